"""Largest allowed facets, and the number of parts of their integrals."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import SPEED_OF_LIGHT, FloatArray, IntArray
from rfgen_sionna.scene.mesh import lengths, max_component, triangle_centroids, unit
from rfgen_sionna.tracing.surface.quadratic_patch import QuadraticPatch

MAX_BULGE = 1.0
"""Largest phase bulge [rad] for which an expansion to first order holds."""
FACET_BULGE = 0.5
"""Largest phase bulge [rad] of a facet; smaller ones are integrals in parts."""
STATIC_BULGE = 1.0
"""The same for static facets: shadows on them are exact at any size."""
PATTERN_CHANGE, STATIC_PATTERN_CHANGE = 0.5, 0.2
"""Largest error per tolerance of an exponential pattern gain over a facet; the second for static facets."""
_MIN_TOLERANCE = 1e-4
"""Tolerance below which the pattern splits no facets: its error goes with the square of their size."""
_MIN_BULGE = 0.003
"""Phase bulge [rad] below which the pattern splits no facets: patterns may have steps."""
_MIN_GAIN = 1e-6
"""Least pattern gain relative to the peak, -60 dB."""
BAND_SWING = 4.0
"""Phase [rad] of a facet's corners from mid-band to its end: two or three range cells, for few coefficients."""
MAX_HEIGHT = 2.0
"""Height of a smooth surface over a part, as a phase, over the allowed bulge: plates repeat bulges, heights do not."""
CUBIC_PHASE = 0.03
"""Cubic phase over a facet of edge L at range R, in k L^3 / R^2."""
SAGITTA_ERROR = 0.02
"""Phase error of a facet of edge L and sagitta h at oblique incidence, in k h L / R."""
MAX_TERMINATOR_TURN = 2.0
"""Turn [rad] of a smooth facet at the terminator per root of the allowed bulge: the kink there is of order turn^2."""
MAX_PARTS = 8
"""Largest number of parts per edge."""


def phase_bulge(corners: FloatArray, viewpoint: FloatArray, frequency: float) -> FloatArray:
    """(facet,) two-way phase [rad] of the mean over the corners less that at the centroid, about k L^2 / (4 R) for an
    edge L at range R. `corners` (facet, 3, 3) and `viewpoint` (3,) in m, `frequency` in Hz."""
    from_view = corners - viewpoint
    offset = corners - triangle_centroids(corners)[:, None]
    centre = triangle_centroids(from_view)[:, None]
    # |x| - |y| = (x - y) . (x + y) / (|x| + |y|), without cancellation.
    sizes = lengths(from_view) + lengths(centre)
    excess = np.einsum("fci,fci->fc", offset, from_view + centre) / np.maximum(sizes, 1e-12)
    return np.asarray(
        np.abs(4 * np.pi * frequency / SPEED_OF_LIGHT * np.einsum("fc->f", excess) / 3.0), dtype=np.float64
    )


def allowed_bulge(rtol: float) -> float:
    """Largest phase bulge [rad] for a relative error `rtol` of a surface's return. For a bulge b (:func:`phase_bulge`)
    the facet integral misses in each grating lobe about the variance of the quadratic phase, 3 b^2 / 160 on an
    equilateral triangle and more on right ones. A plate errs by up to 0.1 b^2: b = sqrt(10 rtol)."""
    return float(min(np.sqrt(10.0 * rtol), MAX_BULGE))


@dataclass(frozen=True)
class SmoothPieces:
    """Pieces of a smooth surface."""

    height: FloatArray
    """(facet,) height of the surface over the piece [m]."""
    weights: FloatArray
    """(facet, 3, 3) barycentric coordinates of the piece in its face."""
    sagittas: FloatArray
    """(facet, 3, 3) sagittas of the face [m]."""

    def ends(self, chosen: NDArray[np.bool_], corners: FloatArray, viewpoint: FloatArray) -> NDArray[np.bool_]:
        """(chosen,) whether the terminator crosses the `chosen` facets, with flat `corners` (chosen, 3, 3) [m]."""
        patch = QuadraticPatch(self.sagittas[chosen]).within(self.weights[chosen])
        places = corners - viewpoint if patch.corner_offsets is None else corners - viewpoint + patch.corner_offsets
        first, second = places[:, 1] - places[:, 0], places[:, 2] - places[:, 0]
        r = 4.0 * patch.sagittas
        tangents = (
            (first + r[:, 2], second + r[:, 1]),
            (first - r[:, 2], second + r[:, 0] - r[:, 2]),
            (first + r[:, 0] - r[:, 1], second - r[:, 1]),
        )  # along the two edges of each corner
        volumes = (np.einsum("fi,fi->f", np.cross(*each), places[:, k]) for k, each in enumerate(tangents))
        found = np.stack(list(volumes))
        return np.asarray((np.min(found, axis=0) < 0) & (np.max(found, axis=0) > 0))


