"""What is behind slabs: loss, delay, angle, polarisation and dispersion of walls, panes and clothes, there and back."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from scipy.interpolate import CubicSpline

from rfgen_sionna._types import SPEED_OF_LIGHT
from rfgen_sionna.radar import Radar
from rfgen_sionna.scene import MATERIALS, MeshActor, load_scene
from rfgen_sionna.simulation import Simulator
from rfgen_sionna.tracing.integral.slabs import transmission
from tests.physics.test_ghosts import decibels, sphere
from tests.sionna.rectangles import scene_of

ISOTROPIC = {"pattern": {"kind": "sionna:iso"}}
BALL = np.array([2.0, 0.3, 0.1])


def pane(x=1.0, turn=0.0, half=0.3, y=0.0):
    """Corners of a square across x, turned by so many degrees about z."""
    square = np.array([[0, -half, -half], [0, half, -half], [0, half, half], [0, -half, half]])
    c, s = np.cos(np.radians(turn)), np.sin(np.radians(turn))
    return square @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]).T + [x, y, 0]


def scene_with(**panes):
    return load_scene(scene_of(77e9, **panes).sionna)


def ball(material="pec", radius=0.01, position=BALL):
    return MeshActor.from_mesh(sphere(3, radius), material=material, position=position, name="ball")


def channel(paths, offset=0.0):
    """(tx, rx) coherent sums, `offset` [Hz] off the middle of the band."""
    gains = paths.a[..., 0]
    if paths.dispersion is not None:
        u = offset / paths.half_band
        gains = gains + sum(values[..., 0] * u**order for order, values in enumerate(paths.dispersion, start=1))
    return (gains * np.exp(-2j * np.pi * np.mod((paths.frequency + offset) * paths.tau[..., 0], 1.0))).sum(axis=-1)


def returned(radar, actor, scene=None, **options):
    options = {"rtol": 1e-2, "transmission": True, **options}
    paths = Simulator(scene, radar, [actor], **options).paths()
    return paths.select(paths.object_id == paths.object_names.index("ball"))


def there_and_back(properties, thickness, normal, field, frequency, place=BALL):
    """What is left of a wave of the elements' field, by their own polarisation."""
    k = place / np.linalg.norm(place)
    t_s, t_p = transmission(complex(properties.relative_permittivity(frequency)), 1.0, thickness,
                            np.array([abs(k @ normal)]), frequency)  # fmt: skip
    s = np.cross(k, normal)
    s /= np.linalg.norm(s)
    e = field - (field @ k) * k
    e /= np.linalg.norm(e)
    return complex(t_s[0] ** 2 * (e @ s) ** 2 + t_p[0] ** 2 * (e @ np.cross(s, k)) ** 2)


@pytest.fixture(scope="module")
def radar():
    return Radar.load("awr1843", overrides=ISOTROPIC)


@pytest.mark.parametrize(
    ("name", "thickness", "turn", "polarization"),
    [
        ("plasterboard", 0.0125, 0.0, "V"),
        ("wood", 0.02, 30.0, "H"),
        pytest.param("glass", 0.006, 55.0, "V", marks=pytest.mark.slow),
        ("glass", 0.006, 55.0, "H"),
        pytest.param("clothing", 0.001, 55.0, "H", marks=pytest.mark.slow),
    ],
)
def test_a_ball_behind_a_slab_returns_what_the_slab_s_coefficients_leave(name, thickness, turn, polarization):
    """In level and phase, over the band: complex ratio to free space within 2 % (a ball of 1 cm is not quite a point),
    and the group delay within a tenth of a millimetre and 1 %."""
    radar = Radar.load("awr1843", overrides=ISOTROPIC)
    radar = replace(radar, tx_polarization=polarization, rx_polarization=polarization)
    scene = scene_with(pane=(pane(turn=turn), name, thickness))
    free, behind = returned(radar, ball()), returned(radar, ball(), scene)
    angle = np.radians(turn)
    normal = np.array([np.cos(angle), np.sin(angle), 0])
    properties = scene.objects[0].properties
    ratios, truths, places = [], [], np.array([-1.0, -0.4, 0.3, 1.0])
    for offset in places * 0.5 * radar.waveform.bandwidth:
        ratios.append((channel(behind, offset) / channel(free, offset)).mean())
        frequency = radar.center_frequency + offset
        truths.append(there_and_back(properties, thickness, normal, radar.tx_field, frequency))
    np.testing.assert_allclose(ratios, truths, rtol=0.02)
    # Delays: what carries the bulk's, without the echoes, is the path's own length.
    eps = complex(properties.relative_permittivity(radar.center_frequency)).real
    index = np.sqrt(eps - 1 + (normal @ BALL / np.linalg.norm(BALL)) ** 2)
    _, alike, there = np.intersect1d(free.facet, behind.facet, return_indices=True)
    extra = behind.range[there].mean() - free.range[alike].mean()
    assert extra == pytest.approx(thickness * index, rel=0.01, abs=1e-4)
    assert set(behind.bounces) == {1}


