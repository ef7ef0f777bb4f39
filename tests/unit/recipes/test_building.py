"""Builds: the same bytes for any order and engine; what cannot be made is listed; what is there is kept."""

from __future__ import annotations

import hashlib
import os
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from rfgen_sionna.dataset import open_dataset
from rfgen_sionna.dataset.store import OutputError
from rfgen_sionna.recipes import building_folder
from rfgen_sionna.recipes.building import build_dataset
from rfgen_sionna.recipes.building_folder import BuildingFolder, BusyError
from rfgen_sionna.recipes.recipe import Recipe
from rfgen_sionna.recipes.repairing import verify_dataset
from rfgen_sionna.recipes.set_facts import SetFacts
from tests.unit.recipes.noise_job import NOISE_COUNT, EndingEngine
from tests.unit.recipes.set_contents import contents, sums


def test_a_set_has_all_recordings_and_is_whole(build: Any, tmp_path: Path) -> None:
    report = build(tmp_path / "set")
    assert (report.count, report.made, report.failures) == (NOISE_COUNT, NOISE_COUNT, ())
    assert report.warnings == {"a warning": NOISE_COUNT // 2}
    assert verify_dataset(tmp_path / "set") == []
    recordings = open_dataset(tmp_path / "set")
    assert [row.number for row in recordings.rows] == list(range(NOISE_COUNT))
    assert {row.shard for row in recordings.rows} == {f"shard-{index:05d}.h5" for index in range(3)}
    assert recordings[4].recording["number"] == 4
    assert set(contents(tmp_path / "set")) == {
        "README.md", "SHA256SUMS", "index.sqlite", "recipe.toml", *(row.shard for row in recordings.rows)
    }  # fmt: skip


def test_the_order_changes_no_byte(build: Any, whole: Any, tmp_path: Path) -> None:
    build(tmp_path / "other", numbers=[3, 0, 6, 2, 5, 1, 4])
    assert contents(tmp_path / "other") == whole


def test_two_processes_in_reversed_order_give_the_same_checksums(balls: Any, tmp_path: Path) -> None:
    recipe, folder = balls
    done: list[tuple[int, int]] = []
    build_dataset(recipe, tmp_path / "set", workers=2, order="reversed", progress=lambda *numbers: done.append(numbers))
    assert sums(tmp_path / "set") == sums(folder)
    assert done == [(number, 6) for number in range(7)]
    for line in sums(folder).splitlines()[:-1]:
        digest, _, name = line.partition("  ")
        assert hashlib.sha256((folder / name).read_bytes()).hexdigest() == digest


def test_leftovers_of_killed_workers_are_removed(build: Any, whole: Any, tmp_path: Path) -> None:
    with pytest.raises(KeyboardInterrupt):
        build(tmp_path / "set", engine=EndingEngine(2))
    for name in (".building/worker-host-12/000003.h5", ".building/.000003.h5.partial-12", ".shard-00000.h5.9.tmp"):
        (tmp_path / "set" / name).parent.mkdir(exist_ok=True)
        (tmp_path / "set" / name).write_bytes(b"half")
    build(tmp_path / "set")
    assert contents(tmp_path / "set") == whole


def test_a_whole_set_is_left_as_it_is(build: Any, tmp_path: Path) -> None:
    build(tmp_path / "set")
    before = {path: path.stat().st_mtime_ns for path in (tmp_path / "set").iterdir()}
    assert build(tmp_path / "set", impossible=tuple(range(NOISE_COUNT))).made == 0
    assert {path: path.stat().st_mtime_ns for path in (tmp_path / "set").iterdir()} == before


def test_what_cannot_be_made_is_listed_with_its_reason_and_seed(build: Any, tmp_path: Path, recipe: Recipe) -> None:
    report = build(tmp_path / "set", impossible=(1, 6))
    assert report.count == NOISE_COUNT - 2
    failures = open_dataset(tmp_path / "set").failures
    assert [(each.number, each.kind, each.reason) for each in failures] == [
        (number, "impossible", "somebody is in a wall") for number in (1, 6)
    ]
    assert [each.seed for each in failures] == [recipe.recording(number).seed for number in (1, 6)]
    assert build(tmp_path / "set").made == 0
    assert verify_dataset(tmp_path / "set") == []


def test_a_second_driver_is_refused(build: Any, tmp_path: Path, recipe: Recipe) -> None:
    state = BuildingFolder(tmp_path, SetFacts.of(recipe))
    with state.locked(), pytest.raises(BusyError, match=rf"is being built by process {os.getpid()} on"):
        build(tmp_path)
    assert build(tmp_path).made == NOISE_COUNT


def test_the_lock_of_an_ended_build_is_none(build: Any, tmp_path: Path, recipe: Recipe, monkeypatch: Any) -> None:
    """A driver waits at the lock while the other one ends and removes its folder."""
    state = BuildingFolder(tmp_path, SetFacts.of(recipe))
    lock = building_folder._lock
    ended: list[bool] = []

    def ends(*arguments: Any) -> None:
        lock(*arguments)
        if not ended:
            ended.append(True)
            state.remove()

    monkeypatch.setattr(building_folder, "_lock", ends)
    with state.locked(), pytest.raises(BusyError):
        build(tmp_path)
    assert ended


def test_a_folder_of_something_else_is_refused(tmp_path: Path, recipe: Recipe, build: Any) -> None:
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "thesis.tex").touch()
    for resume in (False, True):
        with pytest.raises(OutputError, match="is not empty: choose another folder"):
            build_dataset(recipe, tmp_path / "mine", resume=resume)
    build(tmp_path / "set")
    with pytest.raises(OutputError, match=r"holds a set: resume=True"):
        build_dataset(recipe, tmp_path / "set")
    other = replace(recipe, text=recipe.text + "# another\n")
    with pytest.raises(OutputError, match="a set of another recipe"):
        build_dataset(other, tmp_path / "set", resume=True)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"order": "sideways"}, "order is 'sideways'"),
        ({"order": [0, 0, 1]}, "all numbers from 0 to 6"),
        ({"engine": "slurm"}, "engine is 'slurm': 'processes' or 'ray'"),
        ({"address": "auto"}, "address is 'auto', which belongs to the engine 'ray'"),
        ({"workers": 0}, "workers is 0"),
        ({"time_limit": 0.0}, r"time_limit is 0\.0: more than 0 s"),
        ({"time_limit": 9.0, "engine": "ray"}, r"time_limit is 9\.0, which belongs to the engine 'processes'"),
        ({"gpus_per_worker": -1.0}, r"gpus_per_worker is -1\.0"),
    ],
)
def test_arguments_are_checked_before_any_work(recipe: Recipe, tmp_path: Path, options: Any, said: str) -> None:
    with pytest.raises(ValueError, match=said):
        build_dataset(recipe, tmp_path / "set", **options)
    assert not (tmp_path / "set").exists()
