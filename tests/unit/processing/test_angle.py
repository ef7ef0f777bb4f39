"""Directions of arrival on the true element positions, with the slots of TDM."""

import numpy as np
import pytest

from rfgen_sionna.processing.angle import (
    compensate_tdm,
    drai,
    find_directions,
    range_azimuth,
    row_weights,
    steering,
    unit_vectors,
)
from rfgen_sionna.processing.spectrum import range_doppler


def channels_of(cube, radar, padding=2):
    maps = range_doppler(cube, radar, velocity_bins=padding * cube.shape[0], range_bins=padding * cube.shape[-1])
    row, column = np.unravel_index(maps.power.argmax(), maps.power.shape)
    return maps.spectrum[column, :, :, row][None], maps.velocity[column]


@pytest.mark.parametrize("azimuth", [-60, -20, 0, 35, 65])
@pytest.mark.parametrize("elevation", [-30, 0, 20])
def test_steering_and_search_are_inverse(mmmesh, azimuth, elevation):
    az, el = np.radians([azimuth, elevation])
    channels = steering(mmmesh, unit_vectors([az], [el]))
    found = find_directions(channels, mmmesh, 0.0)
    assert found.azimuth[0] == pytest.approx(az, abs=2e-3)
    assert found.elevation[0] == pytest.approx(el, abs=2e-3)
    assert found.power[0] == pytest.approx(1, abs=1e-4)


def test_a_plane_wave_is_the_far_limit_of_the_sphere(mmmesh):
    direction = unit_vectors([0.5, -0.9], [0.2, -0.3])
    far = steering(mmmesh, direction, np.array([1e4, 1e4]))
    np.testing.assert_allclose(far, steering(mmmesh, direction), atol=1e-3)
    near = steering(mmmesh, direction, np.array([0.2, 0.2]))
    assert np.abs(np.angle(near * steering(mmmesh, direction).conj())).max() > 0.2


def test_left_is_positive_azimuth_and_up_positive_elevation(synthesise, mmmesh):
    left, _ = channels_of(synthesise(mmmesh, [((3, 1, 0), (0, 0, 0), 1)])[0], mmmesh)
    right, _ = channels_of(synthesise(mmmesh, [((3, -1, 0), (0, 0, 0), 1)])[0], mmmesh)
    above, _ = channels_of(synthesise(mmmesh, [((3, 0, 0.8), (0, 0, 0), 1)])[0], mmmesh)
    found = find_directions(np.concatenate([left, right, above]), mmmesh, 0.0, distance=3.0)
    np.testing.assert_allclose(found.azimuth, [np.arctan2(1, 3), -np.arctan2(1, 3), 0], atol=5e-3)
    np.testing.assert_allclose(found.elevation, [0, 0, np.arctan2(0.8, 3)], atol=5e-3)


def test_motion_looks_like_angle_until_the_slots_are_compensated(synthesise, mmmesh):
    cube = synthesise(mmmesh, [((3, 0, 0), (2.0, 0, 0), 1)])[0]
    channels, velocity = channels_of(cube, mmmesh)
    assert abs(find_directions(channels, mmmesh, velocity).azimuth[0]) < np.radians(0.5)
    wrong = find_directions(channels, mmmesh, 0.0)
    assert np.hypot(wrong.azimuth[0], wrong.elevation[0]) > np.radians(5)
    # Compensation turns the Tx elements only, and the first slot not at all.
    turned = compensate_tdm(channels, mmmesh, np.array([velocity]))
    np.testing.assert_allclose(np.abs(turned), np.abs(channels), rtol=1e-5)
    np.testing.assert_allclose(turned[:, mmmesh.waveform.tx_order[0]], channels[:, mmmesh.waveform.tx_order[0]])


