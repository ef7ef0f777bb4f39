"""Run time against error, scene by scene."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from tests.benchmarks.errors import AdcCheck, Known, spurious
from tests.benchmarks.measuring import Peak, timed
from tests.benchmarks.methods import Beams, Method, Samples, SionnaPaths, Traced
from tests.benchmarks.subjects import SUBJECTS, Subject, sphere

STEP = 1e-3
"""Time between instants [s]: half a millimetre."""
PUBLISHED_VIEW = float(np.tan(np.radians(30.0)))
"""Tangent of half of 60 degrees, the field of view of published images."""
SLOW_FLOOR, SLOW_SAMPLES = 0.05, 0.3
"""A method that takes longer for an instant [s] is not asked for 250 of them, or for samples of the ADC."""
PATIENCE = 8.0
"""For all instants of a method [s]."""


def methods(subject: Subject, band: int, quick: bool, seed: int) -> Iterator[Callable[[], Method]]:
    """Makers of all methods, each made when its turn comes."""
    curved = (2, 3, 4) if quick else (2, 3, 4, 5)
    for rtol in (1e-1, 1e-3) if quick else (1e-1, 1e-2, 1e-3, 1e-4):
        if subject.name == "sphere":
            for level in curved if rtol == 1e-3 else curved[-2:-1]:
                yield lambda rtol=rtol, level=level: Traced(sphere(band, level), rtol, 20 * 4**level)
        else:
            yield lambda rtol=rtol: Traced(subject, rtol)
    corner = subject.least_bounces > 1
    for pixels in () if corner else (64, 128, 256) if quick else (64, 128, 256, 512, 1024):
        yield lambda pixels=pixels: Beams(subject, pixels)
    for pixels in (128, 512) if quick else (128, 256, 512, 1024, 2048, 4096):
        for jitter in (False,) if corner else (False, True):
            yield lambda pixels=pixels, jitter=jitter: Samples(subject, pixels, jitter, PUBLISHED_VIEW, seed)
            if not corner:
                yield lambda pixels=pixels, jitter=jitter: Samples(subject, pixels, jitter, None, seed)
    if subject.name in ("sphere", "plate", "dihedral", "trihedral"):
        yield lambda: SionnaPaths(baseline_apart(subject) if corner else subject)
        for samples in () if corner else (100_000,) if quick else (100_000, 1_000_000, 10_000_000):
            yield lambda samples=samples: SionnaPaths(subject, samples)


def run(name: str, band: int, quick: bool, seed: int, progress: Callable[[str], None]) -> dict[str, Any]:
    """All methods on one scene."""
    subject = SUBJECTS[name](band)
    heavy = subject.quadrature is not None
    steps = (4 if heavy else 8) if quick else (6 if heavy else 16)
    times = STEP * np.arange(steps)
    progress(f"{name}, {band} GHz: the truth")
    seconds, known = timed(lambda: Known(subject, times))
    result: dict[str, Any] = {
        "scene": name, "band_ghz": band, "title": subject.title, "truth": subject.truth, "steps": steps,
        "truth_seconds": seconds,
    }  # fmt: skip
    if subject.quadrature is not None and len(subject.quadrature().points) < 6_000_000:
        finer = subject.quadrature(oversampling=1.4).gain(np.zeros(3), subject.frequency)
        result["truth_own_error"] = abs(finer / known.smooth[0] - 1)
        if known.flat is not known.smooth:
            result["polyhedron_differs"] = float(abs(known.flat[0] / known.smooth[0] - 1))
    check = AdcCheck(subject, seed, 3 if heavy and quick else 6 if heavy else 32)
    rows: list[dict[str, Any]] = []
    for make in methods(subject, band, quick, seed):
        method = make()
        progress(f"{name}, {band} GHz: {method.row}")
        rows.append(measure(method, check, known, quick))
        del method
    return result | {"rows": rows}


def measure(method: Method, check: AdcCheck, known: Known, quick: bool) -> dict[str, Any]:
    """One row: warm median time of an instant, memory, errors."""
    with Peak() as peak:
        first = timed(lambda: method(float(known.times[0])))[0]
        again = timed(lambda: method(float(known.times[-1])))[0]
        # What takes seconds is asked for fewer instants.
        times = known.times[: max(3, int(PATIENCE / again))]
        trials = [timed(lambda t=t: method(float(t))) for t in times]
    seconds = float(np.median([each for each, _ in trials]))
    row = method.row | {"seconds": seconds, "first_seconds": first, "peak_mb": peak.megabytes}
    row |= known.errors(method, np.array([value for _, value in trials]))
    if isinstance(method, Traced) or (not quick and seconds < SLOW_FLOOR):
        row["floor_db"] = spurious(method)
    if isinstance(method, Traced) or seconds < SLOW_SAMPLES:
        row |= check(method)
    return row


def compare(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Ours against one sample per pixel of the published view: error at equal time, time at equal error (1 dB and 10
    degrees). Where the baseline never gets that far, its longest time makes it a bound."""
    ours = [row for row in rows if row["method"] == "tracer"]
    theirs = [row for row in rows if row["method"].startswith("one sample per pixel") and row.get("view_deg") == 60.0]
    if not ours or not theirs:
        return {}
    best = min((row for row in ours), key=lambda row: row["relative"])
    affordable = [row for row in theirs if row["seconds"] <= 1.2 * best["seconds"]] or [min(theirs, key=_seconds)]
    equal_time = min(row["relative"] for row in affordable) / best["relative"]
    good_ours = [row for row in ours if _good(row)]
    good_theirs = [row for row in theirs if _good(row)]
    found: dict[str, Any] = {
        "ours_seconds": best["seconds"], "ours_relative": best["relative"], "error_ratio_at_equal_time": equal_time,
        "phase_ratio_at_equal_time": min(row["phase_deg"] for row in affordable) / max(best["phase_deg"], 1e-9),
    }  # fmt: skip
    if good_ours:
        fastest = min(map(_seconds, good_ours))
        reached = min(map(_seconds, good_theirs)) if good_theirs else max(map(_seconds, theirs))
        found |= {"time_ratio_at_equal_error": reached / fastest, "baseline_reaches_it": bool(good_theirs)}
    return found


def _seconds(row: dict[str, Any]) -> float:
    return float(row["seconds"])


def _good(row: dict[str, Any]) -> bool:
    return bool(row["level_db"] <= 1.0 and row["phase_deg"] <= 10.0)


def baseline_apart(subject: Subject) -> Subject:
    """The subject with Tx and Rx 5 cm apart: Sionna drops segments shorter than 1 cm, and with them a corner's
    returns to where they came from."""
    radar = subject.radar
    return replace(subject, radar=replace(radar, rx_positions=np.array([[0.0, 0.05, 0.0]])))
