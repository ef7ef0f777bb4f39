"""Ghosts by one wall on the way there and by another on the way back."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from rfgen_sionna._types import SPEED_OF_LIGHT
from rfgen_sionna.radar import Radar
from rfgen_sionna.scene import MeshActor, load_scene
from rfgen_sionna.simulation import Simulator
from tests.physics.test_ghosts import (
    BALL,
    ISOTROPIC,
    RADIUS,
    SIDE,
    changed_over,
    channel,
    decibels,
    of,
    sphere,
    sphere_return,
    wall_reflection,
)
from tests.physics.test_moving_radar_ghosts import scene_with_mesh
from tests.reference.physical_optics import Wall, po_gain
from tests.sionna.rectangles import scene_of

OTHER = -1.2  # the other wall's y
VIEW = np.array([0.0, 0.0, 1.0])
IMAGES = {side: VIEW + np.array([0, 2 * wall, 0]) for side, wall in ((1, SIDE), (-1, OTHER))}
FAR = np.array([5.0, 0.2, 1.0])  # where the images are 58 degrees apart: beyond 90 physical optics errs by 1 dB


def corridor(left, right, thickness=0.1):
    def wall(y, material):
        return [[-0.4, y, 0.6], [4.0, y, 0.6], [4.0, y, 1.4], [-0.4, y, 1.4]], material, thickness

    return load_scene(scene_of(77e9, left=wall(SIDE, left), right=wall(OTHER, right)).sionna)


def across(paths):
    """Paths by (first, last) wall, 1 for the left and -1 for the right one, of those by one of each."""
    sides = [np.where(np.abs(each[:, 0, 1] / each[:, 0, 0]) > 0.5, np.sign(each[:, 0, 1]), 0) for each in
             (paths.direction, paths.arrival)]  # fmt: skip
    return {(first, last): paths.select((sides[0] == first) & (sides[1] == last)) for first, last in ((1, -1), (-1, 1))}


@pytest.fixture(scope="module")
def radar():
    return Radar.load("awr1843", position=VIEW, overrides=ISOTROPIC)


@pytest.fixture(scope="module")
def ball():
    return MeshActor.from_mesh(sphere(4), material="pec", position=BALL, name="ball")


@pytest.mark.parametrize(
    ("left", "right"),
    [*(pytest.param("pec", each, marks=pytest.mark.slow) for each in ("pec", "concrete")), ("concrete", "wood")],
)
def test_they_are_as_far_and_as_strong_as_between_the_two_images(radar, left, right):
    """Half a decibel for each element pair; delays to what the ball's facets are from its specular point."""
    scene, ball = corridor(left, right), MeshActor.from_mesh(sphere(), material="pec", position=FAR, name="ball")
    found = across(of(Simulator(scene, radar, [ball], rtol=2e-3, max_bounces=None).paths()))
    gamma = 1.0
    for name, wall in (("left", SIDE), ("right", OTHER)):
        cos = abs(2 * wall - FAR[1]) / np.hypot(2 * wall - FAR[1], FAR[0])
        material = next(each.properties for each in scene.objects if each.name == name)
        gamma *= wall_reflection(material, cos, radar.center_frequency)
    for (first, last), paths in found.items():
        level, length = sphere_return(FAR, IMAGES[first], IMAGES[last], RADIUS, radar.wavelength)
        assert abs(decibels(channel(paths) / (gamma * level))).max() < 0.5
        assert set(paths.bounces) == {3}
        strongest = np.argmax(np.abs(paths.a[0, 0, :, 0]))
        assert SPEED_OF_LIGHT * paths.tau[0, 0, strongest, 0] == pytest.approx(length, abs=0.04)


