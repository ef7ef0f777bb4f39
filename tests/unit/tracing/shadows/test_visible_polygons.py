"""Visible polygons: areas left by straight and round shadow boundaries, in disjoint pieces."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import trapezoid

from rfgen_sionna.tracing.shadows.lattices import SPACINGS
from rfgen_sionna.tracing.shadows.visible_polygons import find_visible_polygons
from tests.unit.tracing.shadows.barycentric import barycentric_lattice

value = st.floats(0.05, 1.0)


class Light:
    """Light where a function of facets (ray,) and barycentric coordinates (ray, 3) is true."""

    def __init__(self, visible):
        self.visible = visible

    def edges(self, of, unoccluded, occluded, halvings):
        unoccluded, occluded = unoccluded.copy(), occluded.copy()
        for count in range(halvings.max(initial=0)):
            middle = 0.5 * (unoccluded + occluded)
            visible, on = self.visible(of, middle), count < halvings
            unoccluded[on & visible], occluded[on & ~visible] = middle[on & visible], middle[on & ~visible]
        return 0.5 * (unoccluded + occluded), np.full(len(unoccluded), 0.4)


def share_of(values, level, width=0.0):
    """Visible polygons of one facet where a linear function with corner `values` is positive."""
    return find_visible_polygons(
        Light(lambda _, place: place @ np.asarray(values) > 0), np.array([level]), np.array([width])
    )


@given(st.tuples(value, value, value), st.integers(0, 2), st.booleans(), st.integers(0, 5))
def test_a_straight_boundary_leaves_its_geometric_share(sizes, odd, unoccluded, level):
    """Triangle with corner i alone on one side: f_i^2 / ((f_i - f_j) (f_i - f_k)) of the area."""
    f = -np.array(sizes)
    f[odd] *= -1
    corner = f[odd] ** 2 / np.prod([f[odd] - f[(odd + k) % 3] for k in (1, 2)])
    found = share_of(f if unoccluded else -f, level)
    # Crossings are found to a thirty-second of a cell's edge; the shadow crosses fewer than 4 n of them.
    assert found.fraction[0] == pytest.approx(corner if unoccluded else 1 - corner, abs=0.07 / SPACINGS[level])
    size = np.linalg.det(found.pieces)
    # Rays aim a two-thousandth of the facet beside the lattice: a sliver on a cell's edge may turn over by as much.
    assert (size > -5e-4 / SPACINGS[level]).all()
    assert size.sum() == pytest.approx(found.fraction[0], abs=1e-3 / SPACINGS[level])


@pytest.mark.parametrize("level", [0, 3, 5])
def test_boundaries_of_facets_of_many_wavelengths_are_found_more_sharply(level):
    """To less than a tenth of a radian, with no more rays than needed."""
    rng = np.random.default_rng(1)
    for width in (0.1, 10.0, 100.0):
        errors, rays = [], []
        for first in rng.uniform(0.2, 0.8, 40).tolist():
            found = share_of((-first, 1.0 - first, 1.0 - first), level, width)
            # The shadow boundary is parallel to a side of the facet.
            errors.append(width * (np.sqrt(1.0 - found.fraction[0]) - first))
            rays.append(found.rays)
        plain = share_of((-0.5, 0.51, 0.49), level, 0.0).rays
        # Tolerance is a twentieth of a radian; eight bisections leave 1 / 256 / sqrt(12) of a cell.
        assert np.sqrt(np.mean(np.square(errors))) < max(0.08, 0.002 * width / SPACINGS[level])
        if width / SPACINGS[level] < 1.0:
            assert max(rays) <= 2 * plain


@given(st.lists(st.tuples(st.floats(-1, 1), st.floats(-1, 1), st.floats(-1, 1)), min_size=2, max_size=8), st.data())
def test_facets_of_all_levels_are_independent(values, data):
    """A batch agrees with single facets, and pieces lie in the visible part."""
    levels = np.array([data.draw(st.integers(0, 5)) for _ in values])
    table = np.array(values)
    found = find_visible_polygons(
        Light(lambda of, place: np.einsum("rc,rc->r", place, table[of]) > 0), levels, np.zeros(len(values))
    )
    for k, (row, level) in enumerate(zip(values, levels, strict=True)):
        alone = share_of(row, int(level))
        assert found.fraction[k] == pytest.approx(alone.fraction[0], abs=1e-12)
        pieces = found.pieces[found.owner == k]
        assert len(pieces) == len(alone.pieces)
        inside = pieces.mean(axis=1) @ np.array(row)
        assert (inside > -np.ptp(row) / 16 / SPACINGS[level]).all()


def test_round_shadows_converge_with_the_square_of_the_spacing():
    rng = np.random.default_rng(0)
    corners = np.array([[0.0, 0.0], [1.0, 0.0], [0.3, 0.9]])
    fine = barycentric_lattice(400) @ corners
    errors = np.zeros((40, len(SPACINGS)))
    for row in errors:
        centre, radius = corners.mean(axis=0) + rng.uniform(-0.5, 0.5, 2), rng.uniform(0.2, 0.6)
        truth = (np.linalg.norm(fine - centre, axis=1) > radius).mean()
        for level in range(len(SPACINGS)):
            found = find_visible_polygons(
                Light(lambda _, place, c=centre, r=radius: np.linalg.norm(place @ corners - c, axis=1) > r),
                np.array([level]),
                np.zeros(1),
            )
            row[level] = found.fraction[0] - truth
    rms = np.sqrt((errors**2).mean(axis=0))
    assert (rms[1:] < 0.35 / np.array(SPACINGS[1:]) ** 2).all()


def test_visible_cells_are_joined():
    """A shadow on a corner leaves few pieces, not a thousand cells."""
    found = share_of((-0.01, 1.0, 1.0), 5)
    assert len(found.pieces) < 60
    assert found.rays < 700


@given(st.tuples(value, value, value), st.integers(0, 2), st.booleans(), st.integers(0, 5))
def test_one_straight_boundary_leaves_one_or_two_triangles(sizes, odd, unoccluded, level):
    f = -np.array(sizes)
    f[odd] *= -1
    found = share_of(f if unoccluded else -f, level)
    # Near a corner the boundary may pass between it and the next points.
    assert len(found.pieces) in ((0, 1) if unoccluded else (0, 2)) or found.fraction[0] in (0.0, 1.0)


@pytest.mark.parametrize("level", [3, 4, 5])
def test_boundaries_other_than_one_straight_line_are_followed(level):
    """Slit, corner and island of shadow: their areas differ much from those of one line."""
    cells = SPACINGS[level]
    shapes = {
        "slit": (lambda p: np.abs(p[:, 0] - 0.4) < 0.15, 0.75**2 - 0.45**2),
        "patch": (lambda p: (p[:, 0] > 0.5) | (p[:, 1] > 0.5), 0.5),
        "island": (lambda p: (p > 0.15).all(axis=1), (1 - 3 * 0.15) ** 2),
    }
    for name, (shape, area) in shapes.items():
        for light in (True, False):
            found = find_visible_polygons(
                Light(lambda _, p, shape=shape, light=light: shape(p) == light), np.array([level]), np.zeros(1)
            )
            assert found.fraction[0] == pytest.approx(area if light else 1 - area, abs=0.3 / cells), name
            assert len(found.pieces) > 2, name
            # Visible points lie in one piece, others in none, but for a few beside edges.
            points = np.random.default_rng(0).dirichlet(np.ones(3), 2000)
            on = (np.einsum("nj,pjk->pnk", points, np.linalg.inv(found.pieces)) >= 0).all(axis=2).sum(axis=0)
            assert (on != (shape(points) == light)).mean() < 0.6 / cells, name


@pytest.mark.parametrize("level", [2, 3, 4, 5])
def test_a_nearly_straight_boundary_is_one_line_with_the_same_area(level):
    """Boundary with a third of the largest sagitta, on 300 facets: a chord would leave two thirds of it out."""
    cells, rng = SPACINGS[level], np.random.default_rng(level)
    begin = rng.uniform(0.2, 0.7, 300)
    edge_curvature = 0.3 * 0.1 / cells**2

    def visible(of, p):
        along = (p[:, 1] - p[:, 2]) / (1 - begin[of])
        return p[:, 0] > begin[of] + edge_curvature * (1 - along**2)

    found = find_visible_polygons(Light(visible), np.full(300, level), np.zeros(300))
    assert len(found.pieces) == 300
    across = np.linspace(-1, 1, 2001)[:, None] * (1 - begin)
    height = 1 - np.abs(across) - begin - edge_curvature * (1 - (across / (1 - begin)) ** 2)
    expected = trapezoid(np.maximum(height, 0), across, axis=0)
    # Each crossing is known to 0.094 / n^2, evenly: the ends and the mean of all to a third of it at most. And rays aim
    # a two-thousandth of the facet beside the lattice.
    assert np.sqrt(np.mean((found.fraction - expected) ** 2)) < 0.094 / 3 / cells**2 + 5e-4
    assert abs((found.fraction - expected).mean()) < edge_curvature / 3 + 5e-4


def test_a_curved_boundary_is_no_line():
    found = find_visible_polygons(
        Light(lambda _, p: p[:, 0] > 0.4 + 0.1 * (1 - (p[:, 1] - p[:, 2]) ** 2)), np.array([4]), np.zeros(1)
    )
    assert len(found.pieces) > 10


@given(st.tuples(value, value, value), st.integers(0, 5))
def test_pieces_mark_the_side_on_the_boundary(values, level):
    """From the second to the third corner, with the visible part on the left."""
    found = share_of(values, level)
    edged = np.flatnonzero(~np.isnan(found.occluder[:, 0]))
    assert np.isnan(found.occluder).any(axis=1).sum() == len(found.occluder) - len(edged)
    assert (found.occluder[edged] == 0.4).all()
    corners = found.pieces[edged]
    light = corners @ np.asarray(values)
    size = np.ptp(values)
    assert (np.abs(light[:, 1:]) < 0.02 * size).all()
    assert (light[:, 0] > -0.02 * size).all()
    assert (np.linalg.det(corners) > -1e-12).all()
    # All of the edge is there: as long as the line is on the facet.
    if len(edged) and found.fraction[0] not in (0.0, 1.0):
        places = np.array([[0, 0], [1, 0], [0, 1]])
        length = np.linalg.norm((corners[:, 2] - corners[:, 1]) @ places, axis=1).sum()
        ends = []
        for i in range(3):
            a, b = values[i], values[(i + 1) % 3]
            if (a > 0) != (b > 0):
                ends.append(places[i] + a / (a - b) * (places[(i + 1) % 3] - places[i]))
        assert length == pytest.approx(np.linalg.norm(ends[0] - ends[1]), abs=0.02)


@given(st.tuples(value, value, value), st.integers(0, 2), st.booleans(), st.integers(0, 5))
def test_straight_boundaries_end_on_the_facet_s_sides(sizes, odd, unoccluded, level):
    """Rays are inset, but visible parts extend to the facet's sides: slivers would count as edges."""
    f = -np.array(sizes)
    f[odd] *= -1
    found = share_of(f if unoccluded else -f, level)
    edged = np.isfinite(found.occluder).all(axis=1)
    for piece in found.pieces[edged]:
        for end in piece[1:]:
            assert np.abs(end).min() < 1e-9


