"""Actors by material, and, for a moving radar, the world in the frame of the radar at t = 0.

Delays depend on distances only. Paths between a moving radar and its surroundings equal those of a radar at rest, in
its pose at t = 0, with surroundings that move the other way. The static scene becomes moving surfaces. Directions refer
to that frame, whose axes are those of the world at t = 0.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import FloatArray, IntArray
from rfgen_sionna.radar import Radar
from rfgen_sionna.scene.materials import Material
from rfgen_sionna.scene.mesh import used_vertices

if TYPE_CHECKING:
    from rfgen_sionna.scene import MeshActor, RadarScene


@dataclass(frozen=True)
class RelativeObject:
    """An object in the frame of the moving radar at t = 0, or the parts of an actor that have one material."""

    name: str
    properties: Material
    faces: IntArray
    """(face, 3)"""
    part_names: tuple[str, ...]
    face_parts: IntArray
    """(face,) index into `part_names`."""
    static: bool
    """Whether it belongs to the static scene."""
    vertices: Callable[[float], FloatArray]
    """Time [s] to (vertex, 3) positions [m]."""
    rest_vertices: FloatArray
    """(vertex, 3) positions of the mesh at rest in its own frame [m]."""
    whole: str = ""
    """Name of the actor that it is a part of; empty for whole ones."""


def by_material(actors: Iterable[MeshActor | RelativeObject]) -> tuple[MeshActor | RelativeObject, ...]:
    """The actors, with an object for each material of an actor of several: "car, glass"; no unused vertices."""
    found: list[MeshActor | RelativeObject] = []
    for actor in actors:
        materials: tuple[Material, ...] = getattr(actor, "materials", ())
        groups: list[Material] = []
        for each in materials:
            if each not in groups:
                groups.append(each)
        if len(groups) < 2:
            used, faces = used_vertices(np.ascontiguousarray(actor.faces))
            if len(faces) and len(actor.rest_vertices) > len(actor.rest_vertices[used]):  # some are of no face
                own = actor.part_names, actor.face_parts, False, _of_vertices(actor.vertices, used)
                rest = np.ascontiguousarray(actor.rest_vertices[used])
                found.append(RelativeObject(actor.name, actor.properties, faces, *own, rest))
            else:
                found.append(actor)
            continue
        owners = np.array([groups.index(each) for each in materials])[actor.face_parts]
        for k, group in enumerate(groups):
            used, faces = used_vertices(np.ascontiguousarray(actor.faces[owners == k]))
            same = sum(each.name == group.name for each in groups[:k])
            name = f"{actor.name}, {group.name}" + (f" {same + 1}" if same else "")
            own = actor.part_names, actor.face_parts[owners == k], False, _of_vertices(actor.vertices, used)
            rest = np.ascontiguousarray(actor.rest_vertices[used])
            found.append(RelativeObject(name, group, faces, *own, rest, actor.name))
    return tuple(found)


def _of_vertices(
    vertices: Callable[[float], FloatArray], used: NDArray[np.intp] | slice
) -> Callable[[float], FloatArray]:
    return lambda t: np.ascontiguousarray(vertices(t)[used])


def relative_objects(
    radar: Radar, scene: RadarScene | None, actors: Sequence[MeshActor | RelativeObject]
) -> tuple[RelativeObject, ...]:
    """Static objects, then actors, in the frame of the radar along its trajectory."""

    def carried(vertices: Callable[[float], FloatArray]) -> Callable[[float], FloatArray]:
        return lambda t: from_world(vertices(t), radar, t)

    def still(points: FloatArray) -> Callable[[float], FloatArray]:
        return lambda _: points

    found = []
    for thing in scene.objects if scene is not None else ():
        parts, points = np.zeros(len(thing.faces), dtype=np.int32), np.asarray(thing.vertices, dtype=np.float64)
        given = thing.name, thing.properties, thing.faces, (thing.name,), parts, True, carried(still(points))
        found.append(RelativeObject(*given, points))
    for actor in by_material(actors):
        known = actor.name, actor.properties, actor.faces, actor.part_names, actor.face_parts, False
        whole = getattr(actor, "whole", "")
        found.append(RelativeObject(*known, carried(actor.vertices), actor.rest_vertices, whole))
    return tuple(found)


def from_world(points: FloatArray, radar: Radar, t: float) -> FloatArray:
    """Points (..., 3) [m] of the world at `t` [s], in the frame of the radar at t = 0."""
    there = radar.at(t)
    # Rows times matrices: into the device, then from where the device was at t = 0 into the world.
    turn = there.rotation @ radar.rotation.T
    return np.asarray((points - np.asarray(there.position)) @ turn + np.asarray(radar.position))


def to_world(directions: FloatArray, radar: Radar, t: float) -> FloatArray:
    """Directions (..., 3) in the frame of t = 0 at `t` [s], in the world."""
    return np.asarray(directions @ (radar.at(t).rotation @ radar.rotation.T).T)
