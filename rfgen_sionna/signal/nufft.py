"""Sums of paths over chirps as nonuniform Fourier transforms, in one kernel for the CPU and for CUDA devices.

A lane of the kernel is a chirp or a few of one element pair. For each path it evaluates phase and beat frequency at the
time of the chirp from B-splines, and spreads them with the interpolation kernel of
:mod:`rfgen_sionna.signal.nufft_kernel` on its own grid; a transform of the grids follows. The kernel includes the
quadratic phase and the change of the gain over the ADC window, without further transforms. Single precision is used
where the tolerance allows it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from rfgen_sionna._types import ComplexArray, FloatArray
from rfgen_sionna.signal.nufft_kernel import InterpolationKernel, Term, deconvolution, interpolation_kernel

PHASE, BEAT, QUADRATIC, GAINS = 0, 1, 2, 3
"""Fields of a table: cycles at the window's middle, cycles per sample, cycles of the quadratic phase, then real and
imaginary part of the gain's coefficient of each order."""
_SINGLE = 3e-7  # tolerance below which sine and cosine are of double precision
_CUDA_LANES, _MOST_SHARES = 1 << 16, 32  # lanes that fill a CUDA device; most lanes of one chirp, for memory
_CHIRPS_PER_LANE = 4
"""Chirps of a CPU lane with the same coefficients, which are read once."""


@dataclass(frozen=True)
class ChirpTable:
    """B-spline coefficients of all paths, and their weights at the time of each chirp."""

    table: NDArray[np.float64] | NDArray[np.float32]
    """(row, path, field) coefficients; the fields are padded to a multiple of 4. Single precision where
    :func:`single_precision_suffices`."""
    rows: NDArray[np.intp]
    """(lane,) first row of the table for this lane."""
    weights: FloatArray
    """(lane, coefficient) of that row and the next ones: a field is their weighted sum."""


def single_precision_suffices(phase: FloatArray, beat: FloatArray, count: int, eps: float) -> bool:
    """Whether single precision errs by at most a tenth of `eps`, with coefficients of `phase` [cycles] and of `beat`
    [cycles per sample] for `count` samples.

    Both are rounded to 2^-24 of their size, and so is the position on the grid; the beat counts `count` / 2 times at
    the outermost sample. The root mean square of uniform rounding is 0.3 of the sum.
    """
    turns = float(np.abs(phase).max(initial=0.0)) + 0.5 * count * max(1.0, float(np.abs(beat).max(initial=0.0)))
    return 0.3 * 2 * np.pi * 2.0**-24 * turns <= 0.1 * eps


