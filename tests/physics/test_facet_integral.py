"""Laws of the facet integral: image theory, the flat plate, reciprocity, invariance, and the dense quadrature."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rfgen_sionna._types import SPEED_OF_LIGHT
from rfgen_sionna.records import knot_weights
from rfgen_sionna.tracing.integral.facet import Nodes, facet_gains
from rfgen_sionna.tracing.integral.obliquity import Media
from rfgen_sionna.tracing.surface.quadratic_patch import QuadraticPatch
from rfgen_sionna.tracing.surface.resolution import FACET_BULGE, allowed_bulge, phase_bulge
from rfgen_sionna.tracing.surface.tessellate import tessellate
from tests.reference.physical_optics import po_gain

VERTICAL = np.array([0.0, 0.0, 1.0])
SKIN = 6.57 - 8.91j  # dry skin at 77 GHz


def channel(facets, tx, rx, frequency, permittivity=complex(np.inf), tx_field=VERTICAL, rx_field=VERTICAL):
    """Coherent sum over facets of one element pair; `facets` are corners, or corners and their numbers of parts."""
    corners, parts = facets if isinstance(facets, tuple) else (facets, None)
    one = np.ones(1)
    media = Media(np.full((1, 1), permittivity), np.ones((1, 1)), np.inf * one, one)
    nodes = Nodes(tx[None], rx[None], frequency * one)
    gains = facet_gains(corners, np.zeros(len(corners), np.int32), media, nodes, tx_field, rx_field, parts)
    assert np.isfinite(gains.a).all()
    assert np.isfinite(gains.tau).all()
    phase = 2 * np.pi * np.mod(frequency * gains.tau[0], 1.0)
    return complex((gains.a[0] * np.exp(-1j * phase)).sum())


def plate(width, height, distance, frequency, rtol, tilt=0.0):
    """Corners of the facets of a plate across +x, turned by `tilt` [rad] about z."""
    y, z = width / 2, height / 2
    vertices = np.array([[0, -y, -z], [0, y, -z], [0, y, z], [0, -y, z]], dtype=float)
    turn = np.array([[np.cos(tilt), -np.sin(tilt), 0], [np.sin(tilt), np.cos(tilt), 0], [0, 0, 1]])
    vertices = vertices @ turn.T + [distance, 0, 0]
    faces = np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32)
    return split(vertices, faces, frequency, rtol)


def split(vertices, faces, frequency, rtol):
    """Corners and numbers of parts of a mesh's facets for a viewpoint at the origin."""
    pieces = tessellate(vertices, faces, np.zeros(3), frequency, rtol)
    return pieces.corners(vertices, faces), pieces.parts


@pytest.mark.parametrize("frequency", [24.125e9, 77e9])
@pytest.mark.parametrize(("permittivity", "reflection"), [(complex(np.inf), -1.0), (5.24 + 0j, None)])
def test_large_mirror_is_the_image_of_the_radar(frequency, permittivity, reflection):
    """A plate of many Fresnel zones gives Gamma lambda / (4 pi 2 d) exp(-j 2 k d), phase included.

    Each edge at u zones from the specular point adds a wave of its own of relative size 1 / (2 pi u) with a phase of
    pi u^2; over random u in 8 … 24 the mean of 48 plates is within 0.1 dB (4 edges x 0.01 / sqrt(48), two sigma).
    """
    distance, wavelength = 2.0, SPEED_OF_LIGHT / frequency
    if reflection is None:
        reflection = (1 - np.sqrt(permittivity)) / (1 + np.sqrt(permittivity))
    rng = np.random.default_rng(0)
    faces = np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32)
    sums = []
    for left, right, below, above in np.sqrt(wavelength * distance / 2) * rng.uniform(8, 24, (48, 4)):
        rim = [[distance, y, z] for y, z in ((-right, -below), (left, -below), (left, above), (-right, above))]
        corners = split(np.array(rim), faces, frequency, 1e-2)
        sums.append(channel(corners, np.zeros(3), np.zeros(3), frequency, permittivity))
    image = reflection * wavelength / (4 * np.pi * 2 * distance) * np.exp(-2j * np.pi * 2 * distance / wavelength)
    assert abs(np.mean(sums) / image - 1) < 0.0115


