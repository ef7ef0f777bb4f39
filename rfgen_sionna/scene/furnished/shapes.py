"""Shapes of furniture: small triangle meshes; closed ones face outwards."""

# ruff: noqa: RUF005  (arrays are added to tuples here, not joined)
from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from rfgen_sionna._types import FloatArray, IntArray


@dataclass(frozen=True, eq=False)
class Part:
    """A mesh of one finish."""

    points: FloatArray
    """(vertex, 3) [m]."""
    faces: IntArray
    """(face, 3), counter-clockwise from outside."""
    finish: str = ""
    """Name in :data:`~rfgen_sionna.scene.furnished.finishes.FINISHES`."""

    def of(self, finish: str) -> Part:
        """The same shape with a finish."""
        return replace(self, finish=finish)

    def at(self, x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Part:
        """Shifted by x, y, z [m]."""
        return replace(self, points=self.points + (x, y, z))

    def turned(self, degrees: float, axis: str = "z") -> Part:
        """Turned about a coordinate axis through the origin, counter-clockwise [degrees]."""
        c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
        i, j = {"x": (1, 2), "y": (2, 0), "z": (0, 1)}[axis]
        points = self.points.copy()
        points[:, i] = c * self.points[:, i] - s * self.points[:, j]
        points[:, j] = s * self.points[:, i] + c * self.points[:, j]
        return replace(self, points=points)

    def scaled(self, x: float, y: float, z: float) -> Part:
        """Stretched along the axes by positive factors."""
        return replace(self, points=self.points * (x, y, z))


def joined(parts: Sequence[Part]) -> Part:
    """One part of several, with the finish of the first."""
    starts = np.cumsum([0] + [len(part.points) for part in parts[:-1]])
    return Part(
        np.concatenate([part.points for part in parts]),
        np.concatenate([part.faces + np.int32(start) for part, start in zip(parts, starts, strict=True)]),
        parts[0].finish,
    )


def mirrored(part: Part) -> Part:
    """Mirrored left to right, x to -x."""
    return Part(part.points * (-1.0, 1.0, 1.0), np.ascontiguousarray(part.faces[:, ::-1]), part.finish)


_BOX = np.array(
    [(0, 2, 1), (0, 3, 2), (4, 5, 6), (4, 6, 7), (0, 1, 5), (0, 5, 4)]
    + [(1, 2, 6), (1, 6, 5), (2, 3, 7), (2, 7, 6), (3, 0, 4), (3, 4, 7)],
    np.int32,
)


def box(low: ArrayLike, high: ArrayLike) -> Part:
    """Axis-aligned box between two corners (3,) [m]."""
    (x0, y0, z0), (x1, y1, z1) = np.asarray(low, np.float64), np.asarray(high, np.float64)
    square = [(x0, y0), (x1, y0), (x1, y1), (x0, y1)]
    return Part(np.array([(x, y, z) for z in (z0, z1) for x, y in square]), _BOX)


def block(width: float, depth: float, height: float, x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Part:
    """Box [m] standing on z, centred at x, y."""
    return box((x - width / 2, y - depth / 2, z), (x + width / 2, y + depth / 2, z + height))


def quad(corners: ArrayLike) -> Part:
    """A rectangle of two triangles from corners (4, 3) [m], counter-clockwise from its front."""
    return Part(np.asarray(corners, np.float64), np.array([(0, 1, 2), (0, 2, 3)], np.int32))


def grid_faces(rows: int, columns: int, closed: bool = False) -> IntArray:
    """Faces of a net of `rows` times `columns` points; `closed` joins the last column to the first."""
    index = np.arange(rows * columns).reshape(rows, columns)
    if closed:
        index = np.concatenate([index, index[:, :1]], axis=1)
    a, b, c, d = (m.ravel() for m in (index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]))
    return np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)]).astype(np.int32)


def loft(sections: ArrayLike) -> Part:
    """A closed body through sections (section, point, 3) [m], with fans as ends; the points turn by the right-hand rule
    about the direction from the first to the last section."""
    rings = np.asarray(sections, np.float64)
    count, size = rings.shape[:2]
    around = np.arange(size)
    after = (around + 1) % size
    first, last = count * size, count * size + 1
    ends = [
        np.stack([np.full(size, first), after, around], 1),
        np.stack([np.full(size, last), (count - 1) * size + around, (count - 1) * size + after], 1),
    ]
    points = np.concatenate([rings.reshape(-1, 3), rings[[0, -1]].mean(axis=1)])
    return Part(points, np.concatenate([grid_faces(count, size, closed=True), *ends]).astype(np.int32))


def lathe(profile: Sequence[tuple[float, float]], sections: int = 14) -> Part:
    """Solid of revolution about z from (radius, height) pairs [m], from the bottom upwards."""
    r, z = np.asarray(profile, np.float64).T
    angle = 2 * np.pi * np.arange(sections) / sections
    rings = np.stack([np.outer(r, np.cos(angle)), np.outer(r, np.sin(angle)), np.repeat(z[:, None], sections, 1)], -1)
    return loft(rings)


def pipe(points: ArrayLike, radius: float | Sequence[float], sides: int = 6) -> Part:
    """A round bar along a line through points (point, 3) [m]; one radius, or one for each point."""
    line = np.asarray(points, np.float64)
    radii = np.broadcast_to(np.asarray(radius, np.float64), len(line))
    way = np.gradient(line, axis=0)
    way /= np.linalg.norm(way, axis=1, keepdims=True)
    across = np.eye(3)[np.abs(way).max(axis=0).argmin()]
    side = np.cross(way, across)
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    other = np.cross(way, side)
    angle = 2 * np.pi * np.arange(sides) / sides
    rim = np.cos(angle)[:, None] * side[:, None] + np.sin(angle)[:, None] * other[:, None]
    return loft(line[:, None] + radii[:, None, None] * rim)


