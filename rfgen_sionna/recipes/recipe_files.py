"""Files that a recipe names, and those that these name in turn: what its recordings are made from."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from rfgen_sionna.generative.motion_library import FOLDER
from rfgen_sionna.recipes.recipe_contents import RecipeContents
from rfgen_sionna.recipes.recipe_error import faults_of
from rfgen_sionna.recipes.recipe_places import scene_file
from rfgen_sionna.recipes.recipe_sources import source_tables
from rfgen_sionna.resources import available, resolve

_TEXTS = (".toml", ".json", ".xml", ".gltf")
"""Endings of files that may name others."""
_LARGEST_TEXT = 100_000_000
"""Size from which on a file is not searched for the names of others [bytes]."""
_QUOTED = re.compile(r'"([^"\n]{1,500})"|\'([^\'\n]{1,500})\'')


def file_digests(recipe: RecipeContents) -> dict[str, str]:
    """SHA-256 of each file of a recipe, by the key and the names that lead to it, without folders of this machine.

    These are the files and whole folders of sources, radars, boards, scenes and interferers, those of this package
    too, and what they name: patterns of antennas, configurations, meshes of scenes, and descriptions beside scenes.

    Raises:
        RecipeError: a file cannot be read.
    """
    found: dict[str, str] = {}
    for key, path in _named(recipe):
        with faults_of(key):
            files = sorted(each for each in path.rglob("*") if each.is_file()) if path.is_dir() else [path]
            for file in files:
                label = f"{key} {file.relative_to(path).as_posix()}" if path.is_dir() else key
                _add(found, label, file)
    return found


def _add(found: dict[str, str], label: str, file: Path, above: tuple[Path, ...] = ()) -> None:
    """Add the digest of a file and of those that it names."""
    with file.open("rb") as stored:
        found[label] = hashlib.file_digest(stored, "sha256").hexdigest()
    above = (*above, file.resolve())
    for name, other in _files_beside(file):
        if other.resolve() not in above:
            _add(found, f"{label} > {name}", other, above)


def _named(recipe: RecipeContents) -> Iterator[tuple[str, Path]]:
    """Path of a key, and the file or folder that it names."""
    for (key, _), source in zip(source_tables(recipe.tables), recipe.sources, strict=True):
        if source.spec.file is not None:
            path = Path(source.spec.file)
            yield key, path if path.is_absolute() else FOLDER
    for radar in recipe.radars:
        for key, name in (("radar", radar.radar), ("board", radar.board)):
            if name is not None:
                yield radar.path(key), _radar_file(name)
    for number, place in enumerate(recipe.places):
        if place.kind == "scene":
            scene = scene_file(place)
            yield f"places[{number}]", scene
            if (beside := scene.with_suffix(".toml")).is_file():
                yield f"places[{number}] {beside.suffix}", beside
    for number, receiver in enumerate(recipe.receivers.values):
        for text in _texts(receiver):
            if text in available("radars") or _is_file(Path(text)):
                yield f"receiver[{number}] {text}", _radar_file(text)


def _radar_file(name: str) -> Path:
    return resolve("radars", name) if name in available("radars") else Path(name)


def _files_beside(file: Path) -> Iterator[tuple[str, Path]]:
    """Files that a text names in quotes, relative to its folder, or by the ends of paths of another machine."""
    if file.suffix.lower() not in _TEXTS or file.stat().st_size > _LARGEST_TEXT:
        return
    text = file.read_text(encoding="utf-8", errors="replace")
    for name in dict.fromkeys(one or other for one, other in _QUOTED.findall(text)):
        for short in dict.fromkeys((name, re.split(r"[\\/]", name)[-1])):
            if short and _is_file(file.parent / short):
                yield short, file.parent / short
                break
    if file.name.lower().endswith(".mmwave.json"):  # its device is in the setup that names it
        for setup in sorted(file.parent.glob("*.setup.json")):
            if file.name.lower() in setup.read_text(encoding="utf-8", errors="replace").lower():
                yield setup.name, setup


def _is_file(path: Path) -> bool:
    try:
        return path.is_file()
    except (OSError, ValueError):
        return False


def _texts(value: Any) -> Iterator[str]:
    """All texts in a table."""
    if isinstance(value, str):
        yield value
    elif isinstance(value, dict):
        for each in value.values():
            yield from _texts(each)
    elif isinstance(value, (list, tuple)):
        for each in value:
            yield from _texts(each)
