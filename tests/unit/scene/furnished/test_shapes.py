"""Closed shapes look outwards and hold what geometry says."""

import numpy as np
import pytest

from rfgen_sionna.scene.furnished import shapes
from rfgen_sionna.scene.furnished.layout import Ground
from rfgen_sionna.scene.mesh import check_mesh


def volume(part):
    a, b, c = (part.points[part.faces[:, i]] for i in range(3))
    return np.einsum("ij,ij->", a, np.cross(b, c)) / 6


CLOSED = {
    "box": (shapes.box((0, 0, 0), (1, 2, 3)), 6.0, 1e-12),
    "cushion": (shapes.cushion((1, 1, 1), 1e-6, cells=4), 1.0, 1e-4),
    "puffed cushion": (shapes.cushion((1.0, 0.6, 0.2), 0.05, 0.02), 0.126, 0.1),
    "ball": (shapes.ball(1.0, 8), 4 / 3 * np.pi, 0.05),
    "cylinder": (shapes.lathe([(1, 0), (1, 2)], 64), 2 * np.pi, 0.01),
    "cone": (shapes.lathe([(1, 0), (0, 1)], 64), np.pi / 3, 0.01),
    "pipe": (shapes.pipe([(0, 0, 0), (0, 0, 1), (0, 0, 2)], 0.1, 32), 2 * np.pi * 0.01, 0.01),
    "bent tube": (shapes.pipe([(0, 0, 0), (1, 0, 0.2), (2, 1, 0)], 0.1, 12), 2.43 * np.pi * 0.01, 0.1),
    "ring": (shapes.ring(1.0, 0.1, 48, 16), 2 * np.pi**2 * 0.01, 0.04),
    "lump": (shapes.lump((1, 1, 1), np.random.default_rng(0), 0.0, 8), np.pi / 6, 0.05),
    "mirrored": (shapes.mirrored(shapes.box((0, 0, 0), (1, 2, 3))), 6.0, 1e-12),
    "turned": (shapes.box((0, 0, 0), (1, 2, 3)).turned(33, "x").turned(20).at(5, 6, 7), 6.0, 1e-9),
}


@pytest.mark.parametrize("name", CLOSED)
def test_volume(name):
    part, expected, tolerance = CLOSED[name]
    assert volume(part) == pytest.approx(expected, rel=tolerance)


@pytest.mark.parametrize("name", ["box", "cushion", "ball", "pipe", "ring", "lump", "cylinder"])
def test_neighbouring_faces_agree(name):
    check_mesh(CLOSED[name][0].points, CLOSED[name][0].faces, name)


def test_sheets_look_up():
    part = shapes.sheet(lambda x, y: 0.1 * x, (0, 0), (1, 2), (3, 4))
    a, b, c = (part.points[part.faces[:, i]] for i in range(3))
    assert (np.cross(b - a, c - a)[:, 2] > 0).all()


def test_leaves_have_their_size():
    part = shapes.leaves(np.zeros((500, 3)), 0.1, np.random.default_rng(0))
    assert part.faces.shape == (1000, 3)
    assert 0.03 < np.linalg.norm(part.points, axis=1).mean() < 0.07


def test_joined_keeps_faces():
    two = shapes.joined([shapes.box((0, 0, 0), (1, 1, 1)).of("wood"), shapes.box((2, 0, 0), (3, 1, 1))])
    assert volume(two) == pytest.approx(2.0)
    assert two.finish == "wood"


@pytest.mark.parametrize(
    ("other", "meet"),
    [
        (Ground(1.9, 0, 2, 2, 0), True),
        (Ground(2.1, 0, 2, 2, 0), False),
        (Ground(2.3, 0, 2, 2, 45), True),
        (Ground(2.5, 0, 2, 2, 45), False),
        (Ground(2.2, 2.2, 2, 2, 45), False),
        (Ground(0, 0, 2, 2, 0, 2.0, 3.0), False),
    ],
)
def test_boxes_on_the_plan_meet(other, meet):
    one = Ground(0, 0, 2, 2, 0, 0.0, 2.0)
    assert one.meets(other) is meet
    assert other.meets(one) is meet
