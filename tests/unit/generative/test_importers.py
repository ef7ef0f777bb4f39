"""Motion of other programs lands on our skeleton with its joints in place."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.motion import MEAN_ADULT, KinematicSource
from rfgen_sionna.generative.motion.clip_error import ClipError
from rfgen_sionna.generative.motion.importers import load_any_motion, positions_of_humanml
from rfgen_sionna.generative.motion.inverse_kinematics import motion_of_positions
from rfgen_sionna.generative.motion.rotations import to_matrices
from rfgen_sionna.generative.motion.skeleton import (
    JOINT,
    JOINT_NAMES,
    NUM_BODY_JOINTS,
    PARENTS,
    forward_kinematics,
    global_rotations,
)
from rfgen_sionna.records import Motion

_Y_UP = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
SOURCE = KinematicSource(20.0)
PICK = SOURCE("pick_up", 4.0, 1)
WALK = SOURCE("walk", 4.0, 1)


def joints(motion: Motion) -> FloatArray:
    """(frame, 22, 3) positions [m]."""
    world = global_rotations(to_matrices(motion.rotations), motion.parents)
    return forward_kinematics(world, motion.translation, motion.offsets, motion.parents)[:, :NUM_BODY_JOINTS]


def shape(places: FloatArray) -> FloatArray:
    """Distances between all joints, which no turn or shift changes."""
    return np.linalg.norm(places[:, :, None] - places[:, None], axis=-1)


@pytest.mark.parametrize("action", ["walk", "jumping_jacks", "pick_up", "push", "t_pose"])
def test_positions_give_the_joints_back(action: str) -> None:
    places = joints(SOURCE(action, 4.0, 1))
    made = motion_of_positions(places, 20.0)
    # the spine has no length of its own in the positions: bending shortens it by millimetres
    error = np.linalg.norm(joints(made) - places, axis=-1)
    toes = [JOINT["left_foot"], JOINT["right_foot"]]
    assert np.delete(error, toes, axis=1).max() < 0.008
    # feet near the floor are levelled, as the noise of cameras needs
    assert error[:, toes].max() < 0.035
    lengths = [np.linalg.norm(m.offsets[4:NUM_BODY_JOINTS], axis=-1) for m in (made, SOURCE(action, 4.0, 1))]
    limbs = [JOINT[f"{s}_{j}"] - 4 for s in ("left", "right") for j in ("knee", "ankle", "elbow", "wrist")]
    np.testing.assert_allclose(lengths[0][limbs], lengths[1][limbs], rtol=0.01)


def test_knees_and_elbows_are_hinges() -> None:
    made = motion_of_positions(joints(PICK), 20.0)
    local = to_matrices(made.rotations)
    for side in ("left", "right"):
        knee = local[:, JOINT[f"{side}_knee"]]
        # the knee turns about the y axis: it leaves y where it is
        assert np.abs(knee[:, 1, 1] - 1.0).max() < 0.01
        elbow = local[:, JOINT[f"{side}_elbow"]]
        assert np.abs(elbow[:, 2, 2] - 1.0).max() < 0.01


def test_bad_positions_are_named() -> None:
    with pytest.raises(ValueError, match="shape"):
        motion_of_positions(np.zeros((3, 21, 3)), 20.0)
    with pytest.raises(ValueError, match="frame_rate"):
        motion_of_positions(joints(WALK), 0.0)
    with pytest.raises(ValueError, match="finite"):
        motion_of_positions(joints(WALK) * np.nan, 20.0)


def humanml(places: FloatArray) -> FloatArray:
    """(frame - 1, 263) features of (frame, 22, 3) positions, y up; what nobody reads is 0."""
    across = places[:, JOINT["left_hip"]] - places[:, JOINT["right_hip"]]
    # turning the body by this angle about y makes it face z
    yaw = np.unwrap(np.arctan2(across[:, 2], across[:, 0]))
    half = 0.5 * (yaw - yaw[0])
    c, s = np.cos(yaw - yaw[0]), np.sin(yaw - yaw[0])
    turn = np.zeros((len(places), 3, 3))
    turn[:, 0, 0], turn[:, 0, 2], turn[:, 1, 1], turn[:, 2, 0], turn[:, 2, 2] = c, s, 1.0, -s, c
    n = len(places) - 1
    out = np.zeros((n, 263))
    out[:, 0] = np.diff(half)
    step = np.einsum("nij,nj->ni", turn[1:], np.diff(places[:, 0], axis=0))
    out[:, 1:3] = step[:, [0, 2]]
    out[:, 3] = places[:n, 0, 1]
    rest = places[:n, 1:].copy()
    rest[..., [0, 2]] -= places[:n, :1][..., [0, 2]]
    out[:, 4:67] = np.einsum("nij,nkj->nki", turn[:n], rest).reshape(n, -1)
    return out


def test_humanml_features_give_the_walk_back(tmp_path: Path) -> None:
    places = joints(WALK) @ _Y_UP.T
    rows = humanml(places)
    back = positions_of_humanml(rows)
    start = places[0, 0] * [1.0, 0.0, 1.0]
    assert np.abs(back - (places[:-1] - start)).max() < 1e-9
    np.save(tmp_path / "clip.npy", rows)
    motion = load_any_motion(tmp_path / "clip.npy", action="walk")
    assert np.abs(shape(joints(motion)) - shape(joints(WALK)[:-1])).max() < 0.04
    assert motion.frame_rate == 20.0


def test_mdm_results_give_the_motion_that_is_asked_for(tmp_path: Path) -> None:
    motions = np.stack([np.moveaxis(joints(m) @ _Y_UP.T, 0, -1) for m in (WALK, PICK)])
    results = {"motion": motions, "text": ["a person walks", "a person picks up"], "lengths": np.array([81, 60])}
    np.save(tmp_path / "results.npy", np.array(results, object), allow_pickle=True)
    motion = load_any_motion(tmp_path / "results.npy", index=1)
    assert motion.prompt == "a person picks up"
    assert len(motion.translation) == 60
    assert np.abs(shape(joints(motion)) - shape(joints(PICK)[:60])).max() < 0.015
    assert np.percentile(joints(motion)[..., 2].min(axis=1), 5.0) == pytest.approx(0.0, abs=0.02)
    with pytest.raises(ClipError, match="index 2"):
        load_any_motion(tmp_path / "results.npy", index=2)


def test_a_pickle_that_could_run_is_refused(tmp_path: Path) -> None:
    class Trap:
        def __reduce__(self) -> tuple:
            return (print, ("run",))

    np.save(tmp_path / "trap.npy", np.array({"motion": Trap()}, object), allow_pickle=True)
    with pytest.raises(ClipError, match=r"builtins\.print"):
        load_any_motion(tmp_path / "trap.npy")


def bvh(motion: Motion, names: dict[str, str], up: str = "y") -> str:
    """A BVH file of a motion, in centimetres."""
    axes = _Y_UP if up == "y" else np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])  # it faces -y
    local = axes @ to_matrices(motion.rotations[:, :NUM_BODY_JOINTS]) @ axes.T
    offsets = 100.0 * MEAN_ADULT.offsets[:NUM_BODY_JOINTS] @ axes.T
    order: list[int] = []

    def node(j: int, depth: int) -> str:
        order.append(j)
        pad = "  " * depth
        kind = "ROOT" if j == 0 else "JOINT"
        channels = "6 Xposition Yposition Zposition " if j == 0 else "3 "
        children = [k for k in range(NUM_BODY_JOINTS) if PARENTS[k] == j]
        inner = (
            "".join(node(k, depth + 1) for k in children)
            or f"{pad}  End Site\n{pad}  {{\n{pad}  OFFSET 0 1 0\n{pad}  }}\n"
        )
        x, y, z = offsets[j]
        return (
            f"{pad}{kind} {names.get(JOINT_NAMES[j], JOINT_NAMES[j])}\n{pad}{{\n{pad}  OFFSET {x} {y} {z}\n"
            f"{pad}  CHANNELS {channels}Zrotation Yrotation Xrotation\n{inner}{pad}}}\n"
        )

    head = "HIERARCHY\n" + node(0, 0)
    angles = Rotation.from_matrix(local.reshape(-1, 3, 3)).as_euler("ZYX", degrees=True).reshape(len(local), -1, 3)
    rows = np.concatenate([100.0 * motion.translation @ axes.T, angles[:, order].reshape(len(local), -1)], axis=1)
    body = "\n".join(" ".join(f"{v:.6f}" for v in row) for row in rows)
    return f"{head}MOTION\nFrames: {len(rows)}\nFrame Time: {1.0 / motion.frame_rate}\n{body}\n"


_CMU = {
    "pelvis": "Hips", "spine1": "LowerBack", "spine2": "Spine", "spine3": "Spine1", "neck": "Neck", "head": "Head",
    **{f"{s}_{a}": f"{s.capitalize()}{b}" for s in ("left", "right") for a, b in (
        ("hip", "UpLeg"), ("knee", "Leg"), ("ankle", "Foot"), ("foot", "ToeBase"), ("collar", "Shoulder"),
        ("shoulder", "Arm"), ("elbow", "ForeArm"), ("wrist", "Hand"))},
}  # fmt: skip


def _styled(limbs: str, style: str) -> dict[str, str]:
    """Names of the limbs' joints as other programs have them; {side} and {joint} in `style`."""
    joints = ("hip", "knee", "ankle", "foot", "collar", "shoulder", "elbow", "wrist")
    own = {
        f"{side}_{ours}": style.format(side=side[0], joint=theirs)
        for side in ("left", "right")
        for ours, theirs in zip(joints, limbs.split(), strict=True)
    }
    return {**{name: f"Bip01 {name.title()}" if "Bip01" in style else name for name in JOINT_NAMES[:22]}, **own}


