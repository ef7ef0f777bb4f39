"""Builds of processes that are killed, of Ray, and on a small disk: the same bytes as without."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest

from rfgen_sionna.recipes.building import BuildError, build_dataset
from rfgen_sionna.recipes.building_folder import BUILDING
from tests.unit.recipes.set_contents import contents, sums


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
