"""Joint positions of predicted features, differentiable, for the losses that live in space."""

from __future__ import annotations

import torch
from torch import Tensor

from rfgen_sionna.generative.diffusion.features import CONTACTS, LOCAL, ROOT, TRACKED, TURN
from rfgen_sionna.generative.motion import MEAN_ADULT, PARENTS
from rfgen_sionna.generative.motion.skeleton import JOINT, NUM_BODY_JOINTS


def rotations(six: Tensor) -> Tensor:
    """(..., 3, 3) from (..., 6): Gram-Schmidt on the first two columns."""
    a, b = six[..., :3], six[..., 3:]
    x = torch.nn.functional.normalize(a, dim=-1, eps=1e-6)
    b = b - (x * b).sum(dim=-1, keepdim=True) * x
    y = torch.nn.functional.normalize(b, dim=-1, eps=1e-6)
    return torch.stack([x, y, torch.linalg.cross(x, y)], dim=-1)


def joint_positions(features: Tensor) -> Tensor:
    """(..., 22, 3) joint positions from the root [m] of (..., NUM_FEATURES) features in their own units."""
    six = torch.cat([features[..., TURN], features[..., LOCAL]], dim=-1).unflatten(-1, (NUM_BODY_JOINTS, 6))
    local = rotations(six)
    offsets = torch.as_tensor(MEAN_ADULT.offsets[:NUM_BODY_JOINTS], dtype=features.dtype, device=features.device)
    # joints of the same depth are turned together: nine steps instead of twenty-two
    depth = [0] * NUM_BODY_JOINTS
    for j in range(1, NUM_BODY_JOINTS):
        depth[j] = depth[PARENTS[j]] + 1
    world: dict[int, Tensor] = {0: local[..., 0, :, :]}
    places: dict[int, Tensor] = {0: torch.zeros_like(features[..., ROOT])}
    for level in range(1, max(depth) + 1):
        joints = [j for j in range(NUM_BODY_JOINTS) if depth[j] == level]
        parent = torch.stack([world[PARENTS[j]] for j in joints], dim=-3)
        step = (parent * offsets[joints][:, None, :]).sum(dim=-1)
        # as nine products: small matrices are slow to multiply one by one
        mine = local[..., joints, :, :]
        turned = (parent[..., :, :, None] * mine[..., None, :, :]).sum(dim=-2)
        for i, j in enumerate(joints):
            world[j] = turned[..., i, :, :]
            places[j] = places[PARENTS[j]] + step[..., i, :]
    return torch.stack([places[j] for j in range(NUM_BODY_JOINTS)], dim=-2)


def geometric_loss(guess: Tensor, truth: Tensor) -> Tensor:
    """(batch,) errors of position, of velocity and of planted feet, in units in which they are about alike.

    Args:
        guess, truth: (batch, frame, NUM_FEATURES) in their own units.
    """
    p, q = joint_positions(guess), joint_positions(truth)
    place, goal = guess[..., None, ROOT], truth[..., None, ROOT]
    position = (((p - q) / 0.12) ** 2).mean(dim=(1, 2, 3)) + (((place - goal) / 0.3) ** 2).mean(dim=(1, 2, 3))
    # written positions must agree with what the joints make of the rotations
    written = guess[..., slice(LOCAL.stop, CONTACTS.start)].unflatten(-1, (len(TRACKED), 3))
    agree = (((written - p[..., list(TRACKED), :]) / 0.12) ** 2).mean(dim=(1, 2, 3))
    v, w = (p + place).diff(dim=1), (q + goal).diff(dim=1)
    velocity = (((v - w) / 0.03) ** 2).mean(dim=(1, 2, 3))
    planted = truth[:, 1:, CONTACTS] * truth[:, :-1, CONTACTS]
    toes = v[..., [JOINT["left_foot"], JOINT["right_foot"]], :]
    still = ((toes / 0.02) ** 2).sum(dim=-1) * planted
    slide = still.sum(dim=(1, 2)) / planted.sum(dim=(1, 2)).clamp(min=1.0)
    return 0.4 * position + 0.2 * agree + 0.25 * velocity + 0.05 * slide.clamp(max=40.0)
