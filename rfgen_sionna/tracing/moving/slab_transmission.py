"""Transmission of slabs beside the boundaries of their shadows, which each element pair sees elsewhere
(:mod:`rfgen_sionna.tracing.shadows.boundary_edges`).

A ray to a point slightly within the shadow finds the slabs on the way.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from rfgen_sionna._types import SPEED_OF_LIGHT, ComplexArray, FloatArray
from rfgen_sionna.scene.mesh import lengths
from rfgen_sionna.scene.rays import RayScene
from rfgen_sionna.tracing.gains.band import BandTracer
from rfgen_sionna.tracing.gains.expansion import PROBES
from rfgen_sionna.tracing.integral.slabs import NO_SLAB, transmission
from rfgen_sionna.tracing.moving.visible_facets import VisibleFacets
from rfgen_sionna.tracing.shadows.return_bounds import MAX_BOUNDARY_WIDTH
from rfgen_sionna.tracing.surface.facets import Facets
from rfgen_sionna.tracing.transmission.transmission import Transmission

_WITHIN = 0.5
"""Depth of the ray's target within the shadow, over the shift of the boundary at the outermost element."""
_SURELY = (0.02, 0.1, 0.4)
"""Smallest depths over the facet's height, as the boundary is uncertain; the next one where a ray meets no slab."""
_MAX_EXTRAPOLATION = 0.3
"""Largest depth over the distance, as the target lies that much before the facet's plane."""
_COLUMNS = 2 * 2 * len(PROBES)


class SlabTransmission:
    """Finds the transmission beside shadow boundaries, of the surfaces `only`; None allows all."""

    def __init__(self, transmission_tracer: Transmission, band: BandTracer, only: Sequence[int] | None = None) -> None:
        self._transmission_tracer, self._band, self._only = transmission_tracer, band, only

    def __call__(
        self,
        rays: RayScene,
        vertices: Sequence[FloatArray],
        facets: Facets,
        owner: NDArray[np.intp],
        pieces: FloatArray,
        occluder: FloatArray,
    ) -> tuple[FloatArray, int]:
        """`occluder` (piece, 4) of :class:`rfgen_sionna.tracing.shadows.adaptive_sampling.SampledVisibility` with the
        transmission of the slabs that cast the shadows appended (piece, 12),
        :attr:`rfgen_sionna.tracing.shadows.boundary_edges.ShadowEdges.through` as real and imaginary parts in turn; and
        the number of rays. `vertices` (vertex, 3) [m] are those of all surfaces."""
        edged = np.flatnonzero(occluder[:, 0] < 1.0)
        if not len(edged):
            return _appended(occluder, np.zeros((len(owner), _COLUMNS))), 0
        found = np.zeros((len(owner), 2, len(PROBES)), np.complex128)
        band, viewpoint, slab_tracer = (
            self._band,
            self._band.viewpoint,
            self._transmission_tracer.slab_tracer(rays, vertices, self._only),
        )
        corners = np.take(facets.corners, owner[edged], axis=0) - viewpoint
        start, stop = (np.einsum("ec,eci->ei", pieces[edged, corner], corners) for corner in (1, 2))
        middle, normal = 0.5 * (start + stop), np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        area, distance = lengths(normal), np.maximum(lengths(middle), 1e-9)
        inward = np.cross(normal, stop - start)
        inward /= np.maximum(lengths(inward), 1e-300)[:, None]
        upright = np.abs(np.einsum("ei,ei->e", normal, middle)) / np.maximum(area * distance, 1e-300)
        off = np.maximum(occluder[edged, :2].mean(axis=1), 1e-3)
        width = band.reach * (1.0 - off) / (off * np.maximum(upright, 0.1))
        width = np.minimum(width, MAX_BOUNDARY_WIDTH * np.sqrt(SPEED_OF_LIGHT / band.highest * distance))
        height = np.sqrt(area)
        left = np.arange(len(edged))
        for surely in _SURELY:
            within = np.maximum(_WITHIN * width[left], surely * height[left])
            within = np.minimum(within, _MAX_EXTRAPOLATION * distance[left])
            towards = middle[left] - within[:, None] * inward[left]
            # Curved facets lie slightly before their plane.
            targets = viewpoint + (1.0 - within / distance[left])[:, None] * towards
            chain = slab_tracer(viewpoint, targets, None, facets.number[owner[edged[left]]])
            visible = np.flatnonzero(chain.unblocked & (chain.crossed[:, 0] != NO_SLAB))
            k = towards[visible] / np.maximum(lengths(towards[visible]), 1e-12)[:, None]
            found[edged[left[visible]]] = self._coefficients(chain.crossed[visible], chain.normals[visible], k)
            left = left[chain.crossed[:, 0] == NO_SLAB]
            if not len(left):
                break
        return _appended(occluder, found.reshape(len(found), -1).view(np.float64)), slab_tracer.sent

    def with_transmission(
        self, rays: RayScene, vertices: Sequence[FloatArray], visible: VisibleFacets
    ) -> VisibleFacets:
        """The same visibility with the transmission."""
        occluder, sent = self(rays, vertices, visible.facets, visible.owner, visible.pieces, visible.occluder)
        return replace(visible, occluder=occluder, rays=visible.rays + sent)

    def _coefficients(self, crossed: NDArray[np.int64], normals: FloatArray, k: FloatArray) -> ComplexArray:
        """(way, 2, probe) coefficients of the slabs `crossed` (way, depth) with `normals` (way, depth, 3) along unit
        vectors `k` (way, 3), one-way and two-way, of the elements' polarisations towards metal at normal incidence."""
        found, table = np.ones((len(k), 2, len(PROBES)), np.complex128), self._transmission_tracer.table
        for slab, normal in zip(crossed.T, normals.transpose(1, 0, 2), strict=True):
            across = np.cross(k, normal)
            sin2 = np.minimum((across**2).sum(axis=1), 1.0)
            across /= np.maximum(np.sqrt(sin2), 1e-9)[:, None]
            tx, rx = self._band.fields
            both = tx @ rx - (k @ tx) * (k @ rx)
            # Orthogonal fields return nothing to first order; both polarisations count alike.
            s = np.full(len(k), 0.5)
            s = np.clip(np.divide((across @ tx) * (across @ rx), both, out=s, where=np.abs(both) > 1e-6), 0.0, 1.0)
            for each in np.unique(slab[slab != NO_SLAB]):
                mine = np.flatnonzero(slab == each)
                material, thickness = table.materials[each], float(table.thickness[each])
                for number, frequency in enumerate(self._band.frequency(PROBES).tolist()):
                    eps, mu = complex(material.relative_permittivity(frequency)), complex(material.permeability)
                    given = (
                        eps,
                        mu,
                        thickness,
                        np.sqrt(1.0 - sin2[mine]),
                        frequency,
                        float(table.internal_reflections[each]),
                    )
                    t_s, t_p = transmission(*given)
                    found[mine, 0, number] *= s[mine] * t_s + (1.0 - s[mine]) * t_p
                    found[mine, 1, number] *= s[mine] * t_s**2 + (1.0 - s[mine]) * t_p**2
        return found


