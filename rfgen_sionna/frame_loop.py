"""The frame loop: one thread traces while another sums, or several processes do both."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna.parallel import one_blas_thread
from rfgen_sionna.pir.fused_tracer import FusedTracer
from rfgen_sionna.processes import map_in_processes
from rfgen_sionna.radar import Radar
from rfgen_sionna.records import RadarPaths
from rfgen_sionna.signal import synthesize
from rfgen_sionna.signal.synthesis_accuracy import required_eps
from rfgen_sionna.tracing.report import TraceReport
from rfgen_sionna.tracing.tracer import Tracer

TIDIED_EVERY = 50
"""Number of frames after which free memory goes back to the system."""
RUN = 4
"""Number of consecutive frames that one process computes."""


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
    """Actors and imagined surroundings, for images; empty where surroundings are modelled."""
    still: int
    """Number of static objects, the first ones, which share one tolerance."""


def frame_tracer(
    tracer: Tracer, fusion: FusedTracer | None, times: NDArray[np.float64]
) -> Callable[[float], TracedFrame]:
    """Function that traces the frame that begins at one of the `times` [s]. Frames are traced one after another: each
    starts from the facets of the one before."""
    moving, length = tracer.follow(), tracer.radar.waveform.frame_length
    still = sum(each.still for each in (*tracer.surfaces.static, *tracer.surfaces.moving))
    if fusion is None:

        def traced(begin: float) -> TracedFrame:
            found = tracer.trace(begin, begin + length, moving)
            return TracedFrame(begin, (found.static,), found.changing, found.report, (), still)

        return traced
    refinement = fusion.refinement(float(times[0]), float(times[-1]) + length)

    def fused(begin: float) -> TracedFrame:
        found = fusion.trace(begin, begin + length, moving, refinement)
        return TracedFrame(begin, (), partial(tuple, found.parts), found.report, found.parts, still)

    return fused


def frame_samples(
    radar: Radar,
    trace: Callable[[float], TracedFrame],
    times: NDArray[np.float64],
    rtol: float,
    gains: NDArray[np.complex128] | None,
    device: str,
    begun: Callable[[], None],
    workers: int,
) -> Iterator[tuple[NDArray[np.complex128], TracedFrame]]:
    """Samples (chirp, tx, rx, sample) of each frame before the receiver, and the traced frame without its paths.

    One worker traces in the caller's thread while another thread sums. Several workers are processes; each traces and
    sums `RUN` frames at a time, from the facets of the first frame. Their samples are the same to the bit whatever
    their number. The sum of each object is accurate to a share of `rtol` of itself
    (:mod:`rfgen_sionna.signal.synthesis_accuracy`).

    Parameters
    ----------
    times
        (frame,) starts of the frames [s].
    gains, device
        As `tx_gains` and `device` of :func:`rfgen_sionna.signal.synthesize`.
    begun
        Called once the static scene is traced, where there is one.
    """

    @one_blas_thread()
    def samples(parts: Callable[[], Sequence[RadarPaths]], start: float, still: int) -> NDArray[np.complex128]:
        total = np.zeros(radar.frame_shape, dtype=np.complex128)
        for part in parts():
            eps = required_eps(radar, part, rtol, still)
            total += synthesize(radar, part, start, eps=eps, tx_gains=gains, device=device)
        return total

    def emptied(frame: TracedFrame) -> TracedFrame:
        return frame._replace(static=(), parts=tuple)

    first = trace(float(times[0]))
    still: NDArray[np.complex128] | float = 0.0
    if first.static:
        begun()
        # Nothing in it changes: one synthesis serves every frame.
        still = samples(partial(tuple, first.static), 0.0, first.still)
    if workers > 1:

        def of_frame(number: int) -> tuple[NDArray[np.complex128], TracedFrame]:
            frame = trace(float(times[number]))
            return samples(frame.parts, frame.begin, frame.still), emptied(frame)

        yield samples(first.parts, first.begin, first.still) + still, emptied(first)
        runs = [range(start, min(start + RUN, len(times))) for start in range(1, len(times), RUN)]
        for made, frame in map_in_processes(of_frame, runs, workers):
            yield made + still, frame
        return
    rest, frames = map(trace, times[1:].tolist()), 0
    now: TracedFrame | None = first
    with ThreadPoolExecutor(1, "rfgen-samples") as other:
        while now is not None:
            summed = other.submit(samples, now.parts, now.begin, now.still)
            following, failure = None, None
            try:
                following = next(rest, None)
            except Exception as error:  # once this frame, which is whole, is handed over
                failure = error
            yield summed.result() + still, emptied(now)
            if failure is not None:
                raise failure
            now, frames = following, frames + 1
            if frames % TIDIED_EVERY == 0:
                _tidy()


def _tidy() -> None:
    """Give free memory back to the system. glibc keeps the gaps between blocks in use, which grow as the sizes of
    arrays change from frame to frame. Other C libraries are left alone."""
    with suppress(AttributeError, OSError, TypeError):
        ctypes.CDLL(None).malloc_trim(0)
