"""Makes the living room: `python scenes/living_room/make.py` writes scene.xml, scene.toml and meshes/ next to it.

The room is 5.8 m x 4.4 m x 2.6 m. The floor is z = 0; the origin lies on it, 0.4 m in front of the middle of a short
wall, so that a radar at (0, 0, 1) looking along +x sees a person at (3, 0, 0). The floor is free for
1.2 m < x < 4.2 m and |y| < 1.2 m. Walls, floor, ceiling and window panes are single planes that face the room (Sionna
takes a surface as a slab of its material's thickness), curtains are single sheets, everything else is closed and faces
outwards. The books are drawn from a seed.
"""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import trimesh
from trimesh import Trimesh
from trimesh.transformations import rotation_matrix

X0, X1, Y0, Y1, HEIGHT = -0.4, 5.4, -2.2, 2.2, 2.6
WINDOW = (1.8, 3.6, 0.95, 2.2)
"""Opening in the wall at Y0: x from, x to, z from, z to [m]."""
PANE = Y0 - 0.1
"""Where the window panes stand."""
DOOR = (3.9, 4.8, 0.0, 2.06)
"""Opening in the wall at Y1."""
SEED = 0

# id: (plugin, type or (relative permittivity, conductivity [S/m] at 77 GHz), thickness [m], colour)
# Ids that start with rfgen_ name materials of this package; their constants serve readers that only have Sionna.
MATERIALS = {
    "walls": ("plasterboard", 0.0125, (0.86, 0.84, 0.79)),
    "outer_wall": ("concrete", 0.2, (0.80, 0.78, 0.74)),
    "slab": ("concrete", 0.2, (0.93, 0.93, 0.92)),
    "rfgen_floorboard": ((3.66, 1.559), 0.02, (0.60, 0.43, 0.27)),
    "panes": ("glass", 0.006, (0.65, 0.80, 0.90)),
    "screen": ("glass", 0.003, (0.05, 0.05, 0.07)),
    "timber": ("wood", 0.03, (0.45, 0.28, 0.16)),
    "door_leaf": ("wood", 0.04, (0.88, 0.86, 0.82)),
    "boards": ("chipboard", 0.018, (0.72, 0.60, 0.46)),
    "paper": ("wood", 0.03, (0.55, 0.25, 0.20)),
    "fittings": ("metal", 0.002, (0.35, 0.35, 0.38)),
    "rfgen_clothing": ((1.7, 0.2913), 0.003, (0.33, 0.42, 0.50)),
    "rfgen_plastic": ((2.7, 0.1157), 0.003, (0.12, 0.12, 0.13)),
}

Part = Trimesh
OBJECTS: dict[str, tuple[str, Trimesh]] = {}


def add(name: str, material: str, *parts: Part) -> None:
    OBJECTS[name] = (material, trimesh.util.concatenate(parts))


def block(low: tuple[float, float, float], high: tuple[float, float, float]) -> Part:
    """Axis-aligned box between two corners [m]."""
    return trimesh.creation.box(bounds=np.array([low, high]))


def quad(corners: list[tuple[float, float, float]]) -> Part:
    """A rectangle of two triangles, counter-clockwise seen from the room."""
    return Trimesh(corners, [[0, 1, 2], [0, 2, 3]], process=False)


def place(part: Part, position: tuple[float, float, float] = (0, 0, 0), yaw: float = 0.0) -> Part:
    """Turn about z by `yaw` [degrees], then shift [m]."""
    moved = part.copy()
    moved.apply_transform(rotation_matrix(np.radians(yaw), (0, 0, 1)))
    moved.apply_translation(position)
    return moved


def tilt(part: Part, degrees: float, axis: tuple[float, float, float]) -> Part:
    turned = part.copy()
    turned.apply_transform(rotation_matrix(np.radians(degrees), axis))
    return turned


