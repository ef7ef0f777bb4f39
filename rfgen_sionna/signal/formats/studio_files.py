"""Files of one recording of a DCA1000, by the names that mmWave Studio and the DCA1000's own program give them.

A `<any>.setup.json` names the configuration (`configUsed`, a `<any>.mmwave.json`) and the data files: as they came
(`<any>_Raw_0.bin`, `<any>_Raw_1.bin`, … of about 1 GB, continued in the middle of a chirp) and processed
(`<any>.bin`, or `<any>_0.bin`, …). Without one, the names of the data files say which belong together. Paths in these
files are those of the computer that recorded: names count, in the folder of the file, or in `fileBasePath` below it.
"""

from __future__ import annotations

import re
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path, PureWindowsPath

from rfgen_sionna.signal.formats.capture import CaptureFormatError, CaptureWarning
from rfgen_sionna.signal.formats.files import read_json
from rfgen_sionna.signal.formats.sidecar import is_sidecar, sidecar_of

CONFIG, SETUP = ".mmwave.json", ".setup.json"
_NUMBERED = re.compile(r"(?P<base>.*?)(?P<raw>_raw)?_(?P<number>\d+)", re.IGNORECASE)
_STANDARD = "adc_data"  # base name of mmWave Studio, mmWave SDK and OpenRadar
_OTHERS = re.compile(r"(master|slave[123])_\d{4}_(data|idx)\.bin")


@dataclass(frozen=True)
class RecordedFiles:
    """Files of one recording."""

    data: tuple[Path, ...]
    """In the order of their numbers."""
    config: Path | None = None
    """`.mmwave.json`"""
    setup: Path | None = None
    """`.setup.json`"""
    device: str | None = None
    """`mmWaveDevice` of the setup."""
    named: Path | None = None
    """The file that was asked for, where only names such as `walk_0.bin`, `walk_1.bin` join several: they may be
    recordings of their own."""
    joined: bool = True
    """Whether the files are known to be parts of one recording."""

    @property
    def sidecar(self) -> Path:
        return sidecar_of(self.data[0])


@dataclass(frozen=True)
class _Setup:
    path: Path
    config: str
    processed: tuple[str, ...]
    raw: tuple[str, ...]
    base: str
    device: str | None

    def find(self, name: str) -> Path:
        """File of that name in any case, as on Windows, in the folder of the setup or in its `fileBasePath`."""
        folder = self.path.parent
        inside = folder / self.base.replace("\\", "/")
        if self.base and (inside / name).is_file():
            return inside / name
        same = [file for file in folder.iterdir() if file.name.lower() == name.lower()]
        return same[0] if len(same) == 1 else folder / name


def find_files(path: Path) -> RecordedFiles:
    """The recording that a folder, a data file, a `.setup.json` or a `.mmwave.json` leads to.

    Raises
    ------
    CaptureFormatError
        The folder holds several recordings, a part of one is missing, or a setup has other fields.
    FileNotFoundError
        A named file does not exist.
    """
    folder = path if path.is_dir() else path.parent
    if not path.exists():
        raise FileNotFoundError(f"capture file '{path}' does not exist")
    setups = [_read_setup(found) for found in _named(folder, SETUP)]
    if path.name.lower().endswith(SETUP):
        setups = [setup for setup in setups if setup.path.name == path.name]
    elif path.suffix.lower() == ".json":
        setups = [setup for setup in setups if setup.find(setup.config).name == path.name]
    elif path.is_file():
        setups = [setup for setup in setups if path.name in (*setup.processed, *setup.raw)]
    if len(setups) > 1:
        found = ", ".join(f"'{setup.path.name}'" for setup in setups)
        raise CaptureFormatError(f"'{path}' belongs to several recordings: open one of {found}")
    groups = _groups(folder)
    if not setups:
        return _without_setup(path, folder, groups)
    (setup,) = setups
    data = _listed(setup, path, groups)
    return RecordedFiles(data, _config_of(setup, path, sidecar_of(data[0]).is_file()), setup.path, setup.device)


