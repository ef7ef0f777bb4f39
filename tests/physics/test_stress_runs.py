"""Extreme speeds, frames, numbers of paths, places and runs stay finite and within their error bound."""

from __future__ import annotations

import gc
import logging
import random
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from rfgen_sionna._types import SPEED_OF_LIGHT
from rfgen_sionna.radar import Radar
from rfgen_sionna.scene import MeshActor
from rfgen_sionna.signal import synthesize
from rfgen_sionna.simulation import Simulator
from rfgen_sionna.tracing.tracer import Tracer
from tests.physics.stressing import FEW, channel, one_element, plate, traced


@pytest.fixture(autouse=True)
def quiet_log(caplog):
    """Tolerances that are out of reach are told of in the log; here the report tells."""
    caplog.set_level(logging.ERROR, logger="rfgen_sionna")


# -- time -------------------------------------------------------------------------------------------------------------


@pytest.mark.slow
@settings(FEW, max_examples=8)
@given(speed=st.floats(-300.0, 300.0), aside=st.floats(-50.0, 50.0))
def test_velocities_up_to_300_metres_a_second(speed, aside):
    """Between its knots a path is where the thing is: samples of a fast ball against traces at each chirp."""
    radar = one_element(num_loops=16)
    ball = trimesh.creation.icosphere(subdivisions=2, radius=0.03)
    actor = MeshActor.from_mesh(ball, material="pec", position=(5, 0, 0), velocity=(speed, aside, 0), name="ball")
    tracer = Tracer(None, radar, [actor], rtol=1e-3)
    paths = tracer.trace(0.0, radar.waveform.frame_length).moving
    for t in radar.waveform.chirp_times[:, 0]:
        weights = paths.weights(np.array([t]))[0]
        cycles = np.mod(paths.frequency * (paths.tau[0, 0] @ weights), 1.0)
        between = complex(((paths.a[0, 0] @ weights) * np.exp(-2j * np.pi * cycles)).sum())
        there = channel(tracer.trace(float(t), float(t)).moving)
        assert abs(between - there) < 0.02 * abs(there)


