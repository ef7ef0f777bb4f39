"""Checks of the free space around a radar, and distances to surfaces."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from rfgen_sionna._types import FloatArray, IntArray
from rfgen_sionna.radar import Radar
from rfgen_sionna.scene.mesh import used_vertices
from rfgen_sionna.scene.mesh_files import LARGE_MESH, units_hint
from rfgen_sionna.scene.scene import RadarScene
from rfgen_sionna.scene.scene_errors import PlacementError

CLEARANCE = 0.02
"""Free space needed around a radar's centre [m]: antenna arrays are a few centimetres wide."""
ROOM_RADIUS = 0.5
"""Least distance of a closed surface around the radar [m] at which it counts as a room, not as a wall or furniture."""
PATH_STEP = 1e-3
"""Time between positions of a moving radar's path [s]: at 10 m/s half the clearance."""


class Obstacle(Protocol):
    """A moving mesh: an actor, or an actor relative to a moving radar."""

    @property
    def name(self) -> str: ...

    @property
    def faces(self) -> IntArray:
        """(face, 3)"""

    @property
    def vertices(self) -> Callable[[float], FloatArray]:
        """Time [s] to (vertex, 3) positions [m]."""


@dataclass(frozen=True)
class _Surface:
    name: str
    faces: IntArray
    vertices: Callable[[float], FloatArray]


def surface_of(body: Obstacle) -> Obstacle:
    """A body without its unused vertices."""
    used, faces = used_vertices(body.faces)
    return _Surface(body.name, faces, lambda t: body.vertices(t)[used])


def winding_number(points: ArrayLike, vertices: FloatArray, faces: IntArray) -> FloatArray:
    """(point,) winding number of a surface around points (point, 3) [m]: sum of its solid angles over 4 pi.

    1 inside a closed surface that faces outwards, -1 if it faces inwards, 0 outside, fractions for open surfaces.
    Source of the solid angle: A. van Oosterom and J. Strackee, IEEE Trans. Biomed. Eng. 30 (1983) 125.
    """
    queries = np.atleast_2d(np.asarray(points, np.float64))
    total = np.empty(len(queries))
    for i, point in enumerate(queries):
        a, b, c = (vertices[faces[:, k]] - point for k in range(3))
        la, lb, lc = (np.linalg.norm(v, axis=1) for v in (a, b, c))
        numerator = np.einsum("ij,ij->i", a, np.cross(b, c))
        denominator = la * lb * lc
        for u, v, w in ((a, b, lc), (b, c, la), (c, a, lb)):
            denominator = denominator + np.einsum("ij,ij->i", u, v) * w
        total[i] = np.arctan2(numerator, denominator).sum() / (2.0 * np.pi)
    return total


def distance(point: ArrayLike, vertices: FloatArray, faces: IntArray) -> float:
    """Distance [m] of a point (3,) [m] from a surface."""
    from trimesh.triangles import closest_point

    query = np.asarray(point, np.float64)
    nearest = closest_point(vertices[faces], np.broadcast_to(query, (len(faces), 3)))
    return float(np.sqrt(((nearest - query) ** 2).sum(axis=1).min()))


def nearest_surface(point: ArrayLike, scene: RadarScene) -> tuple[str, float]:
    """Name of the object nearest to a point (3,) [m], and its distance [m]."""
    place = np.asarray(point, np.float64)
    name, reach = "", np.inf
    for item in scene.objects:
        low, high = item.vertices.min(axis=0), item.vertices.max(axis=0)
        if np.linalg.norm(np.maximum(0.0, np.maximum(low - place, place - high))) < reach:
            gap = distance(place, item.vertices, item.faces)
            name, reach = (item.name, gap) if gap < reach else (name, reach)
    return name, reach


def check_radar_clear(
    position: ArrayLike, scene: RadarScene | None, actors: Sequence[Obstacle] = (), t: float = 0.0
) -> None:
    """Check the free space around a radar at time `t` [s].

    A closed object around the radar is allowed if it is a room: it faces inwards, surrounds an actor as well, or,
    without actors, is further away than :data:`ROOM_RADIUS`.

    Args:
        position: (3,) of the radar [m].
        scene: static surroundings; None is free space.
        actors: moving meshes.
        t: time [s].

    Raises:
        PlacementError: the radar is inside an object, or nearer to its surface than :data:`CLEARANCE`.
    """
    place = np.asarray(position, np.float64)
    bodies = [(body.name, body.vertices(t), body.faces) for body in map(surface_of, actors)]
    for name, vertices, faces in bodies:
        what = f"actor {name!r} at t = {t:g} s"
        _check_gap(place, what, vertices, faces)
        if _surrounds(place, vertices, faces) != 0.0:
            extent = float(np.ptp(vertices, axis=0).max())
            units = f", which is {extent:.4g} m long ({units_hint(extent)})" if extent > LARGE_MESH else ""
            raise PlacementError(f"radar position {point_text(place)} m lies inside {what}{units}: move either")
    centres = [vertices.mean(axis=0) for _, vertices, _ in bodies]
    for item in scene.objects if scene else ():
        what = f"{item.name!r} ({item.material})"
        _check_gap(place, what, item.vertices, item.faces)
        if _surrounds(place, item.vertices, item.faces) > 0.0 and not _is_room(
            place, item.vertices, item.faces, centres
        ):
            raise PlacementError(f"radar position {point_text(place)} m lies inside {what}: place it in free space")


def check_path_clear(
    radar: Radar, scene: RadarScene | None, actors: Sequence[Obstacle], start: float, stop: float
) -> None:
    """Check the free space along a moving radar's path from `start` to `stop` [s], every half :data:`CLEARANCE`.

    Raises:
        PlacementError: as :func:`check_radar_clear`.
    """
    if radar.trajectory is None:
        return
    checked: FloatArray | None = None
    for t in np.linspace(start, stop, 1 + max(1, int(np.ceil((stop - start) / PATH_STEP)))).tolist():
        place = np.asarray(radar.pose(t)[0])
        if checked is None or np.linalg.norm(place - checked) > 0.5 * CLEARANCE:
            check_radar_clear(place, scene, actors, t)
            checked = place


def _is_room(place: FloatArray, vertices: FloatArray, faces: IntArray, centres: Iterable[FloatArray]) -> bool:
    inside = [_surrounds(centre, vertices, faces) > 0.0 for centre in centres]
    return any(inside) if inside else distance(place, vertices, faces) > ROOM_RADIUS


def _check_gap(place: FloatArray, what: str, vertices: FloatArray, faces: IntArray) -> None:
    corners = vertices[faces.ravel()]
    if (place < corners.min(axis=0) - CLEARANCE).any() or (place > corners.max(axis=0) + CLEARANCE).any():
        return
    gap = distance(place, vertices, faces)
    if gap < CLEARANCE:
        raise PlacementError(
            f"radar position {point_text(place)} m is {1e3 * gap:.3g} mm from the surface of {what}, it needs "
            f"{1e3 * CLEARANCE:g} mm of free space"
        )


def _surrounds(place: FloatArray, vertices: FloatArray, faces: IntArray) -> float:
    """Sign of the winding number if it is nearer to ±1 than to 0, else 0."""
    corners = vertices[faces.ravel()]
    if (place < corners.min(axis=0)).any() or (place > corners.max(axis=0)).any():
        return 0.0
    turns = float(winding_number(place, vertices, faces)[0])
    return float(np.sign(turns)) if abs(turns) > 0.75 else 0.0


def point_text(place: FloatArray) -> str:
    """Coordinates (3,) as text, for messages."""
    return "(" + ", ".join(f"{x:g}" for x in place) + ")"
