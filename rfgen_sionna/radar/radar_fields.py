"""From a checked radar file to the arguments of a radar: waveform of the preset, elements, pattern, units."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from rfgen_sionna._types import SPEED_OF_LIGHT, FloatArray
from rfgen_sionna.radar.adc import Adc
from rfgen_sionna.radar.config import CHIRP, RadarConfigError, check_cut, check_plausible
from rfgen_sionna.radar.pattern import ElementPattern, NamedPattern, Pattern
from rfgen_sionna.radar.pattern_table import read_table
from rfgen_sionna.radar.profile import Profile
from rfgen_sionna.radar.slots import Slot, coded_slots, doppler_slot, hadamard_code, single
from rfgen_sionna.radar.waveform import Waveform

_LEAST_PITCH, _LARGEST_ARRAY = 0.05, 250.0
"""Allowed distances between elements of one end [wavelengths]: a wrong unit prefix falls outside."""


def radar_fields(config: dict[str, Any], preset: str | None, where: str, prefixes: bool = True) -> dict[str, Any]:
    """Arguments of :class:`~rfgen_sionna.radar.radar.Radar` from a checked file, its pose left out.

    `prefixes` is whether values off by a unit prefix are sought; vendors' files have units of their own.

    Raises
    ------
    RadarConfigError, ValueError
        The preset does not exist, or exceeds the device.
    """
    preset = config["default_preset"] if preset is None else preset
    if not isinstance(preset, str) or preset not in config["preset"]:
        raise RadarConfigError(f"{where}: preset is {preset!r}; presets: {', '.join(sorted(config['preset']))}")
    array, chirp = config["array"], config["preset"][preset]
    waveform, fired = preset_waveform(
        chirp, config["transmitter"], array["tx_names"], f"{where}: preset.{preset}", prefixes
    )
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
        "tx_phases_deg": _chosen_phases(array, "tx", fired, where),
        "rx_phases_deg": _chosen_phases(array, "rx", array["rx_names"], where),
        "pattern": _pattern(config["pattern"], Path(where).parent, waveform.start_frequency),
        "tx_polarization": array.get("tx_polarization", array.get("polarization")),
        "rx_polarization": array.get("rx_polarization", array.get("polarization")),
        "tx_power_dbm": float(config["transmitter"]["power_dbm"]),
        "noise_figure_db": float(config["receiver"]["noise_figure_db"]),
        "temperature": float(config["receiver"]["temperature_k"]),
        "frequency_range": tuple(map(float, config["transmitter"]["frequency_range_hz"])),
        "adc": Adc(**config["adc"] | {"full_scale_dbm": None if full_scale == "auto" else float(full_scale)}),
    }


def _positions(array: dict[str, Any], element: str, frequency: float, where: str) -> FloatArray:
    """(element, 3) positions [m] from the file's unit; `frequency` [Hz] bounds their size."""
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
    nearest = gaps[gaps > 0].min(initial=np.inf) / wavelength
    if nearest < _LEAST_PITCH or gaps.max(initial=0.0) / wavelength > _LARGEST_ARRAY:
        raise RadarConfigError(
            f"{where}: array.{key} spans {gaps.max():.3g} m with elements {nearest * wavelength:.3g} m apart; "
            f"{_LEAST_PITCH:g} … {_LARGEST_ARRAY:g} wavelengths, {_LEAST_PITCH * wavelength:.3g} … "
            f"{_LARGEST_ARRAY * wavelength:.3g} m, are allowed (is it off by a prefix?)"
        )
    return metres


def _chosen_phases(array: dict[str, Any], element: str, chosen: Sequence[str], where: str) -> tuple[float, ...]:
    """Phases of the `chosen` elements' feeds [degrees]; empty where the file has none."""
    key, names = f"{element}_phases_deg", list(array[f"{element}_names"])
    if key not in array:
        return ()
    if len(array[key]) != len(names):
        raise RadarConfigError(
            f"{where}: array.{key} is {array[key]}: an angle for each of {', '.join(names)} is needed"
        )
    return tuple(float(array[key][names.index(name)]) for name in chosen)


def _pattern(pattern: dict[str, Any], folder: Path, frequency: float) -> Pattern:
    """Element pattern of a checked section; `folder` is that of the radar's file."""
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


_PLAUSIBLE = {
    "sample_rate_hz": (1e3, 1e9),
    "slope_hz_per_s": (1e8, 1e16),
    "idle_time_s": (1e-6, 1.0),
    "adc_start_time_s": (1e-7, 1.0),
    "ramp_end_time_s": (1e-6, 1.0),
}
"""Allowed ranges of FMCW radars: a wrong unit prefix falls outside. Idle and start time may also be 0."""
_FRAME_PERIOD = (1e-5, 2.0)
"""Allowed frame periods [s]: milliseconds fall outside."""
_RANGE_LIMIT = (1.0, 800.0)
"""Allowed range limits [m]: kilometres and millimetres fall outside."""
_LEAST_SHARE = {"ADC window of the ramp": 0.01, "sampled bandwidth of the start frequency": 1e-4}
"""Least shares of any FMCW radar: a wrong unit prefix falls below."""


