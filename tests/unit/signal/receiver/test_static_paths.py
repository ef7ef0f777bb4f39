"""Leakage, chassis and range bias are paths of known level and length."""

from dataclasses import replace

import numpy as np
import pytest

from rfgen_sionna._types import SPEED_OF_LIGHT
from rfgen_sionna.radar import Slot
from rfgen_sionna.radar.slots import coded_slots, hadamard_code
from rfgen_sionna.signal import Chassis, Leakage, RangeBias, Receiver, receive

IDEAL = Receiver.ideal()


def tone(radar, delay):
    wave = radar.waveform
    cycles = wave.start_frequency * delay + wave.slope * wave.sample_times * delay - 0.5 * wave.slope * delay**2
    return np.exp(2j * np.pi * np.mod(cycles, 1.0))


def test_leakage_goes_straight_from_tx_to_rx(small):
    radar = small()
    silent = np.zeros((4, 3, 4, 256), complex)
    out = receive(silent, radar, replace(IDEAL, leakage=Leakage(-40.0, extra_length=0.12))).samples
    for tx in range(3):
        for rx in range(4):
            length = np.linalg.norm(radar.tx_positions[tx] - radar.rx_positions[rx]) + 0.12
            # 30 dBm is 1 W, and 40 dB below it a hundredth of its voltage.
            np.testing.assert_allclose(out[:, tx, rx], np.tile(0.01 * tone(radar, length / SPEED_OF_LIGHT), (4, 1)))
    assert not silent.any(), "the samples given stay as they are"


def test_the_chassis_mirrors(small):
    """By way of a plate at distance d the path is the hypotenuse of 2 d and the elements' distance."""
    radar = small()
    out = receive(np.zeros((4, 3, 4, 256), complex), radar, replace(IDEAL, chassis=Chassis(-60.0, 0.05))).samples
    for tx in range(3):
        for rx in range(4):
            along = np.linalg.norm(radar.tx_positions[tx] - radar.rx_positions[rx])
            expected = 1e-3 * tone(radar, np.hypot(0.1, along) / SPEED_OF_LIGHT)
            np.testing.assert_allclose(out[2, tx, rx], expected, rtol=1e-9)


def test_range_bias_delays_everything(small, echoes):
    """Within the documented cross term: 2 pi mu tau tau_b, 0.01 rad here, the same for every chirp."""
    radar = small()
    bias = RangeBias(0.065)
    ranges, gains = [1.0, 4.2, 9.0], [1.0, 0.5j, -0.7]
    leak = Leakage(-40.0)
    out = receive(echoes(radar, ranges, gains), radar, replace(IDEAL, range_bias=bias, leakage=leak)).samples
    truth = echoes(radar, ranges, gains, extra_delay=bias.delay)
    length = np.linalg.norm(radar.tx_positions[:, None] - radar.rx_positions[None], axis=-1)
    truth += 0.01 * np.stack([[tone(radar, v / SPEED_OF_LIGHT + bias.delay) for v in row] for row in length])
    cross = 2 * np.pi * radar.waveform.slope * 2 * 9.0 / SPEED_OF_LIGHT * bias.delay
    assert cross < 0.012
    assert np.abs(out - truth).max() < cross * (1 + 0.5 + 0.7)
    assert bias.delay == pytest.approx(0.13 / SPEED_OF_LIGHT)
    # The peak moves by 6.5 cm, to a hundredth of that.
    moved = receive(echoes(radar, 4.2), radar, replace(IDEAL, range_bias=bias)).samples
    peaks = [np.argmax(np.abs(np.fft.fft(x[0, 0, 0] * np.hanning(256), 1 << 16))) for x in (echoes(radar, 4.2), moved)]
    cell = radar.max_range / (1 << 16)
    assert (peaks[1] - peaks[0]) * cell == pytest.approx(0.065, abs=6.5e-4)


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: Leakage(3.0), "leakage.level_db is 3.0.*-200 … 0 dB"),
        (lambda: Leakage(-40, -1), "leakage.extra_length is -1.*0 … 10 m"),
        (lambda: Chassis(float("nan"), 0.1), "chassis.level_db is nan"),
        (lambda: Chassis(-40, 0), "chassis.distance is 0.*0.001 … 100 m"),
        (lambda: RangeBias("6 cm"), "range_bias.distance is '6 cm'.*m is needed"),
    ],
)
def test_values_out_of_range(make, said):
    with pytest.raises(ValueError, match=said):
        make()


def test_a_chassis_beyond_the_range_window(small):
    with pytest.raises(ValueError, match=r"chassis.distance.*range window.*awr1843"):
        replace(IDEAL, chassis=Chassis(-60, 20.0)).check(small())


def test_feeds_turn_the_devices_own_paths(small):
    """A phase of a Tx element's feed is one of its phase shifter, also where several elements fire at once."""
    radar = small()
    slots = coded_slots(hadamard_code(3), range(3), 3)
    shifted = [Slot(tuple(np.add(slot.phases_deg, (0.0, 180.0, 33.75)).tolist())) for slot in slots]
    receiver = replace(IDEAL, leakage=Leakage(-30.0), chassis=Chassis(-50.0, 0.05))
    found = []
    for chosen, phases in ((slots, (0.0, 180.0, 33.75)), (shifted, ())):
        wave = replace(radar.waveform, tx_order=(), slots=tuple(chosen))
        coded = replace(radar, waveform=wave, tx_phases_deg=phases, rx_phases_deg=(0, 90, 0, 180))
        found.append(receive(np.zeros(coded.frame_shape, complex), coded, receiver).samples)
    np.testing.assert_allclose(*found, atol=1e-12)
    wave = replace(radar.waveform, tx_order=(), slots=slots)
    plain = receive(np.zeros((4, 4, 4, 256), complex), replace(radar, waveform=wave), receiver).samples
    ratio = found[0][0, 0, :, 0] / plain[0, 0, :, 0]
    assert np.abs(ratio - ratio[0]).max() > 0.5
