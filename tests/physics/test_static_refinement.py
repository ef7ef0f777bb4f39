"""Between instants: what actors that move on leave of the static scene, against instants traced there."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh

from rfgen_sionna.radar import Radar
from rfgen_sionna.scene import MeshActor
from rfgen_sionna.simulation import Simulator
from rfgen_sionna.tracing.moving import sample_times as instants
from rfgen_sionna.tracing.static import static_refinement as static_glances
from rfgen_sionna.tracing.tracer import Tracer
from tests.physics.test_moving_radar_ghosts import scene_with_mesh


@pytest.fixture(scope="module")
def radar():
    return Radar.load("awr1843", "mmmesh", position=(0, 0, 1), look_at=(3, 0, 1))


def sheet(width, count):
    """A plate across the line of sight, of so many squares along each side."""
    places = np.linspace(-0.5 * width, 0.5 * width, count + 1)
    y, z = (each.ravel() for each in np.meshgrid(places, places, indexing="ij"))
    first = (np.arange(count)[:, None] * (count + 1) + np.arange(count)).ravel()
    a, b, c, d = first, first + count + 1, first + count + 2, first + 1
    faces = np.concatenate([np.stack([a, c, b], axis=1), np.stack([a, d, c], axis=1)])
    return trimesh.Trimesh(np.stack([np.full_like(y, 3.0), y, z + 1], axis=1), faces, process=False)


def plate(tilt, width=0.12):
    mesh = trimesh.creation.box((0.002, width, width))
    mesh.apply_transform(trimesh.transformations.rotation_matrix(np.deg2rad(tilt), (0, 0, 1)))
    return mesh.apply_translation((3, 0, 1))


def screen(speed, place=-0.155):
    """It passes before the plate, half way."""
    return MeshActor.from_mesh(
        trimesh.creation.box((0.002, 0.3, 0.5)),
        material="pec",
        name="screen",
        trajectory=lambda t: (2.0, place + speed * t, 1.0),
        orientation=(np.deg2rad(-40.0), 0.0, 0.0),
    )


def static_channel(tracer, traced, times):
    """(time,) of the first pair: the static scene less what is hidden, between knots."""
    total = np.zeros(len(times), complex)
    for each in (traced.static, *(shadow.paths for shadow in traced.shadows)):
        there = each.at(times) if len(each.times) > 1 else each
        weight = tracer._band.pattern_gain(there.direction[:, 0])[:, None]
        turns = np.mod(there.frequency * there.tau[0, 0], 1.0)
        total = total + (there.a[0, 0] * np.exp(-2j * np.pi * turns) * weight).sum(axis=0)
    return total


def rms(values):
    return float(np.sqrt(np.mean(np.abs(values) ** 2)))


def errors(tracer, length, monkeypatch):
    """Errors relative to the static scene's level, and what is stated: with glances, then without."""
    times = np.linspace(0.0, length, 40)
    truth = np.array([static_channel(tracer, tracer.trace(t, t), np.array([t]))[0] for t in times.tolist()])
    found = []
    for tolerance in (static_glances.TIME_ERROR_PER_RTOL, np.inf):
        monkeypatch.setattr(static_glances, "TIME_ERROR_PER_RTOL", tolerance)
        monkeypatch.setattr("rfgen_sionna.tracing.moving.temporal_refinement.TIME_ERROR_PER_RTOL", tolerance)
        traced = tracer.trace(0.0, length)
        error = rms(static_channel(tracer, traced, times) - truth) / tracer.static.level
        found.append((error, traced.report.time_error + traced.report.error, traced))
    return found


@pytest.mark.slow
@pytest.mark.parametrize(("tilt", "speed", "place"), [(35, 0.3, -0.155), (60, 1.0, -0.12), (75, 2.0, -0.14)])
def test_an_edge_that_passes_a_static_plate_aslant(radar, monkeypatch, tilt, speed, place):
    """What a screen leaves of it is followed between instants, to the error stated; by splines through instants alone
    it is off by a quarter to a half of the plate's return, and that is stated as well."""
    tracer = Tracer(scene_with_mesh(plate(tilt)), radar, [screen(speed, place)], rtol=1e-2)
    (error, stated, traced), (before, stated_before, plain) = errors(tracer, radar.waveform.frame_length, monkeypatch)
    assert error < stated
    assert before < stated_before
    assert before > 0.2
    assert error < before / 2.5
    assert max(len(shadow.paths.times) for shadow in traced.shadows) > 8 * (traced.report.sample_times - 1)
    assert max(len(shadow.paths.times) for shadow in plain.shadows) == plain.report.sample_times
    assert traced.report.rays > plain.report.rays
    assert traced.report.facets > plain.report.facets


