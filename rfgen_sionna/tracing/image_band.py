"""Facet gains by way of plane mirrors, for every element pair over the sampled band."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna.radar import Radar
from rfgen_sionna.records import SPEED_OF_LIGHT, FloatArray, IntArray
from rfgen_sionna.scene.materials import Material
from rfgen_sionna.tracing.facet import FacetGains, Nodes, facet_gains
from rfgen_sionna.tracing.facets import Facets
from rfgen_sionna.tracing.gains import BandTracer
from rfgen_sionna.tracing.mirrors import Mirror
from rfgen_sionna.tracing.obliquity import Media
from rfgen_sionna.tracing.reflected import Via


@dataclass(frozen=True)
class MirroredFacets(Facets):
    """Facets, each as one mirror shows it: a facet that several show is there several times."""

    mirror: IntArray
    """(facet,) index of the mirror."""

    @classmethod
    def of(cls, facets: Facets, index: NDArray[np.intp], mirror: IntArray) -> MirroredFacets:
        """The facets that `index` counts out, each by its `mirror`."""
        chosen = facets.take(index)
        return cls(**{each.name: getattr(chosen, each.name) for each in fields(Facets)}, mirror=mirror)

    def take(self, index: NDArray[np.intp]) -> MirroredFacets:
        """The facets that `index` counts out."""
        return MirroredFacets.of(super().take(index), np.arange(len(index)), self.mirror[index])


class ImageBand(BandTracer):
    """As :class:`~rfgen_sionna.tracing.gains.BandTracer`, for :class:`MirroredFacets`.

    Parameters
    ----------
    radar, rtol
        As there.
    mirrors
        What `MirroredFacets.mirror` counts out of.
    tx, rx
        Whether the way from Tx, and that to Rx, goes by the mirror.
    """

    enough = 4000

    def __init__(self, radar: Radar, rtol: float, mirrors: Sequence[Mirror], tx: bool, rx: bool) -> None:
        super().__init__(radar, rtol)
        self.tx, self.rx = tx, rx
        self._mirrors = tuple(mirrors)
        self._normals = np.stack([mirror.normal for mirror in mirrors])
        self._offsets = np.array([mirror.height(self._origin) for mirror in mirrors])
        if tx != rx:  # Tx and Rx changed over make another path
            self._powers = 1

    def lengths(self, centroids: FloatArray, mirror: IntArray) -> FloatArray:
        """(tx, rx, facet) delays [s] by way of `centroids` (facet, 3) [m, world], each by its mirror."""
        place = centroids - self._origin
        height = np.einsum("fi,fi->f", place, self._normals[mirror]) + self._offsets[mirror]
        mirrored = place - 2.0 * height[:, None] * self._normals[mirror]
        to_tx = np.linalg.norm((mirrored if self.tx else place) - self._tx[:, None], axis=2)
        to_rx = np.linalg.norm((mirrored if self.rx else place) - self._rx[:, None], axis=2)
        return np.asarray((to_tx[:, None] + to_rx) / SPEED_OF_LIGHT)

    def _gains(
        self, facets: Facets, materials: tuple[Material, ...], nodes: Nodes, parts: IntArray | None = None
    ) -> FacetGains:
        if not isinstance(facets, MirroredFacets):
            raise TypeError(f"facets is a {type(facets).__name__}: MirroredFacets are needed")
        walls = Media.at([mirror.material for mirror in self._mirrors], nodes.frequency, self.half_band)
        via = Via(facets.mirror, self._normals, -self._offsets, walls, self.tx, self.rx)
        return facet_gains(
            facets.corners - self._origin,
            facets.surface,
            Media.at(materials, nodes.frequency, self.half_band),
            nodes,
            *self._fields,
            facets.parts if parts is None else parts,
            via=via,
        )
