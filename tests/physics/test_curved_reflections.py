"""From bent surface to bent surface over time: metal balls against quadrature, laws, people against the ray mode."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from scipy.optimize import minimize

import rfgen_sionna as rfgen
from rfgen_sionna.radar import Radar
from rfgen_sionna.records import PathKind, knot_weights
from rfgen_sionna.scene import MeshActor, load_scene
from rfgen_sionna.simulation import Simulator
from rfgen_sionna.tracing.static.static_curved import StaticCurvedReflections
from rfgen_sionna.tracing.tracer import Tracer
from tests.benchmarks.subjects import ball, radar_of
from tests.physics.test_ghosts import channel, decibels
from tests.reference.sbr.shoot import shoot
from tests.reference.two_spheres import by_way_of
from tests.sionna.rectangles import add_meshes, scene_of

SLOW = pytest.mark.slow
RADIUS = 0.15
PLACES = {
    "side by side": ((3.0, -0.25, 0.0), (3.0, 0.25, 0.0)),
    "one behind": ((3.0, -0.25, 0.1), (3.2, 0.1, 0.0)),
    "above": ((2.5, 0.0, -0.2), (2.6, 0.1, 0.3)),
}
LENGTH = 0.0276
"""Of an mmMesh frame [s]."""


@pytest.fixture(scope="module")
def radar():
    return radar_of(77)


def metal(place, name, level=3, radius=RADIUS, **motion):
    mesh = ball(level, radius)
    return MeshActor.from_mesh(
        mesh, material="pec", position=None if motion.get("trajectory") else place, name=name, **motion
    )


def true_radius(level, radius=RADIUS):
    """Of the smooth surface that goes through the vertices."""
    return radius * np.linalg.norm(ball(level, 1.0).vertices, axis=1).mean()


def around(paths):
    return paths.select(paths.bounces == 2)


def at(paths, t):
    """(tx, rx) channel at `t` [s], by the paths' splines."""
    weights = knot_weights(paths.times, np.array([t]))
    turns = np.mod(paths.frequency * (paths.tau @ weights.T), 1.0)
    return ((paths.a @ weights.T) * np.exp(-2j * np.pi * turns)).sum(axis=(2, 3))


@pytest.mark.slow
@pytest.mark.parametrize(
    "places",
    [pytest.param(places, id=name, marks=() if name == "above" else SLOW) for name, places in PLACES.items()],
)
def test_two_balls_return_by_way_of_each_other_what_quadrature_says(radar, places):
    """Within 0.5 dB and 5 degrees of geometrical optics at one ball and dense physical optics over the other, both ways
    round, which by itself differs by a tenth of 1 / sqrt(k a) from either end."""
    actors = [metal(place, name) for place, name in zip(places, "ab", strict=True)]
    paths = Simulator(None, radar, actors, rtol=1e-2, max_bounces=2).paths(0.0)
    balls = [(np.array(place), true_radius(3)) for place in places]
    ends = radar.tx_world[0], radar.rx_world[0], radar.tx_field, radar.rx_field, radar.center_frequency
    truth = by_way_of(*balls, *ends) + by_way_of(*balls[::-1], *ends)
    found = around(paths)
    assert found.num_paths == 2
    assert set(found.kind) == {PathKind.MULTI_BOUNCE}
    ratio = channel(found)[0, 0] / truth
    assert abs(decibels(ratio)) < 0.5
    assert abs(np.degrees(np.angle(ratio))) < 5
    # It is not small: 16 to 29 % of what the balls return directly.
    assert abs(truth) > 0.15 * np.abs(channel(paths.select(paths.bounces == 1))).max()


def test_without_further_bounces_there_are_none(radar):
    actors = [metal(place, name) for place, name in zip(PLACES["above"], "ab", strict=True)]
    assert not around(Simulator(None, radar, actors, rtol=1e-2, max_bounces=1).paths(0.0)).num_paths


