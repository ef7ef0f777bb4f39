"""A run file is whole or not there, and never takes the place of another unasked."""

import json
import os
import signal
import subprocess
import sys
import textwrap
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest

from rfgen_sionna.dataset import OutputError, RunWriter, check_output, check_run_output, open_run
from rfgen_sionna.dataset.schema import ActorInfo, Label, RunInfo, software_versions


def test_what_is_written_is_read(tmp_path, write, info, frame, radar):
    write(tmp_path / "run.h5")
    with open_run(tmp_path / "run.h5") as run:
        assert len(run) == 3
        assert (run.prompt, run.negative_prompt, run.environment) == ("a person pushing", "furniture", "a hall")
        assert run.seeds == {"motion": 3, "noise": 7, "body": None}
        assert run.software == software_versions()
        assert run.radar.to_dict() == radar.to_dict()
        np.testing.assert_allclose(run.frame_times, [0, 0.1, 0.2])
        np.testing.assert_allclose(run.mesh_times, [0.0138, 0.1138, 0.2138])
        assert list(run.actors) == ["person", "ball"]
        person = run.actors["person"]
        assert (person.material, person.part_names, person.joint_names) == (
            "skin",
            ("torso", "arm"),
            ("pelvis", "hand"),
        )
        np.testing.assert_array_equal(person.faces, info.actors[0].faces)
        np.testing.assert_array_equal(person.face_parts, [0, 0, 1, 1])
        assert run.actors["ball"].joints(0).shape == (0, 3)
        for index in range(3):
            given = frame(index)
            np.testing.assert_array_equal(run.adc[index], given["adc"])
            np.testing.assert_allclose(person.vertices(index), given["vertices"]["person"], rtol=1e-6)
            np.testing.assert_allclose(person.joints(index), given["joints"]["person"], rtol=1e-6)
            image = run.pir(index)
            for channel in ("energy", "time_of_arrival", "velocity"):
                np.testing.assert_allclose(getattr(image, channel), getattr(given["pir"], channel), rtol=1e-6)
            assert image.fov_deg == (60.0, 45.0)
            assert image.position == radar.position
            assert image.time == pytest.approx(0.1 * index)
        assert run.labels["action"].values.tolist() == [["push", "roll"]] * 3
        assert run.labels["distance"].values[:, 0].tolist() == [3.0, 4.0, 5.0]
        assert run.labels["distance"].units == "m"
        assert run.labels["gaze"].dims == ("frame", "eye", "axis")
        assert set(run.labels) == {"action", "position", "distance", "breath", "gaze"}
        cube = run.cube(slice(1, 3))
        assert cube.data.shape == (2, 4, 3, 4, 16)
        assert cube.seed == 7
        assert cube.frame_times[0] == pytest.approx(0.1)


def test_every_axis_has_a_name_and_every_quantity_a_unit(tmp_path, write):
    unnamed, without = [], []

    def look(name, item):
        if not isinstance(item, h5py.Dataset) or item.is_scale:
            return
        unnamed.extend(f"{name}[{axis}]" for axis, dim in enumerate(item.dims) if not dim.label or not len(dim))
        if item.dtype.kind in "fc" and "units" not in item.attrs:
            without.append(name)

    with h5py.File(write(tmp_path / "run.h5")) as file:
        file.visititems(look)
        assert [dim.label for dim in file["adc"].dims] == ["frame", "chirp", "tx", "rx", "sample"]
        assert file["adc"].attrs["units"] == "sqrt(W)"
        assert file["adc"].chunks == (1, 4, 3, 4, 16)
        assert file["pir/channel"].asstr()[:].tolist() == ["energy", "time_of_arrival", "velocity"]
        assert file["pir/channel_units"].asstr()[:].tolist() == ["1", "s", "m s-1"]
        assert file.attrs["Conventions"] == "rfgen-run-1.0"
        assert json.loads(file.attrs["radar"])["name"] == "awr1843"
    assert not unnamed
    assert not without


