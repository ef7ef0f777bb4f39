"""Which routes, and which of their facets, matter: by bounds of the facets' returns."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import FloatArray
from rfgen_sionna.tracing.direct.facet_bounds import bound_returns, significant
from rfgen_sionna.tracing.direct.samples import Sample
from rfgen_sionna.tracing.direct.trace_plan import TracePlan
from rfgen_sionna.tracing.legs.leg import Leg
from rfgen_sionna.tracing.routes.image_tree import OMITTED_SHARE, LegKey, ReturnBounds, RouteKey, leg_of
from rfgen_sionna.tracing.routes.reflectors import Plate
from rfgen_sionna.tracing.routes.route import Route

FEW_ROUTES = 8
"""Number of routes from which bounds of all facets select some before their visibility is known."""
Weights = Callable[[NDArray[np.intp], LegKey, LegKey], FloatArray]
"""Facets and the legs of a route to the (facet,) weight of the roles."""


def raise_bounds(
    plan: TracePlan, sample: Sample, facets: NDArray[np.intp], visible: FloatArray, legs: tuple[Leg, Leg],
    bounds: ReturnBounds, bound: FloatArray,
) -> None:  # fmt: skip
    """Raise `bound` (facet,) to the largest return of some `facets` of shares `visible` (facet,) by two legs."""
    mesh = plan.mesh
    centroids = mesh.centroids(sample.points, facets)
    gain = bounds.gain(legs[0], centroids) * bounds.gain(legs[1], centroids)
    bound_returns(
        sample.points, mesh.meshes.corners, mesh.faces, mesh.group, sample.normals, mesh.face_of, facets, visible, gain,
        plan.scene.wavenumber, legs[0].view, legs[1].view, bound,
    )  # fmt: skip


def strong_routes(
    plan: TracePlan,
    poses: Sequence[tuple[Sample, Sequence[Plate | None]]],
    keys: set[RouteKey],
    bounds: ReturnBounds,
    weights: Weights,
) -> set[RouteKey]:
    """The routes of `keys` without the weakest, by all facets in their windows, visible or not, at some `poses`."""
    if len(keys) < FEW_ROUTES or plan.settings.omitted <= 0 or not plan.cull:
        return keys
    mesh, ordered, direct = plan.mesh, sorted(keys), Leg(())
    energy, level = np.zeros((len(ordered), len(plan.scene.group))), np.zeros(len(plan.scene.group))
    every = np.arange(len(mesh))

    def energies(sample: Sample, facets: NDArray[np.intp], visible: FloatArray, legs: tuple[Leg, Leg]) -> FloatArray:
        bound = np.zeros(len(facets))
        raise_bounds(plan, sample, facets, visible, legs, bounds, bound)
        group = plan.scene.group[mesh.facet_surface[facets]]
        return np.asarray(np.bincount(group, bound**2, len(plan.scene.group)), np.float64)

    for sample, plates in poses:
        centroids = mesh.centroids(sample.points, every)
        size = np.linalg.norm(sample.points[mesh.meshes.corners] - centroids[:, None], axis=2).max(axis=1)
        level = np.maximum(level, energies(sample, every, sample.visible, (direct, direct)))
        legs: dict[LegKey, Leg | None] = {(): direct}
        reached: dict[LegKey, NDArray[np.bool_]] = {(): sample.visible > 0}
        for key in {leg for pair in ordered for leg in pair if leg}:
            leg = legs[key] = leg_of(key, plates)
            if leg is not None:
                reached[key] = (centroids @ leg.planes[:, :3].T - leg.planes[:, 3] >= -size[:, None]).all(axis=1)
        for row, (one, other) in enumerate(ordered):
            out, back = legs[one], legs[other]
            if out is not None and back is not None:
                some = np.flatnonzero(reached[one] & reached[other])
                found = energies(sample, some, weights(some, one, other), (out, back))
                energy[row] = np.maximum(energy[row], found * (1.0 if one == other else 4.0))
    most = np.maximum(np.maximum(level, energy.max(axis=0, initial=0.0)), 1e-300)
    share = (energy / most).max(axis=1)
    order = np.argsort(share)
    weak = np.cumsum(np.sqrt(share[order])) <= OMITTED_SHARE * plan.scene.rtol
    return {ordered[row] for row in order[~weak]}


def significant_facets(
    plan: TracePlan, samples: Sequence[Sample], routes: Sequence[Route], bounds: ReturnBounds
) -> list[Route]:
    """The `routes` with the facets that matter beside all others and the direct returns at some of the `samples`."""
    scene, mesh = plan.scene, plan.mesh
    direct = np.flatnonzero(np.max([each.visible for each in samples], axis=0))
    bound, leg = np.zeros(len(direct)), Leg(())
    for each in samples:
        raise_bounds(plan, each, direct, each.visible[direct], (leg, leg), bounds, bound)
    facets = np.concatenate([direct, *(each.facets for each in routes)])
    every = np.concatenate([bound, *(each.bound for each in routes)])
    omitted = plan.settings.omitted if plan.cull else 0.0
    chosen = np.zeros(len(every), np.bool_)
    chosen[significant(every, scene.group[mesh.facet_surface[facets]], len(scene.group), omitted)] = True
    found, first = [], len(direct)
    for route in routes:
        found.append(route.take(np.flatnonzero(chosen[first : first + len(route.facets)])))
        first += len(route.facets)
    return found
