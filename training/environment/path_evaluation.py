"""Examination of path diffusion on held-out pairs, beside what a straight line and interpolation do."""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt

from rfgen_sionna._types import SPEED_OF_LIGHT, FloatArray
from rfgen_sionna.generative.environment.classifier import COMPLETE, INCOMPLETE, ConfidenceGate
from rfgen_sionna.generative.environment.path_diffusion import PathDiffusion
from rfgen_sionna.generative.environment.place_encoder import ViewFacts
from rfgen_sionna.pir.codec import PirCodec
from rfgen_sionna.records import Pir
from training.environment.view_corpus import ViewCorpus

_SHARES = np.linspace(0.0, 1.0, 51)
"""Candidate shares of the fit."""
_LEFT_ALONE = 0.93
"""Largest mean change of complete images [dB]; keeps unseen ones below 1 dB."""


@dataclass(frozen=True)
class AffineBaseline:
    """Levels through a straight line, and where nothing returns the nearest pixel's if that helps."""

    slope: float
    offset: float
    """[dB]"""
    fills: bool
    """Whether what returns nothing is filled: it is where that errs less on the training pairs."""

    @classmethod
    def fit(cls, pairs: ViewCorpus, codec: PirCodec) -> AffineBaseline:
        """Least squares over the pixels that return something in both images of training pairs.

        Skies return nothing in either: filling them would make the baseline weaker than it need be.
        """
        x, y = _levels(pairs, codec)
        known = np.isfinite(x) & np.isfinite(y)
        slope, offset = np.polyfit(x[known], y[known], 1)
        filled, plain = (cls(float(slope), float(offset), fills) for fills in (True, False))
        absent = codec.energy_db[0]
        errors = [[energy_error(line(a), b, absent) for a, b in zip(x, y, strict=True)] for line in (filled, plain)]
        return filled if np.mean(errors[0]) < np.mean(errors[1]) else plain

    def __call__(self, level: FloatArray) -> FloatArray:
        """(row, column) levels [dB] of a completed image."""
        seen = np.isfinite(level)
        if not self.fills or not seen.any():
            return np.asarray(self.slope * level + self.offset)
        nearest = tuple(distance_transform_edt(~seen, return_distances=False, return_indices=True))
        return np.asarray(self.slope * level[nearest] + self.offset)


def pir_of(channels: NDArray[np.floating], view: ViewFacts, codec: PirCodec) -> Pir:
    """One image of a corpus as a PIR."""
    like = Pir(
        np.zeros(channels.shape[1:]),
        np.zeros(channels.shape[1:]),
        np.zeros(channels.shape[1:]),
        view.fov_deg,
        (0.0, 0.0, view.height),
        (view.yaw, view.pitch, view.roll),
        view.projection,
    )
    return codec.decode(channels.astype(np.float64), like, clip=True)


def energy_error(level: FloatArray, truth: FloatArray, absent: float) -> float:
    """Mean difference [dB] without regard to sign over the pixels of which either returns something; nothing counts as
    `absent` [dB]."""
    either = np.isfinite(level) | np.isfinite(truth)
    a, b = (np.where(np.isfinite(x), x, absent) for x in (level, truth))
    return float(np.abs(a - b)[either].mean())


def examine_paths(
    refiner: PathDiffusion,
    test: ViewCorpus,
    train: ViewCorpus,
    *,
    strength: float,
    count: int,
    seed: int,
) -> dict[str, Any]:
    """Figures over `count` held-out pairs: errors of the incomplete image, of the baseline, of the refined image.

    Intervals are the 2.5 and 97.5 % quantiles of 2,000 bootstrap draws of the views.
    """
    codec = refiner.backend.model.codec
    baseline = AffineBaseline.fit(train, codec)
    rng = np.random.default_rng([seed, 83])
    absent = codec.energy_db[0]
    rows = []
    for i in rng.permutation(len(test))[:count].tolist():
        given = pir_of(test.lacking[i], test.views[i], codec)
        truth = pir_of(test.images[i], test.views[i], codec)
        refined = refiner.refine(given, test.captions[i], strength=strength, seed=seed)
        again = refiner.refine(truth, test.captions[i], strength=strength, seed=seed)
        level, goal, new = (_decibels(p) for p in (given, truth, refined))
        there = truth.energy > 0
        rows.append(
            (
                energy_error(level, goal, absent),
                energy_error(baseline(level), goal, absent),
                energy_error(new, goal, absent),
                _range_error(given, truth, there & (given.energy > 0)),
                _range_error(refined, truth, there & (given.energy > 0)),
                float(np.abs(_decibels(again) - goal)[there].mean()),
                _range_error(refined, truth, there & (given.energy <= 0) & (refined.energy > 0)),
                float(((given.energy <= 0) & (refined.energy > 0)).mean()),
            )
        )
    table = np.array(rows)
    given_error, base_error, own_error = table[:, 0], table[:, 1], table[:, 2]

    def fall(reference: FloatArray) -> dict[str, Any]:
        draws = rng.integers(len(table), size=(2000, len(table)))
        falls = 1.0 - own_error[draws].mean(axis=1) / reference[draws].mean(axis=1)
        low, high = np.quantile(falls, [0.025, 0.975])
        return {
            "fall": float(1.0 - own_error.mean() / reference.mean()),
            "interval": [float(low), float(high)],
        }

    return {
        "pairs": len(table),
        "strength": strength,
        "energy error of the incomplete image [dB]": float(given_error.mean()),
        "energy error of affine and interpolation [dB]": float(base_error.mean()),
        "energy error refined [dB]": float(own_error.mean()),
        "against the incomplete image": fall(given_error),
        "against affine and interpolation": fall(base_error),
        "range error of the incomplete image [m]": float(table[:, 3].mean()),
        "range error refined [m]": float(table[:, 4].mean()),
        "change of a complete image [dB]": float(table[:, 5].mean()),
        "range error of added energy [m]": float(np.nanmean(table[:, 6])) if np.isfinite(table[:, 6]).any() else None,
        "share of the pixels that are added": float(table[:, 7].mean()),
    }


