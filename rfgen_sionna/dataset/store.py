"""Writer of run files: frame by frame into a hidden partial file, renamed when the run is complete."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Collection, Mapping
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Any

import h5py
from numpy.typing import ArrayLike

from rfgen_sionna.dataset.frame_writer import FrameWriter
from rfgen_sionna.dataset.guarded_file import GuardedFile
from rfgen_sionna.dataset.hdf5_layout import create_radars, run_difference
from rfgen_sionna.dataset.run_storage import Storage
from rfgen_sionna.dataset.schema import RADARS, RunInfo, StoredArray
from rfgen_sionna.dataset.whole_files import synced
from rfgen_sionna.records import Pir


class OutputError(ValueError):
    """An output file cannot be written."""


_OTHER_FORMATS = (".npy", ".npz", ".mat", ".bin", ".raw", ".csv", ".json", ".png", ".gif", ".zarr")
"""Endings of files that a reader would take for something else."""


def check_output(path: str | os.PathLike[str], overwrite: bool = False) -> Path:
    """Check before long work that a file can be written at `path`, and return the path.

    Raises
    ------
    OutputError
        If the file exists (without `overwrite`), is a folder, or its folder is missing or not writable.
    TypeError
        If `path` is not a path.
    """
    if not isinstance(path, (str, os.PathLike)):
        raise TypeError(f"output is {path!r}: the path of a file is needed")
    target = Path(path)
    folder = target.parent
    if target.is_dir() or not target.name:
        raise OutputError(f"output '{target}' is a folder: the name of a file is needed")
    if not folder.is_dir():
        raise OutputError(f"output '{target}': the folder '{folder}' does not exist; create it first")
    try:
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        raise OutputError(f"output '{target}': the folder '{folder}' is not writable ({error.strerror})") from error
    if target.exists() and not overwrite:
        raise OutputError(f"output '{target}' exists; choose another name, or pass overwrite=True (--overwrite)")
    return target


def check_run_output(path: str | os.PathLike[str], overwrite: bool = False) -> Path:
    """:func:`check_output` of a run, whose name must not have the ending of another format (else OutputError)."""
    target = check_output(path, overwrite)
    if target.suffix.lower() in _OTHER_FORMATS:
        raise OutputError(
            f"output '{target}' has the ending of another format; runs are HDF5 files: name it '{target.stem}.h5', and "
            "export it (rfgen export, write_capture)"
        )
    return target


class RunWriter:
    """Writer of one run, for a `with` statement: the file gets its name when the block ends without an exception.

    A block that raises, or appends no frame, leaves no file.

    Parameters
    ----------
    path
        Output file (:func:`check_output`).
    info
        Properties of the run; of several radars, a dictionary with those of each radar by its name.
    overwrite
        Whether the complete file replaces an existing one.
    resume
        Whether a block that raises keeps its whole frames in `.NAME.partial` beside the output, and a later writer with
        the same `info` goes on after them.
    keep
        Parts that are stored, of "adc", "vertices" (with faces), "joints" and "labels"; None stores all. Names beside
        them are noted in the file, for arrays that `info` declares.
    words
        Whether samples that the receiver quantised to 16 bits or fewer are stored as int16 words: half the size, and
        the same samples when read.
    compressed
        Whether arrays are compressed without loss; other programs read them with hdf5plugin.
    dated
        Whether the file has the time of its creation; without it, equal runs are equal files.

    Raises
    ------
    OutputError
        If the file cannot be written, at the start or at the end, or kept frames are those of another run.
    """

    def __init__(
        self,
        path: str | os.PathLike[str],
        info: RunInfo | Mapping[str, RunInfo],
        *,
        overwrite: bool = False,
        resume: bool = False,
        keep: Collection[str] | None = None,
        words: bool = False,
        compressed: bool = False,
        dated: bool = True,
    ) -> None:
        self.path = check_run_output(path, overwrite)
        self.info = info
        self.storage = Storage(None if keep is None else frozenset(keep), words, compressed, dated)
        self._overwrite, self._resume = overwrite, resume
        self._partial = self.path.parent / f".{self.path.name}.partial{'' if resume else f'-{os.getpid()}'}"
        self._file: h5py.File | None = None
        self._guarded: GuardedFile | None = None
        self._writers: dict[str, FrameWriter] = {}

    def __enter__(self) -> RunWriter:
        continued = self._resume and self._partial.exists()
        try:
            # Frames of a run that is continued are on the disk after each: HDF5 writes that file itself.
            self._guarded = GuardedFile(self._partial) if self.storage.compressed and not self._resume else None
            self._file = h5py.File(
                self._guarded or self._partial, "r+" if continued else "w", libver=self.storage.libver
            )
        except OSError as error:
            if self._guarded is not None:
                self._guarded.close()
                self._partial.unlink(missing_ok=True)
            raise OutputError(
                f"output '{self.path}': its frames in '{self._partial}' cannot be opened ({error}); another process "
                "writes them, or the file is damaged: delete it"
            ) from error
        try:
            if continued:
                self._check_same(self._file)
            elif isinstance(self.info, Mapping):
                create_radars(self._file, self.info, self.storage)
            named = self.info.items() if isinstance(self.info, Mapping) else [("", self.info)]
            for name, info in named:
                group = self._file.require_group(f"{RADARS}/{name}") if name else self._file
                self._writers[name] = FrameWriter(group, info, self.storage)
        except BaseException:
            self._close()
            if not continued:
                self._partial.unlink(missing_ok=True)
            raise
        return self

    def _check_same(self, file: h5py.File) -> None:
        """OutputError unless the frames in the partial file are those of the same run."""
        difference = run_difference(file, self.info)
        if difference:
            raise OutputError(
                f"output '{self.path}': the frames in '{self._partial}' are those of another run, whose "
                f"{difference}: delete that file, or take the same arguments"
            )

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if kind is not None:
            self._abort()
            return
        if not all(writer.frames for writer in self._writers.values()):
            self._abort()
            raise OutputError(f"output '{self.path}': no frame was written")
        try:
            _ = self._opened
            self._close()
            if self._guarded is not None:
                self._guarded.check()
            synced(self._partial)
        except BaseException:
            self._abort()
            raise
        self._publish()

    def radar(self, name: str = "") -> FrameWriter:
        """Writer of the frames of the radar `name`; empty for the only one."""
        _ = self._opened
        return self._writers[name]

    @property
    def frames(self) -> int:
        """Number of frames in the file."""
        return sum(writer.frames for writer in self._writers.values())

    def add_array(self, path: str, values: ArrayLike, declared: StoredArray, *, radar: str = "") -> None:
        """Store an array that has no value for each frame, at any time before the end of the block.

        Parameters
        ----------
        path
            Path in the file, such as "actors/person/body/shape".
        values
            Numbers with the axes `declared.dims`.
        declared
            Axes, unit and meaning.
        radar
            Name of the radar, in a file of several.

        Raises
        ------
        ValueError
            If the array has other axes than declared, or the path is taken.
        """
        self.radar(radar).add_array(path, values, declared)

    def append(
        self,
        adc: ArrayLike | None,
        *,
        time: float,
        pir: Pir | None = None,
        vertices: Mapping[str, ArrayLike] | None = None,
        joints: Mapping[str, ArrayLike] | None = None,
        labels: Mapping[str, Any] | None = None,
        mesh_time: float | None = None,
        full_scale: float | None = None,
        clipped: float = 0.0,
        arrays: Mapping[str, ArrayLike] | None = None,
        radar: str = "",
    ) -> None:
        """Append a frame.

        Parameters
        ----------
        adc
            (chirp, tx, rx, sample) samples, real for a radar with a real ADC, else complex; None where none are stored.
        time
            Start of the frame's first ramp [s].
        pir
            Image of the frame; all frames have one, or none.
        vertices, joints
            (vertex, 3) and (joint, 3) world positions [m] by actor; joints of actors with a skeleton.
        labels
            A value for each declared label.
        mesh_time
            Time of `vertices`, `joints` and `labels` [s]; None takes `time`.
        full_scale
            Largest I or Q of the ADC [sqrt(W)], the same for all frames; None for samples without quantisation.
        clipped
            Share of the frame's I and Q values beyond full scale.
        arrays
            A value for each array that `info` declares.
        radar
            Name of the radar, in a file of several.

        Raises
        ------
        ValueError
            If a value has a wrong shape, name or range; the frame is then not in the file.
        """
        self.radar(radar).append(
            adc, time=time, pir=pir, vertices=vertices, joints=joints, labels=labels, mesh_time=mesh_time,
            full_scale=full_scale, clipped=clipped, arrays=arrays,
        )  # fmt: skip
        if self._resume:
            self._opened.flush()
        if self._guarded is not None:
            self._guarded.check()

    @property
    def _opened(self) -> h5py.File:
        if self._file is None:
            raise RuntimeError("the writer is closed; append frames inside its 'with' block")
        return self._file

    def _publish(self) -> None:
        """Give the partial file its name; it keeps its own, with the finished run, if the name is taken meanwhile."""
        if self._overwrite:
            os.replace(self._partial, self.path)
        else:
            try:
                os.link(self._partial, self.path)
            except OSError:
                if os.path.lexists(self.path):
                    raise OutputError(
                        f"output '{self.path}' appeared while the run was written; the run is in '{self._partial}'"
                    ) from None
                os.rename(self._partial, self.path)  # a file system without hard links
            else:
                os.unlink(self._partial)
        with suppress(OSError):
            synced(self.path.parent)

    def _close(self) -> None:
        try:
            if self._file is not None:
                self._file.close()
        finally:
            self._file = None
            if self._guarded is not None:
                self._guarded.close()

    def _abort(self) -> None:
        try:
            self._close()
        finally:
            if not (self._resume and self.frames):
                self._partial.unlink(missing_ok=True)
