"""How strong the ghosts of a body are, before they are traced."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from rfgen_sionna.radar import Radar
from rfgen_sionna.records import FloatArray
from rfgen_sionna.tracing.mirrors import Mirror
from rfgen_sionna.tracing.obliquity import strongest_reflection

SAMPLES = 200
"""Vertices of a body that its ghosts' levels are estimated from."""
ON_MIRROR = 1e-3
"""What is nearer to a mirror than this [m] has no ghost in it."""
_PLACES = np.array([-1.0, 0.0, 1.0])
"""Places in the band at which mirrors reflect; a slab's coefficients change over it."""


def ghost_levels(
    radar: Radar,
    importance: Callable[[FloatArray], FloatArray],
    mirrors: Sequence[Mirror],
    points: FloatArray,
    max_bounces: int,
) -> FloatArray:
    """(mirror, 2) returns by way of each mirror once, both ways round together, and twice.

    They are relative to the direct return without shadows: Fresnel coefficients, spreading and antenna pattern of
    the vertex where they are largest. The body itself counts as returning as much to every side; a ghost that lies
    outside of a mirror's rectangle or beyond the range window has level 0.

    Parameters
    ----------
    radar, importance
        Where it stands, and its two-way field gain towards unit vectors.
    mirrors
        Flat parts of the scene.
    points
        (vertex, 3) vertices of the body [m].
    max_bounces
        2 leaves out those by the mirror twice.
    """
    found = np.zeros((len(mirrors), 2))
    points = points[:: max(1, len(points) // SAMPLES)]
    view, reach = np.asarray(radar.position), radar.max_range

    def listens(offset: FloatArray) -> FloatArray:
        return np.sqrt(importance(offset / np.maximum(np.linalg.norm(offset, axis=1, keepdims=True), 1e-12)))

    distance = np.maximum(np.linalg.norm(points - view, axis=1), 1e-6)
    near = listens(points - view) / distance
    direct = float((near**2).max())
    rows = []
    for number, mirror in enumerate(mirrors):
        before = mirror.height(points) > ON_MIRROR
        if not before.any():
            continue
        crossing = mirror.crossings(view, points[before])
        place = crossing @ mirror.axes.T
        if (place.max(axis=0) < mirror.low).any() or (place.min(axis=0) > mirror.high).any():
            continue
        length = np.linalg.norm(points[before] - mirror.image(view), axis=1)
        cos = (mirror.height(points[before]) + mirror.height(view)) / length
        once = near[before] * (0.5 * (length + distance[before]) < reach)
        rows.append(
            np.stack([np.full(len(length), number), cos, listens(crossing - view) / length, once, length < reach])
        )
    if not rows or direct <= 0:
        return found
    index, cos, way, once, twice = np.concatenate(rows, axis=1)
    number = index.astype(np.int32)
    frequencies = radar.center_frequency + 0.5 * radar.waveform.bandwidth * _PLACES
    way = way * strongest_reflection([mirror.material for mirror in mirrors], number, cos, frequencies)
    np.maximum.at(found[:, 0], number, 2.0 * way * once / direct)
    if max_bounces > 2:
        np.maximum.at(found[:, 1], number, way**2 * twice / direct)
    return found
