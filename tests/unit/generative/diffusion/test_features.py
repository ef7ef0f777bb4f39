"""Features hold a motion without loss, and turn, mirror and lock it as bodies turn."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from rfgen_sionna.generative.diffusion.features import (
    CONTACTS,
    NUM_FEATURES,
    PARTS,
    ROOT,
    TRACKED,
    TRACKED_POSITIONS,
    HandBasis,
    decode,
    encode,
    heading,
    joint_positions,
    recentred,
    turned,
)
from rfgen_sionna.generative.diffusion.postprocessing import clamp_joint_angles
from rfgen_sionna.generative.motion import MEAN_ADULT, KinematicSource
from rfgen_sionna.generative.motion.foot_lock import lock_feet, root_from_feet
from rfgen_sionna.generative.motion.resampling import runs
from rfgen_sionna.generative.motion.skeleton import JOINT, NUM_BODY_JOINTS
from rfgen_sionna.records import Motion
from training.motion.motion_corpus import fit_hands, mirrored
from training.motion.motion_metrics import out_of_limits

SOURCE = KinematicSource(20.0)


@pytest.fixture(scope="module")
def motions() -> dict[str, Motion]:
    wanted = ("walk", "click", "push", "standing", "jumping_jacks")
    return {a: SOURCE(a, 4.0, 3, hand="left" if a in ("click", "push") else None) for a in wanted}


@pytest.fixture(scope="module")
def hands(motions: dict[str, Motion]) -> HandBasis:
    return fit_hands([motions["standing"]], list(motions.values()))


def angles(a: Motion, b: Motion) -> np.ndarray:
    """(frame, joint) angle between two motions' joint rotations [degrees]."""
    r = Rotation.from_quat(a.rotations.reshape(-1, 4)).inv() * Rotation.from_quat(b.rotations.reshape(-1, 4))
    return np.degrees(r.magnitude()).reshape(a.rotations.shape[:2])


@pytest.mark.parametrize("action", ["walk", "click", "push", "jumping_jacks"])
def test_what_goes_in_comes_out(action: str, motions: dict[str, Motion], hands: HandBasis) -> None:
    motion = motions[action]
    back = decode(encode(motion, hands), hands, 20.0)
    error = angles(motion, back)
    assert error[:, :NUM_BODY_JOINTS].max() < 1e-6
    # six components keep the fingers of the synthesiser within two degrees
    assert error[:, NUM_BODY_JOINTS:].max() < 2.0
    assert np.array_equal(back.translation, motion.translation)
    assert np.array_equal(back.contacts, motion.contacts)


def test_written_positions_are_those_of_the_rotations(motions: dict[str, Motion], hands: HandBasis) -> None:
    rows = encode(motions["walk"], hands)
    places = joint_positions(rows)
    assert np.allclose(
        rows[:, TRACKED_POSITIONS].reshape(-1, len(TRACKED), 3), (places - rows[:, None, ROOT])[:, list(TRACKED)]
    )


def test_parts_share_no_column_and_leave_none_out() -> None:
    columns = [c for part in PARTS.values() for c in part]
    assert sorted(columns) == list(range(NUM_FEATURES))


def test_a_mirror_image_swaps_sides_and_twice_is_the_same(motions: dict[str, Motion], hands: HandBasis) -> None:
    rows = encode(motions["push"], hands)
    image = mirrored(rows)
    assert np.allclose(mirrored(image), rows)
    places, other = joint_positions(rows), joint_positions(image)
    flip = [1.0, -1.0, 1.0]
    assert np.allclose(other[:, JOINT["right_wrist"]], places[:, JOINT["left_wrist"]] * flip, atol=1e-9)
    fingers, flipped = (decode(r, hands, 20.0) for r in (rows, image))
    left, right = JOINT["left_index1"], JOINT["right_index1"]
    assert np.allclose(np.abs(fingers.rotations[:, left]), np.abs(flipped.rotations[:, right]), atol=1e-6)


