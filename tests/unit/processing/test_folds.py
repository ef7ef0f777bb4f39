"""Speeds at the end of the Doppler axis and beyond it: what tells them, and what nothing tells."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rfgen_sionna._types import SPEED_OF_LIGHT
from rfgen_sionna.processing import point_cloud, range_doppler, velocity_axis
from rfgen_sionna.processing.peak_focusing import at_velocity
from rfgen_sionna.processing.spectrum import observation_time
from rfgen_sionna.radar import ElementPattern, Radar
from rfgen_sionna.records import PathKind, RadarPaths
from rfgen_sionna.signal import synthesize

AZIMUTH = -0.3


def radar_of(preset, **overrides):
    changes = {f"preset.{preset}.{key}": value for key, value in overrides.items()}
    return replace(Radar.load("awr1843", preset, overrides=changes), pattern=ElementPattern(0.0))


def frame(radar, *targets):
    """(chirp, tx, rx, sample) of points: range [m] and velocity [m/s] in the frame's middle, azimuth [rad]."""
    times = np.linspace(0.0, radar.waveform.frame_length, 17)
    cubes = []
    for distance, velocity, azimuth in targets:
        towards = np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
        place = towards * (distance + velocity * (times - observation_time(radar)))[:, None]
        out, back = (
            np.linalg.norm(place - ends[:, None], axis=-1) for ends in (radar.tx_positions, radar.rx_positions)
        )
        tau = (out[:, None] + back[None])[:, :, None] / SPEED_OF_LIGHT
        direction = np.broadcast_to(towards, (1, len(times), 3))
        index = np.zeros(1, np.int32)
        paths = RadarPaths(
            a=np.full(tau.shape, 1e-6, complex), tau=tau, tau_rate=np.gradient(tau, times, axis=-1), times=times,
            frequency=radar.center_frequency, direction=direction, arrival=direction, object_id=index, part_id=index,
            kind=np.full(1, PathKind.SPECULAR, np.uint8), bounces=np.ones(1, np.uint8), object_names=("point",),
            part_names=("point",), facet=index,
        )  # fmt: skip
        cubes.append(synthesize(radar, paths, 0.0))
    return np.sum(cubes, axis=0)


def check(found, radar, distance, velocity, azimuth=AZIMUTH):
    assert len(found) >= 1
    assert abs(found.range[0] - distance) < 0.05 * radar.range_resolution
    assert abs(found.velocity[0] - velocity) < 0.05 * radar.velocity_resolution
    assert abs(found.azimuth[0] - azimuth) < 0.005


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("short", [2.0, 1.0, 0.5, 0.2, 0.0, -0.4])
@pytest.mark.parametrize("preset", ["mmmesh", "bpm", "ddm"])
def test_within_a_cell_of_the_end_of_the_axis(preset, short, sign):
    """The peak's other half is at the other end of the axis, where migration is corrected the other way."""
    radar = radar_of(preset, num_loops=64 if preset != "ddm" else 128)
    velocity = sign * (radar.max_velocity - short * radar.velocity_resolution)
    cube = frame(radar, (5.5, velocity, AZIMUTH))
    check(point_cloud(cube, radar, max_points=1, static=True), radar, 5.5, velocity)


@pytest.mark.parametrize("velocity", [-12.9, -9.0, -4.0, 3.4, 6.58, 8.0, 12.5])
def test_an_empty_doppler_band_tells_the_fold(velocity):
    """Bands are 6.6 m/s wide, a quarter of what one Tx alone could tell; in noise, at rest and with height."""
    radar = radar_of("ddm", num_loops=128)
    assert abs(velocity) > radar.max_velocity
    rng = np.random.default_rng(3)
    cube = frame(radar, (5.5, velocity, AZIMUTH))
    level = 0.5 * np.abs(cube).max()
    cube = cube + level * (rng.standard_normal(cube.shape) + 1j * rng.standard_normal(cube.shape))
    found = point_cloud(cube, radar, max_points=1, static=True)
    assert abs(found.range[0] - 5.5) < 0.1 * radar.range_resolution
    assert abs(found.velocity[0] - velocity) < 0.1 * radar.velocity_resolution
    assert abs(found.azimuth[0] - AZIMUTH) < 0.03


