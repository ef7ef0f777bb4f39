"""Means of w exp(-j k s) over triangles on which s and w are quadratic, against Gauss-Legendre quadrature."""

import numpy as np
import pytest

from rfgen_sionna.scene.kernels import drjit_types
from rfgen_sionna.tracing.integral.quadratic import PathVariation, Quadratic, SlopeOrder
from rfgen_sionna.tracing.integral.simplex import Complex


def dense(k, lengths, length_sagittas, strengths, strength_sagittas, n=120):
    """(triangle,) means; Duffy's map makes the triangle a square."""
    node, weight = np.polynomial.legendre.leggauss(n)
    s, t = (each.ravel() for each in np.meshgrid((node + 1) / 2, (node + 1) / 2, indexing="ij"))
    w = np.outer(weight, weight).ravel() / 2 * s
    corner = np.stack([1 - s, s * (1 - t), s * t])
    edge = 4 * corner[[1, 2, 0]] * corner[[2, 0, 1]]
    path = lengths.T @ corner - length_sagittas.T @ edge
    return ((strengths.T @ corner + strength_sagittas.T @ edge) * np.exp(-1j * k * path)) @ w


def found(k, lengths, length_sagittas, strengths, strength_sagittas, ways=None, path_curvatures=()):
    """(term, triangle) of :meth:`Quadratic.mean`; `ways` and `path_curvatures` (corner or edge, triangle): corners,
    then sagittas."""
    dr, types = drjit_types()
    real = types.Float64

    def rows(values):
        return [real(np.ascontiguousarray(each)) for each in values]

    def pairs(values):
        return [Complex(re, im) for re, im in zip(rows(values.real), rows(values.imag), strict=True)]

    quadratic = Quadratic(rows(lengths), rows(length_sagittas), pairs(strengths), pairs(strength_sagittas))
    wavenumber = real(np.full(lengths.shape[1], k))

    def detours(given):
        return [PathVariation(rows(each[:3]), rows(each[3:])) for each in given]

    kinds = SlopeOrder.CURVATURE if len(path_curvatures) else SlopeOrder.SECOND
    terms = quadratic.mean(dr, wavenumber, None if ways is None else detours(ways), kinds, detours(path_curvatures))
    return np.stack([each.re.numpy() + 1j * each.im.numpy() for each in terms])


def some(rng, slope, sag, uneven=0.0, count=40):
    lengths = slope * rng.normal(size=(3, count))
    length_sagittas = sag * rng.normal(size=(3, count))
    strengths = 1.0 + uneven * (rng.normal(size=(3, count)) + 1j * rng.normal(size=(3, count)))
    return lengths, length_sagittas, strengths, 0.5 * uneven * rng.normal(size=(3, count)) + 0j


@pytest.mark.parametrize("bulge", [0.1, 0.2, 0.4])
def test_the_error_at_normal_incidence_is_of_third_order(bulge):
    """Error below b^3 / 60 for a bulge b without slope, whose effect is up to b^2 / 10."""
    case = some(np.random.default_rng(0), 0.0, bulge)
    truth, size = dense(1.0, *case), np.abs(case[1]).max(axis=0)
    assert (np.abs(found(1.0, *case)[0] - truth) < size**3 / 60).all()
    assert (np.abs(1.0 - np.abs(truth)) / size**2).max() > 0.09


@pytest.mark.parametrize("slope", [0.3, 3.0, 30.0])
@pytest.mark.parametrize("bulge", [0.02, 0.1, 0.3])
def test_the_error_at_oblique_incidence_is_of_second_order(slope, bulge):
    """Phases of up to 100 rad: error below 0.03 b^2, plus b / 25 for a strength that varies by a tenth."""
    rng = np.random.default_rng(1)
    for uneven, least in ((0.0, 0.0), (0.1, 0.04)):
        case = some(rng, slope, bulge, uneven)
        size = np.abs(case[1]).max(axis=0)
        assert (np.abs(found(1.0, *case)[0] - dense(1.0, *case)) < 0.03 * size**2 + least * size).all()


def test_slopes_are_those_of_the_mean():
    """Slopes over the wavenumber, two path variations and path curvatures are differences of the mean, to second order
    in the bulge."""
    rng = np.random.default_rng(2)
    case, k, step = some(rng, 2.0, 0.05), 1.3, 1e-4
    ways, path_curvatures = rng.normal(size=(2, 6, 40)), rng.normal(size=(3, 6, 40))
    ways[:, 3:] *= 0.02  # second slopes are without
    terms = found(k, *case, ways, path_curvatures)

    def along_them(by):
        return found(k, case[0] + by[:3], case[1] - by[3:], *case[2:])[0]

    def moved(one, other=0.0, at=k):
        by = one * ways[0] + other * ways[1]
        return found(at, case[0] + by[:3], case[1] - by[3:], *case[2:])[0]

    assert np.abs(terms[0] - moved(0.0)).max() < 1e-14
    over_k = (moved(0.0, at=k + step) - moved(0.0, at=k - step)) / (2 * step)
    bulge = np.abs(case[1]).max(axis=0)
    assert np.abs(terms[1] - over_k).max() < 1e-4 * np.abs(over_k).max()
    along = (moved(step) - moved(-step)) / (2 * step), (moved(0, step) - moved(0, -step)) / (2 * step)
    along += tuple(
        (along_them(step * edge_curvature) - along_them(-step * edge_curvature)) / (2 * step)
        for edge_curvature in path_curvatures
    )
    for term, difference in zip([*terms[2:4], *terms[7:]], along, strict=True):
        assert (np.abs(term - difference) < 2 * bulge * np.abs([*ways, *path_curvatures]).max(axis=(0, 1))).all()
    # Where nothing bulges, ways that rise themselves are followed exactly.
    flat = case[0], 0.0 * case[1], *case[2:]
    for way, term in zip(ways, found(k, *flat, ways, path_curvatures)[2:4], strict=True):
        there, back = (found(k, flat[0] + by * way[:3], -by * way[3:], *flat[2:])[0] for by in (step, -step))
        assert np.abs(term - (there - back) / (2 * step)).max() < 1e-6
    step = 1e-3
    twice = (moved(step) - 2 * moved(0) + moved(-step)) / step**2
    mixed = (moved(step, step) - moved(step, -step) - moved(-step, step) + moved(-step, -step)) / (4 * step**2)
    for term, difference in ((terms[4], twice), (terms[5], mixed)):
        assert (np.abs(term - difference) < 4 * (bulge + 0.04) * np.abs(ways).max(axis=(0, 1)) ** 2 + 1e-4).all()
