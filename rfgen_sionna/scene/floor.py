"""The floor of a scene under a place."""

from __future__ import annotations

import numpy as np

from rfgen_sionna.scene.rays import RayScene
from rfgen_sionna.scene.scene import RadarScene

SLAB = 0.5
"""Largest distance between the two sides of a slab of one object [m]; thicker than any ceiling."""
_RESTART_GAP = 1e-3
"""Distance below a surface at which the next ray starts [m]; above the rounding of float32 rays."""


def floor_under(scene: RadarScene, point: tuple[float, float, float]) -> tuple[float, str] | None:
    """Height [m] of the floor under a point (x, y, z) [m] and the name of its object; None without a floor.

    The floor is the lowest surface below the point, on a slab its upper side; furniture does not count. A point with
    nothing below may lie under a slope: its floor is the nearest surface above.
    """
    if not scene.objects:
        return None
    rays = RayScene([(item.vertices, item.faces) for item in scene.objects], origin=point)
    x, y, z = point
    found: list[tuple[float, int]] = []
    while True:
        hit = rays.first_hit((x, y, z), [(0.0, 0.0, -1.0)])
        if hit.object[0] < 0:
            break
        z -= float(hit.distance[0])
        found.append((z, int(hit.object[0])))
        z -= _RESTART_GAP
    if not found:
        hit = rays.first_hit(point, [(0.0, 0.0, 1.0)])
        if hit.object[0] < 0:
            return None
        found.append((point[2] + float(hit.distance[0]), int(hit.object[0])))
    height, index = found[-1]
    sides = [z for z, other in found if other == index and z - height < SLAB]
    # Rounded to 10 um: float32 rays resolve a few micrometres near their origin.
    return float(np.round(max(sides), 5)) + 0.0, scene.objects[index].name
