"""Physical optics of one facet, in closed form, on Dr.Jit's float64 arrays (LLVM or CUDA).

With Tx element at distance R_t, Rx element at R_r and k = 2 pi f / c the gain of a facet is

    a = (j / 4 pi) F A / (R_t R_r) <exp(-j k (R_t + R_r))>

where A is the area, <.> the mean over the facet and F the polarimetric obliquity: half the projection of
the Stratton-Chu integrand of the tangential fields (incident plus Fresnel-reflected) on the Rx element's field
direction (:mod:`rfgen_sionna.tracing.obliquity`). For a metal plate at normal incidence F = -1, so that an infinite
mirror at distance d gives the image-theory gain -lambda / (4 pi 2 d) exp(-j 2 k d).

The mean of a linear phase over a triangle has a closed form (:mod:`rfgen_sionna.tracing.simplex`). The phase of a facet
is not quite linear, nor is its return equally strong all over (distance, angle, polarisation). Both are small on a
facet, but neighbouring facets repeat the same residue: a grating, whose lobes add up in first order. So the quadratic
part of the phase is kept to first order, with its variance, and the strength to second
(:mod:`rfgen_sionna.tracing.quadratic`), which leaves an error of second order.

A bent facet is a quadratic patch (:mod:`rfgen_sionna.tracing.smooth`): its path length is quadratic all the same, and
its vector element of area, slope and stretch in one, weighs the strength at its corners and in its middle.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rfgen_sionna.records import SPEED_OF_LIGHT, ComplexArray, FloatArray, IntArray
from rfgen_sionna.scene.transfer import upload
from rfgen_sionna.tracing.arrays import drjit_types
from rfgen_sionna.tracing.obliquity import Media, Medium, Way, backscatter, drift, media_of_lanes, transverse
from rfgen_sionna.tracing.quadratic import Quadratic, flattened, lattice_triangle, number_of_terms, pairs, summed
from rfgen_sionna.tracing.reflected import Strength, Via, Wall, walls_of_lanes
from rfgen_sionna.tracing.simplex import Complex as ComplexPair
from rfgen_sionna.tracing.slabs import Crossed, Screens, bulk_length, screens_of_lanes
from rfgen_sionna.tracing.smooth import Bend

MOST_PULL = 1.0
"""Logarithm of the ratio by which the antennas' gain may change over a facet: patterns are not as steep for long."""


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
        """(slope, node, facet) of the gains over the wavenumber [m], over the `axes` and, second ones, over each two of
        them."""
        return self.terms[1:]


