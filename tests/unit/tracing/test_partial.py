"""What is missed where facets are partly hidden: the estimate against dense quadrature of the part that is seen."""

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from rfgen_sionna.records import SPEED_OF_LIGHT
from rfgen_sionna.scene import Actor
from rfgen_sionna.tracing.partial import SAFETY, SAMPLED, missed, sight_error
from rfgen_sionna.tracing.visibility import lattice
from tests.reference.physical_optics import triangle_points

FREQUENCY = 77e9
WAVENUMBER = 2 * np.pi * FREQUENCY / SPEED_OF_LIGHT
ORIGIN = np.zeros(3)


def pieces(seed):
    """Corners of the facets that look at the radar: a box or a ball of 5 to 20 cm at 0.5 to 3 m, of facets from less
    than a wavelength to many."""
    rng = np.random.default_rng(seed)
    if seed % 2:
        mesh = trimesh.creation.icosphere(subdivisions=int(rng.integers(2, 5)), radius=rng.uniform(0.05, 0.2))
    else:
        mesh = trimesh.creation.box(rng.uniform(0.05, 0.2, 3))
        for _ in range(int(rng.integers(1, 5))):
            mesh = mesh.subdivide()
    mesh.apply_transform(np.block([[Rotation.random(rng=seed).as_matrix(), np.zeros((3, 1))], [0, 0, 0, 1]]))
    corners = np.asarray(mesh.vertices)[mesh.faces] + [rng.uniform(0.5, 3.0), *rng.uniform(-0.1, 0.1, 2)]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return corners[(normal * corners[:, 0]).sum(axis=1) < 0], rng


def shadowed(corners, across, points):
    """What each facet of metal returns, what the part of it returns that a half-plane's edge through the radar leaves,
    and that part's share: points on the side of `across` are seen."""
    place, weight = triangle_points(corners, points)
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    distance = np.linalg.norm(place, axis=2)
    strength = -1j / (8 * np.pi) * np.abs(np.einsum("fqi,fi->fq", place, cross)) / distance**3
    wave = strength * np.exp(-2j * WAVENUMBER * distance) * weight
    seen = place @ across > 0
    return wave.sum(axis=1), (wave * seen).sum(axis=1), seen @ weight


def test_the_estimate_holds_over_random_shadows():
    """Stated errors bound the true ones in 19 cases of 20, and are not beyond all proportion."""
    metal = Actor.from_mesh(trimesh.creation.box((1, 1, 1)), material="pec").properties
    ratios = []
    for seed in range(20):
        corners, rng = pieces(seed)
        middle = corners.reshape(-1, 3)[rng.integers(3 * len(corners))]
        across = np.cross(middle, rng.normal(size=3))
        whole, part, share = shadowed(corners, across / np.linalg.norm(across), 36)
        level = np.abs([part.sum()])
        true = np.abs((whole * share - part).sum()) / level[0]
        many, one = np.full(len(corners), 10_000), np.ones(len(corners))
        index = np.zeros(len(corners), np.int32)
        stated = sight_error(corners, share, many, one, ORIGIN, index, [metal], FREQUENCY, level)[0]
        ratios.append(true / stated)
    assert np.mean(np.array(ratios) < 1.0) >= 0.95
    assert np.median(ratios) > 0.05


@pytest.mark.parametrize("edge", [2, 4, 8, 16])
def test_rays_on_a_lattice_tell_the_share_as_well_as_said(edge):
    """Of a triangle that a line at random cuts; the estimate holds for one whose phase does not turn."""
    rng = np.random.default_rng(edge)
    fine, table = lattice(128), lattice(edge)
    flat = np.array([[0.0, 0.0], [1.0, 0.0], [0.5, 0.9]])
    errors, shares = [], []
    for _ in range(400):
        angle, through = rng.uniform(0, 2 * np.pi), rng.dirichlet(np.ones(3)) @ flat
        sides = [((points @ flat - through) @ [np.cos(angle), np.sin(angle)] > 0).mean() for points in (fine, table)]
        if 0 < sides[1] < 1:
            errors.append(sides[1] - sides[0])
            shares.append(sides[1])
    found = np.sqrt(np.mean(np.square(errors)))
    stated = missed(np.array([0.5]), np.array([edge**2]), np.ones(1), np.zeros(1))[0]
    assert stated == pytest.approx(SAMPLED * edge**-1.5)
    assert found < SAFETY * stated
    assert found > 0.2 * stated


def test_whole_facets_and_hidden_ones_miss_nothing():
    metal = Actor.from_mesh(trimesh.creation.box((1, 1, 1)), material="pec").properties
    corners, _ = pieces(3)
    share = (np.arange(len(corners)) % 2).astype(float)
    index, many = np.zeros(len(corners), np.int32), np.ones(len(corners), np.int32)
    found = sight_error(corners, share, many, np.ones(len(corners)), ORIGIN, index, [metal], FREQUENCY, np.ones(2))
    np.testing.assert_array_equal(found, [0.0, 0.0])
    half = sight_error(corners, 0.5 * share, many, np.ones(len(corners)), ORIGIN, index, [metal], FREQUENCY, np.ones(2))
    assert half[0] > 0
    assert half[1] == 0
