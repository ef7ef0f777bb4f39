"""Physical optics of one facet, in closed form, on Dr.Jit's float64 arrays (LLVM or CUDA).

With Tx element at distance R_t, Rx element at R_r and k = 2 pi f / c the gain of a facet is

    a = (j / 4 pi) F A / (R_t R_r) <exp(-j k (R_t + R_r))>

where A is the area, <.> the mean over the facet and F the polarimetric obliquity: half the projection of
the Stratton-Chu integrand of the tangential fields (incident plus Fresnel-reflected) on the Rx element's field
direction (:mod:`rfgen_sionna.tracing.integral.obliquity`). For a metal plate at normal incidence F = -1, so that an
infinite mirror at distance d gives the image-theory gain -lambda / (4 pi 2 d) exp(-j 2 k d).

The mean of a linear phase over a triangle has a closed form (:mod:`rfgen_sionna.tracing.integral.simplex`). The phase
of a facet is not quite linear, nor is its return equally strong all over (distance, angle, polarisation). Both are
small on a facet, but neighbouring facets repeat the same residue: a grating, whose lobes add up in first order. So the
quadratic part of the phase is kept to first order, with its variance, and the strength to second
(:mod:`rfgen_sionna.tracing.integral.quadratic`), which leaves an error of second order.

A bent facet is a quadratic patch (:mod:`rfgen_sionna.tracing.surface.quadratic_patch`): its path length is quadratic
all the
same, and its vector element of area, slope and stretch in one, weighs the strength at its corners and in its middle.
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
from rfgen_sionna.tracing.integral.reflected import MirrorLanes, MirrorLegs, mirror_tables, mirrors_of_lanes
from rfgen_sionna.tracing.integral.simplex import Complex as ComplexPair
from rfgen_sionna.tracing.integral.slabs import (
    SlabStackLanes,
    SlabStacks,
    slab_delay_length,
    slab_stack_tables,
    slab_stacks_of_lanes,
)
from rfgen_sionna.tracing.integral.triangle import FacetLanes, triangle_gain
from rfgen_sionna.tracing.surface.quadratic_patch import QuadraticPatch


@dataclass(frozen=True)
class Nodes:
    """Element pairs and frequencies at which facets are integrated, one of each per node."""

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
        """Whether they are frequencies of one pair."""
        return bool((self.tx == self.tx[0]).all() and (self.rx == self.rx[0]).all())


@dataclass(frozen=True)
class FacetGains:
    """Gains and delays of facets at every node."""

    terms: ComplexArray
    """(term, node, facet): gains, then slopes if they were asked for."""
    tau: FloatArray
    """(node, facet) delay by way of the centroid, or of another point of reference [s]."""

    @property
    def a(self) -> ComplexArray:
        """(node, facet) complex gain without the propagation phase of that point."""
        return self.terms[0]

    @property
    def slopes(self) -> ComplexArray:
        """(slope, node, facet) of the gains over the wavenumber [m], over the `axes` and, if asked for, over each two
        of them and over what path lengths have of second order in each two."""
        return self.terms[1:]


class GainBuffer:
    """Where the gains of `count` facets are written, those of some facets at a time."""

    def __init__(self, count: int) -> None:
        self.count = count
        self.index: NDArray[np.intp] | None = None
        """(facet,) places of those that come next; None is all."""
        self.found: Any = None
        self.tau: Any = None


def split_by_curvature(
    curved: NDArray[np.bool_] | None, gains: Callable[[NDArray[np.intp] | slice, bool, GainBuffer | None], FacetGains]
) -> FacetGains:
    """Gains of flat facets and of `curved` (facet,) ones, apart: `gains` takes an index, whether these are curved, and
    what they are written into.

    Large flat facets are integrated point by point, which curved ones, that are small, don't need.
    """
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
    via: MirrorLegs | None = None,
    reference: FloatArray | None = None,
    patch: QuadraticPatch | None = None,
    slab_stacks: tuple[SlabStacks, SlabStacks] | None = None,
    axes: FloatArray | None = None,
    pattern_gradient: FloatArray | None = None,
    gradient_origin: FloatArray | None = None,
    buffer: GainBuffer | None = None,
    origin: FloatArray | None = None,
    steady: bool = False,
    kinds: SlopeOrder = SlopeOrder.SECOND,
    outward: NDArray[np.bool_] | None = None,
) -> FacetGains:
    """Gain of every facet at every node.

    Parameters
    ----------
    corners
        (facet, 3, 3) corner positions [m], either orientation. Less the `origin` they are near the radar's.
    material
        (facet,) index into the materials of `media`.
    media
        What the materials are at the nodes.
    nodes
        Element pairs and frequencies.
    tx_field, rx_field
        (3,) direction of the elements' electric field; towards each facet its transverse part counts, unit gain.
    parts
        (facet,) number n of parts that each edge is divided into: the facet is integrated as n^2 equal triangles. None
        is 1.
    monostatic
        Whether obliquity and Fresnel coefficients are those for an element half way between Tx and Rx; phase and
        spreading stay those of the pair. It errs by about a quarter of the square of baseline over distance, and takes
        half the time.
    via
        The plane mirrors by way of which Tx or Rx or both see the facets; delays are those by way of them. None is the
        straight way.
    reference
        (facet, 3) points [m] that delays go by, and whose propagation phase the gains are without. None is the
        facets' centroids.
    bend
        How the facets leave their flat triangles; None is that they don't.
    screens
        The slabs that Tx, and Rx, see the facets through, if anything. Delays hold that of the slabs' bulk.
    axes
        (axis, 3) displacements [m] of Tx and Rx together, their sum, over which slopes of the gains are asked for.
        Neither with mirrors nor with slabs.
    pull
        (facet, 3) by how much what the antennas make of a facet's points rises per metre, relative to what they make of
        the point `gradient_origin` (facet, 3) [m], the centroid if it is None. None is that it does not. Neither with
        mirrors nor with slabs.
    into
        Other facets' gains, among which these are written; what is returned is all of them then. None is that there are
        no others.
    origin
        (3,) [m] of the frame that nodes, mirrors and slabs are in, in that of corners, `reference` and
        `gradient_origin`. None is that it is the same frame.
    steady
        Whether what the materials reflect may be taken to change linearly from node to node, as it does in the middle
        of the facet. Where nodes are of one pair, with neither mirrors nor slabs, all but the integral over the phase
        is reckoned once for all of them then. It errs by 0.1 to 0.2 times the square of the band over the frequency.
    kinds
        Which slopes are asked for. Those over path lengths of second order stand apart, as displacements of Tx from Rx
        have the same as those of both together.
    outward
        (facet,) which flat facets look away by their corners and are not turned round, but return what of them looks
        at Tx and Rx still, bent as they are. None is none.

    Notes
    -----
    Facets of zero area, those that Tx and Rx see from different sides, and elements closer than 0.1 mm to the centroid
    give gain 0.
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
    together = steady and via is None and slab_stacks is None and nodes.one_pair and not media.slabs
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
    if outward is not None and outward.any():
        given["outward"] = upload(UInt32, outward.astype(np.uint32))
    if parts is not None and int(np.max(parts)) > 1:
        given["parts"] = upload(UInt32, np.asarray(parts, np.uint32))
        # Lanes that are computed together take as long as the one of most parts: those of as many side by side.
        order = np.argsort(np.minimum(parts, 65_535).astype(np.uint16), kind="stable")  # short ones are quick to sort
        given["order"] = upload(UInt32, order.astype(np.uint32))
    if (axes is not None or (together and len(nodes) > 1)) and (drifted := media.drifted) is not None:
        given["drifted"] = media_tables(dr, types, drifted)
    if via is not None:
        given["via"] = mirror_tables(dr, types, via)
    if slab_stacks is not None:
        given["slab_stacks"] = [
            slab_stack_tables(dr, types, each, nodes.frequency)
            for each in (slab_stacks[:1] if via is None and slab_stacks[0] is slab_stacks[1] else slab_stacks)
        ]
    if buffer.index is not None:
        given["place"] = upload(UInt32, np.asarray(buffer.index, np.uint32))
    _INTEGRATED(given, monostatic, None if axes is None else len(axes), int(kinds), len(nodes) if together else 1)
    found, tau = buffer.found.numpy(), buffer.tau.numpy()
    return FacetGains(found.view(np.complex128).reshape(sizes), tau.reshape(sizes[1:]))


