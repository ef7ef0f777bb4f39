"""Kernels of the block transform (:mod:`rfgen_sionna.signal.block_transform`), compiled by Numba.

The lanes of vectors (:mod:`rfgen_sionna.signal.vector_intrinsics`) are the Rx elements of a group.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit, types

from rfgen_sionna.signal.vector_intrinsics import LANES, add3, cos_sin, multiply, multiply_add, set3

POSITIONS = 256
"""Positions between two cells for which taps are tabulated; first-order terms bridge the rest."""
DEGREE = 2
"""Degree of the polynomials in u."""
_SOURCES = 9
"""Vectors that are spread: gain, its slopes over u and v, each also times j, its u^2, v^2 and u v coefficients."""


_READ4, _READ2 = (
    types.Array(number, dim, "A", readonly=True) for number, dim in ((types.complex128, 4), (types.float64, 2))
)
_READ5 = types.Array(types.complex128, 5, "A", readonly=True)
_DELAYS = types.Array(types.float64, 4, "A", readonly=True)
_FAST = {"contract", "reassoc", "nsz", "arcp"}
_SCALARS = (types.float64,) * 5


@njit(
    types.void(
        _READ4, _READ5, _READ2, _DELAYS, types.intp, types.intp, types.float64, types.float64[:, ::1],
        types.float32[:, :, :, ::1], types.float64[:, :, ::1],
    ),
    cache=True, nogil=True, fastmath=_FAST,
)  # fmt: skip
def tabulate(
    a: Any, dispersion: Any, amplitude: Any, tau: Any, tx: Any, first: Any, lower: Any, powers: Any, gains: Any,
    delays: Any,
) -> Any:  # fmt: skip
    """Conjugate gains and delays of one Tx and the Rx from `first` on.

    Writes `gains` (path, order of u, knot, 2 `LANES`) and `delays` (path, knot, `LANES`) [s], the last Rx again in the
    lanes without one. Values at the paths' knots are `a` (tx, rx, path, knot), `dispersion` (order, tx, rx, path,
    knot), `amplitude` (path, knot), `tau` (tx, rx, path, knot). The frequency falls by `lower` half bands per second
    of delay; `powers` (order of u, order) takes powers of the frequency to powers of u.
    """
    orders, knots, last = len(dispersion) + 1, tau.shape[3], tau.shape[1] - 1
    real, imaginary = np.empty(orders), np.empty(orders)
    for path in range(len(delays)):
        for lane in range(LANES):
            rx = first + lane if first + lane < last else last
            of_tau = tau[tx, rx, path]
            for knot in range(knots):
                delays[path, knot, lane] = of_tau[knot]
            if first + lane > last:
                continue
            of_a, of_dispersion = a[tx, rx, path], dispersion[:, tx, rx, path]
            for knot in range(knots):
                size = amplitude[path, knot]
                real[0], imaginary[0] = of_a[knot].real * size, -of_a[knot].imag * size
                for n in range(1, orders):
                    value = of_dispersion[n - 1, knot]
                    real[n], imaginary[n] = value.real * size, -value.imag * size
                # As in `path_phases.conjugate_gains`: the frequency sent at t - tau.
                less = lower * of_tau[knot]
                if orders <= 2:
                    high = 0.0
                    if orders == 2:
                        high = powers[0, 0] * less + powers[0, 1]
                        gains[path, 1, knot, 2 * lane] = powers[1, 1] * real[1]
                        gains[path, 1, knot, 2 * lane + 1] = powers[1, 1] * imaginary[1]
                    gains[path, 0, knot, 2 * lane] = powers[0, 0] * real[0] + high * real[orders - 1]
                    gains[path, 0, knot, 2 * lane + 1] = powers[0, 0] * imaginary[0] + high * imaginary[orders - 1]
                    continue
                for least in range(orders - 1):
                    for n in range(orders - 2, least - 1, -1):
                        real[n] += less * real[n + 1]
                        imaginary[n] += less * imaginary[n + 1]
                for q in range(gains.shape[1]):
                    x, y = 0.0, 0.0
                    for n in range(orders):
                        x += powers[q, n] * real[n]
                        y += powers[q, n] * imaginary[n]
                    gains[path, q, knot, 2 * lane] = x
                    gains[path, q, knot, 2 * lane + 1] = y


@njit(fastmath=_FAST)
def _mean(values: Any, n: int) -> float:
    return 0.25 * (values[n] + values[n + 1] + values[n + 2] + values[n + 3])


@njit(fastmath=_FAST)
def _interpolate(delays: Any, path: Any, weights: Any, block: Any, derivatives: Any, out: Any) -> Any:
    """Delay and its `derivatives` in v, for each lane, from (path, knot, lane), by the weights of a block."""
    first, padded = path * weights.shape[2], weights.shape[2]
    for n in range(derivatives + 1):
        set3(
            out, LANES * n, delays, first * LANES, weights[block, n, 0], weights[block, n, 1], weights[block, n, 2]
        )  # fmt: skip
        for knot in range(3, padded, 3):
            add3(
                out, LANES * n, delays, (first + knot) * LANES,
                weights[block, n, knot], weights[block, n, knot + 1], weights[block, n, knot + 2],
            )  # fmt: skip


@njit(fastmath=_FAST)
def _interpolate_gains(x: Any, target: Any, gains: Any, place: Any, weights: Any, row: Any, add: Any) -> Any:
    """Write the gains of a `place`, counted in paths and orders, by a row of the weights (row, knot) to the vector
    `target` of x, or `add` them."""
    padded, vector = weights.shape[1], 2 * LANES
    first, into = place * padded * vector, target * vector
    if add:
        add3(x, into, gains, first, weights[row, 0], weights[row, 1], weights[row, 2])
    else:
        set3(x, into, gains, first, weights[row, 0], weights[row, 1], weights[row, 2])
    for knot in range(3, padded, 3):
        add3(
            x, into, gains, first + knot * vector, weights[row, knot], weights[row, knot + 1], weights[row, knot + 2]
        )  # fmt: skip


@njit(fastmath=_FAST)
def _power(x: Any, target: Any) -> Any:
    total = 0.0
    for n in range(2 * LANES * target, 2 * LANES * (target + 1)):
        total += np.float64(x[n]) * np.float64(x[n])
    return total


@njit(fastmath=_FAST)
def _angles(at: Any, f: Any, mu: Any, per_u: Any, half: Any, rate: Any) -> Any:
    """Mean over the lanes of the phase's coefficients [rad] of uv, v^2, v^3, u^2 and u v^2."""
    d, d1, d2, d3 = _mean(at, 0), _mean(at, LANES), _mean(at, 2 * LANES), _mean(at, 3 * LANES)
    lower, slope = f - mu * d, rate * d1
    uv = 2 * np.pi * per_u * (mu * d1 + rate * (d2 * lower - mu * d1 * d1))
    vv = np.pi * (d2 * lower - mu * d1 * d1)
    vvv = np.pi * (d3 * lower / 3 - mu * d1 * d2)
    uu = 2 * np.pi * half * half * (mu * slope * (1 - 0.5 * slope) + 0.5 * f * rate * rate * d2)
    uvv = np.pi * per_u * (mu * d2 + rate * d3 * lower)
    return uv, vv, vvv, uu, uvv


