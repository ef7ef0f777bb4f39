"""Recorded joint positions made ready for a body: metres, z up, smooth, and with all joints of the trunk."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from rfgen_sionna._short_repr import ShortRepr
from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.motion.clip_error import ClipError
from rfgen_sionna.generative.motion.joint_files import JointTrack, read_joints
from rfgen_sionna.generative.motion.joint_layouts import package_joints
from rfgen_sionna.generative.motion.joint_smoothing import LONGEST_GAP, check_gaps, smooth_paths
from rfgen_sionna.generative.motion.rotations import normalised
from rfgen_sionna.generative.motion.skeleton import JOINT, JOINT_NAMES, NUM_BODY_JOINTS, SIDES
from rfgen_sionna.scene.mesh_files import to_z_up

_LOG = logging.getLogger(__name__)
_LEGS = (0.3, 1.15)
"""Hip to ankle of people from a toddler to the tallest [m]."""
_UNITS = {"millimetres": 1e-3, "centimetres": 1e-2, "inches": 0.0254, "decimetres": 0.1}
_PROPORTIONS = {
    "thigh over shank": (0.55, 1.8),
    "upper arm over forearm": (0.5, 2.0),
    "left thigh over right": (0.6, 1.7),
    "left shank over right": (0.6, 1.7),
    "left arm over right": (0.6, 1.7),
    "trunk over leg": (0.35, 1.5),
    "arm over leg": (0.35, 1.5),
}
"""Bounds of the ratios of bones, from infants to the longest legs, with the errors of depth cameras."""
_UPRIGHT = 0.7
"""Cosine of the angle to the vertical within which a body stands or sits."""
_VARYING = 0.3
"""Largest relative standard deviation of a leg bone's length over time; above, positions are no body's."""
_OPTIONAL = (
    "pelvis", "spine1", "spine2", "spine3", "neck", "head", "nose",
    *(f"{side}_{joint}" for side in SIDES for joint in ("ear", "hand", "heel", "collar", "foot")),
)  # fmt: skip
"""Joints that a body does without, where they are missing in all frames."""


@dataclass(frozen=True, eq=False, repr=False)
class JointRecording(ShortRepr):
    """Smooth positions of the 22 joints of a body at a uniform rate."""

    positions: FloatArray
    """(frame, 22, 3) [m], z up, at the place where they were recorded."""
    frame_rate: float
    """[Hz]."""
    measured: tuple[str, ...]
    """Joints that were measured; the others are interpolated along the trunk or carried along."""
    noise: dict[str, float]
    """Median distance of each measured joint's raw positions from the smooth path [m]."""
    lengths: dict[str, float]
    """Joint -> median distance from its parent in the raw positions [m], of knees, ankles, elbows and wrists."""
    hip_centred: bool
    """Whether the hips are the origin in every frame, as in MediaPipe's world landmarks."""


