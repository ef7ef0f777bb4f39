"""Field and path length from an element to a point by way of bent mirrors
(:mod:`rfgen_sionna.tracing.curved.arriving_waves`)
and through slabs."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from rfgen_sionna._types import ComplexArray, FloatArray, IntArray
from rfgen_sionna.scene.mesh import lengths
from rfgen_sionna.tracing.curved import arriving_waves as passage
from rfgen_sionna.tracing.curved.arriving_waves import ArrivingWave
from rfgen_sionna.tracing.curved.media import polarisation_bases, reflected
from tests.reference.sbr.media import SlabOptics, transmitted


@dataclass(frozen=True)
class Slab:
    """A slab that rays go through."""

    normal: FloatArray
    """(lane, 3) unit."""
    surface: IntArray
    """(lane,) -1 where there is none."""


@dataclass(frozen=True)
class SlabRoute(passage.CurvedRoute):
    """Routes that go through slabs."""

    slabs: tuple[tuple[Slab, ...], ...]
    """Of each leg: one more than mirrors."""


def arriving_wave(element: FloatArray, route: SlabRoute, optics: SlabOptics) -> ArrivingWave:
    """The wave of an `element` (3,), or (lane, 3) of one for each point, [m] at the route's points; the length includes
    the slabs' bulk."""
    found = passage.arriving_wave(element, route, optics)
    bulk = np.zeros(len(route.point))
    for leg, slabs in zip(found.legs, route.slabs, strict=True):
        for slab in slabs:
            there = np.flatnonzero(slab.surface >= 0)
            cos, _, _ = polarisation_bases(leg[there], slab.normal[there])
            bulk[there] += optics.bulk(slab.surface[there], cos)
    return replace(found, length=found.length + bulk)


def polarised_field(
    field: FloatArray, arrival: ArrivingWave, route: SlabRoute, optics: SlabOptics, frequency: float
) -> ComplexArray:
    """(lane, 3) field at the points, without its phase by length, for an element whose field has direction `field`
    (3,); of unit strength one metre away in all directions."""
    first = arrival.legs[0]
    across = field - (first @ field)[:, None] * first
    found = (across / np.maximum(lengths(across), 1e-9)[:, None]).astype(np.complex128)
    for i, (leg, slabs) in enumerate(zip(arrival.legs, route.slabs, strict=True)):
        for slab in slabs:
            there = np.flatnonzero(slab.surface >= 0)
            cos, _, _ = polarisation_bases(leg[there], slab.normal[there])
            pair = optics.transmission(slab.surface[there], cos, frequency)
            found[there] = transmitted(found[there], leg[there], slab.normal[there], *pair)
        if i < len(route.mirrors):
            normal = arrival.normals[i]
            cos, _, _ = polarisation_bases(leg, normal)
            pair = optics.reflection(route.mirrors[i].surface, cos, frequency)
            found, _ = reflected(found, leg, normal, *pair)
    return np.asarray(found * arrival.spread[:, None])
