"""Motions that are too weak, or another movement, are not called by the name of an action."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from rfgen_sionna.generative.action_definitions import MotionSignals, check, is_true_of
from rfgen_sionna.generative.motion_library import MotionLibrary
from rfgen_sionna.records import Motion


@cache
def clip(name: str) -> Motion:
    return MotionLibrary().motion(name)


def slowed(motion: Motion, factor: float) -> Motion:
    """The same poses, `factor` times as long."""
    return replace(motion, frame_rate=motion.frame_rate / factor)


@pytest.mark.parametrize(
    ("action", "name", "factor", "reason"),
    [
        ("kick", "hdm05_bd_kickLFront1Reps_001", 2.0, "fastest ankle of a raised foot"),
        ("punch", "m2m_base_Punch_Cross", 2.5, "fast strikes of a hand"),
        ("throw", "m2m_addon_Throw_Object", 5.0, "fastest hand ahead or up"),
        ("run", "cmu_09_01", 3.0, "90th percentile of the speed"),
        ("fall", "m2m_base_Death01", 3.0, "fastest descent of the head"),
        ("faint", "m2m_base_Death01", 3.0, "fastest descent of the head"),
    ],
)
def test_in_slow_motion_it_is_another_action(action: str, name: str, factor: float, reason: str) -> None:
    assert check(clip(name), action).reasons == ()
    reasons = check(slowed(clip(name), factor), action).reasons
    assert any(each.startswith(reason) for each in reasons)


@pytest.mark.parametrize("rate", [25.0, 50.0])
def test_strikes_are_the_same_at_other_rates(rate: float) -> None:
    kick = clip("hdm05_bd_kickLFront1Reps_001")
    frames = np.arange(0.0, kick.duration, 1.0 / rate) * kick.frame_rate
    low = np.minimum(frames.astype(int), len(kick.translation) - 2)
    part = (frames - low)[:, None]
    turned = (1 - part[..., None]) * kick.rotations[low] + part[..., None] * kick.rotations[low + 1]
    resampled = replace(
        kick,
        rotations=turned / np.linalg.norm(turned, axis=-1, keepdims=True),
        translation=(1 - part) * kick.translation[low] + part * kick.translation[low + 1],
        frame_rate=rate,
        contacts=None,
    )
    assert is_true_of(resampled, "left_kick")


def test_both_hands_throw_as_one_does() -> None:
    assert is_true_of(clip("hdm05_tr_throwBasketball_012"), "throw")  # a set shot, at 1 m/s of each hand
    assert is_true_of(clip("sl_throw_R"), "throw")
    assert not is_true_of(clip("hdm05_bd_squat1Reps_007"), "throw")


def test_a_dance_is_more_than_walking_and_less_than_standing_still() -> None:
    assert is_true_of(clip("cmu_x_salsa_02"), "dance")
    for name in ("cmu_02_01", "m2m_base_Idle_Loop", "hdm05_bk_depositFloorR_010"):
        assert not is_true_of(clip(name), "dance")


def test_a_box_keeps_the_distance_of_the_hands() -> None:
    walking = clip("accad_f1_B20_WalkWithBox")
    assert is_true_of(walking, "carry")
    assert MotionSignals(walking).hands_apart.std() < 0.02
    assert not is_true_of(clip("cmu_09_01"), "carry")


def test_a_faint_sinks_on_its_knees_and_a_plank_falls() -> None:
    assert is_true_of(clip("m2m_base_Death01"), "faint")
    stiff = clip("cmu_90_16_dm")  # onto a mat, with straight legs
    assert is_true_of(stiff, "fall")
    assert any("bend of a knee" in reason for reason in check(stiff, "faint").reasons)


def test_who_lies_is_calm() -> None:
    lying = clip("accad_m2_A9_Lie")
    assert is_true_of(lying, "lie")
    places = lying.translation + np.sin(np.arange(len(lying.translation)))[:, None] * [0.1, 0.0, 0.0]
    assert any("mean speed" in reason for reason in check(replace(lying, translation=places), "lie").reasons)


def test_a_high_stool_is_a_seat() -> None:
    assert is_true_of(clip("cmu_14_27"), "sit_and_stand")
    assert not is_true_of(clip("cmu_13_33"), "sit_and_stand")  # on a ladder
