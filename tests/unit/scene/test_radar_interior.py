"""A radar stands in the open or in a room: not inside of a building, below the ground or outside of its room."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh

from rfgen_sionna.scene import SceneError, available_scenes, load_scene, material
from rfgen_sionna.scene.checks.radar_interior import check_radar_placed
from rfgen_sionna.scene.scene import Interior, StaticObject, read_interior
from rfgen_sionna.simulation import Simulator

pytestmark = pytest.mark.filterwarnings("ignore::rfgen_sionna.scene.scene_errors.MaterialRangeWarning")


class Surroundings:
    """What `check_radar_placed` reads of a scene."""

    interior = None

    def __init__(self, **meshes: trimesh.Trimesh) -> None:
        self.objects = [
            StaticObject(name, material("concrete"), np.asarray(m.vertices), np.asarray(m.faces, np.int32))
            for name, m in meshes.items()
        ]


def building(x: float, y: float, height: float = 10.0, inwards: bool = False) -> trimesh.Trimesh:
    """A house without a bottom."""
    mesh = trimesh.creation.box(bounds=[(x - 5, y - 4, 0), (x + 5, y + 4, height)])
    mesh.update_faces(mesh.face_normals[:, 2] > -0.5)
    if inwards:
        mesh.invert()
    return mesh


def ground(size: float = 100.0) -> trimesh.Trimesh:
    mesh = trimesh.creation.box((size, size, 1.0))
    mesh.update_faces(mesh.face_normals[:, 2] > 0.5)
    return mesh.apply_translation((0, 0, -0.5))


def alone() -> bool:
    """No actor is in view."""
    return False


@pytest.mark.parametrize("inwards", [False, True])
def test_buildings_without_a_floor(inwards: bool) -> None:
    """Whichever side their faces show: Sionna's street canyon shows the inner one."""
    town = Surroundings(ground=ground(), house=building(0, 0, inwards=inwards), mill=building(14, 0, 30.0, inwards))
    for place in ((0, 0, 1), (4.5, -3, 1), (0, 0, 9), (10.0, 3.5, 29)):
        name = "house" if place[0] < 6 else "mill"
        with pytest.raises(SceneError, match=rf"radar position \({place[0]:g}, .*inside of '{name}' \(concrete\)"):
            check_radar_placed(place, town, alone)
        check_radar_placed(place, town, lambda: True)  # a hall, with somebody in it
    for place in ((7, 0, 1), (7, 0, 0.03), (0, 5, 1), (0, 0, 11), (30, 30, 2)):
        check_radar_placed(place, town, lambda: pytest.fail("asked in the open"))


def test_below_the_ground() -> None:
    with pytest.raises(SceneError, match=r"\(7, 0, -1\) m lies below 'ground'.*above the ground"):
        check_radar_placed((7, 0, -1), Surroundings(ground=ground(), house=building(0, 0)), lambda: True)
    # A plate above the radar is no ground.
    check_radar_placed((0, 0, -0.3), Surroundings(plate=ground(1.0)), alone)


def test_rooms_have_a_floor_of_their_own() -> None:
    """Closed, with walls and ceiling of single sheets, and a room in a house that stands in the open."""
    box = trimesh.creation.box(bounds=[(-3, -2, 0), (3, 2, 2.6)])
    for room in (box, box.copy()):
        check_radar_placed((1, 1, 1), Surroundings(room=room), alone)
        room.invert()
        check_radar_placed((1, 1, 1), Surroundings(room=room), alone)
    upstairs = box.copy().apply_translation((0, 0, 4))
    check_radar_placed((1, 1, 5), Surroundings(ground=ground(), house=building(0, 0), room=upstairs), alone)


def test_what_does_not_enclose() -> None:
    roof = ground(20.0).apply_translation((0, 0, 4))
    check_radar_placed((0, 0, 1), Surroundings(ground=ground(), roof=roof), alone)
    wall = trimesh.creation.box((0.2, 8, 3)).apply_translation((1, 0, 1.5))
    check_radar_placed((0, 0, 1), Surroundings(ground=ground(), wall=wall), alone)
    check_radar_placed((0, 0, 1), None, alone)
    check_radar_placed((0, 0, 1), load_scene(None), alone)


