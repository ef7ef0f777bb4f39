"""Paths between static surfaces besides direct ones."""

from __future__ import annotations

from rfgen_sionna.radar import Radar
from rfgen_sionna.scene.rays import RayScene
from rfgen_sionna.tracing.gains.band import BandTracer
from rfgen_sionna.tracing.static.static_curved import StaticCurvedReflections, trace_static_curved
from rfgen_sionna.tracing.static.static_reflections import StaticReflections, trace_static_reflections
from rfgen_sionna.tracing.static.static_trace import StaticTrace
from rfgen_sionna.tracing.static.static_transmission import (
    StaticTransmission,
    trace_static_slab_reflections,
    trace_static_transmission,
)
from rfgen_sionna.tracing.surface.surfaces import Surfaces
from rfgen_sionna.tracing.transmission.transmission import Transmission

StaticIndirect = StaticReflections | StaticCurvedReflections | StaticTransmission


def trace_static_indirect(
    surfaces: Surfaces,
    rays: RayScene,
    radar: Radar,
    band: BandTracer,
    static: StaticTrace,
    slabs: Transmission | None,
    rtol: float,
    max_bounces: int,
    transmission: bool,
) -> tuple[StaticIndirect, ...]:
    """Indirect paths between static surfaces and through them; `slabs` is the transmission between static surfaces,
    None without any."""
    scene = surfaces, rays, radar
    straight = None if slabs is None else trace_static_transmission(surfaces, rays, slabs, static)
    found: list[StaticIndirect | None] = [straight]
    if max_bounces > 1:
        found.append(trace_static_reflections(*scene, band, static, rtol, max_bounces))
        found.append(trace_static_curved(*scene, static, rtol))
    if max_bounces > 1 and transmission:
        through = None if straight is None else straight.paths
        found.append(trace_static_slab_reflections(*scene, band, static, through, rtol, max_bounces))
    return tuple(each for each in found if each is not None)
