"""A short run with one target that recedes on the left of the radar, above it, in noise."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh

from rfgen_sionna.dataset import STANDARD_LABELS, ActorInfo, RunInfo, RunWriter, open_run
from rfgen_sionna.radar import Radar
from rfgen_sionna.records import Pir

C = 299_792_458.0
START, SPEED = np.array([2.5, 1.0, 1.2]), 0.8
"""World position [m] at time 0 and radial velocity [m/s] of the target."""


def where(t):
    away = START - np.array([0, 0, 1.0])
    return START + SPEED * t * away / np.linalg.norm(away)


def beats(radar, start, rng):
    wave = radar.waveform
    ramp = start + wave.chirp_times
    fast = wave.sample_times
    t = ramp[..., None] + fast
    path = np.linalg.norm(where(0.0) - np.asarray(radar.position)) + SPEED * t
    direction = (START - np.asarray(radar.position)) / np.linalg.norm(START - np.asarray(radar.position))
    shift = radar.virtual_positions @ (radar.rotation.T @ direction)
    tau = (2 * path[:, :, None, :] - shift[None, :, :, None]) / C
    turns = wave.start_frequency * tau + wave.slope * fast * tau - 0.5 * wave.slope * tau**2
    cube = 1e-6 * np.exp(2j * np.pi * (turns % 1))
    return (cube + 1e-7 * (rng.standard_normal(cube.shape) + 1j * rng.standard_normal(cube.shape))).astype(np.complex64)


def image(radar, t):
    rows = columns = 24
    energy = np.full((rows, columns), 1e-9)
    energy[0] = 0.0
    energy[6:14, 2:8] = 1e-7
    tau = np.where(energy > 0, 3e-8, np.nan)
    velocity = np.where(energy > 1e-8, SPEED, 0.0)
    return Pir(energy, tau, velocity, (70.0, 70.0), radar.position, radar.orientation, time=t)


@pytest.fixture(scope="session")
def small_radar():
    radar = Radar.load("awr1843", preset="mmmesh", position=(0, 0, 1), look_at=(3, 0, 1))
    return replace(radar, waveform=replace(radar.waveform, num_loops=32, num_samples=128))


@pytest.fixture(scope="session")
def make_run(tmp_path_factory, small_radar):
    def make(name, frames=4, period=0.1, pir=True, actors=True):
        ball = trimesh.creation.icosphere(subdivisions=3, radius=0.3)
        info = RunInfo(
            small_radar,
            prompt="a ball rolling away",
            environment="an empty hall",
            seeds={"noise": 1},
            actors=(ActorInfo("ball", "metal", np.asarray(ball.faces), len(ball.vertices)),) if actors else (),
            labels={k: STANDARD_LABELS[k] for k in ("action", "distance", "radial_velocity")} if actors else {},
        )
        rng = np.random.default_rng(0)
        path = tmp_path_factory.mktemp("runs") / f"{name}.h5"
        with RunWriter(path, info) as writer:
            for index in range(frames):
                t = index * period
                centre = where(t)
                writer.append(
                    beats(small_radar, t, rng),
                    time=t,
                    pir=image(small_radar, t) if pir else None,
                    vertices={"ball": ball.vertices + centre} if actors else None,
                    labels={
                        "action": ["rolling"],
                        "distance": [np.linalg.norm(centre - np.asarray(small_radar.position))],
                        "radial_velocity": [SPEED],
                    }
                    if actors
                    else None,
                )
        return path

    return make


@pytest.fixture(scope="session")
def run_path(make_run):
    return make_run("ball")


@pytest.fixture
def run(run_path):
    with open_run(run_path) as source:
        yield source
