"""Exact gains of some pairs, which an expansion is held against."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rfgen_sionna._types import ComplexArray, FloatArray, IntArray
from rfgen_sionna.tracing.surface.facets import sum_by_surface

PROBES = np.array([-1.0, 0.0, 1.0])
"""Places in the band at which gains are tried and returns compared."""


@dataclass(frozen=True)
class Probes:
    """What an expansion is held against: exact gains of some pairs at places of the band."""

    u: FloatArray
    """(probe,)"""
    pairs: IntArray
    """(probe,)"""
    gains: ComplexArray
    """(probe, facet)"""
    phasors: ComplexArray
    """(probe, facet) of the propagation, times the facets' weights."""
    group: IntArray
    """(facet,) what each is summed up with."""
    scale: FloatArray
    """(group,) return that errors are relative to."""

    def error(self, gains: ComplexArray) -> float:
        """Relative error of the coherent sums of `gains` (probe, facet), of the worst of them."""
        missed = root_mean_square(sum_by_surface((gains - self.gains) * self.phasors, self.group, len(self.scale)))
        # Of nothing no tolerance is left.
        error = np.where(missed > 0, missed / np.where(self.scale > 0, self.scale, 1e-300), 0.0)
        return float(error.max(initial=0.0))


def root_mean_square(values: ComplexArray) -> FloatArray:
    """(group,) of `values` (probe, group)."""
    return np.asarray(np.sqrt((np.abs(values) ** 2).mean(axis=0)))
