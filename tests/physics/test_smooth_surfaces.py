"""Meshes of round things return what the round things do: dense quadrature, the Mie series, and edges left alone."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from rfgen_sionna._types import SPEED_OF_LIGHT
from rfgen_sionna.radar import Radar
from rfgen_sionna.radar.pattern import ElementPattern
from rfgen_sionna.scene import MeshActor
from rfgen_sionna.tracing.integral.facet import Nodes, facet_gains
from rfgen_sionna.tracing.integral.obliquity import Media
from rfgen_sionna.tracing.surface.quadratic_patch import QuadraticPatch, edge_sagittas
from rfgen_sionna.tracing.surface.smoothing import find_smoothing
from rfgen_sionna.tracing.tracer import Tracer

VERTICAL = np.array([0.0, 0.0, 1.0])
CONE = 0.06, 0.15
"""Radius and height [m]."""
OFTEN = (0.02, 60.5e9), (0.05, 24.1e9), (0.05, 79e9), (0.15, 77e9)
"""Radius [m] and frequency [Hz] of balls."""


def radar_at(frequency):
    """Isotropic elements in one place, a narrow band around `frequency` [Hz]."""
    radar = Radar.load("awr1843")
    wave = replace(radar.waveform, start_frequency=frequency, tx_order=(0,))
    return replace(
        radar,
        waveform=wave,
        frequency_range=None,
        pattern=ElementPattern(0.0),
        tx_positions=np.zeros((1, 3)),
        rx_positions=np.array([[0.0, 1e-4, 0.0]]),
        tx_names=radar.tx_names[:1],
        rx_names=radar.rx_names[:1],
    )


def section(mesh, material, distance, radius, frequency, seeds=(0, 1)):
    """Mean radar cross section [m^2] over orientations of the mesh, referred to the divergence R (R - a)."""
    radar, found = radar_at(frequency), []
    for seed in seeds:
        turned = mesh.copy()
        turned.apply_transform(np.block([[Rotation.random(rng=seed).as_matrix(), np.zeros((3, 1))], [0, 0, 0, 1]]))
        ball = MeshActor.from_mesh(turned, material=material, position=(distance, 0, 0), name="ball")
        paths = Tracer(None, radar, [ball], 1e-3).instant(0.0)
        turns = np.mod(paths.frequency * paths.tau[0, 0, :, 0], 1.0)
        energy = np.abs((paths.a[0, 0, :, 0] * np.exp(-2j * np.pi * turns)).sum()) ** 2
        found.append(energy * (4 * np.pi) ** 3 * (distance * (distance - radius)) ** 2 / radar.wavelength**2)
    return np.mean(found), radar.center_frequency


@pytest.mark.parametrize(
    ("radius", "frequency"),
    [
        pytest.param(a, f, marks=[] if (a, f) in OFTEN else pytest.mark.slow)
        for a in (0.01, 0.02, 0.05, 0.15, 0.5)
        for f in (24.1e9, 60.5e9, 77e9, 79e9)
        if a * f > 20 * 48e6
    ],
)
def test_a_metal_sphere_of_1280_facets_agrees_with_mie(radius, frequency):
    """0.1 dB from ka = 80 on, 0.3 dB from ka = 20 on, where physical optics itself ends; 24 … 79 GHz, 1 … 50 cm."""
    miepython = pytest.importorskip("miepython")
    mesh = trimesh.creation.icosphere(subdivisions=3, radius=radius)
    found, centre = section(mesh, "pec", max(2.0, 8 * radius), radius, frequency)
    size = 2 * np.pi * radius * centre / SPEED_OF_LIGHT
    assert size >= 20
    mie = miepython.efficiencies_mx(1.0 - 1e6j, size)[2] * np.pi * radius**2
    assert 10 * np.log10(found / mie) == pytest.approx(0.0, abs=0.1 if size >= 80 else 0.3)


@pytest.mark.parametrize("radius", [0.05, pytest.param(0.5, marks=pytest.mark.slow)])
def test_a_metal_sphere_of_320_facets_is_within_a_tenth_of_a_decibel(radius):
    """They turn by 9 degrees each, below where a mesh counts as coarse; 77 GHz."""
    miepython = pytest.importorskip("miepython")
    mesh = trimesh.creation.icosphere(subdivisions=2, radius=radius)
    found, centre = section(mesh, "pec", max(2.0, 8 * radius), radius, 77e9)
    size = 2 * np.pi * radius * centre / SPEED_OF_LIGHT
    mie = miepython.efficiencies_mx(1.0 - 1e6j, size)[2] * np.pi * radius**2
    assert 10 * np.log10(found / mie) == pytest.approx(0.0, abs=0.1)


@pytest.mark.parametrize("material", ["skin", "concrete"])
@pytest.mark.parametrize("radius", [0.05, pytest.param(0.3, marks=pytest.mark.slow)])
def test_spheres_of_skin_and_concrete_against_metal(material, radius):
    """The ratio to metal is that of the Mie series within 0.3 dB, at 77 GHz."""
    miepython = pytest.importorskip("miepython")
    mesh = trimesh.creation.icosphere(subdivisions=3, radius=radius)
    found, centre = section(mesh, material, 3.0, radius, 77e9, seeds=(0,))
    metal, _ = section(mesh, "pec", 3.0, radius, 77e9, seeds=(0,))
    size = 2 * np.pi * radius * centre / SPEED_OF_LIGHT
    ball = MeshActor.from_mesh(mesh, material=material)
    index = np.sqrt(complex(ball.properties.relative_permittivity(centre)))
    mie = miepython.efficiencies_mx(index.real - 1j * abs(index.imag), size)[2]
    of_metal = miepython.efficiencies_mx(1.0 - 1e6j, size)[2]
    assert 10 * np.log10(found / metal) == pytest.approx(10 * np.log10(mie / of_metal), abs=0.3)


def dense(corners, sagittas, frequency, points=60):
    """Physical optics of a metal patch, quadratic over a triangle, monostatic at the origin, by Gauss's rule.

    `sagittas` (3, 3) are those of the middles of its edges; its normals come from its tangents, by differences.
    """
    node, weight = np.polynomial.legendre.leggauss(points)
    node, weight = 0.5 * (node + 1), 0.5 * weight
    u, v = (each.ravel() for each in np.meshgrid(node, node, indexing="ij"))
    area = (2.0 * u * np.outer(weight, weight).ravel()) * 0.5

    def place(second, third):
        first = 1 - second - third
        flat = np.stack([first, second, third], axis=-1) @ corners
        return flat + 4 * np.stack([second * third, third * first, first * second], axis=-1) @ sagittas

    second, third, step = u * (1 - v), u * v, 1e-5
    point = place(second, third)
    along = (place(second + step, third) - place(second - step, third)) / (2 * step)
    across = (place(second, third + step) - place(second, third - step)) / (2 * step)
    normal = np.cross(along, across)
    distance = np.linalg.norm(point, axis=1)
    k = 2 * np.pi * frequency / SPEED_OF_LIGHT
    towards = -np.einsum("qi,qi->q", normal, point) / distance  # cos times the area element
    return 1j / (4 * np.pi) * (area * -np.abs(towards) / distance**2 * np.exp(-2j * k * distance)).sum()


@pytest.mark.parametrize("parts", [2, 4])
@pytest.mark.parametrize("seed", range(6))
def test_a_curved_facet_agrees_with_dense_quadrature(seed, parts):
    """Facets of half a centimetre with curvature radii from 5 cm on, at 77 GHz, to either side and saddles among them:
    within 1 % of what the flat facet would return at most, falling with the parts."""
    rng = np.random.default_rng(seed)
    frequency, edge = 77e9, 6e-3
    corners = np.array([[0, 0, 0], [0, edge, 0], [0, 0.4 * edge, 0.9 * edge]]) + np.array([0.8, 0.02 * seed, 0.05])
    patch = rng.uniform(-20, 20, (2, 2))  # curvatures [1/m]
    offset = corners[:, 1:] - corners.mean(axis=0)[1:]
    slope = offset @ (0.5 * (patch + patch.T)) + np.tan(rng.uniform(-0.5, 0.5, 2))
    normals = np.column_stack([-np.ones(3), slope])
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    tilt = Rotation.align_vectors(np.cross(*(corners[1:] - corners[0]))[None], -normals.mean(axis=0)[None])[
        0
    ].as_matrix()
    normals = normals @ tilt.T
    one = np.ones(1)
    media = Media(np.full((1, 1), complex(np.inf)), np.ones((1, 1)), np.inf * one, one)
    nodes = Nodes(np.zeros((1, 3)), np.zeros((1, 3)), frequency * one)
    found = facet_gains(
        corners[None],
        np.zeros(1, np.int32),
        media,
        nodes,
        VERTICAL,
        VERTICAL,
        np.array([parts], np.int32),
        monostatic=True,
        patch=QuadraticPatch(edge_sagittas(corners[None], normals[None])),
    )
    gain = found.a[0, 0] * np.exp(-2j * np.pi * np.mod(frequency * found.tau[0, 0], 1.0))
    truth = dense(corners, edge_sagittas(corners[None], normals[None])[0], frequency)
    most = 0.5 * np.linalg.norm(np.cross(*(corners[1:] - corners[0]))) / (4 * np.pi * 0.8**2)
    assert abs(gain - truth) < 1e-2 * most


@pytest.mark.parametrize(
    "mesh",
    [
        trimesh.creation.box((0.5, 0.4, 0.3)),
        trimesh.creation.box((0.5, 0.4, 0.3)).subdivide().subdivide(),
        trimesh.creation.icosahedron(),
        trimesh.Trimesh([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], [[0, 1, 2], [0, 2, 3]]),
    ],
)
def test_boxes_plates_and_crystals_have_nothing_smooth(mesh):
    assert find_smoothing(np.asarray(mesh.vertices), np.asarray(mesh.faces)) is None


def test_a_cylinder_is_round_around_and_flat_at_its_ends():
    """Normals on the side point away from the axis, those of the caps along it; it rises by a circle's sagitta."""
    mesh = trimesh.creation.cylinder(0.1, 0.3, sections=48)
    vertices, faces = np.asarray(mesh.vertices), np.asarray(mesh.faces)
    smooth = find_smoothing(vertices, faces)
    normals = smooth.normals(vertices, faces)
    cap = np.abs(mesh.face_normals[:, 2]) > 0.5
    np.testing.assert_allclose(normals[cap], np.repeat(mesh.face_normals[cap, None], 3, axis=1), atol=1e-12)
    radial = vertices[faces[~cap]] * [1, 1, 0]
    np.testing.assert_allclose(normals[~cap], radial / 0.1, atol=1e-12)
    sagittas = np.linalg.norm(edge_sagittas(vertices[faces], normals), axis=2)
    np.testing.assert_allclose(sagittas[cap], 0.0, atol=1e-15)
    # Of a side's triangle one edge is straight; a chord and the diagonal span one section each.
    np.testing.assert_allclose(np.sort(sagittas[~cap], axis=1)[:, 0], 0.0, atol=1e-15)
    np.testing.assert_allclose(np.sort(sagittas[~cap], axis=1)[:, 1], 0.1 * (1 - np.cos(np.pi / 48)), rtol=1e-9)


