"""The receiver behind slots in which several Tx elements radiate, and behind several kinds of chirps."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rfgen_sionna.radar import Radar
from rfgen_sionna.signal import (
    Chassis,
    Interferer,
    Leakage,
    Mismatch,
    PhaseNoise,
    RampError,
    RangeBias,
    Receiver,
    add_thermal_noise,
    noise_power,
    receive,
)

BOARD = replace(
    Receiver.ideal(),
    leakage=Leakage(-20.0, extra_length=0.3),
    chassis=Chassis(-40.0, 0.15),
    range_bias=RangeBias(0.06),
    mismatch=Mismatch(tx_gain_db=(1.0, -2.0), tx_phase_deg=(20.0, 70.0), rx_phase_deg=(0.0, 5.0, -9.0, 30.0)),
    ramp_error=RampError(polynomial_hz=(0.0, 0.0, 4e6)),
)


def short(preset, loops=8):
    radar = Radar.load("awr1843", preset)
    return replace(radar, waveform=replace(radar.waveform, num_loops=loops, num_samples=64))


def alone(radar, tx):
    """A radar of one Tx element with the chirps of one slot."""
    wave = replace(radar.waveform, slots=(), tx_order=(0,), slot_starts=None)
    return replace(radar, waveform=wave, tx_names=radar.tx_names[tx : tx + 1], tx_positions=radar.tx_positions[[tx]])


@pytest.mark.parametrize("preset", ["bpm", "ddm", "near_far"])
def test_slots_hold_the_sum_of_their_elements(preset):
    """Leakage, chassis, Tx chains and ramp error of each element by itself, then added with the slot's phases."""
    radar = short(preset)
    count = len(radar.tx_names)
    board = replace(
        BOARD,
        mismatch=replace(BOARD.mismatch, tx_gain_db=(1.0, -2.0, 0.5)[:count], tx_phase_deg=(20.0, 70.0, 0.0)[:count]),
    )
    out = receive(np.zeros(radar.frame_shape, complex), radar, board).samples
    for number in range(len(radar.waveform.profiles)):
        part = radar.of_profile(number)
        weights = np.conj(part.waveform.axis_weights)
        expected = 0
        for tx in range(count):
            one = replace(board, mismatch=replace(board.mismatch, tx_gain_db=board.mismatch.tx_gain_db[tx],
                                                  tx_phase_deg=board.mismatch.tx_phase_deg[tx]))  # fmt: skip
            single = alone(part, tx)
            echo = receive(np.zeros(single.frame_shape, complex), single, one).samples
            expected = expected + weights[:, :, tx, None, None] * echo
        axis = list(radar.waveform.profile_axis(number))
        np.testing.assert_allclose(out[:, axis], expected, rtol=0, atol=2e-5 * np.abs(expected).max())


def test_tx_chains_are_for_the_synthesiser_where_elements_add_up():
    bpm, tdm = short("bpm"), short("di_gesture")
    gains = BOARD.tx_gains(bpm, seed=0)
    np.testing.assert_allclose(gains, BOARD.mismatch.factors(bpm, 0)[0])
    assert BOARD.tx_gains(tdm, seed=0) is None
    assert Receiver().tx_gains(bpm, seed=0) is None
    # Echoes go through the Rx chains alone.
    echo = np.ones(bpm.frame_shape, complex)
    out = receive(echo, bpm, replace(Receiver.ideal(), mismatch=BOARD.mismatch)).samples
    np.testing.assert_allclose(out, echo * BOARD.mismatch.factors(bpm, 0)[1][:, None])


def test_noise_of_each_profile_has_the_bandwidth_of_its_samples():
    radar = Radar.load("awr1843", "near_far")
    samples = np.zeros(radar.frame_shape, complex)
    add_thermal_noise(samples, radar, seed=0, frame=0)
    for number in (0, 1):
        own = samples[:, list(radar.waveform.profile_axis(number))]
        assert 10 * np.log10(np.mean(np.abs(own) ** 2) / noise_power(radar.of_profile(number))) == pytest.approx(
            0.0, abs=0.05
        )
    assert noise_power(radar) == noise_power(radar.of_profile(1))


def test_phase_noise_of_profiles_is_drawn_apart():
    radar = short("triangle")
    receiver = replace(Receiver.ideal(), leakage=Leakage(-20.0, 3.0), phase_noise=PhaseNoise(((1e6, -70.0),)))
    zero = np.zeros(radar.frame_shape, complex)
    clean = receive(zero, radar, replace(receiver, phase_noise=None)).samples
    error = receive(zero, radar, receiver, seed=1).samples - clean
    up, down = error[:, :3].ravel(), error[:, 3:].ravel()
    assert np.mean(np.abs(down) ** 2) == pytest.approx(np.mean(np.abs(up) ** 2), rel=0.2)
    assert abs(np.vdot(up, np.conj(down))) < 0.2 * np.linalg.norm(up) * np.linalg.norm(down)
    assert abs(np.vdot(up, down)) < 0.2 * np.linalg.norm(up) * np.linalg.norm(down)
    with pytest.raises(ValueError, match="slope is 0"):
        receive(np.zeros((128, 1, 2, 64)), Radar.load("position2go", "doppler"), receiver)


def test_chirps_of_all_kinds_interfere():
    """Another radar of two profiles leaves the bursts of both: those of a radar for each of them."""
    radar = short("mmmesh", loops=16)
    other = Radar.load("awr1843", "near_far", position=(5, 0, 0))
    both = Interferer(other, received_dbm=-60.0, start=0.0)
    ideal = Receiver.ideal()
    zero = np.zeros(radar.frame_shape, complex)

    def burst(source):
        return np.abs(receive(zero, radar, replace(ideal, interferers=(source,)), seed=4).samples[..., 0, :]) > 1e-6

    each = [replace(both, radar=other.of_profile(number)) for number in (0, 1)]
    # The far profile's slope differs: it crosses the band in bursts. The near one's ramps are parallel to the own ones.
    assert burst(each[1]).any()
    together = burst(both)
    for single in each:
        assert np.count_nonzero(together & burst(single)) > 0.5 * np.count_nonzero(burst(single))
    assert both.amplitude(radar) == pytest.approx(10 ** (-90 / 20))
    friis, one = Interferer(Radar.load("awr1843", "bpm", position=(5, 0, 0))), Interferer(other)
    assert friis.amplitude(radar) == pytest.approx(np.sqrt(2) * one.amplitude(radar), rel=0.02)
