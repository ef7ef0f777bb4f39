"""The scene in three dimensions."""

from types import SimpleNamespace

import numpy as np
import pytest
import trimesh
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d import proj3d

from rfgen_sionna.show.actor_shapes import DecimatedMesh, actor_shapes
from rfgen_sionna.show.run_view import view_frame
from rfgen_sionna.show.scene_plot import PlotLimits, draw_scene


def record(mesh):
    return SimpleNamespace(vertices=lambda _: np.asarray(mesh.vertices, np.float32), faces=np.asarray(mesh.faces))


def test_a_dense_mesh_is_thinned_and_keeps_its_shape():
    sphere = trimesh.creation.icosphere(subdivisions=5, radius=0.5)
    coarse = DecimatedMesh.of(record(sphere), 4000)
    corners = coarse.corners(np.asarray(sphere.vertices, np.float32))
    assert 500 < len(corners) <= 4000
    thin = trimesh.Trimesh(corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3))
    assert thin.area == pytest.approx(sphere.area, rel=0.05)
    np.testing.assert_allclose(np.linalg.norm(corners, axis=-1), 0.5, atol=0.02)
    # Thinned faces still look outwards.
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert np.mean(np.einsum("fi,fi->f", normal, corners.mean(axis=1)) > 0) > 0.97


def test_a_small_mesh_stays_as_it_is():
    box = trimesh.creation.box()
    corners = DecimatedMesh.of(record(box)).corners(np.asarray(box.vertices, np.float32))
    np.testing.assert_allclose(corners, box.vertices[box.faces])


def test_the_limits_hold_radar_and_actors_and_left_is_left(run):
    shapes = actor_shapes(run)
    limits = PlotLimits.of(run, shapes)
    for place in (run.radar.position, *run.actors["ball"].vertices(3)):
        assert np.all(place >= limits.low)
        assert np.all(place <= limits.high)
    figure = Figure()
    axes = figure.add_subplot(projection="3d")
    view = view_frame(run, 0)
    draw_scene(
        figure,
        axes,
        run,
        0,
        view.cloud,
        limits=limits,
        shapes=shapes,
        speed=1.0,
    )
    figure.draw_without_rendering()
    here, left, right = (proj3d.proj_transform(2.5, y, 1.2, axes.get_proj())[0] for y in (0.0, 1.0, -1.0))
    assert left < here < right
    assert "1 moving points" in axes.get_title("right")
    np.testing.assert_allclose(view.cloud.position[0], [2.5, 1.0, 1.2], atol=0.06)
