"""Errors of the chirp generator leave phi(t) - phi(t - tau) on every path: held against the sum path by path."""

from dataclasses import replace

import numpy as np
import pytest

from rfgen_sionna._types import SPEED_OF_LIGHT
from rfgen_sionna.signal import Leakage, PhaseNoise, RampError, Receiver, receive
from rfgen_sionna.signal.noise import frame_stream
from rfgen_sionna.signal.receiver.delay_phase_errors import gap_length

IDEAL = Receiver.ideal()
BENT = RampError(polynomial_hz=(5e4, 2e5, -3e5), sine_hz=2e5, sine_frequency_hz=1e5, sine_phase_deg=40)


def delays(ranges):
    return 2 * np.asarray(ranges)[:, None] / SPEED_OF_LIGHT


def tones(radar, tau):
    wave = radar.waveform
    cycles = wave.start_frequency * tau + wave.slope * wave.sample_times * tau - 0.5 * wave.slope * tau**2
    return np.exp(2j * np.pi * np.mod(cycles, 1.0))


def relative(found, truth):
    return np.linalg.norm(found - truth) / np.linalg.norm(truth)


def test_the_phase_of_a_bent_ramp_is_the_integral_of_its_frequency(small):
    radar = small()
    t = np.linspace(0, radar.waveform.ramp_end_time, 200_001)
    frequency = BENT.frequency(radar, t)
    share = t / radar.waveform.ramp_end_time
    by_hand = 5e4 + 2e5 * share - 3e5 * share**2 + 2e5 * np.sin(2 * np.pi * 1e5 * t + np.radians(40))
    np.testing.assert_allclose(frequency, by_hand, rtol=1e-9, atol=1e-3)
    step = t[1]
    area = 2 * np.pi * np.concatenate([[0], np.cumsum(0.5 * (frequency[1:] + frequency[:-1])) * step])
    np.testing.assert_allclose(BENT.phase(radar, t), area, atol=1e-5)


@pytest.mark.parametrize(
    ("count", "nearest", "furthest", "tolerance"),
    # The error itself, not the samples, is within 5 %: a lone path keeps some leakage across the gap, few samples at
    # the ends of the chirp. Many paths fill it well.
    [(1, 1.0, 1.0, 0.05), (1, 6.01, 6.01, 0.01), (5, 0.3, 9.5, 0.05), (300, 0.3, 9.5, 0.01)],
)
def test_a_bent_ramp_acts_on_every_path_by_its_delay(small, count, nearest, furthest, tolerance):
    radar = small(loops=2)
    rng = np.random.default_rng(3)
    tau = delays(rng.uniform(nearest, furthest, count))
    gain = (rng.normal(size=count) + 1j * rng.normal(size=count))[:, None]
    paths = gain * tones(radar, tau)
    t = radar.waveform.sample_times
    truth = (paths * np.exp(1j * (BENT.phase(radar, t) - BENT.phase(radar, t - tau)))).sum(axis=0)
    straight = np.broadcast_to(paths.sum(axis=0), (2, 3, 4, 256))
    out = receive(straight, radar, replace(IDEAL, ramp_error=BENT)).samples
    for chirp in (out[0, 0, 0], out[1, 2, 3]):
        assert relative(chirp - straight[0, 0, 0], truth - straight[0, 0, 0]) < tolerance


@pytest.mark.parametrize("speed", [0.0, 50.0])
@pytest.mark.parametrize("distance", [0.3, 1.0, 3.3, 6.01, 9.0])
@pytest.mark.parametrize("height", [2e4, 2e5, 2e6])
def test_the_residual_of_a_ramp_error_is_bounded(small, height, distance, speed):
    """As documented: 1.5 % of the phase error at the end of the range window, whatever the range and the speed."""
    radar = small(loops=1)
    wave, t = radar.waveform, radar.waveform.sample_times
    tau = 2 * (distance + speed * t) / SPEED_OF_LIGHT
    cycles = wave.start_frequency * tau + wave.slope * t * tau - 0.5 * wave.slope * tau**2
    path = np.exp(2j * np.pi * np.mod(cycles, 1.0))
    for frequency in (2e4, 8.8e4):  # up to 2 % of the sample rate
        bent = RampError(sine_hz=height, sine_frequency_hz=frequency, sine_phase_deg=40)
        largest = np.sqrt(np.mean((bent.phase(radar, t) - bent.phase(radar, t - 2 * radar.max_range / 3e8)) ** 2))
        assert largest < 1.0
        truth = path * np.expm1(1j * (bent.phase(radar, t) - bent.phase(radar, t - tau)))
        samples = np.broadcast_to(path, (1, 3, 4, 256))
        error = (receive(samples, radar, replace(IDEAL, ramp_error=bent)).samples - samples)[0, 0, 0] - truth
        assert np.sqrt(np.mean(np.abs(error) ** 2)) < 0.015 * largest


