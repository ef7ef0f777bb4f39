"""A simulation refuses what cannot be before it starts, and its samples are what its paths say."""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

import rfgen_sionna as rfgen
from rfgen_sionna.scene import CoarseMeshWarning
from rfgen_sionna.signal import synthesize
from rfgen_sionna.signal.noise import noise_power

BALL = trimesh.creation.icosphere(subdivisions=2, radius=0.1)
POINTS = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
FACES = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])


@pytest.fixture(scope="module")
def radar(tiny_toml: Path) -> Any:
    return rfgen.Radar.load(tiny_toml, position=(0, 0, 1), look_at=(3, 0, 1))


def ball(name: str = "ball", **changes: Any) -> Any:
    return rfgen.Actor.from_mesh(BALL, **{"material": "metal", "position": (3, 0, 1), "name": name} | changes)


@contextmanager
def refused(error: type[Exception], *parts: str) -> Iterator[None]:
    """The block raises `error` with all `parts` in its message, without building a tracer, within a second."""
    from rfgen_sionna.tracing.tracer import Tracer

    built: list[Any] = []
    original: Callable[..., None] = Tracer.__init__
    started = time.perf_counter()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Tracer, "__init__", lambda self, *a, **k: (built.append(self), original(self, *a, **k))[1])
        with pytest.raises(error) as caught:
            yield
    for part in parts:
        assert part in str(caught.value)
    assert not built, "long work had begun"
    assert time.perf_counter() - started < 1.0


# -- bad input ------------------------------------------------------------------------------------------------


def test_what_is_no_radar_actor_or_scene_is_refused(radar: Any) -> None:
    with refused(TypeError, "radar is a str", "Radar.load"):
        rfgen.Simulator(None, "awr1843")  # type: ignore[arg-type]
    with refused(TypeError, "Trimesh", "Actor.from_mesh"):
        rfgen.Simulator(None, radar, [BALL])
    for actors in (3, np.array(0.01), None):
        with refused(TypeError, f"actors is {actors!r}"):
            rfgen.Simulator(None, radar, actors)  # type: ignore[arg-type]
    with refused(TypeError, "scene", "list", "sionna.rt.Scene"):
        rfgen.Simulator([1, 2], radar)
    with refused(ValueError, "living_rom", "living_room"):
        rfgen.Simulator("living_rom", radar)


@pytest.mark.parametrize("rtol", [0.0, -1e-3, 1e-9, 0.31, 1.0, 10**400, True, float("nan"), "fine", None])
def test_rtol_out_of_range(radar: Any, rtol: Any) -> None:
    with refused(ValueError, f"rtol is {rtol!r}", "1e-08 … 0.3"):
        rfgen.Simulator(None, radar, rtol=rtol)


def test_actors_have_names_of_their_own(radar: Any) -> None:
    with refused(ValueError, "'one'", "name=…"):
        rfgen.Simulator(None, radar, [ball("one"), ball("two"), ball("one", position=(4, 0, 1))])


@pytest.mark.parametrize("position", [(3, 0, 1), (2.899, 0, 1), (3.05, 0.02, 0.97)])
def test_a_radar_in_or_at_an_actor(radar: Any, position: tuple[float, float, float]) -> None:
    with refused(ValueError, "radar position", "'ball'"):
        rfgen.Simulator(None, radar.placed(position=position), [ball()])


@pytest.fixture(scope="module")
def living_room() -> Any:
    return rfgen.load_scene("living_room")


@pytest.mark.parametrize("name", ["wall", "sofa"])
def test_a_radar_in_a_wall_or_in_furniture(living_room: Any, radar: Any, name: str) -> None:
    living_room.tune(radar.center_frequency)
    item = next(item for item in living_room.objects if name in item.name)
    triangles = item.vertices[item.faces]
    # A little behind the middle of the largest face.
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    largest = np.linalg.norm(normals, axis=1).argmax()
    inside = triangles[largest].mean(axis=0) - 0.01 * normals[largest] / np.linalg.norm(normals[largest])
    with refused(ValueError, "radar position", item.name):
        rfgen.Simulator(living_room, radar.placed(position=tuple(inside)), [])


