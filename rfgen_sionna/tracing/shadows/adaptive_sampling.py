"""RF adaptive sampling: visible share of each facet, with rays where errors of the return would be largest.

Guiding rays go to the facets' corners and past silhouettes. A facet with mixed corners, or that a silhouette ray hits,
has a shadow boundary and is sampled on a lattice, finer where its return is large. Facets of static scenes are searched
for undetected boundaries as well. Shadows finer than the finest lattice keep their share but lose their pattern.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import FloatArray, IntArray
from rfgen_sionna.scene.kernels import FrozenKernel, drjit_types, upload
from rfgen_sionna.scene.mesh import bounds, lengths
from rfgen_sionna.tracing.shadows.lattice_sampling import LatticeSampler, OccluderTest
from rfgen_sionna.tracing.shadows.lattices import SPACINGS, inset_points, points_of
from rfgen_sionna.tracing.shadows.return_bounds import corners_of, error_budget, max_boundary_returns, max_returns
from rfgen_sionna.tracing.shadows.visible_polygons import EDGE_INSET

MISSED_PER_RTOL = 0.25
"""Allowed error of shadow boundaries over the incoherent sum of all returns, per unit of the tolerance."""
CURVED_EDGE_ERROR = 0.125
"""Mean error of polygons with `n` cells per edge, times n^2, over the bound of a cut facet; fitted on bodies."""
_STATIC_EDGE_ERROR = 0.28
"""The same in a furnished room, where errors add up in phase on walls; fitted."""
CORNER_ERROR = 0.3
"""Error of a visible share taken from three corners, over the bound of a cut facet; fitted."""
_MAX_POINTS = 4_000_000
"""Most lattice points per sample time; bounds memory and time."""
_STATIC_MAX_POINTS = 32_000_000
"""The same for a static scene, which is sampled once."""
_SEARCH_SHARE = 0.5
"""Share of the error budget for facets that the search skips."""
_MAX_EDGES = 32.0
"""Most shadow boundaries assumed on one facet; bounds the lattice."""
_MAX_ROUNDS = 3
"""Most refinements after the returns turned out to be less than half of the guide rays' estimate."""


class SampledVisibility(NamedTuple):
    """Visible parts of facets."""

    fraction: FloatArray
    """(facet,) visible share of the area, 0 … 1."""
    owner: NDArray[np.intp]
    """(piece,) facet of each visible piece, ascending; only partly visible facets have pieces."""
    pieces: FloatArray
    """(piece, corner, 3) barycentric coordinates."""
    occluder: FloatArray
    """(piece, 4) :attr:`rfgen_sionna.tracing.shadows.visible_polygons.VisiblePolygons.occluder`, then the width [m] of
    the visible band and the distance ratio of the occluder at its far end; infinity and NaN where the band is wider
    than the array resolves."""
    missed: FloatArray
    """(facet,) estimated error of each return, in units of `returned`."""
    returned: FloatArray
    """(facet,) bound on each return by its visible share, up to a common factor."""
    rays: int
    """Rays sent, without guiding rays."""


def shared_vertices(corners: FloatArray, surface: NDArray[np.integer[Any]] | None = None) -> IntArray:
    """(facet, 3) numbers of coinciding `corners` (facet, 3, 3) [m]; each `surface` (facet,) has its own numbers."""
    if surface is not None:
        places, first = np.zeros((len(corners), 3), np.int32), 0
        for each in np.unique(surface):
            mine = surface == each
            places[mine] = first + shared_vertices(corners[mine])
            first = int(places[mine].max(initial=first - 1)) + 1
        return places
    points = corners.reshape(-1, 3)
    if not len(points):
        return np.zeros((0, 3), np.int32)
    low, high = bounds(points)
    size = max(float((high - low).max()), 1e-9)
    x, y, z = (
        np.rint((row - start) * (2**20 / size)).astype(np.int64) for row, start in zip(points.T, low, strict=True)
    )
    key = (x << 42) + (y << 21) + z
    return np.unique(key, return_inverse=True)[1].reshape(-1, 3).astype(np.int32)


