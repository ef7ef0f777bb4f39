"""Directions as whole numbers: triangles that cover the sphere once, at every level, and share their corners."""

import numpy as np
import pytest

from tests.reference.sbr import lattice

EYE = np.eye(3)


def solid_angle(cells):
    a, b, c = np.moveaxis(lattice.directions(cells, EYE), 1, 0)
    volume = np.abs(np.einsum("ci,ci->c", a, np.cross(b, c)))
    dots = 1 + (a * b).sum(1) + (b * c).sum(1) + (c * a).sum(1)
    return 2 * np.arctan2(volume, dots)  # van Oosterom and Strackee


@pytest.mark.parametrize("level", [0, 1, 3])
def test_cells_cover_the_sphere_once(level):
    cells = lattice.cells(level)
    assert len(cells) == 8 * 4**level
    assert solid_angle(cells).sum() == pytest.approx(4 * np.pi, rel=1e-12)
    # Euler: a closed surface of triangles has two corners more than half of its faces.
    assert len(np.unique(lattice.keys(cells.reshape(-1, 3)))) == len(cells) // 2 + 2


def test_quarters_are_the_next_level_to_the_bit():
    quarters, finer = lattice.quarters(lattice.cells(2)), lattice.cells(3)
    assert set(lattice.cell_keys(quarters)) == set(lattice.cell_keys(finer))
    assert set(lattice.keys(quarters.reshape(-1, 3))) == set(lattice.keys(finer.reshape(-1, 3)))


def test_a_direction_falls_into_the_cell_around_it():
    rng = np.random.default_rng(1)
    directions = rng.normal(size=(200, 3))
    for level in (0, 4, 9):
        for one in directions[:50]:
            cell = lattice.cells_of(one[None], level)
            assert len(cell) == 1
            weights = np.linalg.solve(cell[0].T.astype(float), one)
            assert (weights > -1e-9).all()
    assert (np.abs(lattice.cells_of(directions, 7)).sum(axis=2) == lattice.SIZE).all()


def test_a_direction_along_an_axis_has_a_cell():
    for axis in np.concatenate([EYE, -EYE]):
        cell = lattice.cells_of(axis[None], 5)
        assert (np.abs(cell).sum(axis=2) == lattice.SIZE).all()
        assert np.abs(lattice.directions(cell, EYE) - axis).max() < 0.1


def test_middles_stay_on_the_octahedron_however_often_they_are_taken():
    rng = np.random.default_rng(2)
    cell = lattice.cells(3)[:1]
    for _ in range(40):
        cell = lattice.quarters(cell)[[rng.integers(4)]]
        assert (np.abs(cell).sum(axis=2) == lattice.SIZE).all()


def test_the_nearest_node_of_a_direction_is_the_one_it_was_of():
    """Nodes of all faces, corners and edges of the octahedron among them; others are off by a node at most."""
    nodes = np.unique(lattice.cells(3).reshape(-1, 3), axis=0)
    turned = lattice.directions(nodes, np.eye(3))
    assert (lattice.nearest(7.0 * turned) == nodes).all()
    rays = np.random.default_rng(0).normal(size=(1000, 3))
    found = lattice.nearest(rays)
    assert (np.abs(found).sum(axis=1) == lattice.SIZE).all()
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    assert np.abs(lattice.directions(found, np.eye(3)) - rays).max() < 2e-8
