"""One mixer and one converter: half the range axis; level, phase, velocity, noise and place are those of I and Q."""

from dataclasses import replace

import numpy as np
import pytest

from rfgen_sionna.processing.azimuth import drai, range_azimuth
from rfgen_sionna.processing.demultiplex import demultiplex
from rfgen_sionna.processing.pointcloud import point_cloud
from rfgen_sionna.processing.spectrogram import doppler_time, micro_doppler, range_time
from rfgen_sionna.processing.spectrum import (
    check_cube,
    observation_time,
    range_axis,
    range_doppler,
    range_spectrum,
)
from rfgen_sionna.radar import Adc
from rfgen_sionna.radar.slots import coded_slots, doppler_slot, hadamard_code


@pytest.fixture(scope="module")
def real(mmmesh):
    return replace(mmmesh, adc=Adc(16, real=True))


def downward(radar):
    wave = radar.waveform
    start = wave.start_frequency + wave.slope * wave.ramp_end_time
    return replace(radar, waveform=replace(wave, start_frequency=start, slope=-wave.slope))


def with_slots(radar, slots):
    return replace(radar, waveform=replace(radar.waveform, tx_order=(), slots=tuple(slots)))


def test_the_range_axis_is_half_as_long_with_the_same_steps(mmmesh, real):
    whole, half = range_axis(mmmesh), range_axis(real)
    assert len(half) == len(whole) // 2 + 1
    np.testing.assert_allclose(half[:-1], whole[: len(half) - 1])
    assert half[-1] == pytest.approx(real.max_range)
    assert real.max_range == pytest.approx(mmmesh.max_range / 2)
    assert real.range_resolution == mmmesh.range_resolution


@pytest.mark.parametrize("window", ["hann", "blackman"])
@pytest.mark.parametrize("turn", [lambda radar: radar, downward], ids=["up", "down"])
def test_spectra_are_those_of_complex_samples(synthesise, mmmesh, real, turn, window):
    targets = [((2.0, 0.7, 0.1), (1.1, -0.4, 0), 1.0), ((3.6, -1.2, 0.3), (-0.9, 0, 0), 0.3j)]
    options = {"range_window": window, "correct_coupling": True, "correct_migration": True}
    maps = {
        radar.adc.real: range_doppler(synthesise(radar, targets)[0], radar, **options)
        for radar in (turn(mmmesh), turn(real))
    }
    near = slice(20, 115)  # away from both ends, where the image of a beat leaks
    difference = maps[True].spectrum[..., near] - maps[False].spectrum[..., near]
    assert np.abs(difference).max() < 1e-3 * np.abs(maps[False].spectrum).max()


def test_signal_to_noise_is_that_of_complex_samples(synthesise, mmmesh, real):
    level, snr = 1e-3, []
    for radar in (mmmesh, real):
        noise = range_spectrum(synthesise(radar, [], noise=0.3, seed=4)[0], radar)[..., 10:110]
        tone = range_spectrum(synthesise(radar, [((50 * radar.range_resolution, 0, 0), (0, 0, 0), level)])[0], radar)
        snr.append(np.abs(tone[..., 50]).mean() ** 2 / np.mean(np.abs(noise) ** 2))
    assert 10 * np.log10(snr[1] / snr[0]) == pytest.approx(0, abs=0.08), "three deviations of 1e5 cells of noise"


@pytest.mark.parametrize("turn", [lambda radar: radar, downward], ids=["up", "down"])
@pytest.mark.parametrize("seed", range(4))
def test_points_are_where_the_targets_are(synthesise, real, seed, turn):
    radar = turn(real)
    rng = np.random.default_rng(seed)
    distance, speed = rng.uniform(0.5, 0.9 * radar.max_range), rng.uniform(-0.9, 0.9) * radar.max_velocity
    azimuth, elevation = rng.uniform(-1, 1), rng.uniform(-0.5, 0.5)
    where = np.array([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)])
    start = where * (distance - speed * observation_time(radar))
    cloud = point_cloud(synthesise(radar, [(start, speed * where, 1e-3)])[0], radar, static=True)
    assert len(cloud) == 1
    assert abs(cloud.range[0] - distance) < 0.1 * radar.range_resolution
    assert abs(cloud.velocity[0] - speed) < 0.1 * radar.velocity_resolution
    found = cloud.device[0] / cloud.range[0]
    assert np.abs(found[1:] - where[1:]).max() < 0.1 / 4
    assert 10 * np.log10(cloud.power[0] / 1e-6) == pytest.approx(0, abs=0.1)


def test_noise_alone_has_few_points_and_a_target_the_ratio_of_its_energy(synthesise, real):
    where = np.array([2.5, 0.5, 0.0])
    cube = synthesise(real, [(where, (1.0, 0, 0), 3e-3)], noise=3e-3, seed=1)[0]
    cloud = point_cloud(cube, real, false_alarm=1e-8)
    assert len(cloud) == 1
    cells = cube.shape[0] * cube.shape[-1]
    # Hann's equivalent noise bandwidth is 1.5 bins along each axis.
    assert cloud.snr_db[0] == pytest.approx(10 * np.log10(cells / 1.5**2), abs=0.7)
    assert len(point_cloud(synthesise(real, [], noise=3e-3, seed=2)[0], real, false_alarm=1e-8)) == 0


