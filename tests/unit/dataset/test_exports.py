"""What an export writes is what a loader reads, in the files that others read."""

import csv
import json
import tarfile

import numpy as np
import pytest

from rfgen_sionna.dataset import OutputError, open_dataset
from rfgen_sionna.dataset.exports import EXPORTS, export_dataset, to_npy, to_webdataset
from tests.unit.dataset.small_sets import ACTIONS, JOINTS, make_set


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return make_set(tmp_path_factory.mktemp("exports") / "set", count=6, keep=("adc", "joints", "labels", "body"))


def test_npy_files_and_their_table(folder, tmp_path):
    to_npy(folder, tmp_path / "out", "range_doppler", ["action", "joints", "azimuth_deg"], window_s=0.2)
    with (tmp_path / "out" / "labels.csv").open() as file:
        table = list(csv.DictReader(file))
    assert len(table) == 12
    row = table[3]
    assert (row["recording"], row["first_frame"], row["frames"], row["azimuth_deg"]) == ("1", "2", "2", "")
    assert ACTIONS[int(row["action"])] == row["action_name"]
    map_ = np.load(tmp_path / "out" / row["split"] / "range_doppler" / row["file"], allow_pickle=False)
    joints = np.load(tmp_path / "out" / row["split"] / "joints" / row["file"], allow_pickle=False)
    with open_dataset(folder)[1] as run:
        np.testing.assert_array_equal(map_, run.representation("range_doppler", slice(2, 4)).values)
        np.testing.assert_array_equal(joints[:, 0], run.stored("actors/person/joints")[2:4])
    about = json.loads((tmp_path / "out" / "dataset.json").read_text())
    assert about["classes"] == list(ACTIONS)
    assert about["arrays"]["range_doppler"]["dims"] == ["frame", "range", "velocity"]
    assert len(about["arrays"]["range_doppler"]["axes"]["range"]) == map_.shape[1]
    assert about["joints"] == list(JOINTS)


@pytest.mark.filterwarnings("ignore:unclosed file", "ignore::pytest.PytestUnraisableExceptionWarning")  # webdataset's
def test_webdataset_reads_its_shards(folder, tmp_path):
    webdataset = pytest.importorskip("webdataset")
    to_webdataset(folder, tmp_path / "out", "range_doppler", ["action", "joints"], shard_bytes=2e4)
    shards = sorted(str(path) for path in (tmp_path / "out").glob("*.tar"))
    assert len(shards) > 2
    assert {path.rsplit("/", 1)[1].split("-")[0] for path in shards} == {"train", "test"}
    items = list(webdataset.WebDataset(shards, shardshuffle=False).decode())
    assert len(items) == 6
    item = next(each for each in items if each["json"]["recording"] == 4)
    assert item["__key__"] == "000004-0000"
    assert ACTIONS[item["action.cls"]] == item["json"]["action_name"]
    with open_dataset(folder)[4] as run:
        np.testing.assert_array_equal(item["range_doppler.npy"], run.representation("range_doppler").values)
        np.testing.assert_array_equal(item["joints.npy"][:, 0], run.stored("actors/person/joints")[:])


def test_exports_are_the_same_bytes_again(folder, tmp_path):
    pytest.importorskip("webdataset")
    for name in ("one", "two"):
        to_webdataset(folder, tmp_path / name)
    for path in (tmp_path / "one").iterdir():
        assert path.read_bytes() == (tmp_path / "two" / path.name).read_bytes()
    with tarfile.open(tmp_path / "one" / "train-000000.tar") as file:
        assert {member.mtime for member in file.getmembers()} == {0}


@pytest.mark.parametrize("format", sorted(EXPORTS))
def test_a_folder_that_is_there_is_kept(folder, tmp_path, format):
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "mine").write_text("x")
    options = {"voxels": False} if format == "radhar" else {}
    with pytest.raises(OutputError, match="exists"):
        export_dataset(folder, tmp_path / "out", format, **options)
    assert (tmp_path / "out" / "mine").read_text() == "x"
    with pytest.raises(OutputError, match="does not exist"):
        export_dataset(folder, tmp_path / "none" / "out", format, **options)
    export_dataset(folder, tmp_path / "out", format, overwrite=True, **options)
    assert not (tmp_path / "out" / "mine").exists()


def test_an_export_that_fails_leaves_nothing(folder, tmp_path):
    def fails(run, frames):
        raise RuntimeError("no")

    with pytest.raises(RuntimeError):
        to_npy(folder, tmp_path / "out", fails)
    assert list(tmp_path.iterdir()) == []


def test_arrays_that_would_be_pickled_are_refused(folder, tmp_path):
    with pytest.raises(TypeError, match="object"):
        to_npy(folder, tmp_path / "out", lambda run, frames: np.array([{}, None], object))


def test_an_unknown_format_is_named(folder, tmp_path):
    with pytest.raises(ValueError, match=r"'zarr'.*'webdataset'"):
        export_dataset(folder, tmp_path / "out", "zarr")


def test_progress_counts_to_the_end(folder, tmp_path):
    seen = []
    to_npy(folder, tmp_path / "out", progress=lambda done, total: seen.append((done, total)))
    assert seen[-1] == (6, 6)
