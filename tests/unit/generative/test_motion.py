"""Motion by rules: the named action comes out, seeds decide the rest, bad input is refused."""

import numpy as np
import pytest

from rfgen_sionna.generative.motion import ACTIONS, MEAN_ADULT, KinematicSource, MotionSource
from rfgen_sionna.generative.motion.curves import bump, cruise, ease, hermite, keys
from rfgen_sionna.generative.motion.limits import joint_angles
from rfgen_sionna.generative.motion.rotations import about, basis, between, continuous, to_matrices, to_quaternions
from rfgen_sionna.generative.motion.skeleton import (
    JOINT,
    JOINT_NAMES,
    PARENTS,
    forward_kinematics,
    global_rotations,
    two_bone,
)
from rfgen_sionna.records import Motion

SEEDS = (0, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (1, 2)))
RATE = 60.0
source = KinematicSource(RATE)


def joints_of(motion: Motion) -> np.ndarray:
    """(frame, 52, 3) joint positions."""
    world = global_rotations(to_matrices(motion.rotations), motion.parents)
    return forward_kinematics(world, motion.translation, motion.offsets, motion.parents)


def track(action: str, seed: int, duration: float = 4.0, **options) -> tuple[Motion, dict[str, np.ndarray]]:
    motion = source(action, duration, seed, **options)
    positions = joints_of(motion)
    return motion, {name: positions[:, j] for name, j in JOINT.items()}


def velocity(positions: np.ndarray) -> np.ndarray:
    return np.gradient(positions, axis=0) * RATE


def test_the_actions_of_the_paper_are_there():
    assert set(ACTIONS) >= {
        "walk", "jump", "jumping_jacks", "pick_up", "t_pose", "y_pose", "left_arm_raised", "right_arm_raised",
        "left_leg_raised", "right_leg_raised", "swipe_left", "swipe_right", "push", "pull", "circle_clockwise",
        "circle_counterclockwise", "click", "finger_swing", "standing",
    }  # fmt: skip
    assert isinstance(source, MotionSource)


@pytest.mark.parametrize("action", [*list(ACTIONS)[:20], "wave", "boxing", "look_around"])
def test_motion_is_a_complete_record_that_the_seed_decides(action):
    a, same, other = source(action, 2.0, 5), source(action, 2.0, 5), source(action, 2.0, 6)
    assert a.rotations.shape == (121, 52, 4)
    assert a.joint_names == JOINT_NAMES
    assert a.parents == PARENTS
    assert (a.action, a.seed, a.duration) == (action, 5, 2.0)
    assert a.contacts.shape == (121, 2)
    np.testing.assert_allclose(np.linalg.norm(a.rotations, axis=-1), 1.0, atol=1e-12)
    # no sign flips from frame to frame
    assert np.min(np.sum(a.rotations[1:] * a.rotations[:-1], axis=-1)) > 0.5
    np.testing.assert_array_equal(a.rotations, same.rotations)
    np.testing.assert_array_equal(a.translation, same.translation)
    assert np.abs(a.rotations - other.rotations).max() > 0.01


def test_a_longer_motion_begins_like_a_shorter_one_of_a_pose():
    short, long = source("t_pose", 1.0, 3), source("t_pose", 4.0, 3)
    arms = [j for name, j in JOINT.items() if not any(part in name for part in ("hip", "knee", "ankle", "foot"))]
    np.testing.assert_allclose(long.rotations[:61, arms], short.rotations[:, arms], atol=1e-9)


