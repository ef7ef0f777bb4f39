"""Frame loop: one thread traces while another sums."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._short_repr import ShortRepr
from rfgen_sionna.parallel import one_blas_thread
from rfgen_sionna.pir.fused_tracer import FusedTracer
from rfgen_sionna.radar import Radar
from rfgen_sionna.records import RadarPaths
from rfgen_sionna.signal import synthesize
from rfgen_sionna.signal.path_phases import element_gains
from rfgen_sionna.tracing.report import TraceReport

if TYPE_CHECKING:
    from rfgen_sionna.tracing.tracer import Tracer

TRIM_INTERVAL = 50
"""Number of frames after which free memory goes back to the system."""
SYNTHESIS_SHARE = 0.3
"""Share of the tolerance for the sum of the paths."""
MIN_EPS = 1e-7
"""Lower bound of the accuracy of a sum, where paths of one of many objects cancel."""
_BAND_POSITIONS = (-1.0, 0.0, 1.0)  # in half bands, for the estimate of an object's return


@dataclass(frozen=True, repr=False)
class Frame(ShortRepr):
    """One frame of a run."""

    index: int
    time: float
    """Start of the first ramp [s]."""
    samples: NDArray[np.complex128] | NDArray[np.float64]
    """(chirp, tx, rx, sample) [sqrt(W)]."""
    report: TraceReport
    full_scale: float | None = None
    """Largest I or Q, or real sample, of the ADC [sqrt(W)]; None for samples that are not quantised."""
    clipped: float = 0.0
    """Share of the words of I and Q beyond the ADC's range."""
    paths: tuple[RadarPaths, ...] = ()
    """Paths of actors and imagined surroundings for :func:`rfgen_sionna.pir.image`; empty for modelled surroundings."""
    traced: TracedFrame | None = None
    """All paths, of frames that keep them."""


class TracedFrame(NamedTuple):
    """Paths of one frame."""

    begin: float
    """[s]"""
    static: tuple[RadarPaths, ...]
    """Paths of the static scene, the same in every frame."""
    parts: Callable[[], Sequence[RadarPaths]]
    """Computes all other paths, on any thread."""
    report: TraceReport
    image_paths: tuple[RadarPaths, ...]
    """Paths of actors and imagined surroundings, for images; empty for modelled surroundings."""
    num_static: int
    """Number of static objects, the first ones, which share one tolerance."""


def frame_tracer(
    tracer: Tracer, fusion: FusedTracer | None, times: NDArray[np.float64]
) -> Callable[[float], TracedFrame]:
    """Function that traces the frame that begins at one of the `times` [s], in turn: each frame starts from the facets
    of the one before."""
    length = tracer.radar.waveform.frame_length
    moving = tracer.follow(span=(float(times[0]), float(times[-1]) + length))
    num_static = sum(each.still for each in (*tracer.surfaces.static, *tracer.surfaces.moving))
    if fusion is None:

        def traced(begin: float) -> TracedFrame:
            found = tracer.trace(begin, begin + length, moving)
            return TracedFrame(begin, (found.static,), found.changing, found.report, (), num_static)

        return traced
    refinement = fusion.refinement(float(times[0]), float(times[-1]) + length)

    def fused(begin: float) -> TracedFrame:
        found = fusion.trace(begin, begin + length, moving, refinement)
        return TracedFrame(begin, (), partial(tuple, found.parts), found.report, found.parts, num_static)

    return fused


