"""Rays hit what stands in their way, in static and moving meshes alike, near the origin and far from it."""

from types import SimpleNamespace

import drjit as dr
import numpy as np
import pytest
import trimesh

from rfgen_sionna.scene import RayScene, face_normals
from rfgen_sionna.scene.mitsuba_backend import ensure_backend

BALL = trimesh.creation.icosphere(subdivisions=4)
ROOM = trimesh.creation.box((20, 20, 10))


def arrays(mesh: trimesh.Trimesh, shift=(0.0, 0.0, 0.0)):
    return np.asarray(mesh.vertices, np.float64) + shift, np.asarray(mesh.faces, np.int32)


def moller_trumbore(origin, directions, corners):
    """Reference in float64: nearest distance and face of each ray, by brute force over all triangles."""
    distances, faces = [], []
    a, b, c = corners.transpose(1, 0, 2)
    e1, e2, s = b - a, c - a, origin - a
    q = np.cross(s, e1)
    for d in directions:
        p = np.cross(d, e2)
        with np.errstate(divide="ignore", invalid="ignore"):
            inverse = 1.0 / np.einsum("ij,ij->i", e1, p)
            u = np.einsum("ij,ij->i", s, p) * inverse
            v = (q @ d) * inverse
            t = np.einsum("ij,ij->i", e2, q) * inverse
            t = np.where((u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0), t, np.inf)
        faces.append(int(np.argmin(t)))
        distances.append(float(t.min()))
    return np.array(distances), np.array(faces)


@pytest.fixture(scope="module")
def mixed() -> RayScene:
    """Static: room (12 faces) and ball at x = 4. Moving: ball at y = 4 and ball at y = -4."""
    return RayScene(
        [arrays(ROOM), arrays(BALL, (4, 0, 0))], [arrays(BALL, (0, 4, 0)), arrays(BALL, (0, -4, 0))], origin=(0, 0, 0)
    )


