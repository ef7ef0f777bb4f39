"""Physical optics of one flat facet, in closed form, on Dr.Jit's float64 arrays (LLVM or CUDA).

With Tx element at distance R_t, Rx element at R_r and k = 2 pi f / c the gain of a facet is

    a = (j / 4 pi) F A / (R_t R_r) <exp(-j k (R_t + R_r))>

where A is the area, <.> the mean over the facet and F the polarimetric obliquity: half the projection of
the Stratton-Chu integrand of the tangential fields (incident plus Fresnel-reflected) on the Rx element's field
direction (:mod:`rfgen_sionna.tracing.obliquity`). For a metal plate at normal incidence F = -1, so that an infinite
mirror at distance d gives the image-theory gain -lambda / (4 pi 2 d) exp(-j 2 k d).

The mean of a linear phase over a triangle has a closed form (:mod:`rfgen_sionna.tracing.simplex`). The phase of a facet
is not quite linear, nor is its return equally strong all over (distance, angle, polarisation). Both are small on a
facet, but neighbouring facets repeat the same residue: a grating, whose lobes add up in first order. So the quadratic
part of the phase and the linear part of the strength are kept to first order, which leaves an error of second order.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from rfgen_sionna.records import SPEED_OF_LIGHT, ComplexArray, FloatArray, IntArray
from rfgen_sionna.tracing.arrays import drjit_types, upload
from rfgen_sionna.tracing.obliquity import Media, Medium, Way, backscatter, media_of_lanes, transverse
from rfgen_sionna.tracing.reflected import Strength, Via, Wall, walls_of_lanes
from rfgen_sionna.tracing.simplex import Complex as ComplexPair
from rfgen_sionna.tracing.simplex import moments
from rfgen_sionna.tracing.slabs import Slab, Slabs, bulk_length, slabs_of_lanes


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


@dataclass(frozen=True)
class FacetGains:
    """Gains and delays of facets at every node."""

    a: ComplexArray
    """(node, facet) complex gain without the propagation phase of the centroid, or of another point of reference."""
    tau: FloatArray
    """(node, facet) delay by way of that point [s]."""


def _integral(
    dr: Any, wavenumber: Any, lengths: list[Any], sags: list[Any], strength: ComplexPair, changes: list[ComplexPair]
) -> ComplexPair:
    """Mean of w exp(-j psi) over a facet, to first order in the sags and in how w changes.

    psi is quadratic, linear between the corners less 4 sum_edges sag l_i l_k; w is the `strength` in the middle and
    `changes` by so much at the corners, linearly.
    """
    found = moments(dr, (wavenumber * lengths[0], wavenumber * lengths[1], wavenumber * lengths[2]))
    sag = [wavenumber * each for each in sags]
    mean_sag = (sag[0] + sag[1] + sag[2]) / 3.0  # <4 l_i l_k> = 1/3
    quadratic = found.edge[0].scaled(4 * sag[0]) + found.edge[1].scaled(4 * sag[1]) + found.edge[2].scaled(4 * sag[2])
    total = strength.times(found.mean + (quadratic - found.mean.scaled(mean_sag)).turned())
    for moment, change in zip(found.corner, changes, strict=True):
        total = total + change.times(moment)
    sin, cos = dr.sincos(mean_sag)
    return total.times(ComplexPair(cos, sin))


def facet_gains(
    corners: FloatArray,
    material: IntArray,
    media: Media,
    nodes: Nodes,
    tx_field: FloatArray,
    rx_field: FloatArray,
    parts: IntArray | None = None,
    monostatic: bool = False,
    via: Via | None = None,
    reference: FloatArray | None = None,
    normals: FloatArray | None = None,
    slabs: Slabs | None = None,
) -> FacetGains:
    """Gain of every facet at every node.

    Parameters
    ----------
    corners
        (facet, 3, 3) corner positions [m], in a frame whose origin is near the radar; either orientation.
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
    normals
        (facet, 3, 3) unit normals at the corners, of the smooth surface that the facets stand for
        (:mod:`rfgen_sionna.tracing.smooth`), to either side; None is that they are flat.
    slabs
        What Tx and Rx see the facets through, if anything; it may not go together with mirrors. Delays hold that of the
        slabs' bulk.

    Notes
    -----
    Facets of zero area, those that Tx and Rx see from different sides, and elements closer than 0.1 mm to the centroid
    give gain 0.
    """
    dr, types = drjit_types()
    Float, UInt32, Array3, Complex = types.Float64, types.UInt32, types.Array3f64, types.Complex2f64
    shape = (len(nodes), len(corners))
    if 0 in shape:
        return FacetGains(np.zeros(shape, np.complex128), np.zeros(shape))

    def vector(values: FloatArray, index: Any) -> Any:
        flat = upload(dr, Float, np.asarray(values, np.float64))
        return Array3(*(dr.gather(Float, flat, index * 3 + axis) for axis in range(3)))

    def whole(values: ArrayLike, index: Any) -> Any:
        return dr.gather(UInt32, upload(dr, UInt32, np.asarray(values, np.uint32)), index)

    lane = dr.arange(UInt32, shape[0] * shape[1])
    facet_count = dr.opaque(UInt32, shape[1])
    facet, node = lane % facet_count, lane // facet_count
    flat_corners = np.ascontiguousarray(corners, dtype=np.float64).reshape(-1, 3)
    p = [vector(flat_corners, facet * 3 + corner) for corner in range(3)]
    t, r = vector(nodes.tx, node), vector(nodes.rx, node)
    wavenumbers = 2 * np.pi / SPEED_OF_LIGHT * np.asarray(nodes.frequency, np.float64)
    wavenumber = dr.gather(Float, upload(dr, Float, wavenumbers), node)
    medium = media_of_lanes(dr, types, media, node, whole(material, facet), wavenumber)
    field_of_tx, field_of_rx = (Array3(*(dr.opaque(Float, float(x)) for x in f)) for f in (tx_field, rx_field))
    walls = None
    if via is not None:
        walls = first, last = walls_of_lanes(dr, types, via, facet, node, wavenumber)
        if first is not None:
            t, field_of_tx = first.image(dr, t), first.turned(dr, field_of_tx)
        if last is not None:
            r, field_of_rx = last.image(dr, r), last.turned(dr, field_of_rx)
    elif slabs is not None:
        walls = (None, None)
    centre = (p[0] + p[1] + p[2]) / 3.0
    origin = centre if reference is None else vector(np.reshape(reference, (-1, 3)), facet)
    cross = dr.cross(p[1] - p[0], p[2] - p[0])
    twice_area = dr.norm(cross)
    normal = cross / dr.select(twice_area > 0, twice_area, 1.0)
    away = dr.dot(normal, centre - t) > 0
    normal = dr.select(away, -normal, normal)
    tips = None
    if normals is not None:
        flat_normals = np.ascontiguousarray(normals, dtype=np.float64).reshape(-1, 3)
        tips = [vector(flat_normals, facet * 3 + corner) for corner in range(3)]
        tips = [dr.select(dr.dot(tip, normal) < 0, -tip, tip) for tip in tips]
    crossed: list[Slab] = []
    turn, bulk = None, 0.0
    if slabs is not None:
        crossed = slabs_of_lanes(dr, types, slabs, nodes.frequency, facet, node, wavenumber)
        bulk = bulk_length(dr, crossed, dr.normalize(origin - t)) + bulk_length(dr, crossed, dr.normalize(r - origin))
        sin, cos = dr.sincos(wavenumber * bulk)
        turn = ComplexPair(cos, sin)
    ends = t, r, field_of_tx, field_of_rx
    surface = _Surface(normal, 0.5 * twice_area, medium, *ends, monostatic, walls, crossed, turn)

    whole_facets = parts is None or int(np.max(parts)) == 1
    if parts is None or whole_facets or tips is not None:
        each = None if parts is None or whole_facets else whole(parts, facet)
        gain, excess = _triangle(dr, Array3, Complex, surface, p, tips, wavenumber, origin, each)
        if reference is not None:
            sin, cos = dr.sincos(-wavenumber * excess)
            gain = gain.times(ComplexPair(cos, sin))
        real, imaginary = gain.re, gain.im
    else:
        count = Float(whole(parts, facet))

        def lattice(row: Any, column: Any) -> Any:
            return p[0] + (row / count) * (p[1] - p[0]) + (column / count) * (p[2] - p[1])

        def step(index: Any, re: Any, im: Any) -> tuple[Any, Any, Any]:
            row, column, turned, last = lattice_triangle(dr, Float(index))
            part = [
                lattice(row, column),
                lattice(row + 1.0, dr.select(turned, column + 1.0, column)),
                lattice(last, column + 1.0),
            ]
            gain, excess = _triangle(dr, Array3, Complex, surface, part, None, wavenumber, origin)
            sin, cos = dr.sincos(-wavenumber * excess)
            gain = gain.times(ComplexPair(cos, sin)).scaled(1.0 / (count * count))
            return index + 1, re + gain.re, im + gain.im

        total = whole(np.asarray(parts) ** 2, facet)
        start = (dr.zeros(UInt32, len(lane)), dr.zeros(Float, len(lane)), dr.zeros(Float, len(lane)))
        _, real, imaginary = dr.while_loop(start, lambda index, re, im: index < total, step)
    length = dr.norm(origin - t) + dr.norm(r - origin) + bulk
    dr.eval(real, imaginary, length)
    a = np.empty(shape, dtype=np.complex128)
    a.real, a.imag = real.numpy().reshape(shape), imaginary.numpy().reshape(shape)
    return FacetGains(a, length.numpy().reshape(shape) / SPEED_OF_LIGHT)


class _Surface(NamedTuple):
    """A facet and the elements that look at it, lane by lane."""

    normal: Any
    """Towards the Tx element."""
    area: Any
    medium: Medium
    tx: Any
    rx: Any
    tx_field: Any
    rx_field: Any
    monostatic: bool
    walls: tuple[Wall | None, Wall | None] | None
    """By way of which Tx and Rx look at it: `tx` and `rx` with their fields are images then."""
    slabs: list[Slab]
    """Through what they do."""
    turn: ComplexPair | None
    """What takes the phase of the slabs' bulk away, as delays hold it."""