def nonuniform_fft(
    lanes: ChirpTable, count: int, terms: Sequence[Term], width: int, eps: float, device: str, shares: int | None = None
) -> ComplexArray:
    """(lane, count) samples of all lanes, modes -count // 2 … at u = mode / (count / 2).

    Sums over the paths, with the fields at each lane's own time,

        exp(j 2 pi phase) exp(j 2 pi beat mode) sum_m gain_m u^m sum_n (j 2 pi quadratic T_2(u))^n / n!

    for the (m, n) of `terms`. `device` is "cpu" or "cuda". `shares` lanes of the kernel share a chirp, each with its
    own grid, so that the order of the sums is always the same; None takes 1 on the CPU, and fills a CUDA device.
    """
    if shares is None:
        shares = (
            1 if device == "cpu" else max(1, min(_MOST_SHARES, lanes.table.shape[1], _CUDA_LANES // len(lanes.rows)))
        )
    grid = _grids(lanes, count, terms, width, eps, device, shares)
    size, cells = 2 * count, grid.shape[1]
    # Periodic grid: the margins wrap around, several times in a small grid.
    lead = _lead(width)
    whole = grid[:, lead : lead + size]
    for cell in (*range(lead), *range(lead + size, cells)):
        whole[:, (cell - lead) % size] += grid[:, cell]
    modes = np.arange(count) - count // 2
    # The inverse transform has the kernel's sign; norm "forward" leaves out its factor 1 / size.
    spectrum = fft.ifft(whole, axis=-1, norm="forward", overwrite_x=True)
    return np.asarray(spectrum[:, modes % size] * deconvolution(width, count), dtype=np.complex128)


def _lead(width: int) -> int:
    return width // 2 + 1


def _grids(
    lanes: ChirpTable, count: int, terms: Sequence[Term], width: int, eps: float, device: str, shares: int
) -> ComplexArray:
    """(lane, cell) grids of 2 count cells with a margin on both sides."""
    import drjit as dr

    types = _types(device)
    index = types.UInt32
    single = lanes.table.dtype == np.float32
    names = ("Float", "Array2f", "Array4f") if single else ("Float64", "Array2f64", "Array4f64")
    real, pair, four = (getattr(types, name) for name in names)
    paths, fields = lanes.table.shape[1:]
    size, cells = 2 * count, 2 * count + 2 * _lead(width) + 1
    number = len(lanes.rows)
    table = real(lanes.table.ravel())
    members = _groups(lanes.rows, _CHIRPS_PER_LANE if device == "cpu" else 1)
    group = dr.arange(index, len(members) * shares) // index(dr.opaque(index, shares))
    share = dr.arange(index, len(members) * shares) - group * dr.opaque(index, shares)

    def of_group(values: NDArray[Any]) -> Any:
        kind = index if values.dtype.kind == "i" else real
        return dr.gather(kind, kind(np.ascontiguousarray(values, np.uint32 if kind is index else None)), group)

    row = of_group(lanes.rows[members[:, 0]])
    # One more grid, for the empty lanes of groups.
    of_lane = np.concatenate([lanes.weights, np.zeros((1, lanes.weights.shape[1]))]).astype(lanes.table.dtype)
    lines = [of_group(column) for column in members.T]
    weights = [[of_group(column) for column in of_lane[own].T] for own in members.T]
    grid = dr.zeros(real, 2 * (number + 1) * cells * shares)
    scale, rows, last = dr.opaque(real, float(size)), dr.opaque(index, cells), dr.opaque(index, paths)
    step, stride = dr.opaque(index, shares), dr.opaque(index, fields // 4)
    orders = sorted({order for order, _ in terms})
    powers = {order: sorted(n for m, n in terms if m == order) for order in orders}
    of = {term: interpolation_kernel(width, term) for term in terms}
    turn = types.Float if eps >= _SINGLE else real

    def one_path(p: Any) -> tuple[Any]:
        at = [((row + number) * last + p) * stride for number in range(len(weights[0]))]
        read = [[dr.gather(four, table, place + k) for place in at] for k in range(fields // 4)]
        for line, own in zip(lines, weights, strict=True):
            one_lane(line, [value for each in read for value in _mean(each, own, dr)])
        return (p + step,)

    def one_lane(line: Any, values: list[Any]) -> None:
        cycles = values[PHASE]
        cycles -= dr.round(cycles)
        sine, cosine = (real(part) for part in dr.sincos(turn(cycles) * turn(2 * np.pi)))
        beat = values[BEAT]
        place = (beat - dr.floor(beat)) * scale - 0.5 * width
        first = dr.ceil(place)
        v = 2 * (first - place) - 1
        target = (line * rows + index(types.Int32(first) + _lead(width))) * step + share
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
            dr.scatter_add(grid, pair(out_re, out_im), target + tap * step, mode=dr.ReduceMode.NoConflicts)

    dr.while_loop((share,), lambda p: p < last, one_path, labels=("path",))
    if shares > 1:
        cell = dr.arange(index, (number + 1) * cells) * step
        total = pair(0.0)
        for number_of_share in range(shares):
            total += dr.gather(pair, grid, cell + number_of_share)
        grid = dr.ravel(total)
    dr.eval(grid)
    sums: ComplexArray = np.asarray(grid.numpy()).view(np.complex64 if single else np.complex128)
    return sums.reshape(number + 1, cells)[:-1]


def _groups(rows: NDArray[np.intp], most: int) -> NDArray[np.int64]:
    """(group, most) consecutive lanes of the same row, padded with len(rows)."""
    lane = np.arange(len(rows))
    start = np.flatnonzero(np.diff(rows, prepend=-1))
    within = lane - np.repeat(start, np.diff(start, append=len(rows)))
    group = np.cumsum(within % most == 0) - 1
    members = np.full((int(group[-1]) + 1, most), len(rows))
    members[group, within % most] = lane
    return members


def _mean(values: Sequence[Any], weights: Sequence[Any], dr: Any) -> Any:
    total = weights[0] * values[0]
    for weight, value in zip(weights[1:], values[1:], strict=True):
        total = dr.fma(value, weight, total)
    return total


def _expanded(
    powers: Sequence[tuple[int, InterpolationKernel]], tap: int, v: Any, angle: Any, dr: Any
) -> tuple[Any, Any]:
    """Real and imaginary part of sum_n (j angle)^n / n! times the tap's polynomials; None for an absent part."""
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
