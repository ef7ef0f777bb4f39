"""Strict reading of the TOML files in `radars/`: unknown keys, missing keys and wrong types are errors."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

_NUMBER = (int, float)

_SCHEMA: dict[str, dict[str, tuple[type, ...]]] = {
    "": {
        "name": (str,),
        "description": (str,),
        "default_preset": (str,),
        "array": (dict,),
        "pattern": (dict,),
        "transmitter": (dict,),
        "receiver": (dict,),
        "preset": (dict,),
        "source": (dict,),
    },
    "array": {
        "design_frequency_hz": _NUMBER,
        "tx_names": (list,),
        "tx_positions_half_wavelengths": (list,),
        "rx_names": (list,),
        "rx_positions_half_wavelengths": (list,),
        "polarization": (str,),
    },
    "pattern": {
        "peak_gain_dbi": _NUMBER,
        "azimuth_deg": (list,),
        "azimuth_db": (list,),
        "elevation_deg": (list,),
        "elevation_db": (list,),
    },
    "transmitter": {"power_dbm": _NUMBER, "frequency_range_hz": (list,)},
    "receiver": {"noise_figure_db": _NUMBER, "temperature_k": _NUMBER},
    "preset": {
        "start_frequency_hz": _NUMBER,
        "slope_hz_per_s": _NUMBER,
        "sample_rate_hz": _NUMBER,
        "num_samples": (int,),
        "idle_time_s": _NUMBER,
        "adc_start_time_s": _NUMBER,
        "ramp_end_time_s": _NUMBER,
        "num_loops": (int,),
        "tx_order": (list,),
        "frame_period_s": _NUMBER,
    },
}


class RadarConfigError(ValueError):
    """A radar file says something that no radar can do, or in words the format does not know."""


def _check(table: dict[str, Any], section: str, where: str) -> None:
    schema = _SCHEMA[section.partition(".")[0]]
    prefix = f"{section}." if section else ""
    for key, value in table.items():
        if key not in schema:
            raise RadarConfigError(f"{where}: unknown key '{prefix}{key}'; known there: {', '.join(sorted(schema))}")
        if not isinstance(value, schema[key]) or isinstance(value, bool):
            wanted = " or ".join(t.__name__ for t in schema[key])
            raise RadarConfigError(f"{where}: '{prefix}{key}' is {value!r}; {wanted} is needed")
    missing = [key for key in schema if key not in table]
    if missing:
        raise RadarConfigError(f"{where}: '{prefix}{missing[0]}' is missing (needed: {', '.join(schema)})")


def read_config(path: Path) -> dict[str, Any]:
    """Parse and check one radar file.

    Raises
    ------
    RadarConfigError
        With the file, the key, what was found and what is allowed.
    """
    try:
        table = tomllib.loads(path.read_text(encoding="utf-8"))
    except tomllib.TOMLDecodeError as error:
        raise RadarConfigError(f"{path}: not a TOML file: {error}") from error
    check_config(table, str(path))
    return table


def check_config(table: dict[str, Any], where: str) -> None:
    """Check the keys and types of a parsed radar file; `where` names it in errors."""
    _check(table, "", where)
    for section in ("array", "pattern", "transmitter", "receiver"):
        _check(table[section], section, where)
    if not table["preset"]:
        raise RadarConfigError(f"{where}: at least one [preset.NAME] is needed")
    for name, preset in table["preset"].items():
        if not isinstance(preset, dict):
            raise RadarConfigError(f"{where}: 'preset.{name}' is {preset!r}; a table is needed")
        _check(preset, f"preset.{name}", where)
    if table["default_preset"] not in table["preset"]:
        raise RadarConfigError(
            f"{where}: default_preset is '{table['default_preset']}'; presets: {', '.join(sorted(table['preset']))}"
        )
    # A number without a source is a number nobody can check.
    sourced = set(table["source"])
    for section in ("array", "pattern", "transmitter", "receiver"):
        for key in table[section]:
            if key.endswith(("_names", "_deg")):
                continue
            if f"{section}.{key}" not in sourced and section not in sourced:
                raise RadarConfigError(f"{where}: [source] has no entry for '{section}.{key}' (write 'assumption' if so)")
    for name in table["preset"]:
        if f"preset.{name}" not in sourced:
            raise RadarConfigError(f"{where}: [source] has no entry for 'preset.{name}'")