def test_far_plate_has_the_cross_section_of_its_area():
    """sigma = 4 pi A^2 / lambda^2 at normal incidence (far: 100 x 2 D^2 / lambda leaves 0.01 rad of curvature)."""
    frequency, side = 77e9, 0.05
    wavelength = SPEED_OF_LIGHT / frequency
    distance = 200 * side**2 / wavelength
    a = channel(plate(side, side, distance, frequency, 1e-4), np.zeros(3), np.zeros(3), frequency)
    sigma = abs(a) ** 2 * (4 * np.pi) ** 3 * distance**4 / wavelength**2
    assert 10 * np.log10(sigma / (4 * np.pi * side**4 / wavelength**2)) == pytest.approx(0.0, abs=0.01)


def test_far_tilted_plate_follows_the_sinc():
    """sigma(theta) = 4 pi A^2 / lambda^2 (cos theta sinc(k L sin theta))^2 through the first side lobes."""
    frequency, side = 77e9, 0.05
    wavelength = SPEED_OF_LIGHT / frequency
    distance = 200 * side**2 / wavelength
    peak = abs(channel(plate(side, side, distance, frequency, 1e-4), np.zeros(3), np.zeros(3), frequency))
    for tilt in np.radians([1.0, 3.2, 5.5, 7.7]):
        a = channel(plate(side, side, distance, frequency, 1e-4, tilt), np.zeros(3), np.zeros(3), frequency)
        argument = 2 * side / wavelength * np.sin(tilt)  # np.sinc has pi in it
        assert abs(a) / peak == pytest.approx(abs(np.cos(tilt) * np.sinc(argument)), abs=2e-3)


@pytest.mark.parametrize("seed", [*range(6), *(pytest.param(seed, marks=pytest.mark.slow) for seed in range(6, 12))])
def test_facets_agree_with_dense_quadrature(seed):
    """Random facets, materials, polarisations and bistatic element pairs, at several tolerances.

    The error is at most rtol of what a facet can return at most, A / (4 pi R^2). Polarisation and Fresnel coefficients
    are constant on a facet; at the sizes below their change, of first order in size over range, stays under 5e-4.
    """
    rng = np.random.default_rng(seed)
    frequency = float(rng.choice([24.125e9, 60e9, 77e9]))
    permittivity = [complex(np.inf), SKIN, 2.7 - 0.1j][seed % 3]
    wavelength = SPEED_OF_LIGHT / frequency
    centre = rng.uniform(0.5, 4.0) * np.array([1.0, *rng.uniform(-0.4, 0.4, 2)])
    vertices = centre + rng.normal(scale=rng.uniform(1, 4) * wavelength, size=(3, 3))
    faces = np.array([[0, 1, 2]], dtype=np.int32)
    tx, rx = rng.normal(scale=0.03, size=(2, 3))
    fields = rng.normal(size=(2, 3))
    fields /= np.linalg.norm(fields, axis=1, keepdims=True)
    truth = po_gain(vertices[faces], tx, rx, fields[0], fields[1], frequency, permittivity, n=400)
    area = 0.5 * np.linalg.norm(np.cross(vertices[1] - vertices[0], vertices[2] - vertices[0]))
    ceiling = area / (4 * np.pi * np.dot(centre, centre))
    for rtol in (1e-2, 1e-3, 1e-4):
        corners = split(vertices, faces, frequency, rtol)
        found = channel(corners, tx, rx, frequency, permittivity, fields[0], fields[1])
        assert abs(found - truth) < (rtol + 5e-4) * ceiling


