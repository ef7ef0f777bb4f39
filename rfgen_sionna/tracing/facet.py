"""Physical optics of one flat facet, in closed form, on Dr.Jit's float64 arrays (LLVM or CUDA).

With Tx element at distance R_t, Rx element at R_r and k = 2 pi f / c the gain of a facet is

    a = (j / 4 pi) F A / (R_t R_r) <exp(-j k (R_t + R_r))>

where A is the area, <.> the mean over the facet and F the polarimetric obliquity: half the projection of
the Stratton-Chu integrand of the tangential fields (incident plus Fresnel-reflected) on the Rx element's field
direction. For a metal plate at normal incidence F = -1, so that an infinite mirror at distance d
gives the image-theory gain -lambda / (4 pi 2 d) exp(-j 2 k d).

Physical optics takes the currents from the incident side alone and so is not reciprocal where Tx and Rx lie in
different directions. F is therefore the mean of both ways, Tx to Rx and Rx to Tx: the same where physical optics is
exact (one place for both, the specular direction), and reciprocal everywhere.

The mean of a linear phase over a triangle has a closed form (:mod:`rfgen_sionna.tracing.simplex`). The phase of a
facet is not quite linear, nor is its return equally strong all over. Both are small on a facet, but neighbouring facets
repeat the same residue: a grating, whose lobes add up in first order. So the quadratic part of the phase and the
linear part of the strength are kept to first order, which leaves an error of second order.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from rfgen_sionna.records import SPEED_OF_LIGHT, ComplexArray, FloatArray
from rfgen_sionna.tracing.arrays import drjit_types
from rfgen_sionna.tracing.simplex import Complex as ComplexPair
from rfgen_sionna.tracing.simplex import moments


@dataclass(frozen=True)
class FacetGains:
    """Gains and delays of facets for every element pair."""

    a: ComplexArray
    """(frequency, tx, rx, facet) complex gain without the propagation phase of the centroid."""
    tau: FloatArray
    """(tx, rx, facet) delay by way of the facet's centroid [s]."""
    bulge: FloatArray
    """(facet,) phase at the centroid that a linear phase through the corners misses, first element pair [rad]."""


def _mean_phasor(dr: Any, wavenumber: Any, lengths: list[Any], sags: list[Any], swings: list[Any]) -> ComplexPair:
    """Mean of (1 + w) exp(-j psi) over a facet, to first order in the sags and in the swings w.

    psi is quadratic, linear between the corners less 4 sum_edges sag l_i l_k; w is linear between its corner values.
    """
    found = moments(dr, (wavenumber * lengths[0], wavenumber * lengths[1], wavenumber * lengths[2]))
    sag = [wavenumber * each for each in sags]
    mean_sag = (sag[0] + sag[1] + sag[2]) / 3.0  # <4 l_i l_k> = 1/3
    quadratic = found.edge[0].scaled(4 * sag[0]) + found.edge[1].scaled(4 * sag[1]) + found.edge[2].scaled(4 * sag[2])
    total = found.mean + (quadratic - found.mean.scaled(mean_sag)).turned()
    for moment, swing in zip(found.corner, swings, strict=True):
        total = total + moment.scaled(swing)
    sin, cos = dr.sincos(mean_sag)
    return total.times(ComplexPair(cos, sin))


