"""Actors as Sionna's sensing targets: the radar equation, phase, polarisation, near field, ghosts and Doppler."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import trimesh

import rfgen_sionna as rfgen
from rfgen_sionna._types import SPEED_OF_LIGHT
from rfgen_sionna.radar import Radar
from rfgen_sionna.scene import MeshActor, add_radar, load_scene
from rfgen_sionna.scene.mitsuba_backend import ensure_backend
from rfgen_sionna.simulation import Simulator
from tests.reference.physical_optics import po_gain
from tests.sionna.rectangles import add_rectangles, apart, scene_of

QUAD = np.array([[0, 1, 2], [0, 2, 3]])


@pytest.fixture(scope="module")
def rt():
    ensure_backend()
    import sionna.rt
    import sionna.rt.rcs

    return sionna.rt


def solve(rt, scene, depth=1, **options):
    settings = {"samples_per_sp": 2_000, "synthetic_array": False, "seed": 1, **options}
    return rt.rcs.RCSSolver()(scene.sionna, max_depth=depth, **settings)


def free_space(radar):
    scene = load_scene(None)
    scene.tune(radar.center_frequency)
    add_radar(scene, radar)
    return scene


def channel(paths):
    """(tx, rx) sum over the paths, propagation included."""
    return (paths.a * np.exp(-2j * np.pi * np.mod(paths.frequency * paths.tau, 1.0)))[..., 0].sum(axis=-1)


def radar_equation(radar, cross_section, distance):
    return radar.wavelength * np.sqrt(cross_section) / ((4 * np.pi) ** 1.5 * distance**2)


def plate(width, height):
    y, z = width / 2, height / 2
    return np.array([[0, -y, -z], [0, y, -z], [0, y, z], [0, -y, z]]), QUAD


def ball(radius, subdivisions=5):
    made = trimesh.creation.icosphere(subdivisions=subdivisions, radius=radius)
    return made.vertices, made.faces


def reference(actor, radar, n):
    """(tx, rx) dense quadrature of the actor's surface; it has no shadows of its own."""
    corners = actor.vertices(0.0)[actor.faces]
    eps = complex(actor.properties.relative_permittivity(radar.center_frequency))
    return np.array(
        [
            [
                po_gain(corners, tx, rx, radar.tx_field, radar.rx_field, radar.center_frequency, eps, n=n)
                for rx in radar.rx_world
            ]
            for tx in radar.tx_world
        ]
    )


def decibels(ratio):
    return 20 * np.log10(np.abs(ratio))


@pytest.mark.parametrize(
    ("mesh", "cross_section"),
    [
        # A sphere of metal: pi a^2, and the interference with physical optics' shadow edge of at most 1 / (k a).
        (ball(0.05, 6), lambda wavelength: np.pi * 0.05**2),
        (plate(0.06, 0.04), lambda wavelength: 4 * np.pi * (0.06 * 0.04) ** 2 / wavelength**2),
    ],
)
def test_metal_obeys_the_radar_equation_with_its_cross_section(rt, mesh, cross_section):
    """At 40 m, 20 times the far-field distance of the sphere, where its centre and its front differ by 0.02 dB."""
    radar = Radar.load("awr1843", position=(1.0, 2.0, 1.0), orientation=(0.7, 0.0, 0.0))
    towards = radar.rotation @ [1.0, 0, 0]
    actor = MeshActor.from_mesh(
        mesh, material="metal", position=radar.position + 40.0 * towards, orientation=(0.7, 0, 0), name="thing"
    )
    scene = free_space(radar)
    rfgen.add_actor(scene, actor)
    found = rfgen.from_sionna(solve(rt, scene), radar, scene=scene)
    level = radar_equation(radar, cross_section(radar.wavelength), 40.0)
    assert abs(decibels(channel(found) / level)).max() < 0.1
    assert (found.num_paths, found.object_names[found.object_id[0]], found.bounces[0]) == (1, "thing", 1)


@pytest.mark.parametrize("name", ["metal", "concrete"])
@pytest.mark.parametrize("polarizations", [("V", "V"), ("+45", "V"), ("H", "V")])
def test_a_tilted_plate_s_bistatic_return_is_physical_optics(rt, name, polarizations):
    """Level, phase and polarisation against the dense quadrature, the elements 4 m apart."""
    radar = replace(
        apart(baseline=4.0, position=(0, 0, 1), orientation=(0, 0, 0.2)),
        tx_polarization=polarizations[0],
        rx_polarization=polarizations[1],
    )
    actor = MeshActor.from_mesh(
        plate(0.05, 0.03), material=name, position=(30, 5, 4), orientation=(0.175, -0.11, 0.6), name="plate"
    )
    scene = free_space(radar)
    rfgen.add_actor(scene, actor)
    found = channel(rfgen.from_sionna(solve(rt, scene), radar))
    expected = reference(actor, radar, 64)
    scale = abs(reference(actor, replace(radar, tx_polarization="V", rx_polarization="V"), 64)).max()
    # At 30 m the quadratic phase is 0.05 rad at the corners, a third of it on the mean.
    assert abs(found - expected).max() < 0.025 * scale


