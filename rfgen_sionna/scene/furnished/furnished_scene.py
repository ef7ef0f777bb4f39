"""A furnished place as a scene."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from rfgen_sionna._types import FloatArray, IntArray
from rfgen_sionna.scene.array_scene import ArrayScene
from rfgen_sionna.scene.furnished.finishes import FINISHES, surface_material
from rfgen_sionna.scene.furnished.layout import Ground, Item, Plan
from rfgen_sionna.scene.furnished.piece import merge
from rfgen_sionna.scene.furnished.shapes import Part
from rfgen_sionna.scene.mesh import face_normals, lengths
from rfgen_sionna.scene.scene import Interior, StaticObject

CEILING_OF_THE_SKY = 30.0
"""Height of the free space outdoors [m]; above any tree and roof."""


@dataclass(frozen=True)
class Layout:
    """Layout of a place, drawn from a seed."""

    place: str
    seed: int
    x: tuple[float, float]
    """Extent of the floor [m]."""
    y: tuple[float, float]
    height: float
    """Height of the ceiling [m]; outdoors that of the highest piece."""
    indoors: bool
    items: tuple[Item, ...]
    """Furniture with positions and sizes."""
    stand: tuple[tuple[float, float], tuple[float, float]]
    """Ranges of x and y for a radar [m]: the whole room, or the street without its gardens."""

    @property
    def kinds(self) -> dict[str, int]:
        """Number of pieces of each kind of furniture."""
        return dict(Counter(item.kind for item in self.items))

    def is_free(self, x: float, y: float, z: float, margin: float = 0.3) -> bool:
        """Whether a point [m] lies within the place and below its ceiling, at least `margin` [m] from all pieces."""
        if self.indoors and z > self.height - margin:
            return False
        if not (self.x[0] + margin <= x <= self.x[1] - margin and self.y[0] + margin <= y <= self.y[1] - margin):
            return False
        spot = Ground(x, y, 0.01, 0.01, 0.0, z - margin, z + margin)
        return not any(spot.meets(item.ground, margin) for item in self.items)


class FurnishedScene(ArrayScene):
    """Scene of :func:`~rfgen_sionna.scene.furnished.furnished`."""

    def __init__(self, layout: Layout, parts: list[tuple[str, str, Part]], owners: list[int], frequency: float) -> None:
        super().__init__(f"{layout.place} {layout.seed}")
        self.layout = layout
        self.surface_frequency = frequency
        """Frequency of the scattering coefficients [Hz]."""
        self.parts = parts
        """Kind, name and part of each object."""
        self.owners = owners
        """(object,) index of its item, -1 for the shell."""
        self.kinds: tuple[str, ...] = tuple(kind for kind, _, _ in parts)
        """(object,) kind of each object, or of its piece: "sofa", "far wall"."""

    @property
    def shell(self) -> tuple[tuple[str, FloatArray], ...]:
        """Walls, floor, doors and windows: kind and points (vertex, 3) [m] of each part."""
        return tuple(
            (kind, np.asarray(part.points, np.float64))
            for (kind, _, part), owner in zip(self.parts, self.owners, strict=True)
            if owner < 0
        )

    @cached_property
    def finishes(self) -> dict[str, str]:
        """Finish of the largest area of each kind of object."""
        areas: dict[str, dict[str, float]] = {}
        for kind, _, part in self.parts:
            own = areas.setdefault(kind, {})
            own[part.finish] = own.get(part.finish, 0.0) + float(lengths(face_normals(part.points, part.faces)).sum())
        return {kind: max(found, key=found.__getitem__) for kind, found in areas.items()}

    @cached_property
    def interior(self) -> Interior | None:
        plan = self.layout
        top = plan.height if plan.indoors else CEILING_OF_THE_SKY
        return Interior(np.array([[plan.x[0], plan.y[0], 0.0]]), np.array([[plan.x[1], plan.y[1], top]]))

    @cached_property
    def objects(self) -> tuple[StaticObject, ...]:
        materials = {
            name: surface_material(name, self.surface_frequency) for name in {p.finish for _, _, p in self.parts}
        }
        return tuple(
            StaticObject(name, materials[part.finish], np.asarray(part.points, np.float64), part.faces)
            for _, name, part in self.parts
        )

    @cached_property
    def colours(self) -> FloatArray:
        """(object, 3) red, green, blue of each object, 0 … 1."""
        return np.array([FINISHES[part.finish].colour for _, _, part in self.parts])


def assemble(place: str, seed: int, plan: Plan, indoors: bool, frequency: float) -> FurnishedScene:
    """Scene of a plan, with an object for each finish of each piece."""
    parts: list[tuple[str, str, Part]] = []
    owners: list[int] = []
    counts: Counter[str] = Counter()

    def add(kind: str, pieces: list[Part], owner: int) -> None:
        counts[kind] += 1
        label = kind if counts[kind] == 1 else f"{kind} {counts[kind]}"
        for part in pieces:
            kept = _with_area(part.points, part.faces)
            name = label if len(pieces) == 1 else f"{label}, {part.finish}"
            parts.append((kind, name, Part(part.points, kept, part.finish)))
            owners.append(owner)

    for kind, part in plan.shell:
        add(kind, [part], -1)
    for number, item in enumerate(plan.items):
        add(item.kind, merge(item.parts), number)
    layout = Layout(place, seed, plan.x, plan.y, plan.height, indoors, tuple(plan.items), plan.stand)
    return FurnishedScene(layout, parts, owners, frequency)


def _with_area(points: FloatArray, faces: IntArray) -> IntArray:
    area = np.linalg.norm(face_normals(points, faces), axis=1)
    return np.ascontiguousarray(faces[area > 1e-12])
