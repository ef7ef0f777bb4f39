"""A fault in the text of a recipe is named by the path of its key, with what is allowed."""

from pathlib import Path

import pytest

from rfgen_sionna.recipes import RecipeError
from rfgen_sionna.recipes.recipe_tables import BodiesTable, RadarTable, RecipeTables, SourceTable, SplitsTable
from rfgen_sionna.recipes.recipe_text import MAX_BYTES, MAX_FAULTS, read_tables


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("cuont = 3", "cuont: there is no such key: did you mean 'count'?"),
        ('[[radars]]\nradar = "a"\nprest = "b"', "radars[0].prest: there is no such key: did you mean 'preset'?"),
        ("[bodies]\nheigth_m = 2.0", "bodies.heigth_m: there is no such key: did you mean 'height_m'?"),
        ("distance_m = {rang = [1, 2]}", "distance_m.rang: there is no such key: did you mean 'range'?"),
        ("people = {choice = [1], weigts = [1]}", "people.weigts: there is no such key: did you mean 'weights'?"),
        ("distance_m = {choice = [2], range = [1, 2]}", "distance_m: choice and range are both given; leave one out"),
        ("distance_m = {grid = [2, 3], weights = [1, 2]}", "distance_m.weights: weights belong to a choice"),
        ("distance_m = {weights = [1, 2]}", "distance_m.weights: weights belong to a choice"),
        ('[splits]\nby = ["body"]', "splits.shares is missing"),
        ('[[radars]]\nname = "a"', "radars[0].radar is missing"),
        ('prompts = "a"\n[[sources]]\nprompt = "b"', "prompts and sources are both given"),
        ("distance_m = {range = [2, 1]}", "the low end first, then the high end is needed"),
        ("distance_m = {range = [-2, 1]}", "distance_m.range[0] is -2: greater than 0 is needed"),
        ("distance_m = {grid = [2, -1]}", "distance_m.grid[1] is -1: greater than 0 is needed"),
        ("distance_m = [2, -1]", "distance_m[1] is -1: greater than 0 is needed"),
        ("distance_m = {choice = [1, 2], weights = [1]}", "weights are 1, values 2"),
        ("distance_m = {choice = [1, 2], weights = [0, 0]}", "weights are all 0"),
        (
            'prompts = {range = ["a", "b"]}',
            "a value, a list, {choice = [...], weights = [...]}, {grid = [...]} is needed",
        ),
        ("count = 3.5", "count is 3.5: a valid integer is needed"),
        ("count = true", "count is True: a valid integer is needed"),
        ("count = 2_000_000", "count is 2000000: less than or equal to 1000000 is needed"),
        ("rtol = nan", "rtol is nan: a finite number is needed"),
        ('shard_size = "5 XB"', "a size with a unit (B, kB, MB, GB, KiB, MiB, GiB) is needed"),
        ("shard_size = 5", "a size with a unit"),
        ("[splits]\nshares = {a = 0.5, b = 0.4}", "0.5 + 0.4 is 0.9: a sum of 1 is needed"),
        ('[splits]\nshares = {a = 1.0}\nby = ["bdy"]', "splits.by[0] is 'bdy'"),
        ('[[sources]]\nprompt = "a"\nclip = "b"', "sources[0]: prompt and clip given: exactly one of"),
        ('[[sources]]\nmesh = "a"\nwords = "b"', "sources[0]: words does not belong to a mesh"),
        ("a = " + "[" * 5000, "recipe "),
        ("receiver = " + "{a = " * 20 + "1" + "}" * 20, "nests tables and lists too deeply"),
        ("count = " + "9" * 5000, "no TOML"),
        ("x = \x00", "no TOML"),
    ],
)
def test_faults_name_the_key_and_the_cure(text: str, message: str) -> None:
    with pytest.raises(RecipeError) as caught:
        read_tables(text)
    assert message in str(caught.value)


def test_all_faults_are_named_at_once() -> None:
    with pytest.raises(RecipeError) as caught:
        read_tables("\n".join(f"key{index} = 1" for index in range(20)))
    lines = str(caught.value).splitlines()
    assert len(lines) == MAX_FAULTS + 1
    assert lines[-1] == f"… and {20 - MAX_FAULTS} more"


def test_a_huge_text_is_refused_unread() -> None:
    with pytest.raises(RecipeError, match="allowed are"):
        read_tables("#" * (MAX_BYTES + 1))


def test_a_list_of_three_numbers_is_a_position_and_lists_of_them_a_choice() -> None:
    assert read_tables("position_m = [0, 1, 2]").position_m.kind == "scalar"
    assert read_tables("position_m = [[0, 1, 2], [0, 0, 1]]").position_m.kind == "choice"


def test_sizes_have_units() -> None:
    assert read_tables('shard_size = "2 MiB"').shard_size == 2 * 2**20


def test_the_page_of_recipes_has_every_key() -> None:
    page = (Path(__file__).parents[3] / "docs" / "recipes.md").read_text()
    tables = (RecipeTables, SourceTable, RadarTable, BodiesTable, SplitsTable)
    keys = {key for table in tables for key in table.model_fields}
    assert not {key for key in keys if f"`{key}`" not in page and f"[{key}]" not in page}
