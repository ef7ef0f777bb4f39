"""Objects that are no people: cars on a path, and whatever a GLB file animates."""

from __future__ import annotations

import json
import struct
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from rfgen_sionna.generative.bodies.gltf import is_animated, load_animation
from rfgen_sionna.generative.driving import Drive
from rfgen_sionna.generative.motion.loaders import ClipError
from rfgen_sionna.records import MeshSequence


def glb(path: Path, *, interpolation: str = "LINEAR", extra: dict | None = None) -> Path:
    """An arm of two boxes' corners: six vertices, three of them on a joint that turns by 90° about z in a second."""
    vertices = np.array([[0, 0, 0], [1, 0, 0], [0, 0, 1], [0, 2, 0], [1, 2, 0], [0, 2, 1]], "<f4")
    faces = np.array([0, 1, 2, 3, 4, 5], "<u2")
    joints = np.array([[0, 0, 0, 0]] * 3 + [[1, 0, 0, 0]] * 3, "<u1")
    weights = np.array([[1, 0, 0, 0]] * 6, "<f4")
    bind = np.tile(np.eye(4, dtype="<f4"), (2, 1, 1))
    bind[1, 1, 3] = -1.0
    times = np.array([0.0, 1.0], "<f4")
    turns = Rotation.from_euler("z", [[0.0], [90.0]], degrees=True).as_quat().astype("<f4")
    if interpolation == "CUBICSPLINE":
        turns = np.stack([np.zeros_like(turns), turns, np.zeros_like(turns)], axis=1).reshape(-1, 4)
    # matrices are stored column by column
    arrays = [vertices, faces, joints, weights, bind.swapaxes(1, 2), times, turns]
    kinds = ["VEC3", "SCALAR", "VEC4", "VEC4", "MAT4", "SCALAR", "VEC4"]
    views, accessors, data = [], [], b""
    for values, kind in zip(arrays, kinds, strict=True):
        raw = np.ascontiguousarray(values).tobytes()
        views.append({"buffer": 0, "byteOffset": len(data), "byteLength": len(raw)})
        code = {"<f4": 5126, "<u2": 5123, "|u1": 5121}[values.dtype.str]
        width = {"VEC3": 3, "SCALAR": 1, "VEC4": 4, "MAT4": 16}[kind]
        accessors.append(
            {"bufferView": len(views) - 1, "componentType": code, "count": values.size // width, "type": kind}
        )
        data += raw + b"\0" * (-len(raw) % 4)
    tree = {
        "asset": {"version": "2.0"},
        "buffers": [{"byteLength": len(data)}],
        "bufferViews": views,
        "accessors": accessors,
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "JOINTS_0": 2, "WEIGHTS_0": 3}, "indices": 1}]}],
        "skins": [{"joints": [1, 2], "inverseBindMatrices": 4}],
        "nodes": [{"mesh": 0, "skin": 0}, {"children": [2]}, {"translation": [0, 1, 0]}],
        "animations": [
            {
                "name": "bend",
                "channels": [{"sampler": 0, "target": {"node": 2, "path": "rotation"}}],
                "samplers": [{"input": 5, "output": 6, "interpolation": interpolation}],
            }
        ],
        **(extra or {}),
    }
    text = json.dumps(tree).encode()
    text += b" " * (-len(text) % 4)
    body = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(data), b"BIN\0") + data
    path.write_bytes(struct.pack("<4sII", b"glTF", 2, 12 + len(body)) + body)
    return path


@pytest.mark.parametrize("interpolation", ["LINEAR", "CUBICSPLINE"])
def test_a_skin_follows_its_joints(tmp_path: Path, interpolation: str) -> None:
    made = load_animation(glb(tmp_path / "arm.glb", interpolation=interpolation), frame_rate=10.0)
    assert is_animated(tmp_path / "arm.glb")
    assert isinstance(made, MeshSequence)
    assert made.duration == pytest.approx(1.0)
    # glTF's (x, y, z) is our (z, x, y) read as (y, z, x): x to the left, y up, z ahead
    assert np.allclose(made.vertices(0.0)[4], [0.0, 1.0, 2.0], atol=1e-6)
    # (1, 2, 0) turned by 90° about (0, 1, 0)'s z axis is (-1, 2, 0)
    assert np.allclose(made.vertices(1.0)[4], [0.0, -1.0, 2.0], atol=1e-6)
    assert np.allclose(made.vertices(1.0)[:3], made.vertices(0.0)[:3], atol=1e-9)
    bone = [np.linalg.norm(made.samples[k, 4] - [0.0, 0.0, 1.0]) for k in range(11)]
    assert np.allclose(bone, np.sqrt(2.0), atol=1e-6)


def test_files_that_cannot_be_used_are_named(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match="none"):
        load_animation(tmp_path / "none.glb")
    with pytest.raises(ClipError, match="it has bend"):
        load_animation(glb(tmp_path / "arm.glb"), animation=1)
    (tmp_path / "text.glb").write_bytes(b"not a mesh at all, but long enough")
    with pytest.raises(ClipError, match="not a GLB"):
        load_animation(tmp_path / "text.glb")
    whole = glb(tmp_path / "cut.glb").read_bytes()
    (tmp_path / "cut.glb").write_bytes(whole[:-40])
    with pytest.raises(ClipError, match="cut off"):
        load_animation(tmp_path / "cut.glb")


