"""Lamps, plants, pictures, sanitary and small things."""

from __future__ import annotations

import numpy as np

from rfgen_sionna.scene.furnished.piece import Piece, pick, piece
from rfgen_sionna.scene.furnished.shapes import Part, block, box, cushion, grid_faces, lathe, leaves, pipe


def floor_lamp(rng: np.random.Generator) -> Piece:
    h, r = rng.uniform(1.4, 1.75), rng.uniform(0.17, 0.24)
    foot = lathe([(0.14, 0), (0.14, 0.02), (0.02, 0.03), (0.0, 0.03)], 16).of("dark metal")
    pole = pipe([(0, 0, 0.02), (0, 0, h - 0.05)], 0.012).of("dark metal")
    shade = lathe([(0.0, h - 0.3), (r, h - 0.3), (0.7 * r, h), (0.0, h)], 18).of("curtain")
    return piece("floor lamp", [foot, pole, shade])


def plant(rng: np.random.Generator) -> Piece:
    """A pot with long or with bushy leaves."""
    r, tall = rng.uniform(0.13, 0.19), rng.uniform(0.7, 1.5)
    pot_height = 1.7 * r
    pot = lathe([(0.75 * r, 0), (r, pot_height), (0.88 * r, pot_height), (0.85 * r, 0.85 * pot_height),
        (0.0, 0.85 * pot_height)]).of(pick(rng, "ceramic", "plastic", "bright plastic"))  # fmt: skip
    parts = [pot]
    if rng.random() < 0.5:
        for a in rng.uniform(0, 2 * np.pi, int(rng.integers(9, 15))):
            reach, up = rng.uniform(0.15, 0.34), rng.uniform(0.6, 1.0) * tall
            s = np.linspace(0, 1, 6)
            out = reach * s**1.6
            z = 0.85 * pot_height + (up - pot_height) * np.sin(0.6 * np.pi * s) / np.sin(0.6 * np.pi)
            way = np.stack([out * np.cos(a), out * np.sin(a), z], -1)
            wide = 0.045 * np.sin(np.pi * np.clip(s, 0.08, 0.95))[:, None] * np.array([-np.sin(a), np.cos(a), 0.0])
            strip = np.stack([way - wide, way + wide], 1).reshape(-1, 3)
            parts.append(Part(strip, grid_faces(6, 2)).of("leaf"))
    else:
        stem = np.array([0.0, 0.0, 0.8 * pot_height])
        for _ in range(int(rng.integers(3, 6))):
            tip = np.array([*rng.normal(0, 0.12, 2), rng.uniform(0.65, 0.9) * tall])
            parts.append(pipe([stem, 0.5 * (stem + tip) + (0.02, 0, 0), tip], [0.012, 0.009, 0.005], 5).of("bark"))
            around = tip + rng.uniform(-0.2, 0.2, (26, 3)) * (1, 1, 1.2)
            parts.append(leaves(around, 0.11, rng).of("leaf"))
    wide = 2 * max(float(np.abs(part.points[:, :2]).max()) for part in parts)
    return piece("plant", parts, (wide, wide))


def rug(rng: np.random.Generator) -> Piece:
    width, depth = rng.uniform(1.6, 2.4), rng.uniform(1.1, 1.7)
    return piece("rug", [block(width, depth, 0.01, z=0.001).of("rug")])


def picture(rng: np.random.Generator) -> Piece:
    """A frame that hangs on a wall at eye level."""
    w, h = rng.uniform(0.4, 1.1), rng.uniform(0.35, 0.75)
    z = 1.6 - h / 2
    parts = [block(w - 0.04, 0.012, h - 0.04, 0, 0, z + 0.02).of(pick(rng, "window", "paper"))]
    for s in (-1, 1):
        parts.append(block(0.035, 0.028, h, s * (w / 2 - 0.0175), 0.006, z).of("wood"))
        parts.append(block(w - 0.07, 0.028, 0.035, 0, 0.006, z + (0 if s < 0 else h - 0.035)).of("wood"))
    return piece("picture", parts)


def wall_clock(rng: np.random.Generator) -> Piece:
    face = lathe([(0.15, 0), (0.16, 0.02), (0.14, 0.03), (0.0, 0.03)], 20).turned(-90, "x").of("white plastic")
    return piece("clock", [face.at(0, 0, rng.uniform(1.9, 2.2))])


def radiator(rng: np.random.Generator) -> Piece:
    """Ribs on two pipes, at a wall."""
    width, h = rng.uniform(0.8, 1.6), rng.uniform(0.5, 0.65)
    ribs = [
        cushion((0.045, 0.09, h), 0.018, cells=2).at(x, 0.0, 0.13 + h / 2)
        for x in np.arange(-width / 2, width / 2, 0.065)
    ]
    bars = [pipe([(-width / 2 - 0.06, 0, z), (width / 2 + 0.02, 0, z)], 0.016) for z in (0.17, 0.09 + h)]
    return piece("radiator", [part.of("metal") for part in [*ribs, *bars]])


