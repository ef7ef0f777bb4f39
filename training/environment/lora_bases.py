"""Bases that an RF LoRA can be trained on: our own model and any Stable Diffusion, seen through one interface."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import torch
from diffusers.models.attention_processor import AttnProcessor
from numpy.typing import NDArray
from torch import Tensor

from rfgen_sionna.generative.environment.adapters import fingerprint
from rfgen_sionna.generative.environment.environment_model import read_model
from rfgen_sionna.generative.environment.image_models import is_embedded
from rfgen_sionna.generative.environment.place_encoder import ViewFacts
from rfgen_sionna.generative.environment.view_unet import make_scheduler
from rfgen_sionna.pir.codec import PirCodec


class Base(Protocol):
    """What a LoRA is trained on."""

    name: str
    weights: str
    """Fingerprint of the U-Net before anything is added to it; empty for bases that are too large for one."""
    unet: Any
    text_encoders: list[Any]
    """Those that a LoRA may be given as well."""
    codec: PirCodec

    def latents(self, images: NDArray[np.float32]) -> Tensor:
        """Latents of (image, 3, 64, 64) channels in −1 … 1."""
        ...

    def words(self, texts: Sequence[str], views: Sequence[ViewFacts]) -> dict[str, Any]:
        """What the U-Net takes beside noisy latents and time steps."""
        ...

    @property
    def scheduler(self) -> Any:
        """The forward process."""
        ...


class EmbeddedBase:
    """Our own model."""

    def __init__(self, model: str | Path | None, device: str) -> None:
        own = read_model(None if model is None else Path(model))
        self.name = "embedded" if model is None else Path(model).name
        self.device, self.codec, self.text_encoders = device, own.codec, []
        self.unet, self.vae, self.text = own.unet.to(device), own.vae, own.text
        self.scheduler: Any = make_scheduler()
        self.weights = fingerprint(own.unet)
        if torch.device(device).type == "cpu":
            self.unet.set_attn_processor(AttnProcessor())  # the fused kernel's backward pass is slow there

    text_encoders: list[Any]

    @torch.no_grad()
    def latents(self, images: NDArray[np.float32]) -> Tensor:
        """Latents of (image, 3, 64, 64) channels in −1 … 1."""
        latents: Tensor = self.vae.encode(torch.from_numpy(images)).latent_dist.mode()
        return latents.to(self.device)

    def words(self, texts: Sequence[str], views: Sequence[ViewFacts]) -> dict[str, Any]:
        """What the U-Net takes beside noisy latents and time steps."""
        return {"encoder_hidden_states": self.text.embed(texts, views).to(self.device)}


class StableDiffusionBase:
    """A Stable Diffusion pipeline (SD 1.x, 2.x or SDXL), from a local folder or the hub.

    Args:
        name: folder or hub name.
        device: where to train.
        edge: edge of the pictures that PIRs are enlarged to [pixels]; None is the base's own.
    """

    def __init__(self, name: str, device: str, edge: int | None = None) -> None:
        from rfgen_sionna.generative.environment.stable_diffusion import load_pipeline

        pipeline = load_pipeline(name, torch.float16 if torch.device(device).type == "cuda" else torch.float32)
        pipeline.to(device)
        self.pipeline, self.name, self.device, self.codec = pipeline, name, device, PirCodec()
        self.unet, self.weights = pipeline.unet, ""
        self.edge = edge or pipeline.unet.config.sample_size * pipeline.vae_scale_factor
        if self.edge % (8 * pipeline.vae_scale_factor):
            raise ValueError(f"edge: {self.edge} pixels; multiples of {8 * pipeline.vae_scale_factor} are needed")
        self.is_xl = hasattr(pipeline, "text_encoder_2")
        encoders = [pipeline.text_encoder, getattr(pipeline, "text_encoder_2", None)]
        self.text_encoders = [each for each in encoders if each is not None]
        for part in (pipeline.vae, *self.text_encoders):
            part.requires_grad_(False)
        if getattr(pipeline.vae.config, "force_upcast", False):
            pipeline.vae.float()  # SDXL's overflows in half precision

    @property
    def scheduler(self) -> Any:
        """The forward process."""
        from diffusers import DDPMScheduler

        return DDPMScheduler.from_config(self.pipeline.scheduler.config)

    @torch.no_grad()
    def latents(self, images: NDArray[np.float32]) -> Tensor:
        """Latents of (image, 3, 64, 64) channels in −1 … 1; blown up pixel by pixel, so that edges stay edges."""
        vae = self.pipeline.vae
        x = torch.nn.functional.interpolate(torch.from_numpy(images), size=(self.edge, self.edge), mode="nearest")
        latents: Tensor = vae.encode(x.to(self.device, vae.dtype)).latent_dist.mode() * vae.config.scaling_factor
        return latents.float()

    def words(self, texts: Sequence[str], views: Sequence[ViewFacts]) -> dict[str, Any]:
        """What the U-Net takes beside noisy latents and time steps; views can't be told to it."""
        common = {"device": self.device, "num_images_per_prompt": 1, "do_classifier_free_guidance": False}
        if not self.is_xl:
            states, _ = self.pipeline.encode_prompt(list(texts), **common)
            return {"encoder_hidden_states": states}
        states, _, pooled, _ = self.pipeline.encode_prompt(list(texts), **common)
        size = torch.tensor([[self.edge, self.edge, 0, 0, self.edge, self.edge]], device=self.device)
        sizes = size.repeat(len(texts), 1).to(pooled)
        return {
            "encoder_hidden_states": states,
            "added_cond_kwargs": {"text_embeds": pooled, "time_ids": sizes},
        }


def open_base(model: str | Path | None, device: str, edge: int | None = None) -> Base:
    """The base of that name: None or a file or folder of ours, else a Stable Diffusion pipeline."""
    if model is None or is_embedded(Path(model)):
        return EmbeddedBase(model, device)
    return StableDiffusionBase(str(model), device, edge)


def target_of(scheduler: Any, clean: Tensor, noise: Tensor, steps: Tensor) -> Tensor:
    """What the network should guess.

    Raises:
        ValueError: the base predicts something else than noise or velocity.
    """
    kind = scheduler.config.prediction_type
    if kind == "epsilon":
        return noise
    if kind == "v_prediction":
        velocity: Tensor = scheduler.get_velocity(clean, noise, steps)
        return velocity
    raise ValueError(f"base: prediction type {kind!r}; 'epsilon' and 'v_prediction' can be trained")
