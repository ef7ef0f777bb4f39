"""`radar.npy` and `config.json` of Infineon's Radar SDK and Radar Fusion GUI, for boards such as BGT60TR13C.

`radar.npy`: uint16 (frame, rx, chirp, sample), real 12-bit words; arrays of the SDK's Python interface, float (the word
over 4,095), are read as well. Samples are words less 2,048, the middle of the converter's range; the mean of a
receiver, some hundred LSB of DC on a board, stays in them. `config.json` has the chirps
(`device_config.fmcw_single_shape`).
"""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna.radar import Radar
from rfgen_sionna.signal.formats.capture import Capture, CaptureFormatError, CaptureReport
from rfgen_sionna.signal.formats.consistency import check_json
from rfgen_sionna.signal.formats.files import atomic_files, data_file, need_file, warn_or_raise, write_json
from rfgen_sionna.signal.formats.frames import Quantizer, WriteRequest, channel_numbers, element_order, with_receivers
from rfgen_sionna.signal.formats.npy import NpyHeader, open_frames, read_header
from rfgen_sionna.signal.formats.sidecar import SUFFIX, Description, find_description, sidecar_of

NAME = "infineon"
STANDARD, CONFIG = "radar.npy", "config.json"
ADC_BITS = 12
MIDDLE = 1 << (ADC_BITS - 1)
"""Word of zero volts at the converter."""
_TOP = (1 << ADC_BITS) - 1
_MOST_RECEIVERS = 4
_DEFAULTS = {"aaf_cutoff_Hz": 500_000, "hp_cutoff_Hz": 80_000, "if_gain_dB": 33, "mimo_mode": "off"}
"""Filters and gain of the board, which this package does not simulate: defaults of Infineon's SDK."""
_CHECKED_FIELDS = frozenset(
    {
        "chirp_repetition_time_s",
        "end_frequency_Hz",
        "frame_repetition_time_s",
        "num_chirps_per_frame",
        "num_samples_per_chirp",
        "rx_antennas",
        "sample_rate_Hz",
        "start_frequency_Hz",
        "tx_antennas",
    }
)


def write(request: WriteRequest) -> CaptureReport:
    """Write `request.path` (or `radar.npy` in it, where it is a folder) and `config.json` beside; see `write_capture`.

    Raises
    ------
    CaptureFormatError
        The radar has a complex ADC, several Tx or several kinds of chirps.
    """
    cube, radar = request.cube, request.cube.radar
    receivers = _receivers(radar)
    loops, _, channels, samples = radar.frame_shape
    quantizer = Quantizer(request, NAME, MIDDLE)
    data = data_file(request.path, STANDARD)
    paths = (data, data.with_name(CONFIG), data.with_name(data.stem + SUFFIX))
    with atomic_files(paths, request.overwrite) as parts:
        shape = (cube.data.shape[0], channels, loops, samples)
        stored = np.lib.format.open_memmap(parts[0], mode="w+", dtype=np.uint16, shape=shape)
        for number, levels in enumerate(quantizer.frames(receivers)):
            stored[number] = levels[:, 0, :, :, 0].swapaxes(0, 1) + MIDDLE
        stored.flush()
        del stored
        write_json(parts[1], _config(radar, receivers))
        quantizer.write_sidecar(parts[2])
    return quantizer.report(paths)


def _config(radar: Radar, receivers: list[int]) -> dict[str, Any]:
    wave = radar.waveform
    start = wave.start_frequency + wave.slope * wave.adc_start_time
    shape = {
        **_DEFAULTS,
        "chirp_repetition_time_s": wave.idle_time + wave.ramp_end_time,
        "end_frequency_Hz": round(start + wave.slope * wave.num_samples / wave.sample_rate),
        "frame_repetition_time_s": wave.frame_period,
        "num_chirps_per_frame": wave.num_loops,
        "num_samples_per_chirp": wave.num_samples,
        "rx_antennas": sorted(receivers),
        "sample_rate_Hz": round(wave.sample_rate),
        "start_frequency_Hz": round(start),
        "tx_antennas": channel_numbers(radar.tx_names, "TX", 2, "the board"),
        "tx_power_level": 31,  # full power
    }
    return {"device_config": {"fmcw_single_shape": dict(sorted(shape.items()))}}


