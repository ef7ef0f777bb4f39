"""Recordings of a DCA1000 on one device of TI: `adc_data.bin` and the like.

int16, little-endian, without headers; order frame, loop, slot as fired, then that of two lanes (xWR16xx, xWR18xx,
xWR68xx, AWR2944) or four (xWR12xx, xWR14xx), complex or real (:mod:`~rfgen_sionna.signal.formats.lanes`). A recording
has the names and JSON files of mmWave Studio (:mod:`~rfgen_sionna.signal.formats.studio_files`). Dumps of UDP packets
with their headers are unpacked (:mod:`~rfgen_sionna.signal.formats.udp`). The sidecar adds scale and radar.
"""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from rfgen_sionna.radar import Radar
from rfgen_sionna.signal.formats.capture import Capture, CaptureFormatError, CaptureReport
from rfgen_sionna.signal.formats.consistency import check_json
from rfgen_sionna.signal.formats.files import atomic_files, companion, data_file, write_json
from rfgen_sionna.signal.formats.frames import Quantizer, WriteRequest, channel_numbers, element_order, to_samples
from rfgen_sionna.signal.formats.lanes import LaneLayout, lanes_of
from rfgen_sionna.signal.formats.losses import Order
from rfgen_sionna.signal.formats.mmwave_studio import read_studio, setup_config
from rfgen_sionna.signal.formats.mmwave_studio_chirps import CHECKED_FIELDS, FULL_SCALE, RX_PER_DEVICE
from rfgen_sionna.signal.formats.mmwave_studio_export import studio_config
from rfgen_sionna.signal.formats.recorded_frames import (
    check_size,
    complete_stream,
    one_recording,
    open_stream,
    stored_receivers,
    warn_if_mirrored,
)
from rfgen_sionna.signal.formats.sidecar import SUFFIX, Description, find_description
from rfgen_sionna.signal.formats.studio_files import CONFIG, SETUP, find_files

NAME = "dca1000"
STANDARD = "adc_data.bin"
BANDS = ((57e9, 64e9), (76e9, 81e9))
"""Bands of the devices [Hz]: xWR68xx; xWR12xx, xWR14xx, xWR16xx, xWR18xx and AWR2944."""


def write(request: WriteRequest, *, lanes: int | None = None) -> CaptureReport:
    """Write `request.path` (or `adc_data.bin` in it, where it is a folder) with its JSON files; see `write_capture`.

    `lanes` are the LVDS lanes, 2 or 4; None takes those of the board.

    Raises
    ------
    CaptureFormatError
        More elements than a device has, a number of samples that the lanes cannot carry, or a band of no device.
    """
    cube, radar = request.cube, request.cube.radar
    _device_band(radar)
    receivers = channel_numbers(radar.rx_names, "RX", RX_PER_DEVICE, "one device")
    lanes = lanes_of(radar) if lanes is None else lanes
    layout = _layout(Description(radar, lanes=lanes), len(receivers))
    config = studio_config(radar, cube.data.shape[0], lanes=lanes)
    quantizer = Quantizer(request, NAME, FULL_SCALE)
    data = data_file(request.path, STANDARD)
    paths = (data, *(companion(data, suffix) for suffix in (CONFIG, SETUP, SUFFIX)))
    with atomic_files(paths, request.overwrite) as parts:
        with parts[0].open("wb") as stream:
            for fired in quantizer.frames(receivers):
                stream.write(layout.pack(fired).data)
        write_json(parts[1], config)
        write_json(parts[2], setup_config(radar, data, paths[1]))
        quantizer.write_sidecar(parts[3], lanes=lanes)
    return quantizer.report(paths)


