"""Culling of static facets by bounding cones of actors as the radar sees them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import FloatArray
from rfgen_sionna.scene.mesh import lengths
from rfgen_sionna.tracing.surface.facets import Facets


class BoundingSpheres(NamedTuple):
    """Bounding sphere of each facet as the radar sees it."""

    direction: FloatArray
    """(facet, 3) unit vectors."""
    reach: FloatArray
    """(facet,) distance of the far end [m]."""
    turn: FloatArray
    """(2, facet) cosine and sine of the angular radius with a margin."""


def bounding_spheres(facets: Facets, viewpoint: FloatArray) -> BoundingSpheres:
    """Bounding spheres of facets around their centroids, seen from the `viewpoint` (3,) [m]."""
    centroids = facets.centroids
    distance = lengths(centroids - viewpoint)
    radius = lengths(facets.corners - centroids[:, None]).max(axis=1, initial=0.0)
    margin = np.arctan2(radius, distance) + 1e-3
    turn = np.stack([np.cos(margin), np.sin(margin)])
    return BoundingSpheres(facets.directions(viewpoint), distance + radius, turn)


def in_shadow_cones(around: BoundingSpheres, viewpoint: FloatArray, actors: Sequence[FloatArray]) -> NDArray[np.bool_]:
    """(facet,) whether the sphere reaches into or behind the cone around an actor, its vertices (vertex, 3) [m]."""
    found = np.zeros(len(around.reach), dtype=np.bool_)
    for points in actors:
        offset = points - viewpoint
        reach = lengths(offset)
        unit = offset / np.maximum(reach, 1e-12)[:, None]
        axis = unit.mean(axis=0)
        length = float(np.linalg.norm(axis))
        if length < 0.1:  # the actor surrounds the radar
            return np.ones(len(found), dtype=np.bool_)
        axis /= length
        opening = np.arccos(np.clip((unit @ axis).min(), -1.0, 1.0))
        if opening > 0.45 * np.pi:  # a cone this wide need not hold the triangles between its directions
            return np.ones(len(found), dtype=np.bool_)
        # No triangle comes nearer than the plane across the axis through its nearest corner.
        near = around.reach > (offset @ axis).min()
        along = around.direction @ axis
        # Cosine of a sum of two angles, which stay below pi.
        index = np.flatnonzero(near & (along >= np.cos(opening) * around.turn[0] - np.sin(opening) * around.turn[1]))
        # Rectangle around the actor within the cone's cross section. A sphere with margin m at an angle b off the axis
        # takes tan(b + m) - tan(b) = sin(m) / (cos(b) cos(b + m)) of it outwards.
        cos, (cos_margin, sin_margin) = np.clip(along[index], -1.0, 1.0), around.turn[:, index]
        rim = cos * cos_margin - np.sqrt(1.0 - cos * cos) * sin_margin
        wide = sin_margin / np.maximum(cos * rim, 1e-12)
        beside = np.zeros(len(index), dtype=np.bool_)
        for side in perpendicular_axes(axis):
            span = (unit @ side) / (unit @ axis)
            place = (around.direction[index] @ side) / np.maximum(along[index], 1e-3)
            beside |= (place < span.min() - wide) | (place > span.max() + wide)
        found[index[~beside | (rim < np.cos(1.4))]] = True
    return found


def perpendicular_axes(axis: FloatArray) -> FloatArray:
    """(2, 3) unit vectors perpendicular to a unit vector; the first is horizontal unless the axis is vertical."""
    level = np.array([-axis[1], axis[0], 0.0])
    level = level / np.linalg.norm(level) if np.linalg.norm(level) > 1e-6 else np.array([1.0, 0.0, 0.0])
    return np.stack([level, np.cross(axis, level)])
