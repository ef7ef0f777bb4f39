"""Words for diffusers' pipelines on our model: what they call a tokenizer and a text encoder."""

from __future__ import annotations

from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any, ClassVar

import torch
from torch import Tensor, nn

from rfgen_sionna.generative.diffusion.sentence_encoder import MAX_WORDS, tokenise, words
from rfgen_sionna.generative.environment.place_encoder import PlaceEncoder, ViewFacts

HORIZONTAL_VIEW = ViewFacts((60.0, 60.0), 1.0, 0.0, 0.0)
"""The view that pictures of words alone have: level, 1 m above the floor."""


class PromptTokenizer:
    """Sentences to buckets of pieces of words, as diffusers asks for them."""

    model_max_length = MAX_WORDS
    added_tokens_encoder: ClassVar[dict[str, int]] = {}
    """Words that textual inversions added: there are none."""

    def tokenize(self, text: str) -> list[str]:
        """Its words."""
        return words(text)

    def __call__(self, texts: str | Sequence[str], **_: Any) -> SimpleNamespace:
        """`input_ids` (text, word, piece); how they are to be padded is not asked."""
        ids = tokenise([texts] if isinstance(texts, str) else list(texts))
        return SimpleNamespace(input_ids=ids, attention_mask=(ids > 0).any(dim=-1))


class PromptEncoder(nn.Module):
    """The model's encoder for one view, as diffusers calls it.

    Args:
        text: the model's encoder.
        view: that all prompts are meant for.
    """

    def __init__(self, text: PlaceEncoder, view: ViewFacts = HORIZONTAL_VIEW) -> None:
        super().__init__()
        self.text, self.view = text, view
        self.config = SimpleNamespace(use_attention_mask=False)

    @property
    def dtype(self) -> torch.dtype:
        return self.text.named.weight.dtype

    @property
    def device(self) -> torch.device:
        return self.text.named.weight.device

    def forward(self, ids: Tensor, attention_mask: Tensor | None = None) -> tuple[Tensor]:
        """((text, TOKENS, WIDTH),) of `input_ids`."""
        said = (ids > 0).any(dim=-1).any(dim=-1)
        return (self.text.embed_ids(ids, said, [self.view] * len(ids)),)
