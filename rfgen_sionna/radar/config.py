"""Strict reading of the TOML files in `radars/`: unknown keys, missing keys and wrong types are errors."""

from __future__ import annotations

import copy
import math
import tomllib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

_ZERO_OR: dict[str, tuple[float, float]] = {
    "transmitter.power_dbm": (0.1, 80.0),
    "transmitter.phase_step_deg": (0.2, 180.0),
    "receiver.noise_figure_db": (0.3, 60.0),
    "receiver.temperature_k": (3.0, 2000.0),
    "adc.full_scale_dbm": (0.2, 150.0),
    "pattern.peak_gain_dbi": (0.1, 60.0),
}
"""Allowed magnitudes besides 0: a value with a wrong unit prefix falls outside."""
_FREQUENCY = (1e9, 1e12)
"""Allowed frequencies [Hz]: microwaves to submillimetre waves."""
_LEAST_SPAN, _LEAST_DEPTH, _MOST_DEPTH = 1.0, 0.3, 200.0
"""Allowed least span of angles [degrees] and depths of patterns [dB]: radians and factors fall outside."""
_SLOT_PHASE = (0.4, 360.0)
"""Allowed magnitudes of phases of slots and elements [degrees]: most radians fall outside."""


class RadarConfigError(ValueError):
    """A radar file has an unknown key, a wrong type, or a value that no radar can have."""


def check_plausible(
    where: str, key: str, value: float, low: float, high: float, also: str = "", signed: bool = True
) -> None:
    """Raise :class:`RadarConfigError` unless the magnitude of `value` is in `low` … `high`; `also` names other allowed
    values."""
    if not low <= (abs(value) if signed else value) <= high:
        raise RadarConfigError(
            f"{where}.{key} is {value:g}; {also}{low:g} … {high:g} is allowed (is it off by a prefix?)"
        )


def check_units(table: Mapping[str, Any], where: str) -> None:
    """Check magnitudes in a radar file of correct keys and types.

    Raises
    ------
    RadarConfigError
        A value is out of range.
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
    phases = [("array", key, angle) for key in _PHASES for angle in table["array"].get(key, ())]
    for place, key, angle in (*phases, *_slot_angles(table["preset"])):
        if angle != 0:
            check_plausible(f"{where}: {place}", key, angle, *_SLOT_PHASE, "0 or, in magnitude, ")


def check_cut(where: str, cut: str, angles: Any, levels: Any) -> None:
    """Check the span of a cut's angles [degrees] and the depth of its levels [dB]."""
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


_NUMBER = (int, float)

_Types = tuple[type, ...]


def _keys(types: _Types, *keys: str) -> dict[str, _Types]:
    return dict.fromkeys(keys, types)


CHIRP = _keys(
    _NUMBER,
    *("start_frequency_hz", "slope_hz_per_s", "sample_rate_hz", "idle_time_s", "adc_start_time_s", "ramp_end_time_s"),
)
"""Keys of a chirp, in the order of the fields of :class:`~rfgen_sionna.radar.profile.Profile`."""

_SCHEMA: dict[str, dict[str, _Types]] = {
    "": _keys((str,), "name", "description", "default_preset")
    | _keys((dict,), "array", "pattern", "transmitter", "receiver", "adc", "preset", "source"),
    "array": _keys(_NUMBER, "design_frequency_hz")
    | _keys((list,), "tx_names", "tx_positions_half_wavelengths", "tx_positions_m")
    | _keys((list,), "rx_names", "rx_positions_half_wavelengths", "rx_positions_m")
    | _keys((list,), "tx_phases_deg", "rx_phases_deg")
    | _keys((str,), "polarization", "tx_polarization", "rx_polarization"),
    "pattern": _keys((str,), "kind", "file")
    | _keys(_NUMBER, "peak_gain_dbi")
    | _keys((list,), "azimuth_deg", "azimuth_db", "elevation_deg", "elevation_db"),
    "transmitter": {"power_dbm": _NUMBER, "frequency_range_hz": (list,), "phase_step_deg": _NUMBER},
    "receiver": _keys(_NUMBER, "noise_figure_db", "temperature_k"),
    "adc": {"bits": (int,), "full_scale_dbm": (*_NUMBER, str), "real": (bool,)},
    "preset": CHIRP
    | {"num_samples": (int,), "num_loops": (int,), "tx_order": (list,), "frame_period_s": _NUMBER}
    | {"multiplexing": (str,), "bpm_code": (list,), "doppler_bands": (int,)}
    | {"profile": (list,), "slot": (list,), "max_range_m": _NUMBER},
    "profile": CHIRP,
    "slot": {"tx": (list,), "profile": (int,), "phase_deg": (list,), "advance_deg": (list,)},
}

