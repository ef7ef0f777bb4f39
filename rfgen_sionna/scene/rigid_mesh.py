"""Meshes that keep their shape, from files, from trimesh or from arrays."""

from __future__ import annotations

import math
import os
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from rfgen_sionna._short_repr import ShortRepr
from rfgen_sionna._types import FloatArray, IntArray
from rfgen_sionna.scene.mesh import check_mesh
from rfgen_sionna.scene.mesh_files import (
    LARGE_ARRAYS,
    LARGE_MESH,
    LARGE_STL,
    MeshPart,
    check_scale,
    metres_per_unit,
    read_mesh_parts,
    scene_parts,
    to_z_up,
    warn_of_units,
)
from rfgen_sionna.scene.scene_errors import MeshError


def _no_parts() -> IntArray:
    return np.empty(0, np.int32)


@dataclass(frozen=True, eq=False, repr=False)
class RigidMesh(ShortRepr):
    """A mesh of constant shape: a :class:`~rfgen_sionna.records.MeshSequence`.

    Raises:
        MeshError: see :func:`~rfgen_sionna.scene.mesh.check_mesh`, which checks each part by itself.
        ValueError: `name` is no text, or empty.
    """

    points: FloatArray
    """(vertex, 3) positions of the used vertices in the mesh's own frame [m]."""
    faces: IntArray
    """(face, 3) vertex indices, counter-clockwise from outside."""
    name: str = "mesh"
    part_names: tuple[str, ...] = ()
    """Names of the parts; empty takes the mesh's name for its only part."""
    face_parts: IntArray = field(default_factory=_no_parts)
    """(face,) index into `part_names`, ascending; empty for a single part."""

    def __post_init__(self) -> None:
        if not isinstance(self.name, str) or not self.name:
            raise ValueError(f"name: {self.name!r} given, a text that is not empty is needed")
        names = tuple(self.part_names) or (self.name,)
        if len(names) == 1:
            points, faces = check_mesh(self.points, self.faces, self.name)
            owners = np.zeros(len(faces), np.int32)
        else:
            given = np.asarray(self.faces)
            if np.shape(self.face_parts) != (len(given),):
                raise MeshError(f"{self.name}: face_parts of shape ({len(given)},) are needed, one for each face")
            each = [
                check_mesh(self.points, given[np.asarray(self.face_parts) == k], f"{self.name}, {name}")
                for k, name in enumerate(names)
            ]
            first = np.cumsum([0, *(len(vertices) for vertices, _ in each)])
            points = np.concatenate([vertices for vertices, _ in each])
            faces = np.concatenate([own + np.int32(k) for (_, own), k in zip(each, first[:-1], strict=True)])
            owners = np.repeat(np.arange(len(names), dtype=np.int32), [len(own) for _, own in each])
        for array in (points, faces, owners):
            array.flags.writeable = False
        object.__setattr__(self, "points", points)
        object.__setattr__(self, "faces", faces)
        object.__setattr__(self, "part_names", names)
        object.__setattr__(self, "face_parts", owners)

    @classmethod
    def load(
        cls, mesh: Any, name: str | None = None, *, up: str | None = None, scale: float | None = None
    ) -> RigidMesh:
        """A rigid mesh of one part.

        Args:
            mesh: a `trimesh.Trimesh`, a `trimesh.Scene` as one mesh, a file that trimesh reads, or a pair (vertices,
                faces).
            name: name of the mesh; None takes the file's name, else "mesh".
            up, scale: up axis, and metres per unit, as of :func:`mesh_parts`.

        Raises:
            MeshError: the mesh is not usable, or the file has none.
            ValueError: `name` is no text, or empty, `up` is no axis or `scale` is not positive.
            FileNotFoundError, IsADirectoryError: the path is no file.
            TypeError: `mesh` is none of the above.
        """
        parts, own_name = mesh_parts(mesh, name, up=up, scale=scale)
        found = cls.of_parts([("", part.vertices, part.faces) for part in parts], own_name)
        warn_of_units(found.name, found.points, size_limit(mesh, scale), stacklevel=3)
        return found

    @classmethod
    def of_parts(cls, parts: Sequence[tuple[str, FloatArray, IntArray]], name: str) -> RigidMesh:
        """A mesh of parts: label, vertices (vertex, 3) [m] and faces (face, 3) of each; equal labels are one part."""
        labels = tuple(dict.fromkeys(label for label, _, _ in parts))
        ranked = sorted(parts, key=lambda part: labels.index(part[0])) if len(labels) > 1 else parts
        if len(ranked) == 1:
            return cls(ranked[0][1], ranked[0][2], name)
        first = np.cumsum([0, *(len(vertices) for _, vertices, _ in ranked)])
        points = np.concatenate([vertices for _, vertices, _ in ranked])
        faces = np.concatenate([own + np.int32(k) for (_, _, own), k in zip(ranked, first[:-1], strict=True)])
        owners = np.repeat(
            np.array([labels.index(label) for label, _, _ in ranked], np.int32), [len(own) for _, _, own in ranked]
        )
        return cls(points, faces, name, labels if len(labels) > 1 else (), owners)

    @property
    def duration(self) -> float:
        return math.inf

    @property
    def joint_names(self) -> tuple[str, ...]:
        return ()

    def vertices(self, t: float) -> FloatArray:
        """(vertex, 3) positions [m], the same at any time; read-only."""
        return self.points

    def joints(self, t: float) -> FloatArray:
        """(0, 3): no skeleton."""
        return np.empty((0, 3))


