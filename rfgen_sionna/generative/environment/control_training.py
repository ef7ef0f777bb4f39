"""Training of the ControlNet that completes incomplete images: seeded, resumable, the base model stays as it is."""

from __future__ import annotations

import json
import time
from copy import deepcopy
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import torch
from diffusers.models.attention_processor import AttnProcessor
from torch import Tensor

from rfgen_sionna.generative.environment.model import CONTROL_FILE, EnvironmentModel, new_control, write_control
from rfgen_sionna.generative.environment.training import (
    Progress,
    diffuse,
    draw_batch,
    follow,
    half,
    pace,
    resume,
    save,
)

if TYPE_CHECKING:
    from rfgen_sionna.generative.environment.corpus import Corpus

_SILENT = 0.3
"""Share of the images without a sentence: the image to complete says most of it."""


@dataclass(frozen=True)
class ControlRecipe:
    """What decides the outcome of a training run."""

    steps: int = 3_000
    items: int = 16
    rate: float = 3e-4
    seed: int = 0
    average: float = 0.995
    complete: float = 0.25
    """Share of the images that are complete already and must stay as they are."""


def condition_of(channels: np.ndarray) -> Tensor:
    """(image, 3, row, column) channels in −1 … 1 as a ControlNet reads them: 0 … 1."""
    return torch.from_numpy(np.ascontiguousarray(0.5 * (channels.astype(np.float32) + 1.0)))


def train_control(
    corpus: Corpus,
    model: EnvironmentModel,
    out: Path,
    recipe: ControlRecipe,
    *,
    device: str = "cpu",
    save_every: int = 100,
    progress: Progress | None = None,
) -> Path:
    """Train, or go on where `out` stopped, and write `control.safetensors` there.

    Args:
        corpus: pairs of incomplete and complete views.
        model: the base model; its weights aren't changed.
        out: folder of checkpoint, log and result.
        recipe: what to do. A checkpoint of another recipe is refused, except for more or fewer steps.
        device: where to train.
        save_every: steps between checkpoints.
        progress: called with (step, steps, running mean of the loss).

    Raises:
        ValueError: `corpus` has no pairs, or `out` holds a checkpoint of another recipe.
    """
    if corpus.incomplete is None:
        raise ValueError("data: pairs of incomplete and complete views are needed (… environment.render, kind 'pairs')")
    out.mkdir(parents=True, exist_ok=True)
    torch.manual_seed(recipe.seed)
    unet = model.unet.to(device).requires_grad_(False)
    net = new_control(unet).to(device).train()
    mean = deepcopy(net).requires_grad_(False)
    if torch.device(device).type == "cpu":
        for part in (net, unet):
            part.set_attn_processor(AttnProcessor())
    optimiser = torch.optim.AdamW(net.parameters(), lr=recipe.rate, weight_decay=0.01, betas=(0.9, 0.99), fused=True)
    saved = out / "control-checkpoint.pt"
    first, seconds = 0, 0.0
    if saved.is_file():
        state = resume(saved, recipe)
        net.load_state_dict(state["net"])
        mean.load_state_dict(state["mean"])
        optimiser.load_state_dict(state["optimiser"])
        first, seconds = state["step"], state["seconds"]
    latents = corpus.latents(model.vae)
    shown, started = 0.0, time.monotonic()
    for step in range(first, recipe.steps):
        for group in optimiser.param_groups:
            group["lr"] = recipe.rate * pace(step, recipe.steps, warmup=100)
        rng = np.random.default_rng([recipe.seed, 43, step])
        batch = draw_batch(corpus, model.text, recipe.items, rng, _SILENT)
        given = []
        for index, mirrored in zip(batch.index, batch.mirrored, strict=True):
            source = corpus.images if rng.uniform() < recipe.complete else corpus.incomplete
            given.append(source[index, :, :, ::-1] if mirrored else source[index])
        clean = latents[[int(m) for m in batch.mirrored], batch.index].float().to(device)
        noisy, times, target = diffuse(clean, torch.Generator().manual_seed(recipe.seed * 1_000_033 + step))
        tokens = batch.tokens.to(device)
        with half(device):
            down, middle = net(
                noisy,
                times,
                encoder_hidden_states=tokens,
                controlnet_cond=condition_of(np.stack(given)).to(device),
                return_dict=False,
            )
            guess = unet(
                noisy,
                times,
                encoder_hidden_states=tokens,
                down_block_additional_residuals=down,
                mid_block_additional_residual=middle,
            ).sample
        loss = torch.nn.functional.mse_loss(guess.float(), target)
        optimiser.zero_grad()
        loss.backward()
        torch.nn.utils.clip_grad_norm_(net.parameters(), 1.0)
        optimiser.step()
        follow(mean, net, recipe.average, step)
        value = float(loss.detach())
        shown = value if step == first else 0.97 * shown + 0.03 * value
        if progress is not None:
            progress(step + 1, recipe.steps, shown)
        if (step + 1) % save_every == 0 or step + 1 == recipe.steps:
            spent = seconds + time.monotonic() - started
            save(saved, net, mean, optimiser, step + 1, spent, recipe)
            with (out / "control-log.jsonl").open("a", encoding="utf-8") as log:
                log.write(json.dumps({"step": step + 1, "seconds": round(spent), "loss": round(shown, 5)}) + "\n")
            facts = {**asdict(recipe), "steps": step + 1, "hours": spent / 3600.0, "pairs": len(corpus)}
            write_control(out / CONTROL_FILE, mean, facts)
    return out / CONTROL_FILE