@pytest.mark.parametrize(
    ("name", "position", "what"),
    [
        ("simple_street_canyon", (0.4, -22.6, 25.5), "building_6"),
        ("simple_street_canyon", (0.4, -17, 1), "building_6"),
        ("simple_street_canyon", (0, 0, -1), "floor"),
        ("simple_street_canyon_with_cars", (40, 28, 1), "building_2"),
        ("etoile", (140, 54, 1.5), "element_243"),
        ("munich", (-375.9, -20.7, 10), "element_799"),
        ("munich", (0, 0, -1), "ground"),
        pytest.param("san_francisco", (0, 0, 1), "Terrain", marks=pytest.mark.slow),
    ],
)
def test_in_and_below_the_buildings_of_sionnas_scenes(tiny_radar, name: str, position: tuple, what: str) -> None:
    with pytest.raises(SceneError, match=rf"radar position .*{what}"):
        Simulator(name, tiny_radar.placed(position=position))


@pytest.mark.parametrize(
    ("name", "position"),
    [
        *((name, (-3.0, 0.2, 1.0)) for name in ("box", "box_knife", "box_one_screen", "box_two_screens")),
        *(("floor_wall", (x, 0.1, 1.0)) for x in (-1.5, 1.5)),
        ("simple_reflector", (0, 0, 0.2)),
        ("simple_reflector", (0, 0, -0.2)),
        ("simple_wedge", (-5, -1, 0)),
        ("double_reflector", (-5, 0, 2)),
        ("triple_reflector", (1, 0, 2)),
        ("simple_street_canyon", (0, 0, 1)),
        ("living_room", (0, 0, 1)),
        ("living_room", (4.5, 1.5, 2.4)),
        ("living_room", (2.5, -2.25, 1.2)),
    ],
)
def test_free_places_of_the_scenes(tiny_radar, name: str, position: tuple) -> None:
    Simulator(name, tiny_radar.placed(position=position))


@pytest.mark.parametrize("position", [(0, 0, -0.05), (0, 0, -0.5), (-50, 0, 1), (2, 0, 10), (6.0, 0, 1), (4.3, 2.5, 1)])
def test_outside_of_the_living_room(tiny_radar, position: tuple) -> None:
    with pytest.raises(SceneError, match=r"outside of the room 'living_room'.*x -0.4 … 5.4, y -2.2 … 2.2, z 0 … 2.6"):
        Simulator("living_room", tiny_radar.placed(position=position))


def test_the_interior_is_that_of_the_meshes() -> None:
    room = load_scene("living_room")
    assert isinstance(room.interior, Interior)
    floor, ceiling = (next(o for o in room.objects if o.name == name) for name in ("floor", "ceiling"))
    np.testing.assert_allclose(room.interior.low[0], floor.vertices.min(axis=0), atol=1e-6)
    np.testing.assert_allclose(room.interior.high[0], ceiling.vertices.max(axis=0), atol=1e-6)
    panes = next(o for o in room.objects if o.name == "window_panes")
    assert room.interior.low[1][1] == pytest.approx(panes.vertices[:, 1].mean())
    assert {name for name in available_scenes() if load_scene(name).interior is not None} == {"living_room"}


@pytest.mark.parametrize(
    "text",
    ["x", "walls = 3", "interior = 3", "[[interior]]\nlow = [0, 0, 0]", "[[interior]]\nlow = [0,0,0]\nhigh = [1,0,1]",
     "[[interior]]\nlow = [0,0]\nhigh = [1,1]", "[[interior]]\nlow = [0,0,0]\nhigh = [1,1,1]\ncolour = 2"],
)  # fmt: skip
def test_descriptions_that_are_none(tmp_path: Path, text: str) -> None:
    file = tmp_path / "room.toml"
    file.write_text(text)
    with pytest.raises(SceneError, match=r"'room.toml'.*allowed are tables \[\[interior\]\]"):
        read_interior(file)