def test_a_target_beyond_the_range_window(radar: Any) -> None:
    assert 10.9 < radar.max_range < 11
    sim = rfgen.Simulator(None, radar, [ball(position=(10.95, 0, 1))])
    with refused(ValueError, "'ball'", "11.05 m", "10.99 m", "preset"):
        sim.adc(0.1)
    with refused(ValueError, "'ball'", "11.05 m", "10.99 m"):
        sim.paths(0.0)


def test_a_target_that_only_gets_there_during_the_run(radar: Any) -> None:
    sim = rfgen.Simulator(None, radar, [ball(position=(9, 0, 1), velocity=(4, 0, 0))])
    with refused(ValueError, "'ball'", "t = 0.4", "10.99 m"):
        sim.adc(3.0)
    sim.frames(0.4)  # which is before
    excursion = ball(position=(0, 0, 0), trajectory=lambda t: (4 + 8 * np.exp(-(((t - 7.13) / 0.1) ** 2)), 0, 1))
    sim = rfgen.Simulator(None, radar, [excursion])
    with refused(ValueError, "'ball'", "t = 7."):
        sim.adc(20.0)


@pytest.mark.parametrize("speed", [0.7, 7.0, 70.0])
def test_a_target_that_flies_through_the_radar(radar: Any, speed: float) -> None:
    start = (1.33, 0.01, 1.0)
    sim = rfgen.Simulator(None, radar, [ball(position=start, velocity=(-speed, 0, 0))])
    with refused(ValueError, "radar position", "'ball'"):
        sim.adc(2.5 / speed + 0.1)
    past = rfgen.Simulator(None, radar, [ball(position=(1.33, 0.15, 1.0), velocity=(-speed, 0, 0))])
    past.frames(2.5 / speed + 0.1)


def test_a_large_plate_that_passes_the_radar(radar: Any) -> None:
    """Its corners stay far away."""
    plate = trimesh.creation.box((0.01, 6, 6))
    sim = rfgen.Simulator(None, radar, [ball(position=(0.5, 0, 1))])
    sim.frames(1.0)
    through = rfgen.Actor.from_mesh(plate, material="wood", position=(0.5, 0, 1), velocity=(-1, 0, 0), name="plate")
    with refused(ValueError, "radar position", "'plate'"):
        rfgen.Simulator(None, radar, [through]).adc(1.0)


def meshes() -> dict[str, tuple[Any, str]]:
    points, faces = POINTS, FACES
    nan = points.copy()
    nan[2, 1] = np.nan
    fin = np.vstack([faces, [[0, 1, 4]]])  # a third face at the edge 0-1
    return {
        "empty": ((np.zeros((0, 3)), np.zeros((0, 3), int)), "empty"),
        "without faces": ((points, np.zeros((0, 3), int)), "empty"),
        "an empty Trimesh": (trimesh.Trimesh(), "empty"),
        "NaN": ((nan, faces), "1 of 4 vertices are NaN or infinite, the first is vertex 2"),
        "infinite": ((np.where(points > 0, np.inf, 0.0), faces), "NaN or infinite"),
        "quads": ((points, np.array([[0, 1, 2, 3]])), "triangles"),
        "not manifold": ((np.vstack([points, [[0.5, -1, 0]]]), fin), "not manifold, 1 edges"),
        "twisted": ((points, np.vstack([faces[:3], faces[3:, ::-1]])), "oriented against each other"),
        "flat": ((np.zeros((3, 3)), np.array([[0, 1, 2]])), "zero area"),
        "out of bounds": ((points, np.array([[0, 1, 9]])), "0 … 3"),
        "planar vertices": ((points[:, :2], faces), "(vertex, 3)"),
        "words": ((points.astype(str), faces), "numbers"),
    }


@pytest.mark.parametrize("which", list(meshes()))
def test_unusable_meshes(which: str) -> None:
    mesh, said = meshes()[which]
    with refused(ValueError, "thing", said):
        rfgen.Actor.from_mesh(mesh, material="wood", name="thing")


