"""Expansions: exact polynomials, slopes of the gains, and gains of every pair."""

import numpy as np
import pytest
import trimesh

from rfgen_sionna._types import SPEED_OF_LIGHT
from rfgen_sionna.radar import Radar
from rfgen_sionna.scene import MeshActor
from rfgen_sionna.scene.materials import material
from rfgen_sionna.tracing.gains.expansion import TANGENTS, band_nodes, tangent_weights
from rfgen_sionna.tracing.integral.facet import Nodes, facet_gains
from rfgen_sionna.tracing.integral.obliquity import Media
from rfgen_sionna.tracing.integral.quadratic import SlopeOrder
from rfgen_sionna.tracing.moving.interval import TraceInterval
from rfgen_sionna.tracing.surface.quadratic_patch import QuadraticPatch
from rfgen_sionna.tracing.trace_run import TraceRun
from rfgen_sionna.tracing.tracer import Tracer


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


def test_a_tangent_has_the_return_of_every_pair_over_the_band():
    """A ball before the mmMesh array: two integrals per facet instead of nine, the same return within the tolerance."""
    radar = Radar.load("awr1843", "mmmesh", position=(0, 0, 1), look_at=(3, 0, 1))
    mesh = trimesh.creation.icosphere(subdivisions=4, radius=0.1)
    ball = MeshActor.from_mesh(mesh, material="skin", position=(2, 0.4, 1.1), name="ball")
    rtol = 1e-2
    tracer = Tracer(None, radar, [ball], rtol)
    run = tracer._follow(True)
    tracer.trace(0.0, 0.0, TraceRun(run, True, None))
    expansion, band = run._error_control.expansion, run._band
    assert expansion.axes is not None
    assert len(expansion.nodes) <= 3
    rays = tracer.rays_at(0.0)
    (visible,) = run._trace_visibility(
        [0.0], TraceInterval(np.zeros(1), lambda t: [ball.vertices(t)], lambda t: rays, rays, lambda t: rays, [])
    )
    facets = visible.facets.take(np.flatnonzero(visible.fraction > 0))
    weight = visible.fraction[visible.fraction > 0]
    gains = band(facets, run._error_control._materials, expansion)
    u = np.array([-1.0, -0.3, 0.6, 1.0])
    for pair in ((0, 0), (2, 3), (1, 2)):
        exact = band.at_probes(facets, run._error_control._materials, u, pair, facets.parts)
        phasor = weight * np.exp(-2j * np.pi * np.mod(band.frequency(u)[:, None] * exact.tau, 1.0))
        found = np.vander(u, expansion.order, increasing=True) @ gains[:, *pair]
        truth = (exact.a * phasor).sum(axis=1)
        assert np.abs((found * phasor).sum(axis=1) - truth).max() < rtol * np.abs(truth).mean()


@pytest.mark.parametrize("shape", ["ball", "box"])
def test_the_pieces_of_a_facet_sum_to_its_return(shape):
    """Sixteen pieces with their own phases and patches: gains to the integral's error, slopes to a tenth."""
    radar = Radar.load("awr1843", "mmmesh", position=(0, 0, 1), look_at=(3, 0, 1))
    ball = trimesh.creation.icosphere(subdivisions=4, radius=0.1)
    mesh = ball if shape == "ball" else trimesh.creation.box((0.02, 0.06, 0.05))
    actor = MeshActor.from_mesh(mesh, material="skin", position=(2, 0.2, 1.1), orientation=(0.02, 0.01, 0), name="it")
    tracer = Tracer(None, radar, [actor], 1e-2)
    run = tracer._follow(True)
    tracer.trace(0.0, 0.0, TraceRun(run, True, None))
    rays = tracer.rays_at(0.0)
    (visible,) = run._trace_visibility(
        [0.0], TraceInterval(np.zeros(1), lambda t: [actor.vertices(t)], lambda t: rays, rays, lambda t: rays, [])
    )
    facets = visible.facets.take(np.flatnonzero(visible.fraction > 0))
    points, faces = np.eye(3), np.arange(3)[None]
    for _ in range(2):
        points, faces = trimesh.remesh.subdivide(points, faces)
    parts = points[faces]
    count = len(parts)
    owner = np.repeat(np.arange(len(facets)), count)
    pieces = facets.cut(owner, np.tile(parts, (len(facets), 1, 1)))
    identity = np.stack([pieces.number, pieces.place], axis=1)
    assert len(np.unique(identity, axis=0)) == len(pieces)  # rough ones have phases of their own
    each = run._band.values(
        pieces, run._error_control._materials, run._error_control.expansion, facets.centroids[owner]
    )
    whole = run._band.values(facets, run._error_control._materials, run._error_control.expansion)
    summed = each.reshape(len(whole), len(facets), count).sum(axis=2)
    nodes = len(run._error_control.expansion.nodes)
    for number, (value, expected) in enumerate(zip(summed, whole, strict=True)):
        allowed = 0.005 if number < nodes else 0.1  # gains, and their slopes
        assert np.abs(value - expected).max() < allowed * np.abs(expected).max()