@pytest.mark.parametrize("level", [2, pytest.param(4, marks=SLOW)])
def test_the_mesh_matters_little(radar, level):
    """320 and 5,120 faces stand for the same ball: within 0.3 dB, of its own radius."""
    places = PLACES["side by side"]

    def returned(level):
        radius = RADIUS**2 / true_radius(level)
        actors = [metal(place, name, level, radius) for place, name in zip(places, "ab", strict=True)]
        return channel(around(Simulator(None, radar, actors, rtol=1e-2, max_bounces=2).paths(0.0)))[0, 0]

    assert abs(decibels(returned(level) / returned(3))) < 0.3


@pytest.mark.slow
def test_one_mesh_of_two_balls_is_two_balls(radar):
    """Limb and trunk of one body: what it shows of itself."""
    places = PLACES["one behind"]
    parts = [ball(3, RADIUS).apply_translation(place) for place in places]
    body = MeshActor.from_mesh(trimesh.util.concatenate(parts), material="pec", name="body")
    two = [metal(place, name) for place, name in zip(places, "ab", strict=True)]
    one, other = (around(Simulator(None, radar, each, rtol=1e-2, max_bounces=2).paths(0.0)) for each in ([body], two))
    assert one.num_paths == other.num_paths == 2
    assert channel(one) == pytest.approx(channel(other), rel=1e-3)


def test_paths_between_instants_are_those_that_instants_have(radar):
    """Balls that pass each other at 1 m/s: at five times of each of two frames within 0.3 %."""
    actors = [
        metal((3.0, -0.25, 0.0), "a", velocity=(-1.0, 0.2, 0.0)),
        metal((3.0, 0.25, 0.0), "b", velocity=(0.3, -0.5, 0.8)),
    ]
    tracer = Tracer(None, radar, actors, rtol=1e-2, max_bounces=2)
    run = tracer.follow()
    for start in (0.0, 0.2):
        moving = tracer.trace(start, start + LENGTH, run).moving
        assert around(moving).num_paths == 2
        for t in np.linspace(start, start + LENGTH, 5).tolist():
            truth = channel(around(tracer.instant(t)))[0, 0]
            assert abs(at(around(moving), t)[0, 0] - truth) < 3e-3 * abs(truth)


def test_rates_are_how_delays_change(radar):
    actors = [
        metal((3.0, -0.25, 0.0), "a", velocity=(-1.0, 0.2, 0.0)),
        metal((3.0, 0.25, 0.0), "b", velocity=(0.3, -0.5, 0.8)),
    ]
    tracer = Tracer(None, radar, actors, rtol=1e-2, max_bounces=2)
    before, here, after = (around(tracer.instant(0.1 + step)) for step in (-1e-3, 0.0, 1e-3))
    slope = (after.tau - before.tau) / 2e-3
    assert here.tau_rate == pytest.approx(slope, rel=1e-4)
    assert np.abs(slope).max() > 1e-9


def test_tx_and_rx_changed_over_make_no_difference():
    """Reciprocity, for elements apart: to 1e-6."""
    here, there = np.array([[0, 0.02, 0.0], [0, 0.03, 0.01]]), np.array([[0, -0.01, 0.015]])
    actors = [metal(place, name) for place, name in zip(PLACES["above"], "ab", strict=True)]
    radar = radar_of(77)
    radars = (
        replace(
            radar, tx_positions=a, rx_positions=b, tx_names=tuple(f"TX{n}" for n in range(len(a))),
            rx_names=tuple(f"RX{n}" for n in range(len(b))),
            waveform=replace(radar.waveform, tx_order=tuple(range(len(a)))),
        )
        for a, b in ((here, there), (there, here))
    )  # fmt: skip
    one, other = (
        channel(around(Simulator(None, each, actors, rtol=1e-3, max_bounces=2).paths(0.0))) for each in radars
    )
    assert one.shape == (2, 1)
    assert one == pytest.approx(other.T, rel=1e-6)


