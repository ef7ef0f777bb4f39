"""A Mitsuba scene of one mesh whose vertices can move.

Needs a Mitsuba variant: call :func:`rfgen_sionna.scene.mitsuba_backend.ensure_backend` first.
"""

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
    """One Mitsuba scene with a single mesh made of several objects."""

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
        """Parameters of the scene; most scenes never move."""
        import mitsuba as mi

        return mi.traverse(self.scene)

    def move(self, vertices: FloatArray) -> None:
        self.vertices = vertices
        with _ONE_THREAD.held():
            self._parameters[_position_key(self._parameters)] = self._shifted()
            self._parameters.update()

    def _shifted(self) -> Any:
        import mitsuba as mi

        return upload(mi.Float, self.vertices - self._origin)


@cache
def _start() -> None:
    """Let Embree start as many threads as Dr.Jit has: it does with its first scene, and where there is but one then all
    trees take twice as long."""
    import mitsuba as mi

    mi.load_dict({"type": "scene", "mesh": {"type": "rectangle"}})


def one_scene_per_kernel() -> bool:
    """Whether a kernel can ask but one scene: OptiX has one table of shaders for each, and rays through a second scene
    hit nothing, of which no more is heard than a line on the terminal."""
    import drjit as dr
    import mitsuba as mi

    return bool(dr.backend_v(mi.Float) == dr.JitBackend.CUDA)


def evaluate_hits(*found: Any) -> None:
    """Compute what rays have `found` in one scene, where the kernel that asks the next can't."""
    import drjit as dr

    if one_scene_per_kernel():
        dr.eval(*found)


def loop_mode(scenes: int) -> Literal["evaluated", "symbolic"]:
    """Mode of a Dr.Jit loop whose steps trace so many scenes: symbolic (one kernel) where possible."""
    return "evaluated" if scenes > 1 and one_scene_per_kernel() else "symbolic"


def _one_thread() -> Callable[[], None]:
    """Leave Dr.Jit on the CPU, and Embree with it, one thread, in all of the process; returns what gives the others
    back."""
    import drjit as dr
    import mitsuba as mi

    threads = dr.thread_count()
    if threads < 2 or dr.backend_v(mi.Float) != dr.JitBackend.LLVM:
        return lambda: None
    dr.set_thread_count(1)
    return lambda: dr.set_thread_count(threads)


_ONE_THREAD = ThreadLimit(_one_thread)
"""Embree builds the tree of what moves with one thread, however large it is, and takes up to twice as long (on two
cores) where another waits to help."""


def _position_key(parameters: Any) -> str:
    # Mitsuba 3.9 says vertex_positions; later ones are expected to rename it.
    for key in map(str, parameters.keys()):
        if key.split(".")[-1] in ("vertex_positions", "positions"):
            return key
    raise BackendError(f"this Mitsuba names mesh vertices in an unknown way: {list(parameters.keys())}")
