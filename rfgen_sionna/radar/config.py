"""Strict reading of radar files in TOML: unknown keys, missing keys and wrong types are errors, all told at once."""

from __future__ import annotations

import copy
import math
import tomllib
from collections.abc import Callable, Iterator, Mapping
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


def _unit_checks(table: Mapping[str, Any]) -> Iterator[tuple[Callable[..., None], tuple[Any, ...]]]:
    """Checks of the magnitudes in a file of correct keys and types, with their arguments."""
    for dotted, (low, high) in _ZERO_OR.items():
        section, _, key = dotted.partition(".")
        value = table[section].get(key)
        if isinstance(value, (int, float)) and value != 0:
            yield check_plausible, (section, key, value, low, high, "0 or, in magnitude, ")
    for value in table["transmitter"]["frequency_range_hz"]:
        yield check_plausible, ("transmitter", "frequency_range_hz", value, *_FREQUENCY, "", False)
    pattern = table["pattern"]
    for cut in ("azimuth", "elevation"):
        yield check_cut, ("pattern", cut, pattern.get(f"{cut}_deg", ()), pattern.get(f"{cut}_db", ()))
    phases = [("array", key, angle) for key in _PHASES for angle in table["array"].get(key, ())]
    for place, key, angle in (*phases, *_slot_angles(table["preset"])):
        if angle != 0:
            yield check_plausible, (place, key, angle, *_SLOT_PHASE, "0 or, in magnitude, ")


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
    "adc": {"bits": (int,), "full_scale_dbm": (*_NUMBER, str)} | _keys((bool,), "real", "iq_swap"),
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
    "": {"source"},
    "array": {"design_frequency_hz", *_POSITIONS["tx"], *_POSITIONS["rx"], *_POLARIZATIONS, *_PHASES},
    "pattern": {"kind", "file", *_CUTS},
    "transmitter": {"phase_step_deg"},
    "adc": {"real", "iq_swap"},
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


_SECTIONS = ("array", "pattern", "transmitter", "receiver", "adc")
_MISSING, _UNKNOWN, _VALUE = range(3)
"""Kinds of problems, in the order in which they are told."""

_Problems = Iterator[tuple[int, str]]


def _value_problems(value: Any, wanted: tuple[type, ...], what: str) -> _Problems:
    if not isinstance(value, wanted) or (isinstance(value, bool) and bool not in wanted):
        yield _VALUE, f"{what} is {value!r}; {' or '.join(t.__name__ for t in wanted)} is needed"
    elif isinstance(value, float) and not math.isfinite(value):  # TOML allows nan and inf
        yield _VALUE, f"{what} is {value!r}; a finite number is needed"


def _section_problems(table: dict[str, Any], section: str, kind: str | None = None) -> _Problems:
    """Missing keys, unknown keys and values of a wrong type in one section of a kind (default: its own name)."""
    kind = section if kind is None else kind
    schema, optional = _SCHEMA[kind], _OPTIONAL.get(kind, set())
    prefix = f"{section}." if section else ""
    for key in schema:
        if key not in table and key not in optional:
            yield _MISSING, f"'{prefix}{key}' is missing"
    for key, value in table.items():
        what = f"'{prefix}{key}'"
        if key not in schema:
            yield _UNKNOWN, f"unknown key {what}; known there: {', '.join(sorted(schema))}"
            continue
        yield from _value_problems(value, schema[key], what)
        for item in value if isinstance(value, list) else ():
            yield from _value_problems(item, _ITEMS.get(key, _NUMBER), f"an entry of {what}")
            if isinstance(item, list):
                if len(item) != 3 and "_positions_" in key:
                    yield _VALUE, f"an entry of {what} is {item!r}; three numbers x, y, z are needed"
                for coordinate in item:
                    yield from _value_problems(coordinate, _NUMBER, f"a number in {what}")


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
    """Check the keys and types of a parsed radar file; `where` names it in errors.

    Raises
    ------
    RadarConfigError
        With all that is missing, unknown or wrong.
    """
    problems = [message for _, message in sorted(_problems(table), key=lambda problem: problem[0])]
    for check, arguments in () if problems else _unit_checks(table):
        try:
            check(*arguments)
        except RadarConfigError as error:
            problems.append(str(error))
    if len(problems) == 1:
        raise RadarConfigError(f"{where}: {problems[0]}")
    if problems:
        raise RadarConfigError("\n- ".join([f"{where}: {len(problems)} entries are missing or wrong:", *problems]))


