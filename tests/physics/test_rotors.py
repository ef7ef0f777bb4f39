"""Rotors: samples against the sum of all paths at each time, and the micro-Doppler of the tips."""

import numpy as np
import pytest
import trimesh

import rfgen_sionna as rfgen
from rfgen_sionna.signal import synthesize

SPEED_OF_LIGHT = 299792458.0
HUB = np.array([3.0, 0.0, 1.0])
TIP = 0.13
"""Radius of the rotor [m]."""


def blade_mesh():
    """Blade from 1 to 13 cm along x, 2 cm wide and pitched by 12°."""
    mesh = trimesh.creation.box((0.12, 0.02, 0.003))
    mesh.apply_translation((0.07, 0, 0))
    return mesh.apply_transform(trimesh.transformations.rotation_matrix(np.radians(12), (1, 0, 0), (0, 0, 0)))


def blade(number, rate, of=2, mesh=None):
    """One of several blades around the hub; `rate` in turns a second."""

    def pose(t):
        return HUB, (2 * np.pi * (rate * t + number / of), 0, 0)

    shape = blade_mesh() if mesh is None else mesh
    return rfgen.Actor.from_mesh(shape, material="metal", name=f"blade {number}", trajectory=pose)


def radar_24(loops):
    """Continuous wave at 24 GHz, whose samples are evenly spaced over the frame."""
    chosen = {"preset.doppler.num_loops": loops}
    return rfgen.Radar.load("position2go", preset="doppler", overrides=chosen, position=(0, 0, 0.7), look_at=(3, 0, 1))


def samples_by_instants(simulator, times):
    """(time,) samples of the first element pair by all paths at each of the `times` [s], up to a factor."""
    frequency, found = simulator.radar.waveform.start_frequency, []
    for t in times.tolist():
        paths = simulator.paths(t)
        waves = paths.a[0, 0, :, 0] * np.exp(-2j * np.pi * frequency * paths.tau[0, 0, :, 0])
        found.append(np.conj(waves.sum()))
    return np.array(found)


def compared(rate, blades, loops, step, rtol=0.02):
    """Error of every `step`-th chirp's samples, relative to their root mean square, and the report's."""
    actors = [blade(number, rate, blades) for number in range(blades)]
    simulator = rfgen.Simulator(None, radar_24(loops), actors, rtol=rtol)
    (frame,) = simulator.frames(simulator.radar.waveform.frame_period, noise=False)
    waveform = simulator.radar.waveform
    begin = waveform.chirp_times[::step, 0] + waveform.adc_start_time
    # The first, a middle and the last sample of the chirp: its phase is far from quadratic.
    some = np.arange(len(begin)) % 3 * (waveform.num_samples // 2 - 1)
    found = frame.samples[::step, 0, 0][np.arange(len(begin)), some]
    instants = rfgen.Simulator(None, radar_24(loops), actors, rtol=min(rtol, 0.02))
    truth = samples_by_instants(instants, begin + some / waveform.sample_rate)
    scale = np.vdot(truth, found) / np.vdot(truth, truth)
    missed = np.linalg.norm(found - scale * truth) / np.linalg.norm(found)
    return missed, frame.report


@pytest.mark.parametrize("rate", [pytest.param(50.0, marks=pytest.mark.slow), 100.0])
def test_samples_of_a_rotor_are_the_sum_of_its_paths(rate):
    """Of a blade at 50 and 100 turns a second, to a few per cent; the report states no less."""
    missed, report = compared(rate, 1, 24, 2)
    assert missed < 0.03
    assert np.hypot(report.error, report.time_error) < 0.1
    assert missed < 3 * (report.error + report.time_error) + 0.005


@pytest.mark.slow
@pytest.mark.parametrize("rate", [5.0, 20.0, 150.0])
def test_samples_of_two_blades(rate):
    missed, _ = compared(rate, 2, 128, 4)
    assert missed < 0.04


@pytest.mark.parametrize("rtol", [0.1, 0.3])
def test_coarse_tolerances_follow_a_rotor_as_well(rtol):
    """100 turns a second, between knots that a walk has at these tolerances: each is over half a turn long."""
    missed, report = compared(100.0, 1, 24, 2, rtol)
    assert missed < rtol
    assert np.hypot(report.error, report.time_error) < 3 * rtol


def test_micro_doppler_ends_at_the_speed_of_the_tip():
    rate, radar = 100.0, radar_24(64)
    (frame,) = rfgen.Simulator(None, radar, [blade(0, rate)], rtol=0.02).frames(0.1, noise=False)
    signal, waveform = frame.samples[:, 0, 0].ravel(), radar.waveform
    power = np.abs(np.fft.fft(signal * np.hanning(len(signal)))) ** 2
    doppler = np.abs(np.fft.fftfreq(len(signal), 1 / waveform.sample_rate))
    extent = 2 * 2 * np.pi * rate * TIP * waveform.start_frequency / SPEED_OF_LIGHT
    assert power[doppler > 1.1 * extent].sum() < 1e-3 * power.sum()
    assert power[(doppler > 0.8 * extent) & (doppler < extent)].sum() > 1e-2 * power.sum()


def test_finely_meshed_blades_keep_up_with_their_turn():
    """Small facets need no limits, yet sample times that follow how they come into view and leave it."""
    rotor = blade(0, 100.0, mesh=blade_mesh().subdivide_to_size(0.012))
    simulator = rfgen.Simulator(None, radar_24(16), [rotor], rtol=0.02)
    (frame,) = simulator.frames(0.1, noise=False)
    begin = simulator.radar.waveform.chirp_times[::2, 0]
    truth, found = samples_by_instants(simulator, begin), frame.samples[::2, 0, 0, 0]
    scale = np.vdot(truth, found) / np.vdot(truth, truth)
    assert np.linalg.norm(found - scale * truth) < 0.04 * np.linalg.norm(found)


def test_flashes_of_a_rotor_are_summed_within_the_tolerance():
    """A blade that is specular for less than a chirp: its gain changes within the chirp."""
    radar, eps = radar_24(24), 5e-3
    traced = rfgen.Simulator(None, radar, [blade(0, 100.0)], rtol=0.02).tracer.trace(0.0, radar.waveform.frame_length)
    coarse, fine = (
        sum(synthesize(radar, paths, 0.0, eps=each, device="cpu") for paths in traced.actors) for each in (eps, 1e-5)
    )
    assert np.linalg.norm(coarse - fine) < eps * np.linalg.norm(fine)
