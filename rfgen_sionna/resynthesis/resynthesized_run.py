"""Runs of other samples, written from the paths of a recorded one."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping
from os import PathLike
from typing import Any

from rfgen_sionna.dataset import Run, RunInfo, RunWriter, open_run
from rfgen_sionna.dataset.representations import REPRESENTATIONS, checked_keep, representation_values
from rfgen_sionna.radar import Radar
from rfgen_sionna.resynthesis.copied_contents import CopiedContents
from rfgen_sionna.resynthesis.path_samples import Resynthesis
from rfgen_sionna.signal import receiver_record
from rfgen_sionna.signal.noise import check_whole, noise_seed
from rfgen_sionna.signal.receiver.receiver_record import ReceiverSource, read_receiver

RadarChoice = Radar | str | None
"""A radar, the name of a preset of the recorded one, or None for that."""


def resynthesize(
    run: Run,
    output: str | PathLike[str],
    *,
    radar: RadarChoice | Mapping[str, RadarChoice] = None,
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
        Run of one or several radars that was recorded with keep "paths".
    output
        File to write.
    radar
        Radar with the same elements, or some of them, at the same place, whose band, range window and frames lie within
        the recorded ones; or the name of a preset of the recorded radar. Power, noise figure and ADC may differ. None
        is the recorded one. Or a dictionary with that of each of the run's radars by its name.
    receiver
        Impairments of the receiver, as of :meth:`rfgen_sionna.simulation.Simulator.adc`; None is the recorded one.
    seed
        Seed of all draws of the receiver, from which each radar of several has its own; None is the recorded one.
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
    several = all(each is not run for each in run.radars.values())
    if isinstance(radar, Mapping) and set(radar) - set(run.radars):
        raise ValueError(f"radar names {', '.join(map(repr, radar))}; the run has {', '.join(map(repr, run.radars))}")
    if several and isinstance(radar, Radar):
        raise ValueError(f"radar is one Radar, and the run has {len(run.radars)}: give them by name in a dictionary")
    parts = {}
    seed = None if seed is None else check_whole("seed", seed)
    for index, (name, each) in enumerate(run.radars.items()):
        choice = radar.get(name) if isinstance(radar, Mapping) else radar
        own_seed = None if seed is None else noise_seed(seed, index)
        parts[name if several else ""] = _Part(each, choice, receiver, own_seed, keep)
    infos = {name: part.info(recording) for name, part in parts.items()}
    stored: dict[str, Any] = {"words": words, "compressed": compressed, "dated": dated, "overwrite": overwrite}
    total, count = sum(len(part.made.frames) for part in parts.values()), 0
    stored["keep"] = next(iter(parts.values())).keep
    with RunWriter(output, infos if several else infos[""], **stored) as writer:
        for name, part in parts.items():
            part.copied.constants(writer, name)
            for values in part.frames(device):
                writer.append(**values, radar=name)
                count += 1
                if progress is not None:
                    progress(count, total)
    return open_run(output)


class _Part:
    """The new run of one radar."""

    def __init__(
        self, run: Run, radar: RadarChoice, receiver: ReceiverSource | None, seed: int | None,
        keep: Collection[str] | None,
    ) -> None:  # fmt: skip
        self.made = Resynthesis(run, chosen_radar(run, radar))
        self.receiver = read_receiver((run.receiver or {}) if receiver is None else receiver, self.made.radar)
        self.seed = check_whole("seed", (run.seeds.get("noise") or 0) if seed is None else seed)
        self.keep = _checked_keep(run, keep)
        self.copied = CopiedContents(run, self.keep, self.made.radar)

    def info(self, recording: Mapping[str, Any] | None) -> RunInfo:
        """Properties of the run."""
        return self.copied.info(self.made, receiver_record(self.receiver), self.seed, recording)

    def frames(self, device: str) -> Iterator[dict[str, Any]]:
        """Arguments of :meth:`rfgen_sionna.dataset.RunWriter.append` of each frame."""
        radar = self.made.radar
        for frame, capture in self.made.received(self.receiver, self.seed, device):
            values = self.copied.frame(frame.source)
            values["arrays"] |= representation_values(self.keep, capture.samples, radar)
            values["adc"] = capture.samples if "adc" in self.keep else None
            yield values | {"time": frame.time, "full_scale": capture.full_scale, "clipped": capture.clipped}


def chosen_radar(run: Run, radar: RadarChoice) -> Radar:
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
