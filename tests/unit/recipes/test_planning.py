"""A plan counts what a recipe makes, and says how large it is and how long it takes."""

from pathlib import Path

import pytest
from PIL import Image

from rfgen_sionna.recipes import Recipe, build_dataset
from rfgen_sionna.recipes.plan_sheet import draw_sample_scenes, sample_recordings
from rfgen_sionna.recipes.planning import (
    INDEX_BYTES,
    MIN_PROBES,
    DatasetPlan,
    Probe,
    StratumPlan,
    chosen_probes,
    duration_text,
    plan_dataset,
)

from .recipe_texts import FULL, SHORT
from .small_recipes import write_small_recipe


def test_a_plan_without_probes_counts_everything() -> None:
    recipe = Recipe.parse(FULL)
    plan = plan_dataset(recipe, probes=0, workers=3)
    assert plan.count == sum(plan.splits.values()) == sum(each.count for each in plan.strata) == 300
    assert plan.splits == {"train": 210, "validation": 30, "test": 60}
    assert sum(plan.actions.values()) == 300
    assert sum(plan.counts.values()) == 300
    text = str(plan)
    assert "300 recordings in" in text
    assert "furnished: office" in text
    assert "size and time are not known without probes" in text


def test_size_and_time_are_the_sums_over_the_kinds() -> None:
    strata = (
        StratumPlan(("free space", 1, 2.0), 30, (Probe(0, 1.0, 1000), Probe(1, 3.0, 3000))),
        StratumPlan(("furnished: lab", 1, 2.0), 10, (Probe(2, 10.0, 4000), Probe(3, 14.0, 0, reason="in a wall"))),
    )
    plan = DatasetPlan(40, 2, strata, {"all": 40}, {"waves": 40}, 16, start_seconds=5.0)
    assert plan.seconds == 5.0 + (30 * 2.0 + 10 * 12.0) / 2
    assert plan.bytes == 30 * (2000 + INDEX_BYTES) + 10 * (0.5 * 4000 + INDEX_BYTES)
    assert plan.seconds_error == pytest.approx(((30 * 1.0) ** 2 + (10 * 2.0) ** 2) ** 0.5 / 2)
    assert [probe.number for probe in plan.failed] == [3]
    assert "recording 3 cannot be made: in a wall" in str(plan)
    assert "3 shards of 16" in str(plan)


def test_every_kind_is_probed_by_its_share() -> None:
    recipe = Recipe.parse(FULL)
    kinds: dict[tuple[str, int, float], list[object]] = {}
    for spec in recipe:
        kinds.setdefault((spec.place, len(spec.sources), spec.duration_s), []).append(spec)
    chosen = chosen_probes(kinds, 60, 0)  # type: ignore[arg-type]
    assert all(MIN_PROBES <= len(numbers) == len(set(numbers)) <= len(kinds[kind]) for kind, numbers in chosen.items())
    assert len(chosen[("free space", 1, 0.5)]) > len(chosen[("furnished: lab", 2, 0.5)])
    assert chosen == chosen_probes(kinds, 60, 0)  # type: ignore[arg-type]


def test_wrong_arguments_are_refused_before_probes(tmp_path: Path) -> None:
    recipe = Recipe.parse(SHORT)
    (tmp_path / "old.png").touch()
    for sheet, message in (("old.png", "exists"), ("no/new.png", "does not exist"), ("new.gif", "one of the endings")):
        with pytest.raises(ValueError, match=message):
            plan_dataset(recipe, sheet=tmp_path / sheet)
    with pytest.raises(ValueError, match="workers is 0"):
        plan_dataset(recipe, workers=0)
    with pytest.raises(ValueError, match="probes is -1"):
        plan_dataset(recipe, probes=-1)


def test_times_have_their_two_largest_units() -> None:
    assert [duration_text(seconds) for seconds in (7.2, 130.0, 7_380.0, 400_000.0)] == [
        "7 s", "2 min", "2 h 3 min", "4.6 days",
    ]  # fmt: skip


def test_samples_are_of_different_actions_and_places() -> None:
    chosen = sample_recordings(Recipe.parse(FULL), 5)
    assert len({spec.prompt for spec in chosen}) == 5
    assert len({spec.place for spec in chosen}) == 3


@pytest.mark.slow
def test_the_sheet_shows_rooms_and_people(tmp_path: Path) -> None:
    recipe = Recipe.parse('count = 4\nprompts = "a person waves"\nplaces = ["free space", "a lab"]\nduration_s = 0.5')
    draw_sample_scenes(recipe, tmp_path / "sheet.png", count=2)
    with Image.open(tmp_path / "sheet.png") as picture:
        colours = picture.convert("RGB").getcolors(1 << 24)
    assert colours is not None
    assert len(colours) > 500  # shaded skin and furniture


@pytest.mark.slow
def test_a_plan_holds_for_what_is_then_made(tmp_path: Path) -> None:
    recipe = Recipe.load(write_small_recipe(tmp_path / "recipe", count=40))
    done: list[int] = []
    plan = plan_dataset(recipe, probes=6, workers=1, progress=lambda number, total: done.append(number))
    assert done == list(range(1, len(plan.probes) + 1))
    assert not plan.failed
    build_dataset(recipe, tmp_path / "set", workers=1, progress=False)
    size = sum(path.stat().st_size for path in (tmp_path / "set").glob("*") if path.is_file())
    assert plan.bytes == pytest.approx(size, rel=0.1)
    assert 0.0 < plan.seconds < 600.0
