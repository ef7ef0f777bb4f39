"""Figures of merit of the action reader: sentences that are read right, refused, and read wrong without a word."""

from __future__ import annotations

import tomllib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from rfgen_sionna.generative.prompts.action_reader import ActionReader, ActionReading

HELD_OUT = Path(__file__).with_name("held_out.toml")
"""Sentences on which the limits are chosen."""
MOST_WRONG = (0.01, 0.01, 0.02)
"""Largest share of held-out sentences that may be read as something else, by the doubt of the reading ..."""
LEAST = (0.45, 0.55, 0.75)
"""... and the least limits: of sentences of other topics than the held-out ones more are wrong."""


@dataclass(frozen=True)
class Expected:
    """One sentence of an examination."""

    text: str
    right: tuple[str, ...]
    """Readings that are right, such as "walk+wave"; empty where a refusal is."""
    topic: str


@dataclass(frozen=True)
class Outcome:
    """Reading of one sentence of an examination."""

    expected: Expected
    reading: ActionReading

    @property
    def said(self) -> str:
        """Action of legs and arms."""
        return "+".join(filter(None, (self.reading.action, self.reading.arms)))

    @property
    def right(self) -> bool:
        """Whether the sentence is read as meant, or refused as meant."""
        if not self.expected.right:
            return not self.reading.possible
        options = {self.said, *(() if self.reading.arms else self.reading.options)}
        return self.reading.possible and options <= set(self.expected.right)

    @property
    def wrong(self) -> bool:
        """Whether it is read as something else."""
        return self.reading.possible and not self.right

    @property
    def silent(self) -> bool:
        """Whether it is wrong without a word that is named as unknown."""
        return self.wrong and not self.reading.unknown


def examination(path: Path = HELD_OUT) -> list[Expected]:
    """Sentences of a file in the form of held_out.toml."""
    parts = tomllib.loads(path.read_text(encoding="utf-8"))
    return [
        Expected(" ".join(text.split()), tuple(label.split("|")) if part == "read" else (), label)
        for part, labels in parts.items()
        for label, texts in labels.items()
        for text in texts.split(";")
        if text.strip()
    ]


def outcomes(reader: ActionReader, sentences: Sequence[Expected]) -> list[Outcome]:
    """Readings of all sentences."""
    return [Outcome(each, reader.read(each.text)) for each in sentences]


def chosen_limits(found: Sequence[Outcome]) -> tuple[float, float, float]:
    """Least probabilities of a reading, by its doubt: the lowest under which at most `MOST_WRONG` of the sentences of
    that doubt are read as something else.

    Args:
        found: readings without limits.
    """
    limits = []
    for doubt in range(3):
        some = [each for each in found if each.reading.doubt == doubt]
        wrong = sorted((each.reading.probability for each in some if each.wrong), reverse=True)
        allowed = int(MOST_WRONG[doubt] * len(some))
        limits.append(max(LEAST[doubt], round(wrong[allowed] + 0.005, 2) if len(wrong) > allowed else 0.0))
    return limits[0], limits[1], limits[2]


def figures(found: Sequence[Outcome]) -> dict[str, float]:
    """Shares of an examination, of 1."""
    read = [each for each in found if each.expected.right]
    refused = [each for each in found if not each.expected.right]
    return {
        "sentences": len(found),
        "right": _share(each.right for each in found),
        "right of those about actions": _share(each.right for each in read),
        "refused of those about nothing that can be done": _share(each.right for each in refused),
        "wrong": _share(each.wrong for each in found),
        "wrong without a word that is named as unknown": _share(each.silent for each in found),
    }


def _share(flags: Iterable[bool]) -> float:
    values = list(flags)
    return round(sum(values) / max(1, len(values)), 4)
