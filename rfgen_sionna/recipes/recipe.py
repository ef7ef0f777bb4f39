"""A data set described once: what its recordings are drawn from, checked whole before anything runs."""

from __future__ import annotations

import hashlib
import json
import math
import tomllib
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna.recipes.partitions import WHOLE_SET, assigned, derived_seed, parts_of, stream
from rfgen_sionna.recipes.recipe_checks import check_recipe
from rfgen_sionna.recipes.recipe_contents import RecipeContents
from rfgen_sionna.recipes.recipe_error import RecipeError, faults_of
from rfgen_sionna.recipes.recipe_files import file_digests
from rfgen_sionna.recipes.recipe_places import Place, check_names, prompted_place, read_place
from rfgen_sionna.recipes.recipe_sources import Source, changes_freely, check_file, read_source, source_tables
from rfgen_sionna.recipes.recipe_tables import MAX_COUNT, RecipeTables
from rfgen_sionna.recipes.recipe_text import MAX_BYTES, raise_faults, read_tables
from rfgen_sionna.recipes.recording_sizes import recording_bytes
from rfgen_sionna.recipes.recording_spec import FREE_SPACE, BodySpec, RecordingSpec
from rfgen_sionna.recipes.set_radars import set_radars
from rfgen_sionna.recipes.split_pools import SplitPools, split_pools
from rfgen_sionna.recipes.stratified_draws import StratifiedDraws
from rfgen_sionna.recipes.value_forms import ValueForm

DRAWN = ("people", "distance_m", "azimuth_deg", "orientation_deg", "duration_s")
"""Keys whose values are drawn for each recording, in the order of their grids after prompts and places."""
_KEPT_ON_RETRY = ("people", "duration_s", "receiver")


