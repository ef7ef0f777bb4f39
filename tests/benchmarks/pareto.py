"""Run time against error, scene by scene."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from tests.benchmarks.comparison import PUBLISHED_DEG, compare, compare_frames, compare_rays
from tests.benchmarks.errors import AdcCheck, Known, spurious
from tests.benchmarks.measuring import Peak, default_rtol, timed
from tests.benchmarks.methods import Beams, Lines, Method, Samples, SionnaPaths, Traced, Tubes
from tests.benchmarks.stored import Store
from tests.benchmarks.subjects import SUBJECTS, Subject, sphere

STEP = 1e-3
"""Time between instants [s]: half a millimetre."""
STEPS, SAMPLES_CHECKED = 6, 6
"""Instants and samples of the ADC that bodies are asked for; a quick run takes the first ones."""
PUBLISHED_VIEW = float(np.tan(np.radians(30.0)))
"""Tangent of half of 60 degrees, the field of view of published images."""
SLOW_FLOOR, SLOW_SAMPLES = 0.015, 0.2
"""A method that takes longer for an instant [s] is not asked for 250 of them, or for samples of the ADC."""
PATIENCE = 5.0
"""For all instants of a method [s]."""
VERY_LONG = 20.0
"""The first instant of a method, with what is compiled, after which it is asked for no other [s]."""
LINES_PIXELS, LINES_INSTANTS = (512, 1024, 2048, 4096), (2, 5)
"""Of frames that are traced at a few instants, with lines between them."""
LONGEST = 6.0
"""A ladder ends with the first rung whose instant takes longer [s]."""

Make = Callable[[], Method]


def ladders(subject: Subject, band: int, quick: bool, seed: int) -> Iterator[list[Make]]:
    """Makers of all methods, each made when its turn comes, every list from fast to slow."""
    default = default_rtol()
    tolerances = {1e-1, default, 1e-3} if quick else {1e-1, 1e-2, 1e-3, 1e-4, default}
    if subject.name == "sphere":
        for level in (2, 3, 4) if quick else (2, 3, 4, 5):
            yield [lambda level=level: Traced(sphere(band, level), default, 20 * 4**level)]
        tolerances.discard(default)
        level = 3 if quick else 4
        yield [
            lambda rtol=rtol: Traced(sphere(band, level), rtol, 20 * 4**level)
            for rtol in sorted(tolerances, reverse=True)
        ]
    else:
        yield [lambda rtol=rtol: Traced(subject, rtol) for rtol in sorted(tolerances, reverse=True)]
    # At 24 GHz, and of rays, few settings: they tell the same as those of the other band and of the other methods.
    few = quick or band != 77
    if subject.name == "sphere" if few else subject.scene is None and subject.name != "car":
        yield [lambda r=r: Tubes(subject, r) for r in ((0.03,) if few else (0.03, 0.01))]
        # Of a person until uniform ones are so many that the share of adaptive ones is told.
        most = 10 if subject.name == "person" and not few else 8
        yield [lambda n=n: Tubes(subject, level=n) for n in range(6 if few else 5, most)]
    corner = subject.least_bounces > 1
    if not corner:
        yield [lambda n=n: Beams(subject, n) for n in ((64, 128, 256) if few else (64, 128, 256, 512))]
    counts = [128, 512, 2048] if few else [128, 256, 512, 1024, 2048, 4096]
    if not quick and band == 77 and subject.name in ("sphere", "person"):
        counts += [8192, 16384]  # until it gets to 1 dB and 10 degrees
    for jitter in (False,) if corner else (False, True):
        for view in (PUBLISHED_VIEW,) if corner else (PUBLISHED_VIEW, None):
            yield [lambda n=n, j=jitter, v=view: Samples(subject, n, j, v, seed) for n in counts]
    if subject.name in ("sphere", "plate", "dihedral", "trihedral"):
        yield [lambda: SionnaPaths(baseline_apart(subject) if corner else subject)]
        if not corner:
            rays = (100_000,) if quick else (100_000, 1_000_000, 10_000_000)
            yield [lambda n=n: SionnaPaths(subject, n) for n in rays]


def run(
    name: str, band: int, quick: bool, seed: int, progress: Callable[[str], None], store: Store | None = None
) -> dict[str, Any]:
    """All methods on one scene."""
    subject, store = SUBJECTS[name](band), store or Store()
    heavy = subject.quadrature is not None
    steps = (4 if heavy else 8) if quick else (STEPS if heavy else 16)
    times = STEP * np.arange(steps)
    progress(f"{name}, {band} GHz: the truth")
    before = store.integrated
    seconds, known = timed(lambda: Known(subject, times, store))
    result: dict[str, Any] = {
        "scene": name, "band_ghz": band, "title": subject.title, "truth": subject.truth, "steps": steps,
    }  # fmt: skip
    if heavy:
        result["truth_own_error"] = known.own_error
        result["polyhedron_differs"] = float(abs(known.flat[0] / known.smooth[0] - 1))
    check = AdcCheck(subject, seed, 3 if heavy and quick else SAMPLES_CHECKED if heavy else 32, store)
    rows: list[dict[str, Any]] = []
    left_out = []
    for ladder in ladders(subject, band, quick, seed):
        slow = False
        for make in ladder:
            method = make()
            if slow:
                left_out.append(method.row)
                continue
            progress(f"{name}, {band} GHz: {_words(method.row)}")
            rows.append(measure(method, check, known, quick))
            slow = rows[-1]["seconds"] > LONGEST
            del method
    if heavy:
        result |= {"truth_integrated": store.integrated - before, "truth_seconds": seconds}
    rays = compare_rays(rows, "rays, adaptive", "rays, uniform")
    result["frames"] = over_frames(subject, rows, [] if quick else lines(subject, check, seed, progress))
    result["frames_compared"] = compare_frames(result["frames"], default_rtol())
    return result | {
        "rows": rows, "left_out": left_out, "comparison": compare(rows, default_rtol()), "adaptive_rays": rays,
    }  # fmt: skip


def lines(subject: Subject, check: AdcCheck, seed: int, progress: Callable[[str], None]) -> list[dict[str, Any]]:
    """One sample per pixel at a few instants of a frame, with lines between them."""
    if subject.name not in ("sphere", "person"):
        return []
    found, length = [], subject.radar.waveform.frame_length
    for pixels in LINES_PIXELS:
        samples = Samples(subject, pixels, False, None, seed)
        samples(0.0)
        seconds = min(timed(lambda samples=samples: samples(0.0))[0] for _ in range(3))
        for sample_times in LINES_INSTANTS:
            method = Lines(samples, sample_times, length)
            progress(f"{subject.name}: {_words(method.row)}")
            error = check(method)["adc_relative"]
            found.append(method.row | {"seconds": sample_times * seconds, "adc_relative": error})
    return found


def over_frames(subject: Subject, rows: list[dict[str, Any]], between: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """What a frame takes and is wrong by: ours with its synthesis, the baseline's without."""
    chirps = len(subject.radar.waveform.chirp_times)
    found = []
    for row in rows:
        kept = {key: row[key] for key in ("method", "rtol", "facets", "rays", "view_deg") if key in row}
        if row["method"] == "tracer" and "adc_seconds" in row:
            found.append(kept | {"way": "tracer", "seconds": row["adc_seconds"], "relative": row["adc_relative"]})
        elif row["method"].startswith("one sample per pixel"):
            view = "60°" if row["view_deg"] == PUBLISHED_DEG else "the subject alone"
            error = row.get("adc_relative", row["relative"])  # of slow ones that of instants, to which chirps are alike
            kept |= {"way": f"every chirp, samples over {view}", "of_instants": "adc_relative" not in row}
            found.append(kept | {"seconds": chirps * row["seconds"], "relative": error})
    way = "lines between instants, samples over the subject alone"
    return found + [
        {key: row[key] for key in ("method", "rays", "view_deg", "instants", "seconds")}
        | {"way": way, "relative": row["adc_relative"]}
        for row in between
    ]


