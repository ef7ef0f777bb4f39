"""Means of exp(-j phi) and its moments over a triangle on which the phase phi is linear.

With barycentric coordinates l_i and corner phases p_i they are divided differences of f(x) = exp(-j x)
(Hermite-Genocchi): with G[x_0 ... x_n] = j^n f[x_0 ... x_n],

    <exp(-j phi)>         = 2 G[p_0, p_1, p_2]
    <l_i exp(-j phi)>     = 2 G[p_0, p_1, p_2, p_i]
    <l_i l_k exp(-j phi)> = 2 G[p_0, p_1, p_2, p_i, p_k]

For sorted phases a <= b <= c each reduces to integrals along the edges ab and bc, spherical Bessel functions of half
the phase difference, divided by c - a. A power series replaces it where c - a is small.

The growth of a moment is D = sum_i p_i d/dp_i of it. The D of a lower moment consists of higher ones; for the highest,
of two corners, (D + 1) of a quotient by c - a is D of its numerator over c - a.
"""

from __future__ import annotations

from typing import Any, NamedTuple

SERIES_SPREAD = 0.1
"""Spread of the phases [rad] below which the series holds: differences lose three digits at it."""
SERIES_TERMS = 7
"""Terms of the series: remainder below 1e-13 of the mean up to `SERIES_SPREAD`."""
_BESSEL_SERIES = 0.3
"""Argument below which the spherical Bessel functions are series of five terms: remainder below 1e-16."""


class Complex(NamedTuple):
    """Complex number as two real arrays: real factors and quarter turns are cheap."""

    re: Any
    im: Any

    def __add__(self, other: Any) -> Complex:
        return Complex(self.re + other.re, self.im + other.im)

    def __sub__(self, other: Complex) -> Complex:
        return Complex(self.re - other.re, self.im - other.im)

    def scaled(self, factor: Any) -> Complex:
        """Times a real factor."""
        return Complex(self.re * factor, self.im * factor)

    def turned(self) -> Complex:
        """Times j."""
        return Complex(-self.im, self.re)

    def times(self, other: Complex) -> Complex:
        """Complex product."""
        return Complex(self.re * other.re - self.im * other.im, self.re * other.im + self.im * other.re)


class Moments(NamedTuple):
    """Moments of the unit phasor over a triangle."""

    mean: Complex
    """<exp(-j phi)>"""
    corner: tuple[Complex, Complex, Complex]
    """<l_i exp(-j phi)> for corners 0, 1, 2"""
    edge: tuple[Complex, Complex, Complex]
    """<l_i l_k exp(-j phi)> for the edges opposite corners 0, 1, 2"""
    growth: tuple[Complex, ...] = ()
    """Growth of the moments of edges; empty unless requested."""

    def along(self, way: Any) -> list[Complex]:
        """<l_i s exp(-j phi)> for corners 0, 1, 2, with s linear and `way` at the corners."""
        edge = self.edge
        return [
            self.corner[i].scaled(way[i])
            + edge[i - 1].scaled(way[i - 2] - way[i])
            + edge[i - 2].scaled(way[i - 1] - way[i])
            for i in range(3)
        ]


def moments(dr: Any, p: tuple[Any, Any, Any], growth: bool = False) -> Moments:
    """Moments for corner phases `p` [rad], arrays of one Dr.Jit real type; `growth` adds that of the edges' moments."""
    low = dr.minimum(dr.minimum(p[0], p[1]), p[2])
    high = dr.maximum(dr.maximum(p[0], p[1]), p[2])
    middle = p[0] + p[1] + p[2] - low - high
    spread = high - low

    def by(rule: Any) -> Any:
        def values(*phases: Any) -> tuple[Any, ...]:
            found = rule(dr, *phases, growth)
            return tuple(value for each in (found.mean, *found.corner, *found.edge, *found.growth) for value in each)

        return values

    found = dr.if_stmt((low, middle, high), spread < SERIES_SPREAD, by(_by_series), by(_by_differences))
    mean, *rest = (Complex(*found[k : k + 2]) for k in range(0, len(found), 2))

    # Back from sorted order; equal phases have equal moments.
    def unsorted(values: list[Complex], index: int) -> Complex:
        is_low, is_high = p[index] == low, p[index] == high
        re = dr.select(is_low, values[0].re, dr.select(is_high, values[2].re, values[1].re))
        im = dr.select(is_low, values[0].im, dr.select(is_high, values[2].im, values[1].im))
        return Complex(re, im)

    corner, edge, *more = (
        (unsorted(each, 0), unsorted(each, 1), unsorted(each, 2))
        for each in (rest[k : k + 3] for k in range(0, len(rest), 3))
    )
    return Moments(mean, corner, edge, *more)


class _Edge(NamedTuple):
    """G over the corners x <= y of an edge, each as often as in the field's name."""

    xy: Complex
    xxy: Complex
    xyy: Complex
    xxyy: Complex


