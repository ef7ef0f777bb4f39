"""Ghosts and corners behind slabs: every leg takes the coefficient and the delay of the slabs that it goes through."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from rfgen_sionna.radar import Radar
from rfgen_sionna.scene import MATERIALS, MeshActor, load_scene
from rfgen_sionna.simulation import Simulator
from rfgen_sionna.tracing.integral.slabs import transmission
from tests.physics.test_corners import corner, placed
from tests.physics.test_ghosts import ISOTROPIC, SLOW, decibels, sphere
from tests.physics.test_transmission import channel, pane
from tests.reference.sbr.shoot import shoot
from tests.sionna.rectangles import scene_of

SIDE = 1.5  # the wall's y
BALL = np.array([2.0, 0.2, 0.0])
WALL = [[0.3, SIDE, -0.4], [2.0, SIDE, -0.4], [2.0, SIDE, 0.4], [0.3, SIDE, 0.4]]
BOARD = ("plasterboard", 0.0125)


@pytest.fixture(scope="module")
def radar():
    return Radar.load("awr1843", overrides=ISOTROPIC)


def ball(radius=0.01, detail=3, **pose):
    return MeshActor.from_mesh(sphere(detail, radius), material="pec", name="ball", **{"position": BALL, **pose})


def returned(radar, actor, panes, **options):
    options = {"rtol": 1e-2, "transmission": True, "max_bounces": 3, **options}
    scene = load_scene(scene_of(77e9, **panes).sionna) if panes else None
    paths = Simulator(scene, radar, [actor], **options).paths()
    return paths.select(paths.object_id == paths.object_names.index(actor.name))


def by_way(paths):
    """Paths by whether they go by the side wall on the way there, and back."""
    ends = [each[:, 0, 1] / each[:, 0, 0] > 0.5 for each in (paths.direction, paths.arrival)]
    return {(tx, rx): paths.select((ends[0] == tx) & (ends[1] == rx)) for tx in (False, True) for rx in (False, True)}


def middle(paths):
    """Range [m] of all paths, by what they return."""
    return np.average(np.broadcast_to(paths.range, paths.a.shape), weights=np.abs(paths.a) ** 2)


def cosines(elements, by_wall, way, radius=0.01):
    """(element,) of the angles at which ways cross what stands across x: to the specular point of the ball, or to its
    image. Before and behind the wall, which is parallel to x, they are the same."""
    ends = [(np.array([0, 2 * SIDE, 0]) if by else np.zeros(3)) - BALL for by in way]
    normal = sum(each / np.linalg.norm(each) for each in ends)
    point = BALL + radius * normal / np.linalg.norm(normal)
    offset = (point * [1, -1, 1] + [0, 2 * SIDE, 0] if by_wall else point) - elements
    return offset[:, 0] / np.linalg.norm(offset, axis=1)


def slab_of(properties, thickness, cos, frequency):
    """(element,) coefficients for fields across the plane of incidence."""
    return transmission(complex(properties.relative_permittivity(frequency)), 1.0, thickness, cos, frequency)[0]


def bulk(properties, thickness, cos, frequency):
    """(element,) delay of a slab [m]."""
    return thickness * np.sqrt(complex(properties.relative_permittivity(frequency)).real - 1.0 + cos**2)


@pytest.mark.parametrize(
    ("board", "crosses"),
    [
        (pane(0.6, half=1.2), (True, True)),  # before the wall, and in the straight way
        pytest.param(pane(0.6, half=0.3, y=0.84), (False, True), marks=SLOW),  # before the wall alone
        pytest.param(pane(1.5, half=0.3, y=0.9), (False, True), marks=SLOW),  # between wall and ball
        pytest.param(pane(1.5, half=1.2), (True, True), marks=SLOW),  # there, and in the straight way
        pytest.param(pane(0.9, half=0.3), (True, False), marks=SLOW),  # in the straight way alone
    ],
)
def test_each_leg_of_a_ghost_takes_the_slab_s_coefficient_and_delay(radar, board, crosses):
    """Against the same scene without the slab: level and phase, pair by pair and over the band, within 1.2 %
    (0.1 dB), of which strips before the ball's horizon are 0.3 %, which the straight way alone has where nothing is in
    it; delays within 0.2 mm and 1 %."""
    walls = {"side": (WALL, "concrete", 0.1)}
    free = by_way(returned(radar, ball(), walls, transmission=False, rtol=2e-3))
    panes = {**walls, "pane": (board, *BOARD)}
    behind = by_way(returned(radar, ball(), panes, rtol=2e-3))
    scene = load_scene(scene_of(77e9, **panes).sionna)
    properties = next(each.properties for each in scene.objects if each.name == "pane")
    for way, paths in behind.items():
        assert set(paths.bounces) == {1 + sum(way)}
        cos = [cosines(each, by, way) for each, by in zip((radar.tx_world, radar.rx_world), way, strict=True)]
        for offset in np.array([-1.0, 0.2, 1.0]) * 0.5 * radar.waveform.bandwidth:
            frequency = radar.center_frequency + offset
            legs = [
                slab_of(properties, BOARD[1], each, frequency) if crosses[by] else np.ones(len(each))
                for each, by in zip(cos, way, strict=True)
            ]
            ratio = channel(paths, offset) / channel(free[way], offset)
            assert abs(ratio / np.outer(*legs) - 1).max() < 0.012
        extra = sum(
            bulk(properties, BOARD[1], each, radar.center_frequency).mean() for each, by in zip(cos, way, strict=True)
            if crosses[by]
        )  # fmt: skip
        assert 2 * (middle(paths) - middle(free[way])) == pytest.approx(extra, rel=0.01, abs=2e-4)


@pytest.mark.parametrize("behind", [pytest.param(False, marks=SLOW), True])
def test_by_a_metal_wall_twice_all_is_as_if_unfolded(behind):
    """Image theory with polarisation: a ghost by a metal wall both times is the straight return of an image, and
    what stands between wall and ball is an image as well; for elements at 45 degrees and a slab aslant."""
    radar = Radar.load("awr1843", overrides=ISOTROPIC)
    radar = replace(radar, tx_polarization="+45", rx_polarization="V")
    mesh = sphere(3, 0.02)
    here = (mesh.vertices + BALL, mesh.faces)
    flip, shift = np.array([1, -1, 1]), np.array([0, 2 * SIDE, 0])
    there = (here[0] * flip + shift, mesh.faces[:, ::-1])
    place = [1.5, 0.9, 0.0] if behind else [0.6, 0.84, 0.0]
    board = (pane(0.0, half=0.35) @ Rotation.from_euler("ZYX", (0.5, 0.3, 0)).as_matrix().T) + place
    unfolded = board * flip + shift if behind else board
    glass = ("glass", 0.006)
    actors = [MeshActor.from_mesh(each, material="pec", name="ball") for each in (here, there)]
    ghost = by_way(returned(radar, actors[0], {"side": (WALL, "pec", 0.1), "pane": (board, *glass)}, rtol=2e-3))
    straight = returned(radar, actors[1], {"pane": (unfolded, *glass)}, max_bounces=1, rtol=2e-3)
    a, b = channel(ghost[True, True]), channel(straight)
    assert abs(a - b).max() < 0.03 * abs(b).max()  # of the ball, whose facets are other ones to either
    clear = channel(returned(radar, actors[1], {}, max_bounces=1, rtol=2e-3))
    assert abs(b - clear).max() > 0.1 * abs(clear).max()


@pytest.mark.slow
def test_rays_agree_about_a_ghost_through_a_slab(radar):
    """The ray mode, which knows nothing of images and plates: within twice its tolerance, which is an
    estimate, of the strongest return."""
    small = [[0.8, SIDE, -0.15], [1.35, SIDE, -0.15], [1.35, SIDE, 0.15], [0.8, SIDE, 0.15]]
    panes = {"side": (small, "metal", 0.1), "pane": (pane(0.6, turn=15, half=0.35, y=0.84), *BOARD)}
    scene = load_scene(scene_of(77e9, **panes).sionna)
    simulator = Simulator(scene, radar, [ball(0.02)], rtol=2e-3, transmission=True, max_bounces=2)
    sums = []
    for paths in (simulator.paths(), shoot(simulator.tracer, rtol=1e-2).paths):
        own = paths.select(paths.object_id == paths.object_names.index("ball"))
        sums.append([channel(own.select(own.bounces == count)) for count in (1, 2)])
    allowed = 2e-2 * abs(sums[0][0]).max()
    for one, other in zip(*sums, strict=True):
        assert abs(one - other).max() < allowed
    assert abs(sums[0][1]).max() > 5 * allowed  # of some pairs the two ways fade


@pytest.mark.slow
def test_tx_and_rx_changed_over_exchange_the_two_ways_and_leave_the_sum(radar):
    place = np.array([[0.0, 0.03, 0.01]])
    ends = {"tx_names": ("T",), "rx_names": ("R",), "waveform": replace(radar.waveform, tx_order=(0,))}
    one = replace(radar, tx_positions=place, rx_positions=-place, tx_polarization="+45", rx_polarization="V", **ends)
    other = replace(one, tx_positions=-place, rx_positions=place, tx_polarization="V", rx_polarization="+45")
    panes = {"side": (WALL, "concrete", 0.1), "pane": (pane(0.6, turn=20, half=1.2), "glass", 0.006)}
    here, there = (by_way(returned(each, ball(), panes)) for each in (one, other))
    for way, paths in here.items():
        assert abs(channel(paths) / channel(there[way[::-1]]) - 1).max() < 1e-6


def test_a_wall_that_is_hidden_behind_a_slab_shows_the_back_of_who_stands_before_it(radar):
    """Radar, slab, back wall, ball, and the same way back: the ball seen from behind, through the slab twice."""
    far = [[3.2, -0.6, -0.6], [3.2, 0.6, -0.6], [3.2, 0.6, 0.6], [3.2, -0.6, 0.6]]
    place = np.array([2.0, 0.5, 0.0])
    walls = {"far": (far, "metal", 0.1)}
    screen = {"pane": (pane(0.7, half=0.8), *BOARD)}
    free, behind = (
        returned(radar, ball(position=place), panes, rtol=2e-3, max_bounces=3) for panes in (walls, {**walls, **screen})
    )
    # By the far wall both times: it and the back of the slab in a row show the ball as well, nearer or farther.
    length = np.linalg.norm([2 * 3.2 - 2.0 - 0.01, 0.5, 0])
    sums = [
        channel(each.select((each.bounces == 3) & (abs(each.range.reshape(-1, each.num_paths)[0] - length) < 0.1)))
        for each in (free, behind)
    ]
    scene = load_scene(scene_of(77e9, **screen).sionna)
    image = np.array([2 * 3.2 - 2.0 - 0.01, 0.5, 0])
    cos = image[0] / np.linalg.norm(image)
    t_s = slab_of(scene.objects[0].properties, BOARD[1], np.array([cos]), radar.center_frequency)[0]
    assert abs(sums[1] / sums[0] / t_s**2 - 1).max() < 0.02
    assert decibels(abs(t_s) ** 2) < -5


@pytest.mark.slow
def test_a_body_under_clothes_has_its_ghosts_through_them(radar):
    """A skin ball of 4 cm in a shell of cloth, by the wall twice: the cloth's coefficients at normal incidence."""
    sheet = replace(MATERIALS["clothing"], thickness=1e-3)
    cloth = MeshActor.from_mesh(sphere(4, 0.05), material=sheet, position=BALL, name="cloth")
    skin = MeshActor.from_mesh(sphere(4, 0.04), material="skin", position=BALL, name="ball")
    scene = load_scene(scene_of(77e9, side=(WALL, "metal", 0.1)).sionna)
    sums = []
    for actors in ([skin], [skin, cloth]):
        paths = Simulator(scene, radar, actors, rtol=1e-2, transmission=True, max_bounces=3).paths()
        sums.append(channel(by_way(paths.select(paths.object_id == paths.object_names.index("ball")))[True, True]))
    t_s = slab_of(cloth.properties, 1e-3, np.ones(1), radar.center_frequency)[0]
    assert abs(decibels(sums[1] / sums[0] / t_s**2)).max() < 0.3


