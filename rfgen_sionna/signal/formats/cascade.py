"""The files of TI's MMWCAS-RF-EVM: four devices of 4 Rx, recorded by a TDA2 host, one pair of files each.

`<device>_NNNN_data.bin`: int16, little-endian, I and Q in turn; order frame, loop, chirp as fired, sample, receiver.
`<device>_NNNN_idx.bin`: a header of 24 bytes, `<IIIIQ` = tag, version, flags, frames, bytes of data; then 48 bytes a
frame, `<HHIHH4IIQQ` = tag, version, flags, width (samples), height (chirps), pitch[4] (bytes of a chirp first), bytes,
time stamp, offset. The host begins a new pair of files before one exceeds 2047 MiB, and allocates files in advance:
the index, not the size, says how much is data. Time stamps are in microseconds in the captures that published readers
process; other units are recognised on reading by the frame period.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna.radar import Radar
from rfgen_sionna.records import AdcCube, FloatArray
from rfgen_sionna.signal.formats.capture import Capture, CaptureFormatError, CaptureReport
from rfgen_sionna.signal.formats.files import complain, staged, write_json
from rfgen_sionna.signal.formats.frames import (
    Scale,
    channel_numbers,
    check_cube,
    complex_lsb,
    element_order,
    firing_order,
    frame_shape,
    frames_of,
    quantize,
    resolve_scale,
)
from rfgen_sionna.signal.formats.sidecar import SUFFIX, Description, describe, described, write_sidecar
from rfgen_sionna.signal.formats.studio import read_studio, studio_config
from rfgen_sionna.signal.formats.studio_chirps import RX_PER_DEVICE

NAME = "cascade"
DEVICES = ("master", "slave1", "slave2", "slave3")
FULL_SCALE = 1 << 15
MAX_FILE_SIZE = 2047 << 20
SIDECAR = "capture" + SUFFIX
DATA_NAME = re.compile(r"(master|slave[123])_(\d{4})_(data|idx)\.bin")

_HEADER = np.dtype([("tag", "<u4"), ("version", "<u4"), ("flags", "<u4"), ("frames", "<u4"), ("size", "<u8")])
_ENTRY = np.dtype(
    [
        ("tag", "<u2"),
        ("version", "<u2"),
        ("flags", "<u4"),
        ("width", "<u2"),
        ("height", "<u2"),
        ("pitch", "<u4", 4),
        ("size", "<u4"),
        ("time", "<u8"),
        ("offset", "<u8"),
    ]
)
_FILE_TAG, _FRAME_TAG = 0x746B6362, 0x6964
_TIME_UNITS = (1e-6, 1e-9, 1e-3)


def write(
    cube: AdcCube,
    path: str | os.PathLike[str],
    *,
    scale: Scale = "auto",
    full_scale_dbm: float | None = None,
    overwrite: bool = False,
    max_file_size: int = MAX_FILE_SIZE,
) -> CaptureReport:
    """Write the files of the four devices into the folder `path`; see `write_capture`.

    `max_file_size` [bytes] is where a new pair of files begins.

    Raises
    ------
    CaptureFormatError
        The radar has not the 16 receivers of the board, or more than its 12 transmitters.
    """
    check_cube(cube)
    radar, frames = cube.radar, cube.data.shape[0]
    receivers = _receivers(radar)
    loops, slots, _, samples = frame_shape(radar)
    frame_size = 4 * loops * slots * samples * RX_PER_DEVICE
    per_file = max(1, max_file_size // frame_size)
    groups = [range(first, min(first + per_file, frames)) for first in range(0, frames, per_file)]
    config = studio_config(radar, frames, len(DEVICES))
    divisor, declared = resolve_scale(cube, scale, full_scale_dbm, FULL_SCALE)
    folder = Path(path)
    data = [folder / f"{name}_{group:04d}_data.bin" for group in range(len(groups)) for name in DEVICES]
    index = [folder / f"{name}_{group:04d}_idx.bin" for group in range(len(groups)) for name in DEVICES]
    paths = (*data, *index, folder / f"{folder.resolve().name}.mmwave.json", folder / SIDECAR)
    clipped = 0
    with staged(paths, overwrite) as parts:
        remaining = frames_of(cube)
        for number, group in enumerate(groups):
            own = slice(len(DEVICES) * number, len(DEVICES) * (number + 1))
            with ExitStack() as stack:
                streams = [stack.enter_context(part.open("wb")) for part in parts[own]]
                for _ in group:
                    levels, beyond = quantize(next(remaining), divisor, FULL_SCALE)
                    clipped += beyond
                    # (chirp, slot, rx, sample, IQ) to (chirp, slot, sample, rx, IQ)
                    ordered = firing_order(levels, radar, receivers).swapaxes(2, 3)
                    for place, stream in enumerate(streams):
                        channels = slice(RX_PER_DEVICE * place, RX_PER_DEVICE * (place + 1))
                        stream.write(np.ascontiguousarray(ordered[..., channels, :], dtype="<i2").data)
            entries = _index(radar, cube.frame_times, group, frame_size)
            header = np.array((_FILE_TAG, 1, 0, len(group), len(group) * frame_size), dtype=_HEADER)
            for part in parts[len(data) :][own]:
                part.write_bytes(header.tobytes() + entries.tobytes())
        write_json(parts[-2], config)
        write_sidecar(parts[-1], describe(cube, NAME, declared, FULL_SCALE))
    return CaptureReport(NAME, paths, frames, declared, FULL_SCALE, clipped, 2 * cube.data.size)


def _index(radar: Radar, times: FloatArray, group: range, frame_size: int) -> NDArray[Any]:
    loops, slots, _, samples = frame_shape(radar)
    if loops * slots > 0xFFFF or samples > 0xFFFF or frame_size > 0xFFFFFFFF:
        raise CaptureFormatError(
            f"{loops * slots} chirps of {samples} samples a frame do not fit the index: at most 65535 of each"
        )
    entries = np.zeros(len(group), dtype=_ENTRY)
    entries["tag"], entries["version"], entries["flags"] = _FRAME_TAG, 1, 1
    entries["width"], entries["height"], entries["size"] = samples, loops * slots, frame_size
    entries["pitch"][:, 0] = 4 * samples * RX_PER_DEVICE
    # The host's clock never was negative.
    entries["time"] = np.rint((times[group.start : group.stop] - min(times[0], 0.0)) / _TIME_UNITS[0])
    entries["offset"] = np.arange(len(group)) * frame_size
    return entries


def read(path: str | os.PathLike[str], radar: Radar | None = None, *, partial: bool = False) -> Capture:
    """Open the capture in a folder; see `open_capture`. Without a sidecar, `radar` gives the hardware and the
    folder's only `.mmwave.json`, where there is one, the waveform and the Tx elements that fire.
    """
    folder = Path(path)
    if DATA_NAME.fullmatch(folder.name):
        folder = folder.parent
    known = described(folder, folder / SIDECAR, radar, lambda hardware: _configured(folder, hardware))
    receivers = _receivers(known.radar)
    loops, slots, _, samples = frame_shape(known.radar)
    frame_size = 4 * loops * slots * samples * RX_PER_DEVICE
    devices = [list(_frames_of_device(folder, name, known.radar, frame_size, partial)) for name in DEVICES]
    counts = [len(found) for found in devices]
    wanted = max(counts) if known.frames is None else known.frames
    frames = min([*counts, wanted])
    if any(count != wanted for count in counts):
        held = ", ".join(f"{name} {count}" for name, count in zip(DEVICES, counts, strict=True))
        message = f"'{folder}' holds frames of: {held}; {wanted} of each are expected"
        if frames == 0:
            raise CaptureFormatError(message)
        complain(message, partial)
    times = known.times(frames)
    if known.frame_times is None:
        times = _seconds([entry[2] for entry in devices[0][:frames]], known.radar.waveform.frame_period)

    def frame(number: int) -> NDArray[Any]:
        stored = np.empty((loops, slots, samples, len(DEVICES), RX_PER_DEVICE, 2), dtype=np.int16)
        for place, found in enumerate(devices):
            file, offset, _ = found[number]
            shape = (loops, slots, samples, RX_PER_DEVICE, 2)
            stored[:, :, :, place] = np.memmap(file, dtype="<i2", mode="r", offset=offset, shape=shape)
        if known.iq_swap:
            stored = stored[..., ::-1]
        levels = stored.reshape(loops, slots, samples, -1, 2).swapaxes(2, 3)
        return element_order(complex_lsb(levels), known.radar, receivers)

    files = tuple(sorted({entry[0] for found in devices for entry in found}))
    return Capture(NAME, files, known.radar, times, known.scale, known.seed, frame)


def _frames_of_device(
    folder: Path, name: str, radar: Radar, frame_size: int, partial: bool
) -> Iterator[tuple[Path, int, int]]:
    """File, offset and time stamp of each frame that one device recorded."""
    files = sorted(path for path in folder.glob(f"{name}_*_data.bin") if DATA_NAME.fullmatch(path.name))
    if not files:
        raise FileNotFoundError(f"capture file '{folder / f'{name}_0000_data.bin'}' does not exist")
    loops, slots, _, samples = frame_shape(radar)
    for data in files:
        index = data.with_name(data.name.replace("_data", "_idx"))
        if not index.is_file():  # the devices run in step, and often only the master's index is kept
            index = data.with_name(re.sub(r"^slave\d", "master", index.name))
        entries = _read_index(index, partial)
        size = data.stat().st_size
        for number, entry in enumerate(entries):
            if (entry["width"], entry["height"], entry["size"]) != (samples, loops * slots, frame_size):
                raise CaptureFormatError(
                    f"'{index}', frame {number}: {entry['width']} samples × {entry['height']} chirps, "
                    f"{entry['size']} bytes; the radar's frames have {samples} × {loops * slots}, {frame_size} bytes"
                )
            offset = int(entry["offset"])
            if offset + frame_size > size:
                complain(
                    f"'{data}' has {size:,} bytes; frame {number} lies at {offset:,} … {offset + frame_size:,}: "
                    f"{offset + frame_size - max(size, offset):,} of its {frame_size:,} bytes are missing, "
                    f"and {len(entries) - number - 1} frames after it",
                    partial,
                )
                return
            yield data, offset, int(entry["time"])


def _read_index(path: Path, partial: bool) -> NDArray[Any]:
    if not path.is_file():
        raise FileNotFoundError(f"capture file '{path}' does not exist")
    content = path.read_bytes()
    if len(content) < _HEADER.itemsize:
        raise CaptureFormatError(f"'{path}' has {len(content)} bytes; its header alone has {_HEADER.itemsize}")
    header = np.frombuffer(content, dtype=_HEADER, count=1)[0]
    if header["tag"] != _FILE_TAG:
        raise CaptureFormatError(f"'{path}' begins with 0x{header['tag']:08x}; an index begins with 0x{_FILE_TAG:08x}")
    present = (len(content) - _HEADER.itemsize) // _ENTRY.itemsize
    declared = int(header["frames"])
    wanted = _HEADER.itemsize + declared * _ENTRY.itemsize
    if len(content) != wanted:
        complain(
            f"'{path}' has {len(content):,} bytes; a header and {declared} entries are {wanted:,}: "
            f"{abs(wanted - len(content)):,} bytes are {'missing' if len(content) < wanted else 'too many'}",
            partial,
        )
    entries = np.frombuffer(content, dtype=_ENTRY, count=min(present, declared), offset=_HEADER.itemsize)
    if bad := np.flatnonzero(entries["tag"] != _FRAME_TAG).tolist():
        raise CaptureFormatError(
            f"'{path}', frame {bad[0]}: tag 0x{entries['tag'][bad[0]]:04x}; 0x{_FRAME_TAG:04x} is needed"
        )
    return entries


def _configured(folder: Path, hardware: Radar) -> Description:
    configs = sorted(folder.glob("*.mmwave.json"))
    if len(configs) != 1:
        return Description(hardware, None, None, None)
    found = read_studio(configs[0], hardware, len(DEVICES))
    # Frames are counted by the index: the host drops some, and the last ones when it is stopped.
    return Description(found.radar, None, None, None, found.iq_swap)


def _receivers(radar: Radar) -> list[int]:
    count = RX_PER_DEVICE * len(DEVICES)
    if len(radar.rx_names) != count:
        raise CaptureFormatError(
            f"radar '{radar.name}' has {len(radar.rx_names)} receivers; the cascade records {count}, "
            f"{RX_PER_DEVICE} a device"
        )
    return channel_numbers(radar.rx_names, "RX", count, f"a cascade of {len(DEVICES)} devices")


def _seconds(stamps: list[int], period: float) -> FloatArray:
    """Times from the first frame on; the unit is the one in which frames are closest to `period` apart."""
    steps = np.diff(np.asarray(stamps, dtype=np.float64))
    unit = _TIME_UNITS[0]
    if len(steps) and np.median(steps) > 0:
        unit = min(_TIME_UNITS, key=lambda unit: abs(np.log(np.median(steps) * unit / period)))
    return np.asarray((np.asarray(stamps, dtype=np.float64) - stamps[0]) * unit)
