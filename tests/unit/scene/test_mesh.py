"""Meshes are checked before they are used."""

from pathlib import Path

import numpy as np
import pytest
import trimesh

from rfgen_sionna.records import MeshSequence
from rfgen_sionna.scene import MeshError, RigidMesh, check_mesh

TETRAHEDRON = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
FACES = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])


def test_a_good_mesh_passes_unchanged():
    vertices, faces = check_mesh(TETRAHEDRON, FACES)
    np.testing.assert_array_equal(vertices, TETRAHEDRON)
    np.testing.assert_array_equal(faces, FACES)
    assert (vertices.dtype, faces.dtype) == (np.float64, np.int32)


def test_an_open_plate_is_allowed():
    _, faces = check_mesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
    assert len(faces) == 2


@pytest.mark.parametrize(
    ("vertices", "faces", "message"),
    [
        (np.empty((0, 3)), np.empty((0, 3), int), "the mesh is empty, it has no vertices"),
        (TETRAHEDRON, np.empty((0, 3), int), "the mesh is empty, it has no faces"),
        (TETRAHEDRON[:, :2], FACES, r"vertices have shape \(4, 2\)"),
        (TETRAHEDRON, [[0, 1, 2, 3]], r"faces have shape \(1, 4\), only triangles"),
        (TETRAHEDRON, [[0, 1, 2], [0, 1]], "ragged"),
        (TETRAHEDRON, [[0, 1, 4]], r"face 0 = \(0, 1, 4\); indices must lie in 0 … 3"),
        (TETRAHEDRON, [[0, 1, -1]], "a vertex that does not exist"),
        (TETRAHEDRON, [[0, 1, 1.5]], "not integers"),
        (TETRAHEDRON, [["a", "b", "c"]], "numbers are needed"),
        (
            np.where(TETRAHEDRON == 1, np.nan, TETRAHEDRON),
            FACES,
            "3 of 4 vertices are NaN or infinite, the first is vertex 1",
        ),
        (np.where(TETRAHEDRON == 1, np.inf, TETRAHEDRON), FACES, "NaN or infinite"),
        (
            TETRAHEDRON * 1e160,
            FACES,
            r"3 of 4 vertices are too far off, the first is vertex 1 = \(1e\+160, .* 1e\+10 m",
        ),
        (TETRAHEDRON * 1e200, FACES, "too far off"),
        (TETRAHEDRON + 1.1e10, FACES, "4 of 4 vertices are too far off"),
        (np.ma.masked_equal(TETRAHEDRON, 1.0), FACES, "vertices: 3 values are masked"),
        (TETRAHEDRON, [[0, 1, 1]], "all 1 faces have zero area"),
        (TETRAHEDRON, [*FACES, [1, 0, 3]], "not manifold, 3 edges are shared by more than two faces"),
        (TETRAHEDRON, [*FACES, [3, 0, 1]], "1 of 5 faces are there a second time: leave one of each"),
        (TETRAHEDRON, [*FACES, *FACES[:, ::-1]], "4 of 8 faces are there a second time, 4 of them reversed, as in a"),
        (TETRAHEDRON, [FACES[0], FACES[0]], "oriented against each other .* 1 of 2 faces are there a second time"),
        (
            TETRAHEDRON,
            [[0, 1, 2], [0, 1, 3]],
            "oriented against each other at 1 edges; the first joins vertices 0 and 1",
        ),
    ],
)
def test_a_bad_mesh_is_named(vertices, faces, message):
    with pytest.raises(MeshError, match=message) as error:
        check_mesh(vertices, faces, "target")
    assert str(error.value).startswith("target: ")
    assert isinstance(error.value, ValueError)


def test_faces_without_area_are_dropped_and_counted():
    with pytest.warns(UserWarning, match="dropped 2 of 6 faces"):
        _, faces = check_mesh(TETRAHEDRON, [*FACES, [0, 1, 1], [2, 2, 2]])
    np.testing.assert_array_equal(faces, FACES)


def test_area_is_judged_by_the_size_of_the_mesh():
    """A millimetre mesh and a kilometre mesh keep all their faces, also 10 km away from the origin."""
    ball = trimesh.creation.icosphere(subdivisions=3)
    for scale in (1e-3, 1e3):
        _, faces = check_mesh(ball.vertices * scale, ball.faces)
        assert len(faces) == len(ball.faces)
    _, faces = check_mesh(ball.vertices * 0.05 + 1e4, ball.faces)
    assert len(faces) == len(ball.faces)


def test_a_billion_metres_off_is_not_too_far():
    vertices, faces = check_mesh(TETRAHEDRON + 1e9, FACES)
    np.testing.assert_array_equal(vertices, TETRAHEDRON + 1e9)
    assert len(faces) == len(FACES)


def test_an_array_with_nothing_masked_is_an_array():
    np.testing.assert_array_equal(check_mesh(np.ma.masked_array(TETRAHEDRON), FACES)[0], TETRAHEDRON)


