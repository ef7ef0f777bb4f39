"""Checks of the actors before a run: range window, passage by the radar, collisions."""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import FloatArray
from rfgen_sionna.radar import Radar
from rfgen_sionna.scene.checks.collision import CollisionFinder, report_collisions
from rfgen_sionna.scene.checks.radar_distance import CLEARANCE, Obstacle, check_radar_clear, surface_of
from rfgen_sionna.scene.mesh import used_vertices
from rfgen_sionna.scene.mesh_files import LARGE_MESH, units_hint
from rfgen_sionna.scene.rays import RayScene
from rfgen_sionna.scene.scene_errors import PlacementError

if TYPE_CHECKING:
    from rfgen_sionna.scene.mesh_actor import MeshActor
    from rfgen_sionna.scene.scene import RadarScene

Policy: TypeAlias = Literal["error", "warn", "ignore"]
POLICIES = ("error", "warn", "ignore")
OutsidePolicy: TypeAlias = Literal["error", "ignore"]
OUTSIDE_POLICIES = ("error", "ignore")
CHECK_STEP = 0.05
"""Time between checks of the actors' positions [s]: limbs move by less than 0.5 m."""
MIN_CHECK_STEP = 1e-4
"""Shortest time between checks of an actor that passes the radar [s]; ends the bisection."""


def check_outside(outside: Any) -> OutsidePolicy:
    """Policy for actors outside of the range window, checked."""
    if not isinstance(outside, str) or outside not in OUTSIDE_POLICIES:
        raise ValueError(f"outside is {outside!r}: allowed are {', '.join(map(repr, OUTSIDE_POLICIES))}")
    return "ignore" if outside == "ignore" else "error"


def check_places(
    radar: Radar,
    actors: Sequence[Obstacle],
    start: float,
    stop: float,
    outside: OutsidePolicy = "error",
    stacklevel: int = 1,
) -> None:
    """Check that actors, in the frame of a radar at rest, stay in the range window and off the radar.

    With `outside` "ignore" they may leave the window; one that never enters it is a warning.

    Raises
    ------
    ValueError
        An actor has vertices that are not finite.
    PlacementError
        An actor leaves the range window, comes around the radar or through it.
    """
    for actor in actors:
        steps = max(1, math.ceil((stop - start) / CHECK_STEP))
        used = used_vertices(actor.faces)[0]
        points, nearest = _within_window(radar, actor, used, start, outside)
        earlier = (start, points)
        check_radar_clear(radar.position, None, [actor], start)
        for t in np.linspace(start, stop, steps + 1)[1:] if stop > start else ():
            points, near = _within_window(radar, actor, used, float(t), outside)
            later, nearest = (float(t), points), min(nearest, near)
            _check_passage(radar, surface_of(actor), earlier, later)
            earlier = later
        if nearest > radar.max_range and stop > start:
            warnings.warn(
                f"actor '{actor.name}' stays beyond the range window, which ends at {radar.max_range:.2f} m: it comes "
                f"no nearer than {nearest:.2f} m from {start:.3f} to {stop:.3f} s and returns nothing",
                stacklevel=stacklevel + 1,
            )


def warn_frozen(actors: Sequence[MeshActor], start: float, stop: float, stacklevel: int) -> None:
    """Warn of actors whose motion does not cover the run: they hold their first or last pose."""
    for actor in actors:
        if np.isfinite(actor.duration) and (start < -1e-9 or stop > actor.duration + 1e-9):
            warnings.warn(
                f"actor '{actor.name}' moves from 0 to {actor.duration:.3f} s and holds its pose before and after; "
                f"the run lasts from {start:.3f} to {stop:.3f} s",
                stacklevel=stacklevel + 1,
            )


def check_collisions(
    scene: RadarScene,
    rays: RayScene | None,
    actors: Sequence[MeshActor],
    start: float,
    stop: float,
    policy: Policy,
    stacklevel: int,
) -> None:
    """Check that no actor goes through a surface of the scene from `start` to `stop` [s].

    Depths above :data:`~rfgen_sionna.scene.checks.collision.CONTACT` warn; with `policy` "error" depths above
    :data:`~rfgen_sionna.scene.checks.collision.ALLOWED` are errors.

    Raises
    ------
    PlacementError
        At the first such depth, with actor, object, time, place and cure.
    """
    if policy == "ignore" or rays is None:
        return
    for actor in actors:
        found = CollisionFinder(scene.objects, rays, actor).find(start, stop)
        remedy = "Place the actor elsewhere or at another distance, let it move less"
        report_collisions(found, policy, remedy, stacklevel + 1)


def _within_window(
    radar: Radar, actor: Obstacle, used: NDArray[np.intp] | slice, t: float, outside: OutsidePolicy
) -> tuple[FloatArray, float]:
    """(vertex, 3) world positions [m] of the `used` vertices, checked against the range window, and the distance [m] of
    the nearest one."""
    points = actor.vertices(t)
    if not np.isfinite(points).all():
        raise ValueError(f"actor '{actor.name}' has vertices that are not finite at t = {t:.3f} s")
    points = points[used]
    with np.errstate(over="ignore"):
        away = np.linalg.norm(points - np.asarray(radar.position), axis=1)
    reach = float(away.max())
    if reach > radar.max_range and outside == "error":
        extent = float(np.ptp(points, axis=0).max())
        units = f"; it is {extent:.4g} m long: {units_hint(extent)}" if extent > LARGE_MESH else ""
        raise PlacementError(
            f"actor '{actor.name}' reaches {reach:.2f} m from the radar at t = {t:.3f} s; the ADC's range window "
            f'ends at {radar.max_range:.2f} m: move it closer, leave out returns from beyond it (outside="ignore"), or '
            f"take a preset with a lower slope or a higher sample rate{units}"
        )
    return points, float(away.min())


def _check_passage(
    radar: Radar, actor: Obstacle, earlier: tuple[float, FloatArray], later: tuple[float, FloatArray]
) -> None:
    """Check the free space around the radar between two times, in steps of motion below the clearance."""
    place = np.asarray(radar.position)
    (t0, before), (t1, after) = earlier, later
    low, high = np.minimum(before, after).min(axis=0), np.maximum(before, after).max(axis=0)
    if (place < low - CLEARANCE).any() or (place > high + CLEARANCE).any():
        return
    if t1 - t0 > MIN_CHECK_STEP and np.linalg.norm(after - before, axis=1).max() > CLEARANCE:
        t = 0.5 * (t0 + t1)
        middle = (t, actor.vertices(t))
        _check_passage(radar, actor, earlier, middle)
        _check_passage(radar, actor, middle, later)
    else:
        check_radar_clear(radar.position, None, [actor], t1)


def with_unique_names(actors: Sequence[MeshActor]) -> tuple[MeshActor, ...]:
    """The actors as a tuple.

    Raises
    ------
    ValueError
        Two actors share a name.
    """
    names = [actor.name for actor in actors]
    doubled = {name for name in names if names.count(name) > 1}
    if doubled:
        raise ValueError(f"actors share the name '{min(doubled)}': give each a name of its own (name=…)")
    return tuple(actors)
