"""Motion of other programs: SMPL parameters, MDM's results, HumanML3D features, BVH files."""

from __future__ import annotations

from dataclasses import replace
from os import PathLike
from pathlib import Path

import numpy as np

from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.motion.array_files import ARRAY_SUFFIXES, read_arrays
from rfgen_sionna.generative.motion.bvh import bvh_positions
from rfgen_sionna.generative.motion.clip_error import ClipError
from rfgen_sionna.generative.motion.inverse_kinematics import motion_of_positions
from rfgen_sionna.generative.motion.joint_files import MDM_RATE, mdm_motion
from rfgen_sionna.generative.motion.joint_recording import check_size, upright_rotation
from rfgen_sionna.generative.motion.joint_smoothing import smooth_paths
from rfgen_sionna.generative.motion.loaders import chosen_rate, load_motion, recentred
from rfgen_sionna.generative.motion.rotations import to_matrices
from rfgen_sionna.generative.motion.skeleton import JOINT_NAMES, NUM_BODY_JOINTS, forward_kinematics, global_rotations
from rfgen_sionna.generative.motion.smpl_parameters import is_smpl
from rfgen_sionna.records import Motion

MOTION_SUFFIXES = (*ARRAY_SUFFIXES, ".bvh", ".csv")


def load_any_motion(
    path: str | PathLike[str],
    *,
    up: str | None = None,
    frame_rate: float | None = None,
    index: int = 0,
    action: str = "",
) -> Motion:
    """A motion from a file, by its extension and content, starting over the origin facing +x.

    `.npz`, `.npy`, `.pkl`, `.pt`: parameters of the SMPL family
    (:func:`rfgen_sionna.generative.motion.loaders.load_motion`). `.npy` also: MDM's `results.npy`, HumanML3D features
    (frame, 263) or joint positions (frame, 22, 3). `.bvh`: motion capture with a human skeleton.

    Args:
        path: the file.
        up: up axis of the clip's world, "z", "y", "-y", ...; None takes the format's own: z for AMASS, y for MDM and
            HumanML3D, "-y" for camera frames, and the axis along which people stand for `.bvh`.
        frame_rate: poses per second [Hz]; it replaces that of the file, with a warning where they differ. None takes
            the file's, for MDM and HumanML3D 20 Hz.
        index: number of the motion or the person in a file with several.
        action: label.

    Raises:
        FileNotFoundError: there is no such file.
        ClipError: the file is unusable; the message names field, value and cure.
    """
    path = Path(path)
    if isinstance(index, bool) or not isinstance(index, (int, np.integer)):
        raise ClipError(f"{path.name}: index {index!r}; a whole number is needed")
    kind = path.suffix.lower()
    if not path.is_file():
        raise FileNotFoundError(f"no motion file {path}")
    if kind == ".npy":
        return _load_npy(path, up, frame_rate, int(index), action)
    if kind == ".bvh":
        places, rate = bvh_positions(path, up=up, index=int(index))
        return from_start(motion_of_positions(places, chosen_rate(path.name, rate, frame_rate), action=action))
    if kind == ".csv":
        raise ClipError(f"{path.name}: joint positions go to Actor.from_joints, which keeps place and bone lengths")
    if kind not in MOTION_SUFFIXES:
        raise ClipError(f"{path.name}: ending {path.suffix!r}; allowed are {', '.join(MOTION_SUFFIXES)}")
    return load_motion(path, up=up, frame_rate=frame_rate, index=int(index), action=action)


def positions_of_humanml(features: FloatArray) -> FloatArray:
    """(frame, 22, 3) joint positions [m], y up, of HumanML3D's (frame, 263) features, not normalised.

    A row holds the root's turn to the next pose [rad, about y], its step [m, root frame], its height, the other joints'
    positions in the root frame, their rotations and velocities, and foot contacts (Guo et al. 2022).
    """
    f = np.asarray(features, np.float64)
    turn = np.concatenate([[0.0], np.cumsum(f[:-1, 0])])
    # rows hold half angles
    c, s = np.cos(2.0 * turn), np.sin(2.0 * turn)
    inverse = np.zeros((len(f), 3, 3))
    inverse[:, 0, 0], inverse[:, 0, 2], inverse[:, 1, 1] = c, -s, 1.0
    inverse[:, 2, 0], inverse[:, 2, 2] = s, c
    step = np.zeros((len(f), 3))
    step[1:, [0, 2]] = f[:-1, 1:3]
    root = np.cumsum(np.einsum("nij,nj->ni", inverse, step), axis=0)
    root[:, 1] = f[:, 3]
    others = np.einsum("nij,nkj->nki", inverse, f[:, 4 : 4 + 3 * (NUM_BODY_JOINTS - 1)].reshape(len(f), -1, 3))
    others[..., [0, 2]] += root[:, None, [0, 2]]
    return np.concatenate([root[:, None], others], axis=1)


def _load_npy(path: Path, up: str | None, frame_rate: float | None, index: int, action: str) -> Motion:
    data = read_arrays(path)
    if is_smpl(data) or (isinstance(data, dict) and "motion" not in data):
        return load_motion(path, up=up, frame_rate=frame_rate, index=index, action=action)
    prompt = ""
    if isinstance(data, dict):
        positions, prompt = mdm_motion(path.name, data, index)
    else:
        if index:
            raise ClipError(f"{path.name}: index {index!r}; it holds one motion, 0")
        if not isinstance(data, np.ndarray) or data.dtype.kind not in "fiu":
            raise ClipError(f"{path.name}: holds {getattr(data, 'dtype', type(data).__name__)}; allowed are numbers")
        if not data.size:
            raise ClipError(f"{path.name}: no frames")
        if data.ndim == 2 and data.shape[1] == 263:
            positions = positions_of_humanml(data)
        elif data.ndim == 3 and data.shape[1:] == (NUM_BODY_JOINTS, 3):
            positions = data
        else:
            raise ClipError(
                f"{path.name}: shape {data.shape}; allowed are HumanML3D's (frames, 263), positions (frames, 22, 3), "
                "MDM's results and SMPL parameters; positions of other joints go to Actor.from_joints(layout=...)"
            )
    if not np.size(positions) or not np.isfinite(positions).all():
        raise ClipError(f"{path.name}: no frames, or values that are not finite")
    raw = isinstance(data, np.ndarray) and data.ndim == 3
    rate = chosen_rate(path.name, None if raw and frame_rate else MDM_RATE, frame_rate)
    names = JOINT_NAMES[:NUM_BODY_JOINTS]
    places = np.asarray(positions, np.float64)
    check_size(path.name, places, names)
    places = places @ upright_rotation(path.name, places, names, up or "y").T
    if len(places) > 4:
        # noise of a centimetre would let straight knees jump where planted feet are held
        _, smooth, fine = smooth_paths(np.arange(len(places)) / rate, places, np.ones(places.shape[:2]), names)
        places = smooth[:: round(fine / rate)][: len(places)]
    return from_start(motion_of_positions(places, rate, action=action, prompt=prompt))


def from_start(motion: Motion) -> Motion:
    """The motion, turned and shifted to start over the origin facing +x, its lowest joints on the floor."""
    rotations = motion.rotations.copy()
    world = global_rotations(to_matrices(motion.rotations), motion.parents)
    places = forward_kinematics(world, motion.translation, motion.offsets, motion.parents)
    floor = np.array([0.0, 0.0, np.percentile(places[..., 2].min(axis=1), 5.0)])
    rotations[:, 0], translation = recentred(rotations[:, 0], motion.translation - floor)
    return replace(motion, rotations=rotations, translation=translation)