def cushion(size: tuple[float, float, float], radius: float, puff: float = 0.0, cells: int = 6) -> Part:
    """A box centred at the origin with rounded edges, its faces bulging out by `puff` [m]."""
    corner = np.linspace(-1.0, 1.0, cells + 1)
    # Denser towards the edges, where the rounding is.
    steps = np.sin(0.5 * np.pi * corner)
    grid = np.stack(np.meshgrid(steps, steps, indexing="ij"), -1).reshape(-1, 2)
    index = np.arange((cells + 1) ** 2).reshape(cells + 1, cells + 1)
    a, b, c, d = (m.ravel() for m in (index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]))
    square = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    points, faces = [], []
    for axis in range(3):
        for sign in (-1.0, 1.0):
            side = np.empty((len(grid), 3))
            side[:, axis] = sign
            side[:, (axis + 1) % 3], side[:, (axis + 2) % 3] = grid[:, 0], grid[:, 1]
            faces.append((square if sign > 0 else square[:, ::-1]) + len(grid) * len(points))
            points.append(side)
    mesh = Trimesh(np.concatenate(points), np.concatenate(faces), process=True)
    mesh.merge_vertices(digits_vertex=9)
    unit = mesh.vertices.copy()
    half = 0.5 * np.asarray(size)
    inner = np.clip(unit * half, -(half - radius), half - radius)
    offset = unit * half - inner
    offset *= radius / np.maximum(np.linalg.norm(offset, axis=1, keepdims=True), 1e-12)
    bulge = np.empty_like(unit)
    for axis in range(3):
        others = unit[:, [(axis + 1) % 3, (axis + 2) % 3]]
        bulge[:, axis] = puff * np.sign(unit[:, axis]) * (np.abs(unit[:, axis]) > 1 - 1e-9) * (1 - others**2).prod(1)
    mesh.vertices = inner + offset + bulge
    return mesh


def turned(profile: list[tuple[float, float]], sections: int = 20) -> Part:
    """Solid of revolution about z from (radius, height) pairs [m]; the first and last radius are 0."""
    mesh = trimesh.creation.revolve(np.array(profile), sections=sections)
    if mesh.volume < 0:
        mesh.invert()
    return mesh


def leg(foot: tuple[float, float, float], top: tuple[float, float, float], r0: float, r1: float, n: int = 8) -> Part:
    """A tapered round leg from `foot` (radius r0) to `top` (radius r1) [m]."""
    start, end = np.array(foot, float), np.array(top, float)
    length = float(np.linalg.norm(end - start))
    mesh = turned([(0, 0), (r0, 0), (r1, length), (0, length)], n)
    mesh.apply_transform(trimesh.geometry.align_vectors((0, 0, 1), (end - start) / length))
    mesh.apply_translation(start)
    return mesh


def wall_with_opening(y: float, opening: tuple[float, float, float, float]) -> list[Part]:
    """The wall at `y` around an opening, as quads that meet corner to corner."""
    xs, zs = (X0, *opening[:2], X1), (0.0, *opening[2:], HEIGHT)
    parts = []
    for i in range(3):
        for k in range(3):
            if (i, k) == (1, 1) or zs[k + 1] - zs[k] < 1e-9:
                continue
            corners = [(xs[i], y, zs[k]), (xs[i + 1], y, zs[k]), (xs[i + 1], y, zs[k + 1]), (xs[i], y, zs[k + 1])]
            # Seen from the room, +x runs to the left on the wall at Y0 (its normal is +y) and to the right at Y1.
            parts.append(quad(corners[::-1] if y < 0 else corners))
    return parts


def shell() -> None:
    add("floor", "rfgen_floorboard", quad([(X0, Y0, 0), (X1, Y0, 0), (X1, Y1, 0), (X0, Y1, 0)]))
    add("ceiling", "slab", quad([(X0, Y1, HEIGHT), (X1, Y1, HEIGHT), (X1, Y0, HEIGHT), (X0, Y0, HEIGHT)]))
    add("far wall", "walls", quad([(X1, Y0, 0), (X1, Y0, HEIGHT), (X1, Y1, HEIGHT), (X1, Y1, 0)]))
    add("near wall", "walls", quad([(X0, Y0, 0), (X0, Y1, 0), (X0, Y1, HEIGHT), (X0, Y0, HEIGHT)]))
    add("window wall", "outer_wall", *wall_with_opening(Y0, WINDOW))
    add("door wall", "walls", *wall_with_opening(Y1, DOOR))
    h, d = 0.07, 0.014
    add(
        "skirting boards",
        "timber",
        block((X0 + d, Y0, 0), (X1 - d, Y0 + d, h)),
        block((X0 + d, Y1 - d, 0), (DOOR[0] - 0.07, Y1, h)),
        block((DOOR[1] + 0.07, Y1 - d, 0), (X1 - d, Y1, h)),
        block((X0, Y0, 0), (X0 + d, Y1, h)),
        block((X1 - d, Y0, 0), (X1, Y1, h)),
    )


