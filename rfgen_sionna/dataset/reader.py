"""Reader of run files: arrays stay on the disk until they are read."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from types import TracebackType
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import FloatArray, IntArray
from rfgen_sionna.dataset.schema import FORMAT, PIR_CHANNELS, VERSION, RunFormatError
from rfgen_sionna.radar import Radar
from rfgen_sionna.records import AdcCube, Pir

_NEEDED = ("adc", "frame_time", "mesh_time", "actors", "labels")
_NEEDED_ATTRIBUTES = ("format_version", "prompt", "negative_prompt", "environment", "radar", "seeds", "software")


@dataclass(frozen=True)
class ActorRecord:
    """Actor of a run."""

    name: str
    material: str
    faces: IntArray
    """(face, 3) vertex numbers."""
    part_names: tuple[str, ...]
    face_parts: IntArray
    """(face,) index into `part_names`."""
    joint_names: tuple[str, ...]
    _group: h5py.Group

    def vertices(self, frame: int) -> NDArray[np.float32]:
        """(vertex, 3) world positions [m] in frame `frame`."""
        return np.asarray(self._group["vertices"][frame])

    def joints(self, frame: int) -> NDArray[np.float32]:
        """(joint, 3) world positions [m] in frame `frame`; (0, 3) where the actor has no skeleton."""
        return np.asarray(self._group["joints"][frame]) if self.joint_names else np.empty((0, 3), np.float32)


@dataclass(frozen=True)
class LabelRecord:
    """Label over all frames."""

    values: NDArray[Any]
    """(frame, ...) with the axes `dims`; texts as str objects."""
    units: str
    dims: tuple[str, ...]
    description: str


class Run:
    """Open run file (:func:`open_run`), to be closed or used in a `with` statement."""

    def __init__(self, path: Path, file: h5py.File) -> None:
        self.path = path
        self._file = file

    def __enter__(self) -> Run:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def __len__(self) -> int:
        """Number of frames."""
        return int(self.adc.shape[0])

    @property
    def adc(self) -> h5py.Dataset:
        """(frame, chirp, tx, rx, sample) complex64 on the disk [sqrt(W)]; a slice reads it."""
        return self._opened["adc"]

    def cube(self, frames: slice = slice(None)) -> AdcCube:
        """Samples of `frames`, in memory, with the radar and the frames' times."""
        return AdcCube(self.adc[frames], self.radar, self.frame_times[frames], self.seeds.get("noise"))

    @cached_property
    def radar(self) -> Radar:
        """The radar of the run."""
        return Radar.from_dict(self._json("radar"))

    @cached_property
    def frame_times(self) -> FloatArray:
        """(frame,) start of each frame's first ramp [s]."""
        return np.asarray(self._opened["frame_time"][:])

    @cached_property
    def mesh_times(self) -> FloatArray:
        """(frame,) times of meshes, joints and labels [s]."""
        return np.asarray(self._opened["mesh_time"][:])

    @property
    def prompt(self) -> str:
        """The prompt; empty without one."""
        return str(self._opened.attrs["prompt"])

    @property
    def negative_prompt(self) -> str:
        """The negative prompt; empty without one."""
        return str(self._opened.attrs["negative_prompt"])

    @property
    def receiver(self) -> dict[str, Any] | None:
        """Record of the receiver for `signal.receiver_from_record`; None without a receiver."""
        return self._json("receiver") if self._opened.attrs.get("receiver") else None

    @property
    def full_scale(self) -> float | None:
        """Largest I or Q of the ADC [sqrt(W)]; None if the samples are not quantised or the file has no value."""
        value = self.adc.attrs.get("full_scale")
        return None if value is None else float(value)

    @property
    def clipped(self) -> int:
        """Number of I and Q values, of `2 adc.size`, beyond the ADC's range."""
        return int(self.adc.attrs.get("clipped", 0))

    @property
    def report(self) -> str:
        """Interpretation of the prompt and every decision with its origin; empty without a prompt."""
        return str(self._opened.attrs.get("report", ""))

    @property
    def environment(self) -> str:
        """Name of the surroundings; empty in free space."""
        return str(self._opened.attrs["environment"])

    @property
    def created(self) -> str:
        """Time of the file's creation, ISO 8601, UTC."""
        return str(self._opened.attrs.get("created", ""))

    @property
    def seeds(self) -> dict[str, int | None]:
        """Seed of each draw; None for one without randomness."""
        return dict(self._json("seeds"))

    @property
    def software(self) -> dict[str, str]:
        """Versions of the packages at the file's creation."""
        return dict(self._json("software"))

    @property
    def has_pir(self) -> bool:
        """Whether the run has PIR images."""
        return "image" in self._opened.get("pir", ())

    def pir(self, frame: int) -> Pir:
        """PIR of frame number `frame`; RunFormatError if the run has none."""
        if not self.has_pir:
            raise RunFormatError(f"{self.path} holds no PIR frames ('pir/image')")
        group = self._opened["pir"]
        names = list(group["channel"].asstr()[:])
        image = group["image"][frame].astype(np.float64)
        channels = {name: image[names.index(name)] for name in PIR_CHANNELS}
        fov = group.attrs["fov_deg"]
        return Pir(
            **channels,
            fov_deg=(float(fov[0]), float(fov[1])),
            position=_vector(group["position"][frame]),
            orientation=_vector(group["orientation"][frame]),
            projection=str(group.attrs["projection"]),
            time=float(group["time"][frame]),
        )

    @cached_property
    def actors(self) -> Mapping[str, ActorRecord]:
        """Actors by name, in the order of the "actor" axis of labels."""
        names = self._opened["actor"].asstr()[:] if "actor" in self._opened else ()
        found = {}
        for name in names:
            group = self._opened[f"actors/{name}"]
            found[str(name)] = ActorRecord(
                name=str(name), material=str(group.attrs["material"]), faces=group["faces"][:],
                part_names=tuple(group["part"].asstr()[:]), face_parts=group["face_part"][:],
                joint_names=tuple(group["joint"].asstr()[:]) if "joint" in group else (), _group=group,
            )  # fmt: skip
        return found

    @cached_property
    def labels(self) -> Mapping[str, LabelRecord]:
        """Labels by name, with their values over all frames."""
        found = {}
        for name, dataset in self._opened["labels"].items():
            if dataset.is_scale:
                continue
            text = h5py.check_string_dtype(dataset.dtype) is not None
            found[name] = LabelRecord(
                values=dataset.asstr()[:] if text else dataset[:],
                units=str(dataset.attrs.get("units", "")),
                dims=tuple(dim.label for dim in dataset.dims),
                description=str(dataset.attrs.get("long_name", "")),
            )
        return found

    @property
    def _opened(self) -> h5py.File:
        if not self._file:
            raise ValueError(f"run '{self.path}' is closed")
        return self._file

    def _json(self, name: str) -> dict[str, Any]:
        try:
            return dict(json.loads(self._opened.attrs[name]))
        except (ValueError, TypeError) as error:
            raise RunFormatError(f"{self.path}: attribute '{name}' is not a JSON object ({error})") from error


