"""Waveform of a frame: chirps, slots, loops, and the limits that follow."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, fields, replace
from functools import cached_property

import numpy as np

from rfgen_sionna._short_repr import ShortRepr
from rfgen_sionna._types import SPEED_OF_LIGHT, ComplexArray, FloatArray
from rfgen_sionna.radar.profile import Profile, is_number
from rfgen_sionna.radar.slots import Slot, check_slots, doppler_gap, multiplexing_of


@dataclass(frozen=True, repr=False)
class Waveform(ShortRepr):
    """A frame of linear chirps: `num_loops` loops of slots. Times count from the start of each ramp.

    A chirp is `idle_time` of silence and a ramp of `ramp_end_time`; the ADC takes `num_samples` from `adc_start_time`
    on. A TDM-MIMO frame of one profile fires `tx_order` slot by slot. Other frames list `slots`, with Tx elements,
    phases and profile of each; the fields of this class are profile 0, `other_profiles` the next ones.

    The cube's axis "tx" has one entry per Tx element with `tx_order`, else one per slot.

    Raises
    ------
    ValueError
        A field is out of range, or fields do not fit each other; the message names field, value and allowed values.
    """

    start_frequency: float
    """Frequency at the start of the ramp [Hz]."""
    slope: float
    """[Hz/s]; negative sweeps downwards, 0 is a constant frequency (CW)."""
    sample_rate: float
    """Samples per second, complex or real ones [Hz]."""
    num_samples: int
    """Samples per chirp, the same for all profiles."""
    idle_time: float
    """[s]"""
    adc_start_time: float
    """[s]"""
    ramp_end_time: float
    """[s]"""
    num_loops: int
    tx_order: tuple[int, ...]
    """TDM: Tx index of each slot, each Tx once. Empty with `slots`."""
    frame_period: float
    """[s]"""
    other_profiles: tuple[Profile, ...] = ()
    slots: tuple[Slot, ...] = ()
    phase_step_deg: float = 0.0
    """Step of the phase shifters, to which phases are rounded [degrees]; 0 rounds none."""
    range_limit: float | None = None
    """Largest range [m] below the range window; None takes the window. Required without a slope."""
    slot_starts: tuple[float, ...] | None = None
    """Start of each slot's ramp after the loop's first ramp [s]; None puts one chirp right after the other."""
    loop_time: float | None = None
    """Loop period [s]; None takes the duration of the slots."""
    separated: bool = False
    """Whether demultiplexing has separated the Tx elements of a single slot; the axis "tx" then counts elements."""

    def __post_init__(self) -> None:
        for name in ("num_samples", "num_loops"):
            value = getattr(self, name)
            if isinstance(value, bool) or not isinstance(value, int) or value < 1:
                raise ValueError(f"waveform.{name} is {value!r}: a whole number of at least 1 is needed")
        object.__setattr__(self, "other_profiles", tuple(self.other_profiles))
        object.__setattr__(self, "slots", tuple(self.slots))
        for index, profile in enumerate(self.profiles):
            profile.check(self.num_samples, f"waveform.profile[{index}]" if self.other_profiles else "waveform")
        if not (is_number(self.frame_period) and self.frame_period > 0):
            raise ValueError(f"waveform.frame_period is {self.frame_period!r}: a positive, finite number is needed")
        if not self.slots:
            object.__setattr__(self, "tx_order", _checked_order(self.tx_order))
            if self.other_profiles:
                raise ValueError("waveform.other_profiles needs slots that use each profile")
        elif self.tx_order:
            raise ValueError("waveform has tx_order and slots: a frame is described by one of them")
        else:
            object.__setattr__(self, "tx_order", ())
            check_slots(self.slots, len(self.profiles))
        if not (is_number(self.phase_step_deg) and 0 <= self.phase_step_deg <= 180):
            raise ValueError(
                f"waveform.phase_step_deg is {self.phase_step_deg!r}: a step in 0 … 180 degrees is needed, 0 for none"
            )
        if self.separated and len(self.slots) != 1:
            raise ValueError("waveform.separated goes with a single slot, in which all Tx elements fire")
        if self.slot_starts is not None:
            object.__setattr__(self, "slot_starts", tuple(float(start) for start in self.slot_starts))
        _check_times(self)
        if self.range_limit is not None and not (is_number(self.range_limit) and self.range_limit > 0):
            raise ValueError(f"waveform.range_limit is {self.range_limit!r}: a positive, finite range [m] is needed")
        if self.range_limit is None and not any(profile.slope for profile in self.profiles):
            raise ValueError(
                "waveform.slope is 0: a constant frequency has no range resolution and needs a range_limit [m] (in a "
                "file: max_range_m), up to which surfaces count"
            )

    @cached_property
    def profiles(self) -> tuple[Profile, ...]:
        """All profiles; the fields of this class are the first one."""
        return (Profile(*(getattr(self, field.name) for field in fields(Profile))), *self.other_profiles)

    @property
    def num_slots(self) -> int:
        return len(self.slots or self.tx_order)

    @property
    def num_tx(self) -> int:
        return len(self.slots[0].phases_deg) if self.slots else len(self.tx_order)

    @property
    def multiplexing(self) -> str:
        """Scheme: "tdm", "bpm", "ddm", "beam" (:func:`~rfgen_sionna.radar.slots.multiplexing_of`), "none" (one Tx) or
        "separated"; different ones of several profiles joined by "+"."""
        if self.separated:
            return "separated"
        if self.num_tx == 1:
            return "none"
        if not self.slots:
            return "tdm"
        kinds = [
            multiplexing_of([slot for slot in self.slots if slot.profile == number])
            for number in range(len(self.profiles))
        ]
        return "+".join(dict.fromkeys(kinds))

    @property
    def doppler_bands(self) -> float:
        """Number of bands of the Doppler spectrum, empty ones included (DDM); else 1."""
        if self.slots and not self.separated and any(slot.advance_deg for slot in self.slots):
            return 1 / min(doppler_gap(slot) for slot in self.slots if slot.advance_deg)
        return 1.0

    def profile_axis(self, number: int) -> tuple[int, ...]:
        """Entries of the axis "tx" of profile `number`."""
        if not self.other_profiles:
            return tuple(range(len(self.axis_slots)))
        return tuple(index for index, slot in enumerate(self.slots) if slot.profile == number)

    def profile_tx(self, number: int) -> tuple[int, ...]:
        """Tx elements of profile `number`."""
        if not self.other_profiles:
            return tuple(range(self.num_tx))
        return tuple(sorted({tx for slot in self.slots if slot.profile == number for tx in slot.on}))

    def of_profile(self, number: int) -> Waveform:
        """The frame of one profile's chirps: its slots at their times, as profile 0.

        Raises
        ------
        ValueError
            There is no such profile.
        """
        if not (_is_index(number) and 0 <= number < len(self.profiles)):
            raise ValueError(f"profile is {number!r}: a whole number in 0 … {len(self.profiles) - 1} is needed")
        if not self.other_profiles:
            return self
        chosen, used, profile = list(self.profile_axis(number)), self.profile_tx(number), self.profiles[number]
        return replace(
            self,
            **asdict(profile),
            other_profiles=(),
            slots=tuple(self.slots[index].only(used) for index in chosen),
            slot_starts=tuple(self.slot_times[chosen].tolist()),
            loop_time=self.loop_period,
            range_limit=self.range_limit if profile.slope else self.max_range,
        )

    @cached_property
    def axis_slots(self) -> tuple[int, ...]:
        """Slot of each entry of the axis "tx"."""
        if self.separated:
            return (0,) * self.num_tx
        return tuple(range(self.num_slots)) if self.slots else tuple(np.argsort(self.tx_order).tolist())

    @property
    def slot_axis(self) -> tuple[int, ...]:
        """Entry of the axis "tx" of each slot, in order of time."""
        return tuple(range(len(self.axis_slots))) if self.slots else self.tx_order

    @cached_property
    def axis_weights(self) -> ComplexArray:
        """(loop, axis, tx) complex weights of the Tx elements; (1, axis, tx) for equal loops."""
        if self.separated or not self.slots:
            return np.eye(self.num_tx, dtype=np.complex128)[None]
        rows = [slot.weights(self.num_loops, self.phase_step_deg) for slot in self.slots]
        loops = max(len(row) for row in rows)
        return np.stack([np.broadcast_to(row, (loops, self.num_tx)) for row in rows], axis=1)

    @property
    def chirp_period(self) -> float:
        """Idle time and ramp of the first profile [s]."""
        return self.idle_time + self.ramp_end_time

    @cached_property
    def slot_times(self) -> FloatArray:
        """(slot,) start of each slot's ramp after the loop's first ramp [s]."""
        if self.slot_starts is not None:
            return np.array(self.slot_starts)
        if not self.other_profiles:
            return np.asarray(np.arange(self.num_slots) * self.chirp_period, dtype=np.float64)
        chirps = [self.profiles[slot.profile] for slot in self.slots]
        steps = [before.ramp_end_time + after.idle_time for before, after in itertools.pairwise(chirps)]
        return np.asarray(np.cumsum([0.0, *steps]), dtype=np.float64)

    @property
    def loop_period(self) -> float:
        """Time between two ramps of the same slot [s]."""
        if self.loop_time is not None:
            return self.loop_time
        if not self.other_profiles:
            return self.num_slots * self.chirp_period
        return float(sum(self.profiles[slot.profile].chirp_period for slot in self.slots))

    @property
    def frame_length(self) -> float:
        """Duration of a frame's chirps with idle times [s]."""
        return self.num_loops * self.loop_period

    @cached_property
    def sample_times(self) -> FloatArray:
        """(sample,) sample times of the first profile after the start of the ramp [s]."""
        return self.adc_start_time + np.arange(self.num_samples) / self.sample_rate

    @cached_property
    def chirp_times(self) -> FloatArray:
        """(chirp, axis) start of each ramp after the frame's first ramp [s]."""
        return np.arange(self.num_loops)[:, None] * self.loop_period + self.slot_times[list(self.axis_slots)]

    @property
    def sampled_band(self) -> tuple[float, float]:
        """Lowest and highest frequency in the ADC windows [Hz]."""
        bands = [profile.sampled_band(self.num_samples) for profile in self.profiles]
        return min(low for low, _ in bands), max(high for _, high in bands)

    @property
    def bandwidth(self) -> float:
        """Width of `sampled_band` [Hz]."""
        if not self.other_profiles:
            return abs(self.slope) * self.num_samples / self.sample_rate
        low, high = self.sampled_band
        return high - low

    @property
    def center_frequency(self) -> float:
        """Middle of `sampled_band` [Hz]."""
        if not self.other_profiles:
            return self.start_frequency + self.slope * (self.adc_start_time + 0.5 * self.num_samples / self.sample_rate)
        low, high = self.sampled_band
        return 0.5 * (low + high)

    @property
    def wavelength(self) -> float:
        """Wavelength at `center_frequency` [m]."""
        return SPEED_OF_LIGHT / self.center_frequency

    @property
    def range_resolution(self) -> float:
        """c / 2B of the profile with the widest band [m]; infinite without a slope."""
        widest = max(abs(profile.slope) / profile.sample_rate for profile in self.profiles) * self.num_samples
        return SPEED_OF_LIGHT / (2 * widest) if widest else float("inf")

    @property
    def range_window(self) -> float:
        """Largest range of all profiles whose beat frequency is below the sample rate [m]; a radar with a real ADC has
        half of it."""
        windows = [profile.range_window for profile in self.profiles if profile.slope]
        return max(windows, default=float("inf"))

    @property
    def max_range(self) -> float:
        """Lesser of `range_window` and `range_limit` [m]."""
        return self.range_window if self.range_limit is None else min(self.range_limit, self.range_window)

    @property
    def velocity_resolution(self) -> float:
        """Velocity resolution, wavelength / (2 loops loop_period) [m/s]."""
        return self.wavelength / (2 * self.num_loops * self.loop_period)

    @property
    def max_velocity(self) -> float:
        """Largest unambiguous radial speed, wavelength / (4 loop_period) over the Doppler bands [m/s]."""
        return self.wavelength / (4 * self.loop_period * self.doppler_bands)


def _check_times(wave: Waveform) -> None:
    """Check that slots do not overlap, and fit the loop, the frame and the Doppler bands (else ValueError)."""
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


def _is_index(value: object) -> bool:
    return isinstance(value, (int, np.integer)) and not isinstance(value, bool)


def _checked_order(order: Sequence[int]) -> tuple[int, ...]:
    """`order` as a tuple, checked to fire each Tx element once."""
    fired = list(order)
    if not fired or not all(_is_index(tx) for tx in fired) or sorted(fired) != list(range(len(fired))):
        raise ValueError(
            f"waveform.tx_order is {order!r}: each of the Tx elements 0..n-1 must fire exactly once a loop"
        )
    return tuple(int(tx) for tx in fired)
