"""MARS's recordings: point clouds of a radar, and the joints that a Kinect saw at the same time.

A folder `mars/subjectN` has `radar_dataM.mat` of each movement M, and the joints of all movements in three tables,
`timesplit/kinect_data_{train,validate,test}.csv`: of the N frames of a movement the first ceil(0.6 N) are in `train`,
the next ceil(0.2 N) in `validate`, the rest in `test`, and movements follow one another.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import h5py
import numpy as np
from numpy.typing import NDArray

from rfgen_sionna.generative.motion.joint_files import read_joints

FRAME_PERIOD_S = 0.1
"""Time from frame number to frame number."""
VELOCITY_STEP = 3e8 / (2 * 77e9 * 16 * 3 * 114e-6)
"""Step of the Doppler of MARS's points [m/s]; the board takes the frequency at which a ramp starts, and 3e8 m/s."""
RANGE_STEP = 3e8 * 5e6 / (2 * 100e12 * 256)
"""Step of |xyz| [m]."""
MOVEMENTS: Mapping[int, str] = {
    1: "left upper limb extended", 2: "right upper limb extended", 3: "both upper limbs extended",
    4: "left front lunge", 5: "right front lunge", 6: "squat", 7: "left side lunge", 8: "right side lunge",
    9: "left limb extended", 10: "right limb extended",
}  # fmt: skip
PARTS = ("train", "validate", "test")
_KEY = "radar_data_cropped"
_COLUMNS = 8


@dataclass(frozen=True)
class MarsClouds:
    """Point clouds of frames of one movement, measured or simulated, in the axes of the data set."""

    row: NDArray[np.int64]
    """(frame,) row of the movement's joints of each frame, ascending."""
    frame: NDArray[np.int64]
    """(point,) index into `row`, ascending."""
    xyz: NDArray[np.float64]
    """(point, 3) x lateral, y depth, z up [m], from the radar."""
    doppler: NDArray[np.float64]
    """(point,) [m/s], receding is positive."""
    intensity: NDArray[np.float64]
    """(point,) magnitude of the strongest azimuth beam."""

    @property
    def distance(self) -> NDArray[np.float64]:
        """(point,) [m]"""
        return np.linalg.norm(self.xyz, axis=1)

    @property
    def counts(self) -> NDArray[np.int64]:
        """(frame,) number of points."""
        return np.bincount(self.frame, minlength=len(self.row))

    def at_rows(self, rows: NDArray[np.int64]) -> MarsClouds:
        """The frames of `rows`, ascending, that these clouds have."""
        kept = np.isin(self.row, rows)
        points = kept[self.frame]
        number = np.cumsum(kept) - 1
        return MarsClouds(
            self.row[kept], number[self.frame[points]], self.xyz[points], self.doppler[points], self.intensity[points]
        )


@dataclass(frozen=True, eq=False)
class MarsMovement:
    """One movement of one person: a cloud and 25 joints a frame."""

    subject: int
    movement: int
    clouds: MarsClouds
    joints: NDArray[np.float64]
    """(row, 25, 3) x lateral, y depth, z up [m], from the Kinect."""
    names: tuple[str, ...]
    """(25,) names of the joints, as the tables have them."""
    number: NDArray[np.int64]
    """(row,) number of the radar's frame."""
    stamp: NDArray[np.float64]
    """(row,) time of the host [s]."""
    part: NDArray[np.str_]
    """(row,) one of `PARTS`."""

    @property
    def name(self) -> str:
        return f"subject{self.subject}-{self.movement:02d}"

    def cut(self, start: int, stop: int) -> MarsMovement:
        """Rows from `start` to before `stop`, numbered from 0."""
        part = slice(start, stop)
        clouds = self.clouds.at_rows(np.arange(start, stop))
        return replace(
            self, clouds=replace(clouds, row=clouds.row - start), joints=self.joints[part], number=self.number[part],
            stamp=self.stamp[part], part=self.part[part],
        )  # fmt: skip


def subjects(data: Path) -> list[int]:
    """Numbers of the people below `data`/mars.

    Raises
    ------
    FileNotFoundError
        If there is none.
    """
    found = [folder.name.removeprefix("subject") for folder in (data / "mars").glob("subject*") if folder.is_dir()]
    numbers = sorted(int(each) for each in found if each.isdigit())
    if not numbers:
        raise FileNotFoundError(f"{data / 'mars'}: no folder subjectN; MARS is needed (github.com/SizheAn/MARS)")
    return numbers


