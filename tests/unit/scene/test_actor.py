"""Actors stand where they are put and move as they are told."""

import numpy as np
import pytest
import trimesh

from rfgen_sionna.scene import MaterialError, MeshActor, MeshError, RigidMesh, rotation_matrix

BOX = trimesh.creation.box((0.2, 0.4, 0.6))


def test_an_actor_is_placed_rotated_and_moves():
    actor = MeshActor.from_mesh(
        BOX, material="metal", position=(3, -1, 1), velocity=(0.5, 0, -0.25), orientation=(np.pi / 2, 0, 0)
    )
    # A quarter turn to the left takes +x to +y.
    expected = BOX.vertices[:, [1, 0, 2]] * [-1, 1, 1] + [4.0, -1, 0.5]
    np.testing.assert_allclose(actor.vertices(2.0), expected, atol=1e-12)
    assert actor.vertices(2.0).dtype == np.float64
    assert actor.faces.shape == (12, 3)
    assert actor.duration == np.inf
    assert actor.joints(0.0).shape == (0, 3)


def test_orientation_is_yaw_then_pitch_then_roll_as_in_sionna():
    """R = Rz(yaw) Ry(pitch) Rx(roll): a positive pitch lowers the nose, a positive roll raises the left side."""
    np.testing.assert_allclose(rotation_matrix((0, np.pi / 2, 0)) @ [1, 0, 0], [0, 0, -1], atol=1e-15)
    np.testing.assert_allclose(rotation_matrix((0, 0, np.pi / 2)) @ [0, 1, 0], [0, 0, 1], atol=1e-15)
    a, b, c = 0.3, -0.7, 1.1
    product = rotation_matrix((a, 0, 0)) @ rotation_matrix((0, b, 0)) @ rotation_matrix((0, 0, c))
    np.testing.assert_allclose(rotation_matrix((a, b, c)), product, atol=1e-15)


def test_a_trajectory_gives_position_or_position_and_orientation():
    swing = MeshActor.from_mesh(
        BOX, material="metal", trajectory=lambda t: (3.0, 0.1 * np.sin(t), 1.0), orientation=(0.1, 0, 0)
    )
    np.testing.assert_allclose(swing.pose(0.5)[0], [3.0, 0.1 * np.sin(0.5), 1.0])
    np.testing.assert_allclose(swing.pose(0.5)[1], rotation_matrix((0.1, 0, 0)))
    spin = MeshActor.from_mesh(BOX, material="metal", trajectory=lambda t: (np.array([3.0, 0, 1]), (t, 0, 0)))
    np.testing.assert_allclose(spin.vertices(0.7), BOX.vertices @ rotation_matrix((0.7, 0, 0)).T + [3, 0, 1])


def test_vertices_keep_micrometres_10_km_away():
    near = MeshActor.from_mesh(BOX, material="metal", position=(3, 0, 1))
    far = MeshActor.from_mesh(BOX, material="metal", position=(1e4 + 3, 0, 1))
    np.testing.assert_allclose(far.vertices(0.1) - [1e4, 0, 0], near.vertices(0.1), atol=1e-11)


def test_a_mesh_without_a_material_is_told_what_there_is():
    with pytest.raises(MaterialError, match=r"crate: no material given; .*known are .*skin \("):
        MeshActor.from_mesh(BOX, name="crate")


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        (
            {"material": "stell"},
            MaterialError,
            r"crate: unknown material 'stell', did you mean 'steel'\?; .*known are .*skin",
        ),
        ({"material": ""}, MaterialError, "crate: no material given; .*known are"),
        ({"material": None}, TypeError, "name of a material"),
        ({"position": (1, 2)}, ValueError, r"crate: position is \(1, 2\)"),
        ({"velocity": (np.nan, 0, 0)}, ValueError, "crate: velocity"),
        (
            {"velocity": (0, 4e8, 0)},
            ValueError,
            r"crate: velocity \(0.0, 400000000.0, 0.0\) m/s given, 400000000.0 m/s in all, at most 2997924.58 m/s",
        ),
        (
            {"velocity": (3e6, 0, 0)},
            ValueError,
            r"3000000\.0 m/s in all, at most 2997924\.58 m/s",
        ),
        ({"velocity": (1e200, 1e200, 0)}, ValueError, "crate: velocity"),
        ({"name": np.array(["a", "b"])}, ValueError, "name: .* a text that is not empty is needed"),
        ({"name": ""}, ValueError, "name: '' given"),
        ({"orientation": "left"}, ValueError, "crate: orientation"),
        ({"trajectory": 3}, TypeError, "not callable"),
        ({"trajectory": lambda t: (t, 0)}, ValueError, "trajectory: position at t = 0.0"),
        ({"trajectory": lambda t: (t, 0, 0), "velocity": (1, 0, 0)}, ValueError, "leave position and velocity out"),
        ({"mesh": (BOX.vertices, np.arange(8).reshape(2, 4))}, MeshError, "crate: faces have shape"),
    ],
)
def test_bad_arguments_are_named(arguments, error, message):
    good = {"mesh": BOX, "material": "metal", "name": "crate"}
    with pytest.raises(error, match=message):
        MeshActor.from_mesh(**{**good, **arguments})


def test_names():
    assert MeshActor.from_mesh(BOX, material="metal").name == "mesh"
    assert MeshActor.from_mesh(BOX, material="metal", name="crate").part_names == ("crate",)
    with pytest.raises(ValueError, match="name"):
        MeshActor(RigidMesh.load(BOX), "metal", name="")
    with pytest.raises(TypeError, match="no mesh sequence"):
        MeshActor(BOX, "metal")