STYLES = {
    "cmu": _CMU,
    "mixamo": {ours: f"mixamorig:{theirs}" for ours, theirs in _CMU.items()},
    "mixamo by others": {ours: f"mixamorig_{theirs}" for ours, theirs in _CMU.items()},
    "smpl": {},
    "smpl short": _styled("Hip Knee Ankle Foot Collar Shoulder Elbow Wrist", "{side}_{joint}"),
    "unreal": _styled("thigh calf foot ball clavicle upperarm lowerarm hand", "{joint}_{side}"),
    "blender": _styled("thigh shin foot toe shoulder upper_arm forearm hand", "{joint}.{side}"),
    "3ds max": _styled("Thigh Calf Foot Toe0 Clavicle UpperArm Forearm Hand", "Bip01 {side} {joint}"),
}


STYLES |= {
    "kinect": {
        **{f"{s}_{ours}": f"{theirs}{s.title()}" for s in ("left", "right") for ours, theirs in (
            ("hip", "Hip"), ("knee", "Knee"), ("ankle", "Ankle"), ("foot", "Foot"), ("collar", "Clavicle"),
            ("shoulder", "Shoulder"), ("elbow", "Elbow"), ("wrist", "Wrist"))},
        "pelvis": "SpineBase", "spine3": "SpineMid", "neck": "SpineShoulder", "head": "Head",
    },
    "optitrack": {
        **_styled("Thigh Shin Foot Toe Shoulder UArm FArm Hand", "Skeleton1_{side}{joint}"),
        "pelvis": "Skeleton1_Hip", "spine1": "Skeleton1_Ab", "spine2": "Skeleton1_Ab2", "spine3": "Skeleton1_Chest",
        "neck": "Skeleton1_Neck", "head": "Skeleton1_Head",
    },
    "rokoko": {
        **{f"{s}_{ours}": f"{s.title()}{theirs}" for s in ("left", "right") for ours, theirs in (
            ("hip", "Thigh"), ("knee", "Shin"), ("ankle", "Foot"), ("foot", "Toe"), ("collar", "Shoulder"),
            ("shoulder", "Arm"), ("elbow", "ForeArm"), ("wrist", "Hand"))},
        "pelvis": "Hips", "spine1": "Spine", "spine2": "Spine2", "spine3": "Spine3", "neck": "Neck", "head": "Head",
    },
    "xsens": {
        **{f"{s}_{ours}": f"{s.title()}{theirs}" for s in ("left", "right") for ours, theirs in (
            ("hip", "Hip"), ("knee", "Knee"), ("ankle", "Ankle"), ("foot", "Toe"), ("collar", "Collar"),
            ("shoulder", "Shoulder"), ("elbow", "Elbow"), ("wrist", "Wrist"))},
        "pelvis": "Hips", "spine1": "Chest", "spine2": "Chest2", "spine3": "Chest4", "neck": "Neck", "head": "Head",
    },
    "xsens segments": {
        **{f"{s}_{ours}": f"{s.title()}{theirs}" for s in ("left", "right") for ours, theirs in (
            ("hip", "UpperLeg"), ("knee", "LowerLeg"), ("ankle", "Foot"), ("foot", "Toe"), ("collar", "Shoulder"),
            ("shoulder", "UpperArm"), ("elbow", "ForeArm"), ("wrist", "Hand"))},
        "pelvis": "Pelvis", "spine1": "L5", "spine2": "L3", "spine3": "T8", "neck": "Neck", "head": "Head",
    },
    "motion builder": {ours: f"Character1_{theirs}" for ours, theirs in _CMU.items()},
    "biped with underscores": {
        ours: theirs.replace(" ", "_").replace("Bip01", "Bip001") for ours, theirs in STYLES["3ds max"].items()
    },
    "vrm": {
        **_styled("UpperLeg LowerLeg Foot ToeBase Shoulder UpperArm LowerArm Hand", "J_Bip_{side}_{joint}"),
        "pelvis": "J_Bip_C_Hips", "spine1": "J_Bip_C_Spine", "spine2": "J_Bip_C_Chest",
        "spine3": "J_Bip_C_UpperChest", "neck": "J_Bip_C_Neck", "head": "J_Bip_C_Head",
    },
    "namespace": {ours: f"Jane:Reference|{theirs}" for ours, theirs in _CMU.items()},
}  # fmt: skip


