"""Configuration files of mmWave Studio: `<name>.mmwave.json` and `<name>.setup.json`.

Fields are those of :mod:`rfgen_sionna.radar.studio_json`. Receive gain, filters and the clock of the lanes, which this
package does not simulate, have mmWave Studio's defaults in files that it writes.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from rfgen_sionna.radar import Radar
from rfgen_sionna.radar.board_frames import BoardFrames, element_numbers, enabled_rx, named_tx
from rfgen_sionna.radar.config import RadarConfigError
from rfgen_sionna.radar.radar_fields import preset_waveform
from rfgen_sionna.radar.studio_json import number, read_studio_config
from rfgen_sionna.signal.formats.capture import CaptureFormatError
from rfgen_sionna.signal.formats.files import read_json
from rfgen_sionna.signal.formats.sidecar import Description, periodic_times


def setup_config(radar: Radar, data: Path, config: Path) -> dict[str, Any]:
    """Content of `.setup.json`: the files of a capture, relative to its folder."""
    return {
        "createdByVersion": "rfgen_sionna",
        "mmWaveDevice": radar.name.lower(),
        "operatingFreq": round(radar.waveform.start_frequency / 1e9),
        "captureHardware": "DCA1000",
        "DCA1000Config": {
            "dataLoggingMode": "raw",
            "dataTransferMode": "LVDSCapture",
            "dataCaptureMode": "ethernetStream",
            "packetSequenceEnable": 1,
            "packetDelay_us": 25,
        },
        "configUsed": config.name,
        "capturedFiles": {
            "numFilesCollected": 1,
            "fileBasePath": ".",
            "files": [{"rawFileName": data.name, "processedFileName": data.name}],
        },
    }


def radar_from_studio(
    path: str | os.PathLike[str], hardware: Radar | str | os.PathLike[str], preset: str | None = None
) -> Radar:
    """Radar of a `.mmwave.json`: `hardware` with its waveform, Tx elements, receivers and kind of samples.

    Parameters
    ----------
    path
        The `.mmwave.json`.
    hardware
        A radar, or the name or file of a board, as in :meth:`Radar.load`.
    preset
        "subframe0", "subframe1" … of advanced frames.

    Raises
    ------
    CaptureFormatError
        Naming the field that is missing or not supported.
    """
    if not isinstance(hardware, Radar):
        try:
            return Radar.load(path, preset, board=hardware)
        except ValueError as error:
            raise CaptureFormatError(str(error)) from error
    return _read(Path(path), hardware, None, preset).radar


def read_studio(path: str | os.PathLike[str], hardware: Radar, devices: int = 1) -> Description:
    """Read a `.mmwave.json`; `hardware` gives positions, pattern, power and noise.

    Raises
    ------
    CaptureFormatError
        Naming the field that is missing or not supported.
    """
    return _read(Path(path), hardware, devices, None)


def _read(path: Path, hardware: Radar, devices: int | None, preset: str | None) -> Description:
    config = read_json(path)
    try:
        studio = read_studio_config(config)
        if devices is not None and studio.frames.devices != devices:
            raise ValueError(f"mmWaveDevices has {studio.frames.devices} entries; {devices} needed")
        if devices is not None:
            _check_packets(config)
        radar = _with_frames(hardware, studio.frames, preset)
    except KeyError as error:
        raise CaptureFormatError(f"'{path}' lacks {error}") from error
    except (AttributeError, TypeError, ValueError, IndexError) as error:
        raise CaptureFormatError(f"'{path}': {error}") from error
    times = periodic_times(studio.num_frames, radar) if studio.num_frames else None
    return Description(radar, frame_times=times, lanes=studio.lanes, interleaved=studio.interleaved)


def _check_packets(config: dict[str, Any]) -> None:
    """Refuse recordings of more than ADC samples, which `rawDataReader` does not read either."""
    for record in config["mmWaveDevices"]:
        path = record["rawDataCaptureConfig"].get("rlDevDataPathCfg_t", {})
        for field, wanted in (("transferFmtPkt0", 1), ("transferFmtPkt1", 0)):
            if number(path.get(field, wanted)) & 63 != wanted:
                raise ValueError(
                    f"{field} is {path[field]!r}, chirp parameters or quality data among the samples; "
                    f"{wanted:#x} is supported: record ADC samples alone"
                )


def _with_frames(hardware: Radar, frames: BoardFrames, preset: str | None) -> Radar:
    """`hardware` with one preset of `frames`."""
    if preset is None and len(frames.presets) > 1:
        raise ValueError(
            f"waveformType is 'advancedFrameChirp' with {', '.join(frames.presets)}; a frame of one kind is supported"
        )
    chosen = next(iter(frames.presets)) if preset is None else preset
    if chosen not in frames.presets:
        raise ValueError(f"preset is {preset!r}; presets: {', '.join(frames.presets)}")
    if hardware.adc.real and not frames.real:
        raise ValueError(f"b2AdcOutFmt is that of complex samples; radar '{hardware.name}' has real ones")
    if not set(frames.transmitters) <= set(element_numbers(hardware.tx_names, "TX")):
        hardware = _with_more_tx(hardware, frames.transmitters)
    try:
        values = named_tx(frames.presets[chosen], hardware.tx_names, hardware.name)
    except RadarConfigError as error:
        raise ValueError(f"{error}, those of preset '{hardware.preset}': take one that fires all of them") from error
    if not any(chirp["slope_hz_per_s"] for chirp in values.get("profile", (values,))):
        values["max_range_m"] = hardware.max_range
    transmitter = {"phase_step_deg": hardware.waveform.phase_step_deg}
    waveform, fired = preset_waveform(values, transmitter, hardware.tx_names, chosen, prefixes=False)
    kept = [hardware.tx_names.index(name) for name in fired]
    heard = enabled_rx(frames.receivers, hardware.rx_names, hardware.name)
    tx_phases, rx_phases = hardware.tx_phases_deg, hardware.rx_phases_deg
    return replace(
        hardware,
        preset=chosen,
        waveform=waveform,
        tx_names=tuple(fired),
        tx_positions=hardware.tx_positions[kept],
        tx_phases_deg=tuple(tx_phases[index] for index in kept) if tx_phases else (),
        rx_names=tuple(hardware.rx_names[index] for index in heard),
        rx_positions=hardware.rx_positions[heard],
        rx_phases_deg=tuple(rx_phases[index] for index in heard) if rx_phases else (),
        tx_power_dbm=hardware.tx_power_dbm - frames.backoff_db,
        adc=replace(hardware.adc, real=frames.real, iq_swap=frames.iq_swap),
    )


def _with_more_tx(hardware: Radar, transmitters: Sequence[int]) -> Radar:
    """A shipped board, as it ships, with a preset that fires `transmitters`; other radars as they are."""
    place: dict[str, Any] = {"position": hardware.position, "orientation": hardware.orientation}
    presets = Radar.available().get(hardware.name, ())
    if hardware.preset not in presets or Radar.load(hardware.name, hardware.preset, **place) != hardware:
        return hardware
    boards = (Radar.load(hardware.name, preset, **place) for preset in presets)
    fits = (board for board in boards if set(transmitters) <= set(element_numbers(board.tx_names, "TX")))
    found = next(fits, None)
    return hardware if found is None else replace(found, preset=hardware.preset)
