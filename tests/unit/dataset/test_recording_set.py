"""A data set is a sequence of runs, in any process."""

import multiprocessing
import os
import pickle
import shutil

import numpy as np
import pytest

from rfgen_sionna.dataset import ChecksumError, OutputError, RunFormatError, open_dataset, open_run
from rfgen_sionna.dataset.checksums import write_sums
from rfgen_sionna.dataset.set_index import INDEX, Failure, read_index, write_index
from rfgen_sionna.dataset.shards import extract_recording


def samples_of(recordings, place):
    return recordings[place].adc[1]


def test_recordings_are_runs(small_set):
    with open_dataset(small_set) as recordings:
        assert len(recordings) == 3
        assert [run.recording["number"] for run in recordings] == [0, 1, 2]
        run = recordings[-1]
        assert (run.prompt, len(run), list(run.actors)) == ("a person waving", 2, ["person"])
        assert run.cube().data.shape == (2, *run.radar.frame_shape)
        assert run.radar is recordings[0].radar
        assert recordings.recording(2).adc[0].tobytes() == run.adc[0].tobytes()
        assert recordings.splits == ("test", "train")
        train = recordings.split("train")
        assert [row.number for row in train.rows] == [1, 2]
        assert train[0].recording["number"] == 1
        assert len(recordings[1:]) == 2
        assert recordings[np.int64(1)].recording["number"] == 1
        row = recordings.rows[1]
        assert (row.name, row.actions, row.bodies, row.frames, row.seed) == ("000001", ("wave",), (1,), 2, 6)
        assert row.spec["split"] == "train"
        assert recordings.recipe_text.startswith("#") or "=" in recordings.recipe_text
        assert "3 recordings, splits test, train" in " ".join(repr(recordings).split())
        assert "recordings/000002', 2 frames" in " ".join(repr(run).split())
        with pytest.raises(IndexError, match="position 3: the set has 3"):
            recordings[3]
        with pytest.raises(ValueError, match=r"split is 'dev': .* has test, train"):
            recordings.split("dev")
        with pytest.raises(KeyError, match="has no recording 9"):
            recordings.recording(9)


def test_copies_in_other_processes(small_set, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    with open_dataset("set") as recordings:
        wanted = samples_of(recordings, 2)
        monkeypatch.chdir("/")
        copy = pickle.loads(pickle.dumps(recordings))
        np.testing.assert_array_equal(samples_of(copy, 2), wanted)
        copy.close()
        np.testing.assert_array_equal(samples_of(copy, 2), wanted)
        run = pickle.loads(pickle.dumps(recordings[2]))
        np.testing.assert_array_equal(run.adc[1], wanted)
        with multiprocessing.get_context("spawn").Pool(1) as pool:
            np.testing.assert_array_equal(pool.apply(samples_of, (recordings, 2)), wanted)


@pytest.mark.skipif(not hasattr(os, "fork"), reason="processes are forked on POSIX systems")
@pytest.mark.filterwarnings("ignore:This process .* is multi-threaded:DeprecationWarning")
def test_a_forked_process_opens_its_own_files(small_set):
    with open_dataset(small_set) as recordings:
        held = recordings[1]
        wanted = samples_of(recordings, 2)
        receive, send = multiprocessing.Pipe(False)

        def read():
            send.send((samples_of(recordings, 2), held.adc[1], recordings[2].stored("adc").file.id.get_vfd_handle()))

        child = multiprocessing.get_context("fork").Process(target=read)
        child.start()
        here, there, _ = receive.recv()
        child.join()
        np.testing.assert_array_equal(here, wanted)
        np.testing.assert_array_equal(there, held.adc[1])


def test_files_are_read_when_needed_and_closed_when_many(base_set, tmp_path, monkeypatch):
    folder = tmp_path / "set"
    folder.mkdir()
    for name in ("recipe.toml", "README.md"):
        shutil.copy(base_set / name, folder)
    from rfgen_sionna.dataset.shards import assemble_shard

    for number in range(3):
        extract_recording(base_set / "shard-00000.h5", number, tmp_path / f"{number}.h5")
        assemble_shard(folder / f"shard-{number:05d}.h5", {number: tmp_path / f"{number}.h5"})
    write_index(folder)
    write_sums(folder)
    monkeypatch.setattr("rfgen_sionna.dataset.open_shards.MAX_OPEN", 1)
    recordings = open_dataset(folder)
    first = recordings[0]
    samples = first.adc
    wanted = samples[0]
    for _ in range(2):
        for run in recordings:
            assert run.adc[0].shape == wanted.shape
    np.testing.assert_array_equal(samples[0], wanted)  # its file stays open as long as it is needed
    (folder / "shard-00001.h5").unlink()
    again = open_dataset(folder)
    np.testing.assert_array_equal(again[0].adc[0], wanted)
    with pytest.raises(ChecksumError, match=r"shard-00001\.h5' is missing; `rfgen dataset repair"):
        again[1]


def test_a_closed_run_is_closed_and_its_shard_is_not(small_set):
    with open_dataset(small_set) as recordings:
        with recordings[0] as run:
            pass
        with pytest.raises(ValueError, match="is closed"):
            _ = run.adc
        assert recordings[0].adc[0].shape


def test_a_recording_alone(small_set, tmp_path):
    with open_dataset(small_set) as recordings:
        recordings.extract(1, tmp_path / "one.h5")
        with open_run(tmp_path / "one.h5") as run:
            assert run.adc[:].tobytes() == recordings[1].adc[:].tobytes()
        with pytest.raises(OutputError, match="exists"):
            recordings.extract(1, tmp_path / "one.h5")


def test_the_index_is_made_again_from_the_shards(small_set):
    before, data = read_index(small_set), (small_set / INDEX).read_bytes()
    facts = {key: value for key, value in before.meta.items() if key not in ("version", "contents")}
    assert write_index(small_set, facts) == before
    assert (small_set / INDEX).read_bytes() == data
    failures = [Failure(5, 17, "placement", "no room"), Failure(4, None, "prompt", "what?")]
    write_index(small_set, facts, failures)
    write_sums(small_set)
    recordings = open_dataset(small_set)
    assert [each.number for each in recordings.failures] == [4, 5]
    with pytest.raises(KeyError, match=r"has no recording 5: it could not be made \(no room\)"):
        recordings.recording(5)
    assert "2 could not be made" in " ".join(repr(recordings).split())


def test_recordings_in_two_shards_are_refused(small_set):
    shutil.copy(small_set / "shard-00000.h5", small_set / "shard-00001.h5")
    with pytest.raises(RunFormatError, match=r"recordings \[0, 1, 2\] are in two shards"):
        write_index(small_set)


def test_what_is_no_set(tmp_path):
    with pytest.raises(FileNotFoundError, match="is no folder of a data set"):
        open_dataset(tmp_path / "none")
    (tmp_path / "file").write_text("")
    with pytest.raises(NotADirectoryError, match="is no folder"):
        open_dataset(tmp_path / "file")
    with pytest.raises(FileNotFoundError, match="has no SHA256SUMS: `rfgen dataset repair"):
        open_dataset(tmp_path)
    with pytest.raises(TypeError, match="folder is 3"):
        open_dataset(3)


def test_a_folder_of_any_name(small_set):
    odd = small_set.rename(small_set.parent / "a set?mode=rwc#%41 é")
    write_sums(odd)
    with open_dataset(odd) as recordings:
        assert recordings[0].adc[0].shape