def corner_of_walls(size=0.1, distance=3.0):
    """Two sides of a static dihedral that opens towards the radar."""
    vertices, _, _, turn = corner("dihedral", size)
    points = vertices @ turn.as_matrix().T + [distance, 0, 0]
    return {"left": (points[[0, 2, 3, 1]], "metal", 0.01), "right": (points[[0, 1, 5, 4]], "metal", 0.01)}


def of_corner(radar, panes, count, *actors, t=0.0, **options):
    """(tx, rx) sum of what the static corner returns by so many bounces."""
    options = {"rtol": 2e-3, "transmission": True, "max_bounces": 3, **options}
    paths = Simulator(load_scene(scene_of(77e9, **panes).sionna), radar, actors, **options).paths(t)
    sides = [paths.object_names.index(name) for name in ("left", "right")]
    return channel(paths.select(np.isin(paths.object_id, sides) & (paths.bounces == count)))


@pytest.mark.slow
def test_a_static_corner_behind_a_board_returns_what_the_board_leaves(radar):
    """Image theory: both outer legs go through the board within 1.4 degrees of normal incidence, and both sums are
    traced to 2e-3. The same by a radar on a trajectory, to which all of the scene moves: other code chooses the plates
    and follows them."""
    board = {"pane": (pane(half=0.5), *BOARD)}
    free, behind = (of_corner(radar, {**corner_of_walls(), **panes}, 2) for panes in ({}, board))
    properties = load_scene(scene_of(77e9, **board).sionna).objects[0].properties
    t_s = slab_of(properties, BOARD[1], np.ones(1), radar.center_frequency)[0]
    assert abs(behind / free / t_s**2 - 1).max() < 0.01
    assert decibels(abs(t_s) ** 4) < -10
    going = replace(radar, trajectory=lambda t: (0.0, 0.0, 0.0))
    assert abs(of_corner(going, {**corner_of_walls(), **board}, 2) - behind).max() < 2e-3 * abs(behind).max()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("place", "left"), [((1.5, 0, 0), (0.02, 0.5)), ((1.5, 0.03, 0), (0, 0)), ((2, 0.3, 0), (1, 1))]
)
def test_who_stands_before_what_is_shown_through_a_board_hides_it(radar, place, left):
    """An actor in between leaves as much of a corner behind a board as a static thing of its outline does; beside the
    ways, all of it to the bit."""
    panes = {**corner_of_walls(), "pane": (pane(half=0.5), *BOARD)}
    box = MeshActor.from_mesh(trimesh.creation.box((0.02, 0.06, 0.3)), material="pec", name="box", position=place)
    front = np.array([[-0.01, y, z] for y, z in ((-0.03, -0.15), (0.03, -0.15), (0.03, 0.15), (-0.03, 0.15))]) + place
    whole, actor, static = (
        of_corner(radar, {**panes, **more}, 2, *actors, rtol=1e-3)
        for more, actors in (({}, ()), ({}, (box,)), ({"box": (front, "metal", 0.01)}, ()))
    )
    assert abs(actor - static).max() < 1e-3 * abs(whole).max()
    share = abs(actor).max() / abs(whole).max()
    assert left[0] <= share <= left[1]
    assert left != (1, 1) or np.array_equal(actor, whole)


