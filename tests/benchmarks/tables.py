"""The benchmark's figures as text."""

from __future__ import annotations

from typing import Any


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


def markdown(result: dict[str, Any]) -> str:
    """All tables that there are results for."""
    made = result["machine"]
    text = [
        f"# {result['command']}\n",
        f"{made['processor']}, {made['cores']} cores, load at the start {made['load']}, {made['variant']}; "
        + ", ".join(f"{name} {value}" for name, value in result["versions"].items())
        + f"; {result.get('seconds', 0.0):.0f} s\n",
    ]
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
        if found := scene.get("comparison"):
            words = [f"Against one sample per pixel: error {found['error_ratio_at_equal_time']:.3g} times smaller and"]
            words.append(f"phase error {found['phase_ratio_at_equal_time']:.3g} times smaller at equal time")
            if "time_ratio_at_equal_error" in found:
                bound = "" if found["baseline_reaches_it"] else "more than "
                words.append(f"; {bound}{found['time_ratio_at_equal_error']:.3g} times faster at 1 dB and 10°")
            text.append(" ".join(words).replace(" ;", ";") + ".\n")
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
    if "sampling" in result:
        text.append("## Rays for visibility, uniform and adaptive\n")
        rows = [
            [row["method"], f"{row['rays']:,}", _number(row["relative"]), _number(1e3 * row["seconds"] or None)]
            for row in result["sampling"]["rows"]
        ]
        text.append(_table(["method", "rays", "rel. error", "ms"], rows))
    if "skips" in result:
        text.append("## Skips\n")
        heads = ["skip", "s with", "s without", "times faster", "facets", "without", "room differs", "adult differs"]
        rows = [
            [
                row["skip"], _number(row["seconds_on"]), _number(row["seconds_off"]), _number(row["times_faster"]),
                f"{row['facets_on']:,}", f"{row['facets_off']:,}", _number(row["difference_room"]),
                _number(row["difference_actor"]),
            ]
            for row in result["skips"]["rows"]
        ]  # fmt: skip
        text.append(_table(heads, rows))
        imports = result["skips"]["imports"]
        text.append(
            f"Import of the package: {imports['seconds']:.2f} s, of the heavy libraries {imports['imported']}.\n"
        )
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
