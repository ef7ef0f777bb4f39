"""Actions performed by clips of the motion library and by rules: true, as long as asked, varied, in the manner that is
asked for, and reproducible."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rfgen_sionna.generative.action_definitions import DEFINED_ACTIONS, is_true_of
from rfgen_sionna.generative.manner import ARM_POSTURES, Manner
from rfgen_sionna.generative.motion import MEAN_ADULT
from rfgen_sionna.generative.motion.clip_editing import headings, joint_places
from rfgen_sionna.generative.motion.skeleton import JOINT
from rfgen_sionna.generative.motion_library import MotionLibrary
from rfgen_sionna.generative.performing import perform, performable
from rfgen_sionna.generative.prompts.prompt_error import PromptError
from rfgen_sionna.generative.repertoire import windows
from rfgen_sionna.records import Motion

LIBRARY = MotionLibrary()
FEET = [JOINT["left_foot"], JOINT["right_foot"]]
LIMBS = [JOINT[f"{side}_{end}"] for side in ("left", "right") for end in ("wrist", "ankle")]
BY_CLIPS = sorted(action for action, sources in performable().items() if "clips" in sources)


def mean_slide(motion: Motion) -> float:
    """Mean speed over the floor of planted feet [m/s]; the stiller of toe and ankle."""
    places = joint_places(motion)
    speeds = [
        np.linalg.norm(np.diff(places[:, joints, :2], axis=0), axis=-1) * motion.frame_rate
        for joints in (FEET, [JOINT["left_ankle"], JOINT["right_ankle"]])
    ]
    assert motion.contacts is not None
    down = motion.contacts[1:] & motion.contacts[:-1]
    return float(np.minimum(*speeds)[down].mean())


def fast_limbs(motion: Motion) -> float:
    """95th percentile of the speed of wrists and ankles at 20 Hz [m/s]."""
    step = round(motion.frame_rate / 20.0)
    places = joint_places(motion)[::step, LIMBS]
    return float(np.percentile(np.linalg.norm(np.diff(places, axis=0), axis=-1) * 20.0, 95))


def path_speed(motion: Motion) -> float:
    """Mean speed of the pelvis over the floor, by steps of 0.5 s [m/s]."""
    step = round(0.5 * motion.frame_rate)
    way = motion.translation[::step, :2]
    return float(np.linalg.norm(np.diff(way, axis=0), axis=1).sum() / (step * (len(way) - 1)) * motion.frame_rate)


def test_what_can_be_performed_is_defined_and_has_a_source() -> None:
    assert set(performable()) <= set(DEFINED_ACTIONS)
    assert {"walk", "run", "kick", "squat", "fall", "sit_down", "wave", "clap", "drink"} <= set(performable())
    assert len(performable()) >= 60
    assert performable()["kick"][0] == "clips"
    assert performable()["swipe_left"] == ("rules",)
    assert performable()["t_pose"][0] == "rules"  # more exact than a clip


@pytest.mark.parametrize(
    "action",
    [
        "walk",
        "kick",
        "fall",
        *(
            pytest.param(each, marks=pytest.mark.slow)
            for each in ("run", "squat", "lie_down", "reach", "jumping_jacks")
        ),
    ],
)
def test_an_action_is_shown_for_as_long_as_asked(action: str) -> None:
    for seed, duration in ((0, 3.0), (1, 5.0)):
        motion = perform(action, duration, seed)
        assert is_true_of(motion, action)
        assert motion.duration == pytest.approx(duration, abs=0.05)
        assert motion.action == action
        assert motion.seed == seed
        assert motion.clips
        assert all(name in {clip.name for clip in LIBRARY} for name in motion.clips)


def test_the_same_seed_gives_the_same_bits_and_another_one_another_motion() -> None:
    first, again, other = (perform("kick", 3.0, seed) for seed in (4, 4, 5))
    assert np.array_equal(first.rotations, again.rotations)
    assert np.array_equal(first.translation, again.translation)
    assert not np.allclose(first.rotations, other.rotations[: len(first.rotations)], atol=0.05)


def test_seeds_differ_in_people() -> None:
    subjects = {clip.name: clip.subject for clip in LIBRARY}
    people = {subjects[perform("kick", 2.0, seed).clips[0]] for seed in range(8)}
    assert len(people) >= 4


def test_without_strength_a_clip_is_played_as_it_is() -> None:
    motion = perform("squat", 2.0, 3, strength=0.0)
    clip = LIBRARY.motion(motion.clips[0])
    assert motion.frame_rate == clip.frame_rate
    local = motion.rotations[:20, 1:]
    places = np.arange(len(clip.rotations) - 19)
    nearest = min(float(np.abs(clip.rotations[k : k + 20, 1:] - local).max()) for k in places)
    assert nearest < 1e-9
    assert np.ptp(motion.translation[:, 2]) == pytest.approx(np.ptp(clip.translation[:, 2]), abs=0.2)


def test_without_strength_a_clip_goes_before_rules() -> None:
    """Waves have few clips and go by rules otherwise."""
    assert not perform("wave", 2.0, 0).clips
    assert perform("wave", 2.0, 0, strength=0.0).clips


def test_with_strength_no_clip_is_copied() -> None:
    motion = perform("squat", 2.0, 3)
    clip = LIBRARY.motion(motion.clips[0])
    own = motion.rotations[::3, 1:22]
    nearest = min(
        float(np.abs(clip.rotations[k : k + 20, 1:] - own[:20]).max()) for k in range(len(clip.rotations) - 19)
    )
    assert nearest > 0.01


@pytest.mark.parametrize(
    "action",
    ["standing", "nod", *(pytest.param(each, marks=pytest.mark.slow) for each in ("look_around", "shake_head"))],
)
def test_who_keeps_about_still_is_no_copy_of_a_clip(action: str) -> None:
    for seed in range(3):
        motion = perform(action, 3.0, seed)
        for name in motion.clips:
            own = motion.rotations[::3, 1:22][:20]
            clip = LIBRARY.motion(name).rotations[:, 1:]
            gap = min(float(np.abs(clip[k : k + 20] - own).max()) for k in range(len(clip) - 19))
            assert gap > 0.01


def test_a_strength_beyond_its_range_is_refused() -> None:
    with pytest.raises(ValueError, match=r"strength: 1\.5; allowed are 0, a clip as it is, to 1"):
        perform("kick", 2.0, 0, strength=1.5)


@pytest.mark.parametrize(
    "action", ["walk", "kick", *(pytest.param(each, marks=pytest.mark.slow) for each in ("squat", "jump"))]
)
def test_feet_slide_no_more_than_those_of_the_clips(action: str) -> None:
    names = sorted({window.clip for window in windows()[action]})[::6]
    real = np.mean([mean_slide(LIBRARY.motion(name)) for name in names])
    made = np.mean([mean_slide(perform(action, 4.0, seed)) for seed in range(2)])
    assert made <= real


@pytest.mark.parametrize(
    "action", ["walk", "punch", *(pytest.param(each, marks=pytest.mark.slow) for each in ("kick", "jumping_jacks"))]
)
def test_limbs_are_as_fast_as_those_of_the_clips(action: str) -> None:
    names = sorted({window.clip for window in windows()[action]})[::4]
    real = np.percentile([fast_limbs(LIBRARY.motion(name)) for name in names], [10, 90])
    made = np.median([fast_limbs(perform(action, 3.0, seed)) for seed in range(3)])
    assert 0.7 * real[0] < made < 1.4 * real[1]


def test_no_joint_jumps() -> None:
    # joins of clips go on with the velocities of both
    for action, seed in (("squat", 2), ("walk", 1), ("punch", 0)):
        motion = perform(action, 6.0, seed)
        second = np.diff(joint_places(motion)[:, LIMBS], 2, axis=0) * motion.frame_rate**2
        assert np.linalg.norm(second, axis=-1).max() < 400.0


def test_a_walk_goes_to_and_fro_and_comes_back() -> None:
    motion = perform("walk", 6.0, 0)
    x = motion.translation[:, 0]
    assert np.gradient(x).max() * motion.frame_rate > 0.3
    assert np.gradient(x).min() * motion.frame_rate < -0.3
    assert abs(x.max() + x.min()) < 0.1  # its middle is the origin
    assert abs(headings(motion)[0]) < 0.5  # ahead at first


def test_a_straight_walk_goes_along_x() -> None:
    motion = perform("walk_straight", 4.0, 0)
    assert np.ptp(motion.translation[:, 1]) < 0.2
    assert motion.translation[-1, 0] - motion.translation[0, 0] > 1.5


@pytest.mark.parametrize("speed", [0.5, pytest.param(1.4, marks=pytest.mark.slow)])
def test_a_walk_has_the_speed_that_is_asked_for(speed: float) -> None:
    motion = perform("walk", 6.0, 1, manner=Manner(speed_mps=speed, path="straight"))
    assert path_speed(motion) == pytest.approx(speed, rel=0.1)


def test_ways_have_their_shape() -> None:
    circle = perform("walk", 6.0, 0, manner=Manner(path="circle")).translation[:, :2]
    radius = np.linalg.norm(circle - 0.5 * (circle.min(axis=0) + circle.max(axis=0)), axis=1)
    assert radius.std() < 0.2 * radius.mean()
    loop = perform("walk", 12.0, 0, manner=Manner(path="loop"))
    assert np.ptp(headings(loop)) > np.radians(250.0)


def test_who_pauses_stands_for_a_time() -> None:
    motion = perform("walk", 7.0, 1, manner=Manner(pauses=True, path="straight"))
    speed = np.linalg.norm(np.gradient(motion.translation[:, :2], axis=0), axis=1) * motion.frame_rate
    slow = np.convolve(speed < 0.1, np.ones(round(0.5 * motion.frame_rate)), mode="valid")
    assert slow.max() >= 0.9 * round(0.5 * motion.frame_rate)
    assert np.percentile(speed, 90) > 0.5


def test_squats_come_as_often_as_asked() -> None:
    low = perform("squat", 10.0, 0, manner=Manner(rate=12.0)).translation[:, 2]
    down = low < low.min() + 0.35 * np.ptp(low)
    assert np.count_nonzero(np.diff(down.astype(int)) == 1) in (2, 3)  # 5 s apart


def test_slow_is_slow() -> None:
    fast, slow = (perform("kick", 3.0, 0, manner=Manner(speed=factor)) for factor in (1.0, 0.8))
    assert fast_limbs(slow) < fast_limbs(fast)


def test_arms_act_over_legs() -> None:
    motion = perform("walk", 4.0, 0, arms="both_arms_raised")
    assert is_true_of(motion, "walk")
    assert np.mean(joint_places(motion)[:, JOINT["left_wrist"], 2] > joint_places(motion)[:, JOINT["neck"], 2]) > 0.3


@pytest.mark.parametrize(
    "posture", [pytest.param(each, marks=[pytest.mark.slow] * (k % 2)) for k, each in enumerate(ARM_POSTURES)]
)
def test_arms_are_held_while_the_legs_walk(posture: str) -> None:
    motion = perform("walk", 3.0, 0, manner=Manner(arm_posture=posture))
    assert is_true_of(motion, "walk")
    hand = joint_places(motion)[:, JOINT["left_wrist"]] - joint_places(motion)[:, JOINT["spine3"]]
    assert np.linalg.norm(hand, axis=1).std() < 0.06


def test_who_is_tired_stoops() -> None:
    tall, tired = (perform("walk", 3.0, 0, manner=Manner(tired=flag)) for flag in (False, True))
    heights = [joint_places(motion)[:, JOINT["head"], 2].mean() for motion in (tall, tired)]
    assert heights[1] < heights[0] - 0.02
    assert path_speed(tired) < path_speed(tall)


def test_a_body_of_other_proportions_stands_on_its_feet() -> None:
    small = replace(MEAN_ADULT, offsets=0.7 * MEAN_ADULT.offsets, ankle_height=0.7 * MEAN_ADULT.ankle_height,
                    heel=0.7 * MEAN_ADULT.heel, toe_height=0.7 * MEAN_ADULT.toe_height)  # fmt: skip
    motion = perform("walk_straight", 3.0, 0, skeleton=small)
    lowest = joint_places(motion)[..., 2].min(axis=1)
    assert is_true_of(motion, "walk_straight")
    assert 0.0 < lowest.min() < 0.05
    assert np.median(lowest) < 0.06


def test_who_sits_down_upright_at_first_stays_seated() -> None:
    motion = perform("sit_down", 5.0, 1)
    height = motion.translation[:, 2]
    assert height[0] > height[-1] + 0.2
    last = motion.translation[-round(motion.frame_rate) :, 2]
    assert np.ptp(last) < 0.03


@pytest.mark.parametrize(
    ("action", "manner", "words"),
    [
        ("sit", Manner(speed_mps=1.0), "speed: 'sit' does not lead over the floor"),
        ("clap", Manner(hand="left"), "hand: 'left' with 'clap', whose clips show no such choice"),
        ("fall", Manner(rate=10.0), "rate: 'fall' is not repeated"),
        ("walk", Manner(speed_mps=6.0), "speed: 6 m/s with 'walk'; allowed are"),
        ("crawl", Manner(arm_posture="folded"), "arm posture: 'arms_folded' with 'crawl'"),
        ("walk_straight", Manner(path="circle"), "path: 'circle' with 'walk_straight'"),
    ],
)
def test_what_an_action_cannot_have_is_refused_in_words(action: str, manner: Manner, words: str) -> None:
    with pytest.raises(PromptError, match=words.replace("(", r"\(")):
        perform(action, 3.0, 0, manner=manner)


def test_unknown_actions_and_lengths_are_refused() -> None:
    with pytest.raises(PromptError, match="'moonwalk' cannot be performed; allowed are arm_circles"):
        perform("moonwalk", 3.0, 0)
    with pytest.raises(ValueError, match="duration: -1"):
        perform("walk", -1.0, 0)


@pytest.mark.slow
@pytest.mark.parametrize("action", BY_CLIPS)
def test_every_action_of_clips_is_shown_for_every_seed(action: str) -> None:
    for seed in range(10):
        assert is_true_of(perform(action, 5.0, seed), action)


@pytest.mark.parametrize("action", ["hop", pytest.param("jump", marks=pytest.mark.slow)])
def test_the_size_of_jumps_is_the_height_of_their_flights(action: str) -> None:
    def rise(size: float, seed: int) -> float:
        places = joint_places(perform(action, 2.5, seed, manner=Manner(amplitude=size)))
        toes = places[:, FEET, 2].min(axis=1) - MEAN_ADULT.toe_height
        assert abs(np.percentile(toes, 5)) < 0.01
        return float(toes.max())

    for seed in range(2):
        assert 0.03 <= rise(0.4, seed) <= 0.08
        assert 0.03 <= rise(0.6, seed) <= 0.08
        assert 0.08 <= rise(1.0, seed) <= 0.25
        assert rise(1.4, seed) > 0.25


@pytest.mark.parametrize("rate", [110.0, pytest.param(140.0, marks=pytest.mark.slow)])
def test_quick_hops_follow_one_another(rate: float) -> None:
    motion = perform("hop", 6.0, 0, manner=Manner(amplitude=0.4, rate=rate))
    places = joint_places(motion)
    up = places[:, FEET, 2].min(axis=1) > MEAN_ADULT.toe_height + 0.02
    assert np.diff(up.astype(int)).clip(0).sum() == pytest.approx(rate / 10.0, abs=1.0)
    pelvis = places[:, 0, 2]
    apart = np.gradient(np.gradient(pelvis)) * motion.frame_rate**2
    assert np.percentile(np.abs(apart), 95) < 3.5 * 9.81  # landing and push are one swing of a spring
    assert np.ptp(pelvis[round(motion.frame_rate) :]) < 0.25


def test_who_slips_lands_on_the_back_or_a_side() -> None:
    for seed in range(6):
        motion = perform("slip", 4.0, seed)
        x, y, z, w = motion.rotations[-1, 0]
        assert 2.0 * (x * z - w * y) > -0.6  # the front of the pelvis does not face the floor


@pytest.mark.parametrize(("action", "speed"), [("walk", 0.3), ("run", 8.0), ("walk_backwards", 0.8)])
def test_a_given_speed_is_kept(action: str, speed: float) -> None:
    for seed in range(2):
        motion = perform(action, 3.0, seed, manner=Manner(speed_mps=speed))
        way = np.linalg.norm(np.diff(motion.translation[:, :2], axis=0), axis=-1).sum()
        assert way / 3.0 == pytest.approx(speed, rel=0.25)


@pytest.mark.parametrize(("action", "speed"), [("walk", 2.5), ("limp", 1.5)])
def test_a_speed_that_no_motion_reaches_is_refused(action: str, speed: float) -> None:
    with pytest.raises(PromptError, match="speed"):
        perform(action, 3.0, 0, manner=Manner(speed_mps=speed))
