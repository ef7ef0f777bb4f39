"""Corrections between the shadow boundary of the phase centre and those of elements."""

import numpy as np
import pytest

from rfgen_sionna._types import SPEED_OF_LIGHT
from rfgen_sionna.tracing.shadows.boundary_edges import ShadowEdges
from rfgen_sionna.tracing.shadows.boundary_integrals import boundary_gains
from rfgen_sionna.tracing.surface.facets import Facets

WAVENUMBER = 1600.0
CENTRE = WAVENUMBER * SPEED_OF_LIGHT / (2 * np.pi)


def facet(corners):
    number = np.zeros(1, np.int32)
    return Facets(np.asarray(corners, float)[None], number, number, number, np.ones(1, bool), number + 1, number)


def edges(corners, start, stop, occluder):
    """Edge between two barycentric points, with the visible side on its left."""
    piece = np.stack([np.full(3, 1 / 3), start, stop])[None]
    return ShadowEdges.of(
        facet(corners),
        np.zeros(1, np.intp),
        piece,
        np.array([[occluder, occluder, np.inf, np.nan]]),
        np.zeros(3),
        WAVENUMBER,
    )


@pytest.mark.parametrize("occluder", [0.3, 0.5, 0.8])
def test_an_edge_shifts_as_rays_past_its_occluder(occluder):
    """Against the line from each element through the occluder."""
    corners = np.array([[2.0, -0.2, -0.3], [2.2, 0.3, -0.2], [2.1, 0.0, 0.3]])
    found = edges(corners, np.array([0.5, 0.3, 0.2]), np.array([0.2, 0.3, 0.5]), occluder)
    elements = np.random.default_rng(0).normal(size=(20, 3)) * [0.002, 0.02, 0.02]
    normal = found.normal[0]
    for k, middle in enumerate(found.middle):
        by = occluder * middle
        way = ((middle - elements) @ normal / ((by - elements) @ normal))[:, None]
        there = elements + way * (by - elements)
        assert np.allclose((there - middle) @ normal, 0.0, atol=1e-12)
        assert np.allclose(found.shifts(elements)[:, k], (there - middle) @ found.inward[k], atol=1e-12)


def test_corrections_are_integrals_of_the_phase():
    """Against points on the facet, between the centre's boundary and that of Tx and Rx which leaves less."""
    corners = np.array([[2.0, -0.2, -0.3], [2.05, 0.3, -0.2], [2.1, 0.0, 0.3]])
    found = edges(corners, np.array([0.4, 0.35, 0.25]), np.array([0.36, 0.33, 0.31]), 0.5)
    tx, rx = (np.random.default_rng(k).normal(size=(n, 3)) * [0.0, 0.02, 0.02] for k, n in ((1, 3), (2, 4)))
    ones = np.ones((1, 3, 4, len(found.owner)), complex)
    correction = -boundary_gains(found, tx, rx, CENTRE, 0.0, ones, found.middle)[0] * found.area
    one, weight = np.polynomial.legendre.leggauss(40)
    for i, a in enumerate(tx):
        for j, b in enumerate(rx):
            total, size = 0.0, 0.0
            for k, middle in enumerate(found.middle):
                width = max(found.shifts(tx)[i, k], found.shifts(rx)[j, k])
                across = 0.5 * width * (1 + one)[:, None, None] * found.inward[k]
                along = 0.5 * found.length[k] * one[:, None] * found.along[k]
                points = middle + across + along
                way = sum(np.linalg.norm(points - e, axis=-1) - np.linalg.norm(middle - e) for e in (a, b))
                area = np.multiply.outer(weight, weight) * width * found.length[k] / 4
                total, size = (area * np.exp(-1j * WAVENUMBER * way)).sum(), np.abs(area.sum())
                assert correction[i, j, k] == pytest.approx(total, abs=0.01 * size)
    assert np.abs(found.shifts(tx)).max() * WAVENUMBER > 3  # the phase turns across them


