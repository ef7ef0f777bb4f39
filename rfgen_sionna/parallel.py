"""Keeping libraries from fighting over the cores."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from functools import lru_cache
from threading import Condition
from typing import Any


class ThreadLimit:
    """Something that a whole process is limited to while anybody holds it: the first to come sets it, the last to go
    lifts it. `limit` sets it and returns what lifts it."""

    def __init__(self, limit: Callable[[], Callable[[], object]]) -> None:
        self._free, self._holders, self._limit = Condition(), 0, limit
        self._lift: Callable[[], object] | None = None

    @contextmanager
    def held(self) -> Iterator[None]:
        """Within it the limit holds."""
        self._take()
        try:
            yield
        finally:
            self._give_back()

    @contextmanager
    def unheld(self) -> Iterator[None]:
        """Within it nobody holds it: it is waited until the last one has gone, and who comes waits."""
        with self._free:
            self._free.wait_for(lambda: self._holders == 0)
            yield

    def reset(self) -> None:
        """Begin anew, in a process that was forked within :meth:`unheld`."""
        self._free, self._holders = Condition(), 0

    def _take(self) -> None:
        with self._free:
            if self._holders == 0:
                self._lift = self._limit()
            self._holders += 1

    def _give_back(self) -> None:
        with self._free:
            self._holders -= 1
            if self._holders == 0:
                if self._lift is not None:
                    self._lift()
                self._lift = None
                self._free.notify_all()


@lru_cache(maxsize=1)
def _controller() -> Any:
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController()


_BLAS = ThreadLimit(lambda: _controller().limit(limits=1, user_api="blas").restore_original_limits)


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """Within it (a block, or a function that it decorates) NumPy's matrix products run on the calling thread alone,
    and so do those of other threads.

    OpenBLAS' threads wait for each other by spinning: where the caller already works on all cores, with threads of its
    own or through Dr.Jit, products of a few rows take four times as long with them as without.
    """
    with _BLAS.held():
        yield


def no_blas_users() -> AbstractContextManager[None]:
    """Within it no thread is in :func:`one_blas_thread`, such as to trace or to sum paths: a process may be forked, in
    which what another thread holds would never be let go. The child calls :func:`reset_after_fork` first."""
    return _BLAS.unheld()


def reset_after_fork() -> None:
    """Let threads of a forked process work again."""
    _BLAS.reset()
