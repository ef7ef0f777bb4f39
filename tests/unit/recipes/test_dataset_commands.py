"""`rfgen dataset`: what it says, and its exit codes."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from typer.testing import CliRunner

from rfgen_sionna import cli
from rfgen_sionna.dataset.set_index import Failure
from rfgen_sionna.radar import Radar
from rfgen_sionna.recipes.building import run_build
from rfgen_sionna.recipes.building_folder import BuildingFolder
from rfgen_sionna.recipes.recipe import Recipe
from rfgen_sionna.recipes.set_facts import SetFacts, note_origin, recipe_of_set
from tests.unit.recipes.noise_job import InlineEngine, NoiseJob
from tests.unit.recipes.small_recipes import write_small_recipe


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory, tiny_toml: Path) -> tuple[Path, Path]:
    """A recipe, and a set of noise that claims to be made of it."""
    folder = tmp_path_factory.mktemp("made")
    path = write_small_recipe(folder / "recipe", 2)
    recipe, target = Recipe.load(path), folder / "set"
    target.mkdir()
    state = BuildingFolder(target, SetFacts.of(recipe))
    with state.locked():
        job = NoiseJob(recipe, state.path, Radar.load(tiny_toml), impossible=(1,))
        run_build(state, InlineEngine(), job, range(2), lambda done, failed: None)
    return path, target


def rfgen(*arguments: Any) -> tuple[int, str]:
    done = CliRunner().invoke(cli.app, ["dataset", *map(str, arguments)])
    error = "" if done.exception is None else str(done.exception)
    return done.exit_code, " ".join((done.output + error).split())


def test_a_build_that_is_stopped_says_how_it_goes_on(made: Any, tmp_path: Path, monkeypatch: Any) -> None:
    def stopped(*_: Any, **__: Any) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("rfgen_sionna.recipes.building.build_dataset", stopped)
    recipe, folder = made
    for arguments in (("build", recipe, tmp_path / "set"), ("resume", "--recipe", recipe, folder)):
        code, said = rfgen(*arguments)
        assert code != 0
        assert f"rfgen dataset resume {arguments[-1]} makes the rest" in said


def test_verify_names_each_damage_and_repair_mends_it(made: Any) -> None:
    _, folder = made
    assert rfgen("verify", folder) == (0, f"whole: all files of {folder} are as they were written")
    (folder / "README.md").write_text("another")
    code, said = rfgen("verify", folder)
    assert code == 1
    assert "damaged: README.md" in said
    assert f"rfgen dataset repair {folder}" in said
    code, said = rfgen("repair", folder)
    assert code == 0
    assert "1 recordings, 0 of them made now, 1 not made" in said
    assert "not made: recording 1 (seed" in said
    assert rfgen("verify", folder)[0] == 0
    assert "nothing" in rfgen("repair", folder)[1]


@pytest.mark.parametrize(
    ("count", "kind", "code"), [(1, "impossible", 0), (1, "error", 1), (1, "crashed", 1), (0, "impossible", 1)]
)
def test_the_exit_status_says_whether_a_set_is_finished(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, count: int, kind: str, code: int
) -> None:
    recipe = write_small_recipe(tmp_path / "recipe", 2)
    report = SimpleNamespace(
        folder=tmp_path, count=count, made=count, failures=(Failure(1, 7, kind, "no"),), warnings={}
    )
    monkeypatch.setattr("rfgen_sionna.recipes.building.build_dataset", lambda *_, **__: report)
    assert rfgen("build", recipe, tmp_path / "set")[0] == code


def test_a_whole_set_needs_no_resuming(made: Any) -> None:
    recipe, folder = made
    code, said = rfgen("resume", folder, "--recipe", recipe)
    assert code == 0
    assert "0 of them made now" in said


def test_files_of_a_recipe_are_found_beside_it_or_named(made: Any) -> None:
    recipe, folder = made
    with pytest.raises(ValueError, match="--recipe FILE"):
        recipe_of_set(folder)
    note_origin(folder, recipe)
    try:
        assert recipe_of_set(folder).text == recipe.read_text()
    finally:
        (folder / ".origin").unlink()


@pytest.mark.parametrize("command", ["verify", "repair", "resume"])
def test_a_folder_without_a_set_is_named(command: str, tmp_path: Path) -> None:
    code, said = rfgen(command, tmp_path)
    assert code != 0
    assert str(tmp_path) in said


def test_a_recipe_is_checked_before_the_build(tmp_path: Path) -> None:
    (tmp_path / "bad.toml").write_text('count = 3\nprompts = ["a person waves"]\nradars = "awr1843"\n')
    code, said = rfgen("build", tmp_path / "bad.toml", tmp_path / "set")
    assert code != 0
    assert "radars" in said
    assert not (tmp_path / "set").exists()
