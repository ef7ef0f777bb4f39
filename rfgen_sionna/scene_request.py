"""Request of a run: what its prompts and its arguments say about people and surroundings, read before any long work."""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from rfgen_sionna.generative.clip_person import Clip, read_clip_prompt
from rfgen_sionna.generative.decisions import argument
from rfgen_sionna.generative.environment_setup import ImageOptions, chosen_source
from rfgen_sionna.generative.motion_sources import motion_source
from rfgen_sionna.generative.prompts import CLIP, DEFAULT_DISTANCE, PromptError, ScenePrompt, check_seed
from rfgen_sionna.generative.prompts.environment_prompt import (
    NOWHERE,
    EnvironmentPrompt,
    in_words,
    parse_environment,
    split_source,
)
from rfgen_sionna.generative.prompts.prompt_reader import read_prompt, with_body_of
from rfgen_sionna.generative.prompts.thing_prompt import ThingPrompt
from rfgen_sionna.generative.radar_placement import place_before_radar
from rfgen_sionna.generative.several_actors import PromptedActors, actor_seed, read_prompts
from rfgen_sionna.radar import Radar
from rfgen_sionna.scene.checks.actors import OutsidePolicy
from rfgen_sionna.scene.mesh_actor import MeshActor
from rfgen_sionna.scene.scene_errors import PlacementError

_LOG = logging.getLogger(__name__)

NO_IMAGE = ImageOptions()
"""Options of surroundings that are no image."""


@dataclass(frozen=True)
class RunSeeds:
    """Seeds of the draws of a run."""

    body: int
    motion: int
    """Of the motion, and of what the prompt leaves open."""
    surroundings: int
    speckle: int
    """Of rough surfaces."""
    noise: int

    @classmethod
    def same(cls, seed: int) -> RunSeeds:
        """One seed for all."""
        return cls(seed, seed, seed, seed, seed)


@dataclass(frozen=True)
class PersonBody:
    """Body of one person of a prompt."""

    seed: int
    """Seed of all that words and traits leave open."""
    traits: Mapping[str, Any] = field(default_factory=dict)
    """Fields of :class:`~rfgen_sionna.generative.prompts.body_prompt.BodyPrompt` that replace the words."""


@dataclass(frozen=True)
class Placement:
    """Place of the people of a prompt that names none, before the radar; None leaves the default."""

    distance_m: float | None = None
    """Horizontal distance [m]."""
    azimuth_deg: float | None = None
    """Azimuth from the boresight, positive to the radar's left [degrees]; of several people that of their middle."""
    orientation_deg: float | None = None
    """Rotation from facing the radar, towards the person's left [degrees]."""

    def __post_init__(self) -> None:
        distance = self.distance_m
        if distance is not None and not (np.isfinite(distance) and distance > 0):
            raise ValueError(f"distance is {distance!r} m: a positive, finite distance is needed")


@dataclass(frozen=True)
class SceneRequest:
    """What a run shows: words that are read and checked, and actors, before any long work."""

    prompt: str
    negative: str
    read: PromptedActors | None
    """Contents of the prompt; None for a run without one."""
    surroundings: EnvironmentPrompt | None
    """None is free space."""
    source: str
    """Source of the surroundings, by :func:`~rfgen_sionna.generative.environment_setup.chosen_source`."""
    seeds: RunSeeds
    image_options: ImageOptions = NO_IMAGE
    motion: str = "auto"
    """Name of the source of motions."""
    clip: Clip | None = None
    """Clip of the prompt's person."""
    up: str | None = None
    """Up axis of the clip."""
    frame_rate: float | None = None
    """Frames of the clip a second [Hz]."""
    others: tuple[MeshActor, ...] = ()
    """Further actors with their places in the world."""

    @property
    def said(self) -> tuple[ScenePrompt, ...]:
        """Interpreted prompts of the actors."""
        return () if self.read is None else self.read.said


def read_request(
    prompts: Sequence[str],
    *,
    negative: str = "",
    environment: Any = None,
    seeds: RunSeeds,
    bodies: Sequence[PersonBody] = (),
    placement: Placement = Placement(),
    motion: str = "auto",
    clip: Clip | None = None,
    up: str | None = None,
    frame_rate: float | None = None,
    others: tuple[MeshActor, ...] = (),
    image_options: ImageOptions = NO_IMAGE,
) -> SceneRequest:
    """Read the prompts and the arguments of a run; words without effect are logged.

    `environment` is that of :func:`~rfgen_sionna.pipeline.generate`. People of several prompts stand apart; no prompt
    is one about nobody. `bodies` are those of the people, in order; without any, the seed of the bodies draws them.

    Raises
    ------
    ValueError, TypeError
        Naming the argument, its value and the allowed values.
    """
    for seed in (seeds.motion, seeds.body, seeds.surroundings, seeds.speckle, seeds.noise):
        check_seed(seed)
    origin, place_words = split_source(environment)
    read: PromptedActors | None = None
    if not prompts:
        asked = None if place_words is None else parse_environment(place_words)
    else:
        if clip is None:
            motion_source(motion)
            read = _with_bodies(_joined(prompts, negative, seeds.motion), bodies)
        else:
            read = PromptedActors((read_clip_prompt(prompts[0], negative, seeds.motion, clip),), "apart")
        read, asked = _with_arguments(read, place_words, placement, origin)
    source = chosen_source(origin, asked, image_options)
    for sentence in asked.warnings(imagined=source == "diffusion") if asked else ():
        _LOG.warning(sentence)
    text = "; ".join(prompts)
    return SceneRequest(
        text, negative, read, asked, source, seeds, image_options, motion, clip, up, frame_rate, others
    )  # fmt: skip


