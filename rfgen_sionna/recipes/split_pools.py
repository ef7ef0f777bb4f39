"""What each split of a set may draw from, so that no two splits share a body, place, action or seed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna.recipes.partitions import WHOLE_SET, partition, stream
from rfgen_sionna.recipes.recipe_error import RecipeError
from rfgen_sionna.recipes.recipe_places import Place
from rfgen_sionna.recipes.recipe_sources import Source
from rfgen_sionna.recipes.recipe_tables import RecipeTables
from rfgen_sionna.recipes.stratified_draws import chosen
from rfgen_sionna.recipes.value_forms import ValueForm


@dataclass(frozen=True)
class Options:
    """Values that a split draws from: their indices among all of a recipe, and their chances."""

    indices: tuple[int, ...]
    chances: tuple[float, ...]
    is_grid: bool = False

    def draw(self, number: float, cell: int) -> tuple[int, float]:
        """Index of a value among all of the recipe, and a number in [0, 1) for a choice that depends on the value.

        `number` in [0, 1) decides the value; of a grid `cell` does.
        """
        if self.is_grid:
            return self.indices[cell % len(self.indices)], number
        index, rest = chosen(number, self.chances)
        return self.indices[index], rest


@dataclass(frozen=True)
class SplitPools:
    """Everything that one split draws from; None is a pool without an end."""

    sources: Options
    places: Options
    bodies: NDArray[np.int64] | None
    motions: NDArray[np.int64] | None
    layouts: Mapping[str, NDArray[np.int64]]
    """Name of a furnished place -> numbers of its layouts; empty for pools without an end."""


def split_pools(tables: RecipeTables, sources: Sequence[Source], places: Sequence[Place]) -> dict[str, SplitPools]:
    """Pools of each split.

    Raises:
        RecipeError: a pool has fewer members than there are splits.
    """
    shares = {WHOLE_SET: 1.0} if tables.splits is None else tables.splits.shares
    by = () if tables.splits is None else tables.splits.by

    def numbers(key: str, size: int | None, what: str, own: str = "") -> dict[str, NDArray[np.int64] | None]:
        if size is None:
            return dict.fromkeys(shares)
        if what not in by:
            return dict.fromkeys(shares, np.arange(size))
        try:
            return {**partition(size, shares, stream(tables.seed, "partition", key, own))}
        except ValueError as error:
            raise RecipeError(f"{key} is {size}, and splits.by has '{what}': {error}") from None

    bodies = numbers("bodies.pool", tables.bodies.pool, "body")
    motions = numbers("motions", tables.motions, "seed")
    layouts = {p.name: numbers("layouts", tables.layouts, "place", p.name) for p in places if p.has_layouts}
    own_sources = _sources_of(tables, sources, shares, "action" in by)
    own_places = _places_of(tables, places, shares, "place" in by)
    found = {}
    for name in shares:
        pools = {place: pool for place, each in layouts.items() if (pool := each[name]) is not None}
        found[name] = SplitPools(own_sources[name], own_places[name], bodies[name], motions[name], pools)
    return found


def source_chances(tables: RecipeTables) -> tuple[tuple[float, ...], bool]:
    """Chance of each source, and whether they are a grid.

    Raises:
        RecipeError: all weights are 0.
    """
    if tables.sources is None:
        form: ValueForm[str] = tables.prompts or ValueForm("scalar", ("",))
        return form.chances, form.is_grid
    weights = [table.weight for table in tables.sources]
    if not sum(weights) > 0.0:
        raise RecipeError("sources: weight is 0 in all of them: a positive one is needed")
    return tuple(weight / sum(weights) for weight in weights), False


def _options(indices: Sequence[int], chances: Sequence[float], is_grid: bool, key: str, split: str) -> Options:
    total = sum(chances[index] for index in indices)
    if not total > 0.0:
        raise RecipeError(f"{key}: those of split '{split}' have weights of 0: give them positive ones")
    return Options(tuple(indices), tuple(chances[index] / total for index in indices), is_grid)


def _sources_of(
    tables: RecipeTables, sources: Sequence[Source], shares: Mapping[str, float], apart: bool
) -> dict[str, Options]:
    chances, is_grid = source_chances(tables)
    if not apart:
        return {name: _options(range(len(sources)), chances, is_grid, "sources", name) for name in shares}
    groups: list[tuple[set[str], list[int]]] = []
    for index, source in enumerate(sources):
        actions, members = set(source.open_actions), [index]
        for group in [each for each in groups if each[0] & actions]:
            groups.remove(group)
            actions, members = actions | group[0], group[1] + members
        groups.append((actions, members))
    try:
        parts = partition(len(groups), shares, stream(tables.seed, "partition", "action"))
    except ValueError as error:
        names = ", ".join(" / ".join(sorted(actions)) for actions, _ in groups)
        raise RecipeError(f"splits.by has 'action', and there are {len(groups)} ({names}): {error}") from None
    return {
        name: _options(sorted(i for group in part for i in groups[group][1]), chances, is_grid, "prompts", name)
        for name, part in parts.items()
    }


def _places_of(
    tables: RecipeTables, places: Sequence[Place], shares: Mapping[str, float], apart: bool
) -> dict[str, Options]:
    form = tables.places or ValueForm("choice", tuple(each.name for each in places))
    scenes = [index for index, place in enumerate(places) if place.kind == "scene"]
    everywhere = [index for index, place in enumerate(places) if place.kind != "scene"]
    if not (apart and scenes):
        return {name: _options(range(len(places)), form.chances, form.is_grid, "places", name) for name in shares}
    if len(scenes) < len(shares):
        names = ", ".join(places[index].name for index in scenes)
        raise RecipeError(
            f"places: splits.by has 'place', and {names} cannot be in {len(shares)} splits at once; give at least "
            f"{len(shares)} scenes, take furnished places instead, or leave 'place' out"
        )
    parts = partition(len(scenes), shares, stream(tables.seed, "partition", "scenes"))
    # The chance of a scene is the same in each split.
    total, found = sum(form.chances[index] for index in scenes), {}
    for name, part in parts.items():
        own = [scenes[index] for index in part]
        inside = sum(form.chances[index] for index in own)
        if total > 0.0 and not inside > 0.0:
            raise RecipeError(f"places: the scenes of split '{name}' have weights of 0: give them positive ones")
        chances = {index: form.chances[index] for index in everywhere}
        chances |= {index: form.chances[index] * total / (inside or 1.0) for index in own}
        indices = sorted(chances)
        found[name] = Options(tuple(indices), tuple(chances[index] for index in indices), form.is_grid)
    return found
