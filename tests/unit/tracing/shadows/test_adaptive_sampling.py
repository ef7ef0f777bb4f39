"""RF adaptive sampling: shares of uniform sampling with a fraction of its rays."""

import numpy as np
import pytest
import trimesh

from rfgen_sionna._types import SPEED_OF_LIGHT
from rfgen_sionna.scene.rays import RayScene
from rfgen_sionna.tracing.shadows.adaptive_sampling import CornerVisibility, sample_visibility, shared_vertices
from rfgen_sionna.tracing.shadows.return_bounds import max_returns
from rfgen_sionna.tracing.shadows.silhouettes import (
    RAY_SPACING,
    STATIC_RAY_SPACING,
    FacetLocator,
    MeshSilhouette,
    SilhouetteRays,
)
from tests.unit.tracing.shadows.barycentric import barycentric_lattice

VIEW = np.array([0.0, 0.0, 1.0])
WAVENUMBER = 2 * np.pi * 79e9 / SPEED_OF_LIGHT


def facets_of(*meshes):
    """Ray scene, and corners and numbers of all faces that face the radar."""
    scene = RayScene([], [(np.asarray(m.vertices), np.asarray(m.faces)) for m in meshes], origin=VIEW)
    corners = np.concatenate([m.vertices[m.faces] for m in meshes])
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    facing = np.flatnonzero(np.einsum("fi,fi->f", cross, VIEW - corners.mean(axis=1)) > 0)
    return scene, corners[facing], facing


def sampled(scene, corners, number, rtol):
    """Sampled visibility of facets, and the number of rays."""
    visible, guides = CornerVisibility(VIEW, corners, number, shared_vertices(corners)).visible(scene)
    found = sample_visibility(scene, VIEW, corners, number, visible, WAVENUMBER, rtol)
    return found._replace(rays=found.rays + guides)


def uniform(scene, corners, number, n):
    """Shares by n^2 rays to each facet."""
    rows = barycentric_lattice(n)
    of, places = np.repeat(np.arange(len(corners)), len(rows)), np.tile(rows, (len(corners), 1))
    visible = scene.targets(VIEW, corners, number).visible(of, places).reshape(len(corners), -1)
    return visible.mean(axis=1)


def returned(corners, fraction):
    """Coherent sum of returns: solid angles with the phases of a few points."""
    points = np.einsum("wc,fci->fwi", barycentric_lattice(6), corners) - VIEW
    distance = np.linalg.norm(points, axis=2)
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    angle = 0.5 * np.abs(np.einsum("fi,fi->f", cross, points.mean(axis=1))) / distance.mean(axis=1) ** 3
    return (fraction * angle * np.exp(-2j * WAVENUMBER * distance).mean(axis=1)).sum()


def test_facets_touch_where_they_share_a_corner_and_nowhere_else():
    mesh = trimesh.creation.box((1, 1, 1))
    soup = trimesh.Trimesh(mesh.triangles.reshape(-1, 3), np.arange(36).reshape(-1, 3), process=False)
    places = shared_vertices(soup.vertices[soup.faces])
    assert len(np.unique(places)) == 8
    points = {}
    for place, point in zip(places.ravel(), soup.vertices[soup.faces].reshape(-1, 3), strict=True):
        assert np.allclose(points.setdefault(int(place), point), point)
    assert shared_vertices(np.zeros((0, 3, 3))).shape == (0, 3)


def test_nothing_in_the_way_takes_one_ray_a_corner():
    scene, corners, number = facets_of(trimesh.creation.box((0.01, 0.5, 0.5)).apply_translation((3, 0, 1)))
    found = sampled(scene, corners, number, 1e-3)
    assert (found.fraction == 1).all()
    assert found.rays == len(np.unique(corners.reshape(-1, 3), axis=0))
    assert not len(found.owner)
    assert sampled(scene, corners[:0], number[:0], 1e-3).rays == 0


@pytest.mark.parametrize("y", np.linspace(-0.4, 0.4, 5))
def test_the_area_that_a_board_shades_on_a_plate(y):
    """The shadow of a board's edge half way to the plate moves twice as far."""
    plate = trimesh.creation.box((0.01, 1.0, 1.0)).subdivide().subdivide().subdivide().apply_translation((3, 0, 1))
    board = trimesh.creation.box((0.001, 2.0, 2.0)).apply_translation((1.4975, 1.0 + 0.5 * y, 1.0))
    scene, corners, number = facets_of(plate, board)
    of_plate = number < len(plate.faces)
    corners, number = corners[of_plate], number[of_plate]
    found = sampled(scene, corners, number, 1e-3)
    fraction = found.fraction
    # Visible pieces add up to the share.
    size = np.linalg.det(found.pieces)
    assert (size > 0).all()  # orientation of the facet
    mixed = np.flatnonzero((fraction > 0) & (fraction < 1))
    assert np.allclose(np.bincount(found.owner, size, len(fraction))[mixed], fraction[mixed])
    area = 0.5 * np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    assert (fraction * area).sum() / area.sum() == pytest.approx(0.5 + y, abs=0.01)