@pytest.mark.parametrize("style", STYLES)
def test_a_bvh_file_gives_the_limbs_back(tmp_path: Path, style: str) -> None:
    path = tmp_path / "pick.bvh"
    path.write_text(bvh(PICK, STYLES[style]), encoding="utf-8")
    motion = load_any_motion(path, action="pick_up")
    assert motion.frame_rate == pytest.approx(20.0)
    made, true = joints(motion), joints(PICK)
    limbs = [JOINT[f"{s}_{j}"] for s in ("left", "right") for j in ("hip", "knee", "ankle", "foot")]
    assert np.abs(shape(made[:, limbs]) - shape(true[:, limbs])).max() < 0.02
    hands = [JOINT[f"{s}_{j}"] for s in ("left", "right") for j in ("shoulder", "elbow", "wrist")]
    # the trunk is only known to run from hips to shoulders, evenly
    assert np.abs(shape(made[:, hands]) - shape(true[:, hands])).max() < 0.05


def test_a_bvh_file_with_z_up_is_the_same_motion(tmp_path: Path) -> None:
    """Whether it is said or seen."""
    for up in ("y", "z"):
        (tmp_path / f"{up}.bvh").write_text(bvh(WALK, _CMU, up=up), encoding="utf-8")
    one, seen, said = (
        joints(load_any_motion(tmp_path / f"{up}.bvh", up=told)) for up, told in (("y", None), ("z", None), ("z", "z"))
    )
    np.testing.assert_allclose(seen, one, atol=2e-3)
    np.testing.assert_array_equal(seen, said)
    with pytest.raises(ClipError, match=r"up: 'w'.*'y', 'x'"):
        load_any_motion(tmp_path / "y.bvh", up="w")
    lying = joints(load_any_motion(tmp_path / "z.bvh", up="y"))
    assert np.ptp(lying[..., 2], axis=1).mean() < 0.7 * np.ptp(one[..., 2], axis=1).mean()


