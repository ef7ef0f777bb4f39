"""Figures of merit of simulated data against references, each with controls that should not agree."""

from rfgen_sionna.evaluation.body_errors import BodyEstimates, compare_bodies
from rfgen_sionna.evaluation.cloud_distance import chamfer_distance, compare_clouds, hausdorff_distance
from rfgen_sionna.evaluation.cloud_statistics import CloudStatistics, compare_statistics
from rfgen_sionna.evaluation.controlled_metric import ControlledMetric, shifted_in_time, with_controls
from rfgen_sionna.evaluation.doppler_course import (
    DopplerCourse,
    compare_courses,
    course_of_points,
    course_of_spectra,
)
from rfgen_sionna.evaluation.frechet_distance import compare_features, frechet_distance
from rfgen_sionna.evaluation.image_similarity import compare_images

__all__ = [
    "BodyEstimates",
    "CloudStatistics",
    "ControlledMetric",
    "DopplerCourse",
    "chamfer_distance",
    "compare_bodies",
    "compare_clouds",
    "compare_courses",
    "compare_features",
    "compare_images",
    "compare_statistics",
    "course_of_points",
    "course_of_spectra",
    "frechet_distance",
    "hausdorff_distance",
    "shifted_in_time",
    "with_controls",
]
