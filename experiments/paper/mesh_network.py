"""Bodies from sequences of point clouds: a PointNet over each frame's points, a recurrent network over the frames.

After H. Xue et al., "mmMesh", MobiSys 2021: points with position, velocity, energy and range; as output the rotations
of 22 joints, the root's place and the body's parameters. It is smaller, and has anny's bodies instead of SMPL's.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor, nn

from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.motion.skeleton import JOINT_NAMES, MEAN_ADULT, NUM_BODY_JOINTS, PARENTS

NUM_POINTS = 128
"""Points of a frame; mmMesh's number."""
MAX_TURN_DEG = 15.0
"""Largest turn of a training recording about the radar's vertical axis [degrees]."""
_MEAN = torch.tensor([2.5, 0.0, 0.0, 0.0, 0.0, 2.5])
_SCALE = torch.tensor([0.5, 0.5, 0.5, 1.0, 1.0, 0.5])
_MIRROR = torch.tensor([1.0, -1.0, 1.0])
_TWINS = torch.tensor([
    JOINT_NAMES.index(name.replace("left_", "?_").replace("right_", "left_").replace("?_", "right_"))
    for name in JOINT_NAMES[:NUM_BODY_JOINTS]
])  # fmt: skip


@dataclass(frozen=True)
class BodySet:
    """Recordings of people: points, and the bodies behind them."""

    points: Tensor
    """(recording, frame, point, 6) x, y, z from the radar in the world's axes [m], velocity [m/s], log10 of the
    magnitude about its mean in the recording, range [m]."""
    root: Tensor
    """(recording, frame, 3) pelvis, from the radar [m]."""
    rotations: Tensor
    """(recording, frame, 22, 3, 3) world rotations of the joints relative to the T-pose."""
    shape: Tensor
    """(recording, parameter) parameters of the body model."""

    def __len__(self) -> int:
        return len(self.points)

    def __add__(self, other: BodySet) -> BodySet:
        return BodySet(*(torch.cat([a, b]) for a, b in zip(self._parts, other._parts, strict=True)))

    def __getitem__(self, rows: Tensor) -> BodySet:
        return BodySet(*(each[rows] for each in self._parts))

    @property
    def _parts(self) -> tuple[Tensor, ...]:
        return self.points, self.root, self.rotations, self.shape


