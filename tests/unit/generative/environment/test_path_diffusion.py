"""Path diffusion changes energies within bounds, adds where nothing was, and never moves what is there."""

from __future__ import annotations

from collections.abc import Callable
from copy import copy
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from rfgen_sionna.generative.environment.classifier import ConfidenceGate
from rfgen_sionna.generative.environment.environment_model import (
    CONTROL_FILE,
    EnvironmentModel,
    read_control,
)
from rfgen_sionna.generative.environment.path_diffusion import PathDiffusion
from rfgen_sionna.pir.codec import PirCodec
from rfgen_sionna.pir.view import View
from rfgen_sionna.records import Pir
from training.environment.classifier_training import train_confidence_gate
from training.environment.path_evaluation import fit_confidence_gate, pir_of
from training.environment.view_corpus import ViewCorpus
from training.model_files import write_control

VIEW = View((64, 64), (60.0, 60.0), (0.0, 0.0, 1.0), (0.0, 0.0, 0.0))
pytestmark = pytest.mark.filterwarnings("ignore::rfgen_sionna.generative.environment.image_models.UnknownPlaceWarning")


@pytest.fixture(scope="module")
def refiner(model_folder: Path) -> PathDiffusion:
    return PathDiffusion(model_folder, steps=2, samples=2, most_gain_db=4.0)


@pytest.fixture
def mixed(wall: Callable[..., Pir]) -> Pir:
    """A wall with a hole in it."""
    pir = wall(4.0, VIEW)
    hole = np.zeros(VIEW.resolution, dtype=np.bool_)
    hole[10:20, 10:20] = True
    return replace(
        pir,
        energy=np.where(hole, 0.0, pir.energy),
        time_of_arrival=np.where(hole, np.nan, pir.time_of_arrival),
        velocity=np.where(hole, 0.0, 0.5),
    )


def test_no_strength_gives_the_image_back(refiner: PathDiffusion, mixed: Pir) -> None:
    assert refiner.refine(mixed, "a bedroom", strength=0.0) is mixed


def test_what_is_there_keeps_its_delay_and_changes_within_bounds(refiner: PathDiffusion, mixed: Pir) -> None:
    refined = refiner.refine(mixed, "a bedroom", seed=1)
    there = mixed.energy > 0
    np.testing.assert_array_equal(refined.time_of_arrival[there], mixed.time_of_arrival[there])
    np.testing.assert_array_equal(refined.velocity[there], mixed.velocity[there])
    gain = 10 * np.log10(refined.energy[there] / mixed.energy[there])
    assert 0.05 < np.abs(gain).max() <= 4.0 + 1e-9
    new = ~there & (refined.energy > 0)
    assert new.any(), "energy where nothing was"
    assert np.isfinite(refined.time_of_arrival[new]).all()
    assert not refined.velocity[new].any()


def test_the_same_seed_refines_the_same(refiner: PathDiffusion, mixed: Pir) -> None:
    a, b, c = (refiner.refine(mixed, "a bedroom", seed=seed) for seed in (1, 1, 2))
    np.testing.assert_array_equal(a.energy, b.energy)
    assert not np.array_equal(a.energy, c.energy)


def test_a_negative_prompt_has_its_say(refiner: PathDiffusion, mixed: Pir) -> None:
    a, b = (refiner.refine(mixed, "a bedroom", negative=words) for words in ("", "a sofa"))
    assert not np.array_equal(a.energy, b.energy)


def test_what_stands_still_keeps_one_gain(refiner: PathDiffusion, wall: Callable[..., Pir]) -> None:
    """Something passes by on the left: the gain of the right half doesn't flicker."""
    frames = []
    for k in range(3):
        pir = wall(4.0, VIEW)
        energy, arrival = pir.energy.copy(), pir.time_of_arrival.copy()
        energy[20:40, 6 * k : 6 * k + 8] = 1e-11
        arrival[20:40, 6 * k : 6 * k + 8] = 1.5e-8
        frames.append(replace(pir, energy=energy, time_of_arrival=arrival, time=0.1 * k))
    refined = refiner.refine_sequence(frames, "a bedroom", seed=1)
    assert [r.time for r in refined] == [0.0, 0.1, 0.2]
    gains = np.stack([10 * np.log10(r.energy / f.energy) for r, f in zip(refined, frames, strict=True)])
    assert np.ptp(gains[:, :, 32:], axis=0).max() < 1e-9
    alone = [refiner.refine(frame, "a bedroom", seed=1) for frame in frames]
    loose = np.stack([10 * np.log10(r.energy / f.energy) for r, f in zip(alone, frames, strict=True)])
    assert np.ptp(loose[:, :, 32:], axis=0).max() > 1e-6


