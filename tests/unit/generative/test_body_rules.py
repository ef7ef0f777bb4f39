"""Rules for whole-body movement: sitting, rising, limping, marching, lying, sit-ups, push-ups."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from rfgen_sionna.generative.action_definitions import MotionSignals, check
from rfgen_sionna.generative.manner import Manner
from rfgen_sionna.generative.motion import KinematicSource

NAMES = ("sit", "sit_down", "stand_up", "sit_and_stand", "lie", "sit_up", "push_up", "limp", "march", "march_in_place")
SOURCE = KinematicSource(30.0)


def signals(action: str, seconds: float = 5.0, seed: int = 0, manner: Manner | None = None) -> MotionSignals:
    return MotionSignals(SOURCE(action, seconds, seed, manner=manner))


@pytest.mark.parametrize("action", NAMES)
def test_the_definition_holds(action: str) -> None:
    for seed, seconds in ((0, 3.0), (1, 5.0), (2, 8.0)):
        verdict = check(SOURCE(action, seconds, seed), action)
        assert verdict.true, verdict.reasons


@pytest.mark.slow
@pytest.mark.parametrize("action", NAMES)
def test_the_definition_holds_for_a_hundred_seeds(action: str) -> None:
    for seed in range(100):
        seconds = 3.0 + 5.0 * seed / 99.0
        verdict = check(SOURCE(action, seconds, seed), action)
        assert verdict.true, (seed, verdict.reasons)


@pytest.mark.parametrize(
    "action", [*NAMES[::3], *(pytest.param(name, marks=pytest.mark.slow) for name in NAMES[1::3] + NAMES[2::3])]
)
def test_tired_people_do_it_too(action: str) -> None:
    verdict = check(SOURCE(action, 6.0, 4, manner=Manner(tired=True)), action)
    assert verdict.true, verdict.reasons


def _rise(seed: int, manner: Manner | None = None) -> tuple[float, float]:
    """Time between 5 and 95 % of the way up [s], and the greatest lean of the trunk meanwhile [degrees]."""
    s = signals("stand_up", 6.0, seed, manner)
    height = (s.pelvis_height - s.pelvis_height[0]) / (s.pelvis_height[-1] - s.pelvis_height[0])
    first, last = int(np.argmax(height > 0.05)), int(np.argmax(height > 0.95))
    return float(s.time[last] - s.time[first]), float(s.inclination[: last + 1].max())


def test_people_rise_in_about_a_second_and_lean_forward() -> None:
    """The way up takes 50 to 60 % of the rise of 1.2 to 2.1 s; trunk and pelvis together lean by 30 to 45 degrees."""
    for seed in range(6):
        seconds, lean = _rise(seed)
        assert 0.4 < seconds < 1.4
        assert 24.0 < lean < 55.0


def test_the_centre_of_mass_comes_over_the_feet_before_the_knees_are_straight() -> None:
    s = signals("stand_up", 6.0, 3)
    behind = -s.ahead(s.mass[:, None] - s.pair("ankle"))[..., 0].mean(axis=1)
    up = s.pelvis_height > 0.7 * s.pelvis_height[-1]
    assert behind[0] > 0.1
    assert behind[np.argmax(up) :].max() < 0.06


def test_pace_shortens_the_rise() -> None:
    slow, fast = _rise(1, Manner(speed=0.7))[0], _rise(1, Manner(speed=1.6))[0]
    assert slow / fast == pytest.approx(1.6 / 0.7, rel=0.25)


def test_seats_are_as_high_as_chairs() -> None:
    heights = [signals("sit", 1.0, seed).pelvis_height.mean() - 0.1 for seed in range(12)]
    assert 0.39 < min(heights) < max(heights) < 0.5
    assert np.std(heights) > 0.01


def test_hands_of_some_rest_on_the_thighs() -> None:
    def near(seed: int) -> float:
        s = signals("sit", 1.0, seed)
        return float(np.linalg.norm(s.pair("wrist") - s.pair("knee"), axis=-1).mean())

    distances = [near(seed) for seed in range(12)]
    assert min(distances) < 0.25
    assert max(distances) > 0.3


def test_people_lie_on_back_side_and_stomach() -> None:
    fronts = [float(signals("lie", 1.0, seed).front.mean()) for seed in range(20)]
    assert max(fronts) > 0.9
    assert min(fronts) < -0.9
    assert any(abs(front) < 0.4 for front in fronts)


def _period(values: np.ndarray, rate: float = 20.0) -> float:
    """Period of a signal [s], from the strongest line of its spectrum."""
    spectrum = np.abs(np.fft.rfft(values - values.mean(), 4096))
    return float(1.0 / np.fft.rfftfreq(4096, 1.0 / rate)[np.argmax(spectrum)])


@pytest.mark.parametrize(
    ("action", "signal"),
    [
        ("push_up", lambda s: s.joint("neck")[:, 2]),
        ("sit_up", lambda s: s.inclination),
        ("sit_and_stand", lambda s: s.pelvis_height),
    ],
)
def test_a_rate_is_kept(action: str, signal: Callable[[MotionSignals], np.ndarray]) -> None:
    s = signals(action, 20.0, 0, Manner(rate=24.0))
    assert 60.0 / _period(signal(s)) == pytest.approx(24.0, abs=1.5)


def test_size_deepens_push_ups() -> None:
    shallow, deep = (np.ptp(signals("push_up", 5.0, 2, Manner(amplitude=a)).joint("neck")[:, 2]) for a in (0.6, 1.2))
    assert deep > 1.25 * shallow


def test_palms_stay_in_place_in_push_ups() -> None:
    s = signals("push_up", 5.0, 1)
    assert np.ptp(s.pair("wrist"), axis=0).max() < 0.02


def test_a_limp_spares_one_leg() -> None:
    """The sore leg is on the floor for a shorter time (Perry and Burnfield 2010): the other one swings shortly."""
    motion = SOURCE("limp", 8.0, 0)
    assert motion.contacts is not None
    stance = motion.contacts.mean(axis=0)
    assert abs(stance[0] - stance[1]) > 0.08


def test_speed_over_the_floor_is_kept() -> None:
    for action in ("limp", "march"):
        s = signals(action, 6.0, 0, Manner(speed_mps=0.6))
        assert s.path / s.duration == pytest.approx(0.6, rel=0.1)


def test_steps_a_minute_are_counted() -> None:
    s = signals("march_in_place", 10.0, 0, Manner(rate=100.0))
    lifts = np.sum(np.diff((s.thigh_elevation > 45.0).astype(int), axis=0) == 1)
    assert 60.0 * lifts / s.duration == pytest.approx(100.0, abs=10.0)
