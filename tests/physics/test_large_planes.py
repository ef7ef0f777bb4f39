"""Large flat faces by the edges of what is seen of them, against fine facets."""

import numpy as np
import pytest
import trimesh

from rfgen_sionna.frame_loop import sum_paths
from rfgen_sionna.radar import Radar
from rfgen_sionna.scene import MeshActor
from rfgen_sionna.simulation import Simulator
from rfgen_sionna.tracing.integral.patch_gains import patch_gains
from rfgen_sionna.tracing.integral.polygon import edge_gains
from rfgen_sionna.tracing.static.cell_edges import divide, outlines, towards
from rfgen_sionna.tracing.static.flat_cells import find_cells
from tests.physics.test_moving_radar_ghosts import scene_with_mesh

METAL, CONCRETE = complex(np.inf), 5.2 - 0.3j


def media(permittivity):
    conductor = not np.isfinite(permittivity)
    value = 1.0 if conductor else permittivity
    return np.array([[[np.real(value), np.imag(value), 1.0, 0.0, -1.0, 1.0, float(conductor)]]])


def rectangle(sides, turn, offset, height):
    """Two triangles in the plane z = -height [m] of a rectangle whose middle is at `offset`."""
    x, y = 0.5 * np.array(sides)
    rotation = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    points = np.array([[-x, -y], [x, -y], [x, y], [-x, y]]) @ rotation + offset
    points = np.c_[points, np.full(4, -height)]
    return np.stack([points[[0, 1, 2]], points[[0, 2, 3]]])


def of_facets(corners, wavenumber, fields, permittivity):
    """Gain of triangles (facet, 3, 3) as they are, in fine pieces."""
    count = len(corners)
    points, faces = np.ascontiguousarray(corners.reshape(-1, 3)), np.arange(3 * count, dtype=np.int32).reshape(-1, 3)
    gains, centroids, index = np.empty((1, count), complex), np.empty((count, 3)), np.arange(count)
    patch_gains(
        points, faces, np.full((count, 3), -1, np.int32), np.zeros((1, 3)), index.astype(np.int32), np.zeros((0, 3, 3)),
        index, np.ones(count), np.full(count, -1, np.int32), np.zeros((0, 2, 3, 3)), np.zeros(0, np.int32),
        np.zeros(count, np.int32), np.zeros(count, np.bool_), np.r_[np.zeros(6), wavenumber][None], fields,
        media(permittivity), False, 0.05, 0.0, np.zeros((0, 3)), gains, centroids,
    )  # fmt: skip
    return (gains[0] * np.exp(-2j * wavenumber * np.linalg.norm(centroids, axis=1))).sum()


def halved(corners):
    """Each triangle in four."""
    a, b, c = np.moveaxis(corners, 1, 0)
    d, e, f = 0.5 * (b + c), 0.5 * (c + a), 0.5 * (a + b)
    return np.concatenate([np.stack(each, axis=1) for each in ((a, f, e), (f, b, d), (e, d, c), (d, e, f))])


def of_edges(corners, wavenumber, fields, permittivity):
    normal = towards(corners)
    segments = divide(outlines(corners, np.zeros(len(corners), np.int32)), normal, wavenumber, 0.0, 0.3)
    gains = np.empty((1, len(segments.cell)), complex)
    edge_gains(
        segments.start, segments.stop, normal[segments.cell], np.zeros(len(segments.cell), np.int32),
        np.r_[np.zeros(6), wavenumber][None], fields, media(permittivity), False, np.zeros((0, 3)), gains,
    )  # fmt: skip
    return (gains[0] * np.exp(-2j * wavenumber * np.linalg.norm(segments.middle, axis=1))).sum()


@pytest.mark.parametrize("frequency", [24e9, 77e9])
@pytest.mark.parametrize("permittivity", [METAL, CONCRETE], ids=["metal", "concrete"])
@pytest.mark.parametrize("height", [0.5, 2.0, 6.0])
def test_a_plate_aside_returns_by_its_edges(frequency, permittivity, height):
    """Foot point outside, also some Fresnel zones only: within 0.2 dB of fine facets, though edges and corners are all
    that a plate returns there."""
    wavenumber = 2 * np.pi * frequency / 299_792_458
    for turn, aside in ((0.0, 1.0), (0.5, 2.0), (1.1, 0.7)):
        fields = np.tile([0.0, 0.0, 1.0] if turn else [0.0, 1.0, 0.0], (2, 1))
        corners = rectangle((0.5, 0.3), turn, (0.25 + aside * max(height, 1.0) ** 0.5, 0.1), height)
        fine = corners
        for _ in range(6 if frequency < 50e9 else 8):
            fine = halved(fine)
        found, expected = (
            of(each, wavenumber, fields, permittivity) for of, each in ((of_edges, corners), (of_facets, fine))
        )
        assert abs(found / expected - 1) < 0.023