@pytest.mark.slow
@pytest.mark.parametrize("count", [4, 24, 60])
def test_facets_in_phase_are_missed_together(radar, count):
    """However finely a plate is meshed, what is missed of it is stated: its facets' errors add up as amplitudes."""
    # The first pair in one place, the phase centre: at 0.6 m others see the edge centimetres aside.
    tx, rx = (each - each[0] for each in (radar.tx_positions, radar.rx_positions))
    radar = replace(radar, tx_positions=tx, rx_positions=rx)
    length = radar.waveform.frame_length
    silhouette_rays = MeshActor.from_mesh(
        trimesh.creation.box((0.002, 0.1, 0.2)),
        material="pec",
        name="screen",
        trajectory=lambda t: (0.6, -0.055 + 1.0 * t, 1.0),
        orientation=(np.deg2rad(-40.0), 0.0, 0.0),
    )
    tracer = Tracer(scene_with_mesh(sheet(0.06, count)), radar, [silhouette_rays], rtol=1e-2)
    traced = tracer.trace(0.0, length)
    times = np.linspace(0.0, length, 25)
    truth = np.array([static_channel(tracer, tracer.trace(t, t), np.array([t]))[0] for t in times.tolist()])
    error = rms(static_channel(tracer, traced, times) - truth) / tracer.static.level
    assert error < 1.25 * traced.report.time_error  # an estimate: of four squares to a side it is a fifth too low
    assert error < 0.08  # 0.03 is asked for, of an estimate that is taken by a third before more looks are


def test_an_edge_too_quick_to_be_followed_is_stated(radar, monkeypatch):
    """At 20 m/s it passes by a dozen wavelengths from instant to instant, of which its own turning asks for twelve."""
    tracer = Tracer(scene_with_mesh(plate(20)), radar, [screen(20.0, -0.4)], rtol=1e-2)
    for error, stated, _ in errors(tracer, radar.waveform.frame_length, monkeypatch):
        assert 0.1 < error < stated


def test_a_plate_that_nobody_passes_is_left_alone(radar, monkeypatch):
    """Its shadows are the same all the time, and nothing is looked at again."""
    monkeypatch.setattr(instants, "PAIR_SPACING", 0.0)  # without the plate two instants would do
    tracer = Tracer(scene_with_mesh(plate(35)), radar, [screen(0.3, place=-1.0)], rtol=1e-2)
    traced = tracer.trace(0.0, radar.waveform.frame_length)
    assert traced.shadows == ()
    alone = Tracer(None, radar, [screen(0.3, place=-1.0)], rtol=1e-2).trace(0.0, radar.waveform.frame_length)
    assert traced.report.time_error == pytest.approx(alone.report.time_error, abs=1e-3)  # the screen's own


def test_what_corners_return_is_in_the_error_stated(radar):
    """A screen passes before a dihedral: of its second bounce is stated what splines miss."""
    half = trimesh.creation.box((0.3, 0.002, 0.3))
    left, right = half.copy(), half.copy()
    left.apply_transform(trimesh.transformations.rotation_matrix(np.deg2rad(-45), (0, 0, 1)))
    right.apply_transform(trimesh.transformations.rotation_matrix(np.deg2rad(45), (0, 0, 1)))
    corner = trimesh.util.concatenate(
        left.apply_translation((3.0, 0.108, 1.0)), right.apply_translation((3.0, -0.108, 1.0))
    )
    found = []
    for bounces in (1, 2):
        tracer = Tracer(scene_with_mesh(corner), radar, [screen(1.0)], rtol=1e-2, max_bounces=bounces)
        found.append((tracer, tracer.trace(0.0, radar.waveform.frame_length).report.time_error))
    assert sum(each.paths.num_paths for each in found[1][0].static_indirect) > 0
    assert found[1][1] > 1.05 * found[0][1]


def test_samples_hold_what_is_looked_at_again(radar, monkeypatch):
    """Frames of a simulator, made twice, are the same to the bit; without further looks they are others."""
    scene = scene_with_mesh(plate(35))

    def samples():
        return next(Simulator(scene, radar, [screen(0.3)], rtol=1e-2).frames(0.05)).samples

    found = [samples(), samples()]
    assert np.array_equal(*found)
    monkeypatch.setattr("rfgen_sionna.tracing.moving.temporal_refinement.TIME_ERROR_PER_RTOL", np.inf)
    assert np.linalg.norm(samples() - found[0]) > 0.1 * np.linalg.norm(found[0])
