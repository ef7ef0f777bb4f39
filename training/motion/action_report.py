"""Measure what `perform` makes of every action beside the library's clips of it:
`python -m training.motion.action_report [--actions A --actions B] [--seeds 100]`.

It writes a JSON file, from which `python -m training.motion.definitions` puts a table on the page of actions.
"""

from __future__ import annotations

import json
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import cached_property
from itertools import combinations
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich.console import Console

from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.action_definitions import MotionSignals, check
from rfgen_sionna.generative.action_definitions.sampled_series import RATE, rate_of
from rfgen_sionna.generative.manner import Manner
from rfgen_sionna.generative.motion import MEAN_ADULT
from rfgen_sionna.generative.motion.skeleton import NUM_BODY_JOINTS
from rfgen_sionna.generative.motion_library import LibraryClip, MotionLibrary
from rfgen_sionna.generative.performing import performable, trials
from rfgen_sionna.generative.prompts.prompt_error import PromptError
from rfgen_sionna.records import Motion
from training.commands import plainly, progress_bar
from training.motion.action_recogniser import ActionRecogniser, learnable
from training.motion.action_table import METRICS, table
from training.motion.alignment import POSE_RATE, aligned_distance, mirrored_poses, poses
from training.motion.definitions import half_of_subjects, read_clips

_PAIRS = 60
"""Pairs of motions that are compared at most."""
_PART = 2.0
"""Longest part of a motion that is compared [s]."""
_SUBJECTS = 5
"""Subjects from which a variety of real clips can be stated."""
_FALLS = ("fall", "fall_forward", "fall_backward", "fall_sideways", "fall_from_chair", "faint", "slip", "lie_down")


@dataclass(frozen=True)
class ActionFigures:
    """What was measured on the motions of one action; None for what cannot be."""

    sources: tuple[str, ...]
    seeds: int
    first: float
    """Share of seeds whose first motion the definition holds for."""
    true: float
    """Share of seeds with a motion that the definition holds for; the others are refused."""
    reasons: tuple[tuple[str, int], ...]
    """What most often is against first motions, and how often."""
    seconds: float
    """Processor time of a motion, median [s]."""
    clips: int
    """Clips of the library that show it."""
    subjects: int
    speed: float | None
    """95th percentile of the speed of wrists and ankles in the liveliest stretch, median over motions [m/s]."""
    speed_ratio: float | None
    """That of a motion over its own clips', or, of one by rules, over people's; median."""
    slide: float | None
    """Mean speed over the floor of feet that stand [m/s]."""
    slide_clips: float | None
    """The same of the clips."""
    below: float
    """Depth of the deepest joint, or sole, under the floor [m]."""
    end_height: float | None
    """Of falls: the higher of pelvis and head at the end, the highest of all motions [m]."""
    variety: float | None
    """Distance of two seeds, as they are aligned in time: rms over joints, median [m]."""
    variety_ratio: float | None
    """That over the distance of clips of different subjects, where five or more show it."""
    nearest: float | None
    """Distance to the nearest clip or its mirror image, median [m]."""
    takes: float | None
    """Distance of a clip to the nearest other one of the same person, median [m]."""
    recognised: float | None
    """Share that a recogniser names rightly which has seen other people."""
    recognised_clips: float | None
    """The same of real clips."""
    taken_for: tuple[tuple[str, int], ...]
    """What it names else."""


class ClipReference:
    """Clips of the library with their signals, and recognisers of both halves of the subjects.

    Args:
        names: clips to take; None takes all.
    """

    def __init__(self, names: Sequence[str] | None = None) -> None:
        library = MotionLibrary()
        self._clips = [clip for clip in library if names is None or clip.name in names]
        self.signals = {clip.name: MotionSignals(library.motion(clip.name)) for clip in self._clips}
        self._shown = read_clips()
        self._half = half_of_subjects(library)
        self._subjects = {clip.name: clip.subject for clip in library}

    def clips(self, action: str) -> list[LibraryClip]:
        """Clips that show an action, by caption and definition."""
        if action not in self._shown:
            return []
        roles = self._shown[action]
        return [c for c in self._clips if roles.role(c) == "shown" and check(self.signals[c.name], action).true]

    @cached_property
    def recognisers(self) -> dict[bool, ActionRecogniser]:
        """By whether the half of subjects that they have *not* seen is the first one."""
        unseen = {half: [c for c in self._clips if (c.subject in self._half) != half] for half in (True, False)}
        return {half: ActionRecogniser(own, self.signals) for half, own in unseen.items() if learnable(own)}

    def names(
        self, motions: Sequence[MotionSignals], made_of: Sequence[Sequence[str]], accepted: frozenset[str]
    ) -> list[str]:
        """What recognisers call motions that have seen none of the people of their clips; left out are motions of whose
        people both have seen some, or where what is `accepted` was not learned."""
        found = []
        for signals, clips in zip(motions, made_of, strict=True):
            halves = {self._subjects[name] in self._half for name in clips} or {True, False}
            able = [
                h for h in self.recognisers if accepted & self.recognisers[h].actions and (halves == {h} or not clips)
            ]
            if able:
                found.append(self.recognisers[able[0]].name(signals))
        return found


