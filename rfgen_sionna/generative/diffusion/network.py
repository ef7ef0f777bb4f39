"""Denoising network: a one-dimensional convolutional U-Net over pairs of poses (10 Hz), and correction of its residual.

A small network predicts the conditional mean and misses small variation (slant of a held arm, sway). For each action
and noise level, its errors on training motion are regressed on the difference between noisy motion and guess, along the
errors' principal directions and frequency by frequency, as in a Wiener filter. Sampling adds the regressed error to
each guess.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import cast

import numpy as np
import torch
from scipy.fft import dct
from torch import Tensor, nn
from torch.nn.functional import scaled_dot_product_attention

from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.diffusion.features import NUM_FEATURES, PARTS
from rfgen_sionna.generative.diffusion.sentence_encoder import WIDTH

PAIR = 2
"""Poses in one position of the network."""
STRIDE = 4
"""Lengths in positions are multiples of this number."""
SOURCES = ("kinematic", "mocap", "any")
BANDS = 48
"""Frequencies from 0 to half the frame rate."""


@dataclass(frozen=True)
class NetworkShape:
    """Sizes of the network."""

    channels: tuple[int, ...] = (160, 224, 288)
    kernel: int = 5
    heads: int = 4
    features: int = NUM_FEATURES
    parts: int = len(PARTS)


@dataclass(frozen=True)
class Conditions:
    """Conditions of a batch of motions."""

    tokens: Tensor
    """(batch, word, WIDTH) token states of the prompt; zeros without one."""
    mask: Tensor
    """(batch, word) whether there is a word."""
    pooled: Tensor
    """(batch, WIDTH) pooled state of the prompt; zeros without one."""
    unwanted: Tensor
    """(batch, WIDTH) pooled state of the negative prompt; zeros without one."""
    source: Tensor
    """(batch,) index into `SOURCES`."""
    beat: Tensor
    """(batch, frame, 3) cosine, sine and 1; zeros without a beat."""
    known: Tensor
    """(batch, frame, features) given normalised features; zeros elsewhere."""
    given: Tensor
    """(batch, frame, part) 1 for given parts of the body."""


class DenoisingNet(nn.Module):
    """U-Net from noisy to clean motion."""

    def __init__(self, shape: NetworkShape | None = None) -> None:
        super().__init__()
        self.shape = shape = shape or NetworkShape()
        c = shape.channels
        wide = 4 * c[0] // 2
        inputs = PAIR * (2 * shape.features + shape.parts + 3)
        self.time = nn.Sequential(nn.Linear(128, wide), nn.SiLU(), nn.Linear(wide, wide))
        self.prompt = nn.Linear(WIDTH, wide)
        self.unwanted = nn.Linear(WIDTH, wide, bias=False)
        self.source = nn.Embedding(len(SOURCES), wide)
        self.enter = nn.Conv1d(inputs, c[0], 3, padding=1)
        self.down = nn.ModuleList()
        self.up = nn.ModuleList()
        for i, width in enumerate(c):
            blocks = [_Block(width, width, wide, shape.kernel) for _ in range(2)]
            shrink = nn.Conv1d(width, c[i + 1], 4, 2, 1) if i + 1 < len(c) else nn.Identity()
            self.down.append(nn.ModuleList([*blocks, shrink]))
        self.middle = nn.ModuleList([_Attention(c[-1], shape.heads, WIDTH), _Block(c[-1], c[-1], wide, shape.kernel)])
        for i in reversed(range(len(c))):
            blocks = [_Block(2 * c[i], c[i], wide, shape.kernel), _Block(c[i], c[i], wide, shape.kernel)]
            grow = nn.ConvTranspose1d(c[i], c[i - 1], 4, 2, 1) if i else nn.Identity()
            self.up.append(nn.ModuleList([*blocks, grow]))
        self.leave = nn.Sequential(
            nn.GroupNorm(8, c[0]), nn.SiLU(), nn.Conv1d(c[0], PAIR * shape.features, 3, padding=1)
        )

    def forward(self, noisy: Tensor, log_snr: Tensor, given: Conditions) -> Tensor:
        """(batch, frame, features) clean motion.

        Args:
            noisy: (batch, frame, features), normalised; the number of frames is a multiple of `PAIR * STRIDE`.
            log_snr: (batch,) ln of signal over noise power.
            given: the conditions.
        """
        b, n, _ = noisy.shape
        x = torch.cat([noisy, given.known, given.given, given.beat], dim=-1)
        x = x.reshape(b, n // PAIR, -1).transpose(1, 2)
        film = self.time(_waves(log_snr)) + self.prompt(given.pooled) + self.unwanted(given.unwanted)
        film = nn.functional.silu(film + self.source(given.source))
        x = self.enter(x)
        kept = []
        for level in self.down:
            first, second, shrink = cast(nn.ModuleList, level)
            x = second(first(x, film), film)
            kept.append(x)
            x = shrink(x)
        attention, block = self.middle
        x = block(attention(x, given.tokens, given.mask), film)
        for level in self.up:
            first, second, grow = cast(nn.ModuleList, level)
            x = second(first(torch.cat([x, kept.pop()], dim=1), film), film)
            x = grow(x)
        return self.leave(x).transpose(1, 2).reshape(b, n, -1)


class _Block(nn.Module):
    """Two convolutions with feature-wise scale and shift from the conditions between."""

    def __init__(self, inputs: int, outputs: int, film: int, kernel: int) -> None:
        super().__init__()
        self.first = nn.Sequential(
            nn.GroupNorm(8, inputs), nn.SiLU(), nn.Conv1d(inputs, outputs, kernel, padding=kernel // 2)
        )
        self.film = nn.Linear(film, 2 * outputs)
        self.norm = nn.GroupNorm(8, outputs)
        self.second = nn.Conv1d(outputs, outputs, kernel, padding=kernel // 2)
        nn.init.zeros_(self.second.weight)
        self.pass_by = nn.Conv1d(inputs, outputs, 1) if inputs != outputs else nn.Identity()

    def forward(self, x: Tensor, film: Tensor) -> Tensor:
        scale, shift = self.film(film)[..., None].chunk(2, dim=1)
        h = self.norm(self.first(x)) * (1.0 + scale) + shift
        return self.pass_by(x) + self.second(nn.functional.silu(h))


class _Attention(nn.Module):
    """Self-attention of the motion, then cross-attention to the words."""

    def __init__(self, width: int, heads: int, context: int) -> None:
        super().__init__()
        self.heads = heads
        self.norm = nn.ModuleList([nn.GroupNorm(8, width), nn.GroupNorm(8, width)])
        self.query = nn.ModuleList([nn.Linear(width, width), nn.Linear(width, width)])
        self.key_value = nn.ModuleList([nn.Linear(width, 2 * width), nn.Linear(context, 2 * width)])
        out = [nn.Linear(width, width), nn.Linear(width, width)]
        for layer in out:
            nn.init.zeros_(layer.weight)
        self.out = nn.ModuleList(out)

    def forward(self, x: Tensor, tokens: Tensor, mask: Tensor) -> Tensor:
        for i, (context, seen) in enumerate(((None, None), (tokens, mask))):
            h = self.norm[i](x).transpose(1, 2)
            q = self._split(self.query[i](h))
            k, v = self.key_value[i](h if context is None else context).chunk(2, dim=-1)
            bias = None if seen is None else seen[:, None, None, :]
            y = scaled_dot_product_attention(q, self._split(k), self._split(v), attn_mask=bias)
            x = x + self.out[i](y.transpose(1, 2).flatten(2)).transpose(1, 2)
        return x

    def _split(self, x: Tensor) -> Tensor:
        return x.unflatten(-1, (self.heads, -1)).transpose(1, 2)


def _waves(log_snr: Tensor) -> Tensor:
    """(batch, 128) sinusoids of the noise level."""
    f = torch.exp(torch.linspace(math.log(0.03), math.log(3.0), 64, device=log_snr.device))
    angle = log_snr[:, None].float() * f
    return torch.cat([angle.cos(), angle.sin()], dim=-1)


@dataclass(frozen=True)
class Residual:
    """Regression of one action's error."""

    directions: FloatArray
    """(direction, NUM_FEATURES) orthonormal rows, of normalised features."""
    levels: FloatArray
    """(level,) ln of signal over noise power, ascending."""
    gains: FloatArray
    """(level, BANDS, direction) error over difference."""


