"""Moving surfaces of a run, and the radar that sees them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from rfgen_sionna._types import SPEED_OF_LIGHT, FloatArray, IntArray
from rfgen_sionna.scene.mesh import lengths
from rfgen_sionna.tracing.direct.expansion_choice import node_table
from rfgen_sionna.tracing.direct.samples import (
    GainNodes,
    Positions,
    Sampler,
)
from rfgen_sionna.tracing.direct.settings import Settings
from rfgen_sionna.tracing.gains.band import MONOSTATIC, BandTracer
from rfgen_sionna.tracing.gains.diffuse import grain_of
from rfgen_sionna.tracing.integral.fresnel import media_table
from rfgen_sionna.tracing.integral.obliquity import Media
from rfgen_sionna.tracing.legs.slab_scene import SlabScene
from rfgen_sionna.tracing.surface.facet_mesh import FacetMesh
from rfgen_sionna.tracing.surface.surfaces import Surface, tolerance_groups
from rfgen_sionna.tracing.surface.tessellate import tessellate

FINE_PARALLAX, COARSE_PARALLAX, FINE_RTOL = 0.1, 2.0, 0.03
"""Shift of a shadow boundary at the outermost elements over the Fresnel zone above which Tx and Rx have their own
visibility: up to the tolerance given third, and above."""
RANGE_MARGIN = 1.1
"""Range of tessellation over the range window: facets may enter it during the run."""


@dataclass(frozen=True)
class RunScene:
    """Moving surfaces of a run, and the radar that sees them."""

    surfaces: tuple[Surface, ...]
    band: BandTracer
    max_range: float
    rtol: float
    positions: Positions
    static: FloatArray = field(default_factory=lambda: np.zeros((0, 3, 3)))
    """(facet, 3, 3) corners [m] of visible facets at rest, relative to the viewpoint."""
    slabs: SlabScene | None = None
    """Slabs that transmit; None means that all surfaces occlude."""
    group: IntArray = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "group", tolerance_groups(self.surfaces))

    @property
    def wavelength(self) -> float:
        """At the middle of the band [m]."""
        return SPEED_OF_LIGHT / self.band.centre

    @property
    def wavenumber(self) -> float:
        """Largest wavenumber [rad/m]."""
        return 2 * np.pi * self.band.highest / SPEED_OF_LIGHT

    def mesh(self, vertices: Sequence[FloatArray], rtol: float) -> FacetMesh:
        """Facets fine enough for `vertices` (vertex, 3) [m] of each surface and a tolerance `rtol`."""
        band = self.band
        pieces = [
            tessellate(
                points, surface.faces, band.viewpoint, band.highest, rtol, band.pattern_gain,
                RANGE_MARGIN * self.max_range, band.half_band, smooth=surface.smooth, grain=grain_of(surface),
            )
            for points, surface in zip(vertices, self.surfaces, strict=True)
        ]  # fmt: skip
        return FacetMesh.of(self.surfaces, pieces, [len(points) for points in vertices])

    def sampler(self, mesh: FacetMesh, settings: Settings) -> Sampler:
        """Samples a `mesh` with these `settings`."""
        known = self.positions, self.band.viewpoint, self.max_range
        return Sampler(mesh, *known, settings.resolution, self.static, self.slabs)

    def nodes(self, table: FloatArray, nearest: float, parallax: bool) -> GainNodes:
        """Nodes of a `table` (node, 7) for facets that are `nearest` [m] at least, seen from Tx and Rx themselves where
        the `parallax` of the array counts, else from the phase centre."""
        band = self.band
        frequency = table[:, 6] * SPEED_OF_LIGHT / (2 * np.pi)
        media = media_table(Media.at([each.material for each in self.surfaces], frequency, band.half_band))
        monostatic = band.alike and band.baseline**2 < MONOSTATIC * self.rtol * nearest**2
        places = np.zeros((1, 3))
        place: IntArray = np.zeros((len(table), 2), np.int32)
        if parallax:
            places, number = np.unique(
                np.concatenate([table[:, :3], table[:, 3:6], places]), axis=0, return_inverse=True
            )
            place = number.reshape(-1)[:-1].reshape(2, -1).T.astype(np.int32)
        return GainNodes(np.ascontiguousarray(table), media, np.stack(band.fields), not monostatic, places, place)

    def has_parallax(self, poses: Sequence[Sequence[FloatArray]]) -> bool:
        """Whether shadow boundaries move between elements by a share of a Fresnel zone that counts, for positions
        (vertex, 3) [m] of the surfaces in some `poses`; not through slabs."""
        if self.slabs is not None:
            return False
        for pose in poses:
            every = [points - self.band.viewpoint for points in pose]
            moving = [points for points in every if lengths(points).min(initial=np.inf) < self.max_range]
            cones = [_cone(points[None]) for points in moving]
            for points, (axis, wide) in zip(moving, cones, strict=True):
                occluders = [
                    other for other, (to, apart) in zip(moving, cones, strict=True)
                    if np.arccos(np.clip(axis[0] @ to[0], -1.0, 1.0)) <= wide[0] + apart[0]
                ]  # fmt: skip
                if self._shift(min(float(lengths(each).min()) for each in occluders), points) or (
                    len(static := self._in_front(points)) and self._shift(float(lengths(static).min()), points)
                ):
                    return True
        return False

    def _shift(self, near: float, points: FloatArray) -> bool:
        """Whether shadow boundaries of what is `near` [m] move by a share of a Fresnel zone that counts on surfaces at
        `points` (point, 3) [m]."""
        near, far = max(near, 1e-3), float(lengths(points).max())
        if far <= near:
            return False
        zone = np.sqrt(SPEED_OF_LIGHT / self.band.highest * near * (far - near) / (2.0 * far))
        share = FINE_PARALLAX if self.rtol <= FINE_RTOL else COARSE_PARALLAX
        return bool(self.band.reach * (far - near) / near > share * zone)

    def _in_front(self, points: FloatArray) -> FloatArray:
        """(corner, 3) corners [m] of facets at rest that reach into the cone around `points` (point, 3) [m] and are
        before them, both relative to the viewpoint."""
        to, apart = _cone(points[None])
        towards, wide = _cone(self.static)
        inside = np.arccos(np.clip(towards @ to[0], -1.0, 1.0)) <= wide + apart[0]
        corners = self.static[inside].reshape(-1, 3)
        return corners[lengths(corners) < lengths(points).max()]

    def distances(self, vertices: Sequence[FloatArray]) -> list[float]:
        """Distance [m] of the nearest of the `vertices` (vertex, 3) [m] of each surface."""
        return [float(lengths(points - self.band.viewpoint).min(initial=np.inf)) for points in vertices]

    def probe_nodes(self, u: FloatArray, pairs: IntArray) -> FloatArray:
        """(probe, 7) table of element `pairs` (probe,) at positions `u` (probe,) of the band."""
        return node_table(self.band.expansions.nodes(u, pairs))

    def gradient(self, centroids: FloatArray, needed: bool) -> FloatArray:
        """(facet, 3) gradient of the logarithm of the pattern gain at `centroids` (facet, 3) [m]; empty where it is not
        `needed` or zero."""
        found = self.band.pattern_gradients(centroids) if needed and len(centroids) else None
        return np.zeros((0, 3)) if found is None else found

    def pattern(self, centroids: FloatArray) -> FloatArray:
        """(facet,) two-way field gain over its peak towards `centroids` (facet, 3) [m] relative to the viewpoint."""
        away = np.maximum(lengths(centroids), 1e-12)
        return self.band.pattern_gain(centroids / away[:, None])


def _cone(points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(set, 3) axes and (set,) half angles [rad] of cones from the viewpoint around `points` (set, point, 3) [m]."""
    away = points / np.maximum(np.linalg.norm(points, axis=2, keepdims=True), 1e-12)
    axes = away.mean(axis=1)
    axes /= np.maximum(lengths(axes)[:, None], 1e-12)
    return axes, np.arccos(np.clip(np.einsum("spi,si->sp", away, axes).min(axis=1, initial=1.0), -1.0, 1.0))
