"""Shadows as each pair of elements sees them: a plate behind the edge of a screen half way, against quadrature of what
Tx and Rx both see."""

from dataclasses import replace

import numpy as np
import pytest
import sionna.rt as rt
import trimesh

from rfgen_sionna._types import SPEED_OF_LIGHT
from rfgen_sionna.radar import ElementPattern, Radar
from rfgen_sionna.scene import MeshActor
from rfgen_sionna.simulation import Simulator
from rfgen_sionna.tracing.tracer import Tracer

PLATE, SCREEN, WIDTH = 2.0, 1.0, 0.6


def radar(name="awr1843"):
    return replace(Radar.load(name), pattern=ElementPattern(0.0))


def rectangle(x, left, right, half):
    """Across the boresight, from one y to the other, as high as wide."""
    corners = [[x, left, -half], [x, right, -half], [x, right, half], [x, left, half]]
    return trimesh.Trimesh(corners, [[0, 2, 1], [0, 3, 2]], process=False)


def seen_by_both(tx, rx, edge, wavenumber, points, other=np.inf):
    """Physical optics of the plate where neither Tx nor Rx sees a screen up to y = `edge`, nor one from `other` on."""
    low, high = (
        [each[1] + (end - each[1]) * (PLATE - each[0]) / (SCREEN - each[0]) for each in (tx, rx)]
        for end in (edge, other)
    )
    low, high = max(*low, -WIDTH / 2), min(*high, WIDTH / 2)
    if low >= high:
        return 0.0
    one, weight = np.polynomial.legendre.leggauss(points)
    y, z = low + 0.5 * (high - low) * (1 + one), 0.5 * WIDTH * one
    area = np.multiply.outer(0.5 * (high - low) * weight, 0.5 * WIDTH * weight)
    there = np.stack(np.broadcast_arrays(PLATE, y[:, None], z), axis=-1)
    to_tx, to_rx = (np.linalg.norm(there - each, axis=-1) for each in (tx, rx))
    return (area * PLATE / to_tx * np.exp(-1j * wavenumber * (to_tx + to_rx)) / (4 * np.pi * to_tx * to_rx)).sum()


def of_the_plate(traced):
    """(tx, rx) what comes back by the plate in the middle of the band, with all shadows."""
    total = 0.0
    for paths in (traced.static, traced.moving, *(each.paths for each in traced.shadows)):
        if paths.num_paths and "plate" in paths.object_names:
            mine = paths.object_id == paths.object_names.index("plate")
            phase = 2 * np.pi * np.mod(paths.frequency * paths.tau[..., mine, 0], 1.0)
            total = total + (paths.a[..., mine, 0] * np.exp(-1j * phase)).sum(axis=-1)
    return np.asarray(total)


def held_against_quadrature(radar, traced, edge, points=500, pairs=slice(None)):
    """Largest error of any pair, of itself, and the range of levels [dB]; a phase that all share is free."""
    wavenumber = 2 * np.pi * traced.moving.frequency / SPEED_OF_LIGHT
    tx, rx = radar.tx_world[pairs], radar.rx_world[pairs]
    true = np.array([[seen_by_both(a, b, edge, wavenumber, points) for b in rx] for a in tx])
    ratio = of_the_plate(traced)[pairs, pairs] / true
    turned = ratio / (ratio.sum() / abs(ratio.sum()))
    return np.abs(turned - 1).max(), np.ptp(20 * np.log10(np.abs(true)))


@pytest.mark.slow
@pytest.mark.parametrize("edge", [-0.05, -0.02, 0.0, 0.013, 0.03])
@pytest.mark.parametrize("rtol", [1e-2, 1e-3])
def test_each_pair_sees_the_shadow_from_its_own_place(edge, rtol):
    """At 0 the phase centre's edge falls between two rows of facets. Shadows from there alone were up to 3 dB off."""
    radar_here = radar()
    plate = MeshActor.from_mesh(rectangle(PLATE, -WIDTH / 2, WIDTH / 2, WIDTH / 2), material="pec", name="plate")
    screen = MeshActor.from_mesh(rectangle(SCREEN, edge - 1.0, edge, 1.0), material="pec", name="screen")
    traced = Tracer(None, radar_here, [plate, screen], rtol).trace(0.0, 0.0)
    error, levels = held_against_quadrature(radar_here, traced, edge)
    assert error < min(traced.report.error, 0.006 + rtol)
    assert levels > (0.8 if edge < 0 else 2.0)  # pairs differ by so much


@pytest.mark.parametrize("still", ["plate", "screen", pytest.param("both", marks=pytest.mark.slow)])
def test_of_what_stays_and_of_what_moves_alike(tmp_path, still):
    edge, rtol, meshes, scene, actors = 0.013, 1e-2, {}, rt.load_scene(), []
    meshes["plate"] = rectangle(PLATE, -WIDTH / 2, WIDTH / 2, WIDTH / 2)
    meshes["screen"] = rectangle(SCREEN, edge - 1.0, edge, 1.0)
    for name, mesh in meshes.items():
        if still not in (name, "both"):
            actors.append(MeshActor.from_mesh(mesh, material="pec", name=name))
            continue
        mesh.export(tmp_path / f"{name}.ply")
        metal = rt.RadioMaterial(f"metal-{name}", relative_permittivity=1.0, conductivity=1e9)
        scene.edit(add=rt.SceneObject(fname=str(tmp_path / f"{name}.ply"), name=name, radio_material=metal))
    radar_here = radar()
    traced = Simulator(scene, radar_here, actors, rtol=rtol).tracer.trace(0.0, 0.0)
    error, _ = held_against_quadrature(radar_here, traced, edge)
    # Static facets are in the shadow from the phase centre alone: up to 3 dB for single pairs.
    assert error < (0.41 if still == "plate" else 0.02)


@pytest.mark.parametrize(
    ("edge", "other", "error"),
    [(-0.0015, 0.0015, 0.25), pytest.param(-0.004, 0.004, 0.25, marks=pytest.mark.slow), (0.003, 0.02, 0.12)],
)
def test_through_a_slit_each_pair_sees_its_own_part_or_nothing(edge, other, error):
    """Tx and Rx 5 to 19 mm apart see parts of the plate through a slit of 3 mm that have nothing in common, but
    for the two nearest."""
    radar_here = radar()
    plate = MeshActor.from_mesh(rectangle(PLATE, -WIDTH / 2, WIDTH / 2, WIDTH / 2), material="pec", name="plate")
    slab_stacks = [
        MeshActor.from_mesh(rectangle(SCREEN, *ends, 1.0), material="pec", name=name)
        for name, ends in (("left", (edge - 1.0, edge)), ("right", (other, other + 1.0)))
    ]
    traced = Tracer(None, radar_here, [plate, *slab_stacks], 1e-2).trace(0.0, 0.0)
    wavenumber = 2 * np.pi * traced.moving.frequency / SPEED_OF_LIGHT
    tx, rx = radar_here.tx_world, radar_here.rx_world
    true = np.array([[seen_by_both(a, b, edge, wavenumber, 500, other) for b in rx] for a in tx])
    found = of_the_plate(traced)
    turn = np.vdot(true, found)
    centre = abs(seen_by_both(np.zeros(3), np.zeros(3), edge, wavenumber, 500, other))
    assert np.abs(found * abs(turn) / turn - true).max() < error * centre
    assert np.abs(true).min() < (0.01 if other - edge < 0.004 else 0.9) * centre
