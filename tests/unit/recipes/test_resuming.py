"""Builds that go on: what is missing is made and nothing else, and never with another recipe or software."""

from __future__ import annotations

import errno
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from rfgen_sionna.dataset import open_dataset
from rfgen_sionna.dataset.schema import software_versions
from rfgen_sionna.dataset.store import OutputError
from rfgen_sionna.recipes import set_facts
from rfgen_sionna.recipes.building import BuildError, build_dataset
from rfgen_sionna.recipes.building_folder import BUILDING, BuildingFolder
from rfgen_sionna.recipes.recipe import Recipe
from rfgen_sionna.recipes.repairing import verify_dataset
from rfgen_sionna.recipes.set_facts import PROCESSOR, SetFacts
from tests.unit.recipes.noise_job import NOISE_COUNT, CrashingEngine, EndingEngine
from tests.unit.recipes.set_contents import contents, copy_of, flipped


@pytest.mark.parametrize("after", [0, 4, NOISE_COUNT])
def test_an_interrupted_build_makes_what_is_missing_and_nothing_else(
    build: Any, whole: Any, tmp_path: Path, after: int
) -> None:
    with suppress(KeyboardInterrupt):
        build(tmp_path / "set", engine=EndingEngine(after))
    assert build(tmp_path / "set").made == NOISE_COUNT - after
    assert contents(tmp_path / "set") == whole


def test_a_deleted_shard_is_made_again(build: Any, tmp_path: Path) -> None:
    build(tmp_path / "set")
    before = contents(tmp_path / "set")
    (tmp_path / "set" / "shard-00001.h5").unlink()
    assert build(tmp_path / "set").made == 3
    assert contents(tmp_path / "set") == before


def test_a_recording_whose_worker_crashed_is_tried_again_by_a_later_call(
    build: Any, whole: Any, tmp_path: Path
) -> None:
    report = build(tmp_path / "set", engine=CrashingEngine())
    assert [(each.number, each.kind) for each in report.failures] == [(4, "crashed")]
    assert len(open_dataset(tmp_path / "set")) == NOISE_COUNT - 1
    assert build(tmp_path / "set").made == 1
    assert contents(tmp_path / "set") == whole


def test_a_full_disk_in_a_worker_stops_the_build_which_goes_on_later(build: Any, whole: Any, tmp_path: Path) -> None:
    with pytest.raises(BuildError, match=r"is full .*rfgen dataset resume"):
        build(tmp_path / "set", full=(4,))
    assert build(tmp_path / "set").made == NOISE_COUNT - 4
    assert contents(tmp_path / "set") == whole


@pytest.mark.parametrize("failing", ["assemble_shard", "write_index", "write_card", "write_sums"])
def test_a_full_disk_in_the_driver_loses_nothing(
    build: Any, whole: Any, tmp_path: Path, monkeypatch: Any, failing: str
) -> None:

    def full(*_: Any, **__: Any) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    where = "building_folder" if failing == "assemble_shard" else "building"
    with monkeypatch.context() as patched:
        patched.setattr(f"rfgen_sionna.recipes.{where}.{failing}", full)
        with pytest.raises(BuildError, match="is full"):
            build(tmp_path / "set")
    assert build(tmp_path / "set").made == (NOISE_COUNT - 3 if failing == "assemble_shard" else 0)
    assert contents(tmp_path / "set") == whole


def test_a_full_disk_at_a_resume_leaves_the_recipe(build: Any, tmp_path: Path, monkeypatch: Any) -> None:
    with suppress(KeyboardInterrupt):
        build(tmp_path / "set", engine=EndingEngine(2))
    before = (tmp_path / "set" / "recipe.toml").read_bytes()

    def full(*_: Any) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    with monkeypatch.context() as patched:
        patched.setattr(Path, "write_bytes", full)
        patched.setattr(Path, "write_text", full)
        with suppress(BuildError):
            build(tmp_path / "set", full=(2,))
    assert (tmp_path / "set" / "recipe.toml").read_bytes() == before


@pytest.mark.parametrize(
    ("engine", "place"), [(EndingEngine(5), 0.3), (CrashingEngine(), 0.9)], ids=["interrupted", "with a failure"]
)
def test_a_resumed_build_does_not_take_a_damaged_shard_as_whole(
    build: Any, whole: Any, tmp_path: Path, engine: Any, place: float
) -> None:
    with suppress(KeyboardInterrupt):
        build(tmp_path / "set", engine=engine)
    shard = tmp_path / "set" / "shard-00000.h5"
    flipped(shard, int(place * shard.stat().st_size))
    build(tmp_path / "set")
    assert contents(tmp_path / "set") == whole
    assert verify_dataset(tmp_path / "set") == []


