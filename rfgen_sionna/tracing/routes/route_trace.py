"""Paths of all routes over an interval, at the knots of the direct trace."""

from __future__ import annotations

import copy
from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import SPEED_OF_LIGHT, ComplexArray, FloatArray, IntArray
from rfgen_sionna.records import PathKind, RadarPaths, knot_weights
from rfgen_sionna.tracing.direct.expansion_choice import choose_expansion, first_pair, node_table
from rfgen_sionna.tracing.direct.planner import EXPANSION_SHARE
from rfgen_sionna.tracing.direct.samples import GainNodes, Sample, integrate, pair_delays
from rfgen_sionna.tracing.direct.trace_plan import TracePlan
from rfgen_sionna.tracing.gains.expansion import Expansion
from rfgen_sionna.tracing.integral.fresnel import media_table
from rfgen_sionna.tracing.integral.leg_fields import MAX_MIRRORS, LegTables
from rfgen_sionna.tracing.integral.obliquity import Media
from rfgen_sionna.tracing.legs.leg import Leg
from rfgen_sionna.tracing.legs.leg_visibility import Crossings, LegOccluders, see_along
from rfgen_sionna.tracing.routes.image_tree import LegKey, ReturnBounds, RouteKey, leg_of, significant_routes
from rfgen_sionna.tracing.routes.reflectors import Plate, Reflectors
from rfgen_sionna.tracing.routes.route import Route, RouteReturns
from rfgen_sionna.tracing.routes.route_bounds import raise_bounds, significant_facets, strong_routes
from rfgen_sionna.tracing.surface.facets import RATE_STEP
from rfgen_sionna.tracing.surface.surfaces import Surfaces

MAX_STILL_MIRRORS = 32
"""Most mirrors within a scene at rest, for time."""
CHECKED_FACETS, CHECKED_ROUTES = 300, 12
"""Strongest facets of the strongest routes that decide on an expansion."""


