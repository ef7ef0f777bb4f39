"""Daily actions of arms by rules: what they show, how fast, how often, in which manner, each seed in its way."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest

from rfgen_sionna.generative.action_definitions import DEFINED_ACTIONS, MotionSignals, check, is_true_of
from rfgen_sionna.generative.action_definitions.sampled_series import RATE, turning_points
from rfgen_sionna.generative.manner import Manner
from rfgen_sionna.generative.motion import ACTIONS, KinematicSource
from rfgen_sionna.generative.motion.arm_actions import CIRCLES, FINGER_SWING, GESTURES, SWIPES
from rfgen_sionna.generative.motion.limits import LIMITS, joint_angles
from rfgen_sionna.generative.motion.rotations import to_matrices
from rfgen_sionna.generative.motion.skeleton import JOINT, SIDES, global_rotations
from rfgen_sionna.records import Motion

source = KinematicSource(60.0)
DAILY = [name for name in ACTIONS if name in GESTURES]
HORIZONTAL = [f"{side}_arm_horizontal" for side in SIDES]
MANNERS = (
    Manner(), Manner(amplitude=0.6), Manner(amplitude=1.4), Manner(speed=0.7), Manner(speed=1.4), Manner(tired=True),
)  # fmt: skip


def made(action: str, duration: float, seed: int, **manner) -> MotionSignals:
    return MotionSignals(source(action, duration, seed, manner=Manner(**manner)))


def hand_speed(s: MotionSignals) -> np.ndarray:
    """(sample,) of the faster hand in the world [m/s]."""
    return np.linalg.norm(np.gradient(s.pair("wrist"), axis=0) * RATE, axis=-1).max(axis=1)


@pytest.mark.parametrize("action", [*DAILY, *HORIZONTAL])
@pytest.mark.parametrize(("duration", "seed"), [(2.0, 4), pytest.param(5.0, 11, marks=pytest.mark.slow)])
def test_rules_show_the_action_of_their_name(action, duration, seed):
    assert check(source(action, duration, seed), action).reasons == ()


@pytest.mark.slow
@pytest.mark.parametrize("action", [*DAILY, *HORIZONTAL])
def test_every_seed_length_and_manner_shows_the_action(action):
    for seed in range(20):
        motion = source(action, (2.0, 3.0, 4.5, 6.0, 8.0)[seed % 5], seed, manner=MANNERS[seed % len(MANNERS)])
        assert check(motion, action).reasons == (), seed


@pytest.mark.parametrize(
    ("action", "least", "most"),
    [("wave", 0.5, 2.5), ("clap", 0.7, 2.8), ("sweep", 0.4, 2.0), ("boxing", 2.2, 5.5), ("type", 0.05, 0.6)],
)
def test_hands_move_as_fast_as_people_move_them(action, least, most):
    """95th percentile of the speed; clips: waves 1.1 to 1.8 m/s, claps 0.5 to 2.6, boxing 4.2, typing 0.4."""
    for seed in range(3):
        assert least < np.percentile(hand_speed(made(action, 4.0, seed)), 95) < most


@pytest.mark.parametrize("seed", range(3))
def test_punches_and_throws_are_the_fastest(seed):
    assert 3.5 < hand_speed(made("boxing", 4.0, seed)).max() < 8.0
    assert 4.0 < hand_speed(made("throw", 4.0, seed)).max() < 10.0


@pytest.mark.parametrize("rate", [60.0, 120.0])
def test_claps_come_as_often_as_they_are_asked_for(rate):
    apart = made("clap", 8.0, 2, rate=rate).hands_apart
    meets = [k for k in turning_points(apart, 0.08) if apart[k] < 0.2]
    assert 60.0 * RATE / np.mean(np.diff(meets)) == pytest.approx(rate, rel=0.05)
    assert apart[meets].max() < 0.13  # wrists of flat hands that touch


def test_jumps_come_as_often_as_they_are_asked_for():
    contacts = source("jump", 10.0, 1, manner=Manner(rate=30.0, amplitude=0.6)).contacts
    assert contacts is not None
    starts = np.flatnonzero(np.diff(contacts.any(axis=1).astype(int)) < 0)
    assert 60.0 * 60.0 / np.mean(np.diff(starts)) == pytest.approx(30.0, rel=0.1)


def flown(**manner) -> list[float]:
    """Heights by which the centre of mass flies in a jump, from the time off the floor: g t^2 / 8 [m]."""
    found = []
    for seed in range(4):
        contacts = source("jump", 3.0, seed, manner=Manner(**manner)).contacts
        assert contacts is not None
        edges = np.flatnonzero(np.diff(contacts.any(axis=1).astype(int)))
        first = edges[1] - edges[0] if not contacts[edges[0] + 1].any() else edges[2] - edges[1]
        found.append(9.81 * (first / 60.0) ** 2 / 8.0)
    return found


def test_small_jumps_are_hops_of_five_centimetres_and_high_ones_seven_times_that():
    small, usual, high = flown(amplitude=0.6), flown(), flown(amplitude=1.4)
    assert 0.035 < min(small) <= max(small) < 0.08
    assert 0.07 < min(usual) <= max(usual) < 0.34
    assert 0.3 < min(high) <= max(high) < 0.48
    assert np.ptp(usual) > 0.05


@pytest.mark.parametrize("side", SIDES)
def test_a_horizontal_arm_is_at_shoulder_height_ahead_or_to_the_side(side):
    ahead = set()
    for seed in range(6):
        s = made(f"{side}_arm_horizontal", 2.0, seed)
        arm = s.ahead(s.pair("wrist") - s.pair("shoulder"))[:, SIDES.index(side)]
        assert np.abs(arm[:, 2]).max() < 0.12
        ahead.add(bool(arm[:, 0].mean() > abs(arm[:, 1].mean())))
    assert ahead == {True, False}


def test_a_named_hand_waves():
    for k, side in enumerate(SIDES):
        s = made("wave", 3.0, 0, hand=side)
        assert s.hands_over_shoulders[:, k].min() > 0.0
        assert s.hands_over_shoulders[:, 1 - k].max() < -0.2


def test_both_hands_wave_in_step():
    s = made("wave", 3.0, 1, hand="both")
    assert is_true_of(s, "wave")
    assert s.hands_over_shoulders.min() > 0.0
    assert np.corrcoef(s.wrists[:, 0, 1], -s.wrists[:, 1, 1])[0, 1] > 0.9


def test_small_waves_are_small_and_slow_ones_slow():
    def width(**manner) -> float:
        s = made("wave", 3.0, 5, hand="right", **manner)
        return float(np.ptp(s.wrists[:, 1, 1]))

    assert width(amplitude=0.6) < 0.75 * width() < 0.75 * 0.75 * width(amplitude=1.4) / 0.9
    fast, slow = (np.percentile(hand_speed(made("wave", 6.0, 5, speed=v)), 95) for v in (1.4, 0.7))
    assert fast > 1.5 * slow


@pytest.mark.parametrize(
    ("posture", "shown"),
    [
        ("on_hips", "arms_on_hips"), ("folded", "arms_folded"), ("behind_back", "hands_behind_back"),
        ("in_pockets", "hands_in_pockets"),
    ],
)  # fmt: skip
def test_free_arms_take_the_posture_that_is_asked_for(posture, shown):
    s = made("walk_straight", 3.0, 1, arm_posture=posture)
    assert check(s, shown).reasons == ()
    assert is_true_of(s, "walk_straight")


def test_arms_that_work_take_no_posture():
    with pytest.raises(ValueError, match="arm_posture: 'folded' with the action 'clap', which needs the arms"):
        source("clap", 2.0, 0, manner=Manner(arm_posture="folded"))
    s = made("wave", 3.0, 0, hand="right", arm_posture="on_hips")
    assert is_true_of(s, "wave")
    assert s.elbow_flexion[:, 0].min() > 65.0


def test_hanging_arms_swing_less_than_free_ones():
    free, hanging = made("walk_straight", 3.0, 1), made("walk_straight", 3.0, 1, arm_posture="hanging")
    assert np.ptp(hanging.wrists[..., 0], axis=0).max() < 0.4 * np.ptp(free.wrists[..., 0], axis=0).max()
    for seed in range(4):
        assert made("standing", 1.0, seed, arm_posture="hanging").arm_elevation.max() < 40.0


def with_arms(legs: Motion, arms: Motion) -> Motion:
    rows = [j for name, j in JOINT.items() if name.startswith(("left", "right")) and j > JOINT["neck"]]
    rotations = legs.rotations.copy()
    rotations[:, rows] = arms.rotations[:, rows]
    return replace(legs, rotations=rotations)


@pytest.mark.parametrize("arms", ["wave", "phone", "clap"])
def test_arms_go_over_the_legs_of_a_walk(arms):
    motion = with_arms(source("walk_straight", 4.0, 3), source(arms, 4.0, 3))
    assert check(motion, arms).reasons == ()
    assert check(motion, "walk_straight").reasons == ()


@pytest.mark.parametrize("action", ["boxing", "throw", "phone", "comb", "arms_folded", "beckon"])
def test_joints_stay_within_their_range(action):
    """Throwing arms turn outwards by up to 170 degrees (Dillman, Fleisig and Andrews 1993), beyond the table's 90."""
    for seed in range(2):
        motion = source(action, 3.0, seed)
        for name, angles in joint_angles(global_rotations(to_matrices(motion.rotations), motion.parents)).items():
            if not (action == "throw" and name == "shoulder external rotation"):
                assert LIMITS[name].low - 1.0 < angles.min(), name
                assert angles.max() < LIMITS[name].high + 1.0, name


