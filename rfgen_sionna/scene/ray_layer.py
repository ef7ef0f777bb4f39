"""A Mitsuba scene of one mesh whose vertices can move. :func:`~rfgen_sionna.scene.mitsuba_backend.ensure_backend` must
have run."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache, cached_property
from typing import Any, Literal, TypeAlias

import numpy as np

from rfgen_sionna._types import FloatArray, IntArray
from rfgen_sionna.parallel import ThreadLimit
from rfgen_sionna.scene.kernels import upload
from rfgen_sionna.scene.scene_errors import BackendError

MeshArrays: TypeAlias = tuple[FloatArray, IntArray]
"""(vertex, 3) positions [m] and (face, 3) vertex indices."""


class MeshLayer:
    """One Mitsuba scene with a single mesh of several objects.

    Args:
        meshes: vertices [m] and faces of each object.
        origin: (3,) origin of the float32 coordinates [m].
        moving: True builds an instance whose vertices :meth:`move` can change.
    """

    def __init__(self, meshes: Sequence[MeshArrays], origin: FloatArray, moving: bool) -> None:
        import mitsuba as mi

        self.vertices = np.concatenate([np.asarray(v, np.float64) for v, _ in meshes])
        starts = np.cumsum([0] + [len(v) for v, _ in meshes])
        self.counts = [len(v) for v, _ in meshes]
        self.faces = np.concatenate(
            [np.asarray(f, np.uint32) + np.uint32(s) for (_, f), s in zip(meshes, starts, strict=False)]
        )
        self._origin = origin
        _start()
        mesh = mi.Mesh("layer", len(self.vertices), len(self.faces))
        parameters = mi.traverse(mesh)
        parameters["faces"] = mi.UInt32(self.faces.ravel())
        key = _position_key(parameters)
        parameters[key] = self._shifted()
        parameters.update()
        if moving:
            description: dict[str, Any] = {
                "type": "scene",
                "group": {"type": "shapegroup", "mesh": mesh},
                "instance": {"type": "instance", "group": {"type": "ref", "id": "group"}},
            }
            with _ONE_THREAD.held():
                self.scene = mi.load_dict(description)
        else:
            self.scene = mi.load_dict({"type": "scene", "mesh": mesh})

    @cached_property
    def _parameters(self) -> Any:
        import mitsuba as mi

        return mi.traverse(self.scene)

    def move(self, vertices: FloatArray) -> None:
        """Move all vertices to (vertex, 3) positions [m]."""
        self.vertices = vertices
        with _ONE_THREAD.held():
            self._parameters[_position_key(self._parameters)] = self._shifted()
            self._parameters.update()

    def _shifted(self) -> Any:
        import mitsuba as mi

        return upload(mi.Float, self.vertices - self._origin)


@cache
def _start() -> None:
    """Build a first scene with all threads of Dr.Jit: Embree keeps the number of threads of its first scene."""
    import mitsuba as mi

    mi.load_dict({"type": "scene", "mesh": {"type": "rectangle"}})


def one_scene_per_kernel() -> bool:
    """Whether a kernel can trace one scene only. OptiX has one shader table per kernel: rays through a second scene
    silently hit nothing."""
    import drjit as dr
    import mitsuba as mi

    return bool(dr.backend_v(mi.Float) == dr.JitBackend.CUDA)


def evaluate_hits(*found: Any) -> None:
    """Evaluate the hits in one scene before the next, where a kernel can trace one scene only."""
    import drjit as dr

    if one_scene_per_kernel():
        dr.eval(*found)


def loop_mode(scenes: int) -> Literal["evaluated", "symbolic"]:
    """Mode of a Dr.Jit loop whose steps trace a number of scenes: symbolic (one kernel) where possible."""
    return "evaluated" if scenes > 1 and one_scene_per_kernel() else "symbolic"


def _one_thread() -> Callable[[], None]:
    """Limit Dr.Jit and Embree to one CPU thread in the process; returns the function that undoes it."""
    import drjit as dr
    import mitsuba as mi

    threads = dr.thread_count()
    if threads < 2 or dr.backend_v(mi.Float) != dr.JitBackend.LLVM:
        return lambda: None
    dr.set_thread_count(1)
    return lambda: dr.set_thread_count(threads)


_ONE_THREAD = ThreadLimit(_one_thread)
"""Embree builds the tree of a moving mesh with one thread; waiting helpers slow it down."""


def _position_key(parameters: Any) -> str:
    for key in map(str, parameters.keys()):  # Mitsuba 3.9: vertex_positions
        if key.split(".")[-1] in ("vertex_positions", "positions"):
            return key
    raise BackendError(f"this Mitsuba names mesh vertices in an unknown way: {list(parameters.keys())}")
