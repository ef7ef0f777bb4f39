"""Sample times: times at which gains and visibility are traced, so that splines follow an interval.

The error of splines is estimated with the faces of the meshes before any trace. Without the phase of its centre, a flat
face returns the mean phasor over its area, in closed form.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from rfgen_sionna._types import FloatArray, IntArray
from rfgen_sionna.tracing.moving.knots import FIRST_COUNT, LEAST_SPACING, MIN_SPACING, QUIET_GAPS, representative
from rfgen_sionna.tracing.moving.representative_faces import RepresentativeFaces

QUIET_SPACING, QUIET_TURN = 14e-3, 20e-3
"""Largest gap between three times [s], and largest angle of any vertex across the line of sight per gap [rad]: the
width of an arm at 4 m."""
PAIR_SPACING, PAIR_TURN, STRAIGHT = 28e-3, 10e-3, 1e-4
"""The same of two times, and largest departure of any vertex from a straight way between them [rad], as a return motion
would hide shadows from both."""
MARGIN = 1.5
"""Stated error over that of the faces: the measured error of people is 0.4 to 2.1 times the latter."""
CANCELLING_SHARE = 0.25
"""Share of the tolerance with indirect paths, from whose aspect bodies may turn faster."""
_LOG = logging.getLogger(__name__)


class SampleTimes(NamedTuple):
    """Sample times and their error."""

    times: FloatArray
    """(time,) evenly spaced [s]."""
    error: float
    """Estimated error of the return between them for turning faces, relative to that of the worst mesh [root mean
    square over time]."""
    allowed: float
    """Allowed one."""

    @property
    def spacing(self) -> float:
        """Gap between the times [s]; infinity for a single one."""
        return float(self.times[1] - self.times[0]) if len(self.times) > 1 else np.inf

    def warn(self) -> None:
        """Warn of an error above the allowed one."""
        if self.error > self.allowed:
            _LOG.warning(
                "gains between %.4f and %.4f s turn too fast: with sample times %.2g ms apart their error is %.2g "
                "(allowed: %.2g); time_error includes it",
                self.times[0], self.times[-1], 1e3 * self.spacing, self.error, self.allowed,
            )  # fmt: skip


def choose_sample_times(
    positions: Callable[[float], Sequence[FloatArray]],
    faces: Sequence[IntArray],
    closed: Sequence[bool],
    viewpoint: FloatArray,
    knots: FloatArray,
    frequency: float,
    tolerance: float,
    max_spacing: float,
    indirect: bool = False,
    pair: bool = False,
    cancellation: FloatArray | None = None,
    longest_edges: Sequence[FloatArray] | None = None,
) -> SampleTimes:
    """The smallest number of evenly spaced times for which splines follow the gains.

    Parameters
    ----------
    positions, faces, closed
        Time [s] to the (vertex, 3) positions [m] of each mesh, its (face, 3), and whether its back faces do not count.
    viewpoint
        (3,) phase centre of the radar [m].
    knots
        (knot,) of :func:`rfgen_sionna.tracing.moving.knots.choose_knots` [s].
    frequency, tolerance
        Highest frequency of the band [Hz]; allowed error relative to the return [root mean square over time].
    max_spacing
        Largest gap [s] of four times or more; that of three and two is :data:`QUIET_SPACING` and :data:`PAIR_SPACING`.
    indirect
        Whether mirrors or slabs show the meshes: then four times at least, as indirect paths have no temporal
        refinement.
    pair
        Whether two times may suffice, from which no time can be left out to test moving shadows.
    cancellation
        (mesh,) factor on each mesh's error; None is 1.
    longest_edges
        Of each mesh the (face,) limits [m] of the facets of fast turning faces
        (:mod:`rfgen_sionna.tracing.moving.fast_turns`), for which sample times may be closer; None without any.
    """
    if len(knots) == 1:
        return SampleTimes(knots, 0.0, tolerance)
    length = float(knots[-1] - knots[0])
    places = [positions(float(t)) for t in knots]
    limits = [None] * len(faces) if longest_edges is None else longest_edges
    meshes = [
        RepresentativeFaces([each[k] for each in places], own, shut, viewpoint, frequency, limit)
        for k, (own, shut, limit) in enumerate(zip(faces, closed, limits, strict=True))
    ]
    least = max(FIRST_COUNT - 1, int(np.ceil(length / max_spacing * (1 - 1e-9))))
    most = max(least, int(length / (MIN_SPACING if longest_edges is None else LEAST_SPACING)))
    allowed, gaps = CANCELLING_SHARE * tolerance if indirect else tolerance, least

    more = np.ones(len(meshes)) if cancellation is None else cancellation

    def missed(gaps: int) -> float:
        return MARGIN * max(
            (own * each.missed(gaps) for each, own in zip(meshes, more.tolist(), strict=True)), default=0.0
        )

    representatives = [[representative(each) for each in there] for there in places]
    turn = _most_turn(representatives, viewpoint) * (len(knots) - 1) if not indirect else np.inf
    few = (1, PAIR_SPACING, PAIR_TURN), (QUIET_GAPS, QUIET_SPACING, QUIET_TURN)
    for some, spacing, most_turn in few if pair else few[1:]:
        straight = some > 1 or _most_departure(representatives, viewpoint) <= STRAIGHT
        if length <= some * spacing and turn <= some * most_turn and straight and (error := missed(some)) <= allowed:
            gaps = some
            break
    else:
        error = missed(gaps)
    while error > allowed and gaps < most:
        # Small errors fall with the fourth power of the gap.
        gaps = min(max(gaps + 1, int(np.ceil(gaps * (error / allowed) ** 0.25))), most)
        error = missed(gaps)
    return SampleTimes(np.linspace(knots[0], knots[-1], gaps + 1), error, allowed)


def _most_departure(places: Sequence[Sequence[FloatArray]], viewpoint: FloatArray) -> float:
    """Largest angle [rad] across the line of sight between any vertex and the straight way from the first to the last
    of the evenly spaced `places`."""
    found, count = 0.0, len(places) - 1
    for number, there in enumerate(places[1:-1], 1):
        share = number / count
        for first, now, last in zip(places[0], there, places[-1], strict=True):
            found = max(found, _across(now - viewpoint, now - first - share * (last - first)))
    return found


def _across(offset: FloatArray, step: FloatArray) -> float:
    """Largest angle [rad] of a `step` (vertex, 3) across the line of sight, at `offset` (vertex, 3)."""
    square = np.maximum(np.einsum("vi,vi->v", offset, offset), 1e-12)
    along = np.einsum("vi,vi->v", offset, step) / square
    across = np.einsum("vi,vi->v", step, step) / square - along**2
    return float(np.sqrt(max(across.max(initial=0.0), 0.0)))


def _most_turn(places: Sequence[Sequence[FloatArray]], viewpoint: FloatArray) -> float:
    """Largest angle [rad] of any vertex across the line of sight from one of the `places` to the next."""
    found = 0.0
    for before, after in pairwise(places):
        for old, new in zip(before, after, strict=True):
            found = max(found, _across(old - viewpoint, new - old))
    return found