def test_spectrograms_and_images_are_those_of_complex_samples(synthesise, mmmesh, real):
    targets = [((2.0, 0.6, 0), (1.0, 0.3, 0), 1e-3)]
    cubes = {radar: synthesise(radar, targets, frames=2) for radar in (mmmesh, real)}
    for image in (range_time, doppler_time, micro_doppler):
        whole, half = (image(cube, radar).power for radar, cube in cubes.items())
        columns = slice(half.shape[1] - 1 if image is range_time else None)
        np.testing.assert_allclose(half[:, columns], whole[:, columns], atol=3e-3 * whole.max())
    whole, half = (range_azimuth(cube[0], radar).power for radar, cube in cubes.items())
    np.testing.assert_allclose(half[:-1], whole[: len(half) - 1], atol=3e-3 * whole.max())
    whole, half = (drai(cube, radar, range_bins=64).image for radar, cube in cubes.items())
    np.testing.assert_allclose(half, whole, atol=3e-3 * whole.max())


@pytest.mark.parametrize("turn", [lambda radar: radar, downward], ids=["up", "down"])
@pytest.mark.parametrize("scheme", ["bpm", "ddm"])
def test_codes_and_doppler_bands_of_real_samples(synthesise, real, scheme, turn):
    """An AWR2944 has both: Tx elements in Doppler bands, and one converter for each Rx element."""
    order = turn(real)
    tdm = replace(order, waveform=replace(order.waveform, num_loops=64, tx_order=(0, 1, 2)))
    slots = [doppler_slot(4, range(3), 3)] if scheme == "ddm" else coded_slots(hadamard_code(3), range(3), 3)
    radar = with_slots(tdm, slots)
    wave = radar.waveform
    # Each Tx element alone in every slot's time, weighted as the slot radiates it.
    where, speed, level = np.array([2.2, 0.8, 0.25]), 0.4 * radar.max_velocity, 1e-3
    direction = where / np.linalg.norm(where)
    start = where - speed * direction * observation_time(radar)
    fast = wave.adc_start_time + np.arange(wave.num_samples) / wave.sample_rate
    cube = np.zeros(radar.frame_shape, complex)
    for entry in range(cube.shape[1]):
        t = wave.chirp_times[:, entry, None] + fast
        point = start + t[..., None] * speed * direction
        weights = np.broadcast_to(wave.axis_weights[:, entry], (wave.num_loops, 3))
        for tx in range(3):
            for rx in range(4):
                path = np.linalg.norm(point - radar.tx_positions[tx], axis=-1)
                tau = (path + np.linalg.norm(point - radar.rx_positions[rx], axis=-1)) / 299_792_458.0
                turns = wave.start_frequency * tau + wave.slope * fast * tau - 0.5 * wave.slope * tau**2
                cube[:, entry, rx] += level * np.conj(weights[:, tx, None]) * np.exp(2j * np.pi * (turns % 1))
    samples = (np.sqrt(2) * cube.real).astype(np.float32)
    distance = np.linalg.norm(where)
    for given, its_radar in ((samples, radar), demultiplex(samples, radar)):
        assert given.dtype == np.float32
        cloud = point_cloud(given, its_radar, static=True, dynamic_range_db=20)
        assert abs(cloud.range[0] - distance) < 0.1 * radar.range_resolution
        assert abs(cloud.velocity[0] - speed) < 0.1 * radar.velocity_resolution
        np.testing.assert_allclose(cloud.device[0] / cloud.range[0], direction, atol=0.1 / 4)


def test_samples_of_the_wrong_kind_are_refused(mmmesh, real):
    shape = real.frame_shape
    with pytest.raises(ValueError, match=r"complex64: radar .* has a real ADC \(adc.real\)"):
        check_cube(np.zeros(shape, np.complex64), real)
    with pytest.raises(ValueError, match=r"int16: radar .* has a real ADC"):
        check_cube(np.zeros(shape, np.int16), real)
    with pytest.raises(ValueError, match=r"float32: complex .* need a radar with adc.real"):
        check_cube(np.zeros(shape, np.float32), mmmesh)


def test_a_constant_frequency_leaves_the_sign_of_a_velocity_open(synthesise, real):
    wave = replace(real.waveform, slope=0.0, range_limit=5.0)
    radar = replace(real, waveform=wave)
    maps = range_doppler(synthesise(radar, [((2, 0, 0), (1.0, 0, 0), 1.0)])[0], radar)
    power = maps.power[0]
    there, mirrored = (power[np.abs(maps.velocity - v).argmin()] for v in (1.0, -1.0))
    assert there == pytest.approx(mirrored, rel=1e-3)
    assert there > 0.5