def pole_before_a_wall():
    """Scene, corners, numbers and true shares of the wall's facets of 16 mm, and rays past the pole for each
    spacing."""
    wall = trimesh.creation.box((0.01, 1.0, 1.0))
    for _ in range(6):
        wall = wall.subdivide()
    wall.apply_translation((4, 0, 1))
    pole = trimesh.creation.box((0.001, 0.004, 1.2)).apply_translation((2, 0.004, 1))
    pole.apply_transform(trimesh.transformations.rotation_matrix(0.02, (1, 0, 0), (2, 0, 1)))
    scene, corners, number = facets_of(wall, pole)
    of_wall = number < len(wall.faces)
    corners, number = corners[of_wall], number[of_wall]

    def past(apart):
        points, span = MeshSilhouette(np.asarray(pole.faces)).silhouette_rays(np.asarray(pole.vertices) - VIEW, apart)
        return FacetLocator(corners - VIEW, number).silhouette_lengths(
            SilhouetteRays(points, scene.first_facet(VIEW, points), span)
        )[0]

    return scene, corners, number, uniform(scene, corners, number, 24), past


def test_the_shadow_of_a_pole_is_found_on_facets_with_visible_corners():
    """By silhouette rays that are dense enough, and without them by searching."""
    scene, corners, number, truth, past = pole_before_a_wall()
    guided, _ = CornerVisibility(VIEW, corners, number, shared_vertices(corners)).visible(scene)
    crossed = (truth > 0.02) & (truth < 0.98)
    unaware = crossed & (guided.all(axis=1) | ~guided.any(axis=1))
    assert unaware.sum() > 10
    closely, coarsely = past(STATIC_RAY_SPACING) > 0, past(RAY_SPACING) > 0
    assert closely[unaware].all()
    assert not coarsely[unaware].all()

    def found(**more):
        return sample_visibility(scene, VIEW, corners, number, guided, WAVENUMBER, 1e-3, **more)

    blind, searched, known = found(), found(search=True), found(silhouette=past(STATIC_RAY_SPACING))
    assert (blind.fraction[unaware] == 1).all()
    for each in (searched, known):
        assert np.abs(each.fraction - truth).max() < 0.02  # 576 points resolve an edge to a twenty-fourth
    assert np.linalg.norm(searched.missed) < 0.5e-3 * np.linalg.norm(searched.returned)
    # Coarser sampling keeps the edges of a search.
    _, cut, _ = max_returns(corners - VIEW, WAVENUMBER)
    for rtol in (0.03, 0.06, 0.1):
        rough = sample_visibility(scene, VIEW, corners, number, guided, WAVENUMBER, rtol, search=True)
        wrong = np.linalg.norm((cut * np.abs(rough.fraction - truth))[unaware])
        assert wrong < np.linalg.norm(rough.missed)
    # A coarse tolerance samples fewer facets.
    loose = sample_visibility(scene, VIEW, corners, number, guided, WAVENUMBER, 0.3, search=True)
    assert loose.rays < 0.5 * searched.rays


def test_an_occluded_facet_with_visible_corners_is_found():
    """The plate's shadow is one facet; shared guiding rays pass it."""
    wall = trimesh.creation.box((0.01, 1.0, 1.0))
    for _ in range(4):
        wall = wall.subdivide()
    wall.apply_translation((4, 0, 1))
    front = np.flatnonzero(
        (wall.face_normals[:, 0] < -0.9) & (np.abs(wall.triangles_center - [4, 0, 1])[:, 1:] < 0.1).all(axis=1)
    )
    one = wall.triangles[front[0]]
    middle = one.mean(axis=0)
    plate = trimesh.Trimesh(VIEW + 0.5 * (middle + 1.02 * (one - middle) - VIEW), [[0, 1, 2]], process=False)
    scene, corners, number = facets_of(wall, plate)
    of_wall = number < len(wall.faces)
    corners, number = corners[of_wall], number[of_wall]
    unoccluded = np.ones((len(corners), 3), np.bool_)
    found = sample_visibility(scene, VIEW, corners, number, unoccluded, WAVENUMBER, 1e-3, search=True)
    assert found.fraction[number == front[0]][0] < 0.01
    assert found.fraction.mean() > 0.99


def test_a_fifth_of_the_rays_finds_the_same_shares():
    """Self-occluding knot with facets of a centimetre: adaptive rays against 16 to each facet."""
    # A torus seen edge-on, and a ball before it.
    ring = trimesh.creation.torus(0.4, 0.1, major_sections=192, minor_sections=64)
    ring.apply_transform(trimesh.transformations.rotation_matrix(1.2, (0, 1, 0.3))).apply_translation((3, 0, 1))
    ball = trimesh.creation.icosphere(subdivisions=5, radius=0.15).apply_translation((2.6, 0.2, 1.1))
    scene, corners, number = facets_of(ring, ball)
    truth = uniform(scene, corners, number, 4)
    partly = np.flatnonzero((truth > 0) & (truth < 1))
    evenly = returned(corners, truth)
    truth[partly] = uniform(scene, corners[partly], number[partly], 32)
    exact = returned(corners, truth)
    found = sampled(scene, corners, number, 1e-2)
    fraction = found.fraction
    assert found.rays < 16 * len(corners) / 5
    assert abs(returned(corners, fraction) - exact) < abs(evenly - exact) + 1e-3 * abs(exact)


