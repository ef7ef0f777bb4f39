"""A receiver with one mixer and one converter: sqrt(2) times the real part of the echoes, k T F f_s / 2 of noise."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import signal

from rfgen_sionna.radar import Adc
from rfgen_sionna.signal import (
    DcOffset,
    Interferer,
    IqImbalance,
    Leakage,
    Mismatch,
    PhaseNoise,
    RampError,
    Receiver,
    receive,
)
from rfgen_sionna.signal.receiver.interference import TRANSITION_SHARE
from rfgen_sionna.signal.receiver.reception import convert

IDEAL = Receiver.ideal()


@pytest.fixture(scope="module")
def one_mixer(small):
    return lambda **changes: replace(small(**changes), adc=Adc(16, real=True))


def test_echoes_and_leakage_are_the_real_part_at_their_power(one_mixer, small, echoes):
    radar = one_mixer()
    samples = echoes(radar, [1.3, 4.2], [2e-4, 1e-4j])
    receiver = replace(IDEAL, leakage=Leakage(-60.0), mismatch=Mismatch(gain_spread_db=1.0, phase_spread_deg=50.0))
    found = receive(samples, radar, receiver, seed=3).samples
    whole = receive(samples, small(), receiver, seed=3).samples
    assert found.dtype == np.float64
    np.testing.assert_array_equal(found, np.sqrt(2) * whole.real)
    tone = receive(echoes(radar, 2.0, 3e-5), radar, IDEAL).samples
    assert np.mean(tone**2) == pytest.approx(9e-10, rel=0.01), "the mean square is the received power"


def test_noise_has_half_the_band(one_mixer):
    radar = one_mixer(loops=64)
    nothing = np.zeros(radar.frame_shape, complex)
    noise = receive(nothing, radar, replace(IDEAL, thermal_noise=True), seed=1).samples
    density = 1.380649e-23 * radar.temperature * 10 ** (radar.noise_figure_db / 10)
    assert np.mean(noise**2) == pytest.approx(density * radar.waveform.sample_rate / 2, rel=0.02)
    spectrum = np.mean(np.abs(np.fft.rfft(noise, axis=-1)[..., 1:-1]) ** 2, axis=(0, 1, 2))
    np.testing.assert_allclose(spectrum, spectrum.mean(), rtol=0.2, err_msg="white over the Nyquist band")


@pytest.mark.parametrize("bits", [8, 12])
def test_a_tone_of_full_scale_just_fills_the_converter(one_mixer, bits):
    """6.02 dB a bit plus 1.76 dB, as for I and Q each."""
    radar = one_mixer(loops=64)
    phase = 2 * np.pi * np.sqrt(2) * np.arange(64 * 3 * 4 * 256).reshape(64, 3, 4, 256)
    top = 1 - np.linspace(0.51, 4.51, 64)[:, None, None, None] / 2 ** (bits - 1)
    tone = np.sqrt(2 * 1e-5) * top * np.cos(phase)  # -20 dBm
    adc = Adc(bits, -20.0, real=True)
    taken = convert(tone, radar, adc)
    assert taken.clipped == 0
    assert taken.full_scale == pytest.approx(np.sqrt(2e-5))
    ratio = 10 * np.log10(1e-5 / np.mean((taken.samples - tone) ** 2))
    assert ratio == pytest.approx(6.02 * bits + 1.76, abs=0.1)
    assert taken.words.shape == tone.shape
    louder = convert(1.2 * tone, radar, adc)
    beyond = np.count_nonzero(np.abs(np.rint(1.2 * tone / taken.lsb) + 0.5) > 2 ** (bits - 1))
    assert louder.clipped == pytest.approx(beyond / tone.size)
    automatic = convert(tone, radar, Adc(bits, real=True))
    assert 2 <= automatic.full_scale / np.abs(tone).max() <= 4
    kept = automatic.samples.astype(np.float32).astype(float)
    np.testing.assert_array_equal(automatic.words * automatic.lsb, kept, err_msg="also after a passage through float32")


def test_parts_that_one_converter_lacks_are_refused_by_name(one_mixer, small):
    radar = one_mixer()
    with pytest.raises(ValueError, match=r"receiver.iq_imbalance: radar 'awr1843' has one mixer .* no Q"):
        Receiver(iq_imbalance=IqImbalance(0.5)).check(radar)
    with pytest.raises(ValueError, match=r"receiver.adc.real is False .* take Adc\(..., real=True\)"):
        Receiver(adc=Adc(12)).check(radar)
    with pytest.raises(ValueError, match=r"receiver.adc.real is True"):
        Receiver(adc=Adc(12, real=True)).check(small())
    with pytest.raises(ValueError, match="phase of 0 or 180 degrees"):
        Receiver(dc_offset=DcOffset(-60.0, 90.0)).check(radar)
    with pytest.raises(ValueError, match="samples are float64: the complex ones of synthesize"):
        receive(np.zeros(radar.frame_shape), radar, IDEAL)


def test_an_offset_is_one_voltage(one_mixer):
    radar = one_mixer()
    nothing = np.zeros(radar.frame_shape, complex)
    given = receive(nothing, radar, replace(IDEAL, dc_offset=DcOffset(-60.0, (0.0, 180.0, 0.0, -180.0)))).samples
    np.testing.assert_allclose(given[0, 0, :, 0], np.array([1, -1, 1, -1]) * np.sqrt(1e-9))
    drawn = [
        receive(nothing, radar, replace(IDEAL, dc_offset=DcOffset(-60.0)), seed=seed).samples[0, 0, :, 0]
        for seed in range(8)
    ]
    np.testing.assert_allclose(np.square(drawn), 1e-9)
    assert 8 < np.count_nonzero(np.array(drawn) > 0) < 24, "both signs"


@pytest.mark.parametrize("distance", [0.8, 2.5])
def test_a_mixer_folds_the_lower_sideband_of_a_ripple(one_mixer, distance):
    """Beats of 0.3 and 1 MHz with a ripple of 0.8 MHz: one sideband of the first is below zero."""
    radar = one_mixer(loops=1)
    wave = radar.waveform
    ripple = RampError(sine_hz=1e6, sine_frequency_hz=0.8e6)
    tau, t = 2 * distance / 299_792_458.0, wave.sample_times
    cycles = wave.start_frequency * tau + wave.slope * t * tau - 0.5 * wave.slope * tau**2
    straight = np.exp(2j * np.pi * np.mod(cycles, 1.0))
    bent = straight * np.exp(1j * (ripple.phase(radar, t) - ripple.phase(radar, t - tau)))
    out = receive(np.broadcast_to(straight, radar.frame_shape), radar, replace(IDEAL, ramp_error=ripple)).samples
    truth = np.sqrt(2) * (bent - straight).real
    inside = slice(16, -16)  # the error leaks at the ends of a chirp
    error = (out[0, 0, 0] - np.sqrt(2) * straight.real - truth)[inside]
    assert np.linalg.norm(error) < 0.05 * np.linalg.norm(truth[inside])


def test_phase_noise_has_its_density_on_both_sides(one_mixer, echoes):
    """A white level L makes 2 sin^2 (2 pi f tau / 2) L a side, of which the mixer keeps those within the band."""
    radar = one_mixer(loops=32)
    distance, level = 2.6, -95.0
    samples = echoes(radar, distance, 1.0)
    noise = PhaseNoise(((1e3, level),))
    error = receive(samples, radar, replace(IDEAL, phase_noise=noise), seed=1).samples - np.sqrt(2) * samples.real
    rate, tau = radar.waveform.sample_rate, 2 * distance / 299_792_458.0
    beat = radar.waveform.slope * tau
    offset = np.linspace(-rate / 2, rate / 2, 100_001) - beat  # of the band after the mixer, from the carrier
    inside = 4 * np.sin(np.pi * offset * tau) ** 2 * 10 ** (level / 10)
    assert np.mean(error**2) == pytest.approx(np.trapezoid(inside, offset), rel=0.1)


@pytest.mark.parametrize("band", [None, (0.6e6, 1.9e6)])
def test_bursts_come_from_both_sides_of_the_ramp(one_mixer, band):
    """The whole chirp on a grid 512 times finer, mixed by a cosine and filtered there; within 1 % of the peak."""
    radar = one_mixer(loops=1)
    wave = radar.waveform
    slope = wave.slope - 0.15e12
    start = wave.start_frequency + (wave.slope - slope) * 30e-6
    other = replace(radar, waveform=replace(wave, slope=slope, start_frequency=start), frequency_range=None)
    other = other.placed(position=(10.0, 0, 0), look_at=radar.position)
    interferer = Interferer(other, received_dbm=-50.0, start=0.0, if_band_hz=band)
    burst = receive(np.zeros(radar.frame_shape, complex), radar, replace(IDEAL, interferers=interferer)).samples

    fine = 512
    rate = fine * wave.sample_rate
    count, beta = signal.kaiserord(70.0, 2 * TRANSITION_SHARE / fine)
    count |= 1
    edges, low_pass = (0.45 * wave.sample_rate, True) if band is None else (band, False)
    taps = signal.firwin(count, edges, window=("kaiser", beta), fs=rate, pass_zero=low_pass)
    lead = count // 2
    t = wave.adc_start_time + np.arange(-lead, 256 * fine + lead) / rate
    cycles = (wave.start_frequency - start) * t + 0.5 * (wave.slope - slope) * t**2
    on = (t >= 0) & (t <= wave.ramp_end_time)
    chirp = 1e-4 * on * np.exp(2j * np.pi * cycles)
    parts = [signal.oaconvolve(part, taps, mode="valid")[: 256 * fine : fine] for part in (chirp.real, chirp.imag)]
    columns = np.sqrt(2) * np.stack(parts, axis=1)
    turn = np.linalg.lstsq(columns, burst[0, 0, 0], rcond=None)[0]  # the phase of a ramp is drawn
    assert np.hypot(*turn) == pytest.approx(1.0, abs=0.01)
    assert np.abs(burst[0, 0, 0] - columns @ turn).max() < 0.01 * np.abs(columns).max()


def test_an_if_band_beyond_nyquist_is_refused(one_mixer):
    radar = one_mixer()
    other = radar.placed(position=(5, 0, 0))
    with pytest.raises(ValueError, match=r"real samples \(adc.real\), 0 … 1.98e\+06 Hz fit"):
        Interferer(other, if_band_hz=(0.0, 3e6)).check(radar)
    with pytest.raises(ValueError, match="without aliases"):
        Interferer(other, if_band_hz=(-1e6, 1e6)).check(radar)
    Interferer(other).check(radar)