def test_unusable_files_and_fields_of_actors(tmp_path: Path) -> None:
    (tmp_path / "bad.obj").write_text("v 0 0\nf 1 2 3\n")
    with refused(FileNotFoundError, "nowhere.ply"):
        rfgen.Actor.from_mesh(tmp_path / "nowhere.ply", material="wood")
    with refused(ValueError, "bad.obj"):
        rfgen.Actor.from_mesh(tmp_path / "bad.obj", material="wood")
    with refused(TypeError, "mesh"):
        rfgen.Actor.from_mesh(3, material="wood")
    with refused(ValueError, "unobtainium", "wood"):
        ball(material="unobtainium")
    for field, value in (("position", (0, 0)), ("velocity", (0, np.nan, 0)), ("orientation", "up")):
        with refused(ValueError, field, repr(value), "three"):
            ball(**{field: value})
    with refused(TypeError, "trajectory"):
        ball(position=(0, 0, 0), trajectory="straight")


def test_vertices_that_stop_being_numbers(radar: Any) -> None:
    class Broken:
        """A mesh sequence that breaks half way."""

        faces, part_names, face_parts = BALL.faces.astype(np.int32), ("all",), np.zeros(len(BALL.faces), np.int32)
        duration, joint_names = 1.0, ()

        def vertices(self, t: float) -> Any:
            return np.asarray(BALL.vertices) * (1.0 if t < 0.3 else np.nan)

        def joints(self, t: float) -> Any:
            return np.zeros((0, 3))

    sim = rfgen.Simulator(None, radar, [rfgen.Actor(Broken(), "skin", name="broken", position=(2, 0, 1))])
    with refused(ValueError, "'broken'", "not finite", "t = 0.3"):
        sim.adc(1.0)


class Stray:
    """A ball that swells, with vertices that no face uses: before those of the ball, among them and after."""

    part_names, duration, joint_names = ("all",), 1.0, ()

    def __init__(self, place: tuple[float, float, float], radius: float = 0.1) -> None:
        self.place, self.radius = place, radius
        half = len(BALL.vertices) // 2
        self.faces = (BALL.faces + 1 + (BALL.faces >= half)).astype(np.int32)
        self.face_parts = np.zeros(len(self.faces), np.int32)

    def vertices(self, t: float) -> Any:
        half = len(BALL.vertices) // 2
        points = np.asarray(BALL.vertices) * (self.radius / 0.1) * (1.0 + 0.01 * t)
        return np.concatenate([[self.place], points[:half], [self.place], points[half:], [self.place]])

    def joints(self, t: float) -> Any:
        return np.zeros((0, 3))


@pytest.mark.parametrize("place", [(1e6, 0.0, 0.0), (0.0, 0.0, 0.0), (-2.0, 0.0, 0.0)])
def test_vertices_that_no_face_uses_are_nowhere(radar: Any, place: tuple[float, float, float]) -> None:
    def run(where: tuple[float, float, float]) -> Any:
        actors = [
            rfgen.Actor(Stray(where), "skin", name="stray", position=(2, 0, 1)),
            rfgen.Actor(Stray(where, 0.05), "skin", name="other", position=(3, 0, 1), velocity=(-0.1, 0, 0)),
        ]
        return rfgen.Simulator(None, radar, actors).adc(0.05, noise=False).data

    np.testing.assert_array_equal(run(place), run((0.0, 0.0, 0.1)))


@pytest.mark.parametrize("gap", [0.0, 1e-6, 0.01, 0.12])
def test_vertices_that_no_face_uses_hide_no_actors_in_one_place(radar: Any, gap: float) -> None:
    actors = [
        rfgen.Actor(Stray((1.0, 0.0, 5.0), 0.2), "skin", name=name, position=(2.0 + offset, 0, 1))
        for name, offset in (("one", 0.0), ("two", gap))
    ]
    with refused(ValueError, "actor '", "cm deep in"):
        rfgen.Simulator(None, radar, actors).frames(0.05)


