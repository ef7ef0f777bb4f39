"""Integrals of w exp(-j k s) over triangles on which the path length s and the strength w are quadratic.

Both are known at the corners and to second order between them. The quadratic part of the phase is kept to first order,
so that where it is large the triangle is integrated in parts, each with its own corners.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from rfgen_sionna.tracing.simplex import Complex as ComplexPair
from rfgen_sionna.tracing.simplex import moments


class Quadratic(NamedTuple):
    """Path length and strength over a triangle."""

    lengths: list[Any]
    """Path length at the corners [m], less that at a point of reference."""
    sags: list[Any]
    """By how much a linear path length lies above the true one in the middle of the edge opposite each corner [m]."""
    strengths: list[ComplexPair]
    """At the corners."""
    swell: ComplexPair
    """By how much the strength in the middle lies above the mean of the corners; all edges have their share of it."""

    def at(self, weight: tuple[Any, Any, Any]) -> tuple[Any, ComplexPair]:
        """Path length [m] and strength at barycentric coordinates."""
        product = [weight[(i + 1) % 3] * weight[(i + 2) % 3] for i in range(3)]
        length, strength = 0.0, self.swell.scaled(3.0 * (product[0] + product[1] + product[2]))
        for i in range(3):
            length = length + weight[i] * self.lengths[i] - 4.0 * product[i] * self.sags[i]
            strength = strength + self.strengths[i].scaled(weight[i])
        return length, strength

    def mean(self, dr: Any, wavenumber: Any) -> ComplexPair:
        """Mean of w exp(-j k s), to first order in the sags."""
        found = moments(dr, (wavenumber * self.lengths[0], wavenumber * self.lengths[1], wavenumber * self.lengths[2]))
        sag = [wavenumber * each for each in self.sags]
        mean_sag = (sag[0] + sag[1] + sag[2]) / 3.0  # <4 l_i l_k> = 1/3
        edge = found.edge
        quadratic = edge[0].scaled(4 * sag[0]) + edge[1].scaled(4 * sag[1]) + edge[2].scaled(4 * sag[2])
        middle = (self.strengths[0] + self.strengths[1] + self.strengths[2]).scaled(1.0 / 3.0)
        total = (middle + self.swell.scaled(0.75)).times((quadratic - found.mean.scaled(mean_sag)).turned())
        for strength, moment in zip(self.strengths, found.corner, strict=True):
            total = total + strength.times(moment)
        total = total + self.swell.times((edge[0] + edge[1] + edge[2]).scaled(3.0))
        sin, cos = dr.sincos(mean_sag)
        return total.times(ComplexPair(cos, sin))

    def mean_in_parts(self, dr: Any, wavenumber: Any, parts: Any) -> ComplexPair:
        """The same, each edge divided into so many `parts`."""
        Float = type(wavenumber)
        count = Float(parts)
        scale = 1.0 / count

        def corner(row: Any, column: Any) -> tuple[Any, ComplexPair]:
            return self.at((1.0 - row * scale, (row - column) * scale, column * scale))

        def step(index: Any, re: Any, im: Any) -> tuple[Any, Any, Any]:
            row, column, turned, last = lattice_triangle(dr, Float(index))
            ends = [
                corner(row, column),
                corner(row + 1.0, dr.select(turned, column + 1.0, column)),
                corner(last, column + 1.0),
            ]
            # Edges of the turned triangles run the other way round.
            own = self.sags
            sags = [dr.select(turned, own[(i + 2) % 3], own[i]) * scale * scale for i in range(3)]
            swell = self.swell.scaled(scale * scale)
            piece = Quadratic([length for length, _ in ends], sags, [strength for _, strength in ends], swell)
            part = piece.mean(dr, wavenumber).scaled(scale * scale)
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
