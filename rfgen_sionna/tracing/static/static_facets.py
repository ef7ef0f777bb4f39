"""Facets of the static scene."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from rfgen_sionna._types import SPEED_OF_LIGHT, FloatArray
from rfgen_sionna.tracing.gains.band import BandTracer
from rfgen_sionna.tracing.surface.facets import Facets, stack_facets, with_patches
from rfgen_sionna.tracing.surface.surfaces import Surfaces
from rfgen_sionna.tracing.surface.tessellate import NO_FACETS, tessellate


def static_facets(
    surfaces: Surfaces,
    band: BandTracer,
    viewpoint: FloatArray,
    tolerance: FloatArray,
    max_range: float,
    chosen: Collection[int] | None = None,
) -> Facets:
    """All facets of the static surfaces, or of those `chosen`, made for the `tolerance` (surface,) of each and as far
    as `max_range` [m]: seen or not, whichever way they look."""
    pieces = [
        tessellate(
            points,
            surface.faces,
            viewpoint,
            band.highest,
            rtol,
            band.pattern_gain,
            max_range,
            band.half_band,
            smooth=surface.smooth,
            still=True,
        )
        if chosen is None or number in chosen
        else NO_FACETS
        for number, (points, surface, rtol) in enumerate(
            zip(surfaces.static_vertices, surfaces.static, tolerance.tolist(), strict=True)
        )
    ]
    wavenumber = 2 * np.pi * band.highest / SPEED_OF_LIGHT
    flat = stack_facets(surfaces.static, pieces, [surfaces.static_vertices], viewpoint, wavenumber)
    (found,) = with_patches(flat, surfaces.static, pieces, [surfaces.static_vertices])
    return found
