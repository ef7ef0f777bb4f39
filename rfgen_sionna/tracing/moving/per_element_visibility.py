"""Visibility of moving facets from single elements.

Shadows are sampled from the phase centre; the shadow-boundary correction
(:mod:`rfgen_sionna.tracing.shadows.boundary_edges`) accounts for the element pairs to first order. That does not
suffice where a surface returns little except at the corners of its shadow, where a boundary falls far from that of the
phase centre, or where the phase centre sees none. There each pair is sampled itself: at points visible from both
elements.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from itertools import chain

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import FloatArray, IntArray
from rfgen_sionna.scene.mesh import lengths, unit
from rfgen_sionna.scene.point_visibility import PointVisibility
from rfgen_sionna.scene.rays import RayScene
from rfgen_sionna.tracing.moving.visible_facets import PerElementSamples, PerElementVisibility, VisibleFacets
from rfgen_sionna.tracing.shadows.adaptive_sampling import CornerVisibility, sample_visibility
from rfgen_sionna.tracing.shadows.silhouettes import (
    RAY_CLEARANCE,
    STATIC_RAY_SPACING,
    FacetLocator,
    MeshSilhouette,
    SilhouetteRays,
)
from rfgen_sionna.tracing.surface.facets import Facets
from rfgen_sionna.tracing.surface.surfaces import Surfaces, tolerance_groups

MAX_REPRESENTATIVE_PAIRS = 12
"""Largest number of pairs that decide for all others."""
MAX_LANES = 60_000
"""Facets times pairs per batch, which bounds the memory."""
_LATERAL_CLEARANCE = 1.5 * RAY_CLEARANCE
"""Height of a silhouette over a facet's plane, over its distance, from which it casts a shadow: silhouette rays clear
the facet's own body by less."""
MAX_FINER = 30.0
"""Largest factor on the accuracy of shadow boundaries where facets cancel one another."""


class _ElementOccluders:
    """Occluders between points and the positions `ends` (set, position, 3) [m]; facet numbers are those of the ray
    scene plus its number of facets times the set."""

    def __init__(self, rays: RayScene, ends: FloatArray) -> None:
        self._rays, self._ends = rays, ends

    def targets(
        self,
        viewpoint: FloatArray,
        corners: FloatArray,
        facets: NDArray[np.int64],
        moving: bool = False,
        bundled: bool = False,
    ) -> PointVisibility:
        """Points to be seen from all positions of a set; the viewpoint is not used."""
        of, own = np.divmod(facets, self._rays.num_facets)
        return self._rays.targets(self._ends[of], corners, own, moving, bundled)


