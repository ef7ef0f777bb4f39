"""Checks of a radar's elements and of the band of its device."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from rfgen_sionna._types import FloatArray
from rfgen_sionna.radar.boards import boards_for
from rfgen_sionna.radar.profile import is_number
from rfgen_sionna.radar.waveform import Waveform

_LARGEST_OFFSET = 10.0
"""Largest distance of an element from the centre [m]; millimetres fall outside."""
_ROUNDING = 1e-9
"""Relative difference by which a band may exceed the device's."""


def checked_band(name: str, band: Any, waveform: Waveform) -> tuple[float, float]:
    """`band` [Hz] of the device `name`, checked to hold the frequencies in the ADC windows (else ValueError)."""
    if (
        not isinstance(band, (tuple, list))
        or len(band) != 2
        or not all(map(is_number, band))
        or not 0 < band[0] < band[1]
    ):
        raise ValueError(f"radar.frequency_range is {band!r}: two frequencies [Hz], the lower one first, are needed")
    low, high = (float(limit) for limit in band)
    for index, profile in enumerate(waveform.profiles):
        first, last = profile.sampled_band(waveform.num_samples)
        if low * (1 - _ROUNDING) <= first and last <= high * (1 + _ROUNDING):
            continue
        which = f"profile[{index}]" if waveform.other_profiles else "waveform"
        others = boards_for((first, last))
        raise ValueError(
            f"{which} samples {first / 1e9:.6g} … {last / 1e9:.6g} GHz; '{name}' reaches {low / 1e9:g} … "
            f"{high / 1e9:g} GHz{': boards of that band are ' + ', '.join(others) if others else ''}"
        )
    return low, high


def checked_elements(end: str, positions: ArrayLike, names: Sequence[str]) -> FloatArray:
    """Read-only copy of the positions (element, 3) [m] of the named "tx" or "rx" elements."""
    field = f"radar.{end}_positions"
    array = np.array(positions, dtype=np.float64)
    if array.ndim != 2 or array.shape[1] != 3 or len(array) == 0 or not np.all(np.isfinite(array)):
        raise ValueError(f"{field} has shape {array.shape}: finite (element, 3) positions [m] are needed")
    if np.abs(array).max() > _LARGEST_OFFSET:
        raise ValueError(
            f"{field} reaches {np.abs(array).max():g} m: elements lie within {_LARGEST_OFFSET:g} m of the centre"
        )
    gaps = np.linalg.norm(array[:, None] - array[None], axis=-1) + np.eye(len(array))
    if gaps.min() < 1e-6:
        i, j = np.argwhere(gaps < 1e-6)[0]
        raise ValueError(f"{field}: elements {i} and {j} are at the same place {array[i].tolist()} m")
    if len(names) != len(array) or len(set(names)) != len(names):
        raise ValueError(f"radar.{end}_names is {tuple(names)!r}: a different name for each of {len(array)} elements")
    array.setflags(write=False)
    return array


def checked_phases(end: str, phases: Any, names: Sequence[str]) -> tuple[float, ...]:
    """`phases` [degrees] of the named "tx" or "rx" elements; empty where all are 0."""
    label = f"radar.{end}_phases_deg"
    if isinstance(phases, str) or not np.iterable(phases) or len(list(phases)) not in (0, len(names)):
        raise ValueError(
            f"{label} is {phases!r}: one angle [degrees] for each of {', '.join(names)}, or none, is needed"
        )
    if not all(is_number(phase) and abs(phase) <= 360 for phase in phases):
        raise ValueError(f"{label} is {phases!r}: angles in -360 … 360 degrees are needed")
    return tuple(float(phase) for phase in phases) if any(phases) else ()
