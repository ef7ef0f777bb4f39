"""What a person returns: mean cross section, micro-Doppler as fast as the mesh moves, and none where nothing bends."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal.windows import blackman

from rfgen_sionna.radar import Radar
from rfgen_sionna.records import RadarPaths, knot_weights
from rfgen_sionna.scene import RigidMesh
from rfgen_sionna.signal import synthesize
from rfgen_sionna.simulation import Simulator
from rfgen_sionna.tracing.tracer import Tracer

pytest.importorskip("anny")

from rfgen_sionna.generative.actor import Actor


def one_channel(radar, **waveform):
    """The radar with its first Tx and Rx alone."""
    return replace(
        radar,
        waveform=replace(radar.waveform, tx_order=(0,), **waveform),
        tx_positions=radar.tx_positions[:1],
        tx_names=radar.tx_names[:1],
        rx_positions=radar.rx_positions[:1],
        rx_names=radar.rx_names[:1],
    )


@pytest.fixture(scope="module")
def radar():
    return Radar.load("awr1843", "mmmesh", position=(0, 0, 1), look_at=(3, 0, 1))


@pytest.fixture(scope="module")
def standing(radar):
    return Actor.from_prompt("a person standing", seed=0, radar=radar, duration=1.0, motion="kinematic")


@pytest.mark.slow
def test_mean_cross_section_over_azimuth(radar, standing):
    """-14 … -2 dBsm at 77 GHz (JRC EUR 25762 EN and the prototype of the design), skin, 24 azimuths, 12 channels."""
    distance = 6.0
    sections = []
    for azimuth in np.linspace(0, 2 * np.pi, 24, endpoint=False):
        person = Actor(standing.sequence, "skin", name="person", position=(distance, 0, 0), orientation=(azimuth, 0, 0))
        paths = Simulator(None, radar, [person], rtol=1e-2).paths(0.5)
        phase = 2 * np.pi * np.mod(paths.frequency * paths.tau[..., 0], 1.0)
        channels = (paths.a[..., 0] * np.exp(-1j * phase)).sum(axis=-1)
        sections.append(np.mean(np.abs(channels) ** 2) * (4 * np.pi) ** 3 * distance**4 / radar.wavelength**2)
    assert -14 < 10 * np.log10(np.mean(sections)) < -2


@pytest.mark.slow
def test_translation_makes_no_doppler_of_its_own(radar, standing):
    """An adult who only translates: beyond 150 Hz of the body's own Doppler at least 90 dB under the peak.

    0.58 m/s at 3 m, 0.5 s at 2 kHz, Blackman window, with the body's own shadows coming and going. Steps in visibility
    or in phase would be broadband Doppler.
    """
    fast = one_channel(radar, num_loops=1000, idle_time=435e-6, num_samples=16, frame_period=1.0)
    still = RigidMesh(standing.sequence.vertices(0.0), standing.faces, "body")
    body = Actor(still, "skin", name="body", position=(3, 0, 0), velocity=(0.58, 0, 0))
    traced = Tracer(None, fast, [body], rtol=1e-3).trace(0.0, fast.waveform.frame_length)
    samples = sum(synthesize(fast, each, 0.0, eps=3e-4) for each in traced.actors)
    slow_time = samples[:, 0, 0].mean(axis=1)
    spectrum = np.abs(np.fft.fft(slow_time * blackman(1000), 8000)) ** 2
    frequency = np.fft.fftfreq(8000, fast.waveform.loop_period)
    doppler = 2 * 0.58 / fast.wavelength
    assert frequency[spectrum.argmax()] == pytest.approx(doppler, abs=2.0)
    far = np.abs((frequency - doppler + 1000) % 2000 - 1000) > 150
    assert 10 * np.log10(spectrum[far].max() / spectrum.max()) < -90


def test_walking_shows_the_speeds_of_the_mesh(radar):
    """Power-weighted Doppler of each body part against the radial speeds of its vertices, torso and limbs.

    Traced part by part from one trace, the spectrum's centroid lies within the spread of the part's vertices; the whole
    spectrum ends where the fastest visible vertices end.
    """
    fast = one_channel(radar, num_loops=384, num_samples=32)
    person = Actor.from_prompt(
        "a person walking towards the radar and back", seed=1, radar=fast, duration=6.0, motion="kinematic"
    )
    tracer = Tracer(None, fast, [person], rtol=1e-2)
    resolution = fast.wavelength / (2 * fast.waveform.frame_length)
    fastest_limb = 0.0
    for start in (0.8, 1.1):
        parts = tracer.trace(start, start + fast.waveform.frame_length).actors
        paths = RadarPaths.concatenate([each.at(parts[-1].times) for each in parts])
        middle = start + 0.5 * fast.waveform.frame_length
        offset = person.vertices(middle) - np.asarray(fast.position)
        velocity = (person.vertices(middle + 1e-3) - person.vertices(middle - 1e-3)) / 2e-3
        speed = np.einsum("ij,ij->i", velocity, offset) / np.linalg.norm(offset, axis=1)
        window = np.hanning(384)

        def centroid(chosen, start=start, paths=paths, window=window):
            slow = synthesize(fast, paths.select(chosen), start)[:, 0, 0]
            spectrum = np.fft.fftshift(np.abs(np.fft.fft(slow * window[:, None], axis=0)) ** 2, axes=0).sum(axis=1)
            axis = np.fft.fftshift(np.fft.fftfreq(384, fast.waveform.loop_period)) * fast.wavelength / 2
            return (spectrum @ axis) / spectrum.sum(), axis, spectrum

        for name in paths.part_names:
            part = paths.part_names.index(name)
            chosen = np.flatnonzero(paths.part_id == part)
            if len(chosen) < 50:
                continue
            found, _, _ = centroid(chosen)
            own = speed[np.unique(person.faces[paths.facet[chosen]])]
            assert own.min() - resolution < found < own.max() + resolution, name
            if "foot" in name or "shank" in name:
                fastest_limb = max(fastest_limb, abs(found))
        _, axis, spectrum = centroid(np.arange(paths.num_paths))
        visible = speed[np.unique(person.faces[paths.facet])]
        outside = (axis < visible.min() - 3 * resolution) | (axis > visible.max() + 3 * resolution)
        # A Hann window's side lobes are 31 dB down and fall off; 3 cells away little is left.
        assert spectrum[outside].sum() < 1e-3 * spectrum.sum()
    assert fastest_limb > 1.2  # a swinging leg is faster than the walk


def test_finer_motion_sampling_does_not_change_the_spectrogram(radar):
    """The delays of a walking person from knots twice as dense differ by less than 3 rtol rad rms."""
    person = Actor.from_prompt(
        "a person walking towards the radar and back", seed=1, radar=radar, duration=2.0, motion="kinematic"
    )
    tracer = Tracer(None, radar, [person], rtol=1e-3)
    start, stop = 0.8, 0.8 + radar.waveform.frame_length
    run = tracer.follow()
    paths = tracer.trace(start, stop, run).moving
    t = np.linspace(start, stop, 57)
    delays = paths.tau[0, 0] @ knot_weights(paths.times, t).T
    centroids = []
    for instant in t:
        vertices = person.vertices(float(instant))
        centroids.append(vertices[person.faces[paths.facet]].mean(axis=1))
    centroids = np.stack(centroids, axis=1)
    mesh = run.plan(tracer._run_scene, start, stop).mesh
    whole = np.bincount(mesh.face_in_surface)[paths.facet] == 1  # not split
    assert whole.mean() > 0.5  # most of what is told, though faces near the rim are split
    length = sum(np.linalg.norm(centroids - element, axis=2) for element in (radar.tx_world[0], radar.rx_world[0]))
    error = 2 * np.pi * radar.center_frequency * (delays - length / 299_792_458.0)[whole]
    assert np.sqrt(np.mean(error**2)) < 3e-3
