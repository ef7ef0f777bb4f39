"""Recordings of each split have the shares of a choice to within one, and cover a range evenly."""

from collections import Counter
from collections.abc import Hashable, Iterable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rfgen_sionna.recipes import Recipe
from rfgen_sionna.recipes.stratified_draws import StratifiedDraws, chosen

RECIPE = """
count = 90
seed = {seed}
prompts = {{choice = ["a man waves", "a woman claps", "a person bows"], weights = [3, 2, 1]}}
places = {{choice = ["free space", "furnished: an office"], weights = [2, 1]}}
layouts = 12
motions = 9
duration_s = [0.5, 1.0]
distance_m = {{range = [2.0, 3.0]}}
position_m = {{range = [[0.0, -0.1, 0.9], [0.0, 0.1, 1.1]]}}
bodies = {{pool = 12, gender = ["female", "male"], height_m = {{range = [1.5, 1.9]}}}}
splits = {{shares = {{train = 0.6, validation = 0.15, test = 0.25}}, by = {by}}}
"""

SOURCES = {"waves": 6.0, "claps": 3.0, "bows": 1.0}
"""Action -> weight."""


def draws_of(size: int, seed: int = 0, attempt: int = 0, group: str = "all") -> list[StratifiedDraws]:
    return [StratifiedDraws(seed, rank, attempt, group, rank, size) for rank in range(size)]


def assert_shares(found: Iterable[Hashable], chances: dict[str, float]) -> None:
    counts = Counter(found)
    assert set(counts) <= set(chances)
    for value, chance in chances.items():
        assert abs(counts[value] - chance * counts.total()) < 1.0 + 1e-9, (value, counts)


def assert_covered(values: Iterable[float | None], low: float, high: float) -> None:
    """One value lies in each of equal intervals."""
    cells = (np.array([*values], float) - low) / (high - low)
    assert sorted(np.floor(cells * len(cells))) == [*range(len(cells))]


@given(st.integers(1, 200), st.lists(st.integers(0, 20), min_size=1, max_size=8).filter(any), st.integers(0, 2**40))
def test_each_value_of_a_choice_has_its_share_to_within_one(size: int, weights: list[int], seed: int) -> None:
    found = [chosen(each.even("key"), weights) for each in draws_of(size, seed)]
    for index, weight in enumerate(weights):
        own = sorted(rest for value, rest in found if value == index)
        assert abs(len(own) - size * weight / sum(weights)) < 1.0 + 1e-9
        assert all(0.0 <= rest < 1.0 for rest in own)
        # A second choice within the value has its shares, too.
        assert abs(sum(rest < 0.5 for rest in own) - len(own) / 2) <= 1.0


@given(st.integers(1, 200), st.integers(0, 2**40))
def test_a_range_has_one_number_in_each_interval(size: int, seed: int) -> None:
    assert_covered([each.loose("key") for each in draws_of(size, seed)], 0.0, 1.0)


@pytest.mark.parametrize("other", [draws_of(300, seed=1), draws_of(300, group="test"), draws_of(300, attempt=1)])
def test_seeds_splits_and_attempts_are_independent(other: list[StratifiedDraws]) -> None:
    pairs = [(a.loose("a"), b.loose("a")) for a, b in zip(draws_of(300), other, strict=True)]
    assert abs(np.asarray(np.corrcoef(pairs, rowvar=False))[0, 1]) < 0.2


def test_keys_are_independent() -> None:
    pairs = [(each.even("a"), each.even("b"), each.loose("c 0"), each.loose("c 1")) for each in draws_of(300)]
    assert np.abs(np.corrcoef(pairs, rowvar=False) - np.eye(4)).max() < 0.2


@pytest.mark.parametrize("seed", range(6))
def test_four_recordings_of_two_prompts_have_two_of_each(seed: int) -> None:
    recipe = Recipe.parse(f'count = 4\nseed = {seed}\nprompts = ["a man waves", "a woman claps"]', check=False)
    assert Counter(spec.prompt for spec in recipe) == {"a man waves": 2, "a woman claps": 2}


def test_weights_of_sources_are_shares() -> None:
    text = "\n".join(f'[[sources]]\nprompt = "a person {word}"\nweight = {weight}' for word, weight in SOURCES.items())
    recipe = Recipe.parse("count = 10\n" + text, check=False)
    assert Counter(spec.prompt.split()[-1] for spec in recipe) == {"waves": 6, "claps": 3, "bows": 1}


@pytest.mark.parametrize("by", ['["body", "place", "seed"]', "[]"])
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_every_split_of_a_recipe_is_balanced(seed: int, by: str) -> None:
    recipe = Recipe.parse(RECIPE.format(seed=seed, by=by), check=False)
    bodies: dict[int, tuple[str | None, float | None]] = {}
    for split in recipe.splits:
        own = [spec for spec in recipe if spec.split == split]
        assert_shares((s.prompt for s in own), {"a man waves": 1 / 2, "a woman claps": 1 / 3, "a person bows": 1 / 6})
        assert_shares((s.place for s in own), {"free space": 2 / 3, "furnished: office": 1 / 3})
        assert_shares((s.duration_s for s in own), {0.5: 0.5, 1.0: 0.5})  # type: ignore[dict-item]
        assert_covered((s.distance_m for s in own), 2.0, 3.0)
        for axis, (low, high) in {1: (-0.1, 0.1), 2: (0.9, 1.1)}.items():
            assert_covered((s.radars[0].position_m[axis] for s in own), low, high)
        pools = recipe._pools[split]
        assert pools.bodies is not None
        assert pools.motions is not None
        offices = [spec for spec in own if spec.place != "free space"]
        assert_equal_use((s.bodies[0].seed for s in own), len(pools.bodies))
        assert_equal_use((s.motion_seed for s in own), len(pools.motions))
        assert_equal_use((s.place_seed for s in offices), len(pools.layouts["furnished: office"]))
        people = {s.bodies[0].seed: (s.bodies[0].gender, s.bodies[0].height_m) for s in own}
        if len(people) == len(pools.bodies):
            assert_shares((gender for gender, _ in people.values()), {"female": 0.5, "male": 0.5})
        for body, attributes in people.items():  # one person is the same in all splits
            assert bodies.setdefault(body, attributes) == attributes


def assert_equal_use(found: Iterable[int], pool: int) -> None:
    counts = Counter(found)
    assert len(counts) == min(pool, counts.total())
    assert max(counts.values()) - min(counts.values()) <= 1


def test_bodies_without_a_pool_are_balanced() -> None:
    body = 'bodies = {gender = ["female", "male"], height_m = {range = [1.5, 1.9]}}'
    recipe = Recipe.parse(f'count = 21\nprompts = "a person waves"\n{body}', check=False)
    bodies = [spec.bodies[0] for spec in recipe]
    assert_shares((body.gender for body in bodies), {"female": 0.5, "male": 0.5})
    heights = np.sort([body.height_m for body in bodies])
    assert np.abs((heights - 1.5) / 0.4 * 21 - (np.arange(21) + 0.5)).max() < 0.6  # rounded to a millimetre


def test_people_of_a_recording_are_different_bodies_of_the_pool() -> None:
    recipe = Recipe.parse('count = 10\nprompts = "a person waves"\npeople = 3\nbodies = {pool = 4}', check=False)
    used = Counter(body.seed for spec in recipe for body in spec.bodies)
    assert all(len({body.seed for body in spec.bodies}) == 3 for spec in recipe)
    assert len(used) == 4