@pytest.mark.slow
def test_several_slabs_in_a_row_multiply(radar):
    one, two = ("glass", 0.006), ("plasterboard", 0.0125)
    both = scene_with(pane=(pane(0.8), *one), board=(pane(1.2), *two))
    singles = [scene_with(pane=(pane(0.8), *one)), scene_with(board=(pane(1.2), *two))]
    free = channel(returned(radar, ball(), rtol=1e-2))
    ratios = [channel(returned(radar, ball(), scene, rtol=1e-2)) / free for scene in (both, *singles)]
    np.testing.assert_allclose(ratios[0], ratios[1] * ratios[2], rtol=0.03)


def test_what_is_opaque_stays_so_and_what_is_not_hides_where_it_is_told_to(radar):
    for name, thickness in (("metal", 0.001), ("concrete", 0.2)):
        assert returned(radar, ball(), scene_with(pane=(pane(), name, thickness))).num_paths == 0
    board = scene_with(pane=(pane(), "plasterboard", 0.0125))
    assert returned(radar, ball(), board, transmission=False).num_paths == 0
    assert returned(radar, ball(), board).num_paths > 0
    with pytest.raises(TypeError, match="transmission is 'yes'"):
        Simulator(board, radar, [], transmission="yes")


def test_where_nothing_is_in_between_nothing_changes(radar):
    """To the bit, with a pane beside the ball and without any; but for facets that are too faint, as nobody knows what
    a pane shows of them."""
    for scene in (None, scene_with(pane=(pane(y=2.0), "glass", 0.006))):
        here, there = (returned(radar, ball(), scene, transmission=each) for each in (True, False))
        np.testing.assert_array_equal(here.a, there.a)
        np.testing.assert_array_equal(here.tau, there.tau)


def test_a_body_under_clothes_returns_through_them(radar):
    """A skin ball of 4 cm in a shell of cloth 1 cm before it: its own return, as the cloth's coefficients leave it."""
    thickness = 1e-3
    sheet = replace(MATERIALS["clothing"], thickness=thickness)
    cloth = MeshActor.from_mesh(sphere(4, 0.05), material=sheet, position=(1.5, 0, 0), name="cloth")
    skin = MeshActor.from_mesh(sphere(4, 0.04), material="skin", position=(1.5, 0, 0), name="ball")
    bare = channel(returned(radar, skin))
    paths = Simulator(None, radar, [skin, cloth], rtol=1e-2, transmission=True).paths()
    under = channel(paths.select(paths.object_id == 0))
    t_s, _ = transmission(complex(cloth.properties.relative_permittivity(radar.center_frequency)), 1.0, thickness,
                          np.ones(1), radar.center_frequency)  # fmt: skip
    assert abs(decibels(under / bare / t_s[0] ** 2)).max() < 0.3
    hidden = Simulator(None, radar, [skin, cloth], rtol=1e-2).paths()
    assert not (hidden.object_id == 0).any()


