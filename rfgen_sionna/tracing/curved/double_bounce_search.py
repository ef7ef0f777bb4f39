"""Search of specular double bounces: Newton's method on candidate pairs of surface patches, then visibility rays."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from rfgen_sionna._types import FloatArray
from rfgen_sionna.scene.mesh import lengths
from rfgen_sionna.scene.rays import RayScene
from rfgen_sionna.tracing.curved.double_bounces import DoubleBounces, unit_normals
from rfgen_sionna.tracing.curved.patch_pairs import PathLimits, candidate_pairs
from rfgen_sionna.tracing.curved.smoothed_surface import SmoothedSurface, tangential
from rfgen_sionna.tracing.curved.specular_points import find_specular_points
from rfgen_sionna.tracing.curved.surface_patches import PatchSubdivision

GAP, STEEP = 1e-4, 0.3
"""Height [m] of ray origins above a surface; least cosine of incidence that such heights are divided by."""
MIN_SEPARATION = 2.0
"""Least distance of both points [wavelengths]: rays are meaningless in a crease of a body."""
MAX_OVERSHOOT_WAVELENGTHS = 2.0
"""Most distance of a point outside its face, on a smooth continuation [wavelengths]."""
SAME_POINT, SAME_BOUNCE = 1e-6, 1e-3
"""Distances [m] of equal points, found on halves of the same faces, and of equal double bounces on neighbouring faces.
"""


class DoubleBounceSearch:
    """Finds double bounces at one time.

    Parameters
    ----------
    surface_model, rays
        The surfaces at that time.
    source, max_range, wavelength
        (3,) phase centre of the radar, half the longest path length, and wavelength [m].
    wanted, required
        (face,) candidate faces, and faces of which at least one is on each path.
    curvatures
        From faces (n,) to the change of normals at their corners (n, 3, 3, 3) [1/m].
    """

    def __init__(
        self,
        surface_model: SmoothedSurface,
        rays: RayScene,
        source: FloatArray,
        wanted: NDArray[np.bool_],
        max_range: float,
        wavelength: float,
        required: NDArray[np.bool_],
        curvatures: Callable[[NDArray[np.int64]], FloatArray],
    ) -> None:
        self._smoothed, self._rays, self._source, self._wanted = surface_model, rays, source, wanted
        self._required, self._curvatures = required, curvatures
        self._max_overshoot = MAX_OVERSHOOT_WAVELENGTHS * wavelength
        self._limits = PathLimits(MIN_SEPARATION * wavelength, 2.0 * max_range)
        self.sent = 0
        """Rays sent so far."""

    def find(self) -> DoubleBounces:
        """All double bounces, each once."""
        surface_model, source = self._smoothed, self._source
        subdivision = PatchSubdivision(surface_model, source, np.flatnonzero(self._wanted))
        size = lengths(surface_model.corners[:, [1, 2, 0]] - surface_model.corners).max(axis=1, initial=0.0)
        faces, weights, rank = [np.zeros((0, 2), np.int64)], [np.zeros((0, 2, 3))], [np.zeros((2, 0))]
        for one, other in candidate_pairs(subdivision, self._required, self._limits):
            pieces = subdivision.pieces
            pair = pieces.facet[one], pieces.facet[other]
            found = find_specular_points(surface_model, source, pair, (pieces.weights[one], pieces.weights[other]))
            faces.append(np.stack(pair, axis=1)[found.pair])
            weights.append(found.weights)
            width = size[faces[-1]].max(axis=1, initial=0.0)
            rank.append(np.stack([np.maximum(found.overshoot, 0.0) * width, found.miss]))
        return self._visible(np.concatenate(faces), np.concatenate(weights), *np.concatenate(rank, axis=1))

    def _visible(
        self, facet: NDArray[np.int64], weights: FloatArray, overshoot: FloatArray, miss: FloatArray
    ) -> DoubleBounces:
        """Visible ones of the points (n, 2, 3) on faces `facet` (n, 2), each once. They lie about `overshoot` (n,) [m]
        outside their faces and miss by `miss` (n,) [rad]."""
        surface_model, source, count = self._smoothed, self._source, len(facet)
        reverse = facet[:, 0] > facet[:, 1]
        facet[reverse], weights[reverse] = facet[reverse][:, ::-1], weights[reverse][:, ::-1]
        lane, place = facet.reshape(-1), weights.reshape(-1, 3)
        flat, point = surface_model.places(lane, place)
        normal = unit_normals(surface_model, lane, place)
        normal *= -np.sign(np.einsum("ni,ni->n", normal, point - source))[:, None]
        flat, point, normal = (each.reshape(count, 2, 3) for each in (flat, point, normal))
        way = lengths(point[:, 1] - point[:, 0])
        total = way + lengths(point - source).sum(axis=1)
        counts = (way >= self._limits.shortest) & (total <= self._limits.longest) & (overshoot < self._max_overshoot)
        kept = np.flatnonzero(counts)
        # Halves of a face and neighbouring faces share a double bounce: the best one stays.
        kept = kept[np.lexsort((miss[kept], overshoot[kept]))]
        alike = np.round(point[kept].reshape(-1, 6) / SAME_POINT).astype(np.int64)
        kept = kept[np.sort(np.unique(alike, axis=0, return_index=True)[1])]
        kept = kept[_distinct(point[kept], overshoot[kept])]
        for side in range(2):
            outside = weights[kept, side].min(axis=1, initial=np.inf) < 0
            stands = flat[kept, side], normal[kept, side], facet[kept, side]
            kept = kept[self._visible_from_source(*stands, outside, overshoot[kept])]
        kept = kept[self._mutually_visible(facet[kept], point[kept], normal[kept])]
        return self._with_curvature(facet[kept], weights[kept], point[kept], normal[kept])

    def _visible_from_source(
        self,
        place: FloatArray,
        normal: FloatArray,
        facet: NDArray[np.int64],
        outside: NDArray[np.bool_],
        overshoot: FloatArray,
    ) -> NDArray[np.bool_]:
        """(n,) whether the source sees each `place` (n, 3) [m] in the plane of a face. A point `outside` (n,) its face,
        by at most `overshoot` (n,) [m], needs a visible face of the same smooth sheet."""
        visible, within = np.zeros(len(place), np.bool_), ~outside
        self.sent += len(place)
        if within.any():
            visible[within] = ~self._rays.occluded(self._source, place[within], facet[within])
        if outside.any():
            span, own = place[outside] - self._source, facet[outside]
            reach = np.maximum(lengths(span), 1e-9)
            fall = -np.einsum("gi,gi->g", span, normal[outside]) / reach
            hit = self._rays.first_hit(self._source, span / reach[:, None])
            near = np.abs(reach - hit.distance) < (self._rise(own) + overshoot[outside]) / np.maximum(fall, STEEP)
            sheet = self._smoothed.sheet
            visible[outside] = near & (sheet[np.maximum(hit.facet, 0)] == sheet[own])
        return visible

    def _rise(self, facet: NDArray[np.int64]) -> FloatArray:
        """Height of ray origins above the smooth surface of faces [m]."""
        return np.asarray(GAP + 2.0 * lengths(self._smoothed.sagittas[facet]).max(axis=-1, initial=0.0))

    def _mutually_visible(self, facet: NDArray[np.int64], point: FloatArray, normal: FloatArray) -> NDArray[np.bool_]:
        """(n,) whether a ray joins both points, in either direction. The smooth surface is off the triangles: rays
        start above one point, and a hit within that height of the other belongs to it."""
        free = np.zeros(len(facet), np.bool_)
        rise = self._rise(facet)
        for here, there in ((0, 1), (1, 0)):
            lane = np.flatnonzero(~free)
            if len(lane) == 0:
                break
            start = point[lane, here] + rise[lane, here, None] * normal[lane, here]
            span = point[lane, there] - start
            reach = np.maximum(lengths(span), 1e-9)
            fall = -np.einsum("gi,gi->g", span, normal[lane, there]) / reach
            hit = self._rays.first_hit(start, span / reach[:, None])
            near = reach - hit.distance < rise[lane, there] / np.maximum(fall, STEEP)
            own = self._smoothed.sheet[np.maximum(hit.facet, 0)] == self._smoothed.sheet[facet[lane, there]]
            # The mesh may lie below the smooth surface, and the ray passes the point.
            free[lane] = (hit.distance >= reach) | (near & own) | (hit.facet == facet[lane, there])
            self.sent += len(lane)
        return free

    def _with_curvature(
        self, facet: NDArray[np.int64], place: FloatArray, point: FloatArray, normal: FloatArray
    ) -> DoubleBounces:
        """Double bounces with curvatures and their gradients."""
        face, across = facet.reshape(-1), normal.reshape(-1, 3)
        own = self._curvatures(face)
        outward = np.einsum("ni,ni->n", unit_normals(self._smoothed, face, place.reshape(-1, 3)), across)
        own = own * np.sign(outward)[:, None, None, None]  # positive where convex towards the ray
        curvature = tangential(np.einsum("nc,ncij->nij", place.reshape(-1, 3), own), across)
        curvature_gradient = _curvature_gradients(self._smoothed.corners[face], own)
        return DoubleBounces(
            facet, place, point, normal, curvature.reshape(-1, 2, 3, 3), curvature_gradient.reshape(-1, 2, 3, 3, 3)
        )


def _distinct(points: FloatArray, overshoot: FloatArray) -> NDArray[np.intp]:
    """Indices of the pairs of `points` (n, 2, 3) [m], best first, without duplicates from neighbouring faces; points
    `overshoot` (n,) [m] outside their face are less exact."""
    kept = np.ones(len(points), np.bool_)
    if len(points) > 1:
        slack = 2.0 * overshoot
        pairs = cKDTree(points.reshape(-1, 6)).query_pairs(SAME_BOUNCE + slack.max(), output_type="ndarray")
        better, worse = np.sort(pairs, axis=1).T
        gap = np.sqrt(((points[better] - points[worse]) ** 2).sum(axis=(1, 2)))
        near = np.flatnonzero(gap < SAME_BOUNCE + np.maximum(slack[better], slack[worse]))
        for k in near[np.argsort(better[near], kind="stable")].tolist():
            if kept[better[k]]:
                kept[worse[k]] = False
    return np.flatnonzero(kept)


def _curvature_gradients(corners: FloatArray, curvatures: FloatArray) -> FloatArray:
    """(face, 3, 3, 3) gradient over each face, first axis, of `curvatures` (face, 3, 3, 3) at `corners` (face, 3, 3)
    [1/m^2]."""
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    square = np.maximum((across**2).sum(axis=1), 1e-300)[:, None]
    found = np.zeros((len(corners), 3, 3, 3))
    for corner in range(3):
        edge = corners[:, (corner + 2) % 3] - corners[:, (corner + 1) % 3]
        slope = np.cross(across, edge) / square
        found += slope[:, :, None, None] * curvatures[:, corner][:, None]
    return found
