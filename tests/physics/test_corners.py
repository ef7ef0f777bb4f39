"""Corner reflectors, and what one thing shows of another: closed forms, quadrature, polarisation, legs, motion."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from rfgen_sionna._types import SPEED_OF_LIGHT
from rfgen_sionna.radar import Radar
from rfgen_sionna.records import PathKind
from rfgen_sionna.scene import MeshActor, load_scene
from rfgen_sionna.simulation import Simulator
from rfgen_sionna.tracing.routes.planar_parts import mirror_weight
from tests.physics.test_ghosts import channel, decibels, side_wall, sphere
from tests.reference.corners import Side, corner_gain
from tests.sionna.rectangles import scene_of

ISOTROPIC = {"pattern": {"kind": "sionna:iso"}}
RADARS = {24: "position2go", 77: "awr1843"}
SLOW = pytest.mark.slow


def radar_of(gigahertz, **changes):
    """Isotropic elements, and a range window long enough for the far field of large corners."""
    radar = Radar.load(RADARS[gigahertz], overrides=ISOTROPIC)
    slope = radar.waveform.slope / (20 if gigahertz == 77 else 1)
    return replace(radar, waveform=replace(radar.waveform, slope=slope), **changes)


def far(radar, size):
    """A distance [m] beyond which a corner's return hardly changes but for spreading."""
    return min(max(10.0, 16 * size**2 / radar.wavelength), 0.9 * radar.max_range)


def corner(kind, size):
    """Vertices, faces, sides and the rotation that turns the opening towards -x."""
    e = size * np.eye(3)
    if kind == "dihedral":
        low = -0.5 * e[2]
        edges, vertices = [(low, e[0], e[2]), (low, e[1], e[2])], [
            low, low + e[2], low + e[0], low + e[0] + e[2], low + e[1], low + e[1] + e[2],
        ]  # fmt: skip
        faces = [[0, 2, 3], [0, 3, 1], [0, 1, 5], [0, 5, 4]]
        turn = Rotation.from_euler("z", 0.75 * np.pi)
    else:
        zero = np.zeros(3)
        edges = [(zero, e[i], e[(i + 1) % 3]) for i in range(3)]
        turn, _ = Rotation.align_vectors([[-1, 0, 0]], [np.ones(3) / np.sqrt(3)])
        vertices, faces = [zero, *e], [[0, 1, 2], [0, 2, 3], [0, 3, 1]]
        if kind == "square":
            vertices += [e[0] + e[1], e[1] + e[2], e[2] + e[0]]
            faces = [[0, 1, 4], [0, 4, 2], [0, 2, 5], [0, 5, 3], [0, 3, 6], [0, 6, 1]]
    return np.array(vertices), np.array(faces), [Side(*each, kind == "triangle") for each in edges], turn


def placed(kind, size, distance, tilt=None, name="corner"):
    """The actor in front of the radar at the origin, and its sides."""
    vertices, faces, sides, turn = corner(kind, size)
    matrix = ((tilt or Rotation.identity()) * turn).as_matrix()
    actor = MeshActor.from_mesh((vertices @ matrix.T, faces), material="pec", position=(distance, 0, 0), name=name)
    return actor, [
        Side(each.corner @ matrix.T + [distance, 0, 0], each.u @ matrix.T, each.v @ matrix.T, each.triangle)
        for each in sides
    ]


def dihedral(widths, height, distance, angles):
    """Two plates of these widths at right angles, open to the radar at the origin, then yawed, pitched and rolled by
    these `angles` [degrees]: an actor, static plates, and its sides."""
    turn = Rotation.from_euler("ZYX", angles, degrees=True) * Rotation.from_euler("z", 135, degrees=True)
    across, along, up = turn.apply(np.diag([*widths, height]))
    low = np.array([distance, 0.0, 0.0]) - 0.5 * up
    sides = [Side(low, across, up), Side(low, up, along)]
    quads = [np.array([side.corner, side.corner + side.u, side.corner + side.u + side.v, side.corner + side.v])
             for side in sides]  # fmt: skip
    mesh = np.concatenate(quads), [[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]]
    actor = MeshActor.from_mesh(mesh, material="pec", name="dihedral")
    plates = {f"plate{number}": (quad, "pec", 0.01) for number, quad in enumerate(quads)}
    return actor, plates, sides