def test_neighbours_rise_alike_on_a_shared_edge():
    """The smooth surface has no gaps: both faces of an edge lift its middle to the same point, on a deformed ball."""
    mesh = trimesh.creation.icosphere(subdivisions=3, radius=0.1)
    vertices = np.asarray(mesh.vertices) * (1 + 0.2 * np.sin(30 * np.asarray(mesh.vertices)))
    faces = np.asarray(mesh.faces)
    sagittas = edge_sagittas(vertices[faces], find_smoothing(vertices, faces).normals(vertices, faces))
    opposite = np.stack([np.sort(faces[:, [(i + 1) % 3, (i + 2) % 3]], axis=1) for i in range(3)], axis=1)
    order = np.lexsort(opposite.reshape(-1, 2).T)
    pairs = sagittas.reshape(-1, 3)[order].reshape(-1, 2, 3)
    np.testing.assert_allclose(pairs[:, 0], pairs[:, 1], atol=1e-15)
    assert np.abs(pairs).max() > 1e-5


@pytest.mark.parametrize("kind", [np.int32, np.int64])
def test_faces_bend_as_their_normals_say(kind):
    """By Dr.Jit as by NumPy, all faces or some, of a deformed ball with a cylinder, whose caps are flat, beside it."""
    ball, cylinder = trimesh.creation.icosphere(subdivisions=3, radius=0.1), trimesh.creation.cylinder(0.1, 0.3)
    round_ones = np.asarray(ball.vertices) * (1 + 0.2 * np.sin(30 * np.asarray(ball.vertices)))
    vertices = np.concatenate([round_ones, np.asarray(cylinder.vertices) + np.array([1.0, 0, 0])])
    faces = np.concatenate([np.asarray(ball.faces), np.asarray(cylinder.faces) + len(round_ones)]).astype(kind)
    smooth = find_smoothing(vertices, faces)
    expected = edge_sagittas(vertices[faces], smooth.normals(vertices, faces))
    found = smooth.patch(vertices, faces).sagittas
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-16)
    assert np.abs(expected).max() > 1e-4
    for any_visible in (np.arange(1, len(faces), 3), np.zeros(0, np.intp)):
        some = smooth.patches([vertices], faces, any_visible)[0].sagittas
        np.testing.assert_allclose(some[any_visible], found[any_visible], rtol=0, atol=1e-16)
        assert not np.delete(some, any_visible, axis=0).any()


