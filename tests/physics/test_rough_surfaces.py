"""Rough surfaces: Sionna's split of the energy, its patterns, and phases that stay with the surface."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from rfgen_sionna.radar import Radar
from rfgen_sionna.records import knot_weights
from rfgen_sionna.scene import MeshActor
from rfgen_sionna.scene.materials import MATERIALS
from rfgen_sionna.scene.scattering import ScatteringPattern
from rfgen_sionna.scene.scene_errors import MaterialError
from rfgen_sionna.simulation import Simulator
from rfgen_sionna.tracing.gains.diffuse import diffuse_gains
from rfgen_sionna.tracing.surface.facets import Facets

PATTERNS = [
    ScatteringPattern(),
    ScatteringPattern("directive", alpha_r=4),
    ScatteringPattern("backscattering", alpha_r=3, alpha_i=7, lambda_=0.4),
]
UP = np.array([0.0, 0.0, 1.0])


def radar():
    return Radar.load("awr1843", overrides={"pattern": {"kind": "sionna:iso"}})


def plate(material, distance=2.0, tilt=0.0, size=0.3):
    mesh = trimesh.creation.box((1e-3, size, size))
    return MeshActor.from_mesh(
        mesh, material=material, position=(distance, 0, 0), orientation=(tilt, 0, 0), name="plate"
    )


def channel(paths):
    gains = paths.a[0, 0, :, 0]
    return complex((gains * np.exp(-2j * np.pi * np.mod(paths.frequency * paths.tau[0, 0, :, 0], 1.0))).sum())


@pytest.mark.parametrize("pattern", PATTERNS, ids=lambda pattern: pattern.kind)
@pytest.mark.parametrize("theta", [0.0, 0.5, 1.2])
def test_a_pattern_spreads_all_of_the_energy_and_no_more(pattern, theta):
    """Over the hemisphere it integrates to 1, from wherever the wave comes."""
    node, weight = np.polynomial.legendre.leggauss(80)
    cos, phi = 0.5 * (node + 1.0), np.arange(160) * (2 * np.pi / 160)
    sin = np.sqrt(1 - cos**2)
    out = np.stack([np.outer(sin, np.cos(phi)), np.outer(sin, np.sin(phi)), np.outer(cos, np.ones(160))], axis=-1)
    k_in = np.broadcast_to([np.sin(theta), 0.0, -np.cos(theta)], out.shape)
    values = pattern(k_in, out, np.broadcast_to(UP, out.shape))
    assert (values >= 0).all()
    total = (0.5 * weight[:, None] * values).sum() * (2 * np.pi / 160)
    assert total == pytest.approx(1.0, abs=1e-6)


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2), st.floats(0.0, 1.5), st.floats(0.0, 1.5), st.floats(0.0, 6.28))
def test_patterns_are_those_of_sionna(which, theta_in, theta_out, phi):
    from rfgen_sionna.scene.mitsuba_backend import ensure_backend

    ensure_backend()
    import mitsuba as mi
    from sionna.rt import BackscatteringPattern, DirectivePattern, LambertianPattern

    theirs = [LambertianPattern(), DirectivePattern(4), BackscatteringPattern(3, 7, 0.4)][which]
    k_in = np.array([np.sin(theta_in), 0.0, -np.cos(theta_in)])
    k_out = np.array([np.sin(theta_out) * np.cos(phi), np.sin(theta_out) * np.sin(phi), np.cos(theta_out)])
    truth = theirs(mi.Vector3f(*k_in.tolist()), mi.Vector3f(*k_out.tolist()))
    ours = ScatteringPattern.from_sionna(theirs)(k_in, k_out, UP)
    assert float(ours) == pytest.approx(float(np.ravel(truth.numpy())[0]), rel=1e-4, abs=1e-7)


@pytest.mark.parametrize("s", [pytest.param(0.3, marks=pytest.mark.slow), 0.8])
def test_coherent_part_of_a_mirror_loses_what_is_scattered(s):
    """|a|^2 of the coherent part is 1 - S^2 of the smooth plate's: the mean over many seeds leaves it."""
    smooth = channel(Simulator(None, radar(), [plate("metal", size=0.2)], rtol=1e-3).paths())
    rough = replace(MATERIALS["metal"], scattering_coefficient=s)
    found = [
        channel(Simulator(None, radar(), [plate(rough, size=0.2)], rtol=1e-3, seed=seed).paths()) for seed in range(40)
    ]
    # The diffuse part is 4 S^2 A / (pi R^2) of the mirror's power: in the mean of 40 up to 1.4 % of its field are left.
    assert abs(np.mean(found) / smooth) ** 2 == pytest.approx(1 - s**2, abs=0.036)


