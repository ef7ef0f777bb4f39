"""Points on facets that tell what is seen, and what mirrors show of facets."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna.records import FloatArray, IntArray
from rfgen_sionna.scene.rays import RayScene


def lattice(n: int) -> FloatArray:
    """(n^2, 3) barycentric centroids of the n^2 equal triangles that a triangle splits into."""
    upright = [(i + 1 / 3, j + 1 / 3) for i in range(n) for j in range(n - i)]
    inverted = [(i + 2 / 3, j + 2 / 3) for i in range(n) for j in range(n - i - 1)]
    u = np.array(upright + inverted) / n
    return np.column_stack([u, 1 - u.sum(axis=1)])


GUIDE = np.array([[2 / 3, 1 / 6, 1 / 6], [1 / 6, 2 / 3, 1 / 6], [1 / 6, 1 / 6, 2 / 3]])
FINE = lattice(4)
_LEAST_HEIGHT = 1e-4
"""What lies nearer to a mirror than this [m] is on it."""


@dataclass(frozen=True)
class MirrorView:
    """Which mirror shows each facet, and where the mirrors' faces are."""

    normal: FloatArray
    """(facet, 3) unit vector of the facet's mirror, towards the viewpoint's side."""
    offset: FloatArray
    """(facet,) normal . x of the mirror [m]."""
    mirror: IntArray
    """(facet,) number of the mirror."""
    owner: IntArray
    """(face,) number of the mirror that each face of the ray scene belongs to, -1 for none."""


@dataclass(frozen=True)
class MirroredVisibility:
    """Visible shares of facets that mirrors show."""

    once: FloatArray
    """(facet,) share of the area that is seen both directly and by the mirror, 0 … 1."""
    twice: FloatArray
    """(facet,) share that is seen by the mirror."""
    points: NDArray[np.uint16]
    """(facet,) which of the points `FINE` that is, a bit for each: all or none where guiding rays agree."""
    rays: int


def mirrored_fraction(
    rays: RayScene, viewpoint: FloatArray, corners: FloatArray, facet: IntArray, direct: FloatArray, view: MirrorView
) -> MirroredVisibility:
    """Share of each facet's area that its mirror shows to the viewpoint.

    A point counts where the way from the viewpoint first meets the mirror in the place that the law of reflection asks
    for, and nothing is between that place and the point. `direct` (facet,) is the share that is seen directly. Three
    guiding rays go to every facet; where they disagree, or where the neighbour in the list (most often one in the mesh
    too) is shown differently, 16 on a lattice decide.
    """
    count = 0

    def shares(index: NDArray[np.intp], weights: FloatArray) -> tuple[FloatArray, NDArray[np.bool_]]:
        """The share seen both ways, and (sample, facet) which points the mirror shows."""
        nonlocal count
        targets = np.tensordot(weights, corners[index], axes=(1, 1)).reshape(-1, 3)  # sample by sample
        lane = np.tile(index, len(weights))
        normal, offset = view.normal[lane], view.offset[lane]
        here, there = normal @ viewpoint - offset, np.einsum("ri,ri->r", targets, normal) - offset
        twice = there > _LEAST_HEIGHT
        sent = np.flatnonzero(twice)
        normal, here, there, lane = normal[sent], here[sent, None], there[sent, None], lane[sent]
        foot, other = viewpoint - here * normal, targets[sent] - there * normal
        place = (there * foot + here * other) / (here + there)
        hit = rays.first_facet(viewpoint, place - viewpoint)
        on = (hit >= 0) & (view.owner[hit] == view.mirror[lane])
        twice[sent[~on]] = False
        count += len(sent)
        sent, place, hit, lane = sent[on], place[on], hit[on], lane[on]
        twice[sent] = ~rays.occluded(place, targets[sent], facet[lane], hit)
        count += len(sent)
        once = twice.copy()
        sent = np.flatnonzero(twice)
        lane = np.tile(index, len(weights))[sent]
        once[sent[direct[lane] == 0]] = False
        partly = (direct[lane] > 0) & (direct[lane] < 1)
        sent, lane = sent[partly], lane[partly]
        once[sent] = ~rays.occluded(viewpoint, targets[sent], facet[lane])
        count += len(sent)
        shape = len(weights), len(index)
        return once.reshape(shape).mean(axis=0), twice.reshape(shape)

    once, by_points = shares(np.arange(len(corners)), GUIDE)
    twice = by_points.mean(axis=0)
    mixed = (twice > 0) & (twice < 1) | (once != twice) & (once > 0)
    step = (twice[1:] != twice[:-1]) & (view.mirror[1:] == view.mirror[:-1])
    mixed[1:] |= step
    mixed[:-1] |= step
    points = np.where(twice > 0, ~np.uint16(0), np.uint16(0))
    index = np.flatnonzero(mixed)
    once[index], by_points = shares(index, FINE)
    twice[index] = by_points.mean(axis=0)
    points[index] = (by_points << np.arange(len(FINE), dtype=np.uint16)[:, None]).sum(axis=0, dtype=np.uint16)
    return MirroredVisibility(once, twice, points, count)


def seen_by_both(one: NDArray[np.uint16], other: NDArray[np.uint16]) -> FloatArray:
    """Share of the points `FINE` that are among both of two choices of :attr:`MirroredVisibility.points`."""
    return np.asarray(np.bitwise_count(one & other) / len(FINE))
