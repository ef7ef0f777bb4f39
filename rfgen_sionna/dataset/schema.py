"""Contents of a run file: names, axes and units of format `rfgen-run`.

One HDF5 file holds one run in netCDF-4 layout: dimension scales by name, units as attributes. Complex samples are the
compound (r, i) of h5py and NumPy::

    /adc            (frame, chirp, tx, rx, sample) complex64 [sqrt(W)]; float32 of a radar with a real ADC
    /frame_time     (frame) start of each frame's first ramp [s]
    /chirp_time     (chirp, tx) start of each ramp after that [s]
    /sample_time    (sample) after the start of the ramp [s]; (tx, sample) with several profiles
    /tx_phase, /tx_advance  (tx, tx_element) phases of the Tx elements [degree], if `tx` counts slots
    /pir/image      (frame, channel, row, column) float32; channel: energy, time_of_arrival [s], velocity [m s-1]
    /pir/...        time, position, orientation of the viewpoint per frame
    /actors/NAME/   vertices (frame, vertex, axis) [m], faces, face_part, joints (frame, joint, axis) [m]; float32, or
                    float64 for a radar more than 1 km from the origin
    /labels/NAME    (frame, ...) as declared, with units
    /...            further arrays (:class:`StoredArray`), such as /representations/drai/power

Recordings of data sets have quantised samples as the ADC's words, int16 (frame, chirp, tx, rx, sample, iq), real ones
without iq: times the attribute scale_factor they are those samples, bit for bit. What a run need not have (samples,
vertices, joints, labels, images) is absent where its attribute contents (JSON) does not name it.

Attributes of the file: prompt, its interpretation (report), environment, radar (JSON), seeds, settings and versions
(JSON); in a data set recording, its specification (JSON). A file of several radars has one group of this layout for
each, /radars/NAME. A shard of a data set has the layout of a run file in each group /recordings/NUMBER.

    >>> import xarray                                                           # doctest: +SKIP
    >>> run = xarray.open_dataset("jacks.h5", engine="h5netcdf")                # doctest: +SKIP
    >>> run.adc.sel(frame=3, tx="TX1").isel(rx=0)                               # doctest: +SKIP
    >>> images = xarray.open_dataset("jacks.h5", engine="h5netcdf", group="pir")  # doctest: +SKIP
    >>> everything = xarray.open_datatree("jacks.h5", engine="h5netcdf")        # doctest: +SKIP
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from importlib.metadata import PackageNotFoundError, version
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._short_repr import ShortRepr
from rfgen_sionna._types import IntArray

if TYPE_CHECKING:
    from rfgen_sionna.radar import Radar

FORMAT = "rfgen-run"
VERSION = "1.0"
RADARS = "radars"
"""Group, in a file of several radars, with the run of each radar as a group of this layout; the attribute of the same
name lists them (JSON)."""
PIR_CHANNELS: dict[str, str] = {"energy": "1", "time_of_arrival": "s", "velocity": "m s-1"}
"""Channels of a PIR image in the order of the file -> unit; energy is |path gain|²."""
RECORDINGS = "recordings"
"""Group, in a shard of a data set, with the run of each recording as a group with its number as the name."""
SHARD_FORMAT = "rfgen-shard"
"""Attribute `format` of a shard."""
AXES = ("x", "y", "z")
SOFTWARE = (
    "rfgen_sionna", "sionna-rt", "mitsuba", "drjit", "numpy", "scipy", "finufft", "trimesh", "anny", "torch", "h5py",
)  # fmt: skip
"""Distributions whose versions are stored, if installed."""


class RunFormatError(ValueError):
    """The file is not a run of this format, or lacks a part of it."""


def software_versions() -> dict[str, str]:
    """Installed versions of :data:`SOFTWARE`, without importing them."""
    found = {}
    for name in SOFTWARE:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            continue
    return found


@dataclass(frozen=True)
class Label:
    """Declaration of a label: one value a frame with further axes `dims`."""

    units: str = "1"
    """Unit in UDUNITS notation ("m s-1"); "1" for numbers without a unit; empty for text."""
    dims: tuple[str, ...] = ()
    """Axes after frame: "actor", "axis" (x, y, z), or any other name."""
    description: str = ""
    text: bool = False
    """Whether the values are texts."""


STANDARD_LABELS: dict[str, Label] = {
    "action": Label("", ("actor",), "action of the actor", text=True),
    "position": Label("m", ("actor", "axis"), "centre of the actor, world frame"),
    "velocity": Label("m s-1", ("actor", "axis"), "velocity of that point, world frame"),
    "bounding_box": Label("m", ("actor", "bound", "axis"), "least and largest coordinates of the actor, world frame"),
    "orientation": Label("rad", ("actor",), "direction the actor faces: yaw in the world frame"),
    "distance": Label("m", ("actor",), "radar to the centre of the actor"),
    "radial_velocity": Label("m s-1", ("actor",), "rate of the distance; positive is receding"),
    "in_range": Label(
        "1", ("actor",), "share of the actor's vertices within the radar's range window; 0 returns nothing"
    ),
    "azimuth": Label("rad", ("actor",), "direction of the centre in the radar's frame; positive is left"),
    "elevation": Label("rad", ("actor",), "direction of the centre in the radar's frame; positive is up"),
    "breathing_rate": Label("min-1", ("actor",), "mean rate of breathing; NaN for a still skin"),
    "heart_rate": Label("min-1", ("actor",), "mean rate of the heart; NaN for a still skin"),
    "chest_displacement": Label("m", ("actor",), "displacement of the chest over the heart, outwards; NaN likewise"),
}
"""Labels that this package writes."""


@dataclass(frozen=True)
class StoredAxis:
    """Values of an axis of a :class:`StoredArray`."""

    values: Sequence[Any] | NDArray[Any]
    """One value for each entry; texts for names."""
    units: str = "1"
    description: str = ""


@dataclass(frozen=True)
class StoredArray:
    """Declaration of an array of a run beside those of the layout; its path in the file is a key of its own.

    Raises
    ------
    ValueError
        If axes repeat, or one with values is not among them.
    """

    dims: tuple[str, ...]
    """Axes; those of one frame, without "frame", of arrays with rows for each frame (`RunInfo.arrays`)."""
    units: str = "1"
    description: str = ""
    dtype: str = "float32"
    axes: Mapping[str, StoredAxis] = field(default_factory=dict)
    """Values of axes that the run does not have; an axis without values counts from 0."""
    ragged: bool = False
    """Whether the length of the first axis differs from frame to frame, as of point clouds."""

    def __post_init__(self) -> None:
        if len(set(self.dims)) != len(self.dims) or (self.ragged and not self.dims):
            raise ValueError(f"array.dims is {self.dims!r}: different names are needed, of a ragged array at least one")
        if unknown := set(self.axes) - set(self.dims):
            raise ValueError(f"array.axes has {sorted(unknown)}; dims are {self.dims!r}")


def check_array_path(path: str) -> None:
    """ValueError unless `path` is that of a group and an array in it, and no array of the layout."""
    parts = path.split("/") if isinstance(path, str) else []
    fixed = len(parts) > 1 and (parts[0] in ("labels", "pir") or (parts[0] == "actors" and len(parts) < 4))
    if len(parts) < 2 or fixed or not all(parts) or {".", ".."} & set(parts):
        raise ValueError(
            f"array path is {path!r}: 'representations/NAME' or 'actors/NAME/GROUP/NAME', or one like them, is needed"
        )


@dataclass(frozen=True, repr=False)
class ActorInfo(ShortRepr):
    """Constant properties of an actor; ValueError if the name, the faces or the face parts are invalid."""

    name: str
    material: str
    faces: IntArray
    """(face, 3) vertex indices."""
    num_vertices: int
    part_names: tuple[str, ...] = ("body",)
    face_parts: IntArray | None = None
    """(face,) index into `part_names`; None assigns all faces to the first part."""
    joint_names: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if not self.name or "/" in self.name or self.name in (".", ".."):
            raise ValueError(f"actor.name is {self.name!r}: a text without '/' is needed")
        faces = np.asarray(self.faces)
        if faces.ndim != 2 or faces.shape[1] != 3 or faces.dtype.kind not in "iu":
            raise ValueError(f"actor '{self.name}': faces have shape {faces.shape}; whole numbers (face, 3) are needed")
        if len(faces) and not 0 <= faces.min() <= faces.max() < self.num_vertices:
            raise ValueError(
                f"actor '{self.name}': faces use vertices {faces.min()} … {faces.max()}; "
                f"0 … {self.num_vertices - 1} exist"
            )
        parts = np.zeros(len(faces), np.int32) if self.face_parts is None else np.asarray(self.face_parts)
        if parts.shape != (len(faces),) or (len(parts) and not 0 <= parts.min() <= parts.max() < len(self.part_names)):
            raise ValueError(
                f"actor '{self.name}': face_parts must give each of the {len(faces)} faces one of the "
                f"{len(self.part_names)} parts"
            )
        object.__setattr__(self, "faces", faces.astype(np.int32))
        object.__setattr__(self, "face_parts", parts.astype(np.int32))

    @classmethod
    def of(cls, actor: Any) -> ActorInfo:
        """Properties of an :class:`rfgen_sionna.scene.MeshActor`."""
        count, parts, joints = len(actor.vertices(0.0)), tuple(actor.part_names), tuple(actor.joint_names)
        material = ", ".join(dict.fromkeys(each.name for each in actor.materials))
        return cls(actor.name, material, actor.faces, count, parts, actor.face_parts, joints)


@dataclass(frozen=True)
class RunInfo:
    """Properties of a run, known before its first frame.

    Raises
    ------
    ValueError, TypeError
        If names of actors or labels are invalid, or a seed is not a whole number.
    """

    radar: Radar
    prompt: str = ""
    negative_prompt: str = ""
    environment: str = ""
    seeds: Mapping[str, int | None] = field(default_factory=dict)
    """Seed of each draw, such as {"motion": 0, "noise": 1}; None without randomness."""
    actors: tuple[ActorInfo, ...] = ()
    labels: Mapping[str, Label] = field(default_factory=dict)
    report: str = ""
    """Interpretation of the prompt and every decision with its origin; several lines."""
    receiver: Mapping[str, Any] | None = None
    """Record of the receiver (`signal.receiver_record`), ready for JSON; None stores none."""
    settings: Mapping[str, Any] = field(default_factory=dict)
    """Settings of the simulation, ready for JSON, such as {"rtol": 0.01}; a resumed run has the same ones."""
    software: Mapping[str, str] = field(default_factory=software_versions)
    arrays: Mapping[str, StoredArray] = field(default_factory=dict)
    """Further arrays with a value for each frame, by their paths in the file: "representations/drai/power"."""
    recording: Mapping[str, Any] | None = None
    """Specification of the recording in a data set, ready for JSON."""

    def __post_init__(self) -> None:
        names = [actor.name for actor in self.actors]
        if len(set(names)) != len(names):
            raise ValueError(f"actors are named {names}: each name may appear once")
        for name, label in self.labels.items():
            if not name or "/" in name or name in ("frame", *label.dims):
                raise ValueError(f"label {name!r}: a name without '/' that is no axis is needed")
            if "frame" in label.dims or len(set(label.dims)) != len(label.dims):
                raise ValueError(f"label '{name}' has dims {label.dims}: different names, without 'frame', are needed")
        for path in self.arrays:
            check_array_path(path)
        for name, seed in self.seeds.items():
            if seed is not None and (isinstance(seed, bool) or not isinstance(seed, int | np.integer)):
                raise TypeError(f"seeds['{name}'] is {seed!r}: a whole number or None is needed")
