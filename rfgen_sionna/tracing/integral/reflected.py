"""Physical optics of a facet that one or both elements reach via plane mirrors, in the kernel.

An element behind a plane wall of normal n has an image with the field f - 2 (f . n) n. Towards a facet it radiates as
the element does towards the wall, with the wall's r_s and r_p in the plane of incidence. For the image's direction k,
the transverse part e of its field, and a = k x n the field that arrives is

    -r_p e + (r_s + r_p) (e . a) a / |a|^2

It is smooth through normal incidence, where r_s = -r_p, and the same for both senses of k.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from rfgen_sionna.tracing.integral.mirror_lanes import MirrorLanes
from rfgen_sionna.tracing.integral.obliquity import Medium, reflection, transverse
from rfgen_sionna.tracing.integral.simplex import Complex as ComplexPair
from rfgen_sionna.tracing.integral.slabs import SlabStackLanes, field_by_polarisation, transmitted_field


class _Field(NamedTuple):
    """Complex vector."""

    re: Any
    im: Any

    def dot(self, dr: Any, other: _Field) -> ComplexPair:
        return ComplexPair(
            dr.dot(self.re, other.re) - dr.dot(self.im, other.im), dr.dot(self.re, other.im) + dr.dot(self.im, other.re)
        )


class ReflectedStrength:
    """Obliquity over the product of the distances at points of a facet; `surface` holds the elements' images. Fresnel
    coefficients are those at `centre` with this `normal`: they vary less than directions and distances."""

    def __init__(self, dr: Any, vector: Any, complex_type: Any, surface: Any, centre: Any, normal: Any) -> None:
        self._dr, self._vector, self._surface, self._complex = dr, vector, surface, complex_type
        first, last = surface.walls

        def coefficients(medium: Medium, k: Any, n: Any) -> tuple[Any, Any]:
            across = dr.cross(k, n)
            sin2 = dr.minimum(dr.dot(across, across), 1.0)
            return reflection(dr, complex_type, medium, dr.sqrt(1.0 - sin2), sin2)

        k_in, k_out, _ = self._ways(centre)

        def by(wall: MirrorLanes | None, k: Any) -> list[tuple[Any, Any, Any]]:
            surfaces = [] if wall is None else wall.surfaces(dr)
            return [(across, *coefficients(medium, k, across)) for across, medium in surfaces]

        self._walls_in, self._walls_out = by(first, k_in), by(last, k_out)
        self._there = coefficients(surface.medium, k_in, normal)
        self._back = coefficients(surface.medium, k_out, normal)

    def _ways(self, point: Any) -> tuple[Any, Any, Any]:
        dr = self._dr
        from_tx, to_rx = point - self._surface.tx, self._surface.rx - point
        distance_tx, distance_rx = dr.maximum(dr.norm(from_tx), 1e-4), dr.maximum(dr.norm(to_rx), 1e-4)
        return from_tx / distance_tx, to_rx / distance_rx, distance_tx * distance_rx

    def at(self, point: Any, normal: Any) -> ComplexPair:
        """Strength at a `point` of surface normal `normal`."""
        dr, surface = self._dr, self._surface
        k_in, k_out, spread = self._ways(point)

        weights = [1.0 / 3.0 + dr.dot(slope, point - surface.middle) for slope in surface.slopes]  # as slabs need

        def field(of_element: Any, k: Any, by: list[tuple[Any, Any, Any]], crossed: SlabStackLanes) -> _Field:
            own = transverse(dr, of_element, k), self._vector(0, 0, 0)
            own = transmitted_field(dr, self._complex, crossed.before, weights, k, *own)
            for across, r_s, r_p in by:
                own = _reflected(dr, _Field(*own), dr.cross(k, across), r_s, r_p)
            return _Field(*transmitted_field(dr, self._complex, crossed.behind, weights, k, *own))

        e_tx = field(surface.tx_field, k_in, self._walls_in, surface.crossed[0])
        e_rx = field(surface.rx_field, k_out, self._walls_out, surface.crossed[1])
        there = _obliquity(dr, normal, k_in, e_tx, k_out, e_rx, self._there)
        back = _obliquity(dr, normal, -k_out, e_rx, -k_in, e_tx, self._back)
        total = (there + back).scaled(0.5 / spread)
        return total if surface.turn is None else total.times(surface.turn)


def _reflected(dr: Any, mirrored: _Field, across: Any, r_s: Any, r_p: Any) -> _Field:
    """Reflected field of a wave from its mirror image; `across` is k x n."""
    return _Field(*field_by_polarisation(dr, *mirrored, across, r_s, -r_p))


def _obliquity(
    dr: Any, normal: Any, k_in: Any, e_in: _Field, k_out: Any, e_out: _Field, coefficients: tuple[Any, Any]
) -> ComplexPair:
    """As :class:`rfgen_sionna.tracing.integral.obliquity.ScatteredWave`, for complex fields."""
    cos = dr.clip(-dr.dot(k_in, normal), 0.0, 1.0)
    k_reflected = k_in + 2.0 * cos * normal
    image = _Field(*(each - 2.0 * dr.dot(each, normal) * normal for each in e_in))
    returned = _reflected(dr, image, dr.cross(k_in, normal), *coefficients)
    # A field E along direction d is received as E . (n x (e x k) + (n x e) x d) / 2.
    electric = [dr.cross(normal, dr.cross(e, k_out)) for e in e_out]
    current = [dr.cross(normal, e) for e in e_out]

    def received(field: _Field, direction: Any) -> ComplexPair:
        return field.dot(dr, _Field(*(e + dr.cross(j, direction) for e, j in zip(electric, current, strict=True))))

    return (received(e_in, k_in) + received(returned, k_reflected)).scaled(0.5)
