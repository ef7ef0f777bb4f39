"""Waves after mirrors: image theory, textbook radii of curvature, phase turns at foci, reciprocity."""

import numpy as np
import pytest

from rfgen_sionna.scene.materials import material
from rfgen_sionna.tracing.curved.arriving_waves import CurvedMirror, CurvedRoute, arriving_wave, polarised_field
from rfgen_sionna.tracing.curved.media import SurfaceOptics
from tests.reference.two_spheres import reflection_points

OPTICS = SurfaceOptics.of([material("pec")], 77e9, 0.0)
NONE = np.zeros(1, np.int32)


def plane(point, normal):
    return CurvedMirror(
        np.atleast_2d(point).astype(float), np.atleast_2d(normal).astype(float), np.zeros((1, 3, 3)), NONE
    )


def ball(centre, radius, source, end):
    """A ball as a mirror for one ray; a negative radius is its hollow inside."""
    point = reflection_points(centre, abs(radius), source, end[None])[0]
    normal = (point - centre) / radius
    curvature = (np.eye(3) - np.outer(normal, normal)) / radius
    return CurvedMirror(point[None], normal[None], curvature[None], NONE)


def route(mirrors, end):
    return CurvedRoute(tuple(mirrors), np.atleast_2d(end).astype(float))


def test_a_plane_mirror_is_an_image():
    """Length, direction and spreading equal the image's, for elements a decimetre from the ray's source."""
    wall = plane([1.0, 2.0, 0.3], [0.0, -1.0, 0.0])
    end = np.array([2.0, 0.5, -0.2])
    for element in ([0.0, 0.0, 0.0], [0.1, -0.05, 0.1]):
        image = np.array([element[0], 4.0 - element[1], element[2]])
        found = arriving_wave(np.array(element), route([wall], end), OPTICS)
        reach = np.linalg.norm(end - image)
        assert found.length[0] == pytest.approx(reach, abs=1e-9)
        assert abs(found.spread[0]) == pytest.approx(1 / reach, rel=1e-6)
        np.testing.assert_allclose(found.ray[0], (end - image) / reach, atol=1e-6)


@pytest.mark.parametrize("radius", [0.05, 0.3])
def test_a_ball_spreads_a_wave_with_the_textbook_s_radii(radius):
    """1 / rho = 1 / s + 2 / (a cos) in the plane of incidence and 1 / s + 2 cos / a across it."""
    centre, source, end = np.array([2.0, 0.1, 0]), np.zeros(3), np.array([1.2, 1.0, 0.4])
    mirror = ball(centre, radius, source, end)
    found = arriving_wave(source, route([mirror], end), OPTICS)
    point, normal = mirror.point[0], mirror.normal[0]
    s_1, s_2 = np.linalg.norm(point), np.linalg.norm(end - point)
    cos = -normal @ point / s_1
    rho = [1 / (1 / s_1 + curvature) for curvature in (2 / (radius * cos), 2 * cos / radius)]
    expected = np.sqrt(rho[0] * rho[1] / ((rho[0] + s_2) * (rho[1] + s_2))) / s_1
    assert found.spread[0] == pytest.approx(expected, rel=1e-6)


def test_a_hollow_mirror_turns_the_phase_by_a_quarter_at_each_focus():
    """On the axis of a hollow ball of radius a, from 3 a before it: the focus is at 0.6 a."""
    mirror = CurvedMirror(np.zeros((1, 3)), np.array([[0, 0, 1.0]]), -np.diag([1.0, 1.0, 0.0])[None], NONE)
    source = np.array([0, 0, 3.0])
    for height, turns in ((0.4, 0), (1.0, 2)):
        found = arriving_wave(source, route([mirror], [0, 0, height]), OPTICS)
        assert found.spread[0] / abs(found.spread[0]) == pytest.approx(1j**turns)
        assert abs(found.spread[0]) == pytest.approx(1 / abs(3 * (1 - height / 0.6)), rel=1e-6)
    # A trough has one focus.
    trough = CurvedMirror(np.zeros((1, 3)), np.array([[0, 0, 1.0]]), -np.diag([1.0, 0.0, 0.0])[None], NONE)
    found = arriving_wave(source, route([trough], [0, 0, 1.0]), OPTICS)
    assert found.spread[0] / abs(found.spread[0]) == pytest.approx(1j)


def test_two_curved_mirrors_are_reciprocal_and_fermat_finds_the_path_of_a_displaced_element():
    first, second = (np.array([2.0, 0.4, 0.0]), 0.3), (np.array([1.8, -0.5, 0.2]), 0.2)
    source, end = np.zeros(3), np.array([0.3, -2.0, 0.5])
    # Reference path: reflect at each ball in turn for a fixed point of the other.
    one, other = first[0], second[0]
    for _ in range(40):
        one = reflection_points(*first, source, other[None])[0]
        other = reflection_points(*second, one, end[None])[0]
    mirrors = [ball(*first, source, other), ball(*second, one, end)]
    there = arriving_wave(source, route(mirrors, end), OPTICS)
    back = arriving_wave(end, route(mirrors[::-1], source), OPTICS)
    by_hand = np.linalg.norm(one) + np.linalg.norm(other - one) + np.linalg.norm(end - other)
    assert there.length[0] == pytest.approx(by_hand, abs=1e-9)
    assert there.length[0] == pytest.approx(back.length[0], abs=1e-12)
    assert there.spread[0] == pytest.approx(back.spread[0], rel=1e-9)
    element = np.array([0.0, 0.03, -0.02])
    one, other = mirrors[0].point[0], mirrors[1].point[0]
    for _ in range(40):
        one = reflection_points(*first, element, other[None])[0]
        other = reflection_points(*second, one, end[None])[0]
    moved = arriving_wave(element, route(mirrors, end), OPTICS)
    by_hand = np.linalg.norm(one - element) + np.linalg.norm(other - one) + np.linalg.norm(end - other)
    # A hundredth of a degree at 77 GHz.
    assert moved.length[0] == pytest.approx(by_hand, abs=1e-7)


def test_a_conductor_keeps_the_field_along_its_normal():
    wall = plane([1.0, 2.0, 0.3], [0.0, -1.0, 0.0])
    end, field = np.array([2.0, 0.5, 0.3]), np.array([0, 0, 1.0])
    way = route([wall], end)
    found = arriving_wave(np.array([0, 0, 0.3]), way, OPTICS)
    np.testing.assert_allclose(
        polarised_field(field, found, way, OPTICS, 77e9)[0] / found.spread[0], [0, 0, -1], atol=1e-6
    )
