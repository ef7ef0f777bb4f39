"""Coupling mixes the Rx ports, mismatch turns and scales channels."""

from dataclasses import replace

import numpy as np
import pytest

from rfgen_sionna.signal import Coupling, Mismatch, Receiver, receive

IDEAL = Receiver.ideal()


def random_samples(rng, shape=(4, 3, 4, 256)):
    return rng.normal(size=shape) + 1j * rng.normal(size=shape)


def test_every_port_receives_its_row(small):
    rng = np.random.default_rng(0)
    matrix = np.eye(4) + 0.1 * random_samples(rng, (4, 4))
    samples = random_samples(rng)
    out = receive(samples, small(), replace(IDEAL, coupling=Coupling(tuple(map(tuple, matrix))))).samples
    truth = sum(matrix[2, q] * samples[:, :, q] for q in range(4))
    np.testing.assert_allclose(out[:, :, 2], truth, rtol=1e-12)
    np.testing.assert_allclose(out, np.einsum("rq,ctqn->ctrn", matrix, samples), rtol=1e-12, atol=1e-12)


def test_neighbours_couple_by_their_distance(small):
    """Receivers of the AWR1843 stand half a wavelength (of 77 GHz) apart."""
    radar = small()
    matrix = np.array(Coupling.of_neighbours(radar, -20.0, phase_deg=30.0).matrix)
    np.testing.assert_allclose(np.diag(matrix), 1.0)
    ratio = 77e9 / radar.center_frequency  # of the pitch to half a wavelength at the band's middle, inverted
    np.testing.assert_allclose(np.abs(matrix[0, 1:]), 0.1 / (np.arange(1, 4) / ratio), rtol=1e-9)
    np.testing.assert_allclose(matrix, matrix.T)
    turn = np.degrees(np.angle(matrix[0, 1:]))
    expected = 30 - 180 * (np.arange(1, 4) / ratio - 1)
    np.testing.assert_allclose(np.mod(turn - expected + 180, 360) - 180, 0, atol=1e-6)


def test_channels_get_the_gain_and_phase_given(small):
    samples = random_samples(np.random.default_rng(1))
    mismatch = Mismatch(tx_gain_db=(0, 1, -2), tx_phase_deg=10.0, rx_gain_db=0.5, rx_phase_deg=(0, 5, -5, 20))
    out = receive(samples, small(), replace(IDEAL, mismatch=mismatch)).samples
    ratio = out / samples
    for tx, tx_gain in enumerate((0, 1, -2)):
        for rx, rx_phase in enumerate((0, 5, -5, 20)):
            np.testing.assert_allclose(20 * np.log10(np.abs(ratio[:, tx, rx])), tx_gain + 0.5, atol=1e-9)
            np.testing.assert_allclose(np.degrees(np.angle(ratio[:, tx, rx])), 10 + rx_phase, atol=1e-9)


def test_drawn_mismatch_is_the_devices_own(small):
    """Normal with the spread asked for, the same in every frame, another one for another seed."""
    radar, samples = small(loops=1), np.ones((1, 3, 4, 256), complex)
    receiver = replace(IDEAL, mismatch=Mismatch(gain_spread_db=0.5, phase_spread_deg=8.0))
    first, later, other = (
        receive(samples, radar, receiver, seed=seed, frame=frame).samples for seed, frame in ((1, 0), (1, 9), (2, 0))
    )
    np.testing.assert_array_equal(first, later)
    assert np.abs(first - other).max() > 1e-3
    factors = [receiver.mismatch.factors(radar, seed)[1] for seed in range(2000)]
    gain, phase = 20 * np.log10(np.abs(factors)), np.degrees(np.angle(factors))
    # 8000 draws: one sigma of a standard deviation is 0.8 %, that of a mean 1.1 %.
    assert gain.std() == pytest.approx(0.5, rel=0.04)
    assert phase.std() == pytest.approx(8.0, rel=0.04)
    assert abs(gain.mean()) < 0.05 * 0.5
    assert abs(np.corrcoef(gain.ravel(), phase.ravel())[0, 1]) < 0.05
    assert abs(np.corrcoef(gain[:, 0], gain[:, 1])[0, 1]) < 0.1


def test_a_mismatched_chain_scales_its_noise_too(small):
    radar = small(loops=64)
    receiver = Receiver(mismatch=Mismatch(tx_gain_db=6.0, rx_gain_db=(0, 3, 0, 0)), adc=None)
    noise = receive(np.zeros((64, 3, 4, 256), complex), radar, receiver).samples
    level = 10 * np.log10(np.mean(np.abs(noise) ** 2, axis=(0, 1, 3)))
    assert level[1] - level[0] == pytest.approx(3.0, abs=0.1)
    plain = receive(np.zeros((64, 3, 4, 256), complex), radar, Receiver(adc=None)).samples
    assert level[0] == pytest.approx(10 * np.log10(np.mean(np.abs(plain[:, :, 0]) ** 2)), abs=1e-9)


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: Coupling(((1, 0), (0, 1, 2))), "coupling.matrix"),
        (lambda: Coupling(((1, float("nan")), (0, 1))), "coupling.matrix.*finite"),
        (lambda: Mismatch(rx_gain_db=200.0), "mismatch.rx_gain_db is 200.0"),
        (lambda: Mismatch(tx_phase_deg=("a",)), r"mismatch.tx_phase_deg\[0\] is 'a'"),
        (lambda: Mismatch(gain_spread_db=-1), "mismatch.gain_spread_db is -1"),
    ],
)
def test_values_out_of_range(make, said):
    with pytest.raises(ValueError, match=said):
        make()


def test_configurations_for_other_radars_are_refused(small):
    with pytest.raises(ValueError, match=r"coupling.matrix is 2 x 2; radar 'awr1843' has 4 Rx"):
        replace(IDEAL, coupling=Coupling(((1, 0), (0, 1)))).check(small())
    with pytest.raises(ValueError, match=r"mismatch.tx_gain_db has 2 values.*TX1, TX2, TX3"):
        replace(IDEAL, mismatch=Mismatch(tx_gain_db=(0, 1))).check(small())


def test_coupling_of_neighbours_is_that_of_the_patches_not_of_their_feeds(small):
    """What leaks from a patch into a turned one arrives with the other sign at its port."""
    radar = small()
    plain = np.array(Coupling.of_neighbours(radar, -20.0, 30.0).matrix)
    turned = np.array(Coupling.of_neighbours(replace(radar, rx_phases_deg=(0, 180, 180, 0)), -20.0, 30.0).matrix)
    np.testing.assert_allclose(turned, plain * np.outer([1, -1, -1, 1], [1, -1, -1, 1]))
