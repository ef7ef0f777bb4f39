"""Records that pass from stage to stage."""

from dataclasses import replace

import numpy as np
import pytest

from rfgen_sionna.radar import Adc, Radar
from rfgen_sionna.records import AdcCube


def numbered(radar):
    """A cube whose samples are the number of their entry along "tx"."""
    shape = (2, *radar.frame_shape)
    data = np.broadcast_to(np.arange(shape[2])[:, None, None], shape).astype(radar.sample_type)
    return AdcCube(data, radar, np.array([0.0, radar.waveform.frame_period]))


@pytest.mark.parametrize("real", [False, True])
def test_firing_order_is_that_of_the_slots_not_of_the_names(real):
    """mmMesh fires TX1, TX3, TX2; a cube has TX1, TX2, TX3."""
    radar = replace(Radar.load("awr1843", "mmmesh"), adc=Adc(real=real))
    samples, names = numbered(radar).in_firing_order()
    assert radar.axis_names == ("TX1", "TX2", "TX3")
    assert names == ("TX1", "TX3", "TX2")
    assert samples.shape == (2, *radar.frame_shape)
    assert samples.dtype == (np.float32 if real else np.complex64)
    np.testing.assert_array_equal(samples[1, 3, :, 2, 7], [0, 2, 1])
    times = radar.waveform.chirp_times[0][[0, 2, 1]]
    assert np.all(np.diff(times) > 0)


@pytest.mark.parametrize("preset", ["di_gesture", "bpm", "near_far"])
def test_slots_and_ascending_orders_stay(preset):
    cube = numbered(Radar.load("awr1843", preset))
    samples, names = cube.in_firing_order()
    assert samples is cube.data
    assert names == cube.radar.axis_names
