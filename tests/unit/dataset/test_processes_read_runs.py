"""Runs go to other processes, however these are started."""

import multiprocessing
import operator
import os
import pickle

import numpy as np
import pytest

from rfgen_sionna.dataset import RunInfo, RunWriter, open_run


@pytest.fixture
def path(tmp_path, write):
    return write(tmp_path / "run.h5")


def test_a_pickled_run_opens_its_file_again(path, frame, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    with open_run("run.h5") as run:
        assert len(run.radar.tx_names) == 3  # which is then known
        monkeypatch.chdir("/")
        stored = pickle.dumps((run, run.actors["person"]))
    copy, person = pickle.loads(stored)
    with copy:
        np.testing.assert_array_equal(copy.adc[2], frame(2)["adc"])
        assert copy.radar == run.radar
        np.testing.assert_allclose(person.vertices(1), frame(1)["vertices"]["person"], rtol=1e-6)
    with pytest.raises(ValueError, match=r"run '.*run\.h5' is closed"):
        pickle.dumps(run)


def test_a_radar_of_several_is_pickled_with_its_name(tmp_path, radar):
    infos = {name: RunInfo(radar) for name in ("left", "right")}
    with RunWriter(tmp_path / "run.h5", infos) as writer:
        for value, name in enumerate(infos):
            writer.append(np.full(radar.frame_shape, value, np.complex64), time=0.0, radar=name)
    with open_run(tmp_path / "run.h5") as run, pickle.loads(pickle.dumps(run["right"])) as copy:
        assert copy.name == "right"
        assert np.all(copy.adc[0] == 1)


def test_a_spawned_process_reads_a_run(path, frame):
    with open_run(path) as run, multiprocessing.get_context("spawn").Pool(1) as pool:
        cubes = pool.map(operator.methodcaller("cube"), [run, run])
    np.testing.assert_array_equal(cubes[1].data[2], frame(2)["adc"])
    assert cubes[0].radar == cubes[1].radar


@pytest.mark.skipif(not hasattr(os, "fork"), reason="processes are forked on POSIX systems")
@pytest.mark.filterwarnings("ignore:This process .* is multi-threaded:DeprecationWarning")
def test_a_forked_process_has_a_position_in_the_file_of_its_own(path, frame):
    with open_run(path) as run:
        here = run.adc.file.id.get_vfd_handle()
        receive, send = multiprocessing.Pipe(False)

        def read():
            samples = run.adc[1]
            os.lseek(run.adc.file.id.get_vfd_handle(), 12_345, os.SEEK_SET)
            send.send(samples)

        child = multiprocessing.get_context("fork").Process(target=read)
        child.start()
        samples = receive.recv()
        child.join()
        assert os.lseek(here, 0, os.SEEK_CUR) != 12_345
        np.testing.assert_array_equal(samples, frame(1)["adc"])
        np.testing.assert_array_equal(run.adc[0], frame(0)["adc"])


@pytest.mark.parametrize("start", ["fork", pytest.param("spawn", marks=pytest.mark.slow)])
@pytest.mark.filterwarnings("ignore:This process .* is multi-threaded:DeprecationWarning")
def test_workers_of_a_data_loader(path, frame, start):
    data = pytest.importorskip("torch.utils.data")
    if start not in multiprocessing.get_all_start_methods():
        pytest.skip(f"no processes by {start} here")
    with open_run(path) as run:
        loader = data.DataLoader(
            [run, run], batch_size=None, num_workers=2, multiprocessing_context=start,
            collate_fn=operator.methodcaller("cube", slice(2, 3)), timeout=60,
        )  # fmt: skip
        for cube in loader:
            np.testing.assert_array_equal(cube.data[0], frame(2)["adc"])
