"""Direct paths of moving surfaces over one interval of time."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import ComplexArray, FloatArray
from rfgen_sionna.records import PathKind, RadarPaths, knot_weights
from rfgen_sionna.scene.mesh import lengths
from rfgen_sionna.tracing.direct.samples import Sample, pair_delays
from rfgen_sionna.tracing.direct.settings import MAX_KNOTS
from rfgen_sionna.tracing.direct.time_error import mean_level, prediction_error
from rfgen_sionna.tracing.direct.trace_plan import SAFETY, TIME_PER_RTOL, TracePlan
from rfgen_sionna.tracing.surface.facets import RATE_STEP, Facets
from rfgen_sionna.tracing.visibility.item_buffer import Shadows

LEEWAY = 1.5
"""Growth of the time error over the allowed one above which an interval gets more knots."""


class Returns(Protocol):
    """Further returns of facets at the knots."""

    @property
    def gains(self) -> ComplexArray:
        """(path, knot) of the first pair in the middle of the band, with antennas."""

    @property
    def delays(self) -> FloatArray:
        """(tx, rx, path, knot) [s]"""

    @property
    def facets(self) -> NDArray[np.intp]:
        """(path,)"""


class Routes(Protocol):
    """Traces further returns of facets at the same knots (:mod:`rfgen_sionna.tracing.routes.route_trace`)."""

    def trace(self, plan: TracePlan, times: FloatArray, samples: Sequence[Sample], level: FloatArray) -> Sequence[Any]:
        """Returns at `times` [s], from the `samples` at these and the `level` (group,) of direct ones."""

    def paths(self, plan: TracePlan, times: FloatArray, samples: Sequence[Sample], returns: Any,
              names: tuple[tuple[str, ...], tuple[str, ...]]) -> RadarPaths:  # fmt: skip
        """Paths of some `returns`."""


@dataclass(frozen=True)
class DirectTrace:
    """Paths of moving surfaces over an interval."""

    paths: RadarPaths
    """Direct ones, then those of routes."""
    error: float
    """Measured relative error of the worst actor's return at the knots, of the run."""
    time_error: float
    """Estimated relative error of the worst actor's return between the knots."""
    surface: float
    """Change of the worst actor's return if quads of its mesh were cut along the other diagonal, of the run."""
    facets: int
    """Facets that were integrated, over all knots."""
    shadows: tuple[Shadows, ...]
    """Shadows on facets at rest at each knot of the paths."""
    centroids: Callable[[float], FloatArray]
    """Time [s] to the (path, 3) facet centres [m] of direct paths."""
    samples: tuple[Sample, ...] = field(repr=False)
    """At each knot of the paths."""