def window() -> None:
    x0, x1, z0, z1 = WINDOW
    depth, w, xm = 0.16, 0.06, 0.5 * (x0 + x1)
    y_pane = PANE
    add(
        "window panes",
        "panes",
        quad([(xm, y_pane, z0), (x0, y_pane, z0), (x0, y_pane, z1), (xm, y_pane, z1)]),
        quad([(x1, y_pane, z0), (xm, y_pane, z0), (xm, y_pane, z1), (x1, y_pane, z1)]),
    )
    bars = [block((x, y_pane - 0.03, z0), (x + w, y_pane + 0.03, z1)) for x in (x0, xm - w / 2, x1 - w)]
    bars += [
        block((a, y_pane - 0.025, z), (b, y_pane + 0.025, z + w))
        for z in (z0, z1 - w)
        for a, b in ((x0 + w, xm - w / 2), (xm + w / 2, x1 - w))
    ]
    add("window frame", "timber", *bars)
    add(
        "window reveal",
        "outer_wall",
        quad([(x0, Y0 - depth, z0), (x0, Y0, z0), (x0, Y0, z1), (x0, Y0 - depth, z1)]),
        quad([(x1, Y0 - depth, z0), (x1, Y0, z0), (x1, Y0, z1), (x1, Y0 - depth, z1)][::-1]),
        quad([(x0, Y0 - depth, z1), (x0, Y0, z1), (x1, Y0, z1), (x1, Y0 - depth, z1)]),
    )
    sill = cushion((x1 - x0 + 0.12, 0.22, 0.03), 0.01, cells=3)
    add("window sill", "boards", place(sill, (xm, Y0 - 0.03, z0 - 0.005)))
    add("curtains", "rfgen_clothing", *(curtain(x, 0.5) for x in (x0 - 0.42, x1 - 0.08)))
    rod = trimesh.creation.cylinder(
        0.012, segment=[(x0 - 0.5, Y0 + 0.09, 2.36), (x1 + 0.5, Y0 + 0.09, 2.36)], sections=10
    )
    knobs = [place(trimesh.creation.icosphere(1, 0.025), (x, Y0 + 0.09, 2.36)) for x in (x0 - 0.5, x1 + 0.5)]
    add("curtain rod", "fittings", rod, *knobs)


def curtain(x: float, width: float) -> Part:
    """A hanging sheet of folds that get deeper towards the floor."""
    columns, rows = 48, 4
    u, v = np.meshgrid(np.linspace(0, 1, columns + 1), np.linspace(0, 1, rows + 1), indexing="ij")
    phase = 2 * np.pi * 6 * u
    y = Y0 + 0.09 + (0.025 + 0.02 * (1 - v)) * np.sin(phase + 0.4 * np.sin(3 * u))
    points = np.stack([x + width * u + 0.006 * np.sin(2 * phase), y, 0.06 + (2.33 - 0.06) * v], -1).reshape(-1, 3)
    index = np.arange(len(points)).reshape(columns + 1, rows + 1)
    a, b, c, d = (m.ravel() for m in (index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]))
    # Facing the room, +y.
    return Trimesh(points, np.concatenate([np.stack([a, c, b], 1), np.stack([a, d, c], 1)]), process=False)


