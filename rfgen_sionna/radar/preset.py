"""From a checked preset of a radar file to its waveform: units, slots, what the device can do."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields
from typing import Any

from rfgen_sionna.radar.config_checks import RadarConfigError, check_plausible
from rfgen_sionna.radar.profile import Profile
from rfgen_sionna.radar.slots import Slot, coded_slots, doppler_slot, hadamard_code, single
from rfgen_sionna.radar.waveform import Waveform

_UNITS = {
    "start_frequency": "hz",
    "slope": "hz_per_s",
    "sample_rate": "hz",
    "idle_time": "s",
    "adc_start_time": "s",
    "ramp_end_time": "s",
}
_PLAUSIBLE = {
    "sample_rate_hz": (1e3, 1e9),
    "slope_hz_per_s": (1e8, 1e16),
    "idle_time_s": (5e-7, 1.0),
    "adc_start_time_s": (1e-7, 1.0),
    "ramp_end_time_s": (1e-6, 1.0),
}
"""Ranges that every FMCW radar keeps to; a prefix forgotten falls out of them. Idle and start time may also be 0."""
_FRAME_PERIOD = (1e-5, 2.0)
_RANGE_LIMIT = (1.0, 800.0)
_LEAST_SHARE = {"ADC window of the ramp": 0.01, "sampled bandwidth of the start frequency": 1e-4}
"""Shares that no radar falls below by choice, but any does with a unit prefix too many."""


def preset_waveform(
    preset: Mapping[str, Any], transmitter: Mapping[str, Any], names: Sequence[str], where: str
) -> tuple[Waveform, list[str]]:
    """The waveform of a preset and the names of the Tx elements that it fires, in the order of `names`.

    Raises
    ------
    RadarConfigError, ValueError
        If the device cannot do it, naming the key, the value and what is allowed.
    """
    chirps = list(preset.get("profile", ())) or [preset]
    for index, chirp in enumerate(chirps):
        _check_chirp(
            chirp, preset["num_samples"], transmitter, f"{where}.profile[{index}]" if chirp is not preset else where
        )
    for key, (low, high) in (("frame_period_s", _FRAME_PERIOD), ("max_range_m", _RANGE_LIMIT)):
        if key in preset:
            check_plausible(where, key, preset[key], low, high)
    profiles = [
        Profile(**{field.name: float(chirp[f"{field.name}_{_UNITS[field.name]}"]) for field in fields(Profile)})
        for chirp in chirps
    ]
    fired = _fired(preset, names, where)
    scheme = preset.get("multiplexing", "tdm")
    plain = "tx_order" in preset and scheme == "tdm" and len(profiles) == 1
    waveform = Waveform(
        **{field.name: getattr(profiles[0], field.name) for field in fields(Profile)},
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


def _check_chirp(chirp: Mapping[str, Any], num_samples: int, transmitter: Mapping[str, Any], where: str) -> None:
    """Band and plausible units of one kind of chirp."""
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
    low, high = transmitter["frequency_range_hz"]
    start = chirp["start_frequency_hz"]
    end = start + chirp["slope_hz_per_s"] * chirp["ramp_end_time_s"]
    if not (low <= min(start, end) and max(start, end) <= high):
        raise RadarConfigError(
            f"{where} sweeps {start / 1e9:g} … {end / 1e9:.3f} GHz; "
            f"the device reaches {low / 1e9:g} … {high / 1e9:g} GHz"
        )
    window = num_samples / chirp["sample_rate_hz"]
    shares = (window / chirp["ramp_end_time_s"], window * abs(chirp["slope_hz_per_s"]) / start)
    for (what, least), share in zip(_LEAST_SHARE.items(), shares, strict=True):
        if 0 < share < least:
            raise RadarConfigError(
                f"{where}: {what} is {share:.2g}, at least {least:g} is needed: num_samples {num_samples}, "
                f"sample_rate_hz {chirp['sample_rate_hz']:g}, slope_hz_per_s {chirp['slope_hz_per_s']:g} and "
                f"ramp_end_time_s {chirp['ramp_end_time_s']:g} do not go together (is one off by a prefix?)"
            )