def trace_direct(
    plan: TracePlan,
    start: float,
    stop: float,
    names: tuple[tuple[str, ...], tuple[str, ...]],
    routes: Routes | None = None,
) -> DirectTrace:
    """Paths from `start` to `stop` [s], with as many knots as the motion demands; `names` are those of objects and
    parts, `routes` are further ones."""
    scene = plan.scene
    count = plan.knots if stop > start else 1
    known: dict[float, Sample] = {}
    allowed, error, before = SAFETY * TIME_PER_RTOL * scene.rtol, 0.0, np.inf
    while True:
        times = np.linspace(start, stop, count)
        fresh = [t for t in times.tolist() if t not in known]
        known |= dict(zip(fresh, plan.sample(fresh), strict=True))
        samples = [known[t] for t in times.tolist()]
        if _rests(samples):
            times, samples = times[:1], samples[:1]
        chosen = plan.choose(samples)
        found = [plan.values(each, chosen) for each in samples]
        values = np.stack([own for own, _ in found], axis=-1)  # (node, facet, knot)
        centroids = np.stack([each for _, each in found])
        group = scene.group[plan.mesh.facet_surface[chosen]]
        gains = plan.first_pair(values) * scene.pattern(centroids[len(times) // 2])[:, None]
        delays = plan.delays(samples, chosen, centroids, only_first=True)[0, 0]
        more: Sequence[Any] = ()
        if routes is not None:
            level = mean_level(gains, delays, scene.band.centre, group, len(scene.group))
            more = routes.trace(plan, times, samples, level)
            group = np.concatenate([group, *(scene.group[plan.mesh.facet_surface[each.facets]] for each in more)])
            gains = np.concatenate([gains, *(each.gains for each in more)])
            delays = np.concatenate([delays, *(each.delays[0, 0] for each in more)])
        if len(times) < 3 or not len(gains):
            break
        missed, level = prediction_error(gains, delays, scene.band.centre, group, len(scene.group))
        level = np.maximum(level, plan.level)  # a fading return demands no more knots than elsewhere
        predicted = float((missed / np.where(level > 0, level, np.inf)).max(initial=0.0))
        error = plan.time_scale * predicted
        if error <= LEEWAY * allowed or error > 0.7 * before or 2 * count - 1 > MAX_KNOTS:
            break
        count, before = 2 * count - 1, error
    paths = _paths(plan, times, samples, chosen, values, centroids, names)
    if more and routes is not None:
        paths = RadarPaths.concatenate([paths, *(routes.paths(plan, times, samples, each, names) for each in more)])

    def centres(t: float) -> FloatArray:
        points = plan.mesh.points(scene.positions(t), np.zeros(3))
        return plan.mesh.centroids(points, chosen)

    time_error = max(error, plan.time_error) if len(times) > 1 else 0.0
    facets = (len(chosen) + sum(len(each.facets) for each in more)) * len(times)
    shadows = tuple(each.shadows for each in samples)
    return DirectTrace(
        paths, plan.error, time_error, plan.surface, facets, shadows, centres, tuple(samples)
    )  # fmt: skip


def _rests(samples: list[Sample]) -> bool:
    """Whether nothing moves."""
    return len(samples) > 1 and all(np.array_equal(each.points, samples[0].points) for each in samples[1:])


def _paths(
    plan: TracePlan,
    times: FloatArray,
    samples: list[Sample],
    chosen: NDArray[np.intp],
    values: ComplexArray,
    centroids: FloatArray,
    names: tuple[tuple[str, ...], tuple[str, ...]],
) -> RadarPaths:
    """One path per facet, from values (node, facet, knot) and `centroids` (knot, facet, 3) [m] relative to the
    viewpoint."""
    scene, mesh, expansion = plan.scene, plan.mesh, plan.expansion
    band = scene.band
    tx, rx = (np.ascontiguousarray(each - band.viewpoint) for each in band.elements)
    gains = band.combined(expansion, values)
    rough = [_diffuse(plan, sample, chosen) for sample in samples]
    if rough[0] is not None:
        gains[0] += np.stack([each for each in rough if each is not None], axis=-1)
    tau = plan.delays(samples, chosen, centroids)
    if len(times) > 1:
        rate = tau @ knot_weights(times, times, 1).T
    else:
        t = float(times[0])
        after, ahead = np.empty((2, *tau.shape))
        for step, into in ((-RATE_STEP, after), (RATE_STEP, ahead)):
            points = mesh.points(scene.positions(t + step), band.viewpoint)
            pair_delays(mesh.centroids(points, chosen)[None], tx, rx, into)
        rate = (ahead - after) / (2 * RATE_STEP)
    away = np.maximum(lengths(centroids), 1e-12)
    direction = np.ascontiguousarray((centroids / away[..., None]).transpose(1, 0, 2))
    surface = mesh.facet_surface[chosen]
    objects = np.array([each.object_id for each in scene.surfaces], np.int32)
    several = len(gains) > 1
    return RadarPaths(
        a=gains[0],
        tau=tau,
        tau_rate=rate,
        times=times,
        frequency=band.centre,
        direction=direction,
        arrival=direction,
        object_id=objects[surface] if len(chosen) else np.zeros(0, np.int32),
        part_id=mesh.part[chosen],
        kind=np.full(len(chosen), PathKind.FACET, np.uint8),
        bounces=np.ones(len(chosen), np.uint8),
        object_names=names[0],
        part_names=names[1],
        facet=mesh.face_in_surface[chosen],
        dispersion=gains[1:] if several else None,
        half_band=band.half_band if several else 0.0,
    )


def _diffuse(plan: TracePlan, sample: Sample, chosen: NDArray[np.intp]) -> ComplexArray | None:
    """(tx, rx, facet) diffuse gains with the shadow weight; None without rough surfaces."""
    scene, mesh = plan.scene, plan.mesh
    materials = tuple(each.material for each in scene.surfaces)
    if not any(each.scattering_coefficient for each in materials):
        return None
    corners = sample.points[mesh.meshes.corners[chosen]] + scene.band.viewpoint
    number = mesh.face_in_surface[chosen]
    facets = Facets(
        corners, number, number, mesh.facet_surface[chosen], np.ones(len(chosen), np.bool_),
        np.ones(len(chosen), np.int32), mesh.place[chosen], grain=None if mesh.grain is None else mesh.grain[chosen],
    )  # fmt: skip
    found = scene.band.diffuse(facets, materials)
    return None if found is None else np.asarray(np.sqrt(sample.visible[chosen]) * found)
