"""Actors: mesh sequences with a material and a pose in the world."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Self

import numpy as np

from rfgen_sionna._short_repr import ShortRepr, short_value, short_vector
from rfgen_sionna._types import SPEED_OF_LIGHT, FloatArray, IntArray
from rfgen_sionna.radar.pose import Vector, pose_at, rotation_matrix, vector
from rfgen_sionna.records import MeshSequence
from rfgen_sionna.scene.material_names import label_parts
from rfgen_sionna.scene.materials import Material, material
from rfgen_sionna.scene.mesh_files import warn_of_units
from rfgen_sionna.scene.rigid_mesh import RigidMesh, mesh_parts, size_limit
from rfgen_sionna.scene.scene_errors import MaterialError
from rfgen_sionna.scene.vertex_welding import weld_vertices

MAX_SPEED = 0.01 * SPEED_OF_LIGHT
"""Largest constant velocity [m/s]: the tracer neglects motion during the travel time."""
_PROBE_TIMES = (0.0, 0.236, 0.382, 0.618, 0.854, 1.0)
"""Tests for closed seams, as shares of the duration; in phase with no motion cycle."""


@dataclass(frozen=True, eq=False, repr=False)
class MeshActor(ShortRepr):
    """A mesh sequence of one material, or of one for each part, with a rigid motion in the world on top of its own
    deformation. Paths of an actor of several materials are labelled by actor and material: "car, glass".

    Raises:
        ValueError: a vector is not three finite numbers, the velocity exceeds :data:`MAX_SPEED`, the name is empty, or
            a trajectory comes with a position or velocity.
        MaterialError: the material is unknown.
        TypeError: `sequence` is no mesh sequence.
    """

    sequence: MeshSequence
    """Shape over time in the actor's own frame [m]."""
    material: str | Material | Mapping[str, str | Material]
    """A material, or its name in :data:`rfgen_sionna.scene.MATERIALS` (:func:`rfgen_sionna.material` makes own ones);
    or a mapping from each of `part_names` to one."""
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
        if max(map(abs, self.orientation)) > 2 * math.pi:
            turned = short_vector(np.degrees(self.orientation))
            warnings.warn(
                f"{self.name}: orientation is {short_vector(self.orientation)}, yaw, pitch, roll in radians, which are "
                f"{turned}°: np.radians turns degrees into radians",
                stacklevel=4,
            )
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
        _ = self.materials

    @classmethod
    def from_mesh(
        cls,
        mesh: Any,
        *,
        material: str | Material | Mapping[str, str | Material] = "",
        position: Vector = (0.0, 0.0, 0.0),
        velocity: Vector = (0.0, 0.0, 0.0),
        orientation: Vector = (0.0, 0.0, 0.0),
        trajectory: Callable[[float], Any] | None = None,
        name: str | None = None,
        up: str | None = None,
        scale: float | None = None,
        default_material: str | Material | None = None,
    ) -> Self:
        """A rigid actor.

        Args:
            mesh: `trimesh.Trimesh`, `trimesh.Scene`, path of a file that trimesh reads, or a pair (vertices, faces).
                Colours and textures have no effect.
            material: a material or its name, for the whole mesh; or a mapping from names of materials or objects in the
                file to materials: `{"paint": "metal", "window": "glass"}`. Without it, materials (else objects) in the
                file with names of :data:`rfgen_sionna.scene.MATERIALS` are those.
            position, velocity, orientation, trajectory: fields of this class.
            name: label; None takes the file's name, else "mesh".
            up: up axis of the mesh, "x", "y", "z", "-x", "-y" or "-z"; None is "y" for glTF files, else "z". The front
                of a mesh with y up is +z, as in glTF, and turns to +x.
            scale: metres per unit of the mesh, 0.001 for millimetres; None takes the unit of the file, else metres.
            default_material: material of the parts of a mesh without a known one; None refuses them, with their names.

        Raises:
            MeshError: the mesh is not usable (:func:`rfgen_sionna.scene.mesh.check_mesh`).
            MaterialError: no material, or an unknown one.
            FileNotFoundError, IsADirectoryError: the path is no file.
            ValueError: `up` is no axis, `scale` is not positive, or a `default_material` has no effect.
            TypeError: `mesh` is none of the above.
        """
        if isinstance(material, Material) or (isinstance(material, str) and material.strip()):
            if default_material is not None:
                raise ValueError("default_material: material gives one to the whole mesh, leave one of them out")
            rigid = RigidMesh.load(mesh, name, up=up, scale=scale)
            return cls(rigid, material, rigid.name, position, orientation, velocity, trajectory)
        parts, own_name = mesh_parts(mesh, name, up=up, scale=scale)
        labels, materials = label_parts(parts, material, own_name, default_material)
        labelled = [(label, part.vertices, part.faces) for label, part in zip(labels, parts, strict=True)]
        rigid = RigidMesh.of_parts(labelled, own_name)
        warn_of_units(rigid.name, rigid.points, size_limit(mesh, scale))
        of_parts = materials[labels[0]] if len(rigid.part_names) == 1 else materials
        return cls(rigid, of_parts, rigid.name, position, orientation, velocity, trajectory)

    @cached_property
    def materials(self) -> tuple[Material, ...]:
        """Material of each of `part_names`; named ones refuse frequencies that their sources do not cover."""
        names = self.sequence.part_names
        if not isinstance(self.material, Mapping):
            return (self._material_of(self.material),) * len(names)
        missing = [name for name in names if name not in self.material]
        unused = [name for name in self.material if name not in names]
        if missing or unused:
            raise MaterialError(
                f"{self.name}: material gives {', '.join(map(repr, self.material)) or 'nothing'}, one for each part is "
                f"needed: {', '.join(map(repr, names))}"
            )
        return tuple(self._material_of(self.material[name]) for name in names)

    def _material_of(self, given: str | Material) -> Material:
        return given if isinstance(given, Material) else material(given, outside="raise", owner=self.name)

    def _facts(self) -> Iterable[str]:
        yield short_value(self.name)
        yield f"material {self.material_names}"
        yield f"{len(self.sequence.vertices(0.0))} vertices, {len(self.faces)} faces"
        yield f"{len(self.part_names)} parts" if len(self.part_names) > 1 else ""
        yield f"{len(self.joint_names)} joints" if self.joint_names else ""
        yield f"action {self.action!r}" if self.action else ""
        endless = "rigid" if isinstance(self.sequence, RigidMesh) else "moves"
        yield endless if math.isinf(self.duration) else f"moves for {self.duration:.4g} s"
        yield "on a trajectory" if self.trajectory is not None else f"at {short_vector(self.position)} m"
        yield f"yaw, pitch, roll {short_vector(np.degrees(self.orientation))}°" if any(self.orientation) else ""
        yield f"velocity {short_vector(self.velocity)} m/s" if any(self.velocity) else ""

    @property
    def material_names(self) -> str:
        """Names of the materials: "metal, glass"."""
        return ", ".join(dict.fromkeys(each.name for each in self.materials))

    @property
    def properties(self) -> Material:
        """The material of all parts.

        Raises:
            MaterialError: the parts have several materials (`materials`).
        """
        if any(each != self.materials[0] for each in self.materials[1:]):
            each = zip(self.part_names, self.materials, strict=True)
            given = ", ".join(f"{name} ({of.name})" for name, of in each)
            raise MaterialError(f"{self.name}: one material is needed here, it has several: {given}")
        return self.materials[0]

    @cached_property
    def faces(self) -> IntArray:
        """(face, 3) vertex indices, counter-clockwise from outside, with welded seams
        (:func:`rfgen_sionna.scene.vertex_welding.weld_vertices`)."""
        faces, duration = self.sequence.faces, self.sequence.duration
        if isinstance(self.sequence, RigidMesh):
            return faces
        length = duration if math.isfinite(duration) else 1.0
        return weld_vertices(faces, (self.sequence.vertices(share * length) for share in _PROBE_TIMES))

    @cached_property
    def rest_vertices(self) -> FloatArray:
        """(vertex, 3) positions of the mesh at rest in the actor's own frame [m]: those of a body model, else the pose
        at t = 0."""
        rest: FloatArray | None = getattr(self.sequence, "rest_vertices", None)
        return np.asarray(self.sequence.vertices(0.0) if rest is None else rest, np.float64)

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
