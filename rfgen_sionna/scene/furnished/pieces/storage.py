"""Wardrobes, cabinets and other closed storage furniture."""

from __future__ import annotations

import numpy as np

from rfgen_sionna.scene.furnished.piece import Piece, corners, legs, pick, piece
from rfgen_sionna.scene.furnished.shapes import block, box, cushion, lathe, pipe


def wardrobe(rng: np.random.Generator) -> Piece:
    width, depth, height = rng.uniform(1.2, 2.2), rng.uniform(0.56, 0.64), rng.uniform(1.95, 2.3)
    wood, doors = pick(rng, "wood", "pale wood", "painted wood"), max(2, round(width / 0.52))
    parts = [box((-width / 2, -depth / 2, 0.06), (width / 2, depth / 2 - 0.03, height)).of(wood)]
    parts.append(block(width - 0.06, depth - 0.1, 0.06, 0, -0.03).of(wood))
    parts.append(block(width + 0.04, depth + 0.02, 0.04, z=height - 0.001).of(wood))
    each, mirror = width / doors, int(rng.integers(-2, doors))
    for i in range(doors):
        x = -width / 2 + (i + 0.5) * each
        parts.append(cushion((each - 0.01, 0.024, height - 0.14), 0.006,
            cells=2).at(x, depth / 2 - 0.018, height / 2 + 0.02).of(wood))  # fmt: skip
        if i == mirror:
            parts.append(box((x - each / 2 + 0.06, depth / 2 - 0.01, 0.3), (x + each / 2 - 0.06, depth / 2 - 0.001,
                height - 0.2)).of("screen"))  # fmt: skip
        side = 1 if i % 2 == 0 else -1
        parts.append(pipe([(x + side * (each / 2 - 0.05), depth / 2 + 0.02, z) for z in (0.95, 1.2)], 0.009,
            5).of("metal"))  # fmt: skip
    return piece("wardrobe", parts)


def chest(rng: np.random.Generator, kind: str = "chest of drawers") -> Piece:
    """Drawers with knobs, something on top."""
    width, depth = rng.uniform(0.75, 1.15), rng.uniform(0.42, 0.5)
    height, wood = rng.uniform(0.75, 1.05), pick(rng, "wood", "pale wood", "painted wood")
    rows = 3 if height < 0.9 else 4
    parts = [box((-width / 2, -depth / 2, 0.1), (width / 2, depth / 2 - 0.02, height)).of(wood)]
    parts.append(block(width + 0.03, depth + 0.01, 0.025, z=height).of(wood))
    each = (height - 0.12) / rows
    for i in range(rows):
        z = 0.11 + (i + 0.5) * each
        parts.append(cushion((width - 0.03, 0.022, each - 0.02), 0.006, cells=2).at(0, depth / 2 - 0.01, z).of(wood))
        for s in (-0.25, 0.25):
            parts.append(cushion((0.03, 0.03, 0.03), 0.014, cells=2).at(s * width, depth / 2 + 0.014, z).of("metal"))
    parts += legs(corners(width, depth, 0.05), 0.11, 0.022, wood)
    if rng.random() < 0.6:
        parts.append(lathe([(0.06, 0), (0.09, 0.08), (0.05, 0.2), (0.06, 0.26),
            (0.0, 0.26)]).at(-0.25 * width, 0, height + 0.025).of("ceramic"))  # fmt: skip
    return piece(kind, parts)


