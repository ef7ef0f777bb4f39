"""Builds: the same bytes for any order, engine and interruption; what cannot be made is listed, and nothing is lost."""

from __future__ import annotations

import errno
import hashlib
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Generator, Iterable
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from rfgen_sionna.dataset import open_dataset, whole_files
from rfgen_sionna.dataset.schema import software_versions
from rfgen_sionna.dataset.store import OutputError
from rfgen_sionna.dataset.whole_files import write_whole
from rfgen_sionna.radar import Radar
from rfgen_sionna.recipes import building_folder, set_facts
from rfgen_sionna.recipes.building import BuildError, BuildReport, build_dataset, run_build
from rfgen_sionna.recipes.building_folder import BUILDING, BuildingFolder, BusyError
from rfgen_sionna.recipes.outcome import Job, Outcome
from rfgen_sionna.recipes.process_engine import LocalProcesses
from rfgen_sionna.recipes.recipe import Recipe
from rfgen_sionna.recipes.recording_job import RecordingJob
from rfgen_sionna.recipes.repairing import repair_dataset, verify_dataset
from rfgen_sionna.recipes.set_facts import SetFacts
from tests.unit.recipes.noise_job import InlineEngine, NoiseJob
from tests.unit.recipes.small_recipes import write_small_recipe

COUNT = 7


@pytest.fixture(scope="module")
def recipe(tmp_path_factory: pytest.TempPathFactory) -> Recipe:
    """Recipe of `COUNT` recordings in shards of three, with which :class:`NoiseJob` makes runs of noise."""
    read = Recipe.load(write_small_recipe(tmp_path_factory.mktemp("recipe"), COUNT, shard_size="2 MB"))
    read.__dict__["recordings_per_shard"] = 3
    return read


@pytest.fixture(scope="module")
def radar(tiny_toml: Path) -> Radar:
    return Radar.load(tiny_toml)


@pytest.fixture
def build(recipe: Recipe, radar: Radar) -> Callable[..., BuildReport]:
    """Builds runs of noise in a folder."""

    def made(folder: Path, *, engine: Any = None, numbers: Iterable[int] | None = None, **options: Any) -> BuildReport:
        folder.mkdir(exist_ok=True)
        state = BuildingFolder(folder, SetFacts.of(recipe))
        with state.locked():
            job = NoiseJob(recipe, state.path, radar, **options)
            order = range(COUNT) if numbers is None else numbers
            return run_build(state, engine or InlineEngine(), job, order, lambda done, failed: None)

    return made


def contents(folder: Path) -> dict[str, bytes]:
    """All files of a set."""
    return {path.name: path.read_bytes() for path in folder.iterdir() if not path.name.startswith(".")}


class EndingEngine:
    """Ends after a number of recordings as a killed driver does: nothing more is run."""

    def __init__(self, count: int) -> None:
        self.count = count

    def outcomes(self, job: Job, numbers: Iterable[int]) -> Generator[Outcome, None, None]:
        for done, number in enumerate(numbers):
            if done == self.count:
                raise KeyboardInterrupt
            yield job(number)


