"""Bounds of the returns of facets from their slopes, before integration.

A body returns most where its surface is specular for the radar; most of its facets are oblique. The weakest are omitted
as long as the energy of their bounds is negligible.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from rfgen_sionna._types import FloatArray, IntArray


@njit(cache=True, nogil=True, error_model="numpy")
def bound_returns(
    points: Any, corners: Any, faces: Any, group: Any, normals: Any, face_of: Any, chosen: Any, visible: Any, gain: Any,
    wavenumber: float, tx: Any, rx: Any, bounds: Any,
) -> None:  # fmt: skip
    """Raise `bounds` (chosen,) to the largest return of each of the `chosen` facets [1/m^2 of area over distance
    squared].

    With phases d = k times the differences of the corners' distances from `tx` and `rx` (3,) [m] together, the mean
    phasor of a triangle is at most 2 / (the largest d times the second largest), and 1. Edges of smooth facets bend:
    their slopes reach four sagittas more. `points` (vertex, 3) and `corners` (facet, 3) are those of flat facets, the
    others those of :func:`rfgen_sionna.tracing.integral.patch_gains.patch_gains`; `gain` (chosen,) is the pattern gain,
    `wavenumber` is in rad/m.
    """
    for q in range(chosen.shape[0]):
        if visible[q] <= 0.0:
            continue
        f = chosen[q]
        a, b, c = corners[f, 0], corners[f, 1], corners[f, 2]
        mx = points[a, 0] + points[b, 0] + points[c, 0]
        my = points[a, 1] + points[b, 1] + points[c, 1]
        mz = points[a, 2] + points[b, 2] + points[c, 2]
        # Mean of the directions from both.
        tx_x, tx_y, tx_z = mx - 3.0 * tx[0], my - 3.0 * tx[1], mz - 3.0 * tx[2]
        rx_x, rx_y, rx_z = mx - 3.0 * rx[0], my - 3.0 * rx[1], mz - 3.0 * rx[2]
        from_tx = 1.0 / max(np.sqrt(tx_x * tx_x + tx_y * tx_y + tx_z * tx_z), 1e-12)
        from_rx = 1.0 / max(np.sqrt(rx_x * rx_x + rx_y * rx_y + rx_z * rx_z), 1e-12)
        ux, uy, uz = (
            0.5 * (tx_x * from_tx + rx_x * from_rx), 0.5 * (tx_y * from_tx + rx_y * from_rx),
            0.5 * (tx_z * from_tx + rx_z * from_rx),
        )  # fmt: skip
        px, py, pz = points[b, 0] - points[a, 0], points[b, 1] - points[a, 1], points[b, 2] - points[a, 2]
        qx, qy, qz = points[c, 0] - points[a, 0], points[c, 1] - points[a, 1], points[c, 2] - points[a, 2]
        area = abs((py * qz - pz * qy) * ux + (pz * qx - px * qz) * uy + (px * qy - py * qx) * uz)
        d1, d2 = abs(px * ux + py * uy + pz * uz), abs(qx * ux + qy * uy + qz * uz)
        d3 = abs((px - qx) * ux + (py - qy) * uy + (pz - qz) * uz)
        face = face_of[f]
        bend, turn = 0.0, 0.0
        if group[face, 0] >= 0:
            for e in range(3):
                i, j = faces[face, (e + 1) % 3], faces[face, (e + 2) % 3]
                g, h = group[face, (e + 1) % 3], group[face, (e + 2) % 3]
                nx, ny, nz = normals[h, 0] - normals[g, 0], normals[h, 1] - normals[g, 1], normals[h, 2] - normals[g, 2]
                x, y, z = points[j, 0] - points[i, 0], points[j, 1] - points[i, 1], points[j, 2] - points[i, 2]
                bend = max(bend, abs(nx * x + ny * y + nz * z))
                turn = max(turn, nx * nx + ny * ny + nz * nz)
            if turn > 0.0:  # a facet that turns shows more of its area
                whole = np.sqrt((py * qz - pz * qy) ** 2 + (pz * qx - px * qz) ** 2 + (px * qy - py * qx) ** 2)
                area = min(area + 0.5 * np.sqrt(turn) * whole, whole)
        most = max(2.0 * wavenumber * (max(d1, d2, d3) - 0.5 * bend), 0.0)
        least = max(2.0 * wavenumber * (min(d1, d2, d3) - 0.5 * bend), 0.0)
        mean = min(1.0, 2.0 / max(most * max(least, 2.0), 2.0))
        bounds[q] = max(bounds[q], visible[q] * gain[q] * area * 9.0 * from_tx * from_rx * mean)


def significant(bounds: FloatArray, surface: IntArray, count: int, omitted: float) -> NDArray[np.intp]:
    """Indices, ascending, of all but the weakest facets of each of `count` surfaces, by `bounds` (facet,); the energy
    of the omitted bounds is at most the share `omitted` of all."""
    energy = bounds**2
    total = np.bincount(surface, energy, count)
    order = np.lexsort((energy, surface))
    running = np.cumsum(energy[order])
    first = np.concatenate([[0.0], np.cumsum(total)[:-1]])
    weak = running - first[surface[order]] <= omitted * total[surface[order]]
    kept = order[~weak]
    return np.sort(kept[energy[kept] > 0])
