"""What a run can keep, and the representations that are computed from its samples.

Representations are those of single frames, so that any slice of a run has the same numbers, whether they are stored or
computed: :meth:`rfgen_sionna.dataset.Run.representation`.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._short_repr import ShortRepr
from rfgen_sionna._types import IntArray
from rfgen_sionna.dataset.adc_words import AdcWords
from rfgen_sionna.dataset.schema import StoredArray, StoredAxis
from rfgen_sionna.processing import drai, micro_doppler, point_cloud, range_axis, range_doppler_power, velocity_axis
from rfgen_sionna.radar import Radar
from rfgen_sionna.records import AdcCube


class SampledRun(Protocol):
    """Run that representations are read from, or computed of: a :class:`rfgen_sionna.dataset.Run`."""

    @property
    def adc(self) -> Any: ...

    @property
    def radar(self) -> Radar: ...

    @property
    def arrays(self) -> Mapping[str, StoredArray]: ...

    def __len__(self) -> int: ...

    def stored(self, path: str) -> Any: ...

    def array(self, path: str, frames: slice) -> Any: ...

    def cube(self, frames: slice) -> AdcCube: ...


@dataclass(frozen=True)
class StoredContent:
    """Something that a run can store."""

    meaning: str
    dims: tuple[str, ...] = ()
    """Axes of the stored array; empty where there are several arrays."""
    units: str = ""
    dataset: str = ""
    """Path of the array within the run."""


KEPT: dict[str, StoredContent] = {
    "adc": StoredContent("samples of the ADC", ("frame", "chirp", "tx", "rx", "sample"), "sqrt(W)", "adc"),
    "range_doppler": StoredContent(
        "power against range and radial velocity, mean over the channels, static returns included",
        ("frame", "range", "velocity"), "W", "range_doppler/power",
    ),
    "drai": StoredContent(
        "dynamic range-angle image: power of moving returns against range and azimuth, 32 x 32",
        ("frame", "range", "angle"), "W", "drai/power",
    ),
    "micro_doppler": StoredContent(
        "short-time Doppler spectra of windows within each frame, static returns removed, summed over range",
        ("frame", "window", "velocity"), "W", "micro_doppler/power",
    ),
    "point_cloud": StoredContent(
        "detections of moving returns, strongest first, with row_splits", ("point", "field"), "", "point_cloud/points",
    ),
    "pir": StoredContent(
        "images of energy, time of arrival and velocity", ("frame", "channel", "row", "column"), "", "pir/image"
    ),
    "vertices": StoredContent("vertices of the mesh of every actor, and its faces"),
    "body": StoredContent("parameters that rebuild the mesh of every actor: shape once, pose in every frame"),
    "joints": StoredContent("joint positions of actors with a skeleton"),
    "labels": StoredContent("ground truth of every actor"),
    "paths": StoredContent("propagation paths, from which other radars of the same array take their samples"),
}  # fmt: skip
"""Names of what a run can keep -> meaning, axes and units."""

DEFAULT_KEPT: tuple[str, ...] = ("adc", "vertices", "joints", "labels")
"""What a run keeps by default; images as well where they are asked for."""

REPRESENTATIONS: tuple[str, ...] = ("range_doppler", "drai", "micro_doppler", "point_cloud")
"""What is computed from samples."""

POINT_FIELDS: dict[str, str] = {
    "x": "m", "y": "m", "z": "m", "velocity": "m s-1", "snr_db": "dB", "power": "W", "range": "m", "azimuth": "rad",
    "elevation": "rad",
}  # fmt: skip
"""Fields of the points of a cloud -> unit; x, y and z are in the world frame, azimuth and elevation in the radar's."""

DRAI_BINS = 32
"""Range bins and angles of a dynamic range-angle image, as in the published ones (Li et al., IEEE TMC 2022)."""


@dataclass(frozen=True, repr=False)
class Representation(ShortRepr):
    """One representation of some frames."""

    name: str
    values: NDArray[Any]
    """(frame, ...) with the axes `dims`; ragged ones are (row, ...)."""
    dims: tuple[str, ...]
    units: str
    axes: Mapping[str, NDArray[Any]] = field(default_factory=dict)
    """Coordinates of the axes by name: range [m], velocity [m/s], angle [rad], window [s] after the start of the frame,
    names of fields."""
    row_splits: IntArray | None = None
    """(frame + 1,) first row of each frame and the row after the last, of a ragged one."""

    def __len__(self) -> int:
        """Number of frames."""
        return len(self.values) if self.row_splits is None else len(self.row_splits) - 1

    def frame(self, number: int) -> NDArray[Any]:
        """Values of one frame."""
        if self.row_splits is None:
            return np.asarray(self.values[number])
        number = range(len(self))[number]
        return np.asarray(self.values[self.row_splits[number] : self.row_splits[number + 1]])

    def _facts(self) -> Iterable[str]:
        yield repr(self.name)
        yield f"{len(self)} frames"
        yield f"{self.dims} {self.values.shape} [{self.units}]"


