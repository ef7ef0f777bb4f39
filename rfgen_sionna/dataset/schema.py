"""Contents of a run file: names, axes and units of format `rfgen-run`.

One HDF5 file holds one run, laid out as netCDF-4 does (dimension scales by name, units as attributes), so that
general tools open it. Complex samples are the compound (r, i) that h5py and NumPy share::

    /adc            (frame, chirp, tx, rx, sample) complex64 [sqrt(W)]
    /frame_time     (frame) start of each frame's first ramp [s]
    /chirp_time     (chirp, tx) start of each ramp after that [s]
    /sample_time    (sample) after the start of the ramp [s]; (tx, sample) where chirps of several kinds differ in it
    /tx_phase, /tx_advance  (tx, tx_element) where `tx` counts slots: phases of the Tx elements in them [degree]
    /pir/image      (frame, channel, row, column) float32; channel: energy, time_of_arrival [s], velocity [m s-1]
    /pir/...        time, position, orientation of the viewpoint per frame
    /actors/NAME/   vertices (frame, vertex, axis) [m], faces, face_part, joints (frame, joint, axis) [m]
    /labels/NAME    (frame, ...) as declared, with units

The attributes of the file say the prompt, what was made of it (report), the environment, the radar (JSON), seeds and
versions (JSON).

    >>> import xarray                                                           # doctest: +SKIP
    >>> run = xarray.open_dataset("jacks.h5", engine="h5netcdf")                # doctest: +SKIP
    >>> run.adc.sel(frame=3, tx="TX1").isel(rx=0)                               # doctest: +SKIP
    >>> images = xarray.open_dataset("jacks.h5", engine="h5netcdf", group="pir")  # doctest: +SKIP
    >>> everything = xarray.open_datatree("jacks.h5", engine="h5netcdf")        # doctest: +SKIP
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib.metadata import PackageNotFoundError, version
from typing import TYPE_CHECKING, Any

import numpy as np

from rfgen_sionna._types import IntArray

if TYPE_CHECKING:
    from rfgen_sionna.radar import Radar

FORMAT = "rfgen-run"
VERSION = "1.0"

PIR_CHANNELS: dict[str, str] = {"energy": "1", "time_of_arrival": "s", "velocity": "m s-1"}
"""Channels of a PIR image, in this order, with their units; energy is |path gain|²."""

AXES = ("x", "y", "z")

SOFTWARE = (
    "rfgen_sionna", "sionna-rt", "mitsuba", "drjit", "numpy", "scipy", "finufft", "trimesh", "anny", "torch", "h5py",
)  # fmt: skip
"""Distributions whose versions go into the file where they are installed."""


class RunFormatError(ValueError):
    """A file is not a run, or a run lacks something."""


def software_versions() -> dict[str, str]:
    """Installed versions of :data:`SOFTWARE`; nothing is imported for it."""
    found = {}
    for name in SOFTWARE:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            continue
    return found


@dataclass(frozen=True)
class Label:
    """Storage of one label: one value a frame with these further axes."""

    units: str = "1"
    """As UDUNITS writes them ("m s-1"); "1" for numbers without a unit; empty for text."""
    dims: tuple[str, ...] = ()
    """Axes beside frame: "actor" (as many as the run has), "axis" (x, y, z), or any other name of your own."""
    description: str = ""
    text: bool = False
    """Whether the values are texts."""


STANDARD_LABELS: dict[str, Label] = {
    "action": Label("", ("actor",), "what the actor does", text=True),
    "position": Label("m", ("actor", "axis"), "centre of the actor, world frame"),
    "velocity": Label("m s-1", ("actor", "axis"), "velocity of that point, world frame"),
    "orientation": Label("rad", ("actor",), "direction the actor faces: yaw in the world frame"),
    "distance": Label("m", ("actor",), "radar to the centre of the actor"),
    "radial_velocity": Label("m s-1", ("actor",), "rate of the distance; positive is receding"),
    "azimuth": Label("rad", ("actor",), "direction of the centre in the radar's frame; positive is left"),
    "elevation": Label("rad", ("actor",), "direction of the centre in the radar's frame; positive is up"),
}
"""Labels that this package writes; declare others beside them."""


@dataclass(frozen=True)
class ActorInfo:
    """Facts about an actor that stay the same during a run."""

    name: str
    material: str
    faces: IntArray
    """(face, 3) vertex indices."""
    num_vertices: int
    part_names: tuple[str, ...] = ("body",)
    face_parts: IntArray | None = None
    """(face,) index into `part_names`; None is all 0."""
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
        """From an :class:`rfgen_sionna.scene.MeshActor` (or anything with its attributes)."""
        return cls(
            name=actor.name,
            material=actor.properties.name,
            faces=actor.faces,
            num_vertices=len(actor.vertices(0.0)),
            part_names=tuple(actor.part_names),
            face_parts=actor.face_parts,
            joint_names=tuple(actor.joint_names),
        )


@dataclass(frozen=True)
class RunInfo:
    """Facts about a run before its first frame."""

    radar: Radar
    prompt: str = ""
    negative_prompt: str = ""
    environment: str = ""
    seeds: Mapping[str, int | None] = field(default_factory=dict)
    """Seed of each draw, for instance {"motion": 0, "noise": 1}; None where nothing was drawn."""
    actors: tuple[ActorInfo, ...] = ()
    labels: Mapping[str, Label] = field(default_factory=dict)
    report: str = ""
    """Interpretation of the prompt, and every decision with its origin; text of several lines."""
    receiver: Mapping[str, Any] | None = None
    """The receiver's record (`signal.receiver_record`), ready for JSON; None where there was none or nobody says."""
    software: Mapping[str, str] = field(default_factory=software_versions)

    def __post_init__(self) -> None:
        names = [actor.name for actor in self.actors]
        if len(set(names)) != len(names):
            raise ValueError(f"actors are named {names}: each name may appear once")
        for name, label in self.labels.items():
            if not name or "/" in name or name in ("frame", *label.dims):
                raise ValueError(f"label {name!r}: a name without '/' that is no axis is needed")
            if "frame" in label.dims or len(set(label.dims)) != len(label.dims):
                raise ValueError(f"label '{name}' has dims {label.dims}: different names, without 'frame', are needed")
        for name, seed in self.seeds.items():
            if seed is not None and (isinstance(seed, bool) or not isinstance(seed, int | np.integer)):
                raise TypeError(f"seeds['{name}'] is {seed!r}: a whole number or None is needed")
