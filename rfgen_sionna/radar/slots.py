"""Slots of a loop: Tx elements in turn (TDM), coded (BPM), in Doppler bands (DDM), as a beam."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rfgen_sionna._types import ComplexArray, FloatArray
from rfgen_sionna.radar.profile import is_number

_MOST_TX = 256
"""Largest number of Tx elements; above that of any cascade."""


@dataclass(frozen=True)
class Slot:
    """One ramp of a loop: active Tx elements, their phases, profile.

    Raises
    ------
    ValueError
        A field is out of range.
    """

    phases_deg: tuple[float | None, ...]
    """(tx,) radiated phase in the first loop [degrees], opposite in the mixed samples; None turns an element off."""
    profile: int = 0
    """Index of the ramp's profile."""
    advance_deg: tuple[float, ...] = ()
    """(tx,) phase advance per loop [degrees]; empty for none. 360 / n shifts the echoes down by an n-th of the Doppler
    spectrum."""

    def __post_init__(self) -> None:
        if not 1 <= len(self.phases_deg) <= _MOST_TX:
            raise ValueError(f"slot.phases_deg is {self.phases_deg!r}: one entry for each Tx element is needed")
        for value in self.phases_deg:
            if value is not None and not (is_number(value) and abs(value) <= 3600):
                raise ValueError(
                    f"slot.phases_deg has the entry {value!r}: a phase in -3600 … 3600 degrees, or None for an "
                    "element that is off, is needed"
                )
        if not self.on:
            raise ValueError(f"slot.phases_deg is {self.phases_deg!r}: at least one Tx element must be on")
        advance = self.advance_deg or (0.0,) * len(self.phases_deg)
        if len(advance) != len(self.phases_deg) or not all(is_number(value) and abs(value) <= 360 for value in advance):
            raise ValueError(
                f"slot.advance_deg is {self.advance_deg!r}: an angle in -360 … 360 degrees for each of "
                f"{len(self.phases_deg)} Tx elements is needed"
            )
        if isinstance(self.profile, bool) or not isinstance(self.profile, (int, np.integer)) or self.profile < 0:
            raise ValueError(f"slot.profile is {self.profile!r}: the index of a profile, from 0, is needed")
        phases = tuple(None if value is None else float(value) for value in self.phases_deg)
        object.__setattr__(self, "phases_deg", phases)
        object.__setattr__(self, "advance_deg", tuple(map(float, advance)) if any(advance) else ())
        object.__setattr__(self, "profile", int(self.profile))

    @property
    def on(self) -> tuple[int, ...]:
        """Indices of the active Tx elements."""
        return tuple(index for index, phase in enumerate(self.phases_deg) if phase is not None)

    def only(self, tx: Sequence[int]) -> Slot:
        """The slot with a subset of the Tx elements, as profile 0."""
        advance = tuple(self.advance_deg[index] for index in tx) if self.advance_deg else ()
        return Slot(tuple(self.phases_deg[index] for index in tx), 0, advance)

    def phases(self, loops: int, step_deg: float = 0.0) -> FloatArray:
        """(loop, tx) phases [degrees] in multiples of `step_deg` (0: exact); NaN for inactive elements."""
        start = np.array([np.nan if phase is None else phase for phase in self.phases_deg])
        phase = start + np.arange(loops)[:, None] * np.array(self.advance_deg or (0.0,) * len(start))
        return np.rint(phase / step_deg) * step_deg if step_deg else phase

    def weights(self, loops: int, step_deg: float = 0.0) -> ComplexArray:
        """(loop, tx) factors of magnitude 1, 0 for inactive elements; one row without an advance."""
        phase = self.phases(loops if self.advance_deg else 1, step_deg)
        return np.where(np.isnan(phase), 0.0, phasors(phase))


def phasors(phase_deg: FloatArray) -> ComplexArray:
    """exp(j phase) of phases [degrees], exact for quarter turns."""
    phase = np.mod(phase_deg, 360.0)
    turn = np.exp(1j * np.radians(phase))
    return np.asarray(np.where(phase % 90 == 0, np.rint(turn.real) + 1j * np.rint(turn.imag), turn))


def single(tx: int, count: int, profile: int = 0) -> Slot:
    """Slot of Tx element `tx` of `count` alone."""
    return Slot(tuple(0.0 if index == tx else None for index in range(count)), profile)


