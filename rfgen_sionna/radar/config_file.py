"""Radar files of all kinds, recognised by their content: the table of a radar file in TOML comes out of each."""

from __future__ import annotations

import codecs
import json
import os
import re
import tomllib
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from rfgen_sionna.radar.board_frames import BoardFrames, on_board
from rfgen_sionna.radar.boards import board_file
from rfgen_sionna.radar.config import RadarConfigError, check_config, read_config
from rfgen_sionna.radar.infineon_json import is_infineon, read_infineon
from rfgen_sionna.radar.studio_json import read_studio_config
from rfgen_sionna.radar.ti_cfg import read_ti_cfg
from rfgen_sionna.radar.ti_cfg_commands import is_ti_cfg
from rfgen_sionna.resources import UnknownResourceError, available

ACCEPTED = (
    "a radar file in TOML, a .cfg of TI's mmWave SDK, a .mmwave.json or .setup.json of mmWave Studio, or a config.json "
    "of Infineon's Radar SDK"
)
_LARGEST = 16 << 20
"""Largest size of a configuration file [bytes]."""


def radar_table(
    radar: str | os.PathLike[str], preset: str | None = None, board: str | os.PathLike[str] | None = None
) -> tuple[dict[str, Any], Path, bool]:
    """Checked table of a radar, its file, and whether that is a radar file in TOML.

    Parameters
    ----------
    radar
        Name of a shipped radar, in any case, or path of a configuration file of any kind.
    preset
        Preset that is wanted; needed where a vendor's file has several kinds of frames.
    board
        Board of a file that leaves it open: name of a shipped radar, or path of a radar file in TOML.

    Raises
    ------
    RadarConfigError, UnknownResourceError
        No such radar or file, another kind of file, or one without its board.
    """
    path = _path(radar)
    if path is None:
        if board is not None:
            raise RadarConfigError(f"board is {board!r}, but radar {str(radar)!r} is a board itself: leave it out")
        path = board_file(str(radar))
        return read_config(path), path, True
    text = _text(path)
    frames = _frames(text, path)
    if frames is None:
        if board is not None:
            raise RadarConfigError(f"board is {board!r}, but {path} describes its board itself: leave it out")
        return read_config(path), path, True
    if preset is None and len(frames.presets) > 1:
        raise RadarConfigError(
            f"{path} has {len(frames.presets)} kinds of frames: name one as preset, {', '.join(frames.presets)}"
        )
    board_path = _board_path(board, frames, path)
    table = on_board(frames, read_config(board_path), board_path, str(path))
    check_config(table, str(path))
    return table, path, False


def _path(radar: str | os.PathLike[str]) -> Path | None:
    """Path of a radar that is given as one; None for a name."""
    if not isinstance(radar, (str, os.PathLike)) or not str(radar):
        raise RadarConfigError(f"radar is {radar!r}: {ACCEPTED}, or one of {', '.join(available('radars'))} is needed")
    path = Path(radar)
    if isinstance(radar, str) and len(path.parts) == 1 and not path.suffix and (_is_board(radar) or not path.is_file()):
        return None
    if path.is_dir():
        raise RadarConfigError(f"radar file {path} is a folder: {ACCEPTED} is needed")
    if not path.is_file():
        raise RadarConfigError(f"radar file {path} does not exist; shipped radars: {', '.join(available('radars'))}")
    return path


def _is_board(name: str) -> bool:
    try:
        board_file(name)
    except UnknownResourceError:
        return False
    return True


def _text(path: Path) -> str:
    if path.stat().st_size > _LARGEST:
        raise RadarConfigError(f"{path} has {path.stat().st_size:,} bytes and is no radar file: {ACCEPTED} is needed")
    content = path.read_bytes()
    if content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):  # redirected output of PowerShell
        return content.decode("utf-16", errors="replace")
    if b"\0" in content:
        raise RadarConfigError(f"{path} is binary and no radar file: {ACCEPTED} is needed")
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError:
        return content.decode("latin-1")  # comments of older tools


