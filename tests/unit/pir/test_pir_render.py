"""The PIR shows what is where, as strong and as fast as it is, from the radar's side."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh

from rfgen_sionna._types import SPEED_OF_LIGHT
from rfgen_sionna.pir.projection import PROJECTIONS
from rfgen_sionna.pir.view import View
from rfgen_sionna.radar import Radar
from rfgen_sionna.scene import MATERIALS, MeshActor
from rfgen_sionna.simulation import Simulator

RADIUS, RANGE = 0.1, 2.5


@pytest.fixture(scope="module")
def radar():
    return Radar.load("awr1843", position=(0, 0, 1), look_at=(3, 0, 1))


@pytest.fixture(scope="module")
def sphere():
    return trimesh.creation.icosphere(subdivisions=5, radius=RADIUS)


def simulate(radar, sphere, position, velocity=(0, 0, 0)):
    return Simulator(
        None, radar, [MeshActor.from_mesh(sphere, material="pec", position=position, velocity=velocity)], rtol=1e-3
    )


@pytest.mark.parametrize("resolution", [(64, 64), (33, 47), (128, 128)])
def test_sphere_in_front(radar, sphere, resolution):
    """Nearest point, outline and radial velocity of a sphere on the boresight, at any resolution."""
    pir = simulate(radar, sphere, (RANGE, 0, 1), (-0.7, 0, 0)).pir(0.0, resolution=resolution, fov_deg=20)
    assert pir.energy.shape == resolution
    hit = np.isfinite(pir.time_of_arrival)
    nearest = np.nanmin(pir.time_of_arrival) * SPEED_OF_LIGHT / 2
    pixel = np.radians(20) / max(resolution)
    # Off the axis by half a pixel the front of the sphere recedes by (R pixel)^2 / 4a at most.
    assert nearest == pytest.approx(RANGE - RADIUS, abs=1e-3 + (RANGE * pixel) ** 2 / (4 * RADIUS))
    angle = 2 * np.sqrt(np.count_nonzero(hit) / np.pi) * pixel
    assert angle == pytest.approx(2 * np.arcsin(RADIUS / RANGE), abs=3 * pixel)
    np.testing.assert_allclose(pir.velocity[hit], -0.7, atol=2e-3)
    assert not pir.energy[~hit].any()
    assert not pir.velocity[~hit].any()
    # The mirror point is in the middle.
    row, column = np.unravel_index(pir.energy.argmax(), pir.energy.shape)
    assert abs(row - (resolution[0] - 1) / 2) <= 1
    assert abs(column - (resolution[1] - 1) / 2) <= 1


def test_left_is_left_and_up_is_up(radar, sphere):
    """+y, the radar's left, is in the left columns; higher is in the upper rows."""
    left_up = simulate(radar, sphere, (RANGE, 0.5, 1.4)).pir(fov_deg=60, resolution=(64, 64))
    row, column = np.unravel_index(left_up.energy.argmax(), left_up.energy.shape)
    scale = 32 / np.tan(np.radians(30))
    assert column == pytest.approx(31.5 - scale * 0.5 / RANGE, abs=1.5)
    assert row == pytest.approx(31.5 - scale * 0.4 / RANGE, abs=1.5)


def test_energy_of_one_pixel_is_that_of_the_paths(radar, sphere):
    """A single pixel around the sphere receives |sum of the facets' returns|^2: rays and facets agree.

    A second opinion: patches 1.5 wavelengths wide against facets half as wide; flat patches on a bend make a phase
    grating of 0.2 rad, whose lobes add up to 10 % of the sphere: 1 dB.
    """
    sim = simulate(radar, sphere, (RANGE, 0, 1))
    paths = sim.paths()
    # The PIR's Tx and Rx are at the phase centre, the paths' at the elements: the sphere's return hardly differs.
    phase = 2 * np.pi * np.mod(paths.frequency * paths.tau[..., 0], 1.0)
    facets = np.mean(np.abs((paths.a[..., 0] * np.exp(-1j * phase)).sum(axis=-1)) ** 2)
    pixel = sim.pir(fov_deg=6, resolution=(1, 1)).energy[0, 0]
    assert 10 * np.log10(pixel / facets) == pytest.approx(0.0, abs=1.0)


def test_own_viewpoint(radar, sphere):
    """A PIR from elsewhere: from the side the sphere is as far as it is from there."""
    sim = simulate(radar, sphere, (RANGE, 0, 1))
    pir = sim.pir(fov_deg=20, resolution=(64, 64), position=(RANGE, 1.5, 1.0), orientation=(-np.pi / 2, 0, 0))
    assert np.nanmin(pir.time_of_arrival) * SPEED_OF_LIGHT / 2 == pytest.approx(1.5 - RADIUS, abs=2e-3)
    assert pir.position == (RANGE, 1.5, 1.0)