def test_a_skin_of_eight_bones_a_vertex(tmp_path: Path) -> None:
    """The second set of four carries the joint that turns."""
    swapped = {"POSITION": 0, "JOINTS_0": 2, "WEIGHTS_0": 7, "JOINTS_1": 2, "WEIGHTS_1": 3}
    path = glb(tmp_path / "arm.glb", extra={"meshes": [{"primitives": [{"attributes": swapped, "indices": 1}]}]})
    raw = path.read_bytes()
    # no weight in the first set: a view of zeros
    tree = json.loads(raw[20 : 20 + struct.unpack_from("<I", raw, 12)[0]])
    data = raw[28 + struct.unpack_from("<I", raw, 12)[0] :]
    tree["bufferViews"].append({"buffer": 0, "byteOffset": len(data), "byteLength": 96})
    tree["accessors"].append({"bufferView": 7, "componentType": 5126, "count": 6, "type": "VEC4"})
    text = json.dumps(tree).encode() + b" " * 3
    data += bytes(96)
    body = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(data), b"BIN\0") + data
    path.write_bytes(struct.pack("<4sII", b"glTF", 2, 12 + len(body)) + body)
    one = load_animation(glb(tmp_path / "one.glb"), frame_rate=10.0)
    np.testing.assert_allclose(load_animation(path, frame_rate=10.0).samples, one.samples, atol=1e-6)


@pytest.mark.parametrize(
    ("extra", "message"),
    [
        ({"accessors": []}, "not a sound GLB file"),
        ({"nodes": [{"mesh": 3}]}, "not a sound GLB file"),
        ({"nodes": [{"mesh": 0}, {"children": [99]}]}, "not a sound GLB file"),
        ({"meshes": [{"primitives": [{"attributes": {}, "mode": 1}]}]}, "no triangles"),
        ({"bufferViews": [{"buffer": 1, "byteLength": 4}] * 7}, "other files"),
    ],
)
def test_broken_files_are_named(tmp_path: Path, extra: dict, message: str) -> None:
    with pytest.raises(ClipError, match=rf"arm\.glb: .*{message}"):
        load_animation(glb(tmp_path / "arm.glb", extra=extra))


def test_a_car_keeps_its_speed_and_faces_where_it_goes() -> None:
    way = Drive([(0.0, 0.0), (20.0, 0.0), (30.0, 10.0), (30.0, 30.0)], 8.0, ramp=2.0)
    t = np.linspace(0.0, way.duration, 4001)
    places = np.stack([way(s)[0] for s in t])
    speed = np.linalg.norm(np.diff(places, axis=0), axis=-1) / np.diff(t)
    cruise = (t[1:] > 2.0) & (t[1:] < way.duration - 2.0)
    assert np.abs(speed[cruise] - 8.0).max() < 0.01
    assert speed[0] < 0.01
    assert np.allclose(places[[0, -1]], [[0.0, 0.0, 0.0], [30.0, 30.0, 0.0]], atol=1e-6)
    heading = np.arctan2(*(np.diff(places, axis=0)[2000, 1::-1]))
    assert way(t[2000])[1][0] == pytest.approx(heading, abs=0.01)
    assert abs(np.diff(speed, n=2)).max() < 1e-3


def test_bad_paths_are_named() -> None:
    with pytest.raises(ValueError, match="points"):
        Drive([(0.0, 0.0)], 1.0)
    with pytest.raises(ValueError, match="same"):
        Drive([(0.0, 0.0), (0.0, 0.0)], 1.0)
    with pytest.raises(ValueError, match="speed"):
        Drive([(0.0, 0.0), (1.0, 0.0)], 0.0)
    with pytest.raises(ValueError, match="ramp"):
        Drive([(0.0, 0.0), (1.0, 0.0)], 1.0, ramp=-1.0)


def test_a_car_is_an_actor() -> None:
    import trimesh

    from rfgen_sionna.scene import MeshActor

    car = MeshActor.from_mesh(
        trimesh.creation.box((4.0, 1.8, 1.4)), material="metal", trajectory=Drive([(5, 0), (25, 0)], 10.0)
    )
    middle = car.vertices(1.5).mean(axis=0)
    assert middle[0] == pytest.approx(5.0 + Drive([(5, 0), (25, 0)], 10.0).travelled(1.5))


def test_an_animated_file_is_an_actor(tmp_path: Path) -> None:
    from rfgen_sionna.generative import Actor, Phenotype

    path = glb(tmp_path / "arm.glb")
    arm = Actor.from_motion(path, material="metal", name="arm", position=(4.0, 0.0, 0.0), orientation=(0.0, 0.0, 0.0))
    assert arm.duration == pytest.approx(1.0)
    assert np.allclose(arm.vertices(0.0)[4], [4.0, 1.0, 2.0], atol=1e-6)
    with pytest.raises(ValueError, match="body"):
        Actor.from_motion(path, body=Phenotype())
