"""The receiver as a whole: noise floor, radar equation, draws that leave each other alone, what it refuses."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import fields, replace

import numpy as np
import pytest

from rfgen_sionna._types import SPEED_OF_LIGHT
from rfgen_sionna.radar import Radar
from rfgen_sionna.records import PathKind, RadarPaths
from rfgen_sionna.resources import resolve
from rfgen_sionna.signal import (
    Chassis,
    Coupling,
    DcOffset,
    Interferer,
    IqImbalance,
    Leakage,
    Mismatch,
    PhaseNoise,
    RampError,
    RangeBias,
    Receiver,
    receive,
    synthesize,
)

IDEAL = Receiver.ideal()


@pytest.fixture(scope="module")
def impairments(small):
    """One of each, as fields of a receiver."""
    radar = small()
    wave = replace(radar.waveform, slope=30e12, frame_period=radar.waveform.frame_length)  # no pause
    other = replace(radar, waveform=wave).placed(position=(9, 1, 0), look_at=(0, 0, 0))
    return {
        "leakage": Leakage(-30.0, 0.05),
        "chassis": Chassis(-50.0, 0.03),
        "range_bias": RangeBias(0.065),
        "ramp_error": RampError((0.0, 1e5)),
        "phase_noise": PhaseNoise(((1e5, -80.0), (1e6, -100.0))),
        "interferers": (Interferer(other, received_dbm=-60.0),),
        "coupling": Coupling.of_neighbours(radar, -20.0),
        "thermal_noise": True,
        "mismatch": Mismatch(gain_spread_db=0.5, phase_spread_deg=5.0),
        "iq_imbalance": IqImbalance(0.3, 2.0),
        "dc_offset": DcOffset(-50.0),
        "adc": "radar",
    }


def test_noise_floor(small):
    """-174 dBm/Hz + NF + 10 log10(bandwidth) within 0.3 dB, in every range bin too, quantised as in the presets.

    256 loops x 12 channels: one sigma is 0.08 dB in a bin, 0.005 dB over all.
    """
    radar = small(loops=256)
    noise = receive(np.zeros((256, 3, 4, 256), complex), radar, Receiver(), seed=1).samples
    floor = -173.975 + radar.noise_figure_db + 10 * np.log10(radar.waveform.sample_rate)
    assert 10 * np.log10(np.mean(np.abs(noise) ** 2)) + 30 == pytest.approx(floor, abs=0.03)
    spectrum = np.mean(np.abs(np.fft.fft(noise, axis=-1)) ** 2, axis=(0, 1, 2)) / 256
    assert np.abs(10 * np.log10(spectrum) + 30 - floor).max() < 0.3
    i, q = noise.real, noise.imag
    assert abs(np.mean(i * q)) < 4e-3 * np.mean(i * i)
    assert np.mean(i * i) == pytest.approx(np.mean(q * q), rel=0.01)
    for lag in range(1, 5):
        assert abs(np.mean(noise[..., lag:] * noise[..., :-lag].conj())) < 5e-3 * np.mean(np.abs(noise) ** 2)


def far_radar(tmp_path):
    """A file of one's own whose range window reaches 37 m."""
    text = resolve("radars", "awr1843").read_text(encoding="utf-8")
    text = text.replace("slope_hz_per_s = 60.012e12", "slope_hz_per_s = 20.0e12")
    text = text.replace("sample_rate_hz = 4.4e6", "sample_rate_hz = 5.0e6").replace("num_loops = 128", "num_loops = 32")
    path = tmp_path / "far.toml"
    path.write_text(text, encoding="utf-8")
    return Radar.load(path, "mmmesh")


