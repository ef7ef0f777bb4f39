"""The surfaces of a scene as the tracer sees them."""

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
    from rfgen_sionna.scene import MeshActor, RadarScene
    from rfgen_sionna.tracing.relative import RelativeObject


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
    outward: NDArray[np.bool_]
    """(face,) which faces are of parts that are closed and do look outwards, each part by itself: from outside, a ray
    comes to one of them that looks at it before it comes to one that looks away."""
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


def tolerance_groups(surfaces: Sequence[Surface]) -> IntArray:
    """(surface,) what shares one tolerance: each actor by itself, and all that stays in the world, which is many
    surfaces to a radar that moves; each lot has the number of its first."""
    still = np.array([each.still for each in surfaces], np.bool_)
    return np.where(still, still.argmax() if still.any() else 0, np.arange(len(still))).astype(np.int32)


def is_closed(faces: IntArray) -> bool:
    """Whether every edge is used once in each direction."""
    start, end = faces.ravel().astype(np.int64), faces[:, [1, 2, 0]].ravel().astype(np.int64)
    size = int(faces.max(initial=0)) + 1
    forward = np.sort(start * size + end)
    return bool(np.array_equal(forward, np.sort(end * size + start)) and len(np.unique(forward)) == len(forward))


def outward_faces(vertices: FloatArray, faces: IntArray) -> NDArray[np.bool_]:
    """(face,) which faces of a closed mesh, of vertices (vertex, 3) [m], are of connected parts of positive volume."""
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
                outward=np.zeros(len(thing.faces), np.bool_),
                smooth=find_smoothing(np.asarray(thing.vertices, dtype=np.float64), thing.faces),
                still=True,
            )
        )
        vertices.append(np.asarray(thing.vertices, dtype=np.float64))
        names.append(thing.name)
        facets += len(thing.faces)
    for actor in actors:
        still = getattr(actor, "static", False)
        labels = np.array([part(name) for name in actor.part_names], dtype=np.int32)
        closed, points = not still and is_closed(actor.faces), actor.vertices(0.0)
        moving.append(
            Surface(
                name=actor.name,
                object_id=len(names),
                faces=actor.faces,
                material=actor.properties,
                parts=labels[actor.face_parts],
                first_facet=facets,
                closed=closed,
                outward=outward_faces(points, actor.faces) if closed else np.zeros(len(actor.faces), np.bool_),
                smooth=find_smoothing(points, actor.faces),
                still=still,
            )
        )
        names.append(actor.name)
        facets += len(actor.faces)
    return Surfaces(tuple(static), tuple(vertices), tuple(moving), tuple(names), tuple(part_names))