def test_diffuse_level_is_the_lambertian_one():
    """A plate seen aslant, whose mirror points elsewhere: mean power (lambda/4 pi)^2 S^2 cos^2 A / (pi R^4)."""
    tilt, distance, size = 0.7, 2.0, 0.3
    rough = replace(MATERIALS["pec"] if "pec" in MATERIALS else MATERIALS["metal"], scattering_coefficient=1.0)
    simulator = radar()
    powers = [
        abs(channel(Simulator(None, simulator, [plate(rough, distance, tilt, size)], rtol=1e-2, seed=seed).paths()))
        ** 2
        for seed in range(100)
    ]
    expected = (simulator.wavelength / (4 * np.pi)) ** 2 * np.cos(tilt) ** 2 * size**2 / (np.pi * distance**4)
    # The power of many random phases is exponentially distributed: the mean of 100 is right to 10 %, three sigma 30 %.
    assert np.mean(powers) / expected == pytest.approx(1.0, abs=0.3)


@pytest.mark.slow
@pytest.mark.parametrize("polarization", ["V", "H"])
def test_diffuse_level_is_that_of_the_polarisation(polarization):
    """A concrete plate turned by 1 rad about the vertical, near Brewster's angle: what a wave with the field across the
    plane of incidence, or in it, would have reflected. The two are 10 dB apart."""
    tilt, distance, size = 1.0, 2.0, 0.3
    rough = replace(MATERIALS["concrete"], scattering_coefficient=1.0)
    visible = replace(radar(), tx_polarization=polarization, rx_polarization=polarization)
    found = [
        abs(channel(Simulator(None, visible, [plate(rough, distance, tilt, size)], rtol=1e-3, seed=seed).paths())) ** 2
        for seed in range(200)
    ]
    eps, cos = complex(rough.relative_permittivity(visible.center_frequency)), np.cos(tilt)
    root = np.sqrt(eps - np.sin(tilt) ** 2)
    r = (cos - root) / (cos + root) if polarization == "V" else (eps * cos - root) / (eps * cos + root)
    level = (visible.wavelength / (4 * np.pi)) ** 2 * abs(r) ** 2 * cos**2 * size**2 / (np.pi * distance**4)
    assert np.mean(found) / level == pytest.approx(1.0, abs=0.25)


@pytest.mark.parametrize(("s", "xpd", "fields"), [(1.0, 0.0, "VV"), (0.5, 0.4, "VH"), (0.8, 0.4, "VH")])
def test_errors_are_relative_to_what_is_scattered_as_well(s, xpd, fields, caplog):
    """A flat concrete square aslant, of which next to nothing comes back coherently: rounding was stated as an error of
    several times the return, with a warning."""
    rough = replace(MATERIALS["concrete"], scattering_coefficient=s, xpd_coefficient=xpd)
    square = trimesh.Trimesh(
        0.25 * np.array([[0, -1, -1], [0, 1, -1], [0, 1, 1], [0, -1, 1]]), [[0, 2, 1], [0, 3, 2]], process=False
    )
    actor = MeshActor.from_mesh(square, material=rough, position=(1.5, 0, 0), orientation=(0.7, 0, 0))
    of = replace(radar(), tx_polarization=fields[0], rx_polarization=fields[1])
    found = []
    for rtol in (1e-2, 1e-3):
        simulator = Simulator(None, of, [actor], rtol=rtol)
        found.append(channel(simulator.paths()))
        assert simulator.tracer.trace(0.0, 0.0).report.error < 3 * rtol
    assert abs(found[0] - found[1]) < 2e-2 * abs(found[1])
    assert "right to" not in caplog.text or s == 0.5  # 0.0015 of itself


def test_speckle_goes_on_where_facets_are_chosen_anew():
    """A concrete box that comes nearer and gets ever finer facets: at the end of each stretch and at the beginning of
    the next, and with a tenth of the tolerance, it returns the same. Where each facet had a phase of its own that was
    off by 9 to 84 %."""
    rough, box = replace(MATERIALS["concrete"], scattering_coefficient=0.9), trimesh.creation.box((0.2, 0.5, 0.5))
    actor = MeshActor.from_mesh(
        box, material=rough, position=(2, 0, 0), velocity=(-1.5, 0.3, 0), orientation=(0.5, 0.2, 0), name="box"
    )
    tracer, fine = (Simulator(None, radar(), [actor], seed=1, rtol=rtol).tracer for rtol in (1e-2, 1e-3))

    def at(interval, t):
        paths = interval.moving
        weights = knot_weights(paths.times, np.array([t]))
        turns = np.mod(paths.frequency * (paths.tau @ weights.T), 1.0)
        return ((paths.a @ weights.T) * np.exp(-2j * np.pi * turns)).sum(axis=(2, 3))

    counts = set()
    for t in (0.1, 0.2, 0.3, 0.4):
        before, after = tracer.trace(t - 0.05, t), tracer.trace(t, t + 0.05)
        counts.add(after.moving.num_paths)
        size = np.abs(at(before, t)).max()
        assert np.abs(at(after, t) - at(before, t)).max() < 2e-2 * size
        assert np.abs(at(fine.trace(t, t + 0.05), t) - at(after, t)).max() < 0.06 * size
    assert len(counts) > 2


