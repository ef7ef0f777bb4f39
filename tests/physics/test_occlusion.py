"""What stands in the way hides, and what is hidden of the static scene is missing from the signal."""

from functools import cache
from itertools import product

import numpy as np
import pytest
import trimesh
from scipy.special import fresnel

from rfgen_sionna._types import SPEED_OF_LIGHT
from rfgen_sionna.radar import Radar
from rfgen_sionna.scene import MeshActor, load_scene
from rfgen_sionna.signal import synthesize
from rfgen_sionna.simulation import Simulator
from rfgen_sionna.tracing.shadows import adaptive_sampling as sampling
from rfgen_sionna.tracing.shadows import boundary_edges
from rfgen_sionna.tracing.tracer import Tracer
from tests.physics.test_ghosts import channel as channels

BACKDROP = """<scene version="2.1.0">
    <bsdf type="itu-radio-material" id="mat-metal-sheet">
        <string name="type" value="metal"/><float name="thickness" value="0.1"/>
    </bsdf>
    <shape type="rectangle" id="wall">
        <transform name="to_world">
            <scale x="0.4" y="0.4"/><rotate y="1" angle="-90"/><translate x="4" z="1"/>
        </transform>
        <ref id="mat-metal-sheet" name="bsdf"/>
    </shape>
</scene>"""


@pytest.fixture(scope="module")
def radar():
    return Radar.load("awr1843", position=(0, 0, 1), look_at=(3, 0, 1))


def channel(paths, knot=0):
    phase = 2 * np.pi * np.mod(paths.frequency * paths.tau[0, 0, :, knot], 1.0)
    return complex((paths.a[0, 0, :, knot] * np.exp(-1j * phase)).sum())


def of(paths, name):
    return paths.select(np.flatnonzero(paths.object_id == paths.object_names.index(name)))


def test_plate_hides_a_sphere(radar):
    """A metal plate in between leaves nothing of the sphere; beside it the sphere is as strong as alone."""
    ball = MeshActor.from_mesh(
        trimesh.creation.icosphere(subdivisions=4, radius=0.1), material="pec", position=(3, 0, 1), name="ball"
    )
    alone = abs(channel(Simulator(None, radar, [ball], rtol=1e-3).paths()))
    board = trimesh.creation.box((0.01, 0.4, 0.4))
    for y, remains in ((0.0, False), (0.6, True)):
        plate = MeshActor.from_mesh(board, material="pec", position=(1.5, y, 1), name="plate")
        paths = of(Simulator(None, radar, [ball, plate], rtol=1e-3).paths(), "ball")
        if remains:
            assert abs(channel(paths)) == pytest.approx(alone, rel=1e-3)
        else:
            assert paths.num_paths == 0 or abs(channel(paths)) < 10 ** (-30 / 20) * alone


@pytest.mark.parametrize(("size", "around"), [(20, -1.8), pytest.param(100, -29.5, marks=pytest.mark.slow)])
def test_shadows_are_geometric_whatever_would_bend_around_a_plate(size, around):
    """Behind a square metal plate of 20 or 100 wavelengths, half way to 3 m, nothing is left of a ball of 2 cm.

    That is physical optics with rays for shadows. By Kirchhoff's integral (Babinet: the open field less that of an
    aperture like the plate) a wave of `around` dB, there and back, would come around it at 77 GHz: what is small beside
    the first Fresnel zone, here 11 cm across, hides less in truth than it does here.
    """
    radar = Radar.load("awr1843", position=(0, 0, 1), look_at=(3, 0, 1))
    ball = MeshActor.from_mesh(
        trimesh.creation.icosphere(3, radius=0.02), material="pec", position=(3, 0, 1), name="ball"
    )
    side = size * radar.wavelength
    plate = MeshActor.from_mesh(
        trimesh.creation.box((0.001, side, side)), material="pec", position=(1.5, 0, 1), name="plate"
    )
    alone = abs(channel(Simulator(None, radar, [ball], rtol=1e-3).paths()))
    paths = of(Simulator(None, radar, [ball, plate], rtol=1e-3).paths(), "ball")
    assert paths.num_paths == 0 or abs(channel(paths)) < 10 ** (-30 / 20) * alone
    sine, cosine = fresnel(side / 2 * np.sqrt(2 * 3.0 / (radar.wavelength * 1.5 * 1.5)))
    behind = 1 - 0.5j * (2 * (cosine - 1j * sine)) ** 2
    assert 40 * np.log10(abs(behind)) == pytest.approx(around, abs=0.5)


