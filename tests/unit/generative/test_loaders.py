"""Clips and mesh sequences from files: frames converted right, bad files refused with what is allowed."""

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from rfgen_sionna.generative.actor import Actor
from rfgen_sionna.generative.bodies import Phenotype, animate, person
from rfgen_sionna.generative.bodies.sampled import SampledSequence, load_mesh_sequence
from rfgen_sionna.generative.motion.loaders import ClipError, load_motion
from rfgen_sionna.generative.motion.rotations import to_matrices
from rfgen_sionna.generative.motion.skeleton import JOINT, forward_kinematics, global_rotations
from rfgen_sionna.records import MeshSequence

UPRIGHT = np.array([np.pi / 2, 0.0, 0.0])
"""Root of someone who stands in a z-up world: SMPL's y-up body turned about x, then facing -y."""
SMPL = {"left_hip": 1, "left_knee": 4, "left_shoulder": 16, "left_elbow": 18, "right_elbow": 19}


def clip(tmp_path, frames=5, joints=52, root=UPRIGHT, rate_key="mocap_framerate", **rotations):
    poses, trans = np.zeros((frames, joints, 3)), np.zeros((frames, 3))
    poses[:, 0] = root
    for name, vector in rotations.items():
        poses[:, SMPL[name]] = vector
    trans[:, 2] = 1.1
    trans[:, 1] = -np.linspace(0.0, 1.0, frames)
    path = tmp_path / "clip.npz"
    np.savez(path, poses=poses.reshape(frames, -1), trans=trans, **{rate_key: 60.0}, betas=np.zeros(16))
    return path


def joints_of(motion):
    world = global_rotations(to_matrices(motion.rotations), motion.parents)
    return forward_kinematics(world, motion.translation, motion.offsets, motion.parents)


def test_a_standing_amass_clip_stands_and_walks_forwards(tmp_path):
    motion = load_motion(clip(tmp_path))
    p = joints_of(motion)
    assert motion.frame_rate == 60.0
    assert len(motion.joint_names) == 52
    # upright, facing +x, left at +y, moving forwards
    assert p[0, JOINT["head"], 2] > p[0, 0, 2] + 0.4
    assert p[0, JOINT["left_ankle"], 2] < p[0, 0, 2] - 0.6
    assert p[0, JOINT["left_wrist"], 1] > 0.5
    assert p[0, JOINT["left_foot"], 0] > p[0, JOINT["left_ankle"], 0] + 0.05
    np.testing.assert_allclose(p[-1, 0] - p[0, 0], [1.0, 0.0, 0.0], atol=1e-9)


def test_its_own_world_is_kept_when_asked(tmp_path):
    motion = load_motion(clip(tmp_path), recentre=False)
    forward = to_matrices(motion.rotations[0, 0]) @ [1.0, 0.0, 0.0]
    np.testing.assert_allclose(forward, [0.0, -1.0, 0.0], atol=1e-9)
    np.testing.assert_allclose(motion.translation[-1] - motion.translation[0], [0.0, -1.0, 0.0], atol=1e-9)


@pytest.mark.parametrize(
    ("joint", "vector", "moved", "direction"),
    [
        # SMPL's x is its left: turning about it bends the knee backwards, the hip forwards when negative
        ("left_knee", [1.2, 0, 0], "left_ankle", [-1, 0, 0]),
        ("left_hip", [-1.0, 0, 0], "left_ankle", [1, 0, 0]),
        # about y, upwards in SMPL: the left forearm swings to the front when negative, the right when positive
        ("left_elbow", [0, -1.2, 0], "left_wrist", [1, 0, 0]),
        ("right_elbow", [0, 1.2, 0], "right_wrist", [1, 0, 0]),
        # about z, forwards in SMPL: the left arm goes down when negative
        ("left_shoulder", [0, 0, -1.2], "left_wrist", [0, 0, -1]),
    ],
)
def test_joints_bend_the_way_smpl_bends(tmp_path, joint, vector, moved, direction):
    straight = joints_of(load_motion(clip(tmp_path)))
    bent = joints_of(load_motion(clip(tmp_path, **{joint: vector})))
    shift = (bent - straight)[0, JOINT[moved]]
    assert shift @ direction > 0.15
    assert shift @ direction == pytest.approx(np.abs(shift).max())


