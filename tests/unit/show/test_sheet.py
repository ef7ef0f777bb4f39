"""Sheets show targets where they are, with left on the left."""

import subprocess
import sys

import numpy as np
import pytest
from matplotlib.figure import Figure
from PIL import Image

from rfgen_sionna.dataset import OutputError, open_run
from rfgen_sionna.show import sheet
from rfgen_sionna.show.panels import draw_azimuth, draw_doppler_time, draw_pir, draw_range_doppler, draw_range_time
from rfgen_sionna.show.run_view import display_range, view_frame, view_run
from rfgen_sionna.show.style import edges, level_limits

DISTANCE = np.linalg.norm([2.5, 1.0, 0.2])


def cell_centre(mesh):
    """Data coordinates of the brightest cell of a pcolormesh."""
    row, column = np.unravel_index(mesh.get_array().argmax(), mesh.get_array().shape)
    corners = mesh.get_coordinates()[row : row + 2, column : column + 2]
    return corners.reshape(-1, 2).mean(axis=0)


def test_a_sheet_is_drawn_from_a_path_and_from_a_run(tmp_path, run_path, run):
    assert sheet(run_path, tmp_path / "a.png") == tmp_path / "a.png"
    sheet(run, tmp_path / "b.png", frame=-1, dpi=60)
    with Image.open(tmp_path / "a.png") as picture, Image.open(tmp_path / "b.png") as other:
        assert picture.size == (1760, 1155)
        assert other.size == (960, 630)
        assert np.asarray(picture.convert("L")).std() > 20
    assert run.adc.shape[0] == 4, "a run that was handed in stays open"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.png", "b.png"]


@pytest.mark.parametrize("options", [{"pir": False}, {"actors": False}, {"frames": 1}, {"period": 32 * 216e-6}])
def test_runs_without_images_actors_frames_or_pauses(tmp_path, make_run, options):
    sheet(make_run("other", **options), tmp_path / "a.png", dpi=50)
    assert (tmp_path / "a.png").stat().st_size > 20_000


def test_range_doppler_shows_the_target(run):
    figure = Figure()
    axes = figure.add_subplot()
    draw_range_doppler(figure, axes, view_frame(run, 0), 6.0)
    velocity, distance = cell_centre(axes.collections[0])
    assert velocity == pytest.approx(0.8, abs=run.radar.velocity_resolution)
    assert distance == pytest.approx(DISTANCE, abs=run.radar.range_resolution)
    assert "receding" in axes.get_xlabel()


def test_the_level_is_the_power_of_the_samples(run):
    # Amplitude 1e-6 in square roots of watts is -90 dBm; up to 1.5 dB of scalloping on a padded grid, two axes.
    assert -91.0 < view_frame(run, 0).range_doppler.max() < -89.5


def test_left_is_left_in_the_azimuth_map_and_in_the_images(run):
    figure = Figure()
    axes = figure.add_subplot()
    draw_azimuth(figure, axes, view_frame(run, 0), 6.0)
    y, x = cell_centre(axes.collections[0])
    assert y == pytest.approx(1.0, abs=0.15)
    assert x == pytest.approx(2.5, abs=0.15)
    assert axes.transData.transform((y, x))[0] < axes.transData.transform((0.0, x))[0]
    places = tuple(figure.add_subplot(1, 3, i + 1) for i in range(3))
    draw_pir(figure, places, run.pir(0))
    for place in places:
        # Azimuth grows to the left, elevation upwards; pixel (6..14, 2..8) is left and up.
        assert place.transData.transform((0.5, 0))[0] < place.transData.transform((-0.5, 0))[0]
        assert place.transData.transform((0, 0.5))[1] > place.transData.transform((0, -0.5))[1]
        assert place.images[0].get_extent()[0] == pytest.approx(np.tan(np.radians(35)))
    image = np.ma.filled(places[0].images[0].get_array(), np.nan)
    assert np.isnan(image[0]).all(), "no return has no colour"
    assert image[10, 4] == pytest.approx(-70.0)


def test_spectrograms_show_the_motion_and_its_label(run):
    view = view_run(run)
    figure = Figure()
    ranges, speeds = figure.subplots(1, 2)
    draw_range_time(figure, ranges, run, view, 6.0)
    draw_doppler_time(figure, speeds, run, view)
    _, distance = cell_centre(ranges.collections[0])
    assert distance == pytest.approx(DISTANCE + 0.12, abs=0.2)
    _, velocity = cell_centre(speeds.collections[0])
    assert velocity == pytest.approx(0.8, abs=run.radar.velocity_resolution)
    assert ranges.lines[0].get_ydata()[0] == pytest.approx(DISTANCE)
    assert speeds.lines[0].get_ydata()[0] == pytest.approx(0.8)
    assert "one spectrum a frame" in speeds.get_title("right")


def test_frames_without_pauses_get_a_short_time_transform(make_run):
    with open_run(make_run("steady", period=32 * 216e-6)) as steady:
        view = view_run(steady)
        assert not view.per_frame
        assert len(view.doppler_time.time) > 4
        assert 0 <= view.most_active_frame < 4


def test_pictures_reach_as_far_as_the_farthest_return(run, make_run):
    assert display_range(run, 0) == pytest.approx(1.05 * 3e-8 * 299_792_458 / 2)
    with open_run(make_run("bare", pir=False, actors=False)) as bare:
        assert display_range(bare, 0) == bare.radar.max_range


def test_colours_span_from_the_noise_to_the_peak():
    rng = np.random.default_rng(0)
    noise = rng.normal(-120, 2, 10_000)
    assert level_limits(np.append(noise, -80.0))[0] == pytest.approx(-123, abs=0.2)
    assert level_limits(np.append(noise, -20.0)) == (-80.0, -20.0)
    low, high = level_limits(noise)
    assert high - low >= 20
    np.testing.assert_allclose(edges(np.array([0.0, 1.0, 3.0])), [-0.5, 0.5, 2.0, 4.0])


def test_bad_requests_are_named(tmp_path, run):
    with pytest.raises(ValueError, match=r"frame is 4; '.*' has the frames 0 … 3"):
        sheet(run, tmp_path / "a.png", frame=4)
    with pytest.raises(ValueError, match=r"ends in '.txt'; allowed: .*\.png"):
        sheet(run, tmp_path / "a.txt")
    (tmp_path / "a.png").write_text("precious")
    with pytest.raises(OutputError, match="exists"):
        sheet(run, tmp_path / "a.png")
    assert (tmp_path / "a.png").read_text() == "precious"


def test_nothing_global_of_matplotlib_is_touched():
    modules = ("matplotlib.pyplot", "mitsuba", "torch")
    code = f"import sys, rfgen_sionna.show; print([m for m in {modules} if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
