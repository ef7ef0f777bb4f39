"""Samples of a radar from the paths of a recorded run."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna.dataset import Run, RunFormatError
from rfgen_sionna.dataset.stored_paths import PATHS, read_frame_paths, read_static_paths
from rfgen_sionna.frame_loop import sum_paths
from rfgen_sionna.radar import Radar
from rfgen_sionna.records import RadarPaths
from rfgen_sionna.scene.devices import tabulated
from rfgen_sionna.signal import receive
from rfgen_sionna.signal.receiver.receiver_record import ReceiverSource, read_receiver
from rfgen_sionna.signal.receiver.reception import ReceivedFrame
from rfgen_sionna.signal.synthesis import chosen_device

SAME_PLACE = 1e-9
"""Largest difference of the positions of two elements that are the same one [m], and of two frames [s]."""
_SAME_FREQUENCY = 1e3
"""Largest frequency beyond the recorded band [Hz]."""
_PLACE = "place it so: radar.placed(position=…, orientation=…)"
_ELEMENTS = "take a radar with the same elements, or trace it"
_EQUAL = {
    "position": _PLACE, "orientation": _PLACE, "trajectory": "give it the same trajectory", "pattern": _ELEMENTS,
    "tx_polarization": _ELEMENTS, "rx_polarization": _ELEMENTS,
}  # fmt: skip
"""What a radar has in common with the recorded one -> the cure."""


class SourceFrame(NamedTuple):
    """A frame, and the recorded one whose paths it has."""

    time: float
    """Start of the first ramp [s]."""
    source: int
    """Number of the recorded frame."""


@dataclass(frozen=True)
class Resynthesis:
    """Samples of a radar from the paths of a recorded run.

    Raises
    ------
    RunFormatError
        If the run has no paths.
    ValueError
        If the radar's elements, place, band, range window or frames are not within what was traced; the message names
        the value and the cure.
    """

    run: Run
    radar: Radar

    def __post_init__(self) -> None:
        traced, radar = tabulated(self.run.radar), tabulated(self.radar)
        object.__setattr__(self, "radar", radar)
        _ = self._paths, self._elements
        called, ours, theirs = self._called, radar.to_dict(), traced.to_dict()
        for name, cure in _EQUAL.items():
            if ours.get(name) != theirs.get(name):
                here, there = _short(ours.get(name)), _short(theirs.get(name))
                raise ValueError(f"{called}: {name} is {here}, recorded is {there}: {cure}")
        (low, high), (least, most) = radar.waveform.sampled_band, traced.waveform.sampled_band
        if low < least - _SAME_FREQUENCY or high > most + _SAME_FREQUENCY:
            raise ValueError(
                f"{called} samples {low / 1e9:.3f} … {high / 1e9:.3f} GHz, and the recorded paths are for "
                f"{least / 1e9:.3f} … {most / 1e9:.3f} GHz: take a preset within that band, or record with a wider one"
            )
        if radar.max_range > traced.max_range * (1 + 1e-9) and not self._all_within:
            raise ValueError(
                f"{called} has a range window of {radar.max_range:.2f} m, and the recorded paths end at "
                f"{traced.max_range:.2f} m: take a preset with a smaller window, or record with a larger one"
            )
        _ = self.frames

    @property
    def _called(self) -> str:
        return f"radar '{self.radar.name}' with preset '{self.radar.preset}'"

    @cached_property
    def _paths(self) -> Any:
        stored = self.run.stored(PATHS)
        if stored is None:
            raise RunFormatError(f"'{self.run.path}' holds no paths: record it with keep=[…, 'paths']")
        return stored

    @cached_property
    def _static(self) -> tuple[tuple[RadarPaths, ...], int]:
        return read_static_paths(self._paths)

    @property
    def _all_within(self) -> bool:
        """Whether no range window leaves out anything: direct returns in free space, of actors within the window."""
        run = self.run
        inside = "in_range" in run.labels and bool(np.all(run.labels["in_range"].values >= 1.0))
        return inside and not run.environment and run.settings.get("max_bounces") == 1

    @cached_property
    def _elements(self) -> tuple[list[int], list[int]]:
        """Recorded Tx and Rx elements of those of the radar."""
        found = []
        for end in ("tx", "rx"):
            ours, theirs = (getattr(radar, f"{end}_positions") for radar in (self.radar, self.run.radar))
            away = np.linalg.norm(ours[:, None] - theirs, axis=-1)
            if away.min(axis=1).max() > SAME_PLACE:
                number = int(away.min(axis=1).argmax())
                raise ValueError(
                    f"{self._called}: element {getattr(self.radar, f'{end}_names')[number]} is at "
                    f"{ours[number].tolist()} m in the device frame, where no recorded one is: take a preset of "
                    f"{', '.join(getattr(self.run.radar, f'{end}_names'))}, or record with all elements"
                )
            found.append(away.argmin(axis=1).tolist())
        return found[0], found[1]

    @cached_property
    def frames(self) -> tuple[SourceFrame, ...]:
        """Frames that fit into the recorded ones, one a frame period."""
        recorded, wave, times = self.run.radar.waveform, self.radar.waveform, self.run.frame_times
        length = len(times) * recorded.frame_period
        starts = times[0] + np.arange(int(np.floor(length / wave.frame_period + 1e-9))) * wave.frame_period
        slack = SAME_PLACE + 1e-6 * wave.frame_length
        found = []
        for start in starts.tolist():
            source = int(np.searchsorted(times, start + slack, side="right")) - 1
            after = start - float(times[source])
            if after + wave.frame_length > recorded.frame_length + slack:
                raise ValueError(
                    f"{self._called} takes a frame from {start:.6g} to {start + wave.frame_length:.6g} s, and the "
                    f"recorded paths there are from {times[source]:.6g} to "
                    f"{times[source] + recorded.frame_length:.6g} s: take a preset with frames of at most "
                    f"{recorded.frame_length:.6g} s, a whole number of {recorded.frame_period:g} s apart"
                )
            found.append(SourceFrame(float(times[source]) if abs(after) < slack else start, source))
        if not found:
            raise ValueError(
                f"{self._called} has a frame each {wave.frame_period:g} s, and {length:g} s are recorded: take a "
                "preset with a shorter period"
            )
        return tuple(found)

    def samples(self, receiver: ReceiverSource, seed: int, device: str = "auto") -> Iterator[NDArray[np.complex128]]:
        """Samples (chirp, tx, rx, sample) of each of the :attr:`frames` before the receiver [sqrt(W)]."""
        known = read_receiver(receiver, self.radar)
        gains, rtol, device = known.tx_gains(self.radar, seed), self.run.settings["rtol"], chosen_device(device)
        paths, num_static = self._static
        given: Any = num_static, rtol, gains, device
        static = sum_paths(self.radar, self._own(paths), 0.0, *given) if paths else 0.0
        for start, source in self.frames:
            yield sum_paths(self.radar, self._own(read_frame_paths(self._paths, source)), start, *given) + static

    def received(
        self, receiver: ReceiverSource, seed: int, device: str = "auto"
    ) -> Iterator[tuple[SourceFrame, ReceivedFrame]]:
        """Each frame with its samples behind the receiver; the first one sets an automatic full scale."""
        full_scale: float | None = None
        each = zip(self.frames, self.samples(receiver, seed, device), strict=True)
        for index, (frame, samples) in enumerate(each):
            capture = receive(samples, self.radar, receiver, seed=seed, frame=index, full_scale=full_scale)
            full_scale = capture.full_scale
            yield frame, capture

    def _own(self, paths: tuple[RadarPaths, ...]) -> list[RadarPaths]:
        """Paths of the radar's elements within its range window."""
        tx, rx = self._elements
        every = (list(range(len(self.run.radar.tx_names))), list(range(len(self.run.radar.rx_names))))
        found = []
        for each in paths:
            if (tx, rx) != every:
                channel = {name: getattr(each, name)[tx][:, rx] for name in ("a", "tau", "tau_rate")}
                bent = None if each.dispersion is None else each.dispersion[:, tx][:, :, rx]
                each = replace(each, **channel, dispersion=bent)
            if self.radar.max_range < self.run.radar.max_range:
                inside = each.range.mean(axis=1) < self.radar.max_range
                each = each if inside.all() else each.select(inside)
            found.append(each)
        return found


def _short(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 60 else f"{text[:57]}…"
