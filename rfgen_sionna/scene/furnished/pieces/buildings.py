"""Houses, sheds, and pieces of corridors and garages."""

from __future__ import annotations

import numpy as np

from rfgen_sionna.scene.furnished.piece import Piece, pick, piece
from rfgen_sionna.scene.furnished.shapes import Part, block, box, cushion, joined, lathe, loft, pipe, quad, ring
from rfgen_sionna.scene.furnished.shell import Opening, panel, window_parts


def house(rng: np.random.Generator, width: float) -> Piece:
    """Walls with windows and a door towards +y, a gable roof, a chimney."""
    depth, floors = rng.uniform(6.0, 9.0), int(rng.integers(1, 4))
    story = rng.uniform(2.7, 3.1)
    height = floors * story + 0.4
    wall = pick(rng, "brickwork", "rendered wall", "rendered wall", "masonry")
    openings = []
    count = max(2, round(width / rng.uniform(2.2, 3.2)))
    each, door = width / count, int(rng.integers(count))
    w, h = rng.uniform(0.9, min(1.5, each - 0.5)), rng.uniform(1.2, 1.5)
    for level in range(floors):
        for i in range(count):
            u = -width / 2 + (i + 0.5) * each
            z = 0.4 + level * story + 0.9
            if level == 0 and i == door:
                openings.append(Opening("door", "right", u, 1.0, 0.0, 2.2))
            else:
                openings.append(Opening("window", "right", u, w, z, z + h))
    front = panel(-width / 2, width / 2, height, openings).at(0, depth / 2)
    parts = [front.of(wall)]
    for opening in openings:
        if opening.kind == "door":
            x = opening.u
            parts.append(box((x - 0.5, depth / 2 - 0.16, 0), (x + 0.5, depth / 2 - 0.1, 2.2)).of("wood"))
            parts.append(block(1.3, 0.35, 0.14, x, depth / 2 + 0.19).of("stone"))
            parts.append(cushion((1.5, 0.7, 0.1), 0.03, cells=2).at(x, depth / 2 + 0.34, 2.45).of("roof tiles"))
        else:
            parts += [part.at(0, depth / 2) for part in window_parts(opening)]
    x, y = width / 2, depth / 2
    for a, b in (((x, y), (x, -y)), ((x, -y), (-x, -y)), ((-x, -y), (-x, y))):
        parts.append(quad([(*b, 0), (*a, 0), (*a, height), (*b, height)]).of(wall))
    rise, over = rng.uniform(0.25, 0.5) * depth, 0.35
    ends = [[(s * (x + over), -y - over, height), (s * (x + over), y + over, height),
        (s * (x + over), 0, height + rise)] for s in (-1, 1)]  # fmt: skip
    parts.append(loft(ends).of("roof tiles"))
    if rng.random() < 0.7:
        parts.append(block(0.6, 0.6, rise + 0.7, rng.uniform(-0.3, 0.3) * width, -0.15 * depth,
            height + 0.1).of("brickwork"))  # fmt: skip
    parts.append(pipe([(x - 0.1, y + 0.07, 0), (x - 0.1, y + 0.07, height)], 0.045, 6).of("metal"))
    return piece("house", parts, (width, depth))


def shed(rng: np.random.Generator) -> Piece:
    """A hut of boards with a pent roof, its door towards +y."""
    w, d, h = rng.uniform(2.0, 3.2), rng.uniform(1.8, 2.4), rng.uniform(1.9, 2.3)
    boards = [box((a, d / 2, 0.05), (a + 0.13, d / 2 + 0.02, h)) for a in np.arange(-w / 2, w / 2 - 0.1, 0.15)]
    roof = [[(s * (w / 2 + 0.2), -d / 2 - 0.2, h - 0.05), (s * (w / 2 + 0.2), d / 2 + 0.3, h + 0.3),
        (s * (w / 2 + 0.2), d / 2 + 0.3, h + 0.36),
        (s * (w / 2 + 0.2), -d / 2 - 0.2, h + 0.01)] for s in (-1, 1)]  # fmt: skip
    return piece("shed", [box((-w / 2, -d / 2, 0), (w / 2, d / 2, h)).of("wood"), joined(boards).of("wood"),
        block(0.85, 0.05, 1.8, rng.uniform(-0.25, 0.25) * w, d / 2 + 0.03, 0.05).of("painted wood"),
        loft(roof).of("roof tiles")], (w + 0.4, d + 0.5))  # fmt: skip