class Corrector:
    """Correction of a batch's guesses.

    Args:
        residuals: one for each motion of the batch; None leaves its guess unchanged.
        frames: of the motions.
    """

    def __init__(self, residuals: Sequence[Residual | None], frames: int) -> None:
        known = [r for r in residuals if r is not None]
        self.which = [k for k, r in enumerate(residuals) if r is not None]
        self.cosines = torch.from_numpy(dct(np.eye(frames), type=2, norm="ortho", axis=0)).float()
        if known:
            places, at = np.linspace(0.0, 1.0, frames), np.linspace(0.0, 1.0, BANDS)
            self.levels = known[0].levels
            self.directions = torch.from_numpy(np.stack([r.directions for r in known])).float()
            wide = [[[np.interp(places, at, c) for c in gain.T] for gain in r.gains] for r in known]
            self.gains = torch.from_numpy(np.array(wide)).float().transpose(2, 3)

    def __call__(self, guess: Tensor, noisy: Tensor, share: float) -> Tensor:
        """(motion, frame, feature) corrected guess; `share` is the signal's share of the noisy motion's power."""
        if not self.which:
            return guess
        level = np.log(share / (1.0 - share))
        place = float(np.interp(level, self.levels, np.arange(len(self.levels))))
        low = min(int(place), len(self.levels) - 2)
        gain = torch.lerp(self.gains[:, low], self.gains[:, low + 1], place - low)
        seen = (noisy[self.which] - share**0.5 * guess[self.which]) @ self.directions.transpose(1, 2)
        error = self.cosines.T @ (gain * (self.cosines @ seen))
        out = guess.clone()
        out[self.which] += error @ self.directions
        return out
