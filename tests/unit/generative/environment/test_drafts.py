"""Drafts are boxes as training views were measured to have them, seen as the view says."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from rfgen_sionna.generative.environment.corpus import Corpus
from rfgen_sionna.generative.environment.data import PLACES
from rfgen_sionna.generative.environment.drafts import Drafts, settled
from rfgen_sionna.generative.environment.imagining import Wish, imagine
from rfgen_sionna.generative.environment.model import (
    BASE_FILE,
    EnvironmentModel,
    make_scheduler,
    read_model,
    write_model,
)
from rfgen_sionna.generative.environment.sampling import Sampler, noise_like
from rfgen_sionna.generative.environment.text import ViewFacts
from rfgen_sionna.pir.codec import PirCodec
from rfgen_sionna.pir.view import View
from rfgen_sionna.records import SPEED_OF_LIGHT

CODEC = PirCodec()
AHEAD, ASIDE, CEILING = 5.0, 2.0, 2.6


def view_of(facts: ViewFacts) -> View:
    return View((64, 64), facts.fov_deg, (0.0, 0.0, facts.height), (facts.yaw, facts.pitch, facts.roll))


def reach(facts: ViewFacts, ahead: float = AHEAD) -> np.ndarray:
    """(row, column) ranges [m] in a box without a wall behind."""
    x, y, z = np.moveaxis(view_of(facts).directions, -1, 0)
    with np.errstate(divide="ignore"):
        sides = [facts.height / -z, (CEILING - facts.height) / z, ahead / x, ASIDE / y, ASIDE / -y]
    return np.min([np.where(r > 0, r, np.inf) for r in sides], axis=0)


def ranges(channels: np.ndarray) -> np.ndarray:
    return 0.5 * SPEED_OF_LIGHT * CODEC.decode_arrays(channels, clip=True)[1]


@pytest.fixture(scope="module")
def boxes() -> Corpus:
    """Thirty views of one room, whose floor returns 6 dB more than its walls."""
    rng = np.random.default_rng(0)
    images, views = [], []
    for _ in range(30):
        facts = ViewFacts(
            (80.0, 80.0), float(rng.uniform(0.8, 1.5)), float(rng.uniform(-0.1, 0.2)), rng.uniform(-0.5, 0.5)
        )
        r = reach(facts)
        z = facts.height + r * view_of(facts).directions[..., 2]
        energy = 10 ** (-12.5 + 0.6 * (z < 0.01)) / r**2
        images.append(CODEC.encode_arrays(energy, 2 * r / SPEED_OF_LIGHT, np.zeros_like(r), clip=True))
        views.append(facts)
    count = len(views)
    return Corpus(
        np.array(images, np.float16), np.zeros(count, np.intp), PLACES, [[]] * count, ["a living room"] * count, views
    )  # fmt: skip


@pytest.fixture(scope="module")
def drafts(boxes: Corpus) -> Drafts:
    return Drafts.fit(boxes, CODEC)


def test_rooms_are_measured(drafts: Drafts) -> None:
    middle = np.nanmedian(drafts.boxes[:, [0, 2, 3, 4]], axis=0)
    np.testing.assert_allclose(middle, [AHEAD, ASIDE, ASIDE, CEILING], rtol=0.03)
    assert np.isfinite(drafts.boxes[:, 1]).mean() < 0.1, "nobody looks back"
    assert drafts.roofed[0]
    floor, walls = drafts.levels[0, 0], drafts.levels[0, 1]
    assert np.median(floor[3:6]) - np.median(walls[3:6]) == pytest.approx(6.0, abs=1.6)


def test_a_draft_shows_the_floor_where_the_view_says_and_walls_where_they_may_be(drafts: Drafts) -> None:
    facts = ViewFacts((70.0, 70.0), 1.2, 0.15, 0.1)
    near, far = [], []
    for seed in range(12):
        seen = ranges(drafts.draw(0, facts, CODEC, seed))
        z = view_of(facts).directions[..., 2]
        np.testing.assert_allclose(seen[-6:], (-facts.height / z)[-6:], rtol=0.01)
        near.append(np.nanmax(seen))
        far.append(np.nanmax(ranges(drafts.draw(0, facts, CODEC, seed, first=facts, moved=(2.0, 0.0)))))
    assert np.std(near) > 0.1, "no two rooms are the same"
    assert np.mean(near) == pytest.approx(np.max(reach(facts)), rel=0.15)
    assert np.mean(np.array(near) - np.array(far)) == pytest.approx(2.0, abs=0.4), "two metres ahead the wall is nearer"
    assert np.array_equal(drafts.draw(0, facts, CODEC, 3), drafts.draw(0, facts, CODEC, 3))


def test_what_lies_near_a_surface_lies_on_it_and_what_stands_before_it_stays(drafts: Drafts) -> None:
    draft = drafts.draw(0, ViewFacts((70.0, 70.0), 1.2, 0.15, 0.1), CODEC, 0)[None]
    drawn = draft + np.random.default_rng(1).normal(0.0, 0.02, draft.shape) * np.array([1, 1, 0])[:, None, None]
    drawn[0, :2, 20:44, 10:30] -= 0.4
    out = settled(drawn, draft)
    left, noise = (np.abs(x - draft)[0, :2, :, 40:].mean() for x in (out, drawn))
    assert left < 0.1 * noise
    assert np.abs(out - drawn)[0, :2, 22:42, 12:28].max() < 0.02


def test_a_model_keeps_its_drafts_and_draws_from_them(model: EnvironmentModel, drafts: Drafts, tmp_path: Path) -> None:
    write_model(tmp_path / BASE_FILE, replace(model, drafts=drafts))
    kept = read_model(tmp_path)
    assert kept.drafts is not None
    facts = ViewFacts((70.0, 70.0), 1.2, 0.15, 0.1)
    np.testing.assert_allclose(kept.drafts.draw(0, facts, CODEC, 2), drafts.draw(0, facts, CODEC, 2), atol=1e-3)
    tokens = kept.text.embed(["a living room"], [facts])

    def image(from_draft: float) -> np.ndarray:
        sampler = Sampler("ddim", 4, 1.0)
        return imagine(
            kept, make_scheduler(), sampler, [Wish(0, facts, 2)], tokens, tokens, noise_like(1, kept, 0),
            from_draft=from_draft,
        )[0]  # fmt: skip

    box = kept.drafts.draw(0, facts, CODEC, 2)
    # an untrained network takes away nothing of the noise: the less of it, the more of the box is left
    apart = [float(np.abs(image(share) - box)[:2].mean()) for share in (0.3, 0.6, 1.0)]
    assert apart[0] < apart[1] < apart[2]
