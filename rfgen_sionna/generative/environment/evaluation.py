"""Examinations of the image models on held-out views: surroundings, RF LoRA, path diffusion."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna.generative.diffusion.metrics import frechet
from rfgen_sionna.generative.environment.corpus import Corpus
from rfgen_sionna.generative.environment.judge import Judge
from rfgen_sionna.generative.environment.metrics import (
    Physical,
    floor_share,
    law_distance,
    nearest,
    range_distance,
    smooth_share,
)
from rfgen_sionna.generative.environment.model import EnvironmentModel, make_scheduler
from rfgen_sionna.generative.environment.sampling import Sampler, draw, noise_like
from rfgen_sionna.pir.codec import PirCodec
from rfgen_sionna.records import FloatArray

Note = Callable[[int, int], None]
_BATCH = 24


@dataclass(frozen=True)
class Halves:
    """Held-out views in two halves of as many layouts and views: conditions are taken from one, the other judges."""

    first: NDArray[np.intp]
    second: NDArray[np.intp]


def halves(corpus: Corpus, layouts: NDArray[np.integer], each: int, seed: int) -> Halves:
    """Up to `each` views a place in either half; a layout's views are all in one half."""
    rng = np.random.default_rng([seed, 71])
    out: tuple[list[int], list[int]] = ([], [])
    for place in np.unique(corpus.places):
        here = np.flatnonzero(corpus.places == place)
        rooms = rng.permutation(np.unique(layouts[here]))
        first = np.isin(layouts[here], rooms[: len(rooms) // 2])
        parts = rng.permutation(here[first]), rng.permutation(here[~first])
        count = min(each, len(parts[0]), len(parts[1]))
        for half, part in zip(out, parts, strict=True):
            half.extend(part[:count].tolist())
    return Halves(np.array(out[0], dtype=np.intp), np.array(out[1], dtype=np.intp))


def drawn_like(
    model: EnvironmentModel,
    corpus: Corpus,
    index: NDArray[np.intp],
    sampler: Sampler,
    seed: int,
    note: Note | None = None,
) -> FloatArray:
    """(view, 3, row, column) images drawn for the captions and views of `index`."""
    out = []
    noise = noise_like(len(index), model, seed)
    for start in range(0, len(index), _BATCH):
        some = index[start : start + _BATCH].tolist()
        views = [corpus.views[i] for i in some]
        tokens = model.text.embed([corpus.captions[i] for i in some], views)
        against = model.text.embed([""] * len(some), views)
        out.append(
            draw(model, make_scheduler(), sampler, tokens, against, noise[start : start + len(some)]).astype(np.float32)
        )
        out[-1] = model.polish(out[-1]).astype(np.float32)
        if note is not None:
            note(min(start + _BATCH, len(index)), len(index))
    return np.concatenate(out).astype(np.float64)


def compare(
    images: NDArray[np.floating], real: NDArray[np.floating], judge: Judge, codec: PirCodec
) -> dict[str, float]:
    """Distances of two sets of images of as many views of each place."""
    a, b = Physical.of(images, codec), Physical.of(real, codec)
    return {
        "frechet": frechet(judge.look(images)[0], judge.look(real)[0]),
        "range wasserstein, up to 10 m [m]": range_distance(a, b),
        "range wasserstein, all [m]": range_distance(a, b, np.inf),
        "energy-range law, 1 to 8.5 m [dB]": law_distance(a, b),
        "smooth pixels": smooth_share(a),
        "nothing returns": float(np.isnan(a.range).mean()),
    }


def examine(
    model: EnvironmentModel,
    test: Corpus,
    layouts: NDArray[np.integer],
    bank: NDArray[np.floating],
    judge: Judge,
    *,
    sampler: Sampler,
    each: int,
    seed: int,
    note: Note | None = None,
) -> tuple[dict[str, Any], FloatArray, Halves]:
    """One seed's figures of the model, and the same of real views.

    Images are drawn for the captions and views of one half of the held-out views and compared with the other half,
    which the first half's renders are compared with as well: that is the floor.

    Args:
        model: the model.
        test: held-out views.
        layouts: (view,) their rooms.
        bank: training images, of which none may be copied.
        judge: trained on training renders only.
        sampler: how to draw.
        each: views of each place in a half.
        seed: of the halves and the noise.
        note: called with (drawn, to be drawn).

    Returns:
        the figures, the images, and which views they were drawn for.
    """
    split = halves(test, layouts, each, seed)
    images = drawn_like(model, test, split.first, sampler, seed, note)
    real_a, real_b = (test.images[part].astype(np.float64) for part in (split.first, split.second))
    drawn, floor = (compare(x, real_b, judge, model.codec) for x in (images, real_a))
    named = judge.look(images)[1] == test.places[split.first]
    facts = [test.views[i] for i in split.first]
    shape = [np.array(x) for x in zip(*((v.height, v.pitch, v.fov_deg) for v in facts), strict=True)]
    result = {
        "views": len(split.first),
        "recognised": float(named.mean()),
        "recognised, by place": {
            test.names[p]: float(named[test.places[split.first] == p].mean()) for p in np.unique(test.places)
        },
        "recognised, real": float((judge.look(real_a)[1] == test.places[split.first]).mean()),
        "drawn": drawn,
        "real": floor,
        "frechet over floor": drawn["frechet"] / floor["frechet"],
        "smooth pixels, real of the other half": smooth_share(Physical.of(real_b, model.codec)),
        "floor where geometry puts it": floor_share(Physical.of(images, model.codec), shape[0], shape[1], shape[2]),
        "floor where geometry puts it, real": floor_share(
            Physical.of(real_a, model.codec), shape[0], shape[1], shape[2]
        ),
        "distance to the nearest training image": float(np.median(nearest(images, bank))),
        "distance to the nearest training image, least": float(np.min(nearest(images, bank))),
        "distance to the nearest training image, real": float(np.median(nearest(real_a, bank))),
    }
    return result, images, split
