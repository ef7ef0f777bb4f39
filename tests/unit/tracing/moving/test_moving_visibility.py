"""What is seen of moving surfaces: the same together as one by one, whichever way their parts look."""

import numpy as np
import pytest
import trimesh

from rfgen_sionna.radar import Radar
from rfgen_sionna.scene import MeshActor
from rfgen_sionna.scene.mitsuba_backend import ensure_backend
from rfgen_sionna.scene.rays import RayScene
from rfgen_sionna.tracing.moving import moving_visibility as sight
from rfgen_sionna.tracing.moving.interval import TraceInterval
from rfgen_sionna.tracing.surface.surfaces import outward_faces
from rfgen_sionna.tracing.trace_run import TraceRun
from rfgen_sionna.tracing.tracer import Tracer


def ball(radius, x=0.0, inverted=False):
    mesh = trimesh.creation.icosphere(subdivisions=3, radius=radius)
    mesh.apply_translation([x, 0, 0])
    if inverted:
        mesh.invert()
    return mesh


def actor(mesh, name, x, speed=0.0):
    return MeshActor.from_mesh(mesh, material="pec", name=name, trajectory=lambda t: (x, speed * t, 0.0))


@pytest.fixture(scope="module")
def radar():
    return Radar.load("awr1843", "mmmesh")


def sampled(radar, actors, times):
    """Visibility at `times`, and the moving tracer."""
    tracer = Tracer(None, radar, actors, 1e-2)
    run = tracer._follow(True)
    tracer.trace(times[0], times[0], TraceRun(run, True, None))
    interval = TraceInterval(
        np.array(times[:1]), tracer._vertices, lambda t: tracer._rays, tracer._rays, tracer.rays_at, []
    )
    return run._trace_visibility(times, interval), run, interval


def test_times_together_equal_single_times(radar, monkeypatch):
    """A ball that passes before another: shares, pieces of facets in half shadow, outlines and levels, with what is too
    faint at all times.

    Coordinates are float32: a ray past an edge may fall on the facet beside, and a few corners of sixteen thousand
    facets, a third of a facet each, on the other side of an edge (with CUDA, six of them).
    """
    monkeypatch.setattr(sight, "CULLED_PER_RTOL", 0.0)
    times = np.linspace(0.0, 0.03, 7).tolist()
    actors = [actor(ball(0.1), "near", 1.5, 4.0), actor(ball(0.3), "far", 2.5)]
    together, run, interval = sampled(radar, actors, times)
    for t, each in zip(times, together, strict=True):
        (alone,) = run._trace_visibility([t], interval)
        assert (each.fraction != alone.fraction).mean() < 0.05
        assert np.abs(each.fraction - alone.fraction).sum() < (5 if ensure_backend().startswith("llvm") else 6.5) / 3
        assert np.abs(each.level / alone.level - 1).max() < 1e-4
        assert np.allclose(each.silhouette, alone.silhouette, atol=run._moving_visibility._ray_spacing)
        assert abs(len(each.owner) - len(alone.owner)) <= 0.02 * len(alone.owner)
        assert each.sampled_facets == alone.sampled_facets
    assert len({each.fraction.sum() for each in together}) == len(times)


def test_many_times_stay_near_the_radar(radar):
    """Coordinates are float32, which loses accuracy at tens of metres."""
    times = np.linspace(0.0, 0.03, 200).tolist()
    together, *_ = sampled(radar, [actor(ball(0.1), "near", 1.5), actor(ball(0.3), "far", 2.5)], times)
    found = np.stack([each.fraction for each in together])  # nothing moves
    assert np.abs(found - found[0]).sum(axis=1).max() < 5 / 3


