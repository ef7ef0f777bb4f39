"""Image sources behind planar reflectors, and facets on which the shadows of their outlines fall."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import FloatArray, IntArray
from rfgen_sionna.scene.materials import Material
from rfgen_sionna.tracing.surface.clip import clip_triangles, triangle_areas
from rfgen_sionna.tracing.surface.facets import Facets


class ImageSource(NamedTuple):
    """An end of the path: the radar, or its image with the cone of one window; relative to the viewpoint [m]."""

    image: FloatArray
    normal: FloatArray
    """(3,) of the reflector; 0 without one."""
    sides: FloatArray
    """(side, 3) half-spaces of the cone, sides . x >= offsets; the last one is the reflector."""
    offsets: FloatArray
    edges: FloatArray
    """(edge, 2, 3) ends of the window's edges, in the order of `sides`."""
    outer: NDArray[np.intp]
    """Edges of the reflector's outline, not between its windows."""
    material: Material | None


class ShadowTargets(NamedTuple):
    """Planar targets of shadow boundaries."""

    pieces: FloatArray
    """(piece, 3, 3) triangles [m], relative to the viewpoint."""
    owner: NDArray[np.intp]
    """(piece,) target of each."""
    normal: FloatArray
    """(target, 3)"""
    group: NDArray[np.intp]
    """(target,) targets of one group add coherently."""
    weight: FloatArray
    """(target,) visible share."""
    surface: IntArray
    """(group,) surface of each group."""
    flat: IntArray
    """(group,) its planar part; -1 for faces of curved surfaces, which continue."""


def reflector_targets(
    facet: NDArray[np.intp],
    visible: FloatArray,
    ways: Sequence[tuple[ImageSource, ImageSource]],
    triangles_of: Callable[[int], FloatArray],
    facets: Facets,
    own: IntArray,
) -> ShadowTargets:
    """Planar parts of the facets (entry,) with a `visible` (entry,) area [m^2]; `triangles_of` returns the triangles of
    a part, relative to the viewpoint [m]."""
    flat = own[facet]
    facet, visible, flat = facet[flat >= 0], visible[flat >= 0], flat[flat >= 0]
    planar_parts, first, index = np.unique(flat, return_index=True, return_inverse=True)
    count, triangles = len(planar_parts), [triangles_of(number) for number in planar_parts.tolist()]
    pieces = np.concatenate([*triangles, np.zeros((0, 3, 3))])
    owner = np.repeat(np.arange(count), [len(each) for each in triangles])
    visible_facets = np.zeros(count)
    for one, other in ways:
        left, of = clip_triangles(
            pieces, owner, np.concatenate([one.sides, other.sides]), np.append(one.offsets, other.offsets)
        )
        visible_facets += np.bincount(of, triangle_areas(left), count)
    weight = np.minimum(np.bincount(index.reshape(-1), visible, count) / np.maximum(visible_facets, 1e-300), 1.0)
    normal = triangle_normals(np.stack([each[0] for each in triangles])) if count else np.zeros((0, 3))
    return ShadowTargets(pieces, owner, normal, np.arange(count), weight, facets.surface[facet[first]], planar_parts)


def facet_targets(
    facet: NDArray[np.intp],
    size: FloatArray,
    visible: FloatArray,
    facets: Facets,
    own: IntArray,
    view: FloatArray,
) -> ShadowTargets:
    """Facets (entry,) on no planar part, with `visible` of the area `size` (entry,) [m^2]."""
    bent = own[facet] < 0
    facet, weight = facet[bent], visible[bent] / np.maximum(size[bent], 1e-300)
    surface, group = np.unique(facets.surface[facet], return_inverse=True)
    pieces, every = facets.corners[facet] - view, np.arange(len(facet))
    return ShadowTargets(
        pieces, every, triangle_normals(pieces), group.reshape(-1), weight, surface, np.full(len(surface), -1)
    )


def triangle_normals(triangles: FloatArray) -> FloatArray:
    """(triangle, 3) unit vectors."""
    cross = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    return np.asarray(cross / np.maximum(np.linalg.norm(cross, axis=1, keepdims=True), 1e-300))