@pytest.mark.parametrize("seed", SEEDS)
def test_t_pose_and_y_pose(seed):
    for action, lowest, highest in (("t_pose", -10.0, 10.0), ("y_pose", 35.0, 62.0)):
        _, j = track(action, seed, 2.0)
        for side, s in (("left", 1), ("right", -1)):
            reach = j[f"{side}_wrist"] - j[f"{side}_shoulder"]
            elevation = np.degrees(np.arctan2(reach[:, 2], s * reach[:, 1]))
            assert lowest < elevation.min() <= elevation.max() < highest
            assert np.abs(reach[:, 0]).max() < 0.15


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize(("side", "other"), [("left", "right"), ("right", "left")])
def test_a_raised_arm_is_over_the_head_and_the_other_hangs(seed, side, other):
    _, j = track(f"{side}_arm_raised", seed, 3.0)
    late = slice(int(1.8 * RATE), int(2.8 * RATE))
    assert (j[f"{side}_wrist"] - j["head"])[late, 2].min() > 0.0
    assert (j[f"{other}_wrist"] - j[f"{other}_shoulder"])[:, 2].max() < -0.35


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize(("side", "other"), [("left", "right"), ("right", "left")])
def test_a_raised_leg_is_up_and_the_other_stands(seed, side, other):
    motion, j = track(f"{side}_leg_raised", seed, 4.0)
    late = slice(int(2.2 * RATE), int(3.4 * RATE))
    assert (j[f"{side}_ankle"] - j[f"{other}_ankle"])[late, 2].min() > 0.2
    assert np.ptp(j[f"{other}_ankle"], axis=0).max() < 1e-6
    i = ("left", "right").index(side)
    assert not motion.contacts[late, i].any()
    assert motion.contacts[:, 1 - i].all()


@pytest.mark.parametrize("hand", ["left", "right"])
@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize(
    ("action", "axis", "sign"),
    [("swipe_left", 1, 1), ("swipe_right", 1, -1), ("push", 0, 1), ("pull", 0, -1)],
)
def test_the_fast_stroke_goes_where_the_name_says(hand, seed, action, axis, sign):
    _, j = track(action, seed, 6.0, hand=hand)
    v = sign * velocity(j[f"{hand}_wrist"])[:, axis]
    assert v.max() > 0.7
    assert v.max() > 1.25 * -v.min()
    idle = {"left": "right", "right": "left"}[hand]
    assert np.linalg.norm(velocity(j[f"{idle}_wrist"]), axis=-1).max() < 0.4 * v.max()


@pytest.mark.parametrize("hand", ["left", "right"])
@pytest.mark.parametrize(("action", "sense"), [("circle_clockwise", 1), ("circle_counterclockwise", -1)])
@pytest.mark.parametrize("seed", SEEDS)
def test_circles_turn_the_way_the_person_sees_it(hand, action, sense, seed):
    _, j = track(action, seed, 5.0, hand=hand)
    wrist = j[f"{hand}_wrist"] - j["spine3"]
    # the person sees its right (-y) on the right and z up: clockwise is a falling angle
    x, y = -wrist[:, 1], wrist[:, 2]
    angle = np.unwrap(np.arctan2(y - y.mean(), x - x.mean()))
    turns = -sense * (angle[-1] - angle[0]) / (2 * np.pi)
    assert 5.0 / 1.75 < turns < 5.0 / 0.9
    assert 0.1 < np.hypot(x - x.mean(), y - y.mean()).mean() < 0.25


@pytest.mark.parametrize("seed", SEEDS)
def test_click_and_finger_swing_move_the_index_finger(seed):
    motion, j = track("click", seed, 4.0, hand="right")
    world = global_rotations(to_matrices(motion.rotations), motion.parents)
    angles = joint_angles(world)
    # columns: left then right, index first
    knuckle = angles["finger knuckle flexion"][:, 4]
    assert np.ptp(knuckle) > 28.0
    assert np.ptp(angles["finger knuckle flexion"][:, 5]) < 1.0
    assert np.ptp(j["right_wrist"], axis=0).max() < 0.12

    motion, j = track("finger_swing", seed, 4.0, hand="right")
    spread = joint_angles(global_rotations(to_matrices(motion.rotations), motion.parents))["finger spread"][:, 4]
    assert np.ptp(spread) > 15.0
    crossings = np.count_nonzero(np.diff(np.sign(spread - spread.mean())))
    assert 1.0 < crossings / 2 / 4.0 < 2.6
    tip = j["right_index3"] - j["right_wrist"]
    # sideways, not forwards
    assert np.ptp(tip[:, 1]) > 1.5 * np.ptp(tip[:, 0])