@pytest.mark.slow
def test_in_the_near_field_the_actor_becomes_many_points(rt):
    """A plate of 16 wavelengths at 1.5 m; one point would err by 4 dB."""
    radar = Radar.load("awr1843", position=(0, 0, 1))
    actor = MeshActor.from_mesh(plate(0.12, 0.12), material="metal", position=(1.5, 0.02, 1.01), name="plate")
    expected = reference(actor, radar, 160)
    errors = {}
    for distance in (None, 1.5):
        scene = free_space(radar)
        rfgen.add_actor(scene, actor, distance=distance)
        found = rfgen.from_sionna(solve(rt, scene), radar, scene=scene)
        ratio = channel(found) / expected
        errors[distance] = abs(ratio - 1).max()
        assert set(found.object_id) == {found.object_names.index("plate")}
    assert errors[None] > 0.3
    assert found.num_paths > 8
    assert errors[1.5] < 0.12
    assert abs(decibels(ratio)).max() < 0.1


@pytest.mark.slow
def test_in_the_near_field_the_lobes_of_a_flat_face_err_by_a_share_of_the_main_one(rt):
    """A plate of 10 x 8 cm at 3 m, broadside, on the flank of its main lobe, and in side lobes 17 and 25 dB below."""
    radar = Radar.load("awr1843", position=(0, 0, 1))
    found, expected = [], []
    for yaw in (0.0, 0.01, 0.05, 0.1):
        actor = MeshActor.from_mesh(
            plate(0.1, 0.08), material="metal", position=(3, 0, 1), orientation=(yaw, 0, 0), name="plate"
        )
        scene = free_space(radar)
        rfgen.add_actor(scene, actor, distance=3.0)
        found.append(channel(rfgen.from_sionna(solve(rt, scene), radar)))
        expected.append(reference(actor, radar, 100))
    found, expected = np.array(found), np.array(expected)
    assert abs(decibels(found[:2] / expected[:2])).max() < 0.1
    assert abs(abs(found) - abs(expected)).max() < 0.02 * abs(expected).max()


def test_our_tracer_finds_the_same(rt):
    """A body that shadows itself: a ball of concrete before a metal plate, 2 m away, moving."""
    radar = Radar.load("awr1843", position=(0, 0, 1))
    front, back = ball(0.03, 4), plate(0.1, 0.08)
    vertices = np.concatenate([front[0] - np.array([0.1, 0.02, 0.01]), back[0]])
    faces = np.concatenate([front[1], back[1] + len(front[0])])
    actor = MeshActor.from_mesh(
        (vertices, faces), material="concrete", position=(2.0, 0.0, 1.0), velocity=(1.0, -2.0, 0.5), name="both"
    )
    scene = free_space(radar)
    rfgen.add_actor(scene, actor, distance=1.8)
    found = rfgen.from_sionna(solve(rt, scene), radar)
    ours = Simulator(None, radar, [actor], rtol=1e-3).paths()
    ratio = channel(found) / channel(ours)
    assert abs(decibels(ratio)).max() < 0.4
    assert np.degrees(abs(np.angle(ratio))).max() < 6.0
    spread = np.sort(ours.velocity[:, 0])[[0, -1]]
    assert spread[0] - 1e-3 < found.velocity.min() < found.velocity.max() < spread[1] + 1e-3


@pytest.mark.parametrize(("material", "subdivisions"), [("pec", 2), pytest.param("skin", 3, marks=pytest.mark.slow)])
def test_a_coarse_ball_is_the_round_one_that_our_tracer_takes_it_for(rt, material, subdivisions):
    """320 and 1,280 facets: gains of all element pairs within 0.2 dB and 2 degrees of our tracer's, the delay to the
    nearest point and the radial velocity as far as one point stands for a piece of 1.5 cm."""
    radar = Radar.load("awr1843", position=(0, 0, 1))
    actor = MeshActor.from_mesh(
        ball(0.05, subdivisions), material=material, position=(6, 0.3, 1.2), velocity=(1.0, -2, 0.5), name="ball"
    )
    scene = free_space(radar)
    rfgen.add_actor(scene, actor, distance=5.9)
    found = rfgen.from_sionna(solve(rt, scene), radar)
    ours = Simulator(None, radar, [actor], rtol=1e-3).paths()
    ratio = channel(found) / channel(ours)
    assert abs(decibels(ratio)).max() < 0.2
    assert np.degrees(abs(np.angle(ratio))).max() < 2.0
    assert found.range.min() == pytest.approx(ours.range.min(), abs=0.015)
    assert found.velocity.mean() == pytest.approx(ours.velocity.mean(), abs=0.005)


