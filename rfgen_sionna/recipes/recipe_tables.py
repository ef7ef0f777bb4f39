"""Tables and keys of a recipe, with their types, bounds and defaults."""

from __future__ import annotations

import re
from typing import Annotated, Any, Literal

from annotated_types import Len
from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, model_validator

from rfgen_sionna.dataset.set_index import NAME_FORM
from rfgen_sionna.generative.motion.kinematic import MAX_DURATION
from rfgen_sionna.recipes.recording_spec import DEFAULT_KEEP, FREE_SPACE
from rfgen_sionna.recipes.value_forms import ValueForm, form_type
from rfgen_sionna.tolerance import DEFAULT_RTOL, Rtol

MAX_COUNT = 1_000_000
"""Most recordings of a set."""
MAX_PEOPLE = 6
"""Most actors of a recording."""
MAX_TEXT = 2_000
"""Most characters of a text in a recipe."""
MAX_RADARS = 8
"""Most radars of a recording."""
BYTES: dict[str, float] = {"B": 1, "kB": 1e3, "MB": 1e6, "GB": 1e9, "KiB": 2**10, "MiB": 2**20, "GiB": 2**30}
"""Units of sizes [bytes]."""
_SIZE = re.compile(r"\s*(\d{1,9}(?:\.\d{1,9})?)\s*([A-Za-z]{1,3})\s*")


def _bytes(value: Any) -> Any:
    match = _SIZE.fullmatch(value) if isinstance(value, str) else None
    if match is None or match[2] not in BYTES:
        raise ValueError(f'a size with a unit ({", ".join(BYTES)}) is needed, such as "512 MB"')
    return float(match[1]) * BYTES[match[2]]


def _is_name(value: str) -> str:
    if not NAME_FORM.fullmatch(value):
        raise ValueError("a name of 1 to 40 letters, digits, - and _ is needed")
    return value


Text = Annotated[str, Len(1, MAX_TEXT)]
Name = Annotated[str, AfterValidator(_is_name)]
Seed = Annotated[int, Field(ge=0, lt=2**53)]
Positive = Annotated[float, Field(gt=0.0, le=1e6)]
Coordinate = Annotated[float, Field(ge=-1e6, le=1e6)]
Vector3 = Annotated[list[Coordinate], Len(3, 3)]
Pool = Annotated[int, Field(ge=1, le=MAX_COUNT)]
Size = Annotated[float, BeforeValidator(_bytes), Field(ge=1e6, le=1e12)]


class RecipeTable(BaseModel):
    """Base of all tables: no other keys, no conversions of types, no infinities."""

    model_config = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False)


class SourceTable(RecipeTable):
    """`[[sources]]`: one alternative of what moves; exactly one of `prompt`, `clip`, `joints` and `mesh`."""

    prompt: Text | None = None
    clip: Text | None = None
    """Name of a shipped clip (`rfgen motions`); or the file or folder of a motion, as of
    :meth:`~rfgen_sionna.generative.actor.Actor.from_motion`."""
    joints: Text | None = None
    """File of joint positions, as of :meth:`~rfgen_sionna.generative.actor.Actor.from_joints`."""
    mesh: Text | None = None
    """File of a rigid mesh."""
    action: Text | None = None
    """Action in the labels of a clip, joints or a mesh; left out, that of a shipped clip, or the name of a mesh's file.
    """
    weight: Annotated[float, Field(ge=0.0, le=1e9)] = 1.0
    """Weight among the sources."""
    words: Annotated[str, Len(0, MAX_TEXT)] = ""
    """Words about the person of a clip: body, distance, orientation."""
    up: Literal["x", "y", "z", "-x", "-y", "-z"] | None = None
    """Up axis of a file."""
    frame_rate: Positive | None = None
    """Frames per second of a clip or of joints [Hz]."""
    layout: Text | None = None
    """Layout of joints ("kinect_v2", "smpl22" …)."""
    scale: Positive | None = None
    """Metres per unit of joints."""
    material: Text | None = None
    """Material of a mesh."""
    position_m: Vector3 | None = None
    """Place of a mesh in the world [m]; left out, it is at the drawn distance and azimuth."""
    velocity_m_s: Vector3 | None = None
    """Velocity of a mesh [m/s]."""

    @model_validator(mode="after")
    def _of_one_kind(self) -> SourceTable:
        given = [name for name in SOURCE_OPTIONS if getattr(self, name) is not None]
        if len(given) != 1:
            found = " and ".join(given) or "none"
            raise ValueError(f"{found} given: exactly one of {', '.join(SOURCE_OPTIONS)} is needed")
        known = (*SOURCE_OPTIONS, "weight", *SOURCE_OPTIONS[given[0]])
        if idle := sorted(self.model_fields_set - set(known)):
            allowed = ", ".join(SOURCE_OPTIONS[given[0]]) or "weight alone"
            raise ValueError(f"{idle[0]} does not belong to a {given[0]}; it takes {allowed}")
        return self


