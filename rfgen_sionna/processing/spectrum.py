"""Range and Doppler spectra of FMCW frames, on axes in metres and metres per second.

Cubes have the axes (..., chirp, tx, rx, sample), simulated or measured, with any leading axes. The numbers of Tx
entries and Rx elements must fit the radar, not those of chirps and samples. Chirps have one profile
(:func:`~rfgen_sionna.processing.demultiplex.select_profile`). Tx elements in Doppler bands are separated in the Doppler
spectra, those in codes with the directions. The signal model is

    s(t) = A exp(+j 2 pi (f0 tau + mu t tau - mu tau^2 / 2)),   t from the start of the ramp,

so that a beat frequency f is the range c f / (2 mu), and a positive Doppler bin is a receding target. A downward ramp
has its targets at negative frequencies; without a slope there is one range bin.

Samples of a real ADC are sqrt(2) Re(s). Their spectra are one-sided: half the range axis with the same steps, where a
tone has the complex amplitude that it has with I and Q. Without a slope they leave the sign of velocities open.

Ranges are those at the centre of the observation (:func:`observation_time`). The beat frequency of a target of radial
velocity v is mu tau + 2 v fc / c, which moves its range bin to R + fc v / mu (range-Doppler coupling);
`correct_coupling` of :func:`range_doppler` removes it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike
from scipy import fft
from scipy.signal import CZT, get_window, hilbert

from rfgen_sionna._short_repr import ShortRepr
from rfgen_sionna._types import FloatArray
from rfgen_sionna.processing.array_namespace import (
    array_namespace,
    as_type,
    complex_type,
    constant,
    fast_fourier,
    is_tensor,
    kind_of,
    real_type,
)
from rfgen_sionna.processing.multiplexing import ComplexChannels, Samples, axis_lengths, occupied_bins, separate_bands

if TYPE_CHECKING:
    from rfgen_sionna.radar import Radar

Window = str | tuple[str, float]
"""Name (or name and parameter) of :func:`scipy.signal.get_window`, for instance "hann"."""


def check_cube(cube: ArrayLike, radar: Radar, *, frames: bool = False, tensors: bool = False) -> Samples:
    """Cube (..., chirp, tx, rx, sample), with `frames` exactly (frame, chirp, tx, rx, sample), as an array; with
    `tensors`, a tensor of PyTorch as it is.

    A wrong shape, complex samples for a real ADC or real ones for another, and samples that are not finite are a
    ValueError; other objects than arrays and radars are a TypeError.
    """
    if isinstance(cube, list | tuple) and any(map(is_tensor, cube)):
        raise TypeError(f"cube is a {type(cube).__name__} with tensors: one tensor is needed (torch.stack)")
    array: Any = cube if tensors and is_tensor(cube) else np.asarray(cube)
    kind = kind_of(array)
    if kind == "O":
        raise TypeError(f"cube is a {type(cube).__name__}: its samples are needed (cube.data)")
    if not hasattr(radar, "waveform"):
        raise TypeError(f"radar is {radar!r}: a Radar is needed (Radar.load('awr1843'), or that of the capture)")
    check_shape(tuple(array.shape), radar, frames=frames)
    if radar.adc.real and kind != "f":
        raise ValueError(
            f"cube holds {array.dtype}: radar '{radar.name}' has a real ADC (adc.real), real floats are needed"
        )
    if not radar.adc.real and kind != "c":
        raise ValueError(
            f"cube holds {array.dtype}: complex (I + jQ) samples are needed; real ones need a radar with adc.real"
        )
    finite = array_namespace(array).isfinite(array)
    if not finite.all():
        raise ValueError(f"cube holds {int((~finite).sum())} samples that are NaN or infinite")
    return array


def check_shape(shape: tuple[int, ...], radar: Radar, *, frames: bool = False) -> None:
    """ValueError unless `shape` is that of a cube for :func:`check_cube`."""
    axes = "(frame, chirp, tx, rx, sample)" if frames else "(..., chirp, tx, rx, sample)"
    if len(shape) < 4 or (frames and len(shape) != 5):
        raise ValueError(f"cube has shape {shape}: the axes {axes} are needed")
    wanted = {-3: ("tx", axis_lengths(radar)), -2: ("rx", (len(radar.rx_positions),))}
    for axis, (name, lengths) in wanted.items():
        if shape[axis] not in lengths:
            raise ValueError(
                f"cube has {shape[axis]} entries along '{name}' (shape {shape}, axes {axes}); "
                f"radar '{radar.name}' with preset '{radar.preset}' has {lengths[0]}"
            )
    if 0 in shape:
        raise ValueError(f"cube is empty: shape {shape}, axes {axes}")


def range_axis(radar: Radar, bins: int | None = None) -> FloatArray:
    """(range,) centres of the range bins [m] of a transform of length `bins`: from 0 to below the range window, to half
    of it with a real ADC (bins // 2 + 1); one bin at 0 without a slope."""
    if radar.waveform.slope == 0:
        return np.zeros(1)
    bins = radar.waveform.num_samples if bins is None else bins
    count = bins // 2 + 1 if radar.adc.real else bins
    return np.arange(count, dtype=np.float64) * (radar.waveform.range_window / bins)


def range_transform(array: Samples, radar: Radar, bins: int) -> ComplexChannels:
    """Tapered samples (..., sample), or their Doppler spectra, to bins of ascending range, for a downward ramp with
    reversed frequency."""
    if radar.waveform.slope == 0:
        spectrum: Any = array.sum(axis=-1, keepdims=True) + 0j
    else:
        spectrum = fast_fourier(array, bins, -1, inverse=radar.waveform.slope < 0)
    if radar.adc.real:  # a tone has half its power at negative frequencies
        spectrum = spectrum[..., : bins // 2 + 1] * 2**0.5
    return spectrum


def complex_samples(array: Samples, radar: Radar) -> Samples:
    """Complex samples s of real ones, sqrt(2) Re(s), with beats of one sign; complex ones are unchanged."""
    if not radar.adc.real:
        return array
    analytic = (hilbert(array, axis=-1) / np.sqrt(2)).astype(np.result_type(array.dtype, np.complex64), copy=False)
    return np.asarray(analytic.conj() if radar.waveform.slope < 0 else analytic)


def real_samples(array: Samples, radar: Radar) -> Samples:
    """Inverse of :func:`complex_samples`."""
    return np.sqrt(2, dtype=array.real.dtype) * array.real if radar.adc.real else array


def velocity_axis(radar: Radar, bins: int | None = None) -> FloatArray:
    """(velocity,) centres of the Doppler bins [m/s], ascending; positive is receding.

    `bins` is the length of the transform; frames in Doppler bands have the axis of one band.
    """
    bins = radar.waveform.num_loops if bins is None else bins
    return _doppler_axis(radar, bins)[occupied_bins(radar, bins)]


def _doppler_axis(radar: Radar, bins: int) -> FloatArray:
    return fft.fftshift(fft.fftfreq(bins, radar.waveform.loop_period)) * (radar.wavelength / 2)


def observation_time(radar: Radar) -> float:
    """Time of the range and position estimates of a frame, the centre of its ADC windows, after its start [s]."""
    wave = radar.waveform
    return float(wave.chirp_times.mean() + wave.sample_times.mean())


def taper(window: Window, length: int) -> FloatArray:
    """(length,) symmetric window of sum 1, so that the bin of a tone has its amplitude."""
    # The periodic window of length + 1 without its first zero is symmetric without zeros.
    values = np.asarray(get_window(window, length + 1, fftbins=True)[1:], dtype=np.float64)
    return values / values.sum()


def remove_static(cube: ArrayLike, *, over: str = "frame") -> Samples:
    """Subtract static returns: the mean over the chirps of each frame, Hann-weighted against leakage of moving ones.

    Parameters
    ----------
    cube
        (frame, chirp, tx, rx, sample), or (chirp, tx, rx, sample) with `over="frame"`; an array or a tensor.
    over
        "frame": the mean of each frame, a notch at zero Doppler. "run": the mean over all frames, which keeps people
        who are static for a part of the run.
    """
    array: Any = cube if is_tensor(cube) else np.asarray(cube)
    if array.ndim >= 4 and (over == "frame" or (over == "run" and array.ndim == 5)):
        weights = constant(taper("hann", array.shape[-4]).astype(real_type(array)), array)
        mean = (array * weights[:, None, None, None]).sum(axis=-4, keepdims=True)
        return array - (mean if over == "frame" else mean.mean(axis=0))
    raise ValueError(
        f"over is {over!r} for a cube of shape {array.shape}: 'frame' needs (..., chirp, tx, rx, sample), "
        "'run' needs (frame, chirp, tx, rx, sample)"
    )


def range_spectrum(
    cube: ArrayLike, radar: Radar, *, window: Window = "hann", bins: int | None = None
) -> ComplexChannels:
    """Range profiles (..., chirp, tx, rx, range) on the axis :func:`range_axis`.

    A tone of amplitude A has |A| at its bin for any window. More `bins` than samples pad with zeros. The profiles of a
    tensor of PyTorch are a tensor.
    """
    array = check_cube(cube, radar, tensors=True)
    return range_profiles(array, radar, window, _bins("bins", bins, array.shape[-1]))


def range_profiles(array: Samples, radar: Radar, window: Window, bins: int) -> ComplexChannels:
    """:func:`range_spectrum` of checked samples, which may be separate Doppler bands."""
    fast = constant(taper(window, array.shape[-1]).astype(real_type(array)), array)
    return range_transform(array * fast, radar, bins)


@dataclass(frozen=True, repr=False)
class RangeDoppler(ShortRepr):
    """Range-Doppler spectra of every channel."""

    spectrum: ComplexChannels
    """(..., velocity, tx, rx, range) complex amplitude of a tone, in the unit of the samples; "tx" as in the cube, or
    Tx elements for Doppler bands."""
    range: FloatArray
    """(range,) [m]"""
    velocity: FloatArray
    """(velocity,) [m/s], ascending; positive is receding."""

    @property
    def power(self) -> FloatArray:
        """(..., range, velocity) power, mean over the channels [W for samples in sqrt(W)]."""
        return squared_magnitude(self.spectrum).mean(axis=(-3, -2)).swapaxes(-1, -2)


def range_doppler(
    cube: ArrayLike,
    radar: Radar,
    *,
    range_window: Window = "hann",
    velocity_window: Window = "hann",
    range_bins: int | None = None,
    velocity_bins: int | None = None,
    correct_coupling: bool = False,
    correct_migration: bool = False,
    static: bool = True,
    all_bands: bool = False,
) -> RangeDoppler:
    """Windowed FFT over sample and chirp, for every frame, Tx and Rx element.

    Parameters
    ----------
    cube
        (..., chirp, tx, rx, sample), an array, or a tensor of PyTorch, of which the spectra are a tensor on its device.
    range_window, velocity_window
        Names for :func:`scipy.signal.get_window`.
    range_bins, velocity_bins
        FFT lengths, at least the number of samples and of chirps (the default).
    correct_coupling
        Whether the range-Doppler coupling of each Doppler bin is removed, for velocities within the radar's unambiguous
        interval.
    correct_migration
        Whether the Doppler frequency of each sample is that of the ramp's frequency there (keystone transform), so that
        targets that cross range cells keep their level and width, for the same velocities; for arrays alone.
    static
        Whether static returns are kept; see :func:`remove_static`.
    all_bands
        Whether Tx elements in Doppler bands keep the whole Doppler axis, which outside of the own band has the echoes
        of other elements and of faster targets.
    """
    if correct_migration and is_tensor(cube):
        raise ValueError("correct_migration is True for a tensor: give an array, cube.cpu().numpy()")
    array = separate_bands(check_cube(cube, radar, tensors=True), radar)
    if not static:
        array = remove_static(array)
    chirps, samples = array.shape[-4], array.shape[-1]
    range_bins = _bins("range_bins", range_bins, samples)
    velocity_bins = _bins("velocity_bins", velocity_bins, chirps)
    slow = taper(velocity_window, chirps)[:, None, None, None]
    window = constant((slow * taper(range_window, samples)).astype(real_type(array)), array)
    kept = slice(None) if all_bands else occupied_bins(radar, velocity_bins)
    velocity = _doppler_axis(radar, velocity_bins)[kept]
    tapered = array * window
    if correct_migration:
        doppler = _keystone(tapered, radar, velocity_bins)
    else:
        doppler = array_namespace(tapered).fft.fftshift(fast_fourier(tapered, velocity_bins, -4), -4)
    doppler = doppler[..., kept, :, :, :]
    if correct_coupling or radar.waveform.slope == 0:  # without a slope all beat frequencies are Doppler
        frequency = 2 * velocity / radar.wavelength
        turn = np.exp(-2j * np.pi * frequency[:, None] * np.arange(samples) / radar.waveform.sample_rate)
        doppler *= constant(turn.astype(complex_type(doppler)), doppler)[:, None, None, :]
    return RangeDoppler(
        spectrum=range_transform(doppler, radar, range_bins), range=range_axis(radar, range_bins), velocity=velocity
    )


def _keystone(array: Samples, radar: Radar, bins: int) -> ComplexChannels:
    """Doppler spectra (..., velocity, tx, rx, sample), each sample on the velocity axis of its own frequency.

    Source: R. Perry, R. DiPietro and R. Fante, IEEE Trans. AES-35 (1999), 188; as a chirp-z transform.
    """
    chirps, samples = array.shape[-4], array.shape[-1]
    middle = 0.5 * (samples - 1)
    step = radar.waveform.slope / radar.waveform.sample_rate
    scale = 1 + step * (np.arange(samples) - middle) / radar.center_frequency
    cycles = fft.fftshift(fft.fftfreq(bins))
    result = np.empty((*array.shape[:-4], bins, *array.shape[-3:]), np.result_type(array.dtype, np.complex64))
    for sample in range(samples):
        transform = CZT(
            chirps, bins, w=np.exp(-2j * np.pi * scale[sample] / bins), a=np.exp(2j * np.pi * scale[sample] * cycles[0])
        )
        # The middle of the frame keeps its range.
        turn = np.exp(2j * np.pi * (scale[sample] - 1) * cycles * (chirps - 1) / 2)
        result[..., sample] = transform(array[..., sample], axis=-3) * turn[:, None, None]
    return result


def squared_magnitude(values: Any) -> Any:
    """|values|² of a complex array or tensor, in double precision."""
    power = as_type(values.real, "float64") ** 2
    power += as_type(values.imag, "float64") ** 2
    return power


def coupling(radar: Radar, velocity: ArrayLike) -> FloatArray:
    """Offset [m] of a target of radial `velocity` [m/s] in the range spectrum, by range-Doppler coupling."""
    slope = radar.waveform.slope
    return np.asarray(velocity, dtype=np.float64) * (radar.center_frequency / slope if slope else 0.0)


def decibel(power: ArrayLike, *, floor: float = -400.0) -> FloatArray:
    """10 log10 of a power, at least `floor` [dB]."""
    return np.asarray(10 * np.log10(np.maximum(np.asarray(power, dtype=np.float64), 10 ** (floor / 10))))


def watts_to_dbm(power: ArrayLike) -> FloatArray:
    """Power in watts as dBm."""
    return decibel(power) + 30.0


def _bins(name: str, bins: int | None, least: int) -> int:
    if bins is None:
        return least
    if isinstance(bins, bool) or not isinstance(bins, int | np.integer) or bins < least:
        raise ValueError(f"{name} is {bins!r}: a whole number of at least {least} is needed")
    return int(bins)
