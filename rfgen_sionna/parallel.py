"""Keeping libraries from fighting over the cores."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from functools import lru_cache
from threading import Lock
from typing import Any


class _Limit:
    """NumPy's products on one thread while anybody holds it: the first to come sets it, the last to go lifts it."""

    def __init__(self) -> None:
        self._lock, self._holders = Lock(), 0
        self._set: Any = None

    def take(self) -> None:
        with self._lock:
            if self._holders == 0:
                self._set = _controller().limit(limits=1, user_api="blas")
            self._holders += 1

    def give_back(self) -> None:
        with self._lock:
            self._holders -= 1
            if self._holders == 0 and self._set is not None:
                self._set.restore_original_limits()
                self._set = None


_LIMIT = _Limit()


@lru_cache(maxsize=1)
def _controller() -> Any:
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController()


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """Within it (a block, or a function that it decorates) NumPy's matrix products run on the calling thread alone,
    and so do those of other threads.

    OpenBLAS' threads wait for each other by spinning: where the caller already works on all cores, with threads of its
    own or through Dr.Jit, products of a few rows take four times as long with them as without.
    """
    _LIMIT.take()
    try:
        yield
    finally:
        _LIMIT.give_back()
