"""Writing a PIR data set: what each view is follows from the settings alone, and shards are written whole."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import lru_cache
from pathlib import Path
from typing import Any, Literal

import h5py
import numpy as np
from numpy.typing import NDArray

from rfgen_sionna.generative.environment.layout_map import render_layout_map
from rfgen_sionna.generative.environment.primitives import PrimitiveScene
from rfgen_sionna.generative.environment.viewpoints import (
    MAX_ATTEMPTS,
    PlaceRenderer,
    Viewpoint,
    ViewpointRanges,
    choose_viewpoint,
)
from rfgen_sionna.pir.projection import check_fov
from rfgen_sionna.radar import Radar
from rfgen_sionna.records import Pir
from rfgen_sionna.scene.furnished import FurnishedScene, Layout, furnished
from rfgen_sionna.scene.furnished.layout import Ground
from rfgen_sionna.scene.mesh_actor import MeshActor
from training.environment.pir_data import (
    CONDITIONS,
    FORMAT,
    IMAGES,
    NO_KIND,
    PLACES,
    SKETCH,
    VERSION,
    DataError,
    split_of,
)
from training.environment.place_captions import absent, caption

Kind = Literal["environment", "pairs"]
PER_SHARD = 16
"""Layouts of a shard."""
LAYOUTS = 1_000_000
"""Seeds of the layouts of one data set: those of another seed don't overlap."""
BODIES = ("a person standing", "a tall man walking", "a woman doing jumping jacks", "a person raising the left arm")
PERSON_WIDTH = 0.9
"""Edge of the floor area of a person [m]."""
MISSING = (0.15, 0.5)
"""Share of the furniture that an incomplete render lacks."""


@dataclass(frozen=True)
class Settings:
    """What a data set is made from."""

    kind: Kind = "environment"
    seed: int = 0
    places: tuple[str, ...] = PLACES
    views: int = 4
    """Of each layout."""
    resolution: tuple[int, int] = (64, 64)
    """(rows, columns)"""
    people: float = 0.0
    """Share of the views with somebody in them."""
    ranges: ViewpointRanges = field(default_factory=ViewpointRanges)
    radar: str = "awr1843"
    """Whose band counts."""

    def __post_init__(self) -> None:
        if self.kind not in ("environment", "pairs"):
            raise DataError(f"kind is {self.kind!r}: allowed are 'environment' and 'pairs'")
        if unknown := [name for name in self.places or ("nothing",) if name not in PLACES]:
            raise DataError(f"places holds {unknown[0]!r}: allowed are {', '.join(PLACES)}")
        if not 0.0 <= self.people <= 1.0:
            raise DataError(f"people is {self.people}: a share of 0 … 1 is needed")
        if self.views < 1 or not all(4 <= n <= 1024 for n in self.resolution):
            raise DataError(f"views is {self.views}, resolution {self.resolution}: at least 1, and 4 … 1024 are needed")
        if self.seed < 0:
            raise DataError(f"seed is {self.seed}: at least 0 is needed")
        for projection in self.ranges.projections:
            check_fov(self.ranges.fov_deg[1], projection, self.resolution)

    @property
    def per_shard(self) -> int:
        """Views of a whole shard."""
        return PER_SHARD * self.views

    def command(self) -> str:
        """All of it as JSON."""
        return json.dumps(asdict(self), sort_keys=True)


def shard_file(folder: Path, number: int) -> Path:
    return folder / f"shard-{number:05d}.h5"


def write_shard(folder: Path, settings: Settings, number: int, count: int) -> int:
    """Render the first `count` views of shard `number` and write them; how many there are.

    The file appears when it is complete.
    """
    views: list[dict[str, Any]] = []
    layout = 0
    while len(views) < count:
        views += render_layout(settings, number * PER_SHARD + layout, min(settings.views, count - len(views)))
        layout += 1
    file = shard_file(folder, number)
    partial = file.with_name(f".{file.name}.{os.getpid()}.part")
    try:
        with h5py.File(partial, "w") as out:
            out.attrs.update(
                format=FORMAT,
                version=VERSION,
                kind=settings.kind,
                seed=settings.seed,
                shard=number,
                places=list(PLACES),
                command=settings.command(),
            )
            kinds = sorted({kind for view in views for kind in np.unique(view["sketch_kind"]).tolist()} - {""})
            for view in views:
                view["sketch_kind"] = _numbered(view["sketch_kind"], kinds)
            for name in views[0]:
                _write(out, name, [view[name] for view in views])
            out["sketch_kind"].attrs["kinds"] = kinds
        partial.replace(file)
    finally:
        partial.unlink(missing_ok=True)
    return len(views)