def test_round_clothes_are_gone_through_at_the_angle_of_each_point(radar):
    """A metal ball of 10 cm in a shell of thick cloth, whose coefficients turn by half a radian over its first zones:
    against the integral over rings, of physical optics with what the cloth leaves at each ring's own angle."""
    there = {"tx_positions": np.array([[0, 1e-3, 0]]), "rx_positions": np.array([[0, -1e-3, 0]])}
    near = {"tx_names": ("T",), "rx_names": ("R",), "waveform": replace(radar.waveform, tx_order=(0,))}
    single = replace(radar, **there, **near)
    size, shell, away, thickness = 0.1, 0.115, 1.5, 3e-3
    sheet = replace(MATERIALS["clothing"], thickness=thickness)
    actors = [
        MeshActor.from_mesh(trimesh.creation.icosphere(4, radius), material=material, position=(away, 0, 0), name=name)
        for name, radius, material in (("ball", size, "pec"), ("cloth", shell, sheet))
    ]
    paths = Simulator(None, single, actors, rtol=1e-3, transmission=True).paths()
    found = channel(paths.select(paths.object_id == 0))[0, 0]
    step = np.arccos(size / away) / 200_000
    polar = step * (np.arange(200_000) + 0.5)
    distance = np.sqrt(away**2 + size**2 - 2 * away * size * np.cos(polar))
    facing = (away * np.cos(polar) - size) / distance
    aslant = away * size * np.sin(polar) / distance / shell
    eps = complex(actors[1].properties.relative_permittivity(radar.center_frequency))
    left = transmission(eps, 1.0, thickness, np.sqrt(1 - aslant**2), radar.center_frequency)
    left = 0.5 * (left[0] ** 2 + left[1] ** 2)
    rings = 2 * np.pi * size**2 * np.sin(polar) * step * facing / distance**2
    expected = -1j / (4 * np.pi) * (rings * left * np.exp(-4j * np.pi * distance / radar.wavelength)).sum()
    assert abs(found - expected) < 0.03 * abs(expected)  # one normal of the cloth for each facet of the ball


@pytest.mark.parametrize("size", [pytest.param(1.0, marks=pytest.mark.slow), 0.06])
def test_what_is_cut_by_a_pane_s_rim_returns_what_an_opening_there_shows(radar, size):
    """A plate behind metal walls with a window: as through the open window, times what the glass leaves, of large
    triangles and of small ones. Elements are next to the phase centre, from which shadows of slabs are cast."""
    there = {"tx_positions": np.array([[0, 1e-5, 0]]), "rx_positions": np.array([[0, -1e-5, 0]])}
    near = {"tx_names": ("T",), "rx_names": ("R",), "waveform": replace(radar.waveform, tx_order=(0,))}
    single = replace(radar, **there, **near)

    def wall(low, high):
        (y, z), (right, top) = low, high
        return np.array([[1.5, y, z], [1.5, right, z], [1.5, right, top], [1.5, y, top]])

    half = np.array([0.09, 0.12])
    walls = {
        "left": (wall((-1, -1), (-half[0], 1)), "metal", 0.01),
        "right": (wall((half[0], -1), (1, 1)), "metal", 0.01),
        "below": (wall((-half[0], -1), (half[0], -half[1])), "metal", 0.01),
        "above": (wall((-half[0], half[1]), (half[0], 1)), "metal", 0.01),
    }
    thickness = 0.5e-3
    window = scene_with(**walls, glass=(wall(-half, half), "glass", thickness))
    quad = [[3.0, -0.2, -0.15], [3.004, 0.3, -0.15], [3.007, 0.3, 0.25], [3.003, -0.2, 0.25]]
    vertices, faces = trimesh.remesh.subdivide_to_size(np.array(quad), np.array([[0, 2, 1], [0, 3, 2]]), size)
    plate = MeshActor.from_mesh((vertices, faces), material="metal", name="plate")

    def any_visible(scene):
        paths = Simulator(scene, single, [plate], rtol=1e-3, transmission=True).paths()
        return channel(paths.select(paths.object_id == paths.object_names.index("plate")))[0, 0]

    glass = window.objects[-1].properties
    left = transmission(complex(glass.relative_permittivity(radar.center_frequency)), 1.0, thickness, np.ones(1),
                        radar.center_frequency)[0][0] ** 2  # fmt: skip
    opened = any_visible(scene_with(**walls))
    assert abs(any_visible(window) / left - opened) < 5e-3 * abs(opened)


