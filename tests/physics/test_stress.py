"""What is extreme stays finite and within its error bound, or is refused with a sentence that says why."""

from __future__ import annotations

import gc
import logging
import random
import warnings
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import trimesh
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from rfgen_sionna.radar import ElementPattern, Radar
from rfgen_sionna.records import SPEED_OF_LIGHT
from rfgen_sionna.scene import Actor, Material, MeshError
from rfgen_sionna.scene.permittivity import Computed
from rfgen_sionna.signal import synthesize
from rfgen_sionna.simulation import Simulator
from rfgen_sionna.tracing.tracer import Tracer
from tests.reference.physical_optics import po_gain

FEW = settings(max_examples=15, deadline=None, derandomize=True, suppress_health_check=list(HealthCheck))


def one_element(**waveform) -> Radar:
    """An isotropic element that sends and receives, with a frame of few samples."""
    radar = replace(Radar.load("awr1843", "mmmesh"), pattern=ElementPattern(0.0), tx_power_dbm=30.0)
    here = np.zeros((1, 3))
    small = {"tx_order": (0,), "num_loops": 4, "num_samples": 32} | waveform
    return replace(
        radar,
        waveform=replace(radar.waveform, **small),
        tx_positions=here,
        tx_names=radar.tx_names[:1],
        rx_positions=here,
        rx_names=radar.rx_names[:1],
    )


@cache
def far_radar() -> Radar:
    """One whose range window ends beyond a kilometre."""
    return one_element(slope=0.5e12)


def plate(width: float, height: float) -> trimesh.Trimesh:
    """Two triangles across the x axis that look to -x."""
    a, b = width / 2, height / 2
    return trimesh.Trimesh([[0, -a, -b], [0, a, -b], [0, a, b], [0, -a, b]], [[0, 2, 1], [0, 3, 2]], process=False)


def channel(paths, at: int = 0) -> complex:
    """Coherent sum of the first element pair at one knot."""
    turns = np.mod(paths.frequency * paths.tau[0, 0, :, at], 1.0)
    return complex((paths.a[0, 0, :, at] * np.exp(-2j * np.pi * turns)).sum())


def traced(radar: Radar, *actors: Actor, rtol: float = 1e-3):
    """Channel at t = 0 and the error that the report states."""
    found = Tracer(None, radar, actors, rtol).trace(0.0, 0.0)
    for array in (found.moving.a, found.moving.tau, found.moving.tau_rate, found.moving.direction):
        assert np.isfinite(array).all()
    return channel(found.moving), found.report.error


def true_channel(actor: Actor, radar: Radar, n: int, permeability: complex = 1.0) -> complex:
    """Dense quadrature over all faces, n^2 points each: for what hides nothing of itself."""
    element, frequency = radar.tx_world[0], radar.center_frequency
    corners = actor.vertices(0.0)[actor.faces]
    eps = complex(actor.properties.relative_permittivity(frequency))
    return po_gain(
        corners, element, element, radar.tx_field, radar.rx_field, frequency,
        complex(np.inf) if not np.isfinite(eps) else eps, permeability, n=n,
    )  # fmt: skip


# -- ranges and angles ------------------------------------------------------------------------------------------------


@FEW
@given(
    distance=st.floats(-2.0, 3.0).map(lambda x: 10.0**x),
    zones=st.floats(0.2, 2.0),
    tilt=st.floats(0.0, 60.0),
    turn=st.floats(0.0, 360.0),
)
def test_ranges_from_a_centimetre_to_a_kilometre(distance, zones, tilt, turn):
    """A plate of some Fresnel zones, tilted anyhow, is right to what the report states."""
    radar = far_radar()
    size = min(zones * np.sqrt(radar.wavelength * distance), 0.6 * distance, 30 * radar.wavelength)
    orientation = Rotation.from_euler("xz", [turn, tilt], degrees=True).as_euler("ZYX")
    actor = Actor.from_mesh(plate(size, 0.7 * size), material="pec", position=(distance, 0, 0), orientation=orientation)
    found, error = traced(radar, actor)
    truth = true_channel(actor, radar, int(20 + 8 * size / radar.wavelength))
    assert abs(found - truth) <= max(error, 1e-6) * abs(truth)