def test_vertices_of_actors_that_deform_are_numbers_even_where_no_face_uses_them(radar: Any) -> None:
    stray = rfgen.Actor(Stray((np.nan, 0.0, 0.0)), "skin", name="stray", position=(2, 0, 1))
    with refused(ValueError, "'stray'", "not finite", "t = 0.0"):
        rfgen.Simulator(None, radar, [stray]).adc(0.1)


def test_a_stray_vertex_goes_through_no_wall(living_room: Any, radar: Any) -> None:
    for place in ((1e6, 0.0, 0.0), (0.0, 0.0, -3.0)):
        stray = rfgen.Actor(Stray(place), "skin", name="stray", position=(2, 0, 1), velocity=(0.5, 0, 0))
        rfgen.Simulator(living_room, radar, [stray]).frames(0.2)


def test_a_motion_that_ends_before_the_run(radar: Any) -> None:
    class Short:
        """A ball that recedes for 0.3 s and then stops dead."""

        faces, part_names, face_parts = BALL.faces.astype(np.int32), ("all",), np.zeros(len(BALL.faces), np.int32)
        duration, joint_names = 0.3, ()

        def vertices(self, t: float) -> Any:
            return np.asarray(BALL.vertices) + np.array([0.5 * np.clip(t, 0, 0.3), 0, 0])

        def joints(self, t: float) -> Any:
            return np.zeros((0, 3))

    sim = rfgen.Simulator(None, radar, [rfgen.Actor(Short(), "skin", name="short", position=(2, 0, 1))])
    for duration, start in ((0.5, 0.0), (0.1, -0.1)):
        with pytest.warns(UserWarning, match=r"actor 'short' moves from 0 to 0\.300 s .*the run lasts from"):
            sim.frames(duration, start=start)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warnings.simplefilter("ignore", CoarseMeshWarning)
        sim.frames(0.3)
        rfgen.Simulator(None, radar, [ball()]).frames(0.5, start=-0.1)  # rigid: it has no end


@pytest.mark.parametrize("duration", [0, -1.0, float("nan"), float("inf"), "3", None, True])
def test_durations_that_are_none(radar: Any, duration: Any) -> None:
    with refused(ValueError, f"duration is {duration!r}", "positive"):
        rfgen.Simulator(None, radar).adc(duration)


def test_a_duration_shorter_than_a_frame(radar: Any) -> None:
    with refused(ValueError, "duration is 0.0001 s", "'tiny'", "0.000512 s"):
        rfgen.Simulator(None, radar).adc(1e-4)


@pytest.mark.parametrize("seed", [-1, 1.5, "7", None, True])
def test_seeds_that_are_none(radar: Any, seed: Any) -> None:
    with refused(ValueError, f"seed is {seed!r}", "at least 0"):
        rfgen.Simulator(None, radar).adc(0.1, seed=seed)


@pytest.mark.parametrize(
    ("argument", "value"),
    [
        *(("noise", value) for value in ("x", float("nan"), object(), None, 1, np.array([True, False]))),
        *(("progress", value) for value in ("x", 3, True, False, ())),
    ],
)
def test_switches_and_functions_that_are_none(radar: Any, argument: str, value: Any) -> None:
    sim = rfgen.Simulator(None, radar, [ball()])
    with refused(TypeError, f"{argument} is {value!r}"):
        sim.adc(0.1, **{argument: value})
    if argument == "noise":
        with refused(TypeError, f"noise is {value!r}"):
            sim.frames(0.1, noise=value)


@pytest.mark.parametrize("value", [np.array(["error", "warn"]), None, True, ["error"]])
def test_policies_that_are_none(radar: Any, value: Any) -> None:
    with refused(ValueError, f"collisions is {value!r}"):
        rfgen.Simulator(None, radar, collisions=value)
    with refused(ValueError, f"device is {value!r}"):
        rfgen.Simulator(None, radar).adc(0.1, device=value)