@pytest.mark.slow
def test_furniture_behind_a_board_has_the_ghosts_that_a_moving_radar_sees(radar):
    """A metal sheet that looks half-way between the radar and its image in a side wall, by the wall and through a board
    aslant: as a radar sees it that is on its way there, within what both may err by."""
    panes = {
        "side": (WALL, "metal", 0.1),
        "pane": (pane(0.7, turn=15, half=1.2), *BOARD),
        "left": (pane(1.9, turn=-22.9, half=0.1, y=0.3), "metal", 0.01),
        "right": (pane(2.6, turn=40, half=0.1, y=-0.3), "metal", 0.01),
    }
    going = replace(radar, trajectory=lambda t: (0.4 * t, -0.2 * t, 0.1 * t))
    one, other = (of_corner(each, panes, 2, t=0.05, rtol=1e-2) for each in (going, going.at(0.05)))
    free = of_corner(going.at(0.05), {name: each for name, each in panes.items() if name != "pane"}, 2, rtol=1e-2)
    assert abs(one - other).max() < 2e-2 * abs(other).max()
    assert -18 < decibels(abs(other).max() / abs(free).max()) < -12


@pytest.mark.slow
def test_a_corner_reflector_of_an_actor_behind_a_board_returns_what_the_board_leaves(radar):
    """Two bounces within one thing, both outer legs through the board, at the same angle."""
    actor, _ = placed("dihedral", 0.1, 3.0, name="ball")
    free, behind = (
        returned(radar, actor, panes, max_bounces=2, rtol=2e-3) for panes in ({}, {"pane": (pane(half=0.5), *BOARD)})
    )
    sums = [channel(each.select(each.bounces == 2)) for each in (free, behind)]
    scene = load_scene(scene_of(77e9, pane=(pane(), *BOARD)).sionna)
    t_s = slab_of(scene.objects[0].properties, BOARD[1], np.ones(1), radar.center_frequency)[0]
    assert abs(sums[1] / sums[0] / t_s**2 - 1).max() < 0.02


