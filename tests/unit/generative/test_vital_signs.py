"""Breathing and heartbeat: rates, depths and places on the body, by arguments and by words."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import rfgen_sionna as rfgen
from rfgen_sionna.dataset.actor_labels import actor_labels
from rfgen_sionna.generative import MotionLibrary
from rfgen_sionna.generative.bodies import Phenotype, Rig, VitalSigns, animate, person
from rfgen_sionna.generative.motion import KinematicSource
from rfgen_sionna.generative.prompts import PromptError, read_prompt
from rfgen_sionna.processing import displacement


@pytest.fixture(scope="module")
def rig() -> Rig:
    return person(Phenotype(height=1.75), seed=0)


@settings(deadline=None, max_examples=4)
@given(st.floats(6, 40), st.floats(45, 150), st.integers(0, 99))
def test_cycles_have_the_rate_and_the_range(breaths: float, beats: float, seed: int) -> None:
    signs = VitalSigns(breaths, beats, seed=seed)
    t = np.arange(0.0, 120.0, 0.03)
    for values, rate in (([signs.volume(x) for x in t], breaths), ([signs.pulse(x) for x in t], beats)):
        series = np.array(values)
        assert series.min() >= 0
        assert series.max() == pytest.approx(1.0, abs=0.1)
        crossings = np.sum((series[1:] >= 0.5) & (series[:-1] < 0.5))
        assert crossings / 2 == pytest.approx(rate, abs=0.03 * rate + 1.0)


def test_breaths_differ_by_the_variability() -> None:
    signs = VitalSigns(15.0, variability=0.05)
    t = np.arange(0.0, 1200.0, 0.02)
    series = np.array([signs.volume(x) for x in t])
    starts = t[1:][(series[1:] >= 0.5) & (series[:-1] < 0.5)]
    assert np.diff(starts).std() / np.diff(starts).mean() == pytest.approx(0.05, abs=0.01)
    steady = VitalSigns(15.0, variability=0.0)
    assert steady.volume(4.0) == pytest.approx(steady.volume(0.0))


def test_chest_and_belly_move_outwards_and_nothing_else(rig: Rig) -> None:
    motion = KinematicSource()("standing", 4.0, 0, skeleton=rig.skeleton)
    signs = VitalSigns(15.0, 0.0, belly_depth=8e-3, chest_depth=4e-3, variability=0.0)
    still, alive = animate(rig, motion), animate(rig, motion, signs)
    t = max(np.arange(0.0, 4.0, 0.05), key=signs.volume)
    moved = alive.vertices(t) - still.vertices(t)
    size = np.linalg.norm(moved, axis=1)
    assert size.max() == pytest.approx(8e-3, abs=1e-3)
    parts = {rig.part_names[p] for p in np.unique(rig.face_parts[np.any(size[rig.faces] > 1e-3, axis=1)])}
    assert "torso" in parts
    assert not {"head", "left_hand", "right_foot", "left_shank"} & parts
    back = still.vertices(t)[:, 0] < still.joints(t)[0, 0] - 0.05
    assert size[back].max() < 5e-4
    assert moved[size > 2e-3, 0].min() > 0  # ahead


def test_the_skin_is_smooth_in_time(rig: Rig) -> None:
    alive = animate(rig, KinematicSource()("standing", 4.0, 0, skeleton=rig.skeleton), VitalSigns(20.0, 90.0))
    t = np.linspace(1.0, 1.1, 21)
    series = np.array([alive.vertices(x) for x in t])
    assert np.abs(np.diff(series, 2, axis=0)).max() / 0.005**2 < 3.0  # [m/s^2]


@pytest.mark.parametrize(
    ("words", "breathing", "heart"),
    [
        ("a person stands and breathes 15 times a minute, at 1.5 m", 15.0, None),
        ("a person stands, breathing at 12 breaths per minute, heart rate 70", 12.0, 70.0),
        ("a woman stands with a heart rate of 65 bpm and a breathing rate of 18", 18.0, 65.0),
        ("a person stands and holds their breath", 0.0, None),
        ("a person breathes twenty times per minute", 20.0, None),
        ("a person stands, breathing at 0.25 Hz", 15.0, None),
        ("a person stands, breathing rate of 0.25 Hz, heart rate 1.2 Hz", 15.0, 72.0),
        ("a person breathes 0.3 times a second", 18.0, None),
        ("a person stands", None, None),
    ],
)
def test_words_give_rates(words: str, breathing: float | None, heart: float | None) -> None:
    said = read_prompt(words)
    assert (said.action, said.breathing_rate, said.heart_rate) == ("standing", breathing, heart)
    assert said.unused == ()


@pytest.mark.parametrize("words", ["a person stands and breathes 300 times a minute", "a person sits, heart rate 5 Hz"])
def test_rates_beyond_people_are_refused_as_they_are_read(words: str) -> None:
    with pytest.raises(PromptError, match="allowed are"):
        read_prompt(words)


@pytest.mark.parametrize(
    ("field", "value"), [("breathing_rate", 200.0), ("heart_rate", -1.0), ("belly_depth", 6.0), ("variability", 1.0)]
)
def test_rates_and_depths_of_no_person_are_refused(field: str, value: float) -> None:
    with pytest.raises(ValueError, match=rf"vital_signs\.{field} is"):
        VitalSigns(**{field: value})


def test_labels_hold_rate_and_displacement() -> None:
    radar = rfgen.Radar.load("awr1843", position=(0, 0, 1), look_at=(3, 0, 1))
    living = rfgen.Actor.from_prompt("a person stands and breathes 12 times a minute, heart rate 70", radar=radar)
    labels = actor_labels([living, living.with_vital_signs(None)], radar, 0.7)
    assert labels["breathing_rate"][0] == 12
    assert labels["heart_rate"][0] == 70
    assert living.vital_signs is not None
    assert labels["chest_displacement"][0] == living.vital_signs.chest_displacement(0.7)
    assert np.isnan(labels["chest_displacement"][1])


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:displacement. the samples lie on no clear circle")
@pytest.mark.parametrize(("clip", "away"), [("cmu_14_30", (-1.5, 0.0, 0.0)), ("m2m_addon_Sleeping", (0.0, 0.0, 1.5))])
def test_breaths_and_beats_are_found(rig: Rig, clip: str, away: tuple[float, float, float]) -> None:
    """12 breaths and 70 beats a minute, each within 0.5 a minute, of somebody who sits before a radar, or lies under it
    on the back."""
    moving = MotionLibrary().motion(clip)
    frame = [20, 20]
    pose = replace(
        moving, rotations=moving.rotations[frame], translation=moving.translation[frame], contacts=None
    )  # fmt: skip
    signs = VitalSigns(12.0, 70.0, heart_depth=5e-4, variability=0.0)
    actor = rfgen.Actor.from_motion(pose, body=rig, position=(1.5, 0.0, 0.0), orientation=(np.pi, 0.0, 0.0))
    chest = actor.joints(0.0)[actor.joint_names.index("spine3")]
    changes = {"num_loops": 1, "tx_order": ["TX1"], "num_samples": 128}
    radar = rfgen.Radar.load(
        "iwr6843isk", position=tuple(chest + away), look_at=tuple(chest),
        overrides={f"preset.out_of_box.{key}": value for key, value in changes.items()},
    )  # fmt: skip
    with pytest.warns(UserWarning, match="holds its pose"):
        cube = rfgen.Simulator(None, radar, [actor.with_vital_signs(signs)], rtol=0.03).adc(duration=30.0, seed=0)
    found = displacement(cube.data, radar)
    assert 60 * found.rate() == pytest.approx(12.0, abs=0.5)
    assert 60 * found.rate(0.8, 2.0, without=found.rate()) == pytest.approx(70.0, abs=0.5)
