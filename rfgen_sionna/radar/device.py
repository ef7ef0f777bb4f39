"""From a checked radar file to the arguments of a radar: units, the preset's elements, what the device can do."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from rfgen_sionna.radar.adc import Adc
from rfgen_sionna.radar.config import RadarConfigError
from rfgen_sionna.radar.pattern import ElementPattern, NamedPattern, Pattern
from rfgen_sionna.radar.table import read_table
from rfgen_sionna.radar.waveform import Waveform
from rfgen_sionna.records import SPEED_OF_LIGHT, FloatArray

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

_LEAST_PITCH, _LARGEST_ARRAY = 0.05, 250.0
"""What lies between two elements of one end [wavelengths]: antennas have a size, and boards too."""


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
    tx_positions, rx_positions = (
        _positions(array, element, config["transmitter"]["frequency_range_hz"][0], where) for element in ("tx", "rx")
    )
    names = list(array["tx_names"])
    fired = [tx for tx in names if tx in chirp["tx_order"]]
    full_scale = config["adc"]["full_scale_dbm"]
    if isinstance(full_scale, str) and full_scale != "auto":
        raise RadarConfigError(f"{where}: 'adc.full_scale_dbm' is {full_scale!r}; a number [dBm] or \"auto\" is needed")
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
        "tx_positions": tx_positions[[names.index(tx) for tx in fired]],
        "rx_positions": rx_positions,
        "pattern": _pattern(config["pattern"], Path(where).parent, chirp["start_frequency_hz"]),
        "tx_polarization": array.get("tx_polarization", array.get("polarization")),
        "rx_polarization": array.get("rx_polarization", array.get("polarization")),
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
        return read_table(folder / pattern["file"], frequency, None if peak is None else float(peak))
    if kind != "cuts":
        return NamedPattern(kind)
    cuts = {
        key: tuple(float(value) for value in pattern[key])
        for key in ("azimuth_deg", "azimuth_db", "elevation_deg", "elevation_db")
    }
    return ElementPattern(float(pattern["peak_gain_dbi"]), **cuts)