@pytest.mark.parametrize("seed", [pytest.param(0, marks=pytest.mark.slow), 1])
def test_they_are_the_dense_quadrature_with_each_wall_s_own_fields(seed):
    """A box that mirrors one image to the other, but for a few degrees, two different walls, elements at 45 degrees: to
    what the report states, of the strongest return."""
    rng = np.random.default_rng(seed)
    radar = Radar.load("awr1843", overrides=ISOTROPIC, position=VIEW, orientation=(0.3, 0.1, 0.4 * seed))
    if seed:
        radar = replace(radar, tx_polarization="+45", rx_polarization="V")
    scene = corridor("metal", "concrete", thickness=0.006)
    place, box = np.array([1.2, 0.3, 0.9]), trimesh.creation.box(radar.wavelength * np.array([2, 6, 5]))
    towards = sum((image - place) / np.linalg.norm(image - place) for image in IMAGES.values())
    turn = Rotation.align_vectors([towards], [[-1, 0, 0]])[0] * Rotation.from_rotvec(0.03 * rng.normal(size=3))
    actor = MeshActor.from_mesh(
        box, material=["pec", "skin"][seed], position=place, orientation=turn.as_euler("ZYX"), name="ball"
    )
    simulator = Simulator(scene, radar, [actor], rtol=3e-3, max_bounces=None)
    error = simulator.tracer.trace(0.0, 0.0).report.error
    paths = of(simulator.paths())
    found = across(paths)
    corners = actor.vertices(0.0)[actor.faces]
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    walls = {}
    for side, y in ((1, SIDE), (-1, OTHER)):
        material = next(each.properties for each in scene.objects if each.name == ("left" if side > 0 else "right"))
        eps = complex(material.relative_permittivity(radar.center_frequency))
        walls[side] = Wall(np.array([0, y, 0]), np.array([0, 1.0, 0]), eps, material.thickness)
    own = complex(actor.properties.relative_permittivity(radar.center_frequency))
    for tx, rx in ((0, 0), (2, 3)):
        total, truth = 0.0, 0.0
        for (first, last), some in found.items():
            unoccluded = np.all(
                [np.einsum("fi,fi->f", cross, IMAGES[end] - corners[:, 0]) > 0 for end in (first, last)], axis=0
            )
            elements = radar.tx_world[tx], radar.rx_world[rx], radar.tx_field, radar.rx_field, radar.center_frequency
            truth += po_gain(corners[unoccluded], *elements, own, n=100, tx_wall=walls[first], rx_wall=walls[last])
            total += channel(some)[tx, rx]
            assert some.num_paths
        allowed = error * np.abs(channel(paths)).max()
        assert abs(truth) > 5 * allowed
        assert abs(total - truth) < allowed


@pytest.mark.parametrize(("reach", "visible"), [pytest.param(0.03, True, marks=pytest.mark.slow), (-0.03, False)])
def test_the_range_window_is_of_the_whole_way(radar, reach, visible, monkeypatch):
    """By one wall a small ball is within it, by the other beyond: the mean of the two ways tells."""
    point = MeshActor.from_mesh(sphere(3, 0.01), material="pec", position=BALL, name="ball")
    lengths = [np.linalg.norm(BALL - image) for image in IMAGES.values()]
    assert abs(lengths[0] - lengths[1]) > 0.15
    monkeypatch.setattr(Radar, "max_range", property(lambda _: float(np.mean(lengths)) + reach))
    paths = of(Simulator(corridor("pec", "pec"), radar, [point], rtol=1e-2, max_bounces=None).paths())
    assert all((each.num_paths > 0) == visible for each in across(paths).values())


@pytest.mark.slow
def test_a_radar_that_moves_sees_those_of_one_that_stands_there(radar, ball):
    """Walls are parts of a world that moves then, whose facets are chosen anew: to half a per cent."""
    goes = replace(radar, trajectory=lambda t: (0.5 * t, 0.0, 1.0))
    scene = corridor("pec", "concrete")
    here, there = (
        across(of(Simulator(scene, each, [ball], rtol=1e-2, max_bounces=3).paths(0.08)))
        for each in (goes, goes.at(0.08))
    )
    for way, paths in there.items():
        assert paths.num_paths
        assert abs(channel(here[way]) - channel(paths)).max() < 5e-3 * abs(channel(paths)).max()


@pytest.mark.slow
def test_changing_tx_and_rx_over_exchanges_them(ball):
    one, other = changed_over()
    scene = corridor("concrete", "glass")
    here, there = (
        across(of(Simulator(scene, each, [ball], rtol=1e-2, max_bounces=None).paths())) for each in (one, other)
    )
    for way in here:
        assert abs(channel(here[way]) / channel(there[way[::-1]]) - 1).max() < 1e-9


@pytest.mark.parametrize("side", [1, pytest.param(-1, marks=pytest.mark.slow)])
def test_what_stands_before_one_of_the_walls_removes_both_ways_round(radar, side):
    wall = SIDE if side > 0 else OTHER
    crossing = np.array([wall / (2 * wall - BALL[1]) * BALL[0], wall, 1.0])
    ball = MeshActor.from_mesh(sphere(3), material="pec", position=BALL, name="ball")
    board = MeshActor.from_mesh(
        trimesh.creation.box((0.2, 0.2, 0.3)), material="wood", position=0.5 * (crossing + BALL), name="board"
    )
    free, hidden = (
        of(Simulator(corridor("pec", "pec"), radar, actors, rtol=5e-2, max_bounces=None).paths())
        for actors in ([ball], [ball, board])
    )
    for way, paths in across(free).items():
        assert abs(channel(across(hidden)[way])[0, 0]) < 1e-2 * abs(channel(paths)[0, 0])


