"""The MARS experiment's parts: reader, clocks, stick figure, clouds; `--data FOLDER` adds the recordings themselves."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest

from experiments.mars.body import MarsPose, frame_times, joint_track, pose_record, read_pose, to_world
from experiments.mars.clouds import clouds_of
from experiments.mars.compare import (
    PREDICTORS,
    against_targets,
    cloud_figures,
    compared_movement,
    figures,
    pooled_clouds,
)
from experiments.mars.courses import BONES, StickFigure, bone_courses, course_of_clouds
from experiments.mars.fit import fitted_lag, fitted_levels, fitted_range
from experiments.mars.recordings import (
    RANGE_STEP,
    VELOCITY_STEP,
    MarsClouds,
    MarsMovement,
    part_lengths,
    read_clouds,
    read_subject,
    subjects,
    write_clouds,
)
from experiments.mars.synthesis import simulate
from rfgen_sionna.evaluation.doppler_course import correlation
from rfgen_sionna.generative.motion import KinematicSource
from rfgen_sionna.generative.motion.joint_layouts import LAYOUTS
from rfgen_sionna.generative.motion.rotations import to_matrices
from rfgen_sionna.generative.motion.skeleton import JOINT_NAMES, forward_kinematics, global_rotations
from rfgen_sionna.signal.noise import noise_power

POSE = MarsPose(0.0, 0.2, 0.0, 0.0, 0.0, 0.0, -26.0)
NAMES = LAYOUTS["kinect_v2"]


def write_subject(folder: Path, lengths: dict[int, int], subject: int = 7) -> dict[int, np.ndarray]:
    """A person in MARS's layout, one to three points a frame; joints (frame, 25, 3) of each movement, counting up."""
    place = folder / "mars" / f"subject{subject}"
    (place / "timesplit").mkdir(parents=True)
    rows: dict[str, list[np.ndarray]] = {"train": [], "validate": [], "test": []}
    joints = {}
    for number, frames in lengths.items():
        joints[number] = np.arange(frames * 75, dtype=float).reshape(frames, 25, 3) + 1000 * number
        columns = np.moveaxis(joints[number], 2, 1).reshape(frames, 75)
        first, second, _ = part_lengths(frames)
        for part, block in zip(rows, np.split(columns, [first, first + second]), strict=True):
            rows[part].append(block)
        frame = np.repeat(np.arange(frames), np.arange(frames) % 3 + 1)
        table = np.zeros((len(frame), 8))
        table[:, 0] = 100 * number + 2 * frame
        table[:, 2:5] = [0.1, 2.0, -0.1]
        table[:, 5], table[:, 6], table[:, 7] = VELOCITY_STEP, 10.0, 1e9 + 0.2 * frame
        with h5py.File(place / f"radar_data{number}.mat", "w") as stored:
            stored["radar_data_cropped"] = table.T
    header = ",".join(f"{name}_{axis}" for axis in "XYZ" for name in NAMES)
    for part, blocks in rows.items():
        np.savetxt(
            place / "timesplit" / f"kinect_data_{part}.csv",
            np.concatenate(blocks),
            "%.6f",
            ",",
            header=header,
            comments="",
        )
    return joints


def acted(action: str = "sit_and_stand", duration: float = 8.0) -> MarsMovement:
    """A movement by rules, in the data's axes at 2 m, with the points of the left forearm's and the belly's middles."""
    motion = KinematicSource(10.0)(action, duration, 1)
    world = global_rotations(to_matrices(motion.rotations), motion.parents)
    place = forward_kinematics(world, motion.translation, motion.offsets, motion.parents)[:, :22]
    facing = place * [-1.0, -1.0, 1.0] + [2.2, -0.2, -0.9]  # to the radar
    count = len(facing)
    joints = np.stack([-facing[..., 1], facing[..., 0], facing[..., 2]], axis=-1)
    nothing = MarsClouds(np.arange(count), *(np.empty(0, int), np.empty((0, 3)), np.empty(0), np.empty(0)))
    number = np.arange(count) + 50
    item = MarsMovement(
        3,
        6,
        nothing,
        joints,
        JOINT_NAMES[:22],
        number,
        np.asarray(1e9 + 0.1 * number, np.float64),
        np.full(count, "train"),
    )
    velocity, distance = bone_courses(item, POSE, np.arange(count))
    chosen = [list(BONES).index("forearm"), list(BONES).index("thigh")]
    points = velocity[:, chosen].reshape(count, -1), distance[:, chosen].reshape(count, -1)
    xyz = np.zeros((4 * count, 3))
    xyz[:, 1] = points[1].ravel()
    clouds = MarsClouds(
        np.arange(count), np.repeat(np.arange(count), 4), xyz, points[0].ravel(), np.tile([3.0, 3.0, 1.0, 1.0], count)
    )
    return replace(item, clouds=clouds)


