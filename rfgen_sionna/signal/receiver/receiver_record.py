"""Receivers as JSON records and TOML files."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import asdict, fields
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from rfgen_sionna.radar import Adc, Radar
from rfgen_sionna.signal.receiver.channels import Coupling
from rfgen_sionna.signal.receiver.interference import Interferer
from rfgen_sionna.signal.receiver.receiver import PARTS, Receiver

ReceiverSource = Receiver | Mapping[str, Any] | str | PathLike[str]
"""A receiver, its record, or a TOML file with the keys of a record."""
_KNOWN = (*PARTS, "coupling", "interferers", "thermal_noise", "adc")


def receiver_record(receiver: Receiver) -> dict[str, Any]:
    """JSON record of the receiver, without the parts that are off."""
    record: dict[str, Any] = {"thermal_noise": receiver.thermal_noise, "adc": "none"}
    if receiver.adc is not None:
        record["adc"] = receiver.adc if isinstance(receiver.adc, str) else asdict(receiver.adc)
    for name in PARTS:
        if (part := getattr(receiver, name)) is not None:
            record[name] = asdict(part)
    if receiver.coupling is not None:
        matrix = np.array(receiver.coupling.matrix)
        record["coupling"] = {"real": matrix.real.tolist(), "imag": matrix.imag.tolist()}
    if receiver.interferers:
        record["interferers"] = [
            {item.name: getattr(other, item.name) for item in fields(Interferer)} | {"radar": other.radar.to_dict()}
            for other in receiver.interferers
        ]
    return record


def receiver_from_record(record: Mapping[str, Any], radar: Radar) -> Receiver:
    """Inverse of :func:`receiver_record`, with two abbreviations.

    `coupling` may have `level_db` and `phase_deg` of neighbours (:meth:`Coupling.of_neighbours`). The `radar` of an
    interferer may be a name or file, with `preset`, `position` and `look_at` or `orientation` beside it.

    Raises
    ------
    ValueError
        Naming the key, its value and the allowed values.
    """
    if not isinstance(record, Mapping):
        raise ValueError(f"receiver is {record!r}: a table with keys of {', '.join(_KNOWN)} is needed")
    _check_keys("receiver", record, _KNOWN)
    arguments: dict[str, Any] = dict(record)
    for name in record:
        if name in PARTS:
            arguments[name] = _part(PARTS[name], f"receiver.{name}", record[name])
    if "coupling" in record:
        arguments["coupling"] = _coupling(record["coupling"], radar)
    if "interferers" in record:
        arguments["interferers"] = tuple(_interferer(entry) for entry in _list(record["interferers"]))
    if "adc" in record:
        arguments["adc"] = _adc(record["adc"], radar)
    try:
        return Receiver(**arguments)
    except TypeError as error:
        raise ValueError(str(error)) from error


def read_receiver(source: ReceiverSource, radar: Radar) -> Receiver:
    """Receiver from a Receiver, a record or a TOML file with the keys of a record, checked against `radar`.

    Raises
    ------
    TypeError, ValueError
        If the file does not exist, or the receiver does not fit the radar.
    """
    if isinstance(source, Receiver):
        receiver = source
    elif isinstance(source, Mapping):
        receiver = receiver_from_record(source, radar)
    elif isinstance(source, (str, PathLike)):
        path = Path(source)
        if not path.is_file():
            raise ValueError(f"receiver file '{path}' does not exist")
        try:
            receiver = receiver_from_record(tomllib.loads(path.read_text(encoding="utf-8")), radar)
        except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
            raise ValueError(f"receiver file '{path}' is not a TOML file: {error}") from error
        except ValueError as error:
            raise ValueError(f"receiver file '{path}': {error}") from error
    else:
        raise TypeError(f"receiver is {source!r}: a Receiver, a table, the path of a TOML file or None is needed")
    receiver.check(radar)
    return receiver


def chosen_receiver(source: ReceiverSource | None, radar: Radar, noise: bool) -> Receiver:
    """Receiver of the arguments `receiver` and `noise` of a run, checked against `radar`.

    None is thermal noise and the radar's ADC, or without `noise` the ideal receiver; without `noise` another receiver
    loses its thermal noise.

    Raises
    ------
    TypeError, ValueError
        As :func:`read_receiver`.
    """
    if source is None:
        return Receiver() if noise else Receiver.ideal()
    known = read_receiver(source, radar)
    return known if noise else known.without_noise()


def _check_keys(label: str, record: Mapping[str, Any], known: Sequence[str]) -> None:
    if unknown := set(record) - set(known):
        raise ValueError(f"{label} has the unknown key '{min(unknown)}'; known: {', '.join(known)}")


def _part(kind: type, label: str, record: Any) -> Any:
    """One part from its table."""
    names = [item.name for item in fields(kind)]
    if not isinstance(record, Mapping):
        raise ValueError(f"{label} is {record!r}: a table with keys of {', '.join(names)} is needed")
    _check_keys(label, record, names)
    values = {key: _tuples(value) for key, value in record.items()}
    try:
        return kind(**values)
    except TypeError as error:
        raise ValueError(f"{label} lacks a key: {', '.join(names)} are known ({error})") from error


def _tuples(value: Any) -> Any:
    return tuple(_tuples(entry) for entry in value) if isinstance(value, (list, tuple)) else value


def _list(value: Any) -> list[Any]:
    if not isinstance(value, (list, tuple)):
        raise ValueError(f"receiver.interferers is {value!r}: a list of tables is needed")
    return list(value)


def _coupling(record: Any, radar: Radar) -> Coupling:
    if not isinstance(record, Mapping):
        raise ValueError(f"receiver.coupling is {record!r}: a table is needed")
    if "real" in record or "imag" in record:
        _check_keys("receiver.coupling", record, ("real", "imag"))
        try:
            real = np.array(record.get("real", 0.0), dtype=np.float64)
            matrix = real + 1j * np.array(record.get("imag", 0.0), dtype=np.float64)
        except (TypeError, ValueError) as error:
            raise ValueError(f"receiver.coupling is {record!r}: two square matrices of numbers are needed") from error
        return Coupling(tuple(map(tuple, np.atleast_2d(matrix))))
    _check_keys("receiver.coupling", record, ("real", "imag", "level_db", "phase_deg"))
    if "level_db" not in record:
        raise ValueError("receiver.coupling lacks 'level_db' (or 'real' and 'imag')")
    return Coupling.of_neighbours(radar, record["level_db"], record.get("phase_deg", 0.0))


def _interferer(record: Any) -> Interferer:
    place = ("preset", "board", "position", "orientation", "look_at")
    known = (*(item.name for item in fields(Interferer)), *place)
    if not isinstance(record, Mapping) or "radar" not in record:
        raise ValueError(f"receiver.interferers has {record!r}: a table with a 'radar' is needed")
    _check_keys("receiver.interferers", record, known)
    values = {key: _tuples(value) for key, value in record.items() if key not in place}
    if isinstance(record["radar"], Mapping):
        values["radar"] = Radar.from_dict(dict(record["radar"]))
    else:
        given = {key: _tuples(record[key]) for key in place if key in record}
        values["radar"] = Radar.load(record["radar"], given.pop("preset", None), **given)
    return Interferer(**values)


def _adc(record: Any, radar: Radar) -> Any:
    if record in ("radar", "none"):
        return None if record == "none" else record
    if not isinstance(record, Mapping):
        raise ValueError(
            f'receiver.adc is {record!r}: "radar", "none" or a table with bits and full_scale_dbm is needed'
        )
    level = record.get("full_scale_dbm")
    known = {"real": radar.adc.real} | dict(record) | {"full_scale_dbm": None if level == "auto" else level}
    return _part(Adc, "receiver.adc", known)
