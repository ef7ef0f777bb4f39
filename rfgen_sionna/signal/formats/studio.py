"""Configuration files of mmWave Studio: `<name>.mmwave.json` and `<name>.setup.json`.

Field names, units and checked values follow TI's MATLAB readers (`rawDataReader` of mmWave Studio, `JsonParser` of the
cascade examples) and the mmWaveLink interface. Receive gain, back-off, filters and lanes, which this package does not
simulate, have mmWave Studio's defaults.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from rfgen_sionna.radar import Radar
from rfgen_sionna.signal.formats.capture import CaptureFormatError
from rfgen_sionna.signal.formats.files import read_json
from rfgen_sionna.signal.formats.frames import channel_numbers
from rfgen_sionna.signal.formats.sidecar import Description, periodic_times
from rfgen_sionna.signal.formats.studio_chirps import (
    RX_PER_DEVICE,
    TX_PER_DEVICE,
    StudioChirp,
    chirp_tables,
    chirps_of,
    number,
    read_chirps,
    read_profiles,
    slots_of,
)

_FRAME_WAVEFORMS = ("legacyFrameChirp", "singleFrameChirp")


def studio_config(radar: Radar, frames: int, devices: int = 1) -> dict[str, Any]:
    """Content of `.mmwave.json` for `frames` frames of `radar` on one device or on four in cascade; no time of
    creation."""
    label = "one device" if devices == 1 else f"a cascade of {devices} devices"
    tx = channel_numbers(radar.tx_names, "TX", TX_PER_DEVICE * devices, label)
    rx = channel_numbers(radar.rx_names, "RX", RX_PER_DEVICE * devices, label)
    chirps, loops = chirps_of(radar.waveform, tx)
    return {
        "configGenerator": {"createdBy": "rfgen_sionna", "isConfigIntermediate": 0},
        "currentVersion": {"jsonCfgVersion": {"major": 0, "minor": 4, "patch": 0}},
        "systemConfig": {"summary": f"{radar.name}, preset {radar.preset}"},
        "mmWaveDevices": [_device(radar, frames, place, devices, (chirps, loops), tx, rx) for place in range(devices)],
        "processingChainConfig": {},
    }


def _device(
    radar: Radar,
    frames: int,
    place: int,
    devices: int,
    frame: tuple[Sequence[StudioChirp], int],
    transmitters: Sequence[int],
    receivers: Sequence[int],
) -> dict[str, Any]:
    wave = radar.waveform
    chirps, loops = frame
    cascade = devices > 1
    first_tx, first_rx = TX_PER_DEVICE * place + 1, RX_PER_DEVICE * place + 1
    return {
        "mmWaveDeviceId": place,
        "rfConfig": {
            "waveformType": "legacyFrameChirp",
            "MIMOScheme": {"bpm": "BPM", "ddm": "DDM"}.get(wave.multiplexing, "TDM"),
            "rlCalibrationDataFile": "",
            "rlChanCfg_t": {
                "rxChannelEn": f"0x{_bits([rx - first_rx for rx in receivers], RX_PER_DEVICE):X}",
                "txChannelEn": f"0x{_bits([tx - first_tx for tx in transmitters], TX_PER_DEVICE):X}",
                "cascading": 0 if not cascade else 1 if place == 0 else 2,
                "cascadingPinoutCfg": "0x0",
            },
            "rlAdcOutCfg_t": {"fmt": {"b2AdcBits": 2, "b8FullScaleReducFctr": 0, "b2AdcOutFmt": 1}},
            "rlLowPowerModeCfg_t": {"lpAdcMode": 0},
            "rlProfiles": [
                {
                    "rlProfileCfg_t": {
                        "profileId": index,
                        "pfVcoSelect": "0x0",
                        "pfCalLutUpdate": "0x0",
                        "startFreqConst_GHz": _scaled(profile.start_frequency, 1e9),
                        "idleTimeConst_usec": _scaled(profile.idle_time, 1e-6),
                        "adcStartTimeConst_usec": _scaled(profile.adc_start_time, 1e-6),
                        "rampEndTime_usec": _scaled(profile.ramp_end_time, 1e-6),
                        "txOutPowerBackoffCode": "0x0",
                        "txPhaseShifter": "0x0",
                        "freqSlopeConst_MHz_usec": _scaled(profile.slope, 1e12),
                        "txStartTime_usec": 0.0,
                        "numAdcSamples": wave.num_samples,
                        "digOutSampleRate": _scaled(profile.sample_rate, 1e3),
                        "hpfCornerFreq1": 0,
                        "hpfCornerFreq2": 0,
                        "rxGain_dB": "0x1E",
                    }
                }
                for index, profile in enumerate(wave.profiles)
            ],
            **chirp_tables(chirps, place),
            "rlFrameCfg_t": {
                "chirpStartIdx": 0,
                "chirpEndIdx": len(chirps) - 1,
                "numLoops": loops,
                "numFrames": frames,
                "framePeriodicity_msec": _scaled(wave.frame_period, 1e-3),
                "triggerSelect": 2 if cascade and place else 1,
                "frameTriggerDelay": 0.0,
            },
        },
        "rawDataCaptureConfig": {
            # Interleave 1 is one receiver after the other (LVDS, two lanes); 0 is all receivers of a sample (CSI-2).
            "rlDevDataFmtCfg_t": {"iqSwapSel": 0, "chInterleave": 0 if cascade else 1},
            "rlDevDataPathCfg_t": {
                "intfSel": 0 if cascade else 1,
                "transferFmtPkt0": "0x1",
                "transferFmtPkt1": "0x0",
                "cqConfig": 0,
                "cq0TransSize": 0,
                "cq1TransSize": 0,
                "cq2TransSize": 0,
            },
            "rlDevDataPathClkCfg_t": {"laneClkCfg": 1, "dataRate_Mbps": 600},
        }
        | (
            {"rlDevCsi2Cfg_t": {"lanePosPolSel": "0x35421", "lineStartEndDis": 0}}
            if cascade
            else {
                "rlDevLaneEnable_t": {"laneEn": "0x3"},
                "rlDevLvdsLaneCfg_t": {"laneFmtMap": 0, "laneParamCfg": "0x1"},
            }
        ),
        "monitoringConfig": {},
    }


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


def _bits(channels: Sequence[int], count: int) -> int:
    return sum(1 << channel for channel in channels if 0 <= channel < count)


def _scaled(value: float, unit: float) -> float:
    """`value` in `unit`, without rounding errors of the division."""
    return float(f"{value / unit:.13g}")