@pytest.mark.parametrize("t", [float("nan"), float("-inf"), "now", None, 1j, 1e300, -(2**70), 10**400])
def test_instants_that_are_none(radar: Any, t: Any) -> None:
    sim = rfgen.Simulator(None, radar, [ball()])
    for call in (sim.paths, sim.pir):
        with refused(ValueError, f"t is {t!r}"):
            call(t)
    with refused(ValueError, f"start is {t!r}"):
        sim.adc(0.1, start=t)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        *(({"resolution": value}, f"resolution is {value!r}") for value in ((0, 8), (8, -1), (8, 8, 3), (8, 5000))),
        ({"resolution": (8.0, 8.0)}, "resolution is (8.0, 8.0)"),
        *(({"fov_deg": value}, f"fov_deg is {value!r}") for value in (0, -60, 180, (60, 180), float("nan"))),
        ({"position": (0, 0)}, "position is (0, 0)"),
        ({"orientation": (0, 0, np.inf)}, "orientation is (0, 0, inf)"),
    ],
)
def test_views_that_are_none(radar: Any, arguments: dict[str, Any], said: str) -> None:
    sim = rfgen.Simulator(None, radar, [ball()])
    with refused(ValueError, said):
        sim.pir(0.0, **arguments)


# -- samples --------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def moving(radar: Any) -> Any:
    return rfgen.Simulator(None, radar, [ball(velocity=(0.5, 0, 0))])


def test_a_cube_has_the_frames_that_fit(moving: Any, radar: Any) -> None:
    done = []
    cube = moving.adc(0.17, seed=3, progress=lambda n, of: done.append((n, of)))
    assert cube.data.shape == (3, 8, 2, 4, 64)
    assert cube.data.dtype == np.complex64
    assert (cube.radar, cube.seed) == (radar, 3)
    np.testing.assert_allclose(cube.frame_times, [0, 0.05, 0.1], atol=1e-12)
    assert done == [(1, 3), (2, 3), (3, 3)]
    later = moving.frame_times(0.1, start=2.0)
    np.testing.assert_allclose(later, [2.0, 2.05])
    assert len(moving.frame_times(0.15)) == 3  # 3 x 0.05 s, to the last bit
    assert len(moving.frame_times(radar.waveform.frame_length)) == 1


@pytest.mark.slow
def test_samples_do_not_depend_on_what_was_asked_before():
    """To the bit, whatever the tracer learned meanwhile: facets made for one run don't serve the next."""
    ball = rfgen.Actor.from_mesh(
        trimesh.creation.icosphere(subdivisions=3, radius=0.1), material="metal", position=(4, 0.2, 1),
        velocity=(-20.0, 0, 0), name="ball",
    )  # fmt: skip
    board = rfgen.Actor.from_mesh(
        trimesh.creation.box((0.01, 0.5, 0.5)), material="wood", position=(3, -0.5, 1), orientation=(0.3, 0, 0),
        name="board",
    )  # fmt: skip
    radar = rfgen.Radar.load("awr1843", "di_gesture", position=(0, 0, 1))
    simulator = rfgen.Simulator(None, radar, [ball, board], collisions="ignore")
    once = simulator.adc(0.1)
    simulator.paths(0.08)
    simulator.pir(0.03, resolution=(8, 8))
    np.testing.assert_array_equal(simulator.adc(0.1).data, once.data)
    np.testing.assert_array_equal(rfgen.Simulator(None, radar, [ball, board]).adc(0.1).data, once.data)
    for frame in simulator.frames(0.1):
        simulator.paths(0.03)
        np.testing.assert_array_equal(frame.samples.astype(np.complex64), once.data[frame.index])


def test_a_frame_that_is_whole_is_handed_over_before_the_next_one_fails(moving: Any, monkeypatch: Any) -> None:
    whole, trace = moving.adc(0.1, noise=False).data, moving.tracer.trace

    def failing(start: float, *rest: Any) -> Any:
        if start > 0.04:
            raise RuntimeError("no more")
        return trace(start, *rest)

    monkeypatch.setattr(moving.tracer, "trace", failing)
    frames = moving.frames(0.1, noise=False)
    np.testing.assert_array_equal(next(frames).samples.astype(np.complex64), whole[0])
    with pytest.raises(RuntimeError, match="no more"):
        next(frames)


