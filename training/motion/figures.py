"""The examination's figures as the table of the model card."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np


class _Row(NamedTuple):
    label: str
    keys: tuple[str, ...]
    wanted: str
    scale: float = 1.0
    digits: int = 2
    unit: str = ""


_ROWS = (
    _Row("recognised, seen wording", ("recognised, seen wording",), "95 %", 100, 1, " %"),
    _Row("worst actions, seen wording", ("worst action, seen wording",), "0.80"),
    _Row("recognised, unseen wording", ("recognised, paraphrases",), "90 %", 100, 1, " %"),
    _Row("worst actions, unseen wording", ("worst action, paraphrases",), "0.80"),
    _Row("rhythm, nine actions whose real motion has it", ("rhythm, where real motion has it",), "0.92", 1, 3),
    _Row("rhythm, all periodic actions / real", ("rhythm", "rhythm, real"), ""),
    _Row("Fréchet distance over floor, synthesised", ("Fréchet distance over floor, kinematic",), "3", 1, 1),
    _Row("Fréchet distance over floor, captured", ("Fréchet distance over floor, captured",), "3", 1, 1),
    _Row("least variance within an action over real", ("least variance ratio",), "0.4"),
    _Row("mean jerk over real, synthesised / captured", ("jerk ratio", "jerk ratio, captured"), "0.7–1.5"),
    _Row("foot slide, all / walking [cm/s]", ("foot slide [m/s]", "foot slide walking [m/s]"), "2 / 5", 100, 1),
    _Row("foot slide, captured manner [cm/s]", ("foot slide, captured [m/s]",), "", 100, 1),
    _Row("poses out of joint limits", ("poses out of joint limits",), "0.5 %", 100, 3, " %"),
    _Row("negative prompts complied with", ("negative prompts complied with",), "80 %", 100, 0, " %"),
    _Row("prompts outside the vocabulary warned about", ("outside the vocabulary, warned",), "100 %", 100, 0, " %"),
    _Row(
        "distance to the nearest training clip over that of unseen real clips, synthesised / captured",
        (
            "distance to the nearest training clip over that of unseen real clips",
            "distance to the nearest captured clip over that of unseen captured ones",
        ),
        "about 1",
    ),
    _Row("planted feet within 1 cm of the floor", ("planted feet within 1 cm of the floor",), "100 %", 100, 1, " %"),
    _Row(
        "planted feet farthest from the floor / hands under it [mm]",
        ("planted feet farthest from the floor [m]", "hands under the floor at most [m]"), "10", 1000, 1,
    ),
    _Row(
        "skin inside the body / synthesised / at rest",
        ("skin inside the body", "skin inside the body, synthesised", "skin inside the body, at rest"),
        "rest", 100, 2, " %",
    ),
    _Row(
        "of it hands, forearms and feet / synthesised",
        (
            "skin of hands, forearms and feet inside the body",
            "skin of hands, forearms and feet inside the body, synthesised",
        ),
        "rest", 100, 2, " %",
    ),
)  # fmt: skip


def table(results: Mapping[str, Any]) -> str:
    """Markdown of what the examination found: mean and standard deviation over seeds, from drafts and from noise."""
    columns = {"from drafts (default)": results["seeds"], "from noise": results.get("from noise", ())}
    lines = [
        f"Mean and standard deviation over {len(results['seeds'])} seeds",
        "",
        f"| | {' | '.join(columns)} | wanted |",
        "|---" * (2 + len(columns)) + "|",
    ]
    for row in _ROWS:
        cells = [_cell(row, found) for found in columns.values()]
        if any(cells):
            lines.append(f"| {row.label} | {' | '.join(cells)} | {row.wanted} |")
    return "\n".join(lines) + "\n"


def _cell(row: _Row, found: Sequence[Mapping[str, Any]]) -> str:
    parts = []
    for key in row.keys:
        values = [each[key] for each in found if each.get(key) is not None]
        if values and isinstance(values[0], Mapping):
            names = {name for value in values for name in value}
            # One that is not among the worst of a seed was at least as good as those that are.
            mean = {n: np.mean([v.get(n, max(v.values())) for v in values]) for n in names}
            worst = sorted(mean.items(), key=lambda item: item[1])[:2]
            parts.append(", ".join(f"{name} {share:.2f}" for name, share in worst))
        elif values:
            # Of a median and the least, the median.
            scaled = row.scale * np.array([np.ravel(value)[0] for value in values], float)
            spread = f" ± {scaled.std(ddof=1):.{row.digits}f}" if len(scaled) > 1 else ""
            parts.append(f"{scaled.mean():.{row.digits}f}{spread}{row.unit}")
    return " / ".join(parts)
