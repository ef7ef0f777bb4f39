"""Cars and bicycles."""

# ruff: noqa: RUF005  (arrays are added to tuples here, not joined)
from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rfgen_sionna.scene.furnished.piece import Piece, pick, piece
from rfgen_sionna.scene.furnished.shapes import (
    Part,
    block,
    cushion,
    lathe,
    loft,
    mirrored,
    pipe,
    ring,
)

WHEEL_RADIUS, WHEEL_WIDTH = 0.32, 0.2
"""Of cars [m]."""


class CarShape(NamedTuple):
    """A car without wheels, about the origin; it drives towards +y."""

    parts: list[Part]
    hubs: list[tuple[float, float]]
    """Side and place along the car (x, y) of the wheels' middles [m], rear wheels first."""


def car(rng: np.random.Generator) -> Piece:
    """A saloon, an estate or a van: body, cabin with windows, wheels, lights, mirrors; it drives towards +y."""
    shape = car_body(rng, int(rng.integers(3)))
    wheels = []
    for x, y in shape.hubs:
        wheel = _wheel(WHEEL_RADIUS, WHEEL_WIDTH, abs(x), y)
        wheels += [part if x > 0 else mirrored(part) for part in wheel]
    return piece("car", [*shape.parts[:_BODY], *wheels, *shape.parts[_BODY:]])


_BODY = 9
"""Parts of a car's body and cabin."""


def car_body(rng: np.random.Generator, kind: int) -> CarShape:
    """Body, cabin with windows, lights and mirrors of a saloon (0), an estate (1) or a van (2)."""
    length, width = (4.4, 4.5, 4.9)[kind] * rng.uniform(0.93, 1.05), rng.uniform(1.72, 1.86)
    roof = (1.43, 1.48, 1.95)[kind]
    paint = pick(rng, "car paint", "painted metal", "metal", "dark metal")
    belt, low, half = (0.9, 0.92, 1.1)[kind], 0.22, length / 2
    # Stations from the tail to the nose: y, lower edge, upper edge, share of the width.
    body = {0: [(-1, 0.38, 0.82, 0.86), (-0.97, 0.30, 0.92, 0.94), (-0.6, low, 0.94, 1), (0.0, low, 0.92, 1),
        (0.4, low, 0.90, 1), (0.75, low, 0.80, 0.98), (0.95, 0.27, 0.70, 0.92), (1, 0.36, 0.60, 0.82)],
        1: [(-1, 0.38, 0.90, 0.90), (-0.97, 0.30, 0.95, 0.96), (-0.6, low, 0.95, 1), (0.0, low, 0.93, 1),
        (0.4, low, 0.91, 1), (0.75, low, 0.82, 0.98), (0.95, 0.27, 0.70, 0.92), (1, 0.36, 0.60, 0.82)],
        2: [(-1, 0.35, 1.08, 0.94), (-0.98, 0.28, 1.1, 0.98), (-0.5, low, 1.1, 1), (0.2, low, 1.1, 1),
        (0.6, low, 1.08, 1), (0.85, low, 0.98, 0.98), (0.97, 0.28, 0.85, 0.92),
        (1, 0.38, 0.7, 0.86)]}[kind]  # fmt: skip
    stations = []
    for y, z0, z1, share in body:
        w, c = 0.5 * width * share, 0.10
        stations.append([(-w, y * half, z0 + c), (-w, y * half, z1 - c), (-w + c, y * half, z1), (w - c, y * half, z1),
            (w, y * half, z1 - c), (w, y * half, z0 + c), (w - c, y * half, z0), (-w + c, y * half, z0)])  # fmt: skip
    parts = [loft(stations).of(paint)]
    outline = {0: [(-0.80, belt), (-0.42, roof), (0.08, roof), (0.42, belt - 0.02)],
        1: [(-0.97, belt), (-0.86, roof), (0.10, roof), (0.44, belt - 0.02)],
        2: [(-0.99, belt), (-0.97, roof), (0.52, roof), (0.74, belt - 0.02)]}[kind]  # fmt: skip
    parts += _cabin([(y * half, z) for y, z in outline], width, paint)
    hubs = [(s * (0.5 * width - 0.08), y) for y in (-0.60 * half, 0.62 * half) for s in (-1, 1)]
    for s in (-1, 1):
        parts.append(cushion((0.3, 0.06, 0.13), 0.03, cells=2).at(s * 0.33 * width, 0.985 * half, 0.62).of("window"))
        parts.append(cushion((0.24, 0.05, 0.16), 0.02, cells=2).at(s * 0.36 * width, -half, 0.76).of("bright plastic"))
        parts.append(cushion((0.16, 0.09, 0.12), 0.04, cells=2).at(s * (0.5 * width + 0.06), outline[3][0] - 0.25,
            belt + 0.07).of(paint))  # fmt: skip
        for y in (-0.12 * half, 0.16 * half):
            parts.append(block(0.03, 0.15, 0.025, s * 0.5 * width, y, belt - 0.16).of("metal"))
    parts.append(block(0.52, 0.03, 0.11, 0, half, 0.42).of("white plastic"))
    parts.append(block(0.52, 0.03, 0.11, 0, -half - 0.005, 0.55).of("white plastic"))
    return CarShape(parts, hubs)


