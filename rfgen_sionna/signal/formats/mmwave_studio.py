"""Configuration files of mmWave Studio: `<name>.mmwave.json` and `<name>.setup.json`.

Field names, units and checked values follow TI's MATLAB readers (`rawDataReader` of mmWave Studio, `JsonParser` of the
cascade examples) and the mmWaveLink interface. Receive gain, back-off, filters and lanes, which this package does not
simulate, have mmWave Studio's defaults.
"""

from __future__ import annotations

from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from rfgen_sionna.radar import Radar
from rfgen_sionna.signal.formats.capture import CaptureFormatError
from rfgen_sionna.signal.formats.files import read_json
from rfgen_sionna.signal.formats.frames import channel_numbers
from rfgen_sionna.signal.formats.mmwave_studio_chirps import (
    RX_PER_DEVICE,
    TX_PER_DEVICE,
    number,
    read_chirps,
    read_profiles,
    slots_of,
)
from rfgen_sionna.signal.formats.sidecar import Description, periodic_times

_FRAME_WAVEFORMS = ("legacyFrameChirp", "singleFrameChirp")


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


def radar_from_studio(path: Path, hardware: Radar) -> Radar:
    """`hardware` with the waveform and the Tx elements of a `.mmwave.json`.

    Raises
    ------
    CaptureFormatError
        Naming the field that is missing or not supported.
    """
    return read_studio(path, hardware).radar


def read_studio(path: Path, hardware: Radar, devices: int = 1) -> Description:
    """Read a `.mmwave.json`; `hardware` gives positions, pattern, power and noise."""
    config = read_json(path)
    try:
        return _parse(config, hardware, devices)
    except KeyError as error:
        raise CaptureFormatError(f"'{path}' lacks {error}") from error
    except (TypeError, ValueError, IndexError) as error:
        raise CaptureFormatError(f"'{path}': {error}") from error


def _parse(config: dict[str, Any], hardware: Radar, devices: int) -> Description:
    records = config["mmWaveDevices"]
    if len(records) != devices:
        raise ValueError(f"mmWaveDevices has {len(records)} entries; {devices} needed")
    records = sorted(records, key=lambda record: int(record["mmWaveDeviceId"]))
    rf, raw = records[0]["rfConfig"], records[0]["rawDataCaptureConfig"]
    if rf["waveformType"] not in _FRAME_WAVEFORMS:
        raise ValueError(f"waveformType is '{rf['waveformType']}'; supported: {', '.join(_FRAME_WAVEFORMS)}")
    output = rf["rlAdcOutCfg_t"]["fmt"]
    if output["b2AdcBits"] != 2 or output["b2AdcOutFmt"] not in (1, 2):
        raise ValueError(
            f"b2AdcBits is {output['b2AdcBits']!r} and b2AdcOutFmt {output['b2AdcOutFmt']!r}; "
            "16 bits (2) and complex samples (1 or 2) are supported"
        )
    interleave = raw["rlDevDataFmtCfg_t"]["chInterleave"]
    if interleave != (1 if devices == 1 else 0):
        raise ValueError(f"chInterleave is {interleave!r}; {1 if devices == 1 else 0} is the layout of this format")
    if devices == 1 and "rlDevLaneEnable_t" in raw and number(raw["rlDevLaneEnable_t"]["laneEn"]) != 3:
        raise ValueError(f"laneEn is {raw['rlDevLaneEnable_t']['laneEn']!r}; two lanes (0x3) are supported")
    frame = rf["rlFrameCfg_t"]
    chirps = read_chirps(records, int(frame["chirpStartIdx"]), int(frame["chirpEndIdx"]))
    fired = {tx for chirp in chirps for tx in chirp.phases}

    label = "one device" if devices == 1 else f"a cascade of {devices} devices"
    numbers = channel_numbers(hardware.tx_names, "TX", TX_PER_DEVICE * devices, label)
    if absent := fired - set(numbers):
        raise ValueError(f"TX{min(absent)} fires; radar '{hardware.name}' has {', '.join(hardware.tx_names)}")
    kept = [index for index, tx in enumerate(numbers) if tx in fired]
    enabled = {
        RX_PER_DEVICE * place + bit + 1
        for place, record in enumerate(records)
        for bit in range(RX_PER_DEVICE)
        if number(record["rfConfig"]["rlChanCfg_t"]["rxChannelEn"]) >> bit & 1
    }
    receivers = channel_numbers(hardware.rx_names, "RX", RX_PER_DEVICE * devices, label)
    if absent := enabled - set(receivers):
        raise ValueError(f"RX{min(absent)} is enabled; radar '{hardware.name}' has {', '.join(hardware.rx_names)}")
    heard = [index for index, rx in enumerate(receivers) if rx in enabled]
    profiles, samples = read_profiles(rf["rlProfiles"])
    used = sorted({chirp.profile for chirp in chirps})
    if used[-1] >= len(profiles):
        raise ValueError(f"rlChirps use profile {used[-1]}; rlProfiles has {len(profiles)}")
    chirps = [replace(chirp, profile=used.index(chirp.profile)) for chirp in chirps]
    order, slots = slots_of(chirps, [numbers[index] for index in kept])
    waveform = replace(
        hardware.waveform,
        **asdict(profiles[used[0]]),
        num_samples=samples,
        num_loops=int(frame["numLoops"]),
        tx_order=order,
        slots=slots,
        other_profiles=tuple(profiles[index] for index in used[1:]),
        slot_starts=None,
        loop_time=None,
        separated=False,
        range_limit=None if any(profiles[index].slope for index in used) else hardware.max_range,
        frame_period=float(frame["framePeriodicity_msec"]) * 1e-3,
    )
    radar = replace(
        hardware,
        waveform=waveform,
        tx_names=tuple(hardware.tx_names[index] for index in kept),
        tx_positions=hardware.tx_positions[kept],
        rx_names=tuple(hardware.rx_names[index] for index in heard),
        rx_positions=hardware.rx_positions[heard],
    )
    frames = int(frame["numFrames"])  # 0 runs until the radar is stopped
    times = periodic_times(frames, radar) if frames else None
    return Description(radar, frame_times=times, iq_swap=bool(raw["rlDevDataFmtCfg_t"]["iqSwapSel"]))