@pytest.mark.parametrize(
    "offset", [(0.0, 0.0), (0.9, 0.0), (1.0, 0.7), (1.3, 0.2)], ids=["inside", "near", "on", "outside"]
)
@pytest.mark.parametrize(("frequency", "permittivity"), [(24e9, METAL), (77e9, METAL), (77e9, CONCRETE)])
def test_a_plate_in_cells_is_the_same(offset, frequency, permittivity):
    """Foot point in the middle, close to an edge, on a corner and outside: facets around it and edges of cells beyond,
    within 0.1 dB."""
    wavenumber, fields = 2 * np.pi * frequency / 299_792_458, np.tile([0.0, 1.0, 0.0], (2, 1))
    corners = rectangle((2.0, 1.4), 0.0, offset, 1.5)
    cells = find_cells(corners, np.arange(2), wavenumber, 0.0, np.inf, 0.0, 0.0)
    area = np.linalg.norm(np.cross(*np.moveaxis(cells.corners[:, 1:] - cells.corners[:, :1], 1, 0)), axis=1).sum() / 2
    assert area == pytest.approx(2.0 * 1.4)
    assert cells.visible.any()
    rest = cells.corners[~cells.visible]
    fine = corners
    for _ in range(7):
        fine = halved(fine)
    expected = of_facets(fine, wavenumber, fields, permittivity)
    found = of_edges(cells.corners[cells.visible], wavenumber, fields, permittivity)
    found += of_facets(halved(halved(rest)), wavenumber, fields, permittivity)
    assert abs(found / expected - 1) < 0.012


def test_edges_between_cells_cancel():
    """However unequal they are: the outline of cells is that of their union, and closed."""
    corners = rectangle((2.0, 1.4), 0.3, (0.4, 0.0), 1.5)
    cells = find_cells(corners, np.arange(2), 1600.0, 0.0, np.inf, 0.0, 0.0)
    own = cells.corners[cells.visible]
    found = outlines(own, np.zeros(len(own), np.int32))
    assert len(found.cell) < 3 * len(own)
    np.testing.assert_allclose((found.stop - found.start).sum(axis=0), 0.0, atol=1e-9)
    area = 0.5 * np.cross(found.start, found.stop)[:, 2].sum()
    assert area == pytest.approx(
        np.linalg.norm(np.cross(own[:, 1] - own[:, 0], own[:, 2] - own[:, 0]), axis=1).sum() / 2
    )


def test_cells_are_wholly_visible():
    """A plate before a wall hides a part: cells of the wall are beside it, nothing behind it is left, and what is
    in the plane of a cell or behind it hides nothing."""
    wall = np.array([[[5.0, -3, -3], [5, 3, -3], [5, 3, 3]], [[5, -3, -3], [5, 3, 3], [5, -3, 3]]])
    plate = 0.3 * wall * [1.0, 1 / 3, 1 / 3] + [1.0, 0, 0]  # half of its extent on the wall's plane
    behind, beside = wall + np.array([0.5, 0, 0]), wall + np.array([0, 6.0, 0])
    cells = find_cells(np.concatenate([wall, plate, behind, beside]), np.arange(2), 1600.0, 0.0, np.inf, 0.0, 0.0)
    shadow = 0.3 * 5.0 / 2.5
    inside = (np.abs(cells.corners[..., 1:]) < shadow - 1e-9).all(axis=2)
    assert not inside[cells.visible].any()
    open_area = 36.0 - (2 * shadow) ** 2
    area = 0.5 * np.linalg.norm(np.cross(*np.moveaxis(cells.corners[:, 1:] - cells.corners[:, :1], 1, 0)), axis=1)
    assert area[cells.visible].sum() > 0.8 * open_area
    assert open_area - 1e-9 < area.sum() < open_area + 0.6


def street(length):
    """A floor, two walls and a box before one of them [m]."""
    floor = trimesh.creation.box(
        (length, 4.0, 0.1), trimesh.transformations.translation_matrix((0.5 * length, 0, -0.05))
    )
    sides = [
        trimesh.creation.box((length, 0.2, 2.5), trimesh.transformations.translation_matrix((0.5 * length, y, 1.25)))
        for y in (-2.1, 2.1)
    ]
    crate = trimesh.creation.box((0.5, 0.5, 0.8), trimesh.transformations.translation_matrix((2.0, 1.2, 0.4)))
    return trimesh.util.concatenate([floor, *sides, crate])


@pytest.mark.slow
def test_a_street_is_the_same_by_fine_facets():
    """Static samples, and what an actor hides of them, within the tolerance of the static level."""
    radar, rtol = Radar.load("awr1843", "mmmesh", position=(0.2, 0.1, 0.8), look_at=(3, 0.4, 0.7)), 0.02
    actor = {"position": (2.4, -0.3, 0.55), "velocity": (0.5, 0.3, 0)}
    box = MeshActor.from_mesh(trimesh.creation.box((0.3, 0.5, 1.0)), material="skin", name="box", **actor)
    found = []
    for tolerance in (rtol, 0.25 * rtol):  # by edges, and by facets and rays
        sim = Simulator(scene_with_mesh(street(6.0)), radar, [box], rtol=tolerance)
        trace, instant = sim.tracer.trace(0.0, radar.waveform.frame_length), sim.paths()
        instant = instant.select(instant.object_id == 0)
        parts = (trace.static,), tuple(each.paths for each in trace.shadows), (instant,)
        found.append([sum_paths(sim.radar, each, 0.0, 1, 1e-4, None, "cpu")[0] for each in parts])
        assert (sim.tracer.static.cells is not None) == (tolerance == rtol)

    def level(samples):
        return np.sqrt((np.abs(samples) ** 2).mean())

    edges, facets = found
    for one, other in zip(edges, facets, strict=True):
        assert level(one - other) < rtol * level(facets[0])
    static, shadow, instant = edges
    assert level(static + shadow - instant) < rtol * level(static)
