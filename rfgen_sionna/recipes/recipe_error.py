"""The error of a recipe."""

from __future__ import annotations


class RecipeError(ValueError):
    """A recipe that cannot be made: the message names the key, its value and what is allowed."""
