"""Axes, levels and signs of range and Doppler spectra."""

from dataclasses import replace
from typing import cast

import numpy as np
import pytest

from rfgen_sionna.processing.spectrum import (
    check_cube,
    coupling,
    decibel,
    observation_time,
    range_axis,
    range_doppler,
    range_spectrum,
    remove_static,
    taper,
    velocity_axis,
)
from rfgen_sionna.radar import Radar


def test_axes_are_those_of_the_waveform(mmmesh):
    distance, speed = range_axis(mmmesh), velocity_axis(mmmesh)
    assert distance[0] == 0
    assert distance[1] == pytest.approx(mmmesh.range_resolution)
    assert distance[-1] == pytest.approx(mmmesh.max_range - mmmesh.range_resolution)
    assert speed[0] == pytest.approx(-mmmesh.max_velocity)
    assert np.all(np.diff(speed) > 0)
    assert speed[1] - speed[0] == pytest.approx(mmmesh.velocity_resolution)
    assert speed[64] == 0
    assert range_axis(mmmesh, 512)[-1] == pytest.approx(mmmesh.max_range * 511 / 512)


@pytest.mark.parametrize("window", ["hann", "boxcar", ("kaiser", 8.0), "blackman"])
@pytest.mark.parametrize("length", [31, 64])
def test_a_taper_is_symmetric_and_keeps_a_tones_level(window, length):
    weights = taper(window, length)
    np.testing.assert_allclose(weights, weights[::-1], atol=1e-15)
    assert weights.sum() == pytest.approx(1)
    assert weights.min() > 0


def test_a_receding_target_has_positive_velocity_and_an_approaching_one_negative(synthesise, mmmesh):
    for speed in (1.3, -1.3):
        cube = synthesise(mmmesh, [((3.0, 0, 0), (speed, 0, 0), 1.0)])
        maps = range_doppler(cube[0], mmmesh)
        row, column = np.unravel_index(maps.power.argmax(), maps.power.shape)
        assert abs(maps.velocity[column] - speed) < mmmesh.velocity_resolution
        assert abs(maps.range[row] - 3.0) < 2 * mmmesh.range_resolution


def test_a_bin_shows_the_power_of_a_tone(synthesise, mmmesh):
    on_bin = 70 * mmmesh.range_resolution
    mean = mmmesh.virtual_positions[..., 0].mean()
    cube = synthesise(mmmesh, [((on_bin + mean, 0, 0), (0, 0, 0), 2e-3)])
    power = range_doppler(cube[0], mmmesh).power
    assert 10 * np.log10(power.max() / 4e-6) == pytest.approx(0, abs=0.02)
    profile = range_spectrum(cube[0], mmmesh)
    assert profile.dtype == np.complex64
    assert 20 * np.log10(np.abs(profile[..., 70]).mean() / 2e-3) == pytest.approx(0, abs=0.02)


def test_the_adc_start_does_not_move_the_range(synthesise, mmmesh):
    later = replace(mmmesh, waveform=replace(mmmesh.waveform, adc_start_time=1e-6))
    peaks = []
    for radar in (mmmesh, later):
        cube = synthesise(radar, [((4.321, 0.5, 0), (0, 0, 0), 1.0)])
        peaks.append(range_doppler(cube[0], radar, range_bins=4096).power.max(axis=1).argmax())
    assert peaks[0] == peaks[1]


@pytest.mark.parametrize("speed", [-4.0, 4.0])
def test_coupling_is_the_velocity_times_frequency_over_slope_and_can_be_removed(synthesise, mmmesh, speed):
    start = 4.0 - speed * observation_time(mmmesh)
    cube = synthesise(mmmesh, [((start, 0, 0), (speed, 0, 0), 1.0)])
    found = {}
    for corrected in (False, True):
        maps = range_doppler(cube[0], mmmesh, range_bins=4096, correct_coupling=corrected, correct_migration=True)
        found[corrected] = maps.range[maps.power.max(axis=1).argmax()]
    expected = coupling(mmmesh, speed)
    assert abs(expected) == pytest.approx(4.0 * 79.1e9 / 60.012e12, rel=0.01)
    assert found[False] - found[True] == pytest.approx(expected, abs=0.003)
    assert found[True] == pytest.approx(4.0, abs=0.003)


def test_the_keystone_keeps_the_level_and_width_of_a_fast_target(synthesise, mmmesh):
    speed = -4.0
    cube = synthesise(mmmesh, [((4.0 - speed * observation_time(mmmesh), 0, 0), (speed, 0, 0), 1.0)])
    width, level = {}, {}
    for corrected in (False, True):
        maps = range_doppler(cube[0], mmmesh, range_bins=2048, velocity_bins=1024, correct_migration=corrected)
        column = maps.power[:, maps.power.max(axis=0).argmax()]
        level[corrected] = 10 * np.log10(column.max())
        width[corrected] = np.count_nonzero(column > column.max() / 100)
    assert level[True] == pytest.approx(0, abs=0.1)
    assert level[False] < -0.8
    assert width[True] < width[False]


def test_static_removal_leaves_only_what_moves(synthesise, mmmesh):
    still, mover = ((3.0, 0, 0), (0, 0, 0), 1.0), ((5.0, 0, 0), (1.0, 0, 0), 0.01)
    cube = synthesise(mmmesh, [still, mover], frames=2)
    assert np.abs(remove_static(cube)).max() < 0.03
    strongest = range_doppler(remove_static(cube), mmmesh).power.max(axis=(0, 2)).argmax()
    assert range_axis(mmmesh)[strongest] == pytest.approx(5.0, abs=0.15)
    np.testing.assert_allclose(remove_static(cube[:1], over="run"), remove_static(cube[:1]), atol=1e-6)
    with pytest.raises(ValueError, match="over is 'run' for a cube of shape"):
        remove_static(cube[0], over="run")


def test_bad_cubes_are_named(mmmesh):
    good = np.zeros((2, 3, 4, 8), np.complex64)
    with pytest.raises(ValueError, match=r"2 entries along 'tx'.*has 3"):
        check_cube(good[:, :2], mmmesh)
    with pytest.raises(ValueError, match=r"shape .3, 4, 8."):
        check_cube(good[0], mmmesh)
    with pytest.raises(ValueError, match="NaN or infinite"):
        check_cube(np.where(np.arange(8) == 3, np.nan, good), mmmesh)
    with pytest.raises(ValueError, match="holds float64"):
        check_cube(good.real.astype(float), mmmesh)
    with pytest.raises(ValueError, match="empty"):
        check_cube(good[:0], mmmesh)
    with pytest.raises(ValueError, match="range_bins is 4: a whole number of at least 8"):
        range_doppler(good, mmmesh, range_bins=4)


def test_decibel_of_nothing_is_its_floor():
    np.testing.assert_allclose(decibel([1.0, 100.0, 0.0]), [0.0, 20.0, -400.0])


def test_names_and_records_are_no_arrays() -> None:
    radar, name, record = Radar.load("awr1843"), cast(Radar, "awr1843"), cast(np.ndarray, {})
    with pytest.raises(TypeError, match=r"radar is 'awr1843': a Radar is needed"):
        range_spectrum(np.zeros(radar.frame_shape, np.complex64), name)
    with pytest.raises(TypeError, match=r"cube is a dict: its samples are needed \(cube.data\)"):
        range_spectrum(record, radar)
