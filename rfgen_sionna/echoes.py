"""Samples of frame after frame: while those of one are made the next one is traced."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna.pir.fused import Fusion
from rfgen_sionna.radar import Radar
from rfgen_sionna.records import RadarPaths
from rfgen_sionna.signal import synthesize
from rfgen_sionna.signal.accuracy import needed_accuracy
from rfgen_sionna.tracing.tracer import Tracer, TraceReport

TIDIED_EVERY = 50
"""Frames after which what is free goes back to the system."""


class Stretch(NamedTuple):
    """What is traced for a frame."""

    begin: float
    """[s]"""
    static: tuple[RadarPaths, ...]
    """What every frame has."""
    parts: Callable[[], Sequence[RadarPaths]]
    """Works all else out, on whatever thread."""
    report: TraceReport
    shown: tuple[RadarPaths, ...]
    """Actors and imagined surroundings, where images need them."""
    still: int
    """So many of the first objects stay in the world, and share one tolerance."""


def stretches(tracer: Tracer, fusion: Fusion | None, times: NDArray[np.float64]) -> Iterator[Stretch]:
    """What is traced for each of the frames that begin at `times` [s], one at a time, when it is asked for."""
    moving, length = tracer.follow(), tracer.radar.waveform.frame_length
    still = sum(each.still for each in (*tracer.surfaces.static, *tracer.surfaces.moving))
    if fusion is not None:
        refinement = fusion.refinement(float(times[0]), float(times[-1]) + length)
        for begin in times.tolist():
            fused = fusion.trace(begin, begin + length, moving, refinement)
            yield Stretch(begin, (), partial(tuple, fused.parts), fused.report, fused.parts, still)
        return
    for begin in times.tolist():
        traced = tracer.trace(begin, begin + length, moving)
        yield Stretch(begin, (traced.static,), traced.changing, traced.report, (), still)


def echoes(
    radar: Radar,
    traced: Iterator[Stretch],
    rtol: float,
    gains: NDArray[np.complex128] | None,
    device: str,
    begun: Callable[[], None],
) -> Iterator[tuple[NDArray[np.complex128], Stretch]]:
    """(chirp, tx, rx, sample) of each frame before the receiver, and what was traced for it.

    Tracing goes on in the caller's thread while samples are made in another; between two frames nothing goes on.
    Each object's sum is right to a share of `rtol` of itself (:mod:`rfgen_sionna.signal.accuracy`); `gains` and
    `device` are those of :func:`rfgen_sionna.signal.synthesize`; `begun` is called when the static scene is traced,
    where there is one.
    """

    def samples(parts: Callable[[], Sequence[RadarPaths]], start: float, still: int) -> NDArray[np.complex128]:
        total = np.zeros(radar.frame_shape, dtype=np.complex128)
        for part in parts():
            eps = needed_accuracy(radar, part, rtol, still)
            total += synthesize(radar, part, start, eps=eps, tx_gains=gains, device=device)
        return total

    following, still, frames = next(traced, None), None, 0
    with ThreadPoolExecutor(1, "rfgen-samples") as other:
        if following is not None and following.static:
            begun()
            # Nothing in it changes: one synthesis serves every frame.
            still = other.submit(samples, partial(tuple, following.static), 0.0, following.still)
        while following is not None:
            now, made = following, other.submit(samples, following.parts, following.begin, following.still)
            failure: Exception | None = None
            try:
                following = next(traced, None)
            except Exception as error:  # once this frame, which is whole, is handed over
                failure = error
            yield made.result() if still is None else made.result() + still.result(), now
            if failure is not None:
                raise failure
            frames += 1
            if frames % TIDIED_EVERY == 0:
                _tidy()


def _tidy() -> None:
    """Give free memory back to the system: glibc keeps what lies between blocks in use, and arrays whose size changes
    from frame to frame leave tens of megabytes of it in a thousand frames. Other C libraries are left alone."""
    with suppress(AttributeError, OSError, TypeError):
        ctypes.CDLL(None).malloc_trim(0)
