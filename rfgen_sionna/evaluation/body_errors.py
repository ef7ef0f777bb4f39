"""Errors of estimated bodies: V, S, Q, T and G of mmMesh and RF Genesis.

Sources: H. Xue et al., "mmMesh", MobiSys 2021, section 6 (V, S, Q, T, G); X. Chen and X. Zhang, "RF Genesis", SenSys
2023, table 2. V, S and T are mean Euclidean distances of vertices, of joints and of the root; Q is the mean angle of
the rotation between true and estimated joint rotations; G the share of right genders.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rfgen_sionna._types import FloatArray
from rfgen_sionna.evaluation.controlled_metric import ControlledMetric, with_controls

_ORTHOGONAL = 1e-3
"""Largest difference of a rotation matrix times its transpose from 1."""


@dataclass(frozen=True)
class BodyEstimates:
    """Bodies of several frames, true or estimated; what is None is not compared."""

    vertices: FloatArray | None = None
    """(frame, vertex, 3) [m]"""
    joints: FloatArray | None = None
    """(frame, joint, 3) [m]"""
    rotations: FloatArray | None = None
    """(frame, joint, 3, 3) rotation matrices of the joints."""
    root: FloatArray | None = None
    """(frame, 3) translation of the root [m]."""
    gender: NDArray[np.generic] | None = None
    """(frame,) class of each frame's body."""


def compare_bodies(
    reference: BodyEstimates, candidate: BodyEstimates, controls: Mapping[str, BodyEstimates]
) -> dict[str, ControlledMetric]:
    """ "V", "S", "T" [m], "Q" [degrees] and "G" (0 … 1) of what the reference and all others have.

    Raises
    ------
    ValueError
        If a part that the reference has is missing or of another shape elsewhere, or if there is none.
    """
    results = {}
    for name, part, metric, unit in (
        ("V", "vertices", mean_distance, "m"),
        ("S", "joints", mean_distance, "m"),
        ("Q", "rotations", mean_rotation_angle, "degrees"),
        ("T", "root", mean_distance, "m"),
        ("G", "gender", accuracy, ""),
    ):
        first = getattr(reference, part)
        if first is None:
            continue
        others = {label: getattr(item, part) for label, item in {"candidate": candidate, **controls}.items()}
        for label, values in others.items():
            if np.shape(values) != np.shape(first):
                raise ValueError(
                    f"{part} of {label} has shape {np.shape(values)}, the reference {np.shape(first)}: the same body "
                    "model and as many frames are needed"
                )
        second = others.pop("candidate")
        results[name] = with_controls(name, metric, first, second, others, unit=unit, higher_is_better=name == "G")
    if not results:
        raise ValueError("reference has none of vertices, joints, rotations, root, gender")
    return results


def mean_distance(first: ArrayLike, second: ArrayLike) -> float:
    """Mean Euclidean distance of points (..., 3), in their unit; other shapes are a ValueError."""
    a, b = _alike("points", first, second, (3,))
    return float(np.linalg.norm(a - b, axis=-1).mean())


def mean_rotation_angle(first: ArrayLike, second: ArrayLike) -> float:
    """Mean angle between rotation matrices (..., 3, 3) [degrees]; other matrices or shapes are a ValueError."""
    a, b = _alike("rotations", first, second, (3, 3))
    for matrix in (a, b):
        error = np.abs(matrix @ np.swapaxes(matrix, -1, -2) - np.eye(3)).max()
        if not error < _ORTHOGONAL:
            raise ValueError(
                f"matrices times their transposes differ from 1 by {error:.3g}: rotation matrices are needed"
            )
    # |A - B| = 2 sqrt(2) sin(angle / 2), which is exact for small angles, too
    chord = np.linalg.norm(a - b, axis=(-2, -1)) / (2 * np.sqrt(2))
    return float(np.degrees(2 * np.arcsin(np.minimum(chord, 1.0))).mean())


def accuracy(first: ArrayLike, second: ArrayLike) -> float:
    """Share of equal classes (...); different shapes are a ValueError."""
    a, b = np.asarray(first), np.asarray(second)
    if a.shape != b.shape or not a.size:
        raise ValueError(f"classes have shapes {a.shape} and {b.shape}: one shape is needed")
    return float(np.mean(a == b))


def _alike(name: str, first: ArrayLike, second: ArrayLike, last: tuple[int, ...]) -> tuple[FloatArray, FloatArray]:
    """Both as arrays of one shape that ends with `last`."""
    a, b = np.asarray(first, np.float64), np.asarray(second, np.float64)
    if a.shape != b.shape or a.shape[-len(last) :] != last or not a.size:
        wanted = ", ".join(("...", *map(str, last)))
        raise ValueError(f"{name} have shapes {a.shape} and {b.shape}: one shape ({wanted}) is needed")
    return a, b
