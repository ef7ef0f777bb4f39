"""Motion from AMASS, SMPL, SMPL-H and SMPL-X clips."""

from __future__ import annotations

from os import PathLike
from pathlib import Path
from zipfile import BadZipFile, is_zipfile

import numpy as np
from scipy.spatial.transform import Rotation

from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.motion.rotations import continuous
from rfgen_sionna.generative.motion.skeleton import JOINT_NAMES, MEAN_ADULT, NUM_BODY_JOINTS, PARENTS
from rfgen_sionna.records import Motion

_RATES = ("mocap_framerate", "mocap_frame_rate", "fps")
_PLACES = ("trans", "transl")
_PARTS = (
    ("root_orient", "pose_body", "pose_hand"),
    ("global_orient", "body_pose", "left_hand_pose", "right_hand_pose"),
)
"""Keys of the parts of `poses` (root, body, hands) in AMASS and in the smplx package."""
_LAYOUTS = {66: "SMPL body, 22 joints", 72: "SMPL, 24 joints", 156: "SMPL-H, 52 joints", 165: "SMPL-X, 55 joints"}
_BODY_TO_OURS = Rotation.from_matrix(np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]))
"""From SMPL's rest body (x left, y up, facing z) to the package's (x forwards, y left, z up)."""
_SMPL_PELVIS = np.array([0.0, -0.23, 0.03])
"""Pelvis joint of SMPL's mean body relative to the origin of `trans` [m, SMPL's frame]. Rounded, since the regressor is
licensed; grounding removes the rest."""
_SMPL_LEG = 0.80
"""Hip to ankle of SMPL's mean body [m], rounded."""


class ClipError(ValueError):
    """A motion or mesh file is unusable."""


def load_motion(path: str | PathLike[str], *, up: str = "z", action: str = "", recentre: bool = True) -> Motion:
    """Read an AMASS, SMPL, SMPL-H or SMPL-X clip.

    Keys: `poses` (frame, 66, 72, 156 or 165) axis-angle [rad] or (frame, joint, 3, 3) matrices, or its parts under the
    names of AMASS (`root_orient`, `pose_body`, `pose_hand`) or the smplx package (`global_orient`, `body_pose`,
    `left_hand_pose`, `right_hand_pose`); `trans` or `transl` (frame, 3) [m]; frame rate `mocap_framerate`,
    `mocap_frame_rate` or `fps`. SMPL's two rigid hand joints, SMPL-X's jaw and eyes, and the shape (`betas`) are
    ignored.

    Args:
        path: the `.npz` file.
        up: up axis of the clip's world, "z" (AMASS) or "y" (raw SMPL fits).
        action: label for the motion.
        recentre: whether to turn and shift the clip to start over the origin facing +x; otherwise its world stays.

    Returns:
        the motion in the package's frame; joint rotations are conjugated by the change of axes.

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
    world = Rotation.identity() if up == "z" else _BODY_TO_OURS
    root = world * Rotation.from_rotvec(vectors[:, 0])
    quaternions[:, 0] = (root * _BODY_TO_OURS.inv()).as_quat()
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
    if not is_zipfile(path):
        raise ClipError(f"{path.name}: not a readable .npz file")
    try:
        with np.load(path, allow_pickle=False) as clip:
            present = tuple(clip.files)
            named = ("poses", *_PLACES, *_RATES, *(key for parts in _PARTS for key in parts))
            data = {key: clip[key] for key in named if key in present}
    except (OSError, ValueError, BadZipFile) as error:
        raise ClipError(f"{path.name}: not a readable .npz file ({error})") from error
    poses = _poses(path.name, data, present)
    place = next((key for key in _PLACES if key in data), None)
    if place is None:
        raise ClipError(f"{path.name}: 'trans' is missing; the file has {', '.join(present) or 'nothing'}")
    trans = _numbers(path.name, place, data[place])
    key = next((key for key in _RATES if key in data), None)
    if key is None:
        raise ClipError(f"{path.name}: no frame rate; one of {', '.join(_RATES)} is needed")
    rates = _numbers(path.name, key, data[key]).ravel()
    if rates.size != 1 or not (np.isfinite(rates[0]) and rates[0] > 0.0):
        raise ClipError(f"{path.name}: the frame rate {key} is {data[key]!r}; allowed is one number of Hz more than 0")
    if poses.shape[1] not in _LAYOUTS:
        allowed = ", ".join(f"{n} ({name})" for n, name in _LAYOUTS.items())
        raise ClipError(
            f"{path.name}: poses has {poses.shape[1]} columns and {len(poses)} frames; allowed are {allowed}"
        )
    if trans.shape != (len(poses), 3):
        raise ClipError(f"{path.name}: {place} has shape {trans.shape}; allowed is {(len(poses), 3)}")
    if not (np.isfinite(poses).all() and np.isfinite(trans).all()):
        raise ClipError(f"{path.name}: poses or {place} hold values that are not finite")
    return poses, trans, float(rates[0])


def _poses(name: str, data: dict[str, np.ndarray], present: tuple[str, ...]) -> FloatArray:
    """(frame, column) axis-angles [rad], joined where the file has them in parts."""
    if "poses" in data:
        parts = [data["poses"]]
    else:
        root, body, *hands = next((keys for keys in _PARTS if keys[0] in data and keys[1] in data), ("poses", "poses"))
        if root not in data:
            raise ClipError(f"{name}: 'poses' is missing; the file has {', '.join(present) or 'nothing'}")
        parts = [data[key] for key in (root, body, *hands) if key in data]
    flat = [_axis_angles(name, part) for part in parts]
    if len({len(part) for part in flat}) > 1:
        raise ClipError(f"{name}: its parts of poses have {', '.join(str(len(p)) for p in flat)} frames")
    return np.concatenate(flat, axis=1)


def _axis_angles(name: str, values: np.ndarray) -> FloatArray:
    values = _numbers(name, "poses", values)
    if values.ndim == 4 and values.shape[2:] == (3, 3) and len(values) and np.isfinite(values).all():
        try:
            return Rotation.from_matrix(values.reshape(-1, 3, 3)).as_rotvec().reshape(len(values), -1)
        except ValueError as error:
            raise ClipError(f"{name}: poses hold matrices that are no rotations ({error})") from error
    return values.reshape(len(values), -1) if values.ndim and len(values) else values.reshape(0, 0)


def _numbers(name: str, key: str, values: np.ndarray) -> FloatArray:
    try:
        return np.asarray(values, np.float64)
    except (TypeError, ValueError) as error:
        raise ClipError(f"{name}: {key} holds no numbers ({error})") from error


def _joint_columns(width: int) -> list[int]:
    """Joints of the file in the package's order."""
    body = list(range(NUM_BODY_JOINTS))
    if width == 156:
        return body + list(range(22, 52))
    if width == 165:
        return body + list(range(25, 55))
    return body


def _recentred(root: FloatArray, translation: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Root quaternions and positions, turned and shifted so that the first frame is over the origin facing +x."""
    forward = Rotation.from_quat(root[0]).apply([1.0, 0.0, 0.0])
    turn = Rotation.from_euler("z", -np.arctan2(forward[1], forward[0]))
    shifted = translation - [*translation[0, :2], 0.0]
    return (turn * Rotation.from_quat(root)).as_quat(), turn.apply(shifted)
