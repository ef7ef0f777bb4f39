"""Element patterns as tables over azimuth and elevation, and their files."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from scipy.interpolate import RegularGridInterpolator

from rfgen_sionna._short_repr import ShortRepr
from rfgen_sionna._types import FloatArray

_FLOOR = -200.0
"""Lowest stored level [dB]; logarithms of nulls are infinite."""
_SLOPE_STEP = np.radians(0.5)
"""Half step of differences for slopes [rad]; below the pitch of measured patterns."""
_COLUMNS = ("azimuth_deg", "elevation_deg", "gain_dbi")


@dataclass(frozen=True, repr=False)
class TablePattern(ShortRepr):
    """Power gain on a grid of azimuth and elevation, linear in dB between its points.

    Directions as of :class:`~rfgen_sionna.radar.pattern.ElementPattern`. The table is periodic over a full turn of
    azimuth, and constant outside its angles otherwise.

    Raises
    ------
    ValueError
        Angles are not ascending within ±180 or ±90 degrees, or gains do not fit them.
    """

    azimuth_deg: tuple[float, ...]
    elevation_deg: tuple[float, ...]
    gain_dbi: tuple[tuple[float, ...], ...]
    """(azimuth, elevation) [dBi]"""
    name: str = ""
    """Registered name of the table, such as "sionna:tr38901"; empty for other tables."""

    def __post_init__(self) -> None:
        for axis, limit in (("azimuth", 180.0), ("elevation", 90.0)):
            angle = np.asarray(getattr(self, f"{axis}_deg"), dtype=np.float64)
            if angle.ndim != 1 or len(angle) < 2 or not np.all(np.diff(angle) > 0) or np.abs(angle).max() > limit:
                raise ValueError(
                    f"pattern.{axis}_deg has {angle.size} entries from {angle.min(initial=np.inf):g} to "
                    f"{angle.max(initial=-np.inf):g}: at least 2 are needed, ascending within ±{limit:g} degrees"
                )
        shape = (len(self.azimuth_deg), len(self.elevation_deg))
        if len({len(row) for row in self.gain_dbi}) != 1 or np.shape(self.gain_dbi) != shape:
            raise ValueError(f"pattern.gain_dbi: a gain for each of {shape} (azimuth, elevation) angles is needed")
        gain = np.asarray(self.gain_dbi, dtype=np.float64)
        if not np.all(np.isfinite(gain)) or not -30 <= gain.max() <= 60:
            raise ValueError(
                f"pattern.gain_dbi peaks at {gain.max():g}: finite gains with a peak in -30 … 60 dBi are needed"
            )

    @classmethod
    def of(
        cls, azimuth_deg: FloatArray, elevation_deg: FloatArray, gain_dbi: FloatArray, name: str = ""
    ) -> TablePattern:
        """A table of arrays [degrees, dBi], with gains of at least -200 dBi in steps of 0.0001 dB."""
        gain = np.round(np.maximum(gain_dbi, _FLOOR), 4)
        return cls(
            tuple(np.asarray(azimuth_deg, np.float64).tolist()),
            tuple(np.asarray(elevation_deg, np.float64).tolist()),
            tuple(map(tuple, gain.tolist())),
            name,
        )

    @property
    def peak_gain_dbi(self) -> float:
        """Largest gain of the table [dBi]."""
        return max(map(max, self.gain_dbi))

    @cached_property
    def _interpolator(self) -> RegularGridInterpolator:
        azimuth, gain = np.asarray(self.azimuth_deg), np.asarray(self.gain_dbi)
        gap = 360.0 - (azimuth[-1] - azimuth[0])
        if 0.0 < gap <= 1.5 * np.diff(azimuth).max():  # a full turn without its last point
            azimuth, gain = np.append(azimuth, azimuth[0] + 360.0), np.vstack([gain, gain[:1]])
        return RegularGridInterpolator((azimuth, np.asarray(self.elevation_deg)), gain)

    def gain_db(self, direction: FloatArray) -> FloatArray:
        """Gain [dBi] towards unit vectors `direction` (..., 3) in the device frame, shape (...)."""
        table = self._interpolator
        azimuth = np.degrees(np.arctan2(direction[..., 1], direction[..., 0]))
        elevation = np.degrees(np.arcsin(np.clip(direction[..., 2], -1.0, 1.0)))
        first, last = table.grid[0][0], table.grid[0][-1]
        azimuth = np.where((azimuth < first) & (azimuth + 360.0 <= last), azimuth + 360.0, azimuth)
        low, high = table.grid[1][0], table.grid[1][-1]
        points = np.stack([np.clip(azimuth, first, last), np.clip(elevation, low, high)], axis=-1)
        return np.asarray(table(points), dtype=np.float64)

    def slope_db(self, direction: FloatArray) -> FloatArray:
        """(..., 3) gradient of the gain [dB/rad] transverse to unit vectors `direction` (..., 3), device frame."""
        d = np.asarray(direction, np.float64)
        spare = np.where(np.abs(d[..., 2:]) < 0.9, [0.0, 0.0, 1.0], [1.0, 0.0, 0.0])
        one = np.cross(spare, d)
        one /= np.linalg.norm(one, axis=-1, keepdims=True)
        found = np.zeros_like(d)
        for across in (one, np.cross(d, one)):
            ahead, back = (np.cos(_SLOPE_STEP) * d + np.sin(step) * across for step in (_SLOPE_STEP, -_SLOPE_STEP))
            found += ((self.gain_db(ahead) - self.gain_db(back)) / (2.0 * _SLOPE_STEP))[..., None] * across
        return found

    def amplitude(self, direction: FloatArray) -> FloatArray:
        """Field gain, the square root of the power gain; shape of `gain_db`."""
        return np.asarray(10.0 ** (self.gain_db(direction) / 20.0), dtype=np.float64)


def read_table(path: Path, frequency: float, peak_gain_dbi: float | None = None) -> TablePattern:
    """Read a pattern from a table (`.csv`) or a far field of HFSS (`.ffd`).

    Parameters
    ----------
    path
        `.csv`: a line `azimuth_deg,elevation_deg,gain_dbi`, then one line for each direction of a full grid, in any
        order; `#` starts a comment. `.ffd`: two lines `first last count` for theta and phi [degrees], the number of
        frequencies, and per frequency its value and Re, Im of E_theta and E_phi, phi running fastest; theta counts from
        +z (up), phi from +x (boresight) to the left.
    frequency
        Frequency [Hz]; the nearest one in the file counts.
    peak_gain_dbi
        Gain of the peak [dBi], required for `.ffd`, whose levels are relative; None keeps the gains of a `.csv`.

    Raises
    ------
    ValueError
        The file cannot be used; the message names it.
    """
    if not path.is_file():
        raise ValueError(f"pattern file {path} does not exist")
    if path.suffix.lower() == ".csv":
        azimuth, elevation, gain = _read_csv(path)
    elif path.suffix.lower() == ".ffd":
        if peak_gain_dbi is None:
            raise ValueError(f"pattern file {path}: an .ffd file has relative levels: peak_gain_dbi is needed too")
        azimuth, elevation, gain = _read_ffd(path, frequency)
    else:
        raise ValueError(f"pattern file {path}: a .csv or an .ffd file is needed")
    if peak_gain_dbi is not None:
        gain = gain + (peak_gain_dbi - gain.max())
    try:
        return TablePattern.of(azimuth, elevation, gain)
    except ValueError as error:
        raise ValueError(f"pattern file {path}: {error}") from error


def _read_csv(path: Path) -> tuple[FloatArray, FloatArray, FloatArray]:
    lines = [line.partition("#")[0].strip() for line in path.read_text(encoding="utf-8").splitlines()]
    rows = [[cell.strip() for cell in line.split(",")] for line in lines if line]
    if not rows or tuple(rows[0]) != _COLUMNS:
        raise ValueError(f"pattern file {path}: the first line must be '{','.join(_COLUMNS)}'")
    try:
        values = np.array([[float(cell) for cell in row] for row in rows[1:]])
    except ValueError:
        values = np.zeros(0)
    if values.ndim != 2 or values.shape[1] != 3 or not np.all(np.isfinite(values)):
        raise ValueError(f"pattern file {path}: three finite numbers in every line are needed")
    azimuth, column = np.unique(values[:, 0], return_inverse=True)
    elevation, row = np.unique(values[:, 1], return_inverse=True)
    gain = np.full((len(azimuth), len(elevation)), np.nan)
    gain[column.ravel(), row.ravel()] = values[:, 2]
    if np.isnan(gain).any() or len(values) != gain.size:
        raise ValueError(
            f"pattern file {path}: {len(values)} directions for {len(azimuth)} azimuths times {len(elevation)} "
            "elevations: each pair of angles once is needed"
        )
    return azimuth, elevation, gain


def _read_ffd(path: Path, frequency: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    lines = [line.split() for line in path.read_text(encoding="utf-8").splitlines() if line.strip()]
    try:
        theta, phi = (np.linspace(float(line[0]), float(line[1]), int(line[2])) for line in lines[:2])
        if lines[2][0] != "Frequencies" or min(len(theta), len(phi)) < 2:
            raise ValueError
        count, size = int(lines[2][1]), len(theta) * len(phi)
        blocks = [lines[3 + k * (size + 1) : 3 + (k + 1) * (size + 1)] for k in range(count)]
        known = np.array([float(block[0][1]) for block in blocks])
        parts = np.array(blocks[int(np.abs(known - frequency).argmin())][1:], dtype=np.float64).reshape(size, 4)
    except (ValueError, IndexError):
        raise ValueError(
            f"pattern file {path}: not the far field of HFSS: 'first last count' of theta and of phi, 'Frequencies n', "
            "then n times 'Frequency f' and four numbers for each direction are needed"
        ) from None
    power = np.square(parts).sum(axis=1).reshape(len(theta), len(phi))
    if not (np.all(np.isfinite(power)) and power.max() > 0):
        raise ValueError(f"pattern file {path}: fields that are finite and not all zero are needed")
    level = 10 * np.log10(np.maximum(power, power.max() * 1e-20))
    # phi from 0 to 360 degrees becomes azimuth from -180 to 180, without the second end of a full turn.
    azimuth = (phi + 180.0) % 360.0 - 180.0
    azimuth, kept = np.unique(np.round(azimuth, 9), return_index=True)
    return azimuth, 90.0 - theta[::-1], level[::-1, kept].T
