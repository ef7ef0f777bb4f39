"""Furnished places: what stands in them stands where it may, and a seed decides it all."""

import numpy as np
import pytest

import rfgen_sionna as rfgen
from rfgen_sionna.radar import Radar
from rfgen_sionna.scene import MATERIALS, MeshActor, SceneError
from rfgen_sionna.scene.furnished import PLACES, furnished
from rfgen_sionna.scene.furnished.finishes import FINISHES, scattering_coefficient
from rfgen_sionna.simulation import Simulator

SEEDS = range(3)
OFTEN = ("living room", "corridor", "street", "open field")
HANGING = ("ceiling lamp", "strip light")
"""Over people's heads."""
USUAL = {
    "living room": {"sofa", "television"},
    "bedroom": {"bed", "wardrobe"},
    "office": {"desk", "office chair"},
    "lab": {"workbench"},
    "corridor": {"strip light"},
    "classroom": {"desk", "chair"},
    "garage": {"shelf"},
    "street": {"house", "car", "lamp post"},
    "playground": {"swing", "slide", "bench"},
    "open field": {"tree", "bush"},
}


@pytest.fixture(scope="module")
def scenes():
    return {(place, seed): furnished(place, seed) for place in PLACES for seed in SEEDS}


def test_there_are_ten_places():
    assert set(PLACES) == set(USUAL)


@pytest.mark.parametrize("place", PLACES)
def test_holds_what_it_should(scenes, place):
    """Some layouts lack one thing or another, but hardly any of what makes the place."""
    found = [set(scenes[place, seed].layout.kinds) for seed in SEEDS]
    for kind in USUAL[place]:
        assert sum(kind in kinds for kinds in found) >= len(SEEDS) - 1, kind


@pytest.mark.parametrize("place", PLACES)
def test_nothing_overlaps(scenes, place):
    """On the floor plan, at its height, no piece reaches into another; rugs lie under others."""
    for seed in SEEDS:
        items = [item for item in scenes[place, seed].layout.items if item.ground.top > 0.03]
        for i, one in enumerate(items):
            for other in items[:i]:
                assert not one.ground.meets(other.ground, -1e-6), (seed, one, other)


@pytest.mark.parametrize("place", PLACES)
def test_floor_plans_say_where_meshes_are(scenes, place):
    """Indoors, and for what has no crown, no vertex lies outside of the box that the plan has for the piece."""
    for seed in SEEDS:
        for item in scenes[place, seed].layout.items:
            if item.kind in ("tree", "bush", "hedge", "house", "lamp post", "traffic sign", "shed", "basketball hoop"):
                continue
            points = np.concatenate([part.points for part in item.parts])
            yaw = np.radians(item.yaw)
            own = (points[:, :2] - (item.x, item.y)) @ [[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]]
            over = np.abs(own).max(axis=0) - 0.5 * np.array(item.size[:2])
            assert over.max() < 0.1, (seed, item.kind, over)


@pytest.mark.parametrize("place", PLACES)
def test_within_the_walls(scenes, place):
    for seed in SEEDS:
        scene = scenes[place, seed]
        plan = scene.layout
        for item in plan.items:
            points = np.concatenate([part.points for part in item.parts])
            if plan.indoors:
                assert points[:, 0].min() > plan.x[0] - 0.03
                assert points[:, 0].max() < plan.x[1] + 0.03
                assert points[:, 1].min() > plan.y[0] - 0.03
                assert points[:, 1].max() < plan.y[1] + 0.03
                assert points[:, 2].max() < plan.height + 1e-6
                assert points[:, 2].min() > -0.01  # feet of leaning legs
        floor = next(
            item for item, kind in zip(scene.objects, scene.kinds, strict=True) if kind in ("floor", "road", "ground")
        )
        x, y, z = floor.vertices.T
        inside = (plan.x[0] <= x) & (x <= plan.x[1]) & (plan.y[0] <= y) & (y <= plan.y[1])
        assert not z[inside].any()


@pytest.mark.parametrize("place", PLACES)
def test_room_for_a_radar_and_a_person(scenes, place):
    """No vertex of the furniture within 0.9 m of somebody at (3, 0), nor in front of a radar at (0, 0, 1)."""
    for seed in SEEDS:
        scene = scenes[place, seed]
        points = np.concatenate([part.points for item in scene.layout.items for part in item.parts])
        points = points[(points[:, 2] > 0.03) & (points[:, 2] < 2.1)]
        assert np.hypot(points[:, 0] - 3, points[:, 1]).min() > 0.9
        between = (points[:, 0] > -0.2) & (points[:, 0] < 3) & (np.abs(points[:, 1]) < 0.45)
        assert not between.any()
        assert scene.layout.is_free(0.0, 0.0, 1.0)
        assert scene.layout.is_free(0.0, 0.0, scene.layout.height + 0.1) is not scene.layout.indoors
        assert scene.interior.contains((0, 0, 1))