def part_lengths(frames: int) -> tuple[int, int, int]:
    """Numbers of frames of a movement in `PARTS`."""
    first = -(-6 * frames // 10)
    second = min(-(-2 * frames // 10), frames - first)
    return first, second, frames - first - second


def read_subject(data: Path, subject: int) -> list[MarsMovement]:
    """All movements of a person below `data`/mars, by number.

    Raises
    ------
    FileNotFoundError
        If the folder or a table is missing.
    ValueError
        If a file is not in the layout, or radar and Kinect have different numbers of frames.
    """
    folder = data / "mars" / f"subject{subject}"
    files = {int(file.stem.removeprefix("radar_data")): file for file in folder.glob("radar_data*.mat")}
    if not files:
        raise FileNotFoundError(f"{folder}: no radar_dataM.mat; MARS is needed (github.com/SizheAn/MARS)")
    tables = {number: _read_points(files[number]) for number in sorted(files)}
    frames = {number: len(np.unique(table[:, 0])) for number, table in tables.items()}
    tracks = {part: read_joints(folder / "timesplit" / f"kinect_data_{part}.csv") for part in PARTS}
    for index, (part, track) in enumerate(tracks.items()):
        needed = sum(part_lengths(count)[index] for count in frames.values())
        if len(track.positions) != needed:
            raise ValueError(
                f"{folder.name}: kinect_data_{part}.csv has {len(track.positions)} rows, and the radar's movements "
                f"{', '.join(map(str, frames))} have {needed} frames for it: radar and joints do not pair; a movement "
                "is missing, or a file is of another release (synced_data/wooutlier is needed)"
            )
        if track.names != tracks[PARTS[0]].names:
            raise ValueError(f"{folder.name}: kinect_data_{part}.csv has other joints than kinect_data_train.csv")
    start = dict.fromkeys(PARTS, 0)
    found = []
    for number, table in tables.items():
        lengths = dict(zip(PARTS, part_lengths(frames[number]), strict=True))
        joints = np.concatenate(
            [tracks[part].positions[start[part] : start[part] + length] for part, length in lengths.items()]
        )
        start = {part: start[part] + length for part, length in lengths.items()}
        own, first, frame = np.unique(table[:, 0], return_index=True, return_inverse=True)
        clouds = MarsClouds(np.arange(len(own)), frame, table[:, 2:5], table[:, 5], table[:, 6])
        found.append(
            MarsMovement(
                subject, number, clouds, joints, tracks[PARTS[0]].names, own.astype(np.int64), table[first, 7],
                np.repeat(PARTS, list(lengths.values())),
            )
        )  # fmt: skip
    return found


def read_clouds(file: Path) -> MarsClouds:
    """Simulated clouds of one movement (:mod:`experiments.mars.clouds`)."""
    with np.load(file) as stored:
        return MarsClouds(**{name: stored[name] for name in MarsClouds.__dataclass_fields__})


def write_clouds(file: Path, clouds: MarsClouds) -> None:
    """The file of :func:`read_clouds`."""
    np.savez_compressed(file, **vars(clouds))


def _read_points(file: Path) -> NDArray[np.float64]:
    """(point, 8) frame, number of the point, x, y, z, Doppler, intensity, time; frames ascend."""
    try:
        with h5py.File(file) as stored:
            if _KEY not in stored:
                raise ValueError(f"{file.name}: no '{_KEY}' in it, only {', '.join(stored)}")
            table = np.asarray(stored[_KEY], np.float64)
    except OSError as error:
        raise ValueError(f"{file.name}: no HDF5 file (MATLAB's 7.3), as MARS's are: {error}") from error
    table = table.T if table.ndim == 2 and table.shape[0] == _COLUMNS else table
    if table.ndim != 2 or table.shape[1] != _COLUMNS or not len(table) or not np.all(np.isfinite(table)):
        raise ValueError(f"{file.name}: '{_KEY}' has shape {table.shape}: finite numbers (point, 8) are needed")
    if np.any(np.diff(table[:, 0]) < 0):
        raise ValueError(f"{file.name}: frame {int(table[np.diff(table[:, 0]).argmin(), 0])} is followed by an earlier")
    return table
