"""IQ imbalance makes an image of known strength, a DC offset a constant of known power."""

from dataclasses import replace

import numpy as np
import pytest

from rfgen_sionna.signal import DcOffset, IqImbalance, Receiver, receive

IDEAL = Receiver.ideal()


@pytest.mark.parametrize(("gain_db", "phase_deg"), [(0.5, 0.0), (0.0, 3.0), (-1.0, 5.0), (0.3, -2.0)])
def test_image_rejection(small, gain_db, phase_deg):
    """A tone in bin 20 has an image in bin -20, weaker by (1 + 2 g cos p + g^2) / (1 - 2 g cos p + g^2)."""
    radar = small()
    tone = np.exp(2j * np.pi * 20 * np.arange(256) / 256) * np.ones((4, 3, 4, 1))
    imbalance = IqImbalance(gain_db, phase_deg)
    out = receive(tone, radar, replace(IDEAL, iq_imbalance=imbalance)).samples
    spectrum = np.abs(np.fft.fft(out, axis=-1)) ** 2
    g, p = 10 ** (gain_db / 20), np.radians(phase_deg)
    expected = 10 * np.log10((1 + 2 * g * np.cos(p) + g * g) / (1 - 2 * g * np.cos(p) + g * g))
    np.testing.assert_allclose(10 * np.log10(spectrum[..., 20] / spectrum[..., -20]), expected, atol=1e-6)
    # What the definition says of I and Q.
    np.testing.assert_allclose(out.real, tone.real, atol=1e-12)
    np.testing.assert_allclose(out.imag, g * (tone.imag * np.cos(p) - tone.real * np.sin(p)), atol=1e-12)


def test_each_receiver_may_have_its_own(small):
    radar = small()
    direct, image = IqImbalance((0.0, 0.5, 1.0, 0.0), (0.0, 0.0, 0.0, 2.0)).coefficients(radar)
    with np.errstate(divide="ignore"):
        rejection = 20 * np.log10(np.abs(direct) / np.abs(image))
    assert np.isinf(rejection[0])
    assert rejection[1] > rejection[2]
    assert rejection[3] == pytest.approx(20 * np.log10(1 / np.tan(np.radians(1.0))))


def test_dc_offset_is_a_constant_of_its_power(small):
    radar = small()
    silent = np.zeros((4, 3, 4, 256), complex)
    out = receive(silent, radar, replace(IDEAL, dc_offset=DcOffset((-30.0, -40.0, -50.0, -60.0), 60.0))).samples
    np.testing.assert_allclose(10 * np.log10(np.abs(out[0, 0, :, 0]) ** 2) + 30, [-30, -40, -50, -60])
    np.testing.assert_allclose(np.angle(out), np.radians(60), atol=1e-12)
    drawn = replace(IDEAL, dc_offset=DcOffset(-40.0))
    one, later, other = (receive(silent, radar, drawn, seed=s, frame=f).samples for s, f in ((0, 0), (0, 5), (1, 0)))
    np.testing.assert_array_equal(one, later)
    assert np.ptp(one, axis=(0, 1, 3)).max() == 0
    assert np.abs(one - other).max() > 1e-6
    assert len(np.unique(np.angle(one).round(9))) == 4


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: IqImbalance(gain_db=30), "iq_imbalance.gain_db is 30.*-20 … 20 dB"),
        (lambda: IqImbalance(phase_deg=90), "iq_imbalance.phase_deg is 90"),
        (lambda: DcOffset("loud"), "dc_offset.level_dbm is 'loud'"),
        (lambda: DcOffset(-40, (0, 400)), r"dc_offset.phase_deg\[1\] is 400"),
    ],
)
def test_values_out_of_range(make, said):
    with pytest.raises(ValueError, match=said):
        make()


def test_lists_for_another_number_of_receivers_are_refused(small):
    with pytest.raises(ValueError, match=r"iq_imbalance.gain_db has 2 values.*RX4"):
        replace(IDEAL, iq_imbalance=IqImbalance((0, 1))).check(small())
    with pytest.raises(ValueError, match=r"dc_offset.level_dbm has 3 values.*RX4"):
        replace(IDEAL, dc_offset=DcOffset((0, 1, 2))).check(small())
