"""Scenes of mesh and Mitsuba files: materials by the names in the file, double precision far from the origin."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from trimesh.visual.material import PBRMaterial

import rfgen_sionna as rfgen
from rfgen_sionna._types import SPEED_OF_LIGHT, FloatArray
from rfgen_sionna.scene import MaterialError, MeshError, SceneError, add_radar
from rfgen_sionna.scene.load import is_path

FROM_BLENDER = np.array([[1.0, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]])
"""To glTF's axes as Blender exports: x stays, z becomes y."""
WALL = trimesh.creation.box((0.02, 2.0, 2.0), transform=trimesh.transformations.translation_matrix((5.01, 0, 1)))
ORIGIN, UTM = np.zeros(3), np.array([690123.37, 5335012.61, 520.13])


def named(mesh: trimesh.Trimesh, material: str) -> trimesh.Trimesh:
    mesh.visual = trimesh.visual.TextureVisuals(material=PBRMaterial(name=material))
    return mesh


@pytest.fixture
def room(tmp_path: Path) -> Path:
    """A floor, a wall at x = 5 m and a pane at y = 3 m, as a GLB file of Blender."""
    scene = trimesh.Scene()
    boxes = {
        "Floor": ((10, 10, 0.1), (0, 0, -0.05), "Mat.001"),
        "Wall": ((0.1, 10, 3), (5.05, 0, 1.5), "mat-itu_concrete"),
        "Pane": ((2, 0.01, 1), (0, 3.005, 1.5), "Glass.002"),
    }
    for name, (size, place, material) in boxes.items():
        moved = FROM_BLENDER @ trimesh.transformations.translation_matrix(place)
        scene.add_geometry(named(trimesh.creation.box(size, transform=moved), material), node_name=name)
    scene.export(tmp_path / "room.glb")
    return tmp_path / "room.glb"


def test_a_gltf_scene_has_blenders_coordinates_and_a_material_for_each_part(room: Path) -> None:
    objects = {each.name: each for each in rfgen.load_scene(room, materials={"Mat.001": "wood"}).objects}
    assert {name: each.material for name, each in objects.items()} == {
        "Floor, Mat.001": "wood", "Pane, Glass.002": "glass", "Wall, mat-itu_concrete": "concrete",
    }  # fmt: skip
    low = {name: each.vertices.min(axis=0) for name, each in objects.items()}
    np.testing.assert_allclose(low["Floor, Mat.001"], [-5, -5, -0.1], atol=1e-6)
    np.testing.assert_allclose(low["Wall, mat-itu_concrete"], [5, -5, 0], atol=1e-6)
    np.testing.assert_allclose(low["Pane, Glass.002"], [-1, 3, 1], atol=1e-6)


def test_unknown_materials_of_a_mesh_scene_are_refused_with_all_names(room: Path) -> None:
    with pytest.raises(MaterialError, match=r"no known material for 'Mat\.001'; give load_scene default_material='me"):
        rfgen.load_scene(room)
    assert rfgen.load_scene(room, default_material="wood").objects[0].material == "wood"
    with pytest.raises(MaterialError, match=r"materials names 'Roof', which no part has"):
        rfgen.load_scene(room, materials={"Roof": "wood"})
    board = rfgen.material("board", permittivity=2.2, loss_tangent=0.02, thickness=0.01)
    assert rfgen.load_scene(room, materials={"Floor": board}).objects[0].properties is board


def test_a_mesh_scene_is_a_sionna_scene(room: Path) -> None:
    scene = rfgen.load_scene(room, default_material="wood", frequency=77e9)
    assert {each.radio_material.name for each in scene.sionna.objects.values()} == {"wood 0", "glass 1", "concrete 2"}
    assert float(scene.sionna.frequency[0]) == pytest.approx(77e9)


def test_a_scene_in_millimetres_is_told(tmp_path: Path) -> None:
    trimesh.creation.box((8000, 6000, 2500)).export(tmp_path / "flat.stl")
    with pytest.warns(UserWarning, match=r"scene 'flat': it is 8000 x 6000 x 2500 m large; .* scale=0\.001"):
        rfgen.load_scene(tmp_path / "flat.stl", default_material="concrete")
    scene = rfgen.load_scene(tmp_path / "flat.stl", default_material="concrete", scale=0.001)
    np.testing.assert_allclose(np.ptp(scene.objects[0].vertices, axis=0), [8, 6, 2.5], rtol=1e-6)


def test_arguments_without_effect_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="up: only scenes of mesh files take it, a Mitsuba scene is in metres"):
        rfgen.load_scene("box", up="y")
    with pytest.raises(ValueError, match="materials, scale: only scenes of files take it"):
        rfgen.load_scene(None, materials={}, scale=2.0)