def test_radar_frames_pair_with_joints(tmp_path: Path) -> None:
    joints = write_subject(tmp_path, {2: 11, 10: 7})
    assert subjects(tmp_path) == [7]
    found = read_subject(tmp_path, 7)
    assert [(item.name, len(item.number)) for item in found] == [("subject7-02", 11), ("subject7-10", 7)]
    for item in found:
        np.testing.assert_allclose(item.joints, joints[item.movement])
        assert item.names == NAMES
        np.testing.assert_array_equal(item.clouds.counts, np.arange(len(item.number)) % 3 + 1)
        np.testing.assert_allclose(frame_times(item), 0.2 * np.arange(len(item.number)))
    assert [int((found[0].part == part).sum()) for part in ("train", "validate", "test")] == [7, 3, 1]


def test_part_lengths_are_ceilings() -> None:
    assert part_lengths(10) == (6, 2, 2)
    assert part_lengths(11) == (7, 3, 1)
    assert part_lengths(1325) == (795, 265, 265)
    assert part_lengths(1) == (1, 0, 0)


def test_what_does_not_pair_is_refused(tmp_path: Path) -> None:
    write_subject(tmp_path, {1: 10, 2: 12, 3: 9})
    (tmp_path / "mars" / "subject7" / "radar_data2.mat").unlink()
    with pytest.raises(ValueError, match=r"kinect_data_train.csv has 20 rows, .* 1, 3 have 12 frames.*do not pair"):
        read_subject(tmp_path, 7)


def test_other_files_are_refused(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match="SizheAn/MARS"):
        subjects(tmp_path)
    with pytest.raises(FileNotFoundError, match="SizheAn/MARS"):
        read_subject(tmp_path, 1)
    write_subject(tmp_path, {1: 10})
    file = tmp_path / "mars" / "subject7" / "radar_data1.mat"
    with h5py.File(file, "a") as stored:
        table = np.asarray(stored["radar_data_cropped"])
        del stored["radar_data_cropped"]
        stored["other"] = table
    with pytest.raises(ValueError, match="no 'radar_data_cropped' in it, only other"):
        read_subject(tmp_path, 7)
    with h5py.File(file, "w") as stored:
        stored["radar_data_cropped"] = table[:, ::-1]
    with pytest.raises(ValueError, match="followed by an earlier"):
        read_subject(tmp_path, 7)
    file.write_bytes(b"MATLAB 5.0 MAT-file")
    with pytest.raises(ValueError, match="no HDF5 file"):
        read_subject(tmp_path, 7)


def test_clouds_are_kept_and_chosen_by_row(tmp_path: Path) -> None:
    clouds = acted().clouds
    some = clouds.at_rows(np.array([3, 4, 9]))
    assert some.row.tolist() == [3, 4, 9]
    assert some.counts.tolist() == [4, 4, 4]
    np.testing.assert_array_equal(some.doppler[4:8], clouds.doppler[16:20])
    write_clouds(tmp_path / "some.npz", some)
    again = read_clouds(tmp_path / "some.npz")
    for name, values in vars(some).items():
        np.testing.assert_array_equal(getattr(again, name), values)


def test_joints_are_on_the_radars_clock() -> None:
    item = acted()
    late = item.stamp.copy()
    late[20] += 0.04
    late[30] = late[29]  # the host got two frames at once
    times, joints = joint_track(replace(item, stamp=late))
    assert len(times) == len(late) - 1
    assert times[20] == pytest.approx(2.04, abs=1e-5)
    np.testing.assert_allclose(joints[:30], to_world(item.joints[:30]))
    assert np.all(np.diff(times) > 0)


