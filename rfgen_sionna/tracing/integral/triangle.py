"""The gain of a triangle that several elements look at, on Dr.Jit's float64 arrays: a facet, or a part of one."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from rfgen_sionna.tracing.integral.obliquity import Medium, ScatteredWave, backscatter, transverse
from rfgen_sionna.tracing.integral.quadratic import PathVariation, Quadratic, SlopeOrder, variation_pairs
from rfgen_sionna.tracing.integral.reflected import MirrorLanes, ReflectedStrength
from rfgen_sionna.tracing.integral.simplex import Complex as ComplexPair
from rfgen_sionna.tracing.integral.slabs import SlabStackLanes

MAX_PATTERN_GRADIENT = 1.0
"""Logarithm of the ratio by which the antennas' gain may change over a facet: patterns are not as steep for long."""


_STEP = 1e-3
"""Share of a displacement over which the change of a strength is differenced."""
_SIGNIFICANT = 0.01
"""Share of what a strength might be above which its change over itself tells anything."""


class FacetLanes(NamedTuple):
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
    walls: tuple[MirrorLanes | None, MirrorLanes | None] | None
    """By way of which Tx and Rx look at it: `tx` and `rx` with their fields are images then."""
    middle: Any
    """Of the facet [m]."""
    slopes: list[Any]
    """How its barycentric coordinates rise from there [1/m]; none where nobody looks through anything."""
    crossed: tuple[SlabStackLanes, SlabStackLanes]
    """Through what Tx and Rx look at it."""
    turn: ComplexPair | None
    """What takes the phase of the slabs' bulk away, as delays hold it."""
    with_pattern_gradient: tuple[Any, Any] | None
    """How the antennas' gain rises from a point on [1/m], and that point."""


