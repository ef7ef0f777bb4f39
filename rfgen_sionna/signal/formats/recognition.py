"""Format of a capture, from the names and the content of its files."""

from __future__ import annotations

from pathlib import Path

from rfgen_sionna.signal.formats.capture import CaptureFormatError
from rfgen_sionna.signal.formats.cascade_files import DATA_NAME
from rfgen_sionna.signal.formats.files import companion, read_json
from rfgen_sionna.signal.formats.matlab import is_ours
from rfgen_sionna.signal.formats.npy import read_header
from rfgen_sionna.signal.formats.sidecar import FORMER_SUFFIX, SUFFIX, is_sidecar, sidecar_of
from rfgen_sionna.signal.formats.studio_files import SETUP, is_config
from rfgen_sionna.signal.formats.udp import header_size

FORMATS = ("dca1000", "cascade", "position2go", "infineon", "rfgenesis", "matlab")
_SUFFIXES = {".bin": "dca1000", ".raw": "position2go", ".npy": "npy", ".mat": "matlab", ".xml": "position2go"}
DATA_SUFFIXES = (".bin", ".raw", ".npy", ".mat")
_DATA = {"dca1000": (".bin", ".BIN"), "position2go": (".raw",), "rfgenesis": (".npy",), "infineon": (".npy",)}
_DATA["matlab"] = (".mat",)


def recognise(path: Path) -> tuple[Path, str]:
    """Path to open and format of the capture that a folder or any of its files leads to.

    Raises
    ------
    CaptureFormatError
        It is none, or several.
    FileNotFoundError
        The path does not exist.
    """
    if not path.exists():
        raise FileNotFoundError(f"capture '{path}' does not exist")
    if path.is_dir():
        return path, _of_folder(path)
    if is_sidecar(path):
        return _of_sidecar(path)
    if path.suffix.lower() == ".json":
        return _of_json(path)
    if DATA_NAME.fullmatch(path.name):
        return path, "cascade"
    found = _SUFFIXES.get(path.suffix.lower())
    if found in (None, "position2go") and header_size(path):
        return path, "dca1000"  # a dump of UDP packets under another suffix
    if path.suffix.lower() == ".xml":
        return companion(path, ".raw"), "position2go"
    if found is None:
        raise CaptureFormatError(f"'{path}' has a suffix of no format: {_cure(path)}")
    return path, _of_array(path) if found == "npy" else found


def _cure(path: Path) -> str:
    if path.suffix.lower() in (".h5", ".hdf5"):
        return "a run of this package is opened with rfgen.open_run"
    if path.suffix.lower() in (".pcap", ".pcapng"):
        return "write the UDP data of the packets, headers of the DCA1000 included, into a .bin file"
    return f"name one of {', '.join(FORMATS)}"


def _of_folder(folder: Path) -> str:
    entries = [entry for entry in sorted(folder.iterdir()) if entry.is_file()]
    if any(DATA_NAME.fullmatch(entry.name) for entry in entries):
        return "cascade"
    studio = any(entry.suffix.lower() == ".bin" for entry in entries) and any(
        entry.name.lower().endswith(SETUP) or is_config(entry) for entry in entries
    )
    if studio:  # results of other programs may lie beside a recording
        entries = [
            entry
            for entry in entries
            if entry.suffix.lower() not in (".npy", ".mat") or sidecar_of(entry).is_file() or is_ours(entry)
        ]
    found: dict[str, Path] = {}
    reasons = []
    for entry in entries:
        format = _SUFFIXES.get(entry.suffix.lower())
        if format == "npy":
            try:
                format = _of_array(entry)
            except CaptureFormatError as error:
                reasons.append(str(error))
                continue
        if format is not None and entry.suffix.lower() != ".xml":
            found.setdefault(format, entry)
    if len(found) == 1:
        return next(iter(found))
    if found:
        names = ", ".join(f"'{entry.name}' ({format})" for format, entry in found.items())
        raise CaptureFormatError(f"'{folder}' holds files of several formats: open one of {names}")
    if reasons:
        raise CaptureFormatError(reasons[0])
    inside = [entry.name for entry in sorted(folder.iterdir()) if entry.is_dir()]
    where = f"; it has the folders {', '.join(inside[:5])}" if inside else ""
    raise CaptureFormatError(
        f"'{folder}' holds no capture (.bin, .raw, .npy or .mat){where}: name the file, or a format "
        f"of {', '.join(FORMATS)}"
    )


def _of_sidecar(path: Path) -> tuple[Path, str]:
    format = str(read_json(path).get("capture_format"))
    if format == "cascade":
        return path.parent, format
    if format not in _DATA:
        raise CaptureFormatError(f"'{path}': capture_format is {format!r}; allowed: {', '.join(FORMATS)}")
    stem = path.name.removesuffix(FORMER_SUFFIX).removesuffix(SUFFIX)
    files = [path.with_name(stem + suffix) for suffix in _DATA[format]]
    return next((file for file in files if file.is_file()), files[0]), format


def _of_json(path: Path) -> tuple[Path, str]:
    record = read_json(path)
    if "mmWaveDevices" in record:
        devices = record["mmWaveDevices"]
        return path, "cascade" if isinstance(devices, list) and len(devices) > 1 else "dca1000"
    if "capturedFiles" in record:
        cascade = any(DATA_NAME.fullmatch(entry.name) for entry in path.parent.iterdir())
        return path, "cascade" if cascade else "dca1000"
    if "device_config" in record:
        return path, "infineon"
    if path.name.endswith("_config.json") and (data := path.with_name(path.name[:-12] + ".npy")).is_file():
        return data, "rfgenesis"
    raise CaptureFormatError(
        f"'{path}' has the fields {', '.join(list(record)[:5]) or 'of an empty object'}: it is no configuration of a "
        "capture (mmWaveDevices or capturedFiles of mmWave Studio, device_config of Infineon)"
    )


def _of_array(path: Path) -> str:
    """Format of a `.npy` file: complex arrays of five axes are RF Genesis', real ones of four axes Infineon's."""
    header = read_header(path)
    shape, kind = header.shape, header.dtype.kind
    if kind == "c" and len(shape) == 5:
        return "rfgenesis"
    if kind in "uif" and len(shape) == 4:
        return "infineon"
    raise CaptureFormatError(
        f"'{path}' holds {header.dtype} {shape}: complex (frame, tx, rx, chirp, sample) is of RF Genesis, uint16 "
        "(frame, rx, chirp, sample) of Infineon; other arrays belong into an AdcCube, with their radar"
    )
