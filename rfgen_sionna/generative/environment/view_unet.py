"""Denoising U-Net with a view's geometry and a layout map as further inputs, and its forward process.

The view comes in the token of numbers (:func:`~.place_encoder.view_tokens`), so that diffusers' pipelines call the
network as any other. From it follow maps of direction and of the range of a floor, a ceiling and walls at a few
distances. A layout map (:mod:`.layout_map`) comes as `cross_attention_kwargs={"layout_map": …}`.
"""

from __future__ import annotations

import functools
import math
from typing import Any

import torch
from diffusers import DDIMScheduler, UNet2DConditionModel
from diffusers.models.unets.unet_2d_condition import UNet2DConditionOutput
from torch import Tensor, nn

from rfgen_sionna.generative.environment.layout_map import CHANNELS, NO_LAYOUT_MAP
from rfgen_sionna.generative.environment.reprojection import PATCH
from rfgen_sionna.pir.codec import PirCodec

WALLS = (1.5, 4.0, 10.0)
"""Distances of walls [m] in the maps, ahead and aside."""
CEILING = 2.7
"""Height [m] of the ceiling in the maps."""
MAPS = 5 + 2 * len(WALLS)
"""Channels of the maps."""
KINDS = 128
"""Largest number of kinds in layout maps, with the empty one."""
_NUMBERS = 8
"""Numbers of a view in its token."""
_KIND_EMBEDDING = 16
"""Numbers of a kind's embedding."""
_LAYOUT_CHANNELS = 128
"""Hidden channels of the layout map's encoder."""
_LEAST = 1e-3
"""Least component of a direction in a quotient."""


def make_scheduler() -> DDIMScheduler:
    """Scheduler of the forward process: v-prediction, scaled-linear betas, zero terminal SNR, trailing DDIM steps."""
    return DDIMScheduler(
        num_train_timesteps=1000,
        beta_start=0.00085,
        beta_end=0.012,
        beta_schedule="scaled_linear",
        prediction_type="v_prediction",
        rescale_betas_zero_snr=True,
        timestep_spacing="trailing",
        set_alpha_to_one=True,
        clip_sample=False,
        steps_offset=1,
    )


_SHARES: Tensor = make_scheduler().alphas_cumprod
"""(step,) share of the latents' energy."""


def signal_and_noise(steps: Tensor) -> tuple[Tensor, Tensor]:
    """(image, 1, 1, 1) factors of latents and of noise at time steps (image,)."""
    share = _SHARES.to(steps.device)[steps.long()][:, None, None, None]
    return share.sqrt(), (1.0 - share).sqrt()


def decode_view_tokens(token: Tensor) -> Tensor:
    """(view, 8) numbers of tokens (view, WIDTH): inverse of the lowest frequency of
    :func:`~.place_encoder.view_tokens`."""
    bands = token.float().reshape(len(token), _NUMBERS, -1)
    half = bands.shape[-1] // 2
    return torch.atan2(bands[..., 0], bands[..., half]) / (0.25 * math.pi)


def upright_view_tokens(tokens: Tensor) -> Tensor:
    """(view, 1, WIDTH) tokens without roll and in perspective, for networks trained on such views only; those of such
    views stay unchanged."""
    bands = tokens.reshape(len(tokens), _NUMBERS, -1)
    level = torch.zeros_like(bands)
    half = bands.shape[-1] // 2
    phase = 0.5 * math.pi * 2.0 ** (torch.arange(half, device=tokens.device) - 1.0)
    level[:, :, half:] = 1.0
    level[:, 6, :half], level[:, 6, half:] = phase.sin(), phase.cos()
    other = torch.zeros(1, _NUMBERS, 1, dtype=torch.bool, device=tokens.device)
    other[:, 6:] = True
    roll = decode_view_tokens(tokens[:, 0])[:, 6:] - torch.tensor([1.0, 0.0], device=tokens.device)
    lies = roll.abs().amax(dim=1) > 0.02
    return torch.where(other & lies[:, None, None], (level * math.sqrt(2.0)).to(bands), bands).reshape(tokens.shape)


