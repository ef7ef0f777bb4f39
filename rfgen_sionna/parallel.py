"""Limits of threads, for libraries that share the cores."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import lru_cache
from threading import Lock
from typing import Any


class ThreadLimit:
    """Limit of a whole process, set by its first holder and lifted by its last. `limit` sets it and returns the
    function that lifts it."""

    def __init__(self, limit: Callable[[], Callable[[], object]]) -> None:
        self._free, self._holders, self._limit = Lock(), 0, limit
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
