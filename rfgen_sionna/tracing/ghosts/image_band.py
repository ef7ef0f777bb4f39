"""Facet gains via plane mirrors, for every element pair over the sampled band."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import SPEED_OF_LIGHT, ComplexArray, FloatArray, IntArray
from rfgen_sionna.radar import Radar
from rfgen_sionna.scene.materials import Material
from rfgen_sionna.tracing.gains.band import BandTracer
from rfgen_sionna.tracing.ghosts.mirror_images import Mirror, SecondOrderImage, Unfolding
from rfgen_sionna.tracing.integral.facet import FacetGains, GainBuffer, Nodes, facet_gains, split_by_curvature
from rfgen_sionna.tracing.integral.mirror_lanes import MirrorLegs, MirrorPlanes
from rfgen_sionna.tracing.integral.obliquity import Media
from rfgen_sionna.tracing.surface.facets import Facets


@dataclass(frozen=True)
class MirroredFacets(Facets):
    """Facets with the mirrors of both legs; a facet appears once for each combination of mirrors."""

    first: IntArray
    """(facet,) mirror on the leg from Tx."""
    last: IntArray
    """(facet,) mirror on the leg to Rx."""

    @classmethod
    def of(cls, facets: Facets, index: NDArray[np.intp], first: IntArray, last: IntArray) -> MirroredFacets:
        """Facets of an `index` with their mirrors."""
        chosen = facets.take(index).with_pattern_gradient(None)
        return cls(**{each.name: getattr(chosen, each.name) for each in fields(Facets)}, first=first, last=last)

    def between(self, after: MirroredFacets, share: float) -> MirroredFacets:
        """Facets at a `share` of the time to `after`: the mirrors stay."""
        return self

    def take(self, index: NDArray[np.intp]) -> MirroredFacets:
        """Facets of an index."""
        return MirroredFacets.of(super().take(index), np.arange(len(index)), self.first[index], self.last[index])


class ImageBand(BandTracer):
    """A :class:`~rfgen_sionna.tracing.gains.band.BandTracer` for :class:`MirroredFacets`.

    `MirroredFacets.first` and `last` index `mirrors`; `tx` and `rx` put a mirror on the leg from Tx and that to Rx.
    """

    probe_facets = 4000
    tangents = False

    def __init__(self, radar: Radar, rtol: float, mirrors: Sequence[Mirror], tx: bool, rx: bool) -> None:
        super().__init__(radar, rtol)
        self.tx, self.rx = tx, rx
        self._mirrors = tuple(mirrors)
        self._normals = np.array([mirror.normal for mirror in mirrors]).reshape(-1, 3)
        self._offsets = np.array([float(mirror.height(self._origin)) for mirror in mirrors])
        self._unfolded = Unfolding(mirrors, self._origin)
        if tx != rx:  # not reciprocal
            self.expansions.powers = 1

    def lengths(self, centroids: FloatArray, visible_facets: MirroredFacets) -> FloatArray:
        """(tx, rx, facet) delays [s] via `centroids` (facet, 3) [m, world] and the facets' mirrors."""
        place = centroids - self._origin
        by_tx = self._unfolded(place, visible_facets.first) if self.tx else place
        by_rx = self._unfolded(place, visible_facets.last) if self.rx else place
        to_tx = np.linalg.norm(by_tx - self._tx[:, None], axis=2)
        to_rx = np.linalg.norm(by_rx - self._rx[:, None], axis=2)
        return np.asarray((to_tx[:, None] + to_rx) / SPEED_OF_LIGHT)

    def pair_delays(self, facets: Facets, pair: tuple[int, int]) -> FloatArray:
        """(facet,) reference delays [s] of one pair's gains."""
        if not isinstance(facets, MirroredFacets):
            raise TypeError(f"facets is a {type(facets).__name__}: MirroredFacets are needed")
        return np.asarray(self.lengths(facets.centroids, facets)[pair])

    def gains_via(
        self, places: FloatArray, facets: MirroredFacets, materials: tuple[Material, ...], nodes: Nodes
    ) -> ComplexArray:
        """(node, facet) gains with delays by `places` (facet, 3) [m, world]."""
        return self._at(facets, materials, nodes, facets.parts, places - self._origin).a

    def _gains(
        self, facets: Facets, materials: tuple[Material, ...], nodes: Nodes, parts: IntArray | None = None
    ) -> FacetGains:
        if not isinstance(facets, MirroredFacets):
            raise TypeError(f"facets is a {type(facets).__name__}: MirroredFacets are needed")
        return self._at(facets, materials, nodes, facets.parts if parts is None else parts)

    def _at(
        self,
        facets: MirroredFacets,
        materials: tuple[Material, ...],
        nodes: Nodes,
        parts: IntArray,
        reference: FloatArray | None = None,
    ) -> FacetGains:
        """Gains with delays by `reference` (facet, 3) [m] from the phase centre; None uses the centroids."""
        corners, media = facets.corners - self._origin, Media.at(materials, nodes.frequency, self.half_band)

        def of(index: NDArray[np.intp] | slice, curved: bool, buffer: GainBuffer | None) -> FacetGains:
            return facet_gains(
                corners[index],
                facets.surface[index],
                media,
                nodes,
                *self.fields,
                parts[index],
                reference=None if reference is None else reference[index],
                patch=facets.patch.take(index) if curved and facets.patch is not None else None,
                buffer=buffer,
                **self._by(facets, nodes, index),
            )

        return split_by_curvature(facets.curved, of)

    def _by(self, facets: MirroredFacets, nodes: Nodes, index: NDArray[np.intp] | slice) -> dict[str, Any]:
        """Leg arguments of :func:`facet_gains` for the facets `index`."""
        return {"via": self._via(nodes, facets.first[index], facets.last[index])}

    def _via(self, nodes: Nodes, first: IntArray, last: IntArray) -> MirrorLegs:
        def planes(mirrors: Sequence[Mirror]) -> MirrorPlanes:
            normals = np.array([mirror.normal for mirror in mirrors]).reshape(-1, 3)
            offsets = -np.array([float(mirror.height(self._origin)) for mirror in mirrors])
            materials = [mirror.material for mirror in mirrors]
            return MirrorPlanes(normals, offsets, Media.at(materials, nodes.frequency, self.half_band))

        before = [mirror.before for mirror in self._mirrors if isinstance(mirror, SecondOrderImage)]
        ways = first if self.tx else None, last if self.rx else None
        return MirrorLegs(planes(self._mirrors), planes(before) if before else None, *ways)