def calibrated(refiner: PathDiffusion, pairs: ViewCorpus, *, count: int, seed: int) -> ConfidenceGate:
    """The doubt of `refiner` with the share that suits `count` validation pairs."""
    plain, gate = copy(refiner), refiner.confidence_gate
    plain.confidence_gate = ConfidenceGate()
    codec = refiner.backend.model.codec
    rng = np.random.default_rng([seed, 89])
    drawn, wanted, changes = [], [], []
    some = rng.permutation(len(pairs))[:count].tolist()
    for i in some:
        given = pir_of(pairs.lacking[i], pairs.views[i], codec)
        truth = pir_of(pairs.images[i], pairs.views[i], codec)
        gains = []
        for image in (given, truth):
            refined = plain.refine(image, pairs.captions[i], seed=seed)
            gains.append(_decibels(refined) - _decibels(image))
        changes.append(float(np.abs(gains[1][truth.energy > 0]).mean()))
        both = (given.energy > 0) & (truth.energy > 0)
        drawn.append(np.where(both, gains[0], np.nan).ravel())
        most = refiner.most_gain_db
        wanted.append(np.where(both, np.clip(_decibels(truth) - _decibels(given), -most, most), np.nan).ravel())
    views = [pairs.views[i] for i in some]
    probabilities = np.stack([gate.probabilities(images[some], views) for images in (pairs.images, pairs.lacking)])
    return fit_confidence_gate(gate, probabilities, np.array(changes), np.array(drawn), np.array(wanted))


def _levels(pairs: ViewCorpus, codec: PirCodec) -> tuple[FloatArray, FloatArray]:
    before, _, _ = codec.decode_arrays(pairs.lacking.astype(np.float64), clip=True)
    after, _, _ = codec.decode_arrays(pairs.images.astype(np.float64), clip=True)
    return tuple(10 * np.log10(np.where(e > 0, e, np.nan)) for e in (before, after))  # type: ignore[return-value]


def _decibels(pir: Pir) -> FloatArray:
    return np.asarray(10 * np.log10(np.where(pir.energy > 0, pir.energy, np.nan)))


def _range_error(pir: Pir, truth: Pir, there: NDArray[np.bool_]) -> float:
    """Mean difference of range [m] where both return something."""
    both = there & np.isfinite(pir.time_of_arrival) & np.isfinite(truth.time_of_arrival)
    if not both.any():
        return float("nan")
    return float(0.5 * SPEED_OF_LIGHT * np.abs(pir.time_of_arrival - truth.time_of_arrival)[both].mean())


def fit_confidence_gate(
    gate: ConfidenceGate, probabilities: FloatArray, changes: FloatArray, drawn: FloatArray, wanted: FloatArray
) -> ConfidenceGate:
    """Gate with the share of least error that leaves complete images nearly unchanged.

    Args:
        gate: gives the classifier.
        probabilities: (2, image) of complete and incomplete images.
        changes: (image,) mean magnitude of the gains on complete images [dB].
        drawn, wanted: (image, pixel) gains of incomplete images [dB]; NaN pixels are ignored.
    """
    sure = probabilities[INCOMPLETE][:, None] * drawn
    both = np.isfinite(sure) & np.isfinite(wanted)
    errors = [float(np.abs(wanted[both] - share * sure[both]).sum()) for share in _SHARES]
    share = float(_SHARES[int(np.argmin(errors))]) if both.any() else 1.0
    change = float(np.mean(probabilities[COMPLETE] * changes))
    return ConfidenceGate(min(share, _LEFT_ALONE / max(change, 1e-9)), gate.classifier)
