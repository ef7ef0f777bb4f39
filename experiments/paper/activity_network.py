"""A small convolutional network that names the activity of a range-Doppler sequence."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from experiments.paper.activity_sets import ActivitySet, Sequences

BATCH = 16
"""Sequences of a step of training."""
_SHIFT = 4
"""Largest shift in range in training [cells]."""
_LEVEL = 0.05
"""Standard deviation of the change of level in training, of the scale of the maps."""


class ActivityNetwork(nn.Module):
    """Three convolutions over frame, range and velocity, the maximum over frames and range, and a linear layer."""

    def __init__(self, classes: int, channels: int = 16) -> None:
        super().__init__()
        widths = (1, channels, 2 * channels, 2 * channels)
        strides = ((2, 2, 2), (1, 2, 2), (1, 2, 1))
        layers: list[nn.Module] = []
        for index, (before, after) in enumerate(pairwise(widths)):
            layers += [
                nn.Conv3d(before, after, (3, 5, 3), stride=strides[index], padding=(1, 2, 1)),
                nn.BatchNorm3d(after),
                nn.ReLU(),
            ]
        self.features = nn.Sequential(*layers)
        self.last = nn.Sequential(nn.Dropout(0.3), nn.LazyLinear(classes))

    def forward(self, maps: Tensor) -> Tensor:
        """Scores (sequence, class) of maps (sequence, frame, range, velocity)."""
        found: Tensor = self.features(maps[:, None])
        scores: Tensor = self.last(found.amax(dim=3).mean(dim=2).flatten(1))
        return scores


def trained(training: ActivitySet, steps: int, seed: int) -> ActivityNetwork:
    """A network after `steps` steps of AdamW with a one-cycle rate; the seed decides weights and order."""
    rng = np.random.default_rng([seed, 1])
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        network = ActivityNetwork(len(training.classes))
        network(torch.from_numpy(training.maps[:2]))  # the first call sizes the last layer
        optimizer = torch.optim.AdamW(network.parameters(), 3e-3, weight_decay=1e-2)
        schedule = torch.optim.lr_scheduler.OneCycleLR(optimizer, 3e-3, total_steps=steps)
        network.train()
        for _ in range(steps):
            chosen = rng.choice(len(training), min(BATCH, len(training)), replace=False)
            optimizer.zero_grad()
            scores = network(torch.from_numpy(varied(training.maps[chosen], rng)))
            nn.functional.cross_entropy(scores, torch.from_numpy(training.activity[chosen])).backward()
            optimizer.step()
            schedule.step()
    return network.eval()


def varied(maps: Sequences, rng: np.random.Generator) -> Sequences:
    """The sequences at other ranges and levels."""
    shifted = np.stack([np.roll(each, int(rng.integers(-_SHIFT, _SHIFT + 1)), axis=1) for each in maps])
    level = rng.normal(0.0, _LEVEL, (len(maps), 1, 1, 1))
    return np.clip(shifted + level, 0.0, 1.0).astype(np.float32)


def predicted(network: ActivityNetwork, maps: Sequences) -> NDArray[np.int64]:
    """(recording,) numbers of the activities."""
    with torch.no_grad():
        scores = [network(torch.from_numpy(maps[start : start + 32])) for start in range(0, len(maps), 32)]
    return torch.cat(scores).argmax(dim=1).numpy().astype(np.int64)


def accuracies(
    training: ActivitySet, tests: dict[str, ActivitySet], steps: int, seeds: int, seed: int
) -> dict[str, Any]:
    """Share of right recordings of each test, for networks of several seeds: mean and standard deviation."""
    found: dict[str, list[float]] = {name: [] for name in tests}
    for number in range(seeds):
        network = trained(training, steps, seed + number)
        for name, test in tests.items():
            found[name].append(float(np.mean(predicted(network, test.maps) == test.activity)))
    return {name: {"mean": np.mean(each), "std": np.std(each), "each": each} for name, each in found.items()}
