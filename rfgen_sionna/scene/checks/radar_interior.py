"""Place of a radar: in the open or in a room, not inside a building or below the ground."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rfgen_sionna._types import FloatArray
from rfgen_sionna.scene.scene import RadarScene
from rfgen_sionna.scene.scene_errors import SceneError

RINGS = (0.97, 0.7, 0.35)
"""Sines of the elevations at which rays go up. Lower ones run into hills, and from below into buildings that are open
there."""
LOW_RING = 0.07
"""Sine of the elevation at which something must be in the way at least: a roof without walls encloses nothing."""
PER_RING = 8
IN_RING, IN_ALL = 0.4, 0.6
"""Shares of the rays that must find the radar enclosed, in every ring and in all. In Sionna's towns the share in all is
0 … 0.33 in streets and 0.67 … 1 in buildings (100 random places in each town)."""
FLOOR_GAP = 0.05
"""Surfaces this close below the first one beneath the radar [m] are floors too: bottoms of houses lie on the ground."""
GROUND_SAMPLES = 24
OPEN_GROUND = 0.1
"""Share of a floor under the open sky from which it is ground, not the floor of a room."""


def check_radar_placed(position: ArrayLike, scene: RadarScene | None, in_view: Callable[[], bool]) -> None:
    """Make sure that a radar stands where it can look around: not inside of a building, below the ground, or outside of
    a room that says where its free space is (:attr:`RadarScene.interior`).

    Buildings of town models have no floor, and the sides that their faces show are no guide: in Sionna's street canyon
    they look inwards. What holds for all of them: from inside, a ray that goes up leaves through a wall or the roof,
    and whatever else it enters it leaves again, so that it crosses an odd number of surfaces; from outside an even one.
    Rooms are told from buildings by their floor: a building stands on ground that goes on under the open sky outside.

    Parameters
    ----------
    position
        (3,) of the radar [m].
    scene
        The static surroundings.
    in_view
        Whether the radar sees an actor: then what encloses both is a hall. Asked only inside of a building.

    Raises
    ------
    SceneError
        Naming the position, the object and what is allowed.
    """
    if scene is None or not scene.objects:
        return
    place = np.asarray(position, np.float64)
    where = "radar position (" + ", ".join(f"{x:g}" for x in place) + ") m"
    if scene.interior is not None:
        if not scene.interior.contains(place):
            raise SceneError(
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
        raise SceneError(
            f"{where} lies {what}: there are surfaces above it and all around, and none beneath it; place it above "
            "the ground, in the open or in a room"
        )
    if enclosing is None:
        return
    if any(surfaces.open_share(floor, place[2]) > OPEN_GROUND for floor in floors) and not in_view():
        item = scene.objects[enclosing]
        raise SceneError(
            f"{where} lies inside of {item.name!r} ({item.material}), a building that hides all that is outside of it; "
            "place the radar outside, or an actor in its view"
        )


class _Surfaces:
    """All triangles of a scene, for counting what a ray crosses."""

    def __init__(self, scene: RadarScene) -> None:
        items = scene.objects
        self.corners = np.concatenate([item.vertices[item.faces] for item in items])
        self.owner = np.repeat(np.arange(len(items)), [len(item.faces) for item in items])
        self._centre = self.corners.mean(axis=1)
        self._radius2 = ((self.corners - self._centre[:, None]) ** 2).sum(axis=2).max(axis=1)

    def crossings(self, origin: FloatArray, direction: FloatArray) -> tuple[FloatArray, NDArray[np.intp]]:
        """Distances [m], ascending, at which a ray crosses faces, and the objects' numbers. `direction` is of unit
        length."""
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
        """Number of the object that is seen most often from inside, None where the radar is not in anything; and
        whether something covers the radar above and all around, once or more often."""
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
        """Numbers of the objects just beneath a point, the nearest first."""
        distance, objects = self.crossings(place, _vertical(-1.0))
        return list(dict.fromkeys(objects[: np.searchsorted(distance, distance[:1].sum() + FLOOR_GAP)].tolist()))

    def open_share(self, number: int, height: float) -> float:
        """Share of an object's area below `height` [m] above which there is nothing, from seeded samples."""
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
    """(ray, 3) directions of one elevation; no two rings share an azimuth."""
    azimuth = 2 * np.pi * (np.arange(PER_RING) + sine) / PER_RING
    level = np.sqrt(1.0 - sine**2)
    return np.stack([level * np.cos(azimuth), level * np.sin(azimuth), np.full(PER_RING, sine)], axis=1)


def _vertical(sign: float) -> FloatArray:
    """Up or down, a little aslant: along the axes faces meet edge to edge."""
    direction = np.array([0.00123, 0.00217, sign])
    return direction / np.linalg.norm(direction)