@pytest.mark.parametrize("angle", [0.0, 1e-12, 1e-6, 89.0, 89.999, 90.0 - 1e-9, 90.0])
@pytest.mark.parametrize("material", ["pec", "skin", "glass"])
def test_from_exactly_normal_to_exactly_grazing_incidence(angle, material):
    """Edge on, a plate returns next to nothing: what is left is held to a part of what it returns head on."""
    radar = one_element()
    shape = plate(0.1, 0.1)
    head_on = Actor.from_mesh(shape, material=material, position=(2, 0, 0))
    actor = Actor.from_mesh(shape, material=material, position=(2, 0, 0), orientation=(np.radians(angle), 0, 0))
    found, error = traced(radar, actor)
    scale = abs(true_channel(head_on, radar, 60))
    eps = complex(actor.properties.relative_permittivity(radar.center_frequency))
    if actor.properties.thickness is None or not np.isfinite(eps):
        truth = true_channel(actor, radar, 120)
        assert abs(found - truth) <= max(error * abs(truth), 1e-6 * scale)
    if angle == 90.0:
        assert abs(found) < 1e-6 * scale


def test_behind_the_radar():
    """An isotropic element hears behind as before; the shipped antenna hears it, but less."""
    radar = one_element()
    before = Actor.from_mesh(plate(0.1, 0.1), material="pec", position=(2, 0, 0))
    behind = Actor.from_mesh(plate(0.1, 0.1), material="pec", position=(-2, 0, 0))
    assert traced(radar, behind)[0] == pytest.approx(traced(radar, before)[0], rel=2e-3)
    directive = replace(radar, pattern=Radar.load("awr1843").pattern)
    # Gains are for unit elements: the antenna's own weight comes with the samples.
    levels = [
        np.abs(synthesize(directive, Tracer(None, directive, [each]).trace(0.0, 0.0).moving, 0.0)).max()
        for each in (before, behind)
    ]
    assert np.isfinite(levels).all()
    assert levels[1] < 0.1 * levels[0]


@settings(FEW, max_examples=8)
@given(shift=st.floats(-0.02, 0.02), tilt=st.floats(-80, 80), roll=st.floats(0, 180))
def test_facets_through_the_radar(shift, tilt, roll):
    """The tracer stays finite however a plate passes the element; the simulator refuses it."""
    radar = one_element()
    turned = Rotation.from_euler("xy", [roll, tilt], degrees=True).as_euler("ZYX")
    actor = Actor.from_mesh(plate(0.2, 0.2), material="pec", position=(shift, 0.0, 0.0), orientation=turned)
    found, _ = traced(radar, actor, rtol=1e-2)
    assert np.isfinite(found)
    through = Actor.from_mesh(plate(0.2, 0.2), material="pec", position=(0.0, 0.0, 0.0), orientation=turned)
    assert np.isfinite(traced(radar, through, rtol=1e-2)[0])
    with pytest.raises(ValueError, match="radar"):
        Simulator(None, radar, [through])


# -- meshes -----------------------------------------------------------------------------------------------------------


@FEW
@given(seed=st.integers(0, 2**32 - 1), vertices=st.integers(3, 12), faces=st.integers(1, 12))
def test_any_soup_of_triangles_is_refused_with_a_sentence_or_finite(seed, vertices, faces):
    rng = np.random.default_rng(seed)
    points = rng.normal(0, 0.2, (vertices, 3)).round(1)  # rounded: coincident points, flat and empty triangles
    index = rng.integers(0, vertices, (faces, 3))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # faces that are dropped, or turned round, are told of
        try:
            actor = Actor.from_mesh((points, index), material="skin", position=(2, 0, 0), name="soup")
        except MeshError as refused:
            actor, reason = None, str(refused)
    if actor is None:
        assert reason.startswith("soup: ")
        return
    found, _ = traced(one_element(), actor, rtol=1e-2)
    assert np.isfinite(found)


def test_faces_without_area_change_nothing():
    ball = trimesh.creation.icosphere(subdivisions=2, radius=0.1)
    points, faces = np.asarray(ball.vertices), np.asarray(ball.faces)
    flat = np.concatenate([faces, [[0, 0, 1], [5, 5, 5]]])
    whole = Actor.from_mesh((points, faces), material="pec", position=(2, 0, 0))
    with pytest.warns(UserWarning, match="dropped 2 of 322 faces"):
        padded = Actor.from_mesh((points, flat), material="pec", position=(2, 0, 0))
    assert traced(one_element(), padded) == traced(one_element(), whole)


