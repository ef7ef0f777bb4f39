"""`radar_frames.npy` of RF Genesis (github.com/Asixa/RF-Genesis): complex128 (frame, tx, rx, chirp, sample).

Its Tx axis counts slots (its `TI1843_config.json` lists TX1, TX3, TX2). `<name>_config.json` has the fields of that
configuration, which RF Genesis' own tools need. Samples are floating-point numbers, by default of scale 1.
"""

from __future__ import annotations

import os
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import SPEED_OF_LIGHT
from rfgen_sionna.radar import Radar
from rfgen_sionna.signal.formats.capture import Capture, CaptureFormatError, CaptureReport
from rfgen_sionna.signal.formats.consistency import check_json
from rfgen_sionna.signal.formats.files import (
    atomic_files,
    companion,
    data_file,
    need_file,
    warn_or_raise,
    write_json,
)
from rfgen_sionna.signal.formats.frames import WriteRequest, complex_only, frames_of
from rfgen_sionna.signal.formats.npy import open_frames, read_header
from rfgen_sionna.signal.formats.sidecar import SUFFIX, Description, describe, find_description, sidecar_of

NAME = "rfgenesis"
STANDARD = "radar_frames.npy"
_ANGLE_BINS = 64  # of RF Genesis' own configuration
_FIELDS = (
    "num_tx num_rx fc slope adc_samples adc_start_time sample_rate idle_time ramp_end_time chirp_per_frame "
    "frame_per_second tx_loc rx_loc"
)
_CHECKED_FIELDS = frozenset(_FIELDS.split())
"""Fields of the configuration that determine the samples or their layout."""


def write(request: WriteRequest) -> CaptureReport:
    """Write `request.path` (or `radar_frames.npy` in it, where it is a folder) and its JSON; see `write_capture`."""
    cube, radar, frames = request.cube, request.cube.radar, request.cube.data.shape[0]
    complex_only(radar, NAME)
    if radar.waveform.slots:
        raise CaptureFormatError(
            f"preset '{radar.preset}' has {radar.waveform.multiplexing} slots of {len(radar.waveform.profiles)} "
            "profiles; RF Genesis has one Tx at a time and one profile: take 'matlab'"
        )
    divisor, declared = request.resolve_scale(None)
    loops, slots, channels, samples = radar.frame_shape
    order = list(radar.waveform.tx_order)
    data = data_file(request.path, STANDARD)
    paths = (data, companion(data, "_config.json"), companion(data, SUFFIX))
    with atomic_files(paths, request.overwrite) as parts:
        stored = np.lib.format.open_memmap(
            parts[0], mode="w+", dtype=np.complex128, shape=(frames, slots, channels, loops, samples)
        )
        for number, frame in enumerate(frames_of(cube)):
            stored[number] = frame[:, order].transpose(1, 2, 0, 3) / divisor
        stored.flush()
        del stored
        write_json(parts[1], _config(radar))
        write_json(parts[2], describe(cube, NAME, declared, None))
    return CaptureReport(NAME, paths, frames, declared, None, 0, 2 * cube.data.size)


def _config(radar: Radar) -> dict[str, Any]:
    """RF Genesis' configuration in Hz, µs, ksps and MHz/µs; elements in half wavelengths, x along the array."""
    wave = radar.waveform
    pitch = 0.5 * SPEED_OF_LIGHT / wave.start_frequency

    def places(positions: NDArray[Any]) -> list[list[float]]:
        # (boresight, left, up) to (left, up, boresight), both right-handed
        return [[round(float(position[axis] / pitch), 6) for axis in (1, 2, 0)] for position in positions]

    return {
        "c0": SPEED_OF_LIGHT,
        "num_tx": len(radar.tx_positions),
        "num_rx": len(radar.rx_positions),
        "fc": wave.start_frequency,
        "slope": wave.slope / 1e12,
        "adc_samples": wave.num_samples,
        "adc_start_time": wave.adc_start_time * 1e6,
        "sample_rate": wave.sample_rate / 1e3,
        "idle_time": wave.idle_time * 1e6,
        "ramp_end_time": wave.ramp_end_time * 1e6,
        "chirp_per_frame": wave.num_loops,
        "frame_per_second": 1.0 / wave.frame_period,
        "num_doppler_bins": wave.num_loops,
        "num_range_bins": wave.num_samples,
        "num_angle_bins": _ANGLE_BINS,
        "power": radar.tx_power_dbm,
        "tx_loc": places(radar.tx_positions[list(wave.tx_order)]),
        "rx_loc": places(radar.rx_positions),
    }


def read(path: str | os.PathLike[str], radar: Radar | None = None, *, partial: bool = False) -> Capture:
    """Open a `radar_frames.npy`; see `open_capture`. Without a sidecar, `radar` must be the radar of the samples."""
    data = need_file(data_file(path, STANDARD))
    sidecar, config = sidecar_of(data), companion(data, "_config.json")

    def same(found: Description) -> None:
        check_json(config, _config(found.radar), _CHECKED_FIELDS, sidecar, partial)

    known = find_description(data, sidecar, radar, lambda hardware: Description(hardware), same)
    loops, slots, channels, samples = known.radar.frame_shape
    header, shape = read_header(data), (slots, channels, loops, samples)
    if header.fortran or header.dtype.kind != "c" or len(header.shape) != 5 or header.shape[1:] != shape:
        raise CaptureFormatError(
            f"'{data}' holds {header.dtype} {header.shape}; complex (frame, tx, rx, chirp, sample) with {shape} after "
            "the frames is needed for this radar"
        )
    stored = open_frames(data, header, None, partial)
    frames = len(stored)
    if known.frames is not None and frames != known.frames:
        warn_or_raise(f"'{data}' holds {frames} frames; {known.frames} are expected", partial)
        frames = min(frames, known.frames)
    elements = np.argsort(known.radar.waveform.tx_order)

    def frame(number: int) -> NDArray[Any]:
        return np.asarray(stored[number])[elements].transpose(2, 0, 1, 3)

    return Capture(NAME, (data,), known.radar, known.times(frames), known.scale, known.seed, frame, (config, sidecar))
