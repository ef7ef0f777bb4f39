"""Pose parameters of the SMPL family as data sets and video methods write them."""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from rfgen_sionna._short_repr import ShortRepr
from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.motion.array_files import read_arrays
from rfgen_sionna.generative.motion.clip_error import ClipError
from rfgen_sionna.generative.motion.rotations import normalised

_LOG = logging.getLogger(__name__)
_RATES = ("mocap_framerate", "mocap_frame_rate", "fps", "frame_rate", "framerate")
_PLACES = {
    "trans_world": "y", "trans": None, "transl": None, "smpl_trans": "y", "pred_trans": "-y", "cam_trans": "-y",
    "pred_cam_t": "-y", "trans_orig": None, "root_trans": None, "root_translation": "y",
}  # fmt: skip
"""Key of the place -> up axis of its frame, None where the key does not say."""
_WHOLE = {
    "pose_world": "y", "poses": None, "pose_aa": None, "smpl_poses": "y", "fullpose": None, "full_pose": None,
    "pred_rotmat": "-y", "smpl_thetas": "-y", "pose": "-y", "poses_cam": "-y",
}  # fmt: skip
"""Key of all joints' rotations -> up axis of its frame. World before camera: WHAM (pose_world), AMASS (poses), AIST++
(smpl_poses), TRAM (pred_rotmat), ROMP (smpl_thetas), VIBE and PARE (pose)."""
_PARTS = (
    ("root_orient", "pose_body", ("pose_hand",)),
    ("global_orient", "body_pose", ("left_hand_pose", "right_hand_pose")),
)
"""Keys of root, body and hands in AMASS and in the smplx package."""
_FRAMES = (("smpl_params_global", "y"), ("smpl_params_incam", "-y"), ("pred_smpl_params", "-y"),
           ("smpl_params", "-y"), ("smpl", "-y"))  # fmt: skip
"""Key of a dictionary of parameters -> up axis (GVHMR, HMR 2.0)."""
_LAYOUTS = {66: "SMPL body, 22 joints", 72: "SMPL, 24 joints", 156: "SMPL-H, 52 joints", 165: "SMPL-X, 55 joints"}
_STANDING = 0.7


@dataclass(frozen=True, eq=False, repr=False)
class SmplTrack(ShortRepr):
    """Parameters of one person."""

    poses: FloatArray
    """(frame, 66, 72, 156 or 165) axis-angle rotations [rad]."""
    translation: FloatArray
    """(frame, 3) [m]."""
    frame_rate: float | None
    """[Hz]; None where the file has none."""
    up: str | None
    """Up axis of the file's frame; None where its keys do not say."""


def read_smpl(path: Path, *, index: int = 0) -> SmplTrack:
    """Parameters of a person in a file.

    Args:
        path: `.npz`, `.npy`, `.pkl` or `.pt`.
        index: number of the person, in the order of their identities.

    Raises:
        FileNotFoundError: there is no such file.
        ClipError: the file is not readable, or has no such parameters.
    """
    data = read_arrays(path)
    if path.suffix.lower() == ".npz" and isinstance(data, dict):
        for key in ("results", "arr_0"):
            if isinstance(data.get(key), (dict, list)):
                data = data[key]
    people = _people(path.name, data)
    if not 0 <= index < len(people):
        holds = f"holds {len(people)} people, from 0" if len(people) > 1 else "holds one motion, 0"
        raise ClipError(f"{path.name}: index {index}; it {holds}")
    if len(people) > 1:
        _LOG.warning("%s: %d people; index=%d of 0 to %d is taken", path.name, len(people), index, len(people) - 1)
    return _track(path.name, people[index])


def is_smpl(data: Any) -> bool:
    """Whether a dictionary has parameters of a person."""
    if not isinstance(data, Mapping):
        return False
    keys = set(data)
    return (
        bool(keys & (set(_WHOLE) | {key for key, _ in _FRAMES}))
        or any({a, b} <= keys for a, b, _ in _PARTS)
        or ("thetas" in keys and "root_translation" in keys)
    )


def _people(name: str, data: Any) -> list[Mapping[str, Any]]:
    """Dictionary of each person's parameters."""
    if is_smpl(data):
        found = next(((data[key], up) for key, up in _FRAMES if isinstance(data.get(key), Mapping)), None)
        if found is not None:
            return [{**_text_keys(data, _RATES), **found[0], "_up": found[1]}]
        if not isinstance(data.get("smpl"), list):
            return [data]
    if isinstance(data, Mapping) and data:
        values = [data[key] for key in _in_order(data)]
        if all(isinstance(v, Mapping) and "smpl" in v and "tid" in v for v in values):
            return _of_phalp(name, values)
        if all(is_smpl(v) for v in values):
            if all(np.ndim(v.get("smpl_thetas", 0)) == 2 for v in values):
                return _of_romp(name, values)
            return values
    if isinstance(data, Sequence) and len(data) and all(is_smpl(v) for v in data):
        return [_stacked(name, data)]
    holds = ", ".join(map(str, data)) if isinstance(data, Mapping) else type(data).__name__
    raise ClipError(
        f"{name}: 'poses' is missing; the file has {holds or 'nothing'}. Allowed are {', '.join(_WHOLE)}, or "
        + ", or ".join(" with ".join((a, b)) for a, b, _ in _PARTS)
    )