def test_two_bounces_have_none(radar, ball):
    paths = of(Simulator(corridor("pec", "pec"), radar, [ball], rtol=1e-2, max_bounces=2).paths())
    assert all(each.num_paths == 0 for each in across(paths).values())


def test_over_time_they_follow_both_images(radar):
    """Across the corridor at 1 m/s the delay changes by one image's rate and the other's, which nearly cancel."""
    velocity = np.array([0.0, 1.0, 0.0])
    actor = MeshActor.from_mesh(sphere(3, 0.02), material="metal", position=BALL, velocity=velocity, name="ball")
    simulator = Simulator(corridor("metal", "metal"), radar, [actor], rtol=1e-2, max_bounces=None)
    traced = simulator.tracer.trace(0.0, radar.waveform.frame_length).moving
    for knot, t in enumerate(traced.times):
        corners = actor.vertices(float(t))[actor.faces]
        for (first, last), paths in across(traced).items():
            assert paths.num_paths
            centroids = corners[paths.facet].mean(axis=1)
            length, rate = 0.0, 0.0
            for side, element in ((first, radar.tx_world[1]), (last, radar.rx_world[2])):
                wall, flip = (SIDE if side > 0 else OTHER), np.array([1, -1, 1.0])
                offset = centroids * flip + [0, 2 * wall, 0] - element
                distance = np.linalg.norm(offset, axis=1)
                length, rate = length + distance, rate + offset @ (velocity * flip) / distance
            np.testing.assert_allclose(SPEED_OF_LIGHT * paths.tau[1, 2, :, knot], length, rtol=0, atol=1e-6)
            np.testing.assert_allclose(SPEED_OF_LIGHT * paths.tau_rate[1, 2, :, knot], rate, rtol=0, atol=2e-3)


@pytest.mark.slow
def test_round_furniture_has_those_of_an_actor(radar):
    """The same ball as part of the scene: to a tolerance that is relative to what the room returns."""
    scene = scene_with_mesh(sphere(4, 0.1).apply_translation(FAR), corridor("pec", "pec"))
    stays = Simulator(scene, radar, [], rtol=1e-3, max_bounces=3).paths()
    actor = MeshActor.from_mesh(sphere(4, 0.1), material="pec", position=FAR, name="ball")
    moves = of(Simulator(corridor("pec", "pec"), radar, [actor], rtol=1e-3, max_bounces=3).paths())
    two = Simulator(scene, radar, [], rtol=1e-3, max_bounces=2).paths()
    assert all(each.num_paths == 0 for each in across(of(two, "thing")).values())
    for way, paths in across(moves).items():
        found = across(of(stays, "thing"))[way]
        assert found.num_paths
        assert abs(channel(found) - channel(paths)).max() < 0.02 * abs(channel(paths)).max()


def test_what_the_radar_does_not_see_of_round_furniture_is_shown_by_a_wall(radar):
    """A wall aslant behind a ball shows the radar its far side, there and back, 108 degrees from the near one: as of an
    actor, and as strong as a sphere that is seen from the image."""
    wall = [[3.2, -0.2, 0.6], [1.0, 2.0, 0.6], [1.0, 2.0, 1.4], [3.2, -0.2, 1.4]]
    behind, also = (load_scene(scene_of(77e9, wall=(wall, "pec", 0.1)).sionna) for _ in range(2))
    place = np.array([2.0, 0.0, 1.0])
    scene = scene_with_mesh(sphere(4, 0.1).apply_translation(place), also)
    actor = MeshActor.from_mesh(sphere(4, 0.1), material="pec", position=place, name="ball")
    found = [
        of(Simulator(scene, radar, [], rtol=1e-3, max_bounces=3).paths(), "thing"),
        of(Simulator(behind, radar, [actor], rtol=1e-3, max_bounces=3).paths()),
    ]
    twice, expected = (channel(each.select(each.bounces == 3)) for each in found)
    assert abs(twice - expected).max() < 0.02 * abs(expected).max()
    image = np.array([3.0, 3.0, 1.0])
    level, _ = sphere_return(place, image, image, 0.1, radar.wavelength)
    assert abs(decibels(twice / level)).max() < 0.5
