"""Training of the base image model: seeded, resumable, on one machine."""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from contextlib import AbstractContextManager
from copy import deepcopy
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from diffusers.models.attention_processor import AttnProcessor
from torch import Tensor

from rfgen_sionna.generative.environment.autoencoder import PatchAutoencoder
from rfgen_sionna.generative.environment.corpus import Corpus
from rfgen_sionna.generative.environment.drafts import Drafts
from rfgen_sionna.generative.environment.model import (
    BASE_FILE,
    EnvironmentModel,
    Shape,
    make_scheduler,
    write_model,
)
from rfgen_sionna.generative.environment.text import PlaceEncoder
from rfgen_sionna.pir.codec import PirCodec

Progress = Callable[[int, int, float], None]

WITHOUT_FILE = "without-later.safetensors"
"""The model before it was shown its recipe's later place."""
_SILENT = 0.12
"""Share of the images shown without a sentence, so that guidance has something to guide away from."""

_HIGH_NOISE = 1.5
"""Times are drawn as 1 − u to this power: what stands where is decided under much noise, since patches that belong
together tell of each other."""


@dataclass(frozen=True)
class Recipe:
    """What decides the outcome of a training run."""

    steps: int = 12_000
    items: int = 32
    """Images a step."""
    rate: float = 6e-4
    """Learning rate; it warms up over 300 steps and falls over the last 40 % of them."""
    seed: int = 0
    average: float = 0.9985
    """Decay of the running mean of the weights, which is what is kept."""
    later: str = ""
    """A place that isn't shown before step `later_from`; the model of that moment is kept too, so that an RF LoRA can
    be examined on a place that its base has never seen."""
    later_from: int = 0


@dataclass(frozen=True)
class Batch:
    """What one step sees."""

    index: list[int]
    """(item,) of the corpus."""
    mirrored: list[bool]
    tokens: Tensor
    """(item, TOKENS, WIDTH)."""


def draw_batch(
    corpus: Corpus,
    text: PlaceEncoder,
    items: int,
    rng: np.random.Generator,
    silent: float = _SILENT,
    without: str = "",
) -> Batch:
    """Items drawn evenly over the places but `without`, newly worded, half of them mirrored."""
    groups = [np.flatnonzero(corpus.places == k) for k in np.unique(corpus.places) if corpus.names[k] != without]
    index = [int(rng.choice(groups[int(rng.integers(len(groups)))])) for _ in range(items)]
    mirrored = [bool(rng.integers(2)) for _ in index]
    texts = ["" if rng.uniform() < silent else corpus.sentence(i, rng) for i in index]
    return Batch(index, mirrored, text.embed(texts, [corpus.view(i, m) for i, m in zip(index, mirrored, strict=True)]))


