"""How small facets have to be, and in how many parts they are integrated."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import SPEED_OF_LIGHT, FloatArray, IntArray
from rfgen_sionna.scene.mesh import lengths, max_component, triangle_centroids, unit
from rfgen_sionna.tracing.surface.quadratic_patch import QuadraticPatch

MAX_BULGE = 1.0
"""Phase bulge [rad] up to which an expansion to first order means anything."""
FACET_BULGE = 0.5
"""Phase bulge [rad] that a facet may have: those that need a smaller one are integrated in parts."""
STATIC_BULGE = 1.0
"""The same of what stays: nothing turns, and what shadows cut of facets is known whatever their size."""
PATTERN, STATIC_PATTERN = 0.5, 0.2
"""By how much, per unit of the tolerance, what the antennas make of a facet's points may differ from what its
middle and the rise there tell of them, relative to the largest: parts don't mend that, and facets alike repeat it. The
second is of what stays, smooth or not; the facets of bodies don't repeat it."""
_FINEST = 1e-4
"""Tolerance below which no facets are split for that: it goes with the square of their size, and what is made finer for
its phase takes parts."""
_LEAST_BULGE = 0.003
"""Phase bulge [rad] below which facets are not split for that either: patterns may have steps."""
_NONE = 1e-6
"""Gain that counts as none, relative to the largest."""
BAND_SWING = 4.0
"""Phase [rad] by which the band's ends turn the corners of a facet against each other, seen from its centre: it is then
two or three range cells deep at most, and a few coefficients follow its gain over the band."""
CURVED = 2.0
"""How much higher, as a phase, a smooth surface may rise over a part than a flat one's phase may bulge: it rises once,
where facets of a plate repeat their bulge."""
CUBIC = 0.03
"""Share of k L^3 / R^2 that the cubic phase over a facet of edge L comes to beside a quadratic one."""
SAGITTA_ERROR = 0.02
"""Share of k h L / R that the rest comes to where a facet of edge L bows by h, aslant."""
MAX_TERMINATOR_TURN = 2.0
"""Angle [rad] by which a smooth surface may turn over a facet in which it turns out of sight, per root of the phase
bulge allowed: its return ends there with a kink, that goes with the angle's square."""
MAX_PARTS = 8
"""Largest number of parts to an edge."""


def phase_bulge(corners: FloatArray, viewpoint: FloatArray, frequency: float) -> FloatArray:
    """(facet,) two-way phase [rad] by which the mean over the corners exceeds that at the centroid.

    It measures the quadratic phase on a facet: about k L^2 / (4 R) for an edge L at range R.
    """
    from_view = corners - viewpoint
    offset = corners - triangle_centroids(corners)[:, None]
    centre = triangle_centroids(from_view)[:, None]
    # |x| - |y| = (x - y) . (x + y) / (|x| + |y|), exact where a difference of norms cancels.
    sizes = lengths(from_view) + lengths(centre)
    excess = np.einsum("fci,fci->fc", offset, from_view + centre) / np.maximum(sizes, 1e-12)
    return np.asarray(
        np.abs(4 * np.pi * frequency / SPEED_OF_LIGHT * np.einsum("fc->f", excess) / 3.0), dtype=np.float64
    )


def allowed_bulge(rtol: float) -> float:
    """Largest phase bulge [rad] that keeps the relative error of a surface's return below `rtol`.

    The facet integral keeps the quadratic phase q to first order and its variance. In each grating lobe that a plate of
    facets alike adds up to it misses what else is of second order: for a bulge b (:func:`phase_bulge`) as much as that
    variance, 3 b^2 / 160 on an equilateral triangle, and more on the right triangles that bisection makes. Plates a
    hundred wavelengths wide err by up to 0.1 b^2, hence b = sqrt(10 rtol).
    """
    return float(min(np.sqrt(10.0 * rtol), MAX_BULGE))


@dataclass(frozen=True)
class SmoothPieces:
    """Pieces of a smooth surface."""

    height: FloatArray
    """(facet,) how high it is over each [m]."""
    weights: FloatArray
    """(facet, 3, 3) of each in its face."""
    sagittas: FloatArray | None
    """(facet, 3, 3) of its face [m]; None leaves out where it turns out of sight."""

    def ends(self, chosen: NDArray[np.bool_], corners: FloatArray, viewpoint: FloatArray) -> NDArray[np.bool_]:
        """Whether the `chosen` ones, with flat `corners` (chosen, 3, 3) [m], turn out of sight of the viewpoint."""
        if self.sagittas is None:
            return np.zeros(int(np.count_nonzero(chosen)), np.bool_)
        patch = QuadraticPatch(self.sagittas[chosen]).within(self.weights[chosen])
        places = corners - viewpoint if patch.corner_offsets is None else corners - viewpoint + patch.corner_offsets
        first, second = places[:, 1] - places[:, 0], places[:, 2] - places[:, 0]
        r = 4.0 * patch.sagittas
        # At each corner: the tangents along its two edges.
        tangents = (
            (first + r[:, 2], second + r[:, 1]),
            (first - r[:, 2], second + r[:, 0] - r[:, 2]),
            (first + r[:, 0] - r[:, 1], second - r[:, 1]),
        )
        found = np.stack(
            [
                np.einsum("fi,fi->f", np.cross(one, other), places[:, corner])
                for corner, (one, other) in enumerate(tangents)
            ]
        )
        return np.asarray((np.min(found, axis=0) < 0) & (np.max(found, axis=0) > 0))


