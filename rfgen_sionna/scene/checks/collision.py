"""Collisions of actors with the surfaces of a scene."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import FloatArray, IntArray
from rfgen_sionna.scene.checks.radar_distance import Obstacle, distance, surface_of, winding_number
from rfgen_sionna.scene.rays import Hits, RayScene
from rfgen_sionna.scene.scene import StaticObject
from rfgen_sionna.scene.scene_errors import PlacementError

CONTACT = 0.02
"""Depth of contact with a surface [m]: feet on the floor, a hand on a table."""
ALLOWED = 0.05
"""Depth by which cushions and flesh give way [m], as of a seated person."""
STEP = 0.1
"""Time between checks [s], refined where an actor crosses a surface between two of them."""
FINEST_STEP = 1e-4
"""Shortest time between checks [s]; ends the bisection."""
ROUNDING = 1e-5
"""Margin of boxes around ray hits [m], for the rounding of float32."""
SHIFT = 0.05
"""Largest motion of a vertex between checks [m] without refinement."""
SPACING = 0.03
"""Distance of the points on the scene's edges that are tested for being inside an actor [m]."""
_SAMPLES = 128
"""Most vertices of a part whose depth is measured, for speed."""
_DIRECTIONS = np.array(
    [(x, y, z) for x in (-1, 0, 1) for y in (-1, 0, 1) for z in (-1, 0, 1) if (x, y, z) != (0, 0, 0)]
)
_DIRECTIONS = _DIRECTIONS / np.linalg.norm(_DIRECTIONS, axis=1, keepdims=True)


@dataclass(frozen=True)
class FrozenMesh:
    """A moving mesh at one time."""

    name: str
    vertices: FloatArray
    """(vertex, 3) [m]."""
    faces: IntArray
    """(face, 3)."""


@dataclass(frozen=True)
class Collision:
    """An actor and an object of the scene in one place."""

    actor: str
    object: str
    time: float
    """[s]"""
    place: tuple[float, float, float]
    """Deepest point [m]."""
    depth: float
    """Depth of the actor behind the surface, or of the object in the actor [m]; `inf` for a whole actor in the
    object or through it."""

    @property
    def target(self) -> str:
        """The object, for messages."""
        return f"{self.object!r} of the scene"

    def __str__(self) -> str:
        where = "(" + ", ".join(f"{x:.2f}" for x in self.place) + ") m"
        how = "goes through" if np.isinf(self.depth) else f"is {100 * self.depth:.0f} cm deep in"
        return f"actor {self.actor!r} {how} {self.target} at t = {self.time:.2f} s, at {where}"


