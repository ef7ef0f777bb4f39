"""The equipment of playgrounds."""

from __future__ import annotations

import numpy as np

from rfgen_sionna.scene.furnished.piece import Piece, corners, pick, piece
from rfgen_sionna.scene.furnished.shapes import Part, block, box, cushion, grid_faces, lathe, pipe, ring


def swing(rng: np.random.Generator) -> Piece:
    """Two A-frames, a bar, and seats on chains; it swings along y."""
    seats, h = int(rng.integers(1, 3)), rng.uniform(2.1, 2.5)
    width = 1.5 * seats + 0.7
    steel = pick(rng, "painted metal", "metal")
    parts = [pipe([(-width / 2 - 0.1, 0, h), (width / 2 + 0.1, 0, h)], 0.045, 8).of(steel)]
    for s in (-1, 1):
        parts += [pipe([(s * width / 2, 0, h), (s * (width / 2 + 0.12), e * 0.85, 0)], 0.035,
            7).of(steel) for e in (-1, 1)]  # fmt: skip
        parts.append(pipe([(s * width / 2, -0.4, 0.52 * h), (s * width / 2, 0.4, 0.52 * h)], 0.022).of(steel))
    for i in range(seats):
        x = (i - 0.5 * (seats - 1)) * 1.5
        parts.append(cushion((0.46, 0.18, 0.04), 0.018, cells=2).at(x, 0, 0.48).of("rubber"))
        parts += [pipe([(x + s * 0.21, 0, 0.5), (x + s * 0.21, 0, h)], 0.009, 4).of("metal") for s in (-1, 1)]
    return piece("swing", parts)


def slide(rng: np.random.Generator) -> Piece:
    """A ladder at -y, a platform with rails, a chute with raised rims down to +y."""
    h, run = rng.uniform(1.3, 1.9), rng.uniform(2.2, 2.9)
    colour, s = pick(rng, "bright plastic", "metal", "painted metal"), np.linspace(0, 1, 12)
    y0, w = -run / 2 + 0.45, 0.27
    y = y0 + run * s
    z = 0.25 + (h - 0.25) * (1 - s) ** 1.15
    z[-2:] = 0.27
    profile = [(-w, 0.16), (-w, 0.0), (w, 0.0), (w, 0.16)]
    net = np.array([[(x, yy, zz + up) for x, up in profile] for yy, zz in zip(y, z, strict=True)]).reshape(-1, 3)
    parts = [Part(net, grid_faces(12, 4)[:, ::-1]).of(colour)]
    for side in (-1, 1):
        parts.append(pipe([(side * w, yy, zz + 0.16) for yy, zz in zip(y, z, strict=True)], 0.022).of(colour))
        parts += [pipe([(side * (w + 0.03), yy, 0), (side * (w + 0.03), yy, h + 0.75)],
            0.025).of("metal") for yy in (y0 - 0.45, y0)]  # fmt: skip
        parts.append(pipe([(side * (w + 0.03), y0 - 0.45, h + 0.72), (side * (w + 0.03), y0, h + 0.72)],
            0.02).of("metal"))  # fmt: skip
        parts.append(pipe([(side * 0.2, y0 - 0.85, 0), (side * 0.2, y0 - 0.45, h)], 0.02).of("metal"))
    parts.append(block(2 * w + 0.06, 0.5, 0.04, 0, y0 - 0.22, h - 0.02).of("wood"))
    for t in np.linspace(0.12, 0.92, 6):
        parts.append(pipe([(-0.2, y0 - 0.85 + 0.4 * t, h * t), (0.2, y0 - 0.85 + 0.4 * t, h * t)], 0.015,
            5).of("metal"))  # fmt: skip
    parts.append(pipe([(0, y[-3], 0), (0, y[-3], z[-3])], 0.03).of("metal"))
    return piece("slide", parts)


def seesaw(rng: np.random.Generator) -> Piece:
    length, tilt = rng.uniform(2.4, 3.2), rng.uniform(-12, 12)
    beam = [block(0.16, length, 0.06, z=-0.03).of("bright plastic")]
    for s in (-1, 1):
        beam.append(cushion((0.3, 0.36, 0.05), 0.02, cells=2).at(0, s * (length / 2 - 0.2), 0.05).of("plastic"))
        beam.append(pipe([(-0.16, s * (length / 2 - 0.5), 0.26), (0.16, s * (length / 2 - 0.5), 0.26)], 0.015,
            5).of("metal"))  # fmt: skip
        beam.append(pipe([(0, s * (length / 2 - 0.5), 0.0), (0, s * (length / 2 - 0.5), 0.26)], 0.015, 5).of("metal"))
    parts = [part.turned(tilt, "x").at(z=0.48) for part in beam]
    parts += [pipe([(s * 0.22, 0, 0), (s * 0.1, 0, 0.5)], 0.035).of("metal") for s in (-1, 1)]
    return piece("seesaw", parts)


