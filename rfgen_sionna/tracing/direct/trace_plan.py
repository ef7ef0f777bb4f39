"""Plan of a run: facets, expansion and settings that meet the tolerance, with their measured errors.

The plan depends on the run alone, not on the order in which its intervals are traced.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import SPEED_OF_LIGHT, ComplexArray, FloatArray, IntArray
from rfgen_sionna.tracing.direct.expansion_choice import first_pair, node_table
from rfgen_sionna.tracing.direct.run_scene import RunScene
from rfgen_sionna.tracing.direct.samples import (
    GainNodes,
    Sample,
    choose_facets,
    integrate,
    pair_delays,
)
from rfgen_sionna.tracing.direct.settings import Settings
from rfgen_sionna.tracing.gains.expansion import Expansion
from rfgen_sionna.tracing.integral.leg_fields import LegTables
from rfgen_sionna.tracing.surface.facet_mesh import FacetMesh

SAFETY = 1.5
"""Factor on errors measured at a few times, pairs and frequencies, for all others."""
TIME_PER_RTOL = 1.0
"""Allowed error between knots per unit of the tolerance."""


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

    @staticmethod
    def single(scene: RunScene, vertices: Sequence[FloatArray]) -> TracePlan:
        """Plan without measured errors for a single time with `vertices` (vertex, 3) [m], for other returns than direct
        ones."""
        settings = Settings.of(scene.rtol)
        mesh, expansion = scene.mesh(vertices, settings.facet_rtol), scene.band.expansions.through([(0, 0, 0, 0, 0)])
        return TracePlan(
            scene=scene, settings=settings, mesh=mesh, material=mesh.surface, expansion=expansion,
            nodes=scene.nodes(node_table(expansion.nodes), np.inf, False), steep=False, error=0.0, knots=1,
            time_error=0.0, time_scale=0.0, cull=True, nearest=np.array(scene.distances(vertices)),
            level=np.zeros(len(scene.group)), surface=0.0,
        )  # fmt: skip

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
        legs, slabs = None, self.scene.slabs
        if slabs is not None and sample.crossed is not None:
            own = sample.crossed.take(chosen)
            frequency = self.nodes.table[:, 6] * SPEED_OF_LIGHT / (2 * np.pi)
            legs = LegTables.direct()._replace(**slabs.leg_tables((own, own), frequency))
        known = self.nodes, self.settings.sagitta, self.settings.turn, gradient
        return integrate(self.mesh, self.material, sample, chosen, *known, legs=legs)

    def delays(
        self, samples: Sequence[Sample], chosen: NDArray[np.intp], centroids: FloatArray, only_first: bool = False
    ) -> FloatArray:
        """(tx, rx, chosen, time) delays [s] by `centroids` (time, chosen, 3) [m] relative to the viewpoint, or those of
        the first pair only, (1, 1, chosen, time)."""
        band, slabs = self.scene.band, self.scene.slabs
        some = slice(1) if only_first else slice(None)
        tx, rx = (np.ascontiguousarray(each[some] - band.viewpoint) for each in band.elements)
        found = np.empty((len(tx), len(rx), centroids.shape[1], centroids.shape[0]))
        pair_delays(centroids, tx, rx, found)
        for k, sample in enumerate(samples):
            if slabs is not None and sample.crossed is not None:
                own = sample.crossed.take(chosen)
                out, back = (slabs.delays(own, each, centroids[k]) for each in (tx, rx))
                found[..., k] += out[:, None] + back
        return found

    def first_pair(self, values: ComplexArray) -> ComplexArray:
        """(...) gains of the first pair in the middle of the band, from values (node, ...)."""
        return first_pair(self.expansion, values)
