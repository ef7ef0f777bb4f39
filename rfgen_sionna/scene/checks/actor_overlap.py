"""Collisions of two actors: people that walk through each other, a hand in somebody's chest."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from rfgen_sionna._types import FloatArray, IntArray
from rfgen_sionna.scene.checks.collision import (
    ALLOWED,
    FINEST_STEP,
    STEP,
    Collision,
    CollisionFinder,
    report_collisions,
)
from rfgen_sionna.scene.checks.radar_distance import surface_of, winding_number
from rfgen_sionna.scene.rays import RayScene

if TYPE_CHECKING:
    from rfgen_sionna.scene.mesh_actor import MeshActor

SHIFT = 0.12
"""Instants are close enough where actors come no nearer to each other [m] from one to the next: less than two depths
of a forearm or a head, so that none passes another unseen."""
_ALIKE, _INSIDE = 0.5, 5
"""Share of the vertices of the smaller of two that are near the other's where both may be in one place and neither's
surface deep in the other, and how many points along each axis are looked at whether they are within both."""
_BULGE = 0.25
"""Share of its way that a vertex may leave the box around the way's ends: limbs move on arcs."""


@dataclass(frozen=True)
class ActorOverlap(Collision):
    """Two actors in one place; `object` is the other actor's name."""

    def __str__(self) -> str:
        where = "(" + ", ".join(f"{x:.2f}" for x in self.place) + ") m"
        how = "goes through" if np.isinf(self.depth) else f"is {100 * self.depth:.0f} cm deep in"
        return f"actor {self.actor!r} {how} actor {self.object!r} at t = {self.time:.2f} s, at {where}"


def find_actor_overlaps(
    one: MeshActor, other: MeshActor, start: float, stop: float, viewpoint: ArrayLike = (0.0, 0.0, 0.0)
) -> Iterator[ActorOverlap]:
    """Encounters of two actors deeper than :data:`~rfgen_sionna.scene.checks.collision.CONTACT`, in order of time.

    Args:
        one, other: the actors; the order only decides which of them is called the one that is in the other.
        start, stop: time to look at [s].
        eye: (3,) [m] of the radar: an actor that surrounds both it and the other is a room or a vehicle around them.
    """
    times = np.linspace(start, stop, 1 + max(0, int(np.ceil((stop - start) / STEP - 1e-9)))).tolist()
    before = _Instant(one, other, times[0])
    met = False
    for each in before.overlaps(viewpoint):
        met = met or each.depth > ALLOWED
        yield each
    for t in times[1:]:
        after = _Instant(one, other, t)
        # those who are in one place already needn't be looked at between the instants
        for each in after.overlaps(viewpoint) if met else _between(before, after, viewpoint):
            met = met or each.depth > ALLOWED
            yield each
        before = after


def check_actor_overlaps(
    actors: Sequence[MeshActor],
    start: float,
    stop: float,
    policy: str,
    stacklevel: int,
    viewpoint: ArrayLike = (0.0, 0.0, 0.0),
) -> None:
    """Make sure that no two actors are in one place from `start` to `stop` [s], as
    :func:`~rfgen_sionna.scene.checks.actors.check_collisions` does for actors and surroundings.

    Raises:
        SceneError: naming both actors, time and place, and what to do.
    """
    if policy == "ignore":
        return
    for one, other in combinations(actors, 2):
        found = find_actor_overlaps(one, other, start, stop, viewpoint)
        report_collisions(found, policy, "Place one of them elsewhere, let them move less", stacklevel + 1)


