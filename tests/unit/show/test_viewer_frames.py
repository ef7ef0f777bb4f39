"""What viewers take from recordings that store representations instead of samples."""

import numpy as np
import pytest

from rfgen_sionna.dataset import RunInfo, RunWriter, open_run
from rfgen_sionna.dataset.representations import representation_arrays, representation_values
from rfgen_sionna.processing import point_cloud
from rfgen_sionna.show.contact_sheet import contact_sheet
from rfgen_sionna.show.level_pictures import even_columns
from rfgen_sionna.show.page_data import page_data
from rfgen_sionna.show.viewer_frames import viewed_frame, viewed_run

KEEP = ("range_doppler", "micro_doppler", "point_cloud", "labels")


@pytest.fixture(scope="module")
def stored(run_path, tmp_path_factory):
    """Path of the ball's run with maps, spectra and points in place of the samples."""
    path = tmp_path_factory.mktemp("stored") / "stored.h5"
    with open_run(run_path) as run:
        info = RunInfo(run.radar, prompt=run.prompt, arrays=representation_arrays(KEEP, run.radar))
        with RunWriter(path, info, keep=KEEP) as writer:
            for frame, time in enumerate(run.frame_times):
                arrays = representation_values(KEEP, run.adc[frame], run.radar)
                writer.append(None, time=float(time), arrays=arrays)
    return path


def test_points_and_maps_are_those_that_are_stored(stored, run):
    with open_run(stored) as without:
        assert "adc" not in without.contents
        for frame in (0, 3):
            view, points = viewed_frame(without, frame), point_cloud(run.adc[frame], run.radar)
            np.testing.assert_allclose(view.cloud.position, points.position, atol=1e-5)
            np.testing.assert_allclose(view.cloud.device, points.device, atol=1e-5)
            np.testing.assert_allclose(view.cloud.velocity, points.velocity, atol=1e-6)
            distance, speed = np.unravel_index(view.range_doppler.argmax(), view.range_doppler.shape)
            assert view.range[distance] == pytest.approx(points.range[0], abs=0.1)
            assert view.velocity[speed] == pytest.approx(0.8, abs=0.2)
            assert view.static


def test_spectrograms_are_those_that_are_stored(stored, run):
    with open_run(stored) as without:
        whole, spectra = viewed_run(without), run.representation("micro_doppler")
    np.testing.assert_allclose(
        whole.doppler_time.power, spectra.values.reshape(-1, spectra.values.shape[-1]), rtol=1e-6
    )
    windows = run.frame_times[:, None] + spectra.axes["window"]
    np.testing.assert_allclose(whole.doppler_time.time, windows.ravel())
    assert np.all(np.diff(whole.doppler_time.time) > 0)
    nearest = whole.range_time.range[whole.range_time.power.argmax(axis=1)]
    np.testing.assert_allclose(nearest, np.linalg.norm([2.5, 1.0, 0.2]) + 0.8 * run.frame_times, atol=0.1)


def test_columns_stand_at_their_times_after_pauses():
    time = np.array([0.0, 0.1, 0.2, 0.6, 0.7])
    even, values = even_columns(time, np.arange(5.0)[:, None])
    np.testing.assert_allclose(even, 0.1 * np.arange(8))
    assert values[:, 0].tolist() == [0, 1, 2, 2, 2, 3, 3, 4]
    same, values = even_columns(np.arange(4.0), np.arange(4.0)[:, None])
    np.testing.assert_array_equal(same, np.arange(4.0))
    assert len(even_columns(np.array([0.0, 1e-3, 1e6]), np.zeros((3, 1)))[0]) <= 4096


def test_a_page_and_a_sheet_show_them(stored, tmp_path):
    with open_run(stored) as without:
        data = page_data(without, "report")
    assert data.header["rangeDoppler"]["note"] == "static included"
    assert [plot["title"] for plot in data.header["spectrograms"]] == ["Range–time", "Doppler–time"]
    assert data.header["cloud"]["starts"][-1] == len(data.arrays["cloud"]) > 0
    assert data.header["actors"] == []
    assert contact_sheet({"maps": stored}, tmp_path / "sheet.png").stat().st_size > 5000
