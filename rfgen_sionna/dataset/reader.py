"""Reader of run files: arrays stay on the disk until they are read."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from types import TracebackType
from typing import Any, NoReturn

import h5py
import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._short_repr import ShortRepr, name_list, short_value, time_span
from rfgen_sionna._types import FloatArray, IntArray
from rfgen_sionna.dataset.hdf5_layout import run_difference
from rfgen_sionna.dataset.run_file import RunFile
from rfgen_sionna.dataset.schema import PIR_CHANNELS, RunFormatError, RunInfo
from rfgen_sionna.radar import Radar
from rfgen_sionna.records import AdcCube, Pir


@dataclass(frozen=True, repr=False)
class ActorRecord(ShortRepr):
    """Actor of a run."""

    name: str
    material: str
    faces: IntArray
    """(face, 3) vertex numbers."""
    part_names: tuple[str, ...]
    face_parts: IntArray
    """(face,) index into `part_names`."""
    joint_names: tuple[str, ...]
    _file: RunFile
    _radar_name: str

    def vertices(self, frame: int) -> NDArray[np.floating[Any]]:
        """(vertex, 3) world positions [m] in frame `frame`."""
        return self._points("vertices", frame)

    def joints(self, frame: int) -> NDArray[np.floating[Any]]:
        """(joint, 3) world positions [m] in frame `frame`; (0, 3) where the actor has no skeleton."""
        return self._points("joints", frame) if self.joint_names else np.empty((0, 3), np.float32)

    def _points(self, kind: str, frame: int) -> NDArray[np.floating[Any]]:
        return np.asarray(self._file.group(self._radar_name)[f"actors/{self.name}/{kind}"][frame])


@dataclass(frozen=True, repr=False)
class LabelRecord(ShortRepr):
    """Label over all frames."""

    values: NDArray[Any]
    """(frame, ...) with the axes `dims`; texts as str objects."""
    units: str
    dims: tuple[str, ...]
    description: str


class Run(ShortRepr):
    """Open run file (:func:`open_run`), to be closed or used in a `with` statement.

    A file of several radars has the run of each by its name, `run["left"]`; the file itself has no samples. A run can
    be pickled, for processes of any start method: the copy opens the file again, as does a forked process.
    """

    def __init__(self, file: RunFile, radar_name: str = "") -> None:
        self._file, self._radar_name = file, radar_name

    def _facts(self) -> Iterable[str]:
        yield repr(str(self.path))
        if not self._file.is_open:
            yield "closed"
            return
        if names := () if self._radar_name else self._file.radar_names:
            yield f"radars {name_list(names)}"
            return
        radar = self.radar
        yield f"{len(self)} frame{'' if len(self) == 1 else 's'}"
        yield time_span(self.frame_times)
        yield f"radar {self.name!r} ({radar.preset})"
        yield radar.cell_text
        yield f"actors {name_list(self.actors)}" if self.actors else "no actors"
        yield short_value(self.prompt) if self.prompt else ""
        yield f"in {short_value(self.environment)}" if self.environment else ""
        yield f"labels {name_list(self.labels, 10)}" if self.labels else "no labels"
        yield "PIR images" if self.has_pir else ""

    def __reduce__(self) -> Any:
        return Run, (self._file, self._radar_name)

    def __enter__(self) -> Run:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Close the file, for all of its radars."""
        self._file.close()

    @property
    def path(self) -> Path:
        """The file."""
        return self._file.path

    @property
    def name(self) -> str:
        """Name of the radar in the file."""
        return self._radar_name or self.radar.name

    @property
    def radars(self) -> Mapping[str, Run]:
        """Runs by the names of their radars, in the order of the file; of one radar this run itself."""
        names = () if self._radar_name else self._file.radar_names
        return {name: Run(self._file, name) for name in names} or {self.name: self}

    def __getitem__(self, radar: str) -> Run:
        """Run of the radar of that name."""
        runs = self.radars
        if radar not in runs:
            raise KeyError(f"'{self.path}' has no radar {radar!r}; it has {', '.join(map(repr, runs))}")
        return runs[radar]

    def __iter__(self) -> NoReturn:
        raise TypeError("a run is no sequence: run.adc has its frames, run.radars its radars")

    def is_same(self, info: RunInfo | Mapping[str, RunInfo]) -> bool:
        """Whether the file has all frames of the run `info` (of each radar, by its name)."""
        return not run_difference(self._file.root, info)

    def __len__(self) -> int:
        """Number of frames."""
        return int(self.adc.shape[0])

    @property
    def adc(self) -> h5py.Dataset:
        """(frame, chirp, tx, rx, sample) complex64, of a real ADC float32, on the disk [sqrt(W)]; a slice reads it."""
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
        """Number of I and Q values, of `2 adc.size` (of a real ADC `adc.size`), beyond the ADC's range."""
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
    def settings(self) -> dict[str, Any]:
        """Settings of the simulation; empty in older files."""
        return dict(self._json("settings")) if "settings" in self._opened.attrs else {}

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
                joint_names=tuple(group["joint"].asstr()[:]) if "joint" in group else (), _file=self._file,
                _radar_name=self._radar_name,
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
    def _opened(self) -> h5py.Group:
        """Group of the radar's run."""
        return self._file.group(self._radar_name)

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
    return Run(RunFile(Path(path)))


def _vector(values: Any) -> tuple[float, float, float]:
    x, y, z = (float(value) for value in values)
    return x, y, z
