"""The command line passes on what it is told, and turns what the user can mend into one line and exit code 2."""

from __future__ import annotations

import logging
import re
import signal
import subprocess
import sys
import warnings
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from typer.testing import CliRunner

from rfgen_sionna import cli
from rfgen_sionna.dataset import Run, RunInfo, RunWriter, open_run
from rfgen_sionna.radar import Radar
from rfgen_sionna.show import NoPictureError
from rfgen_sionna.signal.formats import read_capture


class Rfgen:
    """Calls the entry point as the shell does, with a stand-in for the long work."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
        self.monkeypatch, self.capsys = monkeypatch, capsys
        self.calls: list[dict[str, Any]] = []
        self.failure: BaseException | None = None
        monkeypatch.setattr("rfgen_sionna.pipeline.generate", self.generate)
        monkeypatch.setattr(logging.getLogger("rfgen_sionna"), "handlers", [])

    def generate(self, prompt: str, **options: Any) -> Run:
        self.calls.append({"prompt": prompt} | options)
        if self.failure is not None:
            raise self.failure
        warnings.warn("a word was not understood", UserWarning, stacklevel=1)
        logging.getLogger("rfgen_sionna.generative").warning("another one neither")
        options["progress"](1, 2)
        write_run(options["output"], prompt)
        return open_run(options["output"])

    def __call__(self, *arguments: str) -> tuple[int, str, str]:
        self.monkeypatch.setattr(sys, "argv", ["rfgen", *arguments])
        self.monkeypatch.setattr(warnings, "filters", [("always", None, Warning, None, 0)])
        with pytest.raises(SystemExit) as ended:
            cli.main()
        out, err = self.capsys.readouterr()
        return int(ended.value.code or 0), out, err


def write_run(path: Path, prompt: str) -> None:
    """A short run without actors."""
    radar = Radar.load("awr1843", "mmmesh")
    radar = replace(radar, waveform=replace(radar.waveform, num_loops=8, num_samples=16))
    rng = np.random.default_rng(0)
    with RunWriter(
        path, RunInfo(radar, prompt=prompt, seeds={"noise": 0}, report="decided:\n  hand  left  drawn from seed 0")
    ) as writer:
        for frame in range(2):
            samples = rng.standard_normal((8, 3, 4, 16, 2)).view(np.complex128)[..., 0]
            writer.append(1e-6 * samples, time=0.1 * frame)


@pytest.fixture
def rfgen(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path) -> Rfgen:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "200")
    return Rfgen(monkeypatch, capsys)


def test_generate_passes_every_option_on(rfgen: Rfgen, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "rx.toml").touch()
    code, out, err = rfgen(
        *("generate", "a person raises an arm", "--negative", "left arm", "--environment", "diffusion: a living room"),
        *("--radar", "awr1843", "--preset", "di_gesture", "--duration", "1.5", "--seed", "7", "--output", "arm.h5"),
        *("--no-noise", "--rtol", "0.01", "--distance", "2", "--pir-resolution", "32x64", "--no-pictures"),
        *("--radar-position", "-1,0.5,1.2", "--look-at", "3,0,1", "--receiver", "rx.toml"),
        *("--motion", "diffusion", "--collisions", "warn", "--device", "cpu", "--max-bounces", "2", "--transmission"),
        *("--negative-environment", "sofa", "--no-refine"),
        *("--environment-model", "folder", "--environment-lora", "owner/lora", "--fov-deg", "80"),
        *("--projection", "equirectangular"),
    )
    assert code == 0, err
    call = rfgen.calls[0]
    call.pop("progress")
    call.pop("report")
    assert call == {
        "prompt": "a person raises an arm",
        "actors": [],
        "board": None,
        "outside": "error",
        "up": None,
        "frame_rate": None,
        "negative": "left arm",
        "environment": "diffusion: a living room",
        "negative_environment": "sofa",
        "refine": False,
        "environment_model": "folder",
        "environment_lora": "owner/lora",
        "radar": "awr1843",
        "preset": "di_gesture",
        "duration": 1.5,
        "seed": 7,
        "output": Path("arm.h5"),
        "overwrite": False,
        "resume": False,
        "noise": False,
        "receiver": Path("rx.toml"),
        "rtol": 0.01,
        "distance": 2.0,
        "radar_position": (-1.0, 0.5, 1.2),
        "look_at": (3.0, 0.0, 1.0),
        "pir_resolution": (32, 64),
        "fov_deg": 80.0,
        "projection": "equirectangular",
        "max_bounces": 2,
        "transmission": True,
        "motion": "diffusion",
        "collisions": "warn",
        "device": "cpu",
    }
    assert re.search(r"raises an arm +action right_arm_raised", out)
    assert "wrote arm.h5" in out
    assert "warning: a word was not understood" in err
    assert "warning: another one neither" in err


def test_a_strength_is_how_far_images_are_refined(rfgen: Rfgen) -> None:
    code, _, err = rfgen("generate", "a person walking", "--strength", "0.25", "--no-pictures")
    assert code == 0, err
    assert rfgen.calls[0]["refine"] == 0.25
    code, _, err = rfgen("generate", "a person walking", "--strength", "0.25", "--no-refine", "--no-pictures")
    assert code == 2
    assert "--strength is 0.25, but --no-refine" in err


def test_what_can_be_done_is_read_and_what_cannot_is_refused_with_the_nearest(rfgen: Rfgen) -> None:
    for prompt, name, said in (
        ("a person walks while raising the left arm", "walk", "arms left_arm_raised"),
        ("a person dances at 2 m", "dance", "action dance"),
    ):
        code, out, err = rfgen("generate", prompt, "--no-pictures")
        assert code == 0, err
        assert said in out
        assert rfgen.calls[-1]["output"] == Path(f"{name}.h5")
    code, _, err = rfgen("generate", "a person rides a unicycle", "--no-pictures")
    assert code == 2
    assert "cannot be done" in err
    assert "the nearest that can be done are: a person" in err


def test_no_environment_is_free_space(rfgen: Rfgen) -> None:
    code, _, err = rfgen("generate", "a person walks in an office", "--no-environment", "--no-pictures")
    assert code == 0, err
    assert rfgen.calls[0]["environment"] == "none"
    code, _, err = rfgen("generate", "a person walks", "--no-environment", "--environment", "scene", "--no-pictures")
    assert code == 2
    assert "--environment is 'scene', but --no-environment" in err


def test_the_former_option_for_the_source_warns(rfgen: Rfgen) -> None:
    options = ("--environment", "an office", "--surroundings", "furnished", "--no-pictures")
    code, _, err = rfgen("generate", "a person walks", *options)
    assert code == 0, err
    assert "--surroundings is deprecated: use --environment 'furnished: …'" in err
    assert rfgen.calls[0]["environment"] == "furnished: an office"


def test_generate_draws_what_it_made_and_names_it_after_the_action(rfgen: Rfgen, tmp_path: Path) -> None:
    code, out, err = rfgen("generate", "a person doing jumping jacks")
    assert code == 0, err
    for suffix in ("h5", "png", "gif"):
        assert f"wrote jumping_jacks.{suffix}" in out
        assert (tmp_path / f"jumping_jacks.{suffix}").stat().st_size > 1000
    code, out, err = rfgen("show", "jumping_jacks.h5")  # as the README has it
    assert code == 0, err
    assert out.index("a person doing jumping jacks") < out.index("jumping_jacks.png exists and is kept")
    assert "jumping_jacks.gif exists and is kept" in out
    assert "wrote" not in out


def test_a_run_that_has_no_picture_is_a_warning(rfgen: Rfgen, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A constant frequency tells no ranges: the data are there all the same."""

    def none(*_: object, **__: object) -> Path:
        raise NoPictureError("it tells no ranges")

    monkeypatch.setattr("rfgen_sionna.show.sheet", none)
    write_run(tmp_path / "run.h5", "a person walking")
    code, out, err = rfgen("show", "run.h5")
    assert code == 0
    assert "a person walking" in out
    assert "warning: it tells no ranges" in err
    assert list(tmp_path.glob("run.*")) == [tmp_path / "run.h5"]


