"""Accuracy of the sum of paths that keeps the return of each object within a tolerance."""

from __future__ import annotations

import numpy as np

from rfgen_sionna.radar import Radar
from rfgen_sionna.records import RadarPaths
from rfgen_sionna.signal.path_phases import element_gains

TOLERANCE_SHARE = 0.3
"""Share of the tolerance that summing paths up may use."""
MIN_EPS = 1e-7
"""No sums are asked to be more accurate for what interference leaves of one of many objects."""
_BAND_POSITIONS = (-1.0, 0.0, 1.0)


def required_eps(radar: Radar, paths: RadarPaths, rtol: float, still: int = 0) -> float:
    """The `eps` of :func:`rfgen_sionna.signal.synthesize` with which each object's samples are right to
    `TOLERANCE_SHARE` of `rtol`, relative to themselves.

    What a transform errs by goes with what paths return one by one, and the tolerance with what an object's return
    together: of a plate that lies aslant that may be a thousandth. It is told for one pair of elements at the middle
    of the time and three frequencies. So many of the first objects as are `still` share one tolerance, relative
    to what they return one by one.
    """
    loose, tight = TOLERANCE_SHARE * rtol, min(MIN_EPS, TOLERANCE_SHARE * rtol)
    if not paths.num_paths:
        return loose
    gains, patterns = paths.a[0, 0], element_gains(radar, paths)
    weight = patterns[:, patterns.shape[1] // 2]
    middle = gains.shape[1] // 2
    tau = paths.tau[0, 0, :, paths.tau.shape[3] // 2]
    orders = [gains[:, middle]]
    if paths.dispersion is not None:
        orders += [each[0, 0, :, each.shape[3] // 2] for each in paths.dispersion]
    count, lot = len(paths.object_names), np.where(paths.object_id < still, 0, paths.object_id)
    together = np.zeros(count)
    for place in _BAND_POSITIONS:
        frequency = paths.frequency + place * paths.half_band
        waves = sum(each * place**order for order, each in enumerate(orders))
        waves = waves * weight * np.exp(-2j * np.pi * np.mod(frequency * tau, 1.0))
        real, imaginary = (np.bincount(lot, part, count) for part in (waves.real, waves.imag))
        together += (real**2 + imaginary**2) / len(_BAND_POSITIONS)
    single = np.abs(orders[0] * weight) ** 2
    alone = float(np.sqrt(single.sum()))
    if still:
        together[0] = max(together[0], single[lot == 0].sum())
    there = together[np.unique(lot)]
    if not alone > 0.0:
        return loose
    return float(np.clip(loose * np.sqrt(there.min()) / alone, max(tight, 1e-9), max(loose, 1e-9)))
