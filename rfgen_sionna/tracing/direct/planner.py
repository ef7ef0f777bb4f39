"""Choice of the facets, the settings and the expansion of a run."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import SPEED_OF_LIGHT, ComplexArray, FloatArray, IntArray
from rfgen_sionna.scene.mesh import lengths
from rfgen_sionna.tracing.direct.expansion_choice import choose_expansion, expanded, group_sums, node_table
from rfgen_sionna.tracing.direct.knot_count import with_knots
from rfgen_sionna.tracing.direct.other_diagonals import with_other_diagonals
from rfgen_sionna.tracing.direct.run_scene import RunScene
from rfgen_sionna.tracing.direct.samples import GainNodes, Sample
from rfgen_sionna.tracing.direct.settings import Settings
from rfgen_sionna.tracing.direct.time_error import share_of
from rfgen_sionna.tracing.direct.trace_plan import SAFETY, TracePlan
from rfgen_sionna.tracing.gains.band import BandTracer
from rfgen_sionna.tracing.gains.expansion import PROBES
from rfgen_sionna.tracing.surface.facets import CANCELLED

POSES = 9
"""Poses of a run that decide on its facets."""
MAX_ROUNDS = 4
"""Largest number of refinements; then a warning reports the error."""
EXPANSION_SHARE = 0.7
"""Share of the tolerance for an expansion."""
EXPANSION_FACETS, MOST_FACETS = 80.0, 2000
"""Number of strongest facets of an actor that decide on an expansion, times the tolerance; and the largest number."""
_LOG = logging.getLogger(__name__)


def plan_run(scene: RunScene, start: float, stop: float, length: float, cull: bool = True) -> TracePlan:
    """Plan for intervals of `length` [s] between `start` and `stop` [s]; `cull` omits facets that are negligible for
    the antennas."""
    times = np.unique(np.linspace(start, max(stop, start), POSES if stop > start else 1))
    poses = [scene.positions(float(t)) for t in times]
    away = np.array([scene.distances(pose) for pose in poses])
    closest = [poses[int(np.argmin(away[:, k]))][k] for k in range(len(scene.surfaces))]
    fastest = int(np.argmax(_speeds(poses))) if len(poses) > 1 else 0
    count = len(times)
    probes = sorted({float(times[k]) for k in (fastest, count // 4, count // 2, (3 * count) // 4)})
    planner = Planner(scene, closest, away.min(axis=0), probes, cull, scene.has_parallax(poses))
    plan = planner.plan(*planner.settings(Settings.of(scene.rtol)))
    plan = replace(plan, surface=planner.surface_error(plan))
    starts = sorted({min(t, max(stop - length, start)) for t in probes})
    return plan if length <= 0 else with_knots(plan, planner.without_expansion(plan.settings), starts, length)


class Planner:
    """Chooses settings and expansion at the times `probes` [s]."""

    def __init__(
        self,
        scene: RunScene,
        closest: Sequence[FloatArray],
        nearest: FloatArray,
        probes: Sequence[float],
        cull: bool,
        parallax: bool,
    ) -> None:
        self.parallax = parallax
        self._scene, self._closest, self._probes, self._cull = scene, closest, probes, cull
        self._of_surfaces, self._nearest = nearest, float(nearest.min(initial=np.inf))
        self._plans: dict[Settings, TracePlan] = {}
        self._plain: dict[Settings, TracePlan] = {}
        band = scene.band
        pairs = len(band.elements[0]) * len(band.elements[1])
        self._pairs = np.repeat(np.unique([0, pairs - 1]), len(PROBES)).astype(np.int32)
        self._u = np.tile(PROBES, len(self._pairs) // len(PROBES))

    def settings(self, first: Settings) -> tuple[Settings, FloatArray]:
        """Settings that meet the tolerance, from the `first` ones on, and the error (group,) with them."""
        settings, before = first, np.inf
        for attempt in range(MAX_ROUNDS):
            error = self._error(settings)
            worst = float(error.max(initial=0.0))
            if worst <= SAFETY * self._scene.rtol:
                break
            if attempt == MAX_ROUNDS - 1 or worst > 0.7 * before:
                name = self._scene.surfaces[int(np.argmax(error))].name
                _LOG.warning(
                    "the return of '%s' has a relative error of %.2g (rtol: %g)", name, worst, self._scene.rtol
                )
                break
            settings, before = settings.finer(), worst
        return settings, error

    def plan(self, settings: Settings, error: FloatArray | float = 0.0) -> TracePlan:
        """Plan with these `settings`, for single times."""
        if settings not in self._plans:
            self._plans[settings] = self._with_expansion(self.without_expansion(settings))
        return replace(self._plans[settings], error=float(np.max(error, initial=0.0)))

    def without_expansion(self, settings: Settings) -> TracePlan:
        """Plan with the gains of the first pair in the middle of the band alone."""
        if settings not in self._plain:
            scene = self._scene
            mesh = scene.mesh(self._closest, settings.facet_rtol)
            centre = self.nodes(scene.probe_nodes(np.zeros(1), np.zeros(1, np.int32)))
            expansion = scene.band.expansions.through([(0, 0, 0, 0, 0)])
            steep = scene.rtol < 0.03 or not all(each.smooth for each in scene.surfaces)
            self._plain[settings] = TracePlan(
                scene=scene, settings=settings, mesh=mesh, material=mesh.surface, expansion=expansion, nodes=centre,
                steep=steep, error=0.0, knots=1, time_error=0.0, time_scale=0.0, cull=self._cull,
                nearest=self._of_surfaces, level=np.zeros(len(scene.group)), surface=0.0,
            )  # fmt: skip
        return self._plain[settings]

    def _error(self, settings: Settings) -> FloatArray:
        """(group,) error of the returns with `settings` against finer ones, relative to the larger of each return and
        that at the other times."""
        coarse, fine = self.plan(settings), self.without_expansion(settings.finer())
        missed, level, strongest = np.zeros((3, len(self._scene.group)))
        for t in self._probes:
            one, single = self._returns(coarse, t, True)
            other, _ = self._returns(fine, t, False)
            missed += (np.abs(one - other) ** 2).mean(axis=0)
            level += (np.abs(other) ** 2).mean(axis=0)
            strongest = np.maximum(strongest, single)
        least = np.maximum(np.sqrt(level / len(self._probes)), CANCELLED * strongest)
        return SAFETY * share_of(np.sqrt(missed / len(self._probes)), least)

    def surface_error(self, plan: TracePlan) -> float:
        """Change of the worst return by the other diagonals of the quads, relative to the typical return."""
        cut = [with_other_diagonals(*each) for each in zip(self._scene.surfaces, self._closest, strict=True)]
        if all(one is other for one, other in zip(cut, self._scene.surfaces, strict=True)):
            return 0.0
        scene = replace(self._scene, surfaces=tuple(cut))
        mesh = scene.mesh(self._closest, plan.settings.facet_rtol)
        other = replace(plan, scene=scene, mesh=mesh, material=mesh.surface)
        changed, level = np.zeros((2, len(scene.group)))
        for t in self._probes:
            one, two = (self._returns(each, t, True)[0] for each in (plan, other))
            changed += (np.abs(one - two) ** 2).mean(axis=0)
            level += (np.abs(one) ** 2).mean(axis=0)
        return float(share_of(np.sqrt(changed), np.sqrt(level)).max(initial=0.0))

    def _returns(self, plan: TracePlan, t: float, by_expansion: bool) -> tuple[ComplexArray, FloatArray]:
        """(probe, group) returns at `t` [s], by the expansion or by integrals at each probe, and (group,) the strongest
        facet's."""
        scene = self._scene
        if not by_expansion:
            plan = replace(plan, nodes=self.nodes(scene.probe_nodes(self._u, self._pairs)))
        (sample,) = plan.sample([t])
        chosen = plan.choose([sample])
        gains, centroids = plan.values(sample, chosen)
        if by_expansion:
            gains = expanded(plan.expansion, gains, self._u, self._pairs)
        waves = gains * pair_waves(scene.band, centroids, self._u, self._pairs) * scene.pattern(centroids)
        group = scene.group[plan.mesh.facet_surface[chosen]]
        strongest = np.zeros(len(scene.group))
        np.maximum.at(strongest, group, np.abs(waves).max(axis=0, initial=0.0))
        return group_sums(waves, group, len(scene.group)), strongest

    def _with_expansion(self, plan: TracePlan) -> TracePlan:
        """The plan with the smallest expansion whose coherent sums are right to a share of the tolerance."""
        scene = self._scene
        checks = [each for each in (_Check.of(self, plan, t) for t in self._probes) if len(each.facets)]
        tolerance = EXPANSION_SHARE * scene.rtol
        expansion = choose_expansion(scene.band.expansions, checks, scene.rtol, tolerance)
        return replace(plan, expansion=expansion, nodes=self.nodes(node_table(expansion.nodes)))

    def nodes(self, table: FloatArray) -> GainNodes:
        """Nodes of a `table` (node, 7)."""
        return self._scene.nodes(table, self._nearest, self.parallax)