def _words(row: dict[str, Any]) -> str:
    return ", ".join(str(value) if key == "method" else f"{key} {value}" for key, value in row.items())


def measure(method: Method, check: AdcCheck, known: Known, quick: bool) -> dict[str, Any]:
    """One row: warm median time of an instant, memory, errors."""
    with Peak() as peak:
        first, value = timed(lambda: method(float(known.times[0])))
        # What takes very long is asked once: it is the last rung of its ladder.
        once = first > VERY_LONG
        again = first if once else timed(lambda: method(float(known.times[-1])))[0]
        # What takes seconds is asked for fewer instants.
        times = known.times[: max(2, int(PATIENCE / again))]
        trials = [(first, value)] if once else [timed(lambda t=t: method(float(t))) for t in times]
    seconds = float(np.median([each for each, _ in trials]))
    row = method.row | {"seconds": seconds, "first_seconds": first, "peak_mb": peak.megabytes}
    row |= known.errors(method, np.array([value for _, value in trials]))
    ours = isinstance(method, Traced)
    reference_level = ours and (row["rtol"] == default_rtol() or check.subject.quadrature is None)
    if reference_level or (not quick and seconds < SLOW_FLOOR):
        row["floor_db"] = spurious(method)
    if (ours and seconds < 1.0) or seconds < SLOW_SAMPLES:
        row |= check(method)
    return row


def baseline_apart(subject: Subject) -> Subject:
    """The subject with Tx and Rx 5 cm apart: Sionna drops segments shorter than 1 cm, and with them a corner's
    returns to where they came from."""
    radar = subject.radar
    return replace(subject, radar=replace(radar, rx_positions=np.array([[0.0, 0.05, 0.0]])))
