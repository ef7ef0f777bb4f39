"""Periods, phases, strides and drawn beats."""

from __future__ import annotations

import numpy as np
import pytest

from rfgen_sionna.generative.diffusion.features import encode
from rfgen_sionna.generative.diffusion.rhythm import Beat, find_period, find_phase, stride
from rfgen_sionna.generative.motion import KinematicSource
from training.motion.motion_corpus import fit_hands

SOURCE = KinematicSource(20.0)
WALK, JACKS, STANDING = (SOURCE(a, 6.0, 1) for a in ("walk", "jumping_jacks", "standing"))
HANDS = fit_hands([STANDING], [WALK, JACKS])


@pytest.mark.parametrize("period", [0.6, 1.1, 2.3])
def test_the_period_and_phase_of_a_wave_are_found(period: float) -> None:
    t = np.arange(160) / 20.0
    wave = np.cos(2 * np.pi * t / period) + 0.3 * np.cos(4 * np.pi * t / period)
    found, height = find_period(wave, 20.0)
    assert found == pytest.approx(period, rel=0.02)
    assert height > 0.98
    phase = find_phase(wave, 20.0, found)
    crests = np.cos(phase)[40:120]
    assert np.corrcoef(crests, np.cos(2 * np.pi * t / period)[40:120])[0, 1] > 0.98


def test_nothing_and_noise_have_no_rhythm() -> None:
    assert find_period(np.zeros(100), 20.0) == (0.0, 0.0)
    assert find_period(np.random.default_rng(0).standard_normal(200), 20.0)[1] < 0.5


def test_only_travel_has_strides() -> None:
    assert stride(encode(WALK, HANDS), 20.0) is not None
    assert stride(encode(JACKS, HANDS), 20.0) is None


def test_a_drawn_beat_keeps_its_rate_and_comes_from_its_seed() -> None:
    beat = Beat(np.log(0.8), 0.0, 0.02)
    rows = beat.draw(400, 20.0, np.random.default_rng(1))
    assert np.allclose(rows[:, 0] ** 2 + rows[:, 1] ** 2, 1.0)
    turns = np.unwrap(np.arctan2(rows[:, 1], rows[:, 0]))
    assert (turns[-1] - turns[0]) / (2 * np.pi) / (399 / 20.0) == pytest.approx(0.8, rel=0.05)
    assert np.array_equal(rows, beat.draw(400, 20.0, np.random.default_rng(1)))
    fast = beat.draw(400, 20.0, np.random.default_rng(1), speed=1.5)
    faster = np.unwrap(np.arctan2(fast[:, 1], fast[:, 0]))
    assert (faster[-1] - faster[0]) / (turns[-1] - turns[0]) == pytest.approx(1.5, rel=0.01)
