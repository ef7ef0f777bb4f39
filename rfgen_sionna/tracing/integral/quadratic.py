"""Integrals of w exp(-j k s) over triangles on which the path length s and the strength w are quadratic.

The quadratic part of the phase is kept to first order, and its variance to second order. That is all of the second
order where the linear part is small; where it is large, the triangle is integrated in parts.
"""

from __future__ import annotations

from collections.abc import Sequence, Sized
from enum import IntEnum
from typing import Any, NamedTuple

from rfgen_sionna.tracing.integral.simplex import Complex as ComplexPair
from rfgen_sionna.tracing.integral.simplex import Moments, moments

_MAX_DAMPING = 2.0
"""Largest exponent of the damping by the variance: a phase bulge of radians stays visible as an error."""


class SlopeOrder(IntEnum):
    """Slopes of a mean."""

    FIRST = 0
    """Over the wavenumber and over each path variation."""
    SECOND = 1
    """Also over each pair of path variations."""
    CURVATURE = 2
    """Also over each path curvature, one per pair of path variations."""


class PathVariation(NamedTuple):
    """Change of a path length [m] per unit of a displacement."""

    corners: list[Any]
    """At the three corners."""
    sagittas: list[Any] | None = None
    """Excess over the mean of the ends in the middle of the edge opposite each corner; None counts as zero."""

    def at(self, weight: tuple[Any, Any, Any]) -> Any:
        """Value at barycentric coordinates."""
        total = sum(w * each for w, each in zip(weight, self.corners, strict=True))
        if self.sagittas is not None:
            for i, rise in enumerate(self.sagittas):
                total = total + 4.0 * weight[(i + 1) % 3] * weight[(i + 2) % 3] * rise
        return total

    @property
    def mean(self) -> Any:
        """Mean over the triangle."""
        total = self.corners[0] + self.corners[1] + self.corners[2]
        if self.sagittas is not None:  # <4 l_i l_k> = 1/3
            total = total + self.sagittas[0] + self.sagittas[1] + self.sagittas[2]
        return total / 3.0