def view_maps(token: Tensor, rows: int, columns: int, codec: PirCodec | None = None) -> Tensor:
    """(view, MAPS, row, column) maps of the views in (view, WIDTH) tokens.

    Components of the direction in the world, and the channel of range (:class:`PirCodec`) of a floor, of a ceiling, and
    of walls perpendicular to x and y at `WALLS`.
    """
    codec = codec or PirCodec()
    x = decode_view_tokens(token)
    fov = torch.deg2rad(60.0 * (x[:, :2] + 1.0)).clamp(0.05, 2.0 * math.pi)
    height, pitch = (x[:, 2] + 1.0).clamp(min=0.05), 0.5 * x[:, 3]
    yaw, roll = torch.atan2(x[:, 5], x[:, 4]), torch.atan2(x[:, 7], x[:, 6])
    flat = (x[:, 6:].norm(dim=1) > 0.75)[:, None, None, None]
    half = 0.5 * fov
    across = 1.0 - (2.0 * torch.arange(columns, device=x.device) + 1.0) / columns
    up = 1.0 - (2.0 * torch.arange(rows, device=x.device) + 1.0) / rows

    def spread(half: Tensor) -> tuple[Tensor, Tensor]:
        left = (half[:, :1] * across)[:, None, :].expand(-1, rows, -1)
        return left, (half[:, 1:] * up)[:, :, None].expand(-1, -1, columns)

    # as in :class:`~rfgen_sionna.pir.projection.ImagePlane`
    left, above = spread(torch.tan(half.clamp(max=1.5)))
    device = torch.stack([torch.ones_like(left), left, above], dim=-1)
    azimuth, elevation = spread(half)
    level = elevation.cos()
    around = torch.stack([level * azimuth.cos(), level * azimuth.sin(), elevation.sin()], dim=-1)
    device = torch.where(flat, device / device.norm(dim=-1, keepdim=True), around)
    world = torch.einsum("nij,nrcj->nrci", _rotation(yaw, pitch, roll), device)
    away = world.abs().clamp(min=_LEAST)

    def channel(distance: Tensor | float) -> Tensor:
        reach = torch.as_tensor(distance, device=x.device).clamp(max=codec.max_range)
        return 2.0 * torch.log1p(reach / codec.knee) / math.log1p(codec.max_range / codec.knee) - 1.0

    height = height[:, None, None]
    far = torch.full_like(left, codec.max_range)
    floor = torch.where(world[..., 2] < 0, height / away[..., 2], far)
    ceiling = torch.where(world[..., 2] > 0, (CEILING - height).clamp(min=0.2) / away[..., 2], far)
    maps = [*world.unbind(-1), channel(floor), channel(ceiling)]
    maps += [channel(distance / away[..., axis]) for axis in (0, 1) for distance in WALLS]
    return torch.stack(maps, dim=1)


def _rotation(yaw: Tensor, pitch: Tensor, roll: Tensor) -> Tensor:
    """(view, 3, 3) device to world, as :func:`~rfgen_sionna.radar.pose.rotation_matrix`."""
    one, zero = torch.ones_like(yaw), torch.zeros_like(yaw)

    def matrix(*values: Tensor) -> Tensor:
        return torch.stack(values, dim=-1).reshape(-1, 3, 3)

    c, s = torch.cos(yaw), torch.sin(yaw)
    about_z = matrix(c, -s, zero, s, c, zero, zero, zero, one)
    c, s = torch.cos(pitch), torch.sin(pitch)
    about_y = matrix(c, zero, s, zero, one, zero, -s, zero, c)
    c, s = torch.cos(roll), torch.sin(roll)
    about_x = matrix(one, zero, zero, zero, c, -s, zero, s, c)
    return about_z @ about_y @ about_x


class _SummingConv(nn.Conv2d):
    """Convolution with an added term."""

    added: Tensor | None = None

    def forward(self, x: Tensor) -> Tensor:
        out = super().forward(x)
        return out if self.added is None else out + self.added.to(out)


class LayoutMapEncoder(nn.Module):
    """Encoder of layout maps (image, CHANNELS, row, column) to an addition to the network's first features.

    Inputs: a patch's pixels, the mean embedding of its kinds, and mean and spread of the expected latents.
    """

    def __init__(self, width: int, latents: int) -> None:
        super().__init__()
        self.kind = nn.Embedding(KINDS, _KIND_EMBEDDING)
        inputs = (CHANNELS - 1) * PATCH**2 + _KIND_EMBEDDING + 1 + 2 * latents
        self.first = nn.Conv2d(inputs, _LAYOUT_CHANNELS, 3, padding=1)
        self.last = nn.Conv2d(_LAYOUT_CHANNELS, width, 3, padding=1)
        for parameter in self.last.parameters():  # no effect before training
            nn.init.zeros_(parameter)

    def forward(self, layout_map: Tensor, mean: Tensor, spread: Tensor, given: Tensor) -> Tensor:
        """(image, width, row / PATCH, column / PATCH); zero for images without a layout map."""
        traits = self.kind(layout_map[:, -1].long().clamp(0, KINDS - 1)).movedim(-1, 1)
        pixels = nn.functional.pixel_unshuffle(layout_map[:, :-1].to(self.last.weight), PATCH)
        traits = nn.functional.avg_pool2d(traits, PATCH)
        sky = nn.functional.avg_pool2d((layout_map[:, :1] >= 1.0).to(traits), PATCH)
        inputs = torch.cat([pixels, traits, sky, mean.to(pixels), spread.log().to(pixels)], dim=1)
        out: Tensor = self.last(nn.functional.silu(self.first(inputs)))
        return out * given


