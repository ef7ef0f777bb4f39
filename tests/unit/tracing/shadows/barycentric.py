"""Lattices of points on a triangle."""

from __future__ import annotations

import numpy as np

from rfgen_sionna._types import FloatArray


def barycentric_lattice(n: int) -> FloatArray:
    """(n^2, 3) barycentric centroids of the n^2 equal subtriangles."""
    upright = [(i + 1 / 3, j + 1 / 3) for i in range(n) for j in range(n - i)]
    inverted = [(i + 2 / 3, j + 2 / 3) for i in range(n) for j in range(n - i - 1)]
    u = np.array(upright + inverted) / n
    return np.column_stack([u, 1 - u.sum(axis=1)])