_POSITIONS = {
    element: tuple(f"{element}_positions_{unit}" for unit in ("half_wavelengths", "m")) for element in ("tx", "rx")
}
_POLARIZATIONS = ("polarization", "tx_polarization", "rx_polarization")
_PHASES = ("tx_phases_deg", "rx_phases_deg")
_CUTS = ("peak_gain_dbi", "azimuth_deg", "azimuth_db", "elevation_deg", "elevation_db")
_OPTIONAL: dict[str, set[str]] = {
    "array": {"design_frequency_hz", *_POSITIONS["tx"], *_POSITIONS["rx"], *_POLARIZATIONS, *_PHASES},
    "pattern": {"kind", "file", *_CUTS},
    "transmitter": {"phase_step_deg"},
    "adc": {"real"},
    "preset": {*CHIRP, "tx_order", "multiplexing", "bpm_code", "doppler_bands", "profile", "slot", "max_range_m"},
    "slot": {"profile", "phase_deg", "advance_deg"},
}
"""Keys that a section may leave out, subject to the checks of that section."""

_ITEMS: dict[str, _Types] = (
    _keys((str,), "tx_names", "rx_names", "tx_order", "tx")
    | _keys((list,), *_POSITIONS["tx"], *_POSITIONS["rx"], "bpm_code")
    | _keys((dict,), "profile", "slot")
)
"""Types of list entries; other lists hold numbers."""


def _check_value(value: Any, wanted: tuple[type, ...], what: str) -> None:
    if not isinstance(value, wanted) or (isinstance(value, bool) and bool not in wanted):
        raise RadarConfigError(f"{what} is {value!r}; {' or '.join(t.__name__ for t in wanted)} is needed")
    if isinstance(value, float) and not math.isfinite(value):  # TOML allows nan and inf
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
                if len(item) != 3 and "_positions_" in key:
                    raise RadarConfigError(f"an entry of {what} is {item!r}; three numbers x, y, z are needed")
                for coordinate in item:
                    _check_value(coordinate, _NUMBER, f"a number in {what}")
    needed = [key for key in schema if key not in _OPTIONAL.get(section.partition(".")[0], ())]
    for key in needed:
        if key not in table:
            raise RadarConfigError(f"{where}: '{prefix}{key}' is missing (needed: {', '.join(needed)})")


