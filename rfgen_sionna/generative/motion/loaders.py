"""Motion from clips of the SMPL family."""

from __future__ import annotations

import logging
from os import PathLike
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.motion.clip_error import ClipError
from rfgen_sionna.generative.motion.rotations import continuous
from rfgen_sionna.generative.motion.skeleton import JOINT_NAMES, MEAN_ADULT, NUM_BODY_JOINTS, PARENTS
from rfgen_sionna.generative.motion.smpl_parameters import SmplTrack, read_smpl, standing_axis
from rfgen_sionna.records import Motion
from rfgen_sionna.scene.mesh_files import to_z_up

_LOG = logging.getLogger(__name__)
_BODY_TO_OURS = Rotation.from_matrix(np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]))
"""From SMPL's rest body (x left, y up, facing z) to the package's (x forwards, y left, z up)."""
_SMPL_PELVIS = np.array([0.0, -0.23, 0.03])
"""Pelvis joint of SMPL's mean body relative to the origin of `trans` [m, SMPL's frame]. Rounded, since the regressor is
licensed; grounding removes the rest."""
_SMPL_LEG = 0.80
"""Hip to ankle of SMPL's mean body [m], rounded."""
_LYING = 0.35
"""Cosine of the pelvis' tilt below which nobody stands."""

__all__ = ["ClipError", "load_motion"]


def load_motion(
    path: str | PathLike[str],
    *,
    up: str | None = None,
    frame_rate: float | None = None,
    index: int = 0,
    action: str = "",
    recentre: bool = True,
) -> Motion:
    """Read a clip of the SMPL family.

    Keys: `poses` (frame, 66, 72, 156 or 165) axis-angle [rad] or (frame, joint, 3, 3) matrices, or its parts under the
    names of AMASS (`root_orient`, `pose_body`, `pose_hand`) or the smplx package (`global_orient`, `body_pose`,
    `left_hand_pose`, `right_hand_pose`); `trans` or `transl` (frame, 3) [m]; frame rate `mocap_framerate`,
    `mocap_frame_rate` or `fps`. Also what WHAM, GVHMR, TRAM, 4D-Humans (PHALP), ROMP, VIBE, PARE and MDM write. SMPL's
    two rigid hand joints, SMPL-X's jaw and eyes, hands as principal components, and the shape (`betas`) are ignored.

    Args:
        path: the `.npz`, `.npy`, `.pkl` or `.pt` file.
        up: up axis of the clip's world; None takes the method's own ("-y" for camera frames), else z for `.npz`
            (AMASS), else the axis along which the person stands.
        frame_rate: poses per second [Hz]; it replaces that of the file.
        index: number of the person in a file of several.
        action: label for the motion.
        recentre: whether to turn and shift the clip to start over the origin facing +x; otherwise its world stays.

    Returns:
        the motion in the package's frame; joint rotations are conjugated by the change of axes.

    Raises:
        FileNotFoundError: there is no such file.
        ClipError: a key is missing or has a wrong shape, a value is not finite, or the frame rate is missing or not
            positive.
    """
    path = Path(path)
    track = read_smpl(path, index=index)
    rate = chosen_rate(path.name, track.frame_rate, frame_rate)
    world = Rotation.from_matrix(_up_rotation(path, track, up))
    joints = _joint_columns(track.poses.shape[1])
    names = JOINT_NAMES[: len(joints)]
    vectors = track.poses.reshape(len(track.poses), -1, 3)[:, joints]
    quaternions = np.empty((*vectors.shape[:2], 4))
    body = _BODY_TO_OURS * Rotation.from_rotvec(vectors.reshape(-1, 3)) * _BODY_TO_OURS.inv()
    quaternions[:] = body.as_quat().reshape(quaternions.shape)
    root = world * Rotation.from_rotvec(vectors[:, 0])
    quaternions[:, 0] = (root * _BODY_TO_OURS.inv()).as_quat()
    translation = world.apply(track.translation + _SMPL_PELVIS)
    if recentre:
        quaternions[:, 0], translation = recentred(quaternions[:, 0], translation)
    return Motion(
        rotations=continuous(quaternions),
        translation=translation,
        frame_rate=rate,
        joint_names=names,
        parents=PARENTS[: len(names)],
        offsets=MEAN_ADULT.offsets[: len(names)] * (_SMPL_LEG / MEAN_ADULT.leg_length()),
        action=action,
    )


def chosen_rate(name: str, own: float | None, given: float | None) -> float:
    """Frame rate [Hz]: the given one, else the file's own; a warning where they differ.

    Raises:
        ClipError: neither is there, or the given one is not positive.
    """
    if given is not None and (isinstance(given, bool) or not (np.isfinite(given) and given > 0.0)):
        raise ClipError(f"frame_rate: {given!r} Hz; allowed is more than 0")
    if given is None and own is None:
        raise ClipError(
            f"{name}: no frame rate (mocap_framerate, mocap_frame_rate, fps) in it; frame_rate= [Hz] is needed, "
            "such as that of the video"
        )
    if given is not None and own is not None and abs(given / own - 1.0) > 1e-3:
        _LOG.warning("%s: frame_rate=%g Hz replaces the file's %g Hz", name, given, own)
    return float(given if given is not None else own or 0.0)


def _up_rotation(path: Path, track: SmplTrack, up: str | None) -> FloatArray:
    """(3, 3) rotation from the clip's world to z up."""
    stands = standing_axis(track.poses)
    axis = up or track.up or ("z" if path.suffix.lower() == ".npz" else stands)
    if axis is None:
        raise ClipError(
            f"{path.name}: its keys do not say which axis is up, and nobody stands; up='y', 'z' or '-y' does"
        )
    try:
        turn = to_z_up(axis, front=True)
    except ValueError as error:
        raise ClipError(str(error)) from error
    if up is None and track.up == "-y":
        _LOG.warning("%s: camera coordinates, read with up='-y': places are relative to the camera", path.name)
    elif up is None and path.suffix.lower() != ".npz" and track.up is None:
        _LOG.info("%s: read with up=%r, along which the person stands", path.name, axis)
    upright = Rotation.from_rotvec(track.poses[:, :3]).apply([0.0, 1.0, 0.0]) @ turn[2]
    if np.quantile(upright, 0.9) < _LYING:
        cure = f"; a standing person needs up={stands!r}" if stands else ""
        _LOG.warning("%s: the person never stands with %s up%s", path.name, axis, cure)
    return turn


def _joint_columns(width: int) -> list[int]:
    """Joints of the file in the package's order."""
    body = list(range(NUM_BODY_JOINTS))
    if width == 156:
        return body + list(range(22, 52))
    if width == 165:
        return body + list(range(25, 55))
    return body


def recentred(root: FloatArray, translation: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Root quaternions (frame, 4) and positions (frame, 3) [m], turned and shifted so that the first frame is over the
    origin facing +x."""
    forward = Rotation.from_quat(root[0]).apply([1.0, 0.0, 0.0])
    turn = Rotation.from_euler("z", -np.arctan2(forward[1], forward[0]))
    shifted = translation - [*translation[0, :2], 0.0]
    return (turn * Rotation.from_quat(root)).as_quat(), turn.apply(shifted)
