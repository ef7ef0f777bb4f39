"""Shooting and bouncing rays, a second opinion, against quadrature, closed forms and the facet tracer."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from rfgen_sionna.radar.pose import rotation_matrix
from rfgen_sionna.records import PathKind
from rfgen_sionna.scene import MeshActor, load_scene
from rfgen_sionna.simulation import Simulator
from tests.benchmarks.subjects import radar_of
from tests.physics.test_corners import placed
from tests.physics.test_ghosts import (
    BALL,
    RADIUS,
    SIDE,
    channel,
    decibels,
    side_wall,
    sphere,
    sphere_return,
    wall_reflection,
)
from tests.physics.test_transmission import pane, there_and_back
from tests.reference.corners import corner_gain
from tests.reference.physical_optics import Wall, po_gain
from tests.reference.sbr.shoot import shoot
from tests.reference.two_spheres import by_way_of
from tests.sionna.rectangles import scene_of

SLOW = pytest.mark.slow
SQUARE = np.array([[0, -1, -1], [0, 1, -1], [0, 1, 1], [0, -1, 1]]) * 0.05
FACES = np.array([[0, 2, 1], [0, 3, 2]])


@pytest.fixture(scope="module")
def radar():
    """One isotropic element at the origin that looks along +x, at 77 GHz."""
    return radar_of(77)


def plate(degrees=0.0, position=(2.0, 0.05, 0.03), name="plate"):
    turned = SQUARE @ Rotation.from_euler("z", degrees, degrees=True).as_matrix().T
    return MeshActor.from_mesh((turned, FACES), material="pec", position=position, name=name)


def ends(radar, tx=0, rx=0):
    return radar.tx_world[tx], radar.rx_world[rx], radar.tx_field, radar.rx_field, radar.center_frequency


def of(paths, name):
    return paths.select(paths.object_id == paths.object_names.index(name))


@pytest.mark.parametrize(
    ("degrees", "allowed"),
    [(0, 0.05), pytest.param(3, 0.05, marks=SLOW), (10, 0.15), pytest.param(25, 0.4, marks=SLOW)],
)
def test_a_plate_returns_what_dense_quadrature_does(radar, degrees, allowed):
    """A plate of 26 wavelengths, in its main lobe and 25 and 40 dB below it, where all that is left is what its rims
    return: they are known to a two-hundredth of the tubes there."""
    subject = plate(degrees)
    truth = po_gain(subject.vertices(0.0)[FACES], *ends(radar), n=120)
    found = shoot(Simulator(None, radar, [subject], rtol=1e-3).tracer, rtol=3e-3)
    assert abs(decibels(channel(found.paths)[0, 0] / truth)) < allowed
    assert found.report.rays < 60_000


@pytest.mark.parametrize("material", ["pec", pytest.param("concrete", marks=SLOW)])
def test_a_ball_returns_the_same_by_rays_and_by_facets_over_the_band(radar, material):
    """Within 0.2 dB and 2 degrees: what both say that they may be off by is 0.15 dB."""
    ball = MeshActor.from_mesh(sphere(4), material=material, position=(2, 0.2, 0), name="ball")
    simulator = Simulator(None, radar, [ball], rtol=3e-3)
    facets, found = simulator.paths(), shoot(simulator.tracer, rtol=1e-2)
    assert found.report.error < 0.015
    for u in (-1.0, 0.0, 1.0):
        ratio = channel(found.paths, u)[0, 0] / channel(facets, u)[0, 0]
        assert abs(decibels(ratio)) < 0.2
        assert abs(np.degrees(np.angle(ratio))) < 2.0


@pytest.mark.parametrize(
    ("kind", "count", "degrees"),
    [
        ("dihedral", 2, 0),
        pytest.param("dihedral", 2, 25, marks=SLOW),
        pytest.param("triangle", 3, 0, marks=SLOW),
        pytest.param("triangle", 3, 15, marks=SLOW),
    ],
)
def test_corner_reflectors_follow_dense_quadrature(radar, kind, count, degrees):
    """Of two and three bounces, within 0.2 dB: the same field, cut at the same edges."""
    actor, sides = placed(kind, 0.06, 3.0, Rotation.from_euler("z", degrees, degrees=True))
    truth = corner_gain(sides, count, *ends(radar), n=200)
    found = shoot(Simulator(None, radar, [actor], rtol=1e-3, max_bounces=3).tracer, rtol=1e-2, max_bounces=count)
    paths = found.paths.select(found.paths.bounces == count)
    assert set(paths.kind) == {PathKind.MULTI_BOUNCE}
    assert abs(decibels(channel(paths)[0, 0] / truth)) < 0.2


@SLOW
@pytest.mark.parametrize(
    ("name", "thickness", "turn"), [("plasterboard", 0.0125, 10.0), pytest.param("glass", 0.006, 25.0, marks=SLOW)]
)
def test_a_plate_behind_a_slab_returns_what_the_slab_s_coefficients_leave(radar, name, thickness, turn):
    """In level and phase over the band within 1.5 %, and later by the slab's bulk."""
    place = np.array([2.0, 0.0, 0.0])
    scene = load_scene(scene_of(77e9, pane=(pane(turn=turn), name, thickness)).sionna)
    free = shoot(Simulator(None, radar, [plate(0, place)], rtol=1e-3).tracer, rtol=3e-3).paths
    behind = shoot(Simulator(scene, radar, [plate(0, place)], rtol=1e-3, transmission=True).tracer, rtol=3e-3)
    found = of(behind.paths, "plate")
    normal = np.array([np.cos(np.radians(turn)), np.sin(np.radians(turn)), 0])
    for u in (-1.0, 0.0, 1.0):
        frequency = radar.center_frequency + u * 0.5 * radar.waveform.bandwidth
        truth = there_and_back(scene.objects[0].properties, thickness, normal, radar.tx_field, frequency, place)
        assert channel(found, u)[0, 0] / channel(free, u)[0, 0] == pytest.approx(truth, rel=0.015)
    assert set(found.bounces) == {1}
    assert (
        shoot(Simulator(scene, radar, [plate(0, place)], rtol=1e-3).tracer).paths.object_id.tolist().count(1) == 0
    )  # opaque


