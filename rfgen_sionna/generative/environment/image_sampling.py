"""Reverse process of images: diffusers' steps, with known patches, and a start image beside a ControlNet."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from torch import Tensor

from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.environment.conditional_prior import LatentPrior
from rfgen_sionna.generative.environment.environment_model import LATENT_SIZE, EnvironmentModel
from rfgen_sionna.generative.environment.reprojection import KnownView
from rfgen_sionna.generative.environment.torch_device import memory_errors
from rfgen_sionna.pir.view import View

Progress = Callable[[int, int], None]
"""Called with (step, steps)."""

SAMPLERS = ("ddim", "dpm", "euler")
MOST_STEPS = 1000
"""Steps of the forward process."""


@dataclass(frozen=True)
class ImageSampler:
    """Options of the reverse process."""

    kind: str = "ddim"
    """"ddim", or the few-step samplers "dpm" (DPM-Solver++ of second order) and "euler"."""
    steps: int = 20
    guidance: float = 1.5
    """Weight of the prompt; 1 halves the cost and keeps the model's own spread."""
    spread: float = 1.0
    """Standard deviation of the initial noise; below 1 images vary less."""

    def __post_init__(self) -> None:
        if not 0.0 < self.spread <= 1.5:
            raise ValueError(f"spread: {self.spread!r}; above 0 and up to 1.5 is allowed")
        if self.kind not in SAMPLERS:
            raise ValueError(f"sampler: {self.kind!r}; allowed are {', '.join(SAMPLERS)}")
        if not 1 <= self.steps <= MOST_STEPS:
            raise ValueError(f"steps: {self.steps!r}; 1 … {MOST_STEPS} are allowed")
        if not 1.0 <= self.guidance <= 20.0:
            raise ValueError(f"guidance: {self.guidance!r}; 1 … 20 are allowed")

    def scheduler(self, base: Any) -> Any:
        """Scheduler of diffusers of this kind with the forward process of `base`."""
        from diffusers import DDIMScheduler, DPMSolverMultistepScheduler, EulerDiscreteScheduler

        if self.kind == "ddim":
            return DDIMScheduler.from_config(base.config)
        if self.kind == "dpm":
            return DPMSolverMultistepScheduler.from_config(
                base.config, final_sigmas_type="zero", algorithm_type="dpmsolver++", lower_order_final=True
            )
        return EulerDiscreteScheduler.from_config(base.config)


@dataclass(frozen=True)
class DrawingOptions:
    """Options of :meth:`~rfgen_sionna.generative.environment.image_models.ImageModel.draw`, common to its images."""

    view: View
    sampler: ImageSampler
    negative: str = ""
    """Absent objects."""
    known: KnownView | None = None
    """Reprojection of earlier views; None draws the whole view."""
    first: View | None = None
    """First view of the place; None for a new place."""
    progress: Progress | None = None
    """None reports nothing."""


@dataclass(frozen=True)
class Conditioning:
    """Conditions of a drawing beside its words; None leaves a condition out."""

    control: Tensor | None = None
    """(image, 3, row, column) in 0 … 1 for the ControlNet."""
    start: Tensor | None = None
    """(image, latent, row, column) start image."""
    strength: float = 1.0
    """Share of the schedule that runs from `start`: 0 leaves it unchanged, 1 keeps none of it."""
    known: Tensor | None = None
    """(image, latent, row, column) latents that stay under `keep`."""
    keep: Tensor | None = None
    """(image, 1, row, column) mask of known patches."""
    expected: LatentPrior | None = None
    """Prior of the latents."""
    layout_map: Tensor | None = None
    """(image, CHANNELS, row, column) of :mod:`.layout_map`, with its prior in `expected`."""


def noise_like(count: int, model: EnvironmentModel, seed: int) -> Tensor:
    """(count, latent, row, column) noise; its first images are independent of `count`."""
    shape = (model.shape.latents, LATENT_SIZE, LATENT_SIZE)
    drawn = [
        torch.randn(shape, generator=torch.Generator().manual_seed(int(s.generate_state(1)[0])))
        for s in np.random.SeedSequence([seed, 41]).spawn(count)
    ]
    return torch.stack(drawn)


@torch.no_grad()
def sample_images(
    model: EnvironmentModel,
    scheduler: Any,
    sampler: ImageSampler,
    tokens: Tensor,
    against: Tensor,
    noise: Tensor,
    conditioning: Conditioning | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> FloatArray:
    """(image, 3, row, column) channels in −1 … 1.

    Args:
        model: the model, on its device.
        scheduler: forward process, of diffusers; stays unchanged.
        sampler: options of the reverse process.
        tokens, against: (image, token, WIDTH) of the prompts, and of the negative prompts for guidance.
        noise: (image, latent, row, column).
        conditioning: further conditions; None has none.
        progress: called with (step, steps); None reports nothing.

    Raises:
        DeviceMemoryError: the device runs out of memory.
    """
    conditioning = conditioning or Conditioning()
    with memory_errors(str(model.unet.device)):
        device, dtype = model.unet.device, model.unet.dtype
        walk = sampler.scheduler(scheduler)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DeprecationWarning)  # schedulers with NumPy 2
            walk.set_timesteps(sampler.steps, device=device)
        times = walk.timesteps
        noise = sampler.spread * noise.to(device, torch.float32)
        start, known = (
            None if x is None else x.to(device, torch.float32) for x in (conditioning.start, conditioning.known)
        )
        keep = None if conditioning.keep is None else conditioning.keep.to(device, torch.bool)
        if start is not None:
            run = min(int(sampler.steps * conditioning.strength), sampler.steps)
            if run == 0:
                return model.vae.decode(start).sample.float().clamp(-1, 1).double().cpu().numpy()
            times = times[sampler.steps - run :]
            if hasattr(walk, "set_begin_index"):
                walk.set_begin_index(sampler.steps - run)
            x = walk.add_noise(start, noise, times[:1].repeat(len(start)))
        else:
            x = noise * walk.init_noise_sigma
        guided = sampler.guidance > 1.0
        text = (torch.cat([against, tokens]) if guided else tokens).to(device, dtype)
        control = None if conditioning.control is None else conditioning.control.to(device, dtype)
        if control is not None and guided:
            control = torch.cat([control, control])
        more: dict[str, Any] = {}
        if conditioning.expected is not None:
            prior = {"expected": conditioning.expected.mean, "spread": conditioning.expected.spread}
            if conditioning.layout_map is not None:
                prior["layout_map"] = conditioning.layout_map
            more["cross_attention_kwargs"] = {name: x.to(device, torch.float32) for name, x in prior.items()}
        for number, time in enumerate(times):
            if known is not None and keep is not None:
                x = torch.where(keep, walk.add_noise(known, noise, time[None].repeat(len(x))), x)
            fed = walk.scale_model_input(torch.cat([x, x]) if guided else x, time).to(dtype)
            extra = dict(more)
            if control is not None and model.control is not None:
                down, middle = model.control(
                    fed, time, encoder_hidden_states=text, controlnet_cond=control, return_dict=False
                )
                extra |= {"down_block_additional_residuals": down, "mid_block_additional_residual": middle}
            guess = model.unet(fed, time, encoder_hidden_states=text, **extra).sample.float()
            if guided:
                away, wanted = guess.chunk(2)
                guess = away + sampler.guidance * (wanted - away)
            x = walk.step(guess, time, x).prev_sample
            if progress is not None:
                progress(number + 1, len(times))
        if known is not None and keep is not None:
            x = torch.where(keep, known, x)
        image = model.vae.decode(x).sample
        return image.float().clamp(-1, 1).double().cpu().numpy()