def train(
    corpus: Corpus,
    vae: PatchAutoencoder,
    text: PlaceEncoder,
    out: Path,
    recipe: Recipe,
    *,
    shape: Shape | None = None,
    codec: PirCodec | None = None,
    device: str = "cpu",
    save_every: int = 50,
    progress: Progress | None = None,
) -> Path:
    """Train, or go on where `out` stopped, and write `environment.safetensors` there.

    Args:
        corpus: the training set.
        vae, text: autoencoder and sentence encoder; they aren't changed.
        out: folder of checkpoint, log and result.
        recipe: what to do. A checkpoint of another recipe is refused, except for more or fewer steps.
        shape: sizes of the network.
        codec: the convention of the images, which the model will carry.
        device: where to train.
        save_every: steps between checkpoints.
        progress: called with (step, steps, running mean of the loss).

    Returns:
        the file with the model.

    Raises:
        ValueError: `out` holds a checkpoint of another recipe, or its later place isn't in the corpus.
    """
    if recipe.later and recipe.later not in corpus.names:
        raise ValueError(f"later: {recipe.later!r}; the data set has {', '.join(corpus.names)}")
    shape, codec = shape or Shape(latents=vae.config.latent_channels), codec or PirCodec()
    out.mkdir(parents=True, exist_ok=True)
    torch.manual_seed(recipe.seed)
    net = shape.unet().to(device)
    mean = deepcopy(net).requires_grad_(False)
    if device == "cpu":
        net.set_attn_processor(AttnProcessor())  # the fused kernel's backward pass is slow there
    optimiser = torch.optim.AdamW(net.parameters(), lr=recipe.rate, weight_decay=0.01, betas=(0.9, 0.99), fused=True)
    saved = out / "checkpoint.pt"
    first, seconds = 0, 0.0
    if saved.is_file():
        state = resume(saved, recipe)
        net.load_state_dict(state["net"])
        mean.load_state_dict(state["mean"])
        optimiser.load_state_dict(state["optimiser"])
        first, seconds = state["step"], state["seconds"]
    latents = corpus.latents(vae)
    drafts = Drafts.fit(corpus, codec)
    shown, started = 0.0, time.monotonic()
    for step in range(first, recipe.steps):
        for group in optimiser.param_groups:
            group["lr"] = recipe.rate * pace(step, recipe.steps)
        rng = np.random.default_rng([recipe.seed, 17, step])
        hidden = recipe.later if step < recipe.later_from else ""
        batch = draw_batch(corpus, text, recipe.items, rng, without=hidden)
        clean = latents[[int(m) for m in batch.mirrored], batch.index].float().to(device)
        noisy, timesteps, target = diffuse(clean, torch.Generator().manual_seed(recipe.seed * 1_000_003 + step))
        with half(device):
            guess = net(noisy, timesteps, batch.tokens.to(device)).sample
        loss = torch.nn.functional.mse_loss(guess.float(), target)
        optimiser.zero_grad()
        loss.backward()
        torch.nn.utils.clip_grad_norm_(net.parameters(), 1.0)
        optimiser.step()
        follow(mean, net, recipe.average, step)
        value = float(loss.detach())
        shown = value if step == first else 0.98 * shown + 0.02 * value
        if progress is not None:
            progress(step + 1, recipe.steps, shown)
        if (step + 1) % save_every == 0 or step + 1 == recipe.steps:
            spent = seconds + time.monotonic() - started
            save(saved, net, mean, optimiser, step + 1, spent, recipe)
            with (out / "log.jsonl").open("a", encoding="utf-8") as log:
                log.write(json.dumps({"step": step + 1, "seconds": round(spent), "loss": round(shown, 5)}) + "\n")
            facts = {"steps": step + 1, "hours": spent / 3600.0, "views": len(corpus), **asdict(recipe)}
            model = EnvironmentModel(mean, vae, text, codec, shape, {**facts, "steps": step + 1}, drafts=drafts)
            write_model(out / BASE_FILE, model)
            if recipe.later and step + 1 <= recipe.later_from:
                write_model(out / WITHOUT_FILE, model)
    return out / BASE_FILE


def diffuse(clean: Tensor, generator: torch.Generator) -> tuple[Tensor, Tensor, Tensor]:
    """Noisy latents, their time steps, and the velocities that are to be guessed."""
    scheduler = make_scheduler()
    count = scheduler.config.num_train_timesteps
    drawn = 1.0 - torch.rand(len(clean), generator=generator) ** _HIGH_NOISE
    steps = (count * drawn).long().clamp(0, count - 1).to(clean.device)
    noise = torch.randn(clean.shape, generator=generator).to(clean.device)
    share = scheduler.alphas_cumprod.to(clean.device)[steps][:, None, None, None]
    noisy = share.sqrt() * clean + (1 - share).sqrt() * noise
    return noisy, steps, share.sqrt() * noise - (1 - share).sqrt() * clean


def half(device: str) -> AbstractContextManager[None]:
    """Mixed precision: bfloat16 where matrices are multiplied."""
    return torch.autocast(torch.device(device).type, torch.bfloat16)


def pace(step: int, steps: int, warmup: int = 300) -> float:
    """Share of the learning rate."""
    rise = min(1.0, (step + 1) / min(warmup, max(1, steps // 4)))
    return rise * float(np.clip((steps - step) / max(1.0, 0.4 * steps), 0.01, 1.0))


@torch.no_grad()
def follow(mean: torch.nn.Module, net: torch.nn.Module, average: float, step: int) -> None:
    """Move the running mean of the weights towards `net`, faster in the beginning."""
    keep = min(average, (step + 1.0) / (step + 20.0))
    torch._foreach_lerp_(list(mean.parameters()), list(net.parameters()), 1.0 - keep)


def save(
    path: Path,
    net: torch.nn.Module,
    mean: torch.nn.Module,
    optimiser: torch.optim.Optimizer,
    step: int,
    seconds: float,
    recipe: Any,
) -> None:
    """Write a checkpoint, whole or not at all."""
    state = {
        "net": net.state_dict(),
        "mean": mean.state_dict(),
        "optimiser": optimiser.state_dict(),
        "step": step,
        "seconds": seconds,
        "recipe": asdict(recipe),
    }
    partial = path.with_suffix(".part")
    torch.save(state, partial)
    partial.replace(path)


def resume(path: Path, recipe: Any) -> dict[str, Any]:
    """The state in a checkpoint.

    Raises:
        ValueError: it was made with another recipe.
    """
    state: dict[str, Any] = torch.load(path, weights_only=True, map_location="cpu")
    if {**state["recipe"], "steps": 0} != {**asdict(recipe), "steps": 0}:
        raise ValueError(f"out: {path} was made with {state['recipe']}, not with {asdict(recipe)}; use another folder")
    return state
