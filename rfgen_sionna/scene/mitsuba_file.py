"""Mitsuba's scene files: checks, names of materials, and vertices in double precision.

Mitsuba reads vertices into 32-bit floats. Far from the origin, such as in UTM coordinates, these are up to half a metre
apart; there the vertices are read from the mesh files and transformed in double precision.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from pathlib import Path
from types import MappingProxyType
from xml.etree import ElementTree

import numpy as np
from scipy.spatial.transform import Rotation

from rfgen_sionna._types import FloatArray, IntArray
from rfgen_sionna.scene.material_names import label_parts
from rfgen_sionna.scene.material_words import canonical_name
from rfgen_sionna.scene.materials import MATERIALS, Material, material
from rfgen_sionna.scene.mesh import bounds
from rfgen_sionna.scene.mesh_files import MeshPart, check_digits, is_single_precision, read_mesh_parts
from rfgen_sionna.scene.permittivity import Outside
from rfgen_sionna.scene.scene_errors import MaterialError, MeshError, SceneError

FAR = 256.0
"""Coordinate [m] beyond which vertices are read in double precision: 32-bit floats are 30 um apart there."""
FARTHEST = 2048.0
"""Coordinate [m] beyond which 32-bit floats are rounded by more than 0.1 mm."""
_RADIO = ("radio-material", "itu-radio-material", "holder-material")
_NO_MESHES = ("sphere", "cylinder", "disk", "bsplinecurve", "linearcurve", "sdfgrid", "ellipsoids", "instance")
_SHARED = "~material"
"""Ending of a material with the name of an object."""
_SINGLE_STEPS = 4.0
"""Roundings of a vertex by Mitsuba, in steps of 32-bit floats at the largest coordinate."""


def scene_tree(path: Path, own: Collection[str] = ()) -> ElementTree.Element:
    """Root of a Mitsuba scene file, with an id for the material of each shape.

    Args:
        path: scene file.
        own: names of shapes that get a material of their name, as do shapes without a material.

    Raises:
        SceneError: the file is no XML or no scene, has no shapes, or mesh files that do not exist.
    """
    try:
        root = ElementTree.parse(path).getroot()
    except (ElementTree.ParseError, UnicodeDecodeError) as error:
        raise SceneError(f"scene file {str(path)!r} is no XML: {error}") from error
    if root.tag != "scene":
        raise SceneError(f"scene file {str(path)!r} is no Mitsuba scene: its root is <{root.tag}>, not <scene>")
    files = [_file_of(path, shape) for shape in root.iter("shape")]
    if not files and root.find(".//include") is None:
        raise SceneError(f"scene file {str(path)!r} has no shapes")
    bodies = [shape for shape in root.iter("shape") if shape.get("type") in _NO_MESHES]
    if other := [f"{shape.get('id', '')!r} ({shape.get('type')})" for shape in bodies]:
        raise SceneError(
            f"scene file {str(path)!r}: shapes {', '.join(other[:5])} are no triangle meshes: give them as PLY files"
        )
    if missing := list(dict.fromkeys(str(file) for file in files if file is not None and not file.is_file())):
        shown = ", ".join(missing[:5]) + (f" and {len(missing) - 5} more" if len(missing) > 5 else "")
        raise SceneError(f"scene file {str(path)!r}: mesh files do not exist: {shown}")
    _name_materials(root, own)
    return root


def scene_materials(
    path: Path, materials: Mapping[str, str | Material], default: str | Material | None, outside: Outside
) -> Mapping[str, Material]:
    """Materials by id, of those of a Mitsuba scene file that are not radio materials of Sionna or this package.

    Args:
        path: scene file.
        materials: materials by id, with or without "mat-", or by names of shapes.
        default: material of ids that are unknown; None refuses them.
        outside: policy at frequencies that a source does not cover.

    Raises:
        SceneError: see :func:`scene_tree`.
        MaterialError: ids have no known material, or `materials` has others.
    """
    wanted = {bare_name(key): of for key, of in materials.items()}
    root = scene_tree(path, wanted)
    every = [*root.findall("./bsdf"), *root.findall(".//shape/bsdf")]
    ids = {bsdf.get("id", ""): bsdf for bsdf in every if bsdf.get("id")}
    bare = [bare_name(name) for name in ids]
    owner = f"scene {path.name!r}"
    if stray := [repr(key) for key in wanted if key not in bare]:
        there = ", ".join(map(repr, dict.fromkeys([*bare, *shapes_by_name(path)]))) or "none"
        raise MaterialError(
            f"{owner}: materials names {', '.join(stray)}; materials and objects of the file are {there}"
        )
    open_ids = [name for name, bsdf in ids.items() if bare_name(name) in wanted or not _is_radio(name, bsdf)]
    none, no_faces = np.empty((0, 3)), np.empty((0, 3), np.int32)
    parts = [MeshPart("", bare_name(name), none, no_faces) for name in open_ids]
    labels, chosen = label_parts(parts, wanted, owner, default, "materials", "default_material", "load_scene ")
    found = {}
    for name, label in zip(open_ids, labels, strict=True):
        of = chosen[label]
        found[name] = of if isinstance(of, Material) else material(of, outside=outside, owner=f"{owner}: {label}")
    return MappingProxyType(found)


def shapes_by_name(path: Path | None) -> dict[str, ElementTree.Element]:
    """Shapes of a Mitsuba scene file by the names of Sionna's objects; empty without a file."""
    shapes = () if path is None else scene_tree(path).iter("shape")
    return {bare_name(shape.get("id")): shape for shape in shapes if shape.get("id")}


