"""Silhouette rays: their course, and shadows that facets' corners do not detect."""

import numpy as np
import pytest
import trimesh

from rfgen_sionna._types import SPEED_OF_LIGHT
from rfgen_sionna.scene.mesh import unit
from rfgen_sionna.scene.rays import RayScene
from rfgen_sionna.tracing.shadows.adaptive_sampling import CornerVisibility, sample_visibility, shared_vertices
from rfgen_sionna.tracing.shadows.silhouettes import (
    RAY_CLEARANCE,
    RAY_SPACING,
    FacetLocator,
    MeshSilhouette,
    SilhouetteRays,
)

WAVENUMBER = 2 * np.pi * 79e9 / SPEED_OF_LIGHT


def test_rays_pass_a_ball_all_around_just_outside():
    """Icosphere: the distance to the centre is the radius less the faces' sagitta."""
    ball = trimesh.creation.icosphere(subdivisions=4, radius=0.2).apply_translation((2, 0.3, -0.2))
    points, span = MeshSilhouette(np.asarray(ball.faces)).silhouette_rays(np.asarray(ball.vertices))
    towards = np.array([2, 0.3, -0.2]) / np.linalg.norm([2, 0.3, -0.2])
    direction = points / np.linalg.norm(points, axis=1)[:, None]
    angle = np.arccos(direction @ towards)
    assert span.sum() == pytest.approx(2 * np.pi * np.sin(angle).mean(), rel=0.02)
    expected = np.arcsin(0.2 / np.linalg.norm([2, 0.3, -0.2]))
    assert angle == pytest.approx(expected, rel=0.02)
    scene = RayScene([], [(ball.vertices, ball.faces)], origin=np.zeros(3))
    assert (scene.first_facet(np.zeros(3), points) < 0).mean() > 0.95
    off = direction - (direction @ towards)[:, None] * towards
    within = points - 3 * RAY_CLEARANCE * (np.linalg.norm(points, axis=1) / np.sin(angle))[:, None] * off
    assert (scene.first_facet(np.zeros(3), within) >= 0).mean() > 0.95


def test_the_silhouette_of_an_open_sheet_is_its_border():
    plate = trimesh.Trimesh([[1, 0, 0], [1, 1, 0], [1, 1, 1], [1, 0, 1]], [[0, 1, 2], [0, 2, 3]])
    points, span = MeshSilhouette(np.asarray(plate.faces)).silhouette_rays(np.asarray(plate.vertices))
    assert len(points) == pytest.approx(span.sum() / RAY_SPACING, abs=4)
    assert span.sum() == pytest.approx(2 * np.pi / 4 + 2 * np.arctan2(1, np.sqrt(2)), rel=0.01)
    outside = (points[:, 1:] < 0) | (points[:, 1:] > 1)
    assert outside.any(axis=1).all()


@pytest.mark.parametrize("halvings", [1, 5])
def test_the_piece_that_a_ray_hits_is_found(halvings):
    """Among four, and among a thousand."""
    whole = np.array([[[1, 0, 0], [1, 1, 0], [1, 0, 1.0]]])
    points, faces = np.eye(3), np.arange(3)[None]
    for _ in range(halvings):
        points, faces = trimesh.remesh.subdivide(points, faces)
    corners = points[faces] @ whole[0]
    places = FacetLocator(corners, np.full(len(corners), 7))
    middles = corners.mean(axis=1)
    for k, middle in enumerate(middles[::17] if halvings > 1 else middles):
        held = places.silhouette_lengths(SilhouetteRays(middle[None], np.array([7]), np.ones(1)))[0]
        assert np.flatnonzero(held).tolist() == [17 * k if halvings > 1 else k]
    assert not places.silhouette_lengths(SilhouetteRays(middles[:4], np.array([-1, 3, 8, 6]), np.ones(4))).any()


