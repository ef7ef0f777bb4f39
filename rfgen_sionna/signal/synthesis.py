"""FMCW synthesis: paths to dechirped samples.

The dechirped signal of a path of delay tau(t) is (sign of TI, Infineon and RF Genesis)

    s(t) = conj(A) exp(j 2 pi [f_c tau + mu t tau - mu tau^2 / 2]),   t from the start of the ramp.

`A` is conjugated because the mixer multiplies the transmitted signal with the conjugate of the received one. The phase
is a constant, a beat frequency and a small quadratic term (:mod:`rfgen_sionna.signal.path_phases`). At loose tolerances
a nonuniform FFT over beat and Doppler sums blocks of loops (:mod:`rfgen_sionna.signal.block_transform`), else one over
the beat each chirp and element pair (:mod:`rfgen_sionna.signal.nufft`). The slope mu may be negative or 0, which leaves
Doppler alone.

Gains that change with time (visibility, element pattern, return of a facet) are linear over the ADC window of a chirp,
or constant where the change is negligible. Where that or the quadratic phase does not suffice, as for fast rotors in
long chirps, the window is summed in parts.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import ComplexArray, FloatArray
from rfgen_sionna.parallel import one_blas_thread
from rfgen_sionna.radar import Radar
from rfgen_sionna.radar.profile import is_number
from rfgen_sionna.records import RadarPaths, knot_weights
from rfgen_sionna.scene.mitsuba_backend import ensure_llvm, has_cuda
from rfgen_sionna.signal.block_transform import LEAST_EPS, block_sums
from rfgen_sionna.signal.nufft import (
    BEAT,
    GAINS,
    PHASE,
    QUADRATIC,
    ChirpTable,
    nonuniform_fft,
    single_precision_suffices,
)
from rfgen_sionna.signal.nufft_kernel import NEGLIGIBLE, needed_terms, width_for
from rfgen_sionna.signal.path_phases import (
    MIN_SPLINE_KNOTS,
    AdcWindow,
    PathSplines,
    conjugate_gains,
    element_gains,
    gain_coefficients,
    gains_change,
    max_power,
    needed_parts,
    phase_terms,
)

DEVICES = ("auto", "cpu", "cuda")
_TABLE, _MOST_TABLE = 1_000_000, 4_000_000  # coefficients at a time: 8 MB of several channels, 32 MB of one
_GRID, _MOST_GRID = 300_000, 600_000  # cells at a time, 2.4 MB; where they are a small share of the frame, 5 MB
_SHARE = 12  # least number of parts of a frame for the larger grid

MAX_TIME = 1e10
"""Largest |start| of a frame [s]: beyond it float64 does not resolve the times of chirps."""
MAX_EPS = 0.3
"""Largest relative error that may be asked for."""
_VALUES = ("a", "tau", "tau_rate", "times", "direction", "arrival", "dispersion")


def synthesize(
    radar: Radar,
    paths: RadarPaths,
    start: float,
    *,
    eps: float = 1e-6,
    tx_gains: ComplexArray | None = None,
    device: str = "auto",
) -> NDArray[np.complex128]:
    """Noise-free samples of one frame.

    Parameters
    ----------
    radar
        Waveform, element pattern, power.
    paths
        Paths whose knots cover the frame.
    start
        Start of the frame's first ramp [s], on the clock of `paths.times`.
    eps
        Relative accuracy of the samples. From 1e-3 on the CPU sums blocks of loops, where the motion allows it.
    tx_gains
        (tx,) complex gains of the Tx elements, for elements that radiate at once; None is 1.
    device
        "cpu", "cuda" (the first CUDA device), or "auto", CUDA if available.

    Returns
    -------
    (chirp, tx, rx, sample) [sqrt(W)], of the shape `radar.frame_shape`. They are complex for a real ADC as well, the
    real part of which :func:`~rfgen_sionna.signal.receiver.reception.receive` takes.

    Raises
    ------
    TypeError
        If `radar` is no Radar, or `paths` are no RadarPaths.
    ValueError
        If the paths have another number of elements or are not finite, their knots do not cover the frame, the device
        does not exist, or another argument is out of range.
    BackendError
        If the CPU sums chirp by chirp and Dr.Jit finds no LLVM; the message names the cure.
    """
    check_synthesis(radar, paths, start, eps, tx_gains)
    waveform = radar.waveform
    elements = (len(radar.tx_positions), len(radar.rx_positions))
    if paths.a.shape[:2] != elements:
        raise ValueError(f"paths.a is for {paths.a.shape[:2]} (tx, rx) elements; radar '{radar.name}' has {elements}")
    gains = np.ones(elements[0], dtype=np.complex128) if tx_gains is None else np.asarray(tx_gains)
    if len(paths.times) > 1:
        slack = 1e-9 + 1e-3 * waveform.frame_length
        if paths.times[0] > start + slack or paths.times[-1] < start + waveform.frame_length - slack:
            raise ValueError(
                f"paths.times cover {paths.times[0]:.6f} … {paths.times[-1]:.6f} s; the frame lasts from "
                f"{start:.6f} to {start + waveform.frame_length:.6f} s"
            )
    device = chosen_device(device)
    samples = np.zeros(radar.frame_shape, dtype=np.complex128)
    if paths.num_paths == 0:
        return samples
    for number in range(len(waveform.profiles)):
        part = radar.of_profile(number)
        tx, axis = list(waveform.profile_tx(number)), list(waveform.profile_axis(number))
        own = paths if part is radar else _subset(paths, tx, slice(None))
        # The mixer conjugates the received signal.
        tx_feeds, rx_feeds = (feeds.conj() for feeds in part.feed_factors)
        weights = np.conj(part.waveform.axis_weights) * (gains[tx] * tx_feeds)
        still = not np.any(own.tau_rate) and bool(np.all(own.tau == own.tau[..., :1]))
        first_tx = dict(reversed(_transmitters(weights)))
        with one_blas_thread():
            echoes = (
                _synthesize_static(part, own, start, weights, eps)
                if still
                else _synthesize_moving(part, own, start, weights, eps, device)
            )
            for (entry, tx_index, rx), echo in echoes:
                into = samples[:, axis[entry], rx]
                factor = np.multiply.outer(weights[:, entry, tx_index], rx_feeds[rx])[..., None]
                echo = echo if np.all(factor == 1) else factor * echo
                if tx_index == first_tx[entry]:
                    into[...] = echo  # no page of the zeros is read
                else:
                    into += echo
    return samples


def check_synthesis(radar: Radar, paths: RadarPaths, start: float, eps: float, tx_gains: Any) -> None:
    """Check arguments of :func:`synthesize`: types, ranges, finite values."""
    if not isinstance(radar, Radar):
        raise TypeError(f"radar is a {type(radar).__name__}: a Radar is needed (Radar.load('awr1843'))")
    if not isinstance(paths, RadarPaths):
        raise TypeError(f"paths is a {type(paths).__name__}: RadarPaths are needed, such as of Simulator.paths")
    check_time("start", start)
    if not (is_number(eps) and 1e-14 <= eps <= MAX_EPS):
        raise ValueError(f"eps is {eps!r}: a value in 1e-14 … {MAX_EPS:g} is needed")
    if tx_gains is not None:
        _check_tx_gains(tx_gains, len(radar.tx_positions))
    for name in _VALUES:
        if getattr(paths, name) is not None:
            _check_finite(f"paths.{name}", np.asarray(getattr(paths, name)))


def _check_tx_gains(tx_gains: Any, count: int) -> None:
    gains = np.asarray(tx_gains)
    if gains.shape != (count,):
        raise ValueError(f"tx_gains has shape {gains.shape}: one factor for each of {count} Tx is needed")
    if gains.dtype.kind not in "iufc" or not np.isfinite(gains).all():
        raise ValueError(f"tx_gains is {tx_gains!r}: finite numbers are needed")


def _check_finite(name: str, values: np.ndarray[Any, Any]) -> None:
    if values.dtype.kind not in "iufc":
        raise ValueError(f"{name} is of type {values.dtype}: numbers are needed")
    # A finite sum has finite terms, in one pass.
    with np.errstate(over="ignore", invalid="ignore"):
        if np.isfinite(values.sum()):
            return
    if len(bad := np.argwhere(~np.isfinite(values))):
        where = tuple(bad[0].tolist())
        found = f"{len(bad)} values that are NaN or infinite, the first is {values[where]} at {where}"
        raise ValueError(f"{name} has {found}: finite ones are needed")


def check_time(name: str, value: Any) -> float:
    """`value` [s], checked to be a finite time of at most `MAX_TIME` either way."""
    if not (is_number(value) and abs(value) <= MAX_TIME):
        raise ValueError(f"{name} is {value!r}: a finite time of -{MAX_TIME:g} … {MAX_TIME:g} s is needed")
    return float(value)


def chosen_device(device: str) -> str:
    """ "cpu" or "cuda".

    Raises
    ------
    ValueError
        If `device` is none of `DEVICES`, or "cuda" without a CUDA device.
    """
    if not isinstance(device, str) or device not in DEVICES:
        raise ValueError(f"device is {device!r}; allowed: {', '.join(DEVICES)}")
    cuda = device != "cpu" and has_cuda()
    if device == "cuda" and not cuda:
        raise ValueError("device is 'cuda', but no CUDA driver with a device was found here: take 'cpu' or 'auto'")
    return "cuda" if cuda else "cpu"


def _subset(paths: RadarPaths, tx: list[int] | slice, part: slice) -> RadarPaths:
    """Channels of some Tx elements and paths; slices make no copies. Directions and labels stay."""
    dispersion = None if paths.dispersion is None else paths.dispersion[:, tx][:, :, :, part]
    values: dict[str, Any] = {name: getattr(paths, name)[tx][:, :, part] for name in ("a", "tau", "tau_rate")}
    return replace(paths, **values, dispersion=dispersion)


Channel = tuple[int, int, int]
"""Entry of the axis "tx", Tx element in it, Rx element."""
Channels = tuple[int, int, int | slice]
"""The same of one or several Rx elements."""


def _transmitters(weights: ComplexArray) -> list[tuple[int, int]]:
    """Entries of the axis "tx" with each Tx element in them."""
    on = np.any(weights != 0, axis=0)
    return [(entry, int(tx)) for entry in range(len(on)) for tx in np.flatnonzero(on[entry])]


def _channels(radar: Radar, weights: ComplexArray) -> list[Channel]:
    return [(*each, rx) for each in _transmitters(weights) for rx in range(len(radar.rx_positions))]


def _synthesize_static(
    radar: Radar, paths: RadarPaths, start: float, weights: ComplexArray, eps: float
) -> Iterator[tuple[Channel, ComplexArray]]:
    """(chirp, sample) of each channel for constant delays: one transform per knot, interpolated at each chirp."""
    import finufft

    window = AdcWindow.of(radar)
    amplitude = element_gains(radar, paths)
    # Single precision moves a point by 2e-7 rad, the outermost mode by 3e-5 rad.
    number: Any = np.complex64 if eps >= 1e-4 else np.complex128
    amplitude = amplitude.astype(np.float32 if number is np.complex64 else np.float64)
    for entry, tx, rx in _channels(radar, weights):
        times = start + radar.waveform.chirp_times[:, entry] + window.middle
        gains = conjugate_gains(radar, paths, amplitude, window, tx, rx)
        delay = paths.tau[tx, rx, :, 0]
        cycles, beat, _ = phase_terms(radar, delay, np.zeros_like(delay), None, window)
        orders, knots = len(gains), len(paths.times)
        turn = np.exp(2j * np.pi * (cycles - np.rint(cycles))).astype(number)
        strengths = np.ascontiguousarray(gains.transpose(0, 2, 1) * turn, dtype=number).reshape(-1, len(delay))
        points = (2 * np.pi * (beat - np.rint(beat))).astype(strengths.real.dtype)
        # Paths at one point, as all are without a slope, have the same error: a margin of 5.
        sharp = {"eps": max(0.2 * eps, 1e-14), "isign": 1, "nthreads": 1}
        modes = finufft.nufft1d1(points, strengths if len(strengths) > 1 else strengths[0], window.count, **sharp)
        modes = modes.reshape(orders, knots, window.count)
        at_knots = np.einsum("okn,on->kn", modes, window.u ** np.arange(orders)[:, None])
        if knots == 1:
            yield (entry, tx, rx), np.repeat(at_knots, len(times), axis=0).astype(np.complex128)
            continue
        rates = window.half * knot_weights(paths.times, times, 1)
        chirps = paths.weights(times) @ at_knots + (rates @ at_knots) * window.u
        yield (entry, tx, rx), np.asarray(chirps, dtype=np.complex128)


def _synthesize_moving(
    radar: Radar, paths: RadarPaths, start: float, weights: ComplexArray, eps: float, device: str
) -> Iterator[tuple[Channels, NDArray[np.complexfloating[Any]]]]:
    """(chirp, rx, sample) of groups of channels in blocks of loops, or (chirp, sample) of each channel where `eps`, the
    motion or the device demands a transform per chirp."""
    if not (transmitters := _transmitters(weights)):
        return
    if eps >= LEAST_EPS and device == "cpu":
        echoes = block_sums(radar, paths, start, transmitters, eps)
        if echoes is not None:
            yield from echoes
            return
    if 1 < len(paths.times) < MIN_SPLINE_KNOTS:
        # The delay is a polynomial through two or three knots; the phase, quadratic in it, needs a spline of more.
        paths = paths.at(np.linspace(paths.times[0], paths.times[-1], 2 * MIN_SPLINE_KNOTS + 1))
    yield from _synthesize_in_parts(radar, paths, start, weights, eps, device)


def _synthesize_in_parts(
    radar: Radar, paths: RadarPaths, start: float, weights: ComplexArray, eps: float, device: str
) -> Iterator[tuple[Channel, ComplexArray]]:
    """(chirp, sample) of each channel, in as many parts of the ADC window as the motion demands."""
    windows = AdcWindow.parts(radar, needed_parts(radar, paths, eps))
    parts = [_synthesize_window(radar, paths, start, weights, eps, device, window) for window in windows]
    for found in zip(*parts, strict=True):
        yield found[0][0], np.concatenate([echo for _, echo in found], axis=1) if len(found) > 1 else found[0][1]


def _synthesize_window(
    radar: Radar,
    paths: RadarPaths,
    start: float,
    weights: ComplexArray,
    eps: float,
    device: str,
    window: AdcWindow,
) -> Iterator[tuple[Channel, ComplexArray]]:
    """(chirp, sample) of each channel in a `window`, a few channels at a time."""
    if device == "cpu":
        ensure_llvm()
    times = start + radar.waveform.chirp_times + window.middle
    splines = PathSplines.of(paths, float(times.min()), float(times.max()))
    amplitude = element_gains(radar, paths)
    channels = _channels(radar, weights)
    changing = gains_change(radar, paths, amplitude, splines, window, channels[0][1:], NEGLIGIBLE * eps)
    orders = (1 if paths.dispersion is None else 1 + len(paths.dispersion)) + changing
    fields = -(-(GAINS + 2 * orders) // 4) * 4
    single = single_precision_suffices(
        *_max_coefficients(radar, paths, splines, window, channels[0][1:]), window.count, eps
    )
    numbers = fields * len(splines.knots) * paths.num_paths
    cells = 4 * len(times) * window.count
    room = max(_GRID, min(_MOST_GRID, cells * len(channels) // _SHARE))
    step = max(1, min(_TABLE // numbers, room // cells))
    # Paths of a channel are split where its table is too large.
    bounds = np.linspace(0, paths.num_paths, max(1, -(-numbers // _MOST_TABLE)) + 1).astype(int)
    for first in range(0, len(channels), step):
        group = channels[first : first + step]
        total: ComplexArray = np.zeros(0, dtype=np.complex128)
        for low, high in itertools.pairwise(bounds):
            chosen = paths if len(bounds) == 2 else _subset(paths, slice(None), slice(low, high))
            echo = _spread_channels(
                radar, chosen, amplitude[low:high], splines, times, group, window, changing, single, eps, device
            )
            total = echo if low == 0 else total + echo
        yield from zip(group, total, strict=True)


def _max_coefficients(
    radar: Radar, paths: RadarPaths, splines: PathSplines, window: AdcWindow, pair: tuple[int, int]
) -> tuple[FloatArray, FloatArray]:
    """Coefficients of the phase [cycles], less whole cycles, and of the beat [cycles per sample] of one (tx, rx)."""
    phase, beat, _ = splines.terms(radar, paths, window, *pair)
    phase = splines.matrix @ phase
    return phase - np.rint(phase[0]), splines.matrix @ beat


def _spread_channels(
    radar: Radar,
    paths: RadarPaths,
    amplitude: FloatArray,
    splines: PathSplines,
    times: FloatArray,
    channels: Sequence[Channel],
    window: AdcWindow,
    changing: bool,
    single: bool,
    eps: float,
    device: str,
) -> ComplexArray:
    """(channel, chirp, sample)"""
    knots, orders = len(splines.knots), 1 if paths.dispersion is None else 1 + len(paths.dispersion)
    orders += changing
    fields = -(-(GAINS + 2 * orders) // 4) * 4
    table = np.zeros((len(channels), knots, paths.num_paths, fields), np.float32 if single else np.float64)
    scale = amplitude.astype(table.dtype)
    shared, sizes, angle = [], np.zeros(orders), 0.0
    for own, (_, tx, rx) in zip(table, channels, strict=True):
        gains = conjugate_gains(radar, paths, scale, window, tx, rx)
        if changing and splines.derivatives is not None:
            gains = gain_coefficients(gains, splines.derivatives[1], window)
        most = [max_power(gain) for gain in gains]
        power_share = most[0] / max(float(most[0].sum()), 1e-300)
        sizes = np.maximum(sizes, np.sqrt([each.sum() for each in most]))
        phase, beat, quadratic = splines.terms(radar, paths, window, tx, rx)
        # u^2 = 1/2 + T_2(u)/2: without the constant and the common part the expansion needs fewer terms.
        quadratic = 0.5 * quadratic
        common = quadratic @ power_share
        phase = splines.matrix @ (phase + quadratic)
        own[..., PHASE] = phase - np.rint(phase[0])  # whole cycles are the same for all coefficients of a path
        own[..., BEAT] = splines.matrix @ beat
        quadratic = quadratic - common[:, None]
        own[..., QUADRATIC] = splines.matrix @ quadratic
        shared.append(splines.matrix @ common)
        angle = max(angle, 2 * np.pi * float(np.sqrt(np.square(np.abs(quadratic).max(axis=0)) @ power_share)))
        turned = gains if gains.shape[2] == 1 else gains @ splines.matrix.T.astype(gains.real.dtype)
        own[..., GAINS : GAINS + 2 * len(gains) : 2] = turned.real.T
        own[..., GAINS + 1 : GAINS + 1 + 2 * len(gains) : 2] = turned.imag.T
    at = [splines.place(times[:, entry]) for entry, _, _ in channels]
    rows = np.concatenate([first + knots * index for index, (first, _) in enumerate(at)])
    lanes = ChirpTable(table.reshape(-1, *table.shape[2:]), rows, np.concatenate([weights for _, weights in at]))
    terms = needed_terms(angle, sizes, eps)
    samples = nonuniform_fft(lanes, window.count, tuple(terms), width_for(terms, 0.5 * eps), eps, device)
    samples = samples.reshape(len(channels), len(times), window.count)
    chebyshev = 2 * window.u**2 - 1
    for index, (first, weights) in enumerate(at):
        turns = (shared[index][first[:, None] + np.arange(weights.shape[1])] * weights).sum(axis=1)
        if np.any(turns):
            samples[index] *= np.exp(2j * np.pi * turns[:, None] * chebyshev)
    return samples
