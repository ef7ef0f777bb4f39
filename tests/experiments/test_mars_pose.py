"""Joints from clouds: a network learns what the clouds hold, the same by the same seed, and nothing of the test."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from experiments.mars import pose
from experiments.mars.body import MarsPose
from experiments.mars.pose import errors, evaluate, training_sources
from experiments.mars.pose_frames import (
    FEET,
    JOINTS,
    MAX_POINTS,
    Augmentation,
    PoseFrames,
    chunks,
    every,
    first_minutes,
    pose_frames,
)
from experiments.mars.pose_network import TrainingPlan, estimate, train_network
from experiments.mars.recordings import MarsClouds, MarsMovement, write_clouds

PLAN = TrainingPlan(steps=150, runs=8, run_frames=12, kernel=5)


def swaying(seed: int, frames: int = 90, points: int = 20) -> PoseFrames:
    """A person that sways sideways and to the front; points lie about the joints and have their radial speed."""
    rng = np.random.default_rng(seed)
    time = np.arange(frames) * 0.1
    sway = np.column_stack([0.4 * np.sin(2 * time + rng.uniform(0, 6)), 0.3 * np.cos(1.3 * time), 0 * time])
    body = np.column_stack([np.linspace(-0.4, 0.4, JOINTS), np.full(JOINTS, 2.0), np.linspace(-0.9, 0.8, JOINTS)])
    share = np.linspace(0, 1, JOINTS)[:, None]  # feet stand, the head goes farthest
    joints = body + sway[:, None, :] * share
    which = rng.integers(JOINTS, size=(frames, points))
    position = np.take_along_axis(joints, which[..., None], 1) + 0.03 * rng.normal(size=(frames, points, 3))
    speed = np.gradient(joints[..., 1], 0.1, axis=0)
    doppler = np.take_along_axis(speed, which, 1)
    frame = np.repeat(np.arange(frames), points)
    return pose_frames(frame, position.reshape(-1, 3), doppler.ravel(), joints)


def test_points_go_to_their_frame_and_surplus_ones_are_dropped() -> None:
    rng = np.random.default_rng(0)
    frame = np.array([2] * (MAX_POINTS + 5) + [0])
    position = rng.normal(size=(len(frame), 3))
    frames = pose_frames(frame, position, np.arange(len(frame)), np.zeros((3, JOINTS, 3)))
    assert frames.present.sum(1).tolist() == [1, 0, MAX_POINTS]
    np.testing.assert_allclose(frames.points[2, :, :3], position[:MAX_POINTS], rtol=1e-6)
    np.testing.assert_allclose(frames.points[0, 0, :3], position[-1], rtol=1e-6)
    assert not frames.points[1].any()


def test_points_of_a_frame_without_joints_are_refused() -> None:
    with pytest.raises(ValueError, match="number them from 0"):
        pose_frames([0, 3], np.zeros((2, 3)), np.zeros(2), np.zeros((3, JOINTS, 3)))


def test_minutes_come_from_the_start_of_every_movement() -> None:
    movements = [swaying(0, 90), swaying(1, 60)]
    few = first_minutes(movements, 0.1)
    assert [len(part) for part in few] == [30, 30]
    assert torch.equal(few[1].joints, movements[1].joints[:30])
    with pytest.raises(ValueError, match="the shortest has 60"):
        first_minutes(movements, 0.5)


def test_every_second_frame_keeps_all_frames() -> None:
    movement = swaying(0, 9)
    parts = every([movement], 2)
    assert [len(part) for part in parts] == [5, 4]
    assert torch.equal(parts[1].joints, movement.joints[1::2])
    network = train_network([[movement]], 0, replace(PLAN, steps=1, run_frames=4))
    found = estimate(network, [movement], 2)[0]
    torch.testing.assert_close(found[1::2], estimate(network, [parts[1]])[0])


def runs_of(*seeds: int) -> PoseFrames:
    parts = [swaying(seed) for seed in seeds]
    return PoseFrames(
        *(torch.stack([getattr(part, name) for part in parts]) for name in ("points", "present", "joints"))
    )


def test_changed_runs_keep_points_at_the_joints() -> None:
    runs = runs_of(*range(8))
    changed = Augmentation(jitter_m=0, jitter_doppler=0)(runs, np.random.default_rng(1))
    assert not torch.allclose(changed.joints, runs.joints, atol=0.01)

    def nearest(item: PoseFrames) -> torch.Tensor:
        exact = "donot_use_mm_for_euclid_dist"
        return torch.cdist(item.points[..., :3], item.joints, compute_mode=exact).amin(-1)

    kept = changed.present
    assert 0.6 < kept.float().mean() / runs.present.float().mean() < 0.95
    assert torch.all(nearest(changed)[kept] <= 1.15 * nearest(runs)[kept] + 1e-5)
    assert not changed.points[~kept].any()
    # The feet keep their place but for the shift of the place
    moved = (changed.joints - runs.joints)[:, :, FEET].mean((1, 2))[:, 1:]
    assert torch.all(moved.abs() <= torch.tensor(Augmentation().shift_m[1:]) + 1e-4)


def test_a_mirrored_run_has_left_and_right_changed() -> None:
    only_mirror = Augmentation(dropped=0, jitter_m=0, jitter_doppler=0, shift_m=(0, 0, 0), size=0)
    runs = runs_of(*range(8))
    changed = only_mirror(runs, np.random.default_rng(0))
    mirrored = changed.joints[:, 0, 4, 0] != runs.joints[:, 0, 4, 0]
    assert 0 < mirrored.sum() < 8
    for number in range(8):
        sign, other = (-1, 8) if mirrored[number] else (1, 4)
        assert torch.equal(changed.joints[number, :, 4, 0], sign * runs.joints[number, :, other, 0])
        assert torch.equal(changed.points[number, ..., 0], sign * runs.points[number, ..., 0])


def test_the_network_beats_the_mean_pose_and_shuffled_frames_on_others() -> None:
    network = train_network([[swaying(seed) for seed in range(4)]], 0, PLAN)
    test = [swaying(seed) for seed in (10, 11)]
    result = errors(test, estimate(network, test), network.mean_pose)
    for name in ("S", "S about the root"):
        assert result[name] < 0.6 * min(result["controls"][name].values())
    assert result["mae"] < result["S"]


def test_a_training_is_decided_by_its_seed_alone() -> None:
    plan, source, test = replace(PLAN, steps=5), [[swaying(0)], [swaying(1)]], [swaying(2)]
    first = estimate(train_network(source, 3, plan), test)[0]
    torch.manual_seed(1)
    assert torch.equal(estimate(train_network(source, 3, plan), test)[0], first)
    assert not torch.equal(estimate(train_network(source, 4, plan), test)[0], first)


def test_estimates_are_causal_and_do_not_depend_on_the_order_of_points() -> None:
    network = train_network([[swaying(0)]], 0, replace(PLAN, steps=5))
    item = swaying(1)
    whole = estimate(network, [item])[0]
    torch.testing.assert_close(estimate(network, [item[:40]])[0], whole[:40])
    torch.testing.assert_close(
        estimate(network, [PoseFrames(item.points.flip(1), item.present.flip(1), item.joints)])[0], whole
    )


def test_with_a_kernel_of_one_the_order_of_earlier_frames_does_not_matter() -> None:
    network = train_network([[swaying(0)]], 0, replace(PLAN, steps=5, kernel=1))
    item = swaying(1, 20)
    other = item[torch.tensor([*range(18, -1, -1), 19])]
    torch.testing.assert_close(estimate(network, [other])[0][-1], estimate(network, [item])[0][-1])
    assert not torch.allclose(estimate(network, [item[19:]])[0][-1], estimate(network, [item])[0][-1])


def test_runs_are_of_one_movement_and_in_order() -> None:
    movements = [swaying(0, 40), swaying(1, 8), swaying(2, 30)]
    for number, movement in enumerate(movements):
        movement.joints[..., 0] = number
        movement.joints[..., 1] = torch.arange(len(movement))[:, None]
    for consecutive in (True, False):
        rng = np.random.default_rng(0)
        runs = chunks(movements, 30, 10, rng, consecutive=consecutive).joints[:, :, 0]
        assert set(runs[:, 0, 0].tolist()) == {0, 2}
        assert torch.all(runs[..., 0] == runs[:, :1, 0])
        steps = runs[:, 1:, 1] - runs[:, :-1, 1]
        assert torch.all(steps > 0)
        assert bool(torch.all(steps == 1)) == consecutive


def test_the_same_person_is_not_trained_on_and_tested() -> None:
    person = [swaying(0)]
    with pytest.raises(ValueError, match=r"subjects \[2\] are trained on and tested"):
        evaluate({1: person}, {2: person}, {2: person}, [0], PLAN)


def test_the_table_has_every_source_and_its_ratio() -> None:
    train, simulated, test = [swaying(0, 1300)], [swaying(1)], [swaying(2)]
    names = list(training_sources(train, simulated))
    assert names == [
        "real", "real 0.5 min", "real 1 min", "real 2 min", "synthetic",
        "synthetic and 0.5 min", "synthetic and 1 min", "synthetic and 2 min", "synthetic and real",
    ]  # fmt: skip
    table = evaluate({2: train}, {2: simulated}, {3: test}, [0, 1], replace(PLAN, steps=2, kernel=1))["3"]
    ratios = table.pop("S over that of real")
    names.insert(1, "real, 9 frames at a time")
    assert list(table) == names
    assert ratios["synthetic"] == pytest.approx(table["synthetic"]["S"]["mean"] / table["real"]["S"]["mean"])


def movement_of(subject: int, movement: int, rows: int) -> MarsMovement:
    """A swaying person as a recording, the Kinect 0.2 m to the left of the radar."""
    frames = swaying(100 * subject + movement, rows)
    frame, point = torch.nonzero(frames.present, as_tuple=True)
    values = frames.points[frame, point].numpy().astype(np.float64)
    clouds = MarsClouds(np.arange(rows), frame.numpy(), values[:, :3], values[:, 3], np.ones(len(values)))
    joints = frames.joints.numpy().astype(np.float64) + np.array([0.2, 0, 0])
    names = tuple(map(str, range(JOINTS)))
    number, part = np.arange(rows), np.full(rows, "train")
    return MarsMovement(subject, movement, clouds, joints, names, number, number * np.float64(0.1), part)


def test_the_program_pairs_simulated_frames_with_their_joints(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    recorded = {subject: [movement_of(subject, number, 600) for number in (1, 2)] for subject in (2, 3)}
    monkeypatch.setattr(pose, "read_subject", lambda data, subject: recorded[subject])
    radar = MarsPose(**dict.fromkeys(MarsPose.__dataclass_fields__, 0.0) | {"lateral_m": 0.2})
    (tmp_path / "pose.json").write_text(json.dumps({"pose": vars(radar)}))
    for movements in recorded.values():
        for movement in movements:
            write_clouds(tmp_path / f"{movement.name}.npz", movement.clouds.at_rows(np.arange(3, 600, 8)))
    simulated = pose.read_people(tmp_path, [2], radar, [tmp_path])[2][0]
    real = pose.read_people(tmp_path, [2], radar)[2][0]
    assert torch.equal(simulated.joints, real.joints[3::8])
    assert torch.equal(simulated.points, real.points[3::8])

    arguments = ["--data", str(tmp_path), "--synthetic", str(tmp_path), "--pose", str(tmp_path / "pose.json")]
    output = tmp_path / "joints.json"
    pose.main([*arguments, "--output", str(output), "--steps", "2", "--seeds", "1"])
    report = json.loads(output.read_text())
    assert set(report["unseen people"]) == {"2", "3"}
    assert report["frames"] == {"real": {"2": 1200, "3": 1200}, "synthetic": {"2": 150, "3": 150}}
    with pytest.raises(SystemExit):
        pose.main([*arguments, "--output", str(output), "--subjects", "2"])
