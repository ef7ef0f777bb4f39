"""RF adaptive sampling: how much of each facet the radar sees, by rays that go where they matter.

Guiding rays go to the corners of facets, one for all that share a corner, and just past the outlines of bodies. Facets
whose corners fare differently, or that such a ray falls on, have a shadow's edge on them, which is found by more rays,
the more may be missed: a facet that lies aslant, over many wavelengths, returns little, and a few will do. Where the
shadow of a grille is finer than the finest lattice its share is right, its pattern is not, and the estimate is too low.

Of what stays, which is looked at once, edges are searched for on all other facets that matter as well: a pole leaves
facets behind it lit at all corners, and surfaces that run through each other have no outline there.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import FloatArray, IntArray
from rfgen_sionna.scene.kernels import FrozenKernel, drjit_types, upload
from rfgen_sionna.scene.mesh import bounds, lengths
from rfgen_sionna.tracing.shadows.lattice_sampling import LatticeSampler, OccluderTest, search_lattices
from rfgen_sionna.tracing.shadows.lattices import SPACINGS, inset_points, points_of
from rfgen_sionna.tracing.shadows.return_bounds import corners_of, max_boundary_returns, max_returns
from rfgen_sionna.tracing.shadows.visible_polygons import EDGE_INSET, VisibilitySampler, find_visible_polygons

MISSED_PER_RTOL = 0.25
"""Estimated error of all returns together for what is not known of shadows' edges, against what all return without
interfering, per unit of the tolerance."""
CURVED_EDGE_ERROR = 0.125
"""What lines between `n` points along a facet's edge miss, in the mean, times n^2, against what it may return."""
_STATIC_EDGE_ERROR = 0.28
"""The same of what stays, a furnished room, where edges of many things cross and what they miss adds up in phase on
walls. What actors hide of it is no better for being looked at as closely."""
CORNER_ERROR = 0.3
"""What the number of its corners that are seen misses of a facet."""
_MAX_POINTS = 4_000_000
"""Points that are looked at on all facets, at most, before shadows' edges are found where they are crossed."""
_STATIC_MAX_POINTS = 32_000_000
"""The same of what is looked at once."""
_SEARCH_SHARE = 0.5
"""Share of what may be missed that facets may which are not searched."""
_MAX_EDGES = 32.0
"""Shadows' edges that are reckoned with on one facet, at most."""
_CHORD = 0.45
"""Mean length of straight edges on a facet, over its longest side: pi times the area over the girth of an equilateral
triangle."""
_UNSAMPLED_EDGE_RETURN = 0.25
"""What a facet returns less or more for an edge that is not looked at, over what it may return when cut: so much that
light that was missed on purpose, in five poses of a body, is stated with half as much again."""
_MAX_ROUNDS = 3
"""How often facets are looked at, ever more closely, where there is much less light than corners told of."""


class SampledVisibility(NamedTuple):
    """What of facets is seen."""

    fraction: FloatArray
    """(facet,) share of the area that nothing hides, 0 … 1."""
    owner: NDArray[np.intp]
    """(piece,) facet that a piece is of, ascending: those that are seen of facets that are hidden in part."""
    pieces: FloatArray
    """(piece, corner, 3) barycentric coordinates of their corners."""
    occluder: FloatArray
    """(piece, 4) :attr:`rfgen_sionna.tracing.shadows.visible_polygons.Lit.occluder`; then how far [m] the facet's
    plane is lit from
    there on, and how far off what casts the shadow that follows is, over the way there: infinity and NaN where that is
    further than any element tells."""
    missed: FloatArray
    """(facet,) estimated error of what each returns, in units of `returned`."""
    returned: FloatArray
    """(facet,) what each may return, up to a factor that all share, by the share that is seen."""
    rays: int
    """Rays sent, apart from guiding ones."""