class MeshNet(nn.Module):
    """Points of each frame to features, features over time to bodies."""

    shape_mean: Tensor
    shape_std: Tensor

    def __init__(self, shape: Tensor) -> None:
        """`shape` (recording, parameter) are the bodies to learn from."""
        super().__init__()
        self.register_buffer("shape_mean", shape.mean(dim=0))
        self.register_buffer("shape_std", shape.std(dim=0).clamp_min(1e-3))
        self.point = nn.Sequential(
            nn.Linear(6, 64), nn.ReLU(), nn.Linear(64, 128), nn.ReLU(), nn.Linear(128, 192), nn.ReLU()
        )
        self.time = nn.GRU(384, 128, batch_first=True, bidirectional=True)
        outputs = 3 + 6 * NUM_BODY_JOINTS
        self.pose = nn.Sequential(nn.Dropout(0.2), nn.Linear(256, 256), nn.ReLU(), nn.Linear(256, outputs))
        self.body = nn.Sequential(nn.Dropout(0.5), nn.Linear(256, shape.shape[1]))

    def forward(self, points: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Root, rotations and shape, as of :class:`BodySet`, of points (recording, frame, point, 6)."""
        features = self.point((points - _MEAN) / _SCALE)
        states: Tensor = self.time(torch.cat([features.amax(dim=2), features.mean(dim=2)], dim=-1))[0]
        pose = self.pose(states)
        root = pose[..., :3] + _MEAN[:3]
        axes = pose[..., 3:].unflatten(-1, (NUM_BODY_JOINTS, 2, 3)) + torch.eye(3)[:2]
        return root, rotations_of(axes), self.shape_mean + self.shape_std * self.body(states.mean(dim=1))


def rotations_of(axes: Tensor) -> Tensor:
    """(..., 3, 3) rotations of two axes (..., 2, 3), by Gram and Schmidt (Zhou et al., CVPR 2019)."""
    first = nn.functional.normalize(axes[..., 0, :], dim=-1)
    second = axes[..., 1, :] - (first * axes[..., 1, :]).sum(-1, keepdim=True) * first
    second = nn.functional.normalize(second, dim=-1)
    return torch.stack([first, second, torch.linalg.cross(first, second)], dim=-1)


def trained_net(data: BodySet, steps: int, seed: int, batch: int = 16) -> MeshNet:
    """A network that learned the bodies of `data`; recordings are mirrored and turned about the radar at random."""
    torch.manual_seed(seed)
    draw = torch.Generator().manual_seed(seed)
    net = MeshNet(data.shape)
    optimizer = torch.optim.AdamW(net.parameters(), 2e-3, weight_decay=1e-2)
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimizer, 2e-3, total_steps=steps)
    for _ in range(steps):
        rows = torch.randint(len(data), (min(batch, len(data)),), generator=draw)
        wanted = _turned(_mirrored(data[rows], draw), draw)
        chosen = torch.randperm(wanted.points.shape[2], generator=draw)[: 3 * NUM_POINTS // 4]
        root, rotations, shape = net(wanted.points[:, :, chosen])
        places = _joints(rotations, root), _joints(wanted.rotations, wanted.root)
        loss = (
            nn.functional.l1_loss(root, wanted.root)
            + nn.functional.l1_loss(*places)
            + nn.functional.mse_loss(rotations, wanted.rotations)
            + 0.02 * nn.functional.mse_loss((shape - wanted.shape) / net.shape_std, torch.zeros_like(shape))
        )
        optimizer.zero_grad()
        loss.backward()
        nn.utils.clip_grad_norm_(net.parameters(), 1.0)
        optimizer.step()
        schedule.step()
    return net.eval()


def local_rotations(world: FloatArray) -> FloatArray:
    """(..., 22, 3, 3) rotations relative to the parents, of world ones; the pelvis keeps its own."""
    parents = list(PARENTS[1:NUM_BODY_JOINTS])
    found = world.copy()
    found[..., 1:, :, :] = np.swapaxes(world[..., parents, :, :], -1, -2) @ world[..., 1:, :, :]
    return found


def _joints(rotations: Tensor, root: Tensor) -> Tensor:
    """(..., 22, 3) joints of a mean adult in this pose [m]."""
    offsets = torch.from_numpy(MEAN_ADULT.offsets[:NUM_BODY_JOINTS].astype(np.float32))
    places = [root]
    for joint in range(1, NUM_BODY_JOINTS):
        parent = PARENTS[joint]
        places.append(places[parent] + rotations[..., parent, :, :] @ offsets[joint])
    return torch.stack(places, dim=-2)


def _mirrored(data: BodySet, draw: torch.Generator) -> BodySet:
    """Half of the recordings with left and right exchanged."""
    chosen = torch.rand(len(data), generator=draw) < 0.5
    points, root, rotations = data.points.clone(), data.root.clone(), data.rotations.clone()
    points[chosen, ..., 1] *= -1
    root[chosen] *= _MIRROR
    rotations[chosen] = data.rotations[chosen][:, :, _TWINS] * _MIRROR[:, None] * _MIRROR
    return BodySet(points, root, rotations, data.shape)


def _turned(data: BodySet, draw: torch.Generator) -> BodySet:
    """Each recording turned about the radar's vertical axis."""
    angle = torch.deg2rad(MAX_TURN_DEG * (2 * torch.rand(len(data), generator=draw) - 1))
    turn = torch.zeros(len(data), 1, 1, 3, 3)
    turn[:, 0, 0, 0, 0] = turn[:, 0, 0, 1, 1] = torch.cos(angle)
    turn[:, 0, 0, 1, 0], turn[:, 0, 0, 0, 1] = torch.sin(angle), -torch.sin(angle)
    turn[:, 0, 0, 2, 2] = 1
    points = torch.cat([(turn @ data.points[..., :3, None]).squeeze(-1), data.points[..., 3:]], dim=-1)
    root = (turn[:, :, 0] @ data.root[..., None]).squeeze(-1)
    return BodySet(points, root, turn @ data.rotations, data.shape)