def door() -> None:
    x0, x1, _, z1 = DOOR
    y = Y1 + 0.01
    leaf = [block((x0 + 0.003, y, 0.006), (x1 - 0.003, y + 0.04, z1 - 0.003))]
    for a, b in ((0.22, 0.95), (1.12, 1.86)):
        # Raised panels.
        leaf += [place(cushion((0.62, 0.03, b - a), 0.012, cells=4), (0.5 * (x0 + x1), y + 0.004, 0.5 * (a + b)))]
    add("door", "door_leaf", *leaf)
    w, t = 0.07, 0.015
    add(
        "door frame",
        "timber",
        block((x0 - w, Y1 - t, 0), (x0, Y1 + 0.09, z1 + w)),
        block((x1, Y1 - t, 0), (x1 + w, Y1 + 0.09, z1 + w)),
        block((x0, Y1 - t, z1), (x1, Y1 + 0.09, z1 + w)),
    )
    add("threshold", "timber", block((x0, Y1, -0.01), (x1, Y1 + 0.09, 0.005)))
    hx, hz = x0 + 0.08, 1.03
    add(
        "door handle",
        "fittings",
        trimesh.creation.cylinder(0.026, segment=[(hx, y + 0.002, hz), (hx, y - 0.01, hz)], sections=14),
        trimesh.creation.cylinder(0.009, segment=[(hx, y, hz), (hx, y - 0.05, hz)], sections=10),
        place(tilt(trimesh.creation.capsule(0.12, 0.01, count=[8, 8]), 90, (0, 1, 0)), (hx - 0.01, y - 0.05, hz)),
    )


def seat(width: float, depth: float, places: int) -> tuple[list[Part], list[Part]]:
    """Upholstery and legs of a sofa or armchair with its back along y = 0, looking along +y, centred at x = 0."""
    arm = 0.17
    inner = width - 2 * arm
    cloth = [
        place(cushion((width - 0.04, depth - 0.06, 0.24), 0.04), (0, 0.5 * depth, 0.24)),
        place(tilt(cushion((width - 0.06, 0.2, 0.66), 0.08), 6, (1, 0, 0)), (0, 0.14, 0.52)),
    ]
    for side in (-1, 1):
        cloth.append(place(cushion((arm, depth - 0.02, 0.5), 0.075), (side * 0.5 * (width - arm), 0.5 * depth, 0.37)))
    each = inner / places
    for i in range(places):
        x = -0.5 * inner + (i + 0.5) * each
        cloth.append(place(cushion((each - 0.012, depth - 0.25, 0.16), 0.05, 0.018), (x, 0.5 * depth + 0.11, 0.425)))
        back = tilt(cushion((each - 0.03, 0.17, 0.42), 0.07, 0.03), 12, (1, 0, 0))
        cloth.append(place(back, (x, 0.3, 0.68)))
    legs = [
        leg((0.97 * x, y + 0.02 * np.sign(y - 0.4), 0), (x, y, 0.14), 0.014, 0.022)
        for x in (-0.5 * width + 0.1, 0.5 * width - 0.1)
        for y in (0.1, depth - 0.1)
    ]
    return cloth, legs


def seating() -> None:
    cloth, legs = seat(2.1, 0.84, 3)
    at = (2.7, Y0 + 0.15, 0.0)
    pillow = cushion((0.44, 0.13, 0.44), 0.06, 0.035)
    throw = [
        place(tilt(pillow, 22, (1, 0, 0)), (-0.68, 0.47, 0.70), 0.0),
        place(tilt(pillow, 24, (1, 0, 0)), (0.66, 0.48, 0.70), 14.0),
    ]
    add("sofa", "rfgen_clothing", *(place(p, at) for p in cloth))
    add("sofa pillows", "rfgen_clothing", *(place(p, at) for p in throw))
    add("sofa legs", "timber", *(place(p, at) for p in legs))
    cloth, legs = seat(0.86, 0.8, 1)
    at, yaw = (5.08, -1.88, 0.0), 45.0
    add("armchair", "rfgen_clothing", *(place(p, at, yaw) for p in cloth))
    add("armchair legs", "timber", *(place(p, at, yaw) for p in legs))


