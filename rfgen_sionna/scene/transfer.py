"""NumPy's numbers for Dr.Jit.

On the CPU Dr.Jit takes over NumPy's memory as it is, and compiles one kernel per combination of aligned and unaligned
inputs: so small arrays, which lie anywhere, are copied to where memory is aligned. Large ones never are, as they begin
behind what the allocator keeps of them.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

_ALIGNED = 64
_LARGE = 1 << 18
"""[byte]"""


def upload(kind: Any, values: ArrayLike) -> Any:
    """`values`, of any shape, as a flat Dr.Jit array of type `kind`: one of its real or integer types."""
    import drjit as dr

    dtype = np.dtype({dr.VarType.Float32: "f4", dr.VarType.Float64: "f8", dr.VarType.UInt32: "u4"}[dr.type_v(kind)])
    given = np.asarray(values)
    if given.nbytes >= _LARGE and given.dtype == dtype and given.flags.c_contiguous:
        return kind(given.reshape(-1))
    memory = np.empty(given.size * dtype.itemsize + _ALIGNED, np.uint8)
    start = -memory.ctypes.data % _ALIGNED
    flat = memory[start : start + given.size * dtype.itemsize].view(dtype)
    flat.reshape(given.shape)[...] = given
    return kind(flat)
