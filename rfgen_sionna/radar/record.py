"""Radars as JSON-able records, and back."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import partial
from typing import TYPE_CHECKING, Any

from rfgen_sionna.radar.adc import Adc
from rfgen_sionna.radar.pattern import pattern_from_record, pattern_record
from rfgen_sionna.radar.trajectory import Trajectory
from rfgen_sionna.radar.waveform import Waveform

if TYPE_CHECKING:
    from rfgen_sionna.radar.radar import Radar

_OPTIONAL = ("position", "orientation", "adc", "trajectory")
"""Keys that records may lack; those of older runs do."""


def _keys(what: str, record: Any, known: Iterable[str], optional: Iterable[str] = ()) -> dict[str, Any]:
    """`record` as a dictionary, or an error that names the key it should not have, or lacks."""
    if not isinstance(record, Mapping):
        raise ValueError(f"{what} is {record!r}: a table with the keys {', '.join(known)} is needed")
    if unknown := set(record) - set(known):
        raise ValueError(f"{what} has the unknown key '{min(unknown)}'; known: {', '.join(known)}")
    if missing := set(known) - set(record) - set(optional):
        raise ValueError(f"{what} lacks the key '{min(missing)}'; needed: {', '.join(known)}")
    return dict(record)


def radar_record(radar: Radar) -> dict[str, Any]:
    """See :meth:`~rfgen_sionna.radar.radar.Radar.to_dict`."""
    record = {
        "name": radar.name,
        "preset": radar.preset,
        "waveform": {key: getattr(radar.waveform, key) for key in Waveform.__dataclass_fields__}
        | {"tx_order": list(radar.waveform.tx_order)},
        "tx_names": list(radar.tx_names),
        "rx_names": list(radar.rx_names),
        "tx_positions": radar.tx_positions.tolist(),
        "rx_positions": radar.rx_positions.tolist(),
        "pattern": pattern_record(radar.pattern),
        "tx_polarization": radar.tx_polarization,
        "rx_polarization": radar.rx_polarization,
        "tx_power_dbm": radar.tx_power_dbm,
        "noise_figure_db": radar.noise_figure_db,
        "temperature": radar.temperature,
        "position": list(radar.position),
        "orientation": list(radar.orientation),
        "adc": {"bits": radar.adc.bits, "full_scale_dbm": radar.adc.full_scale_dbm},
    }
    if radar.trajectory is None:
        return record
    if not isinstance(radar.trajectory, Trajectory):
        raise ValueError(
            f"radar.trajectory is a {type(radar.trajectory).__name__}, which no file can hold: "
            "Trajectory(times, positions, orientations) can be stored"
        )
    return record | {"trajectory": radar.trajectory.to_dict()}


def fields_from_record(record: Any, known: tuple[str, ...]) -> dict[str, Any]:
    """Arguments of a radar from its record; `known` are their names."""
    if isinstance(record, Mapping) and "polarization" in record:  # older runs have one for both ends
        record = dict(record)
        record["tx_polarization"] = record["rx_polarization"] = record.pop("polarization")
    record = _keys("radar record", record, known, optional=_OPTIONAL)
    waveform = _keys("radar record: waveform", record["waveform"], Waveform.__dataclass_fields__)
    fields: dict[str, Any] = record | {
        "waveform": Waveform(**waveform),
        "pattern": pattern_from_record(record["pattern"], partial(_keys, "radar record: pattern")),
    }
    if "adc" in record:
        fields["adc"] = Adc(**_keys("radar record: adc", record["adc"], Adc.__dataclass_fields__))
    if record.get("trajectory") is not None:
        table = _keys("radar record: trajectory", record["trajectory"], Trajectory.__dataclass_fields__)
        fields["trajectory"] = Trajectory(**table)
    return fields | {key: tuple(record[key]) for key in ("tx_names", "rx_names")}
