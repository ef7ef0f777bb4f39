"""What the axis "tx" of a cube holds: lengths that are taken, and what cannot be told apart."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rfgen_sionna.processing import (
    demultiplex,
    find_directions,
    point_cloud,
    range_doppler,
    range_time,
    select_profile,
    select_slot,
    velocity_axis,
)
from rfgen_sionna.processing.multiplexing import separate_bands
from rfgen_sionna.radar import Radar, Slot


def noise(radar, entries=None):
    """(chirp, tx, rx, sample)"""
    loops, own, receivers, samples = radar.frame_shape
    rng = np.random.default_rng(0)
    shape = (loops, own if entries is None else entries, receivers, samples)
    return rng.standard_normal(shape) + 1j * rng.standard_normal(shape)


@pytest.fixture(scope="module")
def ddm():
    radar = Radar.load("awr1843", "ddm")
    return replace(radar, waveform=replace(radar.waveform, num_loops=32, num_samples=32))


@pytest.fixture(scope="module")
def beams():
    """Two slots, a beam each."""
    radar = Radar.load("awr1843", "mmmesh")
    slots = (Slot((0.0, None, 0.0)), Slot((0.0, 0.0, 180.0)))
    return replace(radar, waveform=replace(radar.waveform, tx_order=(), slots=slots, num_loops=8, num_samples=32))


def test_doppler_bands_split_the_velocities(ddm):
    """A tone at a Doppler bin appears once, in the element whose band it is in."""
    axis = velocity_axis(ddm)
    assert len(axis) == 32 / 4
    assert np.abs(axis).max() <= ddm.max_velocity * (1 + 1e-9)
    whole = 32 * ddm.waveform.loop_period
    for element, turns in enumerate((0.0, -0.25, -0.5)):  # what is radiated ahead is received behind
        frequency = turns / ddm.waveform.loop_period + 2 / whole
        tone = np.exp(2j * np.pi * frequency * np.arange(32) * ddm.waveform.loop_period)
        cube = np.broadcast_to(tone[:, None, None, None], ddm.frame_shape).astype(complex)
        maps = range_doppler(cube, ddm, velocity_window="boxcar", range_window="boxcar")
        level = np.abs(maps.spectrum[:, :, 0, 0])
        assert level.shape == (8, 3)
        expected = np.zeros((8, 3))
        expected[np.argmin(np.abs(axis - axis[4] - 2 / whole * ddm.wavelength / 2)), element] = 1.0
        np.testing.assert_allclose(level, expected, atol=1e-9)


def test_bands_may_be_separated_before(ddm):
    cube = noise(ddm)
    apart = separate_bands(cube, ddm)
    assert apart.shape == (32, 3, 4, 32)
    assert separate_bands(apart, ddm) is apart
    np.testing.assert_allclose(range_doppler(apart, ddm).spectrum, range_doppler(cube, ddm).spectrum)
    with pytest.raises(ValueError, match="2 entries along 'tx'"):
        range_doppler(noise(ddm, 2), ddm)


def test_static_echoes_of_every_element_are_taken_out(ddm):
    """At rest an echo is a tone in each band: the mean over the chirps would leave all but one."""
    weights = np.conj(ddm.waveform.axis_weights[:, 0]).sum(axis=1)
    cube = np.broadcast_to(weights[:, None, None, None], ddm.frame_shape)
    left = np.abs(range_doppler(cube, ddm, static=False, velocity_window="blackman").spectrum)
    assert left.max() < 1e-3
    still = range_time(cube[None], ddm, static=True).power.max()
    assert range_time(cube[None], ddm).power.max() < 1e-5 * still


def test_range_profiles_have_the_power_of_each_elements_echo(ddm):
    """Three elements with echoes of amplitude 1, moving: the mean over elements of the power is 1, as for TDM."""
    chirps = np.arange(32)
    doppler = np.exp(2j * np.pi * 2 / 32 * chirps)
    cube = (np.conj(ddm.waveform.axis_weights[:, 0]).sum(axis=1) * doppler)[:, None, None, None]
    cube = np.broadcast_to(cube * np.exp(2j * np.pi * 5 / 32 * np.arange(32)), ddm.frame_shape)
    assert range_time(cube[None], ddm, window="boxcar").power[0, 5] == pytest.approx(1.0, rel=0.05)


def test_beams_are_looked_at_one_by_one(beams):
    cube = noise(beams)
    for attempt in (
        lambda: demultiplex(cube, beams),
        lambda: point_cloud(cube, beams),
        lambda: find_directions(cube[:, :, :, 0], beams, np.zeros(8)),
    ):
        with pytest.raises(ValueError, match=r"a beam of TX1, TX2, TX3.*select_slot"):
            attempt()
    samples, radar = select_slot(cube, beams, 1)
    assert samples.shape == radar.frame_shape
    np.testing.assert_array_equal(samples[:, 0], cube[:, 1])
    assert radar.tx_names == ("TX1+TX2-TX3",)
    np.testing.assert_allclose(radar.waveform.chirp_times[:, 0], beams.waveform.chirp_times[:, 1], rtol=1e-12)
    np.testing.assert_allclose(radar.tx_positions[0], beams.tx_positions.mean(axis=0))
    with pytest.raises(ValueError, match=r"slot is 2: a whole number in 0 … 1"):
        select_slot(cube, beams, 2)
    with pytest.raises(ValueError, match="multiplexed as 'tdm'"):
        select_slot(noise(Radar.load("awr1843")), Radar.load("awr1843"), 0)


def test_one_at_a_time_needs_no_demultiplexing():
    radar = Radar.load("awr1843", "di_gesture")
    cube = noise(radar)
    same, again = demultiplex(cube, radar)
    assert same is cube
    assert again is radar


def test_profiles_go_in_one_by_one():
    radar = Radar.load("awr1843", "near_far")
    cube = noise(radar)
    with pytest.raises(ValueError, match=r"has 2 profiles: take the chirps of one, processing\.select_profile"):
        range_time(cube[None], radar)
    samples, far = select_profile(cube, radar, 1)
    np.testing.assert_array_equal(samples, cube[:, 2:])
    assert far.max_range == pytest.approx(49.97, abs=0.01)
    with pytest.raises(ValueError, match="4 entries along 'tx' is needed"):
        select_profile(samples, radar, 1)


def test_a_ramp_downwards_has_its_targets_at_positive_ranges():
    radar = Radar.load("awr1843", "triangle").of_profile(1)
    beat = radar.waveform.slope * 2 * 4.0 / 299_792_458
    tone = np.exp(2j * np.pi * beat * radar.waveform.sample_times)
    cube = np.broadcast_to(tone, radar.frame_shape)
    maps = range_doppler(cube, radar, range_bins=2048)
    assert maps.range[maps.power.max(axis=1).argmax()] == pytest.approx(4.0, abs=0.01)