def shared_vertices(corners: FloatArray, surface: NDArray[np.integer[Any]] | None = None) -> IntArray:
    """(facet, 3) numbers of the places where the `corners` (facet, 3, 3) [m] are: facets that share one touch, if they
    are of the same `surface` (facet,)."""
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
    group: NDArray[np.integer[Any]] | None = None,
    before: NDArray[np.bool_] | None = None,
    level: FloatArray | float = 0.0,
    moving: bool = False,
    search: bool = False,
    times: int = 1,
    ray_spacing: float = 0.0,
    places: IntArray | None = None,
    occluded: IntArray | None = None,
    reach: float = 0.0,
    occluder_distance: float = np.inf,
    shadowing: FloatArray | None = None,
) -> SampledVisibility:
    """Share of each facet's area that nothing hides from the viewpoint, and which pieces of those in half shadow.

    The points looked at are fixed in the facet: the share changes gradually while it moves.

    Parameters
    ----------
    rays
        The geometry.
    viewpoint
        (3,) [m].
    corners
        (facet, 3, 3) [m].
    facet
        (facet,) number of the ray scene's face that each facet is a piece of; it does not hide itself.
    seen
        (facet, 3) which corners are seen, by :class:`CornerVisibility`.
    wavenumber
        At the highest frequency [rad/m].
    rtol
        Allowed error of the return of all together.
    outline
        (facet,) length of outlines whose shadows fall on each [rad] (:mod:`rfgen_sionna.tracing.shadows.silhouettes`);
        None: no shadow is looked for beyond what corners tell.
    weight
        (facet,) the antennas' field gain towards each; None is 1.
    group
        (facet,) what belongs together: errors are relative to what the facets of a group return; None: all do.
    before
        (facet, 3) which corners were seen when something was not there that is now: facets that it does not shadow are
        seen as a whole. None: there is no telling.
    level
        The least that counts as what all return without interfering, in units of :attr:`SampledVisibility.returned`;
        an array has that of each group.
    moving
        Whether nothing but moving objects hides: shares are of what is seen without them.
    search
        Whether edges are looked for on facets, too, that neither corners nor outlines tell of any: where surfaces
        run through each other, and behind what is narrow. It takes a few rays to each facet that would matter, and
        edges that are known are looked at more closely than where facets are looked at again and again. What is too
        narrow for these rays, a quarter of a facet, is neither found nor in `missed`.
    times
        Number of times that the facets are looked at together: so many more points may be looked at.
    ray_spacing
        Angle between rays past outlines [rad]: edges that pass smaller facets between two of them, and reach no corner,
        are not looked at. Those that are tell how many these are, and so what `missed` has of them.
    places
        (facet, 3) those of :func:`shared_vertices`, by which edges that fall between two facets are known; None: they
        are not asked for.
    dark
        (facet, 3) places of others, of which nothing is seen.
    reach
        How far elements are from the viewpoint at most [m]: as far as they see past edges, what follows the lit side is
        looked for.
    occluder_distance
        How far what hides is from the viewpoint at least [m], if that is known: by that and `reach` the strips beside
        edges, which not all elements see alike, may return more than a narrow facet itself, and ask for a closer look.
        Infinity: it is not, and they count for nothing.
    shadowing
        (facet,) what of the `silhouette` has its shadow there: what is narrower than a lattice is looked for by that.
        None is all of it.
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
    if before is not None:
        changed = (visible != before).any(axis=1)
        share = np.minimum(unoccluded / np.maximum(before.sum(axis=1), 1), 1.0)
        fraction, mixed = np.where(changed, share, 1.0), changed & (unoccluded > 0)
    silhouette = np.zeros(count) if silhouette is None else silhouette
    passed = silhouette > 0
    edged, hidden, sent = mixed | passed, np.zeros(count), 0
    least = np.full(count, -1, np.intp)
    if search:
        level_there = float(np.linalg.norm(most * fraction))
        least, hidden, sent = search_lattices(
            rays, viewpoint, corners, facet, moving, fraction > 0, np.where(edged, 0.0, cut),
            _SEARCH_SHARE * MISSED_PER_RTOL * rtol * level_there,
        )  # fmt: skip
        edged |= least >= 0
    patch, most_points = (
        (_STATIC_EDGE_ERROR, _STATIC_MAX_POINTS) if search else (CURVED_EDGE_ERROR, times * _MAX_POINTS)
    )
    bent = patch * cut
    some = np.flatnonzero(passed)
    size = lengths(corners[some] - corners[some][:, [1, 2, 0]]).max(axis=1, initial=0.0)
    size /= np.maximum(lengths(offset[some]).min(axis=1, initial=np.inf), 1e-9)
    wide = np.zeros(count)
    wide[some] = size
    lines = np.clip(
        0.5 * silhouette[some] / np.maximum(size, 1e-300), 1.0, _MAX_EDGES
    )  # one line counts there and back
    bent[some] *= lines**2
    share = np.sqrt(1.0 - _SEARCH_SHARE**2) if search else 1.0
    groups = np.zeros(1, np.intp) if group is None else np.flatnonzero(np.bincount(group[edged]))
    members = [np.arange(count) if group is None else np.flatnonzero(group == each) for each in groups]
    floors = np.full(len(groups), level) if np.ndim(level) == 0 else np.asarray(level)[groups]
    total, wanted = np.full(len(groups), np.inf), np.zeros(count)
    sampler = LatticeSampler(rays, viewpoint, corners, facet, moving, width, fraction)
    for _ in range(_MAX_ROUNDS):
        told, total = total, np.maximum([np.linalg.norm(most[mine] * fraction[mine]) for mine in members], floors)
        # Light through gaps is less than what corners tell of: then it is looked at more closely.
        again = (total < 0.5 * told) & ((total > 0) | np.isinf(told))
        if not again.any():
            break
        for mine, all_of_them in zip(members, np.where(again, total, told).tolist(), strict=True):
            some = mine[edged[mine]]
            wanted[some] = np.sqrt(bent[some] / error_budget(bent[some], share * MISSED_PER_RTOL * rtol * all_of_them))
        # Where an edge was found by searching, no coarser lattice would find it again.
        closely = np.flatnonzero(edged & ((wanted > np.sqrt(patch / CORNER_ERROR)) | (least >= 0)))
        finer = np.full(count, -1, np.intp)
        finer[closely] = np.maximum(np.searchsorted(SPACINGS[:-1], wanted[closely]), least[closely])
        while points_of(finer[closely]).sum() > most_points and finer[closely].any():
            finer[closely] = np.maximum(finer[closely] - 1, 0)
        sampler.sample(np.flatnonzero(finer > sampler.lattice), finer)
    lattice = sampler.lattice.copy()
    sampled = lattice >= 0
    missed = np.minimum(cut, np.where(sampled, bent / np.array(SPACINGS)[lattice] ** 2, CORNER_ERROR * cut * edged))
    missed = np.maximum(missed, hidden)
    # What is narrower than a cell may be missed: where a ray got by an outline, smaller ones look for it.
    got_by = passed if shadowing is None else shadowing > 0
    whole = got_by & sampled & ((fraction == 0) | (fraction == 1))
    narrow = np.flatnonzero(whole & (lattice < len(SPACINGS) - 1) & (np.array(SPACINGS)[lattice] < wanted**2))
    sampler.sample(narrow[np.cumsum(points_of(lattice[narrow] + 1)) < most_points], lattice + 1)
    # An edge falls on facets along a chord of each; where that is short, it passes others between two rays.
    shadowed_surfaces = np.flatnonzero(passed & ~mixed & (fraction > 0) & (fraction < 1))
    others = np.maximum(ray_spacing / np.maximum(_CHORD * wide[shadowed_surfaces], 1e-12) - 1.0, 0.0)
    missed[shadowed_surfaces] = np.hypot(
        missed[shadowed_surfaces], _UNSAMPLED_EDGE_RETURN * cut[shadowed_surfaces] * np.sqrt(others)
    )
    if places is not None:
        sent += sampler.sample_sides(np.flatnonzero(passed & (lattice >= 0) & (fraction == 1)), places, occluded)
    owner, pieces, occluder, rays_sent = sampler.collect(reach, np.pi / wavenumber)
    return SampledVisibility(fraction, owner, pieces, occluder, missed, most * fraction, sent + rays_sent)


class CornerVisibility:
    """Guiding rays: one to each place where corners of facets meet, and where these show the viewpoint different sides,
    one for each.

    `corners` (facet, 3, 3) [m] and `facet` (facet,) are those of :func:`sample_visibility`, `places` (facet, 3) those
    of
    :func:`shared_vertices`.
    """

    def __init__(
        self, viewpoint: FloatArray, corners: FloatArray, facet: IntArray | NDArray[np.int64], places: IntArray
    ) -> None:
        self._viewpoint, self._corners, self._facet = viewpoint, corners, facet
        self.places = places
        self._side = 2 * places + _shown_sides(corners, viewpoint)[:, None]
        # The corner that stands for all that meet in a place; the last one of them.
        self._one = np.full(int(self._side.max(initial=-1)) + 1, -1, np.intp)
        self._one[self._side.ravel()] = np.arange(self._side.size)

    def visible(
        self, rays: OccluderTest, some: NDArray[np.intp] | None = None, moving: bool = False
    ) -> tuple[NDArray[np.bool_], int]:
        """(facet, 3) whether corners are seen, those of `some` facets, and the number of rays; `moving`, where nothing
        but moving objects hides."""
        side = self._side if some is None else self._side[some]
        light = np.zeros(len(self._one), np.bool_)
        light[side.ravel()] = True
        there = np.flatnonzero(light)
        owner, corner = np.divmod(self._one[there], 3)
        targets = rays.targets(self._viewpoint, np.take(self._corners, owner, axis=0), self._facet[owner], moving)
        light[there] = targets.visible(np.arange(len(there)), inset_points(np.eye(3), EDGE_INSET)[corner])
        return light[side], len(there)


def error_budget(errors: FloatArray, total: float) -> float:
    """What each of the `errors` may be, so that the root of the sum of their squares is `total`: above zero."""
    ordered = np.sort(errors) ** 2
    below = np.cumsum(ordered) - ordered
    rest = np.arange(len(ordered), 0, -1)
    enough = np.flatnonzero(below + rest * ordered > total**2)
    if not len(enough):
        return np.inf
    k = enough[0]
    return max(float(np.sqrt((total**2 - below[k]) / rest[k])), 1e-300)


def _shown_sides(corners: FloatArray, viewpoint: FloatArray) -> IntArray:
    """(facet,) which side facets with these `corners` (facet, 3, 3) [m] show the viewpoint, 0 or 1."""
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
    """The kernel of :func:`_shown_sides`."""
    dr, types = drjit_types()
    a, b, c = corners_of(given)
    eye = types.Array3f64(*(dr.gather(types.Float64, given["viewpoint"], types.UInt32(k)) for k in range(3)))
    away = dr.select(dr.dot(a - eye, dr.cross(b - a, c - a)) < 0, types.UInt32(1), types.UInt32(0))
    dr.scatter(given["found"], away, given["lanes"], mode=dr.ReduceMode.Permute)
    dr.eval(given["found"])


_TURN_AWAY = FrozenKernel(_turn_away)


_CLIP_BATCH = 300_000
"""Points that are looked at together."""


class ClippedFacets(NamedTuple):
    """What is seen of facets that rims cut."""

    share: FloatArray
    """(facet,) of its area."""
    owner: NDArray[np.intp]
    """(piece,) facet that each is of, ascending; those that matter little are not cut."""
    pieces: FloatArray
    """(piece, corner, 3) barycentric coordinates of its corners."""
    missed: float
    """Estimated error of what they return, relative to `level`."""


def clip_by_silhouettes(
    sampler: Callable[[NDArray[np.intp]], VisibilitySampler],
    cut: FloatArray,
    width: FloatArray,
    share: FloatArray,
    level: float,
    rtol: float,
) -> ClippedFacets:
    """Look at facets on lattices, the finer the more may be missed, as
    :func:`rfgen_sionna.tracing.shadows.adaptive_sampling.sampled_fraction` does where shadows fall.

    Parameters
    ----------
    look
        What tells which points are seen of the facets that it is given the numbers of.
    cut, width
        (facet,) what each may return where a straight edge cuts it, and the phase between its ends, there and back
        [rad], as of :func:`rfgen_sionna.tracing.shadows.return_bounds.returns_at_most`.
    share
        (facet,) of each that guiding rays tell of.
    level
        What all facets return without interfering, in units of `cut`.
    rtol
        Allowed error of the return of all together.
    """
    bent, share = CURVED_EDGE_ERROR * cut, share.copy()
    wanted = np.sqrt(bent / error_budget(bent, MISSED_PER_RTOL * rtol * level))
    cells = np.searchsorted(SPACINGS[:-1], wanted)
    sampled = wanted > np.sqrt(CURVED_EDGE_ERROR / CORNER_ERROR)
    missed = np.where(sampled, bent / np.array(SPACINGS)[cells] ** 2, CORNER_ERROR * cut * ((share > 0) & (share < 1)))
    some = np.flatnonzero(sampled)
    owners, pieces = [np.zeros(0, np.intp)], [np.zeros((0, 3, 3))]
    batch = np.cumsum(points_of(cells[some])) // _CLIP_BATCH
    for own in np.split(some, np.flatnonzero(np.diff(batch)) + 1):
        unoccluded = find_visible_polygons(sampler(own), cells[own], width[own])
        share[own] = unoccluded.fraction
        missed[np.setdiff1d(own, own[unoccluded.owner])] = 0.0  # no rim is on it
        order = np.argsort(unoccluded.owner, kind="stable")
        owners.append(own[unoccluded.owner[order]])
        pieces.append(unoccluded.pieces[order])
    error = float(np.linalg.norm(missed)) / level if level > 0 else 0.0
    return ClippedFacets(share, np.concatenate(owners), np.concatenate(pieces), error)