def test_sidebands_of_a_fast_ripple_stay_within_the_if_band(small, echoes):
    """J_1 on either side of a target at 5.5 m (2.2 MHz); of one at 1 m (0.4 MHz) the lower one lies below zero."""
    radar = small(loops=1)
    wave = radar.waveform
    ripple, count = 58 / (wave.num_samples / wave.sample_rate), wave.num_samples  # 1 MHz, 58 bins
    for beat, lower in ((128, 1.0), (23, 0.0)):
        tau = beat * wave.sample_rate / (count * wave.slope)
        bent = RampError(sine_hz=1e5, sine_frequency_hz=ripple)
        out = receive(echoes(radar, tau * SPEED_OF_LIGHT / 2), radar, replace(IDEAL, ramp_error=bent)).samples[0, 0, 0]
        level = np.abs(np.fft.fft(out)) / count
        # phi(t) - phi(t - tau) of a sine is one of twice its size times sin(pi f tau).
        swing = 2 * 1e5 / ripple * abs(np.sin(np.pi * ripple * tau))
        assert level[beat + 58] == pytest.approx(swing / 2, rel=0.03)
        assert level[(beat - 58) % count] == pytest.approx(lower * swing / 2, abs=0.03 * swing)


def test_a_linear_error_is_another_slope(small, echoes):
    """A frequency error that grows evenly with time moves targets as that slope does: by 2 % here, at all ranges."""
    radar = small(loops=1)
    wave = radar.waveform
    receiver = replace(IDEAL, ramp_error=RampError((0.0, 0.02 * wave.slope * wave.ramp_end_time)))
    for distance in (1.5, 8.0):
        out = receive(echoes(radar, distance), radar, receiver).samples[0, 0, 0]
        peak = np.argmax(np.abs(np.fft.fft(out * np.hanning(256), 1 << 14))) * radar.max_range / (1 << 14)
        assert peak == pytest.approx(1.02 * distance, abs=0.02 * radar.range_resolution)


def test_leakage_has_the_error_of_its_own_delay(small):
    """Known to the last digit but for what the IF filter takes: 1e-3 of an error of 4e-4 rad."""
    radar = small(loops=1)
    receiver = replace(IDEAL, leakage=Leakage(-20.0, 0.02))
    clean = receive(np.zeros((1, 3, 4, 256), complex), radar, receiver).samples
    bent = receive(np.zeros((1, 3, 4, 256), complex), radar, replace(receiver, ramp_error=BENT)).samples
    length = np.linalg.norm(radar.tx_positions[:, None] - radar.rx_positions[None], axis=-1)[..., None] + 0.02
    t = radar.waveform.sample_times
    phase = BENT.phase(radar, t) - BENT.phase(radar, t - length / SPEED_OF_LIGHT)
    inner = slice(20, -20)
    error = (bent - clean)[0, ..., inner]
    truth = (clean[0] * np.expm1(1j * phase))[..., inner]
    assert relative(error, truth) < 0.05
    assert np.abs(truth).max() > 1e-5


# -- phase noise ----------------------------------------------------------------------------------------------

NOISE = PhaseNoise(((1e4, -80.0), (1e5, -85.0), (1e6, -95.0), (1e7, -115.0)))


def residual_density(noise, offset, delay):
    """Two-sided power spectral density of phi(t) - phi(t - delay) [rad^2/Hz]."""
    return noise.density(offset) * 2 * (1 - np.cos(2 * np.pi * offset * delay))


