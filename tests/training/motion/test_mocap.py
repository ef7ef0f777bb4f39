"""The mocap pack lands on our skeleton."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from rfgen_sionna.generative.motion import MEAN_ADULT, PARENTS, KinematicSource
from rfgen_sionna.generative.motion.clip_editing import joint_places
from rfgen_sionna.generative.motion.rotations import to_matrices, to_quaternions
from rfgen_sionna.generative.motion.skeleton import JOINT_NAMES, NUM_BODY_JOINTS
from training.motion.mocap import read_pack

_TO_PACK = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])


def test_the_pack_comes_back_in_our_frame(tmp_path: Path) -> None:
    """A synthesised walk on the mean adult, in the pack's own axes (y up, facing z)."""
    original = KinematicSource(20.0)("walk", 9.0, 2)
    local = _TO_PACK @ to_matrices(original.rotations[:, :NUM_BODY_JOINTS]) @ _TO_PACK.T
    np.savez(
        tmp_path / "motions.npz",
        quat=np.roll(to_quaternions(local), 1, axis=-1).astype(np.float32),
        trans=(original.translation @ _TO_PACK.T).astype(np.float32),
        offsets=MEAN_ADULT.offsets[:NUM_BODY_JOINTS] @ _TO_PACK.T,
        parents=np.array(PARENTS[:NUM_BODY_JOINTS]),
        fps=20.0,
    )
    record = {
        "name": "clip", "start": 0, "frames": len(local), "action": "march", "captions": ["a person marches left"],
        "licence": "none", "subject": "nobody", "source": "here", "kind": "mocap",
    }  # fmt: skip
    (tmp_path / "clips.json").write_text(json.dumps([record]), encoding="utf-8")
    capture = read_pack(tmp_path)[0]
    assert capture.action == "march"
    assert capture.motion.joint_names == JOINT_NAMES[:NUM_BODY_JOINTS]
    assert np.allclose(capture.motion.translation[:, :2], original.translation[:, :2], atol=1e-6)
    places = [joint_places(motion)[:, :NUM_BODY_JOINTS] for motion in (capture.motion, original)]
    # legs reach for scaled ankles by inverse kinematics; the pelvis may be put on the floor anew
    lift = places[0][0, 0, 2] - places[1][0, 0, 2]
    assert abs(lift) < 0.02
    assert np.abs(places[0] - places[1] - [0.0, 0.0, lift]).max() < 0.01
    # planted is what is low and slow, which the synthesiser knows without looking
    assert capture.motion.contacts is not None
    assert original.contacts is not None
    assert np.mean(capture.motion.contacts == original.contacts) > 0.8


def test_a_pack_without_its_files_is_named(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match=r"motions\.npz"):
        read_pack(tmp_path)
