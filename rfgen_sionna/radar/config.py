"""Strict reading of the TOML files in `radars/`: unknown keys, missing keys and wrong types are errors."""

from __future__ import annotations

import math
import tomllib
from pathlib import Path
from typing import Any

import numpy as np

from rfgen_sionna.radar.adc import Adc
from rfgen_sionna.radar.pattern import ElementPattern
from rfgen_sionna.radar.waveform import Waveform
from rfgen_sionna.records import SPEED_OF_LIGHT

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
        "adc": (dict,),
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
    "adc": {"bits": (int,), "full_scale_dbm": (*_NUMBER, str)},
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


_ITEMS: dict[str, tuple[type, ...]] = {
    "tx_names": (str,),
    "rx_names": (str,),
    "tx_order": (str,),
    "tx_positions_half_wavelengths": (list,),
    "rx_positions_half_wavelengths": (list,),
}
"""What the lists hold; those that are not named here hold numbers."""


def _check_value(value: Any, wanted: tuple[type, ...], what: str) -> None:
    if not isinstance(value, wanted) or isinstance(value, bool):
        raise RadarConfigError(f"{what} is {value!r}; {' or '.join(t.__name__ for t in wanted)} is needed")
    if isinstance(value, float) and not math.isfinite(value):  # TOML knows nan and inf
        raise RadarConfigError(f"{what} is {value!r}; a finite number is needed")


def _check(table: dict[str, Any], section: str, where: str) -> None:
    schema = _SCHEMA[section.partition(".")[0]]
    prefix = f"{section}." if section else ""
    for key, value in table.items():
        if key not in schema:
            raise RadarConfigError(f"{where}: unknown key '{prefix}{key}'; known there: {', '.join(sorted(schema))}")
        what = f"{where}: '{prefix}{key}'"
        _check_value(value, schema[key], what)
        for item in value if isinstance(value, list) else ():
            _check_value(item, _ITEMS.get(key, _NUMBER), f"an entry of {what}")
            if isinstance(item, list):
                if len(item) != 3:
                    raise RadarConfigError(f"an entry of {what} is {item!r}; three numbers x, y, z are needed")
                for coordinate in item:
                    _check_value(coordinate, _NUMBER, f"a coordinate in {what}")
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
    for section in ("array", "pattern", "transmitter", "receiver", "adc"):
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
    band = table["transmitter"]["frequency_range_hz"]
    if len(band) != 2 or not 0 < band[0] < band[1]:
        raise RadarConfigError(
            f"{where}: 'transmitter.frequency_range_hz' is {band!r}; two positive frequencies, the "
            "lower one first, are needed"
        )
    # A number without a source is a number nobody can check.
    sourced = set(table["source"])
    for key, text in table["source"].items():
        if not isinstance(text, str) or not text.strip():
            raise RadarConfigError(f"{where}: source of '{key}' is {text!r}; a text is needed")
        section, _, rest = key.partition(".")
        if section in ("", "source") or section not in table or (rest and rest not in table[section]):
            raise RadarConfigError(f"{where}: [source] names '{key}', which is not in the file")
    for section in ("array", "pattern", "transmitter", "receiver", "adc"):
        for key in table[section]:
            if key.endswith(("_names", "_deg")):
                continue
            if f"{section}.{key}" not in sourced and section not in sourced:
                raise RadarConfigError(
                    f"{where}: [source] has no entry for '{section}.{key}' (write 'assumption' if it is one)"
                )
    for name in table["preset"]:
        if f"preset.{name}" not in sourced:
            raise RadarConfigError(f"{where}: [source] has no entry for 'preset.{name}'")


_WAVEFORM_UNITS = {
    "start_frequency": "hz",
    "slope": "hz_per_s",
    "sample_rate": "hz",
    "idle_time": "s",
    "adc_start_time": "s",
    "ramp_end_time": "s",
    "frame_period": "s",
}
_PLAUSIBLE = {
    "sample_rate_hz": (1e3, 1e9),
    "slope_hz_per_s": (1e8, 1e16),
    "idle_time_s": (5e-7, 1.0),
    "adc_start_time_s": (1e-7, 1.0),
    "ramp_end_time_s": (1e-6, 1.0),
    "frame_period_s": (1e-5, 10.0),
}
"""Ranges that every FMCW radar keeps to; a prefix forgotten falls out of them. Idle and start time may also be 0."""
_LEAST_SHARE = {"ADC window of the ramp": 0.01, "sampled bandwidth of the start frequency": 1e-4}
"""Shares that no radar falls below by choice, but any does with a unit prefix too many."""


