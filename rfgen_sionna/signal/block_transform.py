"""Sums of paths over blocks of loops, as a nonuniform Fourier transform over beat and Doppler at once.

Within a block of L loops and an ADC window, with v = loop / (L / 2) and u = sample / (N / 2) from -1 to 1, the phase of
a path is a constant, a Doppler frequency in v, a beat frequency in u, and a small angle

    X u v + Q v^2 + R v^3 + P u^2 + Y u v^2

of range migration, acceleration and motion within the chirp. The exponential of the angle is expanded to the second
order; its powers of u and v and those of the gain go into the taps of :mod:`rfgen_sionna.signal.nufft_kernel`, which
spread the paths on the grid of a block. Powers beyond the highest are replaced by the polynomial of least squares. The
Rx of a group share the taps: their deviations from the group's mean are expanded, too.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from rfgen_sionna._types import FloatArray
from rfgen_sionna.radar import Radar
from rfgen_sionna.records import RadarPaths, knot_weights
from rfgen_sionna.signal.nufft_kernel import deconvolution, interpolation_kernel, width_for
from rfgen_sionna.signal.path_phases import AdcWindow, element_gains, frequency_powers

LEAST_EPS = 1e-3
"""Least tolerance."""
_LOOPS = (64, 32, 16, 8, 4)
_FEW, _MANY = 3, 6  # powers of v, without and with the square of the curvature
_TAPS_SHARE, _BLOCK_SHARE = 0.4, 0.7  # of the tolerance: either interpolation, and the terms left out
_INSTANTS = 6  # least number of chirps at which the error is estimated; paths with more knots change faster
_CELLS = 1 << 19  # vectors of a grid, 16 MB
_DENSE = 0.75  # beats per sample below which a matrix product is faster than FFTs


class BlockPlan(NamedTuple):
    """Form of the blocks of one frame."""

    loops: int
    powers: int
    """Number of powers of v."""
    doppler_taps: int
    beat_taps: int


class _Tables(NamedTuple):
    """Values of one Tx and a group of Rx at knots, as :func:`rfgen_sionna.signal.block_kernels.tabulate` has them."""

    gains: NDArray[np.float32]
    delays: FloatArray


def block_sums(
    radar: Radar, paths: RadarPaths, start: float, channels: list[tuple[int, int]], eps: float
) -> Iterator[tuple[tuple[int, int, slice], NDArray[np.complex64]]] | None:
    """(chirp, rx, sample) of a group of Rx for each (entry of the axis "tx", Tx) of `channels`; None if blocks are not
    within the relative error `eps`, estimated from the first group.

    Parameters as of :func:`rfgen_sionna.signal.synthesize`; the radar has one profile.
    """
    window = AdcWindow.of(radar)
    if len(paths.times) == 1:
        ends = start + np.array([0.0, radar.waveform.frame_length + 2 * window.middle])
        paths = paths_of_constant_rate(paths, ends)
    groups = _Groups(radar, paths, start, window)
    first = groups.table(channels[0][1], 0)
    plan = groups.plan(first, channels[0][0], eps)
    return None if plan is None else _echoes(groups, plan, channels, first)


def paths_of_constant_rate(paths: RadarPaths, times: FloatArray) -> RadarPaths:
    """Paths of a single knot with the knots `times` [s]; directions stay."""
    tau = paths.tau + paths.tau_rate * (times - paths.times[0])
    return replace(paths, tau=tau, times=times)


def _echoes(
    groups: _Groups, plan: BlockPlan, channels: list[tuple[int, int]], first: _Tables
) -> Iterator[tuple[tuple[int, int, slice], NDArray[np.complex64]]]:
    from rfgen_sionna.signal.block_kernels import LANES

    count = len(groups.radar.rx_positions)
    for number, (entry, tx) in enumerate(channels):
        for rx in range(0, count, LANES):
            tables = first if number == rx == 0 else groups.table(tx, rx)
            samples = groups.samples(tables, entry, plan)
            size = min(LANES, count - rx)
            yield (entry, tx, slice(rx, rx + size)), samples[:, :size]


class _Groups:
    """Tables and sums of the groups of Rx of one frame."""

    def __init__(self, radar: Radar, paths: RadarPaths, start: float, window: AdcWindow) -> None:
        self.radar, self.paths, self.start, self.window = radar, paths, start, window
        wave = radar.waveform
        self.knots = -(-len(paths.times) // 3) * 3
        full = paths.tau.shape
        self.a = np.broadcast_to(paths.a, full)
        none = np.zeros((0, *full), np.complex128)
        self.dispersion = none if paths.dispersion is None else np.broadcast_to(
            paths.dispersion, (len(paths.dispersion), *full))  # fmt: skip
        self.amplitude = np.broadcast_to(element_gains(radar, paths), full[2:])
        self.powers, self.lower = np.ones((1, 1)), 0.0
        if paths.dispersion is not None:
            self.powers = frequency_powers(radar, paths, window, len(paths.dispersion) + 1)
            self.lower = -wave.slope / paths.half_band
        self.over_u = _reduction(window.count, max(len(self.powers), 5))
        middle = wave.start_frequency + wave.slope * window.middle
        self.scalars = (middle, wave.slope, 0.5 * window.count * window.step, window.half)

    def table(self, tx: int, rx: int) -> _Tables:
        from rfgen_sionna.signal import block_kernels

        count, lanes = self.paths.num_paths, block_kernels.LANES
        gains = np.zeros((count, min(3, len(self.powers)), self.knots, 2 * lanes), np.float32)
        delays = np.zeros((count, self.knots, lanes))
        powers = np.ascontiguousarray(self.over_u[: len(self.powers)].T @ self.powers)
        block_kernels.tabulate(
            self.a, self.dispersion, self.amplitude, self.paths.tau, tx, rx, self.lower, powers, gains, delays
        )
        return _Tables(gains, delays)

    def _weights(self, times: FloatArray, scale: float) -> FloatArray:
        """(time, derivative, knot) weights at `times` [s] from the start for derivatives after time / `scale`."""
        found = [knot_weights(self.paths.times, self.start + times, n) * scale**n for n in range(4)]
        padding = ((0, 0), (0, 0), (0, self.knots - len(self.paths.times)))
        return np.ascontiguousarray(np.pad(np.stack(found, axis=1), padding))

    def plan(self, tables: _Tables, entry: int, eps: float) -> BlockPlan | None:
        """Largest blocks whose error is at most `eps`."""
        from rfgen_sionna.signal.block_kernels import moments

        wave = self.radar.waveform
        scale = 0.5 * wave.loop_period
        instants = max(_INSTANTS, len(self.paths.times))
        chirps = np.linspace(0, wave.num_loops - 1, min(instants, wave.num_loops))
        times = chirps * wave.loop_period + wave.chirp_times[0, entry] + self.window.middle
        found = moments(*tables, self._weights(times, scale), *self.scalars, 1 / scale)
        limit = (_BLOCK_SHARE * eps) ** 2 - self._dispersion_error() ** 2
        most = [loops for loops in _LOOPS if loops <= wave.num_loops]
        for largest, powers in [*((loops, powers) for loops in most for powers in (_FEW, _MANY)), (1, _FEW)]:
            blocks = -(-wave.num_loops // largest)
            loops = -(-wave.num_loops // blocks)
            if not found[0] > 0:
                return BlockPlan(loops, powers, 4, 4)  # silence
            if error(found, loops, powers) ** 2 <= limit:
                return BlockPlan(loops, powers, *_widths(found, loops, _TAPS_SHARE * eps))
        return None

    def _dispersion_error(self) -> float:
        """Relative error of powers of u beyond the second in the gain, of the first element pair."""
        if len(self.powers) <= 3 or self.paths.dispersion is None:
            return 0.0
        held = max(float(np.linalg.norm(self.paths.a[0, 0])), 1e-300)
        sizes = [1.0, *(float(np.linalg.norm(each[0, 0])) / held for each in self.paths.dispersion)]
        count, of_powers = len(self.powers), np.abs(self.powers) @ np.array(sizes)
        return sum(float(of_powers[n]) * _rms_left(self.window.count, max(count, 5), n) for n in range(3, count))

    def samples(self, tables: _Tables, entry: int, plan: BlockPlan) -> NDArray[np.complex64]:
        """(chirp, lane, sample)"""
        from rfgen_sionna.signal.block_kernels import LANES, beat_bounds, spread

        wave, count = self.radar.waveform, self.window.count
        blocks, scale = -(-wave.num_loops // plan.loops), 0.5 * plan.loops * wave.loop_period
        chirps = np.arange(blocks) * plan.loops + plan.loops // 2
        times = chirps * wave.loop_period + wave.chirp_times[0, entry] + self.window.middle
        weights = self._weights(times, scale)
        scalars = (*self.scalars, 1 / scale)
        low, high = beat_bounds(tables.delays, weights, *scalars)
        first = math.floor(4 * low) - plan.beat_taps
        beats, period = math.ceil(4 * high) + plan.beat_taps + 2 - first, 0
        if beats > 2 * count + plan.beat_taps:
            first, beats, period = 0, 2 * count + plan.beat_taps, 2 * count
        dopplers = 2 * plan.loops if plan.loops > 1 else 1
        over_v, over_u = (each.astype(np.float32) for each in (_reduction(plan.loops, 5), self.over_u))
        taps = _taps(plan.doppler_taps, plan.powers), _taps(plan.beat_taps, 3)
        step = max(1, _CELLS // (dopplers * beats))
        found = []
        for block in range(0, blocks, step):
            own = weights[block : block + step]
            grid = np.zeros((len(own), dopplers, beats, 2 * LANES), np.float32)
            spread(*tables, own, *scalars, *taps, over_v, over_u, first, period, grid)
            cells = grid.view(np.complex64)
            if plan.loops > 1:
                matrix = _doppler_matrix(plan.loops, plan.doppler_taps)
                cells = (matrix @ cells.reshape(len(own), dopplers, -1)).reshape(len(own), plan.loops, beats, LANES)
            lines = cells.transpose(0, 1, 3, 2).reshape(-1, beats)
            found.append(_over_beats(lines, first, count, plan.beat_taps))
        samples = found[0] if len(found) == 1 else np.concatenate(found)
        return samples.reshape(-1, LANES, count)[: wave.num_loops]


def error(moments: FloatArray, loops: int, powers: int) -> float:
    """Relative error of blocks of `loops`, from :func:`rfgen_sionna.signal.block_kernels.moments` of single loops."""
    if loops == 1:
        return math.sqrt(float(moments[1] / moments[0]))
    missed = float(moments[1:8] @ float(loops) ** (2 * np.arange(7)))
    if powers == _FEW:
        missed += float(moments[8]) * loops**6 * _rms_left(loops, 5, 3) ** 2
        missed += float(moments[9]) * loops**8 * _rms_left(loops, 5, 4) ** 2
    return math.sqrt(missed / float(moments[0]))


def _widths(moments: FloatArray, loops: int, eps: float) -> tuple[int, int]:
    """Numbers of taps over Doppler and beat, by the mean sizes of the powers of v and u."""
    u, v, vv, uuvv, uu = (
        math.sqrt(float(moment / moments[0]) * loops**power)
        for moment, power in zip(moments[10:], (0, 2, 4, 4, 0), strict=True)
    )
    across = v / math.sqrt(3)
    over_v = {(0, 0): 1.0, (1, 0): v, (2, 0): vv + uuvv}
    over_u = {(0, 0): 1.0, (1, 0): u + across, (2, 0): uu + uuvv}
    return width_for(over_v, eps) if loops > 1 else 1, width_for(over_u, eps)


def _points(count: int) -> FloatArray:
    return np.asarray((np.arange(count) - count // 2) / (0.5 * count))


@functools.lru_cache(maxsize=64)
def _rms_left(count: int, powers: int, power: int) -> float:
    """Root mean square of what the polynomial of :func:`_reduction` leaves of a power."""
    x = _points(count)
    left = x**power - np.vander(x, 3, increasing=True) @ _reduction(count, powers)[power]
    return float(np.sqrt(np.mean(np.square(left))))


@functools.lru_cache(maxsize=64)
def _reduction(count: int, powers: int) -> FloatArray:
    """(powers, 3) quadratic polynomials of least squares in place of the powers of u or v, at `count` points."""
    x = _points(count)
    found = np.linalg.lstsq(np.vander(x, 3, increasing=True), np.vander(x, powers, increasing=True), rcond=None)[0].T
    found[:3] = np.eye(3)
    return np.ascontiguousarray(found)


@functools.lru_cache(maxsize=32)
def _taps(width: int, powers: int) -> NDArray[np.float32]:
    """(position, power, tap) taps between two cells; a single one is that of the value."""
    from rfgen_sionna.signal.block_kernels import POSITIONS

    if width == 1:
        return np.ones((POSITIONS, 1, 1), np.float32) * np.eye(1, powers, dtype=np.float32)[..., None]
    v = 1 - 2 * (np.arange(POSITIONS) + 0.5) / POSITIONS
    tables = [
        np.polynomial.polynomial.polyval(v, interpolation_kernel(width, (power, 0)).coefficients.T)
        for power in range(powers)
    ]
    return np.ascontiguousarray(np.stack(tables).transpose(2, 0, 1), dtype=np.float32)


@functools.lru_cache(maxsize=32)
def _doppler_matrix(loops: int, taps: int) -> NDArray[np.complex64]:
    """(loop, cell)"""
    modes = np.arange(loops) - loops // 2
    turns = np.exp(2j * np.pi * np.outer(modes, np.arange(2 * loops)) / (2 * loops))
    return (deconvolution(taps, loops)[:, None] * turns).astype(np.complex64)


def _over_beats(lines: NDArray[np.complex64], first: int, count: int, taps: int) -> NDArray[np.complex64]:
    """(line, count) samples of grids (line, beat) that begin at the cell `first`."""
    size, beats = 2 * count, lines.shape[1]
    modes = np.arange(count) - count // 2
    if beats <= _DENSE * count:
        roots = np.exp(2j * np.pi * np.arange(size) / size)
        matrix = roots[np.outer(first + np.arange(beats), modes) % size] * deconvolution(taps, count)
        return np.asarray(lines @ matrix.astype(np.complex64))
    whole = np.zeros((len(lines), size), np.complex64)
    for low in range(0, beats, size):  # repeats after `size` cells
        part = lines[:, low : low + size]
        whole[:, : part.shape[1]] += part
    spectrum = fft.ifft(whole, axis=-1, norm="forward", overwrite_x=True)[:, modes % size]
    shift = np.exp(2j * np.pi * first * modes / size)
    return np.asarray(spectrum * (deconvolution(taps, count) * shift).astype(np.complex64))