def nightstand(rng: np.random.Generator) -> Piece:
    """A small cabinet with a lamp on it."""
    width, depth, height = rng.uniform(0.4, 0.5), 0.4, rng.uniform(0.48, 0.58)
    wood = pick(rng, "wood", "pale wood", "painted wood")
    parts = [box((-width / 2, -depth / 2, 0.1), (width / 2, depth / 2 - 0.02, height)).of(wood)]
    for z in (0.12, 0.12 + (height - 0.14) / 2):
        parts.append(block(width - 0.03, 0.02, (height - 0.16) / 2, 0, depth / 2 - 0.01, z).of(wood))
        parts.append(block(0.1, 0.02, 0.012, 0, depth / 2 + 0.006, z + 0.1).of("metal"))
    parts += legs(corners(width, depth, 0.04), 0.11, 0.018, wood)
    shade = lathe([(0.0, 0.2), (0.13, 0.2), (0.08, 0.38), (0.0, 0.38)]).of("curtain")
    parts += [lathe([(0.07, 0), (0.05, 0.03), (0.014, 0.06), (0.014, 0.22),
        (0.0, 0.22)]).at(0, -0.03, height).of("ceramic")]  # fmt: skip
    parts.append(shade.at(0, -0.03, height))
    return piece("nightstand", parts)


def filing_cabinet(rng: np.random.Generator) -> Piece:
    rows, each = int(rng.integers(2, 5)), 0.32
    parts = [box((-0.22, -0.3, 0.02), (0.22, 0.28, rows * each + 0.04)).of("metal")]
    for i in range(rows):
        parts.append(block(0.42, 0.02, each - 0.015, 0, 0.285, 0.03 + i * each).of("metal"))
        parts.append(block(0.12, 0.025, 0.02, 0, 0.3, 0.2 + i * each).of("plastic"))
    return piece("filing cabinet", parts)


def cupboard(rng: np.random.Generator, kind: str = "cupboard") -> Piece:
    """A tall cupboard with two doors."""
    width, depth, height = rng.uniform(0.8, 1.1), rng.uniform(0.4, 0.5), rng.uniform(1.8, 2.05)
    finish = pick(rng, "metal", "board", "pale wood")
    parts = [box((-width / 2, -depth / 2, 0.03), (width / 2, depth / 2 - 0.02, height)).of(finish)]
    for s in (-1, 1):
        parts.append(block(width / 2 - 0.01, 0.02, height - 0.1, s * width / 4, depth / 2 - 0.01, 0.07).of(finish))
        parts.append(pipe([(s * 0.05, depth / 2 + 0.025, z) for z in (0.95, 1.15)], 0.01, 5).of("dark metal"))
    return piece(kind, parts)


def tv_unit(rng: np.random.Generator) -> Piece:
    """A low cabinet with a television on it."""
    width, depth, h = rng.uniform(1.3, 1.9), 0.42, rng.uniform(0.42, 0.55)
    wood, doors = pick(rng, "wood", "pale wood", "painted wood"), 3
    parts = [box((-width / 2, -depth / 2, 0.12), (width / 2, depth / 2 - 0.02, h)).of(wood)]
    for i in range(doors):
        x = -width / 2 + (i + 0.5) * width / doors
        parts.append(cushion((width / doors - 0.012, 0.022, h - 0.16), 0.005,
            cells=2).at(x, depth / 2 - 0.012, 0.5 * h + 0.06).of(wood))  # fmt: skip
        parts.append(block(0.11, 0.02, 0.012, x, depth / 2 + 0.01, h - 0.1).of("metal"))
    parts += legs(corners(width, depth, 0.1), 0.13, 0.02, wood)
    screen = rng.uniform(0.95, min(1.5, width))
    tall = 0.57 * screen
    y, z = -0.05, h + 0.07
    parts += [cushion((screen, 0.045, tall), 0.012, cells=2).at(0, y, z + tall / 2).of("plastic"),
        box((-screen / 2 + 0.015, y + 0.015, z + 0.015), (screen / 2 - 0.015, y + 0.0245,
        z + tall - 0.015)).of("screen")]  # fmt: skip
    for s in (-0.3, 0.3):
        parts.append(pipe([(s * screen, y + 0.11, h + 0.008), (s * screen, y, z + 0.02),
            (s * screen, y - 0.11, h + 0.008)], 0.012, 5).of("plastic"))  # fmt: skip
    if rng.random() < 0.5:
        parts.append(cushion((0.75, 0.09, 0.07), 0.02, cells=2).at(0, depth / 2 - 0.1, h + 0.036).of("plastic"))
    return piece("television", parts)
