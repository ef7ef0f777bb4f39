"""What a surface returns when it is seen best, of one that goes behind another, or comes forth, within a stretch."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import ComplexArray, FloatArray
from rfgen_sionna.tracing.surface.facets import CANCELLED

MIN_INCREASE = 0.2
"""Share of what is seen of a surface half way by which more has to be seen of it at another instant for that to tell
what it returns: of bodies that shadow themselves one instant tells as much as another."""


def most_visible_times(shares: FloatArray, surface: NDArray[np.integer[Any]], half: int) -> list[int]:
    """The instants at which most is seen of those that much more is seen of than at the instant `half`, by the `shares`
    (facet, instant) that are seen of facets of each `surface` (facet,), large and small ones alike."""
    more = np.bincount(surface, shares.max(axis=1) - shares[:, half])
    fading = np.flatnonzero(more > MIN_INCREASE * np.bincount(surface, shares[:, half]))
    return sorted({int(shares[surface == number].sum(axis=0).argmax()) for number in fading.tolist()})


def best_visible_level(
    waves: Callable[[int], ComplexArray],
    shares: FloatArray,
    surface: NDArray[np.integer[Any]],
    half: int,
    level: FloatArray,
    cancellation: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """(surface,) `level` of each one's return and its `cancellation`
    (:attr:`rfgen_sionna.tracing.gains.error_estimate.Accuracy.cancellation`), or what they are at an instant at which
    much more is seen of it and it returns more.

    `waves` gives what facets (facet,) return at an instant, propagation and antennas included; the others are those of
    :func:`most_visible_times`. `level` is not below what comes back `half` way.
    """
    best, more = level, cancellation
    for k in [half, *most_visible_times(shares, surface, half)]:
        found = waves(k)
        single = found.real**2 + found.imag**2
        together = np.hypot(*(np.bincount(surface, part, len(level)) for part in (found.real, found.imag)))
        alone = np.sqrt(np.bincount(surface, single, len(level)))
        if k != half:
            strongest = np.zeros(len(level))
            np.maximum.at(strongest, surface, np.sqrt(single))
            least = np.maximum(together, CANCELLED * strongest)
            more = np.where(together > best, alone / np.where(least > 0, least, 1.0), more)
        best = np.maximum(best, together)
    return best, more
