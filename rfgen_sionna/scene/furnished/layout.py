"""Placement of pieces on a floor plan without overlaps, with free space for a radar and a person."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from rfgen_sionna._types import FloatArray
from rfgen_sionna.scene.furnished.piece import Piece
from rfgen_sionna.scene.furnished.shapes import Part

Wall = Literal["far", "near", "left", "right"]
"""Sides of a place for a radar that points along +x: far is high x, left is high y."""
FACING: dict[Wall, float] = {"right": 0.0, "far": 90.0, "left": 180.0, "near": -90.0}
"""Yaw of a piece with its back to a wall [degrees]."""
TRIES = 12
"""Tried spots of a piece, which is then left out."""
HEADROOM = 2.15
"""Height of the free space of a person [m]."""
SLACK = 0.02
"""Least gap between pieces [m]."""


@dataclass(frozen=True)
class Ground:
    """An upright box on the floor plan, turned about z [m, degrees]."""

    x: float
    y: float
    width: float
    """Extent along its own x [m]."""
    depth: float
    """Extent along its own y [m]."""
    yaw: float
    """[degrees]"""
    bottom: float = 0.0
    top: float = 10.0

    @property
    def corners(self) -> FloatArray:
        """(4, 2) [m]"""
        c, s = np.cos(np.radians(self.yaw)), np.sin(np.radians(self.yaw))
        half = 0.5 * np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) * (self.width, self.depth)
        return np.asarray(half @ [[c, s], [-s, c]] + (self.x, self.y))

    def meets(self, other: Ground, gap: float = 0.0) -> bool:
        """Whether two boxes are closer than `gap` [m]; a negative gap allows an overlap."""
        if self.bottom >= other.top - 1e-9 or other.bottom >= self.top - 1e-9:
            return False
        mine, theirs = self.corners, other.corners
        for yaw in (self.yaw, self.yaw + 90, other.yaw, other.yaw + 90):
            axis = np.array([np.cos(np.radians(yaw)), np.sin(np.radians(yaw))])
            a, b = mine @ axis, theirs @ axis
            if a.min() >= b.max() + gap or b.min() >= a.max() + gap:
                return False
        return True


@dataclass(frozen=True)
class Item:
    """A piece that has been placed."""

    kind: str
    x: float
    """[m]"""
    y: float
    """[m]"""
    yaw: float
    """Direction of its front, counter-clockwise from +y [degrees]."""
    size: tuple[float, float, float]
    """Width, depth and height [m]."""
    ground: Ground
    parts: tuple[Part, ...] = field(repr=False, compare=False)
    """One part of each finish, world frame [m]."""


def person_space(half_width: float = 1.2) -> tuple[Ground, ...]:
    """Free ground of every place: a radar at (0, 0), and a person at 1.2 … 4.3 m in front of it."""
    return (Ground(0.45, 0.0, 1.5, 1.0, 0.0, 0.0, HEADROOM), Ground(2.75, 0.0, 3.1, 2 * half_width, 0.0, 0.0, HEADROOM))


class Plan:
    """Floor plan of a place during its furnishing.

    Parameters
    ----------
    rng
        Random generator of all decisions.
    x, y
        Extent [m].
    height
        Height of the ceiling, outdoors of the pieces [m].
    free
        Ground that stays free.
    """

    def __init__(
        self,
        rng: np.random.Generator,
        x: tuple[float, float],
        y: tuple[float, float],
        height: float,
        free: Sequence[Ground],
    ) -> None:
        self.rng = rng
        self.x, self.y, self.height = x, y, height
        self.free = list(free)
        self.stand = (x, y)
        """Ranges of x and y for a radar [m]."""
        self.items: list[Item] = []
        self.shell: list[tuple[str, Part]] = []
        """Names and parts of the enclosing surfaces."""

    def ground_of(self, thing: Piece, x: float, y: float, yaw: float) -> Ground:
        return Ground(x, y, thing.width, thing.depth, yaw, thing.bottom, thing.top)

    def fits(self, ground: Ground, within: bool = True) -> bool:
        """Whether a box lies in the place, off the free ground, and apart from all pieces."""
        if within:
            corners = ground.corners
            low, high = corners.min(axis=0), corners.max(axis=0)
            if low[0] < self.x[0] or high[0] > self.x[1] or low[1] < self.y[0] or high[1] > self.y[1]:
                return False
        if any(ground.meets(each) for each in self.free):
            return False
        return not any(ground.meets(item.ground, SLACK) for item in self.items if not _flat(item))

    def put(self, thing: Piece, x: float, y: float, yaw: float, check: bool = True, within: bool = True) -> bool:
        """Place a piece at (x, y) [m], its front turned by `yaw` [degrees] from +y; returns whether it fits."""
        ground = self.ground_of(thing, x, y, yaw)
        if check and not self.fits(ground, within):
            return False
        parts = tuple(part.turned(yaw).at(x, y) for part in thing.parts)
        size = (thing.width, thing.depth, thing.top - thing.bottom)
        self.items.append(Item(thing.kind, float(x), float(y), float(yaw), size, ground, parts))
        return True

    def at_wall(
        self,
        thing: Piece,
        walls: Sequence[Wall] = ("left", "right", "far", "near"),
        gap: float = 0.03,
        where: tuple[float, float] = (0.0, 1.0),
    ) -> Item | None:
        """Place a piece with its back to one of `walls`, at a random spot of `where` as shares of the wall's length."""
        for wall in self.rng.permutation(np.array(walls)).tolist():
            for share in self.rng.uniform(*where, TRIES // 2 if len(walls) > 1 else TRIES):
                if self.put(thing, *self.wall_spot(thing, wall, float(share), gap), FACING[wall]):
                    return self.items[-1]
        return None

    def wall_spot(self, thing: Piece, wall: Wall, share: float, gap: float = 0.03) -> tuple[float, float]:
        """Centre of a piece with its back to a wall, at a share of the wall's length."""
        along = self.x if wall in ("left", "right") else self.y
        low, high = along[0] + thing.width / 2 + gap, along[1] - thing.width / 2 - gap
        u, off = low + share * max(high - low, 0.0), gap + thing.depth / 2
        if wall == "right":
            return u, self.y[0] + off
        if wall == "left":
            return u, self.y[1] - off
        return (self.x[1] - off, u) if wall == "far" else (self.x[0] + off, u)

    def anywhere(self, thing: Piece) -> bool:
        """Place a piece at a random free spot and yaw."""
        for _ in range(TRIES):
            turn = float(self.rng.uniform(0, 360))
            if self.put(thing, self.rng.uniform(*self.x), self.rng.uniform(*self.y), turn):
                return True
        return False

    def before(self, thing: Piece, item: Item, gap: float, yaw: float = 0.0, aside: float = 0.0) -> bool:
        """Place a piece in front of another, `gap` [m] away and `aside` [m] to its right, at a relative `yaw`."""
        off = 0.5 * item.size[1] + gap + thing.depth / 2
        return self.put(thing, *from_item(item, aside, off), item.yaw + yaw)

    def group(self, things: Sequence[tuple[Piece, float, float, float]], x: float, y: float, yaw: float) -> bool:
        """Place all pieces of a group, or none; each has x, y [m] and yaw [degrees] relative to the group's."""
        c, s = np.cos(np.radians(yaw)), np.sin(np.radians(yaw))
        spots = [(thing, x + c * u - s * v, y + s * u + c * v, yaw + turn) for thing, u, v, turn in things]
        grounds = [self.ground_of(*spot) for spot in spots]
        if not all(self.fits(ground) for ground in grounds):
            return False
        if any(one.meets(other) for i, one in enumerate(grounds) for other in grounds[:i]):
            return False
        for thing, a, b, turn in spots:
            self.put(thing, a, b, turn, check=False)
        return True

    def on_wall(self, thing: Piece, wall: Wall, tries: int = TRIES) -> bool:
        """Hang a piece on a wall at a free spot."""
        return any(
            self.put(thing, *self.wall_spot(thing, wall, float(self.rng.random()), 0.012), FACING[wall])
            for _ in range(tries)
        )

    def some(self, chance: float, make: Callable[[], Piece], put: Callable[[Piece], object]) -> None:
        """Make and place a piece with a probability `chance`."""
        if self.rng.random() < chance:
            put(make())


def from_item(item: Item, right: float, forward: float) -> tuple[float, float]:
    """Position (x, y) [m] at offsets along a piece's own x (`right`) and y (`forward`) [m]."""
    c, s = np.cos(np.radians(item.yaw)), np.sin(np.radians(item.yaw))
    return float(item.x + c * right - s * forward), float(item.y + s * right + c * forward)


def _flat(item: Item) -> bool:
    return item.ground.top < 0.03