@pytest.mark.parametrize("name", [pytest.param(each, marks=SLOW) for each in ("pec", "concrete")])
def test_a_ghost_by_a_wall_is_as_strong_as_its_image(name):
    """By the wall once, there or back: within half a decibel of the bistatic closed form, and where its image is."""
    radar = replace(radar_of(77), position=(0, 0, 1))
    ball = MeshActor.from_mesh(sphere(4), material="pec", position=BALL, name="ball")
    scene = side_wall(name)
    found = shoot(Simulator(scene, radar, [ball], rtol=1e-3).tracer, max_bounces=2).paths
    ghost = of(found.select(found.bounces == 2), "ball")
    view = np.array(radar.position)
    image = np.array([view[0], 2 * SIDE - view[1], view[2]])
    level, length = sphere_return(BALL, image, view, RADIUS, radar.wavelength)
    cos = (2 * SIDE - BALL[1]) / np.linalg.norm(BALL - image)
    level *= wall_reflection(scene.objects[0].properties, cos, radar.center_frequency)
    assert abs(decibels(channel(ghost)[0, 0] / (2 * level))) < 0.5  # there and back
    weight = np.abs(ghost.a[0, 0, :, 0])
    assert (weight * ghost.range[:, 0]).sum() / weight.sum() == pytest.approx(length / 2, abs=0.02)