@pytest.mark.usefixtures("kernels")
def test_first_hits_are_those_of_a_brute_force_search(mixed: RayScene):
    mixed.update([arrays(BALL, (0, 4, 0))[0], arrays(BALL, (0, -4, 0))[0]])
    rng = np.random.default_rng(1)
    directions = rng.normal(size=(300, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    origin = np.array([0.3, 0.2, -0.1])
    corners = np.concatenate(
        [arrays(m, s)[0][m.faces] for m, s in ((ROOM, 0), (BALL, (4, 0, 0)), (BALL, (0, 4, 0)), (BALL, (0, -4, 0)))]
    )
    distance, facet = moller_trumbore(origin, directions, corners)
    hits = mixed.first_hit(origin, 7.0 * directions)
    # float32 barycentrics place the point within a wall triangle of 28 m to about 1 um.
    np.testing.assert_allclose(hits.distance, distance, atol=2e-6)
    same = hits.facet == facet
    assert same.mean() > 0.99, "only rays through an edge may differ"
    np.testing.assert_array_equal(np.unique(hits.object), [0, 1, 2, 3])
    np.testing.assert_array_equal(hits.facet, mixed.facet_offsets[hits.object] + hits.face)
    points = np.einsum("rc,rci->ri", hits.barycentric, corners[hits.facet])
    np.testing.assert_allclose(points, origin + hits.distance[:, None] * directions, atol=5e-6)


def test_a_ray_into_the_open_hits_nothing():
    rays = RayScene([arrays(BALL)])
    hits = rays.first_hit((3, 0, 0), [[1.0, 0, 0], [-1, 0, 0]])
    assert hits.distance[0] == np.inf
    assert (hits.object[0], hits.face[0], hits.facet[0]) == (-1, -1, -1)
    assert np.isnan(hits.barycentric[0]).all()
    assert hits.distance[1] == pytest.approx(2.0, abs=1e-6)


def test_an_empty_scene_hides_nothing():
    rays = RayScene([], [])
    assert not rays.occluded((0, 0, 0), [[1.0, 2, 3]]).any()
    assert rays.first_hit((0, 0, 0), [[1.0, 0, 0]]).distance[0] == np.inf
    assert rays.num_facets == 0


def test_a_convex_body_hides_exactly_the_facets_that_face_away():
    vertices, faces = arrays(BALL)
    radar = np.array([-8.0, 1.0, 0.5])
    rays = RayScene([], [(vertices, faces)])
    rng = np.random.default_rng(0)
    points = np.einsum("fc,fci->fi", rng.dirichlet((1, 1, 1), len(faces)), vertices[faces])
    facing = np.einsum("ij,ij->i", face_normals(vertices, faces), radar - points) > 0
    hidden = rays.occluded(radar, points, np.arange(len(faces)))
    assert not hidden[facing].any()
    # Behind the rim a facet tilts away by less than the gap within which a hit is its own.
    assert hidden[~facing].mean() > 0.995


def test_the_answer_is_the_same_10_km_away_and_1_km_off():
    vertices, faces = arrays(BALL)
    points = vertices[faces].mean(axis=1)
    own = np.arange(len(faces))
    radar = np.array([-8.0, 1.0, 0.5])
    near = RayScene([], [(vertices, faces)]).occluded(radar, points, own)
    shift = np.array([1e4, -1e4, 3e2])
    far = RayScene([], [(vertices + shift, faces)]).occluded(radar + shift, points + shift, own)
    np.testing.assert_array_equal(near, far)
    distant = RayScene([], [(vertices, faces)], origin=(-1000, 0, 0)).occluded((-1000, 0, 0), points, own)
    facing = np.einsum("ij,ij->i", face_normals(vertices, faces), np.array([-1000, 0, 0]) - points) > 0
    assert (distant == ~facing).mean() > 0.99


@pytest.mark.usefixtures("kernels")
def test_static_and_moving_bodies_hide_each_other(mixed: RayScene):
    wall = np.array([[9.99, 0, 0], [0, 9.99, 0], [-9.99, 0, 0]])
    mixed.update([arrays(BALL, (0, 4, 0))[0], arrays(BALL, (0, -4, 0))[0]])
    assert mixed.occluded((0, 0, 0), wall).tolist() == [True, True, False]
    # The moving ball steps aside and in front of the other wall, 100 m would be through it.
    mixed.update([arrays(BALL, (-4, 0, 0))[0], arrays(BALL, (0, -4, 0))[0]])
    assert mixed.occluded((0, 0, 0), wall).tolist() == [True, False, True]
    hits = mixed.first_hit((0, 0, 0), [[-1.0, 0, 0]])
    assert hits.object[0] == 2
    assert hits.distance[0] == pytest.approx(3.0, abs=1e-6)


def points_on_the_walls(mixed: RayScene, count: int):
    """Corners and numbers of the room's faces, and random points on them: which face, and barycentric coordinates."""
    number = np.arange(12)
    rng = np.random.default_rng(0)
    return mixed.corners(number), number, rng.integers(0, 12, count), rng.dirichlet(np.ones(3), (2, count))


@pytest.mark.usefixtures("kernels")
def test_points_on_facets_are_seen_where_nothing_hides_them(mixed: RayScene, monkeypatch: pytest.MonkeyPatch):
    corners, number, of, (places, _) = points_on_the_walls(mixed, 4000)
    viewpoint = np.array([0.3, 0.1, 0.2])
    targets = mixed.targets(viewpoint, corners, number)
    visible = targets.visible(of, places)
    points = np.einsum("rc,rci->ri", places, corners[of])
    np.testing.assert_array_equal(visible, ~mixed.occluded(viewpoint, points, number[of]))
    assert 0.1 < visible.mean() < 0.95
    monkeypatch.setattr("rfgen_sionna.scene.point_visibility.CHUNK", 1000)
    np.testing.assert_array_equal(targets.visible(of, places), visible)


@pytest.mark.usefixtures("kernels")
def test_the_edge_of_a_shadow_is_where_halving_finds_it(mixed: RayScene, monkeypatch: pytest.MonkeyPatch):
    """In one kernel as step by step; each pair as often as it asks for."""
    corners, number, of, (one, other) = points_on_the_walls(mixed, 4000)
    targets = mixed.targets(np.array([0.3, 0.1, 0.2]), corners, number)
    unoccluded = np.flatnonzero(targets.visible(of, one) & ~targets.visible(of, other))
    of, near, far = of[unoccluded], one[unoccluded], other[unoccluded]
    halvings = np.random.default_rng(1).integers(0, 9, len(of))
    found, occluder = targets.edges(of, near, far, halvings)
    monkeypatch.setattr("rfgen_sionna.scene.point_visibility.CHUNK", 100)
    np.testing.assert_array_equal(targets.edges(of, near, far, halvings)[0], found)
    for step in range(8):
        middle = 0.5 * (near + far)
        visible, on = targets.visible(of, middle), step < halvings
        near[on & visible], far[on & ~visible] = middle[on & visible], middle[on & ~visible]
    assert len(of) > 100
    np.testing.assert_allclose(found, 0.5 * (near + far), atol=1e-15)
    # What casts it is what a ray to the dark side meets first.
    occluded = np.einsum("rc,rci->ri", far, corners[of])
    viewpoint = np.array([0.3, 0.1, 0.2])
    hit = mixed.first_facet(viewpoint, occluded - viewpoint)
    plane = mixed.corners(hit)
    normal = np.cross(plane[:, 1] - plane[:, 0], plane[:, 2] - plane[:, 0])
    share = np.einsum("ri,ri->r", normal, plane[:, 0] - viewpoint) / np.einsum("ri,ri->r", normal, occluded - viewpoint)
    np.testing.assert_allclose(occluder, share, rtol=1e-4)
    assert (occluder < 0.9).mean() > 0.5


@pytest.mark.usefixtures("kernels")
def test_points_that_several_places_have_to_see_are_those_that_each_does(mixed: RayScene):
    """Two places for each of the facets, other ones for every third; edges between light and shadow as well."""
    mixed.update([arrays(BALL, (0, 4, 0))[0], arrays(BALL, (0, -4, 0))[0]])
    rng = np.random.default_rng(3)
    walls = np.arange(12)
    corners, of = mixed.corners(walls), np.repeat(walls, 60)
    places = rng.dirichlet((1, 1, 1), len(of))
    ends = rng.uniform(-2.0, 2.0, (12, 2, 3))
    both = mixed.targets(ends, corners, walls)
    visible = both.visible(of, places)
    apart = np.ones(len(of), np.bool_)
    for facet in walls.tolist():
        mine = of == facet
        for end in ends[facet]:
            alone = mixed.targets(end, corners[facet : facet + 1], walls[facet : facet + 1])
            apart[mine] &= alone.visible(np.zeros(mine.sum(), np.intp), places[mine])
    assert 0.05 < visible.mean() < 0.95
    np.testing.assert_array_equal(visible, apart)
    unoccluded, occluded = [], []
    for facet in walls.tolist():
        there = np.flatnonzero((of == facet) & visible)
        here = np.flatnonzero((of == facet) & ~visible)
        count = min(len(there), len(here))
        unoccluded.append(there[:count])
        occluded.append(here[:count])
    one, other = np.concatenate(unoccluded), np.concatenate(occluded)
    edge, occluder = both.edges(of[one], places[one], places[other], 20)
    along = (places[other] - places[one]) / np.linalg.norm(places[other] - places[one], axis=1, keepdims=True)
    assert both.visible(of[one], edge - 1e-4 * along).mean() > 0.98
    assert both.visible(of[one], edge + 1e-4 * along).mean() < 0.02
    assert ((occluder > 0) & (occluder < 1)).all()


def test_both_sides_of_a_plate_hide():
    plate = (np.array([[0.0, -1, -1], [0, 1, -1], [0, 1, 1], [0, -1, 1]]), np.array([[0, 1, 2], [0, 2, 3]]))
    rays = RayScene([plate], [])
    assert rays.occluded([[-2.0, 0.1, 0], [2.0, 0.1, 0]], [[2.0, 0.1, 0], [-2.0, 0.1, 0]]).all()


def test_a_thin_sheet_hides_what_is_right_behind_it():
    """A body 1 mm behind its clothing is hidden from 5 m."""
    plate = np.array([[0.0, -1, -1], [0, 1, -1], [0, 1, 1], [0, -1, 1]])
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    rays = RayScene([(plate, faces), (plate + np.array([1e-3, 0, 0]), faces)])
    hidden = rays.occluded((-5, 0, 0), [[0.0, 0.3, 0.1], [1e-3, 0.3, 0.1]], facets=[0, 2])
    assert hidden.tolist() == [False, True]


def test_a_point_without_a_known_facet_does_not_hide_itself():
    vertices, faces = arrays(BALL)
    centres = vertices[faces].mean(axis=1)
    facing = np.einsum("ij,ij->i", face_normals(vertices, faces), [-8.0, 0, 0] - centres) > 0
    assert not RayScene([(vertices, faces)]).occluded((-8, 0, 0), centres[facing]).any()


def test_rays_may_start_on_a_surface():
    """Two walls of an empty room see each other, with a ball in between they do not; a wall's back sees nothing."""
    vertices, faces = arrays(ROOM)
    centres = vertices[faces].mean(axis=1)
    normals = face_normals(vertices, faces)
    i, j = np.array([(a, b) for a in range(12) for b in range(12)]).T
    apart = ~np.isclose(np.einsum("ij,ij->i", normals[i], centres[j] - centres[i]), 0.0)
    i, j = i[apart], j[apart]
    assert not RayScene([(vertices, faces)]).occluded(centres[i], centres[j], facets=j, source_facets=i).any()
    between = RayScene([(vertices, faces)], [arrays(BALL)])
    hidden = between.occluded(centres[i], centres[j], facets=j, source_facets=i)
    span = centres[j] - centres[i]
    nearest = np.linalg.norm(np.cross(centres[i], span), axis=1) / np.linalg.norm(span, axis=1)
    np.testing.assert_array_equal(hidden, nearest < 1.0)
    outside = centres[i] + 1e-2 * np.sign(centres[i]) * (np.abs(centres[i]) > 4.9)
    assert between.occluded(outside, centres[j], facets=j).all()


@pytest.mark.parametrize("each", [False, True])
def test_scenes_are_asked_one_after_the_other_where_kernels_ask_but_one(mixed: RayScene, monkeypatch, each: bool):
    """What the first has found is computed before the second is asked, and no loop within a kernel asks both."""
    monkeypatch.setattr("rfgen_sionna.scene.ray_layer.one_scene_per_kernel", lambda: each)
    done, evaluated = list[str](), dr.eval
    for name in ("_static", "_moving"):
        layer = getattr(mixed, name)

        def asked(*given, scene=layer.scene, name=name, **options):
            done.append(name)
            return scene.ray_intersect_preliminary(*given, **options)

        monkeypatch.setattr(layer, "scene", SimpleNamespace(ray_intersect_preliminary=asked))
    monkeypatch.setattr(dr, "eval", lambda *values: done.append("eval") or evaluated(*values))
    corners, number, of, (one, other) = points_on_the_walls(mixed, 400)
    mixed.first_facet((0, 0, 0), [[1.0, 0, 0]])
    assert done == ["_static", *(["eval"] if each else []), "_moving", "eval"]
    targets = mixed.targets(np.array([0.3, 0.1, 0.2]), corners, number)
    done.clear()
    targets.edges(of, one, other, 3)
    steps = [k for k, name in enumerate(done) if name == "_static"]
    assert len(steps) == (4 if each else 2)  # three and the last look; a loop within a kernel is gone through once
    for k in steps:
        assert done[k + 1 : k + 3] == (["eval", "_moving"] if each else ["_moving", *done[k + 2 : k + 3]])


@pytest.mark.usefixtures("kernels")
def test_frames_reuse_their_kernel_and_their_memory():
    """A hundred frames: nothing is compiled after the first, resident memory grows by less than 20 MB."""
    import drjit as dr

    resource = pytest.importorskip("resource")
    vertices, faces = arrays(trimesh.creation.icosphere(subdivisions=4))
    rays = RayScene([arrays(ROOM)], [(vertices, faces)])
    own = np.arange(len(faces)) + 12
    sizes = []
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        for i in range(100):
            moved = vertices + np.array([0.01 * i, 0, 0])
            rays.update([moved])
            # The number of rays changes from frame to frame as well.
            rays.occluded((-8, 0, 0), moved[faces].mean(axis=1)[i:], own[i:])
            sizes.append(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024)
            kernels = [k for k in dr.kernel_history() if k["type"] == dr.KernelType.JIT]
            assert kernels
            assert i == 0 or all(k["cache_hit"] for k in kernels)
    assert sizes[-1] - sizes[10] < 20


def test_results_do_not_change_with_later_calls():
    """Dr.Jit shares memory with NumPy: what was returned must be the caller's own."""
    rays = RayScene([], [arrays(BALL)])
    first = rays.first_hit((-8, 0, 0), [[1.0, 0, 0], [1.0, 0.05, 0]])
    kept = first.distance.copy(), first.facet.copy()
    rays.update([arrays(BALL, (1, 0, 0))[0]])
    rays.first_hit((-8, 0, 0), [[1.0, 0.02, 0], [1.0, -0.05, 0]])
    np.testing.assert_array_equal(first.distance, kept[0])
    np.testing.assert_array_equal(first.facet, kept[1])


def test_many_rays_are_split(monkeypatch: pytest.MonkeyPatch):
    from rfgen_sionna.scene import rays as module

    rays = RayScene([arrays(BALL)])
    targets = np.random.default_rng(0).normal(size=(1000, 3))
    whole = rays.occluded((-8, 0, 0), targets)
    monkeypatch.setattr(module, "CHUNK", 64)
    np.testing.assert_array_equal(rays.occluded((-8, 0, 0), targets), whole)
    assert 0 < whole.sum() < 1000


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda r: r.occluded((0, 0, 0), [[np.nan, 0, 0]]), "targets: NaN"),
        (lambda r: r.occluded((0, 0), [[1, 0, 0]]), "origins: shape"),
        (lambda r: r.occluded((1, 0, 0), [[1, 0, 0]]), "target 0 lies at its origin"),
        (lambda r: r.occluded((0, 0, 0), [[1, 0, 0]], facets=[99999]), "facets: 99999"),
        (lambda r: r.first_hit((0, 0, 0), [[0, 0, 0]]), "ray 0 has length zero"),
        (lambda r: r.update([BALL.vertices[:-1]]), "the moving objects have"),
        (lambda r: r.update([BALL.vertices * np.nan]), "vertices of moving object 0: NaN"),
        (lambda r: RayScene([(BALL.vertices, np.zeros((2, 4), int))]), "faces of object 0"),
    ],
)
def test_bad_arguments_are_named(call, message):
    rays = RayScene([], [arrays(BALL)])
    with pytest.raises(ValueError, match=message):
        call(rays)


def test_threads_are_given_back_after_a_move():
    """A tree is built with one thread, and whatever happens Dr.Jit has those of before again. CUDA builds its own."""
    on_cpu = ensure_backend().startswith("llvm")
    scene = RayScene([], [arrays(BALL)])
    before, visible = dr.thread_count(), []
    update = scene._moving._parameters.update

    def failing():
        visible.append(dr.thread_count())
        update()
        if len(visible) == 2:
            raise RuntimeError("no more memory")

    scene._moving._parameters.update = failing
    try:
        dr.set_thread_count(2)
        scene.update([arrays(BALL, (1.0, 0, 0))[0]])
        assert dr.thread_count() == 2
        with pytest.raises(RuntimeError, match="no more memory"):
            scene.update([arrays(BALL)[0]])
        assert dr.thread_count() == 2
    finally:
        dr.set_thread_count(before)
    assert visible == ([1, 1] if on_cpu else [2, 2])


def test_the_former_name_of_occluders_warns() -> None:
    with pytest.warns(DeprecationWarning, match="RayScene.looks is deprecated.*RayScene.occluders"):
        assert RayScene.looks == RayScene.occluders
