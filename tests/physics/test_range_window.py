"""Actors that come into the range window or leave it."""

import numpy as np
import pytest
import trimesh

import rfgen_sionna as rfgen
from rfgen_sionna.dataset.actor_labels import actor_labels

SHORT = {"preset.mmmesh.num_loops": 4, "preset.mmmesh.frame_period_s": 0.1}


def radar(**placed):
    return rfgen.Radar.load("awr1843", preset="mmmesh", overrides=SHORT, **{"position": (0, 0, 0.7)} | placed)


def car(place, name="car"):
    """Box of the size of a car, whose front is 2 m before its place (3,) [m], a function of time [s]."""
    mesh = trimesh.creation.box((4, 1.8, 1.4))
    return rfgen.Actor.from_mesh(mesh, material="metal", name=name, trajectory=lambda t: (place(t), (0, 0, 0)))


def ranges(cube):
    """Of each frame the range [m] of the strongest return; None without any."""
    samples = cube.data[:, 0, 0, 0]
    spectra = np.abs(np.fft.fft(samples * np.hanning(samples.shape[1]), 16 * samples.shape[1]))
    cell = cube.radar.range_window / spectra.shape[1]
    return [float(each.argmax()) * cell if each.any() else None for each in spectra]


def test_a_car_that_drives_in():
    """It appears when its front comes into range, at its own range, and is aliased from nowhere before."""
    here, speed = radar(), -10.0
    front = here.max_range + 1.55 + speed * 0.1 * np.arange(4)
    actor = car(lambda t: (front[0] + 2 + speed * t, 0, 0.7))
    cube = rfgen.Simulator(None, here, [actor], rtol=0.02, outside="ignore").adc(0.4, noise=False)
    found = ranges(cube)
    assert found[:2] == [None, None]
    assert not cube.data[:2].any()
    np.testing.assert_allclose(np.array(found[2:], float), front[2:], atol=0.05)
    shares = [actor_labels([actor], here, t)["in_range"][0] for t in cube.frame_times]
    assert shares == [0, 0, 0.5, 0.5]  # four of eight corners: the front


def test_a_ball_that_flies_through():
    """Samples are zero before and after, also of a radar that moves past a ball at rest."""
    ball = trimesh.creation.icosphere(2, 0.1)
    flying = rfgen.Actor.from_mesh(ball, material="metal", name="ball", position=(8, -12, 0.7), velocity=(0, 30, 0))
    cube = rfgen.Simulator(None, radar(), [flying], rtol=0.05, outside="ignore").adc(0.8, noise=False)
    silent = ~cube.data.any(axis=(1, 2, 3, 4))
    away = np.hypot(8, -12 + 30 * cube.frame_times)
    assert (silent == (away > cube.radar.max_range)).all()
    assert silent[[0, -1]].all()
    assert not silent.all()
    resting = rfgen.Actor.from_mesh(ball, material="metal", name="ball", position=(12, 2, 0.7))
    passing = radar(trajectory=lambda t: ((20 * t, 0, 0.7), (0, 0, 0)))
    cube = rfgen.Simulator(None, passing, [resting], rtol=0.05, outside="ignore").adc(0.2, noise=False)
    assert [bool(frame.any()) for frame in cube.data] == [False, True]


def test_a_ball_that_has_come_in_is_as_accurate_as_one_that_was_there():
    """Facets are chosen for the first return, not kept from frames without one."""
    eight = rfgen.Radar.load("awr1843", overrides={"preset.mmmesh.num_loops": 8}, position=(0, 0, 1), look_at=(3, 0, 1))
    ball = trimesh.creation.icosphere(3, 0.1)
    flying = rfgen.Actor.from_mesh(ball, material="metal", name="ball", position=(12.5, 0, 1), velocity=(-10, 0, 0))
    simulator = rfgen.Simulator(None, eight, [flying], rtol=0.002, outside="ignore")
    entered = simulator.adc(0.3, noise=False).data
    alone = simulator.adc(0.1, start=0.2, noise=False).data[0]
    assert not entered[:2].any()
    assert np.abs(entered[2] - alone).max() < 0.005 * np.abs(alone).max()


def test_the_refusal_names_the_cure_and_silence_warns():
    away = car(lambda t: (50.0, 0, 0.7))
    with pytest.raises(ValueError, match=r'reaches .* m from the radar .*outside="ignore"'):
        rfgen.Simulator(None, radar(), [away]).adc(0.1)
    with pytest.raises(ValueError, match="outside is 'drop': allowed are 'error', 'ignore'"):
        rfgen.Simulator(None, radar(), [away], outside="drop")
    simulator = rfgen.Simulator(None, radar(), [away], rtol=1e-3, outside="ignore")
    with pytest.warns(UserWarning, match="'car' stays beyond the range window, .* returns nothing"):
        cube = simulator.adc(0.1, noise=False)
    assert not cube.data.any()
