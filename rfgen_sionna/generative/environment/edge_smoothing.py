"""Edge-preserving smoothing of drawn images (Perona and Malik 1990).

Removes residual noise within surfaces. Energy and range are smoothed together, between neighbours of one surface by
both channels and by the layout map.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import FloatArray

_TURN, _STEP = 0.15, 0.1
"""Differences between neighbours of a layout map's cosines of incidence and of its ranges, in −1 … 1, that separate
surfaces."""


@dataclass(frozen=True)
class EdgePreservingSmoothing:
    """Options of the smoothing."""

    rounds: int = 0
    """Number of diffusion steps; 0 leaves images unchanged."""
    edge: tuple[float, float] = (0.06, 0.04)
    """Differences of energy and range between neighbours that count as an edge, in −1 … 1."""

    def __call__(self, images: NDArray[np.floating], layout_maps: NDArray[np.floating] | None = None) -> FloatArray:
        """(…, 3, row, column) smoothed channels in −1 … 1; empty pixels stay unchanged. `layout_maps` (…, CHANNELS,
        row, column) separate further surfaces; None uses the image alone."""
        x = np.array(images, dtype=np.float64)
        there = x[..., 2, :, :] > -2.0 / 3.0
        one = {
            axis: _pairs(there, axis) & (True if layout_maps is None else _alike(layout_maps, axis))
            for axis in (-2, -1)
        }
        values = x[..., :2, :, :]
        scale = np.array(self.edge)[:, None, None]
        for _ in range(self.rounds):
            change = np.zeros_like(values)
            for axis in (-2, -1):
                step = np.diff(values, axis=axis)
                weight = np.exp(-np.sum((step / scale) ** 2, axis=-3)) * one[axis]
                flow = 0.2 * weight[..., None, :, :] * step
                before, after = [(0, 0)] * values.ndim, [(0, 0)] * values.ndim
                before[axis], after[axis] = (1, 0), (0, 1)
                change += np.pad(flow, after) - np.pad(flow, before)
            values = values + change
        x[..., :2, :, :] = values
        return x


def _pairs(there: NDArray[np.bool_], axis: int) -> NDArray[np.bool_]:
    """Whether both of two neighbouring pixels have a return."""
    count = there.shape[axis]
    return np.asarray(np.take(there, range(count - 1), axis=axis) & np.take(there, range(1, count), axis=axis))


def _alike(layout_maps: NDArray[np.floating], axis: int) -> NDArray[np.bool_]:
    """Whether neighbouring pixels of layout maps are on one surface: same kind, same direction, no step."""
    reach, cosine, kind = (np.abs(np.diff(layout_maps[..., channel, :, :], axis=axis)) for channel in (0, 2, -1))
    return np.asarray((kind == 0) & (cosine < _TURN) & (reach < _STEP))
