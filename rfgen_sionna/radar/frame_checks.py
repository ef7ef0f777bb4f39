"""Checks of the order of Tx elements and of the slots of a frame."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rfgen_sionna.radar.slots import Slot, multiplexing_of


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
