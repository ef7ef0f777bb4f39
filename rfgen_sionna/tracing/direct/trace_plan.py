"""Plan of a run: facets, expansion and settings that meet the tolerance, with their measured errors.

The plan depends on the run alone, not on the order in which its intervals are traced.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import SPEED_OF_LIGHT, ComplexArray, FloatArray, IntArray
from rfgen_sionna.scene.mesh import lengths
from rfgen_sionna.tracing.direct.expansion_choice import first_pair
from rfgen_sionna.tracing.direct.samples import (
    GainNodes,
    Positions,
    Sample,
    Sampler,
    choose_facets,
    integrate,
    pair_delays,
)
from rfgen_sionna.tracing.direct.settings import Settings
from rfgen_sionna.tracing.gains.band import MONOSTATIC, BandTracer
from rfgen_sionna.tracing.gains.diffuse import grain_of
from rfgen_sionna.tracing.gains.expansion import Expansion
from rfgen_sionna.tracing.integral.fresnel import media_table
from rfgen_sionna.tracing.integral.obliquity import Media
from rfgen_sionna.tracing.surface.facet_mesh import FacetMesh
from rfgen_sionna.tracing.surface.surfaces import Surface, actor_groups
from rfgen_sionna.tracing.surface.tessellate import tessellate
from rfgen_sionna.tracing.visibility.static_items import StaticItems

SAFETY = 1.5
"""Factor on errors measured at a few times, pairs and frequencies, for all others."""
TIME_PER_RTOL = 1.0
"""Allowed error between knots per unit of the tolerance."""
FINE_PARALLAX, COARSE_PARALLAX, FINE_RTOL = 0.1, 0.5, 0.03
"""Shift of a shadow boundary at the outermost elements over the Fresnel zone above which each node has its own
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
    static: StaticItems = field(default_factory=StaticItems)
    group: IntArray = field(init=False)
    """(surface,) first surface of each one's tolerance group: the parts of an actor are one."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "group", actor_groups(self.surfaces))

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
        return Sampler(mesh, *known, settings.resolution, self.static, self.group)

    def nodes(self, table: FloatArray, nearest: float, parallax: bool) -> GainNodes:
        """Nodes of a `table` (node, 7) for facets that are `nearest` [m] at least, each with its own visibility where
        the `parallax` of the array counts."""
        band = self.band
        frequency = table[:, 6] * SPEED_OF_LIGHT / (2 * np.pi)
        media = media_table(Media.at([each.material for each in self.surfaces], frequency, band.half_band))
        monostatic = band.alike and band.baseline**2 < MONOSTATIC * self.rtol * nearest**2
        places = np.zeros((1, 3))
        place: IntArray = np.zeros(len(table), np.int32)
        if parallax:
            places, number = np.unique(0.5 * (table[:, :3] + table[:, 3:6]), axis=0, return_inverse=True)
            place = number.reshape(-1).astype(np.int32)
        return GainNodes(np.ascontiguousarray(table), media, np.stack(band.fields), not monostatic, places, place)

    def has_parallax(self, poses: Sequence[Sequence[FloatArray]]) -> bool:
        """Whether shadow boundaries move between elements by a share of a Fresnel zone that counts, for positions
        (vertex, 3) [m] of the surfaces in some `poses`."""
        away = [lengths(points - self.band.viewpoint) for pose in poses for points in pose if len(points)]
        if not away:
            return False
        moving = len(away)
        if len(self.static):
            away.append(lengths(self.static.corners.reshape(-1, 3)))
        near = max(min(float(each.min()) for each in away), 1e-3)
        far = max(float(each.max()) for each in away[:moving])
        if far <= near:
            return False
        zone = np.sqrt(SPEED_OF_LIGHT / self.band.highest * near * (far - near) / (2.0 * far))
        share = FINE_PARALLAX if self.rtol <= FINE_RTOL else COARSE_PARALLAX
        return bool(0.5 * self.band.aperture * (far - near) / near > share * zone)

    def distances(self, vertices: Sequence[FloatArray]) -> list[float]:
        """Distance [m] of the nearest of the `vertices` (vertex, 3) [m] of each surface."""
        return [float(lengths(points - self.band.viewpoint).min(initial=np.inf)) for points in vertices]

    def probe_nodes(self, u: FloatArray, pairs: IntArray) -> FloatArray:
        """(probe, 7) table of element `pairs` (probe,) at positions `u` (probe,) of the band."""
        nodes = self.band.expansions.nodes(u, pairs)
        return np.hstack([nodes.tx, nodes.rx, 2 * np.pi / SPEED_OF_LIGHT * nodes.frequency[:, None]])

    def gradient(self, centroids: FloatArray, needed: bool) -> FloatArray:
        """(facet, 3) gradient of the logarithm of the pattern gain at `centroids` (facet, 3) [m]; empty where it is not
        `needed` or zero."""
        found = self.band.pattern_gradients(centroids) if needed and len(centroids) else None
        return np.zeros((0, 3)) if found is None else found

    def pattern(self, centroids: FloatArray) -> FloatArray:
        """(facet,) two-way field gain over its peak towards `centroids` (facet, 3) [m] relative to the viewpoint."""
        away = np.maximum(lengths(centroids), 1e-12)
        return self.band.pattern_gain(centroids / away[:, None])


@dataclass(frozen=True)
class TracePlan:
    """Facets, expansion and settings of a run."""

    scene: RunScene
    settings: Settings
    mesh: FacetMesh
    material: IntArray
    """(face,) index of the material of each face, that of its surface."""
    expansion: Expansion
    nodes: GainNodes
    steep: bool
    """Whether the pattern gain changes over facets."""
    error: float
    """Measured error of the worst actor's return at single times."""
    knots: int
    """Number of knots of an interval."""
    time_error: float
    """Measured error between knots."""
    time_scale: float
    """That error over the error of predictions of single knots."""
    cull: bool
    """Whether facets that are negligible for the antennas are omitted."""
    nearest: FloatArray
    """(surface,) least distance [m] for which the facets are made."""
    level: FloatArray
    """(group,) typical return of the first pair; 0 where unknown."""
    surface: float
    """Change of the worst return if quads of smooth meshes were cut along the other diagonal."""

    def holds(self, t: float) -> bool:
        """Whether the facets fit the distances of all surfaces at `t` [s]."""
        away = np.array(self.scene.distances(self.scene.positions(t)))
        return bool(((away >= 0.8 * self.nearest) & (away <= 2.0 * self.nearest)).all())

    def sample(self, times: Sequence[float]) -> list[Sample]:
        """Samples of the facets at `times` [s]."""
        return self.scene.sampler(self.mesh, self.settings).at(times, self.nodes.places)

    def choose(self, samples: Sequence[Sample]) -> NDArray[np.intp]:
        """Facets that matter at any of the `samples`."""
        scene = self.scene
        omitted = self.settings.omitted if self.cull else 0.0
        return choose_facets(self.mesh, samples, scene.band.pattern_gain, scene.wavenumber, scene.group, omitted)

    def values(self, sample: Sample, chosen: NDArray[np.intp]) -> tuple[ComplexArray, FloatArray]:
        """(node, chosen) gains of the expansion, and (chosen, 3) centroids [m] relative to the viewpoint."""
        gradient = self.scene.gradient(self.mesh.centroids(sample.points, chosen), self.steep)
        return integrate(
            self.mesh, self.material, sample, chosen, self.nodes, self.settings.sagitta, self.settings.turn, gradient
        )

    def first_pair(self, values: ComplexArray) -> ComplexArray:
        """(...) gains of the first pair in the middle of the band, from values (node, ...)."""
        return first_pair(self.expansion, values)


def first_delays(band: BandTracer, centroids: FloatArray) -> FloatArray:
    """(facet, knot) delays [s] of the first pair by `centroids` (knot, facet, 3) [m] relative to the viewpoint."""
    tx, rx = (np.ascontiguousarray(each[:1] - band.viewpoint) for each in band.elements)
    found = np.empty((1, 1, centroids.shape[1], centroids.shape[0]))
    pair_delays(centroids, tx, rx, found)
    return found[0, 0]
