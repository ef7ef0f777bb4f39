"""Laws of human motion, checked on the skin that the radar sees: floor, feet, joints, smoothness, gait."""

import itertools
from functools import cache

import numpy as np
import pytest

from rfgen_sionna.generative.bodies import BodySequence, Phenotype, Rig, animate, person
from rfgen_sionna.generative.manner import Manner
from rfgen_sionna.generative.motion import ACTIONS, KinematicSource
from rfgen_sionna.generative.motion.arm_actions import GESTURES
from rfgen_sionna.generative.motion.balance import centre_of_mass
from rfgen_sionna.generative.motion.limits import LIMITS, joint_angles
from rfgen_sionna.generative.motion.skeleton import JOINT
from rfgen_sionna.records import Motion

BODIES = {
    "adult": Phenotype(gender="male", height=1.78),
    "heavy": Phenotype(gender="female", age=50, height=1.62, weight=85),
    "child": Phenotype(gender="female", age=8),
}
DURATION = 4.0
STEP = 1.0 / 30.0
GESTURED = [name for name in ACTIONS if name in GESTURES]
OFTEN = (
    "jump", "jumping_jacks", "pick_up", "walk", "walk_straight", "left_leg_raised", "swipe_left", "push",
    "finger_swing",
)  # fmt: skip
DAILY = ("wave", "clap", "boxing", "phone", "arms_on_hips", "sweep")
CASES = [
    *(
        pytest.param(action, body, seed, marks=[] if seed == k % 3 else pytest.mark.slow)
        for k, action in enumerate(OFTEN)
        for seed, body in enumerate(BODIES)
    ),
    *((action, tuple(BODIES)[k % 3], k) for k, action in enumerate(DAILY)),
    *(
        pytest.param(action, body, seed + 3, marks=pytest.mark.slow)
        for action in GESTURED
        for seed, body in enumerate(BODIES)
    ),
]


@cache
def rig_of(body: str) -> Rig:
    return person(BODIES[body], seed=1)


@cache
def performance(action: str, body: str, seed: int) -> tuple[Motion, BodySequence]:
    rig = rig_of(body)
    motion = KinematicSource()(action, DURATION, seed, skeleton=rig.skeleton)
    return motion, animate(rig, motion)


def foot_vertices(rig: Rig, side: str) -> np.ndarray:
    return np.unique(rig.faces[rig.face_parts == rig.part_names.index(f"{side}_foot")])


def contact_runs(planted: np.ndarray) -> list[np.ndarray]:
    runs = np.split(np.arange(len(planted)), np.flatnonzero(np.diff(planted.astype(int))) + 1)
    return [run for run in runs if planted[run[0]] and len(run) > 3]


@pytest.mark.parametrize(("action", "body", "seed"), CASES)
def test_nothing_goes_through_the_floor_and_planted_feet_touch_it(action, body, seed):
    motion, sequence = performance(action, body, seed)
    rows = {side: foot_vertices(sequence.rig, side) for side in ("left", "right")}
    for k in range(0, len(motion.translation), 6):
        vertices = sequence.vertices(k / motion.frame_rate)
        assert vertices[:, 2].min() > -0.01
        for i, side in enumerate(rows):
            if motion.contacts[k, i]:
                assert vertices[rows[side], 2].min() < 0.01


@pytest.mark.parametrize(("action", "body", "seed"), CASES)
def test_planted_feet_do_not_slide(action, body, seed):
    """The part of the sole that touches the floor moves by less than 2 cm in all while the foot is planted.

    The foot rolls, so the touching part changes: its path is summed up from frame to frame.
    """
    motion, sequence = performance(action, body, seed)
    for i, side in enumerate(("left", "right")):
        rows = foot_vertices(sequence.rig, side)
        for run in contact_runs(motion.contacts[:, i]):
            frames = run[1:-1:2]
            soles = np.array([sequence.rig.skin(*sequence.pose(k / motion.frame_rate), rows) for k in frames])
            path = 0.0
            for now, then in itertools.pairwise(soles):
                touching = now[:, 2] < now[:, 2].min() + 0.004
                path += np.median(np.linalg.norm((then - now)[touching, :2], axis=1))
            assert path < 0.02


