"""Pieces in streets, on playgrounds and in fields."""

# ruff: noqa: RUF005  (arrays are added to tuples here, not joined)
from __future__ import annotations

import numpy as np

from rfgen_sionna.scene.furnished.piece import Piece, piece
from rfgen_sionna.scene.furnished.shapes import (
    Part,
    block,
    box,
    cushion,
    lathe,
    leaves,
    loft,
    lump,
    pipe,
)


def tree(rng: np.random.Generator) -> Piece:
    """A trunk that forks into boughs, with crowns of leaves, or a conifer."""
    tall, r = rng.uniform(4.0, 8.0), rng.uniform(0.12, 0.28)
    if rng.random() < 0.25:
        parts = [pipe([(0, 0, 0), (0, 0, 0.9 * tall)], [r, 0.2 * r], 8).of("bark")]
        height = 0.12 + 0.88 * rng.random(1100) ** 1.4
        angle, out = rng.uniform(0, 2 * np.pi, 1100), 0.22 * tall * (1.02 - height) * np.sqrt(rng.random(1100))
        places = np.stack([out * np.cos(angle), out * np.sin(angle), tall * height], -1)
        return piece("tree", [*parts, leaves(places, 0.16, rng).of("leaf")], (4 * r, 4 * r))
    fork = rng.uniform(0.32, 0.45) * tall
    bend = rng.normal(0, 0.1, 2)
    parts = [pipe([(0, 0, 0), (0, 0, 0.15), (0.5 * bend[0], 0.5 * bend[1], 0.6 * fork), (*bend, fork)],
        [1.5 * r, 1.05 * r, 0.9 * r, 0.75 * r], 9).of("bark")]  # fmt: skip
    count = int(rng.integers(4, 7))
    for a in 2 * np.pi * np.arange(count) / count + rng.uniform(0, 0.8, count):
        reach = rng.uniform(0.12, 0.24) * tall
        tip = np.array([bend[0] + reach * np.cos(a), bend[1] + reach * np.sin(a), rng.uniform(0.62, 0.9) * tall])
        middle = 0.5 * (tip + (*bend, fork)) + (0, 0, -0.05 * tall)
        parts.append(pipe([(*bend, 0.97 * fork), middle, tip], [0.5 * r, 0.35 * r, 0.12 * r], 6).of("bark"))
        size = rng.uniform(0.13, 0.2) * tall
        cloud = rng.normal(size=(260, 3))
        cloud *= (size * rng.random(260) ** 0.4 / np.linalg.norm(cloud, axis=1))[:, None]
        parts.append(leaves(tip + cloud * (1, 1, 0.8), 0.17, rng).of("leaf"))
    return piece("tree", parts, (4 * r, 4 * r))


def bush(rng: np.random.Generator) -> Piece:
    w, h = rng.uniform(0.7, 1.6), rng.uniform(0.6, 1.3)
    core = lump((0.8 * w, 0.8 * w, 0.9 * h), rng, 0.12).at(z=0.42 * h).of("leaf")
    around = rng.normal(size=(420, 3))
    around *= (
        0.5 * np.array([w, w, h]) * (0.8 + 0.22 * rng.random((420, 1))) / np.linalg.norm(around, axis=1, keepdims=True)
    )
    around = around[around[:, 2] > -0.4 * h]
    return piece("bush", [core, leaves(around + (0, 0, 0.45 * h), 0.1, rng).of("leaf")], (w, w))


def hedge(rng: np.random.Generator, length: float) -> Piece:
    depth, h = rng.uniform(0.5, 0.8), rng.uniform(0.9, 1.6)
    core = cushion((length, depth, h), 0.15, 0.03, 6).at(z=h / 2).of("leaf")
    count = int(160 * length)
    places = rng.uniform(-0.5, 0.5, (count, 3))
    axis = rng.integers(0, 3, count)
    places[np.arange(count), axis] = np.sign(places[np.arange(count), axis]) * 0.5
    return piece("hedge", [core, leaves(places * (length, depth, h) + (0, 0, h / 2), 0.1, rng).of("leaf")])


