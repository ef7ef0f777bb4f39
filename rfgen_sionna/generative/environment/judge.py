"""A judge of images of surroundings: names the place, and measures how far two sets lie apart.

It is trained on the training split's renders alone, and never on drawn images.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from torch.nn.functional import cross_entropy

from rfgen_sionna.records import FloatArray

FEATURES = 48


class _Net(nn.Module):
    def __init__(self, classes: int) -> None:
        super().__init__()
        layers: list[nn.Module] = []
        width = 3
        for wider in (32, 48, 64, 96):
            layers += [nn.Conv2d(width, wider, 3, stride=2, padding=1), nn.GroupNorm(8, wider), nn.GELU()]
            layers += [nn.Conv2d(wider, wider, 3, padding=1), nn.GroupNorm(8, wider), nn.GELU()]
            width = wider
        self.body = nn.Sequential(*layers)
        self.squeeze = nn.Sequential(nn.Dropout(0.2), nn.Linear(2 * width, FEATURES), nn.LayerNorm(FEATURES))
        self.classes = nn.Linear(FEATURES, classes)

    def forward(self, x: Tensor) -> tuple[Tensor, Tensor]:
        h = self.body(x)
        f = self.squeeze(torch.cat([h.mean(dim=(2, 3)), h.amax(dim=(2, 3))], dim=-1))
        return f, self.classes(f)


@dataclass(frozen=True)
class Judge:
    """A trained judge."""

    net: _Net

    def look(self, images: NDArray[np.floating]) -> tuple[FloatArray, NDArray[np.intp]]:
        """(image, FEATURES) features and (image,) places of (image, 3, row, column) channels in −1 … 1."""
        features, places = [], []
        with torch.no_grad():
            for start in range(0, len(images), 128):
                f, logits = self.net(torch.from_numpy(images[start : start + 128].astype(np.float32)))
                features.append(f.double().numpy())
                places.append(logits.argmax(dim=-1).numpy())
        return np.concatenate(features), np.concatenate(places)


def train_judge(
    images: NDArray[np.floating],
    places: NDArray[np.intp],
    *,
    seed: int = 0,
    steps: int = 1500,
    items: int = 48,
    progress: Callable[[int, int], None] | None = None,
) -> Judge:
    """A judge from (image, 3, row, column) channels and their places; places are drawn equally often."""
    torch.manual_seed(seed)
    rng = np.random.default_rng([seed, 61])
    net = _Net(int(places.max()) + 1)
    groups = [np.flatnonzero(places == k) for k in np.unique(places)]
    optimiser = torch.optim.AdamW(net.parameters(), lr=1e-3, weight_decay=0.05)
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimiser, 2e-3, total_steps=steps)
    for step in range(steps):
        index = [int(rng.choice(groups[int(rng.integers(len(groups)))])) for _ in range(items)]
        x = torch.from_numpy(images[index].astype(np.float32))
        flip = torch.from_numpy(rng.integers(2, size=items) > 0)[:, None, None, None]
        x = torch.where(flip, x.flip(-1), x)
        x = x + 0.01 * torch.randn(x.shape)
        _, logits = net(x)
        loss = cross_entropy(logits, torch.from_numpy(places[index]), label_smoothing=0.05)
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()
        schedule.step()
        if progress is not None:
            progress(step + 1, steps)
    return Judge(net.eval().requires_grad_(False))