class Into:
    """Where the gains of `count` facets are written, those of some facets at a time."""

    def __init__(self, count: int) -> None:
        self.count = count
        self.index: NDArray[np.intp] | None = None
        """(facet,) places of those that come next; None is all."""
        self.found: Any = None
        self.tau: Any = None


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
    bend: Bend | None = None,
    screens: tuple[Screens, Screens] | None = None,
    axes: FloatArray | None = None,
    pull: FloatArray | None = None,
    aim: FloatArray | None = None,
    into: Into | None = None,
    origin: FloatArray | None = None,
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
        the point `aim` (facet, 3) [m], the centroid if it is None. None is that it does not. Neither with mirrors nor
        with slabs.
    into
        Other facets' gains, among which these are written; what is returned is all of them then. None is that there are
        no others.
    origin
        (3,) [m] of the frame that nodes, mirrors and slabs are in, in that of corners, `reference` and `aim`. None is
        that it is the same frame.

    Notes
    -----
    Facets of zero area, those that Tx and Rx see from different sides, and elements closer than 0.1 mm to the centroid
    give gain 0.
    """
    dr, types = drjit_types()
    Float, UInt32, Array3, Complex = types.Float64, types.UInt32, types.Array3f64, types.Complex2f64
    shape = (len(nodes), len(corners))
    if 0 in shape:
        return FacetGains(np.zeros((number_of_terms(axes), *shape), np.complex128), np.zeros(shape))

    def vectors(values: FloatArray, index: Any, count: int = 1) -> list[Any]:
        flat = upload(Float, np.asarray(values, np.float64))
        first = 3 * count * index
        return [Array3(*(dr.gather(Float, flat, first + 3 * k + i) for i in range(3))) for k in range(count)]

    def whole(values: ArrayLike, index: Any) -> Any:
        return dr.gather(UInt32, upload(UInt32, np.asarray(values, np.uint32)), index)

    wavenumbers = 2 * np.pi / SPEED_OF_LIGHT * np.asarray(nodes.frequency, np.float64)
    lane = dr.arange(UInt32, shape[0] * shape[1])
    facet_count = dr.opaque(UInt32, shape[1])
    facet, node = lane % facet_count, lane // facet_count
    whole_facets = parts is None or int(np.max(parts)) == 1
    if not whole_facets:
        # Lanes that are computed together take as long as the one of most parts: those of as many side by side.
        facet = whole(np.argsort(np.asarray(parts), kind="stable"), facet)
    start = None if origin is None else vectors(np.asarray(origin)[None], dr.zeros(UInt32, len(lane)))[0]

    def placed(points: FloatArray, count: int = 1) -> list[Any]:
        return [each if start is None else each - start for each in vectors(points, facet, count)]

    p = placed(corners, 3)
    (t,), (r,) = vectors(nodes.tx, node), vectors(nodes.rx, node)
    wavenumber = dr.gather(Float, upload(Float, wavenumbers), node)
    medium = media_of_lanes(dr, types, media, node, whole(material, facet), wavenumber)
    field_of_tx, field_of_rx = (Array3(*(dr.opaque(Float, float(x)) for x in f)) for f in (tx_field, rx_field))
    walls = None
    if via is not None:
        walls = first, last = walls_of_lanes(dr, types, via, facet, node, wavenumber)
        if first is not None:
            t, field_of_tx = first.image(dr, t), first.turned(dr, field_of_tx)
        if last is not None:
            r, field_of_rx = last.image(dr, r), last.turned(dr, field_of_rx)
    elif screens is not None:
        walls = (None, None)
    middle = (p[0] + p[1] + p[2]) / 3.0
    through = middle if reference is None else placed(reference)[0]
    cross = dr.cross(p[1] - p[0], p[2] - p[0])
    # What is bent may turn out of sight of one element and not of another: its side is the one that the radar sees.
    away = dr.dot(cross, middle if bend is not None and via is None else middle - t) > 0
    cross = dr.select(away, -cross, cross)
    rises = None
    if bend is not None:
        rises = vectors(bend.rises, facet, 3)
        if bend.lifts is not None:
            p = [corner + lift for corner, lift in zip(p, vectors(bend.lifts, facet, 3), strict=True)]
    crossed = Crossed([], []), Crossed([], [])
    turn, bulk = None, 0.0
    if screens is not None and walls is not None:

        def lanes(of: Screens, wall: Wall | None) -> Crossed:
            def mirrored(direction: Any) -> Any:
                return direction if wall is None else wall.turned(dr, direction)

            return screens_of_lanes(dr, types, of, mirrored, nodes.frequency, facet, node, wavenumber)

        there = lanes(screens[0], walls[0])
        crossed = there, there if via is None and screens[0] is screens[1] else lanes(screens[1], walls[1])
        ways = dr.normalize(through - t), dr.normalize(r - through)
        bulk = bulk_length(dr, crossed[0], ways[0]) + bulk_length(dr, crossed[1], ways[1])
        sin, cos = dr.sincos(wavenumber * bulk)
        turn = ComplexPair(cos, sin)
    ends = t, r, field_of_tx, field_of_rx
    pulled = None
    if pull is not None:
        pulled = vectors(pull, facet)[0], middle if aim is None else placed(aim)[0]
    surface = _Surface(cross, away, medium, *ends, monostatic, walls, crossed, turn, pulled)

    moved = None if axes is None else [Array3(*(dr.opaque(Float, float(x)) for x in axis)) for axis in axes]

    if parts is None or whole_facets or rises is not None:
        each = None if parts is None or whole_facets else whole(parts, facet)
        terms, excess = _triangle(dr, Array3, Complex, surface, p, rises, wavenumber, through, moved, each)
        if reference is not None or (bend is not None and bend.lifts is not None):
            terms = _carried(dr, terms, wavenumber, excess)
    else:
        count = Float(whole(parts, facet))

        def lattice(row: Any, column: Any) -> Any:
            return p[0] + (row / count) * (p[1] - p[0]) + (column / count) * (p[2] - p[1])

        def step(index: Any, *sums: Any) -> tuple[Any, ...]:
            row, column, turned, last = lattice_triangle(dr, Float(index))
            part = [
                lattice(row, column),
                lattice(row + 1.0, dr.select(turned, column + 1.0, column)),
                lattice(last, column + 1.0),
            ]
            terms, excess = _triangle(dr, Array3, Complex, surface, part, None, wavenumber, through, moved)
            found = [each.scaled(1.0 / (count * count)) for each in _carried(dr, terms, wavenumber, excess)]
            return index + 1, *(a + b for a, b in zip(sums, flattened(found), strict=True))

        total = whole(np.asarray(parts) ** 2, facet)
        terms = summed(dr, Float, total, step, number_of_terms(axes), len(lane))
    if (
        axes is not None and media.drift
    ):  # the integral's slope over the wavenumber is that for media that stay the same
        normal = cross / dr.maximum(dr.norm(cross), 1e-30)
        known = node, whole(material, facet), wavenumber, normal, middle - 0.5 * (t + r)
        terms[1] = terms[1] + terms[0].times(drift(dr, types, media, *known, (field_of_tx, field_of_rx)))
    length = dr.norm(through - t) + dr.norm(r - through) + bulk
    into = into or Into(shape[1])
    shape = shape[0], into.count
    if into.found is None:
        into.found, into.tau = (
            dr.empty(Float, 2 * len(terms) * shape[0] * shape[1]),
            dr.empty(Float, shape[0] * shape[1]),
        )
    # Written as NumPy's complex numbers lie in memory, which saves copying them.
    place = facet if into.index is None else whole(into.index, facet)
    place, size = node * dr.opaque(UInt32, shape[1]) + place, dr.opaque(UInt32, shape[0] * shape[1])
    for k, value in enumerate(flattened(terms)):
        dr.scatter(into.found, value, 2 * (place + k // 2 * size) + k % 2, mode=dr.ReduceMode.Permute)
    dr.scatter(into.tau, length / SPEED_OF_LIGHT, place, mode=dr.ReduceMode.Permute)
    dr.eval(into.found, into.tau)
    found, tau = into.found.numpy(), into.tau.numpy()
    return FacetGains(found.view(np.complex128).reshape(len(terms), *shape), tau.reshape(shape))


def _carried(dr: Any, terms: list[ComplexPair], wavenumber: Any, excess: Any) -> list[ComplexPair]:
    """Gain and slopes of a point whose path exceeds that of the point of reference by `excess` [m], from there."""
    sin, cos = dr.sincos(-wavenumber * excess)
    carrier = ComplexPair(cos, sin)
    if len(terms) > 1:
        terms = [terms[0], terms[1] - terms[0].turned().scaled(excess), *terms[2:]]
    return [each.times(carrier) for each in terms]


class _Surface(NamedTuple):
    """A facet and the elements that look at it, lane by lane."""

    cross: Any
    """Normal of the flat facet towards the Tx element, twice its area long [m^2]."""
    turned: Any
    """Whether that is the other way round than its corners say."""
    medium: Medium
    tx: Any
    rx: Any
    tx_field: Any
    rx_field: Any
    monostatic: bool
    walls: tuple[Wall | None, Wall | None] | None
    """By way of which Tx and Rx look at it: `tx` and `rx` with their fields are images then."""
    crossed: tuple[Crossed, Crossed]
    """Through what they do."""
    turn: ComplexPair | None
    """What takes the phase of the slabs' bulk away, as delays hold it."""
    pulled: tuple[Any, Any] | None
    """How the antennas' gain rises from a point on [1/m], and that point."""