@pytest.mark.parametrize(
    ("edge", "off"),
    [
        pytest.param(0.05, 0.0, id="5 cm"),
        pytest.param(0.05, 1.5, id="5 cm, off its lobe", marks=SLOW),
        pytest.param(0.1, 1.5, id="10 cm, off its lobe", marks=SLOW),
        pytest.param(0.3, 1.5, id="30 cm, off its lobe", marks=SLOW),
    ],
)
def test_a_plate_before_a_wall_is_integrated_for_the_wall_s_image_of_the_radar(edge, off):
    """Dense quadrature over the plate, with the wall, which is wide, as an image of the radar: within half a percent in
    the lobe and 3 % off it, where rims are all there is, whose obliquity is the wave's that comes by the wall here and
    the mean of both ways there. Were the plate the mirror, tubes as narrow as it would land on the wall where waves
    have long spread: by half it was, 5.4 dB too strong for 5 cm."""
    radar, place = replace(radar_of(77), position=(0, 0, 1)), np.array([2.0, 0.3, 1.0])
    wall = Wall(np.array([0, SIDE, 0]), np.array([0, -1.0, 0]), complex(np.inf))
    view = np.array(radar.position)
    # Turned so that it takes what comes by the wall to the radar, but for `off` degrees.
    towards = [(each - place) / np.linalg.norm(each - place) for each in (view, wall.image(view))]
    yaw = np.arctan2(*-np.sum(towards, axis=0)[[1, 0]]) + np.radians(off)
    square = SQUARE * (edge / np.ptp(SQUARE[:, 1])) @ Rotation.from_euler("z", yaw).as_matrix().T
    board = MeshActor.from_mesh((square, FACES), material="pec", position=place, name="plate")
    corners = board.vertices(0.0)[FACES]
    truth = sum(po_gain(corners, *ends(radar), n=150, **{by: wall}) for by in ("tx_wall", "rx_wall"))
    simulator = Simulator(side_wall("pec"), radar, [board], rtol=1e-3, max_bounces=2)
    for found in (shoot(simulator.tracer, rtol=1e-2).paths, simulator.paths()):
        assert channel(found.select(found.bounces == 2))[0, 0] == pytest.approx(truth, rel=0.03 if off else 0.005)


@pytest.mark.slow
@pytest.mark.parametrize("edge", [0.05, 0.3])
def test_a_plate_that_a_wall_shows_there_and_back_is_in_the_stated_error(edge):
    """A mirror between two walls, as narrow as it is: 7.9 dB too strong where it is 5 cm wide, 2.5 dB at 30 cm."""
    radar, place = replace(radar_of(77), position=(0, 0, 1)), np.array([2.0, 0.3, 1.0])
    wall = Wall(np.array([0, SIDE, 0]), np.array([0, -1.0, 0]), complex(np.inf))
    towards = wall.image(np.array(radar.position)) - place
    yaw = np.arctan2(*-towards[[1, 0]])
    square = SQUARE * (edge / np.ptp(SQUARE[:, 1])) @ Rotation.from_euler("z", yaw).as_matrix().T
    board = MeshActor.from_mesh((square, FACES), material="pec", position=place, name="plate")
    truth = po_gain(board.vertices(0.0)[FACES], *ends(radar), n=150, tx_wall=wall, rx_wall=wall)
    found = shoot(Simulator(side_wall("pec"), radar, [board], rtol=1e-3, max_bounces=3).tracer, rtol=1e-2)
    off = abs(channel(found.paths.select(found.paths.bounces == 3))[0, 0] - truth)
    level = abs(channel(of(found.paths.select(found.paths.bounces == 1), "side"))[0, 0])
    assert off < found.report.error * level < 10 * off


