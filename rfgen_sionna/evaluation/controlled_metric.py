"""A figure of merit beside the same figure for controls: pairs that should not agree.

Images and clouds of radars resemble one another whatever they show: two unrelated recordings reach a structural
similarity of 0.93 on linear images. A figure says something only where it is better than that of another scene, of the
same scene shifted in time, or of another body; so every comparison of this package takes controls and returns them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

Item = TypeVar("Item")


@dataclass(frozen=True)
class ControlledMetric:
    """Value of a metric, with its controls."""

    name: str
    unit: str
    """Empty for a pure number."""
    value: float
    controls: Mapping[str, float]
    """The same metric of the reference against each control."""
    higher_is_better: bool

    @property
    def margin(self) -> float:
        """By how much the value is better than the best control, in its unit; negative where a control is better, and
        NaN without controls."""
        if not self.controls:
            return float("nan")
        sign = 1.0 if self.higher_is_better else -1.0
        return sign * self.value - max(sign * value for value in self.controls.values())

    def __str__(self) -> str:
        others = ", ".join(f"{name} {value:.4g}" for name, value in self.controls.items())
        unit = f" {self.unit}" if self.unit else ""
        return f"{self.name} {self.value:.4g}{unit}" + (f" (controls: {others})" if others else "")


def with_controls(
    name: str,
    metric: Callable[[Item, Item], float],
    reference: Item,
    candidate: Item,
    controls: Mapping[str, Item],
    *,
    unit: str = "",
    higher_is_better: bool = False,
) -> ControlledMetric:
    """`metric(reference, candidate)`, and the metric of the reference against every control."""
    return ControlledMetric(
        name,
        unit,
        float(metric(reference, candidate)),
        {other: float(metric(reference, item)) for other, item in controls.items()},
        higher_is_better,
    )


def shifted_in_time(values: ArrayLike, frames: int | None = None) -> NDArray[np.generic]:
    """Control of a series: the first axis rolled by `frames`, by default by a half of it.

    Raises
    ------
    ValueError
        If the shift is a multiple of the length, which would leave the series as it is.
    """
    array = np.asarray(values)
    count = len(array)
    frames = count // 2 if frames is None else frames
    if count < 2 or frames % count == 0:
        raise ValueError(f"frames is {frames} for a series of {count}: a shift of at least one frame of it is needed")
    return np.roll(array, frames, axis=0)