class CollisionFinder:
    """Search for collisions of one actor with static objects.

    The actor's edges are rays. Edges that cross a surface divide the actor into parts before and behind it; the depth
    is the distance of the smaller part's points from the surface. Objects thinner than the actor, such as poles and
    table tops, are found by points on their edges that lie inside the actor.

    Parameters
    ----------
    objects
        Static objects.
    rays
        Their surfaces, in the same order.
    actor
        A moving mesh of constant faces.
    """

    def __init__(self, objects: Sequence[FrozenMesh | StaticObject], rays: RayScene, actor: Obstacle) -> None:
        self._items = objects
        self._rays = rays
        self._actor = actor = surface_of(actor)
        self._edges = _unique_edges(actor.faces)
        # Facet through which each vertex has crossed to the other side, -1 for none.
        self._crossed = np.full(int(actor.faces.max()) + 1, -1)
        self._shells = _components(self._edges, int(actor.faces.max()) + 1)
        self._corners = np.concatenate([item.vertices[item.faces] for item in self._items])
        self._owner = np.repeat(np.arange(len(self._items)), [len(item.faces) for item in self._items])

    def find(self, start: float, stop: float) -> Iterator[Collision]:
        """Collisions deeper than :data:`CONTACT` from `start` to `stop` [s], in order of time."""
        times = check_times(start, stop)
        poses = [self._actor.vertices(t) for t in times]
        low, high = np.min([p.min(axis=0) for p in poses], axis=0), np.max([p.max(axis=0) for p in poses], axis=0)
        corners = self._corners
        boxes = corners.min(axis=1) - ROUNDING, corners.max(axis=1) + ROUNDING
        self._near = np.flatnonzero(_overlap(*boxes, low, high))
        self._boxes = boxes[0][self._near], boxes[1][self._near]
        points = self._edge_points(low, high)
        yield from self._inside(poses[0], times[0])
        yield from self._at(times[0], poses[0], points)
        for i in range(1, len(times)):
            yield from self._between(times[i - 1], poses[i - 1], times[i], poses[i], points)
            yield from self._at(times[i], poses[i], points)

    def _between(
        self, t0: float, before: FloatArray, t1: float, after: FloatArray, points: tuple[FloatArray, NDArray[np.intp]]
    ) -> Iterator[Collision]:
        """Collisions of an actor between two times."""
        way = np.linalg.norm(after - before, axis=1)
        crossing, hits = self._crossing(before, after)
        # Distances of each vertex from the surface, before and after.
        share = hits.distance / way[crossing]
        along = np.einsum("ij,ij->i", (after - before)[crossing], self._normals(hits.facet))
        depth = np.abs(along) * np.minimum(share, 1.0 - share)
        if way.max() > SHIFT and t1 - t0 > FINEST_STEP and depth.max(initial=0.0) > CONTACT:
            t = 0.5 * (t0 + t1)
            middle = self._actor.vertices(t)
            yield from self._between(t0, before, t, middle, points)
            yield from self._at(t, middle, points)
            yield from self._between(t, middle, t1, after, points)
            return
        self._crossed[crossing] = np.where(self._crossed[crossing] < 0, hits.facet, -1)
        # A thin actor may never be on both sides at a checked time.
        through = np.flatnonzero(self._crossed >= 0)
        if len(through) > 0.5 * len(way):
            number = int(np.bincount(self._owner[self._crossed[through]]).argmax())
            facets = np.unique(self._crossed[through])
            depth = self._depth(after[through[:_SAMPLES]], number, facets[self._owner[facets] == number])
            if depth.max() > CONTACT:
                yield self._collision(number, t1, after[through[depth.argmax()]], np.inf)

    def _at(self, t: float, vertices: FloatArray, points: tuple[FloatArray, NDArray[np.intp]]) -> Iterator[Collision]:
        yield from self._behind(t, vertices)
        yield from self._within(t, vertices, *points)

    def _behind(self, t: float, vertices: FloatArray) -> Iterator[Collision]:
        """Parts of the actor behind surfaces that cut it."""
        cut, hits = self._crossing(vertices[self._edges[:, 0]], vertices[self._edges[:, 1]])
        if not len(cut):
            return
        whole = np.ones(len(self._edges), np.bool_)
        whole[cut] = False
        parts = _components(self._edges[whole], len(self._shells))
        sizes = np.bincount(parts)
        ends = self._edges[cut]
        joined = parts[ends]
        for shell in np.unique(self._shells[ends[:, 0]]):
            reached = {int(np.argmax(np.where(self._sizes_of(shell, parts, len(sizes)), sizes, -1)))}
            while True:
                # Neighbouring parts of those reached, and the edges between them.
                known = np.isin(joined, list(reached))
                leading = np.flatnonzero(known[:, 0] ^ known[:, 1])
                leading = leading[self._shells[ends[leading, 0]] == shell]
                if not len(leading):
                    break
                through = np.where(known[leading, 0], joined[leading, 1], joined[leading, 0])
                for part in np.unique(through):
                    yield from self._part(
                        t, vertices, np.flatnonzero(parts == part), hits.facet[leading[through == part]]
                    )
                reached.update(through.tolist())

    def _sizes_of(self, shell: int, parts: NDArray[np.int32], count: int) -> NDArray[np.bool_]:
        """(part,) whether a part belongs to a shell."""
        return np.bincount(parts[self._shells == shell], minlength=count) > 0

    def _part(
        self, t: float, vertices: FloatArray, members: NDArray[np.intp], facets: NDArray[np.int64]
    ) -> Iterator[Collision]:
        """Collision of a part, whose edges to the rest of the actor cross `facets`."""
        facets, counts = np.unique(facets, return_counts=True)
        number = int(np.bincount(self._owner[facets], weights=counts).argmax())
        members = members[:: max(1, len(members) // _SAMPLES)]
        depth = self._depth(vertices[members], number, facets[self._owner[facets] == number])
        deepest = int(depth.argmax())
        if depth[deepest] > CONTACT:
            yield self._collision(number, t, vertices[members[deepest]], float(depth[deepest]))

    def _depth(self, points: FloatArray, number: int, facets: NDArray[np.int64]) -> FloatArray:
        """(point,) distance [m] from an object crossed in `facets`: an upper bound, exact for flat surfaces."""
        from trimesh.triangles import closest_point

        facets = facets[:: max(1, len(facets) // 32)]
        corners = self._corners[facets]
        near = closest_point(
            np.repeat(corners, len(points), axis=0).reshape(-1, 3, 3), np.tile(points, (len(facets), 1))
        ).reshape(len(facets), len(points), 3)
        depth = np.linalg.norm(near - points, axis=2).min(axis=0)
        hits = self._rays.first_hit(np.repeat(points, len(_DIRECTIONS), axis=0), np.tile(_DIRECTIONS, (len(points), 1)))
        reach = np.where(hits.object == number, hits.distance, np.inf).reshape(len(points), -1).min(axis=1)
        return np.asarray(np.minimum(depth, reach))

    def _within(
        self, t: float, vertices: FloatArray, points: FloatArray, owner: NDArray[np.intp]
    ) -> Iterator[Collision]:
        """Points of the scene's edges inside the actor."""
        from scipy.spatial import cKDTree

        low, high = vertices.min(axis=0) + CONTACT, vertices.max(axis=0) - CONTACT
        index = np.flatnonzero(((points > low) & (points < high)).all(axis=1))
        if not len(index):
            return
        faces = self._actor.faces
        # A point before the nearest face, further from its centre than its width, is outside.
        corners = vertices[faces]
        middle = corners.mean(axis=1)
        wide = np.linalg.norm(corners - middle[:, None], axis=2).max(axis=1)
        gap, nearest = cKDTree(middle).query(points[index])
        normals = np.cross(corners[nearest, 1] - corners[nearest, 0], corners[nearest, 2] - corners[nearest, 0])
        behind = np.einsum("ij,ij->i", points[index] - middle[nearest], normals) < 0.0
        chosen = (gap > CONTACT) & (behind | (gap < wide[nearest]))
        index, gap = index[chosen], gap[chosen]
        for i in index[np.argsort(-gap, kind="stable")][:8]:
            if winding_number(points[i], vertices, faces)[0] < 0.5:
                continue
            depth = distance(points[i], vertices, faces)
            if depth > CONTACT:
                yield self._collision(int(owner[i]), t, points[i], depth)
                return

    def _inside(self, vertices: FloatArray, t: float) -> Iterator[Collision]:
        """Closed objects around the whole actor, other than rooms around the radar."""
        point = vertices[self._edges[0, 0]]
        low, high = vertices.min(axis=0), vertices.max(axis=0)
        for number, item in enumerate(self._items):
            if (low <= item.vertices.min(axis=0)).any() or (high >= item.vertices.max(axis=0)).any():
                continue
            turns = winding_number(np.stack([point, self._rays.origin]), item.vertices, item.faces)
            if abs(turns[0]) > 0.75 and abs(turns[1]) < 0.75:
                yield self._collision(number, t, point, np.inf)

    def _edge_points(self, low: FloatArray, high: FloatArray) -> tuple[FloatArray, NDArray[np.intp]]:
        """Points (point, 3) [m] on the scene's edges within a box, and the indices of their objects."""
        corners = self._corners[self._near]
        start, end = corners.reshape(-1, 3), np.roll(corners, -1, axis=1).reshape(-1, 3)
        near = _overlap(np.minimum(start, end), np.maximum(start, end), low, high)
        start, end, owner = start[near], end[near], np.repeat(self._owner[self._near], 3)[near]
        counts = np.maximum(1, np.ceil(np.linalg.norm(end - start, axis=1) / SPACING)).astype(np.intp)
        which = np.repeat(np.arange(len(counts)), counts)
        share = (np.arange(len(which)) - np.repeat(np.cumsum(counts) - counts, counts)) / counts[which]
        points = start[which] + share[:, None] * (end - start)[which]
        held = ((points > low) & (points < high)).all(axis=1)
        return points[held], owner[which[held]]

    def _crossing(self, start: FloatArray, end: FloatArray) -> tuple[NDArray[np.intp], Hits]:
        """Indices of the segments from `start` to `end` that cross a surface, and their first hits."""
        low, high = np.minimum(start, end) - ROUNDING, np.maximum(start, end) + ROUNDING
        near = np.flatnonzero(_overlap(*self._boxes, low.min(axis=0), high.max(axis=0)))
        owner = self._owner[self._near[near]]
        chosen = np.zeros(len(start), np.bool_)
        for number in np.unique(owner):
            mine = near[owner == number]
            chosen |= _overlap(low, high, self._boxes[0][mine].min(axis=0), self._boxes[1][mine].max(axis=0))
        along = end - start
        index = np.flatnonzero(chosen & along.any(axis=1))
        hits = self._rays.first_hit(start[index], along[index])
        crossed = hits.distance < np.linalg.norm(along[index], axis=1)
        return index[crossed], hits.take(crossed)

    def _normals(self, facets: NDArray[np.int64]) -> FloatArray:
        corners = self._corners[facets]
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        return np.asarray(normals / np.linalg.norm(normals, axis=1, keepdims=True))

    def _collision(self, number: int, t: float, place: FloatArray, depth: float) -> Collision:
        x, y, z = place.tolist()
        return Collision(self._actor.name, self._items[number].name, t, (x, y, z), depth)


def _overlap(low: FloatArray, high: FloatArray, box_low: FloatArray, box_high: FloatArray) -> NDArray[np.bool_]:
    """(box,) which of many boxes (box, 3) overlap with one (3,)."""
    return np.asarray(((low < box_high) & (high > box_low)).all(axis=1))


def _unique_edges(faces: NDArray[np.int32]) -> NDArray[np.int64]:
    edges = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2).astype(np.int64), axis=1)
    return np.unique(edges, axis=0)


def _components(edges: NDArray[np.int64], count: int) -> NDArray[np.int32]:
    """(vertex,) index of the connected part of each vertex."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    graph = coo_array((np.ones(len(edges), np.bool_), (edges[:, 0], edges[:, 1])), shape=(count, count))
    return np.asarray(connected_components(graph, directed=False)[1])


def check_times(start: float, stop: float) -> list[float]:
    """Times from `start` to `stop` [s] at most :data:`STEP` apart."""
    return [float(t) for t in np.linspace(start, stop, 1 + max(0, int(np.ceil((stop - start) / STEP - 1e-9))))]


def deepest(found: Sequence[Collision]) -> list[Collision]:
    """Deepest collision of each actor with each object, in order of depth."""
    worst: dict[tuple[str, str], Collision] = {}
    for each in found:
        key = each.actor, each.object
        if key not in worst or each.depth > worst[key].depth:
            worst[key] = each
    return sorted(worst.values(), key=lambda each: -each.depth)


def report_collisions(found: Iterable[Collision], policy: str, remedy: str, stacklevel: int) -> None:
    """Refuse collisions deeper than :data:`ALLOWED` with `policy` "error", and warn of the deepest of all others.

    Raises
    ------
    PlacementError
        At the first refused collision; the message ends with `remedy`.
    """
    collisions: list[Collision] = []
    for each in found:
        if each.depth > ALLOWED and policy == "error":
            raise PlacementError(
                f"{each}; allowed are {100 * ALLOWED:g} cm. {remedy}, or say Simulator(..., collisions='warn') if it "
                "is meant"
            )
        collisions.append(each)
    if collisions:
        warnings.warn("; ".join(map(str, deepest(collisions))), stacklevel=stacklevel + 1)
