"""Training of the ControlNet that completes incomplete images: seeded, resumable, the base model stays as it is."""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import torch
from diffusers.models.attention_processor import AttnProcessor
from torch import Tensor

from rfgen_sionna.generative.environment.adapters import fingerprint
from rfgen_sionna.generative.environment.conditional_prior import LEAST_SPREAD
from rfgen_sionna.generative.environment.environment_model import (
    CONTROL_FILE,
    EnvironmentModel,
    condition_of,
    new_control,
    weights_fingerprint,
)
from rfgen_sionna.generative.environment.view_unet import make_scheduler
from training.environment.image_training import draw_batch, weighted_velocity_loss
from training.learning import Progress, Run, precision, reports_out_of_memory
from training.model_files import write_control

if TYPE_CHECKING:
    from diffusers import ControlNetModel

    from training.environment.view_corpus import ViewCorpus

_LOWEST = 0.35
"""Time from which noise may lie on the incomplete image."""
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
    started: float = 0.5
    """Share of the noisy images that are made from the incomplete image, as image-to-image starts from it."""
    begun: str = ""
    """Fingerprint of the ControlNet that training begins with; :func:`train_control` fills it in."""
    base: str = ""
    """Fingerprint of the base model's network, which the ControlNet's file keeps; so is this."""


@reports_out_of_memory
def train_control(
    corpus: ViewCorpus,
    model: EnvironmentModel,
    out: Path,
    recipe: ControlRecipe,
    *,
    start: ControlNetModel | None = None,
    device: str = "cpu",
    save_every: int = 25,
    progress: Progress | None = None,
) -> Path:
    """Train, or go on where `out` stopped, and write `control.safetensors` there.

    Args:
        corpus: pairs of incomplete and complete views.
        model: the base model; its weights aren't changed.
        out: folder of checkpoint, log and result.
        recipe: what to do. A checkpoint of another recipe is refused, except for more or fewer steps.
        start: a trained ControlNet to begin with; None: the base model's own encoder.
        device: where to train.
        save_every: steps between checkpoints.
        progress: called with (step, steps, running mean of the loss).

    Raises:
        ValueError: `corpus` has no pairs, or `out` holds a checkpoint of another recipe, start or base.
    """
    recipe = replace(recipe, begun=fingerprint(start), base=weights_fingerprint(model.unet))
    latents, given_latents = corpus.latents(model.vae), corpus.latents(model.vae, incomplete=True)
    out.mkdir(parents=True, exist_ok=True)
    torch.manual_seed(recipe.seed)
    unet = model.unet.to(device).requires_grad_(False)
    files = out / "control-checkpoint.pt", out / "control-log.jsonl"
    net = new_control(unet)
    if start is not None:
        net.load_state_dict(start.state_dict())
    run = Run(net.to(device).requires_grad_(True).train(), recipe, *files, warmup=100, forget=0.03)
    if torch.device(device).type == "cpu":
        for part in (run.net, unet):
            part.set_attn_processor(AttnProcessor())

    # What a complete image is expected to be is the incomplete one, give or take how they differ.
    spread = (latents - given_latents).float().std(dim=(0, 1, 3, 4)).clamp(min=LEAST_SPREAD)

    def keep(step: int, hours: float) -> None:
        facts = {**asdict(recipe), "spread": spread.tolist(), "steps": step, "hours": hours, "pairs": len(corpus)}
        write_control(out / CONTROL_FILE, run.mean, facts)

    for step in run.steps(save_every, keep, progress):
        rng = np.random.default_rng([recipe.seed, 43, step])
        batch = draw_batch(corpus, model.text, recipe.items, rng, _SILENT)
        whole = rng.uniform(size=recipe.items) < recipe.complete
        given = [_picked(corpus, i, m, w) for i, m, w in zip(batch.index, batch.mirrored, whole, strict=True)]
        sides = [int(m) for m in batch.mirrored]
        clean = latents[sides, batch.index].float()
        start = torch.where(
            torch.from_numpy(whole)[:, None, None, None], clean, given_latents[sides, batch.index].float()
        )
        noisy, times, target = diffuse_towards(
            clean.to(device),
            start.to(device),
            torch.from_numpy(rng.uniform(size=recipe.items) < recipe.started).to(device),
            torch.Generator().manual_seed(recipe.seed * 1_000_033 + step),
        )
        tokens = batch.tokens.to(device)
        scale = spread[:, None, None].to(device).expand(clean.shape)
        told = {"expected": start.to(device), "spread": scale}
        with precision(device):
            down, middle = run.net(
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
                cross_attention_kwargs=told,
                down_block_additional_residuals=down,
                mid_block_additional_residual=middle,
            ).sample
        run.learn(weighted_velocity_loss(guess, target, times, scale))
    return out / CONTROL_FILE


def diffuse_towards(
    clean: Tensor, start: Tensor, started: Tensor, generator: torch.Generator
) -> tuple[Tensor, Tensor, Tensor]:
    """Noisy latents, their time steps, and the velocities that lead to `clean`.

    Where `started` (image,) the noise lies on `start` instead, at the higher levels that image-to-image starts from:
    there is still seen what is incomplete, and what is to be guessed is the complete image all the same.
    """
    scheduler = make_scheduler()
    count = scheduler.config.num_train_timesteps
    steps = torch.randint(count, (len(clean),), generator=generator).to(clean.device)
    lowest = int(_LOWEST * count)
    steps = torch.where(started, lowest + (steps * (count - lowest)) // count, steps)
    noise = torch.randn(clean.shape, generator=generator).to(clean.device)
    share = scheduler.alphas_cumprod.to(clean.device)[steps][:, None, None, None]
    noisy = share.sqrt() * torch.where(started[:, None, None, None], start, clean) + (1 - share).sqrt() * noise
    straight = share.sqrt() * noise - (1 - share).sqrt() * clean
    bent = (share.sqrt() * noisy - clean) / (1 - share).sqrt()
    return noisy, steps, torch.where(started[:, None, None, None], bent, straight)


def _picked(corpus: ViewCorpus, index: int, mirrored: bool, complete: bool) -> np.ndarray:
    images = corpus.images if complete else corpus.lacking
    return images[index, :, :, ::-1] if mirrored else images[index]
