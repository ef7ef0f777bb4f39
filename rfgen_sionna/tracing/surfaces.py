"""The surfaces of a scene as the tracer sees them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from rfgen_sionna.records import FloatArray, IntArray
from rfgen_sionna.scene.materials import Material
from rfgen_sionna.tracing.smooth import Smoothing, smoothing

if TYPE_CHECKING:
    from rfgen_sionna.scene import Actor, RadarScene
    from rfgen_sionna.tracing.relative import Seen


@dataclass(frozen=True)
class Surface:
    """One object: its triangles, what it is made of and how its paths are labelled."""

    name: str
    object_id: int
    faces: IntArray
    """(face, 3)"""
    material: Material
    parts: IntArray
    """(face,) index into the tracer's part names."""
    first_facet: int
    """Number of its face 0 among all faces of the ray scene."""
    closed: bool
    """Whether it is known to enclose a volume, looking outwards: then a face that looks away is hidden by another."""
    smooth: Smoothing | None
    """Normals of the smooth surface that it samples; None where it is flat."""
    still: bool
    """Whether it stays in the world; seen from a radar that moves it moves all the same."""


@dataclass(frozen=True)
class Surfaces:
    """All objects, static ones first, numbered as in the ray scene."""

    static: tuple[Surface, ...]
    static_vertices: tuple[FloatArray, ...]
    moving: tuple[Surface, ...]
    object_names: tuple[str, ...]
    part_names: tuple[str, ...]


def is_closed(faces: IntArray) -> bool:
    """Whether every edge is used once in each direction."""
    start, end = faces.ravel().astype(np.int64), faces[:, [1, 2, 0]].ravel().astype(np.int64)
    size = int(faces.max(initial=0)) + 1
    forward = np.sort(start * size + end)
    return bool(np.array_equal(forward, np.sort(end * size + start)) and len(np.unique(forward)) == len(forward))


def collect_surfaces(scene: RadarScene | None, actors: Sequence[Actor | Seen]) -> Surfaces:
    """Number the objects and parts of a scene and its actors."""
    part_names: dict[str, int] = {}

    def part(name: str) -> int:
        return part_names.setdefault(name, len(part_names))

    static: list[Surface] = []
    vertices: list[FloatArray] = []
    moving: list[Surface] = []
    names: list[str] = []
    facets = 0
    for thing in scene.objects if scene is not None else ():
        label = part(thing.name)
        static.append(
            Surface(
                name=thing.name,
                object_id=len(names),
                faces=thing.faces,
                material=thing.properties,
                parts=np.full(len(thing.faces), label, dtype=np.int32),
                first_facet=facets,
                # A room may look inwards or outwards: rays alone decide which of its faces are seen.
                closed=False,
                smooth=smoothing(np.asarray(thing.vertices, dtype=np.float64), thing.faces),
                still=True,
            )
        )
        vertices.append(np.asarray(thing.vertices, dtype=np.float64))
        names.append(thing.name)
        facets += len(thing.faces)
    for actor in actors:
        still = getattr(actor, "static", False)
        labels = np.array([part(name) for name in actor.part_names], dtype=np.int32)
        moving.append(
            Surface(
                name=actor.name,
                object_id=len(names),
                faces=actor.faces,
                material=actor.properties,
                parts=labels[actor.face_parts],
                first_facet=facets,
                closed=not still and is_closed(actor.faces),
                smooth=smoothing(actor.vertices(0.0), actor.faces),
                still=still,
            )
        )
        names.append(actor.name)
        facets += len(actor.faces)
    return Surfaces(tuple(static), tuple(vertices), tuple(moving), tuple(names), tuple(part_names))