@njit(
    types.UniTuple(types.float64, 2)(types.float64[:, :, ::1], types.float64[:, :, ::1], *_SCALARS),
    cache=True, nogil=True, fastmath=_FAST,
)  # fmt: skip
def beat_bounds(delays: Any, weights: Any, f: Any, mu: Any, per_u: Any, half: Any, rate: Any) -> Any:
    """Least and largest beat [cycles over u = 0 … 1] at the middles of the blocks; arguments as :func:`spread`."""
    low, high, at = np.inf, -np.inf, np.empty(4 * LANES)
    for block in range(len(weights)):
        for path in range(len(delays)):
            _interpolate(delays, path, weights, block, 1, at)
            d = _mean(at, 0)
            beat = per_u * (mu * d + rate * _mean(at, LANES) * (f - mu * d))
            low = beat if beat < low else low
            high = beat if beat > high else high
    return low, high


@njit(
    types.float64[::1](types.float32[:, :, :, ::1], types.float64[:, :, ::1], types.float64[:, :, ::1], *_SCALARS),
    cache=True, nogil=True, fastmath=_FAST,
)  # fmt: skip
def moments(gains: Any, delays: Any, weights: Any, f: Any, mu: Any, per_u: Any, half: Any, rate: Any) -> Any:
    """Sums over paths and instants of the gains' power (0); of the squares that the second order leaves out, by powers
    of v from 0 to 12 in steps of two (1 … 7); of those of v^3 and v^4 (8, 9); and of the squares of the coefficients of
    u, v, v^2, u^2 v^2 and u^2 (10 … 14). Arguments as :func:`spread`.
    """
    out, at, x = np.zeros(15), np.empty(4 * LANES), np.zeros(12 * LANES, np.float32)
    orders, rho2 = gains.shape[1], (per_u * rate) ** 2
    for block in range(len(weights)):
        single = weights[block].astype(np.float32)
        for path in range(len(delays)):
            _interpolate(delays, path, weights, block, 3, at)
            uv, vv, vvv, uu, uvv = _angles(at, f, mu, per_u, half, rate)
            for n in range(4):
                _interpolate_gains(x, n, gains, path * orders, single, n, False)
            if orders > 1:
                _interpolate_gains(x, 4, gains, path * orders + 1, single, 0, False)
                _interpolate_gains(x, 5, gains, path * orders + 1, single, 2, False)
            g, g1, g2, g3 = _power(x, 0), _power(x, 1), _power(x, 2) / 4, _power(x, 3) / 36
            s, s2 = _power(x, 4), _power(x, 5) / 4
            # Deviation of the lanes from their mean.
            d, d1, over_u, over_v = _mean(at, 0), _mean(at, LANES), 0.0, 0.0
            for lane in range(LANES):
                of_u = abs(2 * np.pi * per_u * mu * (at[lane] - d))
                of_v = abs(2 * np.pi * f * (at[LANES + lane] - d1))
                over_u = of_u if of_u > over_u else over_u
                over_v = of_v if of_v > over_v else over_v
            uv2, vv2, uu2, vvv2 = uv * uv, vv * vv, uu * uu, vvv * vvv
            out[0] += g
            out[1] += g * (uu2 * uu2 * uu2 / 468 + over_u**6 / 252 + over_u**4 * uu2 / 36) + s * uu2 * uu2 / 44
            out[1] += s * over_u**4 / 28
            # Gains and the cube of the phase that change within the chirp.
            out[1] += g1 * rho2 / 3 + g * vvv2 * rho2**3 / 7
            out[2] += g * over_u**4 * uv2 / 84
            out[3] += s2 / 15 + s * uv2 * uv2 / 140
            out[4] += g * (uv2 * uv2 * uv2 / 1764 + over_v**6 / 252 + uvv * uvv * uv2 / 35)
            out[4] += g1 * uv2 * uv2 / 140 + g2 * uv2 / 21 + g3 / 7
            out[5] += g * (uv2 * uv2 * vv2 / 180 + uv2 * vvv2 / 27) + g1 * vvv2 / 9 + g2 * vv2 / 9
            out[6] += g * (uv2 * vv2 * vv2 / 132 + vv2 * vvv2 / 11) + g1 * vv2 * vv2 / 44
            out[7] += g * (vv2 * vv2 * vv2 / 468 + vvv2 * vvv2 / 52)
            out[8] += g * (vvv2 + uv2 * vv2 / 3) + g1 * vv2
            out[9] += g * vv2 * vv2 / 4
            out[10] += g * over_u * over_u + s
            out[11] += g * (uv2 / 3 + over_v * over_v) + g1
            out[12] += g * vv2 + g2
            out[13] += g * uv2 * uv2 / 20
            out[14] += g * uu2
    return out


