"""The reverse process, on a small network with random weights: shapes, seeds, what is kept, what is refused."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from rfgen_sionna.generative.diffusion import diffusion_source as source_module
from rfgen_sionna.generative.diffusion.checkpoint import read_model
from rfgen_sionna.generative.diffusion.constraints import MotionConstraint, resampled_features
from rfgen_sionna.generative.diffusion.diffusion_source import DiffusionSource
from rfgen_sionna.generative.diffusion.features import NUM_FEATURES, PARTS
from rfgen_sionna.generative.diffusion.motion_sampling import MotionSampler
from rfgen_sionna.generative.diffusion.network import DenoisingNet, NetworkShape
from rfgen_sionna.generative.diffusion.phrasebook import CLAUSES
from rfgen_sionna.generative.diffusion.rhythm import Beat
from rfgen_sionna.generative.diffusion.schedule import make_scheduler, signal_shares, step_at
from rfgen_sionna.generative.diffusion.sentence_encoder import TextEncoder
from rfgen_sionna.generative.motion import MEAN_ADULT, KinematicSource, MotionSource
from rfgen_sionna.generative.motion.skeleton import JOINT
from training.model_files import write_motion_model
from training.motion.motion_corpus import MotionCorpus, fit_hands
from training.motion.motion_training import assembled

WALK = KinematicSource(20.0)("walk", 4.0, 0)


@pytest.fixture(scope="module")
def source(tmp_path_factory: pytest.TempPathFactory) -> DiffusionSource:
    torch.manual_seed(0)
    net = DenoisingNet(NetworkShape(channels=(16, 24, 32)))
    hands = fit_hands([WALK], [WALK])
    rows = resampled_features(WALK, hands)
    corpus = MotionCorpus((), hands, {"walk": Beat(0.0, 0.1, 0.02)}, rows.mean(axis=0), np.full(NUM_FEATURES, 0.05))
    path = tmp_path_factory.mktemp("model") / "motion.safetensors"
    write_motion_model(path, assembled(net, TextEncoder(tuple(CLAUSES)), corpus, {"seed": 0}))
    return DiffusionSource(path, MotionSampler(steps=3))


def test_the_model_file_holds_the_model(source: DiffusionSource) -> None:
    model = source.model
    assert model.facts == {"seed": 0}
    assert model.beats["walk"] == Beat(0.0, 0.1, 0.02)
    assert "walk" in model.stems
    assert all(p.dtype == torch.float32 and not p.requires_grad for p in model.net.parameters())


def test_a_source_is_a_motion_source(source: DiffusionSource) -> None:
    assert isinstance(source, MotionSource)
    motion = source("walk", 2.0, 3)
    assert motion.action == "walk"
    assert motion.duration >= 2.0
    assert motion.rotations.shape == (len(motion.translation), 52, 4)
    assert np.allclose(np.linalg.norm(motion.rotations, axis=-1), 1.0)


def test_seeds_decide(source: DiffusionSource) -> None:
    a, b, c = (source.generate("a person walks", duration=2.0, seed=s) for s in (5, 5, 6))
    assert np.array_equal(a.rotations, b.rotations)
    assert not np.allclose(a.rotations, c.rotations)


def test_a_motion_does_not_depend_on_its_company(source: DiffusionSource) -> None:
    alone = source.generate("a person jumps", duration=2.0, seed=4)
    among = source.generate_many(["a person walks", "a person jumps"], duration=2.0, seeds=[1, 4])[1]
    assert np.abs(alone.translation - among.translation).max() < 1e-4


def test_long_motions_go_on_without_a_jump(source: DiffusionSource) -> None:
    motion = source.generate("a person walks", duration=19.0, seed=1)
    assert motion.duration == pytest.approx(19.0, abs=0.06)
    steps = np.linalg.norm(np.diff(motion.translation, axis=0), axis=-1)
    seam = slice(round(8.0 * 60) - 3, round(8.0 * 60) + 3)
    assert steps[seam].max() <= 2.0 * steps.max()


def test_kept_parts_come_out_as_they_are(source: DiffusionSource) -> None:
    hands = source.model.hands
    parts = ("place", "pelvis", "legs")
    motion = source.generate("a person pushes", duration=3.9, seed=2, keep=MotionConstraint(WALK, parts))
    made, given = resampled_features(motion, hands), resampled_features(WALK, hands)[:79]
    made = made[:79]
    for part in ("place", "pelvis"):
        columns = list(PARTS[part])
        assert np.abs(made[:, columns] - given[:, columns]).max() < 1e-6
    arms = list(PARTS["left_arm"])
    assert np.abs(made[:, arms] - given[:, arms]).max() > 0.01


def test_kept_frames_come_out_as_they_are(source: DiffusionSource) -> None:
    motion = source.generate("a person walks", duration=3.9, seed=2, keep=MotionConstraint(WALK, stop=1.0))
    made, given = (resampled_features(m, source.model.hands) for m in (motion, WALK))
    assert np.abs(made[:20, :3] - given[:20, :3]).max() < 1e-6
    assert np.abs(made[40:79, :3] - given[40:79, :3]).max() > 1e-3


def test_a_draft_under_full_noise_is_forgotten_and_under_less_it_is_not(source: DiffusionSource) -> None:
    hands = source.model.hands
    drafts = [KinematicSource(20.0)(action, 3.0, 1) for action in ("standing", "t_pose")]

    def apart(strength: float) -> float:
        a, b = (resampled_features(source.redo(d, "a person stands", strength=strength), hands) for d in drafts)
        arms = list(PARTS["left_arm"])
        return float(np.abs(a[:, arms] - b[:, arms]).max())

    assert 3.0 * apart(1.0) < apart(0.5)


def test_skeletons_scale_the_path(source: DiffusionSource) -> None:
    sizes = {name: 1.2 * getattr(MEAN_ADULT, name) for name in ("offsets", "ankle_height", "heel", "toe_height")}
    tall = replace(MEAN_ADULT, **sizes)
    a, b = (source.generate("a person walks", duration=2.0, seed=1, skeleton=s) for s in (None, tall))
    assert np.allclose(b.translation[:, :2], 1.2 * a.translation[:, :2], atol=1e-9)
    assert np.array_equal(b.offsets, tall.offsets)


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ({"duration": 0.0}, "duration"),
        ({"duration": 1000.0}, "duration"),
        ({"speed": 3.0}, "speed"),
        ({"path": [[0.0, 0.0]]}, "path"),
        ({"path": [[0.0, 0.0], [90.0, 0.0]], "duration": 6.0}, "path"),
        ({"path": [[0.0, 0.0], [1.0, 0.0]], "duration": 20.0}, "path"),
    ],
)
def test_bad_input_is_named(source: DiffusionSource, change: dict, named: str) -> None:
    with pytest.raises(ValueError, match=named):
        source.generate("a person walks", **change)


def test_unknown_actions_parts_and_samplers_are_named(source: DiffusionSource) -> None:
    with pytest.raises(ValueError, match="action"):
        source("flies", 2.0, 0)
    with pytest.raises(ValueError, match="parts"):
        MotionConstraint(WALK, ("tail",))
    with pytest.raises(ValueError, match="sampler"):
        MotionSampler(kind="euler")
    with pytest.raises(ValueError, match="steps"):
        MotionSampler(steps=1)


def test_a_missing_model_is_named(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match=r"nothing\.safetensors"):
        read_model(tmp_path / "nothing.safetensors")


def test_noise_grows_from_none_to_all() -> None:
    shares = signal_shares()
    assert np.all(np.diff(shares) < 0.0)
    assert shares[0] > 0.999
    assert shares[-1] < 1e-4
    # half of the steps are spent above t = 0.75
    assert [step_at(t) for t in (0.75, 0.9)] == [499, 683]


@pytest.mark.filterwarnings("ignore:__array__ implementation:DeprecationWarning")  # of diffusers, with NumPy 2
@pytest.mark.parametrize("kind", ["ddim", "dpm"])
def test_a_scheduler_told_the_truth_arrives_at_it(kind: str) -> None:
    scheduler = make_scheduler(kind)
    scheduler.set_timesteps(15)
    truth = torch.linspace(-1.0, 1.0, 40).reshape(1, 4, 10)
    x = torch.randn(truth.shape, generator=torch.Generator().manual_seed(0))
    for t in scheduler.timesteps:
        x = scheduler.step(truth, int(t), x).prev_sample
    # ddim stops at the first step, where a hundredth of the noise is left
    left = float(np.sqrt(1.0 - signal_shares()[0]))
    assert float((x - truth).abs().max()) < (5.0 * left if kind == "ddim" else 1e-3)


def test_the_shipped_model_path_is_inside_the_package() -> None:
    assert source_module.SHIPPED.parent.parent == Path(source_module.__file__).parent
    assert JOINT["pelvis"] == 0