def computed(name: str, samples: NDArray[Any], radar: Radar) -> Representation:
    """Representation of the frames `samples` (frame, chirp, tx, rx, sample) of a radar.

    Raises
    ------
    ValueError
        If `name` is not in `REPRESENTATIONS`, or the radar has no such representation.
    """
    check_names((name,), REPRESENTATIONS)
    kept = KEPT[name]
    if name == "point_cloud":
        clouds = [_points(frame, radar) for frame in samples]
        splits = np.cumsum([0, *map(len, clouds)])
        flat = np.concatenate([*clouds, np.empty((0, len(POINT_FIELDS)), np.float32)])
        return Representation(name, flat, kept.dims, kept.units, {"field": np.array(list(POINT_FIELDS))}, splits)
    found = [_of_frame(name, frame, radar) for frame in samples]
    axes = found[0][1] if found else _of_frame(name, np.zeros(radar.frame_shape, radar.sample_type), radar)[1]
    shape = tuple(len(each) for each in axes.values())
    values = np.stack([power for power, _ in found]) if found else np.empty((0, *shape), np.float32)
    return Representation(name, values, kept.dims, kept.units, axes)


def _of_frame(name: str, frame: NDArray[Any], radar: Radar) -> tuple[NDArray[np.float32], dict[str, NDArray[Any]]]:
    """Power of a frame (chirp, tx, rx, sample), and the coordinates of its axes."""
    if name == "range_doppler":
        power = range_doppler_power(frame, radar)
        return power, {"range": range_axis(radar, frame.shape[-1]), "velocity": velocity_axis(radar, len(frame))}
    if name == "drai":
        images = drai(frame[None], radar, range_bins=DRAI_BINS, angle_bins=DRAI_BINS)
        if images.image.shape[1:] != (DRAI_BINS, DRAI_BINS):
            raise ValueError(f"radar '{radar.name}' with preset '{radar.preset}' has {len(images.range)} range bins")
        return images.image[0], {"range": images.range, "angle": images.angle}
    spectra = micro_doppler(frame[None], radar)
    return spectra.power.astype(np.float32), {"window": spectra.time, "velocity": spectra.velocity}


def _points(frame: NDArray[Any], radar: Radar) -> NDArray[np.float32]:
    """(point, field) detections of a frame."""
    found = point_cloud(frame, radar)
    columns = {name: getattr(found, name, None) for name in POINT_FIELDS}
    columns |= dict(zip("xyz", found.position.T, strict=True))
    return np.stack([np.asarray(column) for column in columns.values()], axis=1).astype(np.float32)


def representation(run: SampledRun, name: str, frames: slice = slice(None)) -> Representation:
    """Representation of the `frames` of a run, as stored, or computed from its samples; "adc" are the samples.

    Raises
    ------
    RunFormatError
        If the run has neither it nor samples.
    ValueError
        If `name` is unknown, or the radar has no such representation.
    """
    check_names((name,), ("adc", *REPRESENTATIONS))
    kept, path = KEPT[name], KEPT[name].dataset
    numbers = range(*frames.indices(len(run)))
    if name == "adc":
        return Representation(name, run.cube(frames).data, kept.dims, kept.units)
    if run.stored(path) is None:
        found = [_computed_frame(name, run, number) for number in numbers]
        return _joined(found) if found else computed(name, np.empty((0, *run.radar.frame_shape)), run.radar)
    stored = run.arrays[path]
    axes = {dim: np.asarray(axis.values) for dim, axis in stored.axes.items()}
    values = run.array(path, frames)
    if not stored.ragged:
        return Representation(name, np.asarray(values), kept.dims, kept.units, axes)
    flat = np.concatenate([*values, np.empty((0, len(POINT_FIELDS)), np.float32)])
    return Representation(name, flat, kept.dims, kept.units, axes, np.cumsum([0, *map(len, values)]))