def test_inside_out_is_turned_round():
    ball = trimesh.creation.icosphere(subdivisions=2, radius=0.1)
    points, faces = np.asarray(ball.vertices), np.asarray(ball.faces)
    whole = Actor.from_mesh((points, faces), material="pec", position=(2, 0, 0))
    with pytest.warns(UserWarning, match="orientation was reversed"):
        turned = Actor.from_mesh((points, faces[:, ::-1]), material="pec", position=(2, 0, 0))
    assert traced(one_element(), turned)[0] == pytest.approx(traced(one_element(), whole)[0], rel=1e-9)


@pytest.mark.parametrize("what", ["duplicated", "three faces at an edge", "twisted"])
def test_meshes_that_are_no_surfaces_are_refused(what):
    points = np.array([[0, 0, 0], [0, 1, 0], [0, 0, 1], [0, 1, 1], [1, 0, 0.5]], float)
    faces = {
        "duplicated": [[0, 1, 2], [0, 1, 2]],
        "three faces at an edge": [[0, 1, 2], [2, 1, 3], [1, 2, 4]],
        "twisted": [[0, 1, 2], [1, 2, 3]],
    }[what]
    with pytest.raises(MeshError, match="edges"):
        Actor.from_mesh((points, faces), material="pec", name="thing")


@pytest.mark.parametrize("size", [1e-6, 1e-5, 1e-3])
def test_things_of_a_micrometre(size):
    """A box far smaller than the wavelength: what its faces return is their area, and the phases of their places."""
    radar = one_element()
    actor = Actor.from_mesh(trimesh.creation.box((size, size, size)), material="pec", position=(1.0, 0.1, 0.2))
    found, error = traced(radar, actor)
    assert error <= 1e-3
    vertices = actor.vertices(0.0)
    corners = vertices[actor.faces]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    seen = corners[(normal * corners.mean(axis=1)).sum(axis=1) < 0]
    element = radar.tx_world[0]
    truth = po_gain(seen, element, element, radar.tx_field, radar.rx_field, radar.center_frequency, n=8)
    # Rays resolve a few 1e-7 of the distance: of a box of 1 um they can't tell the faces apart.
    assert abs(found - truth) <= (2e-3 if size > 1e-5 else 0.7) * abs(truth)


@pytest.mark.slow
def test_two_million_triangles():
    """A dome as wide as a ball of half a metre: geometrical optics' a / 2, spread over R (R - a)."""
    radar = one_element()
    radius, distance, side = 0.5, 3.0, 1024
    u, v = np.meshgrid(np.linspace(-0.35, 0.35, side + 1), np.linspace(-0.35, 0.35, side + 1), indexing="ij")
    points = np.stack([-np.sqrt(radius**2 - u**2 - v**2), u, v], axis=-1).reshape(-1, 3)
    first = (np.arange(side)[:, None] * (side + 1) + np.arange(side)).ravel()
    quads = np.stack([first, first + 1, first + side + 2, first + side + 1], axis=1)
    faces = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    assert len(faces) > 2_000_000
    actor = Actor.from_mesh((points, faces), material="pec", position=(distance, 0, 0), name="dome")
    found, _ = traced(radar, actor, rtol=1e-2)
    expected = radar.wavelength / (4 * np.pi) * (radius / 2) / (distance * (distance - radius))
    assert abs(found) == pytest.approx(expected, rel=0.05)  # the rim returns a few percent


# -- materials --------------------------------------------------------------------------------------------------------


