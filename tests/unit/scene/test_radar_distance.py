"""A radar stands free: not inside of a wall, of furniture or of a person."""

import numpy as np
import pytest
import trimesh

from rfgen_sionna.scene import MeshActor, SceneError, check_radar_clear, load_scene, material
from rfgen_sionna.scene.checks.radar_distance import distance, winding_number
from rfgen_sionna.scene.scene import StaticObject

BALL = trimesh.creation.icosphere(subdivisions=2)


class Surroundings:
    """What `check_radar_clear` reads of a scene."""

    def __init__(self, *meshes: trimesh.Trimesh) -> None:
        self.objects = [
            StaticObject(f"thing {i}", material("concrete"), np.asarray(m.vertices), np.asarray(m.faces, np.int32))
            for i, m in enumerate(meshes)
        ]


def test_winding_number_counts_how_often_a_surface_surrounds_a_point():
    vertices, faces = np.asarray(BALL.vertices), np.asarray(BALL.faces)
    points = [[0.0, 0, 0], [0.5, 0.2, 0], [2.0, 0, 0], [0, 0, -1.5]]
    np.testing.assert_allclose(winding_number(points, vertices, faces), [1, 1, 0, 0], atol=1e-12)
    np.testing.assert_allclose(winding_number(points, vertices, faces[:, ::-1]), [-1, -1, 0, 0], atol=1e-12)
    # Two thirds of a solid angle: a cube without its two ends along x seen from its centre.
    cube = trimesh.creation.box((2, 2, 2))
    sides = cube.faces[np.abs(cube.face_normals[:, 0]) < 0.5]
    np.testing.assert_allclose(winding_number([0.0, 0, 0], cube.vertices, sides), 2 / 3)


def test_distance_is_to_faces_edges_and_corners():
    cube = trimesh.creation.box((2, 2, 2))
    for point, expected in (((3, 0, 0), 2), ((2, 2, 0), np.sqrt(2)), ((2, 2, 2), np.sqrt(3)), ((0.9, 0, 0), 0.1)):
        assert distance(point, cube.vertices, cube.faces) == pytest.approx(expected)


def test_a_radar_inside_an_actor_is_refused():
    ball = MeshActor.from_mesh(BALL, material="metal", name="ball", velocity=(-1, 0, 0), position=(3, 0, 1))
    check_radar_clear((0, 0, 1), None, [ball], t=0.0)
    with pytest.raises(SceneError, match=r"\(0, 0, 1\) m lies inside actor 'ball' at t = 2.9 s"):
        check_radar_clear((0, 0, 1), None, [ball], t=2.9)
    with pytest.raises(SceneError, match=r"10 mm from the surface of actor 'ball'.* it needs 20 mm"):
        check_radar_clear((1.99, 0, 1), None, [ball])


def test_an_actor_in_millimetres_is_asked_for_its_units():
    with pytest.warns(UserWarning, match=r"ball: it is 2000 m long; .* scale=0\.001"):
        ball = MeshActor.from_mesh((1e3 * BALL.vertices, BALL.faces), material="metal", name="ball", position=(3, 0, 1))
    with pytest.raises(SceneError, match=r"inside actor 'ball' at t = 0 s, which is 2000 m long .* scale=0\.001"):
        check_radar_clear((0, 0, 1), None, [ball])


def test_a_radar_inside_furniture_is_refused():
    cupboard = trimesh.creation.box((0.6, 0.6, 2))
    with pytest.raises(SceneError, match=r"lies inside 'thing 0' \(concrete\)"):
        check_radar_clear((0, 0, 0.2), Surroundings(cupboard))
    with pytest.raises(SceneError, match="5 mm from the surface of 'thing 0'"):
        check_radar_clear((0.305, 0, 0), Surroundings(cupboard))
    check_radar_clear((0.35, 0, 0), Surroundings(cupboard))


def test_a_radar_inside_a_room_is_fine():
    room = trimesh.creation.box((6, 4, 3))
    person = MeshActor.from_mesh(BALL, material="skin", position=(2, 0, 0), name="person")
    check_radar_clear((-1, 0, 0), Surroundings(room))
    check_radar_clear((-2.9, 0, 0), Surroundings(room), [person])
    inwards = room.copy()
    inwards.invert()
    check_radar_clear((-2.9, 0, 0), Surroundings(inwards))


def test_a_radar_in_a_room_without_its_target_is_refused():
    bunker = trimesh.creation.box((6, 4, 3))
    person = MeshActor.from_mesh(BALL, material="skin", position=(9, 0, 0), name="person")
    with pytest.raises(SceneError, match="lies inside 'thing 0'"):
        check_radar_clear((-1, 0, 0), Surroundings(bunker), [person])


def test_free_space_and_no_scene_are_clear():
    check_radar_clear((0, 0, 1), None)
    check_radar_clear((0, 0, 1), load_scene(None))
