"""Examination of RF LoRA: how far it brings a base to a place that this base has never seen."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from rfgen_sionna.generative.environment.adapters import WEIGHT_NAME
from rfgen_sionna.generative.environment.classifier import ImageClassifier
from rfgen_sionna.generative.environment.image_models import load_embedded
from rfgen_sionna.generative.environment.image_sampling import ImageSampler
from training.environment.image_evaluation import drawn_like
from training.environment.image_metrics import correctly_named, frechet
from training.environment.lora_bases import EmbeddedBase
from training.environment.lora_training import LoraRecipe, choose_rate
from training.environment.pir_data import PirData
from training.environment.view_corpus import read_corpus

RATES = (1e-4, 2e-3, 5e-3)
"""The paper's, and what small networks need."""
_LEARNT_FROM = 800


def examine_lora(
    base: Path,
    views: PirData,
    place: str,
    classifier: ImageClassifier,
    out: Path,
    *,
    sampler: ImageSampler,
    rates: Sequence[float] = RATES,
    items: int = 16,
    steps: int = LoraRecipe.steps,
    rank: int = LoraRecipe.rank,
    convolutions: bool = False,
    most: int = 48,
    half: bool = False,
    seed: int = 0,
) -> dict[str, Any]:
    """Fréchet distances to held-out renders of a place: of the base, with each rate's LoRA, of other real renders.

    Images are drawn from words alone: a sketch would tell the base what it has not seen.

    Args:
        base: a model that hasn't seen the place.
        views: the data set.
        place: the place.
        judge: trained on training renders.
        out: folder for checkpoints.
        sampler: how to draw.
        rates: learning rates; which is kept is decided on the validation split.
        items, steps, rank, convolutions: of the training.
        most: views that are drawn at most; of the renders all count.
        half: draw in half precision.
        seed: of everything.
    """
    model = load_embedded(base, None, "cpu")
    learn, check, test = (
        read_corpus(views.select(split=name, place=place), model.codec) for name in ("train", "validation", "test")
    )
    recipe = LoraRecipe(_LEARNT_FROM, steps, items, rank, convolutions, seed=seed)
    some = np.random.default_rng([seed, 37]).permutation(len(test))[:most]
    real = classifier.classify(test.images, test.views)[0]
    other = classifier.classify(check.images, check.views)[0]
    noise_seed = seed + 1

    def distance(lora: Path | None) -> tuple[float, float]:
        drawn = drawn_like(
            load_embedded(base, lora, "cpu", half=half), test, some, sampler, noise_seed, use_layout_map=False
        )
        features, probabilities = classifier.classify(drawn, [test.views[i] for i in some])
        return frechet(features, real), float(correctly_named(probabilities, test.places[some]).mean())

    before = distance(None)
    report: dict[str, Any] = {
        "place": place,
        "views of the test split": len(test),
        "frames": min(_LEARNT_FROM, len(learn)),
        "steps": recipe.steps,
        "rank": rank,
        "convolutions": convolutions,
        "views drawn": len(some),
        "frechet, base": before[0],
        "recognised, base": before[1],
        "frechet, real validation against real test": frechet(other, real),
        "rates": {},
    }
    for rate in rates:
        folder = out / f"{rate:g}"
        outcome = choose_rate(lambda: EmbeddedBase(base, "cpu"), learn, check, folder, recipe, [rate])
        after = distance(folder / WEIGHT_NAME)
        report["share of the parameters"] = outcome.share
        report["rates"][f"{rate:g}"] = {
            "validation loss": outcome.losses[rate],
            "validation loss of the base": outcome.before,
            "frechet": after[0],
            "recognised": after[1],
            "fall": 1.0 - after[0] / before[0],
        }
    chosen = min(report["rates"], key=lambda rate: report["rates"][rate]["validation loss"])
    report["chosen on validation"] = chosen
    return report
