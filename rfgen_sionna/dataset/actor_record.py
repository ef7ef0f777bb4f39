"""Actors and labels of a run that is read."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._short_repr import ShortRepr, short_value
from rfgen_sionna._types import IntArray
from rfgen_sionna.dataset.run_file import RunFile
from rfgen_sionna.dataset.schema import RunFormatError


@dataclass(frozen=True, repr=False)
class ActorRecord(ShortRepr):
    """Actor of a run. Its mesh is stored, or rebuilt from the parameters of its body."""

    name: str
    material: str
    joint_names: tuple[str, ...]
    _file: RunFile
    _radar_name: str

    def _facts(self) -> Iterable[str]:
        yield from super()._facts()
        if self._file.is_open and "faces" in self._group:
            yield f"faces={short_value(self._group['faces'])}"

    @property
    def faces(self) -> IntArray:
        """(face, 3) vertex numbers."""
        return self._mesh[0]

    @property
    def face_parts(self) -> IntArray:
        """(face,) index into `part_names`."""
        return self._mesh[1]

    @property
    def part_names(self) -> tuple[str, ...]:
        """Names of the parts of the body."""
        return self._mesh[2]

    def vertices(self, frame: int) -> NDArray[np.floating[Any]]:
        """(vertex, 3) world positions [m] in frame `frame`; RunFormatError if the run has no mesh of the actor."""
        group = self._group
        if "vertices" in group:
            return np.asarray(group["vertices"][frame])
        from rfgen_sionna.dataset.actor_bodies import body_vertices

        self._check_body()
        return body_vertices(group, frame)

    def joints(self, frame: int) -> NDArray[np.floating[Any]]:
        """(joint, 3) world positions [m] in frame `frame`; (0, 3) without a stored skeleton."""
        return np.asarray(self._group["joints"][frame]) if self.joint_names else np.empty((0, 3), np.float32)

    @cached_property
    def _mesh(self) -> tuple[IntArray, IntArray, tuple[str, ...]]:
        group = self._group
        if "faces" in group:
            return group["faces"][:], group["face_part"][:], tuple(group["part"].asstr()[:])
        from rfgen_sionna.dataset.actor_bodies import body_faces

        self._check_body()
        return body_faces(group)

    def _check_body(self) -> None:
        if "body" not in self._group:
            raise RunFormatError(
                f"'{self._file.path}' holds no mesh of actor '{self.name}': write runs with keep 'body' or 'vertices'"
            )

    @property
    def _group(self) -> h5py.Group:
        return self._file.group(self._radar_name)[f"actors/{self.name}"]


@dataclass(frozen=True, repr=False)
class LabelRecord(ShortRepr):
    """Label over all frames."""

    values: NDArray[Any]
    """(frame, ...) with the axes `dims`; texts as str objects."""
    units: str
    dims: tuple[str, ...]
    description: str