def mesh_parts(
    mesh: Any, name: str | None = None, *, up: str | None = None, scale: float | None = None
) -> tuple[list[MeshPart], str]:
    """Parts of a mesh in metres, z up and front along +x, and its name.

    Args:
        mesh: as of :meth:`RigidMesh.load`.
        name: name of the mesh; None takes the file's name, else "mesh".
        up: axis that points upwards, "x", "y", "z", "-x", "-y" or "-z"; None is "y" for glTF files, else "z". With y
            up the front is along +z, as in glTF.
        scale: metres per unit, 0.001 for millimetres; None takes the unit of the file or object, else metres.

    Raises:
        MeshError, ValueError, FileNotFoundError, IsADirectoryError, TypeError: as of :meth:`RigidMesh.load`.
    """
    if name is not None and (not isinstance(name, str) or not name):
        raise ValueError(f"name: {name!r} given, a text that is not empty is needed")
    if isinstance(mesh, (str, os.PathLike)):
        path = Path(mesh)
        name = path.stem if name is None else name
        parts = read_mesh_parts(path, up=up, scale=scale)
    else:
        name = "mesh" if name is None else name
        turn, metres = to_z_up(up, front=True), check_scale(scale)
        if isinstance(mesh, (tuple, list)) and len(mesh) == 2:
            # One pair of arrays: lists, tensors and wrong shapes go to the check of meshes as they are.
            plain = up is None and scale is None
            vertices = mesh[0] if plain else metres * (np.asarray(mesh[0], np.float64) @ turn.T)
            parts = [MeshPart("", "", vertices, mesh[1])]
        elif hasattr(mesh, "geometry") or (hasattr(mesh, "vertices") and hasattr(mesh, "faces")):
            metres = metres_per_unit(mesh) if scale is None else metres
            if up is None and getattr(getattr(mesh, "source", None), "file_type", None) in ("glb", "gltf"):
                warnings.warn(
                    f"{name}: z is taken for its up axis, but its glTF file has y up: give up='y', or up='z' for an "
                    "object that was turned, or the path of the file",
                    stacklevel=4,
                )
            parts = [
                MeshPart(part.name, part.material, metres * (part.vertices @ turn.T), part.faces)
                for part in scene_parts(mesh)
            ]
            if not parts:
                raise MeshError(f"{name}: the mesh is empty, it has no faces")
        else:
            raise TypeError(
                f"mesh: {type(mesh).__name__} given, allowed are a trimesh.Trimesh or trimesh.Scene, the path of a "
                "mesh file, or a pair (vertices, faces)"
            )
    return parts, name


def size_limit(mesh: Any, scale: float | None) -> float:
    """Extent [m] above which a mesh, as of :meth:`RigidMesh.load`, is probably not in metres."""
    if isinstance(mesh, (str, os.PathLike)):
        return LARGE_STL if Path(mesh).suffix.lower() == ".stl" and scale is None else LARGE_MESH
    return LARGE_ARRAYS if isinstance(mesh, (tuple, list)) else LARGE_MESH