@pytest.mark.parametrize("seed", SEEDS)
def test_pick_up_reaches_the_ground_with_bent_hips_and_knees(seed):
    motion, j = track("pick_up", seed, 3.0, hand="right")
    fingers = np.minimum(j["right_middle3"][:, 2], j["right_index3"][:, 2])
    lowest = int(np.argmin(fingers))
    assert 0.0 < fingers[lowest] < 0.12
    angles = joint_angles(global_rotations(to_matrices(motion.rotations), motion.parents))
    assert angles["knee flexion"][lowest].min() > 50.0
    assert angles["hip flexion"][lowest].min() > 70.0
    assert motion.contacts.all()
    assert j["pelvis"][-1, 2] > 0.8 or np.max(j["pelvis"][lowest:, 2]) > 0.8


@pytest.mark.parametrize("seed", SEEDS)
def test_jumping_jacks_open_arms_and_legs_together(seed):
    motion, j = track("jumping_jacks", seed, 5.0)
    feet = np.abs((j["left_ankle"] - j["right_ankle"])[:, 1])
    hands = (j["left_wrist"] - j["left_shoulder"])[:, 2]
    assert feet.min() < 0.25
    assert feet.max() > 0.5
    assert hands.max() > 0.35
    assert hands.min() < -0.35
    assert np.corrcoef(feet, hands)[0, 1] > 0.75
    assert 0.2 < np.mean(~motion.contacts.any(axis=1)) < 0.5


def test_arms_of_jumping_jacks_come_forward_as_those_of_captured_people():
    """Wrists of captured people (CMU 13_30 and 13_31, Animated Drawings) at the shoulders' height are 16 to 31 degrees
    ahead of them."""
    found = []
    for seed in range(8):
        _, j = track("jumping_jacks", seed, 4.0)
        reach = j["left_wrist"] - j["left_shoulder"]
        level = np.abs(reach[:, 2]) < 0.15
        found.append(np.degrees(np.arctan2(reach[level, 0], reach[level, 1])).mean())
    assert min(found) > 5.0
    assert max(found) < 50.0
    assert 16.0 < np.mean(found) < 31.0


@pytest.mark.parametrize("seed", range(12))
def test_three_seconds_show_the_way_there_and_the_way_back(seed):
    _, j = track("walk", seed, 3.0)
    v = velocity(j["pelvis"])[:, 0]
    assert np.count_nonzero(v > 0.3) / RATE > 0.45
    assert np.count_nonzero(v < -0.3) / RATE > 0.6
    assert v[:10].mean() > 0.3


def test_time_to_spare_leaves_the_walk_as_it_is():
    """The way there is shortened only where the end would come before the way back."""
    _, long = track("walk", 1, 8.0)
    _, longer = track("walk", 1, 9.0)
    steps = [np.diff(j["pelvis"][: int(7.5 * RATE), :2], axis=0) for j in (long, longer)]
    np.testing.assert_allclose(*steps, atol=2e-3)


@pytest.mark.parametrize("seed", SEEDS)
def test_walking_straight_goes_one_way_at_one_pace(seed):
    _, j = track("walk_straight", seed, 3.0)
    v = velocity(j["pelvis"])[2:-2]
    assert v[:, 0].min() > 0.7
    assert v[:, 0].max() < 2.0
    assert np.abs(v[:, 1]).max() < 0.25
    assert j["pelvis"][0, 0] + j["pelvis"][-1, 0] == pytest.approx(0.0, abs=0.05)


@pytest.mark.parametrize("seed", SEEDS)
def test_a_faster_factor_makes_a_faster_rhythm(seed):
    def rate(speed: float) -> float:
        _, j = track("finger_swing", seed, 6.0, hand="right", speed=speed)
        y = (j["right_index3"] - j["right_wrist"])[:, 1]
        spectrum = np.abs(np.fft.rfft((y - y.mean()) * np.hanning(len(y)), 8192))
        return float(np.argmax(spectrum))

    assert rate(1.6) / rate(0.8) == pytest.approx(2.0, rel=0.12)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("moonwalk", 2.0, 0), "moonwalk.*allowed are walk, jump"),
        (("walk", 0.0, 0), "duration"),
        (("walk", -1.0, 0), "duration"),
        (("walk", float("nan"), 0), "duration"),
        (("walk", 1e6, 0), "600"),
    ],
)
def test_bad_input_is_refused(arguments, message):
    with pytest.raises(ValueError, match=message):
        source(*arguments)