def coffee_table() -> None:
    x, y, r, h = 4.72, -0.25, 0.38, 0.42
    rim = [(0, h - 0.03), (r - 0.03, h - 0.03), (r - 0.008, h - 0.022), (r, h - 0.012), (r - 0.004, h), (0, h)]
    angles = np.radians([90, 210, 330])
    legs = [
        leg(
            (x + (r - 0.05) * np.cos(a), y + (r - 0.05) * np.sin(a), 0.009),
            (x + 0.6 * r * np.cos(a), y + 0.6 * r * np.sin(a), h - 0.025),
            0.013,
            0.022,
        )
        for a in angles
    ]
    add("coffee table", "timber", place(turned(rim, 36), (x, y, 0)), *legs)
    bowl = [(0, 0), (0.05, 0), (0.06, 0.012), (0.105, 0.045), (0.125, 0.085), (0.118, 0.085), (0.095, 0.045)]
    add("bowl", "screen", place(turned([*bowl, (0.05, 0.02), (0, 0.016)], 24), (x + 0.1, y + 0.08, h + 0.001)))
    add(
        "magazines",
        "paper",
        place(block((-0.105, -0.148, 0), (0.105, 0.148, 0.008)), (x - 0.12, y - 0.1, h + 0.001), 20),
        place(block((-0.1, -0.14, 0), (0.1, 0.14, 0.012)), (x - 0.11, y - 0.09, h + 0.0095), 38),
    )
    rug = cushion((1.1, 1.7, 0.008), 0.0035, cells=2)
    add("rug", "rfgen_clothing", place(rug, (4.76, -0.3, 0.0045)))


def media() -> None:
    x0, x1, y0, y1 = 1.85, 3.45, Y1 - 0.47, Y1 - 0.06
    front = [block((x0, y0, 0.14), (x1, y1, 0.5))]
    each = (x1 - x0) / 3
    for i in range(3):
        door_front = cushion((each - 0.008, 0.02, 0.34), 0.004, cells=2)
        front.append(place(door_front, (x0 + (i + 0.5) * each, y0 - 0.006, 0.32)))
    add("television stand", "boards", *front)
    handles = [
        trimesh.creation.capsule(0.12, 0.006, count=[6, 8]).apply_translation(
            (x0 + (i + 0.5) * each + 0.2 * (1 - i), y0 - 0.03, 0.26)
        )
        for i in range(3)
    ]
    add("stand handles", "fittings", *handles)
    legs = [
        leg((x + 0.03 * np.sign(x - 2.6), y, 0), (x, y, 0.145), 0.012, 0.02)
        for x in (x0 + 0.15, x1 - 0.15)
        for y in (y0 + 0.07, y1 - 0.07)
    ]
    add("stand legs", "timber", *legs)
    xm, y, z = 0.5 * (x0 + x1), Y1 - 0.27, 0.58
    body = place(cushion((1.235, 0.045, 0.72), 0.012, cells=3), (xm, y, z + 0.36))
    hump = place(cushion((0.7, 0.05, 0.4), 0.02, cells=3), (xm, y + 0.035, z + 0.27))
    feet = [
        leg((xm + s * 0.42, y + d, 0.502), (xm + s * 0.38, y, z + 0.03), 0.009, 0.009, 6)
        for s in (-1, 1)
        for d in (-0.12, 0.12)
    ]
    add("television", "rfgen_plastic", body, hump, *feet)
    add("television screen", "screen", block((xm - 0.605, y - 0.0255, z + 0.015), (xm + 0.605, y - 0.015, z + 0.705)))
    vase = [(0, 0), (0.045, 0), (0.06, 0.03), (0.072, 0.09), (0.055, 0.17), (0.03, 0.22), (0.037, 0.26)]
    inside = [(0.031, 0.258), (0.024, 0.22), (0.048, 0.17), (0.06, 0.09), (0, 0.02)]
    add("vase", "screen", place(turned(vase + inside, 24), (x0 + 0.12, 0.5 * (y0 + y1), 0.501)))
    speaker = cushion((0.9, 0.09, 0.065), 0.02, cells=3)
    add("sound bar", "rfgen_plastic", place(speaker, (xm, y0 + 0.07, 0.534)))


