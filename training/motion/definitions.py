"""Measure the definitions of actions on the motion library and write their page:
`python -m training.motion.definitions`.

`definition_clips.toml` holds which clips show which action. Subjects are split in two halves, measured each by itself.
"""

from __future__ import annotations

import re
import textwrap
import tomllib
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from rfgen_sionna.generative.action_definitions import DEFINED_ACTIONS, MotionSignals, check
from rfgen_sionna.generative.motion_library import LibraryClip, MotionLibrary
from training.commands import plainly
from training.motion.action_table import performed_lines

CLIPS = Path(__file__).with_name("definition_clips.toml")
"""Which clips show an action."""
_MEASURED = (
    "The definitions were measured on the {clips} clips of the motion library. *True*: clips of the action for "
    "which the definition holds, of one half of the subjects and of the other. *Refused*: clips of other actions "
    "for which it does not hold. Clips that may show the action beside their own (boxing has punches, dances have "
    "turns) count neither way; `training/motion/definition_clips.toml` lists them. Disagreements in both halves led "
    "to corrections, so no rate is one of people never seen. Actions without clips have no "
    "measured rate."
)
_FIELDS = {"shown", "compatible", "mixed"}


@dataclass(frozen=True)
class Clips:
    """Patterns of clips for and beside an action; all others count against it."""

    shown: tuple[str, ...]
    compatible: tuple[str, ...] = ()

    def role(self, clip: LibraryClip) -> str:
        """One of "shown", "compatible" and "other"."""
        if clip.name in read_wrong():
            return "compatible"
        if _among(clip, self.shown):
            return "shown"
        return "compatible" if _among(clip, self.compatible) else "other"


def _among(clip: LibraryClip, patterns: Iterable[str]) -> bool:
    words = " ".join((clip.name, *clip.captions))
    for pattern in patterns:
        name, _, regex = pattern.partition("/")
        if name in ("*", clip.action, clip.name) and re.search(regex, words):
            return True
    return False


@cache
def read_wrong(path: Path = CLIPS) -> dict[str, str]:
    """Clips that do not show what their captions say, with the reason; they count neither way."""
    return dict(tomllib.loads(path.read_text())["wrong"])


def read_clips(path: Path = CLIPS) -> dict[str, Clips]:
    """Clips of each action that has any.

    Raises
    ------
    ValueError
        An action has no definition, or a field is unknown.
    """
    stored = tomllib.loads(path.read_text())
    groups = stored["groups"]
    found = {}
    for action, fields in stored["actions"].items():
        if action not in DEFINED_ACTIONS:
            raise ValueError(f"{path.name}: action '{action}' has no definition")
        if unknown := set(fields) - _FIELDS:
            raise ValueError(f"{path.name}: {action}.{unknown.pop()} is unknown; allowed are {', '.join(_FIELDS)}")
        compatible = [
            name for each in fields["compatible"] for name in (groups[each[1:]] if each[0] == "@" else [each])
        ]
        mixed = groups["mixed"] if fields.get("mixed", True) else []
        found[action] = Clips(tuple(fields["shown"]), (*compatible, *mixed))
    return found


def half_of_subjects(library: MotionLibrary) -> frozenset[str]:
    """One of two halves: every other subject, in the order of the number of their clips."""
    counts = Counter(clip.subject for clip in library)
    return frozenset(sorted(counts, key=lambda subject: (-counts[subject], subject))[1::2])


@dataclass(frozen=True)
class Rates:
    """How often the definition of an action is right."""

    action: str
    true: tuple[int, int]
    """Clips of the action found true, and all, of one half of the subjects."""
    true_before: tuple[int, int]
    """The same of the other half."""
    refused: tuple[int, int]
    """Other clips refused, and all, of one half of the subjects."""
    refused_before: tuple[int, int]
    """The same of the other half."""
    disagreements: tuple[tuple[str, str], ...]
    """(clip, reason) where definition and caption differ; an empty reason for a clip that is found true."""

    @property
    def reliable(self) -> bool:
        """Whether at least 95 % of three or more clips are found true and 95 % of the others refused, in both halves
        together."""
        true, shown = self.true[0] + self.true_before[0], self.true[1] + self.true_before[1]
        refused, other = self.refused[0] + self.refused_before[0], self.refused[1] + self.refused_before[1]
        return shown >= 3 and true >= 0.95 * shown and refused >= 0.95 * other


