"""Mesh files as parts in metres and with z up: OBJ, glTF, PLY, STL and further formats of trimesh."""

from __future__ import annotations

import json
import re
import warnings
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from rfgen_sionna._short_repr import ShortRepr
from rfgen_sionna._types import FloatArray, IntArray
from rfgen_sionna.radar.profile import is_number
from rfgen_sionna.scene.obj_file import read_obj
from rfgen_sionna.scene.scene_errors import MeshError

GLTF_SUFFIXES = (".glb", ".gltf")
MESH_SUFFIXES = (".obj", *GLTF_SUFFIXES, ".ply", ".stl", ".off")
"""Endings of the mesh files that scenes take."""
LARGE_MESH = 20.0
"""Extent of an actor [m] above which its file is probably in millimetres or centimetres."""
LARGE_STL = 6.0
""":data:`LARGE_MESH` of STL files, which have no unit and come from mechanical design, in millimetres."""
LARGE_ARRAYS = 100.0
""":data:`LARGE_MESH` of arrays, which programs fill rather than exporters."""
LARGE_SCENE, HIGH_SCENE = 10e3, 900.0
"""Extent and height of a scene [m] above which it is probably in millimetres; no building is higher."""
SINGLE_STEP = 2e-4
"""Allowed distance of neighbouring coordinates [m]: roundings of 0.1 mm."""
_PACKED = (
    "KHR_draco_mesh_compression", "EXT_meshopt_compression", "KHR_mesh_quantization", "EXT_mesh_gpu_instancing",
)  # fmt: skip

_FORWARD: Mapping[str, tuple[tuple[int, int, int], ...]] = MappingProxyType(
    {
        "z": ((1, 0, 0), (0, 1, 0), (0, 0, 1)),
        "y": ((0, 0, 1), (1, 0, 0), (0, 1, 0)),
        "x": ((0, 1, 0), (0, 0, 1), (1, 0, 0)),
        "-z": ((1, 0, 0), (0, -1, 0), (0, 0, -1)),
        "-y": ((0, 0, 1), (-1, 0, 0), (0, -1, 0)),
        "-x": ((0, 1, 0), (0, 0, -1), (-1, 0, 0)),
    }
)
"""Up axis of a thing with a front (glTF: +z with y up) -> rotation to z up and the front along +x."""
_UPRIGHT: Mapping[str, tuple[tuple[int, int, int], ...]] = MappingProxyType(
    {
        **_FORWARD,
        "y": ((1, 0, 0), (0, 0, -1), (0, 1, 0)),
        "x": ((0, 0, -1), (0, 1, 0), (1, 0, 0)),
        "-y": ((1, 0, 0), (0, 0, 1), (0, -1, 0)),
        "-x": ((0, 0, 1), (0, 1, 0), (-1, 0, 0)),
    }
)
"""Up axis of a place -> rotation about one horizontal axis to z up, which undoes that of Blender's exporters."""


@dataclass(frozen=True, eq=False, repr=False)
class MeshPart(ShortRepr):
    """Triangles of one object and one material of a mesh file."""

    name: str
    """Name of the object or node; may be empty."""
    material: str
    """Name of the material in the file; empty without one."""
    vertices: FloatArray
    """(vertex, 3) positions [m]."""
    faces: IntArray
    """(face, 3) vertex indices."""


def to_z_up(up: str | None, *, front: bool) -> FloatArray:
    """(3, 3) rotation from a file with the axis `up` ("x", "y", "z", "-x", "-y", "-z") upwards; None is "z".

    With a `front` (glTF's +z, y up) it turns to +x, where actors face; otherwise x stays, as for Blender's exports.

    Raises:
        ValueError: `up` is no axis.
    """
    table = _FORWARD if front else _UPRIGHT
    if up is not None and (not isinstance(up, str) or up.lower().removeprefix("+") not in table):
        raise ValueError(f"up: {up!r} given, allowed are {', '.join(map(repr, table))}")
    return np.array(table["z" if up is None else up.lower().removeprefix("+")], np.float64)


def check_scale(scale: float | None) -> float:
    """`scale` [m per unit of the file], 1 for None; ValueError if it is not positive and finite."""
    if scale is None:
        return 1.0
    if not (is_number(scale) and scale > 0.0):
        raise ValueError(f"scale: {scale!r} given, a positive number of metres per unit is needed (0.001 for mm)")
    return float(scale)


