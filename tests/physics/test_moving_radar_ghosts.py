"""Ghosts and corners before a radar on a trajectory: at each instant what one that stands there sees, and in between
delays and phases that follow the image of its way."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh

from rfgen_sionna._types import SPEED_OF_LIGHT
from rfgen_sionna.radar import Radar
from rfgen_sionna.records import PathKind
from rfgen_sionna.scene import MeshActor, load_scene
from rfgen_sionna.signal import synthesize
from rfgen_sionna.simulation import Simulator
from tests.physics.test_corners import corner, radar_of
from tests.physics.test_ghosts import ISOTROPIC, channel, sphere
from tests.sionna.rectangles import scene_of

SIDE = 1.5  # the wall's y
BALL = np.array([2.0, 0.2, 1.0])
START, VELOCITY = np.array([0.0, 0.0, 1.0]), np.array([1.5, 0.6, -0.2])
FLIP = np.array([1.0, -1.0, 1.0])  # to the image in the wall, less 2 SIDE along y
SHORT = {
    **ISOTROPIC,
    "preset.mmmesh.num_loops": 8,
    "preset.mmmesh.num_samples": 64,
    "preset.mmmesh.tx_order": ["TX1", "TX2"],
}


def turning(t):
    """(position [m], orientation [rad]) of a radar that goes along a bend."""
    return START + VELOCITY * t + [0, 2.0 * t**2, 0], (0.1 + 2.0 * t, 0.05, 0.3 * t)


def moving(trajectory=turning, **overrides):
    return Radar.load("awr1843", preset="mmmesh", overrides={**SHORT, **overrides}, trajectory=trajectory)


def room(material="concrete", floor=True):
    """A side wall, and a floor if there is one, no larger than the ghosts need."""
    wall = [[0.3, SIDE, 0.5], [2.0, SIDE, 0.5], [2.0, SIDE, 1.5], [0.3, SIDE, 1.5]]
    ground = [[0.3, -0.4, 0], [2.0, -0.4, 0], [2.0, 0.6, 0], [0.3, 0.6, 0]]
    below = {"floor": (ground, "metal", 0.02)} if floor else {}
    return load_scene(scene_of(77e9, side=(wall, material, 0.1), **below).sionna)


def ball(radius=0.05, detail=4, position=BALL, **pose):
    return MeshActor.from_mesh(sphere(detail, radius), material="pec", position=position, name="ball", **pose)


def of(paths, name):
    return paths.select(paths.object_id == paths.object_names.index(name))


def legs(paths):
    """(path, 2, 3) unit vectors to the first and the last interaction."""
    return np.stack([paths.direction[:, 0], paths.arrival[:, 0]], axis=1)


def over_band(paths, places):
    """(place, tx, rx) channel at places -1 … 1 of the band."""
    if paths.dispersion is None:
        return np.stack([channel(paths)] * len(places))
    terms = np.concatenate([paths.a[None], paths.dispersion])[..., 0]
    found = []
    for u in places:
        gains = np.tensordot(u ** np.arange(len(terms)), terms, 1)
        phase = 2 * np.pi * np.mod((paths.frequency + u * paths.half_band) * paths.tau[..., 0], 1.0)
        found.append((gains * np.exp(-1j * phase)).sum(axis=2))
    return np.array(found)


@pytest.mark.slow
def test_a_weak_actor_s_ghost_is_what_it_is_alone_beside_a_strong_one():
    """Through two reflections by a pane whose coefficient changes over the band: an expansion that is judged by the sum
    of all was right for a trihedral's ghost and 0.9 % of its direct return off for a ball of skin."""
    pane = [[0.3, SIDE, 0.0], [2.5, SIDE, 0.0], [2.5, SIDE, 2.0], [0.3, SIDE, 2.0]]
    scene = load_scene(scene_of(77e9, side=(pane, "glass", 0.012)).sionna)
    weak = MeshActor.from_mesh(sphere(4, 0.09), material="skin", position=(1.6, -0.3, 1.1), name="ball")
    vertices, faces, _, turn = corner("triangle", 0.09)
    vertices = vertices @ turn.as_matrix().T
    strong = MeshActor.from_mesh((vertices, faces), material="pec", position=(2, 0.1, 1), name="corner")
    radar, places, found = Radar.load("awr1843", overrides=ISOTROPIC, trajectory=turning), np.linspace(-1, 1, 9), []
    for actors in ([weak], [strong, weak]):
        paths = of(Simulator(scene, radar, actors, rtol=3e-3, max_bounces=3).paths(0.01), "ball")
        found.append([over_band(paths.select(paths.bounces == count), places) for count in (1, 2, 3)])
    direct = np.abs(found[0][0]).max()
    for alone, beside in zip(*found, strict=True):
        assert np.abs(alone).max() > 0.02 * direct
        assert np.abs(alone - beside).max() < 3e-3 * direct