def cone_return(radar, actor, n=400):
    """Dense quadrature of physical optics over a cone's exact side, for the first pair."""
    radius, height = CONE
    place, turn = actor.pose(0.0)
    node, weight = np.polynomial.legendre.leggauss(n)
    along, azimuth = 0.5 * (node + 1), (np.arange(4 * n) + 0.5) * np.pi / (2 * n)
    s, ring = np.meshgrid(along, azimuth, indexing="ij")
    points = np.stack([radius * s * np.cos(ring), radius * s * np.sin(ring), height * (1 - s)], axis=-1) @ turn.T
    slope = np.arctan(radius / height)
    normals = np.stack([np.cos(ring) * np.cos(slope), np.sin(ring) * np.cos(slope), 0 * s + np.sin(slope)], axis=-1)
    area = (0.5 * weight * along * radius * np.hypot(radius, height))[:, None] * (np.pi / (2 * n))
    legs = [points + place - end for end in (radar.tx_world[0], radar.rx_world[0])]
    reach = [np.linalg.norm(leg, axis=-1) for leg in legs]
    cos = -sum(np.einsum("abi,abi->ab", normals @ turn.T, leg) / r for leg, r in zip(legs, reach, strict=True)) / 2
    k = 2 * np.pi * radar.center_frequency / SPEED_OF_LIGHT
    values = np.maximum(cos, 0.0) * np.exp(-1j * k * (reach[0] + reach[1])) / (reach[0] * reach[1])
    return -1j / (4 * np.pi) * (values * area).sum()