@pytest.mark.slow
def test_elements_have_their_own_ways():
    """A long array sees both balls aslant: within 1 % and 1 degree of one radar at each pair's place."""
    array, radar = np.array([[0, 0.0, 0.0], [0, 0.06, 0.0], [0, -0.05, 0.03]]), radar_of(77)
    actors = [metal(place, name) for place, name in zip(PLACES["side by side"], "ab", strict=True)]
    wide = replace(radar, rx_positions=array, rx_names=("RX0", "RX1", "RX2"))
    together = channel(around(Simulator(None, wide, actors, rtol=1e-3, max_bounces=2).paths(0.0)))[0]
    alone = [
        channel(
            around(
                Simulator(None, replace(radar, rx_positions=place[None]), actors, rtol=1e-3, max_bounces=2).paths(0.0)
            )
        )[0, 0]
        for place in array
    ]
    assert together == pytest.approx(np.array(alone), rel=0.02)


@pytest.mark.slow
def test_scene_and_radar_may_move_together(radar):
    """A radar that goes past balls that stand sees what one that stands sees of balls that go past."""
    velocity = np.array([0.8, -0.4, 0.0])
    going = replace(radar, trajectory=lambda t: velocity * t)
    stand = [metal(place, name) for place, name in zip(PLACES["above"], "ab", strict=True)]
    go = [metal(place, name, velocity=-velocity) for place, name in zip(PLACES["above"], "ab", strict=True)]
    found = []
    for tracer in (Tracer(None, going, stand, 1e-2, max_bounces=2), Tracer(None, radar, go, 1e-2, max_bounces=2)):
        moving = around(tracer.trace(0.05, 0.05 + LENGTH).moving)
        found.append([at(moving, t)[0, 0] for t in (0.05, 0.06, 0.07)])
    assert found[0] == pytest.approx(found[1], rel=1e-3)


def test_what_stands_between_hides_them(radar):
    """A plate between two balls, edge on to the radar: what each shows of the other is gone."""
    places = PLACES["side by side"]
    actors = [metal(place, name) for place, name in zip(places, "ab", strict=True)]
    plate = np.array([[2.5, 0.0, -0.5], [3.5, 0.0, -0.5], [3.5, 0.0, 0.5], [2.5, 0.0, 0.5]])
    screen = MeshActor.from_mesh((plate, np.array([[0, 1, 2], [0, 2, 3]])), material="pec", name="screen")
    paths = around(Simulator(None, radar, [*actors, screen], rtol=1e-2, max_bounces=2).paths(0.0))
    by_balls = paths.select((paths.arrival[:, 0, 1] * paths.direction[:, 0, 1]) < -1e-3)
    assert not by_balls.num_paths


@pytest.mark.slow
def test_glints_fade_where_something_comes_between(radar):
    """A small plate that falls between two balls: the frame in which it cuts the way off ends without that."""
    actors = [metal(place, name) for place, name in zip(PLACES["side by side"], "ab", strict=True)]
    plate = np.array([[-0.3, 0.0, 0.0], [0.3, 0.0, 0.0], [0.3, 0.0, 0.3], [-0.3, 0.0, 0.3]])
    screen = MeshActor.from_mesh(
        (plate, np.array([[0, 1, 2], [0, 2, 3]])), material="pec", name="screen",
        trajectory=lambda t: (3.0, 0.0, 0.03 - 3.0 * t),
    )  # fmt: skip
    tracer = Tracer(None, radar, [*actors, screen], rtol=1e-2, max_bounces=2)
    moving = tracer.trace(0.0, LENGTH).moving
    both = around(moving)
    both = both.select((both.arrival[:, 0, 1] * both.direction[:, 0, 1]) < -1e-3)
    size = [abs(at(both, t)[0, 0]) for t in (0.0, LENGTH)]
    assert size[1] < 0.02 * size[0]