def radar_fields(config: dict[str, Any], preset: str | None, where: str) -> dict[str, Any]:
    """Arguments of :class:`~rfgen_sionna.radar.radar.Radar` from a checked file, its pose left out.

    Raises
    ------
    RadarConfigError, ValueError
        If the preset does not exist, or says what the device cannot do.
    """
    preset = preset or config["default_preset"]
    if preset not in config["preset"]:
        raise RadarConfigError(f"{where}: preset is '{preset}'; presets: {', '.join(sorted(config['preset']))}")
    array, chirp = config["array"], config["preset"][preset]
    _check_device(config, chirp, f"{where}: preset.{preset}")
    design = array["design_frequency_hz"]
    if not 1e9 <= design <= 1e12:
        raise RadarConfigError(f"{where}: array.design_frequency_hz is {design:g}; 1e9 … 1e12 Hz is allowed")
    for label in ("tx", "rx"):
        known, positions = array[f"{label}_names"], array[f"{label}_positions_half_wavelengths"]
        if len(known) != len(positions) or len(set(known)) != len(known):
            raise RadarConfigError(f"{where}: array.{label}_names must name each {label} position once, got {known}")
    names = list(array["tx_names"])
    fired = [tx for tx in names if tx in chirp["tx_order"]]
    half = SPEED_OF_LIGHT / design / 2
    positions = [array["tx_positions_half_wavelengths"][names.index(tx)] for tx in fired]
    full_scale = config["adc"]["full_scale_dbm"]
    if isinstance(full_scale, str) and full_scale != "auto":
        raise RadarConfigError(f"{where}: 'adc.full_scale_dbm' is {full_scale!r}; a number [dBm] or \"auto\" is needed")
    cuts = {
        key: tuple(float(value) for value in config["pattern"][key])
        for key in ("azimuth_deg", "azimuth_db", "elevation_deg", "elevation_db")
    }
    return {
        "name": config["name"],
        "preset": preset,
        "waveform": Waveform(
            **{key: float(chirp[f"{key}_{unit}"]) for key, unit in _WAVEFORM_UNITS.items()},
            num_samples=chirp["num_samples"],
            num_loops=chirp["num_loops"],
            tx_order=tuple(fired.index(tx) for tx in chirp["tx_order"]),
        ),
        "tx_names": tuple(fired),
        "rx_names": tuple(array["rx_names"]),
        "tx_positions": half * np.array(positions, dtype=np.float64),
        "rx_positions": half * np.array(array["rx_positions_half_wavelengths"], dtype=np.float64),
        "pattern": ElementPattern(float(config["pattern"]["peak_gain_dbi"]), **cuts),
        "polarization": array["polarization"],
        "tx_power_dbm": float(config["transmitter"]["power_dbm"]),
        "noise_figure_db": float(config["receiver"]["noise_figure_db"]),
        "temperature": float(config["receiver"]["temperature_k"]),
        "adc": Adc(config["adc"]["bits"], None if full_scale == "auto" else float(full_scale)),
    }


def _check_device(config: dict[str, Any], chirp: dict[str, Any], where: str) -> None:
    """Band, plausible units and Tx names of one preset."""
    for key, (lowest, highest) in _PLAUSIBLE.items():
        allowed = f"{lowest:g} … {highest:g}"
        if key in ("idle_time_s", "adc_start_time_s"):
            if chirp[key] == 0:
                continue
            allowed = f"0 or {allowed}"
        if not lowest <= chirp[key] <= highest:
            raise RadarConfigError(f"{where}.{key} is {chirp[key]:g}; {allowed} is allowed (is it off by a prefix?)")
    low, high = config["transmitter"]["frequency_range_hz"]
    end = chirp["start_frequency_hz"] + chirp["slope_hz_per_s"] * chirp["ramp_end_time_s"]
    if not (low <= chirp["start_frequency_hz"] and end <= high):
        raise RadarConfigError(
            f"{where} sweeps {chirp['start_frequency_hz'] / 1e9:g} … {end / 1e9:.3f} GHz; "
            f"the device reaches {low / 1e9:g} … {high / 1e9:g} GHz"
        )
    window = chirp["num_samples"] / chirp["sample_rate_hz"]
    shares = (window / chirp["ramp_end_time_s"], window * chirp["slope_hz_per_s"] / chirp["start_frequency_hz"])
    for (what, least), share in zip(_LEAST_SHARE.items(), shares, strict=True):
        if 0 < share < least:
            raise RadarConfigError(
                f"{where}: {what} is {share:.2g}, at least {least:g} is needed: num_samples {chirp['num_samples']}, "
                f"sample_rate_hz {chirp['sample_rate_hz']:g}, slope_hz_per_s {chirp['slope_hz_per_s']:g} and "
                f"ramp_end_time_s {chirp['ramp_end_time_s']:g} do not go together (is one off by a prefix?)"
            )
    names, order = config["array"]["tx_names"], chirp["tx_order"]
    unknown = [tx for tx in order if tx not in names]
    if unknown:
        raise RadarConfigError(f"{where}.tx_order names '{unknown[0]}'; elements: {', '.join(names)}")
    if len(set(order)) != len(order):
        raise RadarConfigError(f"{where}.tx_order fires an element twice: {order}")