def _computed_frame(name: str, run: SampledRun, number: int) -> Representation:
    """Representation of one frame of a run, of the ADC's words without a cube of samples where that is possible."""
    adc, radar, kept = run.adc, run.radar, KEPT[name]
    if name != "range_doppler" or not isinstance(adc, AdcWords):
        return computed(name, run.cube(slice(number, number + 1)).data, radar)
    power = range_doppler_power(adc.words[number : number + 1], radar, scale=adc.scale_factor)
    axes = {"range": range_axis(radar, adc.shape[-1]), "velocity": velocity_axis(radar, adc.shape[1])}
    return Representation(name, power, kept.dims, kept.units, axes)


def _joined(parts: Sequence[Representation]) -> Representation:
    first, values = parts[0], np.concatenate([part.values for part in parts])
    splits = None if first.row_splits is None else np.cumsum([0, *(len(part.values) for part in parts)])
    return Representation(first.name, values, first.dims, first.units, first.axes, splits)


def check_names(names: Iterable[str], known: Iterable[str] = tuple(KEPT)) -> None:
    """ValueError if one of the `names` is not `known`."""
    for name in names:
        if name not in tuple(known):
            raise ValueError(f"{name!r} is nothing that a run keeps: allowed are {', '.join(known)}")


def checked_keep(keep: Iterable[str] | None, pictures: bool) -> tuple[str, ...]:
    """Names in the order of :data:`KEPT`; None is :data:`DEFAULT_KEPT`, with images if there are `pictures`.

    Raises
    ------
    TypeError, ValueError
        If `keep` is no list of known names, is empty, or has "pir" without the pixels of its images.
    """
    if isinstance(keep, str) or not (keep is None or isinstance(keep, Iterable)):
        raise TypeError(f"keep is {keep!r}: a list of names of {', '.join(KEPT)} is needed")
    names = (*DEFAULT_KEPT, *(["pir"] if pictures else [])) if keep is None else tuple(keep)
    for name in names:
        if name not in KEPT:
            raise ValueError(f"keep has {name!r}: allowed are {', '.join(KEPT)}")
    if not names:
        raise ValueError(f"keep is empty: at least one of {', '.join(KEPT)} is needed")
    if "pir" in names and not pictures:
        raise ValueError("keep has 'pir', but images have no size: give pir_resolution, such as (128, 128)")
    return tuple(name for name in KEPT if name in names)


def representation_arrays(keep: Iterable[str], radar: Radar) -> dict[str, StoredArray]:
    """Declarations of the representations in `keep`, by their paths in a run.

    Raises
    ------
    ValueError
        Naming one that the radar does not have.
    """
    declared, names = {}, tuple(keep)
    for name in (each for each in REPRESENTATIONS if each in names):
        kept = KEPT[name]
        if name == "point_cloud":
            if radar.waveform.slope == 0:
                raise ValueError(
                    f"keep has 'point_cloud': radar '{radar.name}' with preset '{radar.preset}' has a slope of 0, and "
                    "points have no ranges; keep 'micro_doppler'"
                )
            units = ", ".join(f"{label} [{unit}]" for label, unit in POINT_FIELDS.items())
            axes = {"field": StoredAxis(list(POINT_FIELDS), "", units)}
            declared[kept.dataset] = StoredArray(kept.dims, "", kept.meaning, axes=axes, ragged=True)
            continue
        try:
            found = computed(name, np.empty((0, *radar.frame_shape)), radar).axes
        except ValueError as error:
            raise ValueError(f"keep has '{name}', which this radar has not: {error}; leave it out") from error
        axes = {dim: StoredAxis(values, *_AXES[dim]) for dim, values in found.items()}
        declared[kept.dataset] = StoredArray(kept.dims[1:], kept.units, kept.meaning, axes=axes)
    return declared


def representation_values(keep: Iterable[str], samples: NDArray[Any], radar: Radar) -> dict[str, NDArray[Any]]:
    """Entries of one frame (chirp, tx, rx, sample) for the representations in `keep`, by their path."""
    stored = samples.astype(radar.sample_type)[None]  # as a reader sees them
    names = [name for name in REPRESENTATIONS if name in tuple(keep)]
    made = {KEPT[name].dataset: computed(name, stored, radar) for name in names}
    return {path: each.values if each.row_splits is not None else each.values[0] for path, each in made.items()}


_AXES = {
    "range": ("m", "centre of the range bin"), "velocity": ("m s-1", "radial velocity, positive is receding"),
    "angle": ("rad", "azimuth, positive is left"), "window": ("s", "middle of the window after the start of the frame"),
}  # fmt: skip
