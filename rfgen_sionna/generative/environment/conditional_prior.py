"""What an image is expected to be, given a sketch, and how far images stray from that.

A wall is where its brick is and returns what walls do at that range and incidence; of a tree's brick a part is sky. For
each kind of thing there is a plane through what training views were, how bright it is in each finish, and the spread of
each latent on what it covers. A network has to draw how an image differs from this: nothing on most of a wall, much
where things end.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.environment.layout_map import NO_LAYOUT_MAP
from rfgen_sionna.generative.environment.reprojection import PATCH
from rfgen_sionna.pir.codec import PirCodec

if TYPE_CHECKING:
    from rfgen_sionna.generative.environment.autoencoder import PatchAutoencoder
    from rfgen_sionna.generative.environment.place_encoder import ViewFacts

TERMS = 8
"""Of the plane: 1, ranges of brick and shell, cosine and its square, levels by range of both, whether there is a
shell."""
PURE = 0.99
"""Share of a patch from which it counts as of one kind."""
_LEAST_RANGE = 0.3
"""Range under which levels don't grow any more [m]."""
LEAST_SPREAD = 0.03
"""Of a latent."""


@dataclass(frozen=True)
class LatentPrior:
    """Of some images, as latents."""

    mean: Tensor
    """(image, latent, row, column)"""
    spread: Tensor
    """(image, latent, row, column) standard deviations."""


@dataclass(frozen=True)
class ConditionalPrior:
    """What training views were. The first kind is another, or nothing; the others count as in sketches."""

    planes: FloatArray
    """(kind, TERMS, 3) to the channels of energy, range and validity."""
    brighter: FloatArray
    """(2, 1 + finish, kind) mean and spread, over views, of how much brighter all of a kind is than the plane says, in
    the channel of energy: whatever its finish, and in each of them."""
    within: FloatArray
    """(kind, latent) variance of latents where a patch shows one kind."""
    between: FloatArray
    """(kind, latent) variance where it shows several."""
    finishes: tuple[str, ...] = ()
    """Names of the finishes."""

    def image(
        self, layout_map: NDArray[np.floating], facts: ViewFacts, codec: PirCodec, bright: FloatArray
    ) -> NDArray[np.float32]:
        """(3, row, column) channels for a sketch (CHANNELS, row, column), with each kind brighter by `bright` (kind,),
        in the channel of energy."""
        kind = layout_map[-1].astype(np.intp)
        channels = np.einsum("rct,rctk->krc", terms(layout_map.astype(np.float64), facts, codec), self.planes[kind])
        channels[0] += bright[kind]
        return channels.clip(-1.0, 1.0).astype(np.float32)

    def rows(self, made_of: Mapping[str, str], things: Sequence[str]) -> NDArray[np.intp]:
        """(kind,) which row of `brighter` each kind is in, by the names of the first kinds, `things`, and what each is
        `made_of`; the first where that isn't known."""
        known = {name: number for number, name in enumerate(self.finishes, start=1)}
        rows = np.zeros(len(self.planes), np.intp)
        rows[1 : 1 + len(things)] = [known.get(made_of.get(thing, ""), 0) for thing in things]
        return rows

    def sample_brightness(self, made_of: Mapping[str, str], things: Sequence[str], seed: int) -> FloatArray:
        """(kind,) how bright each kind is where things are `made_of` that; what the finish leaves open is drawn."""
        rng = np.random.default_rng([seed, 109])
        mean, spread = self.brighter[:, self.rows(made_of, things), np.arange(len(self.planes))]
        return np.asarray(mean + spread * np.clip(rng.standard_normal(len(mean)), -2.5, 2.5))

    def of(
        self,
        layout_maps: NDArray[np.floating],
        views: Sequence[ViewFacts],
        bright: Sequence[FloatArray],
        vae: PatchAutoencoder,
        codec: PirCodec,
    ) -> LatentPrior:
        """For sketches (image, CHANNELS, row, column) with brightnesses (kind,) each.

        Raises:
            ValueError: one of the images has no sketch.
        """
        if any((layout_map[-1] == NO_LAYOUT_MAP).all() for layout_map in layout_maps):
            raise ValueError("sketches: one of the images has none")
        told = zip(layout_maps, views, bright, strict=True)
        images = np.stack([self.image(layout_map, facts, codec, own) for layout_map, facts, own in told])
        variances = []
        for layout_map in layout_maps:
            shares = shares_of(layout_map[-1], len(self.within))
            mixed = shares.max(axis=0) < PURE
            variances.append(np.where(mixed, *(np.tensordot(x, shares, (0, 0)) for x in (self.between, self.within))))
        device = vae.device
        with torch.no_grad():
            mean: Tensor = vae.encode(torch.from_numpy(images).to(device)).latent_dist.mode()
        spread = np.maximum(np.sqrt(np.stack(variances)), LEAST_SPREAD).astype(np.float32)
        return LatentPrior(mean.float(), torch.from_numpy(spread).to(device))

    @property
    def tables(self) -> dict[str, FloatArray]:
        """Everything, for a file."""
        return {name: getattr(self, name) for name in _TABLES}

    @classmethod
    def from_tables(cls, tables: Mapping[str, FloatArray], finishes: Sequence[str]) -> ConditionalPrior:
        """From what a file holds."""
        return cls(**{name: np.asarray(tables[name], np.float64) for name in _TABLES}, finishes=tuple(finishes))


_TABLES = ("planes", "brighter", "within", "between")


def shares_of(kind: NDArray[np.floating], kinds: int) -> FloatArray:
    """(kind, row / PATCH, column / PATCH) share of each patch."""
    rows, columns = kind.shape[0] // PATCH, kind.shape[1] // PATCH
    patches = kind.astype(np.intp).reshape(rows, PATCH, columns, PATCH).swapaxes(1, 2).reshape(rows * columns, PATCH**2)
    index = np.arange(rows * columns)[:, None] * kinds + patches
    counts = np.bincount(index.ravel(), minlength=rows * columns * kinds).reshape(rows, columns, kinds)
    return np.moveaxis(counts / PATCH**2, -1, 0)


def terms(layout_map: FloatArray, facts: ViewFacts, codec: PirCodec) -> FloatArray:
    """(row, column, TERMS) what planes are laid through, of a sketch (CHANNELS, row, column)."""
    rows, columns = layout_map.shape[1:]
    angle = facts.view((rows, columns)).solid_angles
    low, high = codec.energy_db

    def level(channel: FloatArray) -> FloatArray:
        """Of a surface of 1 per steradian at 1 m, relative to the middle of the convention."""
        reach = np.maximum(codec.distance(channel), _LEAST_RANGE)
        return np.asarray(2.0 / (high - low) * (10 * np.log10(angle) - 20 * np.log10(reach)))

    primitive, shell, cosine = layout_map[:3]
    there = (shell < 1.0).astype(np.float64)
    return np.stack(
        [np.ones_like(primitive), primitive, shell, cosine, cosine**2, level(primitive), level(shell) * there, there],
        axis=-1,
    )
