"""Training of the action reader's head: softmax regression on vectors of sentences and hashed words."""

from __future__ import annotations

import json
import re
from collections import Counter, defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray

from rfgen_sionna.generative.prompts import sentence_features
from rfgen_sionna.generative.prompts.action_reader import REFUSED
from training.learning import Progress, fit
from training.prompts.sentences import Sentence, plain, wordings


@dataclass(frozen=True)
class HeadRecipe:
    """Settings of a training."""

    seed: int = 0
    sentences: int = 3
    """Of each wording."""
    steps: int = 900
    batch: int = 512
    rate: float = 0.02
    hashed: float = 1.5
    """Factor on the hashed features."""
    vectors: float = 12.0
    """Factor on the vectors."""
    decay: float = 1e-4
    """Of the weights, towards zero."""
    noise: float = 0.02
    """Standard deviation of noise on the components of the vectors."""


@dataclass(frozen=True)
class Head:
    """Trained head, for the file that the action reader loads."""

    labels: list[str]
    weights: NDArray[np.float32]
    """(feature, label)."""
    bias: NDArray[np.float32]
    stems: dict[str, list[str]]
    """Family -> stems of its wordings."""
    common: list[str]
    """Stems that tell nothing of an action."""
    words: list[str]
    """Words of the training sentences."""


def train_head(
    corpus: Sequence[Sentence], vectors: NDArray[np.float32], recipe: HeadRecipe, progress: Progress | None = None
) -> Head:
    """Head for the labels of a corpus.

    Args:
        corpus: sentences.
        vectors: (sentence, width) by the encoder.
        recipe: settings.
        progress: called with (step, steps, loss).
    """
    torch.manual_seed(recipe.seed)
    generator = torch.Generator().manual_seed(recipe.seed)
    labels = sorted({each.label for each in corpus}, key=lambda label: (label.startswith(REFUSED), label))
    target = torch.tensor([labels.index(each.label) for each in corpus])
    dense = torch.from_numpy(vectors)
    rows = [torch.from_numpy(sentence_features.hashed(each.text)) for each in corpus]
    net = _Regression(vectors.shape[1], len(labels), recipe)

    def loss_of() -> torch.Tensor:
        chosen = torch.randint(len(corpus), (recipe.batch,), generator=generator)
        said = [rows[index] for index in chosen.tolist()]
        # a fifth of the words is left out, as strangers do
        said = [each[torch.rand(len(each), generator=generator) > 0.2] for each in said]
        x = dense[chosen] + recipe.noise * torch.randn(recipe.batch, dense.shape[1], generator=generator)
        loss = torch.nn.functional.cross_entropy(net(x, said), target[chosen], label_smoothing=0.02)
        return loss + recipe.decay * net.size()

    fit(net, loss_of, recipe.steps, rate=recipe.rate, progress=progress)
    stems, common = vocabulary(corpus)
    words = sorted({word for each in corpus for word in re.findall(r"[a-z]+", each.text)})
    return Head(labels, net.weights(), net.bias(), stems, common, words)


class _Regression(torch.nn.Module):
    """Softmax regression on vectors and hashed words."""

    def __init__(self, width: int, labels: int, recipe: HeadRecipe) -> None:
        super().__init__()
        self._scales = recipe.vectors, recipe.hashed
        self.vectors = torch.nn.Linear(width, labels)
        self.words = torch.nn.EmbeddingBag(sentence_features.HASHED, labels, mode="sum")
        for values in (self.vectors.weight, self.vectors.bias, self.words.weight):
            torch.nn.init.zeros_(values)

    def forward(self, vectors: torch.Tensor, words: Sequence[torch.Tensor]) -> torch.Tensor:
        """Scores (text, label) of vectors (text, width) and of the indices of hashed words of each text."""
        lengths = torch.tensor([len(each) for each in words])
        offsets = lengths.cumsum(0) - lengths
        each = lengths.clamp(min=1).float().rsqrt().repeat_interleave(lengths)
        hashed = self.words(torch.cat(list(words)), offsets, per_sample_weights=each)
        return self._scales[0] * self.vectors(vectors) + self._scales[1] * hashed

    def bias(self) -> NDArray[np.float32]:
        """(label,)"""
        return (self._scales[0] * self.vectors.bias.detach()).numpy()

    def size(self) -> torch.Tensor:
        """Sum of the squares of the weights."""
        return (self.vectors.weight**2).sum() + (self.words.weight**2).sum()

    def weights(self) -> NDArray[np.float32]:
        """Weights (feature, label) of the design matrix of :func:`.sentence_features.design`."""
        both = torch.cat(
            [self._scales[0] * self.vectors.weight.detach().T, self._scales[1] * self.words.weight.detach()]
        )
        return both.numpy().astype(np.float32)


def vocabulary(corpus: Sequence[Sentence]) -> tuple[dict[str, list[str]], list[str]]:
    """Stems of the wordings of each family, and stems of circumstances."""
    found: dict[str, set[str]] = defaultdict(set)
    for label, phrases in wordings().items():
        if not label.startswith(REFUSED):
            for phrase in phrases:
                found[label] |= set(sentence_features.stems(plain(phrase)))
    circumstances: Counter[str] = Counter()
    for each in corpus:
        extra = set(sentence_features.stems(each.text)) - set(sentence_features.stems(plain(each.phrase)))
        circumstances.update(extra)
    common = sorted(word for word, count in circumstances.items() if count > 1)
    return {label: sorted(words) for label, words in found.items()}, common


def write_head(path: Path, head: Head, limits: tuple[float, float, float]) -> None:
    """Write the file that the action reader loads; weights in half precision.

    Args:
        path: the file.
        head: trained head.
        limits: least probability of a reading, by its doubt.
    """
    facts = {"labels": head.labels, "stems": head.stems, "common": head.common, "words": head.words, "limits": limits}
    np.savez_compressed(
        path,
        weights=head.weights.astype(np.float16),
        bias=head.bias.astype(np.float16),
        facts=np.frombuffer(json.dumps(facts).encode(), np.uint8),
    )
