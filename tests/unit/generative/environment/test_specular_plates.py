"""Flashes of flat faces: image theory, finite plates against quadrature, and what hides them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rfgen_sionna._types import SPEED_OF_LIGHT
from rfgen_sionna.generative.environment.environment_diffusion import EnvironmentDiffusion
from rfgen_sionna.generative.environment.layout_map import render_layout_map
from rfgen_sionna.generative.environment.primitives import Primitives, PrimitiveScene
from rfgen_sionna.generative.environment.room_selection import PlaceRequest, choose_room
from rfgen_sionna.generative.environment.specular_plates import specular_plate_returns, training_frequency
from rfgen_sionna.pir import render_pir
from rfgen_sionna.pir.view import View
from rfgen_sionna.radar import Radar
from rfgen_sionna.scene import MeshActor
from rfgen_sionna.scene.furnished.finishes import surface_material
from rfgen_sionna.simulation import Simulator
from rfgen_sionna.tracing.gains.diffuse import reflectance

AHEAD = View((64, 64), (90.0, 90.0), (0.0, 0.0, 1.0), (0.0, 0.0, 0.0))
FREQUENCY = training_frequency()
WAVELENGTH = SPEED_OF_LIGHT / FREQUENCY


def plate(
    distance: float, y: float, z: float, middle: tuple[float, float] = (0.0, 1.0), yaw: float = 0.0
) -> PrimitiveScene:
    """A metal wall ahead, from -`y` to `y` and from -`z` to `z` about a `middle` [m]."""
    primitives = Primitives.upright(np.array([[distance, *middle]]), np.array([[0.0, y, z]]), np.array([yaw]))
    return replace(PrimitiveScene.plain(primitives, ("far wall",), 1), finishes={"far wall": "metal"})


def specular_return(place: PrimitiveScene, view: View = AHEAD) -> np.ndarray:
    return specular_plate_returns(place, render_layout_map(place, view), view).energy


def of_metal() -> float:
    """(1 - S^2) |Gamma|^2 at normal incidence."""
    metal = surface_material("metal", FREQUENCY)
    return float((1 - metal.scattering_coefficient**2) * reflectance(metal, FREQUENCY, np.ones(1))[0])


@pytest.mark.parametrize("distance", [0.5, 3.0, 40.0])
def test_an_endless_wall_is_a_mirror(distance: float) -> None:
    found = specular_return(plate(distance, 30.0 * distance, 30.0 * distance))
    expected = (WAVELENGTH / (8 * np.pi * distance)) ** 2 * of_metal()
    assert 10 * np.log10(found.sum() / expected) == pytest.approx(0.0, abs=0.15)
    np.testing.assert_array_equal(np.flatnonzero(found), [31 * 64 + 31, 31 * 64 + 32, 32 * 64 + 31, 32 * 64 + 32])
    np.testing.assert_allclose(found[31:33, 31:33], found.sum() / 4)


@pytest.mark.parametrize("finish", ["metal", "plaster", "bare concrete"])
def test_the_tracer_says_the_same_of_a_wall(finish: str) -> None:
    """All of a wall of 1.6 m, in one pixel of its own: what its parts return together, in phase."""
    radar = Radar.load("awr1843", position=(0, 0, 1), look_at=(3, 0, 1))
    assert training_frequency() == radar.center_frequency == FREQUENCY
    distance, half = 3.0, 0.8
    corners = np.array(
        [[distance, y, 1.0 + z] for y, z in ((-half, -half), (half, -half), (half, half), (-half, half))]
    )
    smooth = replace(surface_material(finish, FREQUENCY), scattering_coefficient=0.0)
    wall = MeshActor.from_mesh((corners, np.array([[0, 2, 1], [0, 3, 2]])), material=smooth)
    traced = render_pir(Simulator(None, radar, [wall]).tracer, 0.0, (1, 1), 40.0, patch_wavelengths=1.0)
    place = replace(plate(distance, half, half), finishes={"far wall": finish})
    rough = surface_material(finish, FREQUENCY).scattering_coefficient ** 2
    assert 10 * np.log10(specular_return(place).sum() / (1 - rough) / traced.energy.sum()) == pytest.approx(
        0.0, abs=0.5
    )


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
    assert 10 * np.log10(specular_return(plate(distance, y, z, middle)).sum() / expected) == pytest.approx(
        0.0, abs=0.01
    )


def test_what_is_aslant_hidden_or_out_of_view_does_not_flash() -> None:
    assert not specular_return(plate(3.0, 0.5, 0.5, yaw=0.3)).any()
    assert not specular_return(plate(3.0, 0.5, 0.5, middle=(0.8, 1.0))).any()
    assert not specular_return(plate(3.0, 0.5, 0.5), replace(AHEAD, orientation=(1.2, 0.0, 0.0))).any()
    both = Primitives.joined([plate(3.0, 0.5, 0.5).bounding_boxes, plate(2.0, 0.3, 0.3).bounding_boxes])
    for others, kind in ((2, "left wall"), (1, "curtain")):
        two = replace(PrimitiveScene.plain(both, ("far wall", kind), others), finishes={"far wall": "metal"})
        assert not specular_return(two).any(), "hidden, by what is made of nothing known"
    doors = replace(
        PrimitiveScene.plain(both, ("far wall", "door"), 2), finishes={"far wall": "metal", "door": "metal"}
    )
    np.testing.assert_allclose(specular_return(doors).sum(), specular_return(plate(2.0, 0.3, 0.3)).sum())
    desk = replace(
        PrimitiveScene.plain(plate(3.0, 0.5, 0.5).bounding_boxes, ("cupboard",)), finishes={"cupboard": "metal"}
    )
    assert not specular_return(desk).any(), "the box around a piece of furniture is no mirror"


def test_a_foot_between_pixels_is_shared_by_those_around_it() -> None:
    away = 0.3  # of a pixel, from the middle of one
    pixel = 2.0 / 64
    view = replace(AHEAD, orientation=(float(np.arctan((0.5 + away) * pixel)), 0.0, 0.0))
    found = specular_return(plate(3.0, 5.0, 5.0), view)
    columns = found.sum(axis=0)
    weaker, stronger = sorted(columns[columns > 0])
    assert stronger / weaker == pytest.approx(((1 - away) / away) ** 2, rel=0.02)
    assert found.sum() == pytest.approx(specular_return(plate(3.0, 5.0, 5.0)).sum(), rel=1e-9)
    edge = replace(AHEAD, orientation=(0.5 * np.pi * 0.5 * 0.999, 0.0, 0.0))
    assert specular_return(plate(3.0, 5.0, 5.0), edge).sum() == pytest.approx(found.sum(), rel=1e-9), (
        "what is outside is none"
    )


def test_drawn_rooms_flash_where_walls_are_met_at_right_angles_in_every_view_and_size() -> None:
    """The far wall ahead: no weaker than image theory has it, at its range; so in a second view, and in more pixels."""
    rooms = EnvironmentDiffusion(steps=1, sampler="dpm", device="cpu")
    told = 0
    for seed in range(4):
        room = choose_room(PlaceRequest("living room"), AHEAD, seed)
        first = rooms.generate("a living room", fov_deg=90.0, seed=seed)
        for view in (AHEAD, replace(AHEAD, position=(0.2, 0.1, 1.0))):
            expected = specular_plate_returns(room.place, room.layout_from(view), room.moved(view))
            drawn = rooms.generate("a living room", fov_deg=90.0, position=view.position, seed=seed)
            strong = (expected.energy > 1e-16) & (drawn.energy > 0)
            assert (drawn.energy[strong] > 0.97 * expected.energy[strong]).all()
            specular = strong & (drawn.energy < 1.03 * expected.energy)
            reach = 0.5 * SPEED_OF_LIGHT * drawn.time_of_arrival
            np.testing.assert_allclose(reach[specular], expected.range[specular], rtol=5e-3)
            told += int(specular.any())
        large = rooms.generate("a living room", fov_deg=90.0, seed=seed, resolution=(128, 128))
        assert large.energy.sum() == pytest.approx(first.energy.sum(), rel=1e-6)
        assert large.energy.max() > 0.2 * first.energy.max()
    assert told >= 4