@pytest.mark.parametrize("gap", [0.03, 0.06])
def test_light_through_a_slit_is_found_between_occluded_corners(gap):
    """Slit between two boards: its light on the plate, twice as wide, covers no corner of a facet."""
    plate = trimesh.creation.box((0.01, 1.0, 1.0)).apply_translation((3, 0, 0))
    slit = [
        trimesh.creation.box((0.001, 2.0, 1.0)).apply_translation((1.4975, 0, 0.05 + side * (0.5 + gap / 2)))
        for side in (-1, 1)
    ]
    scene = RayScene([], [(m.vertices, m.faces) for m in (plate, *slit)], origin=np.zeros(3))
    corners = plate.vertices[plate.faces]
    front = np.flatnonzero((corners[:, :, 0] < 3).all(axis=1))
    corners = corners[front]
    guides = CornerVisibility(np.zeros(3), corners, front, shared_vertices(corners))
    found = [MeshSilhouette(np.asarray(m.faces)).silhouette_rays(np.asarray(m.vertices)) for m in slit]
    past, span = (np.concatenate(each) for each in zip(*found, strict=True))
    silhouette_rays = SilhouetteRays(past, scene.first_facet(np.zeros(3), past), span)
    view, area = np.zeros(3), 0.5 * np.linalg.norm(np.cross(*np.diff(corners, axis=1).swapaxes(0, 1)), axis=1)

    def unoccluded(rays):
        passed = None if rays is None else FacetLocator(corners, front).silhouette_lengths(rays)[0]
        found = sample_visibility(scene, view, corners, front, guides.visible(scene)[0], WAVENUMBER, 1e-3, passed)
        return (found.fraction * area).sum() / area.sum()

    assert unoccluded(None) == 0
    assert unoccluded(silhouette_rays) == pytest.approx(2 * gap, rel=0.05)


def test_directions_have_length_one_whatever_the_shape():
    vectors = np.random.default_rng(0).normal(size=(4, 3, 3))
    assert np.allclose(np.linalg.norm(unit(vectors), axis=-1), 1.0, rtol=0, atol=1e-15)
    assert np.array_equal(unit(vectors)[:, 1], unit(vectors[:, 1]))
    assert not unit(np.zeros((2, 3))).any()


def test_no_shadow_falls_before_a_silhouette():
    """A ray past a silhouette hits facets behind it or touches it, whichever side they show."""
    triangle = np.array([[0.0, -1, -1], [0.0, 1, -1], [0.0, 0, 2]])
    corners = np.stack([triangle + np.array([distance, 0, 0]) for distance in (1.0, 2.0, 2.5)])
    corners[1] = corners[1, ::-1]
    places = FacetLocator(corners, np.arange(3))
    way = np.array([2.0, 0.1, 0.0])
    for far, held in ((0.5, [1, 1, 1]), (1.0005, [1, 1, 1]), (1.3, [0, 1, 1]), (2.0005, [0, 1, 1]), (3.0, [0, 0, 0])):
        silhouette_rays = SilhouetteRays(np.tile(way * far / way[0], (3, 1)), np.arange(3), np.full(3, 0.25))
        every, shadowed = places.silhouette_lengths(silhouette_rays)
        assert np.array_equal(shadowed, 0.25 * np.array(held)), far
        assert (every == 0.25).all()


def on(corners, ray):
    """Whether a ray hits a facet, by the sides of its edges."""
    sides = [np.linalg.det(np.stack([ray, corners[k], corners[(k + 1) % 3]])) for k in range(3)]
    return min(sides) >= 0 or max(sides) <= 0


def test_rays_hit_the_facets_that_they_cross():
    rng = np.random.default_rng(3)
    corners = np.array([3.0, 0, 0]) + rng.normal(size=(60, 3, 3))
    number = np.sort(rng.integers(0, 5, 60))  # up to 32 pieces of each face are all tested
    rays, hit = np.array([3.0, 0, 0]) + rng.normal(size=(200, 3)), rng.integers(-1, 6, 200)
    for count in (200, 1, 0, 150):
        held = FacetLocator(corners, number).silhouette_lengths(
            SilhouetteRays(rays[:count], hit[:count], np.ones(count))
        )[0]
        expected = np.zeros(60)
        for ray, face in zip(rays[:count], hit[:count], strict=True):
            expected += [face == own and on(facet, ray) for facet, own in zip(corners, number, strict=True)]
        assert np.array_equal(held, expected)


def test_a_ray_on_a_shared_edge_hits_one_of_two_facets():
    """On neither a shadow would be lost, on both it would count twice."""
    rng = np.random.default_rng(2)
    square = np.array([[3, -1, -1], [3, 1, 1], [3, 1, -1], [3, -1, 1.0]])
    corners, rays = [], []
    for _ in range(500):
        a, b, c, d = square + 0.3 * rng.normal(size=(4, 3))
        corners += [[a, c, b], [b, d, a]]
        rays.append(a + rng.choice([0.5, 0.25, rng.uniform()]) * (b - a))
    places = FacetLocator(np.array(corners), np.repeat(np.arange(500), 2))
    held = (
        places.silhouette_lengths(SilhouetteRays(np.array(rays), np.arange(500), np.ones(500)))[0]
        .reshape(-1, 2)
        .sum(axis=1)
    )
    assert (held == 1).mean() > 0.99  # on both where the ray meets the edge to the last bit
    assert held.min() == 1
