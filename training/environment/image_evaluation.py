"""Examinations of the image models on held-out views: surroundings, RF LoRA, path diffusion."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import FloatArray
from rfgen_sionna.generative.environment.classifier import ImageClassifier
from rfgen_sionna.generative.environment.environment_model import EnvironmentModel
from rfgen_sionna.generative.environment.image_generation import ImageRequest, generate_images
from rfgen_sionna.generative.environment.image_sampling import ImageSampler, noise_like
from rfgen_sionna.generative.environment.reprojection import NATIVE
from rfgen_sionna.generative.environment.room_selection import PlaceRequest
from rfgen_sionna.generative.environment.view_unet import make_scheduler
from rfgen_sionna.pir.codec import PirCodec
from training.environment.image_metrics import (
    Physical,
    correctly_named,
    floor_share,
    frechet,
    law_distance,
    nearest,
    range_distance,
    smooth_share,
)
from training.environment.view_corpus import ViewCorpus

Note = Callable[[int, int], None]
_BATCH = 24


@dataclass(frozen=True)
class Halves:
    """Held-out views in two halves of as many layouts and views: conditions are taken from one, the other judges."""

    first: NDArray[np.intp]
    second: NDArray[np.intp]


def halves(corpus: ViewCorpus, layouts: NDArray[np.integer], each: int, seed: int) -> Halves:
    """About `each` views a place in either half: whole layouts, with all of their views."""
    rng = np.random.default_rng([seed, 71])
    out: tuple[list[int], list[int]] = ([], [])
    for place in np.unique(corpus.places):
        here = np.flatnonzero(corpus.places == place)
        rooms, views = np.unique(layouts[here], return_counts=True)
        count = int(min(max(1, round(each / views.max())), len(rooms) // 2))
        rooms = rng.permutation(rooms)
        for half, part in zip(out, (rooms[:count], rooms[count : 2 * count]), strict=True):
            half.extend(here[np.isin(layouts[here], part)].tolist())
    return Halves(np.array(out[0], dtype=np.intp), np.array(out[1], dtype=np.intp))


def drawn_like(
    model: EnvironmentModel,
    corpus: ViewCorpus,
    index: NDArray[np.intp],
    sampler: ImageSampler,
    seed: int,
    note: Note | None = None,
    use_layout_map: bool = True,
) -> FloatArray:
    """(view, 3, row, column) images drawn for the captions and views of `index`."""
    out = []
    noise = noise_like(len(index), model, seed)
    for start in range(0, len(index), _BATCH):
        some = index[start : start + _BATCH].tolist()
        views = [corpus.views[i] for i in some]
        requests = [_request(model, corpus, i, seed) for i in some] if use_layout_map else None
        tokens = model.text.embed([corpus.captions[i] for i in some], views)
        against = model.text.embed([""] * len(some), views)
        part = noise[start : start + len(some)]
        drawn = generate_images(model, make_scheduler(), sampler, requests, tokens, against, part)
        out.append(drawn.astype(np.float32))
        if note is not None:
            note(min(start + _BATCH, len(index)), len(index))
    return np.concatenate(out).astype(np.float64)


def _request(model: EnvironmentModel, corpus: ViewCorpus, index: int, seed: int) -> ImageRequest:
    """A place of its own for the words and the direction of a view."""
    view = corpus.views[index].view(NATIVE)
    things = model.text.read(corpus.captions[index]).meant
    return ImageRequest(
        PlaceRequest(corpus.names[corpus.places[index]], things), view, seed * 1_000_003 + index, anywhere=True
    )


def compare(
    images: NDArray[np.floating],
    real: NDArray[np.floating],
    features: tuple[FloatArray, FloatArray],
    codec: PirCodec,
) -> dict[str, float]:
    """Distances of two sets of images of as many views of each place, of which the judge saw `features`."""
    a, b = Physical.of(images, codec), Physical.of(real, codec)
    return {
        "frechet": frechet(*features),
        "range wasserstein, up to 10 m [m]": range_distance(a, b),
        "range wasserstein, all [m]": range_distance(a, b, np.inf),
        "energy-range law, 1 to 8.5 m [dB]": law_distance(a, b),
        "smooth pixels": smooth_share(a),
        "nothing returns": float(np.isnan(a.range).mean()),
    }


def examine(
    model: EnvironmentModel,
    test: ViewCorpus,
    layouts: NDArray[np.integer],
    bank: NDArray[np.floating],
    classifier: ImageClassifier,
    *,
    sampler: ImageSampler,
    each: int,
    seed: int,
    use_layout_map: bool = True,
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
        sketched: whether to draw over sketches.
        note: called with (drawn, to be drawn).

    Returns:
        the figures, the images, and which views they were drawn for.
    """
    split = halves(test, layouts, each, seed)
    images = drawn_like(model, test, split.first, sampler, seed, note, use_layout_map)
    real_a, real_b = (test.images[part].astype(np.float64) for part in (split.first, split.second))
    first, second = ([test.views[i] for i in part] for part in (split.first, split.second))
    (seen, probabilities), (seen_a, chances_a) = (classifier.classify(x, first) for x in (images, real_a))
    seen_b = classifier.classify(real_b, second)[0]
    drawn, floor = (compare(x, real_b, (f, seen_b), model.codec) for x, f in ((images, seen), (real_a, seen_a)))
    goal, rooms = test.places[split.first], layouts[split.first]

    def recognised(probabilities: FloatArray, together: bool = False) -> NDArray[np.bool_]:
        return correctly_named(probabilities, goal, rooms if together else None)

    named, named_together = recognised(probabilities), recognised(probabilities, True)
    result = {
        "views": len(split.first),
        "layouts": len(np.unique(np.stack([rooms, goal]), axis=1).T),
        "recognised": float(named.mean()),
        "recognised, real": float(recognised(chances_a).mean()),
        "recognised, all views of a layout together": float(named_together.mean()),
        "recognised, all views of a layout together, real": float(recognised(chances_a, True).mean()),
        "recognised, by place": {test.names[p]: float(named[goal == p].mean()) for p in np.unique(goal)},
        "recognised together, by place": {
            test.names[p]: float(named_together[goal == p].mean()) for p in np.unique(goal)
        },
        "drawn": drawn,
        "real": floor,
        "frechet over floor": drawn["frechet"] / floor["frechet"],
        "smooth pixels, real of the other half": smooth_share(Physical.of(real_b, model.codec)),
        "floor where geometry puts it": floor_share(Physical.of(images, model.codec), first),
        "floor where geometry puts it, real": floor_share(Physical.of(real_a, model.codec), first),
        "distance to the nearest training image": float(np.median(nearest(images, bank))),
        "distance to the nearest training image, least": float(np.min(nearest(images, bank))),
        "distance to the nearest training image, real": float(np.median(nearest(real_a, bank))),
    }
    return result, images, split
