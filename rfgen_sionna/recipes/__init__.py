"""Recipes: data sets of many recordings, described once, checked whole, and made by any number of workers.

Names are imported at first use.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rfgen_sionna.recipes.augmentation import Variant, augment_dataset, variants_of
    from rfgen_sionna.recipes.building import BuildReport, build_dataset
    from rfgen_sionna.recipes.planning import DatasetPlan, plan_dataset
    from rfgen_sionna.recipes.recipe import Recipe
    from rfgen_sionna.recipes.recipe_error import RecipeError
    from rfgen_sionna.recipes.recording_spec import BodySpec, RadarSpec, RecordingSpec, SourceSpec
    from rfgen_sionna.recipes.repairing import repair_dataset, verify_dataset

_HOME = {
    "BodySpec": "recording_spec", "BuildReport": "building", "DatasetPlan": "planning", "RadarSpec": "recording_spec",
    "Recipe": "recipe", "RecipeError": "recipe_error", "RecordingSpec": "recording_spec",
    "SourceSpec": "recording_spec", "Variant": "augmentation", "augment_dataset": "augmentation",
    "build_dataset": "building", "plan_dataset": "planning",
    "repair_dataset": "repairing", "variants_of": "augmentation", "verify_dataset": "repairing",
}  # fmt: skip

__all__ = [
    "BodySpec", "BuildReport", "DatasetPlan", "RadarSpec", "Recipe", "RecipeError", "RecordingSpec", "SourceSpec",
    "Variant", "augment_dataset", "build_dataset", "plan_dataset", "repair_dataset",
    "variants_of", "verify_dataset",
]  # fmt: skip


def __getattr__(name: str) -> Any:
    if name in _HOME:
        return getattr(import_module(f"{__name__}.{_HOME[name]}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