def _triangle(
    dr: Any,
    vector: Any,
    complex_type: Any,
    surface: _Surface,
    p: list[Any],
    rises: list[Any] | None,
    wavenumber: Any,
    reference: Any,
    axes: list[Any] | None,
    parts: Any = None,
) -> tuple[list[ComplexPair], Any]:
    """Gain of a triangle `p` as if it were the whole facet, with its slopes if there are `axes`, and by how much its
    centroid's path exceeds that by way of the `reference` point [m]. `rises` are those of its edges, if it is bent; it
    may be integrated in `parts` to an edge then."""
    t, r = surface.tx, surface.rx
    centre = (p[0] + p[1] + p[2]) / 3.0
    twice_area = dr.norm(surface.cross)
    inverse = dr.select(twice_area > 0, 1.0 / dr.select(twice_area > 0, twice_area, 1.0), 0.0)
    normal = surface.cross * inverse

    # Path length at a point less that at another, without cancellation: |x|-|y| = (x-y).(x+y)/(|x|+|y|).
    def excess(point: Any, origin: Any) -> Any:
        offset = point - origin
        from_t, from_r = point - t, point - r
        base_t, base_r = origin - t, origin - r
        return dr.dot(offset, from_t + base_t) / dr.maximum(dr.norm(from_t) + dr.norm(base_t), 1e-30) + dr.dot(
            offset, from_r + base_r
        ) / dr.maximum(dr.norm(from_r) + dr.norm(base_r), 1e-30)

    middle = centre if rises is None else centre + (4 / 9) * (rises[0] + rises[1] + rises[2])
    from_tx, to_rx = middle - t, r - middle
    distance_tx, distance_rx = dr.norm(from_tx), dr.norm(to_rx)
    usable = (twice_area > 0) & (distance_tx > 1e-4) & (distance_rx > 1e-4)
    spread = dr.select(usable, distance_tx * distance_rx, 1.0)
    k_in, k_out = from_tx / dr.maximum(distance_tx, 1e-30), to_rx / dr.maximum(distance_rx, 1e-30)
    if rises is None or surface.walls is not None:  # an element in the facet's plane, the other behind it
        usable &= (dr.dot(normal, r - centre) > 0) & (dr.dot(normal, centre - t) < 0)

    lengths = [excess(corner, centre) for corner in p]
    # By how much a linear phase through the corners lies above the true one in the middle of each edge.
    edges = [0.5 * (p[(i + 1) % 3] + p[(i + 2) % 3]) for i in range(3)]
    if rises is not None:
        edges = [edge + rise for edge, rise in zip(edges, rises, strict=True)]
    sags = [0.5 * (lengths[(i + 1) % 3] + lengths[(i + 2) % 3]) - excess(edge, centre) for i, edge in enumerate(edges)]
    # Where the strength is found, with the normal there and by how much the area is that of the flat facet.
    places, facing = [(corner, normal, None) for corner in p], normal
    if rises is not None:
        sign = dr.select(surface.turned, -inverse, inverse)
        elements = [sign * _element(dr, p, rises, weight) for weight in _NODES]
        sizes = [dr.norm(element) for element in elements]
        facing, *tips = [element / dr.maximum(size, 1e-9) for element, size in zip(elements, sizes, strict=True)]
        places = list(zip([*p, *edges], tips, sizes[1:], strict=True))

    # How spreading, Fresnel coefficients and polarisation change over the facet is taken for an element half way
    # between Tx and Rx: the difference to the pair itself is of second order.
    element = 0.5 * (t + r)
    floor = 0.5 * dr.sqrt(spread)

    def at(point: Any, normal: Any) -> ComplexPair:
        fields = surface.tx_field, surface.rx_field
        return backscatter(dr, complex_type, surface.medium, normal, point - element, *fields, floor)

    def everywhere(strength: Callable[[Any, Any], ComplexPair]) -> list[ComplexPair]:
        found = [(strength(point, normal), stretch) for point, normal, stretch in places]
        return [each if stretch is None else each.scaled(stretch) for each, stretch in found]

    if surface.walls is not None:  # the images may lie in very different directions
        by_wall = Strength(dr, vector, complex_type, surface, middle, facing)
        strengths = everywhere(by_wall.at)
        swells = _swells(strengths, None if rises is not None else by_wall.at(middle, normal))
    else:
        strengths = everywhere(at)
        half_way = None if rises is not None and surface.monostatic else at(middle, facing)
        swells = _swells(strengths, None if rises is not None else half_way)
        if surface.monostatic:
            ratio = dr.square(dr.norm(middle - element)) / spread
            strengths, swells = ([each.scaled(ratio) for each in some] for some in (strengths, swells))
            half_way = None if half_way is None else half_way.scaled(ratio)
        elif half_way is not None:
            e_tx, e_rx = transverse(dr, surface.tx_field, k_in), transverse(dr, surface.rx_field, k_out)
            there = Way(dr, vector, facing, k_in, e_tx, k_out, e_rx).obliquity(dr, complex_type, surface.medium)
            back = Way(dr, vector, facing, -k_out, e_rx, -k_in, e_tx).obliquity(dr, complex_type, surface.medium)
            more = ComplexPair(there.re + back.re, there.im + back.im).scaled(0.5 / spread) - half_way
            if rises is not None:
                faced = (dr.dot(facing, k_in) < 0) & (dr.dot(facing, k_out) > 0)
                more = ComplexPair(dr.select(faced, more.re, 0.0), dr.select(faced, more.im, 0.0))
            strengths = [
                each + (more if stretch is None else more.scaled(stretch))
                for each, (_, _, stretch) in zip(strengths, places, strict=False)
            ]
            half_way = half_way + more
        if surface.pulled is not None:
            (slope, aim), points = surface.pulled, [middle, *(point for point, _, _ in places)]
            raised = [dr.exp(dr.clip(dr.dot(slope, each - aim), -MOST_PULL, MOST_PULL)) for each in points]
            strengths = [each.scaled(rise) for each, rise in zip(strengths, raised[1:], strict=True)]
            swells = _swells(strengths, None if half_way is None or rises is not None else half_way.scaled(raised[0]))
    quadratic = Quadratic(lengths, sags, strengths[:3], swells)
    ways = None
    if axes is not None:
        # Path lengths at the corners, beyond that by way of the point of reference, per unit of each displacement.
        looks = [dr.normalize(point - element) for point in (reference, *p)]
        ways = [[dr.dot(axis, looks[0] - look) for look in looks[1:]] for axis in axes]
    if parts is None:
        terms = quadratic.mean(dr, wavenumber, ways)
    else:
        terms = quadratic.mean_in_parts(dr, wavenumber, parts, ways)
    if axes is not None:  # nearer is stronger
        nearer, count = [dr.dot(middle - element, axis) / spread for axis in axes], len(axes)
        first = terms[2 : 2 + count]
        terms[2 : 2 + count] = [each + terms[0].scaled(more) for each, more in zip(first, nearer, strict=True)]
        for k, (one, other) in enumerate(pairs(count), 2 + count):
            terms[k] = terms[k] + first[one].scaled(nearer[other]) + first[other].scaled(nearer[one])
    factor = dr.select(usable, twice_area / (8.0 * dr.pi), 0.0)
    terms = [each.turned() for each in terms]
    terms = [
        ComplexPair(dr.select(usable, each.re * factor, 0.0), dr.select(usable, each.im * factor, 0.0))
        for each in terms
    ]
    return terms, excess(centre, reference)