@pytest.mark.parametrize("distance", [1.0, 3.0, 10.0, 30.0])
def test_signal_to_noise_follows_the_radar_equation(tmp_path, distance):
    """P G^2 lambda^2 sigma / ((4 pi)^3 R^4) over kTBF for 10 m^2, through noise and ADC, within 0.5 dB.

    The level is read off by a matched filter over the frame's 98,304 samples: 30 dB above the noise it leaves at 30 m.
    """
    radar = far_radar(tmp_path)
    assert radar.max_range > 31
    sigma, tau = 10.0, 2 * distance / SPEED_OF_LIGHT
    gain = np.sqrt(sigma * radar.wavelength**2 / ((4 * np.pi) ** 3 * distance**4))
    ahead = np.array([[[1.0, 0.0, 0.0]]])
    index = np.zeros(1, np.int32)
    paths = RadarPaths(
        a=np.full((3, 4, 1, 1), gain, complex),
        tau=np.full((3, 4, 1, 1), tau),
        tau_rate=np.zeros((3, 4, 1, 1)),
        times=np.zeros(1),
        frequency=radar.center_frequency,
        direction=ahead,
        arrival=ahead,
        object_id=index,
        part_id=index,
        kind=np.full(1, PathKind.SPECULAR, np.uint8),
        bounces=np.ones(1, np.uint8),
        object_names=("reflector",),
        part_names=("reflector",),
        facet=index,
    )
    clean = synthesize(radar, paths, 0.0)
    noisy = receive(clean, radar, Receiver(), seed=5).samples
    t = radar.waveform.sample_times
    template = np.exp(2j * np.pi * radar.waveform.slope * tau * t)
    signal = np.abs(np.mean(noisy * template.conj())) ** 2
    noise = np.mean(np.abs(noisy - clean) ** 2)
    directive = 2 * radar.pattern.gain_db(np.array([1.0, 0, 0]))
    received = (
        radar.tx_power_dbm + directive + 10 * np.log10(radar.wavelength**2 * sigma / ((4 * np.pi) ** 3 * distance**4))
    )
    floor = -173.975 + radar.noise_figure_db + 10 * np.log10(radar.waveform.sample_rate)
    assert 10 * np.log10(signal / noise) == pytest.approx(received - floor, abs=0.5)


def test_all_is_off_but_noise_and_adc(small, echoes):
    radar = small()
    samples = echoes(radar, [2.0, 5.0])
    np.testing.assert_array_equal(receive(samples, radar, IDEAL).samples, samples)
    default = Receiver()
    on = {field.name for field in fields(default) if getattr(default, field.name) not in (None, ())}
    assert on == {"thermal_noise", "adc"}


def test_every_impairment_changes_the_samples(small, echoes, impairments):
    radar = replace(small(), tx_power_dbm=10.0)
    samples = echoes(radar, [2.0, 5.0])
    assert set(impairments) == {field.name for field in fields(Receiver)}
    for name, value in impairments.items():
        out = receive(samples, radar, replace(IDEAL, **{name: value}), seed=1).samples
        assert np.abs(out - samples).max() > 1e-12, name


@pytest.mark.parametrize("drawn", ["thermal_noise", "interferers", "mismatch", "dc_offset", "phase_noise"])
def test_one_impairment_leaves_the_draws_of_another_alone(small, echoes, impairments, drawn):
    """What additive ones add, and what multiplicative ones multiply with, is the same beside any other."""
    radar = small(loops=2)
    samples = echoes(radar, [2.0, 5.0])
    alone = receive(samples, radar, replace(IDEAL, **{drawn: impairments[drawn]}), seed=3, frame=2).samples
    for other in ("thermal_noise", "interferers", "dc_offset", "phase_noise"):
        if other == drawn:
            continue
        pair = replace(IDEAL, **{drawn: impairments[drawn], other: impairments[other]})
        without = receive(samples, radar, replace(IDEAL, **{other: impairments[other]}), seed=3, frame=2).samples
        both = receive(samples, radar, pair, seed=3, frame=2).samples
        if "mismatch" not in (drawn, other):
            np.testing.assert_allclose(both - without, alone - samples, atol=1e-12)
        elif other == "phase_noise":
            np.testing.assert_allclose(both / without, alone / samples, rtol=1e-9)


def test_the_same_seed_and_frame_give_the_same_samples(small, echoes, impairments):
    radar = small(loops=2)
    samples = echoes(radar, [2.0, 5.0])
    full = Receiver(**impairments)
    one = receive(samples, radar, full, seed=8, frame=1)
    np.testing.assert_array_equal(one.samples, receive(samples, radar, full, seed=8, frame=1).samples)
    for seed, frame in ((9, 1), (8, 2)):
        assert np.abs(one.samples - receive(samples, radar, full, seed=seed, frame=frame).samples).max() > 1e-6


