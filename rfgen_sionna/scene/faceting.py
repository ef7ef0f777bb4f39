"""Whether a mesh is fine enough to stand for the smooth surface that it samples."""

from __future__ import annotations

import warnings
from dataclasses import dataclass

import numpy as np

from rfgen_sionna._types import FloatArray, IntArray
from rfgen_sionna.scene.mesh import RigidMesh, face_normals, lengths
from rfgen_sionna.scene.mesh_actor import MeshActor
from rfgen_sionna.scene.plane_parts import find_plane_parts
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
