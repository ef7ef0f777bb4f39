"""Slow, readable oracles for the facet integral: dense quadrature in float64, straight from the definition."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rfgen_sionna._types import SPEED_OF_LIGHT, ComplexArray, FloatArray


def fresnel(permittivity: complex, permeability: complex, cos_in: FloatArray) -> tuple[ComplexArray, ComplexArray]:
    """r_s and r_p of a half-space; an infinite permittivity is a perfect conductor."""
    if not np.isfinite(permittivity):
        return -np.ones_like(cos_in, dtype=complex), np.ones_like(cos_in, dtype=complex)
    root = np.sqrt(permittivity * permeability - (1 - cos_in**2) + 0j)
    root = np.where(root.imag > 0, -root, root)
    return (
        (permeability * cos_in - root) / (permeability * cos_in + root),
        (permittivity * cos_in - root) / (permittivity * cos_in + root),
    )


def triangle_points(corners: FloatArray, n: int) -> tuple[FloatArray, FloatArray]:
    """(facet, n^2, 3) points on each facet and their (n^2,) weights, which add up to 1: Gauss-Legendre in the collapsed
    square, exponentially convergent from about two points per wavelength of the path on."""
    node, weight = np.polynomial.legendre.leggauss(n)
    node, weight = 0.5 * (node + 1.0), 0.5 * weight
    u, v = (each.ravel() for each in np.meshgrid(node, node, indexing="ij"))
    barycentric = np.stack([1.0 - u, u * (1.0 - v), u * v], axis=1)
    return np.einsum("qc,fci->fqi", barycentric, corners), 2.0 * u * np.outer(weight, weight).ravel()


def clusters(corners: FloatArray, sagittas: FloatArray, n: int) -> tuple[FloatArray, FloatArray]:
    """(facet, n^2, 3) points on quadratic patches and their normals, twice the area element long."""
    w, _ = triangle_points(np.eye(3)[None], n)
    weight = [w[0][:, i, None] for i in range(3)]
    p, r = ([each[:, None, i] for i in range(3)] for each in (corners, sagittas))
    ring = [(i, (i + 1) % 3, (i + 2) % 3) for i in range(3)]
    point = sum(weight[i] * p[i] + 4 * weight[j] * weight[k] * r[i] for i, j, k in ring)
    slope = [p[i] + 4 * (weight[k] * r[j] + weight[j] * r[k]) for i, j, k in ring]
    return point, np.cross(slope[1] - slope[0], slope[2] - slope[0])


def dot(a: FloatArray, b: FloatArray) -> FloatArray:
    return (a * b).sum(axis=-1, keepdims=True)


def obliquity(normal, k_in, e_in, k_out, e_out, permittivity, permeability):
    """(..., 1) half of e_out on the Stratton-Chu integrand of the tangential fields of a wave `e_in` along `k_in`."""
    cos_in = -dot(k_in, normal)
    s = np.cross(k_in, normal)
    size = np.linalg.norm(s, axis=-1, keepdims=True)
    spare = np.cross(normal, np.where(np.abs(normal[..., :1]) < 0.5, [1.0, 0, 0], [0, 1.0, 0]))
    s = np.where(size > 1e-12, s / np.maximum(size, 1e-12), spare / np.linalg.norm(spare, axis=-1, keepdims=True))
    k_refl = k_in + 2 * cos_in * normal
    r_s, r_p = fresnel(permittivity, permeability, cos_in)
    e_refl = r_s * dot(e_in, s) * s + r_p * dot(e_in, np.cross(s, k_in)) * np.cross(s, k_refl)
    h_total = np.cross(k_in, e_in) + np.cross(k_refl, e_refl)  # times eta
    e_total = e_in + e_refl
    current_j, current_m = np.cross(normal, h_total), -np.cross(normal, e_total)
    return 0.5 * dot(e_out, np.cross(k_out, current_m) + np.cross(k_out, np.cross(k_out, current_j)))


def slab(r: ComplexArray, permittivity: complex, cos_in: FloatArray, turns: float) -> ComplexArray:
    """Reflection of a slab whose front reflects `r`, `turns` vacuum wavelengths thick (ITU-R P.2040, eq. 43)."""
    root = np.sqrt(permittivity - (1 - cos_in**2) + 0j)
    trip = np.exp(-4j * np.pi * turns * np.where(root.imag > 0, -root, root))
    return r * (1 - trip) / (1 - r**2 * trip)


@dataclass(frozen=True)
class Wall:
    """A plane through `point` with unit vector `normal`, of a half-space or of a slab."""

    point: FloatArray
    normal: FloatArray
    permittivity: complex
    thickness: float = np.inf

    def image(self, place: FloatArray) -> FloatArray:
        return place - 2 * dot(place - self.point, self.normal) * self.normal

    def reflected(self, element: FloatArray, field: FloatArray, points: FloatArray, frequency: float) -> ComplexArray:
        """Field direction at `points` of an element's unit field that came by way of the wall."""
        image = self.image(element)
        heights = dot(points - self.point, self.normal) / dot(image - self.point, self.normal)
        place = (points - heights * image) / (1 - heights)  # where the line from the image crosses the plane
        k = (place - element) / np.linalg.norm(place - element, axis=-1, keepdims=True)
        e = field - dot(field, k) * k
        return self.turned(e / np.linalg.norm(e, axis=-1, keepdims=True), place - element, points - place, frequency)

    def turned(self, e: ComplexArray, before: FloatArray, after: FloatArray, frequency: float) -> ComplexArray:
        """What is left of a field `e` that comes along `before` and goes on along `after`."""
        k, k_after = (each / np.linalg.norm(each, axis=-1, keepdims=True) for each in (before, after))
        s = np.cross(k, self.normal)
        s = s / np.linalg.norm(s, axis=-1, keepdims=True)
        cos = np.abs(dot(k, self.normal))
        r_s, r_p = fresnel(self.permittivity, 1.0, cos)
        if np.isfinite(self.thickness):
            turns = self.thickness * frequency / SPEED_OF_LIGHT
            r_s, r_p = (slab(r, self.permittivity, cos, turns) for r in (r_s, r_p))
        return r_s * dot(e, s) * s + r_p * dot(e, np.cross(s, k)) * np.cross(s, k_after)


