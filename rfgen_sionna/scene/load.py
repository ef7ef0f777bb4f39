"""Loading of scenes by name, from a Mitsuba or mesh file, from a Sionna scene, or of free space."""

from __future__ import annotations

import importlib.util
import os
import re
from collections.abc import Mapping
from difflib import get_close_matches
from pathlib import Path
from typing import Any

import numpy as np

from rfgen_sionna.resources import available, resolve
from rfgen_sionna.scene.array_scene import MeshScene
from rfgen_sionna.scene.materials import Material
from rfgen_sionna.scene.mesh_files import MESH_SUFFIXES
from rfgen_sionna.scene.mitsuba_file import scene_materials
from rfgen_sionna.scene.permittivity import Outside
from rfgen_sionna.scene.scene import RadarScene, read_description
from rfgen_sionna.scene.scene_errors import SceneError, SceneFileNotFoundError

SCENE_SUFFIXES = (".xml", *MESH_SUFFIXES)
"""Endings of the files that :func:`load_scene` takes."""
_FILE_ENDING = re.compile(
    r"\.(?:xml|obj|glb|gltf|ply|stl|off|blend\d?|fbx|dae|usd[acz]?|3ds|max|skp|step|stp|ifc|zip)$", re.I
)
"""Endings of scene files, also of those that are not taken."""


def load_scene(
    scene: Any = None,
    frequency: float | None = None,
    outside: Outside = "extrapolate",
    *,
    materials: Mapping[str, str | Material] | None = None,
    default_material: str | Material | None = None,
    up: str | None = None,
    scale: float | None = None,
) -> RadarScene:
    """Static surroundings of a simulation.

    Args:
        scene: name of a scene (`available_scenes()`), path of a Mitsuba XML file with Sionna's material conventions or
            of a mesh file (OBJ, glTF, PLY, STL, OFF), a `sionna.rt.Scene` (its ITU materials are retuned in place), a
            `RadarScene` (returned unchanged), or None for free space. A `.toml` file of the same name as a scene file
            may give the free space of a room (`scenes/living_room/scene.toml`), and the arguments below: a table
            `[materials]`, `default_material`, `up`, `scale`.
        frequency: carrier frequency of the Sionna scene [Hz]; None leaves its own.
        outside: policy at frequencies that a material's source does not cover: "extrapolate" and "clamp" warn, "raise"
            is an error.
        materials: materials by their names in the file, or by names of its objects: `{"Mat.001": "concrete"}`. Names
            that are materials ("glass", "mat-itu_concrete", "Wood.002") need none.
        default_material: material of the parts of a file without a known one; None refuses them, with their names.
        up: up axis of a mesh file, "x", "y", "z", "-x", "-y" or "-z"; None is "y" for glTF, whose x stays, as for
            exports of Blender, and "z" for others.
        scale: metres per unit of a mesh file, 0.001 for millimetres; None takes its unit, else metres.

    Raises:
        SceneError: no such name, or the file is no scene; :class:`SceneFileNotFoundError`, also a FileNotFoundError, if
            there is no such file.
        MeshError: the mesh file cannot be read.
        MaterialError: parts of the file have no known material.
        ValueError: the frequency or `scale` is not positive, `up` is no axis, or an argument has no effect.
        TypeError: `scene` is none of the above.
    """
    if frequency is not None and not (np.isfinite(frequency) and frequency > 0.0):
        raise ValueError(f"frequency: {frequency!r} given, a positive value [Hz] is needed")
    of_file: dict[str, Any] = {"materials": materials, "default_material": default_material, "up": up, "scale": scale}
    path = _find(scene) if isinstance(scene, (str, os.PathLike)) else None
    if path is not None:
        beside = read_description(path.with_suffix(".toml"))
        of_file = {name: beside.get(name) if given is None else given for name, given in of_file.items()}
    if path is not None and path.suffix.lower() in MESH_SUFFIXES:
        return MeshScene(path, frequency=frequency, outside=outside, **of_file)
    without = ("materials", "default_material", "up", "scale") if path is None else ("up", "scale")
    if idle := [name for name in without if of_file[name] is not None]:
        kind = "files take it" if path is None else "mesh files take it, a Mitsuba scene is in metres with z up"
        raise ValueError(f"{', '.join(idle)}: only scenes of {kind}; leave it out")
    if path is not None:
        name = path.parent.name if path.name == "scene.xml" else path.stem
        chosen = scene_materials(path, of_file["materials"] or {}, of_file["default_material"], outside)
        return RadarScene(name, path, frequency=frequency, outside=outside, materials=chosen)
    if scene is None:
        return RadarScene("free space", frequency=frequency, outside=outside)
    if isinstance(scene, RadarScene):
        return scene
    if is_scene(scene):
        return RadarScene("sionna scene", scene=scene, frequency=frequency, outside=outside)
    allowed = "a name, the path of a Mitsuba XML or mesh file, a sionna.rt.Scene or None"
    raise TypeError(f"scene: {type(scene).__name__} given, allowed are {allowed}")


