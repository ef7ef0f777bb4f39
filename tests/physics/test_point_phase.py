"""From chirp to chirp and from frame to frame a target's phase follows the analytic law."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from rfgen_sionna._types import SPEED_OF_LIGHT
from rfgen_sionna.radar import Radar
from rfgen_sionna.scene import MeshActor
from rfgen_sionna.simulation import Simulator

RADIUS = 0.01
MESH = trimesh.creation.icosphere(subdivisions=2, radius=RADIUS)
DISTANCE = 3.0
SHORT = {"num_loops": 16, "num_samples": 64, "ramp_end_time_s": 25e-6, "frame_period_s": 2e-3}

MOTIONS = {
    "50 m/s^2": lambda t: 25.0 * t**2,
    "0.1 mm at 20 Hz": lambda t: 1e-4 * np.sin(2 * np.pi * 20 * t),
    "both, on the way": lambda t: -1.2 * t + 25.0 * t**2 + 1e-4 * np.sin(2 * np.pi * 60 * t),
}
OFTEN = ("0.1 mm at 20 Hz", "mmmesh"), ("both, on the way", "mmmesh"), ("both, on the way", "bpm")


@pytest.mark.parametrize(
    ("motion", "preset"),
    [
        pytest.param(motion, preset, marks=[] if (motion, preset) in OFTEN else pytest.mark.slow)
        for motion in MOTIONS
        for preset in ("mmmesh", "bpm")
    ],
)
def test_a_targets_phase_over_frames_and_their_borders(motion, preset):
    """Ten frames of 16 loops, 2 ms from one to the next: within 0.1 degrees of 2 pi (f tau - mu tau^2 / 2).

    Where two Tx fire at once, their mean counts: the elements' echoes differ by a phase that stays.
    """
    changed = {f"preset.{preset}.{key}": value for key, value in SHORT.items()}
    if preset == "mmmesh":
        changed["preset.mmmesh.tx_order"] = ["TX1", "TX3"]
    radar = Radar.load("awr1843", preset, overrides=changed)
    course = MOTIONS[motion]
    ball = MeshActor.from_mesh(
        MESH, material="pec", name="ball", trajectory=lambda t: (DISTANCE + RADIUS + course(t), 0.0, 0.0)
    )
    cube = Simulator(None, radar, [ball], rtol=1e-4).adc(0.02, noise=False)
    wave = radar.waveform
    middle = wave.adc_start_time + 0.5 * wave.num_samples / wave.sample_rate
    times = (cube.frame_times[:, None] + wave.chirp_times[:, 0] + middle).ravel()
    assert len(times) == 160

    def path(tx, at):
        centre = np.stack([DISTANCE + RADIUS + course(at), 0 * at, 0 * at], axis=1)
        ends = (radar.tx_positions[tx], radar.rx_positions[0])
        return sum(np.linalg.norm(centre - end, axis=1) for end in ends) - 2 * RADIUS

    f, mu = wave.start_frequency + wave.slope * middle, wave.slope
    weights = np.conj(wave.axis_weights[0, 0])
    expected = 0
    for tx in np.flatnonzero(weights):
        tau = path(tx, times) / SPEED_OF_LIGHT
        expected = expected + weights[tx] * np.exp(2j * np.pi * (f * tau - 0.5 * mu * tau**2))
    # Samples weighted about the window's middle, each at its own beat frequency.
    offset = wave.sample_times - middle
    rate = (path(0, times + 1e-6) - path(0, times - 1e-6)) / 2e-6
    beat = mu * path(0, times) / SPEED_OF_LIGHT + f * rate / SPEED_OF_LIGHT
    window = np.hanning(wave.num_samples + 1)[1:]
    own = cube.data[:, :, 0, 0].reshape(len(times), -1) * np.exp(-2j * np.pi * beat[:, None] * offset)
    error = np.angle((own * window).sum(axis=1) * np.conj(expected))
    error = np.degrees(np.angle(np.exp(1j * (error - error[0]))))
    assert np.abs(error - error.mean()).max() < 0.1


@pytest.mark.parametrize(
    "frequency",
    [30.0, *(pytest.param(f, marks=pytest.mark.slow) for f in (60.0, 120.0, 200.0, 300.0, 500.0)), 390.0, 700.0],
)
def test_a_vibration_of_a_tenth_of_a_millimetre_over_a_whole_frame(frequency):
    """At `rtol` 1e-3, at every instant of the 27.6 ms: within 0.1 degrees of -2 pi f tau."""
    radar = Radar.load("awr1843", "mmmesh")

    def centre(t):
        return DISTANCE + RADIUS + 1e-4 * np.sin(2 * np.pi * frequency * t)

    ball = MeshActor.from_mesh(MESH, material="pec", name="ball", trajectory=lambda t: (centre(t), 0.0, 0.0))
    paths = Simulator(None, radar, [ball], rtol=1e-3).tracer.trace(0.0, radar.waveform.frame_length).moving
    times = np.linspace(0.0, radar.waveform.frame_length, 700)
    weights = paths.weights(times).T
    a, tau = paths.a[0, 0] @ weights, paths.tau[0, 0] @ weights
    found = (a * np.exp(-2j * np.pi * np.mod(paths.frequency * tau, 1.0))).sum(axis=0)
    place = np.stack([centre(times), 0 * times, 0 * times], axis=1)
    length = sum(np.linalg.norm(place - end, axis=1) for end in (radar.tx_positions[0], radar.rx_positions[0]))
    ratio = found * np.exp(2j * np.pi * np.mod(paths.frequency * length / SPEED_OF_LIGHT, 1.0))
    off = np.degrees(np.angle(ratio / ratio.mean()))
    assert np.abs(off).max() < 0.1