def exact_mesh(
    path: Path, name: str, shape: ElementTree.Element | None, vertices: FloatArray, faces: IntArray
) -> tuple[FloatArray, IntArray]:
    """Vertices (vertex, 3) [m] and faces (face, 3) of a shape of a Mitsuba scene file, in double precision.

    Args:
        path: scene file.
        name: name of the object, for messages.
        shape: its element (:func:`shapes_by_name`); None if it has none.
        vertices, faces: as Mitsuba has read them; near the origin they are returned.

    Raises:
        SceneError: the shape is far from the origin, and its coordinates cannot be read in double precision.
    """
    far = float(np.abs(vertices).max(initial=0.0))
    if far < FAR:
        return vertices, faces
    where = f"scene file {str(path)!r}: object {name!r}"
    file = None if shape is None else _file_of(path, shape)
    if shape is None or file is None or file.suffix.lower() not in (".ply", ".obj"):
        problem = "its shape is no PLY or OBJ file with an id of its own"
    elif (matrix := _to_world(shape)) is None:
        problem = "its transform has elements that are not read here"
    else:
        try:
            if is_single_precision(file) and np.array_equal(matrix, np.eye(4)):
                check_digits(f"mesh file {str(file)!r}", vertices)
                return vertices, faces
            (part,) = read_mesh_parts(file, merge=True)
        except (MeshError, ValueError) as error:
            raise SceneError(f"{where}: {error}") from error
        exact = part.vertices @ matrix[:3, :3].T + matrix[:3, 3]
        largest = np.float32(max(far, np.abs(part.vertices).max(initial=0.0)))
        gap = np.abs(bounds(exact[part.faces.ravel()]) - bounds(vertices[faces.ravel()])).max()
        if len(part.faces) == len(faces) and gap <= _SINGLE_STEPS * np.spacing(largest):
            return exact, part.faces
        problem = "Mitsuba reads another shape in its file"
    if far < FARTHEST:
        return vertices, faces
    raise SceneError(
        f"{where} is {far:.10g} m from the origin, where Mitsuba's 32-bit floats are "
        f"{np.spacing(np.float32(far)):.2g} m apart, and {problem}: give it as a PLY file near the origin with a "
        "<translate> of its `to_world`, or the whole scene as OBJ"
    )