class _Way:
    """A plane wave of unit field `e_in` along `k_in` on a facet, received along `k_out` by an element of field `e_out`.

    Holds half of e_out . (k_out x (E x n) + k_out x (k_out x (n x eta H))) for the incident wave and for reflected ones
    of unit coefficient in both polarisations.
    """

    def __init__(self, dr: Any, vector: Any, normal: Any, k_in: Any, e_in: Any, k_out: Any, e_out: Any) -> None:
        self.cos = dr.clip(-dr.dot(k_in, normal), 0.0, 1.0)
        s_raw = dr.cross(k_in, normal)
        self.sin = dr.norm(s_raw)
        # At normal incidence the plane of incidence is free: any direction across will do.
        spare = dr.cross(dr.select(dr.abs(normal.x) < 0.6, vector(1, 0, 0), vector(0, 1, 0)), normal)
        s = dr.select(self.sin > 1e-9, s_raw / dr.maximum(self.sin, 1e-9), dr.normalize(spare))
        k_reflected = k_in + 2.0 * self.cos * normal
        p_in, p_reflected = dr.cross(s, k_in), dr.cross(s, k_reflected)
        # e . (k x (E x n)) = E . (n x (e x k)) and e . (k x (k x J)) = -e . J, for e across k.
        of_electric, of_current = dr.cross(normal, dr.cross(e_out, k_out)), dr.cross(normal, e_out)

        def received(field: Any, direction: Any) -> Any:
            return 0.5 * (dr.dot(field, of_electric) + dr.dot(of_current, dr.cross(direction, field)))

        self._incident = received(e_in, k_in)
        self._s = dr.dot(e_in, s) * received(s, k_reflected)
        self._p = dr.dot(e_in, p_in) * received(p_reflected, k_reflected)

    def obliquity(self, dr: Any, complex_type: Any, eps: Any, mu: Any, perfect: Any) -> ComplexPair:
        """Incident plus Fresnel-reflected; `eps` and `mu` are complex relative values."""
        root = dr.sqrt(eps * mu - self.sin * self.sin)
        root = dr.select(root.imag > 0, -root, root)  # a wave that decays into the material, exp(+j omega t)
        r_s = dr.select(perfect, complex_type(-1, 0), (mu * self.cos - root) / (mu * self.cos + root))
        r_p = dr.select(perfect, complex_type(1, 0), (eps * self.cos - root) / (eps * self.cos + root))
        return ComplexPair(
            self._incident + r_s.real * self._s + r_p.real * self._p, r_s.imag * self._s + r_p.imag * self._p
        )


