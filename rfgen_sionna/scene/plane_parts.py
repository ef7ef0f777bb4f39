"""Flat parts of a mesh beside parts that sample a curved surface.

A box with rounded edges has large faces that are as flat as they look and narrow ones that stand for its edges, and
between both the mesh turns by a few degrees as it does within the edges. A normal that is a mean of both would bend the
large faces by millimetres, which is a wavelength. Where a plane part of several faces is several times as wide as its
neighbour it is taken for flat, and the neighbour goes on from it without a kink. Where two parts meet and neither turns
on anywhere else, as two walls of a house do, the edge between them is an edge.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from rfgen_sionna._types import FloatArray, IntArray
from rfgen_sionna.scene.mesh import face_normals, lengths

FLATNESS_ANGLE = 1e-3
"""Faces that turn by less [rad] are one plane: 1 cm of it rises by a micrometre."""
MIN_WIDTH_RATIO = 3.0
"""Plane parts that are so many times as wide as what they turn into are flat there. Where a bent thing is sampled at
equal heights over its chords, the wider of two neighbours is bent by the smaller share of the angle between them."""


@dataclass(frozen=True)
class PlaneParts:
    """Plane parts of a mesh, and how they go on where they turn by little."""

    part: NDArray[np.int32]
    """(face,) number of the plane part that each face is of."""
    smooth: NDArray[np.bool_]
    """(edge,) whether the surface goes on there without a kink."""
    flat: NDArray[np.bool_]
    """(edge,) whether the face is flat there, and what of its turn there is is its neighbour's."""


def find_plane_parts(
    vertices: FloatArray,
    faces: IntArray,
    edge: NDArray[np.int64],
    other: NDArray[np.int64],
    turn: FloatArray,
) -> PlaneParts:
    """Plane parts of a mesh.

    Parameters
    ----------
    vertices, faces
        (vertex, 3) [m] and (face, 3).
    edge, other
        (edge,) three times a face plus the number of its edge, and the same of its neighbour there, of all edges over
        which the mesh turns by little; each in both directions.
    turn
        (edge,) angle between both faces [rad].
    """
    within = turn < FLATNESS_ANGLE
    here, there = edge // 3, other // 3
    ones, size = np.ones(np.count_nonzero(within), np.int8), len(faces)
    links = coo_array((ones, (here[within], there[within])), shape=(size, size))
    count, part = connected_components(links, directed=False)
    smooth, flat = np.ones(len(edge), np.bool_), np.zeros(len(edge), np.bool_)
    several = np.bincount(part, minlength=count) > 1
    if not several.any():
        return PlaneParts(part, smooth, flat)
    bent = np.flatnonzero(~within)
    one, two = part[here[bent]].astype(np.int64), part[there[bent]].astype(np.int64)
    start, end = faces.ravel()[edge[bent]], faces[:, [1, 2, 0]].ravel()[edge[bent]]
    _, pair = np.unique(one * count + two, return_inverse=True)
    shared = np.bincount(pair, weights=lengths(vertices[end] - vertices[start]))[pair]
    area = np.bincount(part, weights=0.5 * lengths(face_normals(vertices, faces)), minlength=count)
    # How far each goes on across what both share; of a disc among small faces that is its size at most.
    width, width_there = (area[each] / shared for each in (one, two))
    wider = (np.minimum(width, np.sqrt(area[one])) > MIN_WIDTH_RATIO * width_there) & several[one]
    narrower = (np.minimum(width_there, np.sqrt(area[two])) > MIN_WIDTH_RATIO * width) & several[two]
    flat[bent] = wider
    # Bent towards one neighbour alone a part would be bent at one end, which nothing round is.
    link, alike = one * count + two, ~wider & ~narrower
    last, like = _neighbours(link, count) < 2, _neighbours(link[alike], count)
    ends, alone = several & (like < 2), like == 0
    kink = (alike & ends[one] & ends[two]) | (wider & alone[one] & last[two]) | (narrower & alone[two] & last[one])
    smooth[bent] = ~kink
    return PlaneParts(part, smooth, flat & smooth)


def _neighbours(link: NDArray[np.int64], count: int) -> NDArray[np.intp]:
    """(part,) how many others each of so many parts is linked to; links are numbered part after part."""
    return np.bincount(np.unique(link) // count, minlength=count)
