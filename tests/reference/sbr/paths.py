"""Footprints as paths: who sends and receives, where from and where to, how fast, of what."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import SPEED_OF_LIGHT, ComplexArray, FloatArray
from rfgen_sionna.records import PathKind, RadarPaths
from rfgen_sionna.scene.mesh import unit
from rfgen_sionna.tracing.curved.array_elements import ArrayElements
from rfgen_sionna.tracing.surface.surfaces import Surface
from rfgen_sionna.tracing.tracer import Tracer
from tests.reference.sbr.hits import Hits, Index


def ends(hits: Hits, rows: Index) -> tuple[FloatArray, FloatArray]:
    """(tube, 3) unit vectors from the source towards the first and the last surface, for rows (tube, 6)."""
    row, own = rows[:, 3:], hits
    place = own.point[row].mean(axis=1)
    while own.before is not None:
        row, own = own.parent[row], own.before
    first, last = own.ray[row].mean(axis=1), place - hits.setting.source
    return unit(first), unit(last)


@dataclass(frozen=True)
class Scenery:
    """What paths are labelled and moved by."""

    surfaces: tuple[Surface, ...]
    names: tuple[tuple[str, ...], tuple[str, ...]]
    """Of objects and of parts."""
    velocities: tuple[FloatArray | None, ...]
    """Of each surface's vertices [m/s]; None where it stays."""
    t: float
    """Instant [s]."""
    frequency: float
    half_band: float

    @staticmethod
    def of(tracer: Tracer, velocities: list[FloatArray | None], t: float) -> Scenery:
        found, radar = tracer.surfaces, tracer.radar
        names = found.object_names, found.part_names
        half = 0.5 * radar.waveform.bandwidth
        return Scenery((*found.static, *found.moving), names, tuple(velocities), t, radar.center_frequency, half)

    def paths(
        self,
        hits: Hits,
        rows: Index,
        coefficients: ComplexArray,
        tau: FloatArray,
        ways: tuple[FloatArray, FloatArray],
    ) -> RadarPaths:
        """Of footprints `rows` (tube, 6), with (order, tx, rx, tube) gains and (tx, rx, tube) delays [s] and directions
        (tube, 3) in which they set out and from which they come."""
        count, order = len(rows), len(coefficients)
        surface, facet = hits.surface[rows[:, 0]], hits.facet[rows[:, 0]]
        face = (facet - np.array([each.first_facet for each in self.surfaces])[surface]).astype(np.int32)
        part = np.zeros(count, np.int32)
        for number in np.unique(surface):
            chosen = surface == number
            part[chosen] = self.surfaces[number].parts[face[chosen]]
        bounces = hits.reflections + 1
        rate = self.rates(hits, rows)
        return RadarPaths(
            a=coefficients[0][..., None],
            tau=tau[..., None],
            tau_rate=np.broadcast_to(rate[:, None], (*tau.shape, 1)).copy(),
            times=np.array([self.t]),
            frequency=self.frequency,
            direction=ways[0][:, None],
            arrival=ways[1][:, None],
            object_id=np.array([each.object_id for each in self.surfaces], np.int32)[surface],
            part_id=part,
            kind=np.full(count, PathKind.FACET if bounces == 1 else PathKind.MULTI_BOUNCE, np.uint8),
            bounces=np.full(count, bounces, np.uint8),
            object_names=self.names[0],
            part_names=self.names[1],
            facet=face,
            dispersion=coefficients[1:, ..., None] if order > 1 else None,
            half_band=self.half_band if order > 1 else 0.0,
        )

    def none(self, elements: ArrayElements) -> RadarPaths:
        """No paths at all."""
        shape = (len(elements.tx), len(elements.rx), 0, 1)
        empty, nowhere = np.zeros(0, np.int32), np.zeros((0, 1, 3))
        return RadarPaths(
            np.zeros(shape, np.complex128), np.zeros(shape), np.zeros(shape), np.array([self.t]), self.frequency,
            nowhere, nowhere, empty, empty, empty.astype(np.uint8), empty.astype(np.uint8), *self.names, empty,
        )  # fmt: skip

    def rates(self, hits: Hits, rows: Index) -> FloatArray:
        """(tube,) rate of the delay [s/s]: every surface moves the path's length by its velocity along the turn that
        the path takes there."""
        rate, row, own = np.zeros(len(rows)), rows, hits
        out = unit(hits.setting.source - own.point[row])
        while True:
            turn = own.ray[row] - out
            rate += np.einsum("pni,pni->pn", self._speed(own, row), turn)[:, 3:].mean(axis=1)
            if own.before is None:
                return rate / SPEED_OF_LIGHT
            out, row, own = own.ray[row], own.parent[row], own.before

    def _speed(self, hits: Hits, row: NDArray[np.intp]) -> FloatArray:
        """(..., 3) velocities of the points hit [m/s]."""
        found = np.zeros((*row.shape, 3))
        for number, speed in enumerate(self.velocities):
            if speed is None:
                continue
            at = hits.surface[row] == number
            face = hits.facet[row[at]] - self.surfaces[number].first_facet
            found[at] = np.einsum("rc,rci->ri", hits.weights[row[at]], speed[self.surfaces[number].faces[face]])
        return found
