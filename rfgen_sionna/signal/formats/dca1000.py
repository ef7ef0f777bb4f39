"""`adc_data.bin` of a DCA1000 on TI's xWR16xx, xWR18xx and xWR68xx (two LVDS lanes, complex samples).

int16, little-endian, `I0 I1 Q0 Q1 I2 I3 Q2 Q3 …`; order frame, loop, slot as fired, receiver, sample; no headers
(TI SWRA581B). `.mmwave.json` and `.setup.json` have the format of mmWave Studio; the sidecar adds scale and radar.
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
from rfgen_sionna.signal.formats.files import atomic_files, companion, data_file, need_file, whole_frames, write_json
from rfgen_sionna.signal.formats.frames import Quantizer, WriteRequest, channel_numbers, complex_lsb, element_order
from rfgen_sionna.signal.formats.mmwave_studio import read_studio, setup_config
from rfgen_sionna.signal.formats.mmwave_studio_chirps import CHECKED_FIELDS, FULL_SCALE, RX_PER_DEVICE
from rfgen_sionna.signal.formats.mmwave_studio_export import studio_config
from rfgen_sionna.signal.formats.sidecar import SUFFIX, Description, find_description

NAME = "dca1000"
STANDARD = "adc_data.bin"
BANDS = ((57e9, 64e9), (76e9, 81e9))
"""Bands of the devices [Hz]: xWR68xx, xWR16xx and xWR18xx."""


def write(request: WriteRequest) -> CaptureReport:
    """Write `request.path` (or `adc_data.bin` in it, where it is a folder) with its JSON files; see `write_capture`.

    Raises
    ------
    CaptureFormatError
        More than 3 Tx or 4 Rx, an odd number of samples, or a band of no device.
    """
    cube, radar = request.cube, request.cube.radar
    _device_band(radar)
    receivers = channel_numbers(radar.rx_names, "RX", RX_PER_DEVICE, "one device")
    _even_samples(radar)
    config = studio_config(radar, cube.data.shape[0])
    quantizer = Quantizer(request, NAME, FULL_SCALE)
    data = data_file(request.path, STANDARD)
    paths = (data, *(companion(data, suffix) for suffix in (".mmwave.json", ".setup.json", SUFFIX)))
    with atomic_files(paths, request.overwrite) as parts:
        with parts[0].open("wb") as stream:
            for fired in quantizer.frames(receivers):
                # (…, sample, IQ) to (…, pair of samples, IQ, sample of the pair)
                pairs = fired.reshape(*fired.shape[:3], -1, 2, 2).swapaxes(-1, -2)
                stream.write(np.ascontiguousarray(pairs, dtype="<i2").data)
        write_json(parts[1], config)
        write_json(parts[2], setup_config(radar, data, paths[1]))
        quantizer.write_sidecar(parts[3])
    return quantizer.report(paths)


def read(path: str | os.PathLike[str], radar: Radar | None = None, *, partial: bool = False) -> Capture:
    """Open a capture; see `open_capture`. Without a sidecar, `radar` gives the hardware, and an existing
    `.mmwave.json` the waveform and the Tx elements that fire."""
    data = need_file(data_file(path, STANDARD))
    sidecar, config = companion(data, SUFFIX), companion(data, ".mmwave.json")

    def same(found: Description) -> None:
        check_json(config, studio_config(found.radar, found.frames or 0), CHECKED_FIELDS, sidecar, partial)

    known = find_description(data, sidecar, radar, lambda hardware: _configured(data, hardware), same)
    _even_samples(known.radar)
    shape = known.radar.frame_shape
    frame_size = 4 * int(np.prod(shape))
    if radar is not None and not sidecar.is_file() and config.is_file():
        _check_size(data, config, known, radar)
    frames = whole_frames(data, frame_size, known.frames, partial)
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
    """Refuse a size that no capture of this configuration has, truncated or not: its frames would be scrambled."""
    loops, slots, channels, samples = known.radar.frame_shape
    each, size = 4 * loops * slots * channels, data.stat().st_size
    said = (
        f"'{data}' has {size:,} bytes; by '{config.name}' a frame has {each * samples:,}: numLoops x chirps {loops} x "
        f"{slots}, receivers {channels}, numAdcSamples {samples}, 4 bytes a sample"
    )
    # A truncated file ends anywhere; one that fits frames of another size exactly was not truncated.
    broken = size % (each * samples) != 0
    own, rest = divmod(size, 4 * int(np.prod(hardware.frame_shape)))
    exact = known.frames not in (None, size // (each * samples)) and own == known.frames
    if not rest and (broken or exact) and hardware.frame_shape != known.radar.frame_shape:
        raise CaptureFormatError(
            f"{said}; the size is that of whole frames (chirp, tx, rx, sample) of {hardware.frame_shape}, those of "
            f"radar '{hardware.name}', preset '{hardware.preset}'"
        )
    if known.frames is None:
        return
    said += f", numFrames {known.frames}"
    if size > known.frames * each * samples:
        over = size - known.frames * each * samples
        raise CaptureFormatError(f"{said}; {over:,} bytes are too many: one of these fields is wrong")
    other, rest = divmod(size, known.frames * each)
    if broken and not rest:
        raise CaptureFormatError(f"{said}; the size is that of numAdcSamples {other}")


def _configured(data: Path, hardware: Radar) -> Description:
    config = companion(data, ".mmwave.json")
    return read_studio(config, hardware) if config.is_file() else Description(hardware)


def _device_band(radar: Radar) -> None:
    """Refuse a carrier frequency of no device, such as the frames of a Position2Go."""
    centre = radar.center_frequency
    if not any(low <= centre <= high for low, high in BANDS):
        bands = " and ".join(f"{low / 1e9:g} … {high / 1e9:g} GHz" for low, high in BANDS)
        raise CaptureFormatError(
            f"radar '{radar.name}', preset '{radar.preset}', is at {centre / 1e9:.4g} GHz; a DCA1000 records devices "
            f"of {bands}: take 'position2go' for that board, or 'matlab' or 'rfgenesis' for any band"
        )


def _even_samples(radar: Radar) -> None:
    if radar.waveform.num_samples % 2:
        raise CaptureFormatError(
            f"waveform.num_samples is {radar.waveform.num_samples}: "
            "two lanes carry samples in pairs, an even number is needed"
        )