@pytest.mark.slow
def test_coming_out_from_behind_a_pane_a_ghost_s_delay_and_level_stay_continuous(radar):
    """What is left of one and the same ghost by and by goes from what the pane leaves to all of it."""
    panes = {"side": (WALL, "metal", 0.1), "pane": (pane(1.5, half=0.3, y=0.9), *BOARD)}
    actor = ball(0.03, 4, position=BALL - [0, 0.0, 0.25], velocity=(0, 0, -6.0))
    scene = load_scene(scene_of(77e9, **panes).sionna)
    simulator = Simulator(scene, radar, [actor], rtol=1e-2, transmission=True, max_bounces=3)
    run, levels = simulator.tracer.follow(), []
    for t in np.arange(0, 0.04, 0.01):
        moving = simulator.tracer.trace(t, t + 0.01, run).moving
        own = by_way(moving.select(moving.object_id == moving.object_names.index("ball")))[True, True]
        at = own.at(np.linspace(t, t + 0.01, 21))
        phasor = np.exp(-2j * np.pi * np.mod(at.frequency * at.tau[0, 0], 1.0))
        levels.append(np.abs((at.a[0, 0] * phasor).sum(axis=0)))
    level = np.concatenate(levels)
    assert decibels(level[-1] / level[0]) > 8
    assert np.abs(np.diff(level)).max() < 0.35 * level.max()


