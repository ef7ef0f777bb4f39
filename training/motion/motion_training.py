"""Training of the motion model: seeded, resumable, on one machine."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from rfgen_sionna.generative.diffusion.checkpoint import MotionModel
from rfgen_sionna.generative.diffusion.network import Conditions, DenoisingNet, NetworkShape
from rfgen_sionna.generative.diffusion.schedule import STEPS, log_snr, signal_shares
from rfgen_sionna.generative.diffusion.sentence_encoder import TextEncoder, tokenise
from training.learning import Progress, Run, precision
from training.model_files import write_motion_model
from training.motion.batches import BatchSampler, MotionBatch
from training.motion.calibration import calibrate
from training.motion.joint_loss import geometric_loss
from training.motion.motion_captions import vocabulary
from training.motion.motion_corpus import MotionCorpus

_LAG = 4
"""Poses over which movement is seen."""
_QUIET = 0.02
"""Movement under which it counts as standing still, mean square of the normalised features' changes."""


@dataclass(frozen=True)
class MotionRecipe:
    """What decides the outcome of a training run."""

    steps: int = 12_000
    items: int = 32
    """Motions a step."""
    rate: float = 5e-4
    """Learning rate; it warms up over 300 steps and falls over the last 40 % of them."""
    seed: int = 0
    geometric: float = 0.15
    """Weight of the losses in space."""
    movement: float = 0.5
    """Weight of the error of movement, relative to each clip's own movement."""
    movement_from: int = 2500
    """Step from which that counts: postures come first."""
    average: float = 0.999
    """Decay of the running mean of the weights, which is what is kept."""


def train(
    corpus: MotionCorpus,
    text: TextEncoder,
    out: Path,
    recipe: MotionRecipe,
    *,
    shape: NetworkShape | None = None,
    save_every: int = 500,
    progress: Progress | None = None,
) -> Path:
    """Train, or go on where `out` stopped, and write `motion.safetensors` there.

    Args:
        corpus: the training set.
        text: the sentence encoder; it isn't changed.
        out: folder of checkpoints, log and result.
        recipe: what to do. A checkpoint of another recipe is refused, except for more or fewer steps.
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
    run = Run(DenoisingNet(shape), recipe, out / "checkpoint.pt", out / "log.jsonl")
    feeder = BatchSampler(corpus, seed=recipe.seed, items=recipe.items)
    loss_of = DenoisingLoss(corpus, text)

    def keep(step: int, hours: float) -> None:
        model = assembled(run.mean, text, corpus, {"steps": step, "hours": hours, "seed": recipe.seed})
        if step == recipe.steps:
            model = calibrate(replace(model, net=run.mean.eval()), corpus, seed=recipe.seed)
        write_motion_model(out / "motion.safetensors", model)

    for step in run.steps(save_every, keep, progress):
        generator = torch.Generator().manual_seed(recipe.seed * 1_000_003 + step)
        movement = recipe.movement if step >= recipe.movement_from else 0.0
        loss, parts = loss_of(run.net, feeder.batch(step), recipe.geometric, movement, generator)
        run.learn(loss, **parts)
    return out / "motion.safetensors"


class DenoisingLoss:
    """The training loss of a batch."""

    def __init__(self, corpus: MotionCorpus, text: TextEncoder) -> None:
        self.text = text
        self.mean = torch.from_numpy(corpus.mean).float()
        self.scale = torch.from_numpy(corpus.scale).float()
        self.shares = torch.from_numpy(signal_shares()).float()
        self.log_snr = torch.from_numpy(log_snr(signal_shares())).float()

    def __call__(
        self, net: DenoisingNet, batch: MotionBatch, geometric: float, movement: float, generator: torch.Generator
    ) -> tuple[Tensor, dict[str, float]]:
        """Loss, and its parts for the log.

        The error of the clean motion is weighted with 1 + min(SNR, 4): without the 1 high noise, where the rhythm is
        decided, would count for nothing.
        """
        clean = torch.from_numpy(batch.clean)
        step = torch.randint(STEPS, (len(clean),), generator=generator)
        noise = torch.randn(clean.shape, generator=generator)
        share = self.shares[step][:, None, None]
        noisy = share.sqrt() * clean + (1.0 - share).sqrt() * noise
        conditions = self.conditions(batch)
        with precision():
            guess = net(noisy, self.log_snr[step], conditions)
        guess = guess.float()
        weight = 0.5 * (1.0 + self.log_snr[step].exp().clamp(max=4.0))
        error = ((guess - clean) ** 2).mean(dim=(1, 2))
        # positions are dear, and a quarter of the batch shows the same
        some = slice(0, max(1, len(clean) // 4))
        space = geometric_loss(guess[some] * self.scale + self.mean, clean[some] * self.scale + self.mean)
        plain, shaped = (weight * error).mean(), (weight[some] * space.clamp(max=50.0)).mean()
        # a gesture moves a fiftieth of what a dance does: over its own movement, it counts as much
        change, goal = (x[:, _LAG:] - x[:, :-_LAG] for x in (guess, clean))
        still = ((change - goal) ** 2).mean(dim=(1, 2)) / ((goal**2).mean(dim=(1, 2)) + _QUIET)
        moved = (weight * still.clamp(max=4.0)).mean()
        parts = {"plain": float(plain.detach()), "space": float(shaped.detach()), "movement": float(moved.detach())}
        return plain + geometric * shaped + movement * moved, parts

    @torch.no_grad()
    def conditions(self, batch: MotionBatch) -> Conditions:
        """A batch's sentences encoded; empty ones are zeros."""
        wanted = self.text(tokenise(batch.prompts))
        unwanted = self.text(tokenise(batch.unwanted)).pooled
        said = torch.tensor([bool(p) for p in batch.prompts])[:, None]
        denied = torch.tensor([bool(p) for p in batch.unwanted])[:, None]
        return Conditions(
            wanted.tokens * said[..., None],
            wanted.mask,
            wanted.pooled * said,
            unwanted * denied,
            torch.from_numpy(batch.source),
            torch.from_numpy(batch.beat),
            torch.from_numpy(batch.known),
            torch.from_numpy(batch.given),
        )


def assembled(net: DenoisingNet, text: TextEncoder, corpus: MotionCorpus, facts: dict[str, Any]) -> MotionModel:
    """A model from what was trained and the statistics of its training set; residuals aren't measured yet."""
    stems = vocabulary(tuple({c for e in corpus.entries if not e.held_out for c in e.captions}))
    return MotionModel(net, text, corpus.hands, corpus.beats, corpus.mean, corpus.scale, facts, stems)
