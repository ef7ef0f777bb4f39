"""FMCW synthesis: paths to dechirped samples, one nonuniform FFT per chirp and element pair.

Dechirping a path of delay tau(t) gives (FACTS of the trade: TI, Infineon and RF Genesis agree on the sign)

    s(t) = conj(A) exp(j 2 pi [f_c tau + mu t tau - mu tau^2 / 2])

with t counted from the start of the ramp. `A` is conjugated because the mixer multiplies the transmitted signal with
the conjugate of the received one. Around the middle t_m of the ADC window, u = t - t_m, the delay is
tau + rate u + curve u^2 / 2, which makes the phase a constant, a term in u (the beat frequency) and a small one in u^2.
The linear part is what the nonuniform FFT sums. The small one, like the change of the gain over the band, is a
polynomial in u, and each of its powers is one more transform over the same points.
"""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna.parallel import one_blas_thread
from rfgen_sionna.radar import Radar
from rfgen_sionna.records import ComplexArray, FloatArray, RadarPaths, knot_weights

_CHUNK = 200_000  # chirps x paths at a time: what a core's cache holds


def synthesize(
    radar: Radar,
    paths: RadarPaths,
    start: float,
    *,
    eps: float = 1e-6,
    tx_gains: ComplexArray | None = None,
) -> NDArray[np.complex128]:
    """Noise-free samples of one frame.

    Parameters
    ----------
    radar
        Waveform, element pattern, power.
    paths
        The paths, with knots that cover the frame.
    start
        Start of the frame's first ramp [s], on the clock of `paths.times`.
    eps
        Relative accuracy of the transforms.
    tx_gains
        (tx,) factors of what the samples hold of each Tx element; None is 1. They matter where several radiate at once,
        so that their sum is all that the samples hold.

    Returns
    -------
    (chirp, tx, rx, sample) in square roots of watts, of the shape `radar.frame_shape`.

    Raises
    ------
    ValueError
        If the paths are for another number of elements, or their knots don't cover the frame.
    """
    waveform = radar.waveform
    elements = (len(radar.tx_positions), len(radar.rx_positions))
    if paths.a.shape[:2] != elements:
        raise ValueError(f"paths.a is for {paths.a.shape[:2]} (tx, rx) elements; radar '{radar.name}' has {elements}")
    if not 1e-14 <= eps <= 0.1:
        raise ValueError(f"eps is {eps!r}: a value in 1e-14 … 0.1 is needed")
    gains = np.ones(elements[0], dtype=np.complex128) if tx_gains is None else np.asarray(tx_gains)
    if gains.shape != elements[:1]:
        raise ValueError(f"tx_gains has shape {gains.shape}: one factor for each of {elements[0]} Tx is needed")
    if len(paths.times) > 1:
        slack = 1e-9 + 1e-3 * waveform.frame_length
        if paths.times[0] > start + slack or paths.times[-1] < start + waveform.frame_length - slack:
            raise ValueError(
                f"paths.times cover {paths.times[0]:.6f} … {paths.times[-1]:.6f} s; the frame lasts from "
                f"{start:.6f} to {start + waveform.frame_length:.6f} s"
            )
    samples = np.zeros(radar.frame_shape, dtype=np.complex128)
    if paths.num_paths == 0:
        return samples
    for number in range(len(waveform.profiles)):
        part = radar.of_profile(number)
        tx, axis = list(waveform.profile_tx(number)), list(waveform.profile_axis(number))
        own = (
            paths
            if part is radar
            else replace(
                paths,
                a=paths.a[tx],
                tau=paths.tau[tx],
                tau_rate=paths.tau_rate[tx],
                dispersion=None if paths.dispersion is None else paths.dispersion[:, tx],
            )
        )
        # The mixer conjugates what is received.
        weights = np.conj(part.waveform.axis_weights) * gains[tx]
        _one_profile(part, own, start, eps, weights, samples, axis)
    return samples


