"""Ghosts by two walls, one after the other: radar, wall, wall, body, radar, and backwards."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from rfgen_sionna._types import SPEED_OF_LIGHT
from rfgen_sionna.radar import Radar
from rfgen_sionna.records import PathKind, knot_weights
from rfgen_sionna.scene import MeshActor, load_scene
from rfgen_sionna.simulation import Simulator
from tests.physics.test_ghosts import (
    ISOTROPIC,
    RADIUS,
    SIDE,
    channel,
    decibels,
    of,
    sphere,
    sphere_return,
    wall_reflection,
)
from tests.physics.test_ghosts_by_two_walls import FAR, OTHER, VIEW, corridor
from tests.reference.physical_optics import Wall, WallAfter, po_gain
from tests.sionna.rectangles import scene_of

WALLS = {1: SIDE, -1: OTHER}
NAMES = {1: "left", -1: "right"}


def image(first):
    """Of the radar, by the wall `first`, 1 the left and -1 the right one, then by the other."""
    return VIEW + np.array([0.0, 2 * (WALLS[-first] - WALLS[first]), 0.0])


def in_a_row(paths, ball):
    """Paths by (first wall, whether it is on the way there), the other way being straight."""
    found = {}
    for first in WALLS:
        # Where the radar sees the ball by the first wall and then the other.
        visible = ball - np.array([0.0, image(first)[1], 0.0])
        for there in (True, False):
            ways = (paths.direction, paths.arrival) if there else (paths.arrival, paths.direction)
            chosen = paths.bounces == 3
            for each, place in zip(ways, (visible, ball), strict=True):
                towards = (place - VIEW) / np.linalg.norm(place - VIEW)
                chosen = chosen & (each[:, 0] @ towards > 0.998)
            found[first, there] = paths.select(chosen)
    return found


@pytest.fixture(scope="module")
def radar():
    return Radar.load("awr1843", position=VIEW, overrides=ISOTROPIC)


@pytest.mark.parametrize(("left", "right"), [pytest.param("pec", "pec", marks=pytest.mark.slow), ("concrete", "wood")])
def test_they_are_as_far_and_as_strong_as_the_image_of_the_image_says(radar, left, right):
    """Half a decibel for each element pair, delays to what the ball's facets are from its specular point."""
    scene, ball = corridor(left, right), MeshActor.from_mesh(sphere(), material="pec", position=FAR, name="ball")
    found = in_a_row(of(Simulator(scene, radar, [ball], rtol=2e-3, max_bounces=3).paths()), FAR)
    for (first, _), paths in found.items():
        gamma, span = 1.0, image(first) - FAR
        for name in NAMES.values():
            material = next(each.properties for each in scene.objects if each.name == name)
            gamma *= wall_reflection(material, abs(span[1]) / np.linalg.norm(span), radar.center_frequency)
        level, length = sphere_return(FAR, image(first), VIEW, RADIUS, radar.wavelength)
        assert abs(decibels(channel(paths) / (gamma * level))).max() < 0.5
        assert set(paths.kind) == {PathKind.MULTI_BOUNCE}
        strongest = np.argmax(np.abs(paths.a[0, 0, :, 0]))
        assert SPEED_OF_LIGHT * paths.tau[0, 0, strongest, 0] == pytest.approx(length, abs=0.04)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 1])
