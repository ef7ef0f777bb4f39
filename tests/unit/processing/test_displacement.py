"""Breathing at rest: millimetres in the phase of one range bin."""

from collections.abc import Callable

import numpy as np
import pytest

from rfgen_sionna.processing import displacement
from rfgen_sionna.radar import Radar

RATE, AMPLITUDE, FRAMES = 0.27, 4e-3, 240


@pytest.fixture(scope="module")
def radar() -> Radar:
    return Radar.load("awr1843", overrides={"preset.mmmesh.num_loops": 2, "preset.mmmesh.num_samples": 64})


def recording(radar: Radar, synthesise: Callable[..., np.ndarray], moved: np.ndarray) -> np.ndarray:
    """A chest at 1.2 m that moves by `moved` [m], before a wall at 3.5 m, with noise."""
    frames = [
        synthesise(radar, [((1.2 + shift, 0.2, 0), (0, 0, 0), 1.0), ((3.5, -1, 0), (0, 0, 0), 4.0)], noise=0.2, seed=n)
        for n, shift in enumerate(moved)
    ]
    return np.concatenate(frames)


def breath(radar: Radar) -> np.ndarray:
    return AMPLITUDE * np.sin(2 * np.pi * RATE * radar.waveform.frame_period * np.arange(FRAMES))


def test_a_chest_is_followed_to_a_tenth_of_a_millimetre(radar: Radar, synthesise: Callable[..., np.ndarray]) -> None:
    moved = breath(radar)
    found = displacement(recording(radar, synthesise, moved), radar)
    assert found.range == pytest.approx(np.hypot(1.2, 0.2), abs=0.5 * radar.range_resolution)
    radial = moved * 1.2 / np.hypot(1.2, 0.2)
    assert found.displacement == pytest.approx(radial - radial.mean(), abs=1.5e-4)
    assert found.rate() == pytest.approx(RATE, abs=0.005)
    assert found.scale_error < 0.1


def test_frames_at_uneven_times_keep_theirs(radar: Radar, synthesise: Callable[..., np.ndarray]) -> None:
    cube = recording(radar, synthesise, breath(radar)[:40])
    times = 5.0 + radar.waveform.frame_period * np.arange(40)
    assert displacement(cube, radar, frame_times=times).time[0] == pytest.approx(5.0, abs=0.01)


@pytest.mark.parametrize(
    ("frames", "options", "message"),
    [
        (4, {}, "at least 8"),
        (20, {"range_limits": (50.0, 60.0)}, "range_limits"),
        (20, {"frame_times": np.arange(3.0)}, "frame_times"),
    ],
)
def test_bad_input_is_refused(radar: Radar, frames: int, options: dict, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        displacement(np.ones((frames, *radar.frame_shape), np.complex64), radar, **options)


def test_a_run_shorter_than_a_breath_has_no_rate(radar: Radar, synthesise: Callable[..., np.ndarray]) -> None:
    found = displacement(recording(radar, synthesise, breath(radar)[:20]), radar)
    with pytest.raises(ValueError, match="less than a period"):
        found.rate()
    with pytest.raises(ValueError, match="low"):
        found.rate(low=2.0, high=1.0)


def test_a_short_arc_has_a_rate_and_an_uncertain_scale(radar: Radar, synthesise: Callable[..., np.ndarray]) -> None:
    with pytest.warns(UserWarning, match="scale is uncertain"):
        found = displacement(recording(radar, synthesise, 0.01 * breath(radar)), radar)
    assert found.scale_error > 0.1
    assert found.rate() == pytest.approx(RATE, abs=0.01)


def test_a_heart_is_found_beside_the_harmonics_of_breathing(
    radar: Radar, synthesise: Callable[..., np.ndarray]
) -> None:
    t = radar.waveform.frame_period * np.arange(FRAMES)
    breathing = AMPLITUDE * sum(np.sin(2 * np.pi * k * RATE * t) / k**2 for k in (1, 2, 3, 4))
    found = displacement(recording(radar, synthesise, breathing + 1e-4 * np.sin(2 * np.pi * 1.2 * t)), radar)
    assert abs(found.rate(0.7, 2.0) - 1.2) > 0.1
    assert found.rate(0.7, 2.0, without=found.rate()) == pytest.approx(1.2, abs=0.01)