@pytest.mark.parametrize("speed", [-7.0, -5.5, 5.5, 7.0])
def test_the_array_resolves_the_doppler_ambiguity(synthesise, mmmesh, speed):
    cube = synthesise(mmmesh, [((3, 0.6, 0.1), (speed, 0, 0), 1)])[0]
    channels, folded = channels_of(cube, mmmesh)
    radial = speed * 3 / np.linalg.norm((3, 0.6, 0.1))
    assert abs(folded - radial) > mmmesh.max_velocity
    found = find_directions(channels, mmmesh, folded, ambiguities=1)
    assert found.velocity[0] == pytest.approx(radial, abs=mmmesh.velocity_resolution)
    assert found.azimuth[0] == pytest.approx(np.arctan2(0.6, 3), abs=0.02)


def test_a_single_row_has_no_elevation(synthesise, di_gesture):
    cube = synthesise(di_gesture, [((1, -0.4, 0), (0.5, 0, 0), 1)])[0]
    channels, velocity = channels_of(cube, di_gesture)
    found = find_directions(channels, di_gesture, velocity, distance=np.hypot(1, 0.4))
    assert found.elevation[0] == 0
    assert found.azimuth[0] == pytest.approx(np.arctan2(-0.4, 1), abs=0.01)


def test_azimuth_weights_take_the_longest_row_only(mmmesh):
    for window in ("none", "hamming"):
        weights = row_weights(mmmesh, window)
        assert weights.sum() == pytest.approx(1)
        assert np.count_nonzero(weights) == 8
        assert np.all(weights[1] == 0), "TX2 is raised"
    with pytest.raises(ValueError, match="window is 'hann'; allowed: 'none', 'hamming'"):
        row_weights(mmmesh, "hann")


@pytest.mark.parametrize("azimuth_deg", [-40, 0, 25])
@pytest.mark.parametrize("speed", [0.0, -1.5, 3.0])
def test_a_range_azimuth_map_peaks_at_the_target_with_its_power(synthesise, mmmesh, azimuth_deg, speed):
    az = np.radians(azimuth_deg)
    direction = np.array([np.cos(az), np.sin(az), 0])
    start = (100 * mmmesh.range_resolution - 0.0138 * speed) * direction
    cube = synthesise(mmmesh, [(start, speed * direction, 0.5)])[0]
    found = range_azimuth(cube, mmmesh, azimuth=np.radians(np.arange(-80, 81)), max_range=6.0)
    row, column = np.unravel_index(found.power.argmax(), found.power.shape)
    assert found.range[-1] <= 6.0
    assert found.power.shape == (len(found.range), 161)
    assert abs(np.degrees(found.azimuth[column]) - azimuth_deg) <= 1
    assert abs(found.range[row] - 100 * mmmesh.range_resolution) < mmmesh.range_resolution
    # 3 m/s cross two cells in a frame.
    assert 10 * np.log10(found.power.max() / 0.25) == pytest.approx(0, abs=0.3 if speed < 2 else 1.0)


def test_drai_shows_the_hand_and_not_the_wall(synthesise, di_gesture):
    hand, wall = ((0.6, 0.3, 0), (0.3, 0, 0), 0.01), ((1.2, -0.5, 0), (0, 0, 0), 1.0)
    images = drai(synthesise(di_gesture, [hand, wall], frames=3), di_gesture)
    assert images.image.shape == (3, 32, 32)
    assert images.image.dtype == np.float32
    for image in images.image:
        row, column = np.unravel_index(image.argmax(), image.shape)
        assert images.range[row] == pytest.approx(np.hypot(0.6, 0.3), abs=0.06)
        assert np.sin(images.angle[column]) == pytest.approx(0.3 / np.hypot(0.6, 0.3), abs=0.05)
    with pytest.raises(ValueError, match="range_bins is 200"):
        drai(np.zeros((1, 2, 2, 4, 128), np.complex64), di_gesture, range_bins=200)


def test_bad_requests_are_named(mmmesh):
    with pytest.raises(ValueError, match=r"channels have shape \(1, 2, 4\)"):
        find_directions(np.zeros((1, 2, 4), complex), mmmesh, 0.0)
    with pytest.raises(ValueError, match="ambiguities is -1"):
        find_directions(np.zeros((1, 3, 4), complex), mmmesh, 0.0, ambiguities=-1)