def bounced(radar, actors, count=None, scene=None, **options):
    options = {"max_bounces": 3, "rtol": 1e-3, **options}
    paths = Simulator(scene, radar, actors, **options).paths()
    return paths if count is None else paths.select(paths.bounces == count)


@pytest.mark.parametrize(
    ("gigahertz", "size"),
    [
        (24, 0.1),
        (77, 0.05),
        (77, 0.2),
        *(pytest.param(*each, marks=SLOW) for each in ((24, 0.05), (24, 0.2), (77, 0.1))),
    ],
)
@pytest.mark.parametrize("kind", ["dihedral", "square", "triangle"])
def test_corner_reflectors_return_their_closed_forms_at_boresight(kind, gigahertz, size):
    """sigma = 8 pi a^2 b^2 / lambda^2, 12 pi a^4 / lambda^2 and 4 pi a^4 / 3 lambda^2 within 0.5 dB, in the far field;
    what returns by fewer bounces, which the forms leave out, is left out."""
    radar = radar_of(gigahertz)
    distance = far(radar, size)
    factor, count = {"dihedral": (8, 2), "square": (12, 3), "triangle": (4 / 3, 3)}[kind]
    actor, _ = placed(kind, size, distance)
    paths = bounced(radar, [actor], count)
    assert set(paths.kind) == {PathKind.MULTI_BOUNCE}
    level = np.sqrt(factor * np.pi) * size**2 / ((4 * np.pi) ** 1.5 * distance**2)
    assert abs(decibels(channel(paths) / level)).max() < 0.5
    # All of three bounces go as far as to the apex and back.
    if count == 3:
        assert np.abs(0.5 * SPEED_OF_LIGHT * paths.tau / distance - 1).max() < 0.2 * size


@pytest.mark.slow
@pytest.mark.parametrize("size", [pytest.param(0.05, marks=SLOW), 0.1, pytest.param(0.2, marks=SLOW)])
@pytest.mark.parametrize("gigahertz", [24, 77])
@pytest.mark.parametrize("kind", ["dihedral", "square", "triangle"])
def test_corner_reflectors_follow_dense_quadrature_off_boresight(kind, gigahertz, size):
    """Within 1 dB at angles up to 30 degrees: returns of three bounces of trihedrals, of two of dihedrals."""
    radar = radar_of(gigahertz)
    count = 2 if kind == "dihedral" else 3
    for degrees, axis in ((-30, "z"), (-12, "y"), (7, "z"), (21, "z"), (30, "y")):
        if kind == "dihedral" and axis == "y":
            axis, degrees = "z", -degrees
        actor, sides = placed(kind, size, far(radar, size), Rotation.from_euler(axis, degrees, degrees=True))
        ends = radar.tx_world[0], radar.rx_world[-1], radar.tx_field, radar.rx_field, radar.center_frequency
        truth = corner_gain(sides, count, *ends, n=200)
        assert abs(decibels(channel(bounced(radar, [actor], count))[0, -1] / truth)) < 1.0


WIDTHS = ((0.083, 0.083), (0.05, 0.1), (0.04, 0.2))
ANGLES = ((12, 0, 25), (17, 0, 30), (10, 0, -30), (-8, 0, 40), (5, 4, 20))


