"""A recipe from a stranger runs no code and never takes the process down: a RecipeError is all that comes out."""

import random
import re
import warnings
from contextlib import suppress

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from rfgen_sionna.recipes import Recipe, RecipeError
from rfgen_sionna.recipes.recipe_text import read_tables

from .recipe_texts import FULL, SHORT

VALUES = (
    "-1", "0", "1e308", "inf", "nan", "true", '""', '"a"', "[]", "{}", "[[]]", "9" * 40, '"\\u0000"', "1979-05-27",
    '"/dev/zero"', '"/"', '"../../x.npy"', "{range = [1, 2]}", "{grid = [1]}", "{choice = []}", "[1, [2]]", "0.5",
    '"furnished: a lab"', '"a dog and a cat run"', '"diffusion: a street"', '"scene: /etc/passwd"',
)  # fmt: skip
"""Values of other types, sizes and meanings."""


def mutated(text: str, rng: random.Random) -> str:
    """A text with one to four changes: values replaced, lines doubled, dropped or swapped, characters flipped."""
    for _ in range(rng.randint(1, 4)):
        lines = text.splitlines() or [""]
        index, kind = rng.randrange(len(lines)), rng.randrange(6)
        if kind == 0 and "=" in lines[index]:
            lines[index] = f"{lines[index].split('=')[0]}= {rng.choice(VALUES)}"
        elif kind == 1:
            del lines[index]
        elif kind == 2:
            lines.insert(rng.randrange(len(lines)), lines[index])
        elif kind == 3:
            parts = re.split(r"(\d+\.?\d*|\"[^\"]*\")", lines[index])
            parts[rng.randrange(len(parts))] = rng.choice(VALUES)
            lines[index] = "".join(parts)
        elif kind == 4:
            place = rng.randrange(len(lines[index]) + 1)
            lines[index] = lines[index][:place] + chr(rng.choice((0, 34, 44, 61, 91, 93, 123, 125, 0x2028, 97)))
        else:
            place = rng.randrange(len(lines[index]) + 1)
            lines[index] = lines[index][:place] + lines[index][place + 1 :]
        text = "\n".join(lines)
    return text


def attempt(text: str) -> bool:
    """Whether a text is a recipe; every recording of its first ones can then be drawn."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            recipe = Recipe.parse(text)
        except RecipeError:
            return False
        for number in range(min(5, recipe.count)):
            recipe.recording(number, attempt=1)
    return True


def attempts(count: int, seed: int) -> None:
    rng = random.Random(seed)
    found = [attempt(mutated(rng.choice((FULL, SHORT)), rng)) for _ in range(count)]
    assert any(found)
    assert not all(found)


def test_mutated_recipes_are_refused_or_made() -> None:
    attempts(60, 0)


@pytest.mark.slow
def test_ten_thousand_mutated_recipes_are_refused_or_made() -> None:
    attempts(10_000, 1)


tables = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=20),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=8), inner, max_size=4),
    max_leaves=20,
)


@settings(max_examples=200, suppress_health_check=[HealthCheck.too_slow], deadline=None)
@given(st.text(max_size=200) | st.binary(max_size=200).map(lambda data: data.decode("latin-1")))
def test_any_text_is_refused(text: str) -> None:
    with suppress(RecipeError):
        read_tables(text)


@settings(max_examples=200, suppress_health_check=[HealthCheck.too_slow], deadline=None)
@given(st.sampled_from(sorted(type(read_tables("")).model_fields)), tables)
def test_any_value_of_a_key_is_refused_or_read(key: str, value: object) -> None:
    with suppress(RecipeError):
        read_tables(f"{key} = {_toml(value)}")


def _toml(value: object) -> str:
    if isinstance(value, dict):
        return "{" + ", ".join(f"{_toml(key)} = {_toml(each)}" for key, each in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(_toml, value)) + "]"
    if isinstance(value, str):
        return '"' + "".join(f"\\U{ord(c):08X}" for c in value if not 0xD800 <= ord(c) < 0xE000) + '"'
    return "nan" if value is None else str(value).lower()
