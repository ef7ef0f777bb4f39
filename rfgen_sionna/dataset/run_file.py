"""Open run files, for several processes."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import h5py

from rfgen_sionna.dataset.schema import FORMAT, RADARS, VERSION, RunFormatError

_NEEDED = ("adc", "frame_time", "mesh_time", "actors", "labels")
_NEEDED_ATTRIBUTES = ("prompt", "negative_prompt", "environment", "radar", "seeds", "software")


class RunFile:
    """Checked run file at `path`, open for reading.

    A copy in another process opens the file again, whether it was pickled or inherited by a fork: processes must not
    share one handle.

    Raises
    ------
    FileNotFoundError, IsADirectoryError
        If there is no such file, or it is a folder.
    RunFormatError
        If the file is not HDF5, not a run, of another format version, or lacks datasets or attributes.
    """

    def __init__(self, path: Path) -> None:
        self.path, self._absolute = path, path.absolute()  # the working folder may change
        self._file, self._process = _checked(path), os.getpid()

    def __reduce__(self) -> Any:
        _ = self.root
        return RunFile, (self._absolute,)

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    @property
    def is_open(self) -> bool:
        """Whether the file is open."""
        return bool(self._file)

    @property
    def root(self) -> h5py.File:
        """The file; ValueError if it is closed."""
        if not self._file:
            raise ValueError(f"run '{self.path}' is closed")
        if self._process != os.getpid():
            self._file.close()  # HDF5 would share the handle with a file that is open
            self._file, self._process = _checked(self._absolute), os.getpid()
        return self._file

    @property
    def radar_names(self) -> tuple[str, ...]:
        """Names of the radars in a file of several; empty for one radar."""
        return tuple(json.loads(self.root.attrs.get(RADARS, "[]")))

    def group(self, radar: str) -> h5py.Group:
        """Group with the run of a radar; the empty name is that of the only one, else a ValueError."""
        if radar:
            return self.root[f"{RADARS}/{radar}"]
        if names := self.radar_names:
            raise ValueError(
                f"'{self.path}' has several radars, {', '.join(map(repr, names))}: take the run of one, "
                f"run[{names[0]!r}]"
            )
        return self.root


def _checked(path: Path) -> h5py.File:
    if path.is_dir():
        raise IsADirectoryError(f"run file '{path}' is a folder: the name of a file in it is needed")
    if not path.is_file():
        raise FileNotFoundError(f"run file '{path}' does not exist")
    try:
        file = h5py.File(path, "r")
    except OSError as error:
        raise RunFormatError(f"'{path}' is not an HDF5 file: {error}") from error
    try:
        _check_format(path, file)
        for name in json.loads(file.attrs.get(RADARS, '[""]')):
            _check_run(path, file[f"{RADARS}/{name}"] if name else file)
    except BaseException:
        file.close()
        raise
    return file


def _check_format(path: Path, file: h5py.File) -> None:
    if file.attrs.get("format") != FORMAT:
        raise RunFormatError(
            f"'{path}' is no run of this package: attribute 'format' is {file.attrs.get('format')!r}, "
            f"'{FORMAT}' is needed; it holds {', '.join(sorted(file)) or 'nothing'}"
        )
    version = str(file.attrs.get("format_version"))
    major = VERSION.partition(".")[0]
    if version.partition(".")[0] != major:
        raise RunFormatError(f"'{path}' has format version {version}; this package reads {major}.x")


def _check_run(path: Path, group: h5py.Group) -> None:
    missing = [f"attribute '{name}'" for name in _NEEDED_ATTRIBUTES if name not in group.attrs]
    missing += [f"'{name}'" for name in _NEEDED if name not in group]
    if missing:
        raise RunFormatError(f"'{path}' lacks {', '.join(missing)}")
    samples = group["adc"]
    if samples.ndim != 5 or samples.dtype.kind not in "cf":
        raise RunFormatError(
            f"'{path}': 'adc' is {samples.dtype} {samples.shape}; complex or real (frame, chirp, tx, rx, sample) needed"
        )
