"""Training set of the motion model: the motion library and motions by rules, as rows, without the held-out subjects."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.diffusion.motion_noise import MotionNoise, measured_noise
from rfgen_sionna.generative.diffusion.pose_rows import pose_rows
from rfgen_sionna.generative.diffusion.variation_model import Scaling
from rfgen_sionna.generative.diffusion.variation_net import stems
from rfgen_sionna.generative.motion import ACTIONS, KinematicSource
from rfgen_sionna.generative.motion.skeleton import JOINT, JOINT_NAMES, NUM_BODY_JOINTS
from rfgen_sionna.generative.motion_library import MotionLibrary

HELD_OUT = ("ACCAD Male 1", "CMU 01", "CMU 09", "CMU 12", "CMU 16", "HDM05 dg", "ReActIdle 003", "ReActIdle 012")
"""Subjects that the model is not trained on: an eighth of the library, of actions that others perform too."""
SHORTEST = 32
"""Rows of the shortest stretch."""
_STRETCH = 64
"""Rows of the stretches whose spectrum the noise has."""
_RULES = "rules"
_DURATION = 7.0
"""Length of motions by rules [s]."""
_REFLECT = np.array([1.0, -1.0, 1.0, -1.0, 1.0, -1.0])
"""Signs of the first two columns of M R M, M the reflection left for right."""
_OTHER = {"left": "right", "right": "left"}


@dataclass(frozen=True)
class Entry:
    """One motion of the training set."""

    rows: NDArray[np.float32]
    """(frame, NUM_COLUMNS)."""
    context: NDArray[np.float32]
    """(frame, NUM_CONTEXT)."""
    action: str
    captions: tuple[str, ...]
    subject: str

    @property
    def by_rules(self) -> bool:
        return self.subject == _RULES


@dataclass(frozen=True)
class RowCorpus:
    """Motions that the model is trained on, and what was measured on them."""

    entries: tuple[Entry, ...]
    scaling: Scaling
    noise: MotionNoise
    vocabulary: tuple[str, ...]


def build(
    library: MotionLibrary, *, rules: int = 4, seed: int = 0, progress: Callable[[int, int], None] | None = None
) -> RowCorpus:
    """The training set.

    Args:
        library: its clips count with their mirror images, but those of `HELD_OUT`.
        rules: motions of each action of the rules of movement.
        seed: of these.
        progress: called with (motions done, motions).
    """
    entries = []
    kept = [clip for clip in library if clip.subject not in HELD_OUT and clip.frames >= SHORTEST]
    total = len(kept) + rules * len(ACTIONS)
    for done, clip in enumerate(kept):
        entries.append(_entry(*pose_rows(library.motion(clip.name)), clip.action, clip.captions, clip.subject))
        entries.append(mirrored(entries[-1]))
        if progress is not None:
            progress(done + 1, total)
    source = KinematicSource(20.0)
    rng = np.random.default_rng([seed, 11])
    for k, (name, action) in enumerate(ACTIONS.items()):
        for each in range(rules):
            speed = float(np.exp(rng.uniform(np.log(0.7), np.log(1.4))))
            motion = source(name, _DURATION, seed + each, speed=speed)
            entries.append(_entry(*pose_rows(motion), name, (f"a person {action.description}",), _RULES))
        if progress is not None:
            progress(len(kept) + rules * (k + 1), total)
    scaling = Scaling(_statistics([e.rows for e in entries], 0.35), _statistics([e.context for e in entries], 0.0))
    noise = measured_noise(_differences(entries, scaling))
    vocabulary = sorted({stem for entry in entries for caption in entry.captions for stem in stems(caption)})
    return RowCorpus(tuple(entries), scaling, noise, tuple(vocabulary))


def mirrored(entry: Entry) -> Entry:
    """The mirror image of a motion, left for right."""
    n = len(entry.rows)
    rows = (entry.rows.reshape(n, NUM_BODY_JOINTS, 6)[:, _SWAPPED] * _REFLECT).reshape(n, -1)
    context = entry.context[:, [0, 1, 2, 3, 5, 4]] * [1.0, -1.0, -1.0, 1.0, 1.0, 1.0]
    words = tuple(_flip_words(caption) for caption in entry.captions)
    return _entry(rows, context, _flip_words(entry.action), words, entry.subject)


def _entry(rows: FloatArray, context: FloatArray, action: str, captions: tuple[str, ...], subject: str) -> Entry:
    return Entry(rows.astype(np.float32), context.astype(np.float32), action, captions, subject)


def _flip_words(text: str) -> str:
    return text.replace("left", "\0").replace("right", "left").replace("\0", "right")


def _swapped() -> list[int]:
    def other(name: str) -> str:
        side, _, rest = name.partition("_")
        return f"{_OTHER[side]}_{rest}" if side in _OTHER else name

    return [JOINT[other(name)] for name in JOINT_NAMES[:NUM_BODY_JOINTS]]


_SWAPPED = _swapped()


def _statistics(parts: Sequence[NDArray[np.float32]], least: float) -> tuple[FloatArray, FloatArray]:
    """Mean and scale of each column; none is under `least` of the common scale."""
    rows = np.concatenate(parts).astype(np.float64)
    scale = rows.std(axis=0)
    return rows.mean(axis=0), np.maximum(scale, max(least * float(np.sqrt(np.mean(scale**2))), 1e-3))


def _differences(entries: Sequence[Entry], scaling: Scaling) -> FloatArray:
    """(stretch, _STRETCH, NUM_COLUMNS) normalised differences of captured motions from the mean of their action, a few
    of each so that no action outweighs the others."""
    groups: dict[str, list[NDArray[np.float32]]] = {}
    for entry in entries:
        if not entry.by_rules and len(entry.rows) >= _STRETCH:
            groups.setdefault(entry.action, []).append(entry.rows)
    scale = scaling.rows[1]
    out = []
    for group in groups.values():
        middle = np.concatenate(group).mean(axis=0)
        stretches = [rows[k : k + _STRETCH] for rows in group for k in range(0, len(rows) - _STRETCH + 1, _STRETCH)]
        for k in np.linspace(0, len(stretches) - 1, min(len(stretches), 24)).astype(int):
            out.append((stretches[k] - middle) / scale)
    return np.array(out, np.float64)


def stretch(entry: Entry, frames: int, rng: np.random.Generator) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """`frames` rows and their context, from anywhere in a motion."""
    start = int(rng.integers(len(entry.rows) - frames + 1))
    return entry.rows[start : start + frames], entry.context[start : start + frames]
