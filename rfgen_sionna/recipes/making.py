"""One recording of a data set: its scene and its people are made once, and all its radars record them."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from rfgen_sionna.composition import Reception, TraceOptions, compose
from rfgen_sionna.dataset.actor_labels import actor_labels
from rfgen_sionna.generative.actor import Actor
from rfgen_sionna.generative.bodies import Phenotype, PhenotypeError
from rfgen_sionna.generative.clip_person import person_with_clip, read_clip_prompt
from rfgen_sionna.generative.environment_setup import ImageOptions
from rfgen_sionna.generative.prompts import DEFAULT_DISTANCE, PromptError
from rfgen_sionna.generative.radar_placement import place_before_radar
from rfgen_sionna.generative.several_actors import placed_before
from rfgen_sionna.options import chosen_view, placed_radar
from rfgen_sionna.radar import Radar
from rfgen_sionna.recipes.recipe_sources import clip_of
from rfgen_sionna.recipes.recording_spec import BodySpec, RecordingSpec, SourceSpec
from rfgen_sionna.recording import ImageView, RunPlan, write_run
from rfgen_sionna.scene.floor import floor_under
from rfgen_sionna.scene.scene import RadarScene
from rfgen_sionna.scene.scene_errors import PlacementError
from rfgen_sionna.scene_request import (
    PersonBody,
    Placement,
    RunSeeds,
    SceneRequest,
    check_distances,
    read_request,
    with_person_body,
    with_placement,
)

if TYPE_CHECKING:
    from rfgen_sionna.recipes.recipe import Recipe

SPACING = 1.3
"""Distance between neighbours of a recording of several sources [m]."""
IMPOSSIBLE = (PlacementError, PromptError, PhenotypeError)
"""Errors of a draw that cannot be; all others are faults of the machine, the files or the program."""


def make_with_attempts(recipe: Recipe, number: int, path: Path, device: str = "cpu") -> RecordingSpec:
    """Make a recording, with further draws where a place cannot be, and return what it is made of.

    Raises
    ------
    PlacementError
        If no attempt can be made: the reason of the last one.
    Exception
        Whatever else is wrong, such as a full disk or an unreadable file: no further draw is an answer to that.
    """
    attempts = max(1, recipe.tables.attempts)
    for attempt in range(attempts):
        spec = recipe.recording(number, attempt)
        try:
            make_recording(spec, path, device)
        except IMPOSSIBLE as error:
            if attempt == attempts - 1:
                raise PlacementError(f"none of {attempts} draws could be made, the last one: {error}") from error
        else:
            return spec
    raise AssertionError("unreachable")


def make_recording(spec: RecordingSpec, path: Path, device: str = "cpu") -> None:
    """Make one recording and write its run file; nothing is left at `path` where it cannot be.

    Parameters
    ----------
    spec
        What it is made of.
    path
        Run file to write, in place of one that is there.
    device
        Device that sums the paths: "cpu", "cuda" or "auto".

    Raises
    ------
    PlacementError, PromptError, PhenotypeError
        If the recording cannot be: somebody in a wall, hidden or too far, for instance.
    """
    plans = recording_plans(spec, device)
    write_run(path, plans, overwrite=True, words=True, compressed=True, dated=False).close()


def recording_plans(spec: RecordingSpec, device: str = "cpu") -> dict[str, RunPlan]:
    """Runs of the radars of a recording, checked, before their first frame."""
    radars = {
        each.name: placed_radar(each.radar, each.preset, each.board, each.position_m, each.look_at_m)
        for each in spec.radars
    }
    first = next(iter(radars.values()))
    request = recording_request(spec, device)
    for radar in radars.values():
        request.image_options.check(moves=radar.trajectory is not None)
    check_distances(request, first, spec.outside)
    resolution, fov = chosen_view(spec.pir_resolution, spec.fov_deg, "perspective", request.source)
    return compose(
        request,
        radars,
        duration=spec.duration_s,
        view=ImageView(resolution, fov, "perspective"),
        images="pir" in spec.keep,
        trace=TraceOptions(spec.rtol, spec.max_bounces, spec.transmission, spec.outside, spec.collisions),
        reception=Reception(spec.noise, spec.receiver, spec.noise or spec.receiver is not None, device),
        placed=lambda scene: _placed_sources(spec, request, scene, first),
        keep=spec.keep,
        recording=portable(spec),
    )


def portable(spec: RecordingSpec) -> dict[str, Any]:
    """Record of a recording as its run stores it: with the names of files, without their folders."""
    record = spec.to_dict()
    del record["place_file"]
    for source in record["sources"]:
        source["file"] = source["file"] and Path(source["file"]).name
    for radar in record["radars"]:
        radar["radar"] = Path(radar["radar"]).name
        radar["board"] = radar["board"] and Path(radar["board"]).name
    return record


def recording_request(spec: RecordingSpec, device: str = "cpu") -> SceneRequest:
    """The prompts and the place of a recording, read and checked."""
    prompts = [each.text for each in spec.sources if each.kind == "prompt"]
    if len(spec.sources) > 1 and any(each.kind in ("clip", "joints") for each in spec.sources):
        raise ValueError("sources: clips and joints are alone in a recording; leave out the other sources")
    request = read_request(
        prompts,
        environment=spec.place_file or spec.place,
        seeds=RunSeeds(_first_body(spec).seed, spec.motion_seed, spec.place_seed, spec.seed, spec.seed),
        bodies=tuple(map(_person_body, spec.bodies)) if prompts else (),
        placement=Placement(spec.distance_m, spec.azimuth_deg, spec.orientation_deg),
        motion=spec.motion,
        image_options=ImageOptions(device=None if device == "auto" else device),
    )
    return replace(request, prompt="; ".join(each.text or Path(each.file or "").name for each in spec.sources))


def _person_body(body: BodySpec) -> PersonBody:
    names = ("gender", "age_years", "height_m", "weight_kg", "muscle")
    given = {name: getattr(body, name) for name in names}
    return PersonBody(body.seed, {name: value for name, value in given.items() if value is not None})


def _first_body(spec: RecordingSpec) -> PersonBody:
    return _person_body(spec.bodies[0]) if spec.bodies else PersonBody(spec.motion_seed)


def _placed_sources(spec: RecordingSpec, request: SceneRequest, scene: RadarScene, radar: Radar) -> list[Actor]:
    """Actors of the clips, joints and meshes of a recording, beside those of its prompts."""
    files = [each for each in spec.sources if each.kind != "prompt"]
    count, row = sum("position_m" not in each.options for each in files), 0
    made: list[Actor] = []
    for source in files:
        place = Placement()
        if "position_m" not in source.options:
            place, row = _beside(spec, _shift(row, count, len(request.said))), row + 1
        if source.kind == "mesh":
            actor = _mesh(source, place, scene, radar)
            taken = sum(each.name == actor.name or each.name.startswith(f"{actor.name}_") for each in made)
            made.append(replace(actor, name=f"{actor.name}_{taken + 1}") if taken else actor)
        else:
            make = _clip if source.kind == "clip" else _joints
            made.append(make(spec, source, place, scene, radar))
        made[-1] = replace(made[-1], named_action=source.options.get("action", ""))
    return made


def _shift(index: int, count: int, prompted: int) -> float:
    """Offset to the radar's left of a source of a file [m]: in a row, or on both sides of the people of prompts."""
    if not prompted:
        return (0.5 * (count - 1) - index) * SPACING
    return (1 if index % 2 == 0 else -1) * (0.5 * (prompted - 1) + 1 + index // 2) * SPACING


def _beside(spec: RecordingSpec, shift: float) -> Placement:
    """Place of a recording's source, moved to the radar's left [m]."""
    if shift == 0.0:
        return Placement(spec.distance_m, spec.azimuth_deg, spec.orientation_deg)
    distance = DEFAULT_DISTANCE if spec.distance_m is None else spec.distance_m
    azimuth = (spec.azimuth_deg or 0.0) + math.degrees(shift / distance)
    return Placement(distance, azimuth, spec.orientation_deg)


def _floor(scene: RadarScene, radar: Radar, place: Placement) -> tuple[tuple[float, float], float, float]:
    """Place (x, y) [m], yaw that faces the radar [rad] and height of the floor there [m]."""
    distance = DEFAULT_DISTANCE if place.distance_m is None else place.distance_m
    spot, yaw = place_before_radar(radar, distance, place.azimuth_deg or 0.0)
    found = floor_under(scene, (*spot, float(radar.position[2])))
    return spot, yaw, 0.0 if found is None else found[0]


def _clip(spec: RecordingSpec, source: SourceSpec, place: Placement, scene: RadarScene, radar: Radar) -> Actor:
    body = _first_body(spec)
    clip = clip_of(source)
    said = with_placement(read_clip_prompt(source.text, "", spec.motion_seed, clip), place)
    words = read_clip_prompt(source.text, "", body.seed, clip).body
    said = with_person_body(replace(said, body=words), body)
    where = Placement(said.distance_m, said.bearing_deg)
    return person_with_clip(
        said, clip, seed=body.seed, radar=radar, floor=_floor(scene, radar, where)[2], **_options(source)
    )


def _joints(spec: RecordingSpec, source: SourceSpec, place: Placement, scene: RadarScene, radar: Radar) -> Actor:
    body = _first_body(spec)
    traits = {name.split("_")[0]: value for name, value in body.traits.items()}
    floor = _floor(scene, radar, place)[2]
    person = Actor.from_joints(
        source.file or "", body=Phenotype(**traits) if traits else None, seed=body.seed, floor=floor, **_options(source)
    )
    if place == Placement():  # as seen by a camera at the radar
        (x, y), facing = place_before_radar(radar, 0.0)
        return replace(person, position=(x, y, person.position[2]), orientation=(facing + math.pi, 0.0, 0.0))
    heading = math.degrees(actor_labels([person], radar, 0.0)["orientation"][0])
    distance = DEFAULT_DISTANCE if place.distance_m is None else place.distance_m
    turn = (place.orientation_deg or 0.0) - heading
    return placed_before(person, radar, distance, place.azimuth_deg or 0.0, turn, spec.duration_s)


def _mesh(source: SourceSpec, place: Placement, scene: RadarScene, radar: Radar) -> Actor:
    options = dict(source.options)
    position, velocity = options.get("position_m"), options.get("velocity_m_s", (0.0, 0.0, 0.0))
    mesh = Actor.from_mesh(source.file or "", material=options.get("material", ""))
    velocity = tuple(map(float, velocity))
    if position is not None:
        x, y, z = map(float, position)
        return replace(mesh, position=(x, y, z), velocity=velocity)
    (x, y), yaw, floor = _floor(scene, radar, place)
    turned = replace(mesh, orientation=(yaw + math.radians(place.orientation_deg or 0.0), 0.0, 0.0))
    lowest = float(np.min(turned.vertices(0.0)[:, 2]))
    return replace(turned, position=(x, y, floor - lowest), velocity=velocity)


def _options(source: SourceSpec) -> dict[str, Any]:
    return {name: value for name, value in source.options.items() if name != "action" and value is not None}
