"""Actors in one place are found, whichever is fast, thin or inside, and those that pass each other are not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import trimesh

import rfgen_sionna as rfgen
from rfgen_sionna.scene import MeshActor, SceneError
from rfgen_sionna.scene.checks.actor_overlap import ActorOverlap, find_actor_overlaps
from rfgen_sionna.scene.materials import MATERIALS


def ball(name: str, radius: float = 0.1, **changes) -> MeshActor:
    mesh = trimesh.creation.icosphere(subdivisions=3, radius=radius)
    return MeshActor.from_mesh(mesh, **{"material": "metal", "name": name} | changes)


def body(name: str, **changes) -> MeshActor:
    """An upright capsule from z = 0 to 1.7 m."""
    mesh = trimesh.creation.capsule(1.3, 0.2, count=[40, 40]).apply_translation((0, 0, 0.85))
    return MeshActor.from_mesh(mesh, **{"material": "skin", "name": name} | changes)


def deepest_of(one: MeshActor, other: MeshActor, stop: float = 0.0) -> ActorOverlap | None:
    found = list(find_actor_overlaps(one, other, 0.0, stop, (-3.0, 0.0, 1.0)))
    return max(found, key=lambda each: each.depth, default=None)


@pytest.mark.parametrize(("overlap", "visible"), [(-0.05, False), (0.01, False), (0.03, True), (0.07, True)])
def test_how_deep_a_ball_is_in_a_body(overlap: float, visible: bool) -> None:
    for pair in (lambda a, b: (a, b), lambda a, b: (b, a)):
        found = deepest_of(*pair(ball("hand", position=(0.3 - overlap, 0, 0.85)), body("anna")))
        assert (found is not None) is visible
        if found is not None:
            assert {found.actor, found.object} == {"hand", "anna"}
            assert found.depth == pytest.approx(overlap, abs=0.012)
            assert np.hypot(*found.place[:2]) < 0.21


@pytest.mark.parametrize("apart", [0.0, 1e-6, 1e-3, 0.02, 0.05, 0.1, 0.3])
def test_two_in_nearly_the_same_place(apart: float) -> None:
    """Where surfaces all but coincide no vertex of either is deep in the other, and the bodies are."""
    found = deepest_of(ball("anna", 0.2, position=(2, 0, 1)), ball("ben", 0.2, position=(2 + apart, 0, 1)))
    assert found is not None
    assert found.depth > 0.045
    assert deepest_of(body("anna"), body("ben")) is not None
    assert deepest_of(body("anna"), body("ben", position=(0.41, 0, 0))) is None


@pytest.mark.parametrize("speed", [0.7, 3.0, 30.0])
def test_nobody_walks_through_another_unseen(speed: float) -> None:
    """Whatever the time between the instants that are looked at; passing beside each other is nothing."""
    stop = 2.0 / speed
    left, right = (body(n, position=(x, 0, 0), velocity=(v, 0, 0)) for n, x, v in (("a", 1, -speed), ("b", -1, speed)))
    assert deepest_of(left, right, stop).depth > 0.05  # type: ignore[union-attr]
    beside = body("b", position=(-1, 0.45, 0), velocity=(speed, 0, 0))
    assert deepest_of(left, beside, stop) is None
    # one after the other through the same place
    behind = body("b", position=(1.5, 0, 0), velocity=(-speed, 0, 0))
    assert deepest_of(left, behind, stop) is None


def test_one_inside_of_another() -> None:
    small, large = ball("heart", 0.03, position=(0, 0, 1)), body("anna")
    found = deepest_of(small, large)
    assert found is not None
    assert np.isinf(found.depth)
    assert str(found).startswith("actor 'heart' goes through actor 'anna' at t = 0.00 s")
    # a room that holds the radar as well is no obstacle
    hall = MeshActor.from_mesh(trimesh.creation.box((12, 12, 12)), material="metal", name="hall")
    assert deepest_of(small, hall) is None


def test_clothes_are_worn_and_not_run_into() -> None:
    """A surface of a thickness is a sheet: who is in it as a whole is right there, who cuts it is not."""
    cloth = trimesh.creation.capsule(1.3, 0.28, count=[40, 40]).apply_translation((0, 0, 0.85))
    coat = MeshActor.from_mesh(cloth, material=replace(MATERIALS["clothing"], thickness=1e-3), name="coat")
    assert deepest_of(body("anna"), coat) is None
    assert deepest_of(coat, body("anna")) is None
    found = deepest_of(body("anna", position=(0.2, 0, 0)), coat)
    assert found is not None
    assert found.depth > 0.05


def test_the_three_policies(tiny_radar) -> None:
    radar = tiny_radar.placed(position=(0, 0, 1))
    anna, bert = body("anna", position=(2, 0, 0)), body("bert", position=(2.3, 0, 0))
    said = r"actor '(anna|bert)' is 1\d cm deep in actor '(anna|bert)' at t = 0.00 s, at .* m"
    with pytest.raises(SceneError, match=said + "; allowed are 5 cm"):
        rfgen.Simulator(None, radar, [anna, bert]).paths(0.0)
    with pytest.warns(UserWarning, match=said):
        rfgen.Simulator(None, radar, [anna, bert], collisions="warn").paths(0.0)
    rfgen.Simulator(None, radar, [anna, bert], collisions="ignore").paths(0.0)
    # contact is fine, a hand's breadth is warned of
    with pytest.warns(UserWarning, match="is 3 cm deep in actor 'bert'"):
        rfgen.Simulator(None, radar, [ball("hand", position=(2.03, 0, 0.85)), bert]).paths(0.0)
    rfgen.Simulator(None, radar, [ball("hand", position=(2.01, 0, 0.85)), bert]).paths(0.0)
