"""Forms of a value in a recipe: one value, a choice, a choice with weights, a range, or a grid.

In TOML: `3.0`, `[2.0, 3.0]`, `{choice = [2.0, 3.0], weights = [1, 3]}`, `{range = [2.0, 4.0]}` (uniform), and
`{grid = [2.0, 3.0]}` (all grids of a recipe form a product, which is gone through in order).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Generic, Literal, TypeVar

import numpy as np
from annotated_types import Len
from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Discriminator, Field, Tag, model_validator

from rfgen_sionna.recipes.stratified_draws import StratifiedDraws, chosen

T = TypeVar("T")

MAX_VALUES = 10_000
"""Most values in a choice or grid."""


@dataclass(frozen=True)
class ValueForm(Generic[T]):
    """A value to be drawn for each recording."""

    kind: Literal["scalar", "choice", "range", "grid"]
    """How it is drawn."""
    values: tuple[T, ...]
    """All values; of a range the two ends."""
    weights: tuple[float, ...] = ()
    """Weights of a choice, of sum 1; empty for equal ones."""

    @property
    def is_grid(self) -> bool:
        """Whether the value goes through a grid."""
        return self.kind == "grid"

    @property
    def is_fixed(self) -> bool:
        """Whether there is one value only."""
        return len(self.values) == 1

    def draw(self, draws: StratifiedDraws, key: str, cell: int = 0) -> T:
        """The value of a key; `cell` is the index in a grid."""
        if self.kind == "range":
            low, high = (np.asarray(value, np.float64) for value in self.values)
            numbers = [draws.loose(f"{key} {axis}") for axis in range(low.size)]
            return np.minimum(low + (high - low) * np.reshape(numbers, low.shape), high).tolist()
        if self.is_fixed:
            return self.values[0]
        return self.values[cell if self.is_grid else chosen(draws.even(key), self.chances)[0]]

    @property
    def chances(self) -> tuple[float, ...]:
        """Chance of each value of a scalar, choice or grid."""
        return self.weights or (1.0 / len(self.values),) * len(self.values)


class FormTable(BaseModel):
    """Base of the tables of forms."""

    model_config = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False)


class ChoiceForm(FormTable, Generic[T]):
    """A table of a choice."""

    choice: Annotated[list[T], Len(1, MAX_VALUES)]
    weights: list[Annotated[float, Field(ge=0.0)]] | None = None

    @model_validator(mode="after")
    def _of_one_length(self) -> ChoiceForm[T]:
        if self.weights is not None:
            if len(self.weights) != len(self.choice):
                raise ValueError(f"weights are {len(self.weights)}, values {len(self.choice)}: one for each is needed")
            if not 0.0 < sum(self.weights) < np.inf:
                raise ValueError("weights are all 0 or too large: a positive one is needed")
        return self


class RangeForm(FormTable, Generic[T]):
    """A table of a range."""

    range: Annotated[list[T], Len(2, 2)]

    @model_validator(mode="after")
    def _ascends(self) -> RangeForm[T]:
        low, high = np.asarray(self.range[0]), np.asarray(self.range[1])
        if not (low <= high).all():
            raise ValueError(f"range is {self.range}: the low end first, then the high end is needed")
        return self


class GridForm(FormTable, Generic[T]):
    """A table of a grid."""

    grid: Annotated[list[T], Len(1, MAX_VALUES)]


TAGS = ("scalar", "choice", "range", "grid")
"""Names of the forms, which are no keys of a recipe."""


def _listed(value: Any) -> Any:
    return {"choice": value} if isinstance(value, list) else value


def _listed_points(value: Any) -> Any:
    return {"choice": value} if isinstance(value, list) and any(isinstance(each, list) for each in value) else value


def _form_of(value: Any) -> str:
    if isinstance(value, (ChoiceForm, RangeForm, GridForm)):
        return next(name for name in TAGS[1:] if name in type(value).model_fields)
    if isinstance(value, Mapping):
        return next((name for name in TAGS[1:] if name in value), "scalar")
    return "scalar"


def _as_form(value: Any) -> ValueForm[Any]:
    if isinstance(value, ChoiceForm):
        total = sum(value.weights or ())
        return ValueForm("choice", tuple(value.choice), tuple(each / total for each in value.weights or ()))
    if isinstance(value, RangeForm):
        return ValueForm("range", tuple(value.range))
    if isinstance(value, GridForm):
        return ValueForm("grid", tuple(value.grid))
    return ValueForm("scalar", (value,))


def form_type(item: Any, *, ranges: bool = False, points: bool = False) -> Any:
    """Type of a pydantic field whose values are of type `item`, checked and read as a :class:`ValueForm`.

    Args:
        item: type of a value.
        ranges: whether there are ranges of it.
        points: whether a value is itself a list, so that only a list of lists is a choice.
    """
    forms: Any = Annotated[item, Tag("scalar")] | Annotated[ChoiceForm[item], Tag("choice")]
    forms |= Annotated[GridForm[item], Tag("grid")]
    if ranges:
        forms |= Annotated[RangeForm[item], Tag("range")]
    allowed = "a value, a list, {choice = [...], weights = [...]}, {grid = [...]}" + (
        " or {range = [low, high]}" if ranges else ""
    )
    chosen = Discriminator(_form_of, custom_error_type="value_form", custom_error_message=f"{allowed} is needed")
    return Annotated[
        forms, Field(discriminator=chosen), BeforeValidator(_listed_points if points else _listed),
        AfterValidator(_as_form),
    ]  # fmt: skip