def _one_profile(
    radar: Radar,
    paths: RadarPaths,
    start: float,
    eps: float,
    weights: ComplexArray,
    samples: ComplexArray,
    axis: Sequence[int],
) -> None:
    """Fill the entries `axis` of `samples` (chirp, tx, rx, sample); `weights` are (loop or 1, entry, tx)."""
    waveform = radar.waveform
    still = not np.any(paths.tau_rate) and bool(np.all(paths.tau == paths.tau[..., :1]))
    amplitude = _element_gains(radar, paths) * math.sqrt(1e-3 * 10.0 ** (radar.tx_power_dbm / 10.0))
    make = _still_channel if still else _channel

    def channel(pair: tuple[int, int]) -> None:
        entry, rx = pair
        times = start + waveform.chirp_times[:, entry]
        for tx in np.flatnonzero(np.any(weights[:, entry] != 0, axis=0)):
            factor = weights[:, entry, tx, None]
            echo = make(radar, paths, amplitude, times, int(tx), rx, eps)
            samples[:, axis[entry], rx] += echo if np.all(factor == 1) else factor * echo

    pairs = [(entry, rx) for entry in range(len(axis)) for rx in range(samples.shape[2])]
    with one_blas_thread(), ThreadPoolExecutor(min(len(pairs), os.cpu_count() or 1)) as pool:
        list(pool.map(channel, pairs))


def _element_gains(radar: Radar, paths: RadarPaths) -> FloatArray:
    """(path, time) product of the field gains of the Tx and the Rx element."""
    to_device = radar.rotation  # row vectors: world @ R = device
    departing = radar.pattern.amplitude(paths.direction @ to_device)
    if paths.arrival is paths.direction:
        return departing * departing
    return departing * radar.pattern.amplitude(paths.arrival @ to_device)


