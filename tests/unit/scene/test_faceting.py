"""A mesh too coarse for the smooth surface that it samples is told from one that is fine, and from a box."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
import trimesh

from rfgen_sionna.scene import CoarseMeshWarning, MeshActor
from rfgen_sionna.scene.faceting import COARSE, faceting
from rfgen_sionna.simulation import Simulator


def of(mesh: trimesh.Trimesh):
    return faceting(np.asarray(mesh.vertices), np.asarray(mesh.faces))


@pytest.mark.parametrize("sections", [16, 64, 256])
def test_the_turn_of_a_round_bar(sections: int) -> None:
    """2 pi / n from face to face, whatever the length of the bar."""
    for length in (0.3, 3.0):
        assert of(trimesh.creation.cylinder(0.1, length, sections=sections)).turn == pytest.approx(2 * np.pi / sections)


@pytest.mark.parametrize("radius", [0.05, 0.6])
def test_spheres_need_as_many_facets_whatever_their_radius(radius: float) -> None:
    for subdivisions in (1, 2, 3, 4):
        found = of(trimesh.creation.icosphere(subdivisions, radius))
        assert found.facets_needed == pytest.approx(1300, rel=0.15)
        assert (found.turn > COARSE) == (subdivisions < 2)


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
    assert of(mesh).turn == pytest.approx(0.0, abs=1e-9)
    assert of(mesh).facets_needed == 0


def test_the_warning_says_what_would_do(tiny_radar) -> None:
    ball = MeshActor.from_mesh(trimesh.creation.icosphere(1, 0.15), material="metal", position=(3, 0, 0), name="ball")
    with pytest.warns(CoarseMeshWarning, match=r"'ball'.* 80 facets turn by \d+ degrees.* about 1,\d00 facets") as told:
        Simulator(None, tiny_radar, [ball])
    assert len(told) == 1
    fine = MeshActor.from_mesh(trimesh.creation.icosphere(3, 0.15), material="metal", position=(3, 0, 0), name="ball")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        Simulator(None, tiny_radar, [fine])
