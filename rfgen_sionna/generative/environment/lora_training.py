"""Training of an RF LoRA: seeded, resumable, in mixed precision."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field
from functools import partial
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import torch
from torch import Tensor

from rfgen_sionna.generative.environment.adapters import WEIGHT_NAME, LoraFacts, add_lora, lora_state, save_lora
from rfgen_sionna.generative.environment.bases import Base, target_of
from rfgen_sionna.generative.environment.corpus import Corpus
from rfgen_sionna.generative.environment.memory import training
from rfgen_sionna.generative.environment.text import ViewFacts
from rfgen_sionna.generative.learning import cool, precision, resume, write

JUDGED = 64
"""Validation views that a learning rate is chosen on."""
_LEVELS = 4
"""Noise levels at which each of them is judged."""


@dataclass(frozen=True)
class LoraRecipe:
    """What decides the outcome; as it stands, the paper's settings."""

    frames: int = 800
    steps: int = 100
    items: int = 8
    rank: int = 4
    convolutions: bool = False
    text_encoder: bool = False
    word: str = ""
    seed: int = 0
    save_every: int = 50

    paper_rate: ClassVar[float] = 1e-4


@dataclass(frozen=True)
class _Run:
    """One learning rate of a recipe: what a checkpoint must agree with."""

    recipe: dict[str, Any]
    base: str
    rate: float
    steps: int


@dataclass(frozen=True)
class LoraOutcome:
    """What came of a training."""

    rate: float
    share: float
    """Trained parameters over those of the base's U-Net."""
    losses: dict[float, float]
    """Learning rate to loss on the validation split."""
    before: float
    """Loss of the base without a LoRA there."""
    recipe: LoraRecipe
    base: str
    state: dict[str, Tensor] = field(repr=False, default_factory=dict)

    def report(self) -> dict[str, Any]:
        """Everything but the weights."""
        return {
            "base": self.base,
            "rate": self.rate,
            "share of the parameters": self.share,
            "validation loss": {f"{rate:g}": loss for rate, loss in self.losses.items()},
            "validation loss of the base": self.before,
            "recipe": asdict(self.recipe),
        }


@training
def choose_rate(
    fresh_base: Callable[[], Base],
    learn: Corpus,
    judge: Corpus,
    out: Path,
    recipe: LoraRecipe,
    rates: Sequence[float],
    *,
    progress: Callable[[float, int, float], None] | None = None,
) -> LoraOutcome:
    """Train at each rate and keep the one that does best on the validation split.

    Args:
        fresh_base: opens the base anew.
        learn, judge: training and validation views.
        out: folder of checkpoints and the result, `pytorch_lora_weights.safetensors`.
        recipe: what to do.
        rates: learning rates to try; each falls over the last 40 % of the steps.
        progress: called with (rate, step, loss).

    Raises:
        ValueError: no rate, one out of range or too high for any good, or a text encoder where there is none.
    """
    if not rates or not all(0 < rate < 1 for rate in rates):
        raise ValueError(f"rate: {list(rates)}; learning rates above 0 and below 1 are needed")
    losses: dict[float, float] = {}
    best: tuple[dict[str, Tensor], float] = {}, 0.0
    before, name, lowest = np.nan, "", np.inf
    for rate in rates:
        base = fresh_base()
        name, weights = base.name, base.weights
        if np.isnan(before):
            before = validation_loss(base, judge, recipe)
        state, share = train_lora(
            base,
            learn,
            out,
            recipe,
            rate,
            progress=None if progress is None else partial(progress, rate),
        )
        losses[rate] = validation_loss(base, judge, recipe)
        if losses[rate] < lowest:
            lowest, best = losses[rate], (state, share)
            facts = LoraFacts("rfgen", name, recipe.steps, rate, recipe.seed, recipe.word, weights)
            save_lora(out / WEIGHT_NAME, state, facts)
    if lowest == np.inf:
        raise ValueError(f"rate: {list(rates)}; training went astray with each of them, lower ones are needed")
    winner = min(rate for rate in losses if losses[rate] == lowest)
    return LoraOutcome(winner, best[1], losses, before, recipe, name, best[0])