def _text_keys(data: Mapping[Any, Any], keys: Sequence[str]) -> dict[str, Any]:
    return {key: data[key] for key in keys if key in data}


def _in_order(data: Mapping[Any, Any]) -> list[Any]:
    """Keys by number where they are numbers, else by name."""
    return sorted(data, key=lambda k: (0, k, "") if isinstance(k, (int, np.integer)) else (1, 0, str(k)))


def _of_phalp(name: str, frames: Sequence[Mapping[str, Any]]) -> list[Mapping[str, Any]]:
    """People of PHALP's tracks (4D-Humans): for each frame lists of parameters, cameras and identities."""
    found: dict[int, list[tuple[int, Mapping[str, Any]]]] = {}
    for k, frame in enumerate(frames):
        for j, identity in enumerate(frame["tid"]):
            if j < len(frame["smpl"]) and isinstance(frame["smpl"][j], Mapping):
                place = np.ravel(frame["camera"][j]) if j < len(frame.get("camera", ())) else np.zeros(3)
                found.setdefault(int(identity), []).append((k, {**frame["smpl"][j], "pred_cam_t": place}))
    people: list[Mapping[str, Any]] = []
    for identity in sorted(found):
        at = np.array([k for k, _ in found[identity]])
        if len(at) != at[-1] - at[0] + 1:
            gap = int(np.argmax(np.diff(at)))
            people.append({"_gap": f"person {identity} is missing from frame {at[gap] + 1} to {at[gap + 1] - 1}"})
        else:
            people.append({**_stacked(name, [item for _, item in found[identity]]), "_up": "-y"})
    if not people:
        raise ClipError(f"{name}: nobody in any frame")
    return people


def _of_romp(name: str, frames: Sequence[Mapping[str, Any]]) -> list[Mapping[str, Any]]:
    """People of ROMP's results: for each frame arrays over the people."""
    counts = {len(frame["smpl_thetas"]) for frame in frames}
    if len(counts) != 1:
        raise ClipError(f"{name}: {min(counts)} to {max(counts)} people in a frame; track them, or cut the clip")
    keys = [key for key in ("smpl_thetas", "cam_trans") if all(key in frame for frame in frames)]
    return [{key: np.stack([frame[key][j] for frame in frames]) for key in keys} for j in range(counts.pop())]


