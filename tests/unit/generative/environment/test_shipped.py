"""The environment model that ships: small enough, loaded offline, and drawing what it is told in physical units."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace
from importlib.resources import files

import numpy as np
import pytest

from rfgen_sionna._types import SPEED_OF_LIGHT
from rfgen_sionna.generative.environment.environment_diffusion import EnvironmentDiffusion
from rfgen_sionna.generative.environment.environment_model import (
    BASE_FILE,
    CONTROL_FILE,
    read_model,
    weights_fingerprint,
)
from rfgen_sionna.generative.environment.path_diffusion import PathDiffusion
from rfgen_sionna.records import Pir
from training.environment.image_metrics import Physical
from training.environment.path_evaluation import energy_error
from training.environment.pir_data import PLACES
from training.environment.shards import Settings, render_layout

WEIGHTS = files("rfgen_sionna.generative.environment") / "weights"


@pytest.fixture(scope="module")
def rooms() -> EnvironmentDiffusion:
    return EnvironmentDiffusion(steps=8, sampler="dpm")


def distance(pir: Pir) -> np.ndarray:
    return 0.5 * SPEED_OF_LIGHT * pir.time_of_arrival


def levels(pir: Pir) -> np.ndarray:
    """[dB]; NaN where nothing returns."""
    return 10 * np.log10(np.where(pir.energy > 0, pir.energy, np.nan))


def test_the_files_are_small_enough() -> None:
    from pathlib import Path

    sizes = [Path(str(WEIGHTS / name)).stat().st_size for name in (BASE_FILE, CONTROL_FILE)]
    assert sum(sizes) <= 60e6


def test_the_control_net_knows_its_base() -> None:
    own = read_model(control=True)
    assert own.control_facts["base"] == weights_fingerprint(own.unet)


@pytest.mark.parametrize(
    ("prompt", "place"),
    [
        ("a cosy lounge with two sofas", "living room"),
        ("a teacher's classroom full of desks", "classroom"),
        ("long hallway", "corridor"),
        ("a grassy meadow", "open field"),
        ("a garage with a parked car", "garage"),
        ("a children's playground", "playground"),
    ],
)
def test_unseen_wordings_are_understood(prompt: str, place: str) -> None:
    named, chance = read_model().text.place_of(prompt)
    assert (named, chance > 0.5) == (place, True)


def test_rooms_are_closed_and_fields_open(rooms: EnvironmentDiffusion) -> None:
    room = rooms.generate("a living room", seed=1)
    field = rooms.generate("an open field", seed=1)
    assert (room.energy <= 0).mean() < 0.03
    assert (field.energy <= 0).mean() > 0.1
    assert np.nanmax(distance(room)) < 15.0
    assert np.nanmax(distance(field)) > 15.0
    level = 10 * np.log10(np.median(room.energy[room.energy > 0]))
    assert -150 < level < -125
    assert not room.velocity.any()


@pytest.mark.slow
def test_what_a_room_lacks_is_drawn_around_the_rest_and_the_sky_stays_empty(rooms: EnvironmentDiffusion) -> None:
    """A hole of 12 x 12 pixels in a room gets a return near what was cut out, and keeps it over time; a street's sky
    none, as little as other pixels change."""
    paths = PathDiffusion()
    strayed = []
    for place, seed in (("an office", 1), ("an office", 2), ("an office", 3), ("a corridor", 2)):
        whole = rooms.generate(place, seed=seed)
        hole = np.zeros(whole.energy.shape, np.bool_)
        hole[16:28, 20:32] = True
        cut = replace(
            whole,
            energy=np.where(hole, 0.0, whole.energy),
            time_of_arrival=np.where(hole, np.nan, whole.time_of_arrival),
        )
        first, second = paths.refine_sequence([cut, replace(cut, time=0.5)], place, seed=1)
        if seed == 1:
            weak = paths.refine(cut, place, seed=1, strength=0.1).energy[hole]
            np.testing.assert_allclose(weak, 0.1 * first.energy[hole], rtol=1e-3)
        assert (first.energy[hole] > 0).all()
        strayed.append(np.median(np.abs(distance(first) - distance(whole))[hole]))
        assert np.median(np.abs(10 * np.log10(first.energy[hole] / whole.energy[hole]))) < 4.0
        np.testing.assert_array_equal(first.time_of_arrival[~hole], whole.time_of_arrival[~hole])
        np.testing.assert_array_equal(first.energy, second.energy)
    # Over six offices 0.2 to 0.6 m, over six corridors, which are seen along, 0.4 to 1 m.
    assert max(strayed) < 1.0
    assert np.median(strayed) < 0.6
    street = rooms.generate("a street", seed=2)
    refined = paths.refine(street, "a street", seed=1)
    sky = street.energy <= 0
    assert sky.sum() > 300
    assert (refined.energy[sky] > 0).mean() < 0.1


@pytest.mark.slow
def test_height_and_pitch_move_the_floor(rooms: EnvironmentDiffusion) -> None:
    """The lowest rows show the floor: near where the radar is low or looks down."""

    def floor(height: float, pitch: float) -> float:
        views = rooms.generate_many(
            ["an office"] * 6, seeds=range(6), fov_deg=80.0, position=(0.0, 0.0, height), orientation=(0.0, pitch, 0.0)
        )
        return float(np.median([distance(pir)[-6:, 24:40] for pir in views]))

    for height, pitch in ((1.0, 0.35), (1.0, 0.0), (1.8, 0.35)):
        # the middle of those rows lies some 37 degrees under the line of sight
        assert floor(height, pitch) == pytest.approx(height / np.sin(pitch + np.radians(37.0)), rel=0.05)


def test_a_sketch_keeps_space_for_somebody_which_words_alone_do_not_know_of(rooms: EnvironmentDiffusion) -> None:
    """In front of the radar nothing stands before 4 m, and without the sketch another image comes out."""
    alone = EnvironmentDiffusion(steps=8, sampler="dpm", use_layout_map=False)
    for seed in range(3):
        over = distance(rooms.generate("an office", seed=seed))[30:34, 30:34]
        assert np.nanmedian(over) > 4.0
        without = distance(alone.generate("an office", seed=seed))[30:34, 30:34]
        assert abs(np.nanmedian(over) / np.nanmedian(without) - 1.0) > 1e-3


def test_refinement_keeps_delays(rooms: EnvironmentDiffusion) -> None:
    mixed = rooms.generate("a living room", seed=1)
    refined = PathDiffusion(steps=2, samples=1).refine(mixed, "a living room", seed=1)
    there = mixed.energy > 0
    np.testing.assert_array_equal(refined.time_of_arrival[there], mixed.time_of_arrival[there])
    assert np.abs(10 * np.log10(refined.energy[there] / mixed.energy[there])).max() <= 15.0 + 1e-9


def test_refinement_brings_what_a_hurried_tracer_sees_nearer_and_leaves_complete_images_alone() -> None:
    """Places of no data set, rendered with direct returns, plain materials and a part of the things, and whole."""
    paths, falls = PathDiffusion(), []
    for number in (1, 6, 7):
        (view,) = render_layout(Settings("pairs", seed=77, views=1), number, 1)
        incomplete, whole = (
            Pir(
                *(view[name + which].astype(np.float64) for name in ("energy", "time_of_arrival", "velocity")),
                fov_deg=tuple(view["fov_deg"]),
                position=(0.0, 0.0, float(view["height"])),
                orientation=(float(view["yaw"]), float(view["pitch"]), 0.0),
            )
            for which in ("_incomplete", "")
        )
        refined, again = (paths.refine(image, view["caption"]) for image in (incomplete, whole))
        before, after = (energy_error(levels(image), levels(whole), -180.0) for image in (incomplete, refined))
        falls.append(1.0 - after / before)
        forced = PathDiffusion(judged=False).refine(whole, view["caption"]) if number == 1 else again
        change, most = (np.abs(levels(image) - levels(whole))[whole.energy > 0].mean() for image in (again, forced))
        assert change < 0.93
        assert number != 1 or most > 3 * change
    assert min(falls) > 0.0
    assert np.mean(falls) > 0.3


def test_images_are_in_the_range_of_renders(rooms: EnvironmentDiffusion) -> None:
    model = read_model()
    assert set(model.text.places) == set(PLACES)
    many = rooms.generate_many(["an office"] * 4, seeds=range(4))
    seen = Physical.of(np.stack([model.codec.encode(p) for p in many]), model.codec)
    assert 1.0 < np.nanmedian(seen.range) < 6.0


@pytest.mark.parametrize("prompt", ["an open field, a person in it", "a person in a garage"])
def test_a_place_by_its_own_name_is_known(rooms: EnvironmentDiffusion, prompt: str) -> None:
    rooms.generate(prompt, seed=1)  # warnings are errors


def test_nothing_is_imported_before_it_is_asked_for() -> None:
    code = (
        "import sys, rfgen_sionna.generative.environment, rfgen_sionna.generative.environment.environment_diffusion, "
        "rfgen_sionna.pir.codec; "
        "print([m for m in ('torch', 'diffusers', 'peft', 'transformers') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
