"""Slabs of a scene: which surfaces transmit, and the tables and delays of the legs that cross them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from rfgen_sionna._types import SPEED_OF_LIGHT, FloatArray, IntArray
from rfgen_sionna.tracing.integral.fresnel import media_table
from rfgen_sionna.tracing.integral.obliquity import Media
from rfgen_sionna.tracing.integral.slabs import SlabTable
from rfgen_sionna.tracing.legs.leg_visibility import Crossings, LegOccluders
from rfgen_sionna.tracing.surface.surfaces import Surface


@dataclass(frozen=True)
class SlabScene:
    """Surfaces of a scene, static ones first, some of which transmit."""

    table: SlabTable
    occluders: LegOccluders
    half_band: float
    """[Hz]"""

    @staticmethod
    def of(
        static: Sequence[Surface],
        moving: Sequence[Surface],
        vertices: Sequence[FloatArray],
        centre: float,
        half_band: float,
        least: float,
    ) -> SlabScene:
        """Scene with static `vertices` (vertex, 3) [m] relative to the viewpoint, for a band of `half_band` [Hz] to
        both sides of `centre` [Hz]. Surfaces transmit that leave more than the amplitude `least`."""
        table = SlabTable.of([each.material for each in (*static, *moving)], centre, half_band)
        through = np.max([table.strength(centre + u * half_band) for u in (-1.0, 0.0, 1.0)], axis=0)
        transmits = through > least
        opaque, slabs, surface = [np.zeros((0, 3, 3))], [np.zeros((0, 3, 3))], [np.zeros(0, np.int32)]
        for number, (each, points) in enumerate(zip(static, vertices, strict=True)):
            corners = points[each.faces]
            (slabs if transmits[number] else opaque).append(corners)
            if transmits[number]:
                surface.append(np.full(len(corners), number, np.int32))
        moving_slabs = tuple(transmits[len(static) :].tolist())
        occluders = LegOccluders(
            np.concatenate(opaque), np.concatenate(slabs), np.concatenate(surface), len(static), moving_slabs
        )
        return SlabScene(table, occluders, half_band)

    def leg_tables(self, legs: tuple[Crossings, Crossings], frequency: FloatArray) -> dict[str, Any]:
        """Entries of :class:`rfgen_sionna.tracing.integral.leg_fields.LegTables` at node frequencies (node,) [Hz]."""
        depth = max(each.surface.shape[1] for each in legs)

        def joined(name: str, fill: float) -> Any:
            found = []
            for each in legs:
                own = getattr(each, name)
                wide = np.full((len(own), depth, *own.shape[2:]), fill, own.dtype)
                wide[:, : own.shape[1]] = own
                found.append(wide)
            return np.stack(found)

        media = media_table(Media.at(self.table.materials, frequency, self.half_band))
        table = np.column_stack([self.table.thickness, self.table.index2, self.table.internal_reflections])
        return {
            "slab": joined("surface", -1), "segment": joined("segment", -1), "slab_normals": joined("normals", 0.0),
            "cover": joined("cover", 0.0), "slab_media": np.ascontiguousarray(media[..., :4]), "slab_table": table,
        }  # fmt: skip

    def delays(self, crossed: Crossings, elements: FloatArray, points: FloatArray) -> FloatArray:
        """(element, facet) delays [s] of the slabs between (images of) `elements` (element, 3) and `points` (facet, 3)
        [m], both in the space of the last segment."""
        found = np.zeros((len(elements), len(points)))
        some = np.flatnonzero((crossed.surface >= 0).any(axis=1))
        if len(some):
            offset = points[some] - elements[:, None]
            k = offset / np.maximum(np.linalg.norm(offset, axis=2, keepdims=True), 1e-12)
            own = crossed.take(some)
            for depth in range(own.surface.shape[1]):
                there: IntArray = own.surface[:, depth]
                slab = np.maximum(there, 0)
                cosine = np.einsum("efi,fi->ef", k, own.normals[:, depth])
                sine2 = np.maximum(1.0 - cosine**2, 0.0)
                bulk = self.table.thickness[slab] * np.sqrt(np.maximum(self.table.index2[slab] - sine2, 0.0))
                found[:, some] += np.where(there >= 0, own.cover[:, depth] * bulk, 0.0) / SPEED_OF_LIGHT
        return found