def test_a_bvh_file_of_one_who_crawls_has_y_up(tmp_path: Path) -> None:
    """His head is ahead of his hips, along z; at rest it is over them, along y."""
    crawling = Rotation.from_rotvec([0.0, 1.4, 0.0]) * Rotation.from_quat(WALK.rotations[:, 0])
    rotations = WALK.rotations.copy()
    rotations[:, 0] = crawling.as_quat()
    path = tmp_path / "crawl.bvh"
    path.write_text(bvh(replace(WALK, rotations=rotations), _CMU), encoding="utf-8")
    np.testing.assert_array_equal(joints(load_any_motion(path)), joints(load_any_motion(path, up="y")))


def test_a_bvh_file_whose_hips_are_no_root_travels(tmp_path: Path) -> None:
    """A still root over everything, as game engines have it: the hips' own channels carry the way."""
    text = bvh(WALK, _CMU)
    head, rows = text.split("MOTION")
    nested = (
        head.replace("HIERARCHY\nROOT Hips", "HIERARCHY\nROOT Ground\n{\nOFFSET 0 0 0\nCHANNELS 0\nJOINT Hips") + "}\n"
    )
    (tmp_path / "own.bvh").write_text(text, encoding="utf-8")
    (tmp_path / "nested.bvh").write_text(f"{nested}MOTION{rows}", encoding="utf-8")
    own, other = (joints(load_any_motion(tmp_path / name)) for name in ("own.bvh", "nested.bvh"))
    np.testing.assert_allclose(other, own, atol=1e-9)
    assert np.ptp(other[:, 0, 0]) > 0.5