@dataclass(frozen=True)
class _Window:
    """The ADC window: its samples count from -1 to 1 in u about the transform's mode 0."""

    count: int
    step: float
    """[s]"""
    middle: float
    """After the start of the ramp [s]."""
    half: float
    """[s]"""
    u: FloatArray

    @classmethod
    def of(cls, radar: Radar) -> _Window:
        waveform = radar.waveform
        count, step = waveform.num_samples, 1.0 / waveform.sample_rate
        half = max(count // 2, 1) * step
        modes = np.arange(count) - count // 2
        return cls(count, step, waveform.adc_start_time + (count // 2) * step, half, np.asarray(modes * step / half))


def _precision(eps: float) -> tuple[type, type]:
    # Single precision moves a point by 2e-7 rad, the outermost mode by 3e-5 rad.
    return (np.float32, np.complex64) if eps >= 1e-4 else (np.float64, np.complex128)


def _phasor(cycles: FloatArray, number: type) -> NDArray[Any]:
    """exp(j 2 pi cycles); float64 down to the fraction of a cycle."""
    phase = (2 * np.pi * (cycles - np.rint(cycles))).astype(np.float32)
    phasor: NDArray[Any] = np.empty(phase.shape, dtype=number)
    phasor.real, phasor.imag = np.cos(phase), np.sin(phase)
    return phasor


def _points(beat: FloatArray, step: float, real: type) -> NDArray[Any]:
    """Beat frequencies [Hz] as radians per sample in -pi … pi."""
    turns = beat * step
    turns -= np.rint(turns)
    return (2 * np.pi * turns).astype(real)


def _plan(count: int, transforms: int, eps: float, number: type) -> Any:
    import finufft

    # Sorting the points pays only on grids that don't fit the cache.
    return finufft.Plan(
        1, (count,), n_trans=transforms, eps=eps, isign=1, nthreads=1, dtype=np.dtype(number).name, spread_sort=0
    )


def _gains(radar: Radar, paths: RadarPaths, amplitude: FloatArray, window: _Window, tx: int, rx: int) -> ComplexArray:
    """(order, path, time) conjugate gains, element patterns and power included, as coefficients of u^order."""
    gains = [paths.a[tx, rx]] + ([] if paths.dispersion is None else list(paths.dispersion[:, tx, rx]))
    scaled = [np.conj(gain) * amplitude for gain in gains]
    return np.stack(_about_window_middle(scaled, radar, paths, window.middle, window.half))


def _still_channel(
    radar: Radar, paths: RadarPaths, amplitude: FloatArray, chirp_times: FloatArray, tx: int, rx: int, eps: float
) -> ComplexArray:
    """(chirp, sample) of one element pair where delays stay: one transform per knot, blended from chirp to chirp."""
    window = _Window.of(radar)
    real, number = _precision(eps)
    gains = _gains(radar, paths, amplitude, window, tx, rx)
    delay = paths.tau[tx, rx, :, 0]
    cycles, beat, _ = _phase_terms(radar, delay, np.zeros_like(delay), None, window.middle, window.half)
    orders, knots = len(gains), len(paths.times)
    strengths = (gains.transpose(0, 2, 1) * _phasor(cycles, np.complex128)).astype(number).reshape(-1, len(delay))
    plan = _plan(window.count, orders * knots, eps, number)
    plan.setpts(_points(beat, window.step, real))
    modes = plan.execute(strengths if len(strengths) > 1 else strengths[0]).reshape(orders, knots, window.count)
    at_knots = np.einsum("okn,on->kn", modes, window.u ** np.arange(orders)[:, None])
    if knots == 1:
        return np.broadcast_to(at_knots, (len(chirp_times), window.count))
    return np.asarray(paths.weights(chirp_times + window.middle) @ at_knots, dtype=np.complex128)


def _channel(
    radar: Radar, paths: RadarPaths, amplitude: FloatArray, chirp_times: FloatArray, tx: int, rx: int, eps: float
) -> ComplexArray:
    """(chirp, sample) of one element pair."""
    window = _Window.of(radar)
    count, middle, half, u = window.count, window.middle, window.half, window.u
    real, number = _precision(eps)
    gains = _gains(radar, paths, amplitude, window, tx, rx)
    stacked_gains: NDArray[Any] = gains.transpose(0, 2, 1).astype(number)  # (order, time, path)
    loudness = np.abs(gains[0]).max(axis=1) ** 2
    loudness /= max(float(loudness.sum()), 1e-300)
    sizes = np.sqrt((np.abs(gains) ** 2).max(axis=2).sum(axis=1))
    single = len(paths.times) == 1
    knots, at_knots = _knot_terms(radar, paths, chirp_times + middle, middle, half, tx, rx)

    out = np.empty((len(chirp_times), count), dtype=np.complex128)
    rows = max(1, _CHUNK // max(paths.num_paths, 1))
    plans: dict[int, Any] = {}
    for first in range(0, len(chirp_times), rows):
        times = chirp_times[first : first + rows] + middle
        blend = knot_weights(knots, times)
        cycles, beat, quadratic = (blend @ term for term in at_knots)
        # u^2 = 1/2 + T_2(u)/2: taking the half off halves what is left to expand, and so does what all paths share.
        quadratic *= 0.5
        cycles += quadratic
        shared = quadratic @ loudness
        quadratic -= shared[:, None]
        phasor = _phasor(cycles, number)
        terms_of = _needed_terms(2 * np.pi * _weighted_size(quadratic, loudness), sizes, eps)
        terms: NDArray[Any] = np.empty((len(times), len(terms_of), paths.num_paths), dtype=number)
        weights: NDArray[Any] = np.ones((len(times), 1), dtype=real) if single else blend.astype(real)
        chebyshev, shapes = 2 * u * u - 1, []  # row n of `shapes` is the function of u that term n carries
        turn: NDArray[Any] = np.zeros(0)
        for index, (order, power) in enumerate(terms_of):
            if power == 0:
                np.multiply(weights @ stacked_gains[order], phasor, out=terms[:, index])
            else:
                turn = (2j * np.pi * quadratic).astype(number) if turn.size == 0 else turn
                np.multiply(terms[:, terms_of.index((order, power - 1))], turn, out=terms[:, index])
                terms[:, index] /= power
            shapes.append(u**order * chebyshev**power)
        points = _points(beat, window.step, real)
        if len(shapes) not in plans:
            plans[len(shapes)] = _plan(count, len(shapes), eps, number)
        shape = np.stack(shapes)
        for row in range(len(times)):
            plans[len(shapes)].setpts(points[row])
            modes = plans[len(shapes)].execute(terms[row] if len(shapes) > 1 else terms[row, 0])
            out[first + row] = (np.atleast_2d(modes) * shape).sum(axis=0)
            out[first + row] *= np.exp(2j * np.pi * shared[row] * chebyshev)
    return out


def _knot_terms(
    radar: Radar, paths: RadarPaths, times: FloatArray, middle: float, half: float, tx: int, rx: int
) -> tuple[FloatArray, tuple[FloatArray, FloatArray, FloatArray]]:
    """Knots [s] and there the three terms of :func:`_phase_terms`, (knot, path).

    The terms are as smooth as the delay: splines through their values serve as well as values of the delay's spline,
    for a fraction of the work. A single knot means a constant rate, and the terms are parabolas through three times.
    """
    tau, rate = paths.tau[tx, rx], paths.tau_rate[tx, rx]
    if len(paths.times) == 1:
        knots = np.array([times.min(), 0.0, times.max() + 1e-6])
        knots[1] = 0.5 * (knots[0] + knots[2])
        delay = tau.T + rate.T * (knots[:, None] - paths.times[0])
        return knots, _phase_terms(radar, delay, rate.T, None, middle, half)
    delay, slope, curve = (knot_weights(paths.times, paths.times, order) @ tau.T for order in range(3))
    return paths.times, _phase_terms(radar, delay, slope, curve, middle, half)


def _phase_terms(
    radar: Radar, delay: FloatArray, slope: FloatArray, curve: FloatArray | None, middle: float, half: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Phase in cycles at the window's middle, beat frequency [Hz], and cycles of the u^2 term at the window's edge."""
    f_c, mu = radar.waveform.start_frequency, radar.waveform.slope
    constant = delay * (f_c + mu * middle - 0.5 * mu * delay)
    beat = mu * delay + slope * (f_c + mu * (middle - delay))
    quadratic = np.broadcast_to((mu * half**2) * slope * (1 - 0.5 * slope), delay.shape)
    if curve is not None:
        quadratic = quadratic + (0.5 * half**2 * (f_c + mu * middle)) * curve
    return constant, beat, quadratic


def _weighted_size(values: FloatArray, loudness: FloatArray) -> float:
    """Root mean square over the paths, weighted with their share of the power, of each one's largest |value|."""
    return float(np.sqrt((loudness * np.abs(values).max(axis=0) ** 2).sum()))


def _needed_terms(angle: float, sizes: FloatArray, eps: float) -> list[tuple[int, int]]:
    """(order of the gain, power of the quadratic phase) of the terms that matter to `eps`.

    exp(j angle T) leaves angle^(n+1) / (n+1)! after n powers; `sizes` are those of the gain's coefficients.
    """
    terms = []
    for order, size in enumerate(sizes):
        power, left = 0, size / max(float(sizes[0]), 1e-300) if order else 1.0
        terms.append((order, 0))
        left *= angle
        while left > eps and power < 40:
            power += 1
            terms.append((order, power))
            left *= angle / (power + 1)
    return terms


def _about_window_middle(
    gains: list[ComplexArray], radar: Radar, paths: RadarPaths, middle: float, half: float
) -> list[ComplexArray]:
    """Polynomial coefficients of the gain in u / half instead of in (f - frequency) / half_band."""
    if len(gains) == 1:
        return gains
    waveform = radar.waveform
    shift = (waveform.start_frequency + waveform.slope * middle - paths.frequency) / paths.half_band
    scale = waveform.slope * half / paths.half_band
    return [
        sum((math.comb(m, n) * shift ** (m - n) * gains[m] for m in range(n, len(gains))), np.zeros_like(gains[0]))
        * scale**n
        for n in range(len(gains))
    ]
