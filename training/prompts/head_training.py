"""Training of the action reader's head: softmax regression on vectors of sentences and hashed words."""

from __future__ import annotations

import json
from collections import Counter, defaultdict
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from rfgen_sionna.generative.prompts import sentence_features
from training.learning import Progress, fit
from training.prompts.sentences import REFUSED, Sentence, plain, wordings


@dataclass(frozen=True)
class HeadRecipe:
    """Settings of a training."""

    seed: int = 0
    sentences: int = 3
    """Of each wording."""
    steps: int = 1500
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

    def write(self, path: Path, limits: tuple[float, float], facts: dict[str, Any]) -> None:
        """Write the file; weights in half precision."""
        header = {"labels": self.labels, "stems": self.stems, "common": self.common, "limits": limits, **facts}
        path.parent.mkdir(parents=True, exist_ok=True)
        np.savez_compressed(
            path,
            weights=self.weights.astype(np.float16),
            bias=self.bias.astype(np.float16),
            facts=np.frombuffer(json.dumps(header).encode(), np.uint8),
        )


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
    width = vectors.shape[1]
    scale = torch.full((width + sentence_features.HASHED,), recipe.hashed)
    scale[:width] = recipe.vectors
    dense = torch.from_numpy(vectors)
    rows = [torch.from_numpy(sentence_features.hashed(each.text)) for each in corpus]
    net = torch.nn.Linear(len(scale), len(labels))
    torch.nn.init.zeros_(net.weight)
    torch.nn.init.zeros_(net.bias)

    def loss_of() -> torch.Tensor:
        chosen = torch.randint(len(corpus), (recipe.batch,), generator=generator)
        x = torch.zeros(recipe.batch, len(scale))
        x[:, :width] = dense[chosen]
        x[:, :width] += recipe.noise * torch.randn(recipe.batch, width, generator=generator)
        for row, index in enumerate(chosen.tolist()):
            said = rows[index]
            said = said[torch.rand(len(said), generator=generator) > 0.2]  # words that a stranger leaves out
            x[row, width + said] = 1.0 / max(1.0, float(len(said))) ** 0.5
        scores = net(x * scale)
        penalty = recipe.decay * (net.weight**2).sum()
        return torch.nn.functional.cross_entropy(scores, target[chosen], label_smoothing=0.02) + penalty

    fit(net, loss_of, recipe.steps, rate=recipe.rate, progress=progress)
    weights = (net.weight.detach() * scale).T.numpy().astype(np.float32)
    stems, common = vocabulary(corpus)
    return Head(labels, np.ascontiguousarray(weights), net.bias.detach().numpy().astype(np.float32), stems, common)


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


def recipe_facts(recipe: HeadRecipe) -> dict[str, Any]:
    """The recipe as JSON."""
    return asdict(recipe)