def test_paths_are_told_from_words() -> None:
    for path in ("own/own.xml", "room.glb", "/there/room", "./room", "~/room", "C:\\scenes\\room.blend", Path("room")):
        assert is_path(path)
    for words in ("a living room", "living_room", "kitchen / living room", "Munich", "scene: an office", None, 3):
        assert not is_path(words)


def test_a_scene_file_that_is_none_is_named(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match=r"nowhere\.glb' does not exist"):
        rfgen.load_scene(tmp_path / "nowhere.glb")
    (tmp_path / "room.obj").write_text("")
    with pytest.raises(SceneError, match=r"is a folder: give the path of a file in it: room\.obj"):
        rfgen.load_scene(tmp_path)
    (tmp_path / "room.blend").write_text("")
    with pytest.raises(SceneError, match=r"files with the ending '\.blend' are not read, .* export it as glTF"):
        rfgen.load_scene(tmp_path / "room.blend")


SHAPE = '<shape type="{}" id="mesh-Wall"><string name="filename" value="{}"/>{}<ref id="{}" name="bsdf"/></shape>'


def write_xml(path: Path, file: Path, material: str = "mat-itu_concrete", transform: str = "") -> Path:
    """A Mitsuba scene of one shape, with the materials that Blender's exporter writes."""
    shape = SHAPE.format(file.suffix[1:], file.name, transform, material)
    path.write_text(f'<scene version="2.1.0"><bsdf type="diffuse" id="{material}"/>{shape}</scene>')
    return path


@pytest.mark.parametrize(
    ("material", "given", "expected"),
    [
        ("mat-Mat.001", {"materials": {"Mat.001": "concrete"}}, "concrete"),
        ("mat-Mat.001", {"default_material": "wood"}, "wood"),
        ("mat-itu_glass.001", {}, "glass"),
        ("mat-itu_water", {}, "water"),
        ("mat-concrete", {}, "concrete"),
        ("Cardboard", {}, "cardboard"),
        ("mat-itu_wood", {"materials": {"mat-itu_wood": "metal"}}, "metal"),
    ],
)
def test_materials_of_a_mitsuba_scene_by_name(
    tmp_path: Path, material: str, given: dict[str, Any], expected: str
) -> None:
    WALL.export(tmp_path / "wall.ply")
    scene = rfgen.load_scene(write_xml(tmp_path / "w.xml", tmp_path / "wall.ply", material), **given)
    assert [each.material for each in scene.objects] == [expected]
    again = rfgen.load_scene(scene.sionna)
    assert [each.material for each in again.objects] == [expected]


def test_a_material_object_keeps_its_thickness_in_a_mitsuba_scene(tmp_path: Path) -> None:
    WALL.export(tmp_path / "wall.ply")
    resin = rfgen.material("resin", permittivity=2.9, loss_tangent=0.02, thickness=0.01)
    scene = rfgen.load_scene(write_xml(tmp_path / "w.xml", tmp_path / "wall.ply", "mat-X"), materials={"X": resin})
    found = scene.objects[0].properties
    assert found.thickness == pytest.approx(0.01)
    assert found.relative_permittivity(77e9) == pytest.approx(2.9 - 0.058j)


@pytest.mark.parametrize(
    ("body", "error", "message"),
    [
        ("", SceneError, "has no shapes"),
        (SHAPE.format("ply", "no.ply", "", "a"), SceneError, r"mesh files do not exist: .*no\.ply"),
        ('<shape type="sphere" id="ball"/>', SceneError, r"shapes 'ball' \(sphere\) are no triangle meshes"),
        (
            "".join(f'<shape type="cube"><bsdf type="diffuse" id="mat-{name}"/></shape>' for name in ("A", "itu_b")),
            MaterialError,
            r"no known material for 'A', 'itu_b'; give load_scene default_material=",
        ),
    ],
)
def test_what_a_mitsuba_file_lacks_is_told(tmp_path: Path, body: str, error: type[Exception], message: str) -> None:
    (tmp_path / "s.xml").write_text(f'<scene version="2.1.0">{body}</scene>')
    with pytest.raises(error, match=message):
        rfgen.load_scene(tmp_path / "s.xml")


def test_materials_that_a_mitsuba_file_has_not_are_told(tmp_path: Path) -> None:
    WALL.export(tmp_path / "wall.ply")
    with pytest.raises(
        MaterialError, match=r"materials names 'wall'; materials and objects .* are 'itu_concrete', 'Wall'"
    ):
        rfgen.load_scene(write_xml(tmp_path / "w.xml", tmp_path / "wall.ply"), materials={"wall": "wood"})


RECTANGLE = """<shape type="rectangle" id="{id}"><transform name="to_world"><rotate y="1" angle="-90"/>
    <translate x="4" z="1"/></transform>{material}</shape>"""


