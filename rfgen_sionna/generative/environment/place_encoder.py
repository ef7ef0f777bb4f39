"""What a prompt and a view tell the image model: tokens of words, and one token of numbers.

The sentence encoder is the motion model's kind, trained here to say which place a sentence names and what stands there.
It ships with the weights and needs no download.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import torch
from torch import Tensor, nn

from rfgen_sionna.generative.diffusion.sentence_encoder import MAX_WORDS, WIDTH, SentenceEncoder, tokenise
from rfgen_sionna.generative.environment import requested_objects as wishes
from rfgen_sionna.pir.projection import Projection
from rfgen_sionna.pir.view import View

TOKENS = MAX_WORDS + 2
"""Tokens a prompt and its view take: the numbers, the sentence as a whole, its words."""
_BANDS = WIDTH // 16


@dataclass(frozen=True)
class ViewFacts:
    """How a view looks at its place."""

    fov_deg: tuple[float, float]
    """Horizontal, vertical [degrees]."""
    height: float
    """Of the radar over the floor [m]."""
    pitch: float
    """[rad]; positive looks down."""
    yaw: float
    """[rad]; positive is to the left."""
    roll: float = 0.0
    """[rad]"""
    projection: Projection = "perspective"

    def mirrored(self) -> ViewFacts:
        """Of the image whose columns are swapped."""
        return replace(self, yaw=-self.yaw, roll=-self.roll)

    def view(self, resolution: tuple[int, int]) -> View:
        """With pixels (rows, columns), at the origin."""
        orientation = self.yaw, self.pitch, self.roll
        return View(resolution, self.fov_deg, (0.0, 0.0, self.height), orientation, self.projection)

    @property
    def numbers(self) -> tuple[float, ...]:
        """Eight numbers of the order of 1; the last two have the length 1 in perspective, half of it otherwise."""
        length = 1.0 if self.projection == "perspective" else 0.5
        return (
            self.fov_deg[0] / 60.0 - 1.0,
            self.fov_deg[1] / 60.0 - 1.0,
            self.height - 1.0,
            2.0 * self.pitch,
            math.cos(self.yaw),
            math.sin(self.yaw),
            length * math.cos(self.roll),
            length * math.sin(self.roll),
        )


def view_tokens(views: Sequence[ViewFacts]) -> Tensor:
    """(view, 1, WIDTH) sines and cosines of each view's numbers at several frequencies; nothing is learned."""
    x = torch.tensor([view.numbers for view in views], dtype=torch.float32)
    phase = x[:, :, None] * (0.5 * math.pi * 2.0 ** (torch.arange(_BANDS) - 1.0))
    return torch.cat([phase.sin(), phase.cos()], dim=-1).reshape(len(views), 1, WIDTH) * math.sqrt(2.0)


class PlaceEncoder(SentenceEncoder):
    """The encoder of sentences about places.

    Args:
        places: names of the places it tells apart.
        things: names of the furniture it tells apart.
    """

    def __init__(self, places: Sequence[str], things: Sequence[str]) -> None:
        super().__init__()
        self.places, self.things = tuple(places), tuple(things)
        self.named = nn.Linear(WIDTH, len(self.places))
        self.mentioned = nn.Linear(WIDTH, len(self.things))
        self.register_buffer("spread", torch.ones(2))

    spread: Tensor
    """Root mean square of pooled states and of word states over the training sentences."""

    @torch.no_grad()
    def embed(self, texts: Sequence[str], views: Sequence[ViewFacts]) -> Tensor:
        """(text, TOKENS, WIDTH) of sentences and views; an empty sentence is zeros but for its view."""
        said = torch.tensor([bool(t.strip()) for t in texts])
        return self.embed_ids(tokenise(list(texts)), said, views)

    @torch.no_grad()
    def embed_ids(self, ids: Tensor, said: Tensor, views: Sequence[ViewFacts]) -> Tensor:
        """The same of tokenised sentences (text, word, piece), and whether each says anything (text,)."""
        reading = self(ids.to(self.place.device))
        said = said.to(self.place.device)[:, None, None]
        pooled = reading.pooled[:, None] / self.spread[0] * said
        tokens = reading.tokens / self.spread[1] * said
        return torch.cat([view_tokens(views).to(pooled), pooled, tokens], dim=1)

    def read(self, text: str) -> wishes.NamedObjects:
        """What a text names by its words: of the places, those that are told apart here."""
        said = wishes.read_objects(text)
        return replace(said, places=tuple(place for place in said.places if place in self.places))

    @torch.no_grad()
    def place_of(self, text: str) -> tuple[str, float]:
        """The likeliest place of a sentence, among those that its words name if they name any, and its probability."""
        probabilities = self.named(self(tokenise([text]).to(self.place.device)).pooled).softmax(dim=-1)[0].tolist()
        every = dict(zip(self.places, probabilities, strict=True))
        best = max(self.read(text).places or self.places, key=every.__getitem__)
        return best, every[best]
