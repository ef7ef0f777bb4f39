"""Twenty people of both genders: they differ in height, limbs and what they return; and two of them in one scene."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest

from rfgen_sionna.radar import Radar
from rfgen_sionna.simulation import Simulator

pytest.importorskip("anny")

from rfgen_sionna.generative.actor import Actor
from rfgen_sionna.generative.bodies import Phenotype, Rig, animate, person
from rfgen_sionna.generative.motion import KinematicSource


@pytest.fixture(scope="module")
def people() -> list[Rig]:
    return [person(Phenotype(gender=("male", "female")[k % 2]), seed=k) for k in range(20)]


@pytest.fixture(scope="module")
def radar() -> Radar:
    full = Radar.load("awr1843", "mmmesh", position=(0, 0, 1), look_at=(3, 0, 1))
    return replace(
        full,
        waveform=replace(full.waveform, tx_order=(0,)),
        tx_positions=full.tx_positions[:1],
        tx_names=full.tx_names[:1],
    )


@pytest.mark.slow
def test_people_differ_in_height_and_limbs(people: list[Rig]) -> None:
    heights = np.array([p.height for p in people])
    legs = np.array([p.skeleton.leg_length() for p in people])
    arms = np.array([p.skeleton.length("left_elbow") + p.skeleton.length("left_wrist") for p in people])
    masses = np.array([p.mass for p in people])
    assert heights.std() > 0.05
    assert np.ptp(masses) > 20.0
    assert heights[::2].mean() > heights[1::2].mean() + 0.05
    # proportions differ as well: not one body in twenty sizes
    for limb in (legs, arms):
        assert limb.std() > 0.02
        assert np.std(limb / heights) / np.mean(limb / heights) > 0.01
    shapes = np.stack([heights, legs, arms, masses / 100.0], axis=1)
    assert min(np.abs(a - b).max() for a, b in combinations(shapes, 2)) > 2e-3


@pytest.mark.slow
def test_people_differ_in_cross_section(people: list[Rig], radar: Radar) -> None:
    """Mean over four azimuths and four channels, standing at 6 m: a spread of decibels, within that of adults."""
    sections = []
    for rig in people:
        sequence = animate(rig, KinematicSource(20.0)("standing", 0.5, 1, skeleton=rig.skeleton))
        powers = []
        for azimuth in np.radians([20.0, 110.0, 200.0, 290.0]):
            body = Actor(sequence, "skin", name="person", position=(6.0, 0, 0), orientation=(azimuth, 0, 0))
            paths = Simulator(None, radar, [body], rtol=1e-2).paths(0.2)
            turn = 2 * np.pi * np.mod(paths.frequency * paths.tau[..., 0], 1.0)
            channels = (paths.a[..., 0] * np.exp(-1j * turn)).sum(axis=-1)
            powers.append(np.mean(np.abs(channels) ** 2))
        sections.append(np.mean(powers) * (4 * np.pi) ** 3 * 6.0**4 / radar.wavelength**2)
    decibels = 10 * np.log10(sections)
    print("cross sections [dBsm]", np.round(np.sort(decibels), 1))
    assert np.std(decibels) > 0.5
    assert np.ptp(decibels) > 2.0
    assert -18 < np.mean(decibels) < 0


@pytest.mark.slow
def test_two_people_in_one_scene_return_what_each_does_alone(radar: Radar) -> None:
    one, other = (
        Actor.from_prompt(text, seed=k, radar=radar, duration=1.0, name=name, motion=motion)
        for k, (name, text, motion) in enumerate(
            (
                (
                    "anna",
                    "a woman draws clockwise circles, at 3 m, azimuth 25 degrees",
                    "diffusion",
                ),
                ("bert", "a man does jumping jacks, at 4 m, azimuth -25 degrees", "kinematic"),
            )
        )
    )
    frame = radar.waveform.frame_period

    def samples(*actors: Actor) -> np.ndarray:
        return Simulator(None, radar, actors, rtol=1e-2).adc(duration=frame, noise=False).data

    together, alone = samples(one, other), samples(one) + samples(other)
    assert np.linalg.norm(together - alone) < 0.02 * np.linalg.norm(alone)
    paths = Simulator(None, radar, [one, other], rtol=1e-2).paths(0.2)
    assert {"anna", "bert"} <= set(paths.object_names)
    # somebody right behind somebody else is hidden
    behind = Actor(other.sequence, "skin", name="behind", position=np.asarray(one.position) * [1.35, 1.35, 1.0])
    hidden = np.linalg.norm(samples(one, behind) - samples(one)) / np.linalg.norm(samples(behind))
    assert hidden < 0.8