def is_scene(scene: Any) -> bool:
    """Whether `scene` is a scene object of this package or of Sionna."""
    of_sionna = type(scene).__name__ == "Scene" and hasattr(scene, "mi_scene") and hasattr(scene, "radio_materials")
    return isinstance(scene, RadarScene) or of_sionna


def is_path(scene: Any) -> bool:
    """Whether `scene` is a path, or a text that is one: with the ending of a file, or separators and no spaces."""
    if isinstance(scene, os.PathLike):
        return True
    if not isinstance(scene, str):
        return False
    text = scene.strip()
    if text.startswith(("/", "./", "../", "~", ".\\", "..\\")) or re.match(r"[A-Za-z]:[\\/]", text):
        return True
    return bool(_FILE_ENDING.search(text)) or (("/" in text or "\\" in text) and not re.search(r"\s", text))


def check_scene_file(path: str | os.PathLike[str]) -> None:
    """Raise :class:`SceneFileNotFoundError` if there is no such file, or :class:`SceneError` if it is a folder."""
    place = Path(path).expanduser()
    if place.is_dir():
        raise SceneError(f"scene file {os.fspath(path)!r} is a folder: give the path of a file in it{_files_in(place)}")
    if not place.is_file():
        raise SceneFileNotFoundError(f"scene file {os.fspath(path)!r} does not exist; {_allowed()}")


def _allowed() -> str:
    files = f"the path of a file ({', '.join(SCENE_SUFFIXES)})"
    return f"allowed are {', '.join(sorted(available_scenes()))}, {files}, a sionna.rt.Scene or None"


def _files_in(folder: Path) -> str:
    found = sorted(path.name for path in folder.iterdir() if path.suffix.lower() in SCENE_SUFFIXES)
    return f": {', '.join(found)}" if found else ""


def available_scenes() -> dict[str, Path]:
    """Names and files of the scenes of this package and of Sionna."""
    scenes = {}
    package = importlib.util.find_spec("sionna")
    for place in (package.submodule_search_locations or []) if package else []:
        for folder in sorted((Path(place) / "rt" / "scenes").glob("*/")):
            file = folder / f"{folder.name}.xml"
            if file.is_file():
                scenes[folder.name] = file
    scenes.update({name: resolve("scenes", name) for name in available("scenes")})
    return scenes


def _find(scene: str | os.PathLike[str]) -> Path:
    text = os.fspath(scene)
    names = available_scenes()
    if text in names:
        return names[text]
    path = Path(text).expanduser()
    if path.exists() or is_path(scene):
        check_scene_file(path)
        if path.suffix.lower() not in SCENE_SUFFIXES:
            raise SceneError(
                f"scene file {text!r}: files with the ending {path.suffix!r} are not read, allowed are "
                f"{', '.join(SCENE_SUFFIXES)}; export it as glTF (.glb) or OBJ, with a material for each part"
            )
        return path.resolve()
    close = get_close_matches(text, names, n=1)
    raise SceneError(f"unknown scene {text!r}{f', did you mean {close[0]!r}?' if close else ''}; {_allowed()}")
