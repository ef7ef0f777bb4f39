"""Seams are sewn where that makes a surface, and nothing else is."""

from dataclasses import dataclass

import numpy as np
import pytest
import trimesh

from rfgen_sionna.scene import MeshActor, RigidMesh
from rfgen_sionna.scene.vertex_welding import weld_vertices
from tests.physics.stressing import one_element, traced

BALL = trimesh.creation.icosphere(subdivisions=3, radius=0.1)


def soup(mesh):
    """Each face with corners of its own."""
    return mesh.triangles.reshape(-1, 3), np.arange(3 * len(mesh.faces)).reshape(-1, 3)


def seamed(mesh):
    """The mesh with the vertices of its half at y > 0 given once more where it meets the other half."""
    half = mesh.triangles_center[:, 1] > 0
    faces = np.array(mesh.faces)
    faces[half] += len(mesh.vertices)
    return np.concatenate([mesh.vertices, mesh.vertices]), faces


@dataclass(frozen=True, eq=False)
class Breathing:
    """A mesh that grows and shrinks; vertices of its second half may drift away."""

    points: np.ndarray
    faces: np.ndarray
    drift: float
    part_names = ("all",)
    joint_names = ()
    duration = 1.0

    @property
    def face_parts(self):
        return np.zeros(len(self.faces), np.int32)

    def vertices(self, t):
        found = self.points * (1 + 0.01 * np.sin(t))
        found[len(found) // 2 :] += self.drift * t
        return found

    def joints(self, t):
        return np.empty((0, 3))


@pytest.mark.parametrize("split", [soup, seamed])
def test_a_ball_with_seams_is_a_ball(split):
    """All corners that were one are one again, and its return is the same to the last digits."""
    mesh = RigidMesh(*split(BALL))
    assert len(mesh.points) == len(BALL.vertices)
    radar = one_element()
    whole, sewed = (
        traced(radar, MeshActor(each, "metal", position=(2.0, 0.0, 0.0)))[0] for each in (RigidMesh.load(BALL), mesh)
    )
    assert abs(sewed / whole - 1) < 1e-9


@pytest.mark.parametrize("suffix", [".obj", ".ply", ".glb"])
def test_files_with_seams_are_read_as_one_surface(tmp_path, suffix):
    path = tmp_path / f"ball{suffix}"
    trimesh.Trimesh(*seamed(BALL), process=False).export(path)
    assert len(RigidMesh.load(path).points) == len(BALL.vertices)


def test_seams_that_are_turned_are_sewn_all_the_same():
    """Of a scene whose parts are placed by a rotation, which costs the last digits; and in single precision."""
    turn = trimesh.transformations.rotation_matrix(0.7, (1, 2, 3), (0.3, 0.1, 0.2))
    scene = trimesh.Scene()
    scene.add_geometry(trimesh.Trimesh(*seamed(BALL), process=False), transform=turn)
    assert len(RigidMesh.load(scene).points) == len(BALL.vertices)
    vertices, faces = seamed(BALL)
    assert len(np.unique(MeshActor(Breathing(vertices.astype(np.float32), faces, 0.0), "skin").faces)) == len(
        BALL.vertices
    )


def test_a_soup_that_looks_inwards_is_turned():
    vertices, faces = soup(BALL)
    with pytest.warns(UserWarning, match="point inwards"):
        mesh = RigidMesh(vertices, faces[:, ::-1])
    assert trimesh.Trimesh(mesh.points, mesh.faces, process=False).volume > 0


def test_seams_of_what_moves_are_sewn_where_they_stay_together():
    vertices, faces = seamed(BALL)
    together = MeshActor(Breathing(vertices, faces, 0.0), "skin").faces
    assert len(np.unique(together)) == len(BALL.vertices)
    apart = MeshActor(Breathing(vertices, faces, 0.1), "skin").faces
    np.testing.assert_array_equal(apart, faces)


def test_what_would_be_no_surface_is_left_apart():
    """Two boxes on one another, two sheets back to back, sheets in one place, neighbours that look opposite ways, and
    a sheet that would lose its area."""
    box = trimesh.creation.box((1, 1, 1))
    upper = box.copy()
    upper.apply_translation((0, 0, 1))
    boxes = trimesh.util.concatenate([box, upper])
    np.testing.assert_array_equal(weld_vertices(np.asarray(boxes.faces), [np.asarray(boxes.vertices)]), boxes.faces)
    ball = trimesh.creation.icosphere(2)
    sheet = ball.submesh([np.flatnonzero(ball.triangles_center[:, 2] > 0)], append=True)
    vertices, faces = np.asarray(sheet.vertices), np.asarray(sheet.faces)
    twice = np.concatenate([vertices, vertices])
    for other in (faces, faces[:, ::-1]):
        both = np.concatenate([faces, other + len(vertices)])
        left = weld_vertices(both, [twice])
        np.testing.assert_array_equal(left, both)
        assert len(RigidMesh(twice, both).faces) == 2 * len(faces)
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0.0]])
    opposed = np.array([[0, 1, 2], [4, 5, 3]])
    np.testing.assert_array_equal(weld_vertices(opposed, [corners[[0, 1, 2, 3, 1, 2]]]), opposed)
    lost = np.array([[0, 1, 2], [1, 3, 2]])
    np.testing.assert_array_equal(weld_vertices(lost, [corners[[0, 1, 2, 2]]]), lost)


def test_a_soup_whose_corners_differ_by_what_turning_costs_is_sewn():
    """As of a file in single precision, each of whose parts was turned by itself."""
    vertices, faces = soup(BALL)
    jittered = vertices + np.random.default_rng(0).normal(scale=5e-9, size=vertices.shape)
    assert len(RigidMesh(jittered, faces).points) == len(BALL.vertices)