def _problems(table: dict[str, Any]) -> _Problems:
    yield from _section_problems(table, "")
    inner = {name: table.get(name, {}) for name in (*_SECTIONS, "preset", "source")}
    inner = {name: section if isinstance(section, dict) else {} for name, section in inner.items()}
    for section in _SECTIONS:
        yield from _section_problems(inner[section], section)
    yield from _array_problems(inner["array"])
    yield from _pattern_problems(inner["pattern"])
    presets = inner["preset"]
    if not presets:
        needed = ", ".join(key for key in _SCHEMA["preset"] if key not in _OPTIONAL["preset"])
        yield _MISSING, f"at least one [preset.NAME] is needed, with {needed}, tx_order, {', '.join(CHIRP)}"
    for name, preset in presets.items():
        if isinstance(preset, dict):
            yield from _preset_problems(preset, f"preset.{name}")
        else:
            yield _VALUE, f"'preset.{name}' is {preset!r}; a table is needed"
    if presets and isinstance(table.get("default_preset"), str) and table["default_preset"] not in presets:
        yield _VALUE, f"default_preset is '{table['default_preset']}'; presets: {', '.join(sorted(presets))}"
    band = inner["transmitter"].get("frequency_range_hz")
    numbers = isinstance(band, list) and all(type(limit) in _NUMBER for limit in band)
    if numbers and (len(band) != 2 or not 0 < band[0] < band[1]):
        wanted = "two positive frequencies, the lower one first, are needed"
        yield _VALUE, f"'transmitter.frequency_range_hz' is {band!r}; {wanted}"
    for key, text in inner["source"].items():
        if not isinstance(text, str) or not text.strip():
            yield _VALUE, f"source of '{key}' is {text!r}; a text is needed"
        section, _, rest = key.partition(".")
        known = presets if section == "preset" else _SCHEMA[section] if section in _SECTIONS else None
        if known is None or rest not in ("", *known):
            yield _UNKNOWN, f"[source] names '{key}', which is not in the file"


def _preset_problems(preset: dict[str, Any], section: str) -> _Problems:
    """Problems of a preset: one chirp or several profiles, Tx elements in turn or slot by slot."""
    yield from _section_problems(preset, section, "preset")
    for kind in ("profile", "slot"):
        entries = preset.get(kind, ())
        for index, entry in enumerate(entries if isinstance(entries, list) else ()):
            if isinstance(entry, dict):
                yield from _section_problems(entry, f"{section}.{kind}[{index}]", kind)
    own = [key for key in CHIRP if key in preset]
    if "profile" in preset and own:
        yield _VALUE, f"'{section}' has profiles and a '{own[0]}' of its own; it goes into a profile"
    if "profile" not in preset:
        for key in CHIRP:
            if key not in preset:
                yield _MISSING, f"'{section}.{key}' is missing{'' if own else ' (or profiles)'}"
    if "slot" in preset and "tx_order" in preset:
        yield _VALUE, f"'{section}' has both of 'tx_order' and 'slot'; one of them is needed"
    if "slot" not in preset and "tx_order" not in preset:
        each = "'tx_order' (the Tx elements in turn, or coded) and 'slot' (slot by slot)"
        yield _MISSING, f"'{section}' has neither of {each}; one of them is needed"
    scheme = preset.get("multiplexing", "tdm")
    if "slot" in preset and "multiplexing" in preset:
        yield _VALUE, f"'{section}.multiplexing' does not go with slots; leave it out"
    if scheme not in ("tdm", "bpm", "ddm"):
        yield _VALUE, f"'{section}.multiplexing' is '{scheme}'; 'tdm', 'bpm' or 'ddm' is needed"
    for key, needed in (("bpm_code", "bpm"), ("doppler_bands", "ddm")):
        if key in preset and scheme != needed:
            yield _VALUE, f"'{section}.{key}' goes with multiplexing = '{needed}' only"


def _array_problems(array: dict[str, Any]) -> _Problems:
    """Positions have one unit with its wavelength, and both ends a polarisation."""
    for known in _POSITIONS.values():
        given = [key for key in known if key in array]
        if len(given) != 1:
            yield (
                _VALUE if given else _MISSING,
                f"[array] has {' and '.join(given) or 'no positions'}; either '{known[0]}' or '{known[1]}' is needed",
            )
        elif given[0].endswith("half_wavelengths") and "design_frequency_hz" not in array:
            yield _MISSING, f"'array.design_frequency_hz' is missing; array.{given[0]} counts in it"
    both, *each = _POLARIZATIONS
    given = [key for key in _POLARIZATIONS if key in array]
    if given not in ([both], each):
        wanted = f"either '{both}' or both of '{each[0]}' and '{each[1]}' are needed"
        yield _VALUE if given else _MISSING, f"[array] has {' and '.join(given) or 'no polarisation'}; {wanted}"


def _pattern_problems(pattern: dict[str, Any]) -> _Problems:
    """The keys are those of the kind of pattern."""
    kind = pattern.get("kind", "cuts")
    if not isinstance(kind, str):
        return
    needed, optional = {"cuts": (_CUTS, ()), "table": (("file",), ("peak_gain_dbi",))}.get(kind, ((), ()))
    if not (needed or kind.startswith("sionna:")):
        yield _VALUE, f"'pattern.kind' is {kind!r}; 'cuts', 'table' or 'sionna:NAME' is needed"
        return
    for key in needed:
        if key not in pattern:
            yield _MISSING, f"'pattern.{key}' is missing"
    for key in pattern:
        if key in _SCHEMA["pattern"] and key not in ("kind", *needed, *optional):
            yield _VALUE, f"'pattern.{key}' does not go with pattern.kind = '{kind}'"


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
        source = changed.get("source", {})
        for key in [key for key in source if key == dotted or key.startswith(f"{dotted}.")]:
            del source[key]
        if value is not None:
            inner[last] = copy.deepcopy(value)
    try:
        check_config(changed, where)
    except RadarConfigError as error:
        raise RadarConfigError(f"{error} (overrides: {', '.join(map(str, overrides))})") from error
    return changed