@training
def train_lora(
    base: Base,
    corpus: Corpus,
    out: Path,
    recipe: LoraRecipe,
    rate: float,
    *,
    progress: Callable[[int, float], None] | None = None,
) -> tuple[dict[str, Tensor], float]:
    """Train a LoRA on `base`, in place.

    Returns:
        its weights under diffusers' names, and their number over that of the U-Net's.
    """
    if recipe.text_encoder and not base.text_encoders:
        raise ValueError("text_encoder: this base has no text encoder that a LoRA could adapt; leave the option out")
    nets = {"unet": base.unet}
    if recipe.text_encoder:
        nets |= {("text_encoder", "text_encoder_2")[k]: net for k, net in enumerate(base.text_encoders)}
    everything = sum(p.numel() for p in base.unet.parameters())
    trained = [
        p
        for net in nets.values()
        for p in add_lora(net, recipe.rank, convolutions=recipe.convolutions, seed=recipe.seed)
    ]
    share = sum(p.numel() for p in trained) / everything
    optimiser = torch.optim.AdamW(trained, lr=rate, weight_decay=0.01)
    device = str(base.unet.device)
    run = _Run({**asdict(recipe), "steps": 0}, f"{base.name} {base.weights}".strip(), rate, recipe.steps)
    saved = out / f"checkpoint-{rate:g}.pt"
    out.mkdir(parents=True, exist_ok=True)
    first = 0
    if saved.is_file():
        state = resume(saved, run)
        for parameter, values in zip(trained, state["trained"], strict=True):
            parameter.data.copy_(values)
        optimiser.load_state_dict(state["optimiser"])
        first = state["step"]
    some = np.random.default_rng([recipe.seed, 23]).permutation(len(corpus))[: recipe.frames]
    base.unet.train()
    scheduler = base.scheduler
    for step in range(first, recipe.steps):
        rng = np.random.default_rng([recipe.seed, 29, step])
        index = [int(some[i]) for i in rng.integers(len(some), size=recipe.items)]
        mirrored = [bool(rng.integers(2)) for _ in index]
        clean = base.latents(np.stack([corpus.image(i, m) for i, m in zip(index, mirrored, strict=True)]))
        texts = ["" if rng.uniform() < 0.1 else f"{recipe.word} {corpus.sentence(i, rng)}".strip() for i in index]
        views = [corpus.view(i, m) for i, m in zip(index, mirrored, strict=True)]
        with precision(device):
            loss = _loss(base, scheduler, clean, texts, views, torch.Generator().manual_seed(recipe.seed * 7919 + step))
        for group in optimiser.param_groups:
            group["lr"] = rate * cool(step, recipe.steps)
        optimiser.zero_grad()
        loss.backward()
        torch.nn.utils.clip_grad_norm_(trained, 1.0)
        optimiser.step()
        if progress is not None:
            progress(step + 1, float(loss.detach()))
        if (step + 1) % recipe.save_every == 0 or step + 1 == recipe.steps:
            state = {
                "trained": [p.detach().cpu() for p in trained],
                "optimiser": optimiser.state_dict(),
                "step": step + 1,
                "recipe": asdict(run),
            }
            write(saved, state)
    base.unet.eval()
    weights: dict[str, Tensor] = {}
    for name, net in nets.items():
        weights |= lora_state(net, name)
    return weights, share


@torch.no_grad()
def validation_loss(base: Base, judge: Corpus, recipe: LoraRecipe) -> float:
    """Mean loss over validation views at a few noise levels; the same noise every time."""
    some = np.random.default_rng([recipe.seed, 31]).permutation(len(judge))[:JUDGED]
    scheduler, losses = base.scheduler, []
    count = scheduler.config.num_train_timesteps
    for start in range(0, len(some), recipe.items):
        index = [int(i) for i in some[start : start + recipe.items]]
        clean = base.latents(np.stack([judge.image(i, False) for i in index]))
        texts = [f"{recipe.word} {judge.captions[i]}".strip() for i in index]
        for level in range(_LEVELS):
            generator = torch.Generator().manual_seed(1_000 * start + level)
            at = int((level + 0.5) / _LEVELS * count)
            losses.append(float(_loss(base, scheduler, clean, texts, [judge.views[i] for i in index], generator, at)))
    return float(np.mean(losses))


def _loss(
    base: Base,
    scheduler: Any,
    clean: Tensor,
    texts: Sequence[str],
    views: Sequence[ViewFacts],
    generator: torch.Generator,
    at: int | None = None,
) -> Tensor:
    count = scheduler.config.num_train_timesteps
    steps = _spread_steps(len(clean), count, generator) if at is None else torch.full((len(clean),), at)
    noise = torch.randn(clean.shape, generator=generator).to(clean)
    steps = steps.to(clean.device)
    target = target_of(scheduler, clean, noise, steps)
    noisy = scheduler.add_noise(clean, noise, steps).to(base.unet.dtype)
    guess = base.unet(noisy, steps, **base.words(texts, views)).sample
    return torch.nn.functional.mse_loss(guess.float(), target.float())


def _spread_steps(images: int, count: int, generator: torch.Generator) -> Tensor:
    """(image,) time steps, one from each of as many equal parts of `count` as there are images: gradients differ less
    from one batch to the next than with steps from anywhere."""
    parts = torch.arange(images) + torch.rand(images, generator=generator)
    return (parts * (count / images)).long().clamp(max=count - 1)