def test_phases_stay_with_the_facets():
    """Same seed, same return to the bit, another one with another seed; a plate that moves keeps its speckle."""
    rough = replace(MATERIALS["concrete"], scattering_coefficient=0.5)
    one, same, other = (Simulator(None, radar(), [plate(rough, tilt=0.6)], rtol=1e-3, seed=seed) for seed in (3, 3, 4))
    np.testing.assert_array_equal(one.paths().a, same.paths().a)
    assert abs(channel(one.paths()) / channel(other.paths()) - 1) > 0.05
    moving = MeshActor.from_mesh(
        trimesh.creation.box((1e-3, 0.3, 0.3)), material=rough, position=(2, 0, 0), orientation=(0.6, 0, 0),
        velocity=(1.0, 0, 0), name="plate",
    )  # fmt: skip
    simulator = Simulator(None, radar(), [moving], rtol=1e-3, seed=3)
    traced = simulator.tracer.trace(0.0, 0.02).moving
    gains = traced.a[0, 0]
    # Two centimetres nearer: gains of rough facets change by the spreading, 2 %, and a little by the angle.
    assert np.median(np.abs(gains[:, -1] / gains[:, 0] - 1)) < 0.1


def test_patterns_that_are_none():
    for wrong in ({"kind": "shiny"}, {"alpha_r": 0}, {"alpha_i": 2.5}, {"lambda_": 1.2}):
        with pytest.raises(MaterialError, match=next(iter(wrong))):
            ScatteringPattern(**wrong)
    with pytest.raises(MaterialError, match="xpd_coefficient"):
        replace(MATERIALS["concrete"], xpd_coefficient=2.0)


@pytest.mark.parametrize("baseline", [*(pytest.param(b, marks=pytest.mark.slow) for b in (0.05, 1.0)), 3.0])
def test_elements_far_apart_see_each_their_own_side_of_a_rough_plate(baseline):
    """Metal, all of whose energy is scattered after Lambert: against the integral of cos(theta_i) cos(theta_s) / pi
    over the square of both distances, from the elements' own places."""
    one = radar()
    there = {"tx_positions": np.array([[0, baseline / 2, 0]]), "rx_positions": np.array([[0, -baseline / 2, 0]])}
    apart = replace(one, **there, tx_names=("T",), rx_names=("R",), waveform=replace(one.waveform, tx_order=(0,)))
    rough = replace(MATERIALS["metal"], scattering_coefficient=1.0)
    mesh = trimesh.creation.box((1e-3, 0.3, 0.3)).subdivide_to_size(0.03)
    actor = MeshActor.from_mesh(mesh, material=rough, position=(2, 0, 0), orientation=(0.4, 0, 0), name="plate")
    found = (np.abs(Simulator(None, apart, [actor], rtol=1e-2).paths().a[0, 0, :, 0]) ** 2).sum()
    step = (np.arange(200) + 0.5) / 200 - 0.5
    y, z = (0.3 * each.ravel() for each in np.meshgrid(step, step))
    turn = np.array([[np.cos(0.4), -np.sin(0.4)], [np.sin(0.4), np.cos(0.4)]])
    points = np.column_stack([np.column_stack([np.full(y.shape, -5e-4), y]) @ turn.T + [2, 0], z])
    normal = np.array([-np.cos(0.4), -np.sin(0.4), 0])
    offsets = [points - each for each in (apart.tx_world[0], apart.rx_world[0])]
    distances = [np.linalg.norm(each, axis=1) for each in offsets]
    cosines = [-(each @ normal) / far for each, far in zip(offsets, distances, strict=True)]
    spread = cosines[0] * cosines[1] / np.pi / (distances[0] * distances[1]) ** 2
    expected = (apart.wavelength / (4 * np.pi)) ** 2 * spread.mean() * 0.09
    assert 10 * np.log10(found / expected) == pytest.approx(0.0, abs=0.1)


@pytest.mark.parametrize("xpd", [0.0, 0.3])
@pytest.mark.parametrize("pattern", PATTERNS, ids=lambda pattern: pattern.kind)
def test_elements_far_apart_that_change_places_and_fields_see_the_same(pattern, xpd):
    """Each facet by itself, of concrete, seen under different angles and across each other's polarisation."""
    rng = np.random.default_rng(0)
    corners = rng.normal(size=(200, 3, 3)) * 0.1 + np.array([1.5, 0, 0])
    number = np.arange(200, dtype=np.int32)
    facets = Facets(corners, number, number, 0 * number, np.ones(200, bool), 1 + 0 * number, number)
    rough = replace(MATERIALS["concrete"], scattering_coefficient=0.7, scattering_pattern=pattern, xpd_coefficient=xpd)
    one, other = np.array([[0.0, 0.5, 0.2]]), np.array([[0.0, -0.4, -0.3]])
    fields = np.array([0.0, 0.0, 1.0]), np.array([0.0, 1.0, 1.0]) / np.sqrt(2)
    there = diffuse_gains(facets, [rough], (one, other), fields, 77e9, 3)
    back = diffuse_gains(facets, [rough], (other, one), fields[::-1], 77e9, 3)
    assert np.abs(there).max() > 0
    np.testing.assert_allclose(there, back, rtol=1e-9, atol=0)