def test_weak_ones_are_left_out(radar):
    """Two small balls show less of one another than a loose tolerance lets be missed."""
    actors = [metal((3.0, y, 0.0), f"{y}", 2, 0.03) for y in (-1.0, 1.0)]
    assert not around(Simulator(None, radar, actors, rtol=5e-2, max_bounces=2).paths(0.0)).num_paths
    assert around(Simulator(None, radar, actors, rtol=1e-4, max_bounces=2).paths(0.0)).num_paths == 2


@pytest.mark.slow
def test_something_strong_elsewhere_hides_no_glints(radar):
    """Balls of skin before a metal board that returns ten times as much: what they show of one another counts against
    what they return themselves."""
    balls = [
        MeshActor.from_mesh(ball(3, RADIUS), material="skin", position=place, name=name)
        for place, name in zip(PLACES["above"], "ab", strict=True)
    ]
    corners = np.array([[0.0, -1.0, -1.0], [0.0, 1.0, -1.0], [0.0, 1.0, 1.0], [0.0, -1.0, 1.0]])
    faces = np.array([[0, 2, 1], [0, 3, 2]])
    board = MeshActor.from_mesh((corners, faces), material="pec", position=(6.0, 0.0, 0.0), name="board")
    alone, both = (
        around(Simulator(None, radar, actors, rtol=0.1, max_bounces=2).paths(0.0))
        for actors in (balls, [*balls, board])
    )
    own = np.isin(both.object_id, [both.object_names.index(name) for name in "ab"])
    bent = both.select(own & ~np.isclose(both.arrival[:, 0, 0], 1.0, atol=1e-9))
    lengths = np.round(alone.tau[0, 0, :, 0] * 3e8, 6)
    kept = np.isin(np.round(bent.tau[0, 0, :, 0] * 3e8, 6), lengths)
    assert alone.num_paths == 2
    assert kept.sum() == 2
    assert channel(bent.select(kept)) == pytest.approx(channel(alone), rel=1e-6)


def test_what_comes_is_there_from_its_first_frame_on(radar):
    """A ball that comes from behind another one: frames have what instants have, whatever was before."""
    still = metal((2.5, 0.0, 0.0), "still")
    comes = MeshActor.from_mesh(ball(3, RADIUS), material="pec", name="comes", trajectory=lambda t: (2.9, 1.5 * t, 0.0))
    tracer = Tracer(None, radar, [still, comes], rtol=1e-2, max_bounces=2)
    run = tracer.follow()
    visible = []
    for start in (0.0, 0.2, 0.4):
        found = around(tracer.trace(start, start + 0.01, run).moving)
        truth = around(tracer.instant(start))
        visible.append(truth.num_paths)
        size = abs(channel(truth)[0, 0]) if truth.num_paths else 0.0
        assert abs(at(found, start)[0, 0] if found.num_paths else 0.0) == pytest.approx(size, rel=1e-3)
    assert visible[0] == 0
    assert visible[-1] == 2


def stationary(balls):
    """Places on two balls (centre, radius) by way of which the path from the origin and back is shortest."""

    def places(x):
        return [c + r * each / np.linalg.norm(each) for (c, r), each in zip(balls, (x[:3], x[3:]), strict=True)]

    def length(x):
        p, q = places(x)
        return np.linalg.norm(p) + np.linalg.norm(q - p) + np.linalg.norm(q)

    ways = [balls[1 - i][0] - balls[i][0] for i in range(2)]
    start = [w / np.linalg.norm(w) - c / np.linalg.norm(c) for w, (c, _) in zip(ways, balls, strict=True)]
    return places(minimize(length, np.concatenate(start), tol=1e-14).x)


