"""Bodies on the floor: whatever carries them touches it, nothing goes under it, flights stay flights."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d

from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.bodies import Phenotype, Rig, animate, person
from rfgen_sionna.generative.bodies.body_support import part_heights
from rfgen_sionna.generative.bodies.retarget import joint_rotations, root_translation
from rfgen_sionna.generative.bodies.sequence import BodySequence
from rfgen_sionna.generative.motion import MEAN_ADULT, KinematicSource
from rfgen_sionna.generative.motion_library import MotionLibrary
from rfgen_sionna.generative.performing import perform, performable

PEOPLE = {
    "child": Phenotype(age=6.0),
    "adult": Phenotype(gender=0.5, age=35.0, height=1.7, weight=68.0),
    "heavy": Phenotype(gender="male", height=1.92, weight=120.0),
}
CARRIED = {
    "on the back": "accad_f1_A09_LieT2",
    "asleep": "m2m_addon_Sleeping",
    "lying down": "accad_m2_A8_CrouchToLie",
    "lying down by hdm05": "hdm05_bd_lieDownFloor_003",
    "getting up": "accad_m2_A10_LieToCrouch",
    "getting up from the stomach": "cmu_139_17_dm",
    "crawling": "accad_m1_A11_CrawlForward",
    "push-ups": "m2m_addon_Pushup",
    "kneeling": "m2m_addon_Kneeling_Tired",
    "sitting": "cmu_86_09_s3",
    "sitting down": "sl_sit_generic",
    "squatting": "hdm05_bd_squat1Reps_001",
}
"""Clips without a flight."""
LEAVES = {"climb_stairs", "climb_ladder"}
"""Actions that end over the floor."""


@cache
def body(name: str) -> Rig:
    return person(PEOPLE[name], seed=0)


def lowest(rig: Rig, sequence: BodySequence, rate: float = 40.0) -> FloatArray:
    """(time,) height of the lowest vertex that can touch the floor [m]."""
    times = np.arange(0.0, sequence.duration, 1.0 / rate)
    joints = np.stack([sequence.joint_rotations(t) for t in times])
    roots = np.stack([sequence.pose(t)[1] for t in times])
    return np.asarray(np.min(list(part_heights(rig, joints, roots).values()), axis=0))


def rested(clip: str, person_name: str) -> tuple[BodySequence, FloatArray]:
    rig = body(person_name)
    sequence = animate(rig, MotionLibrary().motion(clip))
    return sequence, lowest(rig, sequence)


def test_heights_of_parts_are_those_of_the_skin() -> None:
    rig = body("adult")
    sequence = animate(rig, MotionLibrary().motion("accad_f1_A08_CrouchToLie"))
    for t in (0.0, 2.0, 5.0):
        heights = part_heights(rig, sequence.joint_rotations(t)[None], sequence.pose(t)[1][None])
        assert min(h[0] for h in heights.values()) == pytest.approx(sequence.vertices(t)[:, 2].min(), abs=1e-3)


@pytest.mark.parametrize(
    "name", [pytest.param(each, marks=[pytest.mark.slow] * (k % 2)) for k, each in enumerate(CARRIED)]
)
def test_what_carries_a_body_is_on_the_floor(name: str) -> None:
    _, heights = rested(CARRIED[name], "adult")
    assert heights.min() > -0.02
    assert np.mean(heights < 0.03) > 0.97


@pytest.mark.parametrize("person_name", ["child", pytest.param("heavy", marks=pytest.mark.slow)])
def test_bodies_of_any_size_lie_on_the_floor(person_name: str) -> None:
    for clip in ("accad_f1_A09_LieT2", "hdm05_bd_lieDownFloor_002"):
        _, heights = rested(clip, person_name)
        assert heights.min() > -0.02
        assert heights.max() < 0.03


def test_who_lies_keeps_still() -> None:
    """No jumps that a radar would see: the clip itself moves the pelvis by less than 5 cm/s."""
    sequence, _ = rested("accad_m1_A9_LieDown", "adult")
    speed = np.abs(np.diff(sequence.translation[:, 2])) * sequence.frame_rate
    assert speed.max() < 0.1


def test_a_body_on_its_way_down_gains_little_speed() -> None:
    rig, motion = body("heavy"), MotionLibrary().motion("hdm05_bd_lieDownFloor_002")
    added = animate(rig, motion).translation[:, 2] - root_translation(motion, rig.skeleton)[:, 2]
    speed = np.abs(np.diff(gaussian_filter1d(added, 1.0))) * motion.frame_rate
    assert np.percentile(speed, 95) < 0.2


def test_flights_stay_flights() -> None:
    clip = "cmu_13_39"
    _, heights = rested(clip, "adult")
    source = MotionLibrary().motion(clip).translation[:, 2]
    assert heights.max() == pytest.approx(source.max() - np.median(source), abs=0.2)
    assert heights.max() > 0.25
    assert np.median(heights) == pytest.approx(0.0, abs=0.01)


def test_who_climbs_stays_up() -> None:
    _, heights = rested("cmu_13_35", "adult")
    assert heights.max() > 0.5


def test_a_body_that_hovers_comes_down() -> None:
    """As in recordings with a wrong floor: who lies 0.3 m too high lies on the floor."""
    motion = MotionLibrary().motion("accad_f1_A08_CrouchToLie")
    falls = np.interp(np.arange(len(motion.translation)), [0, 40, 60, 200], [0.0, 0.0, 0.3, 0.3])
    hovering = replace(motion, translation=motion.translation + falls[:, None] * [0.0, 0.0, 1.0])
    rig = body("adult")
    heights = lowest(rig, animate(rig, hovering))
    assert heights[-1] == pytest.approx(0.0, abs=0.02)
    assert heights.min() > -0.02


def test_a_motion_for_the_body_that_is_on_the_floor_stays_as_it_is() -> None:
    rig = body("adult")
    motion = KinematicSource(30.0)("jump", 2.0, 0, skeleton=rig.skeleton)
    np.testing.assert_array_equal(animate(rig, motion).translation, motion.translation)


def test_hands_are_bent_up_instead_of_going_through_the_floor() -> None:
    rig, motion = body("adult"), MotionLibrary().motion("accad_f1_A11_CrawlForward")
    own = part_heights(rig, joint_rotations(motion), root_translation(motion, rig.skeleton))
    assert min(own["left_hand"].min(), own["right_hand"].min()) < -0.1
    _, heights = rested("accad_f1_A11_CrawlForward", "adult")
    assert heights.min() > -0.02


@pytest.mark.slow
@pytest.mark.parametrize("person_name", PEOPLE)
@pytest.mark.parametrize("action", sorted(performable()))
def test_every_action_is_done_on_the_floor(action: str, person_name: str) -> None:
    rig = body(person_name)
    for seed in (0, 1):
        heights = lowest(rig, animate(rig, perform(action, 4.0, seed, skeleton=rig.skeleton)))
        assert heights.min() > -0.025
        if action not in LEAVES:
            assert np.percentile(heights, 30) < 0.03


def test_sizes_of_the_bodies_differ() -> None:
    assert body("child").skeleton.leg_length() < 0.65 * MEAN_ADULT.leg_length()
    assert body("heavy").mass > 110.0
