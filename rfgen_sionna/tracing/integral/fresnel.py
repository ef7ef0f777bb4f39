"""Fresnel coefficients and the polarimetric obliquity of a facet's currents, in scalar kernels.

Physical optics uses the currents of the incident side alone and is not reciprocal where Tx and Rx lie in different
directions. The obliquity here is the mean of both ways: the same where physical optics is exact (monostatic, specular),
and reciprocal everywhere. Vectors are tuples of three numbers.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit

from rfgen_sionna._types import FloatArray
from rfgen_sionna.tracing.integral.obliquity import Media
from rfgen_sionna.tracing.integral.phasor_moments import FAST

_MIN_SINE_PRODUCT = 1e-36
"""Product of the squared sines between direction and fields below which there is no transverse field: 1e-9 rad."""
_MIN_DISTANCE = 1e-4
_MIN_COSINE = 1e-3


def media_table(media: Media) -> FloatArray:
    """(node, material, 7) real and imaginary relative permittivity and permeability, thickness [m] with -1 for a
    half-space, coherent share of the field, and 1 for a perfect conductor."""
    conductor = ~np.isfinite(media.permittivity)
    eps, mu = np.where(conductor, 1.0, media.permittivity), np.where(conductor, 1.0, media.permeability)
    thickness = np.where(np.isfinite(media.thickness), media.thickness, -1.0)
    columns = eps.real, eps.imag, mu.real, mu.imag, thickness, media.smoothness, conductor
    return np.ascontiguousarray(np.stack([np.broadcast_to(each, eps.shape) for each in columns], axis=-1), np.float64)


@njit(fastmath=FAST, error_model="numpy")
def dot(a: Any, b: Any) -> Any:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@njit(fastmath=FAST, error_model="numpy")
def cross(a: Any, b: Any) -> Any:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@njit(fastmath=FAST, error_model="numpy")
def plus(a: Any, b: Any) -> Any:
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@njit(fastmath=FAST, error_model="numpy")
def minus(a: Any, b: Any) -> Any:
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@njit(fastmath=FAST, error_model="numpy")
def scaled(a: Any, by: Any) -> Any:
    return a[0] * by, a[1] * by, a[2] * by


@njit(fastmath=FAST, error_model="numpy")
def norm(a: Any) -> float:
    return np.sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2])


@njit(fastmath=FAST, error_model="numpy")
def unit(a: Any) -> Any:
    return scaled(a, 1.0 / max(norm(a), 1e-30))


@njit(fastmath=FAST, error_model="numpy")
def reflection(medium: Any, wavenumber: float, cosine: float, sine2: float) -> tuple[complex, complex]:
    """Fresnel's r_s and r_p of the coherent field, of a half-space or a slab (ITU-R P.2040, eq. 43)."""
    share = medium[5]
    if medium[6] > 0.5:
        return complex(-share, 0.0), complex(share, 0.0)
    eps, mu, c = complex(medium[0], medium[1]), complex(medium[2], medium[3]), max(cosine, 1e-9)
    root = np.sqrt(eps * mu - sine2)
    if root.imag > 0.0:
        root = -root  # decay into the material, exp(+j omega t)
    r_s, r_p = (mu * c - root) / (mu * c + root), (eps * c - root) / (eps * c + root)
    if medium[4] >= 0.0:
        trip = np.exp(complex(0.0, -2.0) * wavenumber * medium[4] * root)
        below_s, below_p = 1.0 - r_s * r_s * trip, 1.0 - r_p * r_p * trip
        # A slab without thickness reflects nothing, at grazing incidence too.
        r_s = r_s * (1.0 - trip) / below_s if abs(below_s) > 1e-12 else 0j
        r_p = r_p * (1.0 - trip) / below_p if abs(below_p) > 1e-12 else 0j
    return r_s * share, r_p * share


@njit(fastmath=FAST, error_model="numpy")
def transverse(field: Any, k: Any) -> Any:
    """Unit vector of the part of a `field` across `k`; zero where there is none."""
    across = minus(field, scaled(k, dot(field, k)))
    size = norm(across)
    return scaled(across, 1.0 / size) if size > 1e-9 else (0.0, 0.0, 0.0)