def test_it_is_reciprocal(rt):
    """Element by element: Tx and Rx changed over give the same gain."""
    radar = apart(baseline=1.0, position=(0, 0, 1))
    swapped = replace(
        radar, tx_positions=-radar.tx_positions, rx_positions=-radar.rx_positions, orientation=(0.0, 0.0, 0.0)
    )
    actor = MeshActor.from_mesh(ball(0.05, 3), material="skin", position=(6, 1, 1.5), name="ball")
    gains = []
    for each in (radar, swapped):
        scene = free_space(each)
        rfgen.add_actor(scene, actor)
        gains.append(channel(rfgen.from_sionna(solve(rt, scene), each))[0, 0])
    assert abs(gains[1] / gains[0] - 1) < 1e-3


def test_targets_of_different_kinds_stand_in_one_scene_and_may_be_moved_there(rt):
    """Each returns what it returns alone; one that Sionna moves and turns about the vertical is one made there."""
    radar = apart(position=(0, 0, 1), orientation=(0.1, 0, 0))
    made = {
        "board": {"mesh": plate(0.05, 0.04), "material": "wood", "position": (6, 1.0, 1.5), "orientation": (0.2, 0, 0)},
        "ball": {"mesh": ball(0.04, 3), "material": "metal", "position": (5, -1.0, 0.8)},
    }
    actors = {name: MeshActor.from_mesh(**values, name=name) for name, values in made.items()}
    both, moved = free_space(radar), free_space(radar)
    for actor in actors.values():
        rfgen.add_actor(both, actor)
    together = rfgen.from_sionna(solve(rt, both), radar, scene=both)
    target = rfgen.add_actor(moved, replace(actors["board"], position=(3.0, -2.0, 0.5), orientation=(-0.5, 0, 0)))
    target.position, target.orientation = [6, 1.0, 1.5], [0.7, 0, 0]
    alone = rfgen.from_sionna(solve(rt, moved), radar, scene=moved)
    board = together.select(together.object_id == together.object_names.index("board"))
    assert board.num_paths == 1
    np.testing.assert_allclose(channel(alone), channel(board), rtol=2e-3)
    ball_alone = free_space(radar)
    rfgen.add_actor(ball_alone, actors["ball"])
    rest = together.select(together.object_id == together.object_names.index("ball"))
    np.testing.assert_allclose(channel(rfgen.from_sionna(solve(rt, ball_alone), radar)), channel(rest), rtol=1e-5)


def test_a_target_over_a_floor_has_its_ghosts_at_their_images(rt):
    """Directly, by the floor on one way or the other, by the floor on both: each at its delay, level and Doppler."""
    radar = apart(axis=2, position=(0, 0, 1.0))
    velocity = np.array([0.5, 0.0, -1.5])
    actor = MeshActor.from_mesh(ball(0.02, 5), material="metal", position=(4, 0, 0.8), velocity=velocity, name="ball")
    scene = scene_of(radar.center_frequency)
    floor = [[-3, -3, 0], [6, -3, 0], [6, 3, 0], [-3, 3, 0]]
    add_rectangles(scene, floor=(floor, "metal"))
    add_radar(scene, radar)
    rfgen.add_actor(scene, actor)
    found = rfgen.from_sionna(solve(rt, scene, depth=3, refraction=False, samples_per_sp=20_000), radar, scene=scene)
    assert sorted(found.bounces.tolist()) == [1, 2, 2, 3]
    assert {label["object"] for label in found.labels()} == {"ball"}

    centre, down = actor.vertices(0.0).mean(axis=0), np.array([1, 1, -1.0])

    def leg(elements, at, sign):
        return np.linalg.norm(elements * sign - at, axis=-1)

    ways = {}
    for first in (np.ones(3), down):
        for last in (np.ones(3), down):
            lengths, later = (
                leg(radar.tx_world, at, first)[:, None] + leg(radar.rx_world, at, last)[None]
                for at in (centre, centre + 1e-4 * velocity)
            )
            ways[tuple(lengths.ravel())] = (lengths, (later - lengths) / 1e-4, first, last)
    lengths = SPEED_OF_LIGHT * found.tau[..., 0]
    for expected, rate, first, last in ways.values():
        path = int(abs(lengths - expected[..., None]).max(axis=(0, 1)).argmin())
        np.testing.assert_allclose(lengths[..., path], expected, rtol=0, atol=2e-6)
        np.testing.assert_allclose(SPEED_OF_LIGHT * found.tau_rate[..., path, 0], rate, atol=2e-3)
        # The sphere's bistatic cross-section is pi a^2 within physical optics' ripple; the floor is metal.
        one, other = leg(radar.tx_world, centre, first)[:, None], leg(radar.rx_world, centre, last)[None]
        level = radar.wavelength * np.sqrt(np.pi * 0.02**2) / ((4 * np.pi) ** 1.5 * one * other)
        assert abs(decibels(found.a[..., path, 0] / level)).max() < 0.5


