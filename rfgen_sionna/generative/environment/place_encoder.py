"""Encoder of a prompt and a view for the image model: tokens of words, and one token of the view's numbers.

The sentence encoder is trained to name place and furniture of a sentence, and ships with the weights.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import torch
from torch import Tensor, nn

from rfgen_sionna.generative.environment.requested_objects import NamedObjects, read_objects
from rfgen_sionna.generative.environment.sentence_encoder import MAX_WORDS, WIDTH, SentenceEncoder, tokenise
from rfgen_sionna.pir.projection import Projection
from rfgen_sionna.pir.view import View

TOKENS = MAX_WORDS + 2
"""Tokens of a prompt and its view: numbers, whole sentence, words."""
_BANDS = WIDTH // 16
"""Frequencies of each number in its token."""


@dataclass(frozen=True)
class ViewFacts:
    """Geometry of a view."""

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

    def view(self, resolution: tuple[int, int]) -> View:
        """View with pixels (rows, columns), at the origin."""
        orientation = self.yaw, self.pitch, self.roll
        return View(resolution, self.fov_deg, (0.0, 0.0, self.height), orientation, self.projection)

    @property
    def numbers(self) -> tuple[float, ...]:
        """Eight numbers of order 1; the last two have length 1 in perspective, 0.5 otherwise."""
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
    """(view, 1, WIDTH) sines and cosines of each view's numbers at several frequencies; fixed, not learned."""
    x = torch.tensor([view.numbers for view in views], dtype=torch.float32)
    phase = x[:, :, None] * (0.5 * math.pi * 2.0 ** (torch.arange(_BANDS) - 1.0))
    return torch.cat([phase.sin(), phase.cos()], dim=-1).reshape(len(views), 1, WIDTH) * math.sqrt(2.0)


class PlaceEncoder(SentenceEncoder):
    """Encoder of sentences about places.

    Args:
        places: names of the places.
        things: names of the furniture.
    """

    def __init__(self, places: Sequence[str], things: Sequence[str]) -> None:
        super().__init__()
        self.places, self.things = tuple(places), tuple(things)
        self.named = nn.Linear(WIDTH, len(self.places))
        self.mentioned = nn.Linear(WIDTH, len(self.things))
        self.register_buffer("spread", torch.ones(2))

    spread: Tensor
    """Root mean square of pooled states and of word states over training sentences."""

    @torch.no_grad()
    def embed(self, texts: Sequence[str], views: Sequence[ViewFacts]) -> Tensor:
        """(text, TOKENS, WIDTH) of sentences and views; an empty sentence gives zeros beside its view."""
        said = torch.tensor([bool(t.strip()) for t in texts])
        return self.embed_ids(tokenise(list(texts)), said, views)

    @torch.no_grad()
    def embed_ids(self, ids: Tensor, said: Tensor, views: Sequence[ViewFacts]) -> Tensor:
        """(text, TOKENS, WIDTH) of tokenised sentences (text, word, piece), with a mask (text,) of nonempty ones."""
        reading = self(ids.to(self.place.device))
        said = said.to(self.place.device)[:, None, None]
        pooled = reading.pooled[:, None] / self.spread[0] * said
        tokens = reading.tokens / self.spread[1] * said
        return torch.cat([view_tokens(views).to(pooled), pooled, tokens], dim=1)

    def read(self, text: str) -> NamedObjects:
        """Objects that a text names; places are limited to those of the model."""
        said = read_objects(text)
        return replace(said, places=tuple(place for place in said.places if place in self.places))

    @torch.no_grad()
    def place_of(self, text: str) -> tuple[str, float]:
        """Likeliest place of a sentence and its probability; named places only, where there are any."""
        probabilities = self.named(self(tokenise([text]).to(self.place.device)).pooled).softmax(dim=-1)[0].tolist()
        every = dict(zip(self.places, probabilities, strict=True))
        best = max(self.read(text).places or self.places, key=every.__getitem__)
        return best, every[best]
