"""Meshes of files stand upright, in metres, with a material for each part; others are refused with the cure."""

from __future__ import annotations

import json
import struct
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh
from trimesh.visual.material import PBRMaterial

import rfgen_sionna as rfgen
from rfgen_sionna.dataset import ActorInfo
from rfgen_sionna.generative.bodies.gltf import load_animation
from rfgen_sionna.scene import MaterialError, MeshError, RigidMesh
from rfgen_sionna.scene.mesh_files import read_mesh_parts, to_z_up
from rfgen_sionna.scene.obj_file import read_obj, split_polygon

Y_UP_CAR = trimesh.creation.box((1.8, 1.5, 4.0), transform=trimesh.transformations.translation_matrix((0, 0.75, 1.0)))
"""A car of 4 m in glTF's axes: 1.5 m high, on y = 0, its front towards +z."""
PLY_HEADER = "ply\nformat ascii 1.0\nelement vertex {}\nproperty double x\nproperty double y\nproperty double z\n"


def field(paths: rfgen.RadarPaths, number: int) -> complex:
    """Sum of the returns of an object at the first pair of elements."""
    own = paths.object_id == number
    turns = np.mod(paths.frequency * paths.tau[0, 0, own, 0], 1.0)
    return complex((paths.a[0, 0, own, 0] * np.exp(-2j * np.pi * turns)).sum())


def write_obj(path: Path, *parts: tuple[str, str, trimesh.Trimesh]) -> Path:
    """An OBJ file of (object, material, mesh)."""
    lines, count = ["mtllib none.mtl"], 0
    for name, material, mesh in parts:
        lines += [f"o {name}"] + ([f"usemtl {material}"] if material else [])
        lines += ["v {:.17g} {:.17g} {:.17g}".format(*vertex) for vertex in mesh.vertices]
        lines += ["f {} {} {}".format(*(face + 1 + count)) for face in mesh.faces]
        count += len(mesh.vertices)
    path.write_text("\n".join(lines))
    return path


@pytest.fixture
def two_tone(tmp_path: Path) -> Path:
    body = trimesh.creation.box((4.0, 1.8, 1.0))
    window = trimesh.creation.box((2.0, 1.6, 0.6), transform=trimesh.transformations.translation_matrix((0, 0, 0.8)))
    return write_obj(tmp_path / "car.obj", ("shell", "Paint", body), ("screen", "Glass_01", window))


def test_a_static_gltf_stands_and_faces_as_an_animated_one(tmp_path: Path) -> None:
    Y_UP_CAR.export(tmp_path / "car.glb")
    low, high = np.array([[-1.0, -0.9, 0.0], [3.0, 0.9, 1.5]])
    points = rfgen.Actor.from_mesh(tmp_path / "car.glb", material="metal").vertices(0.0)
    np.testing.assert_allclose([points.min(axis=0), points.max(axis=0)], [low, high], atol=1e-6)
    animated = load_animation(_animated(tmp_path / "car.glb")).vertices(0.0)
    np.testing.assert_allclose(np.sort(points, axis=0), np.sort(animated, axis=0), atol=1e-6)


def _animated(path: Path) -> Path:
    """The file with an animation that keeps its node in place."""
    raw = path.read_bytes()
    size = struct.unpack_from("<I", raw, 12)[0]
    tree, data = json.loads(raw[20 : 20 + size]), raw[28 + size :]
    node = next(k for k, each in enumerate(tree["nodes"]) if "mesh" in each)
    times = struct.pack("<2f", 0.0, 1.0) + struct.pack("<6f", *[0.0] * 6)
    tree["nodes"][node].pop("matrix", None)
    views, accessors = tree["bufferViews"], tree["accessors"]
    views += [
        {"buffer": 0, "byteOffset": len(data), "byteLength": 8},
        {"buffer": 0, "byteOffset": len(data) + 8, "byteLength": 24},
    ]
    accessors += [
        {"bufferView": len(views) - 2, "componentType": 5126, "count": 2, "type": "SCALAR", "min": [0], "max": [1]},
        {"bufferView": len(views) - 1, "componentType": 5126, "count": 2, "type": "VEC3"},
    ]
    sampler = {"input": len(accessors) - 2, "output": len(accessors) - 1}
    channel = {"sampler": 0, "target": {"node": node, "path": "translation"}}
    tree["animations"] = [{"samplers": [sampler], "channels": [channel]}]
    tree["buffers"][0]["byteLength"] = len(data) + 32
    text = json.dumps(tree).encode()
    text += b" " * (-len(text) % 4)
    body = struct.pack("<II", len(text), 0x4E4F534A) + text + struct.pack("<II", len(data) + 32, 0x004E4942)
    out = path.with_name("animated.glb")
    out.write_bytes(b"glTF" + struct.pack("<II", 2, 12 + len(body) + len(data) + 32) + body + data + times)
    with pytest.warns(UserWarning, match=r"animation is left out.*Actor\.from_motion plays"):
        RigidMesh.load(out)
    return out


