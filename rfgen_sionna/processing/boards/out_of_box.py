"""Point clouds of TI's out-of-box demonstrations, from samples: what the boards of public data sets report.

The steps, their order and their integer arithmetic are those of the mmWave SDK's demonstration: range transform, static
clutter removal, Doppler transform, detection map (sum of log2 magnitudes over the virtual channels), CFAR along range
(and Doppler, from SDK 3 on), peak grouping, compensation of the slots' times, 64-point azimuth transform, elevation by
the phase between two rows, a second azimuth peak. Points come in the order of Doppler bins 0, 1, …, -1, each by
ascending range, are cut at `max_points`, and second azimuth peaks follow.

The IWR1443 runs this in a hardware accelerator on 16-bit integers: samples are words of the ADC, a range bin has a
quarter of its windowed sum, a Doppler bin a mean, both rounded; the detection map has steps of 1/512 of a power of two,
where a magnitude of 0 counts as 1/256. Sources: TI, "mmWave SDK user's guide" 2.1 (cfarCfg, peakGrouping,
multiObjBeamForming), the demonstration's source for the xWR14xx, and "Radar hardware accelerator user's guide" SWRU526.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from math import ceil, log2
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import fft
from scipy.signal import get_window

from rfgen_sionna._types import FloatArray
from rfgen_sionna.processing.array_namespace import (
    array_namespace,
    constant,
    fast_fourier,
    of_real_parts,
    real_parts,
    to_numpy,
)
from rfgen_sionna.processing.boards.board_points import BoardPoints
from rfgen_sionna.processing.boards.range_cfar import CfarSettings, noise_level
from rfgen_sionna.processing.boards.virtual_rows import VirtualRows, virtual_rows
from rfgen_sionna.processing.multiplexing import entry_times
from rfgen_sionna.processing.spectrum import check_cube

if TYPE_CHECKING:
    from rfgen_sionna.radar import Radar

_BIT_DB = float(20 * np.log10(2))
"""Level of one power of two in magnitude [dB]."""
_BATCH = 64
"""Frames that are transformed at once, which bounds the memory."""

Channels = NDArray[np.complexfloating[Any, Any]]


@dataclass(frozen=True)
class OutOfBoxChain:
    """Settings of the demonstration's chain; the defaults are the IWR1443's with three Tx, as its profile has them."""

    range_window: str = "blackman"
    """Window of the range transform."""
    doppler_window: str = "hann"
    """Window of the Doppler transform."""
    clutter_removal: bool = False
    """Whether the mean over the chirps is subtracted (`clutterRemoval`)."""
    range_cfar: CfarSettings = field(default_factory=lambda: CfarSettings(threshold_db=20.0))
    """CFAR along range. The IWR1443's 1280 is 15 dB with 8 channels and 20 dB with 12."""
    doppler_cfar: CfarSettings | None = None
    """CFAR along Doppler, which cells have to pass, too (SDK 3); None leaves it out (SDK 2)."""
    group_range: bool = False
    """Whether a detection has to be a maximum over its neighbours in range."""
    group_doppler: bool = True
    """Whether a detection has to be a maximum over its neighbours in Doppler."""
    range_bins: tuple[int, int] = (1, 229)
    """First and last range bin of detections."""
    second_peak: float | None = 0.5
    """Smallest share of the strongest azimuth peak for a second point; None reports none."""
    angle_bins: int = 64
    """Length of the azimuth transform."""
    max_points: int = 64
    """Largest number of points of a frame."""
    integers: bool = True
    """Whether bins are rounded to integers and coordinates to the TLV's fixed point."""
    full_scale_dbm: float | None = -26.0
    """Power of a full-scale tone at the receiver's input [dBm], which gives the ADC's steps from samples in sqrt(W);
    None takes samples as words. A receiver gain of 30 dB before 4 dBm is the default."""

    def __post_init__(self) -> None:
        if self.max_points < 1 or self.angle_bins < 8:
            raise ValueError(f"max_points is {self.max_points}, angle_bins {self.angle_bins}: >= 1 and >= 8 are needed")
        if self.range_bins[0] < 0 or self.range_bins[0] > self.range_bins[1]:
            raise ValueError(f"range_bins is {self.range_bins}: two ascending bins of at least 0 are needed")

    @property
    def step(self) -> float:
        """Amplitude of one word of a 16-bit ADC, in the unit of the samples."""
        if self.full_scale_dbm is None:
            return 1.0
        return float(np.sqrt(10 ** ((self.full_scale_dbm - 30) / 10)) / 2**15)


