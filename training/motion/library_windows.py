"""Index of the motion library: which part of which clip shows which action.
`python -m training.motion.library_windows` writes it beside the clips.

Candidates of an action are the clips that `definition_clips.toml` names for it, clips of the library whose action has
its name, and those of `_BORROWED`. A window is the shortest part of a clip for which the definition holds, as it is or
mirrored.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from types import MappingProxyType
from typing import Annotated

import numpy as np
import typer
from rich.console import Console

from rfgen_sionna.generative.action_definitions import DEFINED_ACTIONS, MotionSignals, check
from rfgen_sionna.generative.motion.clip_editing import cut, joint_places, mirrored
from rfgen_sionna.generative.motion.rotations import to_matrices
from rfgen_sionna.generative.motion.skeleton import JOINT, SIDES
from rfgen_sionna.generative.motion_library import FOLDER, LibraryClip, MotionLibrary
from rfgen_sionna.generative.repertoire import WINDOWS, Window
from rfgen_sionna.records import Motion
from training.commands import plainly
from training.motion.definitions import read_clips, read_wrong

_BORROWED = MappingProxyType(
    {
        "walk_straight": ("walk", "fast_walk", "slow_walk", "stride_walk"),
        "left_kick": ("kick",),
        "right_kick": ("kick",),
        "sit_down": ("sit_stand", "sit_floor"),
        "stand_up": ("sit_stand",),
        "sit": ("sit_stand",),
        "get_up": ("getup",),
        "jump": ("jump_forward",),
        "lie": ("lie_down",),
        "fall": ("fall_forward", "fall_backward", "fall_sideways"),
        "slip": ("fall_backward", "fall_sideways"),
    }
)
"""Action -> actions of clips that hold it, too."""
_NOT_PRONE = frozenset({"slip"})
"""Actions whose clips end on the back or a side: the foot that slides away leaves the trunk behind."""
_PRONE = -0.5
"""Vertical part of the direction to which the pelvis faces, under which a body that lies is face down."""
_LEFT_OUT = MappingProxyType({"carry": ("carry_run",)})
"""Action -> actions of clips that show it in another way than is meant."""
_STOOLS = ("cmu_13_01", "cmu_14_27", "cmu_14_28", "cmu_14_29", *(f"cmu_86_09_s{k}" for k in range(2, 6)))
"""Clips of people who sit on high stools, the pelvis at nine tenths of standing."""
_FROM_A_CROUCH = ("accad_f1_A08_CrouchToLie", "accad_m1_A8_CrouchToLie", "accad_m2_A8_CrouchToLie")
"""Clips of people who lie down from a crouch; one props itself up at the end."""
_OTHERWISE = MappingProxyType(
    {
        "fall": ("cmu_90_16_dm",),  # flies 0.6 m up into it, as acrobats do
        "crawl": ("accad_f1_A12_CrawlBackwards", "accad_m1_A12_CrawlBackward", "accad_m2_A12_CrawlBackwards"),
        "get_up": ("kaykit_Lie_StandUp",),  # its pelvis is over the floor
        "lie": _FROM_A_CROUCH,
        "lie_down": _FROM_A_CROUCH,
        "sit": (*_STOOLS, "m2m_addon_Meditate"),
        "sit_down": (*_STOOLS, "kaykit_Sit_Floor_Down", "sl_sit_ground"),
        "stand_up": _STOOLS,
        "sit_and_stand": _STOOLS,
    }
)
"""Action -> clips that show it in another way than its name alone means: with a leap, backwards, from a
crouch, on a stool or the floor. The reader refuses most of these kinds."""
_MADE = ("simulated", "edited")
"""Kinds of clips that were made to show one action once."""
_MANY = 3
"""Most windows of a clip."""
_LENGTHS = (0.8, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0, 12.0)
"""Lengths of windows that are tried [s]."""
_FASTEST = 320.0
"""Largest acceleration of a joint at the rate of the clips [m/s^2]; hands and feet of fast strikes reach 250."""
_STEP = 0.2
"""Distance of the starts that are tried [s]."""


def candidates(library: MotionLibrary) -> dict[str, list[LibraryClip]]:
    """Clips that may show an action, by its name."""
    clips = read_clips()
    found = {}
    for action in DEFINED_ACTIONS:
        borrowed = _BORROWED.get(action, ())
        found[action] = [
            clip
            for clip in library
            if clip.name not in read_wrong()
            and clip.action not in _LEFT_OUT.get(action, ())
            and clip.name not in _OTHERWISE.get(action, ())
            and (
                clip.action in (action, *borrowed)
                if action not in clips
                else clips[action].role(clip) == "shown" or clip.action in borrowed
            )
        ]
    return {action: each for action, each in found.items() if each}


def windows_of(clip: LibraryClip, motion: Motion, action: str, whole: dict[bool, MotionSignals]) -> list[Window]:
    """Shortest parts of a clip that show an action, and do not overlap."""
    shows = {side: check(signals, action).true for side, signals in whole.items()}
    rate, frames = motion.frame_rate, len(motion.translation)
    versions = {False: motion, True: mirrored(motion)}
    found: list[tuple[int, int]] = []
    plain = next((side for side, true in shows.items() if true), None)
    search = [side for side in (False, True) if shows[side]] or [False, True]
    if clip.kind in _MADE and plain is not None:
        found = [_narrowed(versions[plain], action)]
    for length in () if found else _LENGTHS:
        size = round(length * rate) + 1
        if size > frames:
            break
        for start in range(0, frames - size + 1, max(1, round(_STEP * rate))):
            if any(start < b and a < start + size for a, b in found):
                continue
            part = cut(versions[search[0]], start, start + size)
            if check(part, action).true:
                found.append((start, start + size))
        if found:
            break
    if not found and plain is not None:
        found = [(0, frames)]
    if not found or (action in _NOT_PRONE and to_matrices(motion.rotations[-1, 0])[2, 0] < _PRONE):
        return []
    evenly = np.unique(np.linspace(0, len(found) - 1, _MANY).round().astype(int))
    out = []
    for start, stop in [found[k] for k in evenly]:
        sides = [side for side in (False, True) if check(cut(versions[side], start, stop), action).true]
        if not sides:
            continue
        first, last = (0, frames) if shows[sides[0]] else _widened(versions[sides[0]], action, start, stop)
        part = cut(motion, first, last)
        if not _jumps(part):
            mirror = None if len(sides) == 2 else sides[0]
            side, speed = _working_side(cut(motion, start, stop)), round(_mean_speed(part), 3)
            out.append(Window(clip.name, start, stop, mirror, first, last, side, speed))
    return out


def _narrowed(motion: Motion, action: str) -> tuple[int, int]:
    """Part of a motion that still shows the action, cut step by step at its end and then at its beginning."""
    step, start, stop = round(_STEP * motion.frame_rate), 0, len(motion.translation)
    while stop > 2 * step and check(cut(motion, 0, stop - step), action).true:
        stop -= step
    while stop - start > 2 * step and check(cut(motion, start + step, stop), action).true:
        start += step
    return start, stop


def _widened(motion: Motion, action: str, start: int, stop: int) -> tuple[int, int]:
    """Longest part of a motion about that from `start` to `stop` that shows the action, step by step at either end."""
    step = round(2.0 * _STEP * motion.frame_rate)
    while start > 0 and check(cut(motion, max(start - step, 0), stop), action).true:
        start = max(start - step, 0)
    while stop < len(motion.translation) and check(cut(motion, start, stop + step), action).true:
        stop = min(stop + step, len(motion.translation))
    return start, stop


def _jumps(motion: Motion) -> bool:
    """Whether a joint of a clip jumps from one place to another, which no muscle does."""
    second = np.linalg.norm(np.diff(joint_places(motion), 2, axis=0), axis=-1) * motion.frame_rate**2
    return bool(second.max(initial=0.0) > _FASTEST)


def _working_side(motion: Motion) -> str:
    """Side whose hand or foot moves more."""
    places = joint_places(motion)
    ways = {}
    for end, root in (("wrist", "spine3"), ("ankle", "pelvis")):
        ways[end] = [
            np.linalg.norm(np.diff(places[:, JOINT[f"{side}_{end}"]] - places[:, JOINT[root]], axis=0), axis=1).sum()
            for side in SIDES
        ]
    left, right = max(ways.values(), key=lambda each: abs(each[0] - each[1]))
    return "both" if max(left, right) < 1.3 * min(left, right) else SIDES[int(right > left)]


def _mean_speed(motion: Motion) -> float:
    """Way of the pelvis over the time [m/s]; sway left out by 0.5 s steps."""
    step = max(1, round(0.5 * motion.frame_rate))
    way = motion.translation[::step, :2]
    if len(way) < 2:
        return float(np.linalg.norm(motion.translation[-1, :2] - motion.translation[0, :2]) / max(motion.duration, 0.1))
    return float(np.linalg.norm(np.diff(way, axis=0), axis=1).sum() / (step * (len(way) - 1)) * motion.frame_rate)


def index(library: MotionLibrary, actions: Sequence[str] | None = None) -> dict[str, list[Window]]:
    """Windows of every action that has any, or of some `actions`."""
    signals: dict[str, dict[bool, MotionSignals]] = {}
    found: dict[str, list[Window]] = {}
    for action, clips in sorted(candidates(library).items()):
        if actions is not None and action not in actions:
            continue
        for clip in clips:
            motion = library.motion(clip.name)
            if clip.name not in signals:
                signals[clip.name] = {False: MotionSignals(motion), True: MotionSignals(mirrored(motion))}
            found.setdefault(action, []).extend(windows_of(clip, motion, action, signals[clip.name]))
    return {action: each for action, each in found.items() if each}


def write_index(folder: Path, actions: Sequence[str] | None = None) -> dict[str, list[Window]]:
    """Write the index of the library of a folder; that of other actions than `actions` stays."""
    path = folder / WINDOWS
    found = index(MotionLibrary(folder), actions)
    kept = json.loads(path.read_text(encoding="utf-8")) if actions is not None and path.exists() else {}
    rows = {action: each for action, each in kept.items() if action not in (actions or ())}
    rows |= {action: [list(asdict(window).values()) for window in each] for action, each in found.items()}
    lines = [f'"{action}": {json.dumps(each, separators=(",", ":"))}' for action, each in sorted(rows.items())]
    path.write_text("{\n" + ",\n".join(lines) + "\n}\n", encoding="utf-8")
    return found


@plainly
def main(
    folder: Annotated[Path, typer.Option(help="Folder of the library.")] = FOLDER,
    actions: Annotated[list[str] | None, typer.Option(help="Actions; all by default, the others stay.")] = None,
) -> None:
    """Write which part of which clip of the motion library shows which action."""
    found = write_index(folder, actions)
    subjects = {clip.name: clip.subject for clip in MotionLibrary(folder)}
    for action, each in found.items():
        people = Counter(subjects[window.clip] for window in each)
        Console().print(f"{action}: {len(each)} windows of {len(people)} people")


if __name__ == "__main__":
    typer.run(main)
