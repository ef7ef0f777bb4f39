"""Checks of a whole recipe before anything runs: radars, files, distances, bodies, places."""

from __future__ import annotations

import math

import numpy as np

from rfgen_sionna._types import FloatArray
from rfgen_sionna.dataset.representations import checked_keep, representation_arrays
from rfgen_sionna.generative.prompts import DEFAULT_DISTANCE
from rfgen_sionna.generative.radar_placement import NEAREST, place_before_radar
from rfgen_sionna.radar import Radar
from rfgen_sionna.recipes.recipe_contents import RecipeContents
from rfgen_sionna.recipes.recipe_error import RecipeError, faults_of
from rfgen_sionna.recipes.recipe_places import CHECKED_LAYOUTS, Place, interiors
from rfgen_sionna.recipes.recipe_sources import changes_freely, check_source_file, source_tables
from rfgen_sionna.recipes.recipe_tables import MAX_PEOPLE
from rfgen_sionna.recipes.set_radars import load_radar
from rfgen_sionna.recipes.value_forms import ValueForm
from rfgen_sionna.scene.scene import Interior
from rfgen_sionna.signal.receiver.receiver_record import chosen_receiver

BODY_TRAITS = {"gender": "gender", "age_years": "age", "height_m": "height", "weight_kg": "weight", "muscle": "muscle"}
"""Key of the bodies -> attribute in the words of a prompt."""
STANDING = 0.3
"""Half the width of a standing person [m], who is to be inside a place."""


def check_recipe(recipe: RecipeContents) -> None:
    """Check a recipe whole; no recording is made.

    Raises:
        RecipeError: it cannot be made; the message names the key, its value and what is allowed.
    """
    _check_keep(recipe)
    radars = [_check_radar(recipe, number) for number in range(len(recipe.radars))]
    _check_people(recipe)
    _check_bodies(recipe)
    _check_distances(recipe, radars)
    _check_placed_meshes(recipe, radars)
    _check_places(recipe, radars)
    for (key, _), source in zip(source_tables(recipe.tables), recipe.sources, strict=True):
        with faults_of(key):
            check_source_file(source)


def _check_keep(recipe: RecipeContents) -> None:
    keep = recipe.tables.keep
    with faults_of("keep"):
        if len(set(keep)) < len(keep):
            raise ValueError(f"{keep} has a name twice")
        checked_keep(keep, pictures=True)
        for source in recipe.sources if "body" in keep else ():
            if soft := changes_freely(source):
                raise ValueError(f"'body' is in it, and no parameters rebuild '{soft}': keep 'vertices' instead")


def _check_radar(recipe: RecipeContents, number: int) -> list[Radar]:
    """The radar at all its places."""
    tables, each = recipe.tables, recipe.radars[number]
    with faults_of(each.path("radar")):
        placed = [load_radar(spec) for spec in each.placements()]
    radar = placed[0]
    with faults_of("receiver"):
        for receiver in recipe.receivers.values:
            chosen_receiver(receiver, radar, tables.noise)
    frame, shortest = radar.waveform.frame_length, min(tables.duration_s.values)
    if shortest < frame * (1 - 1e-9):
        raise RecipeError(
            f"duration_s is {shortest:g}, but one frame of radar '{radar.name}' (preset '{radar.preset}') takes "
            f"{frame:.6g} s: give at least that"
        )
    with faults_of("keep"):
        representation_arrays(tables.keep, radar)
    return placed


def _check_people(recipe: RecipeContents) -> None:
    people = recipe.tables.people
    most = max(people.values)
    for source in recipe.sources if most > 1 else ():
        if len(source.actions) > 1:
            raise RecipeError(
                f"people is {most}, but '{source.spec.text}' is about {len(source.actions)} actors already: say who "
                "does what in one prompt, or take prompts of one actor each"
            )
        if source.spec.kind in ("clip", "joints"):
            raise RecipeError(
                f"people is {most}, but a {source.spec.kind} is alone ('{source.spec.file}'): take prompts and meshes"
            )
    for source in recipe.sources:
        if len(source.actions) > MAX_PEOPLE:
            raise RecipeError(f"prompts: '{source.spec.text}' is about more than {MAX_PEOPLE} actors")
    if recipe.tables.places is None and most > 1 and len({s.surroundings for s in recipe.sources} - {None}) > 1:
        raise RecipeError(f"people is {most}, but prompts name several places: leave them out, and give places")


def _check_bodies(recipe: RecipeContents) -> None:
    bodies = recipe.tables.bodies
    for key, trait in BODY_TRAITS.items():
        form = getattr(bodies, key)
        if form is None:
            continue
        if form.is_grid:
            raise RecipeError(f"bodies.{key} is a grid, which bodies do not go through: give a list or a range")
        for source in recipe.sources:
            grown_up = trait == "age" and "gender" in source.traits and min(form.values) >= 18.0
            if trait in source.traits and not grown_up:
                raise RecipeError(
                    f"bodies.{key}: '{source.spec.text}' says the {trait}, too: leave it out there or in the bodies"
                )


def _distances(recipe: RecipeContents, needed: bool) -> dict[float, str]:
    """Distances that are drawn, or the ends of their range, and their keys.

    Args:
        recipe: the recipe.
        needed: whether those are left out that another draw replaces.
    """
    found: dict[float, str] = {}
    form: ValueForm[float] | None = recipe.tables.distance_m
    moving = [source for source in recipe.sources if source.spec.options.get("position_m") is None]
    if any(not source.distances_m for source in moving):
        if form is None:
            found[DEFAULT_DISTANCE] = "distance_m (default)"
        else:
            values = (min(form.values),) if needed and form.kind in ("range", "choice") else form.values
            found |= dict.fromkeys(values, "distance_m")
    for source in moving:
        if source.distances_m:
            values = (source.distances_m[0],) if needed else source.distances_m
            found |= dict.fromkeys(values, f"the distance of '{source.spec.text}'")
    return found


