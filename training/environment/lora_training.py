"""Training of an RF LoRA: seeded, resumable, in mixed precision."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import torch
from torch import Tensor, nn

from rfgen_sionna.generative.environment.adapters import WEIGHT_NAME, LoraFacts
from rfgen_sionna.generative.environment.place_encoder import ViewFacts
from training.environment.lora_bases import Base, target_of
from training.environment.view_corpus import ViewCorpus
from training.learning import Loop, Progress, precision, reports_out_of_memory
from training.model_files import save_lora

ATTENTION = ("to_q", "to_k", "to_v", "to_out.0")
CONVOLUTIONS = ("conv1", "conv2", "conv_in", "conv_out")
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
class _RateSettings:
    """Settings of one learning rate of a recipe."""

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


@reports_out_of_memory
def choose_rate(
    fresh_base: Callable[[], Base],
    learn: ViewCorpus,
    classifier: ViewCorpus,
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
            before = validation_loss(base, classifier, recipe)
        state, share = train_lora(
            base,
            learn,
            out,
            recipe,
            rate,
            progress=None if progress is None else _of_rate(progress, rate),
        )
        losses[rate] = validation_loss(base, classifier, recipe)
        if losses[rate] < lowest:
            lowest, best = losses[rate], (state, share)
            facts = LoraFacts("rfgen", name, recipe.steps, rate, recipe.seed, recipe.word, weights)
            save_lora(out / WEIGHT_NAME, state, facts)
    if lowest == np.inf:
        raise ValueError(f"rate: {list(rates)}; training went astray with each of them, lower ones are needed")
    winner = min(rate for rate in losses if losses[rate] == lowest)
    return LoraOutcome(winner, best[1], losses, before, recipe, name, best[0])


@reports_out_of_memory
def train_lora(
    base: Base,
    corpus: ViewCorpus,
    out: Path,
    recipe: LoraRecipe,
    rate: float,
    *,
    progress: Progress | None = None,
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
    out.mkdir(parents=True, exist_ok=True)
    settings = _RateSettings({**asdict(recipe), "steps": 0}, f"{base.name} {base.weights}".strip(), rate, recipe.steps)
    loop = Loop(trained, optimiser, settings, out / f"checkpoint-{rate:g}.pt")
    some = np.random.default_rng([recipe.seed, 23]).permutation(len(corpus))[: recipe.frames]
    base.unet.train()
    scheduler = base.scheduler
    for step in loop.steps(recipe.save_every, None, progress):
        rng = np.random.default_rng([recipe.seed, 29, step])
        index = [int(some[i]) for i in rng.integers(len(some), size=recipe.items)]
        mirrored = [bool(rng.integers(2)) for _ in index]
        clean = base.latents(np.stack([corpus.image(i, m) for i, m in zip(index, mirrored, strict=True)]))
        texts = ["" if rng.uniform() < 0.1 else f"{recipe.word} {corpus.sentence(i, rng)}".strip() for i in index]
        views = [corpus.view(i, m) for i, m in zip(index, mirrored, strict=True)]
        with precision(device):
            loss = _loss(base, scheduler, clean, texts, views, torch.Generator().manual_seed(recipe.seed * 7919 + step))
        loop.learn(loss)
    base.unet.eval()
    weights: dict[str, Tensor] = {}
    for name, net in nets.items():
        weights |= lora_state(net, name)
    return weights, share


@torch.no_grad()
def validation_loss(base: Base, classifier: ViewCorpus, recipe: LoraRecipe) -> float:
    """Mean loss over validation views at a few noise levels; the same noise every time."""
    some = np.random.default_rng([recipe.seed, 31]).permutation(len(classifier))[:JUDGED]
    scheduler, losses = base.scheduler, []
    count = scheduler.config.num_train_timesteps
    for start in range(0, len(some), recipe.items):
        index = [int(i) for i in some[start : start + recipe.items]]
        clean = base.latents(np.stack([classifier.image(i, False) for i in index]))
        texts = [f"{recipe.word} {classifier.captions[i]}".strip() for i in index]
        for level in range(_LEVELS):
            generator = torch.Generator().manual_seed(1_000 * start + level)
            at = int((level + 0.5) / _LEVELS * count)
            losses.append(
                float(_loss(base, scheduler, clean, texts, [classifier.views[i] for i in index], generator, at))
            )
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


def add_lora(net: Any, rank: int, *, convolutions: bool = False, seed: int = 0) -> list[nn.Parameter]:
    """Give `net` (a U-Net or text encoder) an untrained LoRA and freeze everything else.

    Returns:
        the parameters to train.
    """
    from peft import LoraConfig

    torch.manual_seed(seed)
    targets = [*ATTENTION, *(CONVOLUTIONS if convolutions else ())]
    if hasattr(net, "text_model") or type(net).__name__.startswith("CLIPText"):
        targets = ["q_proj", "k_proj", "v_proj", "out_proj"]
    net.requires_grad_(False)
    net.add_adapter(LoraConfig(r=rank, lora_alpha=rank, init_lora_weights="gaussian", target_modules=targets))
    trained = [p for p in net.parameters() if p.requires_grad]
    for parameter in trained:
        parameter.data = parameter.data.float()
    return trained


def lora_state(net: nn.Module, prefix: str) -> dict[str, Tensor]:
    """The LoRA's weights under the names that peft and diffusers share.

    diffusers' older names exist for attention alone, and where a file mixes both, it reads peft's only.
    """
    from peft.utils import get_peft_model_state_dict

    state = get_peft_model_state_dict(net)
    return {f"{prefix}.{k}": v.detach().float().cpu().contiguous() for k, v in state.items()}


def _of_rate(progress: Callable[[float, int, float], None], rate: float) -> Progress:
    return lambda step, _, loss: progress(rate, step, loss)
