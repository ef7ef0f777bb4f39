"""A MATLAB file: version 5 (SciPy), or version 7.3 (HDF5) where `adc` exceeds version 5's 2 GB.

Variables: `adc` (chirp, tx, rx, sample, frame) complex single, or single of a real ADC; `dims`, its axes; `units`, a
struct with the unit of each variable; `frame_time` (frame, 1), `chirp_time` (chirp, tx), `sample_time` (1, sample), or
(tx, sample) where profiles differ in it; `tx_name`, `rx_name`; `slot_name`, the entries of `adc` along tx;
`tx_position`, `rx_position` (element, 3); `scale`; `description`, JSON with the full radar.

MATLAB's first axis is the fastest: a frame, `adc(:, :, :, :, n)`, is contiguous. A truncated file is refused.
"""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna.radar import Radar
from rfgen_sionna.records import AdcCube
from rfgen_sionna.signal.formats.capture import Capture, CaptureFormatError, CaptureReport
from rfgen_sionna.signal.formats.files import atomic_files, data_file, need_file, warn_or_raise
from rfgen_sionna.signal.formats.frames import WriteRequest, frames_of
from rfgen_sionna.signal.formats.sidecar import Description, describe, from_record, with_radar

NAME = "matlab"
STANDARD = "adc_data.mat"
MAX_VERSION_5 = (1 << 31) - 1  # bytes of a variable (MAT-File Format, version 5)
_DIMS = ("chirp", "tx", "rx", "sample", "frame")
_UNITS = {
    "adc": "sqrt(W)",
    "frame_time": "s",
    "chirp_time": "s",
    "sample_time": "s",
    "tx_position": "m",
    "rx_position": "m",
    "scale": "sqrt(W)/unit of adc",
}
_COMPLEX = np.dtype([("real", "<f4"), ("imag", "<f4")])
_USERBLOCK = 512  # bytes before the HDF5 content, the smallest of HDF5
# MATLAB's header in that block: a text of 116 bytes, version 0x0200, byte order.
_HEADER = b"MATLAB 7.3 MAT-file, HDF5 schema 1.00 .".ljust(116) + bytes(8) + b"\x00\x02IM"


def write(request: WriteRequest, *, version: Literal["auto", "5", "7.3"] = "auto") -> CaptureReport:
    """Write `request.path` (or `adc_data.mat` in it, where it is a folder); see `write_capture`.

    `version` "auto" is 5 up to 2 GB and 7.3 above.

    Raises
    ------
    ValueError
        `adc` does not fit into version "5".
    """
    cube = request.cube
    if version not in ("auto", "5", "7.3"):
        raise ValueError(f"version is {version!r}; allowed: auto, 5, 7.3")
    size = cube.radar.sample_type.itemsize * int(np.prod(cube.data.shape))
    if version == "5" and size > MAX_VERSION_5:
        raise ValueError(
            f"version 5 holds variables of at most {MAX_VERSION_5:,} bytes; adc has {size:,}: take version 7.3"
        )
    divisor, declared = request.resolve_scale(None)
    variables = _variables(cube, declared)
    target = data_file(request.path, STANDARD)
    with atomic_files((target,), request.overwrite) as (part,):
        if version == "7.3" or size > MAX_VERSION_5:
            _write_hdf5(part, cube, divisor, variables)
        else:
            from scipy.io import savemat

            data = np.stack(list(frames_of(cube)))
            if divisor != 1.0:
                data /= np.float32(divisor)
            with part.open("wb") as stream:
                savemat(stream, variables | {"adc": np.moveaxis(data, 0, -1)}, format="5", oned_as="column")
    real = cube.radar.adc.real
    values = int(np.prod(cube.data.shape)) * (1 if real else 2)
    return CaptureReport(NAME, (target,), cube.data.shape[0], declared, None, 0, values, real)


def _variables(cube: AdcCube, scale: float | None) -> dict[str, Any]:
    radar, wave = cube.radar, cube.radar.waveform
    profiles = [wave.profiles[slot.profile] for slot in wave.slots] if wave.other_profiles else [wave.profiles[0]]
    units = _UNITS if scale == 1.0 else _UNITS | {"adc": "1" if scale is None else "scale sqrt(W)"}
    return {
        "dims": ", ".join(_DIMS),
        "units": units,
        "frame_time": np.asarray(cube.frame_times, dtype=np.float64)[:, None],
        "chirp_time": np.array(wave.chirp_times),
        "sample_time": np.stack([profile.sample_times(wave.num_samples) for profile in profiles]),
        "tx_name": ", ".join(radar.tx_names),
        "slot_name": ", ".join(radar.axis_names),
        "rx_name": ", ".join(radar.rx_names),
        "tx_position": np.array(radar.tx_positions),
        "rx_position": np.array(radar.rx_positions),
        "scale": np.array([[np.nan if scale is None else scale]]),
        "description": json.dumps(describe(cube, NAME, scale, None)),
    }


