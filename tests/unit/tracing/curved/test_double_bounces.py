"""Specular double bounces: smooth surfaces and curvatures, patches and their pairs, matching, folds."""

from types import SimpleNamespace

import numpy as np
import pytest
import trimesh
from scipy.integrate import quad
from scipy.optimize import least_squares

from rfgen_sionna.scene import MeshActor
from rfgen_sionna.tracing.curved.double_bounces import DoubleBounces, match_points, unit_normals
from rfgen_sionna.tracing.curved.patch_pairs import (
    MAX_SPREAD,
    PathLimits,
    _initial_pairs,
    _visible_pairs,
    candidate_pairs,
)
from rfgen_sionna.tracing.curved.smoothed_surface import SmoothedSurface, corner_curvatures
from rfgen_sionna.tracing.curved.specular_points import find_specular_points
from rfgen_sionna.tracing.curved.surface_patches import PatchSubdivision, SurfacePatches, angular_radius
from rfgen_sionna.tracing.surface.surfaces import collect_surfaces


@pytest.fixture(scope="module")
def two():
    """An ellipsoid, and a cylinder with sharp edges."""
    egg = trimesh.creation.icosphere(3, 0.2)
    egg.apply_scale((1.0, 0.6, 0.8))
    rod = trimesh.creation.cylinder(radius=0.05, height=0.4, sections=32)
    actors = [MeshActor.from_mesh(mesh, material="pec", name=name) for mesh, name in ((egg, "egg"), (rod, "rod"))]
    return collect_surfaces(None, actors).moving, [actor.vertices(0.0) for actor in actors]


def smoothed(surfaces, vertices):
    return SmoothedSurface.joined(
        [SmoothedSurface.one(each, points) for each, points in zip(surfaces, vertices, strict=True)]
    )


def curvatures_of(surface, surface_model):
    return corner_curvatures(surface, surface_model.corners, surface_model.normals, np.arange(len(surface.faces)))


def test_selected_faces_equal_those_of_the_whole_surface(two):
    surfaces, vertices = two
    every = smoothed(surfaces, vertices)
    facet = np.random.default_rng(1).integers(0, len(every.corners), 50)
    some = SmoothedSurface.some(surfaces, vertices, facet)
    for name in ("corners", "normals", "sagittas"):
        assert getattr(some, name) == pytest.approx(getattr(every, name)[facet], abs=1e-15)


def test_a_surface_at_another_time_has_the_sheets_of_the_first(two):
    surfaces, vertices = two
    first = SmoothedSurface.one(surfaces[1], vertices[1])
    later = SmoothedSurface.one(surfaces[1], vertices[1] + 0.1, like=first)
    assert np.array_equal(later.sheet, first.sheet)
    assert later.corners == pytest.approx(first.corners + 0.1)


def test_curvatures_of_selected_faces_equal_those_of_all(two):
    surfaces, vertices = two
    for surface, points in zip(surfaces, vertices, strict=True):
        surface_model = SmoothedSurface.one(surface, points)
        every = curvatures_of(surface, surface_model)
        face = np.array([0, 5, 5, len(surface.faces) - 1])
        assert corner_curvatures(surface, surface_model.corners, surface_model.normals, face) == pytest.approx(
            every[face], abs=1e-9
        )


def test_curvatures_of_a_cylinder(two):
    """1 / radius around it, nothing along it."""
    surfaces, vertices = two
    surface_model = SmoothedSurface.one(surfaces[1], vertices[1])
    side = np.flatnonzero(np.abs(surface_model.normals[:, :, 2]).max(axis=1) < 0.1)
    found = np.sort(np.linalg.eigvalsh(curvatures_of(surfaces[1], surface_model)[side].reshape(-1, 3, 3)), axis=1)
    assert found[:, 2] == pytest.approx(1 / 0.05, rel=0.02)
    assert np.abs(found[:, :2]).max() < 0.05 / 0.05


SOURCE = np.array([-2.0, 0.3, 0.1])


def unit(vectors):
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def outgoing(surface_model, facet, weights):
    """Points on the smooth surface, relative to the source, and directions of the reflected rays."""
    place = surface_model.places(facet, weights)[1] - SOURCE
    normal, home = unit_normals(surface_model, facet, weights), -unit(place)
    return place, 2.0 * np.einsum("ni,ni->n", normal, home)[:, None] * normal - home


