"""What is measured: rhythm, distance, slide, limits, and a judge that learns."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.diffusion.features import encode
from rfgen_sionna.generative.motion import MEAN_ADULT, KinematicSource
from training.motion import motion_metrics as metrics
from training.motion.motion_corpus import Entry, MotionCorpus, fit_hands
from training.motion.motion_metrics import rhythm_score
from training.motion.originality import originality
from training.motion.recogniser import train_action_classifier

SOURCE = KinematicSource(20.0)
WALK, JACKS, STANDING = (SOURCE(a, 6.0, 1) for a in ("walk", "jumping_jacks", "standing"))
HANDS = fit_hands([STANDING], [WALK, JACKS])


def test_jumping_jacks_have_rhythm_and_standing_has_none() -> None:
    assert rhythm_score(encode(JACKS, HANDS), 20.0) > 0.95
    assert rhythm_score(encode(STANDING, HANDS), 20.0) < 0.8


def test_frechet_is_the_squared_distance_of_shifted_sets() -> None:
    rng = np.random.default_rng(0)
    a = rng.standard_normal((500, 4))
    assert metrics.frechet(a, a) == pytest.approx(0.0, abs=1e-6)
    assert metrics.frechet(a, a + np.array([3.0, 0.0, 0.0, 0.0])) == pytest.approx(9.0, rel=1e-6)
    # normal distributions of the same mean: the squared difference of the deviations, per dimension
    assert metrics.frechet(a, 2.0 * (a - a.mean(axis=0)) + a.mean(axis=0)) == pytest.approx(4.0, rel=0.15)
    assert metrics.frechet_floor(a, 100, rng) < 0.5


def test_a_dragged_foot_slides() -> None:
    assert metrics.foot_slide(STANDING, MEAN_ADULT) < 0.01
    dragged = STANDING.translation + np.linspace(0.0, 1.2, len(STANDING.translation))[:, None] * [1.0, 0.0, 0.0]
    assert metrics.foot_slide(replace(STANDING, translation=dragged), MEAN_ADULT) == pytest.approx(0.2, rel=0.05)


def test_the_synthesiser_keeps_the_limits_and_a_broken_knee_does_not() -> None:
    assert metrics.out_of_limits(WALK) == 0.0
    broken = WALK.rotations.copy()
    broken[10:20, 4] = [0.0, -np.sin(0.4), 0.0, np.cos(0.4)]
    assert metrics.out_of_limits(replace(WALK, rotations=broken)) == pytest.approx(10 / len(broken))


def test_jerk_and_variance_grow_with_noise() -> None:
    rows = encode(WALK, HANDS)
    rng = np.random.default_rng(0)
    rough = rows + 0.01 * rng.standard_normal(rows.shape)
    assert metrics.mean_jerk(rough) > 1.5 * metrics.mean_jerk(rows)
    assert metrics.variance([rows, rows]) == 0.0
    assert metrics.variance([rows, encode(JACKS, HANDS)]) > 0.001


def test_a_copy_is_next_to_its_original() -> None:
    walk, jacks = encode(WALK, HANDS), encode(JACKS, HANDS)
    # stretches of the others begin at every fourth pose, as the middle two seconds of six do
    assert metrics.nearest([walk], [walk, jacks])[0] < 1e-3
    assert metrics.nearest([walk], [jacks])[0] > 0.05


def test_copies_of_synthesised_and_of_captured_clips_are_told_in_every_action() -> None:
    def entry(action: str, rows: FloatArray, source: str = "kinematic", *, held_out: bool = False) -> Entry:
        return Entry(
            rows.astype(np.float16), np.zeros((len(rows), 3), np.float16), (action,), source, "", held_out=held_out
        )

    actions = ("walk", "jumping_jacks", "t_pose")
    clips = {a: [encode(SOURCE(a, 6.0, seed), HANDS) for seed in range(7)] for a in actions}
    bank = [entry(a, rows) for a in actions for rows in clips[a][:3]]
    captured = encode(SOURCE("circle_clockwise", 6.0, 9), HANDS)
    bank += [entry("wash_window", captured, "mocap"), entry("walk", clips["walk"][6], held_out=True)]
    corpus = MotionCorpus(tuple(bank), HANDS, {}, np.zeros(1), np.ones(1))
    unseen = {a: clips[a][3:5] for a in actions}
    name = "distance to the nearest {} clip over that of unseen real clips"
    fresh = originality({a: clips[a][5:] for a in actions}, unseen, corpus)
    assert set(fresh[name.format("training") + ", by action"]) == set(actions)
    # a held-out clip is no copy
    assert min(least for _, least in fresh[name.format("training") + ", by action"].values()) > 0.2
    copied = originality({"walk": clips["walk"][:2], "t_pose": [captured, clips["t_pose"][6]]}, unseen, corpus)
    assert copied[name.format("training") + ", by action"]["walk"][0] < 0.02
    assert copied[name.format("captured training") + ", by action"]["t_pose"][1] < 0.02
    assert copied[name.format("captured training") + ", by action"]["walk"][1] > 0.2


def test_what_is_too_short_to_compare_is_refused() -> None:
    rows = encode(WALK, HANDS)
    with pytest.raises(ValueError, match="30 poses"):
        metrics.nearest([rows[:30]], [rows])
    assert metrics.nearest([rows], [rows[:30]])[0] == np.inf


def test_the_judge_tells_what_it_was_shown() -> None:
    rows, labels = [], []
    for action in ("push", "t_pose", "standing"):
        for seed in range(5):
            rows.append(encode(SOURCE(action, 5.0, seed), HANDS))
            labels.append(action)
    keep = [k for k in range(len(rows)) if k % 5]
    classifier = train_action_classifier([rows[k] for k in keep], [labels[k] for k in keep], steps=40)
    assert classifier.name([rows[k] for k in range(0, 15, 5)]) == ["push", "t_pose", "standing"]
    classify, chance = classifier.classify([rows[0][:30]])
    assert np.isfinite(classify).all()
    assert chance.sum() == pytest.approx(1.0)
