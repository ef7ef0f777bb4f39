"""Directions of arrival on the true element positions, with the slots of TDM."""

import numpy as np
import pytest

from rfgen_sionna.processing.angle import compensate_tdm, find_directions, steering, unit_vectors
from rfgen_sionna.processing.spectrum import range_doppler
from rfgen_sionna.radar import Radar


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


def test_bad_requests_are_named(mmmesh):
    with pytest.raises(ValueError, match=r"channels have shape \(1, 2, 4\)"):
        find_directions(np.zeros((1, 2, 4), complex), mmmesh, 0.0)
    with pytest.raises(ValueError, match="ambiguities is -1"):
        find_directions(np.zeros((1, 3, 4), complex), mmmesh, 0.0, ambiguities=-1)


@pytest.mark.parametrize(("name", "field"), [("position2go", 84), ("position2go_v11", 52)])
def test_two_elements_far_to_the_side(name: str, field: int) -> None:
    """A grating lobe just outside of the half sphere, or as good as the true peak, does not take its place.

    7.75 mm apart two receivers cannot tell a sine from one that is a wavelength / 7.75 mm = 1.6 away: the answer is the
    one nearer to boresight, so that up to asin(0.8) = 53 degrees it is right.
    """
    radar = Radar.load(name)
    azimuth = np.radians(np.linspace(-field, field, 2 * field + 1))
    rng = np.random.default_rng(3)
    channels = steering(radar, unit_vectors(azimuth, 0.0))
    channels = channels + 1e-3 * (rng.normal(size=channels.shape) + 1j * rng.normal(size=channels.shape))
    found = find_directions(channels, radar, 0.0)
    np.testing.assert_allclose(np.sin(found.azimuth), np.sin(azimuth), atol=0.01)
