"""Smooth paths through noisy joint positions: gaps, glitches, and a cut-off by generalised cross-validation."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from scipy.fft import dct
from scipy.interpolate import PchipInterpolator, make_smoothing_spline
from scipy.ndimage import median_filter

from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.motion.clip_error import ClipError

LONGEST_GAP = 0.5
"""Longest gap that is interpolated [s]: half a step of walking; beyond, the path between is a guess."""
MAX_ACCELERATION = 150.0
"""Upper bound of a joint's acceleration [m/s²]: feet and hands of kicks and punches reach about 100."""
_GLITCH = 0.03
"""Least distance of a glitch from the median of its neighbours [m]: above the noise of depth cameras."""
_CUT_OFFS = np.geomspace(1.0, 6.0, 10)
"""Cut-off frequencies to choose from [Hz]; people's voluntary movement ends at about 6 Hz (Winter 2009)."""
_LEAST_WEIGHT = 0.05
"""Weight of a position of confidence 0.05 and less, relative to one of confidence 1."""
_LEAST_RATE = 30.0
"""Least rate of the smooth path [Hz]: rotations between poses are interpolated."""


def smooth_paths(
    times: FloatArray,
    positions: FloatArray,
    weights: FloatArray,
    names: Sequence[str],
    longest_gap: float = LONGEST_GAP,
) -> tuple[FloatArray, FloatArray, float]:
    """Smoothing splines through joint positions, at a uniform rate.

    Cubic smoothing splines (penalty on the acceleration); the cut-off of each joint is the one of 1 to 6 Hz with the
    least generalised cross-validation score (Craven and Wahba 1979), lowered while its acceleration is beyond people's.

    Args:
        times: (frame,) increasing [s].
        positions: (frame, joint, 3) [m], NaN where missing.
        weights: (frame, joint) confidences 0 to 1.
        names: (joint,) names for messages.
        longest_gap: longest gap that is interpolated [s].

    Returns:
        (sample,) times and (sample, joint, 3) positions, and their rate [Hz].

    Raises:
        ClipError: a joint is missing, or longer than `longest_gap`.
    """
    step = float(np.median(np.diff(times))) if len(times) > 1 else 1.0
    rate = 1.0 / step * max(1, int(np.ceil(_LEAST_RATE * step - 1e-6)))
    count = max(1, round((times[-1] - times[0]) * rate) + 1)
    at = times[0] + np.arange(count) / rate
    out = np.empty((count, len(names), 3))
    for j, name in enumerate(names):
        seen = np.asarray(np.isfinite(positions[:, j]).all(axis=-1))
        check_gaps(times, seen, name, longest_gap)
        seen[seen] = ~_glitches(times[seen], positions[seen, j])
        t, y, w = times[seen], positions[seen, j], np.clip(weights[seen, j], _LEAST_WEIGHT, 1.0)
        out[:, j] = _curve(t, y, w, step)(np.clip(at, t[0], t[-1]))
    return at, out, rate


def check_gaps(times: FloatArray, seen: np.ndarray, name: str, longest_gap: float) -> None:
    """Check that a joint is missing for `longest_gap` [s] at most.

    Raises:
        ClipError: it is not; the message names the joint and the times.
    """
    if not seen.any():
        raise ClipError(f"{name}: missing in all frames; leave the joint out, or take a clip in which it is seen")
    if len(times) < 2:
        return
    step = float(np.median(np.diff(times)))
    known = np.concatenate([[times[0] - step], times[seen], [times[-1] + step]])
    gaps = np.diff(known) - step
    worst = int(np.argmax(gaps))
    if gaps[worst] > longest_gap + 1e-9:
        raise ClipError(
            f"{name}: missing from {known[worst] - times[0]:.2f} s to {known[worst + 1] - times[0]:.2f} s after the "
            f"start; at most {longest_gap:g} s are interpolated: cut the clip there, or raise longest_gap="
        )


def _glitches(times: FloatArray, path: FloatArray) -> np.ndarray:
    """(frame,) positions that are off the median of five by an acceleration that nobody reaches."""
    if len(path) < 5:
        return np.zeros(len(path), bool)
    distance = np.linalg.norm(path - median_filter(path, size=(5, 1), mode="nearest"), axis=-1)
    step = np.median(np.diff(times))
    off = (distance > _GLITCH) & (2.0 * distance / step**2 > MAX_ACCELERATION)
    return off if off.sum() <= len(path) // 4 else np.zeros(len(path), bool)


def _curve(t: FloatArray, y: FloatArray, w: FloatArray, step: float) -> Callable[[FloatArray], FloatArray]:
    """Path (time,) -> (time, 3) through positions `y` (n, 3) at times `t` (n,) with weights `w` (n,)."""
    if len(t) == 1:
        return lambda at: np.broadcast_to(y[0], (len(at), 3))
    if len(t) < 5:
        return PchipInterpolator(t, y)
    best = _cut_off(y, step)
    while True:
        curve = make_smoothing_spline(t, y, w, lam=(2.0 * np.pi * best) ** -4 / step)
        fastest = float(np.linalg.norm(curve(t, 2), axis=-1).max())
        if fastest <= MAX_ACCELERATION or best <= _CUT_OFFS[0]:
            return curve
        best *= 0.8


def _cut_off(y: FloatArray, step: float) -> float:
    """Cut-off [Hz] with the least generalised cross-validation score, for samples taken as uniform."""
    n = len(y)
    spectrum = dct(y, axis=0, norm="ortho")
    angle = (2.0 - 2.0 * np.cos(np.pi * np.arange(n) / n)) ** 2
    gains = 1.0 / (1.0 + angle / (2.0 * np.pi * _CUT_OFFS[:, None] * step) ** 4)
    left = np.einsum("cn,nk->c", (1.0 - gains) ** 2, spectrum**2)
    return float(_CUT_OFFS[np.argmin(left / np.maximum(n - gains.sum(axis=1), 1e-9) ** 2)])