@pytest.mark.slow
@pytest.mark.parametrize("widths", WIDTHS)
@pytest.mark.parametrize("gigahertz", [24, 77])
def test_dihedrals_that_are_rolled_and_yawed_follow_dense_quadrature(gigahertz, widths):
    """Within 1 dB down to 40 dB below boresight, where what the first plate returns by way of the second is up to 5 dB
    from what the second does by way of the first: each counts half."""
    radar, distance, height, compared = radar_of(gigahertz), 2.3, 0.12, 0
    ends = radar.tx_world[0], radar.rx_world[-1], radar.tx_field, radar.rx_field, radar.center_frequency
    boresight = np.sqrt(8 * np.pi) * min(widths) * height / ((4 * np.pi) ** 1.5 * distance**2)
    for angles in ANGLES:
        actor, _, sides = dihedral(widths, height, distance, angles)
        truth = corner_gain(sides, 2, *ends, n=600)
        if decibels(truth / boresight) > -40:
            compared += 1
            assert abs(decibels(channel(bounced(radar, [actor], 2))[0, -1] / truth)) < 1.0
    assert compared > 2


@pytest.mark.parametrize("angles", [(12, 0, 25), pytest.param((-8, 0, 40), marks=SLOW)])
@pytest.mark.parametrize("widths", [*WIDTHS[1:], pytest.param(WIDTHS[0], marks=SLOW)])
def test_dihedrals_that_stay_rolled_and_yawed_return_what_an_actor_s_do(widths, angles):
    radar = radar_of(24)
    actor, plates, _ = dihedral(widths, 0.12, 2.3, angles)
    there = bounced(radar, [], 2, scene=load_scene(scene_of(24e9, **plates).sionna))
    one, other = channel(there), channel(bounced(radar, [actor], 2))
    assert abs(one / other - 1).max() < 2e-3


@pytest.mark.parametrize("ratio", [1.0, 5.0, 8.0, 17.0, 32.0, 1e3])
def test_two_plates_have_either_role_and_count_once_together(ratio):
    one, other = np.array(ratio), np.array(1.0)
    small, large = mirror_weight(one, other), mirror_weight(other, one)
    assert small + large == pytest.approx(1.0)
    assert small == pytest.approx({5.0: 0.5, 8.0: 0.5, 32.0: 1.0}.get(ratio, small))
    assert large <= 0.5 <= small


@pytest.mark.parametrize("gigahertz", [pytest.param(24, marks=SLOW), 77])
def test_a_dihedral_turned_by_45_degrees_turns_the_polarisation(gigahertz):
    """Cross-polar at 45 degrees of roll as strong as co-polar at 0 within 0.5 dB, and hardly anything co-polar."""
    sums = {}
    for roll in (0, 45):
        for received in "VH":
            radar = radar_of(gigahertz, tx_polarization="V", rx_polarization=received)
            actor, _ = placed("dihedral", 0.1, 5.0, Rotation.from_euler("x", roll, degrees=True))
            sums[roll, received] = np.abs(channel(bounced(radar, [actor], 2))).mean()
    assert abs(decibels(sums[45, "H"] / sums[0, "V"])) < 0.5
    assert decibels(sums[45, "V"] / sums[0, "V"]) < -25
    assert decibels(sums[0, "H"] / sums[0, "V"]) < -25


def changed_over():
    """Two radars of which one's Tx is where the other's Rx is, polarisations as well."""
    radar = radar_of(77)
    place = np.array([[0.0, 0.03, 0.01]])
    ends = {"tx_names": ("T",), "rx_names": ("R",), "waveform": replace(radar.waveform, tx_order=(0,))}
    one = replace(radar, tx_positions=place, rx_positions=-place, tx_polarization="+45", rx_polarization="V", **ends)
    other = replace(one, tx_positions=-place, rx_positions=place, tx_polarization="V", rx_polarization="+45")
    return one, other


@pytest.mark.slow
def test_tx_and_rx_changed_over_leave_corners_as_they_are():
    radars = changed_over()
    actor, _ = placed("square", 0.1, 2.0, Rotation.from_euler("zy", (11, -7), degrees=True))
    for count in (2, 3):
        here, there = (channel(bounced(each, [actor], count, rtol=1e-2)) for each in radars)
        assert abs(here / there - 1).max() < 1e-6


