"""Numbered work, split among forked processes.

Python runs one thread at a time, so threads hardly speed up tracing. A forked process shares scenes, functions and
compiled kernels with its parent.
"""

from __future__ import annotations

import gc
import logging
import logging.handlers
import os
import pickle
import signal
import sys
import traceback
import warnings
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from enum import Enum, auto
from multiprocessing import current_process, get_context
from multiprocessing.connection import Connection, wait
from multiprocessing.reduction import ForkingPickler
from queue import SimpleQueue
from signal import SIG_DFL, SIG_IGN, SIGHUP, SIGINT, SIGTERM
from threading import Thread
from typing import Any, TypeVar

import numpy as np
from threadpoolctl import threadpool_limits

from rfgen_sionna.parallel import no_blas_users, reset_after_fork
from rfgen_sionna.scene.mitsuba_backend import may_use_cuda, without_threads

T = TypeVar("T")
MAX_FINISHED = 1
"""Most finished runs whose results wait for their turn: bounds memory."""

_JOIN_TIMEOUT = 5.0
"""Time for a process to end before it is killed [s]."""


class _Message(Enum):
    """Kind of a message from a process."""

    MADE = auto()
    LOGGED = auto()
    WARNED = auto()
    FAILED = auto()
    OVER = auto()


def check_workers(workers: Any, device: str = "cpu") -> int:
    """Checked number of processes for sums on `device`.

    Raises
    ------
    ValueError
        If `workers` is no whole number of at least 1, or more than 1 where processes can't be forked.
    """
    if isinstance(workers, bool) or not isinstance(workers, (int, np.integer)) or workers < 1:
        raise ValueError(f"workers is {workers!r}: a whole number of at least 1 is needed")
    if workers > 1 and sys.platform != "linux":
        raise ValueError(f"workers is {workers}: processes are forked, which is safe on Linux alone; 1 is allowed here")
    if workers > 1 and (device == "cuda" or may_use_cuda()):
        raise ValueError(
            f"workers is {workers}: a process that uses CUDA can't be forked. 1 is allowed, and more on the CPU: with "
            "the environment variable CUDA_VISIBLE_DEVICES empty, or with device='cpu' after "
            "mitsuba.set_variant('llvm_ad_mono_polarized')"
        )
    if workers > 1 and current_process().daemon:
        raise ValueError(
            f"workers is {workers}: this is a process of a multiprocessing.Pool or a DataLoader, which can't start "
            "processes; 1 is allowed here"
        )
    return int(workers)


def map_in_processes(job: Callable[[int], T], runs: Sequence[range], workers: int) -> Iterator[T]:
    """Results of `job` for the numbers of all `runs`, in order; `workers` processes compute a run each at a time.

    A process is forked when its run begins and no other thread traces or sums paths, and uses one core. It ends with
    this process or at the end of the iteration. Its log messages and warnings appear here, in the order of the results.

    Raises
    ------
    Exception
        Error of the job, after all earlier results; a RuntimeError with its text if it cannot be pickled.
    RuntimeError
        If a process ended before its work.
    """
    to_do, begun, warned = deque(runs), deque[_Worker](), dict[Any, Any]()
    try:
        while to_do or begun:
            while to_do and sum(not each.over for each in begun) < workers and len(begun) < workers + MAX_FINISHED:
                begun.append(_Worker(job, to_do.popleft(), begun))
            first, working = begun[0], {each.connection: each for each in begun if not each.over}
            # Pipes are emptied in every round; it waits only where no message of the first process is left.
            for ready in wait(list(working), 0.0 if first.queue else None) if working else ():
                if isinstance(ready, Connection):
                    working[ready].receive()
            if not first.queue:
                continue
            kind, content = first.queue.popleft()
            if kind is _Message.MADE:
                yield content
            elif kind is _Message.LOGGED:
                logging.getLogger(content.name).handle(content)
            elif kind is _Message.WARNED:
                message, category, filename, line = content
                warnings.warn_explicit(message, category, filename, line, registry=warned)
            elif kind is _Message.FAILED:
                raise content
            else:
                begun.popleft().end()
    finally:
        for each in begun:
            each.end()


