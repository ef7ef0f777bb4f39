"""Checks of the numbers of a receiver's configuration."""

from __future__ import annotations

from typing import Any

import numpy as np

from rfgen_sionna._types import FloatArray
from rfgen_sionna.radar.profile import is_number


def check_number(label: str, value: Any, low: float, high: float, unit: str) -> None:
    """Raise a ValueError unless `value` is a finite number in `low` … `high`."""
    if not (is_number(value) and low <= value <= high):
        raise ValueError(f"{label} is {value!r}: a value in {low:g} … {high:g}{unit and ' '}{unit} is needed")


def check_numbers(label: str, values: Any, low: float, high: float, unit: str) -> tuple[float, ...]:
    """`values` as a tuple of checked floats."""
    if isinstance(values, str) or not np.iterable(values):
        raise ValueError(f"{label} is {values!r}: a list of values in {low:g} … {high:g} {unit} is needed")
    for index, value in enumerate(values):
        check_number(f"{label}[{index}]", value, low, high, unit)
    return tuple(float(value) for value in values)


def number_or_numbers(label: str, value: Any, low: float, high: float, unit: str) -> float | tuple[float, ...]:
    """Checked number for all elements, or numbers for each."""
    if np.iterable(value) and not isinstance(value, str):
        return check_numbers(label, value, low, high, unit)
    check_number(label, value, low, high, unit)
    return float(value)


def per_element(label: str, value: float | tuple[float, ...], names: tuple[str, ...]) -> FloatArray:
    """(element,) from one number for all elements or one for each; another number of values is a ValueError."""
    values = np.asarray(value, dtype=np.float64)
    if values.ndim and len(values) != len(names):
        raise ValueError(f"{label} has {len(values)} values: one, or one for each of {', '.join(names)}, is needed")
    return np.broadcast_to(values, (len(names),))
