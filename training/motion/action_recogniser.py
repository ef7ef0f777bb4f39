"""A recogniser of actions that no definition and no choice of a motion uses: decision trees over statistics of poses,
trained on library clips of one half of the subjects."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence

import numpy as np
from sklearn.ensemble import ExtraTreesClassifier

from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.action_definitions import MotionSignals
from rfgen_sionna.generative.motion_library import LibraryClip
from training.motion.alignment import POSE_RATE, mirrored_poses, poses

WINDOW = 2.0
"""Length of what is looked at at once [s]."""
_FEWEST = 3
"""Clips from which an action of the library is learned."""
_MOST = 40
"""Windows of an action that are learned from."""


def statistics(signals: MotionSignals) -> FloatArray:
    """(window, k) statistics of windows of a motion, half of a window apart; of all of a shorter motion."""
    rows = poses(signals)
    step = round(len(signals.time) / len(rows))
    way = np.column_stack([signals.velocity, np.gradient(signals.heading)])[::step][: len(rows)]
    size = round(WINDOW * POSE_RATE)
    starts = range(0, max(len(rows) - size, 0) + 1, size // 2)
    return np.stack([_of_window(rows[k : k + size], way[k : k + size]) for k in starts])


def _of_window(rows: FloatArray, way: FloatArray) -> FloatArray:
    both = []
    for each, aside in ((rows, 1.0), (mirrored_poses(rows), -1.0)):
        path = way * [1.0, aside, 1.0, aside]
        rate = np.diff(each, axis=0, append=each[-1:]) * POSE_RATE
        parts = [
            each.mean(0),
            each.std(0),
            each.min(0),
            each.max(0),
            each[-1] - each[0],
            rate.std(0),
            np.abs(rate).max(0),
        ]
        both.append(np.concatenate([*parts, path.mean(0), path.std(0), path.min(0), path.max(0)]))
    return np.stack(both)


def learnable(clips: Sequence[LibraryClip]) -> frozenset[str]:
    """Actions of the library of which there are clips enough to learn them."""
    return frozenset(action for action, count in Counter(clip.action for clip in clips).items() if count >= _FEWEST)


class ActionRecogniser:
    """Names the action of the library that a motion looks like.

    Parameters
    ----------
    clips
        Clips to learn from.
    signals
        Signals of each, by name.

    Raises
    ------
    ValueError
        No action has three clips.
    """

    def __init__(self, clips: Sequence[LibraryClip], signals: Mapping[str, MotionSignals], seed: int = 0) -> None:
        learned = learnable(clips)
        if not learned:
            raise ValueError(f"clips: {len(clips)}, of no action {_FEWEST} or more; there is nothing to learn")
        windows: dict[str, list[FloatArray]] = {}
        for clip in clips:
            if clip.action in learned:
                windows.setdefault(clip.action, []).extend(statistics(signals[clip.name]))
        rng = np.random.default_rng(seed)
        rows, labels = [], []
        for action, own in windows.items():
            chosen = rng.permutation(len(own))[:_MOST]
            rows += [own[k] for k in chosen]
            labels += [action] * 2 * len(chosen)
        self._trees = ExtraTreesClassifier(
            100, min_samples_leaf=2, max_features=0.1, class_weight="balanced", random_state=seed
        )
        self._trees.fit(np.concatenate(rows), labels)

    @property
    def actions(self) -> frozenset[str]:
        """Actions of the library that it has learned."""
        return frozenset(self._trees.classes_)

    def name(self, signals: MotionSignals) -> str:
        """The likeliest action of the library."""
        windows = statistics(signals)
        return str(self._trees.classes_[self._trees.predict_proba(windows[:, 0]).mean(axis=0).argmax()])
