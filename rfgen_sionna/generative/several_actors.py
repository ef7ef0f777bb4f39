"""Actors of a prompt about several: each with its own seed, motion and labels, placed without going through another."""

from __future__ import annotations

import logging
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from scipy.spatial import cKDTree

from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.actor import DEFAULT_DURATION, Actor
from rfgen_sionna.generative.decisions import Decision, tabulate
from rfgen_sionna.generative.person_decisions import triple_decision
from rfgen_sionna.generative.prompts.actor_clauses import split_actors
from rfgen_sionna.generative.prompts.prompt_error import PromptError
from rfgen_sionna.generative.prompts.prompt_reader import read_prompt
from rfgen_sionna.generative.prompts.scene_prompt import DECIDED, DEFAULT_DISTANCE, ScenePrompt
from rfgen_sionna.generative.prompts.thing_prompt import ThingPrompt
from rfgen_sionna.generative.radar_placement import place_before_radar

if TYPE_CHECKING:
    from rfgen_sionna.radar import Radar

_LOG = logging.getLogger(__name__)

AMONG = "its place among the actors"
"""Origin of the place of one of several actors."""
CLEARANCE = 0.02
"""Least distance between the surfaces of two actors [m]."""
CHECK_RATE = 10.0
"""Checks of that distance a second [Hz]."""
_EVERY = 3
"""One vertex of so many is checked."""
_WIDER = 5
"""Further spacings that are tried."""
_STATIC = 0.15
"""Mean speed over the floor below which an actor stays in place [m/s]."""


@dataclass(frozen=True)
class PromptedActors:
    """Interpreted prompts of several actors, and their places to each other."""

    said: tuple[ScenePrompt, ...]
    relation: str
    """One of :data:`~rfgen_sionna.generative.prompts.actor_clauses.RELATIONS`."""
    azimuth_deg: float = 0.0
    """Azimuth of the middle of several actors whose prompts name none, positive to the radar's left [degrees]."""
    body_seeds: tuple[int, ...] = ()
    """Seed of each actor's body; without any, those of the motions."""

    @property
    def distance_m(self) -> float:
        """Distance of the actors' middle from the radar over the floor [m]."""
        given = [each.distance_m for each in self.said if each.distance_m is not None]
        return given[0] if given else DEFAULT_DISTANCE

    @property
    def surroundings(self) -> str | None:
        """Surroundings that the prompts name."""
        return next((each.surroundings for each in self.said if each.surroundings), None)


def actor_seed(seed: int, index: int) -> int:
    """Seed of the actor number `index` of a prompt: the prompt's own for the first one."""
    return seed if index == 0 else int(np.random.SeedSequence([seed, 77, index]).generate_state(1)[0])


def read_prompts(prompt: str, negative: str = "", *, seed: int = 0) -> PromptedActors:
    """Interpret a prompt about one or several actors.

    Args:
        prompt: "a woman walks past a man who sits", "two people shake hands", "a person and a dog", "a dog runs".
        negative: negative prompt, of people.
        seed: seed of open choices; each actor has its own, derived from it.

    Raises:
        PromptError: an actor's sentence cannot be carried out, or the sentences contradict each other.
    """
    several = split_actors(prompt) if isinstance(prompt, str) else None
    if several is None:
        return PromptedActors((read_prompt(prompt, negative, seed=seed),), "apart")
    said = []
    for index, clause in enumerate(several.clauses):
        unwanted = negative if clause.thing is None else ""
        said.append(read_prompt(clause.text, unwanted, seed=actor_seed(seed, index)))
    places = {each.surroundings for each in said if each.surroundings}
    if len(places) > 1:
        raise PromptError(f"surroundings: the prompt names several: {', '.join(sorted(places))}")
    if several.relation != "apart":
        for name, values in (
            ("distance", {each.distance_m for each in said}),
            ("azimuth", {each.bearing_deg for each in said}),
        ):
            if len(values - {None}) > 1:
                raise PromptError(
                    f"{name}: the prompt names several for actors whose places depend on each other "
                    f"({several.relation}); name one, or join two sentences with 'and'"
                )
    if several.relation == "facing" and any(each.orientation_deg is not None for each in said):
        raise PromptError("orientation: the actors face each other; leave out the other direction")
    if several.relation not in ("apart", "facing", "beside"):
        said = [_straight(each) for each in said]
    return PromptedActors(tuple(said), several.relation)


