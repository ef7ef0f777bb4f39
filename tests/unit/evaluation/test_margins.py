"""Margins over controls on images of simulated people, as `docs/evaluation.md` states them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest

from rfgen_sionna.evaluation import compare_courses, compare_images, course_of_spectra, shifted_in_time
from rfgen_sionna.processing import range_axis, range_doppler, velocity_axis
from rfgen_sionna.radar import Radar
from rfgen_sionna.simulation import Simulator

pytest.importorskip("anny")
pytest.importorskip("skimage")

from rfgen_sionna.generative.actor import Actor

pytestmark = pytest.mark.slow

BOXER = "a person boxing, facing the radar"
PEOPLE = {
    "reference": (BOXER, 0, 0), "other noise": (BOXER, 0, 1), "other body": (BOXER, 7, 2),
    "other action": ("a person does jumping jacks, facing the radar", 0, 3),
}  # fmt: skip
"""Prompt, seed of the body and seed of the noise of each recording."""


@pytest.fixture(scope="module")
def radar() -> Radar:
    radar = Radar.load("iwr1443boost", preset="radhar", position=(0, 0, 1), look_at=(3, 0, 1))
    return replace(radar, waveform=replace(radar.waveform, frame_period=0.1))


@pytest.fixture(scope="module")
def cubes(radar: Radar) -> Mapping[str, np.ndarray]:
    """Samples of 10 frames of a person at 2.5 m, by the names of `PEOPLE`."""
    found = {}
    for name, (prompt, body_seed, noise_seed) in PEOPLE.items():
        person = Actor.from_prompt(
            prompt, body_seed=body_seed, radar=radar, duration=2.0, motion="kinematic", position=(2.5, 0, 0)
        )
        found[name] = Simulator(None, radar, [person], rtol=0.1).adc(1.0, start=0.5, seed=noise_seed).data
    return found


def powers(cube: np.ndarray, radar: Radar, static: bool) -> np.ndarray:
    """(frame, range, velocity) powers of the ranges within 1 m of the person."""
    ranges = range_axis(radar, cube.shape[-1])
    return np.asarray(range_doppler(cube, radar, static=static).power[:, np.abs(ranges - 2.5) < 1.0])


@pytest.mark.parametrize("static", [True, False])
def test_controls_are_worse_on_images_in_decibels(radar: Radar, cubes: Mapping[str, np.ndarray], static: bool) -> None:
    images = {name: powers(cube, radar, static) for name, cube in cubes.items()}
    reference, candidate = images.pop("reference"), images.pop("other noise")
    found = compare_images(reference, candidate, images | {"shifted in time": shifted_in_time(reference)})
    assert set(found["ssim_db"].controls) == {"other body", "other action", "shifted in time"}
    assert found["ssim_db"].margin > 0.1
    assert found["psnr_db"].margin > 6.0
    assert min(found["ssim_linear"].controls.values()) > 0.8  # everything looks alike
    assert found["ssim_db"].margin > 1.5 * found["ssim_linear"].margin


def test_controls_are_worse_in_the_course_of_doppler(radar: Radar, cubes: Mapping[str, np.ndarray]) -> None:
    velocity = velocity_axis(radar, radar.waveform.num_loops)
    courses = {name: course_of_spectra(powers(cube, radar, True).sum(axis=1), velocity) for name, cube in cubes.items()}
    found = compare_courses(courses.pop("reference"), courses.pop("other noise"), courses)
    assert found["centroid_correlation"].margin > 0.1
    assert found["spread_correlation"].margin > 0.2
    assert found["centroid_rms"].margin > 0.03