@pytest.mark.parametrize(("action", "body", "seed"), CASES)
def test_joints_stay_within_human_limits(action, body, seed):
    _, sequence = performance(action, body, seed)
    rotations = np.stack([sequence.joint_rotations(t) for t in np.arange(0.0, DURATION, STEP)])
    for name, angle in joint_angles(rotations).items():
        assert LIMITS[name].low - 0.5 <= angle.min() <= angle.max() <= LIMITS[name].high + 0.5, name


@pytest.mark.parametrize(("action", "body", "seed"), CASES)
def test_velocity_has_no_stairs(action, body, seed):
    """Velocities are continuous: halving the step halves their jumps.

    Velocity steps of size s show as second differences of s/h, whatever h; for a curve with continuous acceleration
    the second difference tends to the acceleration, so that of 1 ms and that of 2 ms agree to the jerk times h.
    """
    _, sequence = performance(action, body, seed)
    rows = np.arange(0, len(sequence.rig.vertices), 97)
    rng = np.random.default_rng(seed)
    worst = 0.0
    for t in rng.uniform(0.1, DURATION - 0.1, 40):
        x = [sequence.rig.skin(*sequence.pose(t + k * 1e-3), rows) for k in (-2, -1, 0, 1, 2)]
        fine = (x[1] - 2 * x[2] + x[3]) / 1e-6
        coarse = (x[0] - 2 * x[2] + x[4]) / 4e-6
        worst = max(worst, float(np.abs(fine - coarse).max()))
    # jerk times 1 ms: up to 8,000 m/s^3 at a landing, 60 d / T^3 in a strike by d = 0.6 m in T = 0.12 s; a step of
    # 1 cm/s would show as 5 m/s^2 on top everywhere
    assert worst < (30.0 if action in ("boxing", "throw") else 8.0)


@pytest.mark.parametrize(
    "action",
    [
        "walk",
        "jumping_jacks",
        *(pytest.param(each, marks=pytest.mark.slow) for each in ("pick_up", "swipe_left", "click")),
    ],
)
def test_knots_of_the_spline_are_not_seen(action):
    """Acceleration is continuous across the poses that the spline passes through."""
    motion, sequence = performance(action, "adult", 0)
    rows = np.arange(0, len(sequence.rig.vertices), 97)
    h = 2e-4
    for k in range(20, len(motion.translation) - 20, 23):
        t = k / motion.frame_rate

        def acceleration(at: float) -> np.ndarray:
            x = [sequence.rig.skin(*sequence.pose(at + m * h), rows) for m in (-1, 0, 1)]
            return (x[0] - 2 * x[1] + x[2]) / h**2

        # h away on either side; linear blending of poses would jump by (velocity change)/h = 100 times this
        assert np.abs(acceleration(t + 1.01 * h) - acceleration(t - 1.01 * h)).max() < 6.0


def test_the_same_seed_gives_the_same_skin_and_another_one_another():
    rig = rig_of("adult")

    def skin(seed: int) -> np.ndarray:
        return animate(rig, KinematicSource()("walk", 1.0, seed, skeleton=rig.skeleton)).vertices(0.6)

    np.testing.assert_array_equal(skin(3), skin(3))
    assert np.abs(skin(3) - skin(4)).max() > 0.05


@pytest.mark.parametrize("body", BODIES)
@pytest.mark.parametrize("seed", [0, *(pytest.param(each, marks=pytest.mark.slow) for each in (1, 2))])
def test_walking_has_a_human_pace_and_cadence(body, seed):
    """Speed and cadence are those of slow to brisk walking once leg length is taken out (Froude)."""
    rig = rig_of(body)
    motion = KinematicSource()("walk", 8.0, seed, skeleton=rig.skeleton)
    sequence = animate(rig, motion)
    t = np.arange(0.0, 8.0, STEP)
    pelvis = np.array([sequence.joints(s)[0] for s in t])
    speed = np.linalg.norm(np.gradient(pelvis[:, :2], STEP, axis=0), axis=1)
    froude = np.quantile(speed, 0.9) ** 2 / (9.81 * rig.skeleton.leg_length())
    assert 0.06 < froude < 0.3
    landings = np.count_nonzero(motion.contacts[1:] & ~motion.contacts[:-1])
    cadence = landings / 8.0 * 60.0 * np.sqrt(rig.skeleton.leg_length() / 0.82)
    assert 75.0 < cadence < 135.0
    # back and forth on a short path, towards the facing direction first, without leaving the box
    assert 0.8 < np.ptp(pelvis[:, 0]) < 2.3
    assert np.ptp(pelvis[:, 1]) < 0.7
    assert pelvis[10, 0] > pelvis[0, 0]
    assert np.abs(pelvis[:, :2]).max() < 1.3
    # heel down first, toes last
    ankle = np.array([sequence.joints(s)[JOINT["left_ankle"]] for s in t])
    assert ankle[:, 2].max() > 1.5 * ankle[:, 2].min()