def folder_config(folder: Path) -> tuple[Path, ...]:
    """Configuration of a folder with one recording, and the setup that names it: the `.mmwave.json` that the only
    `.setup.json` names, else the only `.mmwave.json`; nothing where that is open."""
    setups = [_read_setup(found) for found in _named(folder, SETUP)]
    if len(setups) == 1 and (config := setups[0].find(setups[0].config)).is_file():
        return config, setups[0].path
    configs = _configs(folder)
    return tuple(configs) if len(configs) == 1 else ()


def is_config(file: Path) -> bool:
    """Whether a file is a configuration of mmWave Studio, by its name or, since people rename them, by its content."""
    if file.name.lower().endswith(CONFIG):
        return True
    named = file.suffix.lower() == ".json" and not is_sidecar(file) and file.is_file()
    return named and b'"mmWaveDevices"' in file.read_bytes()


def _configs(folder: Path) -> list[Path]:
    """Configurations of mmWave Studio in a folder; those under other names where none has the usual one."""
    return _named(folder, CONFIG) or [file for file in sorted(folder.iterdir()) if is_config(file)]


def _named(folder: Path, suffix: str) -> list[Path]:
    return [file for file in sorted(folder.iterdir()) if file.name.lower().endswith(suffix)]


def _read_setup(path: Path) -> _Setup:
    record = read_json(path)
    try:
        captured = record.get("capturedFiles", {"files": []})  # absent before the first capture
        files = captured["files"]
        entries = files if isinstance(files, list) else [files]
        names = [
            tuple(PureWindowsPath(str(entry[key])).name for entry in entries if entry.get(key))
            for key in ("processedFileName", "rawFileName")
        ]
        config = PureWindowsPath(str(record["configUsed"])).name
        base = str(captured.get("fileBasePath") or "")
    except KeyError as error:
        raise CaptureFormatError(f"'{path}' lacks {error}") from error
    except (AttributeError, TypeError) as error:
        raise CaptureFormatError(f"'{path}': capturedFiles is not a table with a list of files: {error}") from error
    device = record.get("mmWaveDevice")
    return _Setup(path, config, names[0], names[1], base, None if device is None else str(device))


def _listed(setup: _Setup, path: Path, groups: dict[str, list[Path]]) -> tuple[Path, ...]:
    """Data files that a setup names: the processed ones where they exist, else the raw ones."""
    kinds = [[setup.find(name) for name in names] for names in (setup.processed, setup.raw) if names]
    kinds.sort(key=lambda files: path.name not in {file.name for file in files})  # the kind of the named file first
    for files in kinds:
        if all(file.is_file() for file in files):
            return _parts(files, setup)
    for files in kinds:
        if any(file.is_file() for file in files):
            absent = next(file for file in files if not file.is_file())
            raise FileNotFoundError(f"capture file '{absent}' does not exist; '{setup.path}' names it")
    names = ", ".join(f"'{name}'" for name in (*setup.processed, *setup.raw))
    if len(groups) != 1:
        raise FileNotFoundError(f"'{setup.path}' names the data files {names or 'of no name'}; none of them exists")
    (files,) = groups.values()
    warnings.warn(
        f"'{setup.path}' names the data files {names or 'of no name'}, which do not exist; '{files[0]}', the only "
        "recording in the folder, is taken",
        CaptureWarning,
        stacklevel=5,
    )
    return tuple(sorted(files, key=_number))


def _parts(files: Sequence[Path], setup: _Setup) -> tuple[Path, ...]:
    """Files that a setup lists, by their numbers; files that go on from them are a warning."""
    ordered = sorted(files, key=_number) if all(_NUMBERED.fullmatch(file.stem) for file in files) else list(files)
    if len(ordered) > 1:
        _check_numbers(ordered, setup.path.name)
    last = ordered[-1]
    following = last.with_name(re.sub(r"\d+$", str(_number(last) + 1), last.stem) + last.suffix)
    if _NUMBERED.fullmatch(last.stem) and following.is_file():
        warnings.warn(
            f"'{setup.path}' does not name '{following.name}', which goes on from '{last.name}': it is left out",
            CaptureWarning,
            stacklevel=5,
        )
    return tuple(ordered)


