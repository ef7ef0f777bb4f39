"""Paths of all routes over an interval, at the knots of the direct trace."""

from __future__ import annotations

import copy
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import SPEED_OF_LIGHT, ComplexArray, FloatArray, IntArray
from rfgen_sionna.records import PathKind, RadarPaths, knot_weights
from rfgen_sionna.tracing.direct.expansion_choice import choose_expansion, first_pair, node_table
from rfgen_sionna.tracing.direct.return_bounds import bound_returns, significant
from rfgen_sionna.tracing.direct.run_plan import EXPANSION_SHARE, RunPlan
from rfgen_sionna.tracing.direct.samples import GainNodes, Sample, integrate, pair_delays
from rfgen_sionna.tracing.gains.expansion import Expansion
from rfgen_sionna.tracing.integral.fresnel import media_table
from rfgen_sionna.tracing.integral.leg_fields import MAX_MIRRORS, LegTables
from rfgen_sionna.tracing.integral.obliquity import Media
from rfgen_sionna.tracing.routes.image_tree import (
    OMITTED_SHARE,
    LegKey,
    ReturnBounds,
    RouteKey,
    leg_of,
    significant_routes,
)
from rfgen_sionna.tracing.routes.leg_visibility import Crossings, Occluders, see_along
from rfgen_sionna.tracing.routes.legs import Leg
from rfgen_sionna.tracing.routes.reflectors import Plate, Reflectors
from rfgen_sionna.tracing.surface.facets import RATE_STEP
from rfgen_sionna.tracing.surface.surfaces import Surfaces

FEW_ROUTES = 8
"""Number of routes from which bounds of all facets select some before their visibility is known."""
CHECKED_FACETS, CHECKED_ROUTES = 300, 12
"""Strongest facets of the strongest routes that decide on an expansion."""


@dataclass(frozen=True, eq=False)
class Route:
    """Facets by one leg out and one back over the knots."""

    out: tuple[Leg, ...]
    """Of each knot."""
    back: tuple[Leg, ...]
    facets: NDArray[np.intp]
    """(path,)"""
    visible: FloatArray
    """(knot, path) visible share times the weight of the roles."""
    bound: FloatArray
    """(path,) bound of the return."""
    crossed: tuple[tuple[Crossings, Crossings], ...] = ()
    """Slabs on both legs at each knot; empty without transmission."""

    @property
    def bounces(self) -> int:
        """Number of surfaces on a path."""
        return 1 + len(self.out[0].mirrors) + len(self.back[0].mirrors)

    def take(self, index: NDArray[np.intp]) -> Route:
        """Some of its facets."""
        crossed = tuple((out.take(index), back.take(index)) for out, back in self.crossed)
        return Route(self.out, self.back, self.facets[index], self.visible[:, index], self.bound[index], crossed)


@dataclass(frozen=True, eq=False)
class RouteReturns:
    """Integrated routes."""

    route: Route
    values: ComplexArray
    """(node, path, knot)"""
    gains: ComplexArray
    """(path, knot) of the first pair in the middle of the band, with antennas."""
    delays: FloatArray
    """(tx, rx, path, knot) [s]"""

    @property
    def facets(self) -> NDArray[np.intp]:
        """(path,)"""
        return self.route.facets