def materials_of(path: Path, body: str, encoding: str = "utf-8", **options: Any) -> dict[str, str]:
    """Materials of the objects of a Mitsuba scene with a `body`."""
    head = f'<?xml version="1.0" encoding="{encoding}"?>\n<scene version="2.1.0">'
    path.write_bytes(f"{head}\n<!-- Möbel -->\n{body}</scene>".encode(encoding))
    return {each.name: each.material for each in rfgen.load_scene(path, **options).objects}


@pytest.mark.parametrize(
    "material", ["", '<bsdf type="diffuse"/>', '<bsdf type="twosided"><bsdf type="plastic"/></bsdf>']
)
def test_a_shape_without_a_named_material_takes_it_by_its_own_name(tmp_path: Path, material: str) -> None:
    path, body = tmp_path / "hand.xml", RECTANGLE.format(id="wall", material=material)
    with pytest.raises(MaterialError, match=r"no known material for 'wall'; .*materials={'wall': 'concrete'}"):
        materials_of(path, body)
    assert materials_of(path, body, default_material="wood") == {"wall": "wood"}
    assert materials_of(path, body, materials={"wall": "metal"}) == {"wall": "metal"}


def test_an_object_of_a_mitsuba_scene_takes_another_material_than_the_rest(tmp_path: Path) -> None:
    shapes = [RECTANGLE.format(id=name, material='<ref id="mat-Mat.001" name="bsdf"/>') for name in ("mesh-a", "b")]
    body = '<bsdf type="diffuse" id="mat-Mat.001"/><bsdf type="diffuse" id="unused"/>' + "".join(shapes)
    found = materials_of(tmp_path / "two.xml", body, materials={"Mat.001": "wood", "b": "glass"})
    assert found == {"a": "wood", "b": "glass"}
    with pytest.raises(MaterialError, match=r"names 'c'; materials and objects of the file are 'Mat.001', 'a', 'b'"):
        materials_of(tmp_path / "two.xml", body, materials={"c": "glass"})


@pytest.mark.parametrize("name", ["glass", "itu_glass", "Glass"])
def test_an_object_may_have_the_name_of_its_material(tmp_path: Path, name: str) -> None:
    body = f'<bsdf type="diffuse" id="mat-{name}"/>'
    body += RECTANGLE.format(id=f"mesh-{name}", material=f'<ref id="mat-{name}"/>')
    assert materials_of(tmp_path / "pane.xml", body, "iso-8859-1") == {name: "glass"}


def test_an_object_is_more_specific_than_its_material(room: Path) -> None:
    given = {"Mat.001": "wood", "Floor": "concrete", "Glass": "glass"}
    assert rfgen.load_scene(room, materials=given).objects[0].material == "concrete"


def wall_file(folder: Path, kind: str, offset: FloatArray) -> Path:
    """The wall `offset` metres away in a file of a kind: OBJ and PLY of doubles, XML of these, GLB and XML of a
    translation."""
    points = WALL.vertices + offset
    if kind == "glb":
        scene = trimesh.Scene()
        moved = FROM_BLENDER @ trimesh.transformations.translation_matrix(offset)
        scene.add_geometry(named(WALL.copy(), "concrete"), transform=moved)
        scene.export(folder / "wall.glb")
        return folder / "wall.glb"
    if kind == "xml translate":
        WALL.export(folder / "wall.ply")
        move = "<translate x='{:.17g}' y='{:.17g}' z='{:.17g}'/>".format(*offset)
        there = f'<transform name="to_world">{move}</transform>'
        return write_xml(folder / "wall.xml", folder / "wall.ply", transform=there)
    file = folder / ("wall.obj" if "obj" in kind else "wall.ply")
    numbers = ["{:.17g} {:.17g} {:.17g}".format(*point) for point in points]
    if "obj" in kind:
        faces = ["f {} {} {}".format(*(face + 1)) for face in WALL.faces]
        file.write_text("\n".join(["usemtl concrete", *("v " + text for text in numbers), *faces]))
    else:
        header = f"ply\nformat ascii 1.0\nelement vertex {len(points)}\n"
        header += "property double x\nproperty double y\nproperty double z\n"
        header += f"element face {len(WALL.faces)}\nproperty list uchar int vertex_indices\nend_header"
        file.write_text("\n".join([header, *numbers, *("3 {} {} {}".format(*face) for face in WALL.faces)]) + "\n")
    return write_xml(folder / "wall.xml", file) if kind.startswith("xml") else file


