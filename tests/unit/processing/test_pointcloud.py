"""A point target comes out where it is, within a tenth of a resolution cell, on the right side, at its level."""

from dataclasses import replace

import numpy as np
import pytest

from rfgen_sionna.processing.pointcloud import point_cloud
from rfgen_sionna.processing.spectrum import observation_time
from rfgen_sionna.radar import Radar


def direction(azimuth, elevation):
    return np.array([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)])


@pytest.mark.parametrize("seed", range(24))
def test_random_moving_targets_within_a_tenth_of_a_cell(synthesise, mmmesh, seed):
    rng = np.random.default_rng(seed)
    distance = rng.uniform(0.4, 0.9 * mmmesh.max_range)
    azimuth, elevation = rng.uniform(-1.1, 1.1), rng.uniform(-0.6, 0.6)
    speed = rng.uniform(-0.98, 0.98) * mmmesh.max_velocity
    where = direction(azimuth, elevation)
    level = 10 ** rng.uniform(-6, -2)
    start = where * (distance - speed * observation_time(mmmesh))
    cloud = point_cloud(synthesise(mmmesh, [(start, speed * where, level)])[0], mmmesh, static=True)
    assert len(cloud) == 1
    assert abs(cloud.range[0] - distance) < 0.1 * mmmesh.range_resolution
    assert abs(cloud.velocity[0] - speed) < 0.1 * mmmesh.velocity_resolution
    # 8 elements of half a wavelength: a cell of 1/4 in y; two rows: a cell of 1 in z.
    found = direction(cloud.azimuth[0], cloud.elevation[0])
    assert abs(found[1] - where[1]) < 0.1 / 4
    assert abs(found[2] - where[2]) < 0.1 / 4
    assert np.sign(cloud.azimuth[0]) == np.sign(azimuth)
    assert np.sign(cloud.elevation[0]) == np.sign(elevation)
    assert 10 * np.log10(cloud.power[0] / level**2) == pytest.approx(0, abs=0.1)


@pytest.mark.parametrize("seed", range(8))
def test_targets_moving_across_report_their_radial_velocity(synthesise, mmmesh, seed):
    rng = np.random.default_rng(100 + seed)
    where = rng.uniform(2, 6) * direction(rng.uniform(-0.8, 0.8), rng.uniform(-0.3, 0.3))
    velocity = rng.uniform(-2, 2, 3)
    start = where - velocity * observation_time(mmmesh)
    cloud = point_cloud(synthesise(mmmesh, [(start, velocity, 1e-3)])[0], mmmesh, static=True)
    radial = velocity @ where / np.linalg.norm(where)
    assert abs(cloud.velocity[0] - radial) < 0.1 * mmmesh.velocity_resolution
    np.testing.assert_allclose(cloud.device[0], where, atol=0.03 * np.linalg.norm(where) / 4)


@pytest.mark.parametrize("seed", range(8))
def test_the_other_preset_and_the_array_without_height(synthesise, di_gesture, seed):
    rng = np.random.default_rng(200 + seed)
    distance, azimuth = rng.uniform(0.3, 0.9 * di_gesture.max_range), rng.uniform(-1.1, 1.1)
    speed = rng.uniform(-0.98, 0.98) * di_gesture.max_velocity
    where = direction(azimuth, 0.0)
    start = where * (distance - speed * observation_time(di_gesture))
    cloud = point_cloud(synthesise(di_gesture, [(start, speed * where, 1.0)])[0], di_gesture, static=True)
    assert abs(cloud.range[0] - distance) < 0.1 * di_gesture.range_resolution
    assert abs(cloud.velocity[0] - speed) < 0.1 * di_gesture.velocity_resolution
    assert abs(np.sin(cloud.azimuth[0]) - np.sin(azimuth)) < 0.1 / 4
    assert cloud.elevation[0] == 0


def test_a_faster_target_than_the_axis_shows_with_ambiguities(synthesise, mmmesh):
    speed, distance = 6.0, 4.0
    where = direction(0.3, 0.1)
    start = where * (distance - speed * observation_time(mmmesh))
    cube = synthesise(mmmesh, [(start, speed * where, 1.0)])[0]
    cloud = point_cloud(cube, mmmesh, static=True, ambiguities=1)
    assert abs(cloud.velocity[0] - speed) < 0.1 * mmmesh.velocity_resolution
    assert abs(cloud.azimuth[0] - 0.3) < 0.02
    assert abs(cloud.range[0] - distance) < 0.1 * mmmesh.range_resolution


def test_two_movers_over_a_wall_in_noise(synthesise, mmmesh):
    targets = [((3, 1, 0), (1, 0, 0), 1e-3), ((4, -1.5, 0.4), (-1.5, 0, 0), 7e-4), ((6, 0, 0), (0, 0, 0), 0.1)]
    cube = synthesise(mmmesh, targets, noise=3e-3, seed=3)[0]
    cloud = point_cloud(cube, mmmesh)
    assert len(cloud) == 2, "the wall is static, the noise below the threshold"
    np.testing.assert_allclose(cloud.device, [[3, 1, 0], [4, -1.5, 0.4]], atol=0.1)
    assert np.sign(cloud.velocity).tolist() == [1, -1]
    # Mean channel SNR after windowed transforms: |A|² N / (1.5² noise power), Hann over both axes.
    expected = 10 * np.log10(1e-6 * 256 * 128 / (1.5**2 * 9e-6))
    assert cloud.snr_db[0] == pytest.approx(expected, abs=2.0)


