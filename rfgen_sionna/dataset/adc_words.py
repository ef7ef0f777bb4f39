"""Samples that are stored as the words of the ADC."""

from __future__ import annotations

from typing import Any

import h5py
import numpy as np
from numpy.typing import ArrayLike, NDArray

from rfgen_sionna._short_repr import ShortRepr


class AdcWords(ShortRepr):
    """Samples of a run [sqrt(W)] on the disk, stored as int16 words; a slice reads them, as of an HDF5 dataset.

    Parameters
    ----------
    words
        (frame, chirp, tx, rx, sample, iq) int16 of I and Q, or (frame, chirp, tx, rx, sample) of a real ADC, with the
        attribute `scale_factor` [sqrt(W)].
    holder
        Object that is referred to as long as this one, such as that of the open file.
    """

    def __init__(self, words: h5py.Dataset, holder: Any = None) -> None:
        self.words, self._holder = words, holder
        self._complex = words.ndim == 6
        self.dtype = np.dtype(np.complex64 if self._complex else np.float32)

    @property
    def scale_factor(self) -> float:
        """Step of the ADC [sqrt(W)]."""
        return float(self.words.attrs["scale_factor"])

    @property
    def shape(self) -> tuple[int, ...]:
        """(frame, chirp, tx, rx, sample)"""
        return tuple(self.words.shape[:5])

    @property
    def ndim(self) -> int:
        """Number of axes, 5."""
        return 5

    @property
    def size(self) -> int:
        """Number of samples."""
        return int(np.prod(self.shape))

    @property
    def nbytes(self) -> int:
        """Size of the samples in memory [bytes]."""
        return self.size * self.dtype.itemsize

    @property
    def attrs(self) -> h5py.AttributeManager:
        """Attributes of the dataset."""
        return self.words.attrs

    @property
    def file(self) -> h5py.File:
        """The open file."""
        return self.words.file

    @property
    def chunks(self) -> tuple[int, ...] | None:
        """Shape of the stored blocks."""
        found = self.words.chunks
        return None if found is None else tuple(found[:5])

    def __len__(self) -> int:
        return self.shape[0]

    def __getitem__(self, key: Any) -> NDArray[Any]:
        if self._complex and any(each is Ellipsis for each in (key if isinstance(key, tuple) else (key,))):
            key = (*(key if isinstance(key, tuple) else (key,)), slice(None))
        return decoded(self.words[key], self.scale_factor, self._complex)

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> NDArray[Any]:
        return np.asarray(self[:], dtype)


def decoded(words: NDArray[np.int16], scale_factor: float, is_complex: bool) -> NDArray[Any]:
    """Samples [sqrt(W)], complex64 or float32, of `words` (..., iq) or (...)."""
    out = np.empty(np.shape(words), np.float32)
    # Products of float64 rounded once are the receiver's own samples in float32.
    np.multiply(words, scale_factor, out=out, casting="same_kind", dtype=np.float64)
    return out.view(np.complex64)[..., 0] if is_complex else out


def encoded(samples: ArrayLike, scale_factor: float, bits: int) -> NDArray[np.int16]:
    """Words (..., iq), or (...) of real samples, of quantised samples [sqrt(W)].

    Raises
    ------
    ValueError
        If samples are no words of such an ADC: these words would not give them back.
    """
    given = np.asarray(samples)
    is_complex = given.dtype.kind == "c"
    parts = np.stack([given.real, given.imag], axis=-1) if is_complex else given
    words = np.rint(parts / scale_factor)
    half = 2 ** (bits - 1)
    if words.size and not -half <= words.min() <= words.max() <= half - 1:
        raise ValueError(f"adc reaches beyond the {bits} bits of the receiver's ADC at steps of {scale_factor:.4g} √W")
    out = words.astype(np.int16)
    stored = decoded(out, scale_factor, is_complex)
    if not np.array_equal(stored, given.astype(stored.dtype)):
        raise ValueError(
            f"adc has values between the steps of the receiver's ADC ({bits} bits, {scale_factor:.4g} √W): store "
            "floating-point numbers (words=False)"
        )
    return out