def test_what_moves_keeps_its_phase(refiner: PathDiffusion, wall: Callable[..., Pir]) -> None:
    """One gain all over a body and all along: whatever its parts add up to only gets stronger or weaker."""
    frames = []
    for k in range(3):
        pir = wall(4.0, VIEW)
        energy, arrival, velocity = pir.energy.copy(), pir.time_of_arrival.copy(), pir.velocity.copy()
        body = np.s_[10:50, 20 + 3 * k : 34 + 3 * k]
        energy[body] = 1e-11 * np.linspace(0.2, 2.0, 14)
        arrival[body], velocity[body] = 1.5e-8, 0.4
        frames.append(replace(pir, energy=energy, time_of_arrival=arrival, velocity=velocity, time=0.1 * k))
    refined = refiner.refine_sequence(frames, "a bedroom", seed=1)
    gains = np.stack([10 * np.log10(r.energy / f.energy) for r, f in zip(refined, frames, strict=True)])
    moves = np.stack([frame.velocity != 0 for frame in frames])
    assert np.ptp(gains[moves]) < 1e-9
    assert abs(gains[moves].mean()) > 0.01
    assert np.ptp(gains[~moves]) > 0.1


def test_strength_has_every_level(refiner: PathDiffusion, mixed: Pir) -> None:
    there = mixed.energy > 0
    still = replace(mixed, velocity=np.zeros(VIEW.resolution))
    levels = (1e-5, 0.01, 0.1, 0.3, 0.5, 0.75, 0.99, 1.0)
    refined = [refiner.refine(still, "a bedroom", strength=level).energy for level in levels]
    changes = [float(np.abs(10 * np.log10(energy[there] / mixed.energy[there])).mean()) for energy in refined]
    assert len({round(change, 9) for change in changes}) == len(levels)
    assert 0 < changes[0] < 0.1 * changes[-1]
    assert changes[-2] == pytest.approx(changes[-1], rel=0.05)


@pytest.mark.parametrize(
    ("channel", "value", "allowed"),
    [("energy", np.nan, "0 … 1"), ("energy", -1e-12, "0 … 1"), ("energy", -140.0, "0 … 1"), ("energy", 1e3, "0 … 1"),
     ("time_of_arrival", 4.0, "0 … 1e-3 s"), ("time_of_arrival", np.nan, "0 … 1e-3 s"), ("velocity", np.inf, "m/s")],
)  # fmt: skip
def test_images_of_the_wrong_range_are_refused(
    refiner: PathDiffusion, wall: Callable[..., Pir], channel: str, value: float, allowed: str
) -> None:
    frames = [wall(4.0, VIEW), wall(4.0, VIEW)]
    values = getattr(frames[1], channel).copy()
    values[40, 7] = value
    frames[1] = replace(frames[1], **{channel: values})
    with pytest.raises(ValueError, match=rf"frames\[1\]\.{channel}\[40, 7\] is .*{allowed}"):
        refiner.refine_sequence(frames, "a bedroom")
    with pytest.raises(TypeError, match="a Pir is needed"):
        refiner.refine(values, "a bedroom")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="prompt is None"):
        refiner.refine(frames[0], None)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="seed is -1"):
        refiner.refine(frames[0], "a bedroom", seed=-1)


