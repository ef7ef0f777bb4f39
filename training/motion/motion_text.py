"""Training of the sentence encoder on drawn sentences; a few minutes on one core."""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np
import torch
from torch.nn.functional import cross_entropy

from rfgen_sionna.generative.diffusion.phrasebook import CLAUSES, FRAGMENTS, UPPER
from rfgen_sionna.generative.diffusion.sentence_encoder import TextEncoder, tokenise
from rfgen_sionna.generative.motion import ACTIONS
from training.learning import Progress, fit
from training.motion.motion_captions import ENDINGS, FAST, SLOW, SUBJECTS, caption


@dataclass(frozen=True)
class Captions:
    """Sentences of captured clips."""

    action: str
    sentences: tuple[str, ...]


def reworded(rng: np.random.Generator, sentence: str) -> str:
    """A captured clip's sentence with another subject and ending."""
    if sentence.startswith("a person ") and rng.uniform() < 0.5:
        sentence = SUBJECTS[int(rng.integers(len(SUBJECTS)))] + sentence[len("a person") :]
    return sentence + ENDINGS[int(rng.integers(len(ENDINGS)))]


def roughened(rng: np.random.Generator, text: str) -> str:
    """A sentence with now and then a word left out or a letter wrong."""
    parts = text.split(" ")
    if len(parts) > 4 and rng.uniform() < 0.15:
        del parts[int(rng.integers(len(parts)))]
    if rng.uniform() < 0.12:
        i = int(rng.integers(len(parts)))
        w = parts[i]
        if len(w) > 4:
            k = int(rng.integers(1, len(w) - 1))
            parts[i] = w[:k] + w[k + 1 :] if rng.uniform() < 0.5 else w[:k] + w[k + 1] + w[k] + w[k + 2 :]
    return " ".join(parts)


def train_text(
    captured: list[Captions],
    *,
    seed: int = 0,
    steps: int = 1500,
    batch: int = 112,
    progress: Progress | None = None,
) -> TextEncoder:
    """A trained encoder.

    Args:
        captured: captions of captured clips; their actions are added to the kinematic ones.
        seed: of weights and sentences.
        steps: optimiser steps.
        batch: sentences a step.
        progress: called with (step, steps, loss).
    """
    torch.manual_seed(seed)
    rng = np.random.default_rng([seed, 77])
    names = tuple(CLAUSES) + tuple(sorted({c.action for c in captured} - set(CLAUSES)))
    index = {name: i for i, name in enumerate(names)}
    model = TextEncoder(names)

    def loss_of() -> torch.Tensor:
        texts: list[str] = []
        columns: tuple[list[int], ...] = ([], [], [], [])
        for _ in range(batch):
            text, targets = _example(rng, captured, index)
            texts.append(roughened(rng, text))
            for column, value in zip(columns, targets, strict=True):
                column.append(value)
        actions, arms, hands, paces = map(torch.tensor, columns)
        reading = model(tokenise(texts))
        loss = cross_entropy(model.action(reading.pooled), actions, label_smoothing=0.02)
        loss = loss + 0.3 * cross_entropy(model.arms(reading.pooled), arms)
        loss = loss + 0.2 * cross_entropy(model.hand(reading.pooled), hands)
        loss = loss + 0.1 * cross_entropy(model.pace(reading.pooled), paces)
        return loss

    fit(model, loss_of, steps, rise=0.1, progress=progress)
    return model.eval()


def _example(
    rng: np.random.Generator, captured: list[Captions], index: dict[str, int]
) -> tuple[str, tuple[int, int, int, int]]:
    none = len(index)
    kind = rng.uniform()
    kinematic = tuple(CLAUSES)
    if captured and kind < 0.3:
        clip = captured[int(rng.integers(len(captured)))]
        sentence = clip.sentences[int(rng.integers(len(clip.sentences)))]
        return reworded(rng, sentence), (index[clip.action], none, 0, 1)
    if kind < 0.4:
        arms = UPPER[int(rng.integers(len(UPPER)))]
        hand = ("left", "right")[int(rng.integers(2))] if ACTIONS[arms].one_handed else ""
        text = caption(rng, ("walk", arms), hand=hand)
        return text, (index["walk"], index[arms], _hand(text, hand), 1)
    if kind < 0.5:
        action = kinematic[int(rng.integers(len(kinematic)))]
        return FRAGMENTS[action][int(rng.integers(len(FRAGMENTS[action])))], (index[action], none, 0, 1)
    action = kinematic[int(rng.integers(len(kinematic)))]
    hand = ("left", "right")[int(rng.integers(2))] if ACTIONS[action].one_handed else ""
    speed = float(np.exp(rng.uniform(np.log(0.75), np.log(1.3))))
    text = caption(rng, (action,), hand=hand, speed=speed)
    pace = 1 if SLOW <= speed <= FAST else (0 if speed < SLOW else 2)
    return text, (index[action], none, _hand(text, hand), pace)


def _hand(text: str, hand: str) -> int:
    said = hand and re.search(rf"\b{hand} (?:index finger|finger|hand|arm)", text)
    return ("", "left", "right").index(hand) if said else 0
