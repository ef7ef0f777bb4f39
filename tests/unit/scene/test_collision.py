"""Actors that go through walls and furniture are found, and those that stand on the floor are not."""

from __future__ import annotations

import time

import numpy as np
import pytest
import trimesh

import rfgen_sionna as rfgen
from rfgen_sionna.scene import MeshActor, RayScene, SceneError, load_scene, material
from rfgen_sionna.scene.checks.actors import check_collisions
from rfgen_sionna.scene.checks.collision import CONTACT, Collision, CollisionFinder, deepest
from rfgen_sionna.scene.scene import StaticObject

SOFA = (2.7, -1.5, 0.0)


class Surroundings:
    """What the finder reads of a scene."""

    def __init__(self, **meshes: trimesh.Trimesh) -> None:
        self.objects = tuple(
            StaticObject(name, material("wood"), np.asarray(m.vertices, float), np.asarray(m.faces, np.int32))
            for name, m in meshes.items()
        )

    def find(self, actor: MeshActor, stop: float = 0.0) -> dict[str, Collision]:
        rays = RayScene([(item.vertices, item.faces) for item in self.objects], origin=(0, 0, 1))
        return {each.object: each for each in deepest(list(CollisionFinder(self.objects, rays, actor).find(0.0, stop)))}  # type: ignore[arg-type]


def sheet(x: float = 0.0, size: float = 4.0) -> trimesh.Trimesh:
    """A wall at `x` that faces +x."""
    half = 0.5 * size
    corners = [(x, -half, -half), (x, half, -half), (x, half, half), (x, -half, half)]
    return trimesh.Trimesh(corners, [[0, 1, 2], [0, 2, 3]], process=False)


def ball(radius: float = 0.1, **changes) -> MeshActor:
    mesh = trimesh.creation.icosphere(subdivisions=3, radius=radius)
    return MeshActor.from_mesh(mesh, **{"material": "metal", "name": "ball"} | changes)


def body(**changes) -> MeshActor:
    """An upright capsule from z = 0 to 1.7 m."""
    mesh = trimesh.creation.capsule(1.3, 0.2, count=[40, 40]).apply_translation((0, 0, 0.85))
    return MeshActor.from_mesh(mesh, **{"material": "skin", "name": "person"} | changes)


@pytest.mark.parametrize("depth", [0.01, 0.03, 0.07, 0.12])
@pytest.mark.parametrize("side", [1, -1])
def test_the_depth_in_a_wall(depth: float, side: int) -> None:
    found = Surroundings(wall=sheet()).find(ball(position=(side * (0.1 - depth), 0.3, 0.2)))
    if depth < CONTACT:
        assert not found
        return
    # Beyond the middle the smaller part is the one on the near side.
    assert found["wall"].depth == pytest.approx(min(depth, 0.2 - depth), abs=2e-3)
    assert found["wall"].actor == "ball"
    assert abs(found["wall"].place[0]) == pytest.approx(min(depth, 0.2 - depth), abs=2e-3)


@pytest.mark.parametrize("speed", [0.3, 3.0, 30.0, 300.0])
@pytest.mark.parametrize("shape", ["ball", "plate"])
def test_nothing_passes_a_wall_unseen(speed: float, shape: str) -> None:
    mesh = trimesh.creation.box((0.005, 0.3, 0.3)) if shape == "plate" else trimesh.creation.icosphere(2, 0.1)
    actor = MeshActor.from_mesh(mesh, material="metal", position=(-1.03, 0, 0), velocity=(speed, 0, 0), name="thing")
    found = Surroundings(wall=sheet()).find(actor, 2.0 / speed)
    assert np.isinf(found["wall"].depth)
    assert found["wall"].time * speed == pytest.approx(1.15, abs=0.2)
    assert not Surroundings(wall=sheet()).find(actor, 0.85 / speed)
    past = MeshActor.from_mesh(mesh, material="metal", position=(-1.03, 2.5, 0), velocity=(speed, 0, 0), name="thing")
    assert not Surroundings(wall=sheet()).find(past, 2.0 / speed)


def test_contact_is_fine() -> None:
    floor = trimesh.creation.box((5, 5, 0.1)).apply_translation((0, 0, -0.05))
    for actor in (body(), body(position=(0, 0, -0.015)), body(velocity=(0.5, 0, 0))):
        assert not Surroundings(floor=floor).find(actor, 2.0)
    crate = MeshActor.from_mesh(trimesh.creation.box((0.4, 0.4, 0.4)), material="wood", position=(0, 0, 0.2))
    assert not Surroundings(floor=floor).find(crate)
    bouncing = MeshActor.from_mesh(
        trimesh.creation.box((1, 1, 0.01)), material="wood", trajectory=lambda t: (0, 0, 0.004 + abs(np.sin(7 * t)))
    )
    assert not Surroundings(floor=floor).find(bouncing, 2.0)
    assert Surroundings(floor=floor).find(body(position=(0, 0, -0.06)))["floor"].depth == pytest.approx(0.06, abs=5e-3)