def read_mesh_parts(
    path: Path, *, up: str | None = None, scale: float | None = None, front: bool = True, merge: bool = False
) -> list[MeshPart]:
    """Parts of a mesh file, in metres and with z up.

    Args:
        path: file of a format that trimesh reads.
        up: up axis of the file; None is "y" for glTF, as its standard says, and "z" for others.
        scale: metres per unit of the file; None takes the unit that the file states, else metres.
        front: whether the front (glTF's +z) turns to +x; see :func:`to_z_up`.
        merge: whether the parts become one.

    Raises:
        MeshError: the file cannot be read or has no triangles.
        FileNotFoundError, IsADirectoryError: the path is no file.
        ValueError: `up` is no axis or `scale` is not positive.
    """
    if path.is_dir():
        raise IsADirectoryError(f"mesh file {str(path)!r} is a directory: give the path of a file in it")
    if not path.is_file():
        raise FileNotFoundError(f"mesh file {str(path)!r} does not exist")
    suffix = path.suffix.lower()
    turn = to_z_up("y" if up is None and suffix in GLTF_SUFFIXES else up, front=front)
    metres = check_scale(scale)
    if suffix == ".obj":
        parts, unit = [MeshPart(*each) for each in read_obj(path)], 1.0
    else:
        if suffix in GLTF_SUFFIXES:
            _check_gltf(path)
        parts, unit = _load(path)
    if scale is None:
        metres = unit
    parts = [replace(part, vertices=metres * (part.vertices @ turn.T)) for part in parts]
    if merge and len(parts) > 1:
        first = np.cumsum([0, *(len(part.vertices) for part in parts)])
        faces = [part.faces + np.int32(k) for part, k in zip(parts, first[:-1], strict=True)]
        return [MeshPart("", "", np.concatenate([part.vertices for part in parts]), np.concatenate(faces))]
    return parts


def scene_parts(scene: Any) -> list[MeshPart]:
    """Parts of a `trimesh.Trimesh` or `trimesh.Scene`, in its own units and axes."""
    if not hasattr(scene, "geometry"):
        return [MeshPart("", _material_name(scene), *_arrays(scene.vertices, scene.faces))]
    found = []
    for node in scene.graph.nodes_geometry:
        transform, name = scene.graph[node]
        mesh = scene.geometry[name]
        if not hasattr(mesh, "faces") or not len(mesh.faces):
            continue
        turn = np.asarray(transform, np.float64)
        vertices, faces = _arrays(mesh.vertices, mesh.faces)
        if np.linalg.det(turn[:3, :3]) < 0.0:  # a mirrored node turns its faces inside out
            faces = np.ascontiguousarray(faces[:, ::-1])
        found.append(MeshPart(str(node), _material_name(mesh), vertices @ turn[:3, :3].T + turn[:3, 3], faces))
    return sorted(found, key=lambda part: part.name)


def metres_per_unit(mesh: Any) -> float:
    """Metres per unit of a trimesh object that states its units, else 1."""
    units = getattr(mesh, "units", None)
    if not units:
        return 1.0
    from trimesh.units import unit_conversion

    try:
        return float(unit_conversion(str(units), "meters"))
    except (KeyError, ValueError) as error:
        raise MeshError(f"units: {units!r} of the mesh are unknown; give scale, in metres per unit") from error


def warn_of_units(name: str, points: FloatArray, limit: float = LARGE_MESH, stacklevel: int = 2) -> None:
    """Warn of a mesh with points (vertex, 3) [m] that is longer than `limit` [m], as one in millimetres is."""
    finite = points[np.isfinite(points).all(axis=1)]
    if not len(finite):
        return
    extent = float(np.ptp(finite, axis=0).max())
    if extent > limit:
        warnings.warn(f"{name}: it is {extent:.4g} m long; {units_hint(extent)}", stacklevel=stacklevel + 1)


def units_hint(extent: float) -> str:
    """Cure for an `extent` [m] that is too large, as text."""
    return (
        f"coordinates are in metres: scale=0.001 takes a file in millimetres ({1e-3 * extent:.4g} m), scale=0.01 one "
        f"in centimetres ({1e-2 * extent:.4g} m)"
    )


def warn_of_scene_units(name: str, meshes: Iterable[FloatArray], stacklevel: int = 2) -> None:
    """Warn of a scene with the vertices `meshes` (vertex, 3) [m] each that is too long or high to be in metres."""
    ends = [(points.min(axis=0), points.max(axis=0)) for points in meshes if len(points)]
    if not ends:
        return
    size = np.max([high for _, high in ends], axis=0) - np.min([low for low, _ in ends], axis=0)
    if size.max() > LARGE_SCENE or size[2] > HIGH_SCENE:
        text = f"scene {name!r}: it is {' x '.join(f'{length:.4g}' for length in size)} m large"
        warnings.warn(f"{text}; {units_hint(float(size.max()))}", stacklevel=stacklevel + 1)