def record_joints(
    source: Any,
    *,
    layout: str | None = None,
    names: Sequence[str] | None = None,
    columns: str | None = None,
    index: int | None = None,
    up: str | None = None,
    scale: float = 1.0,
    frame_rate: float | None = None,
    times: ArrayLike | None = None,
    longest_gap: float = LONGEST_GAP,
) -> JointRecording:
    """Joint positions of one person, smooth and with z up; the arguments are those of
    :meth:`rfgen_sionna.generative.actor.Actor.from_joints`.

    Raises:
        FileNotFoundError: there is no such file.
        ClipError: the positions are no person's, or the axis, the unit or the rate is missing or wrong.
    """
    track = read_joints(source, layout=layout, names=names, columns=columns, index=index)
    if isinstance(scale, bool) or not (np.isfinite(scale) and scale > 0.0):
        raise ClipError(f"scale: {scale!r} m per unit; allowed is more than 0")
    if not (np.isfinite(longest_gap) and longest_gap >= 0.0):
        raise ClipError(f"longest_gap: {longest_gap!r} s; allowed is 0 and more")
    joints = package_joints(track.names)
    kept = list(joints)
    places = track.positions[:, [joints[name] for name in kept]] * scale
    trust = np.ones(places.shape[:2])
    if track.confidences is not None:
        trust = track.confidences[:, [joints[name] for name in kept]]
    places[~(np.isfinite(places).all(axis=-1) & (trust > 0.0))] = np.nan
    places[np.abs(places).max(axis=-1) == 0.0] = np.nan  # sensors write zeros for joints that they do not see
    if "pelvis" in joints and _at_origin(track.positions[:, joints["pelvis"]]):
        places[:, kept.index("pelvis")] = 0.0
    at = _times(track, frame_rate, times)
    unseen = _unseen(track.label, at, places, kept, longest_gap)
    part = [k for k, name in enumerate(kept) if name not in unseen]
    kept, places, trust = [kept[k] for k in part], places[:, part], trust[:, part]
    for name, path in zip(kept, places.swapaxes(0, 1), strict=True):
        if np.isnan(path).all():
            raise ClipError(f"{track.label}: {name} is missing in all frames, and no body goes without it")
    check_size(track.label, places, kept, scale)
    _check_proportions(track.label, places, kept)
    _check_image(track, places, kept, scale)
    axis = up if up is not None else track.up
    places = places @ upright_rotation(track.label, places, kept, axis).T
    _check_handedness(track.label, places, kept)
    grid, smooth, rate = smooth_paths(at, places, trust, [f"{track.label}: {name}" for name in kept], longest_gap)
    back = np.stack([np.interp(at, grid, smooth[:, j, k]) for j in range(len(kept)) for k in range(3)], axis=-1)
    distance = np.linalg.norm(places - back.reshape(places.shape), axis=-1)
    hips = 0.5 * (smooth[:, kept.index("left_hip")] + smooth[:, kept.index("right_hip")])
    centred = len(hips) > 1 and float(np.abs(hips).max()) < 0.02
    if centred:
        _LOG.warning(
            "%s: the hips are the origin in every frame (MediaPipe's world landmarks are): the person keeps the "
            "place, and the height follows from the feet; give positions in the room where the way matters",
            track.label,
        )
    body = {name: smooth[:, k] for k, name in enumerate(kept)}
    return JointRecording(
        complete(body), rate, tuple(name for name in kept if name in JOINT and JOINT[name] < NUM_BODY_JOINTS),
        {name: float(np.nanmedian(distance[:, k])) for k, name in enumerate(kept)}, _lengths(places, kept), centred,
    )  # fmt: skip


def _unseen(label: str, times: FloatArray, places: FloatArray, names: Sequence[str], longest_gap: float) -> list[str]:
    """Joints that a body does without, missing for too long; a warning names those that are seen at times."""
    unseen = []
    for name in (name for name in _OPTIONAL if name in names):
        seen = np.asarray(np.isfinite(places[:, names.index(name)]).all(axis=-1))
        try:
            check_gaps(times, seen, name, longest_gap)
        except ClipError as error:
            unseen.append(name)
            if seen.any():
                _LOG.warning("%s: %s; it is left out, and follows the joints around it", label, error)
    return unseen


def _lengths(places: FloatArray, names: Sequence[str]) -> dict[str, float]:
    bones = (("hip", "knee"), ("knee", "ankle"), ("shoulder", "elbow"), ("elbow", "wrist"))
    return {
        f"{side}_{b}": float(np.nanmedian(_distance(places, names, f"{side}_{a}", f"{side}_{b}")))
        for side in SIDES
        for a, b in bones
    }


def _at_origin(path: FloatArray) -> bool:
    seen = path[np.isfinite(path)]
    return bool(len(seen) and not seen.any())


