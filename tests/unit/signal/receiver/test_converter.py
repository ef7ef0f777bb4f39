"""The ADC: 6.02 dB a bit, a range of known power, words that give the samples back."""

from dataclasses import replace

import numpy as np
import pytest

from rfgen_sionna.radar import Adc
from rfgen_sionna.signal import Receiver, receive
from rfgen_sionna.signal.receiver.reception import convert


@pytest.mark.parametrize("bits", [6, 8, 12, 16])
def test_signal_to_quantisation_noise(small, bits):
    """A tone that fills I and Q, -20 dBm here, over the noise: 6.02 bits + 1.76 dB, within 0.1 dB."""
    radar = small(loops=64)
    # An irrational frequency visits all phases. Amplitudes half a step to five steps below the top do not clip, and
    # between them the crests, which dwell at one word, err every way.
    phase = 2 * np.pi * np.sqrt(2) * np.arange(64 * 3 * 4 * 256).reshape(64, 3, 4, 256)
    top = 1 - np.linspace(0.51, 4.51, 64)[:, None, None, None] / 2 ** (bits - 1)
    tone = np.sqrt(1e-3 * 10 ** (-20 / 10)) * top * np.exp(1j * phase)
    taken = convert(tone, radar, Adc(bits, -20.0))
    assert taken.clipped == 0
    error = taken.samples - tone
    ratio = 10 * np.log10(1e-5 / np.mean(np.abs(error) ** 2))
    assert ratio == pytest.approx(6.02 * bits + 1.76, abs=0.1)
    assert np.abs(np.concatenate([error.real, error.imag])).max() <= 0.5 * taken.lsb * (1 + 1e-9)
    # Quantisation noise of I and of Q alike, and white.
    assert np.var(error.real) == pytest.approx(np.var(error.imag), rel=0.05)


def test_beyond_full_scale_it_clips(small):
    radar = small()
    samples = np.linspace(-3, 3, 4 * 3 * 4 * 256).reshape(4, 3, 4, 256) * (1 + 0j)
    taken = convert(samples, radar, Adc(8, 30.0))  # 30 dBm is 1 W: I and Q reach to 1
    assert taken.full_scale == 1.0
    assert taken.lsb == 1 / 128
    assert (taken.samples.real.min(), taken.samples.real.max()) == (-1.0, 127 / 128)
    inside = np.abs(samples.real) < 0.99
    np.testing.assert_allclose(taken.samples.real[inside], samples.real[inside], atol=0.5 / 128 * (1 + 1e-9))
    beyond = np.count_nonzero((samples.real < -128.5 / 128) | (samples.real > 127.5 / 128))
    assert taken.clipped == pytest.approx(beyond / (2 * samples.size))


@pytest.mark.parametrize(("bits", "kind"), [(12, np.int16), (16, np.int16), (20, np.int32)])
def test_words_are_the_samples(small, bits, kind):
    """Also after a passage through complex64, in which cubes are kept."""
    radar = small()
    rng = np.random.default_rng(0)
    samples = (rng.normal(size=(4, 3, 4, 256)) + 1j * rng.normal(size=(4, 3, 4, 256))) * 3.7e-7
    taken = convert(samples, radar, Adc(bits))
    words = taken.words
    assert words.dtype == kind
    assert words.shape == (4, 3, 4, 256, 2)
    kept = taken.samples.astype(np.complex64)
    np.testing.assert_array_equal(words[..., 0] * taken.lsb, kept.real.astype(float))
    np.testing.assert_array_equal(words[..., 1] * taken.lsb, kept.imag.astype(float))


def test_automatic_full_scale_leaves_room_and_stays(small):
    radar = small()
    rng = np.random.default_rng(0)
    samples = rng.normal(size=(4, 3, 4, 256)) + 1j * rng.normal(size=(4, 3, 4, 256))
    peak = max(np.abs(samples.real).max(), np.abs(samples.imag).max())
    for scale in (1.0, 3e-5, 1.7e-7):
        first = convert(scale * samples, radar, Adc())
        assert 2 * scale * peak <= first.full_scale < 4 * scale * peak
        assert np.log2(first.full_scale) % 1 == 0
        later = convert(10 * scale * samples, radar, Adc(), first.full_scale)
        assert later.full_scale == first.full_scale
        assert first.clipped == 0
        assert later.clipped > 0
    assert convert(samples, radar, Adc(16, 30.0), 7.0).full_scale == 1.0, "a fixed full scale is fixed"
    silent = convert(np.zeros((4, 3, 4, 256), complex), radar, Adc())
    assert not silent.words.any()


def test_presets_quantise_and_an_own_adc_takes_their_place(small):
    radar = replace(small(), adc=Adc(10, -60.0))
    tone = np.full((4, 3, 4, 256), 1e-5 + 3e-6j)
    assert receive(tone, radar, Receiver(thermal_noise=False)).adc == Adc(10, -60.0)
    assert receive(tone, radar, Receiver(thermal_noise=False, adc=Adc(4))).adc == Adc(4)
    bare = receive(tone, radar, Receiver.ideal())
    np.testing.assert_array_equal(bare.samples, tone)
    assert bare.lsb is None
    with pytest.raises(ValueError, match=r"capture.words.*no ADC"):
        _ = bare.words