def test_workers_are_refused_with_the_cure(moving: Any, tmp_path: Path) -> None:
    generate: Any = rfgen.generate
    for call in (
        lambda: moving.adc(0.1, workers=2),
        lambda: moving.frames(0.1, workers=1),
        lambda: moving.record(tmp_path / "run.h5", 0.1, workers=2),
        lambda: generate("a person waving", workers=4, output=tmp_path / "run.h5"),
    ):
        with pytest.raises(ValueError, match=r"workers is \d, .*`rfgen dataset build`"):
            call()
    assert not list(tmp_path.iterdir())


def test_the_seed_makes_the_noise(moving: Any, radar: Any) -> None:
    first, again, other = (moving.adc(0.1, seed=seed) for seed in (1, 1, 2))
    np.testing.assert_array_equal(first.data, again.data)
    clean = moving.adc(0.1, noise=False)
    assert clean.seed is None
    np.testing.assert_array_equal(clean.data, moving.adc(0.1, noise=False, seed=9).data)
    noise, others = first.data - clean.data, other.data - clean.data
    assert not np.array_equal(first.data, other.data)
    # kTB with the noise figure; frames, elements and seeds are independent. 8192 samples: 1 sigma is 0.05 dB.
    assert 10 * np.log10(np.mean(np.abs(noise) ** 2) / noise_power(radar)) == pytest.approx(0.0, abs=0.2)
    for one, two in ((noise, others), (noise[:1], noise[1:]), (noise[:, :, :1], noise[:, :, 1:])):
        size = np.sqrt(np.vdot(one, one).real * np.vdot(two, two).real)
        assert abs(np.vdot(one, two)) / size < 5 / np.sqrt(one.size)


def test_a_frame_does_not_depend_on_where_the_run_begins(moving: Any) -> None:
    """The same instants, numbered from another start; only the noise knows the frame's number. Facets are chosen at the
    pose that a run begins with: a fiftieth of the tolerance."""
    whole, late = moving.adc(0.2, noise=False), moving.adc(0.1, start=0.1, noise=False)
    np.testing.assert_allclose(late.frame_times, whole.frame_times[2:])
    scale = np.abs(whole.data).max()
    np.testing.assert_allclose(late.data, whole.data[2:], atol=2e-5 * scale, rtol=0)
    np.testing.assert_array_equal(moving.adc(0.05, noise=False).data[0], whole.data[0])


def test_a_room_without_actors_stands_still(living_room: Any, radar: Any) -> None:
    sim = rfgen.Simulator(living_room, radar, rtol=0.05)
    cube = sim.adc(0.15, noise=False)
    assert np.abs(cube.data).max() > 0
    np.testing.assert_array_equal(cube.data[1], cube.data[0])
    np.testing.assert_array_equal(cube.data[2], cube.data[0])
    # From chirp to chirp as well: no Doppler at all.
    np.testing.assert_array_equal(cube.data[0], np.broadcast_to(cube.data[0, :1], cube.data[0].shape))


def test_an_actor_that_stands_still_has_no_doppler(radar: Any) -> None:
    sim = rfgen.Simulator(None, radar, [ball()])
    assert not sim.paths(0.2).tau_rate.any()
    cube = sim.adc(0.1, noise=False).data
    assert np.abs(cube).max() > 0
    spectrum = np.abs(np.fft.fft(cube, axis=1)).sum(axis=(0, 2, 3, 4))
    assert spectrum[1:].max() < 1e-6 * spectrum[0]
    np.testing.assert_allclose(cube[1], cube[0], rtol=1e-6, atol=1e-6 * np.abs(cube).max())


def test_free_space_without_actors_is_noise_alone(radar: Any) -> None:
    sim = rfgen.Simulator(None, radar)
    assert not sim.adc(0.05, noise=False).data.any()
    assert sim.paths().num_paths == 0
    assert not sim.pir(resolution=(4, 4)).energy.any()


