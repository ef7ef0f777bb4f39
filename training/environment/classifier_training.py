"""Training of judges: of places, and of what an image lacks."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import torch
from numpy.typing import NDArray
from torch.nn.functional import cross_entropy

from rfgen_sionna.generative.environment.classifier import (
    COMPLETE,
    INCOMPLETE,
    SPREAD_DB,
    WIDTHS,
    ClassifierNet,
    ConfidenceGate,
    ImageClassifier,
    classifier_inputs,
)
from rfgen_sionna.generative.environment.classifier import GATE_WIDTHS as SMALL
from rfgen_sionna.generative.environment.place_encoder import ViewFacts
from rfgen_sionna.pir.codec import PirCodec
from training.environment.view_corpus import ViewCorpus
from training.learning import Progress, fit, precision, reports_out_of_memory

_ROUGH = 0.02
"""Noise that it learns to look past."""
_STEPS = 1200
_JITTER_DB = 2.5
"""By how much levels of whole images are changed at random in training: a place a little brighter than usual is none
that lacks something."""
_LEVEL_CHANNEL = 4
"""Channel of the level at 1 m in :func:`classifier_inputs`."""


@reports_out_of_memory
def train_classifier(
    images: NDArray[np.floating],
    classes: NDArray[np.intp],
    views: Sequence[ViewFacts],
    *,
    codec: PirCodec | None = None,
    widths: Sequence[int] = WIDTHS,
    jitter_db: float = 0.0,
    seed: int = 0,
    steps: int = 2500,
    items: int = 48,
    progress: Progress | None = None,
) -> ImageClassifier:
    """A judge from (image, 3, row, column) channels, their classes, such as places, and views.

    Classes are drawn equally often. Levels of whole images are raised or lowered by up to `jitter_db`: it learns not to
    rely on them.
    """
    torch.manual_seed(seed)
    rng = np.random.default_rng([seed, 61])
    codec = codec or PirCodec()
    net = ClassifierNet(int(classes.max()) + 1, widths)
    shown = classifier_inputs(images, views, codec)
    groups = [np.flatnonzero(classes == k) for k in np.unique(classes)]

    def loss_of() -> torch.Tensor:
        index = [int(rng.choice(groups[int(rng.integers(len(groups)))])) for _ in range(items)]
        x = shown[index].float()
        flip = torch.from_numpy(rng.integers(2, size=items) > 0)[:, None, None, None]
        x = torch.where(flip, x.flip(-1), x)
        x = x + _ROUGH * torch.randn(x.shape)
        if jitter_db:
            louder = torch.from_numpy(rng.uniform(-jitter_db, jitter_db, items)).float()[:, None, None]
            there = shown[index][:, 2] > -2 / 3
            x[:, 0] += there * louder * (2.0 / (codec.energy_db[1] - codec.energy_db[0]))
            x[:, _LEVEL_CHANNEL] += there * louder / SPREAD_DB
        with precision():
            _, logits = net(x)
        return cross_entropy(logits.float(), torch.from_numpy(classes[index]), label_smoothing=0.05)

    fit(net, loss_of, steps, progress=progress)
    return ImageClassifier(net.eval().requires_grad_(False), codec)


def train_confidence_gate(
    pairs: ViewCorpus, seed: int, *, steps: int = _STEPS, progress: Progress | None = None
) -> ConfidenceGate:
    """A judge from training pairs; `progress` is called with (step, steps, loss).

    Raises:
        ValueError: they are no pairs.
    """
    incomplete = pairs.lacking
    classes = np.repeat(np.array([COMPLETE, INCOMPLETE], np.intp), len(pairs))
    images, views = np.concatenate([pairs.images, incomplete]), [*pairs.views, *pairs.views]
    return ConfidenceGate(
        classifier=train_classifier(
            images, classes, views, widths=SMALL, jitter_db=_JITTER_DB, seed=seed, steps=steps, progress=progress
        )
    )
