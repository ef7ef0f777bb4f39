"""`config.json` of Infineon's Radar SDK and Radar Fusion GUI, for its BGT60 sensors.

Layouts: `device_config.fmcw_single_shape` (frequencies as `start_`/`end_` or `lower_`/`upper_`), the fields of
`FmcwSimpleSequenceConfig`, and a `sequence` of one frame loop, one loop of chirps in it, and the chirps. Samples fill
the ramp from the start to the end frequency, as published range axes take it.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import replace
from decimal import Decimal
from typing import Any

from rfgen_sionna.radar.board_frames import FRAME, BoardFrames, RadarConfigWarning
from rfgen_sionna.radar.config import RadarConfigError
from rfgen_sionna.radar.ti_chirps import TiChirp, TiProfile, decimal, frame_preset

BOARD = "bgt60tr13c"
"""Board of a file that names none: the one whose receivers these layouts number."""

_FULL_POWER = 31  # the highest level


def is_infineon(record: Mapping[str, Any]) -> bool:
    """Whether a JSON object is a configuration of Infineon's tools."""
    return any(key in record for key in ("device_config", "fmcw_single_shape", "fmcw_scene", "sequence", "chirp"))


def read_infineon(record: Mapping[str, Any], where: str) -> BoardFrames:
    """Frames of a configuration of Infineon's tools; `where` names it in errors.

    Raises
    ------
    RadarConfigError
        Naming the field that is missing or not supported.
    """
    try:
        frames = _frames(record.get("device_config", record))
        device = record.get("device_info", {}).get("device_name")
        return frames if device is None else replace(frames, board=str(device))
    except KeyError as error:
        raise RadarConfigError(f"{where} lacks {error}") from error
    except (TypeError, ValueError, AttributeError, IndexError) as error:
        raise RadarConfigError(f"{where}: {error}") from error


def _frames(config: Mapping[str, Any]) -> BoardFrames:
    if "fmcw_single_shape" in config:
        return _single_shape(config["fmcw_single_shape"])
    if "fmcw_scene" in config:
        raise ValueError("fmcw_scene has requirements, which the SDK turns into chirps; fmcw_single_shape is read")
    if "sequence" in config:
        return _sequence(config["sequence"])
    if "chirp" in config:
        return _simple(config)
    raise ValueError(f"device_config has {', '.join(config)}; fmcw_single_shape, sequence or chirp is read")


def _single_shape(shape: Mapping[str, Any]) -> BoardFrames:
    start, end = (
        next((shape[key] for key in keys if key in shape), None)
        for keys in (("start_frequency_Hz", "lower_frequency_Hz"), ("end_frequency_Hz", "upper_frequency_Hz"))
    )
    if start is None or end is None:
        raise KeyError("start_frequency_Hz and end_frequency_Hz")
    transmitters = _listed(shape, "tx")
    mimo = str(shape.get("mimo_mode", "off")).lower()
    if mimo not in ("off", "tdm"):
        raise ValueError(f"mimo_mode is '{mimo}'; 'off' or 'tdm' is supported")
    if mimo == "off" and len(transmitters) != 1:
        raise ValueError(f"tx_antennas is {transmitters} with mimo_mode 'off'; one Tx is needed")
    profile = _profile(
        start, end, shape["sample_rate_Hz"], shape["num_samples_per_chirp"], shape["chirp_repetition_time_s"]
    )
    chirps = [TiChirp(0, {tx: 0.0}) for tx in transmitters]
    _check_power(shape)
    loops = _whole("num_chirps_per_frame", shape["num_chirps_per_frame"])
    preset = frame_preset(chirps, {0: profile}, loops, decimal(shape["frame_repetition_time_s"], 0))
    return BoardFrames({FRAME: preset}, tuple(_listed(shape, "rx")), True, board=BOARD)


def _simple(config: Mapping[str, Any]) -> BoardFrames:
    """Fields of FmcwSimpleSequenceConfig."""
    chirp = config["chirp"]
    transmitters = _listed(chirp, "tx")
    if bool(config.get("tdm_mimo", False)) != (len(transmitters) > 1):
        raise ValueError(f"tdm_mimo is {config.get('tdm_mimo')!r} with tx_mask {chirp.get('tx_mask')!r}")
    profile = _chirp_profile(chirp, config["chirp_repetition_time_s"])
    chirps = [TiChirp(0, {tx: 0.0}) for tx in transmitters]
    _check_power(chirp)
    loops = _whole("num_chirps", config["num_chirps"])
    preset = frame_preset(chirps, {0: profile}, loops, decimal(config["frame_repetition_time_s"], 0))
    return BoardFrames({FRAME: preset}, tuple(_listed(chirp, "rx")), True, board=BOARD)


