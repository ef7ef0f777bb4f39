"""The benchmark's figures as text."""

from __future__ import annotations

from typing import Any

from tests.benchmarks.comparison import sentences
from tests.benchmarks.pareto import LONGEST


def _table(heads: list[str], rows: list[list[str]]) -> str:
    lines = ["| " + " | ".join(heads) + " |", "|" + " --- |" * len(heads)]
    return "\n".join([*lines, *("| " + " | ".join(row) + " |" for row in rows)]) + "\n"


def _number(value: Any, digits: int = 3) -> str:
    return "–" if value is None else f"{value:.{digits}g}"


def _setting(row: dict[str, Any]) -> str:
    parts = []
    if "rtol" in row:
        parts.append(f"rtol {row['rtol']:g}")
    if "facets" in row:
        parts.append(f"{row['facets']:,} facets")
    if "rays" in row:
        parts.append(f"{row['rays']:,} rays")
    if "view_deg" in row:
        parts.append(f"{row['view_deg']:g}° view")
    return ", ".join(parts)


def _share(row: dict[str, Any]) -> str:
    bound = "" if row["reached"] else "less than "
    return (
        f"{row['rays']:,} adaptive rays at rtol {row['rtol']:g}: {bound}{row['share']:.2g} of the "
        f"{row['uniform_rays']:,.0f} uniform ones that reach the same error"
        + ("" if row["reached"] else " or come nearest to it")
        + ".\n"
    )


def markdown(result: dict[str, Any]) -> str:
    """All tables that there are results for."""
    made, load = result["machine"], result.get("load")
    text = [
        f"# {result['command']}\n",
        f"{made['processor']}, {made['cores']} cores, load at the start {load}, {made['variant']}; "
        + ", ".join(f"{name} {value}" for name, value in result["versions"].items())
        + f"; code {str(result['code']['commit'])[:7]}; default rtol {result['default_rtol']:g}; "
        f"seed {result['seed']}; {result.get('seconds', 0.0):.0f} s\n",
    ]
    text += [f"{name} failed: {reason}\n" for name, reason in result.get("failed", {}).items()]
    if result.get("open"):
        text.append(f"Not finished: {', '.join(result['open'])}.\n")
    if result.get("claims"):
        rows = [
            [each["claim"], each["wanted"], f"{_number(each['found'])} {each['unit']}".strip(),
             "yes" if each["holds"] else "**no**", each["note"]]
            for each in result["claims"]
        ]  # fmt: skip
        text.append("## What is to hold\n\n" + _table(["", "wanted", "found", "holds", ""], rows))
    for scene in result.get("scenes", ()):
        own = f"; known to {scene['truth_own_error']:.2g}" if "truth_own_error" in scene else ""
        text.append(f"## {scene['title']}, {scene['band_ghz']} GHz\n\nTruth: {scene['truth']}{own}.\n")
        heads = ["method", "setting", "ms", "first ms", "MB", "rel. error", "dB", "deg", "floor dB", "ADC rel."]
        rows = [
            [
                row["method"], _setting(row), _number(1e3 * row["seconds"]), _number(1e3 * row["first_seconds"]),
                _number(row["peak_mb"]), _number(row["relative"]), _number(row["level_db"]), _number(row["phase_deg"]),
                _number(row.get("floor_db")), _number(row.get("adc_relative")),
            ]
            for row in scene["rows"]
        ]  # fmt: skip
        text.append(_table(heads, rows))
        if scene.get("frames"):
            rows = [
                [row["way"], _setting(row), str(row.get("instants", "–")), _number(row["seconds"]),
                 _number(row["relative"]) + (" (instants)" if row.get("of_instants") else "")]
                for row in scene["frames"]
            ]  # fmt: skip
            text.append(_table(["frame", "setting", "instants", "s", "ADC rel."], rows))
        text += [line + "\n" for line in sentences(scene.get("comparison", {}))]
        text += [_share(row) for row in scene.get("adaptive_rays", ())]
        if scene.get("left_out"):
            names = ", ".join(f"{row['method']} ({_setting(row)})" for row in scene["left_out"])
            text.append(f"Left out, as the rung before took more than {LONGEST:g} s: {names}.\n")
    if "doppler" in result:
        text.append("## Spurious Doppler of a translating adult\n")
        text.append(
            _table(
                ["method", "setting", "floor dB"],
                [[row["method"], _setting(row), _number(row["floor_db"])] for row in result["doppler"]],
            )
        )
    if "synthesiser" in result:
        text.append("## Synthesiser\n")
        heads = ["method", "eps", "s", "rel. error"]
        rows = [
            [row["method"], _number(row.get("eps")), _number(row["seconds"]), _number(row["relative"])]
            for row in result["synthesiser"]["rows"]
        ]
        text.append(_table(heads, rows))
    if "skips" in result:
        text.append("## Skips\n")
        heads = ["skip", "shown with", "s with", "s without", "times faster", "scene differs", "actor differs",
                 "allowed", "holds", "of what the actor leaves of the scene"]  # fmt: skip
        rows = [
            [
                row["skip"], row["of"], _number(row["seconds_on"]), _number(row["seconds_off"]),
                _number(row["times_faster"]), _number(row["difference_room"]), _number(row["difference_actor"]),
                _number(row["allowed"]), "yes" if row["holds"] else "**no**",
                _number(row.get("difference_shadowed_room")),
            ]
            for row in result["skips"]
        ]  # fmt: skip
        text.append(_table(heads, rows))
    if "imports" in result:
        found = result["imports"]
        text.append(f"Import of the package: {found['seconds']:.2f} s, of the heavy libraries {found['imported']}.\n")
    if "scaling" in result:
        text.append("## Scaling\n")
        rows = [
            [name, str(curve["sizes"]), ", ".join(_number(each) for each in curve["seconds"]),
             f"{curve['exponent']:.2f}", curve["of"]]
            for name, curve in result["scaling"].items()
        ]  # fmt: skip
        text.append(_table(["n", "sizes", "s", "exponent", "of"], rows))
    if "pipeline" in result:
        text.append("## Whole runs\n")
        rows = [
            [part, key.replace("_", " "), _number(value, 4) if isinstance(value, float) else str(value)]
            for part, found in result["pipeline"].items()
            for key, value in found.items()
        ]
        text.append(_table(["", "", ""], rows))
    return "\n".join(text)
