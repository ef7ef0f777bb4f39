"""Limits of threads, for libraries that share the cores."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from functools import lru_cache
from threading import Condition
from typing import Any


class ThreadLimit:
    """Limit of a whole process, set by its first holder and lifted by its last. `limit` sets it and returns the
    function that lifts it."""

    def __init__(self, limit: Callable[[], Callable[[], object]]) -> None:
        self._free, self._holders, self._limit = Condition(), 0, limit
        self._lift: Callable[[], object] | None = None

    @contextmanager
    def held(self) -> Iterator[None]:
        """Context with the limit."""
        with self._free:
            if self._holders == 0:
                self._lift = self._limit()
            self._holders += 1
        try:
            yield
        finally:
            with self._free:
                self._holders -= 1
                if self._holders == 0:
                    if self._lift is not None:
                        self._lift()
                    self._lift = None
                    self._free.notify_all()

    @contextmanager
    def unheld(self) -> Iterator[None]:
        """Context without holders: it waits for the last one, and new ones wait for its end."""
        with self._free:
            self._free.wait_for(lambda: self._holders == 0)
            yield

    def reset(self) -> None:
        """Start without holders, in a process forked within :meth:`unheld`."""
        self._free, self._holders = Condition(), 0


@lru_cache(maxsize=1)
def _controller() -> Any:
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController()


_BLAS = ThreadLimit(lambda: _controller().limit(limits=1, user_api="blas").restore_original_limits)


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """Context (or decorator) in which matrix products of all threads use one BLAS thread each.

    OpenBLAS' threads spin while they wait, which slows down small products where all cores are in use already.
    """
    with _BLAS.held():
        yield


def no_blas_users() -> AbstractContextManager[None]:
    """Context in which no thread is in :func:`one_blas_thread`, for a fork. The child calls :func:`reset_after_fork`
    first."""
    return _BLAS.unheld()


def reset_after_fork() -> None:
    """Reset the limit of BLAS threads in a forked process."""
    _BLAS.reset()