def _straight(said: ScenePrompt) -> ScenePrompt:
    """The prompt with a walk or run on a line, where places of actors to each other need one."""
    if isinstance(said, ThingPrompt) or said.manner.path is not None:
        return said
    if said.action == "run":
        return replace(said, manner=replace(said.manner, path="straight"))
    return said if said.action != "walk" else replace(said, action="walk_straight")


def actors_from_prompt(
    prompt: str | PromptedActors,
    *,
    negative: str = "",
    seed: int = 0,
    duration: float = DEFAULT_DURATION,
    radar: Radar | None = None,
    floor: float = 0.0,
    motion: str = "auto",
    material: str = "skin",
) -> tuple[Actor, ...]:
    """Actors of a prompt about one or several people, animals and things.

    Args:
        prompt: a sentence, or interpreted prompts, whose warnings are then not logged again.
        negative, seed, duration, radar, floor, motion, material: as for
            :meth:`~rfgen_sionna.generative.actor.Actor.from_prompt`; the material is that of people.

    Raises:
        PromptError: the prompt cannot be carried out, or the actors find no place without going through one another.
    """
    if isinstance(prompt, PromptedActors):
        read = prompt
    else:
        read = read_prompts(prompt, negative, seed=seed)
        for sentence in (warning for each in read.said for warning in each.warnings):
            _LOG.warning(sentence)
    common: dict[str, Any] = {"radar": radar, "floor": floor, "duration": duration, "motion": motion}
    names, seeds = _names(read.said), [actor_seed(seed, index) for index in range(len(read.said))]
    own: list[dict[str, Any]] = [
        {"seed": one, "body_seed": body} for one, body in zip(seeds, read.body_seeds or seeds, strict=True)
    ]
    if len(read.said) == 1:
        only = read.said[0]
        return (Actor.from_prompt(only, material=material, name=names[0], **own[0], **common),)
    made: list[Actor] = []
    for index, said in enumerate(_paced(read, None)):
        if made and read.relation in ("side by side", "pushing", "behind", "in front"):
            said = _paced(read, _speed(made[0], duration))[index]
        if isinstance(said, ThingPrompt):
            made.append(Actor.from_prompt(said, name=names[index], **own[index], **common))
            continue
        made.append(
            Actor.from_prompt(
                said, name=names[index], position=(0.0, 0.0, floor), orientation=(0.0, 0.0, 0.0),
                material=material, **own[index], **common,
            )
        )  # fmt: skip
    rng = np.random.default_rng([seed, 78])
    side = float(rng.choice((-1.0, 1.0)))
    ahead, facing = place_before_radar(radar, 1.0)
    origin = np.asarray(place_before_radar(radar, 0.0)[0])
    forward = np.asarray(ahead) - origin
    for attempt in range(_WIDER + 1):
        placed = []
        for actor, said, spot in zip(made, read.said, _layout(read, made, duration, side, attempt), strict=True):
            if isinstance(said, ThingPrompt) and read.relation == "apart" and _speed(actor, duration) > _STATIC:
                placed.append(_beyond(actor, forward * (1.5 * (attempt + (said.distance_m is None)))))
            else:
                placed.append(_placed(actor, origin, forward, facing, *spot, duration))
        if _clear(placed, duration):
            return tuple(placed)
    raise PromptError(
        f"target: {len(made)} actors find no place for {duration:g} s without going through one another; take a "
        "shorter duration, or place each with Actor.from_prompt(position=…)"
    )


def actors_report(actors: Sequence[Actor], more: Iterable[Decision] = ()) -> str:
    """Interpretation and decisions of each actor from a prompt, under its name where there are several, with `more`
    decisions at the end; several lines."""
    last = [DECIDED, *tabulate(more)]
    if not actors:
        return "\n".join(last)
    if len(actors) == 1:
        return actors[0].report(more)
    parts = [f"actor: {actor.name}\n{actor.report()}" for actor in actors]
    return "\n".join([*parts, *last])


def _paced(read: PromptedActors, speed: float | None) -> tuple[ScenePrompt, ...]:
    """Prompts whose actors go at a common speed [m/s] over the floor; None leaves them as they are."""
    if speed is None or speed < _STATIC:
        return read.said
    return tuple(
        each if index == 0 else replace(each, manner=replace(each.manner, speed_mps=speed))
        for index, each in enumerate(read.said)
    )


def _names(said: Sequence[ScenePrompt]) -> list[str]:
    names: list[str] = []
    for each in said:
        base = each.target if isinstance(each, ThingPrompt) else "person"
        taken = sum(name == base or name.startswith(f"{base}_") for name in names)
        names.append(base if taken == 0 else f"{base}_{taken + 1}")
    return names