def read_config(path: Path) -> dict[str, Any]:
    """Parse and check one radar file.

    Raises
    ------
    RadarConfigError
        The message names file, key, value and allowed values.
    """
    try:
        table = tomllib.loads(path.read_text(encoding="utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise RadarConfigError(f"{path}: not a TOML file: {error}") from error
    check_config(table, str(path))
    return table


def check_config(table: dict[str, Any], where: str) -> None:
    """Check the keys and types of a parsed radar file; `where` names it in errors."""
    _check(table, "", where)
    sections = ("array", "pattern", "transmitter", "receiver", "adc")
    for section in sections:
        _check(table[section], section, where)
    _check_array(table["array"], where)
    _check_pattern(table["pattern"], where)
    if not table["preset"]:
        raise RadarConfigError(f"{where}: at least one [preset.NAME] is needed")
    for name, preset in table["preset"].items():
        if not isinstance(preset, dict):
            raise RadarConfigError(f"{where}: 'preset.{name}' is {preset!r}; a table is needed")
        _check_preset(preset, f"preset.{name}", where)
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
    check_units(table, where)
    sourced = set(table["source"])
    for key, text in table["source"].items():
        if not isinstance(text, str) or not text.strip():
            raise RadarConfigError(f"{where}: source of '{key}' is {text!r}; a text is needed")
        section, _, rest = key.partition(".")
        if section in ("", "source") or section not in table or (rest and rest not in table[section]):
            raise RadarConfigError(f"{where}: [source] names '{key}', which is not in the file")
    for section in sections:
        for key in table[section]:
            if key.endswith(("_names", "_deg")) or key == "kind":
                continue
            if f"{section}.{key}" not in sourced and section not in sourced:
                raise RadarConfigError(
                    f"{where}: [source] has no entry for '{section}.{key}' (write 'assumption' if it is one)"
                )
    for name in table["preset"]:
        if f"preset.{name}" not in sourced:
            raise RadarConfigError(f"{where}: [source] has no entry for 'preset.{name}'")


def _check_preset(preset: dict[str, Any], section: str, where: str) -> None:
    """Check a preset: one chirp or several profiles, Tx elements in turn or slot by slot."""
    _check(preset, section, where)
    for kind in ("profile", "slot"):
        for index, entry in enumerate(preset.get(kind, ())):
            _check(entry, kind, f"{where}: {section}.{kind}[{index}]")
    own = [key for key in CHIRP if key in preset]
    if "profile" in preset and own:
        raise RadarConfigError(f"{where}: '{section}' has profiles and a '{own[0]}' of its own; it goes into a profile")
    if "profile" not in preset and len(own) < len(CHIRP):
        missing = min(set(CHIRP) - set(own))
        raise RadarConfigError(f"{where}: '{section}.{missing}' is missing (needed: {', '.join(CHIRP)}, or profiles)")
    if ("slot" in preset) == ("tx_order" in preset):
        raise RadarConfigError(
            f"{where}: '{section}' has {'both' if 'slot' in preset else 'neither'} of 'tx_order' (the Tx elements in "
            "turn, or coded) and 'slot' (slot by slot); one of them is needed"
        )
    scheme = preset.get("multiplexing", "tdm")
    if "slot" in preset and "multiplexing" in preset:
        raise RadarConfigError(f"{where}: '{section}.multiplexing' does not go with slots; leave it out")
    if scheme not in ("tdm", "bpm", "ddm"):
        raise RadarConfigError(f"{where}: '{section}.multiplexing' is '{scheme}'; 'tdm', 'bpm' or 'ddm' is needed")
    for key, needed in (("bpm_code", "bpm"), ("doppler_bands", "ddm")):
        if key in preset and scheme != needed:
            raise RadarConfigError(f"{where}: '{section}.{key}' goes with multiplexing = '{needed}' only")


def _check_array(array: dict[str, Any], where: str) -> None:
    """Check that positions have one unit with its wavelength, and both ends a polarisation."""
    for known in _POSITIONS.values():
        given = [key for key in known if key in array]
        if len(given) != 1:
            raise RadarConfigError(
                f"{where}: [array] has {' and '.join(given) or 'no positions'}; "
                f"either '{known[0]}' or '{known[1]}' is needed"
            )
        if given[0].endswith("half_wavelengths") and "design_frequency_hz" not in array:
            raise RadarConfigError(f"{where}: 'array.design_frequency_hz' is missing; array.{given[0]} counts in it")
    both, *each = _POLARIZATIONS
    given = [key for key in _POLARIZATIONS if key in array]
    if given not in ([both], each):
        raise RadarConfigError(
            f"{where}: [array] has {' and '.join(given) or 'no polarisation'}; either '{both}' or both of "
            f"'{each[0]}' and '{each[1]}' are needed"
        )


def _check_pattern(pattern: dict[str, Any], where: str) -> None:
    """Check the keys of the kind of pattern."""
    kind = pattern.get("kind", "cuts")
    needed, optional = {"cuts": (_CUTS, ()), "table": (("file",), ("peak_gain_dbi",))}.get(kind, ((), ()))
    if not (needed or kind.startswith("sionna:")):
        raise RadarConfigError(f"{where}: 'pattern.kind' is {kind!r}; 'cuts', 'table' or 'sionna:NAME' is needed")
    for key in needed:
        if key not in pattern:
            raise RadarConfigError(f"{where}: 'pattern.{key}' is missing (needed: {', '.join(needed)})")
    for key in pattern:
        if key not in ("kind", *needed, *optional):
            raise RadarConfigError(f"{where}: 'pattern.{key}' does not go with pattern.kind = '{kind}'")


def overridden(table: dict[str, Any], overrides: Mapping[str, Any], where: str) -> dict[str, Any]:
    """A checked copy of the table with other values under dotted keys.

    Parameters
    ----------
    overrides
        Dotted key ("receiver.noise_figure_db", "preset.mmmesh.num_loops") to value. A table as a value replaces the
        whole section; None removes a key.

    Raises
    ------
    RadarConfigError
        A key is unknown, or a value does not suit it.
    TypeError
        `overrides` is no mapping.
    """
    if not isinstance(overrides, Mapping):
        raise TypeError(f"overrides is {overrides!r}: a table of keys and values is needed, {{'adc.bits': 12}}")
    changed = copy.deepcopy(table)
    for dotted, value in overrides.items():
        *sections, last = str(dotted).split(".")
        inner: Any = changed
        for name in sections:
            inner = inner.get(name)
            if not isinstance(inner, dict):
                raise RadarConfigError(f"{where}: overrides has the unknown key '{dotted}': there is no table '{name}'")
        inner.pop(last, None)
        source = changed["source"]
        for key in [key for key in source if key == dotted or key.startswith(f"{dotted}.")]:
            del source[key]
        if value is not None:
            inner[last] = copy.deepcopy(value)
            if sections or isinstance(value, dict):
                source[".".join([*sections[:2], last][:2])] = "override"
    try:
        check_config(changed, where)
    except RadarConfigError as error:
        raise RadarConfigError(f"{error} (overrides: {', '.join(map(str, overrides))})") from error
    return changed