def _triangle(
    dr: Any,
    vector: Any,
    complex_type: Any,
    surface: _Surface,
    p: list[Any],
    tips: list[Any] | None,
    wavenumber: Any,
    reference: Any,
    parts: Any = None,
) -> tuple[ComplexPair, Any]:
    """Gain of a triangle `p` as if it were the whole facet, and by how much its centroid's path exceeds that by way of
    the `reference` point [m]. `tips` are the normals at its corners, if it is curved; it may be integrated in `parts`
    to an edge then."""
    t, r, normal = surface.tx, surface.rx, surface.normal
    centre = (p[0] + p[1] + p[2]) / 3.0

    # Path length at a point less that at another, without cancellation: |x|-|y| = (x-y).(x+y)/(|x|+|y|).
    def excess(point: Any, origin: Any) -> Any:
        offset = point - origin
        from_t, from_r = point - t, point - r
        base_t, base_r = origin - t, origin - r
        return dr.dot(offset, from_t + base_t) / dr.maximum(dr.norm(from_t) + dr.norm(base_t), 1e-30) + dr.dot(
            offset, from_r + base_r
        ) / dr.maximum(dr.norm(from_r) + dr.norm(base_r), 1e-30)

    from_tx, to_rx = centre - t, r - centre
    distance_tx, distance_rx = dr.norm(from_tx), dr.norm(to_rx)
    usable = (surface.area > 0) & (distance_tx > 1e-4) & (distance_rx > 1e-4)
    spread = dr.select(usable, distance_tx * distance_rx, 1.0)
    k_in, k_out = from_tx / dr.maximum(distance_tx, 1e-30), to_rx / dr.maximum(distance_rx, 1e-30)
    usable &= (dr.dot(normal, k_out) > 0) & (
        dr.dot(normal, k_in) < 0
    )  # an element in the facet's plane, the other behind it

    facing, area = normal, surface.area
    if tips is not None:
        facing = dr.normalize(tips[0] + tips[1] + tips[2])
        area = area * _swelling(dr, p, tips, normal, facing, area)
    lengths = [excess(corner, centre) for corner in p]
    # By how much a linear phase through the corners lies above the true one in the middle of each edge.
    middles = [0.5 * (p[(i + 1) % 3] + p[(i + 2) % 3]) for i in range(3)]
    if tips is not None:
        middles = [middle + _rise(dr, p, tips, i) for i, middle in enumerate(middles)]
    sags = [
        0.5 * (lengths[(i + 1) % 3] + lengths[(i + 2) % 3]) - excess(middle, centre) for i, middle in enumerate(middles)
    ]
    # How spreading, Fresnel coefficients and polarisation change over the facet is taken for an element half way
    # between Tx and Rx: the difference to the pair itself is of second order.
    element = 0.5 * (t + r)
    floor = 0.5 * dr.sqrt(spread)

    def at(point: Any, normal: Any) -> ComplexPair:
        fields = surface.tx_field, surface.rx_field
        return backscatter(dr, complex_type, surface.medium, normal, point - element, *fields, floor)

    if surface.walls is not None:  # the images may lie in very different directions
        by_wall = Strength(dr, vector, complex_type, surface, centre)
        of_centre = by_wall.at(centre, facing)
        if tips is None:
            changes = [by_wall.at(corner, facing) - of_centre for corner in p[:2]]
            changes.append((changes[0] + changes[1]).scaled(-1.0))  # linear: nothing on the average
        else:
            changes = [by_wall.at(corner, tip) - of_centre for corner, tip in zip(p, tips, strict=True)]
        expansion = _Expansion(lengths, sags, of_centre, changes)
        return _return(dr, area, usable, wavenumber, expansion, parts), excess(centre, reference)
    middle = at(centre, facing)
    if surface.monostatic:
        of_centre = middle.scaled(dr.square(dr.norm(centre - element)) / spread)
    else:
        e_tx, e_rx = transverse(dr, surface.tx_field, k_in), transverse(dr, surface.rx_field, k_out)
        there = Way(dr, vector, facing, k_in, e_tx, k_out, e_rx).obliquity(dr, complex_type, surface.medium)
        back = Way(dr, vector, facing, -k_out, e_rx, -k_in, e_tx).obliquity(dr, complex_type, surface.medium)
        of_centre = ComplexPair(there.re + back.re, there.im + back.im).scaled(0.5 / spread)
    changes = [at(corner, facing if tips is None else tips[i]) - middle for i, corner in enumerate(p)]
    expansion = _Expansion(lengths, sags, of_centre, changes)
    return _return(dr, area, usable, wavenumber, expansion, parts), excess(centre, reference)


