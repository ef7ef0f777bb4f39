"""Actors of prompts about animals and things."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from rfgen_sionna.generative.decisions import DEFAULT, PROMPT, Decision, argument, drawn
from rfgen_sionna.generative.prompts.prompt_error import PromptError
from rfgen_sionna.generative.prompts.scene_prompt import DEFAULT_DISTANCE
from rfgen_sionna.generative.prompts.thing_prompt import PACED, ThingPrompt, way_origin
from rfgen_sionna.generative.radar_placement import place_before_radar
from rfgen_sionna.generative.things.thing_catalogue import THINGS
from rfgen_sionna.generative.things.thing_placement import build_thing, ground_speed, half_extent, thing_fields, yaw_of

if TYPE_CHECKING:
    from rfgen_sionna.radar import Radar

CLEARANCE = 0.3
"""Least distance of a thing's surface from the radar on its way [m]."""
_TURNS = {"to": 0.0, "away": np.pi, "left": -0.5 * np.pi, "right": 0.5 * np.pi}
"""Way as seen from the radar -> turn from facing it [rad]."""


def prompted_thing(
    said: ThingPrompt,
    given: Mapping[str, Any],
    seed: int,
    duration: float,
    radar: Radar | None,
    floor: float,
    name: str,
    body_seed: int | None = None,
) -> dict[str, Any]:
    """Fields of the actor of a prompt.

    A thing that moves towards the radar or away is at the prompt's distance at t = 0; one that passes is there in the
    middle of the duration.

    Args:
        said: the prompt.
        given: arguments position, orientation, body and material of :meth:`Actor.from_prompt`.
        seed: seed of what the prompt leaves open.
        duration: length of the motion [s].
        radar: the radar; None is one at the origin.
        floor: height of the floor [m].
        name: name in labels; "person" takes that of the kind.
        body_seed: seed of size and details; None is `seed`.

    Raises:
        PromptError: the speed is out of reach, or the way leads to the radar.
        ValueError: a body is given, or a duration that is not positive.
    """
    kind = THINGS[said.target]
    if given["body"] is not None:
        raise ValueError(f"body: the prompt is about a {kind.name}, which has its own; leave it out")
    if not (np.isfinite(duration) and duration > 0.0):
        raise ValueError(f"duration: {duration!r} s; allowed is more than 0")
    does, body_seed = kind.actions[said.action], seed if body_seed is None else body_seed
    values = kind.values(said.values, np.random.default_rng([body_seed, 52]))
    given_values = dict(said.values)
    if said.speed is not None and does.speed == 0.0:
        for key in PACED.intersection(values).difference(given_values):
            given_values[key] = values[key] * (1.0 / said.speed if key == "seconds" else said.speed)
    try:
        speed = ground_speed(kind, said.action, values, said.speed_mps)
    except ValueError as error:
        raise PromptError(str(error)) from error
    if said.speed is not None:
        speed = min(speed * said.speed, does.fastest)
    usual = said.speed_mps is None and said.speed is None
    if usual and speed > 0.0:
        speed = min(speed * float(np.random.default_rng([seed, 55]).uniform(0.85, 1.15)), does.fastest)
    travel = speed * duration
    way = said.way
    if does.speed > 0.0 and way in ("", "past") and said.orientation_deg is None:
        way = ("left", "right")[int(np.random.default_rng([seed, 54]).integers(2))]
    # a usual place leaves room for the way
    distance = said.distance_m
    if distance is None:
        distance = max(DEFAULT_DISTANCE, 0.6 * travel if way in ("left", "right") else 0.0)
        distance = max(distance, travel + 2.0) if way == "to" else distance
    place, facing = place_before_radar(radar, distance, said.bearing_deg or 0.0)
    yaw = facing + _TURNS.get(way, 0.0) + float(np.radians(said.orientation_deg or 0.0))
    if given["orientation"] is not None:
        yaw = yaw_of(given["orientation"])
    yaw = float(np.arctan2(np.sin(yaw), np.cos(yaw)))
    ahead = np.array([np.cos(yaw), np.sin(yaw)])
    start = np.asarray(place) - (0.5 * travel * ahead if way in ("left", "right") else 0.0)
    height = does.height if said.height_m is None else said.height_m
    built = build_thing(
        kind.name, said.action, seed=body_seed, speed=speed if does.speed > 0.0 else None, path=None, yaw=yaw,
        height=height, values=given_values,
    )  # fmt: skip
    position = (float(start[0]), float(start[1]), floor + height) if given["position"] is None else given["position"]
    if travel > 0.0 and given["position"] is None:
        _check_way(said, start, ahead, travel, half_extent(built.sequence), speed, radar)
    orientation = (yaw, 0.0, 0.0) if given["orientation"] is None else given["orientation"]
    fields = thing_fields(built, None if name == "person" else name, position, orientation)
    if given["material"] != "skin":
        fields["material"] = given["material"]

    def origin(key: str) -> str:
        return PROMPT if key in said.origins else DEFAULT

    rows = [*said.decisions()]
    if given["position"] is None:
        rows.append(Decision("distance", f"{distance:.3g} m", said.origins.get("distance", DEFAULT)))
        rows.append(Decision("azimuth", f"{said.bearing_deg or 0.0:g}°", origin("azimuth")))
        rows.append(Decision("altitude", f"{height:g} m over the floor", origin("height")))
    else:
        rows.append(Decision("position", ", ".join(f"{x:g}" for x in position) + " m", argument("position")))
    if does.speed > 0.0:
        if way:
            rows.append(Decision("way", _WAY_TEXTS[way], way_origin(said, seed)))
        rows.append(Decision("speed", f"{speed:.3g} m/s", drawn(seed) if usual else PROMPT))
    else:
        rows.append(
            Decision("orientation", f"{said.orientation_deg or 0.0:g}° from facing the radar", origin("orientation"))
        )
    for key, value in built.thing.values.items():
        whence = PROMPT if key in said.values else drawn(body_seed)
        rows.append(Decision(key, f"{value:.4g}, {kind.parameters[key].meaning}", whence))
    return fields | {"prompt": said, "decisions": tuple(rows)}


_WAY_TEXTS = {
    "to": "towards the radar", "away": "away from the radar", "left": "to the radar's left, past its boresight",
    "right": "to the radar's right, past its boresight",
}  # fmt: skip


def _check_way(
    said: ThingPrompt, start: Any, ahead: Any, travel: float, extent: float, speed: float, radar: Radar | None
) -> None:
    """Refuse a straight way that leads to the radar."""
    at = np.zeros(2) if radar is None else np.asarray(radar.position)[:2]
    nearest = float(np.clip((at - start) @ ahead, 0.0, travel))
    clear = float(np.linalg.norm(start + nearest * ahead - at)) - extent
    if clear < CLEARANCE and nearest > 0.0:
        room = float(np.linalg.norm(start - at)) - extent - CLEARANCE
        fits = f"at most {room / speed:.1f} s fit there, or " if room > 0.1 * speed else ""
        raise PromptError(
            f"distance: the {said.target} goes {travel:.1f} m at {speed:g} m/s and comes to "
            f"{max(clear, 0.0):.1f} m from the radar; {CLEARANCE:g} m must stay free: {fits}take a distance of at "
            f"least {np.ceil(10.0 * (travel + extent + CLEARANCE)) / 10.0:g} m, or a lower speed"
        )