def inside(pieces, rng, times=20):
    """Random points on patches: patch, and barycentric coordinates on its face."""
    which = np.repeat(np.arange(len(pieces)), times)
    return which, np.einsum("nc,ncv->nv", rng.dirichlet(np.ones(3), len(which)), pieces.weights[which])


def test_rays_leave_a_patch_within_its_bounds(two):
    """Points lie in its ball and above its plane, directions within its spread; halves cover it with closer bounds."""
    surfaces, vertices = two
    surface_model, rng = smoothed(surfaces, vertices), np.random.default_rng(0)
    facet = rng.integers(0, len(surface_model.corners), 200)
    whole = SurfacePatches.of(surface_model, SOURCE, facet, np.tile(np.eye(3), (len(facet), 1, 1)))
    halves = whole.halves(surface_model, SOURCE)
    for pieces in (whole, halves, halves.halves(surface_model, SOURCE)):
        which, weights = inside(pieces, rng)
        place, out = outgoing(surface_model, pieces.facet[which], weights)
        assert (np.linalg.norm(place - pieces.middle[which], axis=1) <= pieces.radius[which] * (1 + 1e-9)).all()
        off = np.arccos(np.clip(np.einsum("ni,ni->n", out, pieces.out[which]), -1, 1))
        assert (off <= pieces.spread[which] + 1e-6).all()
        rows = pieces.rows[which].astype(np.float64)
        assert (np.einsum("ni,ni->n", rows[:, 8:11], place) >= rows[:, 11] - 1e-6).all()
        leaves = np.einsum("ni,ni->n", rows[:, 8:11], out)
        assert (leaves >= rows[:, 12] - 1e-6).all()
    area = np.abs(np.linalg.det(halves.weights)).reshape(-1, 2)
    assert area == pytest.approx(0.5)
    assert halves.spread.mean() < 0.85 * whole.spread.mean()


def test_no_pair_with_a_double_bounce_is_lost(two):
    """Random pairs of faces, turned so that rays return to the source: each is among the candidates."""
    surfaces, vertices = two
    surface_model, rng = smoothed(surfaces, vertices), np.random.default_rng(1)
    limits, count = PathLimits(0.01, 20.0), len(surface_model.corners)
    kept = 0
    for _ in range(40):
        facet = rng.integers(0, count, 2)
        weights = rng.dirichlet(np.full(3, 2.0), 2)
        place = surface_model.places(facet, weights)[1] + rng.normal(size=(2, 3))
        # Faces are moved and turned about their points.
        home, ray = unit(SOURCE - place), unit(place[1] - place[0])
        wanted = unit(home + np.array([ray, -ray]))
        if np.linalg.norm(place[1] - place[0]) < 0.05:
            continue
        corners, normals, sagittas = (np.empty((2, 3, 3)) for _ in range(3))
        for k in range(2):
            own = unit_normals(surface_model, facet[k : k + 1], weights[k : k + 1])[0]
            axis = np.cross(own, wanted[k])
            angle = np.arctan2(np.linalg.norm(axis), own @ wanted[k])
            turn = trimesh.transformations.rotation_matrix(angle, axis)[:3, :3]
            middle = surface_model.places(facet[k : k + 1], weights[k : k + 1])[1][0]
            corners[k] = (surface_model.corners[facet[k]] - middle) @ turn.T + place[k]
            normals[k], sagittas[k] = (
                surface_model.normals[facet[k]] @ turn.T,
                surface_model.sagittas[facet[k]] @ turn.T,
            )
        pair = SmoothedSurface(corners, normals, sagittas, np.zeros(2, np.int32), np.zeros(1, bool))
        subdivision = PatchSubdivision(pair, SOURCE, np.arange(2))
        found = [find_specular_points(pair, SOURCE, (subdivision.pieces.facet[one], subdivision.pieces.facet[other]),
                        (subdivision.pieces.weights[one], subdivision.pieces.weights[other]))
                 for one, other in candidate_pairs(subdivision, np.ones(2, bool), limits)]  # fmt: skip
        spots = np.concatenate([each.weights for each in found]) if found else np.zeros((0, 2, 3))
        gap = np.abs(spots - weights).max(axis=(1, 2)), np.abs(spots[:, ::-1] - weights).max(axis=(1, 2))
        assert min(each.min(initial=np.inf) for each in gap) < 1e-5
        kept += 1
    assert kept > 30


