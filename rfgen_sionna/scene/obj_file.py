"""Wavefront OBJ files: triangles of each object and material, in double precision."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from rfgen_sionna._types import FloatArray, IntArray
from rfgen_sionna.scene.scene_errors import MeshError

_IGNORED_SHAPES = {"p": "points", "l": "lines", "curv": "curves", "curv2": "curves", "surf": "free-form surfaces"}


def read_obj(path: Path) -> list[tuple[str, str, FloatArray, IntArray]]:
    """(object or group, material, vertices (vertex, 3), faces (face, 3)) of an OBJ file, in the order of the file.

    Materials are the names after `usemtl`, empty without one; the MTL file, which holds colours only, is not read.
    Polygons are split into triangles.

    Raises:
        MeshError: a line cannot be read, a face uses a vertex that does not exist, or there are no faces.
    """
    points: list[tuple[float, float, float]] = []
    parts: dict[tuple[str, str], list[list[int]]] = {}
    left_out: dict[str, int] = {}
    owner, material = "", ""
    faces: list[list[int]] | None = None
    for number, line in _lines(path):
        keyword, *words = line.split()
        try:
            if keyword == "v":
                x, y, z = words[:3]
                points.append((float(x), float(y), float(z)))
            elif keyword == "f":
                corners = [int(word.partition("/")[0]) for word in words]
                if min(corners, default=0) < 0:
                    corners = [c + len(points) + 1 if c < 0 else c for c in corners]
                if len(corners) < 3 or min(corners) < 1 or max(corners) > len(points):
                    raise ValueError(f"three or more of the {len(points)} vertices so far are needed")
                if faces is None:
                    faces = parts.setdefault((owner, material), [])
                faces.append(corners)
            elif keyword in ("o", "g"):
                owner, faces = " ".join(words), None
            elif keyword == "usemtl":
                material, faces = " ".join(words), None
            elif keyword in _IGNORED_SHAPES:
                left_out[_IGNORED_SHAPES[keyword]] = left_out.get(_IGNORED_SHAPES[keyword], 0) + 1
        except ValueError as error:
            raise MeshError(
                f"mesh file {str(path)!r}: line {number}, {line[:60]!r}, cannot be read: {error}"
            ) from error
    if not parts:
        there = "".join(f", {count} {name}" for name, count in left_out.items())
        raise MeshError(
            f"mesh file {str(path)!r} holds no triangles: it has {len(points)} vertices{there}; surfaces of faces "
            "are needed (a point cloud must be meshed first)"
        )
    vertices = np.array(points, np.float64)
    found = []
    for (name, of), polygons in parts.items():
        triangles = _triangles(vertices, polygons)
        used = np.zeros(len(vertices), np.bool_)
        used[triangles] = True
        numbers = np.cumsum(used, dtype=np.int32) - np.int32(1)
        found.append((name, of, vertices[used], numbers[triangles]))
    return found


def _lines(path: Path) -> Iterator[tuple[int, str]]:
    """Numbers and texts of the lines that are not empty, without comments; a backslash continues a line."""
    pending = ""
    with path.open(encoding="utf-8", errors="replace") as file:
        for number, line in enumerate(file, 1):
            if line.startswith(("vn", "vt")):  # by far the most of what is not read
                continue
            text = line.partition("#")[0].strip() if "#" in line else line.strip()
            if pending:
                text = pending + text
            pending = text[:-1] + " " if text.endswith("\\") else ""
            if text and not pending:
                yield number, text


def _triangles(vertices: FloatArray, polygons: list[list[int]]) -> IntArray:
    """(face, 3) triangles of polygons of vertex numbers from 1 on, convex or not."""
    if max(map(len, polygons)) == 3:
        return np.array(polygons, np.int32) - np.int32(1)
    found: list[list[int]] = []
    for polygon in polygons:
        corners = [c - 1 for c in polygon]
        found += [corners] if len(corners) == 3 else split_polygon(vertices, corners)
    return np.array(found, np.int32)


def split_polygon(vertices: FloatArray, polygon: list[int]) -> list[list[int]]:
    """Triangles of a simple polygon with the corners `polygon`, by cutting ears in the plane of its area vector."""
    corners = vertices[polygon] - vertices[polygon[0]]
    normal = np.cross(corners, np.roll(corners, -1, axis=0)).sum(axis=0)
    left, found = list(range(len(polygon))), list[list[int]]()

    def turn(a: int, b: int, c: int) -> float:
        return float(normal @ np.cross(corners[b] - corners[a], corners[c] - corners[b]))

    def is_ear(k: int) -> bool:
        a, b, c = left[k - 1], left[k], left[(k + 1) % len(left)]
        if turn(a, b, c) <= 0.0:
            return False
        inside = (min(turn(a, b, p), turn(b, c, p), turn(c, a, p)) > 0.0 for p in left if p not in (a, b, c))
        return not any(inside)

    while len(left) > 3:
        ear = next((k for k in range(1, len(left)) if is_ear(k)), 1)  # a polygon without area has no ears
        found.append([polygon[left[k]] for k in (ear - 1, ear, (ear + 1) % len(left))])
        del left[ear]
    return [*found, [polygon[k] for k in left]]
