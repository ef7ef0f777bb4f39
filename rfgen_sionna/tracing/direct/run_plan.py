"""Plan of a run: facets, expansion and settings that meet the tolerance, with their measured errors.

The plan depends on the run alone, not on the order in which its intervals are traced.
"""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import SPEED_OF_LIGHT, ComplexArray, FloatArray, IntArray
from rfgen_sionna.scene.mesh import lengths
from rfgen_sionna.tracing.direct.samples import (
    GainNodes,
    Positions,
    Sample,
    Sampler,
    choose_facets,
    integrate,
    pair_delays,
)
from rfgen_sionna.tracing.direct.settings import MAX_KNOTS, Settings
from rfgen_sionna.tracing.direct.time_error import prediction_error
from rfgen_sionna.tracing.gains.band import MONOSTATIC, BandTracer
from rfgen_sionna.tracing.gains.diffuse import grain_of
from rfgen_sionna.tracing.gains.expansion import PROBES, Expansion
from rfgen_sionna.tracing.integral.fresnel import media_table
from rfgen_sionna.tracing.integral.obliquity import Media
from rfgen_sionna.tracing.surface.facet_mesh import FacetMesh
from rfgen_sionna.tracing.surface.facets import CANCELLED
from rfgen_sionna.tracing.surface.surfaces import Surface, actor_groups
from rfgen_sionna.tracing.surface.tessellate import tessellate
from rfgen_sionna.tracing.visibility.item_buffer import StaticItems

POSES = 9
"""Poses of a run that decide on its facets."""
MAX_ROUNDS = 4
"""Largest number of refinements; then a warning reports the error."""
SAFETY = 1.5
"""Factor on errors measured at a few times, pairs and frequencies, for all others."""
EXPANSION_SHARE = 0.7
"""Share of the tolerance for an expansion."""
MAX_ORDER, MAX_DEGREE = 8, 6
"""Bounds of the expansion over the band and over the array: interpolation at more nodes is ill-conditioned."""
TIME_PER_RTOL = 1.0
"""Allowed error between knots per unit of the tolerance."""
RANGE_MARGIN = 1.1
"""Range of tessellation over the range window: facets may enter it during the run."""
EXPANSION_FACETS = 800
"""Strongest facets that decide on an expansion."""
_LOG = logging.getLogger(__name__)


@dataclass(frozen=True)
class RunScene:
    """Moving surfaces of a run, and the radar that sees them."""

    surfaces: tuple[Surface, ...]
    band: BandTracer
    max_range: float
    rtol: float
    positions: Positions
    static: StaticItems = field(default_factory=StaticItems)
    group: IntArray = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "group", actor_groups(self.surfaces))

    @property
    def wavenumber(self) -> float:
        """Largest wavenumber [rad/m]."""
        return 2 * np.pi * self.band.highest / SPEED_OF_LIGHT

    def mesh(self, vertices: Sequence[FloatArray], rtol: float) -> FacetMesh:
        """Facets fine enough for `vertices` (vertex, 3) [m] of each surface and a tolerance `rtol`."""
        band = self.band
        pieces = [
            tessellate(
                points, surface.faces, band.viewpoint, band.highest, rtol, band.pattern_gain,
                RANGE_MARGIN * self.max_range, band.half_band, smooth=surface.smooth, grain=grain_of(surface),
            )
            for points, surface in zip(vertices, self.surfaces, strict=True)
        ]  # fmt: skip
        return FacetMesh.of(self.surfaces, pieces, [len(points) for points in vertices])

    def sampler(self, mesh: FacetMesh, settings: Settings) -> Sampler:
        """Samples a `mesh` with these `settings`."""
        known = self.positions, self.band.viewpoint, self.max_range
        return Sampler(mesh, *known, settings.resolution, self.static, self.group)

    def nodes(self, table: FloatArray, nearest: float) -> GainNodes:
        """Nodes of a `table` (node, 7) for facets that are `nearest` [m] at least."""
        band = self.band
        frequency = table[:, 6] * SPEED_OF_LIGHT / (2 * np.pi)
        media = media_table(Media.at([each.material for each in self.surfaces], frequency, band.half_band))
        monostatic = band.alike and band.baseline**2 < MONOSTATIC * self.rtol * nearest**2
        return GainNodes(np.ascontiguousarray(table), media, np.stack(band.fields), not monostatic)

    def probe_nodes(self, u: FloatArray, pairs: IntArray) -> FloatArray:
        """(probe, 7) table of element `pairs` (probe,) at positions `u` (probe,) of the band."""
        nodes = self.band.expansions.nodes(u, pairs)
        return np.hstack([nodes.tx, nodes.rx, 2 * np.pi / SPEED_OF_LIGHT * nodes.frequency[:, None]])

    def gradient(self, centroids: FloatArray, needed: bool) -> FloatArray:
        """(facet, 3) gradient of the logarithm of the pattern gain at `centroids` (facet, 3) [m]; empty where it is not
        `needed` or zero."""
        found = self.band.pattern_gradients(centroids) if needed and len(centroids) else None
        return np.zeros((0, 3)) if found is None else found

    def pattern(self, centroids: FloatArray) -> FloatArray:
        """(facet,) two-way field gain over its peak towards `centroids` (facet, 3) [m] relative to the viewpoint."""
        away = np.maximum(lengths(centroids), 1e-12)
        return self.band.pattern_gain(centroids / away[:, None])