@pytest.mark.parametrize("count", [1, 2, 3, 5, 64, 255, 257, 600])
def test_blocks_of_patches_lose_no_pair(two, count):
    """Pairs of whole faces with a required one: blocks give the same as all pairs."""
    surfaces, vertices = two
    surface_model, rng = (
        smoothed(surfaces, [vertices[0], vertices[1] + np.array([0.1, 0.5, 0.0])]),
        np.random.default_rng(count),
    )
    subdivision = PatchSubdivision(
        surface_model, SOURCE, np.sort(rng.choice(len(surface_model.corners), count, replace=False))
    )
    limits = PathLimits(0.01, 20.0)
    for required in (rng.random(count) < 0.3, np.ones(count, bool), np.arange(count) == count - 1):
        one, other = np.triu_indices(count, 1)
        some = required[one] | required[other]
        wanted = _visible_pairs(
            subdivision.pieces.rows, (one[some].astype(np.intp), other[some].astype(np.intp)), limits
        )
        found = np.sort(np.stack(_initial_pairs(subdivision, required, limits)), axis=0)
        assert set(map(tuple, found.T.tolist())) == set(map(tuple, np.stack(wanted).T.tolist()))
        assert found.shape[1] == len(wanted[0])


def test_a_radar_on_a_curved_face_ends_the_search(two):
    """Directions are unbounded there: patches are halved to the least size alone."""
    surfaces, vertices = two
    surface_model = smoothed(surfaces, vertices)
    place = surface_model.places(np.array([5]), np.full((1, 3), 1 / 3))[1][0]
    subdivision = PatchSubdivision(surface_model, place, np.arange(0, len(surface_model.corners), 9))
    list(candidate_pairs(subdivision, np.ones(len(surface_model.corners), bool), PathLimits(0.01, 20.0)))
    assert subdivision.pieces.radius.min() > 1e-6


def test_candidates_are_within_the_spread(two):
    """All pairs of :func:`candidate_pairs`, each with a required face."""
    surfaces, vertices = two
    surface_model = smoothed(surfaces, [vertices[0], vertices[1] + np.array([0.1, 0.5, 0.0])])
    subdivision, required = (
        PatchSubdivision(surface_model, SOURCE, np.arange(len(surface_model.corners))),
        np.arange(len(surface_model.corners)) < 40,
    )
    visible = 0
    for one, other in candidate_pairs(subdivision, required, PathLimits(0.01, 20.0)):
        pieces = subdivision.pieces
        assert (required[pieces.facet[one]] | required[pieces.facet[other]]).all()
        apart = np.linalg.norm(pieces.middle[one] - pieces.middle[other], axis=1)
        aside = angular_radius((pieces.radius[one] + pieces.radius[other]) / apart)
        assert (np.maximum(pieces.spread[one], pieces.spread[other]) + aside < MAX_SPREAD).all()
        visible += len(one)
    assert visible > 0


def test_specular_points_on_two_balls_have_the_shortest_path():
    """Found by the nearest patches, and by no other pair that faces the source."""
    balls = [trimesh.creation.icosphere(3, 0.2) for _ in range(2)]
    middles = np.array([[0.0, 0.0, 0.0], [0.3, 0.5, 0.1]])
    actors = [MeshActor.from_mesh(ball, material="pec", name=name) for ball, name in zip(balls, "ab", strict=True)]
    surfaces = collect_surfaces(None, actors).moving
    surface_model = smoothed(surfaces, [ball.vertices + m for ball, m in zip(balls, middles, strict=True)])
    subdivision, found = PatchSubdivision(surface_model, SOURCE, np.arange(len(surface_model.corners))), []
    for one, other in candidate_pairs(subdivision, np.ones(len(surface_model.corners), bool), PathLimits(0.01, 20.0)):
        facet = subdivision.pieces.facet[one], subdivision.pieces.facet[other]
        there = find_specular_points(
            surface_model, SOURCE, facet, (subdivision.pieces.weights[one], subdivision.pieces.weights[other])
        )
        lane = there.pair[there.overshoot <= 0]
        weights = there.weights[there.overshoot <= 0]
        for pair, own in zip(lane, weights, strict=True):
            face = np.array([facet[0][pair], facet[1][pair]])
            place, out = outgoing(surface_model, face, own)
            ray = unit(place[1] - place[0])
            assert out[0] == pytest.approx(ray, abs=1e-3)
            assert out[1] == pytest.approx(-ray, abs=1e-3)
            order = np.argsort(face)
            found.append((place + SOURCE)[order])

    def miss(x):
        place = middles + 0.2 * unit(x.reshape(2, 3))
        normal, home, ray = unit(x.reshape(2, 3)), unit(SOURCE - place), unit(place[1] - place[0])
        return (unit(home + np.array([ray, -ray])) - normal).reshape(-1)

    way = unit(middles[1] - middles[0])
    start = unit(SOURCE - middles) + np.array([way, -way])
    truth = middles + 0.2 * unit(least_squares(miss, start.reshape(-1), xtol=1e-14).x.reshape(2, 3))

    def leaves(each):
        normal, ray = each - middles, each[1] - each[0]
        return ((normal * (SOURCE - each)).sum(axis=1) > 0).all() and normal[0] @ ray > 0 > normal[1] @ ray

    outside = [each for each in found if leaves(each)]
    assert outside
    assert max(np.abs(each - truth).max() for each in outside) < 2e-3


