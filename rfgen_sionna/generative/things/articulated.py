"""Meshes of parts that move: rigid ones about axes, soft ones in shape."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from rfgen_sionna._short_repr import ShortRepr
from rfgen_sionna._types import FloatArray, IntArray
from rfgen_sionna.scene.materials import Material

Pose = Callable[[float], tuple[FloatArray, FloatArray]]
"""Rotation (3, 3) and translation (3,) [m] at a time [s], C²."""


@dataclass(frozen=True, eq=False)
class ThingPart:
    """A part of one material: a closed mesh."""

    name: str
    """Name in labels, unique within the thing."""
    points: FloatArray | Callable[[float], FloatArray]
    """(vertex, 3) positions at rest [m], or a C² function of the time [s] that returns them."""
    faces: IntArray
    """(face, 3) vertex indices, counter-clockwise from outside."""
    material: Material
    pose: Pose | None = None
    """Motion of the part; None is at rest. Parts that move together share one."""

    def at_rest(self) -> FloatArray:
        """(vertex, 3) positions at t = 0 before the pose [m]."""
        return np.asarray(self.points(0.0) if callable(self.points) else self.points, np.float64)


@dataclass(frozen=True, eq=False, repr=False)
class ArticulatedSequence(ShortRepr):
    """Parts of a thing over time: a :class:`~rfgen_sionna.records.MeshSequence` without an end.

    Raises:
        ValueError: no parts, or two of one name.
    """

    parts: Sequence[ThingPart]
    joint_names: tuple[str, ...] = ()
    joint_path: Callable[[float], FloatArray] | None = None
    """(joint, 3) positions [m] at a time [s]."""
    duration: float = field(default=math.inf, init=False)

    def __post_init__(self) -> None:
        names = [part.name for part in self.parts]
        if not names or len(set(names)) < len(names):
            raise ValueError(f"parts are called {names}: at least one is needed, each with its own name")

    @property
    def part_names(self) -> tuple[str, ...]:
        return tuple(part.name for part in self.parts)

    @property
    def materials(self) -> dict[str, Material]:
        """Material of each of `part_names`."""
        return {part.name: part.material for part in self.parts}

    @cached_property
    def faces(self) -> IntArray:
        """(face, 3) vertex indices."""
        counts = [len(part.at_rest()) for part in self.parts]
        first = np.cumsum([0, *counts[:-1]])
        return np.concatenate([part.faces + np.int32(k) for part, k in zip(self.parts, first, strict=True)]).astype(
            np.int32
        )

    @cached_property
    def face_parts(self) -> IntArray:
        """(face,) index into `part_names`."""
        return np.repeat(np.arange(len(self.parts), dtype=np.int32), [len(part.faces) for part in self.parts])

    @cached_property
    def _poses(self) -> tuple[list[Pose], IntArray]:
        """Different motions, and (vertex,) index of each vertex's; 0 is at rest."""
        poses: list[Pose] = []
        owners = []
        for part in self.parts:
            if part.pose is not None and part.pose not in poses:
                poses.append(part.pose)
            owner = 0 if part.pose is None else 1 + poses.index(part.pose)
            owners.append(np.full(len(part.at_rest()), owner, np.int32))
        return poses, np.concatenate(owners)

    @cached_property
    def _rest(self) -> FloatArray:
        return np.concatenate([part.at_rest() for part in self.parts])

    @property
    def is_rigid(self) -> bool:
        """Whether every part keeps its shape."""
        return not any(callable(part.points) for part in self.parts)

    @property
    def rest_vertices(self) -> FloatArray:
        """(vertex, 3) positions at t = 0 before the motions of :meth:`motions` [m]."""
        return self._rest

    @property
    def owners(self) -> IntArray:
        """(vertex,) index of the motion of each vertex in :meth:`motions`."""
        return self._poses[1]

    def motions(self, t: float) -> tuple[FloatArray, FloatArray]:
        """(motion, 3, 3) rotations and (motion, 3) translations [m] at `t` [s]; the first is at rest."""
        poses = self._poses[0]
        turns, shifts = np.empty((1 + len(poses), 3, 3)), np.zeros((1 + len(poses), 3))
        turns[0] = np.eye(3)
        for k, pose in enumerate(poses, start=1):
            turns[k], shifts[k] = pose(float(t))
        return turns, shifts

    def vertices(self, t: float) -> FloatArray:
        """(vertex, 3) positions at `t` [s] in metres."""
        if self.is_rigid:
            points = self._rest
        else:
            points = np.concatenate([p.points(t) if callable(p.points) else p.points for p in self.parts])
        if not self._poses[0]:
            return points
        turns, shifts = self.motions(t)
        return np.asarray(np.einsum("vij,vj->vi", turns[self.owners], points) + shifts[self.owners])

    def joints(self, t: float) -> FloatArray:
        """(joint, 3) positions at `t` [s] in metres."""
        return np.empty((0, 3)) if self.joint_path is None else self.joint_path(float(t))