@njit(fastmath=_FAST)
def _put(terms: Any, powers: Any, p: Any, q: Any, source: Any, turned: Any, value: Any) -> Any:
    """Add `value` times a source, or j times it if `turned`, to the factor of v^p u^q, over j for each odd power."""
    quarter = (p & 1) + (q & 1) + turned
    terms[(q * powers + p) * 6 + source + (quarter & 1)] += -value if quarter > 1 else value


@njit(fastmath=_FAST)
def _put_v(terms: Any, powers: Any, p: Any, q: Any, source: Any, turned: Any, value: Any, reduction: Any) -> Any:
    """:func:`_put` of a power p of v that may be beyond the highest."""
    if p < powers:
        _put(terms, powers, p, q, source, turned, value)
    else:
        _put(terms, powers, 0, q, source, turned, value * reduction[p, 0])
        _put(terms, powers, 1, q, source, turned, value * reduction[p, 1])
        _put(terms, powers, 2, q, source, turned, value * reduction[p, 2])


@njit(fastmath=_FAST)
def _put_u(terms: Any, powers: Any, p: Any, q: Any, source: Any, turned: Any, value: Any, reduction: Any) -> Any:
    """:func:`_put` of a power q of u beyond `DEGREE`."""
    _put(terms, powers, p, 0, source, turned, value * reduction[q, 0])
    _put(terms, powers, p, 1, source, turned, value * reduction[q, 1])
    _put(terms, powers, p, 2, source, turned, value * reduction[q, 2])