def _swells(strengths: list[ComplexPair], middle: ComplexPair | None) -> list[ComplexPair]:
    """By how much the strength rises in the middle of the edge opposite each corner: from that at corners and middles
    of edges, or all alike, from that in the `middle` of the facet."""
    if middle is not None:
        return [(middle - (strengths[0] + strengths[1] + strengths[2]).scaled(1.0 / 3.0)).scaled(0.75)] * 3
    return [
        each - (strengths[(i + 1) % 3] + strengths[(i + 2) % 3]).scaled(0.5) for i, each in enumerate(strengths[3:])
    ]


_NODES = ((1 / 3, 1 / 3, 1 / 3), (1, 0, 0), (0, 1, 0), (0, 0, 1), (0, 0.5, 0.5), (0.5, 0, 0.5), (0.5, 0.5, 0))
"""Barycentric coordinates of the middle of a facet, of its corners and of the middles of the edges opposite them."""


def _element(dr: Any, p: list[Any], rises: list[Any], weight: tuple[float, float, float]) -> Any:
    """Vector element of area of the patch with corners `p` and `rises`, at barycentric coordinates `weight`, as long as
    twice a flat facet's area."""
    slope = [sum(4 * weight[3 - i - k] * rises[k] for k in range(3) if k != i and weight[3 - i - k]) for i in range(3)]
    return dr.cross(p[1] - p[0] + (slope[1] - slope[0]), p[2] - p[0] + (slope[2] - slope[0]))
