"""Estimated levels of a body's ghosts, before tracing."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from rfgen_sionna._types import FloatArray
from rfgen_sionna.radar import Radar
from rfgen_sionna.tracing.ghosts.mirror_images import Mirror
from rfgen_sionna.tracing.integral.obliquity import strongest_reflection

SAMPLES = 200
"""Vertices of a body for the levels by single mirrors; bounds the time."""
SECOND_ORDER_SAMPLES = 40
"""Vertices of a body for the many pairs of mirrors; bounds the time."""
ON_MIRROR = 1e-3
"""Least distance from a mirror [m]; nearer points have no ghost in it."""
_BAND_POSITIONS = np.array([-1.0, 0.0, 1.0])
"""Positions u in the band at which the mirrors' reflection is evaluated."""


class GhostLevels(NamedTuple):
    """Ghost levels relative to the unoccluded direct return."""

    single: FloatArray
    """(mirror, 2) by each mirror on one leg, both directions together, and on both legs."""
    across: FloatArray
    """(mirror, mirror) by one mirror out and another back, both directions together; upper triangle."""


def ghost_levels(
    radar: Radar,
    pattern_gain: Callable[[FloatArray], FloatArray],
    mirrors: Sequence[Mirror],
    points: FloatArray,
    max_bounces: int,
) -> GhostLevels:
    """Levels from Fresnel coefficients, spreading and antenna pattern of the strongest of a body's `points` (vertex, 3)
    [m].

    The body is assumed isotropic. Ghosts outside a mirror's rectangle or the range window have level 0. `pattern_gain`
    is the two-way field gain towards unit vectors (..., 3); `max_bounces` 2 skips mirrors on both legs.
    """
    found = GhostLevels(np.zeros((len(mirrors), 2)), np.zeros((len(mirrors), len(mirrors))))
    points = points[:: max(1, len(points) // SAMPLES)]
    view = np.asarray(radar.position)

    def field_gain(offset: FloatArray) -> FloatArray:
        return np.sqrt(pattern_gain(offset / np.maximum(np.linalg.norm(offset, axis=1, keepdims=True), 1e-12)))

    distance = np.maximum(np.linalg.norm(points - view, axis=1), 1e-6)
    near = field_gain(points - view) / distance
    direct = float((near**2).max(initial=0.0))
    # One-way field by each mirror, 0 without an image, and path length: (mirror, vertex).
    way, length, rows = np.zeros((len(mirrors), len(points))), np.zeros((len(mirrors), len(points))), []
    for number, mirror in enumerate(mirrors):
        height = mirror.height(points)
        before = np.flatnonzero(height > ON_MIRROR)
        if not len(before):
            continue
        # Vertices of large faces on or behind the mirror bound the visible part.
        reaching = mirror.crossings(view, points - np.minimum(height, 0.0)[:, None] * mirror.normal)
        crossing, place = reaching[before], reaching @ mirror.axes.T
        if (place.max(axis=0) < mirror.low).any() or (place.min(axis=0) > mirror.high).any():
            continue
        own = np.linalg.norm(points[before] - mirror.image(view), axis=1)
        way[number, before], length[number, before] = field_gain(crossing - view) / own, own
        cos = (mirror.height(points[before]) + mirror.height(view)) / own
        rows.append(np.stack([np.full(len(before), number), before, cos]))
    if not rows or direct <= 0:
        return found
    index, vertex, cos = np.concatenate(rows, axis=1)
    which, column = index.astype(np.int32), vertex.astype(np.intp)
    frequencies = radar.center_frequency + 0.5 * radar.waveform.bandwidth * _BAND_POSITIONS
    way[which, column] *= strongest_reflection([mirror.material for mirror in mirrors], which, cos, frequencies)
    once = way * near * (0.5 * (length + distance) < radar.max_range)
    found.single[:, 0] = 2.0 * once.max(axis=1) / direct
    if max_bounces > 2:
        found.single[:, 1] = (way**2 * (length < radar.max_range)).max(axis=1) / direct
        for one in np.flatnonzero(way.any(axis=1)):
            others = slice(one + 1, None)
            reached = 0.5 * (length[one] + length[others]) < radar.max_range
            level = (way[one] * way[others] * reached).max(axis=1, initial=0.0)
            found.across[one, others] = 2.0 * level / direct
    return found


def second_order_levels(
    radar: Radar, pattern_gain: Callable[[FloatArray], FloatArray], mirrors: Sequence[Mirror], points: FloatArray
) -> FloatArray:
    """(mirror, mirror) levels by one mirror, then another, on one leg, both directions together
    (:func:`ghost_levels`)."""
    found = np.zeros((len(mirrors), len(mirrors)))
    points = points[:: max(1, len(points) // SECOND_ORDER_SAMPLES)]
    view = np.asarray(radar.position)
    offset = points - view
    distance = np.maximum(np.linalg.norm(offset, axis=1), 1e-6)
    near = np.sqrt(pattern_gain(offset / distance[:, None])) / distance
    direct = float((near**2).max(initial=0.0))
    if direct <= 0 or len(mirrors) < 2:
        return found
    apart = _spacing(points)
    normal, axes = np.stack([each.normal for each in mirrors]), np.stack([each.axes for each in mirrors])
    low, high = (np.stack([getattr(each, end) for each in mirrors])[:, None] for end in ("low", "high"))
    there = np.stack([each.height(points) for each in mirrors])  # (mirror, vertex)
    feet = points - there[..., None] * normal[:, None]
    frequencies = radar.center_frequency + 0.5 * radar.waveform.bandwidth * _BAND_POSITIONS
    for number, mirror in enumerate(mirrors):
        image = mirror.image(view)
        here = np.array([float(each.height(image)) for each in mirrors])
        foot = image - here[:, None] * normal
        both = np.where((here[:, None] > ON_MIRROR) & (there > ON_MIRROR), here[:, None] + there, np.nan)
        place = foot[:, None] + (here[:, None] / both)[..., None] * (feet - foot[:, None])
        span = np.einsum("mvi,mai->mva", place, axes)
        rise = mirror.height(place)
        turn = mirror.crossings(view, np.nan_to_num(place).reshape(-1, 3)).reshape(place.shape)
        # Surface between two vertices may be visible where neither is: widen mirrors by the spacing.
        within = (span >= low - apart) & (span <= high + apart)
        within = within.all(axis=2) & (rise > ON_MIRROR)
        within &= mirror.spans(turn.reshape(-1, 3), apart).reshape(rise.shape)
        length = np.linalg.norm(points - (image - 2.0 * here[:, None] * normal)[:, None], axis=2)
        other, vertex = np.nonzero(within & (0.5 * (length + distance) < radar.max_range))
        others = other != number
        other, vertex = other[others].astype(np.int32), vertex[others]
        if not len(other):
            continue
        leaves = turn[other, vertex] - view
        leaves /= np.maximum(np.linalg.norm(leaves, axis=1), 1e-12)[:, None]
        cos = [
            (rise[other, vertex] + mirror.height(view)) / np.linalg.norm(place[other, vertex] - image, axis=1),
            both[other, vertex] / length[other, vertex],
        ]
        way = np.sqrt(pattern_gain(leaves)) / length[other, vertex]
        for which, materials, slope in (
            (np.zeros(len(other), np.int32), [mirror.material], cos[0]),
            (other, [each.material for each in mirrors], cos[1]),
        ):
            way *= strongest_reflection(materials, which, np.minimum(slope, 1.0), frequencies)
        np.maximum.at(found[number], other, 2.0 * way * near[vertex] / direct)
    return found


def _spacing(points: FloatArray) -> float:
    """Largest distance of a body's sampled `points` (vertex, 3) from their neighbours [m]."""
    near = cKDTree(points).query(points, k=min(4, len(points)))[0].reshape(len(points), -1)[:, -1]
    return float(near.max(initial=0.0))
