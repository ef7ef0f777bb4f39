"""A piece of furniture: its parts, and the floor that it takes."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from rfgen_sionna.scene.furnished.shapes import Part, joined, tube


@dataclass(frozen=True, eq=False)
class Piece:
    """Something that is placed as a whole. In its own frame it stands on z = 0 about the origin, with its back towards
    -y and its front towards +y."""

    kind: str
    """Noun of a caption: "sofa"."""
    parts: tuple[Part, ...]
    """One of each finish."""
    width: float
    """Extent along x that must stay free of others [m], centred."""
    depth: float
    """The same along y [m]."""
    bottom: float
    """Lowest height [m]."""
    top: float
    """Greatest height [m]."""


def piece(kind: str, parts: Iterable[Part], footprint: tuple[float, float] | None = None) -> Piece:
    """A piece from any number of parts, centred on its footprint (width, depth) [m]; None takes that of the parts."""
    merged = merge(parts)
    points = np.concatenate([part.points for part in merged])
    low, high = points.min(axis=0), points.max(axis=0)
    if footprint is None:
        middle = 0.5 * (low + high)
        merged = [part.at(-middle[0], -middle[1]) for part in merged]
        footprint = float(high[0] - low[0]), float(high[1] - low[1])
    return Piece(
        kind,
        tuple(merged),
        footprint[0],
        footprint[1],
        float(low[2]),
        float(high[2]),
    )


def merge(parts: Iterable[Part]) -> list[Part]:
    """One part of each finish, in the order in which they first appear."""
    by_finish: dict[str, list[Part]] = {}
    for part in parts:
        by_finish.setdefault(part.finish, []).append(part)
    return [joined(group) for group in by_finish.values()]


def pick(rng: np.random.Generator, *options: str) -> str:
    """One of several, at random."""
    return options[int(rng.integers(len(options)))]


def legs(
    places: Sequence[tuple[float, float]], height: float, radius: float, finish: str, splay: float = 0.0
) -> list[Part]:
    """Round tapered legs at (x, y) [m], their feet `splay` [m] further out than their tops."""
    found = []
    for x, y in places:
        out = np.array([np.sign(x), np.sign(y)]) * splay
        found.append(tube([(x + out[0], y + out[1], 0.0), (x, y, height)], [0.7 * radius, radius]).of(finish))
    return found


def corners(width: float, depth: float, inset: float) -> list[tuple[float, float]]:
    """The four (x, y) [m] that lie `inset` [m] within a rectangle about the origin."""
    x, y = width / 2 - inset, depth / 2 - inset
    return [(-x, -y), (x, -y), (x, y), (-x, y)]
