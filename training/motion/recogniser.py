"""A judge of motion: says which action a motion shows, and measures how far two sets of motions lie apart.

It is trained on synthesised and captured motion that the generator has never seen, and never on generated motion.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from torch.nn.functional import cross_entropy

from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.diffusion.features import FRAME_RATE, HANDS, heading
from rfgen_sionna.generative.diffusion.rhythm import relative_positions
from training.learning import Progress, fit

WINDOW = 96
"""Poses that it looks at."""
_WIDTH = 96
FEATURES = 48


def appearance(features: FloatArray) -> NDArray[np.float32]:
    """(frame, k) what a motion looks like wherever it is: joints from the pelvis, their and its speed, hands."""
    places = relative_positions(features) / 0.2
    yaw = heading(features)
    step = np.gradient(features[:, :2], axis=0) * FRAME_RATE
    ahead = np.cos(yaw) * step[:, 0] + np.sin(yaw) * step[:, 1]
    aside = np.cos(yaw) * step[:, 1] - np.sin(yaw) * step[:, 0]
    turning = np.gradient(yaw) * FRAME_RATE
    rates = np.stack([ahead, aside, 0.5 * turning], axis=-1)
    moving = np.gradient(relative_positions(features), axis=0) * FRAME_RATE
    return np.concatenate([places, 0.7 * moving, rates, 2.0 * features[:, HANDS]], axis=1).astype(np.float32)


class RecogniserNet(nn.Module):
    def __init__(self, inputs: int, classes: int) -> None:
        super().__init__()
        layers: list[nn.Module] = []
        width = inputs
        for _ in range(4):
            layers += [nn.Conv1d(width, _WIDTH, 5, stride=2, padding=2), nn.GroupNorm(8, _WIDTH), nn.GELU()]
            width = _WIDTH
        self.body = nn.Sequential(*layers)
        self.squeeze = nn.Sequential(nn.Dropout(0.2), nn.Linear(2 * _WIDTH, FEATURES), nn.LayerNorm(FEATURES))
        self.classes = nn.Linear(FEATURES, classes)

    def forward(self, x: Tensor) -> tuple[Tensor, Tensor]:
        h = self.body(x.transpose(1, 2))
        f = self.squeeze(torch.cat([h.mean(dim=-1), h.amax(dim=-1)], dim=-1))
        return f, self.classes(f)


@dataclass(frozen=True)
class ActionClassifier:
    """A trained judge."""

    net: RecogniserNet
    actions: tuple[str, ...]

    def classify(self, motions: Sequence[FloatArray]) -> tuple[FloatArray, FloatArray]:
        """(motion, FEATURES) features and (motion, action) probabilities of feature rows of any length."""
        windows = np.stack([_window(appearance(m), None) for m in motions])
        with torch.no_grad():
            f, logits = self.net(torch.from_numpy(windows))
        return f.double().numpy(), logits.double().softmax(-1).numpy()

    def name(self, motions: Sequence[FloatArray]) -> list[str]:
        """The likeliest action of each."""
        return [self.actions[k] for k in self.classify(motions)[1].argmax(axis=1)]


def train_action_classifier(
    motions: Sequence[FloatArray],
    labels: Sequence[str],
    *,
    seed: int = 0,
    steps: int = 1200,
    progress: Progress | None = None,
) -> ActionClassifier:
    """A judge from (frame, NUM_FEATURES) feature rows and their actions; classes are drawn equally often."""
    torch.manual_seed(seed)
    rng = np.random.default_rng([seed, 9])
    actions = tuple(sorted(set(labels)))
    looks = [appearance(m) for m in motions]
    groups = [[k for k, label in enumerate(labels) if label == a] for a in actions]
    net = RecogniserNet(looks[0].shape[1], len(actions))

    def loss_of() -> torch.Tensor:
        which = rng.integers(len(actions), size=48)
        rows = [_window(looks[groups[c][int(rng.integers(len(groups[c])))]], rng) for c in which]
        x = torch.from_numpy(np.stack(rows))
        x = x + 0.02 * torch.randn(x.shape)
        _, logits = net(x)
        return cross_entropy(logits, torch.from_numpy(which), label_smoothing=0.05)

    fit(net, loss_of, steps, rate=3e-3, progress=progress)
    return ActionClassifier(net.eval(), actions)


def _window(classify: NDArray[np.float32], rng: np.random.Generator | None) -> NDArray[np.float32]:
    """`WINDOW` poses: the middle ones, or any; short motions are played to and fro."""
    if len(classify) < WINDOW:
        there = np.arange(len(classify))
        order = np.concatenate([there, there[-2:0:-1]]) if len(classify) > 2 else there
        classify = classify[np.resize(order, WINDOW)]
    room = len(classify) - WINDOW
    start = room // 2 if rng is None else int(rng.integers(room + 1))
    return classify[start : start + WINDOW]
