"""Variations of motions: as somebody else would do it, on the same way, with the same contacts, within joint limits."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.diffusion.pose_rows import pose_rows, turned_by
from rfgen_sionna.generative.diffusion.variation import vary
from rfgen_sionna.generative.motion import JOINT_NAMES, MEAN_ADULT, KinematicSource
from rfgen_sionna.generative.motion.clip_editing import mirrored, moved
from rfgen_sionna.generative.motion.floor_contact import floor_clearance
from rfgen_sionna.generative.motion.limits import LIMITS, joint_angles
from rfgen_sionna.generative.motion.resampling import resample_motion
from rfgen_sionna.generative.motion.rotations import to_matrices
from rfgen_sionna.generative.motion.skeleton import JOINT, NUM_BODY_JOINTS, SIDES, forward_kinematics, global_rotations
from rfgen_sionna.generative.motion_library import MotionLibrary
from rfgen_sionna.records import Motion

LIBRARY = MotionLibrary()
WALK, SQUAT, KICK, LIE = (
    LIBRARY.motion(name)
    for name in (
        "cmu_x_test_walking_1",
        "hdm05_bk_squat1Reps_014",
        "accad_m2_G3_SidekickLeadingRight",
        "accad_m1_A8_CrouchToLie",
    )
)
CLIPS = [WALK, SQUAT, KICK, LIE]


def places(motion: Motion) -> FloatArray:
    world = global_rotations(to_matrices(motion.rotations), motion.parents)
    return forward_kinematics(world, motion.translation, motion.offsets, motion.parents)


def far(motion: Motion, other: Motion) -> float:
    return float(np.sqrt(np.mean(np.sum((places(motion) - places(other)) ** 2, axis=-1))))


def test_no_strength_is_the_draft() -> None:
    assert vary(WALK, "a person walks", strength=0.0, seed=3) is WALK


def test_seeds_differ_and_each_is_reproducible() -> None:
    one, again, other = (vary(SQUAT, "a person squats", seed=seed) for seed in (1, 1, 2))
    assert np.array_equal(one.rotations, again.rotations)
    assert far(one, other) > 0.01
    assert one.seed == 1


def test_more_strength_is_farther_from_the_draft() -> None:
    away = [
        np.mean([far(vary(KICK, "a person kicks", strength=strength, seed=seed), KICK) for seed in range(3)])
        for strength in (0.15, 0.4, 0.8)
    ]
    assert 0.0 < away[0] < away[1] < away[2] < 0.5


@pytest.mark.parametrize("clip", CLIPS)
def test_way_timing_and_contacts_are_the_drafts(clip: Motion) -> None:
    varied = vary(clip, "", strength=0.7, seed=5)
    assert np.array_equal(varied.translation[:, :2], clip.translation[:, :2])
    assert varied.contacts is clip.contacts
    assert varied.duration == clip.duration
    assert np.allclose(np.linalg.norm(varied.rotations, axis=-1), 1.0)


@pytest.mark.parametrize("clip", CLIPS)
def test_planted_feet_slide_no_more_than_the_drafts(clip: Motion) -> None:
    """The mean speed of planted toes is within 1 cm/s of the draft's; legs that do not reach are the difference."""
    assert clip.contacts is not None
    before, after = places(clip), places(vary(clip, "", strength=0.6, seed=2))
    for i, side in enumerate(SIDES):
        held = clip.contacts[1:, i] & clip.contacts[:-1, i]
        old, new = (
            np.linalg.norm(np.diff(each[:, JOINT[f"{side}_foot"], :2], axis=0), axis=-1)[held].mean() * clip.frame_rate
            for each in (before, after)
        )
        assert new < old + 0.01


@pytest.mark.parametrize("clip", CLIPS)
def test_a_body_rests_where_its_draft_rests(clip: Motion) -> None:
    """Within 3 cm, and not under the floor."""
    before, after = (floor_clearance(places(each)) for each in (clip, vary(clip, "", strength=0.6, seed=2)))
    assert np.percentile(np.abs(after - before), 90) < 0.03
    assert after.min() > min(before.min(), 0.0) - 5e-3


def test_joints_stay_within_peoples_ranges() -> None:
    """Rules of movement are within the limits; so are their variations, in knees, ankles, elbows and wrists."""
    draft = KinematicSource()("pick_up", 4.0, 1)
    varied = vary(draft, "a person picks up an item", strength=0.9, seed=4)
    angles = joint_angles(global_rotations(to_matrices(varied.rotations), varied.parents))
    for name in ("knee flexion", "elbow flexion", "wrist flexion", "forearm pronation"):
        assert angles[name].min() > LIMITS[name].low - 1.0
        assert angles[name].max() < LIMITS[name].high + 1.0


def test_fingers_stay() -> None:
    draft = KinematicSource()("click", 2.0, 1)
    varied = vary(draft, "a person clicks", seed=1)
    assert varied.joint_names == JOINT_NAMES
    assert np.array_equal(varied.rotations[:, NUM_BODY_JOINTS:], draft.rotations[:, NUM_BODY_JOINTS:])


def test_a_variation_is_one_of_the_body_at_any_rate() -> None:
    """The same change of posture at 20 and at 60 Hz, and on longer legs."""
    slow, fast = vary(WALK, "", seed=1), vary(resample_motion(WALK, 60.0), "", seed=1)
    assert far(resample_motion(fast, 20.0), slow) < 0.01
    longer = replace(WALK, offsets=1.1 * WALK.offsets, translation=1.1 * WALK.translation)
    assert np.array_equal(vary(longer, "", seed=1).offsets, longer.offsets)


def test_place_and_heading_do_not_matter() -> None:
    elsewhere = moved(WALK, 2.0, np.array([3.0, -1.0]))
    rows, context = pose_rows(WALK)
    other, others_context = pose_rows(elsewhere)
    assert np.allclose(rows, other, atol=1e-9)
    assert np.allclose(context, others_context, atol=1e-9)


def test_rows_give_the_motion_that_they_describe() -> None:
    """A walk turned into the rows of its mirror image, and back."""
    rows, _ = pose_rows(WALK)
    other, _ = pose_rows(mirrored(WALK))
    assert not np.allclose(rows, other, atol=0.1)
    there = turned_by(WALK, rows, other)
    assert np.allclose(pose_rows(there)[0], other, atol=1e-6)
    assert np.allclose(places(turned_by(there, other, rows)), places(WALK), atol=1e-6)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: vary(WALK, "", strength=1.5), "strength: 1.5"),
        (lambda: vary(WALK, "", seed=-1), "seed: -1"),
        (lambda: vary(replace(WALK, frame_rate=1000.0), ""), "draft: 0.06 s"),
        (lambda: vary(replace(WALK, joint_names=WALK.joint_names[::-1]), ""), "joint_names"),
    ],
)
def test_what_cannot_be_varied_is_refused(call: Callable[[], Motion], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        call()


def test_feet_without_contacts_are_found() -> None:
    """A person who stands has both feet planted, contacts or not."""
    standing = replace(KinematicSource(20.0)("standing", 3.0, 1, skeleton=MEAN_ADULT), contacts=None)
    _, context = pose_rows(standing)
    assert context[:, 4:].mean() > 0.95
