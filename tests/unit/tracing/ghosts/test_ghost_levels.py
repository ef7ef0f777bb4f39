"""Estimated levels of ghosts."""

import numpy as np
import pytest

from rfgen_sionna.radar import Radar
from rfgen_sionna.scene import load_scene, tabulated
from rfgen_sionna.tracing.ghosts.ghost_levels import ghost_levels
from rfgen_sionna.tracing.tracer import Tracer
from tests.sionna.rectangles import scene_of

POINT = np.array([[2.0, 0.2, 1.0]])
WALLS = {"left": 1.5, "right": -1.2}


@pytest.fixture(scope="module")
def known():
    radar = tabulated(Radar.load("awr1843", position=(0, 0, 1), overrides={"pattern": {"kind": "sionna:iso"}}))
    corners = {name: [[-1.0, y, 0.5], [4.0, y, 0.5], [4.0, y, 1.5], [-1.0, y, 1.5]] for name, y in WALLS.items()}
    walls = {name: (each, "pec", 0.1) for name, each in corners.items()}
    mirrors = Tracer(load_scene(scene_of(77e9, **walls).sionna), radar, [], rtol=1e-2).mirrors
    assert len(mirrors) == 2
    return radar, lambda direction: np.ones(np.shape(direction)[:-1]), mirrors


def lengths():
    """Path lengths directly and by the walls."""
    straight = np.linalg.norm(POINT[0] - [0, 0, 1])
    return straight, {name: np.hypot(POINT[0, 0], 2 * y - POINT[0, 1]) for name, y in WALLS.items()}


def test_levels_go_with_the_spreading_of_each_way(known):
    """Metal walls, relative to the direct return; two directions count for one mirror and for two."""
    straight, by = lengths()
    left, right = by["left"], by["right"]
    levels, across = ghost_levels(*known, POINT, 3)
    ordered = sorted(levels.tolist())
    for found, length in zip(ordered, sorted(by.values(), reverse=True), strict=True):
        assert found == pytest.approx([2 * straight / length, (straight / length) ** 2], rel=1e-6)
    assert np.count_nonzero(across) == 1
    assert across[0, 1] == pytest.approx(2 * straight**2 / (left * right), rel=1e-6)


@pytest.mark.parametrize(("beyond", "once", "twice", "both"), [(0.03, 2, 1, 1), (-0.03, 2, 1, 0), (-0.2, 2, 0, 0)])
def test_beyond_the_range_window_there_are_none(known, monkeypatch, beyond, once, twice, both):
    """Half of the whole path length counts."""
    _, by = lengths()
    monkeypatch.setattr(Radar, "max_range", property(lambda _: float(np.mean(list(by.values()))) + beyond))
    levels, across = ghost_levels(*known, POINT, 3)
    assert np.count_nonzero(levels, axis=0).tolist() == [once, twice]
    assert np.count_nonzero(across) == both


def test_two_bounces_are_by_one_wall_once(known):
    levels, across = ghost_levels(*known, POINT, 2)
    assert (levels[:, 0] > 0).all()
    assert not levels[:, 1].any()
    assert not across.any()


def test_points_behind_a_wall_have_none(known):
    for points in (POINT + np.array([0, 2.0, 0]), np.zeros((0, 3))):
        assert not ghost_levels(*known, points, 3).across.any()