@SLOW
def test_a_box_before_a_wall_shows_the_wall_to_the_radar_in_neither_mode():
    """No face that the radar sees is one that its image behind the wall sees: by two surfaces nothing but what edges
    bend comes back. The wall's return from the beam that a face at grazing incidence throws on it, cut as no wave is,
    was 15 dB above the box's own."""
    radar = radar_of(77)
    turn = rotation_matrix((0.6, 0.2, 0.1))
    box = trimesh.creation.box((0.3, 0.3, 0.3))
    actor = MeshActor.from_mesh(
        (box.vertices @ turn.T, box.faces), material="metal", position=(1.5, 0.1, 0), name="box"
    )
    corners = actor.vertices(0.0)[actor.faces]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    visible = [np.einsum("fi,fi->f", normal, np.array([x, 0, 0]) - corners[:, 0]) > 0 for x in (0.0, 5.0)]
    assert visible[0].any()
    assert not (visible[0] & visible[1]).any()
    wall = scene_of(77e9, wall=([[2.5, -1.5, -1.5], [2.5, 1.5, -1.5], [2.5, 1.5, 1.5], [2.5, -1.5, 1.5]], "concrete"))
    simulator = Simulator(load_scene(wall.sionna), radar, [actor], rtol=1e-3, max_bounces=2)
    direct = abs(channel(of(simulator.paths(), "box"))[0, 0])
    for found in (shoot(simulator.tracer, rtol=3e-2).paths, simulator.paths()):
        assert abs(channel(found.select(found.bounces == 2))[0, 0]) < 1e-3 * direct


@SLOW
@pytest.mark.parametrize("radii", [(0.1, 0.1), (0.15, 0.06)])
def test_two_metal_balls_return_by_way_of_each_other_what_quadrature_says(radar, radii):
    """Bent to bent: within 0.5 dB of geometrical optics at one ball and dense quadrature over the other, both ways
    round. Physical optics from either end is not the same number: they differ by about 1 / sqrt(k a), a tenth of it."""
    places = np.array([2.0, 0.2, 0.0]), np.array([2.05, -0.2, 0.03])
    actors = [
        MeshActor.from_mesh(sphere(5, radius), material="pec", position=place, name=name)
        for radius, place, name in zip(radii, places, ("one", "other"), strict=True)
    ]
    true_radii = [
        np.linalg.norm(each.vertices(0.0) - at, axis=1).mean() for each, at in zip(actors, places, strict=True)
    ]
    balls = list(zip(places, true_radii, strict=True))
    truth = by_way_of(*balls, *ends(radar)) + by_way_of(*balls[::-1], *ends(radar))
    found = shoot(Simulator(None, radar, actors, rtol=1e-3, max_bounces=2).tracer, rtol=1e-2).paths
    ratio = channel(found.select(found.bounces == 2))[0, 0] / truth
    assert abs(decibels(ratio)) < 0.5
    assert abs(np.degrees(np.angle(ratio))) < 10


@SLOW
def test_tx_and_rx_changed_over_make_no_difference(radar):
    """Of a dihedral by up to two surfaces: each pair's two ways round change over with it."""
    here, there = np.array([[0, 0.02, 0.0]]), np.array([[0, -0.01, 0.015]])
    actor, _ = placed("dihedral", 0.05, 2.0, Rotation.from_euler("z", 10, degrees=True))
    found = [
        channel(shoot(Simulator(None, each, [actor], rtol=1e-3).tracer, max_bounces=2).paths)
        for each in (replace(radar, tx_positions=a, rx_positions=b) for a, b in ((here, there), (there, here)))
    ]
    assert found[0] == pytest.approx(found[1], rel=1e-6)


@pytest.mark.parametrize("count", [1, pytest.param(2, marks=SLOW)])
def test_rates_are_how_delays_change(radar, count):
    """Of a ball, and of its ghost by a wall: Doppler of the path's own length."""
    place, velocity = np.array([1.5, 0.1, 0.0]), np.array([0.4, -0.3, 0.0])
    wall = scene_of(77e9, side=([[-1, 0.6, -1], [4, 0.6, -1], [4, 0.6, 1], [-1, 0.6, 1]], "pec"))
    ball = MeshActor.from_mesh(sphere(3), material="pec", position=place, velocity=velocity, name="ball")
    simulator = Simulator(None if count == 1 else load_scene(wall.sionna), radar, [ball], rtol=1e-3)
    paths = of(shoot(simulator.tracer, max_bounces=count, rtol=3e-2).paths, "ball")
    chosen = paths.select(paths.bounces == count)
    straight, mirrored = (np.array([1.5, y, 0.0]) / np.hypot(1.5, y) for y in (0.1, -1.1))
    # The image of the ball moves towards +y where the ball moves towards -y.
    expected = straight @ velocity if count == 1 else 0.5 * (straight + mirrored) @ velocity
    weight = np.abs(chosen.a[0, 0, :, 0])
    assert (weight * chosen.velocity[:, 0]).sum() / weight.sum() == pytest.approx(expected, abs=0.03)