@pytest.mark.parametrize("options", [{}, {"engine": "h5netcdf"}, {"engine": "h5netcdf", "invalid_netcdf": True}])
def test_it_opens_in_xarray(tmp_path, write, frame, options):
    xarray = pytest.importorskip("xarray")
    pytest.importorskip("h5netcdf")
    path = write(tmp_path / "run.h5")
    with xarray.open_dataset(path, **options) as run:
        assert run.adc.dims == ("frame", "chirp", "tx", "rx", "sample")
        assert run.adc.dtype == np.complex64
        assert run.adc.attrs["units"] == "sqrt(W)"
        np.testing.assert_array_equal(run.adc.sel(frame=1, tx="TX2", rx="RX4"), frame(1)["adc"][:, 1, 3])
        assert run.frame_time.dtype == np.float64
        assert run.attrs["prompt"] == "a person pushing"
    with xarray.open_dataset(path, group="pir", **options) as images:
        assert images.image.dims == ("frame", "channel", "row", "column")
        np.testing.assert_allclose(images.image.sel(channel="energy")[2], frame(2)["pir"].energy, rtol=1e-6)
    with xarray.open_dataset(path, group="actors/person", **options) as person:
        assert person.vertices.dims == ("frame", "vertex", "axis")
        assert person.joints.sel(joint="hand").shape == (3, 3)
    with xarray.open_datatree(path, **options) as tree:
        assert tree["labels/position"].attrs["units"] == "m"
        assert tree["labels/position"].sel(actor="ball", axis="z").shape == (3,)


@pytest.mark.parametrize("error", [RuntimeError, KeyboardInterrupt])
def test_an_interrupted_run_leaves_nothing(tmp_path, info, frame, error):
    def interrupted():
        with RunWriter(tmp_path / "run.h5", info) as writer:
            writer.append(**frame(0))
            assert not (tmp_path / "run.h5").exists()
            assert [path.name for path in tmp_path.iterdir()] == [f".run.h5.partial-{os.getpid()}"]
            raise error

    with pytest.raises(error):
        interrupted()
    assert list(tmp_path.iterdir()) == []


def test_a_key_press_in_another_process_leaves_nothing(tmp_path):
    script = textwrap.dedent(
        """
        import signal, sys, time, numpy as np
        from rfgen_sionna.dataset import RunInfo, RunWriter
        signal.signal(signal.SIGINT, signal.default_int_handler)  # tests in the background inherit that it is ignored
        from rfgen_sionna.radar import Radar
        radar = Radar.load("awr1843")
        with RunWriter(sys.argv[1], RunInfo(radar)) as writer:
            writer.append(np.zeros((128, 3, 4, 256), np.complex64), time=0.0)
            print("ready", flush=True)
            time.sleep(60)
        """
    )
    output = tmp_path / "run.h5"
    child = subprocess.Popen(
        [sys.executable, "-c", script, str(output)], stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )
    assert child.stdout.readline() == b"ready\n"
    assert [path.name for path in tmp_path.iterdir()] == [f".run.h5.partial-{child.pid}"]
    child.send_signal(signal.SIGINT)
    _, errors = child.communicate(timeout=20)
    assert b"KeyboardInterrupt" in errors
    assert list(tmp_path.iterdir()) == []


def test_an_existing_file_stays_unless_it_is_to_be_overwritten(tmp_path, write):
    path = tmp_path / "run.h5"
    path.write_text("precious")
    with pytest.raises(OutputError, match=r"exists; choose another name, or pass overwrite=True"):
        write(path)
    assert path.read_text() == "precious"
    write(path, overwrite=True)
    with open_run(path) as run:
        assert len(run) == 3
    assert list(tmp_path.iterdir()) == [path]


def test_a_failed_overwrite_keeps_the_old_file(tmp_path, info, frame):
    path = tmp_path / "run.h5"
    path.write_text("precious")
    with pytest.raises(OutputError, match="no frame was written"), RunWriter(path, info, overwrite=True):
        pass
    assert path.read_text() == "precious"
    assert list(tmp_path.iterdir()) == [path]


def test_a_file_that_appears_meanwhile_is_kept_and_so_is_the_run(tmp_path, info, frame):
    path = tmp_path / "run.h5"

    def late():
        with RunWriter(path, info) as writer:
            writer.append(**frame(0))
            path.write_text("precious")

    with pytest.raises(OutputError, match="appeared while the run was written; the run is in"):
        late()
    assert path.read_text() == "precious"
    with open_run(tmp_path / f".run.h5.partial-{os.getpid()}") as run:
        assert len(run) == 1