@pytest.mark.parametrize("tilt", [0.0, 0.3, 0.8])
def test_large_plate_meets_the_tolerance(tilt):
    """Half a metre square at 1.5 m, 77 GHz: 130 wavelengths of facets that all make the same error.

    The error stays under rtol of the mirror's gain whether the mirror point is on the plate or far off it: no grating
    lobes. Truth is Gauss-Legendre quadrature with 1800 x 1800 points, converged to 1e-10.
    """
    frequency, k = 77e9, 2 * np.pi * 77e9 / SPEED_OF_LIGHT
    rim = np.array([[0, -0.25, -0.25], [0, 0.25, -0.25], [0, 0.25, 0.25], [0, -0.25, 0.25]])
    turn = np.array([[np.cos(tilt), -np.sin(tilt), 0], [np.sin(tilt), np.cos(tilt), 0], [0, 0, 1]])
    vertices, faces = rim @ turn.T + [1.5, 0.0123, 0.0456], np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32)
    node, weight = np.polynomial.legendre.leggauss(1800)
    along, up = vertices[1] - vertices[0], vertices[3] - vertices[0]
    normal = np.cross(along, up)
    truth = 0j
    for u, w in zip((node + 1) / 2, weight / 2, strict=True):
        points = vertices[0] + u * along + (node[:, None] + 1) / 2 * up
        r = np.linalg.norm(points, axis=1)
        truth += w * (weight / 2 * np.abs(points @ normal) / r**3 * np.exp(-2j * k * r)).sum()
    truth *= -1j / (4 * np.pi)
    mirror = 1 / (4 * k * 1.5)
    for rtol in (1e-2, 1e-3, 1e-4):
        corners = split(vertices, faces, frequency, rtol)
        assert abs(channel(corners, np.zeros(3), np.zeros(3), frequency) - truth) < rtol * mirror


def dense_plate(side, distance, tilt, frequency):
    """Channel of a square metal plate by Gauss-Legendre quadrature, twice as dense as its phase asks for."""
    k = 2 * np.pi * frequency / SPEED_OF_LIGHT
    along, up = side * np.array([-np.sin(tilt), np.cos(tilt), 0]), side * np.array([0, 0, 1.0])
    count = 40 + int(2.5 * k * side / np.pi)
    node, weight = np.polynomial.legendre.leggauss(count)
    normal, total = np.cross(along, up), 0j
    for u, w in zip(node / 2, weight / 2, strict=True):
        points = [distance, 0, 0] + u * along + node[:, None] / 2 * up
        r = np.linalg.norm(points, axis=1)
        total += w * (weight / 2 * np.abs(points @ normal) / r**3 * np.exp(-2j * k * r)).sum()
    return -1j / (4 * np.pi) * total


@pytest.mark.parametrize("distance", [0.2, 3.0, 50.0])
@pytest.mark.parametrize("size", [3, 30, pytest.param(300, marks=pytest.mark.slow)])
def test_main_lobe_and_three_side_lobes_of_a_plate(size, distance):
    """3, 30 and 300 wavelengths square at 0.2, 3 and 50 m, 77 GHz, tilted to where its lobes are far away and by up to
    40 degrees: within 0.3 dB of dense quadrature where it returns as much as a third side lobe, elsewhere within 0.3 dB
    of that lobe."""
    frequency = 77e9
    side = size * SPEED_OF_LIGHT / frequency
    lobes = np.arcsin(np.minimum(np.array([0, 1.4303, 2.459, 3.4709]) / (2 * size), 1.0))
    third = 0.09 * abs(dense_plate(side, distance, 0.0, frequency))
    for tilt in [*lobes, *np.radians([10.0, 20.0, 40.0])]:
        truth = dense_plate(side, distance, tilt, frequency)
        found = channel(plate(side, side, distance, frequency, 1e-3, tilt), np.zeros(3), np.zeros(3), frequency)
        if abs(truth) > third or tilt in lobes:
            assert abs(20 * np.log10(abs(found / truth))) < 0.3
        assert abs(found - truth) < 0.035 * max(abs(truth), third)


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("permittivity", [complex(np.inf), SKIN])
def test_reciprocity(seed, permittivity):
    """Swapping Tx and Rx, with their polarisations, leaves the gain, wherever they are: metres apart, too."""
    rng = np.random.default_rng(seed)
    corners = np.array([0.6, 0, 0]) + rng.normal(scale=0.02, size=(40, 3, 3))
    tx, rx = rng.normal(scale=[0.01, 0.05, 0.3][seed % 3], size=(2, 3))
    u, v = (vector / np.linalg.norm(vector) for vector in rng.normal(size=(2, 3)))
    there = channel(corners, tx, rx, 77e9, permittivity, u, v)
    back = channel(corners, rx, tx, 77e9, permittivity, v, u)
    assert abs(there) > 0
    assert abs(there - back) < 1e-9 * abs(there)


