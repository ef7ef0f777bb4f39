"""Conditional prior: expected image for a layout map, and spread of latents about it.

For each kind of object: a plane fitted to training views, its brightness in each finish, and the variance of latents.
The network draws the difference from this expectation.
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
"""Terms of a plane: 1, ranges of primitive and shell, cosine and its square, levels by range of both, presence of a
shell."""
PURE = 0.99
"""Least share of one kind in a pure patch."""
_LEAST_RANGE = 0.3
"""Range below which levels stop growing [m]; bounds the near field."""
TABLES = ("planes", "brighter", "within", "between")
"""Arrays of a prior in a model file."""
LEAST_SPREAD = 0.03
"""Least standard deviation of a latent; bounds the normalisation."""


@dataclass(frozen=True)
class LatentPrior:
    """Prior of the latents of some images."""

    mean: Tensor
    """(image, latent, row, column)"""
    spread: Tensor
    """(image, latent, row, column) standard deviations."""


@dataclass(frozen=True)
class ConditionalPrior:
    """Statistics of training views. The first kind is unknown or empty; the others count as in layout maps."""

    planes: FloatArray
    """(kind, TERMS, 3) coefficients of the channels of energy, range and validity."""
    brighter: FloatArray
    """(2, 1 + finish, kind) mean and spread, over views, of a kind's brightness above its plane in the channel of
    energy: for any finish, and for each."""
    within: FloatArray
    """(kind, latent) variance of latents of pure patches."""
    between: FloatArray
    """(kind, latent) variance of latents of mixed patches."""
    finishes: tuple[str, ...] = ()
    """Names of the finishes."""

    def image(
        self, layout_map: NDArray[np.floating], facts: ViewFacts, codec: PirCodec, bright: FloatArray
    ) -> NDArray[np.float32]:
        """(3, row, column) expected channels of a layout map (CHANNELS, row, column), with the energy of each kind
        raised by `bright` (kind,)."""
        kind = layout_map[-1].astype(np.intp)
        channels = np.einsum("rct,rctk->krc", terms(layout_map.astype(np.float64), facts, codec), self.planes[kind])
        channels[0] += bright[kind]
        return channels.clip(-1.0, 1.0).astype(np.float32)

    def rows(self, made_of: Mapping[str, str], things: Sequence[str]) -> NDArray[np.intp]:
        """(kind,) row of `brighter` of each kind, from the names of kinds, `things`, and their finish, `made_of`; the
        first row for unknown finishes."""
        known = {name: number for number, name in enumerate(self.finishes, start=1)}
        rows = np.zeros(len(self.planes), np.intp)
        rows[1 : 1 + len(things)] = [known.get(made_of.get(thing, ""), 0) for thing in things]
        return rows

    def sample_brightness(self, made_of: Mapping[str, str], things: Sequence[str], seed: int) -> FloatArray:
        """(kind,) brightness of each kind for its finish; the remaining spread is drawn from the seed."""
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
        """Prior of layout maps (image, CHANNELS, row, column) with brightnesses (kind,) each.

        Raises:
            ValueError: an image has no layout map.
        """
        if any((layout_map[-1] == NO_LAYOUT_MAP).all() for layout_map in layout_maps):
            raise ValueError("layout_maps: one of the images has none; draw it without the prior")
        each = zip(layout_maps, views, bright, strict=True)
        images = np.stack([self.image(layout_map, facts, codec, own) for layout_map, facts, own in each])
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

    @classmethod
    def from_tables(cls, tables: Mapping[str, FloatArray], finishes: Sequence[str]) -> ConditionalPrior:
        """From the arrays of a file."""
        return cls(**{name: np.asarray(tables[name], np.float64) for name in TABLES}, finishes=tuple(finishes))


def shares_of(kind: NDArray[np.floating], kinds: int) -> FloatArray:
    """(kind, row / PATCH, column / PATCH) share of each kind in each patch."""
    rows, columns = kind.shape[0] // PATCH, kind.shape[1] // PATCH
    patches = kind.astype(np.intp).reshape(rows, PATCH, columns, PATCH).swapaxes(1, 2).reshape(rows * columns, PATCH**2)
    index = np.arange(rows * columns)[:, None] * kinds + patches
    counts = np.bincount(index.ravel(), minlength=rows * columns * kinds).reshape(rows, columns, kinds)
    return np.moveaxis(counts / PATCH**2, -1, 0)


def terms(layout_map: FloatArray, facts: ViewFacts, codec: PirCodec) -> FloatArray:
    """(row, column, TERMS) terms of the planes for a layout map (CHANNELS, row, column)."""
    rows, columns = layout_map.shape[1:]
    angle = facts.view((rows, columns)).solid_angles
    low, high = codec.energy_db

    def level(channel: FloatArray) -> FloatArray:
        """Level of a surface of 1 per steradian at 1 m, relative to the middle of the convention."""
        reach = np.maximum(codec.distance(channel), _LEAST_RANGE)
        return np.asarray(2.0 / (high - low) * (10 * np.log10(angle) - 20 * np.log10(reach)))

    primitive, shell, cosine = layout_map[:3]
    there = (shell < 1.0).astype(np.float64)
    return np.stack(
        [np.ones_like(primitive), primitive, shell, cosine, cosine**2, level(primitive), level(shell) * there, there],
        axis=-1,
    )