@pytest.mark.parametrize(
    ("options", "message"), [({"speed": 0.0}, "speed"), ({"hand": "both"}, "hand"), ({"hand": "left"}, "not done with")]
)
def test_bad_options_are_refused(options, message):
    with pytest.raises(ValueError, match=message):
        source("walk", 1.0, 0, **options)


@pytest.mark.parametrize("shape", [ease, cruise, bump])
def test_profiles_start_and_end_at_rest(shape):
    h = 1e-4
    for end in (0.0, 1.0):
        inside = shape(np.array([end, abs(end - h), abs(end - 2 * h)]))
        first = (inside[1] - inside[0]) / h
        second = (inside[0] - 2 * inside[1] + inside[2]) / h**2
        assert abs(first) < 1e-5
        # the third derivative is at most a few hundred, so the second is within h times that
        assert abs(second) < 0.1


def test_cruise_is_increasing_and_symmetric():
    s = np.linspace(0.0, 1.0, 201)
    c = cruise(s, 0.3)
    assert np.all(np.diff(c) >= 0.0)
    np.testing.assert_allclose(c + c[::-1], 1.0, atol=1e-12)
    assert np.max(np.diff(c)) * 200 == pytest.approx(1 / 0.7, rel=1e-6)


def test_keys_and_hermite_pass_through_what_is_given():
    t = np.array([0.0, 1.0, 2.5])
    np.testing.assert_allclose(keys(t, [0.0, 1.0, 2.5], [3.0, -1.0, 2.0]), [3.0, -1.0, 2.0])
    free_fall = hermite(np.linspace(0, 1, 5), [0.0, 1.0], [[0.0, 2.0, -9.81], [2.0 - 9.81 / 2, 2.0 - 9.81, -9.81]])
    s = np.linspace(0, 1, 5)
    np.testing.assert_allclose(free_fall, 2 * s - 9.81 / 2 * s**2, atol=1e-12)


def test_two_bones_keep_their_lengths_and_reach_the_target():
    rng = np.random.default_rng(0)
    start, target = rng.normal(size=(50, 3)), rng.normal(size=(50, 3))
    target = start + (target - start) / np.linalg.norm(target - start, axis=1)[:, None] * rng.uniform(
        0.2, 0.68, (50, 1)
    )
    middle, first, second = two_bone(start, target, rng.normal(size=(50, 3)), 0.4, 0.3)
    np.testing.assert_allclose(np.linalg.norm(middle - start, axis=1), 0.4)
    np.testing.assert_allclose(start + 0.4 * first[:, :, 0] + 0.3 * second[:, :, 0], target, atol=1e-9)
    np.testing.assert_allclose(np.linalg.det(first), 1.0)


def test_rotations_round_trip():
    rng = np.random.default_rng(1)
    q = continuous(rng.normal(size=(10, 3, 4)))
    r = to_matrices(q)
    np.testing.assert_allclose(to_matrices(to_quaternions(r)), r, atol=1e-12)
    a, b = np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.6, 0.8])
    np.testing.assert_allclose(between(a, b) @ a, b, atol=1e-12)
    np.testing.assert_allclose(about(np.array([0.0, 0.0, 1.0]), np.pi / 2) @ a, [0, 1, 0], atol=1e-12)
    np.testing.assert_allclose(np.linalg.det(basis(a, b)), 1.0)


def test_the_rest_pose_is_a_t_pose_facing_x():
    p = MEAN_ADULT.rest_positions()
    assert p[JOINT["left_wrist"], 1] > 0.6
    assert p[JOINT["right_wrist"], 1] < -0.6
    assert p[JOINT["left_foot"], 0] > p[JOINT["left_ankle"], 0] + 0.1
    assert p[JOINT["head"], 2] > 0.5 > 0 > p[JOINT["left_ankle"], 2]
    assert MEAN_ADULT.standing_height() == pytest.approx(0.91, abs=0.02)
