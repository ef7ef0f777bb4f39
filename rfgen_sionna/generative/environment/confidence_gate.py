"""Confidence gate: share of path diffusion's gains that is applied, so that complete images stay unchanged.

A classifier separates images of a fast trace (smooth surfaces of one material, no further bounces) from complete ones.
Its mean probability over the frames of a sequence, times a factor fitted on validation pairs, scales the gains. It
judges surfaces, not objects: an image that lacks a table counts as complete.
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
"""Classes of the classifier."""
WIDTHS = (16, 24, 48, 64)
"""Channels of the classifier's four stages; a small one suffices."""
_SHARES = np.linspace(0.0, 1.0, 51)
"""Candidate factors of the fit."""
_LEFT_ALONE = 0.93
"""Largest mean change of complete images [dB]; keeps unseen ones below 1 dB."""


@dataclass(frozen=True)
class ConfidenceGate:
    """Share of the gains that is applied."""

    share: float = 1.0
    """Share for an image that is certainly incomplete."""
    classifier: ImageClassifier | None = None
    """Classifier of incomplete images; None counts all as incomplete."""

    def __call__(self, images: NDArray[np.floating], views: Sequence[ViewFacts]) -> float:
        """Share, 0 … 1, of gains for all frames (frame, 3, row, column) of one view, in the codec's channels."""
        return self.share * float(self.probabilities(images, views).mean())

    def probabilities(self, images: NDArray[np.floating], views: Sequence[ViewFacts]) -> FloatArray:
        """(image,) probabilities that images (image, 3, row, column) are incomplete."""
        if self.classifier is None:
            return np.ones(len(images))
        return np.asarray(np.exp(self.classifier.classify(images, views)[1][:, INCOMPLETE]))

    def fitted(
        self, probabilities: FloatArray, changes: FloatArray, drawn: FloatArray, wanted: FloatArray
    ) -> ConfidenceGate:
        """Gate with the share of least error that leaves complete images nearly unchanged.

        Args:
            probabilities: (2, image) of complete and incomplete images.
            changes: (image,) mean magnitude of the gains on complete images [dB].
            drawn, wanted: (image, pixel) gains of incomplete images [dB]; NaN pixels are ignored.
        """
        sure = probabilities[INCOMPLETE][:, None] * drawn
        both = np.isfinite(sure) & np.isfinite(wanted)
        errors = [float(np.abs(wanted[both] - share * sure[both]).sum()) for share in _SHARES]
        share = float(_SHARES[int(np.argmin(errors))]) if both.any() else 1.0
        change = float(np.mean(probabilities[COMPLETE] * changes))
        return ConfidenceGate(min(share, _LEFT_ALONE / max(change, 1e-9)), self.classifier)

    def tensors(self) -> dict[str, Tensor]:
        """State of the classifier, for a file."""
        return {} if self.classifier is None else dict(self.classifier.net.state_dict())

    @classmethod
    def of(cls, share: float, tensors: dict[str, Tensor]) -> ConfidenceGate:
        """Gate from the contents of a file."""
        if not tensors:
            return cls(share)
        classifier = untrained_classifier(2, widths=WIDTHS)
        classifier.net.load_state_dict(tensors)
        return cls(share, classifier)