def test_they_are_the_dense_quadrature_with_the_fields_of_both_walls(seed):
    """A box that mirrors the image of the image back, but for a few degrees, two different walls, elements at 45
    degrees: to what the report states, of the strongest return."""
    rng = np.random.default_rng(seed)
    radar = Radar.load("awr1843", overrides=ISOTROPIC, position=VIEW, orientation=(0.3, 0.1, 0.4 * seed))
    if seed:
        radar = replace(radar, tx_polarization="+45", rx_polarization="V")
    scene, first = corridor("metal", "concrete", thickness=0.006), (1, -1)[seed]
    place, box = np.array([3.0, 0.3, 0.9]), trimesh.creation.box(radar.wavelength * np.array([2, 6, 5]))
    ends = image(first), VIEW
    towards = sum((each - place) / np.linalg.norm(each - place) for each in ends)
    turn = Rotation.align_vectors([towards], [[-1, 0, 0]])[0] * Rotation.from_rotvec(0.03 * rng.normal(size=3))
    actor = MeshActor.from_mesh(
        box, material=["pec", "skin"][seed], position=place, orientation=turn.as_euler("ZYX"), name="ball"
    )
    simulator = Simulator(scene, radar, [actor], rtol=3e-3, max_bounces=3)
    error = simulator.tracer.trace(0.0, 0.0).report.error
    paths = of(simulator.paths())
    found = in_a_row(paths, place)
    corners = actor.vertices(0.0)[actor.faces]
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    unoccluded = np.all([np.einsum("fi,fi->f", cross, end - corners[:, 0]) > 0 for end in ends], axis=0)
    walls = {}
    for side, y in WALLS.items():
        material = next(each.properties for each in scene.objects if each.name == NAMES[side])
        eps = complex(material.relative_permittivity(radar.center_frequency))
        walls[side] = np.array([0, y, 0]), np.array([0, 1.0, 0]), eps, material.thickness
    both = WallAfter(*walls[-first], before=Wall(*walls[first]))
    own = complex(actor.properties.relative_permittivity(radar.center_frequency))
    allowed = error * np.abs(channel(paths)).max()
    for tx, rx in ((0, 0), (2, 3)):
        elements = radar.tx_world[tx], radar.rx_world[rx], radar.tx_field, radar.rx_field, radar.center_frequency
        for there, by in ((True, {"tx_wall": both}), (False, {"rx_wall": both})):
            truth = po_gain(corners[unoccluded], *elements, own, n=100, **by)
            assert abs(truth) > 3 * allowed
            assert abs(channel(found[first, there])[tx, rx] - truth) < allowed