def test_a_bvh_file_with_two_people_gives_the_one_that_is_asked_for(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    (one, rows), (other, more) = (bvh(m, _CMU).split("MOTION") for m in (WALK, PICK))
    header = "\n".join(rows.splitlines()[:3])
    both = "\n".join(f"{a} {b}" for a, b in zip(rows.splitlines()[3:], more.splitlines()[3:], strict=True))
    path = tmp_path / "two.bvh"
    path.write_text(one + other.removeprefix("HIERARCHY\n") + "MOTION" + header + "\n" + both, encoding="utf-8")
    (tmp_path / "pick.bvh").write_text(bvh(PICK, _CMU), encoding="utf-8")
    second = load_any_motion(path, index=1)
    np.testing.assert_allclose(joints(second), joints(load_any_motion(tmp_path / "pick.bvh")), atol=1e-9)
    assert "2 people; index=1 of 0 to 1 is taken" in caplog.text
    with pytest.raises(ClipError, match="index 2; it holds 2 people"):
        load_any_motion(path, index=2)


def test_a_clip_that_never_stands_is_told(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    poses = np.zeros((30, 66))
    np.savez(tmp_path / "fit.npz", poses=poses, trans=np.zeros((30, 3)), mocap_framerate=30.0)  # SMPL at rest: y up
    load_any_motion(tmp_path / "fit.npz", up="y")
    assert "never stands" not in caplog.text
    load_any_motion(tmp_path / "fit.npz")
    assert "never stands" in caplog.text
    assert "up='y'" in caplog.text


def test_a_bvh_file_without_arms_or_sense_is_named(tmp_path: Path) -> None:
    names = {**_CMU, "left_elbow": "Tentacle"}
    (tmp_path / "odd.bvh").write_text(bvh(PICK, names), encoding="utf-8")
    with pytest.raises(ClipError, match="left_elbow"):
        load_any_motion(tmp_path / "odd.bvh")
    (tmp_path / "not.bvh").write_text("hello", encoding="utf-8")
    with pytest.raises(ClipError, match="HIERARCHY"):
        load_any_motion(tmp_path / "not.bvh")
    cut = bvh(PICK, _CMU).rsplit(" ", 5)[0]
    (tmp_path / "cut.bvh").write_text(cut, encoding="utf-8")
    with pytest.raises(ClipError, match="channels are needed"):
        load_any_motion(tmp_path / "cut.bvh")


def test_other_endings_and_missing_files_are_named(tmp_path: Path) -> None:
    (tmp_path / "clip.fbx").write_bytes(b"x")
    with pytest.raises(ClipError, match=r"\.fbx"):
        load_any_motion(tmp_path / "clip.fbx")
    with pytest.raises(FileNotFoundError, match="none"):
        load_any_motion(tmp_path / "none.bvh")
    for empty in (np.zeros((0, 263)), np.zeros((0, 22, 3))):
        np.save(tmp_path / "empty.npy", empty)
        with pytest.raises(ClipError, match=r"empty\.npy: no frames"):
            load_any_motion(tmp_path / "empty.npy")
    np.save(tmp_path / "odd.npy", np.array(1.0))
    with pytest.raises(ClipError, match="shape"):
        load_any_motion(tmp_path / "odd.npy")
    np.save(tmp_path / "odd.npy", np.zeros((4, 5)))
    with pytest.raises(ClipError, match="shape"):
        load_any_motion(tmp_path / "odd.npy")


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (np.zeros((30, 263)), "joints coincide"),
        (np.random.default_rng(0).normal(size=(30, 263)), "Std.npy, and Mean.npy"),
        (np.zeros((30, 251)), r"\(30, 251\); allowed are"),
        (np.zeros((1, 30, 263)), "allowed are"),
        (joints(WALK) * np.nan, "not finite"),
        ({"motion": np.zeros((2, 25, 6, 60))}, "allowed is"),
    ],
)
def test_arrays_that_are_no_motion_are_named(tmp_path: Path, content: object, message: str) -> None:
    np.save(tmp_path / "x.npy", content)  # type: ignore[arg-type]
    with pytest.raises(ClipError, match=message):
        load_any_motion(tmp_path / "x.npy")
    whole = (tmp_path / "x.npy").read_bytes()
    (tmp_path / "cut.npy").write_bytes(whole[: len(whole) // 2])
    with pytest.raises(ClipError, match=r"cut\.npy"):
        load_any_motion(tmp_path / "cut.npy")


@pytest.mark.parametrize(
    ("old", "new"), [("}", ""), ("OFFSET", "OFFSET x"), ("Zrotation", "Wrotation"), ("CHANNELS 3", "CHANNELS y")]
)
def test_broken_skeletons_are_named(tmp_path: Path, old: str, new: str) -> None:
    path = tmp_path / "arm.BVH"
    path.write_text(bvh(WALK, _CMU), encoding="utf-8")
    assert load_any_motion(path).duration > 3.0
    path.write_text(path.read_text(encoding="utf-8").replace(old, new, 1), encoding="utf-8")
    with pytest.raises(ClipError, match=r"arm\.BVH: its HIERARCHY cannot be read"):
        load_any_motion(path)