def bookshelf(rng: np.random.Generator) -> None:
    x0, x1, y0, y1, top, t = X1 - 0.33, X1 - 0.02, 0.42, 1.62, 1.95, 0.022
    boards = [block((x0, y, 0), (x1, y + t, top)) for y in (y0, y1 - t)]
    levels = [0.07, 0.45, 0.80, 1.13, 1.46, top - t]
    boards += [block((x0 + 0.004, y0 + t, z), (x1, y1 - t, z + t)) for z in levels]
    boards.append(block((x1 - 0.006, y0 + t, levels[0] + t), (x1 - 0.001, y1 - t, levels[-1])))
    boards.append(block((x0 + 0.03, y0 + t, 0), (x0 + 0.045, y1 - t, levels[0])))
    add("bookshelf", "boards", *boards)
    books = []
    for low, high in pairwise(levels):
        room = high - low - t
        y = y0 + t + 0.01
        end = y1 - t - rng.uniform(0.05, 0.4)
        while True:
            thick = rng.uniform(0.014, 0.05)
            tall = min(rng.uniform(0.19, 0.29), room - 0.03)
            deep = rng.uniform(0.13, 0.2)
            if y + thick > end:
                break
            front = x0 + rng.uniform(0.015, 0.04)
            book = block((front, y, low + t + 0.0005), (front + deep, y + thick, low + t + tall))
            books.append(book)
            y += thick + rng.uniform(0.0006, 0.002)
        # The last one leans against the row.
        lean = rng.uniform(12, 20)
        book = block((x0 + 0.02, 0, 0), (x0 + 0.18, 0.022, 0.2))
        book.apply_transform(rotation_matrix(np.radians(lean), (1, 0, 0)))
        book.apply_translation((0, y + 0.2 * np.sin(np.radians(lean)) + 0.002, low + t + 0.001))
        if book.bounds[1, 1] < y1 - t and book.bounds[1, 2] < high:
            books.append(book)
    add("books", "paper", *books)


def chair(at: tuple[float, float, float], yaw: float) -> list[Part]:
    """A wooden chair that looks along +x before it is turned."""
    parts = [place(cushion((0.42, 0.43, 0.035), 0.016, cells=4), (0, 0, 0.455))]
    for y in (-0.18, 0.18):
        parts.append(leg((0.19, 1.05 * y, 0), (0.17, y, 0.445), 0.013, 0.02))
        parts.append(leg((-0.22, 1.05 * y, 0), (-0.18, y, 0.445), 0.013, 0.02))
        parts.append(leg((-0.19, y, 0.44), (-0.26, y, 0.88), 0.019, 0.013))
    for i, z in enumerate((0.6, 0.72, 0.84)):
        slat = cushion((0.018, 0.37, 0.07), 0.008, cells=6)
        bent = slat.vertices.copy()
        bent[:, 0] -= 0.035 * (1 - (bent[:, 1] / 0.185) ** 2)
        slat.vertices = bent
        parts.append(place(slat, (-0.212 - 0.0185 * i, 0, z)))
    return [place(p, at, yaw) for p in parts]


def dining() -> None:
    x, y = 0.72, Y1 - 0.42
    top = place(cushion((0.9, 0.7, 0.03), 0.012, cells=4), (x, y, 0.735))
    legs = [
        leg((x + sx * 0.41, y + sy * 0.31, 0), (x + sx * 0.38, y + sy * 0.28, 0.725), 0.016, 0.026)
        for sx in (-1, 1)
        for sy in (-1, 1)
    ]
    apron = [block((x - 0.37, y + s * 0.27 - 0.01, 0.65), (x + 0.37, y + s * 0.27 + 0.01, 0.724)) for s in (-1, 1)]
    add("dining table", "timber", top, *legs, *apron)
    add("chair left", "timber", *chair((0.02, y, 0), 0))
    add("chair right", "timber", *chair((1.43, y, 0), 176))
    mug = [(0, 0), (0.036, 0), (0.04, 0.01), (0.041, 0.09), (0.037, 0.09), (0.036, 0.012), (0, 0.01)]
    add("mug", "screen", place(turned(mug, 16), (x + 0.2, y - 0.1, 0.7505)))


def lamps() -> None:
    x, y = 5.08, -0.93
    stem = [
        (0, 0.009),
        (0.14, 0.009),
        (0.145, 0.02),
        (0.13, 0.028),
        (0.016, 0.034),
        (0.012, 0.06),
        (0.012, 1.5),
        (0, 1.5),
    ]
    add("floor lamp", "fittings", place(turned(stem, 20), (x, y, 0)))
    shade = [(0.13, 1.62), (0.21, 1.34), (0.207, 1.34), (0.127, 1.62), (0.13, 1.62)]
    mesh = trimesh.creation.revolve(np.array(shade), sections=28)
    if mesh.volume < 0:
        mesh.invert()
    add("lamp shade", "rfgen_clothing", place(mesh, (x, y, 0)))
    add("lamp bulb", "panes", place(trimesh.creation.icosphere(2, 0.04), (x, y, 1.53)))
    disc = [(0, 2.5), (0.17, 2.505), (0.2, 2.53), (0.205, 2.57), (0.2, HEIGHT - 0.001), (0, HEIGHT - 0.001)]
    add("ceiling lamp", "rfgen_plastic", place(turned(disc, 28), (2.7, 0, 0)))