def turned_wall(middle, towards, half=4.0):
    """Corners of a square around `middle`, across the level direction `towards`, and its normal."""
    normal = np.array([*towards, 0.0]) / np.hypot(*towards)
    along, up = np.cross([0, 0, 1.0], normal), np.array([0, 0, 1.0])
    corners = [middle + half * (a * along + b * up) for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    return [each.tolist() for each in corners], normal


@pytest.mark.slow
@pytest.mark.parametrize("first", ["one", pytest.param("other", marks=pytest.mark.slow)])
def test_walls_at_any_angle_have_each_its_own(first):
    """A wall of concrete and one of metal, 59 degrees apart and one leaning over, elements at 45 degrees: in either
    order within what is stated of dense quadrature."""
    radar = Radar.load("awr1843", overrides=ISOTROPIC, position=VIEW, orientation=(0.2, 0.1, 0.3))
    radar = replace(radar, tx_polarization="+45", rx_polarization="V")
    place, thickness = np.array([2.2, 0.1, 1.1]), 0.006
    given = {"one": (np.array([1.0, 1.6, 1.0]), (0.25, -1.0)), "other": (np.array([4.4, 0.6, 1.0]), (-1.0, 0.3))}
    materials = {"one": "concrete", "other": "metal"}
    square = {name: turned_wall(*each) for name, each in given.items()}
    lean = Rotation.from_rotvec([0.0, 0.06, 0.0]).as_matrix()
    middle = given["other"][0]
    corners = (np.array(square["other"][0]) - middle) @ lean.T + middle
    square["other"] = corners.tolist(), lean @ square["other"][1]
    scene = load_scene(
        scene_of(77e9, **{name: (each[0], materials[name], thickness) for name, each in square.items()}).sionna
    )
    second = {"one": "other", "other": "one"}[first]
    walls = {}
    for name, (_, normal) in square.items():
        material = next(each.properties for each in scene.objects if each.name == name)
        eps = complex(material.relative_permittivity(radar.center_frequency))
        walls[name] = given[name][0], normal, eps, material.thickness
    both = WallAfter(*walls[second], before=Wall(*walls[first]))
    visible = both.image(VIEW)
    ends = visible, VIEW
    towards = sum((each - place) / np.linalg.norm(each - place) for each in ends)
    box = trimesh.creation.box(radar.wavelength * np.array([2, 6, 5]))
    turn = Rotation.align_vectors([towards], [[-1, 0, 0]])[0]
    actor = MeshActor.from_mesh(box, material="pec", position=place, orientation=turn.as_euler("ZYX"), name="ball")
    simulator = Simulator(scene, radar, [actor], rtol=3e-3, max_bounces=3)
    error = simulator.tracer.trace(0.0, 0.0).report.error
    paths = of(simulator.paths())
    found = paths.select(paths.bounces == 3)
    # The radar sees the body along where the way begins: by the delay of the image of the image.
    length = np.linalg.norm(visible - place) + np.linalg.norm(VIEW - place)
    there = np.abs(SPEED_OF_LIGHT * found.tau[0, 0, :, 0] - length) < 0.02
    straight = (place - VIEW) / np.linalg.norm(place - VIEW)
    corners = actor.vertices(0.0)[actor.faces]
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    unoccluded = np.all([np.einsum("fi,fi->f", cross, end - corners[:, 0]) > 0 for end in ends], axis=0)
    allowed = error * np.abs(channel(paths)).max()
    for tx, rx in ((0, 0), (2, 3)):
        elements = radar.tx_world[tx], radar.rx_world[rx], radar.tx_field, radar.rx_field, radar.center_frequency
        for back, by in ((found.arrival, {"tx_wall": both}), (found.direction, {"rx_wall": both})):
            own = found.select(there & (back[:, 0] @ straight > 0.998))
            truth = po_gain(corners[unoccluded], *elements, complex(np.inf), n=100, **by)
            assert own.num_paths
            assert abs(truth) > 3 * allowed
            assert abs(channel(own)[tx, rx] - truth) < allowed


def test_a_periscope_shows_what_neither_of_its_mirrors_does(radar):
    """Two metal plates at 45 degrees, one above the other: there is no ghost by one of them alone."""
    place, plates = np.array([5.0, 0.0, 3.0]), {}
    for name, middle, normal in (
        ("low", (1.8, 0.0, 1.0), (-1.0, 0.0, 1.0)),
        ("high", (1.8, 0.0, 3.0), (1.0, 0.0, -1.0)),
    ):
        across, up = np.array([0.0, 1.0, 0.0]), np.cross(normal, [0.0, 1.0, 0.0]) / np.sqrt(2)
        corners = [np.array(middle) + 0.5 * (a * across + b * up) for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
        plates[name] = [each.tolist() for each in corners], "pec"
    scene = load_scene(scene_of(77e9, **plates).sionna)
    ball = MeshActor.from_mesh(sphere(), material="pec", position=place, name="ball")
    paths = of(Simulator(scene, radar, [ball], rtol=2e-3, max_bounces=3).paths())
    assert set(paths.bounces) == {1, 3}
    there = paths.select((paths.bounces == 3) & (paths.direction[:, 0, 2] < 0.1))
    visible = place - np.array([7.0, 0.0, 0.0])  # 1.8 m on, 2 m up and 3.2 m on again
    level, _ = sphere_return(place, visible, VIEW, RADIUS, radar.wavelength)
    assert abs(decibels(channel(there) / level)).max() < 0.5


@pytest.mark.slow
def test_changing_tx_and_rx_over_exchanges_them(radar):
    ball = MeshActor.from_mesh(sphere(4), material="pec", position=FAR, name="ball")
    tx, rx = radar.tx_positions, radar.rx_positions
    swapped = replace(
        radar, tx_positions=rx, rx_positions=tx, tx_names=tuple(f"TX{n}" for n in range(len(rx))),
        rx_names=tuple(f"RX{n}" for n in range(len(tx))),
        waveform=replace(radar.waveform, tx_order=tuple(range(len(rx)))),
    )  # fmt: skip
    scene = corridor("concrete", "glass")
    here, there = (
        in_a_row(of(Simulator(scene, each, [ball], rtol=1e-2, max_bounces=3).paths()), FAR) for each in (radar, swapped)
    )
    for (first, way), paths in here.items():
        assert paths.num_paths
        np.testing.assert_allclose(channel(there[first, not way]).T, channel(paths), rtol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("leg", [pytest.param(0, marks=pytest.mark.slow), 1, pytest.param(2, marks=pytest.mark.slow)])
def test_what_stands_in_one_of_the_legs_removes_them(radar, leg):
    """Of the way by the left wall, then the right one, and straight back, before the first wall, between both, and
    before the ball: that by the right wall first is still there."""
    ball = MeshActor.from_mesh(sphere(4), material="pec", position=FAR, name="ball")
    visible = FAR - np.array([0.0, image(1)[1], 0.0])
    shares = np.array([0.0, (SIDE - VIEW[1]), (SIDE - VIEW[1]) + (SIDE - OTHER)]) / (visible - VIEW)[1]
    places = [VIEW, *(VIEW + share * (visible - VIEW) for share in shares[1:])]
    places[1][1], places[2][1] = SIDE, OTHER
    places.append(FAR)
    middle = 0.45 * places[leg] + 0.55 * places[leg + 1]
    board = MeshActor.from_mesh(trimesh.creation.box((0.15, 0.15, 0.3)), material="wood", position=middle, name="board")
    free, hidden = (
        in_a_row(of(Simulator(corridor("pec", "pec"), radar, actors, rtol=1e-2, max_bounces=3).paths()), FAR)
        for actors in ([ball], [ball, board])
    )
    for there in (True, False):
        assert abs(channel(hidden[1, there])[0, 0]) < 1e-2 * abs(channel(free[1, there])[0, 0])
        if leg == 1:  # the others are in the straight way, or in that by the right wall first
            assert channel(hidden[-1, there])[0, 0] == pytest.approx(channel(free[-1, there])[0, 0], rel=0.1)


@pytest.mark.slow
def test_two_bounces_have_none(radar):
    ball = MeshActor.from_mesh(sphere(3), material="pec", position=FAR, name="ball")
    paths = of(Simulator(corridor("pec", "pec"), radar, [ball], rtol=1e-2, max_bounces=2).paths())
    assert not any(each.num_paths for each in in_a_row(paths, FAR).values())


@pytest.mark.slow
def test_over_time_they_follow_the_image_of_the_image(radar):
    """Across the corridor at 1 m/s: frames have what instants have."""
    velocity = np.array([0.0, 1.0, 0.0])
    ball = MeshActor.from_mesh(sphere(4, 0.02), material="metal", position=FAR, velocity=velocity, name="ball")
    tracer = Simulator(corridor("metal", "metal"), radar, [ball], rtol=1e-2, max_bounces=3).tracer
    traced = in_a_row(of(tracer.trace(0.0, radar.waveform.frame_length).moving), FAR)
    for t in np.linspace(0.0, radar.waveform.frame_length, 4)[:3].tolist():
        truth = in_a_row(of(tracer.instant(t)), FAR)
        for way, paths in traced.items():
            assert paths.num_paths
            weights = knot_weights(paths.times, np.array([t]))
            turns = np.mod(paths.frequency * (paths.tau @ weights.T), 1.0)
            found = ((paths.a @ weights.T) * np.exp(-2j * np.pi * turns)).sum(axis=(2, 3))
            assert abs(found - channel(truth[way])).max() < 0.03 * abs(channel(truth[way])).max()