@pytest.mark.parametrize(
    "edge", [0.0, *(pytest.param(e, marks=pytest.mark.slow) for e in (-0.02, -0.01, -0.005, 0.005))]
)
def test_a_plate_s_edge_before_a_sphere_is_a_half_plane(edge):
    """Half of a metal sphere's Fresnel zone hidden, a bit more, a bit less: for every pair of elements within 1.2 dB of
    dense quadrature over the sphere with all left out that is behind the edge for Tx or Rx. From the phase centre, at
    `edge` = 0, that is 6 dB less than the whole, as of a half-plane."""
    found, truth, centre = half_hidden(edge)
    assert 20 * np.log10(abs(found / truth)) == pytest.approx(np.zeros(truth.shape), abs=1.2)
    if edge == 0:
        assert 20 * np.log10(abs(centre)) == pytest.approx(-6.0, abs=0.5)


@pytest.mark.slow
@pytest.mark.parametrize("edge", [0.01, 0.02])
def test_a_plate_s_edge_beyond_a_sphere_s_middle(edge):
    """What is left of it, about 16 to 23 dB less, is right to 2 % of the whole."""
    found, truth, _ = half_hidden(edge)
    assert np.abs(found - truth).max() < 0.02


def half_hidden(edge, rtol=1e-3):
    """(tx, rx) what each pair sees of a metal ball of 10 cm at 3 m behind a half-plane half way, over what it sees of
    all of it: as traced, and by quadrature; and this from the phase centre."""
    radar = Radar.load("awr1843", position=(0, 0, 0), look_at=(3, 0, 0), overrides={"pattern": {"kind": "sionna:iso"}})
    mesh = trimesh.creation.icosphere(subdivisions=3, radius=0.1)
    ball = MeshActor.from_mesh(mesh, material="pec", position=(3, 0, 0), name="ball")
    board = trimesh.creation.box((0.001, 0.4, 0.4))
    plate = MeshActor.from_mesh(board, material="pec", position=(1.5, 0.5 * edge - 0.2, 0), name="plate")
    behind = of(Simulator(None, radar, [ball, plate], rtol=rtol).paths(), "ball")
    found = channels(behind) / channels(Simulator(None, radar, [ball], rtol=rtol).paths())
    k = 2 * np.pi * radar.center_frequency / SPEED_OF_LIGHT
    # The ball as it is seen from x = -infinity, with a smooth end far from where it shines.
    y, z = np.meshgrid(np.arange(-0.06, 0.06, 5e-5) + 2.5e-5, np.linspace(-0.075, 0.075, 1201), indexing="ij")
    x = 3.0 - np.sqrt(0.01 - y * y - z * z)
    fade = np.clip((0.06 - np.abs(y)) / 0.03, 0.0, 1.0) ** 2 * np.clip((0.075 - np.abs(z)) / 0.05, 0.0, 1.0) ** 2

    def wave(tx, rx):
        """Of each point, and whether it is seen past both rims of the plate."""
        ways, facing, visible = [], 0.0, np.ones(x.shape, np.bool_)
        for end in (tx, rx):
            way = np.sqrt((x - end[0]) ** 2 + (y - end[1]) ** 2 + (z - end[2]) ** 2)
            facing = facing + ((3.0 - x) * (x - end[0]) - y * (y - end[1]) - z * (z - end[2])) / way
            ways.append(way)
            for rim in (1.4995, 1.5005):
                visible &= end[1] + (y - end[1]) * (rim - end[0]) / (x - end[0]) > 0.5 * edge
        return np.exp(-1j * k * (ways[0] + ways[1])) * facing / (ways[0] * ways[1] * (3.0 - x)) * fade, visible

    def share(tx, rx):
        every, visible = wave(tx, rx)
        return every[visible].sum() / every.sum()

    truth = np.array([[share(tx, rx) for rx in radar.rx_world] for tx in radar.tx_world])
    return found, truth, share(np.zeros(3), np.zeros(3))


