"""Gains of the virtual channels and range bias of a board: estimated from a corner reflector, removed from cubes."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import minimize_scalar

from rfgen_sionna._short_repr import ShortRepr
from rfgen_sionna._types import SPEED_OF_LIGHT, ComplexArray, FloatArray
from rfgen_sionna.processing.multiplexing import Samples
from rfgen_sionna.processing.spectrum import check_cube, complex_samples, real_samples, taper

if TYPE_CHECKING:
    from rfgen_sionna.radar import Radar

_FORMAT = "rfgen-calibration"
_KEYS = ("format", "tx_names", "rx_names", "gains_real", "gains_imag", "range_bias_m")
_LEAST_SNR, _LEAST_COHERENCE = 10.0, 0.5
"""Least power of the reflector over the median of the range axis, and of the mean over chirps and frames over that of
single ones."""
_STEPS = 8
"""Trials of the range bias per range cell before the refinement."""


@dataclass(frozen=True, eq=False, repr=False)
class Calibration(ShortRepr):
    """Errors of a board's channels.

    Raises
    ------
    ValueError
        Shape or values of a field are wrong.
    """

    gains: ComplexArray
    """(tx, rx) factor of the samples of each channel over those of an ideal board."""
    tx_names: tuple[str, ...]
    rx_names: tuple[str, ...]
    range_bias: float = 0.0
    """Distance that ranges appear too far [m]."""

    def __post_init__(self) -> None:
        for name in ("tx_names", "rx_names"):
            object.__setattr__(self, name, tuple(getattr(self, name)))
        gains, shape = np.array(self.gains, dtype=np.complex128), (len(self.tx_names), len(self.rx_names))
        if gains.shape != shape or not np.all(np.isfinite(gains)) or np.any(gains == 0):
            raise ValueError(
                f"calibration.gains have shape {gains.shape}: finite factors other than 0 of shape {shape} are needed, "
                f"for {', '.join(self.tx_names)} and {', '.join(self.rx_names)}"
            )
        if not abs(self.range_bias) <= 10:
            raise ValueError(f"calibration.range_bias is {self.range_bias!r}: a distance of -10 … 10 m is needed")
        gains.setflags(write=False)
        object.__setattr__(self, "gains", gains)
        object.__setattr__(self, "range_bias", float(self.range_bias))

    def apply(self, cube: ArrayLike, radar: Radar) -> Samples:
        """Samples (..., chirp, tx, rx, sample) of an ideal board, from those of this one.

        Further processing takes the result in place of the `cube`. Elements are found by their names.

        Raises
        ------
        ValueError
            The cube does not fit the radar, entries of "tx" are no Tx elements, or the radar has unknown elements.
        """
        array = _element_samples(cube, radar)
        index = []
        for end, known, wanted in (("Tx", self.tx_names, radar.tx_names), ("Rx", self.rx_names, radar.rx_names)):
            if missing := [name for name in wanted if name not in known]:
                raise ValueError(
                    f"calibration has the {end} elements {', '.join(known)}; radar '{radar.name}' with preset "
                    f"'{radar.preset}' has {', '.join(missing)} besides: take the calibration of this board"
                )
            index.append([known.index(name) for name in wanted])
        delay = np.array(2 * self.range_bias / SPEED_OF_LIGHT)
        factor = np.conj(_beats(radar, delay, array.shape[-1])) / self.gains[np.ix_(*index)][..., None]
        corrected = complex_samples(array, radar) * factor
        return real_samples(corrected, radar).astype(array.dtype)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write a JSON file."""
        values = (
            *(_FORMAT, self.tx_names, self.rx_names),
            *(self.gains.real.tolist(), self.gains.imag.tolist(), self.range_bias),
        )
        Path(path).write_text(json.dumps(dict(zip(_KEYS, values, strict=True)), indent=1), encoding="utf-8")

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Calibration:
        """Read a file of :meth:`save`; ValueError for another file."""
        try:
            record: Any = json.loads(Path(path).read_text(encoding="utf-8"))
        except ValueError as error:
            raise ValueError(
                f"calibration file '{path}' is not JSON: {error} (read_cfg_calibration reads that of TI's .cfg)"
            ) from error
        if not isinstance(record, dict) or record.get("format") != _FORMAT or set(record) != set(_KEYS):
            raise ValueError(
                f"calibration file '{path}' has {', '.join(map(str, record))}: the keys {', '.join(_KEYS)} are needed, "
                f"with the format {_FORMAT}"
            )
        gains = np.array(record["gains_real"]) + 1j * np.array(record["gains_imag"])
        try:
            return cls(gains, record["tx_names"], record["rx_names"], record["range_bias_m"])
        except ValueError as error:
            raise ValueError(f"calibration file '{path}': {error}") from error


