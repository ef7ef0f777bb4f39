"""Sionna's own paths as records of ours: they keep its channel, gain its missing digits, and make samples."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import rfgen_sionna as rfgen
from rfgen_sionna._types import SPEED_OF_LIGHT
from rfgen_sionna.radar import Radar
from rfgen_sionna.records import PathKind
from rfgen_sionna.scene import MeshActor, add_radar, material, radar_alone
from rfgen_sionna.scene.mitsuba_backend import ensure_backend
from rfgen_sionna.signal import synthesize
from rfgen_sionna.simulation import Simulator
from tests.sionna.rectangles import add_rectangles, apart, scene_of, wall


@pytest.fixture(scope="module")
def rt():
    ensure_backend()
    import sionna.rt

    return sionna.rt


def solve(rt, scene, depth=1, **options):
    settings = {"los": False, "refraction": False, "samples_per_src": 50_000, "synthetic_array": False, **options}
    return rt.PathSolver()(scene.sionna, max_depth=depth, **settings)


def image(tx, rx, *planes):
    """(tx, rx) path lengths [m] by way of mirrors (axis, place) met in this order."""
    rx = np.array(rx)
    for axis, place in reversed(planes):
        rx[:, axis] = 2 * place - rx[:, axis]
    return np.linalg.norm(tx[:, None] - rx[None], axis=-1)


def mirror_level(radar, length):
    return radar.wavelength / (4 * np.pi * length)


@pytest.mark.filterwarnings("ignore:.*32-bit floats of Sionna.s solvers")
@pytest.mark.parametrize("centre", [(0.0, 0.0, 0.0), (1500.0, -2300.0, 20.0)])
def test_a_mirror_has_the_image_s_delay_in_double_precision(rt, centre):
    """Wherever the scene is; single precision loses up to 0.1 mm of path in a town."""
    centre = np.array(centre)
    radar = Radar.load("awr1843", position=tuple(centre + np.array([0.25, 0.125, 1.0])))
    scene = scene_of(radar.center_frequency, mirror=(np.array(wall(4.0)) + centre, "metal"))
    add_radar(scene, radar)
    paths = solve(rt, scene)
    found = rfgen.from_sionna(paths, radar)
    lengths = image(radar.tx_world, radar.rx_world, (0, centre[0] + 4.0))
    np.testing.assert_allclose(SPEED_OF_LIGHT * found.tau[:, :, 0, 0], lengths, rtol=0, atol=1e-10)
    # Real metal keeps 1e-3 of the field.
    np.testing.assert_allclose(abs(found.a[:, :, 0, 0]), mirror_level(radar, lengths), rtol=1.2e-3)
    assert (found.num_paths, found.object_names[found.object_id[0]], found.bounces[0]) == (1, "mirror", 1)
    assert found.kind[0] == PathKind.SPECULAR
    assert found.frequency == radar.center_frequency
    np.testing.assert_allclose(found.direction[0, 0], [1, 0, 0], atol=2e-3)


def test_the_channel_is_sionna_s(rt):
    """Before a corner behind a pane, every path of every element pair, direct ones included, and the sum over paths."""
    radar = Radar.load("awr1843", position=(0.0, 0.2, 1.1), orientation=(0.1, 0.2, 0.3))
    floor = [[-1, -3, 0], [3, -3, 0], [3, 3, 0], [-1, 3, 0]]
    scene = scene_of(
        radar.center_frequency,
        wall=(wall(3.0), "concrete"),
        floor=(floor, "wood"),
        pane=(wall(1.5, half=0.8, z=1.0), "glass", 0.006),
    )
    add_radar(scene, radar)
    paths = solve(rt, scene, depth=3, los=True, refraction=True)
    found = rfgen.from_sionna(paths, radar)
    assert (np.diff(found.range[:, 0]) > 0).all()
    real, imaginary = (part.numpy()[0, :, 0].swapaxes(0, 1).astype(float) for part in paths.a)
    valid = paths.valid.numpy()[0, :, 0].swapaxes(0, 1)
    cycles = radar.center_frequency * paths.tau.numpy()[0, :, 0].swapaxes(0, 1).astype(float)
    theirs = ((real + 1j * imaginary) * np.exp(-2j * np.pi * np.mod(cycles, 1)) * valid).sum(axis=-1)
    assert valid.sum() == (found.a != 0).sum()
    assert found.num_paths >= 4
    # The same antennas, each element's own direction to the path's ends.
    gains = found.a[..., 0]
    for elements, ends in (
        (radar.tx_world[:, None, None], found.direction),
        (radar.rx_world[None, :, None], found.arrival),
    ):
        towards = np.asarray(radar.position) + ends[:, 0] * found.range - elements
        towards = np.where((found.bounces == 0)[:, None], ends[:, 0], towards)
        towards = towards / np.linalg.norm(towards, axis=-1, keepdims=True)
        gains = gains * radar.pattern.amplitude(towards @ radar.rotation)
    ours = gains * np.exp(-2j * np.pi * np.mod(radar.center_frequency * found.tau[..., 0], 1))
    echoes = found.bounces > 0
    direct = SPEED_OF_LIGHT * paths.tau.numpy()[0, :, 0].swapaxes(0, 1) < 0.1
    theirs -= ((real + 1j * imaginary) * np.exp(-2j * np.pi * np.mod(cycles, 1)) * (valid & direct)).sum(axis=-1)
    np.testing.assert_allclose(ours[:, :, echoes].sum(axis=-1), theirs, atol=0.01 * abs(theirs).max())
    labels = found.labels()
    assert [label["bounces"] for label in labels].count(0) == 1
    assert labels[0]["object"] == "direct"
    assert {label["object"] for label in labels} == {"direct", "pane", "floor", "wall"}


def test_a_floor_with_something_standing_on_it_reflects_once(rt):
    """Sionna returns the floor's path once more for a surface that comes very near to the floor's plane."""
    radar = Radar.load("awr1843", position=(0, 0, 1), orientation=(0, 1.2, 0))
    floor = [[-2.7, -2.6, 0], [3.3, -2.6, 0], [3.3, 3.4, 0], [-2.7, 3.4, 0]]
    feet = [[0.6, -0.5, 2e-4], [1.2, -0.5, 2e-4], [1.2, 0.1, 7e-4], [0.6, 0.1, 7e-4]]
    scene = scene_of(radar.center_frequency, floor=(floor, "metal"), feet=(feet, "wood"))
    add_radar(scene, radar)
    paths = solve(rt, scene)
    assert paths.valid.numpy().sum() > 12
    found = rfgen.from_sionna(paths, radar)
    assert [found.object_names[index] for index in found.object_id] == ["floor"]
    lengths = image(radar.tx_world, radar.rx_world, (2, 0.0))
    np.testing.assert_allclose(SPEED_OF_LIGHT * found.tau[..., 0, 0], lengths, rtol=0, atol=1e-9)
    np.testing.assert_allclose(abs(found.a[..., 0, 0]), mirror_level(radar, lengths), rtol=2e-3)


def test_a_moving_mirror_peaks_at_its_range_and_velocity(rt):
    radar = Radar.load("awr1843", position=(0, 0, 1))
    scene = scene_of(radar.center_frequency, mirror=(wall(4.0), "metal"))
    velocity = np.array([-1.7, 0.4, 0.2])
    scene.sionna.objects["mirror"].velocity = velocity.tolist()
    add_radar(scene, radar)
    found = rfgen.from_sionna(solve(rt, scene), radar)
    # What a plane does along itself changes nothing.
    lengths = image(radar.tx_world, radar.rx_world, (0, 4.0))
    np.testing.assert_allclose(found.velocity[0, 0], velocity[0], rtol=1e-4)

    samples = synthesize(radar, found, 0.0)[:, 1, 2]
    power = abs(np.fft.fft2(samples, [16 * n for n in samples.shape])) ** 2
    loop, sample = np.unravel_index(power.argmax(), power.shape)
    wave = radar.waveform
    rate, tau = 2 * velocity[0] / SPEED_OF_LIGHT, lengths[1, 2] / SPEED_OF_LIGHT
    middle = 0.5 * wave.num_loops * wave.loop_period
    beat = (wave.slope * (tau + rate * middle) + rate * wave.center_frequency) / wave.sample_rate
    doppler = rate * wave.center_frequency * wave.loop_period
    assert sample / 16 == pytest.approx(beat * samples.shape[1], abs=0.1)
    assert ((loop / 16 - doppler * samples.shape[0] + 64) % 128) - 64 == pytest.approx(0.0, abs=0.15)
    weight = radar.pattern.amplitude(found.direction[0, 0] @ radar.rotation) ** 2
    level = mirror_level(radar, lengths[1, 2]) * weight * np.sqrt(1e-3 * 10 ** (radar.tx_power_dbm / 10))
    assert abs(samples).mean() == pytest.approx(level, rel=0.01)
    # Over the band the level goes with the wavelength.
    half = 0.5 * wave.bandwidth / wave.center_frequency
    assert abs(samples[:, 0]).mean() / abs(samples[:, -1]).mean() == pytest.approx((1 + half) / (1 - half), rel=0.01)


def test_our_tracer_s_samples_of_a_moving_mirror_are_the_same(rt):
    """Range, phase across the array, level and Doppler at once: the share of ours in Sionna's samples is one.

    Ours has the rim of the plate, 18 zones away: each of four edges adds up to 1 / (2 pi 18) of the mirror's field.
    """
    radar = Radar.load("awr1843", position=(0, 0, 1))
    corners, velocity = np.array(wall(2.5, half=1.25)), (-2.0, 0.0, 0.0)
    scene = scene_of(radar.center_frequency, mirror=(corners, "metal"))
    scene.sionna.objects["mirror"].velocity = list(velocity)
    add_radar(scene, radar)
    found = synthesize(radar, rfgen.from_sionna(solve(rt, scene), radar), 0.0)
    mesh = corners, np.array([[0, 1, 2], [0, 2, 3]])
    actor = MeshActor.from_mesh(mesh, material="metal", velocity=velocity, name="mirror")
    ours = synthesize(radar, Simulator(None, radar, [actor], rtol=1e-2).paths(), 0.0)
    share = np.vdot(found, ours) / np.vdot(found, found)
    assert abs(share - 1) < 0.036 + 0.012  # the tolerance
    assert abs(np.vdot(found, ours)) > 0.998 * np.linalg.norm(found) * np.linalg.norm(ours)


def test_a_mirror_behind_a_slab_is_weakened_by_its_transmission_twice(rt):
    """Airy's formula for 12 mm of plasterboard, phase included; the path stays straight, its delay is free space's."""
    radar = apart(position=(0, 0, 1))
    scene = scene_of(radar.center_frequency, mirror=(wall(4.0), "metal"), board=(wall(2.0), "plasterboard", 0.012))
    add_radar(scene, radar)
    found = rfgen.from_sionna(solve(rt, scene, depth=3, refraction=True), radar)
    named = [found.object_names[index] for index in found.object_id]
    assert named == ["board", "mirror"]  # the mirror's path is told by the mirror, not by the pane
    assert found.bounces.tolist() == [1, 3]
    assert found.kind.tolist() == [PathKind.SPECULAR] * 2
    lengths = image(radar.tx_world, radar.rx_world, (0, 4.0))
    np.testing.assert_allclose(SPEED_OF_LIGHT * found.tau[..., 1, 0], lengths, rtol=0, atol=1e-9)

    wavenumber = 2 * np.pi / radar.wavelength
    sine = radar.tx_world[:, None, 1] - radar.rx_world[None, :, 1]
    sine = np.hypot(sine, radar.tx_world[:, None, 2] - radar.rx_world[None, :, 2]) / lengths
    eps = complex(material("plasterboard").relative_permittivity(radar.center_frequency))
    inner, cosine = np.sqrt(eps - sine**2), np.sqrt(1 - sine**2)
    r = (cosine - inner) / (cosine + inner)
    once = np.exp(-1j * wavenumber * 0.012 * inner)
    transmitted, reflected = (1 - r**2) * once / (1 - (r * once) ** 2), r * (1 - once**2) / (1 - (r * once) ** 2)
    ratio = found.a[..., 1, 0] / (-mirror_level(radar, lengths) * transmitted**2)
    np.testing.assert_allclose(abs(ratio), 1.0, atol=0.003)
    assert np.degrees(abs(np.angle(ratio))).max() < 1.0
    near = image(radar.tx_world, radar.rx_world, (0, 2.0))
    ratio = found.a[..., 0, 0] / (mirror_level(radar, near) * reflected)
    np.testing.assert_allclose(abs(ratio), 1.0, atol=0.003)
    assert np.degrees(abs(np.angle(ratio))).max() < 1.0


def test_a_corner_gives_its_double_bounce_at_the_image_in_both_planes(rt):
    """Floor and wall of metal; Tx and Rx 10 cm apart, as Sionna drops stretches of less than 1 cm."""
    radar = apart(axis=2, position=(0, 0, 1.0), orientation=(0, 0.3, 0))
    floor = [[-1, -3, 0], [3, -3, 0], [3, 3, 0], [-1, 3, 0]]
    scene = scene_of(radar.center_frequency, wall=(wall(3.0), "metal"), floor=(floor, "metal"))
    add_radar(scene, radar)
    found = rfgen.from_sionna(solve(rt, scene, depth=2), radar)
    assert found.bounces.tolist() == [1, 1, 2]
    assert found.kind.tolist() == [PathKind.SPECULAR, PathKind.SPECULAR, PathKind.MULTI_BOUNCE]
    assert [found.object_names[index] for index in found.object_id] == ["floor", "wall", "wall"]
    for path, planes in enumerate([[(2, 0.0)], [(0, 3.0)], [(0, 3.0), (2, 0.0)]]):
        lengths = image(radar.tx_world, radar.rx_world, *planes)
        np.testing.assert_allclose(SPEED_OF_LIGHT * found.tau[:, :, path, 0], lengths, rtol=0, atol=1e-9)
    # Upright field on upright wall: what the floor turns round in the field, the direction has turned as well.
    np.testing.assert_allclose(abs(found.a[:, :, 2, 0]), mirror_level(radar, lengths), rtol=0.01)


def test_gains_are_those_of_unit_elements(rt):
    """Whatever antennas the solver was called with."""
    gains = []
    for pattern in ({"kind": "sionna:iso"}, {"kind": "sionna:tr38901"}):
        radar = Radar.load("awr1843", position=(0, 0, 1), orientation=(0.5, 0, 0), overrides={"pattern": pattern})
        scene = scene_of(radar.center_frequency, mirror=(wall(4.0), "concrete"))
        add_radar(scene, radar)
        gains.append(rfgen.from_sionna(solve(rt, scene), radar).a)
    np.testing.assert_allclose(gains[1], gains[0], rtol=1e-4)


def test_diffuse_paths_keep_their_power(rt):
    radar = apart(position=(0, 0, 1))
    scene = scene_of(radar.center_frequency, rough=(wall(3.0), "concrete"))
    scene.sionna.objects["rough"].radio_material.scattering_coefficient = 0.5
    add_radar(scene, radar)
    paths = solve(rt, scene, specular_reflection=False, diffuse_reflection=True, samples_per_src=20_000)
    found = rfgen.from_sionna(paths, radar)
    assert set(found.kind) == {PathKind.DIFFUSE}
    # Followed from one Tx element to the next, most of them.
    assert found.num_paths < 1.6 * paths.valid.shape[-1]
    assert (found.a != 0).sum() == paths.valid.numpy().sum()
    antennas = radar.pattern.amplitude(found.direction[:, 0]) * radar.pattern.amplitude(found.arrival[:, 0])
    power = (abs(found.a[..., 0] * antennas) ** 2).sum(axis=-1)
    theirs = sum(part.numpy()[0, :, 0].swapaxes(0, 1).astype(float) ** 2 for part in paths.a).sum(axis=-1)
    np.testing.assert_allclose(power, theirs, rtol=0.05)


def test_what_was_found_of_nothing_is_no_path(rt):
    radar = Radar.load("awr1843", position=(0, 0, 1), look_at=(-3, 0, 1))
    scene = scene_of(radar.center_frequency, mirror=(wall(4.0, y=50.0), "metal"))
    add_radar(scene, radar)
    for depth in (0, 1):
        found = rfgen.from_sionna(solve(rt, scene, depth=depth), radar)
        assert found.num_paths == 0
        assert not synthesize(radar, found, 0.0).any()


def test_surfaces_that_moved_since_don_t_spoil_the_delay(rt):
    radar = Radar.load("awr1843", position=(0, 0, 1))
    scene = scene_of(radar.center_frequency, mirror=(wall(4.0), "metal"))
    add_radar(scene, radar)
    paths = solve(rt, scene)
    scene.sionna.objects["mirror"].position = [3.9, 0, 1]
    lengths = image(radar.tx_world, radar.rx_world, (0, 4.0))
    np.testing.assert_allclose(SPEED_OF_LIGHT * rfgen.from_sionna(paths, radar).tau[:, :, 0, 0], lengths, atol=3e-6)


def test_several_radars_each_have_their_own_paths(rt):
    radars = [Radar.load("awr1843", position=(x, 0.1, 1.0)) for x in (-0.2, 0.3)]
    scene = scene_of(radars[0].center_frequency, mirror=(wall(4.0), "metal"))
    for number, radar in enumerate(radars):
        add_radar(scene, radar, f"radar{number}")
    paths = solve(rt, scene)
    for radar in radars:
        found = rfgen.from_sionna(paths, radar, time=0.25)
        lengths = image(radar.tx_world, radar.rx_world, (0, 4.0))
        np.testing.assert_allclose(SPEED_OF_LIGHT * found.tau[:, :, 0, 0], lengths, rtol=0, atol=1e-10)
        assert found.times.tolist() == [0.25]
    with pytest.raises(ValueError, match=r"none of the 2 transmitters of these paths has the radar's 3 element"):
        rfgen.from_sionna(paths, radars[0].placed(position=(0, 0, 0.5)))


def test_what_are_no_paths_of_a_radar_is_refused(rt):
    radar = Radar.load("awr1843", position=(0, 0, 1))
    scene = scene_of(radar.center_frequency, mirror=(wall(4.0), "metal"))
    add_radar(scene, radar)
    paths = solve(rt, scene)
    with pytest.raises(TypeError, match=r"paths is a tuple: give the sionna\.rt\.Paths of a solver"):
        rfgen.from_sionna(paths.cir(out_type="numpy"), radar)
    with pytest.raises(TypeError, match=r"radar is a NoneType: give the rfgen_sionna\.Radar"):
        rfgen.from_sionna(paths, None)
    with pytest.raises(TypeError, match=r"scene: int given, a RadarScene or a sionna"):
        rfgen.from_sionna(paths, radar, scene=3)
    for time in ("x", np.nan, None):
        with pytest.raises(ValueError, match=rf"time is {time!r}: give a finite time \[s\]"):
            rfgen.from_sionna(paths, radar, time=time)
    with pytest.raises(TypeError, match="scene: NoneType given"):
        add_radar(None, radar)
    with pytest.raises(TypeError, match="radar: str given"):
        add_radar(scene, "awr1843")
    with pytest.raises(TypeError, match="radar: NoneType given"), radar_alone(scene, None):
        pass
    with pytest.raises(ValueError, match="synthetic_array is True"):
        rfgen.from_sionna(solve(rt, scene, synthetic_array=True), radar)
    scene.sionna.frequency = 60e9
    with pytest.raises(ValueError, match=r"paths are for 60 GHz; radar 'awr1843' samples 7"):
        rfgen.from_sionna(solve(rt, scene), radar)
    scene.sionna.frequency = radar.center_frequency
    two = replace(radar, tx_positions=radar.tx_positions + np.array([0, 0, 1e-4]))
    with pytest.raises(ValueError, match="none of the 1 transmitters"):
        rfgen.from_sionna(paths, two)
    dual = rt.load_scene()
    dual.frequency = radar.center_frequency
    dual.tx_array = dual.rx_array = rt.PlanarArray(num_rows=1, num_cols=1, pattern="iso", polarization="VH")
    dual.add(rt.Transmitter("t", position=[0, 0, 1]))
    dual.add(rt.Receiver("r", position=[0, 0.1, 1]))
    add_rectangles_to(dual)
    with pytest.raises(ValueError, match="tx_array has 2 polarisations per element"):
        rfgen.from_sionna(rt.PathSolver()(dual, max_depth=1, synthetic_array=False), radar)


def add_rectangles_to(scene):
    from rfgen_sionna.scene.scene import RadarScene

    add_rectangles(RadarScene("own", scene=scene), mirror=(wall(4.0), "metal"))