def _write(out: h5py.File, name: str, values: list[Any]) -> None:
    if name in CONDITIONS:
        kind, unit = CONDITIONS[name]
        data = np.array(values, dtype=object) if kind == "text" else np.array(values, dtype=kind)
        item = out.create_dataset(name, data=data, dtype=h5py.string_dtype() if kind == "text" else None)
        labels = ["view", *{"fov_deg": ["axis"], "position": ["coordinate"]}.get(name, [])]
    else:
        unit = IMAGES.get(name.removesuffix("_incomplete"), "1")
        data = np.stack(values)
        if name in SKETCH:
            kind, unit = SKETCH[name]
            data = data.astype(kind)
        item = out.create_dataset(name, data=data, chunks=(1, *data.shape[1:]), compression="gzip", shuffle=True)
        labels = ["view", "row", "column", "axis"][: data.ndim]
    item.attrs["units"] = unit
    for axis, label in enumerate(labels):
        item.dims[axis].label = label


def _numbered(kinds: NDArray[np.str_], known: Sequence[str]) -> NDArray[np.uint8]:
    """Indices into `known`; NO_KIND for nothing."""
    if len(known) >= NO_KIND:
        raise DataError(f"{len(known)} kinds of things in a shard: less than {NO_KIND} are needed")
    values, where = np.unique(kinds, return_inverse=True)
    table = np.array([known.index(kind) if kind else NO_KIND for kind in values.tolist()], np.uint8)
    return table[where].reshape(kinds.shape)


def render_layout(settings: Settings, number: int, views: int) -> list[dict[str, Any]]:
    """The views of the data set's layout `number`, as fields by name."""
    place = settings.places[number % len(settings.places)]
    layout = settings.seed * LAYOUTS + number
    radar = Radar.load(settings.radar)
    scene = furnished(place, layout, radar.center_frequency)
    scene.frequency = radar.center_frequency  # what the materials' sources cover is told once, not for each layout
    renderer, rng = PlaceRenderer(scene, radar), np.random.default_rng([layout, 1])
    built = PrimitiveScene.of(scene)
    coarse = PlaceRenderer(coarse_model(scene, rng, MISSING), radar) if settings.kind == "pairs" else None
    found = []
    for view in range(views):
        view_seed = settings.views * layout + view
        rng = np.random.default_rng([view_seed, 2])
        viewpoint = choose_viewpoint(renderer, rng, settings.ranges)
        here, there, people = renderer, coarse, 0
        if rng.random() < settings.people and (spot := place_person(renderer, viewpoint, rng)) is not None:
            actor = _person(rng, spot)
            here, people = PlaceRenderer(scene, radar, [actor]), 1
            there = PlaceRenderer(coarse.scene, radar, [actor]) if coarse is not None else None
        fields = _fields(settings, here, there, viewpoint, people, view_seed, np.random.default_rng([view_seed, 3]))
        found.append(fields | _layout_map_fields(built, viewpoint, settings.resolution))
    return found


def _fields(
    settings: Settings,
    renderer: PlaceRenderer,
    coarse: PlaceRenderer | None,
    viewpoint: Viewpoint,
    people: int,
    view_seed: int,
    rng: np.random.Generator,
) -> dict[str, Any]:
    rows, columns = settings.resolution
    scene = renderer.scene
    objects, _ = renderer.first_hits(viewpoint, rows, columns)
    seen = renderer.in_view(objects)
    t = float(rng.uniform(0.3, 2.5))
    pir = renderer.render(viewpoint, settings.resolution, 1 if coarse is None else 2, t)
    place = scene.layout.place
    fields: dict[str, Any] = {
        **_images(pir, ""),
        "actor": (objects >= len(scene.kinds)).reshape(rows, columns).astype(np.uint8),
        "place": PLACES.index(place),
        "caption": caption(place, seen, rng, people),
        "objects": json.dumps(seen),
        "absent": json.dumps(absent(place, [*scene.layout.kinds, *scene.kinds])),
        "fov_deg": pir.fov_deg,
        "height": viewpoint.position[2],
        "pitch": viewpoint.pitch,
        "yaw": viewpoint.yaw,
        "roll": viewpoint.roll,
        "position": viewpoint.position,
        "projection": pir.projection,
        "layout": scene.layout.seed,
        "view_seed": view_seed,
        "split": split_of(scene.layout.seed),
        "people": people,
    }
    if coarse is not None:
        fields.update(_images(coarse.render(viewpoint, settings.resolution, 1, t), "_incomplete"))
    return fields


