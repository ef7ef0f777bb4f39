"""Radars of a recipe: one, or several that record the same scene."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, replace
from difflib import get_close_matches
from pathlib import Path
from typing import Any

from rfgen_sionna.radar import Radar
from rfgen_sionna.recipes.recipe_error import RecipeError
from rfgen_sionna.recipes.recipe_sources import check_file
from rfgen_sionna.recipes.recipe_tables import RadarTable, RecipeTables
from rfgen_sionna.recipes.recording_spec import Point, RadarSpec
from rfgen_sionna.recipes.value_forms import ValueForm
from rfgen_sionna.resources import available

DEFAULT_RADAR = "awr1843"
"""Radar of a recipe that names none."""


@dataclass(frozen=True)
class SetRadar:
    """A radar of every recording of a set."""

    key: str
    """Path of its key in the recipe; empty for keys at the top."""
    name: str
    """Name in the runs; empty for the only one."""
    radar: str
    """Name of a shipped radar, or absolute path of its file."""
    preset: str | None
    board: str | None
    position_m: ValueForm[list[float]]
    """Position [m]."""
    look_at_m: ValueForm[list[float]] | None
    """Point on the boresight [m]; None is along +x."""

    def forms(self) -> dict[str, ValueForm[list[float]] | None]:
        """What is drawn for each recording, by the path of its key."""
        return {self.path("position_m"): self.position_m, self.path("look_at_m"): self.look_at_m}

    def path(self, key: str) -> str:
        """Path of one of its keys."""
        return f"{self.key}.{key}" if self.key else key

    def spec(self, value: Callable[[str, ValueForm[Any] | None], Any]) -> RadarSpec:
        """The radar of a recording, placed by `value` of each form."""
        position, look_at = (value(key, form) for key, form in self.forms().items())
        at: Point | None = None if look_at is None else (look_at[0], look_at[1], look_at[2])
        return RadarSpec(self.name, self.radar, self.preset, self.board, (position[0], position[1], position[2]), at)

    def placements(self) -> list[RadarSpec]:
        """The radar at each of its positions, or at the ends of their ranges, with each of its boresights."""
        ahead: list[list[float] | None] = [None] if self.look_at_m is None else [*self.look_at_m.values]
        return [
            RadarSpec(
                self.name, self.radar, self.preset, self.board, (x, y, z), None if at is None else (at[0], at[1], at[2])
            )
            for x, y, z in self.position_m.values
            for at in ahead
        ]  # fmt: skip


def load_radar(spec: RadarSpec) -> Radar:
    """The placed radar.

    Raises:
        ValueError: there is no such radar, preset or board, or the boresight has no direction.
    """
    x, y, z = spec.position_m
    at = (x + 1.0, y, z) if spec.look_at_m is None else spec.look_at_m
    if at == spec.position_m:
        raise ValueError(f"look_at_m is {list(at)}, the position of the radar: a point away from it is needed")
    return Radar.load(spec.radar, spec.preset, board=spec.board, position=spec.position_m, look_at=at)


def set_radars(tables: RecipeTables, located: Callable[[str], Path]) -> tuple[SetRadar, ...]:
    """Radars of a recipe, with a name for each of several.

    Raises:
        RecipeError: keys of one radar and of several, the same name twice, or no such radar.
    """
    top = ("radar", "preset", "board", "position_m", "look_at_m")
    given = {name: value for name in top if (value := getattr(tables, name)) is not None}
    if tables.radars is None:
        only = RadarTable.model_construct(**({"radar": DEFAULT_RADAR} | given))
        return (_radar("", only, "", located),)
    if given:
        raise RecipeError(f"{next(iter(given))} belongs to a recipe with one radar; put it into the tables [[radars]]")
    counts = Counter(table.radar for table in tables.radars)
    found: list[SetRadar] = []
    for number, table in enumerate(tables.radars):
        own = Path(table.radar).stem.replace(".", "_")
        if counts[table.radar] > 1:
            own += f"_{1 + sum(each.radar == table.radar for each in tables.radars[:number])}"
        name = "" if len(tables.radars) == 1 else table.name or own
        if any(each.name == name for each in found):
            raise RecipeError(f"radars[{number}].name: '{name}' is another radar's, too; give each a name of its own")
        found.append(_radar(f"radars[{number}]", table, name, located))
    return tuple(found)


def _radar(key: str, table: RadarTable, name: str, located: Callable[[str], Path]) -> SetRadar:
    radar = SetRadar(key, name, "", table.preset, None, table.position_m, table.look_at_m)
    return replace(
        radar,
        radar=_file_or_name(radar.path("radar"), table.radar, located),
        board=None if table.board is None else _file_or_name(radar.path("board"), table.board, located),
    )


def _file_or_name(key: str, text: str, located: Callable[[str], Path]) -> str:
    known = available("radars")
    if text.lower() in known:
        return text.lower()
    if "/" in text or "\\" in text or Path(text).suffix:
        path = located(text)
        try:
            check_file(path)
        except ValueError as error:
            raise RecipeError(f"{key}: {error}") from None
        return str(path)
    close = get_close_matches(text.lower(), known, n=1)
    hint = f"did you mean '{close[0]}'?" if close else f"there are {', '.join(known)}"
    raise RecipeError(f"{key} is '{text}', and there is no such radar: {hint}")
