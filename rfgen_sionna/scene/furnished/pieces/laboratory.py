"""Benches and instruments of laboratories."""

from __future__ import annotations

import numpy as np

from rfgen_sionna.scene.furnished.piece import Piece, piece
from rfgen_sionna.scene.furnished.shapes import Part, block, box, cushion, lathe, pipe


def lab_bench(rng: np.random.Generator, width: float | None = None) -> Piece:
    """A work bench with cupboards below, instruments on it and a shelf above its back."""
    width = rng.uniform(1.6, 2.4) if width is None else width
    depth, h = rng.uniform(0.7, 0.8), 0.9
    parts = [box((-width / 2, -depth / 2, h - 0.04), (width / 2, depth / 2, h)).of("ceramic"),
        box((-width / 2 + 0.02, -depth / 2, 0.1), (width / 2 - 0.02, depth / 2 - 0.06, h - 0.04)).of("board"),
        box((-width / 2 + 0.02, -depth / 2, 0.0), (width / 2 - 0.02, depth / 2 - 0.14, 0.1)).of("plastic")]  # fmt: skip
    doors = max(2, round(width / 0.5))
    each = (width - 0.04) / doors
    for i in range(doors):
        x = -width / 2 + 0.02 + (i + 0.5) * each
        parts.append(block(each - 0.008, 0.02, h - 0.18, x, depth / 2 - 0.05, 0.12).of("board"))
        parts.append(block(0.14, 0.02, 0.014, x, depth / 2 - 0.032, h - 0.16).of("metal"))
    x = -width / 2 + 0.08
    while x < width / 2 - 0.3:
        kind = int(rng.integers(5))
        w = (0.42, 0.36, 0.25, 0.3, 0.4)[kind]
        parts += [part.at(x + w / 2, -0.05, h) for part in (oscilloscope, supply, microscope, glassware,
            centrifuge)[kind](rng)]  # fmt: skip
        x += w + rng.uniform(0.08, 0.3)
    if rng.random() < 0.7:
        for z in (1.35, 1.65):
            parts.append(block(width, 0.25, 0.022, 0, -depth / 2 + 0.13, z).of("board"))
        for s in (-1, 1):
            parts.append(block(0.03, 0.03, 0.8, s * (width / 2 - 0.03), -depth / 2 + 0.03, h).of("metal"))
        for x in np.arange(-width / 2 + 0.15, width / 2 - 0.1, 0.24):
            if rng.random() < 0.7:
                parts.append(bottle(rng).at(x, -depth / 2 + 0.13, 1.372))
    return piece("workbench", parts, (width, depth))


def oscilloscope(rng: np.random.Generator) -> list[Part]:
    w, h = 0.38, 0.22
    knobs = [lathe([(0.014, 0), (0.012, 0.02), (0.0, 0.02)], 8).turned(-90, "x").at(0.08 + 0.05 * (i % 2), 0.1,
        0.05 + 0.06 * (i // 2)).of("plastic") for i in range(6)]  # fmt: skip
    return [block(w, 0.2, h, z=0.015).of("white plastic"), box((-w / 2 + 0.02, 0.095, 0.05),
        (0.04, 0.104, h - 0.01)).of("screen"), *knobs]  # fmt: skip


def supply(rng: np.random.Generator) -> list[Part]:
    """A stack of metal cases."""
    parts, z = [], 0.0
    for _ in range(int(rng.integers(1, 4))):
        h = rng.uniform(0.09, 0.14)
        parts += [block(0.34, 0.32, h - 0.01, z=z + 0.008).of("metal"),
            block(0.3, 0.02, h - 0.04, y=0.16, z=z + 0.02).of("plastic")]  # fmt: skip
        z += h
    return parts


def microscope(rng: np.random.Generator) -> list[Part]:
    return [block(0.18, 0.24, 0.035).of("white plastic"), pipe([(0, -0.08, 0.03), (0, -0.1, 0.25), (0, -0.02, 0.34)],
        0.028).of("white plastic"), pipe([(0, 0.02, 0.16), (0, 0.0, 0.3), (0, 0.12, 0.42)], [0.018, 0.028, 0.02],
        8).of("dark metal"), block(0.13, 0.13, 0.015, 0, 0.03, 0.12).of("dark metal")]  # fmt: skip


def bottle(rng: np.random.Generator) -> Part:
    r, h = rng.uniform(0.03, 0.055), rng.uniform(0.14, 0.24)
    return lathe([(r, 0), (r, 0.6 * h), (0.35 * r, 0.8 * h), (0.35 * r, h), (0.0, h)], 10).of("screen")


def glassware(rng: np.random.Generator) -> list[Part]:
    flask = lathe([(0.06, 0), (0.06, 0.01), (0.02, 0.12), (0.02, 0.17), (0.0, 0.17)], 12).of("window")
    return [flask.at(-0.08, 0.06), bottle(rng).at(0.06, 0.0), bottle(rng).at(-0.04, -0.1), flask.at(0.1, 0.12)]


def centrifuge(rng: np.random.Generator) -> list[Part]:
    return [cushion((0.38, 0.42, 0.26), 0.05).at(z=0.13).of("white plastic"),
        lathe([(0.16, 0), (0.15, 0.03), (0.0, 0.04)], 18).at(z=0.255).of("plastic")]  # fmt: skip
