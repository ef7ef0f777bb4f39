"""Gain of one triangle for one pair of elements, on Dr.Jit's float64 arrays: a facet, or a part of one."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from rfgen_sionna.tracing.integral.obliquity import (
    MIN_RELATIVE_STRENGTH,
    Medium,
    ScatteredWave,
    backscatter,
    transverse,
)
from rfgen_sionna.tracing.integral.quadratic import PathVariation, Quadratic, SlopeOrder, mean_of_three, variation_pairs
from rfgen_sionna.tracing.integral.simplex import Complex as ComplexPair

MAX_PATTERN_GRADIENT = 1.0
"""Bound of the logarithm of the pattern gain's change over a facet: real patterns are this steep only near nulls."""


_RATE_STEP = 1e-3
"""Share of a displacement for differences of the strength: error 1e-3, rounding 1e-13."""


class FacetLanes(NamedTuple):
    """Facet and elements of each lane."""

    cross: Any
    """Normal of the flat facet on Tx's side, of twice the area's length [m^2]."""
    turned: Any
    """Whether `cross` is opposite to the corners' orientation."""
    medium: Medium
    tx: Any
    rx: Any
    tx_field: Any
    rx_field: Any
    monostatic: bool
    pattern_gradient: tuple[Any, Any] | None
    """Gradient of the pattern gain's logarithm [1/m], and its origin [m]; None means constant gain."""


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
    """Gains of a triangle `p` at each of the `wavenumbers`, as if it were the whole facet, with slopes of order
    `slopes` over displacements `axes`, and the excess of its centroid's path over that of the `reference` point [m].
    `sagittas` are those of the edges of a bent facet, which is integrated in `parts` per edge."""
    t, r = surface.tx, surface.rx
    centre = (p[0] + p[1] + p[2]) / 3.0
    twice_area = dr.norm(surface.cross)
    inverse = dr.select(twice_area > 0, 1.0 / dr.select(twice_area > 0, twice_area, 1.0), 0.0)
    normal = surface.cross * inverse

    # Difference of path lengths without cancellation: |x|-|y| = (x-y).(x+y)/(|x|+|y|).
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
    k_in = from_tx * (1.0 / dr.maximum(distance_tx, 1e-30))
    k_out = to_rx * (1.0 / dr.maximum(distance_rx, 1e-30))
    if sagittas is None:  # an element in the facet's plane, the other behind it
        usable &= (dr.dot(normal, r - centre) > 0) & (dr.dot(normal, centre - t) < 0)

    lengths = [excess(corner, centre) for corner in p]
    # Linear less true path length in the middle of each edge.
    edges = [0.5 * (p[(i + 1) % 3] + p[(i + 2) % 3]) for i in range(3)]
    if sagittas is not None:
        edges = [edge + rise for edge, rise in zip(edges, sagittas, strict=True)]
    length_sagittas = [
        0.5 * (lengths[(i + 1) % 3] + lengths[(i + 2) % 3]) - excess(edge, centre) for i, edge in enumerate(edges)
    ]
    # Nodes of the strength: point, normal, area over that of the flat facet.
    places, facing = [(corner, normal, None) for corner in p], normal
    if sagittas is not None:
        sign = dr.select(surface.turned, -inverse, inverse)
        elements = [sign * _element(dr, p, sagittas, weight) for weight in _NODES]
        sizes = [dr.norm(element) for element in elements]
        facing, *tips = [each * (1.0 / dr.maximum(size, 1e-9)) for each, size in zip(elements, sizes, strict=True)]
        places = list(zip([*p, *edges], tips, sizes[1:], strict=True))

    # Relative changes over the facet are those for an element half way: the error is of second order.
    element = 0.5 * (t + r)
    nearest = 2.0 / dr.sqrt(spread)

    def at(point: Any, normal: Any) -> ComplexPair:
        fields = surface.tx_field, surface.rx_field
        return backscatter(dr, complex_type, surface.medium, normal, point - element, *fields, nearest)

    def everywhere(strength: Callable[[Any, Any], ComplexPair]) -> list[ComplexPair]:
        found = [(strength(point, normal), area_ratio) for point, normal, area_ratio in places]
        return [each if area_ratio is None else each.scaled(area_ratio) for each, area_ratio in found]

    strengths = everywhere(at)
    half_way = None if sagittas is not None and surface.monostatic else at(middle, facing)
    strength_sagittas = _strength_sagittas(strengths, None if sagittas is not None else half_way)
    if surface.monostatic:
        ratio = dr.square(dr.norm(middle - element)) / spread
        strengths = [each.scaled(ratio) for each in strengths]
        strength_sagittas = [each.scaled(ratio) for each in strength_sagittas]
        half_way = None if half_way is None else half_way.scaled(ratio)
    elif half_way is not None:
        e_tx, e_rx = transverse(dr, surface.tx_field, k_in), transverse(dr, surface.rx_field, k_out)
        given = dr, complex_type, surface.medium
        there = ScatteredWave(dr, vector, facing, k_in, e_tx, k_out, e_rx).obliquity(*given)
        back = ScatteredWave(dr, vector, facing, -k_out, e_rx, -k_in, e_tx).obliquity(*given)
        more = ComplexPair(there.re + back.re, there.im + back.im).scaled(0.5 / spread) - half_way
        if sagittas is not None:
            faced = (dr.dot(facing, k_in) < 0) & (dr.dot(facing, k_out) > 0)
            more = ComplexPair(dr.select(faced, more.re, 0.0), dr.select(faced, more.im, 0.0))
        strengths = [
            each + (more if area_ratio is None else more.scaled(area_ratio))
            for each, (_, _, area_ratio) in zip(strengths, places, strict=False)
        ]
        half_way = half_way + more
    if surface.pattern_gradient is not None:
        slope, gradient_origin = surface.pattern_gradient

        def pattern_gain(point: Any) -> Any:
            exponent = dr.dot(slope, point - gradient_origin)
            return dr.exp(dr.clip(exponent, -MAX_PATTERN_GRADIENT, MAX_PATTERN_GRADIENT))

        bent = half_way is None or sagittas is not None
        in_middle = None if half_way is None or bent else half_way.scaled(pattern_gain(middle))
        strengths = [each.scaled(pattern_gain(point)) for each, (point, _, _) in zip(strengths, places, strict=True)]
        strength_sagittas = _strength_sagittas(strengths, in_middle)
    quadratic = Quadratic(lengths, length_sagittas, strengths[:3], strength_sagittas)
    ways, path_curvatures = None, list[PathVariation]()
    if axes is not None:
        # Path lengths at the corners less that of the reference point, per unit of each displacement.
        directions = [dr.normalize(point - element) for point in (reference, *p)]
        ways = [PathVariation([dr.dot(axis, directions[0] - each) for each in directions[1:]]) for axis in axes]
        if sagittas is not None:
            over = [
                0.5 * (directions[1 + (i + 1) % 3] + directions[1 + (i + 2) % 3]) - dr.normalize(edge - element)
                for i, edge in enumerate(edges)
            ]
            ways = [
                PathVariation(way.corners, [dr.dot(axis, k) for k in over])
                for way, axis in zip(ways, axes, strict=True)
            ]
        if slopes == SlopeOrder.CURVATURE:
            distances = [dr.norm(point - element) for point in (reference, *p)]
            path_curvatures = [
                _path_curvatures(dr, axes[one], axes[other], directions, distances)
                for one, other in variation_pairs(len(axes))
            ]
    factor = dr.select(usable, twice_area / (8.0 * dr.pi), 0.0)
    rates = None
    if axes is not None:
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
        turned = (each.turned().scaled(factor) for each in terms)
        return [ComplexPair(dr.select(usable, each.re, 0.0), dr.select(usable, each.im, 0.0)) for each in turned]

    return [at_wavenumber(each) for each in wavenumbers], excess(centre, reference)