def _track(actor: Actor, duration: float) -> FloatArray:
    """(time, 2) way over the floor in the actor's own frame [m]."""
    if actor.motion is not None:
        return np.asarray(actor.motion.translation)[:, :2]
    yaw = float(actor.orientation[0])
    back = np.array([[np.cos(yaw), np.sin(yaw)], [-np.sin(yaw), np.cos(yaw)]])
    times = np.linspace(0.0, duration, 11)
    world = np.stack([actor.vertices(float(t))[:, :2].mean(axis=0) for t in times])
    return (world - np.asarray(actor.position)[:2]) @ back.T


def _speed(actor: Actor, duration: float) -> float:
    """Mean speed over the floor [m/s]."""
    track = _track(actor, duration)
    return float(np.linalg.norm(np.diff(track, axis=0), axis=1).sum()) / duration


def _layout(
    read: PromptedActors, made: Sequence[Actor], duration: float, side: float, attempt: int
) -> list[tuple[float, float, float]]:
    """(distance, offset to the radar's left, turn against the radar's direction of view) of each actor [m, m, rad];
    further attempts are wider."""
    spots = _boresight_layout(read, made, duration, side, attempt)
    if read.relation == "apart":
        return spots
    bearing = np.radians(
        next((each.bearing_deg for each in read.said if each.bearing_deg is not None), read.azimuth_deg)
    )
    c, s = float(np.cos(bearing)), float(np.sin(bearing))
    return [(c * u - s * v, s * u + c * v, turn + float(bearing)) for u, v, turn in spots]


def _given_turn(said: ScenePrompt, side: float) -> float | None:
    """Direction that the prompt gives an actor, from facing the radar [rad]."""
    way = said.way if isinstance(said, ThingPrompt) else ""
    ways = {"to": 0.0, "away": np.pi, "right": 0.5 * np.pi, "left": -0.5 * np.pi, "past": side * 0.5 * np.pi}
    if said.orientation_deg is not None:
        return float(np.radians(said.orientation_deg))
    return ways.get(way)


def _boresight_layout(
    read: PromptedActors, made: Sequence[Actor], duration: float, side: float, attempt: int
) -> list[tuple[float, float, float]]:
    """The layout of :func:`_layout` around the radar's boresight."""
    middle, wider = read.distance_m, 1.0 + 0.25 * attempt
    count = len(made)
    given = [_given_turn(each, side) for each in read.said]
    turns = [turn or 0.0 for turn in given]
    common = next((turn for turn in given if turn is not None), None)
    if read.relation == "facing":
        half = 0.5 * (0.85 + 0.06 * attempt)
        return [(middle, half, 0.5 * np.pi), (middle, -half, -0.5 * np.pi)]
    if read.relation == "parting":
        ways = [0.5 * float(np.ptp(_track(actor, duration)[:, 0])) + 0.4 * wider for actor in made]
        return [(middle, -ways[0], 0.5 * np.pi), (middle, ways[1], -0.5 * np.pi)]
    if read.relation == "side by side":
        step = 0.8 * wider
        return [(middle, (0.5 * (count - 1) - i) * step, common or 0.0) for i in range(count)]
    if read.relation in ("past", "towards"):
        across = side * 0.5 * np.pi
        away = 0.9 * wider
        if read.relation == "past":
            own = given[0]
            turn = across if own is None else own
            against = turn + np.pi if given[1] is None and _speed(made[1], duration) > _STATIC else turns[1]
            return [(middle + away * np.sin(turn), -away * np.cos(turn), turn), (middle, 0.0, against)]
        # the first one's way ends beside the second one
        half = 0.5 * float(np.ptp(_track(made[0], duration)[:, 0]))
        return [(middle, side * (half + away), across), (middle, 0.0, turns[1])]
    if read.relation == "beside":
        return [(middle, side * 0.5 * wider, turns[0]), (middle, -side * 0.5 * wider, turns[1])]
    if read.relation in ("behind", "in front", "pushing"):
        across = side * 0.5 * np.pi if _speed(made[1], duration) > _STATIC else 0.0
        turn = across if common is None else common
        gap = (0.95 if read.relation == "pushing" else 1.3) * wider * (1.0 if read.relation == "in front" else -1.0)
        ways = [0.5 * float(np.ptp(_track(actor, duration)[:, 0])) for actor in made]
        gap += ways[0] - ways[1]  # from the starts to the middles
        return [(middle - gap * np.cos(turn), -gap * np.sin(turn), turn), (middle, 0.0, turn)]
    step = 1.3 * wider
    spots = []
    for i, said in enumerate(read.said):
        distance = middle if said.distance_m is None else said.distance_m
        angle = float(np.radians(read.azimuth_deg)) + (0.5 * (count - 1) - i) * step / distance
        bearing = said.bearing_deg
        if bearing is not None:
            angle = float(np.radians(bearing))
        spots.append((distance * np.cos(angle), distance * np.sin(angle), turns[i] + angle))
    return spots