def lamp_post(rng: np.random.Generator) -> Piece:
    h, arm = rng.uniform(4.0, 6.5), rng.uniform(0.6, 1.3)
    parts = [lathe([(0.13, 0), (0.12, 0.35), (0.07, 0.4), (0.0, 0.4)], 10).of("dark metal"),
        pipe([(0, 0, 0.3), (0, 0, h - 0.4), (0, 0.25 * arm, h - 0.05), (0, arm, h)], [0.07, 0.05, 0.045, 0.04],
        8).of("dark metal"), cushion((0.22, 0.55, 0.1), 0.04).at(0, arm + 0.15, h - 0.02).of("dark metal")]  # fmt: skip
    return piece("lamp post", parts, (0.3, 0.3))


def sign(rng: np.random.Generator) -> Piece:
    """A traffic sign on its pole."""
    h = rng.uniform(2.2, 2.6)
    sides = int(rng.choice([3, 8, 24]))
    plate = lathe([(0.32, 0), (0.32, 0.012), (0.0, 0.012)], sides).turned(-90, "x").turned(90 if sides == 3 else 0, "y")
    return piece("traffic sign", [pipe([(0, 0, 0), (0, 0, h + 0.25)], 0.032, 8).of("metal"),
        plate.at(0, 0.034, h).of("metal")], (0.3, 0.3))  # fmt: skip


def litter_bin(rng: np.random.Generator) -> Piece:
    r = rng.uniform(0.2, 0.26)
    return piece("litter bin", [lathe([(0.9 * r, 0.05), (r, 0.1), (r, 0.75), (0.92 * r, 0.75), (0.9 * r, 0.6),
        (0.0, 0.6)], 16).of("dark metal"), lathe([(1.05 * r, 0.88), (0.6 * r, 0.98), (0.0, 1.0)], 16).of("dark metal"),
        *[pipe([(0.9 * r * c, 0, 0), (0.9 * r * c, 0, 0.9)], 0.015, 5).of("dark metal") for c in (-1, 1)]])  # fmt: skip


def wheelie_bin(rng: np.random.Generator) -> Piece:
    """A household's dustbin on wheels."""
    body = loft([[(-a, -b, z), (a, -b, z), (a, b, z), (-a, b, z)]
        for a, b, z in ((0.2, 0.22, 0.08), (0.28, 0.32, 0.95))])  # fmt: skip
    parts = [body.of("plastic"), box((-0.3, -0.36, 0.95), (0.3, 0.34, 1.03)).of("plastic")]
    parts += [lathe([(0.1, -0.03), (0.1, 0.03), (0.0, 0.03)],
        12).turned(90, "y").at(s * 0.26, -0.26, 0.1).of("rubber") for s in (-1, 1)]  # fmt: skip
    parts.append(pipe([(-0.22, -0.38, 0.98), (0.22, -0.38, 0.98)], 0.015).of("plastic"))
    return piece("dustbin", parts)


def stone(rng: np.random.Generator) -> Piece:
    w, d, h = rng.uniform(0.35, 1.2), rng.uniform(0.3, 1.0), rng.uniform(0.25, 0.8)
    return piece("rock", [lump((w, d, 1.5 * h), rng, 0.16).at(z=0.35 * h).of("stone")])


def fence(rng: np.random.Generator, length: float) -> Piece:
    """Posts, two rails and palings."""
    h = rng.uniform(0.9, 1.3)
    parts: list[Part] = [
        block(0.09, 0.09, h + 0.1, x).of("wood") for x in np.arange(-length / 2, length / 2 + 0.01, 1.6)
    ]
    if rng.random() < 0.5:
        parts += [block(length, 0.03, 0.09, 0, 0.04, z).of("wood") for z in (0.3, h - 0.2)]
        parts += [block(0.08, 0.02, h, x, 0.065).of("wood") for x in np.arange(-length / 2 + 0.05, length / 2, 0.14)]
    else:
        parts += [block(length, 0.035, 0.11, 0, 0.04, z).of("wood") for z in (0.3, 0.62, h - 0.1)]
    return piece("fence", parts)


def hay_bale(rng: np.random.Generator) -> Piece:
    r, w = rng.uniform(0.55, 0.8), rng.uniform(1.1, 1.4)
    roll = lathe([(0.93 * r, -w / 2), (r, -0.4 * w), (r, 0.4 * w), (0.93 * r, w / 2), (0.0, w / 2)], 24).turned(90, "y")
    return piece("hay bale", [roll.at(z=0.99 * r).of("grass")])
