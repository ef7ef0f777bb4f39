"""Seats and beds."""

from __future__ import annotations

import numpy as np

from rfgen_sionna.scene.furnished.piece import Piece, corners, legs, pick, piece
from rfgen_sionna.scene.furnished.shapes import Part, block, box, cushion, lathe, pipe


def upholstered(rng: np.random.Generator, places: int, cover: str, arm: float, each: float, depth: float) -> list[Part]:
    """Base, back, arm rests, seat and back cushions of a sofa or an armchair."""
    inner = places * each
    width = inner + 2 * arm
    seat, back = rng.uniform(0.40, 0.46), rng.uniform(0.76, 0.92)
    parts = [
        cushion((width - 0.04, depth - 0.06, seat - 0.22), 0.04).at(z=0.10 + 0.5 * (seat - 0.22)).of(cover),
        cushion((width - 0.06, 0.2, back - 0.18), 0.08)
        .turned(6, "x")
        .at(y=0.14 - depth / 2, z=0.5 * back + 0.1)
        .of(cover),
    ]
    arms = rng.uniform(0.56, 0.66)
    for side in (-1, 1):
        parts.append(cushion((arm, depth - 0.02, arms - 0.1), min(0.075, 0.45 * arm)).at(side * 0.5 * (width - arm),
            0.0, 0.1 + 0.5 * (arms - 0.1)).of(cover))  # fmt: skip
    for i in range(places):
        x = -0.5 * inner + (i + 0.5) * each
        parts.append(cushion((each - 0.012, depth - 0.25, 0.16), 0.05, 0.018).at(x, 0.11, seat - 0.05).of(cover))
        parts.append(
            cushion((each - 0.03, 0.17, 0.42), 0.07, 0.03).turned(12, "x").at(x, 0.3 - depth / 2, seat + 0.22).of(cover)
        )
    return parts


def sofa(rng: np.random.Generator) -> Piece:
    """Two or three seats, cushions, arm rests, pillows, short legs."""
    cover, arm, places = pick(rng, "fabric", "fabric", "leather"), rng.uniform(0.14, 0.22), int(rng.integers(2, 4))
    each, depth = rng.uniform(0.6, 0.72), rng.uniform(0.82, 0.95)
    parts = upholstered(rng, places, cover, arm, each, depth)
    width = places * each + 2 * arm
    for x in rng.uniform(-0.35, 0.35, int(rng.integers(0, 3))) * width:
        parts.append(
            cushion((0.44, 0.13, 0.42), 0.06, 0.035).turned(22, "x").at(x, 0.45 - depth / 2, 0.68).of("bedding")
        )
    parts += legs(corners(width, depth, 0.1), 0.13, 0.022, "wood")
    return piece("sofa", parts)


def armchair(rng: np.random.Generator) -> Piece:
    cover, depth = pick(rng, "fabric", "leather"), rng.uniform(0.78, 0.88)
    arm, each = rng.uniform(0.13, 0.18), rng.uniform(0.5, 0.6)
    parts = upholstered(rng, 1, cover, arm, each, depth) + legs(corners(each + 2 * arm, depth, 0.09), 0.13, 0.02,
        "wood")  # fmt: skip
    return piece("armchair", parts)


def chair(rng: np.random.Generator, style: str = "") -> Piece:
    """Four legs, a seat, a back of slats or a padded one. The same generator state gives the same chair."""
    style = style or pick(rng, "slats", "padded", "shell")
    wood = pick(rng, "wood", "pale wood")
    w, d, h = rng.uniform(0.40, 0.46), rng.uniform(0.42, 0.48), rng.uniform(0.44, 0.47)
    top = rng.uniform(0.82, 0.98)
    x, y = w / 2 - 0.025, d / 2 - 0.025
    parts = [pipe([(s * x, y, 0), (s * x, y, h - 0.02)], [0.014, 0.019]).of(wood) for s in (-1, 1)]
    if style == "shell":
        parts += [pipe([(s * x, -y, 0), (s * x, -y, h - 0.02)], [0.012, 0.016]).of(wood) for s in (-1, 1)]
        parts.append(cushion((w, d, 0.035), 0.015).at(z=h).of("white plastic"))
        parts.append(
            cushion((w, 0.03, top - h - 0.08), 0.014)
            .turned(9, "x")
            .at(y=-y - 0.02, z=0.5 * (top + h) + 0.06)
            .of("white plastic")
        )
        return piece("chair", parts)
    lean = 0.06
    parts += [pipe([(s * x, -y, 0), (s * x, -y, h), (s * x, -y - lean, top)],
        [0.014, 0.02, 0.015]).of(wood) for s in (-1, 1)]  # fmt: skip
    parts.append(cushion((w, d, 0.03), 0.012).at(z=h - 0.005).of(wood))
    if style == "padded":
        parts.append(cushion((w - 0.02, d - 0.02, 0.05), 0.02, 0.01).at(z=h + 0.03).of("fabric"))
        parts.append(
            cushion((w - 0.05, 0.05, 0.34), 0.02, 0.01).turned(8, "x").at(y=-y - 0.6 * lean, z=top - 0.19).of("fabric")
        )
    else:
        parts.append(block(2 * x, 0.022, 0.07, 0, -y - 0.9 * lean, top - 0.08).of(wood))
        for s in np.linspace(-0.6, 0.6, 4):
            parts.append(pipe([(s * x, -y, h), (s * x, -y - 0.85 * lean, top - 0.06)], 0.009, 5).of(wood))
    for s in (-1, 1):
        parts.append(pipe([(s * x, -y, 0.2), (s * x, y, 0.2)], 0.01, 5).of(wood))
    return piece("chair", parts)