def _sequence(sequence: Any) -> BoardFrames:
    """One loop of the frame, with one loop of chirps in it."""
    frame = _one(sequence, "the sequence")
    inner = _inner(frame)
    if isinstance(inner, Mapping) or len(inner) == 1:
        loop = _one(inner, "the frame's loop")
        if str(loop.get("type", "loop")).lower() != "loop" and _inner(loop, None) is None:
            raise ValueError("the frame's loop has chirps of its own; a loop of chirps is needed in it")
    else:
        raise ValueError(f"the frame's loop has {len(inner)} elements; one loop of chirps is supported")
    elements = _inner(loop)
    elements = [elements] if isinstance(elements, Mapping) else list(elements)
    elements = [element.get("chirp", element) for element in elements]
    if not all("start_frequency_Hz" in element for element in elements):
        raise ValueError("the loop of chirps holds delays or other loops; chirps alone are supported")
    if len({tuple(_listed(element, "rx")) for element in elements}) != 1:
        raise ValueError("the chirps have different rx_mask; the same receivers are needed in all of them")
    repetition = decimal(loop["repetition_time_s"], 0) / len(elements)
    profiles = {index: _chirp_profile(element, repetition) for index, element in enumerate(elements)}
    numbers = {index: list(profiles.values()).index(profile) for index, profile in profiles.items()}
    chirps = [
        TiChirp(numbers[index], dict.fromkeys(_listed(element, "tx"), 0.0)) for index, element in enumerate(elements)
    ]
    _check_power(elements[0])
    loops = _whole("num_repetitions", loop["num_repetitions"])
    preset = frame_preset(chirps, profiles, loops, decimal(frame["repetition_time_s"], 0))
    return BoardFrames({FRAME: preset}, tuple(_listed(elements[0], "rx")), True, board=BOARD)


def _one(elements: Any, what: str) -> Mapping[str, Any]:
    found = [elements] if isinstance(elements, Mapping) else list(elements)
    if len(found) != 1:
        raise ValueError(f"{what} has {len(found)} elements; one loop is supported")
    element: Mapping[str, Any] = found[0].get("loop", found[0])
    return element


def _inner(element: Mapping[str, Any], *default: None) -> Any:
    for key in ("sequence", "sub_sequence"):
        if key in element:
            return element[key]
    if default:
        return None
    raise KeyError("sequence")


def _chirp_profile(chirp: Mapping[str, Any], repetition: Any) -> TiProfile:
    return _profile(
        chirp["start_frequency_Hz"],
        chirp["end_frequency_Hz"],
        chirp["sample_rate_Hz"],
        chirp["num_samples"],
        repetition,
    )


def _profile(start: Any, end: Any, rate: Any, samples: Any, repetition: Any) -> TiProfile:
    count, sample_rate = _whole("number of samples", samples), decimal(rate, 0)
    if sample_rate <= 0 or count < 1:
        raise ValueError(f"sample_rate_Hz is {rate!r} and the number of samples {samples!r}; both must be positive")
    ramp = count / sample_rate
    idle = decimal(repetition, 0) - ramp
    if idle < 0:
        raise ValueError(f"a chirp of {float(ramp):g} s ({count} samples) does not fit into {float(repetition):g} s")
    low = decimal(start, 0)
    return TiProfile(low, (decimal(end, 0) - low) / ramp, sample_rate, idle, Decimal(0), ramp, count)


def _listed(table: Mapping[str, Any], end: str) -> list[int]:
    """Numbers of the "tx" or "rx" antennas, from a list or from a mask."""
    if f"{end}_antennas" in table:
        found = [_whole(f"{end}_antennas", number) for number in table[f"{end}_antennas"]]
    else:
        mask = _whole(f"{end}_mask", table[f"{end}_mask"])
        found = [bit + 1 for bit in range(16) if mask >> bit & 1]
    if not found or min(found) < 1:
        raise ValueError(f"{end}: {found} are in use; at least one, from 1, is needed")
    return found


def _check_power(table: Mapping[str, Any]) -> None:
    level = table.get("tx_power_level", _FULL_POWER)
    if level != _FULL_POWER:
        warnings.warn(
            f"tx_power_level is {level!r}; the power of the board's file is that of level {_FULL_POWER}: "
            "overrides={'transmitter.power_dbm': …} sets another one",
            RadarConfigWarning,
            stacklevel=7,
        )


def _whole(name: str, value: Any) -> int:
    if isinstance(value, bool) or not isinstance(value, (int, float)) or value != int(value):
        raise ValueError(f"{name} is {value!r}; a whole number is needed")
    return int(value)
