"""Other samples of a recorded run from its paths, without a trace: other noise, receivers, powers and presets."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from os import PathLike
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import FloatArray
from rfgen_sionna.dataset import ActorInfo, Label, Run, RunFormatError, RunInfo, RunWriter, open_run
from rfgen_sionna.dataset.representations import (
    KEPT,
    REPRESENTATIONS,
    checked_keep,
    representation_arrays,
    representation_values,
)
from rfgen_sionna.dataset.stored_paths import PATHS, read_frame_paths, read_static_paths
from rfgen_sionna.frame_loop import sum_paths
from rfgen_sionna.radar import Radar
from rfgen_sionna.records import RadarPaths
from rfgen_sionna.scene.devices import tabulated
from rfgen_sionna.signal import receive, receiver_record
from rfgen_sionna.signal.noise import check_whole
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


def resynthesize(
    run: Run,
    output: str | PathLike[str],
    *,
    radar: Radar | str | None = None,
    receiver: ReceiverSource | None = None,
    seed: int | None = None,
    keep: Collection[str] | None = None,
    device: str = "auto",
    words: bool = False,
    compressed: bool = False,
    dated: bool = True,
    overwrite: bool = False,
    recording: Mapping[str, Any] | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Run:
    """Write another recording of a run that keeps its paths, without a trace.

    The same radar, receiver and seed give the recorded samples. Another preset gives those of a trace of its own,
    within the run's tolerance.

    Parameters
    ----------
    run
        Run of one radar that was recorded with keep "paths".
    output
        File to write.
    radar
        Radar with the same elements, or some of them, at the same place, whose band, range window and frames lie within
        the recorded ones; or the name of a preset of the recorded radar. Power, noise figure and ADC may differ. None
        is the recorded one.
    receiver
        Impairments of the receiver, as of :meth:`rfgen_sionna.simulation.Simulator.adc`; None is the recorded one.
    seed
        Seed of all draws of the receiver; None is the recorded one.
    keep
        What is stored, as of :func:`rfgen_sionna.record`; meshes, joints, labels and images can be what the run has.
        None is what the run keeps, but paths.
    device
        Device that sums the paths.
    words, compressed, dated, overwrite
        As of :class:`rfgen_sionna.dataset.RunWriter`.
    recording
        Specification of the recording in a data set; None is that of the run.
    progress
        Called with the numbers of finished frames and of all frames.

    Returns
    -------
    The written run, open for a read.

    Raises
    ------
    RunFormatError
        If the run has no paths.
    ValueError, TypeError
        Before any sum, naming the argument, its value and the cure.
    """
    made = Resynthesis(run, chosen_radar(run, radar))
    known = read_receiver((run.receiver or {}) if receiver is None else receiver, made.radar)
    seed = check_whole("seed", (run.seeds.get("noise") or 0) if seed is None else seed)
    names = _checked_keep(run, keep)
    copied = _Copy(run, names, made.radar)
    info = copied.info(made, receiver_record(known), seed, recording)
    stored: dict[str, Any] = {"keep": names, "words": words, "compressed": compressed, "dated": dated}
    with RunWriter(output, info, overwrite=overwrite, **stored) as writer:
        copied.constants(writer)
        for number, (frame, capture) in enumerate(made.received(known, seed, device), 1):
            values = copied.frame(frame.source)
            values["arrays"] |= representation_values(names, capture.samples, made.radar)
            writer.append(
                capture.samples if "adc" in names else None, time=frame.time, full_scale=capture.full_scale,
                clipped=capture.clipped, **values,
            )  # fmt: skip
            if progress is not None:
                progress(number, len(made.frames))
    return open_run(output)


def chosen_radar(run: Run, radar: Radar | str | None) -> Radar:
    """The radar of an argument `radar` of :func:`resynthesize`; TypeError if it is none."""
    recorded = run.radar
    if radar is None:
        return recorded
    if isinstance(radar, str):
        place: dict[str, Any] = {"trajectory": recorded.trajectory, "orientation": recorded.orientation}
        return Radar.load(recorded.name, radar, position=recorded.position, **place)
    if not isinstance(radar, Radar):
        raise TypeError(f"radar is a {type(radar).__name__}: a Radar, the name of a preset or None is needed")
    return radar


def _short(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 60 else f"{text[:57]}…"


def _checked_keep(run: Run, keep: Collection[str] | None) -> tuple[str, ...]:
    has = set(run.contents)
    names = checked_keep([each for each in has if each != "paths"] if keep is None else keep, "pir" in has)
    computed = {"adc", *REPRESENTATIONS}
    for name in names:
        if name not in computed | (has - {"paths"}):
            raise ValueError(
                f"keep has '{name}', which the run '{run.path}' has not to copy; it has "
                f"{', '.join(sorted(has - {'paths'}))}"
            )
    return names


class _Copy:
    """What a run of other samples takes from the recorded one, as it is."""

    def __init__(self, run: Run, keep: tuple[str, ...], radar: Radar) -> None:
        self._run, self._keep, self._radar = run, keep, radar
        computed = {KEPT[name].dataset for name in REPRESENTATIONS}
        declared = {path: array for path, array in run.arrays.items() if path not in computed}
        if "body" not in keep:
            declared = {path: array for path, array in declared.items() if "/body/" not in path}
        of_frames = [path for path in declared if self._dims(path)[:1] == ("frame",) or declared[path].ragged]
        self._arrays = {path: declared[path] for path in of_frames}
        self._constants = {path: array for path, array in declared.items() if path not in of_frames}
        self._labels = run.labels if "labels" in keep else {}
        self._other_window = "in_range" in self._labels and radar.max_range != run.radar.max_range
        for name in run.actors if self._other_window else ():
            self._share_in_range(name, 0)  # needs its mesh

    def _dims(self, path: str) -> tuple[str, ...]:
        stored: Any = self._run.stored(path)
        return tuple(dim.label for dim in stored.dims)

    def info(
        self, made: Resynthesis, receiver: Mapping[str, Any], seed: int, recording: Mapping[str, Any] | None
    ) -> RunInfo:
        """Properties of the new run."""
        run = self._run
        settings = run.settings | {"frames": len(made.frames), "keep": list(self._keep)}
        if made.radar != run.radar:
            settings["traced"] = f"{run.radar.name}, {run.radar.preset}"
        return RunInfo(
            made.radar, run.prompt, run.negative_prompt, run.environment, run.seeds | {"noise": seed},
            tuple(map(self._actor, run.actors)),
            {
                name: Label(label.units, label.dims[1:], label.description, label.values.dtype.kind == "O")
                for name, label in self._labels.items()
            },
            run.report, receiver, settings, run.software,
            {**self._arrays, **representation_arrays(self._keep, made.radar)},
            (run.recording or None) if recording is None else recording,
        )  # fmt: skip

    def _actor(self, name: str) -> ActorInfo:
        actor = self._run.actors[name]
        if "vertices" not in self._keep:
            return ActorInfo(name, actor.material, np.empty((0, 3), np.int32), 0, joint_names=actor.joint_names)
        vertices = len(actor.vertices(0))
        return ActorInfo(
            name, actor.material, actor.faces, vertices, actor.part_names, actor.face_parts, actor.joint_names
        )  # fmt: skip

    def constants(self, writer: RunWriter) -> None:
        """Write the arrays without frames, and the records of bodies."""
        for name in self._run.actors if "body" in self._keep else ():
            path = f"actors/{name}/body"
            recorded: Any = self._run.stored(path)
            writer.radar().group.require_group(path).attrs.update(recorded.attrs)
        for path, array in self._constants.items():
            values: Any = self._run.array(path)
            writer.add_array(path, values, array)

    def frame(self, number: int) -> dict[str, Any]:
        """Arguments of :meth:`rfgen_sionna.dataset.RunWriter.append` from frame `number`, but samples and its time."""
        run, actors = self._run, self._run.actors
        labels = {name: label.values[number] for name, label in self._labels.items()}
        if self._other_window:
            labels["in_range"] = np.array([self._share_in_range(each, number) for each in actors])
        joints = {name: each.joints(number) for name, each in actors.items() if each.joint_names}
        return {
            "pir": run.pir(number) if "pir" in self._keep else None,
            "mesh_time": float(run.mesh_times[number]),
            "vertices": {name: each.vertices(number) for name, each in actors.items()}
            if "vertices" in self._keep
            else {},
            "joints": joints if "joints" in self._keep else {},
            "labels": labels,
            "arrays": {path: run.array(path, number) for path in self._arrays},
        }

    def _share_in_range(self, actor: str, number: int) -> float:
        """Share of the vertices of an actor within the range window."""
        place: FloatArray = np.asarray(self._radar.at(float(self._run.mesh_times[number])).position)
        away = np.linalg.norm(self._run.actors[actor].vertices(number) - place, axis=1)
        return float((away <= self._radar.max_range).mean())