def office_chair(rng: np.random.Generator) -> Piece:
    """Five feet on castors, a gas spring, a padded seat and back, arm rests."""
    h, top = rng.uniform(0.44, 0.52), rng.uniform(0.95, 1.15)
    parts = [pipe([(0, 0, 0.08), (0, 0, h - 0.06)], [0.03, 0.022], 8).of("dark metal")]
    for a in 2 * np.pi * np.arange(5) / 5 + rng.uniform(0, 1):
        tip = 0.29 * np.cos(a), 0.29 * np.sin(a)
        parts.append(pipe([(0, 0, 0.1), (*tip, 0.07)], [0.025, 0.016]).of("plastic"))
        parts.append(cushion((0.05, 0.05, 0.055), 0.02, cells=2).at(*tip, 0.0275).of("rubber"))
    parts.append(cushion((0.49, 0.48, 0.09), 0.04, 0.012).at(z=h).of("fabric"))
    tall = top - h - 0.12
    parts.append(
        cushion((0.46, 0.07, tall), 0.032, 0.012).turned(8, "x").at(y=-0.24, z=h + 0.14 + tall / 2).of("fabric")
    )
    parts.append(pipe([(0, -0.12, h - 0.03), (0, -0.3, h), (0, -0.28, h + 0.3)], 0.02).of("plastic"))
    for s in (-1, 1):
        parts.append(pipe([(s * 0.22, -0.02, h - 0.02), (s * 0.28, -0.02, h), (s * 0.28, -0.02, h + 0.19)],
            0.014).of("plastic"))  # fmt: skip
        parts.append(cushion((0.06, 0.26, 0.03), 0.012, cells=2).at(s * 0.28, 0.0, h + 0.2).of("plastic"))
    return piece("office chair", parts)


def stool(rng: np.random.Generator) -> Piece:
    h = rng.uniform(0.45, 0.65)
    top = lathe([(0.0, h - 0.04), (0.16, h - 0.04), (0.18, h - 0.02), (0.17, h), (0.0, h + 0.005)]).of("plastic")
    feet = [pipe([(0.22 * np.cos(a), 0.22 * np.sin(a), 0), (0.1 * np.cos(a), 0.1 * np.sin(a), h - 0.03)],
        0.013).of("metal") for a in 2 * np.pi * np.arange(4) / 4 + 0.4]  # fmt: skip
    return piece("stool", [top, *feet])


def bench(rng: np.random.Generator) -> Piece:
    """A park bench of slats on iron legs; its front is +y."""
    width, h = rng.uniform(1.4, 1.9), 0.45
    parts = [block(width, 0.085, 0.035, 0, y, h - 0.035).of("wood") for y in (-0.15, -0.05, 0.05, 0.15)]
    for z, y in ((0.58, -0.235), (0.70, -0.265), (0.82, -0.295)):
        parts.append(box((-width / 2, -0.017, -0.045),
            (width / 2, 0.017, 0.045)).turned(14, "x").at(0, y, z).of("wood"))  # fmt: skip
    for x in (-0.4 * width, 0.4 * width):
        parts.append(pipe([(x, 0.2, 0), (x, 0.17, h - 0.05), (x, -0.2, h - 0.05), (x, -0.32, 0.88)],
            0.022).of("dark metal"))  # fmt: skip
        parts.append(pipe([(x, -0.22, 0), (x, -0.17, h - 0.05)], 0.022).of("dark metal"))
        parts.append(pipe([(x, 0.19, h - 0.05), (x, 0.2, 0.63), (x, -0.25, 0.66)], 0.016).of("dark metal"))
    return piece("bench", parts)


def bed(rng: np.random.Generator) -> Piece:
    """Frame, mattress, headboard at the wall, pillows and a blanket that hangs over the sides."""
    width, length = pick_size(rng), rng.uniform(2.0, 2.1)
    wood, base = pick(rng, "wood", "pale wood", "painted wood"), rng.uniform(0.28, 0.36)
    head = rng.uniform(0.85, 1.15)
    parts = [box((-width / 2, -length / 2, 0.12), (width / 2, length / 2, base)).of(wood),
        cushion((width + 0.04, 0.06, head - 0.1), 0.025).at(0, -length / 2 - 0.03, 0.5 * head + 0.05).of(wood),
        cushion((width - 0.04, length - 0.04, 0.2), 0.06).at(0, 0.0, base + 0.1).of("bedding"),
        cushion((width + 0.06, 0.68 * length, 0.26), 0.05,
        0.02).at(0, 0.17 * length, base + 0.13).of("fabric")]  # fmt: skip
    count = 2 if width > 1.2 else 1
    for i in range(count):
        x = (i + 0.5) / count * width - width / 2
        parts.append(
            cushion((0.6, 0.4, 0.15), 0.07, 0.03).turned(16, "x").at(x, 0.27 - length / 2, base + 0.28).of("bedding")
        )
    parts += legs(corners(width, length, 0.06), 0.13, 0.03, wood)
    return piece("bed", parts)


def pick_size(rng: np.random.Generator) -> float:
    """Width of a mattress [m]."""
    return float(rng.choice([0.9, 1.4, 1.6, 1.8]))
