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
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna.radar import Radar
from rfgen_sionna.records import ComplexArray, FloatArray, RadarPaths

_CHUNK = 2_000_000  # chirps x paths at a time: bounds the memory of a thread to about 200 MB


def synthesize(radar: Radar, paths: RadarPaths, start: float, *, eps: float = 1e-6) -> NDArray[np.complex128]:
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

    Returns
    -------
    (chirp, tx, rx, sample) in square roots of watts.

    Raises
    ------
    ValueError
        If the paths are for another number of elements, or their knots don't cover the frame.
    """
    waveform = radar.waveform
    shape = (waveform.num_loops, len(radar.tx_positions), len(radar.rx_positions), waveform.num_samples)
    if paths.a.shape[:2] != shape[1:3]:
        raise ValueError(f"paths.a is for {paths.a.shape[:2]} (tx, rx) elements; radar '{radar.name}' has {shape[1:3]}")
    if not 1e-14 <= eps <= 0.1:
        raise ValueError(f"eps is {eps!r}: a value in 1e-14 … 0.1 is needed")
    still = len(paths.times) == 1 and not np.any(paths.tau_rate)
    if len(paths.times) > 1:
        slack = 1e-9 + 1e-3 * waveform.frame_length
        if paths.times[0] > start + slack or paths.times[-1] < start + waveform.frame_length - slack:
            raise ValueError(
                f"paths.times cover {paths.times[0]:.6f} … {paths.times[-1]:.6f} s; the frame lasts from {start:.6f} to "
                f"{start + waveform.frame_length:.6f} s"
            )
    samples = np.zeros(shape, dtype=np.complex128)
    if paths.num_paths == 0:
        return samples
    amplitude = _element_gains(radar, paths) * math.sqrt(1e-3 * 10.0 ** (radar.tx_power_dbm / 10.0))

    def channel(pair: tuple[int, int]) -> None:
        tx, rx = pair
        chirp_times = start + waveform.chirp_times[: 1 if still else None, tx]
        samples[:, tx, rx] = _channel(radar, paths, amplitude, chirp_times, tx, rx, eps)

    pairs = [(tx, rx) for tx in range(shape[1]) for rx in range(shape[2])]
    with ThreadPoolExecutor(min(len(pairs), os.cpu_count() or 1)) as pool:
        list(pool.map(channel, pairs))
    return samples


def _element_gains(radar: Radar, paths: RadarPaths) -> FloatArray:
    """(path, time) product of the field gains of the Tx and the Rx element."""
    to_device = radar.rotation  # row vectors: world @ R = device
    departing = radar.pattern.amplitude(paths.direction @ to_device)
    if paths.arrival is paths.direction:
        return departing * departing
    return departing * radar.pattern.amplitude(paths.arrival @ to_device)


def _channel(
    radar: Radar, paths: RadarPaths, amplitude: FloatArray, chirp_times: FloatArray, tx: int, rx: int, eps: float
) -> ComplexArray:
    """(chirp, sample) of one element pair."""
    import finufft

    waveform = radar.waveform
    count, step = waveform.num_samples, 1.0 / waveform.sample_rate
    middle = waveform.adc_start_time + (count // 2) * step  # the transform's mode 0
    half = max(count // 2, 1) * step
    u = (np.arange(count) - count // 2) * step / half

    gains = [paths.a[tx, rx]] + ([] if paths.dispersion is None else list(paths.dispersion[:, tx, rx]))
    gains = _about_window_middle([np.conj(gain) * amplitude for gain in gains], radar, paths, middle, half)
    tau, rate = paths.tau[tx, rx], paths.tau_rate[tx, rx]

    out = np.empty((len(chirp_times), count), dtype=np.complex128)
    rows = max(1, _CHUNK // max(paths.num_paths, 1))
    plan: Any = None
    for first in range(0, len(chirp_times), rows):
        times = chirp_times[first : first + rows] + middle
        if len(paths.times) == 1:
            delay = tau.T + rate.T * (times[:, None] - paths.times[0])
            slope, curve = np.broadcast_to(rate.T, delay.shape), 0.0
        else:
            delay = paths.weights(times) @ tau.T
            slope = paths.weights(times, 1) @ tau.T
            curve = paths.weights(times, 2) @ tau.T
        constant, beat, quadratic = _phase_terms(radar, delay, slope, curve, middle, half)
        # u^2 = 1/2 + T_2(u)/2: taking the half off halves what is left to expand.
        powers = _quadratic_powers(float(2 * np.pi * np.abs(quadratic).max(initial=0.0)) / 2, eps)
        cycles = constant + 0.5 * quadratic
        phase = (2 * np.pi * (cycles - np.rint(cycles))).astype(np.float32)
        phasor = np.empty(phase.shape, dtype=np.complex128)
        phasor.real, phasor.imag = np.cos(phase), np.sin(phase)
        weights = paths.weights(times) if len(paths.times) > 1 else np.ones((len(times), 1))
        strengths = [(weights @ gain.T) * phasor for gain in gains]
        # Row n of `shapes` is the function of u that strength n carries.
        terms, shapes = list(strengths), [u**n for n in range(len(strengths))]
        chebyshev, factor = 2 * u * u - 1, np.ones((), dtype=np.complex128)
        for order in range(1, powers + 1):
            factor = factor * (1j * np.pi * quadratic) / order
            terms += [strength * factor for strength in strengths]
            shapes += [chebyshev**order * u**n for n in range(len(strengths))]
        if plan is None or plan[0] != len(terms):
            plan = (len(terms), finufft.Plan(1, (count,), n_trans=len(terms), eps=max(eps, 1e-14), isign=1, nthreads=1))
        stacked = np.stack(terms, axis=1)  # (chirp, term, path)
        points = 2 * np.pi * step * beat
        points -= 2 * np.pi * np.rint(points / (2 * np.pi))
        shape = np.stack(shapes)
        for row in range(len(times)):
            plan[1].setpts(points[row])
            modes = plan[1].execute(stacked[row] if len(terms) > 1 else stacked[row, 0])
            out[first + row] = (np.atleast_2d(modes) * shape).sum(axis=0)
    return out


def _phase_terms(
    radar: Radar, delay: FloatArray, slope: FloatArray, curve: FloatArray | float, middle: float, half: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Phase in cycles at the window's middle, beat frequency [Hz], and cycles of the u^2 term at the window's edge."""
    f_c, mu = radar.waveform.start_frequency, radar.waveform.slope
    constant = f_c * delay + mu * delay * (middle - 0.5 * delay)
    beat = mu * delay + slope * (f_c + mu * (middle - delay))
    quadratic = (mu * slope * (1 - 0.5 * slope) + 0.5 * curve * (f_c + mu * middle)) * half**2
    return constant, beat, np.asarray(quadratic, dtype=np.float64)


def _quadratic_powers(angle: float, eps: float) -> int:
    """Terms of exp(j angle T) that leave a remainder below eps."""
    remainder, order = angle, 0
    while remainder > eps and order < 40:
        order += 1
        remainder *= angle / (order + 1)
    return order


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
        sum((math.comb(m, n) * shift ** (m - n) * gains[m] for m in range(n, len(gains))), np.zeros_like(gains[0])) * scale**n
        for n in range(len(gains))
    ]
