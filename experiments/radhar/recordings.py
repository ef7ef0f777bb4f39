"""RadHAR's point clouds, measured or simulated, as one record."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna.processing.boards import BoardPoints

ACTIVITIES = ("boxing", "jack", "jump", "squats", "walk")
"""Names of RadHAR's folders."""
FRAME_RATE_HZ = 27.0
"""Frames a second that RadHAR's files hold; the board makes 30, some are lost on their way."""
RANGE_BIN_M = 0.04091
"""Step of |xyz| in RadHAR's files [m]."""


@dataclass(frozen=True)
class CloudRecording:
    """Points of one recording of one activity."""

    activity: str
    name: str
    frame: NDArray[np.int64]
    """(point,) number of the frame, ascending."""
    doppler: NDArray[np.int64]
    """(point,) signed Doppler bin."""
    position: NDArray[np.float64]
    """(point, 3) x ahead, y lateral, z up [m], from the radar."""
    distance: NDArray[np.float64]
    """(point,) [m]"""
    intensity: NDArray[np.float64]
    """(point,) 10 log10(peak + 1) [dB]."""
    frames: int

    @property
    def moving(self) -> NDArray[np.bool_]:
        """(point,) whether the point is outside of Doppler bin 0."""
        return self.doppler != 0


def read_recording(file: Path) -> CloudRecording:
    """One `.npz` of RadHAR."""
    with np.load(file) as stored:
        start = stored["point_id"] == 0
        xyz = stored["xyz"].astype(np.float64)
        return CloudRecording(
            activity=file.parent.name,
            name=file.stem,
            frame=np.cumsum(start) - 1,
            doppler=stored["dbin"].astype(np.int64) - 8,
            position=xyz,
            distance=np.linalg.norm(xyz, axis=1),
            intensity=stored["intensity"].astype(np.float64),
            frames=int(start.sum()),
        )


def read_part(data: Path, part: str = "Train") -> list[CloudRecording]:
    """All recordings below `data`/radhar/PART, by activity and name.

    Raises
    ------
    FileNotFoundError
        If a folder of an activity is missing.
    """
    found = []
    for activity in ACTIVITIES:
        folder = data / "radhar" / part / activity
        if not folder.is_dir():
            raise FileNotFoundError(f"{folder}: RadHAR's part {part} is needed (github.com/nesl/RadHAR), as .npz")
        found += [read_recording(file) for file in sorted(folder.glob("*.npz"))]
    return found


def first_recordings(recordings: Sequence[CloudRecording]) -> list[CloudRecording]:
    """The first recording of each activity, which the chain and the manner of the motions are fitted on."""
    return [next(item for item in recordings if item.activity == name) for name in ACTIVITIES]


def from_board_points(points: BoardPoints, activity: str, name: str) -> CloudRecording:
    """Simulated points in RadHAR's axes: lateral to the right."""
    return CloudRecording(
        activity=activity,
        name=name,
        frame=points.frame,
        doppler=points.doppler_bin,
        position=points.position * [1.0, -1.0, 1.0],
        distance=np.linalg.norm(points.position, axis=1),
        intensity=10 * np.log10(points.peak + 1),
        frames=points.frames,
    )