def _write_hdf5(path: Path, cube: AdcCube, divisor: float, variables: dict[str, Any]) -> None:
    import h5py

    frames, shape = cube.data.shape[0], cube.radar.frame_shape
    with h5py.File(path, "w", userblock_size=_USERBLOCK, libver="earliest") as file:
        for name, value in variables.items():
            if isinstance(value, dict):
                group = file.create_group(name)
                group.attrs["MATLAB_class"] = np.bytes_("struct")
                for key, entry in value.items():
                    _put(group, key, entry)
            else:
                _put(file, name, value)
        # In the order of HDF5 the axes are those of `dims` reversed: MATLAB's first axis is the fastest.
        kind = cube.radar.sample_type
        stored = _COMPLEX if kind == np.complex64 else kind
        adc = file.create_dataset("adc", shape=(frames, *shape[::-1]), dtype=stored)
        adc.attrs["MATLAB_class"] = np.bytes_("single")
        for number, frame in enumerate(frames_of(cube)):
            values = np.ascontiguousarray((frame / np.float32(divisor)).transpose(3, 2, 1, 0), dtype=kind)
            adc[number] = values.view(stored)
    with path.open("r+b") as stream:
        stream.write(_HEADER)


def _put(group: Any, name: str, value: str | NDArray[Any]) -> None:
    if isinstance(value, str):
        letters = np.array([ord(letter) for letter in value], dtype=np.uint16)[:, None]
        dataset = group.create_dataset(name, data=letters)
        dataset.attrs["MATLAB_class"] = np.bytes_("char")
        dataset.attrs["MATLAB_int_decode"] = np.int32(2)
    else:
        group.create_dataset(name, data=value.T).attrs["MATLAB_class"] = np.bytes_("double")


def read(path: str | os.PathLike[str], radar: Radar | None = None, *, partial: bool = False) -> Capture:
    """Open a MATLAB file of :func:`write`; see `open_capture`. Version 5 is read into memory.

    Raises
    ------
    CaptureFormatError
        The file is truncated (also with `partial`), or has other contents.
    """
    data = need_file(data_file(path, STANDARD))
    description, stored = _open_hdf5(data) if _is_hdf5(data) else _open_version_5(data)
    found = tuple(stored.shape if isinstance(stored, np.ndarray) else stored.shape[::-1])
    found += (1,) * (5 - len(found))  # MATLAB drops trailing axes of length 1
    known = with_radar(_described(description, data), radar, data)
    shape = known.radar.frame_shape
    if len(found) != 5 or found[:4] != shape:
        raise CaptureFormatError(f"'{data}': adc has {found}; {', '.join(_DIMS)} = {shape} and the frames are needed")
    if (stored.dtype.kind == "f") != known.radar.adc.real:
        raise CaptureFormatError(
            f"'{data}': adc is {stored.dtype}; radar '{known.radar.name}' has {known.radar.sample_type} samples "
            f"(adc.real is {known.radar.adc.real})"
        )
    frames = found[4]
    if frames != known.frames:
        warn_or_raise(f"'{data}' holds {frames} frames; {known.frames} are expected", partial)
        frames = min(frames, len(known.times(frames)))

    def frame(number: int) -> NDArray[Any]:
        if isinstance(stored, np.ndarray):
            return stored.reshape(found)[..., number]
        return np.ascontiguousarray(stored[number]).view(known.radar.sample_type).transpose(3, 2, 1, 0)

    return Capture(NAME, (data,), known.radar, known.times(frames), known.scale, known.seed, frame)


def is_ours(path: Path) -> bool:
    """Whether a file is a MATLAB file of :func:`write`, by its variables."""
    if path.suffix.lower() != ".mat":
        return False
    try:
        return bool(_open_hdf5(path) if _is_hdf5(path) else _open_version_5(path))
    except CaptureFormatError:
        return False


def _is_hdf5(path: Path) -> bool:
    with path.open("rb") as stream:
        return stream.read(len(_HEADER)).startswith(b"MATLAB 7.3")


def _described(description: str, path: Path) -> Description:
    try:
        record = json.loads(description)
    except ValueError as error:
        raise CaptureFormatError(f"'{path}': 'description' is not JSON: {error}") from error
    return from_record(record, f"'{path}', 'description'")


def _open_version_5(path: Path) -> tuple[str, Any]:
    from scipy.io import loadmat

    try:
        content = loadmat(path, variable_names=["adc", "description"])
    except Exception as error:  # of SciPy: struct.error, zlib.error, TypeError, its own
        raise _damaged(path, "5", error) from error
    for name in ("adc", "description"):
        if name not in content:
            raise _damaged(
                path,
                "5",
                f"it lacks the variable '{name}'; files of write_capture are read, other arrays belong into an AdcCube",
            )
    return str(np.ravel(content["description"])[0]), np.asarray(content["adc"])


def _open_hdf5(path: Path) -> tuple[str, Any]:
    import h5py

    try:
        file = h5py.File(path, "r")
        return "".join(chr(letter) for letter in file["description"][:].ravel()), file["adc"]
    except (OSError, KeyError) as error:
        raise _damaged(path, "7.3", error) from error


def _damaged(path: Path, version: str, reason: object) -> CaptureFormatError:
    size = path.stat().st_size
    return CaptureFormatError(
        f"'{path}' ({size:,} bytes) is truncated or no MATLAB file of version {version}: {reason}"
    )
