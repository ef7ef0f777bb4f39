"""Finished images of surroundings from tokens: layout maps, sampling, smoothing, specular plate returns."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from rfgen_sionna._types import SPEED_OF_LIGHT, FloatArray
from rfgen_sionna.generative.environment.environment_model import EnvironmentModel, ModelFileError
from rfgen_sionna.generative.environment.image_sampling import Conditioning, ImageSampler, sample_images
from rfgen_sionna.generative.environment.place_encoder import ViewFacts
from rfgen_sionna.generative.environment.reprojection import PATCH
from rfgen_sionna.generative.environment.room_selection import PlaceRequest, Room, choose_room
from rfgen_sionna.generative.environment.specular_plates import SpecularReturns, specular_plate_returns
from rfgen_sionna.pir.codec import PirCodec
from rfgen_sionna.pir.view import View

SPREAD = 0.5
"""Factor on the sampler's noise over a layout map: the network overestimates the remaining variance."""


@dataclass(frozen=True)
class ImageRequest:
    """Request for one image."""

    wanted: PlaceRequest
    view: View
    seed: int
    first: View | None = None
    """First view of the place; None for the first view itself."""
    anywhere: bool = False
    """Whether the radar may stand anywhere in the place."""

    def room(self) -> Room:
        """The place that the image is drawn over."""
        return choose_room(self.wanted, self.first or self.view, self.seed, anywhere=self.anywhere)


def view_facts(view: View) -> ViewFacts:
    """Description of a view for the embedded model; the floor is z = 0."""
    yaw, pitch, roll = view.orientation
    return ViewFacts(view.fov_deg, view.position[2], pitch, yaw, roll, view.projection)


def with_layout_maps(
    model: EnvironmentModel,
    conditioning: Conditioning,
    layout_maps: NDArray[np.float32],
    views: Sequence[ViewFacts],
    bright: Sequence[FloatArray],
) -> Conditioning:
    """Conditioning with layout maps (image, CHANNELS, row, column) and their prior with brightnesses (kind,) each.

    Raises:
        ModelFileError: the model reads no layout maps.
    """
    if model.conditional_prior is None:
        raise ModelFileError("model: it reads no layout maps; train one with training.environment.train")
    expected = model.conditional_prior.of(layout_maps, views, bright, model.vae, model.codec)
    return replace(conditioning, layout_map=torch.from_numpy(layout_maps), expected=expected)


def generate_images(
    model: EnvironmentModel,
    scheduler: Any,
    sampler: ImageSampler,
    requests: Sequence[ImageRequest] | None,
    tokens: Tensor,
    against: Tensor,
    noise: Tensor,
    conditioning: Conditioning | None = None,
    *,
    progress: Callable[[int, int], None] | None = None,
) -> FloatArray:
    """(image, 3, row, column) finished images, each over the layout map of its request, or from words alone for
    `requests=None`; the other arguments are those of :func:`sample_images`."""
    conditioning, layout_maps = conditioning or Conditioning(), None
    specular: list[SpecularReturns] = []
    if requests is not None and model.conditional_prior is not None:
        shown, bright, things = [], [], model.text.things
        for request in requests:
            room = request.room()
            layout_map = room.layout_from(request.view)
            shown.append(layout_map.channels(room.place, things, model.codec))
            bright.append(model.conditional_prior.sample_brightness(room.place.finishes, things, request.seed))
            specular.append(specular_plate_returns(room.place, layout_map, room.moved(request.view)))
        sampler = replace(sampler, spread=SPREAD * sampler.spread)
        layout_maps = np.stack(shown)
        conditioning = with_layout_maps(
            model, conditioning, layout_maps, [view_facts(request.view) for request in requests], bright
        )
    drawn = sample_images(model, scheduler, sampler, tokens, against, noise, conditioning, progress)
    finished = model.edge_smoothing(drawn, layout_maps)
    if conditioning.keep is not None:
        known = np.kron(conditioning.keep.cpu().numpy(), np.ones((1, 1, PATCH, PATCH))) > 0
        finished = np.where(known, drawn, finished)
    return _with_specular_returns(finished, specular, model.codec) if specular else finished


def _with_specular_returns(images: FloatArray, specular: Sequence[SpecularReturns], codec: PirCodec) -> FloatArray:
    """(image, 3, row, column) channels, at least as strong as the specular plate returns."""
    energy, reach = (np.stack(each) for each in zip(*specular, strict=True))
    specular_return = codec.encode_arrays(energy, 2.0 / SPEED_OF_LIGHT * reach, np.zeros_like(energy), clip=True)
    stronger = (energy > 0) & (images[:, 2] > -2 / 3) & (specular_return[:, 0] > images[:, 0])
    images = images.copy()
    images[:, :2] = np.where(stronger[:, None], specular_return[:, :2], images[:, :2])
    return images
