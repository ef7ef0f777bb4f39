"""Sentences of the people who use the package, by the field they work in (`sentences.toml`)."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest

pytest.importorskip("anny")

from rfgen_sionna.generative.prompts import PromptError, ThingPrompt
from rfgen_sionna.generative.several_actors import read_prompts

SENTENCES = tomllib.loads(Path(__file__).with_name("sentences.toml").read_text(encoding="utf-8"))
REFUSED = "refused"


def reading(sentence: str) -> tuple[str, bool]:
    """Actions of the actors, and whether a refusal or a warning is about the sentence."""
    try:
        read = read_prompts(sentence)
    except PromptError:
        return REFUSED, True
    actions = [
        each.target if isinstance(each, ThingPrompt) else " + ".join(filter(None, (each.action, each.arms)))
        for each in read.said
    ]
    return " & ".join(actions), any(each.warnings for each in read.said)


@pytest.fixture(scope="module")
def wrong() -> list[tuple[str, str, bool]]:
    """(sentence, reading, whether something is said about it) of what is read otherwise than meant."""
    found = []
    for sentences in SENTENCES.values():
        for sentence, meant in sentences.items():
            read, said = reading(sentence)
            if read not in ([meant] if isinstance(meant, str) else meant):
                found.append((sentence, read, said))
    return found


def test_sentences_are_read_as_they_are_meant(wrong: list[tuple[str, str, bool]]) -> None:
    count = sum(map(len, SENTENCES.values()))
    impossible = sum(REFUSED in meant for sentences in SENTENCES.values() for meant in sentences.values())
    assert count >= 200
    assert impossible >= count / 5
    assert len(wrong) <= 0.1 * count, wrong
    silent = [row for row in wrong if not row[2]]
    assert len(silent) <= 0.01 * count, silent


def test_the_papers_prompts_are_all_right(wrong: list[tuple[str, str, bool]]) -> None:
    assert not [row for row in wrong if row[0] in SENTENCES["the paper's prompts"]]


def test_a_refusal_names_three_that_can_be_done() -> None:
    with pytest.raises(PromptError, match=r"the nearest that can be done are: .*; .*; .*"):
        read_prompts("a person swims")