def test_paths_carry_their_labels_and_signs(radar: Any) -> None:
    away = ball("away", position=(3, 0.5, 1), velocity=(0.5, 0, 0))
    towards = ball("towards", position=(3, -0.5, 1), velocity=(-0.5, 0, 0))
    paths = rfgen.Simulator(None, radar, [away, towards]).paths(0.2)
    assert paths.a.shape == (2, 4, paths.num_paths, 1)
    assert paths.tau.shape == paths.tau_rate.shape == paths.a.shape
    np.testing.assert_array_equal(paths.times, [0.2])
    np.testing.assert_allclose(np.linalg.norm(paths.direction, axis=-1), 1.0)
    assert set(paths.kind) == {rfgen.PathKind.FACET}
    for name, sign, x, y in (("away", 1, 3.1, 0.5), ("towards", -1, 2.9, -0.5)):
        mine = paths.select(paths.object_id == paths.object_names.index(name))
        assert mine.num_paths > 50
        # Every point of a rigid body moves alike; what counts is the part along the line of sight.
        np.testing.assert_allclose(mine.velocity, sign * 0.5 * mine.direction[:, :, 0], rtol=1e-3)
        np.testing.assert_allclose(mine.doppler, -2 * mine.velocity / radar.wavelength, rtol=1e-9)
        np.testing.assert_allclose(mine.range, np.hypot(x, y), atol=0.101)
        assert np.all(np.sign(mine.direction[:, 0, 1]) == np.sign(y))  # left is left
    labels = paths.labels()
    assert {label["object"] for label in labels} == {"away", "towards"}
    assert all(label["kind"] == "facet" and label["bounces"] == 1 for label in labels)
    assert all((label["radial_velocity"] > 0) == (label["object"] == "away") for label in labels)


def test_parts_of_an_actor_are_named(radar: Any) -> None:
    class TwoParts:
        """The upper half of a ball is its head."""

        faces, part_names = BALL.faces.astype(np.int32), ("torso", "head")
        face_parts = (BALL.triangles_center[:, 2] > 0).astype(np.int32)
        duration, joint_names = float("inf"), ()

        def vertices(self, t: float) -> Any:
            return np.asarray(BALL.vertices, np.float64)

        def joints(self, t: float) -> Any:
            return np.zeros((0, 3))

    paths = rfgen.Simulator(None, radar, [rfgen.Actor(TwoParts(), "skin", name="dummy", position=(2, 0, 1))]).paths()
    head = np.array([label["part"] == "head" for label in paths.labels()])
    assert head.any()
    assert not head.all()
    np.testing.assert_array_equal(head, TwoParts.face_parts[paths.facet] == 1)


def test_samples_are_those_of_the_paths_at_an_instant(moving: Any, radar: Any) -> None:
    """One instant's delays and rates, carried on over a frame of 0.5 ms.

    The ball moves 0.26 mm in it; off axis the rate itself changes by v^2 sin^2/R, below 1e-4 rad here, so both agree
    to the tolerance of the tracer and of the transforms, 1e-3.
    """
    start = 0.1
    cube = moving.adc(0.05, start=start, noise=False).data[0]
    carried = synthesize(radar, moving.paths(start), start)
    assert np.linalg.norm(cube - carried) < 2e-3 * np.linalg.norm(cube)


def test_a_receding_target_has_a_positive_doppler_bin(radar: Any) -> None:
    for sign in (1, -1):
        # 2 bins of the 8 loops of 2 slots of 32 us.
        speed = sign * 2 * radar.velocity_resolution
        sim = rfgen.Simulator(None, radar, [ball(velocity=(speed, 0, 0))])
        cube = sim.adc(0.05, noise=False).data[0]
        spectrum = np.abs(np.fft.fft2(cube, axes=(0, 3))).sum(axis=(1, 2))
        doppler, distance = np.unravel_index(spectrum.argmax(), spectrum.shape)
        assert doppler == (2 * sign) % 8
        assert distance * radar.range_resolution == pytest.approx(2.9, abs=radar.range_resolution)