def test_a_set_has_all_recordings_and_is_whole(build: Any, tmp_path: Path) -> None:
    report = build(tmp_path / "set")
    assert (report.count, report.made, report.failures) == (COUNT, COUNT, ())
    assert report.warnings == {"a warning": COUNT // 2}
    assert verify_dataset(tmp_path / "set") == []
    recordings = open_dataset(tmp_path / "set")
    assert [row.number for row in recordings.rows] == list(range(COUNT))
    assert {row.shard for row in recordings.rows} == {f"shard-{index:05d}.h5" for index in range(3)}
    assert recordings[4].recording["number"] == 4
    assert set(contents(tmp_path / "set")) == {
        "README.md", "SHA256SUMS", "index.sqlite", "recipe.toml", *(row.shard for row in recordings.rows)
    }  # fmt: skip


@pytest.mark.parametrize("numbers", [range(COUNT)[::-1], [3, 0, 6, 2, 5, 1, 4]])
def test_the_order_changes_no_byte(build: Any, tmp_path: Path, numbers: Any) -> None:
    build(tmp_path / "forward")
    build(tmp_path / "other", numbers=numbers)
    assert contents(tmp_path / "forward") == contents(tmp_path / "other")


def test_processes_change_no_byte(build: Any, tmp_path: Path) -> None:
    build(tmp_path / "here")
    build(tmp_path / "there", engine=LocalProcesses(2))
    assert contents(tmp_path / "here") == contents(tmp_path / "there")


@pytest.mark.parametrize("after", [0, 1, 3, 5, COUNT])
def test_an_interrupted_build_makes_what_is_missing_and_nothing_else(build: Any, tmp_path: Path, after: int) -> None:
    build(tmp_path / "whole")
    with suppress(KeyboardInterrupt):
        build(tmp_path / "set", engine=EndingEngine(after))
    assert build(tmp_path / "set").made == COUNT - after
    assert contents(tmp_path / "set") == contents(tmp_path / "whole")


def test_leftovers_of_killed_workers_are_removed(build: Any, tmp_path: Path) -> None:
    build(tmp_path / "whole")
    with pytest.raises(KeyboardInterrupt):
        build(tmp_path / "set", engine=EndingEngine(2))
    for name in (".building/worker-host-12/000003.h5", ".building/.000003.h5.partial-12", ".shard-00000.h5.9.tmp"):
        (tmp_path / "set" / name).parent.mkdir(exist_ok=True)
        (tmp_path / "set" / name).write_bytes(b"half")
    build(tmp_path / "set")
    assert contents(tmp_path / "set") == contents(tmp_path / "whole")


def test_a_whole_set_is_left_as_it_is(build: Any, tmp_path: Path) -> None:
    build(tmp_path / "set")
    before = {path: path.stat().st_mtime_ns for path in (tmp_path / "set").iterdir()}
    assert build(tmp_path / "set", impossible=tuple(range(COUNT))).made == 0
    assert {path: path.stat().st_mtime_ns for path in (tmp_path / "set").iterdir()} == before


def test_a_deleted_shard_is_made_again(build: Any, tmp_path: Path) -> None:
    build(tmp_path / "set")
    before = contents(tmp_path / "set")
    (tmp_path / "set" / "shard-00001.h5").unlink()
    assert build(tmp_path / "set").made == 3
    assert contents(tmp_path / "set") == before


def test_what_cannot_be_made_is_listed_with_its_reason_and_seed(build: Any, tmp_path: Path, recipe: Recipe) -> None:
    report = build(tmp_path / "set", impossible=(1, 6))
    assert report.count == COUNT - 2
    failures = open_dataset(tmp_path / "set").failures
    assert [(each.number, each.kind, each.reason) for each in failures] == [
        (number, "impossible", "somebody is in a wall") for number in (1, 6)
    ]
    assert [each.seed for each in failures] == [recipe.recording(number).seed for number in (1, 6)]
    assert build(tmp_path / "set").made == 0
    assert verify_dataset(tmp_path / "set") == []


class CrashingEngine:
    """Reports one recording as one whose worker crashed."""

    def outcomes(self, job: Job, numbers: Iterable[int]) -> Generator[Outcome, None, None]:
        for number in numbers:
            yield Outcome(number, "crashed", "signal SIGKILL") if number == 4 else job(number)


def test_a_recording_whose_worker_crashed_is_tried_again_by_a_later_call(build: Any, tmp_path: Path) -> None:
    build(tmp_path / "whole")
    report = build(tmp_path / "set", engine=CrashingEngine())
    assert [(each.number, each.kind) for each in report.failures] == [(4, "crashed")]
    assert len(open_dataset(tmp_path / "set")) == COUNT - 1
    assert build(tmp_path / "set").made == 1
    assert contents(tmp_path / "set") == contents(tmp_path / "whole")


def test_a_full_disk_in_a_worker_stops_the_build_which_goes_on_later(build: Any, tmp_path: Path) -> None:
    build(tmp_path / "whole")
    with pytest.raises(BuildError, match=r"is full .*rfgen dataset resume"):
        build(tmp_path / "set", full=(4,))
    assert build(tmp_path / "set").made == COUNT - 4
    assert contents(tmp_path / "set") == contents(tmp_path / "whole")


@pytest.mark.parametrize("failing", ["assemble_shard", "write_index", "write_card", "write_sums"])
def test_a_full_disk_in_the_driver_loses_nothing(build: Any, tmp_path: Path, monkeypatch: Any, failing: str) -> None:
    build(tmp_path / "whole")

    def full(*_: Any, **__: Any) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    where = "building_folder" if failing == "assemble_shard" else "building"
    with monkeypatch.context() as patched:
        patched.setattr(f"rfgen_sionna.recipes.{where}.{failing}", full)
        with pytest.raises(BuildError, match="is full"):
            build(tmp_path / "set")
    assert build(tmp_path / "set").made == (COUNT - 3 if failing == "assemble_shard" else 0)
    assert contents(tmp_path / "set") == contents(tmp_path / "whole")


def test_a_second_driver_is_refused(build: Any, tmp_path: Path, recipe: Recipe) -> None:
    state = BuildingFolder(tmp_path, SetFacts.of(recipe))
    with state.locked(), pytest.raises(BusyError, match=rf"is being built by process {os.getpid()} on"):
        build(tmp_path)
    assert build(tmp_path).made == COUNT


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
        ({"gpus_per_worker": -1.0}, r"gpus_per_worker is -1\.0"),
    ],
)
def test_arguments_are_checked_before_any_work(recipe: Recipe, tmp_path: Path, options: Any, said: str) -> None:
    with pytest.raises(ValueError, match=said):
        build_dataset(recipe, tmp_path / "set", **options)
    assert not list(tmp_path.glob("set/shard*"))