@njit(fastmath=_FAST)
def _expand(terms: Any, powers: Any, angles: Any, over_v: Any, over_u: Any) -> Any:
    """Products of the sources G, G1 u and H v with exp(j angle) to the second order, into flat (q, p, source)."""
    uv, vv, vvv = np.float32(angles[0]), np.float32(angles[1]), np.float32(angles[2])
    uu, uvv, one, half = np.float32(angles[3]), np.float32(angles[4]), np.float32(1), np.float32(0.5)
    for n in range(len(terms)):
        terms[n] = np.float32(0)
    g, g1, h = 0, 2, 4
    _put(terms, powers, 0, 0, g, 0, one)
    _put(terms, powers, 1, 1, g, 1, uv)
    _put(terms, powers, 2, 0, g, 1, vv)
    _put(terms, powers, 0, 2, g, 1, uu)
    _put(terms, powers, 2, 1, g, 1, uvv)
    _put_v(terms, powers, 3, 0, g, 1, vvv, over_v)
    _put(terms, powers, 2, 2, g, 0, -half * uv * uv - vv * uu)
    _put_v(terms, powers, 4, 0, g, 0, -half * vv * vv, over_v)
    _put_v(terms, powers, 3, 1, g, 0, -uv * vv, over_v)
    _put_u(terms, powers, 1, 3, g, 0, -uv * uu, over_u)
    _put_u(terms, powers, 0, 4, g, 0, -half * uu * uu, over_u)
    _put(terms, powers, 0, 1, g1, 0, one)
    _put(terms, powers, 1, 2, g1, 1, uv)
    _put(terms, powers, 2, 1, g1, 1, vv)
    _put_u(terms, powers, 0, 3, g1, 1, uu, over_u)
    _put(terms, powers, 1, 0, h, 0, one)
    _put(terms, powers, 2, 1, h, 1, uv)
    _put(terms, powers, 1, 2, h, 1, uu)
    _put_v(terms, powers, 3, 0, h, 1, vv, over_v)