def hadamard_code(count: int) -> FloatArray:
    """(slot, tx) code of ±1 for `count` Tx elements: columns of the smallest Sylvester matrix."""
    from scipy.linalg import hadamard

    order = 1 << max(0, int(count - 1).bit_length())
    return np.asarray(hadamard(order)[:, :count], dtype=np.float64)


def coded_slots(code: FloatArray, members: Sequence[int], count: int, profile: int = 0) -> tuple[Slot, ...]:
    """BPM: Tx elements `members` of `count` fire at once, with the signs of `code` (slot, member).

    Raises
    ------
    ValueError
        The code has other entries than 1 and -1, or dependent columns.
    """
    code = np.asarray(code, dtype=np.float64)
    if code.ndim != 2 or code.shape[1] != len(members) or not np.all(np.abs(code) == 1):
        raise ValueError(
            f"bpm_code is {code.tolist()}: rows of 1 and -1, one for each of {len(members)} Tx, are needed"
        )
    if np.linalg.matrix_rank(code) < len(members):
        raise ValueError(
            f"bpm_code is {code.tolist()}: its columns are not independent; at least {len(members)} slots are needed, "
            f"for instance {hadamard_code(len(members)).tolist()}"
        )
    slots = []
    for row in code:
        phases: list[float | None] = [None] * count
        for member, sign in zip(members, row, strict=True):
            phases[member] = 0.0 if sign > 0 else 180.0
        slots.append(Slot(tuple(phases), profile))
    return tuple(slots)


def doppler_slot(bands: int, members: Sequence[int], count: int, profile: int = 0) -> Slot:
    """DDM: Tx elements `members` of `count` fire at once, the k-th shifted down by k of `bands` Doppler bands.

    Raises
    ------
    ValueError
        There are fewer bands than elements.
    """
    if isinstance(bands, bool) or not isinstance(bands, int) or not len(members) <= bands <= 64:
        raise ValueError(f"doppler_bands is {bands!r}: a whole number in {len(members)} … 64 is needed, one per Tx")
    phases: list[float | None] = [None] * count
    advance = [0.0] * count
    for band, member in enumerate(members):
        phases[member], advance[member] = 0.0, 360.0 * band / bands
    return Slot(tuple(phases), profile, tuple(advance))


def multiplexing_of(slots: Sequence[Slot]) -> str:
    """Multiplexing of the Tx elements in slots of one profile.

    "tdm": one at a time. "bpm": an invertible code of phases over the slots. "ddm": Doppler bands. "beam": none.

    Raises
    ------
    ValueError
        Phases advance in one of several slots, or by the same angle for two Tx elements.
    """
    if any(slot.advance_deg for slot in slots):
        if len(slots) > 1:
            raise ValueError(
                f"slot.advance_deg: {len(slots)} slots of one profile; Doppler bands take a single slot a loop"
            )
        gap = doppler_gap(slots[0])
        if gap < 1e-9:
            raise ValueError(
                f"slot.advance_deg is {slots[0].advance_deg!r}: two Tx elements would share a Doppler band; each "
                "needs an advance of its own"
            )
        return "ddm"
    used = sorted({tx for slot in slots for tx in slot.on})
    code = np.concatenate([slot.weights(1) for slot in slots])[:, used]
    if np.array_equal(np.sort(np.abs(code).sum(axis=0)), np.ones(len(used))) and len(code) == len(used) == code.sum():
        return "tdm"
    return "bpm" if np.linalg.matrix_rank(code, tol=1e-6) == len(used) else "beam"


def doppler_gap(slot: Slot) -> float:
    """Smallest gap between the Doppler bands of two Tx elements, over the Doppler spectrum."""
    at = np.sort(np.mod(np.array(slot.advance_deg)[list(slot.on)], 360.0)) / 360.0
    return float(np.diff(np.append(at, at[0] + 1.0)).min())


def slot_label(slot: Slot, names: Sequence[str]) -> str:
    """Tx elements and phases of a slot as text: "TX1-TX3", "TX1+TX2@90" (degrees)."""
    text = ""
    for tx in slot.on:
        phase = (slot.phases_deg[tx] or 0.0) % 360
        text += f"{'-' if phase == 180 else '+'}{names[tx]}{'' if phase in (0, 180) else f'@{phase:g}'}"
    return text.removeprefix("+")


def check_slots(slots: Sequence[Slot], profiles: int) -> None:
    """Check that slots have the same Tx elements, and that all elements and profiles are used (else ValueError)."""
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