def flipped(path: Path, place: int) -> None:
    """Change one bit of a file."""
    data = bytearray(path.read_bytes())
    data[place % len(data)] ^= 4
    path.write_bytes(data)


@pytest.mark.parametrize(
    "files", [["README.md"], ["recipe.toml"], ["index.sqlite"], ["SHA256SUMS"], ["recipe.toml", "SHA256SUMS"]]
)
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


@pytest.mark.parametrize("place", [0.3, 0.6, 0.9])
@pytest.mark.parametrize("engine", [EndingEngine(5), CrashingEngine()], ids=["interrupted", "with a failure"])
def test_a_resumed_build_does_not_take_a_damaged_shard_as_whole(
    build: Any, tmp_path: Path, engine: Any, place: float
) -> None:
    build(tmp_path / "whole")
    with suppress(KeyboardInterrupt):
        build(tmp_path / "set", engine=engine)
    shard = tmp_path / "set" / "shard-00000.h5"
    flipped(shard, int(place * shard.stat().st_size))
    build(tmp_path / "set")
    assert contents(tmp_path / "set") == contents(tmp_path / "whole")
    assert verify_dataset(tmp_path / "set") == []


def test_whole_recordings_of_a_damaged_shard_are_not_made_again(build: Any, tmp_path: Path) -> None:
    build(tmp_path / "set", engine=CrashingEngine())
    shard = tmp_path / "set" / "shard-00000.h5"
    flipped(shard, int(0.5 * shard.stat().st_size))
    for name in ("SHA256SUMS", "index.sqlite"):
        flipped(tmp_path / "set" / name, 100)  # the shard has the digests of its recordings
    assert build(tmp_path / "set").made == 1 + 1
    assert verify_dataset(tmp_path / "set") == []