class PerElementSampler:
    """Samples facets from pairs of the elements at `tx` and `rx` (element, 3) [m], for a phase centre `viewpoint` (3,)
    [m], the `wavenumber` at the highest frequency [rad/m] and a tolerance `rtol` of a tolerance group."""

    def __init__(
        self, surfaces: Surfaces, tx: FloatArray, rx: FloatArray, viewpoint: FloatArray, wavenumber: float, rtol: float
    ) -> None:
        self._surfaces = surfaces
        self._silhouettes, self._tolerance_group = (
            [MeshSilhouette(each.faces) for each in surfaces.moving],
            tolerance_groups(surfaces.moving),
        )
        self._curved = np.array([each.smooth is not None for each in surfaces.moving], np.bool_)
        self._tx, self._rx, self._viewpoint = tx, rx, viewpoint
        self._wavenumber, self._rtol = wavenumber, rtol
        self._static: dict[tuple[int, int], tuple[FloatArray, FloatArray]] = {}  # by element and surface

    @property
    def pairs(self) -> NDArray[np.intp]:
        """Indices of all pairs."""
        return np.arange(len(self._tx) * len(self._rx))

    @cached_property
    def _outermost(self) -> NDArray[np.intp]:
        """Elements of the representative pairs, all Tx first."""
        tx, rx = np.divmod(self.representative(), len(self._rx))
        return np.unique(np.concatenate([tx, len(self._tx) + rx]))

    def representative(self) -> NDArray[np.intp]:
        """Pairs with the most different visibility: each is the one furthest from those before."""
        tx, rx = (each - self._viewpoint for each in (self._tx, self._rx))
        both = np.concatenate([np.repeat(tx, len(rx), axis=0), np.tile(rx, (len(tx), 1))], axis=1)
        found, distance = list[int](), np.linalg.norm(both, axis=1)
        for _ in range(min(len(both), MAX_REPRESENTATIVE_PAIRS)):
            found.append(int(np.argmax(distance)))
            distance = np.minimum(distance, np.linalg.norm(both - both[found[-1]], axis=1))
            distance[found] = -1.0
        return np.sort(np.array(found))

    def shadowed_surfaces(
        self, silhouette_rays: SilhouetteRays, visible: VisibleFacets, surfaces: NDArray[np.bool_]
    ) -> NDArray[np.bool_]:
        """(surface,) whether a shadow boundary falls on each of the `surfaces` (surface,) for an outermost element, by
        `silhouette_rays` past other bodies from the phase centre; `visible` is the visibility from there."""
        found, facets = np.zeros(len(surfaces), np.bool_), visible.facets
        elements = np.concatenate([self._tx, self._rx])[self._outermost]
        chosen = np.flatnonzero((visible.weight > 0) & surfaces[facets.surface])
        corners = np.take(facets.corners, chosen, axis=0) - self._viewpoint
        edges, away = silhouette_rays.directions, lengths(silhouette_rays.directions)
        reach = float(lengths(elements - self._viewpoint).max(initial=0.0))
        for surface in np.unique(facets.surface[chosen]).tolist():
            own = corners[facets.surface[chosen] == surface]
            # Cone around the surface, widened by the shift of a boundary between elements.
            ways = unit(own.reshape(-1, 3))
            axis = unit(ways.mean(axis=0))
            opening = (
                np.arccos(np.clip((ways @ axis).min(), -1.0, 1.0)) + (reach + 0.5 * silhouette_rays.span * away) / away
            )
            in_cone = np.arccos(np.clip(edges @ axis / away, -1.0, 1.0)) < opening
            others = True if silhouette_rays.owner is None else silhouette_rays.owner != surface
            near = np.flatnonzero(in_cone & others & (away < lengths(own.reshape(-1, 3)).max()))
            for some in np.array_split(near, -(-len(near) * len(own) // MAX_LANES)) if len(near) else ():
                if any(
                    _shadow_reaches(edges[some], silhouette_rays.span[some], own, end - self._viewpoint)
                    for end in elements
                ):
                    found[surface] = True
                    break
        return found

    def visibility(
        self,
        rays: RayScene,
        vertices: Sequence[FloatArray],
        visible: VisibleFacets,
        places: IntArray,
        surfaces: NDArray[np.bool_],
        cancellation: FloatArray,
        pairs: NDArray[np.intp],
        level: FloatArray,
    ) -> PerElementSamples:
        """Visibility of some `surfaces` (surface,) from the `pairs`, where that of the phase centre is `visible`.

        `rays` is the ray scene at the time, with the `vertices` (vertex, 3) [m] of all moving surfaces; `places`
        (facet, 3) are those of :func:`rfgen_sionna.tracing.shadows.adaptive_sampling.shared_vertices`. Flat surfaces,
        which may cancel completely, are sampled more finely by their `cancellation` (surface,). `level` (surface,) is
        the reference of errors, as :attr:`VisibleFacets.level` at best visibility.
        """
        facets, ends = visible.facets, np.stack([pairs // len(self._rx), len(self._tx) + pairs % len(self._rx)])
        sampled_facets = (visible.weight > 0) & surfaces[facets.surface]
        if facets.outward is not None:  # beyond the terminator
            sampled_facets &= ~facets.outward
        chosen = np.flatnonzero(sampled_facets)
        if not len(chosen):
            return PerElementSamples(PerElementVisibility.none(), np.zeros(len(surfaces)), level, 0)
        light, silhouette, sent = self._guided(rays, vertices, facets, places, chosen, ends)
        silhouette = np.maximum(silhouette, visible.silhouette[chosen])
        # No boundary where all elements and the phase centre see all or nothing.
        alike = (light == light[:1, :, :1]).all(axis=(0, 2)) & (light[0, :, 0] == visible.fraction[chosen])
        edged = ~alike | np.isin(chosen, visible.owner) | (silhouette > 0).any(axis=0)
        # A boundary between corners may cross adjacent facets.
        edged = np.isin(places[chosen], places[chosen[edged]]).any(axis=1)
        of_groups = np.zeros(len(surfaces))
        of_groups[self._tolerance_group] = level
        views, energy, curved = (
            [PerElementVisibility.none()],
            np.zeros(len(surfaces)),
            self._curved[facets.surface[chosen]],
        )
        finer = float(np.clip(cancellation[surfaces & ~self._curved].max(initial=1.0), 1.0, MAX_FINER))
        for closely, kind in ((True, ~curved), (False, curved)):
            some, missed = np.flatnonzero(edged & kind), np.zeros(len(surfaces))
            batches = min(-(-len(some) * len(pairs) // MAX_LANES), len(pairs))
            for batch in np.array_split(np.arange(len(pairs)), batches) if batches else ():
                given = rays, visible, chosen[some], pairs[batch], ends[:, batch], light[:, some], silhouette[:, some]
                view, error, more = self._sampled(*given, of_groups, self._rtol / (finer if closely else 1.0), closely)
                views.append(view)
                missed, sent = np.maximum(missed, error), sent + more  # of the worst pair
            energy += missed**2
        missed = np.sqrt(energy)
        return PerElementSamples(
            PerElementVisibility.joined(views, [0] * len(views)), missed[self._tolerance_group], level, sent
        )

    def _sampled(
        self,
        rays: RayScene,
        visible: VisibleFacets,
        chosen: NDArray[np.intp],
        pairs: NDArray[np.intp],
        ends: NDArray[np.intp],
        light: NDArray[np.bool_],
        silhouette: FloatArray,
        level: FloatArray,
        rtol: float,
        search: bool,
    ) -> tuple[PerElementVisibility, FloatArray, int]:
        """Visibility of the `chosen` facets from the `pairs` (pair,) with elements `ends` (2, pair), the error of each
        tolerance group relative to its `level` (group,), and the number of rays; further arguments as of
        :meth:`_guided`."""
        facets, groups_of_all, elements = visible.facets, len(level), np.concatenate([self._tx, self._rx])
        of, facet = np.repeat(np.arange(len(pairs)), len(chosen)), np.tile(chosen, len(pairs))
        group = self._tolerance_group[facets.surface[facet]] + groups_of_all * of
        own = sample_visibility(
            _ElementOccluders(rays, np.moveaxis(elements[ends], 0, 1)), self._viewpoint,
            np.take(facets.corners, facet, axis=0), facets.number[facet] + np.int64(rays.num_facets) * of,
            (light[ends[0]] & light[ends[1]]).reshape(-1, 3), self._wavenumber, rtol,
            np.maximum(silhouette[ends[0]], silhouette[ends[1]]).ravel(), visible.weight[facet], group,
            level=np.tile(level, len(pairs)), search=search, times=len(pairs),
        )  # fmt: skip
        changed = np.flatnonzero((own.fraction != visible.fraction[facet]) | ((own.fraction > 0) & (own.fraction < 1)))
        lane = np.full(len(facet), -1, np.intp)
        lane[changed] = np.arange(len(changed))
        mine = lane[own.owner] >= 0
        view = PerElementVisibility(
            facet[changed], pairs[of[changed]], own.fraction[changed], lane[own.owner[mine]], own.pieces[mine]
        )
        energy = np.bincount(group, own.missed**2, len(pairs) * groups_of_all).reshape(len(pairs), -1)
        error = np.sqrt(energy.max(axis=0, initial=0.0))
        return view, error / np.where(level > 0, level, np.inf), own.rays

    def _guided(
        self,
        rays: RayScene,
        vertices: Sequence[FloatArray],
        facets: Facets,
        places: IntArray,
        chosen: NDArray[np.intp],
        ends: NDArray[np.intp],
    ) -> tuple[NDArray[np.bool_], FloatArray, int]:
        """(element, chosen, 3) whether elements, all Tx first, see the corners of the `chosen` facets; (element,
        chosen) length of silhouettes on these [rad], of the elements `ends` (2, pair); and the number of rays."""
        elements, used = np.concatenate([self._tx, self._rx]), np.unique(ends)
        corners, number = np.take(facets.corners, chosen, axis=0), facets.number[chosen]
        light = np.zeros((len(elements), len(chosen), 3), np.bool_)
        silhouette = np.zeros((len(elements), len(chosen)))
        # In large batches: a kernel launch costs as much as ten thousand rays.
        step = max(1, MAX_LANES // max(len(chosen), 1))
        sent = 0
        for some in np.split(used, np.arange(step, len(used), step)):
            ends_of, each = elements[some], np.arange(len(some))[:, None]
            own = (number + rays.num_facets * each).ravel()
            there = np.tile(corners, (len(some), 1, 1))
            met = (places[chosen] + (int(places.max(initial=-1)) + 1) * each[..., None]).reshape(-1, 3)
            visible, guides = CornerVisibility(self._viewpoint, there, own, met).visible(
                _ElementOccluders(rays, ends_of[:, None])
            )
            light[some] = visible.reshape(len(some), -1, 3)
            past = [
                [one.silhouette_rays(points - end) for one, points in zip(self._silhouettes, vertices, strict=True)]
                + [self._rays_past_static(element, corners.reshape(-1, 3) - end)]
                for element, end in zip(some.tolist(), ends_of, strict=True)
            ]
            count = [sum(len(span) for _, span in of_one) for of_one in past]
            directions, span = (np.concatenate(columns) for columns in zip(*chain(*past), strict=True))
            of = np.repeat(np.arange(len(some)), count)
            hit = rays.first_facet(ends_of[of], directions)
            fallen = SilhouetteRays(directions, np.where(hit < 0, -1, hit + rays.num_facets * of), span)
            from_there = there - np.repeat(ends_of, len(chosen), axis=0)[:, None]
            silhouette[some] = FacetLocator(from_there, own).silhouette_lengths(fallen)[0].reshape(len(some), -1)
            sent += guides + len(span)
        light[np.setdiff1d(np.arange(len(elements)), used)] = light[used[:1]]
        return light, silhouette, sent

    def _rays_past_static(self, element: int, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Silhouette rays past static surfaces from an element, all Tx first, in the cone of `points` (point, 3) [m]
        relative to it, and their spans."""
        end, far = np.concatenate([self._tx, self._rx])[element], lengths(points)
        ways = points / np.maximum(far, 1e-12)[:, None]
        axis = unit(ways.mean(axis=0))
        opening, furthest = float((ways @ axis).min()) - 1e-3, float(far.max())
        rays, spans = [np.zeros((0, 3))], [np.zeros(0)]
        for number, (low, high) in enumerate(self._boxes):
            if np.linalg.norm(np.clip(end, low, high) - end) >= furthest:
                continue
            if (element, number) not in self._static:
                there = self._surfaces.static_vertices[number] - end
                self._static[element, number] = self._static_silhouettes[number].silhouette_rays(
                    there, STATIC_RAY_SPACING
                )
            past, span = self._static[element, number]
            away = lengths(past)
            before = (past @ axis > opening * away) & (away < furthest)
            rays.append(past[before])
            spans.append(span[before])
        return np.concatenate(rays), np.concatenate(spans)

    @cached_property
    def _static_silhouettes(self) -> list[MeshSilhouette]:
        return [MeshSilhouette(each.faces) for each in self._surfaces.static]

    @cached_property
    def _boxes(self) -> list[tuple[FloatArray, FloatArray]]:
        """Least and largest coordinates [m] of each static surface."""
        return [(each.min(axis=0), each.max(axis=0)) for each in self._surfaces.static_vertices]


def _shadow_reaches(edges: FloatArray, span: FloatArray, corners: FloatArray, element: FloatArray) -> bool:
    """Whether the shadow of a silhouette with points `edges` (point, 3) [m] of length `span` (point,) [rad] falls on a
    facet with `corners` (facet, 3, 3) [m], for an `element` (3,) [m]; all relative to one viewpoint."""
    a, b, c = np.moveaxis(corners - element, 1, 0)
    normal = np.cross(b - a, c - a)
    ways = edges - element
    along, height = ways @ normal.T, np.einsum("fi,fi->f", a, normal)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = height / along  # (point, facet) distance of the facet's plane over that of the silhouette
    area = lengths(normal)
    before = (
        (ratio > 1.0)
        & np.isfinite(ratio)
        & (np.abs(height - along) > _LATERAL_CLEARANCE * lengths(ways)[:, None] * area)
    )
    if not before.any():
        return False
    point, facet = np.nonzero(before)
    there = ratio[point, facet][:, None] * ways[point] - a[facet]
    area, across = area[facet], normal[facet]
    # Inside all three sides, with the span of a silhouette point as slack.
    slack = 0.5 * span[point] * ratio[point, facet] * lengths(ways)[point]
    slack *= area * lengths(ways)[point] / np.maximum(np.abs(along[point, facet]), 1e-300)  # oblique incidence
    inside = np.ones(len(point), np.bool_)
    for first, second in ((a, b), (b, c), (c, a)):
        start, side = (first - a)[facet], (second - first)[facet]
        out = np.einsum("pi,pi->p", np.cross(side, there - start), across) / area
        inside &= out >= -slack * lengths(side)
    return bool(inside.any())
