"""Actions are performed, and varied as far as they stay true."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from rfgen_sionna.generative.action_definitions import is_true_of
from rfgen_sionna.generative.diffusion import diffusion_source
from rfgen_sionna.generative.diffusion.diffusion_source import DiffusionSource
from rfgen_sionna.generative.manner import Manner
from rfgen_sionna.generative.motion import MEAN_ADULT, MotionSource
from rfgen_sionna.generative.motion.clip_editing import joint_places
from rfgen_sionna.generative.performing import perform
from rfgen_sionna.records import Motion


def test_it_is_a_source_of_motion() -> None:
    source: MotionSource = DiffusionSource()
    assert isinstance(source, MotionSource)


@pytest.mark.parametrize(
    "action",
    [
        "walk",
        "lie",
        "wave",
        *(pytest.param(each, marks=pytest.mark.slow) for each in ("squat", "kick", "sit", "t_pose", "run")),
    ],
)
def test_variations_show_their_action(action: str) -> None:
    draft = perform(action, 3.0, 4)
    varied = DiffusionSource(strength=0.5)(action, 3.0, 4)
    assert is_true_of(varied, action)
    assert varied.action == action
    assert varied.seed == 4
    assert varied.clips == draft.clips
    assert np.abs(joint_places(varied) - joint_places(draft)).max() > 0.01


def test_no_strength_performs_alone() -> None:
    alone, varied = perform("squat", 3.0, 2), DiffusionSource(strength=0.0)("squat", 3.0, 2)
    assert np.array_equal(alone.rotations, varied.rotations)


def test_manner_and_body_are_those_of_the_performance() -> None:
    varied = DiffusionSource()("walk", 3.0, 1, skeleton=MEAN_ADULT, manner=Manner(speed_mps=0.6))
    draft = perform("walk", 3.0, 1, manner=Manner(speed_mps=0.6))
    assert np.array_equal(varied.translation[:, :2], draft.translation[:, :2])


def test_a_variation_that_would_not_show_its_action_is_weaker(monkeypatch: pytest.MonkeyPatch) -> None:
    """A definition that nothing but the draft meets leaves the draft; one that weak variations meet takes these."""
    draft = perform("squat", 3.0, 2)
    tried: list[float] = []

    def away(motion: Motion) -> float:
        return float(np.linalg.norm(joint_places(motion) - joint_places(draft)))

    def weak_enough(motion: Motion, action: str) -> bool:
        tried.append(away(motion))
        return tried[-1] < limit

    monkeypatch.setattr(diffusion_source, "is_true_of", weak_enough)
    limit = 1e-12
    assert DiffusionSource(strength=0.8).vary(draft) is draft
    assert tried[1:] == sorted(tried[1:], reverse=True)
    limit = 0.5 * (tried[1] + tried[2])
    varied = DiffusionSource(strength=0.8).vary(draft)
    assert 0.0 < away(varied) < limit


@pytest.mark.parametrize("strength", [-0.1, 1.1, float("nan")])
def test_strengths_out_of_range_are_refused(strength: float) -> None:
    with pytest.raises(ValueError, match="strength"):
        DiffusionSource(strength=strength)


def test_missing_weights_are_named(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match=r"none\.safetensors"):
        DiffusionSource(weights=tmp_path / "none.safetensors")
