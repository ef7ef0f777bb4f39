"""Range-Doppler maps of many frames in single precision, from samples or from an ADC's words."""

from __future__ import annotations

import threading
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import fft

from rfgen_sionna.processing.multiplexing import uses_doppler_bands
from rfgen_sionna.processing.spectrum import check_cube, check_shape, range_doppler, taper

if TYPE_CHECKING:
    from rfgen_sionna.radar import Radar

Single = NDArray[np.float32]


def range_doppler_power(
    cube: ArrayLike, radar: Radar, *, scale: float | None = None, static: bool = True
) -> NDArray[np.float32]:
    """`range_doppler(cube, radar, static=static).power` in single precision, with a tenth of the memory.

    Parameters
    ----------
    cube
        (..., chirp, tx, rx, sample), or words of an ADC: whole numbers of these axes, with a last axis of I and Q for
        complex samples.
    scale
        Samples [sqrt(W)] of a word of 1; needed for words.
    static
        Whether static returns are kept.

    Returns
    -------
    (..., range, velocity) mean power of the channels [W for samples in sqrt(W)], as Hann windows give it.

    Raises
    ------
    ValueError
        For another shape or type, or words without a scale.
    """
    array = np.asarray(cube)
    if words := array.dtype.kind in "iu":
        if scale is None:
            raise ValueError(f"cube holds {array.dtype} words: their scale [sqrt(W)] is needed")
        pairs = () if radar.adc.real else (2,)
        if pairs and array.shape[-1:] != pairs:
            raise ValueError(f"cube of words has shape {array.shape}: a last axis of 2, I and Q, is needed")
        shape = array.shape[: array.ndim - len(pairs)]
        check_shape(shape, radar)
    else:
        array, shape, scale = check_cube(array, radar), array.shape, 1.0
    plain = radar.waveform.slope > 0 and not uses_doppler_bands(radar)
    frames = array.reshape(-1, *array.shape[len(shape) - 4 :])
    maps = [(_quick if plain else _general)(frame, radar, words, float(scale or 1.0), static) for frame in frames]
    return np.stack(maps).reshape(*shape[:-4], *maps[0].shape)


_WORK = threading.local()
"""Memory for one frame, of each thread: large blocks that come and go leave holes in the heap, which then grows."""


def _samples(frame: NDArray[Any], radar: Radar, words: bool) -> NDArray[Any]:
    """The samples (chirp, tx, rx, sample) in single precision, words as they are, in memory for one frame."""
    kind = np.dtype(np.float32 if words or radar.adc.real else np.complex64)
    values: NDArray[Any] | None = getattr(_WORK, "samples", None)
    if values is None or (values.shape, values.dtype) != (frame.shape, kind):
        values = _WORK.samples = np.empty(frame.shape, kind)
    np.copyto(values, frame, casting="same_kind")
    return values if radar.adc.real or not words else values.view(np.complex64)[..., 0]


def _general(frame: NDArray[Any], radar: Radar, words: bool, scale: float, static: bool) -> Single:
    """Map of any radar."""
    power = range_doppler(_samples(frame, radar, words), radar, static=static).power
    return np.asarray(power * scale**2, np.float32)


def _quick(frame: NDArray[Any], radar: Radar, words: bool, scale: float, static: bool) -> Single:
    """Map of a radar with a rising ramp and no Doppler bands."""
    samples = _samples(frame, radar, words)
    chirps, channels = samples.shape[0], samples.shape[1] * samples.shape[2]
    samples = samples.reshape(chirps, channels, samples.shape[3])
    slow, fast = _tapers(chirps, samples.shape[2])
    if not static:
        flat = samples.view(np.float32).reshape(chirps, -1)
        flat -= np.einsum("c,cx->x", slow, flat)  # a matrix product would take the cores of other workers
    samples *= slow[:, None, None] * fast
    spectrum = (fft.rfft if radar.adc.real else fft.fft)(samples, axis=2, overwrite_x=True)
    spectrum = fft.fft(spectrum, axis=0, overwrite_x=True)
    parts = spectrum.view(np.float32)
    power = np.einsum("cnr,cnr->cr", parts, parts)
    power = power[:, 0::2] + power[:, 1::2]
    # Real samples have half their power at negative frequencies.
    power *= np.float32((2 if radar.adc.real else 1) * scale**2 / channels)
    return np.ascontiguousarray(fft.fftshift(power, axes=0).T)


@lru_cache(maxsize=32)
def _tapers(chirps: int, samples: int) -> tuple[Single, Single]:
    """Windows over chirps and samples, as :func:`~rfgen_sionna.processing.spectrum.range_doppler` takes them."""
    slow, fast = taper("hann", chirps).astype(np.float32), taper("hann", samples).astype(np.float32)
    slow.flags.writeable = fast.flags.writeable = False
    return slow, fast