def log_gain_excess(ends: FloatArray, middle: FloatArray) -> FloatArray:
    """(facet,) mean logarithm of the pattern gains at the corners, `ends` (facet, 3), less that in the `middle`
    (facet,). It vanishes for an exponential gain, as the integral has it; its mean over the facet is a quarter of
    it."""
    return np.asarray(np.log(np.maximum(ends, _MIN_GAIN)).mean(axis=1) - np.log(np.maximum(middle, _MIN_GAIN)))


def _gain_excess(ends: FloatArray, middle: FloatArray) -> FloatArray:
    """(facet,) the same as a gain relative to the peak."""
    return np.asarray(np.maximum(middle, _MIN_GAIN) * np.abs(np.expm1(log_gain_excess(ends, middle))))


def _pattern_gains(
    corners: FloatArray, viewpoint: FloatArray, pattern_gain: Callable[[FloatArray], FloatArray]
) -> tuple[FloatArray, FloatArray]:
    """Pattern gains at the corners (facet, 3) and in the middle (facet,)."""
    return pattern_gain(unit(corners - viewpoint)), pattern_gain(unit(triangle_centroids(corners) - viewpoint))


def required_splits(
    corners: FloatArray,
    viewpoint: FloatArray,
    frequency: float,
    rtol: float,
    pattern_gain: Callable[[FloatArray], FloatArray] | None,
    half_band: float,
    patch: SmoothPieces | None = None,
    still: bool = False,
) -> tuple[NDArray[np.bool_], IntArray, FloatArray]:
    """(facet,) whether each facet is too large, parts per edge if it is flat, and parts for the surface's height, not
    rounded. `patch` are the pieces of a smooth surface, None means flat facets; `still` marks static surfaces. The
    other arguments are those of :func:`rfgen_sionna.tracing.surface.tessellate.tessellate`."""
    allowed = np.full(len(corners), allowed_bulge(rtol))
    bulge = phase_bulge(corners, viewpoint, frequency)
    coarse = np.zeros(len(corners), np.bool_)
    if pattern_gain is not None:
        ends, middle = _pattern_gains(corners, viewpoint, pattern_gain)
        weight = np.maximum(max_component(ends), middle)
        if patch is None or still:
            most = (STATIC_PATTERN_CHANGE if still else PATTERN_CHANGE) * max(rtol, _MIN_TOLERANCE)
            coarse |= (_gain_excess(ends, middle) > most) & (bulge > _MIN_BULGE)
        # The root of the gain: more facets lie outside the beam, and their errors add up.
        allowed = np.minimum(np.sqrt(10.0 * rtol / np.sqrt(np.maximum(weight, 1e-12))), MAX_BULGE)
    coarse |= bulge > np.clip(STATIC_BULGE if still else FACET_BULGE, allowed, MAX_PARTS**2 * allowed)
    if half_band > 0:
        away = lengths(corners - viewpoint)
        depth = max_component(away) + max_component(-away)  # half the range of the paths
        coarse |= 2 * np.pi * half_band / SPEED_OF_LIGHT * depth > BAND_SWING
    height = np.zeros(len(corners))
    if patch is not None:
        height = 4 * np.pi * frequency / SPEED_OF_LIGHT * patch.height / MAX_HEIGHT
        coarse |= np.maximum(bulge, height) > MAX_PARTS**2 * allowed
        # Orders after the quadratic path: u v^2 / R^2 and h u / R.
        size = max_component(lengths(corners[:, [1, 2, 0]] - corners))
        share = size / np.maximum(lengths(triangle_centroids(corners) - viewpoint), 1e-3)
        cubic = (
            2 * np.pi * frequency / SPEED_OF_LIGHT * share * (CUBIC_PHASE * size * share + SAGITTA_ERROR * patch.height)
        )
        coarse |= cubic > 0.1 * allowed
        # An arc turns by 8 sagittas over its chord.
        turns = 6.0 * patch.height > MAX_TERMINATOR_TURN * allowed * size
        coarse[turns] |= patch.ends(turns, corners[turns], viewpoint)
    return coarse, np.maximum(np.ceil(np.sqrt(bulge / allowed)), 1.0).astype(np.int32), np.sqrt(height / allowed)
