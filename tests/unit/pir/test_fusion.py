"""Images of surroundings as paths: energies and places exact, phases fixed, traced phases untouched."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from scipy.signal import get_window

from rfgen_sionna._types import SPEED_OF_LIGHT
from rfgen_sionna.pir.fused_tracer import FusedTracer
from rfgen_sionna.pir.fusion import Refinement, concatenate_paths, image, rasterise
from rfgen_sionna.pir.image_surroundings import SOFT_EDGE, ImageSurroundings
from rfgen_sionna.pir.view import View
from rfgen_sionna.radar import Radar
from rfgen_sionna.records import PathKind, Pir
from rfgen_sionna.scene import MeshActor
from rfgen_sionna.signal import synthesize
from rfgen_sionna.simulation import Simulator

PIXELS = (24, 32)


@pytest.fixture(scope="module")
def radar(tiny_toml):
    return Radar.load(tiny_toml, position=(0, 0, 1), look_at=(3, 0, 1))


@pytest.fixture(scope="module")
def ball():
    """A ball of 1,280 facets that flies across the view."""
    mesh = trimesh.creation.icosphere(subdivisions=3, radius=0.25)
    return MeshActor.from_mesh(mesh, material="metal", name="ball", position=(2.5, -0.2, 1), velocity=(0.3, 0.8, 0.1))


def wall(
    radar, distance=4.0, level_db=-90.0, spread_db=3.0, seed=0, velocity=0.0, fov=(60.0, 46.0), projection="perspective"
):
    """A wall across the boresight, of random energies."""
    view = View(PIXELS, fov, radar.position, radar.orientation, projection)
    reach = distance / (view.directions @ radar.rotation[:, 0])
    levels = level_db + spread_db * np.random.default_rng(seed).normal(size=PIXELS)
    return Pir(
        10 ** (levels / 10),
        2 * reach / SPEED_OF_LIGHT,
        np.full(PIXELS, velocity),
        view.fov_deg,
        view.position,
        view.orientation,
        view.projection,
    )


def single(pir, row, column):
    """The image with one pixel left."""
    energy = np.zeros(PIXELS)
    energy[row, column] = pir.energy[row, column]
    return replace(pir, energy=energy)


class Refine:
    """Multiplies energies by a pattern that is another one at every instant, and adds some where nothing was."""

    def __init__(self, deviation_db=3.0, added=0.0):
        self.deviation_db, self.added = deviation_db, added

    def refine_sequence(self, frames):
        out = []
        for number, frame in enumerate(frames):
            factor = 10 ** (self.deviation_db / 10 * np.random.default_rng(number).normal(size=frame.energy.shape))
            empty = frame.energy == 0
            out.append(
                replace(
                    frame,
                    energy=np.where(empty, self.added, frame.energy * factor),
                    time_of_arrival=np.where(empty, 2 * 3.3 / SPEED_OF_LIGHT, frame.time_of_arrival),
                )
            )
        return out


@pytest.mark.parametrize(("t", "projection"), [(0.0, "perspective"), (0.13, "perspective"), (0.13, "equirectangular")])
def test_rasterising_what_was_fused_gives_the_image_back(radar, ball, t, projection):
    """Every pixel: with an actor in front, without anything before, beside the actor; within 0.1 dB (here 1e-6)."""
    environment = wall(radar, projection=projection)
    environment.energy[:, :6] = 0.0  # nothing known there
    fusion = FusedTracer(Simulator(None, radar, [ball], rtol=1e-3).tracer, environment, 1, Refine(added=3e-10))
    (mixed,) = fusion.images([t])
    (refined,) = Refine(added=3e-10).refine_sequence([mixed])
    limited = np.clip(refined.energy / np.where(mixed.energy > 0, mixed.energy, np.inf), 10**-1.5, 10**1.5)
    wanted = np.where(mixed.energy > 0, mixed.energy * limited, refined.energy)
    paths = concatenate_paths(fusion.instant(t))
    found = rasterise(paths, fusion.surroundings.view, t)
    np.testing.assert_allclose(found.energy, wanted, rtol=1e-6)
    np.testing.assert_allclose(found.time_of_arrival, refined.time_of_arrival, atol=2e-12)
    assert set(paths.object_names) >= {"ball", "environment"}
    assert {PathKind(int(kind)) for kind in np.unique(paths.kind)} == {PathKind.FACET, PathKind.ENVIRONMENT}


def test_nothing_around_and_nothing_refined_is_the_traced_cube(radar, ball):
    """Bit for bit."""

    class Identity:
        def refine_sequence(self, frames):
            return list(frames)

    traced = Simulator(None, radar, [ball], rtol=1e-3, seed=3).adc(0.1, seed=5)
    empty = replace(wall(radar), energy=np.zeros(PIXELS))
    fused = Simulator(None, radar, [ball], rtol=1e-3, seed=3, environment=empty, refiner=Identity()).adc(0.1, seed=5)
    assert np.array_equal(traced.data, fused.data)
    alone = Simulator(None, radar, [ball], rtol=1e-3, seed=3, environment=empty).adc(0.1, seed=5)
    assert np.array_equal(traced.data, alone.data)


def test_a_static_environment_stays_in_the_middle_of_the_doppler_axis(radar):
    """With a Hann window nothing but rounding lies beyond one bin from zero."""
    frame = Simulator(None, radar, rtol=1e-3, environment=wall(radar)).adc(0.05, noise=False).data[0]
    doppler = np.fft.fft(frame * get_window("hann", len(frame))[:, None, None, None], axis=0)
    power = np.square(np.abs(doppler)).sum(axis=(1, 2, 3))
    assert power[2:-1].max() < 1e-12 * power[0]


def test_a_moving_pixel_has_its_doppler(radar):
    """A receding pixel's phase turns by 2 k v per second, at the pixel's own chirp times."""
    speed = 1.7
    pixel = single(wall(radar, velocity=speed), 12, 16)
    frame = Simulator(None, radar, rtol=1e-3, environment=pixel).adc(0.05, noise=False).data[0]
    turn = np.angle(np.sum(frame[1:, 0] * np.conj(frame[:-1, 0])))
    expected = 4 * np.pi * speed / radar.wavelength * radar.waveform.loop_period
    assert np.angle(np.exp(1j * (turn - expected))) == pytest.approx(0.0, abs=np.radians(0.5))


@pytest.mark.parametrize(
    ("row", "column", "projection"),
    [(12, 16, "perspective"), (3, 28, "perspective"), (20, 1, "perspective"), (20, 1, "equirectangular")],
)
def test_a_pixel_returns_its_energy_from_its_place(radar, row, column, projection):
    """|sample|^2 = E G_t G_r P_t, and the beat frequency is that of its distance."""
    pir = single(wall(radar, projection=projection), row, column)
    paths = Simulator(None, radar, rtol=1e-3, environment=pir).paths()
    direction = View.of(pir).directions[row, column]
    np.testing.assert_allclose(paths.direction[0, 0], direction, atol=1e-12)
    assert 0.5 * SPEED_OF_LIGHT * pir.time_of_arrival[row, column] == pytest.approx(float(paths.range[0, 0]), abs=2e-3)
    gain = 10 ** (radar.pattern.gain_db(direction @ radar.rotation) / 10)
    samples = synthesize(radar, paths, 0.0)
    watts = pir.energy[row, column] * gain**2 * 1e-3 * 10 ** (radar.tx_power_dbm / 10)
    np.testing.assert_allclose(np.abs(samples) ** 2, watts, rtol=1e-4)


def test_phases_are_drawn_once_for_each_pixel(radar):
    """The same from run to run and whatever else the image shows; another seed gives others."""
    whole, alone = wall(radar), single(wall(radar), 5, 7)
    at = 5 * PIXELS[1] + 7
    first = ImageSurroundings(whole, radar, 1).paths(np.zeros(1), np.ones((whole.energy.size, 1))).a[0, 0, at, 0]
    again = ImageSurroundings(alone, radar, 1).paths(np.zeros(1), np.ones((1, 1))).a[0, 0, 0, 0]
    other = ImageSurroundings(alone, radar, 2).paths(np.zeros(1), np.ones((1, 1))).a[0, 0, 0, 0]
    assert first == again
    assert abs(np.angle(first / other)) > 1e-3


def test_an_actor_hides_what_is_behind_it(radar):
    """A plate of 1 m x 1 m at 2 m before a wall at 4 m hides a square of 2 m; before a wall at 1.5 m it hides nothing,
    and is hidden itself."""
    plate = trimesh.creation.box((0.01, 1.0, 1.0)).subdivide().subdivide()
    actor = MeshActor.from_mesh(plate, material="metal", position=(2, 0, 1))
    behind = Simulator(None, radar, [actor], rtol=1e-3, environment=wall(radar))
    seen = behind.paths()
    shown = seen.select(seen.kind == PathKind.ENVIRONMENT)
    points = wall(radar).energy.ravel()
    share = np.abs(shown.a[0, 0, :, 0]) ** 2 / points
    y, z = (4 * shown.direction[:, 0, i] / shown.direction[:, 0, 0] for i in (1, 2))
    pixel = 4 * 2 * np.tan(np.radians(30)) / PIXELS[1]
    inside = (np.abs(y) < 1 - pixel) & (np.abs(z) < 1 - pixel)
    outside = (np.abs(y) > 1 + pixel) | (np.abs(z) > 1 + pixel)
    assert inside.any()
    assert not share[inside].any()
    np.testing.assert_allclose(share[outside], 1.0, rtol=1e-12)
    # The shadow has the plate's area: 4 m^2 of the wall, to a quarter of the outline's pixels.
    assert (1 - share).sum() * pixel**2 == pytest.approx(4.0, abs=0.25 * 8 / pixel * pixel**2)
    front = Simulator(None, radar, [actor], rtol=1e-3, environment=wall(radar, 1.5)).paths()
    assert not front.a[:, :, front.kind == PathKind.FACET].any()
    np.testing.assert_allclose(np.abs(front.a[0, 0, front.kind == PathKind.ENVIRONMENT, 0]) ** 2, points, rtol=1e-12)


def test_who_is_behind_the_surroundings_all_along_is_told(radar):
    """By more than `SOFT_EDGE`, and as long as he is; what comes out at one instant, or stands aside, is not hidden."""
    ball = MeshActor.from_mesh(
        trimesh.creation.icosphere(subdivisions=2, radius=0.2), material="metal", position=(5, 0, 1)
    )
    behind = Simulator(None, radar, [ball], rtol=1e-3, environment=wall(radar, 4.0))
    assert behind.is_occluded(behind.actors[0], 0.0, 0.2)
    with pytest.warns(UserWarning, match="behind the surroundings that the image shows all along"):
        behind.frames(0.05, noise=False)
    for distance, position, velocity in (
        (4.8, (5, 0, 1), (0, 0, 0)),
        (4.0, (5, 0, 1), (-6, 0, 0)),
        (4.0, (5, 4, 1), (0, 0, 0)),
    ):
        actor = replace(ball, position=position, velocity=velocity)
        seen = Simulator(None, radar, [actor], rtol=1e-3, environment=wall(radar, distance))
        assert not seen.is_occluded(seen.actors[0], 0.0, 0.2), (distance, position, velocity)


def test_who_comes_to_be_half_behind_the_surroundings_is_told(radar, recwarn):
    """A plate that turns its rim to the radar, half of it more than `SOFT_EDGE` behind a wall; and one that is not."""
    plate = trimesh.creation.box((2.0, 0.1, 0.5)).subdivide().subdivide().subdivide()
    actor = MeshActor.from_mesh(plate, material="metal", name="plate", position=(3.0, 0.4, 1))
    Simulator(None, radar, [actor], rtol=1e-3, environment=wall(radar, 4.0)).frames(0.05, noise=False)
    assert not recwarn.list
    leaving = replace(actor, velocity=(24.0, 0, 0))
    with pytest.warns(UserWarning, match=r"'plate' is behind the surr.*, or in them, by \d\d% at t = 0.05 s"):
        Simulator(None, radar, [leaving], rtol=1e-3, environment=wall(radar, 4.0)).frames(0.1, noise=False)


def test_what_goes_behind_the_surroundings_fades_smoothly(radar):
    """From 0 to `SOFT_EDGE` behind a wall, steadily, without steps."""
    paths = ImageSurroundings(wall(radar, 3.0), radar, 0)
    ahead = np.linspace(2.9, 3.1 + SOFT_EDGE, 200)
    weight = paths._fade(paths._distance, ahead, np.full(200, 11.3), np.full(200, 15.8))
    assert weight[0] == 1.0
    assert weight[-1] == 0.0
    assert np.diff(weight).max() <= 1e-12
    assert np.abs(np.diff(weight)).max() < 3 * (ahead[1] - ahead[0]) / SOFT_EDGE


def test_refinement_leaves_phases_and_delays_alone(radar, ball):
    """Over frames: gains change by real factors above 0, and never by steps; delays not at all."""
    environment, refiner = wall(radar), Refine()
    # At this tolerance facets are whole faces, whose paths can be told from frame to frame.
    plain, fusion = (
        FusedTracer(Simulator(None, radar, [ball], rtol=1e-2).tracer, environment, 0, each) for each in (None, refiner)
    )
    refinement = fusion.refinement(0.0, 1.0)
    levels = []
    runs = [each._tracer.follow() for each in (plain, fusion)]
    for start in np.arange(0.0, 1.0, 0.05):
        length = radar.waveform.frame_length
        before, after = (
            each.trace(start, start + length, run, change).parts
            for each, run, change in zip((plain, fusion), runs, (None, refinement), strict=True)
        )
        for old, new in zip(before, after, strict=True):
            assert np.array_equal(old.tau, new.tau)
            there = np.abs(old.a) > 0
            ratio = new.a[there] / old.a[there]
            np.testing.assert_allclose(ratio.imag, 0.0, atol=1e-12)
            assert (ratio.real > 0).all()
            assert np.abs(20 * np.log10(ratio.real)).max() <= 15.0 + 1e-9
        level = np.full(len(ball.faces), np.nan)
        strength = np.abs(before[0].a[0, 0, :, 0])
        found = strength > 0
        change = np.log(np.abs(after[0].a[0, 0, found, 0]) / strength[found])
        level[before[0].facet[found]] = change
        faces = runs[0].plan(plain._tracer._run_scene, start, start + length).mesh.face_in_surface
        level[np.bincount(faces, minlength=len(level)) > 1] = np.nan  # of pieces each has its own
        levels.append(level)
    steps = np.abs(np.diff(levels, axis=0))
    assert np.nanmax(np.abs(levels)) > 0.5
    # Smoothstep over half a second, of at most twice 15 dB: 1.5 times the mean slope.
    assert np.nanmax(steps) < 1.5 * 2 * 15 / 8.686 * 0.05 / 0.5


def test_a_moving_radar_sees_points_that_stay(radar):
    """Delays of the pixels follow the distances from where the elements are, also while the radar turns."""
    moving = replace(radar, trajectory=lambda t: ((0.4 * t, 0.2 * t, 1.0), (0.3 * t, 0.0, 0.0)))
    environment = wall(radar)
    fusion = FusedTracer(Simulator(None, moving, rtol=1e-3).tracer, environment, 0)
    start, stop = 0.2, 0.23
    (_, around) = fusion.trace(start, stop, fusion._tracer.follow(), None).parts
    view = View.of(environment)
    distance = 0.5 * SPEED_OF_LIGHT * environment.time_of_arrival.ravel()
    points = np.asarray(radar.position) + distance[:, None] * view.directions.reshape(-1, 3)
    tried = np.linspace(start, stop, 7)
    delays = around.tau @ around.weights(tried).T
    for k, t in enumerate(tried):
        there = moving.at(float(t))
        to_tx = np.linalg.norm(points - there.tx_world[1], axis=1)
        to_rx = np.linalg.norm(points - there.rx_world[2], axis=1)
        phase = 2 * np.pi * radar.center_frequency * (delays[1, 2, :, k] - (to_tx + to_rx) / SPEED_OF_LIGHT)
        assert np.abs(phase).max() < np.radians(0.1)
    # What is seen on the left of a radar that has turned left by 0.3 t comes nearer to its boresight.
    here = moving.at(start)
    expected = (points - np.asarray(here.position)) @ here.rotation @ radar.rotation.T
    expected /= np.linalg.norm(expected, axis=1, keepdims=True)
    np.testing.assert_allclose(around.direction[:, 0], expected, atol=1e-9)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"energy": np.full(PIXELS, -1.0)}, r"environment.energy\[0, 0\] is .*-1"),
        ({"energy": np.full(PIXELS, np.nan)}, "environment.energy"),
        ({"energy": np.full(PIXELS, 2.0)}, "at most the sent energy"),
        ({"time_of_arrival": np.full(PIXELS, np.nan)}, "environment.time_of_arrival"),
        ({"velocity": np.full(PIXELS, np.inf)}, "environment.velocity"),
        ({"velocity": np.zeros((2, 2))}, "shapes"),
        ({"projection": "fisheye"}, "perspective"),
    ],
)
def test_images_of_the_wrong_range_are_refused(radar, change, words):
    with pytest.raises(ValueError, match=words):
        Simulator(None, radar, environment=replace(wall(radar), **change))


def test_what_does_not_go_together_is_refused(radar, ball):
    environment = wall(radar)
    with pytest.raises(ValueError, match="scene=None"):
        Simulator("living_room", radar, environment=environment)
    with pytest.raises(ValueError, match="refiner needs an environment"):
        Simulator(None, radar, [ball], refiner=Refine())
    with pytest.raises(TypeError, match="environment is a ndarray"):
        Simulator(None, radar, environment=environment.energy)
    moving = replace(radar, trajectory=lambda t: (0.1 * t, 0, 1))
    with pytest.raises(ValueError, match="the radar moves"):
        Simulator(None, moving, environment=environment, refiner=Refine())
    with pytest.raises(ValueError, match="one for each"):
        Refinement([environment], [], radar, 0)
    with pytest.raises(ValueError, match="view"):
        Refinement([environment], [replace(environment, fov_deg=(50.0, 40.0))], radar, 0)


@pytest.mark.parametrize("projection", ["perspective", "equirectangular"])
def test_the_image_of_a_run_is_the_one_that_was_given(radar, projection):
    """Without actors the rasterised surroundings are the image again."""
    environment = wall(radar, projection=projection)
    found = Simulator(None, radar, rtol=1e-3, environment=environment).pir(
        0.0, PIXELS, (60.0, 46.0), projection=projection
    )
    assert found.projection == projection
    np.testing.assert_allclose(found.energy, environment.energy, rtol=1e-9)
    np.testing.assert_allclose(found.time_of_arrival, environment.time_of_arrival, atol=2e-12)
    twice = image(
        [ImageSurroundings(environment, radar, s).paths(np.zeros(1), np.ones((768, 1))) for s in (0, 1)],
        View.of(environment),
        0.0,
    )
    np.testing.assert_allclose(twice.energy, 2 * environment.energy, rtol=1e-9)


@pytest.mark.parametrize("direction", [(-1, 0, 0), (-1, 1e-3, 0), (-1, -1e-3, 0), (0, 0, 1), (0, 0, -1), (1, 0, 0)])
def test_surroundings_all_around_hide_without_a_seam(radar, direction):
    """A closed image keeps back what is behind it in every direction."""
    view = View(PIXELS, (360.0, 180.0), radar.position, radar.orientation, "equirectangular")
    pir = Pir(
        np.full(PIXELS, 1e-9), np.full(PIXELS, 2 * 3.0 / SPEED_OF_LIGHT), np.zeros(PIXELS), view.fov_deg,
        view.position, view.orientation, view.projection,
    )  # fmt: skip
    surroundings = ImageSurroundings(pir, radar, 0)
    unit = np.array(direction) / np.linalg.norm(direction)
    hidden = surroundings.occluded(np.zeros(3), np.asarray(radar.position) + np.array([[2.0], [5.0]]) * unit)
    np.testing.assert_allclose(hidden, [0.0, 1.0], atol=1e-12)


@pytest.mark.slow
def test_what_returns_next_to_nothing_is_in_the_image_all_the_same():
    """At a tolerance of a tenth, of a fine ball of which half lies off the beam."""
    aimed = Radar.load("awr1843", "mmmesh", position=(0, 0, 1), look_at=(3, 0, 1))
    mesh = trimesh.creation.icosphere(subdivisions=6, radius=1.2)
    actors = [MeshActor.from_mesh(mesh, material="metal", name="ball", position=(1.1, 1.9, 1))]
    environment = wall(aimed, distance=6.0, fov=(170.0, 60.0), projection="equirectangular")
    environment.energy[:] = 0.0
    fusions = [FusedTracer(Simulator(None, aimed, actors, rtol=rtol).tracer, environment, 1) for rtol in (0.1, 1e-3)]
    (found,), (wanted,) = (fusion.images([0.0]) for fusion in fusions)
    assert np.count_nonzero(wanted.energy) > 200
    assert np.array_equal(found.energy > 0, wanted.energy > 0)
    # What goes to a radar leaves most of it out.
    paths, every = (sum(part.num_paths for part in fusion.instant(0.0)) for fusion in fusions)
    assert paths < 0.3 * every


def test_an_actor_before_an_image_is_looked_at_at_every_knot(radar):
    """An image is occluded at the same knots as everything else; being watched adds none."""
    mesh = trimesh.creation.icosphere(subdivisions=3, radius=0.25)
    actor = MeshActor.from_mesh(mesh, material="metal", name="ball", position=(2.5, -0.2, 1), velocity=(0.0, 0.2, 0.0))
    tracer = Simulator(None, radar, [actor], rtol=1e-2).tracer
    alone = tracer.trace(0.0, 0.025)
    watched = list[float]()
    before_it = tracer.trace(0.0, 0.025, watch=lambda t, rays: watched.append(t))
    assert before_it.report.sample_times == alone.report.sample_times
    assert watched == before_it.moving.times.tolist()