def test_outputs_that_cannot_be_are_refused_before_work(tmp_path, monkeypatch):
    assert check_output(tmp_path / "new.h5") == tmp_path / "new.h5"
    assert list(tmp_path.iterdir()) == []
    with pytest.raises(OutputError, match=r"folder '.*missing' does not exist"):
        check_output(tmp_path / "missing" / "run.h5")
    with pytest.raises(OutputError, match="is a folder"):
        check_output(tmp_path)

    def refuse(*_, **__):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr("rfgen_sionna.dataset.store.tempfile.TemporaryFile", refuse)
    with pytest.raises(OutputError, match=r"not writable \(Permission denied\)"):
        check_output(tmp_path / "run.h5")


def change(frame, **changes):
    return frame | changes


BAD_FRAMES = {
    "adc is complex64 .* is needed by the radar": lambda f: {"adc": f["adc"][:2]},
    "adc is float32": lambda f: {"adc": f["adc"].real},
    "NaN or infinite samples": lambda f: {"adc": f["adc"] * np.nan},
    "frames ascend": lambda f: {"time": 0.0},
    "time is nan": lambda f: {"time": float("nan")},
    r"vertices are given for \['person'\]; needed for": lambda f: {"vertices": {"person": f["vertices"]["person"]}},
    r"vertices of 'ball' have shape \(3, 3\)": lambda f: {"vertices": f["vertices"] | {"ball": np.zeros((3, 3))}},
    "joints of 'person'": lambda f: {"joints": {"person": np.full((2, 3), np.nan)}},
    r"labels are .*; declared are": lambda f: {"labels": f["labels"] | {"mood": 1}},
    "label 'position' has shape": lambda f: {"labels": f["labels"] | {"position": np.zeros((1, 3))}},
    "label 'action' is .*texts": lambda f: {"labels": f["labels"] | {"action": [1, 2]}},
    "pir is missing in frame 1": lambda f: {"pir": None},
    "pir of frame 1 has": lambda f: {"pir": replace(f["pir"], fov_deg=(50.0, 45.0))},
}


@pytest.mark.parametrize("message", BAD_FRAMES)
def test_a_frame_that_does_not_fit_is_named_and_not_written(tmp_path, info, frame, message):
    with RunWriter(tmp_path / "run.h5", info) as writer:
        writer.append(**frame(0))
        with pytest.raises(ValueError, match=message):
            writer.append(**change(frame(1), **BAD_FRAMES[message](frame(1))))
        assert writer.frames == 1
        writer.append(**frame(1))
    with open_run(tmp_path / "run.h5") as run:
        assert len(run) == 2
        np.testing.assert_array_equal(run.adc[1], frame(1)["adc"])


def test_a_run_without_actors_and_images(tmp_path, radar):
    with RunWriter(tmp_path / "run.h5", RunInfo(radar)) as writer:
        writer.append(np.zeros((4, 3, 4, 16), np.complex64), time=0.0)
    with pytest.raises(RuntimeError, match="the writer is closed"):
        writer.append(np.zeros((4, 3, 4, 16), np.complex64), time=0.1)
    with open_run(tmp_path / "run.h5") as run:
        assert not run.has_pir
        assert not run.actors
        assert not run.labels
        with pytest.raises(ValueError, match="holds no PIR"):
            run.pir(0)


def test_bad_descriptions_are_named(radar):
    faces = np.array([[0, 1, 2]])
    with pytest.raises(ValueError, match=r"faces use vertices 0 … 2; 0 … 1 exist"):
        ActorInfo("a", "skin", faces, 2)
    with pytest.raises(ValueError, match=r"actor.name is 'a/b'"):
        ActorInfo("a/b", "skin", faces, 3)
    with pytest.raises(ValueError, match="each of the 1 faces one of the 1 parts"):
        ActorInfo("a", "skin", faces, 3, face_parts=np.array([1]))
    with pytest.raises(ValueError, match="each name may appear once"):
        RunInfo(radar, actors=(ActorInfo("a", "skin", faces, 3),) * 2)
    with pytest.raises(ValueError, match=r"label 'x' has dims"):
        RunInfo(radar, labels={"x": Label("m", ("frame",))})
    with pytest.raises(TypeError, match=r"seeds\['noise'\] is 1.5"):
        RunInfo(radar, seeds={"noise": 1.5})


