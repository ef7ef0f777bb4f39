"""From a prompt to a file: mistakes are told before the work begins, and a file is whole or absent."""

from __future__ import annotations

import logging
import re
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import trimesh

import rfgen_sionna as rfgen
from rfgen_sionna import cli, composition
from rfgen_sionna.generative.motion.kinematic import KinematicSource
from rfgen_sionna.radar import Adc
from rfgen_sionna.signal import DcOffset, Receiver, receiver_from_record

pytest.importorskip("anny", reason="people need the body model")

PROMPT = "a person pushing, 1.5 m away"


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Default names are those of files in the working folder."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture(scope="module")
def quick(tiny_toml: Path) -> Any:
    """Options of a run that takes a second."""
    small = {"radar": tiny_toml, "duration": 0.1, "pir_resolution": (12, 16), "rtol": 0.03}
    return {"environment": "free space", "motion": "kinematic", **small}


@pytest.fixture
def no_work(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Fails if a body or a tracer is built."""
    work: list[str] = []

    def note(name: str) -> Callable[..., None]:
        def built(*_: Any, **__: Any) -> None:
            work.append(name)
            raise AssertionError(f"a {name} was built before the input was refused")

        return built

    monkeypatch.setattr("rfgen_sionna.generative.actor.person", note("body"))
    monkeypatch.setattr("rfgen_sionna.tracing.tracer.Tracer", note("tracer"))
    started = time.perf_counter()
    yield
    assert time.perf_counter() - started < 4.0  # a room's scene may have been read, which takes a second or two
    assert work == []


BAD: list[tuple[dict[str, Any], tuple[str, ...]]] = [
    ({"prompt": "a flying saucer"}, ("a flying saucer", "cannot be done", "the nearest", "a person")),
    ({"prompt": "a person"}, ("action", "a person", "say what the person does")),
    ({"prompt": "an elephant walking"}, ("'elephant'", "a person")),
    ({"prompt": ""}, ("''", "say what the person does")),
    ({"prompt": "a person not jumping"}, ("negative prompt",)),
    ({"negative": "pushing"}, ("pushing", "forbids")),
    ({"environment": "the moon"}, ("environment", "'the moon'", "free space", "living_room")),
    ({"radar": "awr1483"}, ("awr1483", "awr1843")),
    ({"radar": "nowhere.toml"}, ("nowhere.toml", "does not exist")),
    ({"preset": "fast"}, ("'fast'", "tiny")),
    ({"duration": -3.0}, ("duration is -3.0", "positive")),
    ({"duration": 0.0}, ("duration is 0.0",)),
    ({"duration": float("nan")}, ("duration is nan",)),
    ({"duration": "3 s"}, ("duration is '3 s'",)),
    ({"duration": 1e-4}, ("duration is 0.0001 s", "0.000512 s")),
    ({"seed": -1}, ("seed is -1", "at least 0")),
    ({"seed": 0.5}, ("seed is 0.5",)),
    ({"rtol": 0.0}, ("rtol is 0.0", "1e-08 … 0.3")),
    ({"rtol": 2.0}, ("rtol is 2.0",)),
    ({"pir_resolution": (0, 4)}, ("resolution is (0, 4)", "1 … 4096")),
    ({"fov_deg": 190.0}, ("fov_deg is 190.0", "180")),
    ({"fov_deg": (60.0, 0.0)}, ("fov_deg is (60.0, 0.0)",)),
    ({"prompt": "a person pushing, 12 m away"}, ("12 m", "10.99 m", "tiny")),
    ({"prompt": "a person pushing", "distance": 12.0}, ("12 m", "10.99 m")),
    ({"prompt": "a person pushing", "distance": -2.0}, ("distance is -2.0",)),
    ({"prompt": "a person pushing", "distance": float("nan")}, ("distance is nan",)),
    ({"output": "nowhere/run.h5"}, ("nowhere", "does not exist")),
    ({"output": "."}, ("is a folder",)),
    ({"duration": 1e9}, ("duration is 1e+09 s", " TB", "free", "at most 600 s")),
    ({"duration": 601.0}, ("duration is 601 s", " MB", "at most 600 s")),
    ({"prompt": PROMPT + " in a living room"}, ("'free space'", "the prompt says living_room")),
    ({"prompt": PROMPT + " in a kitchen"}, ("'in a kitchen'", "living_room")),
    ({"environment": "not a living room"}, ("environment", "negates")),
    ({"radar_position": (0, 0)}, ("radar_position is (0, 0)", "three finite coordinates")),
    ({"radar_position": (0, 0, float("nan"))}, ("radar_position is",)),
    ({"look_at": "ahead"}, ("look_at is 'ahead'", "three finite coordinates")),
    ({"radar_position": (3, 0, 1), "look_at": (3, 0, 1)}, ("look_at is (3, 0, 1)", "the position of the radar")),
    ({"output": "/proc/run.h5"}, ("/proc",)),
    ({"receiver": "nowhere.toml"}, ("receiver file 'nowhere.toml' does not exist",)),
    ({"receiver": {"leakage": {"level_db": 3.0}}}, ("leakage.level_db is 3.0", "-200 … 0")),
    ({"receiver": {"mismatch": {"rx_gain_db": [1.0]}}}, ("mismatch.rx_gain_db has 1 values", "RX1, RX2")),
]


@pytest.mark.usefixtures("no_work")
@pytest.mark.parametrize(("changes", "said"), BAD, ids=[str(changes) for changes, _ in BAD])
def test_bad_input_is_refused_before_the_work(
    quick: dict[str, Any], folder: Path, changes: dict[str, Any], said: tuple[str, ...]
) -> None:
    arguments = {"prompt": PROMPT, "output": "run.h5"} | quick | changes
    with pytest.raises(ValueError, match=r".") as caught:
        rfgen.generate(**arguments)
    for part in said:
        assert part in str(caught.value)
    assert list(folder.iterdir()) == []


@pytest.mark.usefixtures("no_work")
def test_types_that_cannot_be(quick: dict[str, Any]) -> None:
    with pytest.raises(TypeError, match="prompt: expected a text, got int"):
        rfgen.generate(7, **quick)  # type: ignore[arg-type]
    with pytest.raises(TypeError, match="environment: expected a text, the path of a scene file"):
        rfgen.generate(PROMPT, **quick | {"environment": 3})
    with pytest.raises(ValueError, match=r"radar is 1843.*awr1843"):
        rfgen.generate(PROMPT, **quick | {"radar": 1843})
    with pytest.raises(TypeError, match="output is 3: the path of a file"):
        rfgen.generate(PROMPT, **quick | {"output": 3})
    for name in ("noise", "overwrite"):
        with pytest.raises(TypeError, match=f"{name} is 'no': True or False is needed"):
            rfgen.generate(PROMPT, **quick | {name: "no"})
    with pytest.raises(TypeError, match="distnace"):
        rfgen.generate(PROMPT, distnace=3, **quick)


@pytest.mark.usefixtures("no_work")
def test_a_radar_that_has_its_preset_gets_no_other(quick: dict[str, Any]) -> None:
    radar = rfgen.Radar.load(quick["radar"])
    with pytest.raises(ValueError, match=r"preset is 'mmmesh' but a Radar is given, which has its own \('tiny'\)"):
        rfgen.generate(PROMPT, **quick | {"radar": radar, "preset": "mmmesh"})
    with pytest.raises(ValueError, match=r"look_at is \(1, 0, 0\) but a Radar is given"):
        rfgen.generate(PROMPT, **quick | {"radar": radar, "look_at": (1, 0, 0)})


@pytest.mark.usefixtures("no_work")
def test_a_run_that_the_disk_has_no_room_for(quick: dict[str, Any], monkeypatch: pytest.MonkeyPatch) -> None:
    frame = 8 * 2 * 4 * 64 * 8 + 12 * 12 * 16
    monkeypatch.setattr("shutil.disk_usage", lambda folder: SimpleNamespace(free=100 * frame))
    with pytest.raises(ValueError, match=r"duration is 6 s: .* take 4\.21 MB, .* has 3\.51 MB free; .* at most 5 s"):
        rfgen.generate(PROMPT, **quick | {"duration": 6.0})


@pytest.mark.usefixtures("no_work")
def test_a_radar_in_the_wall_of_the_room(quick: dict[str, Any]) -> None:
    room = rfgen.load_scene("living_room")
    wall = next(item for item in room.objects if "wall" in item.name)
    low, high = wall.vertices.min(axis=0), wall.vertices.max(axis=0)
    place = (*(0.5 * (low + high))[:2], 0.05)  # under any window
    radar = rfgen.Radar.load(quick["radar"], position=place, look_at=(0, 0, 1))
    with pytest.raises(ValueError, match=rf"radar position .*{wall.name}"):
        rfgen.generate(PROMPT, **quick | {"radar": radar, "environment": "living_room"})


@pytest.mark.usefixtures("no_work")
def test_a_radar_that_looks_at_the_ground_has_no_place_before_it(quick: dict[str, Any]) -> None:
    radar = rfgen.Radar.load(quick["radar"], position=(0, 0, 2), look_at=(0, 0, 0))
    with pytest.raises(ValueError, match="its boresight is vertical"):
        rfgen.generate(PROMPT, **quick | {"radar": radar})


@pytest.mark.usefixtures("no_work")
def test_an_unknown_key_in_a_radar_file(quick: dict[str, Any], folder: Path) -> None:
    text = quick["radar"].read_text(encoding="utf-8")
    (folder / "odd.toml").write_text(text.replace("num_loops = 8", "num_loops = 8\nnum_lops = 9"))
    with pytest.raises(ValueError, match=r"odd\.toml: unknown key 'preset\.tiny\.num_lops'; known there: .*num_loops"):
        rfgen.generate(PROMPT, **quick | {"radar": folder / "odd.toml"})


@pytest.mark.usefixtures("no_work")
def test_an_existing_file_stays(quick: dict[str, Any], folder: Path) -> None:
    for name, output in (("mine.h5", "mine.h5"), ("push.h5", None)):
        (folder / name).write_text("mine")
        with pytest.raises(ValueError, match=rf"{name}' exists; .*overwrite=True"):
            rfgen.generate(PROMPT, output=output, **quick)
        assert (folder / name).read_text() == "mine"


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="needs a folder that nobody can write into")
@pytest.mark.usefixtures("no_work")
def test_a_folder_that_cannot_be_written(quick: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match=r"output '/proc/run\.h5'.*not writable"):
        rfgen.generate(PROMPT, output="/proc/run.h5", **quick)


def test_a_body_in_the_radar_is_refused_before_tracing(
    quick: dict[str, Any], folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where the arms go is known once there is a body; nothing is traced or written all the same."""
    monkeypatch.setattr("rfgen_sionna.tracing.tracer.Tracer", None)
    with pytest.raises(ValueError, match=r"radar position .* actor 'person'"):
        rfgen.generate("a person pushing", output="run.h5", distance=0.05, **quick)
    assert list(folder.iterdir()) == []


def test_an_interrupted_run_leaves_no_file_and_spares_an_earlier_one(quick: dict[str, Any], folder: Path) -> None:
    def interrupt(done: int, count: int) -> None:
        assert (done, count) == (1, 2)
        assert (folder / "run.h5").exists() == before
        raise KeyboardInterrupt

    before = False
    with pytest.raises(KeyboardInterrupt):
        rfgen.generate(PROMPT, output="run.h5", progress=interrupt, **quick)
    assert list(folder.iterdir()) == []

    (folder / "run.h5").write_text("earlier")
    before = True
    with pytest.raises(KeyboardInterrupt):
        rfgen.generate(PROMPT, output="run.h5", progress=interrupt, overwrite=True, **quick)
    assert [path.name for path in folder.iterdir()] == ["run.h5"]
    assert (folder / "run.h5").read_text() == "earlier"


def test_an_interrupted_run_goes_on(quick: dict[str, Any], folder: Path) -> None:
    def interrupt(done: int, count: int) -> None:
        if done == 1:
            raise KeyboardInterrupt

    steps: list[tuple[int, int]] = []
    with pytest.raises(KeyboardInterrupt):
        rfgen.generate(PROMPT, output="run.h5", progress=interrupt, resume=True, **quick)
    assert [path.name for path in folder.iterdir()] == [".run.h5.partial"]
    with pytest.raises(ValueError, match=r"those of another run, whose prompt is 'a person pushing, 1\.5 m away' inst"):
        rfgen.generate("a person pulls, 1.5 m away", output="run.h5", resume=True, **quick)
    with rfgen.generate(PROMPT, output="run.h5", resume=True, progress=lambda *a: steps.append(a), **quick) as run:
        assert len(run) == 2
        assert run.pir(1).time == run.mesh_times[1]
    assert steps == [(2, 2)]
    assert [path.name for path in folder.iterdir()] == ["run.h5"]


# -- runs -----------------------------------------------------------------------------------------------------


def test_a_run_is_in_its_file(quick: dict[str, Any], folder: Path, tiny_toml: Path) -> None:
    done: list[tuple[int, int]] = []
    with rfgen.generate(PROMPT, seed=5, progress=lambda *step: done.append(step), **quick) as run:
        assert run.path.name == "push.h5"
        radar = rfgen.Radar.load(tiny_toml, position=(0, 0, 1), look_at=(3, 0, 1))
        cube = run.cube()
        samples = cube.data
        assert samples.shape == (2, 8, 2, 4, 64)
        assert samples.dtype == np.complex64
        assert (cube.radar, cube.seed) == (radar, 5)
    assert [path.name for path in folder.iterdir()] == ["push.h5"]
    assert done == [(1, 2), (2, 2)]

    with rfgen.open_run("push.h5") as run:
        assert len(run) == 2
        assert run.radar == radar
        assert (run.prompt, run.negative_prompt, run.environment) == (PROMPT, "", "")
        assert run.seeds == {"body": 5, "motion": 5, "surroundings": None, "speckle": 5, "noise": 5}
        assert receiver_from_record(run.receiver or {}, run.radar) == Receiver()
        assert run.full_scale is not None
        assert {"rfgen_sionna", "sionna-rt", "numpy"} <= set(run.software)
        np.testing.assert_allclose(run.frame_times, [0, 0.05])
        # Meshes, images and labels are those of the middle of the frame's chirps.
        np.testing.assert_allclose(run.mesh_times, run.frame_times + 0.5 * radar.waveform.frame_length)

        pir = run.pir(1)
        assert pir.energy.shape == pir.time_of_arrival.shape == pir.velocity.shape == (12, 16)
        assert pir.time == run.mesh_times[1]
        assert pir.position == (0, 0, 1)
        assert np.nanmin(pir.time_of_arrival) * 299_792_458 / 2 == pytest.approx(1.3, abs=0.4)

        person = run.actors["person"]
        vertices, joints = person.vertices(1), person.joints(1)
        assert vertices.shape[1:] == joints.shape[1:] == (3,)
        assert len(joints) == len(person.joint_names) > 20
        assert person.faces.max() == len(vertices) - 1
        assert person.material == "skin"
        assert len(person.part_names) > 5
        assert vertices[:, 2].min() == pytest.approx(0.0, abs=0.03)  # on the floor
        assert 1.4 < np.ptp(vertices[:, 2]) < 2.2

        labels = run.labels
        assert list(labels["action"].values.ravel()) == ["push", "push"]
        position = labels["position"].values
        assert position.shape == (2, 1, 3)
        np.testing.assert_allclose(position[1, 0], vertices.mean(axis=0), atol=1e-4)
        assert labels["position"].units == "m"
        offset = position[:, 0] - np.array([0, 0, 1])
        distance = np.linalg.norm(offset, axis=1)
        np.testing.assert_allclose(labels["distance"].values[:, 0], distance)
        assert distance == pytest.approx([1.5, 1.5], abs=0.2)
        velocity = labels["velocity"].values[:, 0]
        radial = np.einsum("fi,fi->f", velocity, offset) / distance
        np.testing.assert_allclose(labels["radial_velocity"].values[:, 0], radial)
        np.testing.assert_allclose(labels["azimuth"].values[:, 0], np.arctan2(offset[:, 1], offset[:, 0]))
        np.testing.assert_allclose(labels["elevation"].values[:, 0], np.arcsin(offset[:, 2] / distance))
        assert abs(abs(labels["orientation"].values[0, 0]) - np.pi) < 0.2  # facing the radar
        np.testing.assert_array_equal(run.cube().data, samples)
        np.testing.assert_array_equal(run.cube(slice(1, 2)).data, samples[1:])

    # The same seed again gives the same samples to the bit; another one another person, motion and noise.
    with rfgen.generate(PROMPT, seed=5, output="again.h5", **quick) as run:
        np.testing.assert_array_equal(run.cube().data, samples)
        body = run.actors["person"].vertices(0)
    # An earlier file is replaced where that is asked for.
    with rfgen.generate(PROMPT, seed=6, output="again.h5", overwrite=True, noise=False, **quick) as run:
        assert not np.array_equal(run.cube().data, samples)
        assert not np.allclose(run.actors["person"].vertices(0), body, atol=1e-3)
        assert run.seeds == {"body": 6, "motion": 6, "surroundings": None, "speckle": 6, "noise": None}
        assert run.cube().seed is None


def test_a_receiver_of_ones_own(quick: dict[str, Any], tmp_path: Path) -> None:
    """Its impairments are in the samples, and it is in the file with seed, full scale and what was clipped."""
    board = tmp_path / "board.toml"
    board.write_text("adc = {bits = 8, full_scale_dbm = -100.0}\n[dc_offset]\nlevel_dbm = -99.0\n")
    short = quick | {"duration": 0.05}
    with rfgen.generate(PROMPT, seed=5, output="board.h5", receiver=board, noise=False, **short) as run:
        assert run.receiver is not None
        receiver = receiver_from_record(run.receiver, run.radar)
        assert receiver.adc == Adc(8, -100.0)
        assert receiver.dc_offset == DcOffset(-99.0)
        assert not receiver.thermal_noise
        assert run.seeds["noise"] == 5
        assert run.full_scale == pytest.approx(10 ** (-130 / 20))
        samples = run.cube().data
        words = np.stack([samples.real, samples.imag]) * (128 / run.full_scale)
        np.testing.assert_allclose(words, np.rint(words), atol=1e-4)
        # A constant of -99 dBm is beyond I or Q wherever its phase puts more than 0.9 of it into one of them.
        at_the_end = np.count_nonzero((words > 126.5) | (words < -127.5))
        assert 0 < run.clipped <= at_the_end
    with rfgen.generate(PROMPT, seed=5, output="ideal.h5", noise=False, **short) as run:
        assert run.full_scale is None
        assert run.clipped == 0
        assert receiver_from_record(run.receiver or {}, run.radar) == Receiver.ideal()


def test_the_prompt_says_where(quick: dict[str, Any], caplog: pytest.LogCaptureFixture) -> None:
    """Distance of the prompt before that of the argument; words without effect are named."""
    with rfgen.generate(
        "a person pushing, 2.5 m away, wearing a hat", distance=4.0, output="run.h5", **quick | {"duration": 0.05}
    ) as run:
        assert run.labels["distance"].values[0, 0] == pytest.approx(2.5, abs=0.2)
    assert "hat" in caplog.text
    placed = rfgen.Radar.load(quick["radar"], position=(5, 5, 1.2), look_at=(5, 8, 1.2))
    with rfgen.generate("a person pushing", distance=1.0, output="placed.h5", **quick | {"radar": placed}) as run:
        np.testing.assert_allclose(run.labels["position"].values[0, 0, :2], [5, 6], atol=0.2)
        assert abs(run.labels["azimuth"].values[0, 0]) < 0.1


def test_the_report_is_told_before_the_frames_and_kept_in_the_file(
    quick: dict[str, Any], caplog: pytest.LogCaptureFixture
) -> None:
    said: list[str] = []
    prompt = "a woman pulls, at azimuth 15 degrees, wearing a hat"
    options = quick | {"duration": 0.05, "distance": 2.0}
    with rfgen.generate(prompt, seed=1, output="run.h5", report=said.append, **options) as run:
        assert run.report == said[0]
        assert run.labels["azimuth"].values[0, 0] == pytest.approx(np.radians(15), abs=0.07)
        assert run.labels["distance"].values[0, 0] == pytest.approx(2.0, abs=0.2)
        yaw = run.labels["orientation"].values[0, 0]
        assert np.cos(yaw - np.radians(195)) == pytest.approx(1.0, abs=0.05)  # facing the radar
    for name, value, origin in (
        ("hand", "left|right", "drawn from seed 1"),
        ("orientation", "0°, facing the radar", "default"),
        ("distance", "2 m", "from the argument distance"),
        ("azimuth", "15°", "from the prompt"),
        ("speed", "× 1", "default"),
        ("surroundings", "free space", "from the argument environment"),
        ("gender", "female", "from the prompt"),
        ("age", r"\d+ years", "drawn from .*seed 1.*"),
        ("height", r"1\.\d\d m", "drawn from seed 1"),
        ("weight", r"\d+ kg", "drawn from seed 1"),
        ("floor", r"0\.00 m", "no surface there, so height 0"),
    ):
        assert re.search(rf"^  {name} +(?:{value}) +{origin}$", said[0], re.MULTILINE), (name, said[0])
    assert "not understood, no effect: wearing a hat" in said[0]
    assert caplog.text.count("'wearing a hat'") == 1


@pytest.mark.parametrize(
    ("prompt", "action", "told"),
    [
        ("a person walks while raising the left arm", "walk", r"arms +left_arm_raised: .* from the prompt"),
        ("a person dances at 3 to 4 m", "dance", r"distance +3\.\d+ m +drawn from 3 to 4 m \(seed 2\)"),
        pytest.param("the driver sits, tired", "sit", r"tired +yes +from the prompt", marks=pytest.mark.slow),
    ],
)
def test_clips_and_manner_reach_a_run(quick: dict[str, Any], prompt: str, action: str, told: str) -> None:
    options = quick | {"motion": "auto", "duration": 0.05, "distance": 4.0}
    with rfgen.generate(prompt, output="run.h5", seed=2, **options) as run:
        assert run.labels["action"].values[0, 0] == action
        assert run.prompt == prompt
        assert re.search(told, run.report)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:materials extrapolated")
def test_a_radar_placed_in_a_scene_of_sionna(quick: dict[str, Any]) -> None:
    """The person stands where the radar looks, at the distance, on what is there: the floor of a street at -3 cm."""
    with rfgen.generate(
        "a person pushing, 2 m away", output="run.h5", radar_position=(1, -2, 1.2), look_at=(1, 3, 1),
        **quick | {"environment": "scene: a street", "duration": 0.05},
    ) as run:  # fmt: skip
        assert run.radar.position == (1, -2, 1.2)
        np.testing.assert_allclose(run.labels["position"].values[0, 0, :2], [1, 0], atol=0.2)
        assert run.actors["person"].vertices(0)[:, 2].min() == pytest.approx(-0.03, abs=0.02)
        assert "'floor' there" in run.report
    with rfgen.generate(
        PROMPT, output="ahead.h5", radar_position=(2, 1, 1), **quick | {"duration": 0.05}
    ) as run:  # it looks along +x
        np.testing.assert_allclose(run.labels["position"].values[0, 0, :2], [3.5, 1], atol=0.2)


def test_labels_follow_a_person_who_turns(quick: dict[str, Any]) -> None:
    """Walking there and back, a person faces where it goes: the radar at first, away from it later."""
    radar = rfgen.Radar.load(quick["radar"])
    radar = replace(radar, waveform=replace(radar.waveform, frame_period=0.5, num_loops=1))
    with rfgen.generate(
        "a person walking back and forth, at 4 m", output="run.h5", **quick | {"radar": radar, "duration": 6.0}
    ) as run:
        yaw = run.labels["orientation"].values[:, 0]
        velocity = run.labels["velocity"].values[:, 0, :2]
        radial = run.labels["radial_velocity"].values[:, 0]
    speed = np.linalg.norm(velocity, axis=1)
    walking = speed > 0.6
    assert np.count_nonzero(walking & (radial < 0)) >= 2
    assert np.count_nonzero(walking & (radial > 0)) >= 2
    ahead = np.column_stack([np.cos(yaw), np.sin(yaw)])
    along = np.einsum("fi,fi->f", ahead, velocity)[walking] / speed[walking]
    assert along.min() > np.cos(np.radians(25))  # hips swing to and fro


# -- the command line -----------------------------------------------------------------------------------------


@pytest.fixture
def rfgen_command(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Any:
    """The entry point as the shell calls it: (exit code, output, errors)."""

    monkeypatch.setattr(logging.getLogger("rfgen_sionna"), "handlers", [])  # each call adds one

    def call(*arguments: object) -> tuple[int, str, str]:
        logging.getLogger("rfgen_sionna").handlers.clear()
        monkeypatch.setattr(sys, "argv", ["rfgen", *map(str, arguments)])
        monkeypatch.setenv("COLUMNS", "300")
        with pytest.raises(SystemExit) as ended:
            cli.main()
        out, err = capsys.readouterr()
        return int(ended.value.code or 0), out, err

    return call


@pytest.mark.usefixtures("no_work")
@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["a person"], "action: 'a person' names none"),
        ([PROMPT, "--duration", "-3"], "duration is -3.0 s: a positive"),
        ([PROMPT, "--duration", "0.0001"], "one frame of radar 'tiny'"),
        ([PROMPT, "--seed", "-1"], "--seed"),
        ([PROMPT, "--rtol", "0"], "rtol is 0.0"),
        ([PROMPT, "--preset", "fast"], "preset is 'fast'; presets: tiny"),
        ([PROMPT, "--environment", "the moon"], "environment: 'the moon'"),
        (["a person pushing", "--distance", "12"], "distance is 12 m"),
        ([PROMPT, "--output", "/proc/run.h5"], "/proc"),
    ],
)
def test_mistakes_on_the_command_line_end_with_code_2(
    rfgen_command: Any, tiny_toml: Path, folder: Path, arguments: list[str], said: str
) -> None:
    code, _, err = rfgen_command("generate", *arguments, "--radar", tiny_toml)
    assert code == 2
    assert said in err
    assert "Traceback" not in err
    assert list(folder.iterdir()) == []


