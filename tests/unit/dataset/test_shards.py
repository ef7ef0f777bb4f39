"""A shard is the same bytes however its recordings were made, and holds each as it was."""

import hashlib
import time
from dataclasses import replace

import h5py
import numpy as np
import pytest

from rfgen_sionna.dataset import RunFormatError, RunInfo, RunWriter, StoredArray, open_run
from rfgen_sionna.dataset.shards import assemble_shard, extract_recording, recording_digest, shard_recordings
from rfgen_sionna.dataset.verified_files import examined

DECLARED = StoredArray(("point", "field"), ragged=True)


@pytest.fixture
def parts(tmp_path, info, frame):
    """Run files of three recordings: written at once, frame by frame, and of several radars."""
    arrays = {"cloud/points": DECLARED}
    known = replace(info, recording={"number": 0}, arrays=arrays)
    found = {}
    for number in (0, 1):
        found[number] = tmp_path / f"{number}.h5"
        with RunWriter(
            found[number], replace(known, recording={"number": number}), compressed=True, dated=False
        ) as run:
            for index in range(3):
                run.append(**frame(index + number), arrays={"cloud/points": np.ones((900 * index, 2))})
    found[7] = tmp_path / "7.h5"
    radars = {name: replace(info, recording={"number": 7}) for name in ("left", "right")}
    with RunWriter(found[7], radars, compressed=True, dated=False) as run:
        for index in range(2):
            run.append(**frame(index), radar="left")
            changed = frame(index)
            run.append(**changed | {"adc": 2 * changed["adc"]}, radar="right")
    return found


def digest(path):
    return hashlib.sha256(path.read_bytes()).hexdigest()


def test_any_order_and_time_gives_the_same_bytes(tmp_path, parts):
    assemble_shard(tmp_path / "a.h5", parts, {"recipe": "x", "a": "y"})
    time.sleep(1.1)  # times in HDF5 are whole seconds
    assemble_shard(tmp_path / "b.h5", dict(reversed(parts.items())), {"a": "y", "recipe": "x"})
    assert digest(tmp_path / "a.h5") == digest(tmp_path / "b.h5")
    assert not list(tmp_path.glob(".*"))
    fault, digests = examined(tmp_path / "a.h5")
    assert (fault, set(digests)) == ("", {0, 1, 7})


def test_a_recording_taken_out_and_put_back_is_the_same(tmp_path, parts):
    assemble_shard(tmp_path / "a.h5", parts)
    again = {number: tmp_path / f"again-{number}.h5" for number in parts}
    for number, path in again.items():
        extract_recording(tmp_path / "a.h5", number, path)
        with open_run(path) as run, open_run(parts[number]) as wanted:
            assert run.recording == {"number": number}
            for name, each in run.radars.items():
                one = wanted.radars[name]
                assert each.adc[:].tobytes() == one.adc[:].tobytes()
                assert each.arrays.keys() == one.arrays.keys()
                np.testing.assert_array_equal(each.actors["ball"].vertices(1), one.actors["ball"].vertices(1))
                assert each.labels["action"].values.tolist() == one.labels["action"].values.tolist()
                assert each.labels["gaze"].dims == ("frame", "eye", "axis")
                np.testing.assert_array_equal(each.pir(1).energy, one.pir(1).energy)
    assemble_shard(tmp_path / "b.h5", again)
    assert digest(tmp_path / "a.h5") == digest(tmp_path / "b.h5")
    with pytest.raises(RunFormatError, match="has no recording 3"):
        extract_recording(tmp_path / "a.h5", 3, tmp_path / "3.h5")


def test_the_digest_is_that_of_what_is_stored(tmp_path, parts):
    assemble_shard(tmp_path / "a.h5", parts)
    with h5py.File(tmp_path / "a.h5") as shard:
        found = {number: recording_digest(group) for number, group in shard_recordings(shard)}
        assert found == {number: group.attrs["digest"] for number, group in shard_recordings(shard)}
    for number, path in parts.items():
        with h5py.File(path) as run:
            assert recording_digest(run) == found[number]
    assert len(set(found.values())) == 3
    changes = {
        "a value": lambda file: file["labels/distance"].__setitem__((0, 0), 1.0),
        "a text": lambda file: file["labels/action"].__setitem__((0, 0), "sit"),
        "a unit": lambda file: file["labels/distance"].attrs.__setitem__("units", "km"),
        "an attribute": lambda file: file.attrs.__setitem__("prompt", "x"),
        "an array more": lambda file: file.create_dataset("more", data=[1.0]),
        "an array less": lambda file: file.__delitem__("labels/distance"),
    }
    for change in changes.values():
        with h5py.File(parts[0], "r+") as run:
            change(run)
            changed = recording_digest(run)
            assert changed != found[0]
            found[0] = changed


def test_radars_share_what_is_equal(tmp_path, parts):
    assemble_shard(tmp_path / "a.h5", {7: parts[7]})
    with h5py.File(tmp_path / "a.h5") as shard:
        left, right = (shard[f"recordings/000007/radars/{name}"] for name in ("left", "right"))
        for shared in ("actors/person/vertices", "actors/person/faces", "labels/distance", "pir/image", "frame_time"):
            assert left[shared] == right[shared], shared
        assert left["adc"] != right["adc"]
        np.testing.assert_array_equal(2 * left["adc"][:], right["adc"][:])
        assert right["adc"].dims[0][0].name.endswith("frame")


def test_arrays_keep_their_axes_and_open_in_xarray(tmp_path, parts):
    xarray = pytest.importorskip("xarray")
    pytest.importorskip("h5netcdf")
    assemble_shard(tmp_path / "a.h5", parts)
    with xarray.open_dataset(tmp_path / "a.h5", engine="h5netcdf", group="recordings/000001") as run:
        assert run.adc.dims == ("frame", "chirp", "tx", "rx", "sample")
        assert run.adc.sel(frame=1, tx="TX2").shape == (4, 4, 16)


def test_a_fault_leaves_the_old_shard(tmp_path, parts, monkeypatch):
    target = tmp_path / "shard.h5"
    target.write_text("old")
    (tmp_path / "none.h5").write_text("no run")
    with pytest.raises(RunFormatError, match=r"none\.h5' is not an HDF5 file"):
        assemble_shard(target, parts | {9: tmp_path / "none.h5"})

    def full(path):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("rfgen_sionna.dataset.whole_files.synced", full)
    with pytest.raises(OSError, match="No space left"):
        assemble_shard(target, parts)
    assert target.read_text() == "old"
    assert not list(tmp_path.glob(".*"))


def test_links_to_other_places_are_no_part_of_a_run(tmp_path, parts):
    with h5py.File(parts[0], "r+") as run:
        run["labels/away"] = h5py.ExternalLink("/etc/passwd", "/")
    with pytest.raises(ValueError, match="'labels/away' is a link to another place"):
        assemble_shard(tmp_path / "a.h5", parts)


def test_runs_without_actors_are_parts_too(tmp_path, radar):
    with RunWriter(tmp_path / "0.h5", RunInfo(radar), keep=("adc",), dated=False) as run:
        run.append(np.zeros(radar.frame_shape, np.complex64), time=0.0)
    assemble_shard(tmp_path / "a.h5", {0: tmp_path / "0.h5"})
    with pytest.raises(RunFormatError, match=r"is a shard of a data set: .*open_dataset"):
        open_run(tmp_path / "a.h5")
