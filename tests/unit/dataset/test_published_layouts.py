"""The layouts of RadHAR, mmMesh and DI-Gesture, read the way that their own programs read them."""

import csv
import json

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from rfgen_sionna.dataset import open_dataset
from rfgen_sionna.dataset.gesture_layout import to_di_gesture
from rfgen_sionna.dataset.mesh_layout import SMPL_PARENTS, TO_MMMESH, TO_SMPL, mmmesh_points, smpl_rotations, to_mmmesh
from rfgen_sionna.dataset.radhar_layout import VOXELS, radhar_points, to_radhar, voxel_counts
from tests.unit.dataset.small_sets import frames_of, make_set, small_radar


def _voxels_step_by_step(points):
    """The rule of RadHAR's voxels.py, cell by cell: each cell spans one step, from the edge before its own."""
    counts = np.zeros(VOXELS)
    low, high = points.min(axis=0), points.max(axis=0)
    steps = (high - low) / VOXELS
    for point in points:
        place = []
        for value, first, last, step, number in zip(point, low, high, steps, VOXELS, strict=True):
            edge = before = first
            found = None
            for cell in range(number):
                if edge > last:
                    break
                if before <= value < edge:
                    found = cell
                    break
                before, edge = edge, edge + step
            place.append(found)
        if None not in place:
            counts[tuple(place)] += 1
    return counts


@pytest.mark.parametrize("count", [1, 2, 7, 60])
def test_voxels_are_counted_as_radhar_counts_them(count):
    rng = np.random.default_rng(count)
    points = np.round(rng.standard_normal((count, 3)) * [0.5, 1.0, 0.3], 2)
    np.testing.assert_array_equal(voxel_counts(points), _voxels_step_by_step(points))


def test_points_in_one_plane_have_no_voxels():
    points = np.stack([np.arange(5.0), np.arange(5.0), np.zeros(5)], axis=1)
    assert voxel_counts(points).sum() == _voxels_step_by_step(points).sum() == 0


def _read_text(path):
    """Frames of (x, y, z) of a text file: a frame begins with point 0."""
    words = path.read_text().split()
    values = {name: [float(words[k + 1]) for k, word in enumerate(words) if word == f"{name}:"] for name in "xyz"}
    starts = [int(words[k + 1]) == 0 for k, word in enumerate(words) if word == "point_id:"]
    numbers = np.cumsum(starts) - 1
    points = np.stack([values[name] for name in "xyz"], axis=1)
    return [points[numbers == number] for number in range(numbers[-1] + 1)]


@pytest.fixture(scope="module")
def long_set(tmp_path_factory):
    return make_set(tmp_path_factory.mktemp("radhar") / "set", count=2, splits=("train",), frames=75)


def test_radhar_voxels_are_those_of_the_text_files(long_set, tmp_path):
    to_radhar(long_set, tmp_path / "out")
    assert sorted(path.name for path in (tmp_path / "out" / "Train").iterdir()) == ["push", "wave"]
    for action, number in (("push", 0), ("wave", 1)):
        frames = _read_text(tmp_path / "out" / "Train" / action / f"{number:06d}.txt")
        used = len(frames) - 2  # voxels.py leaves out the last two
        windows = [
            np.stack([voxel_counts(points) for points in frames[first : first + 60]])
            for first in range(0, used - 60 + 1, 10)
        ]
        with np.load(tmp_path / "out" / f"Train_Data_voxels_{action}.npz", allow_pickle=False) as file:
            voxels, labels = file["arr_0"], file["arr_1"]
        assert voxels.shape == (len(windows), 60, 10, 32, 32)
        np.testing.assert_array_equal(voxels, np.stack(windows))
        assert labels.tolist() == [action] * len(windows)
        assert voxels.sum() > 0


def test_radhar_text_has_the_lines_of_the_original(long_set, tmp_path):
    to_radhar(long_set, tmp_path / "out", voxels=False)
    lines = (tmp_path / "out" / "Train" / "push" / "000000.txt").read_text().splitlines()
    names = ["header", "seq", "stamp", "secs", "nsecs", "frame_id", "point_id", "x", "y", "z", "range", "velocity",
             "doppler_bin", "bearing", "intensity"]  # fmt: skip
    assert [line.split(":")[0].strip() for line in lines[:15]] == names
    assert lines[0] == "header: "
    assert lines[5] == '  frame_id: "ti_mmwave"'
    assert lines[15] == "---"
    assert not list((tmp_path / "out").glob("*.npz"))