@dataclass
class _Check:
    """Strongest facets at a time `t` [s], to test expansions."""

    planner: Planner
    plan: TracePlan
    t: float
    sample: Sample
    facets: NDArray[np.intp]
    group: IntArray
    least: FloatArray

    @staticmethod
    def of(planner: Planner, plan: TracePlan, t: float) -> _Check:
        scene = plan.scene
        (sample,) = plan.sample([t])
        chosen = plan.choose([sample])
        values, centroids = plan.values(sample, chosen)
        strength, group = np.abs(values[0]) * scene.pattern(centroids), scene.group[plan.mesh.facet_surface[chosen]]
        most = min(int(EXPANSION_FACETS / scene.rtol), MOST_FACETS)
        by_group = [np.flatnonzero(group == number) for number in np.unique(group)]
        few = np.sort(
            np.concatenate([np.zeros(0, np.intp), *(own[np.argsort(-strength[own])[:most]] for own in by_group)])
        )
        return _Check(planner, plan, t, sample, chosen[few], group[few], np.zeros(len(scene.group)))

    def values(self, table: FloatArray) -> ComplexArray:
        """(node, path) gains at the nodes of a `table` (node, 7)."""
        tried = replace(self.plan, nodes=self.planner.nodes(table))
        sample = tried.sample([self.t])[0] if self.planner.parallax else self.sample
        return tried.values(sample, self.facets)[0]

    def waves(self, u: FloatArray, pairs: IntArray) -> ComplexArray:
        """(probe, path) propagation phasors times pattern gain."""
        centroids = self.plan.mesh.centroids(self.sample.points, self.facets)
        return pair_waves(self.plan.scene.band, centroids, u, pairs) * self.plan.scene.pattern(centroids)


def pair_waves(band: BandTracer, centroids: FloatArray, u: FloatArray, pairs: IntArray) -> ComplexArray:
    """(probe, facet) propagation phasors by `centroids` (facet, 3) [m] relative to the viewpoint, at positions `u` of
    the band of `pairs` (probe,)."""
    tx, rx = (each - band.viewpoint for each in band.elements)
    one, other = np.divmod(pairs, len(rx))
    length = lengths(centroids - tx[one][:, None]) + lengths(centroids - rx[other][:, None])
    cycles = band.frequency(u)[:, None] * length / SPEED_OF_LIGHT
    return np.asarray(np.exp(-2j * np.pi * (cycles - np.rint(cycles))))


def _speeds(poses: Sequence[Sequence[FloatArray]]) -> Sequence[float]:
    """Largest movement [m] of any vertex about each of the `poses`."""
    steps = [
        max((float(lengths(b - a).max(initial=0.0)) for a, b in zip(one, other, strict=True)), default=0.0)
        for one, other in pairwise(poses)
    ]
    return [max(steps[max(k - 1, 0) : k + 1], default=0.0) for k in range(len(poses))]