def _azimuths(recipe: RecipeContents) -> tuple[float, ...]:
    form: ValueForm[float] | None = recipe.tables.azimuth_deg
    return (0.0,) if form is None else form.values


def _spots(radar: Radar, distance: float, azimuths: tuple[float, ...]) -> FloatArray:
    """(spot, 2) places of a person before the first radar [m]."""
    return np.array([place_before_radar(radar, distance, azimuth)[0] for azimuth in azimuths])


def _check_distances(recipe: RecipeContents, radars: list[list[Radar]]) -> None:
    """Distances within the range windows, and not too near."""
    with faults_of(recipe.radars[0].path("look_at_m")):
        spots = {
            (distance, key): np.concatenate([_spots(radar, distance, _azimuths(recipe)) for radar in radars[0]])
            for distance, key in _distances(recipe, needed=False).items()
        }
    for (distance, key), places in spots.items():
        if distance < NEAREST:
            raise RecipeError(f"{key} is {distance:g} m: at least {NEAREST:g} m are needed")
        if recipe.tables.outside == "ignore":
            continue
        for each in radars:
            # Of several radars at several places the nearest ones count: what is drawn together is not known.
            away = [np.linalg.norm(places - np.asarray(radar.position)[:2], axis=1) for radar in each]
            far = float(np.max(np.min(away, axis=0)))
            if far > each[0].max_range:
                raise RecipeError(
                    f"{key} is {distance:g} m; the range window of radar '{each[0].name}' (preset "
                    f"'{each[0].preset}') ends at {each[0].max_range:.2f} m: choose a smaller one, or a preset with a "
                    "lower slope or a higher sample rate"
                )


def _check_placed_meshes(recipe: RecipeContents, radars: list[list[Radar]]) -> None:
    """Meshes at places of their own: ahead of a radar, within the range windows, and not at a radar."""
    duration = max(recipe.tables.duration_s.values)
    for (key, _), source in zip(source_tables(recipe.tables), recipe.sources, strict=True):
        if (given := source.spec.options.get("position_m")) is None:
            continue
        start = np.array(given, np.float64)
        end = start + duration * np.array(source.spec.options.get("velocity_m_s", (0.0, 0.0, 0.0)))
        for each in radars:
            away = [float(np.linalg.norm(start - np.asarray(radar.position))) for radar in each]
            where = f"{key}.position_m is {list(given)}, {min(away):.3g} m from radar '{each[0].name}'"
            if max(away) < NEAREST:
                raise RecipeError(f"{where}: at least {NEAREST:g} m are needed")
            if recipe.tables.outside == "error" and min(away) > each[0].max_range:
                raise RecipeError(
                    f"{where}, whose range window (preset '{each[0].preset}') ends at {each[0].max_range:.2f} m: move "
                    'it nearer, or outside = "ignore" leaves it out'
                )
        way = np.stack([start, end])
        if all(np.max((way - radar.position) @ radar.rotation[:, 0]) <= 0.0 for each in radars for radar in each):
            raise RecipeError(f"{key}.position_m is {list(given)}, behind the radar: a place ahead of it is needed")


def _check_places(recipe: RecipeContents, radars: list[list[Radar]]) -> None:
    """Radars and the nearest spots of people inside the places, and room for straight ways."""
    duration = min(recipe.tables.duration_s.values)
    fastest = max(recipe.sources, key=lambda source: source.speed_m_s)
    way = fastest.speed_m_s * duration
    for place in recipe.places:
        rooms = interiors(place, _first_layouts(recipe, place))
        if not rooms:
            continue
        for number, each in enumerate(radars):
            for radar in each:
                if not any(room.contains(radar.position) for room in rooms):
                    raise RecipeError(
                        f"{recipe.radars[number].path('position_m')} is {list(radar.position)}, outside of "
                        f"'{place.name}' ({rooms[0]}): place the radar inside, or take another place"
                    )
        for distance, key in _distances(recipe, needed=True).items():
            spots = np.concatenate([_spots(radar, distance, _azimuths(recipe)) for radar in radars[0]])
            if not any(_holds(room, spot) for room in rooms for spot in spots):
                raise RecipeError(
                    f"places: '{place.name}' is too small: {key} is {distance:g} m, and the place has {rooms[0]}; take "
                    "a smaller distance or another place"
                )
        longest = max(math.dist(room.low.min(axis=0)[:2], room.high.max(axis=0)[:2]) for room in rooms)
        if way > longest:
            raise RecipeError(
                f"places: '{place.name}' is too small: the way of '{fastest.spec.text}' in {duration:g} s is "
                f"{way:.1f} m long, the place is {longest:.1f} m across; take a shorter duration_s, a slower way or "
                "another place"
            )


def _holds(room: Interior, spot: FloatArray) -> bool:
    corners = [(spot[0] + dx, spot[1] + dy) for dx in (-STANDING, STANDING) for dy in (-STANDING, STANDING)]
    height = float(room.low[0, 2]) + 0.1
    return all(room.contains((x, y, height)) for x, y in corners)


def _first_layouts(recipe: RecipeContents, place: Place) -> tuple[int, ...]:
    """Seeds of layouts of the first recordings in a place."""
    if not place.has_layouts:
        return ()
    return tuple(recipe.layout_seed(place.name, number) for number in range(CHECKED_LAYOUTS))
