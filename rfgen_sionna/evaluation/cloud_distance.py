"""Distances between point clouds: Hausdorff and Chamfer distance.

Sources: F. Hausdorff, "Grundzüge der Mengenlehre" (1914); H. Fan, H. Su and L. Guibas, CVPR 2017 (Chamfer distance),
here with distances, not their squares.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial import cKDTree

from rfgen_sionna._types import FloatArray
from rfgen_sionna.evaluation.controlled_metric import ControlledMetric, with_controls


def compare_clouds(
    reference: Sequence[ArrayLike], candidate: Sequence[ArrayLike], controls: Mapping[str, Sequence[ArrayLike]]
) -> dict[str, ControlledMetric]:
    """Mean "hausdorff" and "chamfer" distance [m] over frames, and "missing", the share of frames in which one cloud
    alone is empty, which have no distance.

    Parameters
    ----------
    reference, candidate, controls
        One cloud (point, 3) a frame, the same number of frames.

    Raises
    ------
    ValueError
        For different numbers of frames, or if no frame has points in both.
    """
    for name, clouds in {"candidate": candidate, **controls}.items():
        if len(clouds) != len(reference):
            raise ValueError(f"{name} has {len(clouds)} frames, the reference {len(reference)}: as many are needed")
    return {
        name: with_controls(name, metric, reference, candidate, controls, unit=unit)
        for name, metric, unit in (
            ("hausdorff", lambda a, b: _mean(a, b, hausdorff_distance), "m"),
            ("chamfer", lambda a, b: _mean(a, b, chamfer_distance), "m"),
            ("missing", _missing, ""),
        )
    }


def hausdorff_distance(first: ArrayLike, second: ArrayLike) -> float:
    """Largest distance of a point of either cloud (point, 3) from the nearest of the other [m].

    A cloud without points, or with some that are not finite, is a ValueError.
    """
    there, back = _nearest(first, second)
    return float(max(there.max(), back.max()))


def chamfer_distance(first: ArrayLike, second: ArrayLike) -> float:
    """Mean distance of the points of each cloud (point, 3) from the nearest of the other, mean of both ways [m].

    A cloud without points, or with some that are not finite, is a ValueError.
    """
    there, back = _nearest(first, second)
    return float((there.mean() + back.mean()) / 2)


def _nearest(first: ArrayLike, second: ArrayLike) -> tuple[FloatArray, FloatArray]:
    a, b = _cloud("first", first), _cloud("second", second)
    if a.shape[1] != b.shape[1]:
        raise ValueError(f"points have {a.shape[1]} and {b.shape[1]} coordinates: as many are needed")
    return np.asarray(cKDTree(b).query(a)[0]), np.asarray(cKDTree(a).query(b)[0])


def _cloud(name: str, points: ArrayLike) -> FloatArray:
    array = np.asarray(points, np.float64)
    if array.ndim != 2 or len(array) == 0 or not np.all(np.isfinite(array)):
        raise ValueError(f"{name} has shape {array.shape}: at least one finite point (point, axis) is needed")
    return array


def _mean(
    first: Sequence[ArrayLike], second: Sequence[ArrayLike], distance: Callable[[ArrayLike, ArrayLike], float]
) -> float:
    both = [(a, b) for a, b in zip(first, second, strict=True) if len(np.asarray(a)) and len(np.asarray(b))]
    if not both:
        raise ValueError("no frame has points in both clouds: there is no distance")
    return float(np.mean([distance(a, b) for a, b in both]))


def _missing(first: Sequence[ArrayLike], second: Sequence[ArrayLike]) -> float:
    alone = [bool(len(np.asarray(a))) != bool(len(np.asarray(b))) for a, b in zip(first, second, strict=True)]
    return float(np.mean(alone))