def test_seeds_differ_as_people_do():
    """Idle people of the library differ by 8.6 cm rms over the joints, in place and heading of the pelvis."""
    poses = []
    for seed in range(14):
        s = made("standing", 0.5, seed)
        poses.append(s.ahead(s.joints[:, :22] - s.joint("pelvis")[:, None] * [1.0, 1.0, 0.0]))
    apart = [np.sqrt(((a - b) ** 2).sum(axis=-1).mean()) for a, b in combinations(poses, 2)]
    assert np.mean(apart) > 0.8 * 0.086
    assert min(apart) > 0.015


def test_hands_shake_where_two_people_meet():
    """Two people face each other at 0.85 m: their right wrists come within a clasp of the middle."""
    for seed in range(3):
        s = made("shake_hands", 3.0, seed)
        wrist = s.ahead(s.pair("wrist") - s.joint("pelvis")[:, None])[:, 1]
        assert 0.3 < wrist[:, 0].min() <= wrist[:, 0].max() < 0.43
        assert np.abs(wrist[:, 1]).max() < 0.09


def test_every_daily_action_is_defined():
    assert set(DAILY) <= set(DEFINED_ACTIONS)
    assert len(DAILY) >= 35


def test_palms_are_across_the_fingers_at_every_key_and_between():
    """A hand is aimed by both: along one another they leave its turn open."""
    for gestures in (*GESTURES.values(), *CIRCLES.values(), *SWIPES.values(), FINGER_SWING):
        for what in gestures if isinstance(gestures, tuple) else (gestures,):
            aims = np.array([[key.fingers or what.fingers, key.palm or what.palm] for key in what.keys])
            for share in np.linspace(0.0, 1.0, 5):
                mixed = aims + share * (np.roll(aims, 1, axis=0) - aims)
                unit = mixed / np.linalg.norm(mixed, axis=-1, keepdims=True)
                assert np.abs((unit[:, 0] * unit[:, 1]).sum(axis=-1)).max() < 0.85