@pytest.mark.parametrize("up", ["x", "y", "z", "-x", "-y", "-z", "+Y"])
@pytest.mark.parametrize("front", [True, False])
def test_an_up_axis_turns_to_z_without_mirroring(up: str, front: bool) -> None:
    turn = to_z_up(up, front=front)
    axis = np.zeros(3)
    axis["xyz".index(up[-1].lower())] = -1.0 if up.startswith("-") else 1.0
    np.testing.assert_array_equal(turn @ axis, [0.0, 0.0, 1.0])
    assert np.linalg.det(turn) == pytest.approx(1.0)


def test_axis_and_unit_are_taken_for_files_arrays_and_trimesh(tmp_path: Path) -> None:
    millimetres = trimesh.Trimesh(Y_UP_CAR.vertices * 1e3, Y_UP_CAR.faces, process=False)
    millimetres.export(tmp_path / "car.stl")
    expected = np.array([[-1.0, -0.9, 0.0], [3.0, 0.9, 1.5]])
    for mesh in (tmp_path / "car.stl", millimetres, (millimetres.vertices, millimetres.faces)):
        points = rfgen.Actor.from_mesh(mesh, material="metal", up="y", scale=0.001).vertices(0.0)
        np.testing.assert_allclose([points.min(axis=0), points.max(axis=0)], expected, atol=1e-6)
    millimetres.units = "mm"
    points = rfgen.Actor.from_mesh(millimetres, material="metal", up="y").vertices(0.0)
    np.testing.assert_allclose(np.ptp(points, axis=0), [4.0, 1.8, 1.5])
    with pytest.raises(ValueError, match=r"up: 'w' given, allowed are 'z', 'y', 'x', '-z', '-y', '-x'"):
        rfgen.Actor.from_mesh(millimetres, material="metal", up="w")
    with pytest.raises(ValueError, match=r"scale: 0 given, a positive number of metres per unit is needed"):
        rfgen.Actor.from_mesh(millimetres, material="metal", scale=0)


@pytest.mark.parametrize(("suffix", "size"), [(".stl", 40.0), (".ply", 300.0), (".obj", 1800.0), (".glb", 450.0)])
def test_a_size_of_millimetres_or_centimetres_is_told_without_a_radar(tmp_path: Path, suffix: str, size: float) -> None:
    path = tmp_path / f"thing{suffix}"
    trimesh.creation.box((size, size / 4, size / 4)).export(path)
    with pytest.warns(UserWarning, match=rf"thing: it is {size:g} m long; .* scale=0\.001 .* \({size / 1000:g} m\)"):
        rfgen.Actor.from_mesh(path, material="metal")
    rfgen.Actor.from_mesh(path, material="metal", scale=0.001)  # a warning would be an error here


def test_a_size_of_millimetres_explains_a_range_window_that_is_too_short(awr1843: rfgen.Radar) -> None:
    with pytest.warns(UserWarning, match="it is 4000 m long"):
        car = rfgen.Actor.from_mesh(trimesh.creation.box((4000, 1800, 1500)), material="metal", position=(9e3, 0, 0))
    with pytest.raises(ValueError, match=r"reaches .* higher sample rate; it is 4000 m long: .* scale=0\.001"):
        rfgen.Simulator(None, awr1843, [car]).frames(0.1)


