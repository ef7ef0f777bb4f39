"""RadHAR's layout: point clouds as text, and voxels of two seconds.

Source: A. Singh et al., "RadHAR", mmNets 2019, and its repository nesl/RadHAR (Data, DataPreprocessing/voxels.py).
"""

from __future__ import annotations

import math
import warnings
import zipfile
from collections.abc import Iterator, Sequence
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import FloatArray
from rfgen_sionna.dataset.export_folder import Progress, file_name, new_folder, split_folder
from rfgen_sionna.dataset.reader import Run
from rfgen_sionna.dataset.windows import WindowReader

ACTIVITIES = {
    "jumping_jacks": "jack", "squat": "squats", "walk_straight": "walk", "walk_to_and_fro": "walk", "walk_turn": "walk",
}  # fmt: skip
"""Actions that RadHAR calls otherwise -> its word; boxing, jump and walk are the same."""
VOXELS = (10, 32, 32)
"""Cells of a frame: ahead, to the right, up."""
WINDOW, STRIDE = 60, 10
"""Frames of a window of voxels, and between windows: 2 s and a third of a second at RadHAR's 30 frames a second."""
_LEFT_OUT = 2
"""Frames at the end of a recording that RadHAR's windows leave out."""
_PARTS = {"train": "Train", "test": "Test"}


def to_radhar(
    folder: str | PathLike[str],
    output: str | PathLike[str],
    *,
    split: str | None = None,
    radar: str | None = None,
    voxels: bool | None = None,
    overwrite: bool = False,
    progress: Progress | None = None,
) -> Path:
    """Write `Train/ACTION/000012.txt`, …, and `Train_Data_voxels_ACTION.npz` with the windows of all files.

    A text file has a message for each point: x ahead, y to the right, z up [m] in the radar's frame, range [m],
    velocity [m/s, positive is receding], Doppler bin, bearing [degrees, to the right] and intensity [dB], which is here
    the ratio of signal to noise. Frames without points have no message, as in the original. The `.npz` has `arr_0`
    (window, 60, 10, 32, 32) and `arr_1` (window,) names of actions, which RadHAR's classifiers load. Actions have
    RadHAR's names where it has them.

    Parameters
    ----------
    voxels
        Whether the `.npz` files are written; recordings need 62 frames with points or more. None writes them if one is
        that long, and warns if not.

    Raises
    ------
    OutputError
        If the folder exists already, or cannot be written.
    ValueError
        If recordings have several actors, or all are shorter than a window of voxels.
    """
    reader = WindowReader(folder, split, "point_cloud", ("action",), radar=radar, alike=False)
    longest = max(window.count for window in reader.windows)
    if voxels is not False and longest < WINDOW + _LEFT_OUT:
        short = f"recordings have {longest} frames at most: voxels need {WINDOW + _LEFT_OUT} (RadHAR: 30 a second)"
        if voxels:
            raise ValueError(f"{short}; make longer recordings, or export with voxels=False (text alone)")
        warnings.warn(f"{short}; the text of the points is written alone", stacklevel=2)
        voxels = False
    with new_folder(output, overwrite) as target:
        clouds: dict[tuple[str, str], list[list[FloatArray]]] = {}
        for number, window in enumerate(reader.windows, 1):
            run, row = reader.run(window.position), reader.recordings.rows[window.position]
            action = ACTIVITIES.get(row.actions[0], row.actions[0])
            part = _PARTS.get(row.split, split_folder(row.split))
            frames = radhar_points(run)
            file = target / part / file_name(action) / f"{row.number:06d}.txt"
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_text("".join(_messages(frames, run.frame_times)), encoding="utf-8")
            clouds.setdefault((part, action), []).append([points[:, :3] for points in frames if len(points)])
            if progress is not None:
                progress(number, len(reader.windows))
        for (part, action), recordings in clouds.items() if voxels is not False else ():
            _write_voxels(target / f"{part}_Data_voxels_{file_name(action)}.npz", recordings, action)
    return Path(output)


