"""A piece of furniture: its parts and its footprint."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from rfgen_sionna.scene.furnished.shapes import Part, joined, pipe

Choice = TypeVar("Choice")


@dataclass(frozen=True, eq=False)
class Piece:
    """A piece in its own frame: on z = 0 about the origin, its front towards +y."""

    kind: str
    """Noun for captions: "sofa"."""
    parts: tuple[Part, ...]
    """One part of each finish."""
    width: float
    """Footprint along x, centred [m]."""
    depth: float
    """Footprint along y, centred [m]."""
    bottom: float
    """Lowest height [m]."""
    top: float
    """Greatest height [m]."""


def piece(kind: str, parts: Iterable[Part], footprint: tuple[float, float] | None = None) -> Piece:
    """A piece of parts, centred on its footprint (width, depth) [m]; None takes the extent of the parts."""
    merged = merge(parts)
    points = np.concatenate([part.points for part in merged])
    low, high = points.min(axis=0), points.max(axis=0)
    if footprint is None:
        middle = 0.5 * (low + high)
        merged = [part.at(-middle[0], -middle[1]) for part in merged]
        footprint = float(high[0] - low[0]), float(high[1] - low[1])
    return Piece(kind, tuple(merged), *footprint, float(low[2]), float(high[2]))


def merge(parts: Iterable[Part]) -> list[Part]:
    """One part of each finish, in order of their first appearance."""
    by_finish: dict[str, list[Part]] = {}
    for part in parts:
        by_finish.setdefault(part.finish, []).append(part)
    return [joined(group) for group in by_finish.values()]


def pick(rng: np.random.Generator, *options: Choice) -> Choice:
    """One of several, at random."""
    return options[int(rng.integers(len(options)))]


def legs(
    places: Sequence[tuple[float, float]], height: float, radius: float, finish: str, splay: float = 0.0
) -> list[Part]:
    """Round tapered legs at (x, y) [m], with feet `splay` [m] outside their tops."""
    found = []
    for x, y in places:
        out = np.array([np.sign(x), np.sign(y)]) * splay
        found.append(pipe([(x + out[0], y + out[1], 0.0), (x, y, height)], [0.7 * radius, radius]).of(finish))
    return found


def corners(width: float, depth: float, inset: float) -> list[tuple[float, float]]:
    """Corners (x, y) [m] of a rectangle about the origin, `inset` [m] inwards."""
    x, y = width / 2 - inset, depth / 2 - inset
    return [(-x, -y), (x, -y), (x, y), (-x, y)]
