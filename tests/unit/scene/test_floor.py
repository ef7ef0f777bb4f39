"""The floor under a place is the lowest surface there, and of a slab its upper side."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
import trimesh

from rfgen_sionna.scene import load_scene
from rfgen_sionna.scene.floor import floor_under


def box(name: str, low: tuple[float, float, float], high: tuple[float, float, float]) -> SimpleNamespace:
    mesh = trimesh.creation.box(bounds=[low, high])
    return SimpleNamespace(name=name, vertices=np.array(mesh.vertices), faces=np.array(mesh.faces, np.int32))


SCENE = SimpleNamespace(
    objects=(
        box("slab", (-5, -5, -0.3), (5, 5, -0.1)),
        box("table", (1, -1, 0.68), (2, 1, 0.7)),
        box("roof", (-5, 2, 2.5), (5, 5, 2.6)),
        box("hill", (10, -5, -3), (20, 5, 4)),
    )
)


@pytest.mark.parametrize(
    ("point", "expected"),
    [
        ((0.0, 0.0, 1.0), (-0.1, "slab")),
        ((1.5, 0.1, 1.0), (-0.1, "slab")),  # not the table
        ((0.0, 3.1, 10.0), (-0.1, "slab")),  # not the roof
        ((15.0, 0.2, -4.0), (-3.0, "hill")),  # nothing below
        ((30.0, 0.0, 1.0), None),
    ],
)
def test_the_lowest_surface_is_the_floor(point: tuple[float, float, float], expected: tuple[float, str] | None) -> None:
    found = floor_under(SCENE, point)  # type: ignore[arg-type]
    if expected is None:
        assert found is None
    else:
        assert found is not None
        assert found == (pytest.approx(expected[0], abs=1e-5), expected[1])


def test_free_space_has_no_floor_and_the_room_one_at_height_0() -> None:
    assert floor_under(load_scene(None), (3.0, 0.0, 1.0)) is None
    assert floor_under(load_scene("living_room"), (3.0, 0.0, 1.0)) == (pytest.approx(0.0, abs=1e-5), "floor")
