"""Chirps of TI's xWR devices: profiles, variations from chirp to chirp, enabled Tx, their signs and phases.

A device has 4 profiles and 512 chirps, each with its profile, its Tx, its variations of the profile's start frequency,
slope, idle time and ADC start time, and the phases of its Tx: signs (BPM) and shifters of 5.625 degrees a step
(mmWaveLink interface). Where phases advance from loop to loop, the loops of one period of the phases become one longer
loop.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from decimal import Decimal, InvalidOperation
from typing import Any

import numpy as np

from rfgen_sionna.radar.board_frames import chirp_table
from rfgen_sionna.radar.config import RadarConfigError
from rfgen_sionna.radar.waveform import Waveform

PHASE_STEP = 5.625  # of the Tx phase shifters [degrees], 6 bits
MOST_CHIRPS = 512  # of one device (mmWaveLink interface)
MOST_PROFILES = 4  # of one device (mmWaveLink interface)

Variation = tuple[Decimal, Decimal, Decimal, Decimal]
"""Differences from the profile: start frequency [Hz], slope [Hz/s], idle time, ADC start time [s]."""
NO_VARIATION: Variation = (Decimal(0), Decimal(0), Decimal(0), Decimal(0))


@dataclass(frozen=True)
class TiProfile:
    """A profile of a device, in SI units."""

    start_frequency: Decimal
    slope: Decimal
    sample_rate: Decimal
    idle_time: Decimal
    adc_start_time: Decimal
    ramp_end_time: Decimal
    num_samples: int
    phases: Mapping[int, float] = field(default_factory=dict)
    """Phase of each Tx, by its number from 1 [degrees]."""
    backoff_db: Mapping[int, int] = field(default_factory=dict)
    """Power reduction of each Tx, by its number from 1 [dB]."""

    def varied(self, variation: Variation) -> TiProfile:
        """The profile with the variations of a chirp."""
        names = ("start_frequency", "slope", "idle_time", "adc_start_time")
        return replace(
            self, **{name: getattr(self, name) + change for name, change in zip(names, variation, strict=True)}
        )

    def table(self) -> dict[str, float]:
        """The chirp in the keys of a radar file."""
        values = (self.start_frequency, self.slope, self.sample_rate)
        return chirp_table(
            [float(value) for value in (*values, self.idle_time, self.adc_start_time, self.ramp_end_time)]
        )


@dataclass(frozen=True)
class TiChirp:
    """One chirp of a loop."""

    profile: int
    phases: Mapping[int, float]
    """Phase [degrees] of each Tx that fires, by its number from 1."""
    variation: Variation = NO_VARIATION


def decimal(value: Any, exponent: int) -> Decimal:
    """`value` times 10 to the `exponent`, without rounding.

    Raises
    ------
    ValueError
        `value` is not a finite number.
    """
    try:
        number = Decimal(str(value))
    except InvalidOperation:
        number = Decimal("nan")
    if isinstance(value, bool) or not number.is_finite():
        raise ValueError(f"{value!r}: a number is needed")
    return number.scaleb(exponent)


def shifter_phases(code: int, first: int, count: int) -> dict[int, float]:
    """Phases [degrees] of `count` Tx from number `first` on, from a word with 6 bits in each byte's upper part."""
    return {first + tx: PHASE_STEP * (code >> 8 * tx + 2 & 63) for tx in range(count)}


def backoffs(code: int, first: int, count: int) -> dict[int, int]:
    """Power reductions [dB] of `count` Tx from number `first` on, from a word with a byte for each."""
    return {first + tx: code >> 8 * tx & 255 for tx in range(count)}


def common_backoff(profiles: Mapping[int, TiProfile], chirps: Sequence[TiChirp]) -> int | None:
    """Power reduction [dB] of all Tx that fire; None where they differ."""
    found = {profiles[chirp.profile].backoff_db.get(tx, 0) for chirp in chirps for tx in chirp.phases}
    return found.pop() if len(found) == 1 else None


