"""Shadow boundaries of reflectors' outlines, their targets, and the field across them, for
:mod:`~rfgen_sionna.tracing.reflectors.edge_diffraction`.

Behind a straight edge the field of geometrical optics, H(v) = 1 for v > 0, is F(v) = 1/2 + (1 + j)/2 (C(v) - j S(v))
with Fresnel's integrals; v is the distance from the shadow boundary in units in which the detour by the edge is v^2
lambda / 4. Physical optics integrates F - H times a phase of slope q per unit of v: 0 for q = 0, else (exp(j q^2 / 2
pi) - 1) / (j q), the difference of a wave by the edge and one straight past it. A surface that ends near the boundary
has a part of that.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import ComplexArray, FloatArray
from rfgen_sionna.tracing.reflectors.clipped_footprints import DIRECT, ClippedFootprints
from rfgen_sionna.tracing.reflectors.planar_reflectors import PlanarReflector
from rfgen_sionna.tracing.reflectors.shadow_targets import ImageSource

ON_EDGE = 1e-6
"""Distance below which a point is on an edge or plane [m]."""


DIRECT_SOURCE = ImageSource(
    np.zeros(3), np.zeros(3), np.zeros((0, 3)), np.zeros(0), np.zeros((0, 2, 3)), np.zeros(0, np.intp), None
)


def image_sources(reflector: PlanarReflector | None, view: FloatArray) -> list[ImageSource]:
    """One for each window; none without a reflector."""
    if reflector is None:
        return []
    image = -2.0 * float(reflector.height(view)) * reflector.normal
    edges = [np.stack([each, np.roll(each, -1, axis=0)], axis=1) - view for each in reflector.windows]
    # Edges between two windows are in both.
    places = np.rint(np.concatenate(edges).sum(axis=1) / (2 * ON_EDGE)).astype(np.int64)
    _, same, count = np.unique(places, axis=0, return_inverse=True, return_counts=True)
    seam, found, begin = count[same.reshape(-1)] > 1, [], 0
    for own, (sides, offsets) in zip(edges, reflector.shadow(view), strict=True):
        outer = np.flatnonzero(~seam[begin : begin + len(own)])
        begin += len(own)
        before = np.append(offsets[:-1], offsets[-1] + ON_EDGE)
        found.append(ImageSource(image, reflector.normal, sides, before, own, outer, reflector.material))
    return found


def reflector_pairs(footprints: ClippedFootprints) -> list[tuple[int, int, NDArray[np.intp]]]:
    """Pairs of reflectors with their entries, each direction pair once."""
    once = np.flatnonzero(
        (footprints.last == DIRECT) | ((footprints.first <= footprints.last) & (footprints.first != DIRECT))
    )
    order = once[np.lexsort([footprints.last[once], footprints.first[once]])]
    pair = np.stack([footprints.first[order], footprints.last[order]], axis=1)
    starts = 1 + np.flatnonzero((np.diff(pair, axis=0) != 0).any(axis=1))
    tolerance_groups = np.split(order, starts)
    return [
        (int(footprints.first[tolerance_group[0]]), int(footprints.last[tolerance_group[0]]), tolerance_group)
        for tolerance_group in tolerance_groups
        if len(tolerance_group)
    ]


def triangle_spans(t: FloatArray, s: FloatArray, at: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(piece, cell) entry and exit of lines `at` (piece, cell) through triangles with corners `t`, `s` (piece, corner);
    reversed where they miss."""
    away = t[:, :, None] - at[:, None]
    after, following_s = np.roll(away, -1, axis=1), np.roll(s, -1, axis=1)
    met = away * after < 0
    share = away / np.where(met, away - after, 1.0)
    place = s[:, :, None] + share * (following_s - s)[:, :, None]
    return np.where(met, place, np.inf).min(axis=1), np.where(met, place, -np.inf).max(axis=1)


def paths_over_edge(
    source: ImageSource, edge: NDArray[np.intp], places: FloatArray, normal: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Of the shortest paths from the source by its `edge` (line,) to `places` (line, point, 3) on a surface with a
    `normal` (line, 3): excess length [m], length after the edge over the share before it [m], and cosine of incidence,
    all (line, point)."""
    one, other = np.moveaxis(source.edges[edge][:, :, None], 1, 0)
    along = (other - one) / np.linalg.norm(other - one, axis=-1, keepdims=True)

    def unrolled(points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Coordinates along the edge and distances from it."""
        offset = points - one
        length = (offset * along).sum(axis=-1)
        return length, np.linalg.norm(offset - length[..., None] * along, axis=-1)

    (here, near), (there, other_source) = unrolled(source.image), unrolled(places)
    way, share = np.hypot(near + other_source, here - there), near / (near + other_source)
    longer = np.maximum(way - np.linalg.norm(places - source.image, axis=-1), 0.0)
    rest = way * (1 - share)
    turn = one + (here + share * (there - here))[..., None] * along
    height = np.abs(np.einsum("lpi,li->lp", places - turn, normal))
    return longer, rest / share, np.where(rest > ON_EDGE, height / np.maximum(rest, ON_EDGE), 0.0)


MIN_SLOPE = 1e-4
"""Least slope: 1 / q keeps enough digits, at next to no phase over hundreds of zones."""


def fresnel_transition(v: FloatArray) -> ComplexArray:
    """Transition F(v), of any shape."""
    from scipy.special import fresnel

    sine, cosine = fresnel(v)
    return np.asarray(0.5 + 0.5 * (1 + 1j) * (cosine - 1j * sine))


def transition_integral(low: FloatArray, high: FloatArray, slope: FloatArray) -> ComplexArray:
    """Integral of (F(v) - H(v)) exp(-j q v) from v = `low` to `high`, either of which may be infinite; `slope` is q.
    All of one shape."""
    q = np.where(slope < 0, -1.0, 1.0) * np.maximum(np.abs(slope), MIN_SLOPE)
    turned = np.exp(0.5j * q * q / np.pi)

    unoccluded = low >= 0, high > 0

    def below(v: FloatArray, unoccluded: NDArray[np.bool_]) -> ComplexArray:
        # By parts: F' is a Gaussian of imaginary width, shifted by the slope.
        known = np.isfinite(v)
        there = np.where(known, v, 0.0)
        own = np.where(known, (fresnel_transition(there) - unoccluded) * np.exp(-1j * q * there), 0.0)
        return np.asarray(1j / q * (own - turned * fresnel_transition(v + q / np.pi)))

    return np.asarray(
        below(high, unoccluded[1]) - below(low, unoccluded[0]) + np.where(unoccluded[1] & ~unoccluded[0], 1j / q, 0.0)
    )
