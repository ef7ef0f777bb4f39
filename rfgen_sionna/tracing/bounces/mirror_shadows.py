"""Shadows that the outlines of plates throw, and what they fall on: what
:mod:`~rfgen_sionna.tracing.bounces.mirror_edges` integrates along."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import FloatArray, IntArray
from rfgen_sionna.scene.materials import Material
from rfgen_sionna.tracing.bounces.landing import DIRECT, Landing
from rfgen_sionna.tracing.bounces.plates import Plate
from rfgen_sionna.tracing.surface.clip import areas, cut
from rfgen_sionna.tracing.surface.facets import Facets

NEAR = 1e-6
"""What is nearer to an edge or to a plane than this [m] is on it."""


class End(NamedTuple):
    """An end of the way: the radar, or its image with the shadow that a window of a plate throws; all relative to the
    viewpoint [m]."""

    image: FloatArray
    normal: FloatArray
    """(3,) of the plate; 0 where there is none."""
    sides: FloatArray
    """(side, 3) half-spaces of the shadow, sides . x >= offsets; the plate itself is the last one."""
    offsets: FloatArray
    edges: FloatArray
    """(edge, 2, 3) ends of the window's edges, in the order of `sides`."""
    outer: NDArray[np.intp]
    """Those that are the plate's, and no seam between its windows."""
    material: Material | None


STRAIGHT = End(np.zeros(3), np.zeros(3), np.zeros((0, 3)), np.zeros(0), np.zeros((0, 2, 3)), np.zeros(0, np.intp), None)


def ends(plate: Plate | None, view: FloatArray) -> list[End]:
    """One for each window; none where there is no plate."""
    if plate is None:
        return []
    image = -2.0 * float(plate.height(view)) * plate.normal
    edges = [np.stack([each, np.roll(each, -1, axis=0)], axis=1) - view for each in plate.windows]
    # What lies between two windows is in both.
    places = np.rint(np.concatenate(edges).sum(axis=1) / (2 * NEAR)).astype(np.int64)
    _, same, count = np.unique(places, axis=0, return_inverse=True, return_counts=True)
    seam, found, begin = count[same.reshape(-1)] > 1, [], 0
    for own, (sides, offsets) in zip(edges, plate.shadow(view), strict=True):
        outer = np.flatnonzero(~seam[begin : begin + len(own)])
        begin += len(own)
        before = np.append(offsets[:-1], offsets[-1] + NEAR)
        found.append(End(image, plate.normal, sides, before, own, outer, plate.material))
    return found


class Targets(NamedTuple):
    """Plane things that shadows fall on."""

    pieces: FloatArray
    """(piece, 3, 3) triangles [m], relative to the viewpoint."""
    owner: NDArray[np.intp]
    """(piece,) target that each is of."""
    normal: FloatArray
    """(target, 3)"""
    group: NDArray[np.intp]
    """(target,) those of one group return together."""
    weight: FloatArray
    """(target,) share that is seen."""
    surface: IntArray
    """(group,) what a group is part of ..."""
    flat: IntArray
    """(group,) ... and the flat part that it is; -1 are faces of what is bent, beside which others go on."""


def of_plates(
    facet: NDArray[np.intp],
    seen: FloatArray,
    ways: Sequence[tuple[End, End]],
    outline: Callable[[int], FloatArray],
    facets: Facets,
    own: IntArray,
) -> Targets:
    """Flat parts that some facets (entry,) are on, of which an area `seen` (entry,) [m^2] returns; `outline` tells the
    triangles that one is made of, relative to the viewpoint [m]."""
    flat = own[facet]
    facet, seen, flat = facet[flat >= 0], seen[flat >= 0], flat[flat >= 0]
    flats, first, index = np.unique(flat, return_index=True, return_inverse=True)
    count, triangles = len(flats), [outline(number) for number in flats.tolist()]
    pieces = np.concatenate([*triangles, np.zeros((0, 3, 3))])
    owner = np.repeat(np.arange(count), [len(each) for each in triangles])
    shown = np.zeros(count)
    for one, other in ways:
        left, of = cut(pieces, owner, np.concatenate([one.sides, other.sides]), np.append(one.offsets, other.offsets))
        shown += np.bincount(of, areas(left), count)
    weight = np.minimum(np.bincount(index.reshape(-1), seen, count) / np.maximum(shown, 1e-300), 1.0)
    normal = normals(np.stack([each[0] for each in triangles])) if count else np.zeros((0, 3))
    return Targets(pieces, owner, normal, np.arange(count), weight, facets.surface[facet[first]], flats)