def open_run(path: str | os.PathLike[str]) -> Run:
    """Open the run file at `path` for reading.

    Raises
    ------
    FileNotFoundError, IsADirectoryError
        If there is no such file, or it is a folder.
    RunFormatError
        If the file is not HDF5, not a run, of another format version, or lacks datasets or attributes.
    TypeError
        If `path` is not a path.
    """
    if not isinstance(path, (str, os.PathLike)):
        raise TypeError(f"path is {path!r}: the path of a run file is needed")
    target = Path(path)
    if target.is_dir():
        raise IsADirectoryError(f"run file '{target}' is a folder: the name of a file in it is needed")
    if not target.is_file():
        raise FileNotFoundError(f"run file '{target}' does not exist")
    try:
        file = h5py.File(target, "r")
    except OSError as error:
        raise RunFormatError(f"'{target}' is not an HDF5 file: {error}") from error
    try:
        _check(target, file)
    except BaseException:
        file.close()
        raise
    return Run(target, file)


def _check(path: Path, file: h5py.File) -> None:
    if file.attrs.get("format") != FORMAT:
        raise RunFormatError(
            f"'{path}' is no run of this package: attribute 'format' is {file.attrs.get('format')!r}, "
            f"'{FORMAT}' is needed; it holds {', '.join(sorted(file)) or 'nothing'}"
        )
    missing = [f"attribute '{name}'" for name in _NEEDED_ATTRIBUTES if name not in file.attrs]
    missing += [f"'{name}'" for name in _NEEDED if name not in file]
    if missing:
        raise RunFormatError(f"'{path}' lacks {', '.join(missing)}")
    major = VERSION.partition(".")[0]
    if str(file.attrs["format_version"]).partition(".")[0] != major:
        raise RunFormatError(
            f"'{path}' has format version {file.attrs['format_version']}; this package reads {major}.x"
        )
    if file["adc"].ndim != 5 or file["adc"].dtype.kind != "c":
        raise RunFormatError(
            f"'{path}': 'adc' is {file['adc'].dtype} {file['adc'].shape}; complex (frame, chirp, tx, rx, sample) needed"
        )


def _vector(values: Any) -> tuple[float, float, float]:
    x, y, z = (float(value) for value in values)
    return x, y, z
