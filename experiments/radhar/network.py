"""A small temporal network on counts of moving points, after RadHAR's own on voxels.

RadHAR's authors count points in 10 x 32 x 32 voxels over 60 frames for a time-distributed CNN and a bidirectional LSTM.
Here each frame has the projections of its moving points instead: range about the window's median and height, each for
approaching and receding points, distance to the side, and Doppler. Three convolutions over time follow.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import nn

from experiments.radhar.features import WINDOW_FRAMES
from experiments.radhar.recordings import CloudRecording

RANGE_EDGES = np.arange(-0.6, 0.61, 0.1)
"""Edges of range about the median [m]."""
HEIGHT_EDGES = np.arange(-1.0, 1.01, 0.2)
"""Edges of height over the radar [m]."""
SIDE_EDGES = np.array([0.0, 0.1, 0.2, 0.35, 0.5, 0.7, 1.0])
"""Edges of the distance to the side from the median [m]."""
DOPPLER_EDGES = np.array([-8, -2, -1, 0, 1, 2, 3, 8]) - 0.5
"""Edges of Doppler bins; bin 0 holds no moving point."""
CHANNELS = 2 * (len(RANGE_EDGES) + len(HEIGHT_EDGES) - 2) + len(SIDE_EDGES) + len(DOPPLER_EDGES) - 2
"""Counts of each frame."""
STEPS, BATCH = 400, 32
"""Steps of each training, windows of a step."""
MEMBERS = 2
"""Networks that vote, of different seeds."""


def window_counts(recording: CloudRecording, step: int = 27) -> NDArray[np.float32]:
    """(window, 54, channel) numbers of moving points of all whole windows, `step` frames apart."""
    starts = range(0, recording.frames - WINDOW_FRAMES + 1, step)
    return np.array([_counts(recording, start) for start in starts], np.float32).reshape(-1, WINDOW_FRAMES, CHANNELS)


def _counts(recording: CloudRecording, start: int) -> NDArray[np.float32]:
    chosen = recording.moving & (recording.frame >= start) & (recording.frame < start + WINDOW_FRAMES)
    frame, doppler = recording.frame[chosen] - start, recording.doppler[chosen]
    side, height = recording.position[chosen, 1], recording.position[chosen, 2]
    distance = recording.distance[chosen]
    near = distance - (np.median(distance) if len(distance) else 0.0)
    aside = np.abs(side - (np.median(side) if len(side) else 0.0))
    away = doppler > 0
    parts = [
        _histogram(frame[mask], values[mask], edges)
        for values, edges in ((near, RANGE_EDGES), (height, HEIGHT_EDGES))
        for mask in (away, ~away)
    ]
    parts += [_histogram(frame, aside, SIDE_EDGES), _histogram(frame, doppler, DOPPLER_EDGES)]
    return np.concatenate(parts, axis=1)


def _histogram(frame: NDArray[np.int64], values: NDArray[Any], edges: NDArray[np.float64]) -> NDArray[np.float32]:
    frames = np.arange(WINDOW_FRAMES + 1) - 0.5
    return np.histogram2d(frame, np.clip(values, edges[0], edges[-1]), (frames, edges))[0].astype(np.float32)


class CountsNetwork(nn.Module):
    """Counts (window, frame, channel) to scores (window, class)."""

    def __init__(self, classes: int, width: int = 32) -> None:
        super().__init__()
        self.course = nn.Sequential(
            nn.Conv1d(CHANNELS, width, 5, stride=2, padding=2), nn.ReLU(), nn.Dropout(0.3),
            nn.Conv1d(width, width, 5, padding=4, dilation=2), nn.ReLU(), nn.Dropout(0.3),
            nn.Conv1d(width, width, 5, padding=6, dilation=3), nn.ReLU(), nn.Dropout(0.3),
        )  # fmt: skip
        self.scores = nn.Linear(2 * width, classes)

    def forward(self, counts: torch.Tensor) -> torch.Tensor:
        course = self.course(torch.log1p(counts).transpose(1, 2))
        result: torch.Tensor = self.scores(torch.cat([course.mean(dim=2), course.amax(dim=2)], dim=1))
        return result


class NetworkVote:
    """Networks of several seeds, whose probabilities are averaged."""

    def __init__(self, classes: Sequence[str], seed: int) -> None:
        self.classes, self.seed = list(classes), seed
        with torch.random.fork_rng():
            torch.manual_seed(seed)
            self.members = [CountsNetwork(len(self.classes)) for _ in range(MEMBERS)]

    def train(self, counts: NDArray[np.float32], activity: NDArray[np.str_], steps: int = STEPS) -> NetworkVote:
        """Train all members, on from where they are; classes are drawn alike. Counts are left out at random."""
        labels, inputs = torch.tensor([self.classes.index(name) for name in activity]), torch.from_numpy(counts)
        share = torch.bincount(labels, minlength=len(self.classes)).double()[labels]
        for number, member in enumerate(self.members):
            generator = torch.Generator().manual_seed(100 * self.seed + number)
            with torch.random.fork_rng():
                torch.manual_seed(100 * self.seed + number)
                optimizer = torch.optim.AdamW(member.parameters(), 2e-3, weight_decay=1e-2)
                member.train()
                for _ in range(steps):
                    batch = torch.multinomial(1.0 / share, BATCH, replacement=True, generator=generator)
                    kept = 0.5 + 0.5 * torch.rand((BATCH, 1, 1), generator=generator)
                    some = inputs[batch] * (torch.rand(inputs[batch].shape, generator=generator) < kept)
                    optimizer.zero_grad()
                    nn.functional.cross_entropy(member(some), labels[batch]).backward()
                    optimizer.step()
        return self

    def predict(self, counts: NDArray[np.float32]) -> NDArray[np.str_]:
        """(window,) names of the activities."""
        inputs = torch.from_numpy(counts)
        with torch.no_grad():
            votes = torch.stack([member.eval()(inputs).softmax(dim=1) for member in self.members]).mean(dim=0)
        return np.array(self.classes)[votes.argmax(dim=1).numpy()]