def of_faces(
    facet: NDArray[np.intp],
    size: FloatArray,
    seen: FloatArray,
    facets: Facets,
    own: IntArray,
    view: FloatArray,
) -> Targets:
    """Those of the facets (entry,) that are on no flat part; of an area `size` (entry,) `seen` returns [m^2]."""
    bent = own[facet] < 0
    facet, weight = facet[bent], seen[bent] / np.maximum(size[bent], 1e-300)
    surface, group = np.unique(facets.surface[facet], return_inverse=True)
    pieces, every = facets.corners[facet] - view, np.arange(len(facet))
    return Targets(pieces, every, normals(pieces), group.reshape(-1), weight, surface, np.full(len(surface), -1))


def normals(triangles: FloatArray) -> FloatArray:
    """(triangle, 3) unit vectors."""
    cross = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    return np.asarray(cross / np.maximum(np.linalg.norm(cross, axis=1, keepdims=True), 1e-300))


def by_plates(landing: Landing) -> list[tuple[int, int, NDArray[np.intp]]]:
    """Pairs of plates, and which entries go by them; of both ways round one."""
    once = np.flatnonzero((landing.last == DIRECT) | ((landing.first <= landing.last) & (landing.first != DIRECT)))
    order = once[np.lexsort([landing.last[once], landing.first[once]])]
    pair = np.stack([landing.first[order], landing.last[order]], axis=1)
    starts = 1 + np.flatnonzero((np.diff(pair, axis=0) != 0).any(axis=1))
    lots = np.split(order, starts)
    return [(int(landing.first[lot[0]]), int(landing.last[lot[0]]), lot) for lot in lots if len(lot)]


def spans(t: FloatArray, s: FloatArray, at: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(piece, cell) where lines across, at `at` (piece, cell), enter and leave triangles with corners `t`, `s`
    (piece, corner); the other way round where they miss them."""
    away = t[:, :, None] - at[:, None]
    after, beyond = np.roll(away, -1, axis=1), np.roll(s, -1, axis=1)
    met = away * after < 0
    share = away / np.where(met, away - after, 1.0)
    place = s[:, :, None] + share * (beyond - s)[:, :, None]
    return np.where(met, place, np.inf).min(axis=1), np.where(met, place, -np.inf).max(axis=1)


def by_edge(
    lamp: End, edge: NDArray[np.intp], places: FloatArray, normal: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Of the shortest ways from the lamp by its `edge` (line,) to `places` (line, place, 3) on a surface with a
    `normal` (line, 3): by how much longer than straight ones they are [m], what of them comes after the edge, divided
    by the share that comes before it [m], and the cosine of their incidence. All (line, place)."""
    one, other = np.moveaxis(lamp.edges[edge][:, :, None], 1, 0)
    along = (other - one) / np.linalg.norm(other - one, axis=-1, keepdims=True)

    def unrolled(points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """How far along the edge and from it."""
        offset = points - one
        length = (offset * along).sum(axis=-1)
        return length, np.linalg.norm(offset - length[..., None] * along, axis=-1)

    (here, near), (there, far) = unrolled(lamp.image), unrolled(places)
    way, share = np.hypot(near + far, here - there), near / (near + far)
    longer = np.maximum(way - np.linalg.norm(places - lamp.image, axis=-1), 0.0)
    rest = way * (1 - share)
    turn = one + (here + share * (there - here))[..., None] * along
    height = np.abs(np.einsum("lpi,li->lp", places - turn, normal))
    return longer, rest / share, np.where(rest > NEAR, height / np.maximum(rest, NEAR), 0.0)
