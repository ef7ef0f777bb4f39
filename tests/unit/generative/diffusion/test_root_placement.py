"""What a made motion may do on the floor: it neither whirls nor jumps."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.diffusion.constraints import MotionConstraint, resampled_features
from rfgen_sionna.generative.diffusion.diffusion_source import DiffusionSource
from rfgen_sionna.generative.diffusion.features import LOCAL, NUM_FEATURES, PARTS, TURN, encode, joint_positions, turned
from rfgen_sionna.generative.diffusion.inpainting import LATEST, draft_around
from rfgen_sionna.generative.diffusion.root_placement import limit_speed
from rfgen_sionna.generative.motion import KinematicSource
from rfgen_sionna.generative.motion.path_following import follow_motion


@pytest.fixture(scope="module")
def walk() -> FloatArray:
    """Ten seconds of walking back and forth at 20 Hz."""
    return encode(KinematicSource(20.0)("walk", 10.0, 1), DiffusionSource().model.hands)


def _fastest(rows: FloatArray) -> float:
    return float(np.linalg.norm(np.diff(joint_positions(rows), axis=0), axis=-1).max() * 20.0)


def test_what_people_do_is_left_alone(walk: FloatArray) -> None:
    assert limit_speed(walk) is walk


@pytest.mark.parametrize("turned", [2.0, 3.1])
def test_a_jump_is_spread(walk: FloatArray, turned: float) -> None:
    """Somebody who lies from one row to the next: he gets there in a while, and what is far from it stays."""
    rows = walk[:120].copy()
    c, s = np.cos(turned), np.sin(turned)
    tilt = np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])
    rows[60:, TURN] = (rows[60:, TURN].reshape(-1, 2, 3) @ tilt.T).reshape(-1, 6)
    assert _fastest(rows) > 20.0
    after = limit_speed(rows)
    assert _fastest(after) < 9.0
    np.testing.assert_allclose(after[:10], rows[:10], atol=1e-6)
    np.testing.assert_allclose(after[110:], rows[110:], atol=1e-6)
    given = np.arange(120) < 58
    held = limit_speed(rows, ~given)
    np.testing.assert_array_equal(held[given], rows[given])


def test_drafts_go_on_from_given_poses_and_lead_to_them(walk: FloatArray) -> None:
    """A walk between two stretches of itself elsewhere begins and ends where those are."""
    known, given = np.zeros((100, NUM_FEATURES)), np.zeros((100, 6))
    moved = walk[:100].copy()
    moved[:, :2] += (3.0, -1.0)
    known[40:60], given[40:60] = moved[40:60], 1.0
    draft = walk[17 : 17 + 100 + LATEST]
    rows = draft_around(draft, known, given)
    assert rows.shape == (100, NUM_FEATURES)
    np.testing.assert_array_equal(rows[40:60], moved[40:60])
    for seam in (40, 60):
        assert np.linalg.norm(rows[seam, :2] - rows[seam - 1, :2]) * 20.0 < 2.0
        assert np.abs(rows[seam, LOCAL] - rows[seam - 1, LOCAL]).max() < 0.6
    only_arms = np.zeros((100, 6))
    only_arms[:, 4] = 1.0
    rows = draft_around(draft, known, only_arms)
    arm = list(PARTS["left_arm"])
    np.testing.assert_array_equal(rows[:, arm], known[:, arm])
    np.testing.assert_array_equal(np.delete(rows, arm, axis=1), np.delete(draft[:100], arm, axis=1))


def test_what_is_not_given_beside_given_legs_is_the_drafts(walk: FloatArray) -> None:
    """Arms and trunk go along with a pelvis that is somewhere else and heads elsewhere."""
    known, given = turned(walk[30:130], 0.7), np.zeros((100, 6))
    given[:, :3] = 1.0  # place, pelvis, legs
    rows = draft_around(walk, known, given)
    legs = [*PARTS["place"], *PARTS["pelvis"], *PARTS["legs"]]
    np.testing.assert_array_equal(rows[:, legs], known[:, legs])
    np.testing.assert_allclose(rows[:, PARTS["trunk"]], walk[:100, PARTS["trunk"]], atol=1e-9)
    assert np.abs(rows[:, LOCAL]).max(axis=1).min() > 0.5


def test_a_jump_that_has_been_spread_stays_so_beside_a_wider_one(walk: FloatArray) -> None:
    """Two jumps of one who stands, one of half a metre and one of three: the smaller is gone after the first round."""
    rows = np.repeat(walk[:1], 320, axis=0)
    rows[80:, 0] += 0.6
    rows[240:, 0] += 3.0
    assert _fastest(limit_speed(rows)) < 9.0


def test_who_falls_keeps_facing_his_way() -> None:
    """Two falls on the back that tremble differently: past the vertical, where somebody faces from above turns over,
    and nobody spins for it."""
    stand = KinematicSource(60.0)("standing", 3.0, 1)
    n = len(stand.translation)
    tilt = Rotation.from_rotvec(np.linspace(0.0, -1.8, n)[:, None] * [0.0, 1.0, 0.0])
    falls = []
    for yaw in 0.05 * np.random.default_rng(0).standard_normal((2, n)):
        pelvis = Rotation.from_rotvec(yaw[:, None] * [0.0, 0.0, 1.0]) * tilt
        rotations = np.concatenate([pelvis.as_quat()[:, None], stand.rotations[:, 1:]], axis=1)
        falls.append(replace(stand, rotations=rotations))
    moved = follow_motion(*falls)
    apart = Rotation.from_quat(moved.rotations[:, 0]) * Rotation.from_quat(falls[0].rotations[:, 0]).inv()
    assert apart.magnitude().max() < 0.2


def test_given_poses_begin_a_captured_action_of_eight_seconds() -> None:
    """There is no synthesised draft of it, and one pose more than the network makes at once."""
    source = DiffusionSource()
    given = KinematicSource(20.0)("walk", 8.0, 1)
    motion = source.generate("a person dances", duration=8.0, seed=2, keep=MotionConstraint(given, stop=2.0))
    assert motion.duration == pytest.approx(8.0, abs=0.02)
    made, kept = (joint_positions(resampled_features(m, source.model.hands))[:41] for m in (motion, given))
    np.testing.assert_allclose(made, kept, atol=1e-4)
    assert _fastest(resampled_features(motion, source.model.hands)) < 10.0
