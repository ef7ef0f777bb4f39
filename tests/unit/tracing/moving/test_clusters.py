"""Patches of small facets: connected, compact, the same wherever the mesh is; and what a mesh returns through them."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from rfgen_sionna._types import SPEED_OF_LIGHT
from rfgen_sionna.radar import Radar
from rfgen_sionna.radar.pose import rotation_matrix
from rfgen_sionna.scene import MeshActor
from rfgen_sionna.scene.materials import MATERIALS
from rfgen_sionna.signal import synthesize
from rfgen_sionna.tracing.moving import clusters as patches
from rfgen_sionna.tracing.moving.clusters import cluster_heads, max_cluster_width
from rfgen_sionna.tracing.tracer import Tracer

RTOL = 1e-2


def uneven(radius=0.15):
    """A ball with faces ten times smaller on one side, which is partly visible."""
    mesh = trimesh.creation.icosphere(subdivisions=5)
    vertices = np.asarray(mesh.vertices) + 0.85 * np.array([-0.6, 0.64, 0.48])
    vertices *= radius / np.linalg.norm(vertices, axis=1)[:, None]
    return vertices, np.asarray(mesh.faces, np.int32)


@pytest.fixture(scope="module")
def ball():
    return uneven()


def lead(vertices, faces, parts=None, most=1.0):
    parts = np.zeros(len(faces), np.int32) if parts is None else parts
    return cluster_heads(vertices, faces, parts, np.arange(len(faces)), most, RTOL)


def test_clusters_are_connected_and_small(ball):
    vertices, faces = ball
    cluster_head = lead(vertices, faces, most=0.02)
    width = 0.02
    assert (cluster_head[cluster_head] == cluster_head).all()  # who leads is of the patch
    assert len(np.unique(cluster_head)) < 0.6 * len(faces)
    centres = vertices[faces].mean(axis=1)
    edges = np.linalg.norm(vertices[faces] - vertices[faces][:, [1, 2, 0]], axis=2).max(axis=1)
    alone = np.bincount(cluster_head, minlength=len(faces))[cluster_head] == 1
    assert alone[edges >= width].all()
    assert np.linalg.norm(centres - centres[cluster_head], axis=1).max() <= np.sqrt(3) * width
    # Faces of one patch are joined by edges within it.
    neighbours = trimesh.graph.face_adjacency(faces)
    within = neighbours[cluster_head[neighbours[:, 0]] == cluster_head[neighbours[:, 1]]]
    links = coo_array((np.ones(len(within)), within.T), shape=(len(faces),) * 2)
    assert connected_components(links, directed=False)[0] == len(np.unique(cluster_head))


def test_clusters_stay_within_a_body_part(ball):
    vertices, faces = ball
    parts = (vertices[faces].mean(axis=1)[:, 1] > 0).astype(np.int32)
    cluster_head = lead(vertices, faces, parts)
    assert (parts[cluster_head] == parts).all()
    assert len(np.unique(cluster_head)) > len(np.unique(lead(vertices, faces)))


def test_clusters_do_not_depend_on_the_pose(ball):
    """Rotated and 10 km away, except for centres within a nanometre of a cell boundary."""
    vertices, faces = ball
    moved = vertices @ rotation_matrix((0.3, -0.8, 1.9)).T + [1e4, -3e3, 20.0]
    assert np.mean(lead(vertices, faces) != lead(moved, faces)) < 0.01


def test_equal_faces_stay_alone():
    sphere = trimesh.creation.icosphere(subdivisions=4, radius=0.2)
    faces = np.asarray(sphere.faces, np.int32)
    assert (lead(np.asarray(sphere.vertices), faces) == np.arange(len(faces))).all()
    assert (cluster_heads(np.asarray(sphere.vertices), faces, np.zeros(len(faces), np.int32), np.arange(0), 1.0, RTOL)
            == np.arange(len(faces))).all()  # fmt: skip


def test_largest_width():
    """A wider band or array, a nearer mesh or a smaller tolerance narrows the clusters."""
    reference_level = max_cluster_width(77e9, 1.8e9, 8e-3, 3.0, RTOL)
    assert 5e-3 < reference_level < 20e-3
    assert max_cluster_width(77e9, 3.6e9, 8e-3, 3.0, RTOL) == pytest.approx(0.5 * reference_level)
    assert max_cluster_width(77e9, 1.8e9, 0.2, 3.0, RTOL) < reference_level
    assert max_cluster_width(77e9, 1.8e9, 0.2, 1.5, RTOL) == pytest.approx(
        0.5 * max_cluster_width(77e9, 1.8e9, 0.2, 3.0, RTOL)
    )
    assert max_cluster_width(77e9, 1.8e9, 8e-3, 3.0, 1e-4 * RTOL) == pytest.approx(0.1 * reference_level)


@pytest.mark.parametrize(
    ("name", "preset", "rtol", "turns"),
    [
        ("awr1843", "mmmesh", 4e-3, 0.5),
        ("awr1843", "mmmesh", 4e-3, 8.0),
        ("awr1843", "mmmesh", 1e-3, 2.0),
        ("position2go", None, 4e-3, 2.0),
    ],
)
def test_clusters_return_the_sum_of_their_facets(ball, name, preset, rtol, turns, monkeypatch):
    """Balls at 3 m/s with so many turns a second: samples of a frame are those with a path for every facet, to four
    tenths of the tolerance: 0.2 for the expansion (SLOPED), 0.3 for the spline in time (PATCHED_PER_RTOL)."""
    radar = Radar.load(name, preset) if preset else Radar.load(name)
    radar = replace(radar, waveform=replace(radar.waveform, num_loops=min(32, radar.waveform.num_loops)))

    def spinning(t):
        return (1.5, -0.2 + 3.0 * t, 0.1), (2 * np.pi * turns * t, 0.0, 0.3)

    actor = MeshActor.from_mesh(ball, material="skin", name="ball", trajectory=spinning)
    together, found = samples_of(radar, actor, rtol)
    monkeypatch.setattr(patches, "CLUSTER_SHARE", 0.0)
    apart, wanted = samples_of(radar, actor, rtol)
    assert together < 0.8 * apart
    assert np.linalg.norm(found - wanted) < 0.4 * rtol * np.linalg.norm(wanted)


def samples_of(radar, actor, rtol):
    traced = Tracer(None, radar, [actor], rtol).trace(0.0, radar.waveform.frame_length)
    return traced.moving.num_paths, synthesize(radar, traced.moving, 0.0, eps=1e-2 * rtol, device="cpu")


@pytest.mark.parametrize("scattering", [0.6, 1.0])
def test_facets_of_rough_surfaces_stay_alone(ball, scattering, monkeypatch):
    """Each facet has a phase of its own over the band."""
    radar = Radar.load("awr1843", "mmmesh")
    radar = replace(radar, waveform=replace(radar.waveform, num_loops=8))
    material = replace(MATERIALS["skin"], name="rough", scattering_coefficient=scattering)
    actor = MeshActor.from_mesh(ball, material=material, name="ball", position=(1.5, 0, 0), velocity=(1.0, 0.5, 0))
    count, found = samples_of(radar, actor, RTOL)
    monkeypatch.setattr(patches, "CLUSTER_SHARE", 0.0)
    assert samples_of(radar, actor, RTOL)[0] == count
    assert np.array_equal(samples_of(radar, actor, RTOL)[1], found)


def test_at_a_single_time_each_facet_has_its_own_doppler(ball):
    """A path has one delay rate at a single time, but facets two centimetres apart on a spinning body differ."""
    radar = Radar.load("awr1843", "mmmesh")
    actor = MeshActor.from_mesh(
        ball, material="skin", name="ball", trajectory=lambda t: ((1.5, 0.0, 0.0), (20.0 * t, 0.0, 0.0))
    )
    traced = Tracer(None, radar, [actor], RTOL)
    paths = traced.instant(0.1)
    centre = np.array([1.5, 0.0, 0.0])
    across = np.cross([0.0, 0.0, 20.0], traced.trace(0.1, 0.1).places(0.1) - centre)
    wanted = (across * paths.direction[:, 0]).sum(axis=1)
    rate = paths.tau_rate[0, 0, :, 0] * SPEED_OF_LIGHT / 2
    assert np.abs(rate - wanted).max() < 0.05  # elements are up to 6 mm off the radar's middle
    assert len(np.unique(paths.facet)) == paths.num_paths