@dataclass(frozen=True, eq=False, repr=False)
class Recipe(RecipeContents):
    """A checked recipe; :meth:`load` and :meth:`parse` make one.

    All that is drawn derives from the recipe's seed and a recording's number, so that neither order nor number of
    workers changes a recording. First attempts are stratified: each choice has its share in every split to within one
    recording, and ranges are covered evenly.
    """

    @classmethod
    def load(cls, path: str | PathLike[str], *, check: bool = True) -> Recipe:
        """The recipe of a file; paths in it are relative to its folder.

        Raises:
            RecipeError: as :meth:`parse`, or there is no such file.
        """
        file = Path(path)
        try:
            if file.is_file() and file.stat().st_size > MAX_BYTES:
                raise RecipeError(f"recipe '{file}' has {file.stat().st_size} bytes; allowed are {MAX_BYTES}")
            text = file.read_text(encoding="utf-8")
        except OSError as error:
            raise RecipeError(f"recipe '{file}' cannot be read: {error.strerror}") from None
        except UnicodeDecodeError:
            raise RecipeError(f"recipe '{file}' is no text in UTF-8") from None
        return cls.parse(text, file.resolve().parent, check=check)

    @classmethod
    def parse(cls, text: str, folder: str | PathLike[str] | None = None, *, check: bool = True) -> Recipe:
        """The recipe of a text.

        Args:
            text: TOML, with the keys of :class:`~rfgen_sionna.recipes.recipe_tables.RecipeTables`.
            folder: folder of relative paths; without one they are refused.
            check: whether radars, receivers, files, distances and places are checked; False is for a text that was.

        Raises:
            RecipeError: the recipe cannot be made; the message names the key, its value and what is allowed.
        """
        tables = read_tables(text)

        def located(name: str) -> Path:
            file = Path(name).expanduser()
            if not file.is_absolute():
                if folder is None:
                    raise RecipeError(
                        f"'{name}' is a relative path, and the recipe has no folder; give an absolute one"
                    )
                file = Path(folder).resolve() / file
            return file

        longest = max(tables.duration_s.values)
        sources, faults = [], []
        for key, table in source_tables(tables):
            try:
                with faults_of(key):
                    sources.append(read_source(table, located, tables.motion, longest))
            except RecipeError as error:
                faults.append(str(error))
        raise_faults(faults)
        if not sources:
            raise RecipeError('prompts is missing: what moves, such as prompts = ["a person waves"], is needed')
        if "keep" not in tables.model_fields_set and any(map(changes_freely, sources)):
            kept = ["vertices" if name == "body" else name for name in tables.keep]
            tables = tables.model_copy(update={"keep": kept})
        places = _places(tables, sources, located)
        with faults_of("receiver"):
            receivers = _receivers(tables, located)
        recipe = cls(text, tables, tuple(sources), places, set_radars(tables, located), receivers)
        _ = recipe.count, recipe._pools, recipe.recordings_per_shard
        if check:
            recipe._check_splits()
            check_recipe(recipe)
        return recipe

    @cached_property
    def count(self) -> int:
        """Number of recordings."""
        if self.tables.count is not None:
            return self.tables.count
        cells = math.prod(size for _, size in self._grids(self.splits[0]))
        if cells < 2 or self.tables.splits is not None:
            raise RecipeError("count is missing: the number of recordings, such as count = 100, is needed")
        if cells > MAX_COUNT:
            raise RecipeError(f"the grids have {cells} cells; allowed are {MAX_COUNT}: give a count")
        return cells

    @cached_property
    def digest(self) -> str:
        """SHA-256 of all keys but title, description and licence, and of the contents of all files they lead to.

        Sources and their folders, radars, boards, receivers and scenes count, wherever their files lie
        (:func:`~rfgen_sionna.recipes.recipe_files.file_digests`). RecipeError if one cannot be read.
        """
        keys = self.tables.model_dump(exclude={"title", "description", "licence"}, warnings=False)
        contents = [keys, self.receivers, file_digests(self)]
        return hashlib.sha256(json.dumps(contents, sort_keys=True, default=_plain).encode()).hexdigest()

    @cached_property
    def recordings_per_shard(self) -> int:
        """Number of recordings of a shard, by the recipe alone."""
        return max(1, int(self.tables.shard_size // recording_bytes(self)))

    @property
    def splits(self) -> tuple[str, ...]:
        """Names of the splits; "all" without any."""
        return tuple(self._pools)

    @cached_property
    def _pools(self) -> dict[str, SplitPools]:
        return split_pools(self.tables, self.sources, self.places)

    @cached_property
    def _assigned(self) -> tuple[NDArray[Any], NDArray[Any]]:
        return assigned(self.count, self._shares, stream(self.tables.seed, "splits"))

    @cached_property
    def _sizes(self) -> dict[str, int]:
        return parts_of(self.count, self._shares)

    @property
    def _shares(self) -> Mapping[str, float]:
        return {WHOLE_SET: 1.0} if self.tables.splits is None else self.tables.splits.shares

    def _check_splits(self) -> None:
        for name, size in self._sizes.items():
            if size == 0:
                raise RecipeError(f"splits.shares: '{name}' would be empty with {self.count} recordings: give more")
        most = max(max(source.people for source in self.sources), max(self.tables.people.values))
        for name, pools in self._pools.items():
            if pools.bodies is not None and len(pools.bodies) < most and any(each.people for each in self.sources):
                raise RecipeError(
                    f"bodies.pool is {self.tables.bodies.pool}: split '{name}' has {len(pools.bodies)} of them, and "
                    f"recordings have {most} people: give more, or leave the pool out"
                )

    def split_of(self, number: int) -> str:
        """Name of the split of a recording."""
        return self.splits[int(self._assigned[0][number])]

    def __len__(self) -> int:
        return self.count

    def __iter__(self) -> Iterator[RecordingSpec]:
        return map(self.recording, range(self.count))

    def recording(self, number: int, attempt: int = 0) -> RecordingSpec:
        """What a recording is made of.

        Args:
            number: its number, from 0.
            attempt: number of draws before this one that could not be made. Split, sources, kind of place, duration
                and all grids stay; bodies, seeds, layouts, distances and angles are drawn again.

        Raises:
            IndexError: there is no such recording.
            ValueError: the attempt is negative.
        """
        if not 0 <= number < self.count:
            raise IndexError(f"recording {number}: the set has 0 to {self.count - 1}")
        if attempt < 0:
            raise ValueError(f"attempt is {attempt}: at least 0 is needed")
        tables, name = self.tables, self.split_of(number)
        pools, rank = self._pools[name], int(self._assigned[1][number])
        cells = self._cells(name, rank)
        draws = StratifiedDraws(tables.seed, number, attempt, name, rank, self._sizes[name])
        first = replace(draws, attempt=0)

        def value(key: str, form: ValueForm[Any] | None) -> Any:
            if form is None or form.is_fixed:
                return None if form is None else form.values[0]
            return form.draw(first if key in _KEPT_ON_RETRY else draws, key, cells.get(key, 0))

        def placed(key: str) -> float | None:
            """What the words say goes before what is drawn; of several actors, the azimuth is that of their middle."""
            alone = len(sources) == 1 and len(sources[0].actions) == 1
            if all(key in each.own_place for each in sources) and (alone or key != "azimuth_deg"):
                said = {each.own_place[key] for each in sources}
                return said.pop() if len(said) == 1 and (alone or key == "distance_m") else None
            drawn: float | None = value(key, getattr(tables, key))
            return drawn

        def seed(key: str) -> int:
            return derived_seed(tables.seed, number, attempt, key)

        people = value("people", tables.people)
        sources = [
            self.sources[pools.sources.draw(first.even(f"source {index}"), cells.get("prompts", 0))[0]]
            for index in range(people)
        ]
        if tables.places is None:
            place = next((prompted_place(each.surroundings) for each in sources if each.surroundings), self.places[0])
            of_layout = first.even("layout")
        else:
            index, of_layout = pools.places.draw(first.even("place"), cells.get("places", 0))
            place = self.places[index]
        layouts = pools.layouts.get(place.name)
        if layouts is None:
            place_seed = seed("place seed")
        else:
            number_of_layout = draws.even("layout") if attempt else of_layout
            place_seed = self.layout_seed(place.name, _member(layouts, number_of_layout))
        if pools.motions is None:
            motion_seed = seed("motion")
        else:
            motion_seed = derived_seed(tables.seed, "motion", _member(pools.motions, draws.even("motion")))
        return RecordingSpec(
            number=number,
            attempt=attempt,
            split=name,
            seed=seed("noise"),
            motion_seed=motion_seed,
            place=place.name,
            place_file=place.file,
            place_seed=place_seed,
            bodies=self._bodies(pools, sum(each.people for each in sources), draws, seed("bodies")),
            sources=tuple(each.spec for each in sources),
            radars=tuple(each.spec(value) for each in self.radars),
            duration_s=value("duration_s", tables.duration_s),
            distance_m=placed("distance_m"),
            azimuth_deg=placed("azimuth_deg"),
            orientation_deg=placed("orientation_deg"),
            receiver=value("receiver", self.receivers),
            noise=tables.noise,
            rtol=tables.rtol,
            max_bounces=tables.max_bounces,
            transmission=tables.transmission,
            collisions=tables.collisions,
            outside=tables.outside,
            motion=tables.motion,
            pir_resolution=None if tables.pir_resolution is None else (*tables.pir_resolution,),  # type: ignore[arg-type]
            fov_deg=tables.fov_deg,
            keep=tuple(tables.keep),
        )

    def _bodies(self, pools: SplitPools, people: int, draws: StratifiedDraws, seed: int) -> tuple[BodySpec, ...]:
        """Different people: the pool has as many."""
        if pools.bodies is None:
            return tuple(
                self._body(derived_seed(seed, index, "body"), draws, f"body {index} ") for index in range(people)
            )
        found, left = [], pools.bodies
        for index in range(people):
            body = _member(left, draws.even(f"body {index}"))
            left = left[left != body]
            found.append(self._body_of_pool(pools.bodies, body, draws.group))
        return tuple(found)

    def _body_of_pool(self, pool: NDArray[np.int64], body: int, split: str) -> BodySpec:
        """A person, the same in all recordings."""
        splits, seed = self.tables.splits, self.tables.seed
        group = split if splits is not None and "body" in splits.by else WHOLE_SET
        draws = StratifiedDraws(seed, body, 0, group, int(np.searchsorted(pool, body)), len(pool))
        return self._body(derived_seed(seed, "pool", body, "body"), draws, "pool ")

    def _body(self, seed: int, draws: StratifiedDraws, key: str) -> BodySpec:
        """A person with drawn attributes; `key` stands before their names."""
        tables = self.tables.bodies
        drawn: dict[str, Any] = {
            name: form.draw(draws, key + name)
            for name in ("gender", "age_years", "height_m", "weight_kg", "muscle")
            if (form := getattr(tables, name)) is not None
        }
        rounded: dict[str, Any] = {
            name: value if isinstance(value, str) else round(value, 3) for name, value in drawn.items()
        }
        return BodySpec(seed, **rounded)

    def _grids(self, split: str) -> list[tuple[str, int]]:
        """Keys with a grid and the number of their values in a split, the fastest first."""
        pools, tables = self._pools[split], self.tables
        found = [
            (key, len(options.indices))
            for key, options in (("prompts", pools.sources), ("places", pools.places))
            if options.is_grid
        ]
        forms = {key: getattr(tables, key) for key in DRAWN} | {"receiver": self.receivers}
        forms |= {key: form for radar in self.radars for key, form in radar.forms().items()}
        return found + [(key, len(form.values)) for key, form in forms.items() if form is not None and form.is_grid]

    def _cells(self, split: str, rank: int) -> dict[str, int]:
        """Key -> index in its grid, of the recording number `rank` of a split."""
        found = {}
        for key, size in self._grids(split):
            rank, found[key] = divmod(rank, size)
        return found

    def _facts(self) -> Iterable[str]:
        yield f"{self.count} recordings"
        yield f"{len(self.sources)} sources"
        yield f"{len(self.places)} places"
        yield f"radars: {', '.join(each.name or each.radar for each in self.radars)}"
        yield f"splits: {', '.join(self.splits)}"


def _places(tables: RecipeTables, sources: Iterable[Source], located: Any) -> tuple[Place, ...]:
    """Alternatives of surroundings; without any in the recipe free space and the places that prompts name."""
    named = {each.spec.text: each.surroundings for each in sources if each.surroundings}
    if tables.places is None:
        found = [Place(FREE_SPACE, "none"), *map(prompted_place, named.values())]
        if tables.splits is not None and "place" in tables.splits.by and any(each.kind == "scene" for each in found):
            raise RecipeError("splits.by has 'place', but prompts name scenes: give the places by the key places")
        return tuple(dict.fromkeys(found))
    if named:
        prompt, place = next(iter(named.items()))
        raise RecipeError(f"places: the prompt '{prompt}' names one ({place}); leave it out there, or leave out places")
    read = []
    for text in tables.places.values:
        with faults_of("places"):
            read.append(read_place(text, located))
    with faults_of("places"):
        check_names(read)
    return tuple(read)


def _receivers(tables: RecipeTables, located: Any) -> ValueForm[Mapping[str, Any] | None]:
    """Tables of the receivers, those of files read."""
    form = tables.receiver
    if form is None:
        return ValueForm("scalar", (None,))
    read: list[Mapping[str, Any]] = []
    for value in form.values:
        if isinstance(value, str):
            path = located(value)
            check_file(path)
            value = tomllib.loads(path.read_text(encoding="utf-8"))
        read.append(value)
    return ValueForm(form.kind, tuple(read), form.weights)


def _member(pool: NDArray[np.int64], number: float) -> int:
    """A member of a pool by a number in [0, 1), each with the same chance."""
    return int(pool[int(number * len(pool))])


def _plain(value: Any) -> Any:
    """What JSON holds of a form of values."""
    return [value.kind, value.values, value.weights] if isinstance(value, ValueForm) else str(value)