def test_a_shard_that_was_begun_to_be_noted_is_written_again(build: Any, tmp_path: Path, monkeypatch: Any) -> None:
    """The driver ends between the shard and the note of its digest: the parts are still there."""
    build(tmp_path / "whole")
    with monkeypatch.context() as patched:
        patched.setattr(BuildingFolder, "note_shard", lambda *_: (_ for _ in ()).throw(KeyboardInterrupt()))
        with pytest.raises(KeyboardInterrupt):
            build(tmp_path / "set")
    flipped(tmp_path / "set" / "shard-00000.h5", 9_000)
    assert build(tmp_path / "set").made == COUNT - 3
    assert contents(tmp_path / "set") == contents(tmp_path / "whole")


def test_a_damaged_state_of_a_build_is_begun_anew(build: Any, tmp_path: Path) -> None:
    build(tmp_path / "whole")
    with suppress(KeyboardInterrupt):
        build(tmp_path / "set", engine=EndingEngine(5))
    (tmp_path / "set" / BUILDING / "state.sqlite").write_bytes(b"no data base" * 1000)
    assert build(tmp_path / "set").made == COUNT - 5  # the shard has the digests of its recordings
    assert contents(tmp_path / "set") == contents(tmp_path / "whole")


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


def test_a_small_file_is_written_whole_or_not_at_all(tmp_path: Path, monkeypatch: Any) -> None:
    path = tmp_path / "recipe.toml"
    write_whole(path, "old")
    written = path.stat().st_mtime_ns, path.stat().st_ino
    write_whole(path, "old")
    assert (path.stat().st_mtime_ns, path.stat().st_ino) == written

    def full(*_: Any) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(whole_files, "synced", full)
    with pytest.raises(OSError, match="No space"):
        write_whole(path, "new")
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


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


def test_the_ends_of_a_recipes_lines_are_no_matter(balls: Any, tmp_path: Path) -> None:
    recipe, folder = balls
    crlf = Recipe.parse(Recipe.load(recipe).text.replace("\n", "\r\n"), recipe.parent)
    again = copy_of(folder, tmp_path / "set")
    assert build_dataset(crlf, again, resume=True).made == 0
    assert SetFacts.of(crlf).text == (folder / "recipe.toml").read_bytes().decode()


@pytest.mark.parametrize("edit", [("seed = 5", "seed = 6"), ("balls", "other balls")])
@pytest.mark.parametrize("engine", [EndingEngine(4), CrashingEngine()], ids=["interrupted", "with a failure"])
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


@pytest.mark.parametrize("options", [{"workers": 0}, {"engine": "slurm"}, {"order": "sideways"}])
def test_a_wrong_argument_leaves_nothing(tmp_path: Path, options: Any) -> None:
    recipe = write_small_recipe(tmp_path / "recipe")
    with pytest.raises(ValueError, match=r"(is|are) needed"):
        build_dataset(recipe, tmp_path / "set", **options)
    assert not (tmp_path / "set").exists()


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


# The whole of it, made by the package's own job.