def climbing_frame(rng: np.random.Generator) -> Piece:
    """A tower of posts, platform and roof with a ladder wall, or a dome of bars."""
    if rng.random() < 0.5:
        r, parts = rng.uniform(1.0, 1.35), []
        levels = [(r * np.cos(a), r * np.sin(a)) for a in np.radians([0, 28, 55, 80])]
        count = 10
        points = [
            [(q * np.cos(t), q * np.sin(t), z) for t in 2 * np.pi * (np.arange(count) + 0.5 * (k % 2)) / count]
            for k, (q, z) in enumerate(levels)
        ]
        for k in range(4):
            for i in range(count):
                if k:
                    parts.append(pipe([points[k][i], points[k][(i + 1) % count]], 0.018, 5).of("painted metal"))
                if k < 3:
                    parts += [pipe([points[k][i], points[k + 1][(i + o) % count]], 0.018,
                        5).of("painted metal") for o in ((0, -1) if k % 2 == 0 else (0, 1))]  # fmt: skip
        return piece("climbing frame", parts)
    side, deck, top = rng.uniform(1.1, 1.4), rng.uniform(1.0, 1.4), 2.4
    parts = [block(0.1, 0.1, top, x, y).of("wood") for x, y in corners(side, side, 0.05)]
    parts.append(box((-side / 2, -side / 2, deck - 0.05), (side / 2, side / 2, deck)).of("wood"))
    for s in (-1, 1):
        parts.append(
            box((-0.01, -side / 2 - 0.12, 0), (0.01, side / 2 + 0.12, 0.82 * side))
            .turned(s * 45, "y")
            .at(s * 0.5 * side * 1.15, 0, top - 0.1)
            .of("bright plastic")
        )
        parts += [pipe([(s * side / 2, -side / 2, z), (s * side / 2, side / 2, z)],
            0.02).of("painted metal") for z in (deck + 0.35, deck + 0.7)]  # fmt: skip
    parts += [pipe([(-side / 2, side / 2, z), (side / 2, side / 2, z)],
        0.02).of("painted metal") for z in np.arange(0.25, deck, 0.28)]  # fmt: skip
    parts += [pipe([(-side / 2, -side / 2, z), (side / 2, -side / 2, z)],
        0.02).of("painted metal") for z in (deck + 0.35, deck + 0.7)]  # fmt: skip
    return piece("climbing frame", parts)


def spring_rider(rng: np.random.Generator) -> Piece:
    """A little animal on a spring."""
    turn = np.linspace(0, 2 * np.pi * 5, 50)
    coil = np.stack([0.09 * np.cos(turn), 0.09 * np.sin(turn), 0.02 + 0.36 * turn / turn[-1]], -1)
    return piece("spring rider",
        [pipe(coil, 0.013, 5).of("metal"), cushion((0.2, 0.75, 0.28), 0.09, 0.02).at(z=0.54).of("bright plastic"),
        cushion((0.16, 0.2, 0.34), 0.07).turned(-25, "x").at(0, 0.36, 0.76).of("bright plastic"),
        pipe([(-0.2, 0.22, 0.78), (0.2, 0.22, 0.78)], 0.016).of("metal")])  # fmt: skip


def sandpit(rng: np.random.Generator) -> Piece:
    side = rng.uniform(1.6, 2.6)
    parts = [block(side, 0.16, 0.24, 0, s * (side / 2 - 0.08)).of("wood") for s in (-1, 1)]
    parts += [block(0.16, side - 0.32, 0.24, s * (side / 2 - 0.08), 0).of("wood") for s in (-1, 1)]
    parts.append(box((-side / 2 + 0.16, -side / 2 + 0.16, 0.01), (side / 2 - 0.16, side / 2 - 0.16, 0.12)).of("sand"))
    parts.append(lathe([(0.35, 0), (0.2, 0.14), (0.0, 0.22)], 12).at(0.2, -0.1, 0.1).of("sand"))
    return piece("sandpit", parts)


def goal(rng: np.random.Generator) -> Piece:
    """A small football goal with net stays, open towards +y."""
    w, h, d = rng.uniform(2.0, 3.0), rng.uniform(1.5, 2.0), 0.9
    parts = [pipe([(-w / 2, d / 2, 0), (-w / 2, d / 2, h), (w / 2, d / 2, h), (w / 2, d / 2, 0)], 0.05, 8).of("metal")]
    for s in (-1, 1):
        parts.append(pipe([(s * w / 2, d / 2, h), (s * w / 2, -d / 2, 0.02)], 0.025).of("metal"))
        parts.append(pipe([(s * w / 2, d / 2, 0.03), (s * w / 2, -d / 2, 0.03)], 0.025).of("metal"))
    parts.append(pipe([(-w / 2, -d / 2, 0.03), (w / 2, -d / 2, 0.03)], 0.025).of("metal"))
    for x in np.arange(-w / 2 + 0.2, w / 2, 0.2):
        parts.append(pipe([(x, d / 2, h), (x, -d / 2, 0.03)], 0.003, 3).of("plastic"))
    for t in np.arange(0.1, 1.0, 0.12):
        parts.append(pipe([(-w / 2, d / 2 - d * t, h - (h - 0.03) * t), (w / 2, d / 2 - d * t, h - (h - 0.03) * t)],
            0.003, 3).of("plastic"))  # fmt: skip
    return piece("goal", parts)


def basketball_hoop(rng: np.random.Generator) -> Piece:
    return piece("basketball hoop", [pipe([(0, -0.3, 0), (0, -0.3, 2.7), (0, 0.2, 3.0)], 0.06, 8).of("metal"),
        block(1.2, 0.03, 0.8, 0, 0.22, 2.75).of("white plastic"),
        ring(0.23, 0.012, 18, 5).at(0, 0.48, 2.95).of("painted metal")], (0.6, 0.9))  # fmt: skip
