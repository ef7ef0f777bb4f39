"""A small network from the cloud of a frame, and of those before it, to joints, and its training.

Points of a frame go through one perceptron, their maximum and mean through two causal convolutions over time (Qi et
al., "PointNet", CVPR 2017; Bai et al., "An Empirical Evaluation of Generic Convolutional and Recurrent Networks for
Sequence Modeling", 2018). The order of points doesn't matter.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn import functional

from experiments.mars.pose_frames import FEATURES, JOINTS, Augmentation, PoseFrames, chunks, every


@dataclass(frozen=True)
class TrainingPlan:
    """Course of a training: a fixed number of steps, no choice of a state by any test."""

    steps: int = 1500
    runs: int = 12
    """Runs of frames a step."""
    run_frames: int = 16
    kernel: int = 1
    """Frames of each of the two convolutions over time. With 1, frames before the last count by their mean alone, and
    runs are drawn from all of a movement."""
    learning_rate: float = 1e-2
    """Largest rate; it rises over the first tenth and falls as a cosine."""
    weight_decay: float = 1e-2
    augmentation: Augmentation = field(default_factory=Augmentation)


class PoseNetwork(nn.Module):
    """Points (run, frame, point, FEATURES) and their presence (run, frame, point) to joints (run, frame, JOINTS, 3).

    A frame's features go on with their mean over the run up to that frame, which shows a person's size and place.
    """

    def __init__(self, mean_pose: Tensor, kernel: int, width: int = 32) -> None:
        super().__init__()
        self.kernel = kernel
        self.mean_pose: Tensor
        self.register_buffer("mean_pose", mean_pose)
        self.point = nn.Sequential(nn.Linear(FEATURES, width), nn.ReLU(), nn.Linear(width, 2 * width), nn.ReLU())
        self.first = nn.Conv1d(8 * width, 3 * width, kernel)
        self.second = nn.Conv1d(3 * width, 3 * width, kernel)
        self.dropout = nn.Dropout(0.1)
        self.head = nn.Linear(3 * width, 3 * JOINTS)

    def forward(self, points: Tensor, present: Tensor) -> Tensor:
        centre = torch.cat([self.mean_pose.mean(0), self.mean_pose.new_zeros(1)])
        features = self.point(points[present] - centre)
        counts = present.sum(-1)
        # Features are not negative, so a frame without points has zeros
        largest, total = (
            torch.segment_reduce(features, kind, lengths=counts.flatten(), initial=0) for kind in ("max", "sum")
        )
        pooled = torch.cat([largest, total / counts.flatten()[:, None].clamp(min=1)], -1).unflatten(0, counts.shape)
        so_far = torch.arange(1, pooled.shape[1] + 1, dtype=pooled.dtype)
        context = pooled.cumsum(1) / so_far[:, None]
        course = self.dropout(torch.cat([pooled, context], -1).transpose(1, 2))
        for layer in (self.first, self.second):
            course = functional.relu(layer(functional.pad(course, (self.kernel - 1, 0))))
        change = self.head(self.dropout(course.transpose(1, 2)))
        return self.mean_pose + change.unflatten(-1, (JOINTS, 3))


def train_network(sources: Sequence[Sequence[PoseFrames]], seed: int, plan: TrainingPlan | None = None) -> PoseNetwork:
    """Network trained on sources of movements, each with the same share of every step.

    Raises
    ------
    ValueError
        If a source has no movement as long as a run.
    """
    plan = plan or TrainingPlan()
    for number, source in enumerate(sources):
        if all(len(movement) < plan.run_frames for movement in source):
            raise ValueError(f"source {number} has no movement of {plan.run_frames} frames")
    rng = np.random.default_rng(np.random.SeedSequence([54, seed]))
    joints = torch.stack([torch.cat([movement.joints for movement in source]).mean(0) for source in sources]).mean(0)
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        network = PoseNetwork(joints, plan.kernel)
        optimizer = torch.optim.AdamW(network.parameters(), plan.learning_rate, weight_decay=plan.weight_decay)
        schedule = torch.optim.lr_scheduler.OneCycleLR(optimizer, plan.learning_rate, plan.steps, pct_start=0.1)
        for _ in range(plan.steps):
            counts = [plan.runs // len(sources)] * len(sources)
            counts[0] += plan.runs - sum(counts)
            drawn = [
                chunks(source, count, plan.run_frames, rng, consecutive=plan.kernel > 1)
                for source, count in zip(sources, counts, strict=True)
            ]
            parts = [plan.augmentation(runs, rng) for runs in drawn]
            found = network(torch.cat([part.points for part in parts]), torch.cat([part.present for part in parts]))
            loss = (found - torch.cat([part.joints for part in parts])).norm(dim=-1).mean()
            optimizer.zero_grad()
            loss.backward()
            optimizer.step()
            schedule.step()
    return network.eval()


@torch.no_grad()
def estimate(network: PoseNetwork, movements: Sequence[PoseFrames], step: int = 1) -> list[Tensor]:
    """Joints (frame, JOINTS, 3) of each movement [m], each from frames `step` apart."""
    found = [torch.empty_like(movement.joints) for movement in movements]
    for joints, movement in zip(found, movements, strict=True):
        for first, part in enumerate(every([movement], step)):
            joints[first::step] = network(part.points[None], part.present[None])[0]
    return found