@pytest.mark.parametrize("name", ["position2go", "awr1843"])
@pytest.mark.parametrize("cells", [0.6, -0.9, 1.3, -1.7, 2.4])
def test_what_stands_still_is_taken_out_and_slow_targets_keep_their_velocity(synthesise, name, cells):
    """A person at 1 m/s is 1.3 Doppler cells of a Position2Go from rest, in the notch of what is taken out."""
    radar = Radar.load(name)
    speed, where = cells * radar.velocity_resolution, direction(0.2, 0.0)
    start = where * (5.0 - speed * observation_time(radar))
    wall = ((0.45 * radar.max_range, 0, 0), (0, 0, 0), 10.0)
    cube = synthesise(radar, [(start, speed * where, 1.0), wall], noise=0.01, seed=2)[0]
    cloud = point_cloud(cube, radar, max_points=1)
    assert abs(cloud.velocity[0] - speed) < 0.06 * radar.velocity_resolution
    assert abs(cloud.range[0] - 5.0) < 0.1 * radar.range_resolution


def test_the_world_position_follows_the_pose_of_the_radar(synthesise, mmmesh):
    placed = mmmesh.placed(position=(1.0, -2.0, 1.5), look_at=(1.0, 3.0, 0.5))
    cube = synthesise(placed, [((3, 0.7, 0.3), (0, 0, 0), 1.0)])[0]
    cloud = point_cloud(cube, placed, static=True)
    expected = placed.rotation @ [3, 0.7, 0.3] + np.array([1.0, -2.0, 1.5])
    np.testing.assert_allclose(cloud.position[0], expected, atol=0.02)
    # Looking along +y, left is -x.
    assert cloud.position[0, 0] < 1.0


def test_nothing_there_gives_an_empty_cloud_and_bad_requests_are_named(mmmesh):
    rng = np.random.default_rng(0)
    shape = (128, 3, 4, 256)
    noise = (rng.standard_normal(shape) + 1j * rng.standard_normal(shape)).astype(np.complex64)
    cloud = point_cloud(noise, mmmesh)
    assert len(cloud) <= 1
    assert cloud.position.shape == (len(cloud), 3)
    with pytest.raises(ValueError, match="one frame"):
        point_cloud(noise[None], mmmesh)
    with pytest.raises(ValueError, match="max_points is 0"):
        point_cloud(noise, mmmesh, max_points=0)


def test_shorter_frames_of_measured_data_work(synthesise, mmmesh):
    short = replace(mmmesh, waveform=replace(mmmesh.waveform, num_loops=64, num_samples=200))
    where = direction(-0.4, 0.0) * 3
    cloud = point_cloud(synthesise(short, [(where, (0, 0, 0), 1.0)])[0], short, static=True)
    np.testing.assert_allclose(cloud.device[0], where, atol=0.02)


@pytest.mark.parametrize(("loops", "samples"), [(16, 64), (32, 32), (8, 16), (4, 64), (128, 8)])
def test_small_frames_have_room_for_the_default_window(synthesise, loops, samples):
    """A Position2Go's map has 16 Doppler and 64 range cells; its own preset and smaller ones."""
    radar = Radar.load("position2go")
    radar = replace(radar, waveform=replace(radar.waveform, num_loops=loops, num_samples=samples))
    where = direction(0.2, 0.0) * 0.45 * radar.max_range
    speed = 0.5 * radar.max_velocity
    start = where * (1 - speed * observation_time(radar) / np.linalg.norm(where))
    cube = synthesise(radar, [(start, speed * direction(0.2, 0.0), 1.0)], noise=0.05, seed=1)[0]
    cloud = point_cloud(cube, radar, static=True, max_points=1, false_alarm=1e-3)
    assert len(cloud) == 1
    assert abs(cloud.range[0] - np.linalg.norm(where)) < 0.15 * radar.range_resolution
    assert abs(cloud.velocity[0] - speed) < 0.15 * radar.velocity_resolution
    with pytest.raises(ValueError, match="span"):
        point_cloud(cube, radar, train=(64, 64))


@pytest.mark.parametrize(("uy", "uz", "points"), [(0.6, 0.5, 1), (0.8, 0.8, 0), (-0.9, 0.7, 0)])
def test_phases_of_no_direction_are_no_point(synthesise, uy, uz, points):
    """Phases of two rows and columns of an array can need direction cosines beyond the unit circle."""
    radar = Radar.load("iwr6843isk")
    cube = synthesise(radar, [((3.0, 0, 0), (0, 0, 0), 1e-3)])[0]
    phase = 2 * np.pi / radar.wavelength * radar.virtual_positions @ (0, uy, uz)
    turned = cube * np.exp(-1j * phase)[:, :, None].astype(np.complex64)
    cloud = point_cloud(turned, radar, static=True)
    assert len(cloud) == points
    for name in ("range", "velocity", "azimuth", "elevation", "power", "snr_db", "device", "position"):
        assert len(getattr(cloud, name)) == points
    if points:
        np.testing.assert_allclose(np.abs(cloud.device[0] / cloud.range[0])[1:], (uy, uz), atol=0.05)
