"""Free space of a scene that is a room, as boxes."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from rfgen_sionna._types import FloatArray
from rfgen_sionna.scene.scene_errors import SceneError


@dataclass(frozen=True)
class Interior:
    """Free space of a scene that is a room: a union of boxes, with low and high corners (box, 3) [m]."""

    low: FloatArray
    high: FloatArray

    def contains(self, point: ArrayLike) -> bool:
        """Whether a point (3,) [m] lies in one of the boxes."""
        place = np.asarray(point, np.float64)
        return bool(((place >= self.low) & (place <= self.high)).all(axis=1).any())

    def __str__(self) -> str:
        return " or ".join(
            ", ".join(f"{axis} {a:g} … {b:g}" for axis, a, b in zip("xyz", low, high, strict=True))
            for low, high in zip(self.low.tolist(), self.high.tolist(), strict=True)
        )


def read_interior(path: Path) -> Interior:
    """The interior of a scene from a TOML file: tables `[[interior]]` with `low` and `high` corners [m].

    Raises
    ------
    SceneError
        The file holds anything else, or a box without volume.
    """
    wanted = "tables [[interior]] with low = [x, y, z] and high = [x, y, z], low below high, and nothing else"
    try:
        held = tomllib.loads(path.read_text(encoding="utf-8"))
        if set(held) != {"interior"} or any(set(box) != {"low", "high"} for box in held["interior"]):
            raise ValueError(f"it has {', '.join(held)}")
        low, high = (np.array([box[end] for box in held["interior"]], np.float64) for end in ("low", "high"))
        if low.shape[1:] != (3,) or high.shape != low.shape or not (low < high).all():
            raise ValueError(f"low is {low.tolist()} and high {high.tolist()}")
    except (ValueError, TypeError) as error:  # those of TOML and Unicode are ValueErrors too
        raise SceneError(f"scene description {path.name!r}: {error}; allowed are {wanted}") from error
    return Interior(low, high)
