"""Surfaces of a scene in the tracer."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from rfgen_sionna._types import FloatArray, IntArray
from rfgen_sionna.scene.materials import Material
from rfgen_sionna.scene.mesh import corner_columns
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
    outward: NDArray[np.bool_]
    """(face,) faces of closed, outward parts: a ray from outside meets their front first."""
    smooth: Smoothing | None
    """Normals of the smooth surface that the mesh samples; None means flat."""
    still: bool
    """Whether it is static in the world, also for a moving radar."""
    whole: str = ""
    """Name of the actor of which it is the part of one material; empty for whole ones."""


@dataclass(frozen=True)
class Surfaces:
    """All objects, static ones first, numbered as in the ray scene."""

    static: tuple[Surface, ...]
    static_vertices: tuple[FloatArray, ...]
    moving: tuple[Surface, ...]
    object_names: tuple[str, ...]
    part_names: tuple[str, ...]


def tolerance_groups(surfaces: Sequence[Surface]) -> IntArray:
    """(surface,) first surface of each one's tolerance group: one per moving surface, one for all static ones."""
    still = np.array([each.still for each in surfaces], np.bool_)
    return np.where(still, still.argmax() if still.any() else 0, np.arange(len(still))).astype(np.int32)


def actor_groups(surfaces: Sequence[Surface]) -> IntArray:
    """(surface,) :func:`tolerance_groups` where the parts of an actor, one of each material, are one group."""
    groups, first = tolerance_groups(surfaces), dict[str, int]()
    for number, each in enumerate(surfaces):
        if each.whole:
            groups[number] = first.setdefault(each.whole, number)
    return groups


def is_closed(faces: IntArray) -> bool:
    """Whether `faces` (face, 3) use every edge once in each direction."""
    start, end = faces.ravel().astype(np.int64), faces[:, [1, 2, 0]].ravel().astype(np.int64)
    size = int(faces.max(initial=0)) + 1
    forward = np.sort(start * size + end)
    return bool(np.array_equal(forward, np.sort(end * size + start)) and len(np.unique(forward)) == len(forward))


def outward_faces(vertices: FloatArray, faces: IntArray) -> NDArray[np.bool_]:
    """(face,) faces of connected parts of positive volume, for a closed mesh with `vertices` (vertex, 3) [m]."""
    links = coo_array(
        (np.ones(2 * len(faces), np.int8), (np.tile(faces[:, 0], 2), faces[:, 1:].T.ravel())),
        shape=(len(vertices), len(vertices)),
    )
    count, part = connected_components(links, directed=False)
    a, b, c = np.moveaxis(corner_columns(vertices - vertices.mean(axis=0), faces), 1, 0)
    volume = sum(a[i] * (b[i - 2] * c[i - 1] - b[i - 1] * c[i - 2]) for i in range(3))
    own = part[faces[:, 0]]
    return np.asarray((np.bincount(own, volume, count) > 0)[own])


def collect_surfaces(scene: RadarScene | None, actors: Sequence[MeshActor | RelativeObject]) -> Surfaces:
    """Number the objects and parts of a scene and its actors. Which faces are smooth, and which way they look, is that
    of the mesh at rest, whatever its pose."""
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
                outward=outward_faces(points, thing.faces) if closed else np.zeros(len(thing.faces), np.bool_),
                smooth=find_smoothing(points, thing.faces),
                still=still,
                whole=getattr(thing, "whole", ""),
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