@njit(fastmath=_FAST)
def _turned(raw: Any, factors: Any, x: Any) -> Any:
    """Sources x from the gain (0), its slopes over u (1) and v (2), and its coefficients of u^2, v^2 and u v (3 … 5).

    `factors` are the phasor (0) and the lanes' deviations from the mean [rad] over u and v, times j (1, 2).
    """
    v = 2 * LANES
    for n in range(3):
        multiply(x, 2 * n * v, raw, n * v, factors, 0)
        multiply(x, (6 + n) * v, raw, (3 + n) * v, factors, 0)
    # Deviations to the second order: (1 + j over + (j over)^2 / 2) times the gain.
    for n in range(2):
        multiply(raw, n * v, x, 0, factors, (n + 1) * v)
    half, none = np.float32(0.5), np.float32(0)
    multiply_add(x, 8 * v, x, 4 * v, factors, v)
    multiply_add(x, 8 * v, x, 2 * v, factors, 2 * v)
    multiply_add(x, 8 * v, raw, 0, factors, 2 * v)
    for n in range(2):
        add3(x, (2 + 2 * n) * v, raw, n * v, half, none, none)
        multiply_add(x, (6 + n) * v, x, (2 + 2 * n) * v, factors, (n + 1) * v)
        add3(x, (2 + 2 * n) * v, raw, n * v, half, none, none)
    for n in range(3):
        multiply(x, (2 * n + 1) * v, x, 2 * n * v, factors, 3 * v)


@njit(fastmath=_FAST)
def _place(turns: Any, taps: Any) -> Any:
    """First cell of an even or odd number of taps, and the tabulated position and its turns, of a point of `turns` per
    unit of v or u: four cells a turn."""
    shift = 0.5 * POSITIONS * (taps & 1)
    steps = np.floor(4 * POSITIONS * turns + shift)
    cell = np.floor(steps / POSITIONS)
    first = np.intp(cell) - (taps - 1) // 2
    return first, np.intp(steps - POSITIONS * cell), (steps + 0.5 - shift) / (4 * POSITIONS)