@pytest.mark.parametrize("stays", [False, True])
@pytest.mark.parametrize("widths", [WIDTHS[1], (0.02, 0.32), *(pytest.param(each, marks=SLOW) for each in WIDTHS[::2])])
def test_tx_and_rx_changed_over_leave_two_plates_as_they_are(widths, stays):
    """Of like sizes, of unlike ones, and between."""
    actor, plates, _ = dihedral(widths, 0.12, 2.0, (10, 0, -30))
    scene, actors = (load_scene(scene_of(77e9, **plates).sionna), []) if stays else (None, [actor])
    here, there = (channel(bounced(each, actors, 2, scene=scene, rtol=1e-2)) for each in changed_over())
    assert abs(here / there - 1).max() < 1e-6


def test_two_plates_of_two_actors_are_a_dihedral():
    radar = radar_of(77)
    vertices, faces, _, turn = corner("dihedral", 0.1)
    vertices = turn.apply(vertices) + np.array([3.0, 0, 0])
    whole = MeshActor.from_mesh((vertices, faces), material="pec", name="corner")
    plates = [
        MeshActor.from_mesh((vertices[index], [[0, 1, 2], [0, 2, 3]]), material="pec", name=f"plate {number}")
        for number, index in enumerate(([0, 2, 3, 1], [0, 1, 5, 4]))
    ]
    one, other = (channel(bounced(radar, each, 2)) for each in ([whole], plates))
    assert abs(one / other - 1).max() < 1e-3


@pytest.mark.slow
def test_a_board_that_may_move_shows_a_ball_as_a_wall_does():
    """The same image by the walls' ghosts and by plates."""
    radar = Radar.load("awr1843", position=(0, 0, 1), overrides=ISOTROPIC)
    ball = MeshActor.from_mesh(sphere(3, 0.02), material="pec", position=(2.0, 0.2, 1.0), name="ball")
    corners = np.array([[-1.0, 1.5, -1], [4, 1.5, -1], [4, 1.5, 3], [-1, 1.5, 3]])
    board = MeshActor.from_mesh((corners, [[0, 1, 2], [0, 2, 3]]), material="pec", name="board")
    there = bounced(radar, [ball], scene=side_wall("pec"), rtol=1e-2)
    here = bounced(radar, [ball, board], rtol=1e-2)
    for count in (2, 3):
        one, other = (
            channel(each.select((each.bounces == count) & (each.object_id == each.object_names.index("ball"))))
            for each in (there, here)
        )
        assert abs(one - other).max() < 0.05 * abs(other).max()  # in other pixels


def test_a_board_in_a_leg_removes_the_dihedral_s_return():
    radar = radar_of(77)
    actor, _ = placed("dihedral", 0.1, 3.0)
    free = np.abs(channel(bounced(radar, [actor], 2, rtol=1e-2))).mean()
    board = trimesh.creation.box((0.2, 0.002, 0.3))
    # Edge on to the radar: in the bisecting plane, where the waves cross over from plate to plate, or beside it all.
    for place, remains in (((2.899, 0, 0), False), ((2.7, 0.6, 0), True)):
        post = MeshActor.from_mesh(board, material="metal", position=place, name="board")
        # the board touches the plates where they meet
        paths = bounced(radar, [actor, post], 2, rtol=1e-2, collisions="ignore")
        left = np.abs(channel(paths.select(paths.object_id == 0))).mean()
        assert left == pytest.approx(free, rel=0.02) if remains else left < 0.1 * free