def sample_visibility(
    rays: OccluderTest,
    viewpoint: FloatArray,
    corners: FloatArray,
    facet: IntArray | NDArray[np.int64],
    visible: NDArray[np.bool_],
    wavenumber: float,
    rtol: float,
    silhouette: FloatArray | None = None,
    weight: FloatArray | None = None,
    search: bool = False,
    places: IntArray | None = None,
    reach: float = 0.0,
    occluder_distance: float = np.inf,
    shadowing: FloatArray | None = None,
) -> SampledVisibility:
    """Visible share and visible pieces of facets.

    Sample points are fixed in the facet, so that the share changes smoothly with motion.

    Parameters
    ----------
    rays, viewpoint
        The geometry, and (3,) [m].
    corners, facet
        (facet, 3, 3) [m], and (facet,) face of the ray scene that contains each facet; it does not occlude itself.
    visible
        (facet, 3) visible corners, by :class:`CornerVisibility`.
    wavenumber, rtol
        At the highest frequency [rad/m], and allowed relative error of the sum of all returns.
    silhouette
        (facet,) silhouette length whose shadow falls on each [rad] (:mod:`rfgen_sionna.tracing.shadows.silhouettes`);
        None uses the corners alone.
    weight
        (facet,) field gain of the antennas; None is 1.
    search
        Whether facets without a known boundary are searched for one, with the static budget; shadows narrower than a
        quarter of a facet are neither found nor in `missed`.
    places
        (facet, 3) numbers of :func:`shared_vertices`, for boundaries between two facets; None skips these.
    reach, occluder_distance
        Largest distance of an element and least one of an occluder [m]: adds the boundary's return for other elements.
    shadowing
        (facet,) part of `silhouette` that casts a shadow on the facet, for shadows narrower than a cell; None uses all.
    """
    count = len(corners)
    if not count:
        none = np.zeros(0)
        return SampledVisibility(none, np.zeros(0, np.intp), np.zeros((0, 3, 3)), np.zeros((0, 4)), none, none, 0)
    offset = corners - viewpoint
    most, cut, width = max_returns(offset, wavenumber)
    if np.isfinite(occluder_distance):
        cut = cut + max_boundary_returns(offset, width, reach, occluder_distance, wavenumber)
    if weight is not None:
        most, cut = weight * most, weight * cut
    unoccluded = visible[:, 0].astype(np.int8) + visible[:, 1] + visible[:, 2]
    fraction = unoccluded / 3.0
    mixed = (unoccluded > 0) & (unoccluded < 3)
    silhouette = np.zeros(count) if silhouette is None else silhouette
    passed = silhouette > 0
    edged, skipped, sent = mixed | passed, np.zeros(count), 0
    least = np.full(count, -1, np.intp)
    sampler = LatticeSampler(rays, viewpoint, corners, facet, width, fraction)
    patch, most_points = CURVED_EDGE_ERROR, _MAX_POINTS
    if search:
        allowed = _SEARCH_SHARE * MISSED_PER_RTOL * rtol * float(np.linalg.norm(most * fraction))
        least, skipped, sent = sampler.search(np.where(edged, 0.0, cut), allowed)
        edged |= least >= 0
        patch, most_points = _STATIC_EDGE_ERROR, _STATIC_MAX_POINTS
    errors = patch * cut
    some = np.flatnonzero(passed)
    size = lengths(corners[some] - corners[some][:, [1, 2, 0]]).max(axis=1, initial=0.0)
    size /= np.maximum(lengths(offset[some]).min(axis=1, initial=np.inf), 1e-9)
    # A silhouette counts on both sides of a body.
    errors[some] *= np.clip(0.5 * silhouette[some] / np.maximum(size, 1e-300), 1.0, _MAX_EDGES) ** 2
    share = np.sqrt(1.0 - _SEARCH_SHARE**2) if search else 1.0
    total, wanted, some = np.inf, np.zeros(count), np.flatnonzero(edged)
    for _ in range(_MAX_ROUNDS):
        previous, total = total, float(np.linalg.norm(most * fraction))
        # Light through gaps is overestimated by corners: refine.
        if total >= 0.5 * previous or (total <= 0 and np.isfinite(previous)):
            break
        wanted[some] = np.sqrt(errors[some] / error_budget(errors[some], share * MISSED_PER_RTOL * rtol * total))
        # A coarser lattice would lose an edge that the search found.
        closely = np.flatnonzero(edged & ((wanted > np.sqrt(patch / CORNER_ERROR)) | (least >= 0)))
        finer = np.full(count, -1, np.intp)
        finer[closely] = np.maximum(np.searchsorted(SPACINGS[:-1], wanted[closely]), least[closely])
        while points_of(finer[closely]).sum() > most_points and finer[closely].any():
            finer[closely] = np.maximum(finer[closely] - 1, 0)
        sampler.sample(np.flatnonzero(finer > sampler.lattice), finer)
    lattice = sampler.lattice.copy()
    sampled = lattice >= 0
    missed = np.minimum(cut, np.where(sampled, errors / np.array(SPACINGS)[lattice] ** 2, CORNER_ERROR * cut * edged))
    missed = np.maximum(missed, skipped)
    # Shadows narrower than a cell: refine once where a silhouette ray hit a fully visible or occluded facet.
    got_by = passed if shadowing is None else shadowing > 0
    whole = got_by & sampled & ((fraction == 0) | (fraction == 1))
    narrow = np.flatnonzero(whole & (lattice < len(SPACINGS) - 1) & (np.array(SPACINGS)[lattice] < wanted**2))
    sampler.sample(narrow[np.cumsum(points_of(lattice[narrow] + 1)) < most_points], lattice + 1)
    if places is not None:
        sent += sampler.sample_sides(np.flatnonzero(passed & (lattice >= 0) & (fraction == 1)), places)
    owner, pieces, occluder, rays_sent = sampler.collect(reach, np.pi / wavenumber)
    return SampledVisibility(fraction, owner, pieces, occluder, missed, most * fraction, sent + rays_sent)


