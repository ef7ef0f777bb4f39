"""Motion of other programs: MDM's results, HumanML3D features, BVH files."""

from __future__ import annotations

import io
import logging
import pickle
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.motion.from_positions import from_y_up
from rfgen_sionna.generative.motion.loaders import ClipError, load_motion
from rfgen_sionna.generative.motion.skeleton import JOINT, NUM_BODY_JOINTS, SIDES
from rfgen_sionna.records import Motion

_LOG = logging.getLogger(__name__)
MOTION_SUFFIXES = (".npz", ".npy", ".bvh")
HUMANML_RATE = 20.0
"""Poses per second of HumanML3D and of MDM's results [Hz]."""
_LONGER = 0.3
"""Largest relative standard deviation of a leg bone's length over time; above, positions are no body's."""
_LYING = 0.35
"""Cosine of the pelvis' tilt below which nobody stands."""
_ALLOWED = {
    *((f"numpy.{core}.multiarray", name) for core in ("core", "_core") for name in ("_reconstruct", "scalar")),
    *(("numpy", name) for name in ("ndarray", "dtype")),
}


def load_any_motion(path: str | PathLike[str], *, up: str | None = None, index: int = 0, action: str = "") -> Motion:
    """A motion from a file, by its extension.

    `.npz`: AMASS, SMPL, SMPL-H, SMPL-X parameters. `.npy`: MDM's `results.npy`, HumanML3D features (frame, 263) or
    joint positions (frame, 22, 3), at 20 Hz. `.bvh`: motion capture with a human skeleton.

    Args:
        path: the file.
        up: up axis of the world of an `.npz` or `.bvh` clip, "z" or "y". None takes z for `.npz` (AMASS) and the axis
            along which people stand for `.bvh`. `.npy` files have y up.
        index: number of the motion in a file with several.
        action: label.

    Raises:
        FileNotFoundError: there is no such file.
        ClipError: the file is unusable; the message names field, value and cure.
    """
    path = Path(path)
    if isinstance(index, bool) or not isinstance(index, (int, np.integer)):
        raise ClipError(f"{path.name}: index {index!r}; a whole number is needed")
    if up not in (None, "y", "z"):
        raise ClipError(f"up: {up!r}; allowed are 'y', 'z' and None")
    kind = path.suffix.lower()
    if kind in (".npz", ".bvh"):
        _check_single(path.name, index)
    if kind == ".npz":
        motion = load_motion(path, up=up or "z", action=action)
        _warn_of_lying(path.name, motion, up or "z")
        return motion
    if not path.is_file():
        raise FileNotFoundError(f"no motion file {path}")
    if kind == ".npy":
        if up == "z":
            raise ClipError(f"{path.name}: up 'z'; MDM's and HumanML3D's motions have y up, leave it out")
        return _load_npy(path, index, action)
    if kind == ".bvh":
        from rfgen_sionna.generative.motion.bvh import load_bvh

        return load_bvh(path, up=up, action=action)
    raise ClipError(f"{path.name}: ending {path.suffix!r}; allowed are .npz, .npy and .bvh")


def _warn_of_lying(name: str, motion: Motion, up: str) -> None:
    """Warn of a clip whose person never stands, as with a wrong up axis."""
    upright = Rotation.from_quat(motion.rotations[:, 0]).as_matrix()[:, 2, 2]
    if np.quantile(upright, 0.9) < _LYING:
        other = "y" if up == "z" else "z"
        _LOG.warning("%s: the person never stands with %s up; a standing person needs up=%r", name, up, other)


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


def _load_npy(path: Path, index: int, action: str) -> Motion:
    data = _read_npy(path)
    if isinstance(data, dict):
        if "motion" not in data:
            raise ClipError(f"{path.name}: no 'motion' in it, only {', '.join(map(repr, data))}; MDM's results have it")
        motions = np.asarray(data["motion"])
        if motions.ndim != 4 or motions.shape[1:3] != (NUM_BODY_JOINTS, 3):
            raise ClipError(f"{path.name}: motion has shape {motions.shape}; allowed is (motions, 22, 3, frames)")
        if not 0 <= index < len(motions):
            raise ClipError(f"{path.name}: index {index}; it holds {len(motions)} motions, from 0")
        frames = int(data["lengths"][index]) if "lengths" in data else motions.shape[-1]
        positions = np.moveaxis(motions[index], -1, 0)[:frames]
        texts = np.atleast_1d(data.get("text", ()))
        prompt = str(texts[index]) if index < len(texts) else ""
        return _of_positions(path.name, positions, action, prompt)
    _check_single(path.name, index)
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
            f"{path.name}: shape {data.shape}; allowed are HumanML3D's (frames, 263), positions (frames, 22, 3), or"
            " MDM's results"
        )
    return _of_positions(path.name, positions, action)


def _of_positions(name: str, positions: FloatArray, action: str, prompt: str = "") -> Motion:
    if not np.size(positions) or not np.isfinite(positions).all():
        raise ClipError(f"{name}: no frames, or values that are not finite")
    _check_bones(name, np.asarray(positions, np.float64))
    return from_y_up(positions, HUMANML_RATE, action, prompt)


def _check_single(name: str, index: int) -> None:
    if index:
        raise ClipError(f"{name}: index {index!r}; it holds one motion, 0")


def _check_bones(name: str, positions: FloatArray) -> None:
    """Check that thighs and shanks have a constant, nonzero length."""
    bones = [
        np.linalg.norm(positions[:, JOINT[f"{side}_{b}"]] - positions[:, JOINT[f"{side}_{a}"]], axis=-1)
        for side in SIDES
        for a, b in (("hip", "knee"), ("knee", "ankle"))
    ]
    if min(float(np.median(b)) for b in bones) < 1e-6:
        raise ClipError(f"{name}: all joints coincide; legs of some length are needed")
    spread = max(float(b.std() / b.mean()) for b in bones)
    if spread > _LONGER:
        raise ClipError(
            f"{name}: a leg's bone changes its length by {100 * spread:.0f} %, allowed are {100 * _LONGER:.0f} %; "
            "features that were normalised for training must be multiplied by Std.npy, and Mean.npy added, first"
        )


class _ArraysOnly(pickle.Unpickler):
    """Unpickler of plain containers and arrays; refuses everything executable."""

    def find_class(self, module: str, name: str) -> Any:
        if (module, name) not in _ALLOWED:
            raise ClipError(f"the file loads {module}.{name}; only arrays, texts and numbers are allowed")
        return super().find_class(module, name)


def _read_npy(path: Path) -> Any:
    raw = path.read_bytes()
    try:
        return np.load(io.BytesIO(raw), allow_pickle=False)
    except ValueError as error:
        if "allow_pickle" not in str(error):
            raise ClipError(f"{path.name}: not a readable .npy file ({error})") from error
    except (EOFError, OSError) as error:
        raise ClipError(f"{path.name}: not a readable .npy file ({error})") from error
    if not raw.startswith(np.lib.format.MAGIC_PREFIX):
        raise ClipError(f"{path.name}: not a readable .npy file")
    try:
        stream = io.BytesIO(raw)
        version = np.lib.format.read_magic(stream)
        read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
        read(stream)
        boxed = _ArraysOnly(stream).load()
    except (ValueError, pickle.UnpicklingError, EOFError) as error:
        if isinstance(error, ClipError):
            raise
        raise ClipError(f"{path.name}: not a readable .npy file ({error})") from error
    return boxed.item() if isinstance(boxed, np.ndarray) and boxed.shape == () else boxed