@njit(fastmath=FAST, error_model="numpy")
def _received(field: Any, direction: Any, electric: Any, current: Any) -> Any:
    """Half of e_out . (k_out x (E x n) + k_out x (k_out x (n x eta H))), the Stratton-Chu integrand, of a `field`
    along a `direction`."""
    return 0.5 * (dot(field, electric) + dot(current, cross(direction, field)))


@njit(fastmath=FAST, error_model="numpy")
def one_way(medium: Any, wavenumber: float, normal: Any, k_in: Any, e_in: Any, k_out: Any, e_out: Any) -> complex:
    """Obliquity of a plane wave of unit field `e_in` along `k_in`, received along `k_out` by an element of field
    `e_out`."""
    cosine = min(max(-dot(k_in, normal), 0.0), 1.0)
    s = cross(k_in, normal)
    sine = norm(s)
    if sine > 1e-9:
        s = scaled(s, 1.0 / sine)
    else:  # at normal incidence any direction across is s
        s = unit(cross((1.0, 0.0, 0.0) if abs(normal[0]) < 0.6 else (0.0, 1.0, 0.0), normal))
    k_reflected = plus(k_in, scaled(normal, 2.0 * cosine))
    p_in, p_reflected = cross(s, k_in), cross(s, k_reflected)
    electric, current = cross(normal, cross(e_out, k_out)), cross(normal, e_out)
    r_s, r_p = reflection(medium, wavenumber, cosine, sine * sine)
    return (
        _received(e_in, k_in, electric, current)
        + r_s * (dot(e_in, s) * _received(s, k_reflected, electric, current))
        + r_p * (dot(e_in, p_in) * _received(p_reflected, k_reflected, electric, current))
    )


@njit(fastmath=FAST, error_model="numpy")
def both_ways(medium: Any, wavenumber: float, normal: Any, k_in: Any, e_in: Any, k_out: Any, e_out: Any) -> complex:
    """Mean of :func:`one_way` in both senses: the same for Tx and Rx exchanged."""
    there = one_way(medium, wavenumber, normal, k_in, e_in, k_out, e_out)
    back = one_way(medium, wavenumber, normal, scaled(k_out, -1.0), e_out, scaled(k_in, -1.0), e_in)
    return 0.5 * (there + back)


@njit(fastmath=FAST, error_model="numpy")
def obliquity(
    medium: Any, wavenumber: float, normal: Any, point: Any, tx: Any, rx: Any, tx_field: Any, rx_field: Any,
    bistatic: bool,
) -> complex:  # fmt: skip
    """Obliquity over the product of the distances [1/m^2] at a `point`, per cosine of incidence for an element half way
    between `tx` and `rx` [m]; that element's where not `bistatic`."""
    element = scaled(plus(tx, rx), 0.5)
    offset = minus(point, element)
    k = unit(offset)
    cosine = min(max(-dot(k, normal), 0.0), 1.0)
    if bistatic:
        from_tx, to_rx = minus(point, tx), minus(rx, point)
        spread = norm(from_tx) * norm(to_rx)
        if spread < _MIN_DISTANCE**2:
            return 0j
        k_in, k_out = unit(from_tx), unit(to_rx)
        if dot(normal, k_in) >= 0.0 or dot(normal, k_out) <= 0.0:
            return 0j
        e_tx, e_rx = transverse(tx_field, k_in), transverse(rx_field, k_out)
        mean = both_ways(medium, wavenumber, normal, k_in, e_tx, k_out, e_rx)
        return mean / (spread * max(cosine, _MIN_COSINE))
    distance = norm(offset)
    if distance < _MIN_DISTANCE:
        return 0j
    across = cross(k, normal)
    sine2 = dot(across, across)
    r_s, r_p = reflection(medium, wavenumber, cosine, sine2)
    # Transverse fields, turned by 90 degrees: the product of two is the same.
    e, f = cross(tx_field, k), cross(rx_field, k)
    squares = dot(e, e) * dot(f, f)
    if squares <= _MIN_SINE_PRODUCT:
        return 0j
    along_s = dot(tx_field, across) * dot(rx_field, across) / max(sine2, 1e-18)
    along_p = dot(e, f) - along_s
    return (r_s * along_s - r_p * along_p) / (np.sqrt(squares) * distance * distance)