@dataclass(frozen=True)
class WallAfter(Wall):
    """A wall that waves come to by way of another one."""

    before: Wall | None = None

    def image(self, place: FloatArray) -> FloatArray:
        return super().image(place if self.before is None else self.before.image(place))

    def reflected(self, element: FloatArray, field: FloatArray, points: FloatArray, frequency: float) -> ComplexArray:
        """As there, after both."""
        if self.before is None:
            return super().reflected(element, field, points, frequency)
        image = self.before.image(element)
        heights = dot(points - self.point, self.normal) / dot(image - self.point, self.normal)
        mirror = points - 2 * dot(points - self.point, self.normal) * self.normal
        share = dot(image - self.point, self.normal) / (
            dot(image - self.point, self.normal) - dot(mirror - self.point, self.normal)
        )
        place = image + share * (mirror - image)
        assert np.all(heights > 0)
        return self.turned(
            self.before.reflected(element, field, place, frequency),
            place - image,
            points - place,
            frequency,
        )


def po_gain(
    corners: FloatArray,
    tx: FloatArray,
    rx: FloatArray,
    tx_field: FloatArray,
    rx_field: FloatArray,
    frequency: float,
    permittivity: complex = complex(np.inf),
    permeability: complex = 1.0,
    n: int = 64,
    tx_wall: Wall | None = None,
    rx_wall: Wall | None = None,
    sagittas: FloatArray | None = None,
) -> complex:
    """Channel of one element pair: (j / 4 pi) integral of F exp(-j k (R_t + R_r)) / (R_t R_r), n^2 points a facet.

    Every factor is evaluated at every sample: no linear phase, no constant obliquity. F is the mean of the obliquities
    from Tx to Rx and back. By way of a wall the distances are those to the image, and the field is the wall's
    reflection of the element's. With `sagittas` (facet, 3, 3) [m], by how much the middle of the edge opposite each
    corner
    lies off its chord, facets are quadratic patches with normals of their own: what looks away, seen half way between
    Tx and Rx, returns nothing.
    """
    k = 2 * np.pi * frequency / SPEED_OF_LIGHT
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    twice_area = np.linalg.norm(cross, axis=1)
    points, weights = triangle_points(corners, n)
    normal = np.broadcast_to((cross / twice_area[:, None])[:, None], points.shape)
    front, share = normal, np.ones(points.shape[:2])
    if sagittas is not None:
        points, front = clusters(corners, sagittas, n)
        share = np.linalg.norm(front, axis=2)
        front = front / share[..., None]
        share = share / twice_area[:, None]

    true_tx, true_rx = tx, rx
    tx, rx = (each if wall is None else wall.image(each) for each, wall in ((tx, tx_wall), (rx, rx_wall)))
    to_point, to_rx = points - tx, rx - points
    r_t, r_r = np.linalg.norm(to_point, axis=-1, keepdims=True), np.linalg.norm(to_rx, axis=-1, keepdims=True)
    k_in, k_out = to_point / r_t, to_rx / r_r
    if sagittas is None:
        normal = np.where(dot(normal, k_in) > 0, -normal, normal)
    else:
        normal = front
        share = share * (dot(normal, points - 0.5 * (tx + rx)) < 0)[..., 0]

    def transverse(field: FloatArray, direction: FloatArray) -> FloatArray:
        across = field - dot(field, direction) * direction
        return across / np.linalg.norm(across, axis=-1, keepdims=True)

    e_tx, e_rx = transverse(tx_field, k_in), transverse(rx_field, k_out)
    if tx_wall is not None:
        e_tx = tx_wall.reflected(true_tx, tx_field, points, frequency)
    if rx_wall is not None:
        e_rx = rx_wall.reflected(true_rx, rx_field, points, frequency)
    there = obliquity(normal, k_in, e_tx, k_out, e_rx, permittivity, permeability)
    back = obliquity(normal, -k_out, e_rx, -k_in, e_tx, permittivity, permeability)
    f = 0.5 * (there + back)
    area = 0.5 * twice_area
    integrand = share * (f * np.exp(-1j * k * (r_t + r_r)) / (r_t * r_r))[..., 0]
    return complex(1j / (4 * np.pi) * ((integrand @ weights) * area).sum())