@pytest.mark.parametrize("occluded", [False, True])
def test_corners_of_shadows_are_corners(occluded):
    """Two straight boundaries that meet in a facet: mostly as accurate as each of them alone."""
    rng = np.random.default_rng(2)
    level, errors = 3, []
    fine = barycentric_lattice(600)
    for _ in range(40):
        tip, way = rng.dirichlet([4, 4, 4]), rng.uniform(0, 2 * np.pi)
        lines = []
        for turn in (0.0, rng.uniform(0.4, 0.8) * np.pi):
            slope = np.array([np.cos(way + turn), np.sin(way + turn), 0.0])
            lines.append(slope - slope @ tip)  # coordinates add up to 1

        def visible(_, place, lines=lines):
            return ((place @ lines[0] > 0) & (place @ lines[1] > 0)) ^ occluded

        found = find_visible_polygons(Light(visible), np.array([level]), np.zeros(1))
        size = np.linalg.det(found.pieces)
        assert (size > -1e-4).all()
        assert size.sum() == pytest.approx(found.fraction[0], abs=1e-4)
        errors.append(found.fraction[0] - visible(None, fine).mean())
    median, most = np.percentile(np.abs(errors), [50, 75]) * SPACINGS[level] ** 2
    assert median < 0.03
    assert most < 0.1
