"""Surfaces of a scene in the tracer."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from rfgen_sionna._types import FloatArray, IntArray
from rfgen_sionna.scene.materials import Material
from rfgen_sionna.tracing.surface.smoothing import Smoothing, find_smoothing

if TYPE_CHECKING:
    from rfgen_sionna.scene import MeshActor, RadarScene, StaticObject
    from rfgen_sionna.tracing.relative_scene import RelativeObject


@dataclass(frozen=True)
class Surface:
    """One object: triangles, material, and labels of its paths."""

    name: str
    object_id: int
    faces: IntArray
    """(face, 3) vertex indices"""
    material: Material
    parts: IntArray
    """(face,) index into the part names of :class:`Surfaces`."""
    first_facet: int
    """Index of its face 0 among all faces of the ray scene."""
    closed: bool
    """Whether it encloses a volume with outward normals: faces that face away are occluded."""
    smooth: Smoothing | None
    """Normals of the smooth surface that the mesh samples; None means flat."""
    still: bool
    """Whether it is static in the world, also for a moving radar."""


@dataclass(frozen=True)
class Surfaces:
    """All objects, static ones first, numbered as in the ray scene."""

    static: tuple[Surface, ...]
    static_vertices: tuple[FloatArray, ...]
    moving: tuple[Surface, ...]
    object_names: tuple[str, ...]
    part_names: tuple[str, ...]


def tolerance_groups(surfaces: Sequence[Surface]) -> IntArray:
    """(surface,) first surface of each one's tolerance group: one group per actor, one for all static surfaces."""
    still = np.array([each.still for each in surfaces], np.bool_)
    return np.where(still, still.argmax() if still.any() else 0, np.arange(len(still))).astype(np.int32)


def is_closed(faces: IntArray) -> bool:
    """Whether `faces` (face, 3) use every edge once in each direction."""
    start, end = faces.ravel().astype(np.int64), faces[:, [1, 2, 0]].ravel().astype(np.int64)
    size = int(faces.max(initial=0)) + 1
    forward = np.sort(start * size + end)
    return bool(np.array_equal(forward, np.sort(end * size + start)) and len(np.unique(forward)) == len(forward))


def collect_surfaces(scene: RadarScene | None, actors: Sequence[MeshActor | RelativeObject]) -> Surfaces:
    """Number the objects and parts of a scene and its actors. Which faces are smooth is a matter of the
    mesh at rest, whatever its pose."""
    part_names: dict[str, int] = {}

    every: list[Surface] = []

    def part(name: str) -> int:
        return part_names.setdefault(name, len(part_names))

    def add(
        thing: StaticObject | MeshActor | RelativeObject, parts: IntArray, points: FloatArray, still: bool, closed: bool
    ) -> None:
        every.append(
            Surface(
                name=thing.name,
                object_id=len(every),
                faces=thing.faces,
                material=thing.properties,
                parts=parts,
                first_facet=every[-1].first_facet + len(every[-1].faces) if every else 0,
                closed=closed,
                smooth=find_smoothing(points, thing.faces),
                still=still,
            )
        )

    things = scene.objects if scene is not None else ()
    vertices = tuple(np.asarray(thing.vertices, dtype=np.float64) for thing in things)
    for thing, points in zip(things, vertices, strict=True):
        # A room may be oriented either way: rays alone decide which of its faces are visible.
        add(thing, np.full(len(thing.faces), part(thing.name), dtype=np.int32), points, still=True, closed=False)
    for actor in actors:
        still = getattr(actor, "static", False)
        labels = np.array([part(name) for name in actor.part_names], dtype=np.int32)
        closed = not still and is_closed(actor.faces)
        add(actor, labels[actor.face_parts], actor.rest_vertices, still, closed)
    count, names = len(vertices), tuple(each.name for each in every)
    return Surfaces(tuple(every[:count]), vertices, tuple(every[count:]), names, tuple(part_names))