@pytest.mark.parametrize("seed", [0, *(pytest.param(each, marks=pytest.mark.slow) for each in (1, 2))])
def test_arms_swing_against_the_legs(seed):
    _, sequence = performance("walk", "adult", seed)
    motion, _ = performance("walk", "adult", seed)
    t = np.arange(0.0, 0.9, STEP)
    j = np.array([sequence.joints(s) for s in t])
    arm = (j[:, JOINT["left_wrist"]] - j[:, JOINT["right_wrist"]])[:, 0]
    leg = (j[:, JOINT["left_ankle"]] - j[:, JOINT["right_ankle"]])[:, 0]
    assert motion.action == "walk"
    assert np.corrcoef(arm, leg)[0, 1] < -0.5


@pytest.mark.parametrize(("action", "seed"), [("jump", 0), ("jumping_jacks", 1)])
def test_flight_is_free_fall(action, seed):
    """In the air nothing pushes: the body's centre of mass falls with g.

    The limbs move against the trunk, which the synthesiser does not solve for: their share of the mass leaves up to
    40 % for single instants, and the mean over a flight must be right within 25 %.
    """
    motion, sequence = performance(action, "adult", seed)
    h = 5e-3
    flights = contact_runs(~motion.contacts.any(axis=1))
    assert flights
    for run in flights:
        if run[0] < 2 or run[-1] > len(motion.translation) - 3:
            continue
        start, end = run[0] / motion.frame_rate + 0.02, run[-1] / motion.frame_rate - 0.02
        z = [centre_of_mass(sequence.joints(s))[2] for s in (start, 0.5 * (start + end), end)]
        mean = (z[0] - 2 * z[1] + z[2]) / (0.5 * (end - start)) ** 2
        assert mean == pytest.approx(-9.81, rel=0.25)
        assert h < end - start


@pytest.mark.parametrize(
    ("action", "body"),
    [
        pytest.param(action, body, marks=[] if n == k % 3 else pytest.mark.slow)
        for k, action in enumerate(("standing", "t_pose", "pick_up", "left_leg_raised", "push"))
        for n, body in enumerate(BODIES)
    ],
)
def test_a_standing_person_would_not_fall(action, body):
    """The centre of mass stays over the soles."""
    motion, sequence = performance(action, body, list(BODIES).index(body))
    rows = {side: foot_vertices(sequence.rig, side) for side in ("left", "right")}
    for t in np.arange(0.0, DURATION, 0.2):
        k = round(t * motion.frame_rate)
        vertices = sequence.vertices(t)
        soles = np.concatenate([vertices[rows[s]] for i, s in enumerate(rows) if motion.contacts[k, i]])[:, :2]
        mass = centre_of_mass(sequence.joints(t))[:2]
        assert np.all(mass > soles.min(axis=0) - 0.005)
        assert np.all(mass < soles.max(axis=0) + 0.005)


@pytest.mark.parametrize("body", BODIES)
def test_hanging_hands_stay_out_of_the_thighs(body):
    """Beside the body at the height of the hand, nothing of trunk and thighs reaches as far out as the palm."""
    rig, hanging = rig_of(body), Manner(arm_posture="hanging")
    seed = list(BODIES).index(body)
    sequence = animate(rig, KinematicSource()("standing", DURATION, seed, skeleton=rig.skeleton, manner=hanging))
    names, faces = sequence.part_names, sequence.faces
    rows = {
        part: np.unique(faces[sequence.face_parts == names.index(part)])
        for part in ("left_hand", "left_thigh", "torso")
    }
    for t in (0.0, 1.7, 3.4):
        v = sequence.vertices(t)
        hand, trunk = v[rows["left_hand"]], np.concatenate([v[rows["left_thigh"]], v[rows["torso"]]])
        level = (trunk[:, 2] > hand[:, 2].min()) & (trunk[:, 2] < hand[:, 2].max())
        assert np.median(hand[:, 1]) > trunk[level, 1].max()