def test_at_coarse_tolerances_every_pair_has_the_shadow_of_the_phase_centre():
    """Half of a metal sphere's Fresnel zone hidden, at a tolerance of 0.1: 6 dB less for every pair, though single ones
    are up to 7 dB weaker."""
    found, truth, centre = half_hidden(0.0, 0.1)
    assert 20 * np.log10(abs(found)) == pytest.approx(np.full(truth.shape, 20 * np.log10(abs(centre))), abs=0.5)
    assert 20 * np.log10(abs(found / truth)).max() == pytest.approx(7.0, abs=0.5)


def test_half_a_sphere_hidden_by_rows(radar):
    """A plate's edge through the line of sight leaves part of the facets, more of them as it moves out."""
    mesh = trimesh.creation.icosphere(subdivisions=4, radius=0.1)
    ball = MeshActor.from_mesh(mesh, material="pec", position=(3, 0, 1), name="ball")
    board = trimesh.creation.box((0.01, 0.4, 0.4))
    visible = []
    for y in np.linspace(0.15, 0.26, 6):
        plate = MeshActor.from_mesh(board, material="pec", position=(1.5, y, 1), name="plate")
        # So coarse a tolerance that the mesh's own faces will do: their number is what is seen.
        tracer = Simulator(None, radar, [ball, plate], rtol=0.1).tracer
        paths = of(tracer.trace(0.0, 0.0, tracer.follow(cull=False)).moving, "ball")
        visible.append(len(np.unique(paths.facet)))
    assert visible == sorted(visible)
    assert 0 <= visible[0] < visible[2] < visible[-1]


@pytest.mark.slow
def test_actor_takes_from_the_wall_what_it_hides(radar, tmp_path):
    """Static plus shadow is the wall traced with the actor in place, at every knot."""
    file = tmp_path / "backdrop.xml"
    file.write_text(BACKDROP)
    mesh = trimesh.creation.icosphere(subdivisions=3, radius=0.15)
    ball = MeshActor.from_mesh(mesh, material="pec", position=(2.5, -0.4, 1), velocity=(0, 20.0, 0), name="ball")
    sim = Simulator(str(file), radar, [ball], rtol=1e-3)
    traced = sim.tracer.trace(0.0, 0.02)
    changing, *others = traced.shadows
    assert len(changing.paths.times) >= 3
    shaded = np.concatenate([each.index for each in traced.shadows])
    assert len(np.unique(shaded)) == len(shaded)
    assert 0 < len(shaded) < traced.static.num_paths
    unobstructed = channel(traced.static)
    changes = []
    for knot, t in enumerate(changing.paths.times):
        blended = unobstructed + channel(changing.paths, knot)
        for each in others:  # such as stay, and such as are looked at between these knots as well
            own = each.paths.times
            blended += channel(each.paths, 0 if len(own) == 1 else int(np.flatnonzero(own == t)[0]))
        direct = channel(of(sim.paths(float(t)), "wall"))
        # All instants are looked at together, where rays beside an outline may fall on the other of two facets.
        assert abs(blended - direct) < 1e-4 * abs(unobstructed)
        changes.append(abs(blended / unobstructed))
    # The ball passes the mirror point in the middle of the run: little of the wall is left then.
    assert min(changes) < 0.7
    assert traced.report.rays > 0


def isotropic():
    return Radar.load("awr1843", position=(0, 0, 1), look_at=(3, 0, 1), overrides={"pattern": {"kind": "sionna:iso"}})


SCREEN = """<shape type="rectangle" id="screen">
        <transform name="to_world">
            <scale x="0.4" y="0.4"/><rotate y="1" angle="-90"/><translate x="2" y="{y}" z="1"/>
        </transform>
        <ref id="mat-metal-sheet" name="bsdf"/>
    </shape>
</scene>"""