def _rise(dr: Any, p: list[Any], tips: list[Any], corner: int) -> Any:
    """Off its chord, the middle of the edge opposite `corner` on the surface with normals `tips`."""
    i, k = (corner + 1) % 3, (corner + 2) % 3
    mean = tips[i] + tips[k]
    size = dr.maximum(dr.norm(mean), 1e-9)
    return dr.dot(tips[k] - tips[i], p[k] - p[i]) / (2.0 * size * (2.0 + size)) * mean


def _swelling(dr: Any, p: list[Any], tips: list[Any], normal: Any, facing: Any, area: Any) -> Any:
    """The area of a curved facet over that of its triangle `p`: its edges bow outwards, and it is aslant there."""
    centre = (p[0] + p[1] + p[2]) / 3.0
    more = 0.0
    for i in range(3):
        edge, middle = p[(i + 2) % 3] - p[(i + 1) % 3], 0.5 * (p[(i + 2) % 3] + p[(i + 1) % 3])
        outwards = dr.cross(edge, normal)
        outwards = dr.select(dr.dot(outwards, middle - centre) < 0, -outwards, outwards)
        more = more + (2 / 3) * dr.dot(_rise(dr, p, tips, i), outwards)  # a parabola's segment
    # The mean of what grows with the square of the distance from the centroid is a quarter of its mean at the corners.
    aslant = sum(1.0 / dr.maximum(dr.dot(tip, facing), 0.5) - 1.0 for tip in tips) / 12.0
    return 1.0 + more / dr.select(area > 0, area, 1.0) + aslant