def test_static_occlusion_is_not_tested_again():
    """Points behind a board, a moving ball or both: separate tests of static and moving occluders agree with a joint
    one."""
    board = trimesh.creation.box((0.5, 0.02, 0.5), trimesh.transformations.translation_matrix((0.2, 1.0, 1.0)))
    wall = trimesh.creation.box((3.0, 0.02, 3.0), trimesh.transformations.translation_matrix((0.0, 3.0, 1.0)))
    ball = trimesh.creation.icosphere(subdivisions=2, radius=0.2)
    ball.apply_translation((-0.1, 2.0, 1.2))
    static, moving = [[(np.asarray(m.vertices), np.asarray(m.faces)) for m in each] for each in ([board, wall], [ball])]
    every, alone = RayScene(static, moving, origin=VIEW), RayScene(static, origin=VIEW)
    corners = np.asarray(wall.vertices[wall.faces])
    number = len(board.faces) + np.arange(len(corners))
    rows = np.random.default_rng(0).dirichlet(np.ones(3), 400)
    asked = np.repeat(np.arange(len(corners)), len(rows)), np.tile(rows, (len(corners), 1))
    visible = every.targets(VIEW, corners, number).visible(*asked)
    by_ball = ~every.targets(VIEW, corners, number, moving=True).visible(*asked)
    by_board = ~alone.targets(VIEW, corners, number).visible(*asked)
    assert 20 < np.count_nonzero(by_ball & by_board) < np.count_nonzero(by_ball) < np.count_nonzero(~visible)
    assert np.array_equal(visible, ~by_ball & ~by_board)


def test_bounds_on_returns_fall_with_the_phase_range():
    """Against NumPy; for fewer facets after more, and for none."""
    rng = np.random.default_rng(5)
    corners = 4.0 * rng.normal(size=(3000, 1, 3)) + rng.normal(size=(3000, 3, 3)) * rng.uniform(1e-3, 1, (3000, 1, 1))
    away = np.linalg.norm(corners, axis=2)
    turn = WAVENUMBER * np.ptp(away, axis=1)
    angle = np.abs(np.linalg.det(corners)) / away.min(axis=1) ** 3
    for count in (3000, 7, 1, 0, 500):
        most, cut, width = max_returns(corners[:count], WAVENUMBER)
        assert np.allclose(most, (angle / (1 + turn**2))[:count], rtol=1e-6)
        assert np.allclose(cut, (angle / (1 + turn))[:count], rtol=1e-6)
        assert np.allclose(width, 2 * turn[:count])
    # With another return leg the phases add up; on the bisector they are constant.
    other = corners * [1.0, -1.0, 1.0] + [0.0, 2.0, 0.0]
    ways = 0.5 * (away + np.linalg.norm(other, axis=2))
    apart = np.abs(np.linalg.det(other)) / np.linalg.norm(other, axis=2).min(axis=1) ** 3
    most, _, width = max_returns(corners, WAVENUMBER, other)
    assert np.allclose(width, 2 * WAVENUMBER * np.ptp(ways, axis=1), rtol=1e-6)
    assert np.allclose(most, np.sqrt(angle * apart) / (1 + (0.5 * width) ** 2), rtol=1e-6)


def test_a_narrow_facet_is_sampled_for_the_correction_beside_its_edge():
    """Facet 0.2 mm wide at a wall's border behind a plate: its boundary correction is as wide as the array."""
    rows = [(5.0, y, z) for y in (0.0, 0.3, 0.3002) for z in (0.9, 0.93)]
    wall = trimesh.Trimesh(rows, [(0, 1, 2), (2, 1, 3), (2, 3, 4), (4, 3, 5)], process=False)
    plate = trimesh.creation.box((0.01, 0.4, 0.4), trimesh.transformations.translation_matrix((2.5, 0.05, 0.7571)))
    scene, corners, number = facets_of(wall, plate)
    narrow = np.flatnonzero((corners[..., 0] > 4.9).all(axis=1) & (np.ptp(corners[..., 1], axis=1) < 1e-3))
    assert len(narrow) == 2
    guided, _ = CornerVisibility(VIEW, corners, number, shared_vertices(corners)).visible(scene)
    assert all(0 < each.sum() < 3 for each in guided[narrow])

    def sampled_facets(**more):
        found = sample_visibility(scene, VIEW, corners, number, guided, WAVENUMBER, 0.1, **more)
        return np.isin(narrow, found.owner), found.missed[narrow].max()

    sampled, missed = sampled_facets(reach=6e-3, occluder_distance=2.5)
    assert sampled.all()
    little = [{}, {"reach": 6e-3}, {"reach": 0.0, "occluder_distance": 2.5}, {"reach": 6e-3, "occluder_distance": 5.1}]
    for more in little:
        sampled, of_itself = sampled_facets(**more)
        assert not sampled.any()
        assert of_itself < missed  # of the facet alone, which is negligible
