"""Work that is split among forked processes."""

import logging
import os
import signal
import subprocess
import sys
import time
import warnings
from multiprocessing import current_process
from threading import Event, Thread, Timer

import numpy as np
import pytest

from rfgen_sionna.parallel import one_blas_thread
from rfgen_sionna.processes import check_workers, map_in_processes

RUNS = [range(1, 4), range(4, 5), range(5, 9), range(9, 12)]


class PeculiarError(Exception):
    """One that can't be made again of what it says."""

    def __init__(self, first: int, second: int) -> None:
        super().__init__(f"{first} and {second}")


def alive(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    return True


@pytest.mark.parametrize("workers", [2, 3, 9])
def test_results_come_in_order_from_other_processes_that_know_all_there_was(workers):
    known, offset = np.arange(20.0), 0.25

    def job(number):
        time.sleep(0.02 * (number % 3))
        return number, known[number] + offset, os.getpid()

    found = list(map_in_processes(job, RUNS, workers))
    assert [each[:2] for each in found] == [(number, number + offset) for number in range(1, 12)]
    assert os.getpid() not in {each[2] for each in found}
    assert len({each[2] for each in found}) == len(RUNS)  # each run has one of its own
    assert not any(alive(each[2]) for each in found)


def test_more_than_a_pipe_holds():
    """Those that are not at turn would wait until somebody takes what they send."""
    found = list(map_in_processes(lambda number: np.full(300_000, number), RUNS, 2))
    assert [each[-1] for each in found] == list(range(1, 12))


def test_so_many_work_at_a_time():
    def job(number):
        begun = time.monotonic()
        time.sleep(0.1)
        return begun, time.monotonic()

    spans = list(map_in_processes(job, [range(k, k + 1) for k in range(8)], 3))
    most = max(sum(begin <= t < end for begin, end in spans) for t, _ in spans)
    assert most <= 3


def test_what_was_made_before_a_failure_is_handed_over():
    def job(number):
        if number == 5:
            raise KeyError("five")
        return number

    found = []
    with pytest.raises(KeyError, match="five") as caught:
        found.extend(map_in_processes(job, RUNS, 3))
    assert found == [1, 2, 3, 4]
    assert any("test_processes.py" in note and "In another process" in note for note in caught.value.__notes__)


def test_errors_that_can_t_be_sent_say_the_same():
    def job(number):
        raise PeculiarError(1, 2)

    with pytest.raises(RuntimeError, match="PeculiarError: 1 and 2"):
        list(map_in_processes(job, RUNS, 2))


def test_a_process_that_is_killed_is_told_of():
    def job(number):
        if number == 6:
            os.kill(os.getpid(), signal.SIGKILL)
        return number

    found = []
    with pytest.raises(RuntimeError, match=r"frames 5 … 8 ended with -9 .*memory"):
        found.extend(map_in_processes(job, RUNS, 2))
    assert found == [1, 2, 3, 4, 5]


def test_a_process_that_is_killed_while_it_tells_something():
    """In the middle of what it tells, which is more than a pipe holds."""

    def job(number):
        return os.getpid() if number == 1 else np.zeros(2_000_000)

    results = map_in_processes(job, [range(1, 3)], 1)
    process = next(results)
    time.sleep(0.5)
    os.kill(process, signal.SIGKILL)
    with pytest.raises(RuntimeError, match="ended with -9"):
        next(results)


@pytest.mark.parametrize("handler", [signal.SIG_IGN, lambda *_: None])
def test_nobody_works_on_where_signals_are_handled(handler):
    """What the application makes of SIGTERM is not what ends processes, nor do they tell it of any."""

    def job(number):
        if number > 1:
            time.sleep(60)
        return os.getpid()

    before = signal.signal(signal.SIGTERM, handler)
    try:
        results = map_in_processes(job, RUNS, 2)
        next(results)
        begun = time.monotonic()
        results.close()
        assert time.monotonic() - begun < 4.0
    finally:
        signal.signal(signal.SIGTERM, before)


def test_processes_go_with_one_that_is_killed():
    script = """
import os, time
from rfgen_sionna.parallel import one_blas_thread
from rfgen_sionna.processes import map_in_processes
def job(number):
    os.write(1, b"%d\\n" % os.getpid())  # in one piece
    time.sleep(60)
list(map_in_processes(job, [range(2), range(2, 4)], 2))
"""
    with subprocess.Popen([sys.executable, "-c", script], stdout=subprocess.PIPE, text=True) as parent:
        children = [int(parent.stdout.readline()) for _ in range(2)]
        parent.kill()
        end = time.monotonic() + 10.0
        while any(map(alive, children)) and time.monotonic() < end:
            time.sleep(0.05)
    assert not any(map(alive, children))


def test_nothing_is_forked_while_another_thread_works():
    """What it holds would never be let go in the child."""
    working, free = Event(), Event()

    def work():
        with one_blas_thread():
            working.set()
            free.wait(30)

    def job(number):
        with one_blas_thread():  # not held by a thread that is not there
            return free.is_set()

    thread = Thread(target=work)
    thread.start()
    working.wait(30)
    Timer(0.3, free.set).start()
    assert list(map_in_processes(job, [range(1)], 2)) == [True]
    thread.join()


def test_nobody_works_on_for_one_who_leaves():
    def job(number):
        if number > 1:
            time.sleep(60)
        return os.getpid()

    results = map_in_processes(job, RUNS, 2)
    first = next(results)
    assert alive(first)
    results.close()
    assert not alive(first)


def test_logs_and_warnings_come_in_order(caplog):
    def job(number):
        logging.getLogger("rfgen_sionna.somewhere").warning("number %d is logged", number)
        warnings.warn(f"number {number} is warned of", UserWarning, stacklevel=1)
        return number

    with warnings.catch_warnings(record=True) as heard:
        warnings.simplefilter("always")
        for number in map_in_processes(job, RUNS, 3):
            assert caplog.messages[-1] == f"number {number} is logged"
            assert str(heard[-1].message) == f"number {number} is warned of"
    assert len(caplog.messages) == len(heard) == 11


class PeculiarWarning(UserWarning):
    """One that can't be made again of what it says."""

    def __init__(self, first: int, second: int) -> None:
        super().__init__(f"{first} and {second}")


def test_warnings_that_are_errors_and_such_as_can_t_be_sent():
    def deprecated(number):
        warnings.warn("old", DeprecationWarning, stacklevel=1)

    def peculiar(number):
        warnings.warn(PeculiarWarning(1, 2), stacklevel=1)
        return number

    with pytest.raises(DeprecationWarning, match="old"):  # as pytest's filters have it
        list(map_in_processes(deprecated, RUNS, 2))
    with pytest.warns(UserWarning, match="PeculiarWarning: 1 and 2"):
        assert list(map_in_processes(peculiar, RUNS[:1], 2)) == [1, 2, 3]


@pytest.mark.parametrize("workers", [0, -1, True, 1.0, "2", None])
def test_numbers_of_workers_that_are_none(workers):
    with pytest.raises(ValueError, match=r"workers is .* a whole number of at least 1"):
        check_workers(workers)


def test_where_nothing_can_be_forked_one_works(monkeypatch):
    assert check_workers(np.int64(2)) == 2
    with monkeypatch.context() as changed:
        changed.setattr(current_process(), "_config", {"daemon": True})
        with pytest.raises(ValueError, match="workers is 2: this is a process of a multiprocessing"):
            check_workers(2)
    with pytest.raises(ValueError, match="workers is 2: a process that uses CUDA"):
        check_workers(2, "cuda")
    monkeypatch.setattr("sys.platform", "darwin")
    with pytest.raises(ValueError, match=r"workers is 2: .* Linux"):
        check_workers(2)
    assert check_workers(1, "cuda") == 1