class ViewUNet(UNet2DConditionModel):
    """diffusers' U-Net with maps of the view and a layout map beside its latents; the first token is the view."""

    conv_in: nn.Conv2d

    # diffusers writes the signature into configurations
    @functools.wraps(UNet2DConditionModel.__init__)  # type: ignore[misc]
    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        old = self.conv_in
        self.conv_in = _SummingConv(old.in_channels, old.out_channels, 3, padding=1)
        self.conv_in.load_state_dict(old.state_dict())
        self.view_in = nn.Conv2d(MAPS * PATCH**2, old.out_channels, 3, padding=1)
        for parameter in self.view_in.parameters():  # no effect before training
            nn.init.zeros_(parameter)
        self.sketch_in = LayoutMapEncoder(old.out_channels, old.in_channels)
        self.register_buffer("spread", torch.ones(old.in_channels))

    spread: Tensor
    """(latent,) standard deviations of latents, for images without a layout map."""

    def forward(
        self,
        sample: Tensor,
        timestep: Any,
        encoder_hidden_states: Tensor,
        *args: Any,
        cross_attention_kwargs: dict[str, Any] | None = None,
        **kwargs: Any,
    ) -> Any:
        """As the parent's, with velocities as output.

        `cross_attention_kwargs` may hold `expected` and `spread` (image, latent, row, column) of a
        :class:`~.conditional_prior.LatentPrior`, and `layout_map` (image, CHANNELS, row, column); the samples are a
        multiple of the images. Images without a layout map are drawn from words alone.
        """
        rest = dict(cross_attention_kwargs or {})
        layout_map, expected, about = (rest.pop(name, None) for name in ("layout_map", "expected", "spread"))
        kwargs["cross_attention_kwargs"] = rest or None
        count, (rows, columns) = len(sample), sample.shape[-2:]
        noisy = sample.float()
        mean, spread = torch.zeros_like(noisy), self.spread.float()[:, None, None].expand(noisy.shape)
        with torch.no_grad():
            maps = view_maps(encoder_hidden_states[:, 0], PATCH * rows, PATCH * columns)
            patches = nn.functional.pixel_unshuffle(maps, PATCH).to(self.view_in.weight)
            words = torch.cat([upright_view_tokens(encoder_hidden_states[:, :1]), encoder_hidden_states[:, 1:]], dim=1)
        added = self.view_in(patches)
        here = torch.ones(1, 1, 1, 1, dtype=torch.bool, device=sample.device)
        if layout_map is not None:
            here = (layout_map[:, -1].amax(dim=(1, 2)) > NO_LAYOUT_MAP)[:, None, None, None].to(sample.device)
        if expected is not None:
            each = (count // len(expected), 1, 1, 1)
            own = torch.where(here, about.to(noisy), spread[: len(expected)])
            spread, mean = own.repeat(each), (expected.to(noisy) * here).repeat(each)
            if layout_map is not None:
                shown = self.sketch_in(layout_map.to(sample.device), mean[: len(layout_map)], own, here.to(added))
                added = added + shown.repeat(each)
        # Karras et al. (2022): the posterior mean of a normal prior is known, the network draws the rest
        steps = torch.as_tensor(timestep, device=sample.device).reshape(-1).expand(count)
        signal, noise = signal_and_noise(steps)
        total = signal**2 * spread**2 + noise**2
        off = noisy - signal * mean
        conv = getattr(self.conv_in, "base_layer", self.conv_in)
        conv.added = added
        try:
            drawn = super().forward((off / total.sqrt()).to(sample.dtype), timestep, words, *args, **kwargs)
        finally:
            conv.added = None
        rest_of_it = spread * noise / total.sqrt()
        is_tuple = isinstance(drawn, tuple)
        clean = mean + signal * spread**2 / total * off + rest_of_it * (drawn[0] if is_tuple else drawn.sample).float()
        velocity = ((signal * noisy - clean) / noise).to(sample.dtype)
        return (velocity,) if is_tuple else UNet2DConditionOutput(sample=velocity)