class _Instant:
    """Both actors at one time."""

    def __init__(self, one: MeshActor, other: MeshActor, t: float) -> None:
        self.actors, self.time = (one, other), t
        self.bodies = surface_of(one), surface_of(other)
        self.vertices = tuple(body.vertices(t) for body in self.bodies)

    def overlaps(self, viewpoint: ArrayLike) -> Iterator[ActorOverlap]:
        """Parts of one actor in the other, or the whole of either."""
        boxes = [x for v in self.vertices for x in (v.min(axis=0), v.max(axis=0))]
        if not _touch(*boxes) or not (_within(boxes) or _min_gap(self, boxes) <= 0.0):
            return
        for here, there in ((0, 1), (1, 0)):
            if self._is_sheet(here) or self._surrounds(here, np.asarray(viewpoint, np.float64)):
                continue
            still = _Still(self.bodies[there].name, self.vertices[there], self.bodies[there].faces)
            rays = RayScene([(still.vertices, still.faces)], origin=viewpoint)
            finder = CollisionFinder(_StaticMeshes((still,)), rays, self.bodies[here])
            for each in finder.find(self.time, self.time):
                if np.isinf(each.depth) and self._is_sheet(there):
                    continue
                yield ActorOverlap(each.actor, each.object, each.time, each.place, each.depth)
                return
        if (coincident := self._coincident()) is not None:
            yield coincident

    def _coincident(self) -> ActorOverlap | None:
        """The encounter of two that are in nearly the same place, surface by surface: no vertex of either is deep in
        the other, and what is within is."""
        from scipy.spatial import cKDTree

        small, large = sorted((0, 1), key=lambda k: float(np.ptp(self.vertices[k], axis=0).prod()))
        trees = [cKDTree(each) for each in self.vertices]
        near = trees[large].query(self.vertices[small], distance_upper_bound=ALLOWED)[0]
        if self._is_sheet(0) or self._is_sheet(1) or np.isfinite(near).mean() < _ALIKE:
            return None
        low, high = self.vertices[small].min(axis=0), self.vertices[small].max(axis=0)
        points = (
            low + (high - low) * (0.5 + np.arange(_INSIDE**3)[:, None] // _INSIDE ** np.arange(3) % _INSIDE) / _INSIDE
        )
        depth = np.min([tree.query(points)[0] for tree in trees], axis=0)
        for point in np.flatnonzero(depth > ALLOWED)[np.argsort(-depth[depth > ALLOWED])]:
            both = (
                winding_number(points[point], v, a.faces)[0] for v, a in zip(self.vertices, self.bodies, strict=True)
            )
            if all(abs(times) > 0.75 for times in both):
                names = self.actors[small].name, self.actors[large].name
                x, y, z = points[point].tolist()
                return ActorOverlap(*names, self.time, (x, y, z), float(depth[point]))
        return None

    def _is_sheet(self, which: int) -> bool:
        """Whether an actor's surface is a sheet, such as clothes or a box of glass, with room for others in it."""
        return self.actors[which].properties.thickness is not None

    def _surrounds(self, which: int, viewpoint: FloatArray) -> bool:
        """Whether an actor surrounds the radar, as a room or a vehicle: then the others are in it rightly."""
        vertices = self.vertices[which]
        if (viewpoint < vertices.min(axis=0)).any() or (viewpoint > vertices.max(axis=0)).any():
            return False
        return bool(abs(winding_number(viewpoint, vertices, self.bodies[which].faces)[0]) > 0.75)


@dataclass(frozen=True)
class _Still:
    """An actor that is looked at as if it were a thing that stays."""

    name: str
    vertices: FloatArray
    faces: IntArray


@dataclass(frozen=True)
class _StaticMeshes:
    objects: tuple[_Still, ...]


def _between(before: _Instant, after: _Instant, viewpoint: ArrayLike) -> Iterator[ActorOverlap]:
    """Encounters later than one instant, up to the next."""
    ways = [np.linalg.norm(b - a, axis=1).max() for a, b in zip(before.vertices, after.vertices, strict=True)]
    boxes = []
    for a, b, way in zip(before.vertices, after.vertices, ways, strict=True):
        margin = _BULGE * way
        boxes += [np.minimum(a, b).min(axis=0) - margin, np.maximum(a, b).max(axis=0) + margin]
    if not _touch(*boxes):
        return
    span = after.time - before.time
    if _min_gap(before, boxes) > sum(ways):
        return
    if sum(ways) > SHIFT and span > FINEST_STEP:
        middle = _Instant(*before.actors, before.time + 0.5 * span)
        yield from _between(before, middle, viewpoint)
        yield from _between(middle, after, viewpoint)
    else:
        yield from after.overlaps(viewpoint)


def _min_gap(instant: _Instant, boxes: Sequence[FloatArray]) -> float:
    """Distance [m] below which the surfaces of both actors cannot be: that of their vertices less half their edges."""
    from scipy.spatial import cKDTree

    near = []
    slack = 0.0
    for k, (vertices, body) in enumerate(zip(instant.vertices, instant.bodies, strict=True)):
        low, high = boxes[2 - 2 * k], boxes[3 - 2 * k]
        corners = vertices[body.faces]
        touching = ((corners.min(axis=1) < high) & (corners.max(axis=1) > low)).all(axis=1)
        if not touching.any():
            return np.inf
        edges = corners[touching] - np.roll(corners[touching], 1, axis=1)
        # no point of a triangle is further from its nearest corner than this
        slack += float(np.linalg.norm(edges, axis=2).max()) / np.sqrt(3.0)
        near.append(vertices[np.unique(body.faces[touching])])
    gap, _ = cKDTree(near[0]).query(near[1])
    return float(gap.min()) - slack


def _within(boxes: Sequence[FloatArray]) -> bool:
    """Whether one of two boxes (low, high, low, high) lies in the other."""
    low, high, other_low, other_high = boxes
    return bool(((low >= other_low) & (high <= other_high)).all() or ((other_low >= low) & (other_high <= high)).all())


def _touch(low: FloatArray, high: FloatArray, other_low: FloatArray, other_high: FloatArray) -> bool:
    return bool(((low < other_high) & (high > other_low)).all())
