"""What the benchmark is to show, and whether the figures at hand show it."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

Claim = dict[str, Any]
GIB = 1024.0**3 / 1e6
"""[MB]"""


def claims(result: dict[str, Any]) -> list[Claim]:
    """One entry per claim for which there are figures: what is wanted, what was found, whether it holds."""
    made: list[Claim] = []
    for find in (_against_samples, _frames, _floors, _rays, _times, _skips, _start):
        made += [claim for claim in find(result) if claim["found"] is not None]
    return made


def _most(claim: str, wanted: float, found: float | None, unit: str, note: str = "") -> Claim:
    return {
        "claim": claim, "wanted": f"at most {wanted:g} {unit}", "found": found, "unit": unit,
        "holds": found is not None and found <= wanted, "note": note,
    }  # fmt: skip


def _least(claim: str, wanted: float, found: float | None, unit: str, note: str = "") -> Claim:
    made = _most(claim, wanted, found, unit, note)
    return made | {"wanted": f"at least {wanted:g} {unit}", "holds": found is not None and found >= wanted}


def _against_samples(result: dict[str, Any]) -> Iterator[Claim]:
    names = {"sphere": "moving sphere", "person": "person"}
    for scene in result.get("scenes", ()):
        if scene["scene"] not in names or scene["band_ghz"] != 77:
            continue
        for view, found in scene["comparison"].items():
            of = f"{names[scene['scene']]}, samples over " + ("60°" if view == "published" else "the subject alone")
            yield _least(
                f"{of}: their error to ours at equal time", 100, found["equal_time_ratio"], "times",
                f"at the default tolerance; {found['equal_time_best']:.3g} at the best one",
            )  # fmt: skip
            note = "" if found.get("baseline_reaches_it", True) else "a lower bound: they do not get there"
            yield _least(
                f"{of}: their time to ours at 1 dB and 10°", 100, found.get("equal_error_ratio"), "times", note
            )


def _frames(result: dict[str, Any]) -> Iterator[Claim]:
    names = {"sphere": "moving sphere", "person": "person"}
    for scene in result.get("scenes", ()):
        if scene["scene"] not in names or scene["band_ghz"] != 77:
            continue
        for way, found in scene.get("frames_compared", {}).items():
            of = f"a frame of the {names[scene['scene']]}, {way}"
            yield _least(f"{of}: their error to ours at equal time", 100, found["equal_time_ratio"], "times",
                         "at the default tolerance")  # fmt: skip
            note = "" if found["baseline_reaches_it"] else "a lower bound: they do not get there"
            yield _least(f"{of}: their time to ours at 1 dB and 10°", 100, found["equal_error_ratio"], "times", note)


def _floors(result: dict[str, Any]) -> Iterator[Claim]:
    rows = result.get("doppler", ())
    for row in rows:
        if row["method"] == "tracer" and row["rtol"] == result["default_rtol"]:
            yield _most("Doppler beyond 150 Hz of a translating adult, default tolerance", -90, row["floor_db"], "dB")
    theirs = [row["floor_db"] for row in rows if row["method"].startswith("one sample") and row["pixels"] == 128**2]
    if theirs:
        yield _least("the same of one sample per pixel, 128² rays", -20, min(theirs), "dB",
                     "-6 to -20 is expected")  # fmt: skip


def _rays(result: dict[str, Any]) -> Iterator[Claim]:
    some: list[tuple[str, float, Any]] = []
    for scene in result.get("scenes", ()):
        if scene["scene"] in ("sphere", "person"):
            found = scene.get("adaptive_rays", [])
            finest = found[-1]["rtol"] if found else 0.0
            some.append((f"ray mode, {scene['scene']}, {scene['band_ghz']} GHz", finest, found))
    for name, rtol, rows in some:
        for row in rows:
            if row["rtol"] == rtol:
                bound = "" if row["reached"] else "an upper bound: uniform sampling does not get there"
                yield _most(f"adaptive rays to uniform ones at equal error: {name}", 0.2, row["share"], "", bound)


def _times(result: dict[str, Any]) -> Iterator[Claim]:
    found = result.get("pipeline", {})
    person, room, memory = (found.get(name, {}) for name in ("person", "living_room", "memory"))
    if person:
        at = f"rtol {person['rtol']:g}"
        yield _most("an instant of an adult, warm", 0.04, person["instant_seconds"], "s", at)
        yield _most("a frame of an adult with its knots, the quickest", 0.12, person["frame_seconds"], "s", at)
        if walks := person.get("walks_median_seconds"):
            yield _most(
                f"the same, the median of a walk's, the slowest of {len(walks)} walks", 0.12, max(walks), "s",
                f"{at}; {min(walks):.3g} s of the quickest walk; with the best of all walks for each frame "
                f"{person['best_frames_median_seconds']:.3g} s, {person['best_frames_mean_seconds']:.3g} s in the mean",
            )  # fmt: skip
        yield _most("a frame of an adult from mesh to samples", 0.6, person["mesh_to_samples_seconds"], "s", at)
    if room:
        of = f"of {room['frames']} frames, rtol {room['rtol']:g}"
        yield _most(
            "static part of the living room, once", 2, room.get("static_seconds"), "s", f"rtol {room['rtol']:g}"
        )
        yield _most("100 frames in the living room", 90, room["seconds_for_100"], "s", of)
        yield _most("peak memory of that run", 2, None if room["peak_mb"] is None else room["peak_mb"] / GIB, "GiB")
    if memory:
        yield _most(
            "growth of memory", 10, memory["grown_mb"], "MB", f"over {memory['frames']} frames, after the first quarter"
        )


def _skips(result: dict[str, Any]) -> Iterator[Claim]:
    rows = result.get("skips", ())
    if rows:
        failed = [row["skip"] for row in rows if not row["holds"]]
        yield _most("skips that change the answer by more than the tolerance", 0, len(failed),
                    f"of {len(rows)}", "; ".join(failed))  # fmt: skip


def _start(result: dict[str, Any]) -> Iterator[Claim]:
    if "imports" in result:
        yield _most("import of the package", 0.5, result["imports"]["seconds"], "s")
    start = result.get("pipeline", {}).get("start_up")
    if start:
        first, second = (start[name]["first_frame_seconds"] for name in ("first", "second"))
        yield _most("first frame of a fresh process, kernels compiled", 15, first, "s")
        yield _most("the same with cached kernels, to the first", 1.0, second / first, "times", f"{second:.1f} s")
