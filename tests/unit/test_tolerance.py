"""The tolerance has the same bounds and defaults wherever it is asked for."""

from __future__ import annotations

from dataclasses import fields
from inspect import signature
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rfgen_sionna.cli.generate import generate as command
from rfgen_sionna.composition import TraceOptions
from rfgen_sionna.dataset import open_run
from rfgen_sionna.pipeline import generate
from rfgen_sionna.radar import Radar
from rfgen_sionna.recipes.making import make_recording
from rfgen_sionna.recipes.recipe import Recipe
from rfgen_sionna.recipes.recipe_error import RecipeError
from rfgen_sionna.recipes.recipe_tables import RecipeTables
from rfgen_sionna.recipes.recording_spec import RecordingSpec
from rfgen_sionna.simulation import Simulator
from rfgen_sionna.tolerance import DEFAULT_RTOL, MAX_RTOL, MIN_RTOL, SIMULATOR_RTOL, check_rtol
from rfgen_sionna.tracing.tracer import Tracer
from tests.unit.recipes.small_recipes import write_small_recipe


@pytest.mark.parametrize("value", [MIN_RTOL, MAX_RTOL, np.float32(0.1)])
def test_bounds_are_allowed(value: Any) -> None:
    assert check_rtol(value) == Simulator(None, Radar.load("awr1843"), rtol=value).rtol == value


def test_defaults() -> None:
    assert (MIN_RTOL, SIMULATOR_RTOL, DEFAULT_RTOL, MAX_RTOL) == (1e-8, 0.01, 0.1, 0.3)
    assert {signature(each).parameters["rtol"].default for each in (Simulator, Tracer)} == {SIMULATOR_RTOL}
    assert {signature(each).parameters["rtol"].default for each in (generate, command)} == {DEFAULT_RTOL}
    (of_recording,) = (each.default for each in fields(RecordingSpec) if each.name == "rtol")
    assert TraceOptions().rtol == RecipeTables().rtol == of_recording == DEFAULT_RTOL


@pytest.mark.parametrize("value", [0.31, 0.5, 9e-9])
def test_recipes_refuse_what_simulations_refuse(value: float) -> None:
    with pytest.raises(RecipeError, match=f"rtol is {value}: .* is needed"):
        Recipe.parse(f'prompts = ["a person waves"]\nrtol = {value}\n')
    with pytest.raises(ValueError, match=f"rtol is {value}: .* is needed"):
        Simulator(None, Radar.load("awr1843"), rtol=value)


def test_the_largest_tolerance_makes_recordings(tmp_path: Path) -> None:
    path = write_small_recipe(tmp_path)
    path.write_text(path.read_text(encoding="utf-8").replace("rtol = 0.05", f"rtol = {MAX_RTOL}"), encoding="utf-8")
    spec = next(iter(Recipe.load(path)))
    make_recording(spec, tmp_path / "run.h5")
    with open_run(tmp_path / "run.h5") as run:
        assert run.settings["rtol"] == MAX_RTOL
        assert np.abs(run.adc[:]).max() > 0
