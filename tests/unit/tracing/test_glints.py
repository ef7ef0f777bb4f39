"""What glints are found with: places and bends of chosen faces, zeros in triangles, matching, folds."""

from types import SimpleNamespace

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad

from rfgen_sionna.scene import Actor
from rfgen_sionna.tracing.glint_pieces import SHARP, TURN, Pieces
from rfgen_sionna.tracing.glint_search import _barycentre
from rfgen_sionna.tracing.glints import Glints, matched
from rfgen_sionna.tracing.surfaces import collect_surfaces
from rfgen_sionna.tracing.tubes.skin import Skin, corner_bends


@pytest.fixture(scope="module")
def two():
    """A bent mesh that is no sphere, and a cylinder with its sharp rims."""
    egg = trimesh.creation.icosphere(3, 0.2)
    egg.apply_scale((1.0, 0.6, 0.8))
    rod = trimesh.creation.cylinder(radius=0.05, height=0.4, sections=32)
    actors = [Actor.from_mesh(mesh, material="pec", name=name) for mesh, name in ((egg, "egg"), (rod, "rod"))]
    return collect_surfaces(None, actors).moving, [actor.vertices(0.0) for actor in actors]


def test_some_faces_stand_as_all_do(two):
    surfaces, vertices = two
    every = Skin.of(surfaces, vertices)
    facet = np.random.default_rng(1).integers(0, len(every.corners), 50)
    some = Skin.some(surfaces, vertices, facet)
    for name in ("corners", "normals", "rises"):
        assert getattr(some, name) == pytest.approx(getattr(every, name)[facet], abs=1e-15)


def test_a_skin_at_another_time_has_the_sheets_of_the_first(two):
    surfaces, vertices = two
    first = Skin.one(surfaces[1], vertices[1])
    later = Skin.one(surfaces[1], vertices[1] + 0.1, like=first)
    assert np.array_equal(later.sheet, first.sheet)
    assert later.corners == pytest.approx(first.corners + 0.1)
    assert len(later.bends) == 0
    met = later.meet(np.array([[1.0, 0.1, 0.1]]), np.array([[-1.0, 0.0, 0.0]]), np.array([3]), np.full((1, 3), 1 / 3))
    assert not met.bend.any()


def test_bends_of_some_faces_are_those_of_all(two):
    surfaces, vertices = two
    for surface, points in zip(surfaces, vertices, strict=True):
        skin = Skin.one(surface, points)
        face = np.array([0, 5, 5, len(surface.faces) - 1])
        assert corner_bends(surface, skin.corners, skin.normals, face) == pytest.approx(skin.bends[face], abs=1e-9)


def test_bends_are_those_of_a_cylinder(two):
    """1 / radius around it, nothing along it."""
    surfaces, vertices = two
    skin = Skin.one(surfaces[1], vertices[1])
    side = np.flatnonzero(np.abs(skin.normals[:, :, 2]).max(axis=1) < 0.1)
    found = np.sort(np.linalg.eigvalsh(skin.bends[side].reshape(-1, 3, 3)), axis=1)
    assert found[:, 2] == pytest.approx(1 / 0.05, rel=0.02)
    assert np.abs(found[:, :2]).max() < 0.05 / 0.05


def test_pieces_turn_no_more_than_they_may_and_cover_their_faces(two):
    surfaces, vertices = two
    skin = Skin.of(surfaces, vertices)
    pieces = Pieces.of(skin, np.arange(len(skin.corners)), np.zeros(3))
    place = pieces.corners.reshape(-1, 3)
    normal = np.einsum("pc,pci->pi", place, skin.normals[np.repeat(pieces.facet, 3)]).reshape(-1, 3, 3)
    normal /= np.linalg.norm(normal, axis=2, keepdims=True)
    cos = np.einsum("pci,pci->pc", normal, normal[:, [1, 2, 0]])
    assert np.arccos(np.clip(cos, -1, 1)).max() < 1.1 * SHARP
    assert pieces.turn.max() < 1.1 * SHARP
    assert pieces.turn.min() < TURN
    area = np.abs(np.linalg.det(pieces.corners))
    assert np.bincount(pieces.facet, area, len(skin.corners)) == pytest.approx(1.0)
    # Every node is a corner of a piece that has it.
    piece, corner = np.divmod(pieces.at, 3)
    assert np.array_equal(pieces.node[piece, corner], np.arange(len(pieces.at)))


