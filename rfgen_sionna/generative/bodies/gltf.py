"""Skinned and jointed animations from GLB files."""

from __future__ import annotations

import json
import struct
from functools import cached_property
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from rfgen_sionna._types import FloatArray, IntArray
from rfgen_sionna.generative.bodies.sampled import SampledSequence
from rfgen_sionna.generative.motion.clip_error import ClipError
from rfgen_sionna.scene.mesh_files import to_z_up

_TYPES = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}


def load_animation(
    path: str | PathLike[str], *, frame_rate: float = 30.0, animation: int = 0, up: str | None = None
) -> SampledSequence:
    """Read a GLB file with an animated skinned or jointed mesh; morph targets are ignored.

    Args:
        path: `.glb` file, glTF 2.0, in metres.
        frame_rate: sampling rate of the animation [Hz].
        animation: number of the animation.
        up: up axis of the file, "z", "y", "-y", ...; None is "y", as glTF's standard says.

    Raises:
        FileNotFoundError: there is no such file.
        ClipError: not a GLB file, no triangles, no such animation, or sparse or compressed data.
    """
    path = Path(path)
    if not path.is_file():
        raise FileNotFoundError(f"no mesh file {path}")
    if not (np.isfinite(frame_rate) and frame_rate > 0.0):
        raise ClipError(f"frame_rate is {frame_rate!r} Hz; allowed is more than 0")
    try:
        turn = to_z_up(up or "y", front=True)
    except ValueError as error:
        raise ClipError(str(error)) from error
    try:
        return _load(path, frame_rate, animation, turn)
    except (KeyError, IndexError, TypeError, AttributeError, RecursionError, ValueError) as error:
        if isinstance(error, ClipError):
            raise
        raise ClipError(f"{path.name}: not a sound GLB file ({type(error).__name__}: {error})") from error


def _load(path: Path, frame_rate: float, animation: int, turn: FloatArray) -> SampledSequence:
    file = _Glb(path)
    chosen = file.animation(animation)
    times = np.arange(int(np.floor(file.length(chosen) * frame_rate + 1e-6)) + 1) / frame_rate
    world = file.poses(chosen, times)
    blocks, faces, count = [], [], 0
    for node, mesh, skin in file.drawn():
        for primitive in mesh["primitives"]:
            if primitive.get("mode", 4) != 4:
                continue
            vertices, triangles = file.triangles(primitive)
            if skin is None:
                placed = np.einsum("tij,vj->tvi", world[node], _homogeneous(vertices))[..., :3]
            else:
                placed = file.skinned(primitive, vertices, skin, world)
            blocks.append(placed)
            faces.append(triangles + count)
            count += len(vertices)
    if not blocks:
        raise ClipError(f"{path.name}: has no triangles")
    samples = np.concatenate(blocks, axis=1) @ turn.T
    if not np.isfinite(samples).all():
        raise ClipError(f"{path.name}: has vertices that are not finite")
    return SampledSequence(samples, np.concatenate(faces).astype(np.int32), float(frame_rate), (path.stem,))


def is_animated(path: str | PathLike[str]) -> bool:
    """Whether a file is a GLB file with an animation."""
    path = Path(path)
    if path.suffix.lower() != ".glb" or not path.is_file():
        return False
    tree = _Glb(path).tree
    if not isinstance(tree, dict):
        raise ClipError(f"{path.name}: its description is no object")
    return bool(tree.get("animations"))