corner = st.tuples(*[st.floats(-1, 1)] * 3)


@settings(max_examples=60, deadline=None)
@given(
    triangle=st.tuples(corner, corner, corner),
    size=st.sampled_from([0.0, 1e-6, 1e-3, 0.1, 3.0]),
    distance=st.sampled_from([0.0, 0.05, 3.0, 1000.0]),
    permittivity=st.sampled_from([1.0, 1.0 - 1e-9j, SKIN, 1e6 - 1e6j, complex(np.inf)]),
    frequency=st.sampled_from([24e9, 81e9]),
)
def test_gains_are_finite_whatever_the_facet(triangle, size, distance, permittivity, frequency):
    """Degenerate, grazing, head-on, through the radar, no contrast, any conductor."""
    corners = np.array([triangle]) * size + [distance, 0, 0]
    channel(corners, np.zeros(3), np.array([0, 0.01, 0]), frequency, permittivity)


@pytest.mark.parametrize("n", [2, 3, 7])
def test_parts_are_the_facets_that_they_make_up(n):
    """A facet integrated in n^2 parts is the sum over those parts as facets of their own."""
    rng = np.random.default_rng(n)
    whole = np.array([1.5, 0.1, 0.2]) + rng.normal(scale=0.05, size=(3, 3, 3))
    a, b, c = (whole[:, i] for i in range(3))

    def at(i, j):  # row i from corner a, column j from b's side to c's
        return a + (i * (b - a) + j * (c - b)) / n

    upright = [(at(i, j), at(i + 1, j), at(i + 1, j + 1)) for i in range(n) for j in range(i + 1)]
    turned = [(at(i, j), at(i + 1, j + 1), at(i, j + 1)) for i in range(n) for j in range(i)]
    small = np.concatenate([np.stack(each, axis=1) for each in upright + turned])
    assert len(small) == 3 * n * n
    tx, rx = np.array([0, 0.01, 0]), np.array([0, -0.01, 0.005])
    together = channel((whole, np.full(3, n, np.int32)), tx, rx, 77e9, SKIN)
    assert abs(together / channel(small, tx, rx, 77e9, SKIN) - 1) < 1e-9


def test_no_contrast_returns_nothing():
    """epsilon_r = 1 is air: what is reflected is 0, and monostatic forward currents cancel."""
    a = channel(plate(0.1, 0.1, 1.0, 77e9, 1e-3), np.zeros(3), np.zeros(3), 77e9, 1.0)
    metal = channel(plate(0.1, 0.1, 1.0, 77e9, 1e-3), np.zeros(3), np.zeros(3), 77e9)
    assert abs(a) < 1e-9 * abs(metal)


def test_tessellation_meets_its_bound_and_stops_there():
    """Every facet is allowed, no facet is split that was allowed, and the area is kept."""
    vertices = np.array([[3.0, -2, -1], [3, 2, -1], [3, 2, 1.5], [3, -2, 1.5]])
    faces = np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32)
    for rtol in (1e-2, 1e-3):
        pieces = tessellate(vertices, faces, np.zeros(3), 77e9, rtol)
        corners = pieces.corners(vertices, faces)
        bulge = phase_bulge(corners, np.zeros(3), 77e9)
        assert bulge.max() <= max(allowed_bulge(rtol), FACET_BULGE)
        assert (bulge / pieces.parts**2).max() <= allowed_bulge(rtol)
        assert np.median(bulge) > FACET_BULGE / 8  # two bisections quarter the bulge
        cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        assert 0.5 * np.linalg.norm(cross, axis=1).sum() == pytest.approx(10.0, rel=1e-12)


