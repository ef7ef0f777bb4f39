"""A small sentence encoder, shipped with the image model.

Words enter as hashed pieces (word, stem, letter triples and quadruples), so that unseen forms and misspellings are near
known ones; two transformer layers use their order. It is trained to classify sentences, then frozen.
"""

from __future__ import annotations

import re
import zlib
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor, nn

BUCKETS = 8192
"""Size of the table of hashed pieces."""
MAX_WORDS = 28
"""Words of a sentence that are read."""
MAX_PIECES = 14
"""Pieces of a word that are read."""
WIDTH = 128
"""Numbers of a state."""
_COUNTER = re.compile(r"\b(?:counter|anti)[ -]?clockwise")
_WORD = re.compile(r"[a-z0-9']+")


def words(text: str) -> list[str]:
    """Lower-case words of a text; "counter-clockwise" and its variants are one word."""
    return _WORD.findall(_COUNTER.sub("counterclockwise", text.lower()).replace("-", " "))[:MAX_WORDS]


def stem(word: str) -> str:
    """The word without common endings."""
    for ending in ("ing", "ies", "ed", "es", "s"):
        if word.endswith(ending) and len(word) - len(ending) >= 3:
            word = word[: -len(ending)]
            break
    if len(word) > 3 and word[-1] == word[-2]:
        word = word[:-1]
    return word.rstrip("e")


def pieces(word: str) -> list[int]:
    """Buckets of a word's pieces, 1 .. BUCKETS − 1; 0 is padding."""
    padded = f"<{word}>"
    parts = [f"w:{word}", f"s:{stem(word)}"]
    parts += [padded[i : i + n] for n in (3, 4) for i in range(len(padded) - n + 1)]
    return [1 + zlib.crc32(p.encode()) % (BUCKETS - 1) for p in parts[:MAX_PIECES]]


def tokenise(texts: list[str]) -> Tensor:
    """(text, MAX_WORDS, MAX_PIECES) buckets."""
    out = np.zeros((len(texts), MAX_WORDS, MAX_PIECES), np.int64)
    for i, text in enumerate(texts):
        for j, word in enumerate(words(text)):
            row = pieces(word)
            out[i, j, : len(row)] = row
    return torch.from_numpy(out)


@dataclass(frozen=True)
class EncodedSentences:
    """States of encoded sentences."""

    tokens: Tensor
    """(text, MAX_WORDS, WIDTH)."""
    mask: Tensor
    """(text, MAX_WORDS) whether there is a word."""
    pooled: Tensor
    """(text, WIDTH)."""


class SentenceEncoder(nn.Module):
    """Encoder of sentences to token states and a pooled state."""

    def __init__(self) -> None:
        super().__init__()
        self.pieces = nn.Embedding(BUCKETS, WIDTH, padding_idx=0)
        self.place = nn.Parameter(0.02 * torch.randn(MAX_WORDS, WIDTH))
        layer = nn.TransformerEncoderLayer(WIDTH, 4, 2 * WIDTH, 0.1, "gelu", batch_first=True, norm_first=True)
        self.layers = nn.TransformerEncoder(layer, 2, enable_nested_tensor=False)
        self.weight = nn.Linear(WIDTH, 1)
        self.norm = nn.LayerNorm(WIDTH)

    def forward(self, ids: Tensor) -> EncodedSentences:
        """Encode `ids` (text, word, piece) of :func:`tokenise`."""
        there = ids > 0
        mask = there.any(dim=-1)
        # an empty sentence has one padding word
        mask = torch.cat([mask[:, :1] | ~mask.any(dim=-1, keepdim=True), mask[:, 1:]], dim=1)
        count = there.sum(dim=-1, keepdim=True).clamp(min=1).to(self.place.dtype)
        x = self.pieces(ids).sum(dim=2) / count.sqrt() + self.place[: ids.shape[1]]
        x = self.layers(x, src_key_padding_mask=~mask)
        share = self.weight(x).squeeze(-1).masked_fill(~mask, -1e4).softmax(dim=-1)
        pooled = self.norm((share[..., None] * x).sum(dim=1))
        return EncodedSentences(x * mask[..., None], mask, pooled)