SOURCE_OPTIONS: dict[str, tuple[str, ...]] = {
    "prompt": (),
    "clip": ("action", "words", "up", "frame_rate"),
    "joints": ("action", "up", "frame_rate", "layout", "scale"),
    "mesh": ("action", "material", "position_m", "velocity_m_s"),
}
"""Kind of a source -> keys that belong to it."""


class RadarTable(RecipeTable):
    """`[[radars]]`: one of several radars that record the same scene."""

    name: Name | None = None
    """Name in the runs; left out, that of the radar."""
    radar: Text
    """Name of a shipped radar, or path of a file, relative to the recipe."""
    preset: Text | None = None
    board: Text | None = None
    position_m: form_type(Vector3, ranges=True, points=True) = ValueForm("scalar", ([0.0, 0.0, 1.0],))  # type: ignore[valid-type]
    """Position [m]."""
    look_at_m: form_type(Vector3, ranges=True, points=True) | None = None  # type: ignore[valid-type]
    """Point on the boresight [m]; left out, along +x."""


class BodiesTable(RecipeTable):
    """`[bodies]`: who the people are."""

    pool: Pool | None = None
    """Number of different bodies; left out, everybody is somebody else."""
    gender: form_type(Literal["female", "male"]) | None = None  # type: ignore[valid-type]
    age_years: form_type(Annotated[float, Field(ge=2.0, le=100.0)], ranges=True) | None = None  # type: ignore[valid-type]
    height_m: form_type(Annotated[float, Field(ge=0.6, le=2.3)], ranges=True) | None = None  # type: ignore[valid-type]
    weight_kg: form_type(Annotated[float, Field(ge=8.0, le=250.0)], ranges=True) | None = None  # type: ignore[valid-type]
    muscle: form_type(Annotated[float, Field(ge=0.0, le=1.0)], ranges=True) | None = None  # type: ignore[valid-type]
    """0 (frail) to 1 (very muscular)."""


class SplitsTable(RecipeTable):
    """`[splits]`: shares of the splits, and what no two of them have in common."""

    shares: Annotated[dict[Name, Annotated[float, Field(gt=0.0, le=1.0)]], Len(1, 10)]
    by: Annotated[list[Literal["body", "place", "action", "seed"]], Len(0, 4)] = []

    @model_validator(mode="after")
    def _sums_to_one(self) -> SplitsTable:
        total = sum(self.shares.values())
        if abs(total - 1.0) > 1e-6:
            parts = " + ".join(f"{share:g}" for share in self.shares.values())
            raise ValueError(f"shares: {parts} is {total:g}: a sum of 1 is needed")
        return self