@pytest.fixture
def awr1843() -> rfgen.Radar:
    overrides = {"preset.mmmesh.num_loops": 2}
    return rfgen.Radar.load("awr1843", "mmmesh", position=(0, 0, 1), look_at=(3, 0, 1), overrides=overrides)


def test_an_obj_of_two_materials_is_an_actor_with_a_material_each(two_tone: Path, awr1843: rfgen.Radar) -> None:
    given = {"Paint": "metal", "Glass_01": rfgen.material("glass", thickness=0.004)}
    car = rfgen.Actor.from_mesh(two_tone, material=given, position=(8, 0, 0))
    assert car.part_names == ("Paint", "Glass_01")
    assert [each.name for each in car.materials] == ["metal", "glass"]
    assert np.bincount(car.face_parts).tolist() == [12, 12]
    assert ActorInfo.of(car).material == "metal, glass"
    paths = rfgen.Simulator(None, awr1843, [car], rtol=1e-2).paths()
    assert paths.object_names == ("car, metal", "car, glass")
    pieces = [
        rfgen.Actor.from_mesh((car.sequence.points, car.faces[car.face_parts == k]), material=each, position=(8, 0, 0))
        for k, each in enumerate(car.materials)
    ]
    actors = [replace(piece, name=f"piece {k}") for k, piece in enumerate(pieces)]
    apart = rfgen.Simulator(None, awr1843, actors, rtol=1e-2, collisions="ignore").paths()
    for k in (0, 1):
        assert field(paths, k) == pytest.approx(field(apart, k), rel=0.02)
    with pytest.raises(MaterialError, match=r"one material is needed here, it has several: Paint \(metal\), Glass_01"):
        _ = car.properties


def test_a_material_for_all_parts_leaves_one_object(two_tone: Path, awr1843: rfgen.Radar) -> None:
    for material in ("metal", {"Paint": "metal", "Glass_01": "steel"}):
        car = rfgen.Actor.from_mesh(two_tone, material=material, position=(8, 0, 0))
        assert rfgen.Simulator(None, awr1843, [car], rtol=1e-2).paths().object_names == ("car",)


def test_objects_and_known_names_choose_materials(tmp_path: Path, two_tone: Path) -> None:
    car = rfgen.Actor.from_mesh(two_tone, material={"shell": "metal", "screen": "glass"})
    assert [each.name for each in car.materials] == ["metal", "glass"]
    box = trimesh.creation.box()
    known = write_obj(tmp_path / "chair.obj", ("seat", "Leather.001", box), ("leg", "mat-itu_metal", box))
    assert [each.name for each in rfgen.Actor.from_mesh(known).materials] == ["leather", "metal"]


def test_unknown_names_are_refused_in_one_message_with_the_cure(two_tone: Path) -> None:
    wanted = r"car: no known material for 'Paint', 'Glass_01'; give material='metal' for all of them, or material="
    with pytest.raises(MaterialError, match=wanted + r"\{'Paint': 'metal', 'Glass_01': 'glass'\} with .*known are abs"):
        rfgen.Actor.from_mesh(two_tone)
    with pytest.raises(MaterialError, match=r"material names 'Window', which no part has; .* 'Paint', 'shell', 'Glass"):
        rfgen.Actor.from_mesh(two_tone, material={"Window": "glass"})
    with pytest.raises(MaterialError, match=r"unknown material 'human', did you mean 'skin'"):
        rfgen.Actor.from_mesh(two_tone, material={"Paint": "human", "Glass_01": "glass"})


