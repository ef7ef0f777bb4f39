"""Integrals of w exp(-j k s) over triangles on which the path length s and the strength w are quadratic.

Both are known at the corners and to second order between them. The quadratic part of the phase is kept to first order,
and of second order the mean over the triangle, its variance, which is all of it where the linear part is small; where
it is large the triangle is integrated in parts, each with its own corners.
"""

from __future__ import annotations

from collections.abc import Sequence, Sized
from enum import IntEnum
from typing import Any, NamedTuple

from rfgen_sionna.tracing.integral.simplex import Complex as ComplexPair
from rfgen_sionna.tracing.integral.simplex import Moments, moments

_MOST_DAMPED = 2.0
"""What bulges by several radians is not to fade altogether: finer parts are to tell that it is wrong."""


class SlopeOrder(IntEnum):
    """Which slopes of a mean there are."""

    FIRST = 0
    """Over the wavenumber and over each of the ways."""
    SECOND = 1
    """Over each two ways as well."""
    CURVATURE = 2
    """And over path lengths of second order, one for each two ways."""


class PathVariation(NamedTuple):
    """A path length [m] that is added to the others, per unit of something."""

    corners: list[Any]
    """At the corners."""
    sagittas: list[Any] | None = None
    """By how much it lies above the mean of its ends in the middle of the edge opposite each corner; None: nowhere."""

    def at(self, weight: tuple[Any, Any, Any]) -> Any:
        """At barycentric coordinates."""
        total = sum(w * each for w, each in zip(weight, self.corners, strict=True))
        if self.sagittas is not None:
            for i, rise in enumerate(self.sagittas):
                total = total + 4.0 * weight[(i + 1) % 3] * weight[(i + 2) % 3] * rise
        return total

    @property
    def mean(self) -> Any:
        """Over the triangle."""
        total = self.corners[0] + self.corners[1] + self.corners[2]
        if self.sagittas is not None:  # <4 l_i l_k> = 1/3
            total = total + self.sagittas[0] + self.sagittas[1] + self.sagittas[2]
        return total / 3.0