@pytest.mark.slow
def test_a_radar_that_moves_sees_the_same_ghosts_through_a_slab(radar):
    start, t = np.array([0.1, -0.05, 0.02]), 0.05
    going = replace(radar, trajectory=lambda t: start + np.array([0.5, 0.6, 0.1]) * t)
    panes = {"side": (WALL, "metal", 0.1), "pane": (pane(0.6, half=1.2), *BOARD)}
    sums = []
    for each in (going, going.at(t)):
        scene = load_scene(scene_of(77e9, **panes).sionna)
        paths = Simulator(scene, each, [ball()], rtol=1e-2, transmission=True, max_bounces=2).paths(t)
        own = paths.select(paths.object_id == paths.object_names.index("ball"))
        sums.append([channel(own.select(own.bounces == count)) for count in (1, 2)])
    for one, other in zip(*sums, strict=True):
        assert abs(one - other).max() < 3e-3 * abs(other).max()  # each may err by 1e-2


@pytest.mark.slow
def test_what_is_seen_plainly_stays_as_it_is_to_the_bit(radar):
    """With a pane that stands in no leg."""
    panes = {"side": (WALL, "metal", 0.1), "pane": (pane(y=-1.5), "glass", 0.006)}
    one, other = (returned(radar, ball(), panes, transmission=each) for each in (True, False))
    np.testing.assert_array_equal(one.a, other.a)
    np.testing.assert_array_equal(one.tau, other.tau)
    opaque = {**panes, "pane": (pane(0.6, half=1.2), "metal", 0.001)}
    assert returned(radar, ball(), opaque).num_paths == 0


def test_a_slab_on_one_way_alone_may_take_more_than_one_there_and_back(radar):
    """3 cm of concrete before the wall leave 2 % of the amplitude, 0.04 % there and back: the ghost is there at any
    tolerance that it exceeds."""
    low, high = 0.59, 1.09
    board = ([[0.6, low, -0.25], [0.6, high, -0.25], [0.6, high, 0.25], [0.6, low, 0.25]], "concrete", 0.03)
    panes = {"side": (WALL, "metal", 0.1), "pane": board}
    loose, fine = (returned(radar, ball(0.02), panes, rtol=rtol) for rtol in (1e-2, 1e-3))
    ghosts = [channel(each.select(each.bounces == 2)) for each in (loose, fine)]
    assert abs(ghosts[1]).max() > 0.015 * abs(channel(fine)).max()
    assert abs(ghosts[0] - ghosts[1]).max() < 0.05 * abs(ghosts[1]).max()  # what the coarser one states


@pytest.mark.slow
def test_a_slab_that_turns_is_at_each_instant_as_it_stands_there(radar):
    """A glass leaf swung at 8 rad/s before a ball, and a ghost by a wall beside it."""
    leaf = np.array([[0, -0.4, -0.4], [0, 0.4, -0.4], [0, 0.4, 0.4], [0, -0.4, 0.4]], float)
    door = MeshActor.from_mesh(
        trimesh.Trimesh(leaf, [[0, 1, 2], [0, 2, 3]], process=False),
        material=replace(MATERIALS["glass"], thickness=0.006),
        name="door",
        trajectory=lambda t: (np.array([0.8, 0.0, 0.0]), (0.3 + 8.0 * t, 0.0, 0.0)),
    )
    scene = load_scene(scene_of(77e9, side=(WALL, "metal", 0.1)).sionna)
    simulator = Simulator(scene, radar, [ball(0.02, 1), door], rtol=1e-2, max_bounces=2, transmission=True)
    run = simulator.tracer.trace(0.0, 0.005).moving
    for t in (0.0, 0.005):
        here, there = (
            each.select(each.object_id == each.object_names.index("ball"))
            for each in (run.at(np.array([t])), simulator.paths(t))
        )
        for count in (1, 2):
            a, b = (channel(each.select(each.bounces == count)) for each in (here, there))
            assert abs(b).max() > 0
            assert abs(a - b).max() < 0.01 * abs(b).max()