def test_corrections_refer_to_their_reference_points_over_the_band():
    """From the middle of each edge to the reference point of the delay."""
    corners = np.array([[2.0, -0.2, -0.3], [2.05, 0.3, -0.2], [2.1, 0.0, 0.3]])
    found = edges(corners, np.array([0.4, 0.35, 0.25]), np.array([0.36, 0.33, 0.31]), 0.5)
    rng = np.random.default_rng(3)
    tx, rx = (rng.normal(size=(n, 3)) * 0.02 for n in (2, 3))
    gains = rng.normal(size=(4, 2, 3, len(found.owner), 2)).view(complex)[..., 0]
    reference = found.middle + rng.normal(size=found.middle.shape) * 0.01
    half_band = 0.5e9
    plain = boundary_gains(found, tx, rx, CENTRE, half_band, np.ones_like(gains[:1]), found.middle)[0]
    carried = boundary_gains(found, tx, rx, CENTRE, half_band, gains, reference)
    away = [np.linalg.norm(p - e[:, None], axis=2) for p in (found.middle, reference) for e in (tx, rx)]
    way = (away[0][:, None] + away[1] - away[2][:, None] - away[3]) / SPEED_OF_LIGHT
    for u in (-0.3, 0.0, 0.3):
        there, own = (np.tensordot(u ** np.arange(4), each, 1) for each in (carried, gains))
        expected = plain * own * np.exp(-2j * np.pi * (CENTRE + u * half_band) * way)
        # Four orders of what turns by 0.1 rad and is multiplied by polynomials of the fourth.
        assert np.allclose(there, expected, atol=0.02 * np.abs(plain).max())
    assert np.allclose(carried[0], plain * gains[0] * np.exp(-2j * np.pi * CENTRE * way), atol=1e-9)


def test_the_weight_of_a_growing_edge_is_continuous():
    corners = np.array([[2.0, -0.2, -0.3], [2.05, 0.3, -0.2], [2.1, 0.0, 0.3]])
    found = edges(corners, np.array([0.4, 0.35, 0.25]), np.array([0.36, 0.33, 0.31]), 0.5)
    count, weights = len(found.owner), []
    for strength in (1e-4, 1e-3, 1e-2, 2e-2, 1e-1):
        own, missed = found.significant(
            np.full(count, strength / np.sqrt(count)),
            np.full(count, strength / np.sqrt(count)),
            np.ones(count),
            np.zeros(count, bool),
            np.zeros(count, np.intp),
            np.ones(1),
            1e-2,
        )
        weights.append(own.weight[0] if len(own.owner) else 0.0)
        assert 0.0 < missed[0] < 0.4 * strength + 1e-3
    assert weights == sorted(weights)
    assert weights[0] == 0.0
    assert weights[-1] == 1.0


def test_corrections_wider_than_the_known_surface_are_left_out():
    """An occluder at 6 cm shifts the edge at 2 m by 30 times the distance of elements."""
    corners = np.array([[2.0, -0.2, -0.3], [2.05, 0.3, -0.2], [2.1, 0.0, 0.3]])
    elements = np.array([[0.0, 0.01, 0.0], [0.0, -0.01, 0.0]])
    known = []
    for occluder in (0.5, 0.3, 0.03):
        found = edges(corners, np.array([0.4, 0.35, 0.25]), np.array([0.36, 0.33, 0.31]), occluder)
        at_most, _, share = found.return_bounds(elements, elements, WAVENUMBER, np.zeros(len(found.owner)))
        known.append(share[0])
        group, level = np.zeros(len(at_most), np.intp), np.array([np.linalg.norm(at_most)])
        own, missed = found.significant(at_most, at_most, share, group > 0, group, level, 1e-2)
        assert (len(own.owner) == 0) == (share[0] == 0)
        # Known corrections err by half a percent, unknown ones are missed.
        assert missed[0] == pytest.approx(np.hypot(1.0 - share[0], 0.005), rel=0.1)
    assert known[0] == 1.0
    assert known[-1] == 0.0
