"""Actors: mesh sequences with a material and a pose in the world."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from rfgen_sionna._types import SPEED_OF_LIGHT, FloatArray, IntArray
from rfgen_sionna.radar.pose import Vector, pose_at, rotation_matrix, vector
from rfgen_sionna.records import MeshSequence
from rfgen_sionna.scene.materials import Material, material
from rfgen_sionna.scene.mesh import RigidMesh
from rfgen_sionna.scene.vertex_welding import weld_vertices

MAX_SPEED = 0.01 * SPEED_OF_LIGHT
"""Largest constant velocity [m/s]: the tracer neglects motion during the travel time."""
_PROBE_TIMES = (0.0, 0.236, 0.382, 0.618, 0.854, 1.0)
"""Tests for closed seams, as shares of the duration; in phase with no motion cycle."""


@dataclass(frozen=True, eq=False)
class MeshActor:
    """A mesh sequence of one material, with a rigid motion in the world on top of its own deformation.

    Raises:
        ValueError: a vector is not three finite numbers, the velocity exceeds :data:`MAX_SPEED`, the name is empty, or
            a trajectory comes with a position or velocity.
        MaterialError: the material is unknown.
        TypeError: `sequence` is no mesh sequence.
    """

    sequence: MeshSequence
    """Shape over time in the actor's own frame [m]."""
    material: str | Material
    """A material, or its name in :data:`rfgen_sionna.scene.MATERIALS`; `dataclasses.replace` changes one of those."""
    name: str = "actor"
    """Name in labels; unique within a simulation."""
    position: Vector = (0.0, 0.0, 0.0)
    """World position of the actor's origin at t = 0 [m]."""
    orientation: Vector = (0.0, 0.0, 0.0)
    """(yaw, pitch, roll) [rad]."""
    velocity: Vector = (0.0, 0.0, 0.0)
    """Constant velocity in the world [m/s]."""
    trajectory: Callable[[float], Any] | None = None
    """Function of the time [s] that returns the position [m], or a pair (position, orientation [rad]); it replaces
    `position` and `velocity`. It must be smooth (C²): its steps are steps of the phase."""

    def __post_init__(self) -> None:
        if not isinstance(self.sequence, MeshSequence):
            raise TypeError(
                f"sequence: {type(self.sequence).__name__} is no mesh sequence (Actor.from_mesh takes a mesh)"
            )
        if not isinstance(self.name, str) or not self.name:
            raise ValueError(f"name: {self.name!r} given, a text that is not empty is needed")
        for field in ("position", "orientation", "velocity"):
            object.__setattr__(self, field, vector(field, getattr(self, field), f"{self.name}: "))
        speed = math.hypot(*self.velocity)
        if speed > MAX_SPEED:
            raise ValueError(
                f"{self.name}: velocity {self.velocity} m/s given, {speed} m/s in all, at most {MAX_SPEED} m/s is "
                "allowed, a hundredth of the speed of light"
            )
        if self.trajectory is not None:
            if not callable(self.trajectory):
                raise TypeError(f"{self.name}: trajectory is not callable")
            if any(self.position) or any(self.velocity):
                raise ValueError(
                    f"{self.name}: a trajectory gives the world position itself, leave position and velocity out"
                )
            self.pose(0.0)
        _ = self.properties

    @classmethod
    def from_mesh(
        cls,
        mesh: Any,
        *,
        material: str | Material = "",
        position: Vector = (0.0, 0.0, 0.0),
        velocity: Vector = (0.0, 0.0, 0.0),
        orientation: Vector = (0.0, 0.0, 0.0),
        trajectory: Callable[[float], Any] | None = None,
        name: str | None = None,
    ) -> MeshActor:
        """A rigid actor.

        Args:
            mesh: `trimesh.Trimesh`, `trimesh.Scene` as one mesh, path of a file that trimesh reads (metres), or a pair
                (vertices, faces).
            material: a material or its name; required.
            position, velocity, orientation, trajectory: fields of this class.
            name: label; None takes the file's name, else "mesh".

        Raises:
            MeshError: the mesh is not usable (:func:`rfgen_sionna.scene.mesh.check_mesh`).
            MaterialError: no material, or an unknown one.
            FileNotFoundError, IsADirectoryError: the path is no file.
            TypeError: `mesh` is none of the above.
        """
        rigid = RigidMesh.load(mesh, name)
        return cls(rigid, material, rigid.name, position, orientation, velocity, trajectory)

    @property
    def properties(self) -> Material:
        """The material; a named one refuses frequencies that its source does not cover."""
        if isinstance(self.material, Material):
            return self.material
        return material(self.material, outside="raise", owner=self.name)

    @cached_property
    def faces(self) -> IntArray:
        """(face, 3) vertex indices, counter-clockwise from outside, with welded seams
        (:func:`rfgen_sionna.scene.vertex_welding.weld_vertices`)."""
        faces, duration = self.sequence.faces, self.sequence.duration
        if isinstance(self.sequence, RigidMesh):
            return faces
        length = duration if math.isfinite(duration) else 1.0
        return weld_vertices(faces, (self.sequence.vertices(share * length) for share in _PROBE_TIMES))

    @property
    def part_names(self) -> tuple[str, ...]:
        return self.sequence.part_names

    @property
    def face_parts(self) -> IntArray:
        """(face,) index into `part_names`."""
        return self.sequence.face_parts

    @property
    def joint_names(self) -> tuple[str, ...]:
        return self.sequence.joint_names

    @property
    def action(self) -> str:
        """Name of the action in labels; empty for an unknown one."""
        return ""

    @property
    def duration(self) -> float:
        """Length of the mesh sequence [s]; `inf` for a rigid mesh."""
        return self.sequence.duration

    def pose(self, t: float) -> tuple[FloatArray, FloatArray]:
        """World position (3,) [m] and rotation (3, 3) from the actor's frame to the world at time `t` [s]."""
        if self.trajectory is None:
            position = np.asarray(self.position) + float(t) * np.asarray(self.velocity)
            return position, rotation_matrix(self.orientation)
        place, orientation = pose_at(self.trajectory, t, self.orientation, f"{self.name}: ")
        return np.asarray(place), rotation_matrix(orientation)

    def vertices(self, t: float) -> FloatArray:
        """(vertex, 3) world positions [m] at time `t` [s]."""
        return self._to_world(self.sequence.vertices(t), t)

    def joints(self, t: float) -> FloatArray:
        """(joint, 3) world positions of the joints [m] at time `t` [s]."""
        return self._to_world(self.sequence.joints(t), t)

    def _to_world(self, points: FloatArray, t: float) -> FloatArray:
        position, rotation = self.pose(t)
        return np.asarray(points, np.float64) @ rotation.T + position
