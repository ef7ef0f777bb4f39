"""The text of a recipe as checked tables; a fault is a :class:`RecipeError` with the path of its key."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator, Mapping, Sequence
from difflib import get_close_matches
from typing import Any, get_args

from pydantic import BaseModel, ValidationError

from rfgen_sionna._short_repr import short_value
from rfgen_sionna.recipes.recipe_error import RecipeError
from rfgen_sionna.recipes.recipe_tables import RecipeTables
from rfgen_sionna.recipes.value_forms import TAGS

MAX_BYTES = 4_000_000
"""Largest text of a recipe [bytes]."""
MAX_DEPTH = 12
"""Deepest nesting of tables and lists."""
FORMS = ("choice", "weights", "range", "grid")
"""Keys of the tables of forms."""
MAX_FAULTS = 8
"""Most faults in one message."""


def read_tables(text: str) -> RecipeTables:
    """Tables of a recipe in TOML.

    Raises:
        RecipeError: the text is no TOML, has unknown keys, or values of another type or out of bounds; all faults are
            named, up to `MAX_FAULTS`.
    """
    if not isinstance(text, str):
        raise RecipeError(f"recipe is a {type(text).__name__}: the text of a TOML file is needed")
    if len(text) > MAX_BYTES:
        raise RecipeError(f"recipe has {len(text)} characters; allowed are {MAX_BYTES}")
    try:
        tables = tomllib.loads(text)
    except RecursionError:
        raise RecipeError(f"recipe nests tables and lists too deeply; allowed are {MAX_DEPTH} levels") from None
    except ValueError as error:
        raise RecipeError(f"recipe is no TOML: {error}") from None
    _check_depth(tables)
    try:
        return RecipeTables.model_validate(tables)
    except ValidationError as error:
        faults = list(dict.fromkeys(_faults(error, tables)))
    except (OverflowError, RecursionError) as error:
        raise RecipeError(f"recipe holds a number or nesting out of bounds: {error}") from None
    raise_faults(faults)
    raise RecipeError("recipe is at fault")


def raise_faults(faults: Sequence[str]) -> None:
    """One RecipeError of all faults, of the first `MAX_FAULTS` if there are more; none without any."""
    more = [f"… and {len(faults) - MAX_FAULTS} more"] if len(faults) > MAX_FAULTS else []
    if faults:
        raise RecipeError("\n".join([*faults[:MAX_FAULTS], *more]))


def key_path(place: Sequence[str | int], tables: Any) -> str:
    """Path of a key as `tables` have it, `radars[1].preset`, of a path of pydantic, which has names of types, too."""
    text, value, tagged = "", tables, False
    for part in place:
        if part in TAGS and not tagged:
            tagged = True
        elif isinstance(part, int):
            if isinstance(value, list) and part < len(value):
                text, value = f"{text}[{part}]", value[part]
        elif isinstance(value, Mapping) and part in value:
            text, value = (f"{text}.{part}" if text else part), value[part]
    return text


def _check_depth(value: Any) -> None:
    level = [value]
    for _ in range(MAX_DEPTH + 1):
        level = [
            part
            for each in level
            if isinstance(each, (dict, list))
            for part in (each.values() if isinstance(each, dict) else each)
        ]
        if not level:
            return
    raise RecipeError(f"recipe nests tables and lists too deeply; allowed are {MAX_DEPTH} levels")


def _faults(error: ValidationError, tables: Any) -> Iterator[str]:
    for fault in error.errors(include_url=False, include_context=False):
        place, kind = tuple(fault["loc"]), fault["type"]
        path, given = key_path(place, tables), short_value(fault["input"])
        if kind == "extra_forbidden":
            name = str(place[-1])
            above = key_path(place[:-1], tables)
            if name in FORMS and len(place) > 1 and place[-2] in TAGS:
                yield _mixed(above, str(place[-2]), name)
                continue
            yield f"{above}{'.' if above else ''}{name}: there is no such key{_near(name, _known_keys(place[:-1]))}"
        elif "scalar" in place and isinstance(fault["input"], Mapping) and fault["input"]:
            name = str(next(iter(fault["input"])))
            if name in FORMS:
                yield _mixed(path, "", name)
            else:
                yield f"{path}.{name}: there is no such key{_near(name, FORMS)}"
        elif kind == "missing":
            above = key_path(place[:-1], tables)
            yield f"{above}{'.' if above else ''}{place[-1]} is missing"
        elif kind == "value_error":
            yield f"{path or 'recipe'}: {fault['msg'].removeprefix('Value error, ')}"
        else:
            text = fault["msg"].removeprefix("Input should be ").removeprefix("Value should be ")
            yield f"{path} is {given}: {text} is needed" if text != fault["msg"] else f"{path} is {given}: {text}"


def _mixed(path: str, form: str, name: str) -> str:
    """Fault of a table of a form that has the key of another one."""
    if name == "weights":
        return f"{path}.weights: weights belong to a choice, {{choice = [...], weights = [...]}}"
    return f"{path}: {form} and {name} are both given; leave one out"


def _known_keys(place: Sequence[str | int]) -> list[str]:
    """Keys of the table at a path of pydantic."""
    model: type[BaseModel] = RecipeTables
    for part in place:
        if part in TAGS[1:]:
            return list(FORMS)
        if not isinstance(part, str) or part not in model.model_fields:
            continue
        found = next(_models(model.model_fields[part].annotation), None)
        model = found or model
    return list(model.model_fields)


def _models(annotation: Any) -> Iterator[type[BaseModel]]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
    for part in get_args(annotation):
        yield from _models(part)


def _near(name: str, known: Sequence[str]) -> str:
    """Hint at the nearest of known names, or all of them."""
    close = get_close_matches(name, known, n=1, cutoff=0.5)
    return f": did you mean {close[0]!r}?" if close else f"; known are {', '.join(known)}"