def facet_gains(
    corners: FloatArray,
    tx: FloatArray,
    rx: FloatArray,
    tx_field: FloatArray,
    rx_field: FloatArray,
    permittivity: ComplexArray,
    permeability: ComplexArray,
    frequencies: FloatArray,
) -> FacetGains:
    """Gain of every facet between every Tx and Rx element.

    Parameters
    ----------
    corners
        (facet, 3, 3) corner positions [m], in a frame whose origin is near the radar; either orientation.
    tx, rx
        (tx, 3) and (rx, 3) element positions [m].
    tx_field, rx_field
        (3,) direction of the elements' electric field; towards each facet its transverse part counts, unit gain.
    permittivity, permeability
        (frequency, facet) complex relative values, conductivity included as -j sigma/(omega eps0); an infinite
        permittivity is a perfect conductor.
    frequencies
        (frequency,) [Hz]

    Notes
    -----
    Corners of zero area and elements closer than 0.1 mm to the centroid give gain 0.
    """
    dr, types = drjit_types()
    Float, UInt32, Array3, Complex = types.Float64, types.UInt32, types.Array3f64, types.Complex2f64
    facets, num_tx, num_rx = len(corners), len(tx), len(rx)
    tau = np.zeros((num_tx, num_rx, facets))
    a = np.zeros((len(frequencies), num_tx, num_rx, facets), dtype=np.complex128)
    if facets == 0:
        return FacetGains(a, tau, np.zeros(0))

    def vector(values: FloatArray, index: Any) -> Any:
        flat = Float(np.ascontiguousarray(values, dtype=np.float64).reshape(-1))
        return Array3(*(dr.gather(Float, flat, index * 3 + axis) for axis in range(3)))

    lane = dr.arange(UInt32, num_tx * num_rx * facets)
    facet_count, rx_count = dr.opaque(UInt32, facets), dr.opaque(UInt32, num_rx)
    facet, channel = lane % facet_count, lane // facet_count
    flat_corners = np.ascontiguousarray(corners, dtype=np.float64).reshape(-1, 3)
    p = [vector(flat_corners, facet * 3 + corner) for corner in range(3)]
    t, r = vector(tx, channel // rx_count), vector(rx, channel % rx_count)

    centre = (p[0] + p[1] + p[2]) / 3.0
    from_tx, to_rx = centre - t, r - centre
    distance_tx, distance_rx = dr.norm(from_tx), dr.norm(to_rx)
    k_in, k_out = from_tx / distance_tx, to_rx / distance_rx
    cross = dr.cross(p[1] - p[0], p[2] - p[0])
    twice_area = dr.norm(cross)
    usable = (twice_area > 0) & (distance_tx > 1e-4) & (distance_rx > 1e-4)
    normal = cross / dr.select(twice_area > 0, twice_area, 1.0)
    normal = dr.select(dr.dot(normal, k_in) > 0, -normal, normal)
    usable &= dr.dot(normal, k_out) > 0  # an element in the facet's plane, the other behind it

    # Path length at a point less that at the centroid, without cancellation: |x|-|y| = (x-y).(x+y)/(|x|+|y|); and
    # the spreading times the cosine of incidence, relative to the centroid's: on a plane cos/R goes as 1/R^2.
    def path(point: Any) -> tuple[Any, Any]:
        from_t, from_r = point - t, point - r
        offset = point - centre
        size_t, size_r = dr.norm(from_t), dr.norm(from_r)
        excess = dr.dot(offset, from_t + from_tx) / (size_t + distance_tx) + dr.dot(offset, from_r - to_rx) / (
            size_r + distance_rx
        )
        shrink = distance_tx * distance_rx / dr.maximum(size_t * size_r, 1e-30)
        return excess, shrink * dr.sqrt(shrink)

    corner_paths = [path(corner) for corner in p]
    lengths = [excess for excess, _ in corner_paths]
    swings = [dr.clip(strength - 1.0, -1.0, 1.0) for _, strength in corner_paths]
    # By how much a linear phase through the corners lies above the true one in the middle of each edge.
    sags = [
        0.5 * (lengths[(i + 1) % 3] + lengths[(i + 2) % 3]) - path(0.5 * (p[(i + 1) % 3] + p[(i + 2) % 3]))[0]
        for i in range(3)
    ]
    bulge = (lengths[0] + lengths[1] + lengths[2]) / 3.0

    def transverse(field: FloatArray, direction: Any) -> Any:
        v = Array3(*(dr.opaque(Float, float(component)) for component in field))
        across = v - dr.dot(v, direction) * direction
        size = dr.norm(across)
        return dr.select(size > 1e-9, across / dr.maximum(size, 1e-9), 0.0)

    e_tx, e_rx = transverse(tx_field, k_in), transverse(rx_field, k_out)
    there = _Way(dr, Array3, normal, k_in, e_tx, k_out, e_rx)
    back = _Way(dr, Array3, normal, -k_out, e_rx, -k_in, e_tx)
    area_factor = 0.5 * twice_area / (4.0 * dr.pi * dr.select(usable, distance_tx * distance_rx, 1.0))

    outputs = [distance_tx + distance_rx, bulge]
    for index, frequency in enumerate(np.asarray(frequencies, dtype=np.float64)):
        wavenumber = dr.opaque(Float, float(2 * np.pi * frequency / SPEED_OF_LIGHT))
        mean_re, mean_im = _mean_phasor(dr, wavenumber, lengths, sags, swings)
        eps, mu = permittivity[index], permeability[index]
        conductor = ~np.isfinite(eps)
        eps, mu = np.where(conductor, 1.0, eps), np.where(conductor, 1.0, mu)

        def material(values: Any) -> Any:
            return dr.gather(Float, Float(np.ascontiguousarray(values, dtype=np.float64)), facet)

        perfect = material(conductor) > 0.5
        eps_r, mu_r = Complex(material(eps.real), material(eps.imag)), Complex(material(mu.real), material(mu.imag))
        f_there, f_back = (way.obliquity(dr, Complex, eps_r, mu_r, perfect) for way in (there, back))
        f_re, f_im = 0.5 * (f_there.re + f_back.re), 0.5 * (f_there.im + f_back.im)
        # times j: (f_re + j f_im) (mean_re + j mean_im) j
        outputs.append(dr.select(usable, -area_factor * (f_re * mean_im + f_im * mean_re), 0.0))
        outputs.append(dr.select(usable, area_factor * (f_re * mean_re - f_im * mean_im), 0.0))
    dr.eval(*outputs)

    tau[:] = outputs[0].numpy().reshape(tau.shape) / SPEED_OF_LIGHT
    for index in range(len(frequencies)):
        a[index].real = outputs[2 + 2 * index].numpy().reshape(tau.shape)
        a[index].imag = outputs[3 + 2 * index].numpy().reshape(tau.shape)
    wavenumber_high = 2 * np.pi * float(np.max(frequencies)) / SPEED_OF_LIGHT
    return FacetGains(a, tau, wavenumber_high * np.abs(outputs[1].numpy()[:facets]))
