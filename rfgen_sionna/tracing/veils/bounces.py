"""Ghosts and corners behind slabs: what plates show of moving surfaces where a leg of the way goes through a wall, a
window or clothing. What is seen without them is left to :mod:`~rfgen_sionna.tracing.ghosts.ghosts` and
:mod:`~rfgen_sionna.tracing.bounces.bounces`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import cast

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import FloatArray
from rfgen_sionna.radar import Radar
from rfgen_sionna.scene.rays import RayScene
from rfgen_sionna.tracing.bounces.bounces import MOST_IMAGES, Bounces
from rfgen_sionna.tracing.bounces.landing import LandedFacets, Landing
from rfgen_sionna.tracing.bounces.shower import Shower
from rfgen_sionna.tracing.ghosts.image_band import ImageBand
from rfgen_sionna.tracing.ghosts.mirrors import Mirror
from rfgen_sionna.tracing.surface.facets import Facets
from rfgen_sionna.tracing.surface.surfaces import Surfaces
from rfgen_sionna.tracing.veils.landing import VeiledLandedFacets, VeiledLanding, VeiledLandingBand, VeiledShower
from rfgen_sionna.tracing.veils.veils import SKIPPED, Veils
from rfgen_sionna.tracing.veils.walk import Walk


class VeiledBounces(Bounces):
    """As :class:`~rfgen_sionna.tracing.bounces.bounces.Bounces`, through at least one slab, walls being plates as any
    other.

    Parameters
    ----------
    surfaces, radar, rtol, max_bounces
        As there.
    veils
        What can be seen through.
    """

    def __init__(self, surfaces: Surfaces, radar: Radar, rtol: float, max_bounces: int, veils: Veils) -> None:
        self._veils = veils
        super().__init__(surfaces, radar, rtol, max_bounces, tuple)

    def _chosen(self, t: float) -> list[int]:
        """Plates in which images are followed: the largest, walls among them."""
        there = [number for number, plate in enumerate(self.at(t)) if plate is not None]
        return sorted(there, key=lambda number: -self.flats[number].area)[:MOST_IMAGES]

    def _shower(self, t: float, rays: RayScene, facets: Facets) -> Shower:
        every = (*self._surfaces.static, *self._surfaces.moving)
        vertices = [*self._surfaces.static_vertices, *self._positions(t)]
        least = SKIPPED * self._rtol
        # A ghost may go through a slab on one of its ways alone.
        walk = Walk(rays, vertices, every, self._veils.through, least**2)
        given = rays, self.at(t), self.owner, self._viewpoint, facets, self._radar.max_range
        return VeiledShower(walk, self._veils.through, least, *given)

    def _straight(self, facets: Facets, fraction: FloatArray) -> NDArray[np.bool_]:
        return self._veils.faced(facets, self._veils.clear)

    def _joined(self, landings: Sequence[Landing]) -> Landing:
        return VeiledLanding.joined(cast(Sequence[VeiledLanding], landings))

    def _shown(
        self, facets: Sequence[Facets], keys: NDArray[np.int64], landings: Sequence[Landing], swapped: bool
    ) -> Sequence[LandedFacets]:
        return VeiledLandedFacets.over_time(facets, keys, cast(Sequence[VeiledLanding], landings), swapped)

    def _band(self, radar: Radar, rtol: float, mirrors: Sequence[Mirror], tx: bool, rx: bool) -> ImageBand:
        return VeiledLandingBand(self._veils.table, radar, rtol, mirrors, tx, rx)