@given(st.lists(st.tuples(st.floats(-1, 1), st.floats(-1, 1)), min_size=3, max_size=3))
def test_zero_is_found_where_it_is(corners):
    triangle = np.array(corners)[None]
    share = _barycentre(triangle)[0]
    if share.min() > -1 + 1e-9:  # it has an area
        assert share.sum() == pytest.approx(1.0)
        if np.abs(share).max() < 1e6:
            assert np.einsum("c,cv->v", share, triangle[0]) == pytest.approx(0.0, abs=1e-6)


def test_matches_are_mutual_and_near():
    one = np.array([[0.0, 0.0], [1.0, 0.0], [5.0, 0.0]])
    other = np.array([[0.9, 0.0], [0.05, 0.0], [0.2, 0.0], [5.5, 0.0]])
    first, second = matched(one, other, 0.3)
    assert dict(zip(first.tolist(), second.tolist(), strict=True)) == {0: 1, 1: 0}
    assert len(matched(one[:0], other, 0.3)[0]) == 0


def glint(twist):
    """Two flat surfaces across the x axis, of which one bends by `twist` [1/m^2] along z."""
    twists = np.zeros((1, 2, 3, 3, 3))
    twists[0, 0, 2, 2, 2] = twist
    normal = np.tile([1.0, 0.0, 0.0], (1, 2, 1))
    return Glints(np.zeros((1, 2), np.int64), np.zeros((1, 2, 3)), np.zeros((1, 2, 3)), normal,
                  np.zeros((1, 2, 3, 3)), twists)  # fmt: skip


def softened(curvature, twist, wavenumber):
    """Of a glint whose phase has this `curvature` [1/m] along the first surface's z axis; legs turn by 2 there."""
    legs = tuple(np.array([each]) for each in ([-1.0, 0, 0], [1.0, 0, 0], [-1.0, 0, 0]))
    arrival = SimpleNamespace(hessian=np.diag([curvature, 30.0, 30.0, 30.0])[None], legs=legs)
    return glint(twist).softened(arrival, wavenumber)[0]


@pytest.mark.parametrize("apart", [0.0, 0.5, 1.0, 2.0, 6.0])
def test_two_glints_that_meet_return_what_the_integral_does(apart):
    """Around a fold, phase k (h x^2 / 2 + c x^3 / 6): two glints, `apart` by so much of it [rad], against the integral
    along a path on which that falls off: within 3.5 dB at the fold itself, 1 dB where they are 2 rad apart and more. By
    geometrical optics they have no bound there."""
    wavenumber, twist = 1600.0, 300.0
    cubic = 2.0 * twist
    curvature = max((1.5 * apart * cubic**2 / wavenumber) ** (1 / 3), 1e-6)

    def phase(x):
        return wavenumber * (curvature * x**2 / 2 + cubic * x**3 / 6)

    middle = -curvature / cubic

    def leg(angle):
        turn = np.exp(1j * angle)
        return quad(lambda s: np.exp(1j * phase(middle + s * turn)) * turn, 0.0, 0.2, limit=400, complex_func=True)[0]

    truth = leg(np.pi / 6) - leg(5 * np.pi / 6)
    single = softened(curvature, twist, wavenumber) * np.sqrt(2 * np.pi / (wavenumber * curvature))
    found = single * (np.exp(0.25j * np.pi) + np.exp(1j * phase(-2 * curvature / cubic) - 0.25j * np.pi))
    assert abs(20 * np.log10(abs(found / truth))) < (1.0 if apart >= 2.0 else 3.5)


def test_glints_far_from_folds_stay_as_they_are():
    assert softened(2.0, 0.0, 1600.0) == 1.0
    assert softened(1e-6, 0.0, 1600.0) == 1.0
    assert softened(30.0, 100.0, 1600.0) > 0.98
    assert softened(1e-3, 50.0, 1600.0) < 0.05
