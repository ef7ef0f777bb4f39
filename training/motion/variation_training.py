"""Training of the motion model: seeded, resumable, on the CPU or a GPU."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from rfgen_sionna.generative.diffusion.motion_noise import signal_share
from rfgen_sionna.generative.diffusion.variation_model import VariationModel, write_model
from rfgen_sionna.generative.diffusion.variation_net import NetworkShape, VariationNet, word_indices
from training.learning import Progress, Run, precision
from training.motion.row_corpus import SHORTEST, Entry, RowCorpus, stretch

LENGTHS = (SHORTEST, 48, 64, 96, 128)
"""Rows of the motions of a batch."""
_WORDLESS = 0.1
"""Share of motions that are shown without a caption."""


@dataclass(frozen=True)
class VariationRecipe:
    """Settings that decide the outcome of a training run."""

    steps: int = 12_000
    items: int = 24
    """Motions a step."""
    rate: float = 6e-4
    """Learning rate at its height; it rises over 300 steps and falls over the last 40 % of them."""
    seed: int = 0
    movement: float = 0.5
    """Weight of the error of changes from row to row."""
    rules: float = 0.15
    """Share of motions by rules."""
    average: float = 0.999
    """Decay of the running mean of the weights, which is kept."""


def train(
    corpus: RowCorpus,
    out: Path,
    recipe: VariationRecipe,
    *,
    device: str = "cpu",
    shape: NetworkShape | None = None,
    save_every: int = 250,
    progress: Progress | None = None,
) -> Path:
    """Train, or go on where `out` stopped, and write `variation.safetensors` there at each checkpoint.

    Args:
        corpus: the training set.
        out: folder of checkpoints, log and result.
        recipe: settings. A checkpoint of another recipe is refused, except for more or fewer steps.
        device: of the network.
        shape: sizes of the network.
        save_every: steps between checkpoints.
        progress: called with (step, steps, running mean of the loss).

    Returns:
        the file with the finished model.

    Raises:
        ValueError: `out` holds a checkpoint of another recipe.
    """
    out.mkdir(parents=True, exist_ok=True)
    torch.manual_seed(recipe.seed)
    net = VariationNet(shape or NetworkShape(), len(corpus.vocabulary)).to(device)
    run = Run(net, recipe, out / "checkpoint.pt", out / "log.jsonl")
    path = out / "variation.safetensors"
    batches = Batches(corpus, recipe)

    def keep(step: int, hours: float) -> None:
        minutes = round(60.0 * hours, 1)
        facts = {"steps": step, "minutes": minutes, "device": torch.device(device).type, "seed": recipe.seed}
        write_model(path, VariationModel(run.mean, corpus.vocabulary, corpus.noise, corpus.scaling, facts))

    for step in run.steps(save_every, keep, progress):
        noisy, goal, context, level, words = (tensor.to(device) for tensor in batches.batch(step))
        with precision(device):
            guess = run.net(noisy, context, level, words)
        error = guess.float() - goal
        plain, movement = (error**2).mean(), (error.diff(dim=1) ** 2).mean()
        run.learn(plain + recipe.movement * movement, plain=float(plain.detach()), movement=float(movement.detach()))
    return path


class Batches:
    """Draws batches from a corpus, each from the seed and its number alone."""

    def __init__(self, corpus: RowCorpus, recipe: VariationRecipe) -> None:
        self.corpus, self.recipe = corpus, recipe
        self._groups = {
            (by_rules, frames): _by_action(corpus.entries, by_rules, frames)
            for by_rules in (False, True)
            for frames in LENGTHS
        }

    def batch(self, number: int) -> tuple[Tensor, Tensor, Tensor, Tensor, Tensor]:
        """Noisy rows, v, context, levels and words of batch `number`, as :class:`VariationNet` takes them."""
        rng = np.random.default_rng([self.recipe.seed, 101, number])
        frames = LENGTHS[int(rng.integers(len(LENGTHS)))]
        chosen = [self._entry(rng, frames) for _ in range(self.recipe.items)]
        shown = [stretch(entry, frames, rng) for entry in chosen]
        mean, scale = self.corpus.scaling.rows
        clean = (np.stack([rows for rows, _ in shown]) - mean) / scale
        mean, scale = self.corpus.scaling.context
        context = (np.stack([each for _, each in shown]) - mean) / scale
        noise = np.stack([self.corpus.noise.draw(rng, frames) for _ in chosen])
        level = rng.uniform(0.02, 1.0, len(chosen))
        share = signal_share(level)[:, None, None]
        noisy, goal = (
            np.sqrt(share) * clean + np.sqrt(1.0 - share) * noise,
            (np.sqrt(share) * noise - np.sqrt(1.0 - share) * clean),
        )
        texts = [
            "" if rng.uniform() < _WORDLESS else entry.captions[int(rng.integers(len(entry.captions)))]
            for entry in chosen
        ]
        words = word_indices(texts, self.corpus.vocabulary)
        return _tensor(noisy), _tensor(goal), _tensor(context), _tensor(level), words

    def _entry(self, rng: np.random.Generator, frames: int) -> Entry:
        by_rules = bool(rng.uniform() < self.recipe.rules)
        groups = self._groups[by_rules, frames] or self._groups[not by_rules, frames]
        # an action with four times the motion is shown twice as often
        weight = np.sqrt([sum(len(entry.rows) for entry in group) for group in groups])
        group = groups[int(rng.choice(len(groups), p=weight / weight.sum()))]
        length = np.array([len(entry.rows) for entry in group], float)
        return group[int(rng.choice(len(group), p=length / length.sum()))]


def _by_action(entries: tuple[Entry, ...], by_rules: bool, frames: int) -> list[list[Entry]]:
    groups: dict[str, list[Entry]] = {}
    for entry in entries:
        if entry.by_rules == by_rules and len(entry.rows) >= frames:
            groups.setdefault(entry.action, []).append(entry)
    return [groups[action] for action in sorted(groups)]


def _tensor(values: np.ndarray) -> Tensor:
    return torch.from_numpy(values.astype(np.float32))
