"""What one recording of a data set is made of, every choice already drawn."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any, Literal

from rfgen_sionna.tolerance import DEFAULT_RTOL

SourceKind = Literal["prompt", "clip", "joints", "mesh"]
Point = tuple[float, float, float]

DEFAULT_KEEP = ("adc", "body", "joints", "labels")
"""What is kept of a recording by default."""
FREE_SPACE = "free space"
"""Name of the place without surroundings."""


@dataclass(frozen=True)
class SourceSpec:
    """One source of moving bodies: a prompt, or a file."""

    kind: SourceKind
    """"prompt"; "clip", a file of poses; "joints", joint positions; "mesh", a rigid mesh."""
    text: str = ""
    """The prompt; for a clip or joints the words about body, distance and orientation, without an action."""
    file: str | None = None
    """Name of a shipped clip; or absolute path of a clip, of joint positions or of a mesh."""
    options: Mapping[str, Any] = field(default_factory=dict)
    """Of files: `action`, `up`, `frame_rate` [Hz], `layout`; of meshes `material`, `position_m`, `velocity_m_s`."""


@dataclass(frozen=True)
class BodySpec:
    """Body of one person: the seed draws what is None and the words leave open."""

    seed: int
    """Seed of the body."""
    gender: str | None = None
    """"male" or "female"."""
    age_years: float | None = None
    """Age [years]."""
    height_m: float | None = None
    """Stature [m]."""
    weight_kg: float | None = None
    """Mass [kg]."""
    muscle: float | None = None
    """0 (frail) to 1 (very muscular)."""


@dataclass(frozen=True)
class RadarSpec:
    """One radar of a recording."""

    name: str
    """Name in the run; empty for the only one."""
    radar: str
    """Name of a shipped radar, or absolute path of its file."""
    preset: str | None = None
    """Preset; None is the radar's default."""
    board: str | None = None
    """Board of a vendor's configuration file that names none."""
    position_m: Point = (0.0, 0.0, 1.0)
    """Position [m]."""
    look_at_m: Point | None = None
    """Point on the boresight [m]; None is along +x."""


@dataclass(frozen=True)
class RecordingSpec:
    """One recording of a data set: all that :func:`~rfgen_sionna.recipes.making.make_recording` needs."""

    number: int
    """Number in the set, from 0."""
    attempt: int
    """Number of draws before this one that could not be made."""
    split: str
    """Name of its split."""
    seed: int
    """Seed of noise and of the speckle of rough surfaces."""
    motion_seed: int
    """Seed of the motions, and of what the words leave open."""
    place: str
    """Surroundings, as of :func:`~rfgen_sionna.pipeline.generate`; of a scene's file its name; `FREE_SPACE` is none."""
    place_seed: int
    """Seed of the furniture of a place."""
    bodies: tuple[BodySpec, ...]
    """Body of each person, in the order of the sources and of the people in a prompt; its attributes take precedence
    over the words."""
    sources: tuple[SourceSpec, ...]
    """What moves: prompts and clips before the first radar, meshes where they are put."""
    radars: tuple[RadarSpec, ...]
    """Radars that record the same scene."""
    duration_s: float
    """Length [s]."""
    distance_m: float | None = None
    """Horizontal distance of the (first) person from the first radar [m]; None leaves it to the prompt."""
    azimuth_deg: float | None = None
    """Azimuth of the person from the boresight, positive to the radar's left [degrees]; None leaves it to the prompt.
    """
    orientation_deg: float | None = None
    """Orientation, 0 faces the radar [degrees]; None leaves it to the prompt."""
    receiver: Mapping[str, Any] | None = None
    """Table of the receiver's impairments; None is thermal noise and the radar's own ADC."""
    noise: bool = True
    """Whether thermal noise is added."""
    rtol: float = DEFAULT_RTOL
    """Tolerated relative error of each return (:mod:`rfgen_sionna.tolerance`)."""
    max_bounces: int = 1
    """Largest number of surfaces on a path."""
    transmission: bool = False
    """Whether walls and glass transmit."""
    collisions: Literal["error", "warn", "ignore"] = "error"
    """Policy for people in walls or furniture."""
    outside: Literal["error", "ignore"] = "error"
    """Policy for actors beyond the radar's range window."""
    motion: str = "auto"
    """Source of the motion of prompts: "auto", "kinematic" or "diffusion"."""
    pir_resolution: tuple[int, int] | None = None
    """Rows and columns of stored images; None is the default."""
    fov_deg: float | None = None
    """Field of view of stored images [degrees]; None is the default."""
    keep: tuple[str, ...] = DEFAULT_KEEP
    """What is kept."""
    place_file: str | None = None
    """Absolute path of a scene that a file gives, on this machine: no recording stores it."""

    @property
    def name(self) -> str:
        """Name of the recording in a shard."""
        return f"{self.number:06d}"

    @property
    def prompt(self) -> str:
        """Words of all sources: the prompts, and the names of files."""
        return "; ".join(source.text or (source.file or "") for source in self.sources)

    def to_dict(self) -> dict[str, Any]:
        """The record as JSON holds it; :meth:`from_dict` undoes it."""
        return asdict(self)

    @classmethod
    def from_dict(cls, values: Mapping[str, Any]) -> RecordingSpec:
        """The record of such a dictionary, also after JSON has made lists of its tuples.

        Raises:
            ValueError: the dictionary is of no recording.
        """
        try:
            given = dict(values)
            given["sources"] = tuple(SourceSpec(**source) for source in given["sources"])
            given["bodies"] = tuple(BodySpec(**body) for body in given["bodies"])
            given["radars"] = tuple(RadarSpec(**_with_tuples(radar)) for radar in given["radars"])
            given["keep"] = tuple(given["keep"])
            if given.get("pir_resolution") is not None:
                given["pir_resolution"] = tuple(given["pir_resolution"])
            return cls(**given)
        except (TypeError, KeyError, AttributeError) as error:
            raise ValueError(f"recording: {error}: a record of `RecordingSpec.to_dict` is needed") from None


def _with_tuples(values: Mapping[str, Any]) -> dict[str, Any]:
    return {key: tuple(value) if isinstance(value, list) else value for key, value in values.items()}