def _times(track: JointTrack, frame_rate: float | None, times: ArrayLike | None) -> FloatArray:
    """(frame,) times [s]; arguments replace those of the file."""
    count = len(track.positions)
    if times is not None and frame_rate is not None:
        raise ClipError("frame_rate and times: one of the two")
    if frame_rate is not None and (isinstance(frame_rate, bool) or not (np.isfinite(frame_rate) and frame_rate > 0.0)):
        raise ClipError(f"frame_rate: {frame_rate!r} Hz; allowed is more than 0")
    at = track.times if times is None else np.asarray(times, np.float64).ravel()
    rate = track.frame_rate
    if frame_rate is not None:
        own = rate if at is None or count < 2 else 1.0 / float(np.median(np.diff(at)))
        if own and abs(own / frame_rate - 1.0) > 0.02:
            _LOG.warning("%s: frame_rate=%g Hz replaces the file's %.4g Hz", track.label, frame_rate, own)
        at, rate = None, frame_rate
    if at is None:
        if rate is None and count > 1:
            raise ClipError(f"{track.label}: no frame rate and no times; frame_rate= [Hz] or times= [s] is needed")
        if rate is not None and not (np.isfinite(rate) and rate > 0.0):
            raise ClipError(f"{track.label}: frame rate {rate!r} Hz; allowed is more than 0, frame_rate= replaces it")
        return np.arange(count) / (rate or 1.0)
    if at.shape != (count,) or not np.isfinite(at).all():
        raise ClipError(f"times: shape {at.shape}; one finite time [s] for each of the {count} frames is needed")
    if count > 1:
        steps = np.diff(at)
        if steps.min() <= 0.0:
            late = int(np.argmin(steps)) + 1
            raise ClipError(f"times: frame {late} at {at[late]:g} s is not after the one before ({at[late - 1]:g} s)")
        if np.median(steps) > 2.0:
            raise ClipError(f"times: steps of {np.median(steps):g} s; seconds are needed, times * 1e-3 if these are ms")
    return at


def check_size(label: str, places: FloatArray, names: Sequence[str], scale: float = 1.0) -> None:
    """Check that positions (frame, joint, 3) [m] are in space, in metres, and a body's.

    Raises:
        ClipError: they are not; the message names the cure.
    """
    seen = places[np.isfinite(places).all(axis=-1)]
    if not len(seen):
        raise ClipError(f"{label}: no finite positions")
    extent = np.ptp(seen, axis=0)
    bones = np.stack([_distance(places, names, f"{side}_{a}", f"{side}_{b}") for side in SIDES
                      for a, b in (("hip", "knee"), ("knee", "ankle"))])  # fmt: skip
    lengths = np.nanmedian(bones, axis=1)
    if not np.isfinite(lengths).all() or lengths.min() < 1e-6:
        raise ClipError(f"{label}: joints coincide; legs of some length are needed")
    depth = float(np.abs(seen[:, 2]).max()) / scale
    if extent[2] < 0.02 * extent.max() or (extent[:2].max() > 10.0 * scale and depth <= 1.0):
        raise ClipError(
            f"{label}: the third coordinate spans {extent[2]:.3g} beside {extent[:2].max():.3g}: key points in an "
            "image (x, y, score); positions in space [m] are needed, such as a depth camera's or MediaPipe's "
            "pose_world_landmarks"
        )
    spread = float((np.nanstd(bones, axis=1) / np.nanmean(bones, axis=1)).max())
    if spread > _VARYING:
        raise ClipError(
            f"{label}: a leg's bone changes its length by {100 * spread:.0f} %, allowed are {100 * _VARYING:.0f} %: "
            "not the joints of one body; check layout, names, columns and index (features that were normalised for "
            "training must be multiplied by Std.npy, and Mean.npy added, first)"
        )
    leg = 0.5 * float(lengths.sum())
    if not _LEGS[0] <= leg <= _LEGS[1]:
        unit = next((u for u, factor in _UNITS.items() if _LEGS[0] <= leg * factor <= _LEGS[1]), None)
        cure = "positions in metres are needed, or scale= [m per unit]"
        if unit:
            cure = f"it looks like {unit}: scale={_UNITS[unit]:g}"
        elif leg < _LEGS[0]:
            cure += "; MediaPipe's pose_landmarks are image coordinates, pose_world_landmarks are metres"
        raise ClipError(
            f"{label}: legs of {leg:.3g} m from hip to ankle; people have {_LEGS[0]} to {_LEGS[1]} m; {cure}"
        )