def test_radhar_axes_and_units(long_set):
    with open_dataset(long_set)[0] as run:
        found, own = radhar_points(run)[3], run.representation("point_cloud").frame(3).astype(float)
        radar = run.radar
    device = (own[:, :3] - radar.position) @ radar.rotation  # x ahead, y left, z up
    np.testing.assert_allclose(found[:, :3], device * [1, -1, 1], atol=1e-4)
    np.testing.assert_allclose(found[:, 6], np.degrees(np.arctan2(found[:, 1], found[:, 0])), atol=1e-3)
    approaching = found[:, 4] < -0.6 * radar.velocity_resolution
    assert approaching.any()
    assert (found[approaching, 5] < radar.waveform.num_loops // 2).all()


def test_radhar_windows_need_their_frames(tmp_path):
    folder = make_set(tmp_path / "set", count=1)
    with pytest.raises(ValueError, match=r"5 frames.*voxels=False"):
        to_radhar(folder, tmp_path / "out", voxels=True)
    with pytest.warns(UserWarning, match=r"5 frames.*alone"):
        to_radhar(folder, tmp_path / "out")
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["Train"]


@pytest.fixture(scope="module")
def body_set(tmp_path_factory):
    return make_set(tmp_path_factory.mktemp("mesh") / "set", count=4, keep=("adc", "joints", "labels", "body"))


def test_mmmesh_rotations_pose_the_skeleton(body_set, tmp_path):
    to_mmmesh(body_set, tmp_path / "out")
    part = tmp_path / "out" / "train"
    rotations, joints = np.load(part / "pmat.npy"), np.load(part / "joints.npy")
    pelvis, records = np.load(part / "pelvis.npy"), json.loads((part / "recordings.json").read_text())["recordings"]
    assert rotations.shape == (len(records), 1, 5, 24, 3, 3)
    *_, offsets = next(iter(frames_of(small_radar(), records[1]["recording"], records[1]["action"], 5)))
    # Forward kinematics as SMPL has it: bones in SMPL's axes, each turned by the rotations up to its parent.
    world = [rotations[1, 0, 2, 0]]
    placed = [pelvis[1, 0, 2]]
    for joint in range(1, 22):
        parent = SMPL_PARENTS[joint]
        placed.append(placed[parent] + world[parent] @ (TO_SMPL @ offsets[joint]))
        world.append(world[parent] @ rotations[1, 0, 2, joint])
    # The set's own bones turn with the joint at their end instead of the one at their root.
    own = [TO_MMMESH @ np.array([3.0, 0.2, 1.0])]
    for joint in range(1, 22):
        own.append(own[SMPL_PARENTS[joint]] + world[SMPL_PARENTS[joint]] @ (TO_SMPL @ offsets[joint]))
    np.testing.assert_allclose(np.stack(placed), joints[1, 0, 2, :22], atol=1e-4)
    np.testing.assert_allclose(np.stack(own), joints[1, 0, 2, :22], atol=1e-4)
    assert np.isnan(joints[..., 22:, :]).all()


def test_a_t_pose_faces_ahead_in_mmmesh_axes():
    rest = Rotation.from_quat(np.tile([0.0, 0.0, 0.0, 1.0], (22, 1)))
    turned = smpl_rotations(rest, 1)[0]
    np.testing.assert_allclose(turned[0] @ [0, 0, 1], [1, 0, 0] @ TO_MMMESH.T, atol=1e-12)  # SMPL faces +z
    np.testing.assert_allclose(turned[0] @ [0, 1, 0], [0, 0, 1], atol=1e-12)
    np.testing.assert_allclose(turned[1:], np.broadcast_to(np.eye(3), (23, 3, 3)), atol=1e-12)


def test_mmmesh_points_repeat_to_128(body_set, tmp_path):
    to_mmmesh(body_set, tmp_path / "out")
    cloud, counts = np.load(tmp_path / "out/train/pc.npy"), np.load(tmp_path / "out/train/points.npy")
    assert cloud.shape[-2:] == (128, 6)
    assert cloud.dtype == np.float32
    with open_dataset(body_set)[0] as run:
        found = run.representation("point_cloud")
        column = {str(name): number for number, name in enumerate(found.axes["field"])}
        own = mmmesh_points(found.frame(1), column)
    assert counts[0, 0, 1] == len(own)
    np.testing.assert_array_equal(cloud[0, 0, 1, : len(own)], own)
    assert {tuple(row) for row in cloud[0, 0, 1]} == {tuple(row) for row in own}
    distance = np.linalg.norm(own[:, :3] - [0, 0, 1], axis=1)
    np.testing.assert_allclose(distance, own[:, 5], rtol=0.02)
    assert not (tmp_path / "out/train/betas.npy").exists()
    assert "betas" in (tmp_path / "out/README.md").read_text()


def test_di_gesture_files_are_named_after_what_is_in_them(body_set, tmp_path):
    to_di_gesture(body_set, tmp_path / "out")
    with (tmp_path / "out" / "labels.csv").open() as file:
        table = list(csv.DictReader(file))
    assert [row["file"] for row in table] == [
        "train/y_Push_e1_u1_p1_s1.npy", "train/n_Wave_e2_u2_p2_s1.npy",
        "train/y_Push_e2_u3_p3_s1.npy", "train/n_Wave_e1_u4_p4_s1.npy",
    ]  # fmt: skip
    image = np.load(tmp_path / "out" / table[1]["file"], allow_pickle=False)
    assert (image.shape, image.dtype) == ((5, 32, 32), np.float32)
    with open_dataset(body_set)[1] as run:
        np.testing.assert_array_equal(image, run.representation("drai").values)


def test_di_gesture_refuses_who_is_beyond_its_range(tmp_path, monkeypatch):
    folder = make_set(tmp_path / "set", count=1)
    monkeypatch.setattr("rfgen_sionna.dataset.gesture_layout.DRAI_BINS", 3)
    with pytest.raises(ValueError, match=r"recording 0 .* 1.00 m, beyond the 0.86 m"):
        to_di_gesture(folder, tmp_path / "out")
    assert not (tmp_path / "out").exists()
