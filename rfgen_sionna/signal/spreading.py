"""Sums of paths over chirps as nonuniform Fourier transforms, in one kernel for the CPU and for CUDA devices.

Every lane of the kernel is one chirp of one element pair. It goes through the paths, evaluates each one's phase and
beat frequency at the chirp's own time from B-splines, and spreads it with the taps of :mod:`rfgen_sionna.signal.taps`
on a grid of its own; a transform of the grids follows. What changes over the ADC window, the small quadratic phase and
the gain, goes into the taps: it takes no further transform.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from rfgen_sionna.records import ComplexArray, FloatArray
from rfgen_sionna.signal.taps import Taps, Term, deconvolution, taps

PHASE, BEAT, QUADRATIC, GAINS = 0, 1, 2, 3
"""Fields of a table: cycles at the window's middle, cycles per sample, cycles of the quadratic phase, then real and
imaginary part of the gain's coefficient of each order."""
_SINGLE = 3e-7  # tolerance below which phases are turned in double precision
_CUDA_LANES, _MOST_SHARES = 1 << 16, 32


@dataclass(frozen=True)
class Lanes:
    """What the kernel runs over."""

    table: FloatArray
    """(row, path, field) coefficients; the fields are padded to a multiple of 4."""
    rows: NDArray[np.intp]
    """(lane,) first row of the table that counts."""
    weights: FloatArray
    """(lane, coefficient) of that row and the next ones: a field is their weighted sum."""


def spread(
    lanes: Lanes,
    count: int,
    terms: Sequence[Term],
    width: int,
    eps: float,
    device: str,
    shares: int | None = None,
) -> ComplexArray:
    """(lane, count) samples of all lanes, modes -count // 2 … at u = mode / (count / 2).

    Sums over the paths, with the fields at each lane's own time,

        exp(j 2 pi phase) exp(j 2 pi beat mode) sum_m gain_m u^m sum_n (j 2 pi quadratic T_2(u))^n / n!

    for the (m, n) of `terms`. `device` is "cpu" or "cuda". `shares` lanes of the kernel share a chirp, each with a grid
    of its own, so that the order of the sums is always the same; None takes what suits the device.
    """
    if shares is None:
        shares = (
            1 if device == "cpu" else max(1, min(_MOST_SHARES, lanes.table.shape[1], _CUDA_LANES // len(lanes.rows)))
        )
    grid = _grids(lanes, count, terms, width, eps, device, shares)
    size, cells = 2 * count, grid.shape[1]
    # Cells beyond either end are those at the other one; a grid of few cells they go round several times.
    lead = _lead(width)
    whole = grid[:, lead : lead + size]
    for cell in (*range(lead), *range(lead + size, cells)):
        whole[:, (cell - lead) % size] += grid[:, cell]
    modes = np.arange(count) - count // 2
    # The inverse transform has the kernel's sign; its factor 1 / size is taken back.
    spectrum = fft.ifft(whole, axis=-1, norm="forward", overwrite_x=True)
    return np.asarray(spectrum[:, modes % size] * deconvolution(width, count))


def _lead(width: int) -> int:
    return width // 2 + 1


def _grids(
    lanes: Lanes, count: int, terms: Sequence[Term], width: int, eps: float, device: str, shares: int
) -> ComplexArray:
    """(lane, cell) grids of 2 count cells with a margin on both sides."""
    import drjit as dr

    types = _types(device)
    real, index = types.Float64, types.UInt32
    paths, fields = lanes.table.shape[1:]
    size, cells = 2 * count, 2 * count + 2 * _lead(width) + 1
    number = len(lanes.rows)
    table = real(lanes.table.ravel())
    lane = dr.arange(index, number * shares) // index(dr.opaque(index, shares))
    share = dr.arange(index, number * shares) - lane * dr.opaque(index, shares)
    row = dr.gather(index, index(lanes.rows.astype(np.uint32)), lane)
    weights = [dr.gather(real, real(np.ascontiguousarray(column)), lane) for column in lanes.weights.T]
    grid = dr.zeros(real, 2 * number * cells * shares)
    scale, rows, last = dr.opaque(real, float(size)), dr.opaque(index, cells), dr.opaque(index, paths)
    step, stride = dr.opaque(index, shares), dr.opaque(index, fields // 4)
    orders = sorted({order for order, _ in terms})
    powers = {order: sorted(n for m, n in terms if m == order) for order in orders}
    of = {term: taps(width, term) for term in terms}
    turn = types.Float32 if eps >= _SINGLE else real

    def one_path(p: Any) -> tuple[Any]:
        at = [((row + number) * last + p) * stride for number in range(len(weights))]
        values = []
        for k in range(fields // 4):
            total = weights[0] * dr.gather(types.Array4f64, table, at[0] + k)
            for weight, place in zip(weights[1:], at[1:], strict=True):
                total = dr.fma(dr.gather(types.Array4f64, table, place + k), weight, total)
            values += list(total)

        cycles = values[PHASE]
        cycles -= dr.round(cycles)
        sine, cosine = (real(part) for part in dr.sincos(turn(cycles) * turn(2 * np.pi)))
        beat = values[BEAT]
        place = (beat - dr.floor(beat)) * scale - 0.5 * width
        first = dr.ceil(place)
        v = 2 * (first - place) - 1
        target = (lane * rows + index(types.Int32(first) + _lead(width))) * step + share
        angle = 2 * np.pi * values[QUADRATIC] if any(n for _, n in terms) else real(0)
        strengths = []
        for order in orders:
            re, im = values[GAINS + 2 * order], values[GAINS + 2 * order + 1]
            re, im = re * cosine - im * sine, re * sine + im * cosine
            strengths.append((-im, re) if order % 2 else (re, im))
        for tap in range(width):
            out_re, out_im = real(0), real(0)
            for order, (re, im) in zip(orders, strengths, strict=True):
                direct, across = _expanded([(n, of[order, n]) for n in powers[order]], tap, v, angle, dr)
                out_re += re * direct if across is None else re * direct - im * across
                out_im += im * direct if across is None else im * direct + re * across
            both = types.Array2f64(out_re, out_im)
            dr.scatter_add(grid, both, target + tap * step, mode=dr.ReduceMode.NoConflicts)
        return (p + step,)

    dr.while_loop((share,), lambda p: p < last, one_path, labels=("path",))
    if shares > 1:
        cell = dr.arange(index, number * cells) * step
        total = types.Array2f64(0.0)
        for number_of_share in range(shares):
            total += dr.gather(types.Array2f64, grid, cell + number_of_share)
        grid = dr.ravel(total)
    dr.eval(grid)
    return np.asarray(grid.numpy()).view(np.complex128).reshape(number, cells)


def _expanded(powers: Sequence[tuple[int, Taps]], tap: int, v: Any, angle: Any, dr: Any) -> tuple[Any, Any]:
    """Real and imaginary part of sum_n (j angle)^n / n! times the tap's polynomials; None where there is none."""
    parts: list[Any] = [None, None]
    factor: Any = 1.0
    for n, found in powers:
        coefficients = found.coefficients[tap]
        polynomial = type(v)(float(coefficients[-1]))
        for coefficient in coefficients[-2::-1]:
            polynomial = dr.fma(polynomial, v, float(coefficient))
        if n:
            factor = factor * angle * (1.0 / n)
            polynomial = polynomial * factor
        signed = polynomial if n % 4 < 2 else -polynomial
        parts[n % 2] = signed if parts[n % 2] is None else parts[n % 2] + signed
    return parts[0], parts[1]


def _types(device: str) -> Any:
    return import_module("drjit.cuda" if device == "cuda" else "drjit.llvm")
