"""Reader of run files: arrays stay on the disk until they are read."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Mapping
from functools import cached_property, lru_cache
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any, NoReturn

import h5py
import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._short_repr import ShortRepr, name_list, short_value, time_span
from rfgen_sionna._types import FloatArray
from rfgen_sionna.dataset.actor_record import ActorRecord, LabelRecord
from rfgen_sionna.dataset.adc_words import AdcWords
from rfgen_sionna.dataset.hdf5_layout import run_difference
from rfgen_sionna.dataset.run_file import RunFile, json_names
from rfgen_sionna.dataset.schema import PIR_CHANNELS, RunFormatError, RunInfo, StoredArray
from rfgen_sionna.dataset.stored_arrays import StoredArrays, array_values
from rfgen_sionna.radar import Radar
from rfgen_sionna.records import AdcCube, Pir

if TYPE_CHECKING:
    from rfgen_sionna.dataset.representations import Representation


class Run(ShortRepr):
    """Open run file (:func:`open_run`), to be closed or used in a `with` statement.

    A file of several radars has the run of each by its name, `run["left"]`; the file itself has no samples. A run can
    be pickled, for processes of any start method: the copy opens the file again, as does a forked process.
    """

    def __init__(self, file: RunFile, radar_name: str = "") -> None:
        self._file, self._radar_name = file, radar_name

    def _facts(self) -> Iterable[str]:
        yield f"'{self.path}{':' if self._file.inside else ''}{self._file.inside}'"
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
        return int(self._opened["frame_time"].shape[0])

    @property
    def adc(self) -> h5py.Dataset | AdcWords:
        """(frame, chirp, tx, rx, sample) complex64, of a real ADC float32, on the disk [sqrt(W)]; a slice reads it.

        RunFormatError if the run has no samples.
        """
        stored = self.stored("adc")
        if not isinstance(stored, h5py.Dataset):
            raise RunFormatError(f"'{self.path}' holds no samples: write runs with keep 'adc'")
        return AdcWords(stored, self._file) if stored.dtype.kind == "i" else stored

    @property
    def contents(self) -> tuple[str, ...]:
        """Names of the parts that are stored (`keep`)."""
        group = self._opened
        if "contents" in group.attrs:
            return tuple(json_names(self.path, group, "contents"))
        found = ["adc", "labels", *(["pir"] if self.has_pir else [])]
        return tuple(found + [kind for kind in ("vertices", "joints") if any(kind in each for each in self._actors)])

    @property
    def recording(self) -> dict[str, Any]:
        """Specification of the recording in a data set; empty outside of one."""
        text = self._file.root.attrs.get("recording")
        return {} if text is None else _json_object(self.path, "recording", text)

    def stored(self, path: str) -> h5py.Dataset | h5py.Group | None:
        """Dataset or group at `path` in the run, on the disk; None if there is none."""
        found: h5py.Dataset | h5py.Group | None = self._opened.get(path)
        return found

    @property
    def arrays(self) -> Mapping[str, StoredArray]:
        """Further arrays of the run by their paths, such as "representations/drai/power"."""
        group = self._opened
        return StoredArrays(group, json_names(self.path, group, "arrays"))

    def array(self, path: str, frames: int | slice = slice(None)) -> NDArray[Any] | list[NDArray[Any]]:
        """Values of one of the :attr:`arrays`, for `frames` if it has frames; of a ragged one a list of arrays."""
        if path not in self._opened:
            raise RunFormatError(
                f"'{self.path}' holds no array '{path}'; it has {name_list(self.arrays, 10) or 'none'}"
            )
        return array_values(self._opened, path, frames)

    def representation(self, name: str, frames: slice = slice(None)) -> Representation:
        """Representation of `frames`, "range_doppler", "drai", "micro_doppler" or "point_cloud": the stored one, or
        that of the stored samples (:func:`rfgen_sionna.dataset.representations.representation`)."""
        from rfgen_sionna.dataset.representations import representation

        return representation(self, name, frames)

    @property
    def has_paths(self) -> bool:
        """Whether the run has the traced paths of its frames."""
        return "paths" in self._opened

    def cube(self, frames: slice = slice(None)) -> AdcCube:
        """Samples of `frames`, in memory, with the radar and the frames' times."""
        return AdcCube(self.adc[frames], self.radar, self.frame_times[frames], self.seeds.get("noise"))

    @cached_property
    def radar(self) -> Radar:
        """The radar of the run."""
        return _radar(str(self._opened.attrs["radar"]), self.path)

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
        value = self._quantised.get("full_scale")
        return None if value is None else float(value)

    @property
    def clipped(self) -> int:
        """Number of I and Q values, of `2 adc.size` (of a real ADC `adc.size`), beyond the ADC's range."""
        return int(self._quantised.get("clipped", 0))

    @property
    def _quantised(self) -> h5py.AttributeManager:
        return self._opened["adc" if "adc" in self._opened else "frame_time"].attrs

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
        for name in map(str, names):
            group = self._opened[f"actors/{name}"]
            joints = tuple(group["joint"].asstr()[:]) if "joints" in group else ()
            found[name] = ActorRecord(name, str(group.attrs["material"]), joints, self._file, self._radar_name)
        return found

    @property
    def _actors(self) -> list[h5py.Group]:
        return list(self._opened["actors"].values())

    @cached_property
    def labels(self) -> Mapping[str, LabelRecord]:
        """Labels by name, with their values over all frames."""
        found = {}
        for name, dataset in self._opened["labels"].items():
            if not isinstance(dataset, h5py.Dataset) or dataset.is_scale:
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
        return _json_object(self.path, name, self._opened.attrs[name])


def _json_object(path: Path, name: str, text: Any) -> dict[str, Any]:
    try:
        return dict(json.loads(text))
    except (ValueError, TypeError, RecursionError) as error:
        raise RunFormatError(f"{path}: attribute '{name}' is not a JSON object ({error})") from error


@lru_cache(maxsize=64)
def _radar(text: str, path: Path) -> Radar:
    """The radar of a record; recordings of a set share one object."""
    return Radar.from_dict(_json_object(path, "radar", text))


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
