"""Figures of performed actions as the table of their page."""

from __future__ import annotations

import json
import textwrap
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

METRICS = Path("docs/actions-metrics.json")
"""Figures that `python -m training.motion.action_report` writes."""
PICTURE = Path("docs/images/actions-doppler.png")
"""Picture that `python -m training.motion.action_doppler` writes."""
_PERFORMED = (
    "`perform(action, duration, seed)` makes motions from clips of the library, then by rules. Measured by "
    "`python -m training.motion.action_report` on motions of {duration:g} s. *True*: the definition holds at the "
    "first try, and for the motion that is handed out, else it is refused. *Limb speed*: 95th percentile of "
    "wrists and ankles in the liveliest stretch, and over that of its own clips, or of people's where rules make "
    "it. *Slide*: mean speed of standing feet over the floor, and that of the clips. *Below floor*: deepest joint "
    "or sole of all motions. *Variety*: rms over joints of two seeds as they are aligned in time, and over that "
    "of clips of different people where five or more show the action. *Nearest clip*: the same distance to the "
    "nearest clip or its mirror image, and of a clip to the nearest other take of the same person. *Recognised*: "
    "named rightly by decision trees that have seen no clip of these people and no definition, and clips named "
    "rightly. Seeds: {seeds}."
)
_SEEN = "Twenty actions as an AWR1843 sees them, each beside the clip that it begins with:"
_COLUMNS: Mapping[str, Callable[[Mapping[str, Any]], str]] = {
    "true, first try": lambda f: f"{100 * f['first']:.0f} %",
    "true": lambda f: f"{100 * f['true']:.0f} %",
    "s a motion": lambda f: f"{f['seconds']:.2f}",
    "limb speed [m/s]": lambda f: _number(f["speed"], 1),
    "over clips'": lambda f: _number(f["speed_ratio"], 2),
    "slide, clips' [cm/s]": lambda f: f"{_number(f['slide'], 1, 100)}, {_number(f['slide_clips'], 1, 100)}",
    "below floor [cm]": lambda f: f"{100 * f['below']:.1f}",
    "variety [cm]": lambda f: _number(f["variety"], 1, 100),
    "over people's": lambda f: _number(f["variety_ratio"], 2),
    "nearest clip, takes [cm]": lambda f: f"{_number(f['nearest'], 1, 100)}, {_number(f['takes'], 1, 100)}",
    "recognised, clips": lambda f: f"{_number(f['recognised'], 0, 100)}, {_number(f['recognised_clips'], 0, 100)} %",
}
"""Heading and text of each column."""


def _number(value: float | None, digits: int, scale: float = 1.0) -> str:
    return "–" if value is None else f"{scale * value:.{digits}f}"


def table(results: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """Lines of a Markdown table of the figures of actions, as read from the JSON file."""
    lines = [f"| action | {' | '.join(_COLUMNS)} |", "| --- " * (1 + len(_COLUMNS)) + "|"]
    for action, figures in sorted(results.items()):
        lines.append(f"| `{action}` | {' | '.join(column(figures) for column in _COLUMNS.values())} |")
    return lines


def performed_lines(metrics: Path = METRICS, picture: Path = PICTURE) -> list[str]:
    """Part of the page about motions of `perform`, with the picture where there is one; empty without figures."""
    if not metrics.exists():
        return []
    stored = json.loads(metrics.read_text(encoding="utf-8"))
    seeds = sorted({each["seeds"] for each in stored["actions"].values()})
    text = _PERFORMED.format(duration=stored["duration"], seeds=" or ".join(map(str, seeds)))
    return [
        "",
        "## Motions of these actions",
        "",
        *textwrap.wrap(text, 118, break_on_hyphens=False),
        "",
        *([_SEEN, "", f"![Micro-Doppler](images/{picture.name})", ""] if picture.exists() else []),
        *table(stored["actions"]),
    ]
