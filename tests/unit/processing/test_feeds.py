"""Elements that a board feeds from the other side: their phases are in the samples and not in the angles."""

from dataclasses import replace

import numpy as np
import pytest

from rfgen_sionna.processing import point_cloud, range_azimuth, select_slot
from rfgen_sionna.radar import Slot

TX_PHASES, RX_PHASES = (0.0, 180.0, 0.0), (0.0, 180.0, 180.0, 0.0)


@pytest.fixture(scope="module")
def turned(mmmesh):
    return replace(mmmesh, tx_phases_deg=TX_PHASES, rx_phases_deg=RX_PHASES)


def test_angles_are_right_with_the_phases_and_wrong_without_them(synthesise, mmmesh, turned):
    where = np.array([3.0, 1.2, 0.4])
    targets = [(where, (0.5, 0, 0), 1.0)]
    cube = synthesise(turned, targets)[0]
    plain = synthesise(mmmesh, targets)[0]
    signs = np.outer([1, -1, 1], [1, -1, -1, 1])
    np.testing.assert_allclose(cube, plain * signs[..., None], atol=1e-5)
    direction = where / np.linalg.norm(where)
    for samples, radar in ((cube, turned), (plain, mmmesh)):
        cloud = point_cloud(samples, radar, static=True)
        np.testing.assert_allclose(cloud.device[0] / cloud.range[0], direction, atol=0.01)
    wrong = point_cloud(cube, mmmesh, static=True)
    assert np.abs(wrong.device[0] / wrong.range[0] - direction).max() > 0.1


def test_beams_have_their_gain_and_place(synthesise, mmmesh, turned):
    targets = [((3.0, 1.2, 0.0), (0, 0, 0), 1.0)]
    expected = range_azimuth(synthesise(mmmesh, targets)[0], mmmesh).power
    np.testing.assert_allclose(range_azimuth(synthesise(turned, targets)[0], turned).power, expected, atol=1e-5)


def test_any_phase_counts_with_the_sign_of_the_wave(synthesise, mmmesh):
    """A wave that is a quarter turn ahead is a quarter turn behind in the mixed samples."""
    ahead = replace(mmmesh, rx_phases_deg=(0.0, 90.0, 0.0, 0.0))
    targets = [((3.0, -0.8, 0.3), (0.2, 0, 0), 1.0)]
    cube, plain = synthesise(ahead, targets)[0], synthesise(mmmesh, targets)[0]
    np.testing.assert_allclose(cube[:, :, 1], plain[:, :, 1] * -1j, atol=1e-5)
    found, expected = point_cloud(cube, ahead, static=True), point_cloud(plain, mmmesh, static=True)
    np.testing.assert_allclose(found.device, expected.device, atol=1e-4)


def test_one_beam_keeps_the_phases_of_the_receivers(turned):
    wave = replace(turned.waveform, tx_order=(), slots=(Slot((0.0, 0.0, 0.0)),))
    radar = replace(turned, waveform=wave)
    _, alone = select_slot(np.zeros(radar.frame_shape, np.complex64), radar, 0)
    assert (alone.tx_phases_deg, alone.rx_phases_deg) == ((), RX_PHASES)