def test_the_command_line_writes_a_run_and_says_each_thing_once(
    rfgen_command: Any, tiny_toml: Path, folder: Path
) -> None:
    code, out, err = rfgen_command(
        *("generate", PROMPT + ", wearing a hat", "--environment", "free space", "--radar", tiny_toml),
        *("--duration", 0.05, "--rtol", 0.03, "--pir-resolution", "8x8", "--no-pictures", "--seed", 2),
        *("--output", "cli.h5"),
    )
    assert code == 0, err
    assert err.count("hat'") == 1
    assert "effect: wearing a hat" not in out
    assert out.count("drawn from seed 2") >= 3
    assert re.search(r"^  distance +1\.5 m +from the prompt *$", out, re.MULTILINE)

    assert "wrote cli.h5" in out
    with rfgen.open_run(folder / "cli.h5") as run:
        assert run.adc.shape == (1, 8, 2, 4, 64)
        assert run.seeds["motion"] == 2


def test_a_radar_that_no_file_can_hold_is_refused_before_any_work(tiny_toml, tmp_path, monkeypatch):
    monkeypatch.setattr(composition, "set_up_environment", lambda *_, **__: pytest.fail("long work had begun"))
    radar = rfgen.Radar.load(tiny_toml, trajectory=lambda t: (0.3 * t, 0, 1))
    with pytest.raises(ValueError, match=r"radar\.trajectory is a function, which no file can hold: Trajectory"):
        rfgen.generate("a person jumps, 2 m away", radar=radar, output=tmp_path / "run.h5")


