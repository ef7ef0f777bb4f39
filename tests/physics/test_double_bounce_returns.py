"""Glints between bent surfaces: what is stated of them, and that they are found however things are meshed."""

import numpy as np
import pytest
import trimesh

from rfgen_sionna.scene import MeshActor
from rfgen_sionna.simulation import Simulator
from rfgen_sionna.tracing.tracer import Tracer
from tests.benchmarks.subjects import ball, radar_of
from tests.physics.test_curved_reflections import PLACES, RADIUS, around, at, metal, true_radius
from tests.reference.two_spheres import by_way_of


@pytest.fixture(scope="module")
def radar():
    return radar_of(77)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("frequency", "radius", "name"), [(24, 0.15, "side by side"), (24, 0.15, "above"), (77, 0.05, "above")]
)
def test_what_geometrical_optics_is_off_by_is_stated(frequency, radius, name):
    """The error that a trace states grows by what glints may be off by: no less than they are, against dense physical
    optics without what its rims add, and no more than six times as much. Of direct returns both leave out the same:
    nothing."""
    radar, middle = radar_of(frequency), np.mean(PLACES[name], axis=0)
    places = [middle + (np.array(each) - middle) * radius / RADIUS for each in PLACES[name]]
    actors = [metal(place, each, radius=radius) for place, each in zip(places, "ab", strict=True)]
    one, two = (Tracer(None, radar, actors, 1e-2, max_bounces=n).trace(0.0, 1e-4) for n in (1, 2))
    balls = [(place, true_radius(3, radius)) for place in places]
    ends = radar.tx_world[0], radar.rx_world[0], radar.tx_field, radar.rx_field, radar.center_frequency
    truth = sum(by_way_of(*pair, *ends, n=250, taper=0.35) for pair in (balls, balls[::-1]))
    direct = max(abs(at(one.moving.select(one.moving.object_id == n), 0.0)[0, 0]) for n in (0, 1))
    off = abs(at(around(two.moving), 0.0)[0, 0] - truth) / direct
    assert off < two.report.error - one.report.error < 6 * off


def test_what_an_edge_leaves_of_a_glint_is_in_doubt(radar):
    """A ball that ends just beside its glint, or has something in the way there: a fifth of the glint or more."""
    whole = metal(PLACES["side by side"][1], "b")

    def stated(cut):
        mesh = ball(4, RADIUS)
        mesh.update_faces(mesh.triangles_center[:, 1] < cut)
        mesh.remove_unreferenced_vertices()
        part = MeshActor.from_mesh(mesh, material="pec", position=PLACES["side by side"][0], name="a")
        found = [Tracer(None, radar, [part, whole], 1e-2, max_bounces=n).trace(0.0, 1e-4) for n in (1, 2)]
        return found[1].report.error - found[0].report.error, around(found[1].moving).num_paths

    # Glints lie about 45 degrees off the way to the radar, at 0.106 m of 0.15 m.
    (inside, there), (rim, near) = stated(0.16), stated(0.115)
    assert there == near == 2
    assert rim > 5 * inside


def rod(radius, height, sections, rings):
    """A cylinder about z whose side is so many rings of faces."""
    angle, z = 2 * np.pi * np.arange(sections) / sections, np.linspace(-height / 2, height / 2, rings + 1)
    side = [[radius * np.cos(a), radius * np.sin(a), level] for level in z for a in angle]
    here = np.arange(rings * sections)
    right = here - here % sections + (here + 1) % sections
    ends = np.arange(sections), (np.arange(sections) + 1) % sections
    last, count = rings * sections, len(side)
    faces = np.concatenate(
        [
            np.stack([here, right, right + sections], 1),
            np.stack([here, right + sections, here + sections], 1),
            np.stack([ends[1], ends[0], np.full(sections, count)], 1),
            np.stack([last + ends[0], last + ends[1], np.full(sections, count + 1)], 1),
        ]
    )
    return np.array([*side, [0, 0, z[0]], [0, 0, z[-1]]]), faces


RODS = (
    ((0.099, 0.74), (2.981, 0.080, 0.105), (0.700, 0.351, 0.622)),
    ((0.081, 0.76), (3.105, 0.280, 0.563), (0.581, 0.450, -0.678)),
)
"""Radius, height, middle and axis of two that lean."""


@pytest.mark.parametrize(
    ("sections", "rings"), [(32, 1), *(pytest.param(64, each, marks=pytest.mark.slow) for each in (1, 16))]
)
def test_rods_that_lean_have_their_glint_however_they_are_meshed(radar, sections, rings):
    """As long as a face, or in sixteen rings: two paths, as long and as strong as where they are meshed finely."""

    def found(*mesh):
        actors = []
        for (radius, height, *place), name in zip([(*a, b, c) for a, b, c in RODS], "ab", strict=True):
            vertices, faces = rod(radius, height, *mesh)
            turn = trimesh.geometry.align_vectors([0, 0, 1], place[1])[:3, :3]
            actors.append(MeshActor.from_mesh((vertices @ turn.T, faces), material="pec", position=place[0], name=name))
        simulator = Simulator(None, radar, actors, rtol=1e-2, max_bounces=2, collisions="ignore")
        return around(simulator.paths(0.0))

    paths, fine = found(sections, rings), found(96, 48)
    assert paths.num_paths == fine.num_paths == 2
    assert paths.tau[0, 0] * 3e8 == pytest.approx(fine.tau[0, 0] * 3e8, abs=1e-3)
    assert np.abs(paths.a[0, 0]) == pytest.approx(np.abs(fine.a[0, 0]), rel=0.02)
