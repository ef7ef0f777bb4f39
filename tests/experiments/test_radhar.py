"""The RadHAR experiment's parts: takes, features, and a simulated cloud in the recordings' own axes."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from experiments.radhar.chain_fit import moving_against_range
from experiments.radhar.classify import classifiers, evaluate, window_set
from experiments.radhar.clouds import noisy, simulated_clouds
from experiments.radhar.features import FEATURES, WINDOW_FRAMES, window_features
from experiments.radhar.recordings import CloudRecording
from experiments.radhar.synthesis import ACTIVITIES, PLACEMENTS, radhar_radar, takes
from rfgen_sionna.signal.noise import noise_power


def swing(activity: str, number: int, frames: int = 3 * WINDOW_FRAMES) -> CloudRecording:
    """Points that move to and fro, at a rate that the activity has."""
    rng = np.random.default_rng(number)
    time = np.arange(frames) / 27
    rate = 0.5 + 0.6 * ACTIVITIES.index(activity)
    doppler = np.round(3 * np.sin(2 * np.pi * rate * time + rng.uniform(0, 6)) + 0.3 * rng.normal(size=frames))
    position = np.column_stack([np.full(frames, 2.0), 0.1 * rng.normal(size=frames), 0.1 * rng.normal(size=frames)])
    distance = np.linalg.norm(position, axis=1)
    return CloudRecording(
        activity, f"{activity}-{number}", np.arange(frames), doppler.astype(int), position, distance, distance, frames
    )


def test_features_of_a_window_do_not_depend_on_the_others() -> None:
    item = swing("walk", 0)
    features = window_features(item, WINDOW_FRAMES)
    assert features.shape == (3, FEATURES)
    later = item.frame >= WINDOW_FRAMES
    cut = CloudRecording(
        item.activity, item.name, item.frame[later] - WINDOW_FRAMES, item.doppler[later], item.position[later],
        item.distance[later], item.intensity[later], item.frames - WINDOW_FRAMES,
    )  # fmt: skip
    np.testing.assert_allclose(window_features(cut, WINDOW_FRAMES), features[1:])


def test_features_do_not_see_levels_or_what_stands() -> None:
    item = swing("boxing", 1)
    louder = replace(item, intensity=item.intensity + 20)
    np.testing.assert_array_equal(window_features(louder), window_features(item))
    still = item.doppler == 0
    moved = replace(item, position=np.where(still[:, None], item.position + 3, item.position))
    np.testing.assert_array_equal(window_features(moved), window_features(item))


def test_an_empty_window_has_finite_features() -> None:
    item = replace(swing("jump", 0), doppler=np.zeros(3 * WINDOW_FRAMES, int))
    assert np.all(np.isfinite(window_features(item)))


def test_takes_are_balanced_and_do_not_depend_on_their_number() -> None:
    few, many = list(takes(2)), list(takes(9))
    assert many[: len(few)] == few
    assert [take.activity for take in few] == list(ACTIVITIES) * 2
    assert {(take.height_m, take.tilt_deg) for take in many} == set(PLACEMENTS[:3])


def test_moving_points_are_counted_at_their_range() -> None:
    frames = 200
    distance = np.repeat(np.linspace(0.7, 2.9, frames), 2)
    item = CloudRecording(
        "walk", "way", np.repeat(np.arange(frames), 2), np.ones(2 * frames, int), np.zeros((2 * frames, 3)), distance,
        distance, frames,
    )  # fmt: skip
    assert moving_against_range([item]) == [2.0] * 6


def test_a_simulated_cloud_has_the_axes_of_the_recordings(tmp_path: Path) -> None:
    radar = radhar_radar()
    samples = np.arange(240)
    beat = np.exp(2j * np.pi * 40 / 256 * samples)  # range bin 40
    shape = radar.frame_shape
    tone = np.broadcast_to(beat, (3, *shape)) * 30 * np.sqrt(noise_power(radar))
    np.save(tmp_path / "walk-000.npy", tone.astype(np.complex64))
    np.save(tmp_path / "room-000.npy", np.zeros(shape, np.complex64))
    (cloud,) = simulated_clouds(tmp_path)
    assert (cloud.activity, cloud.name, cloud.frames) == ("walk", "walk-000", 3)
    assert np.median(cloud.distance) == pytest.approx(40 * radar.waveform.range_window / 256, abs=0.003)
    (room, *_), weak = simulated_clouds(tmp_path), simulated_clouds(tmp_path, loss_db=10)[0]
    assert room.intensity.max() - weak.intensity.max() == pytest.approx(5.0, abs=0.3)  # of amplitudes
    with pytest.raises(FileNotFoundError, match="no room"):
        simulated_clouds(tmp_path / "elsewhere")


def test_noise_is_that_of_the_receiver() -> None:
    radar = radhar_radar()
    cube = noisy(np.zeros((2, *radar.frame_shape), np.complex64), radar, 1)
    assert np.mean(np.abs(cube) ** 2) == pytest.approx(noise_power(radar), rel=0.02)


@pytest.mark.slow
def test_classifiers_tell_rates_apart() -> None:
    pytest.importorskip("sklearn")
    real = window_set([swing(name, number) for name in ACTIVITIES for number in range(7)], 27)
    synthetic = window_set([swing(name, 50 + number) for name in ACTIVITIES for number in range(4)], 27)
    found = evaluate(real, synthetic, draws=1)
    for name in classifiers():
        assert found[name]["real to real"]["mean"] > 0.9
        assert found[name]["synthetic to real"] > 0.9
        assert np.trace(found[name]["confusion"]) == pytest.approx(len(real.features), rel=0.1)