def test_a_y_up_clip_is_turned_up(tmp_path):
    poses, trans = np.zeros((4, 72)), np.zeros((4, 3))
    trans[:, 1] = 1.0
    trans[:, 2] = [0.0, 0.1, 0.2, 0.3]
    np.savez(tmp_path / "y.npz", poses=poses, trans=trans, fps=30)
    p = joints_of(load_motion(tmp_path / "y.npz", up="y"))
    assert p.shape[1] == 22
    assert p[0, JOINT["head"], 2] > 1.0
    np.testing.assert_allclose(p[-1, 0] - p[0, 0], [0.3, 0.0, 0.0], atol=1e-9)


@pytest.mark.parametrize(("joints", "kept"), [(22, 22), (24, 22), (52, 52), (55, 52)])
@pytest.mark.parametrize("key", ["mocap_framerate", "mocap_frame_rate", "fps"])
def test_known_layouts(tmp_path, joints, kept, key):
    motion = load_motion(clip(tmp_path, joints=joints, rate_key=key))
    assert motion.rotations.shape == (5, kept, 4)


def test_smplx_fingers_are_found_behind_jaw_and_eyes(tmp_path):
    poses = np.zeros((3, 55, 3))
    poses[:, 0] = UPRIGHT
    poses[:, 22:25] = 0.3
    poses[:, 25] = [0.0, 0.0, -0.5]
    np.savez(tmp_path / "x.npz", poses=poses.reshape(3, -1), trans=np.zeros((3, 3)), mocap_frame_rate=30)
    motion = load_motion(tmp_path / "x.npz")
    bent = np.abs(motion.rotations[0, :, 3]) < 0.999
    assert motion.joint_names[JOINT["left_index1"]] == "left_index1"
    assert np.flatnonzero(bent[1:]).tolist() == [JOINT["left_index1"] - 1]


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ({"trans": np.zeros((3, 3)), "fps": 30}, "'poses' is missing"),
        ({"poses": np.zeros((3, 156)), "fps": 30}, "'trans' is missing"),
        ({"poses": np.zeros((3, 156)), "trans": np.zeros((3, 3))}, "mocap_framerate"),
        ({"poses": np.zeros((3, 156)), "trans": np.zeros((3, 3)), "fps": 0}, "more than 0"),
        ({"poses": np.zeros((3, 100)), "trans": np.zeros((3, 3)), "fps": 30}, "100 columns.*156"),
        ({"poses": np.zeros((0, 156)), "trans": np.zeros((0, 3)), "fps": 30}, "0 frames"),
        ({"poses": np.zeros((3, 156)), "trans": np.zeros((2, 3)), "fps": 30}, r"allowed is \(3, 3\)"),
        ({"poses": np.full((3, 156), np.nan), "trans": np.zeros((3, 3)), "fps": 30}, "not finite"),
        ({"poses": np.zeros((3, 156)), "trans": np.zeros((3, 3)), "fps": "fast"}, "fps holds no numbers"),
        ({"poses": np.zeros((3, 156)), "trans": np.zeros((3, 3)), "fps": [30, 60]}, "allowed is one number"),
        ({"poses": np.zeros((3, 24, 3, 3)), "trans": np.zeros((3, 3)), "fps": 30}, "no rotations"),
        ({"root_orient": np.zeros((3, 3)), "pose_body": np.zeros((2, 63))}, "3, 2 frames"),
        ({"betas": np.zeros(16), "gender": "male"}, "'poses' is missing; the file has betas, gender"),
    ],
)
def test_bad_clips_are_refused(tmp_path, content, message):
    np.savez(tmp_path / "bad.npz", **content)
    with pytest.raises(ClipError, match=message):
        load_motion(tmp_path / "bad.npz")


