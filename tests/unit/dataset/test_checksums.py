"""Every byte of a set counts: none is changed unnoticed, and each fault says what it hurts."""

import json
import os
import shutil
import subprocess
from contextlib import closing

import numpy as np
import pytest

from rfgen_sionna.dataset import ChecksumError, RunFormatError, checksums, damaged, open_dataset
from rfgen_sionna.dataset.checksums import read_sums, write_sums
from rfgen_sionna.dataset.set_index import INDEX, read_index
from rfgen_sionna.dataset.shards import assemble_shard, extract_recording
from rfgen_sionna.dataset.verified_files import SUMS, VerifiedFiles, examined
from tests.benchmarks.fuzz_sets import SHARD, contents


def flip(path, place, bit=0):
    data = bytearray(path.read_bytes())
    data[place] ^= 1 << bit
    path.write_bytes(data)


def test_a_whole_set_has_no_damage_and_sha256sum_agrees(small_set):
    assert damaged(small_set) == []
    if shutil.which("sha256sum"):
        done = subprocess.run(["sha256sum", "-c", SUMS], cwd=small_set, capture_output=True, text=True, check=True)
        assert done.stdout.count(": OK") == 4
        assert not done.stderr


@pytest.mark.parametrize("name", [SUMS, INDEX, "recipe.toml", "README.md"])
def test_every_flipped_byte_is_found(small_set, name):
    path = small_set / name
    data = path.read_bytes()
    rng = np.random.default_rng(0)
    places = range(len(data)) if name == SUMS else rng.choice(len(data), min(60, len(data)), replace=False)
    for place in map(int, places):
        flip(path, place, int(rng.integers(8)))
        found = damaged(small_set)
        assert [each.file for each in found] == [name], (place, found)
        path.write_bytes(data)
    assert damaged(small_set) == []