def blocked(balls, p, q):
    """Whether a ball stands in one of the legs, or one of the places is seen at a cosine below 0.2."""
    for a, b in ((np.zeros(3), p), (np.zeros(3), q), (p, q)):
        for centre, radius in balls:
            along = np.clip((centre - a) @ (b - a) / ((b - a) @ (b - a)), 0.0, 1.0)
            if np.linalg.norm(a + along * (b - a) - centre) < radius * (1 - 1e-6):
                return True
    normals = [(each - c) / r for each, (c, r) in zip((p, q), balls, strict=True)]
    return min(abs(n @ each) / np.linalg.norm(each) for n, each in zip(normals, (p, q), strict=True)) < 0.2


@pytest.mark.parametrize("pairs", [4, pytest.param(100, marks=SLOW)])
@pytest.mark.parametrize("furniture", [False, True], ids=["two actors", "furniture"])
def test_any_two_balls_in_the_open_have_one_glint(radar, furniture, pairs):
    """Balls of 6 to 30 cm, 320 or 1,280 faces, 3 cm to 1 m apart anywhere in view: one glint, where the way is
    shortest."""
    rng, count = np.random.default_rng(3), 0
    while count < pairs:
        level, radii = int(rng.integers(2, 4)), rng.uniform(0.06, 0.3, 2)
        one = np.array([rng.uniform(2, 4), *rng.uniform(-1, 1, 2)])
        towards = rng.normal(size=3)
        other = one + towards / np.linalg.norm(towards) * (radii.sum() + rng.uniform(0.03, 1.0))
        balls = [(one, true_radius(level, radii[0])), (other, true_radius(level, radii[1]))]
        truth = stationary(balls)
        if blocked(balls, *truth):
            continue
        count += 1
        scene, actors = None, [metal(other, "other", level, radii[1])]
        if furniture:
            built, mesh = scene_of(77e9), ball(level, radii[0])
            add_meshes(built, one=((mesh.vertices + one, mesh.faces), "pec"))
            scene = load_scene(built.sionna)
        else:
            actors.append(metal(one, "one", level, radii[0]))
        found = around(Tracer(scene, radar, actors, 1e-3, max_bounces=2).instant(0.0))
        assert found.num_paths == 2, (level, radii, one, other)
        length = sum(np.linalg.norm(each) for each in (truth[0], truth[1], truth[1] - truth[0]))
        assert found.tau[0, 0, :, 0] * 299792458.0 == pytest.approx(length, abs=2e-4)


def test_what_moves_is_shown_by_furniture_that_is_round(radar):
    """A ball that moves beside a column that stands: paths are the ball's, and as strong as by two that move."""
    column = trimesh.creation.cylinder(radius=0.1, height=1.0, sections=64)
    column.apply_translation((3.0, -0.3, 0.0))
    scene = scene_of(77e9)
    add_meshes(scene, column=((column.vertices, column.faces), "pec"))
    near = metal((3.0, 0.25, 0.0), "near", velocity=(0.0, 0.5, 0.0))
    as_actor = MeshActor.from_mesh(column, material="pec", name="column")
    still = around(Simulator(load_scene(scene.sionna), radar, [near], rtol=1e-2, max_bounces=2).paths(0.0))
    moving = around(Simulator(None, radar, [near, as_actor], rtol=1e-2, max_bounces=2).paths(0.0))
    assert still.num_paths == moving.num_paths == 2
    assert {still.object_names[number] for number in still.object_id} == {"near"}
    assert channel(still) == pytest.approx(channel(moving), rel=1e-3)


def furnished(*places):
    """A static scene of metal balls."""
    scene, mesh = scene_of(77e9), ball(3, RADIUS)
    add_meshes(scene, **{f"ball{n}": ((mesh.vertices + place, mesh.faces), "pec") for n, place in enumerate(places)})
    return load_scene(scene.sionna)