def preset_waveform(
    preset: Mapping[str, Any], transmitter: Mapping[str, Any], names: Sequence[str], where: str, prefixes: bool = True
) -> tuple[Waveform, list[str]]:
    """Waveform of a preset, and names of its Tx elements in the order of `names`; `prefixes` as for the radar.

    Raises
    ------
    RadarConfigError, ValueError
        The preset exceeds the device; the message names key, value and allowed values.
    """
    chirps = list(preset.get("profile", ())) or [preset]
    for index, chirp in enumerate(chirps if prefixes else ()):
        _check_chirp(chirp, preset["num_samples"], f"{where}.profile[{index}]" if chirp is not preset else where)
    for key, (low, high) in (("frame_period_s", _FRAME_PERIOD), ("max_range_m", _RANGE_LIMIT)):
        if prefixes and key in preset:
            check_plausible(where, key, preset[key], low, high)
    profiles = [Profile(*(float(chirp[key]) for key in CHIRP)) for chirp in chirps]
    fired = _fired(preset, names, where)
    scheme = preset.get("multiplexing", "tdm")
    plain = "tx_order" in preset and scheme == "tdm" and len(profiles) == 1
    waveform = Waveform(
        **asdict(profiles[0]),
        num_samples=preset["num_samples"],
        num_loops=preset["num_loops"],
        tx_order=tuple(fired.index(tx) for tx in preset["tx_order"]) if plain else (),
        frame_period=float(preset["frame_period_s"]),
        other_profiles=tuple(profiles[1:]),
        slots=() if plain else _slots(preset, scheme, fired, len(profiles), where),
        phase_step_deg=float(transmitter.get("phase_step_deg", 0.0)),
        range_limit=float(preset["max_range_m"]) if "max_range_m" in preset else None,
    )
    return waveform, fired


def _fired(preset: Mapping[str, Any], names: Sequence[str], where: str) -> list[str]:
    if "slot" in preset:
        if not preset["slot"]:
            raise RadarConfigError(f"{where}.slot is empty: at least one slot is needed")
        lists = [(f"{where}.slot[{index}].tx", slot["tx"]) for index, slot in enumerate(preset["slot"])]
    else:
        lists = [(f"{where}.tx_order", preset["tx_order"])]
    for what, order in lists:
        if unknown := [tx for tx in order if tx not in names]:
            raise RadarConfigError(f"{what} names '{unknown[0]}'; elements: {', '.join(names)}")
        if len(set(order)) != len(order):
            raise RadarConfigError(f"{what} fires an element twice: {order}")
        if not order:
            raise RadarConfigError(f"{what} is empty: at least one of {', '.join(names)} is needed")
    used = {tx for _, order in lists for tx in order}
    return [tx for tx in names if tx in used]


def _slots(preset: Mapping[str, Any], scheme: str, fired: Sequence[str], profiles: int, where: str) -> tuple[Slot, ...]:
    count = len(fired)
    if "slot" in preset:
        return tuple(
            _slot(slot, fired, profiles, f"{where}.slot[{index}]") for index, slot in enumerate(preset["slot"])
        )
    members = [fired.index(tx) for tx in preset["tx_order"]]
    slots: list[Slot] = []
    for profile in range(profiles):  # the whole scheme with one profile, then with the next
        try:
            if scheme == "tdm":
                slots += [single(tx, count, profile) for tx in members]
            elif scheme == "bpm":
                slots += coded_slots(preset.get("bpm_code", hadamard_code(count)), members, count, profile)
            else:
                slots.append(doppler_slot(preset.get("doppler_bands", count), members, count, profile))
        except ValueError as error:
            raise RadarConfigError(f"{where}.{error}") from error
    return tuple(slots)


def _slot(slot: Mapping[str, Any], fired: Sequence[str], profiles: int, where: str) -> Slot:
    if not 0 <= slot.get("profile", 0) < profiles:
        raise RadarConfigError(f"{where}.profile is {slot['profile']}; 0 … {profiles - 1} is allowed")
    phases: list[float | None] = [None] * len(fired)
    advance = [0.0] * len(fired)
    for key, target in (("phase_deg", phases), ("advance_deg", advance)):
        values = slot.get(key, [0.0] * len(slot["tx"]))
        if len(values) != len(slot["tx"]):
            raise RadarConfigError(f"{where}.{key} is {values}: one angle for each of {slot['tx']} is needed")
        for tx, value in zip(slot["tx"], values, strict=True):
            target[fired.index(tx)] = float(value)
    return Slot(tuple(phases), slot.get("profile", 0), tuple(advance))


def _check_chirp(chirp: Mapping[str, Any], num_samples: int, where: str) -> None:
    """Check magnitudes of one chirp; its band is checked with the radar."""
    for key, (low, high) in _PLAUSIBLE.items():
        value, also = chirp[key], ""
        if key in ("idle_time_s", "adc_start_time_s"):
            also = "0 or "
        elif key == "slope_hz_per_s":
            also = "0 or, up or down, "
        if not (value == 0 and also):
            if value < 0 and key != "slope_hz_per_s":
                raise RadarConfigError(f"{where}.{key} is {value:g}; {also}{low:g} … {high:g} is allowed")
            check_plausible(where, key, value, low, high, also)
    start = chirp["start_frequency_hz"]
    window = num_samples / chirp["sample_rate_hz"]
    shares = (window / chirp["ramp_end_time_s"], window * abs(chirp["slope_hz_per_s"]) / start)
    for (what, least), share in zip(_LEAST_SHARE.items(), shares, strict=True):
        if 0 < share < least:
            raise RadarConfigError(
                f"{where}: {what} is {share:.2g}, at least {least:g} is needed: num_samples {num_samples}, "
                f"sample_rate_hz {chirp['sample_rate_hz']:g}, slope_hz_per_s {chirp['slope_hz_per_s']:g} and "
                f"ramp_end_time_s {chirp['ramp_end_time_s']:g} do not go together (is one off by a prefix?)"
            )
