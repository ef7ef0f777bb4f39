"""Element patterns: gain over direction from two cuts, and names of Sionna's registry."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy.interpolate import PchipInterpolator

from rfgen_sionna._types import FloatArray
from rfgen_sionna.radar.pattern_table import TablePattern

PREFIX = "sionna:"
"""Prefix of the names of patterns in Sionna's registry."""


@dataclass(frozen=True)
class ElementPattern:
    """Power gain from an azimuth and an elevation cut, added in dB (separable model).

    Device frame: azimuth `atan2(y, x)` grows to the left, elevation `asin(z)` upwards. A cut is a shape-preserving
    cubic (PCHIP) between its angles and constant outside them.

    Raises
    ------
    ValueError
        A cut is not ascending within ±180 or ±90 degrees, or a level is out of range.
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

    @property
    def cubics(self) -> list[tuple[FloatArray, FloatArray]]:
        """Per cut, (angle,) ends of the pieces [degrees] and (4, piece) coefficients of the level [dB] as a cubic of
        the angle from a piece's start, highest power first."""
        return [(np.asarray(cut.x), np.asarray(cut.c)) for cut in self._cuts]

    @cached_property
    def _slopes(self) -> tuple[Any, Any]:
        return self._cuts[0].derivative(), self._cuts[1].derivative()

    def slope_db(self, direction: FloatArray) -> FloatArray:
        """(..., 3) gradient of the gain [dB/rad] transverse to unit vectors `direction` (..., 3), device frame; small
        near the poles."""
        x, y, z = np.ascontiguousarray(np.moveaxis(direction, -1, 0), np.float64)
        level = np.sqrt(np.maximum(x * x + y * y, 1e-6))
        angles = np.degrees(np.arctan2(y, x)), np.degrees(np.arcsin(np.clip(z, -1.0, 1.0)))
        tables = self.azimuth_deg, self.elevation_deg
        around, up = (
            np.degrees(slope(np.clip(angle, table[0], table[-1]))) * ((angle > table[0]) & (angle < table[-1]))
            for slope, angle, table in zip(self._slopes, angles, tables, strict=True)
        )
        around, up = around / level**2, up / level
        return np.stack([-around * y - up * z * x, around * x - up * z * y, up * level * level], axis=-1)

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


@dataclass(frozen=True)
class NamedPattern:
    """Name of a pattern of Sionna's registry; :func:`rfgen_sionna.scene.tabulated` replaces it by a table."""

    name: str
    """For instance "sionna:tr38901"."""

    def __post_init__(self) -> None:
        if not (isinstance(self.name, str) and self.name.startswith(PREFIX) and len(self.name) > len(PREFIX)):
            raise ValueError(f"pattern.name is {self.name!r}: '{PREFIX}' and the name of a pattern are needed")

    @property
    def peak_gain_dbi(self) -> float:
        raise self._unknown()

    def gain_db(self, direction: FloatArray) -> FloatArray:
        """Raises ValueError: a name has no values."""
        raise self._unknown()

    slope_db = amplitude = gain_db

    def _unknown(self) -> ValueError:
        return ValueError(
            f"pattern '{self.name}' is a name in Sionna's registry: rfgen_sionna.scene.tabulated(radar) looks it up, "
            "as Simulator does by itself"
        )


Pattern = ElementPattern | TablePattern | NamedPattern


def pattern_record(pattern: Pattern) -> dict[str, Any]:
    """Record of a pattern for JSON; the table of a registered pattern is stored by its name."""
    if isinstance(pattern, NamedPattern) or (isinstance(pattern, TablePattern) and pattern.name):
        return {"kind": pattern.name}
    kind = "table" if isinstance(pattern, TablePattern) else "cuts"
    fields = {name: getattr(pattern, name) for name in pattern.__dataclass_fields__ if name != "name"}
    return {"kind": kind} | {name: _listed(value) for name, value in fields.items()}


def pattern_from_record(record: dict[str, Any], keys: Callable[[Any, Iterable[str]], dict[str, Any]]) -> Pattern:
    """Inverse of :func:`pattern_record`; `keys` checks the keys of a record. A record without a kind has cuts."""
    record = dict(record) if isinstance(record, Mapping) else record
    kind = record.pop("kind", "cuts") if isinstance(record, dict) else "cuts"
    if isinstance(kind, str) and kind.startswith(PREFIX):
        keys(record, ())
        return NamedPattern(kind)
    if kind == "table":
        table = keys(record, ("azimuth_deg", "elevation_deg", "gain_dbi"))
        return TablePattern(**{name: _frozen(value) for name, value in table.items()})
    if kind == "cuts":
        cuts = keys(record, tuple(ElementPattern.__dataclass_fields__))
        return ElementPattern(**{name: _frozen(value) for name, value in cuts.items()})
    raise ValueError(f"pattern.kind is {kind!r}; allowed: 'cuts', 'table', '{PREFIX}NAME'")


def _listed(value: Any) -> Any:
    return [_listed(item) for item in value] if isinstance(value, tuple) else value


def _frozen(value: Any) -> Any:
    return tuple(_frozen(item) for item in value) if isinstance(value, list) else value