def triangle_gain(
    dr: Any,
    vector: Any,
    complex_type: Any,
    surface: FacetLanes,
    p: list[Any],
    sagittas: list[Any] | None,
    wavenumbers: list[Any],
    reference: Any,
    axes: list[Any] | None,
    slopes: int,
    parts: Any = None,
) -> tuple[list[list[ComplexPair]], Any]:
    """At each of the `wavenumbers` the gain of a triangle `p` as if it were the whole facet, with its slopes if there
    are `axes`, those that `slopes` say (one of :class:`SlopeOrder`), and by how much its centroid's path exceeds that
    by
    way of the `reference` point [m]. `sagittas` are those of its edges, if it is bent; it may be integrated in `parts`
    to
    an edge then."""
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
        there = dr.maximum(dr.norm(from_t) + dr.norm(base_t), 1e-30)
        back = dr.maximum(dr.norm(from_r) + dr.norm(base_r), 1e-30)
        product = dr.dot(offset, from_t + base_t) * back + dr.dot(offset, from_r + base_r) * there
        return product / (there * back)

    middle = centre if sagittas is None else centre + (4 / 9) * (sagittas[0] + sagittas[1] + sagittas[2])
    from_tx, to_rx = middle - t, r - middle
    distance_tx, distance_rx = dr.norm(from_tx), dr.norm(to_rx)
    usable = (twice_area > 0) & (distance_tx > 1e-4) & (distance_rx > 1e-4)
    spread = dr.select(usable, distance_tx * distance_rx, 1.0)
    k_in, k_out = (
        way * (1.0 / dr.maximum(size, 1e-30)) for way, size in ((from_tx, distance_tx), (to_rx, distance_rx))
    )
    if sagittas is None or surface.walls is not None:  # an element in the facet's plane, the other behind it
        usable &= (dr.dot(normal, r - centre) > 0) & (dr.dot(normal, centre - t) < 0)

    lengths = [excess(corner, centre) for corner in p]
    # By how much a linear phase through the corners lies above the true one in the middle of each edge.
    edges = [0.5 * (p[(i + 1) % 3] + p[(i + 2) % 3]) for i in range(3)]
    if sagittas is not None:
        edges = [edge + rise for edge, rise in zip(edges, sagittas, strict=True)]
    length_sagittas = [
        0.5 * (lengths[(i + 1) % 3] + lengths[(i + 2) % 3]) - excess(edge, centre) for i, edge in enumerate(edges)
    ]
    # Where the strength is found, with the normal there and by how much the area is that of the flat facet.
    places, facing = [(corner, normal, None) for corner in p], normal
    if sagittas is not None:
        sign = dr.select(surface.turned, -inverse, inverse)
        elements = [sign * _element(dr, p, sagittas, weight) for weight in _NODES]
        sizes = [dr.norm(element) for element in elements]
        facing, *tips = [each * (1.0 / dr.maximum(size, 1e-9)) for each, size in zip(elements, sizes, strict=True)]
        places = list(zip([*p, *edges], tips, sizes[1:], strict=True))

    # How spreading, Fresnel coefficients and polarisation change over the facet is taken for an element half way
    # between Tx and Rx: the difference to the pair itself is of second order.
    element = 0.5 * (t + r)
    nearest = 2.0 / dr.sqrt(spread)

    def at(point: Any, normal: Any) -> ComplexPair:
        fields = surface.tx_field, surface.rx_field
        return backscatter(dr, complex_type, surface.medium, normal, point - element, *fields, nearest)

    def everywhere(strength: Callable[[Any, Any], ComplexPair]) -> list[ComplexPair]:
        found = [(strength(point, normal), interval) for point, normal, interval in places]
        return [each if interval is None else each.scaled(interval) for each, interval in found]

    if surface.walls is not None:  # the images may lie in very different directions
        by_wall = ReflectedStrength(dr, vector, complex_type, surface, middle, facing)
        strengths = everywhere(by_wall.at)
        strength_sagittas = _strength_sagittas(strengths, None if sagittas is not None else by_wall.at(middle, normal))
    else:
        strengths = everywhere(at)
        half_way = None if sagittas is not None and surface.monostatic else at(middle, facing)
        strength_sagittas = _strength_sagittas(strengths, None if sagittas is not None else half_way)
        if surface.monostatic:
            ratio = dr.square(dr.norm(middle - element)) / spread
            strengths, strength_sagittas = (
                [each.scaled(ratio) for each in some] for some in (strengths, strength_sagittas)
            )
            half_way = None if half_way is None else half_way.scaled(ratio)
        elif half_way is not None:
            e_tx, e_rx = transverse(dr, surface.tx_field, k_in), transverse(dr, surface.rx_field, k_out)
            there = ScatteredWave(dr, vector, facing, k_in, e_tx, k_out, e_rx).obliquity(
                dr, complex_type, surface.medium
            )
            back = ScatteredWave(dr, vector, facing, -k_out, e_rx, -k_in, e_tx).obliquity(
                dr, complex_type, surface.medium
            )
            more = ComplexPair(there.re + back.re, there.im + back.im).scaled(0.5 / spread) - half_way
            if sagittas is not None:
                faced = (dr.dot(facing, k_in) < 0) & (dr.dot(facing, k_out) > 0)
                more = ComplexPair(dr.select(faced, more.re, 0.0), dr.select(faced, more.im, 0.0))
            strengths = [
                each + (more if interval is None else more.scaled(interval))
                for each, (_, _, interval) in zip(strengths, places, strict=False)
            ]
            half_way = half_way + more
        if surface.with_pattern_gradient is not None:
            (slope, gradient_origin), points = (
                surface.with_pattern_gradient,
                [middle, *(point for point, _, _ in places)],
            )
            raised = [
                dr.exp(dr.clip(dr.dot(slope, each - gradient_origin), -MAX_PATTERN_GRADIENT, MAX_PATTERN_GRADIENT))
                for each in points
            ]
            strengths = [each.scaled(rise) for each, rise in zip(strengths, raised[1:], strict=True)]
            strength_sagittas = _strength_sagittas(
                strengths, None if half_way is None or sagittas is not None else half_way.scaled(raised[0])
            )
    quadratic = Quadratic(lengths, length_sagittas, strengths[:3], strength_sagittas)
    ways, path_curvatures = None, list[PathVariation]()
    if axes is not None:
        # Path lengths at the corners, beyond that by way of the point of reference, per unit of each displacement.
        occluders = [dr.normalize(point - element) for point in (reference, *p)]
        ways = [PathVariation([dr.dot(axis, occluders[0] - look) for look in occluders[1:]]) for axis in axes]
        if sagittas is not None:
            beside = [dr.normalize(edge - element) for edge in edges]
            over = [
                0.5 * (occluders[1 + (i + 1) % 3] + occluders[1 + (i + 2) % 3]) - look for i, look in enumerate(beside)
            ]
            ways = [
                way._replace(sagittas=[dr.dot(axis, each) for each in over])
                for way, axis in zip(ways, axes, strict=True)
            ]
        if slopes == SlopeOrder.CURVATURE:
            far = [dr.norm(point - element) for point in (reference, *p)]
            path_curvatures = [
                _path_curvatures(dr, axes[one], axes[other], occluders, far)
                for one, other in variation_pairs(len(axes))
            ]
    factor = dr.select(usable, twice_area / (8.0 * dr.pi), 0.0)
    rates = None
    if axes is not None:  # nearer is stronger, and so is what looks at the elements
        rates = _rates(dr, lambda offset: at(offset + element, facing), middle - element, axes, nearest)

    def at_wavenumber(wavenumber: Any) -> list[ComplexPair]:
        if parts is None:
            terms = quadratic.mean(dr, wavenumber, ways, slopes, path_curvatures)
        else:
            terms = quadratic.mean_in_parts(dr, wavenumber, parts, ways, slopes, path_curvatures)
        if rates is not None:
            count = len(rates)
            first = terms[2 : 2 + count]
            terms[2 : 2 + count] = [each + terms[0].times(rate) for each, rate in zip(first, rates, strict=True)]
            for k, (one, other) in enumerate(variation_pairs(count) if slopes >= SlopeOrder.SECOND else (), 2 + count):
                terms[k] = terms[k] + first[one].times(rates[other]) + first[other].times(rates[one])
        turned = [each.turned() for each in terms]
        return [
            ComplexPair(dr.select(usable, each.re * factor, 0.0), dr.select(usable, each.im * factor, 0.0))
            for each in turned
        ]

    return [at_wavenumber(each) for each in wavenumbers], excess(centre, reference)