@pytest.mark.parametrize("place", [(1e6, 0.0, 0.0), (np.nan, 0.0, 0.0), (np.inf, 1e200, 0.0)])
@pytest.mark.parametrize("at", [0, 2, 4])
def test_vertices_that_no_face_uses_are_left_out(place, at):
    ball = TETRAHEDRON * 1e-6
    vertices, faces = check_mesh(np.insert(ball, at, place, axis=0), np.where(at > FACES, FACES, FACES + 1))
    np.testing.assert_array_equal(vertices, ball)
    np.testing.assert_array_equal(faces, FACES)
    assert faces.dtype == np.int32


def test_errors_number_vertices_as_they_were_given():
    broken = np.insert(TETRAHEDRON, 0, 7.0, axis=0)
    broken[3] = np.nan
    with pytest.raises(MeshError, match="1 of 5 vertices are NaN or infinite, the first is vertex 3"):
        check_mesh(broken, FACES + 1)


def test_tensors_are_taken_without_their_gradients():
    torch = pytest.importorskip("torch")
    vertices, faces = check_mesh(torch.tensor(TETRAHEDRON, requires_grad=True), torch.tensor(FACES))
    np.testing.assert_array_equal(vertices, TETRAHEDRON)
    np.testing.assert_array_equal(faces, FACES)


def test_a_mesh_inside_out_is_turned():
    with pytest.warns(UserWarning, match="point inwards"):
        _, faces = check_mesh(TETRAHEDRON, FACES[:, ::-1])
    assert trimesh.Trimesh(TETRAHEDRON, faces).volume > 0


def test_a_hollow_body_keeps_its_inner_surface():
    outer, inner = trimesh.creation.icosphere(1), trimesh.creation.icosphere(1, 0.5)
    inner.invert()
    hollow = trimesh.util.concatenate(outer, inner)
    _, faces = check_mesh(hollow.vertices, hollow.faces)
    np.testing.assert_array_equal(faces, hollow.faces)


def test_the_arrays_given_are_not_touched():
    vertices, faces = TETRAHEDRON.copy(), FACES.copy()
    mesh = RigidMesh(vertices, faces)
    vertices[:] = 7
    faces[:] = 0
    np.testing.assert_array_equal(mesh.vertices(3.0), TETRAHEDRON)
    np.testing.assert_array_equal(mesh.faces, FACES)
    with pytest.raises(ValueError, match="read-only"):
        mesh.vertices(0.0)[0] = 1.0


def test_a_rigid_mesh_is_a_mesh_sequence():
    mesh = RigidMesh.load((TETRAHEDRON, FACES), "tetra")
    assert isinstance(mesh, MeshSequence)
    assert mesh.part_names == ("tetra",)
    assert mesh.face_parts.tolist() == [0] * 4
    assert mesh.duration == np.inf
    assert mesh.joints(0.0).shape == (0, 3)


@pytest.mark.parametrize("suffix", [".stl", ".ply", ".obj", ".off"])
def test_files_are_read(tmp_path: Path, suffix: str):
    path = tmp_path / f"ball{suffix}"
    ball = trimesh.creation.icosphere(subdivisions=2)
    ball.export(path)
    mesh = RigidMesh.load(path)
    assert mesh.name == "ball"
    assert mesh.points.shape == ball.vertices.shape
    assert len(mesh.faces) == len(ball.faces)


def test_a_scene_is_one_mesh_as_of_a_file(tmp_path: Path):
    scene = trimesh.Scene(trimesh.creation.box((1, 1, 1)))
    scene.add_geometry(trimesh.creation.icosphere(subdivisions=1), transform=np.eye(4) + np.eye(4, k=3) * 5.0)
    scene.export(tmp_path / "both.glb")
    mesh, of_file = RigidMesh.load(scene, "both"), RigidMesh.load(tmp_path / "both.glb", up="z")
    assert (len(mesh.points), len(mesh.faces)) == (len(of_file.points), len(of_file.faces))
    for found in (mesh, of_file):
        np.testing.assert_allclose([found.points.min(axis=0), found.points.max(axis=0)], [[-0.5, -1, -1], [6, 1, 1]])
    with pytest.raises(MeshError, match="the mesh is empty"):
        RigidMesh.load(trimesh.Scene())


def test_a_missing_or_broken_file_is_named(tmp_path: Path):
    with pytest.raises(IsADirectoryError, match="is a directory: give the path of a file in it"):
        RigidMesh.load(tmp_path)
    with pytest.raises(FileNotFoundError, match=r"nowhere\.ply"):
        RigidMesh.load(tmp_path / "nowhere.ply")
    (tmp_path / "broken.ply").write_text("no mesh")
    with pytest.raises(MeshError, match=r"broken.ply"):
        RigidMesh.load(tmp_path / "broken.ply")
    (tmp_path / "nan.obj").write_text("v 0 0 0\nv 1 0 0\nv nan 1 0\nf 1 2 3\n")
    with pytest.raises(MeshError, match="NaN"):
        RigidMesh.load(tmp_path / "nan.obj")


def test_something_else_is_a_type_error():
    with pytest.raises(TypeError, match=r"mesh: int given, allowed are a trimesh.Trimesh"):
        RigidMesh.load(3)