@pytest.mark.parametrize("sections", [32, pytest.param(64, marks=pytest.mark.slow)])
def test_the_sides_of_a_cone_are_straight(sections):
    """A cone of one ring of faces, seen square to its side: within 0.3 dB of quadrature; with a mean normal at its tip
    its sides bulged, 6 dB off."""
    radar = radar_at(77e9)
    mesh = trimesh.creation.cone(*CONE, sections=sections)
    aslant = -float(np.arctan(CONE[0] / CONE[1]))
    cone = MeshActor.from_mesh(mesh, material="pec", position=(1.5, 0, -0.07), orientation=(0, aslant, 0), name="cone")
    paths = Tracer(None, radar, [cone], 1e-2).instant(0.0)
    turns = np.mod(paths.frequency * paths.tau[..., 0], 1.0)
    found = (paths.a[..., 0] * np.exp(-2j * np.pi * turns)).sum(axis=2)[0, 0]
    assert abs(20 * np.log10(abs(found / cone_return(radar, cone)))) < 0.3


def test_tips_are_those_of_cones_alone():
    """All corners at the tip of a cone have normals of their own, and none of what is round, however it is meshed."""
    cone = trimesh.creation.cone(*CONE)
    faces = np.asarray(cone.faces)
    group = find_smoothing(np.asarray(cone.vertices), faces).group
    tip = faces == np.argmax(np.asarray(cone.vertices)[:, 2])
    assert len(np.unique(group[tip])) == tip.sum() == 32
    for mesh in (
        trimesh.creation.icosphere(2), trimesh.creation.uv_sphere(count=[12, 16]), trimesh.creation.torus(0.3, 0.1),
        trimesh.creation.capsule(), trimesh.creation.icosphere(3).apply_scale([1, 1, 3]),
    ):  # fmt: skip
        assert len(np.unique(find_smoothing(np.asarray(mesh.vertices), np.asarray(mesh.faces)).group)) == len(
            mesh.vertices
        )
