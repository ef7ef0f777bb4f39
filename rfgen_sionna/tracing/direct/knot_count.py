"""Number of knots at which splines follow a motion: its phases, from the vertices alone, and its returns."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import ComplexArray, FloatArray
from rfgen_sionna.records import interpolate_knots, knot_weights
from rfgen_sionna.scene.mesh import lengths
from rfgen_sionna.tracing.direct.expansion_choice import group_sums
from rfgen_sionna.tracing.direct.settings import MAX_KNOTS
from rfgen_sionna.tracing.direct.time_error import prediction_error, share_of
from rfgen_sionna.tracing.direct.trace_plan import SAFETY, TIME_PER_RTOL, TracePlan

PHASE_PER_RTOL = 0.7
"""Allowed error of the phases alone [rad, root mean square] per unit of the tolerance."""
MAX_VERTICES = 512
"""Largest number of vertices per mesh whose phases are compared."""
MIN_SPACING, SMOOTH_GAIN = 0.125e-3, 1.5
"""Gap between knots [s] below which a motion counts as broken, unless more knots reduce the error by this factor."""
FAR, WRONG = 3.0, 0.3
"""Error over the allowed one, and error, above which the number of knots grows faster, and whether the error falls or
not."""
MAX_COUNT = 4097
"""Largest number of knots of an interval."""
_GOLDEN = 0.5 * (np.sqrt(5.0) - 1.0)
_LOG = logging.getLogger(__name__)


def with_knots(plan: TracePlan, alone: TracePlan, starts: Sequence[float], length: float) -> TracePlan:
    """The plan with the fewest knots per interval of `length` [s] that meet the tolerance in intervals from `starts`;
    `alone` is the same for the first pair in the middle of the band."""
    allowed, before = TIME_PER_RTOL * plan.scene.rtol, np.inf
    scene = plan.scene
    tx, rx = scene.band.elements
    pairs = [(tx[0], rx[0]), (tx[-1], rx[-1])][: max(len(tx), len(rx))]
    tolerance = PHASE_PER_RTOL * scene.rtol
    given = length, scene.wavenumber, tolerance, first_count(plan, length)
    count = max(count_knots(scene.positions, pairs, start, *given)[0] for start in starts)
    while True:
        measured = [_time_error(alone, start, length, count) for start in starts]
        missed, predicted, level = (np.sqrt(np.mean(np.square(each), axis=0)) for each in zip(*measured, strict=True))
        error, guess = (float(share_of(each, level).max(initial=0.0)) for each in (missed, predicted))
        # Gains of large flat facets that turn fast converge late, errors near the tolerance may be those of visibility.
        far = error > min(FAR * allowed, WRONG)
        stalled = count >= 9 and error > 0.8 * before and not far
        if count > MAX_KNOTS or error <= allowed or stalled:
            break
        count, before = count + max(1, count // (2 if far else 4)), error
    scale = SAFETY * error / guess if guess > 0 else 0.0
    return replace(plan, knots=count, time_error=SAFETY * error, time_scale=float(scale), level=level)


def first_count(plan: TracePlan, length: float) -> int:
    """Number of knots from which to start: those of a quiet motion."""
    return max(2, 1 + int(np.ceil(length / plan.settings.spacing - 1e-6)))


def _time_error(plan: TracePlan, start: float, length: float, count: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """(group,) error of each return between `count` knots from `start` on, measured at times between them, that of
    predictions of single knots, and the return."""
    times = np.linspace(start, start + length, 2 * count - 1)
    samples = plan.sample(times.tolist())
    chosen = plan.choose(samples)
    found = [plan.values(each, chosen) for each in samples]
    gains = np.stack([plan.first_pair(values) for values, _ in found], axis=1)
    centroids = np.stack([each for _, each in found])
    scene = plan.scene
    gains = gains * scene.pattern(centroids[count - 1])[:, None]
    delays = plan.delays(samples, chosen, centroids, only_first=True)[0, 0]
    group, groups = scene.group[plan.mesh.facet_surface[chosen]], len(scene.group)
    weights = knot_weights(times[::2], times)
    coarse = interpolate_knots(weights, np.ascontiguousarray(gains[:, ::2]))
    smooth = delays[:, ::2] @ weights.T

    def waves(own: ComplexArray, tau: FloatArray) -> ComplexArray:
        cycles = scene.band.centre * tau
        return group_sums((own * np.exp(-2j * np.pi * (cycles - np.rint(cycles)))).T, group, groups)

    truth = waves(gains, delays)
    off = np.sqrt((np.abs(waves(coarse, smooth) - truth) ** 2).mean(axis=0) * 0.5)
    level = np.sqrt((np.abs(truth) ** 2).mean(axis=0))
    knots = np.ascontiguousarray(gains[:, ::2]), np.ascontiguousarray(delays[:, ::2])
    missed, whole = prediction_error(*knots, scene.band.centre, group, groups)
    return off, missed, np.maximum(level, whole)


def count_knots(
    positions: Callable[[float], Sequence[FloatArray]],
    pairs: Sequence[tuple[FloatArray, FloatArray]],
    start: float,
    length: float,
    wavenumber: float,
    tolerance: float,
    first: int,
) -> tuple[int, float]:
    """Smallest number of evenly spaced knots, `first` at least, between which a spline predicts the phase of every mesh
    to `tolerance` [rad, root mean square over its vertices], and to three times that at any time; and the error [rad].

    `positions` gives the (vertex, 3) of each mesh [m] at a time from `start` for a `length` [s]; `pairs` are positions
    (3,) [m] of Tx and Rx elements, `wavenumber` is in rad/m. Tests are once per gap, at fractions that no vibration is
    in step with.
    """

    def phases(times: FloatArray) -> FloatArray:
        """(time, pair, vertex) [rad]"""
        found = []
        for t in times.tolist():
            points = np.concatenate([_some(each) for each in positions(t)])
            found.append([lengths(points - tx) + lengths(points - rx) for tx, rx in pairs])
        return wavenumber * np.array(found)

    borders = np.cumsum([len(_some(each)) for each in positions(start)])[:-1]
    count, before = first, np.inf
    while True:
        times = np.linspace(start, start + length, count)
        place = 0.2 + 0.6 * np.mod(_GOLDEN * np.arange(1, count), 1.0)
        between = times[:-1] + place * np.diff(times)
        values, truth = phases(times), phases(between)
        off = np.tensordot(knot_weights(times, between), values, 1) - truth
        rms = np.sqrt(np.array([np.mean(own**2, axis=2).max(axis=1) for own in np.split(off, borders, axis=2)]))
        worst = float(np.sqrt(np.mean(rms**2, axis=1)).max(initial=0.0))
        if worst <= tolerance and rms.max(initial=0.0) <= 3 * tolerance:
            return count, worst
        spacing = length / (count - 1)
        if (spacing < MIN_SPACING and worst * SMOOTH_GAIN > before) or count >= MAX_COUNT:
            _LOG.warning(
                "the motion from %.4f to %.4f s is not smooth: with knots %.2g ms apart the phase error is %.2g rad "
                "(allowed: %.2g); time_error includes it",
                start, start + length, 1e3 * spacing, worst, tolerance,
            )  # fmt: skip
            return count, worst
        count, before = count + max(1, count // 3), worst


def _some(points: FloatArray) -> FloatArray:
    """Positions from all over a mesh (vertex, 3); the same vertices for the same count."""
    return points if len(points) <= MAX_VERTICES else np.take(points, _spread(len(points)), axis=0)


@cache
def _spread(count: int) -> NDArray[np.intp]:
    return np.sort(np.random.default_rng(count).permutation(count)[:MAX_VERTICES])
