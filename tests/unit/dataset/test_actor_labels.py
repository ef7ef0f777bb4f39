"""Ground truth of actors at the borders of their motions."""

import numpy as np
import pytest
import trimesh

import rfgen_sionna as rfgen
from rfgen_sionna.dataset.actor_labels import actor_labels
from rfgen_sionna.scene import MeshActor, RigidMesh


class Sliding(RigidMesh):
    """A mesh that slides by 2 m/s along x for 0.2 s, and rests before and after."""

    duration = 0.2

    def vertices(self, t):
        return super().vertices(t) + np.array([2.0 * np.clip(t, 0.0, self.duration), 0, 0])


@pytest.mark.parametrize("t", [0.0, 0.0004, 0.1, 0.1996])
def test_velocities_are_those_of_the_motion_from_its_first_instant(t):
    """A clip that begins in motion has its velocity in the first frame, though it rests before."""
    box = trimesh.creation.box((0.2, 0.2, 0.2))
    actor = MeshActor(Sliding.load(box, "box"), "metal", "box", (3, 0, 1))
    labels = actor_labels([actor], rfgen.Radar.load("awr1843", position=(0, 0, 1), look_at=(3, 0, 1)), t)
    np.testing.assert_allclose(labels["velocity"], [[2.0, 0, 0]], atol=1e-9)
    np.testing.assert_allclose(labels["radial_velocity"], [2.0], atol=1e-9)
