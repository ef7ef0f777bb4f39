"""The PIR shows what is where, as strong and as fast as it is, from the radar's side."""

import numpy as np
import pytest
import trimesh

from rfgen_sionna.radar import Radar
from rfgen_sionna.records import SPEED_OF_LIGHT
from rfgen_sionna.scene import Actor
from rfgen_sionna.simulation import Simulator

RADIUS, RANGE = 0.1, 2.5


@pytest.fixture(scope="module")
def radar():
    return Radar.load("awr1843", position=(0, 0, 1), look_at=(3, 0, 1))


@pytest.fixture(scope="module")
def sphere():
    return trimesh.creation.icosphere(subdivisions=5, radius=RADIUS)


def simulate(radar, sphere, position, velocity=(0, 0, 0)):
    return Simulator(None, radar, [Actor.from_mesh(sphere, material="pec", position=position, velocity=velocity)])


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
    pir = Simulator(None, radar).pir(resolution=(8, 4))
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
    ],
)
def test_bad_view(radar, options, message):
    with pytest.raises(ValueError, match=message):
        Simulator(None, radar).pir(**options)