class _Worker:
    """Forked process that computes one run."""

    def __init__(self, job: Callable[[int], Any], numbers: range, others: Sequence[_Worker]) -> None:
        context = get_context("fork")
        self.connection, theirs = context.Pipe()
        self.queue, self.over, self._numbers = deque[tuple[_Message, Any]](), False, numbers
        # Unused ends of pipes would hide the end of this process from the others.
        inherited = [self.connection, *(each.connection for each in others)]
        self._process = context.Process(target=_run_worker, args=(job, numbers, theirs, inherited), daemon=True)
        with no_blas_users(), without_threads(), warnings.catch_warnings():
            # Python warns of threads that the child lacks: Dr.Jit's have ended, and BLAS starts its own.
            warnings.filterwarnings("ignore", "This process .* is multi-threaded", DeprecationWarning)
            self._process.start()
        theirs.close()

    def receive(self) -> None:
        """Take the next message of the process."""
        try:
            kind, content = self.connection.recv()
        except (EOFError, OSError):  # the latter in the middle of a message
            self._process.join()
            work = f"the process of frames {self._numbers.start} … {self._numbers.stop - 1} ended with"
            code = f"{self._process.exitcode} (below 0 it is a signal; -9 is often want of memory: take fewer workers)"
            kind, content = _Message.FAILED, RuntimeError(f"{work} {code}")
        self.queue.append((kind, content))
        self.over = kind in (_Message.FAILED, _Message.OVER)

    def end(self) -> None:
        """End the process."""
        self.connection.close()  # which ends it
        self._process.join(_JOIN_TIMEOUT)
        if self._process.exitcode is None:
            self._process.kill()
            self._process.join()
        self._process.close()


def _run_worker(
    job: Callable[[int], Any], numbers: range, results: Connection, inherited: Sequence[Connection]
) -> None:
    """Main function of the child process."""
    signal.set_wakeup_fd(-1)  # no signals to the parent's event loop
    for each, handler in ((SIGINT, SIG_IGN), (SIGTERM, SIG_DFL), (SIGHUP, SIG_DFL)):  # at ^C the parent ends it
        signal.signal(each, handler)
    reset_after_fork()
    gc.freeze()  # only the parent closes its open files
    for connection in inherited:
        connection.close()
    Thread(target=_exit_with_parent, args=(results,), daemon=True).start()
    _forward_logs(results)
    try:
        with threadpool_limits(1):
            for number in numbers:
                _send(results, _Message.MADE, job(number))
        _send(results, _Message.OVER, None)
    except Exception as error:
        error.add_note("".join(["In another process:\n", *traceback.format_exception(error)]))
        _send(results, _Message.FAILED, _picklable(error))


def _exit_with_parent(parent: Connection) -> None:
    """Wait until the parent has closed its end, which it never writes to, or has gone."""
    with suppress(EOFError, OSError):
        parent.recv_bytes()
    os._exit(1)


def _send(parent: Connection, kind: _Message, content: Any) -> None:
    """Send a message to the parent, or end without one."""
    message = ForkingPickler.dumps((kind, content))
    try:
        parent.send_bytes(message)
    except OSError:
        os._exit(1)


def _forward_logs(results: Connection) -> None:
    """Send log messages and warnings to the parent instead of showing them."""
    known = [each for each in logging.Logger.manager.loggerDict.values() if isinstance(each, logging.Logger)]
    for logger in (logging.getLogger(), *known):
        logger.handlers.clear()
        logger.propagate = True
    logging.getLogger().addHandler(_LogForwarder(results))

    def show(message: Any, category: Any, filename: str, lineno: int, file: Any = None, line: Any = None) -> None:
        try:
            pickle.loads(pickle.dumps((message, category)))
        except Exception:
            message, category = f"{category.__name__}: {message}", UserWarning
        _send(results, _Message.WARNED, (message, category, filename, lineno))

    warnings.showwarning = show


class _LogForwarder(logging.handlers.QueueHandler):
    """Sends records to the parent."""

    def __init__(self, results: Connection) -> None:
        super().__init__(SimpleQueue())  # unused
        self._results = results

    def enqueue(self, record: logging.LogRecord) -> None:
        _send(self._results, _Message.LOGGED, record)


def _picklable(error: Exception) -> Exception:
    """The error, or one with the same text where it cannot be pickled."""
    try:
        pickle.loads(pickle.dumps(error))
    except Exception:
        return RuntimeError("\n".join([f"{type(error).__name__}: {error}", *error.__notes__]))
    return error