def test_a_moving_trihedral_s_path_is_as_long_as_that_to_its_apex_all_the_time():
    """Turning and moving: all paths of three bounces keep the apex's delay and rate over a frame, and their number."""
    radar = Radar.load("awr1843", overrides=ISOTROPIC)
    vertices, faces, _, turn = corner("triangle", 0.1)
    vertices = turn.apply(vertices)

    def pose(t):
        return (3.0 - 0.7 * t, 0.5 * t, 0.1), (0.8 * t, 0.3 * t, 0.2)

    actor = MeshActor.from_mesh((vertices, faces), material="pec", trajectory=pose, name="corner")
    traced = Simulator(None, radar, [actor], max_bounces=3, rtol=1e-3).tracer.trace(0.0, 0.027)
    paths = traced.moving.select(traced.moving.bounces == 3)
    assert paths.num_paths > 0
    centre = 0.5 * (radar.tx_world[0] + radar.rx_world[0])
    apex = np.array([np.linalg.norm(np.array(pose(t)[0]) - centre) for t in paths.times])
    level = np.abs(paths.a[0, 0]).sum(axis=0)
    np.testing.assert_allclose(level, level.mean(), rtol=0.05)
    weight = np.abs(paths.a[0, 0]).mean(axis=1)
    power = weight / weight.sum()
    lengths = 0.5 * SPEED_OF_LIGHT * paths.tau[0, 0]
    total = (paths.a[0, 0] * np.exp(-2j * np.pi * np.mod(paths.frequency * paths.tau[0, 0], 1.0))).sum(axis=0)
    # The coherent phase is the apex's: constant after its own is taken out.
    phase = np.unwrap(np.angle(total * np.exp(4j * np.pi * paths.frequency / SPEED_OF_LIGHT * apex)))
    assert np.ptp(phase) < np.radians(6.0)
    assert abs(power @ lengths - apex).max() < 0.05
    assert abs(power @ paths.velocity - np.gradient(apex, paths.times)).max() < 0.05


def test_two_bounces_are_those_of_three_without_the_third():
    radar = radar_of(77)
    actor, _ = placed("square", 0.1, 3.0, Rotation.from_euler("z", 30, degrees=True))
    two, three = (bounced(radar, [actor], max_bounces=count) for count in (2, 3))
    assert set(two.bounces) == {1, 2}
    assert abs(channel(two.select(two.bounces == 2)) / channel(three.select(three.bounces == 2)) - 1).max() < 0.01
    assert set(bounced(radar, [actor], max_bounces=1).bounces) == {1}


def test_a_ball_alone_has_no_second_bounce():
    """Its faces are flat, but stand for a surface that is bent."""
    ball = MeshActor.from_mesh(sphere(3, 0.2), material="pec", position=(2, 0, 0), name="ball")
    assert set(bounced(radar_of(77), [ball], rtol=1e-2).bounces) == {1}


def room_corner(gigahertz=77, size=0.1, distance=3.0, tilt=7, kind="dihedral", axis="z"):
    """A corner of static plates, and the same as an actor."""
    actor, sides = placed(kind, size, distance, Rotation.from_euler(axis, tilt, degrees=True))
    plates = {
        f"plate{number}": (
            [side.corner, side.corner + side.u, side.corner + side.u + side.v, side.corner + side.v],
            "pec",
            0.01,
        )
        for number, side in enumerate(sides)
    }
    return actor, load_scene(scene_of(1e9 * gigahertz, **plates).sionna)


def test_static_plates_return_as_an_actor_s():
    """A dihedral of furniture: the same paths by the static scene's way of tracing."""
    radar = radar_of(77)
    actor, scene = room_corner(size=0.4)
    here, there = bounced(radar, [], scene=scene, rtol=1e-2), bounced(radar, [actor], rtol=1e-2)
    assert set(here.kind[here.bounces == 2]) == {PathKind.MULTI_BOUNCE}
    one, other = (channel(each.select(each.bounces == 2)) for each in (here, there))
    assert abs(one / other - 1).max() < 0.01
    assert set(bounced(radar, [], scene=scene, max_bounces=1).bounces) == {1}