def _joined(prompts: Sequence[str], negative: str, seed: int) -> PromptedActors:
    """Contents of one prompt, or of several whose people stand apart."""
    if len(prompts) == 1:
        return read_prompts(prompts[0], negative, seed=seed)
    found: list[ScenePrompt] = []
    for prompt in prompts:
        read = read_prompts(prompt, negative, seed=actor_seed(seed, len(found)))
        if read.relation != "apart":
            raise PromptError(
                f"prompt: {prompt!r} is about actors who are {read.relation}, beside another prompt: give it alone"
            )
        found += read.said
    return PromptedActors(tuple(found), "apart")


def _with_bodies(read: PromptedActors, bodies: Sequence[PersonBody]) -> PromptedActors:
    """Contents of the prompt with the given bodies of its people."""
    if not bodies:
        return read
    said, seeds, left = [], [], iter(bodies)
    for index, each in enumerate(read.said):
        body = None if isinstance(each, ThingPrompt) else next(left, None)
        if body is None and not isinstance(each, ThingPrompt):
            raise ValueError(f"bodies are {len(bodies)}, fewer than the people of the prompt: one for each is needed")
        said.append(each if body is None else with_person_body(each, body))
        seeds.append(actor_seed(each.seed, index) if body is None else body.seed)
    return replace(read, said=tuple(said), body_seeds=tuple(seeds))


def with_person_body(said: ScenePrompt, body: PersonBody) -> ScenePrompt:
    """An interpreted prompt about a person whose body has a seed and traits of its own."""
    if not said.action.startswith(CLIP):
        said = with_body_of(said, read_prompt(said.text, said.negative, seed=body.seed))
    given = {name.split("_")[0]: argument("bodies") for name in body.traits}
    words = replace(said.body, **body.traits, drawn=said.body.drawn - set(given))
    return replace(said, body=words, origins={**said.origins, **given})


def with_placement(said: ScenePrompt, placement: Placement) -> ScenePrompt:
    """An interpreted prompt about one actor, whose words go before the arguments."""
    for name, key in (("distance_m", "distance"), ("orientation_deg", "orientation"), ("azimuth_deg", "azimuth")):
        value, own = getattr(placement, name), name.replace("azimuth", "bearing")
        if value is not None and getattr(said, own) is None:
            changes: dict[str, Any] = {own: float(value), "origins": {**said.origins, key: argument(key)}}
            said = replace(said, **changes)
    return said


def _with_arguments(
    read: PromptedActors, environment: Any, placement: Placement, source: str
) -> tuple[PromptedActors, EnvironmentPrompt | None]:
    """Contents of the prompt and of the arguments, and the surroundings of either."""
    named = in_words(read.surroundings) if read.surroundings else None
    surroundings = named if environment is None else parse_environment(environment)
    place, by_argument = read.surroundings, environment is not None or source == "none"
    if environment is not None:
        place = NOWHERE if surroundings is None else surroundings.scene
        if read.surroundings not in (None, place):
            raise PromptError(f"environment: {environment!r}, but the prompt says {read.surroundings}: leave one out")
    elif source == "none":
        place = NOWHERE
    if placement.orientation_deg is not None and read.relation == "facing":
        raise PromptError("orientation: the actors face each other; leave out the other direction")
    if len(read.said) > 1 and placement.azimuth_deg is not None:  # of their middle
        read, placement = replace(read, azimuth_deg=placement.azimuth_deg), replace(placement, azimuth_deg=None)
    said = []
    for each in read.said:
        each = with_placement(each, placement)
        if by_argument:
            origins = {**each.origins, "surroundings": argument("environment")}
            each = replace(each, surroundings=place, origins=origins)
        said.append(each)
        for sentence in each.warnings:
            _LOG.warning(sentence)
    return replace(read, said=tuple(said)), surroundings


def check_distances(request: SceneRequest, radar: Radar, outside: OutsidePolicy) -> None:
    """PlacementError if the prompt places somebody beyond the range window of the radar; ValueError if that looks
    straight up or down."""
    for said in request.said if outside == "error" else ():
        away = DEFAULT_DISTANCE if said.distance_m is None else said.distance_m
        if away > radar.max_range:
            raise PlacementError(
                f"distance is {away:g} m; the range window of radar '{radar.name}' (preset '{radar.preset}') ends at "
                f"{radar.max_range:.2f} m: choose a smaller one, or a preset with a lower slope or a higher sample rate"
            )
    if request.read is not None:
        spot_of(request.read, radar)


def spot_of(read: PromptedActors, radar: Radar) -> tuple[float, float]:
    """Place (x, y) of the people of a prompt [m]."""
    return place_before_radar(radar, read.distance_m, read.said[0].bearing_deg or read.azimuth_deg)[0]
