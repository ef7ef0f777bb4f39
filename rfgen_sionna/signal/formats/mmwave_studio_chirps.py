"""Slots in mmWave Studio's JSON: chirps of a profile, their enabled Tx, BPM and phase shifters.

A device has up to 512 chirps a loop, each with its Tx (`txEnable`), their signs (`rlBpmChirps`, a bit pair for each Tx:
between and during chirps) and their phase shifts (`rlRfPhaseShiftCfgs`, 5.625 degrees a step). Where phases advance
from loop to loop, the loops of one period of the phases become one longer loop.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from rfgen_sionna.radar import Profile, Slot, Waveform
from rfgen_sionna.signal.formats.capture import CaptureFormatError

TX_PER_DEVICE, RX_PER_DEVICE = 3, 4
FULL_SCALE = 1 << 15  # of the devices' 16-bit words [LSB]
PHASE_STEP = 5.625  # of the Tx phase shifters [degrees], 6 bits
MOST_CHIRPS = 512  # a loop, of one device (mmWaveLink interface)
MOST_PROFILES = 4  # of one device (mmWaveLink interface)
_FIELDS = (
    "mmWaveDeviceId waveformType rxChannelEn b2AdcBits b2AdcOutFmt profileId startFreqConst_GHz idleTimeConst_usec "
    "adcStartTimeConst_usec rampEndTime_usec freqSlopeConst_MHz_usec numAdcSamples digOutSampleRate chirpStartIdx "
    "chirpEndIdx startFreqVar_MHz freqSlopeVar_KHz_usec idleTimeVar_usec adcStartTimeVar_usec txEnable constBpmVal "
    "tx0PhaseShift tx1PhaseShift tx2PhaseShift numLoops numFrames framePeriodicity_msec iqSwapSel chInterleave laneEn"
)
CHECKED_FIELDS = frozenset(_FIELDS.split())
"""Fields that determine the samples or their layout. Others, such as gains and filters, may differ."""


@dataclass(frozen=True)
class StudioChirp:
    """One chirp of a loop."""

    profile: int
    phases: Mapping[int, float]
    """Phase [degrees] of each Tx that fires, by its number from 1."""


def chirps_of(wave: Waveform, numbers: Sequence[int]) -> tuple[list[StudioChirp], int]:
    """Chirps of a loop, and the number of loops; `numbers` are the numbers of the Tx, from 1.

    Raises
    ------
    CaptureFormatError
        If the device has no such frame.
    """
    if wave.separated or wave.slot_starts is not None or wave.loop_time is not None:
        raise CaptureFormatError(
            "the frame sets slot_starts or loop_time, or was demultiplexed; on the board chirps follow each other: "
            "write the cube as sampled"
        )
    if len(wave.profiles) > MOST_PROFILES:
        raise CaptureFormatError(f"the frame has {len(wave.profiles)} profiles; the device has {MOST_PROFILES}")
    if not wave.slots:
        return [StudioChirp(0, {numbers[tx]: 0.0}) for tx in wave.tx_order], wave.num_loops
    tables = [np.mod(slot.phases(wave.num_loops, wave.phase_step_deg), 360.0) for slot in wave.slots]
    period = next(
        count
        for count in range(1, wave.num_loops + 1)
        if wave.num_loops % count == 0 and all(_repeats(table, count) for table in tables)
    )
    if period * len(wave.slots) > MOST_CHIRPS:
        raise CaptureFormatError(
            f"the phases of the slots repeat after {period} loops: {period * len(wave.slots)} chirps a loop, the "
            f"device has {MOST_CHIRPS}"
        )
    chirps = [
        StudioChirp(slot.profile, {numbers[tx]: float(table[loop, tx]) for tx in slot.on})
        for loop in range(period)
        for slot, table in zip(wave.slots, tables, strict=True)
    ]
    return chirps, wave.num_loops // period


def _repeats(table: Any, period: int) -> bool:
    turned = np.exp(1j * np.radians(np.nan_to_num(table)))
    return bool(np.allclose(turned[period:], turned[:-period], atol=1e-9))


def chirp_tables(chirps: Sequence[StudioChirp], device: int) -> dict[str, list[dict[str, Any]]]:
    """Lists `rlChirps`, `rlBpmChirps` and `rlRfPhaseShiftCfgs` of one device."""
    first = TX_PER_DEVICE * device + 1
    tables: dict[str, list[dict[str, Any]]] = {"rlChirps": [], "rlBpmChirps": [], "rlRfPhaseShiftCfgs": []}
    signs_only = all(phase in (0.0, 180.0) for chirp in chirps for phase in chirp.phases.values())
    for index, chirp in enumerate(chirps):
        own = {tx - first: phase for tx, phase in chirp.phases.items() if 0 <= tx - first < TX_PER_DEVICE}
        place = {"chirpStartIdx": index, "chirpEndIdx": index}
        tables["rlChirps"].append(
            {
                "rlChirpCfg_t": place
                | {
                    "profileId": chirp.profile,
                    "startFreqVar_MHz": 0.0,
                    "freqSlopeVar_KHz_usec": 0.0,
                    "idleTimeVar_usec": 0.0,
                    "adcStartTimeVar_usec": 0.0,
                    "txEnable": f"0x{sum(1 << tx for tx in own):X}",
                }
            }
        )
        if not any(own.values()):
            continue
        if signs_only:
            value = sum(3 << 2 * tx for tx, phase in own.items() if phase)
            tables["rlBpmChirps"].append({"rlBpmChirpCfg_t": place | {"constBpmVal": f"0x{value:X}"}})
        else:
            shifts = {f"tx{tx}PhaseShift": _steps(own.get(tx, 0.0)) for tx in range(TX_PER_DEVICE)}
            tables["rlRfPhaseShiftCfgs"].append({"rlRfPhaseShiftCfg_t": place | shifts})
    return tables


def _steps(phase: float) -> int:
    steps = phase / PHASE_STEP
    if abs(steps - round(steps)) > 1e-6:
        raise CaptureFormatError(
            f"a slot has the phase {phase:g} degrees; the device's phase shifters have steps of {PHASE_STEP:g} "
            "(transmitter.phase_step_deg rounds to them)"
        )
    return round(steps) % 64


def read_chirps(records: Sequence[dict[str, Any]], first: int, last: int) -> list[StudioChirp]:
    """Chirps `first` … `last` of all devices together."""
    chirps = []
    for index in range(first, last + 1):
        profiles: set[int] = set()
        phases: dict[int, float] = {}
        for place, record in enumerate(records):
            rf = record["rfConfig"]
            for chirp in _at(rf["rlChirps"], "rlChirpCfg_t", index):
                profiles.add(int(chirp["profileId"]))
                bits = number(chirp["txEnable"])
                for tx in range(TX_PER_DEVICE):
                    if bits >> tx & 1:
                        phases[TX_PER_DEVICE * place + tx + 1] = 0.0
            for entry in _at(rf.get("rlBpmChirps", ()), "rlBpmChirpCfg_t", index):
                value = number(entry["constBpmVal"])
                _turn(phases, place, {tx: 180.0 * (value >> 2 * tx + 1 & 1) for tx in range(TX_PER_DEVICE)})
            for entry in _at(rf.get("rlRfPhaseShiftCfgs", ()), "rlRfPhaseShiftCfg_t", index):
                _turn(
                    phases,
                    place,
                    {tx: PHASE_STEP * float(entry.get(f"tx{tx}PhaseShift", 0)) for tx in range(TX_PER_DEVICE)},
                )
        if not phases:
            raise ValueError(f"rlChirps: chirp {index} fires no Tx")
        if len(profiles) != 1:
            raise ValueError(
                f"rlChirps: chirp {index} has the profiles {sorted(profiles)}: one for all devices is needed"
            )
        chirps.append(StudioChirp(profiles.pop(), phases))
    return chirps


def _at(entries: Sequence[dict[str, Any]], kind: str, index: int) -> list[dict[str, Any]]:
    found = [entry[kind] for entry in entries]
    return [entry for entry in found if int(entry["chirpStartIdx"]) <= index <= int(entry["chirpEndIdx"])]


def _turn(phases: dict[int, float], place: int, shifts: Mapping[int, float]) -> None:
    for tx, shift in shifts.items():
        at = TX_PER_DEVICE * place + tx + 1
        if at in phases:
            phases[at] = (phases[at] + shift) % 360.0


def slots_of(chirps: Sequence[StudioChirp], fired: Sequence[int]) -> tuple[tuple[int, ...], tuple[Slot, ...]]:
    """`tx_order` and `slots` of a waveform, one of them empty; `fired` are the numbers of its Tx elements."""
    alone = [next(iter(chirp.phases)) for chirp in chirps if len(chirp.phases) == 1]
    plain = len(alone) == len(set(alone)) == len(chirps) and not any(
        chirp.profile or any(chirp.phases.values()) for chirp in chirps
    )
    if plain:
        return tuple(fired.index(tx) for tx in alone), ()
    return (), tuple(Slot(tuple(chirp.phases.get(tx) for tx in fired), chirp.profile) for chirp in chirps)


def read_profiles(entries: Sequence[dict[str, Any]]) -> tuple[list[Profile], int]:
    """Profiles in the order of their numbers, and their common number of samples."""
    if not entries:
        raise ValueError("rlProfiles has 0 profiles; one at least is needed")
    tables = sorted((entry["rlProfileCfg_t"] for entry in entries), key=lambda table: int(table["profileId"]))
    counts = {int(table["numAdcSamples"]) for table in tables}
    if len(counts) != 1:
        raise ValueError(f"rlProfiles: numAdcSamples is {sorted(counts)}; all profiles must have the same number")
    profiles = [
        Profile(
            start_frequency=float(table["startFreqConst_GHz"]) * 1e9,
            slope=float(table["freqSlopeConst_MHz_usec"]) * 1e12,
            sample_rate=float(table["digOutSampleRate"]) * 1e3,
            idle_time=float(table["idleTimeConst_usec"]) * 1e-6,
            adc_start_time=float(table["adcStartTimeConst_usec"]) * 1e-6,
            ramp_end_time=float(table["rampEndTime_usec"]) * 1e-6,
        )
        for table in tables
    ]
    return profiles, counts.pop()


def number(value: Any) -> int:
    """Integer from a number or a hexadecimal text."""
    return int(value, 16) if isinstance(value, str) else int(value)
