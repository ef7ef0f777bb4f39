"""Physical optics of facets in closed form, on Dr.Jit's float64 arrays (LLVM or CUDA).

With the Tx element at distance R_t, the Rx element at R_r and k = 2 pi f / c the gain of a facet is

    a = (j / 4 pi) F A / (R_t R_r) <exp(-j k (R_t + R_r))>

A is the area, <.> the mean over the facet, and F the obliquity: half the projection of the Stratton-Chu integrand of
the tangential fields on the Rx element's field (:mod:`rfgen_sionna.tracing.integral.obliquity`). At normal incidence on
metal F = -1: an infinite mirror at distance d has the image-theory gain -lambda / (4 pi 2 d) exp(-j 2 k d).

The mean of a linear phase has a closed form (:mod:`rfgen_sionna.tracing.integral.simplex`). The small rest is a grating
on neighbouring facets, whose lobes are of first order. So the quadratic part of the phase is kept to first order, with
its variance, and the strength to second (:mod:`rfgen_sionna.tracing.integral.quadratic`): the error is of second order.

A bent facet is a quadratic patch (:mod:`rfgen_sionna.tracing.surface.quadratic_patch`): its path length is quadratic
too, and its area element weights the strength at the corners and in the middle.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import chain
from math import prod
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import SPEED_OF_LIGHT, ComplexArray, FloatArray, IntArray
from rfgen_sionna.scene.kernels import FrozenKernel, drjit_types, upload
from rfgen_sionna.tracing.integral.obliquity import Media, dispersion, media_of_lanes, media_tables
from rfgen_sionna.tracing.integral.quadratic import (
    SlopeOrder,
    flatten_terms,
    lattice_triangle,
    number_of_terms,
    sum_terms,
)
from rfgen_sionna.tracing.integral.simplex import Complex as ComplexPair
from rfgen_sionna.tracing.integral.triangle import FacetLanes, triangle_gain
from rfgen_sionna.tracing.surface.quadratic_patch import QuadraticPatch


@dataclass(frozen=True)
class Nodes:
    """Element pairs and frequencies of the integrals, one of each per node."""

    tx: FloatArray
    """(node, 3) [m]"""
    rx: FloatArray
    """(node, 3) [m]"""
    frequency: FloatArray
    """(node,) [Hz]"""

    def __len__(self) -> int:
        return len(self.frequency)

    @property
    def one_pair(self) -> bool:
        """Whether all nodes are of one pair."""
        return bool((self.tx == self.tx[0]).all() and (self.rx == self.rx[0]).all())


@dataclass(frozen=True)
class FacetGains:
    """Gains and delays of facets at every node."""

    terms: ComplexArray
    """(term, node, facet) gains, then their slopes."""
    tau: FloatArray
    """(node, facet) delays via the reference points [s]."""

    @property
    def a(self) -> ComplexArray:
        """(node, facet) complex gains without the propagation phase of the reference points."""
        return self.terms[0]

    @property
    def slopes(self) -> ComplexArray:
        """(slope, node, facet) slopes of the gains, first over the wavenumber [m], in the order of `SlopeOrder`."""
        return self.terms[1:]


class GainBuffer:
    """Output buffer for the gains of `count` facets, filled in parts."""

    def __init__(self, count: int) -> None:
        self.count = count
        self.index: NDArray[np.intp] | None = None
        """(facet,) entries that the next part fills; None means all."""
        self.found: Any = None
        self.tau: Any = None


def split_by_curvature(
    curved: NDArray[np.bool_] | None, gains: Callable[[NDArray[np.intp] | slice, bool, GainBuffer | None], FacetGains]
) -> FacetGains:
    """Gains of flat facets and of `curved` (facet,) ones, by two calls of `gains` (index, curved, buffer). Only large
    flat facets are integrated in many parts."""
    if curved is None or curved.all() or not curved.any():
        return gains(slice(None), curved is not None and bool(curved.any()), None)
    buffer = GainBuffer(len(curved))
    for kind in (False, True):
        buffer.index = np.flatnonzero(curved == kind)
        found = gains(buffer.index, kind, buffer)
    return found


def facet_gains(
    corners: FloatArray,
    material: IntArray,
    media: Media,
    nodes: Nodes,
    tx_field: FloatArray,
    rx_field: FloatArray,
    parts: IntArray | None = None,
    monostatic: bool = False,
    reference: FloatArray | None = None,
    patch: QuadraticPatch | None = None,
    axes: FloatArray | None = None,
    pattern_gradient: FloatArray | None = None,
    gradient_origin: FloatArray | None = None,
    buffer: GainBuffer | None = None,
    origin: FloatArray | None = None,
    steady: bool = False,
    kinds: SlopeOrder = SlopeOrder.SECOND,
) -> FacetGains:
    """Gain of every facet at every node.

    Facets without area, with Tx and Rx on different sides, or within 0.1 mm of an element have gain 0.

    Parameters
    ----------
    corners, material
        (facet, 3, 3) corner positions [m], either orientation, and (facet,) index into the materials of `media`.
    media, nodes
        Materials at the nodes; element pairs and frequencies.
    tx_field, rx_field
        (3,) direction of the elements' electric field; unit gain, transverse part.
    parts
        (facet,) n of the n^2 equal triangles that a facet is integrated as; None means 1.
    monostatic
        Obliquity and Fresnel coefficients of an element half way: half the time, error (baseline / distance)^2 / 4.
    reference
        (facet, 3) points [m] of the delays, whose propagation phase the gains lack; None means the centroids.
    patch
        Quadratic patches of bent facets; None means flat facets.
    axes, kinds
        (axis, 3) displacements [m] of Tx and Rx together, their sum, for slopes of the gains, and order of the slopes.
        None computes no slopes.
    pattern_gradient, gradient_origin
        (facet, 3) gradient of the pattern gain's logarithm [1/m], None means constant gain; (facet, 3) points [m] of
        unit gain, None means the centroids.
    buffer
        Output buffer to write into, and to return as a whole; None allocates one.
    origin
        (3,) origin [m] of the frame of the nodes in that of the facets; None means the same frame.
    steady
        Take the reflection for linear over the nodes. Nodes of one pair then share all but the phase integral. Relative
        error 0.1 to 0.2 times (band / frequency)^2.
    """
    dr, types = drjit_types()
    Float, UInt32 = types.Float64, types.UInt32
    shape = (len(nodes), len(corners))
    if 0 in shape:
        return FacetGains(np.zeros((number_of_terms(axes, kinds), *shape), np.complex128), np.zeros(shape))
    buffer = buffer or GainBuffer(shape[1])
    sizes = number_of_terms(axes, kinds), shape[0], buffer.count
    if buffer.found is None:
        buffer.found, buffer.tau = dr.empty(Float, 2 * prod(sizes)), dr.empty(Float, shape[0] * buffer.count)
    elements = [nodes.tx, nodes.rx, 2 * np.pi / SPEED_OF_LIGHT * np.asarray(nodes.frequency, np.float64)[:, None]]
    together = steady and nodes.one_pair and not media.slabs
    if together:
        media = media.mean()
    given: dict[str, Any] = {
        "lanes": dr.arange(UInt32, (1 if together else shape[0]) * shape[1]),
        "facets": dr.opaque(UInt32, shape[1]),
        "buffer": dr.opaque(UInt32, buffer.count),
        "size": dr.opaque(UInt32, shape[0] * buffer.count),
        "found": buffer.found,
        "tau": buffer.tau,
        "nodes": upload(Float, np.hstack(elements)),
        "fields": upload(Float, np.stack([tx_field, rx_field])),
        "media": media_tables(dr, types, media),
        "corners": upload(Float, corners),
        "material": upload(UInt32, np.asarray(material, np.uint32)),
    }
    arrays = {
        "reference": reference,
        "gradient_origin": None if pattern_gradient is None else gradient_origin,
        "pattern_gradient": pattern_gradient,
        "origin": origin,
        "axes": axes,
    }
    if patch is not None:
        arrays |= {"sagittas": patch.sagittas, "corner_offsets": patch.corner_offsets}
    given |= {name: upload(Float, values) for name, values in arrays.items() if values is not None and len(values)}
    if parts is not None and int(np.max(parts)) > 1:
        given["parts"] = upload(UInt32, np.asarray(parts, np.uint32))
        # Lanes computed together take as long as the one of most parts; 16-bit integers sort quickly.
        order = np.argsort(np.minimum(parts, 65_535).astype(np.uint16), kind="stable")
        given["order"] = upload(UInt32, order.astype(np.uint32))
    if (axes is not None or (together and len(nodes) > 1)) and (drifted := media.drifted) is not None:
        given["drifted"] = media_tables(dr, types, drifted)
    if buffer.index is not None:
        given["place"] = upload(UInt32, np.asarray(buffer.index, np.uint32))
    _INTEGRATED(given, monostatic, None if axes is None else len(axes), int(kinds), len(nodes) if together else 1)
    found, tau = buffer.found.numpy(), buffer.tau.numpy()
    return FacetGains(found.view(np.complex128).reshape(sizes), tau.reshape(sizes[1:]))


def _integrate(given: dict[str, Any], monostatic: bool, axes: int | None, kinds: int, together: int) -> None:
    """Kernel of :func:`facet_gains`; a lane holds `together` nodes, frequencies of one pair."""
    dr, types = drjit_types()
    Float, UInt32, Array3, Complex = types.Float64, types.UInt32, types.Array3f64, types.Complex2f64

    def vector(name: str, index: Any) -> Any:
        return Array3(*(dr.gather(Float, given[name], 3 * index + axis) for axis in range(3)))

    def whole(name: str, index: Any) -> Any:
        return dr.gather(UInt32, given[name], index)

    lane = given["lanes"]
    facet, node = lane % given["facets"], lane // given["facets"]
    if "parts" in given:
        facet = whole("order", facet)
    start = vector("origin", UInt32(0)) if "origin" in given else None

    def placed(name: str, index: Any) -> Any:
        return vector(name, index) if start is None else vector(name, index) - start

    p = [placed("corners", 3 * facet + corner) for corner in range(3)]
    element = [dr.gather(Float, given["nodes"], 7 * node + k) for k in range(6)]
    t, r = Array3(*element[:3]), Array3(*element[3:])
    wavenumbers = [dr.gather(Float, given["nodes"], 7 * (node + k) + 6) for k in range(together)]
    wavenumber = sum(wavenumbers[1:], wavenumbers[0]) / together
    material = whole("material", facet)
    medium = media_of_lanes(dr, types, given["media"], node, material, wavenumber)
    field_of_tx, field_of_rx = vector("fields", UInt32(0)), vector("fields", UInt32(1))
    middle = (p[0] + p[1] + p[2]) / 3.0
    through = placed("reference", facet) if "reference" in given else middle
    cross = dr.cross(p[1] - p[0], p[2] - p[0])
    # A bent facet's side is the one towards the radar: single elements may differ.
    away = dr.dot(cross, middle if "sagittas" in given else middle - t) > 0
    cross = dr.select(away, -cross, cross)
    sagittas = None
    if "sagittas" in given:
        sagittas = [vector("sagittas", 3 * facet + edge) for edge in range(3)]
        if "corner_offsets" in given:
            p = [corner + vector("corner_offsets", 3 * facet + k) for k, corner in enumerate(p)]
    ends = t, r, field_of_tx, field_of_rx
    gradient = None
    if "pattern_gradient" in given:
        gradient_origin = placed("gradient_origin", facet) if "gradient_origin" in given else middle
        gradient = vector("pattern_gradient", facet), gradient_origin
    surface = FacetLanes(cross, away, medium, *ends, monostatic, gradient)
    moved = None if axes is None else [vector("axes", UInt32(axis)) for axis in range(axes)]
    parts = whole("parts", facet) if "parts" in given else None
    common = dr, Array3, Complex, surface
    if parts is None or sagittas is not None:
        terms, excess = triangle_gain(*common, p, sagittas, wavenumbers, through, moved, kinds, parts)
        if "reference" in given or "corner_offsets" in given:
            terms = [_phase_shifted(dr, *each, excess) for each in zip(terms, wavenumbers, strict=True)]
    else:
        count = Float(parts)

        def lattice(row: Any, column: Any) -> Any:
            return p[0] + (row / count) * (p[1] - p[0]) + (column / count) * (p[2] - p[1])

        def step(index: Any, *sums: Any) -> tuple[Any, ...]:
            row, column, turned, last = lattice_triangle(dr, Float(index))
            second = lattice(row + 1.0, dr.select(turned, column + 1.0, column))
            part = [lattice(row, column), second, lattice(last, column + 1.0)]
            terms, excess = triangle_gain(*common, part, None, wavenumbers, through, moved, kinds)
            carried = [_phase_shifted(dr, *each, excess) for each in zip(terms, wavenumbers, strict=True)]
            found = [each.scaled(1.0 / (count * count)) for each in chain(*carried)]
            return index + 1, *(a + b for a, b in zip(sums, flatten_terms(found), strict=True))

        several = number_of_terms(moved, kinds)
        found = sum_terms(dr, Float, parts * parts, step, several * together, dr.width(given["lanes"]))
        terms = [found[first : first + several] for first in range(0, len(found), several)]
    if "drifted" in given:  # the integrals are those for the media at the mean wavenumber
        normal = cross / dr.maximum(dr.norm(cross), 1e-30)
        known = node, material, wavenumber, normal, middle - 0.5 * (t + r)
        changing = given["media"], given["drifted"]
        rate = dispersion(dr, types, changing, *known, (field_of_tx, field_of_rx))
        terms = [_dispersed(each, rate, there - wavenumber) for each, there in zip(terms, wavenumbers, strict=True)]
    length = dr.norm(through - t) + dr.norm(r - through)
    # In the memory layout of NumPy's complex numbers.
    place = node * given["buffer"] + (whole("place", facet) if "place" in given else facet)
    size = given["size"]
    for number, each in enumerate(terms):
        there = place + number * given["buffer"]
        for k, value in enumerate(flatten_terms(each)):
            dr.scatter(given["found"], value, 2 * (there + k // 2 * size) + k % 2, mode=dr.ReduceMode.Permute)
        dr.scatter(given["tau"], length / SPEED_OF_LIGHT, there, mode=dr.ReduceMode.Permute)
    dr.eval(given["found"], given["tau"])


_INTEGRATED = FrozenKernel(_integrate)


def _phase_shifted(dr: Any, terms: list[ComplexPair], wavenumber: Any, excess: Any) -> list[ComplexPair]:
    """Gain and slopes with the phase of an `excess` path [m] over the reference point's."""
    sin, cos = dr.sincos(-wavenumber * excess)
    carrier = ComplexPair(cos, sin)
    if len(terms) > 1:
        terms = [terms[0], terms[1] - terms[0].turned().scaled(excess), *terms[2:]]
    return [each.times(carrier) for each in terms]


def _dispersed(terms: list[ComplexPair], rate: ComplexPair, beyond: Any) -> list[ComplexPair]:
    """Gain and slopes at wavenumbers `beyond` [rad/m] those of the media, for a relative `rate` of the gain [m]."""
    gain = ComplexPair(1.0 + rate.re * beyond, rate.im * beyond)
    found = [each.times(gain) for each in terms]
    if len(found) > 1:
        found[1] = found[1] + terms[0].times(rate)
    return found