@cache
def left_of_the_wall(y, half_width):
    """What a screen half way leaves of the wall's return, as 16 million points say."""
    radar = isotropic()
    n = 4000
    grid = 0.8 * ((np.arange(n) + 0.5) / n - 0.5)
    place = [4.0, grid[:, None], grid[None, :]]
    distance = [
        np.sqrt(sum((a - b) ** 2 for a, b in zip(place, element - np.array([0, 0, 1]), strict=True)))
        for element in (radar.tx_world[0], radar.rx_world[0])
    ]
    wave = np.exp(-2j * np.pi / radar.wavelength * sum(distance)) / np.prod(distance, axis=0) ** 1.5
    visible = np.ones_like(wave, bool)
    for element in (radar.tx_world[0], radar.rx_world[0]):  # half way to the wall
        visible &= np.abs(0.5 * (place[1] + element[1]) - y) > half_width
    return (wave * visible).sum() / wave.sum()


@pytest.mark.parametrize(
    ("who", "y", "rtol"),
    [
        ("furniture", 0.41, 1e-3),
        ("actor", 0.41, 1e-2),
        *(
            pytest.param(who, y, rtol, marks=pytest.mark.slow)
            for who, y, rtol in product(("furniture", "actor"), (0.41, -0.33), (1e-2, 1e-3))
            if (who, y, rtol) not in (("furniture", 0.41, 1e-3), ("actor", 0.41, 1e-2))
        ),
    ],
)
def test_half_a_wall_is_the_dense_quadrature_of_what_is_seen(tmp_path, who, y, rtol):
    """A screen's edge through the wall's facets near the mirror point, where each has a phase of its own: level and
    phase against the wall alone."""
    radar = isotropic()
    whole, half = tmp_path / "whole.xml", tmp_path / "half.xml"
    whole.write_text(BACKDROP)
    half.write_text(BACKDROP.replace("</scene>", SCREEN.format(y=y)))
    alone = of(Simulator(str(whole), radar, rtol=rtol).paths(), "wall")
    if who == "furniture":
        sim = Simulator(str(half), radar, rtol=rtol)
    else:
        board = trimesh.creation.box((0.001, 0.8, 0.8))
        sim = Simulator(str(whole), radar, [MeshActor.from_mesh(board, material="pec", position=(2, y, 1))], rtol=rtol)
    found = channel(of(sim.paths(), "wall")) / channel(alone)
    stated = sim.tracer.trace(0.0, 0.0).report.error * sim.tracer.static.level / abs(channel(alone))
    truth = left_of_the_wall(y, 0.4)
    if who == "furniture":
        # Half of the tolerance is the shadow's; the quadrature's scalar fields differ from the wall's by 0.1 %, twice.
        assert abs(found - truth) < min(max(0.5 * rtol, 2e-3), stated + 2e-3)
    else:  # shadows of actors on what is at rest are those from the phase centre; pairs have edges of their own
        assert abs(found - truth) < 0.07
        assert stated > sim.tracer.static.error * sim.tracer.static.level / abs(channel(alone))


BOX = """<scene version="2.1.0">
    <bsdf type="itu-radio-material" id="mat-metal-sheet">
        <string name="type" value="metal"/><float name="thickness" value="0.1"/>
    </bsdf>
    <shape type="ply" id="box">
        <string name="filename" value="box.ply"/><boolean name="face_normals" value="true"/>
        <ref id="mat-metal-sheet" name="bsdf"/>
    </shape>
</scene>"""


