"""Recordings by local processes, one at a time each. A process that ends takes no other recording with it."""

from __future__ import annotations

import json
import logging
import os
import pickle
import re
import selectors
import signal
import subprocess
import sys
import threading
import time
from collections import Counter, deque
from collections.abc import Generator, Iterable
from contextlib import suppress
from typing import Any

from rfgen_sionna.recipes.outcome import Job, Outcome
from rfgen_sionna.recipes.recording_job import ONE_THREAD, WITHOUT_GPU
from rfgen_sionna.recipes.worker_memory import available_memory
from rfgen_sionna.recipes.worker_process import READY

WORKER_MEMORY = 2_000_000_000
"""Memory that a worker is expected to take [bytes]."""
MAX_WORKER_MEMORY = 3_000_000_000
"""Memory above which a worker is replaced by a new one after its recording [bytes]."""
MAX_CRASHES = 2
"""Number of processes that a recording may end before it is a failure."""
MAX_FAILED_STARTS = 3
"""Processes that may end one after another before they have their job; one that starts counts anew."""
PATIENCE = 5.0
"""Time for a process to end after its output did [s]."""
START_PATIENCE = 120.0
"""Time for a process to say why it cannot start [s]."""

_COMMAND = (sys.executable, "-m", "rfgen_sionna.recipes.worker_process")
_FAULT = re.compile(r"[\w.]+(Error|Exception)\b")
_LOG = logging.getLogger(__name__)


