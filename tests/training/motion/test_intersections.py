"""How much of a body lies inside itself."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from rfgen_sionna.generative.bodies import animate, person
from rfgen_sionna.generative.motion import KinematicSource
from rfgen_sionna.generative.motion.rotations import about, to_quaternions
from rfgen_sionna.generative.motion.skeleton import JOINT
from training.motion.intersections import buried_faces, buried_share


@pytest.mark.parametrize("apart", [0.4, 0.9, 1.5])
def test_two_balls_are_in_each_other_by_their_caps(apart: float) -> None:
    ball = trimesh.creation.icosphere(4, 1.0)
    direction = np.array([0.3, 0.8, 0.52])
    other = ball.vertices + apart * direction / np.linalg.norm(direction)
    vertices = np.concatenate([ball.vertices, other])
    faces = np.concatenate([ball.faces, ball.faces + len(ball.vertices)])
    # a cap's share of a sphere
    assert buried_share(vertices, faces) == pytest.approx(0.5 * (1.0 - 0.5 * apart), abs=0.01)


def test_one_ball_is_not_in_itself() -> None:
    ball = trimesh.creation.icosphere(3, 1.0)
    assert not buried_faces(ball.vertices, ball.faces).any()


def test_an_arm_pressed_into_the_trunk_is_found() -> None:
    body = person(seed=0)
    motion = KinematicSource(20.0)("standing", 0.2, 1, skeleton=body.skeleton)
    sequence = animate(body, motion)
    alone = buried_faces(sequence.vertices(0.1), body.faces)
    pressed = motion.rotations.copy()
    inward = about(np.array([1.0, 0.0, 0.0]), -0.35)
    arm = JOINT["left_shoulder"]
    turned = to_quaternions(inward[None])[0]
    pressed[:, arm] = (Rotation.from_quat(turned) * Rotation.from_quat(pressed[:, arm])).as_quat()
    inside = buried_faces(animate(body, replace(motion, rotations=pressed)).vertices(0.1), body.faces)
    fore = np.isin(body.face_parts, [body.part_names.index(p) for p in ("left_forearm", "left_hand", "left_upper_arm")])
    assert inside[fore].sum() > alone[fore].sum() + 100
    # eyes and mouth lie inside the head of every body
    assert 0.0 < buried_share(body.vertices, body.faces) < 0.01