def _layout_map_fields(place: PrimitiveScene, viewpoint: Viewpoint, resolution: tuple[int, int]) -> dict[str, Any]:
    layout_map = render_layout_map(place, viewpoint.view(resolution))
    return {
        "sketch_range": layout_map.range,
        "sketch_shell": layout_map.shell,
        "sketch_cosine": layout_map.cosine,
        "sketch_place": layout_map.place,
        "sketch_kind": np.array([*place.kinds, ""])[layout_map.piece],
    }


def _images(pir: Pir, suffix: str) -> dict[str, Any]:
    return {name + suffix: getattr(pir, name).astype(np.float32) for name in IMAGES}


@lru_cache(maxsize=len(BODIES))
def _body(number: int) -> Any:
    """The mesh sequence of one of the bodies; building one takes seconds."""
    from rfgen_sionna.generative.actor import Actor as Person

    return Person.from_prompt(BODIES[number], seed=number, duration=3.0, position=(0, 0, 0)).sequence


def _person(rng: np.random.Generator, spot: tuple[float, float]) -> MeshActor:
    sequence = _body(int(rng.integers(len(BODIES))))
    return MeshActor(
        sequence,
        "skin",
        name="person",
        position=(*spot, 0.0),
        orientation=(float(rng.uniform(-np.pi, np.pi)), 0.0, 0.0),
    )


def check_folder(folder: Path, settings: Settings) -> None:
    """Make sure that what is in a folder was made with the same settings.

    Raises
    ------
    DataError
        It was not.
    """
    for file in sorted(folder.glob("shard-*.h5"))[:1]:
        with h5py.File(file) as shard:
            made = str(shard.attrs.get("command", ""))
        if not made or _complete(made) != _complete(settings.command()):
            raise DataError(
                f"{file} was made with other settings:\n  {made}\nnot with\n  {settings.command()}\n"
                "choose another --out, or the same options (a larger --count goes on)"
            )


def _complete(command: str) -> dict[str, Any]:
    """What a file's settings say; those that are younger than it have their defaults."""
    said: dict[str, Any] = json.loads(command)
    usual: dict[str, Any] = json.loads(Settings().command())
    return {**usual, **said, "ranges": {**usual["ranges"], **said.get("ranges", {})}}


def coarse_model(scene: FurnishedScene, rng: np.random.Generator, missing: tuple[float, float]) -> FurnishedScene:
    """A furnished place without a random share (between two limits) of its furniture, of smooth concrete and wood."""
    layout = scene.layout
    count = round(float(rng.uniform(*missing)) * len(layout.items))
    gone = set(rng.choice(len(layout.items), count, replace=False).tolist()) if count else set()
    kept = tuple(item for i, item in enumerate(layout.items) if i not in gone)
    parts = [
        (kind, name, part.of("plain concrete" if owner < 0 else "plain wood"))
        for (kind, name, part), owner in zip(scene.parts, scene.owners, strict=True)
        if owner not in gone
    ]
    owners = [owner for owner in scene.owners if owner not in gone]
    return FurnishedScene(replace(layout, items=kept), parts, owners, scene.surface_frequency)


def _is_clear(layout: Layout, ground: Ground) -> bool:
    """Whether a box lies within the place and overlaps no piece."""
    low, high = ground.corners.min(axis=0), ground.corners.max(axis=0)
    if low[0] < layout.x[0] or high[0] > layout.x[1] or low[1] < layout.y[0] or high[1] > layout.y[1]:
        return False
    return not any(ground.meets(item.ground) for item in layout.items)


def place_person(renderer: PlaceRenderer, viewpoint: Viewpoint, rng: np.random.Generator) -> tuple[float, float] | None:
    """A free spot on the floor in view of the radar (x, y) [m], or None."""
    layout = renderer.scene.layout
    for _ in range(MAX_ATTEMPTS):
        distance = rng.uniform(1.3, 5.0)
        angle = viewpoint.yaw + np.radians(viewpoint.fov_deg) * rng.uniform(-0.35, 0.35)
        x, y = viewpoint.position[0] + distance * np.cos(angle), viewpoint.position[1] + distance * np.sin(angle)
        spot = Ground(x, y, PERSON_WIDTH, PERSON_WIDTH, 0.0, 0.05, 2.0)
        if not _is_clear(layout, spot):
            continue
        head = np.array([[x, y, 1.3], [x, y, 0.6]])
        if not renderer.rays.occluded(viewpoint.position, head).any():
            return float(x), float(y)
    return None
