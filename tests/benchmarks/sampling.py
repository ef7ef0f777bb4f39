"""RF adaptive sampling of visibility: error of an adult's return against the rays sent.

Uniform are n^2 rays to each facet; adaptive those of :mod:`rfgen_sionna.tracing.shadows.adaptive_sampling`, at a
ladder of tolerances. Truth is a lattice so dense that each facet's share is known to a few tenths of a percent.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from rfgen_sionna.tracing.moving.moving_visibility import silhouette_ray_spacing

from rfgen_sionna._types import SPEED_OF_LIGHT, ComplexArray
from rfgen_sionna.tracing import tracer
from rfgen_sionna.tracing.gains import band as gains
from rfgen_sionna.tracing.shadows import adaptive_sampling as sampling
from rfgen_sionna.tracing.shadows.silhouettes import FacetLocator, MeshSilhouette, SilhouetteRays
from rfgen_sionna.tracing.surface.facets import stack_facets
from rfgen_sionna.tracing.surface.tessellate import Tessellation
from tests.benchmarks.comparison import compare_rays
from tests.benchmarks.measuring import default_rtol, timed
from tests.benchmarks.skips import uniform_share
from tests.benchmarks.subjects import person


def run(quick: bool, progress: Callable[[str], None]) -> dict[str, Any]:
    progress("adaptive sampling of visibility")
    subject = person(77)
    made = tracer.Tracer(None, subject.radar, subject.actors, default_rtol())
    rays, vertices, _ = made.geometry(0.0)
    viewpoint = np.asarray(subject.radar.position)
    surface = made.surfaces.moving[0]
    corners = vertices[0][surface.faces]
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    facing = np.flatnonzero(((corners[:, 0] - viewpoint) * cross).sum(axis=1) < 0)
    places = sampling.shared_vertices(corners)[facing]
    corners, number = corners[facing], facing + surface.first_facet
    fields = _fields(made, facing, vertices, viewpoint)
    wavenumber = 2 * np.pi * subject.frequency / SPEED_OF_LIGHT
    truth = (fields * uniform_share(rays, viewpoint, corners, number, 16 if quick else 32)[0]).sum()

    def measured(method: str, find: Callable[[], tuple[Any, int]], **setting: Any) -> dict[str, Any]:
        find()
        elapsed, (share, sent) = timed(find)
        error = float(abs((fields * share).sum() - truth) / abs(truth))
        return {"method": method, "rays": sent, "relative": error, "seconds": elapsed} | setting

    found = [
        measured("uniform", lambda n=n: uniform_share(rays, viewpoint, corners, number, n))
        for n in ((1, 2, 4, 8) if quick else (1, 2, 4, 8, 12, 16))
    ]
    for rtol in sorted({1e-1, 1e-2, 1e-3, default_rtol()}, reverse=True):

        def adaptive(rtol: float = rtol) -> tuple[Any, int]:
            apart = silhouette_ray_spacing([vertices[0][surface.faces]], viewpoint, rtol)
            past, span = MeshSilhouette(surface.faces).silhouette_rays(vertices[0] - viewpoint, apart)
            silhouette_rays = SilhouetteRays(past, rays.first_facet(viewpoint, past), span)
            silhouette = FacetLocator(corners - viewpoint, number).silhouette_lengths(silhouette_rays)[0]
            visible, guides = sampling.CornerVisibility(viewpoint, corners, number, places).visible(rays)
            found = sampling.sample_visibility(rays, viewpoint, corners, number, visible, wavenumber, rtol, silhouette)
            return found.fraction, guides + found.rays + len(past)

        found.append(measured("adaptive", adaptive, rtol=rtol))
    return {"facets": len(corners), "rows": found, "compared": compare_rays(found, "adaptive", "uniform")}


def _fields(made: tracer.Tracer, facing: Any, vertices: Any, viewpoint: Any) -> ComplexArray:
    """(facet,) what the facets that face the radar return, each as a whole."""
    surface, band = made.surfaces.moving[0], gains.BandTracer(made.radar, default_rtol())
    count = len(surface.faces)
    eye = np.broadcast_to(np.eye(3), (count, 3, 3))
    whole = [Tessellation(np.arange(count, dtype=np.int32), eye, np.ones(count, np.int32))]
    (placed,) = stack_facets(made.surfaces.moving, whole, [vertices], viewpoint, 0.0)
    facets = placed.take(facing)
    values = band.at_probes(facets, (surface.material,), np.zeros(1), (0, 0), np.full(len(facets), 4, np.int32))
    return np.asarray(values.a[0] * np.exp(-2j * np.pi * np.mod(band.centre * values.tau[0], 1.0)))