def test_nothing_there(radar):
    pir = Simulator(None, radar, rtol=1e-3).pir(resolution=(8, 4))
    assert not pir.energy.any()
    assert np.isnan(pir.time_of_arrival).all()
    assert pir.fov_deg[0] == 60.0
    assert pir.fov_deg[1] == pytest.approx(np.degrees(2 * np.arctan(2 * np.tan(np.radians(30)))))


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"resolution": (0, 5)}, "resolution is"),
        ({"resolution": (5, 5000)}, "resolution is"),
        ({"fov_deg": 180}, "fov_deg is 180"),
        ({"fov_deg": (60, -1)}, "fov_deg is"),
        ({"fov_deg": "wide"}, "fov_deg is 'wide'"),
        ({"fov_deg": (60,)}, "fov_deg is"),
        ({"fov_deg": None}, "fov_deg is None"),
        ({"resolution": 8}, "resolution is 8"),
        ({"resolution": None}, "resolution is None"),
        ({"resolution": (True, 8)}, "resolution is"),
        ({"resolution": (8.5, 8)}, "resolution is"),
        ({"fov_deg": "1e-3"}, "fov_deg is '1e-3'"),
        ({"fov_deg": ("60", "40")}, "fov_deg is"),
        ({"fov_deg": (True, True)}, "fov_deg is"),
        ({"fov_deg": 60j}, "fov_deg is"),
        ({"fov_deg": [60, [40]]}, "fov_deg is"),
        ({"bounces": np.array([1, 2])}, "bounces is"),
        ({"bounces": 1.0}, "bounces is"),
        ({"bounces": True}, "bounces is"),
        ({"projection": np.array(["perspective", "perspective"])}, "projection is"),
        ({"projection": None}, "projection is"),
    ],
)
def test_bad_view(radar, options, message):
    with pytest.raises(ValueError, match=message):
        Simulator(None, radar).pir(**options)


def test_what_is_behind_is_in_a_view_all_around(radar, sphere):
    """An equirectangular image shows the sphere at its azimuth and elevation, wherever it is, as far and as strong as a
    perspective one that looks at it: patches of another shape make another phase grating of a bend, within 0.5 dB."""
    azimuth, elevation = np.radians(130.0), np.radians(20.0)
    towards = np.array([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)])
    sim = simulate(radar, sphere, tuple(np.array([0, 0, 1]) + RANGE * towards), tuple(-0.5 * towards))
    around = sim.pir(fov_deg=360, resolution=(60, 120), projection="equirectangular")
    assert around.projection == "equirectangular"
    assert around.fov_deg == (360.0, 180.0)
    row, column = np.unravel_index(around.energy.argmax(), around.energy.shape)
    assert 90 - 3 * (row + 0.5) == pytest.approx(20.0, abs=3)
    assert 180 - 3 * (column + 0.5) == pytest.approx(130.0, abs=3)
    ahead = sim.pir(fov_deg=40, resolution=(13, 13), orientation=(azimuth, -elevation, 0.0))
    seen = np.isfinite(around.time_of_arrival)
    assert np.nanmin(around.time_of_arrival) == pytest.approx(np.nanmin(ahead.time_of_arrival), rel=2e-3)
    np.testing.assert_allclose(around.velocity[seen], -0.5, atol=5e-3)
    one, other = (
        sim.pir(fov_deg=30, resolution=(1, 1), orientation=(azimuth - 0.1, tilt, 0.0), projection=projection).energy
        for projection, tilt in (("equirectangular", -elevation - 0.1), ("perspective", -elevation))
    )
    assert abs(10 * np.log10(one.item() / other.item())) < 0.5


def test_a_wall_returns_the_same_in_both_projections(radar):
    """Diffuse energy of a rough wall goes with the solid angle of the pixels, not with their projection."""
    wall = trimesh.creation.box((0.1, 4.0, 4.0))
    rough = replace(MATERIALS["concrete"], thickness=None, scattering_coefficient=1.0)
    sim = Simulator(None, radar, [MeshActor.from_mesh(wall, material=rough, position=(3.05, 0, 1))], rtol=1e-3)
    flat, even = (sim.pir(fov_deg=30, resolution=(24, 24), projection=each) for each in PROJECTIONS)
    views = [View.of(each) for each in (flat, even)]
    density = [pir.energy / view.solid_angles for pir, view in zip((flat, even), views, strict=True)]
    row, column = (np.clip(np.rint(x), 0, 23).astype(int) for x in views[0].coordinates(views[1].directions))
    inside = (np.abs(views[0].coordinates(views[1].directions)[0] - 11.5) < 11) & (row > 0) & (column > 0)
    ratio = 10 * np.log10(density[1][inside] / density[0][row, column][inside])
    assert np.abs(ratio).max() < 0.15  # directions differ by up to half a pixel
    np.testing.assert_allclose(even.time_of_arrival[11:13, 11:13], flat.time_of_arrival[11:13, 11:13], rtol=1e-3)