def read(
    path: str | os.PathLike[str],
    radar: Radar | None = None,
    *,
    partial: bool = False,
    lanes: int | None = None,
    iq_swap: bool | None = None,
) -> Capture:
    """Open a recording by its folder or any of its files; see `open_capture`.

    Without a sidecar, `radar` gives the hardware, and a `.mmwave.json` the waveform, the Tx elements that fire, and the
    lanes. `lanes` are the LVDS lanes, 2 or 4; None takes those of the JSON, else of the board. `iq_swap` is whether Q
    precedes I; None takes `adc.iq_swap` of the radar (in a `.cfg` SampleSwap, in a JSON iqSwapSel). Where neither a
    sidecar nor a JSON confirms it, a spectrum with most of its energy at the far end is a :class:`CaptureWarning`.
    """
    recording = find_files(Path(path))
    sidecar, config = recording.sidecar, recording.config

    def same(found: Description) -> None:
        if config is not None:
            lanes = lanes_of(found.radar) if found.lanes is None else found.lanes
            wanted = studio_config(found.radar, found.frames or 0, lanes=lanes)
            check_json(config, wanted, CHECKED_FIELDS, sidecar, partial)

    def configured(hardware: Radar) -> Description:
        return Description(hardware) if config is None else read_studio(config, hardware)

    if recording.setup and recording.device:
        hint = f"'{recording.device}', the mmWaveDevice of '{recording.setup.name}'"
    else:
        hint = "" if config is None else f"'…', the board, which '{config.name}' does not name"
    known = find_description(recording.data[0], sidecar, radar, configured, same, hint)
    if lanes is not None:
        known = replace(known, lanes=lanes, interleaved=None)
    if iq_swap is not None:
        known = replace(known, iq_swap=iq_swap)
    _device_band(known.radar)
    receivers = channel_numbers(known.radar.rx_names, "RX", RX_PER_DEVICE, "one device")
    layout = _layout(known, len(receivers))
    recording = one_recording(recording, layout.frame_size, known.frames)
    data = recording.data[0]
    source, dump = open_stream(recording)
    layout, rows = stored_receivers(layout, receivers, source)
    cure = ""
    if not sidecar.is_file():
        if radar is not None and config is not None:
            check_size(source, data, config, layout, known, radar)
        elif config is None:
            cure = (
                f"; frames (chirp, tx, rx, sample) of {known.radar.frame_shape} are those of radar "
                f"'{known.radar.name}', preset '{known.radar.preset}': if others were recorded, put their {CONFIG} "
                "beside the data, or pass their configuration as radar=, a .cfg with board="
            )
    stream, frames = complete_stream(source, data, layout, known, partial, not dump, cure)
    size = layout.frame_size

    def frame(number: int) -> NDArray[Any]:
        levels = layout.unpack(stream.read(number * size, size))[:, :, rows]
        if known.iq_swap:
            levels = levels[..., ::-1]
        return element_order(to_samples(levels), known.radar, receivers)

    if frames and config is None and iq_swap is None and not sidecar.is_file():
        warn_if_mirrored(frame(0), known, data)
    used = tuple(file for file in (config, recording.setup, sidecar) if file is not None)
    order: Order = "sample" if layout.interleaved else "receiver"
    times = known.times(frames)
    return Capture(NAME, recording.data, known.radar, times, known.scale, known.seed, frame, used, order)


def _layout(known: Description, channels: int) -> LaneLayout:
    radar = known.radar
    loops, slots, _, samples = radar.frame_shape
    lanes = lanes_of(radar) if known.lanes is None else known.lanes
    interleaved = lanes == 4 if known.interleaved is None else known.interleaved
    return LaneLayout(loops, slots, channels, samples, 1 if radar.adc.real else 2, lanes, interleaved)


def _device_band(radar: Radar) -> None:
    """Refuse a carrier frequency of no device, such as the frames of a Position2Go."""
    centre = radar.center_frequency
    if not any(low <= centre <= high for low, high in BANDS):
        bands = " and ".join(f"{low / 1e9:g} … {high / 1e9:g} GHz" for low, high in BANDS)
        raise CaptureFormatError(
            f"radar '{radar.name}', preset '{radar.preset}', is at {centre / 1e9:.4g} GHz; a DCA1000 records devices "
            f"of {bands}: take 'position2go' for that board, or 'matlab' or 'rfgenesis' for any band"
        )
