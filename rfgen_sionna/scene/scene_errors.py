"""Errors and warnings of scenes."""

from __future__ import annotations


class SceneError(ValueError):
    """A scene cannot be found or read, or does not fit the radar that is put into it."""


class MeshError(ValueError):
    """A mesh is not a usable surface of triangles."""


class MaterialError(ValueError):
    """A material is unknown, or not defined where it is asked for."""


class MaterialRangeWarning(UserWarning):
    """A material is used outside the frequencies that its source covers."""


class CoarseMeshWarning(UserWarning):
    """The facets of a mesh are too large for the smooth surface that they describe."""


class BackendError(RuntimeError):
    """The ray tracing back end (Mitsuba, Dr.Jit and, on the CPU, LLVM) cannot run here."""