def placed_before(
    actor: Actor, radar: Radar, distance: float, azimuth_deg: float, orientation_deg: float, duration: float
) -> Actor:
    """The actor with the middle of its way over the floor before the radar, at its height.

    Args:
        actor: an actor.
        radar: the radar.
        distance: horizontal distance [m].
        azimuth_deg: azimuth from the boresight, positive to the radar's left [degrees].
        orientation_deg: rotation of the actor's x axis from facing the radar [degrees].
        duration: time whose way counts [s].
    """
    ahead, facing = place_before_radar(radar, 1.0)
    origin = np.asarray(place_before_radar(radar, 0.0)[0])
    azimuth, turn = np.radians(azimuth_deg), np.radians(orientation_deg)
    u, v = float(distance * np.cos(azimuth)), float(distance * np.sin(azimuth))
    return _placed(actor, origin, np.asarray(ahead) - origin, facing, u, v, float(turn + azimuth), duration)


def _placed(
    actor: Actor, origin: FloatArray, forward: FloatArray, facing: float, u: float, v: float, turn: float,
    duration: float,
) -> Actor:  # fmt: skip
    """The actor with the middle of its way at a place before the radar."""
    left = np.array([-forward[1], forward[0]])
    rotation, turned = _rotation(facing + turn), _rotation(facing + turn - float(actor.orientation[0]))
    track = _track(actor, duration)
    middle = 0.5 * (track.min(axis=0) + track.max(axis=0))
    place = origin + u * forward + v * left - rotation @ middle
    velocity = np.asarray(actor.velocity, np.float64)
    velocity[:2] = turned @ velocity[:2]
    position = (float(place[0]), float(place[1]), float(actor.position[2]))
    return replace(
        actor,
        position=cast(Any, position),
        orientation=cast(Any, (facing + turn, 0.0, 0.0)),
        velocity=cast(Any, tuple(velocity)),
        decisions=_with_place(actor.decisions, position, turn - float(np.arctan2(v, u))),
    )


def _beyond(actor: Actor, shift: FloatArray) -> Actor:
    """The actor farther from the radar."""
    place = np.asarray(actor.position, np.float64) + np.append(shift, 0.0)
    decisions = _with_place(actor.decisions, tuple(place), None)
    return replace(actor, position=cast(Any, tuple(place)), decisions=decisions)


def _with_place(decisions: Sequence[Decision], position: Any, turn: float | None) -> tuple[Decision, ...]:
    """Decisions with the place among the actors instead of that of an actor alone."""
    moved = {"position", "distance", "azimuth"} | ({"orientation"} if turn is not None else set())
    kept = [each for each in decisions if each.name not in moved]
    kept.append(triple_decision("position", np.round(position, 3), "m", AMONG))
    if turn is not None:
        kept.append(Decision("orientation", f"{np.degrees(turn) % 360.0:.0f}° from facing the radar", AMONG))
    return tuple(kept)


def _rotation(yaw: float) -> FloatArray:
    c, s = np.cos(yaw), np.sin(yaw)
    return np.array([[c, -s], [s, c]])


def _clear(actors: Sequence[Actor], duration: float) -> bool:
    """Whether the surfaces of the actors stay apart by `CLEARANCE`."""
    for t in np.linspace(0.0, duration, max(2, int(duration * CHECK_RATE) + 1)):
        meshes = [actor.vertices(float(t))[::_EVERY] for actor in actors]
        boxes = [(mesh.min(axis=0) - CLEARANCE, mesh.max(axis=0) + CLEARANCE) for mesh in meshes]
        for i, mesh in enumerate(meshes):
            for j in range(i):
                (low, high), (low2, high2) = boxes[i], boxes[j]
                if (low > high2).any() or (low2 > high).any():
                    continue
                if cKDTree(meshes[j]).query(mesh, distance_upper_bound=CLEARANCE)[0].min() < CLEARANCE:
                    return False
    return True
