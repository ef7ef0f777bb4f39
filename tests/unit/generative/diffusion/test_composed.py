"""Arms and legs of a sentence apart, both hands, and no flips, with the weights that ship."""

from __future__ import annotations

import numpy as np
import pytest

from rfgen_sionna.generative.diffusion.constraints import resampled_features
from rfgen_sionna.generative.diffusion.diffusion_source import DiffusionSource
from rfgen_sionna.generative.diffusion.drafts import canonical_sentence
from rfgen_sionna.generative.diffusion.features import heading, joint_positions, turned
from rfgen_sionna.generative.diffusion.root_placement import limit_turn_rate
from rfgen_sionna.generative.motion import KinematicSource
from rfgen_sionna.generative.motion.rotations import to_matrices
from rfgen_sionna.generative.motion.skeleton import JOINT, forward_kinematics, global_rotations


@pytest.fixture(scope="module")
def source() -> DiffusionSource:
    return DiffusionSource()


def test_arms_that_are_named_move(source: DiffusionSource) -> None:
    for origin in (source, DiffusionSource(refine=None)):
        motion = origin.generate("a person walks", action="walk", arms="left_arm_raised", seed=1, duration=4.0)
        places = joint_positions(resampled_features(motion, source.model.hands))
        assert (places[:, JOINT["left_wrist"], 2] > places[:, JOINT["left_shoulder"], 2]).mean() > 0.7


@pytest.mark.parametrize(
    ("prompt", "action"),
    [
        ("a person walks straight ahead while raising the left arm", "walk_straight"),
        ("a person jumps and holds the left arm up", "jump"),
        ("a person stands on the right leg and raises the left arm", "left_leg_raised"),
    ],
)
def test_arms_and_legs_of_a_sentence_do_each_its_own(source: DiffusionSource, prompt: str, action: str) -> None:
    said = source.read(prompt)
    assert said.arms == "left_arm_raised"
    alone, both = (source.generate(p, action=a, arms=b, seed=1, duration=4.0) for p, a, b in (
        (f"a person does {action}", action, ""), (prompt, said.action, said.arms)
    ))  # fmt: skip
    assert both.action == said.action
    if said.action == action:
        ankles = [JOINT["left_ankle"], JOINT["right_ankle"]]
        stand = [joint_positions(resampled_features(m, source.model.hands)) for m in (alone, both)]
        steps = [places[:, ankles] - places[:, [JOINT["pelvis"]]] for places in stand]
        assert np.median(np.linalg.norm(steps[0] - steps[1], axis=-1)) < 0.08
    places = joint_positions(resampled_features(both, source.model.hands))
    up = {
        side: places[:, JOINT[f"{side}_wrist"], 2] > places[:, JOINT[f"{side}_shoulder"], 2]
        for side in ("left", "right")
    }
    assert up["left"].mean() > 0.7
    assert up["right"].mean() < 0.3


def test_arms_go_along_a_path_too(source: DiffusionSource) -> None:
    path = [(0.0, 0.0), (3.0, 0.0), (3.0, 2.0)]
    motion = source.generate("a person walks while raising the left arm", path=path, duration=5.0, seed=1)
    np.testing.assert_allclose(motion.translation[[0, -1], :2], [path[0], path[-1]], atol=1e-6)
    places = joint_positions(resampled_features(motion, source.model.hands))
    assert (places[:, JOINT["left_wrist"], 2] > places[:, JOINT["left_shoulder"], 2]).mean() > 0.7


@pytest.mark.parametrize("action", ["push", "circle_clockwise", "click"])
def test_both_hands_do_the_gesture_beside_each_other(source: DiffusionSource, action: str) -> None:
    spoken = source.generate(f"{canonical_sentence(action)} with both hands", seed=2, duration=4.0)
    for motion in (spoken, source(action, 4.0, 2, hand="both"), KinematicSource(60.0)(action, 4.0, 2, hand="both")):
        world = global_rotations(to_matrices(motion.rotations), motion.parents)
        places = forward_kinematics(world, motion.translation, motion.offsets, motion.parents)
        chest = world[:, JOINT["spine3"]]
        left, right = (
            (places[:, JOINT[f"{side}_wrist"]] - places[:, JOINT["spine3"]])[:, None] @ chest
            for side in ("left", "right")
        )
        np.testing.assert_allclose(left, right * [1.0, -1.0, 1.0], atol=1e-9)
        assert np.ptp(left, axis=0).max() > (0.01 if action == "click" else 0.1)
        tips = [
            [j for name, j in JOINT.items() if name.startswith(side) and name.endswith("3")]
            for side in ("left", "right")
        ]
        assert np.linalg.norm(places[:, tips[0], None] - places[:, None, tips[1]], axis=-1).min() > 0.12
    with pytest.raises(ValueError, match=r"hand: 'both' with the action 'swipe_left'; allowed are left, right"):
        source("swipe_left", 4.0, 2, hand="both")


@pytest.mark.parametrize(
    ("prompt", "action", "arms", "hand"),
    [
        ("a person runs while raising the left arm", "run", "left_arm_raised", "left"),
        ("a person pushes with the left hand while walking straight ahead", "walk_straight", "push", "left"),
        ("a person walks towards the door while pulling with the right hand", "walk_straight", "pull", "right"),
    ],
)
def test_sentences_of_two_halves_are_read_half_by_half(
    source: DiffusionSource, prompt: str, action: str, arms: str, hand: str
) -> None:
    said = source.read(prompt)
    assert (said.known, said.action, said.arms, said.hand) == (True, action, arms, hand)


@pytest.mark.parametrize(
    "prompt", ["a person raises the left arm and then jumps", "a person walks back and forth, then raises the left arm"]
)
def test_one_action_after_another_is_not_made_and_said_so(source: DiffusionSource, prompt: str) -> None:
    said = source.read(prompt)
    assert not said.known
    assert not said.arms


def test_who_runs_with_an_arm_up_runs(source: DiffusionSource) -> None:
    alone, both = (
        source.generate(p, seed=1, duration=4.0) for p in ("a person runs", "a person runs while raising the left arm")
    )
    assert np.ptp(both.translation[:, 0]) > 0.9 * np.ptp(alone.translation[:, 0]) > 3.0
    places = joint_positions(resampled_features(both, source.model.hands))
    assert (places[:, JOINT["left_wrist"], 2] > places[:, JOINT["left_shoulder"], 2]).mean() > 0.7


def test_nobody_turns_round_in_a_twentieth_of_a_second(source: DiffusionSource) -> None:
    """Neither what is made, nor rows that flip by 2 rad from one to the next."""
    motion = source.generate("a person walks back and forth while drawing circles with the left hand", seed=1)
    assert np.abs(np.gradient(heading(resampled_features(motion, source.model.hands)))).max() * 20.0 < 10.0
    rows = resampled_features(KinematicSource(20.0)("walk", 6.0, 1), source.model.hands)
    flipped = np.concatenate([rows[:60], turned(rows[60:], 2.0)])
    even = limit_turn_rate(flipped)
    assert np.abs(np.gradient(heading(even))).max() * 20.0 < 10.0
    np.testing.assert_array_equal(even[[0, -1]], flipped[[0, -1]])
    np.testing.assert_array_equal(limit_turn_rate(rows), rows)
