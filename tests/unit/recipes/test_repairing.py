"""Repairs: damaged files get their old bytes back, and earlier failures stay failures."""

from __future__ import annotations

from collections.abc import Generator, Iterable
from pathlib import Path
from typing import Any

import pytest

from rfgen_sionna.dataset.schema import software_versions
from rfgen_sionna.dataset.store import OutputError
from rfgen_sionna.recipes import set_facts
from rfgen_sionna.recipes.building import run_build
from rfgen_sionna.recipes.building_folder import BuildingFolder
from rfgen_sionna.recipes.outcome import Outcome
from rfgen_sionna.recipes.process_engine import LocalProcesses
from rfgen_sionna.recipes.recipe import Recipe
from rfgen_sionna.recipes.recording_job import RecordingJob
from rfgen_sionna.recipes.repairing import repair_dataset, verify_dataset
from rfgen_sionna.recipes.set_facts import SetFacts
from tests.unit.recipes.noise_job import CrashingEngine, EndingEngine
from tests.unit.recipes.set_contents import contents, copy_of, flipped


@pytest.mark.parametrize("files", [["index.sqlite"], ["README.md", "recipe.toml"], ["recipe.toml", "SHA256SUMS"]])
def test_damaged_small_files_get_their_bytes_back(build: Any, tmp_path: Path, recipe: Recipe, files: list[str]) -> None:
    # an index has the failures, which only the recipe's own job gives again
    build(tmp_path / "set", impossible=() if "index.sqlite" in files else (2,))
    before = contents(tmp_path / "set")
    for name in files:
        flipped(tmp_path / "set" / name, 100)
    assert {each.file for each in verify_dataset(tmp_path / "set")} >= set(files[-1:])
    repair_dataset(tmp_path / "set")  # without the recipe's own files
    assert contents(tmp_path / "set") == before
    assert repair_dataset(tmp_path / "set") is None


class OneFails:
    """Local processes, one of whose recordings counts as crashed."""

    def outcomes(self, job: Any, numbers: Iterable[int]) -> Generator[Outcome, None, None]:
        for outcome in LocalProcesses(1).outcomes(job, numbers):
            if outcome.number == 4:
                (job.folder / "000004.h5").unlink()
            yield outcome if outcome.number != 4 else Outcome(4, "crashed", "signal SIGKILL")


def test_a_repair_makes_what_was_lost_and_keeps_earlier_failures(balls: Any, tmp_path: Path, monkeypatch: Any) -> None:
    recipe = Recipe.load(balls[0])
    (tmp_path / "set").mkdir()
    state = BuildingFolder(tmp_path / "set", SetFacts.of(recipe))
    with state.locked():
        run_build(state, OneFails(), RecordingJob(recipe, state.path), range(6), lambda done, failed: None)
    before = contents(tmp_path / "set")
    shard = tmp_path / "set" / "shard-00000.h5"
    flipped(shard, shard.stat().st_size // 2)
    assert [each.file for each in verify_dataset(tmp_path / "set")] == [shard.name]
    with monkeypatch.context() as patched:
        patched.setattr(set_facts, "software_versions", lambda: {**software_versions(), "numpy": "1.0"})
        with pytest.raises(OutputError, match=r"numpy is 1\.0 instead of"):
            repair_dataset(tmp_path / "set", recipe, workers=1)
    report = repair_dataset(tmp_path / "set", recipe, workers=1)
    assert report is not None
    assert report.made == 1
    assert [each.number for each in report.failures] == [4]
    assert contents(tmp_path / "set") == before


def test_the_set_of_another_recipe_is_not_repaired_with_this_one(balls: Any, tmp_path: Path, recipe: Recipe) -> None:
    damaged = copy_of(balls[1], tmp_path / "set")
    flipped(damaged / "shard-00000.h5", 9_000)
    with pytest.raises(ValueError, match="recipe is another one"):
        repair_dataset(damaged, recipe)


def test_an_unfinished_build_is_resumed_and_not_repaired(build: Any, tmp_path: Path) -> None:
    build(tmp_path / "set", engine=CrashingEngine())
    assert verify_dataset(tmp_path / "set") == []
    with pytest.raises(KeyboardInterrupt):
        build(tmp_path / "set", engine=EndingEngine(0))
    for check in (verify_dataset, repair_dataset):
        with pytest.raises(ValueError, match=r"has not ended: `rfgen dataset resume"):
            check(tmp_path / "set")
    assert build(tmp_path / "set").made == 1
    assert verify_dataset(tmp_path / "set") == []
