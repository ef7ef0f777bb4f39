"""How many threads the sampling takes."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import torch

from rfgen_sionna.parallel import one_blas_thread

SMALL = 16
"""Motions up to which one thread is enough."""


@contextmanager
def threads_for(motions: int) -> Iterator[None]:
    """Within it, up to `SMALL` motions are computed on the calling thread alone; then PyTorch's number is as before.

    A layer of so few motions takes less than a millisecond, after which PyTorch's threads wait for each other by
    spinning: on cores that others use as well, one motion takes ten times as long with two threads as with one.
    """
    before = torch.get_num_threads()
    if motions > SMALL or before == 1:
        yield
        return
    torch.set_num_threads(1)
    try:
        with one_blas_thread():
            yield
    finally:
        torch.set_num_threads(before)