def test_between_instants_a_pane_s_rim_moves_on_over_what_is_behind(radar):
    """A metal plate comes out from behind a pane at 1.5 m/s: the phase of the part behind it turns by 2 rad from one
    instant to the next. Against the same instants by themselves, 28 % if gains went by the middle of facets."""
    quad = np.array([[0, -0.15, -0.1], [0.004, 0.15, -0.1], [0.007, 0.15, 0.1], [0.003, -0.15, 0.1]])
    mesh = trimesh.remesh.subdivide_to_size(quad, np.array([[0, 2, 1], [0, 3, 2]]), 0.05)
    scene = scene_with(glass=(pane(1.0, half=0.15), "glass", 0.5e-3))

    def tracer():
        plate = MeshActor.from_mesh(
            mesh, material="metal", trajectory=lambda t: (2.5, 0.35 + 1.5 * t, 0.02), name="plate"
        )
        return Simulator(scene, radar, [plate], rtol=1e-3, transmission=True).tracer

    def at(traced, t):
        paths = traced.moving
        a, tau = (CubicSpline(paths.times, each, axis=-1)(t) for each in (paths.a, paths.tau))
        return (a * np.exp(-2j * np.pi * np.mod(paths.frequency * tau, 1.0))).sum(axis=-1)

    traced = tracer().trace(0.0, 0.01)
    for t in (0.0017, 0.005, 0.0083):
        alone = channel(tracer().trace(t, t).moving)
        assert np.linalg.norm(at(traced, t) - alone) < 0.05 * np.linalg.norm(alone)


def test_the_back_of_a_hollow_ball_is_as_round_as_its_front(radar):
    """Through the front of a wooden shell its back is seen from inside. A shell that is known to be closed returns what
    one with a hole in its rim does, in which every face counts as seen."""
    shell = trimesh.creation.icosphere(subdivisions=3, radius=0.2)
    rim = int(shell.triangles_center[:, 2].argmax())
    wood = replace(MATERIALS["wood"], name="shell", thickness=3e-3)

    def any_visible(faces, transmission):
        actor = MeshActor.from_mesh((shell.vertices, faces), material=wood, position=(2.0, 0.1, 0.0), name="shell")
        return channel(Simulator(None, radar, [actor], rtol=1e-2, transmission=transmission).paths())

    whole = any_visible(shell.faces, True)
    assert abs(whole - any_visible(np.delete(shell.faces, rim, axis=0), True)).max() < 0.02 * abs(whole).max()
    assert abs(whole - any_visible(shell.faces, False)).max() > 0.1 * abs(whole).max()  # the back's part in it


def test_coming_out_from_behind_a_pane_is_a_slope_and_not_a_step(radar):
    """A ball crosses the rim of a pane: its level goes from what the pane leaves to all by and by. Elements are next to
    the phase centre: of a pair further apart one way goes through the pane before the other does, and both interfere.
    """
    there = {"tx_positions": np.array([[0, 1e-5, 0]]), "rx_positions": np.array([[0, -1e-5, 0]])}
    near = {"tx_names": ("T",), "rx_names": ("R",), "waveform": replace(radar.waveform, tx_order=(0,))}
    radar = replace(radar, **there, **near)
    # The pane's rim at y = 0 as seen from the radar; the ball moves across it within a frame or so.
    scene = scene_with(pane=(pane(y=-0.3), "plasterboard", 0.0125))
    actor = MeshActor.from_mesh(
        sphere(4, 0.03), material="pec", position=(2, -0.06, 0), velocity=(0, 4.0, 0), name="ball"
    )
    simulator = Simulator(scene, radar, [actor], rtol=1e-2, transmission=True)
    run = simulator.tracer.follow()
    levels = []
    for t in np.arange(0, 0.03, 0.01):
        times, total = np.linspace(t, t + 0.01, 21), np.zeros(21, complex)
        for paths in simulator.tracer.trace(t, t + 0.01, run).actors:
            at = paths.select(paths.object_id == paths.object_names.index("ball")).at(times)
            phasor = np.exp(-2j * np.pi * np.mod(at.frequency * at.tau[0, 0], 1.0))
            total += (at.a[0, 0] * phasor).sum(axis=0)
        levels.append(np.abs(total))
    level = np.concatenate(levels)
    assert decibels(level[-1] / level[0]) > 10
    # From where the ball's specular point crosses the rim on it is all seen.
    assert np.abs(np.diff(level)).max() < 0.5 * level.max()


