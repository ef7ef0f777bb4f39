"""A set of a stranger runs no code here and never ends the process."""

import h5py
import hdf5plugin
import numpy as np
import pytest

from rfgen_sionna.dataset import ChecksumError, RunFormatError, open_dataset
from rfgen_sionna.dataset.checksums import write_sums
from rfgen_sionna.dataset.set_index import write_index
from rfgen_sionna.dataset.verified_files import examined
from tests.benchmarks.fuzz_sets import SHARD, fuzz

QUICK = {"set": 60, "index": 60, "recipe": 20, "signed": 3}


@pytest.mark.parametrize("form", QUICK)
def test_mutated_sets_are_refused_or_the_same(base_set, form):
    outcomes = fuzz(base_set, form, QUICK[form], seed=7)
    assert set(outcomes) <= {"refused", "same"}, outcomes
    assert sum(outcomes.values()) == QUICK[form]


@pytest.mark.slow
@pytest.mark.parametrize("form", ["set", "index", "recipe", "signed", "shard"])
def test_thousands_of_mutations(base_set, form):
    outcomes = fuzz(base_set, form, 60 if form == "signed" else 1000, seed=8)
    # libhdf5 itself does not stand everything: that is what the process is for.
    allowed = {"refused", "same"} | ({"ended -11", "ended -6", "ended -8"} if form == "shard" else set())
    assert set(outcomes) <= allowed, outcomes


def external_values(group, folder):
    (folder / "secret").write_bytes(bytes(64))
    group.create_dataset("x", (8,), "f8", external=[(str(folder / "secret"), 0, 64)])


def values_of_another_file(group, folder):
    layout = h5py.VirtualLayout((8,), "f8")
    layout[:] = h5py.VirtualSource(str(folder / "other.h5"), "x", shape=(8,))
    group.create_virtual_dataset("x", layout)


def link_elsewhere(group, folder):
    group["x"] = h5py.ExternalLink("/etc/hostname", "/")


def soft_link(group, folder):
    group["x"] = h5py.SoftLink("/recordings/000000/adc")


def other_filter(group, folder):
    group.create_dataset("x", data=np.zeros(4096), **hdf5plugin.Blosc2())


def wrong_parameters(group, folder):
    """Parameters of the filter that end a process which reads."""
    plan = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    plan.set_chunk((4096,))
    plan.set_filter(32008, h5py.h5z.FLAG_OPTIONAL, (0, 4, 2, 0, 4, 2, 0, 2))
    space = h5py.h5s.create_simple((4096,))
    made = h5py.h5d.create(group.id, b"x", h5py.h5t.NATIVE_INT16, space, dcpl=plan)
    made.write_direct_chunk((0,), np.arange(5000, dtype=np.uint8).tobytes())


def endless(group, folder):
    group.create_dataset("x", (1 << 40,), "f8", chunks=(1 << 20,))


@pytest.mark.parametrize(
    ("trick", "said"),
    [
        (external_values, "values in another file"), (values_of_another_file, "values in another file"),
        (link_elsewhere, "link to another place"), (soft_link, "link to another place"),
        (other_filter, "has the filters"), (wrong_parameters, "has the filters"), (endless, "has 8796093022208 bytes"),
    ],
)  # fmt: skip
def test_what_no_shard_has_is_refused_with_any_checksum(small_set, tmp_path, trick, said):
    with h5py.File(small_set / SHARD, "r+") as shard:
        trick(shard["recordings/000001"], tmp_path)
    with pytest.raises(RunFormatError, match="recording 1 cannot be read"):
        write_index(small_set)
    fault, digests = examined(small_set / SHARD)
    assert fault.startswith("recording 1: ValueError: ")
    assert said in fault
    assert set(digests) == {0, 2}
    write_sums(small_set)
    (small_set / ".verified").unlink()
    with open_dataset(small_set) as recordings, pytest.raises(ChecksumError, match="cannot be read, with the checksum"):
        recordings[0]


def test_a_file_that_ends_its_reader_is_a_fault(small_set, monkeypatch, tmp_path):
    program = tmp_path / "reader.py"
    program.write_text("import os, signal\nprint('1 abc', flush=True)\nos.kill(os.getpid(), signal.SIGSEGV)\n")
    monkeypatch.setattr("rfgen_sionna.dataset.recording_digest.__file__", str(program))
    assert examined(small_set / SHARD) == ("signal 11", {1: "abc"})
    program.write_text("import time\ntime.sleep(60)\n")
    assert examined(small_set / SHARD, seconds=0.5)[0] == "not read in 0 s"