def test_matches_are_mutual_and_near():
    one = np.array([[0.0, 0.0], [1.0, 0.0], [5.0, 0.0]])
    other = np.array([[0.9, 0.0], [0.05, 0.0], [0.2, 0.0], [5.5, 0.0]])
    first, second = match_points(one, other, 0.3)
    assert dict(zip(first.tolist(), second.tolist(), strict=True)) == {0: 1, 1: 0}
    assert len(match_points(one[:0], other, 0.3)[0]) == 0


def flat_pair(curvature_gradient):
    """Two flat surfaces across the x axis, one with a `curvature_gradient` [1/m^2] along z."""
    twists = np.zeros((1, 2, 3, 3, 3))
    twists[0, 0, 2, 2, 2] = curvature_gradient
    normal = np.tile([1.0, 0.0, 0.0], (1, 2, 1))
    return DoubleBounces(np.zeros((1, 2), np.int64), np.zeros((1, 2, 3)), np.zeros((1, 2, 3)), normal,
                  np.zeros((1, 2, 3, 3)), twists)  # fmt: skip


def caustic_factor(curvature, curvature_gradient, wavenumber):
    """Of a double bounce with phase `curvature` [1/m] along the first surface's z axis; legs turn by 2 there."""
    legs = tuple(np.array([each]) for each in ([-1.0, 0, 0], [1.0, 0, 0], [-1.0, 0, 0]))
    arrival = SimpleNamespace(hessian=np.diag([curvature, 30.0, 30.0, 30.0])[None], legs=legs)
    return flat_pair(curvature_gradient).caustic_factor(arrival, wavenumber)[0]


@pytest.mark.parametrize("apart", [0.0, 0.5, 1.0, 2.0, 6.0])
def test_two_merging_double_bounces_against_the_integral(apart):
    """Around a fold, phase k (h x^2 / 2 + c x^3 / 6): two double bounces, `apart` in phase [rad], against the integral
    along a path on which that falls off: within 3.5 dB at the fold itself, 1 dB where they are 2 rad apart and more. By
    geometrical optics they have no bound there."""
    wavenumber, curvature_gradient = 1600.0, 300.0
    cubic = 2.0 * curvature_gradient
    curvature = max((1.5 * apart * cubic**2 / wavenumber) ** (1 / 3), 1e-6)

    def phase(x):
        return wavenumber * (curvature * x**2 / 2 + cubic * x**3 / 6)

    middle = -curvature / cubic

    def leg(angle):
        turn = np.exp(1j * angle)
        return quad(lambda s: np.exp(1j * phase(middle + s * turn)) * turn, 0.0, 0.2, limit=400, complex_func=True)[0]

    truth = leg(np.pi / 6) - leg(5 * np.pi / 6)
    single = caustic_factor(curvature, curvature_gradient, wavenumber) * np.sqrt(2 * np.pi / (wavenumber * curvature))
    found = single * (np.exp(0.25j * np.pi) + np.exp(1j * phase(-2 * curvature / cubic) - 0.25j * np.pi))
    assert abs(20 * np.log10(abs(found / truth))) < (1.0 if apart >= 2.0 else 3.5)


def test_double_bounces_far_from_folds_are_unchanged():
    assert caustic_factor(2.0, 0.0, 1600.0) == 1.0
    assert caustic_factor(1e-6, 0.0, 1600.0) == 1.0
    assert caustic_factor(30.0, 100.0, 1600.0) > 0.98
    assert caustic_factor(1e-3, 50.0, 1600.0) < 0.05
