"""One reading of negations for every prompt: words that negate are found, names that hold such words are left alone."""

from __future__ import annotations

import pytest

from rfgen_sionna.generative.environment.requested_objects import check_words
from rfgen_sionna.generative.prompts import PromptError, parse_environment, read_prompt
from rfgen_sionna.generative.prompts.text_reader import negation_in


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("a living room without a sofa", "without"),
        ("A street with NO cars", "no"),
        ("an office that isn't furnished", "not"),
        ("a bus stop, but no bench", "no"),
        ("a person near the bus stops walking", "stops"),
        ("a garage that used to be a shop", "used to"),
        ("minus the sofa", "minus"),
        ("a room lacking furniture", "lacking"),
        ("a room free of furniture", "free of"),
        ("a car-free street", "car free"),
        ("an office missing its desk", "missing"),
        ("zero sofas", "zero"),
        ("a lab w/o chairs", "w/o"),
    ],
)
def test_a_negation_is_found(text: str, word: str) -> None:
    assert negation_in(text) == word


@pytest.mark.parametrize(
    "text",
    [
        "",
        "a street with a bus stop",
        "a street with tram-stops and a stop sign",
        "a never-ending corridor",
        "office no. 5",
        "a street with a no-parking sign",
        "a garage used to repair cars",
        "turned by -30 degrees",
        "a notebook, a nook and a doorstop",
        "a corridor without end",
        "a free spot in a lab",
        "turned by zero degrees",
    ],
)
def test_names_and_numbers_are_no_negations(text: str) -> None:
    assert negation_in(text) is None


def test_all_prompts_read_negations_alike() -> None:
    readers = (
        lambda place: read_prompt(f"a person jumps, environment: {place}"),
        lambda place: read_prompt(f"a person jumps in {place}"),
        parse_environment,
        lambda place: check_words(place, ""),
    )
    for read in readers:
        read("a street with a bus stop")
        with pytest.raises(PromptError, match="'without'"):
            read("a street without a bus stop")


def test_a_negated_place_is_told_where_the_negation_belongs() -> None:
    with pytest.raises(PromptError, match=r"'without'.*known: free space.*negative environment prompt"):
        parse_environment("a living room without a sofa")
