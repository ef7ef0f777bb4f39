"""Specular points on two surface patches: Newton's method on Dr.Jit's float64 arrays (LLVM or CUDA)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import FloatArray
from rfgen_sionna.scene.kernels import drjit_types, upload
from rfgen_sionna.tracing.curved.newton_step import NEWTON_STEP
from rfgen_sionna.tracing.curved.smoothed_surface import SmoothedSurface

NEWTON_STEPS = 10
"""Most steps: convergence is quadratic, and slow pairs near a fold get a few more."""
CONVERGED = 1e-7
"""Miss at which the iteration ends [rad]."""
MAX_MISS = 1e-3
"""Largest miss of a specular point [rad]."""
MAX_STEP_OVERSHOOT = (4.0, 2.0, 1.0)
"""Most overshoot beyond a patch after the first, the second, and later steps, in its barycentric coordinates; points
farther out belong to another pair."""
MAX_FACE_OVERSHOOT = 0.2
"""Most final overshoot beyond a face, in its coordinates: curvature jumps between faces, and a point near an edge may
be on neither of them."""


class SpecularPoints(NamedTuple):
    """Specular points on pairs of patches."""

    pair: NDArray[np.intp]
    """(point,) pair of each."""
    weights: FloatArray
    """(point, 2, 3) barycentric coordinates on both faces."""
    miss: FloatArray
    """(point,) miss of the ray [rad]."""
    overshoot: FloatArray
    """(point,) overshoot beyond the face in its coordinates, the larger of both; negative inside."""


def find_specular_points(
    surface_model: SmoothedSurface,
    source: FloatArray,
    facet: tuple[NDArray[np.int64], NDArray[np.int64]],
    weights: tuple[FloatArray, FloatArray],
) -> SpecularPoints:
    """Specular points of paths from and to the `source` (3,) [m], on pairs of patches: of faces `facet` (pair,), with
    corners at barycentric coordinates `weights` (pair, corner, vertex)."""
    count = len(facet[0])
    alive, at = np.arange(count), np.full((count, 4), 1 / 3)
    found, misses = at.copy(), np.full(count, np.inf)
    # Only faces in use are uploaded.
    used, number = np.unique(np.concatenate(facet), return_inverse=True)
    number = number.reshape(2, count)
    figures = np.concatenate(
        [surface_model.corners[used] - source, surface_model.sagittas[used], surface_model.normals[used]],
        axis=1,
        dtype=np.float64,
    ).reshape(len(used), 27)
    ends = np.stack([each[:, :, 1:].reshape(count, 6) for each in weights], axis=1)
    for step in range(NEWTON_STEPS):
        if len(alive) == 0:
            break
        moved, miss = _newton_step(figures, number[:, alive], ends[alive], at[alive])
        better = miss < misses[alive]
        misses[alive[better]], found[alive[better]] = miss[better], at[alive[better]]
        at[alive] = moved
        most = MAX_STEP_OVERSHOOT[min(step, len(MAX_STEP_OVERSHOOT) - 1)]
        alive = alive[(miss > CONVERGED) & (_overshoot(moved) < most)]
    lane = np.flatnonzero(misses < MAX_MISS)
    local = found[lane].reshape(-1, 2, 2)
    local = np.concatenate([1.0 - local.sum(axis=2, keepdims=True), local], axis=2)
    placed = np.einsum("psc,pscv->psv", local, np.stack([each[lane] for each in weights], axis=1))
    overshoot = -placed.min(axis=(1, 2), initial=np.inf)
    kept = np.flatnonzero(overshoot < MAX_FACE_OVERSHOOT)
    return SpecularPoints(lane[kept], placed[kept], misses[lane[kept]], overshoot[kept])


def _overshoot(at: FloatArray) -> FloatArray:
    """(pair,) overshoot of the points `at` (pair, 4), the larger of both."""
    one, other = at[:, :2], at[:, 2:]
    return np.asarray(-np.minimum.reduce([
        one.min(axis=1, initial=np.inf), 1.0 - one.sum(axis=1),
        other.min(axis=1, initial=np.inf), 1.0 - other.sum(axis=1),
    ]))  # fmt: skip


def _newton_step(
    figures: FloatArray, number: NDArray[np.intp], ends: FloatArray, at: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """(pair, 4) coordinates after one Newton step from `at` (pair, 4), and the miss there (pair,) [rad]."""
    dr, types = drjit_types()
    count = len(at)
    moved, miss = dr.empty(types.Float64, 4 * count), dr.empty(types.Float64, count)
    given = {
        "lanes": dr.arange(types.UInt32, count), "faces": [upload(types.UInt32, each) for each in number],
        "figures": upload(types.Float64, figures), "ends": upload(types.Float64, ends), "at": upload(types.Float64, at),
        "moved": moved, "miss": miss,
    }  # fmt: skip
    NEWTON_STEP(given)
    return np.asarray(moved.numpy()).reshape(count, 4), np.asarray(miss.numpy())