@dataclass(frozen=True)
class RunPlan:
    """Facets, expansion and settings of a run."""

    scene: RunScene
    settings: Settings
    mesh: FacetMesh
    material: IntArray
    """(face,) index of the material of each face, that of its surface."""
    expansion: Expansion
    nodes: GainNodes
    steep: bool
    """Whether the pattern gain changes over facets."""
    error: float
    """Measured error of the worst actor's return at single times."""
    knots: int
    """Number of knots of an interval."""
    time_error: float
    """Measured error between knots."""
    time_scale: float
    """That error over the error of predictions of single knots."""
    cull: bool
    """Whether facets that are negligible for the antennas are omitted."""

    @staticmethod
    def of(scene: RunScene, start: float, stop: float, length: float, cull: bool = True) -> RunPlan:
        """Plan for intervals of `length` [s] between `start` and `stop` [s]."""
        times = np.unique(np.linspace(start, max(stop, start), POSES if stop > start else 1))
        poses = [scene.positions(float(t)) for t in times]
        away = np.array([[_nearest(points, scene.band.viewpoint) for points in pose] for pose in poses])
        closest = [poses[int(np.argmin(away[:, k]))][k] for k in range(len(scene.surfaces))]
        nearest = float(away.min(initial=np.inf))
        fastest = int(np.argmax(_speeds(poses))) if len(poses) > 1 else 0
        probes = sorted({float(times[fastest]), float(times[len(times) // 2])})
        planner = _Planner(scene, closest, nearest, probes, cull)
        settings, error = planner.settings(Settings.of(scene.rtol))
        plan = planner.plan(settings, error)
        starts = [min(t, max(stop - length, start)) for t in probes]
        return plan if length <= 0 else _with_knots(plan, starts, length)

    def sample(self, times: Sequence[float]) -> list[Sample]:
        """Samples of the facets at `times` [s]."""
        return self.scene.sampler(self.mesh, self.settings).at(times)

    def choose(self, samples: Sequence[Sample]) -> NDArray[np.intp]:
        """Facets that matter at any of the `samples`."""
        scene = self.scene
        omitted = self.settings.omitted if self.cull else 0.0
        return choose_facets(self.mesh, samples, scene.band.pattern_gain, scene.wavenumber, scene.group, omitted)

    def values(self, sample: Sample, chosen: NDArray[np.intp]) -> tuple[ComplexArray, FloatArray]:
        """(node, chosen) gains of the expansion, and (chosen, 3) centroids [m] relative to the viewpoint."""
        gradient = self.scene.gradient(self.mesh.centroids(sample.points, chosen), self.steep)
        rise = self.settings.sagitta / self.scene.wavenumber
        return integrate(self.mesh, self.material, sample, chosen, self.nodes, rise, gradient)

    def first_pair(self, values: ComplexArray) -> ComplexArray:
        """(...) gains of the first pair in the middle of the band, from values (node, ...)."""
        weights = self.expansion.weights[0, 0, 0]
        joined = weights @ np.ascontiguousarray(values).view(np.float64).reshape(len(values), -1)
        return joined.view(np.complex128).reshape(values.shape[1:])


class _Planner:
    """Chooses settings and expansion at the times `probes` [s]."""

    def __init__(
        self, scene: RunScene, closest: Sequence[FloatArray], nearest: float, probes: Sequence[float], cull: bool
    ) -> None:
        self._scene, self._closest, self._nearest, self._probes, self._cull = scene, closest, nearest, probes, cull
        self._plans: dict[Settings, RunPlan] = {}
        band = scene.band
        pairs = len(band.elements[0]) * len(band.elements[1])
        self._pairs = np.repeat(np.unique([0, pairs - 1]), len(PROBES)).astype(np.int32)
        self._u = np.tile(PROBES, len(self._pairs) // len(PROBES))

    def settings(self, first: Settings) -> tuple[Settings, FloatArray]:
        """Settings that meet the tolerance, from the `first` ones on, and the error (group,) with them."""
        settings, error = first, self._error(first)
        for attempt in range(MAX_ROUNDS):
            worst = float(error.max(initial=0.0))
            if worst <= SAFETY * self._scene.rtol:
                break
            finer = self._error(settings.finer()) if attempt < MAX_ROUNDS - 1 else error
            falls = float(finer.max(initial=0.0)) / worst
            if falls < 1.0:  # else what is left is no matter of these settings
                settings, error = settings.finer(), finer
            if falls > 0.7:
                name = self._scene.surfaces[int(np.argmax(error))].name
                worst = float(error.max(initial=0.0))
                _LOG.warning("the return of '%s' has a relative error of %.2g (rtol: %g)", name, worst, self._scene.rtol)
                break
        return settings, error

    def plan(self, settings: Settings, error: FloatArray | float = 0.0) -> RunPlan:
        """Plan with these `settings`, for single times."""
        if settings not in self._plans:
            scene = self._scene
            mesh = scene.mesh(self._closest, settings.facet_rtol)
            centre = scene.nodes(scene.probe_nodes(np.zeros(1), np.zeros(1, np.int32)), self._nearest)
            expansion = scene.band.expansions.through([(0, 0, 0, 0, 0)])
            steep = scene.rtol < 0.03 or not all(each.smooth for each in scene.surfaces)
            plan = RunPlan(scene, settings, mesh, mesh.surface, expansion, centre, steep, 0.0, 1, 0.0, 0.0, self._cull)
            self._plans[settings] = self._with_expansion(plan)
        return replace(self._plans[settings], error=float(np.max(error, initial=0.0)))

    def _error(self, settings: Settings) -> FloatArray:
        """(group,) error of the returns with `settings` against finer ones, relative to the larger of each return and
        that at the other times."""
        coarse, fine = self.plan(settings), self.plan(settings.finer())
        missed, level, strongest = np.zeros((3, len(self._scene.group)))
        for t in self._probes:
            one, single = self._returns(coarse, t, True)
            other, _ = self._returns(fine, t, False)
            missed = np.maximum(missed, np.sqrt((np.abs(one - other) ** 2).mean(axis=0)))
            level = np.maximum(level, np.sqrt((np.abs(other) ** 2).mean(axis=0)))
            strongest = np.maximum(strongest, single)
        least = np.maximum(level, CANCELLED * strongest)
        return np.asarray(SAFETY * missed / np.where(least > 0, least, np.inf))

    def _returns(self, plan: RunPlan, t: float, expanded: bool) -> tuple[ComplexArray, FloatArray]:
        """(probe, group) returns at `t` [s], by the expansion or by integrals at each probe, and (group,) the strongest
        facet's."""
        (sample,) = plan.sample([t])
        chosen = plan.choose([sample])
        scene = self._scene
        if expanded:
            values, centroids = plan.values(sample, chosen)
            gains = _expanded(plan.expansion, values, self._u, self._pairs)
        else:
            exact = replace(plan, nodes=scene.nodes(scene.probe_nodes(self._u, self._pairs), self._nearest))
            gains, centroids = exact.values(sample, chosen)
        waves = gains * self._waves(centroids, self._u, self._pairs) * scene.pattern(centroids)
        group = scene.group[plan.mesh.facet_surface[chosen]]
        strongest = np.zeros(len(scene.group))
        np.maximum.at(strongest, group, np.abs(waves).max(axis=0, initial=0.0))
        return _group_sums(waves, group, len(scene.group)), strongest

    def _waves(self, centroids: FloatArray, u: FloatArray, pairs: IntArray) -> ComplexArray:
        """(probe, facet) propagation phasors."""
        band = self._scene.band
        tx, rx = (each - band.viewpoint for each in band.elements)
        one, other = np.divmod(pairs, len(rx))
        length = lengths(centroids - tx[one][:, None]) + lengths(centroids - rx[other][:, None])
        cycles = band.frequency(u)[:, None] * length / SPEED_OF_LIGHT
        return np.asarray(np.exp(-2j * np.pi * (cycles - np.rint(cycles))))

    def _with_expansion(self, plan: RunPlan) -> RunPlan:
        """The plan with the smallest expansion whose coherent sums are right to a share of the tolerance."""
        scene, expansions = self._scene, self._scene.band.expansions
        outer = expansions.representative()
        checks = []
        for t in self._probes:
            (sample,) = plan.sample([t])
            chosen = plan.choose([sample])
            if not len(chosen):
                continue
            value, centroids = plan.values(sample, chosen)
            strength = np.abs(value[0]) * scene.pattern(centroids)
            group = scene.group[plan.mesh.facet_surface[chosen]]
            few = np.concatenate([own[np.argsort(-strength[own])[:EXPANSION_FACETS]] for own in
                                  (np.flatnonzero(group == number) for number in np.unique(group))])  # fmt: skip
            checks.append((sample, chosen[np.sort(few)]))

        def finds(expansion: Expansion) -> RunPlan:
            tx, rx, frequency = expansion.nodes.tx, expansion.nodes.rx, expansion.nodes.frequency
            table = np.hstack([tx, rx, 2 * np.pi / SPEED_OF_LIGHT * frequency[:, None]])
            return replace(plan, expansion=expansion, nodes=scene.nodes(table, self._nearest))

        known: dict[tuple[bytes, bytes, int], tuple[ComplexArray, ComplexArray, FloatArray]] = {}

        def fits(u: FloatArray, pairs: IntArray, expansion: Expansion) -> bool:
            tried = finds(expansion)
            for number, (sample, few) in enumerate(checks):
                key = u.tobytes(), pairs.tobytes(), number
                if key not in known:
                    exact = replace(plan, nodes=scene.nodes(scene.probe_nodes(u, pairs), self._nearest))
                    truth, centroids = exact.values(sample, few)
                    known[key] = truth, self._waves(centroids, u, pairs), scene.pattern(centroids)
                truth, waves, pattern = known[key]
                values, _ = tried.values(sample, few)
                off = (_expanded(tried.expansion, values, u, pairs) - truth) * waves * pattern
                group, count = scene.group[plan.mesh.facet_surface[few]], len(scene.group)
                missed, whole = (
                    np.sqrt((np.abs(_group_sums(each, group, count)) ** 2).mean(axis=0))
                    for each in (off, truth * waves * pattern)
                )
                strongest = np.zeros(count)
                np.maximum.at(strongest, group, np.abs(truth * pattern).max(axis=0))
                level = np.maximum(whole, CANCELLED * strongest)
                if (missed > EXPANSION_SHARE * scene.rtol * level).any():
                    return False
            return True

        order, degree, first = 1, 0, np.zeros(len(PROBES), np.int32)
        middle, ends = np.zeros(len(outer)), np.repeat([-1.0, 1.0], len(outer))
        while order < MAX_ORDER and not fits(PROBES, first, expansions.over_band(order)):
            order += 1
        if len(outer) > 1:
            while degree < MAX_DEGREE and not fits(middle, outer, expansions.through(expansions.basis(1, degree, full=True))):
                degree += 1
        if order == MAX_ORDER or degree == MAX_DEGREE:
            _LOG.warning(
                "rtol is %g: gains change too fast for %d coefficients of degree %d over band and array; raise rtol",
                scene.rtol, order, degree,
            )  # fmt: skip
        found = expansions.through(expansions.basis(order, degree, full=False))
        if degree and order > 1 and not fits(ends, np.tile(outer, 2), found):
            found = expansions.through(expansions.basis(order, degree, full=True))
        return finds(found)


def _with_knots(plan: RunPlan, starts: Sequence[float], length: float) -> RunPlan:
    """The plan with the fewest knots per interval of `length` [s] that meet the tolerance in intervals from `starts`."""
    allowed = SAFETY * TIME_PER_RTOL * plan.scene.rtol
    count = first_count(plan, length)
    measured = [_time_error(plan, start, length, count) for start in starts]
    while count < MAX_KNOTS and max(error for error, _ in measured) > allowed:
        finer = count + max(1, count // 4)
        again = [_time_error(plan, start, length, finer) for start in starts]
        falls = max(error for error, _ in again) < 0.7 * max(error for error, _ in measured)
        if not falls and count >= 9:
            break
        count, measured = finer, again
    error, predicted = max(measured)
    scale = error / predicted if predicted > 0 else 0.0
    return replace(plan, knots=count, time_error=error, time_scale=float(scale))


def first_count(plan: RunPlan, length: float) -> int:
    """Number of knots from which to start: those of a quiet motion."""
    return max(3, 1 + int(np.ceil(length / plan.settings.spacing - 1e-6)))


def _time_error(plan: RunPlan, start: float, length: float, count: int) -> tuple[float, float]:
    """Error of the worst return between `count` knots from `start` on, measured at times between them, and that of
    predictions of single knots."""
    times = np.linspace(start, start + length, 2 * count - 1)
    samples = plan.sample(times.tolist())
    chosen = plan.choose(samples)
    if not len(chosen):
        return 0.0, 0.0
    found = [plan.values(each, chosen) for each in samples]
    gains = np.stack([plan.first_pair(values) for values, _ in found], axis=1)
    centroids = np.stack([each for _, each in found])
    scene = plan.scene
    gains = gains * scene.pattern(centroids[count - 1])[:, None]
    delays = first_delays(scene.band, centroids)
    group, groups = scene.group[plan.mesh.facet_surface[chosen]], len(scene.group)
    from rfgen_sionna.records import interpolate_knots, knot_weights

    weights = knot_weights(times[::2], times)
    coarse = interpolate_knots(weights, np.ascontiguousarray(gains[:, ::2]))
    smooth = delays[:, ::2] @ weights.T

    def waves(own: ComplexArray, tau: FloatArray) -> ComplexArray:
        cycles = scene.band.centre * tau
        return _group_sums((own * np.exp(-2j * np.pi * (cycles - np.rint(cycles)))).T, group, groups)

    truth = waves(gains, delays)
    off = np.sqrt((np.abs(waves(coarse, smooth) - truth) ** 2).mean(axis=0) * 0.5)
    level = np.sqrt((np.abs(truth) ** 2).mean(axis=0))
    knots = np.ascontiguousarray(gains[:, ::2]), np.ascontiguousarray(delays[:, ::2])
    missed, whole = prediction_error(*knots, scene.band.centre, group, groups)
    error, predicted = (
        float((each / np.where(own > 0, own, np.inf)).max(initial=0.0)) for each, own in ((off, level), (missed, whole))
    )
    return SAFETY * error, predicted


def first_delays(band: BandTracer, centroids: FloatArray) -> FloatArray:
    """(facet, knot) delays [s] of the first pair by `centroids` (knot, facet, 3) [m] relative to the viewpoint."""
    tx, rx = (np.ascontiguousarray(each[:1] - band.viewpoint) for each in band.elements)
    found = np.empty((1, 1, centroids.shape[1], centroids.shape[0]))
    pair_delays(centroids, tx, rx, found)
    return found[0, 0]


def _expanded(expansion: Expansion, values: ComplexArray, u: FloatArray, pairs: IntArray) -> ComplexArray:
    """(probe, facet) gains at positions `u` of the band of `pairs`, from the values (node, facet)."""
    weights = expansion.weights.reshape(expansion.order, -1, len(values))[:, pairs]
    return np.asarray(np.einsum("pk,kpn->pn", np.vander(u, expansion.order, increasing=True), weights) @ values)


def _group_sums(waves: ComplexArray, group: IntArray, count: int) -> ComplexArray:
    """(probe, group) sums of `waves` (probe, facet) by `group` (facet,)."""
    return np.stack([np.bincount(group, row.real, count) + 1j * np.bincount(group, row.imag, count) for row in waves])


def _nearest(points: FloatArray, viewpoint: FloatArray) -> float:
    return float(lengths(points - viewpoint).min(initial=np.inf))


def _speeds(poses: Sequence[Sequence[FloatArray]]) -> Sequence[float]:
    """Largest movement [m] of any vertex about each of the `poses`."""
    steps = [
        max((float(lengths(b - a).max(initial=0.0)) for a, b in zip(one, other, strict=True)), default=0.0)
        for one, other in zip(poses[:-1], poses[1:], strict=True)
    ]
    return [max(steps[max(k - 1, 0) : k + 1], default=0.0) for k in range(len(poses))]