def test_show_says_what_a_file_holds_and_draws_it_once(rfgen: Rfgen, tmp_path: Path) -> None:
    write_run(tmp_path / "run.h5", "a person walking")
    code, out, err = rfgen("show", "run.h5", "--no-pictures")
    assert code == 0, err
    assert "a person walking" in out
    assert "2 × 8 × 3 × 4 × 16" in out
    assert "hand  left  drawn from seed 0" in out
    assert list(tmp_path.glob("run.*")) == [tmp_path / "run.h5"]
    (tmp_path / "run.png").write_text("mine")
    code, out, err = rfgen("show", "run.h5")
    assert code == 0, err
    assert "a person walking" in out
    assert "run.png exists and is kept; --overwrite" in out
    assert "wrote run.gif" in out
    assert (tmp_path / "run.png").read_text() == "mine"
    assert rfgen("show", "run.h5", "--overwrite")[0] == 0
    assert (tmp_path / "run.png").read_bytes()[:4] == b"\x89PNG"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["an elephant walking"], "'elephant'"),
        (["a person walking", "--output", "there.h5"], "there.h5"),
        (["a person walking", "--output", "free.h5"], "free.png"),
        (["a person walking", "--output", "walk.png"], "another format"),
        (["a person walking", "--output", "nowhere/walk.h5"], "nowhere"),
        (["a person walking", "--pir-resolution", "0x3"], "--pir-resolution"),
        (["a person walking", "--pir-resolution", "many"], "--pir-resolution"),
        (["a person walking", "--radar-position", "1,2"], "--radar-position: '1,2' is not X,Y,Z"),
        (["a person walking", "--look-at", "ahead"], "--look-at: 'ahead' is not X,Y,Z"),
        (["a person walking", "--radar", "awr"], "awr1843"),
        (["a person walking", "--preset", "fast"], "preset is 'fast'"),
        (["a person walking", "--rtol", "5"], "rtol is 5.0"),
        (["a person walking", "--duration", "0.001"], "duration is 0.001 s"),
        (["a person walking", "--receiver", "nowhere.toml"], "nowhere.toml"),
        (["a person walking", "--collisions", "no"], "collisions is 'no'"),
        (["a person walking", "--fov-deg", "180"], "fov_deg is 180.0"),
        (["a person walking", "--projection", "flat"], "projection is 'flat'"),
        (["a person walking", "--environment", "outside: here"], "environment: 'outside' is no source of surroundings"),
        (["a person walking", "--device", "gpu"], "device is 'gpu'"),
    ],
)
def test_mistakes_are_one_line_before_any_work(
    rfgen: Rfgen, tmp_path: Path, arguments: list[str], message: str
) -> None:
    (tmp_path / "there.h5").touch()
    (tmp_path / "free.png").touch()
    code, out, err = rfgen("generate", *arguments)
    assert code == 2
    assert "frames" not in out
    assert err.startswith("error: ")
    assert message in err
    assert err.count("\n") == 1
    assert rfgen.calls == []
    assert (tmp_path / "there.h5").stat().st_size == 0


