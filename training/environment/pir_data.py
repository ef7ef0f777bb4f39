"""PIR data sets: shards in HDF5, and reading them.

A data set is a folder of `shard-00000.h5`, `shard-00001.h5`, …; each is complete or absent, and any subset of them is a
data set. :mod:`training.environment.render` writes them.

Attributes of a shard: `format` ("rfgen pir"), `version`, `kind` ("environment" or "pairs"), `seed`, `shard`, `places`
(their names), `command` (all settings as JSON).

Its data sets have named dimensions (`view`, `row`, `column`, …) and an attribute `units`. Row 0 is the top, column 0
the left side as the radar looks.

Images, (view, row, column):

- `energy` float32 [1]: \\|path gain\\|^2 for isotropic elements; 0 where nothing returns.
- `time_of_arrival` float32 [s]: round trip, weighted with energy; NaN where nothing returns (the sky).
- `velocity` float32 [m/s]: weighted with energy, receding is positive.
- `actor` uint8: whether a person is in front in the pixel's middle.
- in "pairs" also `energy_incomplete`, `time_of_arrival_incomplete`, `velocity_incomplete`: the same view with direct
  returns alone, default materials and some of the furniture missing; a person is the same in both. There `energy` and
  the other two are complete: all furniture, its own materials, and what smooth surfaces show a second time.

- `sketch_range`, `sketch_shell` float16 [m], `sketch_cosine` float16 [1], `sketch_place` float16 (view, row, column,
  axis), `sketch_kind` uint8 (255: nothing; else an index into its attribute `kinds`): the view of the layout built of
  bricks, :mod:`rfgen_sionna.generative.environment.layout_map`. People are not in it.

Of each view, (view,): `place` (index into `places`), `caption`, `objects` and `absent` (JSON lists of kinds of
furniture: in view, the largest first; usual there but not in this layout), `fov_deg` (view, 2) horizontal and vertical
[deg], `height` [m], `pitch` [rad] (positive looks down), `yaw` [rad] (positive is to the left), `roll` [rad],
`position` (view, 3) [m], `projection`, `layout` (the seed of `rfgen.furnished(place, seed=layout)`), `view_seed`,
`split` ("train", "validation", "test": a function of the layout alone, :func:`split_of`), `people`.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import h5py
import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import FloatArray, IntArray
from rfgen_sionna.generative.environment.layout_map import encode_layout_map, kind_numbers
from rfgen_sionna.pir.codec import PirCodec

FORMAT, VERSION = "rfgen pir", 3
PLACES = (
    "living room",
    "bedroom",
    "office",
    "lab",
    "corridor",
    "classroom",
    "garage",
    "street",
    "playground",
    "open field",
)
"""What `place` counts."""
Split = Literal["train", "validation", "test"]
SPLITS: tuple[Split, ...] = ("train", "validation", "test")
SHARES = (0.8, 0.1, 0.1)
"""Of the layouts, in the order of `SPLITS`."""

IMAGES: dict[str, str] = {"energy": "1", "time_of_arrival": "s", "velocity": "m/s"}
"""Image fields and their units."""
SKETCH: dict[str, tuple[str, str]] = {
    "sketch_range": ("float16", "m"),
    "sketch_shell": ("float16", "m"),
    "sketch_cosine": ("float16", "1"),
    "sketch_place": ("float16", "1"),
    "sketch_kind": ("uint8", "index into kinds"),
}
"""Image fields of the sketches, their type and unit."""
NO_KIND = 255
CONDITIONS: dict[str, tuple[str, str]] = {
    "place": ("uint8", "index into places"),
    "caption": ("text", ""),
    "objects": ("text", "JSON"),
    "absent": ("text", "JSON"),
    "fov_deg": ("float64", "deg"),
    "height": ("float64", "m"),
    "pitch": ("float64", "rad"),
    "yaw": ("float64", "rad"),
    "roll": ("float64", "rad"),
    "position": ("float64", "m"),
    "projection": ("text", ""),
    "layout": ("int64", "seed"),
    "view_seed": ("int64", "seed"),
    "split": ("text", ""),
    "people": ("uint8", "1"),
}
"""Fields of each view, their type and unit."""


class DataError(ValueError):
    """A data set cannot be read or written."""


def split_of(layout: int) -> Split:
    """Which split a layout belongs to, from its seed alone: the same in every data set.

    SplitMix64 spreads the seeds.
    """
    mask = (1 << 64) - 1
    z = (int(layout) + 0x9E3779B97F4A7C15) & mask
    z = ((z ^ (z >> 30)) * 0xBF58476D1CE4E5B9) & mask
    z = ((z ^ (z >> 27)) * 0x94D049BB133111EB) & mask
    share = (z ^ (z >> 31)) / 2.0**64
    return "train" if share < SHARES[0] else "validation" if share < SHARES[0] + SHARES[1] else "test"


def shards(folder: Path | str) -> list[Path]:
    """The complete shards of a folder, in their order."""
    return sorted(Path(folder).glob("shard-[0-9][0-9][0-9][0-9][0-9].h5"))


@dataclass(frozen=True)
class PirData:
    """Views of a data set, or some of them: conditions in memory, images read when asked for."""

    folder: Path
    kind: str
    """"environment" or "pairs"."""
    resolution: tuple[int, int]
    """(rows, columns)"""
    places: IntArray
    """(view,) index into :data:`PLACES`."""
    captions: list[str]
    objects: list[list[str]]
    """Kinds of furniture in view, the largest first."""
    absent: list[list[str]]
    """Kinds usual in such a place that this layout doesn't have."""
    fov_deg: FloatArray
    """(view, 2) horizontal, vertical."""
    height: FloatArray
    """(view,) of the radar [m]."""
    pitch: FloatArray
    """(view,) [rad], positive looks down."""
    yaw: FloatArray
    """(view,) [rad], positive is to the left."""
    roll: FloatArray
    """(view,) [rad]"""
    position: FloatArray
    """(view, 3) [m]"""
    projection: list[str]
    layout: IntArray
    """(view,) seed of the layout; together with the place it names one scene."""
    split: list[str]
    people: IntArray
    """(view,) how many."""
    where: IntArray
    """(view, 2) shard and row within it."""
    files: tuple[Path, ...]

    @classmethod
    def open(cls, folder: Path | str) -> PirData:
        """Read the conditions of all shards.

        Raises
        ------
        DataError
            There is no such folder, it holds no shards, or one of them is something else.
        """
        files = tuple(shards(folder))
        if not files:
            raise DataError(f"{str(folder)!r} holds no shards of a PIR data set (shard-00000.h5, …)")
        columns: dict[str, list[Any]] = {name: [] for name in CONDITIONS}
        where, kinds = [], set()
        for number, file in enumerate(files):
            with _opened(file) as shard:
                kinds.add((str(shard.attrs["kind"]), *shard["energy"].shape[1:]))
                names = [str(name) for name in shard.attrs["places"]]
                for name, (kind, _) in CONDITIONS.items():
                    values = shard[name].asstr()[()] if kind == "text" else shard[name][()]
                    if name == "place":
                        values = np.array([PLACES.index(names[i]) for i in values])
                    columns[name].append(values)
                where += [(number, row) for row in range(len(shard["energy"]))]
        if len(kinds) > 1:
            raise DataError(f"{str(folder)!r} mixes data sets (kind, rows, columns): {sorted(kinds)}; separate them")
        joined = {name: np.concatenate(values) for name, values in columns.items()}
        ((kind, rows, width),) = kinds
        return cls(
            folder=Path(folder),
            kind=kind,
            resolution=(rows, width),
            places=joined["place"],
            captions=joined["caption"].tolist(),
            objects=[json.loads(text) for text in joined["objects"]],
            absent=[json.loads(text) for text in joined["absent"]],
            fov_deg=joined["fov_deg"],
            height=joined["height"],
            pitch=joined["pitch"],
            yaw=joined["yaw"],
            roll=joined["roll"],
            position=joined["position"],
            projection=joined["projection"].tolist(),
            layout=joined["layout"],
            split=joined["split"].tolist(),
            people=joined["people"],
            where=np.array(where),
            files=files,
        )

    def __len__(self) -> int:
        return len(self.where)

    def select(
        self, split: str | None = None, place: str | Iterable[str] | None = None, people: bool | None = None
    ) -> PirData:
        """The views of a split, of one or several places, with or without people.

        Raises
        ------
        DataError
            There is no such split or place.
        """
        keep = np.ones(len(self), dtype=np.bool_)
        if split is not None:
            if split not in SPLITS:
                raise DataError(f"split is {split!r}: allowed are {', '.join(SPLITS)}")
            keep &= np.array([each == split for each in self.split], dtype=np.bool_)
        if place is not None:
            wanted = [place] if isinstance(place, str) else list(place)
            if unknown := [name for name in wanted if name not in PLACES]:
                raise DataError(f"place is {unknown[0]!r}: allowed are {', '.join(PLACES)}")
            keep &= np.isin(self.places, [PLACES.index(name) for name in wanted])
        if people is not None:
            keep &= (self.people > 0) == people
        return self.take(np.flatnonzero(keep))

    def take(self, index: Sequence[int] | NDArray[np.intp]) -> PirData:
        """The views that `index` counts out, in its order."""
        chosen = np.asarray(index, dtype=np.intp)
        arrays = ("places", "fov_deg", "height", "pitch", "yaw", "roll", "position", "layout", "people", "where")
        lists = ("captions", "objects", "absent", "projection", "split")
        taken: dict[str, Any] = {name: getattr(self, name)[chosen] for name in arrays}
        taken |= {name: [getattr(self, name)[i] for i in chosen] for name in lists}
        return replace(self, **taken)

    def read(self, name: str, index: Any = slice(None)) -> NDArray[Any]:
        """(view, row, column) an image field of the views that `index` picks, in its order.

        Raises
        ------
        DataError
            The data set has no such field.
        """
        where = np.atleast_2d(self.where[index])
        out: NDArray[Any] | None = None
        for number in np.unique(where[:, 0]):
            mine = np.flatnonzero(where[:, 0] == number)
            rows = where[mine, 1]
            with _opened(self.files[number]) as shard:
                if name not in shard:
                    raise DataError(f"{self.files[number].name} (kind {self.kind!r}) has no field {name!r}")
                low, high = int(rows.min()), int(rows.max()) + 1
                block = shard[name][low:high]
            if out is None:
                out = np.empty((len(where), *block.shape[1:]), block.dtype)
            out[mine] = block[rows - low]
        return np.empty((0, *self.resolution), np.float32) if out is None else out

    def energy(self, index: Any = slice(None)) -> NDArray[np.float32]:
        """(view, row, column) [\\|path gain\\|^2]"""
        return self.read("energy", index)

    def time_of_arrival(self, index: Any = slice(None)) -> NDArray[np.float32]:
        """(view, row, column) [s], NaN where nothing returns."""
        return self.read("time_of_arrival", index)

    def velocity(self, index: Any = slice(None)) -> NDArray[np.float32]:
        """(view, row, column) [m/s]"""
        return self.read("velocity", index)

    def actor(self, index: Any = slice(None)) -> NDArray[np.uint8]:
        """(view, row, column) whether a person is in front."""
        return self.read("actor", index)

    def layout_maps(self, known: Sequence[str], codec: PirCodec, index: Any = slice(None)) -> NDArray[np.float32]:
        """(view, channel, row, column) sketches as a network is given them that knows some kinds of things."""
        reach, shell, cosine, place = (self.read(name, index).astype(np.float64) for name in list(SKETCH)[:4])
        kind = self.read("sketch_kind", index).astype(np.int64)
        which = np.atleast_2d(self.where[index])[:, 0]
        for number in np.unique(which):
            with _opened(self.files[number]) as shard:
                kinds = [str(name) for name in shard["sketch_kind"].attrs["kinds"]]
            table = np.zeros(NO_KIND + 1, np.int64)
            table[: len(kinds)] = kind_numbers(kinds, known)
            kind[which == number] = table[kind[which == number]]
        return encode_layout_map(reach, shell, cosine, place, kind, codec)

    def incomplete(self, index: Any = slice(None)) -> tuple[NDArray[np.float32], ...]:
        """Energy, time of arrival and velocity of the incomplete renders of "pairs"."""
        return tuple(self.read(f"{name}_incomplete", index) for name in IMAGES)


def _opened(file: Path) -> h5py.File:
    try:
        shard = h5py.File(file, "r")
    except OSError as error:
        raise DataError(f"{file.name} cannot be read: {error}") from error
    if shard.attrs.get("format") != FORMAT or shard.attrs.get("version") != VERSION:
        found = shard.attrs.get("format"), shard.attrs.get("version")
        shard.close()
        raise DataError(f"{file.name} is {found}, a shard ({FORMAT!r}, {VERSION}) is needed")
    return shard