@pytest.mark.parametrize(
    ("kind", "size", "tilt"),
    [
        ("dihedral", 0.05, 0),
        ("dihedral", 0.4, 2),
        ("square", 0.1, 5),
        *(pytest.param("dihedral", *each, marks=SLOW) for each in ((0.1, 4), (0.1, 12), (0.4, 0), (0.4, 8))),
        *(pytest.param("square", *each, marks=SLOW) for each in ((0.1, 0), (0.2, 3))),
    ],
)
def test_corner_reflectors_that_stay_return_what_an_actor_s_do(kind, size, tilt):
    """However narrow, and wherever the edge lies against what coordinates are rounded by."""
    radar = radar_of(77)
    actor, scene = room_corner(size=size, tilt=tilt, kind=kind)
    count = 2 if kind == "dihedral" else 3
    here, there = (
        Simulator(where, radar, actors, rtol=1e-2, max_bounces=3).paths()
        for where, actors in ((scene, []), (None, [actor]))
    )
    one, other = (channel(each.select(each.bounces == count)) for each in (here, there))
    assert abs(one / other - 1).max() < 0.015  # 0.13 dB: each has its own facets


@pytest.mark.parametrize("tilt", [*(pytest.param(each, marks=SLOW) for each in (20, 40)), 30])
@pytest.mark.parametrize("axis", ["x", "y"])
def test_a_dihedral_that_stays_and_leans_is_not_left_out(tilt, axis):
    """Seen past the ends of its edge it returns tens of times what its plates return by themselves: the way leaves both
    plates in one place, beyond that edge, which counted twice when it was judged whether it matters."""
    radar = radar_of(77)
    actor, scene = room_corner(size=0.08, distance=1.1, tilt=tilt, axis=axis)
    here, there = bounced(radar, [], scene=scene, rtol=1e-2), bounced(radar, [actor], rtol=1e-2)
    one, other = (channel(each.select(each.bounces == 2)) for each in (here, there))
    assert abs(one - other).max() < 0.01 * abs(other).max()


@pytest.mark.slow
@pytest.mark.parametrize(("x", "y"), [(4.0, 1.5), (3.3, 2.2), (5.0, 2.0)])
@pytest.mark.parametrize(("position", "yaw"), [((0.0, 0.0, 1.0), 0.0), ((0.1, 0.2, 1.3), 0.3)])
def test_a_room_s_corner_shows_the_radar_its_image(x, y, position, yaw):
    """Two walls at right angles: the image of the image, at twice the distance of their edge."""
    radar = replace(radar_of(77), position=position, orientation=(yaw, 0.0, 0.0))
    walls = {
        "ahead": ([[x, -3, 0], [x, y, 0], [x, y, 3], [x, -3, 3]], "metal", 0.1),
        "aside": ([[-1, y, 0], [-1, y, 3], [x, y, 3], [x, y, 0]], "metal", 0.1),
    }
    paths = bounced(radar, [], scene=load_scene(scene_of(77e9, **walls).sionna), count=2, rtol=1e-2)
    distance = np.hypot(x - position[0], y - position[1])
    # Rims 1 and 2 m from the point of reflection are 11 and 22 Fresnel zones of 0.09 m away: each leaves a wave of
    # 1 / (pi sqrt(2) zones), 0.18 and 0.09 dB.
    assert decibels(channel(paths)[0, 0]) == pytest.approx(decibels(radar.wavelength / (8 * np.pi * distance)), abs=0.3)


def test_two_sides_of_a_box_show_nothing_of_one_another():
    box = trimesh.creation.box((0.4, 0.4, 0.4))
    faces = {}
    corners = np.add(box.vertices, (3.0, 0.0, 0.0))
    for number, (axis, sign) in enumerate(((0, -1), (1, -1), (1, 1))):
        side = corners[np.isclose(box.vertices[:, axis], 0.2 * sign)]
        around = np.delete(side - side.mean(axis=0), axis, axis=1)
        faces[f"side{number}"] = (side[np.argsort(np.arctan2(around[:, 1], around[:, 0]))], "metal", 0.01)
    scene = load_scene(scene_of(77e9, **faces).sionna)
    for yaw in (0.0, 0.5):
        radar = replace(radar_of(77), position=(3 - 3 * np.cos(yaw), 3 * np.sin(yaw), 0.1), orientation=(-yaw, 0, 0))
        assert set(Simulator(scene, radar, [], rtol=1e-2, max_bounces=3).paths().bounces) == {1}


