"""Joint positions from arrays and files: frames, joints, names, times and confidences as given."""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from rfgen_sionna._short_repr import ShortRepr
from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.motion.array_files import read_arrays
from rfgen_sionna.generative.motion.clip_error import ClipError
from rfgen_sionna.generative.motion.joint_layouts import LAYOUTS, layout_names

JOINT_SUFFIXES = (".npy", ".npz", ".csv")
MDM_RATE = 20.0
"""Poses per second of MDM's results [Hz]."""
_POSITIONS = ("positions", "joints", "joints3d", "joints_3d", "keypoints", "keypoints_3d", "keypoints3d", "skeleton")
_TIMES = ("times", "time", "timestamps", "timestamp", "t")
_RATES = ("frame_rate", "fps", "framerate", "mocap_framerate", "mocap_frame_rate", "rate")
_NAMES = ("names", "joint_names", "joints_names")
_CONFIDENCES = ("confidence", "confidences", "visibility", "scores", "score", "conf")
_ROW_NAMES = ("joint", "joint_name", "name", "landmark", "landmark_name", "keypoint", "joint_id", "landmark_id")
_COLUMN = re.compile(
    r"^(?:(?P<a1>[xyz])[ _.:-]+(?P<n1>.+)|(?P<a2>[xyz])(?P<n2>\d+)|(?P<n3>.+?)[ _.:-]+(?P<a3>[xyzXYZ])|"
    r"(?P<n4>.*[a-z0-9])(?P<a4>[XYZ]))$"
)
_TRUST = re.compile(r"^(.+?)[ _.:-]+(?:visibility|confidence|conf|score|c|v)$", re.IGNORECASE)
_SECONDS = {"": 1.0, "s": 1.0, "sec": 1.0, "seconds": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
_TIME = re.compile(r"^(?:time|timestamps?|t)(?:[ _]*[\[(]?(s|sec|seconds|ms|us|ns)[\])]?)?$", re.IGNORECASE)


@dataclass(frozen=True, eq=False, repr=False)
class JointTrack(ShortRepr):
    """Joint positions of one person as they were given."""

    positions: FloatArray
    """(frame, joint, 3), in the data's own units and axes; NaN where missing."""
    names: tuple[str, ...]
    confidences: FloatArray | None = None
    """(frame, joint), at least 0."""
    times: FloatArray | None = None
    """(frame,) [s]."""
    frame_rate: float | None = None
    """[Hz]."""
    label: str = "positions"
    """Name of the file, for messages."""
    up: str | None = None
    """Up axis that the format has."""


def read_joints(
    source: Any,
    *,
    layout: str | None = None,
    names: Sequence[str] | None = None,
    columns: str | None = None,
    index: int | None = None,
) -> JointTrack:
    """Joint positions of one person.

    Args:
        source: an array (frame, joint, 3), (frame, joint, 4) with a confidence, (frame, person, joint, 3 or 4), or
            flat (frame, 3 · joint); or a `.npy`, `.npz` or `.csv` file.
        layout: name of a layout of :data:`LAYOUTS`; None takes `names` or those of the file.
        names: names of the joints, in their order.
        columns: order of flat columns: "xyz" (x, y, z of each joint) or "planar" (all x, all y, all z).
        index: number of the person, or of the motion in MDM's results.

    Raises:
        FileNotFoundError: there is no such file.
        ClipError: the input is no joint positions; the message names the cure.
    """
    if columns not in (None, "xyz", "planar"):
        raise ClipError(
            f"columns: {columns!r}; allowed are 'xyz' (x, y, z of each joint) and 'planar' (all x, all y …)"
        )
    if layout is not None and names is not None:
        raise ClipError("layout and names: one of the two; a layout has its own names")
    given = layout_names(layout) if layout is not None else None if names is None else tuple(map(str, names))
    if not isinstance(source, (str, PathLike)):
        return _track(source, given, columns, index, "positions")
    path = Path(source)
    if not path.is_file():
        raise FileNotFoundError(f"no file of joint positions {path}")
    kind = path.suffix.lower()
    if kind == ".csv":
        return _read_csv(path, given, columns)
    if kind not in JOINT_SUFFIXES:
        raise ClipError(f"{path.name}: ending {path.suffix!r}; joint positions come as {', '.join(JOINT_SUFFIXES)}")
    data = read_arrays(path)
    if isinstance(data, dict) and kind == ".npy":
        return _of_mdm(path.name, data, index)
    if not isinstance(data, dict):
        return _track(data, given, columns, index, path.name)
    key = next((key for key in _POSITIONS if key in data), None)
    if key is None:
        raise ClipError(
            f"{path.name}: no {', '.join(_POSITIONS)} in it, only {', '.join(map(repr, data)) or 'nothing'}"
            + ("; SMPL parameters go to Actor.from_motion" if {"poses", "body_pose", "pose_aa"} & set(data) else "")
        )
    own = next((tuple(map(str, np.ravel(data[k]))) for k in _NAMES if k in data), None)
    trust = next((data[k] for k in _CONFIDENCES if k in data), None)
    times = next((_numbers(data[k], f"{path.name}: {k}").ravel() for k in _TIMES if k in data), None)
    rate = next((_numbers(data[k], f"{path.name}: {k}").ravel() for k in _RATES if k in data), None)
    if rate is not None and rate.size != 1:
        raise ClipError(f"{path.name}: the frame rate has {rate.size} values; one number of Hz is needed")
    return _track(
        data[key], given or own, columns, index, path.name, trust, times, None if rate is None else float(rate[0])
    )


def _numbers(values: Any, label: str) -> FloatArray:
    try:
        array = np.asarray(values, np.float64)
    except (TypeError, ValueError) as error:
        raise ClipError(f"{label}: holds no numbers ({error}); every frame needs the same joints") from error
    if not array.size:
        raise ClipError(f"{label}: no frames (shape {array.shape})")
    return array


def _track(
    values: Any,
    names: tuple[str, ...] | None,
    columns: str | None,
    index: int | None,
    label: str,
    trust: Any = None,
    times: FloatArray | None = None,
    frame_rate: float | None = None,
) -> JointTrack:
    if values is None or isinstance(values, (dict, bytes)):
        raise ClipError(f"{label}: {type(values).__name__} given; an array (frame, joint, 3) [m] or a file is needed")
    array = _numbers(values, label)
    if array.ndim == 4:
        array = _one_person(array, names, index, label)
    elif index:
        raise ClipError(f"index: {index!r}; {label} holds one person (shape {array.shape}), 0")
    if names is None:
        count = array.shape[1] if array.ndim == 3 else 0
        fitting = [name for name, joints in LAYOUTS.items() if len(joints) == count]
        raise ClipError(
            f"{label}: shape {array.shape} without names; layout={' or '.join(map(repr, fitting or LAYOUTS))}, or "
            "names=[...] says them"
        )
    if array.ndim == 2:
        array = _unfolded(array, len(names), columns, label)
    if array.ndim != 3:
        raise ClipError(f"{label}: shape {array.shape}; allowed is (frame, joint, 3) [m]")
    if array.shape[2] == 2:
        raise ClipError(
            f"{label}: shape {array.shape} is of 2-D key points in an image; positions in space (x, y, z) [m] are "
            "needed, such as MediaPipe's pose_world_landmarks, a depth camera's or a lifting network's"
        )
    if array.shape[1] != len(names) or array.shape[2] not in (3, 4):
        wanted = f"(frame, {len(names)}, 3), or (frame, {len(names)}, 4) with a confidence"
        raise ClipError(f"{label}: shape {array.shape}; allowed for these {len(names)} joints is {wanted}")
    confidences = None
    if array.shape[2] == 4:
        confidences = _confidence(array[..., 3], label)
        array = array[..., :3]
    if trust is not None:
        confidences = _confidence(_numbers(trust, f"{label}: confidence"), label)
        if confidences.shape != array.shape[:2]:
            raise ClipError(f"{label}: confidences have shape {confidences.shape}; allowed is {array.shape[:2]}")
    return JointTrack(np.array(array), names, confidences, times, frame_rate, label)


def _one_person(array: FloatArray, names: tuple[str, ...] | None, index: int | None, label: str) -> FloatArray:
    if array.shape[-1] not in (2, 3, 4) or (names is not None and array.shape[2] != len(names)):
        raise ClipError(
            f"{label}: shape {array.shape}; allowed are (frame, joint, 3) and (frame, person, joint, 3): move the "
            "axes, of NTU's (3, frame, joint, person) with np.transpose(x, (1, 3, 2, 0))"
        )
    people = array.shape[1]
    if index is None and people > 1:
        raise ClipError(f"{label}: {people} people; index= says which, 0 to {people - 1}")
    chosen = 0 if index is None else index
    if isinstance(chosen, bool) or not isinstance(chosen, (int, np.integer)) or not 0 <= chosen < people:
        raise ClipError(f"index: {index!r}; {label} holds {people} people, from 0")
    return np.asarray(array[:, chosen])


def _unfolded(array: FloatArray, count: int, columns: str | None, label: str) -> FloatArray:
    """(frame, joint, 3 or 4) of flat columns."""
    if array.shape == (count, 3):
        return array[None]
    if array.shape[1] != 3 * count:
        raise ClipError(f"{label}: {array.shape[1]} columns; allowed for these {count} joints are {3 * count}")
    if columns is None:
        raise ClipError(
            f"{label}: flat columns, shape {array.shape}; columns='xyz' (x, y, z of each joint) or columns='planar' "
            "(all x, all y, all z) says their order"
        )
    if columns == "xyz":
        return array.reshape(len(array), count, 3)
    return np.moveaxis(array.reshape(len(array), 3, count), 1, 2)


def _confidence(values: FloatArray, label: str) -> FloatArray:
    """Confidences 0 to 1; a Kinect's states 0 (not tracked), 1 (inferred), 2 (tracked) become 0, 0.3, 1."""
    filled = np.nan_to_num(values, nan=0.0)
    if filled.min() >= 0.0 and filled.max() <= 1.0:
        return filled
    if set(np.unique(filled)) <= {0.0, 1.0, 2.0}:
        return np.asarray(np.array([0.0, 0.3, 1.0])[filled.astype(int)])
    raise ClipError(
        f"{label}: the fourth column goes from {filled.min():g} to {filled.max():g}; allowed are a confidence of "
        "0 to 1 and a Kinect's tracking states 0, 1, 2; leave out another column (positions[..., :3])"
    )


def _of_mdm(name: str, data: dict[str, Any], index: int | None) -> JointTrack:
    """One motion of MDM's `results.npy`: (motion, 22, 3, frame), y up, 20 Hz."""
    positions, _ = mdm_motion(name, data, index or 0)
    return JointTrack(positions, LAYOUTS["smpl22"], frame_rate=MDM_RATE, label=name, up="y")


def mdm_motion(name: str, data: dict[str, Any], index: int) -> tuple[FloatArray, str]:
    """(frame, 22, 3) positions [m], y up, and text of a motion of MDM's `results.npy`.

    Raises:
        ClipError: the dictionary is no such file, or has no such motion.
    """
    if "motion" not in data:
        raise ClipError(f"{name}: no 'motion' in it, only {', '.join(map(repr, data))}; MDM's results have it")
    motions = _numbers(data["motion"], f"{name}: motion")
    if motions.ndim != 4 or motions.shape[1:3] != (22, 3):
        raise ClipError(f"{name}: motion has shape {motions.shape}; allowed is (motions, 22, 3, frames)")
    if not 0 <= index < len(motions):
        raise ClipError(f"{name}: index {index}; it holds {len(motions)} motions, from 0")
    frames = int(np.ravel(data["lengths"])[index]) if "lengths" in data else motions.shape[-1]
    texts = np.atleast_1d(np.asarray(data.get("text", ())))
    return np.moveaxis(motions[index], -1, 0)[:frames], str(texts[index]) if index < len(texts) else ""


def _read_csv(path: Path, names: tuple[str, ...] | None, columns: str | None) -> JointTrack:
    with path.open(newline="", encoding="utf-8-sig", errors="replace") as file:
        sample = file.read(65536)
        file.seek(0)
        delimiter = max(",;\t", key=sample.splitlines()[0].count) if sample.strip() else ","
        rows = [row for row in csv.reader(file, delimiter=delimiter) if any(cell.strip() for cell in row)]
    if not rows:
        raise ClipError(f"{path.name}: no frames")
    header = [cell.strip() for cell in rows[0]]
    if all(_is_number(cell) for cell in header):
        return _track(_cells(path.name, rows, 0), names, columns, None, path.name)
    lower = [cell.lower() for cell in header]
    if {"x", "y", "z"} <= set(lower) and set(lower) & set(_ROW_NAMES):
        return _of_rows(path.name, lower, rows[1:], names)
    table = _cells(path.name, rows[1:], 1)
    if table.ndim != 2 or table.shape[1] != len(header):
        raise ClipError(f"{path.name}: rows of {table.shape[-1]} cells under a header of {len(header)}")
    places: dict[str, dict[str, int]] = {}
    trust: dict[str, int] = {}
    times: FloatArray | None = None
    for k, cell in enumerate(header):
        if clock := _TIME.fullmatch(cell):
            times = table[:, k] * _SECONDS[(clock[1] or "").lower()]
        elif match := _COLUMN.fullmatch(cell):
            named = match.groupdict()
            name = next(str(named[key]) for key in ("n1", "n2", "n3", "n4") if named[key])
            axis = next(str(named[key]) for key in ("a1", "a2", "a3", "a4") if named[key]).lower()
            if axis in places.setdefault(name, {}):
                raise ClipError(f"{path.name}: column {cell!r} comes twice; one person a file")
            places[name][axis] = k
        elif match := _TRUST.fullmatch(cell):
            trust[match[1]] = k
    whole = [name for name, axes in places.items() if len(axes) == 3]
    flat = [name for name, axes in places.items() if set(axes) == {"x", "y"}]
    if flat and not whole:
        raise ClipError(f"{path.name}: {flat[0]!r} has x and y only: key points in an image; z [m] is needed too")
    if not whole:
        raise ClipError(
            f"{path.name}: no columns such as left_knee_x, left_knee_y, left_knee_z in its header "
            f"({', '.join(header[:6])}, …)"
        )
    own = tuple(whole)
    if all(name.isdigit() for name in own):
        own = tuple(sorted(own, key=int))
        if names is None or len(names) != len(own):
            raise ClipError(
                f"{path.name}: {len(own)} joints by number; layout= or names= with {len(own)} names says them"
            )
    elif names is not None and set(names) != set(own) and len(names) != len(own):
        raise ClipError(f"{path.name}: {len(own)} joints in its header, {len(names)} by layout or names")
    elif names is not None and set(names) != set(own):
        differing = ", ".join(sorted(set(own) - set(names))[:4])
        raise ClipError(
            f"{path.name}: its header has joints of other names ({differing}, …); leave layout and names out"
        )
    else:
        names = own
    if set(names) == set(own):
        own = names
    positions = np.stack([table[:, [places[name][axis] for axis in "xyz"]] for name in own], axis=1)
    confidences = None
    if trust:
        values = np.ones(positions.shape[:2])
        for j, name in enumerate(own):
            if name in trust:
                values[:, j] = table[:, trust[name]]
        confidences = _confidence(values, path.name)
    return JointTrack(positions, tuple(names), confidences, times, None, path.name)


def _of_rows(name: str, header: list[str], rows: list[list[str]], names: tuple[str, ...] | None) -> JointTrack:
    """Track of a table with one joint a row: a frame or a time, a joint's name or number, and x, y, z."""
    column = {key: header.index(key) for key in header}
    joint = column[next(key for key in _ROW_NAMES if key in column)]
    clock = next((k for k, cell in enumerate(header) if _TIME.fullmatch(cell)), None)
    frame = column.get("frame", column.get("frame_id", clock))
    people = next(
        (column[key] for key in ("person", "person_id", "body", "body_id", "track_id") if key in column), None
    )
    if frame is None:
        raise ClipError(f"{name}: rows of joints without a column frame or time")
    if people is not None and len({row[people] for row in rows}) > 1:
        raise ClipError(f"{name}: several people in column {header[people]!r}; one person a file")
    own = list(dict.fromkeys(row[joint].strip() for row in rows))
    if all(cell.isdigit() for cell in own):
        own.sort(key=int)
        if names is None or len(names) != len(own):
            raise ClipError(f"{name}: {len(own)} joints by number; layout= or names= with {len(own)} names says them")
    frames = list(dict.fromkeys(row[frame].strip() for row in rows))
    trust = next((column[key] for key in _CONFIDENCES if key in column), None)
    numbers = [frame if clock is None else clock, *(column[axis] for axis in "xyz"), *([trust] if trust else [])]
    values = _cells(name, [[row[k] for k in numbers] for row in rows], 1)
    table = np.full((len(frames), len(own), values.shape[1]), np.nan)
    place = {cell: k for k, cell in enumerate(frames)}, {cell: k for k, cell in enumerate(own)}
    for row, value in zip(rows, values, strict=True):
        table[place[0][row[frame].strip()], place[1][row[joint].strip()]] = value
    unit = _TIME.fullmatch(header[clock]) if clock is not None else None
    times = None if unit is None else np.nanmin(table[..., 0], axis=1) * _SECONDS[(unit[1] or "").lower()]
    confidences = _confidence(table[..., 4], name) if trust else None
    chosen = names if names is not None and all(cell.isdigit() for cell in own) else tuple(own)
    return JointTrack(table[..., 1:4], tuple(chosen), confidences, times, None, name)


def _is_number(cell: str) -> bool:
    try:
        float(cell or "nan")
    except ValueError:
        return False
    return True


def _cells(name: str, rows: list[list[str]], skipped: int) -> FloatArray:
    if not rows:
        raise ClipError(f"{name}: no frames under its header")
    width = len(rows[0])
    for line, row in enumerate(rows):
        if len(row) != width:
            raise ClipError(f"{name}: line {line + 1 + skipped} has {len(row)} cells, the first {width}")
    try:
        return np.array([[float(cell.strip() or "nan") for cell in row] for row in rows])
    except ValueError as error:
        raise ClipError(f"{name}: {error}; numbers are needed (empty cells are missing joints)") from error