def test_a_gltf_of_several_nodes_keeps_their_places_and_materials(tmp_path: Path) -> None:
    scene = trimesh.Scene()
    for k, name in enumerate(("Chrome", "rubber")):
        box = trimesh.creation.box((1, 1, 1))
        box.visual = trimesh.visual.TextureVisuals(material=PBRMaterial(name=name))
        flip = np.diag([-1.0 if k else 1.0, 1, 1, 1])  # a mirrored node
        scene.add_geometry(box, transform=trimesh.transformations.translation_matrix((0, 0, 3 * k)) @ flip)
    scene.export(tmp_path / "bike.glb")
    bike = rfgen.Actor.from_mesh(tmp_path / "bike.glb")
    middles = [bike.vertices(0.0)[np.unique(bike.faces[bike.face_parts == k])].mean(axis=0) for k in (0, 1)]
    by_name = {each.name: middle for each, middle in zip(bike.materials, middles, strict=True)}
    np.testing.assert_allclose(by_name["metal"], [0, 0, 0], atol=1e-7)
    np.testing.assert_allclose(by_name["rubber"], [3, 0, 0], atol=1e-7)
    (whole,) = [rfgen.Actor.from_mesh(tmp_path / "bike.glb", material="metal")]
    assert trimesh.Trimesh(whole.vertices(0.0), whole.faces).volume == pytest.approx(2.0)


def test_polygons_are_split_also_where_they_are_not_convex(tmp_path: Path) -> None:
    corners = np.array([[0, 0, 0], [2, 0, 0], [2, 2, 0], [1, 0.5, 0], [0, 2, 0]], float)  # an M: area 2.5
    faces = np.array(split_polygon(corners, [0, 1, 2, 3, 4]))
    triangles = trimesh.Trimesh(corners, faces, process=False)
    assert triangles.area == pytest.approx(2.5)
    assert (triangles.face_normals[:, 2] > 0).all()
    (tmp_path / "m.obj").write_text(
        "".join("v {} {} {}\n".format(*c) for c in corners) + "vt 0 0\nf 1/1 2/1 3/1 \\\n 4/1 -1/1 # an M\n"
    )
    ((_, _, vertices, read),) = read_obj(tmp_path / "m.obj")
    np.testing.assert_array_equal(vertices[read], triangles.triangles)


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("points.obj", "v 0 0 0\nv 1 0 0\np 1 2\n", r"holds no triangles: it has 2 vertices, 1 points"),
        ("bad.obj", "v 0 0 0\nv 1 zero 0\n", r"line 2, 'v 1 zero 0', cannot be read"),
        ("missing.obj", "v 0 0 0\nv 1 0 0\nf 1 2 3\n", r"line 3, 'f 1 2 3', cannot be read: three or more of the 2"),
        ("empty.obj", "", "holds no triangles"),
        (
            "cloud.ply",
            PLY_HEADER.format(2) + "end_header\n0 0 0\n1 0 0\n",
            r"holds no triangles: it has 2 points without faces, which must be meshed first",
        ),
        ("odd.gltf", "[1, 2]", "no sound glTF"),
        (
            "fan.gltf",
            '{"asset": {"version": "2.0"}, "accessors": [{"sparse": {}}], "meshes": [{"primitives": [{"mode": 6}]}]}',
            r"geometry that is not read \(sparse accessors, triangle fans\)",
        ),
        (
            "packed.gltf",
            '{"asset": {"version": "2.0"}, "extensionsRequired": ["KHR_draco_mesh_compression"]}',
            r"geometry that is not read \(extension KHR_draco_mesh_compression\): export it as plain",
        ),
    ],
)
def test_a_file_without_a_surface_is_refused(tmp_path: Path, name: str, text: str, message: str) -> None:
    (tmp_path / name).write_text(text)
    with pytest.raises(MeshError, match=message):
        rfgen.Actor.from_mesh(tmp_path / name, material="metal")


def test_quads_of_a_ply_are_two_triangles(tmp_path: Path) -> None:
    (tmp_path / "quad.ply").write_text(
        PLY_HEADER.format(4) + "element face 1\nproperty list uchar int vertex_indices\nend_header\n"
        "0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3\n"
    )
    (part,) = read_mesh_parts(tmp_path / "quad.ply")
    assert trimesh.Trimesh(part.vertices, part.faces).area == pytest.approx(1.0)


