"""Samples of things whose facets all but cancel are right to the tolerance of their own return."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh

from rfgen_sionna.frame_loop import MIN_EPS, SYNTHESIS_SHARE, required_eps
from rfgen_sionna.radar import Radar
from rfgen_sionna.scene import MeshActor
from rfgen_sionna.signal import synthesize
from rfgen_sionna.simulation import Simulator


@pytest.fixture(scope="module")
def radar():
    radar = Radar.load("awr1843", "mmmesh", position=(0, 0, 1), look_at=(3, 0, 1))
    return replace(radar, waveform=replace(radar.waveform, num_loops=4))


def plate():
    """It lies far aslant: its facets return thousands of times what all of it does."""
    corners = 0.15 * np.array([[0, -1, -1], [0, 1, -1], [0, 1, 1], [0, -1, 1]], float)
    pose = {"position": (2, 0, 1), "orientation": (0.858, -1.119, 1.378)}
    return MeshActor.from_mesh((corners, [[0, 1, 2], [0, 2, 3]]), material="metal", name="plate", **pose)


def box():
    pose = {"position": (7.8, 3.04, 2.01), "orientation": (2.89, 2.74, -2.11)}
    return MeshActor.from_mesh(trimesh.creation.box((0.3, 0.2, 0.4)), material="metal", name="box", **pose)


def ball():
    return MeshActor.from_mesh(
        trimesh.creation.icosphere(3, radius=0.1), material="metal", name="ball", position=(3, 0, 1)
    )


def traced(radar, actors, rtol):
    return Simulator(None, radar, actors, rtol=rtol).tracer.trace(0.0, radar.waveform.frame_length)


def samples(radar, found, eps):
    return sum(synthesize(radar, part, 0.0, eps=eps) for part in found.changing())


def off(found, truth):
    return float(np.linalg.norm(found - truth) / np.linalg.norm(truth))


@pytest.mark.parametrize(
    ("thing", "rtol"),
    [
        (box, 1e-2),
        *(pytest.param(*each, marks=pytest.mark.slow) for each in [(plate, 1e-2), (plate, 1e-3), (box, 1e-3)]),
    ],
)
def test_adc_samples_are_within_what_is_stated(radar, thing, rtol):
    """With exact sums and with those that a simulation makes, which were 4 times the tolerance off for the plate, and
    20 times for the box, as gains were those of another frequency. Against one 50 times as accurate."""
    truth = samples(radar, traced(radar, [thing()], rtol / 50), 1e-10)
    found = traced(radar, [thing()], rtol)
    cube = Simulator(None, radar, [thing()], rtol=rtol).adc(1.01 * radar.waveform.frame_period, noise=False).data[0]
    exact = samples(radar, found, 1e-10)
    assert off(cube, exact) < SYNTHESIS_SHARE * rtol
    assert off(cube, truth) < max(found.report.error, rtol)


def test_sums_are_as_accurate_as_the_weakest_object_asks_for(radar):
    (alone,) = traced(radar, [ball()], 1e-2).changing()
    assert required_eps(radar, alone, 1e-2) == pytest.approx(SYNTHESIS_SHARE * 1e-2, rel=0.7)
    (both,) = traced(radar, [ball(), plate()], 1e-2).changing()
    assert MIN_EPS <= required_eps(radar, both, 1e-2) < 0.1 * required_eps(radar, alone, 1e-2)
    # What stays in the world shares one tolerance.
    assert required_eps(radar, both, 1e-2, num_static=2) == pytest.approx(SYNTHESIS_SHARE * 1e-2, rel=0.7)
    assert required_eps(radar, both.select(np.zeros(0, np.intp)), 1e-2) == SYNTHESIS_SHARE * 1e-2
