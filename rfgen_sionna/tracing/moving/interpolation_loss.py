"""Errors of splines between instants, where shadows' edges pass."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import ComplexArray, FloatArray
from rfgen_sionna.tracing.moving.knots import TERMINATOR_GAPS, spline_error

_SPREAD = 2.0
"""Standard deviations by which what facets err by together may be more than some times tell, ..."""
_MIN_SAMPLES = 2.0
"""... which are so many at least: of one in step with its fringes a facet misses nothing."""


def has_shadow_edge(shares: FloatArray) -> NDArray[np.bool_]:
    """(facet,) whether the edge of a shadow is on a facet, or passes it, by its `shares` (facet, instant)."""
    rows = np.ascontiguousarray(shares.T)  # many times faster along long rows
    low, high = rows.min(axis=0), rows.max(axis=0)
    return np.asarray((high > low) | ((low > 0) & (low < 1)))


def leave_one_out(gains: ComplexArray) -> ComplexArray:
    """(facet, inner time) by how much `gains` (facet, time) at evenly spaced times differ from the polynomials through
    their four neighbours; through all others, of four or three times. Where an edge passes, errors go with the gap, so
    that this is twice what splines through all miss."""
    count = gains.shape[1]
    weights = np.zeros((max(count - 2, 0), count))
    for k, row in enumerate(weights, 1):
        first = min(max(k - 2, 0), max(count - 5, 0))
        others = [m for m in range(first, min(first + 5, count)) if m != k]
        for m in others:
            row[m] = -np.prod([(k - other) / (m - other) for other in others if other != m])
        row[k] = 1.0
    return np.asarray(gains @ weights.T)


def largest_energy(missed: ComplexArray) -> FloatArray:
    """(facet,) largest energy of what is `missed` (facet, time): by chance it is little at one time or another."""
    return np.asarray((missed.real**2 + missed.imag**2).max(axis=1, initial=0.0))


def interpolation_loss(swing: FloatArray, gaps: int = TERMINATOR_GAPS) -> FloatArray:
    """(facet,) share of the energy of phasors that swing by so much [rad] from time to time that splines with so many
    `gaps` miss, with many of them as much as at their rim: an edge is not on a facet for long."""
    return np.asarray(np.minimum(spline_error(swing, min(gaps, TERMINATOR_GAPS)), 1.0) ** 2)


def rms(parts: ComplexArray) -> FloatArray:
    """(part,) root mean squares over time of `parts` (part, time)."""
    return np.asarray(np.sqrt((parts.real**2 + parts.imag**2).mean(axis=1)))


def missed_energy(
    gains: ComplexArray,
    phasors: ComplexArray,
    shares: FloatArray,
    width: FloatArray,
    surface: NDArray[np.integer[Any]],
    count: int,
) -> FloatArray:
    """(surface,) energy, the mean over time, that splines miss in between of each of `count` surfaces: what is left out
    of all facets as they add up, or more, of each facet what is left out, or what an edge swings by, as far as it may
    be by chance that they add up to less. The other arguments are those of :func:`choose`, at evenly spaced times.

    An edge that leaves a facet comes upon its neighbour: what splines miss of the two cancels nearly where facets are
    small, by a factor of three on a ball. Of the sum's energy n times at which it is as large tell to 1 / sqrt(n)."""
    energy, missed = gains.real**2 + gains.imag**2, leave_one_out(gains)
    swung = np.maximum(energy[:, 1:], energy[:, :-1]) * interpolation_loss(
        width[:, None] * np.abs(np.diff(shares, axis=1)), gains.shape[1] - 1
    )
    apart = np.bincount(surface, np.maximum(rms(missed) ** 2, swung.mean(axis=1)), count)
    missed = missed * phasors[:, 1:-1]
    together = np.stack([missed[surface == number].sum(axis=0) for number in range(count)])
    at_times = together.real**2 + together.imag**2
    total, square = at_times.sum(axis=1), (at_times**2).sum(axis=1)
    tell = total**2 / np.where(square > 0, square, np.inf)  # so many times
    summed = total / at_times.shape[1]
    by_chance = (1.0 + _SPREAD / np.sqrt(np.maximum(tell, 1e-12))) ** 2 * summed
    return np.asarray(np.maximum(summed, np.where(tell > _MIN_SAMPLES, np.minimum(apart, by_chance), apart)))
