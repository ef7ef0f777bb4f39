"""Prompts about animals and things: the subject picks the kind, and every word has an effect or is named."""

# A table of prompts reads best with one to a line.
# ruff: noqa: E501

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import rfgen_sionna as rfgen
from rfgen_sionna.cli import app
from rfgen_sionna.generative.prompts import PromptError
from rfgen_sionna.generative.prompts.prompt_reader import read_prompt
from rfgen_sionna.generative.prompts.thing_prompt import ThingPrompt, read_thing
from rfgen_sionna.options import default_output

UNDERSTOOD = [
    ("a drone hovers at 3 m", "drone", "hover", {"distance_m": 3.0}),
    ("A quadcopter is hovering 4 m in front of the radar", "drone", "hover", {"distance_m": 4.0}),
    ("a drone flies past at 4 m/s at 2 m above the ground", "drone", "fly", {"speed_mps": 4.0, "height_m": 2.0, "way": "past"}),
    ("a drone hovers at 2 m height", "drone", "hover", {"height_m": 2.0, "distance_m": None}),
    ("a drone at an altitude of 5 m hovers", "drone", "hover", {"height_m": 5.0, "distance_m": None}),
    ("a drone hovers, its rotors at 6000 rpm", "drone", "hover", {"values": {"turns_per_second": 100.0}}),
    ("a car drives towards the radar at 5 m/s, at 20 m", "car", "drive", {"speed_mps": 5.0, "distance_m": 20.0, "way": "to"}),
    ("a car approaches at 36 km/h", "car", "drive", {"speed_mps": 10.0, "way": "to"}),
    ("a parked car", "car", "stand", {}),
    ("there is a van parked at 6 m", "van", "stand", {"distance_m": 6.0}),
    ("a cyclist passes at 8 m at 18 km/h", "bicycle", "ride", {"speed_mps": 5.0, "way": "past"}),
    ("a person riding a bicycle towards the radar, 25 m", "bicycle", "ride", {"way": "to", "distance_m": 25.0}),
    ("a dog runs", "dog", "run", {"unused": ()}),
    ("dog running", "dog", "run", {}),
    ("the dog is barking at 2.5 m", "dog", "bark", {"distance_m": 2.5}),
    ("a dog sits down facing left", "dog", "sit_down", {"orientation_deg": 90.0}),
    ("a male dog walks away from the sensor", "dog", "walk", {"way": "away"}),
    ("a cat walks from right to left", "cat", "walk", {"way": "left"}),
    ("a horse moves at 7 m/s", "horse", "gallop", {}),
    ("a cat moves", "cat", "walk", {}),
    ("a horse comes closer at 6 m/s", "horse", "gallop", {"way": "to"}),
    ("a horse trots at an azimuth of 20 degrees", "horse", "trot", {"bearing_deg": 20.0}),
    ("a bird flies by", "bird", "fly", {"way": "past"}),
    ("a fan turns 20 times a second", "fan", "turn", {"values": {"turns_per_second": 20.0}}),
    ("a pedestal fan with 5 blades spins at 15 Hz", "fan", "turn", {"values": {"turns_per_second": 15.0, "blades": 5.0}}),
    ("a fan that is switched off", "fan", "stand", {}),
    ("a fan in a living room", "fan", "turn", {"surroundings": "living_room"}),
    ("a door opens by 60 degrees in 3 seconds", "door", "open", {"values": {"angle_deg": 60.0, "seconds": 3.0}}),
    ("a door swings shut", "door", "close", {}),
    ("a door closes slowly", "door", "close", {"speed": 0.7}),
    ("the curtains sway", "curtain", "sway", {}),
    ("a curtain moves", "curtain", "sway", {}),
    ("a robot vacuum cleans the floor", "robot_vacuum", "drive", {"unused": ()}),
    ("a pram is being pushed towards the radar at 1 m/s", "pram", "roll", {"way": "to", "speed_mps": 1.0}),
    ("a wheelchair rolls to the left", "wheelchair", "roll", {"way": "left"}),
    ("a metal corner reflector at 4 m", "corner_reflector", "stand", {"distance_m": 4.0}),
    ("a trihedral of 15 cm", "corner_reflector", "stand", {"values": {"edge": 0.15}}),
]  # fmt: skip
"""(prompt, kind, action, values)."""


@pytest.mark.parametrize(("prompt", "kind", "action", "values"), UNDERSTOOD)
def test_the_subject_picks_the_kind(prompt: str, kind: str, action: str, values: dict) -> None:
    said = read_prompt(prompt)
    assert isinstance(said, ThingPrompt)
    assert (said.target, said.action) == (kind, action)
    for name, value in values.items():
        found = getattr(said, name)
        assert (
            found == value if value is None or isinstance(value, (str, dict, tuple)) else found == pytest.approx(value)
        )


REFUSED = [
    ("a dog plays the piano", r"names none that is known of a dog \(not understood: 'plays', 'piano'\); known: walk"),
    ("two dogs run", "names 2 actors"),
    ("dogs run", "several without a number"),
    ("a dog and a cat", "names 2 actors"),
    ("a car drives towards a man", "names 2 actors"),
    ("a dog does not run", "negates"),
    ("a dog runs then sits", "joins several actions"),
    ("a dog runs and barks", r"names several \('runs', 'barks'\)"),
    ("a car drives in a circle", "'in a circle' of a car is none that is known"),
    ("a car drives backwards", "Actor.thing takes any path"),
    ("a dog sits at 2 m/s", "stays in place"),
    ("a fan turns 900 times a second", "allowed are 0 to 60"),
    ("a door sways", "names none that is known of a door"),
    ("a cat is sleeping", "names none that is known of a cat"),
    ("a dog walks at 0 m/s", r"speed: .* is 0 m/s; allowed are 0\.001 m/s"),
    ("a car drives towards the radar and away from the radar", "way: the prompt names several"),
    ("a dog runs in a spaceship", "names none that is known"),
    ("a dog runs at azimuth 120 degrees", "allowed are -90° to 90°"),
]


