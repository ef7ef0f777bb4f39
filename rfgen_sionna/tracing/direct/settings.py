"""Settings of the direct trace for a tolerance."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from rfgen_sionna.tracing.visibility.item_buffer import Resolution

MOST_PER_FACET, MAX_OUTLINE = 200.0, 1024
"""Bounds of the resolution of views, for time and memory."""
FINE_RTOL, COARSE_TURN = 0.03, 0.3
"""Tolerance from which pieces have an obliquity of their own, and the largest turn over a piece above it [rad]."""
MAX_KNOTS = 513
"""Largest number of knots of an interval."""


@dataclass(frozen=True)
class Settings:
    """Accuracy of each stage."""

    facet_rtol: float
    """Tolerance of the tessellation."""
    resolution: Resolution
    sagitta: float
    """Largest quadratic phase [rad] in the middle of an edge of a piece."""
    turn: float
    """Largest turn of the normal against the line of sight over a piece [rad]; 0 takes one obliquity for each facet."""
    omitted: float
    """Share of the energy of the bounds of facets that are left out."""
    spacing: float
    """Largest gap between knots [s]."""

    @staticmethod
    def of(rtol: float) -> Settings:
        """For a relative error `rtol` of each actor's return."""
        return Settings(
            facet_rtol=rtol,
            resolution=Resolution(
                min(4.0 * (0.1 / rtol) ** 1.3, MOST_PER_FACET), int(min(256 * np.sqrt(0.1 / rtol), MAX_OUTLINE))
            ),
            sagitta=float(np.clip(0.75 * np.sqrt(10.0 * rtol), 0.02, 0.75)),
            turn=0.0 if rtol > FINE_RTOL else float(np.clip(6.0 * np.sqrt(rtol), 0.1, 0.6)),
            omitted=float(min(0.625 * rtol**3, 1e-3)),
            spacing=float(np.clip(10e-3 * (rtol / 0.1) ** 0.25, 2.5e-3, 12e-3)),
        )

    def finer(self) -> Settings:
        """The same with a quarter of the error of each stage, about."""
        return replace(
            self,
            facet_rtol=0.25 * self.facet_rtol,
            resolution=Resolution(
                min(4 * self.resolution.facet, MOST_PER_FACET), min(2 * self.resolution.outline, MAX_OUTLINE)
            ),
            sagitta=0.5 * self.sagitta,
            turn=0.5 * self.turn if self.turn > 0 else COARSE_TURN,
            omitted=0.05 * self.omitted,
        )
