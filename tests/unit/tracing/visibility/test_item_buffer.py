"""Visible fractions and shadows by pixels against geometry."""

import numpy as np
import pytest
import trimesh

from rfgen_sionna.tracing.visibility.item_buffer import ItemBuffer, Meshes, Resolution, choose_views

NOTHING = np.zeros((0, 3, 3))
RESOLUTION = Resolution(20.0, 400)


def meshes(*parts):
    """Meshes and (vertex, 3) positions of `parts`, closed ones single-sided."""
    vertices = np.cumsum([0, *(len(each.vertices) for each in parts)])
    facets = np.cumsum([0, *(len(each.faces) for each in parts)])
    corners = np.concatenate([each.faces + first for each, first in zip(parts, vertices, strict=False)])
    single = np.concatenate([np.full(len(each.faces), each.is_watertight) for each in parts])

    def ranges(bounds):
        return np.column_stack([bounds[:-1], bounds[1:]]).astype(np.int32)

    found = Meshes(corners.astype(np.int32), single, ranges(vertices), ranges(facets))
    return found, np.concatenate([np.asarray(each.vertices, np.float64) for each in parts])


def seen(parts, static=NOTHING):
    own, points = meshes(*parts)
    buffer = ItemBuffer(own, choose_views([points], own, RESOLUTION), static)
    found = np.zeros(len(own.corners))
    return found, buffer.fractions(points, found), buffer


def square(x, low, high, z=0.5):
    """Square sheet across the x axis, from y = low to high."""
    corners = [[x, low, -z], [x, high, -z], [x, high, z], [x, low, z]]
    return trimesh.Trimesh(corners, [[0, 1, 2], [0, 2, 3]], process=False)


def area(pieces, count):
    """Share of the area in some `pieces` (2, 3, 3)."""
    return sum(abs(np.linalg.det(each)) for each in pieces[:count])


@pytest.mark.parametrize("place", [(3, 0, 0), (0.3, 0.2, 0.1), (20, -3, 1)])
def test_a_ball_alone_is_seen_where_it_faces_the_viewpoint(place):
    ball = trimesh.creation.icosphere(3, 0.1).apply_translation(place)
    found, cuts, _ = seen([ball])
    facing = (ball.face_normals * ball.triangles_center).sum(axis=1) < 0
    assert not found[~facing].any()
    # Faces seen all but edge-on, thinner than a pixel, are left out at the rim.
    away = ball.triangles_center / np.linalg.norm(ball.triangles_center, axis=1, keepdims=True)
    towards = ball.area_faces * np.maximum(-(ball.face_normals * away).sum(axis=1), 0.0)
    assert towards @ (1.0 - found) < 1e-3 * towards.sum()
    assert not len(cuts.facet)


def test_half_a_plate_behind_a_screen():
    """The share of each triangle, and its cut along the edge of the shadow."""
    found, cuts, _ = seen([square(2.0, -0.5, 0.5), square(1.0, -1.0, 0.05)])
    # The shadow's edge is at y = 0.1: 1 - 0.6^2 of the triangle right of the diagonal is left, 0.4^2 of the other one.
    shares = [1 - 0.6**2, 0.4**2]
    # Pixels are square to the view's axis, 9 degrees aside: over 1 m at 2 m depths differ by 8 %, shares by half of it.
    assert found[:2] == pytest.approx(shares, abs=0.04)
    assert list(cuts.facet[:2]) == [0, 1]
    for facet, pieces, count in zip(cuts.facet, cuts.pieces, cuts.triangles, strict=True):
        assert area(pieces, count) == pytest.approx(shares[facet], abs=0.01)
        places = np.concatenate(pieces[:count]) @ square(2.0, -0.5, 0.5).triangles[facet]
        assert places[:, 1].min() == pytest.approx(0.1, abs=0.01)


@pytest.mark.parametrize("turn", [0.3, 1.0, 2.0, 3.3, 4.4, 5.5])
def test_a_straight_edge_is_found_as_it_lies(turn):
    """An edge aslant over a plate, from each side: corners of the cuts are on its shadow or in its light."""
    edge = np.array([np.cos(turn), np.sin(turn)])
    across = np.array([-edge[1], edge[0]])
    corners = [across * s + edge * d for s, d in ((-2, 0.04), (2, 0.04), (2, -2), (-2, -2))]
    screen = trimesh.Trimesh([[1.0, *each] for each in corners], [[0, 1, 2], [0, 2, 3]], process=False)
    plate = square(2.0, -0.5, 0.5)
    _, cuts, _ = seen([plate, screen])
    parts = [
        np.concatenate(pieces[:count]) @ plate.triangles[facet]
        for facet, pieces, count in zip(cuts.facet, cuts.pieces, cuts.triangles, strict=True)
        if facet < 2
    ]
    assert parts
    for each in parts:
        assert (each[:, 1:] @ edge).min() == pytest.approx(0.08, abs=0.015)


def test_surfaces_beside_each_other_have_views_of_their_own():
    own, points = meshes(*(trimesh.creation.icosphere(2, 0.1).apply_translation((2, y, 0)) for y in (-1.0, 1.0)))
    views = choose_views([points], own, RESOLUTION)
    assert [each.surfaces for each in views] == [(0,), (1,)]


def test_a_surface_around_the_viewpoint_takes_six_views():
    room = trimesh.creation.box((4, 5, 3))
    room.invert()
    found, _, buffer = seen([room])
    assert len(buffer.views) == 6
    assert np.all(found == 1.0)


def test_an_actor_hides_its_share_of_what_stands_behind():
    """Facets at rest lose the pixels before which the actor stands, and get them back beside it."""
    wall = square(4.0, -2.0, 2.0, 2.0).triangles
    _, _, buffer = seen([square(2.0, -0.25, 0.25, 0.25)], wall)
    shadows = buffer.shadows()
    assert len(shadows.facet) == 2
    assert (1 - shadows.left).sum() * 8.0 == pytest.approx(1.0, rel=0.02)  # 1 m^2 of two triangles of 8 m^2
    _, _, beside = seen([square(2.0, 3.0, 3.5, 0.25)], wall)
    assert not len(beside.shadows().facet)


def fine(triangles, times):
    """Each triangle in four, so many `times` over."""
    for _ in range(times):
        a, b, c = np.moveaxis(triangles, 1, 0)
        d, e, f = 0.5 * (b + c), 0.5 * (c + a), 0.5 * (a + b)
        triangles = np.concatenate([np.stack(each, axis=1) for each in ((a, f, e), (f, b, d), (e, d, c), (d, e, f))])
    return triangles


def test_small_facets_behind_an_actor_are_wholly_hidden():
    """However few their pixels."""
    wall = fine(square(4.0, -0.4, 0.4, 0.4).triangles, 6)
    _, _, buffer = seen([square(2.0, -0.25, 0.25, 0.25)], wall)
    shadows = buffer.shadows()
    assert len(shadows.facet) == len(wall)
    assert not shadows.left.any()
    assert not len(shadows.hidden.facet)


def test_what_stands_before_an_actor_hides_it():
    screen = square(1.0, -1.0, 1.0).triangles
    found, _, _ = seen([trimesh.creation.icosphere(2, 0.1).apply_translation((2, 0, 0))], screen)
    assert not found.any()
