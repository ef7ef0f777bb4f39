"""Fréchet distance between sets of features, by normal distributions fitted to them.

Source: D. Dowson and B. Landau, J. Multivariate Analysis 12 (1982), 450; M. Heusel et al., NeurIPS 2017 (FID), where
the features are those of a network; here they are any.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from rfgen_sionna._types import FloatArray
from rfgen_sionna.evaluation.controlled_metric import ControlledMetric, with_controls


def compare_features(
    reference: ArrayLike, candidate: ArrayLike, controls: Mapping[str, ArrayLike], *, standardise: bool = True
) -> ControlledMetric:
    """Fréchet distance of features, with controls.

    Parameters
    ----------
    reference, candidate, controls
        Features (sample, feature), at least 2 samples each.
    standardise
        Whether features are divided by their standard deviation in the reference, where those that are constant are
        left out; the distance is then in standard deviations.

    Raises
    ------
    ValueError
        For other shapes or numbers of features, features that are not finite, or a reference without any that varies.
    """
    base = _features("reference", reference)
    scale = base.std(axis=0)
    used = scale > 0 if standardise else np.ones(base.shape[1], bool)
    if not used.any():
        raise ValueError("reference has constant features alone: a feature that varies is needed")
    divisor = scale[used] if standardise else 1.0

    def scaled(name: str, values: ArrayLike) -> FloatArray:
        array = _features(name, values)
        if array.shape[1] != base.shape[1]:
            raise ValueError(f"{name} has {array.shape[1]} features, the reference {base.shape[1]}")
        return np.asarray(array[:, used] / divisor)

    others = {name: scaled(f"control {name!r}", values) for name, values in controls.items()}
    return with_controls("frechet", frechet_distance, scaled("reference", base), scaled("candidate", candidate), others)


def frechet_distance(first: ArrayLike, second: ArrayLike) -> float:
    """Square root of |m1 - m2|² + tr(C1 + C2 - 2 (C1^½ C2 C1^½)^½) of two sets (sample, feature), in their unit.

    Fewer than 2 samples, other numbers of features, and features that are not finite are a ValueError.
    """
    a, b = _features("first", first), _features("second", second)
    if a.shape[1] != b.shape[1]:
        raise ValueError(f"samples have {a.shape[1]} and {b.shape[1]} features: as many are needed")
    one, two = np.atleast_2d(np.cov(a, rowvar=False)), np.atleast_2d(np.cov(b, rowvar=False))
    root = _root(one)
    cross = np.sqrt(np.maximum(np.linalg.eigvalsh(root @ two @ root), 0.0)).sum()
    square = np.sum((a.mean(axis=0) - b.mean(axis=0)) ** 2) + np.trace(one) + np.trace(two) - 2 * cross
    return float(np.sqrt(max(square, 0.0)))


def _root(matrix: FloatArray) -> FloatArray:
    """Symmetric square root of a covariance."""
    values, vectors = np.linalg.eigh(matrix)
    return np.asarray((vectors * np.sqrt(np.maximum(values, 0.0))) @ vectors.T)


def _features(name: str, values: ArrayLike) -> FloatArray:
    array = np.asarray(values, np.float64)
    if array.ndim != 2 or len(array) < 2 or not array.shape[1] or not np.all(np.isfinite(array)):
        raise ValueError(f"{name} has shape {array.shape}: at least 2 samples of finite features are needed")
    return array
