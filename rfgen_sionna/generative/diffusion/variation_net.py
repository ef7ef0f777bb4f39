"""Network of the motion model: a one-dimensional convolutional U-Net over pairs of rows (10 Hz), for any length."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import cast

import torch
from torch import Tensor, nn

from rfgen_sionna.generative.diffusion.pose_rows import NUM_COLUMNS, NUM_CONTEXT

PAIR = 2
"""Rows in one position of the network."""
_WAVES = 32


@dataclass(frozen=True)
class NetworkShape:
    """Sizes of the network."""

    channels: tuple[int, ...] = (96, 128, 160)
    kernel: int = 5
    width: int = 160
    """Numbers of the state of noise level and words."""

    @property
    def block(self) -> int:
        """Lengths in rows are multiples of this number."""
        return PAIR * int(2 ** (len(self.channels) - 1))


class VariationNet(nn.Module):
    """U-Net from noisy rows to v = √a noise − √(1 − a) rows (Salimans and Ho 2022).

    Args:
        shape: sizes.
        words: size of the vocabulary.
    """

    def __init__(self, shape: NetworkShape, words: int) -> None:
        super().__init__()
        self.shape = shape
        c = shape.channels
        self.words = nn.EmbeddingBag(words + 1, shape.width, mode="mean", padding_idx=0)
        self.level = nn.Sequential(nn.Linear(2 * _WAVES, shape.width), nn.SiLU(), nn.Linear(shape.width, shape.width))
        self.enter = nn.Conv1d(PAIR * (NUM_COLUMNS + NUM_CONTEXT), c[0], 3, padding=1)
        self.down, self.up = nn.ModuleList(), nn.ModuleList()
        for i, width in enumerate(c):
            blocks = [_Block(width, width, shape) for _ in range(2)]
            shrink = nn.Conv1d(width, c[i + 1], 4, 2, 1) if i + 1 < len(c) else nn.Identity()
            self.down.append(nn.ModuleList([*blocks, shrink]))
        for i in reversed(range(len(c))):
            blocks = [_Block(2 * c[i], c[i], shape), _Block(c[i], c[i], shape)]
            grow = nn.ConvTranspose1d(c[i], c[i - 1], 4, 2, 1) if i else nn.Identity()
            self.up.append(nn.ModuleList([*blocks, grow]))
        self.leave = nn.Sequential(nn.GroupNorm(8, c[0]), nn.SiLU(), nn.Conv1d(c[0], PAIR * NUM_COLUMNS, 3, padding=1))

    def forward(self, noisy: Tensor, context: Tensor, level: Tensor, words: Tensor) -> Tensor:
        """(batch, row, column) estimate of v.

        Args:
            noisy: (batch, row, column), normalised; the number of rows is a multiple of `shape.block`.
            context: (batch, row, NUM_CONTEXT), normalised.
            level: (batch,) of the noise, 0 to 1.
            words: (batch, word) indices of the vocabulary from 1; 0 is padding.
        """
        b, n, _ = noisy.shape
        x = torch.cat([noisy, context], dim=-1).reshape(b, n // PAIR, -1).transpose(1, 2)
        state = nn.functional.silu(self.level(_waves(level)) + self.words(words))
        x = self.enter(x)
        kept = []
        for stage in self.down:
            first, second, shrink = cast(nn.ModuleList, stage)
            x = second(first(x, state), state)
            kept.append(x)
            x = shrink(x)
        for stage in self.up:
            first, second, grow = cast(nn.ModuleList, stage)
            x = grow(second(first(torch.cat([x, kept.pop()], dim=1), state), state))
        return self.leave(x).transpose(1, 2).reshape(b, n, -1)


class _Block(nn.Module):
    """Two convolutions with feature-wise scale and shift from the state between."""

    def __init__(self, inputs: int, outputs: int, shape: NetworkShape) -> None:
        super().__init__()
        pad = shape.kernel // 2
        self.first = nn.Sequential(
            nn.GroupNorm(8, inputs), nn.SiLU(), nn.Conv1d(inputs, outputs, shape.kernel, padding=pad)
        )
        self.film = nn.Linear(shape.width, 2 * outputs)
        self.norm = nn.GroupNorm(8, outputs)
        self.second = nn.Conv1d(outputs, outputs, shape.kernel, padding=pad)
        nn.init.zeros_(self.second.weight)
        self.pass_by = nn.Conv1d(inputs, outputs, 1) if inputs != outputs else nn.Identity()

    def forward(self, x: Tensor, state: Tensor) -> Tensor:
        scale, shift = self.film(state)[..., None].chunk(2, dim=1)
        h = self.norm(self.first(x)) * (1.0 + scale) + shift
        return self.pass_by(x) + self.second(nn.functional.silu(h))


def _waves(level: Tensor) -> Tensor:
    """(batch, 2 _WAVES) sinusoids of the noise level."""
    f = math.pi * torch.arange(1, _WAVES + 1, device=level.device, dtype=torch.float32)
    angle = level[:, None].float() * f
    return torch.cat([angle.cos(), angle.sin()], dim=-1)


def stems(text: str) -> list[str]:
    """Lower-case words of a text without common endings."""
    return [_stem(word) for word in re.findall(r"[a-z]+", text.lower())]


def _stem(word: str) -> str:
    for ending in ("ing", "ies", "ed", "es", "s"):
        if word.endswith(ending) and len(word) - len(ending) >= 3:
            word = word[: -len(ending)]
            break
    if len(word) > 3 and word[-1] == word[-2]:
        word = word[:-1]
    return word.rstrip("e")


def word_indices(texts: Sequence[str], vocabulary: Sequence[str]) -> Tensor:
    """(text, word) indices for :class:`VariationNet`; words outside the vocabulary are left out."""
    places = {word: k + 1 for k, word in enumerate(vocabulary)}
    rows = [[places[word] for word in stems(text) if word in places] for text in texts]
    longest = max(1, *map(len, rows))
    return torch.tensor([row + [0] * (longest - len(row)) for row in rows])
