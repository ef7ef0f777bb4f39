"""Whether motions are copies of training clips: how near they come to them, beside unseen real motion."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from rfgen_sionna._types import FloatArray
from training.motion.motion_corpus import MotionCorpus
from training.motion.motion_metrics import nearest

CLIPS = 150
"""Synthesised training clips of an action that are looked through; captured ones all are."""


def originality(
    made: Mapping[str, Sequence[FloatArray]], unseen: Mapping[str, Sequence[FloatArray]], corpus: MotionCorpus
) -> dict[str, Any]:
    """Distance to the nearest training clip over that of unseen real motion: about 1 or more is new, near 0 is a copy.

    Against synthesised clips of the same action, and against all captured ones. "nearest" is that of the single
    motion, of all of an action, that comes closest; the other is the median.

    Args:
        made: action -> feature rows of made motions.
        unseen: the same of motion that the model was not trained on.
        corpus: the training set; its held-out clips are not looked at.
    """
    own = {}
    for action, rows in made.items():
        bank = _rows(corpus, "kinematic", action, CLIPS)
        if bank and unseen.get(action):
            own[action] = _ratios(rows, unseen[action], bank)
    captured = against_captured(made, unseen, corpus)
    out: dict[str, Any] = {}
    for name, found in (("training", own), ("captured training", captured)):
        if found:
            text = f"distance to the nearest {name} clip over that of unseen real clips"
            out[text] = float(np.mean([median for median, _ in found.values()]))
            out[f"{text}, by action"] = {a: list(pair) for a, pair in found.items()}
    return out


def against_captured(
    made: Mapping[str, Sequence[FloatArray]], unseen: Mapping[str, Sequence[FloatArray]], corpus: MotionCorpus
) -> dict[str, tuple[float, float]]:
    """Action -> (median, least) distance to the nearest captured training clip over the median of unseen motion; empty
    where the training set has none."""
    bank = _rows(corpus, "mocap", None, None)
    actions = [a for a in made if unseen.get(a)]
    if not bank or not actions:
        return {}
    # all at once: the clips are gone through a single time
    groups = [group for a in actions for group in (made[a], unseen[a])]
    far = nearest([rows for group in groups for rows in group], bank)
    parts = np.split(far, np.cumsum([len(group) for group in groups])[:-1])
    return {a: _over(parts[2 * k], parts[2 * k + 1]) for k, a in enumerate(actions)}


def _ratios(
    made: Sequence[FloatArray], unseen: Sequence[FloatArray], bank: Sequence[FloatArray]
) -> tuple[float, float]:
    far = nearest([*made, *unseen], bank)
    return _over(far[: len(made)], far[len(made) :])


def _over(ours: FloatArray, theirs: FloatArray) -> tuple[float, float]:
    usual = float(np.median(theirs))
    return float(np.median(ours)) / usual, float(np.min(ours)) / usual


def _rows(corpus: MotionCorpus, source: str, action: str | None, most: int | None) -> list[FloatArray]:
    """Feature rows of the first clips of a source that the model was trained on, of one action or of all."""
    entries = [e for e in corpus.entries if e.source == source and not e.held_out]
    fitting = [e for e in entries if action is None or e.actions == (action,)]
    return [e.features.astype(np.float64) for e in fitting[:most]]
