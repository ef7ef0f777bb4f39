"""What slabs let through beside the edges of their shadows, which each pair of elements sees elsewhere
(:mod:`rfgen_sionna.tracing.shadows.parallax`).

A ray to a point that lies a little within the shadow tells which slabs are on the way there, one after the other.
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
from rfgen_sionna.tracing.gains.probes import PROBES
from rfgen_sionna.tracing.integral.slabs import NO_SLAB, transmission
from rfgen_sionna.tracing.moving.views import Seen
from rfgen_sionna.tracing.shadows.return_bounds import WIDEST
from rfgen_sionna.tracing.surface.facets import Facets
from rfgen_sionna.tracing.veils.veils import Veils

_WITHIN = 0.5
"""How far within the shadow rays go, over the way from the phase centre's edge to that of the outermost element, ..."""
_SURELY = (0.02, 0.1, 0.4)
"""... but so much of a facet's height at least, as far as its edge may not be where it is taken to be: further where
the ray before found nothing in its way."""
_NO_FURTHER = 0.3
"""... and no more than this share of the way there: it is as much nearer than the facet's plane."""
_COLUMNS = 2 * 2 * len(PROBES)


class SlabEdges:
    """Tells what comes through beside shadows' edges.

    Parameters
    ----------
    veils
        What can be seen through.
    band
        The radar's.
    only
        These surfaces are gone through; None is all.
    """

    def __init__(self, veils: Veils, band: BandTracer, only: Sequence[int] | None = None) -> None:
        self._veils, self._band, self._only = veils, band, only

    def __call__(
        self,
        rays: RayScene,
        vertices: Sequence[FloatArray],
        facets: Facets,
        owner: NDArray[np.intp],
        pieces: FloatArray,
        hider: FloatArray,
    ) -> tuple[FloatArray, int]:
        """`hider` (piece, 4) of :class:`rfgen_sionna.tracing.shadows.sampling.Sampled`, followed by what comes through
        the slabs that cast the shadows (piece, 12): :attr:`rfgen_sionna.tracing.shadows.edges.Edges.through`, real
        and imaginary parts in turn; and the number of rays sent. `owner` and `pieces` are those of the `facets` there
        as well, and `vertices` (vertex, 3) [m] those of all surfaces in the `rays`."""
        edged = np.flatnonzero(hider[:, 0] < 1.0)
        if not len(edged):
            return _appended(hider, np.zeros((len(owner), _COLUMNS))), 0
        found = np.zeros((len(owner), 2, len(PROBES)), np.complex128)
        band, viewpoint, walk = self._band, self._band.viewpoint, self._veils.walk(rays, vertices, self._only)
        corners = np.take(facets.corners, owner[edged], axis=0) - viewpoint
        start, stop = (np.einsum("ec,eci->ei", pieces[edged, corner], corners) for corner in (1, 2))
        middle, normal = 0.5 * (start + stop), np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        area, distance = lengths(normal), np.maximum(lengths(middle), 1e-9)
        inward = np.cross(normal, stop - start)
        inward /= np.maximum(lengths(inward), 1e-300)[:, None]
        upright = np.abs(np.einsum("ei,ei->e", normal, middle)) / np.maximum(area * distance, 1e-300)
        off = np.maximum(hider[edged, :2].mean(axis=1), 1e-3)
        width = band.reach * (1.0 - off) / (off * np.maximum(upright, 0.1))
        width = np.minimum(width, WIDEST * np.sqrt(SPEED_OF_LIGHT / band.highest * distance))
        height = np.sqrt(area)
        left = np.arange(len(edged))
        for surely in _SURELY:
            within = np.maximum(_WITHIN * width[left], surely * height[left])
            within = np.minimum(within, _NO_FURTHER * distance[left])
            towards = middle[left] - within[:, None] * inward[left]
            # What is bent is before the plane of its facet, a little.
            targets = viewpoint + (1.0 - within / distance[left])[:, None] * towards
            chain = walk(viewpoint, targets, None, facets.number[owner[edged[left]]])
            seen = np.flatnonzero(chain.free & (chain.crossed[:, 0] != NO_SLAB))
            k = towards[seen] / np.maximum(lengths(towards[seen]), 1e-12)[:, None]
            found[edged[left[seen]]] = self._coefficients(chain.crossed[seen], chain.normals[seen], k)
            left = left[chain.crossed[:, 0] == NO_SLAB]
            if not len(left):
                break
        return _appended(hider, found.reshape(len(found), -1).view(np.float64)), walk.sent

    def beside(self, rays: RayScene, vertices: Sequence[FloatArray], seen: Seen) -> Seen:
        """What is `seen`, with that."""
        hider, sent = self(rays, vertices, seen.facets, seen.owner, seen.pieces, seen.hider)
        return replace(seen, hider=hider, rays=seen.rays + sent)

    def _coefficients(self, crossed: NDArray[np.int64], normals: FloatArray, k: FloatArray) -> ComplexArray:
        """(way, 2, probe) what gets through the slabs `crossed` (way, depth) with `normals` (way, depth, 3) along unit
        vectors `k` (way, 3), once and twice, of waves with the elements' polarisations to something metal that looks at
        them."""
        found, table = np.ones((len(k), 2, len(PROBES)), np.complex128), self._veils.table
        for slab, normal in zip(crossed.T, normals.transpose(1, 0, 2), strict=True):
            across = np.cross(k, normal)
            sin2 = np.minimum((across**2).sum(axis=1), 1.0)
            across /= np.maximum(np.sqrt(sin2), 1e-9)[:, None]
            tx, rx = self._band.fields
            both = tx @ rx - (k @ tx) * (k @ rx)
            # Of fields across each other nothing comes back to the first order, and each polarisation is as good.
            s = np.full(len(k), 0.5)
            s = np.clip(np.divide((across @ tx) * (across @ rx), both, out=s, where=np.abs(both) > 1e-6), 0.0, 1.0)
            for each in np.unique(slab[slab != NO_SLAB]):
                mine = np.flatnonzero(slab == each)
                material, thickness = table.materials[each], float(table.thickness[each])
                for number, frequency in enumerate(self._band.frequency(PROBES).tolist()):
                    eps, mu = complex(material.relative_permittivity(frequency)), complex(material.permeability)
                    given = eps, mu, thickness, np.sqrt(1.0 - sin2[mine]), frequency, float(table.echoes[each])
                    t_s, t_p = transmission(*given)
                    found[mine, 0, number] *= s[mine] * t_s + (1.0 - s[mine]) * t_p
                    found[mine, 1, number] *= s[mine] * t_s**2 + (1.0 - s[mine]) * t_p**2
        return found


