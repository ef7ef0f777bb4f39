"""The quick maps are those of `range_doppler`, which is the reference."""

from dataclasses import replace

import numpy as np
import pytest

from rfgen_sionna.processing import range_doppler, range_doppler_power
from rfgen_sionna.radar import Radar


def _words(radar, frames, seed=0):
    rng = np.random.default_rng(seed)
    axes = (*radar.frame_shape,) if radar.adc.real else (*radar.frame_shape, 2)
    return rng.integers(-300, 300, (*frames, *axes), dtype=np.int16)


def _samples(words, radar, scale):
    values = words.astype(np.float32) * np.float32(scale)
    return values if radar.adc.real else (values[..., 0] + 1j * values[..., 1]).astype(np.complex64)


@pytest.mark.parametrize("static", [True, False])
@pytest.mark.parametrize(
    ("name", "preset"),
    [("awr1843", "mmmesh"), ("bgt60tr13c", None), ("awr2944evm", None), ("position2go", None), ("iwr6843isk", None)],
)
def test_maps_are_those_of_range_doppler(name, preset, static):
    radar = Radar.load(name, preset=preset)
    scale, words = 3e-7, _words(radar, (2,))
    samples = _samples(words, radar, scale)
    expected = range_doppler(samples, radar, static=static).power
    for given, options in ((words, {"scale": scale}), (samples, {})):
        found = range_doppler_power(given, radar, static=static, **options)
        assert found.dtype == np.float32
        np.testing.assert_allclose(found, expected, rtol=1e-4, atol=1e-6 * expected.max())


def test_a_falling_ramp_and_a_single_frame():
    rising = Radar.load("awr1843", preset="mmmesh")
    falling = replace(rising.waveform, start_frequency=80.9e9, slope=-rising.waveform.slope, num_loops=8)
    radar = replace(rising, waveform=falling)
    samples = _samples(_words(radar, ()), radar, 1.0)
    expected = range_doppler(samples, radar).power
    np.testing.assert_allclose(range_doppler_power(samples, radar), expected, rtol=1e-4, atol=1e-6 * expected.max())


def test_what_is_given_stays_as_it_is():
    radar = Radar.load("awr1843", preset="mmmesh")
    small = replace(radar, waveform=replace(radar.waveform, num_loops=4, num_samples=16))
    samples = _samples(_words(small, ()), small, 1.0)
    before = samples.copy()
    range_doppler_power(samples, small, static=False)
    np.testing.assert_array_equal(samples, before)


def test_refused():
    radar = Radar.load("awr1843", preset="mmmesh")
    words = np.zeros((128, 3, 4, 256, 2), np.int16)
    with pytest.raises(ValueError, match="scale"):
        range_doppler_power(words, radar)
    with pytest.raises(ValueError, match="last axis of 2"):
        range_doppler_power(words[..., 0], radar, scale=1.0)
    with pytest.raises(ValueError, match="along 'rx'"):
        range_doppler_power(words[:, :, :2], radar, scale=1.0)
    with pytest.raises(ValueError, match="NaN"):
        range_doppler_power(np.full((128, 3, 4, 256), np.nan, np.complex64), radar)