def picture(name: str, centre: tuple[float, float, float], width: float, height: float, yaw: float) -> None:
    """A framed picture that looks along +x before it is turned."""
    w, d = 0.035, 0.022
    bars = [place(cushion((d, width, w), 0.006, cells=2), (0.5 * d, 0, s * 0.5 * (height - w))) for s in (-1, 1)] + [
        place(cushion((d, w, height - 2 * w + 0.002), 0.006, cells=2), (0.5 * d, s * 0.5 * (width - w), 0))
        for s in (-1, 1)
    ]
    add(f"{name} frame", "timber", *(place(b, centre, yaw) for b in bars))
    half_w, half_h = 0.5 * width - 0.5 * w, 0.5 * height - 0.5 * w
    add(name, "paper", place(block((0.003, -half_w, -half_h), (0.01, half_w, half_h)), centre, yaw))


def write(folder: Path) -> None:
    meshes = folder / "meshes"
    meshes.mkdir(exist_ok=True)
    for old in meshes.glob("*.ply"):
        old.unlink()
    root = ElementTree.Element("scene", version="2.1.0")
    root.append(ElementTree.Comment(" Written by make.py; metres, z up. "))
    for name, (kind, thickness, colour) in MATERIALS.items():
        plugin = "itu-radio-material" if isinstance(kind, str) else "radio-material"
        bsdf = ElementTree.SubElement(root, "bsdf", type=plugin, id=name)
        if isinstance(kind, str):
            ElementTree.SubElement(bsdf, "string", name="type", value=kind)
        else:
            ElementTree.SubElement(bsdf, "float", name="relative_permittivity", value=str(kind[0]))
            ElementTree.SubElement(bsdf, "float", name="conductivity", value=str(kind[1]))
        ElementTree.SubElement(bsdf, "float", name="thickness", value=str(thickness))
        ElementTree.SubElement(bsdf, "rgb", name="color", value=" ".join(map(str, colour)))
    for name, (material, mesh) in OBJECTS.items():
        file = f"meshes/{name.replace(' ', '_')}.ply"
        (folder / file).write_bytes(mesh.export(file_type="ply", vertex_normal=False, include_attributes=False))
        # Sionna takes the prefix off again.
        shape = ElementTree.SubElement(root, "shape", type="ply", id="mesh-" + name.replace(" ", "_"))
        ElementTree.SubElement(shape, "string", name="filename", value=file)
        ElementTree.SubElement(shape, "boolean", name="face_normals", value="true")
        ElementTree.SubElement(shape, "ref", id=material, name="bsdf")
    ElementTree.indent(root, space="  ")
    ElementTree.ElementTree(root).write(folder / "scene.xml", encoding="utf-8")
    with (folder / "scene.xml").open("a", encoding="utf-8") as file_end:
        file_end.write("\n")
    text = "# Written by make.py: where there is free space, the room and the niche of its window; metres.\n"
    for low, high in (((X0, Y0, 0.0), (X1, Y1, HEIGHT)), ((WINDOW[0], PANE, WINDOW[2]), (WINDOW[1], Y0, WINDOW[3]))):
        text += f"\n[[interior]]\nlow = {[round(x, 6) for x in low]}\nhigh = {[round(x, 6) for x in high]}\n"
    (folder / "scene.toml").write_text(text, encoding="utf-8")


def build() -> None:
    """Fill `OBJECTS`."""
    OBJECTS.clear()
    shell()
    window()
    door()
    seating()
    coffee_table()
    media()
    bookshelf(np.random.default_rng(SEED))
    dining()
    lamps()
    picture("landscape", (X1 - 0.002, -0.35, 1.55), 0.9, 0.6, 180)
    picture("portrait", (0.75, Y1 - 0.002, 1.5), 0.45, 0.6, -90)


if __name__ == "__main__":
    build()
    write(Path(__file__).resolve().parent)