class RouteTracer:
    """Traces the routes of moving surfaces, which have the positions `plan_positions` (vertex, 3) [m], by mirrors among
    all `surfaces`; facets at rest occlude. `max_bounces` is at most 3; `through_slabs` adds direct legs through
    slabs."""

    def __init__(
        self, surfaces: Surfaces, plan_positions: Sequence[FloatArray], viewpoint: FloatArray, wavelength: float,
        max_bounces: int, through_slabs: bool = False,
    ) -> None:  # fmt: skip
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
    def _whole(self) -> LegOccluders:
        """All surfaces, of which none transmits."""
        return LegOccluders(self._occluders)

    def trace(
        self, plan: TracePlan, times: FloatArray, samples: Sequence[Sample], level: FloatArray
    ) -> list[RouteReturns]:
        """Returns at `times` [s] by all routes that matter, from the `samples` at these; `level` (group,) is that of
        the direct returns."""
        found = self._routes(plan, times, samples)
        if not found:
            return []
        middle = len(samples) // 2
        expansion = self._expansion or self._chosen_expansion(plan, samples[middle], middle, found, level)
        table = node_table(expansion.nodes)
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
            centroids = plan.mesh.centroids(samples[middle].points, route.facets)
            pattern = self._pattern(plan, route, middle, centroids)
            own_gains = first_pair(expansion, joined) * pattern[:, None]
            returns.append(RouteReturns(route, expansion, joined, own_gains, delays))
        return returns

    def choose_expansion(self, plan: TracePlan, times: Sequence[float]) -> None:
        """Take the largest of the expansions that the routes at some `times` [s] need for all; without routes then,
        each interval has its own."""
        known = []
        for t in times:
            sample = plan.sample([t])
            if found := self._routes(plan, np.array([t]), sample):
                known.append(self._chosen_expansion(plan, sample[0], 0, found, plan.level))
        self._expansion = max(known, key=lambda each: len(each.nodes.frequency), default=None)

    def paths(
        self, plan: TracePlan, times: FloatArray, samples: Sequence[Sample], returns: RouteReturns,
        names: tuple[tuple[str, ...], tuple[str, ...]],
    ) -> RadarPaths:  # fmt: skip
        """Paths of one route."""
        scene, mesh, route = plan.scene, plan.mesh, returns.route
        band, facets = scene.band, route.facets
        gains = band.combined(returns.expansion, returns.values)
        ends = []
        for legs in (route.out, route.back):
            towards = [
                leg.departures(mesh.centroids(each.points, facets)) for leg, each in zip(legs, samples, strict=True)
            ]
            ends.append(np.ascontiguousarray(np.stack(towards, axis=1)))
        rate = (
            returns.delays @ knot_weights(times, times, 1).T
            if len(times) > 1
            else self._rate(plan, float(times[0]), route)
        )
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

    def _plates(self, plan: TracePlan, t: float) -> list[Plate | None]:
        moving = [each - self._viewpoint for each in plan.scene.positions(t)]
        found = self.reflectors.plates([*self._static, *moving])
        fixed = self._fixed
        return [fixed.get(k, each) for k, each in enumerate(found)]

    @cached_property
    def _fixed(self) -> dict[int, Plate | None]:
        """Plates at rest, the same objects at all times."""
        parts = self.reflectors.parts
        count = sum(self.reflectors.is_static(k) for k in range(len(parts)))
        own = Reflectors(parts[:count], self.reflectors.static, self.reflectors.owner).plates(self._static)
        return dict(enumerate(own))

    def _routes(self, plan: TracePlan, times: FloatArray, samples: Sequence[Sample]) -> list[Route]:
        """Routes that matter, in both directions, with the facets that matter."""
        scene, mesh = plan.scene, plan.mesh
        plates = [self._plates(plan, t) for t in times.tolist()]
        if all(each.still for each in scene.surfaces):
            # Furniture has thousands of faces: the largest returns of plates of their size alone are mirrors.
            plates = [self._largest(some) for some in plates]
        poses = sorted({0, len(times) // 2, len(times) - 1})
        bounds = self._bounds(plan)
        keys: set[RouteKey] = set()
        for k in poses:
            own = [samples[k].points[first:last] for first, last in self._vertex_ranges(plan)]
            keys |= significant_routes(
                plates[k], own, bounds, self._max_bounces, scene.max_range, scene.rtol, scene.group
            )
        at_poses = [(samples[k], plates[k]) for k in poses]
        keys = strong_routes(plan, at_poses, keys, bounds, lambda some, *key: self._weights(plan, some, *key))
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
                    legs_crossed = tuple(
                        ((there or none).take(route.facets), (here or none).take(route.facets))
                        for there, here in known_crossed
                    )
                    route = replace(route, crossed=legs_crossed)
                if len(route.facets):
                    found.append((one != other, route))
        kept = significant_facets(plan, [samples[k] for k in poses], [each for _, each in found], bounds)
        both = []
        for (differ, _), route in zip(found, kept, strict=True):
            if len(route.facets):
                both.append(route)
                if differ:
                    swapped = tuple((back, out) for out, back in route.crossed)
                    both.append(replace(route, out=route.back, back=route.out, crossed=swapped))
        return both

    def _largest(self, plates: Sequence[Plate | None]) -> list[Plate | None]:
        """The plates, of which the smallest are None."""
        order = sorted((each for each in plates if each is not None), key=self._most)
        left = {each.part for each in order[-MAX_STILL_MIRRORS:]}
        return [each if each is not None and each.part in left else None for each in plates]

    def _most(self, plate: Plate) -> float:
        """Bound of the return by a plate and one of its size: area / (4 pi distance^2), in both directions."""
        nearest = max(float(np.linalg.norm(np.concatenate(plate.windows), axis=1).min()), 1e-3)
        return 2.0 * self.reflectors.parts[plate.part].area / (4.0 * np.pi * nearest**2)

    def _weights(self, plan: TracePlan, facets: NDArray[np.intp], out: LegKey, back: LegKey) -> FloatArray:
        """(facet,) weight of the roles of some facets on a route."""
        first = np.array([each.first_facet for each in plan.scene.surfaces])[plan.mesh.facet_surface[facets]]
        own = self.reflectors.owner[first + plan.mesh.face_in_surface[facets]]
        return self.reflectors.role_weights(own, out, back)

    def _fractions(self, plan: TracePlan, leg: Leg, points: Sequence[FloatArray]) -> tuple[FloatArray, list[Crossings]]:
        occluders = self._whole if plan.scene.slabs is None else plan.scene.slabs.occluders
        given = plan.mesh.meshes, points, occluders, plan.settings.resolution, plan.mesh.corner_normals
        return see_along(leg, *given)[:2]

    def _vertex_ranges(self, plan: TracePlan) -> list[tuple[int, int]]:
        """First and last vertex of each surface, without those of pieces."""
        ranges = plan.mesh.meshes.vertex_range.tolist()
        return [(a, b - len(ends)) for (a, b), (ends, _) in zip(ranges, plan.mesh.sources, strict=True)]

    def _route(
        self, plan: TracePlan, samples: Sequence[Sample], poses: Sequence[int], key: RouteKey,
        legs: tuple[tuple[Leg, ...], tuple[Leg, ...]], share: FloatArray, bounds: ReturnBounds,
    ) -> Route:  # fmt: skip
        """Facets of one route, with the `share` (knot, facet) that both legs show."""
        scene, mesh = plan.scene, plan.mesh
        facets = np.flatnonzero(share.any(axis=0))
        visible = share[:, facets] * self._weights(plan, facets, *key)
        bound = np.zeros(len(facets))
        for k, sample in enumerate(samples):
            centroids = mesh.centroids(sample.points, facets)
            out, back = legs[0][k], legs[1][k]
            length = np.linalg.norm(centroids - out.view, axis=1) + np.linalg.norm(centroids - back.view, axis=1)
            visible[k, 0.5 * length >= scene.max_range] = 0.0
            if k in poses:
                raise_bounds(plan, sample, facets, visible[k], (out, back), bounds, bound)
        bound[visible.max(axis=0, initial=0.0) <= 0] = 0.0
        return Route(*legs, facets, visible, bound)

    def _bounds(self, plan: TracePlan) -> ReturnBounds:
        band = plan.scene.band
        frequency = band.frequency(np.array([-1.0, 0.0, 1.0]))
        surface = [part.surface for part in self.reflectors.parts]
        return ReturnBounds(
            band.pattern_gain, self._media(plan, frequency), 2 * np.pi * frequency / SPEED_OF_LIGHT, surface
        )

    def _media(self, plan: TracePlan, frequency: FloatArray) -> FloatArray:
        """(node, surface, 7) of all surfaces, static ones first."""
        key = frequency.tobytes()
        if key not in self._tables:
            materials = [each.material for each in (*self._surfaces.static, *self._surfaces.moving)]
            self._tables[key] = media_table(Media.at(materials, frequency, plan.scene.band.half_band))
        return self._tables[key]

    def _pattern(self, plan: TracePlan, route: Route, k: int, centroids: FloatArray) -> FloatArray:
        """(path,) two-way field gain at knot `k`."""
        gain = plan.scene.band.pattern_gain
        return np.asarray(np.sqrt(gain(route.out[k].departures(centroids)) * gain(route.back[k].departures(centroids))))

    def _integrated(
        self, plan: TracePlan, sample: Sample, k: int, route: Route, table: FloatArray,
        some: NDArray[np.intp] | slice = slice(None),
    ) -> tuple[ComplexArray, FloatArray]:  # fmt: skip
        """(node, path) gains at the nodes of a `table` (node, 7) and (path, 3) centroids [m]."""
        out, back = route.out[k], route.back[k]
        there = np.column_stack([out.image(table[:, :3]), back.image(table[:, 3:6]), table[:, 6]])
        media = self._media(plan, table[:, 6] * SPEED_OF_LIGHT / (2 * np.pi))
        fields = np.stack([leg.turned(own) for leg, own in zip((out, back), plan.scene.band.fields, strict=True)])
        own_media = np.ascontiguousarray(media[:, len(self._surfaces.static) :])
        nodes = GainNodes.of_one_place(there, own_media, fields, True)
        facets = route.facets[some]
        legs = self._leg_tables(out, back, media)
        if route.crossed and plan.scene.slabs is not None:
            crossed = tuple(each if isinstance(some, slice) else each.take(some) for each in route.crossed[k])
            frequency = table[:, 6] * SPEED_OF_LIGHT / (2 * np.pi)
            legs = legs._replace(**plan.scene.slabs.leg_tables((crossed[0], crossed[1]), frequency))
        return integrate(
            plan.mesh, plan.material, sample, facets, nodes, plan.settings.sagitta, plan.settings.turn,
            np.zeros((0, 3)), np.ascontiguousarray(route.visible[k, some]), legs,
        )  # fmt: skip

    def _leg_tables(self, out: Leg, back: Leg, media: FloatArray) -> LegTables:
        normals, mirrors = np.zeros((2, MAX_MIRRORS, 3)), np.zeros((len(media), 2, MAX_MIRRORS, 7))
        for side, leg in enumerate((out, back)):
            for place, (mirror, normal) in enumerate(zip(leg.mirrors, leg.normals, strict=True)):
                normals[side, place] = normal
                mirrors[:, side, place] = media[:, self.reflectors.parts[mirror.part].surface]
        planes = [out.planes] if out is back else [out.planes, back.planes]
        return LegTables.direct()._replace(
            views=np.stack([out.view, back.view]), mirrors=np.array([len(out.mirrors), len(back.mirrors)], np.int32),
            normals=normals, media=mirrors, planes=np.concatenate(planes),
        )  # fmt: skip

    def _rate(self, plan: TracePlan, t: float, route: Route) -> FloatArray:
        """(tx, rx, path, 1) rates of the delays [s/s] at a single time."""
        band, ends = plan.scene.band, []
        keys = [tuple(mirror.part for mirror in legs[0].mirrors) for legs in (route.out, route.back)]
        elements = [np.ascontiguousarray(each - band.viewpoint) for each in band.elements]
        for step in (-RATE_STEP, RATE_STEP):
            plates = self._plates(plan, t + step)
            legs = [
                leg_of(key, plates, sided=False) or now[0]
                for key, now in zip(keys, (route.out, route.back), strict=True)
            ]
            points = plan.mesh.points(plan.scene.positions(t + step), band.viewpoint)
            found = np.empty((*(len(each) for each in elements), len(route.facets), 1))
            out, back = (leg.image(each) for leg, each in zip(legs, elements, strict=True))
            pair_delays(plan.mesh.centroids(points, route.facets)[None], out, back, found)
            ends.append(found)
        return np.asarray((ends[1] - ends[0]) / (2 * RATE_STEP))

    def _chosen_expansion(
        self, plan: TracePlan, sample: Sample, k: int, routes: Sequence[Route], level: FloatArray
    ) -> Expansion:
        expansions = copy.copy(plan.scene.band.expansions)
        expansions.powers = 1  # Tx and Rx are not reciprocal on one route
        strongest = sorted(routes, key=lambda each: -float(np.linalg.norm(each.bound)))[:CHECKED_ROUTES]
        check = _RouteCheck(self, plan, sample, k, strongest, level)
        return choose_expansion(expansions, [check], plan.scene.rtol, EXPANSION_SHARE * plan.scene.rtol)


class _RouteCheck:
    """Strongest facets of some `routes` at knot `k`, to test expansions."""

    def __init__(
        self, tracer: RouteTracer, plan: TracePlan, sample: Sample, k: int, routes: Sequence[Route], level: FloatArray
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
            length = np.sum([np.linalg.norm(centroids - each[:, None], axis=2) for each in ends], axis=0)
            cycles = band.frequency(u)[:, None] * length / SPEED_OF_LIGHT
            pattern = self._tracer._pattern(self._plan, route, self._k, centroids)
            found.append(np.exp(-2j * np.pi * (cycles - np.rint(cycles))) * pattern)
        return np.concatenate(found, axis=1)
