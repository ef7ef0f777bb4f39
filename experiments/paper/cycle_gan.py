"""A small CycleGAN: range-Doppler maps of one domain translated to another, learned from unpaired maps.

Generators with residual blocks, discriminators of patches, least-squares losses, a cycle and an identity loss, as in
J.-Y. Zhu et al., ICCV 2017, with fewer channels for maps of 64 x 32 cells.
"""

from __future__ import annotations

import itertools

import numpy as np
import torch
from torch import Tensor, nn

from experiments.paper.activity_sets import Sequences
from experiments.paper.reports import progress

CYCLE, IDENTITY = 10.0, 5.0
"""Weights of the losses."""
BATCH = 4
"""Maps of each domain in a step."""


class _Residual(nn.Module):
    def __init__(self, channels: int) -> None:
        super().__init__()
        self.layers = nn.Sequential(
            nn.Conv2d(channels, channels, 3, padding=1, padding_mode="reflect"), nn.InstanceNorm2d(channels), nn.ReLU(),
            nn.Conv2d(channels, channels, 3, padding=1, padding_mode="reflect"), nn.InstanceNorm2d(channels),
        )  # fmt: skip

    def forward(self, maps: Tensor) -> Tensor:
        found: Tensor = maps + self.layers(maps)
        return found


def _generator(channels: int = 16, blocks: int = 2) -> nn.Module:
    wide = 2 * channels
    return nn.Sequential(
        nn.Conv2d(1, channels, 5, padding=2, padding_mode="reflect"), nn.InstanceNorm2d(channels), nn.ReLU(),
        nn.Conv2d(channels, wide, 3, stride=2, padding=1), nn.InstanceNorm2d(wide), nn.ReLU(),
        *(_Residual(wide) for _ in range(blocks)),
        nn.Upsample(scale_factor=2), nn.Conv2d(wide, channels, 3, padding=1), nn.InstanceNorm2d(channels), nn.ReLU(),
        nn.Conv2d(channels, 1, 5, padding=2, padding_mode="reflect"), nn.Sigmoid(),
    )  # fmt: skip


def _discriminator(channels: int = 16) -> nn.Module:
    return nn.Sequential(
        nn.Conv2d(1, channels, 4, stride=2, padding=1), nn.LeakyReLU(0.2),
        nn.Conv2d(channels, 2 * channels, 4, stride=2, padding=1), nn.InstanceNorm2d(2 * channels), nn.LeakyReLU(0.2),
        nn.Conv2d(2 * channels, 1, 3, padding=1),
    )  # fmt: skip


def _closeness(scores: Tensor, truth: float) -> Tensor:
    return nn.functional.mse_loss(scores, torch.full_like(scores, truth))


class MapTranslator:
    """Translates single maps of the first domain to the second.

    Parameters
    ----------
    first, second
        Sequences (recording, frame, range, velocity) of either domain, 0 … 1, in no relation to each other.
    steps
        Steps of training.
    seed
        Seed of weights and draws.
    """

    def __init__(self, first: Sequences, second: Sequences, steps: int, seed: int) -> None:
        if steps < 1:
            raise ValueError(f"steps is {steps}: at least 1 is needed")
        rng = np.random.default_rng([seed, 2])
        domains = [each.reshape(-1, 1, *each.shape[-2:]) for each in (first, second)]
        with torch.random.fork_rng(devices=[]):
            torch.manual_seed(seed)
            self._there, self._back = _generator(), _generator()
            self._critics = [_discriminator(), _discriminator()]
            makers = itertools.chain(self._there.parameters(), self._back.parameters())
            critics = itertools.chain(*(each.parameters() for each in self._critics))
            optimizers = [torch.optim.Adam(each, 4e-4, betas=(0.5, 0.999)) for each in (makers, critics)]
            for step in range(steps):
                real = [torch.from_numpy(each[rng.integers(len(each), size=BATCH)]) for each in domains]
                loss = self._step(real[0], real[1], *optimizers)
                if (step + 1) % 250 == 0:
                    progress(f"CycleGAN: step {step + 1} of {steps}, loss of the generators {loss:.3f}")

    def _step(self, a: Tensor, b: Tensor, makers: torch.optim.Optimizer, critics: torch.optim.Optimizer) -> float:
        as_b, as_a = self._there(a), self._back(b)
        loss = _closeness(self._critics[1](as_b), 1.0) + _closeness(self._critics[0](as_a), 1.0)
        for found, true in ((self._back(as_b), a), (self._there(as_a), b)):
            loss = loss + CYCLE * nn.functional.l1_loss(found, true)
        for found, true in ((self._there(b), b), (self._back(a), a)):
            loss = loss + IDENTITY * nn.functional.l1_loss(found, true)
        makers.zero_grad()
        loss.backward()
        makers.step()
        critics.zero_grad()
        for critic, true, made in zip(self._critics, (a, b), (as_a, as_b), strict=True):
            (0.5 * (_closeness(critic(true), 1.0) + _closeness(critic(made.detach()), 0.0))).backward()
        critics.step()
        return float(loss.detach())

    def __call__(self, maps: Sequences) -> Sequences:
        """Sequences of the first domain, each map as one of the second."""
        flat = torch.from_numpy(maps.reshape(-1, 1, *maps.shape[-2:]))
        with torch.no_grad():
            found = torch.cat([self._there(part) for part in flat.split(64)])
        return found.numpy().reshape(maps.shape).astype(np.float32)
