"""Things in the world: their ways, speeds and places."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.driving import Drive
from rfgen_sionna.generative.prompts.scene_prompt import DEFAULT_DISTANCE
from rfgen_sionna.generative.radar_placement import place_before_radar
from rfgen_sionna.generative.things.animal_bodies import BIRD, CAT, DOG, HORSE
from rfgen_sionna.generative.things.animals import froude_speed
from rfgen_sionna.generative.things.articulated import ArticulatedSequence
from rfgen_sionna.generative.things.part_motion import Steady
from rfgen_sionna.generative.things.thing_catalogue import thing_action, thing_kind
from rfgen_sionna.generative.things.thing_kind import BuildRequest, ThingKind
from rfgen_sionna.radar.pose import rotation_matrix

if TYPE_CHECKING:
    from rfgen_sionna.radar import Radar

_ANIMALS = {"dog": (DOG, "height"), "cat": (CAT, "height"), "horse": (HORSE, "height"), "bird": (BIRD, "wing_span")}


@dataclass(frozen=True)
class Thing:
    """What a thing is and does."""

    kind: str
    action: str
    values: Mapping[str, float] = field(hash=False)
    """Value of each parameter."""
    speed: float
    """Speed over the ground [m/s]."""


@dataclass(frozen=True)
class LevelDrive:
    """Trajectory of a drive whose vehicle stays level; on a vertical way it keeps its yaw."""

    drive: Drive
    yaw: float | None
    """[rad]; None turns along the way."""

    def __call__(self, t: float) -> tuple[FloatArray, tuple[float, float, float]]:
        place, (yaw, _, _) = self.drive(t)
        return place, (yaw if self.yaw is None else self.yaw, 0.0, 0.0)


@dataclass(frozen=True, eq=False)
class BuiltThing:
    """A thing and its motion through the world."""

    thing: Thing
    sequence: ArticulatedSequence
    velocity: tuple[float, float, float]
    """[m/s]"""
    trajectory: LevelDrive | None


def ground_speed(kind: ThingKind, action: str, values: Mapping[str, float], speed: float | None) -> float:
    """Speed [m/s] of an action: given, or its usual one, which of animals depends on the size.

    Raises:
        ValueError: the action stays in place, or the speed is not positive or too high for it.
    """
    does = kind.actions[action]
    if speed is None:
        if kind.name in _ANIMALS and does.speed > 0.0 and action not in ("fly", "glide"):
            body, size = _ANIMALS[kind.name]
            return min(froude_speed(body, action, values[size]), does.fastest)
        return does.speed
    movers = {name: each for name, each in kind.actions.items() if each.speed > 0.0}
    ways = ", ".join(f"{name} (up to {each.fastest:.2g} m/s)" for name, each in movers.items()) or "none"
    if does.speed == 0.0:
        raise ValueError(
            f"speed: {speed!r} m/s, but a {kind.name} whose action is {action!r} stays in place; it moves by: {ways}"
        )
    if not (np.isfinite(speed) and 0.0 < speed <= does.fastest):
        raise ValueError(
            f"speed: {speed!r} m/s for a {kind.name} whose action is {action!r}; allowed are speeds above 0, by: {ways}"
        )
    return float(speed)


def build_thing(
    name: str,
    action: str | None,
    *,
    seed: int,
    speed: float | None,
    path: ArrayLike | Drive | None,
    yaw: float,
    height: float,
    values: Mapping[str, float],
) -> BuiltThing:
    """Build a thing that moves straight ahead, or along a path.

    Args:
        name, action: kind and action; None takes its first one.
        seed: seed of what `values` leaves open.
        speed: [m/s]; None takes the usual one of the action.
        path: points (point, 2) at `height` or (point, 3) [m], or a drive; None goes straight ahead at constant speed.
        yaw: direction of its front [rad].
        height: height of a path without heights [m].
        values: values of parameters.

    Raises:
        ValueError: an unknown name, action or parameter, a value that is not allowed, or a path of an action in place.
    """
    kind = thing_kind(name)
    action, does = thing_action(kind, action)
    found = kind.values(values, np.random.default_rng([seed, 52]))
    if path is not None and does.speed == 0.0:
        movers = [key for key, each in kind.actions.items() if each.speed > 0.0]
        cure = f"take action {' or '.join(map(repr, movers))}" if movers else "leave the path out"
        raise ValueError(f"path: a {kind.name} whose action is {action!r} stays in place: {cure}")
    drive: Drive | None = None
    if isinstance(path, Drive):
        if speed is not None:
            raise ValueError(f"speed: {speed!r} m/s, but the path is a Drive with its own ({path.speed:g} m/s)")
        drive, pace = path, ground_speed(kind, action, found, path.speed)
    else:
        pace = ground_speed(kind, action, found, speed)
        if path is not None:
            points = np.asarray(path, np.float64)
            if points.ndim == 2 and points.shape[1] == 2:
                points = np.column_stack([points, np.full(len(points), height)])
            drive = Drive(points, pace)
    travelled = Steady(pace) if drive is None else drive.travelled
    request = BuildRequest(np.random.default_rng([seed, 53]), action, travelled, found)
    trajectory, velocity = None, (0.0, 0.0, 0.0)
    if drive is not None:
        line = np.asarray(drive.points)
        vertical = bool(np.allclose(line[:, :2], line[0, :2]))
        trajectory = LevelDrive(drive, yaw if vertical else None)
    elif pace > 0.0:
        velocity = (pace * float(np.cos(yaw)), pace * float(np.sin(yaw)), 0.0)
    return BuiltThing(Thing(kind.name, action, found, pace), kind.build(request), velocity, trajectory)


def thing_fields(built: BuiltThing, name: str | None, position: Any, orientation: Any) -> dict[str, Any]:
    """Fields of the actor of a thing."""
    fields: dict[str, Any] = {
        "sequence": built.sequence,
        "material": built.sequence.materials,
        "name": built.thing.kind if name is None else name,
        "thing_record": built.thing,
    }
    if built.trajectory is not None:
        return fields | {"trajectory": built.trajectory}
    return fields | {"position": position, "orientation": orientation, "velocity": built.velocity}


def named_thing(
    name: str,
    action: str | None,
    seed: int,
    speed: float | None,
    path: ArrayLike | Drive | None,
    position: ArrayLike | None,
    orientation: ArrayLike | None,
    label: str | None,
    radar: Radar | None,
    values: Mapping[str, float],
) -> dict[str, Any]:
    """Fields of the actor of a kind, with the arguments of :meth:`rfgen_sionna.Actor.thing`.

    Raises:
        ValueError: as :func:`build_thing`, and a position beside a path.
    """
    height = thing_action(thing_kind(name), action)[1].height
    place, yaw = place_before_radar(radar, DEFAULT_DISTANCE)
    at = (*place, height) if position is None else position
    turned = (yaw, 0.0, 0.0) if orientation is None else orientation
    built = build_thing(
        name, action, seed=seed, speed=speed, path=path, yaw=yaw_of(turned), height=height, values=values
    )
    if built.trajectory is not None and position is not None:
        raise ValueError(f"position: {position!r}, but the path gives the places: leave one out")
    return thing_fields(built, label, at, turned)


def half_extent(sequence: ArticulatedSequence) -> float:
    """Largest horizontal distance of a thing's surface from its origin at t = 0 [m]."""
    return float(np.hypot(*sequence.vertices(0.0)[:, :2].T).max())


def yaw_of(orientation: Any) -> float:
    """Direction of +x in the plane of an orientation (yaw, pitch, roll) [rad]."""
    front = rotation_matrix(orientation)[:, 0]
    return float(np.arctan2(front[1], front[0]))
