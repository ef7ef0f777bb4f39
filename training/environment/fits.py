"""Parts of the model that are fitted, not trained: the autoencoder of patches, and what an image is expected to be."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache

import numpy as np
import torch
from numpy.typing import NDArray

from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.environment.autoencoder import PatchAutoencoder
from rfgen_sionna.generative.environment.conditional_prior import PURE, TERMS, ConditionalPrior, shares_of, terms
from rfgen_sionna.generative.environment.place_encoder import ViewFacts
from rfgen_sionna.generative.environment.reprojection import PATCH
from rfgen_sionna.pir.codec import PirCodec
from rfgen_sionna.scene.furnished import furnished
from rfgen_sionna.scene.furnished.finishes import FINISHES
from training.environment.view_corpus import ViewCorpus

_VIEWS = 2500
"""Training views that it is fitted to."""
_RIDGE = 30.0
"""Pixels' worth of doubt."""
_ENOUGH = 20
"""Pixels of a kind from which its brightness is measured."""
_UNFINISHED = 1.0
"""Views' worth of doubt whether the finish matters."""


def fit_autoencoder(images: FloatArray, latents: int, whitening: float = 0.5) -> PatchAutoencoder:
    """An autoencoder fitted on images (image, channels, row, column).

    Args:
        images: what it should be able to draw.
        latents: components kept.
        whitening: 0 leaves the components their own spread, 1 gives each the same. In between, what is small in
            the image is small in the latents too: it is settled in the last steps of sampling, once the coarse is
            known, and errors of the network cost it less.
    """
    channels = images.shape[1]
    own = PatchAutoencoder(channels, channels, latents, sample_size=images.shape[-1])
    total, square, count = 0.0, 0.0, 0
    for part in np.array_split(images, max(1, len(images) // 256)):
        x = torch.nn.functional.pixel_unshuffle(torch.from_numpy(np.ascontiguousarray(part)).double(), PATCH)
        rows = x.movedim(1, -1).reshape(-1, channels * PATCH**2).numpy()
        total, square, count = total + rows.sum(axis=0), square + rows.T @ rows, count + len(rows)
    mean = np.asarray(total) / count
    values, vectors = np.linalg.eigh(np.asarray(square) / count - np.outer(mean, mean))
    keep = np.argsort(values)[::-1][:latents]
    spread = np.sqrt(np.maximum(values[keep], 1e-12))
    scale = spread**whitening
    scale *= np.sqrt(np.mean((spread / scale) ** 2))
    own.mean.copy_(torch.from_numpy(mean))
    own.components.copy_(torch.from_numpy(np.ascontiguousarray(vectors[:, keep])))
    own.scale.copy_(torch.from_numpy(scale))
    return own


def fit_conditional_prior(
    corpus: ViewCorpus, kinds: int, vae: PatchAutoencoder, codec: PirCodec, seed: int = 0
) -> ConditionalPrior:
    """Least squares over training views, for as many `kinds`, of which the corpus's things are the first; kinds
    that were hardly seen come out as the mean over all. What things are made of is known of corpora of furnished
    places."""
    if corpus.layout_maps is None:
        raise ValueError("data: the layout maps were not read")
    some = np.random.default_rng([seed, 47]).permutation(len(corpus))[:_VIEWS]
    some = np.sort(some).tolist()  # views of one layout follow each other
    squares, products = np.zeros((kinds, TERMS, TERMS)), np.zeros((kinds, TERMS, 3))
    for i in some:
        layout_map = corpus.layout_maps[i].astype(np.float64)
        told = terms(layout_map, corpus.views[i], codec).reshape(-1, TERMS)
        channels = corpus.images[i].astype(np.float64).reshape(3, -1).T
        kind = layout_map[-1].ravel().astype(np.intp)
        for k in np.unique(kind):
            mine = told[kind == k]
            squares[k] += mine.T @ mine
            products[k] += mine.T @ channels[kind == k]
    everything = squares.sum(axis=0)
    whole = np.linalg.solve(everything + 1e-3 * np.eye(TERMS), products.sum(axis=0))
    confidence_gate = _RIDGE * everything / max(everything[0, 0], 1.0) + 1e-6 * np.eye(TERMS)
    fitted = zip(squares + confidence_gate, products + confidence_gate @ whole, strict=True)
    planes = np.stack([np.linalg.solve(square, product) for square, product in fitted])
    latents, names = vae.config.latent_channels, tuple(FINISHES)
    none = np.zeros((kinds, latents))
    flat = ConditionalPrior(planes, np.zeros((2, 1 + len(names), kinds)), none, none, names)
    moments = np.zeros((3, 1 + len(names), kinds))
    every = np.arange(kinds)
    sums, counts = np.zeros((2, kinds, latents)), np.zeros((2, kinds))
    for i in some:
        layout_map, image = corpus.layout_maps[i].astype(np.float32), corpus.images[i].astype(np.float32)
        bright = brightness_offsets(flat, image, layout_map, corpus.views[i], codec)
        layout = None if corpus.layouts is None else int(corpus.layouts[i])
        made_of = {} if layout is None else _finishes_of(corpus.names[corpus.places[i]], layout)
        moments[:, flat.rows(made_of, corpus.things), every] += [bright != 0, bright, bright**2]
        apart = torch.from_numpy(image - flat.image(layout_map, corpus.views[i], codec, bright))[None]
        with torch.no_grad():
            size = (vae.encode(apart).latent_dist.mode() - vae.encode(0 * apart).latent_dist.mode())[0].square()
        shares = shares_of(layout_map[-1], kinds)
        mixed = shares.max(axis=0) < PURE
        for which, where in enumerate((~mixed, mixed)):
            sums[which] += shares[:, where] @ size.numpy()[:, where].T
            counts[which] += shares[:, where].sum(axis=1)
    mean = sums.sum(axis=1, keepdims=True) / np.maximum(counts.sum(axis=1)[:, None, None], 1.0)
    within, between = (sums + 2.0 * mean) / (counts[..., None] + 2.0)
    return ConditionalPrior(planes, _moments(moments), within, between, names)


@lru_cache(maxsize=256)
def _finishes_of(place: str, layout: int) -> Mapping[str, str]:
    """What the things of a layout are made of."""
    return furnished(place, layout).finishes


def _moments(sums: FloatArray) -> FloatArray:
    """(2, 1 + finish, kind) mean and spread from (3, 1 + finish, kind) counts, sums and sums of squares; the first row
    becomes those of all, which have their part where there is hardly any of a kind in a finish."""
    sums[:, 0] = sums.sum(axis=1)
    many = np.maximum(sums[0, 0], 1.0)
    sums = sums + _UNFINISHED * np.stack([np.ones_like(many), sums[1, 0] / many, sums[2, 0] / many])[:, None]
    mean = sums[1] / sums[0]
    return np.stack([mean, np.sqrt(np.maximum(sums[2] / sums[0] - mean**2, 0.0))])


def brightness_offsets(
    prior: ConditionalPrior,
    image: NDArray[np.floating],
    layout_map: NDArray[np.floating],
    facts: ViewFacts,
    codec: PirCodec,
) -> FloatArray:
    """(kind,) brightness of each kind in an image over that of its plane; 0 for kinds of few pixels.

    Args:
        prior: planes of all kinds.
        image: (3, row, column) channels.
        layout_map: (CHANNELS, row, column).
        facts: the view.
        codec: convention of the channels.
    """
    plain = prior.image(layout_map, facts, codec, np.zeros(len(prior.planes)))
    kind, there = layout_map[-1].astype(np.intp).ravel(), (image[2] > -2 / 3).ravel()
    count = np.bincount(kind[there], minlength=len(prior.planes))
    total = np.bincount(kind[there], (image[0] - plain[0]).ravel()[there], minlength=len(prior.planes))
    return np.where(count >= _ENOUGH, total / np.maximum(count, 1), 0.0)
