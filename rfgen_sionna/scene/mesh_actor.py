"""Actors: meshes that are placed in the scene and move through it."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from rfgen_sionna._types import SPEED_OF_LIGHT, FloatArray, IntArray
from rfgen_sionna.radar.pose import rotation_matrix
from rfgen_sionna.records import MeshSequence
from rfgen_sionna.scene.materials import Material, material
from rfgen_sionna.scene.mesh import RigidMesh
from rfgen_sionna.scene.vertex_welding import weld_vertices

MAX_SPEED = 0.01 * SPEED_OF_LIGHT
"""Constant velocities, at most [m/s]: an echo comes from where a thing is, not from where it was."""
_PROBE_TIMES = (0.0, 0.236, 0.382, 0.618, 0.854, 1.0)
"""Shares of a sequence's length at which seams are looked at whether they stay closed; no cycle keeps step with all."""
Vector: TypeAlias = tuple[float, float, float]


@dataclass(frozen=True, eq=False)
class MeshActor:
    """A mesh sequence of one material, placed and moving rigidly in the world on top of its own deformation.

    Raises:
        ValueError: a vector that is not three finite numbers, a velocity beyond :data:`MAX_SPEED`, an empty name, or a
            trajectory together with a position or velocity.
        MaterialError: unknown material.
        TypeError: `sequence` is no mesh sequence.
    """

    sequence: MeshSequence
    """Shape over time in the actor's own frame [m]."""
    material: str | Material
    """Name of a material, see :data:`rfgen_sionna.scene.MATERIALS`, or a material, such as
    `dataclasses.replace(MATERIALS["concrete"], scattering_coefficient=0.3)`."""
    name: str = "actor"
    """Name in labels; unique within a simulation."""
    position: Vector = (0.0, 0.0, 0.0)
    """World position of the actor's origin at t = 0 [m]."""
    orientation: Vector = (0.0, 0.0, 0.0)
    """(yaw, pitch, roll) [rad]."""
    velocity: Vector = (0.0, 0.0, 0.0)
    """Constant velocity in the world [m/s]."""
    trajectory: Callable[[float], Any] | None = None
    """Function of the time [s] that returns the position [m], or a pair (position, orientation [rad]), instead of
    `position` and `velocity`. It must be smooth (C²): steps in it are steps in the phase."""

    def __post_init__(self) -> None:
        if not isinstance(self.sequence, MeshSequence):
            raise TypeError(
                f"sequence: {type(self.sequence).__name__} is no mesh sequence (Actor.from_mesh takes a mesh)"
            )
        if not isinstance(self.name, str) or not self.name:
            raise ValueError(f"name: {self.name!r} given, a text that is not empty is needed")
        for field in ("position", "orientation", "velocity"):
            object.__setattr__(self, field, _vector(getattr(self, field), f"{self.name}: {field}"))
        speed = math.hypot(*self.velocity)
        if speed > MAX_SPEED:
            # All digits: a limit that is rounded may be above what it refuses.
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
        position: ArrayLike = (0.0, 0.0, 0.0),
        velocity: ArrayLike = (0.0, 0.0, 0.0),
        orientation: ArrayLike = (0.0, 0.0, 0.0),
        trajectory: Callable[[float], Any] | None = None,
        name: str | None = None,
    ) -> MeshActor:
        """A rigid actor.

        Args:
            mesh: `trimesh.Trimesh`, `trimesh.Scene` (all of it), path of a file that trimesh reads (in metres), or a
                pair (vertices, faces).
            material: a material or its name; there is none that would be taken without.
            position: world position of the mesh's origin at t = 0 [m].
            velocity: [m/s].
            orientation: (yaw, pitch, roll) [rad].
            trajectory: see :attr:`trajectory`.
            name: what labels call it; the file's name or "mesh" where it is not given.

        Raises:
            MeshError: the mesh is not usable (see :func:`rfgen_sionna.scene.mesh.check_mesh`).
            MaterialError: no material, or an unknown one.
            FileNotFoundError: there is no such file.
            IsADirectoryError: the path is that of a directory.
            TypeError: `mesh` is none of the above.
        """
        if name is None and isinstance(mesh, (str, Path)):
            name = Path(mesh).stem
        rigid = RigidMesh.load(mesh, name)
        return cls(
            rigid,
            material,
            name=rigid.name,
            position=position,  # type: ignore[arg-type]  # checked and turned into a tuple on construction
            velocity=velocity,  # type: ignore[arg-type]
            orientation=orientation,  # type: ignore[arg-type]
            trajectory=trajectory,
        )

    @property
    def properties(self) -> Material:
        """The material's properties; of one that is named at frequencies that its source covers, and no others."""
        if isinstance(self.material, Material):
            return self.material
        return material(self.material, outside="raise", owner=self.name)

    @cached_property
    def faces(self) -> IntArray:
        """(face, 3) vertex indices, counter-clockwise seen from outside; seams of the sequence's are sewn
        (:func:`rfgen_sionna.scene.vertex_welding.weld_vertices`)."""
        faces, duration = self.sequence.faces, self.sequence.duration
        if isinstance(self.sequence, RigidMesh):
            return faces  # that is done
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
    def duration(self) -> float:
        """Length of the mesh sequence [s]; `inf` for a rigid mesh."""
        return self.sequence.duration

    def pose(self, t: float) -> tuple[FloatArray, FloatArray]:
        """World position (3,) [m] and rotation (3, 3) from the actor's frame to the world at time `t` [s]."""
        orientation: ArrayLike = self.orientation
        if self.trajectory is None:
            position = np.asarray(self.position) + float(t) * np.asarray(self.velocity)
        else:
            place, orientation = _split_pose(self.trajectory(float(t)), self.orientation)
            position = np.asarray(_vector(place, f"{self.name}: position on the trajectory at t = {t} s"))
            orientation = _vector(orientation, f"{self.name}: orientation on the trajectory at t = {t} s")
        return position, rotation_matrix(orientation)

    def vertices(self, t: float) -> FloatArray:
        """(vertex, 3) world positions at time `t` [s], in metres."""
        return self._to_world(self.sequence.vertices(t), t)

    def joints(self, t: float) -> FloatArray:
        """(joint, 3) world positions of the joints at time `t` [s], in metres."""
        return self._to_world(self.sequence.joints(t), t)

    def _to_world(self, points: FloatArray, t: float) -> FloatArray:
        position, rotation = self.pose(t)
        return np.asarray(points, np.float64) @ rotation.T + position


def _vector(value: Any, what: str) -> Vector:
    try:
        array = np.asarray(value, np.float64)
    except (TypeError, ValueError):
        raise ValueError(f"{what}: {value!r} given, three numbers are needed") from None
    if array.shape != (3,) or not np.isfinite(array).all():
        raise ValueError(f"{what}: {value!r} given, three finite numbers are needed")
    return float(array[0]), float(array[1]), float(array[2])


def _split_pose(pose: Any, orientation: Vector) -> tuple[Any, Any]:
    """Position and orientation of a trajectory's value; three numbers are a position alone."""
    if isinstance(pose, (tuple, list)) and len(pose) == 2:
        return pose[0], pose[1]
    return pose, orientation