def test_poses_in_parts_and_as_matrices(tmp_path):
    """As AMASS's SMPL-X files, the smplx package's parameters and regressors' matrices have them."""
    rng = np.random.default_rng(0)
    poses, trans = rng.normal(0.0, 0.3, (4, 156)), rng.normal(size=(4, 3))
    np.savez(
        tmp_path / "whole.npz", poses=poses, trans=trans, mocap_framerate=np.array([60.0]), gender=np.array(b"male")
    )
    whole = load_motion(tmp_path / "whole.npz")
    assert whole.frame_rate == 60.0
    root, body, hands = poses[:, :3], poses[:, 3:66], poses[:, 66:]
    amass = {"root_orient": root, "pose_body": body, "pose_hand": hands, "trans": trans, "mocap_frame_rate": 60.0}
    smplx = {"global_orient": root, "body_pose": body, "left_hand_pose": hands[:, :45], "transl": trans, "fps": 60}
    smplx["right_hand_pose"] = hands[:, 45:]
    matrices = Rotation.from_rotvec(poses.reshape(-1, 3)).as_matrix().reshape(4, 52, 3, 3)
    for name, content in (("amass", amass), ("smplx", smplx), ("r", {"poses": matrices, "trans": trans, "fps": 60})):
        np.savez(tmp_path / f"{name}.npz", betas=np.zeros((1, 10)), **content)
        same = load_motion(tmp_path / f"{name}.npz")
        np.testing.assert_allclose(same.translation, whole.translation)
        np.testing.assert_allclose(same.rotations, whole.rotations, atol=1e-7)


def test_files_that_are_not_there_or_not_clips(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"nothing\.npz"):
        load_motion(tmp_path / "nothing.npz")
    (tmp_path / "text.npz").write_text("hello")
    with pytest.raises(ClipError, match="not a readable"):
        load_motion(tmp_path / "text.npz")
    with pytest.raises(ClipError, match="up"):
        load_motion(clip(tmp_path), up="w")


def test_a_clip_on_a_body_stands_on_the_floor(tmp_path):
    body = person(Phenotype(height=1.7), seed=0)
    actor = Actor.from_motion(clip(tmp_path, frames=60), body=body)
    assert actor.motion.action == "clip"
    for t in (0.0, 0.4, 0.9):
        assert abs(actor.vertices(t)[:, 2].min()) < 0.01
    # fingers that the clip lacks are relaxed, not stretched
    bare = load_motion(clip(tmp_path, joints=22, frames=10))
    knuckle = animate(body, bare).joint_rotations(0.0)[[JOINT["left_wrist"], JOINT["left_index1"]]]
    assert np.trace(knuckle[0].T @ knuckle[1]) < 2.95


def write_meshes(folder, count=12, suffix=".ply"):
    folder.mkdir()
    mesh = trimesh.creation.icosphere(subdivisions=1, radius=0.2)
    for k in range(count):
        moved = mesh.copy()
        moved.apply_translation([0.01 * k**2, 0.0, 1.0])
        moved.export(folder / f"frame_{k}{suffix}")
    return mesh


@pytest.mark.parametrize("suffix", [".ply", ".obj"])
def test_a_folder_of_meshes_in_the_order_of_its_numbers(tmp_path, suffix):
    mesh = write_meshes(tmp_path / "seq", suffix=suffix)
    sequence = load_mesh_sequence(tmp_path / "seq", frame_rate=10.0)
    assert isinstance(sequence, MeshSequence)
    assert sequence.faces.shape == mesh.faces.shape
    assert sequence.duration == pytest.approx(1.1)
    # frame 10 comes after frame 9, and between frames the path is the parabola that the samples lie on
    for t in (0.0, 0.37, 1.0, 1.1):
        assert sequence.vertices(t)[:, 0].mean() == pytest.approx((10 * t) ** 2 * 0.01, abs=1e-5)
    assert sequence.joints(0.0).shape == (0, 3)
    assert set(sequence.face_parts) == {0}


def test_a_single_file_is_a_still_mesh(tmp_path):
    write_meshes(tmp_path / "seq", 3)
    sequence = load_mesh_sequence(tmp_path / "seq" / "frame_2.ply", frame_rate=5.0, name="car")
    assert sequence.part_names == ("car",)
    assert sequence.vertices(0.0)[:, 0].mean() == pytest.approx(0.04, abs=1e-6)
    assert sequence.duration == float("inf")


