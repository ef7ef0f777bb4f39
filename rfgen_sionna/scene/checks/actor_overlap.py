"""Collisions of two actors."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from rfgen_sionna._types import FloatArray
from rfgen_sionna.scene.checks.collision import (
    ALLOWED,
    FINEST_STEP,
    Collision,
    CollisionFinder,
    FrozenMesh,
    check_times,
    report_collisions,
)
from rfgen_sionna.scene.checks.radar_distance import surface_of, winding_number
from rfgen_sionna.scene.rays import RayScene

if TYPE_CHECKING:
    from rfgen_sionna.scene.mesh_actor import MeshActor

MAX_APPROACH = 0.12
"""Largest approach of two actors between two checks [m]: less than twice the depth of a forearm."""
_COINCIDENT_SHARE, _GRID = 0.5, 5
"""Share of near vertices above which two bodies may coincide; points per axis tested for being inside both."""
_BULGE = 0.25
"""Margin of a vertex's path around the box of its ends, over the path's length: limbs move on arcs."""


@dataclass(frozen=True)
class ActorOverlap(Collision):
    """Two actors in one place; `object` names the other actor."""

    @property
    def target(self) -> str:
        return f"actor {self.object!r}"


def find_actor_overlaps(
    one: MeshActor, other: MeshActor, start: float, stop: float, viewpoint: ArrayLike = (0.0, 0.0, 0.0)
) -> Iterator[ActorOverlap]:
    """Overlaps of two actors deeper than :data:`~rfgen_sionna.scene.checks.collision.CONTACT`, in order of time.

    Args:
        one, other: the actors.
        start, stop: times [s].
        viewpoint: (3,) of the radar [m]: an actor around both the radar and the other actor is a room or a vehicle.
    """
    before: _Pair | None = None
    deep = False
    for t in check_times(start, stop):
        after = _Pair(one, other, t)
        # Actors that overlap deeply are not checked between the times.
        found = after.overlaps(viewpoint) if before is None or deep else _between(before, after, viewpoint)
        for each in found:
            deep = deep or each.depth > ALLOWED
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
    """Check that no two actors overlap from `start` to `stop` [s], as
    :func:`~rfgen_sionna.scene.checks.actors.check_collisions` for actors and surroundings.

    Raises:
        SceneError: two actors overlap, with both names, time, place and cure.
    """
    if policy == "ignore":
        return
    for one, other in combinations(actors, 2):
        found = find_actor_overlaps(one, other, start, stop, viewpoint)
        report_collisions(found, policy, "Place one of them elsewhere, let them move less", stacklevel + 1)


class _Pair:
    """Two actors at one time."""

    def __init__(self, one: MeshActor, other: MeshActor, t: float) -> None:
        self.actors, self.time = (one, other), t
        self.bodies = surface_of(one), surface_of(other)
        self.vertices = tuple(body.vertices(t) for body in self.bodies)

    def overlaps(self, viewpoint: ArrayLike) -> Iterator[ActorOverlap]:
        """Overlaps of either actor, or a part of it, with the other."""
        boxes = [x for v in self.vertices for x in (v.min(axis=0), v.max(axis=0))]
        if not _touch(*boxes) or not (_within(boxes) or _min_gap(self, boxes) <= 0.0):
            return
        for here, there in ((0, 1), (1, 0)):
            if self._is_sheet(here) or self._surrounds(here, np.asarray(viewpoint, np.float64)):
                continue
            frozen = FrozenMesh(self.bodies[there].name, self.vertices[there], self.bodies[there].faces)
            rays = RayScene([(frozen.vertices, frozen.faces)], origin=viewpoint)
            finder = CollisionFinder([frozen], rays, self.bodies[here])
            for each in finder.find(self.time, self.time):
                if np.isinf(each.depth) and self._is_sheet(there):
                    continue
                yield ActorOverlap(each.actor, each.object, each.time, each.place, each.depth)
                return
        if (coincident := self._coincident()) is not None:
            yield coincident

    def _coincident(self) -> ActorOverlap | None:
        """Overlap of two actors whose surfaces nearly coincide: no vertex of either is deep in the other."""
        from scipy.spatial import cKDTree

        small, large = sorted((0, 1), key=lambda k: float(np.ptp(self.vertices[k], axis=0).prod()))
        trees = [cKDTree(each) for each in self.vertices]
        near = trees[large].query(self.vertices[small], distance_upper_bound=ALLOWED)[0]
        if self._is_sheet(0) or self._is_sheet(1) or np.isfinite(near).mean() < _COINCIDENT_SHARE:
            return None
        low, high = self.vertices[small].min(axis=0), self.vertices[small].max(axis=0)
        points = low + (high - low) * (0.5 + np.arange(_GRID**3)[:, None] // _GRID ** np.arange(3) % _GRID) / _GRID
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
        """Whether an actor is a hollow sheet, such as clothes or a box of glass."""
        return all(each.thickness is not None for each in self.actors[which].materials)

    def _surrounds(self, which: int, viewpoint: FloatArray) -> bool:
        """Whether an actor surrounds the radar, as a room or a vehicle."""
        vertices = self.vertices[which]
        if (viewpoint < vertices.min(axis=0)).any() or (viewpoint > vertices.max(axis=0)).any():
            return False
        return bool(abs(winding_number(viewpoint, vertices, self.bodies[which].faces)[0]) > 0.75)


def _between(before: _Pair, after: _Pair, viewpoint: ArrayLike) -> Iterator[ActorOverlap]:
    """Overlaps after one time, up to the next."""
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
    if sum(ways) > MAX_APPROACH and span > FINEST_STEP:
        middle = _Pair(*before.actors, before.time + 0.5 * span)
        yield from _between(before, middle, viewpoint)
        yield from _between(middle, after, viewpoint)
    else:
        yield from after.overlaps(viewpoint)


def _min_gap(pair: _Pair, boxes: Sequence[FloatArray]) -> float:
    """Lower bound of the distance of both surfaces [m]: that of their vertices, less the reach of a triangle."""
    from scipy.spatial import cKDTree

    near = []
    slack = 0.0
    for k, (vertices, body) in enumerate(zip(pair.vertices, pair.bodies, strict=True)):
        low, high = boxes[2 - 2 * k], boxes[3 - 2 * k]
        corners = vertices[body.faces]
        touching = ((corners.min(axis=1) < high) & (corners.max(axis=1) > low)).all(axis=1)
        if not touching.any():
            return np.inf
        edges = corners[touching] - np.roll(corners[touching], 1, axis=1)
        # largest distance of a triangle's point from its nearest corner
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
