"""The synthesiser against the direct sum, and the noise against its formula."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rfgen_sionna._types import SPEED_OF_LIGHT
from rfgen_sionna.radar import ElementPattern, Radar
from rfgen_sionna.records import PathKind, RadarPaths
from rfgen_sionna.signal import add_thermal_noise, noise_power, synthesize
from rfgen_sionna.signal.synthesis import check_synthesis
from tests.reference.direct_sum import direct_sum

ISOTROPIC = ElementPattern(0.0)


def small_radar(loops=6, **changes):
    """The mmMesh chirp in a short frame, isotropic, 0 dBm = 1 mW turned to 1 W."""
    radar = Radar.load("awr1843", "mmmesh")
    waveform = replace(radar.waveform, num_loops=loops, **changes)
    return replace(radar, waveform=waveform, pattern=ISOTROPIC, tx_power_dbm=30.0)


def make_paths(radar, gain, delay, knots, dispersion=None):
    """Paths with constant gains (tx, rx, path) and `delay(times, tx, rx) -> (path, n)` sampled at `knots`."""
    tx, rx, count = gain.shape
    tau = np.stack([[delay(knots, i, j) for j in range(rx)] for i in range(tx)])
    step = 1e-6
    rate = np.stack(
        [[(delay(knots + step, i, j) - delay(knots - step, i, j)) / (2 * step) for j in range(rx)] for i in range(tx)]
    )
    direction = np.broadcast_to([1.0, 0, 0], (count, len(knots), 3))
    return RadarPaths(
        a=np.repeat(gain[..., None], len(knots), axis=3).astype(complex),
        tau=tau,
        tau_rate=rate,
        times=knots,
        frequency=radar.center_frequency,
        direction=direction,
        arrival=direction,
        object_id=np.zeros(count, np.int32),
        part_id=np.zeros(count, np.int32),
        kind=np.full(count, PathKind.FACET, np.uint8),
        bounces=np.ones(count, np.uint8),
        object_names=("thing",),
        part_names=("thing",),
        facet=np.arange(count, dtype=np.int32),
        dispersion=dispersion,
        half_band=0.0 if dispersion is None else 0.5 * radar.waveform.bandwidth,
    )


def relative(found, truth):
    return np.linalg.norm(found - truth) / np.linalg.norm(truth)


def random_gains(rng, radar, count):
    shape = (len(radar.tx_names), len(radar.rx_names), count)
    return rng.normal(size=shape) + 1j * rng.normal(size=shape)


@settings(max_examples=15, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1), speed=st.sampled_from([0.0, 1.0, 50.0]), samples=st.sampled_from([256, 255, 64, 1])
)
def test_agrees_with_the_direct_sum(seed, speed, samples):
    """Random paths, 0.05 … 200 m at up to `speed` m/s, one knot, default tolerance: relative error at most 1e-6."""
    rng = np.random.default_rng(seed)
    radar = small_radar(num_samples=samples)
    gain = random_gains(rng, radar, 12)
    tau0 = 2 * rng.uniform(0.05, 200, (3, 4, 12)) / SPEED_OF_LIGHT
    rate = 2 * rng.uniform(-speed, speed, (3, 4, 12)) / SPEED_OF_LIGHT

    def delay(t, tx, rx):
        return tau0[tx, rx][:, None] + rate[tx, rx][:, None] * (t - 0.3)

    paths = make_paths(radar, gain, delay, np.array([0.3]))
    paths = replace(paths, tau_rate=rate[..., None])
    found = synthesize(radar, paths, 0.3)
    assert relative(found, direct_sum(radar, delay, gain, 0.3)) < 1e-6


@pytest.mark.parametrize(
    ("motion", "limit"),
    [
        (lambda t: 0.5 * 50.0 * t**2, 1e-6),  # 50 m/s^2
        (lambda t: 1e-4 * np.sin(2 * np.pi * 20.0 * t), 1e-5),  # a vibration of 0.1 mm at 20 Hz
        (lambda t: 0.3 * np.sin(2 * np.pi * 0.5 * t), 1e-5),  # a pendulum
    ],
)
def test_delay_follows_its_knots_through_the_frame(motion, limit):
    """Acceleration, vibration and swing over a whole frame of 128 loops, with knots 2 ms apart."""
    rng = np.random.default_rng(3)
    radar = small_radar(loops=128, num_samples=16)
    gain = random_gains(rng, radar, 4)
    start_range = rng.uniform(1, 8, 4)

    def delay(t, tx, rx):
        return 2 * (start_range[:, None] + 0.01 * (tx + rx) + motion(np.asarray(t))[None]) / SPEED_OF_LIGHT

    knots = np.linspace(0, radar.waveform.frame_length, 15)
    found = synthesize(radar, make_paths(radar, gain, delay, knots), 0.0, eps=1e-8)
    assert relative(found, direct_sum(radar, delay, gain)) < limit


@pytest.mark.parametrize("count", [2, 3])
def test_a_few_knots_are_a_polynomial_in_the_delay(count):
    """A steady speed by two knots, an acceleration by three, over a whole frame: exact, though the phase is not one."""
    rng = np.random.default_rng(4)
    radar = small_radar(loops=128, num_samples=16)
    gain = random_gains(rng, radar, 4)
    start_range, speed, acceleration = rng.uniform(1, 8, 4), rng.uniform(-50, 50, 4), 50.0 * (count - 2)

    def delay(t, tx, rx):
        t = np.asarray(t)
        away = start_range[:, None] + speed[:, None] * t + 0.5 * acceleration * t**2
        return 2 * (away + 0.01 * (tx + rx)) / SPEED_OF_LIGHT

    knots = np.linspace(0, radar.waveform.frame_length, count)
    found = synthesize(radar, make_paths(radar, gain, delay, knots), 0.0, eps=1e-7)
    assert relative(found, direct_sum(radar, delay, gain)) < 1e-6


def test_gain_changes_over_the_band_as_the_paths_say():
    """Dispersion is a polynomial in the frequency at which what arrives was sent, conjugated by the mixer."""
    rng = np.random.default_rng(5)
    radar = small_radar(loops=2)
    gain, slope = random_gains(rng, radar, 5), random_gains(rng, radar, 5)
    tau0 = 2 * rng.uniform(1, 9, 5) / SPEED_OF_LIGHT

    def delay(t, tx, rx):
        return np.repeat(tau0[:, None], len(np.atleast_1d(t)), axis=1)

    paths = make_paths(radar, gain, delay, np.array([0.0]), dispersion=slope[None, ..., None].copy())
    sloped = direct_sum(radar, delay, slope, offset=(paths.frequency, paths.half_band))
    assert relative(synthesize(radar, paths, 0.0), direct_sum(radar, delay, gain) + sloped) < 1e-6


@pytest.mark.parametrize("speed", [0.0, 3.0])
@pytest.mark.parametrize("depth", [0.0015, 0.015])
def test_a_gain_that_turns_over_the_band_is_a_longer_way(depth, speed):
    """exp(-j 2 pi f d) in the gain of a path of delay tau is a path of delay tau + d, but for pi mu d^2: what arrives
    is of the frequency that the chirp had when it was sent. By that of its arrival it would be 2 pi mu tau d off, 0.2 %
    at 7.5 m for 15 mm."""
    radar = small_radar(loops=3)
    more, tau0 = 2 * depth / SPEED_OF_LIGHT, 2 * 7.5 / SPEED_OF_LIGHT
    half_band, frequency = 0.5 * radar.waveform.bandwidth, radar.center_frequency

    def delay(t, tx, rx):
        return np.full((1, len(np.atleast_1d(t))), tau0) + 2 * speed / SPEED_OF_LIGHT * np.atleast_1d(t)

    ones = np.ones((3, 4, 1), complex)
    turns = [(-2j * np.pi * half_band * more) ** n / math.factorial(n) for n in range(1, 16)]
    knots = np.linspace(0.0, radar.waveform.frame_length, 5) if speed else np.zeros(1)
    gain = ones * np.exp(-2j * np.pi * frequency * more)
    dispersion = np.stack([np.repeat(turn * gain[..., None], len(knots), axis=3) for turn in turns])
    paths = make_paths(radar, gain, delay, knots, dispersion=dispersion)
    truth = direct_sum(radar, lambda *at: delay(*at) + more, ones)
    bound = np.pi * radar.waveform.slope * more**2
    assert relative(synthesize(radar, paths, 0.0, eps=1e-10), truth) < bound + 1e-7
    assert bound < 0.02 * 2 * np.pi * radar.waveform.slope * tau0 * more


@pytest.mark.parametrize("speed", [0.0, 2.0])
@pytest.mark.parametrize("dispersed", [False, True])
def test_gains_change_within_a_chirp_too(speed, dispersed):
    """At 10 Hz the bend over half the ADC window, (29 us x 2 pi 10 Hz)^2 / 2, is 1.7e-6; held gains err by 1e-3."""
    rng = np.random.default_rng(9)
    radar = small_radar(loops=6)
    gain, slope = random_gains(rng, radar, 5), random_gains(rng, radar, 5)
    tau0, phase = 2 * rng.uniform(1, 9, 5) / SPEED_OF_LIGHT, rng.uniform(0, 6, 5)
    rate = 2 * speed * rng.normal(size=5) / SPEED_OF_LIGHT
    omega = 2 * np.pi * 10

    def delay(t, tx, rx):
        return tau0[:, None] + rate[:, None] * (np.atleast_1d(t) - 0.1)

    def course(t):
        return 1 + 0.9 * np.exp(1j * (omega * np.atleast_1d(t) + phase[:, None]))

    knots = np.linspace(0.1, 0.1 + radar.waveform.frame_length, 17)
    still = make_paths(radar, gain, delay, knots, dispersion=slope[None, ..., None].copy() if dispersed else None)
    changes = {"a": still.a * course(knots)}
    truth = direct_sum(radar, delay, gain, 0.1, course)
    if dispersed:
        changes["dispersion"] = still.dispersion * course(knots)
        truth = truth + direct_sum(radar, delay, slope, 0.1, course, (still.frequency, still.half_band))
    assert relative(synthesize(radar, replace(still, **changes), 0.1, eps=1e-8), truth) < 2e-6
    assert relative(synthesize(radar, replace(still, **changes), 0.1), truth) < 4e-6
    held = direct_sum(radar, delay, gain * course(np.array([0.1]))[:, 0], 0.1)
    assert dispersed or relative(held, truth) > 1e-3


@pytest.mark.parametrize("eps", [1e-3, 1e-4, 1e-6])
def test_accuracy_is_what_was_asked_for(eps):
    rng = np.random.default_rng(7)
    radar = small_radar(loops=4)
    gain = random_gains(rng, radar, 200)
    tau0 = 2 * rng.uniform(0.05, 11, 200) / SPEED_OF_LIGHT
    rate = 2 * rng.uniform(-5, 5, 200) / SPEED_OF_LIGHT

    def delay(t, tx, rx):
        return tau0[:, None] + rate[:, None] * t

    found = synthesize(radar, make_paths(radar, gain, delay, np.array([0.0])), 0.0, eps=eps)
    assert relative(found, direct_sum(radar, delay, gain)) < 3 * eps


def test_still_paths_repeat_in_every_chirp():
    radar = small_radar()
    gain = random_gains(np.random.default_rng(0), radar, 3)
    paths = make_paths(radar, gain, lambda t, tx, rx: np.full((3, len(t)), 2e-8), np.array([0.0]))
    samples = synthesize(radar, paths, 5.0)
    np.testing.assert_array_equal(samples, np.broadcast_to(samples[:1], samples.shape))


def test_knots_must_cover_the_frame():
    radar = small_radar()
    gain = random_gains(np.random.default_rng(0), radar, 1)
    paths = make_paths(radar, gain, lambda t, tx, rx: np.full((1, len(t)), 2e-8), np.array([0.0, 1e-4]))
    with pytest.raises(ValueError, match=r"paths\.times cover"):
        synthesize(radar, paths, 0.0)


BAD_NUMBERS = ["x", None, np.nan, np.inf, 1j, True, np.array([0.1, 0.2])]


@pytest.mark.parametrize(
    ("argument", "value", "error"),
    [
        ("radar", "awr1843", TypeError),
        ("radar", None, TypeError),
        ("paths", None, TypeError),
        ("paths", [1.0], TypeError),
        *(("start", value, ValueError) for value in [*BAD_NUMBERS, 1e300, 2**70, -(10**400)]),
        *(("eps", value, ValueError) for value in [*BAD_NUMBERS, 0.0, 0.31, 10**400]),
        *(("tx_gains", value, ValueError) for value in [["a"] * 3, [1, np.nan, 1], [1, 1], "x", 1.0, [None] * 3]),
        *(("device", value, ValueError) for value in ["gpu", None, np.array(["cpu", "cpu"])]),
    ],
)
def test_what_nothing_can_be_synthesised_of_is_named(argument, value, error):
    radar = small_radar()
    gain = random_gains(np.random.default_rng(0), radar, 1)
    paths = make_paths(radar, gain, lambda t, tx, rx: np.full((1, len(t)), 2e-8), np.array([0.0]))
    with pytest.raises(error, match=rf"^{argument} (is|has)"):
        synthesize(**{"radar": radar, "paths": paths, "start": 0.0, argument: value})


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("field", ["a", "tau", "tau_rate", "times", "direction", "arrival", "dispersion"])
def test_paths_that_are_not_finite_are_named(field, value):
    radar = small_radar()
    gain = random_gains(np.random.default_rng(0), radar, 3)
    curve = np.zeros((1, *gain.shape, 1), complex)
    paths = make_paths(radar, gain, lambda t, tx, rx: np.full((3, len(t)), 2e-8), np.array([0.0]), curve)
    wrong = np.array(getattr(paths, field))
    wrong.flat[-1] = value
    with pytest.raises(ValueError, match=rf"^paths\.{field} has 1 values that are NaN or infinite"):
        synthesize(radar, replace(paths, **{field: wrong}), 0.0)


def test_infinities_of_both_signs_are_found_and_large_values_are_none():
    radar = small_radar()
    gain = random_gains(np.random.default_rng(0), radar, 2)
    paths = make_paths(radar, gain, lambda t, tx, rx: np.full((2, len(t)), 2e-8), np.array([0.0]))
    with pytest.raises(ValueError, match=r"paths\.a has 24 values"):
        synthesize(radar, replace(paths, a=paths.a + np.array([np.inf, -np.inf])[:, None]), 0.0)
    check_synthesis(radar, replace(paths, a=np.full_like(paths.a, 1.7e308)), 0.0, 1e-6, None)


@pytest.mark.parametrize("start", [1e9, np.float32(3), np.int64(-7), 10**9])
def test_a_frame_may_start_at_any_time_of_a_clock(start):
    radar = small_radar()
    gain = random_gains(np.random.default_rng(0), radar, 1)
    paths = make_paths(radar, gain, lambda t, tx, rx: np.full((1, len(t)), 2e-8), np.array([0.0]))
    assert np.isfinite(synthesize(radar, paths, start)).all()


def test_no_paths_no_signal():
    radar = small_radar()
    paths = make_paths(radar, np.zeros((3, 4, 0)), lambda t, tx, rx: np.zeros((0, len(t))), np.array([0.0]))
    assert not synthesize(radar, paths, 0.0).any()


def test_noise_floor_is_ktbf():
    """-174 dBm/Hz + NF + 10 log10(B) within 0.05 dB, flat, I and Q independent, repeatable from seed and frame."""
    radar = Radar.load("awr1843")
    noise = np.zeros((400, 3, 4, 256), complex)
    add_thermal_noise(noise, radar, seed=1, frame=0)
    floor = -173.975 + radar.noise_figure_db + 10 * np.log10(radar.waveform.sample_rate)
    assert 10 * np.log10(np.mean(np.abs(noise) ** 2)) + 30 == pytest.approx(floor, abs=0.05)
    assert 10 * np.log10(noise_power(radar)) + 30 == pytest.approx(floor, abs=0.01)
    spectrum = np.mean(np.abs(np.fft.fft(noise, axis=-1)) ** 2, axis=(0, 1, 2))
    assert np.ptp(10 * np.log10(spectrum)) < 1.0  # 4,800 averages: 0.06 dB standard deviation
    assert abs(np.mean(noise.real * noise.imag)) < 4e-3 * np.mean(np.abs(noise) ** 2)
    again, other = np.zeros_like(noise), np.zeros_like(noise)
    add_thermal_noise(again, radar, seed=1, frame=0)
    add_thermal_noise(other, radar, seed=1, frame=1)
    np.testing.assert_array_equal(noise, again)
    assert not np.array_equal(noise, other)
