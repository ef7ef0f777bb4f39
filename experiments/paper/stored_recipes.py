"""Recipes of the folder `recipes`, in full or with fewer recordings."""

from __future__ import annotations

import re
from pathlib import Path

from rfgen_sionna.recipes import Recipe

RECIPES = Path(__file__).parent / "recipes"
"""Folder of the recipes, and of the radars and receivers that they name."""


def stored_recipe(name: str, count: int | None = None, duration_s: float | None = None) -> Recipe:
    """The recipe `recipes/NAME.toml`, with another number of recordings or another length where they are given.

    Raises
    ------
    RecipeError
        If there is no such recipe.
    ValueError
        If it has no line of its own with the key that is changed.
    """
    if count is None and duration_s is None:
        return Recipe.load(RECIPES / f"{name}.toml")
    text = (RECIPES / f"{name}.toml").read_text(encoding="utf-8")
    for key, value in (("count", count), ("duration_s", duration_s)):
        if value is not None:
            text, found = re.subn(rf"^{key} = .*$", f"{key} = {value}", text, flags=re.MULTILINE)
            if found != 1:
                raise ValueError(f"recipe '{name}' has {found} lines '{key} = …': one is needed")
    return Recipe.parse(text, RECIPES)