@pytest.mark.slow
def test_at_each_instant_ghosts_are_those_of_a_radar_that_stands_there():
    """Wall and floor, once and twice: gains, delays and directions, to a fifth of the tolerance, as the facets of a
    world that moves are chosen anew."""
    radar, scene, actors = moving(), room(), [ball(detail=3)]
    t = 0.08
    goes, stands = (Simulator(scene, each, actors, rtol=1e-2, max_bounces=3).paths(t) for each in (radar, radar.at(t)))
    here, there = (of(each, "ball") for each in (goes, stands))
    assert set(there.bounces) == {1, 2, 3}
    for count in (1, 2, 3):
        a, b = (each.select(each.bounces == count) for each in (here, there))
        assert set(a.kind) == {PathKind.FACET if count == 1 else PathKind.MULTI_BOUNCE}
        assert abs(channel(a) - channel(b)).max() < 2e-3 * abs(channel(b)).max()
        mean = [np.einsum("p,pki->ki", abs(each.a[0, 0, :, 0]) ** 2, legs(each)) for each in (a, b)]
        np.testing.assert_allclose(mean[0], mean[1], rtol=0, atol=1e-3 * np.linalg.norm(mean[1], axis=1).max())


def test_a_ghost_s_delay_and_rate_are_those_of_the_radar_s_image_on_the_mirrored_way():
    """The image goes by VELOCITY mirrored: lengths within a micrometre, rates within 2 mm/s."""
    radar = moving(lambda t: START + VELOCITY * t)
    actor = ball(0.02, velocity=(0.4, -1.0, 0.0))
    simulator = Simulator(room("metal", floor=False), radar, [actor], rtol=1e-2, max_bounces=3)
    traced = of(simulator.tracer.trace(0.0, radar.waveform.frame_length).moving, "ball")
    visible = set()
    for knot, t in enumerate(traced.times):
        corners = actor.vertices(float(t))[actor.faces]
        ends = []
        for side in (traced.direction, traced.arrival):
            ends.append(side[:, knot, 1] / side[:, knot, 0] > 0.5)
        for by in {*zip(*(each.tolist() for each in ends), strict=True)}:
            chosen = (ends[0] == by[0]) & (ends[1] == by[1])
            paths = traced.select(chosen)
            centroids = corners[paths.facet].mean(axis=1)
            length, rate = 0.0, 0.0
            for mirrored, element in zip(by, (radar.tx_world[1], radar.rx_world[2]), strict=True):
                place, speed = element + VELOCITY * t, VELOCITY
                if mirrored:
                    place, speed = place * FLIP + [0, 2 * SIDE, 0], speed * FLIP
                offset = centroids - place
                distance = np.linalg.norm(offset, axis=1)
                length = length + distance
                rate = rate + offset @ (actor.vertices(1.0).mean(axis=0) - actor.vertices(0.0).mean(axis=0) - speed) / (
                    distance
                )
            np.testing.assert_allclose(SPEED_OF_LIGHT * paths.tau[1, 2, :, knot], length, rtol=0, atol=1e-6)
            np.testing.assert_allclose(SPEED_OF_LIGHT * paths.tau_rate[1, 2, :, knot], rate, rtol=0, atol=2e-3)
            visible.add(by)
    assert len(visible) == 4


def test_samples_of_the_ghost_by_a_metal_wall_twice_are_those_of_the_image_without_it():
    """Image theory through a whole frame: of vertical elements a vertical metal wall makes a mirror image of the same
    sign, and the ghost by the wall both times is the ball's image in free space; phases from chirp to chirp, and so
    Doppler, included."""
    radar = moving(lambda t: START + VELOCITY * t)
    simulator = Simulator(room("pec", floor=False), radar, [ball(detail=3)], rtol=1e-2, max_bounces=3)
    found = of(simulator.tracer.trace(0.0, radar.waveform.frame_length).moving, "ball")
    ghost = synthesize(simulator.radar, found.select(found.bounces == 3), 0.0)
    image = (sphere(3).vertices * FLIP, sphere(3).faces[:, ::-1])
    there = MeshActor.from_mesh(image, material="pec", position=BALL * FLIP + [0, 2 * SIDE, 0], name="ball")
    alone = Simulator(None, radar, [there], rtol=1e-2)
    expected = synthesize(alone.radar, alone.tracer.trace(0.0, radar.waveform.frame_length).moving, 0.0)
    assert np.abs(ghost - expected).max() < 0.02 * np.abs(expected).max()
    # The radar comes nearer to the image: the phase turns through the frame, as its range rate says.
    turn = np.angle(np.vdot(ghost[0, 0], ghost[-1, 0]))
    away = (BALL * FLIP + [0, 2 * SIDE, 0] - START) / np.linalg.norm(BALL * FLIP + [0, 2 * SIDE, 0] - START)
    times = radar.waveform.chirp_times[:, 0]
    law = -4 * np.pi * (VELOCITY @ away) * (times[-1] - times[0]) / radar.wavelength
    assert abs(np.angle(np.exp(1j * (turn - law)))) < 0.3