def ceiling_lamp(rng: np.random.Generator, height: float) -> Piece:
    """A lamp that hangs from a ceiling at `height` [m]."""
    drop, r = min(rng.uniform(0.25, 0.6), height - 2.16), rng.uniform(0.14, 0.26)
    z = height - drop
    shade = lathe([(0.0, 0.02), (r, 0.0), (0.75 * r, 0.45 * r), (0.05, 0.7 * r), (0.0, 0.7 * r)], 18)
    return piece("ceiling lamp", [
        pipe([(0, 0, z + 0.5 * r), (0, 0, height - 0.001)], 0.008, 5).of("plastic"),
        lathe([(0.05, 0), (0.05, 0.025), (0.0, 0.025)], 12).at(z=height - 0.026).of("white plastic"),
        shade.at(z=z).of(pick(rng, "curtain", "white plastic", "metal")),
    ])  # fmt: skip


def ceiling_panel(rng: np.random.Generator, height: float) -> Piece:
    """A strip light under a ceiling at `height` [m]."""
    parts = [block(1.25, 0.3, 0.05, z=height - 0.06).of("metal"), box((-0.6, -0.12, height - 0.075),
        (0.6, 0.12, height - 0.06)).of("white plastic")]  # fmt: skip
    return piece("strip light", parts)


def whiteboard(rng: np.random.Generator, width: float | None = None, kind: str = "whiteboard") -> Piece:
    width, height, z = width or rng.uniform(1.2, 2.0), rng.uniform(0.9, 1.2), 0.92
    board = "blackboard" if kind == "blackboard" else "ceramic"
    parts = [block(width, 0.015, height, 0, 0, z).of(board), block(width - 0.1, 0.08, 0.012, 0, 0.045,
        z - 0.01).of("metal")]  # fmt: skip
    for s in (-1, 1):
        parts.append(block(0.03, 0.03, height, s * width / 2, 0.0, z).of("metal"))
        parts.append(block(width, 0.03, 0.03, 0, 0.0, z + (0 if s < 0 else height)).of("metal"))
    return piece(kind, parts)


def waste_bin(rng: np.random.Generator) -> Piece:
    r, h = rng.uniform(0.12, 0.17), rng.uniform(0.28, 0.42)
    return piece("bin", [lathe([(0.8 * r, 0), (r, h), (0.93 * r, h), (0.75 * r, 0.02),
        (0.0, 0.02)]).of(pick(rng, "plastic", "metal"))])  # fmt: skip


def coat_rack(rng: np.random.Generator) -> Piece:
    """A stand with hooks and a coat or two."""
    h = rng.uniform(1.65, 1.85)
    parts = [pipe([(0, 0, 0.03), (0, 0, h)], 0.018).of("wood")]
    for a in np.arange(4) * np.pi / 2 + 0.4:
        c, s = np.cos(a), np.sin(a)
        parts.append(pipe([(0, 0, 0.16), (0.26 * c, 0.26 * s, 0.0)], 0.014).of("wood"))
        parts.append(pipe([(0, 0, h - 0.14), (0.12 * c, 0.12 * s, h - 0.12), (0.15 * c, 0.15 * s, h - 0.03)], 0.01,
            5).of("wood"))  # fmt: skip
    for a in rng.uniform(0, 2 * np.pi, int(rng.integers(1, 3))):
        coat = cushion((0.42, 0.14, 0.95), 0.06, 0.02).at(0, 0.15, h - 0.62)
        parts.append(coat.turned(np.degrees(a)).of("fabric"))
    return piece("coat rack", parts)


def sink(rng: np.random.Generator) -> Piece:
    """A cabinet with a basin let into its top, and a tap."""
    width, depth, h = rng.uniform(0.8, 1.2), 0.58, 0.88
    r = 0.19
    parts = [box((-width / 2, -depth / 2, 0.08), (width / 2, depth / 2 - 0.03, h - 0.04)).of("board")]
    top = [(-width / 2, -r), (r, width / 2)]
    parts += [box((a, -depth / 2, h - 0.04), (b, depth / 2, h)).of("ceramic") for a, b in top]
    parts += [box((-r, a, h - 0.04), (r, b, h)).of("ceramic") for a, b in ((-depth / 2, -r), (r, depth / 2))]
    basin = [(0.04, -0.16), (0.13, -0.15), (r, 0.0), (r + 0.012, 0.004), (r - 0.006, -0.005), (0.12, -0.14),
        (0.0, -0.15)]  # fmt: skip
    parts.append(lathe(basin, 18).at(z=h).of("metal"))
    parts.append(pipe([(0, -0.23, h), (0, -0.23, h + 0.25), (0, -0.16, h + 0.29), (0, -0.08, h + 0.22)],
        0.013).of("metal"))  # fmt: skip
    for s in (-1, 1):
        x = s * width / 4
        parts.append(block(width / 2 - 0.01, 0.02, h - 0.2, x, depth / 2 - 0.02, 0.12).of("board"))
        parts.append(block(0.1, 0.02, 0.014, x, depth / 2 - 0.004, h - 0.14).of("metal"))
    return piece("sink", parts)