class _Expansion(NamedTuple):
    """Path length and strength over a facet: the former is quadratic, the latter linear."""

    lengths: list[Any]
    """Of the corners [m], less the centroid's."""
    sags: list[Any]
    """By how much a linear path length lies above the true one in the middle of the edge opposite each corner [m]."""
    strength: ComplexPair
    changes: list[ComplexPair]
    """At the corners, from the middle's `strength`."""

    def at(self, weight: tuple[Any, Any, Any]) -> tuple[Any, ComplexPair]:
        """Path length [m] and strength at barycentric coordinates."""
        length, strength = 0.0, self.strength
        for i, (own, change) in enumerate(zip(self.lengths, self.changes, strict=True)):
            length = length + weight[i] * own - 4.0 * weight[(i + 1) % 3] * weight[(i + 2) % 3] * self.sags[i]
            strength = strength + change.scaled(weight[i])
        return length, strength


def _return(dr: Any, area: Any, usable: Any, wavenumber: Any, expansion: _Expansion, parts: Any = None) -> ComplexPair:
    """The integral with its factor in front, in `parts` to an edge if they are given; 0 where it is not `usable`."""
    whole = parts is None
    total = _integral(dr, wavenumber, *expansion) if whole else _in_parts(dr, wavenumber, expansion, parts)
    gain = total.turned().scaled(area / (4.0 * dr.pi))
    return ComplexPair(dr.select(usable, gain.re, 0.0), dr.select(usable, gain.im, 0.0))


