"""Tables, desks and the things on them."""

from __future__ import annotations

import numpy as np

from rfgen_sionna.scene.furnished.piece import Piece, corners, legs, pick, piece
from rfgen_sionna.scene.furnished.shapes import Part, block, box, cushion, lathe, pipe


def dining_table(rng: np.random.Generator) -> Piece:
    width, depth, h = rng.uniform(1.2, 1.9), rng.uniform(0.8, 0.95), rng.uniform(0.73, 0.77)
    wood = pick(rng, "wood", "pale wood")
    parts = [cushion((width, depth, 0.035), 0.012).at(z=h - 0.018).of(wood)]
    inset = 0.1
    for s in (-1, 1):
        parts.append(block(width - 2 * inset, 0.02, 0.08, 0, s * (depth / 2 - inset), h - 0.115).of(wood))
        parts.append(block(0.02, depth - 2 * inset, 0.08, s * (width / 2 - inset), 0, h - 0.115).of(wood))
    parts += [block(0.06, 0.06, h - 0.03, x, y).of(wood) for x, y in corners(width, depth, inset)]
    for x in rng.uniform(-0.3, 0.3, int(rng.integers(1, 3))) * width:
        parts.append(bowl(rng).at(x, rng.uniform(-0.2, 0.2) * depth, h))
    return piece("table", parts)


def bowl(rng: np.random.Generator) -> Part:
    """A bowl or a vase."""
    if rng.random() < 0.5:
        rim = rng.uniform(0.1, 0.15)
        return lathe([(0.045, 0), (0.6 * rim, 0.015), (rim, 0.07), (0.93 * rim, 0.07), (0.5 * rim, 0.022),
            (0.01, 0.015)]).of("ceramic")  # fmt: skip
    h = rng.uniform(0.2, 0.32)
    return lathe([(0.04, 0), (0.08, 0.3 * h), (0.07, 0.6 * h), (0.035, 0.85 * h), (0.05, h), (0.0, h)]).of("ceramic")


def coffee_table(rng: np.random.Generator) -> Piece:
    h = rng.uniform(0.36, 0.46)
    wood = pick(rng, "wood", "pale wood")
    if rng.random() < 0.4:
        r = rng.uniform(0.36, 0.48)
        parts = [lathe([(0.02, h - 0.03), (r - 0.02, h - 0.03), (r, h - 0.012), (r, h), (0.02, h)], 24).of(wood)]
        parts += legs([(0.7 * r * np.cos(a), 0.7 * r * np.sin(a)) for a in (0.5, 2.6, 4.7)], h - 0.02, 0.02, wood, 0.05)
    else:
        width, depth = rng.uniform(0.9, 1.25), rng.uniform(0.5, 0.65)
        top = pick(rng, wood, wood, "window")
        parts = [cushion((width, depth, 0.03), 0.01).at(z=h - 0.015).of(top)]
        parts += [block(0.05, 0.05, h - 0.025, x, y).of(wood) for x, y in corners(width, depth, 0.06)]
        parts.append(block(width - 0.15, depth - 0.15, 0.018, 0, 0, 0.14).of(wood))
    if rng.random() < 0.7:
        parts.append(bowl(rng).at(0.1, 0.05, h))
    if rng.random() < 0.7:
        parts.append(block(0.21, 0.29, rng.uniform(0.01, 0.04)).turned(25).at(-0.16, -0.05, h).of("paper"))
    return piece("coffee table", parts)


def monitor(rng: np.random.Generator) -> list[Part]:
    """A screen on its stand, facing +y."""
    width = rng.uniform(0.5, 0.7)
    height, z = 0.58 * width, rng.uniform(0.1, 0.16)
    return [cushion((width, 0.035, height), 0.01, cells=2).at(z=z + height / 2).of("plastic"),
        box((-width / 2 + 0.012, 0.012, z + 0.012), (width / 2 - 0.012, 0.0195, z + height - 0.012)).of("screen"),
        pipe([(0, -0.02, 0.01), (0, -0.03, z + 0.1)], 0.02).of("plastic"),
        block(0.24, 0.18, 0.012, 0, -0.01).of("plastic")]  # fmt: skip


def laptop() -> list[Part]:
    """An open laptop, facing +y."""
    lid = box((-0.16, -0.005, 0), (0.16, 0.005, 0.22)).turned(18, "x").at(0, -0.11, 0.015)
    return [block(0.32, 0.22, 0.018).of("metal"), lid.of("screen")]


