"""A mesh too coarse for the smooth surface that it describes is told from one that is fine, and from a box."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
import trimesh

from rfgen_sionna.records import SPEED_OF_LIGHT
from rfgen_sionna.scene import Actor, CoarseMeshWarning
from rfgen_sionna.scene.faceting import COARSE, faceting
from rfgen_sionna.simulation import Simulator


def of(mesh: trimesh.Trimesh):
    return faceting(np.asarray(mesh.vertices), np.asarray(mesh.faces))


@pytest.mark.parametrize("sections", [16, 64, 256])
def test_the_sagitta_of_a_round_bar(sections: int) -> None:
    """r (1 - cos(pi / n)) between chords of a circle, whatever the length of the bar."""
    for length in (0.3, 3.0):
        bar = trimesh.creation.cylinder(0.1, length, sections=sections)
        assert of(bar).sagitta == pytest.approx(0.1 * (1 - np.cos(np.pi / sections)), rel=0.02)


@pytest.mark.parametrize("radius", [0.05, 0.15, 0.6])
def test_spheres_need_facets_by_their_radius(radius: float) -> None:
    for subdivisions in (3, 4, 5):
        found = of(trimesh.creation.icosphere(subdivisions, radius))
        assert found.facets_needed(77e9) == pytest.approx(3500 * radius / 0.05, rel=0.05)
        assert found.phase(77e9) == pytest.approx(4 * np.pi * 77e9 / SPEED_OF_LIGHT * found.sagitta)
        assert (found.phase(77e9) > COARSE) == (found.facets < found.facets_needed(77e9))


@pytest.mark.parametrize(
    "mesh",
    [
        trimesh.creation.box((0.5, 0.4, 0.3)),
        trimesh.creation.box((0.5, 0.4, 0.3)).subdivide().subdivide(),
        trimesh.Trimesh([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], [[0, 1, 2], [0, 2, 3]]),
        trimesh.creation.icosahedron(),
        trimesh.creation.cylinder(0.2, 0.002, sections=32),
    ],
)
def test_edges_and_planes_are_what_they_are(mesh: trimesh.Trimesh) -> None:
    assert of(mesh).sagitta == pytest.approx(0.0, abs=1e-9)
    assert of(mesh).facets_needed(77e9) == 0


def test_the_warning_says_what_would_do(tiny_radar) -> None:
    ball = Actor.from_mesh(trimesh.creation.icosphere(4, 0.15), material="metal", position=(3, 0, 0), name="ball")
    with pytest.warns(
        CoarseMeshWarning, match=r"'ball'.* 5,120 facets .* 0\.2 rad at 7\d.* about 1 dB.* 11,000"
    ) as told:
        Simulator(None, tiny_radar, [ball])
    assert len(told) == 1
    fine = Actor.from_mesh(trimesh.creation.icosphere(5, 0.15), material="metal", position=(3, 0, 0), name="ball")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        Simulator(None, tiny_radar, [fine])


@pytest.mark.slow
@pytest.mark.parametrize("subdivisions", [3, 4, 5])
def test_the_error_is_in_proportion(tiny_radar, subdivisions: int) -> None:
    """The level of a sphere over random orientations strays by 6 dB per radian, within a factor of two."""
    rng = np.random.default_rng(0)
    radius = 0.05
    mesh = trimesh.creation.icosphere(subdivisions, radius)
    levels = []
    for _ in range(12):
        ball = Actor.from_mesh(
            mesh, material="metal", position=(3, 0, 0), orientation=rng.uniform(-3, 3, 3), name="ball"
        )
        paths = Simulator(None, tiny_radar, [ball]).paths()
        turn = np.exp(-2j * np.pi * np.mod(paths.frequency * paths.tau[0, 0, :, 0], 1.0))
        levels.append(20 * np.log10(np.abs((paths.a[0, 0, :, 0] * turn).sum())))
    # First-order physical optics of a sphere near by: |a| = wavelength radius / (8 pi R (R - radius)).
    truth = 20 * np.log10(tiny_radar.wavelength * radius / (8 * np.pi * 3 * (3 - radius)))
    worst = np.abs(np.array(levels) - truth).max()
    assert worst < 12 * of(mesh).phase(tiny_radar.center_frequency) + 0.05
    assert worst > 2 * of(mesh).phase(tiny_radar.center_frequency) - 0.05
