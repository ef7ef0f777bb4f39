"""Motion of a chest, a machine or a string below the range resolution, from the phase of its range bin."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import fft
from scipy.optimize import least_squares

from rfgen_sionna._short_repr import ShortRepr
from rfgen_sionna._types import ComplexArray, FloatArray
from rfgen_sionna.processing.spectrum import check_cube, observation_time, range_axis, range_spectrum

if TYPE_CHECKING:
    from rfgen_sionna.radar import Radar

_PADDING = 4
"""Range bins per sample: the bin of a chest is then within an eighth of a cell of its return."""
_UNCERTAIN = 0.1
"""Relative error of the scale from which on a warning is given."""
_FREQUENCIES = 1 << 14
"""Least number of points of the spectrum of a displacement."""


@dataclass(frozen=True, repr=False)
class Displacement(ShortRepr):
    """Displacement of the strongest moving return."""

    range: float
    """Centre of its range bin [m]."""
    time: FloatArray
    """(frame,) [s]"""
    displacement: FloatArray
    """(frame,) radial displacement of mean 0 [m]; positive is receding."""
    scale_error: float
    """Relative error of the scale of `displacement`: standard error of the radius of the fitted circle, or scatter
    about it. The rate does not depend on it."""

    def rate(self, low: float = 0.1, high: float = 0.7, *, without: float | None = None) -> float:
        """Frequency of the highest spectral line in `low` … `high` [Hz], those of breathing by default.

        Harmonics of the frequency `without` [Hz] are fitted and removed first: those of breathing hide a heart,
        `rate(0.8, 2.0, without=rate())`.

        Raises
        ------
        ValueError
            The limits are not in ascending order within 0 and half the frame rate, or the run is shorter than a period
            of `low`.
        """
        step = float(np.diff(self.time).mean())
        if not 0 < low < high <= 0.5 / step:
            raise ValueError(f"low is {low!r} and high {high!r}: 0 < low < high <= {0.5 / step:.3g} Hz is needed")
        if len(self.time) * step < 1 / low:
            raise ValueError(
                f"the run lasts {len(self.time) * step:.3g} s, less than a period of low = {low:g} Hz: take a longer "
                "run or a higher limit"
            )
        basis = [np.ones_like(self.time), self.time - self.time.mean()]
        if without is not None:
            phase = 2 * np.pi * np.outer(np.arange(1, int(high / without) + 1) * without, self.time)
            basis += [*np.cos(phase), *np.sin(phase)]
        parts = np.stack(basis, axis=1)
        rest = self.displacement - parts @ np.linalg.lstsq(parts, self.displacement, rcond=None)[0]
        steady = rest * np.hanning(len(self.time) + 2)[1:-1]
        bins = max(_FREQUENCIES, 4 * len(self.time))
        level, frequency = np.abs(fft.rfft(steady, bins)), fft.rfftfreq(bins, step)
        inside = np.flatnonzero((frequency >= low) & (frequency <= high))
        return float(frequency[inside[level[inside].argmax()]])


def displacement(
    cube: ArrayLike,
    radar: Radar,
    *,
    range_limits: tuple[float, float] | None = None,
    frame_times: ArrayLike | None = None,
) -> Displacement:
    """Displacement of the return that changes most from frame to frame.

    The chirps of a frame are averaged. The channels are combined by the first singular vector of the changes, a circle
    through the samples gives the static returns of the same bin, and its angle the displacement (arctangent
    demodulation: B.-K. Park et al., IEEE Trans. MTT-55 (2007), 1073).

    Parameters
    ----------
    cube
        (frame, chirp, tx, rx, sample) of at least 8 frames.
    range_limits
        Least and largest range [m]; None takes all but the first two cells, where antennas couple.
    frame_times
        (frame,) start of each frame [s]; None takes multiples of the frame period.

    Raises
    ------
    ValueError
        Wrong shape, too few frames, no range bin within the limits, or a radar without a slope.
    """
    array = check_cube(cube, radar, frames=True)
    frames = len(array)
    if frames < 8:
        raise ValueError(f"cube has {frames} frames: at least 8 are needed to follow a phase")
    given = np.arange(frames) * radar.waveform.frame_period if frame_times is None else frame_times
    times = np.asarray(given, dtype=np.float64)
    if times.shape != (frames,):
        raise ValueError(f"frame_times has shape {times.shape}: a time [s] for each of {frames} frames is needed")
    bins = _PADDING * array.shape[-1]
    ranges = range_axis(radar, bins)
    low, high = (2 * radar.range_resolution, np.inf) if range_limits is None else range_limits
    inside = np.flatnonzero((ranges >= low) & (ranges <= high))
    if len(inside) == 0:
        raise ValueError(
            f"range_limits are {low:.3g} … {high:.3g} m: radar '{radar.name}' has bins at {ranges[0]:.3g} … "
            f"{ranges[-1]:.3g} m"
        )
    spectrum = range_spectrum(array.mean(axis=1, keepdims=True), radar, bins=bins)[:, 0]
    spectrum = spectrum.reshape(frames, -1, spectrum.shape[-1])[..., inside]
    best = int(np.argmax(spectrum.var(axis=0).sum(axis=0)))
    channels = spectrum[..., best].astype(np.complex128)
    changes = channels - channels.mean(axis=0)
    _, _, vectors = np.linalg.svd(changes, full_matrices=False)
    signal = channels @ vectors[0].conj()
    centre, error = _fitted_circle(signal)
    if error > _UNCERTAIN:
        warnings.warn(
            "displacement: the samples lie on no clear circle, on a short arc or with changing amplitude: the scale is "
            f"uncertain by {100 * error:.0f} %, the rate is not",
            stacklevel=2,
        )
    moved = np.unwrap(np.angle(signal - centre)) * radar.wavelength / (4 * np.pi)
    return Displacement(float(ranges[inside[best]]), times + observation_time(radar), moved - moved.mean(), error)


def _fitted_circle(signal: ComplexArray | NDArray[Any]) -> tuple[complex, float]:
    """Centre of the circle nearest to the points by geometric distance, and the relative standard error of its
    radius."""
    x, y = signal.real, signal.imag
    scale = float(np.abs(signal - signal.mean()).max()) or 1.0
    columns = np.column_stack((x, y, np.full(len(x), scale)))
    a, b, c = np.linalg.lstsq(columns, x**2 + y**2, rcond=None)[0]
    start = np.array([a / 2, b / 2, np.sqrt(max(c * scale + (a**2 + b**2) / 4, 0.0))])

    def distances(circle: FloatArray) -> FloatArray:
        return np.asarray(np.hypot(x - circle[0], y - circle[1]) - circle[2])

    fit = least_squares(distances, start, x_scale=scale, loss="soft_l1", f_scale=0.1 * scale)
    found, residual = fit.x, distances(fit.x)
    covariance = np.linalg.pinv(fit.jac.T @ fit.jac) * residual.var()
    # Scatter of the size of the radius is no circle.
    error = max(float(np.sqrt(covariance[2, 2])), float(residual.std()))
    return complex(found[0], found[1]), error / max(abs(float(found[2])), 1e-30 * scale)
