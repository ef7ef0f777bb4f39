"""Facets that return next to nothing are left out: how much the return changes, and what is stated of it."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh

from rfgen_sionna._types import SPEED_OF_LIGHT
from rfgen_sionna.radar import Radar
from rfgen_sionna.scene import MATERIALS, MeshActor
from rfgen_sionna.scene.materials import Material
from rfgen_sionna.scene.permittivity import Conductor
from rfgen_sionna.simulation import Simulator
from rfgen_sionna.tracing.moving import moving_visibility as sight
from rfgen_sionna.tracing.moving.interval import TraceInterval
from rfgen_sionna.tracing.tracer import Tracer

FREQUENCIES = 11


@pytest.fixture(scope="module")
def radar():
    return Radar.load("awr1843", "mmmesh", position=(0, 0, 1), look_at=(3, 0, 1))


def channel(tracer, traced, name):
    """(pair, frequency) of one object over the band, antennas included."""
    paths = traced.moving
    mine = np.flatnonzero(paths.object_id == paths.object_names.index(name))
    u = np.linspace(-1.0, 1.0, FREQUENCIES)
    frequency = paths.frequency + paths.half_band * u
    orders = [paths.a, *([] if paths.dispersion is None else paths.dispersion)]
    gains = sum(each[:, :, mine, 0, None] * u**k for k, each in enumerate(orders))
    turns = np.mod(frequency * paths.tau[:, :, mine, 0, None], 1.0)
    weight = tracer._band.pattern_gain(paths.direction[mine, 0])
    return (gains * np.exp(-2j * np.pi * turns) * weight[:, None]).sum(axis=2).reshape(-1, FREQUENCIES)


def lumpy(subdivisions=5):
    """A body with bumps, of 20,480 facets, that mirrors the radar in a few places."""
    mesh = trimesh.creation.icosphere(subdivisions=subdivisions)
    x, y, z = mesh.vertices.T
    radius = 0.3 + 0.02 * np.sin(7 * x + 1) * np.cos(6 * y) + 0.015 * np.cos(9 * z + x)
    mesh.vertices *= radius[:, None]
    return mesh


def screen(half):
    """A metal disc that is seen edge on nowhere."""
    return trimesh.creation.cylinder(half, 0.002, sections=48, transform=trimesh.transformations.rotation_matrix(
        np.pi / 2, (0, 1, 0)))  # fmt: skip


def both(radar, actors, rtol, name="body"):
    """With such facets and without: (error relative to what is returned with them, stated error, facets integrated)."""
    found = []
    for cull in (False, True):
        tracer = Tracer(None, radar, actors, rtol)
        traced = tracer.trace(0.0, 0.0, tracer.follow(cull=cull))
        found.append((channel(tracer, traced, name), traced.report.error, traced.moving.num_paths))
    (whole, _, most), (some, stated, fewer) = found
    error = np.sqrt((np.abs(some - whole) ** 2).mean() / (np.abs(whole) ** 2).mean())
    return error, stated, fewer / most


@pytest.mark.parametrize(("rtol", "fewer"), [(0.1, 0.8), (1e-2, 0.99)])
def test_what_is_left_out_is_within_the_tolerance(radar, rtol, fewer):
    body = MeshActor.from_mesh(lumpy(), material="skin", position=(3, 0, 1), name="body")
    error, stated, share = both(radar, [body], rtol)
    assert error < 0.5 * rtol
    assert error < stated
    assert share < fewer


def test_nothing_is_left_out_at_fine_tolerances(radar):
    """To look for it would take longer."""
    body = MeshActor.from_mesh(lumpy(), material="skin", position=(3, 0, 1), name="body")
    error, _, share = both(radar, [body], 1e-3)
    assert (error, share) == (0.0, 1.0)


@pytest.mark.parametrize("rtol", [pytest.param(0.1, marks=pytest.mark.slow), 1e-2])
@pytest.mark.parametrize("material", ["foam", pytest.param("half a wavelength of plastic", marks=pytest.mark.slow)])
def test_what_hardly_reflects_where_it_mirrors_the_radar(radar, rtol, material):
    """Aslant it reflects all the more: nothing of it is taken for faint that is not."""
    made = MATERIALS["foam"]
    if material != "foam":
        plastic, frequency = MATERIALS["plastic"], radar.center_frequency
        index = np.sqrt(complex(plastic.relative_permittivity(frequency)).real)
        made = replace(plastic, thickness=SPEED_OF_LIGHT / frequency / 2 / index)
    body = MeshActor.from_mesh(lumpy(4), material=made, position=(3, 0, 1), name="body")
    error, stated, _ = both(radar, [body], rtol)
    assert error < 0.5 * rtol
    assert error < stated


@pytest.mark.parametrize("rtol", [pytest.param(0.1, marks=pytest.mark.slow), 1e-2])
@pytest.mark.parametrize("turn", [0.2, pytest.param(0.5, marks=pytest.mark.slow)])
def test_of_what_cancels_less_is_left_out(radar, rtol, turn):
    """A box that lies aslant returns little of what its facets do: the error stated is not that of the facets."""
    box = trimesh.creation.box((0.3, 0.3, 0.3)).subdivide_to_size(0.02)
    body = MeshActor.from_mesh(box, material="pec", position=(2, 0, 1), orientation=(turn, 0.1, 0), name="body")
    error, stated, _ = both(radar, [body], rtol)
    assert error < 0.5 * rtol
    assert error < stated < 2 * rtol


@pytest.mark.slow
@pytest.mark.parametrize("rtol", [pytest.param(0.1, marks=pytest.mark.slow), 1e-2])
def test_a_wide_array_sees_facets_from_other_sides(radar, rtol):
    """Elements spread over 2 m: what is faint in the middle may mirror the outermost pair."""
    tx, rx = radar.tx_positions.copy(), radar.rx_positions.copy()
    for each in (tx, rx):
        each[:, 1:] = 0.0
        each[:, 1] = np.linspace(-1.0, 1.0, len(each))
    wide = replace(radar, tx_positions=tx, rx_positions=rx + np.array([0, 0, 0.01]))
    body = MeshActor.from_mesh(lumpy(), material="skin", position=(2, 0, 1), name="body")
    found = []
    for cull in (False, True):
        tracer = Tracer(None, wide, [body], rtol)
        found.append(channel(tracer, tracer.trace(0.0, 0.0, tracer.follow(cull=cull)), "body"))
    whole, some = found
    level = np.sqrt((np.abs(whole) ** 2).mean())
    assert np.sqrt((np.abs(some - whole) ** 2).mean(axis=1)).max() < 0.5 * rtol * level


@pytest.mark.slow
@pytest.mark.parametrize("rtol", [pytest.param(0.1, marks=pytest.mark.slow), 1e-2])
def test_what_mirrors_the_radar_is_hidden(radar, rtol):
    """A disc before the body hides all but its rim, which is faint beside what would be seen without it: none of the
    rim is left out by what is hidden."""
    disc = MeshActor.from_mesh(screen(0.23), material="pec", position=(2.4, 0, 1), name="disc")
    body = MeshActor.from_mesh(lumpy(), material="skin", position=(3, 0, 1), name="body")
    error, stated, _ = both(radar, [body, disc], rtol)
    assert error < rtol
    assert error < stated


@pytest.mark.parametrize("rounds", [1, 2])
def test_what_is_seen_tells_what_is_faint(radar, rounds, monkeypatch):
    """The same: by all that looks at the radar, seen or not, too much would be left out."""
    monkeypatch.setattr(sight, "_ROUNDS", rounds)
    rtol = 0.1
    disc = MeshActor.from_mesh(screen(0.25), material="pec", position=(2.4, 0, 1), name="disc")
    body = MeshActor.from_mesh(lumpy(), material="skin", position=(3, 0, 1), name="body")
    tracer = Tracer(None, radar, [body, disc], rtol)
    run = tracer._follow(True)
    positions = tracer._vertices
    run._error_control.cancellation[:] = 1.0
    run._facets.follow(positions, np.zeros(1))
    run._facets.turn_to([positions(0.0)])
    (visible,) = run._trace_visibility(
        [0.0], TraceInterval(np.zeros(1), positions, lambda t: tracer._rays, tracer._rays, tracer.rays_at, [])
    )
    facing = run._moving_visibility._facing(visible.facets)
    return_estimate, most = run._moving_visibility._return_bounds.of(visible.facets, facing)
    mine = visible.facets.surface[facing.chosen] == 0
    left = np.linalg.norm(most[mine & (visible.weight[facing.chosen] == 0)])
    any_visible = np.linalg.norm((return_estimate * visible.fraction[facing.chosen])[mine])
    assert left > 0
    allowed = sight._MAX_EXCESS * sight.CULLED_PER_RTOL * sight.CURVED_FACTOR * rtol * any_visible
    assert (left < allowed) == (rounds == 2)
    assert visible.missed[0] >= left / any_visible * (1 - 1e-9)


@pytest.mark.parametrize("permittivity", [pytest.param(1.0, marks=pytest.mark.slow), 1.0 + 1e-15])
def test_a_surface_of_air_returns_nothing(permittivity, radar):
    """Rounding leaves it a reflection of 1e-16, which no tolerance can be relative to: facets were made finer for half
    a minute. It still hides what is behind it."""
    air = Material("air", Conductor(permittivity, 0.0, ((1e9, 1e12),)), "none")
    board = MeshActor.from_mesh(trimesh.creation.box((0.01, 1, 1)), material=air, position=(2, 0, 1), name="board")
    ball = MeshActor.from_mesh(
        trimesh.creation.icosphere(2, radius=0.1), material="pec", position=(3, 0, 1), name="ball"
    )
    traced = Simulator(None, radar, [board], rtol=1e-3).tracer.trace(0.0, 0.0)
    assert (traced.moving.num_paths, traced.report.error) == (0, 0.0)
    assert Simulator(None, radar, [board, ball], rtol=1e-3).paths().num_paths == 0