def lockers(rng: np.random.Generator) -> Piece:
    """A row of narrow metal doors with vents."""
    count, each, height, depth = int(rng.integers(3, 8)), 0.32, rng.uniform(1.75, 1.95), 0.42
    width = count * each
    parts = [box((-width / 2, -depth / 2, 0.06), (width / 2, depth / 2 - 0.02, height)).of("metal")]
    for i in range(count):
        x = -width / 2 + (i + 0.5) * each
        parts.append(block(each - 0.02, 0.02, height - 0.12, x, depth / 2 - 0.01, 0.09).of("painted metal"))
        parts += [
            block(0.16, 0.012, 0.012, x, depth / 2 + 0.004, z).of("metal")
            for z in (0.25, 0.3, height - 0.3, height - 0.25)
        ]
        parts.append(block(0.03, 0.03, 0.08, x + 0.11, depth / 2 + 0.01, 1.0).of("dark metal"))
    return piece("locker", parts)


def wall_bench(rng: np.random.Generator) -> Piece:
    """A seat along a wall."""
    width = rng.uniform(1.2, 2.0)
    parts = [block(width, 0.09, 0.04, 0, y, 0.42).of("pale wood") for y in (-0.12, 0.0, 0.12)]
    parts += [block(0.05, 0.34, 0.42, s * (width / 2 - 0.2)).of("dark metal") for s in (-1, 1)]
    return piece("bench", parts)


def extinguisher(rng: np.random.Generator) -> Piece:
    z = rng.uniform(0.7, 1.0)
    return piece("fire extinguisher", [lathe([(0.07, 0), (0.075, 0.03), (0.075, 0.4), (0.03, 0.47), (0.0, 0.47)],
        14).at(0, 0, z).of("painted metal"), pipe([(0, 0, z + 0.46), (0.0, 0.05, z + 0.54), (0.09, 0.05, z + 0.45),
        (0.09, 0.03, z + 0.15)], 0.014, 5).of("rubber"),
        block(0.12, 0.03, 0.1, 0, -0.08, z + 0.3).of("metal")])  # fmt: skip


def notice_board(rng: np.random.Generator) -> Piece:
    """A board with sheets of paper."""
    w, h, z = rng.uniform(0.9, 1.6), rng.uniform(0.7, 1.0), 1.05
    parts = [block(w, 0.02, h, 0, 0, z).of("board")]
    for x in np.arange(-w / 2 + 0.16, w / 2 - 0.1, 0.26):
        for dz in (0.06, 0.4):
            if rng.random() < 0.75 and dz + 0.3 < h:
                parts.append(block(0.21, 0.008, 0.29, x, 0.014, z + dz).of("paper"))
    return piece("notice board", parts)


def tyres(rng: np.random.Generator) -> Piece:
    """A stack of tyres."""
    r, t = 0.31, 0.1
    count = int(rng.integers(2, 5))
    parts = [ring(r - t, t, 22, 8).scaled(1, 1, 0.95).at(rng.uniform(-0.02, 0.02), rng.uniform(-0.02, 0.02),
        t * (0.95 + 1.9 * i)) for i in range(count)]  # fmt: skip
    return piece("tyres", [part.of("rubber") for part in parts])


def tool_wall(rng: np.random.Generator) -> Piece:
    """A board at the wall with spanners, saws and hammers on it."""
    w, h, z = rng.uniform(1.1, 1.9), 0.8, 1.15
    parts = [block(w, 0.015, h, 0, 0, z).of("board")]
    for x in np.arange(-w / 2 + 0.1, w / 2 - 0.05, 0.15):
        for top in (z + h - 0.06, z + 0.38):
            long = rng.uniform(0.15, 0.3)
            tool = int(rng.integers(3))
            if tool == 0:
                parts.append(pipe([(x, 0.02, top), (x, 0.02, top - long)], 0.01, 5).of("metal"))
                parts.append(block(0.05, 0.02, 0.04, x, 0.02, top - 0.03).of("metal"))
            elif tool == 1:
                parts.append(pipe([(x, 0.025, top), (x, 0.025, top - long)], 0.013, 5).of("wood"))
                parts.append(block(0.11, 0.03, 0.035, x, 0.025, top - 0.03).of("dark metal"))
            else:
                parts.append(quad([(x + 0.05, 0.016, top - 0.3), (x - 0.02, 0.016, top - 0.3), (x - 0.05, 0.016, top),
                    (x + 0.05, 0.016, top)]).of("metal"))  # fmt: skip
    return piece("tool wall", parts)


def ladder(rng: np.random.Generator) -> Piece:
    """A step ladder, set up."""
    h, spread = rng.uniform(1.4, 2.1), 0.5
    parts: list[Part] = []
    for s in (-1, 1):
        parts.append(pipe([(s * 0.25, spread, 0), (s * 0.18, 0, h)], 0.02).of("metal"))
        parts.append(pipe([(s * 0.25, -spread, 0), (s * 0.18, 0, h)], 0.016).of("metal"))
    for t in np.arange(0.15, 0.98, 0.25 / h):
        parts.append(block(2 * (0.25 - 0.07 * t), 0.08, 0.025, 0, spread * (1 - t), t * h).of("metal"))
    return piece("ladder", parts)
