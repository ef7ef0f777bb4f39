"""What the network misses, put back by linear regression on what the noisy motion shows.

A network of this size, trained for an hour, guesses the mean of what is possible and leaves out what is small: how a
held arm slants, how one sways while standing. For each action and noise level its errors on training motion are
regressed on the difference between the noisy motion and its guess, along the errors' principal directions and frequency
by frequency, as in Wiener's filter. When sampling, the part of that difference which on training motion was error is
added to the guess. As the noise falls, what the network misses comes in from the noise itself, as large and as slow as
it is in real motion; of a network that missed nothing, the regression would be zero.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from scipy.fft import dct
from torch import Tensor

from rfgen_sionna._types import FloatArray

DIRECTIONS = 40
"""Principal directions that are kept."""
BANDS = 48
"""Frequencies from 0 to half the frame rate."""


@dataclass(frozen=True)
class Residual:
    """The regression of one action."""

    directions: FloatArray
    """(DIRECTIONS, NUM_FEATURES) orthonormal rows, of normalised features."""
    levels: FloatArray
    """(level,) ln of signal over noise power, ascending."""
    gains: FloatArray
    """(level, BANDS, DIRECTIONS) error over difference."""


class Corrector:
    """Corrects the guesses of one batch.

    Args:
        residuals: one for each motion of the batch; None corrects nothing.
        frames: of the motions.
    """

    def __init__(self, residuals: Sequence[Residual | None], frames: int) -> None:
        known = [r for r in residuals if r is not None]
        self.which = [k for k, r in enumerate(residuals) if r is not None]
        self.cosines = torch.from_numpy(dct(np.eye(frames), type=2, norm="ortho", axis=0)).float()
        if known:
            places, at = np.linspace(0.0, 1.0, frames), np.linspace(0.0, 1.0, BANDS)
            self.levels = known[0].levels
            self.directions = torch.from_numpy(np.stack([r.directions for r in known])).float()
            wide = [[[np.interp(places, at, c) for c in gain.T] for gain in r.gains] for r in known]
            self.gains = torch.from_numpy(np.array(wide)).float().transpose(2, 3)

    def __call__(self, guess: Tensor, noisy: Tensor, share: float) -> Tensor:
        """(motion, frame, feature) the corrected guess; `share` is the signal's share of the noisy motion's power."""
        if not self.which:
            return guess
        level = np.log(share / (1.0 - share))
        place = float(np.interp(level, self.levels, np.arange(len(self.levels))))
        low = min(int(place), len(self.levels) - 2)
        gain = torch.lerp(self.gains[:, low], self.gains[:, low + 1], place - low)
        seen = (noisy[self.which] - share**0.5 * guess[self.which]) @ self.directions.transpose(1, 2)
        error = self.cosines.T @ (gain * (self.cosines @ seen))
        out = guess.clone()
        out[self.which] += error @ self.directions
        return out
