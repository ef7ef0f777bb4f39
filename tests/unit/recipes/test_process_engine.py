"""Local processes: each recording once, whatever happens to the processes, which never outlive their driver."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from rfgen_sionna.recipes import process_engine
from rfgen_sionna.recipes.process_engine import LocalProcesses, chosen_workers
from tests.unit.recipes.echo_job import EchoJob


def pids(folder: Path) -> list[int]:
    """Processes that have worked."""
    return [int(path.name.partition("-")[2]) for path in folder.glob("pid-*")]


def is_alive(pid: int) -> bool:
    """Whether a process is there and no zombie."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def test_each_recording_is_made_once_and_no_process_stays(tmp_path: Path) -> None:
    made = list(LocalProcesses(2).outcomes(EchoJob(tmp_path), range(20)))
    assert sorted(each.number for each in made) == list(range(20))
    assert all(each.kind == "made" for each in made)
    assert 1 <= len(pids(tmp_path)) <= 2
    assert not any(map(is_alive, pids(tmp_path)))


def test_a_worker_that_is_killed_loses_no_recording(tmp_path: Path) -> None:
    made = list(LocalProcesses(2).outcomes(EchoJob(tmp_path, {3: 1, 4: 1}), range(6)))
    assert sorted(each.number for each in made) == list(range(6))
    assert all(each.kind == "made" for each in made)


def test_a_recording_that_ends_two_workers_is_a_failure_and_the_others_go_on(tmp_path: Path) -> None:
    made = {each.number: each for each in LocalProcesses(2).outcomes(EchoJob(tmp_path, {2: 9}), range(6))}
    assert sorted(made) == list(range(6))
    assert [number for number, each in made.items() if each.kind == "crashed"] == [2]
    assert "SIGKILL" in made[2].reason
    assert "memory" in made[2].reason
    assert len(list(tmp_path.glob("end-2-*"))) == 2


def test_a_worker_beyond_its_time_is_ended_and_the_others_go_on(tmp_path: Path) -> None:
    engine = LocalProcesses(2, time_limit=4.0)
    made = {each.number: each for each in engine.outcomes(EchoJob(tmp_path, waits={1: 300.0}), range(5))}
    assert sorted(made) == list(range(5))
    assert [(number, each.reason) for number, each in made.items() if each.kind != "made"] == [
        (1, "not made in 4 s (time_limit)")
    ]
    assert made[1].kind == "crashed"  # a later call tries it again
    assert not any(map(is_alive, pids(tmp_path)))


def test_a_worker_above_its_memory_is_replaced(tmp_path: Path) -> None:
    made = list(LocalProcesses(1, max_memory=1).outcomes(EchoJob(tmp_path), range(3)))
    assert len({each.reason for each in made}) == 3


def test_a_worker_that_cannot_start_is_an_error_not_a_failed_recording(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setattr(LocalProcesses, "_environment", lambda self: {"PATH": os.environ["PATH"], "PYTHONHOME": "/x"})
    with pytest.raises(RuntimeError, match=r"no worker could start: exit code 1: .*encodings"):
        list(LocalProcesses(2).outcomes(EchoJob(tmp_path), range(3)))


@pytest.mark.parametrize("ended", [1, 2])
def test_a_worker_that_is_killed_before_its_job_ends_no_build(tmp_path: Path, ended: int) -> None:
    made = list(LocalProcesses(1).outcomes(EchoJob(tmp_path, starts_to_end=ended), range(3)))
    assert [(each.number, each.kind) for each in made] == [(number, "made") for number in range(3)]


def test_workers_that_end_at_their_start_are_given_up_with_their_message(tmp_path: Path) -> None:
    with pytest.raises(RuntimeError, match=r"no worker could start: signal SIGKILL.*: MemoryError: no memory for"):
        list(LocalProcesses(1).outcomes(EchoJob(tmp_path, starts_to_end=4), range(3)))


def test_several_idle_workers_take_the_one_recording_that_is_left(tmp_path: Path) -> None:
    job = EchoJob(tmp_path, deadly={0: 1}, waits={0: 1.5})  # its worker ends when the others have nothing to do
    assert sorted(each.number for each in LocalProcesses(3).outcomes(job, range(3))) == [0, 1, 2]


def test_an_iteration_that_is_left_ends_its_processes(tmp_path: Path) -> None:
    outcomes = LocalProcesses(2).outcomes(EchoJob(tmp_path, seconds=0.2), range(100))
    next(outcomes)
    outcomes.close()  # type: ignore[attr-defined]
    assert not any(map(is_alive, pids(tmp_path)))


@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
def test_workers_end_with_their_driver(tmp_path: Path) -> None:
    code = (
        "from pathlib import Path\n"
        "from rfgen_sionna.recipes.process_engine import LocalProcesses\n"
        "from tests.unit.recipes.echo_job import EchoJob\n"
        f"list(LocalProcesses(2).outcomes(EchoJob(Path({str(tmp_path)!r}), seconds=60.0), range(4)))\n"
    )
    driver = subprocess.Popen([sys.executable, "-c", code], env=LocalProcesses(1)._environment())
    try:
        deadline = time.monotonic() + 120.0
        while len(pids(tmp_path)) < 2 and time.monotonic() < deadline:
            time.sleep(0.05)
        assert len(pids(tmp_path)) == 2
        assert all(map(is_alive, pids(tmp_path)))
    finally:
        os.kill(driver.pid, signal.SIGKILL)
        driver.wait()
    deadline = time.monotonic() + 20.0
    while any(map(is_alive, pids(tmp_path))) and time.monotonic() < deadline:
        time.sleep(0.05)
    assert not any(map(is_alive, pids(tmp_path)))


def test_the_number_of_processes_fits_the_memory(monkeypatch, caplog) -> None:
    monkeypatch.setattr(process_engine, "available_memory", lambda: int(2.5 * process_engine.WORKER_MEMORY))
    assert chosen_workers(8) == 2
    assert "room for 2" in caplog.text
    monkeypatch.setattr(process_engine, "available_memory", lambda: 1)
    assert chosen_workers(None) == 1
    monkeypatch.setattr(process_engine, "available_memory", lambda: None)
    assert chosen_workers(3) == 3


@pytest.mark.parametrize("workers", [0, -1, True, 1.5, "2"])
def test_workers_are_a_whole_number(workers) -> None:
    with pytest.raises(ValueError, match="workers is"):
        chosen_workers(workers)
