"""Files of TI's MMWCAS-RF-EVM: four devices of 4 Rx, recorded by a TDA2 host, one pair of files each.

`<device>_NNNN_data.bin`: int16, little-endian, I and Q in turn; order frame, loop, chirp as fired, sample, receiver.
`<device>_NNNN_idx.bin`: a header of 24 bytes, `<IIIIQ` = tag, version, flags, frames, bytes of data; then 48 bytes a
frame, `<HHIHH4IIQQ` = tag (the bytes "id"), version, flags (1, 0x101, 0x201, 0x301 of the four devices), width
(samples × 4 Rx × I and Q), height (chirps of all loops), pitch[4] (bytes of a chirp first), bytes, time stamp, offset.
The host begins a new pair of files before one exceeds 2047 MiB, and allocates files in advance:
the index, not the size, counts the data.

Time stamps are microseconds since the host was switched on (github.com/samxu29/mmwave-cli, check_ir_timestamps.py).
TI documents no unit: a read takes the one of 1 us, 1 ns and 1 ms in which frames are closest to a period apart.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import FloatArray
from rfgen_sionna.radar import Radar
from rfgen_sionna.signal.formats.capture import Capture, CaptureFormatError, CaptureReport
from rfgen_sionna.signal.formats.cascade_files import (
    DATA_NAME,
    DEVICES,
    ENTRY,
    FILE_TAG,
    FRAME_TAG,
    HEADER,
    WORDS_PER_SAMPLE,
    FrameLocation,
    Frames,
    find_frames,
)
from rfgen_sionna.signal.formats.consistency import check_json
from rfgen_sionna.signal.formats.files import atomic_files, warn_or_raise, write_json
from rfgen_sionna.signal.formats.frames import (
    Quantizer,
    WriteRequest,
    channel_numbers,
    complex_only,
    element_order,
    to_samples,
    with_receivers,
)
from rfgen_sionna.signal.formats.mmwave_studio import read_studio
from rfgen_sionna.signal.formats.mmwave_studio_chirps import CHECKED_FIELDS, FULL_SCALE, RX_PER_DEVICE
from rfgen_sionna.signal.formats.mmwave_studio_export import studio_config
from rfgen_sionna.signal.formats.sidecar import SUFFIX, Description, find_description, periodic_times, sidecar_of
from rfgen_sionna.signal.formats.studio_files import folder_config, is_config

NAME = "cascade"
MAX_FILE_SIZE = 2047 << 20  # of the TDA2 host [bytes]
SIDECAR = "capture" + SUFFIX
_TIME_UNITS = (1e-6, 1e-9, 1e-3)  # [s] of a time stamp, the written one first


def write(request: WriteRequest, *, max_file_size: int = MAX_FILE_SIZE) -> CaptureReport:
    """Write the files of the four devices into the folder `request.path`; see `write_capture`.

    A data file has at most `max_file_size` bytes, but at least one frame.

    Raises
    ------
    CaptureFormatError
        The radar does not have 16 receivers, or has more than 12 transmitters.
    """
    radar, frames = request.cube.radar, request.cube.data.shape[0]
    complex_only(radar, NAME)
    receivers = _receivers(radar)
    loops, slots, _, samples = radar.frame_shape
    frame_size = 4 * loops * slots * samples * RX_PER_DEVICE
    per_file = max(1, max_file_size // frame_size)
    groups = [range(first, min(first + per_file, frames)) for first in range(0, frames, per_file)]
    config = studio_config(radar, frames, len(DEVICES))
    quantizer, folder = Quantizer(request, NAME, FULL_SCALE), request.path
    data = [folder / f"{name}_{group:04d}_data.bin" for group in range(len(groups)) for name in DEVICES]
    index = [folder / f"{name}_{group:04d}_idx.bin" for group in range(len(groups)) for name in DEVICES]
    paths = (*data, *index, folder / f"{folder.resolve().name}.mmwave.json", folder / SIDECAR)
    with atomic_files(paths, request.overwrite) as parts:
        remaining = quantizer.frames(receivers)
        for number, group in enumerate(groups):
            own = slice(len(DEVICES) * number, len(DEVICES) * (number + 1))
            with ExitStack() as stack:
                streams = [stack.enter_context(part.open("wb")) for part in parts[own]]
                for _ in group:
                    # (chirp, slot, rx, sample, IQ) to (chirp, slot, sample, rx, IQ)
                    ordered = next(remaining).swapaxes(2, 3)
                    for place, stream in enumerate(streams):
                        channels = slice(RX_PER_DEVICE * place, RX_PER_DEVICE * (place + 1))
                        stream.write(np.ascontiguousarray(ordered[..., channels, :], dtype="<i2").data)
            entries = _index(radar, request.cube.frame_times, group, frame_size)
            header = np.array((FILE_TAG, 1, 0, len(group), len(group) * frame_size), dtype=HEADER)
            for place, part in enumerate(parts[len(data) :][own]):
                entries["flags"] = place << 8 | 1  # the number of the device
                part.write_bytes(header.tobytes() + entries.tobytes())
        write_json(parts[-2], config)
        quantizer.write_sidecar(parts[-1])
    return quantizer.report(paths)


def _index(radar: Radar, times: FloatArray, group: range, frame_size: int) -> NDArray[Any]:
    loops, slots, _, samples = radar.frame_shape
    width = samples * WORDS_PER_SAMPLE
    if loops * slots > 0xFFFF or width > 0xFFFF or frame_size > 0xFFFFFFFF:
        raise CaptureFormatError(
            f"{loops * slots} chirps of {samples} samples a frame do not fit the index: at most 65535 chirps of "
            f"{0xFFFF // WORDS_PER_SAMPLE} samples"
        )
    entries = np.zeros(len(group), dtype=ENTRY)
    entries["tag"], entries["version"] = FRAME_TAG, 1
    entries["width"], entries["height"], entries["size"] = width, loops * slots, frame_size
    entries["pitch"][:, 0] = 4 * samples * RX_PER_DEVICE
    # The clock of the host is never negative.
    entries["time"] = np.rint((times[group.start : group.stop] - min(times[0], 0.0)) / _TIME_UNITS[0])
    entries["offset"] = np.arange(len(group)) * frame_size
    return entries


def read(path: str | os.PathLike[str], radar: Radar | None = None, *, partial: bool = False) -> Capture:
    """Open the capture in a folder; see `open_capture`. Without a sidecar, `radar` gives the hardware, and the
    `.mmwave.json` that `path`, the only `.setup.json` or the folder names the waveform and the Tx elements that fire.

    With `partial`, devices without a whole frame are left out, together with their receivers in the radar; the capture
    has the frames that all other devices hold. The indices of other devices replace a missing or damaged index; without
    any index, frames are contiguous.
    """
    folder = Path(path)
    if DATA_NAME.fullmatch(folder.name) or folder.suffix.lower() == ".json":
        folder = folder.parent
    sidecar = sidecar_of(folder / SIDECAR)
    configs = (Path(path),) if is_config(Path(path)) else folder_config(folder)

    def same(found: Description) -> None:
        if configs:
            wanted = studio_config(found.radar, found.frames or 0, len(DEVICES))
            check_json(configs[0], wanted, CHECKED_FIELDS, sidecar, partial)

    known = find_description(folder, sidecar, radar, lambda hardware: _configured(configs, hardware), same)
    receivers = _receivers(known.radar)
    loops, slots, _, samples = known.radar.frame_shape
    frame_size = 4 * loops * slots * samples * RX_PER_DEVICE
    found, count = find_frames(folder, Frames(samples, loops * slots, frame_size), partial)
    wanted = count if known.frames is None else known.frames
    held = {name: {n: place for n, place in own.items() if n < wanted} for name, own in found.items()}
    left = [name for name in DEVICES if held[name]]
    numbers = sorted(set.intersection(*(set(held[name]) for name in left))) if left else []
    if count > wanted or any(len(own) != wanted for own in held.values()):
        counts = ", ".join(f"{name} {len(own)}" for name, own in found.items())
        message = f"'{folder}' holds frames of: {counts}; {wanted} of each are expected"
        if not numbers:
            raise CaptureFormatError(f"{message}: no frame is whole in all of {', '.join(left) or 'them'}")
        warn_or_raise(message, partial)
    taken = known.radar
    if len(left) < len(DEVICES):
        kept = [n for n, rx in enumerate(receivers) if DEVICES[(rx - 1) // RX_PER_DEVICE] in left]
        taken = with_receivers(taken, kept)
        receivers = [receivers[n] for n in kept]
    places = [[held[name][number] for name in left] for number in numbers]

    def frame(number: int) -> NDArray[Any]:
        stored = np.empty((loops, slots, samples, len(left), RX_PER_DEVICE, 2), dtype=np.int16)
        shape = (loops, slots, samples, RX_PER_DEVICE, 2)
        for device, place in enumerate(places[number]):
            stored[:, :, :, device] = np.memmap(place.file, dtype="<i2", mode="r", offset=place.offset, shape=shape)
        if known.iq_swap:
            stored = stored[..., ::-1]
        levels = stored.reshape(loops, slots, samples, -1, 2).swapaxes(2, 3)
        return element_order(to_samples(levels), taken, receivers)

    files = tuple(sorted({place.file for row in places for place in row}))
    times = _times([row[0] for row in places], numbers, taken) if known.frame_times is None else known.times(wanted)
    if known.frame_times is not None:
        times = times[numbers]
    return Capture(NAME, files, taken, times, known.scale, known.seed, frame, (*configs, sidecar), "sample")


def _configured(configs: Sequence[Path], hardware: Radar) -> Description:
    if not configs:
        return Description(hardware)
    # The index counts the frames: the host drops some.
    return replace(read_studio(configs[0], hardware, len(DEVICES)), frame_times=None)


def _receivers(radar: Radar) -> list[int]:
    count = RX_PER_DEVICE * len(DEVICES)
    if len(radar.rx_names) != count:
        raise CaptureFormatError(
            f"radar '{radar.name}' has {len(radar.rx_names)} receivers; the cascade records {count}, "
            f"{RX_PER_DEVICE} a device"
        )
    return channel_numbers(radar.rx_names, "RX", count, f"a cascade of {len(DEVICES)} devices")


def _times(places: list[FrameLocation], numbers: list[int], radar: Radar) -> FloatArray:
    """(frame,) times after the first frame [s]; the unit is the one in which steps are closest to a frame period."""
    period = radar.waveform.frame_period
    stamps = [place.stamp for place in places if place.stamp is not None]
    if len(stamps) < len(places):
        return periodic_times(numbers[-1] + 1, radar)[numbers] - numbers[0] * period
    since = np.asarray(stamps, dtype=np.float64) - stamps[0]
    steps = np.diff(since) / np.diff(numbers)
    unit = _TIME_UNITS[0]
    if len(steps) and np.median(steps) > 0:
        unit = min(_TIME_UNITS, key=lambda unit: abs(np.log(np.median(steps) * unit / period)))
    return np.asarray(since * unit)
