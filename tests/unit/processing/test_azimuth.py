"""Range-azimuth maps and DRAI show targets at their place."""

import numpy as np
import pytest

from rfgen_sionna.processing.azimuth import drai, range_azimuth, row_weights


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
