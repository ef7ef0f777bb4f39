"""Walls with doors and windows, floors and ceilings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from rfgen_sionna.scene.furnished.layout import FACING, Ground, Plan, Wall
from rfgen_sionna.scene.furnished.piece import merge
from rfgen_sionna.scene.furnished.shapes import Part, box, cushion, grid_faces, joined, lathe, pipe, quad

DOOR_SPACE = 0.75
"""Free space in front of a door [m]."""


@dataclass(frozen=True)
class Opening:
    """A door or a window in a wall."""

    kind: str
    """"door", "window" or "garage door"."""
    wall: Wall
    u: float
    """Its middle along the wall, x or y [m]."""
    width: float
    sill: float
    """Lower edge [m]."""
    top: float
    """Upper edge [m]."""


def enclose(
    plan: Plan,
    openings: Sequence[Opening],
    walls: str | dict[Wall, str] = "plaster",
    floor: str = "floorboards",
    ceiling: str | None = "ceiling",
    skirting: str | None = "wood",
) -> None:
    """Build floor, ceiling, walls, doors and windows of a plan, and keep the doors free; precedes the furniture."""
    (x0, x1), (y0, y1), h = plan.x, plan.y, plan.height
    plan.shell.append(("floor", quad([(x0, y0, 0), (x1, y0, 0), (x1, y1, 0), (x0, y1, 0)]).of(floor)))
    if ceiling is not None:
        plan.shell.append(("ceiling", quad([(x0, y1, h), (x1, y1, h), (x1, y0, h), (x0, y0, h)]).of(ceiling)))
    for wall in ("far", "near", "left", "right"):
        finish = walls if isinstance(walls, str) else walls[wall]
        low, high = (x0, x1) if wall in ("left", "right") else (y0, y1)
        here = [opening for opening in openings if opening.wall == wall]
        face = panel(low, high, h, here)
        plan.shell.append((f"{wall} wall", _to_wall(plan, wall, face).of(finish)))
        if skirting is not None:
            cuts = sorted((o.u - o.width / 2 - 0.08, o.u + o.width / 2 + 0.08) for o in here if o.sill == 0.0)
            ends = [low, *[c for cut in cuts for c in cut], high]
            pieces = [box((a, 0.0, 0.0), (b, 0.014, 0.07)) for a, b in zip(ends[::2], ends[1::2], strict=True) if b > a]
            plan.shell.append(("skirting board", _to_wall(plan, wall, joined(pieces)).of(skirting)))
        for opening in here:
            plan.shell += [(opening.kind, _to_wall(plan, wall, part)) for part in merge(_fill(plan.rng, opening))]
            if opening.kind == "door":
                x, y = _on_plan(plan, wall, opening.u, DOOR_SPACE / 2)
                plan.free.append(Ground(x, y, opening.width, DOOR_SPACE, FACING[wall], 0.0, opening.top + 0.05))
            elif opening.kind == "window":
                x, y = _on_plan(plan, wall, opening.u, 0.15)
                plan.free.append(Ground(x, y, opening.width, 0.3, FACING[wall], opening.sill - 0.05, h))


def add_door(plan: Plan, walls: Sequence[Wall]) -> Opening:
    """A door at a random place in one of `walls`."""
    wall: Wall = walls[int(plan.rng.integers(len(walls)))]
    low, high = plan.x if wall in ("left", "right") else plan.y
    width = plan.rng.uniform(0.82, 0.96)
    u = plan.rng.uniform(low + width / 2 + 0.15, high - width / 2 - 0.15)
    return Opening("door", wall, float(u), float(width), 0.0, 2.03)


def add_windows(plan: Plan, wall: Wall, count: int, taken: Sequence[Opening] = ()) -> list[Opening]:
    """At most `count` windows side by side in a wall, between the openings `taken`."""
    low, high = plan.x if wall in ("left", "right") else plan.y
    sill, found = plan.rng.uniform(0.8, 1.0), []
    each = (high - low) / count
    width = float(np.clip(plan.rng.uniform(0.45, 0.75) * each, 0.6, 2.2))
    top = min(plan.height - 0.25, sill + plan.rng.uniform(1.1, 1.4))
    for i in range(count):
        u = low + (i + 0.5) * each
        if all(o.wall != wall or abs(o.u - u) > 0.5 * (o.width + width) + 0.15 for o in taken):
            found.append(Opening("window", wall, float(u), width, float(sill), float(top)))
    return found


def panel(low: float, high: float, height: float, openings: Sequence[Opening]) -> Part:
    """A wall around its openings in its own frame: u along it, facing +y."""
    us = sorted({low, high, *(o.u + s * o.width / 2 for o in openings for s in (-1, 1))})
    zs = sorted({0.0, height, *(z for o in openings for z in (o.sill, o.top))})
    parts = []
    for a, b in pairwise(us):
        for c, d in pairwise(zs):
            u, z = 0.5 * (a + b), 0.5 * (c + d)
            if not any(abs(u - o.u) < o.width / 2 and o.sill < z < o.top for o in openings):
                parts.append(quad([(b, 0, c), (a, 0, c), (a, 0, d), (b, 0, d)]))
    return joined(parts)


def _to_wall(plan: Plan, wall: Wall, part: Part) -> Part:
    """From a wall's own frame, u along x and y into the place, to the world."""
    x, y, z = part.points.T
    points = {
        "right": (x, plan.y[0] + y, z),
        "left": (x, plan.y[1] - y, z),
        "far": (plan.x[1] - y, x, z),
        "near": (plan.x[0] + y, x, z),
    }[wall]
    faces = part.faces if wall in ("right", "far") else np.ascontiguousarray(part.faces[:, ::-1])
    return Part(np.stack(points, axis=1), faces, part.finish)


