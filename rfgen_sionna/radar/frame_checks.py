"""What a frame of chirps cannot be."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from rfgen_sionna.radar.profile import is_number
from rfgen_sionna.radar.slots import Slot, multiplexing_of

if TYPE_CHECKING:
    from rfgen_sionna.radar.waveform import Waveform


def _is_index(value: object) -> bool:
    return isinstance(value, (int, np.integer)) and not isinstance(value, bool)


def checked_order(order: Sequence[int]) -> tuple[int, ...]:
    """`order` as a tuple, if it fires each Tx element once."""
    fired = list(order)
    if not fired or not all(_is_index(tx) for tx in fired) or sorted(fired) != list(range(len(fired))):
        raise ValueError(
            f"waveform.tx_order is {order!r}: each of the Tx elements 0..n-1 must fire exactly once a loop"
        )
    return tuple(int(tx) for tx in fired)


def check_slots(slots: Sequence[Slot], profiles: int) -> None:
    """Slots for the same Tx elements, all of which fire, with profiles all of which are used."""
    if not all(isinstance(slot, Slot) for slot in slots):
        raise ValueError(f"waveform.slots is {slots!r}: a list of Slot is needed")
    count = len(slots[0].phases_deg)
    if any(len(slot.phases_deg) != count for slot in slots):
        raise ValueError(f"waveform.slots: all of them need {count} phases, one for each Tx element")
    if silent := set(range(count)) - {tx for slot in slots for tx in slot.on}:
        raise ValueError(f"waveform.slots: Tx element {min(silent)} never fires; leave it out of the radar")
    used = {slot.profile for slot in slots}
    if used != set(range(profiles)):
        raise ValueError(
            f"waveform.slots use the profiles {sorted(used)}; there are {profiles}, from 0, each of which must be used"
        )
    for number in used:
        multiplexing_of([slot for slot in slots if slot.profile == number])


def check_times(wave: Waveform) -> None:
    """Slots that don't overlap, loops that hold their slots, frames that hold their loops and Doppler bands."""
    chirps = [wave.profiles[slot.profile] for slot in wave.slots] or [wave.profiles[0]] * len(wave.tx_order)
    needed = sum(chirp.chirp_period for chirp in chirps)
    if wave.slot_starts is not None:
        starts = wave.slot_starts
        if len(starts) != len(chirps) or not np.all(np.isfinite(starts)) or min(starts) < 0:
            raise ValueError(
                f"waveform.slot_starts is {starts!r}: "
                f"a time [s] of at least 0 for each of {len(chirps)} slots is needed"
            )
        ends = [start + chirp.ramp_end_time for start, chirp in zip(starts, chirps, strict=True)]
        for index, (end, begin) in enumerate(zip(ends[:-1], starts[1:], strict=True)):
            if begin < end * (1 - 1e-9):
                raise ValueError(
                    f"waveform.slot_starts: slot {index + 1} starts at {begin * 1e6:g} us, before slot {index} ends at "
                    f"{end * 1e6:g} us: slots must not overlap"
                )
        needed = ends[-1]
    if wave.loop_time is not None and not (is_number(wave.loop_time) and wave.loop_time >= needed * (1 - 1e-9)):
        raise ValueError(
            f"waveform.loop_time is {wave.loop_time!r} s: its slots take {needed:.6g} s, at least that is needed"
        )
    if wave.frame_length > wave.frame_period * (1 + 1e-9):
        each = "" if wave.other_profiles else f" of {wave.chirp_period * 1e6:g} us"
        raise ValueError(
            f"waveform.frame_period is {wave.frame_period * 1e3:g} ms but {wave.num_loops} loops of "
            f"{wave.num_slots} slots{each} take {wave.frame_length * 1e3:.3f} ms: "
            f"lengthen the period or take at most {int(wave.frame_period / wave.loop_period)} loops"
        )
    if wave.doppler_bands > max(1.0, wave.num_loops / 2):
        raise ValueError(
            f"waveform.num_loops is {wave.num_loops}: {wave.doppler_bands:g} Doppler bands of at least 2 bins need "
            f"{2 * math.ceil(wave.doppler_bands)} loops"
        )