def test_a_pose_is_kept(tmp_path: Path) -> None:
    import json

    pose = MarsPose(-0.1, 0.2, 0.03, 8.0, -0.02, 9.5, -3.0)
    file = tmp_path / "pose.json"
    file.write_text(json.dumps({"pose": pose_record(pose)}))
    assert read_pose(file) == pose
    radar = pose.radar()
    assert radar.position == pytest.approx((0.0, -0.2, -0.1))
    np.testing.assert_allclose(radar.rotation, np.eye(3), atol=1e-12)
    up = np.radians([8.0, 22.0])
    gain = radar.pattern.gain_db(np.stack([np.cos(up), 0 * up, np.sin(up)], axis=1))
    np.testing.assert_allclose(gain - radar.pattern.peak_gain_dbi, [0.0, -3.0], atol=1e-6)


def test_the_radar_has_the_steps_of_the_data() -> None:
    wave = POSE.radar().waveform
    assert wave.range_window / 256 == pytest.approx(RANGE_STEP, rel=1e-3)  # TI counts with 3e8 m/s
    np.testing.assert_allclose(VELOCITY_STEP, 0.356003645, rtol=1e-6)
    assert 3e8 / (2 * wave.start_frequency * wave.num_loops * wave.loop_period) == pytest.approx(VELOCITY_STEP)


def test_the_stick_figure_finds_the_bones_that_the_points_are_on() -> None:
    item = acted()
    figure = StickFigure.fit([item], POSE)
    weights = dict(zip(BONES, figure.weights, strict=True))
    assert weights["forearm"] == pytest.approx(0.75, abs=0.02)
    assert weights["thigh"] == pytest.approx(0.25, abs=0.02)
    course, seen = figure.course(item, POSE, item.clouds.row), course_of_clouds(item.clouds)
    np.testing.assert_allclose(course.doppler.centroid, seen.doppler.centroid, atol=0.02)
    np.testing.assert_allclose(course.doppler.spread, seen.doppler.spread, atol=0.05)
    still = replace(item, clouds=replace(item.clouds, doppler=0 * item.clouds.doppler))
    with pytest.raises(ValueError, match="do not pair"):
        StickFigure.fit([still], POSE)


def test_the_lag_of_the_clocks_is_found() -> None:
    item = acted()
    lags = fitted_lag([replace(item, stamp=item.stamp)], POSE)
    assert max(lags, key=lambda lag: lags[lag]) == 0.0


def test_a_simulated_point_is_where_the_data_would_have_it() -> None:
    radar = POSE.radar()
    samples, chirps = np.arange(160), np.arange(16)
    beat = np.exp(2j * np.pi * (68 / 256 * samples + 3 / 16 * chirps[:, None, None, None]))
    slots = np.exp(2j * np.pi * 3 / 16 * np.array([0, 2, 1])[:, None, None] / 3)  # slots TX1, TX3, TX2
    cube = np.broadcast_to(slots * beat, (2, *radar.frame_shape)) * 30 * np.sqrt(noise_power(radar))
    clouds = clouds_of(np.array([4, 8]), cube.astype(np.complex64), POSE)
    strongest = clouds.intensity > 0.9 * clouds.intensity.max()
    assert set(clouds.frame[strongest]) == {0, 1}
    assert np.median(clouds.distance[strongest]) == pytest.approx(68 * RANGE_STEP, abs=0.003)
    np.testing.assert_allclose(np.abs(clouds.doppler[strongest]), 3 * VELOCITY_STEP)
    assert np.abs(clouds.xyz[strongest, 0]).max() < 0.07
    louder = clouds_of(np.array([4, 8]), cube.astype(np.complex64), replace(POSE, gain_db=6.0))
    assert 20 * np.log10(louder.intensity.max() / clouds.intensity.max()) == pytest.approx(6.0, abs=0.2)


def test_levels_and_range_are_found_again() -> None:
    rng = np.random.default_rng(0)
    true = replace(POSE, gain_db=4.0, full_scale_dbm=-12.0)
    shape = POSE.radar().frame_shape
    chirps, samples = np.arange(shape[0])[:, None, None, None], np.arange(shape[-1])
    cubes = np.zeros((12, *shape), np.complex64)
    for cube in cubes:
        for power in 10 ** rng.uniform(-1.0, 2.5, 30):
            turns = rng.uniform(45, 85) / 256 * samples + rng.integers(-3, 4) / 16 * chirps
            cube += np.sqrt(power * noise_power(POSE.radar())) * np.exp(2j * np.pi * (turns + rng.uniform()))
    rows = np.arange(12)
    seen = clouds_of(rows, cubes, true, seed=7)
    nearer = replace(seen, xyz=seen.xyz * (1 - 0.1 / seen.distance[:, None]))
    item = replace(acted().cut(0, 12), clouds=nearer)
    pose, errors = fitted_range([(item, rows, cubes)], fitted_levels([(item, rows, cubes)], POSE, rounds=6))
    assert pose.full_scale_dbm == pytest.approx(true.full_scale_dbm, abs=1.5)
    assert pose.gain_db == pytest.approx(true.gain_db, abs=1.5)
    assert pose.range_bias_m == pytest.approx(-0.1, abs=0.02)
    assert errors.points == pytest.approx(1.0, abs=0.1)
    assert errors.centroid_rms < 0.1
    assert errors.range_rms < 0.1


