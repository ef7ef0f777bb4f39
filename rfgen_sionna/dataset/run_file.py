"""Open run files, for several processes."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any, Protocol

import h5py
import hdf5plugin  # noqa: F401  (registers the filter of compressed runs)

from rfgen_sionna.dataset.schema import FORMAT, RADARS, SHARD_FORMAT, VERSION, RunFormatError

_NEEDED = ("frame_time", "mesh_time", "actors", "labels")
_NEEDED_ATTRIBUTES = ("prompt", "negative_prompt", "environment", "radar", "seeds", "software")


class FilePool(Protocol):
    """Open files that several runs share."""

    checked: set[tuple[Path, str]]
    """Files and groups in them that are known to be runs."""

    def file(self, path: Path) -> h5py.File:
        """The file at `path`, open for reading in this process."""
        ...


class RunFile:
    """Checked run file at `path`, open for reading; or the run in the group `inside` of a file of `pool`.

    A copy in another process opens the file again, whether it was pickled or inherited by a fork: processes must not
    share one handle. A file of a pool stays open when the run is closed.

    Raises
    ------
    FileNotFoundError, IsADirectoryError
        If there is no such file, or it is a folder.
    RunFormatError
        If the file is not HDF5, not a run, of another format version, or lacks datasets or attributes.
    """

    def __init__(self, path: Path, inside: str = "", pool: FilePool | None = None) -> None:
        self.path, self._absolute = path, path.absolute()  # the working folder may change
        self.inside, self._pool, self._closed = inside, pool, False
        self._open()

    def __reduce__(self) -> Any:
        _ = self.root
        return RunFile, (self._absolute, self.inside, self._pool)

    def _open(self) -> None:
        # The file is referred to for as long as its group: it is closed with the last reference.
        self._file = open_hdf5(self._absolute) if self._pool is None else self._pool.file(self._absolute)
        try:
            self._root = self._checked_root()
        except BaseException:
            if self._pool is None:
                self._file.close()
            raise
        self._process = os.getpid()

    def _checked_root(self) -> h5py.Group:
        root = self._file.get(self.inside) if self.inside else self._file
        if not isinstance(root, h5py.Group):
            raise RunFormatError(f"'{self.path}' has no group '{self.inside}'")
        known = (self._absolute, self.inside)
        if self._pool is not None and known in self._pool.checked:
            return root
        check_format(self.path, root, FORMAT)
        for name in _radar_names(self.path, root) or ("",):
            at = f"{RADARS}/{name}" if name else ""
            if at and at not in root:
                raise RunFormatError(f"'{self.path}' lacks '{at}'")
            _check_run(self.path, root[at] if at else root)
        if self._pool is not None:
            self._pool.checked.add(known)
        return root

    def close(self) -> None:
        """Close the file, or leave that of a pool."""
        self._closed = True
        if self._pool is None:
            self._file.close()

    @property
    def is_open(self) -> bool:
        """Whether the file is open."""
        return bool(self._file) and not self._closed

    @property
    def root(self) -> h5py.Group:
        """Group of the run in the file; ValueError if it is closed."""
        if self._closed or (not self._file and self._pool is None):
            raise ValueError(f"run '{self.path}' is closed")
        if self._process != os.getpid() or not self._file:
            if self._pool is None:
                self._file.close()  # HDF5 would share the handle with a file that is open
            self._open()
        return self._root

    @property
    def radar_names(self) -> tuple[str, ...]:
        """Names of the radars in a file of several; empty for one radar."""
        return _radar_names(self.path, self.root)

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


def open_hdf5(path: Path) -> h5py.File:
    """HDF5 file at `path`, open for reading.

    Raises
    ------
    FileNotFoundError, IsADirectoryError
        If there is no such file, or it is a folder.
    RunFormatError
        If the file is not HDF5.
    """
    if path.is_dir():
        raise IsADirectoryError(f"run file '{path}' is a folder: the name of a file in it is needed")
    if not path.is_file():
        raise FileNotFoundError(f"run file '{path}' does not exist")
    try:
        return h5py.File(path, "r")
    except OSError as error:
        raise RunFormatError(f"'{path}' is not an HDF5 file: {error}") from error


def check_format(path: Path, group: h5py.Group, wanted: str) -> None:
    """RunFormatError unless the attributes of `group` name the format `wanted` in a version that is read here."""
    found = group.attrs.get("format")
    if found != wanted:
        if found == SHARD_FORMAT:
            raise RunFormatError(
                f"'{path}' is a shard of a data set: rfgen_sionna.dataset.open_dataset('{path.parent}') has its runs"
            )
        raise RunFormatError(
            f"'{path}' is no run of this package: attribute 'format' is {found!r}, "
            f"'{wanted}' is needed; it holds {', '.join(sorted(group)) or 'nothing'}"
        )
    version = str(group.attrs.get("format_version"))
    major = VERSION.partition(".")[0]
    if version.partition(".")[0] != major:
        raise RunFormatError(f"'{path}' has format version {version}; this package reads {major}.x")


def _radar_names(path: Path, root: h5py.Group) -> tuple[str, ...]:
    return tuple(json_names(path, root, RADARS))


def json_names(path: Path, group: h5py.Group, attribute: str) -> list[str]:
    """Texts in the JSON list of an attribute, none without it; RunFormatError if it is none."""
    try:
        found = json.loads(group.attrs.get(attribute, "[]"))
    except (ValueError, TypeError, RecursionError) as error:
        raise RunFormatError(f"'{path}': attribute '{attribute}' is no JSON list ({error})") from error
    if not isinstance(found, list) or not all(isinstance(name, str) for name in found):
        raise RunFormatError(f"'{path}': attribute '{attribute}' is {found!r}: a list of texts is needed")
    return found


def _check_run(path: Path, group: h5py.Group) -> None:
    missing = [f"attribute '{name}'" for name in _NEEDED_ATTRIBUTES if name not in group.attrs]
    missing += [f"'{name}'" for name in _NEEDED if name not in group]
    has_samples = "contents" not in group.attrs or "adc" in json_names(path, group, "contents")
    missing += ["'adc'"] if has_samples and "adc" not in group else []
    if missing:
        raise RunFormatError(f"'{path}' lacks {', '.join(missing)}")
    for name in ("actors", "labels"):
        if not isinstance(group[name], h5py.Group):
            raise RunFormatError(f"'{path}': '{name}' is no group")
    for name in ("frame_time", "mesh_time"):
        if not isinstance(group[name], h5py.Dataset) or group[name].ndim != 1 or group[name].dtype.kind != "f":
            raise RunFormatError(f"'{path}': '{name}' is no series of times")
    if "adc" not in group:
        return
    samples = group["adc"]
    known = isinstance(samples, h5py.Dataset)
    words = known and samples.dtype == "int16" and "scale_factor" in samples.attrs
    if known and words and (samples.ndim == 5 or (samples.ndim == 6 and samples.shape[5] == 2)):
        return
    if not known or samples.ndim != 5 or samples.dtype.kind not in "cf":
        shape = f"{samples.dtype} {samples.shape}" if known else "a group"
        raise RunFormatError(
            f"'{path}': 'adc' is {shape}; complex or real (frame, chirp, tx, rx, sample), or words, are needed"
        )