@pytest.mark.parametrize("seed", [0, 1, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (2, 3))])
def test_a_box_that_stays_returns_what_one_that_moves_does(tmp_path, seed):
    """Of what stays no face is left out for looking away: rays alone must find that it is hidden, up to its rim."""
    rng = np.random.default_rng(seed)
    radar = Radar.load("awr1843", position=(0, 0, 0), look_at=(3, 0, 0), overrides={"pattern": {"kind": "sionna:iso"}})
    mesh = trimesh.creation.box(rng.uniform(0.02, 0.06, 3))
    mesh.apply_transform(trimesh.transformations.random_rotation_matrix(rng.random(3)))
    mesh = trimesh.Trimesh(mesh.vertices, mesh.faces[rng.permutation(12)], process=False)
    place = (3, rng.uniform(-0.5, 0.5), 0)
    moved = mesh.copy().apply_translation(place)
    (tmp_path / "box.ply").write_bytes(trimesh.exchange.ply.export_ply(moved))
    file = tmp_path / "box.xml"
    file.write_text(BOX)
    moving = channel(
        Simulator(None, radar, [MeshActor.from_mesh(mesh, material="pec", position=place)], rtol=1e-3).paths()
    )
    # 0.1 % of tolerance each, and metal is not quite a perfect conductor: 0.1 %
    assert abs(channel(Simulator(str(file), radar, rtol=1e-3).paths()) - moving) < 3e-3 * abs(moving)


def test_wall_is_an_image_of_the_radar(radar, tmp_path):
    """A metal wall 0.8 m square at 4 m: the mirror's level lambda / (4 pi 2 d) within the ripple of its rim.

    Four edges at 5 zones each add up to 1/(2 pi 5) = 3 % apiece: 1 dB.
    """
    file = tmp_path / "backdrop.xml"
    file.write_text(BACKDROP)
    sim = Simulator(str(file), radar, rtol=1e-3)
    level = abs(channel(sim.paths()))
    assert 20 * np.log10(level / (radar.wavelength / (4 * np.pi * 8.0))) == pytest.approx(0.0, abs=1.0)
    assert sim.paths().object_names == ("wall",)
    assert not sim.paths().velocity.any()


@pytest.mark.slow
def test_a_furnished_room_misses_no_more_of_its_shadows_than_is_allowed(monkeypatch):
    """Edges of shadows are looked at more closely: what a few hundred thousand facets miss adds up in part. All of it
    from the phase centre: what pairs see beside edges is stated by itself."""
    radar = Radar.load("awr1843", "mmmesh", position=(0, 0, 1), look_at=(3, 0, 1))
    monkeypatch.setattr(boundary_edges, "_LEFT_PER_RTOL", np.inf)
    static = Tracer(load_scene("living_room"), radar, [], 1e-2).static
    monkeypatch.setattr(sampling, "_STATIC_EDGE_ERROR", 2.0)  # cells three eighths as wide
    closer = Tracer(load_scene("living_room"), radar, [], 1e-2).static
    found, expected = (synthesize(radar, each.paths, 0.0, eps=1e-4, device="cpu") for each in (static, closer))
    assert closer.rays > 1.5 * static.rays
    assert np.linalg.norm(found - expected) < sampling.MISSED_PER_RTOL * 1e-2 * np.linalg.norm(expected)


@pytest.mark.parametrize("rtol", [0.1, pytest.param(0.03, marks=pytest.mark.slow)])
def test_what_goes_behind_another_does_not_state_more_than_it_returned(radar, rtol):
    """A screen that goes before a ball at 1 m/s hides it by the end of the frame: what is unknown of the shadow's edge
    is a part of what the ball returned before, however little is left (more than the whole of it, relative to that)."""
    ball = MeshActor.from_mesh(
        trimesh.creation.icosphere(subdivisions=3, radius=0.05), material="metal", position=(2, 0, 1), name="ball"
    )
    board = trimesh.creation.box((1e-3, 0.3, 0.3))
    screen = MeshActor.from_mesh(
        board, material="metal", position=(1, -0.144, 1), velocity=(0, 1, 0), orientation=(0.5, 0.3, 0)
    )
    tracer = Simulator(None, radar, [ball, screen], rtol=rtol).tracer
    before, behind = (abs(channel(of(tracer.trace(t, t).moving, "ball"))) for t in (0.0, 0.0276))
    assert behind < 0.3 * before
    assert tracer.trace(0.0, 0.0276).report.error < 0.25