def bare_name(identifier: str | None) -> str:
    """Name of a material or object in a file, without Blender's prefixes and the ending of :func:`_name_materials`."""
    return (identifier or "").removeprefix("mat-").removeprefix("mesh-").removesuffix(_SHARED)


def _name_materials(root: ElementTree.Element, own: Collection[str]) -> None:
    """Give shapes of the names `own`, and those without a material, one of their name, and materials without an id
    that of their shape; leave out materials that no shape has; tell materials from shapes of their name."""
    ids = {bare_name(bsdf.get("id")): bsdf.get("id", "") for bsdf in root.iter("bsdf")}
    names = set[str]()
    for index, shape in enumerate(root.iter("shape")):
        name = bare_name(shape.get("id")) or f"{shape.get('type')}_{index}"
        names.add(name)
        inside, references = shape.findall("bsdf"), shape.findall("ref")
        if name in own and name not in ids:
            for element in (*inside, *references):
                shape.remove(element)
            inside, references = [], []
        if not inside and not references and name in ids:
            ElementTree.SubElement(shape, "ref", {"id": ids[name]})
        elif not inside and not references:
            inside = [ElementTree.SubElement(shape, "bsdf", {"type": "diffuse"})]
        for bsdf in inside:
            if not bsdf.get("id"):
                bsdf.set(
                    "id", next((part.get("id", "") for part in bsdf.iter("bsdf") if part.get("id")), f"mat-{name}")
                )
    if root.find(".//include") is None:
        used = {reference.get("id") for reference in root.iter("ref")}
        for bsdf in root.findall("./bsdf"):
            if bsdf.get("id") not in used:
                root.remove(bsdf)
    # Sionna refuses a material with the name of an object.
    for element in (*root.iter("bsdf"), *root.iter("ref")):
        if bare_name(element.get("id")) in names:
            element.set("id", f"mat-{bare_name(element.get('id'))}{_SHARED}")


def _is_radio(name: str, bsdf: ElementTree.Element) -> bool:
    """Whether Sionna or this package reads a material as one of radio."""
    bare = name.removeprefix("mat-")
    by_name = bare.startswith(("itu_", "itu-", "rfgen_")) and canonical_name(bare) in MATERIALS
    return bsdf.get("type") in _RADIO or by_name


def _file_of(path: Path, shape: ElementTree.Element) -> Path | None:
    """Mesh file of a shape of a scene file; None without one."""
    given = shape.find("string[@name='filename']")
    name = None if given is None else given.get("value")
    return None if not name or "$" in name else path.parent / name


def _to_world(shape: ElementTree.Element) -> FloatArray | None:
    """(4, 4) `to_world` of a shape; None with elements that are not read."""
    total = np.eye(4)
    for element in shape.findall("./transform[@name='to_world']/*"):
        step = _transform(element)
        if step is None:
            return None
        total = step @ total
    return total


def _transform(element: ElementTree.Element) -> FloatArray | None:
    """(4, 4) of one element of a transform; None if it is not read."""

    def numbers(text: str) -> list[float]:
        return [float(word) for word in text.replace(",", " ").split()]

    def axes(default: float) -> list[float]:
        if (value := element.get("value")) is not None:
            found = numbers(value)
            return found * 3 if len(found) == 1 else found
        return [float(element.get(axis, default)) for axis in "xyz"]

    step = np.eye(4)
    try:
        if element.tag == "translate":
            step[:3, 3] = axes(0.0)
        elif element.tag == "scale":
            step[:3, :3] = np.diag(axes(1.0))
        elif element.tag == "rotate":
            axis = np.array(axes(0.0))
            turn = math.radians(float(element.get("angle", 0.0)))
            step[:3, :3] = Rotation.from_rotvec(turn * axis / np.linalg.norm(axis)).as_matrix()
        elif element.tag == "matrix":
            values = numbers(element.get("value", ""))
            side = math.isqrt(len(values))
            step[:side, :side] = np.reshape(values, (side, side))
        else:
            return None
    except ValueError:
        return None
    return step
