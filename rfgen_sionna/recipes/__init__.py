"""Recipes: data sets of many recordings, described once, checked whole, and made by any number of workers.

Names are imported at first use.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rfgen_sionna.recipes.planning import Plan, plan_dataset
    from rfgen_sionna.recipes.recipe import Recipe
    from rfgen_sionna.recipes.recipe_error import RecipeError
    from rfgen_sionna.recipes.recording_spec import BodySpec, RadarSpec, RecordingSpec, SourceSpec

_HOME = {
    "Plan": "planning", "plan_dataset": "planning",
    "BodySpec": "recording_spec",
    "RadarSpec": "recording_spec", "Recipe": "recipe", "RecipeError": "recipe_error", "RecordingSpec": "recording_spec",
    "SourceSpec": "recording_spec",
}  # fmt: skip

__all__ = ["BodySpec", "Plan", "RadarSpec", "Recipe", "RecipeError", "RecordingSpec", "SourceSpec", "plan_dataset"]


def __getattr__(name: str) -> Any:
    if name in _HOME:
        return getattr(import_module(f"{__name__}.{_HOME[name]}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
