"""What a recipe names, read: sources, places, radars and receivers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from rfgen_sionna._short_repr import ShortRepr
from rfgen_sionna.recipes.partitions import derived_seed
from rfgen_sionna.recipes.recipe_places import Place
from rfgen_sionna.recipes.recipe_sources import Source
from rfgen_sionna.recipes.recipe_tables import RecipeTables
from rfgen_sionna.recipes.set_radars import SetRadar
from rfgen_sionna.recipes.value_forms import ValueForm


@dataclass(frozen=True, eq=False, repr=False)
class RecipeContents(ShortRepr):
    """Contents of a recipe."""

    text: str
    """The TOML text."""
    tables: RecipeTables
    """Its tables, with defaults."""
    sources: tuple[Source, ...]
    """Alternatives of what moves."""
    places: tuple[Place, ...]
    """Alternatives of surroundings."""
    radars: tuple[SetRadar, ...]
    """Radars of every recording."""
    receivers: ValueForm[Mapping[str, Any] | None]
    """Impairments of the receivers; None is thermal noise and the radar's own ADC."""

    def layout_seed(self, place: str, number: int) -> int:
        """Seed of a layout of a pool."""
        return derived_seed(self.tables.seed, "layout", place, number)
