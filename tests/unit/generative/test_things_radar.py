"""What a radar sees of things: micro-Doppler of wheels, rotors, doors and legs, and the return of a corner."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import rfgen_sionna as rfgen
from rfgen_sionna._types import SPEED_OF_LIGHT, FloatArray


def radar_24() -> rfgen.Radar:
    """Continuous wave at 24 GHz, 1 m over the floor, looking along +x."""
    chosen = {"preset.doppler.num_loops": 16}
    return rfgen.Radar.load("position2go", preset="doppler", overrides=chosen, position=(0, 0, 1), look_at=(3, 0, 1))


def speeds(actor: rfgen.Actor, t: float = 0.0, part: str = "") -> FloatArray:
    """(path,) radial velocities of direct returns [m/s], of parts whose names begin so."""
    paths = rfgen.Simulator(None, radar_24(), [actor], rtol=0.05).paths(t)
    chosen = np.array([paths.part_names[k].startswith(part) for k in paths.part_id])
    return paths.velocity[chosen, 0]


def test_wheels_of_a_car_return_from_rest_to_twice_its_speed() -> None:
    car = rfgen.Actor.thing("car", speed=6.0, position=(12, 0, 0))
    body, wheels = speeds(car, part="body"), speeds(car, part="front left wheel")
    assert np.allclose(body, -6.0, atol=0.3)
    assert -12.0 <= wheels.min() < -10.5
    assert wheels.max() < 0.2


def test_the_rotor_of_a_drone_returns_up_to_the_speed_of_its_tips() -> None:
    drone = rfgen.Actor.thing("drone", position=(3, 0, 1.2), turns_per_second=80.0, rotor_diameter=0.24, drift=0.0)
    tip = 2 * np.pi * 80.0 * 0.12
    found = np.concatenate([speeds(drone, t, "rotor") for t in (0.0, 0.0011, 0.0023, 0.0037)])
    assert 0.85 * tip < np.abs(found).max() < 1.03 * tip
    assert found.min() < -0.7 * tip < 0.7 * tip < found.max()
    assert np.abs(speeds(drone, part="body")).max() < 1e-6


def test_a_fan_seen_from_its_front_moves_across() -> None:
    """Blades that turn in the plane across the line of sight have little radial speed, from aside their full one."""
    tip = 2 * np.pi * 20.0 * 0.2
    ahead = rfgen.Actor.thing("fan", turns_per_second=20.0, diameter=0.4, height=1.0, position=(3, 0, 0))
    aside = rfgen.Actor.thing(
        "fan", turns_per_second=20.0, diameter=0.4, height=1.0, position=(3, 0, 0), orientation=(np.pi / 2, 0, 0)
    )
    assert np.abs(speeds(ahead, part="blades")).max() < 0.15 * tip
    found = np.concatenate([speeds(aside, t, "blades") for t in (0.0, 0.004, 0.008)])
    assert 0.7 * tip < np.abs(found).max() < 1.1 * tip


def test_a_door_returns_up_to_the_speed_of_its_edge() -> None:
    door = rfgen.Actor.thing("door", position=(3, 0, 0), angle_deg=60.0, seconds=1.0, start=0.0, width=0.86)
    edge = 15 / 8 * np.radians(60.0) * 0.86
    found = speeds(door, 0.5, "leaf")
    assert found.min() == pytest.approx(-edge * np.cos(np.radians(30.0)), abs=0.25)
    assert np.abs(speeds(door, 0.5, "frame")).max() < 1e-6


def test_legs_of_a_walking_dog_go_faster_than_its_body_and_stand() -> None:
    dog = rfgen.Actor.thing("dog", position=(4, 0, 0), seed=1)
    pace = float(np.linalg.norm(dog.velocity))
    body = speeds(dog, 0.2, "torso")
    legs = np.concatenate([speeds(dog, t, "") for t in (0.2, 0.45)])
    assert body.mean() == pytest.approx(-pace, abs=0.3 * pace)
    assert legs.min() < -1.8 * pace
    assert legs.max() > -0.2 * pace


@pytest.mark.parametrize(("edge", "distance"), [(0.1, 4.0), (0.15, 5.0)])
def test_a_corner_reflector_returns_what_its_closed_form_says(edge: float, distance: float) -> None:
    """Within 1 dB of 4 pi a^4 / (3 lambda^2) on its axis, by three bounces; edges of 8 wavelengths and more ripple."""
    corner = rfgen.Actor.thing("corner_reflector", edge=edge, position=(distance, 0, 1))
    paths = rfgen.Simulator(None, radar_24(), [corner], rtol=0.01, max_bounces=3).paths(0.0)
    gain = np.sum(paths.a[0, 0, :, 0] * np.exp(-2j * np.pi * paths.frequency * paths.tau[0, 0, :, 0]))
    wavelength = SPEED_OF_LIGHT / paths.frequency
    section = 4 * np.pi * edge**4 / (3 * wavelength**2)
    expected = wavelength**2 * section / ((4 * np.pi) ** 3 * distance**4)
    assert 10 * np.log10(abs(gain) ** 2 / expected) == pytest.approx(0.0, abs=1.0)


@pytest.mark.parametrize(
    ("prompt", "kind", "action"),
    [("a door opens", "door", "open"), pytest.param("a dog runs at 5 m", "dog", "run", marks=pytest.mark.slow)],
)
def test_labels_of_a_run_have_the_thing_and_its_action(tmp_path: Path, prompt: str, kind: str, action: str) -> None:
    """Never a person's; and an actor of several materials is written."""
    with rfgen.generate(prompt, duration=0.1, output=tmp_path / "run.h5", environment="none", device="cpu") as run:
        assert list(run.actors) == [kind]
        assert run.labels["action"].values[0, 0] == action
        assert "person" not in str(run.report)