class Quadratic(NamedTuple):
    """Path length and strength over a triangle."""

    lengths: list[Any]
    """Path lengths at the corners less that at a reference point [m]."""
    length_sagittas: list[Any]
    """Linear less true path length in the middle of the edge opposite each corner [m]."""
    strengths: list[ComplexPair]
    """Strength at the corners."""
    strength_sagittas: list[ComplexPair]
    """Strength in the middle of the edge opposite each corner, less the mean of its ends."""

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
        """Mean of w exp(-j k s), and its slopes if there are path variations `ways`: over the wavenumber k [m] and over
        each of the `ways`, then by `slopes` over each pair (:func:`variation_pairs`) and over each of the
        `path_curvatures`. Slopes over `ways` and `path_curvatures` keep the mean of the sagittas' share."""
        total, found, bent, damping, over_wavenumber = self._mean(dr, wavenumber, ways is not None)
        if ways is None:
            return [total]
        mean_sagitta, middle = self._means()
        strengths = [each + mean_sagitta for each in self.strengths]
        means = [wavenumber * way.mean for way in ways]
        moved = [found.along(way.corners) for way in ways]

        def over(way: PathVariation, mean: Any, moments: list[ComplexPair]) -> ComplexPair:
            a, b, c = (strength.times(each) for strength, each in zip(strengths, moments, strict=True))
            total = bent.scaled(mean) + a + b + c
            if way.sagittas is not None:
                a, b, c = (edge.scaled(4.0 * rise) for edge, rise in zip(found.edge, way.sagittas, strict=True))
                total = total + (a + b + c).times(middle + mean_sagitta)
            return total.turned().scaled(-wavenumber * damping)

        firsts = [over(*each) for each in zip(ways, means, moved, strict=True)]
        seconds = []
        for one, other in variation_pairs(len(ways)) if slopes >= SlopeOrder.SECOND else ():
            a, b, c = (each.scaled(at) for each, at in zip(moved[other], ways[one].corners, strict=True))
            both = (a + b + c).times(middle + mean_sagitta).scaled(wavenumber)
            seconds.append((both + bent.scaled(means[one] * means[other])).scaled(-wavenumber * damping))
        curvatures = [over(each, wavenumber * each.mean, found.along(each.corners)) for each in path_curvatures]
        return [total, over_wavenumber, *firsts, *seconds, *curvatures]

    def _means(self) -> tuple[ComplexPair, ComplexPair]:
        """Means of the strength's sagittas and of the corners' strengths."""
        return mean_of_three(self.strength_sagittas), mean_of_three(self.strengths)

    def _mean(
        self, dr: Any, wavenumber: Any, slope: bool
    ) -> tuple[ComplexPair, Moments, ComplexPair, Any, ComplexPair]:
        """Mean, moments of the linear phase, undamped share of the sagittas per wavenumber, damping, and slope over the
        wavenumber if `slope`."""
        a, b, c = self.length_sagittas
        mean_length_sagitta = (a + b + c) / 3.0  # <4 l_i l_k> = 1/3
        phases = tuple(wavenumber * (length - mean_length_sagitta) for length in self.lengths)
        found = moments(dr, phases, slope)
        mean_sagitta, middle = self._means()

        def bending(mean: ComplexPair, edge: tuple[ComplexPair, ...]) -> ComplexPair:
            total = edge[0].scaled(4 * a) + edge[1].scaled(4 * b) + edge[2].scaled(4 * c)
            return (middle + mean_sagitta).times((total - mean.scaled(mean_length_sagitta)).turned())

        def straight(corner: Sequence[ComplexPair], edge: tuple[ComplexPair, ...]) -> ComplexPair:
            total = ComplexPair(0.0, 0.0)
            for strength, sagitta, one, other in zip(self.strengths, self.strength_sagittas, corner, edge, strict=True):
                total = total + strength.times(one) + sagitta.times(other.scaled(4.0))
            return total

        bent = bending(found.mean, found.edge)
        total = bent.scaled(wavenumber) + straight(found.corner, found.edge)
        # <16 l_i^2 l_k^2> - 1/9 = 1/15, <16 l_i^2 l_k l_m> - 1/9 = -1/45
        variance = (a * a + b * b + c * c) / 15.0 - (a * b + b * c + c * a) * (2.0 / 45.0)
        exponent = 0.5 * wavenumber * wavenumber * variance
        damping = dr.exp(-dr.minimum(exponent, _MAX_DAMPING))
        over_wavenumber = ComplexPair(0.0, 0.0)
        if slope:
            corner = [each.turned().scaled(-1.0) for each in found.along(phases)]
            mean = corner[0] + corner[1] + corner[2]
            grown = (bent + bending(mean, found.growth)).scaled(wavenumber) + straight(corner, found.growth)
            decay = dr.select(exponent < _MAX_DAMPING, wavenumber * variance, 0.0)
            over_wavenumber = (grown.scaled(1.0 / wavenumber) - total.scaled(decay)).scaled(damping)
        return total.scaled(damping), found, bent, damping, over_wavenumber

    def mean_in_parts(
        self,
        dr: Any,
        wavenumber: Any,
        parts: Any,
        ways: Sequence[PathVariation] | None = None,
        slopes: int = SlopeOrder.SECOND,
        path_curvatures: Sequence[PathVariation] = (),
    ) -> list[ComplexPair]:
        """The same with each edge divided into `parts`."""
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
            def own(values: Sequence[Any]) -> list[Any]:
                return [dr.select(turned, values[(i + 2) % 3], values[i]) * scale * scale for i in range(3)]

            real, imaginary = zip(*self.strength_sagittas, strict=True)
            piece = Quadratic(
                [length for length, _ in ends],
                own(self.length_sagittas),
                [strength for _, strength in ends],
                [ComplexPair(*each) for each in zip(own(real), own(imaginary), strict=True)],
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


def mean_of_three(values: Sequence[ComplexPair]) -> ComplexPair:
    """Mean of three complex numbers."""
    return (values[0] + values[1] + values[2]).scaled(1.0 / 3.0)


def variation_pairs(count: int) -> list[tuple[int, int]]:
    """Pairs of `count` path variations, in the order of second slopes."""
    return [(one, other) for one in range(count) for other in range(one, count)]


def number_of_terms(ways: Sized | None, slopes: int = SlopeOrder.SECOND) -> int:
    """Number of terms of :meth:`Quadratic.mean`."""
    return 1 if ways is None else 2 + len(ways) + slopes * len(variation_pairs(len(ways)))


def flatten_terms(numbers: Sequence[ComplexPair]) -> list[Any]:
    """Real and imaginary parts in turn."""
    return [value for each in numbers for value in each]


def sum_terms(dr: Any, real: Any, total: Any, step: Any, count: int, width: int) -> list[ComplexPair]:
    """Sums of `count` complex numbers, by `step` (index, real and imaginary parts so far) from index 0 to `total`."""
    start = (dr.zeros(type(total), width), *(dr.zeros(real, width) for _ in range(2 * count)))
    _, *sums = dr.while_loop(start, lambda index, *_: index < total, step)
    return [ComplexPair(*sums[k : k + 2]) for k in range(0, 2 * count, 2)]


def lattice_triangle(dr: Any, index: Any) -> tuple[Any, Any, Any, Any]:
    """Position of triangle `index` (a float) of a divided one: row and column of its first corner, whether it is
    turned, row of its last corner. Row k holds k + 1 upright triangles and k turned ones between them."""
    row = dr.floor(dr.sqrt(index + 0.5))
    place = index - row * row
    column = dr.floor(0.5 * place)
    turned = place > 2.0 * column + 0.5
    return row, column, turned, dr.select(turned, row, row + 1.0)
