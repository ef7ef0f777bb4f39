"""Arrays in `.npy` files: header, and whole frames of a truncated one."""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna.signal.formats.capture import CaptureFormatError
from rfgen_sionna.signal.formats.files import whole_frames


class NpyHeader(NamedTuple):
    """Header of a `.npy` file."""

    shape: tuple[int, ...]
    fortran: bool
    dtype: np.dtype[Any]
    start: int
    """First byte of the data."""


def read_header(path: Path) -> NpyHeader:
    """Header of a `.npy` file (CaptureFormatError for another file)."""
    with path.open("rb") as stream:
        try:
            version = np.lib.format.read_magic(stream)
            header = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
            shape, fortran, dtype = header(stream)
        except ValueError as error:
            raise CaptureFormatError(f"'{path}' is not a NumPy file: {error}") from error
        return NpyHeader(tuple(shape), fortran, dtype, stream.tell())


def open_frames(path: Path, header: NpyHeader, expected: int | None, partial: bool) -> NDArray[Any]:
    """Whole frames of an array on the disk, the first axis, at most `expected`; errors of `whole_frames`."""
    shape, dtype = header.shape[1:], header.dtype
    present = whole_frames(path, dtype.itemsize * int(np.prod(shape)), header.shape[0], partial, header.start)
    present = present if expected is None else min(present, expected)
    return np.memmap(path, dtype=dtype, mode="r", offset=header.start, shape=(present, *shape))