def out_of_box_points(cube: ArrayLike, radar: Radar, chain: OutOfBoxChain | None = None) -> BoardPoints:
    """Points of each frame, simulated or measured.

    Parameters
    ----------
    cube
        (frame, chirp, tx, rx, sample) complex samples, a NumPy array or a tensor of PyTorch on any device, in sqrt(W)
        or, for a `full_scale_dbm` of None, in words of the ADC. Of a tensor, all up to the detections is done on its
        device; the points are NumPy arrays.
    chain
        Settings; None takes the defaults.

    Raises
    ------
    ValueError
        For a cube or an array that the chain does not take, naming what is needed.
    TypeError
        For a cube that is neither an array nor a tensor.
    """
    chain = OutOfBoxChain() if chain is None else chain
    array = check_cube(cube, radar, frames=True, tensors=True)
    rows = virtual_rows(radar)
    if radar.waveform.slope <= 0 or radar.adc.real or radar.waveform.multiplexing != "tdm":
        raise ValueError(f"radar '{radar.name}': the chain takes complex samples of rising ramps in TDM")
    parts = [
        _points(array[start : start + _BATCH], radar, chain, rows, start) for start in range(0, len(array), _BATCH)
    ]
    names = [name for name in vars(parts[0]) if name != "frames"]
    joined = {name: np.concatenate([getattr(part, name) for part in parts]) for name in names}
    return BoardPoints(**joined, frames=len(array))


def channel_maps(array: Any, chain: OutOfBoxChain) -> Any:
    """(frame, Doppler, range, tx, rx) bins of the two transforms, Doppler from 0 on, in words."""
    xp = array_namespace(array)
    chirps, samples = array.shape[1], array.shape[-1]
    fast = get_window(chain.range_window, samples, fftbins=False) / (4 * chain.step)
    slow = get_window(chain.doppler_window, chirps, fftbins=False) * (2 / chirps)
    fast, slow = (constant(window.astype(np.float32), array) for window in (fast, slow))
    ranges = _rounded(fast_fourier(array * fast, _power_of_two(samples), -1), chain.integers)
    if chain.clutter_removal:
        ranges = _rounded(ranges - ranges.mean(axis=1, keepdims=True), chain.integers)
    doppler = fast_fourier(ranges * slow[:, None, None, None], _power_of_two(chirps), 1)
    return xp.moveaxis(_rounded(doppler, chain.integers), -1, 2)


def detection_map(channels: Any, integers: bool) -> Any:
    """(frame, Doppler, range) sum of log2 magnitudes over the channels, over the next power of two of their number."""
    xp = array_namespace(channels)
    floor = 2.0**-8 if integers else float(np.finfo(np.float32).tiny)
    bits = xp.log2(xp.clip(xp.abs(channels), floor, None)).sum(axis=(-2, -1), dtype=xp.float64)
    level = bits / _power_of_two(channels.shape[-2] * channels.shape[-1])
    return xp.floor(level * 512) / 512 if integers else level


def _detections(level: Any, chain: OutOfBoxChain, unit_db: float) -> tuple[Any, Any]:
    """Cells (frame, Doppler, range) of `level`, in units of `unit_db`, that are points, and the noise of all cells."""
    xp = array_namespace(level)
    noise = noise_level(level, chain.range_cfar, axis=2)
    detected = level - noise > chain.range_cfar.threshold_db / unit_db
    if chain.doppler_cfar is not None:
        along = noise_level(level, chain.doppler_cfar, axis=1)
        detected &= level - along > chain.doppler_cfar.threshold_db / unit_db
    low, high = chain.range_bins
    detected[..., :low] = False
    detected[..., high + 1 :] = False
    if chain.group_doppler:
        detected &= (level >= xp.roll(level, 1, 1)) & (level >= xp.roll(level, -1, 1))
    if chain.group_range:
        detected[..., 1:] &= level[..., 1:] >= level[..., :-1]
        detected[..., :-1] &= level[..., :-1] >= level[..., 1:]
    return detected, noise