@pytest.mark.parametrize("loops", [1, 10_000])
def test_frames_of_one_chirp_and_of_ten_thousand(loops):
    """A single chirp, and 0.72 s of them while a ball swings: the last ones are as right as the first."""
    radar = one_element(num_loops=loops, num_samples=8, frame_period=1.0)
    ball = trimesh.creation.icosphere(subdivisions=1, radius=0.02)
    actor = MeshActor.from_mesh(
        ball, material="pec", name="ball", trajectory=lambda t: (2.0 + 0.05 * np.sin(9 * t), 0.1 * np.cos(7 * t), 0.0)
    )
    tracer = Tracer(None, radar, [actor], rtol=1e-3)
    paths = tracer.trace(0.0, radar.waveform.frame_length).moving
    samples = synthesize(radar, paths, 0.0, eps=1e-4)
    assert samples.shape == (loops, 1, 1, 8)
    assert np.isfinite(samples).all()
    wave = radar.waveform
    for chirp in {0, loops // 2, loops - 1}:
        now = wave.chirp_times[chirp, 0]
        there = tracer.trace(float(now), float(now)).moving
        tau = there.tau[0, 0, :, 0] + there.tau_rate[0, 0, :, 0] * wave.sample_times[3]
        t = wave.sample_times[3]
        cycles = np.mod(tau * (wave.start_frequency + wave.slope * t - 0.5 * wave.slope * tau), 1.0)
        expected = (np.conj(there.a[0, 0, :, 0]) * np.exp(2j * np.pi * cycles)).sum()
        assert abs(samples[chirp, 0, 0, 3] - expected) < 0.02 * abs(expected)


# -- paths ------------------------------------------------------------------------------------------------------------


def many_paths(radar: Radar, count: int, seed: int = 0):
    """Paths of a ball, again and again at random delays."""
    ball = trimesh.creation.icosphere(subdivisions=1, radius=0.02)
    some = (
        Tracer(None, radar, [MeshActor.from_mesh(ball, material="pec", position=(2, 0, 0))], rtol=1e-3)
        .trace(0.0, 0.0)
        .moving
    )
    index = np.resize(np.arange(some.num_paths), count)
    rng = np.random.default_rng(seed)
    chosen = some.select(index)
    tau = np.broadcast_to(2 * rng.uniform(0.5, 10.0, (count, 1)) / SPEED_OF_LIGHT, chosen.tau.shape)
    a = rng.normal(size=chosen.a.shape) + 1j * rng.normal(size=chosen.a.shape)
    return replace(chosen, tau=tau.copy(), tau_rate=np.zeros_like(tau), a=a, dispersion=None)


def test_no_paths_at_all():
    radar = one_element()
    assert not synthesize(radar, many_paths(radar, 10).select(np.zeros(0, np.intp)), 0.0).any()
    with pytest.raises(ValueError, match="range"):
        # beyond the range window nothing is received, and the simulator says so
        Simulator(None, radar, [MeshActor.from_mesh(plate(1, 1), material="pec", position=(500, 0, 0))]).adc(0.1)


@pytest.mark.parametrize("count", [1000, pytest.param(1_000_000, marks=pytest.mark.slow)])
def test_a_million_paths(count):
    radar = one_element()
    paths = many_paths(radar, count)
    samples = synthesize(radar, paths, 0.0, eps=1e-6)
    wave = radar.waveform
    for chirp, sample in ((0, 0), (3, 31)):
        t, tau = wave.sample_times[sample], paths.tau[0, 0, :, 0]
        cycles = np.mod(tau * (wave.start_frequency + wave.slope * t - 0.5 * wave.slope * tau), 1.0)
        expected = (np.conj(paths.a[0, 0, :, 0]) * np.exp(2j * np.pi * cycles)).sum()
        assert abs(samples[chirp, 0, 0, sample] - expected) < 1e-5 * np.linalg.norm(paths.a)


# -- numbers ----------------------------------------------------------------------------------------------------------


@FEW
@given(seed=st.integers(0, 2**32 - 1))
def test_single_precision_input_is_the_same_numbers(seed):
    """float32 vertices, positions and velocities are taken at their value: nothing is computed in single precision."""
    rng = np.random.default_rng(seed)
    ball = trimesh.creation.icosphere(subdivisions=1, radius=0.1)
    points = (np.asarray(ball.vertices) + 0.01 * rng.normal(size=(len(ball.vertices), 3))).astype(np.float32)
    place = rng.uniform(1, 5, 3).astype(np.float32)
    made = [
        MeshActor.from_mesh((points.astype(kind), np.asarray(ball.faces)), material="skin", position=place.astype(kind))
        for kind in (np.float32, np.float64)
    ]
    assert traced(one_element(), made[0]) == traced(one_element(), made[1])


@FEW
@given(
    shift=st.tuples(*[st.floats(-10_000.0, 10_000.0)] * 3),
    yaw=st.floats(-3.1, 3.1),
    pitch=st.floats(-1.5, 1.5),
)
def test_ten_kilometres_from_the_origin(shift, yaw, pitch):
    ball = trimesh.creation.icosphere(subdivisions=2, radius=0.1)
    place, shift = np.array([2.0, 0.3, -0.2]), np.array(shift)
    turn = Rotation.from_euler("ZYX", (yaw, pitch, 0.3))
    here, _ = traced(one_element(), MeshActor.from_mesh(ball, material="skin", position=place))
    radar = one_element().placed(position=tuple(shift), orientation=(yaw, pitch, 0.3))
    orientation = turn.as_euler("ZYX")
    actor = MeshActor.from_mesh(ball, material="skin", position=shift + turn.apply(place), orientation=orientation)
    there, _ = traced(radar, actor)
    assert abs(there / here - 1) < 2e-3


# -- runs -------------------------------------------------------------------------------------------------------------


def small_run(radar_number: int, seed: int) -> bytes:
    """All samples of a short run, noise included."""
    radar = [
        one_element(),
        one_element(num_loops=3, num_samples=64),
        Radar.load("position2go").placed(orientation=(0.1, 0, 0)),
    ][radar_number]
    ball = trimesh.creation.icosphere(subdivisions=2, radius=0.1)
    actor = MeshActor.from_mesh(ball, material="skin", position=(2, 0.1 * radar_number, 0), velocity=(1.5, 0.2, 0))
    duration = 2 * radar.waveform.frame_period
    return Simulator(None, radar, [actor], rtol=1e-2, seed=seed).adc(duration, seed=seed).data.tobytes()


JOBS = [(radar, seed) for radar in range(3) for seed in range(2)]


@cache
def alone() -> dict[tuple[int, int], bytes]:
    return {job: small_run(*job) for job in JOBS}


@settings(FEW, max_examples=2)
@given(order=st.randoms(use_true_random=False), threads=st.integers(2, 4))
def test_random_interleavings_give_the_same_bits(order: random.Random, threads):
    """Whatever runs before or beside it, the same radar, scene and seed give the same samples to the bit."""
    jobs = JOBS + [order.choice(JOBS) for _ in range(2)]
    order.shuffle(jobs)
    expected = alone()
    assert len(set(expected.values())) == len(JOBS)
    with ThreadPoolExecutor(threads) as pool:
        for job, samples in zip(jobs, pool.map(lambda job: small_run(*job), jobs), strict=True):
            assert samples == expected[job], job


def test_facets_are_as_fine_as_the_pose_asks_for_and_not_as_all_before_did():
    """A wooden ball that drifts past: where its return fades more are asked for, again and again."""
    radar = one_element(frame_period=0.05)
    ball = trimesh.creation.icosphere(subdivisions=2, radius=0.1)
    drifting = MeshActor.from_mesh(ball, material="wood", position=(1.5, 0.6, 0), name="ball", velocity=(0.145, 0, 0))
    tracer = Tracer(None, radar, [drifting], rtol=1e-3)
    run, length = tracer.follow(), radar.waveform.frame_length
    counts = [tracer.trace(t, t + length, run).report.facets for t in np.arange(0.0, 3.4, 0.06)]
    assert len(set(counts)) > 5
    assert max(counts) < 2 * counts[0]


@pytest.mark.skipif(not Path("/proc/self/status").is_file(), reason="only Linux tells the memory")
@pytest.mark.parametrize("frames", [30, pytest.param(1000, marks=pytest.mark.slow)])
def test_memory_does_not_grow_with_the_frames(frames):
    radar = one_element(frame_period=0.01)
    ball = trimesh.creation.icosphere(subdivisions=2, radius=0.1)
    actor = MeshActor.from_mesh(
        ball, material="pec", name="ball", trajectory=lambda t: (2.0, 0.3 * np.sin(2 * np.pi * t), 0.0)
    )

    def resident() -> float:
        gc.collect()
        lines = Path("/proc/self/status").read_text(encoding="ascii").splitlines()
        return float(next(line for line in lines if line.startswith("VmRSS")).split()[1]) / 1e3

    held = []
    for frame in Simulator(None, radar, [actor], rtol=1e-2).frames(frames * 0.01):
        assert np.isfinite(frame.samples).all()
        if frame.index in (frames // 3, frames - 1):
            held.append(resident())
    assert held[1] - held[0] < 10.0  # MB; what a frame holds is less than one
