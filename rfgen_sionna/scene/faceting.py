"""Whether a mesh is fine enough to stand for the smooth surface that it describes."""

from __future__ import annotations

import warnings
from dataclasses import dataclass

import numpy as np

from rfgen_sionna.records import SPEED_OF_LIGHT, FloatArray, IntArray
from rfgen_sionna.scene.actor import Actor
from rfgen_sionna.scene.errors import CoarseMeshWarning
from rfgen_sionna.scene.mesh import RigidMesh, face_normals

SMOOTH = np.radians(30.0)
"""Neighbouring faces that turn by more [rad] are taken for an edge of the thing itself, as of a box."""
COARSE = 0.1
"""Phase [rad] by which facets may stand off: metal spheres of 5 … 30 cm radius err by up to 0.6 dB there at 77 GHz,
over random orientations, in proportion to it."""


@dataclass(frozen=True)
class Faceting:
    """How far the facets of a mesh stand off the smooth surface through its vertices."""

    sagitta: float
    """Height of the smooth surface over the facets [m], median over the area; 0 where most of it is flat."""
    facets: int

    def phase(self, frequency: float) -> float:
        """What that means on the way there and back [rad]."""
        return 4 * np.pi * frequency / SPEED_OF_LIGHT * self.sagitta

    def facets_needed(self, frequency: float) -> int:
        """Facets that keep the phase below :data:`COARSE`, in steps of two digits; they shrink in both directions."""
        needed = self.facets * self.phase(frequency) / COARSE
        step = 10.0 ** max(0, int(np.floor(np.log10(max(needed, 1.0)))) - 1)
        return int(np.ceil(needed / step) * step)


def faceting(vertices: FloatArray, faces: IntArray) -> Faceting:
    """How far facets stand off: an arc over a chord of height h that turns by an angle a rises by h a / 8.

    Parameters
    ----------
    vertices, faces
        (vertex, 3) [m] and (face, 3), consistently oriented.
    """
    normals = face_normals(vertices, faces)
    double_area = np.linalg.norm(normals, axis=1)
    normals = normals / np.maximum(double_area, 1e-300)[:, None]
    start, end = faces.ravel().astype(np.int64), faces[:, [1, 2, 0]].ravel().astype(np.int64)
    key = np.minimum(start, end) * len(vertices) + np.maximum(start, end)
    order = np.argsort(key, kind="stable")
    pair = np.flatnonzero(key[order][1:] == key[order][:-1])
    one, other = order[pair] // 3, order[pair + 1] // 3
    length = np.linalg.norm(vertices[start[order[pair]]] - vertices[end[order[pair]]], axis=1)
    sine = np.linalg.norm(np.cross(normals[one], normals[other]), axis=1)
    angle = np.arctan2(sine, np.einsum("ij,ij->i", normals[one], normals[other]))
    height = 0.5 * (double_area[one] + double_area[other]) / length
    rise = np.where(angle < SMOOTH, height * angle / 8.0, 0.0)
    sagitta = np.zeros(len(faces))
    np.maximum.at(sagitta, one, rise)
    np.maximum.at(sagitta, other, rise)
    rank = np.argsort(sagitta)
    share = np.cumsum(double_area[rank]) / double_area.sum()
    return Faceting(float(sagitta[rank[np.searchsorted(share, 0.5)]]), len(faces))


def warn_coarse(actor: Actor, frequency: float, stacklevel: int) -> None:
    """Warn of an actor whose facets are too coarse for a smooth surface at `frequency` [Hz].

    A sphere of coarse facets is a polyhedron, which glints. Only rigid meshes are looked at, whose shape is meant as it
    is: bodies that move are samples of what a body may look like, folds of a millimetre included.
    """
    if not isinstance(actor.sequence, RigidMesh):
        return
    found = faceting(actor.sequence.points, actor.faces)
    phase = found.phase(frequency)
    if phase > COARSE:
        error = f"about {6 * phase:.1g} dB" if phase < 0.5 else "several dB"
        warnings.warn(
            f"actor '{actor.name}': its {found.facets:,} facets stand off the smooth surface through its vertices by "
            f"{1e3 * found.sagitta:.2g} mm, {phase:.2g} rad at {frequency / 1e9:.4g} GHz; if it is meant to be smooth, "
            f"its return may be off by {error}, and about {found.facets_needed(frequency):,} facets would do",
            CoarseMeshWarning,
            stacklevel=stacklevel + 1,
        )
