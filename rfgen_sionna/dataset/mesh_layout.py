"""mmMesh's layout: point clouds of 128 points, and joint rotations of the SMPL family.

Source: H. Xue et al., "mmMesh", MobiSys 2021, and its repository HavocFiXer/mmMesh (pc_generation.py, data.py).
Bodies here are no SMPL bodies: their joint tree and T-pose are SMPL-H's, their bone lengths and shapes are their own.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from rfgen_sionna._types import FloatArray
from rfgen_sionna.dataset.export_folder import Progress, new_folder, save_array, save_record, split_folder
from rfgen_sionna.dataset.reader import Run
from rfgen_sionna.dataset.windows import MAX_POINTS, WindowReader, actor_names

SMPL_PARENTS = (-1, 0, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 9, 9, 12, 13, 14, 16, 17, 18, 19, 20, 21)
"""Parent of each of SMPL's 24 joints; the first 22 are those of our bodies, in the same order."""
BODY_JOINTS = 22
"""Joints of SMPL that our bodies have; its last two are the hands, which follow the wrists here."""
TO_MMMESH = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
"""From our world axes (x ahead, y left, z up) to mmMesh's (x right, y ahead, z up)."""
TO_SMPL = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
"""From the axes of our T-pose (x ahead, y left, z up) to SMPL's (x left, y up, z ahead)."""

_TEXT = """\
# Radar point clouds and bodies in mmMesh's layout

Arrays of `train/`, …, float32, have the axes (recording, 1, frame, ...), as mmMesh's (person, action, frame, ...):
each recording is a person of its own with one action. `np.load` reads them, without pickles.

| file | axes | what |
| --- | --- | --- |
| `pc.npy` | ..., 128, 6 | points, see below |
| `points.npy` | ... | number of different points |
| `joints.npy` | ..., 24, 3 | joints in SMPL's order, mmMesh's world axes [m]; the hands (22, 23) are NaN |
| `pelvis.npy` | ..., 3 | position of the pelvis joint [m] |
| `pmat.npy` | ..., 24, 3, 3 | rotations of SMPL's joints relative to their parents; the first one in mmMesh's world |
| `gender.npy` | recording, 1 | 1 male, 0 female, between for bodies between |
| `recordings.json` | | number, action, place and body parameters of each recording |

The fields of a point are x to the right, y ahead, z up [m], velocity [m/s, positive recedes], log10 of the amplitude
[sqrt(W)] and range [m]. Frames with fewer than 128 points repeat theirs, frames with none are 0.

`pmat` poses an SMPL body like ours. What mmMesh has and this folder has not:

- `betas`: shape coefficients of SMPL. Our bodies are of another model (anny); `recordings.json` has its parameters. A
  loss over SMPL's vertices has no truth here; one over `joints` has.
- `trans`: SMPL's translation, which is the pelvis minus the pelvis of the turned SMPL body. `pelvis` is the joint
  itself: subtract what your SMPL model puts there.

mmMesh takes the 128 strongest cells of a map; points here are detections (CFAR), the strongest 128.
"""


def to_mmmesh(
    folder: str | PathLike[str],
    output: str | PathLike[str],
    *,
    split: str | None = None,
    radar: str | None = None,
    window_s: float | None = None,
    seed: int = 0,
    overwrite: bool = False,
    progress: Progress | None = None,
) -> Path:
    """Write the arrays of mmMesh's `data.py`, as far as our bodies have them; the folder's README says what is what.

    Parameters
    ----------
    window_s
        Length of each entry [s]; None takes whole recordings, which must have one length.
    seed
        Seed of the repeated points of frames with fewer than 128.

    Raises
    ------
    OutputError
        If the folder exists already, or cannot be written.
    ValueError
        If recordings have several actors, other lengths, or an actor without SMPL's joints; rotations need recordings
        that keep "body", and are left out otherwise.
    """
    reader = WindowReader(
        folder, split, "point_cloud", ("action", "joints"), radar=radar, window_s=window_s, max_points=MAX_POINTS
    )
    if len(reader.joint_names) < BODY_JOINTS:
        raise ValueError(f"recordings have {len(reader.joint_names)} joints: SMPL's first {BODY_JOINTS} are needed")
    random = np.random.default_rng(seed)
    with new_folder(output, overwrite) as target:
        parts: dict[str, dict[str, list[Any]]] = {}
        for number, window in enumerate(reader.windows, 1):
            run, row = reader.run(window.position), reader.recordings.rows[window.position]
            arrays, facts = _entry(run, window.frames, reader.label_values(window, run)["joints"][:, 0], random)
            part = parts.setdefault(split_folder(row.split), {})
            for name, values in arrays.items():
                part.setdefault(name, []).append(values)
            record = {"recording": row.number, "first_frame": window.first, "action": row.actions[0]}
            part.setdefault("recordings", []).append(record | {"place": row.place} | facts)
            if progress is not None:
                progress(number, len(reader.windows))
        for split_name, part in parts.items():
            records = part.pop("recordings")
            for name, entries in part.items():
                if len(entries) == len(records):
                    stacked = np.stack(entries).astype(np.float32)
                    save_array(target / split_name / f"{name}.npy", stacked if name == "gender" else stacked[:, None])
            save_record(target / split_name / "recordings.json", {"recordings": records})
        (target / "README.md").write_text(_TEXT, encoding="utf-8")
    return Path(output)


