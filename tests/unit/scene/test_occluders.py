"""Occluders of several times together hide the same points as those of one time each."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from rfgen_sionna.scene.occluders import possible_occluders
from rfgen_sionna.scene.rays import RayScene

BALL = trimesh.creation.icosphere(subdivisions=3, radius=0.3)
ROD = trimesh.creation.cylinder(radius=0.03, height=1.2, sections=12)
POST = trimesh.creation.box((0.05, 0.1, 3.0))
FACES = [np.asarray(each.faces, np.int32) for each in (BALL, ROD)]
VIEWPOINT = np.array([-3.0, 0.2, 0.1])


def placed(t: float) -> list[np.ndarray]:
    """A ball that turns on the spot, before it a rod that swings."""
    turn = trimesh.transformations.rotation_matrix(t, [0, 0, 1])
    rod = trimesh.transformations.rotation_matrix(4 * t, [1, 0, 0])
    rod[:3, 3] = [-0.8, np.sin(3 * t) * 0.3, 0.0]
    return [trimesh.transform_points(each.vertices, to) for each, to in ((BALL, turn), (ROD, rod))]


def occluders_of(rays, vertices, corners):
    """Behind all faces that come before the facets."""
    found = possible_occluders(
        rays.moving_faces, [np.concatenate(each) - VIEWPOINT for each in vertices], corners - VIEWPOINT
    )
    return rays.occluders(VIEWPOINT, vertices, [found] * len(vertices), corners)


@pytest.mark.usefixtures("kernels")
@pytest.mark.parametrize("post", [False, True])
@pytest.mark.parametrize("moving", [False, True])
def test_what_is_seen_at_several_times_is_what_each_time_shows(post: bool, moving: bool):
    static = [(POST.vertices + np.array([-0.5, 0.1, 0]), POST.faces)] if post else []
    rays = RayScene(static, list(zip(placed(0.0), FACES, strict=True)), origin=VIEWPOINT)
    times = np.linspace(0.0, 0.5, 7)
    first = rays.num_facets - len(FACES[0]) - len(FACES[1])
    rng = np.random.default_rng(0)
    face = rng.permutation(len(FACES[0]))[:200]
    corners = np.stack([placed(t)[0][FACES[0][face]] for t in times])
    of, places = rng.integers(0, len(face), 1500), rng.dirichlet(np.ones(3), 1500)

    occluders = occluders_of(rays, [placed(t) for t in times], corners)
    number = occluders.numbered(first + face.astype(np.int32), len(times))
    together = occluders.targets(VIEWPOINT, corners.reshape(-1, 3, 3), number, moving)
    every = (len(face) * np.arange(len(times))[:, None] + of).ravel()
    found = together.visible(every, np.tile(places, (len(times), 1))).reshape(len(times), -1)

    for k, t in enumerate(times):
        rays.update(placed(t))
        alone = rays.targets(VIEWPOINT, corners[k], first + face, moving).visible(of, places)
        # Rays within 1e-5 of an edge may fall on either side of it: coordinates are float32.
        assert np.count_nonzero(found[k] != alone) <= 2
    assert 0.1 < found.mean() < 0.6
    assert len(np.unique(found.sum(axis=1))) > 3


@pytest.mark.usefixtures("kernels")
@pytest.mark.parametrize("post", [False, True])
def test_what_rays_hit_first_is_what_each_time_shows(post: bool):
    """All around, and along and across the axis along which times stand side by side; among all faces."""
    static = [(POST.vertices + np.array([-0.5, 0.1, 0]), POST.faces)] if post else []
    rays = RayScene(static, list(zip(placed(0.0), FACES, strict=True)), origin=VIEWPOINT)
    times = np.linspace(0.0, 0.5, 9)
    every = [np.arange(len(FACES[0]) + len(FACES[1]))] * len(times)
    occluders = rays.occluders(VIEWPOINT, [placed(t) for t in times], every)
    rng = np.random.default_rng(1)
    cone = np.array([3.0, 0, 0]) + rng.normal(size=(3000, 3)) * 0.4
    directions = np.concatenate([cone, rng.normal(size=(2000, 3)), np.eye(3), -np.eye(3), np.eye(3) + 1e-12])
    count = len(directions)
    found = occluders.first_facet(np.tile(directions, (len(times), 1)), np.repeat(np.arange(len(times)), count))
    for k, t in enumerate(times):
        rays.update(placed(t))
        alone = rays.first_facet(VIEWPOINT, directions)
        # Rays within 1e-5 of an edge may fall on either side of it: coordinates are float32.
        assert np.count_nonzero(found[count * k : count * (k + 1)] != alone) <= 3
    assert 0.1 < (found >= 0).mean() < 0.8


def test_looks_are_from_one_place():
    rays = RayScene([], list(zip(placed(0.0), FACES, strict=True)), origin=VIEWPOINT)
    corners = placed(0.0)[0][FACES[0][:5]][None]
    occluders = occluders_of(rays, [placed(0.0)], corners)
    with pytest.raises(ValueError, match="viewpoint"):
        occluders.targets(VIEWPOINT + 0.1, corners[0], occluders.numbered(np.arange(5, dtype=np.int32), 1))


def test_the_same_kernel_serves_all_looks():
    """However many the times and the faces that come before, nothing is compiled anew."""
    import drjit as dr

    def look(count: int, some: slice) -> None:
        times = np.linspace(0.0, 0.3, count)
        corners = np.stack([placed(t)[0][FACES[0][some]] for t in times])
        occluders = occluders_of(rays, [placed(t) for t in times], corners)
        number = occluders.numbered(np.arange(len(FACES[0]), dtype=np.int32)[some], count)
        occluders.targets(VIEWPOINT, corners.reshape(-1, 3, 3), number).visible(
            np.arange(len(number)), np.full((len(number), 3), 1 / 3)
        )

    rays = RayScene([], list(zip(placed(0.0), FACES, strict=True)), origin=VIEWPOINT)
    look(3, slice(0, 40))
    dr.kernel_history_clear()
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        look(5, slice(0, 200))
        look(9, slice(100, 130))
        history = dr.kernel_history([dr.KernelType.JIT])
    assert history
    assert all(entry["cache_hit"] for entry in history)


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 2**31), size=st.floats(0.01, 3.0), count=st.integers(1, 12))
def test_no_face_that_comes_before_is_left_out(seed: int, size: float, count: int):
    """Random triangles that fly by, against rays to random points on facets at all times: whatever they hit first is
    among those chosen, and faces far beside and behind are not."""
    rng = np.random.default_rng(seed)
    points, speed = rng.normal(size=(90, 3)) * 2.0, rng.normal(size=(90, 3)) * 0.1
    faces = np.arange(90, dtype=np.uint32).reshape(-1, 3)
    points = points[0::3].repeat(3, axis=0) + rng.normal(size=(90, 3)) * size
    vertices = [points + speed * t for t in np.linspace(0.0, 1.0, count)]
    middle = rng.normal(size=3) * 3.0
    corners = np.stack([middle + rng.normal(size=(5, 3, 3)) * 0.1] * count)
    chosen = possible_occluders(faces, vertices, corners)
    for k in range(count):
        targets = np.einsum("rc,rci->ri", rng.dirichlet(np.ones(3), 40), corners[k][rng.integers(0, 5, 40)])
        # What a ray meets at so much of the way, of the plane of each face: w . corners = share * target.
        planes = np.linalg.inv(vertices[k][faces.astype(np.intp)])
        along = np.einsum("ri,fij->rfj", targets, planes)
        total = along.sum(axis=2)
        hit = (along >= 0).all(axis=2) & (total > 1.0)  # the face is met at 1 / total of the way
        assert np.isin(np.flatnonzero(hit.any(axis=0)), chosen).all()


def test_faces_beside_and_behind_are_left_out():
    around = trimesh.creation.icosphere(subdivisions=4, radius=3.0)
    ball = BALL.vertices + np.array([2.0, 0, 0])
    vertices = np.concatenate([around.vertices, ball])
    faces = np.concatenate([around.faces, BALL.faces + len(around.vertices)]).astype(np.uint32)
    corners = ball[BALL.faces[:10]][None]
    chosen = possible_occluders(faces, [vertices], corners)
    assert (chosen >= len(around.faces)).all()
    assert 0 < len(chosen) < 0.7 * len(BALL.faces)