@FEW
@given(
    permittivity=st.one_of(st.just(1.0), st.floats(0.0, 6.0).map(lambda x: 10.0**x)),
    conductivity=st.one_of(st.just(0.0), st.just(np.inf), st.floats(-3.0, 30.0).map(lambda x: 10.0**x)),
    permeability=st.one_of(st.just(1.0), st.floats(0.0, 3.0).map(lambda x: 10.0**x)),
    angle=st.floats(0.0, 89.0),
)
def test_materials_from_vacuum_to_perfect_conductors(permittivity, conductivity, permeability, angle):
    radar = one_element()
    model = Computed(lambda frequency: (permittivity, conductivity))
    thing = Material("thing", model, "made up", permeability=permeability)
    orientation = (np.radians(angle), 0.1, 0.3)
    actor = Actor.from_mesh(plate(0.02, 0.03), material=thing, position=(1, 0, 0), orientation=orientation)
    found, error = traced(radar, actor)
    truth = true_channel(actor, radar, 60, permeability)
    metal = Actor.from_mesh(plate(0.02, 0.03), material="pec", position=(1, 0, 0), orientation=orientation)
    scale = abs(true_channel(metal, radar, 60))
    assert np.isfinite(truth)
    assert abs(found - truth) <= max(error * abs(truth), 1e-5 * scale)


# -- time -------------------------------------------------------------------------------------------------------------


@settings(FEW, max_examples=8)
@given(speed=st.floats(-300.0, 300.0), aside=st.floats(-50.0, 50.0))
def test_velocities_up_to_300_metres_a_second(speed, aside):
    """Between its knots a path is where the thing is: samples of a fast ball against traces at each chirp."""
    radar = one_element(num_loops=16)
    ball = trimesh.creation.icosphere(subdivisions=2, radius=0.03)
    actor = Actor.from_mesh(ball, material="pec", position=(5, 0, 0), velocity=(speed, aside, 0), name="ball")
    tracer = Tracer(None, radar, [actor])
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
    actor = Actor.from_mesh(
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
    some = Tracer(None, radar, [Actor.from_mesh(ball, material="pec", position=(2, 0, 0))]).trace(0.0, 0.0).moving
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
        Simulator(None, radar, [Actor.from_mesh(plate(1, 1), material="pec", position=(500, 0, 0))]).adc(0.1)


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
        Actor.from_mesh((points.astype(kind), np.asarray(ball.faces)), material="skin", position=place.astype(kind))
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
    here, _ = traced(one_element(), Actor.from_mesh(ball, material="skin", position=place))
    radar = one_element().placed(position=tuple(shift), orientation=(yaw, pitch, 0.3))
    orientation = turn.as_euler("ZYX")
    actor = Actor.from_mesh(ball, material="skin", position=shift + turn.apply(place), orientation=orientation)
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
    actor = Actor.from_mesh(ball, material="skin", position=(2, 0.1 * radar_number, 0), velocity=(1.5, 0.2, 0))
    duration = 2 * radar.waveform.frame_period
    return Simulator(None, radar, [actor], rtol=1e-2, seed=seed).adc(duration, seed=seed).data.tobytes()


JOBS = [(radar, seed) for radar in range(3) for seed in range(2)]


@cache
def alone() -> dict[tuple[int, int], bytes]:
    return {job: small_run(*job) for job in JOBS}


@settings(FEW, max_examples=3)
@given(order=st.randoms(use_true_random=False), threads=st.integers(2, 4))
def test_random_interleavings_give_the_same_bits(order: random.Random, threads):
    """Whatever runs before or beside it, the same radar, scene and seed give the same samples to the bit."""
    jobs = JOBS + [order.choice(JOBS) for _ in range(4)]
    order.shuffle(jobs)
    expected = alone()
    assert len(set(expected.values())) == len(JOBS)
    with ThreadPoolExecutor(threads) as pool:
        for job, samples in zip(jobs, pool.map(lambda job: small_run(*job), jobs), strict=True):
            assert samples == expected[job], job


@pytest.mark.skipif(not Path("/proc/self/status").is_file(), reason="only Linux tells the memory")
@pytest.mark.parametrize("frames", [60, pytest.param(1000, marks=pytest.mark.slow)])
def test_memory_does_not_grow_with_the_frames(frames):
    radar = one_element(frame_period=0.01)
    ball = trimesh.creation.icosphere(subdivisions=2, radius=0.1)
    actor = Actor.from_mesh(
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


@pytest.fixture(autouse=True)
def quiet_log(caplog):
    """Tolerances that are out of reach are told of in the log; here the report tells."""
    caplog.set_level(logging.ERROR, logger="rfgen_sionna")