def _entry(
    run: Run, frames: slice, joints: FloatArray, random: np.random.Generator
) -> tuple[dict[str, NDArray[Any]], dict[str, Any]]:
    """Arrays of one recording, and facts about its body."""
    clouds, counts = [], []
    found = run.representation("point_cloud", frames)
    column = {str(name): number for number, name in enumerate(found.axes["field"])}
    for number in range(len(found)):
        cloud = mmmesh_points(found.frame(number), column)[:MAX_POINTS]
        counts.append(len(cloud))
        if len(cloud):
            again = random.integers(len(cloud), size=MAX_POINTS - len(cloud))
            clouds.append(np.concatenate([cloud, cloud[again]]))
        else:
            clouds.append(np.zeros((MAX_POINTS, 6), np.float32))
    placed = np.full((len(joints), len(SMPL_PARENTS), 3), np.nan)
    placed[:, :BODY_JOINTS] = joints[:, :BODY_JOINTS] @ TO_MMMESH.T
    arrays = {"pc": np.stack(clouds), "points": np.array(counts), "joints": placed, "pelvis": placed[:, 0]}
    body = run.stored(f"actors/{actor_names(run)[0]}/body")
    if body is None or "joint_rotation" not in body:
        return arrays, {}
    arrays["pmat"] = smpl_rotations(Rotation.from_quat(_flat(body["joint_rotation"][frames])), len(found))
    record = json.loads(body.attrs.get("record", "{}"))
    facts = {name: value for name, value in record.items() if name != "kind"}
    gender = _gender(record)
    return arrays | ({} if gender is None else {"gender": np.array([gender])}), {"body": facts}


def mmmesh_points(rows: NDArray[np.float32], column: Mapping[str, int]) -> NDArray[np.float32]:
    """(point, 6) points of a frame as mmMesh orders them, from rows with the given columns."""
    world = rows[:, [column[name] for name in "xyz"]] @ TO_MMMESH.T
    energy = 0.5 * np.log10(np.maximum(rows[:, column["power"]], 1e-30))
    others = np.stack([rows[:, column["velocity"]], energy, rows[:, column["range"]]], axis=1)
    return np.concatenate([world, others], axis=1).astype(np.float32)


def smpl_rotations(world: Rotation, frames: int) -> FloatArray:
    """(frame, 24, 3, 3) rotations of SMPL's joints relative to their parents, the first one in mmMesh's world.

    `world` holds the world rotations of our joints relative to the T-pose, frame after frame.
    """
    turns = world.as_matrix().reshape(frames, -1, 3, 3)[:, :BODY_JOINTS]
    found = np.broadcast_to(np.eye(3), (frames, len(SMPL_PARENTS), 3, 3)).copy()
    parents = list(SMPL_PARENTS[1:BODY_JOINTS])
    local = np.swapaxes(turns[:, parents], -1, -2) @ turns[:, 1:]
    found[:, 1:BODY_JOINTS] = TO_SMPL @ local @ TO_SMPL.T
    found[:, 0] = TO_MMMESH @ turns[:, 0] @ TO_SMPL.T
    return found


def _flat(quaternions: NDArray[Any]) -> FloatArray:
    return np.asarray(quaternions, np.float64).reshape(-1, 4)


def _gender(record: Mapping[str, Any]) -> float | None:
    """1 male, 0 female, as mmMesh counts; our body model has 0 for male."""
    value = record.get("parameters", {}).get("gender")
    return None if value is None else 1.0 - float(value)
