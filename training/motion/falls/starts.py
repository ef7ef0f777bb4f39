"""First poses of simulated falls: moments of real clips, with the motion before them."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation, Slerp

from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.action_definitions.changes_of_level import seated
from rfgen_sionna.generative.action_definitions.motion_signals import MotionSignals
from rfgen_sionna.generative.motion_library import LibraryClip, MotionLibrary
from rfgen_sionna.records import Motion
from training.motion.definitions import read_wrong

WALKS = ("walk", "slow_walk", "fast_walk", "stride_walk")
STANDS = ("idle", "wait", "look_around", "talk", "gesture", "laugh", "drink", "photo")
SITS = ("sit", "sit_stand", "sit_down")
_SHORTEST = 0.6
"""Shortest lead-in before a fall [s]."""


@dataclass(frozen=True)
class Start:
    """A moment of a clip."""

    clip: LibraryClip
    motion: Motion
    frame: int
    swing: str = ""
    """Side of the foot in the air, or empty."""
    lead: int = 24
    """Most frames of the motion before the moment that are kept."""

    @property
    def time(self) -> float:
        """Of the moment, from the clip's start [s]."""
        return self.frame / self.motion.frame_rate

    def pose(self, time: float) -> tuple[FloatArray, FloatArray]:
        """(joint, 4) rotations relative to the parent and (3,) place of the pelvis [m] at a time [s]."""
        t = np.arange(len(self.motion.translation)) / self.motion.frame_rate
        low = max(self.frame - 6, 0)
        near = slice(low, self.frame + 7)
        place = CubicSpline(t[near], self.motion.translation[near])(time)
        turns = [
            Slerp(t[near], Rotation.from_quat(each))(time) for each in np.swapaxes(self.motion.rotations[near], 0, 1)
        ]
        return np.array([turn.as_quat() for turn in turns]), place


def clips_of(library: MotionLibrary, actions: Iterable[str]) -> list[tuple[LibraryClip, Motion, MotionSignals]]:
    """Captured clips of actions with their signals, without those under share-alike terms and wrong ones."""
    found = []
    for action in actions:
        for clip in library.actions.get(action, ()):
            if clip.kind in ("mocap", "keyframed") and "SA" not in clip.licence and clip.name not in read_wrong():
                motion = library.motion(clip.name)
                found.append((clip, motion, MotionSignals(motion)))
    return found


def _moments(frames: np.ndarray, signals: MotionSignals) -> list[int]:
    """Those with a lead-in and a following frame."""
    return [int(f) for f in frames if f >= _SHORTEST * 20 and f < len(signals.time) - 2]


def _floats(signals: MotionSignals, frame: int) -> bool:
    """Whether the lower foot is more than 3 cm over or under the floor."""
    return bool(abs(signals.feet[frame].min()) > 0.03)


def mid_swings(library: MotionLibrary) -> list[Start]:
    """Walking: the moments when a foot swings past the other one."""
    out = []
    for clip, motion, s in clips_of(library, WALKS):
        apart = s.ahead(s.joint("left_ankle") - s.joint("right_ankle"))[:, 0]
        for f in _moments(np.flatnonzero(np.sign(apart[1:]) != np.sign(apart[:-1])) + 1, s):
            if s.velocity[f, 0] > 0.6 and s.inclination[f] < 25 and not _floats(s, f):
                out.append(Start(clip, motion, f, "left" if apart[f + 1] > apart[f - 1] else "right"))
    return out


def heel_strikes(library: MotionLibrary) -> list[Start]:
    """Walking: the moments when the weight is on a foot that came down ahead 0.15 s ago; `swing` is its side."""
    out = []
    for clip, motion, s in clips_of(library, WALKS):
        apart = s.ahead(s.joint("left_ankle") - s.joint("right_ankle"))[:, 0]
        far = np.abs(apart)
        peaks = np.flatnonzero((far[1:-1] >= far[:-2]) & (far[1:-1] > far[2:]) & (far[1:-1] > 0.3)) + 1
        for f in _moments(peaks + 3, s):
            if s.velocity[f, 0] > 0.6 and s.inclination[f] < 25 and not _floats(s, f):
                out.append(Start(clip, motion, f, "left" if apart[f] > 0 else "right"))
    return out


def stands(library: MotionLibrary, every: int = 20) -> list[Start]:
    """Standing on both feet, a moment a second."""
    out = []
    for clip, motion, s in clips_of(library, STANDS):
        good = (s.speed < 0.15) & (s.inclination < 15) & (s.feet < 0.03).all(axis=1) & (s.legs > 0.93)
        for f in _moments(np.arange(14, len(s.time), every), s):
            if good[f] and not _floats(s, f):
                out.append(Start(clip, motion, f))
    return out


def sits(library: MotionLibrary, every: int = 12) -> list[Start]:
    """Sitting on a chair, still."""
    out = []
    for clip, motion, s in clips_of(library, SITS):
        good = seated(s) & (s.speed < 0.15) & (s.pelvis_height > 0.42) & (s.pelvis_height < 0.68)
        for f in _moments(np.arange(12, len(s.time), every), s):
            if good[f - 12 : f + 1].all():
                lead = int(np.argmin(good[max(f - 24, 0) : f + 1][::-1])) - 1
                out.append(Start(clip, motion, f, lead=lead if lead > 0 else min(f, 24)))
    return out


def all_starts(library: MotionLibrary) -> dict[str, list[Start]]:
    """Moments of the library's clips to begin from, by what happens there."""
    return {
        "swing": mid_swings(library),
        "strike": heel_strikes(library),
        "stand": stands(library),
        "sit": sits(library),
    }
