"""Radars as records for JSON, and back."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import MISSING, asdict, fields
from functools import partial
from typing import Any

from rfgen_sionna.radar.adc import Adc
from rfgen_sionna.radar.pattern import pattern_from_record
from rfgen_sionna.radar.pose import Trajectory
from rfgen_sionna.radar.profile import Profile
from rfgen_sionna.radar.slots import Slot
from rfgen_sionna.radar.waveform import Waveform

_OPTIONAL = ("position", "orientation", "adc", "trajectory", "tx_phases_deg", "rx_phases_deg", "frequency_range")
"""Keys that records may lack."""


def _keys(what: str, record: Any, known: Iterable[str], optional: Iterable[str] = ()) -> dict[str, Any]:
    """`record` as a dictionary; ValueError with the name of an unknown or a missing key."""
    if not isinstance(record, Mapping):
        raise ValueError(f"{what} is {record!r}: a table with the keys {', '.join(known)} is needed")
    if unknown := set(record) - set(known):
        raise ValueError(f"{what} has the unknown key '{min(unknown)}'; known: {', '.join(known)}")
    if missing := set(known) - set(record) - set(optional):
        raise ValueError(f"{what} lacks the key '{min(missing)}'; needed: {', '.join(known)}")
    return dict(record)


def waveform_record(waveform: Waveform) -> dict[str, Any]:
    """Record of a waveform, without the fields at their defaults."""
    record: dict[str, Any] = {}
    for item in fields(Waveform):
        value = getattr(waveform, item.name)
        if item.default is MISSING or value != item.default:
            record[item.name] = value
    record["tx_order"] = list(waveform.tx_order)
    if waveform.other_profiles:
        record["other_profiles"] = [asdict(profile) for profile in waveform.other_profiles]
    if waveform.slots:
        record["slots"] = [
            {"phases_deg": list(slot.phases_deg), "profile": slot.profile, "advance_deg": list(slot.advance_deg)}
            for slot in waveform.slots
        ]
    if waveform.slot_starts is not None:
        record["slot_starts"] = list(waveform.slot_starts)
    return record


def waveform_from_record(record: Any) -> Waveform:
    """Inverse of :func:`waveform_record`."""
    known = Waveform.__dataclass_fields__
    optional = [name for name, item in known.items() if item.default is not MISSING]
    values = _keys("radar record: waveform", record, known, optional)
    if "other_profiles" in values:
        values["other_profiles"] = tuple(
            Profile(**_keys("radar record: waveform.other_profiles", entry, Profile.__dataclass_fields__))
            for entry in values["other_profiles"]
        )
    if "slots" in values:
        entries = [_keys("radar record: waveform.slots", entry, Slot.__dataclass_fields__) for entry in values["slots"]]
        values["slots"] = tuple(
            Slot(tuple(entry["phases_deg"]), entry["profile"], tuple(entry["advance_deg"])) for entry in entries
        )
    return Waveform(**values)


def fields_from_record(record: Any, known: tuple[str, ...]) -> dict[str, Any]:
    """Arguments of a radar, with the names `known`, from its record."""
    if isinstance(record, Mapping) and "polarization" in record:  # older runs: one for both ends
        record = dict(record)
        record["tx_polarization"] = record["rx_polarization"] = record.pop("polarization")
    record = _keys("radar record", record, known, optional=_OPTIONAL)
    arguments: dict[str, Any] = record | {
        "waveform": waveform_from_record(record["waveform"]),
        "pattern": pattern_from_record(record["pattern"], partial(_keys, "radar record: pattern")),
    }
    if "adc" in record:
        arguments["adc"] = Adc(
            **_keys("radar record: adc", record["adc"], Adc.__dataclass_fields__, ("real", "iq_swap"))
        )
    if record.get("trajectory") is not None:
        table = _keys("radar record: trajectory", record["trajectory"], Trajectory.__dataclass_fields__)
        arguments["trajectory"] = Trajectory(**table)
    lists = ("tx_names", "rx_names", "tx_phases_deg", "rx_phases_deg", "frequency_range")
    return arguments | {key: tuple(record[key]) for key in lists if key in record}