def test_parts_that_touch_are_checked_one_by_one(tmp_path: Path) -> None:
    """Three sheets at one edge are no surface, but three parts are."""
    path = tmp_path / "sheets.obj"
    points = "v 0 0 0\nv 0 0 1\nv 1 0 0\nv 0 1 0\nv -1 0 0\n"
    path.write_text(points + "usemtl metal\nf 1 2 3\nusemtl glass\nf 2 1 4\nusemtl wood\nf 1 2 5\n")
    with pytest.raises(MeshError, match="not manifold"):
        RigidMesh([[0, 0, 0], [0, 0, 1], [1, 0, 0], [0, 1, 0], [-1, 0, 0]], [[0, 1, 2], [1, 0, 3], [0, 1, 4]])
    assert len(rfgen.Actor.from_mesh(path).faces) == 3


def test_a_body_of_one_material_is_closed_across_the_materials_of_its_file(tmp_path: Path) -> None:
    box = trimesh.creation.box()
    lid = box.face_normals[:, 2] > 0.5
    parts = [trimesh.Trimesh(box.vertices, box.faces[chosen], process=False) for chosen in (lid, ~lid)]
    path = write_obj(tmp_path / "box.obj", ("box", "Lid", parts[0]), ("box", "Walls", parts[1]))
    whole = rfgen.Actor.from_mesh(path, material="metal")
    assert trimesh.Trimesh(whole.vertices(0.0), whole.faces, process=False).is_watertight


def test_a_gltf_scene_that_trimesh_has_loaded_is_asked_for_its_up_axis(tmp_path: Path) -> None:
    Y_UP_CAR.export(tmp_path / "car.glb")
    loaded = trimesh.load(tmp_path / "car.glb")
    with pytest.warns(UserWarning, match="mesh: z is taken for its up axis, but its glTF file has y up: give up='y'"):
        rfgen.Actor.from_mesh(loaded, material="metal")
    points = rfgen.Actor.from_mesh(loaded, material="metal", up="y").vertices(0.0)
    np.testing.assert_allclose(np.ptp(points, axis=0), [4.0, 1.8, 1.5], rtol=1e-6)


def test_a_format_that_is_not_read_names_those_that_are(tmp_path: Path) -> None:
    (tmp_path / "car.fbx").write_bytes(b"Kaydara FBX Binary")
    with pytest.raises(MeshError, match=r"car\.fbx' cannot be read: .*; export it as glTF \(\.glb\), OBJ, PLY or STL"):
        rfgen.Actor.from_mesh(tmp_path / "car.fbx", material="metal")


def test_parts_without_a_known_name_take_the_default_material(tmp_path: Path) -> None:
    scene = trimesh.Scene({name: trimesh.creation.box() for name in ("Seat", "Wood")})
    scene.export(tmp_path / "chair.glb")
    chair = rfgen.Actor.from_mesh(tmp_path / "chair.glb", default_material="plastic")
    assert dict(zip(chair.part_names, (each.name for each in chair.materials), strict=True)) == {
        "Seat": "plastic", "Wood": "wood",
    }  # fmt: skip
    with pytest.raises(ValueError, match="default_material: material gives one to the whole mesh"):
        rfgen.Actor.from_mesh(tmp_path / "chair.glb", material="metal", default_material="plastic")


def test_an_orientation_in_degrees_is_told() -> None:
    with pytest.warns(UserWarning, match=r"orientation is \(90, 0, 0\), yaw, pitch, roll in radians, .*5157"):
        rfgen.Actor.from_mesh(trimesh.creation.box(), material="metal", orientation=(90, 0, 0))


def test_a_mesh_that_is_not_manifold_is_taken_as_the_error_says() -> None:
    """Three sheets at one edge."""
    points, faces = [[0, 0, 0], [0, 0, 1], [1, 0, 0], [0, 1, 0], [-1, 0, 0]], [[0, 1, 2], [0, 1, 3], [0, 1, 4]]
    sheets = trimesh.Trimesh(points, faces, process=False)
    with pytest.raises(MeshError, match=r"not manifold, 1 edges .*unmerge_vertices of trimesh parts them"):
        rfgen.Actor.from_mesh(sheets, material="metal")
    sheets.unmerge_vertices()
    assert len(rfgen.Actor.from_mesh(sheets, material="metal").faces) == 3
