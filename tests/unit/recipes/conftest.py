"""Builds of noise, and one of the package's own recordings."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import pytest

from rfgen_sionna.radar import Radar
from rfgen_sionna.recipes.building import BuildReport, build_dataset, run_build
from rfgen_sionna.recipes.building_folder import BuildingFolder
from rfgen_sionna.recipes.recipe import Recipe
from rfgen_sionna.recipes.set_facts import SetFacts
from tests.unit.recipes.noise_job import NOISE_COUNT, InlineEngine, NoiseJob
from tests.unit.recipes.set_contents import contents
from tests.unit.recipes.small_recipes import write_small_recipe


@pytest.fixture(scope="session")
def recipe(tmp_path_factory: pytest.TempPathFactory) -> Recipe:
    """Recipe of `NOISE_COUNT` recordings in shards of three, with which :class:`NoiseJob` makes runs of noise."""
    read = Recipe.load(write_small_recipe(tmp_path_factory.mktemp("recipe"), NOISE_COUNT, shard_size="2 MB"))
    read.__dict__["recordings_per_shard"] = 3
    return read


@pytest.fixture(scope="session")
def radar(tiny_toml: Path) -> Radar:
    return Radar.load(tiny_toml)


@pytest.fixture(scope="session")
def build(recipe: Recipe, radar: Radar) -> Callable[..., BuildReport]:
    """Builds runs of noise in a folder."""

    def made(folder: Path, *, engine: Any = None, numbers: Iterable[int] | None = None, **options: Any) -> BuildReport:
        folder.mkdir(exist_ok=True)
        state = BuildingFolder(folder, SetFacts.of(recipe))
        with state.locked():
            job = NoiseJob(recipe, state.path, radar, **options)
            order = range(NOISE_COUNT) if numbers is None else numbers
            return run_build(state, engine or InlineEngine(), job, order, lambda done, failed: None)

    return made


@pytest.fixture(scope="session")
def whole(build: Callable[..., BuildReport], tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    """Files of the set that an undisturbed build makes."""
    folder = tmp_path_factory.mktemp("whole")
    build(folder)
    return contents(folder)


@pytest.fixture(scope="session")
def balls(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """Recipe of six recordings of balls, and the set that one process makes of it."""
    folder = tmp_path_factory.mktemp("balls")
    recipe = write_small_recipe(folder / "recipe")
    report = build_dataset(recipe, folder / "set", workers=1)
    assert (report.count, report.failures) == (6, ())
    return recipe, folder / "set"