def desk(rng: np.random.Generator, screens: int | None = None) -> Piece:
    """A desk with a drawer unit, monitors, a keyboard, papers, a lamp; its seat is at +y."""
    width, depth, h = rng.uniform(1.2, 1.7), rng.uniform(0.65, 0.8), rng.uniform(0.71, 0.75)
    top, frame = pick(rng, "board", "pale wood", "wood"), pick(rng, "metal", "dark metal")
    parts = [box((-width / 2, -depth / 2, h - 0.028), (width / 2, depth / 2, h)).of(top)]
    for x in (-width / 2 + 0.04, width / 2 - 0.04):
        parts += [block(0.05, 0.05, h - 0.07, x, 0, 0.04).of(frame), block(0.06, depth - 0.1, 0.04, x, 0).of(frame),
            block(0.05, depth - 0.1, 0.03, x, 0, h - 0.058).of(frame)]  # fmt: skip
    parts.append(block(width - 0.16, 0.018, 0.3, 0, -depth / 2 + 0.08, h - 0.36).of(top))
    side = 1 if rng.random() < 0.5 else -1
    if rng.random() < 0.7:
        x = side * (width / 2 - 0.3)
        parts.append(block(0.4, depth - 0.16, h - 0.1, x, -0.02, 0.04).of("board"))
        for i in range(3):
            z = 0.06 + i * (h - 0.14) / 3
            parts.append(block(0.38, 0.016, (h - 0.16) / 3 - 0.01, x, depth / 2 - 0.092, z).of("board"))
            parts.append(block(0.12, 0.02, 0.012, x, depth / 2 - 0.075, z + 0.11).of("metal"))
    screens = int(rng.integers(1, 3)) if screens is None else screens
    for i in range(screens):
        x = 0.0 if screens == 1 else (i - 0.5) * 0.64
        yaw = rng.uniform(-8, 8) if screens == 1 else (-12.0 if i else 12.0)
        parts += [part.turned(yaw).at(x, -0.08 - 0.1 * depth, h) for part in monitor(rng)]
    if screens:
        parts.append(block(0.44, 0.14, 0.02, 0.0, 0.18, h).of("plastic"))
        parts.append(cushion((0.065, 0.11, 0.035), 0.015, cells=2).at(0.32, 0.18, h + 0.0175).of("plastic"))
    else:
        parts += [part.at(0, 0.05, h) for part in laptop()]
    if rng.random() < 0.6:
        parts.append(
            block(0.23, 0.31, rng.uniform(0.01, 0.07))
            .turned(rng.uniform(-20, 20))
            .at(-side * (width / 2 - 0.2), 0.05, h)
            .of("paper")
        )
    if rng.random() < 0.5:
        parts += [part.at(-side * (width / 2 - 0.14), -depth / 2 + 0.14, h) for part in desk_lamp()]
    if rng.random() < 0.5:
        parts.append(lathe([(0.035, 0), (0.042, 0.09), (0.036, 0.09), (0.03, 0.01), (0.0, 0.01)],
            10).at(side * 0.5, 0.15, h).of("ceramic"))  # fmt: skip
    return piece("desk", parts, (width, depth))


def desk_lamp() -> list[Part]:
    """A lamp with a bent arm."""
    shade = lathe([(0.07, 0), (0.03, 0.09), (0.0, 0.1)], 10).turned(40, "y").at(0.13, 0.06, 0.36)
    return [lathe([(0.07, 0), (0.07, 0.015), (0.0, 0.02)], 12).of("dark metal"),
        pipe([(0, 0, 0.01), (-0.05, 0, 0.25), (0.14, 0.06, 0.44)], 0.008, 5).of("dark metal"),
        shade.of("dark metal")]  # fmt: skip


def classroom_desk(rng: np.random.Generator, width: float, depth: float) -> Piece:
    """A pupil's table with bent legs; its seat is at +y."""
    h = 0.72
    parts = [box((-width / 2, -depth / 2, h - 0.025), (width / 2, depth / 2, h)).of("pale wood")]
    parts += legs(corners(width, depth, 0.06), h - 0.02, 0.018, "dark metal")
    parts.append(block(width - 0.12, 0.02, 0.02, 0, -depth / 2 + 0.06, 0.14).of("dark metal"))
    if rng.random() < 0.5:
        parts.append(
            block(0.2, 0.28, rng.uniform(0.01, 0.05))
            .turned(rng.uniform(-25, 25))
            .at(rng.uniform(-0.3, 0.3) * width, 0, h)
            .of("paper")
        )
    return piece("desk", parts, (width, depth))