def _points(array: Any, radar: Radar, chain: OutOfBoxChain, rows: VirtualRows, first: int) -> BoardPoints:
    channels = channel_maps(array, chain)
    level = detection_map(channels, chain.integers)
    count = channels.shape[-2] * channels.shape[-1]
    unit_db = _BIT_DB * _power_of_two(count) / count
    detected, noise = _detections(level, chain, unit_db)
    frame, doppler, place = np.nonzero(to_numpy(detected))
    kept = _rank_in_frame(frame, len(array)) < chain.max_points
    frame, doppler, place = frame[kept], doppler[kept], place[kept]
    snr = to_numpy((level - noise)[frame, doppler, place]) * unit_db
    chirps = channels.shape[1]
    signed = np.where(doppler >= chirps // 2, doppler - chirps, doppler)
    values = _compensated(to_numpy(channels[frame, doppler, place]), radar, signed / chirps)
    beams, above = _beams(values, rows, chain.angle_bins)
    strength = np.abs(beams)
    best = strength.argmax(axis=1) if len(strength) else np.zeros(0, np.int64)
    index = np.arange(len(frame))
    picks = [(index, best)]
    if chain.second_peak is not None and len(frame):
        second, share = _second_peaks(strength, best)
        also = np.flatnonzero(share > chain.second_peak)
        free = chain.max_points - np.bincount(frame, minlength=len(array))
        also = also[_rank_in_frame(frame[also], len(array)) < free[frame[also]]]
        picks.append((also, second[also]))
    owner = np.concatenate([pick[0] for pick in picks])
    beam = np.concatenate([pick[1] for pick in picks])
    order = np.argsort(frame[owner], kind="stable")
    owner, beam = owner[order], beam[order]
    return _located(
        radar, chain, rows, frame[owner] + first, place[owner], signed[owner], beams[owner, beam],
        above[owner, beam] if above is not None else None, beam, snr[owner], channels.shape[2], len(array),
    )  # fmt: skip


def _located(
    radar: Radar,
    chain: OutOfBoxChain,
    rows: VirtualRows,
    frame: NDArray[np.int64],
    place: NDArray[np.int64],
    doppler: NDArray[np.int64],
    beam: Channels,
    above: Channels | None,
    bin_number: NDArray[np.int64],
    snr: FloatArray,
    bins: int,
    frames: int,
) -> BoardPoints:
    """Points at their coordinates, in the TLV's fixed point for integers."""
    half = chain.angle_bins // 2
    across = np.where(bin_number >= half, bin_number - chain.angle_bins, bin_number) / half
    step = radar.waveform.range_window / bins
    distance = place.astype(np.float64) * step
    up = np.zeros(len(frame))
    if above is not None and len(frame):
        turns = np.angle(beam * np.conj(above)) / np.pi + rows.offset * across
        up = (turns - 2 * np.round(turns / 2)) / rows.height
    peak = np.abs(beam).astype(np.float64) / len(rows.azimuth)
    right, upward = distance * across, distance * up
    ahead = np.sqrt(np.maximum(distance**2 - right**2 - upward**2, 0.0))
    position = np.stack([ahead, -right, upward], axis=1).astype(np.float64)
    if chain.integers:
        scale = float(2 ** ceil(log2(16 / step)))
        position = np.asarray(np.sign(position) * np.floor(np.abs(position) * scale + 0.5) / scale)
        peak = np.floor(peak + 0.5)
    wave = radar.waveform
    cell = float(radar.wavelength / 2 / (_power_of_two(wave.num_loops) * wave.loop_period))
    velocity = doppler.astype(np.float64) * cell
    return BoardPoints(frame, place, doppler, position, distance, velocity, peak, snr, frames)


def _compensated(values: Channels, radar: Radar, cycles: FloatArray) -> Channels:
    """Channels (n, tx, rx) without the Doppler phase of their slots; `cycles` (n,) a loop."""
    share = entry_times(radar) / radar.waveform.loop_period
    return np.asarray(values * np.exp(-2j * np.pi * cycles[:, None] * share)[..., None])


def _beams(values: Channels, rows: VirtualRows, bins: int) -> tuple[Channels, Channels | None]:
    """(n, bin) azimuth spectra of the azimuth and of the elevation row."""
    azimuth = fft.fft(values[:, rows.azimuth[:, 0], rows.azimuth[:, 1]], n=bins, axis=1)
    if not len(rows.elevation):
        return azimuth, None
    return azimuth, fft.fft(values[:, rows.elevation[:, 0], rows.elevation[:, 1]], n=bins, axis=1)


def _second_peaks(strength: FloatArray, best: NDArray[np.int64]) -> tuple[NDArray[np.int64], FloatArray]:
    """Bin of the strongest beam outside of the first peak, which ends where the spectrum rises, and its share of it."""
    bins = strength.shape[1]
    shifted = np.take_along_axis(strength, (best[:, None] + np.arange(bins)) % bins, axis=1)
    right = _descent(shifted)
    left = _descent(np.roll(shifted[:, ::-1], 1, axis=1))
    offsets = np.arange(bins)
    outside = (offsets > right[:, None]) & (offsets < bins - left[:, None])
    rest = np.where(outside, shifted, 0.0)
    second = rest.argmax(axis=1)
    return (best + second) % bins, rest.max(axis=1) / np.maximum(shifted[:, 0], np.finfo(float).tiny)


def _descent(shifted: FloatArray) -> NDArray[np.int64]:
    """Number of steps from bin 0 until the spectrum rises."""
    rising = np.diff(shifted, axis=1) > 0
    return np.where(rising.any(axis=1), rising.argmax(axis=1), shifted.shape[1])


def _rank_in_frame(frame: NDArray[np.int64], frames: int) -> NDArray[np.int64]:
    """Position of each entry among those of its frame, for ascending frames."""
    counts = np.bincount(frame, minlength=frames)
    starts = np.cumsum(counts) - counts
    return np.asarray(np.arange(len(frame)) - starts[frame])


def _rounded(values: Any, integers: bool) -> Any:
    """Real and imaginary parts rounded to 16-bit integers that saturate."""
    if not integers:
        return values
    parts = real_parts(values)
    xp = array_namespace(parts)
    return of_real_parts(xp.clip(xp.round(parts), -(2**15), 2**15 - 1))


def _power_of_two(count: int) -> int:
    """Smallest power of two of at least `count`."""
    return 1 << (count - 1).bit_length()
