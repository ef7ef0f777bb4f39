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
from rfgen_sionna.generative.environment.classifier import ImageClassifier, untrained_classifier
from rfgen_sionna.generative.environment.place_encoder import ViewFacts

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
class ConfidenceGate:
    """The share of drawn gains that is applied."""

    share: float = 1.0
    """Of the gains on an image that is surely incomplete."""
    classifier: ImageClassifier | None = None
    """Tells incomplete images from complete ones; None believes that all are incomplete."""

    def __call__(self, images: NDArray[np.floating], views: Sequence[ViewFacts]) -> float:
        """The share, 0 … 1, of gains that is applied to all frames (frame, 3, row, column) of one view, channels of the
        codec, with how each is seen."""
        return self.share * float(self.probabilities(images, views).mean())

    def probabilities(self, images: NDArray[np.floating], views: Sequence[ViewFacts]) -> FloatArray:
        """(image,) chances that images (image, 3, row, column) lack something."""
        if self.classifier is None:
            return np.ones(len(images))
        return np.asarray(np.exp(self.classifier.classify(images, views)[1][:, INCOMPLETE]))

    def fitted(
        self, probabilities: FloatArray, changes: FloatArray, drawn: FloatArray, wanted: FloatArray
    ) -> ConfidenceGate:
        """With the share that errs least, and leaves complete images alone.

        Args:
            chances: (2, image) that complete and incomplete images lack something.
            changes: (image,) mean size of the gains that are drawn for complete images [dB].
            drawn, wanted: (image, pixel) gains of the incomplete ones [dB]; NaN where a pixel doesn't count.
        """
        sure = probabilities[INCOMPLETE][:, None] * drawn
        both = np.isfinite(sure) & np.isfinite(wanted)
        errors = [float(np.abs(wanted[both] - share * sure[both]).sum()) for share in _SHARES]
        share = float(_SHARES[int(np.argmin(errors))]) if both.any() else 1.0
        change = float(np.mean(probabilities[COMPLETE] * changes))
        return ConfidenceGate(min(share, _LEFT_ALONE / max(change, 1e-9)), self.classifier)

    def tensors(self) -> dict[str, Tensor]:
        """The judge's, for a file."""
        return {} if self.classifier is None else dict(self.classifier.net.state_dict())

    @classmethod
    def of(cls, share: float, tensors: dict[str, Tensor]) -> ConfidenceGate:
        """What a file tells."""
        if not tensors:
            return cls(share)
        classifier = untrained_classifier(2, widths=WIDTHS)
        classifier.net.load_state_dict(tensors)
        return cls(share, classifier)