def frame_preset(
    chirps: Sequence[TiChirp], profiles: Mapping[int, TiProfile], loops: int, frame_period: Decimal
) -> dict[str, Any]:
    """Preset of a frame in the keys of a radar file, with Tx elements by their numbers; `frame_period` in s.

    Each variation of a profile is a profile of its own. A pattern that repeats within the loop becomes the loop.

    Raises
    ------
    ValueError
        The profiles have different numbers of samples.
    """
    chirps = [
        replace(
            chirp,
            phases={
                tx: (phase + profiles[chirp.profile].phases.get(tx, 0.0)) % 360 for tx, phase in chirp.phases.items()
            },
        )
        for chirp in chirps
    ]
    period = next(
        count
        for count in range(1, len(chirps) + 1)
        if len(chirps) % count == 0 and all(chirps[index % count] == chirp for index, chirp in enumerate(chirps))
    )
    loops, chirps = loops * (len(chirps) // period), chirps[:period]
    used = sorted({(chirp.profile, chirp.variation) for chirp in chirps})
    varied = [profiles[number].varied(variation) for number, variation in used]
    if len(counts := {profile.num_samples for profile in varied}) != 1:
        raise ValueError(f"numAdcSamples is {sorted(counts)}; all profiles of a frame must have the same number")
    preset: dict[str, Any] = {
        "num_samples": counts.pop(),
        "num_loops": loops,
        "frame_period_s": float(frame_period),
    }
    preset |= varied[0].table() if len(varied) == 1 else {"profile": [profile.table() for profile in varied]}
    alone = [tx for chirp in chirps for tx in chirp.phases if len(chirp.phases) == 1]
    if (
        len(varied) == 1
        and len(set(alone)) == len(chirps)
        and not any(phase for chirp in chirps for phase in chirp.phases.values())
    ):
        return preset | {"tx_order": alone}
    return preset | {"slot": [_slot(chirp, used.index((chirp.profile, chirp.variation))) for chirp in chirps]}


def _slot(chirp: TiChirp, profile: int) -> dict[str, Any]:
    slot: dict[str, Any] = {"tx": sorted(chirp.phases)}
    if profile:
        slot["profile"] = profile
    if any(chirp.phases.values()):
        slot["phase_deg"] = [chirp.phases[tx] for tx in slot["tx"]]
    return slot


def chirps_of(wave: Waveform, numbers: Sequence[int], most_profiles: int = MOST_PROFILES) -> tuple[list[TiChirp], int]:
    """Chirps of a loop, and the number of loops; `numbers` are the numbers of the Tx, from 1.

    Raises
    ------
    RadarConfigError
        A device has no such frame.
    """
    if wave.separated or wave.slot_starts is not None or wave.loop_time is not None:
        raise RadarConfigError(
            "the frame sets slot_starts or loop_time, or was demultiplexed; on the board chirps follow each other: "
            "write the cube as sampled"
        )
    if len(wave.profiles) > most_profiles:
        raise RadarConfigError(f"the frame has {len(wave.profiles)} profiles; the device has {most_profiles}")
    if not wave.slots:
        return [TiChirp(0, {numbers[tx]: 0.0}) for tx in wave.tx_order], wave.num_loops
    tables = [np.mod(slot.phases(wave.num_loops, wave.phase_step_deg), 360.0) for slot in wave.slots]
    period = next(
        count
        for count in range(1, wave.num_loops + 1)
        if wave.num_loops % count == 0 and all(_repeats(table, count) for table in tables)
    )
    if period * len(wave.slots) > MOST_CHIRPS:
        raise RadarConfigError(
            f"the phases of the slots repeat after {period} loops: {period * len(wave.slots)} chirps a loop, the "
            f"device has {MOST_CHIRPS}"
        )
    chirps = [
        TiChirp(slot.profile, {numbers[tx]: float(table[loop, tx]) for tx in slot.on})
        for loop in range(period)
        for slot, table in zip(wave.slots, tables, strict=True)
    ]
    return chirps, wave.num_loops // period


def _repeats(table: Any, period: int) -> bool:
    turned = np.exp(1j * np.radians(np.nan_to_num(table)))
    return bool(np.allclose(turned[period:], turned[:-period], atol=1e-9))
