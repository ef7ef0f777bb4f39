"""CFAR along one axis of a map of logarithms, as TI's hardware accelerator and DSP library do it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rfgen_sionna._types import FloatArray

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


def noise_level(level: FloatArray, settings: CfarSettings, axis: int = -1) -> FloatArray:
    """Noise of each cell: the mean of the training cells of one or both sides, in the unit of `level`.

    Raises
    ------
    ValueError
        If guard and training cells of one side do not fit on the axis.
    """
    moved = np.moveaxis(np.asarray(level, np.float64), axis, -1)
    count, reach = moved.shape[-1], settings.guard + settings.train
    if 2 * reach >= count:
        raise ValueError(
            f"train {settings.train} and guard {settings.guard} span {2 * reach + 1} cells; the axis has {count}"
        )
    if settings.cyclic:
        moved = np.concatenate([moved[..., -reach:], moved, moved[..., :reach]], axis=-1)
    total = np.cumsum(np.concatenate([np.zeros_like(moved[..., :1]), moved], axis=-1), axis=-1)
    means = (total[..., settings.train :] - total[..., : -settings.train]) / settings.train
    if settings.cyclic:
        low, high = means[..., :count], means[..., reach + settings.guard + 1 :][..., :count]
    else:
        low, high = np.full(moved.shape, np.nan), np.full(moved.shape, np.nan)
        low[..., reach:] = means[..., : count - reach]
        high[..., : count - reach] = means[..., settings.guard + 1 :][..., : count - reach]
        low, high = np.where(np.isnan(low), high, low), np.where(np.isnan(high), low, high)
    if settings.mode == "ca":
        noise = (low + high) / 2
    else:
        noise = np.maximum(low, high) if settings.mode == "cago" else np.minimum(low, high)
    return np.asarray(np.moveaxis(noise, -1, axis))