@njit(
    types.void(
        types.float32[:, :, :, ::1], types.float64[:, :, ::1], types.float64[:, :, ::1], *_SCALARS,
        types.float32[:, :, ::1], types.float32[:, :, ::1], types.float32[:, ::1], types.float32[:, ::1],
        types.intp, types.intp, types.float32[:, :, :, ::1],
    ),
    cache=True, nogil=True, fastmath=_FAST,
)  # fmt: skip
def spread(
    gains: Any, delays: Any, weights: Any, f: Any, mu: Any, per_u: Any, half: Any, rate: Any, doppler_taps: Any,
    beat_taps: Any, over_v: Any, over_u: Any, first: Any, period: Any, grid: Any,
) -> Any:  # fmt: skip
    """Add all paths to `grid` (block, Doppler, beat, 2 `LANES`), whose beats begin at the cell `first` and repeat after
    `period` cells, if that is not 0.

    `gains` and `delays` are those of :func:`tabulate`, padded to a multiple of three knots; `weights` (block,
    derivative in v, knot) interpolate them at the middles of the blocks. `f` [Hz] is the frequency there, `mu` the
    slope [Hz/s], `per_u` half the ADC window in whole samples [s], `half` the same of the parameter u [s], `rate` the
    change of v per second. Taps are (position, power, tap); `over_v` and `over_u` (power, lower power) reduce powers.
    """
    vector, powers = 2 * LANES, doppler_taps.shape[1]
    raw, sources = np.zeros(6 * vector, np.float32), np.zeros((_SOURCES + 2) * vector, np.float32)
    factors = np.zeros(4 * vector, np.float32)
    for lane in range(LANES):
        factors[3 * vector + 2 * lane + 1] = 1
    terms = np.empty((DEGREE + 1) * powers * 6, np.float32)
    folded, line = np.empty((DEGREE + 1) * powers * vector, np.float32), np.empty((DEGREE + 1) * vector, np.float32)
    at = np.empty(4 * LANES)
    dopplers, beats, orders = grid.shape[1], grid.shape[2], gains.shape[1]
    rows, columns = doppler_taps.shape[2], beat_taps.shape[2]
    one, none, single = np.float32(1), np.float32(0), np.empty((5, weights.shape[2]), np.float32)
    for block in range(len(weights)):
        # Value, slope, v^2 coefficient; slope over u and u v coefficient of what changes within the window.
        for n, derivative, scale in ((0, 0, 1.0), (1, 1, 1.0), (2, 2, 0.5), (3, 1, half * rate), (4, 2, half * rate)):
            single[n] = scale * weights[block, derivative]
        for path in range(len(delays)):
            _interpolate(delays, path, weights, block, 3, at)
            d, d1 = _mean(at, 0), _mean(at, LANES)
            row, d_place, v_turns = _place(d1 * (f - mu * d), rows)
            column, b_place, u_turns = _place(per_u * (mu * d + rate * d1 * (f - mu * d)), columns)
            column = column % period if period else column - first
            place = path * orders
            _interpolate_gains(raw, 0, gains, place, single, 0, False)
            _interpolate_gains(raw, 1, gains, place, single, 3, False)
            _interpolate_gains(raw, 2, gains, place, single, 1, False)
            _interpolate_gains(raw, 4, gains, place, single, 2, False)
            _interpolate_gains(raw, 5, gains, place, single, 4, False)
            if orders > 1:
                _interpolate_gains(raw, 1, gains, place + 1, single, 0, True)
                _interpolate_gains(raw, 5, gains, place + 1, single, 1, True)
            if orders > 2:
                _interpolate_gains(raw, 3, gains, place + 2, single, 0, False)
            for lane in range(LANES):
                own, doppler = at[lane], at[LANES + lane] * (f - mu * at[lane])
                cosine, sine = cos_sin(own * (f - 0.5 * mu * own))
                factors[2 * lane] = cosine
                factors[2 * lane + 1] = sine
                factors[vector + 2 * lane + 1] = 2 * np.pi * (per_u * (mu * own + rate * doppler) - u_turns)
                factors[2 * vector + 2 * lane + 1] = 2 * np.pi * (doppler - v_turns)
            _turned(raw, factors, sources)
            _expand(terms, powers, _angles(at, f, mu, per_u, half, rate), over_v, over_u)
            for n in range((DEGREE + 1) * powers):
                set3(folded, n * vector, sources, 0, terms[6 * n], terms[6 * n + 1], terms[6 * n + 2])
                add3(
                    folded, n * vector, sources, 3 * vector, terms[6 * n + 3], terms[6 * n + 4], terms[6 * n + 5]
                )  # fmt: skip
            add3(folded, 2 * powers * vector, sources, 6 * vector, one, none, none)
            add3(folded, 2 * vector, sources, 7 * vector, one, none, none)
            add3(folded, (powers + 1) * vector, sources, 8 * vector, -one, none, none)
            row %= dopplers
            for tap in range(rows):
                target = ((block * dopplers + row) * beats + column) * vector
                row = row + 1 if row + 1 < dopplers else 0
                for q in range(DEGREE + 1):
                    set3(
                        line, q * vector, folded, q * powers * vector,
                        doppler_taps[d_place, 0, tap], doppler_taps[d_place, 1, tap], doppler_taps[d_place, 2, tap],
                    )  # fmt: skip
                    for p in range(3, powers, 3):
                        add3(
                            line, q * vector, folded, (q * powers + p) * vector, doppler_taps[d_place, p, tap],
                            doppler_taps[d_place, p + 1, tap], doppler_taps[d_place, p + 2, tap],
                        )  # fmt: skip
                for k in range(columns):
                    add3(
                        grid, target + k * vector, line, 0,
                        beat_taps[b_place, 0, k], beat_taps[b_place, 1, k], beat_taps[b_place, 2, k],
                    )  # fmt: skip