@pytest.fixture(scope="module")
def balls(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """Recipe of six recordings of balls, and the set that one process makes of it."""
    folder = tmp_path_factory.mktemp("balls")
    recipe = write_small_recipe(folder / "recipe")
    report = build_dataset(recipe, folder / "set", workers=1)
    assert (report.count, report.failures) == (6, ())
    return recipe, folder / "set"


def copy_of(folder: Path, target: Path) -> Path:
    target.mkdir()
    for path in folder.iterdir():
        (target / path.name).write_bytes(path.read_bytes())
    return target


def sums(folder: Path) -> str:
    return (folder / "SHA256SUMS").read_text()


def test_two_processes_in_reversed_order_give_the_same_checksums(balls: Any, tmp_path: Path) -> None:
    recipe, folder = balls
    done: list[tuple[int, int]] = []
    build_dataset(recipe, tmp_path / "set", workers=2, order="reversed", progress=lambda *numbers: done.append(numbers))
    assert sums(tmp_path / "set") == sums(folder)
    assert done == [(number, 6) for number in range(7)]
    for line in sums(folder).splitlines()[:-1]:
        digest, _, name = line.partition("  ")
        assert hashlib.sha256((folder / name).read_bytes()).hexdigest() == digest


def test_a_damaged_shard_gets_its_old_bytes_back(balls: Any, tmp_path: Path) -> None:
    recipe, folder = balls
    damaged = copy_of(folder, tmp_path / "set")
    shard = damaged / "shard-00000.h5"
    flipped(shard, shard.stat().st_size // 2)
    found = verify_dataset(damaged)
    assert [each.file for each in found] == ["shard-00000.h5"]
    report = repair_dataset(damaged, recipe, workers=1)
    assert report is not None
    assert report.made == len(found[0].recordings)
    assert contents(damaged) == contents(folder)


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


def driver(recipe: Path, folder: Path) -> subprocess.Popen[bytes]:
    """A build in a process of its own."""
    arguments = f"{str(recipe)!r}, {str(folder)!r}, workers=2, resume=True"
    code = f"from rfgen_sionna.recipes import building; building.build_dataset({arguments})"
    return subprocess.Popen([sys.executable, "-c", code], stderr=subprocess.DEVNULL)


def workers_of(pid: int) -> list[int]:
    """Processes that a driver has started."""
    found = []
    for path in Path("/proc").glob("[0-9]*/stat"):
        try:
            if int(path.read_text().rpartition(")")[2].split()[1]) == pid:
                found.append(int(path.parent.name))
        except OSError:
            continue
    return found


def killed_once(recipe: Path, folder: Path, made: int, delay: float, a_worker: bool) -> None:
    """Begin or continue a build, and kill the driver, or one of its workers, some time [s] after so many recordings."""
    running = driver(recipe, folder)
    while running.poll() is None:
        shards, parts = list(folder.glob("shard-*.h5")), list((folder / BUILDING).glob("[0-9]*.h5"))
        if 4 * len(shards) + len(parts) >= made and workers_of(running.pid):
            break
        time.sleep(0.02)
    time.sleep(delay)
    for victim in (workers_of(running.pid) if a_worker else [running.pid])[:1]:
        with suppress(ProcessLookupError):
            os.kill(victim, signal.SIGKILL)
    running.wait(600)


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
def test_twenty_kills_lose_nothing_and_make_nothing_twice(balls: Any, tmp_path: Path) -> None:
    import random

    recipe, folder = balls
    drawn = random.Random(7)
    for run in range(20):
        target = tmp_path / f"set-{run}"
        killed_once(recipe, target, drawn.randrange(6), drawn.uniform(0.0, 2.0), a_worker=bool(run % 2))
        build_dataset(recipe, target, workers=2, resume=True)
        assert contents(target) == contents(folder), run


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
def test_ray_gives_the_same_checksums(balls: Any, tmp_path: Path) -> None:
    pytest.importorskip("ray")
    recipe, folder = balls
    build_dataset(recipe, tmp_path / "set", workers=2, engine="ray")
    assert sums(tmp_path / "set") == sums(folder)


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux" or os.geteuid() != 0, reason="mounts a file system")
@pytest.mark.parametrize("size", ["200k", "360k"])
def test_a_build_on_a_full_disk_goes_on_with_space(balls: Any, tmp_path: Path, size: str) -> None:
    """The small disk ends in a worker, the larger one in the driver's first shard."""
    recipe, folder = balls
    small = tmp_path / "small"
    small.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", f"size={size}", "tmpfs", str(small)]
    if subprocess.run(mount, capture_output=True, check=False).returncode:
        pytest.skip("no right to mount")
    try:
        with pytest.raises(BuildError, match=r"is full"):
            build_dataset(recipe, small / "set", workers=2)
        made = len(list((small / "set" / BUILDING).glob("[0-9]*.h5")))
        assert made >= 1
        subprocess.run(["mount", "-o", "remount,size=100m", str(small)], check=True)
        assert build_dataset(recipe, small / "set", workers=2, resume=True).made == 6 - made
        assert contents(small / "set") == contents(folder)
    finally:
        subprocess.run(["umount", "-l", str(small)], check=False)