def _check_proportions(label: str, places: FloatArray, names: Sequence[str]) -> None:
    """Check that limbs and trunk have the proportions of a person: joints in another order have not."""

    def length(a: str, b: str) -> float:
        return float(np.nanmedian(_distance(places, names, a, b)))

    sides = [
        [length(f"{s}_{a}", f"{s}_{b}") for a, b in (("hip", "knee"), ("knee", "ankle"), ("shoulder", "elbow"),
                                                      ("elbow", "wrist"))]
        for s in SIDES
    ]  # fmt: skip
    left, right = (np.maximum(side, 1e-6) for side in sides)
    thigh, shank, upper, fore = left + right
    trunk = 2.0 * float(np.nanmedian(np.linalg.norm(_middle(places, names, "shoulder") - _middle(places, names, "hip"),
                                                    axis=-1)))  # fmt: skip
    ratios = (
        thigh / shank, upper / fore, left[0] / right[0], left[1] / right[1], left[2:].sum() / right[2:].sum(),
        trunk / (thigh + shank), (upper + fore) / (thigh + shank),
    )  # fmt: skip
    for (name, (low, high)), ratio in zip(_PROPORTIONS.items(), ratios, strict=True):
        if not low <= ratio <= high:
            raise ClipError(
                f"{label}: {name} is {ratio:.2f}, people have {low:g} to {high:g}: not the joints of one body in this "
                "order; check layout, names, columns and index"
            )


def _distance(places: FloatArray, names: Sequence[str], a: str, b: str) -> FloatArray:
    return np.linalg.norm(places[:, names.index(a)] - places[:, names.index(b)], axis=-1)


def _check_image(track: JointTrack, places: FloatArray, names: Sequence[str], scale: float) -> None:
    """Check that joints of a detector's layout are no shares of an image's width and height."""
    xy = track.positions[..., :2][np.isfinite(track.positions[..., :2])]
    leg = float(np.nanmedian(_distance(places, names, "left_hip", "left_ankle")))
    if "left_ear" in names and scale == 1.0 and xy.min() > -0.1 and 0.3 < xy.max() < 1.1 and leg < 0.65:
        raise ClipError(
            f"{track.label}: x and y from {xy.min():.2f} to {xy.max():.2f}: shares of an image "
            "(MediaPipe's pose_landmarks); positions in space are needed, such as its pose_world_landmarks"
        )


def _middle(places: FloatArray, names: Sequence[str], joint: str) -> FloatArray:
    return 0.5 * (places[:, names.index(f"left_{joint}")] + places[:, names.index(f"right_{joint}")])


def upright_rotation(label: str, places: FloatArray, names: Sequence[str], up: str | None) -> FloatArray:
    """(3, 3) rotation to z up of positions (frame, joint, 3), checked against the body's own direction.

    Raises:
        ClipError: the body stands along another axis, or on its head.
    """
    try:
        chosen = to_z_up(up or "z", front=True)
    except ValueError as error:
        raise ClipError(str(error)) from error
    trunk = _middle(places, names, "shoulder") - _middle(places, names, "hip")
    legs = _middle(places, names, "hip") - _middle(places, names, "ankle")
    body = normalised(trunk) + normalised(legs)
    body = body[np.isfinite(body).all(axis=-1)]
    if not len(body):
        return chosen
    # the most upright part of the clip decides
    axes = {name: float(np.quantile(0.5 * body @ to_z_up(name, front=True)[2], 0.9)) for name in _AXES}
    best = max(axes, key=lambda name: axes[name])
    mine = float(np.quantile(0.5 * body @ chosen[2], 0.9))
    if axes[best] > _UPRIGHT and mine < -0.3:
        raise ClipError(
            f"{label}: the head is below the feet with up={up or 'z'!r}; the person stands with up={best!r}"
        )
    if axes[best] > _UPRIGHT and mine < _UPRIGHT and up is None:
        raise ClipError(
            f"{label}: nobody stands with z up; the person stands with up={best!r}, and up='z' says that somebody lies"
        )
    if axes[best] > _UPRIGHT and mine < 0.35:
        _LOG.warning("%s: the person never stands with up=%r; up=%r would stand", label, up, best)
    return chosen