@pytest.mark.parametrize(("kind", "count"), [pytest.param("dihedral", 2, marks=pytest.mark.slow), ("square", 3)])
def test_corner_reflectors_that_stay_return_the_same_to_a_radar_that_passes(kind, count):
    """As a thing of the scene: by two sides, and by all three, of which each two meet."""
    vertices, faces, _, turn = corner(kind, 0.1)
    radar = radar_of(77)
    silhouette_rays = replace(radar, trajectory=lambda t: np.array([0.2 * t, 1.0 * (t - 0.05), 0.1]))
    place = vertices @ turn.as_matrix().T + [3.0, 0, 0]
    thing = trimesh.Trimesh(place, faces, process=False)
    sums = []
    t = 0.08
    for each in (silhouette_rays, silhouette_rays.at(t)):
        paths = Simulator(scene_with_mesh(thing), each, rtol=1e-2, max_bounces=3).paths(t)
        sums.append(channel(paths.select(paths.bounces == count)))
    assert abs(sums[1]).min() > 0
    assert abs(sums[0] - sums[1]).max() < 0.01 * abs(sums[1]).max()


def scene_with_mesh(mesh, scene=None):
    """A scene of one metal thing, and of what is in a `scene`."""
    import mitsuba as mi
    import sionna.rt as rt

    from rfgen_sionna.scene.radio_materials import sionna_material

    scene = scene or load_scene(None)
    scene.tune(77e9)
    made = mi.Mesh("thing", len(mesh.vertices), len(mesh.faces))
    parameters = mi.traverse(made)
    parameters["faces"] = mi.UInt32(np.asarray(mesh.faces, np.uint32).ravel())
    parameters["vertex_positions"] = mi.Float(np.asarray(mesh.vertices, np.float32).ravel())
    parameters.update()
    thing = rt.SceneObject(mi_mesh=made, name="thing", radio_material=sionna_material("pec", name="thing-material"))
    scene.sionna.edit(add=[thing])
    return load_scene(scene.sionna)


@pytest.mark.slow
def test_direct_returns_do_not_depend_on_how_many_bounces_there_are():
    """To the bit, but for facets that are too faint, as walls may show them."""
    radar, scene = moving(), room(floor=False)
    one, two = (Simulator(scene, radar, [ball(detail=3)], rtol=1e-2, max_bounces=n).paths(0.05) for n in (1, 2))
    assert set(one.bounces) == {1}
    again = two.select(two.bounces == 1)
    np.testing.assert_array_equal(one.a, again.a)
    np.testing.assert_array_equal(one.tau, again.tau)
    assert (two.bounces == 2).any()


def test_ghosts_appear_in_a_run_as_soon_as_there_is_something_to_mirror_them():
    """The radar drives until a short wall shows it the ball: what showed nothing so far is not left alone for good."""
    wall = [[1.2, SIDE, 0.7], [2.0, SIDE, 0.7], [2.0, SIDE, 1.3], [1.2, SIDE, 1.3]]
    scene = load_scene(scene_of(77e9, side=(wall, "metal", 0.1)).sionna)
    radar = moving(lambda t: np.array([1.5 * t - 0.15, 0.0, 1.0]))
    actors = [ball(0.02, detail=2)]
    tracer = Simulator(scene, radar, actors, rtol=1e-2, max_bounces=3).tracer
    run = tracer.follow()
    for frame in range(5):
        t = 0.1 * frame
        here = of(tracer.trace(t, t + 1e-3, run).moving.at(np.array([t])), "ball")
        if frame == 2:
            assert set(here.bounces) == {1}
    there = of(Simulator(scene, radar.at(t), actors, rtol=1e-2, max_bounces=3).paths(t), "ball")
    for count in (2, 3):
        a, b = (channel(each.select(each.bounces == count)) for each in (here, there))
        assert abs(b).max() > 0.05 * abs(channel(there)).max()
        assert abs(a - b).max() < 2e-2 * abs(channel(there)).max()  # the tolerance of either