def _config_of(setup: _Setup, path: Path, has_sidecar: bool) -> Path | None:
    config = path if is_config(path) else setup.find(setup.config)
    if config.is_file() or has_sidecar:
        return config if config.is_file() else None
    warnings.warn(
        f"'{setup.path}': configUsed is '{setup.config}', which does not exist; the waveform is that of the radar "
        f"given. Open another {CONFIG} by its own name",
        CaptureWarning,
        stacklevel=4,
    )
    return None


def _groups(folder: Path) -> dict[str, list[Path]]:
    """Data files in a folder by recording, the processed ones where there are raw ones as well."""
    found: dict[str, dict[str, list[Path]]] = {}
    for file in sorted(folder.iterdir()):
        if file.suffix.lower() != ".bin" or not file.is_file() or _OTHERS.fullmatch(file.name):
            continue
        match = _NUMBERED.fullmatch(file.stem)
        kind = "whole" if match is None else "raw" if match["raw"] else "numbered"
        found.setdefault(file.stem if match is None else match["base"], {}).setdefault(kind, []).append(file)
    groups: dict[str, list[Path]] = {}
    for base, kinds in found.items():
        if "whole" in kinds and "numbered" in kinds:
            groups[f"{base}_"] = kinds.pop("numbered")
        groups[base] = next(kinds[kind] for kind in ("whole", "numbered", "raw") if kind in kinds)
    return groups


def _without_setup(path: Path, folder: Path, groups: dict[str, list[Path]]) -> RecordedFiles:
    if path.suffix.lower() == ".json":
        own = path.name.removesuffix(CONFIG)
        groups = {base: files for base, files in groups.items() if base == own} or groups
    elif path.is_file():
        match = _NUMBERED.fullmatch(path.stem)
        raw = match is not None and match["raw"]
        siblings = [
            file
            for file in sorted(folder.glob(f"*{path.suffix}"))
            if match is not None
            and (other := _NUMBERED.fullmatch(file.stem)) is not None
            and (other["base"], bool(other["raw"])) == (match["base"], bool(raw))
        ]
        groups = {path.stem if match is None else match["base"]: siblings or [path]}
    if not groups:
        raise CaptureFormatError(f"'{folder}' holds no .bin file of a recording")
    if len(groups) > 1:
        names = ", ".join(f"'{files[0].name}'" for files in groups.values())
        raise CaptureFormatError(f"'{folder}' holds {len(groups)} recordings: open one of {names}")
    ((base, files),) = groups.items()
    files = sorted(files, key=_number)
    parts = "_raw_" in files[0].name.lower() or base.lower() == _STANDARD
    if parts:
        _check_numbers(files, str(folder))
    of_file = path.suffix.lower() == ".json"
    config = path if of_file else _lone_config(folder, base, files)
    named = path if path.is_file() and not of_file else None
    return RecordedFiles(tuple(files), config, named=named, joined=parts or len(files) == 1)


def _lone_config(folder: Path, base: str, files: Sequence[Path]) -> Path | None:
    """`.mmwave.json` of the same name as the data, else the only one of the folder."""
    for stem in (files[0].stem, base):
        if (config := folder / (stem + CONFIG)).is_file():
            return config
    configs = _configs(folder)
    if len(configs) > 1 and not sidecar_of(files[0]).is_file():
        names = ", ".join(f"'{config.name}'" for config in configs)
        raise CaptureFormatError(f"'{folder}' holds {names} and no {SETUP} that names one of them: open one of them")
    return configs[0] if len(configs) == 1 else None


def _number(file: Path) -> int:
    match = _NUMBERED.fullmatch(file.stem)
    return 0 if match is None else int(match["number"])


def _check_numbers(files: Sequence[Path], label: str) -> None:
    """Refuse a recording in parts, in their order, without one of them."""
    numbers = [_number(file) for file in files]
    if _NUMBERED.fullmatch(files[0].stem) and numbers != list(range(len(files))):
        missing = next(number for number in range(max(numbers) + 2) if number not in numbers)
        stem = re.sub(r"\d+$", str(missing), files[0].stem)
        names = ", ".join(f"'{file.name}'" for file in files)
        raise CaptureFormatError(
            f"'{label}': part {missing} of the recording is missing, '{stem}{files[0].suffix}'; there are {names}"
        )
