"""Where glints are: on pairs of pieces of bent surfaces that may show one another Newton's method finds the places, and
rays tell whether anything is in between."""

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
"""Rays from surface to surface leave this far above it [m], and what they meet as far above the other is that one, to
which they fall at this cosine at least."""
MIN_SEPARATION = 2.0
"""Wavelengths that both places are apart at least: in a crease of a body rays mean nothing."""
MAX_OVERSHOOT_WAVELENGTHS = 2.0
"""Wavelengths that places lie beyond their faces at most, where these go on smoothly."""
SAME_POINT, SAME_BOUNCE = 1e-6, 1e-3
"""Places as near to each other as that are found by different halves of the same faces, and glints of neighbouring
faces are one [m]."""


class DoubleBounceSearch:
    """Looks for glints at an instant.

    Parameters
    ----------
    skin, rays
        The surfaces as they stand.
    source
        (3,) phase centre of the radar [m].
    wanted
        (face,) which faces of the ray scene count.
    max_range
        Half the length of the longest way that counts [m].
    wavelength
        [m]
    tells
        (face,) of which there has to be one on a glint's way.
    bends
        Faces (n,) to how normals turn at their corners (n, 3, 3, 3) [1/m].
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
        """All glints, each once."""
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
        """Of places (glint, 2, 3) on faces `facet` (glint, 2), which lie about `overshoot` (glint,) [m] these and
        `miss`
        (glint,) by so much [rad], those that the source sees, and that see each other, each once."""
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
        # Halves of the same faces have the same glint, and neighbours do: what is true of the best of them counts.
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
        """(glint,) whether the source sees each `place` (glint, 3) [m] of the plane of a face. `outside` (glint,) that
        by no more than `overshoot` (glint,) [m], it has to see a face there that goes on smoothly."""
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
        """How far above faces of any shape what stands off their smooth surface may be taken to be [m]."""
        return np.asarray(GAP + 2.0 * lengths(self._smoothed.sagittas[facet]).max(axis=-1, initial=0.0))

    def _mutually_visible(self, facet: NDArray[np.int64], point: FloatArray, normal: FloatArray) -> NDArray[np.bool_]:
        """(glint,) whether a ray goes from either place to the other. The smooth surface lies off the triangles: rays
        start above both, and what they meet as near to the other place belongs to that."""
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
            # The mesh may leave a place of the smooth surface free, and the ray goes on to what is behind.
            free[lane] = (hit.distance >= reach) | (near & own) | (hit.facet == facet[lane, there])
            self.sent += len(lane)
        return free

    def _with_curvature(
        self, facet: NDArray[np.int64], place: FloatArray, point: FloatArray, normal: FloatArray
    ) -> DoubleBounces:
        """Glints (glint, 2), ... with how their surfaces bend."""
        face, across = facet.reshape(-1), normal.reshape(-1, 3)
        own = self._curvatures(face)
        outward = np.einsum("ni,ni->n", unit_normals(self._smoothed, face, place.reshape(-1, 3)), across)
        own = own * np.sign(outward)[:, None, None, None]  # positive where they bulge towards the ray
        curvature = tangential(np.einsum("nc,ncij->nij", place.reshape(-1, 3), own), across)
        curvature_gradient = _curvature_gradients(self._smoothed.corners[face], own)
        return DoubleBounces(
            facet, place, point, normal, curvature.reshape(-1, 2, 3, 3), curvature_gradient.reshape(-1, 2, 3, 3, 3)
        )


def _distinct(points: FloatArray, overshoot: FloatArray) -> NDArray[np.intp]:
    """Which of the pairs of `points` (glint, 2, 3) [m], the best ones first, to keep, each once: neighbouring faces
    have the same ones, of which what lies `overshoot` (glint,) [m] one of them is a little elsewhere."""
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
    """(face, 3, 3, 3) gradient over each face, its first axis, [1/m^2] of the `curvatures` (face, 3, 3, 3) at its
    `corners`
    (face, 3, 3) [m]."""
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    square = np.maximum((across**2).sum(axis=1), 1e-300)[:, None]
    found = np.zeros((len(corners), 3, 3, 3))
    for corner in range(3):
        edge = corners[:, (corner + 2) % 3] - corners[:, (corner + 1) % 3]
        slope = np.cross(across, edge) / square
        found += slope[:, :, None, None] * curvatures[:, corner][:, None]
    return found