class _Glb:
    """A GLB file in memory."""

    def __init__(self, path: Path) -> None:
        raw = path.read_bytes()
        if len(raw) < 20 or raw[:4] != b"glTF":
            raise ClipError(f"{path.name}: not a GLB file")
        size = struct.unpack_from("<I", raw, 12)[0]
        self.name = path.name
        try:
            self.tree: dict[str, Any] = json.loads(raw[20 : 20 + size])
        except ValueError as error:
            raise ClipError(f"{path.name}: its description is not readable ({error})") from error
        self.data = raw[20 + size + 8 :]

    @cached_property
    def nodes(self) -> list[dict[str, Any]]:
        return list(self.tree.get("nodes", []))

    @cached_property
    def parents(self) -> list[int]:
        """(node,) -1 for roots."""
        found = [-1] * len(self.nodes)
        for k, node in enumerate(self.nodes):
            for child in node.get("children", []):
                found[child] = k
        return found

    def array(self, index: int) -> FloatArray:
        """(count, width) values of an accessor."""
        accessor = self.tree["accessors"][index]
        if "bufferView" not in accessor or "sparse" in accessor:
            raise ClipError(f"{self.name}: has sparse or compressed data, which is not read; export it without")
        view = self.tree["bufferViews"][accessor["bufferView"]]
        if view.get("buffer", 0) != 0:
            raise ClipError(f"{self.name}: has data in other files, which are not read; export it as one GLB file")
        dtype = np.dtype(_TYPES[accessor["componentType"]])
        width, count = _WIDTHS[accessor["type"]], accessor["count"]
        start = view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
        stride = view.get("byteStride", 0) or width * dtype.itemsize
        if start + stride * (count - 1) + width * dtype.itemsize > len(self.data):
            raise ClipError(f"{self.name}: is cut off; its data end too early")
        values = np.ndarray((count, width), dtype, self.data, start, (stride, dtype.itemsize)).astype(np.float64)
        return values / np.iinfo(dtype).max if accessor.get("normalized") else values

    def animation(self, number: int) -> dict[str, Any]:
        found: list[dict[str, Any]] = self.tree.get("animations", [])
        if 0 <= number < len(found):
            return found[number]
        names = [a.get("name", str(k)) for k, a in enumerate(found)]
        raise ClipError(f"{self.name}: no animation {number!r}; it has {', '.join(names) or 'none'}")

    def length(self, animation: dict[str, Any]) -> float:
        """Duration [s]."""
        return max(float(self.array(s["input"])[-1, 0]) for s in animation["samplers"])

    def poses(self, animation: dict[str, Any], times: FloatArray) -> FloatArray:
        """(node, time, 4, 4) world transforms."""
        moves = {
            (channel["target"]["node"], channel["target"]["path"]): animation["samplers"][channel["sampler"]]
            for channel in animation["channels"]
            if "node" in channel["target"]
        }
        local = np.tile(np.eye(4), (len(self.nodes), len(times), 1, 1))
        for k, node in enumerate(self.nodes):
            if "matrix" in node:
                local[k] = np.reshape(node["matrix"], (4, 4)).T
                continue
            rest = {"translation": [0.0, 0.0, 0.0], "rotation": [0.0, 0.0, 0.0, 1.0], "scale": [1.0, 1.0, 1.0]}
            t, r, s = (
                self._curve(moves[k, path], times, path == "rotation")
                if (k, path) in moves
                else np.tile(np.asarray(node.get(path, rest[path]), np.float64), (len(times), 1))
                for path in ("translation", "rotation", "scale")
            )
            local[k, :, :3, :3] = Rotation.from_quat(r).as_matrix() * s[:, None, :]
            local[k, :, :3, 3] = t
        world: dict[int, FloatArray] = {}

        def place(k: int) -> FloatArray:
            if k not in world:
                world[k] = local[k] if self.parents[k] < 0 else place(self.parents[k]) @ local[k]
            return world[k]

        return np.stack([place(k) for k in range(len(self.nodes))])

    def _curve(self, sampler: dict[str, Any], times: FloatArray, turn: bool) -> FloatArray:
        """(time, width) values of a sampler, constant before its first and after its last key."""
        from scipy.interpolate import CubicHermiteSpline

        keys, values = self.array(sampler["input"])[:, 0], self.array(sampler["output"])
        t = np.clip(times, keys[0], keys[-1])
        kind = sampler.get("interpolation", "LINEAR")
        if kind == "CUBICSPLINE":
            inward, points, outward = values.reshape(len(keys), 3, -1).swapaxes(0, 1)
            if len(keys) < 2:
                return np.repeat(points, len(t), axis=0)
            # glTF's tangents differ on both sides of a key: one Hermite piece between two keys
            out = np.empty((len(t), points.shape[1]))
            piece = np.clip(np.searchsorted(keys, t, side="right") - 1, 0, len(keys) - 2)
            for k in np.unique(piece):
                at = piece == k
                spline = CubicHermiteSpline(keys[k : k + 2], points[k : k + 2], np.stack([outward[k], inward[k + 1]]))
                out[at] = spline(t[at])
            return out
        if kind == "STEP" or len(keys) < 2:
            return values[np.clip(np.searchsorted(keys, t, side="right") - 1, 0, len(keys) - 1)]
        if turn:
            return Slerp(keys, Rotation.from_quat(values))(t).as_quat()
        return np.stack([np.interp(t, keys, column) for column in values.T], axis=-1)

    def drawn(self) -> list[tuple[int, dict[str, Any], dict[str, Any] | None]]:
        """(node, mesh, skin) of every node with a mesh."""
        return [
            (k, self.tree["meshes"][n["mesh"]], self.tree["skins"][n["skin"]] if "skin" in n else None)
            for k, n in enumerate(self.nodes)
            if "mesh" in n
        ]

    def triangles(self, primitive: dict[str, Any]) -> tuple[FloatArray, IntArray]:
        """(vertex, 3) positions and (face, 3) indices."""
        vertices = self.array(primitive["attributes"]["POSITION"])
        order = self.array(primitive["indices"])[:, 0] if "indices" in primitive else np.arange(len(vertices))
        return vertices, order.reshape(-1, 3).astype(np.int32)

    def skinned(
        self, primitive: dict[str, Any], vertices: FloatArray, skin: dict[str, Any], world: FloatArray
    ) -> FloatArray:
        """(time, vertex, 3) positions by linear blend skinning."""
        attributes = primitive["attributes"]
        # four bones a set
        sets = [k for k in range(8) if f"JOINTS_{k}" in attributes] or [0]
        joints = np.concatenate([self.array(attributes[f"JOINTS_{k}"]) for k in sets], axis=1).astype(int)
        weights = np.concatenate([self.array(attributes[f"WEIGHTS_{k}"]) for k in sets], axis=1)
        weights = weights / np.maximum(weights.sum(axis=1, keepdims=True), 1e-12)
        count = len(skin["joints"])
        bind = np.tile(np.eye(4), (count, 1, 1))
        if "inverseBindMatrices" in skin:
            bind = self.array(skin["inverseBindMatrices"]).reshape(-1, 4, 4).swapaxes(1, 2)
        bones = world[skin["joints"]] @ bind[:, None]
        dense = np.zeros((len(vertices), count))
        np.add.at(dense, (np.arange(len(vertices))[:, None], joints), weights)
        blended = np.einsum("vb,btij->tvij", dense, bones[:, :, :3], optimize=True)
        return np.einsum("tvij,vj->tvi", blended, _homogeneous(vertices))


def _homogeneous(vertices: FloatArray) -> FloatArray:
    return np.concatenate([vertices, np.ones((len(vertices), 1))], axis=1)
