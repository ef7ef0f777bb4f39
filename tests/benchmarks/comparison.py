"""Ours against one sample per pixel: error at equal time, time at equal error, both read off the measured curves.

A method's curve joins its settings that no faster one beats, straight lines between them on logarithmic axes. Of the
baseline's ways to do it (with fresh jitter or without, at so many instants) each has its own, of which the best counts:
joined they would be a step where two settings take nearly the same time. A curve is not continued beyond its ends:
before the baseline's fastest setting its error counts as that setting's, and where the baseline never gets as good as
is asked for, the time of its slowest setting is a lower bound. Both are in its favour.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

LEVEL_DB, PHASE_DEG = 1.0, 10.0
"""What counts as equal error."""
PUBLISHED_DEG = 60.0
"""Field of view of published images."""
FRAME_ERROR = 0.22
"""Relative error of samples that are 1 dB and 10 degrees off."""

Row = dict[str, Any]
Point = tuple[float, float]


def front(rows: Sequence[Row], error: Callable[[Row], float]) -> list[Point]:
    """(seconds, error) of the rows that no other one beats in both, the fastest first."""
    kept: list[Point] = []
    for seconds, value in sorted((float(row["seconds"]), float(error(row))) for row in rows):
        if not kept or value < kept[-1][1]:
            kept.append((seconds, value))
    return kept


def error_at(curve: Sequence[Point], seconds: float) -> float:
    """Error that a curve reaches in `seconds`; that of its ends beyond them."""
    times, values = np.log(np.maximum(np.array(curve).T, 1e-12))
    return float(np.exp(np.interp(np.log(seconds), times, values)))


def time_at(curve: Sequence[Point], error: float) -> tuple[float, bool]:
    """Seconds after which a curve is at `error`, and whether it gets there: if not, those of its last setting."""
    if curve[-1][1] > error:
        return curve[-1][0], False
    if curve[0][1] <= error:
        return curve[0][0], True
    times, values = np.log(np.maximum(np.array(curve).T, 1e-12))
    return float(np.exp(np.interp(-np.log(error), -values, times))), True


def curves(rows: Sequence[Row], error: Callable[[Row], float]) -> list[list[Point]]:
    """Those of each way, told apart by what it is called and at how many instants it looks."""
    ways: dict[tuple[Any, ...], list[Row]] = {}
    for row in rows:
        ways.setdefault((row.get("method"), row.get("instants")), []).append(row)
    return [front(some, error) for some in ways.values()]


def least_error(some: Sequence[Sequence[Point]], seconds: float) -> float:
    """Error that the best of some curves reaches in `seconds`."""
    return min(error_at(each, seconds) for each in some)


def least_time(some: Sequence[Sequence[Point]], error: float) -> tuple[float, bool]:
    """Seconds after which the first of some curves is at `error`, and whether one gets there; a lower bound where one
    that does not ends before: it might have, with a little more."""
    return min(time_at(each, error) for each in some)


def shortfall(row: Row) -> float:
    """1 where a row is just right to 1 dB and 10 degrees."""
    return max(row["level_db"] / LEVEL_DB, row["phase_deg"] / PHASE_DEG)


def compare(rows: Sequence[Row], rtol: float) -> dict[str, Any]:
    """Against the baseline with the published view, and with the one that just holds the subject; nothing where either
    is missing. `rtol` is the default tolerance."""
    ours = [row for row in rows if row["method"] == "tracer"]
    baseline = [row for row in rows if row["method"].startswith("one sample per pixel")]
    views = {
        "published": [row for row in baseline if row["view_deg"] == PUBLISHED_DEG],
        "tight": [row for row in baseline if row["view_deg"] < PUBLISHED_DEG],
    }
    return {name: _against(ours, some, rtol) for name, some in views.items() if ours and some}


def _against(ours: Sequence[Row], baseline: Sequence[Row], rtol: float) -> dict[str, Any]:
    theirs = curves(baseline, lambda row: row["relative"])
    phases = curves(baseline, lambda row: row["phase_deg"])
    at_equal_time = []
    for row in ours:
        there = least_error(theirs, row["seconds"])
        at_equal_time.append({
            "rtol": row["rtol"], "facets": row.get("facets"), "seconds": row["seconds"], "ours": row["relative"],
            "theirs": there, "ratio": there / max(row["relative"], 1e-12),
            "phase_ratio": least_error(phases, row["seconds"]) / max(row["phase_deg"], 1e-9),
        })  # fmt: skip
    found: dict[str, Any] = {
        "equal_time": at_equal_time,
        # Of several meshes at the default tolerance, the one that is best.
        "equal_time_ratio": max((each["ratio"] for each in at_equal_time if each["rtol"] == rtol), default=None),
        "equal_time_best": max(each["ratio"] for each in at_equal_time),
        "largest_rays": max(row["rays"] for row in baseline),
    }
    mine, ours_reach = time_at(front(ours, shortfall), 1.0)
    other, they_reach = least_time(curves(baseline, shortfall), 1.0)
    if ours_reach:
        found |= {
            "equal_error_ours_seconds": mine, "equal_error_their_seconds": other, "equal_error_ratio": other / mine,
            "baseline_reaches_it": they_reach,
        }  # fmt: skip
    return found


def compare_frames(rows: Sequence[Row], rtol: float) -> dict[str, Any]:
    """Whole frames, ours traced once and synthesised, against one sample per pixel by the `way` that it takes over the
    frame; `seconds` and `relative` of the `rows` are those of a frame and of its samples."""
    ours = [row for row in rows if row["way"] == "tracer"]
    found: dict[str, Any] = {}
    if not ours:
        return found
    for way in dict.fromkeys(row["way"] for row in rows if row["way"] != "tracer"):
        theirs = [row for row in rows if row["way"] == way]
        some = curves(theirs, lambda row: row["relative"])
        mine, reached = time_at(front(ours, lambda row: row["relative"]), FRAME_ERROR)
        other, they_reach = least_time(some, FRAME_ERROR)
        ratios = [
            least_error(some, row["seconds"]) / max(row["relative"], 1e-12) for row in ours if row["rtol"] == rtol
        ]
        found[way] = {
            "equal_time_ratio": max(ratios, default=None), "equal_error_ratio": other / mine if reached else None,
            "equal_error_ours_seconds": mine, "equal_error_their_seconds": other, "baseline_reaches_it": they_reach,
            "largest_rays": max(row["rays"] for row in theirs),
        }  # fmt: skip
    return found


def compare_rays(rows: Sequence[Row], adaptive: str, uniform: str) -> list[dict[str, Any]]:
    """Of each `adaptive` row the rays that `uniform` sampling needs for the same error, by the same reading of curves;
    where it never gets there, its most are a lower bound of them."""
    known = [row | {"seconds": row["rays"]} for row in rows if row["method"] == uniform]
    found = []
    for row in rows:
        if row["method"] == adaptive and known:
            needed, reached = time_at(front(known, lambda each: each["relative"]), row["relative"])
            found.append({
                "rtol": row["rtol"], "rays": row["rays"], "relative": row["relative"], "uniform_rays": needed,
                "reached": reached, "share": row["rays"] / needed,
            })  # fmt: skip
    return found


def sentences(found: dict[str, Any]) -> list[str]:
    """What :func:`compare` found, in words."""
    names = {"published": "of the published view of 60°", "tight": "of the view that just holds the subject"}
    lines = []
    for name, those in found.items():
        text = f"Against one sample per pixel {names[name]}, at equal time: error "
        ratio = those["equal_time_ratio"]
        text += "–" if ratio is None else f"{ratio:.3g}"
        text += f" times smaller at the default tolerance, {those['equal_time_best']:.3g} at the best one"
        if "equal_error_ratio" in those:
            bound = "" if those["baseline_reaches_it"] else "more than "
            text += f"; at equal error (1 dB, 10°): {bound}{those['equal_error_ratio']:.3g} times faster"
            if not those["baseline_reaches_it"]:
                text += f", as it does not get there with {those['largest_rays']:,} rays"
        lines.append(text + ".")
    return lines
