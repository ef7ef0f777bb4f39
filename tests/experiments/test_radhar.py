"""The RadHAR experiment's parts: takes, features, and a simulated cloud in the recordings' own axes."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from experiments.radhar.chain_fit import levels, moving_against_range
from experiments.radhar.classify import CLASSIFIERS, drawn_recordings, evaluate, share_right, trained_on, window_set
from experiments.radhar.clouds import FOLDER_OF_ACTION, Surroundings, noisy, simulated_clouds
from experiments.radhar.features import FEATURES, WINDOW_FRAMES, window_features
from experiments.radhar.network import CHANNELS, NetworkVote, window_counts
from experiments.radhar.recordings import ACTIVITIES, CloudRecording, from_board_points, read_part
from experiments.radhar.surroundings import HEIGHT_M, floor_clutter, radhar_radar
from rfgen_sionna.generative import read_prompt
from rfgen_sionna.processing.boards import OutOfBoxChain, out_of_box_points
from rfgen_sionna.recipes import Recipe, build_dataset
from rfgen_sionna.signal.noise import noise_power

RECIPE = Path(__file__).parents[2] / "experiments" / "radhar" / "recipe.toml"


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


def test_the_recipe_has_as_many_recordings_of_each_activity() -> None:
    recipe = Recipe.load(RECIPE)
    found = [FOLDER_OF_ACTION[read_prompt(spec.sources[0].text, seed=0).action] for spec in recipe]
    assert {found.count(name) for name in ACTIVITIES} == {len(found) // len(ACTIVITIES)}
    assert recipe.recording(0).radars[0].position_m == (0.0, 0.0, HEIGHT_M)


def test_counts_have_every_moving_point_in_each_projection() -> None:
    item = swing("jack", 3)
    counts = window_counts(item, WINDOW_FRAMES)
    assert counts.shape == (3, WINDOW_FRAMES, CHANNELS)
    assert counts.sum() == 4 * item.moving.sum()  # range, height, side and Doppler


def test_moving_points_are_counted_at_their_range() -> None:
    frames = 200
    distance = np.repeat(np.linspace(0.7, 2.9, frames), 2)
    item = CloudRecording(
        "walk", "way", np.repeat(np.arange(frames), 2), np.ones(2 * frames, int), np.zeros((2 * frames, 3)), distance,
        distance, frames,
    )  # fmt: skip
    assert moving_against_range([item]) == [2.0] * 6


def test_the_floor_hides_weak_points_behind_it() -> None:
    radar = radhar_radar()
    floor = np.broadcast_to(floor_clutter(radar, 3), (16, *radar.frame_shape))
    along, samples = np.arange(16)[:, None, None, None], np.arange(240)

    def seen(number: int, words_db: float) -> float:
        """Share of frames in which a mover of Doppler bin 1 is seen at a range bin."""
        tone = np.exp(2j * np.pi * (number / 256 * samples + along / 16))
        amplitude = 10 ** (words_db / 10) / 25 * OutOfBoxChain().step  # a range bin has a quarter of Blackman's sum
        points = out_of_box_points(noisy(floor + amplitude * tone, radar, 1), radar)
        return len(np.unique(points.frame[(points.range_bin == number) & (points.doppler_bin == 1)])) / 16

    assert seen(24, 21.5) > 0.9 > 0.1 > seen(46, 21.5)  # 0.98 m and 1.88 m, before and behind the floor's 1.31 m
    assert seen(46, 29.0) > 0.9


def test_levels_leave_out_what_stands_still() -> None:
    frames = 200
    place = np.tile([1.88, 1.0], frames)
    level = np.where(place > 1.5, 30.0, np.random.default_rng(0).normal(25.0, 2.0, 2 * frames))
    item = CloudRecording(
        "walk", "still", np.repeat(np.arange(frames), 2), np.zeros(2 * frames, int), np.zeros((2 * frames, 3)), place,
        level, frames,
    )  # fmt: skip
    found = levels([item])["bin 0"]
    assert found[3] == [None] * 3
    assert found[1][1] == pytest.approx(25.0, abs=0.5)


def test_points_come_in_the_axes_of_the_recordings() -> None:
    radar = radhar_radar()
    left = np.exp(-1j * np.pi * np.arange(8) * 0.5).reshape(2, 4)  # sine of azimuth 0.5
    channels = np.ones((3, 4), complex)
    channels[0], channels[2] = left
    tone = channels[:, :, None] * np.exp(2j * np.pi * 40 / 256 * np.arange(240))
    cube = np.broadcast_to(tone * 30 * np.sqrt(noise_power(radar)), (2, *radar.frame_shape))
    points = out_of_box_points(noisy(cube, radar, 0), radar)
    cloud = from_board_points(points, "walk", "0")
    np.testing.assert_allclose(cloud.position, points.position * [1, -1, 1])
    assert np.median(cloud.distance) == pytest.approx(40 * radar.waveform.range_window / 256, abs=0.02)
    assert cloud.intensity.max() == pytest.approx(10 * np.log10(points.peak.max() + 1))


@pytest.mark.slow
def test_a_set_becomes_clouds(tmp_path: Path) -> None:
    text = RECIPE.read_text().replace("count = 30", "count = 2").replace("duration_s = 2.1", "duration_s = 0.2")
    (tmp_path / "recipe.toml").write_text(text)
    build_dataset(tmp_path / "recipe.toml", tmp_path / "set", workers=1)
    np.save(tmp_path / "room-000.npy", np.zeros(radhar_radar().frame_shape, np.complex64))
    clouds = simulated_clouds(tmp_path / "set", Surroundings(tmp_path), repeats=2)
    assert [cloud.activity for cloud in clouds] == ["boxing", "boxing", "jack", "jack"]
    assert all(cloud.frames == 5 for cloud in clouds)
    (alone,) = simulated_clouds(tmp_path / "set", Surroundings(loss_db=(0.0, 0.0)), numbers=[0])
    assert np.median(alone.intensity) > np.median(clouds[0].intensity)
    with pytest.raises(FileNotFoundError, match="no room"):
        simulated_clouds(tmp_path / "set", Surroundings(tmp_path / "elsewhere"))


def test_noise_is_that_of_the_receiver() -> None:
    radar = radhar_radar()
    cube = noisy(np.zeros((2, *radar.frame_shape), np.complex64), radar, 1)
    assert np.mean(np.abs(cube) ** 2) == pytest.approx(noise_power(radar), rel=0.02)


def test_draws_have_as_many_recordings_of_each_activity() -> None:
    windows = window_set([swing(name, number) for name in ACTIVITIES for number in range(4)], 27)
    drawn, others = drawn_recordings(windows, 1, 0, first=2)
    assert [list(drawn.activity).count(name) for name in ACTIVITIES] == [2] * 5
    assert len(np.unique(drawn.recording)) == 5
    assert not set(drawn.recording) & set(others.recording)
    assert len(np.unique(others.recording)) == 15
    again, _ = drawn_recordings(windows, 1, 0)
    assert set(again.recording) == set(drawn.recording)


@pytest.mark.slow
@pytest.mark.parametrize("name", CLASSIFIERS)
def test_classifiers_tell_rates_apart(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("sklearn")
    monkeypatch.setattr(NetworkVote.train, "__defaults__", (100,))
    real = window_set([swing(name, number) for name in ACTIVITIES for number in range(7)], 27)
    synthetic = window_set([swing(name, 50 + number) for name in ACTIVITIES for number in range(4)], 9)
    found = evaluate(name, real, synthetic, draws=1)
    assert found["real to real"]["mean"] > 0.9
    assert found["synthetic to real"] > 0.9
    assert np.sum(found["confusion"]) == len(real.activity)
    assert np.trace(found["confusion"]) == pytest.approx(found["synthetic to real"] * len(real.activity))
    first, again = (trained_on(name, synthetic, None, 3)(real) for _ in range(2))
    np.testing.assert_array_equal(first, again)
    assert share_right(trained_on(name, synthetic, real, 0), real) > 0.9


def test_another_part_is_tested_alone(tmp_path: Path) -> None:
    pytest.importorskip("sklearn")
    for name in ACTIVITIES:
        for number in range(2):
            item = swing(name, 80 + number)
            folder = tmp_path / "radhar" / "Test" / name
            folder.mkdir(parents=True, exist_ok=True)
            np.savez(
                folder / f"{number}.npz", point_id=np.zeros(item.frames, int), xyz=item.position,
                dbin=item.doppler + 8, intensity=item.intensity,
            )  # fmt: skip
    test = window_set(read_part(tmp_path, "Test"), 27)
    real = window_set([swing(name, number) for name in ACTIVITIES for number in range(5)], 27)
    found = evaluate("logistic regression", real, real, 1, test)
    assert np.sum(found["confusion"]) == len(test.activity) == 50
    assert found["real to real"]["mean"] == found["synthetic to real"]


def test_a_part_that_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match="part Test is needed"):
        read_part(tmp_path, "Test")