def extremity_speed(signals: MotionSignals, seconds: float) -> float:
    """95th percentile of the speeds of wrists and ankles in the world, of the liveliest stretch of a length [m/s]."""
    places = np.concatenate([signals.pair("wrist"), signals.pair("ankle")], axis=1)
    speeds = np.linalg.norm(rate_of(places), axis=-1)
    total = np.concatenate([[0.0], np.cumsum(speeds.sum(axis=1))])
    size = min(max(round(seconds * RATE), 5), len(speeds))
    start = int(np.argmax(total[size:] - total[:-size]))
    return float(np.percentile(speeds[start : start + size], 95))


def standing_slide(signals: MotionSignals) -> float | None:
    """Mean speed over the floor of feet within 3 cm of it that go slower than 0.6 m/s, the stiller of ankle and toes
    [m/s]; None where no foot stands."""
    speeds = signals.foot_speed[(signals.feet < 0.03) & (signals.foot_speed < 0.6)]
    return float(speeds.mean()) if len(speeds) > 0.2 * len(signals.time) else None


def depth(signals: MotionSignals) -> float:
    """Depth of the deepest joint, or sole, under the floor [m]; 0 for none."""
    return float(max(-signals.joints[:, :NUM_BODY_JOINTS, 2].min(), -signals.feet.min(), 0.0))


def _part(rows: FloatArray, seconds: float) -> FloatArray:
    """The liveliest stretch of poses."""
    size = min(len(rows), max(round(seconds * POSE_RATE), 3))
    moved = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(rows, axis=0), axis=1))])
    start = int(np.argmax(moved[size - 1 :] - moved[: len(rows) - size + 1]))
    return rows[start : start + size]


def _spread(rows: Sequence[FloatArray], pairs: Sequence[tuple[int, int]], seconds: float) -> float | None:
    """Median distance of pairs of motions as they are aligned [m]."""
    if not pairs:
        return None
    return float(np.median([aligned_distance(_part(rows[a], seconds), rows[b]) for a, b in pairs]))


def _some(pairs: list[tuple[int, int]]) -> list[tuple[int, int]]:
    order = np.random.default_rng(0).permutation(len(pairs))[:_PAIRS]
    return [pairs[k] for k in order]


def _same_person(clips: Sequence[LibraryClip]) -> list[list[int]]:
    """Other clips of the same subject, for each of the first clips."""
    subjects = [clip.subject for clip in clips]
    return [[b for b, one in enumerate(subjects) if b != a and one == own] for a, own in enumerate(subjects[:20])]


