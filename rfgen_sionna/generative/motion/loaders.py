"""Motion from files: AMASS / SMPL / SMPL-H clips."""

from __future__ import annotations

from os import PathLike
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from rfgen_sionna.generative.motion.adult import MEAN_ADULT
from rfgen_sionna.generative.motion.rotations import continuous
from rfgen_sionna.generative.motion.skeleton import JOINT_NAMES, NUM_BODY_JOINTS, PARENTS
from rfgen_sionna.records import FloatArray, Motion

_RATES = ("mocap_framerate", "mocap_frame_rate", "fps")
_LAYOUTS = {
    66: "SMPL body, 22 joints",
    72: "SMPL, 24 joints",
    156: "SMPL-H, 52 joints",
    165: "SMPL-X, 55 joints",
}
_BODY_TO_OURS = Rotation.from_matrix(np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]))
"""SMPL's body at rest has x to its left, y up and faces z; ours has x forwards, y to the left, z up."""
_SMPL_PELVIS = np.array([0.0, -0.23, 0.03])
"""The pelvis joint of SMPL's mean body relative to the origin about which `trans` moves it [m, SMPL's frame],
rounded: the model's regressor is licensed, and grounding on the body takes out what is left."""
_SMPL_LEG = 0.80
"""Hip to ankle of SMPL's mean body [m], rounded."""


class ClipError(ValueError):
    """A motion or mesh file that cannot be used."""


def load_motion(path: str | PathLike[str], *, up: str = "z", action: str = "", recentre: bool = True) -> Motion:
    """Read an AMASS, SMPL or SMPL-H clip.

    Needs `poses` (frame, 66, 72, 156 or 165) axis-angle [rad], `trans` (frame, 3) [m], and the frame rate under
    `mocap_framerate`, `mocap_frame_rate` or `fps`. SMPL's two rigid hand joints and SMPL-X's jaw and eyes are left out.
    Shape (`betas`) is not used: the body is chosen separately.

    Args:
        path: the `.npz` file.
        up: up axis of the clip's world, "z" (AMASS) or "y" (raw SMPL fits).
        action: label for the motion.
        recentre: turn and shift the clip so that it begins over the origin facing +x; otherwise its world is kept.

    Returns:
        the motion in our frame. SMPL's body rests facing its +z with y up, ours faces +x with z up: joint rotations are
        conjugated by that change of axes, and the root's rotation leads on from our rest pose to the clip's world.

    Raises:
        FileNotFoundError: there is no such file.
        ClipError: a key is missing or has a wrong shape, a value is not finite, or the frame rate is not positive.
    """
    path = Path(path)
    if not path.is_file():
        raise FileNotFoundError(f"no motion file {path}")
    if up not in ("y", "z"):
        raise ClipError(f"up: {up!r}; allowed are 'y' and 'z'")
    poses, trans, rate = _read(path)
    joints = _joint_columns(poses.shape[1])
    names = JOINT_NAMES[: len(joints)]
    vectors = poses.reshape(len(poses), -1, 3)[:, joints]
    quaternions = np.empty((*vectors.shape[:2], 4))
    body = _BODY_TO_OURS * Rotation.from_rotvec(vectors.reshape(-1, 3)) * _BODY_TO_OURS.inv()
    quaternions[:] = body.as_quat().reshape(quaternions.shape)
    # the root maps SMPL's rest body into the clip's world; ours maps our rest body into a z-up world
    world = Rotation.identity() if up == "z" else _BODY_TO_OURS
    root = world * Rotation.from_rotvec(vectors[:, 0])
    quaternions[:, 0] = (root * _BODY_TO_OURS.inv()).as_quat()
    # the root joint turns about itself, wherever it rests in SMPL's frame
    translation = world.apply(trans + _SMPL_PELVIS)
    if recentre:
        quaternions[:, 0], translation = _recentred(quaternions[:, 0], translation)
    return Motion(
        rotations=continuous(quaternions),
        translation=translation,
        frame_rate=rate,
        joint_names=names,
        parents=PARENTS[: len(names)],
        offsets=MEAN_ADULT.offsets[: len(names)] * (_SMPL_LEG / MEAN_ADULT.leg_length()),
        action=action,
    )


def _read(path: Path) -> tuple[FloatArray, FloatArray, float]:
    try:
        with np.load(path, allow_pickle=False) as clip:
            present = tuple(clip.files)
            data = {key: clip[key] for key in ("poses", "trans", *_RATES) if key in present}
    except (OSError, ValueError) as error:
        raise ClipError(f"{path.name}: not a readable .npz file ({error})") from error
    for key in ("poses", "trans"):
        if key not in data:
            raise ClipError(f"{path.name}: {key!r} is missing; the file has {', '.join(present) or 'nothing'}")
    rate = next((float(data[key]) for key in _RATES if key in data), None)
    if rate is None:
        raise ClipError(f"{path.name}: no frame rate; one of {', '.join(_RATES)} is needed")
    if not (np.isfinite(rate) and rate > 0.0):
        raise ClipError(f"{path.name}: the frame rate is {rate!r} Hz; allowed is more than 0")
    poses, trans = np.asarray(data["poses"], float), np.asarray(data["trans"], float)
    poses = poses.reshape(len(poses), -1) if len(poses) else poses.reshape(0, 0)
    if poses.shape[1] not in _LAYOUTS:
        allowed = ", ".join(f"{n} ({name})" for n, name in _LAYOUTS.items())
        raise ClipError(
            f"{path.name}: poses has {poses.shape[1]} columns and {len(poses)} frames; allowed are {allowed}"
        )
    if trans.shape != (len(poses), 3):
        raise ClipError(f"{path.name}: trans has shape {trans.shape}; allowed is {(len(poses), 3)}")
    if not (np.isfinite(poses).all() and np.isfinite(trans).all()):
        raise ClipError(f"{path.name}: poses or trans hold values that are not finite")
    return poses, trans, rate


def _joint_columns(width: int) -> list[int]:
    """Which joints of the file are ours, in our order."""
    body = list(range(NUM_BODY_JOINTS))
    if width == 156:
        return body + list(range(22, 52))
    if width == 165:
        return body + list(range(25, 55))
    return body


def _recentred(root: FloatArray, translation: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Root quaternions and positions turned and shifted so that the first frame is over the origin facing +x."""
    forward = Rotation.from_quat(root[0]).apply([1.0, 0.0, 0.0])
    turn = Rotation.from_euler("z", -np.arctan2(forward[1], forward[0]))
    shifted = translation - [*translation[0, :2], 0.0]
    return (turn * Rotation.from_quat(root)).as_quat(), turn.apply(shifted)
