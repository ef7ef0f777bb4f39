"""Drafts: what they show, the beat that they keep, and that prompts are made from them."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d
from scipy.spatial.transform import Rotation

from rfgen_sionna.generative.diffusion.constraints import resampled_features
from rfgen_sionna.generative.diffusion.diffusion_source import DiffusionSource
from rfgen_sionna.generative.diffusion.drafts import (
    canonical_sentence,
    draft_beat,
    make_draft,
    motion_phase,
    sample_pace,
)
from rfgen_sionna.generative.diffusion.features import joint_positions, recentred
from rfgen_sionna.generative.diffusion.motion_sampling import CUTOFFS, MotionRequest, MotionSampler
from rfgen_sionna.generative.motion import MEAN_ADULT
from rfgen_sionna.generative.motion.skeleton import JOINT
from training.motion.motion_metrics import foot_slide, rhythm_score


@pytest.fixture(scope="module")
def source() -> DiffusionSource:
    return DiffusionSource()


def test_a_draft_walks_with_one_arm_up(source: DiffusionSource) -> None:
    rows = make_draft(("walk", "left_arm_raised"), 100, 3, source.model.hands)
    alone = make_draft(("walk",), 100, 3, source.model.hands)
    assert rows.shape == alone.shape
    assert np.allclose(rows[:, :9], alone[:, :9])
    places, plain = joint_positions(rows), joint_positions(alone)
    up, down = (p[:, JOINT["left_wrist"], 2] - p[:, JOINT["left_shoulder"], 2] for p in (places, plain))
    assert np.median(up) > 0.2
    assert np.median(down) < -0.2
    assert np.allclose(places[:, JOINT["right_wrist"]], plain[:, JOINT["right_wrist"]])


def test_a_draft_has_the_phase_of_what_it_repeats(source: DiffusionSource) -> None:
    rows = make_draft(("jumping_jacks",), 121, 2, source.model.hands)
    phase = motion_phase(rows)
    assert phase is not None
    height = joint_positions(rows)[:, JOINT["left_wrist"], 2]
    power = np.abs(np.fft.rfft(height - height.mean(), 4096))
    repetitions = (phase[100] - phase[20]) / (2 * np.pi) / 4.0
    assert repetitions == pytest.approx(np.argmax(power) * 20.0 / 4096, rel=0.06)
    assert motion_phase(rows[:10]) is None


@pytest.mark.parametrize("action", ["jumping_jacks", "push", "walk_straight"])
def test_a_moment_of_a_draft_has_its_beat_wherever_the_draft_begins(source: DiffusionSource, action: str) -> None:
    rows = make_draft((action,), 150, 4, source.model.hands)
    request = MotionRequest(canonical_sentence(action), 0, action=action)
    whole, later = draft_beat(source.model, request, rows), draft_beat(source.model, request, recentred(rows[11:]))
    assert whole is not None
    assert later is not None
    # cosine of the angle between the two phases
    assert np.mean(np.sum(whole[31:120, :2] * later[20:109, :2], axis=-1)) > 0.8


def test_a_held_pose_has_no_beat(source: DiffusionSource) -> None:
    rows = make_draft(("y_pose",), 100, 1, source.model.hands)
    assert draft_beat(source.model, MotionRequest(canonical_sentence("y_pose"), 0, action="y_pose"), rows) is None


@pytest.mark.parametrize("action", ["circle_clockwise", "pull"])
def test_motions_from_drafts_keep_their_rhythm_and_pace(source: DiffusionSource, action: str) -> None:
    scores, apart = [], []
    for seed in (1, 2):
        made = resampled_features(source.generate(canonical_sentence(action, "right"), seed=seed), source.model.hands)
        draft = make_draft((action,), 121, seed, source.model.hands, hand="right", speed=sample_pace(seed))
        scores.append(rhythm_score(made, 20.0))
        mine, its = motion_phase(made), motion_phase(draft)
        assert mine is not None
        assert its is not None
        assert (mine[100] - mine[20]) / (its[100] - its[20]) == pytest.approx(1.0, abs=0.05)
        apart.append(np.sqrt(np.mean((recentred(made)[:120] - draft[:120]) ** 2)))
    assert np.mean(scores) > 0.85
    # made anew, not handed through
    assert min(apart) > 0.01


def test_what_words_leave_open_is_drawn(source: DiffusionSource) -> None:
    assert {_up(source, seed) for seed in range(6)} == {"left", "right"}


def _up(source: DiffusionSource, seed: int) -> str:
    places = joint_positions(
        resampled_features(source.generate("a person raises one arm", seed=seed, duration=1.6), source.model.hands)
    )
    left, right = (places[:, JOINT[f"{s}_wrist"], 2].mean() for s in ("left", "right"))
    return "left" if left > right else "right"


def test_long_motions_from_drafts_have_no_seams(source: DiffusionSource) -> None:
    motion = source.generate("a person walks back and forth", duration=14.0, seed=1)
    assert motion.duration >= 14.0
    speed = np.linalg.norm(np.diff(motion.translation, axis=0), axis=-1) * motion.frame_rate
    turns = np.degrees(2 * np.arccos(np.clip(np.abs(np.sum(motion.rotations[1:] * motion.rotations[:-1], -1)), 0, 1)))
    assert speed.max() < 3.0
    assert turns.max() * motion.frame_rate < 2500.0


def test_drafts_only_where_they_are_meant() -> None:
    plain, drafted = DiffusionSource(refine=None), DiffusionSource()
    words = "a person pushes with the right hand"
    a, b = (s.generate(words, seed=1, duration=1.6) for s in (plain, drafted))
    assert np.abs(a.rotations - b.rotations).max() > 0.01
    # without a beat of its own choice there is no draft either
    c, d = (s.generate(words, seed=1, duration=1.6, rhythm=False) for s in (plain, drafted))
    assert np.array_equal(c.rotations, d.rotations)
    with pytest.raises(ValueError, match=r"refine: 1\.5; allowed"):
        DiffusionSource(refine=1.5)
    with pytest.raises(ValueError, match="manner: 'wild'; allowed are kinematic, mocap, any"):
        DiffusionSource(manner="wild")


def test_people_differ_in_pace_unless_they_are_told_one() -> None:
    free, slow = ([sample_pace(seed, asked) for seed in range(200)] for asked in (1.0, 0.8))
    assert min(free) == pytest.approx(0.75, abs=0.02)
    assert max(free) == pytest.approx(1.3, abs=0.03)
    assert 0.7 < min(slow) < max(slow) < 0.9
    assert np.exp(np.mean(np.log(slow))) == pytest.approx(0.8, abs=0.02)


def test_who_holds_a_pose_does_not_tremble(source: DiffusionSource) -> None:
    """Nor does the head of who makes a gesture."""
    shaky = DiffusionSource(sampler=MotionSampler(cutoff=CUTOFFS["kinematic"]))
    for action, joints in (("t_pose", slice(None)), ("push", [JOINT["left_knee"], JOINT["head"]])):
        calm, before = (
            np.abs(
                np.diff(joint_positions(resampled_features(s(action, 3.0, 2), s.model.hands))[:, joints], n=3, axis=0)
            ).mean()
            for s in (source, shaky)
        )
        assert calm < 0.3 * before


@pytest.mark.parametrize("strength", [0.3, 0.85, 0.95])
def test_a_draft_keeps_its_way_over_the_floor(source: DiffusionSource, strength: float) -> None:
    """Steps are made anew; where somebody is at a time, sway of half a second aside, and which way he faces, stay."""
    path = [(0.5, 0.2), (3.5, 0.2), (3.5, 2.2)]
    draft = source.generate("a person walks straight ahead", path=path, duration=5.0, seed=4)
    made = source.redo(draft, "a person walks", strength=strength, seed=1)
    n = min(len(draft.translation), len(made.translation))
    sway = 0.5 * draft.frame_rate
    gap, own = (
        gaussian_filter1d(m, sway, axis=0, mode="nearest")
        for m in (made.translation[:n, :2] - draft.translation[:n, :2], draft.translation[:n, :2])
    )
    assert np.ptp(own, axis=0).min() > 1.0
    assert np.linalg.norm(gap, axis=-1).max() < 0.12
    ahead = [Rotation.from_quat(m.rotations[:n, 0]).as_matrix()[:, :2, 0] for m in (made, draft)]
    turned = [np.unwrap(np.arctan2(y, x)) for x, y in (each.T for each in ahead)]
    assert np.abs(turned[0] - turned[1]).mean() < np.radians(15.0)
    assert foot_slide(made, MEAN_ADULT) < 0.1
    assert np.abs(made.rotations - draft.rotations[:n]).max() > 0.01