def test_a_body_before_static_plates_hides_what_they_return():
    """A board in the bisecting plane takes all, half of one leaves what the whole less the other half leaves."""
    radar = radar_of(77)
    _, scene = room_corner(size=0.4)
    free = channel(bounced(radar, [], scene=scene, count=2, rtol=1e-2))

    def left(height, up):
        board = trimesh.creation.box((0.6, 0.002, height))
        actor = MeshActor.from_mesh(board, material="clothing", position=(2.6995, 0, up), name="board")
        paths = bounced(radar, [actor], scene=scene, count=2, rtol=1e-2)
        return channel(paths.select(paths.object_id < 2))

    assert abs(left(0.6, 0.0) / free).max() < 0.05
    halves = left(0.3, 0.15) + left(0.3, -0.15)
    assert abs(halves / free - 1).max() < 0.1


@pytest.mark.slow
def test_a_box_that_turns_face_after_face_to_the_radar_is_followed():
    """A face comes into view between two instants: the images that tell how many knots delays need stay the same."""
    rate = 10.0
    box = MeshActor.from_mesh(
        trimesh.creation.box((0.3, 0.3, 0.3)),
        material="pec",
        name="box",
        trajectory=lambda t: (np.array([2.0, 0.0, 0.0]), (rate * t, 0.0, 0.0)),
    )
    beside = MeshActor.from_mesh(
        trimesh.creation.icosphere(1, 0.02), material="pec", position=(1.5, 0.5, 0.0), name="ball"
    )
    simulator = Simulator(None, radar_of(77), [box, beside], rtol=1e-2, max_bounces=2)
    traced, there = simulator.tracer.trace(0.0, 0.01).moving.at(np.array([0.007])), simulator.paths(0.007)
    box_alone = [each.select(each.object_id == each.object_names.index("box")) for each in (traced, there)]
    run, instant = map(channel, box_alone)
    # what splines in time may err by, three times the tolerance, and the facets of either by that itself
    assert abs(run - instant).max() < 5e-2 * abs(instant).max()


@pytest.mark.parametrize("size", [pytest.param(0.15, marks=SLOW), pytest.param(0.18, marks=SLOW), 0.3])
def test_a_large_plate_of_an_actor_before_one_that_stays(size):
    """Its corners lie on the mirror or beyond what that shows: what is in between was taken for not shown at all. The
    one that stays is the only mirror, and within 1 dB of dense quadrature, which has either order."""
    radar, turned = radar_of(77), np.sqrt(0.5) * np.array([[-1.0, 1.0, 0.0], [-1.0, -1.0, 0.0]])
    sides = []
    for along, width in zip(turned, (0.3, size), strict=True):
        low, up = np.array([3.0, 0.0, -0.5 * width]), np.array([0.0, 0.0, width])
        sides.append(Side(low, width * along, up))
    large, small = ([each.corner, each.corner + each.u, each.corner + each.u + each.v, each.corner + each.v]
                    for each in sides)  # fmt: skip
    actor = MeshActor.from_mesh((np.array(large), [[0, 1, 2], [0, 2, 3]]), material="pec", name="large")
    scene = load_scene(scene_of(77e9, small=(small, "pec", 0.01)).sionna)
    found = channel(bounced(radar, [actor], 2, scene, rtol=1e-2))[0, -1]
    ends = radar.tx_world[0], radar.rx_world[-1], radar.tx_field, radar.rx_field, radar.center_frequency
    assert abs(decibels(found / corner_gain(sides, 2, *ends, n=400))) < 1.0