def carried_on(
    found: Seen, times: FloatArray, instants: FloatArray, known: Sequence[Seen], viewpoint: FloatArray
) -> Seen:
    """What is `found` at some `times` [s], facets of one after those of the other, with what slabs let through there,
    as of the nearest edge that is `known` at the nearest of the `instants` [s]; if that is known of them."""
    if known[0].hider.shape[1] == found.hider.shape[1]:
        return found
    through, edged = np.zeros((len(found.owner), _COLUMNS)), found.hider[:, 0] < 1.0
    of_time = found.owner // (len(found.facets) // len(times))
    for k, t in enumerate(times.tolist()):
        other = known[int(np.abs(instants - t).argmin())]
        here, there = np.flatnonzero(edged & (of_time == k)), np.flatnonzero(other.hider[:, 0] < 1.0)
        if len(here) and other.hider[there, -_COLUMNS:].any():
            nearest = cKDTree(_places(other, there, viewpoint)).query(_places(found, here, viewpoint))[1]
            through[here] = other.hider[there[nearest], -_COLUMNS:]
    return replace(found, hider=_appended(found.hider, through))


def _places(seen: Seen, edges: NDArray[np.intp], viewpoint: FloatArray) -> FloatArray:
    """(edge, 4) where edges are, and how far off what casts the shadow is [m]."""
    middle = 0.5 * seen.pieces[edges, 1:].sum(axis=1)
    places = np.einsum("ec,eci->ei", middle, np.take(seen.facets.corners, seen.owner[edges], axis=0)) - viewpoint
    return np.column_stack([places, seen.hider[edges, :2].mean(axis=1) * lengths(places)])


def _appended(hider: FloatArray, through: FloatArray) -> FloatArray:
    return np.concatenate([hider, through], axis=1)
