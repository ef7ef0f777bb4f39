"""Metrics against scikit-image, SciPy and closed forms."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import sqrtm
from scipy.spatial.distance import cdist, directed_hausdorff
from scipy.spatial.transform import Rotation
from scipy.stats import linregress, pearsonr, wasserstein_distance

from rfgen_sionna.evaluation import (
    BodyEstimates,
    CloudStatistics,
    DopplerCourse,
    chamfer_distance,
    compare_bodies,
    compare_clouds,
    compare_courses,
    compare_features,
    compare_images,
    compare_statistics,
    course_of_points,
    course_of_spectra,
    frechet_distance,
    hausdorff_distance,
    shifted_in_time,
    with_controls,
)
from rfgen_sionna.evaluation.body_errors import accuracy, mean_distance, mean_rotation_angle
from rfgen_sionna.evaluation.cloud_statistics import total_variation
from rfgen_sionna.evaluation.doppler_course import correlation, slope


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(0)


def echoes(rng: np.random.Generator, column: int) -> np.ndarray:
    """(16, 24) power image with one strong cell at `column` on exponential noise of 40 dB less."""
    image = rng.exponential(1e-4, (16, 24))
    image[8, column] = 1.0
    return image


def test_images_equal_scikit_image(rng: np.random.Generator) -> None:
    metrics = pytest.importorskip("skimage.metrics")
    first, second = echoes(rng, 5), echoes(rng, 6)
    found = compare_images(first, second, {})
    decibels = [10 * np.log10(np.maximum(image / image.max(), 1e-5)) for image in (first, second)]
    assert found["ssim_db"].value == pytest.approx(metrics.structural_similarity(*decibels, data_range=50.0))
    assert found["psnr_db"].value == pytest.approx(metrics.peak_signal_noise_ratio(*decibels, data_range=50.0))
    assert found["ssim_linear"].value == pytest.approx(metrics.structural_similarity(first, second, data_range=1.0))
    assert found["psnr_linear"].value == pytest.approx(metrics.peak_signal_noise_ratio(first, second, data_range=1.0))


def test_images_of_frames_are_averaged(rng: np.random.Generator) -> None:
    pytest.importorskip("skimage")
    first, second = rng.uniform(0.1, 1, (2, 3, 9, 8))
    first[:, 0, 0] = second[:, 0, 0] = 1.0  # one peak for all frames
    whole = compare_images(first, second, {})["ssim_db"].value
    assert whole == pytest.approx(
        np.mean([compare_images(a, b, {})["ssim_db"].value for a, b in zip(first, second, strict=True)])
    )


def test_linear_images_of_two_scenes_look_alike_and_those_in_decibels_do_not(rng: np.random.Generator) -> None:
    pytest.importorskip("skimage")
    smooth = np.exp(-(np.hypot(*np.meshgrid(np.arange(24) - 12, np.arange(16) - 8)) ** 2) / 8)
    other = np.exp(-(np.hypot(*np.meshgrid(np.arange(24) - 4, np.arange(16) - 3)) ** 2) / 8)
    floor = 1e-4
    found = compare_images(smooth + floor, (smooth + floor) * 1.1, {"other scene": other + floor})
    assert found["ssim_db"].value == pytest.approx(1.0)
    assert found["ssim_db"].margin > 0.4
    assert found["ssim_linear"].margin < found["ssim_db"].margin


@pytest.mark.parametrize(
    ("reference", "candidate", "message"),
    [
        (np.ones((6, 9)), np.ones((6, 9)), "at least 7 x 7"),
        (np.ones((8, 9)), np.ones((9, 8)), "one shape"),
        (np.ones((8, 9)), -np.ones((8, 9)), "powers >= 0"),
        (np.zeros((8, 9)), np.ones((8, 9)), "powers >= 0"),
    ],
)
def test_images_that_cannot_be_compared(reference: np.ndarray, candidate: np.ndarray, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        compare_images(reference, candidate, {})


@given(st.integers(1, 30), st.integers(1, 30), st.integers(0, 100))
@settings(deadline=None, max_examples=25)
def test_cloud_distances_equal_scipy(first: int, second: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    a, b = rng.normal(size=(first, 3)), rng.normal(size=(second, 3))
    assert hausdorff_distance(a, b) == pytest.approx(max(directed_hausdorff(a, b)[0], directed_hausdorff(b, a)[0]))
    table = cdist(a, b)
    assert chamfer_distance(a, b) == pytest.approx((table.min(axis=0).mean() + table.min(axis=1).mean()) / 2)


def test_a_shifted_cloud_is_as_far_as_the_shift(rng: np.random.Generator) -> None:
    clouds = [rng.uniform(size=(20, 3)) * 100 for _ in range(4)]
    near = [np.add(cloud, [0.0, 0.03, 0.04]) for cloud in clouds]
    found = compare_clouds(clouds, near, {"other scene": clouds[::-1]})
    assert found["hausdorff"].value == pytest.approx(0.05)
    assert found["chamfer"].value == pytest.approx(0.05)
    assert found["chamfer"].margin > 1.0
    assert found["missing"].value == 0.0


def test_frames_in_which_one_cloud_is_empty_are_counted() -> None:
    one, none = np.zeros((1, 3)), np.empty((0, 3))
    found = compare_clouds([one, one, none, none], [one, none, one, none], {})
    assert found["missing"].value == 0.5
    assert found["chamfer"].value == 0.0
    with pytest.raises(ValueError, match="no frame has points in both"):
        compare_clouds([one], [none], {})
    with pytest.raises(ValueError, match="candidate has 1 frames, the reference 2"):
        compare_clouds([one, one], [one], {})


def test_course_of_two_lines_is_their_mean_and_half_their_distance() -> None:
    velocity = np.linspace(-2, 2, 9)
    power = np.zeros((3, 9))
    power[0, [3, 5]] = 1.0
    power[1, [4, 8]] = [3.0, 1.0]
    course = course_of_spectra(power, velocity)
    assert course.centroid[:2] == pytest.approx([0.0, 0.5])
    assert course.spread[:2] == pytest.approx([0.5, np.sqrt(0.75)])
    assert np.isnan(course.centroid[2])
    assert np.isnan(course.spread[2])
    points = course_of_points([0, 0, 1, 1], velocity[[3, 5, 4, 8]], [1, 1, 3, 1], 3)
    np.testing.assert_allclose(points.centroid, course.centroid)
    np.testing.assert_allclose(points.spread, course.spread)


def test_courses_equal_scipy_and_their_shift_is_a_control(rng: np.random.Generator) -> None:
    time = np.arange(60) / 10
    first = course_of_points(np.arange(60), np.sin(2 * np.pi * 0.37 * time), np.ones(60), 60)
    second = course_of_points(np.arange(60), 2 * first.centroid + 0.1 * rng.normal(size=60), np.ones(60), 60)
    first.centroid[7] = np.nan
    found = compare_courses(first, second, shift=13)
    both = np.arange(60) != 7
    expected = pearsonr(first.centroid[both], second.centroid[both])[0]
    assert found["centroid_correlation"].value == pytest.approx(expected)
    rms = np.sqrt(np.mean((first.centroid[both] - second.centroid[both]) ** 2))
    assert found["centroid_rms"].value == pytest.approx(rms)
    assert found["centroid_slope"].value == pytest.approx(0.5, abs=0.02)
    shifted = np.roll(second.centroid, 13)
    assert found["centroid_correlation"].controls["shifted in time"] == pytest.approx(
        pearsonr(first.centroid[both], shifted[both])[0]
    )
    assert found["centroid_correlation"].margin > 0.5


def test_slopes_and_spreads_equal_scipy(rng: np.random.Generator) -> None:
    first, second = (DopplerCourse(rng.normal(size=40), rng.uniform(size=40)) for _ in range(2))
    found = compare_courses(first, second, {"other": DopplerCourse(-first.centroid, first.spread[::-1])})
    slope = linregress(second.centroid, first.centroid).slope
    assert found["centroid_slope"].value == pytest.approx(abs(slope - 1))
    assert found["centroid_slope"].controls["other"] == pytest.approx(2.0)
    assert found["spread_correlation"].value == pytest.approx(pearsonr(first.spread, second.spread)[0])
    assert found["spread_rms"].value == pytest.approx(np.sqrt(np.mean((first.spread - second.spread) ** 2)))
    assert found["centroid_correlation"].controls["other"] == pytest.approx(-1.0)
    assert set(found["spread_rms"].controls) == {"other", "shifted in time"}


def test_series_that_have_no_correlation_or_slope() -> None:
    assert np.isnan(correlation([1.0, 1.0, 1.0], [1.0, 2.0, 3.0]))
    assert np.isnan(slope([1.0, 2.0, 3.0], [1.0, 1.0, 1.0]))
    with pytest.raises(ValueError, match="1 frames have values in both series"):
        correlation([1.0, np.nan, 1.0], [np.nan, 2.0, 3.0])
    with pytest.raises(ValueError, match=r"series have shapes \(2,\) and \(3,\)"):
        slope([1.0, 2.0], [1.0, 2.0, 3.0])


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: course_of_spectra(np.ones((3, 4)), np.ones(5)), r"power has shape \(3, 4\) and velocity \(5,\)"),
        (lambda: course_of_spectra(-np.ones((3, 4)), np.ones(4)), "finite powers"),
        (lambda: course_of_points([0, 3], [1.0, 1.0], [1.0, 1.0], 3), "for 3 frames"),
        (lambda: course_of_points([0], [1.0, 1.0], [1.0, 1.0], 3), "one value a point"),
        (lambda: hausdorff_distance(np.empty((0, 3)), np.ones((1, 3))), "first has shape"),
        (lambda: chamfer_distance(np.ones((1, 3)), [[0.0, np.nan, 0.0]]), "at least one finite point"),
        (lambda: chamfer_distance(np.ones((1, 3)), np.ones((1, 2))), "points have 3 and 2 coordinates"),
        (lambda: frechet_distance(np.ones((1, 3)), np.ones((4, 3))), "at least 2 samples"),
        (lambda: frechet_distance(np.ones((4, 2)), np.ones((4, 3))), "2 and 3 features"),
        (lambda: compare_features(np.eye(3), np.eye(4), {}), "candidate has 4 features, the reference 3"),
        (lambda: compare_images(np.ones((8, 8)), np.ones((8, 8)), {}, dynamic_range_db=0), "dynamic_range_db is 0"),
        (lambda: accuracy(["a", "b"], ["a"]), r"classes have shapes \(2,\) and \(1,\)"),
        (lambda: mean_distance(np.ones((4, 3)), np.ones(3)), r"points have shapes \(4, 3\) and \(3,\)"),
        (lambda: mean_rotation_angle(np.ones((4, 3)), np.ones((4, 3))), r"rotations have shapes \(4, 3\)"),
        (lambda: mean_rotation_angle(np.eye(3), 2 * np.eye(3)), "rotation matrices are needed"),
    ],
)
def test_what_no_metric_takes_is_named(call: Callable[[], object], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        call()


def test_clouds_without_points_have_no_statistics() -> None:
    some = CloudStatistics(np.ones(2), np.ones(3), np.ones(3))
    with pytest.raises(ValueError, match="control 'none' has 2 frames, 0 levels and 0 Doppler bins"):
        compare_statistics(some, some, {"none": CloudStatistics(np.ones(2), np.empty(0), np.empty(0))})


def test_statistics_equal_scipy(rng: np.random.Generator) -> None:
    sets = [
        CloudStatistics(rng.poisson(m, 50).astype(float), rng.normal(m, 3, 90), rng.integers(-m, m, 90).astype(float))
        for m in (4, 5, 9)
    ]
    found = compare_statistics(sets[0], sets[1], {"other": sets[2]})
    assert found["counts"].value == pytest.approx(wasserstein_distance(sets[0].counts, sets[1].counts))
    assert found["levels"].value == pytest.approx(wasserstein_distance(sets[0].level_db, sets[1].level_db))
    shares = [np.bincount(item.doppler_bin.astype(int) + 9, minlength=20) / 90 for item in sets[:2]]
    assert found["doppler"].value == pytest.approx(np.abs(shares[0] - shares[1]).sum() / 2)
    assert all(metric.margin > 0 for metric in found.values())
    assert total_variation([1, 1, 2], [3]) == pytest.approx(1.0)


def test_frechet_distance_of_normal_distributions(rng: np.random.Generator) -> None:
    base = rng.normal(size=(400, 4)) @ rng.normal(size=(4, 4))
    other = rng.normal(size=(300, 4)) @ rng.normal(size=(4, 4)) + 1.0
    one, two = np.cov(base, rowvar=False), np.cov(other, rowvar=False)
    mean = base.mean(axis=0) - other.mean(axis=0)
    square = mean @ mean + np.trace(one + two - 2 * np.real(sqrtm(one @ two)))
    assert frechet_distance(base, other) == pytest.approx(np.sqrt(square))
    # one axis: differences of means and of standard deviations
    line = base[:, :1]
    assert frechet_distance(line, 3 * line + 2) == pytest.approx(
        np.hypot(line.mean() - (3 * line + 2).mean(), 2 * line.std(ddof=1))
    )
    assert frechet_distance(base, base) == pytest.approx(0.0, abs=1e-6)


def test_features_are_compared_in_standard_deviations_of_the_reference(rng: np.random.Generator) -> None:
    base = np.column_stack([rng.normal(size=500), 1000 * rng.normal(size=500), np.ones(500)])
    found = compare_features(base, np.add(base, [0, 1000, 5]), {"other": np.add(base, [0, 5000, 0])})
    assert found.value == pytest.approx(1000 / base[:, 1].std())
    assert found.margin == pytest.approx(4000 / base[:, 1].std())
    with pytest.raises(ValueError, match="constant"):
        compare_features(np.ones((3, 2)), base[:, :2], {})


def test_errors_of_bodies_are_those_put_in(rng: np.random.Generator) -> None:
    frames, joints = 5, 24
    turn = Rotation.random(frames * joints, random_state=1)
    off = Rotation.from_rotvec(np.radians(7.0) * np.array([0.0, 0.6, 0.8]))
    true = BodyEstimates(
        vertices=rng.normal(size=(frames, 50, 3)),
        joints=rng.normal(size=(frames, joints, 3)),
        rotations=turn.as_matrix().reshape(frames, joints, 3, 3),
        root=rng.normal(size=(frames, 3)),
        gender=np.array(["f", "f", "m", "m", "m"]),
    )
    found = compare_bodies(
        true,
        BodyEstimates(
            vertices=np.add(true.vertices, [0.03, 0.0, 0.04]),
            joints=np.add(true.joints, [0.0, 0.02, 0.0]),
            rotations=(turn * off).as_matrix().reshape(frames, joints, 3, 3),
            root=np.add(true.root, [0.1, 0.0, 0.0]),
            gender=np.array(["f", "f", "m", "m", "f"]),
        ),
        {"other body": BodyEstimates(*(np.roll(value, 1, axis=0) for value in vars(true).values()))},
    )
    values = {name: metric.value for name, metric in found.items()}
    assert values == pytest.approx({"V": 0.05, "S": 0.02, "Q": 7.0, "T": 0.1, "G": 0.8})
    assert all(metric.margin > 0 for metric in found.values())


def test_what_a_body_lacks_is_named() -> None:
    joints = BodyEstimates(joints=np.zeros((2, 3, 3)))
    with pytest.raises(ValueError, match="joints of other body has shape"):
        compare_bodies(joints, joints, {"other body": BodyEstimates()})
    with pytest.raises(ValueError, match="none of vertices"):
        compare_bodies(BodyEstimates(), BodyEstimates(), {})


def test_margin_is_that_of_the_best_control() -> None:
    def gap(a: float, b: float) -> float:
        return abs(a - b)

    found = with_controls("gap", gap, 0.0, 1.0, {"wrong": 4.0, "other": -3.0}, unit="m")
    assert (found.value, found.margin) == (1.0, 2.0)
    assert str(found) == "gap 1 m (controls: wrong 4, other 3)"
    assert with_controls("gap", gap, 0.0, 5.0, {"wrong": 4.0}).margin == -1.0
    assert np.isnan(with_controls("gap", gap, 0.0, 1.0, {}).margin)


def test_a_shift_changes_the_series() -> None:
    assert shifted_in_time([1, 2, 3, 4]).tolist() == [3, 4, 1, 2]
    with pytest.raises(ValueError, match="a shift of at least one frame"):
        shifted_in_time([1, 2], 2)
