"""Kernels of our own, on Dr.Jit's float64 arrays for the back end in use.

Mitsuba and Sionna run in float32; phases need more, and Dr.Jit itself has float64 on every back end.
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
    """Dr.Jit and its module of (non-differentiable) array types: `drjit.llvm` or `drjit.cuda`."""
    variant = ensure_backend()
    import drjit

    return drjit, drjit.cuda if variant.startswith("cuda") else drjit.llvm


@contextmanager
def exact_division() -> Iterator[None]:
    """Within it reciprocals, and what is made of them (`rsqrt`, `normalize`), are of double precision. With CUDA they
    are right to a few 1e-7 alone otherwise, by Dr.Jit's fast arithmetic. Serves as a decorator, too."""
    dr, types = drjit_types()
    if dr.backend_v(types.Float64) != dr.JitBackend.CUDA:
        yield
        return
    with dr.scoped_set_flag(dr.JitFlag.FastMath, False):
        yield


_RECORDING = Lock()
"""One for all kernels and threads: whether garbage is collected is one switch for the process."""
_LITERALS = (bool, int, str, type(None))
_KINDS, _NEVER = 256, 2**31 - 1
"""Kinds of inputs that a kernel is kept for, and the number after which Dr.Jit warns."""


class FrozenKernel:
    """A kernel that Python goes through once for each kind of inputs, and not again for others of that kind.

    To go through thousands of operations takes milliseconds, as long as the kernel takes for ten thousand facets.

    Args:
        kernel: takes arrays on the device, in a dict of arrays, dicts and lists, and plain values as options. It
            writes into some of the former and returns nothing. What is recorded serves inputs of all sizes: so an array
            of lanes is given, and a width (:func:`drjit.width`) is nothing but that of another array. No two of the
            arrays share their memory. Names of its module that it uses are what they were when it was recorded.
    """

    def __init__(self, kernel: Callable[..., None]) -> None:
        self._kernel = kernel

    def __call__(self, given: dict[str, Any], *options: Any) -> None:
        """Run it.

        Raises:
            ValueError: an array is empty, or given twice.
            TypeError: something given is no array, or an option of another type than Python's own plain ones.
        """
        _check(given, set())
        for option in options:
            # Dr.Jit looks at them with its lock held: where a class answers with Python of its own, as enumerations do,
            # another thread may go on in between, and wait for that lock for ever.
            if type(option) not in _LITERALS:
                raise TypeError(f"a kernel was given {option!r}, a {type(option).__name__}: plain options are needed")
        with _RECORDING:
            collecting = gc.isenabled()
            gc.disable()  # a scene that is collected while its thread records ends the process
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
            # Options are one string as Dr.Jit 1.5 takes an object that it has met for one of those before, whichever it
            # is: what was recorded for (2, 1, 2) serves (2, 1, 1), and writes beyond its arrays.
            kernel(given, *literal_eval(options))

        found: Callable[..., None] = drjit.freeze(recorded, limit=_KINDS, warn_after=_NEVER, auto_opaque=False)
        return found


def _check(given: dict[str, Any] | list[Any], known: set[int]) -> None:
    """Raises ValueError where an array is empty, which would end the process, or among those `known` by their id, and
    TypeError where something is none: what is met again is taken for any other."""
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
