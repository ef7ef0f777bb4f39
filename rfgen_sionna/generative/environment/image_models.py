"""Backends that draw images: the embedded model, or a Stable Diffusion base with an RF LoRA."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Protocol

import numpy as np
import torch
from torch import Tensor

from rfgen_sionna.generative.environment.environment_model import EnvironmentModel, read_model
from rfgen_sionna.generative.environment.image_generation import ImageRequest, generate_images, view_facts
from rfgen_sionna.generative.environment.image_sampling import Conditioning, DrawingOptions, noise_like
from rfgen_sionna.generative.environment.reprojection import NATIVE, empty_pir
from rfgen_sionna.generative.environment.requested_objects import is_empty
from rfgen_sionna.generative.environment.room_selection import PlaceRequest
from rfgen_sionna.generative.environment.torch_device import memory_errors, pick_device, precision
from rfgen_sionna.generative.environment.view_unet import make_scheduler
from rfgen_sionna.generative.furniture import LOOSE
from rfgen_sionna.pir.projection import Projection
from rfgen_sionna.pir.view import View
from rfgen_sionna.records import Pir

FOV_DEG: dict[Projection, tuple[float, float]] = {"perspective": (15.0, 110.0), "equirectangular": (15.0, 160.0)}
"""Fields of view of the embedded model [degrees]. Training views have 40 … 100 in perspective; layout maps extend
that."""


class UnknownThingWarning(UserWarning):
    """A negative prompt excludes an unknown object."""


class UnknownWordsWarning(UserWarning):
    """Words of a prompt have no meaning for a place."""


class AbsentThingWarning(UserWarning):
    """A prompt names an object that the drawn place lacks."""


class UnknownPlaceWarning(UserWarning):
    """A prompt names no known place."""


class ImageModel(Protocol):
    """Backend that draws PIRs."""

    def check_view(self, view: View) -> None:
        """Raise a ValueError for views that the backend cannot draw."""

    def draw(self, prompts: Sequence[str], seeds: Sequence[int], options: DrawingOptions) -> list[Pir]:
        """Static PIRs of one view, one for each prompt and seed."""


def load_image_model(
    model: str | Path | None,
    lora: str | Path | None,
    device: str | None,
    *,
    use_layout_map: bool | None = None,
    half: bool | None = None,
    compiled: bool = False,
) -> ImageModel:
    """Backend of a model; see
    :class:`~rfgen_sionna.generative.environment.environment_diffusion.EnvironmentDiffusion`."""
    if model is not None and not is_embedded(Path(model)):
        from rfgen_sionna.generative.environment.stable_diffusion import StableDiffusionModel

        if use_layout_map:
            raise ValueError(
                f"use_layout_map: {use_layout_map!r}; a Stable Diffusion base has no layout maps, leave it out"
            )
        return StableDiffusionModel(str(model), lora, pick_device(device), half=half, compiled=compiled)
    own = load_embedded(model, lora, device, half=half, compiled=compiled)
    return EmbeddedImageModel(own, use_layout_map is None or use_layout_map)


def load_embedded(
    model: str | Path | None,
    lora: str | Path | None,
    device: str | None,
    *,
    control: Path | bool | None = None,
    half: bool | None = None,
    compiled: bool = False,
) -> EnvironmentModel:
    """An environment model on its device, with its LoRA merged."""
    place = pick_device(device)
    own = read_model(None if model is None else Path(model), control)
    if lora is not None:
        from rfgen_sionna.generative.environment.adapters import load_lora

        own = replace(own, word=load_lora(own.unet, lora).word)
    with memory_errors(place):
        own.to(place, precision(place, half))
    if compiled:
        own.unet.compile()
        if own.control is not None:
            own.control.compile()
    return own


class EmbeddedImageModel:
    """Backend of the embedded model."""

    def __init__(self, model: EnvironmentModel, use_layout_map: bool = True) -> None:
        self.model, self.use_layout_map = model, use_layout_map
        self.scheduler = make_scheduler()

    def check_view(self, view: View) -> None:
        """Raise a ValueError for fields of view out of range."""
        low, high = FOV_DEG[view.projection]
        for name, angle in zip(("horizontal", "vertical"), view.fov_deg, strict=True):
            if not low <= angle <= high:
                wider = ""
                if view.projection == "perspective" and high < angle <= FOV_DEG["equirectangular"][1]:
                    wider = ", an equirectangular view up to {:g}".format(FOV_DEG["equirectangular"][1])
                raise ValueError(
                    f"fov_deg: {angle:.4g} degrees {name}; the environment model draws {low:g} … {high:g} in "
                    f"{view.projection} views{wider}"
                )

    def tokens(self, prompt: str, negative: str, view: View) -> tuple[Tensor, Tensor]:
        """(1, token, WIDTH) tokens of the prompt, and of the negative prompt for guidance."""
        text = self.model.text
        if not text.read(prompt).places:
            warnings.warn(
                f"environment prompt {prompt!r} names no place that the model knows; the nearest is taken: "
                f"{text.place_of(prompt)[0]} (of {', '.join(text.places)})",
                UnknownPlaceWarning,
                stacklevel=5,
            )
        facts = [view_facts(view)]
        words = f"{self.model.word} {prompt}".strip()
        return text.embed([words], facts), text.embed([negative], facts)

    def draw(self, prompts: Sequence[str], seeds: Sequence[int], options: DrawingOptions) -> list[Pir]:
        """Static PIRs of one view, one for each prompt and seed.

        Raises:
            ValueError: the view is outside the room of the first view.
        """
        view, sampler, negative = options.view, options.sampler, options.negative
        known, first, progress = options.known, options.first, options.progress
        each = [self.tokens(prompt, negative, view) for prompt in prompts]
        tokens, against = (torch.cat(parts) for parts in zip(*each, strict=True))
        conditioning = None
        if known is not None:
            latents, keep = self.encode(known.pir), torch.from_numpy(known.patches)[None, None]
            conditioning = Conditioning(known=latents.repeat(len(prompts), 1, 1, 1), keep=keep)
        noise = torch.cat([noise_like(1, self.model, seed) for seed in seeds])
        requests = None
        if self.use_layout_map:
            denied = self.model.text.read(negative)
            if denied.rest:
                warnings.warn(
                    f"negative prompt {negative!r}: {', '.join(map(repr, denied.rest))} names nothing that can be left "
                    "out of a place, and hardly changes the drawing",
                    UnknownThingWarning,
                    stacklevel=3,
                )
            wanted = [self.wanted(prompt, denied.things) for prompt in prompts]
            requests = [ImageRequest(request, view, seed, first) for request, seed in zip(wanted, seeds, strict=True)]
            if first is None:
                for prompt, request in zip(prompts, requests, strict=True):
                    self._warn_of_absent(prompt, request)
            else:
                for request in requests:
                    request.room().check(view)
        drawn = generate_images(
            self.model, self.scheduler, sampler, requests, tokens, against, noise, conditioning, progress=progress
        )
        like = empty_pir(view, np.zeros(NATIVE), np.zeros(NATIVE))
        return [replace(self.model.codec.decode(image, like), velocity=np.zeros(NATIVE)) for image in drawn]

    def wanted(self, prompt: str, without: tuple[str, ...]) -> PlaceRequest:
        """Requested place, objects and surfaces of a prompt, `without` some kinds."""
        text = self.model.text
        place, _ = text.place_of(prompt)
        said = text.read(prompt)
        surfaces = tuple((surface, finishes) for _, surface, finishes in said.surfaces)
        wanted = PlaceRequest(place, said.meant, without, surfaces)
        if not is_empty(prompt):
            return wanted
        return replace(wanted, without=(*without, *(kind for kind in LOOSE if not wanted.wants(kind))))

    def _warn_of_absent(self, prompt: str, request: ImageRequest) -> None:
        """Warn of requested objects that the drawn place or the view lacks."""
        room, read = request.room(), self.model.text.read(prompt)
        if read.places and read.lost:  # otherwise UnknownPlaceWarning
            warnings.warn(
                f"environment prompt {prompt!r}: {', '.join(map(repr, read.lost))} names no place, no furniture and no "
                "surface that is known, and hardly changes the drawing",
                UnknownWordsWarning,
                stacklevel=4,
            )
        made = request.wanted.made(room.place.finishes)
        otherwise = [said for (said, _, _), so in zip(read.surfaces, made, strict=True) if not so]
        if otherwise:
            warnings.warn(
                f"environment prompt {prompt!r}: no suitable layout has {', '.join(map(repr, otherwise))}",
                AbsentThingWarning,
                stacklevel=4,
            )
        words = [said for said, _ in read.words]
        for where, kinds in (("has", room.place.kinds), ("shows", room.layout_from(request.view).kinds(room.place))):
            absent = [said for said, met in zip(words, request.wanted.met(kinds), strict=True) if not met]
            if absent:
                warnings.warn(
                    f"environment prompt {prompt!r}: no suitable layout {where} "
                    f"{', '.join(map(repr, absent))}{' in this view' * (where == 'shows')}; the words alone hardly "
                    "change the drawing",
                    AbsentThingWarning,
                    stacklevel=4,
                )
                return

    def encode(self, pir: Pir) -> Tensor:
        """(1, latent, row, column) latents of a PIR; values are clipped to the convention's range."""
        image = torch.from_numpy(self.model.codec.encode(pir, clip=True))[None]
        vae = self.model.vae
        with torch.no_grad(), memory_errors(str(vae.device)):
            latents: Tensor = vae.encode(image.to(vae.device)).latent_dist.mode()
        return latents.float()


def is_embedded(path: Path) -> bool:
    """Whether a path is a file or folder of an embedded model, not of a diffusers pipeline."""
    if path.suffix == ".safetensors":
        return True
    return path.is_dir() and not (path / "model_index.json").is_file()