@pytest.mark.parametrize("drawn", ["thermal_noise", "interferers", "mismatch", "dc_offset", "phase_noise"])
def test_radars_of_one_scene_draw_independently(small, echoes, impairments, drawn):
    """Under the same seed and frame: by name or by pose."""
    radar = small(loops=2)
    samples = echoes(radar, [2.0, 5.0])
    receiver = replace(IDEAL, **{drawn: impairments[drawn]})
    one = receive(samples, radar, receiver, seed=8).samples - samples
    for other in (
        replace(radar, name="mine"),
        radar.placed(position=(0.0, 0.0, 1e-5)),
        radar.placed(orientation=(0.0, 1e-5, 0.0)),
    ):
        two = receive(samples, other, receiver, seed=8).samples - samples
        changed = np.abs(one - two) > 1e-3 * np.abs(one).max()
        # Of an interferer's chirp the ADC sees a part.
        assert changed.mean() > (0.05 if drawn == "interferers" else 0.5)
        if drawn == "thermal_noise":
            assert abs(np.vdot(one, two)) < 0.03 * np.vdot(one, one).real
    again = radar.placed(position=(0.0, 0.0, 1e-9))  # the last digits of a pose do not matter
    if drawn != "interferers":
        np.testing.assert_array_equal(receive(samples, again, receiver, seed=8).samples - samples, one)


def test_order_and_threads_change_no_sample(small, echoes, impairments):
    """Random interleavings of two radars, seeds and frames on four threads, each to the bit as alone."""
    base = small(loops=2)
    radars = [base, base.placed(position=(1.0, 0.0, 0.5)), replace(base, name="third")]
    samples = echoes(base, [2.0, 5.0])
    full = Receiver(**(impairments | {"interferers": ()}))
    jobs = [(radar, seed, frame) for radar in range(3) for seed in (0, 5) for frame in range(3)]

    def run(job):
        radar, seed, frame = job
        return receive(samples, radars[radar], full, seed=seed, frame=frame).samples

    alone = {job: run(job) for job in jobs}
    shuffled = [jobs[index] for index in np.random.default_rng(2).permutation(len(jobs))]
    with ThreadPoolExecutor(4) as pool:
        for job, result in zip(shuffled, pool.map(run, shuffled), strict=True):
            np.testing.assert_array_equal(result, alone[job])
    assert len({result.tobytes() for result in alone.values()}) == len(jobs)


def test_noise_passes_the_rx_chain_and_leakage_the_antennas(small):
    """Order: noise after coupling (independent between ports), before IQ imbalance; leakage before coupling."""
    radar = small(loops=64)
    silent = np.zeros((64, 3, 4, 256), complex)
    coupling = Coupling(((1, 0.5, 0, 0), (0.5, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1)))
    noise = receive(silent, radar, replace(IDEAL, thermal_noise=True, coupling=coupling)).samples
    power = np.mean(np.abs(noise) ** 2)
    assert abs(np.mean(noise[:, :, 0] * noise[:, :, 1].conj())) < 0.02 * power
    skewed = receive(silent, radar, replace(IDEAL, thermal_noise=True, iq_imbalance=IqImbalance(6.0))).samples
    assert np.var(skewed.imag) / np.var(skewed.real) == pytest.approx(10**0.6, rel=0.02)
    leak = receive(silent, radar, replace(IDEAL, leakage=Leakage(-30.0))).samples
    coupled = receive(silent, radar, replace(IDEAL, leakage=Leakage(-30.0), coupling=coupling)).samples
    np.testing.assert_allclose(coupled[:, :, 0], leak[:, :, 0] + 0.5 * leak[:, :, 1], rtol=1e-9)


def test_what_cannot_be_is_refused(small):
    radar = small()
    samples = np.zeros((4, 3, 4, 256), complex)
    with pytest.raises(ValueError, match=r"samples have the shape \(4, 3, 4, 255\).*\(4, 3, 4, 256\)"):
        receive(samples[..., 1:], radar, IDEAL)
    for seed in (-1, 1.5, True):
        with pytest.raises(ValueError, match=f"seed is {seed!r}"):
            receive(samples, radar, IDEAL, seed=seed)
    with pytest.raises(TypeError, match=r"receiver.leakage is -40: None or a Leakage"):
        Receiver(leakage=-40)
    with pytest.raises(TypeError, match=r"receiver.interferers"):
        Receiver(interferers=3)
    with pytest.raises(TypeError, match=r"receiver.adc is 16"):
        Receiver(adc=16)
    with pytest.raises(TypeError, match=r"receiver.thermal_noise is 1"):
        Receiver(thermal_noise=1)
