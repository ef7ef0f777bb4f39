"""A metal sphere against the Mie series, and its phase while it moves."""

import numpy as np
import pytest
import trimesh

from rfgen_sionna.radar import Radar
from rfgen_sionna.records import SPEED_OF_LIGHT
from rfgen_sionna.scene import Actor
from rfgen_sionna.simulation import Simulator


def channel(paths, tx=0, rx=0):
    phase = 2 * np.pi * np.mod(paths.frequency * paths.tau[tx, rx, :, 0], 1.0)
    return complex((paths.a[tx, rx, :, 0] * np.exp(-1j * phase)).sum())


def test_phase_follows_the_motion():
    """A 15 cm sphere in 0.5 mm steps: -4 pi d / lambda within 0.5 degrees rms, level within 0.2 dB after spreading."""
    radar = Radar.load("awr1843")
    radius, range_, speed = 0.15, 3.0, 0.5
    mesh = trimesh.creation.icosphere(subdivisions=5, radius=radius)
    ball = Actor.from_mesh(mesh, material="pec", position=(range_, 0, 0), velocity=(speed, 0, 0), name="ball")
    sim = Simulator(None, radar, [ball])
    steps = 0.5e-3 * np.arange(41)
    returns = np.array([channel(sim.paths(float(step / speed))) for step in steps])
    tx, rx = radar.tx_world[0], radar.rx_world[0]
    centre = np.column_stack([range_ + steps, np.zeros_like(steps), np.zeros_like(steps)])
    r_t, r_r = (np.linalg.norm(centre - element, axis=1) for element in (tx, rx))
    # The specular point of a sphere for a narrow baseline: path = R_t + R_r - 2 a cos(half the bistatic angle).
    cosine = np.einsum("ij,ij->i", centre - tx, centre - rx) / (r_t * r_r)
    path = r_t + r_r - 2 * radius * np.sqrt((1 + cosine) / 2)
    wavelength = SPEED_OF_LIGHT / radar.center_frequency
    error = np.unwrap(np.angle(returns * np.exp(2j * np.pi * path / wavelength)))
    assert np.degrees(np.std(error)) < 0.5
    # pi rad from the metal: r_s = -1. The faceted sphere lies inside the true one by up to its sagitta.
    assert np.degrees(abs(np.mean(error))) == pytest.approx(180.0, abs=6.0)
    level = 20 * np.log10(np.abs(returns) * (range_ + steps) * (range_ + steps - radius))
    assert np.ptp(level) < 0.2


@pytest.mark.parametrize(("radius", "tolerance_db"), [(0.02, 0.3), (0.05, 0.1), (0.15, 0.1)])
def test_level_agrees_with_mie(radius, tolerance_db):
    """Backscatter of a metal sphere, referred to the near-field divergence R (R - a)."""
    miepython = pytest.importorskip("miepython")
    radar = Radar.load("awr1843")
    wavelength = SPEED_OF_LIGHT / radar.center_frequency
    # Two-way phase of the sagitta L^2 / 8a at 0.025 rad; an icosphere's edges are 1.1 a / 2^subdivisions.
    edge = 0.5 * np.sqrt(0.2 * radius * wavelength / np.pi)
    subdivisions = int(np.ceil(np.log2(1.1 * radius / edge)))
    mesh = trimesh.creation.icosphere(subdivisions=subdivisions, radius=radius)
    # Vertices on the sphere make a polyhedron that is too small: same area on the average instead.
    mesh.apply_scale(np.sqrt(4 * np.pi * radius**2 / mesh.area))
    levels = []
    for turn in range(6):
        rotated = mesh.copy()
        rotated.apply_transform(trimesh.transformations.random_rotation_matrix(np.random.default_rng(turn).random(3)))
        ball = Actor.from_mesh(rotated, material="pec", position=(3.0, 0, 0), name="ball")
        a = channel(Simulator(None, radar, [ball]).paths())
        levels.append(abs(a) ** 2 * (4 * np.pi) ** 3 * (3.0 * (3.0 - radius)) ** 2 / wavelength**2)
    size = 2 * np.pi * radius / wavelength
    # miepython's Q_back is sigma / (pi a^2); a huge imaginary index is a perfect conductor.
    mie = miepython.efficiencies_mx(1.0 - 1e6j, size)[2] * np.pi * radius**2
    assert 10 * np.log10(np.mean(levels) / mie) == pytest.approx(0.0, abs=tolerance_db)


def test_translation_and_rotation_of_everything_change_nothing():
    """Ten kilometres away and turned: same gains and delays to 1e-3 rad and 1e-3 dB."""
    from scipy.spatial.transform import Rotation

    mesh = trimesh.creation.icosphere(subdivisions=3, radius=0.1)
    place = np.array([2.0, 0.3, -0.2])
    here = Simulator(None, Radar.load("awr1843"), [Actor.from_mesh(mesh, material="skin", position=place)]).paths()
    orientation = (1.1, -0.4, 0.6)
    turn = Rotation.from_euler("ZYX", orientation).as_matrix()
    shift = np.array([10_000.0, -7_000.0, 300.0])
    radar = Radar.load("awr1843", position=tuple(shift), orientation=orientation)
    actor = Actor.from_mesh(mesh, material="skin", position=shift + turn @ place, orientation=orientation)
    there = Simulator(None, radar, [actor]).paths()
    for tx in range(3):
        for rx in range(4):
            ratio = channel(there, tx, rx) / channel(here, tx, rx)
            assert abs(np.angle(ratio)) < 1e-3
            assert abs(20 * np.log10(abs(ratio))) < 1e-3