def _edge(dr: Any, h: Any, turn: Complex, middle: Complex) -> _Edge:
    """G for h = (y - x) / 2, `turn` = exp(-j h), `middle` = exp(-j (x + y) / 2)."""
    small = h < _BESSEL_SERIES
    inverse = 1.0 / dr.select(small, 1.0, h)
    h2 = h * h
    wave = -turn.im * inverse
    j0 = dr.select(small, 1 - h2 * (1 / 6) * (1 - h2 * (1 / 20) * (1 - h2 * (1 / 42) * (1 - h2 * (1 / 72)))), wave)
    series = (1 - h2 * (1 / 10) * (1 - h2 * (1 / 28) * (1 - h2 * (1 / 54) * (1 - h2 * (1 / 88))))) * (1 / 3)
    j1_over_h = dr.select(small, series, (wave - turn.re) * inverse * inverse)
    even, last = middle.scaled(0.5 * j0), middle.scaled(0.5 * j1_over_h)
    odd = last.turned().scaled(-h)  # -j j1/2 exp(-j m)
    return _Edge(even + even, even - odd, even + odd, last)


def _by_differences(dr: Any, a: Any, b: Any, c: Any, growth: bool) -> Moments:
    inverse = 1.0 / dr.maximum(c - a, SERIES_SPREAD)

    def turn(angle: Any) -> Complex:
        sin, cos = dr.sincos(angle)
        return Complex(cos, -sin)

    def divided(upper: Complex, lower: Complex) -> Complex:
        return (upper - lower).turned().scaled(inverse)

    first, second = 0.5 * (b - a), 0.5 * (c - b)
    along, on = turn(first), turn(second)
    middle = turn(0.5 * (a + b))
    ab, bc = _edge(dr, first, along, middle), _edge(dr, second, on, middle.times(along).times(on))
    abc = divided(bc.xy, ab.xy)
    aabc, abbc, abcc = divided(abc, ab.xxy), divided(bc.xxy, ab.xyy), divided(bc.xyy, abc)
    found = Moments(
        abc.scaled(2.0),
        (aabc.scaled(2.0), abbc.scaled(2.0), abcc.scaled(2.0)),
        (divided(bc.xxyy, abbc).scaled(2.0), divided(abcc, aabc).scaled(2.0), divided(abbc, ab.xxyy).scaled(2.0)),
    )
    if not growth:
        return found
    of_a, of_b, of_c = (each.turned().scaled(-1.0) for each in found.along((a, b, c)))

    def of_edge(edge: _Edge, mean_phase: Any) -> Complex:
        """Growth numerator of 2 G[x, x, y, y]."""
        return edge.xy - edge.xxyy.scaled(6.0) - edge.xxyy.turned().scaled(2.0 * mean_phase)

    grown = (
        divided(of_edge(bc, 0.5 * (b + c)), of_b) - found.edge[0],
        divided(of_c, of_a) - found.edge[1],
        divided(of_b, of_edge(ab, 0.5 * (a + b))) - found.edge[2],
    )
    return found._replace(growth=grown)


def _by_series(dr: Any, a: Any, b: Any, c: Any, growth: bool) -> Moments:
    """G[x_0 ... x_n] = exp(-j m) sum_k (-j)^k h_k / (k+n)! with h_k the complete homogeneous symmetric polynomials."""
    mean = (a + b + c) / 3.0
    x = (a - mean, b - mean, c - mean)
    e2, e3 = x[0] * x[1] + x[1] * x[2] + x[2] * x[0], x[0] * x[1] * x[2]
    h = [1.0 + 0.0 * mean, 0.0 * mean, -e2]
    for k in range(3, SERIES_TERMS + 1):
        h.append(e3 * h[k - 3] - e2 * h[k - 2])

    def with_another(polynomials: list[Any], value: Any) -> list[Any]:
        out = [polynomials[0]]
        for k in range(1, len(polynomials)):
            out.append(polynomials[k] + value * out[k - 1])
        return out

    sin, cos = dr.sincos(mean)
    carrier = Complex(cos, -sin)

    def total(polynomials: list[Any], order: int, grown: bool = False) -> Complex:
        factor = 2.0
        for n in range(2, order + 1):
            factor /= n
        sums = [0.0 * mean, 0.0 * mean]
        for k, term in enumerate(polynomials):
            sign = (1.0, -1.0, -1.0, 1.0)[k % 4] * (k if grown else 1)
            sums[k % 2] = sums[k % 2] + sign * factor * term
            factor /= order + k + 1
        return carrier.times(Complex(sums[0], sums[1]))

    four = [with_another(h, value) for value in x]
    of_edges = with_another(four[1], x[2]), with_another(four[0], x[2]), with_another(four[0], x[1])
    found = Moments(
        total(h, 2),
        (total(four[0], 3), total(four[1], 3), total(four[2], 3)),
        (total(of_edges[0], 4), total(of_edges[1], 4), total(of_edges[2], 4)),
    )
    if not growth:
        return found
    grown = [total(each, 4, True) - edge.turned().scaled(mean) for each, edge in zip(of_edges, found.edge, strict=True)]
    return found._replace(growth=tuple(grown))
