"""Legs and routes that matter, by one upper bound: reflection, spreading, element pattern, windows and range window."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import combinations_with_replacement
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from rfgen_sionna._types import FloatArray, IntArray
from rfgen_sionna.tracing.integral.fresnel import reflection
from rfgen_sionna.tracing.legs.leg import Leg, cone
from rfgen_sionna.tracing.routes.reflectors import Plate

LegKey = tuple[int, ...]
"""Parts of the mirrors of a leg, in order from the radar."""
RouteKey = tuple[LegKey, LegKey]
"""Legs out and back."""
SAMPLES = 200
"""Vertices of a surface that bound its returns."""
OMITTED_SHARE = 0.5
"""Share of the tolerance for all omitted routes together."""
ON_MIRROR = 1e-3
"""Least distance from a mirror [m]; nearer points have no image in it."""


@njit(cache=True, nogil=True, error_model="numpy")
def largest_reflection(media: Any, wavenumbers: Any, cosines: Any, found: Any) -> None:
    """Largest |r_s| or |r_p| into `found` (point,) at `cosines` (point,) of incidence for `media` (node, 7) at
    `wavenumbers` (node,)."""
    for p in range(cosines.shape[0]):
        c = min(max(cosines[p], 0.0), 1.0)
        found[p] = 0.0
        for n in range(media.shape[0]):
            r_s, r_p = reflection(media[n], wavenumbers[n], c, 1.0 - c * c)
            found[p] = max(found[p], abs(r_s), abs(r_p))


def leg_of(key: LegKey, plates: Sequence[Plate | None], sided: bool = True) -> Leg | None:
    """The leg by the `plates` numbered `key`; None where one is bent or, if `sided`, reflects nothing to the radar."""
    leg = Leg(())
    for number in key:
        plate = plates[number]
        # A plate is seen from the image of the radar, which lies behind the mirror before it.
        mirror = None if plate is None else plate.seen_from(leg.view) if sided else plate.front
        if mirror is None:
            return None
        leg = Leg((*leg.mirrors, mirror))
    return leg


class ReturnBounds:
    """Bounds of the reflection, spreading and pattern gain of legs. `pattern_gain` is the two-way field gain towards
    unit vectors, `media` (node, surface, 7) at `wavenumbers` (node,), `surface` (part,) the surface of each part."""

    def __init__(
        self, pattern_gain: Callable[[FloatArray], FloatArray], media: FloatArray, wavenumbers: FloatArray,
        surface: Sequence[int],
    ) -> None:  # fmt: skip
        self._pattern, self._media, self._wavenumbers, self._surface = pattern_gain, media, wavenumbers, tuple(surface)

    def gain(self, leg: Leg, points: FloatArray) -> FloatArray:
        """(point,) one-way field gain along a `leg` towards `points` (point, 3) [m], without spreading."""
        found = np.sqrt(self._pattern(leg.departures(points)))
        offset = points - leg.view
        k = offset / np.maximum(np.linalg.norm(offset, axis=1, keepdims=True), 1e-12)
        for mirror, normal in zip(leg.mirrors, leg.normals, strict=True):
            share = np.empty(len(points))
            media = np.ascontiguousarray(self._media[:, self._surface[mirror.part]])
            largest_reflection(media, self._wavenumbers, np.abs(k @ normal), share)
            found *= share
        return found


def significant_routes(
    plates: Sequence[Plate | None],
    surfaces: Sequence[FloatArray],
    bounds: ReturnBounds,
    max_bounces: int,
    max_range: float,
    rtol: float,
    group: IntArray,
) -> set[RouteKey]:
    """Routes, with the smaller leg first, that may matter for one of the `surfaces` (vertex, 3) [m]: all but the
    weakest, whose bounds add to a share of the tolerance, relative to the direct return of the `group` (surface,)."""
    points, margins, number = [], [], []
    for index, own in enumerate(surfaces):
        some = own[:: max(1, len(own) // SAMPLES)]
        points.append(some)
        margins.append(np.full(len(some), _spacing(some)))
        number.append(np.full(len(some), index))
    targets, margin, surface = np.concatenate(points), np.concatenate(margins), np.concatenate(number)
    direct = Leg(())
    length = np.maximum(np.linalg.norm(targets, axis=1), 1e-6)
    amplitude: dict[LegKey, FloatArray] = {(): bounds.gain(direct, targets) / length}
    lengths: dict[LegKey, FloatArray] = {(): length}
    level = np.full(len(surfaces), 1e-300)
    np.maximum.at(level, group[surface], amplitude[()] ** 2)

    def add(key: LegKey, leg: Leg) -> None:
        reached = _reached(leg, targets, margin, surface)
        if len(reached):
            way, there = np.zeros(len(targets)), np.full(len(targets), np.inf)
            there[reached] = np.maximum(np.linalg.norm(targets[reached] - leg.view, axis=1), 1e-6)
            way[reached] = bounds.gain(leg, targets[reached]) / there[reached]
            amplitude[key], lengths[key] = way, there

    singles = {k: leg for k in range(len(plates)) if (leg := leg_of((k,), plates)) is not None}
    for one, leg in singles.items():
        add((one,), leg)
        for other, plate in enumerate(plates) if max_bounces > 2 else ():
            if plate is None or other == one:
                continue
            corners = np.concatenate(plate.windows)
            size, whole = np.full(len(corners), _extent(corners)), np.zeros(len(corners), np.intp)
            further = leg_of((one, other), plates) if len(_reached(leg, corners, size, whole)) else None
            if (
                further is not None
                and (further.mirrors[1].height(np.concatenate(leg.mirrors[0].windows)) > ON_MIRROR).any()
            ):
                add((one, other), further)
    routes, strength = [], []
    for out, back in combinations_with_replacement(sorted(amplitude, key=lambda key: (len(key), key)), 2):
        if not 0 < len(out) + len(back) < max_bounces:
            continue
        both = amplitude[out] * amplitude[back] * (0.5 * (lengths[out] + lengths[back]) < max_range)
        most = float((both / level[group[surface]]).max(initial=0.0)) * (1.0 if out == back else 2.0)
        if most > 0:
            routes.append((out, back))
            strength.append(most)
    order = np.argsort(strength)
    weak = np.cumsum(np.array(strength)[order]) <= OMITTED_SHARE * rtol
    return {routes[k] for k in order[~weak]}


def _reached(leg: Leg, points: FloatArray, margin: FloatArray, surface: NDArray[np.intp]) -> NDArray[np.intp]:
    """Indices of the `points` (point, 3) within `margin` (point,) [m] of the space that the mirrors of a `leg` show, of
    each `surface` (point,) that is before the last one."""
    last = leg.mirrors[-1]
    height = last.height(points)
    before = np.zeros(int(surface.max(initial=0)) + 1, np.bool_)
    before[surface[height > ON_MIRROR]] = True
    inside = before[surface] & (height > -margin)
    # Vertices of large faces on or behind the mirror bound the visible part.
    moved = points - np.minimum(height, 0.0)[:, None] * last.normal - leg.view
    for polygons in leg.windows:
        within = np.zeros(len(points), np.bool_)
        for polygon in polygons:
            within |= (moved @ cone(polygon).T >= -margin[:, None]).all(axis=1)
        inside &= within
    return np.flatnonzero(inside)


def _extent(points: FloatArray) -> float:
    return float(np.linalg.norm(np.ptp(points, axis=0)))


def _spacing(points: FloatArray) -> float:
    """Largest distance of a surface's sampled `points` (vertex, 3) from their neighbours [m]."""
    near = cKDTree(points).query(points, k=min(4, len(points)))[0].reshape(len(points), -1)[:, -1]
    return float(near.max(initial=0.0))
