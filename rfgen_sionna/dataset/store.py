"""Writing a run: frame by frame into a hidden partial file that gets its name when the run is whole."""

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

COMPRESSIONS = (None, "gzip", "lzf")


class OutputError(ValueError):
    """An output file cannot be written where it is asked for."""


def check_output(path: str | os.PathLike[str], overwrite: bool = False) -> Path:
    """Whether a file can be written at `path`; call it before any long work.

    Returns the path; creates nothing that stays.

    Raises
    ------
    OutputError
        The file exists (without `overwrite`), is a folder, or its folder is missing or not writable.
    TypeError
        `path` is no path.
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
    """Writes one run. Use it in a `with` statement: the file appears under its name when the block ends well.

    If the block raises (an interruption from the keyboard too), or no frame was appended, nothing is left.

    Parameters
    ----------
    path
        Output file; see :func:`check_output`.
    info
        What is known beforehand.
    overwrite
        Whether an existing file is replaced, in one step, once the new one is whole.
    compression
        None, "gzip" or "lzf", for samples, images and meshes. Noise does not compress; noise-free runs by a third.
    """

    def __init__(
        self,
        path: str | os.PathLike[str],
        info: RunInfo,
        *,
        overwrite: bool = False,
        compression: str | None = None,
    ) -> None:
        if compression not in COMPRESSIONS:
            raise ValueError(f"compression is {compression!r}; allowed: {', '.join(map(repr, COMPRESSIONS))}")
        self.path = check_output(path, overwrite)
        self.info = info
        self.frames = 0
        self._overwrite = overwrite
        self._filters = {} if compression is None else {"compression": compression, "shuffle": True}
        self._partial = self.path.parent / f".{self.path.name}.partial-{os.getpid()}"
        self._file: h5py.File | None = None
        self._view: tuple[tuple[float, ...], str] | None = None

    def __enter__(self) -> RunWriter:
        self._file = h5py.File(self._partial, "w", libver=("earliest", "v110"))
        try:
            create_run(self._file, self.info, self._filters)
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

    # -- one frame ----------------------------------------------------------------------------------------

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
        """Add one frame.

        Parameters
        ----------
        adc
            (chirp, tx, rx, sample) complex samples.
        time
            Start of the frame's first ramp [s].
        pir
            Image of the frame; every frame has one or none has.
        vertices, joints
            (vertex, 3) and (joint, 3) world positions [m] of each actor of the run (joints where it has any).
        labels
            One value for each label that was declared.
        mesh_time
            Instant of `vertices`, `joints` and `labels` [s]; `time` by default.
        full_scale
            Largest I or Q of the ADC [sqrt(W)], that of all frames; None where the samples are not quantised.
        clipped
            Share of the frame's words of I and Q that were beyond it; the file counts the words.

        Raises
        ------
        ValueError
            Naming what does not fit, with the shape or the names needed; the frame is then not in the file.
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
                f"full_scale is {full_scale!r} and clipped {clipped!r}: that of the frames before ({known!r}), and a "
                "share in 0 … 1, are needed"
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
            create_pir(self._opened, pir, self._filters)
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

    # -- the file -----------------------------------------------------------------------------------------

    @property
    def _opened(self) -> h5py.File:
        if self._file is None:
            raise RuntimeError("the writer is closed; append frames inside its 'with' block")
        return self._file

    def _publish(self) -> None:
        if self._overwrite:
            os.replace(self._partial, self.path)
        else:
            try:
                os.link(self._partial, self.path)
            except FileExistsError:
                # Hours of work may be in the partial file: it stays, under its own name.
                raise OutputError(
                    f"output '{self.path}' appeared while the run was written; the run is in '{self._partial}'"
                ) from None
            except OSError:
                # A file system without hard links.
                if self.path.exists():
                    raise OutputError(
                        f"output '{self.path}' appeared while the run was written; the run is in '{self._partial}'"
                    ) from None
                os.rename(self._partial, self.path)
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
