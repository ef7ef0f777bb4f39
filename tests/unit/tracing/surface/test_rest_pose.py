"""Where a body is smooth, and which way its faces look, follows from its rest pose."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import trimesh

from rfgen_sionna.radar import Radar
from rfgen_sionna.scene import MeshActor
from rfgen_sionna.scene.materials import material
from rfgen_sionna.tracing.relative_scene import by_material, relative_objects
from rfgen_sionna.tracing.surface.surfaces import collect_surfaces

BALL = trimesh.creation.icosphere(subdivisions=2, radius=0.1)


def crumpled(start, **more):
    """A ball of two parts, crumpled more the later it is; its first pose is that at `start` [s]."""
    shape, random = np.asarray(BALL.vertices), np.random.default_rng(0).normal(size=BALL.vertices.shape)
    faces = np.asarray(BALL.faces, np.int32)
    sequence = SimpleNamespace(
        faces=faces, part_names=("one", "two"), face_parts=np.repeat([0, 1], len(faces) // 2).astype(np.int32),
        duration=1.0, joint_names=(), joints=lambda t: np.empty((0, 3)),
        vertices=lambda t: shape + 0.05 * (start + t) * random, **more,
    )  # fmt: skip
    return MeshActor(sequence, "metal", position=(3.0, 0.0, 1.0))


def assert_same_groups(some, others):
    for one, other in zip(some, others, strict=True):
        np.testing.assert_array_equal(one.faces, other.faces)
        np.testing.assert_array_equal(one.smooth.group, other.smooth.group)
        np.testing.assert_array_equal(one.smooth.gather.indices, other.smooth.gather.indices)


def moving(actors):
    return collect_surfaces(None, actors).moving


def ways(actor):
    """Surfaces of the actor, of its parts of two materials, and of what a moving radar sees of them."""
    two = replace(actor, material={"one": "metal", "two": material("skin")})
    radar = Radar.load("awr1843", trajectory=lambda t: (0.1 * t, 0.0, 1.0))
    return [moving([actor]), moving(by_material([two])), moving(relative_objects(radar, None, [two]))]


def test_the_pose_at_the_start_changes_nothing():
    rest = {"rest_vertices": np.asarray(BALL.vertices)}
    for calm, late in zip(ways(crumpled(0.0, **rest)), ways(crumpled(1.0, **rest)), strict=True):
        assert_same_groups(calm, late)


def test_without_a_rest_pose_the_first_pose_counts():
    (calm,), (late,) = moving([crumpled(0.0)]), moving([crumpled(1.0)])
    assert len(np.unique(calm.smooth.group)) == len(BALL.vertices) < len(np.unique(late.smooth.group))
    assert_same_groups([calm], moving([crumpled(0.0, rest_vertices=np.asarray(BALL.vertices))]))


def test_a_person_has_the_same_groups_in_all_poses_and_from_any_start():
    pytest.importorskip("anny")
    from rfgen_sionna.generative.bodies import animate, person
    from rfgen_sionna.generative.motion import KinematicSource

    rig, source = person(seed=0), KinematicSource()
    walk = source("walk", 2.0, 0, skeleton=rig.skeleton)
    later = replace(walk, rotations=walk.rotations[20:], translation=walk.translation[20:], contacts=None)
    motions = walk, later, source("sit", 1.0, 1, skeleton=rig.skeleton)
    sequences = [animate(rig, replace(motion, contacts=None)) for motion in motions]
    assert np.abs(sequences[0].vertices(0.0) - sequences[1].vertices(0.0)).max() > 0.05
    first, *others = (moving([MeshActor(sequence, "skin")]) for sequence in sequences)
    for each in others:
        assert_same_groups(first, each)
