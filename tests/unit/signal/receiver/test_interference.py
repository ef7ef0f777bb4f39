"""Chirps of another radar: length, level, place and shape of the bursts."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import signal

from rfgen_sionna.signal import Interferer, Receiver, receive
from rfgen_sionna.signal.receiver.interference import TRANSITION_SHARE

IDEAL = Receiver.ideal()


def crossing(radar, slope, place=(10.0, 0.0, 0.0), at=30e-6):
    """A radar that faces `radar`, in step with it, whose ramps cross its own `at` seconds after their start."""
    own = radar.waveform
    waveform = replace(own, slope=slope, start_frequency=own.start_frequency + (own.slope - slope) * at)
    other = replace(radar, waveform=waveform, name="other", frequency_range=None)
    return other.placed(position=place, look_at=radar.position)


def silent(radar):
    wave = radar.waveform
    return np.zeros((wave.num_loops, len(radar.tx_names), len(radar.rx_names), wave.num_samples), complex)


def seen(radar, interferer, **draws):
    return receive(silent(radar), radar, replace(IDEAL, interferers=(interferer,)), **draws).samples


@pytest.mark.parametrize("difference", [0.3e12, 0.5e12, -0.4e12])
def test_a_burst_lasts_as_long_as_the_band_is_crossed(small, difference):
    """B_if / |mu - mu'| in samples within one, at the level given, about where the beat is in the band's middle."""
    radar = small(loops=1)
    wave = radar.waveform
    band = 0.5 * 0.9 * wave.sample_rate
    other = Interferer(crossing(radar, wave.slope + difference), received_dbm=-50.0, start=0.0, if_band_hz=(0.0, band))
    burst = np.abs(seen(radar, other)[0, 0, 0]) ** 2
    inside = np.flatnonzero(burst > 0.25 * 1e-8)  # -50 dBm is 1e-8 W; the edges of the band are at -6 dB
    assert len(inside) == pytest.approx(band / abs(difference) * wave.sample_rate, abs=2)
    assert np.ptp(inside) == len(inside) - 1
    core = burst[inside[len(inside) // 4 : -len(inside) // 4]]
    assert 10 * np.log10(core.mean() / 1e-8) == pytest.approx(0.0, abs=0.5)  # Fresnel ripple
    middle = wave.sample_times[inside].mean()
    assert middle == pytest.approx(30e-6 - 0.5 * band / difference, abs=1.5 / wave.sample_rate)


@pytest.mark.parametrize("slope", [58e12, 30e12, 61e12, 90e12])
def test_bursts_agree_with_a_chirp_sampled_finely(small, slope):
    """The whole chirp on a grid 512 times finer, through a filter designed there; within 1 % of the peak.

    Faster than B_if^2 a burst is the filter's impulse response, which no formula for its length describes.
    """
    radar = small(loops=1)
    wave = radar.waveform
    other = crossing(radar, slope)
    burst = seen(radar, Interferer(other, received_dbm=-50.0, start=0.0))[0, 0, 0]

    fine = 512
    rate = fine * wave.sample_rate
    count, beta = signal.kaiserord(70.0, 2 * TRANSITION_SHARE / fine)
    count |= 1
    taps = signal.firwin(count, 0.45 * wave.sample_rate, window=("kaiser", beta), fs=rate)
    lead = count // 2
    t = wave.adc_start_time + np.arange(-lead, 256 * fine + lead) / rate
    middle = 0.45 * wave.sample_rate
    start = wave.start_frequency - other.waveform.start_frequency - middle
    beat = start + (wave.slope - slope) * t
    cycles = start * t + 0.5 * (wave.slope - slope) * t**2
    on = (t >= 0) & (t <= wave.ramp_end_time) & (np.abs(beat) < 0.5 * rate)
    truth = signal.oaconvolve(on * np.exp(2j * np.pi * cycles), taps, mode="valid")[: 256 * fine : fine]
    truth = truth * np.exp(2j * np.pi * middle * wave.sample_times) * 1e-4
    phase = np.vdot(truth, burst)
    assert np.abs(burst - truth * phase / abs(phase)).max() < 0.01 * np.abs(truth).max()


def test_the_same_ramp_is_a_ghost_target(small):
    """A radar of the same slope, late by a delay, is a tone at slope times delay: a target that is not there."""
    radar = small(loops=1)
    late = 40e-9
    other = Interferer(crossing(radar, radar.waveform.slope), received_dbm=-50.0, start=late)
    spectrum = np.abs(np.fft.fft(seen(radar, other)[0, 0, 0] * np.hanning(256), 1 << 14))
    peak = np.argmax(spectrum) * radar.waveform.sample_rate / (1 << 14)
    assert peak == pytest.approx(radar.waveform.slope * late, abs=1e3)


def test_the_level_is_that_of_friis(small):
    radar = small()
    other = crossing(radar, 59e12, place=(7.0, 0.0, 0.0))
    expected = 30.0 + 20 * np.log10(other.wavelength / (4 * np.pi * 7.0))  # 30 dBm, isotropic elements
    assert 20 * np.log10(Interferer(other).amplitude(radar)) + 30 == pytest.approx(expected, abs=1e-9)
    directive = replace(other, pattern=type(other.pattern)(9.0, elevation_db=(-20.0, -20.0)))
    assert 20 * np.log10(Interferer(directive).amplitude(radar)) + 30 == pytest.approx(expected + 9 - 20, abs=1e-9)
    # Slanted the same way, two radars that face each other do not hear each other: that is what slants are for.
    slanted = [replace(one, tx_polarization="+45", rx_polarization="+45") for one in (radar, other)]
    assert Interferer(slanted[1]).amplitude(slanted[0]) < 1e-9 * Interferer(other).amplitude(radar)


def test_bursts_come_from_a_direction(small):
    """The phase over the receivers is k times the element's place along the line of sight."""
    radar = small(loops=1)
    for place in ((10.0, 0.0, 0.0), (8.0, 5.0, 0.0), (6.0, -6.0, 1.0)):
        burst = seen(radar, Interferer(crossing(radar, 59.5e12, place), received_dbm=-50.0, start=0.0))
        k = int(np.argmax(np.abs(burst[0, 0, 0])))
        towards = np.array(place) / np.linalg.norm(place)
        turn = np.angle(burst[0, 0, :, k] / burst[0, 0, 0, k])
        # As for a target: an element further towards it has less delay, and the beat's phase grows with delay.
        expected = -2 * np.pi / radar.wavelength * (radar.rx_positions - radar.rx_positions[0]) @ towards
        np.testing.assert_allclose(np.exp(1j * turn), np.exp(1j * expected), atol=1e-6)


