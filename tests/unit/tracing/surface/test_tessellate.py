"""Facets are pieces of faces, with or without faces out of range."""

import numpy as np
import pytest
import trimesh

from rfgen_sionna.radar import Radar
from rfgen_sionna.scene import MeshActor
from rfgen_sionna.tracing.surface.smoothing import find_smoothing
from rfgen_sionna.tracing.surface.tessellate import tessellate
from rfgen_sionna.tracing.tracer import Tracer

BALL = trimesh.creation.icosphere(3, 0.3)


@pytest.mark.parametrize("order", ["near first", "far first"])
@pytest.mark.parametrize("reach", [2.5, 3.0, 20.0])
def test_facets_lie_where_their_faces_do(order, reach):
    """None, some or all of the faces of a ball at 3 m are in range."""
    vertices, faces = np.asarray(BALL.vertices) + np.array([3.0, 0, 0]), np.asarray(BALL.faces, np.int32)
    distance = np.linalg.norm(vertices[faces].mean(axis=1), axis=1)
    faces = faces[np.argsort(distance if order == "near first" else -distance)]
    smooth = find_smoothing(vertices, faces)
    pieces = tessellate(vertices, faces, np.zeros(3), 77e9, 1e-1, max_range=reach, smooth=smooth)
    assert (len(np.unique(pieces.face)) == len(faces)) == (reach == 20.0)
    assert (len(pieces.face) == 0) == (reach == 2.5)
    corners = pieces.corners(vertices, faces)
    assert np.allclose(corners, pieces.weights @ vertices[faces[pieces.face]], rtol=0, atol=1e-12)
    patch, of_faces = pieces.patches([vertices], faces, smooth)[0], smooth.patch(vertices, faces)
    assert patch.sagittas.shape == corners.shape
    whole = np.setdiff1d(np.arange(len(pieces.face)), pieces.pieces)
    np.testing.assert_allclose(patch.sagittas[whole], of_faces.sagittas[pieces.face[whole]], rtol=0, atol=1e-16)


@pytest.mark.parametrize("mesh", [BALL, trimesh.creation.box((0.3, 0.3, 0.3))], ids=["ball", "box"])
@pytest.mark.parametrize("far_first", [True, False])
def test_objects_out_of_range_do_not_change_those_within(mesh, far_first):
    radar = Radar.load("awr1843")

    def actor(distance):
        return MeshActor.from_mesh(mesh, material="pec", position=(distance, 0.1, 0.0), name=f"at {distance:.0f} m")

    near, far = actor(3.0), actor(2.0 * radar.max_range)
    alone = Tracer(None, radar, [near], 1e-2).instant(0.0)
    both = Tracer(None, radar, [far, near] if far_first else [near, far], 1e-2).instant(0.0)
    assert alone.num_paths > 0
    assert np.array_equal(both.a, alone.a)
    assert np.array_equal(both.tau, alone.tau)