def _median(values: Sequence[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return float(np.median(known)) if known else None


def _by_person(clips: Sequence[LibraryClip], values: Sequence[float]) -> list[float]:
    """Median of the values of each person's clips."""
    subjects = np.array([clip.subject for clip in clips])
    return [float(np.median(np.asarray(values)[subjects == each])) for each in sorted(set(subjects))]


def _over(value: float | None, reference: float | None) -> float | None:
    return value / reference if value is not None and reference else None


def measure_action(action: str, seeds: int, duration: float, reference: ClipReference) -> ActionFigures:
    """Figures of the motions of `seeds` seeds of an action, of `duration` [s]."""
    motions: list[Motion] = []
    first, seconds, reasons = 0, [], Counter[str]()
    for seed in range(seeds):
        start = time.process_time()
        try:
            for attempt, (motion, verdict) in enumerate(trials(action, duration, seed, MEAN_ADULT, Manner(), 1.0)):
                first += attempt == 0 and verdict.true
                if attempt == 0:
                    reasons.update(reason.rsplit(":", 1)[0] for reason in verdict.reasons)
                if verdict.true:
                    motions.append(motion)
                    break
        except PromptError as error:
            reasons.update([str(error)])
        seconds.append(time.process_time() - start)
    signals = [MotionSignals(motion) for motion in motions]
    clips = reference.clips(action)
    real = [reference.signals[clip.name] for clip in clips]
    rows, real_rows = [poses(s) for s in signals], [poses(s) for s in real]
    subjects = len({clip.subject for clip in clips})
    part = min(_PART, float(np.median([s.duration for s in real])) if real else _PART)
    variety = _spread(rows, _some(list(combinations(range(len(rows)), 2))), part)
    others = [(a, b) for a, b in combinations(range(len(clips)), 2) if clips[a].subject != clips[b].subject]
    among_clips = _spread(real_rows, _some(others), part) if subjects >= _SUBJECTS else None
    near = [
        min(aligned_distance(_part(row, part), each) for clip in real_rows for each in (clip, mirrored_poses(clip)))
        for row in (rows[:20] if real_rows else [])
    ]
    takes = [
        min((aligned_distance(_part(real_rows[a], part), real_rows[b]) for b in same), default=None)
        for a, same in enumerate(_same_person(clips))
    ]
    accepted = frozenset(clip.action for clip in clips)
    names = reference.names(signals, [motion.clips for motion in motions], accepted)
    real_names = reference.names(real[:40], [(clip.name,) for clip in clips[:40]], accepted)
    speed, slide = _median([extremity_speed(s, part) for s in signals]), _median([standing_slide(s) for s in signals])
    usual = _median(_by_person(clips, [extremity_speed(s, part) for s in real]))
    made_of = [[reference.signals[name] for name in m.clips if name in reference.signals] for m in motions]
    own_speeds = [_median([extremity_speed(s, part) for s in each]) or usual for each in made_of]
    last = slice(-round(0.3 * RATE), None)
    ends = [max(s.pelvis_height[last].mean(), s.head_height[last].mean()) for s in signals]
    return ActionFigures(
        sources=performable()[action],
        seeds=seeds,
        first=first / seeds,
        true=len(motions) / seeds,
        reasons=tuple(reasons.most_common(3)),
        seconds=float(np.median(seconds)),
        clips=len(clips),
        subjects=subjects,
        speed=speed,
        speed_ratio=_median([_over(extremity_speed(s, part), own) for s, own in zip(signals, own_speeds, strict=True)]),
        slide=slide,
        slide_clips=_median([standing_slide(s) for s in real]),
        below=max((depth(s) for s in signals), default=0.0),
        end_height=max(ends) if action in _FALLS and ends else None,
        variety=variety,
        variety_ratio=_over(variety, among_clips),
        nearest=_median(near),
        takes=_median(takes),
        recognised=float(np.mean([name in accepted for name in names])) if names else None,
        recognised_clips=float(np.mean([name in accepted for name in real_names])) if real_names else None,
        taken_for=tuple(Counter(name for name in names if name not in accepted).most_common(3)),
    )


@plainly
def main(
    actions: Annotated[list[str] | None, typer.Option(help="Actions; all that can be performed by default.")] = None,
    seeds: Annotated[int, typer.Option(min=2, help="Motions of each action.")] = 100,
    duration: Annotated[float, typer.Option(min=1.0, help="Of a motion [s].")] = 6.0,
    out: Annotated[Path, typer.Option(help="JSON file; figures of other actions in it are kept.")] = METRICS,
) -> None:
    """Measure what `perform` makes of actions, beside the library's clips."""
    unknown = [action for action in actions or () if action not in performable()]
    if unknown:
        raise ValueError(f"actions: {unknown[0]!r} cannot be performed; allowed are {', '.join(performable())}")
    results = json.loads(out.read_text(encoding="utf-8"))["actions"] if out.exists() else {}
    reference = ClipReference()
    with progress_bar() as bar:
        task = bar.add_task("actions", total=len(actions or performable()), note="")
        for action in actions or performable():
            results[action] = asdict(measure_action(action, seeds, duration, reference))
            stored = {"duration": duration, "actions": dict(sorted(results.items()))}
            out.write_text(json.dumps(stored, indent=1) + "\n", encoding="utf-8")
            bar.update(task, advance=1, note=action)
    Console(width=240).print("\n".join(table({action: results[action] for action in actions or performable()})))


if __name__ == "__main__":
    typer.run(main)
