"""The error of unusable clips."""

from __future__ import annotations


class ClipError(ValueError):
    """A motion or mesh file is unusable."""
