"""Flat and curved parts of a mesh, and its coarseness as a sample of a smooth surface.

Between two large flat faces and the narrow faces of a rounded edge the mesh turns as little as within the edge. A mean
normal there would bend the large faces. :func:`find_plane_parts` therefore takes a plane part of several faces for flat
where it is several times as wide as its neighbour; the neighbour continues it without a kink. Two parts that turn
nowhere else, such as two walls, meet at an edge.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from rfgen_sionna._types import FloatArray, IntArray
from rfgen_sionna.scene.mesh import face_normals, lengths
from rfgen_sionna.scene.mesh_actor import MeshActor
from rfgen_sionna.scene.rigid_mesh import RigidMesh
from rfgen_sionna.scene.scene_errors import CoarseMeshWarning

SMOOTH = np.radians(30.0)
"""Angle between neighbouring faces [rad] above which their edge is one of the object, as of a box."""
COARSE = 0.2
"""Allowed angle between neighbouring faces of a smooth surface [rad]: metal spheres err by 0.1 dB at 0.16 rad."""
FLATNESS_ANGLE = 1e-3
"""Largest angle between faces of one plane [rad]: an arc of 1 cm has a sagitta of 1 um."""
MIN_WIDTH_RATIO = 3.0
"""Least width of a flat part over that of its curved neighbour: chords of an evenly sampled bend differ by less."""


@dataclass(frozen=True)
class FacetingQuality:
    """Coarseness of a mesh as a sample of the smooth surface through its vertices."""

    turn: float
    """Angle between neighbouring faces [rad], median over the area; 0 where most of it is flat."""
    facets: int

    @property
    def facets_needed(self) -> int:
        """Number of facets, rounded up to two digits, for an angle below half of :data:`COARSE`."""
        needed = self.facets * (2.0 * self.turn / COARSE) ** 2
        step = 10.0 ** max(0, int(np.floor(np.log10(max(needed, 1.0)))) - 1)
        return int(np.ceil(needed / step) * step)


def faceting(vertices: FloatArray, faces: IntArray) -> FacetingQuality:
    """Angles between neighbouring faces of the smooth parts of a mesh.

    Parameters
    ----------
    vertices, faces
        (vertex, 3) [m] and (face, 3), consistently oriented.
    """
    normals = face_normals(vertices, faces)
    double_area = lengths(normals)
    normals = normals / np.maximum(double_area, 1e-300)[:, None]
    start, end = faces.ravel().astype(np.int64), faces[:, [1, 2, 0]].ravel().astype(np.int64)
    key = np.minimum(start, end) * len(vertices) + np.maximum(start, end)
    order = np.argsort(key, kind="stable")
    pair = np.flatnonzero(key[order][1:] == key[order][:-1])
    edge, other = (np.concatenate([order[pair + i], order[pair + 1 - i]]) for i in (0, 1))
    one, two = normals[edge // 3], normals[other // 3]
    angle = np.arctan2(lengths(np.cross(one, two)), (one * two).sum(axis=1))
    little = angle < SMOOTH
    edge, other, angle = edge[little], other[little], angle[little]
    found = find_plane_parts(vertices, faces, edge, other, angle)
    turn = np.zeros(len(faces))
    np.maximum.at(turn, edge // 3, np.where(found.smooth & ~found.flat, angle, 0.0))
    rank = np.argsort(turn)
    share = np.cumsum(double_area[rank]) / double_area.sum()
    return FacetingQuality(float(turn[rank[np.searchsorted(share, 0.5)]]), len(faces))


def warn_coarse(actor: MeshActor, stacklevel: int) -> None:
    """Warn of a rigid actor whose facets are too coarse for a smooth surface; moving bodies fold and are skipped."""
    if not isinstance(actor.sequence, RigidMesh):
        return
    found = faceting(actor.sequence.points, actor.faces)
    if found.turn > COARSE:
        warnings.warn(
            f"actor '{actor.name}': its {found.facets:,} facets turn by {np.degrees(found.turn):.0f} degrees from one "
            "to the next, which is coarse for a smooth surface: its return may be off by a decibel; take about "
            f"{found.facets_needed:,} facets",
            CoarseMeshWarning,
            stacklevel=stacklevel + 1,
        )


@dataclass(frozen=True)
class PlaneParts:
    """Plane parts of a mesh, and their continuation at edges of a small angle."""

    part: NDArray[np.int32]
    """(face,) index of the face's plane part."""
    smooth: NDArray[np.bool_]
    """(edge,) whether the surface continues without a kink."""
    flat: NDArray[np.bool_]
    """(edge,) whether the face is flat there: the angle belongs to its neighbour."""


def find_plane_parts(
    vertices: FloatArray, faces: IntArray, edge: NDArray[np.int64], other: NDArray[np.int64], turn: FloatArray
) -> PlaneParts:
    """Plane parts of a mesh.

    Parameters
    ----------
    vertices, faces
        (vertex, 3) [m] and (face, 3).
    edge, other
        (edge,) 3 × face + side, of a face and of its neighbour, for all edges of a small angle in both directions.
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
    # Extent of each part across the shared edge, bounded by its size.
    width, width_there = (area[each] / shared for each in (one, two))
    wider = (np.minimum(width, np.sqrt(area[one])) > MIN_WIDTH_RATIO * width_there) & several[one]
    narrower = (np.minimum(width_there, np.sqrt(area[two])) > MIN_WIDTH_RATIO * width) & several[two]
    flat[bent] = wider
    # A part of a round surface bends towards two neighbours.
    link, alike = one * count + two, ~wider & ~narrower
    last, like = _neighbours(link, count) < 2, _neighbours(link[alike], count)
    ends, alone = several & (like < 2), like == 0
    kink = (alike & ends[one] & ends[two]) | (wider & alone[one] & last[two]) | (narrower & alone[two] & last[one])
    smooth[bent] = ~kink
    return PlaneParts(part, smooth, flat & smooth)


def _neighbours(link: NDArray[np.int64], count: int) -> NDArray[np.intp]:
    """(part,) number of parts that each of `count` parts is linked to."""
    return np.bincount(np.unique(link) // count, minlength=count)
