"""Edits of clips: what stays, what changes, and joins without jumps."""

from __future__ import annotations

import numpy as np
import pytest

from rfgen_sionna.generative.motion.clip_editing import (
    at_pace,
    cut,
    flights,
    headings,
    held,
    joined,
    joint_places,
    likeness,
    mirrored,
    moved,
    placed,
    pose_features,
    scaled,
)
from rfgen_sionna.generative.motion.skeleton import JOINT
from rfgen_sionna.generative.motion_library import MotionLibrary

CLIP = MotionLibrary().motion("hdm05_bd_squat1Reps_002")
JUMP = MotionLibrary().motion("cmu_13_11")


def test_the_mirror_image_of_a_mirror_image_is_the_motion() -> None:
    twice = mirrored(mirrored(CLIP))
    assert np.allclose(twice.rotations, CLIP.rotations)
    assert np.allclose(twice.translation, CLIP.translation)
    left, right = (joint_places(motion) for motion in (CLIP, mirrored(CLIP)))
    assert np.allclose(left[:, JOINT["left_wrist"]] * [1, -1, 1], right[:, JOINT["right_wrist"]], atol=1e-9)


def test_twice_the_pace_takes_half_the_time() -> None:
    assert at_pace(CLIP, 2.0).duration == pytest.approx(0.5 * CLIP.duration, abs=0.05)


def test_size_one_changes_nothing_and_a_smaller_one_lessens_the_turns() -> None:
    same = scaled(CLIP, np.ones(22), 1.0)
    assert np.allclose(joint_places(same), joint_places(CLIP), atol=1e-6)
    less = scaled(CLIP, np.full(22, 0.5), 0.5)
    assert np.ptp(less.translation[:, 2]) == pytest.approx(0.5 * np.ptp(CLIP.translation[:, 2]), rel=1e-6)
    knee = [np.ptp(each.rotations[:, JOINT["left_knee"]], axis=0).max() for each in (CLIP, less)]
    assert knee[1] < 0.7 * knee[0]


def test_a_placed_motion_starts_at_the_origin_facing_x() -> None:
    motion = placed(moved(CLIP, 2.0, np.array([3.0, -1.0])), way=False)
    assert np.allclose(motion.translation[0, :2], 0.0)
    assert abs(headings(motion)[:6].mean()) < 1e-6


def test_a_join_goes_on_in_place_heading_and_velocity() -> None:
    first, second = cut(CLIP, 0, 12), moved(cut(JUMP, 5, 40), 1.0, np.array([5.0, 5.0]))
    both = joined(first, second)
    assert len(both.translation) == 12 + 35
    places = joint_places(both)
    steps = np.linalg.norm(np.diff(places, axis=0), axis=-1) * both.frame_rate
    around, elsewhere = steps[10:13].max(), np.linalg.norm(np.diff(joint_places(second), axis=0), axis=-1).max() * 20
    assert around < max(2.0, elsewhere)
    turned = headings(both)[-1] - headings(both)[11]
    assert turned == pytest.approx(headings(second)[-1] - headings(second)[0], abs=0.3)


def test_the_pose_of_a_clip_is_nearest_to_itself() -> None:
    features = pose_features(CLIP)
    away = likeness(features, features)
    assert np.all(np.argmin(away, axis=1) == np.arange(len(features)))
    assert np.allclose(np.diag(away), 0.0, atol=1e-6)


def test_who_is_held_comes_to_rest() -> None:
    still = held(cut(CLIP, 0, 15), 60, np.zeros((60, 22, 3)))
    speed = np.linalg.norm(np.diff(joint_places(still), axis=0), axis=-1).max(axis=1) * still.frame_rate
    assert speed[-40:].max() < 1e-6
    assert np.allclose(still.rotations[:15], CLIP.rotations[:15])


def test_flights_are_where_no_foot_is_planted() -> None:
    found = flights(JUMP)
    assert found
    assert JUMP.contacts is not None
    assert all(not JUMP.contacts[a:b].any() for a, b in found)
