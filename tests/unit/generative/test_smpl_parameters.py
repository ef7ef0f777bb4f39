"""Parameters of video methods, in the containers that they write: the same person from each, and no code run."""

from __future__ import annotations

import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.motion.array_files import read_arrays
from rfgen_sionna.generative.motion.clip_error import ClipError
from rfgen_sionna.generative.motion.importers import load_any_motion
from rfgen_sionna.generative.motion.rotations import to_matrices
from rfgen_sionna.generative.motion.skeleton import JOINT, forward_kinematics, global_rotations
from rfgen_sionna.records import Motion

FRAMES = 24
CAMERA = Rotation.from_rotvec([np.pi, 0.0, 0.0])
"""From a world with y up to a camera's axes (y down, z ahead): what stands ahead of it faces it."""


def joints(motion: Motion) -> FloatArray:
    world = global_rotations(to_matrices(motion.rotations), motion.parents)
    return forward_kinematics(world, motion.translation, motion.offsets, motion.parents)


def walking() -> tuple[FloatArray, FloatArray]:
    """Poses (frame, 72) [rad] and places (frame, 3) [m] of somebody who goes ahead along z in a world with y up."""
    poses = np.random.default_rng(0).normal(0.0, 0.1, (FRAMES, 72))
    poses[:, :3] = 0.0
    poses[:, 3 * 4] = 0.6  # the left knee
    return poses, np.linspace(0.0, 1.0, FRAMES)[:, None] * [0.0, 0.0, 1.0] + [0.0, 1.0, 0.0]


POSES, PLACES = walking()
MATRICES = Rotation.from_rotvec(POSES.reshape(-1, 3)).as_matrix().reshape(FRAMES, 24, 3, 3)


def camera() -> tuple[FloatArray, FloatArray, FloatArray]:
    """Poses, matrices and places of the same person in a camera's axes, 4 m ahead of it."""
    poses, matrices = POSES.copy(), MATRICES.copy()
    poses[:, :3] = (CAMERA * Rotation.from_rotvec(POSES[:, :3])).as_rotvec()
    matrices[:, 0] = CAMERA.as_matrix() @ MATRICES[:, 0]
    # the body turns about its pelvis, which is off the origin of its place
    pelvis = np.array([0.0, -0.23, 0.03])
    return poses, matrices, CAMERA.apply(PLACES + pelvis) - pelvis + np.array([0.0, 0.0, 4.0])


def phalp() -> dict[str, Any]:
    """Frames with two people each, in changing order."""
    _, matrices, places = camera()
    frames = {}
    for k in range(FRAMES):
        one = {"global_orient": matrices[k, :1], "body_pose": matrices[k, 1:], "betas": np.zeros(10)}
        other = {"global_orient": matrices[0, :1], "body_pose": matrices[0, 1:], "betas": np.zeros(10)}
        people = [(7, one, places[k]), (9, other, places[0])][:: 1 if k % 2 else -1]
        frames[f"frames/{k:06d}.jpg"] = {
            "tid": [p[0] for p in people], "smpl": [p[1] for p in people], "camera": [p[2] for p in people], "time": k,
        }  # fmt: skip
    return frames


def contents() -> dict[str, Any]:
    poses, matrices, places = camera()
    six = np.moveaxis(MATRICES[..., :2, :].reshape(FRAMES, 24, 6), 0, -1)
    frames = [(f"{k:06d}.jpg", slice(k, k + 1)) for k in range(FRAMES)]
    return {
        "wham": {0: {"pose": poses, "trans": places, "pose_world": POSES, "trans_world": PLACES}},
        "gvhmr": {
            "smpl_params_global": {"body_pose": POSES[:, 3:66], "global_orient": POSES[:, :3], "transl": PLACES},
            "smpl_params_incam": {"body_pose": POSES[:, 3:66], "global_orient": poses[:, :3], "transl": places},
        },
        "tram": {"pred_rotmat": matrices, "pred_trans": places[:, None], "pred_shape": np.zeros((FRAMES, 10))},
        "phalp": phalp(),
        "romp": {name: {"smpl_thetas": poses[part], "cam_trans": places[part]} for name, part in frames},
        "aist": {"smpl_poses": POSES, "smpl_trans": 90.0 * PLACES, "smpl_scaling": np.array([90.0])},
        "mdm": {"thetas": six, "root_translation": PLACES.T, "motion": np.zeros((25, 6, FRAMES)), "text": "walks"},
        "plain": {"poses": POSES, "trans": PLACES},
    }  # fmt: skip


@pytest.mark.parametrize("method", contents())
def test_the_same_person_from_every_method(tmp_path: Path, method: str, caplog: pytest.LogCaptureFixture) -> None:
    (tmp_path / "truth.pkl").write_bytes(pickle.dumps({"poses": POSES, "trans": PLACES}))
    truth = joints(load_any_motion(tmp_path / "truth.pkl", up="y", frame_rate=30.0))[:, :22]
    path = tmp_path / "clip.pkl"
    path.write_bytes(pickle.dumps(contents()[method]))
    made = load_any_motion(path, frame_rate=30.0)
    assert made.frame_rate == 30.0
    # upright, ahead along x, the knee flexed
    np.testing.assert_allclose(joints(made)[:, :22], truth, atol=1e-5)
    assert truth[0, JOINT["head"], 2] > truth[0, 0, 2] + 0.4
    assert truth[-1, 0, 0] - truth[0, 0, 0] == pytest.approx(1.0, abs=1e-5)
    if method in ("tram", "phalp", "romp"):
        assert "camera coordinates, read with up='-y'" in caplog.text
    if method == "phalp":
        assert "2 people; index=0 of 0 to 1 is taken" in caplog.text
        assert np.ptp(load_any_motion(path, frame_rate=30.0, index=1).translation) < 1.2
    if method != "mdm":
        with pytest.raises(ClipError, match="that of the video"):
            load_any_motion(path)


