"""Kernels of facet positions and estimated returns against NumPy."""

import numpy as np
import pytest
import trimesh

from rfgen_sionna.scene.mesh import face_normals
from rfgen_sionna.tracing.surface.facet_positions import place_facets
from rfgen_sionna.tracing.surface.return_estimates import (
    estimate_returns,
)
from rfgen_sionna.tracing.surface.tessellate import Tessellation, tessellate

BALL = trimesh.creation.icosphere(subdivisions=3, radius=0.3)
VERTICES, FACES = np.asarray(BALL.vertices), BALL.faces.astype(np.int32)
RADAR = np.array([-2.0, 0.4, 0.1])
WAVENUMBER = 1633.0


def times(count):
    return [VERTICES * [1, 1, 1 + 0.1 * k] + [0.1 * k, 0.02, 0] for k in range(count)]


def pieces(kind):
    """The faces themselves, some of them in another order, or faces in pieces."""
    count = len(FACES)
    chosen = np.arange(count) if kind == "faces" else np.random.default_rng(0).permutation(count)[:200]
    eye = np.broadcast_to(np.eye(3), (len(chosen), 3, 3))
    if kind != "pieces":
        return Tessellation(chosen.astype(np.int32), eye, np.ones(len(chosen), np.int32))
    plate = trimesh.creation.box((0.5, 0.5, 0.02))
    return tessellate(np.asarray(plate.vertices), plate.faces.astype(np.int32), RADAR, 77e9, 1e-2)


@pytest.mark.parametrize("subdivisions", [3, 1, 0])
@pytest.mark.parametrize("count", [1, 3])
def test_one_recording_serves_meshes_of_all_sizes(subdivisions, count):
    """Meshes of one facet included."""
    ball = trimesh.creation.icosphere(subdivisions=subdivisions, radius=0.3)
    faces = ball.faces.astype(np.int32)
    for chosen in (np.arange(len(faces)), np.array([len(faces) // 2]), np.array([3, 1])):
        eye = np.broadcast_to(np.eye(3), (len(chosen), 3, 3))
        piece = Tessellation(chosen.astype(np.int32), eye, np.ones(len(chosen), np.int32))
        vertices = [np.asarray(ball.vertices) + 0.1 * k for k in range(count)]
        found = place_facets(piece, faces, vertices, RADAR, WAVENUMBER)
        for k, points in enumerate(vertices):
            assert np.allclose(found.corners[k], points[faces[chosen]], rtol=0, atol=1e-14)
            assert np.allclose(
                found.return_estimate[k], estimate_returns((points[faces[chosen]] - RADAR).T, WAVENUMBER), rtol=1e-9
            )


@pytest.mark.parametrize("kind", ["faces", "some", "pieces"])
@pytest.mark.parametrize("count", [1, 3])
def test_facets_follow_the_corners_of_their_faces(kind, count):
    piece = pieces(kind)
    vertices, faces = times(count), FACES
    if kind == "pieces":
        plate = trimesh.creation.box((0.5, 0.5, 0.02))
        vertices = [np.asarray(plate.vertices) + 0.1 * k for k in range(count)]
        faces = plate.faces.astype(np.int32)
        assert len(piece.pieces) > 100
    found = place_facets(piece, faces, vertices, RADAR, WAVENUMBER)
    for k, points in enumerate(vertices):
        corners = piece.corners(points, faces)
        assert np.allclose(found.corners[k], corners, rtol=0, atol=1e-14)
        assert np.allclose(found.centroids[k], corners.mean(axis=1), rtol=0, atol=1e-14)
        normals, middles = face_normals(points, faces), points[faces].mean(axis=1)
        facing = np.einsum("fi,fi->f", normals, RADAR - middles) > 0
        assert np.array_equal(found.towards[k], facing[piece.face])
        assert np.allclose(found.return_estimate[k], estimate_returns((corners - RADAR).T, WAVENUMBER), rtol=1e-9)


def test_no_facets():
    none = Tessellation(np.zeros(0, np.int32), np.zeros((0, 3, 3)), np.zeros(0, np.int32))
    found = place_facets(none, FACES, times(2), RADAR, WAVENUMBER)
    assert found.corners.shape == (2, 0, 3, 3)
    assert found.towards.shape == found.return_estimate.shape == (2, 0)