def ring(radius: float, thickness: float, sections: int = 20, sides: int = 6) -> Part:
    """A torus about z: radius of the middle of the bar and of the bar itself [m]."""
    a, b = np.meshgrid(2 * np.pi * np.arange(sections) / sections, 2 * np.pi * np.arange(sides) / sides, indexing="ij")
    r = radius + thickness * np.cos(b)
    points = np.stack([r * np.cos(a), r * np.sin(a), thickness * np.sin(b)], -1)
    closed = np.concatenate([points, points[:1]]).reshape(-1, 3)
    faces = grid_faces(sections + 1, sides, closed=True) % (sections * sides)
    return Part(closed[: sections * sides], np.ascontiguousarray(faces[:, ::-1]))


@lru_cache(maxsize=8)
def _net(cells: int) -> tuple[FloatArray, IntArray]:
    """A cube from -1 to 1 of nets of cells, denser towards the shared edges."""
    steps = np.sin(0.5 * np.pi * np.linspace(-1.0, 1.0, cells + 1))
    plane = np.stack(np.meshgrid(steps, steps, indexing="ij"), -1).reshape(-1, 2)
    faces = grid_faces(cells + 1, cells + 1)[:, ::-1]
    points: list[FloatArray] = []
    triangles: list[IntArray] = []
    for axis in range(3):
        for sign in (-1.0, 1.0):
            side = np.empty((len(plane), 3))
            side[:, axis], side[:, (axis + 1) % 3], side[:, (axis + 2) % 3] = sign, plane[:, 0], plane[:, 1]
            triangles.append((faces if sign > 0 else faces[:, ::-1]) + len(plane) * len(points))
            points.append(side)
    _, first, inverse = np.unique(np.round(np.concatenate(points), 9), axis=0, return_index=True, return_inverse=True)
    return np.concatenate(points)[first], inverse.ravel()[np.concatenate(triangles)].astype(np.int32)


def cushion(size: ArrayLike, radius: float, puff: float = 0.0, cells: int = 4) -> Part:
    """A box [m] about the origin with rounded edges and sides that bulge by `puff` [m]."""
    unit, faces = _net(cells)
    half = 0.5 * np.asarray(size, np.float64)
    radius = min(radius, float(half.min()))
    inner = np.clip(unit * half, radius - half, half - radius)
    offset = unit * half - inner
    offset *= radius / np.maximum(np.linalg.norm(offset, axis=1, keepdims=True), 1e-12)
    points = inner + offset
    for axis in range(3):
        others = unit[:, [(axis + 1) % 3, (axis + 2) % 3]]
        edge = np.abs(unit[:, axis]) > 1 - 1e-9
        points[:, axis] += puff * np.sign(unit[:, axis]) * edge * (1 - others**2).prod(axis=1)
    return Part(points, faces)


def ball(radius: float, cells: int = 4) -> Part:
    """A sphere [m] about the origin."""
    unit, faces = _net(cells)
    return Part(radius * unit / np.linalg.norm(unit, axis=1, keepdims=True), faces)


def lump(size: ArrayLike, rng: np.random.Generator, rough: float = 0.15, cells: int = 6) -> Part:
    """An uneven ellipsoid [m] with bumps of relative depth `rough`: a bush, a stone, a heap."""
    unit, faces = _net(cells)
    unit = unit / np.linalg.norm(unit, axis=1, keepdims=True)
    waves = rng.normal(size=(6, 3)) * 3.0
    bumps = np.sin(unit @ waves.T + rng.uniform(0, 2 * np.pi, 6)).mean(axis=1)
    return Part(unit * (1 + 2 * rough * bumps)[:, None] * 0.5 * np.asarray(size, np.float64), faces)


def leaves(places: FloatArray, size: float, rng: np.random.Generator) -> Part:
    """Open square sheets of edge `size` [m] at places (leaf, 3) [m], turned at random."""
    along = rng.normal(size=(len(places), 3))
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    across = np.cross(along, rng.normal(size=(len(places), 3)))
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    edge = 0.5 * size * rng.uniform(0.6, 1.4, (len(places), 1))
    corners = np.stack([places + edge * (a * along + b * across) for a, b in ((-1, 0), (0, -1), (1, 0), (0, 1))], 1)
    first = 4 * np.arange(len(places), dtype=np.int32)[:, None]
    return Part(corners.reshape(-1, 3), np.concatenate([first + (0, 1, 2), first + (0, 2, 3)]).astype(np.int32))


def sheet(
    height: Callable[[FloatArray, FloatArray], FloatArray], low: ArrayLike, high: ArrayLike, cells: tuple[int, int]
) -> Part:
    """A surface z(x, y) over a rectangle between corners (2,) [m], facing up."""
    (x0, y0), (x1, y1) = np.asarray(low, np.float64), np.asarray(high, np.float64)
    x, y = np.meshgrid(np.linspace(x0, x1, cells[0] + 1), np.linspace(y0, y1, cells[1] + 1), indexing="ij")
    points = np.stack([x, y, height(x, y)], -1).reshape(-1, 3)
    return Part(points, np.ascontiguousarray(grid_faces(cells[0] + 1, cells[1] + 1)[:, ::-1]))
