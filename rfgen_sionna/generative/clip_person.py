"""People of a prompt who move as a clip does: the prompt has body, place and surroundings, the clip the motion."""

from __future__ import annotations

import logging
from dataclasses import asdict, replace
from os import PathLike, sep
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from rfgen_sionna.generative.actor import Actor
from rfgen_sionna.generative.bodies import Phenotype, describe
from rfgen_sionna.generative.decisions import Decision, argument
from rfgen_sionna.generative.manner import Manner
from rfgen_sionna.generative.motion_sources import SOURCES
from rfgen_sionna.generative.person_decisions import prompt_decisions, vital_signs_of
from rfgen_sionna.generative.prompts.person_prompt import read_person
from rfgen_sionna.generative.prompts.prompt_error import PromptError
from rfgen_sionna.generative.prompts.scene_prompt import DEFAULT_DISTANCE, ScenePrompt
from rfgen_sionna.generative.radar_placement import place_before_radar
from rfgen_sionna.records import Motion

if TYPE_CHECKING:
    from rfgen_sionna.radar import Radar

_LOG = logging.getLogger(__name__)

Clip = Motion | Path
"""A motion, or the file or folder of one."""


def chosen_clip(motion: Any, up: str | None = None, frame_rate: float | None = None) -> Clip | None:
    """Clip of an argument `motion`; None for the name of a motion source.

    A text with an ending or a separator, or of an existing file, is a path.

    Raises
    ------
    FileNotFoundError
        If there is no file or folder at the path.
    TypeError
        If `motion` is neither a text, a path nor a motion.
    ValueError
        If `up` or `frame_rate` comes without a clip in a file.
    """
    if not isinstance(motion, (str, PathLike, Motion)):
        raise TypeError(f"motion is {motion!r}: {', '.join(map(repr, SOURCES))}, the path of a clip or a Motion needed")
    clip: Clip | None = None
    if isinstance(motion, Motion):
        clip = motion
    elif not isinstance(motion, str) or _is_path(motion):
        clip = Path(motion)
        if not clip.exists():
            raise FileNotFoundError(f"motion: there is no file or folder '{clip}'")
    for name, value in (("up", up), ("frame_rate", frame_rate)):
        if value is not None and not isinstance(clip, Path):
            raise ValueError(f"{name} is {value!r}, which belongs to a clip in a file, but motion is {_name(motion)}")
    return clip


def _is_path(text: str) -> bool:
    return text not in SOURCES and (bool(Path(text).suffix) or sep in text or "/" in text or Path(text).exists())


def _name(motion: Any) -> str:
    return "a Motion" if isinstance(motion, Motion) else repr(motion)


def clip_name(clip: Clip) -> str:
    """Name of a clip in labels and files."""
    return (clip.action or "motion") if isinstance(clip, Motion) else (clip.stem or clip.name)


def read_clip_prompt(prompt: str, negative: str, seed: int, clip: Clip) -> ScenePrompt:
    """Interpret a prompt whose person moves as `clip` does; actions of the prompt have no effect, with a warning.

    Raises
    ------
    PromptError
        As :func:`~rfgen_sionna.generative.prompts.person_prompt.read_person`, and for a manner: a clip has its own.
    """
    name = clip_name(clip)
    said = read_person(prompt, negative, seed=seed, clip=name)
    if said.manner != Manner():
        given = [field for field, value in asdict(said.manner).items() if value not in (None, False)]
        raise PromptError(f"{given[0]}: the prompt gives it, but the clip '{name}' has its own: leave the words out")
    return said


def person_with_clip(
    said: ScenePrompt,
    clip: Clip,
    *,
    seed: int,
    radar: Radar,
    floor: float,
    up: str | None = None,
    frame_rate: float | None = None,
) -> Actor:
    """Person of a prompt (:func:`read_clip_prompt`) with the motion of `clip`; its origin is at the prompt's distance.

    Raises
    ------
    PromptError
        If the prompt describes a body, and the clip is a mesh with its own.
    ValueError, OSError
        As :meth:`~rfgen_sionna.generative.actor.Actor.from_motion`.
    """
    words = said.body
    described = Phenotype(words.gender, words.age_years, words.height_m, words.weight_kg, words.muscle)
    distance = DEFAULT_DISTANCE if said.distance_m is None else said.distance_m
    place, yaw = place_before_radar(radar, distance, said.bearing_deg or 0.0)
    options: dict[str, Any] = {
        "seed": seed,
        "position": (*place, floor),
        "orientation": (yaw + float(np.radians(said.orientation_deg or 0.0)), 0.0, 0.0),
    }
    options |= {name: value for name, value in (("up", up), ("frame_rate", frame_rate)) if value is not None}
    try:
        person = Actor.from_motion(clip, body=None if described == Phenotype() else described, **options)
    except ValueError as error:
        if described == Phenotype() or not str(error).startswith("body:"):
            raise
        size = [name for name in ("height", "weight", "muscle") if words.traits()[name] is not None]
        if size:
            raise PromptError(
                f"prompt: {said.text!r} gives the person's {' and '.join(size)}, but the clip '{clip_name(clip)}' is a "
                "body of its own: leave the words out"
            ) from error
        _LOG.warning("prompt: gender and age have no effect: the clip '%s' is a body of its own", clip_name(clip))
        person = Actor.from_motion(clip, **options)
    if person.body is None:
        decisions = [each for each in said.decisions() if each.name not in words.traits()]  # the mesh has its own
    else:
        decisions = prompt_decisions(
            said, seed, describe(person.body), dict.fromkeys(("position", "orientation", "body"))
        )
    origin = Decision("motion", str(clip) if isinstance(clip, Path) else clip_name(clip), argument("motion"))
    decisions = [each for each in decisions if each.name != "speed"]
    signs = vital_signs_of(said, seed)
    if signs is not None:
        person = person.with_vital_signs(signs)
    return replace(person, prompt=said, decisions=(*decisions, origin))
