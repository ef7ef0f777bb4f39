"""Straight legs through slabs, and visibility of facets through a sequence of slabs."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import FloatArray, IntArray
from rfgen_sionna.scene.mesh import lengths, unit
from rfgen_sionna.scene.rays import BLIND_GAP, RayScene
from rfgen_sionna.tracing.integral.slabs import NO_SLAB
from rfgen_sionna.tracing.shadows.visible_polygons import bisect_edges
from rfgen_sionna.tracing.surface.surfaces import Surface

MAX_SLABS = 4
"""Most slabs on a leg: more lose too much to matter."""
BLOCKED = -2
"""In place of a slab: opaque."""


class SlabCrossings(NamedTuple):
    """Slabs on each leg."""

    crossed: NDArray[np.int64]
    """(leg, depth) surfaces, nearest to the origin first; `NO_SLAB` after the last, `BLOCKED` on blocked legs."""
    normals: FloatArray
    """(leg, depth, 3) unit normals of the slabs."""

    @property
    def unblocked(self) -> NDArray[np.bool_]:
        """(leg,) whether the leg is free up to slabs."""
        return np.asarray((self.crossed != BLOCKED).all(axis=1))


class SlabTracer:
    """Traces rays through slabs.

    Parameters
    ----------
    rays
        Ray scene.
    vertices, surfaces
        (vertex, 3) [m] of every surface in it, and the surfaces; smooth ones are smooth slabs.
    through
        (surface,) transmitted amplitude, 0 for opaque ones.
    least
        Squared amplitude below which a leg is blocked.
    """

    def __init__(
        self,
        rays: RayScene,
        vertices: Sequence[FloatArray],
        surfaces: Sequence[Surface],
        through: FloatArray,
        least: float,
    ) -> None:
        self._rays, self._through, self._least = rays, through, least
        self._normals = [
            _corner_normals(points, each) if penetrable > 0 else None
            for points, each, penetrable in zip(vertices, surfaces, through, strict=True)
        ]
        self.sent = 0
        """Rays sent so far."""

    def with_rays(self, rays: RayScene) -> SlabTracer:
        """The same in another ray scene, in which additional surfaces are opaque."""
        other = copy(self)
        other._rays, other.sent = rays, 0
        return other

    def __call__(
        self,
        origins: FloatArray,
        targets: FloatArray,
        label: IntArray | None,
        ends: NDArray[np.integer],
        starts: NDArray[np.integer] | None = None,
        exact: bool = False,
    ) -> SlabCrossings:
        """Slabs between `origins` (leg, 3) or (3,) and `targets` (leg, 3) [m].

        Faces of the ray scene have the `label` (face,); None numbers them. Faces `ends` and `starts` (leg,), of target
        and origin, do not block. With `exact`, legs that reach the target without a hit on its face are blocked.
        """
        count = len(targets)
        crossing = np.full((count, MAX_SLABS), NO_SLAB, np.int64)
        normals = np.zeros((count, MAX_SLABS, 3))
        origins = np.broadcast_to(origins, targets.shape)
        left, depth = np.ones(count), np.zeros(count, np.intp)
        span = targets - origins
        reach = lengths(span)
        k = span / np.maximum(reach, 1e-12)[:, None]
        begun = np.zeros(count) if starts is None else BLIND_GAP * reach
        open_ = np.flatnonzero(reach > 0)
        for _ in range(MAX_SLABS + 2):  # one more for a hit on the origin's face
            if len(open_) == 0:
                return SlabCrossings(crossing, normals)
            hits = self._rays.first_hit(origins[open_] + begun[open_, None] * k[open_], k[open_])
            self.sent += len(open_)
            at = begun[open_] + hits.distance
            of = np.where(hits.object < 0, NO_SLAB, hits.facet if label is None else label[hits.facet])
            met = (hits.object >= 0) & (of == ends[open_])
            arrived = ~met & ((hits.object < 0) | (at > (1.0 - BLIND_GAP) * reach[open_]))
            if exact:
                crossing[open_[arrived]] = BLOCKED
            indirect = np.flatnonzero(~met & ~arrived)
            own = np.zeros(len(indirect), np.bool_) if starts is None else of[indirect] == starts[open_[indirect]]
            entered = indirect[~own]
            lane, surface = open_[entered], hits.object[entered]
            left[lane] *= self._through[surface]
            transmitted = (left[lane] ** 2 > self._least) & (depth[lane] < MAX_SLABS)
            crossing[lane[~transmitted]] = BLOCKED
            lane, surface, met_at = lane[transmitted], surface[transmitted], entered[transmitted]
            face, place = hits.face[met_at], hits.barycentric[met_at]
            across = np.empty((len(lane), 3))
            for each in np.unique(surface):
                chosen = surface == each
                corners = self._normals[each]
                if corners is not None:  # transmitting
                    across[chosen] = unit(np.einsum("rc,rci->ri", place[chosen], corners[face[chosen]]))
            across *= -np.sign(np.einsum("ri,ri->r", across, k[lane]))[:, None]
            crossing[lane, depth[lane]], normals[lane, depth[lane]] = surface, across
            depth[lane] += 1
            indirect = np.concatenate([indirect[own], entered[transmitted]])
            open_, at = open_[indirect], at[indirect]
            begun[open_] = at + BLIND_GAP * reach[open_]
        crossing[open_] = BLOCKED
        return SlabCrossings(crossing, normals)


def _corner_normals(points: FloatArray, surface: Surface) -> FloatArray:
    """(face, corner, 3) unit normals."""
    if surface.smooth is not None:
        return surface.smooth.normals(points, surface.faces)
    one, other = (points[surface.faces[:, k]] - points[surface.faces[:, 0]] for k in (1, 2))
    return np.broadcast_to(unit(np.cross(one, other))[:, None], (len(one), 3, 3))


class SlabVisibility:
    """Visibility of facets through slabs, a :class:`rfgen_sionna.tracing.shadows.visible_polygons.VisibilitySampler`.

    Facets have `corners` (facet, 3, 3) [m] on faces `number` (facet,) of the ray scene. They are visible from the
    `viewpoint` (3,) [m] where `slab_tracer` finds exactly the slabs `crossings` (facet, depth).
    """

    def __init__(
        self,
        slab_tracer: SlabTracer,
        viewpoint: FloatArray,
        corners: FloatArray,
        number: IntArray,
        crossings: NDArray[np.int64],
    ) -> None:
        self._slab_tracer, self._viewpoint = slab_tracer, viewpoint
        self._corners, self._number, self._crossings = corners, number, crossings

    def visible(self, of: NDArray[np.intp], places: FloatArray) -> NDArray[np.bool_]:
        """See :class:`rfgen_sionna.tracing.shadows.visible_polygons.VisibilitySampler`."""
        if not len(of):
            return np.zeros(0, np.bool_)
        targets = np.einsum("rc,rci->ri", places, np.take(self._corners, of, axis=0))
        found = self._slab_tracer(self._viewpoint, targets, None, self._number[of])
        return np.asarray((found.crossed == self._crossings[of]).all(axis=1))

    def edges(
        self, of: NDArray[np.intp], unoccluded: FloatArray, occluded: FloatArray, halvings: NDArray[np.intp]
    ) -> tuple[FloatArray, FloatArray]:
        """See there; without the distance of the occluder."""
        return bisect_edges(self.visible, of, unoccluded, occluded, halvings)
