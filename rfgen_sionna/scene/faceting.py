"""Whether a mesh is fine enough to stand for the smooth surface that it samples."""

from __future__ import annotations

import warnings
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from rfgen_sionna._types import FloatArray, IntArray
from rfgen_sionna.scene.mesh import RigidMesh, face_normals, lengths
from rfgen_sionna.scene.mesh_actor import MeshActor
from rfgen_sionna.scene.scene_errors import CoarseMeshWarning

SMOOTH = np.radians(30.0)
"""Neighbouring faces that turn by more [rad] are taken for an edge of the thing itself, as of a box."""
COARSE = 0.2
"""Angle [rad] by which neighbouring faces of a smooth surface may turn. Metal spheres of 5 … 50 cm radius at 77 GHz, as
the tracer rounds them, err by up to 0.01 dB at 0.08 rad (1,280 facets), 0.08 dB at 0.16 and 0.9 dB at 0.32."""


@dataclass(frozen=True)
class FacetingQuality:
    """Coarseness of a mesh as a sample of the smooth surface through its vertices."""

    turn: float
    """Angle between neighbouring faces [rad], median over the area; 0 where most of it is flat."""
    facets: int

    @property
    def facets_needed(self) -> int:
        """Facets that keep the angle below half of :data:`COARSE`, in steps of two digits; they shrink in both
        directions."""
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
    """Warn of an actor whose facets are too coarse for the smooth surface that they seem to be samples of.

    Only rigid meshes are looked at: bodies that move have folds.
    """
    if not isinstance(actor.sequence, RigidMesh):
        return
    found = faceting(actor.sequence.points, actor.faces)
    if found.turn > COARSE:
        warnings.warn(
            f"actor '{actor.name}': its {found.facets:,} facets turn by {np.degrees(found.turn):.0f} degrees from one "
            "to the next and are taken for samples of a smooth surface, which so few of them don't tell: its return "
            f"may be off by a decibel, and about {found.facets_needed:,} facets would do",
            CoarseMeshWarning,
            stacklevel=stacklevel + 1,
        )


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
