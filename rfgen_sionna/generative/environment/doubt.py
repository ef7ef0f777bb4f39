"""How far drawn gains are believed: an image that lacks nothing should stay as it is.

What a path diffusion model draws scatters about any image. Where things are missing, or materials are not their own, it
asks for much, and in some places more than in others. A logistic regression on how much it asks for tells one from the
other; with a common factor, it is fitted on validation pairs and travels with the ControlNet.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.special import expit

from rfgen_sionna.records import FloatArray

_SHARES = np.linspace(0.0, 1.0, 51)
_LEFT_ALONE = 0.93
"""By how much complete images may change in the mean [dB]: less than 1 dB is wanted of those that nobody has seen."""
_PENALTY = 1.0
"""On squared weights of standardised features, for all images together."""


@dataclass(frozen=True)
class Doubt:
    """Turns drawn gains into the share of them that is applied."""

    share: float = 1.0
    """Of the gains on an image that is surely incomplete."""
    weights: tuple[float, ...] = ()
    """Of the logistic regression: its constant, and one for each of :func:`features`; empty believes all."""

    @classmethod
    def of(cls, facts: Mapping[str, Any]) -> Doubt:
        """What a ControlNet's file tells."""
        return cls(float(facts.get("share", 1.0)), tuple(float(w) for w in facts.get("doubt", ())))

    @property
    def facts(self) -> dict[str, Any]:
        """For a ControlNet's file."""
        return {"share": self.share, "doubt": list(self.weights)}

    def __call__(self, gains: Sequence[FloatArray], there: Sequence[NDArray[np.bool_]]) -> float:
        """The share, 0 … 1, of gains [dB] (row, column) that is applied to all frames of one view.

        Args:
            gains: of each frame.
            there: whether a pixel returned something before, of each frame.
        """
        if not self.weights:
            return self.share
        told = np.mean([features(gain, known) for gain, known in zip(gains, there, strict=True)], axis=0)
        return float(self.share * expit(self.weights[0] + told @ np.array(self.weights[1:])))

    @classmethod
    def fit(cls, incomplete: FloatArray, complete: FloatArray, drawn: FloatArray, wanted: FloatArray) -> Doubt:
        """From features (image, feature) of gains drawn for incomplete and complete images, and from `drawn` and
        `wanted` gains (image, pixel) [dB] of the incomplete ones; NaN where a pixel doesn't count."""
        x = np.concatenate([incomplete, complete])
        y = np.concatenate([np.ones(len(incomplete)), np.zeros(len(complete))])
        middle, spread = x.mean(axis=0), np.maximum(x.std(axis=0), 1e-9)
        table = np.column_stack([np.ones(len(x)), (x - middle) / spread])

        def loss(w: FloatArray) -> float:
            z = table @ w
            return float(np.sum(np.logaddexp(0.0, z) - y * z) + 0.5 * _PENALTY * np.sum(w[1:] ** 2))

        found = np.asarray(minimize(loss, np.zeros(table.shape[1]), method="BFGS").x)
        slopes = found[1:] / spread
        weights = (float(found[0] - slopes @ middle), *slopes.tolist())
        sure = expit(weights[0] + incomplete @ slopes)[:, None] * drawn
        both = np.isfinite(sure) & np.isfinite(wanted)
        errors = [float(np.abs(wanted[both] - share * sure[both]).mean()) for share in _SHARES]
        share = float(_SHARES[int(np.argmin(errors))])
        change = float(np.mean(expit(weights[0] + complete @ slopes) * complete[:, 0]))
        return cls(min(share, _LEFT_ALONE / max(change, 1e-9)), tuple(weights))


def features(gain: FloatArray, there: NDArray[np.bool_]) -> FloatArray:
    """(3,) of gains (row, column) [dB] where something returned: mean size, mean, and spread."""
    known = gain[there] if there.any() else np.zeros(1)
    return np.array([np.abs(known).mean(), known.mean(), known.std()])