def test_balls_that_stay_return_what_balls_that_move_do(radar):
    """Within the static scene: found once, with no rate."""
    places = PLACES["above"]
    actors = [metal(place, name) for place, name in zip(places, "ab", strict=True)]
    moving = around(Simulator(None, radar, actors, rtol=1e-2, max_bounces=2).paths(0.0))
    still = around(Simulator(furnished(*places), radar, [], rtol=1e-2, max_bounces=2).paths(0.0))
    assert still.num_paths == 2
    assert channel(still) == pytest.approx(channel(moving), rel=2e-2)  # vertices of static meshes are single precision
    assert not still.tau_rate.any()
    assert around(Simulator(furnished(*places), radar, [], rtol=1e-2).paths(0.0)).num_paths == 0


@pytest.mark.slow
def test_a_radar_that_moves_sees_balls_that_stay(radar):
    """As one that stands, at the time at which it is there."""
    scene = furnished(*PLACES["above"])
    going = replace(radar, trajectory=lambda t: np.array([0.8, -0.4, 0.0]) * (t - 0.1))
    one, other = (around(Simulator(scene, each, [], rtol=1e-2, max_bounces=2).paths(0.1)) for each in (going, radar))
    assert one.num_paths == other.num_paths == 2
    assert channel(one) == pytest.approx(channel(other), rel=1e-3)


@pytest.mark.parametrize("level", [3, pytest.param(4, marks=SLOW)])
def test_actors_elsewhere_change_nothing(radar, level):
    """A bowl that stays, full of glints: a small ball beside it leaves them as they are."""
    mesh = ball(level, 0.6)
    mesh.update_faces(mesh.triangles_center[:, 0] > 0.3)
    mesh.remove_unreferenced_vertices()
    scene = scene_of(77e9)
    add_meshes(scene, bowl=((mesh.vertices + np.array([3.4, 0.0, 0.0]), mesh.faces), "pec"))
    beside = metal((2.0, 1.5, 0.0), "beside", 2, 0.03)
    alone, both = (
        around(Simulator(load_scene(scene.sionna), radar, actors, rtol=1e-2, max_bounces=2).paths(0.0))
        for actors in ([], [beside])
    )
    own = both.select(both.object_id == both.object_names.index("bowl"))
    assert alone.num_paths > 10
    assert channel(own) == pytest.approx(channel(alone), rel=1e-9)


@pytest.mark.parametrize("level", [3, pytest.param(4, marks=SLOW)])
def test_glints_of_a_bowl_are_no_more_than_what_comes_from_it(radar, level):
    """A hollow ball, tilted, has a ring of glints, as many as its mesh has faces there, which together are 30 dB too
    much: within 8 dB of the ray mode."""
    mesh = ball(level, 0.5)
    mesh.update_faces(mesh.triangles_center @ [np.cos(0.3), np.sin(0.3), 0.0] > 0.25)
    mesh.remove_unreferenced_vertices()
    bowl = MeshActor.from_mesh(mesh, material="pec", position=(3.4, 0.0, 0.0), name="bowl")
    simulator = Simulator(None, radar, [bowl], rtol=1e-2, max_bounces=2)
    found = channel(around(simulator.paths(0.0)))[0, 0]
    truth = channel(around(shoot(simulator.tracer, 0.0, max_bounces=2, rtol=3e-2).paths))[0, 0]
    assert abs(decibels(found / truth)) < 8


def test_an_actor_between_balls_that_stay_hides_them(radar):
    """A plate that falls between them, edge on to the radar: what is left of the glint goes from all to nothing."""
    places = PLACES["side by side"]
    plate = np.array([[-0.3, 0.0, 0.0], [0.3, 0.0, 0.0], [0.3, 0.0, 0.3], [-0.3, 0.0, 0.3]])
    screen = MeshActor.from_mesh(
        (plate, np.array([[0, 1, 2], [0, 2, 3]])), material="pec", name="screen",
        trajectory=lambda t: (3.0, 0.0, 0.03 - 3.0 * t),
    )  # fmt: skip
    simulator = Simulator(furnished(*places), radar, [screen], rtol=1e-2, max_bounces=2)
    static = {f"ball{n}" for n in range(2)}

    def left(t):
        paths = around(simulator.paths(t))
        own = np.isin([paths.object_names[number] for number in paths.object_id], list(static))
        by_balls = own & ((paths.arrival[:, 0, 1] * paths.direction[:, 0, 1]) < -1e-3)
        return np.abs(channel(paths.select(by_balls))).max(initial=0.0)

    assert left(0.0) > 0
    assert left(LENGTH) < 1e-3 * left(0.0)