def log_gain_excess(ends: FloatArray, middle: FloatArray) -> FloatArray:
    """(facet,) mean logarithm of the antennas' gains at the corners, `ends` (facet, 3), less that in the `middle`
    (facet,): the integral lets gains change by the same share per metre all over a facet, of which nothing is left in
    this. Over the facet the mean of what is left, quadratic as it is, is a quarter of it."""
    return np.asarray(np.log(np.maximum(ends, _NONE)).mean(axis=1) - np.log(np.maximum(middle, _NONE)))


def _gain_excess(ends: FloatArray, middle: FloatArray) -> FloatArray:
    """(facet,) the same as a gain, relative to the largest."""
    return np.asarray(np.maximum(middle, _NONE) * np.abs(np.expm1(log_gain_excess(ends, middle))))


def needs_finer_facets(
    corners: FloatArray,
    viewpoint: FloatArray,
    frequency: float,
    rtol: float,
    pattern_gain: Callable[[FloatArray], FloatArray],
) -> bool:
    """Whether flat facets with these `corners` (facet, 3, 3) [m] have moved to where the antennas' gain asks for such
    of a third of the area, which is no matter of distance; the others are arguments of :func:`tessellate`."""
    left = _gain_excess(
        pattern_gain(unit(corners - viewpoint)), pattern_gain(unit(triangle_centroids(corners) - viewpoint))
    )
    steep = np.flatnonzero(left > 3.0 * PATTERN * max(rtol, _FINEST))
    return bool((phase_bulge(corners[steep], viewpoint, frequency) > _LEAST_BULGE).any())


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
    """(facet,) whether each is too large, the number of parts that its edges are to be divided into if it is flat, and
    the number, not rounded, for how high the surface is over it.

    `patch` is how they bend, where they are of a smooth surface, and `still` is that it stays.
    """
    allowed = np.full(len(corners), allowed_bulge(rtol))
    bulge = phase_bulge(corners, viewpoint, frequency)
    coarse = np.zeros(len(corners), np.bool_)
    if pattern_gain is not None:
        # A facet counts as much as its most important corner: large ones reach into the beam.
        ends, middle = (
            pattern_gain(unit(corners - viewpoint)),
            pattern_gain(unit(triangle_centroids(corners) - viewpoint)),
        )
        weight = np.maximum(max_component(ends), middle)
        if patch is None or still:
            most = (STATIC_PATTERN if still else PATTERN) * max(rtol, _FINEST)
            coarse |= (_gain_excess(ends, middle) > most) & (bulge > _LEAST_BULGE)
        # There are more of them out of the beam than in it, and their errors add up: the root of what they could do.
        allowed = np.minimum(np.sqrt(10.0 * rtol / np.sqrt(np.maximum(weight, 1e-12))), MAX_BULGE)
    coarse |= bulge > np.clip(STATIC_BULGE if still else FACET_BULGE, allowed, MAX_PARTS**2 * allowed)
    if half_band > 0:
        away = lengths(corners - viewpoint)
        depth = max_component(away) + max_component(-away)  # half the spread of the paths
        coarse |= 2 * np.pi * half_band / SPEED_OF_LIGHT * depth > BAND_SWING
    height = np.zeros(len(corners))
    if patch is not None:
        height = 4 * np.pi * frequency / SPEED_OF_LIGHT * patch.height / CURVED
        coarse |= np.maximum(bulge, height) > MAX_PARTS**2 * allowed
        # The path length over a curved facet is taken for quadratic; u v^2 / R^2 and h u / R are what comes next.
        size = max_component(lengths(corners[:, [1, 2, 0]] - corners))
        share = size / np.maximum(lengths(triangle_centroids(corners) - viewpoint), 1e-3)
        cubic = 2 * np.pi * frequency / SPEED_OF_LIGHT * share * (CUBIC * size * share + SAGITTA_ERROR * patch.height)
        coarse |= cubic > 0.1 * allowed
        turns = (
            6.0 * patch.height > MAX_TERMINATOR_TURN * allowed * size
        )  # a circle's arc turns by 8 sagittas over its chord
        coarse[turns] |= patch.ends(turns, corners[turns], viewpoint)
    return coarse, np.maximum(np.ceil(np.sqrt(bulge / allowed)), 1.0).astype(np.int32), np.sqrt(height / allowed)