def test_meshes_in_utm_coordinates_keep_micrometres(tmp_path, info, frame):
    place = np.array([690123.37, 5335012.61, 520.13])
    far = replace(info, radar=info.radar.placed(position=tuple(place.tolist())))
    given = frame(0)
    given["vertices"] = {name: points + place for name, points in given["vertices"].items()}
    given["joints"] = {name: points + place for name, points in given["joints"].items()}
    with RunWriter(tmp_path / "far.h5", far) as writer:
        writer.append(**given)
    with open_run(tmp_path / "far.h5") as run:
        for name in ("person", "ball"):
            np.testing.assert_allclose(run.actors[name].vertices(0), given["vertices"][name], rtol=0, atol=1e-6)


def test_frames_of_a_killed_process_are_continued(tmp_path, radar):
    """Nothing can be tidied up at SIGKILL: each frame is on the disk when append returns."""
    script = textwrap.dedent(
        """
        import sys, time, numpy as np
        from rfgen_sionna.dataset import RunInfo, RunWriter
        from rfgen_sionna.radar import Radar
        radar = Radar.from_dict(eval(sys.argv[2]))
        with RunWriter(sys.argv[1], RunInfo(radar, settings={"rtol": 0.01}), resume=True) as writer:
            for frame in range(2):
                writer.append(np.full(radar.frame_shape, frame, np.complex64), time=0.1 * frame, full_scale=4.0)
            print("ready", flush=True)
            time.sleep(60)
        """
    )
    output = tmp_path / "run.h5"
    child = subprocess.Popen([sys.executable, "-c", script, str(output), repr(radar.to_dict())], stdout=subprocess.PIPE)
    assert child.stdout.readline() == b"ready\n"
    info = RunInfo(radar, settings={"rtol": 0.01})
    with pytest.raises(OutputError, match="another process writes them"), RunWriter(output, info, resume=True):
        pass
    child.send_signal(signal.SIGKILL)
    child.communicate(timeout=20)
    with pytest.raises(OutputError, match=r"whose settings\.rtol is 0\.01 instead of 0\.02: delete that file"):
        RunWriter(output, replace(info, settings={"rtol": 0.02}), resume=True).__enter__()
    with RunWriter(output, info, resume=True) as writer:
        assert writer.frames == 2
        assert writer.radar().full_scale == 4.0
        writer.append(np.full(radar.frame_shape, 2, np.complex64), time=0.2, full_scale=4.0)
    assert list(tmp_path.iterdir()) == [output]
    with open_run(output) as run:
        assert run.adc[:, 0, 0, 0, 0].real.tolist() == [0.0, 1.0, 2.0]
        assert run.full_scale == 4.0


def test_each_of_several_radars_needs_its_frames(tmp_path, radar):
    infos = {name: RunInfo(radar) for name in ("left", "right")}
    with pytest.raises(OutputError, match="no frame was written"), RunWriter(tmp_path / "run.h5", infos) as writer:
        writer.append(np.zeros(radar.frame_shape, np.complex64), time=0.0, radar="left")
    assert not list(tmp_path.iterdir())


def test_real_samples_of_a_real_adc(tmp_path, radar):
    real = replace(radar, adc=replace(radar.adc, real=True))
    shape = real.frame_shape
    with RunWriter(tmp_path / "run.h5", RunInfo(real)) as writer:
        with pytest.raises(ValueError, match=r"adc is complex64 .*; real .* is needed by the radar"):
            writer.append(np.zeros(shape, np.complex64), time=0.0)
        writer.append(np.full(shape, 0.5), time=0.0, full_scale=1.0, clipped=0.25)
    with open_run(tmp_path / "run.h5") as run:
        assert run.adc.dtype == np.float32
        assert run.clipped == np.prod(shape) / 4
        assert np.all(run.cube().data == 0.5)


def test_a_run_is_not_written_under_the_name_of_another_format(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match=r"ending of another format.*'run\.h5'"):
        check_run_output(tmp_path / "run.npy")
