"""Training of the sentence encoder of places on drawn sentences."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import torch
from torch.nn.functional import binary_cross_entropy_with_logits, cross_entropy

from rfgen_sionna.generative.environment.place_encoder import PlaceEncoder
from rfgen_sionna.generative.environment.sentence_encoder import tokenise
from training.learning import Progress, fit


@dataclass(frozen=True)
class Sentence:
    """A sentence and what it says."""

    text: str
    place: int
    """Index of the place; −1 where it names none."""
    things: tuple[str, ...] = ()


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
    draw: Callable[[np.random.Generator], Sentence],
    places: Sequence[str],
    things: Sequence[str],
    *,
    seed: int = 0,
    steps: int = 500,
    batch: int = 64,
    progress: Progress | None = None,
) -> PlaceEncoder:
    """A trained encoder.

    Args:
        draw: makes a sentence.
        places, things: what sentences may name.
        seed: of weights and sentences.
        steps, batch: optimiser steps and sentences a step.
        progress: called with (step, steps, loss).
    """
    torch.manual_seed(seed)
    rng = np.random.default_rng([seed, 311])
    model = PlaceEncoder(places, things)
    column = {name: i for i, name in enumerate(model.things)}

    def loss_of() -> torch.Tensor:
        drawn = [draw(rng) for _ in range(batch)]
        ids = tokenise([roughened(rng, s.text) for s in drawn])
        longest = int((ids > 0).any(dim=-1).sum(dim=1).max())
        reading = model(ids[:, :longest])
        place = torch.tensor([s.place for s in drawn])
        things_said = torch.zeros(batch, len(model.things))
        for row, sentence in enumerate(drawn):
            for thing in sentence.things:
                if thing in column:
                    things_said[row, column[thing]] = 1.0
        loss = cross_entropy(model.named(reading.pooled), place, label_smoothing=0.02, ignore_index=-1)
        loss = loss + 4.0 * binary_cross_entropy_with_logits(model.mentioned(reading.pooled), things_said)
        return loss

    fit(model, loss_of, steps, rise=0.1, progress=progress)
    model.eval().requires_grad_(False)
    with torch.no_grad():
        reading = model(tokenise([draw(rng).text for _ in range(512)]))
        words = reading.tokens[reading.mask]
        model.spread.copy_(torch.stack([reading.pooled.square().mean().sqrt(), words.square().mean().sqrt()]))
    return model
