"""Check that a radar is in the open or in a room, not inside a building or below the ground."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rfgen_sionna._types import FloatArray
from rfgen_sionna.scene.checks.radar_distance import point_text
from rfgen_sionna.scene.scene import RadarScene
from rfgen_sionna.scene.scene_errors import PlacementError

RINGS = (0.97, 0.7, 0.35)
"""Sines of the elevations of the rays; lower rays would hit hills, and buildings that are open below."""
LOW_RING = 0.07
"""Sine of the elevation of the rays that test for walls: a roof alone encloses nothing."""
PER_RING = 8
"""Rays per ring; 24 rays separate streets from buildings."""
IN_RING, IN_ALL = 0.4, 0.6
"""Enclosed shares of the rays of each ring and of all: in Sionna's towns 0 … 0.33 in streets, 0.67 … 1 in buildings."""
FLOOR_GAP = 0.05
"""Distance below the first surface under the radar within which surfaces are floors too [m]: houses on the ground."""
GROUND_SAMPLES = 24
"""Sampled points of a floor; their share under the sky is compared with 0.1."""
OPEN_GROUND = 0.1
"""Share of a floor under the open sky above which it is ground, not the floor of a room."""


def check_radar_placed(position: ArrayLike, scene: RadarScene | None, in_view: Callable[[], bool]) -> None:
    """Check that a radar is not inside a building, below the ground, or outside the :attr:`RadarScene.interior`.

    Upward rays from inside a building cross an odd number of surfaces, from outside an even one, whatever the
    orientation of its faces. A building differs from a room by its floor: ground that continues under the open sky.

    Parameters
    ----------
    position
        (3,) of the radar [m].
    scene
        Static surroundings; None is free space.
    in_view
        Function that returns whether an actor is visible, called inside a building only: a hall with actors is allowed.

    Raises
    ------
    PlacementError
        The radar is in none of the allowed places.
    """
    if scene is None or not scene.objects:
        return
    place = np.asarray(position, np.float64)
    where = f"radar position {point_text(place)} m"
    if scene.interior is not None:
        if not scene.interior.contains(place):
            raise PlacementError(
                f"{where} lies outside of the room {scene.name!r}, whose walls are opaque: place it within "
                f"{scene.interior} m"
            )
        return
    surfaces = _Surfaces(scene)
    enclosing, covered = surfaces.enclosing(place)
    if not covered:
        return
    floors = surfaces.floors(place)
    if not floors:
        _, above = surfaces.crossings(place, _vertical(1.0))
        what = f"below {scene.objects[above[0]].name!r}" if len(above) else "below the scene"
        raise PlacementError(
            f"{where} lies {what}: there are surfaces above it and all around, and none beneath it; place it above "
            "the ground, in the open or in a room"
        )
    if enclosing is None:
        return
    if any(surfaces.open_share(floor, place[2]) > OPEN_GROUND for floor in floors) and not in_view():
        item = scene.objects[enclosing]
        raise PlacementError(
            f"{where} lies inside of {item.name!r} ({item.material}), a building that occludes everything outside; "
            "place the radar outside, or an actor in its view"
        )


class _Surfaces:
    """All triangles of a scene, to count the crossings of rays."""

    def __init__(self, scene: RadarScene) -> None:
        items = scene.objects
        self.corners = np.concatenate([item.vertices[item.faces] for item in items])
        self.owner = np.repeat(np.arange(len(items)), [len(item.faces) for item in items])
        self._centre = self.corners.mean(axis=1)
        self._radius2 = ((self.corners - self._centre[:, None]) ** 2).sum(axis=2).max(axis=1)

    def crossings(self, origin: FloatArray, direction: FloatArray) -> tuple[FloatArray, NDArray[np.intp]]:
        """Ascending distances [m] of a ray's crossings, and the objects' indices; `direction` has unit length."""
        offset = self._centre - origin
        along = offset @ direction
        near = np.flatnonzero(
            (np.einsum("ij,ij->i", offset, offset) - along**2 <= self._radius2) & (along > -np.sqrt(self._radius2))
        )
        points = self.corners[near] - origin
        side = np.cross(direction, np.eye(3)[np.abs(direction).argmin()])
        side /= np.linalg.norm(side)
        x, y = points @ side, points @ np.cross(direction, side)
        turns = x * np.roll(y, -1, axis=1) - np.roll(x, -1, axis=1) * y
        hit = (turns > 0).all(axis=1) | (turns < 0).all(axis=1)
        points = points[hit]
        normal = np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0])
        distance = np.einsum("ij,ij->i", normal, points[:, 0]) / (normal @ direction)
        order = np.argsort(distance)
        order = order[distance[order] > 0.0]
        return distance[order], self.owner[near[hit][order]]

    def enclosing(self, place: FloatArray) -> tuple[int | None, bool]:
        """Index of the object that most rays leave first (None outside of all objects), and whether the radar is
        covered above and all around."""
        first: list[int] = []
        shares: list[float] = []
        for sine in (*RINGS, LOW_RING):
            crossed = [self.crossings(place, direction)[1] for direction in _ring(sine)]
            if np.mean([len(objects) > 0 for objects in crossed]) < IN_RING:
                return None, False
            if sine != LOW_RING:
                odd = [int(objects[0]) for objects in crossed if len(objects) % 2]
                first += odd
                shares.append(len(odd) / PER_RING)
        inside = min(shares) >= IN_RING and np.mean(shares) >= IN_ALL
        return (Counter(first).most_common(1)[0][0] if inside else None), True

    def floors(self, place: FloatArray) -> list[int]:
        """Indices of the objects just beneath a point, nearest first."""
        distance, objects = self.crossings(place, _vertical(-1.0))
        return list(dict.fromkeys(objects[: np.searchsorted(distance, distance[:1].sum() + FLOOR_GAP)].tolist()))

    def open_share(self, number: int, height: float) -> float:
        """Share of an object's area below `height` [m] that lies under the open sky, from seeded samples."""
        corners = self.corners[self.owner == number]
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        level = np.abs(normals[:, 2])
        rng = np.random.default_rng(0)
        weights = rng.dirichlet(np.ones(3), 4 * GROUND_SAMPLES)
        chosen = rng.choice(len(corners), 4 * GROUND_SAMPLES, p=level / level.sum())
        points = np.einsum("pc,pci->pi", weights, corners[chosen])
        points = points[points[:, 2] < height][:GROUND_SAMPLES]
        up = _vertical(1.0)
        clear = [not (self.crossings(point, up)[0] > 0.01).any() for point in points]
        return float(np.mean(clear)) if clear else 0.0


def _ring(sine: float) -> FloatArray:
    """(ray, 3) directions of one elevation, at azimuths of no other ring."""
    azimuth = 2 * np.pi * (np.arange(PER_RING) + sine) / PER_RING
    level = np.sqrt(1.0 - sine**2)
    return np.stack([level * np.cos(azimuth), level * np.sin(azimuth), np.full(PER_RING, sine)], axis=1)


def _vertical(sign: float) -> FloatArray:
    """Up or down, slightly tilted to miss edges along the axes."""
    direction = np.array([0.00123, 0.00217, sign])
    return direction / np.linalg.norm(direction)