def test_things_thinner_than_the_actor() -> None:
    pole = trimesh.creation.cylinder(0.012, 1.6, sections=12).apply_translation((0, 0, 0.8))
    # 1.2 cm off the middle of a body of 20 cm radius.
    assert Surroundings(pole=pole).find(body())["pole"].depth == pytest.approx(0.19, abs=0.01)
    top = trimesh.creation.box((1.0, 0.6, 0.03)).apply_translation((0, 0, 0.75))
    through = Surroundings(table=top).find(body())["table"]
    assert through.depth > 0.3
    # Its edge reaches 8 cm into the body, from the side.
    edge = Surroundings(table=top).find(body(position=(0.62, 0.02, 0)))["table"]
    assert edge.depth == pytest.approx(0.08, abs=0.01)
    assert edge.place[2] == pytest.approx(0.75, abs=0.03)
    assert not Surroundings(table=top).find(body(position=(0.75, 0, 0)))
    # A coarse actor, whose own edges meet nothing.
    crate = MeshActor.from_mesh(trimesh.creation.box((0.8, 0.8, 0.8)), material="wood", position=(0.1, 0, 0.4))
    assert Surroundings(pole=pole).find(crate)["pole"].depth == pytest.approx(0.3, abs=0.015)


def test_inside_of_furniture_as_a_whole() -> None:
    sofa = trimesh.creation.box((2, 1, 1))
    found = Surroundings(sofa=sofa).find(ball(position=(0.2, 0.1, 0.1)))
    assert np.isinf(found["sofa"].depth)
    room = trimesh.creation.box((8, 8, 4))
    assert not Surroundings(room=room).find(ball(position=(2, 0.1, 0.1)))


def test_the_part_behind_is_that_behind_the_first_surface() -> None:
    """A leg through a table and on to the rug below belongs to the table."""
    top = trimesh.creation.box((1.0, 0.6, 0.03)).apply_translation((0, 0, 0.45))
    rug = trimesh.creation.box((2, 2, 0.008)).apply_translation((0, 0, 0.004))
    found = Surroundings(table=top, rug=rug).find(body())
    assert set(found) == {"table"}


@pytest.fixture(scope="module")
def room():
    return load_scene("living_room", frequency=77e9)


@pytest.fixture(scope="module")
def rays(room) -> RayScene:
    return RayScene([(item.vertices, item.faces) for item in room.objects], origin=(0, 0, 1))


def test_the_three_policies(room, tiny_radar) -> None:
    radar = tiny_radar.placed(position=(0, 0, 1))
    walker = body(position=(4.5, 1.9 - 0.8, 0), velocity=(0.6, -0.5, 0))
    with pytest.raises(SceneError, match=r"actor 'person' is \d+ cm deep in .* at t = .* s, at .* m; allowed are 5 cm"):
        rfgen.Simulator(room, radar, [walker]).frames(3.0)
    with pytest.warns(
        UserWarning, match=r"^actor 'person' goes through 'far_wall' .*; actor 'person' is 1\d\d cm deep in 'bookshelf'"
    ):
        rfgen.Simulator(room, radar, [walker], collisions="warn").frames(3.0)
    rfgen.Simulator(room, radar, [walker], collisions="ignore").frames(3.0)
    with pytest.raises(ValueError, match=r"collisions is 'maybe': allowed are 'error', 'warn', 'ignore'"):
        rfgen.Simulator(room, radar, [walker], collisions="maybe")  # type: ignore[arg-type]
    with pytest.raises(SceneError, match="'sofa'"):
        rfgen.Simulator(room, radar, [body(position=SOFA)]).paths(0.0)
    # A hand's breadth is warned of, whatever the policy.
    with pytest.warns(UserWarning, match=r"is 3 cm deep in 'far_wall'"):
        check_collisions(
            room, rfgen.Simulator(room, radar)._surroundings, [ball(position=(5.33, 0, 1))], 0.0, 0.0, "error", 1
        )


def test_people_at_the_default_place_are_clear_of_the_furniture(room, rays) -> None:
    """And the check takes less than the run's first frame."""
    from rfgen_sionna.generative import Actor as Person

    took = []
    rig = None
    for action in ("jumping jacks", "walking back and forth", "picking up an item from the ground"):
        person = Person.from_prompt(
            f"a person {action}", seed=0, position=(3, 0, 0), orientation=(np.pi, 0, 0), body=rig, motion="kinematic"
        )
        rig = person.body
        begun = time.process_time()
        check_collisions(room, rays, [person], 0.0, 3.0, "error", 1)
        took.append(time.process_time() - begun)
    assert min(took) < 2.0
    with pytest.raises(SceneError, match="'coffee_table'"):
        check_collisions(
            room,
            rays,
            [Person.from_prompt("a person standing", body=rig, position=(4.7, 0, 0), motion="kinematic")],
            0.0,
            1.0,
            "error",
            1,
        )


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(5))
def test_every_action_at_the_default_place(room, rays, seed: int) -> None:
    from rfgen_sionna.generative.actor import Actor as Person
    from rfgen_sionna.generative.bodies import person

    rig = person(None, seed=seed)
    for action in (
        "walks back and forth", "jumps", "does jumping jacks", "picks up an item from the ground", "is in a T pose",
        "is in a Y pose", "raises the left arm", "raises the right arm", "raises the left leg", "raises the right leg",
        "swipes left", "swipes right", "pushes", "pulls", "draws a circle clockwise", "clicks", "swings a finger",
        "draws a circle counter-clockwise", "stands",
    ):  # fmt: skip
        actor = Person.from_prompt(
            f"a person {action}", seed=seed, body=rig, position=(3, 0, 0), orientation=(np.pi, 0, 0), motion="kinematic"
        )
        check_collisions(room, rays, [actor], 0.0, 3.0, "error", 1)