class RecipeTables(RecipeTable):
    """All keys of a recipe."""

    title: Annotated[str, Len(0, MAX_TEXT)] = ""
    description: Annotated[str, Len(0, 20 * MAX_TEXT)] = ""
    licence: Annotated[str, Len(0, MAX_TEXT)] = ""
    """Licence of the set, for its card."""
    count: Annotated[int, Field(ge=1, le=MAX_COUNT)] | None = None
    """Number of recordings; left out, once through the grids."""
    seed: Seed = 0
    """Seed of everything that is drawn."""
    attempts: Annotated[int, Field(ge=1, le=100)] = 10
    """Draws of a recording whose placement cannot be, before it is given up."""

    prompts: form_type(Text) | None = None  # type: ignore[valid-type]
    """What people, animals and things do."""
    sources: Annotated[list[SourceTable], Len(1, 10_000)] | None = None
    """Alternatives with files among them; instead of `prompts`."""
    people: form_type(Annotated[int, Field(ge=1, le=MAX_PEOPLE)]) = ValueForm("scalar", (1,))  # type: ignore[valid-type]
    """Number of sources in a recording."""
    bodies: BodiesTable = BodiesTable()
    motions: Pool | None = None
    """Number of different seeds of motion; left out, each recording has its own."""
    motion: Literal["auto", "kinematic", "diffusion"] = "auto"
    """Source of the motion of prompts."""

    places: form_type(Text) | None = None  # type: ignore[valid-type]
    """Surroundings; left out, those of the prompt, else free space."""
    layouts: Pool | None = None
    """Number of different layouts of each furnished place; left out, each recording has its own."""
    distance_m: form_type(Positive, ranges=True) | None = None  # type: ignore[valid-type]
    """Horizontal distance from the first radar [m]."""
    azimuth_deg: form_type(Annotated[float, Field(ge=-90.0, le=90.0)], ranges=True) | None = None  # type: ignore[valid-type]
    """Azimuth from the boresight, positive to the radar's left [degrees]."""
    orientation_deg: form_type(Annotated[float, Field(ge=-360.0, le=360.0)], ranges=True) | None = None  # type: ignore[valid-type]
    """Orientation, 0 faces the radar, positive towards the person's own left [degrees]."""
    duration_s: form_type(Annotated[float, Field(gt=0.0, le=MAX_DURATION)]) = ValueForm("scalar", (2.0,))  # type: ignore[valid-type]
    """Length of a recording [s]."""

    radar: Text | None = None
    """The only radar; `[[radars]]` are several."""
    preset: Text | None = None
    board: Text | None = None
    position_m: form_type(Vector3, ranges=True, points=True) | None = None  # type: ignore[valid-type]
    look_at_m: form_type(Vector3, ranges=True, points=True) | None = None  # type: ignore[valid-type]
    radars: Annotated[list[RadarTable], Len(1, MAX_RADARS)] | None = None
    receiver: form_type(dict[str, Any] | Text) | None = None  # type: ignore[valid-type]
    """Impairments of the receiver: a table, or the path of its file."""
    noise: bool = True
    rtol: Rtol = DEFAULT_RTOL
    max_bounces: Annotated[int, Field(ge=1, le=3)] = 1
    transmission: bool = False
    collisions: Literal["error", "warn", "ignore"] = "error"
    outside: Literal["error", "ignore"] = "error"

    keep: Annotated[list[Name], Len(1, 20)] = list(DEFAULT_KEEP)
    """What is stored of a recording; left out, meshes instead of bodies where no parameters rebuild them."""
    pir_resolution: Annotated[list[Annotated[int, Field(ge=1, le=1024)]], Len(2, 2)] | None = None
    """Rows and columns of images."""
    fov_deg: Annotated[float, Field(gt=0.0, lt=180.0)] | None = None
    """Field of view of images [degrees]."""
    shard_size: Size = 512e6
    """Bound of the size of a shard, of what is kept before compression."""
    splits: SplitsTable | None = None

    @model_validator(mode="after")
    def _of_one_list(self) -> RecipeTables:
        if self.prompts is not None and self.sources is not None:
            raise ValueError(
                "prompts and sources are both given, and one of them is needed: give each prompt a table of its own, "
                '[[sources]] with prompt = "…"'
            )
        return self


DEFAULT_PLACE = FREE_SPACE
"""Surroundings where neither recipe nor prompt names any."""