def read(path: str | os.PathLike[str], radar: Radar | None = None, *, partial: bool = False) -> Capture:
    """Open a `.npy`, the `config.json` beside it, or their folder; see `open_capture`.

    `config.json` gives the board, without `radar`, and the waveform and the receivers in use.
    """
    data = _data(Path(path))
    sidecar, config = sidecar_of(data), data.with_name(CONFIG)

    def same(found: Description) -> None:
        check_json(config, _config(found.radar, _receivers(found.radar)), _CHECKED_FIELDS, sidecar, partial)

    hardware = radar
    if not sidecar.is_file() and config.is_file():
        hardware = _configured(Radar.load(config), radar)
    known = find_description(data, sidecar, hardware, Description, same)
    receivers = _receivers(known.radar)
    loops, _, channels, samples = known.radar.frame_shape
    header = read_header(data)
    _check_array(data, header, (channels, loops, samples), config if config.is_file() else None, known.radar)
    stored = open_frames(data, header, known.frames, partial)
    if known.frames is not None and header.shape[0] != known.frames:
        warn_or_raise(f"'{data}' holds {header.shape[0]} frames; {known.frames} are expected", partial)

    def frame(number: int) -> NDArray[Any]:
        levels = _words(stored[number], data, number).astype(np.float32) - MIDDLE
        return element_order(levels.swapaxes(0, 1)[:, None], known.radar, receivers)

    times = known.times(len(stored))
    return Capture(NAME, (data,), known.radar, times, known.scale, known.seed, frame, (config, sidecar), "none")


def _data(path: Path) -> Path:
    if path.suffix.lower() == ".npy":
        return need_file(path)
    folder = path if path.is_dir() else path.parent
    if (folder / STANDARD).is_file():
        return folder / STANDARD
    found = sorted(folder.glob("*.npy"))
    if len(found) > 1:
        raise CaptureFormatError(f"'{folder}' holds {', '.join(repr(file.name) for file in found)}: open one of them")
    return found[0] if found else need_file(folder / STANDARD)


def _configured(found: Radar, hardware: Radar | None) -> Radar:
    """Radar of a `config.json`, on other hardware where it is given."""
    if hardware is None:
        return found
    if absent := [name for name in found.rx_names if name not in hardware.rx_names]:
        raise CaptureFormatError(
            f"rx_antennas of '{CONFIG}' has {absent[0]}; radar '{hardware.name}' has {', '.join(hardware.rx_names)}"
        )
    if hardware.adc.real != found.adc.real or len(hardware.tx_names) != len(found.tx_names):
        kind = "real" if hardware.adc.real else "complex"
        raise CaptureFormatError(
            f"'{CONFIG}' is that of a board with {len(found.tx_names)} Tx and real samples; radar '{hardware.name}' "
            f"has {len(hardware.tx_names)} Tx and {kind} ones: leave `radar` out"
        )
    kept = [hardware.rx_names.index(name) for name in found.rx_names]
    return with_receivers(replace(hardware, preset=found.preset, waveform=found.waveform, adc=found.adc), kept)


def _receivers(radar: Radar) -> list[int]:
    wave = radar.waveform
    if not radar.adc.real:
        raise CaptureFormatError(
            f"radar '{radar.name}' has a complex ADC; boards of '{NAME}' have real samples (adc.real): take "
            "'position2go' for that board, 'dca1000' for those of TI, 'matlab' for any"
        )
    if len(radar.tx_names) != 1 or wave.num_slots > 1 or wave.slope <= 0:
        raise CaptureFormatError(
            f"preset '{radar.preset}' has {wave.num_slots} slots of {len(radar.tx_names)} Tx and a slope of "
            f"{wave.slope / 1e12:g} MHz/us: '{NAME}' has one Tx and chirps upwards: take 'matlab'"
        )
    return channel_numbers(radar.rx_names, "RX", _MOST_RECEIVERS, "a board of Infineon")


def _check_array(
    path: Path, header: NpyHeader, wanted: tuple[int, int, int], config: Path | None, radar: Radar
) -> None:
    if header.fortran or header.dtype.kind not in "uif" or len(header.shape) != 4 or header.shape[1:] != wanted:
        origin = f"'{config.name}'" if config else f"radar '{radar.name}', preset '{radar.preset}'"
        raise CaptureFormatError(
            f"'{path}' holds {header.dtype} {header.shape}; (frame, rx, chirp, sample) with {wanted} after the "
            f"frames is needed by {origin}"
        )


def _words(stored: NDArray[Any], path: Path, frame: int) -> NDArray[Any]:
    """Words 0 … 4095 of a frame, from integers or from shares of 4,095."""
    words = np.rint(stored.astype(np.float64) * _TOP) if stored.dtype.kind == "f" else np.asarray(stored)
    low, high = words.min(), words.max()
    if not (low >= 0 and high <= _TOP):
        kind = "shares 0 … 1" if stored.dtype.kind == "f" else f"words 0 … {_TOP:,}"
        raise CaptureFormatError(
            f"'{path}', frame {frame}: {stored.dtype} values {stored.min():g} … {stored.max():g}; {kind} of a "
            f"{ADC_BITS}-bit converter are needed: restore the offset that was taken off, or put the samples into an "
            "AdcCube"
        )
    return words