def radhar_points(run: Run) -> list[FloatArray]:
    """Points of each frame: (point, 8) x, y, z, range, velocity, Doppler bin, bearing, intensity in RadHAR's units."""
    found = run.representation("point_cloud")
    column = {str(name): number for number, name in enumerate(found.axes["field"])}
    wave, cell = run.radar.waveform, run.radar.velocity_resolution
    frames = []
    for number in range(len(found)):
        rows = found.frame(number).astype(np.float64)
        distance, azimuth, elevation = (rows[:, column[name]] for name in ("range", "azimuth", "elevation"))
        velocity = rows[:, column["velocity"]]
        level = distance * np.cos(elevation)
        bins = np.round(velocity / cell) + wave.num_loops // 2
        values = (
            level * np.cos(azimuth), -level * np.sin(azimuth), distance * np.sin(elevation), distance, velocity, bins,
            -np.degrees(azimuth), rows[:, column["snr_db"]],
        )  # fmt: skip
        frames.append(np.round(np.stack(values, axis=1), 9))
    return frames


def _messages(frames: Sequence[FloatArray], times: FloatArray) -> Iterator[str]:
    names = ("x", "y", "z", "range", "velocity", "doppler_bin", "bearing", "intensity")
    sequence = 0
    for points, time in zip(frames, times, strict=True):
        seconds = math.floor(time)
        for number, point in enumerate(points):
            entries = zip(names, map(float, point), strict=True)
            lines = "".join(f"{name}: {int(v) if name == 'doppler_bin' else v!r}\n" for name, v in entries)
            stamp = f"    secs: {seconds}\n    nsecs: {round((time - seconds) * 1e9)}\n"
            header = f'header: \n  seq: {sequence}\n  stamp: \n{stamp}  frame_id: "ti_mmwave"\n'
            yield f"{header}point_id: {number}\n{lines}---\n"
            sequence += 1


def voxel_counts(points: FloatArray) -> NDArray[np.uint16]:
    """(10, 32, 32) numbers of points of a frame (point, 3), counted as RadHAR's `voxels.py` does.

    The grid spans the frame's own points. Cell n of an axis has the points of the n-th step from the lowest one: cell 0
    stays empty, and points in the last step of an axis do not count.
    """
    counts = np.zeros(VOXELS, np.uint16)
    cells = []
    for values, number in zip(points.T, VOXELS, strict=True):
        low = values.min()
        edges = np.add.accumulate(np.r_[low, np.full(number - 1, (values.max() - low) / number)])
        cells.append(np.searchsorted(edges, values, side="right"))
    within = np.all([cell < number for cell, number in zip(cells, VOXELS, strict=True)], axis=0)
    np.add.at(counts, tuple(cell[within] for cell in cells), 1)
    return counts


def _write_voxels(path: Path, recordings: Sequence[Sequence[FloatArray]], action: str) -> None:
    """Write the windows of all recordings, one after the other, without holding them in memory."""
    starts = [range(0, len(frames) - _LEFT_OUT - WINDOW + 1, STRIDE) for frames in recordings]
    total = sum(map(len, starts))
    header: dict[str, Any] = {"descr": "<u2", "fortran_order": False, "shape": (total, WINDOW, *VOXELS)}
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        with archive.open(zipfile.ZipInfo("arr_0.npy"), "w", force_zip64=True) as file:
            np.lib.format.write_array_header_1_0(file, header)
            for frames, firsts in zip(recordings, starts, strict=True):
                counts = [voxel_counts(points) for points in frames] if firsts else []
                for first in firsts:
                    file.write(np.stack(counts[first : first + WINDOW]).astype("<u2").tobytes())
        with archive.open(zipfile.ZipInfo("arr_1.npy"), "w") as file:
            np.lib.format.write_array(file, np.full(total, action), allow_pickle=False)
