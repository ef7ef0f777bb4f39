"""Errors and warnings of scenes."""

from __future__ import annotations


class SceneError(ValueError):
    """A scene is not found, cannot be read, or does not fit its radar."""


class PlacementError(SceneError):
    """A radar, a person or a thing cannot be where it is asked to be: in a wall, hidden, or out of range."""


class SceneFileNotFoundError(SceneError, FileNotFoundError):
    """There is no scene file of the given path."""


class MeshError(ValueError):
    """A mesh is not a usable surface of triangles."""


class MaterialError(ValueError):
    """A material is unknown, or not defined at a frequency."""


class MaterialRangeWarning(UserWarning):
    """A material is used at a frequency outside the range of its source."""


class CoarseMeshWarning(UserWarning):
    """The faces of a mesh are too large for the smooth surface that they sample."""


class BackendError(RuntimeError):
    """The ray-tracing back end (Mitsuba, Dr.Jit and, on the CPU, LLVM) cannot run."""
