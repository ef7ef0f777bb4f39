"""`adc_data.bin` of a DCA1000 on TI's xWR16xx, xWR18xx and xWR68xx (two LVDS lanes, complex samples).

int16, little-endian, `I0 I1 Q0 Q1 I2 I3 Q2 Q3 …`; order frame, loop, slot as fired, receiver, sample; no headers
(TI SWRA581B). Beside it lie `.mmwave.json` and `.setup.json`, as mmWave Studio writes them, and the sidecar.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna.radar import Radar
from rfgen_sionna.signal.formats.capture import Capture, CaptureFormatError, CaptureReport
from rfgen_sionna.signal.formats.consistency import check_json
from rfgen_sionna.signal.formats.files import (
    atomic_files,
    companion_path,
    data_file,
    need_file,
    whole_frames,
    write_json,
)
from rfgen_sionna.signal.formats.frames import (
    WriteRequest,
    channel_numbers,
    complex_lsb,
    element_order,
    firing_order,
    frame_shape,
    frames_of,
    quantize,
)
from rfgen_sionna.signal.formats.sidecar import (
    SUFFIX,
    Description,
    describe,
    find_description,
    periodic_times,
    write_sidecar,
)
from rfgen_sionna.signal.formats.studio import read_studio, setup_config, studio_config
from rfgen_sionna.signal.formats.studio_chirps import CHECKED_FIELDS, RX_PER_DEVICE

NAME = "dca1000"
STANDARD = "adc_data.bin"
FULL_SCALE = 1 << 15
BANDS = ((57e9, 64e9), (76e9, 81e9))
"""Bands of the devices [Hz]."""


def write(request: WriteRequest) -> CaptureReport:
    """Write `request.path` (or `adc_data.bin` in it, where it is a folder) with its JSON files; see `write_capture`.

    Raises
    ------
    CaptureFormatError
        More than 3 Tx or 4 Rx, an odd number of samples, or a band that no device has: one device cannot take such
        frames.
    """
    cube, radar = request.cube, request.cube.radar
    _device_band(radar)
    receivers = channel_numbers(radar.rx_names, "RX", RX_PER_DEVICE, "one device")
    _even_samples(radar)
    config = studio_config(radar, cube.data.shape[0])
    divisor, declared = request.resolve_scale(FULL_SCALE)
    data = data_file(request.path, STANDARD)
    paths = (
        data,
        companion_path(data, ".mmwave.json"),
        companion_path(data, ".setup.json"),
        companion_path(data, SUFFIX),
    )
    clipped = 0
    with atomic_files(paths, request.overwrite) as parts:
        with parts[0].open("wb") as stream:
            for frame in frames_of(cube):
                levels, beyond = quantize(frame, divisor, FULL_SCALE)
                clipped += beyond
                fired = firing_order(levels, radar, receivers)
                # (…, sample, IQ) to (…, pair of samples, IQ, sample of the pair)
                pairs = fired.reshape(*fired.shape[:3], -1, 2, 2).swapaxes(-1, -2)
                stream.write(np.ascontiguousarray(pairs, dtype="<i2").data)
        write_json(parts[1], config)
        write_json(parts[2], setup_config(radar, data, paths[1]))
        write_sidecar(parts[3], describe(cube, NAME, declared, FULL_SCALE))
    return CaptureReport(NAME, paths, cube.data.shape[0], declared, FULL_SCALE, clipped, 2 * cube.data.size)


def read(path: str | os.PathLike[str], radar: Radar | None = None, *, partial: bool = False) -> Capture:
    """Open a capture; see `open_capture`. Without a sidecar, `radar` gives the hardware and `.mmwave.json`, where it
    is there, the waveform and the Tx elements that fire.
    """
    data = need_file(data_file(path, STANDARD))
    sidecar, config = companion_path(data, SUFFIX), companion_path(data, ".mmwave.json")

    def same(found: Description) -> None:
        check_json(config, studio_config(found.radar, found.frames or 0), CHECKED_FIELDS, sidecar, partial)

    known = find_description(data, sidecar, radar, lambda hardware: _configured(data, hardware), same)
    _even_samples(known.radar)
    shape = frame_shape(known.radar)
    frame_size = 4 * int(np.prod(shape))
    if radar is not None and not sidecar.is_file() and config.is_file():
        _check_size(data, config, known, radar)
    frames = whole_frames(data, data.stat().st_size, frame_size, known.frames, partial)
    receivers = channel_numbers(known.radar.rx_names, "RX", RX_PER_DEVICE, "one device")
    loops, slots, channels, samples = shape
    packed = (loops, slots, channels, samples // 2, 2, 2)

    def frame(number: int) -> NDArray[Any]:
        stored = np.memmap(data, dtype="<i2", mode="r", offset=number * frame_size, shape=packed)
        levels = stored.swapaxes(-1, -2).reshape(loops, slots, channels, samples, 2)
        if known.iq_swap:
            levels = levels[..., ::-1]
        return element_order(complex_lsb(levels), known.radar, receivers)

    return Capture(NAME, (data,), known.radar, known.times(frames), known.scale, known.seed, frame)


def _check_size(data: Path, config: Path, known: Description, hardware: Radar) -> None:
    """Refuse sizes that a capture of this configuration cannot have, cut off or not: its frames would be scrambled.

    Raises
    ------
    CaptureFormatError
        Naming the fields of which one is wrong.
    """
    loops, slots, channels, samples = frame_shape(known.radar)
    each, size = 4 * loops * slots * channels, data.stat().st_size
    said = (
        f"'{data}' has {size:,} bytes; by '{config.name}' a frame has {each * samples:,}: numLoops x chirps {loops} x "
        f"{slots}, receivers {channels}, numAdcSamples {samples}, 4 bytes a sample"
    )
    # What was cut off ends anywhere; a file that is just right for frames of another size was not cut off.
    broken = size % (each * samples) != 0
    own, rest = divmod(size, 4 * int(np.prod(frame_shape(hardware))))
    exact = known.frames not in (None, size // (each * samples)) and own == known.frames
    if not rest and (broken or exact) and frame_shape(hardware) != frame_shape(known.radar):
        raise CaptureFormatError(
            f"{said}; the size is that of whole frames (chirp, tx, rx, sample) of {frame_shape(hardware)}, those of "
            f"radar '{hardware.name}', preset '{hardware.preset}'"
        )
    if known.frames is None:
        return
    said += f", numFrames {known.frames}"
    if size > known.frames * each * samples:
        over = size - known.frames * each * samples
        raise CaptureFormatError(f"{said}; {over:,} bytes are too many: one of these is not the capture's")
    other, rest = divmod(size, known.frames * each)
    if broken and not rest:
        raise CaptureFormatError(f"{said}; the size is that of numAdcSamples {other}")


def _configured(data: Path, hardware: Radar) -> Description:
    config = companion_path(data, ".mmwave.json")
    if not config.is_file():
        return Description(hardware, None, None, None)
    found = read_studio(config, hardware)
    times = None if found.frames is None else periodic_times(found.frames, found.radar)
    return Description(found.radar, None, times, None, found.iq_swap)


def _device_band(radar: Radar) -> None:
    """Refuse what no device behind a DCA1000 has sent, such as the frames of a Position2Go."""
    centre = radar.center_frequency
    if not any(low <= centre <= high for low, high in BANDS):
        bands = " and ".join(f"{low / 1e9:g} … {high / 1e9:g} GHz" for low, high in BANDS)
        raise CaptureFormatError(
            f"radar '{radar.name}', preset '{radar.preset}', is at {centre / 1e9:.4g} GHz; a DCA1000 records devices "
            f"of {bands}: 'position2go' is the format of that board, 'matlab' and 'rfgenesis' have no band"
        )


def _even_samples(radar: Radar) -> None:
    if radar.waveform.num_samples % 2:
        raise CaptureFormatError(
            f"waveform.num_samples is {radar.waveform.num_samples}: "
            "two lanes carry samples in pairs, an even number is needed"
        )
