"""Every scene that ships with Sionna, and ours, as a radar sees it from a sensible place in it."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from rfgen_sionna.radar import Radar
from rfgen_sionna.scene import MaterialRangeWarning, MeshActor, RayScene, available_scenes
from rfgen_sionna.scene.checks.radar_distance import distance, nearest_surface
from rfgen_sionna.scene.mitsuba_backend import ensure_backend
from rfgen_sionna.simulation import Simulator

pytestmark = pytest.mark.filterwarnings("ignore::rfgen_sionna.scene.scene_errors.MaterialRangeWarning")

PLACES = {
    "box": ((-3.0, -2.0, 1.2), (2.0, 1.0, 1.2)),
    "box_knife": ((-3.0, -2.0, 1.2), (2.0, 1.0, 1.2)),
    "box_one_screen": ((-3.0, -2.0, 1.2), (2.0, 1.0, 1.2)),
    "box_two_screens": ((-1.0, -2.0, 1.2), (2.0, 1.0, 1.2)),
    "double_reflector": ((-4.0, 0.0, 2.0), (0.0, 0.0, 2.0)),
    "etoile": ((42.2, 28.9, 1.5), (52.0, 28.9, 1.5)),
    "florence": ((49.9, -80.1, 1.5), (49.9, -90.0, 1.5)),
    "floor_wall": ((1.8, 0.3, 1.0), (-1.0, 0.0, 1.0)),
    "living_room": ((0.0, 0.0, 1.0), (3.0, 0.0, 1.0)),
    "munich": ((205.1, -261.5, 1.5), (200.0, -261.5, 1.5)),
    "san_francisco": ((45.8, -0.5, 16.4), (40.8, -0.5, 16.4)),
    "simple_reflector": ((0.0, 0.0, 3.0), (0.1, 0.0, 0.0)),
    "simple_street_canyon": ((28.6, -13.4, 1.5), (34.0, -13.4, 1.5)),
    "simple_street_canyon_with_cars": ((14.9, 4.6, 1.5), (0.0, 4.6, 1.0)),
    "simple_wedge": ((-3.0, -2.0, 0.0), (0.0, 0.0, 0.0)),
    "triple_reflector": ((-4.0, 0.0, 2.0), (0.0, 0.0, 1.0)),
}
"""Where the radar stands and where it looks [m]: outdoors in a street, 1.5 m above the ground; indoors in the room."""
QUICK = ("floor_wall", "simple_reflector", "simple_wedge")
"""Scenes that are traced in every run of the tests."""
AHEAD = 1.4
"""How far before the radar a person stands [m]: free in every scene."""


@pytest.fixture(scope="module")
def radar() -> Radar:
    return Radar.load("awr1843")


def test_there_is_a_place_in_every_scene():
    ensure_backend()
    import sionna.rt

    theirs = {name for name, path in vars(sionna.rt.scene).items() if str(path).endswith(f"{name}.xml")}
    assert len(theirs) >= 15
    assert theirs | {"living_room"} == set(PLACES) == set(available_scenes())


def check(name: str, radar: Radar, rtol: float) -> None:
    position, look_at = PLACES[name]
    simulation = Simulator(name, radar.placed(position=position, look_at=look_at), rtol=rtol)
    radar, scene = simulation.radar, simulation.scene
    paths = simulation.paths()
    assert paths.num_paths > 100
    for values in (paths.a, paths.tau, paths.direction):
        assert np.isfinite(values).all()
    assert np.abs(paths.a).max() > 0.0
    reach = paths.range[:, 0]
    assert reach.max() < radar.max_range + 0.01  # of the phase centre; elements are a few centimetres off
    # The point of the scene that is nearest is always in view; facets are centimetres wide.
    near, gap = nearest_surface(position, scene)
    assert gap < radar.max_range
    assert reach.min() == pytest.approx(gap, rel=0.02, abs=0.01)
    nearest = int(reach.argmin())
    assert paths.object_names[paths.object_id[nearest]] == near
    # Rays in the paths' directions meet the same object at the same distance; of half a facet they may meet another.
    # Paths of the edges of large faces follow those of facets.
    fraction = simulation.tracer.static.fraction
    whole = np.flatnonzero(fraction == 1.0)
    assert len(whole) > 0.7 * len(fraction)
    chosen = np.random.default_rng(0).choice(whole, 2000)
    rays = RayScene([(item.vertices, item.faces) for item in scene.objects], origin=position)
    hits = rays.first_hit(position, paths.direction[chosen, 0])
    same = np.abs(hits.distance - reach[chosen]) < 2e-3
    assert same.mean() > 0.99
    names = np.array([item.name for item in scene.objects])
    assert (names[hits.object] == np.array(paths.object_names)[paths.object_id[chosen]])[same].mean() > 0.99

    # A person before the radar is seen there, and before what is behind.
    ahead = np.asarray(look_at) - position
    ahead /= np.linalg.norm(ahead)
    place = np.asarray(position) + AHEAD * ahead
    shape = trimesh.creation.capsule(0.9, 0.16, count=[32, 32])
    person = MeshActor.from_mesh(shape, material="skin", position=place, velocity=0.5 * ahead, name="person")
    seen = Simulator(scene, radar, [person], rtol=rtol).paths()
    mine = seen.select((seen.object_id == seen.object_names.index("person")) & (seen.bounces == 1))
    assert mine.num_paths > 100
    assert mine.range.min() == pytest.approx(distance(position, person.vertices(0.0), person.faces), abs=0.01)
    assert mine.range.max() < AHEAD + 1.0
    strongest = int(np.abs(mine.a[0, 0, :, 0]).argmax())
    assert mine.velocity[strongest, 0] == pytest.approx(0.5, abs=0.05)
    hidden = [
        np.abs(each.a[0, 0, (each.direction[:, 0] @ ahead > np.cos(0.06)) & (each.range[:, 0] > AHEAD + 0.2)]).sum()
        for each in (seen, paths)
    ]
    assert hidden[0] <= 0.1 * hidden[1]  # of facets at the shadow's edge a part is seen


@pytest.mark.parametrize(
    "name", [name if name in QUICK else pytest.param(name, marks=pytest.mark.slow) for name in PLACES]
)
def test_every_scene_is_seen(name: str):
    check(name, Radar.load("awr1843"), 0.05)


@pytest.mark.slow
@pytest.mark.parametrize("name", PLACES)
def test_every_scene_is_seen_at_the_default_tolerance(name: str):
    check(name, Radar.load("awr1843"), 1e-3)


def test_a_scene_that_returns_nothing_says_why(radar: Radar):
    far = Simulator("simple_reflector", radar.placed(position=(0, 0, 30), look_at=(0.1, 0, 0)), rtol=1e-3)
    with pytest.warns(
        UserWarning, match=r"nothing of scene 'simple_reflector': its nearest surface, 'reflector', is 30.00 m"
    ):
        assert far.paths().num_paths == 0
    far.paths()  # said once
    # In the plane of the plate: facets without a gain.
    edge_on = Simulator("simple_reflector", radar.placed(position=(2.0, 0.1, 0.0), look_at=(0, 0, 0)), rtol=1e-3)
    with pytest.warns(UserWarning, match=r"'reflector', is 1\.50 m away .* no surface within it is visible"):
        edge_on.adc(0.05)
    Simulator(None, radar, rtol=1e-3).paths()  # free space is meant to be silent


def test_the_towns_need_what_our_sources_do_not_cover(radar: Radar):
    """The reason for this module's filter: said, and nothing else is."""
    position, look_at = PLACES["simple_street_canyon"]
    with pytest.warns(MaterialRangeWarning) as told:
        Simulator("simple_street_canyon", radar.placed(position=position, look_at=look_at), rtol=1e-3)
    assert len(told) == 1