def test_clocks_run_on_from_frame_to_frame(small):
    """A radar with a frame period of its own hits other chirps in other frames, and its start is drawn once."""
    radar = small(loops=16)
    wave = radar.waveform
    other = crossing(radar, 50e12)
    # Ramps every 83 us among own ones every 72 us: a burst in some chirps, none in others.
    other = replace(other, waveform=replace(other.waveform, idle_time=18e-6, num_loops=100, frame_period=0.031))
    one = Interferer(other, received_dbm=-50.0)
    energy = [np.sum(np.abs(seen(radar, one, seed=3, frame=frame)[:, :, 0]) ** 2, axis=-1) for frame in range(3)]
    hit = [frame > 1e-12 for frame in energy]
    assert 0 < np.mean(hit) < 1
    assert any((hit[0] != later).any() for later in hit[1:])
    again = np.sum(np.abs(seen(radar, one, seed=3, frame=1)[:, :, 0]) ** 2, axis=-1)
    np.testing.assert_array_equal(again, energy[1])
    assert (np.sum(np.abs(seen(radar, one, seed=4)[:, :, 0]) ** 2, axis=-1) != energy[0]).any()
    # The same instants: 100 frames of 31 ms are 31 own frames of 100 ms.
    assert wave.frame_period == 0.1
    fixed = Interferer(other, received_dbm=-50.0, start=0.004)
    level = [np.abs(seen(radar, fixed, frame=frame)) for frame in (0, 31)]
    np.testing.assert_allclose(level[0], level[1], atol=1e-6 * level[0].max())


def test_two_interferers_add(small):
    radar = small(loops=2)
    both = (
        Interferer(crossing(radar, 59e12), received_dbm=-50.0, start=0.0),
        Interferer(crossing(radar, 61e12, at=45e-6), received_dbm=-60.0, start=0.0),
    )
    out = receive(silent(radar), radar, replace(IDEAL, interferers=both), seed=2).samples
    parts = sum(one.samples(radar, seed=2, frame=0, index=index) for index, one in enumerate(both))
    np.testing.assert_array_equal(out, parts)


def test_what_cannot_be_is_refused(small):
    radar = small()
    other = crossing(radar, 59e12)
    with pytest.raises(TypeError, match=r"interferer.radar is a str"):
        Interferer("awr1843")
    with pytest.raises(ValueError, match=r"interferer.received_dbm is 100"):
        Interferer(other, received_dbm=100)
    with pytest.raises(ValueError, match=r"interferer.start is inf"):
        Interferer(other, start=float("inf"))
    with pytest.raises(ValueError, match=r"interferer.if_band_hz is .*lower one first"):
        Interferer(other, if_band_hz=(2e6, 1e6))
    with pytest.raises(ValueError, match=r"if_band_hz.*at most 3.96e\+06 Hz"):
        Interferer(other, if_band_hz=(0, 5e6)).check(radar)
    with pytest.raises(ValueError, match=r"the position of the radar"):
        Receiver(interferers=(Interferer(radar),)).check(radar)


def test_feeds_of_the_receivers_turn_the_bursts(small):
    radar = small(loops=1)
    other = Interferer(crossing(radar, radar.waveform.slope - 0.5e12), received_dbm=-50.0, start=0.0)
    plain = seen(radar, other)
    turned = seen(replace(radar, rx_phases_deg=(0, 180, 0, 90)), other)
    np.testing.assert_allclose(turned, plain * np.array([1, -1, 1, -1j])[:, None], atol=1e-12 * np.abs(plain).max())
