"""Definitions of actions: true of real clips of the action, not of others, whatever the body, place or rate."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from rfgen_sionna.generative.action_definitions import DEFINED_ACTIONS, MotionSignals, check, is_true_of
from rfgen_sionna.generative.action_definitions.motion_signals import STANDING
from rfgen_sionna.generative.action_definitions.sampled_series import swings, turning_points
from rfgen_sionna.generative.motion import ACTIONS, MEAN_ADULT, KinematicSource
from rfgen_sionna.generative.motion_library import MotionLibrary
from rfgen_sionna.records import Motion
from training.motion.definitions import measure, read_clips

CLIPS = {
    "fall": "m2m_base_Death01",
    "lie_down": "hdm05_bd_lieDownFloor_001",
    "get_up": "cmu_140_01_dm",
    "sit_down": "cmu_86_09_s2",
    "stand_up": "cmu_86_09_s5",
    "crawl": "accad_f1_A11_CrawlForward",
    "squat": "hdm05_bd_squat1Reps_007",
    "walk": "cmu_02_01",
    "walk_backwards": "accad_f1_B05_WalkBackwards",
    "run": "cmu_09_01",
    "hop": "hdm05_bd_hopBothLegs1hops_001",
    "kick": "hdm05_bd_kickLFront1Reps_001",
    "punch": "accad_m2_E10_BodyHookRight",
    "pick_up": "accad_f1_A05_PickUpBox",
    "cartwheel": "accad_f1_D6_CartWheel",
    "jumping_jacks": "ad_jumping_jacks",
    "clap": "cmu_86_09_s4",
    "climb_stairs": "cmu_13_35",
    "sneak": "hdm05_bd_sneak2StepsLStart_001",
    "reach": "hdm05_bd_grabHighR_001",
}
"""A clip of each of twenty actions."""
FALSE = {
    "fall": ("lie_down", "walk", "cartwheel", "get_up"),
    "lie_down": ("fall", "get_up", "squat"),
    "stand_up": ("sit_down", "squat", "walk", "lie_down"),
    "sit_down": ("stand_up", "squat", "fall", "walk"),
    "walk": ("run", "walk_backwards", "hop", "crawl", "squat"),
    "walk_backwards": ("walk", "run"),
    "run": ("walk", "walk_backwards", "squat", "kick"),
    "kick": ("walk", "punch", "squat", "hop"),
    "punch": ("walk", "kick", "squat", "crawl"),
    "crawl": ("lie_down", "walk", "squat"),
    "jumping_jacks": ("hop", "walk", "punch"),
    "climb_stairs": ("walk", "hop", "squat"),
    "hop": ("walk", "lie_down", "punch"),
}
"""Action -> actions whose clips do not show it."""

AWAY = np.array([3.0, -2.0, 0.0])


@cache
def library() -> MotionLibrary:
    return MotionLibrary()


@cache
def signals(action: str) -> MotionSignals:
    return MotionSignals(library().motion(CLIPS[action]))


@pytest.mark.parametrize("action", CLIPS)
def test_a_real_clip_shows_its_action(action: str) -> None:
    assert check(signals(action), action).reasons == ()


@pytest.mark.parametrize(("action", "other"), [(a, o) for a, others in FALSE.items() for o in others])
def test_a_clip_of_another_action_is_refused_with_reasons(action: str, other: str) -> None:
    verdict = check(signals(other), action)
    assert not verdict
    assert verdict.reasons


def test_at_least_sixty_actions_and_all_of_the_synthesiser_are_defined() -> None:
    assert len(DEFINED_ACTIONS) >= 60
    assert set(ACTIONS) <= set(DEFINED_ACTIONS)
    assert all(each.sentence.endswith(".") for each in DEFINED_ACTIONS.values())


@pytest.mark.parametrize("action", ["t_pose", "left_arm_raised", "swipe_left", "jump", "pick_up"])
def test_motions_by_rules_show_their_action(action: str) -> None:
    source = KinematicSource(frame_rate=40.0)
    assert check(source(action, 3.0, 3), action).reasons == ()


def test_a_clip_played_backwards_sits_down_instead_of_standing_up() -> None:
    up = library().motion(CLIPS["stand_up"])
    down = replace(up, rotations=up.rotations[::-1], translation=up.translation[::-1], contacts=None)
    assert is_true_of(down, "sit_down")
    assert not is_true_of(down, "stand_up")


def test_a_walk_played_backwards_walks_backwards() -> None:
    ahead = library().motion(CLIPS["walk"])
    back = replace(ahead, rotations=ahead.rotations[::-1], translation=ahead.translation[::-1], contacts=None)
    assert is_true_of(back, "walk_backwards")
    assert not is_true_of(back, "walk")


@pytest.mark.parametrize("side", ["left", "right"])
def test_an_arm_out_to_the_side_is_horizontal_and_not_raised(side: str) -> None:
    source = KinematicSource(frame_rate=40.0)
    stand, out = source("standing", 2.0, 0), source("t_pose", 2.0, 0)
    arm = [k for k, name in enumerate(stand.joint_names) if name.startswith(side) and k >= 13]
    rotations = stand.rotations.copy()
    rotations[:, arm] = out.rotations[:, arm]
    motion = replace(stand, rotations=rotations)
    other = {"left": "right", "right": "left"}[side]
    assert is_true_of(motion, f"{side}_arm_horizontal")
    for action in (f"{other}_arm_horizontal", f"{side}_arm_raised", "t_pose", "both_arms_raised"):
        assert not is_true_of(motion, action)


@pytest.mark.parametrize(
    ("clip", "way"), [("kaykit_Death_B", "forward"), ("cmu_90_17_dm", "backward"), ("m2m_base_Death01", "backward")]
)
def test_falls_have_a_direction(clip: str, way: str) -> None:
    s = MotionSignals(library().motion(clip))
    assert [each for each in ("forward", "backward", "sideways") if is_true_of(s, f"fall_{each}")] == [way]


def test_a_fall_from_a_chair_starts_on_it() -> None:
    sitting, lying = library().motion("m2m_base_Sitting_Idle_Loop"), library().motion("accad_f1_A09_LieT2")
    drop = np.clip((np.arange(60) - 20) / 9.0, 0.0, 1.0)[:, None] ** 2  # falling in 0.45 s
    turned = (1.0 - drop[..., None]) * sitting.rotations[0] + drop[..., None] * lying.rotations[0]
    fallen = replace(
        sitting,
        rotations=turned / np.linalg.norm(turned, axis=-1, keepdims=True),
        translation=(1.0 - drop) * sitting.translation[0] + drop * lying.translation[0],
        contacts=None,
    )
    assert check(fallen, "fall_from_chair").reasons == ()
    assert not is_true_of(fallen, "lie_down")
    assert not is_true_of(fallen, "fall")  # the pelvis was never at the height of standing
    assert not is_true_of(sitting, "fall_from_chair")
    assert not is_true_of(library().motion(CLIPS["fall"]), "fall_from_chair")


def test_a_walk_with_one_slow_leg_limps() -> None:
    walk = KinematicSource(frame_rate=120.0)("walk_straight", 5.0, 2)
    assert walk.contacts is not None
    pace = np.where(walk.contacts[:, 0], 1.0, 1.8)  # the left leg swings 1.8 times as long
    when = np.concatenate([[0.0], np.cumsum(pace)[:-1]])
    order = np.rint(np.interp(np.arange(0.0, when[-1]), when, np.arange(len(when)))).astype(int)
    limping = replace(walk, rotations=walk.rotations[order], translation=walk.translation[order], contacts=None)
    assert is_true_of(limping, "limp")
    assert is_true_of(limping, "walk")
    assert not is_true_of(walk, "limp")


def mirrored(motion: Motion) -> Motion:
    """Left and right exchanged."""
    twins = {n: n.replace("left", "right") if "left" in n else n.replace("right", "left") for n in motion.joint_names}
    order = [motion.joint_names.index(twins[name]) for name in motion.joint_names]
    return replace(
        motion,
        rotations=motion.rotations[:, order] * [-1.0, 1.0, -1.0, 1.0],
        translation=motion.translation * [1.0, -1.0, 1.0],
        contacts=None,
    )


def test_left_and_right_are_the_persons() -> None:
    left = library().motion("hdm05_bd_kickLFront1Reps_001")
    assert is_true_of(left, "left_kick")
    assert not is_true_of(left, "right_kick")
    assert is_true_of(mirrored(left), "right_kick")
    swipe = KinematicSource(frame_rate=40.0)("swipe_left", 4.0, 0)
    assert not is_true_of(swipe, "swipe_right")
    assert is_true_of(mirrored(swipe), "swipe_right")


@pytest.mark.parametrize("action", ["walk", "fall", "kick", "squat", "punch"])
def test_place_and_heading_change_no_verdict(action: str) -> None:
    motion = library().motion(CLIPS[action])
    turn = Rotation.from_euler("z", 130.0, degrees=True)
    rotations = motion.rotations.copy()
    rotations[:, 0] = (turn * Rotation.from_quat(rotations[:, 0])).as_quat()
    moved = replace(motion, rotations=rotations, translation=turn.apply(motion.translation) + AWAY)
    before, after = MotionSignals(motion), MotionSignals(moved)
    assert [check(before, each).true for each in DEFINED_ACTIONS] == [
        check(after, each).true for each in DEFINED_ACTIONS
    ]


@pytest.mark.parametrize("action", ["walk", "squat", "lie_down", "crawl"])
def test_a_child_shows_what_an_adult_shows(action: str) -> None:
    motion = library().motion(CLIPS[action])
    child = replace(motion, offsets=0.6 * motion.offsets, translation=0.6 * motion.translation)
    assert is_true_of(child, action)
    assert MotionSignals(child).pelvis_height == pytest.approx(signals(action).pelvis_height, abs=1e-9)


def test_the_rate_of_poses_changes_no_verdict() -> None:
    fast = KinematicSource(frame_rate=120.0)("jumping_jacks", 4.0, 1)
    slow = replace(
        fast, rotations=fast.rotations[::4], translation=fast.translation[::4], frame_rate=30.0, contacts=None
    )
    assert is_true_of(fast, "jumping_jacks")
    assert is_true_of(slow, "jumping_jacks")


def test_a_fall_that_hovers_or_stands_again_is_refused() -> None:
    motion = library().motion(CLIPS["fall"])
    hovering = replace(motion, translation=motion.translation + np.array([0.0, 0.0, 0.3]))
    assert any("end" in reason for reason in check(hovering, "fall").reasons)
    again = replace(
        motion,
        rotations=np.concatenate([motion.rotations, motion.rotations[::-1]]),
        translation=np.concatenate([motion.translation, motion.translation[::-1]]),
        contacts=None,
    )
    assert not is_true_of(again, "fall")


def test_a_body_in_free_flight_falls_with_gravity() -> None:
    s = MotionSignals(KinematicSource(frame_rate=80.0)("jump", 4.0, 0))
    start, end = s.flights[0]
    assert s.fall_of_mass[start + 1 : end - 1].mean() == pytest.approx(9.81, rel=0.05)  # limbs move, the mass falls
    assert s.pelvis_height.max() > STANDING


def test_standing_is_measured_as_standing() -> None:
    s = MotionSignals(KinematicSource(frame_rate=40.0)("standing", 3.0, 0))
    assert s.legs == pytest.approx(1.0, abs=0.04)
    assert s.inclination.max() < 10.0
    assert s.flights == []
    assert s.speed.max() < 0.1


def test_turns_of_a_signal_are_counted_by_size() -> None:
    t = np.arange(0.0, 4.0, 0.05)
    wave = np.sin(2.0 * np.pi * t)
    assert swings(wave, 1.0) in (8, 9)  # two a period, and the ends
    assert swings(wave, 2.5) <= 0
    assert [round(t[k] * 4) % 2 for k in turning_points(wave, 1.0)[1:-1]] == [1] * len(turning_points(wave, 1.0)[1:-1])


def test_mistakes_are_named() -> None:
    motion = library().motion(CLIPS["walk"])
    with pytest.raises(ValueError, match="'moonwalk' has no definition; allowed are arm_circles"):
        check(motion, "moonwalk")
    short = replace(motion, rotations=motion.rotations[:2], translation=motion.translation[:2], contacts=None)
    with pytest.raises(ValueError, match="2 poses; at least 3"):
        check(short, "walk")
    with pytest.raises(ValueError, match="need the body's 22"):
        check(replace(motion, joint_names=tuple(f"j{k}" for k in range(22))), "walk")


def test_clicks_need_fingers() -> None:
    click = KinematicSource(frame_rate=40.0)("click", 4.0, 0)
    body = replace(
        click,
        rotations=click.rotations[:, :22],
        joint_names=click.joint_names[:22],
        parents=click.parents[:22],
        offsets=MEAN_ADULT.offsets[:22],
    )
    assert is_true_of(click, "click")
    assert any("index fingers" in reason for reason in check(body, "click").reasons)


def test_every_pattern_of_clips_finds_some() -> None:
    for action, clips in read_clips().items():
        for pattern in clips.shown:
            found = [clip for clip in library() if replace(clips, shown=(pattern,)).role(clip) == "shown"]
            assert found, f"{action}: no clip matches {pattern}"


@pytest.mark.slow
def test_definitions_are_right_on_captured_motion() -> None:
    every = {clip.name: MotionSignals(library().motion(clip.name)) for clip in library()}
    rates = measure(library(), every)
    assert sum(each.reliable for each in rates.values()) >= 38
    for action in ("walk", "run", "squat", "kick", "lie_down", "hop", "put_down", "reach", "sneak", "knee_to_elbow"):
        each = rates[action]
        assert each.true[0] >= 0.95 * each.true[1], action
        assert each.refused[0] >= 0.95 * each.refused[1], action