@pytest.mark.parametrize(
    "place", [pytest.param(each, marks=[] if each in OFTEN else pytest.mark.slow) for each in PLACES]
)
def test_a_simulation_takes_it(scenes, place):
    """The radar stands free in it, somebody in the default place meets nothing, and something returns."""
    radar = Radar.load("awr1843", position=(0, 0, 1))
    box = [(x, y, z) for x in (2.7, 3.3) for y in (-0.8, 0.8) for z in (0.01, 1.9)]
    faces = [
        (0, 1, 3),
        (0, 3, 2),
        (4, 6, 7),
        (4, 7, 5),
        (0, 4, 5),
        (0, 5, 1),
        (2, 3, 7),
        (2, 7, 6),
        (0, 2, 6),
        (0, 6, 4),
        (1, 5, 7),
        (1, 7, 3),
    ]
    somebody = MeshActor.from_mesh((np.array(box), np.array(faces)), material="skin", name="somebody")
    scene = scenes[place, 1]
    if place == "street":
        with pytest.warns(UserWarning, match="asphalt_concrete"):
            sim = Simulator(scene, radar, [somebody])
    else:
        sim = Simulator(scene, radar, [somebody])
    sim._check_places(0.0, 0.0)
    pir = sim.pir(0.0, (16, 16), 70)
    assert np.isfinite(pir.time_of_arrival).mean() > 0.4
    assert (pir.energy[np.isfinite(pir.time_of_arrival)] > 0).mean() > 0.95


@pytest.mark.parametrize("place", PLACES)
def test_the_seed_decides(scenes, place):
    again, other = furnished(place, 1), scenes[place, 2]
    one = scenes[place, 1]
    assert one.layout == again.layout
    assert [item.name for item in one.objects] == [item.name for item in again.objects]
    for a, b in zip(one.objects, again.objects, strict=True):
        np.testing.assert_array_equal(a.vertices, b.vertices)
        np.testing.assert_array_equal(a.faces, b.faces)
        assert a.properties == b.properties
    assert one.layout.items != other.layout.items


@pytest.mark.parametrize("place", PLACES)
def test_meshes_are_usable(scenes, place):
    names = [item.name for item in scenes[place, 0].objects]
    assert len(set(names)) == len(names)
    for item in scenes[place, 0].objects:
        assert np.isfinite(item.vertices).all()
        assert item.faces.min() >= 0
        assert item.faces.max() < len(item.vertices)
        assert item.material in MATERIALS
        assert 0.0 <= item.properties.scattering_coefficient <= 1.0


@pytest.mark.parametrize("text", ["living room", "a living_room", "Living Room", "the living-room", "in a living room"])
def test_spellings(text):
    assert furnished(text, 3).layout.place == "living room"


def test_errors_say_what_is_allowed():
    with pytest.raises(SceneError, match=r"unknown place 'a swamp'; there are living room, .*, open field"):
        rfgen.furnished("a swamp")
    with pytest.raises(TypeError, match="seed: 'x' given"):
        furnished("lab", "x")
    with pytest.raises(ValueError, match="seed: -1 given"):
        furnished("lab", -1)
    with pytest.raises(ValueError, match="frequency: 0 given"):
        furnished("lab", frequency=0)


def test_roughness_makes_matt():
    """exp(-(4 pi h / lambda)^2) of the energy stays coherent; the same plaster is far more of a mirror at 24 GHz."""
    wavelength = 299_792_458 / 77e9
    assert scattering_coefficient(0.0, 77e9) == 0.0
    height = wavelength / (4 * np.pi)
    assert scattering_coefficient(height, 77e9) ** 2 == pytest.approx(1 - np.exp(-1))
    plaster = FINISHES["plaster"].roughness
    assert scattering_coefficient(plaster, 24e9) < 0.5 * scattering_coefficient(plaster, 77e9)
    at = {f: furnished("bedroom", 0, frequency=f).objects[0].properties.scattering_coefficient for f in (24e9, 77e9)}
    assert at[24e9] < at[77e9]


def test_as_a_scene_of_sionna(scenes):
    """Sionna's own scene holds the same objects with the materials at the same frequency."""
    scene = furnished("corridor", 1)
    inside = scene.sionna
    assert len(inside.objects) == len(scene.objects)
    scene.tune(79e9)
    assert float(inside.frequency[0]) == pytest.approx(79e9, rel=1e-6)
    walls = next(item for item, kind in zip(scene.objects, scene.kinds, strict=True) if kind == "left wall")
    found = inside.objects[walls.name]
    assert float(found.radio_material.scattering_coefficient[0]) == pytest.approx(
        walls.properties.scattering_coefficient
    )
    assert float(found.radio_material.relative_permittivity[0]) == pytest.approx(
        walls.properties.relative_permittivity(79e9).real, rel=1e-5
    )