def test_flipped_bytes_of_a_shard_are_found_with_the_recordings_that_they_hurt(small_set):
    path, data = small_set / SHARD, (small_set / SHARD).read_bytes()
    with open_dataset(small_set) as recordings:
        block = recordings[1].stored("adc").id.get_chunk_info(0)
    flip(path, block.byte_offset + 100)
    (fault,) = damaged(small_set)
    assert (fault.file, fault.recordings) == (SHARD, (1,))
    assert "its checksum is not that in SHA256SUMS" in fault.reason
    path.write_bytes(data[: len(data) // 2])
    (fault,) = damaged(small_set)
    assert (fault.file, fault.recordings) == (SHARD, (0, 1, 2))
    path.unlink()
    (fault,) = damaged(small_set)
    assert (fault.file, fault.reason, fault.recordings) == (SHARD, "missing", (0, 1, 2))


def test_what_was_hurt_is_put_back_from_what_was_not(small_set, tmp_path):
    """The parts that are whole are taken out of the damaged shard; the shard is then the same bytes."""
    path, data = small_set / SHARD, (small_set / SHARD).read_bytes()
    with open_dataset(small_set) as recordings:
        block = recordings[1].stored("adc").id.get_chunk_info(1)
        recipe = recordings.recipe_text
        recordings.extract(1, tmp_path / "made again.h5")
    flip(path, block.byte_offset + 7)
    (fault,) = damaged(small_set)
    parts = {number: tmp_path / f"{number}.h5" for number in range(3) if number not in fault.recordings}
    for number, part in parts.items():
        extract_recording(path, number, part)
    assemble_shard(path, parts | {1: tmp_path / "made again.h5"}, {"recipe": recipe})
    assert path.read_bytes() == data
    assert damaged(small_set) == []


@pytest.mark.parametrize("name", ["notes.txt", "..", r"..\shard-x.h5", ".verified"])
def test_sums_that_name_files_of_no_set_are_refused(small_set, name):
    (small_set / SUMS).write_text(checksums._text(read_sums(small_set) | {name: "0" * 64}))
    with pytest.raises(ChecksumError, match="is damaged"):
        read_sums(small_set)
    assert [each.file for each in damaged(small_set)] == [SUMS]


@pytest.mark.parametrize(("folder", "word"), [(".building", "resume"), ("other", "repair")])
def test_a_set_without_sums_is_told_the_cure(tmp_path, folder, word):
    (tmp_path / folder).mkdir()
    with pytest.raises(FileNotFoundError, match=f"`rfgen dataset {word} ") as caught:
        read_sums(tmp_path)
    assert str(caught.value).count("rfgen dataset") == 1


def test_files_that_are_not_listed_are_found(small_set):
    shutil.copy(small_set / SHARD, small_set / "shard-00001.h5")
    assert [(each.file, each.reason) for each in damaged(small_set)] == [("shard-00001.h5", "not in SHA256SUMS")]


def test_two_faults_are_both_found(small_set):
    flip(small_set / SUMS, 5)
    flip(small_set / SHARD, 20_000)
    assert [each.file for each in damaged(small_set)] == [SUMS, SHARD]
    flip(small_set / INDEX, 100, 3)
    assert {SUMS, INDEX} <= {each.file for each in damaged(small_set)}


@pytest.mark.parametrize("name", [SUMS, INDEX, SHARD, "recipe.toml"])
def test_a_changed_file_is_refused_with_the_cure(small_set, name):
    flip(small_set / name, 70, 2)
    with pytest.raises((ChecksumError, RunFormatError), match=f"{name}' is"):
        contents(small_set)


def test_a_shard_is_read_whole_once_on_a_machine(base_set, tmp_path, monkeypatch):
    folder = tmp_path / "set"
    shutil.copytree(base_set, folder)
    read = []

    def count(path):
        read.append(path.name)
        return examined(path)

    monkeypatch.setattr("rfgen_sionna.dataset.verified_files.examined", count)
    for _ in range(2):
        with open_dataset(folder) as recordings:
            assert recordings[0].adc[0].shape
    assert read == [SHARD]  # a copy is other files
    (folder / ".verified").unlink()
    with open_dataset(folder) as recordings:
        assert recordings[1].adc[0].shape
    assert read == [SHARD, SHARD]
    for text in ("{", "[1]", json.dumps({SHARD: 3}), "[" * 100_000):
        (folder / ".verified").write_text(text)
        VerifiedFiles(folder, read_sums(folder)).check(SHARD)
    assert len(read) == 6


@pytest.mark.skipif(os.name != "posix" or os.getuid() == 0, reason="root writes everywhere")
def test_a_folder_that_cannot_be_written(small_set):
    (small_set / ".verified").unlink()
    small_set.chmod(0o555)
    with open_dataset(small_set) as recordings:
        assert recordings[0].adc[0].shape
    assert not (small_set / ".verified").exists()
    small_set.chmod(0o755)


def test_sums_that_are_known_are_not_computed_again(small_set):
    before = (small_set / SUMS).read_bytes()
    digests = read_sums(small_set)
    assert write_sums(small_set, {SHARD: digests[SHARD]}) == digests
    assert (small_set / SUMS).read_bytes() == before
    assert write_sums(small_set, {SHARD: "0" * 64})[SHARD] == "0" * 64


def test_an_index_with_code_is_refused(small_set):
    import sqlite3

    codes = [
        "CREATE VIEW v AS SELECT * FROM meta",
        "CREATE TRIGGER t AFTER INSERT ON meta BEGIN DELETE FROM meta; END",
        "CREATE TABLE more (x)",
        "CREATE INDEX i ON recordings (abs(number))",
        "ALTER TABLE recordings ADD COLUMN more AS (abs(number))",
        "DROP TABLE failures",
        "UPDATE recordings SET number = 7 WHERE number = 1",
        "UPDATE recordings SET split = 4.5, frames = 'x'",
        "UPDATE recordings SET shard = '../../shard.h5'",
        "UPDATE meta SET value = '9' WHERE key = 'version'",
    ]
    data = (small_set / INDEX).read_bytes()
    for code in codes:
        with closing(sqlite3.connect(small_set / INDEX)) as base, base:
            base.execute(code)
        with pytest.raises(RunFormatError, match=r"is no index of a data set .*`rfgen dataset repair"):
            read_index(small_set)
        (small_set / INDEX).write_bytes(data)
    assert len(read_index(small_set).rows) == 3