def test_recentring_starts_over_the_origin_facing_ahead(motions: dict[str, Motion], hands: HandBasis) -> None:
    rows = turned(encode(motions["walk"], hands), 1.1)
    rows[:, :2] += [3.0, -2.0]
    start = recentred(rows, 5)
    assert np.allclose(start[5, :2], 0.0)
    assert abs(heading(start)[5]) < 1e-9
    before, after = joint_positions(rows), joint_positions(start)
    assert np.allclose(
        np.linalg.norm(np.diff(before, axis=0), axis=-1), np.linalg.norm(np.diff(after, axis=0), axis=-1)
    )


def test_a_motion_without_the_body_s_joints_is_refused(motions: dict[str, Motion], hands: HandBasis) -> None:
    short = replace(motions["walk"], joint_names=tuple(reversed(motions["walk"].joint_names)))
    with pytest.raises(ValueError, match="joint_names"):
        encode(short, hands)


def test_locked_feet_stand_still(motions: dict[str, Motion], hands: HandBasis) -> None:
    rows = encode(motions["standing"], hands)
    rng = np.random.default_rng(0)
    rows[:, 0] += 0.03 * np.sin(np.arange(len(rows)) / 5.0) + 0.002 * rng.standard_normal(len(rows))
    sliding = decode(rows, hands, 20.0)
    locked = lock_feet(sliding)

    def slide(motion: Motion) -> float:
        toes = joint_positions(encode(motion, hands))[:, [JOINT["left_foot"], JOINT["right_foot"]], :2]
        return float(np.linalg.norm(np.diff(toes, axis=0), axis=-1).mean() * 20.0)

    assert slide(sliding) > 0.05
    assert slide(locked) < 0.002
    assert np.array_equal(locked.contacts, sliding.contacts)
    assert rows[:, CONTACTS].all()


def test_a_walker_is_carried_by_the_feet(motions: dict[str, Motion]) -> None:
    walk = motions["walk"]
    drift = np.linspace(0.0, 1.0, len(walk.translation))[:, None] * [0.6, -0.3, 0.0]
    back = root_from_feet(replace(walk, translation=walk.translation + drift))
    # what the drift adds to planted feet is taken off again; it stays only in what rolls
    path = back.translation - back.translation[0] - (walk.translation - walk.translation[0])
    assert np.abs(path[:, :2]).max() < 0.3 * np.linalg.norm(drift[-1])
    assert np.array_equal(back.translation[:, 2], walk.translation[:, 2])


def test_swinging_feet_clear_the_floor_and_none_is_under_it(motions: dict[str, Motion], hands: HandBasis) -> None:
    walk = motions["walk"]
    sunk = lock_feet(replace(walk, translation=walk.translation - [0.0, 0.0, 0.05]))
    places = joint_positions(encode(sunk, hands))
    toes = places[:, [JOINT["left_foot"], JOINT["right_foot"]], 2] - MEAN_ADULT.toe_height
    assert toes.min() > -0.005
    assert np.abs(sunk.translation[:, 2] - walk.translation[:, 2]).max() < 0.02


def test_joints_are_brought_within_their_limits_and_others_left(motions: dict[str, Motion]) -> None:
    push = motions["push"]
    bent = push.rotations.copy()
    s = np.sin(np.radians(85.0))
    bent[5:9, JOINT["left_elbow"]] = [0.0, 0.0, -s, np.cos(np.radians(85.0))]
    bent[3:6, JOINT["right_index2"]] = [np.sin(np.radians(60.0)), 0.0, 0.0, np.cos(np.radians(60.0))]
    broken = replace(push, rotations=bent)
    assert out_of_limits(broken) > 0.0
    mended = clamp_joint_angles(broken)
    assert out_of_limits(mended) == 0.0
    same = np.abs(np.sum(mended.rotations * push.rotations, axis=-1)) > 1.0 - 1e-9
    assert same[10:].all()


def test_runs_are_the_stretches_of_true() -> None:
    assert runs(np.array([True, True, False, True])) == [(0, 2), (3, 4)]
    assert runs(np.zeros(3, bool)) == []