def test_containers(tmp_path: Path) -> None:
    """Pickles of every protocol, joblib's, torch's and NumPy's hold the same arrays."""
    torch = pytest.importorskip("torch")
    content = contents()["wham"]
    files = []
    for protocol in range(6):
        files.append(tmp_path / f"{protocol}.pkl")
        files[-1].write_bytes(pickle.dumps(content, protocol=protocol))
    np.save(tmp_path / "clip.npy", np.array(content, object), allow_pickle=True)
    np.savez(tmp_path / "clip.npz", results=np.array(content, object))
    torch.save({0: {key: torch.from_numpy(value) for key, value in content[0].items()}}, tmp_path / "clip.pt")
    files += [tmp_path / "clip.npy", tmp_path / "clip.npz", tmp_path / "clip.pt"]
    # tensors within a plain pickle
    (tmp_path / "tensors.pkl").write_bytes(pickle.dumps({0: {k: torch.from_numpy(v) for k, v in content[0].items()}}))
    files.append(tmp_path / "tensors.pkl")
    for file in files:
        assert np.ptp(load_any_motion(file, frame_rate=25.0).translation[:, 0]) == pytest.approx(1.0, abs=1e-5), file


def test_joblib_files(tmp_path: Path) -> None:
    joblib = pytest.importorskip("joblib")
    content = {"person": {"pose_world": np.asfortranarray(POSES), "trans_world": PLACES.astype(np.float32), "ids": [1]}}
    for compress in (0, 3):
        joblib.dump(content, tmp_path / "wham.pkl", compress=compress)
        read = read_arrays(tmp_path / "wham.pkl")["person"]
        np.testing.assert_array_equal(read["pose_world"], POSES)
        np.testing.assert_array_equal(read["trans_world"], PLACES.astype(np.float32))
    joblib.dump({"x": np.array([print], object)}, tmp_path / "objects.pkl")
    with pytest.raises(ClipError, match="array of objects"):
        read_arrays(tmp_path / "objects.pkl")


class Trap:
    """Runs `print` where a pickle is loaded carelessly."""

    def __reduce__(self) -> tuple[Any, ...]:
        return (print, ("run",))


@pytest.mark.parametrize("ending", [".pkl", ".npy", ".npz", ".pt"])
def test_files_that_would_run_code_are_refused(tmp_path: Path, ending: str, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / f"trap{ending}"
    content = {"poses": POSES, "trans": PLACES, "extra": Trap()}
    if ending == ".pkl":
        path.write_bytes(pickle.dumps(content))
    elif ending == ".npy":
        np.save(path, np.array(content, object), allow_pickle=True)
    elif ending == ".npz":
        np.savez(path, poses=POSES, trans=PLACES, extra=np.array(Trap(), object))
    else:
        pytest.importorskip("torch").save(content, path)
    if ending == ".npz":
        # an archive has other arrays, which need not be opened
        assert len(load_any_motion(path, frame_rate=30.0, up="y").translation) == FRAMES
        np.savez(path, poses=np.array(Trap(), object), trans=PLACES)
    with pytest.raises(ClipError, match=rf"trap\{ending}.*(builtins\.print|safe reader)"):
        load_any_motion(path, frame_rate=30.0)
    assert "run" not in capsys.readouterr().out


def test_what_is_missing_is_named(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    def saved(content: Any) -> Path:
        path = tmp_path / "clip.pkl"
        path.write_bytes(pickle.dumps(content))
        return path

    for content, message in (
        ({"verts": np.zeros((3, 6890, 3))}, "'poses' is missing; the file has verts"),
        ([1, 2], "'poses' is missing"),
        ({"poses": POSES}, "'trans' is missing"),
        ({"poses": POSES[:, :70], "trans": PLACES}, "70 columns.*66 .*72"),
        ({"poses": MATRICES * 2.0, "trans": PLACES}, "no rotations"),
        ({"thetas": np.zeros((24, 5, 3)), "root_translation": np.zeros((3, 3))}, "allowed are .*24, 6, frames"),
    ):
        with pytest.raises(ClipError, match=message):
            load_any_motion(saved(content), frame_rate=30.0)
    with pytest.raises(ClipError, match="index 2; it holds 2 people"):
        load_any_motion(saved(phalp()), frame_rate=30.0, index=2)
    gone = phalp()
    frame = gone["frames/000010.jpg"]
    at = frame["tid"].index(7)
    for key in ("tid", "smpl", "camera"):
        frame[key].pop(at)
    with pytest.raises(ClipError, match="person 7 is missing from frame 10 to 10"):
        load_any_motion(saved(gone), frame_rate=30.0)
    # weak-perspective cameras give no place
    load_any_motion(saved({1: {"pose": camera()[0], "orig_cam": np.zeros((FRAMES, 4))}}), frame_rate=30.0)
    assert "the person stays in place" in caplog.text
    lying = POSES.copy()
    lying[:, :3] = Rotation.from_rotvec([0.9, 0.9, 0.0]).as_rotvec()
    with pytest.raises(ClipError, match="do not say which axis is up"):
        load_any_motion(saved({"poses": lying, "trans": PLACES}), frame_rate=30.0)
