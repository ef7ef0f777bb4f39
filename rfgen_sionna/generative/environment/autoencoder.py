"""Autoencoder of 4 × 4 pixel patches: a fixed linear map (principal component analysis) with diffusers' interface."""

from __future__ import annotations

from typing import Any

import torch
from diffusers import ConfigMixin, ModelMixin
from diffusers.configuration_utils import register_to_config
from diffusers.models.autoencoders.vae import DecoderOutput
from diffusers.models.modeling_outputs import AutoencoderKLOutput
from torch import Tensor

from rfgen_sionna.generative.environment.reprojection import PATCH


class ExactLatents:
    """Latents of an image, with the interface of diffusers' latent distribution and no spread."""

    def __init__(self, latents: Tensor) -> None:
        self.mean = latents

    def sample(self, generator: torch.Generator | None = None) -> Tensor:
        """The latents; the generator is ignored."""
        return self.mean

    def mode(self) -> Tensor:
        """The latents."""
        return self.mean


class PatchAutoencoder(ModelMixin, ConfigMixin):
    """Images (n, channels, 64, 64) to latents (n, latents, 16, 16) and back, always in single precision.

    Args:
        in_channels: channels of the images.
        latent_channels: components of each patch.
        block_out_channels: its length gives the patch, 2^(entries − 1) pixels, as in diffusers.
        scaling_factor: 1, since latents have unit mean square.
        sample_size: edge of the fitted images [pixels].

    Raises:
        ValueError: `block_out_channels` does not give patches of `PATCH` pixels.
    """

    @register_to_config
    def __init__(
        self,
        in_channels: int = 3,
        out_channels: int = 3,
        latent_channels: int = 32,
        block_out_channels: tuple[int, ...] = (1, 1, 1),
        scaling_factor: float = 1.0,
        sample_size: int = 64,
    ) -> None:
        super().__init__()
        if 2 ** (len(block_out_channels) - 1) != PATCH:
            raise ValueError(f"block_out_channels has {len(block_out_channels)} entries; patches of {PATCH} need 3")
        size = in_channels * PATCH**2
        self.register_buffer("mean", torch.zeros(size))
        self.register_buffer("components", torch.eye(size)[:, :latent_channels].contiguous())
        self.register_buffer("scale", torch.ones(latent_channels))
        # ModelMixin takes dtype and device from a parameter
        self.anchor = torch.nn.Parameter(torch.zeros(1), requires_grad=False)

    mean: Tensor
    """(channels · PATCH²,) mean patch."""
    components: Tensor
    """(channels · PATCH², latents) orthonormal columns."""
    scale: Tensor
    """(latents,) length of a unit latent along its component."""

    def encode(self, x: Tensor, return_dict: bool = True) -> Any:
        """Latents of images (n, channels, row, column); edges are multiples of `PATCH`."""
        patches = torch.nn.functional.pixel_unshuffle(x.to(self.mean), PATCH).movedim(1, -1)
        latents = ((patches - self.mean) @ self.components / self.scale).movedim(-1, 1)
        exact = ExactLatents(latents)
        return AutoencoderKLOutput(latent_dist=exact) if return_dict else (exact,)

    def decode(self, z: Tensor, return_dict: bool = True, generator: torch.Generator | None = None) -> Any:
        """Images of latents (n, latents, row, column)."""
        patches = (z.to(self.scale).movedim(1, -1) * self.scale) @ self.components.T + self.mean
        image = torch.nn.functional.pixel_shuffle(patches.movedim(-1, 1), PATCH)
        return DecoderOutput(sample=image) if return_dict else (image,)

    def forward(self, x: Tensor) -> Any:
        """Images after encoding and decoding."""
        return self.decode(self.encode(x).latent_dist.mode())