def test_a_person_behind_the_wall_is_refused(tmp_path):
    """The living room ends 5.4 m from the radar: nobody is seen 8 m away."""
    with pytest.raises(ValueError, match=r"distance is 8 m: the surfaces of scene 'living_room' hide the person"):
        rfgen.generate("a person pushing, 8 m away", environment="living_room", output=tmp_path / "run.h5")
    assert not list(tmp_path.iterdir())


def test_actors_beside_a_person_and_alone(quick: dict[str, Any], folder: Path) -> None:
    ball = trimesh.creation.icosphere(subdivisions=1, radius=0.1)
    drone = rfgen.Actor.from_mesh(ball, material="metal", name="drone", position=(3, 1, 1), velocity=(0, 0.5, 0))
    with rfgen.generate("a person pushing, 1.5 m away", actors=[drone], output="both.h5", **quick) as run:
        assert list(run.actors) == ["person", "drone"]
        assert run.labels["action"].values.tolist() == [["push", ""]] * 2
        np.testing.assert_allclose(run.labels["velocity"].values[:, 1], [[0, 0.5, 0]] * 2, atol=1e-9)
        assert re.search(r"^  actor +drone: metal +from the argument actors$", run.report, re.MULTILINE)
    with rfgen.generate(actors=drone, **quick | {"motion": "auto"}) as run:
        assert (run.path.name, list(run.actors), run.prompt) == ("run.h5", ["drone"], "")
        assert run.seeds == {"body": None, "motion": None, "surroundings": None, "speckle": 0, "noise": 0}
        assert run.has_pir
        radar = rfgen.Radar.load(quick["radar"], position=(0, 0, 1), look_at=(3, 0, 1))
        np.testing.assert_array_equal(run.adc[:], rfgen.Simulator(None, radar, [drone], rtol=0.03).adc(0.1).data)
    assert sorted(path.name for path in folder.iterdir()) == ["both.h5", "run.h5"]