_AXES = ("z", "-z", "y", "-y", "x", "-x")


def _check_handedness(label: str, places: FloatArray, names: Sequence[str]) -> None:
    """Check that feet and nose point ahead of a body whose left is on its left: axes may be left-handed."""
    across = places[:, names.index("left_hip")] - places[:, names.index("right_hip")]
    across = across + places[:, names.index("left_shoulder")] - places[:, names.index("right_shoulder")]
    spine = _middle(places, names, "shoulder") - _middle(places, names, "hip")
    ahead = normalised(np.cross(across, spine))
    signs = []
    for side in SIDES:
        if f"{side}_foot" in names:
            start = f"{side}_heel" if f"{side}_heel" in names else f"{side}_ankle"
            signs.append(places[:, names.index(f"{side}_foot")] - places[:, names.index(start)])
        # knees give way forwards
        hip, knee, ankle = (places[:, names.index(f"{side}_{joint}")] for joint in ("hip", "knee", "ankle"))
        signs.append(2.0 * knee - hip - ankle)
    if "nose" in names and "left_ear" in names and "right_ear" in names:
        signs.append(places[:, names.index("nose")] - _middle(places, names, "ear"))
    seen = np.stack([np.nanmedian(np.sum(sign * ahead, axis=-1)) for sign in signs])
    if np.nansum(seen) < -0.05 and np.nanmax(seen) < 0.01:
        raise ClipError(
            f"{label}: feet and knees point backwards: left and right are exchanged, as in left-handed axes (Unity, "
            "Unreal) or a mirrored image; negate one horizontal axis first, such as positions[..., 0] *= -1"
        )


def complete(body: dict[str, FloatArray]) -> FloatArray:
    """(frame, 22, 3) positions of all joints of the body, from those that were measured.

    Missing vertebrae are spread along the trunk, the neck is put above the shoulders, the head between the ears, toes
    ahead of the ankles.

    Args:
        body: joint -> (frame, 3) [m], z up; hips, knees, ankles, shoulders, elbows and wrists are needed.
    """
    joints = dict(body)
    hips = 0.5 * (joints["left_hip"] + joints["right_hip"])
    shoulders = 0.5 * (joints["left_shoulder"] + joints["right_shoulder"])
    joints.setdefault("pelvis", hips)
    if "spine3" not in joints:
        start = joints.get("spine2", hips)
        joints["spine3"] = start + (0.35 if "spine2" in joints else 0.5) * (shoulders - start)
    joints.setdefault("spine1", joints["pelvis"])
    joints.setdefault("spine2", joints["spine1"] + 0.6 * (joints["spine3"] - joints["spine1"]))
    joints.setdefault("neck", shoulders + 0.2 * (shoulders - hips))
    if "head" not in joints:
        ears = [joints[f"{side}_ear"] for side in SIDES if f"{side}_ear" in joints]
        above = joints["neck"] + 0.25 * (joints["neck"] - joints["spine3"])
        joints["head"] = np.mean(ears, axis=0) if len(ears) == 2 else above
    across = normalised(joints["left_hip"] - joints["right_hip"])
    ahead = normalised(np.cross(across, [0.0, 0.0, 1.0]))
    for side in SIDES:
        shoulder = joints[f"{side}_shoulder"]
        joints.setdefault(f"{side}_collar", shoulders + 0.13 * (shoulder - shoulders) + 0.03 * (shoulders - hips))
        ankle = joints[f"{side}_ankle"]
        size = np.linalg.norm(ankle - joints[f"{side}_knee"], axis=-1, keepdims=True)
        joints.setdefault(f"{side}_foot", ankle + size * (0.34 * ahead - [0.0, 0.0, 0.11]))
    return np.stack([joints[name] for name in JOINT_NAMES[:NUM_BODY_JOINTS]], axis=1)