@pytest.mark.parametrize(("prompt", "message"), REFUSED)
def test_what_it_cannot_do_is_refused_with_what_it_can(prompt: str, message: str) -> None:
    with pytest.raises(PromptError, match=message):
        read_prompt(prompt)


@pytest.mark.parametrize(
    "prompt",
    ["a person walks a dog", "a man pushes", "she raises her arm", "a woman walks", "jumping jacks", "a person jumps"],
)
def test_people_stay_people(prompt: str) -> None:
    assert read_thing(prompt) is None


def test_speeds_out_of_reach_and_ways_to_the_radar_are_refused() -> None:
    with pytest.raises(PromptError, match=r"speed: 20.0 m/s for a dog .* run \(up to 9 m/s\)"):
        rfgen.Actor.from_prompt("a dog walks at 20 m/s")
    with pytest.raises(
        PromptError, match=r"goes 24.0 m at 8 m/s .*at most 0.* s fit there, or take a distance of at least 2"
    ):
        rfgen.Actor.from_prompt("a car drives towards the radar at 8 m/s, at 5 m", duration=3.0)
    with pytest.raises(PromptError, match="negative prompt"):
        rfgen.Actor.from_prompt("a dog runs", negative="barking")
    with pytest.raises(ValueError, match="body: the prompt is about a dog"):
        rfgen.Actor.from_prompt("a dog runs", body=rfgen.generative.Phenotype())


def test_things_are_where_they_are_said_to_be() -> None:
    car = rfgen.Actor.from_prompt("a car drives towards the radar at 5 m/s, at 20 m")
    assert car.position == pytest.approx((20.0, 0.0, 0.0))
    assert car.velocity == pytest.approx((-5.0, 0.0, 0.0))
    assert (car.name, car.action) == ("car", "drive")
    front = car.vertices(0.0)[:, 0].min()
    assert front == pytest.approx(20.0 - 2.2, abs=0.3)
    away = rfgen.Actor.from_prompt("a wheelchair rolls away at 1 m/s, at 3 m")
    assert away.velocity == pytest.approx((1.0, 0.0, 0.0))
    right = rfgen.Actor.from_prompt("a dog walks from left to right at 4 m", duration=2.0)
    middle = right.pose(1.0)[0]
    assert middle == pytest.approx((4.0, 0.0, 0.0), abs=1e-6)
    assert right.velocity[1] < 0.0  # the radar looks along +x, its right is -y
    drone = rfgen.Actor.from_prompt("a drone hovers 3 m away at a height of 2 m", floor=0.5)
    assert drone.position == pytest.approx((3.0, 0.0, 2.5))
    place = rfgen.Actor.from_prompt("a fan", position=(1, 2, 0), orientation=(0.3, 0, 0))
    assert (place.position, place.orientation) == ((1.0, 2.0, 0.0), (0.3, 0.0, 0.0))
    plain = rfgen.Actor.from_prompt("a fan", material="metal", name="cooler")
    assert plain.name == "cooler"
    assert plain.material_names == "metal"


def test_seeds_and_words_of_pace_change_speeds() -> None:
    speeds = {
        round(float(np.linalg.norm(rfgen.Actor.from_prompt("a dog walks", seed=k).velocity)), 4) for k in range(4)
    }
    assert len(speeds) == 4
    slow, fast = (rfgen.Actor.from_prompt(f"a dog walks {word}") for word in ("slowly", "fast"))
    assert np.linalg.norm(fast.velocity) / np.linalg.norm(slow.velocity) == pytest.approx(1.3 / 0.7)
    slow, fast = (rfgen.Actor.from_prompt(f"a fan turns {word}").thing_record for word in ("slowly", "fast"))
    assert slow is not None
    assert fast is not None
    assert fast.values["turns_per_second"] / slow.values["turns_per_second"] == pytest.approx(1.3 / 0.7)


def test_the_report_has_every_decision_with_its_origin() -> None:
    text = rfgen.Actor.from_prompt("the small dog runs towards the radar at 6 m", duration=1.0).report()
    assert "not understood, no effect: small" in text
    for row in ("action        run: runs", "way           towards the radar", "height, at the shoulder"[:6]):
        assert row in text
    assert "drawn from seed 0" in text
    assert default_output(read_prompt("a dog runs")) == "dog_run.h5"


def test_the_command_lists_and_draws(tmp_path: Path) -> None:
    runner = CliRunner()
    listed = runner.invoke(app, ["things"], env={"COLUMNS": "200"})
    assert listed.exit_code == 0
    assert all(name in listed.output for name in rfgen.things())
    shown = runner.invoke(app, ["things", "drone", "--draw", str(tmp_path / "drone.png")])
    assert shown.exit_code == 0
    assert "turns of a rotor a second" in " ".join(shown.output.split())
    assert (tmp_path / "drone.png").stat().st_size > 5000
    again = runner.invoke(app, ["things", "drone", "--draw", str(tmp_path / "drone.png")])
    assert isinstance(again.exception, FileExistsError)
    assert isinstance(runner.invoke(app, ["things", "dragon"]).exception, ValueError)