def test_images_that_lack_nothing_are_left_alone(refiner: PathDiffusion, mixed: Pir, corpus: ViewCorpus) -> None:
    """A judge that has learnt what incomplete images look like decides how much of the gains is applied."""
    confidence_gate = train_confidence_gate(corpus, 0, steps=60)
    probabilities = np.stack(
        [confidence_gate.probabilities(images, corpus.views) for images in (corpus.images, corpus.lacking)]
    )
    assert (probabilities > 0.5).mean(axis=1) == pytest.approx([0.0, 1.0], abs=0.2), probabilities
    timid = copy(refiner)
    changes = []
    for images in (corpus.images, corpus.lacking):
        frame = replace(pir_of(images[0], corpus.views[0], PirCodec()), velocity=np.zeros(VIEW.resolution))
        there = frame.energy > 0
        for timid.confidence_gate in (ConfidenceGate(), confidence_gate):
            refined = timid.refine(frame, "a bedroom")
            changes.append(np.abs(10 * np.log10(refined.energy[there] / frame.energy[there])).mean())
    believed = confidence_gate.probabilities(np.stack([corpus.images[0], corpus.lacking[0]]), corpus.views[:1] * 2)
    assert changes[1] == pytest.approx(believed[0] * changes[0], rel=0.05)
    assert changes[3] == pytest.approx(believed[1] * changes[2], rel=0.05)
    with pytest.raises(ValueError, match="pairs"):
        train_confidence_gate(replace(corpus, incomplete=None), 0)


def test_gains_that_scatter_are_shrunk_and_complete_images_hold_them_down() -> None:
    rng = np.random.default_rng(0)
    wanted = rng.normal(-3.0, 4.0, (40, 64))
    drawn = wanted + rng.normal(0.0, 2.0, wanted.shape)
    sure, alike = np.repeat([[0.0], [1.0]], 40, axis=1), np.ones((2, 40))
    # a fifth of the variance of what is drawn is chance: a bit more than the rest, for the common part, is applied
    assert 0.7 < fit_confidence_gate(ConfidenceGate(), sure, np.full(40, 2.0), drawn, wanted).share < 0.95
    assert fit_confidence_gate(ConfidenceGate(), sure, np.full(40, 2.0), wanted, wanted).share == 1.0
    assert fit_confidence_gate(ConfidenceGate(), alike, np.full(40, 2.0), wanted, wanted).share == pytest.approx(
        0.93 / 2.0
    )


def test_what_is_known_of_completeness_travels_with_the_control_net(
    model: EnvironmentModel, corpus: ViewCorpus, tmp_path: Path
) -> None:
    confidence_gate = replace(train_confidence_gate(corpus, 0, steps=2), share=0.625)
    write_control(tmp_path / CONTROL_FILE, model.control, {}, confidence_gate)
    kept = read_control(tmp_path, model.unet).confidence_gate
    assert kept.share == 0.625
    expected = confidence_gate.probabilities(corpus.images, corpus.views)
    np.testing.assert_allclose(kept.probabilities(corpus.images, corpus.views), expected, atol=2e-3)  # half precision
    assert ConfidenceGate()(corpus.images[:1], corpus.views[:1]) == 1.0


def test_finer_images_get_the_same_gains(refiner: PathDiffusion, wall: Callable[..., Pir]) -> None:
    fine = wall(4.0, replace(VIEW, resolution=(128, 128)))
    refined = refiner.refine(fine, "a bedroom", seed=1)
    assert refined.energy.shape == (128, 128)
    np.testing.assert_array_equal(refined.time_of_arrival, fine.time_of_arrival)


def test_arguments_out_of_range_are_refused(refiner: PathDiffusion, mixed: Pir, model_folder: Path) -> None:
    with pytest.raises(ValueError, match="strength"):
        refiner.refine(mixed, "a bedroom", strength=1.5)
    with pytest.raises(ValueError, match="frames: none"):
        refiner.refine_sequence([], "a bedroom")
    with pytest.raises(ValueError, match="views differ"):
        refiner.refine_sequence([mixed, replace(mixed, position=(1.0, 0.0, 1.0))], "a bedroom")
    with pytest.raises(ValueError, match="samples"):
        PathDiffusion(model_folder, samples=0)
    with pytest.raises(ValueError, match="most_gain_db"):
        PathDiffusion(model_folder, most_gain_db=-1.0)
