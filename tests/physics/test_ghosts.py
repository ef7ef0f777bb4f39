"""Ghosts: what moves is seen again by way of flat walls, where and as strong as its image says."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from scipy.optimize import minimize_scalar
from scipy.spatial.transform import Rotation

from rfgen_sionna._types import SPEED_OF_LIGHT
from rfgen_sionna.radar import Radar
from rfgen_sionna.records import PathKind
from rfgen_sionna.scene import MeshActor, load_scene, tabulated
from rfgen_sionna.signal import synthesize
from rfgen_sionna.simulation import Simulator
from rfgen_sionna.tracing.tracer import Tracer
from tests.reference.physical_optics import Wall, fresnel, po_gain
from tests.sionna.rectangles import scene_of

SLOW = pytest.mark.slow
ISOTROPIC = {"pattern": {"kind": "sionna:iso"}}
SIDE = 1.5  # the wall's y
BALL = np.array([2.0, 0.2, 1.0])
RADIUS = 0.05
THICKNESS = 0.1


def side_wall(material, x=(-0.4, 4.0), y=SIDE, thickness=THICKNESS):
    corners = [[x[0], y, 0.6], [x[1], y, 0.6], [x[1], y, 1.4], [x[0], y, 1.4]]
    return load_scene(scene_of(77e9, side=(corners, material, thickness)).sionna)


def sphere(subdivisions=5, radius=RADIUS):
    mesh = trimesh.creation.icosphere(subdivisions=subdivisions, radius=radius)
    return mesh.apply_scale(np.sqrt(4 * np.pi * radius**2 / mesh.area))


@pytest.fixture(scope="module")
def radar():
    return Radar.load("awr1843", position=(0, 0, 1), overrides=ISOTROPIC)


@pytest.fixture(scope="module")
def ball():
    return MeshActor.from_mesh(sphere(4), material="pec", position=BALL, name="ball")


def of(paths, name="ball"):
    return paths.select(paths.object_id == paths.object_names.index(name))


def ways(paths):
    """Paths by (first, last) interaction at the wall."""
    by_wall = [each[:, 0, 1] / each[:, 0, 0] > 0.5 for each in (paths.direction, paths.arrival)]
    return {
        (tx, rx): paths.select((by_wall[0] == tx) & (by_wall[1] == rx)) for tx in (False, True) for rx in (False, True)
    }


def channel(paths, u=0.0):
    gains = paths.a[..., 0]
    if paths.dispersion is not None:
        gains = gains + sum(values[..., 0] * u**order for order, values in enumerate(paths.dispersion, start=1))
    frequency = paths.frequency + u * paths.half_band
    return (gains * np.exp(-2j * np.pi * np.mod(frequency * paths.tau[..., 0], 1.0))).sum(axis=-1)


def decibels(ratio):
    return 20 * np.log10(np.abs(ratio))


def sphere_return(centre, tx, rx, radius, wavelength):
    """|gain| and path length of a large metal sphere by geometrical optics (the limit of the Mie series, which physical
    optics of ka = 80 follows to 0.1 dB): what diverges from the specular point."""
    to_tx, to_rx = ((each - centre) / np.linalg.norm(each - centre) for each in (tx, rx))
    opening = np.arccos(np.clip(to_tx @ to_rx, -1, 1))
    side = to_rx - (to_rx @ to_tx) * to_tx
    side /= max(np.linalg.norm(side), 1e-300)

    def point(angle):
        return centre + radius * (np.cos(angle) * to_tx + np.sin(angle) * side)

    def length(angle):
        return np.linalg.norm(point(angle) - tx) + np.linalg.norm(point(angle) - rx)

    angle = minimize_scalar(length, bounds=(0, opening), method="bounded", options={"xatol": 1e-10}).x
    normal = (point(angle) - centre) / radius
    s_1, s_2 = (np.linalg.norm(point(angle) - each) for each in (tx, rx))
    cos = normal @ (tx - point(angle)) / s_1
    rho = [1 / (1 / s_1 + patch) for patch in (2 / (radius * cos), 2 * cos / radius)]
    spread = np.sqrt(rho[0] * rho[1] / ((rho[0] + s_2) * (rho[1] + s_2)))
    return wavelength / (4 * np.pi * s_1) * spread, s_1 + s_2


def wall_reflection(material, cos, frequency):
    """|r_s| of the side wall's front: elements are vertical, the plane of incidence is level, and the echo of a back
    face 10 cm further is one of its own."""
    r_s, _ = fresnel(complex(material.relative_permittivity(frequency)), 1.0, np.array([cos]))
    return float(np.abs(r_s[0]))


@pytest.mark.parametrize("name", [pytest.param("pec", marks=SLOW), "concrete"])
def test_a_ghost_behind_a_wall_appears_at_its_image_and_is_as_strong_as_the_wall_reflects(radar, ball, name):
    """A tenth of a range cell, half a decibel: by the wall once, bistatic, and twice, the sphere where its image is."""
    scene = side_wall(name)
    simulator = Simulator(scene, radar, [ball], rtol=2e-3, max_bounces=None)
    found = ways(of(simulator.paths()))
    wall = scene.objects[0].properties
    view = np.array(radar.position)
    image = np.array([view[0], 2 * SIDE - view[1], view[2]])
    cos = (2 * SIDE - BALL[1]) / np.linalg.norm(BALL - image)
    gamma = wall_reflection(wall, cos, radar.center_frequency)
    assert gamma == pytest.approx(1.0) if name == "pec" else 0.3 < gamma < 0.6
    cell = SPEED_OF_LIGHT / (2 * radar.waveform.bandwidth)
    for (by_tx, by_rx), paths in found.items():
        ends = image if by_tx else view, image if by_rx else view
        level, length = sphere_return(BALL, *ends, RADIUS, radar.wavelength)
        level *= gamma ** (by_tx + by_rx)
        assert abs(decibels(channel(paths) / level)).max() < 0.5
        assert abs(decibels(np.sqrt(np.mean(np.abs(channel(paths)) ** 2)) / level)) < 0.3
        assert set(paths.bounces) == {1 + by_tx + by_rx}
        assert set(paths.kind) == {PathKind.MULTI_BOUNCE if by_tx or by_rx else PathKind.FACET}
        # In the samples: the beat frequency of the first chirp of the first pair.
        samples = synthesize(simulator.radar, paths, 0.0)[0, 0, 0]
        padded = 64 * len(samples)
        spectrum = np.abs(np.fft.fft(samples * np.hanning(len(samples)), padded))
        beat = np.argmax(spectrum) / padded * radar.waveform.sample_rate
        offset = np.linalg.norm(radar.tx_world[0] - view) + np.linalg.norm(radar.rx_world[0] - view)
        place = beat * SPEED_OF_LIGHT / radar.waveform.slope
        assert abs(place - length) / 2 < 0.1 * cell + offset
        # The last leg comes from where the image of the sphere is.
        visible = BALL * [1, -1, 1] + [0, 2 * SIDE, 0] if by_rx else BALL
        away = (visible - view) / np.linalg.norm(visible - view)
        assert (paths.arrival[:, 0] @ away).min() > np.cos(1.1 * RADIUS / np.linalg.norm(visible - view))


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, pytest.param(1, marks=SLOW), pytest.param(2, marks=SLOW), 3])
def test_ghosts_are_the_dense_quadrature_with_the_wall_s_own_fields(seed):
    """A tilted box, slabs, elements at 45 degrees: to what the report states, of the strongest way's return."""
    rng = np.random.default_rng(seed)
    radar = Radar.load("awr1843", overrides=ISOTROPIC, position=(0, 0, 1), orientation=(0.3, 0.1, 0.4 * seed))
    if seed % 2:
        radar = replace(radar, tx_polarization="+45", rx_polarization="V")
    scene = side_wall(["glass", "concrete"][seed // 2], thickness=0.006)
    box = trimesh.creation.box(rng.uniform(4, 9, 3) * radar.wavelength)
    actor = MeshActor.from_mesh(
        box,
        material=["pec", "skin"][seed % 2],
        position=(1.2, 0.3, 0.9),
        orientation=Rotation.random(random_state=seed).as_euler("ZYX"),
        name="ball",
    )
    simulator = Simulator(scene, radar, [actor], rtol=3e-3, max_bounces=None)
    error = simulator.tracer.trace(0.0, 0.0).report.error
    paths = simulator.paths()
    found = ways(of(paths))
    corners = actor.vertices(0.0)[actor.faces]
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    material = scene.objects[0].properties
    eps = complex(material.relative_permittivity(radar.center_frequency))
    wall = Wall(np.array([0, SIDE, 0]), np.array([0, 1.0, 0]), eps, material.thickness)
    views = {False: np.array(radar.position), True: wall.image(np.array(radar.position))}
    own = complex(actor.properties.relative_permittivity(radar.center_frequency))
    truth, missed = [], []
    for tx, rx in ((0, 0), (2, 3)):
        for way, some in found.items():
            # Every face that is seen is seen as a whole: a box is convex.
            unoccluded = np.all([np.einsum("fi,fi->f", cross, views[end] - corners[:, 0]) > 0 for end in way], axis=0)
            elements = radar.tx_world[tx], radar.rx_world[rx], radar.tx_field, radar.rx_field, radar.center_frequency
            walls = {"tx_wall": wall if way[0] else None, "rx_wall": wall if way[1] else None}
            truth.append(po_gain(corners[unoccluded], *elements, own, n=100, **walls))
            missed.append(channel(some)[tx, rx] - truth[-1])
    truth, missed = np.reshape(truth, (2, 4)), np.reshape(missed, (2, 4))
    levels = np.sqrt(np.mean(np.abs(truth) ** 2, axis=0))
    assert levels[1:].max() > 3 * error * levels.max()
    assert np.sqrt(np.mean(np.abs(missed.sum(axis=1)) ** 2)) < error * levels.max()


def changed_over():
    """Two radars of one Tx and one Rx, of different polarisation, that are one another's with both changed over."""
    radar = Radar.load("awr1843", position=(0, 0, 1), overrides=ISOTROPIC)
    place = np.array([[0.0, 0.03, 0.01]])
    one = replace(
        radar,
        tx_positions=place,
        rx_positions=-place,
        tx_names=("T",),
        rx_names=("R",),
        tx_polarization="+45",
        rx_polarization="V",
        waveform=replace(radar.waveform, tx_order=(0,)),
    )
    other = replace(one, tx_positions=-place, rx_positions=place, tx_polarization="V", rx_polarization="+45")
    return one, other


def test_tx_and_rx_changed_over_exchange_the_two_ways_and_leave_the_sum(ball):
    one, other = changed_over()
    scene = side_wall("concrete")
    here, there = (
        ways(of(Simulator(scene, each, [ball], rtol=1e-2, max_bounces=None).paths())) for each in (one, other)
    )
    for way in here:
        assert abs(channel(here[way]) / channel(there[way[::-1]]) - 1).max() < 1e-9
    total = [sum(channel(part) for part in each.values()) for each in (here, there)]
    assert abs(total[0] / total[1] - 1).max() < 1e-9


def crossing(y=SIDE):
    """Where the way from the radar by the wall to the ball meets the wall."""
    share = y / (2 * y - BALL[1])
    return np.array([share * BALL[0], y, 1.0])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("place", "remains"),
    [
        (0.5 * crossing() + 0.5 * np.array([0, 0, 1.0]), {(False, False)}),  # radar to wall
        (0.5 * crossing() + 0.5 * BALL, {(False, False)}),  # wall to ball
        (0.5 * BALL + 0.5 * np.array([0, 0, 1.0]), {(True, True)}),  # radar to ball
        (np.array([3.0, -0.5, 1.0]), {(False, False), (True, False), (False, True), (True, True)}),
    ],
)
def test_what_stands_in_a_leg_removes_the_ghosts_that_use_it(radar, place, remains):
    ball = MeshActor.from_mesh(sphere(4), material="pec", position=BALL, name="ball")
    board = MeshActor.from_mesh(trimesh.creation.box((0.2, 0.2, 0.3)), material="wood", position=place, name="board")
    found = ways(of(Simulator(side_wall("metal"), radar, [ball, board], rtol=1e-2, max_bounces=None).paths()))
    free = ways(of(Simulator(side_wall("metal"), radar, [ball], rtol=1e-2, max_bounces=None).paths()))
    for way, paths in found.items():
        ratio = abs(channel(paths)[0, 0] / channel(free[way])[0, 0])
        assert ratio == pytest.approx(1.0, abs=0.02) if way in remains else ratio < 1e-2


def test_a_wall_that_ends_before_the_specular_point_shows_no_ghost(radar, ball):
    point = crossing()[0]
    rim = 2 * RADIUS
    for x, ghosts in (((-0.4, point - rim), False), ((-0.4, point + rim), True), ((point + rim, 4.0), False)):
        paths = of(Simulator(side_wall("metal", x=x), radar, [ball], rtol=1e-2, max_bounces=None).paths())
        assert (paths.bounces.max() == 3) == ghosts


def test_direct_returns_alone_are_those_of_free_space_to_the_bit(radar, ball):
    alone = Simulator(None, radar, [ball], rtol=1e-2).paths()
    beside = of(Simulator(side_wall("metal"), radar, [ball], rtol=1e-2, max_bounces=1).paths())
    np.testing.assert_array_equal(alone.a, beside.a)
    np.testing.assert_array_equal(alone.tau, beside.tau)
    twice = of(Simulator(side_wall("metal"), radar, [ball], rtol=1e-2, max_bounces=2).paths())
    assert set(twice.bounces) == {1, 2}


@pytest.mark.slow
def test_ghosts_below_the_tolerance_are_left_out_and_not_missed(radar):
    """The same wall at two tolerances: what the coarse one leaves out is less than it allows."""
    near = MeshActor.from_mesh(sphere(4), material="pec", position=(0.4, 0, 1), name="ball")
    scene = side_wall("ceiling_board", thickness=0.012)
    left_out = of(Simulator(scene, radar, [near], rtol=0.1, max_bounces=None).paths())
    whole = of(Simulator(scene, radar, [near], rtol=1e-3, max_bounces=None).paths())
    assert set(left_out.bounces) == {1}
    assert set(whole.bounces) > {1}
    missing = np.abs(channel(whole) - channel(left_out)).max()
    assert 1e-3 < missing / np.abs(channel(whole)).max() < 0.1


def test_a_ghost_s_delay_and_rate_follow_the_image(radar):
    """Towards the wall at 1 m/s: nearer to the image, while the ball itself hardly gets nearer or farther."""
    velocity = np.array([0.0, 1.0, 0.0])
    actor = MeshActor.from_mesh(sphere(3, 0.02), material="metal", position=BALL, velocity=velocity, name="ball")
    simulator = Simulator(side_wall("metal"), radar, [actor], rtol=1e-2, max_bounces=None)
    traced = simulator.tracer.trace(0.0, radar.waveform.frame_length).moving
    flip = np.array([1, -1, 1.0])
    for knot, t in enumerate(traced.times):
        corners = actor.vertices(float(t))[actor.faces]
        for (by_tx, by_rx), paths in ways(traced).items():
            centroids = corners[paths.facet].mean(axis=1)
            image = centroids * flip + [0, 2 * SIDE, 0]
            legs = []
            for by, element in ((by_tx, radar.tx_world[1]), (by_rx, radar.rx_world[2])):
                offset = (image if by else centroids) - element
                distance = np.linalg.norm(offset, axis=1)
                legs.append((distance, offset @ (velocity * flip if by else velocity) / distance))
            length, rate = np.sum(legs, axis=0)
            np.testing.assert_allclose(SPEED_OF_LIGHT * paths.tau[1, 2, :, knot], length, rtol=0, atol=1e-6)
            np.testing.assert_allclose(SPEED_OF_LIGHT * paths.tau_rate[1, 2, :, knot], rate, rtol=0, atol=2e-3)


def test_max_bounces_says_what_it_cannot_do(radar, ball):
    for wrong in (0, 4, 1.5, True, "2"):
        with pytest.raises(ValueError, match="max_bounces"):
            Simulator(None, radar, [ball], max_bounces=wrong)
    assert Simulator(None, radar, [ball], max_bounces=None).max_bounces == 3


def test_mirrors_do_not_change_the_knots_of_quiet_bodies(radar):
    slow = MeshActor.from_mesh(sphere(2), material="pec", position=(2, 0, 1), velocity=(0.1, 0, 0), name="ball")
    scene = side_wall("metal", thickness=0.012)
    tracers = [Tracer(scene, tabulated(radar), [slow], 1e-2, max_bounces=bounces) for bounces in (1, 2)]
    one, two = (each.trace(0.0, 0.02).report.sample_times for each in tracers)
    assert one == two