class RouteTracer:
    """Traces the routes of moving surfaces, which have the positions `plan_positions` (vertex, 3) [m], by mirrors among all
    `surfaces`; facets at rest occlude. `max_bounces` is at most 3; `through_slabs` adds direct legs through slabs."""

    def __init__(self, surfaces: Surfaces, plan_positions: Sequence[FloatArray], viewpoint: FloatArray, wavelength: float,
                 max_bounces: int, through_slabs: bool = False) -> None:  # fmt: skip
        self._through_slabs = through_slabs
        self._surfaces, self._viewpoint, self._max_bounces = surfaces, viewpoint, max_bounces
        self._static = [np.asarray(each) - viewpoint for each in surfaces.static_vertices]
        every = [*surfaces.static_vertices, *plan_positions]
        self.reflectors = Reflectors.of(surfaces.static, surfaces.moving, every, wavelength)
        self._expansion: Expansion | None = None
        self._tables: dict[bytes, FloatArray] = {}

    @cached_property
    def _occluders(self) -> FloatArray:
        """(facet, 3, 3) corners [m] of all faces at rest, relative to the viewpoint."""
        found = [points[each.faces] for points, each in zip(self._static, self._surfaces.static, strict=True)]
        return np.concatenate([np.zeros((0, 3, 3)), *found])

    @cached_property
    def _whole(self) -> Occluders:
        """All surfaces, of which none transmits."""
        return Occluders(self._occluders)

    def trace(
        self, plan: RunPlan, times: FloatArray, samples: Sequence[Sample], level: FloatArray
    ) -> list[RouteReturns]:
        """Returns at `times` [s] by all routes that matter, from the `samples` at these; `level` (group,) is that of the
        direct returns."""
        found = self._routes(plan, times, samples)
        if not found:
            return []
        if self._expansion is None:
            self._expansion = self._chosen_expansion(plan, samples[len(samples) // 2], len(samples) // 2, found, level)
        table = node_table(self._expansion.nodes)
        tx, rx = (np.ascontiguousarray(each - plan.scene.band.viewpoint) for each in plan.scene.band.elements)
        returns = []
        for route in found:
            values, delays = [], np.empty((len(tx), len(rx), len(route.facets), len(samples)))
            for k, sample in enumerate(samples):
                own, centroids = self._integrated(plan, sample, k, route, table)
                values.append(own)
                part = np.empty((*delays.shape[:3], 1))
                pair_delays(centroids[None], route.out[k].image(tx), route.back[k].image(rx), part)
                delays[..., k] = part[..., 0]
                if route.crossed and plan.scene.slabs is not None:
                    ends = (route.out[k].image(tx), route.back[k].image(rx))
                    there, here = (
                        plan.scene.slabs.delays(crossed, images, centroids)
                        for crossed, images in zip(route.crossed[k], ends, strict=True)
                    )
                    delays[..., k] += there[:, None] + here
            joined = np.stack(values, axis=-1)
            middle = len(samples) // 2
            centroids = plan.mesh.centroids(samples[middle].points, route.facets)
            pattern = self._pattern(plan, route, middle, centroids)
            returns.append(RouteReturns(route, joined, first_pair(self._expansion, joined) * pattern[:, None], delays))
        return returns

    def paths(
        self, plan: RunPlan, times: FloatArray, samples: Sequence[Sample], returns: RouteReturns,
        names: tuple[tuple[str, ...], tuple[str, ...]],
    ) -> RadarPaths:  # fmt: skip
        """Paths of one route."""
        scene, mesh, route = plan.scene, plan.mesh, returns.route
        band, facets = scene.band, route.facets
        assert self._expansion is not None
        gains = band.combined(self._expansion, returns.values)
        ends = []
        for legs in (route.out, route.back):
            towards = [leg.departures(mesh.centroids(each.points, facets)) for leg, each in zip(legs, samples, strict=True)]
            ends.append(np.ascontiguousarray(np.stack(towards, axis=1)))
        rate = returns.delays @ knot_weights(times, times, 1).T if len(times) > 1 else self._rate(plan, float(times[0]), route)
        surface = mesh.facet_surface[facets]
        several = len(gains) > 1
        return RadarPaths(
            a=gains[0],
            tau=returns.delays,
            tau_rate=rate,
            times=times,
            frequency=band.centre,
            direction=ends[0],
            arrival=ends[1],
            object_id=np.array([each.object_id for each in scene.surfaces], np.int32)[surface],
            part_id=mesh.part[facets],
            kind=np.full(len(facets), PathKind.MULTI_BOUNCE if route.bounces > 1 else PathKind.FACET, np.uint8),
            bounces=np.full(len(facets), route.bounces, np.uint8),
            object_names=names[0],
            part_names=names[1],
            facet=mesh.face_in_surface[facets],
            dispersion=gains[1:] if several else None,
            half_band=band.half_band if several else 0.0,
        )

    def _plates(self, plan: RunPlan, t: float) -> list[Plate | None]:
        moving = [each - self._viewpoint for each in plan.scene.positions(t)]
        found = self.reflectors.plates([*self._static, *moving])
        fixed = self._fixed
        return [fixed[k] if k in fixed else each for k, each in enumerate(found)]

    @cached_property
    def _fixed(self) -> dict[int, Plate | None]:
        """Plates at rest, the same objects at all times."""
        parts = self.reflectors.parts
        count = sum(self.reflectors.is_static(k) for k in range(len(parts)))
        own = Reflectors(parts[:count], self.reflectors.static, self.reflectors.owner).plates(self._static)
        return dict(enumerate(own))

    def _routes(self, plan: RunPlan, times: FloatArray, samples: Sequence[Sample]) -> list[Route]:
        """Routes that matter, in both directions, with the facets that matter."""
        scene, mesh = plan.scene, plan.mesh
        plates = [self._plates(plan, t) for t in times.tolist()]
        poses = sorted({0, len(times) // 2, len(times) - 1})
        bounds = self._bounds(plan)
        keys: set[RouteKey] = set()
        for k in poses:
            own = [samples[k].points[first:last] for first, last in self._vertex_ranges(plan)]
            keys |= significant_routes(plates[k], own, bounds, self._max_bounces, scene.max_range, scene.rtol, scene.group)
        keys = self._strong(plan, samples, poses, plates, keys, bounds)
        if self._through_slabs and plan.scene.slabs is not None:
            keys.add(((), ()))
        legs, shares = dict[LegKey, tuple[Leg, ...]](), dict[LegKey, FloatArray]()
        crossed: dict[LegKey, list[Crossings | None]] = {}
        points = [each.points for each in samples]
        for key in {leg for pair in keys for leg in pair}:
            if not key:
                legs[key], shares[key] = (Leg(()),) * len(times), np.stack([each.visible for each in samples])
                crossed[key] = [each.crossed for each in samples]
                continue
            known = [leg_of(key, each) for each in plates]
            anywhere = [leg_of(key, each, sided=False) for each in plates]
            if any(each is None for each in anywhere):
                continue
            legs[key] = tuple(each or other for each, other in zip(known, anywhere, strict=True) if other is not None)
            shares[key], crossed[key] = np.zeros((len(times), len(mesh))), [None] * len(times)
            if all(self.reflectors.is_static(part) for part in key):
                if known[0] is not None:
                    legs[key] = (known[0],) * len(times)
                    shares[key], found_crossed = self._fractions(plan, known[0], points)
                    crossed[key][: len(found_crossed)] = found_crossed
                continue
            for k, leg in enumerate(known):
                if leg is not None:
                    share, found_crossed = self._fractions(plan, leg, points[k : k + 1])
                    shares[key][k], crossed[key][k : k + len(found_crossed)] = share[0], found_crossed
        found = []
        for one, other in sorted(keys):
            if one in legs and other in legs:
                share = shares[one] if one == other else shares[one] * shares[other]
                if not one and not other:  # the rest is part of the direct returns
                    behind = [each.cover[:, 0] for each in crossed[one] if each is not None]
                    share = share * np.stack(behind)
                    crossed[one] = [None if each is None else each.behind() for each in crossed[one]]
                route = self._route(plan, samples, poses, (one, other), (legs[one], legs[other]), share, bounds)
                if len(route.facets) and plan.scene.slabs is not None:
                    known_crossed = zip(crossed[one], crossed[other], strict=True)
                    none = Crossings.none(len(mesh))
                    own = tuple(tuple((each or none).take(route.facets) for each in pair) for pair in known_crossed)
                    route = replace(route, crossed=own)
                if len(route.facets):
                    found.append((one != other, route))
        kept = self._significant(plan, samples, poses, [each for _, each in found], bounds)
        both = []
        for (differ, _), route in zip(found, kept, strict=True):
            if len(route.facets):
                both.append(route)
                if differ:
                    swapped = tuple((back, out) for out, back in route.crossed)
                    both.append(replace(route, out=route.back, back=route.out, crossed=swapped))
        return both

    def _strong(
        self, plan: RunPlan, samples: Sequence[Sample], poses: Sequence[int], plates: Sequence[Sequence[Plate | None]],
        keys: set[RouteKey], bounds: ReturnBounds,
    ) -> set[RouteKey]:  # fmt: skip
        """The routes of `keys` without the weakest, by bounds of all facets in their windows, visible or not."""
        if len(keys) < FEW_ROUTES or plan.settings.omitted <= 0 or not plan.cull:
            return keys
        scene, mesh = plan.scene, plan.mesh
        ordered, direct = sorted(keys), Leg(())
        energy = np.zeros((len(ordered), len(scene.group)))
        level = np.zeros(len(scene.group))
        for k in poses:
            sample = samples[k]
            centroids = mesh.centroids(sample.points, np.arange(len(mesh)))
            size = np.linalg.norm(sample.points[mesh.meshes.corners] - centroids[:, None], axis=2).max(axis=1)
            level = np.maximum(level, self._energies(plan, sample, np.arange(len(mesh)), sample.visible, direct, direct, bounds))
            legs: dict[LegKey, Leg | None] = {(): direct}
            reached: dict[LegKey, NDArray[np.bool_]] = {(): sample.visible > 0}
            for key in {leg for pair in ordered for leg in pair if leg}:
                leg = legs[key] = leg_of(key, plates[k])
                if leg is not None:
                    reached[key] = (centroids @ leg.planes[:, :3].T - leg.planes[:, 3] >= -size[:, None]).all(axis=1)
            for row, (one, other) in enumerate(ordered):
                out, back = legs[one], legs[other]
                if out is not None and back is not None:
                    some = np.flatnonzero(reached[one] & reached[other])
                    visible = self.reflectors.role_weights(self._owners(plan, some), one, other)
                    found = self._energies(plan, sample, some, visible, out, back, bounds)
                    energy[row] = np.maximum(energy[row], found * (1.0 if one == other else 4.0))
        share = (energy / np.maximum(np.maximum(level, energy.max(axis=0, initial=0.0)), 1e-300)).max(axis=1)
        order = np.argsort(share)
        weak = np.cumsum(np.sqrt(share[order])) <= OMITTED_SHARE * scene.rtol
        return {ordered[row] for row in order[~weak]}

    def _energies(
        self, plan: RunPlan, sample: Sample, facets: NDArray[np.intp], visible: FloatArray, out: Leg, back: Leg,
        bounds: ReturnBounds,
    ) -> FloatArray:  # fmt: skip
        """(group,) energy of the bounds of some `facets` of shares `visible` (facet,)."""
        scene, mesh, bound = plan.scene, plan.mesh, np.zeros(len(facets))
        centroids = mesh.centroids(sample.points, facets)
        gain = bounds.gain(out, centroids) * bounds.gain(back, centroids)
        bound_returns(
            sample.points, mesh.meshes.corners, mesh.faces, mesh.group, sample.normals, mesh.face_of, facets, visible, gain,
            scene.wavenumber, out.view, back.view, bound,
        )  # fmt: skip
        return np.bincount(scene.group[mesh.facet_surface[facets]], bound**2, len(scene.group))

    def _owners(self, plan: RunPlan, facets: NDArray[np.intp]) -> IntArray:
        """(facet,) planar part of some facets, -1 for none."""
        first = np.array([each.first_facet for each in plan.scene.surfaces])[plan.mesh.facet_surface[facets]]
        return np.asarray(self.reflectors.owner[first + plan.mesh.face_in_surface[facets]])

    def _fractions(
        self, plan: RunPlan, leg: Leg, points: Sequence[FloatArray]
    ) -> tuple[FloatArray, list[Crossings]]:
        occluders = self._whole if plan.scene.slabs is None else plan.scene.slabs.occluders
        return see_along(leg, plan.mesh.meshes, points, occluders, plan.settings.resolution, plan.mesh.corner_normals)

    def _vertex_ranges(self, plan: RunPlan) -> list[tuple[int, int]]:
        """First and last vertex of each surface, without those of pieces."""
        ranges = plan.mesh.meshes.vertex_range.tolist()
        return [(a, b - len(ends)) for (a, b), (ends, _) in zip(ranges, plan.mesh.sources, strict=True)]

    def _route(
        self, plan: RunPlan, samples: Sequence[Sample], poses: Sequence[int], key: RouteKey,
        legs: tuple[tuple[Leg, ...], tuple[Leg, ...]], share: FloatArray, bounds: ReturnBounds,
    ) -> Route:  # fmt: skip
        """Facets of one route, with the `share` (knot, facet) that both legs show."""
        scene, mesh = plan.scene, plan.mesh
        facets = np.flatnonzero(share.any(axis=0))
        visible = share[:, facets] * self.reflectors.role_weights(self._owners(plan, facets), *key)
        bound = np.zeros(len(facets))
        for k, sample in enumerate(samples):
            centroids = mesh.centroids(sample.points, facets)
            out, back = legs[0][k], legs[1][k]
            length = np.linalg.norm(centroids - out.view, axis=1) + np.linalg.norm(centroids - back.view, axis=1)
            visible[k, 0.5 * length >= scene.max_range] = 0.0
            if k in poses:
                gain = bounds.gain(out, centroids) * bounds.gain(back, centroids)
                bound_returns(
                    sample.points, mesh.meshes.corners, mesh.faces, mesh.group, sample.normals, mesh.face_of, facets,
                    visible[k], gain, scene.wavenumber, out.view, back.view, bound,
                )  # fmt: skip
        bound[visible.max(axis=0, initial=0.0) <= 0] = 0.0
        return Route(*legs, facets, visible, bound)

    def _significant(
        self, plan: RunPlan, samples: Sequence[Sample], poses: Sequence[int], routes: Sequence[Route], bounds: ReturnBounds
    ) -> list[Route]:
        """The `routes` with the facets that matter beside all others and the direct returns."""
        scene, mesh = plan.scene, plan.mesh
        direct = np.flatnonzero(np.max([each.visible for each in samples], axis=0))
        bound, leg = np.zeros(len(direct)), Leg(())
        for k in poses:
            gain = bounds.gain(leg, mesh.centroids(samples[k].points, direct)) ** 2
            bound_returns(
                samples[k].points, mesh.meshes.corners, mesh.faces, mesh.group, samples[k].normals, mesh.face_of, direct,
                samples[k].visible[direct], gain, scene.wavenumber, leg.view, leg.view, bound,
            )  # fmt: skip
        facets = np.concatenate([direct, *(each.facets for each in routes)])
        every = np.concatenate([bound, *(each.bound for each in routes)])
        omitted = plan.settings.omitted if plan.cull else 0.0
        chosen = np.zeros(len(every), np.bool_)
        chosen[significant(every, scene.group[mesh.facet_surface[facets]], len(scene.group), omitted)] = True
        found, first = [], len(direct)
        for each in routes:
            own = chosen[first : first + len(each.facets)]
            first += len(each.facets)
            found.append(each.take(np.flatnonzero(own)))
        return found

    def _bounds(self, plan: RunPlan) -> ReturnBounds:
        band = plan.scene.band
        frequency = band.frequency(np.array([-1.0, 0.0, 1.0]))
        surface = [part.surface for part in self.reflectors.parts]
        return ReturnBounds(band.pattern_gain, self._media(plan, frequency), 2 * np.pi * frequency / SPEED_OF_LIGHT, surface)

    def _media(self, plan: RunPlan, frequency: FloatArray) -> FloatArray:
        """(node, surface, 7) of all surfaces, static ones first."""
        key = frequency.tobytes()
        if key not in self._tables:
            materials = [each.material for each in (*self._surfaces.static, *self._surfaces.moving)]
            self._tables[key] = media_table(Media.at(materials, frequency, plan.scene.band.half_band))
        return self._tables[key]

    def _pattern(self, plan: RunPlan, route: Route, k: int, centroids: FloatArray) -> FloatArray:
        """(path,) two-way field gain at knot `k`."""
        gain = plan.scene.band.pattern_gain
        return np.sqrt(gain(route.out[k].departures(centroids)) * gain(route.back[k].departures(centroids)))

    def _integrated(
        self, plan: RunPlan, sample: Sample, k: int, route: Route, table: FloatArray, some: NDArray[np.intp] | slice = slice(None)
    ) -> tuple[ComplexArray, FloatArray]:
        """(node, path) gains at the nodes of a `table` (node, 7) and (path, 3) centroids [m]."""
        out, back = route.out[k], route.back[k]
        there = np.column_stack([out.image(table[:, :3]), back.image(table[:, 3:6]), table[:, 6]])
        media = self._media(plan, table[:, 6] * SPEED_OF_LIGHT / (2 * np.pi))
        fields = np.stack([leg.turned(own) for leg, own in zip((out, back), plan.scene.band.fields, strict=True)])
        own_media = np.ascontiguousarray(media[:, len(self._surfaces.static) :])
        nodes = GainNodes(np.ascontiguousarray(there), own_media, fields, True)
        facets = route.facets[some]
        legs = self._leg_tables(out, back, media)
        if route.crossed and plan.scene.slabs is not None:
            crossed = tuple(each if isinstance(some, slice) else each.take(some) for each in route.crossed[k])
            frequency = table[:, 6] * SPEED_OF_LIGHT / (2 * np.pi)
            legs = legs._replace(**plan.scene.slabs.leg_tables((crossed[0], crossed[1]), frequency))
        return integrate(
            plan.mesh, plan.material, sample, facets, nodes, plan.most_rise, np.zeros((0, 3)),
            np.ascontiguousarray(route.visible[k, some]), legs,
        )  # fmt: skip

    def _leg_tables(self, out: Leg, back: Leg, media: FloatArray) -> LegTables:
        normals, mirrors = np.zeros((2, MAX_MIRRORS, 3)), np.zeros((len(media), 2, MAX_MIRRORS, 7))
        for side, leg in enumerate((out, back)):
            for place, (mirror, normal) in enumerate(zip(leg.mirrors, leg.normals, strict=True)):
                normals[side, place] = normal
                mirrors[:, side, place] = media[:, self.reflectors.parts[mirror.part].surface]
        planes = [out.planes] if out is back else [out.planes, back.planes]
        return LegTables.direct()._replace(
            views=np.stack([out.view, back.view]), count=np.array([len(out.mirrors), len(back.mirrors)], np.int32),
            normals=normals, media=mirrors, planes=np.concatenate(planes),
        )  # fmt: skip

    def _rate(self, plan: RunPlan, t: float, route: Route) -> FloatArray:
        """(tx, rx, path, 1) rates of the delays [s/s] at a single time."""
        band, ends = plan.scene.band, []
        keys = [tuple(mirror.part for mirror in legs[0].mirrors) for legs in (route.out, route.back)]
        elements = [np.ascontiguousarray(each - band.viewpoint) for each in band.elements]
        for step in (-RATE_STEP, RATE_STEP):
            plates = self._plates(plan, t + step)
            legs = [leg_of(key, plates, sided=False) or now[0] for key, now in zip(keys, (route.out, route.back), strict=True)]
            points = plan.mesh.points(plan.scene.positions(t + step), band.viewpoint)
            found = np.empty((*(len(each) for each in elements), len(route.facets), 1))
            images = [leg.image(each) for leg, each in zip(legs, elements, strict=True)]
            pair_delays(plan.mesh.centroids(points, route.facets)[None], *images, found)
            ends.append(found)
        return np.asarray((ends[1] - ends[0]) / (2 * RATE_STEP))

    def _chosen_expansion(
        self, plan: RunPlan, sample: Sample, k: int, routes: Sequence[Route], level: FloatArray
    ) -> Expansion:
        expansions = copy.copy(plan.scene.band.expansions)
        expansions.powers = 1  # Tx and Rx are not reciprocal on one route
        strongest = sorted(routes, key=lambda each: -float(np.linalg.norm(each.bound)))[:CHECKED_ROUTES]
        check = _RouteCheck(self, plan, sample, k, strongest, level)
        return choose_expansion(expansions, [check], plan.scene.rtol, EXPANSION_SHARE * plan.scene.rtol)


class _RouteCheck:
    """Strongest facets of some `routes` at knot `k`, to test expansions."""

    def __init__(
        self, tracer: RouteTracer, plan: RunPlan, sample: Sample, k: int, routes: Sequence[Route], level: FloatArray
    ) -> None:
        self._tracer, self._plan, self._sample, self._k, self._routes = tracer, plan, sample, k, routes
        self._some = [np.sort(np.argsort(-each.bound)[:CHECKED_FACETS]) for each in routes]
        self._facets = [each.facets[some] for each, some in zip(routes, self._some, strict=True)]
        self.group = plan.scene.group[plan.mesh.facet_surface[np.concatenate(self._facets)]]
        self.least = level

    def values(self, table: FloatArray) -> ComplexArray:
        """(node, path) gains."""
        return np.concatenate([
            self._tracer._integrated(self._plan, self._sample, self._k, route, table, some)[0]
            for route, some in zip(self._routes, self._some, strict=True)
        ], axis=1)  # fmt: skip

    def waves(self, u: FloatArray, pairs: IntArray) -> ComplexArray:
        """(probe, path) phasors with pattern gain."""
        band, found = self._plan.scene.band, []
        tx, rx = (each - band.viewpoint for each in band.elements)
        one, other = np.divmod(pairs, len(rx))
        for route, facets in zip(self._routes, self._facets, strict=True):
            centroids = self._plan.mesh.centroids(self._sample.points, facets)
            ends = route.out[self._k].image(tx)[one], route.back[self._k].image(rx)[other]
            length = sum(np.linalg.norm(centroids - each[:, None], axis=2) for each in ends)
            cycles = band.frequency(u)[:, None] * length / SPEED_OF_LIGHT
            pattern = self._tracer._pattern(self._plan, route, self._k, centroids)
            found.append(np.exp(-2j * np.pi * (cycles - np.rint(cycles))) * pattern)
        return np.concatenate(found, axis=1)