def test_several_targets_each_have_their_fold():
    radar = radar_of("ddm", num_loops=128)
    targets = [(3.0, 0.0, 0.1), (4.5, 1.0, 0.2), (6.0, 7.0, -0.3), (8.0, -11.0, 0.1)]
    found = point_cloud(frame(radar, *targets), radar, static=True, dynamic_range_db=15)
    order = np.argsort(found.range)
    assert len(order) == len(targets)
    np.testing.assert_allclose(found.range[order], [range_ for range_, _, _ in targets], atol=0.005)
    np.testing.assert_allclose(found.velocity[order], [velocity for _, velocity, _ in targets], atol=0.005)
    np.testing.assert_allclose(found.azimuth[order], [azimuth for _, _, azimuth in targets], atol=0.01)


def test_full_doppler_bands_tell_no_fold_by_themselves():
    """Three Tx in three bands: a fast target is a band off, unless the array is asked."""
    radar = radar_of("ddm", num_loops=96, doppler_bands=3)
    velocity = radar.max_velocity + 2.0
    cube = frame(radar, (5.5, velocity, AZIMUTH))
    folded = point_cloud(cube, radar, max_points=1, static=True)
    assert folded.velocity[0] == pytest.approx(velocity - 2 * radar.max_velocity, abs=radar.velocity_resolution)
    check(point_cloud(cube, radar, max_points=1, static=True, ambiguities=1), radar, 5.5, velocity)


def test_two_targets_whole_bands_apart_at_one_range_are_one():
    """What is documented as not resolved: both lie in the same bins of all three elements."""
    radar = radar_of("ddm", num_loops=128)
    slow, fast = (5.5, 1.0, 0.1), (5.5, 1.0 + 2 * radar.max_velocity, 0.1)
    found = point_cloud(frame(radar, slow, fast), radar, static=True, dynamic_range_db=10)
    assert len(found) == 1


@pytest.mark.parametrize("preset", ["mmmesh", "bpm"])
@pytest.mark.parametrize("share", [-1.7, 1.3])
def test_unfolded_targets_are_as_sharp_as_slow_ones(preset, share):
    radar = radar_of(preset, num_loops=64)
    velocity = share * radar.max_velocity
    cube = frame(radar, (5.5, velocity, AZIMUTH))
    check(point_cloud(cube, radar, max_points=1, static=True, ambiguities=1), radar, 5.5, velocity)
    # Without that it is 2 max_velocity slower, and off by the difference in range-Doppler coupling, as documented.
    # To the side its phases may be of no direction, which is no point.
    folded = point_cloud(frame(radar, (5.5, velocity, 0.0)), radar, max_points=1, static=True)
    turn = 2 * np.sign(velocity) * radar.max_velocity
    assert folded.velocity[0] == pytest.approx(velocity - turn, abs=radar.velocity_resolution)
    off = turn * radar.center_frequency / radar.waveform.slope
    assert folded.range[0] - 5.5 == pytest.approx(off, abs=0.2 * radar.range_resolution)


def test_the_transform_at_one_speed_is_a_bin_of_the_map():
    radar = radar_of("mmmesh", num_loops=16)
    cube = frame(radar, (3.0, 1.0, AZIMUTH))
    maps = range_doppler(
        cube, radar, velocity_window="boxcar", range_window="boxcar", correct_migration=True, velocity_bins=32
    )
    axis = velocity_axis(radar, 32)
    for place in (0, 11, 31):
        one = at_velocity(cube / (16 * 256), radar, float(axis[place]), 256)
        np.testing.assert_allclose(one, maps.spectrum[place], atol=1e-9 * np.abs(maps.spectrum).max())
