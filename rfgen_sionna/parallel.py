"""Keeping libraries from fighting over the cores."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from functools import lru_cache
from typing import Any


@lru_cache(maxsize=1)
def _controller() -> Any:
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController()


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """Within it (a block, or a function that it decorates) NumPy's matrix products run on the calling thread alone.

    OpenBLAS' threads wait for each other by spinning: where the caller already works on all cores, with threads of its
    own or through Dr.Jit, products of a few rows take four times as long with them as without.
    """
    with _controller().limit(limits=1, user_api="blas"):
        yield