@SLOW
def test_more_rays_go_where_they_are_needed(radar):
    """Adaptive sampling is more accurate than uniform sampling with five times as many rays; both are reported."""
    ball = MeshActor.from_mesh(sphere(4), material="pec", position=(2, 0.2, 0), name="ball")
    simulator = Simulator(None, radar, [ball], rtol=1e-3)
    truth = channel(shoot(simulator.tracer, rtol=2e-3).paths)[0, 0]
    adaptive, uniform = shoot(simulator.tracer, rtol=2e-2), shoot(simulator.tracer, sampling="uniform", level=7)
    errors = [abs(channel(each.paths)[0, 0] / truth - 1) for each in (adaptive, uniform)]
    assert 5 * adaptive.report.rays < uniform.report.rays
    assert errors[0] < errors[1]
    report = adaptive.report
    assert report.guiding < report.rays == sum(report.by_bounce)
    assert 0 < report.hits < report.rays
    assert report.tubes[0] >= adaptive.paths.num_paths > 0  # the weakest make no paths


@pytest.mark.slow
@SLOW
def test_the_pir_shows_a_ghost_where_the_radar_sees_it():
    """Beside the ball a wall shows it again: at the image's direction there is nothing by one surface."""
    radar = replace(radar_of(77), position=(0, 0, 1))
    ball = MeshActor.from_mesh(sphere(3), material="pec", position=BALL, name="ball")
    simulator = Simulator(side_wall("pec"), radar, [ball], rtol=1e-3)
    view = {"resolution": (32, 64), "fov_deg": (130.0, 60.0)}
    one, two = simulator.pir(**view), simulator.pir(**view, bounces=2)
    more = two.energy - one.energy
    row, column = np.unravel_index(np.argmax(more[:, :16]), (32, 16))
    image = np.array([BALL[0], 2 * SIDE - BALL[1], 0.0])
    y = 0.5 * (1 - image[1] / image[0] / np.tan(np.radians(65)))
    assert abs(column + 0.5 - 64 * y) < 2
    assert abs(row + 0.5 - 16) < 2
    length = 0.5 * (np.linalg.norm(image) + np.linalg.norm(BALL - [0, 0, 1]))
    assert 149896229.0 * two.time_of_arrival[row, column] == pytest.approx(length - RADIUS, abs=0.05)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"rtol": 1.0}, "rtol is 1.0"),
        ({"max_bounces": 7}, "max_bounces is 7: a whole number of 1 … 6"),
        ({"max_bounces": True}, "max_bounces is True"),
        ({"sampling": "random"}, "sampling is 'random': allowed are 'adaptive', 'uniform'"),
        ({"level": 4}, "level is 4 with 'adaptive'"),
        ({"sampling": "uniform"}, "level is None"),
    ],
)
def test_options_out_of_range_are_named(radar, options, message):
    with pytest.raises(ValueError, match=message):
        shoot(Simulator(None, radar, [plate()]).tracer, **options)


def test_nothing_at_all_is_no_paths(radar):
    found = shoot(Simulator(None, radar, (), rtol=1e-3).tracer)
    assert found.paths.num_paths == 0
    assert found.paths.a.shape[:2] == (1, 1)
    assert found.report.error == 0.0