def _integrate(given: dict[str, Any], monostatic: bool, axes: int | None, kinds: int, together: int) -> None:
    """The kernel of :func:`facet_gains`, of nothing but what is `given` on the device; so many nodes `together`, which
    are frequencies of one pair, make a lane."""
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
    walls = None
    if "via" in given:
        walls = first, last = mirrors_of_lanes(dr, types, given["via"], facet, node, wavenumber)
        if first is not None:
            t, field_of_tx = first.image(dr, t), first.turned(dr, field_of_tx)
        if last is not None:
            r, field_of_rx = last.image(dr, r), last.turned(dr, field_of_rx)
    elif "slab_stacks" in given:
        walls = (None, None)
    middle = (p[0] + p[1] + p[2]) / 3.0
    through = placed("reference", facet) if "reference" in given else middle
    cross = dr.cross(p[1] - p[0], p[2] - p[0])
    slopes = list[Any]()
    if "slab_stacks" in given:
        upright = cross / dr.maximum(dr.squared_norm(cross), 1e-300)
        slopes = [dr.cross(upright, p[(k + 2) % 3] - p[(k + 1) % 3]) for k in range(3)]
    # What is bent may turn out of sight of one element and not of another: its side is the one that the radar sees.
    away = dr.dot(cross, middle if "sagittas" in given and "via" not in given else middle - t) > 0
    if "outward" in given:
        away &= whole("outward", facet) == 0
    cross = dr.select(away, -cross, cross)
    sagittas = None
    if "sagittas" in given:
        sagittas = [vector("sagittas", 3 * facet + edge) for edge in range(3)]
        if "corner_offsets" in given:
            p = [corner + vector("corner_offsets", 3 * facet + k) for k, corner in enumerate(p)]
    crossed = SlabStackLanes([], []), SlabStackLanes([], [])
    turn, bulk = None, 0.0
    if "slab_stacks" in given and walls is not None:

        def lanes(of: dict[str, Any], wall: MirrorLanes | None) -> SlabStackLanes:
            def mirrored(direction: Any) -> Any:
                return direction if wall is None else wall.turned(dr, direction)

            return slab_stacks_of_lanes(dr, types, of, mirrored, facet, node, wavenumber)

        there, *back = given["slab_stacks"]
        crossed_there = lanes(there, walls[0])
        crossed = crossed_there, lanes(back[0], walls[1]) if back else crossed_there
        ways = dr.normalize(through - t), dr.normalize(r - through)
        bulk = slab_delay_length(dr, crossed[0], ways[0]) + slab_delay_length(dr, crossed[1], ways[1])
        sin, cos = dr.sincos(wavenumber * bulk)
        turn = ComplexPair(cos, sin)
    ends = t, r, field_of_tx, field_of_rx
    with_pattern_gradient = None
    if "pattern_gradient" in given:
        with_pattern_gradient = (
            vector("pattern_gradient", facet),
            placed("gradient_origin", facet) if "gradient_origin" in given else middle,
        )
    surface = FacetLanes(
        cross, away, medium, *ends, monostatic, walls, middle, slopes, crossed, turn, with_pattern_gradient
    )
    moved = None if axes is None else [vector("axes", UInt32(axis)) for axis in range(axes)]
    parts = whole("parts", facet) if "parts" in given else None
    if parts is None or sagittas is not None:
        terms, excess = triangle_gain(
            dr, Array3, Complex, surface, p, sagittas, wavenumbers, through, moved, kinds, parts
        )
        if "reference" in given or "corner_offsets" in given:
            terms = [_phase_shifted(dr, *each, excess) for each in zip(terms, wavenumbers, strict=True)]
    else:
        count = Float(parts)

        def lattice(row: Any, column: Any) -> Any:
            return p[0] + (row / count) * (p[1] - p[0]) + (column / count) * (p[2] - p[1])

        def step(index: Any, *sums: Any) -> tuple[Any, ...]:
            row, column, turned, last = lattice_triangle(dr, Float(index))
            part = [
                lattice(row, column),
                lattice(row + 1.0, dr.select(turned, column + 1.0, column)),
                lattice(last, column + 1.0),
            ]
            terms, excess = triangle_gain(dr, Array3, Complex, surface, part, None, wavenumbers, through, moved, kinds)
            carried = [_phase_shifted(dr, *each, excess) for each in zip(terms, wavenumbers, strict=True)]
            found = [each.scaled(1.0 / (count * count)) for each in chain(*carried)]
            return index + 1, *(a + b for a, b in zip(sums, flatten_terms(found), strict=True))

        several = number_of_terms(moved, kinds)
        found = sum_terms(dr, Float, parts * parts, step, several * together, dr.width(given["lanes"]))
        terms = [found[first : first + several] for first in range(0, len(found), several)]
    if "drifted" in given:  # integrals are those for media that stay as they are at the mean wavenumber
        normal = cross / dr.maximum(dr.norm(cross), 1e-30)
        known = node, material, wavenumber, normal, middle - 0.5 * (t + r)
        changing = given["media"], given["drifted"]
        rate = dispersion(dr, types, changing, *known, (field_of_tx, field_of_rx))
        terms = [_dispersed(each, rate, there - wavenumber) for each, there in zip(terms, wavenumbers, strict=True)]
    length = dr.norm(through - t) + dr.norm(r - through) + bulk
    # Written as NumPy's complex numbers lie in memory, which saves copying them.
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
    """Gain and slopes of a point whose path exceeds that of the point of reference by `excess` [m], from there."""
    sin, cos = dr.sincos(-wavenumber * excess)
    carrier = ComplexPair(cos, sin)
    if len(terms) > 1:
        terms = [terms[0], terms[1] - terms[0].turned().scaled(excess), *terms[2:]]
    return [each.times(carrier) for each in terms]


def _dispersed(terms: list[ComplexPair], rate: ComplexPair, beyond: Any) -> list[ComplexPair]:
    """Gain and slopes where the media have changed at a `rate` [m], relative to the gain, over wavenumbers `beyond`
    [rad/m] that for which they are."""
    gain = ComplexPair(1.0 + rate.re * beyond, rate.im * beyond)
    found = [each.times(gain) for each in terms]
    if len(found) > 1:
        found[1] = found[1] + terms[0].times(rate)
    return found