def test_an_inverted_part_occludes(radar):
    """Two balls that are one mesh, the nearer one inside out: it returns nothing, as nothing of it looks at the radar,
    and neither does its far side, which it hides as well."""
    both = trimesh.util.concatenate([ball(0.3), ball(0.1, -0.6, inverted=True)])
    outward = outward_faces(np.asarray(both.vertices), np.asarray(both.faces))
    assert np.array_equal(outward, np.repeat([True, False], 1280))
    (visible,), _, interval = sampled(radar, [actor(both, "both", 2.0)], [0.0])
    assert visible.fraction[visible.facets.face >= 1280].max() == 0.0
    facing = np.flatnonzero(visible.facets.facing & (visible.facets.face < 1280))
    corners = visible.facets.centroids[facing]
    rays = RayScene([], [(interval.positions(0.0)[0], both.faces)])
    hidden = rays.occluded(np.zeros(3), corners, visible.facets.number[facing])
    clear = np.abs(visible.fraction[facing] - 0.5) > 0.49
    assert np.array_equal(visible.fraction[facing][clear] < 0.5, hidden[clear])
    assert 0.05 < hidden.mean() < 0.95


def test_a_box_around_the_radar_occludes(radar):
    """The faces of a closed box around the radar face away and occlude all the same."""
    inside = trimesh.creation.box((1.0, 1.0, 1.0))
    (visible,), *_ = sampled(radar, [actor(inside, "box", 0.0), actor(ball(0.3), "ball", 2.0)], [0.0])
    assert visible.fraction.max() == 0.0


@pytest.mark.slow
def test_silhouette_rays_by_time(radar):
    """Also after geometry at times in between."""
    tracer = Tracer(None, radar, [actor(ball(0.1), "near", 1.5, 4.0), actor(ball(0.3), "far", 2.5)], 1e-2)
    asked = []

    def watch(t, rays):
        tracer.geometry(t)
        asked.append(t)

    traced = tracer.trace(0.0, 0.02, watch=watch)
    assert len(asked) == traced.report.sample_times
    assert traced.report == tracer.trace(0.0, 0.02).report


@pytest.mark.slow
@pytest.mark.parametrize("spin", [0.0, 314.0, 628.0])
@pytest.mark.parametrize("kind", ["closed", "open", "a part inside out", "around the radar"])
def test_resampled_facets_have_all_occluders(radar, kind, spin):
    """A body before a plate, which turns by up to two turns in the stretch [rad/s]: rays to the plate come to what they
    come to in the ray scene, at each of the times."""
    body = ball(2.0 if kind == "around the radar" else 0.1)
    if kind == "a part inside out":
        body = trimesh.util.concatenate([body, ball(0.05, -0.3, inverted=True)])
    if kind == "open":
        body.update_faces(body.triangles_center[:, 0] > -0.02)
    plate = trimesh.creation.box((0.002, 0.8, 0.8)).subdivide_to_size(0.1)
    place = 0.0 if kind == "around the radar" else 1.0
    turning = MeshActor.from_mesh(
        body, material="pec", name="body", trajectory=lambda t: ((place, 0.0, 0.0), (spin * t, 0.0, 0.0))
    )
    actors = [turning, actor(plate, "plate", 3.0)]
    tracer = Tracer(None, radar, actors, 1e-2)
    run = tracer._follow(True)
    tracer.trace(0.0, 0.0, TraceRun(run, True, None))
    times = np.linspace(0.0, 0.02, 17).tolist()
    first = len(body.faces)
    vertices = [tracer._vertices(t) for t in times]
    corners = np.stack([there[1][actors[1].faces] for there in vertices])
    occluders = run._moving_visibility.occluders(tracer._rays, vertices, corners)
    number = occluders.numbered(first + np.arange(len(actors[1].faces), dtype=np.int32), len(times))
    middle = np.full((len(number), 3), 1 / 3)
    visible = occluders.targets(run._viewpoint, corners.reshape(-1, 3, 3), number).visible(
        np.arange(len(number)), middle
    )
    differ = 0
    for k, t in enumerate(times):
        rays = tracer.rays_at(t)
        own = slice(k * len(actors[1].faces), (k + 1) * len(actors[1].faces))
        alone = ~rays.occluded(run._viewpoint, corners[k].mean(axis=1), first + np.arange(len(actors[1].faces)))
        differ += np.count_nonzero(visible[own] != alone)
    assert differ <= 2  # coordinates are float32
    assert visible.any() == (kind != "around the radar")