def _on_plan(plan: Plan, wall: Wall, u: float, off: float) -> tuple[float, float]:
    x, y, _ = _to_wall(plan, wall, Part(np.array([[u, off, 0.0]]), np.zeros((0, 3), np.int32))).points[0]
    return float(x), float(y)


def _fill(rng: np.random.Generator, opening: Opening) -> list[Part]:
    """Filling of an opening, in the wall's own frame: leaf and frame, or panes, bars, sill and curtains."""
    a, b, low, top = opening.u - opening.width / 2, opening.u + opening.width / 2, opening.sill, opening.top
    if opening.kind == "door":
        return _door(rng, a, b, top)
    if opening.kind == "garage door":
        ribs = [box((a, -0.06, z + 0.01), (b, -0.02, z + 0.49)) for z in np.arange(0.0, top - 0.1, 0.5)]
        back = box((a, -0.1, 0.0), (b, -0.05, top))
        return [
            joined([back, *ribs]).of("painted wood"),
            box((opening.u - 0.1, -0.02, 0.9), (opening.u + 0.1, 0.0, 0.94)).of("metal"),
        ]
    parts = window_parts(opening)
    if rng.random() < 0.45:
        parts.append(pipe([(a - 0.35, 0.1, top + 0.12), (b + 0.35, 0.1, top + 0.12)], 0.012).of("dark metal"))
        bottom, hung = rng.choice([0.05, max(low - 0.15, 0.05)]), rng.uniform(0.25, 0.45)
        parts += [_curtain(p, hung, float(bottom), top + 0.1).of("curtain") for p in (a - 0.3, b + 0.3 - hung)]
    elif rng.random() < 0.3:
        slats = np.arange(top - 0.02, top - rng.uniform(0.3, 1.0) * (top - low), -0.045)
        parts += [box((a + 0.06, -0.05, z), (b - 0.06, -0.02, z + 0.006)).of("white plastic") for z in slats]
    return parts


def window_parts(opening: Opening) -> list[Part]:
    """Pane, bars, reveal and sill of a window, in the wall's own frame."""
    a, b = opening.u - opening.width / 2, opening.u + opening.width / 2
    low, top = opening.sill, opening.top
    y, w, parts = -0.1, 0.055, []
    parts.append(quad([(b, y, low), (a, y, low), (a, y, top), (b, y, top)]).of("window"))
    bars = [(a, a + w), (b - w, b)] + ([(opening.u - w / 2, opening.u + w / 2)] if opening.width > 0.9 else [])
    parts += [box((p, y - 0.03, low), (q, y + 0.03, top)).of("painted wood") for p, q in bars]
    parts += [box((a, y - 0.026, z), (b, y + 0.026, z + w)).of("painted wood") for z in (low, top - w)]
    for (p, z0), (q, z1) in (((a, low), (a, top)), ((a, top), (b, top)), ((b, top), (b, low))):
        parts.append(quad([(p, -0.16, z0), (p, 0.0, z0), (q, 0.0, z1), (q, -0.16, z1)]).of("plaster"))
    parts.append(box((a - 0.05, -0.12, low - 0.03), (b + 0.05, 0.1, low)).of("painted wood"))
    return parts


def _curtain(u: float, width: float, bottom: float, top: float) -> Part:
    """A hanging sheet of folds, facing +y."""
    columns = 40
    along = np.linspace(0, 1, columns + 1)
    x, z = np.meshgrid(along, np.linspace(bottom, top, 4), indexing="ij")
    deep = 0.1 + (0.025 + 0.012 * (top - z)) * np.sin(2 * np.pi * 5 * x + 0.4 * np.sin(3 * x))
    return Part(np.stack([u + width * x, deep, z], -1).reshape(-1, 3), np.ascontiguousarray(grid_faces(columns + 1, 4)))


def _door(rng: np.random.Generator, a: float, b: float, top: float) -> list[Part]:
    leaf = [box((a + 0.003, -0.05, 0.006), (b - 0.003, -0.01, top - 0.003))]
    if rng.random() < 0.6:
        middle, width = 0.5 * (a + b), b - a - 0.26
        leaf += [
            cushion((width, 0.03, d - c), 0.012, cells=2).at(middle, -0.006, 0.5 * (c + d))
            for c, d in ((0.2, 0.95), (1.1, 1.86))
        ]
    parts = [joined(leaf).of("painted wood")]
    for u0, u1 in ((a - 0.07, a), (b, b + 0.07)):
        parts.append(box((u0, -0.1, 0), (u1, 0.015, top + 0.07)).of("wood"))
    parts.append(box((a, -0.1, top), (b, 0.015, top + 0.07)).of("wood"))
    x = a + 0.08
    parts += [
        lathe([(0.026, 0), (0.026, 0.012), (0.0, 0.012)], 12).turned(-90, "x").at(x, -0.012, 1.03).of("metal"),
        pipe([(x, -0.01, 1.03), (x, 0.045, 1.03), (x + 0.11, 0.05, 1.03)], 0.009).of("metal"),
    ]
    return parts
