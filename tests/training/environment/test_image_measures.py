"""What judges the image models: figures with known answers, and examinations that hold nothing of the training set."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from rfgen_sionna.generative.environment.image_sampling import ImageSampler
from rfgen_sionna.generative.environment.path_diffusion import PathDiffusion
from rfgen_sionna.generative.environment.place_encoder import ViewFacts
from rfgen_sionna.pir.codec import PirCodec
from rfgen_sionna.pir.view import View
from rfgen_sionna.records import Pir
from training.environment.classifier_training import train_classifier
from training.environment.contact_sheets import completed_sheet, sheet
from training.environment.image_evaluation import examine, halves
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
from training.environment.path_evaluation import AffineBaseline, calibrated, examine_paths
from training.environment.pir_data import split_of
from training.environment.view_corpus import ViewCorpus

CODEC = PirCodec()
VIEW = View((64, 64), (60.0, 60.0), (0.0, 0.0, 1.0), (0.0, 0.1, 0.0))
Wall = Callable[..., Pir]


def seen(*pirs: Pir) -> Physical:
    return Physical.of(np.stack([CODEC.encode(p) for p in pirs]), CODEC)


def test_a_wall_half_a_metre_farther_is_half_a_metre_off(wall: Wall) -> None:
    above = View((64, 64), (40.0, 40.0), (0.0, 0.0, 50.0), (0.0, 0.0, 0.0))
    near, far = (seen(wall(d, above)) for d in (4.0, 4.5))
    assert range_distance(near, near) == 0.0
    # ranges grow with the slant of the rays, some 4 % in the mean of this view
    assert range_distance(near, far) == pytest.approx(0.5 * 1.04, abs=0.01)


def test_three_decibels_more_are_three_decibels(wall: Wall) -> None:
    weak, strong = (seen(wall(5.0, VIEW, level)) for level in (-130.0, -127.0))
    assert law_distance(weak, strong) == pytest.approx(3.0, abs=0.01)


def test_noise_on_ranges_roughens(wall: Wall) -> None:
    pir = wall(5.0, VIEW)
    rng = np.random.default_rng(0)
    rough = replace(pir, time_of_arrival=pir.time_of_arrival * (1 + 0.02 * rng.standard_normal((64, 64))))
    assert smooth_share(seen(pir)) > 0.9
    assert smooth_share(seen(rough)) < 0.3


def test_the_floor_is_where_height_pitch_and_field_of_view_put_it(wall: Wall) -> None:
    facts = ViewFacts((60.0, 60.0), 1.0, 0.1, 0.0)
    for kind in (facts, replace(facts, roll=0.3), replace(facts, projection="equirectangular")):
        x = seen(wall(50.0, kind.view((64, 64))))
        assert floor_share(x, [kind]) > 0.99
        assert floor_share(x, [replace(kind, height=1.3)]) < 0.01
        assert floor_share(x, [replace(kind, fov_deg=(80.0, 80.0))]) < 0.5
    assert floor_share(seen(wall(50.0, VIEW)), [replace(facts, projection="equirectangular")]) < 0.9
    assert np.isnan(floor_share(seen(wall(50.0, VIEW)), [replace(facts, pitch=-0.5)]))


def test_a_copy_is_found(corpus: ViewCorpus) -> None:
    distances = nearest(corpus.images[:3], corpus.images[1:])
    assert distances[0] > 1e-3
    assert distances[1:].max() == 0.0


def test_splits_and_halves_share_no_room(corpus: ViewCorpus) -> None:
    names = {split_of(layout) for layout in range(200)}
    assert names == {"train", "validation", "test"}
    assert all(split_of(layout) == split_of(layout) for layout in range(50))
    layouts = np.arange(16) // 4
    parts = halves(replace(corpus, places=np.zeros(16, np.intp)), layouts, 8, seed=1)
    assert len(parts.first) == len(parts.second) == 8
    assert not set(layouts[parts.first]) & set(layouts[parts.second])


@pytest.mark.slow
def test_the_judge_tells_places_apart_and_an_examination_reports(corpus: ViewCorpus, model, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    classifier = train_classifier(corpus.images, corpus.places, corpus.views, steps=80, items=32)
    probabilities = classifier.classify(corpus.images, corpus.views)[1]
    assert correctly_named(probabilities, corpus.places).mean() > 0.9
    pairs = np.arange(16) // 4  # two views of each place in each layout
    assert (
        correctly_named(probabilities, corpus.places, pairs).mean()
        >= correctly_named(probabilities, corpus.places).mean()
    )
    assert correctly_named(np.array([[-1.0, -2.0], [-9.0, -1.0]]), np.array([0, 0]), np.array([5, 5])).sum() == 0
    figures, images, which = examine(
        model, corpus, np.arange(16), corpus.images, classifier, sampler=ImageSampler("ddim", 2, 1.0), each=4, seed=0
    )
    assert images.shape == (8, 3, 64, 64)
    assert figures["views"] == 8
    # noise is no room: a model that has learnt nothing must not pass
    assert figures["frechet over floor"] > 2.0
    json.dumps(figures)
    sheet(corpus, which.first, images, CODEC, tmp_path / "sheet.png")
    assert (tmp_path / "sheet.png").stat().st_size > 10_000


def test_the_straight_line_finds_what_is_lost_and_fills_holes_where_that_helps(corpus: ViewCorpus) -> None:
    same = replace(corpus, incomplete=corpus.images)
    line = AffineBaseline.fit(same, CODEC)
    assert (line.slope, line.offset) == (pytest.approx(1.0, abs=1e-3), pytest.approx(0.0, abs=0.1))
    assert not line.fills
    holes = corpus.images.copy()
    holes[:, :, 3:6, 4:9] = np.array([-1.0, 1.0, -1.0])[:, None, None]
    line = AffineBaseline.fit(replace(corpus, incomplete=holes), CODEC)
    assert line.fills
    level = np.full((64, 64), -130.0)
    level[3:6, 4:9] = np.nan
    assert np.allclose(line(level), -130.0, atol=0.1)


@pytest.mark.filterwarnings("ignore::rfgen_sionna.generative.environment.image_models.UnknownPlaceWarning")
def test_path_diffusion_is_examined_beside_the_straight_line(
    corpus: ViewCorpus, model_folder: Path, tmp_path: Path
) -> None:
    refiner = PathDiffusion(model_folder, steps=2, samples=1)
    figures = examine_paths(refiner, corpus, corpus, strength=1.0, count=4, seed=0)
    assert figures["range error refined [m]"] == pytest.approx(figures["range error of the incomplete image [m]"])
    low, high = figures["against the incomplete image"]["interval"]
    assert low <= figures["against the incomplete image"]["fall"] <= high
    completed_sheet(corpus, refiner, tmp_path / "paths.png", strength=1.0)
    assert (tmp_path / "paths.png").stat().st_size > 10_000
    confidence_gate = calibrated(refiner, corpus, count=3, seed=0)
    assert 0.0 <= confidence_gate.share <= 1.0
    assert confidence_gate.classifier is refiner.confidence_gate.classifier


def test_frechet_is_the_squared_distance_of_shifted_sets() -> None:
    a = np.random.default_rng(0).standard_normal((500, 4))
    assert frechet(a, a) == pytest.approx(0.0, abs=1e-6)
    assert frechet(a, a + np.array([3.0, 0.0, 0.0, 0.0])) == pytest.approx(9.0, rel=1e-6)
    # normal distributions of the same mean: the squared difference of the deviations, per dimension
    assert frechet(a, 2.0 * (a - a.mean(axis=0)) + a.mean(axis=0)) == pytest.approx(4.0, rel=0.15)
