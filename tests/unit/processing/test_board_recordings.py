"""Recorded point clouds have the traits of the boards' chains: `--data FOLDER` with RadHAR and MARS."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np

from experiments.radhar.chain_fit import range_window_errors
from experiments.radhar.recordings import RANGE_BIN_M, CloudRecording, read_recording
from rfgen_sionna.processing.boards import CHAINS


def radhar(folder: Path) -> list[CloudRecording]:
    """The first recording of each activity."""
    return [read_recording(min(place.glob("*.npz"))) for place in sorted((folder / "radhar/Train").iterdir())]


def neighbour_shares(frame: np.ndarray, range_bin: np.ndarray, doppler: np.ndarray) -> tuple[float, float]:
    """Shares of points whose next range bin, or next Doppler bin, has a point of the same frame."""
    cells = set(zip(frame.tolist(), range_bin.tolist(), doppler.tolist(), strict=True))
    count = len(cells)
    return (
        sum((f, r + 1, d) in cells for f, r, d in cells) / count,
        sum((f, r, d + 1) in cells for f, r, d in cells) / count,
    )


def test_the_range_window_of_radhar_is_blackmans(recordings: Path) -> None:
    errors = range_window_errors(radhar(recordings))
    assert min(errors, key=errors.__getitem__) == CHAINS["radhar"].range_window
    assert errors["blackman"] < 0.6 * errors["hann"]


def test_peaks_of_radhar_are_grouped_in_doppler_and_not_in_range(recordings: Path) -> None:
    chain = CHAINS["radhar"]
    for item in radhar(recordings):
        cells = np.round(item.distance / RANGE_BIN_M).astype(int)
        along, across = neighbour_shares(item.frame[item.moving], cells[item.moving], item.doppler[item.moving])
        assert (along > 0.2) is not chain.group_range
        assert (across < 0.01) is chain.group_doppler


def test_coordinates_and_peaks_of_radhar_are_fixed_point_numbers(recordings: Path) -> None:
    for item in radhar(recordings):
        np.testing.assert_array_equal(item.position * 512 % 1, 0.0)
        peak = 10 ** (item.intensity / 10)
        np.testing.assert_allclose(peak, np.round(peak), rtol=1e-5)


def test_points_come_in_the_order_of_the_transform_and_second_peaks_follow(recordings: Path) -> None:
    """Doppler bins 0, 1, …, -1, each by ascending range; the list starts again for second azimuth peaks."""
    for item in radhar(recordings):
        key = (item.doppler % 16) * 1000 + np.round(item.distance / RANGE_BIN_M).astype(int)
        turns = np.array([np.sum(np.diff(key[item.frame == number]) < 0) for number in range(item.frames)])
        assert np.mean(turns <= 1) > 0.95


def test_points_of_mars_are_not_grouped_and_cut(recordings: Path) -> None:
    with h5py.File(recordings / "mars/subject2/radar_data7.mat") as stored:
        table = np.asarray(stored["radar_data_cropped"])
    table = table.T if table.shape[0] == 8 else table
    cells = np.round(np.linalg.norm(table[:, 2:5], axis=1) / 0.02929).astype(int)
    doppler = np.round(table[:, 5] / 0.356).astype(int)
    _, across = neighbour_shares(table[:, 0].astype(int), cells, doppler)
    assert (across < 0.01) is CHAINS["mars"].group_doppler
    assert np.unique(table[:, 0], return_counts=True)[1].max() <= CHAINS["mars"].max_points
