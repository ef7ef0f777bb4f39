"""What the model is shown: stretches of clips, with sentences, beats and, now and then, parts that are given."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from rfgen_sionna.generative.diffusion.constraints import SOFT, spread
from rfgen_sionna.generative.diffusion.features import FRAME_RATE, PARTS, recentred
from rfgen_sionna.generative.diffusion.network import SOURCES
from training.motion.motion_captions import caption, negative
from training.motion.motion_corpus import Entry, MotionCorpus
from training.motion.motion_text import reworded

LENGTHS = (32, 48, 64, 80, 96, 120, 120, 120, 120, 160)
"""Frames of a batch, each as likely as it occurs here."""
_PARTS = tuple(PARTS)


@dataclass(frozen=True)
class MotionBatch:
    """One step's worth of training, as arrays."""

    clean: NDArray[np.float32]
    """(item, frame, NUM_FEATURES) normalised."""
    beat: NDArray[np.float32]
    known: NDArray[np.float32]
    given: NDArray[np.float32]
    source: NDArray[np.int64]
    prompts: list[str]
    """Empty where the prompt is left out."""
    unwanted: list[str]


class BatchSampler:
    """Draws batches from a corpus; every one from the seed and its number alone."""

    def __init__(self, corpus: MotionCorpus, *, seed: int, items: int) -> None:
        self.corpus, self.seed, self.items = corpus, seed, items
        self._kinematic: dict[str, list[Entry]] = {}
        self._composed: list[Entry] = []
        self._captured: dict[str, list[Entry]] = {}
        for entry in corpus.entries:
            if entry.held_out:
                continue
            if entry.source == "mocap":
                self._captured.setdefault(entry.actions[0], []).append(entry)
            elif len(entry.actions) > 1:
                self._composed.append(entry)
            else:
                self._kinematic.setdefault(entry.actions[0], []).append(entry)

    def batch(self, number: int) -> MotionBatch:
        """Batch `number`."""
        rng = np.random.default_rng([self.seed, 101, number])
        frames = LENGTHS[int(rng.integers(len(LENGTHS)))]
        rows = [self._item(rng, frames) for _ in range(self.items)]
        clean, beat, known, given = (np.stack([row[k] for row in rows]).astype(np.float32) for k in range(4))
        source, prompts, unwanted = (list(column) for column in list(zip(*rows, strict=True))[4:])
        return MotionBatch(clean, beat, known, given, np.array(source, np.int64), prompts, unwanted)

    def _item(self, rng: np.random.Generator, frames: int) -> tuple:
        entry = self._entry(rng, frames)
        start = int(rng.integers(len(entry.features) - frames + 1))
        features = recentred(entry.features[start : start + frames].astype(np.float64))
        beat = entry.beat[start : start + frames].astype(np.float64)
        if rng.uniform() < 0.15:
            beat = np.zeros_like(beat)
        clean = (features - self.corpus.mean) / self.corpus.scale
        known, given = hide(rng, clean, self.corpus.scale)
        if entry.captions:
            prompt = reworded(rng, entry.captions[int(rng.integers(len(entry.captions)))])
        else:
            prompt = caption(rng, entry.actions, hand=entry.hand, speed=entry.speed, doubt=0.2)
        unwanted = ""
        if rng.uniform() < 0.3 and not entry.captions:
            unwanted = negative(rng, entry.actions)
        if rng.uniform() < 0.1:
            prompt = ""
        source = SOURCES.index(entry.source if rng.uniform() > 0.15 else "any")
        return clean, beat, known, given, source, prompt, unwanted

    def _entry(self, rng: np.random.Generator, frames: int) -> Entry:
        kind = rng.uniform()
        share = 0.3 if frames > 64 else 0.55
        if kind < share:
            fitting = {a: [e for e in group if len(e.features) >= frames] for a, group in self._captured.items()}
            fitting = {a: group for a, group in fitting.items() if group}
            if fitting:
                names = sorted(fitting)
                weight = np.array([np.sqrt(sum(len(e.features) for e in fitting[a])) for a in names])
                group = fitting[names[int(rng.choice(len(names), p=weight / weight.sum()))]]
                length = np.array([len(e.features) for e in group], float)
                return group[int(rng.choice(len(group), p=length / length.sum()))]
        if kind > 0.92 and self._composed:
            return self._composed[int(rng.integers(len(self._composed)))]
        names = sorted(self._kinematic)
        group = self._kinematic[names[int(rng.integers(len(names)))]]
        return group[int(rng.integers(len(group)))]


def hide(rng: np.random.Generator, clean: NDArray, scale: NDArray) -> tuple[NDArray, NDArray]:
    """What is given of (frame, NUM_FEATURES) normalised features: nothing, mostly.

    Returns:
        (frame, NUM_FEATURES) the given values, zero elsewhere, and (frame, part) where they are.
    """
    n = len(clean)
    given = np.zeros((n, len(_PARTS)))
    known = clean
    kind = rng.uniform()
    if kind < 0.06:  # go on from a beginning
        given[: int(rng.integers(1, n // 2))] = 1.0
    elif kind < 0.10:  # from a beginning to an end
        given[: int(rng.integers(1, n // 3))] = 1.0
        given[n - int(rng.integers(1, n // 3)) :] = 1.0
    elif kind < 0.13:  # through single poses
        given[rng.uniform(size=n) < rng.uniform(0.02, 0.2)] = 1.0
    elif kind < 0.20:  # the rest of the body
        given[:, rng.uniform(size=len(_PARTS)) < rng.uniform(0.2, 0.8)] = 1.0
    elif kind < 0.24:  # arms for a walking body
        given[:, : _PARTS.index("left_arm")] = 1.0
        given[:, _PARTS.index("left_arm" if rng.uniform() < 0.5 else "right_arm")] = float(rng.uniform() < 0.5)
    elif kind < 0.32:  # along a path
        given[:, _PARTS.index("place")] = SOFT
        known = clean.copy()
        wide = rng.uniform(0.2, 0.5) * FRAME_RATE
        known[:, :2] = gaussian_filter1d(clean[:, :2], wide, axis=0, mode="nearest")
    return known * spread(given), given
