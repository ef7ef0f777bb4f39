"""Configurations of TI's mmWave Studio: `<name>.mmwave.json`, for one device or a cascade of four.

Field names, units and checked values follow TI's MATLAB readers (`rawDataReader` of mmWave Studio, `JsonParser` of the
cascade examples) and the mmWaveLink interface.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from decimal import Decimal
from typing import Any

from rfgen_sionna.radar.board_frames import FRAME, BoardFrames
from rfgen_sionna.radar.ti_chirps import (
    PHASE_STEP,
    TiChirp,
    TiProfile,
    Variation,
    backoffs,
    common_backoff,
    decimal,
    frame_preset,
    shifter_phases,
)

TX_PER_DEVICE, RX_PER_DEVICE = 3, 4
MOST_TX = 4
"""Tx of a single device: the AWR2944 has four."""
_FRAMES = ("legacyFrameChirp", "singleFrameChirp")
_SUBFRAMES = "advancedFrameChirp"
_CHANGING = ("rlLoopbackBursts", "rlDynChirpCfgs", "rlDynPerChirpPhShftCfgs")
_LANES = {3: 2, 15: 4}


@dataclass(frozen=True)
class StudioConfig:
    """Content of a `.mmwave.json`."""

    frames: BoardFrames
    num_frames: int
    """0 runs until the radar is stopped."""
    interleaved: bool
    """Whether all receivers of a sample stand side by side (chInterleave 0)."""
    lanes: int | None
    """LVDS lanes; None where the file has none."""


def read_studio_config(config: Mapping[str, Any]) -> StudioConfig:
    """Read the JSON object of a `.mmwave.json`.

    Raises
    ------
    KeyError
        Naming a missing field.
    TypeError, ValueError, IndexError
        A field is not supported; the message names field and value.
    """
    records = sorted(config["mmWaveDevices"], key=lambda record: int(record["mmWaveDeviceId"]))
    if len(records) not in (1, 4):
        raise ValueError(f"mmWaveDevices has {len(records)} entries; 1 or 4 (a cascade) are needed")
    rf, raw = records[0]["rfConfig"], records[0]["rawDataCaptureConfig"]
    if rf["waveformType"] not in (*_FRAMES, _SUBFRAMES):
        raise ValueError(f"waveformType is '{rf['waveformType']}'; supported: {', '.join((*_FRAMES, _SUBFRAMES))}")
    output = rf["rlAdcOutCfg_t"]["fmt"]
    if output["b2AdcBits"] != 2 or output["b2AdcOutFmt"] not in (0, 1, 2):
        raise ValueError(
            f"b2AdcBits is {output['b2AdcBits']!r} and b2AdcOutFmt {output['b2AdcOutFmt']!r}; "
            "16 bits (2) and real (0) or complex samples (1 or 2) are supported"
        )
    interleave = raw["rlDevDataFmtCfg_t"]["chInterleave"]
    if interleave not in ((0, 1) if len(records) == 1 else (0,)):
        raise ValueError(f"chInterleave is {interleave!r}; {'0 or 1' if len(records) == 1 else 0} is supported")
    lanes = None
    if len(records) == 1 and "rlDevLaneEnable_t" in raw:
        lanes = _LANES.get(number(raw["rlDevLaneEnable_t"]["laneEn"]))
        if lanes is None:
            raise ValueError(
                f"laneEn is {raw['rlDevLaneEnable_t']['laneEn']!r}; two lanes (0x3) or four (0xF) are supported"
            )
    _check_fixed(records)
    profiles = _profiles(records)
    presets, num_frames, fired = _presets(records, profiles)
    receivers = tuple(
        RX_PER_DEVICE * place + bit + 1
        for place, record in enumerate(records)
        for bit in range(RX_PER_DEVICE)
        if number(record["rfConfig"]["rlChanCfg_t"]["rxChannelEn"]) >> bit & 1
    )
    backoff = common_backoff(profiles, fired)
    if backoff is None:
        raise ValueError("txOutPowerBackoffCode differs from Tx to Tx; the same for all of them is supported")
    swap = bool(raw["rlDevDataFmtCfg_t"]["iqSwapSel"])
    real = output["b2AdcOutFmt"] == 0
    frames = BoardFrames(presets, receivers, real, 16, float(backoff), devices=len(records), iq_swap=swap and not real)
    return StudioConfig(frames, num_frames, interleave == 0, lanes)


def _check_fixed(records: Sequence[Mapping[str, Any]]) -> None:
    """Refuse bursts and chirps that change while the radar runs."""
    for name in _CHANGING:
        for record in records:
            for entry in record["rfConfig"].get(name, ()):
                tables = [table for table in entry.values() if isinstance(table, Mapping)] or [entry]
                if any(table.get("isConfigured", 1) for table in tables):
                    raise ValueError(f"{name} is not empty; chirps that change while the radar runs are not supported")


def _presets(
    records: Sequence[Mapping[str, Any]], profiles: Mapping[int, TiProfile]
) -> tuple[dict[str, dict[str, Any]], int, list[TiChirp]]:
    """Presets, number of frames, and all chirps of the frames."""
    rf = records[0]["rfConfig"]
    if rf["waveformType"] in _FRAMES:
        frame = rf["rlFrameCfg_t"]
        chirps = _chirps(records, int(frame["chirpStartIdx"]), int(frame["chirpEndIdx"]))
        _check_profiles(chirps, profiles)
        period = decimal(frame["framePeriodicity_msec"], -3)
        preset = frame_preset(chirps, profiles, int(frame["numLoops"]), period)
        return {FRAME: preset}, int(frame["numFrames"]), chirps
    sequence = rf["rlAdvFrameCfg_t"]["frameSeq"]
    subframes = [entry["rlSubFrameCfg_t"] for entry in sequence["subFrameCfg"]][: int(sequence["numOfSubFrames"])]
    period = sum((decimal(each["subFramePeriodicity_msec"], -3) for each in subframes), Decimal(0))
    presets: dict[str, dict[str, Any]] = {}
    fired: list[TiChirp] = []
    for index, subframe in enumerate(subframes):
        for name in ("numOfBurst", "numOfBurstLoops"):
            if int(subframe[name]) != 1:
                raise ValueError(f"subFrameCfg[{index}]: {name} is {subframe[name]!r}; one burst (1) is supported")
        first = int(subframe["chirpStartIdx"])
        chirps = _chirps(records, first, first + int(subframe["numOfChirps"]) - 1)
        if int(sequence.get("forceProfile", 0)):
            chirps = [replace(chirp, profile=int(subframe["forceProfileIdx"])) for chirp in chirps]
        _check_profiles(chirps, profiles)
        presets[f"subframe{index}"] = frame_preset(chirps, profiles, int(subframe["numLoops"]), period)
        fired += chirps
    if not presets:
        raise ValueError(f"numOfSubFrames is {sequence['numOfSubFrames']!r}; at least one is needed")
    return presets, int(sequence["numFrames"]), fired


def _check_profiles(chirps: Sequence[TiChirp], profiles: Mapping[int, TiProfile]) -> None:
    if absent := {chirp.profile for chirp in chirps} - set(profiles):
        raise ValueError(f"rlChirps use profile {max(absent)}; rlProfiles has {sorted(profiles)}")


def _tx_of(records: Sequence[Mapping[str, Any]]) -> int:
    """Largest number of Tx of each device."""
    return MOST_TX if len(records) == 1 else TX_PER_DEVICE


def _profiles(records: Sequence[Mapping[str, Any]]) -> dict[int, TiProfile]:
    """Profiles of the first device by their numbers, with the phases and power reductions of the Tx of all devices."""
    entries = records[0]["rfConfig"]["rlProfiles"]
    if not entries:
        raise ValueError("rlProfiles has 0 profiles; one at least is needed")
    found: dict[int, TiProfile] = {}
    for entry in entries:
        table = entry["rlProfileCfg_t"]
        profile = int(table["profileId"])
        phases: dict[int, float] = {}
        power: dict[int, int] = {}
        for place, record in enumerate(records):
            own = [each["rlProfileCfg_t"] for each in record["rfConfig"]["rlProfiles"]]
            own = [each for each in own if int(each["profileId"]) == profile] or [table]
            first = TX_PER_DEVICE * place + 1
            phases |= shifter_phases(number(own[0].get("txPhaseShifter", 0)), first, _tx_of(records))
            power |= backoffs(number(own[0].get("txOutPowerBackoffCode", 0)), first, _tx_of(records))
        found[profile] = TiProfile(
            decimal(table["startFreqConst_GHz"], 9),
            decimal(table["freqSlopeConst_MHz_usec"], 12),
            decimal(table["digOutSampleRate"], 3),
            decimal(table["idleTimeConst_usec"], -6),
            decimal(table["adcStartTimeConst_usec"], -6),
            decimal(table["rampEndTime_usec"], -6),
            int(table["numAdcSamples"]),
            phases,
            power,
        )
    return found


def _chirps(records: Sequence[Mapping[str, Any]], first: int, last: int) -> list[TiChirp]:
    """Chirps `first` … `last` of all devices together."""
    chirps = []
    for index in range(first, last + 1):
        kinds: set[tuple[int, Variation]] = set()
        phases: dict[int, float] = {}
        for place, record in enumerate(records):
            rf = record["rfConfig"]
            for chirp in _at(rf["rlChirps"], "rlChirpCfg_t", index):
                kinds.add((int(chirp["profileId"]), _variation(chirp)))
                bits = number(chirp["txEnable"])
                for tx in range(_tx_of(records)):
                    if bits >> tx & 1:
                        phases[TX_PER_DEVICE * place + tx + 1] = 0.0
            for entry in _at(rf.get("rlBpmChirps", ()), "rlBpmChirpCfg_t", index):
                value = number(entry["constBpmVal"])
                _turn(phases, place, {tx: 180.0 * (value >> 2 * tx + 1 & 1) for tx in range(_tx_of(records))})
            for entry in _at(rf.get("rlRfPhaseShiftCfgs", ()), "rlRfPhaseShiftCfg_t", index):
                steps = {tx: float(entry.get(f"tx{tx}PhaseShift", 0)) for tx in range(_tx_of(records))}
                if wrong := [tx for tx, count in steps.items() if count not in range(64)]:
                    raise ValueError(
                        f"rlRfPhaseShiftCfgs, chirp {index}: tx{wrong[0]}PhaseShift is {steps[wrong[0]]:g}; a number "
                        f"of steps of {PHASE_STEP:g} degrees, 0 … 63, is needed"
                    )
                _turn(phases, place, {tx: PHASE_STEP * count for tx, count in steps.items()})
        if not phases:
            raise ValueError(f"rlChirps: chirp {index} fires no Tx")
        if len(kinds) != 1:
            raise ValueError(
                f"rlChirps: chirp {index} has the profiles {sorted({profile for profile, _ in kinds})}, with their "
                "variations: one for all devices is needed"
            )
        profile, variation = kinds.pop()
        chirps.append(TiChirp(profile, phases, variation))
    return chirps


def _variation(chirp: Mapping[str, Any]) -> Variation:
    return (
        decimal(chirp.get("startFreqVar_MHz", 0), 6),
        decimal(chirp.get("freqSlopeVar_KHz_usec", 0), 9),
        decimal(chirp.get("idleTimeVar_usec", 0), -6),
        decimal(chirp.get("adcStartTimeVar_usec", 0), -6),
    )


def _at(entries: Sequence[Mapping[str, Any]], kind: str, index: int) -> list[Mapping[str, Any]]:
    found = [entry[kind] for entry in entries]
    return [entry for entry in found if int(entry["chirpStartIdx"]) <= index <= int(entry["chirpEndIdx"])]


def _turn(phases: dict[int, float], place: int, shifts: Mapping[int, float]) -> None:
    for tx, shift in shifts.items():
        at = TX_PER_DEVICE * place + tx + 1
        if at in phases:
            phases[at] = (phases[at] + shift) % 360.0


def number(value: Any) -> int:
    """Integer from a number or a hexadecimal text."""
    return int(value, 16) if isinstance(value, str) else int(value)
