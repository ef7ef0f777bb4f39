"""Shelves and books."""

from __future__ import annotations

import numpy as np

from rfgen_sionna.scene.furnished.piece import Piece, corners, pick, piece
from rfgen_sionna.scene.furnished.shapes import Part, block, box, cushion, joined, lathe


def books(rng: np.random.Generator, width: float, height: float, depth: float) -> Part | None:
    """A row of books [m] along x from 0, standing at z = 0 with their spines towards +y; None where there are none."""
    x, found = 0.0, []
    fill = width * rng.uniform(0.55, 1.0)
    while x < fill - 0.05:
        thick = rng.uniform(0.018, 0.05)
        tall, deep = height * rng.uniform(0.6, 0.92), depth * rng.uniform(0.65, 0.9)
        book = box((0, -deep, 0), (thick - 0.002, 0, tall))
        found.append(book.turned(rng.uniform(0, 9) if rng.random() < 0.08 else 0.0, "y").at(x, depth / 2, 0.001))
        x += thick
    return joined(found).of("paper") if found else None


def bookshelf(rng: np.random.Generator) -> Piece:
    width, depth, height = rng.uniform(0.7, 1.2), rng.uniform(0.27, 0.34), rng.uniform(1.7, 2.1)
    wood, t = pick(rng, "wood", "pale wood", "board"), 0.022
    parts = [block(t, depth, height, s * (width - t) / 2).of(wood) for s in (-1, 1)]
    parts.append(block(width - 2 * t, 0.008, height - 0.05, 0, -depth / 2 + 0.004, 0.05).of(wood))
    levels = np.linspace(0.07, height - t, int(rng.integers(5, 7)))
    for i, z in enumerate(levels):
        parts.append(block(width - 2 * t, depth - 0.01, t, 0, 0.005, z).of(wood))
        if i == len(levels) - 1:
            continue
        row = books(rng, width - 2 * t, levels[i + 1] - z - t, depth - 0.05)
        if rng.random() < 0.12:
            parts.append(cushion((0.3, 0.2, 0.2), 0.02).at(0, 0, z + t + 0.1).of("cardboard"))
        elif row is not None:
            parts.append(row.at(-width / 2 + t, 0.0, z + t))
    return piece("bookshelf", parts)


def open_shelf(rng: np.random.Generator, width: float | None = None) -> Piece:
    """Uprights and boards with boxes, tins and canisters on them."""
    width = rng.uniform(1.0, 1.8) if width is None else width
    depth, height = rng.uniform(0.4, 0.5), rng.uniform(1.7, 2.1)
    parts = [block(0.04, 0.04, height, x, y).of("metal") for x, y in corners(width, depth, 0.02)]
    for z in np.linspace(0.1, height - 0.06, int(rng.integers(4, 6))):
        parts.append(block(width, depth, 0.025, z=z).of("metal"))
        x = -width / 2 + 0.06
        while x < width / 2 - 0.25 and z < height - 0.2:
            parts += [part.at(x, 0, z + 0.025) for part in stored(rng)]
            x += rng.uniform(0.28, 0.55)
    return piece("shelf", parts)


def stored(rng: np.random.Generator) -> list[Part]:
    """A thing on a shelf, to the right of x = 0."""
    what = int(rng.integers(4))
    if what == 0:
        w, h = rng.uniform(0.22, 0.4), rng.uniform(0.15, 0.3)
        return [block(w, rng.uniform(0.25, 0.36), h, w / 2).of("cardboard"),
            block(w + 0.01, 0.2, 0.02, w / 2, 0, h - 0.02).of("cardboard")]  # fmt: skip
    if what == 1:
        return [
            lathe([(0.08, 0), (0.08, 0.2), (0.0, 0.2)], 12).at(0.1 + 0.18 * i, rng.uniform(-0.06, 0.1)).of("metal")
            for i in range(2)
        ]
    if what == 2:
        return [cushion((0.18, 0.26, 0.3), 0.03).at(0.1, 0, 0.15).of("bright plastic"),
            lathe([(0.025, 0), (0.02, 0.06), (0.0, 0.06)], 8).at(0.06, 0.06, 0.29).of("plastic")]  # fmt: skip
    return [cushion((0.3, 0.24, 0.18), 0.02, cells=2).at(0.15, 0, 0.09).of("white plastic")]
