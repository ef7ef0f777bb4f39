"""Gain of one antenna element against direction."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.interpolate import PchipInterpolator

from rfgen_sionna.records import FloatArray


@dataclass(frozen=True)
class ElementPattern:
    """Power gain from an azimuth and an elevation cut, added in dB (separable model).

    Directions are in the device frame: azimuth `atan2(y, x)` grows to the left, elevation `asin(z)` upwards.
    Between tabulated angles the cut is a shape-preserving cubic (no overshoot); outside them it keeps the end value.
    """

    peak_gain_dbi: float
    azimuth_deg: tuple[float, ...] = (-180.0, 180.0)
    azimuth_db: tuple[float, ...] = (0.0, 0.0)
    elevation_deg: tuple[float, ...] = (-90.0, 90.0)
    elevation_db: tuple[float, ...] = (0.0, 0.0)

    def __post_init__(self) -> None:
        for cut, limit in (("azimuth", 180.0), ("elevation", 90.0)):
            angle, level = np.asarray(getattr(self, f"{cut}_deg")), np.asarray(getattr(self, f"{cut}_db"))
            if angle.shape != level.shape or angle.ndim != 1 or len(angle) < 2:
                raise ValueError(
                    f"pattern.{cut}_deg and pattern.{cut}_db have {angle.size} and {level.size} entries: "
                    "two lists of the same length, at least 2, are needed"
                )
            if not np.all(np.diff(angle) > 0) or np.abs(angle).max() > limit:
                raise ValueError(
                    f"pattern.{cut}_deg is {angle.tolist()}: it must ascend strictly within ±{limit:g} degrees"
                )
            if not np.all(np.isfinite(level)) or level.max() > 1e-9:
                raise ValueError(f"pattern.{cut}_db is relative to the peak: finite values of at most 0 dB are needed")
        if not (np.isfinite(self.peak_gain_dbi) and -30 <= self.peak_gain_dbi <= 60):
            raise ValueError(f"pattern.peak_gain_dbi is {self.peak_gain_dbi!r}: a value in -30 … 60 dBi is needed")

    @cached_property
    def _cuts(self) -> tuple[PchipInterpolator, PchipInterpolator]:
        return (
            PchipInterpolator(self.azimuth_deg, self.azimuth_db),
            PchipInterpolator(self.elevation_deg, self.elevation_db),
        )

    def gain_db(self, direction: FloatArray) -> FloatArray:
        """Gain [dBi] towards unit vectors `direction` (..., 3) in the device frame, shape (...)."""
        azimuth = np.degrees(np.arctan2(direction[..., 1], direction[..., 0]))
        elevation = np.degrees(np.arcsin(np.clip(direction[..., 2], -1.0, 1.0)))
        cut_az, cut_el = self._cuts
        azimuth = np.clip(azimuth, self.azimuth_deg[0], self.azimuth_deg[-1])
        elevation = np.clip(elevation, self.elevation_deg[0], self.elevation_deg[-1])
        return np.asarray(self.peak_gain_dbi + cut_az(azimuth) + cut_el(elevation), dtype=np.float64)

    def amplitude(self, direction: FloatArray) -> FloatArray:
        """Field gain, the square root of the power gain; shape of `gain_db`."""
        return np.asarray(10.0 ** (self.gain_db(direction) / 20.0), dtype=np.float64)
