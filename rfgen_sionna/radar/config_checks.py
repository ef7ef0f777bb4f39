"""Plausible ranges of the numbers in a radar file, which reveal a wrong unit prefix."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

_ZERO_OR: dict[str, tuple[float, float]] = {
    "transmitter.power_dbm": (0.1, 80.0),
    "transmitter.phase_step_deg": (0.2, 180.0),
    "receiver.noise_figure_db": (0.3, 60.0),
    "receiver.temperature_k": (3.0, 2000.0),
    "adc.full_scale_dbm": (0.2, 150.0),
    "pattern.peak_gain_dbi": (0.1, 60.0),
}
"""Allowed magnitudes; nobody's radar has 0.012 dBm or 0.29 K, but 12e-3 and 290e-3 are soon written."""
_FREQUENCY = (1e9, 1e12)
_LEAST_SPAN, _LEAST_DEPTH, _MOST_DEPTH = 1.0, 0.3, 200.0
_SLOT_PHASE = (0.4, 360.0)


class RadarConfigError(ValueError):
    """A radar file says something that no radar can do, or in words the format does not know."""


def check_plausible(
    where: str, key: str, value: float, low: float, high: float, also: str = "", signed: bool = True
) -> None:
    """Raise unless `value` has a magnitude in `low` … `high`; `also` names other values that are allowed."""
    if not low <= (abs(value) if signed else value) <= high:
        raise RadarConfigError(
            f"{where}.{key} is {value:g}; {also}{low:g} … {high:g} is allowed (is it off by a prefix?)"
        )


def check_units(table: Mapping[str, Any], where: str) -> None:
    """The numbers of a radar file that no other check holds to a range; `table` has the right keys and types.

    Raises
    ------
    RadarConfigError
        Naming the key, its value and what is allowed.
    """
    for dotted, (low, high) in _ZERO_OR.items():
        section, _, key = dotted.partition(".")
        value = table[section].get(key)
        if isinstance(value, (int, float)) and value != 0:
            check_plausible(f"{where}: {section}", key, value, low, high, "0 or, in magnitude, ")
    for value in table["transmitter"]["frequency_range_hz"]:
        check_plausible(f"{where}: transmitter", "frequency_range_hz", value, *_FREQUENCY, signed=False)
    pattern = table["pattern"]
    for cut in ("azimuth", "elevation"):
        check_cut(f"{where}: pattern", cut, pattern.get(f"{cut}_deg", ()), pattern.get(f"{cut}_db", ()))
    for place, key, angle in _slot_angles(table["preset"]):
        if angle != 0:
            check_plausible(f"{where}: {place}", key, angle, *_SLOT_PHASE, "0 or, in magnitude, ")


def check_cut(where: str, cut: str, angles: Any, levels: Any) -> None:
    """Angles that span some degrees, and levels that are all alike or differ by what patterns do [dB]."""
    if len(angles):
        check_plausible(where, f"{cut}_deg", max(map(abs, angles)), _LEAST_SPAN, 180.0, "as the largest angle, ")
    if depth := max(levels, default=0.0) - min(levels, default=0.0):
        check_plausible(where, f"{cut}_db", -depth, _LEAST_DEPTH, _MOST_DEPTH, "between peak and least level, 0 or ")


def _slot_angles(presets: Mapping[str, Any]) -> Iterator[tuple[str, str, float]]:
    for name, preset in presets.items():
        for index, slot in enumerate(preset.get("slot", ())):
            for key in ("phase_deg", "advance_deg"):
                for angle in slot.get(key, ()):
                    yield f"preset.{name}.slot[{index}]", key, angle
