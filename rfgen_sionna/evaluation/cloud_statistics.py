"""Statistics of point clouds against a reference: number of points, levels, Doppler histogram.

Distances of distributions are Wasserstein's of order 1, in the unit of the quantity; histograms differ by the total
variation, half the sum of the absolute differences. Source: C. Villani, "Optimal Transport" (2009), chapter 6.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.stats import wasserstein_distance

from rfgen_sionna._types import FloatArray
from rfgen_sionna.evaluation.controlled_metric import ControlledMetric, with_controls


@dataclass(frozen=True)
class CloudStatistics:
    """What a set of clouds has, whatever the positions."""

    counts: FloatArray
    """(frame,) number of points."""
    level_db: FloatArray
    """(point,) level or signal-to-noise ratio [dB]."""
    doppler_bin: FloatArray
    """(point,) signed Doppler bin."""


def compare_statistics(
    reference: CloudStatistics, candidate: CloudStatistics, controls: Mapping[str, CloudStatistics]
) -> dict[str, ControlledMetric]:
    """ "counts" [points], "levels" [dB], "doppler" (0 … 1): 0 is equal.

    Raises
    ------
    ValueError
        For clouds without frames or points.
    """
    others = {f"control {name!r}": clouds for name, clouds in controls.items()}
    for name, clouds in {"reference": reference, "candidate": candidate, **others}.items():
        if not len(clouds.counts) or not len(clouds.level_db) or len(clouds.level_db) != len(clouds.doppler_bin):
            raise ValueError(
                f"{name} has {len(clouds.counts)} frames, {len(clouds.level_db)} levels and "
                f"{len(clouds.doppler_bin)} Doppler bins: frames, and as many levels as bins, are needed"
            )
    return {
        "counts": with_controls(
            "counts", lambda a, b: float(wasserstein_distance(a.counts, b.counts)), reference, candidate, controls,
            unit="points",
        ),
        "levels": with_controls(
            "levels", lambda a, b: float(wasserstein_distance(a.level_db, b.level_db)), reference, candidate, controls,
            unit="dB",
        ),
        "doppler": with_controls(
            "doppler", lambda a, b: total_variation(a.doppler_bin, b.doppler_bin), reference, candidate, controls
        ),
    }  # fmt: skip


def total_variation(first: ArrayLike, second: ArrayLike) -> float:
    """Total variation of the histograms of two sets of whole numbers: 0 for equal shares, 1 without a common value."""
    a, b = np.asarray(first), np.asarray(second)
    values = np.unique(np.concatenate([a, b]))
    shares = [np.searchsorted(np.sort(x), values, side="right") for x in (a, b)]
    parts = [np.diff(np.concatenate([[0], share])) / share[-1] for share in shares]
    return float(0.5 * np.abs(parts[0] - parts[1]).sum())