def test_levels_run_straight_over_the_logarithm_of_the_offset():
    levels = 10 * np.log10(NOISE.density(np.array([10.0, 1e4, 3.1622776601683795e5, -1e6, 1e8])))
    np.testing.assert_allclose(levels, [-80, -80, -90, -95, -115], atol=1e-9)


def test_the_generator_draws_its_spectrum():
    """Variance of phi is the integral over both sidebands, and its periodogram is L(f)."""
    rate, count, period = 8e6, 512, 512 / 8e6
    drawn = NOISE.draw(np.random.default_rng(0), 4000, period, count)
    phase = np.fft.irfft(drawn * count / 2, axis=-1)
    density = np.mean(np.abs(np.fft.fft(phase, axis=-1)) ** 2, axis=0) / (rate * count)
    offset = np.fft.fftfreq(count, 1 / rate)[1 : count // 2]
    ratio = 10 * np.log10(density[1 : count // 2] / NOISE.density(offset))
    assert np.abs(ratio).max() < 0.4  # 4000 draws: one sigma is 0.07 dB
    assert abs(ratio.mean()) < 0.02


@pytest.mark.parametrize("distance", [1.0, 2.53, 6.0])
def test_residual_noise_has_the_spectrum_of_range_correlation(small, echoes, distance):
    """2 L(f) (1 - cos 2 pi f tau) within 0.3 dB on average, 1.2 dB (4 sigma of 768 spectra, 8 bins each) anywhere."""
    radar = small(loops=256)
    wave = radar.waveform
    clean = echoes(radar, distance)[..., :1, :]
    only = replace(radar, rx_names=("RX1",), rx_positions=radar.rx_positions[:1])
    out = receive(clean, only, replace(IDEAL, phase_noise=NOISE), seed=4).samples
    error = (out - clean) * np.conj(clean)
    window = np.hanning(256)
    density = np.mean(np.abs(np.fft.fft(error * window, axis=-1)) ** 2, axis=(0, 1, 2))
    density /= (window**2).sum() * wave.sample_rate
    delay = 2 * distance / SPEED_OF_LIGHT
    beat = wave.slope * delay
    offset = np.fft.fftfreq(256, 1 / wave.sample_rate)
    # The IF filter keeps 0 … sample rate: offsets that leave it on one side come from the other.
    offset[offset + beat < 0] += wave.sample_rate
    away = (np.abs(offset) > 4 / 58e-6) & (offset + beat > 0) & (offset + beat < 0.95 * wave.sample_rate)
    expected = residual_density(NOISE, offset, delay)
    order = np.argsort(offset[away])
    ratio = (density[away] / expected[away])[order]
    groups = [10 * np.log10(np.mean(group)) for group in np.array_split(ratio, len(ratio) // 8)]
    assert abs(10 * np.log10(np.mean(ratio))) < 0.3
    assert np.abs(groups).max() < 1.2


def test_range_correlation_takes_the_noise_off_near_paths(small, echoes):
    """At offsets far below 1 / tau the residual falls with the square of the delay: 20 dB from 10 m to 1 m."""
    radar = small(loops=64)
    slow = PhaseNoise(((1e5, -80.0), (1e6, -130.0)))
    power = []
    for distance in (1.0, 10.0):
        clean = echoes(radar, distance)
        out = receive(clean, radar, replace(IDEAL, phase_noise=slow), seed=2).samples
        power.append(np.mean(np.abs(out - clean)[..., 32:-32] ** 2))
    assert 10 * np.log10(power[1] / power[0]) == pytest.approx(20.0, abs=0.5)


@pytest.mark.parametrize("changes", [{}, {"sample_rate": 22.5e6, "slope": 42.003e12}])
def test_the_same_noise_acts_on_every_path_by_its_delay(small, changes):
    """The drawn Fourier series evaluated at t and t - tau for each of 40 paths; the fast ADC holds long delays."""
    radar = small(loops=2, **changes)
    wave = radar.waveform
    # Quiet beyond a tenth of the sample rate: nothing passes the edges of the IF band, which a sum over paths has not.
    edge = 0.1 * wave.sample_rate
    noise = PhaseNoise(((1e5, -85.0), (0.5 * edge, -90.0), (edge, -250.0)))
    rng = np.random.default_rng(5)
    tau = delays(rng.uniform(0.3, 0.7, 40) * radar.max_range)
    gain = (rng.normal(size=40) + 1j * rng.normal(size=40))[:, None]
    paths = gain * tones(radar, tau)
    clean = np.broadcast_to(paths.sum(axis=0), (2, 3, 4, 256))
    out = receive(clean, radar, replace(IDEAL, phase_noise=noise), seed=7, frame=3).samples

    span = 256 + gap_length(256)
    period = 2 * span / wave.sample_rate
    drawn = noise.draw(frame_stream(7, "phase_noise", 3, radar), 6, period, 4 * span).reshape(2, 3, -1)
    # The grid begins half a gap before the window.
    begin = wave.adc_start_time - gap_length(256) / 2 / wave.sample_rate
    t = wave.sample_times - begin
    offsets = 2j * np.pi * np.arange(drawn.shape[-1]) / period
    for loop, tx in ((0, 0), (1, 2)):
        now = (drawn[loop, tx] @ np.exp(np.outer(offsets, t))).real
        before = np.stack([(drawn[loop, tx] @ np.exp(np.outer(offsets, t - one))).real for one in tau[:, 0]])
        truth = (paths * np.expm1(1j * (now - before))).sum(axis=0)
        error = out[loop, tx, 1] - clean[loop, tx, 1]
        assert relative(error, truth) < 0.02
        np.testing.assert_allclose(out[loop, tx, 1], out[loop, tx, 3], rtol=1e-12)  # one generator for all receivers
    assert relative(out[0, 0, 0], out[0, 1, 0]) > 1e-4  # chirps draw independently


def test_noise_far_beyond_the_band_does_not_fold_back(small, echoes):
    """A target in the middle of the band: offsets beyond half the sample rate lie outside of the IF band."""
    radar = small(loops=8)
    rate = radar.waveform.sample_rate
    far = PhaseNoise(((0.6 * rate, -250.0), (0.7 * rate, -110.0)))
    distance = radar.max_range * 0.47
    clean = echoes(radar, distance)
    out = receive(clean, radar, replace(IDEAL, phase_noise=far), seed=1).samples
    offset = np.linspace(0.6 * rate, rate, 1000)
    unfiltered = 2 * np.trapezoid(residual_density(far, offset, 2 * distance / SPEED_OF_LIGHT), offset)
    assert np.mean(np.abs(out - clean) ** 2) < 1e-3 * unfiltered
    flat = PhaseNoise(((rate, -110.0),))
    kept = receive(clean, radar, replace(IDEAL, phase_noise=flat), seed=1).samples
    offset = np.linspace(-0.47 * rate, 0.53 * rate, 1000)
    within = np.trapezoid(residual_density(flat, offset, 2 * distance / SPEED_OF_LIGHT), offset)
    assert np.mean(np.abs(kept - clean) ** 2) == pytest.approx(within, rel=0.1)


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: RampError(polynomial_hz=3.0), "ramp_error.polynomial_hz is 3.0: a list"),
        (lambda: RampError(polynomial_hz=(1e5, 1e10)), r"ramp_error.polynomial_hz\[1\] is 10000000000.0.*Hz"),
        (lambda: RampError(sine_hz=1e5), "ramp_error.sine_frequency_hz is 0"),
        (lambda: PhaseNoise(()), "phase_noise.points"),
        (lambda: PhaseNoise(((1e5, -80, 3),)), "pairs"),
        (lambda: PhaseNoise(((1e6, -80), (1e5, -90))), "ascend"),
        (lambda: PhaseNoise(((1e6, 10.0),)), r"points\[0\] level is 10.0.*-250 … 0 dBc/Hz"),
        (lambda: PhaseNoise(((0.0, -80.0),)), r"points\[0\] offset is 0.0"),
    ],
)
def test_values_out_of_range(make, said):
    with pytest.raises(ValueError, match=said):
        make()
