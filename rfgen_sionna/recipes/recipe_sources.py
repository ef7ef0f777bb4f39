"""Sources in a recipe: prompts as the package reads them, and files that are there and can be read."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

from rfgen_sionna.generative.actor import Actor
from rfgen_sionna.generative.clip_choice import library
from rfgen_sionna.generative.clip_person import Clip, read_clip_prompt
from rfgen_sionna.generative.motion.importers import MOTION_SUFFIXES, load_any_motion
from rfgen_sionna.generative.motion.joint_recording import record_joints
from rfgen_sionna.generative.motion_library import LibraryClip
from rfgen_sionna.generative.motion_sources import check_source, motion_source
from rfgen_sionna.generative.prompts import ScenePrompt
from rfgen_sionna.generative.prompts.thing_prompt import ThingPrompt
from rfgen_sionna.generative.several_actors import read_prompts
from rfgen_sionna.recipes.recipe_tables import SOURCE_OPTIONS, RecipeTables, SourceTable
from rfgen_sionna.recipes.recording_spec import SourceSpec
from rfgen_sionna.scene.mesh_actor import MeshActor
from rfgen_sionna.scene.scene_errors import MaterialError

_PLACE_KEYS = {"distance_m": "distance_m", "azimuth_deg": "bearing_deg", "orientation_deg": "orientation_deg"}
MAX_FILE = 4_000_000_000
"""Largest file of a source [bytes]."""
READINGS = 4
"""Seeds with which a prompt is read: its ranges and open choices are drawn."""
USUAL_SPEEDS = {"run": 2.5, "run_backwards": 1.5, "crawl": 0.4, "sneak": 0.6}
"""Action -> usual speed over the floor [m/s]; others that lead straight over the floor go at `WALKING_SPEED`."""
WALKING_SPEED = 1.2
"""Usual speed of a walk [m/s]."""


@dataclass(frozen=True)
class Source:
    """One alternative of what moves in a recording."""

    spec: SourceSpec
    actions: tuple[str, ...]
    """Action of each actor; of files without one their names."""
    people: int
    """Number of people, who have bodies."""
    surroundings: str | None = None
    """Place that the prompt names."""
    distances_m: tuple[float, ...] = ()
    """Distances that the prompt gives, of several readings [m]."""
    traits: frozenset[str] = frozenset()
    """Attributes of bodies that the words give: "gender", "age", "height", "weight", "muscle"."""
    speed_m_s: float = 0.0
    """Speed of a straight way over the floor [m/s]; 0 where there is none."""

    things: tuple[str, ...] = ()
    """Kinds of the animals and things."""
    own_place: Mapping[str, float | None] = field(default_factory=dict)
    """What the words say of the place of every actor, by the key of the recipe; None where the seed decides."""
    open_actions: frozenset[str] = frozenset()
    """All actions that the words leave to the seed."""


def source_tables(tables: RecipeTables) -> list[tuple[str, SourceTable]]:
    """Path of the key and table of each source of a recipe."""
    if tables.sources is not None:
        return [(f"sources[{number}]", table) for number, table in enumerate(tables.sources)]
    if tables.prompts is None:
        return []
    form = tables.prompts
    key = {"scalar": "prompts", "choice": "prompts[{}]", "grid": "prompts.grid[{}]"}[form.kind]
    return [(key.format(number), SourceTable(prompt=text)) for number, text in enumerate(form.values)]


def read_source(table: SourceTable, located: Callable[[str], Path], motion: str, duration: float) -> Source:
    """The source of a table; files are only located, :func:`check_source_file` reads them.

    Args:
        table: the table.
        located: function that gives the absolute path of a file.
        motion: source of the motion of prompts.
        duration: longest recording [s].

    Raises:
        ValueError, ImportError: a prompt cannot be carried out.
    """
    kind: Any = next(name for name in SOURCE_OPTIONS if getattr(table, name) is not None)
    if kind == "prompt":
        return _prompt(str(table.prompt), motion, duration)
    shipped = kind == "clip" and table.clip in library_clips()
    path = Path(str(table.clip)) if shipped else located(getattr(table, kind))
    options = {
        name: getattr(table, name)
        for name in SOURCE_OPTIONS[kind]
        if name != "words" and getattr(table, name) is not None
    }
    if shipped:
        options = {"action": library_clips()[str(table.clip)].action} | options
        if idle := {"up", "frame_rate"} & options.keys():
            raise ValueError(f"{min(idle)} belongs to a file, and '{path}' is a shipped clip: leave it out")
    elif kind == "mesh":
        options = {"action": path.stem} | options
    spec, name = SourceSpec(kind, table.words, str(path), options), options.get("action", path.stem)
    if kind == "clip":
        said = [read_clip_prompt(table.words, "", seed, path) for seed in range(READINGS)]
        _check_unused(said[0])
        place = said[0].surroundings
        return Source(
            spec, (name,), 1, place, _distances(said), _traits(said[0]), own_place=_own_place(said),
            open_actions=frozenset((name,)),
        )  # fmt: skip
    own = dict.fromkeys(_PLACE_KEYS) if table.position_m is not None else {}
    people = 1 if kind == "joints" else 0
    return Source(spec, (name,), people, own_place=own, open_actions=frozenset((name,)))


@cache
def library_clips() -> Mapping[str, LibraryClip]:
    """Shipped clips by their names."""
    return {clip.name: clip for clip in library()}


def clip_of(source: SourceSpec) -> Clip:
    """Motion or file of a clip."""
    path = Path(source.file or "")
    return path if path.is_absolute() else library().motion(path.name)


def _prompt(text: str, motion: str, duration: float) -> Source:
    readings = [read_prompts(text, seed=seed) for seed in range(READINGS)]
    first = readings[0]
    for said in first.said:
        _check_unused(said)
        if not isinstance(said, ThingPrompt):
            check_source(said, duration, motion_source(motion))
    people = [said for said in first.said if not isinstance(said, ThingPrompt)]
    return Source(
        SourceSpec("prompt", text),
        tuple(said.action if said.target == "person" else f"{said.target}: {said.action}" for said in first.said),
        len(people),
        first.surroundings,
        _distances([said for reading in readings for said in reading.said]),
        frozenset().union(*map(_traits, people)),
        max(map(_speed, people), default=0.0),
        tuple(said.target for said in first.said if isinstance(said, ThingPrompt)),
        _own_place([said for reading in readings for said in reading.said]),
        frozenset(action for said in first.said for action in (*said.choices, said.action)),
    )


def _check_unused(said: ScenePrompt) -> None:
    for warning in said.warnings:
        cure = "; leave it out" if "has no effect" in warning else ""
        raise ValueError(f"{warning.removeprefix('prompt: ')}{cure}")


def _distances(readings: list[ScenePrompt]) -> tuple[float, ...]:
    return tuple(sorted({said.distance_m for said in readings if said.distance_m is not None}))


def _own_place(readings: Sequence[ScenePrompt]) -> dict[str, float | None]:
    """Keys of the place that all readings give, with their value; None if it is not always the same."""
    found: dict[str, float | None] = {}
    for key, name in _PLACE_KEYS.items():
        values = {getattr(said, name) for said in readings}
        if None not in values:
            found[key] = values.pop() if len(values) == 1 else None
    return found


def _traits(said: ScenePrompt) -> frozenset[str]:
    return frozenset(name for name, value in said.body.traits().items() if value is not None)


def _speed(said: ScenePrompt) -> float:
    straight = said.action in ("walk_straight", "walk_backwards", "sidestep", *USUAL_SPEEDS)
    if not (straight and said.manner.path in (None, "straight")) or said.manner.pauses:
        return 0.0
    usual = USUAL_SPEEDS.get(said.action, WALKING_SPEED) * (said.speed or 1.0)
    return usual if said.speed_mps is None else said.speed_mps


def changes_freely(source: Source) -> str:
    """Animal, thing or file of a source whose mesh no parameters rebuild; empty if there is none."""
    path = Path(source.spec.file or "")
    if source.spec.kind == "clip" and path.is_absolute() and path.suffix.lower() not in MOTION_SUFFIXES:
        return path.name
    return next((kind for kind in source.things if not getattr(Actor.thing(kind).sequence, "is_rigid", True)), "")


def check_source_file(source: Source) -> None:
    """Read the file of a source, once before all recordings.

    Raises:
        ValueError, OSError: it is missing, too large, or cannot be read.
    """
    spec = source.spec
    path, options = Path(spec.file or ""), dict(spec.options)
    if not path.is_absolute():
        return
    if spec.kind == "clip" and not path.exists():
        raise ValueError(f"there is no file '{path}', and no shipped clip '{path.name}' (`rfgen motions`)")
    check_file(path, folders=spec.kind == "clip")
    if spec.kind == "joints":
        options.pop("action", None)
        layout: dict[str, Any] = {"layout": None, "up": None, "scale": 1.0, "frame_rate": None} | options
        record_joints(path, **layout)
    elif spec.kind == "mesh":
        try:
            MeshActor.from_mesh(path, material=options.get("material", ""))
        except MaterialError as error:
            raise ValueError(_material_fault(path, options.get("material"), str(error))) from error
    elif path.suffix.lower() in MOTION_SUFFIXES:
        load_any_motion(path, up=options.get("up"), frame_rate=options.get("frame_rate"), index=0, action=path.stem)
    else:
        Actor.from_motion(path, up=options.get("up"), frame_rate=options.get("frame_rate"))


def _material_fault(path: Path, given: str | None, said: str) -> str:
    if given is not None:
        return said
    return (
        f"material is missing: the parts of '{path.name}' name no known one; give one for all of it, "
        'such as material = "metal", "wood" or "glass"'
    )


def check_file(path: Path, folders: bool = False) -> None:
    """ValueError if a file is not there, is no regular file (or folder, with `folders`), or too large."""
    if folders and path.is_dir():
        return
    if not path.is_file():
        raise ValueError(f"there is no file '{path}'")
    if path.stat().st_size > MAX_FILE:
        raise ValueError(f"'{path}' has {path.stat().st_size / 1e9:.1f} GB; allowed are {MAX_FILE / 1e9:g} GB")