def test_existing_files_are_replaced_where_that_is_asked_for(rfgen: Rfgen, tmp_path: Path) -> None:
    (tmp_path / "free.png").touch()
    code, _, err = rfgen("generate", "a person walking", "--output", "free.h5", "--overwrite", "--no-pictures")
    assert code == 0, err
    assert rfgen.calls[0]["overwrite"] is True


@pytest.mark.parametrize(
    ("failure", "code", "message"),
    [
        (ValueError("duration is -1 s"), 2, "error: duration is -1 s\n"),
        (ImportError("anny is not installed"), 2, "error: anny is not installed\n"),
        (PermissionError(13, "Permission denied"), 2, "error: [Errno 13] Permission denied\n"),
        (KeyboardInterrupt(), 130, ""),
    ],
)
def test_failures_of_the_work_keep_their_words(rfgen: Rfgen, failure: BaseException, code: int, message: str) -> None:
    rfgen.failure = failure
    ended, _, err = rfgen("generate", "a person walking", "--no-pictures")
    assert ended == code
    assert err.endswith(message)
    assert "Traceback" not in err


def test_a_bug_keeps_its_traceback(rfgen: Rfgen, monkeypatch: pytest.MonkeyPatch) -> None:
    rfgen.failure = ZeroDivisionError()
    monkeypatch.setattr(sys, "argv", ["rfgen", "generate", "a person walking", "--no-pictures"])
    with pytest.raises(ZeroDivisionError):
        cli.main()