def test_a_clip_in_the_place_of_the_action(quick: dict[str, Any], caplog: pytest.LogCaptureFixture) -> None:
    """The run is as long as the clip; its action is not the prompt's."""
    motion = KinematicSource()("jump", 0.12, 0)
    options = {name: value for name, value in quick.items() if name not in ("duration", "motion")}
    with rfgen.generate("a tall man walks, 2 m away", motion=replace(motion, action="hop"), **options) as run:
        assert (run.path.name, len(run)) == ("hop.h5", 2)
        assert set(run.labels["action"].values.ravel()) == {"clip: hop"}
        assert run.seeds["motion"] is None
        assert run.labels["distance"].values[0, 0] == pytest.approx(2.0, abs=0.2)
        assert re.search(r"^  motion +hop +from the argument motion$", run.report, re.MULTILINE)
    assert "'walks' has no effect: motion is the clip 'hop'" in caplog.text


@pytest.mark.usefixtures("no_work")
@pytest.mark.parametrize(
    ("changes", "error", "said"),
    [
        ({"actors": ["ball"]}, TypeError, r"actors is \['ball'\]: a list of actors is needed"),
        ({"motion": "clip.npz"}, FileNotFoundError, "there is no file or folder 'clip.npz'"),
        ({"motion": "difusion"}, ValueError, "motion: 'difusion'; allowed are .*, or the path of a clip"),
        ({"up": "y"}, ValueError, "up is 'y', which belongs to a clip in a file, but motion is 'kinematic'"),
    ],
)
def test_actors_and_clips_that_cannot_be(quick: dict[str, Any], changes: Any, error: Any, said: str) -> None:
    with pytest.raises(error, match=said):
        rfgen.generate(PROMPT, **quick | changes)


@pytest.mark.usefixtures("no_work")
def test_what_belongs_to_a_prompt_needs_one(quick: dict[str, Any]) -> None:
    ball = trimesh.creation.icosphere(subdivisions=1, radius=0.1)
    actor = rfgen.Actor.from_mesh(ball, material="metal", position=(3, 0, 1))
    for name, value in (("distance", 2.0), ("negative", "left arm"), ("motion", "kinematic")):
        with pytest.raises(ValueError, match=rf"{name} is {value!r}, which belongs to a prompt, but only actors"):
            rfgen.generate(actors=[actor], **quick | {"motion": "auto", name: value})
