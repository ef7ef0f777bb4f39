"""Classifier of images of surroundings, and confidence gate of path diffusion.

The classifier names the place, and gives features for distances between sets of images. It is trained on the training
split's renders only. Its inputs include height of each point and level at 1 m.

The gate keeps complete images unchanged: a classifier separates images of a fast trace (smooth surfaces of one
material, no further bounces) from complete ones, and its mean probability over the frames of a sequence, times a factor
fitted on validation pairs, scales the gains. It judges surfaces, not objects: an image that lacks a table counts as
complete.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from rfgen_sionna._types import SPEED_OF_LIGHT, FloatArray
from rfgen_sionna.generative.environment.place_encoder import ViewFacts, view_tokens
from rfgen_sionna.generative.environment.view_unet import view_maps
from rfgen_sionna.pir.codec import PirCodec

FEATURES = 48
"""Numbers of an image's feature vector."""
INPUT_CHANNELS = 6
"""Channels of an input image."""
WIDTHS = (32, 48, 96, 128)
"""Channels of the four stages."""
LEVEL_DB, SPREAD_DB = -135.0, 15.0
"""Mean and spread [dB] of levels at 1 m, for normalisation."""
COMPLETE, INCOMPLETE = 0, 1
"""Classes of the gate's classifier."""
GATE_WIDTHS = (16, 24, 48, 64)
"""Channels of the gate's classifier; a small one suffices."""


def classifier_inputs(images: NDArray[np.floating], views: Sequence[ViewFacts], codec: PirCodec) -> Tensor:
    """(image, INPUT_CHANNELS, row, column) inputs in half precision: the channels, height, level at 1 m, and range of
    the floor beyond."""
    parts = []
    for start in range(0, len(images), 256):
        x = torch.from_numpy(images[start : start + 256].astype(np.float32))
        some = views[start : start + 256]
        maps = view_maps(view_tokens(some)[:, 0], x.shape[-2], x.shape[-1], codec)
        energy, arrival, _ = codec.decode_arrays(x.numpy().astype(np.float64), clip=True)
        there = torch.from_numpy(energy > 0)
        reach = torch.from_numpy(np.nan_to_num(0.5 * SPEED_OF_LIGHT * arrival)).float()
        height = torch.tensor([view.height for view in some])[:, None, None] + reach * maps[:, 2]
        level = torch.from_numpy(10 * np.log10(np.maximum(energy, 1e-30))).float()
        level = (level + 20 * torch.log10(reach.clamp(min=0.3)) - LEVEL_DB) / SPREAD_DB
        behind = (maps[:, 3] - x[:, 1]).clamp(-1, 1)
        more = [(0.5 * height.clamp(-0.5, 5.0) - 0.6) * there, level * there, behind]
        parts.append(torch.cat([x, torch.stack(more, dim=1)], dim=1).half())
    return torch.cat(parts)


class ClassifierNet(nn.Module):
    def __init__(self, classes: int, widths: Sequence[int]) -> None:
        super().__init__()
        layers: list[nn.Module] = []
        width = INPUT_CHANNELS
        for wider in widths:
            layers += [nn.Conv2d(width, wider, 3, stride=2, padding=1), nn.GroupNorm(8, wider), nn.GELU()]
            layers += [nn.Conv2d(wider, wider, 3, padding=1), nn.GroupNorm(8, wider), nn.GELU()]
            width = wider
        self.body = nn.Sequential(*layers)
        self.squeeze = nn.Sequential(nn.Dropout(0.3), nn.Linear(2 * width, FEATURES), nn.LayerNorm(FEATURES))
        self.classes = nn.Linear(FEATURES, classes)

    def forward(self, x: Tensor) -> tuple[Tensor, Tensor]:
        h = self.body(x)
        f = self.squeeze(torch.cat([h.mean(dim=(2, 3)), h.amax(dim=(2, 3))], dim=-1))
        return f, self.classes(f)


@dataclass(frozen=True)
class ImageClassifier:
    """A trained classifier."""

    net: ClassifierNet
    codec: PirCodec = field(default_factory=PirCodec)

    def classify(self, images: NDArray[np.floating], views: Sequence[ViewFacts]) -> tuple[FloatArray, FloatArray]:
        """(image, FEATURES) features and (image, class) log probabilities of (image, 3, row, column) channels."""
        features, probabilities = [], []
        with torch.no_grad():
            for start in range(0, len(images), 128):
                part = slice(start, start + 128)
                f, logits = self.net(classifier_inputs(images[part], views[part], self.codec).float())
                features.append(f.double().numpy())
                probabilities.append(logits.log_softmax(dim=-1).double().numpy())
        return np.concatenate(features), np.concatenate(probabilities)


def untrained_classifier(
    classes: int, codec: PirCodec | None = None, widths: Sequence[int] = WIDTHS
) -> ImageClassifier:
    """A classifier of that many classes with random weights."""
    return ImageClassifier(ClassifierNet(classes, widths).eval().requires_grad_(False), codec or PirCodec())


@dataclass(frozen=True)
class ConfidenceGate:
    """Share of the gains that is applied."""

    share: float = 1.0
    """Share for an image that is certainly incomplete."""
    classifier: ImageClassifier | None = None
    """Classifier of incomplete images; None counts all as incomplete."""

    def __call__(self, images: NDArray[np.floating], views: Sequence[ViewFacts]) -> float:
        """Share, 0 … 1, of gains for all frames (frame, 3, row, column) of one view, in the codec's channels."""
        return self.share * float(self.probabilities(images, views).mean())

    def probabilities(self, images: NDArray[np.floating], views: Sequence[ViewFacts]) -> FloatArray:
        """(image,) probabilities that images (image, 3, row, column) are incomplete."""
        if self.classifier is None:
            return np.ones(len(images))
        return np.asarray(np.exp(self.classifier.classify(images, views)[1][:, INCOMPLETE]))

    @classmethod
    def of(cls, share: float, tensors: dict[str, Tensor]) -> ConfidenceGate:
        """Gate from the contents of a file."""
        if not tensors:
            return cls(share)
        classifier = untrained_classifier(2, widths=GATE_WIDTHS)
        classifier.net.load_state_dict(tensors)
        return cls(share, classifier)