def test_tessellation_leaves_out_what_is_far():
    """A kilometre of ground, of which 11 m count: facets beyond are not made, those within are the same."""
    vertices = np.array([[-500.0, -500, -1.5], [500, -500, -1.5], [500, 500, -1.5], [-500, 500, -1.5]])
    faces = np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32)
    pieces = tessellate(vertices, faces, np.zeros(3), 77e9, 1e-2, max_range=11.0)
    corners = pieces.corners(vertices, faces)
    distance = np.linalg.norm(corners.mean(axis=1), axis=1)
    assert len(distance) < 500_000
    assert distance.max() < 11.5
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = 0.5 * np.linalg.norm(cross, axis=1)[distance < 10.9].sum()
    assert area == pytest.approx(np.pi * (10.9**2 - 1.5**2), rel=0.01)


def test_tessellation_refuses_what_no_machine_can_hold():
    vertices = np.array([[0.1, -9, -9], [0.1, 9, -9], [0.1, 0, 9]])
    with pytest.raises(ValueError, match=r"rtol is 1e-08: this scene takes more than 10,000 facets"):
        tessellate(vertices, np.array([[0, 1, 2]], dtype=np.int32), np.zeros(3), 77e9, 1e-8, limit=10_000)


def test_knot_weights_reproduce_cubics():
    """Value, rate and curvature of a cubic come out exactly, wherever the clock starts."""
    for start in (0.0, 1e4):
        knots = start + np.array([0.0, 0.01, 0.02, 0.03])
        t = start + np.linspace(0, 0.03, 7)
        for derivative in range(3):
            p = np.polynomial.Polynomial([1.0, -2.0, 30.0, 500.0])
            found = knot_weights(knots, t, derivative) @ p(knots - start)
            truth = p.deriv(derivative)(t - start) if derivative else p(t - start)
            np.testing.assert_allclose(found, truth, rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("curved", [False, True])
def test_facets_return_the_same_in_any_order(curved):
    """Lanes are sorted by how long they take: each facet's return, slopes and delay stay its own, to the bit."""
    rng = np.random.default_rng(3)
    count = 50
    corners = np.array([3.0, 0.0, 0.0]) + rng.normal(size=(count, 1, 3)) * 0.3 + rng.normal(size=(count, 3, 3)) * 0.02
    parts = rng.integers(1, 6, count).astype(np.int32)
    material = rng.integers(0, 2, count).astype(np.int32)
    patch = QuadraticPatch(1e-3 * rng.normal(size=(count, 3, 3))) if curved else None
    media = Media(np.stack([np.full(2, SKIN), np.full(2, 5.0 - 0.1j)]), np.ones((2, 2)), np.full(2, np.inf), np.ones(2))
    nodes = Nodes(np.zeros((2, 3)), np.array([[0.0, 0.01, 0.0], [0.0, 0.02, 0.0]]), np.array([77e9, 79e9]))
    axes = 0.01 * np.eye(3)[1:]

    def gains(index):
        own = None if patch is None else patch.take(index)
        return facet_gains(
            corners[index], material[index], media, nodes, VERTICAL, VERTICAL, parts[index], patch=own, axes=axes
        )

    found, mixed = gains(np.arange(count)), rng.permutation(count)
    other = gains(mixed)
    assert np.abs(found.a).min() > 0
    assert np.array_equal(other.a, found.a[:, mixed])
    assert np.array_equal(other.tau, found.tau[:, mixed])
    assert np.array_equal(other.slopes, found.slopes[..., mixed])