@SLOW
def test_people_show_as_much_of_themselves_as_the_ray_mode_says():
    """An adult who walks, in three poses, power summed over range cells of 12 cm: within 2 dB of two million rays,
    which differ by 0.4 dB from eight million. Single poses are up to 5 dB off, 10 and more where glints all but cancel:
    most of them have an edge or another one within their Fresnel zones, which is in the error that is stated."""
    radar = Radar.load("awr1843", "mmmesh", position=(0, 0, 1), look_at=(3, 0, 1))
    person = rfgen.Actor.from_prompt(
        "a person walking back and forth, at 3 m", seed=0, radar=radar, duration=2.0, motion="kinematic"
    )
    simulator = Simulator(None, radar, [person], rtol=1e-2, max_bounces=2)

    def power(paths):
        paths = around(paths)
        a = (paths.a * np.exp(-2j * np.pi * np.mod(paths.frequency * paths.tau, 1.0)))[0, 0, :, 0]
        cell = np.floor(paths.tau[0, 0, :, 0] * 1.5e8 / 0.12).astype(int)
        return sum(abs(a[cell == each].sum()) ** 2 for each in np.unique(cell))

    poses = 0.3138, 0.8, 1.0
    found = np.array([power(simulator.paths(t)) for t in poses])
    truth = np.array(
        [power(shoot(simulator.tracer, t, max_bounces=2, sampling="uniform", level=9).paths) for t in poses]
    )
    assert abs(10 * np.log10(found.sum() / truth.sum())) < 2
    assert np.abs(10 * np.log10(found / truth)).max() < 6


@pytest.mark.slow
def test_furniture_of_which_some_glints_are_too_weak_is_hidden_by_actors(radar):
    """Two balls that show one another and two small ones far off, whose glint is left out, with an actor between the
    former: shares are of the paths that there are."""
    places = PLACES["side by side"]
    built, mesh, small = scene_of(77e9), ball(3, RADIUS), ball(2, 0.01)
    add_meshes(
        built,
        far0=((small.vertices + np.array([4.0, 1.0, 0.3]), small.faces), "pec"),
        far1=((small.vertices + np.array([4.0, 1.3, 0.4]), small.faces), "pec"),
        **{f"ball{n}": ((mesh.vertices + place, mesh.faces), "pec") for n, place in enumerate(places)},
    )
    scene = load_scene(built.sionna)
    plate = np.array([[-0.3, 0.0, -0.3], [0.3, 0.0, -0.3], [0.3, 0.0, 0.3], [-0.3, 0.0, 0.3]])
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    screen, aside = (
        MeshActor.from_mesh((plate, faces), material="pec", name="screen", position=position)
        for position in ((3.0, 0.0, 0.0), (2.0, -2.0, 0.0))
    )
    tracer = Tracer(scene, radar, [screen], rtol=1e-2, max_bounces=2)
    glints = next(each for each in tracer.static_indirect if isinstance(each, StaticCurvedReflections))
    assert glints.paths.num_paths == 2 * len(glints.facet)

    def by_balls(actors):
        paths = around(Tracer(scene, radar, actors, rtol=1e-2, max_bounces=2).instant(0.0))
        return channel(paths.select((paths.arrival[:, 0, 1] * paths.direction[:, 0, 1]) < -1e-3))[0, 0]

    whole = by_balls([])
    assert by_balls([aside]) == pytest.approx(whole, rel=1e-6)
    assert abs(by_balls([screen])) < 0.03 * abs(whole)
