"""A full disk is an error that says so: nothing half-written is left, and HDF5 goes on."""

import errno
import os

import h5py
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rfgen_sionna.dataset import OutputError, RunWriter, open_run
from rfgen_sionna.dataset.guarded_file import GuardedFile
from rfgen_sionna.dataset.shards import assemble_shard, extract_recording


@pytest.fixture
def room(monkeypatch):
    """Sets the number of bytes that a disk takes."""
    real, left = os.pwrite, [1 << 60]

    def pwrite(handle, data, place):
        if left[0] <= 0:
            raise OSError(errno.ENOSPC, "No space left on device")
        done = real(handle, data[: left[0]], place)
        left[0] -= done
        return done

    monkeypatch.setattr("rfgen_sionna.dataset.guarded_file.os.pwrite", pwrite)
    return lambda count: left.__setitem__(0, count)


def test_a_full_disk_at_any_byte(tmp_path, room, write, info, frame):
    write(tmp_path / "part.h5", compressed=True, dated=False)
    size = (tmp_path / "part.h5").stat().st_size
    for count in (0, 100, size // 8, size // 3):
        room(count)
        with pytest.raises(OSError, match="No space left on device"):
            write(tmp_path / "run.h5", compressed=True, dated=False)
        room(count)
        with pytest.raises(OSError, match="No space left on device"):
            assemble_shard(tmp_path / "shard.h5", {0: tmp_path / "part.h5"})
        assert os.listdir(tmp_path) == ["part.h5"]
    room(1 << 60)
    assemble_shard(tmp_path / "shard.h5", {0: tmp_path / "part.h5"})
    room(1000)
    with pytest.raises(OSError, match="No space left on device"):
        extract_recording(tmp_path / "shard.h5", 0, tmp_path / "out.h5")
    room(1 << 60)
    extract_recording(tmp_path / "shard.h5", 0, tmp_path / "out.h5")
    with open_run(tmp_path / "out.h5") as run:
        np.testing.assert_array_equal(run.adc[2], frame(2)["adc"])


def test_a_key_pressed_while_hdf5_writes(tmp_path, monkeypatch, info, frame):
    real = os.pwrite
    pressed = []

    def pwrite(handle, data, place):
        if len(pressed) == 0 and place > 20_000:
            pressed.append(True)
            raise KeyboardInterrupt
        return real(handle, data, place)

    monkeypatch.setattr("rfgen_sionna.dataset.guarded_file.os.pwrite", pwrite)

    def interrupted():
        with RunWriter(tmp_path / "run.h5", info, compressed=True) as writer:
            for index in range(3):
                writer.append(**frame(index))

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert not os.listdir(tmp_path)


@given(st.lists(st.tuples(st.integers(0, 200), st.binary(max_size=60)), max_size=12), st.integers(0, 200))
@settings(deadline=None, max_examples=50)
def test_what_is_not_on_the_disk_is_in_memory(tmp_path_factory, writes, limit):
    wanted = bytearray(400)
    file = GuardedFile(tmp_path_factory.mktemp("guarded") / "file")
    with pytest.MonkeyPatch.context() as patch:
        real = os.pwrite

        def pwrite(handle, data, place):
            if place >= limit:
                raise OSError(errno.ENOSPC, "full")
            return real(handle, data[: limit - place], place)

        patch.setattr("rfgen_sionna.dataset.guarded_file.os.pwrite", pwrite)
        for place, data in writes:
            file.seek(place)
            assert file.write(data) == len(data)
            assert file.tell() == place + len(data)
            wanted[place : place + len(data)] = data
    file.seek(0)
    found = bytearray(400)
    assert file.readinto(found) == 400
    assert found == wanted
    if any(data and place + len(data) > limit for place, data in writes):
        with pytest.raises(OSError, match=r"full: '.*file'"):
            file.check()
    else:
        file.check()
    file.close()


def test_a_file_that_hdf5_does_not_open_is_closed_and_gone(tmp_path, monkeypatch, write):
    def fails(*args, **options):
        raise OSError("no")

    made = []

    class Noted(GuardedFile):
        def __init__(self, path):
            super().__init__(path)
            made.append(self)

    monkeypatch.setattr("rfgen_sionna.dataset.store.GuardedFile", Noted)
    monkeypatch.setattr("rfgen_sionna.dataset.store.h5py.File", fails)
    with pytest.raises(OutputError, match="cannot be opened"):
        write(tmp_path / "run.h5", compressed=True, dated=False)
    assert [each.closed for each in made] == [True]
    assert os.listdir(tmp_path) == []


def test_a_guarded_file_is_an_hdf5_file(tmp_path):
    guarded = GuardedFile(tmp_path / "file.h5")
    with h5py.File(guarded, "w", libver=("v110", "v110")) as file:
        file["x"] = np.arange(10_000.0)
        del file["x"]
        file["y/z"] = np.arange(5)
        np.testing.assert_array_equal(file["y/z"], np.arange(5))
    guarded.close()
    guarded.check()
    with h5py.File(tmp_path / "file.h5") as file:
        np.testing.assert_array_equal(file["y/z"], np.arange(5))