def _frames(text: str, path: Path) -> BoardFrames | None:
    """Frames of a board's own configuration file; None for a radar file in TOML."""
    if path.suffix == ".toml":
        return None
    if text.lstrip().startswith("{"):
        return _json_frames(text, path)
    if is_ti_cfg(text):
        return read_ti_cfg(text, str(path))
    try:
        if tomllib.loads(text):
            return None
    except tomllib.TOMLDecodeError:
        pass
    hint = ""
    if re.search(r"^\s*ar1\.", text, re.MULTILINE):
        hint = " (a Lua script of mmWave Studio: export its configuration as JSON)"
    raise RadarConfigError(f"{path} is no radar file{hint}: {ACCEPTED} is needed")


def _json(text: str, path: Path) -> dict[str, Any]:
    try:
        record: dict[str, Any] = json.loads(text)
    except ValueError as error:
        raise RadarConfigError(f"{path} is not JSON: {error}") from error
    return record


def _json_frames(text: str, path: Path) -> BoardFrames:
    record = _json(text, path)
    if "mmWaveDevices" in record:
        return replace(_studio_frames(record, path), board=_device_beside(path))
    if "configUsed" in record:
        return _setup_frames(record, path)
    if is_infineon(record):
        return read_infineon(record, str(path))
    hint = ""
    if record.get("format") == "rfgen-capture":
        hint = " (the sidecar of a capture: open_capture(…).radar has its radar)"
    raise RadarConfigError(
        f"{path} has the keys {', '.join(map(str, list(record)[:8]))} and is no radar file{hint}: {ACCEPTED} is needed"
    )


def _studio_frames(record: Mapping[str, Any], path: Path) -> BoardFrames:
    try:
        return read_studio_config(record).frames
    except KeyError as error:
        raise RadarConfigError(f"{path} lacks {error}") from error
    except (TypeError, ValueError, IndexError, AttributeError) as error:
        raise RadarConfigError(f"{path}: {error}") from error


def _setup_frames(record: Mapping[str, Any], path: Path) -> BoardFrames:
    """Frames of the configuration that a `.setup.json` names, on its device."""
    name = _config_used(record)
    config = path.with_name(name)
    if not config.is_file():
        raise RadarConfigError(f"{path}: configUsed is {record['configUsed']!r}; there is no '{name}' beside it")
    content = _json(_text(config), config)
    if "mmWaveDevices" not in content:
        raise RadarConfigError(f"{path}: configUsed is {record['configUsed']!r}; a .mmwave.json is needed")
    return replace(_studio_frames(content, config), board=_device(record))


def _config_used(setup: Mapping[str, Any]) -> str:
    """Name of the configuration in a `.setup.json`, without its folder on another machine."""
    return re.split(r"[\\/]", str(setup["configUsed"]))[-1]


def _device(setup: Mapping[str, Any]) -> str | None:
    device = setup.get("mmWaveDevice")
    return str(device) if device else None


def _device_beside(config: Path) -> str | None:
    """Device of a `.mmwave.json`, from the `.setup.json` beside it that names it; None where none or several do."""
    found = set()
    for path in config.parent.glob("*.setup.json"):
        try:
            setup = _json(_text(path), path)
        except RadarConfigError:
            continue
        if "configUsed" in setup and _config_used(setup).lower() == config.name.lower():
            found.add(_device(setup))
    return found.pop() if len(found) == 1 else None


def _board_path(board: str | os.PathLike[str] | None, frames: BoardFrames, path: Path) -> Path:
    if board is not None:
        found = _path(board)
        return board_file(str(board)) if found is None else found
    if frames.board is not None:
        try:
            return board_file(frames.board)
        except UnknownResourceError:
            pass
    said = "gives no board" if frames.board is None else f"gives the device '{frames.board}'"
    low, high = frames.band
    reach = f"{low / 1e9:.4g} … {high / 1e9:.4g} GHz with TX{max(frames.transmitters)} and RX{max(frames.receivers)}"
    known = f"boards at {reach}: {', '.join(frames.boards())}"
    if not frames.boards():
        known = f"no shipped board reaches {reach}: name a radar file in TOML"
    raise RadarConfigError(f"{path} {said}, and the antennas are the board's: name it, board='…' (--board); {known}")
