"""Expansions: exact polynomials, slopes of the gains, and gains of every pair."""

import numpy as np
import pytest

from rfgen_sionna._types import SPEED_OF_LIGHT
from rfgen_sionna.scene.materials import material
from rfgen_sionna.tracing.gains.expansion import TANGENTS, band_nodes, tangent_weights
from rfgen_sionna.tracing.integral.facet import Nodes, facet_gains
from rfgen_sionna.tracing.integral.obliquity import Media
from rfgen_sionna.tracing.integral.quadratic import SlopeOrder
from rfgen_sionna.tracing.surface.quadratic_patch import QuadraticPatch


@pytest.mark.parametrize(("order", "count", "slopes"), TANGENTS)
def test_polynomials_are_exact(order, count, slopes):
    """a(u, v, w) = p(u) + v . q(u) + v . r(u) v + v . s(u) v + w . s(u) w - m . s(u) m, with the requested coefficients
    of p and one coefficient of q, r and s per node; terms without slopes are zero."""
    rng = np.random.default_rng(order)
    own, across = rng.normal(size=order), rng.normal(size=(2 + 3 * slopes, count))
    apart, middle = rng.normal(size=(5, 2)), rng.normal(size=2)
    places, scale = rng.normal(size=(5, 2)), 3.0
    u = band_nodes(count)
    poly = np.polynomial.polynomial
    values = [poly.polyval(u, own), poly.polyval(u, poly.polyder(own)) / scale, *poly.polyval(u, across.T)]
    found = tangent_weights(order, count, places, scale, slopes, apart, middle) @ np.concatenate(values)
    expected = np.repeat(own[:, None], len(places), axis=1)
    y, z = places.T

    def squares(y, z):
        return [0.5 * y * y, y * z, 0.5 * z * z]

    both = [one + two - at for one, two, at in zip(squares(y, z), squares(*apart.T), squares(*middle), strict=True)]
    expected[:count] += across.T @ np.stack([y, z, *squares(y, z), *both][: len(across)])
    assert np.abs(found - expected).max() < 1e-11


@pytest.mark.parametrize("bent", [False, True])
@pytest.mark.parametrize("parts", [1, 3])
@pytest.mark.parametrize("medium", ["skin", "glass"])
def test_slopes_are_those_of_the_gains(bent, parts, medium):
    """Facets of a centimetre at 3 m: slopes against differences of gains, within a hundredth of the change over 5 GHz
    and 1 cm. Slopes over the wavenumber, with permittivities and slabs, within a thousandth."""
    rng = np.random.default_rng(1)
    count = 100
    corners = np.array([3.0, 0, 0]) + rng.normal(size=(count, 1, 3)) * 0.3 + rng.normal(size=(count, 3, 3)) * 0.006
    patch = QuadraticPatch(rng.normal(size=(count, 3, 3)) * 5e-5) if bent else None
    across = np.array([0, 0, 1.0])

    def gains(frequency, shift, apart=0.02, **more):
        ends = [np.array([[0, y, 0]]) + 0.5 * shift for y in (-0.5 * apart, 0.5 * apart)]
        nodes = Nodes(*ends, np.array([frequency]))
        media = Media.at((material(medium),), nodes.frequency)
        index, pieces = np.zeros(count, np.int32), np.full(count, parts)
        return facet_gains(corners, index, media, nodes, across, across, pieces, True, patch=patch, **more)

    axes = np.eye(3)[1:]
    slopes = gains(78e9, np.zeros(3), axes=axes, kinds=SlopeOrder.CURVATURE).slopes[:, 0]
    # Displacements of both have products of first slopes and paths of second order; such of Tx from Rx the latter.
    slopes, over_lengths = np.concatenate([slopes[:3], slopes[3:6] + slopes[6:]]), slopes[6:]
    step = 1e6
    truth = [(gains(78e9 + step, np.zeros(3)).a - gains(78e9 - step, np.zeros(3)).a)[0] / (2 * step)]
    truth[0] *= SPEED_OF_LIGHT / (2 * np.pi)
    for axis in axes:
        truth.append((gains(78e9, 1e-5 * axis).a - gains(78e9, -1e-5 * axis).a)[0] / 2e-5)
    for one, other in ((axes[0], axes[0]), (axes[0], axes[1]), (axes[1], axes[1])):
        ends = [s * t * gains(78e9, 1e-3 * (s * one + t * other)).a[0] for s in (1, -1) for t in (1, -1)]
        truth.append(np.sum(ends, axis=0) / 4e-6)
    level = np.linalg.norm(gains(78e9, np.zeros(3)).a)

    def without_spreading(apart):
        ways = np.linalg.norm(corners.mean(axis=1)[:, None] - [[0, 0.5 * apart, 0], [0, -0.5 * apart, 0]], axis=2)
        return gains(78e9, np.zeros(3), apart).a[0] * ways.prod(axis=1)

    from_each_other = (without_spreading(0.021) - without_spreading(0.019)) / 0.002
    over_lengths *= np.linalg.norm(corners.mean(axis=1), axis=1) ** 2
    wrong = np.linalg.norm(0.02 * over_lengths[0] - from_each_other)
    assert wrong < 0.12 * np.linalg.norm(from_each_other)
    reach = 2 * np.pi * 2.5e9 / SPEED_OF_LIGHT, 5e-3, 5e-3, 1e-5, 2e-5, 1e-5
    assert np.linalg.norm(slopes[0] - truth[0]) < 1e-3 * np.linalg.norm(truth[0])
    for found, expected, by in zip(slopes, truth, reach, strict=True):
        assert np.linalg.norm(found - expected) * by < (0.01 if parts > 1 else 0.03) * level
        assert np.linalg.norm(found - expected) < 0.1 * np.linalg.norm(expected)


@pytest.mark.parametrize("bent", [False, True])
def test_steady_frequencies_of_a_pair_agree_with_single_ones(bent):
    """Skin and metal from all sides: reflection that is linear over the band errs by less than 0.2 (band /
    frequency)^2. Slopes agree to two thousandths: their materials are those of mid-band."""
    rng = np.random.default_rng(2)
    count, band = 400, 4e9
    middles = np.array([3.0, 0, 0]) + rng.normal(size=(count, 1, 3)) * 0.3
    corners = middles + rng.normal(size=(count, 3, 3)) * 0.006
    patch = QuadraticPatch(rng.normal(size=(count, 3, 3)) * 5e-5) if bent else None
    nodes = Nodes(np.zeros((3, 3)), np.full((3, 3), 1e-3), 78e9 + band * band_nodes(3) / 2)
    media = Media.at((material("skin"), material("pec")), nodes.frequency)
    index, across = rng.integers(0, 2, count).astype(np.int32), np.array([0, 0, 1.0])
    known = corners, index, media, nodes, across, across, rng.integers(1, 4, count)
    more = {"patch": patch, "axes": np.eye(3)[1:], "kinds": SlopeOrder.CURVATURE}
    one_by_one = facet_gains(*known, **more).terms.copy()
    together = facet_gains(*known, **more, steady=True).terms.copy()
    for number, (found, expected) in enumerate(zip(together, one_by_one, strict=True)):
        error, level = found - expected, np.linalg.norm(expected)
        assert np.linalg.norm(error) < (2e-3 if number else 0.2 * (band / 78e9) ** 2) * level
        assert np.linalg.norm(error[:, index == 1]) < 1e-9 * level  # a difference over 1e-4 of the frequency
    assert not np.array_equal(together, one_by_one)
