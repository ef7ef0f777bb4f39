"""Writer of run files: frame by frame into a hidden partial file, renamed when the run is complete."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Any

import h5py
import numpy as np
from numpy.typing import ArrayLike

from rfgen_sionna.dataset.hdf5_layout import create_label, create_pir, create_run
from rfgen_sionna.dataset.schema import PIR_CHANNELS, ActorInfo, RunInfo
from rfgen_sionna.records import Pir


class OutputError(ValueError):
    """An output file cannot be written."""


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


class RunWriter:
    """Writer of one run, for a `with` statement: the file gets its name when the block ends without an exception.

    A block that raises, or appends no frame, leaves no file.

    Parameters
    ----------
    path
        Output file (:func:`check_output`).
    info
        Properties of the run.
    overwrite
        Whether the complete file replaces an existing one.

    Raises
    ------
    OutputError
        If the file cannot be written, at the start or at the end.
    """

    def __init__(self, path: str | os.PathLike[str], info: RunInfo, *, overwrite: bool = False) -> None:
        self.path = check_output(path, overwrite)
        self.info = info
        self.frames = 0
        self._overwrite = overwrite
        self._partial = self.path.parent / f".{self.path.name}.partial-{os.getpid()}"
        self._file: h5py.File | None = None
        self._view: tuple[tuple[float, ...], str] | None = None

    def __enter__(self) -> RunWriter:
        self._file = h5py.File(self._partial, "w", libver=("earliest", "v110"))
        try:
            create_run(self._file, self.info)
        except BaseException:
            self._abort()
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if kind is not None:
            self._abort()
            return
        if self.frames == 0:
            self._abort()
            raise OutputError(f"output '{self.path}': no frame was written")
        try:
            self._opened.close()
            self._file = None
            _sync(self._partial)
        except BaseException:
            self._abort()
            raise
        self._publish()

    def append(
        self,
        adc: ArrayLike,
        *,
        time: float,
        pir: Pir | None = None,
        vertices: Mapping[str, ArrayLike] | None = None,
        joints: Mapping[str, ArrayLike] | None = None,
        labels: Mapping[str, Any] | None = None,
        mesh_time: float | None = None,
        full_scale: float | None = None,
        clipped: float = 0.0,
    ) -> None:
        """Append a frame.

        Parameters
        ----------
        adc
            (chirp, tx, rx, sample) complex samples.
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

        Raises
        ------
        ValueError
            If a value has a wrong shape, name or range; the frame is then not in the file.
        """
        file = self._opened
        samples = np.asarray(adc)
        if samples.shape != file["adc"].shape[1:] or samples.dtype.kind != "c":
            raise ValueError(
                f"adc is {samples.dtype} {samples.shape}; complex {file['adc'].shape[1:]} "
                "(chirp, tx, rx, sample) is needed by the radar"
            )
        if not np.all(np.isfinite(samples)):
            raise ValueError(f"adc of frame {self.frames} holds NaN or infinite samples")
        if not np.isfinite(time):
            raise ValueError(f"time is {time!r}: seconds are needed")
        if self.frames and not time > file["frame_time"][self.frames - 1]:
            raise ValueError(f"time is {time} s; frames ascend, the last began at {file['frame_time'][-1]} s")
        known = file["adc"].attrs.get("full_scale") if self.frames else full_scale
        if known != full_scale or not 0 <= clipped <= 1 or (full_scale is not None and not 0 < full_scale < np.inf):
            raise ValueError(
                f"full_scale is {full_scale!r} and clipped {clipped!r}: full_scale of the frames before ({known!r}) "
                "and a share in 0 … 1 are needed"
            )
        rows: list[tuple[str, Any]] = [
            ("adc", samples.astype(np.complex64)),
            ("frame_time", time),
            ("mesh_time", time if mesh_time is None else mesh_time),
            ("frame", self.frames),
        ]
        rows += self._geometry("vertices", vertices, [(a, a.num_vertices) for a in self.info.actors])
        rows += self._geometry("joints", joints, [(a, len(a.joint_names)) for a in self.info.actors if a.joint_names])
        rows += self._label_rows(labels)
        rows += self._pir_rows(pir)
        for name, value in rows:
            dataset = file[name]
            dataset.resize(self.frames + 1, axis=0)
            dataset[self.frames] = value
        if full_scale is not None:
            words = int(file["adc"].attrs.get("clipped", 0)) + round(2 * samples.size * clipped)
            file["adc"].attrs.update({"full_scale": full_scale, "clipped": words})
        self.frames += 1

    def _geometry(
        self, kind: str, given: Mapping[str, ArrayLike] | None, wanted: Sequence[tuple[ActorInfo, int]]
    ) -> list[tuple[str, Any]]:
        given = given or {}
        names = {actor.name for actor, _ in wanted}
        if set(given) != names:
            raise ValueError(f"{kind} are given for {sorted(given)}; needed for {sorted(names)}")
        rows = []
        for actor, count in wanted:
            array = np.asarray(given[actor.name], np.float32)
            if array.shape != (count, 3) or not np.all(np.isfinite(array)):
                raise ValueError(f"{kind} of '{actor.name}' have shape {array.shape}: finite ({count}, 3) is needed")
            rows.append((f"actors/{actor.name}/{kind}", array))
        return rows

    def _label_rows(self, labels: Mapping[str, Any] | None) -> list[tuple[str, Any]]:
        labels = labels or {}
        if set(labels) != set(self.info.labels):
            raise ValueError(f"labels are {sorted(labels)}; declared are {sorted(self.info.labels)}")
        group, rows = self._opened["labels"], []
        for name, label in self.info.labels.items():
            value = np.asarray(labels[name], object if label.text else np.float64)
            if label.text and not all(isinstance(item, str) for item in value.flat):
                raise ValueError(f"label '{name}' is {labels[name]!r}: texts are needed")
            if name not in group:
                create_label(self._opened, name, label, value.shape)
            if value.shape != group[name].shape[1:]:
                raise ValueError(
                    f"label '{name}' has shape {value.shape}; {group[name].shape[1:]} {label.dims} is needed"
                )
            rows.append((f"labels/{name}", value if value.ndim else value.item()))
        return rows

    def _pir_rows(self, pir: Pir | None) -> list[tuple[str, Any]]:
        exists = "image" in self._opened.get("pir", ())
        if pir is None:
            if exists:
                raise ValueError(f"pir is missing in frame {self.frames}; the frames before have one")
            return []
        if not exists:
            if self.frames:
                raise ValueError(f"pir is given in frame {self.frames}; the frames before have none")
            create_pir(self._opened, pir)
            self._view = (tuple(pir.fov_deg), pir.projection)
        image = np.stack([getattr(pir, channel) for channel in PIR_CHANNELS]).astype(np.float32)
        if image.shape != self._opened["pir/image"].shape[1:] or self._view != (tuple(pir.fov_deg), pir.projection):
            raise ValueError(
                f"pir of frame {self.frames} has {image.shape[1:]} pixels, {pir.fov_deg} degrees, {pir.projection}; "
                f"{self._opened['pir/image'].shape[2:]}, {self._view} as in the first frame are needed"
            )
        return [
            ("pir/image", image),
            ("pir/time", pir.time),
            ("pir/position", pir.position),
            ("pir/orientation", pir.orientation),
        ]

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
            _sync(self.path.parent)

    def _abort(self) -> None:
        try:
            if self._file is not None:
                self._file.close()
        finally:
            self._file = None
            self._partial.unlink(missing_ok=True)


def _sync(path: Path) -> None:
    """Wait until the file (or folder) is on the disk."""
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
