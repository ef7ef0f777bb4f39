"""Examination of several views of one environment: whether what they share stands in the same place."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.stats import wasserstein_distance

from rfgen_sionna._types import SPEED_OF_LIGHT, FloatArray
from rfgen_sionna.generative.environment.environment_diffusion import EnvironmentDiffusion
from rfgen_sionna.generative.environment.reprojection import known_from_views
from rfgen_sionna.pir.view import View
from rfgen_sionna.records import Pir
from training.environment.view_corpus import ViewCorpus

TURNED, ASIDE = 0.35, 0.3
"""What the second view is turned by [rad] and moved to the left by [m]."""


def examine_views(rooms: EnvironmentDiffusion, test: ViewCorpus, *, count: int, seed: int) -> dict[str, Any]:
    """Differences between two views of an environment, and between views of two environments of the same words.

    Args:
        rooms: the model; what it keeps of other environments isn't touched.
        test: views whose captions and viewpoints are taken.
        count: how many.
        seed: of the choice and the drawing.
    """
    rng = np.random.default_rng([seed, 97])
    rows = []
    for i in rng.permutation(len(test))[:count].tolist():
        facts, words = test.views[i], test.captions[i]
        first_place = {
            "fov_deg": facts.fov_deg,
            "position": (0.0, 0.0, facts.height),
            "orientation": (facts.yaw, facts.pitch, 0.0),
        }
        left = facts.yaw + np.pi / 2
        second_place = {
            "fov_deg": facts.fov_deg,
            "position": (float(ASIDE * np.cos(left)), float(ASIDE * np.sin(left)), facts.height),
            "orientation": (facts.yaw + TURNED, facts.pitch, 0.0),
        }
        first = rooms.generate(words, seed=seed + 1000 + i, **first_place)
        second = rooms.generate(words, seed=seed + 1000 + i, **second_place)
        other = rooms.generate(words, seed=seed + 900_000 + i, **second_place)
        known = known_from_views([first], View.of(second))
        if known is None:
            continue
        there = _range(known.pir)
        seen = np.kron(known.patches, np.ones((4, 4))) > 0
        differences = [_median(np.abs(_range(pir) - there)[seen]) for pir in (second, other)]
        spreads = [_distance(first, pir) for pir in (second, other)]
        rows.append([*differences, *spreads, float(seen.mean())])
    table = np.array(rows)
    names = (
        "range difference where both see [m]",
        "the same, of another environment [m]",
        "range wasserstein between the two views [m]",
        "the same, to a view of another environment [m]",
        "share of the second view that the first has shown",
    )
    return {"environments": len(table), **{n: float(v) for n, v in zip(names, table.mean(axis=0), strict=True)}}


def _range(pir: Pir) -> FloatArray:
    return np.asarray(0.5 * SPEED_OF_LIGHT * pir.time_of_arrival)


def _median(values: FloatArray) -> float:
    return float(np.median(values[np.isfinite(values)])) if np.isfinite(values).any() else 0.0


def _distance(a: Pir, b: Pir) -> float:
    x, y = (r[np.isfinite(r)] for r in (_range(a), _range(b)))
    return float(wasserstein_distance(x, y)) if len(x) and len(y) else 0.0