def frame_samples(
    radar: Radar,
    trace: Callable[[float], TracedFrame],
    times: NDArray[np.float64],
    rtol: float,
    gains: NDArray[np.complex128] | None,
    device: str,
    begun: Callable[[], None],
    start: int = 0,
    keep_paths: bool = False,
) -> Iterator[tuple[NDArray[np.complex128], TracedFrame]]:
    """Samples (chirp, tx, rx, sample) of each frame before the receiver, and the traced frame, without its paths unless
    `keep_paths` is set; those of the static scene are with the first frame.

    The caller's thread traces while another thread sums. The relative error of the sum of each object is a share of
    `rtol` (:func:`required_eps`).

    `times` (frame,) are starts of the frames [s]; `gains` and `device` are arguments of
    :func:`rfgen_sionna.signal.synthesize`; `begun` is called after the trace of a static scene. Frames before number
    `start` are left out; the first one is traced all the same.
    """

    def samples(parts: Callable[[], Sequence[RadarPaths]], start: float, num_static: int) -> NDArray[np.complex128]:
        return sum_paths(radar, parts(), start, num_static, rtol, gains, device)

    def emptied(frame: TracedFrame) -> TracedFrame:
        left = partial(tuple, tuple(frame.parts())) if keep_paths else tuple
        return frame._replace(static=frame.static if keep_paths and frame is first else (), parts=left)

    first = trace(float(times[0]))
    static: NDArray[np.complex128] | float = 0.0
    if first.static:
        begun()
        # One synthesis of the static scene for all frames.
        static = samples(partial(tuple, first.static), 0.0, first.num_static)
    rest, frames = map(trace, times[max(start, 1) :].tolist()), 0
    now: TracedFrame | None = first if start == 0 else next(rest, None)
    with ThreadPoolExecutor(1, "rfgen-samples") as other:
        while now is not None:
            summed = other.submit(samples, now.parts, now.begin, now.num_static)
            following, failure = None, None
            try:
                following = next(rest, None)
            except Exception as error:  # raised after this frame, which is complete
                failure = error
            yield summed.result() + static, emptied(now)
            if failure is not None:
                raise failure
            now, frames = following, frames + 1
            if frames % TRIM_INTERVAL == 0:
                _trim_memory()


@one_blas_thread()
def sum_paths(
    radar: Radar,
    paths: Sequence[RadarPaths],
    start: float,
    num_static: int,
    rtol: float,
    gains: NDArray[np.complex128] | None,
    device: str,
) -> NDArray[np.complex128]:
    """Samples (chirp, tx, rx, sample) of all `paths` in a frame that begins at `start` [s], before the receiver.

    The first `num_static` objects are at rest; other arguments are those of :func:`frame_samples`.
    """
    total = np.zeros(radar.frame_shape, dtype=np.complex128)
    for part in paths:
        eps = required_eps(radar, part, rtol, num_static)
        total += synthesize(radar, part, start, eps=eps, tx_gains=gains, device=device)
    return total


def _trim_memory() -> None:
    """Give free memory of glibc, which fragments as arrays change size, back to the system."""
    with suppress(AttributeError, OSError, TypeError):
        ctypes.CDLL(None).malloc_trim(0)


def required_eps(radar: Radar, paths: RadarPaths, rtol: float, num_static: int = 0) -> float:
    """`eps` of :func:`rfgen_sionna.signal.synthesize` for a relative error of each object's samples of at most
    `SYNTHESIS_SHARE` of `rtol`.

    The error of a transform is relative to the energies of the single paths, the tolerance to the coherent sum of an
    object, which may be a thousandth for an oblique plate. The ratio is estimated for one element pair, at the middle
    time and three frequencies. The first `num_static` objects share one tolerance, relative to their single paths.
    """
    loose, tight = SYNTHESIS_SHARE * rtol, min(MIN_EPS, SYNTHESIS_SHARE * rtol)
    if not paths.num_paths:
        return loose
    gains, patterns = paths.a[0, 0], element_gains(radar, paths)
    weight = patterns[:, patterns.shape[1] // 2]
    middle = gains.shape[1] // 2
    tau = paths.tau[0, 0, :, paths.tau.shape[3] // 2]
    orders = [gains[:, middle]]
    if paths.dispersion is not None:
        orders += [each[0, 0, :, each.shape[3] // 2] for each in paths.dispersion]
    count, group = len(paths.object_names), np.where(paths.object_id < num_static, 0, paths.object_id)
    coherent = np.zeros(count)
    for place in _BAND_POSITIONS:
        frequency = paths.frequency + place * paths.half_band
        waves = sum(each * place**order for order, each in enumerate(orders))
        waves = waves * weight * np.exp(-2j * np.pi * np.mod(frequency * tau, 1.0))
        real, imaginary = (np.bincount(group, part, count) for part in (waves.real, waves.imag))
        coherent += (real**2 + imaginary**2) / len(_BAND_POSITIONS)
    single = np.abs(orders[0] * weight) ** 2
    incoherent = float(np.sqrt(single.sum()))
    if num_static:
        coherent[0] = max(coherent[0], single[group == 0].sum())
    if not incoherent > 0.0:
        return loose
    weakest = coherent[np.unique(group)].min()
    return float(np.clip(loose * np.sqrt(weakest) / incoherent, max(tight, 1e-9), max(loose, 1e-9)))