class CornerVisibility:
    """Guiding rays, one to each shared corner and side of the surface; the arguments are those of
    :func:`sample_visibility`."""

    def __init__(
        self, viewpoint: FloatArray, corners: FloatArray, facet: IntArray | NDArray[np.int64], places: IntArray
    ) -> None:
        self._viewpoint, self._corners, self._facet = viewpoint, corners, facet
        self.places = places
        self._side = 2 * places + _shown_sides(corners, viewpoint)[:, None]
        # The last corner represents all that coincide.
        self._one = np.full(int(self._side.max(initial=-1)) + 1, -1, np.intp)
        self._one[self._side.ravel()] = np.arange(self._side.size)

    def visible(
        self, rays: OccluderTest, some: NDArray[np.intp] | None = None, moving: bool = False
    ) -> tuple[NDArray[np.bool_], int]:
        """(facet, 3) visible corners of `some` facets, None for all, and the rays sent; `moving` ignores static
        occluders."""
        side = self._side if some is None else self._side[some]
        light = np.zeros(len(self._one), np.bool_)
        light[side.ravel()] = True
        there = np.flatnonzero(light)
        owner, corner = np.divmod(self._one[there], 3)
        targets = rays.targets(self._viewpoint, np.take(self._corners, owner, axis=0), self._facet[owner], moving)
        light[there] = targets.visible(np.arange(len(there)), inset_points(np.eye(3), EDGE_INSET)[corner])
        return light[side], len(there)


def _shown_sides(corners: FloatArray, viewpoint: FloatArray) -> IntArray:
    """(facet,) side of each facet that faces the viewpoint, 0 or 1."""
    if not len(corners):
        return np.zeros(0, np.int32)
    dr, types = drjit_types()
    found = dr.empty(types.UInt32, len(corners))
    given = {
        "lanes": dr.arange(types.UInt32, len(corners)),
        "corners": upload(types.Float64, corners),
        "viewpoint": upload(types.Float64, viewpoint),
        "found": found,
    }
    _TURN_AWAY(given)
    return np.asarray(found.numpy()).view(np.int32)


def _turn_away(given: dict[str, Any]) -> None:
    """Kernel of :func:`_shown_sides`."""
    dr, types = drjit_types()
    a, b, c = corners_of(given)
    eye = types.Array3f64(*(dr.gather(types.Float64, given["viewpoint"], types.UInt32(k)) for k in range(3)))
    away = dr.select(dr.dot(a - eye, dr.cross(b - a, c - a)) < 0, types.UInt32(1), types.UInt32(0))
    dr.scatter(given["found"], away, given["lanes"], mode=dr.ReduceMode.Permute)
    dr.eval(given["found"])


_TURN_AWAY = FrozenKernel(_turn_away)