def test_bad_mesh_sequences_are_refused(tmp_path):
    write_meshes(tmp_path / "seq", 3)
    with pytest.raises(ClipError, match="frame_rate"):
        load_mesh_sequence(tmp_path / "seq", frame_rate=0.0)
    with pytest.raises(FileNotFoundError):
        load_mesh_sequence(tmp_path / "none", frame_rate=1.0)
    (tmp_path / "empty").mkdir()
    with pytest.raises(ClipError, match="holds no meshes"):
        load_mesh_sequence(tmp_path / "empty", frame_rate=1.0)
    trimesh.creation.box().export(tmp_path / "seq" / "frame_9.ply")
    with pytest.raises(ClipError, match=r"frame_9\.ply.*connectivity"):
        load_mesh_sequence(tmp_path / "seq", frame_rate=1.0)
    (tmp_path / "seq" / "frame_9.ply").write_bytes(b"no mesh")
    with pytest.raises(ClipError, match=r"frame_9\.ply: not a readable mesh"):
        load_mesh_sequence(tmp_path / "seq", frame_rate=1.0)


def test_a_mesh_sequence_as_an_actor(tmp_path):
    write_meshes(tmp_path / "seq", 5)
    actor = Actor.from_motion(tmp_path / "seq", frame_rate=10.0, material="metal", name="ball", position=(2, 0, 0))
    assert isinstance(actor.sequence, SampledSequence)
    assert actor.vertices(0.0)[:, 0].mean() == pytest.approx(2.0)
    with pytest.raises(ValueError, match="frame_rate: needed"):
        Actor.from_motion(tmp_path / "seq")


def test_axis_and_rate_can_always_be_given(tmp_path, caplog):
    """A rate replaces the file's own, with a warning; a file without one needs it; meshes stand as told."""
    path = clip(tmp_path)
    assert load_motion(path, frame_rate=30.0).frame_rate == 30.0
    assert "frame_rate=30 Hz replaces the file's 60 Hz" in caplog.text
    np.savez(tmp_path / "bare.npz", poses=np.tile(UPRIGHT, (5, 24)), trans=np.zeros((5, 3)))
    with pytest.raises(ClipError, match=r"frame_rate= \[Hz\] is needed"):
        load_motion(tmp_path / "bare.npz")
    assert load_motion(tmp_path / "bare.npz", frame_rate=25.0).frame_rate == 25.0
    with pytest.raises(ClipError, match="more than 0"):
        load_motion(path, frame_rate=-1.0)
    folder = tmp_path / "boxes"
    folder.mkdir()
    for k in range(3):
        box = trimesh.creation.box((0.4, 1.7, 0.3))
        box.apply_translation((0.0, 0.85, 0.05 * k))
        box.export(folder / f"frame{k:03d}.obj")
    caplog.clear()
    lying = load_mesh_sequence(folder, frame_rate=20.0).vertices(0.0)
    assert "up='y' would stand it up" in caplog.text
    assert np.ptp(lying[:, 2]) == pytest.approx(0.3)
    standing = Actor.from_motion(folder, frame_rate=20, up="y", position=(0, 0, 0), orientation=(0, 0, 0))
    assert np.ptp(standing.vertices(0.0)[:, 2]) == pytest.approx(1.7)
    # what was ahead along z is ahead along x
    assert standing.vertices(0.1)[:, 0].mean() == pytest.approx(0.1)
    with pytest.raises(ClipError, match="up: 'w'"):
        load_mesh_sequence(folder, frame_rate=20.0, up="w")


def test_an_index_where_there_is_one_motion_is_refused(tmp_path):
    file = clip(tmp_path, frames=60)
    with pytest.raises(ClipError, match="index 3; it holds one motion"):
        Actor.from_motion(file, index=3)
    with pytest.raises(ClipError, match="index 'a'"):
        Actor.from_motion(file, index="a")
