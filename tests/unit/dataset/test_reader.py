"""Files that are no runs are refused with what they lack."""

import h5py
import pytest

from rfgen_sionna.dataset import RunFormatError, open_run


def test_missing_foreign_and_other_files(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"'.*none.h5' does not exist"):
        open_run(tmp_path / "none.h5")
    with pytest.raises(IsADirectoryError, match="is a folder: the name of a file"):
        open_run(tmp_path)
    (tmp_path / "text.h5").write_text("hello")
    with pytest.raises(RunFormatError, match="is not an HDF5 file"):
        open_run(tmp_path / "text.h5")
    with h5py.File(tmp_path / "other.h5", "w") as file:
        file["measurement"] = [1.0]
    with pytest.raises(RunFormatError, match=r"'format' is None, 'rfgen-run' is needed; it holds measurement"):
        open_run(tmp_path / "other.h5")


@pytest.mark.parametrize("path", [None, 3, b"run.h5", ["run.h5"]])
def test_what_is_no_path(path):
    with pytest.raises(TypeError, match=r"path is .*: the path of a run file is needed"):
        open_run(path)


@pytest.mark.parametrize("lacking", ["adc", "labels"])
def test_a_run_that_lacks_something_says_what(tmp_path, write, lacking):
    path = write(tmp_path / "run.h5")
    with h5py.File(path, "a") as file:
        del file[lacking]
    with pytest.raises(RunFormatError, match=f"lacks '{lacking}'"):
        open_run(path)


def test_lacking_attributes_and_newer_formats(tmp_path, write):
    path = write(tmp_path / "run.h5")
    with h5py.File(path, "a") as file:
        file.attrs["format_version"] = "2.0"
    with pytest.raises(RunFormatError, match=r"format version 2.0; this package reads 1\.x"):
        open_run(path)
    with h5py.File(path, "a") as file:
        file.attrs["format_version"] = "1.0"
        del file.attrs["radar"]
    with pytest.raises(RunFormatError, match="lacks attribute 'radar'"):
        open_run(path)


def test_frames_are_read_when_asked_for(tmp_path, write):
    with open_run(write(tmp_path / "run.h5")) as run:
        assert isinstance(run.adc, h5py.Dataset)
        assert run.adc[0, 0].shape == (3, 4, 16)
    with pytest.raises(ValueError, match=r"run '.*run.h5' is closed"):
        run.adc[0]
