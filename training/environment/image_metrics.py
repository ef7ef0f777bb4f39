"""What is measured on images of surroundings, drawn beside rendered. Sets of arrays (image, row, column)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import sqrtm
from scipy.stats import wasserstein_distance

from rfgen_sionna._types import SPEED_OF_LIGHT, FloatArray
from rfgen_sionna.generative.environment.place_encoder import ViewFacts
from rfgen_sionna.pir.codec import PirCodec

LAW_BINS = np.arange(1.0, 8.5 + 0.25, 0.5)
"""Edges of the ranges in which levels are compared [m]."""
FARTHEST = 10.0
"""Ranges beyond it don't count in the histogram [m]: indoor radars end there, and a street's end would drown rooms."""
BEND = 0.01
"""Second difference of range, relative to range, up to which a pixel counts as smooth."""


@dataclass(frozen=True)
class Physical:
    """Images in physical units."""

    level: FloatArray
    """(image, row, column) energy [dB], NaN where nothing returns."""
    range: FloatArray
    """(image, row, column) [m], NaN where nothing returns."""

    @classmethod
    def of(cls, channels: NDArray[np.floating], codec: PirCodec) -> Physical:
        """Of images (image, 3, row, column) in −1 … 1."""
        energy, arrival, _ = codec.decode_arrays(np.asarray(channels, dtype=np.float64), clip=True)
        level = 10 * np.log10(np.where(energy > 0, energy, np.nan))
        return cls(level, 0.5 * SPEED_OF_LIGHT * arrival)


def range_distance(a: Physical, b: Physical, farthest: float = FARTHEST) -> float:
    """Wasserstein distance [m] of the pixels' ranges up to `farthest`."""
    x, y = (np.asarray(p.range[p.range <= farthest]) for p in (a, b))
    return float(wasserstein_distance(x, y))


def range_law(x: Physical) -> FloatArray:
    """(bin,) mean level [dB] of the pixels in each range bin of `LAW_BINS`; NaN where there are fewer than 100."""
    out = []
    for low, high in pairwise(LAW_BINS.tolist()):
        inside = (x.range >= low) & (x.range < high)
        out.append(float(x.level[inside].mean()) if inside.sum() >= 100 else np.nan)
    return np.array(out)


def law_distance(a: Physical, b: Physical) -> float:
    """Mean difference [dB] of two laws of level against range, without regard to sign."""
    return float(np.nanmean(np.abs(range_law(a) - range_law(b))))


def smooth_share(x: Physical) -> float:
    """Share of the returning pixels whose surface doesn't bend: second differences of range along rows and columns."""
    r = x.range
    middle = r[:, 1:-1, 1:-1]
    across = np.abs(r[:, 1:-1, 2:] + r[:, 1:-1, :-2] - 2 * middle)
    down = np.abs(r[:, 2:, 1:-1] + r[:, :-2, 1:-1] - 2 * middle)
    known = np.isfinite(across) & np.isfinite(down)
    return float(((across < BEND * middle) & (down < BEND * middle))[known].mean())


def nearest(images: NDArray[np.floating], bank: NDArray[np.floating]) -> FloatArray:
    """(image,) rms distance of each image's channels to the nearest of the bank."""
    own = bank.reshape(len(bank), -1).astype(np.float32)
    square = np.einsum("ij,ij->i", own, own)
    rows = images.reshape(len(images), -1).astype(np.float32)
    cross = rows @ own.T
    closest = own[np.argmin(square - 2 * cross, axis=1)]
    return np.asarray(np.sqrt(np.mean((rows - closest) ** 2, axis=1)), dtype=np.float64)


def floor_share(x: Physical, views: Sequence[ViewFacts], tolerance: float = 0.05) -> float:
    """Share of the pixels in the lowest eighth of each image that lie on the floor, within `tolerance` of their range.

    Where the floor is seen follows from field of view, direction and height alone: an image that ignores one of them
    has it elsewhere. Views that don't look down all over there are left out.
    """
    rows, columns = x.range.shape[1:]
    low = np.s_[-(rows // 8) :]
    shares = []
    for reach, facts in zip(x.range, views, strict=True):
        up = facts.view((rows, columns)).directions[low][..., 2]
        if up.max() <= -0.1:
            expected = facts.height / -up
            with np.errstate(invalid="ignore"):
                shares.append(float((np.abs(reach[low] - expected) < tolerance * expected).mean()))
    return float(np.mean(shares)) if shares else float("nan")


def correctly_named(
    probabilities: FloatArray, places: NDArray[np.integer], together: NDArray[np.integer] | None = None
) -> NDArray[np.bool_]:
    """(image,) whether each image is classified as its place.

    Args:
        probabilities: (image, class) log probabilities.
        places: (image,) true classes.
        together: (image,) number of the place whose views are classified together; None classifies each alone.
    """
    if together is not None:
        _, which = np.unique(np.stack([together, places]), axis=1, return_inverse=True)
        sums = np.zeros((int(which.max()) + 1, probabilities.shape[1]))
        np.add.at(sums, which.ravel(), probabilities)
        probabilities = sums[which.ravel()]
    return np.asarray(probabilities.argmax(axis=-1) == places)


def frechet(a: FloatArray, b: FloatArray) -> float:
    """Fréchet distance of two sets of (n, k) features, each taken as a normal distribution."""
    mean = np.sum((a.mean(axis=0) - b.mean(axis=0)) ** 2)
    ca, cb = (np.cov(x, rowvar=False) for x in (a, b))
    root = np.real(sqrtm(ca @ cb))
    return float(mean + np.trace(ca + cb - 2.0 * root))