def test_every_option_is_one_of_the_pipeline() -> None:
    """The stand-in takes anything, the real one does not."""
    from inspect import signature

    from rfgen_sionna.pipeline import generate

    shown = set(signature(cli.generate).parameters) - {
        "pictures",
        "no_environment",
        "strength",
        "surroundings",
        "actor",
    }
    assert shown <= set(signature(generate).parameters)


def test_radars_are_listed_with_what_follows_from_them(rfgen: Rfgen) -> None:
    code, out, _ = rfgen("radars")
    assert code == 0
    radar = Radar.load("awr1843", "mmmesh")
    line = next(line for line in out.splitlines() if "mmmesh" in line)
    assert f"{radar.range_resolution:.3f} {radar.max_range:.1f}" in line
    assert f"±{radar.max_velocity:.2f}" in line
    assert "3×4" in line
    assert "di_gesture" in out


def test_radars_are_named_in_full_on_a_narrow_terminal(rfgen: Rfgen, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cli._out, "_width", 80)
    _, out, _ = rfgen("radars")
    assert "…" not in out
    names = [line.split()[0] for line in out.splitlines()[1:] if not line.startswith(("frame:", "unambiguous"))]
    assert names == [word for name, presets in Radar.available().items() for word in (name, *presets)]
    assert max(map(len, out.splitlines())) <= 80


