"""NumPy's numbers for Dr.Jit.

On the CPU Dr.Jit takes over NumPy's memory as it is, compiles one kernel per combination of aligned and unaligned
inputs, and reads whole packets: so each array is copied to where memory is aligned and goes on for a packet, if it is
not there.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import prod
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

_ALIGNED = 64
_PACKET = 128
"""[byte]: 16 numbers of double precision."""
_DTYPES: dict[str, np.dtype[Any]] = {"Float32": np.dtype("f4"), "Float64": np.dtype("f8"), "UInt32": np.dtype("u4")}


def empty_aligned(shape: tuple[int, ...], dtype: DTypeLike = np.float64) -> NDArray[Any]:
    """An array of that shape, not filled, which :func:`upload` need not copy."""
    kind = np.dtype(dtype)
    size = prod(shape) * kind.itemsize
    memory = np.empty(size + _ALIGNED + _PACKET, np.uint8)
    return np.ndarray(shape, kind, memory, -_address(memory) % _ALIGNED)


def _address(values: NDArray[Any]) -> int:
    address: int = values.__array_interface__["data"][0]  # several times faster than `ctypes.data`
    return address


def concatenate_aligned(parts: Sequence[NDArray[np.float64]]) -> NDArray[np.float64]:
    """One after the other, with :func:`empty_aligned`."""
    found = empty_aligned((sum(len(each) for each in parts), *parts[0].shape[1:]))
    return np.concatenate(parts, out=found)


def upload(kind: Any, values: ArrayLike) -> Any:
    """`values`, of any shape, as a flat Dr.Jit array of type `kind`: one of its real or integer types.

    What has its :func:`empty_aligned` is not copied: it is not to be written to as long as the array is about.
    """
    import drjit as dr

    dtype = _DTYPES[dr.type_v(kind).name]
    given = np.asarray(values)
    if given.dtype != dtype or not _is_aligned(given):
        there = empty_aligned(given.shape, dtype)
        there[...] = given
        given = there
    return kind(given.reshape(-1))


def _is_aligned(values: NDArray[Any]) -> bool:
    base = values.base
    if not isinstance(base, np.ndarray) or base.dtype != np.uint8 or base.ndim != 1 or not base.flags.c_contiguous:
        return False
    start = _address(values)
    left = _address(base) + base.nbytes - start - values.nbytes
    return values.flags.c_contiguous and start % _ALIGNED == 0 and left >= _PACKET
