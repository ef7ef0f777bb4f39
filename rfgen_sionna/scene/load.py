"""Loading of scenes by name, from a Mitsuba file, from a Sionna scene, or of free space."""

from __future__ import annotations

import importlib.util
import os
from difflib import get_close_matches
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from rfgen_sionna.resources import available, resolve
from rfgen_sionna.scene.permittivity import Outside
from rfgen_sionna.scene.scene import RadarScene
from rfgen_sionna.scene.scene_errors import SceneError


def load_scene(scene: Any = None, frequency: float | None = None, outside: Outside = "extrapolate") -> RadarScene:
    """Static surroundings of a simulation.

    Args:
        scene: name of a scene (`available_scenes()`), path of a Mitsuba XML file with Sionna's material conventions (a
            `.toml` file of the same name may give the free space of a room: `scenes/living_room/scene.toml`), a
            `sionna.rt.Scene` (its ITU materials are retuned in place), a `RadarScene` (returned unchanged), or None
            for free space.
        frequency: carrier frequency of the Sionna scene [Hz]; None leaves its own.
        outside: policy at frequencies that a material's source does not cover: "extrapolate" and "clamp" warn, "raise"
            is an error.

    Raises:
        SceneError: no such name or file, or the file is no scene.
        ValueError: the frequency is not positive.
        TypeError: `scene` is none of the above.
    """
    if frequency is not None and not (np.isfinite(frequency) and frequency > 0.0):
        raise ValueError(f"frequency: {frequency!r} given, a positive value [Hz] is needed")
    if scene is None:
        return RadarScene("free space", frequency=frequency, outside=outside)
    if isinstance(scene, RadarScene):
        return scene
    if isinstance(scene, (str, os.PathLike)):
        path = _find(scene)
        name = path.parent.name if path.name == "scene.xml" else path.stem
        return RadarScene(name, path, frequency=frequency, outside=outside)
    if type(scene).__name__ == "Scene" and hasattr(scene, "mi_scene") and hasattr(scene, "radio_materials"):
        return RadarScene("sionna scene", scene=scene, frequency=frequency, outside=outside)
    allowed = "a name, the path of a Mitsuba XML file, a sionna.rt.Scene or None"
    raise TypeError(f"scene: {type(scene).__name__} given, allowed are {allowed}")


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
    path = Path(text)
    if path.is_file():
        _check_description(path)
        return path.resolve()
    allowed = f"allowed are {', '.join(sorted(names))}, the path of a Mitsuba XML file, a sionna.rt.Scene or None"
    if path.suffix.lower() == ".xml" or isinstance(scene, os.PathLike) or os.sep in text:
        raise SceneError(f"scene file {text!r} does not exist; {allowed}")
    close = get_close_matches(text, names, n=1)
    raise SceneError(f"unknown scene {text!r}{f', did you mean {close[0]!r}?' if close else ''}; {allowed}")


def _check_description(path: Path) -> None:
    try:
        root = ElementTree.parse(path).getroot()
    except (ElementTree.ParseError, UnicodeDecodeError) as error:
        raise SceneError(f"scene file {str(path)!r} is no XML: {error}") from error
    if root.tag != "scene":
        raise SceneError(f"scene file {str(path)!r} is no Mitsuba scene: its root is <{root.tag}>, not <scene>")
