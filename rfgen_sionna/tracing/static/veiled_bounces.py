"""What the static scene's flat parts show through slabs: furniture behind a partition, and corners there."""

from __future__ import annotations

from collections.abc import Sequence
from typing import cast

import numpy as np

from rfgen_sionna._types import FloatArray, IntArray
from rfgen_sionna.radar import Radar
from rfgen_sionna.records import RadarPaths
from rfgen_sionna.scene.rays import RayScene
from rfgen_sionna.tracing.bounces.landing import LandedFacets, Landing
from rfgen_sionna.tracing.bounces.plates import Plate
from rfgen_sionna.tracing.gains.band import BandTracer
from rfgen_sionna.tracing.ghosts.image_band import ImageBand
from rfgen_sionna.tracing.ghosts.mirrors import Mirror
from rfgen_sionna.tracing.static.bounces import Showing, StaticBounces, trace_shown
from rfgen_sionna.tracing.static.trace import StaticTrace
from rfgen_sionna.tracing.surface.facets import Facets
from rfgen_sionna.tracing.surface.surfaces import Surfaces
from rfgen_sionna.tracing.veils.landing import VeiledLandedFacets, VeiledLanding, VeiledLandingBand, VeiledShower
from rfgen_sionna.tracing.veils.veils import SKIPPED, Veils
from rfgen_sionna.tracing.veils.walk import Walk


class StaticVeiledBounces(StaticBounces):
    """Paths of two and three bounces through at least one slab within the static scene, a single knot."""

    def _all_pieces(self) -> Landing:
        plain, landings = super()._all_pieces(), cast(Sequence[VeiledLanding], self.landings)
        return VeiledLanding(
            plain.facet, plain.first, plain.last, plain.pieces, plain.owner, plain.share,
            crossed=np.concatenate([each.crossed for each in landings]),
            across=np.concatenate([each.across for each in landings]),
        )  # fmt: skip


def trace_static_veiled_bounces(
    surfaces: Surfaces,
    rays: RayScene,
    radar: Radar,
    band: BandTracer,
    static: StaticTrace,
    through: RadarPaths | None,
    rtol: float,
    most: int,
) -> StaticBounces | None:
    """As :func:`~rfgen_sionna.tracing.static.bounces.trace_static_bounces`, for ways through static slabs; `through`
    are the paths that go straight through them."""
    every, names = (*surfaces.static, *surfaces.moving), (surfaces.object_names, surfaces.part_names)
    veils = Veils(every, surfaces.static, names, radar, rtol)
    count = len(surfaces.static)
    if not veils.possible(range(count), one_way=True):
        return None
    gone_through = np.where(np.arange(len(every)) < count, veils.through, 0.0)
    # Nothing of what moves is gone through: any vertices of it will do.
    vertices = [*surfaces.static_vertices, *(np.zeros((int(each.faces.max()) + 1, 3)) for each in surfaces.moving)]
    view, least = np.asarray(radar.position), SKIPPED * rtol

    def shower(plates: Sequence[Plate | None], owner: IntArray, facets: Facets) -> VeiledShower:
        walk = Walk(rays, vertices, every, gone_through, least**2)
        return VeiledShower(walk, gone_through, least, rays, plates, owner, view, facets, radar.max_range)

    def made_of(radar: Radar, rtol: float, mirrors: Sequence[Mirror], tx: bool, rx: bool) -> ImageBand:
        return VeiledLandingBand(veils.table, radar, rtol, mirrors, tx, rx)

    def joined(landings: Sequence[Landing]) -> Landing:
        return VeiledLanding.joined(cast(Sequence[VeiledLanding], landings))

    def landed(facets: Facets, landing: Landing, swapped: bool) -> LandedFacets:
        veiled = cast(VeiledLanding, landing)
        (found,) = VeiledLandedFacets.over_time([facets], veiled.keys, [veiled], swapped)
        return found

    levels = static.levels if through is None else np.maximum(static.levels, _levels(surfaces, through))
    showing = Showing(_whole(static), levels, shower, made_of, joined, landed, StaticVeiledBounces)
    return trace_shown(showing, surfaces, radar, band, static, rtol, most)


def _whole(static: StaticTrace) -> Facets:
    """All facets that face the radar, seen or hidden, none of them cut."""
    clear = np.flatnonzero(static.fraction[: static.whole] == 1)
    return Facets.joined([static.facets.take(clear), static.hidden])


def _levels(surfaces: Surfaces, paths: RadarPaths) -> FloatArray:
    """(surface,) what straight ways through slabs bring of each, as if nothing interfered."""
    power = np.abs(paths.a[0, 0, :, 0]) ** 2
    return np.sqrt(np.bincount(paths.object_id, power, len(surfaces.static)))