def _cabin(outline: list[tuple[float, float]], width: float, paint: str) -> list[Part]:
    """Roof on pillars and glass between belt line and roof; the outline (y, z) runs from the tail over the roof."""
    (ya, za), (yb, zb), (yc, zc), (yd, zd) = outline
    wl, wh = 0.48 * width, 0.40 * width
    low = np.array([(ya, za), (yd, zd)])
    rings = [[(-wl, low[0, 0], low[0, 1]), (-wl, low[1, 0], low[1, 1]), (wl, low[1, 0], low[1, 1]),
        (wl, low[0, 0], low[0, 1])], [(-wh, yb, zb - 0.06), (-wh, yc, zc - 0.06), (wh, yc, zc - 0.06),
        (wh, yb, zb - 0.06)]]  # fmt: skip
    glass = loft([ring_[::-1] for ring_ in rings]).of("window")
    roof = cushion((2 * wh + 0.02, yc - yb + 0.06, 0.08), 0.04).at(0, 0.5 * (yb + yc), zb - 0.04).of(paint)
    parts = [glass, roof]
    for s in (-1, 1):
        lower, upper = np.array([s * wl, 0, 0]), np.array([s * wh, 0, 0])
        for y0, y1 in ((ya, yb), (yd, yc), (0.55 * ya + 0.45 * yd, 0.5 * (yb + yc))):
            z0 = za if y0 == ya else zd
            parts.append(pipe([lower + (0, y0, z0 - 0.02), upper + (0, y1, zb - 0.05)], 0.035, 6).of(paint))
    return parts


def _wheel(radius: float, width: float, x: float, y: float) -> list[Part]:
    """Tyre, rim and spokes of a wheel whose outside is at +x."""
    profile = [(0.62 * radius, -width / 2), (0.93 * radius, -width / 2), (radius, -0.3 * width), (radius, 0.3 * width),
        (0.93 * radius, width / 2), (0.64 * radius, width / 2), (0.6 * radius, 0.25 * width),
        (0.0, 0.25 * width)]  # fmt: skip
    tyre = lathe(profile, 18).turned(90, "y").at(x, y, radius).of("rubber")
    disc = lathe([(0.6 * radius, 0), (0.6 * radius, 0.02), (0.15 * radius, 0.045), (0.0, 0.045)], 18).turned(90, "y")
    return [tyre, disc.at(x + 0.27 * width, y, radius).of("metal")]


def bicycle(rng: np.random.Generator) -> Piece:
    """Wheels with spokes, frame, saddle, handlebar, pedals; it drives towards +y, leaning a little."""
    r, base = 0.34, 1.04
    back, front = np.array([0, -base / 2, r]), np.array([0, base / 2, r])
    crank, seat, head = np.array([0, -0.1, 0.29]), np.array([0, -0.27, 0.82]), np.array([0, 0.37, 0.82])
    steel, parts = pick(rng, "painted metal", "metal", "dark metal"), []
    for hub in (back, front):
        parts.append(ring(r - 0.02, 0.02, 26).turned(90, "y").at(*hub).of("rubber"))
        parts.append(ring(r - 0.045, 0.009, 26, 5).turned(90, "y").at(*hub).of("metal"))
        for a in 2 * np.pi * np.arange(10) / 10:
            parts.append(pipe([hub, hub + (0, (r - 0.05) * np.cos(a), (r - 0.05) * np.sin(a))], 0.0025, 3).of("metal"))
    for a, b in (
        (crank, seat),
        (crank, head),
        (seat - (0, 0, 0.06), head),
        (crank, back),
        (seat - (0, 0, 0.08), back),
        (head, front),
    ):
        parts.append(pipe([a, b], 0.015).of(steel))
    parts.append(pipe([seat - (0, 0, 0.05), seat + (0, -0.03, 0.1)], 0.013).of("metal"))
    parts.append(cushion((0.15, 0.26, 0.06), 0.028).at(*(seat + (0, -0.02, 0.13))).of("leather"))
    bar = head + (0, -0.02, 0.17)
    parts.append(pipe([head, bar], 0.013).of("metal"))
    parts.append(pipe([bar + (-0.29, -0.12, 0), bar + (-0.2, 0, 0.02), bar + (0.2, 0, 0.02), bar + (0.29, -0.12, 0)],
        0.012).of("metal"))  # fmt: skip
    for s in (-1, 1):
        parts.append(pipe([crank, crank + (s * 0.06, 0, 0), crank + (s * 0.08, s * 0.12, s * 0.12)], 0.009,
            5).of("metal"))  # fmt: skip
        parts.append(block(0.09, 0.09, 0.025, s * 0.12, crank[1] + s * 0.12, crank[2] + s * 0.12).of("plastic"))
    parts.append(lathe([(0.09, 0), (0.09, 0.01), (0.0, 0.01)], 16).turned(90, "y").at(0.02, *crank[1:]).of("metal"))
    return piece("bicycle", parts)
