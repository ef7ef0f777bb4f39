"""The data set as the image models see it: pictures, sentences, views."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from rfgen_sionna._types import IntArray
from rfgen_sionna.generative.environment.place_encoder import ViewFacts
from rfgen_sionna.pir.codec import PirCodec
from rfgen_sionna.pir.projection import check_projection
from training.environment.pir_data import PLACES
from training.environment.place_captions import caption
from training.environment.place_text import Sentence

if TYPE_CHECKING:
    from rfgen_sionna.generative.environment.autoencoder import PatchAutoencoder
    from training.environment.pir_data import PirData

_SAID = 0.25
"""Share of the sentences that the data set itself holds; the others are worded anew each time."""


@dataclass(frozen=True)
class ViewCorpus:
    """Views, in memory."""

    images: NDArray[np.float16]
    """(view, 3, row, column) channels of :class:`PirCodec`."""
    places: NDArray[np.intp]
    """(view,) index into `names`."""
    names: tuple[str, ...]
    """Of the places."""
    objects: list[list[str]]
    """What is in view, for each view."""
    captions: list[str]
    views: list[ViewFacts]
    incomplete: NDArray[np.float16] | None = None
    """(view, 3, row, column) of pairs: what a hurried tracer would have seen."""
    layout_maps: NDArray[np.float16] | None = None
    """(view, CHANNELS, row, column) of :mod:`.layout_map`; kinds are numbered as `things`."""
    layouts: IntArray | None = None
    """(view,) seeds of the furnished places."""

    def __len__(self) -> int:
        return len(self.views)

    @property
    def lacking(self) -> NDArray[np.float16]:
        """(view, 3, row, column) the incomplete images.

        Raises:
            ValueError: there are none.
        """
        if self.incomplete is None or not len(self):
            raise ValueError(
                "data: pairs of incomplete and complete views are needed (training.environment.render --kind pairs)"
            )
        return self.incomplete

    @cached_property
    def things(self) -> tuple[str, ...]:
        """Every kind of furniture in view anywhere, sorted."""
        return _things(self.objects)

    def image(self, index: int, mirrored: bool) -> NDArray[np.float32]:
        """(3, row, column) of one view, or its mirror image."""
        x = self.images[index].astype(np.float32)
        return x[..., ::-1] if mirrored else x

    def layout_map(self, index: int, mirror: bool) -> NDArray[np.float32]:
        """(CHANNELS, row, column) of one view, or of its mirror image.

        Raises:
            ValueError: the layout maps were not read.
        """
        if self.layout_maps is None:
            raise ValueError("data: the layout maps were not read")
        x = self.layout_maps[index].astype(np.float32)
        return mirrored_layout_map(x) if mirror else x

    def sentence(self, index: int, rng: np.random.Generator) -> str:
        """A wording for one view."""
        if rng.uniform() < _SAID:
            return self.captions[index]
        return caption(self.names[self.places[index]], self.objects[index], rng)

    def draw(self, rng: np.random.Generator) -> Sentence:
        """A sentence and what it says, of any view."""
        index = int(rng.integers(len(self)))
        place, seen = self.names[self.places[index]], self.objects[index]
        kept = [thing for thing in seen if rng.uniform() < 0.6]
        text = caption(place, kept, rng)
        said = tuple(thing for thing in self.things if thing in text)
        return Sentence(text, int(self.places[index]), said)

    def view(self, index: int, mirrored: bool) -> ViewFacts:
        """How one view, or its mirror image, looks at its place."""
        return mirrored_facts(self.views[index]) if mirrored else self.views[index]

    def latents(self, vae: PatchAutoencoder, *, incomplete: bool = False) -> Tensor:
        """(2, view, latent, row, column) of the images and of their mirror images, half precision.

        Raises:
            ValueError: the incomplete images are asked for and there are none.
        """
        images = self.lacking if incomplete else self.images
        out = []
        with torch.no_grad():
            for mirrored in (False, True):
                parts = []
                for start in range(0, len(self), 256):
                    x = images[start : start + 256].astype(np.float32)
                    x = np.ascontiguousarray(x[..., ::-1]) if mirrored else x
                    parts.append(vae.encode(torch.from_numpy(x)).latent_dist.mode().half())
                out.append(torch.cat(parts))
        return torch.stack(out)


def read_corpus(data: PirData, codec: PirCodec, *, pairs: bool = False, use_layout_map: bool = False) -> ViewCorpus:
    """All views of `data` as channels, with their sketches if `use_layout_map`.

    Energies, ranges and velocities beyond the convention are held at its ends.

    Raises:
        ValueError: `data` is empty.
    """
    if not len(data):
        raise ValueError("data: no views are left; render some, or choose another split or place")
    if pairs and data.kind != "pairs":
        raise ValueError(
            f"data: {str(data.folder)!r} holds single views; render pairs (training.environment.render --kind pairs)"
        )
    images, before, layout_maps = [], [], []
    things = _things(data.objects)
    for start in range(0, len(data), 256):
        index = np.arange(start, min(start + 256, len(data)))
        images.append(
            codec.encode_arrays(
                data.energy(index), data.time_of_arrival(index), data.velocity(index), clip=True
            ).astype(np.float16)
        )
        if use_layout_map:
            layout_maps.append(data.layout_maps(things, codec, index).astype(np.float16))
        if pairs:
            before.append(codec.encode_arrays(*data.incomplete(index), clip=True).astype(np.float16))
    views = [
        ViewFacts((float(f[0]), float(f[1])), float(h), float(p), float(y), float(r), check_projection(shape))
        for f, h, p, y, r, shape in zip(
            data.fov_deg, data.height, data.pitch, data.yaw, data.roll, data.projection, strict=True
        )
    ]
    return ViewCorpus(
        np.concatenate(images),
        np.asarray(data.places, dtype=np.intp),
        PLACES,
        [list(row) for row in data.objects],
        list(data.captions),
        views,
        np.concatenate(before) if pairs else None,
        np.concatenate(layout_maps) if use_layout_map else None,
        data.layout,
    )


def _things(objects: list[list[str]]) -> tuple[str, ...]:
    return tuple(sorted({thing for row in objects for thing in row}))


def mirrored_layout_map(layout_map: NDArray[np.float32]) -> NDArray[np.float32]:
    """Layout maps (…, CHANNELS, row, column) with reversed columns."""
    out = np.array(layout_map[..., ::-1])
    out[..., 3, :, :] *= -1.0
    return out


def mirrored_facts(view: ViewFacts) -> ViewFacts:
    """View of the image with reversed columns."""
    return replace(view, yaw=-view.yaw, roll=-view.roll)