def test_the_callables_serve_under_a_name_of_the_registry(rt):
    radar = Radar.load("awr1843", position=(0, 0, 1))
    actor = MeshActor.from_mesh(plate(0.06, 0.04), material="metal", position=(30, 0, 1), name="plate")
    scene = free_space(radar)
    points = rfgen.add_actor(scene, actor).scattering_model.spst
    other = free_space(radar)
    rt.rcs.register_rcs("plate", points.rcs_callables[0])
    rt.rcs.register_cpm("plate", points.cpm_callables[0])
    try:
        model = rt.rcs.ScatteringModel([0, 0, 0], rcs="plate", cpm="plate")
    finally:
        rt.rcs.unregister_rcs("plate")
        rt.rcs.unregister_cpm("plate")
    other.sionna.add(
        rt.rcs.SensingTarget("own", scattering_model=model, length=0.1, width=0.1, height=0.1, position=[30, 0, 1])
    )
    one, two = (channel(rfgen.from_sionna(solve(rt, each), radar)) for each in (scene, other))
    np.testing.assert_allclose(two, one, rtol=1e-4)


def test_sionna_s_own_point_targets_convert(rt):
    """Range, level and velocity of a constant cross-section, and its name."""
    radar = Radar.load("awr1843", position=(0, 0, 1))
    scene = free_space(radar)
    place, velocity = np.array([5.0, 1.0, 1.5]), np.array([3.0, -1.0, 0.5])
    scene.sionna.add(
        rt.rcs.ConstantRCSSensingTarget(name="drone", sigma=0.1, position=place.tolist(), velocity=velocity.tolist())
    )
    paths = solve(rt, scene)
    found = rfgen.from_sionna(paths, radar, scene=scene)
    assert found.labels()[0]["object"] == "drone"
    assert rfgen.from_sionna(paths, radar).labels()[0]["object"] == "sensing target 0"
    to_tx, to_rx = (np.linalg.norm(place - each, axis=1) for each in (radar.tx_world, radar.rx_world))
    lengths = to_tx[:, None] + to_rx[None]
    np.testing.assert_allclose(SPEED_OF_LIGHT * found.tau[..., 0, 0], lengths, rtol=0, atol=1e-9)
    level = radar.wavelength * np.sqrt(0.1) / ((4 * np.pi) ** 1.5 * to_tx[:, None] * to_rx)
    # Sionna's field stays across the wave, and so does ours.
    assert abs(decibels(found.a[..., 0, 0] / level)).max() < 0.05
    radial = velocity @ (place - radar.position) / np.linalg.norm(place - radar.position)
    assert found.velocity[0, 0] == pytest.approx(radial, abs=0.01)


def test_what_cannot_be_a_target_is_refused(rt):
    radar = Radar.load("awr1843", position=(0, 0, 1))
    scene = free_space(radar)
    actor = MeshActor.from_mesh(plate(2.0, 2.0), material="metal", position=(3, 0, 1), name="plate")
    with pytest.raises(ValueError, match=r"distance is -1\.0: give a positive value"):
        rfgen.add_actor(scene, actor, distance=-1.0)
    with pytest.raises(ValueError, match=r"distance is '3': give a positive value"):
        rfgen.add_actor(scene, actor, distance="3")
    with pytest.raises(ValueError, match=r"t is 'a': give a finite time \[s\]"):
        rfgen.add_actor(scene, actor, t="a")
    with pytest.raises(TypeError, match=r"actor is a NoneType: give an rfgen_sionna\.Actor"):
        rfgen.add_actor(scene, None)
    with pytest.raises(TypeError, match=r"scene: NoneType given, a RadarScene or a sionna\.rt\.Scene is needed"):
        rfgen.add_actor(None, actor)
    with pytest.raises(TypeError, match="name is a int: give a text or None"):
        rfgen.add_actor(scene, actor, name=3)
    with pytest.raises(ValueError, match=r"plate: distance 0\.3 m at 79\.11 GHz needs \d+ scattering points"):
        rfgen.add_actor(scene, actor, distance=0.3)
    rfgen.add_actor(scene, actor)
    with pytest.raises(ValueError, match="name is 'plate': the scene has an object of that name"):
        rfgen.add_actor(scene, actor)