def test_furniture_behind_a_wall_is_seen_through_it_and_hidden_by_who_stands_before_it(radar):
    """A static plate behind a static board: the board's loss there and back; a metal board before both takes it all."""
    plate = [[1.8, -0.1, -0.1], [1.8, 0.1, -0.1], [1.8, 0.1, 0.1], [1.8, -0.1, 0.1]]
    target = {"target": (plate, "pec", 0.01)}
    sums = []
    for panes in ({}, {"pane": (pane(1.2), "plasterboard", 0.0125)}):
        scene = scene_with(**target, **panes)
        for actors in ([], [MeshActor.from_mesh(trimesh.creation.box((0.01, 0.4, 0.4)), material="metal",
                                            position=(0.8, 0, 0), name="board")]):  # fmt: skip
            paths = Simulator(scene, radar, actors, rtol=1e-3, transmission=True).paths()
            name = paths.object_names.index("target")
            sums.append(channel(paths.select(paths.object_id == name)))
    free, hidden, through, both = sums
    properties = next(each.properties for each in scene.objects if each.name == "pane")
    t_s, _ = transmission(complex(properties.relative_permittivity(radar.center_frequency)), 1.0, 0.0125,
                          np.ones(1), radar.center_frequency)  # fmt: skip
    np.testing.assert_allclose(through / free, t_s[0] ** 2, rtol=0.03)
    # 40 dB: shadows end with pixels
    assert abs(hidden).max() < 1e-2 * abs(free).max()
    assert abs(both).max() < 1e-2 * abs(through).max()


def test_tx_and_rx_changed_over_see_the_same_through_a_wall():
    radar = Radar.load("awr1843", overrides=ISOTROPIC)
    place = np.array([[0.0, 0.03, 0.01]])
    ends = {"tx_names": ("T",), "rx_names": ("R",), "waveform": replace(radar.waveform, tx_order=(0,))}
    one = replace(radar, tx_positions=place, rx_positions=-place, tx_polarization="+45", rx_polarization="V", **ends)
    other = replace(one, tx_positions=-place, rx_positions=place, tx_polarization="V", rx_polarization="+45")
    scene = scene_with(pane=(pane(turn=40), "glass", 0.006))
    here, there = (channel(returned(each, ball(), scene)) for each in (one, other))
    assert abs(here / there - 1).max() < 1e-6


def test_a_slab_without_loss_keeps_the_energy():
    """|T|^2 + |R|^2 = 1 for both polarisations, at all angles; and half a wavelength inside lets all through."""
    from tests.reference.physical_optics import fresnel, slab

    cos = np.linspace(0.05, 1, 50)
    for eps, turns in ((2.5, 1.3), (6.0, 0.4)):
        frequency = 77e9
        thickness = turns * SPEED_OF_LIGHT / frequency
        for r, t in zip(fresnel(eps, 1.0, cos), transmission(eps, 1.0, thickness, cos, frequency), strict=True):
            np.testing.assert_allclose(np.abs(t) ** 2 + np.abs(slab(r, eps, cos, turns)) ** 2, 1.0, rtol=1e-9)
    half = 0.5 * SPEED_OF_LIGHT / 77e9 / np.sqrt(4.0)
    assert abs(transmission(4.0, 1.0, half, np.ones(1), 77e9)[0][0]) == pytest.approx(1.0)


@pytest.mark.parametrize(("thickness", "told"), [(0.02, False), (0.0517, True), (1.0, False)])
def test_the_echo_of_a_back_face_that_is_left_out_is_told(radar, caplog, thickness, told):
    """Of foam: at 2 cm it is part of what the slab returns, at 5 cm it is 65 % of the front's, and at 1 m it is lost
    in the slab. One material is told of once."""
    foam = replace(MATERIALS["foam"], thickness=thickness)
    plates = [
        MeshActor.from_mesh((pane(y=y), [[0, 2, 1], [0, 3, 2]]), material=foam, name=f"pane {y}") for y in (0.0, 1.0)
    ]
    with caplog.at_level("WARNING"):
        _ = Simulator(None, radar, plates, rtol=1e-3).tracer
    assert ["back face" in each.message for each in caplog.records] == [True] * told