def test_figures_of_a_perfect_prediction_and_of_its_controls() -> None:
    item = acted()
    figure = StickFigure.fit([item], POSE).course(item, POSE, item.clouds.row)
    found = [compared_movement(item, item.clouds, figure)]
    everything = figures(found)
    assert set(everything) == {"frames", *PREDICTORS}
    best, shifted = everything["simulated"], everything["simulated, shifted"]
    assert best["centroid rms [m/s]"] == best["range rms [m]"] == 0.0
    assert best["slope of recorded on simulated"] == pytest.approx(1.0)
    assert best["spread, simulated over recorded"] == pytest.approx(1.0)
    assert best["range correlation"] == pytest.approx(1.0)
    assert shifted["centroid rms [m/s]"] > 0.05
    clouds = cloud_figures(found)
    assert clouds["Doppler histogram, total variation"] == 0.0
    targets = against_targets({"all": everything, "clouds": clouds})
    assert targets["centroid rms [m/s]"]["met"]
    assert not targets["centroid correlation over the stick figure's"]["met"]


def test_bodies_are_pooled_at_the_same_rows() -> None:
    item = acted()
    quick = replace(item.clouds, doppler=item.clouds.doppler + 1.0)
    both = pooled_clouds([item.clouds, quick])
    np.testing.assert_array_equal(both.counts, 2 * item.clouds.counts)
    one, pooled = course_of_clouds(item.clouds), course_of_clouds(both)
    np.testing.assert_allclose(pooled.doppler.centroid, one.doppler.centroid + 0.5)
    figure = StickFigure.fit([item], POSE).course(item, POSE, item.clouds.row)
    found = figures([compared_movement(item, item.clouds, figure, [quick])])
    assert found["one simulated body on another, centroid correlation"] == pytest.approx(1.0)
    assert found["simulated bodies together"]["centroid rms [m/s]"] == pytest.approx(0.5)
    with pytest.raises(ValueError, match="other rows"):
        pooled_clouds([item.clouds, item.clouds.at_rows(np.arange(5))])


@pytest.mark.parametrize("subject", [2, 3])
def test_the_recordings_are_read(recordings: Path, subject: int) -> None:
    found = read_subject(recordings, subject)
    assert [item.movement for item in found] == list(range(1, 11))
    assert sum(len(item.number) for item in found) == {2: 11671, 3: 8885}[subject]
    for item in found:
        bins = item.clouds.distance / RANGE_STEP
        assert np.abs(np.mean(np.exp(2j * np.pi * bins))) > 0.98
        np.testing.assert_allclose(
            item.clouds.doppler / VELOCITY_STEP, np.round(item.clouds.doppler / VELOCITY_STEP), atol=1e-5
        )
        rate = np.polyfit(frame_times(item), item.stamp - item.stamp[0], 1)[0]
        assert rate == pytest.approx(1.0, abs=1e-3)


@pytest.mark.slow
def test_a_simulated_lunge_moves_as_the_radar_saw_it(recordings: Path) -> None:
    pytest.importorskip("anny")
    pose = read_pose()
    lunge = read_subject(recordings, 2)[4].cut(540, 780)
    rows, samples = simulate(lunge, pose, every=6)
    ours = course_of_clouds(clouds_of(rows, samples, pose)).doppler.centroid
    theirs = course_of_clouds(lunge.clouds.at_rows(rows)).doppler.centroid
    likeness = {shift: correlation(theirs, np.roll(ours, shift)) for shift in range(-3, 4)}
    assert likeness[0] > 0.85
    assert max(likeness, key=lambda shift: likeness[shift]) == 0
    assert min(likeness.values()) < 0.3
