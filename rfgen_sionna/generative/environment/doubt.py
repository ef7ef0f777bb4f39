"""How far drawn gains are believed: an image that lacks nothing should stay as it is.

What a path diffusion model draws scatters about any image, complete ones too. A judge learns from the pairs that the
model learns from to tell what a hurried tracer renders, smooth surfaces of one material without further bounces, from
what there is. It knows the surfaces, not the things: an image with the right materials that lacks a table looks
complete to it. Its word, the mean over the frames of a sequence, and a common factor that is fitted on validation pairs
decide how much of the gains is applied; both travel with the ControlNet.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.environment.judge import Judge, untrained
from rfgen_sionna.generative.environment.text import ViewFacts

if TYPE_CHECKING:
    from torch import Tensor


COMPLETE, INCOMPLETE = 0, 1
"""The judge's classes."""
WIDTHS = (16, 24, 48, 64)
"""A small judge will do: it tells 97 of 100 validation images."""
_SHARES = np.linspace(0.0, 1.0, 51)
_LEFT_ALONE = 0.93
"""By how much complete images may change in the mean [dB]: less than 1 dB is wanted of those that nobody has seen."""


@dataclass(frozen=True)
class Doubt:
    """The share of drawn gains that is applied."""

    share: float = 1.0
    """Of the gains on an image that is surely incomplete."""
    judge: Judge | None = None
    """Tells incomplete images from complete ones; None believes that all are incomplete."""

    def __call__(self, images: NDArray[np.floating], views: Sequence[ViewFacts]) -> float:
        """The share, 0 … 1, of gains that is applied to all frames (frame, 3, row, column) of one view, channels of the
        codec, with how each is seen."""
        return self.share * float(self.chances(images, views).mean())

    def chances(self, images: NDArray[np.floating], views: Sequence[ViewFacts]) -> FloatArray:
        """(image,) chances that images (image, 3, row, column) lack something."""
        if self.judge is None:
            return np.ones(len(images))
        return np.asarray(np.exp(self.judge.look(images, views)[1][:, INCOMPLETE]))

    def fitted(self, chances: FloatArray, changes: FloatArray, drawn: FloatArray, wanted: FloatArray) -> Doubt:
        """With the share that errs least, and leaves complete images alone.

        Args:
            chances: (2, image) that complete and incomplete images lack something.
            changes: (image,) mean size of the gains that are drawn for complete images [dB].
            drawn, wanted: (image, pixel) gains of the incomplete ones [dB]; NaN where a pixel doesn't count.
        """
        sure = chances[INCOMPLETE][:, None] * drawn
        both = np.isfinite(sure) & np.isfinite(wanted)
        errors = [float(np.abs(wanted[both] - share * sure[both]).sum()) for share in _SHARES]
        share = float(_SHARES[int(np.argmin(errors))]) if both.any() else 1.0
        change = float(np.mean(chances[COMPLETE] * changes))
        return Doubt(min(share, _LEFT_ALONE / max(change, 1e-9)), self.judge)

    def tensors(self) -> dict[str, Tensor]:
        """The judge's, for a file."""
        return {} if self.judge is None else dict(self.judge.net.state_dict())

    @classmethod
    def of(cls, share: float, tensors: dict[str, Tensor]) -> Doubt:
        """What a file tells."""
        if not tensors:
            return cls(share)
        judge = untrained(2, widths=WIDTHS)
        judge.net.load_state_dict(tensors)
        return cls(share, judge)
