"""CFAR along one axis of a map of logarithms, as TI's hardware accelerator and DSP library do it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from rfgen_sionna.processing.array_namespace import array_namespace

MODES = ("ca", "cago", "caso")
"""Mean of both sides, the greater of the two, the lesser."""


@dataclass(frozen=True)
class CfarSettings:
    """One command `cfarCfg`."""

    mode: str = "caso"
    """One of `MODES`."""
    train: int = 8
    """Training cells on each side."""
    guard: int = 4
    """Guard cells on each side."""
    threshold_db: float = 15.0
    """Level over the noise, per channel [dB]."""
    cyclic: bool = False
    """Whether the axis is periodic (Doppler); otherwise cells at an end use the other side alone."""

    def __post_init__(self) -> None:
        if self.mode not in MODES:
            raise ValueError(f"mode is {self.mode!r}; allowed: {', '.join(MODES)}")
        if self.train < 1 or self.guard < 0:
            raise ValueError(f"train is {self.train}, guard {self.guard}: train >= 1 and guard >= 0 are needed")


def noise_level(level: Any, settings: CfarSettings, axis: int = -1) -> Any:
    """Noise of each cell: the mean of the training cells of one or both sides, in the unit of `level`.

    Parameters
    ----------
    level
        Map of logarithms, an array or a tensor of any shape.
    axis
        Axis of the cells.

    Raises
    ------
    ValueError
        If guard and training cells of one side do not fit on the axis.
    """
    xp = array_namespace(level)
    moved = xp.moveaxis(level, axis, -1)
    count, reach = moved.shape[-1], settings.guard + settings.train
    if 2 * reach >= count:
        raise ValueError(
            f"train {settings.train} and guard {settings.guard} span {2 * reach + 1} cells; the axis has {count}"
        )
    if settings.cyclic:
        moved = xp.concatenate([moved[..., -reach:], moved, moved[..., :reach]], axis=-1)
    total = xp.cumsum(xp.concatenate([xp.zeros_like(moved[..., :1]), moved], axis=-1), axis=-1)
    means = (total[..., settings.train :] - total[..., : -settings.train]) / settings.train
    if settings.cyclic:
        low, high = means[..., :count], means[..., reach + settings.guard + 1 :][..., :count]
    else:
        below, above = means[..., : count - reach], means[..., settings.guard + 1 :]
        low = xp.concatenate([above[..., :reach], below], axis=-1)
        high = xp.concatenate([above, below[..., -reach:]], axis=-1)
    if settings.mode == "ca":
        noise = (low + high) / 2
    else:
        noise = xp.maximum(low, high) if settings.mode == "cago" else xp.minimum(low, high)
    return xp.moveaxis(noise, -1, axis)