def measure(
    library: MotionLibrary, signals: dict[str, MotionSignals], actions: Sequence[str] | None = None
) -> dict[str, Rates]:
    """Rates of each action that has clips."""
    first_half = half_of_subjects(library)
    found = {}
    for action, clips in read_clips().items():
        if actions is not None and action not in actions:
            continue
        right: Counter[tuple[str, bool]] = Counter()
        total: Counter[tuple[str, bool]] = Counter()
        disagreements = []
        for clip in library:
            role = clips.role(clip)
            if role == "compatible" or clip.name not in signals:
                continue
            verdict = check(signals[clip.name], action)
            key = role, clip.subject in first_half
            total[key] += 1
            right[key] += verdict.true == (role == "shown")
            if verdict.true != (role == "shown"):
                disagreements.append((clip.name, "; ".join(verdict.reasons)))
        counts = {key: (right[key], total[key]) for key in [(r, h) for r in ("shown", "other") for h in (True, False)]}
        found[action] = Rates(
            action,
            true=counts["shown", True],
            true_before=counts["shown", False],
            refused=counts["other", True],
            refused_before=counts["other", False],
            disagreements=tuple(disagreements),
        )
    return found


def _percent(part: int, whole: int) -> str:
    return f"{100 * part / whole:.1f} %" if whole else "–"


def _of(counts: tuple[int, int]) -> str:
    return f"{counts[0]} of {counts[1]}" if counts[1] else "–"


def page(library: MotionLibrary, rates: dict[str, Rates]) -> str:
    """The page of the actions in Markdown."""
    lines = [
        "# Actions and their definitions",
        "",
        "`is_true_of(motion, action)` says whether a motion shows an action; `check(motion, action).reasons` what is",
        "against it. Both take motions of any rate, body, place and heading, on the floor z = 0. Lengths are of a mean",
        "adult.",
        "",
        "```python",
        "from rfgen_sionna.generative import MotionLibrary, check, is_true_of",
        "",
        'motion = MotionLibrary().motion("hdm05_bd_squat1Reps_002")',
        'assert is_true_of(motion, "squat")',
        'print(check(motion, "sit_down").reasons)',
        "```",
        "",
        *textwrap.wrap(_MEASURED.format(clips=len(library)), 118, break_on_hyphens=False),
        "`python -m training.motion.definitions` writes this page.",
        "",
        "| action | what must be true | true | true, other half | refused |",
        "| --- | --- | --- | --- | --- |",
    ]
    for action, definition in sorted(DEFINED_ACTIONS.items()):
        sentence = definition.sentence
        if definition.undecided:
            sentence += f" Not decided: {definition.undecided}."
        each = rates.get(action)
        empty = each is None or not (each.true[1] or each.true_before[1])
        cells = ["–", "–"] if each is None or empty else [_of(each.true), _of(each.true_before)]
        refused = (
            "–"
            if each is None
            else _percent(each.refused[0] + each.refused_before[0], each.refused[1] + each.refused_before[1])
        )
        lines.append(f"| `{action}` | {sentence} | {cells[0]} | {cells[1]} | {refused} |")
    lines += performed_lines()
    lines += [
        "",
        "## Clips that do not show what their action says",
        "",
        "Seen in stick figures, and left out of the rates:",
        "",
        *(f"- `{name}`: {reason}" for name, reason in sorted(read_wrong().items())),
        "",
        "By the definitions; some hold only a part of the action, some are at the edge:",
        "",
    ]
    for action, each in sorted(rates.items()):
        lines += [f"- `{name}` ({action}): {reason}" for name, reason in each.disagreements if reason]
    return "\n".join(lines) + "\n"


@plainly
def main(out: Annotated[Path, typer.Option(help="Page to write.")] = Path("docs/actions.md")) -> None:
    """Measure the definitions of actions on the motion library and write their page."""
    library = MotionLibrary()
    signals = {clip.name: MotionSignals(library.motion(clip.name)) for clip in library}
    rates = measure(library, signals)
    out.write_text(page(library, rates), encoding="utf-8")
    good = sum(each.reliable for each in rates.values())
    Console().print(f"{out}: {len(DEFINED_ACTIONS)} actions, {len(rates)} measured, {good} of them right on 95 %")


if __name__ == "__main__":
    typer.run(main)
