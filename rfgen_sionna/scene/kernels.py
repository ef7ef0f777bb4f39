"""Kernels and uploads of this package on Dr.Jit's arrays, in float64 for phases.

On the CPU Dr.Jit uses NumPy's memory in place, compiles one kernel for each combination of aligned and unaligned
inputs, and reads whole packets. :func:`upload` therefore copies arrays that are not aligned with room for a packet.
"""

from __future__ import annotations

import gc
from ast import literal_eval
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import cached_property
from math import prod
from threading import Lock
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

from rfgen_sionna.scene.mitsuba_backend import ensure_backend


def drjit_types() -> tuple[ModuleType, Any]:
    """Dr.Jit, and its module of non-differentiable array types: `drjit.llvm` or `drjit.cuda`."""
    variant = ensure_backend()
    import drjit

    return drjit, drjit.cuda if variant.startswith("cuda") else drjit.llvm


@contextmanager
def exact_division() -> Iterator[None]:
    """Context or decorator: reciprocals, `rsqrt` and `normalize` in double precision, which CUDA's fast arithmetic
    computes to a few 1e-7 only."""
    dr, types = drjit_types()
    if dr.backend_v(types.Float64) != dr.JitBackend.CUDA:
        yield
        return
    with dr.scoped_set_flag(dr.JitFlag.FastMath, False):
        yield


_RECORDING = Lock()
"""One lock for all kernels and threads: garbage collection is one switch for the process."""
_LITERALS = (bool, int, str, type(None))
_KINDS, _NEVER = 256, 2**31 - 1
"""Recordings kept per kernel, above the kinds of inputs of any run; count after which Dr.Jit warns: none."""
_ALIGNMENT = 64
"""Alignment of Dr.Jit's packets [byte]: one AVX-512 register."""
_PACKET = 128
"""Room after an array for a packet [byte]: 16 numbers of double precision."""
_DTYPES: dict[str, np.dtype[Any]] = {"Float32": np.dtype("f4"), "Float64": np.dtype("f8"), "UInt32": np.dtype("u4")}


class FrozenKernel:
    """A kernel that is recorded once for each kind of inputs and then replayed without Python.

    Args:
        kernel: function of a dict of device arrays (also nested in dicts and lists) and of plain options. It writes
            into some of the arrays and returns nothing. A recording serves inputs of any size: the lanes must be an
            input array, and a width (:func:`drjit.width`) must be that of an array. No two arrays may share memory.
            Global names keep their values from the time of recording.
    """

    def __init__(self, kernel: Callable[..., None]) -> None:
        self._kernel = kernel

    def __call__(self, given: dict[str, Any], *options: Any) -> None:
        """Run the kernel.

        Raises:
            ValueError: an array is empty, or given twice.
            TypeError: an input is no array, or an option is no plain Python value.
        """
        _check(given, set())
        for option in options:
            # Dr.Jit compares options with its lock held: Python code of an enumeration there can deadlock.
            if type(option) not in _LITERALS:
                raise TypeError(f"a kernel was given {option!r}, a {type(option).__name__}: plain options are needed")
        with _RECORDING:
            collecting = gc.isenabled()
            gc.disable()  # a scene collected during a recording ends the process
            try:
                with exact_division():
                    self._frozen(given, repr(options))
            finally:
                if collecting:
                    gc.enable()

    @cached_property
    def _frozen(self) -> Callable[..., None]:
        import drjit

        kernel = self._kernel

        def recorded(given: dict[str, Any], options: str) -> None:
            # One string: Dr.Jit 1.5 confuses repeated objects, and replays (2, 1, 2) for (2, 1, 1).
            kernel(given, *literal_eval(options))

        found: Callable[..., None] = drjit.freeze(recorded, limit=_KINDS, warn_after=_NEVER, auto_opaque=False)
        return found


def _check(given: dict[str, Any] | list[Any], known: set[int]) -> None:
    """Refuse empty arrays, which end the process, repeated ones (`known` by id), and inputs that are no arrays."""
    import drjit

    for name, each in given.items() if isinstance(given, dict) else enumerate(given):
        if id(each) in known:
            raise ValueError(f"a kernel was given the same for {name!r} as for something else")
        known.add(id(each))
        if isinstance(each, (dict, list)):
            _check(each, known)
        elif not drjit.is_array_v(each):
            raise TypeError(f"a kernel was given {each!r} for {name!r}: arrays are needed, and options for the rest")
        elif drjit.width(each) == 0:
            raise ValueError(f"a kernel was given nothing for {name!r}")


def empty_aligned(shape: tuple[int, ...], dtype: DTypeLike = np.float64) -> NDArray[Any]:
    """Uninitialised array of a `shape` that :func:`upload` need not copy."""
    kind = np.dtype(dtype)
    size = prod(shape) * kind.itemsize
    memory = np.empty(size + _ALIGNMENT + _PACKET, np.uint8)
    return np.ndarray(shape, kind, memory, -_address(memory) % _ALIGNMENT)


def _address(values: NDArray[Any]) -> int:
    address: int = values.__array_interface__["data"][0]  # several times faster than `ctypes.data`
    return address


def concatenate_aligned(parts: Sequence[NDArray[np.float64]]) -> NDArray[np.float64]:
    """`parts` (row, ...) concatenated along their first axis in an :func:`empty_aligned` array."""
    return np.concatenate(parts, out=empty_aligned((sum(map(len, parts)), *parts[0].shape[1:])))


def upload(kind: Any, values: ArrayLike) -> Any:
    """`values` of any shape as a flat Dr.Jit array of type `kind` (Float32, Float64, UInt32).

    An :func:`empty_aligned` array of the same type is shared, not copied: do not write to it while the result lives.
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
    return values.flags.c_contiguous and start % _ALIGNMENT == 0 and left >= _PACKET