def _path_curvatures(dr: Any, one: Any, other: Any, directions: list[Any], distances: list[Any]) -> PathVariation:
    """Second slopes of path lengths at the corners, less that of the reference point, over two displacements of Tx and
    Rx. `directions` (unit vectors) and `distances` [m] from the elements start with the reference point."""
    first, *corners = (
        (dr.dot(one, other) - dr.dot(one, each) * dr.dot(other, each)) / (2.0 * dr.maximum(size, 1e-30))
        for each, size in zip(directions, distances, strict=True)
    )
    return PathVariation([each - first for each in corners])


def _rates(
    dr: Any, strength: Callable[[Any], ComplexPair], offset: Any, axes: list[Any], nearest: Any
) -> list[ComplexPair]:
    """Logarithmic derivative of the `strength` at an `offset` along each of the `axes` of the elements; that of the
    distance alone where the strength is next to none."""
    here = strength(offset)
    size = here.re * here.re + here.im * here.im
    largest = dr.square(0.5 * nearest)  # `nearest` is 2 over the distance
    representative = size > dr.square(MIN_RELATIVE_STRENGTH * largest)
    inverse = dr.select(representative, 1.0 / dr.select(representative, size, 1.0), 0.0)
    square = dr.maximum(dr.squared_norm(offset), 1e-30)
    found = []
    for axis in axes:
        # Both elements' displacements add up to the axis: each goes half of it.
        there = strength(offset - (0.5 * _RATE_STEP) * axis)
        rate = (there - here).times(ComplexPair(here.re * inverse, -here.im * inverse)).scaled(1.0 / _RATE_STEP)
        nearer = dr.dot(offset, axis) / square
        found.append(ComplexPair(dr.select(representative, rate.re, nearer), dr.select(representative, rate.im, 0.0)))
    return found


def _strength_sagittas(strengths: list[ComplexPair], middle: ComplexPair | None) -> list[ComplexPair]:
    """Sagittas of the strength on the three edges, from the nodes or from the strength in the `middle`."""
    if middle is not None:
        return [(middle - mean_of_three(strengths)).scaled(0.75)] * 3
    return [
        each - (strengths[(i + 1) % 3] + strengths[(i + 2) % 3]).scaled(0.5) for i, each in enumerate(strengths[3:])
    ]


_NODES = ((1 / 3, 1 / 3, 1 / 3), (1, 0, 0), (0, 1, 0), (0, 0, 1), (0, 0.5, 0.5), (0.5, 0, 0.5), (0.5, 0.5, 0))
"""Barycentric coordinates of the middle, the corners, and the middles of the edges opposite them."""


def _element(dr: Any, p: list[Any], sagittas: list[Any], weight: tuple[float, float, float]) -> Any:
    """Vector area element of the patch at barycentric coordinates `weight`, of twice the area's length."""
    slope = [
        sum(4 * weight[3 - i - k] * sagittas[k] for k in range(3) if k != i and weight[3 - i - k]) for i in range(3)
    ]
    return dr.cross(p[1] - p[0] + (slope[1] - slope[0]), p[2] - p[0] + (slope[2] - slope[0]))