def _in_parts(dr: Any, wavenumber: Any, expansion: _Expansion, parts: Any) -> ComplexPair:
    """The mean of :func:`_integral` over parts^2 equal triangles, whose path lengths and strengths come from the
    `expansion` of the whole facet: a fraction of what it takes to find them anew."""
    Float = type(wavenumber)
    count = Float(parts)
    scale = 1.0 / count

    def corner(row: Any, column: Any) -> tuple[Any, ComplexPair]:
        return expansion.at((1.0 - row * scale, (row - column) * scale, column * scale))

    def step(index: Any, re: Any, im: Any) -> tuple[Any, Any, Any]:
        row, column, turned, last = lattice_triangle(dr, Float(index))
        ends = [
            corner(row, column),
            corner(row + 1.0, dr.select(turned, column + 1.0, column)),
            corner(last, column + 1.0),
        ]
        # Edges of the turned triangles run the other way round.
        own = expansion.sags
        sags = [dr.select(turned, own[(i + 2) % 3], own[i]) * scale * scale for i in range(3)]
        strengths = [strength for _, strength in ends]
        middle = (strengths[0] + strengths[1] + strengths[2]).scaled(1.0 / 3.0)
        changes = [strength - middle for strength in strengths]
        part = _integral(dr, wavenumber, [length for length, _ in ends], sags, middle, changes).scaled(scale * scale)
        return index + 1, re + part.re, im + part.im

    width = dr.width(wavenumber)
    start = (dr.zeros(type(parts), width), dr.zeros(Float, width), dr.zeros(Float, width))
    total = parts * parts
    _, re, im = dr.while_loop(start, lambda index, re, im: index < total, step)
    return ComplexPair(re, im)


def lattice_triangle(dr: Any, index: Any) -> tuple[Any, Any, Any, Any]:
    """Which of the equal triangles of a divided one `index` (a float) counts: row and column of its first corner,
    whether it is turned, and the row of its last corner.

    Row by row: row k holds k + 1 triangles that lie as the whole does, and k turned ones between them.
    """
    row = dr.floor(dr.sqrt(index + 0.5))
    place = index - row * row
    column = dr.floor(0.5 * place)
    turned = place > 2.0 * column + 0.5
    return row, column, turned, dr.select(turned, row, row + 1.0)