def _stacked(name: str, frames: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """One dictionary of arrays over the frames of a list of dictionaries."""
    known = (*_WHOLE, *_PLACES, *(key for a, b, more in _PARTS for key in (a, b, *more)))
    shared = [key for key in known if all(key in frame for frame in frames)]
    try:
        stacks = {key: np.stack([np.asarray(frame[key], np.float64) for frame in frames]) for key in shared}
    except (TypeError, ValueError) as error:
        raise ClipError(f"{name}: frames of different shapes ({error})") from error
    # one frame a dictionary: a leading axis of one is the frame's own
    for key, value in stacks.items():
        if value.ndim > 2 and value.shape[1] == 1 and key not in ("global_orient", "root_orient"):
            stacks[key] = value[:, 0]
    return dict(stacks)


def _track(name: str, data: Mapping[str, Any]) -> SmplTrack:
    if "_gap" in data:
        raise ClipError(f"{name}: {data['_gap']}; cut the clip there, or take another index=")
    if "thetas" in data and "root_translation" in data:
        return _of_mdm(name, data)
    poses, up = _poses(name, data)
    place = next((key for key in _PLACES if key in data and data[key] is not None), None)
    if "pose_world" not in data and "trans" in data:
        place = "trans"
    if place is None:
        if (data.get("_up") or up) != "-y":
            raise ClipError(
                f"{name}: 'trans' is missing; the file has {', '.join(map(str, data))}. Zeros (frames, 3) keep the "
                "person in place"
            )
        _LOG.warning("%s: no place (trans, transl) in it: the person stays in place", name)
        translation = np.zeros((len(poses), 3))
    else:
        translation = _numbers(name, place, data[place])
        if translation.ndim == 3 and translation.shape[1] == 1:
            translation = translation[:, 0]
        up = up or _PLACES[place]
        if "smpl_scaling" in data:  # of AIST++
            translation = translation / _numbers(name, "smpl_scaling", data["smpl_scaling"]).ravel()[0]
    key = next((key for key in _RATES if key in data), None)
    rate = None
    if key is not None:
        rates = _numbers(name, key, data[key]).ravel()
        if rates.size != 1 or not (np.isfinite(rates[0]) and rates[0] > 0.0):
            raise ClipError(f"{name}: the frame rate {key} is {data[key]!r}; allowed is one number of Hz more than 0")
        rate = float(rates[0])
    if poses.shape[1] not in _LAYOUTS:
        allowed = ", ".join(f"{n} ({layout})" for n, layout in _LAYOUTS.items())
        raise ClipError(f"{name}: poses has {poses.shape[1]} columns and {len(poses)} frames; allowed are {allowed}")
    if translation.shape != (len(poses), 3):
        raise ClipError(f"{name}: {place} has shape {translation.shape}; allowed is {(len(poses), 3)}")
    if not (np.isfinite(poses).all() and np.isfinite(translation).all()):
        raise ClipError(f"{name}: poses or {place} hold values that are not finite")
    return SmplTrack(poses, translation, rate, data.get("_up") or up)


def _poses(name: str, data: Mapping[str, Any]) -> tuple[FloatArray, str | None]:
    """(frame, column) axis-angles [rad], joined where the file has them in parts, and their up axis."""
    whole = next((key for key in _WHOLE if key in data), None)
    if whole is not None:
        return axis_angles(name, whole, data[whole]), _WHOLE[whole]
    root, body, hands = next((keys for keys in _PARTS if keys[0] in data and keys[1] in data), ("", "", ()))
    if not root:
        raise ClipError(f"{name}: 'poses' is missing; the file has {', '.join(map(str, data)) or 'nothing'}")
    present = [key for key in (root, body, *hands) if key in data]
    flat = [axis_angles(name, key, data[key]) for key in present]
    if len({len(part) for part in flat}) > 1:
        raise ClipError(f"{name}: its parts of poses have {', '.join(str(len(p)) for p in flat)} frames")
    if len(flat) == 3 and flat[2].shape[1] == 45 and len(hands) == 2:
        flat.insert(2 if present[2] == hands[1] else 3, np.zeros((len(flat[0]), 45)))
    if any(part.shape[1] != 45 for part in flat[2:]) and len(hands) == 2:
        flat = flat[:2]  # hands as principal components, whose basis is the licensed model's
    if len(flat) > 2:
        flat[1] = flat[1][:, :63]
    return np.concatenate(flat, axis=1), None


def axis_angles(name: str, key: str, values: Any) -> FloatArray:
    """(frame, 3 · joint) axis-angle rotations [rad] of axis-angles, or of (…, 3, 3) matrices.

    Raises:
        ClipError: no numbers, or matrices that are no rotations.
    """
    array = _numbers(name, key, values)
    if array.ndim >= 3 and array.shape[-2:] == (3, 3) and len(array) and np.isfinite(array).all():
        matrices = array.reshape(-1, 3, 3)
        if (
            np.abs(matrices @ np.swapaxes(matrices, 1, 2) - np.eye(3)).max() > 0.05
            or np.linalg.det(matrices).min() < 0.5
        ):
            if array.ndim == 3:
                return array.reshape(len(array), -1)  # three joints of axis-angles
            raise ClipError(f"{name}: {key} holds matrices that are no rotations; orthonormal ones are needed")
        return np.asarray(Rotation.from_matrix(matrices).as_rotvec().reshape(len(array), -1))
    return array.reshape(len(array), -1) if array.ndim and len(array) else array.reshape(0, 0)


def _of_mdm(name: str, data: Mapping[str, Any]) -> SmplTrack:
    """MDM's `…_smpl_params.npy`: (joint, 6, frame) the first two rows of the rotation matrices (Zhou et al. 2019), and
    (3, frame) places; y up, 20 Hz."""
    thetas, places = (
        _numbers(name, "thetas", data["thetas"]),
        _numbers(name, "root_translation", data["root_translation"]),
    )
    if thetas.ndim != 3 or thetas.shape[:2] != (24, 6) or places.shape != (3, thetas.shape[2]):
        raise ClipError(
            f"{name}: thetas has shape {thetas.shape} and root_translation {places.shape}; allowed are "
            "(24, 6, frames) and (3, frames)"
        )
    rows = np.moveaxis(thetas, 2, 0)
    first = normalised(rows[..., :3])
    second = normalised(rows[..., 3:] - np.sum(first * rows[..., 3:], axis=-1, keepdims=True) * first)
    matrices = np.stack([first, second, np.cross(first, second)], axis=-2)
    if not (np.isfinite(matrices).all() and np.isfinite(places).all()):
        raise ClipError(f"{name}: thetas or root_translation hold values that are not finite, or no rotations")
    return SmplTrack(axis_angles(name, "thetas", matrices), places.T, 20.0, "y")


def _numbers(name: str, key: str, values: Any) -> FloatArray:
    try:
        return np.asarray(values, np.float64)
    except (TypeError, ValueError) as error:
        raise ClipError(f"{name}: {key} holds no numbers ({error})") from error


def standing_axis(poses: FloatArray) -> str | None:
    """Axis along which a person stands (SMPL's body has y up at rest), from axis-angles (frame, column) [rad]; None
    where nobody stands along an axis."""
    spine = Rotation.from_rotvec(poses[:, :3]).apply([0.0, 1.0, 0.0])
    shares = {f"{sign}{axis}": float(np.quantile(factor * spine[:, k], 0.5))
              for k, axis in enumerate("xyz") for sign, factor in (("", 1.0), ("-", -1.0))}  # fmt: skip
    best = max(shares, key=lambda axis: shares[axis])
    return best if shares[best] > _STANDING else None
