"""Numbered work that is split among forked processes.

Python runs one thread at a time, so threads hardly speed up tracing. A forked process shares scenes, users' functions
and compiled kernels with its parent until one of them writes to that memory.
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
"""Number of runs beyond those in work whose results may be kept until it is their turn."""

_JOIN_TIMEOUT = 5.0
"""Time that a process gets to end once its results are not wanted any more [s]."""


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
        If it is no whole number of at least 1, or more than 1 where processes can't be forked.
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
            f"workers is {workers}: this process is one of a multiprocessing.Pool or of a DataLoader, which can't have "
            "processes of its own; 1 is allowed here"
        )
    return int(workers)


def map_in_processes(job: Callable[[int], T], runs: Sequence[range], workers: int) -> Iterator[T]:
    """Results of `job` for the numbers of all `runs`, in order; `workers` processes work at a time, on a run each.

    A process is forked when its run begins, as soon as no other thread traces or sums paths, and works on one core. It
    ends with this process, or when its results are not wanted any more. Its log messages and warnings appear here, in
    the order of the results.

    Raises
    ------
    Exception
        The error of the job, after all earlier results; a RuntimeError with its text if it cannot be pickled.
    RuntimeError
        If a process ended before its work did.
    """
    to_do, begun, warned = deque(runs), deque[_Worker](), dict[Any, Any]()
    try:
        while to_do or begun:
            while to_do and sum(not each.over for each in begun) < workers and len(begun) < workers + MAX_FINISHED:
                begun.append(_Worker(job, to_do.popleft(), begun))
            first, working = begun[0], {each.connection: each for each in begun if not each.over}
            # What others send is taken from them, but not waited for where something is at hand.
            for ready in wait(list(working), 0.0 if first.queue else None) if working else ():
                working[ready].receive()  # type: ignore[index]
            if not first.queue:
                continue
            said, what = first.queue.popleft()
            if said is _Message.MADE:
                yield what
            elif said is _Message.LOGGED:
                logging.getLogger(what.name).handle(what)
            elif said is _Message.WARNED:
                message, category, filename, line = what
                warnings.warn_explicit(message, category, filename, line, registry=warned)
            elif said is _Message.FAILED:
                raise what
            else:
                begun.popleft().end()
    finally:
        for each in begun:
            each.end()


class _Worker:
    """A forked process that works on some numbers."""

    def __init__(self, job: Callable[[int], Any], numbers: range, others: Sequence[_Worker]) -> None:
        context = get_context("fork")
        self.connection, theirs = context.Pipe()
        self.queue, self.over, self._numbers = deque[tuple[_Message, Any]](), False, numbers
        # Ends of pipes that it does not need would hide from other processes that this one has gone.
        inherited = [self.connection, *(each.connection for each in others)]
        self._process = context.Process(target=_run_worker, args=(job, numbers, theirs, inherited), daemon=True)
        with no_blas_users(), without_threads(), warnings.catch_warnings():
            # Python warns of threads that the child will lack: Dr.Jit's have ended, and BLAS makes its own anew.
            warnings.filterwarnings("ignore", "This process .* is multi-threaded", DeprecationWarning)
            self._process.start()
        theirs.close()

    def receive(self) -> None:
        """Take the next message of the process."""
        try:
            said, what = self.connection.recv()
        except (EOFError, OSError):  # the latter in the middle of what it told
            self._process.join()
            said, what = _Message.FAILED, RuntimeError(
                f"the process that worked on frames {self._numbers.start} … {self._numbers.stop - 1} ended with "
                f"{self._process.exitcode} (below 0 it is a signal; -9 is often want of memory: take fewer workers)"
            )  # fmt: skip
        self.queue.append((said, what))
        self.over = said in (_Message.FAILED, _Message.OVER)

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
    signal.set_wakeup_fd(-1)  # the parent's event loop is not to hear of this one's signals
    for each, handler in ((SIGINT, SIG_IGN), (SIGTERM, SIG_DFL), (SIGHUP, SIG_DFL)):  # at ^C the parent ends it
        signal.signal(each, handler)
    reset_after_fork()
    gc.freeze()  # what the parent has open, HDF5 files among it, is not this one's to close
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


def _send(parent: Connection, said: _Message, what: Any) -> None:
    """Send a message to the parent, or end without one."""
    message = ForkingPickler.dumps((said, what))
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
        super().__init__(SimpleQueue())  # which nothing goes by
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
