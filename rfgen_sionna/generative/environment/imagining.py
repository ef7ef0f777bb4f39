"""Images of surroundings from tokens: from a sketch to a finished picture, as all that draws does it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from rfgen_sionna._types import SPEED_OF_LIGHT, FloatArray
from rfgen_sionna.generative.environment.flashes import Flashes, flashes
from rfgen_sionna.generative.environment.model import EnvironmentModel, ModelFileError
from rfgen_sionna.generative.environment.rooms import Room, Wanted, choose_room
from rfgen_sionna.generative.environment.sampling import Guide, Sampler, draw
from rfgen_sionna.generative.environment.text import ViewFacts
from rfgen_sionna.generative.environment.views import PATCH
from rfgen_sionna.pir.codec import PirCodec
from rfgen_sionna.pir.view import View

SPREAD = 0.5
"""Of the noise over a sketch, against that of the sampler: what it leaves open is less than the network, as it is,
makes of it."""


@dataclass(frozen=True)
class Wish:
    """One image that is wanted."""

    wanted: Wanted
    view: View
    seed: int
    first: View | None = None
    """How the place was seen first, where this is another view of it."""
    anywhere: bool = False
    """Whether the radar may stand anywhere in the place, wherever the view says it is."""

    def room(self) -> Room:
        """The place that the image is drawn over."""
        return choose_room(self.wanted, self.first or self.view, self.seed, anywhere=self.anywhere)


def facts_of(view: View) -> ViewFacts:
    """What a view tells the embedded model; the floor is z = 0."""
    yaw, pitch, roll = view.orientation
    return ViewFacts(view.fov_deg, view.position[2], pitch, yaw, roll, view.projection)


def sketched(
    model: EnvironmentModel,
    guide: Guide,
    sketches: NDArray[np.float32],
    views: Sequence[ViewFacts],
    bright: Sequence[FloatArray],
) -> Guide:
    """The guide with sketches (image, CHANNELS, row, column), whose kinds of things are as `bright` (kind,) as that.

    Raises:
        ModelFileError: the model reads none.
    """
    if model.expectation is None:
        raise ModelFileError("model: it reads no sketches; train one with training.environment.train")
    expected = model.expectation.of(sketches, views, bright, model.vae, model.codec)
    return replace(guide, sketch=torch.from_numpy(sketches), expected=expected)


def imagine(
    model: EnvironmentModel,
    scheduler: Any,
    sampler: Sampler,
    wishes: Sequence[Wish] | None,
    tokens: Tensor,
    against: Tensor,
    noise: Tensor,
    guide: Guide | None = None,
    *,
    progress: Callable[[int, int], None] | None = None,
) -> FloatArray:
    """(image, 3, row, column) finished images, each over the sketch of its wish, or from words alone where there are no
    `wishes`; the other arguments are those of :func:`draw`."""
    guide, sketches = guide or Guide(), None
    flashing: list[Flashes] = []
    if wishes is not None and model.expectation is not None:
        shown, bright, things = [], [], model.text.things
        for wish in wishes:
            room = wish.room()
            sketch = room.seen(wish.view)
            shown.append(sketch.channels(room.place, things, model.codec))
            bright.append(model.expectation.drawn_offsets(room.place.finishes, things, wish.seed))
            flashing.append(flashes(room.place, sketch, room.moved(wish.view)))
        sampler = replace(sampler, spread=SPREAD * sampler.spread)
        sketches = np.stack(shown)
        guide = sketched(model, guide, sketches, [facts_of(wish.view) for wish in wishes], bright)
    drawn = draw(model, scheduler, sampler, tokens, against, noise, guide, progress)
    finished = model.polish(drawn, sketches)
    if guide.keep is not None:
        known = np.kron(guide.keep.cpu().numpy(), np.ones((1, 1, PATCH, PATCH))) > 0
        finished = np.where(known, drawn, finished)
    return _with_flashes(finished, flashing, model.codec) if flashing else finished


def _with_flashes(images: FloatArray, flashing: Sequence[Flashes], codec: PirCodec) -> FloatArray:
    """(image, 3, row, column) channels, no weaker than the flashes of each."""
    energy, reach = (np.stack(each) for each in zip(*flashing, strict=True))
    flash = codec.encode_arrays(energy, 2.0 / SPEED_OF_LIGHT * reach, np.zeros_like(energy), clip=True)
    stronger = (energy > 0) & (images[:, 2] > -2 / 3) & (flash[:, 0] > images[:, 0])
    images = images.copy()
    images[:, :2] = np.where(stronger[:, None], flash[:, :2], images[:, :2])
    return images