def echo(scene: Any, actors: list[rfgen.Actor], offset: FloatArray) -> tuple[float, complex]:
    """Range [m] of the strongest path and the sum of all, for a radar 1 m above `offset`."""
    x, y, z = (float(each) for each in offset)
    position, target = (x, y, z + 1.0), (x + 3.0, y, z + 1.0)
    overrides = {"preset.mmmesh.num_loops": 2}
    radar = rfgen.Radar.load("awr1843", "mmmesh", position=position, look_at=target, overrides=overrides)
    paths = rfgen.Simulator(scene, radar, actors, rtol=1e-2).paths()
    a, tau = paths.a[0, 0, :, 0], paths.tau[0, 0, :, 0]
    total = (a * np.exp(-2j * np.pi * np.mod(paths.frequency * tau, 1.0))).sum()
    return float(tau[np.abs(a).argmax()]) * SPEED_OF_LIGHT / 2, complex(total)


@pytest.mark.parametrize("kind", ["obj", "ply", "glb", "xml ply", "xml obj", "xml translate"])
def test_a_wall_in_utm_coordinates_is_where_it_is_at_the_origin(tmp_path: Path, kind: str) -> None:
    """Its range is the same to a micrometre and its return to a thousandth: 0.1 mm would turn the phase by 18°."""
    default = "concrete" if kind == "ply" else None
    results = []
    for name, offset in (("near", ORIGIN), ("far", UTM)):
        (tmp_path / name).mkdir()
        scene = rfgen.load_scene(wall_file(tmp_path / name, kind, offset), default_material=default)
        results.append(echo(scene, [], offset))
    (near, field), (far, there) = results
    assert near == pytest.approx(5.0002, abs=1e-3)
    assert far == pytest.approx(near, abs=1e-6)
    assert there == pytest.approx(field, rel=1e-3)


def test_an_actor_in_utm_coordinates_is_where_it_is_at_the_origin() -> None:
    near, field = echo(None, [rfgen.Actor.from_mesh(WALL, material="metal")], ORIGIN)
    moved = (WALL.vertices + UTM, WALL.faces)
    place = (float(UTM[0]), float(UTM[1]), float(UTM[2]))
    for arguments in (
        {"mesh": moved},
        {"mesh": WALL, "position": place},
        {"mesh": WALL, "trajectory": lambda t: place},
    ):
        far, there = echo(None, [rfgen.Actor.from_mesh(**arguments, material="metal")], UTM)
        assert far == pytest.approx(near, abs=1e-6)
        assert there == pytest.approx(field, rel=1e-2)  # pixels on the seams of facets fall to either side


@pytest.mark.parametrize("suffix", [".ply", ".stl", ".glb"])
def test_single_precision_far_away_is_refused_not_rounded(tmp_path: Path, suffix: str) -> None:
    wall = trimesh.Trimesh(WALL.vertices + UTM, WALL.faces, process=False)
    named(wall, "concrete").export(tmp_path / f"wall{suffix}")
    with pytest.raises(MeshError, match=r"32-bit floats, which are 0\.5 m apart at y = 533501.*: the shape is lost"):
        rfgen.load_scene(tmp_path / f"wall{suffix}", default_material="concrete", up="z")
    if suffix == ".ply":
        scene = rfgen.load_scene(write_xml(tmp_path / "w.xml", tmp_path / "wall.ply"))
        with pytest.raises(SceneError, match=r"object 'Wall': .* 32-bit floats, which are 0\.5 m apart"):
            _ = scene.objects


def test_sionnas_own_solvers_far_from_the_origin_are_told(tmp_path: Path) -> None:
    scene = rfgen.load_scene(wall_file(tmp_path, "obj", UTM))
    x, y, z = (float(each) for each in UTM)
    radar = rfgen.Radar.load("awr1843", position=(x, y, z + 1.0), look_at=(x + 3.0, y, z + 1.0))
    with pytest.warns(UserWarning, match=r"5335012\.61 m from the origin, where .* 32-bit floats .* are 0\.5 m apart"):
        add_radar(scene, radar)


def test_a_file_beside_the_scene_gives_what_a_command_line_cannot(room: Path) -> None:
    beside = room.with_suffix(".toml")
    beside.write_text(
        '[materials]\n"Mat.001" = "wood"\n[[interior]]\nlow = [-5.0, -5.0, 0.0]\nhigh = [5.0, 5.0, 3.0]\n'
    )
    scene = rfgen.load_scene(room)
    assert scene.objects[0].material == "wood"
    assert scene.interior is not None
    assert scene.interior.contains((0, 0, 1))
    assert rfgen.load_scene(room, materials={"Mat.001": "marble"}).objects[0].material == "marble"
    beside.write_text('default_material = "wood"\nup = "z"\nscale = 0.5\n')
    small = rfgen.load_scene(room)
    assert small.interior is None
    np.testing.assert_allclose(np.ptp(small.objects[0].vertices, axis=0), [5.0, 0.05, 5.0], atol=1e-6)
    beside.write_text('roof = "wood"\n')
    with pytest.raises(
        SceneError, match=r"room\.toml': it has roof; allowed are tables \[\[interior\]\] .* \[materials\]"
    ):
        rfgen.load_scene(room)
