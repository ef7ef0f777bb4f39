"""NumPy's numbers for Dr.Jit.

On the CPU Dr.Jit takes over NumPy's memory as it is, compiles one kernel per combination of aligned and unaligned
inputs, and reads whole packets: so each array is copied to where memory is aligned and goes on for a packet.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

_ALIGNED = 64
_PACKET = 128
"""[byte]: 16 numbers of double precision."""


def upload(kind: Any, values: ArrayLike) -> Any:
    """`values`, of any shape, as a flat Dr.Jit array of type `kind`: one of its real or integer types."""
    import drjit as dr

    dtype = np.dtype({dr.VarType.Float32: "f4", dr.VarType.Float64: "f8", dr.VarType.UInt32: "u4"}[dr.type_v(kind)])
    given = np.asarray(values)
    memory = np.empty(given.size * dtype.itemsize + _ALIGNED + _PACKET, np.uint8)
    start = -memory.ctypes.data % _ALIGNED
    flat = memory[start : start + given.size * dtype.itemsize].view(dtype)
    flat.reshape(given.shape)[...] = given
    return kind(flat)
