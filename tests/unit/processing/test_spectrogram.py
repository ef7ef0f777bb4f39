"""Pictures against time keep to the instants at which the radar looked."""

from dataclasses import replace

import numpy as np
import pytest

from rfgen_sionna.processing.spectrogram import doppler_time, micro_doppler, range_time
from rfgen_sionna.radar import Radar


@pytest.fixture(scope="module")
def quick():
    """mmMesh with fewer loops and samples: the tests here look at time, not at resolution."""
    radar = Radar.load("awr1843", preset="mmmesh")
    return replace(radar, waveform=replace(radar.waveform, num_loops=64, num_samples=64))


def test_range_time_follows_a_walker(synthesise, quick):
    cube = synthesise(quick, [((4.0, 0, 0), (-1.2, 0, 0), 1.0), ((6.0, 0, 0), (0, 0, 0), 30.0)], frames=6)
    seen = range_time(cube, quick)
    assert seen.power.shape == (6, 64)
    expected = 4.0 - 1.2 * seen.time
    assert np.abs(seen.range[seen.power.argmax(axis=1)] - expected).max() < quick.range_resolution
    still = range_time(cube, quick, static=True)
    assert np.abs(still.range[still.power.argmax(axis=1)] - 6.0).max() < quick.range_resolution


def test_a_frames_doppler_spectrum_has_the_velocity_and_power_of_the_target(synthesise, quick):
    cube = synthesise(quick, [((4.0, 0, 0), (1.2, 0, 0), 0.1)], frames=3)
    seen = doppler_time(cube, quick, range_limits=(3.0, 5.0))
    assert np.abs(seen.velocity[seen.power.argmax(axis=1)] - 1.2).max() < quick.velocity_resolution
    assert np.all(doppler_time(cube, quick, range_limits=(7.0, 9.0)).power.max(axis=1) < 1e-3 * seen.power.max(axis=1))
    np.testing.assert_allclose(np.diff(seen.time), quick.waveform.frame_period)
    assert seen.duration == pytest.approx(64 * 216e-6)


def test_windows_do_not_reach_over_the_pause_between_frames(synthesise, quick):
    cube = synthesise(quick, [((4.0, 0, 0), (1.2, 0, 0), 0.1)], frames=3)
    seen = micro_doppler(cube, quick, segment=32, hop=8, static=True)
    length = quick.waveform.frame_length
    phase = np.mod(seen.time, quick.waveform.frame_period)
    loop = quick.waveform.loop_period
    assert np.all(phase > seen.duration / 2 - loop)
    assert np.all(phase < length - seen.duration / 2)
    assert len(seen.time) == 3 * 5
    peak = seen.velocity[seen.power.argmax(axis=1)]
    assert np.abs(peak - 1.2).max() < 4 * quick.velocity_resolution


def test_each_window_shows_the_velocity_at_its_own_time(synthesise, quick):
    """An accelerating target, frames without pauses: one stretch, windows over the frame boundaries."""
    wave = replace(quick.waveform, frame_period=quick.waveform.frame_length)
    radar = replace(quick, waveform=wave)
    loops = np.arange(4 * 64)
    slot, fast = wave.chirp_times[0], wave.sample_times
    t = (loops[:, None] * wave.loop_period + slot)[..., None] + fast
    tau = 2 * (3.0 + 0.5 * 30.0 * t**2) / 299_792_458.0
    turns = wave.start_frequency * tau + wave.slope * fast * tau - 0.5 * wave.slope * tau**2
    cube = np.exp(2j * np.pi * (turns % 1))[:, :, None, :].repeat(4, axis=2).reshape(4, 64, 3, 4, -1)
    seen = micro_doppler(cube, radar, segment=32, hop=16, bins=1024, static=True)
    assert len(seen.time) == (256 - 32) // 16 + 1
    peak = seen.velocity[seen.power.argmax(axis=1)]
    np.testing.assert_allclose(peak, 30.0 * seen.time, atol=0.01)


def test_bad_requests_are_named(quick):
    cube = np.zeros((2, 64, 3, 4, 64), np.complex64)
    with pytest.raises(ValueError, match="segment is 65 loops; 2 … 64 is allowed"):
        micro_doppler(cube, quick, segment=65)
    with pytest.raises(ValueError, match="hop is 0"):
        micro_doppler(cube, quick, segment=32, hop=0)
    with pytest.raises(ValueError, match="frame_times has shape"):
        doppler_time(cube, quick, frame_times=[0.1, 0.0])
    with pytest.raises(ValueError, match="range_limits"):
        doppler_time(cube, quick, range_limits=(3.0, 3.0))
    with pytest.raises(ValueError, match="frame, chirp, tx, rx, sample"):
        range_time(cube[0], quick)