def test_a_run_that_is_terminated_leaves_no_partial_file(tmp_path: Path) -> None:
    """The process is ended from outside while it writes, as a job scheduler does."""
    code = """
import sys, time
from rfgen_sionna import cli, pipeline
from rfgen_sionna.dataset import RunInfo, RunWriter
from rfgen_sionna.radar import Radar

def generate(prompt, **options):
    with RunWriter(options["output"], RunInfo(Radar.load("awr1843"), prompt=prompt)):
        print("writing", flush=True)
        time.sleep(60)

pipeline.generate = generate
sys.argv = ["rfgen", "generate", "a person walking", "--no-pictures", "--output", "run.h5"]
cli.main()
"""
    process = subprocess.Popen([sys.executable, "-c", code], cwd=tmp_path, stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    for line in process.stdout:
        if line.startswith("writing"):
            break
    assert list(tmp_path.glob(".run.h5.partial-*"))
    process.send_signal(signal.SIGTERM)
    assert process.wait(timeout=30) == 128 + signal.SIGTERM
    process.stdout.close()
    assert list(tmp_path.iterdir()) == []


def test_export_writes_what_the_radar_itself_would(rfgen: Rfgen, tmp_path: Path) -> None:
    write_run(tmp_path / "run.h5", "a person walking")
    code, out, err = rfgen("export", "run.h5", "--format", "dca1000", "--output", "capture")
    assert code == 0, err
    assert "wrote capture/adc_data.bin" in out
    assert "2 frames" in out
    assert "0 values clipped" in out
    back = read_capture(tmp_path / "capture")
    with open_run(tmp_path / "run.h5") as run:
        full = run.cube()
    assert np.abs(back.data - full.data).max() < 1e-4 * np.abs(full.data).max()
    assert (back.radar, back.seed) == (full.radar, full.seed)
    code, out, err = rfgen("export", "run.h5", "--format", "dca1000", "--output", "loud", "--scale=-95dBm")
    assert code == 0, err
    assert "full scale -95.0 dBm" in out
    assert ", 0 values clipped" not in out
    code, _, err = rfgen("export", "run.h5", "--format", "dca1000", "--output", "capture")
    assert code == 2
    assert "adc_data.bin' exists" in err
    for option in (["--format", "wav"], ["--format", "matlab", "--scale", "much"]):
        code, _, err = rfgen("export", "run.h5", "--output", "other", *option)
        assert code == 2
        assert option[-1] in err
        assert not (tmp_path / "other").exists()


@pytest.mark.parametrize("command", [[], ["generate"], ["radars"], ["show"], ["export"]])
def test_help_teaches(rfgen: Rfgen, command: list[str]) -> None:
    code, out, _ = rfgen(*command, "--help")
    assert code == 0
    assert "[/" not in out, "markup is rendered"
    if command != ["radars"]:
        assert "rfgen " + " ".join(command or ["generate"]) in out
    if command == ["generate"]:
        assert '--negative "left arm"' in out


def test_motions_are_listed_and_drawn(tmp_path: Path) -> None:
    app = CliRunner()
    listed = app.invoke(cli.app, ["motions"])
    assert listed.exit_code == 0
    assert "lie_down" in listed.output
    drawn = app.invoke(cli.app, ["motions", "cartwheel", "--draw", str(tmp_path / "wheels.png")])
    assert drawn.exit_code == 0
    assert (tmp_path / "wheels.png").stat().st_size > 10_000
    again = app.invoke(cli.app, ["motions", "cartwheel", "--draw", str(tmp_path / "wheels.png")])
    assert isinstance(again.exception, FileExistsError)
    nothing = app.invoke(cli.app, ["motions", "levitates"])
    assert "no clip has the words" in str(nothing.exception)


def test_a_clip_and_objects_on_the_command_line(rfgen: Rfgen, tmp_path: Path) -> None:
    trimesh.creation.icosphere(subdivisions=1, radius=0.1).export(tmp_path / "my ball.ply")
    np.savez(tmp_path / "wave.npz", poses=np.zeros((3, 72)), trans=np.zeros((3, 3)), mocap_framerate=30.0)
    options = ("--no-pictures", "--environment", "free space")
    arguments = ("a person jumps, 2 m away", "--motion", "wave.npz", "--up", "y", "--frame-rate", "60")
    code, out, err = rfgen("generate", *arguments, *options, "--actor", "my ball.ply metal 2,1,0.5")
    assert code == 0, err
    call = rfgen.calls[0]
    assert (call["motion"], call["up"], call["frame_rate"], call["duration"]) == ("wave.npz", "y", 60.0, None)
    assert call["output"] == Path("wave.h5")
    (ball,) = call["actors"]
    assert (ball.position, ball.material) == ((2.0, 1.0, 0.5), "metal")
    assert "2 m away" in out
    for wrong, said in (
        (("--actor", "ball.ply metal"), "--actor: 'ball.ply metal' is not 'FILE MATERIAL X,Y,Z'"),
        (("--actor", "my ball.ply metal 2,1"), "--actor: '2,1' is not X,Y,Z"),
        (("--motion", "none.bvh"), "there is no file or folder 'none.bvh'"),
        (("--motion", "kinematic", "--up", "y"), "up is 'y', which belongs to a clip"),
    ):
        code, _, err = rfgen("generate", "a person jumps", *options, *wrong)
        assert code == 2
        assert said in " ".join(err.split())


def test_files_of_several_radars_are_shown_and_exported_by_name(rfgen: Rfgen, tmp_path: Path) -> None:
    radar = Radar.load("awr1843", "mmmesh")
    radar = replace(radar, waveform=replace(radar.waveform, num_loops=8, num_samples=16))
    infos = {name: RunInfo(radar.placed(position=(0, y, 1))) for name, y in (("left", 1), ("right side", -1))}
    with RunWriter(tmp_path / "run.h5", infos) as writer:
        for value, name in enumerate(infos):
            writer.append(np.full(radar.frame_shape, 1e-6 * (1 + value), np.complex64), time=0.0, radar=name)
    code, out, err = rfgen("show", "run.h5", "--no-pictures")
    assert code == 0, err
    assert "left: awr1843" in out
    assert "right side: awr1843" in out
    code, _, err = rfgen("export", "run.h5", "--format", "matlab", "--output", "x.mat")
    assert code == 2
    assert "--radar is not given; 'run.h5' has 'left', 'right side': name one of them" in " ".join(err.split())
    code, out, err = rfgen("export", "run.h5", "--format", "matlab", "--output", "x.mat", "--radar", "right side")
    assert code == 0, err
    cube = read_capture(tmp_path / "x.mat")
    np.testing.assert_allclose(cube.data, 2e-6, rtol=1e-6)
    assert cube.radar.position == (0, -1, 1)