def interpolate_transmission(
    found: VisibleFacets,
    times: FloatArray,
    sample_times: FloatArray,
    known: Sequence[VisibleFacets],
    viewpoint: FloatArray,
) -> VisibleFacets:
    """Visibility at `times` [s], time by time, with the transmission of the nearest boundary that is `known` at the
    nearest of the `sample_times` [s], if any."""
    if known[0].occluder.shape[1] == found.occluder.shape[1]:
        return found
    through, edged = np.zeros((len(found.owner), _COLUMNS)), found.occluder[:, 0] < 1.0
    of_time = found.owner // (len(found.facets) // len(times))
    for k, t in enumerate(times.tolist()):
        other = known[int(np.abs(sample_times - t).argmin())]
        here, there = np.flatnonzero(edged & (of_time == k)), np.flatnonzero(other.occluder[:, 0] < 1.0)
        if len(here) and other.occluder[there, -_COLUMNS:].any():
            nearest = cKDTree(_places(other, there, viewpoint)).query(_places(found, here, viewpoint))[1]
            through[here] = other.occluder[there[nearest], -_COLUMNS:]
    return replace(found, occluder=_appended(found.occluder, through))


def _places(visible: VisibleFacets, edges: NDArray[np.intp], viewpoint: FloatArray) -> FloatArray:
    """(edge, 4) positions of boundaries and distances of their occluders [m]."""
    middle = 0.5 * visible.pieces[edges, 1:].sum(axis=1)
    places = np.einsum("ec,eci->ei", middle, np.take(visible.facets.corners, visible.owner[edges], axis=0)) - viewpoint
    return np.column_stack([places, visible.occluder[edges, :2].mean(axis=1) * lengths(places)])


def _appended(occluder: FloatArray, through: FloatArray) -> FloatArray:
    return np.concatenate([occluder, through], axis=1)
