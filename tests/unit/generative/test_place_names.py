"""Places are named in many ways, with what is said of them, in prompts and in descriptions."""

from __future__ import annotations

import pytest

from rfgen_sionna.generative.environment.requested_objects import NAMES
from rfgen_sionna.generative.prompts import PromptError, parse_environment, read_prompt
from training.environment.place_captions import article

NAMED = [(name, place) for place, names in NAMES.items() for name in names]


@pytest.mark.parametrize(("name", "place"), NAMED)
def test_what_the_models_know_a_place_by_names_it_everywhere(name: str, place: str) -> None:
    asked = parse_environment(article(name))
    assert asked is not None
    assert (asked.place, asked.unused) == (place, ())
    said = read_prompt(f"a person jumps in {article(name)}, at 2 m")
    named = parse_environment(said.surroundings)
    assert named is not None
    assert (named.place, said.unused) == (place, ())


@pytest.mark.parametrize(
    ("prompt", "scene", "unused"),
    [
        ("a person jumps in a small office", "office", ("small",)),
        ("a person walks down a busy road at 5 m", "simple_street_canyon", ("busy",)),
        ("a person jumps, large quiet bedroom, facing left", "bedroom", ("large quiet",)),
        ("an old man jumps in the lab", "lab", ()),
    ],
)
def test_what_is_said_of_a_place_does_not_make_it_unknown(prompt: str, scene: str, unused: tuple[str, ...]) -> None:
    said = read_prompt(prompt)
    assert (said.surroundings, said.unused) == (scene, unused)


def test_an_adjective_of_the_place_is_none_of_the_person() -> None:
    assert read_prompt("a person jumps in an old garage").body == read_prompt("a person jumps").body


@pytest.mark.parametrize("place", ["post office", "football field", "small kitchen"])
def test_another_kind_of_place_stays_unknown(place: str) -> None:
    with pytest.raises(PromptError, match=rf"'in a {place}' names none that is known; .*places bedroom.*street; the"):
        read_prompt(f"a person jumps in a {place}")


def test_what_a_place_is_with_is_in_it() -> None:
    for text, scene, unused in (
        ("a living room with a box", "living_room", ("box",)),
        ("a street with a garage and parked cars", "simple_street_canyon", ("garage", "parked cars")),
        ("a street with parked cars", "simple_street_canyon_with_cars", ()),
        ("a box with two screens", "box_two_screens", ()),
        ("a room with a view of a street", "simple_street_canyon", ("room", "view")),
    ):
        asked = parse_environment(text)
        assert asked is not None
        assert (asked.scene, asked.unused) == (scene, unused)
    for several in ("a living room or an office with a box", "an office in a street"):
        with pytest.raises(PromptError, match="several scenes"):
            parse_environment(several)
