"""Bodies from the user's licensed model files; the files here are made up: balls around joints, in their format."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh

from rfgen_sionna.generative import Actor
from rfgen_sionna.generative.bodies import BodyFileError, animate, smpl_file, smpl_person
from rfgen_sionna.generative.bodies.smpl_rig import _JOINTS as LAYOUT
from rfgen_sionna.generative.motion import MEAN_ADULT, KinematicSource
from rfgen_sionna.generative.motion.skeleton import JOINT, JOINT_NAMES, PARENTS

RADIUS = 0.05


def made_up(folder: Path, model: str, **changes: np.ndarray) -> None:
    """A file in the format of `model`: a ball of 42 vertices around each joint, the first shape makes it taller."""
    names = LAYOUT[model]
    rest = MEAN_ADULT.rest_positions()
    follow = {
        "jaw": "head",
        "left_eye": "head",
        "right_eye": "head",
        "left_hand": "left_wrist",
        "right_hand": "right_wrist",
    }
    places = np.array([rest[JOINT[follow.get(n, n)]] for n in names])
    tree = {n: JOINT_NAMES[PARENTS[JOINT[n]]] if PARENTS[JOINT[n]] >= 0 else None for n in names if n in JOINT} | follow
    ball = trimesh.creation.icosphere(1, RADIUS)
    n = len(ball.vertices)
    ours = (places[:, None] + ball.vertices).reshape(-1, 3)
    theirs = ours[:, [1, 2, 0]]  # x to the left, y up, z ahead
    shapes = np.zeros((len(theirs), 3, 4))
    shapes[:, :, 0] = 0.05 * theirs
    one = np.repeat(np.eye(len(names)), n, axis=0)
    data = {
        "v_template": theirs,
        "shapedirs": shapes,
        "J_regressor": one.T / n,
        "weights": one,
        "kintree_table": np.array([[names.index(tree[m]) if tree[m] else 2**32 - 1 for m in names], range(len(names))]),
        "f": (ball.faces + n * np.arange(len(names))[:, None, None]).reshape(-1, 3),
    } | changes
    path = folder / model / f"{model.upper()}_NEUTRAL.npz"
    path.parent.mkdir(parents=True, exist_ok=True)
    np.savez(path, **{k: v for k, v in data.items() if v is not None})


@pytest.mark.parametrize("model", LAYOUT)
def test_a_body_has_its_joints_in_our_frame(tmp_path: Path, model: str) -> None:
    made_up(tmp_path, model)
    rig = smpl_person(tmp_path, model=model, betas=())
    joints = [JOINT[n] for n in JOINT_NAMES if n in LAYOUT[model]]
    np.testing.assert_allclose(rig.skeleton.offsets[joints], MEAN_ADULT.offsets[joints], atol=1e-9)
    assert rig.vertices[:, 2].min() == pytest.approx(0.0)
    left = rig.vertices[np.unique(rig.faces[rig.face_parts == rig.part_names.index("left_hand")])]
    assert left[:, 1].min() > 0.4
    toes = rig.heads[rig.bone_names.index("left_foot")] - rig.heads[rig.bone_names.index("left_ankle")]
    assert toes[0] > 0.1
    assert len(np.unique(rig.face_parts)) == len(rig.part_names)
    # fingers that a model lacks are kept in its skeleton, so that motions with fingers fit
    assert np.linalg.norm(rig.skeleton.offsets[JOINT["left_index2"]]) > 0.01


def test_shapes_make_other_people(tmp_path: Path) -> None:
    made_up(tmp_path, "smplx")
    mean, tall = (smpl_person(tmp_path, betas=b) for b in ((), (2.0,)))
    assert tall.height == pytest.approx(1.1 * mean.height)
    assert tall.mass == pytest.approx(1.1**3 * mean.mass, rel=1e-6)
    assert tall.skeleton.leg_length() == pytest.approx(1.1 * mean.skeleton.leg_length())
    # a ball of 80 triangles is a seventh smaller
    assert mean.mass == pytest.approx(980.0 * 55 * 4 / 3 * np.pi * RADIUS**3, rel=0.15)
    a, same, other = (smpl_person(tmp_path, seed=s) for s in (1, 1, 2))
    np.testing.assert_array_equal(a.vertices, same.vertices)
    assert abs(a.height - other.height) > 1e-3


def test_a_body_performs_a_motion_as_its_joints_say(tmp_path: Path) -> None:
    made_up(tmp_path, "smplx")
    rig = smpl_person(tmp_path, betas=(-1.0,))
    motion = KinematicSource(30.0)("jumping_jacks", 2.0, 1, skeleton=rig.skeleton)
    sequence = animate(rig, motion)
    for t in (0.3, 1.0, 1.6):
        vertices, joints = sequence.vertices(t), sequence.joints(t)
        # every ball stays around its joint
        middle = vertices.reshape(55, -1, 3).mean(axis=1)
        np.testing.assert_allclose(middle[rig.joint_bones], joints, atol=1e-9)
    wrist = [sequence.joints(t)[JOINT["left_wrist"], 2] for t in np.linspace(0.0, 2.0, 30)]
    assert np.ptp(wrist) > 0.8
    # a motion of other proportions is set on the floor
    foreign = animate(rig, KinematicSource(30.0)("walk", 2.0, 1))
    assert min(foreign.vertices(t)[:, 2].min() for t in np.linspace(0.0, 2.0, 9)) == pytest.approx(0.0, abs=0.02)


def test_actors_are_made_with_such_a_body(tmp_path: Path) -> None:
    made_up(tmp_path, "smpl")
    person = Actor.from_motion(KinematicSource(30.0)("push", 1.0, 1), body=smpl_person(tmp_path, model="smpl"))
    assert person.body is not None
    assert person.body.bone_names[-1] == "right_hand"
    assert "left_hand" in person.part_names


def test_errors_say_which_file_goes_where(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match=r"licensed file SMPLX_FEMALE\.npz, which goes to .*smplx.*smpl-x\.is"):
        smpl_person(tmp_path, gender="female")
    with pytest.raises(BodyFileError, match="model: 'star'; allowed are smpl, smplh, smplx"):
        smpl_file(tmp_path, "star")
    with pytest.raises(BodyFileError, match="gender: 'x'; allowed are neutral, female, male"):
        smpl_file(tmp_path, "smpl", "x")
    made_up(tmp_path, "smplh", weights=None)
    with pytest.raises(BodyFileError, match=r"SMPLH_NEUTRAL\.npz: weights missing"):
        smpl_person(tmp_path, model="smplh")
    made_up(tmp_path, "smplh", J_regressor=np.zeros((24, 7)))
    with pytest.raises(BodyFileError, match=r"J_regressor has shape \(24, 7\); allowed is \(52, 2184\)"):
        smpl_person(tmp_path, model="smplh")
    made_up(tmp_path, "smplh")
    with pytest.raises(BodyFileError, match=r"betas: shape \(5,\); allowed are up to 4"):
        smpl_person(tmp_path, model="smplh", betas=np.zeros(5))
    (tmp_path / "smpl").mkdir()
    (tmp_path / "smpl" / "SMPL_NEUTRAL.npz").write_bytes(b"nothing")
    with pytest.raises(BodyFileError, match=r"SMPL_NEUTRAL\.npz: not a readable \.npz file"):
        smpl_person(tmp_path, model="smpl")
