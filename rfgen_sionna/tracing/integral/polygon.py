"""Physical optics of flat polygons, by line integrals along their edges.

With r the distance of an element at height h over the plane, rho that from its foot point and phi the angle around it,
rho drho = r dr, and the integral of cos / r^2 exp(-2j k r) over a polygon is

    h * closed integral of (G(r) - G(h)) dphi,   G(r) = integral of exp(-2j k r) / r^2 dr = -exp(-2j k r) / (2j k r^2)

to leading order in 1 / (k r) (W. B. Gordon, IEEE Trans. Antennas Propag. 23(4), 1975; J. S. Asvestas, same, 34(12),
1986). Where the foot point is outside, the terms of G(h) cancel, and with the obliquity F of the edge's points an edge
with distance d from the foot point has the gain

    a = -(1 / 8 pi) (h / k) d * integral of F exp(-2j k r) / (r rho)^2 ds

The next order, from the change of F / r^2 and of the pattern gain outwards, replaces F / r^2 by itself plus its
derivative by r over 2j k. It matters where F vanishes, at Brewster's angle.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit

from rfgen_sionna.tracing.integral.fresnel import cross, dot, minus, norm, obliquity, plus, scaled
from rfgen_sionna.tracing.integral.phasor_moments import FAST

MAX_DIRECT_PHASE = 7.0
"""Phase [rad] at the end of a segment up to which quadrature takes its moments, and recursion beyond: that is stable
where the phase is above the order."""
STEP = 1e-4
"""Step of the derivative outwards, over the distance from the foot point."""
_MIN_DISTANCE = 1e-4
_ORDERS = 7
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(14)


@njit(fastmath=FAST, error_model="numpy")
def _moments(slope: float, found: Any) -> None:
    """Means of x^n exp(-j slope x) over -1 ... 1 into `found` (order,)."""
    if abs(slope) <= MAX_DIRECT_PHASE:
        for n in range(_ORDERS):
            found[n] = 0.0
        for i in range(_NODES.shape[0]):
            x = _NODES[i]
            wave = 0.5 * _WEIGHTS[i] * complex(np.cos(slope * x), -np.sin(slope * x))
            for n in range(_ORDERS):
                found[n] += wave
                wave = wave * x
        return
    last = complex(np.cos(slope), -np.sin(slope))
    first = last.conjugate()
    sign = 1.0
    found[0] = np.sin(slope) / slope
    for n in range(1, _ORDERS):
        sign = -sign
        # Integration by parts.
        found[n] = (0.5 * (last - sign * first) - n * found[n - 1]) * complex(0.0, 1.0 / slope)


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def edge_gains(
    start: Any, stop: Any, normal: Any, material: Any, nodes: Any, fields: Any, media: Any, bistatic: bool,
    gradient: Any, gains: Any,
) -> None:  # fmt: skip
    """Gains (node, edge) of short edges without the propagation phase of their middles.

    Parameters
    ----------
    start, stop
        (edge, 3) [m] relative to the viewpoint, counter-clockwise around the polygon seen from the radar.
    normal, material
        (edge, 3) unit normal of the plane, towards the radar, and (edge,) index of the material.
    nodes, fields, media, bistatic
        As of :func:`rfgen_sionna.tracing.integral.patch_gains.patch_gains`. Distances are those of an element half way
        between Tx and Rx.
    gradient
        (edge, 3) gradient of the logarithm of the pattern gain [1/m]; empty means none.
    """
    tx_field, rx_field = (fields[0, 0], fields[0, 1], fields[0, 2]), (fields[1, 0], fields[1, 1], fields[1, 2])
    moments, strength, weight = np.empty(_ORDERS, np.complex128), np.empty(3, np.complex128), np.empty(3)
    for q in range(start.shape[0]):
        a, b = (start[q, 0], start[q, 1], start[q, 2]), (stop[q, 0], stop[q, 1], stop[q, 2])
        n = (normal[q, 0], normal[q, 1], normal[q, 2])
        middle, along = scaled(plus(a, b), 0.5), scaled(minus(b, a), 0.5)
        half = norm(along)
        if half <= 0.0:
            for m in range(nodes.shape[0]):
                gains[m, q] = 0.0
            continue
        tilt = 0.0
        if gradient.shape[0]:
            tilt = gradient[q, 0] * along[0] + gradient[q, 1] * along[1] + gradient[q, 2] * along[2]
        for m in range(nodes.shape[0]):
            here, there = (nodes[m, 0], nodes[m, 1], nodes[m, 2]), (nodes[m, 3], nodes[m, 4], nodes[m, 5])
            wavenumber = nodes[m, 6]
            element = scaled(plus(here, there), 0.5)
            centre = minus(middle, element)
            height = -dot(n, centre)
            distance = norm(centre)
            if height <= 0.0 or distance < _MIN_DISTANCE:
                gains[m, q] = 0.0
                continue
            # Strength at both ends and in the middle, and the parabola through them.
            from_foot = plus(centre, scaled(n, height))
            turn = dot(n, cross(from_foot, along)) / half
            medium = media[m, material[q]]
            for k in range(3):
                offset = scaled(along, k - 1.0)
                lateral, point = plus(from_foot, offset), plus(middle, offset)
                strength[k] = obliquity(medium, wavenumber, n, point, here, there, tx_field, rx_field, bistatic)
                weight[k] = turn * (1.0 + tilt * (k - 1.0)) / max(dot(lateral, lateral), 1e-18)
            lateral = norm(from_foot)
            step = STEP * lateral
            point = plus(middle, scaled(from_foot, STEP))
            further = obliquity(medium, wavenumber, n, point, here, there, tx_field, rx_field, bistatic)
            outwards = 0.0
            if gradient.shape[0]:
                outwards = gradient[q, 0] * from_foot[0] + gradient[q, 1] * from_foot[1] + gradient[q, 2] * from_foot[2]
                outwards /= max(lateral, 1e-9)
            change = (further - strength[1]) / max(step, 1e-12) + strength[1] * outwards
            change = change * complex(0.0, -0.5 * distance / (wavenumber * max(lateral, 1e-9)))
            low, w0, high = (
                weight[0] * (strength[0] + change), weight[1] * (strength[1] + change),
                weight[2] * (strength[2] + change),
            )  # fmt: skip
            w1, w2 = 0.5 * (high - low), 0.5 * (high + low) - w0
            # Phase in the middle by derivatives: s x + b x^2 + c x^3.
            u = dot(centre, along) / (half * distance)
            square = 1.0 - u * u
            slope = 2.0 * wavenumber * u * half
            bend = wavenumber * square * half * half / distance
            cubic = -bend * u * half / distance
            _moments(slope, moments)
            total = w0 * moments[0] + w1 * moments[1] + w2 * moments[2]
            total += complex(0.0, -bend) * (w0 * moments[2] + w1 * moments[3] + w2 * moments[4])
            total += complex(0.0, -cubic) * (w0 * moments[3] + w1 * moments[4] + w2 * moments[5])
            total -= 0.5 * bend * bend * (w0 * moments[4] + w1 * moments[5] + w2 * moments[6])
            # Less the phase of the middle seen from the element half way, as patch_gains.
            gains[m, q] = -height / (8.0 * np.pi * wavenumber) * (2.0 * half) * total
