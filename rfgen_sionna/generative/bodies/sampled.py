"""Mesh sequences from sampled vertices: scans, simulations, exports of other programs."""

from __future__ import annotations

import logging
import re
from dataclasses import dataclass
from functools import cached_property
from os import PathLike
from pathlib import Path

import numpy as np
from scipy.interpolate import CubicSpline

from rfgen_sionna._short_repr import ShortRepr
from rfgen_sionna._types import FloatArray, IntArray
from rfgen_sionna.generative.motion.clip_error import ClipError
from rfgen_sionna.generative.motion.importers import MOTION_SUFFIXES
from rfgen_sionna.scene.mesh_files import to_z_up

_LOG = logging.getLogger(__name__)
MESH_SUFFIXES = (".obj", ".ply", ".stl", ".off", ".glb", ".gltf")


@dataclass(frozen=True, eq=False, repr=False)
class SampledSequence(ShortRepr):
    """Vertices on C² splines through samples of a fixed rate; a :class:`~rfgen_sionna.records.MeshSequence`."""

    samples: FloatArray
    """(frame, vertex, 3) positions [m]."""
    faces: IntArray
    """(face, 3) vertex indices, counter-clockwise seen from outside."""
    frame_rate: float
    """Frames per second [Hz]."""
    part_names: tuple[str, ...] = ("mesh",)

    @property
    def face_parts(self) -> IntArray:
        """(face,) zeros: one part."""
        return np.zeros(len(self.faces), np.int32)

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Empty: no skeleton."""
        return ()

    @property
    def duration(self) -> float:
        """Time between the first and the last frame [s]; `inf` for a single one."""
        return float("inf") if len(self.samples) < 2 else (len(self.samples) - 1) / self.frame_rate

    @cached_property
    def _curve(self) -> CubicSpline:
        return CubicSpline(np.arange(len(self.samples)) / self.frame_rate, self.samples)

    def vertices(self, t: float) -> FloatArray:
        """(vertex, 3) positions at `t` [s] in metres."""
        if len(self.samples) < 2:
            return self.samples[0]
        return np.asarray(self._curve(min(max(float(t), 0.0), self.duration)))

    def joints(self, t: float) -> FloatArray:
        """(0, 3): no skeleton."""
        return np.empty((0, 3))


def mesh_sequence(
    source: str | PathLike[str], frame_rate: float | None, index: int = 0, *, name: str = "mesh", up: str | None = None
) -> SampledSequence:
    """:func:`load_mesh_sequence` of a clip that is no file of a motion.

    Raises:
        FileNotFoundError: there is no such file or folder.
        ClipError: the file is of another kind, or cannot be read.
        ValueError: `frame_rate` is missing, or `index` is not 0.
    """
    path = Path(source)
    if not path.exists():
        raise FileNotFoundError(f"no motion file or folder of meshes {source}")
    if path.is_file() and path.suffix.lower() not in MESH_SUFFIXES:
        allowed = ", ".join((*MOTION_SUFFIXES, *MESH_SUFFIXES))
        raise ClipError(f"{path.name}: ending {path.suffix!r}; allowed are {allowed}")
    if index:
        raise ValueError(f"index: {index!r} of the mesh sequence {source}, which is one motion; allowed is 0")
    if frame_rate is None:
        raise ValueError(f"frame_rate: needed for the mesh sequence {source}, in Hz")
    return load_mesh_sequence(source, frame_rate=frame_rate, name=name, up=up)


def load_mesh_sequence(
    source: str | PathLike[str], *, frame_rate: float, name: str = "mesh", up: str | None = None
) -> SampledSequence:
    """Read a sequence of meshes of fixed connectivity, in metres.

    Args:
        source: a folder of OBJ, PLY, STL, OFF and glTF files, in the order of the numbers in their names, or one file.
        frame_rate: frames per second [Hz].
        name: name of the mesh's part.
        up: up axis of the meshes, "z", "y", "-y", ...; None is "y" for glTF files, as its standard says, else "z". The
            front of a mesh with y up is +z, as in glTF, and turns to +x.

    Raises:
        FileNotFoundError: the file or folder does not exist.
        ClipError: no meshes, no triangles, values that are not finite, changing connectivity, or a frame rate that is
            not positive.
    """
    import trimesh

    if not (np.isfinite(frame_rate) and frame_rate > 0.0):
        raise ClipError(f"frame_rate: {frame_rate!r} Hz; allowed is more than 0")
    files = _files(Path(source))
    try:
        turn = to_z_up(up or ("y" if files[0].suffix.lower() in (".glb", ".gltf") else "z"), front=True)
    except ValueError as error:
        raise ClipError(str(error)) from error
    samples: list[FloatArray] = []
    faces = np.empty((0, 3), np.int32)
    for file in files:
        try:
            mesh = trimesh.load_mesh(file, process=False)
        except Exception as error:  # trimesh's readers raise many kinds
            raise ClipError(f"{file.name}: not a readable mesh ({type(error).__name__}: {error})") from error
        vertices, triangles = np.asarray(mesh.vertices, np.float64) @ turn.T, np.asarray(mesh.faces, np.int32)
        if len(triangles) == 0:
            raise ClipError(f"{file.name}: has no triangles")
        if not np.isfinite(vertices).all():
            raise ClipError(f"{file.name}: has vertices that are not finite")
        if not samples:
            faces = triangles
        elif len(vertices) != len(samples[0]) or not np.array_equal(triangles, faces):
            raise ClipError(
                f"{file.name}: {len(vertices)} vertices and {len(triangles)} faces differ from {files[0].name} "
                f"({len(samples[0])} and {len(faces)}, or in another order); the connectivity must be the same"
            )
        samples.append(vertices)
    size = np.ptp(samples[0], axis=0)
    if up is None and size[1] > 2.0 * size[[0, 2]].max():
        _LOG.warning(
            "%s: read with z up, though %.2f m along y and %.2f m along z; up='y' would stand it up",
            files[0].name, size[1], size[2],
        )  # fmt: skip
    return SampledSequence(np.stack(samples), faces, float(frame_rate), (name,))


def _files(folder: Path) -> list[Path]:
    if not folder.exists():
        raise FileNotFoundError(f"no mesh sequence {folder}")
    found = [p for p in folder.iterdir() if p.suffix.lower() in MESH_SUFFIXES] if folder.is_dir() else [folder]
    if not found:
        raise ClipError(f"{folder.name}: holds no meshes; readable are {', '.join(MESH_SUFFIXES)}")
    return sorted(found, key=lambda p: [int(s) if s.isdigit() else s for s in re.split(r"(\d+)", p.name)])