def test_whole_recordings_of_a_damaged_shard_are_not_made_again(build: Any, tmp_path: Path) -> None:
    build(tmp_path / "set", engine=CrashingEngine())
    shard = tmp_path / "set" / "shard-00000.h5"
    flipped(shard, int(0.5 * shard.stat().st_size))
    for name in ("SHA256SUMS", "index.sqlite"):
        flipped(tmp_path / "set" / name, 100)  # the shard has the digests of its recordings
    assert build(tmp_path / "set").made == 1 + 1
    assert verify_dataset(tmp_path / "set") == []


def test_a_shard_that_was_begun_to_be_noted_is_written_again(
    build: Any, whole: Any, tmp_path: Path, monkeypatch: Any
) -> None:
    """The driver ends between the shard and the note of its digest: the parts are still there."""
    with monkeypatch.context() as patched:
        patched.setattr(BuildingFolder, "note_shard", lambda *_: (_ for _ in ()).throw(KeyboardInterrupt()))
        with pytest.raises(KeyboardInterrupt):
            build(tmp_path / "set")
    flipped(tmp_path / "set" / "shard-00000.h5", 9_000)
    assert build(tmp_path / "set").made == NOISE_COUNT - 3
    assert contents(tmp_path / "set") == whole


def test_a_damaged_state_of_a_build_is_begun_anew(build: Any, whole: Any, tmp_path: Path) -> None:
    with suppress(KeyboardInterrupt):
        build(tmp_path / "set", engine=EndingEngine(5))
    (tmp_path / "set" / BUILDING / "state.sqlite").write_bytes(b"no data base" * 1000)
    assert build(tmp_path / "set").made == NOISE_COUNT - 5  # the shard has the digests of its recordings
    assert contents(tmp_path / "set") == whole


def test_the_ends_of_a_recipes_lines_are_no_matter(balls: Any, tmp_path: Path) -> None:
    recipe, folder = balls
    crlf = Recipe.parse(Recipe.load(recipe).text.replace("\n", "\r\n"), recipe.parent)
    again = copy_of(folder, tmp_path / "set")
    assert build_dataset(crlf, again, resume=True).made == 0
    assert SetFacts.of(crlf).text == (folder / "recipe.toml").read_bytes().decode()


@pytest.mark.parametrize(
    ("edit", "engine"), [(("seed = 5", "seed = 6"), EndingEngine(4)), (("balls", "other balls"), CrashingEngine())]
)
def test_a_recipe_that_was_edited_in_its_set_continues_no_build(
    build: Any, recipe: Recipe, tmp_path: Path, edit: tuple[str, str], engine: Any
) -> None:
    with suppress(KeyboardInterrupt):
        build(tmp_path / "set", engine=engine)
    stored = tmp_path / "set" / "recipe.toml"
    stored.write_text(stored.read_text().replace(*edit, 1))
    edited = replace(recipe, text=stored.read_text())
    edited.__dict__.update(recordings_per_shard=3, digest=recipe.digest)
    with pytest.raises(OutputError, match=r"recipe\.toml was edited"):
        build_dataset(edited, tmp_path / "set", resume=True)


def test_a_build_is_not_continued_with_other_files_software_or_device(
    build: Any, recipe: Recipe, tmp_path: Path, monkeypatch: Any
) -> None:
    with suppress(KeyboardInterrupt):
        build(tmp_path / "set", engine=EndingEngine(4))
    other = replace(recipe)
    other.__dict__.update(recordings_per_shard=3, digest="0" * 64)
    with pytest.raises(OutputError, match=r"a file that the recipe names .* has other contents"):
        build_dataset(other, tmp_path / "set", resume=True)
    with pytest.raises(OutputError, match="the device is cuda instead of cpu"):
        build_dataset(recipe, tmp_path / "set", resume=True, gpus_per_worker=1.0)
    build(tmp_path / "ended")
    monkeypatch.setattr(set_facts, "software_versions", lambda: {**software_versions(), "numpy": "1.0"})
    with pytest.raises(OutputError, match=r"numpy is 1\.0 instead of .*Take the old ones again"):
        build_dataset(recipe, tmp_path / "set", resume=True)
    assert build_dataset(recipe, tmp_path / "ended", resume=True).made == 0
    with pytest.raises(OutputError, match="a file that the recipe names"):
        build_dataset(other, tmp_path / "ended", resume=True)


def test_another_kind_of_processor_is_a_warning(balls: Any, tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    recipe, folder = balls
    again = copy_of(folder, tmp_path / "set")
    build_dataset(recipe, again, resume=True)
    assert not caplog.messages
    (again / PROCESSOR).write_text("a processor of tomorrow")
    build_dataset(recipe, again, resume=True)
    assert "was begun on 'a processor of tomorrow', and this is" in caplog.text
