"""What is known of an image before it is drawn: where each pixel looks, where a floor and walls would lie, a sketch.

diffusers' U-Net with two more inputs. It reads the view from the token of numbers (`text.view_tokens`), so that
diffusers' pipelines call it as any other: what follows from field of view, height and direction. Rooms stand square to
the axes: on each of their surfaces the range is a distance over one component of the direction, which this gives the
network for a few distances. A sketch (:mod:`.layout_map`) comes as `cross_attention_kwargs={"layout_map": …}`, which
diffusers' pipelines hand on.
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


def make_scheduler() -> DDIMScheduler:
    """The forward process and its sampler: v-prediction, scaled-linear betas, no signal at all in the last step."""
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
"""(step,) of the latents' energy that is left."""


def signal_and_noise(steps: Tensor) -> tuple[Tensor, Tensor]:
    """(image, 1, 1, 1) factors of latents and of noise at time steps (image,)."""
    share = _SHARES.to(steps.device)[steps.long()][:, None, None, None]
    return share.sqrt(), (1.0 - share).sqrt()


WALLS = (1.5, 4.0, 10.0)
"""Distances of walls [m] whose ranges are given, ahead and aside."""
CEILING = 2.7
"""Height [m] of a ceiling whose range is given."""
MAPS = 5 + 2 * len(WALLS)
"""Numbers of a pixel."""
KINDS = 128
"""Kinds of things in sketches that are told apart at most, nothing among them."""
_NUMBERS = 8
"""Of a view, in its token."""
_KIND_EMBEDDING = 16
"""Numbers that stand for a kind."""
_LAYOUT_CHANNELS = 128
"""Channels between a sketch and the network."""
_LEAST = 1e-3


def decode_view_tokens(token: Tensor) -> Tensor:
    """(view, 8) numbers that `text.view_tokens` wrote into (view, WIDTH): the inverse of its lowest frequency."""
    bands = token.float().reshape(len(token), _NUMBERS, -1)
    half = bands.shape[-1] // 2
    return torch.atan2(bands[..., 0], bands[..., half]) / (0.25 * math.pi)


def upright_view_tokens(tokens: Tensor) -> Tensor:
    """(view, 1, WIDTH) tokens of the same views without roll and in perspective: networks that saw no others take what
    lies where from the maps alone. Tokens of such views stay as they are."""
    bands = tokens.reshape(len(tokens), _NUMBERS, -1)
    level = torch.zeros_like(bands)
    half = bands.shape[-1] // 2
    phase = 0.5 * math.pi * 2.0 ** (torch.arange(half, device=tokens.device) - 1.0)
    level[:, :, half:] = 1.0
    level[:, 6, :half], level[:, 6, half:] = phase.sin(), phase.cos()
    other = torch.zeros(1, _NUMBERS, 1, dtype=torch.bool, device=tokens.device)
    other[:, 6:] = True
    lies = (decode_view_tokens(tokens[:, 0])[:, 6:] - torch.tensor([1.0, 0.0], device=tokens.device)).abs().amax(
        dim=1
    ) > 0.02
    return torch.where(other & lies[:, None, None], (level * math.sqrt(2.0)).to(bands), bands).reshape(tokens.shape)


def view_maps(token: Tensor, rows: int, columns: int, codec: PirCodec | None = None) -> Tensor:
    """(view, MAPS, row, column) of the views in (view, WIDTH) tokens.

    The direction's components in the world, and the channel of range (:class:`PirCodec`) of the floor, of a ceiling,
    and of walls square to x and y at `WALLS`.
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

    # Both of :class:`~rfgen_sionna.pir.projection.ImagePlane`.
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
    """A convolution whose output something is added to."""

    added: Tensor | None = None

    def forward(self, x: Tensor) -> Tensor:
        out = super().forward(x)
        return out if self.added is None else out + self.added.to(out)


class LayoutMapEncoder(nn.Module):
    """From a sketch (image, CHANNELS, row, column) to what a network's first features gain by it.

    Each patch's pixels are told as they are, kinds as the mean of what stands for them; and the latents that are
    expected, and how far they stray.
    """

    def __init__(self, width: int, latents: int) -> None:
        super().__init__()
        self.kind = nn.Embedding(KINDS, _KIND_EMBEDDING)
        told = (CHANNELS - 1) * PATCH**2 + _KIND_EMBEDDING + 1 + 2 * latents
        self.first = nn.Conv2d(told, _LAYOUT_CHANNELS, 3, padding=1)
        self.last = nn.Conv2d(_LAYOUT_CHANNELS, width, 3, padding=1)
        for parameter in self.last.parameters():  # no say before it has learnt one
            nn.init.zeros_(parameter)

    def forward(self, layout_map: Tensor, mean: Tensor, spread: Tensor, given: Tensor) -> Tensor:
        """(image, width, row / PATCH, column / PATCH); zero for images without a sketch."""
        traits = self.kind(layout_map[:, -1].long().clamp(0, KINDS - 1)).movedim(-1, 1)
        pixels = nn.functional.pixel_unshuffle(layout_map[:, :-1].to(self.last.weight), PATCH)
        traits = nn.functional.avg_pool2d(traits, PATCH)
        sky = nn.functional.avg_pool2d((layout_map[:, :1] >= 1.0).to(traits), PATCH)
        told = torch.cat([pixels, traits, sky, mean.to(pixels), spread.log().to(pixels)], dim=1)
        out: Tensor = self.last(nn.functional.silu(self.first(told)))
        return out * given


class ViewUNet(UNet2DConditionModel):
    """diffusers' U-Net, which sees a view's maps and a sketch beside its latents; the first token is the view."""

    conv_in: nn.Conv2d

    # Its signature is what diffusers writes into configurations.
    @functools.wraps(UNet2DConditionModel.__init__)  # type: ignore[misc]
    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        old = self.conv_in
        self.conv_in = _SummingConv(old.in_channels, old.out_channels, 3, padding=1)
        self.conv_in.load_state_dict(old.state_dict())
        self.view_in = nn.Conv2d(MAPS * PATCH**2, old.out_channels, 3, padding=1)
        for parameter in self.view_in.parameters():  # no say before it has learnt one
            nn.init.zeros_(parameter)
        self.sketch_in = LayoutMapEncoder(old.out_channels, old.in_channels)
        self.register_buffer("spread", torch.ones(old.in_channels))

    spread: Tensor
    """(latent,) standard deviations of latents, for images without a sketch."""

    def forward(
        self,
        sample: Tensor,
        timestep: Any,
        encoder_hidden_states: Tensor,
        *args: Any,
        cross_attention_kwargs: dict[str, Any] | None = None,
        **kwargs: Any,
    ) -> Any:
        """As the parent's; velocities come out.

        In `cross_attention_kwargs`, for all of a multiple of as many samples: `expected` and `spread` (image, latent,
        row, column), of :class:`~.conditional_prior.Expected`, and with them `layout_map` (image, CHANNELS, row,
        column); images of it that have none are drawn from words alone.
        """
        rest = dict(cross_attention_kwargs or {})
        layout_map, expected, about = (rest.pop(name, None) for name in ("sketch", "expected", "spread"))
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
        # As Karras et al. (2022): what a normal distribution about the mean would make of the noisy latents is known,
        # the network draws the rest, of unit variance whatever the noise.
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