def chosen_workers(workers: int | None) -> int:
    """Number of processes: the given one, or one for each core, in either case within the free memory.

    Raises
    ------
    ValueError
        If `workers` is no whole number of at least 1.
    """
    if workers is not None and (isinstance(workers, bool) or not isinstance(workers, int) or workers < 1):
        raise ValueError(f"workers is {workers!r}: a whole number of at least 1 is needed")
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    wanted, free = workers or cores, available_memory()
    fit = wanted if free is None else max(1, int(free // WORKER_MEMORY))
    if workers is not None and fit < wanted:
        _LOG.warning("workers is %d, but the free memory of %.1f GB has room for %d", workers, (free or 0) / 1e9, fit)
    return min(wanted, fit)


class LocalProcesses:
    """Engine of processes on this machine.

    Parameters
    ----------
    workers
        Number of processes; None takes one for each core, within the free memory.
    gpu
        Whether the processes may use a GPU.
    max_memory
        Memory above which a process is replaced after its recording [bytes].
    time_limit
        Time of one recording after which its process is ended [s]; None waits.
    """

    def __init__(
        self,
        workers: int | None = None,
        *,
        gpu: bool = False,
        max_memory: int = MAX_WORKER_MEMORY,
        time_limit: float | None = None,
    ) -> None:
        if time_limit is not None and not time_limit > 0.0:
            raise ValueError(f"time_limit is {time_limit!r}: more than 0 s is needed")
        self.workers, self._gpu, self._max_memory = chosen_workers(workers), gpu, max_memory
        self._time_limit = float("inf") if time_limit is None else time_limit

    def outcomes(self, job: Job, numbers: Iterable[int]) -> Generator[Outcome, None, None]:
        """Outcomes of the recordings, in the order in which they end; at the end of the iteration all processes end.

        Processes that cannot start, such as for want of memory, are fewer from then on.

        Raises
        ------
        RuntimeError
            If none can start, with the message of one.
        """
        pickled = pickle.dumps(job)
        left, crashes = deque(numbers), Counter[int]()
        allowed, failed_starts = self.workers, 0
        workers: list[_WorkerHandle] = []
        with selectors.DefaultSelector() as ready:

            def end(worker: _WorkerHandle, patience: float = 0.0) -> int:
                ready.unregister(worker.answers)
                workers.remove(worker)
                return worker.end(patience)

            try:
                while left or any(each.number is not None for each in workers):
                    for worker in [each for each in workers if each.number is None][: len(left)]:
                        worker.give(left.popleft())
                    while left and len(workers) < allowed:
                        worker = _WorkerHandle(pickled, self._environment())
                        workers.append(worker)
                        ready.register(worker.answers, selectors.EVENT_READ, worker)
                        worker.give(left.popleft())
                    begun = [each.begun for each in workers if each.number is not None]
                    patience = max(0.0, min(begun, default=0.0) + self._time_limit - time.monotonic())
                    for key, _ in ready.select(None if patience == float("inf") else patience):
                        worker, number = key.data, key.data.number
                        line = worker.answers.readline()
                        if line == f"{READY}\n".encode():
                            worker.started, failed_starts, worker.begun = True, 0, time.monotonic()
                        elif line.endswith(b"\n"):
                            outcome = Outcome.from_dict(json.loads(line))
                            worker.number = None
                            if outcome.memory > self._max_memory:
                                end(worker)
                            yield outcome
                        else:
                            started, code = worker.started, end(worker, PATIENCE)
                            if not started:
                                left.appendleft(number)
                                failed_starts += 1
                                if failed_starts >= MAX_FAILED_STARTS:
                                    allowed = len(workers)
                                    if not workers:
                                        raise RuntimeError(self._start_fault(pickled, code))
                            elif number is None:  # between two recordings
                                continue
                            else:
                                crashes[number] += 1
                                if crashes[number] < MAX_CRASHES:
                                    left.appendleft(number)
                                else:
                                    yield Outcome(number, "crashed", f"{MAX_CRASHES} workers ended: {_exit_text(code)}")
                    late = time.monotonic() - self._time_limit
                    for worker, number in [(each, each.number) for each in workers if each.begun < late]:
                        if number is not None:
                            end(worker)
                            yield Outcome(number, "crashed", f"not made in {self._time_limit:g} s (time_limit)")
            finally:
                for worker in list(workers):
                    end(worker)

    def _start_fault(self, job: bytes, code: int) -> str:
        """What a process says that starts and ends at once; `code` is the exit code of the last one."""
        with suppress(subprocess.TimeoutExpired):
            done = subprocess.run(
                _COMMAND, input=_message(job), capture_output=True, env=self._environment(), timeout=START_PATIENCE,
                check=False,
            )  # fmt: skip
            said = done.stderr.decode(errors="replace").strip().splitlines()
            if done.returncode and said:
                faults = [line for line in said if _FAULT.match(line)]
                return f"no worker could start: {_exit_text(code)}: {(faults or said)[-1][:500]}"
        return f"no worker could start: {_exit_text(code)}"

    def _environment(self) -> dict[str, str]:
        path = os.pathsep.join(each or os.getcwd() for each in sys.path)
        return {**os.environ, **ONE_THREAD, **({} if self._gpu else WITHOUT_GPU), "PYTHONPATH": path}


def _exit_text(code: int) -> str:
    if code >= 0:
        return f"exit code {code}"
    name = signal.Signals(-code).name if -code in list(signal.Signals) else str(code)
    return f"signal {name}" + (", often want of memory: take fewer workers" if name == "SIGKILL" else "")


def _message(job: bytes) -> bytes:
    """The job as a process reads it."""
    return f"{len(job)}\n".encode() + job


class _WorkerHandle:
    """One process, seen from the driver."""

    def __init__(self, job: bytes, environment: dict[str, str]) -> None:
        # Linux ends a process with the thread that started it, which only the main thread outlives.
        flags = ["--end-with-parent"] if threading.current_thread() is threading.main_thread() else []
        command = [*_COMMAND, *flags]
        self._process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, env=environment, bufsize=0
        )
        self.number: int | None = None
        self.started, self.begun = False, float("inf")
        self.answers: Any = self._process.stdout
        self._send(_message(job))

    def give(self, number: int) -> None:
        """Let it make a recording."""
        self.number = number
        if self.started:
            self.begun = time.monotonic()
        self._send(f"{number}\n".encode())

    def _send(self, data: bytes) -> None:
        stream: Any = self._process.stdin
        with suppress(BrokenPipeError):  # its end is seen at its answers
            while data:
                data = data[stream.write(data) :]

    def end(self, patience: float) -> int:
        """End it, and return its exit code; it is killed after the patience [s]."""
        for stream in (self._process.stdin, self._process.stdout):
            if stream is not None:
                with suppress(OSError):
                    stream.close()
        with suppress(subprocess.TimeoutExpired):
            return self._process.wait(patience)
        self._process.kill()
        return self._process.wait()