def _path_curvatures(dr: Any, one: Any, other: Any, occluders: list[Any], far: list[Any]) -> PathVariation:
    """Second slopes of path lengths at the corners over two displacements of Tx and Rx together, or, as they are the
    same, of Tx from Rx; beyond that by way of the point of reference, which comes first among the `occluders`, unit
    vectors
    from the elements, and distances `far` [m]."""
    first, *corners = (
        (dr.dot(one, other) - dr.dot(one, look) * dr.dot(other, look)) / (2.0 * dr.maximum(size, 1e-30))
        for look, size in zip(occluders, far, strict=True)
    )
    return PathVariation([each - first for each in corners])


def _rates(
    dr: Any, strength: Callable[[Any], ComplexPair], offset: Any, axes: list[Any], nearest: Any
) -> list[ComplexPair]:
    """By how much the `strength` of what lies at an `offset` from the elements rises with their displacement along each
    of the axes, over itself; where there is next to none, as that of what is nearer alone."""
    here = strength(offset)
    size = here.re * here.re + here.im * here.im
    representative = size > dr.square(_SIGNIFICANT * dr.square(0.5 * nearest))  # that is 1 over the distance
    inverse = dr.select(representative, 1.0 / dr.select(representative, size, 1.0), 0.0)
    square = dr.maximum(dr.squared_norm(offset), 1e-30)
    found = []
    for axis in axes:
        # Both elements' displacements add up to the axis: each goes half of it.
        there = strength(offset - (0.5 * _STEP) * axis)
        rate = (there - here).times(ComplexPair(here.re * inverse, -here.im * inverse)).scaled(1.0 / _STEP)
        nearer = dr.dot(offset, axis) / square
        found.append(ComplexPair(dr.select(representative, rate.re, nearer), dr.select(representative, rate.im, 0.0)))
    return found


def _strength_sagittas(strengths: list[ComplexPair], middle: ComplexPair | None) -> list[ComplexPair]:
    """By how much the strength rises in the middle of the edge opposite each corner: from that at corners and middles
    of edges, or all alike, from that in the `middle` of the facet."""
    if middle is not None:
        return [(middle - (strengths[0] + strengths[1] + strengths[2]).scaled(1.0 / 3.0)).scaled(0.75)] * 3
    return [
        each - (strengths[(i + 1) % 3] + strengths[(i + 2) % 3]).scaled(0.5) for i, each in enumerate(strengths[3:])
    ]


_NODES = ((1 / 3, 1 / 3, 1 / 3), (1, 0, 0), (0, 1, 0), (0, 0, 1), (0, 0.5, 0.5), (0.5, 0, 0.5), (0.5, 0.5, 0))
"""Barycentric coordinates of the middle of a facet, of its corners and of the middles of the edges opposite them."""


def _element(dr: Any, p: list[Any], sagittas: list[Any], weight: tuple[float, float, float]) -> Any:
    """Vector element of area of the patch with corners `p` and `sagittas`, at barycentric coordinates `weight`, as
    long as
    twice a flat facet's area."""
    slope = [
        sum(4 * weight[3 - i - k] * sagittas[k] for k in range(3) if k != i and weight[3 - i - k]) for i in range(3)
    ]
    return dr.cross(p[1] - p[0] + (slope[1] - slope[0]), p[2] - p[0] + (slope[2] - slope[0]))