def _load(path: Path) -> tuple[list[MeshPart], float]:
    """Parts of a file by trimesh, and metres per unit."""
    import trimesh

    try:
        # Unprocessed: NaN is reported, not dropped.
        loaded = trimesh.load(path, process=False)
        parts = scene_parts(loaded) if hasattr(loaded, "geometry") or hasattr(loaded, "faces") else []
    except Exception as error:  # any exception of a parser
        cure = "" if path.suffix.lower() in MESH_SUFFIXES else "; export it as glTF (.glb), OBJ, PLY or STL"
        raise MeshError(f"mesh file {str(path)!r} cannot be read: {error}{cure}") from error
    if is_single_precision(path):
        for mesh in loaded.geometry.values() if hasattr(loaded, "geometry") else [loaded]:
            check_digits(
                f"mesh file {str(path)!r}", np.asarray(getattr(mesh, "vertices", ()), np.float64).reshape(-1, 3)
            )
    parts = [part for part in parts if len(part.faces)]
    if not parts:
        points = _count(loaded, "vertices")
        there = f": it has {points:,} points without faces, which must be meshed first" if points else ""
        raise MeshError(f"mesh file {str(path)!r} holds no triangles{there}")
    return parts, 1.0 if path.suffix.lower() in GLTF_SUFFIXES else metres_per_unit(loaded)


def is_single_precision(path: Path) -> bool:
    """Whether a mesh file holds its coordinates as 32-bit floats: glTF, binary STL, and PLY with such properties."""
    suffix = path.suffix.lower()
    if suffix in GLTF_SUFFIXES:
        return True
    with path.open("rb") as file:
        start = file.read(4096)
    if suffix == ".stl":
        return not start.lstrip().startswith(b"solid")
    return suffix == ".ply" and re.search(rb"property\s+float(32)?\s+x", start) is not None


def check_digits(what: str, vertices: FloatArray) -> None:
    """Refuse coordinates (vertex, 3) that were rounded to 32-bit floats far from the origin, such as UTM.

    Raises:
        MeshError: steps of the coordinates are above `SINGLE_STEP`, although the mesh is small.
    """
    if not len(vertices) or not np.isfinite(vertices).all():
        return
    far = np.abs(vertices).max(axis=0)
    step = np.spacing(far.astype(np.float32)).astype(np.float64)
    axis = int(step.argmax())
    offset, extent = np.abs(vertices.mean(axis=0)).max(), np.ptp(vertices, axis=0).max()
    if step[axis] < SINGLE_STEP or offset < 2.0 * extent:
        return
    # Rounded coordinates use all steps; whole metres and the like need not be rounded ones.
    if (np.round(vertices[:, axis] / step[axis]) % 2 == 1).any():
        raise MeshError(
            f"{what}: its coordinates are 32-bit floats, which are {step[axis]:.2g} m apart at {'xyz'[axis]} = "
            f"{far[axis]:.10g} m: the shape is lost. Export it near the origin, or in double precision (OBJ, PLY with "
            "`property double`)"
        )


def _count(loaded: Any, attribute: str) -> int:
    each = loaded.geometry.values() if hasattr(loaded, "geometry") else [loaded]
    return sum(len(getattr(one, attribute, ())) for one in each)


def _arrays(vertices: Any, faces: Any) -> tuple[FloatArray, IntArray]:
    return np.asarray(vertices, np.float64), np.asarray(faces, np.int32)


def _material_name(mesh: Any) -> str:
    """Name of the material of a trimesh mesh; empty without one."""
    return str(getattr(getattr(getattr(mesh, "visual", None), "material", None), "name", None) or "")


def _check_gltf(path: Path) -> None:
    """Refuse geometry of a glTF file that trimesh does not read, and warn of animations and bones."""
    raw = path.read_bytes()
    try:
        tree = json.loads(raw[20 : 20 + int.from_bytes(raw[12:16], "little")] if raw[:4] == b"glTF" else raw)
        used = {*tree.get("extensionsRequired", ()), *tree.get("extensionsUsed", ())}
        lost = [f"extension {name}" for name in _PACKED if name in used]
        lost += ["sparse accessors"] * any("sparse" in accessor for accessor in tree.get("accessors", ()))
        modes = {each.get("mode", 4) for mesh in tree.get("meshes", ()) for each in mesh["primitives"]}
        lost += ["triangle fans"] * (6 in modes)
        moves, bones = bool(tree.get("animations")), bool(tree.get("skins"))
    except (ValueError, AttributeError, TypeError, KeyError) as error:
        raise MeshError(f"mesh file {str(path)!r} cannot be read: no sound glTF ({error})") from error
    if lost:
        raise MeshError(
            f"mesh file {str(path)!r} has geometry that is not read ({', '.join(lost)}): export it as plain triangles, "
            "without compression"
        )
    if moves or bones:
        what = "animation is" if moves else "bones are"
        warnings.warn(
            f"{path.name}: its {what} left out, the mesh keeps its pose at rest; Actor.from_motion plays animations",
            stacklevel=5,
        )
