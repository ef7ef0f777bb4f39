"""NumPy arrays and PyTorch tensors by one code: functions that both libraries have under one name.

A tensor is processed where it is, on CPU or CUDA. This module does not import torch: a tensor exists only where its
library is loaded already.
"""

from __future__ import annotations

import sys
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import fft


def is_tensor(array: Any) -> bool:
    """Whether an object is a tensor of PyTorch."""
    torch = sys.modules.get("torch")
    return torch is not None and isinstance(array, torch.Tensor)


def array_namespace(array: Any) -> Any:
    """The library of an array: the module `numpy`, or `torch` for its tensors."""
    return sys.modules["torch"] if is_tensor(array) else np


def constant(values: ArrayLike, like: Any) -> Any:
    """NumPy values in the library, and on the device, of `like`."""
    values = np.asarray(values)
    return sys.modules["torch"].as_tensor(values, device=like.device) if is_tensor(like) else values


def to_numpy(array: Any) -> NDArray[Any]:
    """Values of an array or tensor in the memory of the host."""
    return np.asarray(array.detach().cpu().numpy() if is_tensor(array) else array)


def kind_of(array: Any) -> str:
    """Kind of the values: "f" (float), "c" (complex), or another kind of :class:`numpy.dtype`."""
    if not is_tensor(array):
        return str(array.dtype.kind)
    return "c" if array.is_complex() else "f" if array.is_floating_point() else "i"


def real_type(array: Any) -> np.dtype[Any]:
    """NumPy's type of the real parts of an array."""
    return np.dtype(f"f{array.real.dtype.itemsize}")


def complex_type(array: Any) -> np.dtype[Any]:
    """NumPy's type of complex numbers with the precision of an array."""
    return np.dtype(f"c{2 * array.real.dtype.itemsize}")


def as_type(array: Any, name: str) -> Any:
    """Array with values of a type, such as "float64"."""
    return array.to(getattr(sys.modules["torch"], name)) if is_tensor(array) else array.astype(name, copy=False)


def fast_fourier(array: Any, length: int, axis: int, *, inverse: bool = False) -> Any:
    """Fourier transform of `length` along an axis, the sum with exponentials of negative or, for `inverse`, positive
    sign; a shorter axis is padded with zeros."""
    library = sys.modules["torch"].fft if is_tensor(array) else fft
    return library.ifft(array, length, axis, "forward") if inverse else library.fft(array, length, axis)


def real_parts(array: Any) -> Any:
    """View of a complex array as the real numbers that it consists of, for functions of each of them alone."""
    if is_tensor(array):
        return sys.modules["torch"].view_as_real(array)
    return array.view(array.real.dtype)


def of_real_parts(parts: Any) -> Any:
    """Inverse of :func:`real_parts`."""
    if is_tensor(parts):
        return sys.modules["torch"].view_as_complex(parts)
    return parts.view(np.result_type(parts.dtype, np.complex64))