def estimate_calibration(cube: ArrayLike, radar: Radar, position: ArrayLike, *, max_bias: float = 0.5) -> Calibration:
    """Calibration from static frames of a corner reflector, the strongest return near its range.

    The paths between the elements and the reflector have their exact lengths, so that it may stand in the near field of
    the array. The range bias is the peak of the power over all channels, between bins. Gains are relative to the first
    channel in phase and to the mean of all in power; the elements' phases in the radar are not in them.

    Parameters
    ----------
    cube
        (..., chirp, tx, rx, sample).
    position
        (3,) place of the reflector in the world frame [m].
    max_bias
        Largest range bias to search [m].

    Raises
    ------
    ValueError
        The cube does not fit the radar, entries of "tx" are no Tx elements, the reflector is out of range, moves, or is
        not there.
    """
    place = np.asarray(position, np.float64)
    if place.shape != (3,) or not np.all(np.isfinite(place)):
        raise ValueError(f"position is {position!r}: x, y, z of the reflector [m] are needed")
    wave = radar.waveform
    if wave.slope == 0:
        raise ValueError(f"radar '{radar.name}' with preset '{radar.preset}' has a slope of 0: a ramp is needed")
    if not 0 < max_bias <= 10:
        raise ValueError(f"max_bias is {max_bias!r}: a distance of up to 10 m is needed")
    samples = complex_samples(_element_samples(cube, radar), radar)
    samples = samples.reshape(-1, *samples.shape[-3:])
    out, back = (np.linalg.norm(place - elements, axis=1) for elements in (radar.tx_world, radar.rx_world))
    path = out[:, None] + back
    if not 2 * radar.range_resolution < path.mean() / 2 < radar.max_range:
        raise ValueError(
            f"position is {path.mean() / 2:.3g} m away: radar '{radar.name}' has ranges of "
            f"{2 * radar.range_resolution:.3g} … {radar.max_range:.3g} m"
        )
    tx_feeds, rx_feeds = radar.feed_factors
    ideal = _beats(radar, path / SPEED_OF_LIGHT, samples.shape[-1]) / (out[:, None] * back)[..., None]
    ideal *= np.conj(tx_feeds[:, None] * rx_feeds)[..., None]
    # Over the ideal beat, the reflector is at the frequency of the range bias.
    ratio = samples / ideal
    bias = _range_bias(ratio.mean(axis=0), radar, max_bias, float(path.mean() / 2))
    single = _responses(ratio, radar, bias)
    gains = single.mean(axis=0)
    coherence = float(np.sum(np.abs(gains) ** 2) / np.mean(np.sum(np.abs(single) ** 2, axis=(1, 2))))
    if coherence < _LEAST_COHERENCE:
        raise ValueError(
            f"the mean over chirps and frames has {100 * coherence:.0f} % of the power of single ones: the reflector "
            "moves, or the radar does, or it is too weak"
        )
    gains = gains * np.exp(-1j * np.angle(gains[0, 0])) / np.sqrt(np.mean(np.abs(gains) ** 2))
    return Calibration(gains, radar.tx_names, radar.rx_names, bias)


def _range_bias(ratio: ComplexArray, radar: Radar, max_bias: float, distance: float) -> float:
    """Bias [m] of the highest power over all channels of `ratio` (tx, rx, sample), within `max_bias` [m]."""

    def power(bias: float) -> float:
        return float(np.mean(np.abs(_responses(ratio, radar, bias)) ** 2))

    step = radar.range_resolution / _STEPS
    trials = step * np.arange(-np.ceil(max_bias / step), np.ceil(max_bias / step) + 1)
    levels = np.array([power(bias) for bias in trials])
    best = int(levels.argmax())
    spectrum = np.mean(np.abs(np.fft.fft(ratio * taper("hann", ratio.shape[-1]), axis=-1)) ** 2, axis=(0, 1))
    # Half of the axis is empty for real samples.
    excess = levels[best] / max(float(np.quantile(spectrum, 0.75)), 1e-300)
    if best in (0, len(trials) - 1) or excess < _LEAST_SNR:
        raise ValueError(
            f"no reflector within {max_bias:g} m of {distance:.3f} m: the highest level there is "
            f"{10 * np.log10(max(excess, 1e-30)):.1f} dB over the background, at {trials[best]:+.3f} m"
        )
    bounds = (float(trials[best - 1]), float(trials[best + 1]))
    found = minimize_scalar(lambda bias: -power(bias), bounds=bounds, method="bounded", options={"xatol": 1e-6 * step})
    return float(found.x)


def _responses(ratio: ComplexArray, radar: Radar, bias: float) -> ComplexArray:
    """(..., tx, rx) amplitudes at the frequency of a range bias [m], of samples over the ideal beat."""
    count = ratio.shape[-1]
    beat = _beats(radar, np.array(2 * bias / SPEED_OF_LIGHT), count)
    return np.asarray(ratio @ (np.conj(beat) * taper("hann", count)))


def _element_samples(cube: ArrayLike, radar: Radar) -> Samples:
    """Checked cube with an entry of the axis "tx" for each Tx element."""
    array = check_cube(cube, radar)
    if radar.axis_names != radar.tx_names:
        raise ValueError(
            f"radar '{radar.name}' with preset '{radar.preset}' has the slots {', '.join(radar.axis_names)}: gains are "
            "of Tx elements; cube, radar = processing.demultiplex(cube, radar) separates them"
        )
    return array


def _beats(radar: Radar, delay: FloatArray, count: int) -> ComplexArray:
    """(..., sample) beats of unit amplitude of paths of `delay` (...) [s]."""
    wave = radar.waveform
    times = wave.adc_start_time + np.arange(count) / wave.sample_rate
    late = np.asarray(delay)[..., None]
    cycles = wave.start_frequency * late + wave.slope * times * late - 0.5 * wave.slope * late**2
    return np.asarray(np.exp(2j * np.pi * (cycles - np.rint(cycles))))
