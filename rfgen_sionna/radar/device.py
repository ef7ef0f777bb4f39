"""From a checked radar file to the arguments of a radar: units, the preset's elements, the size of the arrays."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np

from rfgen_sionna._types import SPEED_OF_LIGHT, FloatArray
from rfgen_sionna.radar.adc import Adc
from rfgen_sionna.radar.config_checks import RadarConfigError, check_cut, check_plausible
from rfgen_sionna.radar.pattern import ElementPattern, NamedPattern, Pattern
from rfgen_sionna.radar.preset import preset_waveform
from rfgen_sionna.radar.table import read_table
from rfgen_sionna.resources import available, resolve

_LEAST_PITCH, _LARGEST_ARRAY = 0.05, 250.0
"""Allowed distances between two elements of one end [wavelengths]: least and largest."""


def radar_file(radar: str | os.PathLike[str]) -> Path:
    """The file of a shipped radar by its name, or of one's own by its path.

    Raises
    ------
    RadarConfigError
        If it is neither.
    """
    if not isinstance(radar, (str, os.PathLike)) or not str(radar):
        raise RadarConfigError(
            f"radar is {radar!r}: the path of a TOML file or one of {', '.join(available('radars'))} is needed"
        )
    path = Path(radar)
    path = path if path.suffix == ".toml" else resolve("radars", str(radar))
    if not path.is_file():
        raise RadarConfigError(f"radar file {path} does not exist; shipped radars: {', '.join(available('radars'))}")
    return path


def radar_fields(config: dict[str, Any], preset: str | None, where: str) -> dict[str, Any]:
    """Arguments of :class:`~rfgen_sionna.radar.radar.Radar` from a checked file, its pose left out.

    Raises
    ------
    RadarConfigError, ValueError
        If the preset does not exist, or says what the device cannot do.
    """
    preset = config["default_preset"] if preset is None else preset
    if not isinstance(preset, str) or preset not in config["preset"]:
        raise RadarConfigError(f"{where}: preset is {preset!r}; presets: {', '.join(sorted(config['preset']))}")
    array, chirp = config["array"], config["preset"][preset]
    waveform, fired = preset_waveform(chirp, config["transmitter"], array["tx_names"], f"{where}: preset.{preset}")
    tx_positions, rx_positions = (
        _positions(array, element, config["transmitter"]["frequency_range_hz"][0], where) for element in ("tx", "rx")
    )
    names = list(array["tx_names"])
    full_scale = config["adc"]["full_scale_dbm"]
    if isinstance(full_scale, str) and full_scale != "auto":
        raise RadarConfigError(f"{where}: 'adc.full_scale_dbm' is {full_scale!r}; a number [dBm] or \"auto\" is needed")
    return {
        "name": config["name"],
        "preset": preset,
        "waveform": waveform,
        "tx_names": tuple(fired),
        "rx_names": tuple(array["rx_names"]),
        "tx_positions": tx_positions[[names.index(tx) for tx in fired]],
        "rx_positions": rx_positions,
        "pattern": _pattern(config["pattern"], Path(where).parent, waveform.start_frequency),
        "tx_polarization": array.get("tx_polarization", array.get("polarization")),
        "rx_polarization": array.get("rx_polarization", array.get("polarization")),
        "tx_power_dbm": float(config["transmitter"]["power_dbm"]),
        "noise_figure_db": float(config["receiver"]["noise_figure_db"]),
        "temperature": float(config["receiver"]["temperature_k"]),
        "adc": Adc(config["adc"]["bits"], None if full_scale == "auto" else float(full_scale)),
    }


def _positions(array: dict[str, Any], element: str, frequency: float, where: str) -> FloatArray:
    """(element, 3) [m] from whichever unit the file counts in; `frequency` [Hz] tells what size arrays have."""
    key = f"{element}_positions_m"
    if key in array:
        positions, unit = array[key], 1.0
    else:
        design = array["design_frequency_hz"]
        if not 1e9 <= design <= 1e12:
            raise RadarConfigError(f"{where}: array.design_frequency_hz is {design:g}; 1e9 … 1e12 Hz is allowed")
        key = f"{element}_positions_half_wavelengths"
        positions, unit = array[key], SPEED_OF_LIGHT / design / 2
    names = array[f"{element}_names"]
    if len(names) != len(positions) or len(set(names)) != len(names):
        raise RadarConfigError(f"{where}: array.{element}_names must name each {element} position once, got {names}")
    metres = unit * np.array(positions, dtype=np.float64).reshape(-1, 3)
    gaps = np.linalg.norm(metres[:, None] - metres, axis=-1)
    wavelength = SPEED_OF_LIGHT / frequency
    # Elements at one and the same place are named by the radar itself.
    nearest = gaps[gaps > 0].min(initial=np.inf) / wavelength
    if nearest < _LEAST_PITCH or gaps.max(initial=0.0) / wavelength > _LARGEST_ARRAY:
        raise RadarConfigError(
            f"{where}: array.{key} spans {gaps.max():.3g} m with elements {nearest * wavelength:.3g} m apart; "
            f"{_LEAST_PITCH:g} … {_LARGEST_ARRAY:g} wavelengths, {_LEAST_PITCH * wavelength:.3g} … "
            f"{_LARGEST_ARRAY * wavelength:.3g} m, are allowed (is it off by a prefix?)"
        )
    return metres


def _pattern(pattern: dict[str, Any], folder: Path, frequency: float) -> Pattern:
    """Element pattern of a checked section; files are looked for beside the radar's own."""
    kind = pattern.get("kind", "cuts")
    if kind == "table":
        peak = pattern.get("peak_gain_dbi")
        file = folder / pattern["file"]
        table = read_table(file, frequency, None if peak is None else float(peak))
        for cut, axis in (("azimuth", table.azimuth_deg), ("elevation", table.elevation_deg)):
            check_cut(f"pattern file {file}:", cut, axis, ())
        if table.peak_gain_dbi != 0:
            check_plausible(f"pattern file {file}:", "gain_dbi", table.peak_gain_dbi, 0.1, 60.0, "as peak 0 or ")
        return table
    if kind != "cuts":
        return NamedPattern(kind)
    cuts = {
        key: tuple(float(value) for value in pattern[key])
        for key in ("azimuth_deg", "azimuth_db", "elevation_deg", "elevation_db")
    }
    return ElementPattern(float(pattern["peak_gain_dbi"]), **cuts)
