"""A radar of ours as Sionna's antennas: PathSolver finds the paths, signs and levels that our own tracer finds."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rfgen_sionna._types import SPEED_OF_LIGHT
from rfgen_sionna.radar import Radar
from rfgen_sionna.scene import add_radar, load_scene, radar_alone, tabulated
from rfgen_sionna.scene.mitsuba_backend import ensure_backend
from rfgen_sionna.simulation import Simulator

HEIGHT = 3.0
POSE = {"position": (0.02, -0.03, HEIGHT), "orientation": (0.4, np.pi / 2 - 0.05, 0.3)}


@pytest.fixture(scope="module")
def rt():
    ensure_backend()
    import sionna.rt

    return sionna.rt


def solve(rt, scene, depth=1):
    return rt.PathSolver()(
        scene.sionna, max_depth=depth, samples_per_src=100_000, synthetic_array=False, los=False, refraction=False
    )


def gains(paths, rx=0, tx=0):
    """(tx, rx, path) complex gains and delays [s] of one pair of devices."""
    real, imaginary = (part.numpy().astype(np.float64) for part in paths.a)
    tau = paths.tau.numpy().astype(np.float64)
    return (real + 1j * imaginary)[rx, :, tx].swapaxes(0, 1), tau[rx, :, tx].swapaxes(0, 1)


def image_lengths(radar):
    """(tx, rx) lengths [m] of the paths by way of the mirror at z = 0."""
    mirrored = radar.rx_world * [1, 1, -1]
    return np.linalg.norm(radar.tx_world[:, None] - mirrored[None], axis=-1)


@pytest.mark.parametrize("name", ["awr1843", "position2go"])
def test_a_mirror_gives_our_delays_and_our_level(rt, name):
    """Delays below 1 um of path in every element pair, although the radar is turned about all its axes.

    Our tracer integrates over the plate, whose rim adds its ripple: an edge at d contributes of the order of
    sqrt(wavelength R / 2) / (2 pi d), 1.4 % of the amplitude at 77 GHz and 2.5 % at 24 GHz from each of four edges.
    """
    scene = load_scene("simple_reflector")
    radar = Radar.load(name, **POSE)
    simulation = Simulator(scene, radar, rtol=1e-3)  # tunes the scene
    add_radar(scene, radar)
    a, tau = gains(solve(rt, scene))
    assert a.shape == (len(radar.tx_names), len(radar.rx_names), 1)
    np.testing.assert_allclose(SPEED_OF_LIGHT * tau[..., 0], image_lengths(radar), atol=1e-6)

    ours = simulation.paths()
    # Theirs have the element patterns in them.
    towards = ours.direction[:, 0] @ radar.rotation
    weight = radar.pattern.amplitude(towards) ** 2
    turn = np.exp(-2j * np.pi * np.mod(ours.frequency * ours.tau[..., 0], 1.0))
    sum_of_ours = (ours.a[..., 0] * weight * turn).sum(axis=-1)
    theirs = a[..., 0] * np.exp(-2j * np.pi * np.mod(ours.frequency * tau[..., 0], 1.0))
    ratio = sum_of_ours / theirs
    assert abs(20 * np.log10(np.abs(ratio))).max() < 1.0
    assert np.degrees(np.abs(np.angle(ratio))).max() < 6.0
    # Their frequency is the scene's, in single precision: equal to ours to 1e-8 of 2,000 cycles.
    assert float(scene.sionna.frequency[0]) == pytest.approx(radar.center_frequency, rel=1e-7)


def test_elements_stay_in_metres_when_the_frequency_changes(rt):
    scene = load_scene("simple_reflector")
    radar = Radar.load("awr1843", **POSE)
    scene.tune(radar.center_frequency)
    transmitter, receiver = add_radar(scene, radar)
    lengths = []
    for frequency in (radar.center_frequency, 76e9, 80e9):
        scene.tune(frequency)
        lengths.append(SPEED_OF_LIGHT * gains(solve(rt, scene))[1])
    for length in lengths:
        np.testing.assert_allclose(length[..., 0], image_lengths(radar), atol=1e-6)
    for array, positions in ((scene.sionna.tx_array, radar.tx_positions), (scene.sionna.rx_array, radar.rx_positions)):
        assert array.num_ant == len(positions)
        ours = positions / radar.wavelength
        np.testing.assert_allclose(np.array(array.normalized_positions).T, ours, atol=1e-6)
    assert (transmitter.radar, receiver.radar) == (radar, radar)
    assert float(transmitter.power_dbm[0]) == pytest.approx(radar.tx_power_dbm)


@pytest.mark.parametrize(
    ("tx", "rx", "expected"),
    [
        ("V", "V", -1),
        ("H", "H", -1),
        ("V", "H", 0),
        ("+45", "V", -(0.5**0.5)),
        ("+45", "-45", 0),
        ("-45", "H", 0.5**0.5),
    ],
)
def test_polarisations_agree(rt, tx, rx, expected):
    """Head on a metal mirror keeps the field and turns its sign; one common phase, ours, for every pair of ends."""
    scene = load_scene("simple_reflector")
    radar = replace(
        Radar.load("awr1843", position=(0, 0, HEIGHT), orientation=(0.0, np.pi / 2, 0.0)),
        tx_polarization=tx,
        rx_polarization=rx,
    )
    simulation = Simulator(scene, radar, rtol=1e-3)
    add_radar(scene, radar)
    a, _ = gains(solve(rt, scene))
    level = radar.wavelength / (4 * np.pi * 2 * HEIGHT) * 10 ** (radar.pattern.gain_db(np.array([1.0, 0, 0])) / 10)
    np.testing.assert_allclose(a[..., 0] / level, expected, atol=0.02)
    ours = simulation.paths()
    total = (ours.a[0, 0, :, 0] * np.exp(-2j * np.pi * np.mod(ours.frequency * (ours.tau[0, 0, :, 0]), 1.0))).sum()
    mirror = np.exp(-2j * np.pi * np.mod(ours.frequency * image_lengths(radar)[0, 0] / SPEED_OF_LIGHT, 1.0))
    normalised = total / mirror / (radar.wavelength / (4 * np.pi * 2 * HEIGHT))
    assert abs(normalised - expected) < 0.08  # the rim


def test_element_patterns_are_those_of_the_radar(rt):
    """In directions all around, sides told apart; Dr.Jit's table is linear between half degrees."""
    import mitsuba as mi

    from rfgen_sionna.scene.sionna_array import ElementAntenna

    cuts = {
        "peak_gain_dbi": 9.0,
        "azimuth_deg": [-180, -60, 0, 40, 180],
        "azimuth_db": [-25, -9, 0, -3, -20],
        "elevation_deg": [-90, -30, 0, 10, 90],
        "elevation_db": [-20, -5, 0, -2, -25],
    }
    radar = Radar.load("awr1843", overrides={"pattern": cuts})
    directions = np.random.default_rng(1).normal(size=(2000, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    theta, phi = np.arccos(directions[:, 2]), np.arctan2(directions[:, 1], directions[:, 0])
    field = ElementAntenna(radar, "tx")[0](mi.Float(theta), mi.Float(phi))
    amplitude = np.sqrt(sum(np.abs(np.asarray(part.numpy())) ** 2 for part in field))
    np.testing.assert_allclose(amplitude, radar.pattern.amplitude(directions), rtol=2e-3)


@pytest.mark.parametrize(("name", "peak"), [("tr38901", 8.0), ("iso", 0.0), ("dipole", 1.761), ("hw_dipole", 2.156)])
def test_a_pattern_of_the_registry(rt, name, peak):
    """Table 7.3-1 of TR 38.901 by hand; the others by their known gains."""
    radar = tabulated(Radar.load("awr1843", overrides={"pattern": {"kind": f"sionna:{name}"}}))
    assert radar.pattern.peak_gain_dbi == pytest.approx(peak, abs=2e-3)
    assert tabulated(radar) is radar
    assert Radar.from_dict(radar.to_dict()).pattern.name == f"sionna:{name}"
    if name == "tr38901":
        rng = np.random.default_rng(2)
        azimuth, elevation = rng.uniform(-180, 180, 500), rng.uniform(-90, 90, 500)
        a, e = np.radians(azimuth), np.radians(elevation)
        towards = np.stack([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)], axis=-1)
        cut = np.minimum(12 * (azimuth / 65) ** 2, 30) + np.minimum(12 * (elevation / 65) ** 2, 30)
        np.testing.assert_allclose(radar.pattern.gain_db(towards), 8 - np.minimum(cut, 30), atol=0.6)
        smooth = cut < 28  # the table rounds the corner where the law stops falling
        np.testing.assert_allclose(radar.pattern.gain_db(towards)[smooth], 8 - cut[smooth], atol=0.01)


def test_names_are_looked_up_where_they_are_needed(rt):
    radar = Radar.load("awr1843", overrides={"pattern": {"kind": "sionna:tr38901"}}, position=(0, 0, 1))
    assert Simulator(None, radar, rtol=1e-3).radar.pattern == tabulated(radar).pattern
    unknown = Radar.load("awr1843", overrides={"pattern": {"kind": "sionna:horn"}})
    with pytest.raises(ValueError, match=r"'sionna:horn' is not in Sionna's registry; it has sionna:iso"):
        Simulator(None, unknown)
    rt.register_antenna_pattern(
        "horn", lambda polarization: rt.antenna_pattern.create_factory("hw_dipole")(polarization=polarization)
    )
    try:
        assert tabulated(unknown).pattern.peak_gain_dbi == pytest.approx(2.156, abs=2e-3)
    finally:
        rt.antenna_pattern.antenna_pattern_registry.unregister("horn")


def test_several_radars_of_one_kind_stand_in_a_scene(rt):
    """Each with its own pose; the paths from one to the other are there as well."""
    scene = load_scene("simple_reflector")
    radars = [Radar.load("awr1843", position=(x, 0.1, z), look_at=(0, 0, 0)) for x, z in ((-0.2, 2.0), (0.3, 3.0))]
    scene.tune(radars[0].center_frequency)
    for number, radar in enumerate(radars):
        add_radar(scene, radar, f"radar{number}")
    assert list(scene.sionna.transmitters) == ["radar0_tx", "radar1_tx"]
    paths = solve(rt, scene)
    for tx, sender in enumerate(radars):
        for rx, listener in enumerate(radars):
            _, tau = gains(paths, rx, tx)
            mirrored = listener.rx_world * [1, 1, -1]
            lengths = np.linalg.norm(sender.tx_world[:, None] - mirrored[None], axis=-1)
            np.testing.assert_allclose(SPEED_OF_LIGHT * tau[..., 0], lengths, atol=1e-6)


def test_radars_of_different_kinds_take_turns_in_a_scene(rt):
    """77 and 24 GHz, each with its own pose, elements, pattern and frequency; what stood there before stands again."""
    scene = load_scene("simple_reflector")
    left = Radar.load("awr1843", position=(-0.2, 0.1, 2.0), look_at=(0, 0, 0))
    scene.tune(left.center_frequency)
    add_radar(scene, left, "left")
    alone = gains(solve(rt, scene))
    arrays = scene.sionna.tx_array, scene.sionna.rx_array
    for radar in (Radar.load("position2go", **POSE), Radar.load("mmwcas", position=(0.1, 0.0, 1.5), look_at=(0, 0, 0))):
        with radar_alone(scene, radar, "other") as (transmitter, receiver):
            assert list(scene.sionna.transmitters) == ["other_tx"]
            assert list(scene.sionna.receivers) == ["other_rx"]
            assert (transmitter.radar, receiver.radar) == (radar, radar)
            assert float(scene.sionna.frequency[0]) == pytest.approx(radar.center_frequency, rel=1e-7)
            a, tau = gains(solve(rt, scene))
        assert a.shape == (len(radar.tx_names), len(radar.rx_names), 1)
        np.testing.assert_allclose(SPEED_OF_LIGHT * tau[..., 0], image_lengths(radar), atol=1e-6)
        own = load_scene("simple_reflector")
        own.tune(radar.center_frequency)
        add_radar(own, radar)
        np.testing.assert_allclose(a, gains(solve(rt, own))[0], rtol=1e-5)
    with pytest.raises(RuntimeError, match="solver"), radar_alone(scene, radar):  # an error leaves no trace either
        raise RuntimeError("solver")
    assert list(scene.sionna.transmitters) == ["left_tx"]
    assert list(scene.sionna.receivers) == ["left_rx"]
    assert (scene.sionna.tx_array, scene.sionna.rx_array) == arrays
    for found, wanted in zip(gains(solve(rt, scene)), alone, strict=True):
        np.testing.assert_allclose(found, wanted, rtol=1e-6)


def test_simulators_of_different_radars_share_a_scene():
    """At 77 and 24 GHz in turns: to the bit what each gives in a scene of its own, although both tune the materials."""
    kinds = ("awr1843", "position2go")
    radars = [Radar.load(name, **POSE | {"position": (0.1 * n, 0.0, HEIGHT)}) for n, name in enumerate(kinds)]
    alone = [Simulator(load_scene("simple_reflector"), radar, rtol=1e-3) for radar in radars]
    wanted = [simulation.adc(0.05, seed=3).data for simulation in alone]
    scene = load_scene("simple_reflector")
    together = [Simulator(scene, radar, rtol=1e-3) for radar in radars]
    runs = [simulation.frames(0.05, seed=3) for simulation in together]
    for number in (1, 0):
        np.testing.assert_array_equal(next(runs[number]).samples.astype(np.complex64), wanted[number][0])


def test_what_sionna_cannot_hold_is_refused(rt):
    scene = load_scene("simple_reflector")
    add_radar(scene, Radar.load("position2go", position=(0, 0, 2)), "left")
    with pytest.raises(ValueError, match=r"'left': the scene has a device 'left_tx' already"):
        add_radar(scene, Radar.load("position2go", position=(0, 0, 3)), "left")
    with pytest.raises(ValueError, match=r"'position2go_v11': the scene's rx_array serves the devices left_rx"):
        add_radar(scene, Radar.load("position2go_v11", position=(0, 0, 3)), "right")
    assert list(scene.sionna.transmitters) == ["left_tx"]
    # A Sionna scene of the user's own, whose arrays nobody uses yet, takes the radar's.
    own = rt.load_scene(rt.scene.simple_reflector)
    own.tx_array = own.rx_array = rt.PlanarArray(num_rows=1, num_cols=1, pattern="iso", polarization="V")
    add_radar(own, Radar.load("awr1843"))
    assert own.tx_array.num_ant == 3