class Quadratic(NamedTuple):
    """Path length and strength over a triangle."""

    lengths: list[Any]
    """Path length at the corners [m], less that at a point of reference."""
    length_sagittas: list[Any]
    """By how much a linear path length lies above the true one in the middle of the edge opposite each corner [m]."""
    strengths: list[ComplexPair]
    """At the corners."""
    strength_sagittas: list[ComplexPair]
    """By how much the strength in the middle of the edge opposite each corner lies above the mean of its ends."""

    def at(self, weight: tuple[Any, Any, Any]) -> tuple[Any, ComplexPair]:
        """Path length [m] and strength at barycentric coordinates."""
        length, strength = 0.0, ComplexPair(0.0, 0.0)
        for i in range(3):
            product = 4.0 * weight[(i + 1) % 3] * weight[(i + 2) % 3]
            length = length + weight[i] * self.lengths[i] - product * self.length_sagittas[i]
            strength = strength + self.strengths[i].scaled(weight[i]) + self.strength_sagittas[i].scaled(product)
        return length, strength

    def mean(
        self,
        dr: Any,
        wavenumber: Any,
        ways: Sequence[PathVariation] | None = None,
        slopes: int = SlopeOrder.SECOND,
        path_curvatures: Sequence[PathVariation] = (),
    ) -> list[ComplexPair]:
        """Mean of w exp(-j k s), to first order in the sags and with their variance; with `ways` its slopes as well.

        These are those over the wavenumber k [m] and over each of the ways; then, where `slopes` say so, second ones
        over each two ways (:func:`variation_pairs`), and first ones over the `path_curvatures`, of which there is one
        for each two. Of the sags' share in those over ways and bows the mean over the triangle is kept.
        """
        total, found, bent, damped, over_wavenumber = self._mean(dr, wavenumber, ways is not None)
        if ways is None:
            return [total]
        swell, middle = self._means()
        strengths = [each + swell for each in self.strengths]
        means = [wavenumber * way.mean for way in ways]
        moved = [found.along(way.corners) for way in ways]

        def over(way: PathVariation, mean: Any, moments: list[ComplexPair]) -> ComplexPair:
            a, b, c = (strength.times(each) for strength, each in zip(strengths, moments, strict=True))
            total = bent.scaled(mean) + a + b + c
            if way.sagittas is not None:
                a, b, c = (edge.scaled(4.0 * rise) for edge, rise in zip(found.edge, way.sagittas, strict=True))
                total = total + (a + b + c).times(middle + swell)
            return total.turned().scaled(-wavenumber * damped)

        firsts = [over(*each) for each in zip(ways, means, moved, strict=True)]
        seconds = []
        for one, other in variation_pairs(len(ways)) if slopes >= SlopeOrder.SECOND else ():
            a, b, c = (each.scaled(at) for each, at in zip(moved[other], ways[one].corners, strict=True))
            both = (a + b + c).times(middle + swell).scaled(wavenumber)
            seconds.append((both + bent.scaled(means[one] * means[other])).scaled(-wavenumber * damped))
        sagitta_error = [
            over(edge_curvature, wavenumber * edge_curvature.mean, found.along(edge_curvature.corners))
            for edge_curvature in path_curvatures
        ]
        return [total, over_wavenumber, *firsts, *seconds, *sagitta_error]

    def _means(self) -> tuple[ComplexPair, ComplexPair]:
        """Of swells and of strengths."""
        swell = (self.strength_sagittas[0] + self.strength_sagittas[1] + self.strength_sagittas[2]).scaled(1.0 / 3.0)
        return swell, (self.strengths[0] + self.strengths[1] + self.strengths[2]).scaled(1.0 / 3.0)

    def _mean(
        self, dr: Any, wavenumber: Any, slope: bool
    ) -> tuple[ComplexPair, Moments, ComplexPair, Any, ComplexPair]:
        """The mean, the moments of the linear part of the phase, what the sags have in it, over the wavenumber and not
        damped, what damps all, and, if asked for, the slope over the wavenumber."""
        mean_sag = (
            self.length_sagittas[0] + self.length_sagittas[1] + self.length_sagittas[2]
        ) / 3.0  # <4 l_i l_k> = 1/3
        phases = tuple(wavenumber * (length - mean_sag) for length in self.lengths)
        found = moments(dr, phases, slope)
        swell, middle = self._means()

        def bending(mean: ComplexPair, edge: tuple[ComplexPair, ...]) -> ComplexPair:
            total = edge[0].scaled(4 * self.length_sagittas[0]) + edge[1].scaled(4 * self.length_sagittas[1])
            return (middle + swell).times(
                (total + edge[2].scaled(4 * self.length_sagittas[2]) - mean.scaled(mean_sag)).turned()
            )

        def straight(corner: Sequence[ComplexPair], edge: tuple[ComplexPair, ...]) -> ComplexPair:
            total = ComplexPair(0.0, 0.0)
            for i in range(3):
                total = (
                    total + self.strengths[i].times(corner[i]) + self.strength_sagittas[i].times(edge[i].scaled(4.0))
                )
            return total

        bent = bending(found.mean, found.edge)
        total = bent.scaled(wavenumber) + straight(found.corner, found.edge)
        a, b, c = self.length_sagittas
        # <16 l_i^2 l_k^2> - 1/9 = 1/15, <16 l_i^2 l_k l_m> - 1/9 = -1/45
        variance = (a * a + b * b + c * c) / 15.0 - (a * b + b * c + c * a) * (2.0 / 45.0)
        fading = 0.5 * wavenumber * wavenumber * variance
        damped = dr.exp(-dr.minimum(fading, _MOST_DAMPED))
        over_wavenumber = ComplexPair(0.0, 0.0)
        if slope:
            corner = [each.turned().scaled(-1.0) for each in found.along(phases)]
            mean = corner[0] + corner[1] + corner[2]
            grown = (bent + bending(mean, found.growth)).scaled(wavenumber) + straight(corner, found.growth)
            fades = dr.select(fading < _MOST_DAMPED, wavenumber * variance, 0.0)
            over_wavenumber = (grown.scaled(1.0 / wavenumber) - total.scaled(fades)).scaled(damped)
        return total.scaled(damped), found, bent, damped, over_wavenumber

    def mean_in_parts(
        self,
        dr: Any,
        wavenumber: Any,
        parts: Any,
        ways: Sequence[PathVariation] | None = None,
        slopes: int = SlopeOrder.SECOND,
        path_curvatures: Sequence[PathVariation] = (),
    ) -> list[ComplexPair]:
        """The same, each edge divided into so many `parts`."""
        Float = type(wavenumber)
        count = Float(parts)
        scale = 1.0 / count

        def step(index: Any, *sums: Any) -> tuple[Any, ...]:
            row, column, turned, last = lattice_triangle(dr, Float(index))
            places = [
                (1.0 - x * scale, (x - y) * scale, y * scale)
                for x, y in ((row, column), (row + 1.0, dr.select(turned, column + 1.0, column)), (last, column + 1.0))
            ]
            ends = [self.at(place) for place in places]

            # Edges of the turned triangles run the other way round.
            def own(values: list[Any]) -> list[Any]:
                return [dr.select(turned, values[(i + 2) % 3], values[i]) * scale * scale for i in range(3)]

            strength_sagittas = zip(
                own([each.re for each in self.strength_sagittas]),
                own([each.im for each in self.strength_sagittas]),
                strict=True,
            )
            piece = Quadratic(
                [length for length, _ in ends],
                own(self.length_sagittas),
                [strength for _, strength in ends],
                [ComplexPair(*each) for each in strength_sagittas],
            )

            def there(of: Sequence[PathVariation]) -> list[PathVariation]:
                sagittas = [None if each.sagittas is None else own(each.sagittas) for each in of]
                return [
                    PathVariation([each.at(at) for at in places], rise) for each, rise in zip(of, sagittas, strict=True)
                ]

            mean = piece.mean(dr, wavenumber, None if ways is None else there(ways), slopes, there(path_curvatures))
            found = [part.scaled(scale * scale) for part in mean]
            return index + 1, *(a + b for a, b in zip(sums, flatten_terms(found), strict=True))

        return sum_terms(dr, Float, parts * parts, step, number_of_terms(ways, slopes), dr.width(wavenumber))


def variation_pairs(count: int) -> list[tuple[int, int]]:
    """Which two of `count` ways second slopes are over."""
    return [(one, other) for one in range(count) for other in range(one, count)]


def number_of_terms(ways: Sized | None, slopes: int = SlopeOrder.SECOND) -> int:
    """Length of what :meth:`Quadratic.mean` returns."""
    return 1 if ways is None else 2 + len(ways) + slopes * len(variation_pairs(len(ways)))


def flatten_terms(numbers: Sequence[ComplexPair]) -> list[Any]:
    return [value for each in numbers for value in each]


def sum_terms(dr: Any, real: Any, total: Any, step: Any, count: int, width: int) -> list[ComplexPair]:
    """Sums of `count` complex numbers over `step` (index, real and imaginary parts so far) from 0 to `total`."""
    start = (dr.zeros(type(total), width), *(dr.zeros(real, width) for _ in range(2 * count)))
    _, *sums = dr.while_loop(start, lambda index, *_: index < total, step)
    return [ComplexPair(*sums[k : k + 2]) for k in range(0, 2 * count, 2)]


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
