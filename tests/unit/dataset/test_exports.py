"""What an export writes is what a loader reads, in the files that others read."""

import csv
import json
import re
import tarfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rfgen_sionna.dataset import OutputError, open_dataset
from rfgen_sionna.dataset.export_folder import file_name
from rfgen_sionna.dataset.exports import EXPORTS, export_dataset, to_npy, to_webdataset
from rfgen_sionna.dataset.schema import RunFormatError
from rfgen_sionna.dataset.set_index import write_index
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


def hostile_set(folder, monkeypatch, action="push", split="train"):
    """A set with right checksums, whose split is checked nowhere when it is written."""
    monkeypatch.setattr("rfgen_sionna.dataset.set_index.NAME_FORM", re.compile(".*", re.DOTALL))
    return make_set(folder, count=2, per_shard=2, actions=(action,), splits=(split,))


HOSTILE = ["../../escaped", "/tmp/escaped", "..", ".", "a/b", "a\\b", "train\n", "x" * 41, "-x", "~", "ü"]


@pytest.mark.parametrize("split", HOSTILE)
def test_a_split_that_no_recipe_can_have_is_refused(tmp_path, monkeypatch, split):
    with monkeypatch.context() as patched:
        folder = hostile_set(tmp_path / "set", patched, split=split)
    with pytest.raises(RunFormatError, match="its split is"):
        open_dataset(folder)
    with pytest.raises(RunFormatError, match="its split is"):
        write_index(folder)


@pytest.mark.parametrize("format", sorted(EXPORTS))
@pytest.mark.parametrize("name", ["../../../escaped", "/tmp/rfgen_escaped/x"])
def test_no_export_leaves_its_folder(tmp_path, monkeypatch, format, name):
    """Neither by an action, nor by a split if nothing else were to stop it."""
    inside = tmp_path / "1" / "2" / "3"
    inside.mkdir(parents=True)
    folder = hostile_set(inside / "set", monkeypatch, action=name, split=name)
    before = set(tmp_path.rglob("*"))
    options = {"voxels": False} if format == "radhar" else {}
    export_dataset(folder, inside / "out", format, **options)
    made = set(tmp_path.rglob("*")) - before
    assert made
    assert all((inside / "out") in (path, *path.parents) or path.parent == folder for path in made)
    assert not Path("/tmp/rfgen_escaped").exists()


@settings(deadline=None)
@given(st.text(max_size=300), st.text(max_size=300))
def test_each_text_is_a_file_name_of_its_own(one, other):
    names = file_name(one), file_name(other)
    assert (names[0] == names[1]) == (one == other)
    for name in names:
        assert re.fullmatch(r"[A-Za-z0-9_%-][A-Za-z0-9_.%-]{0,119}", name)


def test_usual_names_stay():
    for name in ("jumping_jacks", "train", "range_doppler", "clip-03.final"):
        assert file_name(name) == name
    assert file_name("dog: run") == "dog%3A%20run"


def test_progress_counts_to_the_end(folder, tmp_path):
    seen = []
    to_npy(folder, tmp_path / "out", progress=lambda done, total: seen.append((done, total)))
    assert seen[-1] == (6, 6)
