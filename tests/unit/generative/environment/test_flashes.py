"""Flashes of flat faces: image theory, finite plates against quadrature, and what hides them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rfgen_sionna.generative.environment.bricks import Bricks, Place
from rfgen_sionna.generative.environment.diffusion import EnvironmentDiffusion
from rfgen_sionna.generative.environment.flashes import FREQUENCY, flashes
from rfgen_sionna.generative.environment.rooms import Wanted, choose_room
from rfgen_sionna.generative.environment.sketch import shown
from rfgen_sionna.pir.view import View
from rfgen_sionna.records import SPEED_OF_LIGHT
from rfgen_sionna.scene.furnished.finishes import surface_material
from rfgen_sionna.tracing.diffuse import reflectance

AHEAD = View((64, 64), (90.0, 90.0), (0.0, 0.0, 1.0), (0.0, 0.0, 0.0))
WAVELENGTH = SPEED_OF_LIGHT / FREQUENCY


def plate(distance: float, y: float, z: float, middle: tuple[float, float] = (0.0, 1.0), yaw: float = 0.0) -> Place:
    """A metal plate ahead, from -`y` to `y` and from -`z` to `z` about a `middle` [m]."""
    bricks = Bricks.upright(np.array([[distance, *middle]]), np.array([[0.0, y, z]]), np.array([yaw]))
    return replace(Place.plain(bricks, ("cupboard",)), finishes={"cupboard": "metal"})


def flash(place: Place, view: View = AHEAD) -> np.ndarray:
    return flashes(place, shown(place, view), view)


def of_metal() -> float:
    """(1 - S^2) |Gamma|^2 at normal incidence."""
    metal = surface_material("metal", FREQUENCY)
    return float((1 - metal.scattering_coefficient**2) * reflectance(metal, FREQUENCY, np.ones(1))[0])


@pytest.mark.parametrize("distance", [0.5, 3.0, 40.0])
def test_an_endless_wall_is_a_mirror(distance: float) -> None:
    found = flash(plate(distance, 30.0 * distance, 30.0 * distance))
    assert np.count_nonzero(found) == 1
    expected = (WAVELENGTH / (8 * np.pi * distance)) ** 2 * of_metal()
    assert 10 * np.log10(found.max() / expected) == pytest.approx(0.0, abs=0.15)
    assert found.argmax() in (31 * 64 + 31, 31 * 64 + 32, 32 * 64 + 31, 32 * 64 + 32)


@pytest.mark.parametrize(
    ("y", "z", "middle"), [(0.4, 0.3, (0.0, 1.0)), (0.12, 0.5, (0.05, 1.2)), (0.06, 0.06, (0.0, 1.0))]
)
def test_a_plate_returns_what_quadrature_says(y: float, z: float, middle: tuple[float, float]) -> None:
    """The physical-optics integral at 3 m with the phase's second order, relative to that of a mirror without end, of
    which one side is sqrt(lambda d / 2) exp(i pi / 4)."""
    distance = 3.0
    share = 1.0 + 0.0j
    for half, away in ((y, middle[0]), (z, middle[1] - 1.0)):
        points = np.linspace(away - half, away + half, 40_001)
        values = np.exp(2j * np.pi * points**2 / (WAVELENGTH * distance))
        share *= np.trapezoid(values, points) / (np.sqrt(WAVELENGTH * distance / 2) * np.exp(0.25j * np.pi))
    expected = (WAVELENGTH / (8 * np.pi * distance)) ** 2 * of_metal() * abs(share) ** 2
    assert 10 * np.log10(flash(plate(distance, y, z, middle)).max() / expected) == pytest.approx(0.0, abs=0.01)


def test_what_is_aslant_hidden_or_out_of_view_does_not_flash() -> None:
    assert not flash(plate(3.0, 0.5, 0.5, yaw=0.3)).any()
    assert not flash(plate(3.0, 0.5, 0.5, middle=(0.8, 1.0))).any()
    assert not flash(plate(3.0, 0.5, 0.5), replace(AHEAD, orientation=(1.2, 0.0, 0.0))).any()
    both = Bricks.joined([plate(3.0, 0.5, 0.5).wholes, plate(2.0, 0.3, 0.3).wholes])
    two = Place.plain(both, ("cupboard", "curtain"))
    shaded = replace(two, finishes={"cupboard": "metal", "curtain": "fabric"})
    before = flash(plate(3.0, 0.5, 0.5)).max()
    assert 0.0 < flash(shaded).max() < 1e-2 * before
    assert not flash(replace(two, finishes={"cupboard": "metal"})).any()
    one = Place(both, ("cupboard", "cupboard"), 0, both, np.zeros(2, np.intp), {"cupboard": "metal"})
    assert flash(one).max() == pytest.approx(flash(plate(2.0, 0.3, 0.3)).max()), "the back board is behind the door"


def test_a_drawn_room_flashes_where_its_walls_are_met_at_right_angles() -> None:
    """The far wall ahead: the drawing is no weaker there than image theory has it, and stays what it was elsewhere."""
    rooms = EnvironmentDiffusion(steps=1, sampler="dpm", device="cpu")
    model = rooms._backend.model  # type: ignore[attr-defined]
    told = 0
    for seed in range(4):
        room = choose_room(Wanted("living room"), AHEAD, seed)
        expected = flashes(room.place, room.seen(AHEAD), room.moved(AHEAD))
        drawn = rooms.generate("a living room", fov_deg=90.0, seed=seed)
        low = 10 ** (model.codec.energy_db[0] / 10)
        strong = (expected > 10 * low) & (drawn.energy > 0)
        assert (drawn.energy[strong] > 0.97 * expected[strong]).all()
        told += int(strong.any())
    assert told >= 2
