"""Radar files to break: the shipped one, with changes."""

from __future__ import annotations

import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from rfgen_sionna.radar import Radar
from rfgen_sionna.resources import resolve


def dump(table: dict[str, Any]) -> str:
    """TOML of nested tables, numbers, texts and lists."""

    def value(item: Any) -> str:
        if isinstance(item, bool):
            return "true" if item else "false"
        if isinstance(item, str):
            return '"' + item.replace("\\", "\\\\").replace('"', '\\"') + '"'
        if isinstance(item, list):
            return "[" + ", ".join(value(entry) for entry in item) + "]"
        if isinstance(item, dict):
            return "{" + ", ".join(f'"{key}" = {value(entry)}' for key, entry in item.items()) + "}"
        return repr(item)

    def section(name: str, content: dict[str, Any]) -> list[str]:
        lines = [f"[{name}]"] if name else []
        lines += [f'"{key}" = {value(item)}' for key, item in content.items() if not isinstance(item, dict)]
        for key, item in content.items():
            if isinstance(item, dict):
                lines += section(f'{name}."{key}"' if name else f'"{key}"', item)
        return lines

    return "\n".join(section("", table)) + "\n"


class RadarFile:
    """A copy of the shipped radar's table; change `table`, then load it from a file of one's own."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.table: dict[str, Any] = tomllib.loads(resolve("radars", "awr1843").read_text(encoding="utf-8"))

    @property
    def mmmesh(self) -> dict[str, Any]:
        preset: dict[str, Any] = self.table["preset"]["mmmesh"]
        return preset

    def set(self, key: str, value: Any) -> None:
        """Put `value` under a dotted key."""
        *sections, last = key.split(".")
        table = self.table
        for name in sections:
            table = table[name]
        table[last] = value

    def remove(self, key: str) -> None:
        """Take a dotted key out."""
        *sections, last = key.split(".")
        table = self.table
        for name in sections:
            table = table[name]
        del table[last]

    def load(self, preset: str | None = None, **pose: Any) -> Radar:
        self.path.write_text(dump(self.table), encoding="utf-8")
        return Radar.load(self.path, preset, **pose)


@pytest.fixture
def radar_file(tmp_path: Path) -> RadarFile:
    return RadarFile(tmp_path / "mine.toml")


@pytest.fixture
def refuses(radar_file: RadarFile) -> Callable[..., None]:
    """Check that the file is refused with a message that has all of these in it."""

    def check(*parts: str) -> None:
        with pytest.raises(ValueError, match=r".") as caught:
            radar_file.load()
        for part in (str(radar_file.path), *parts):
            assert part in str(caught.value)

    return check
