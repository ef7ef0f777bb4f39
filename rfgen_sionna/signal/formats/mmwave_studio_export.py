"""Configuration of a radar as the JSON of mmWave Studio."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from rfgen_sionna.radar import Radar
from rfgen_sionna.radar.config import RadarConfigError
from rfgen_sionna.radar.studio_json import MOST_TX
from rfgen_sionna.radar.ti_chirps import TiChirp, chirps_of
from rfgen_sionna.signal.formats.capture import CaptureFormatError
from rfgen_sionna.signal.formats.frames import channel_numbers
from rfgen_sionna.signal.formats.mmwave_studio_chirps import RX_PER_DEVICE, TX_PER_DEVICE, chirp_tables


def studio_config(radar: Radar, frames: int, devices: int = 1, lanes: int = 2) -> dict[str, Any]:
    """Content of `.mmwave.json` for `frames` frames of `radar` on one device, through 2 or 4 LVDS lanes, or on four in
    cascade; no time of creation.

    Raises
    ------
    CaptureFormatError
        The devices have no such elements or chirps.
    """
    label = "one device" if devices == 1 else f"a cascade of {devices} devices"
    tx = channel_numbers(radar.tx_names, "TX", MOST_TX if devices == 1 else TX_PER_DEVICE * devices, label)
    rx = channel_numbers(radar.rx_names, "RX", RX_PER_DEVICE * devices, label)
    try:
        chirps, loops = chirps_of(radar.waveform, tx)
    except RadarConfigError as error:
        raise CaptureFormatError(str(error)) from error
    return {
        "configGenerator": {"createdBy": "rfgen_sionna", "isConfigIntermediate": 0},
        "currentVersion": {"jsonCfgVersion": {"major": 0, "minor": 4, "patch": 0}},
        "systemConfig": {"summary": f"{radar.name}, preset {radar.preset}"},
        "mmWaveDevices": [
            _device(radar, frames, place, devices, lanes, (chirps, loops), tx, rx) for place in range(devices)
        ],
        "processingChainConfig": {},
    }


def _device(
    radar: Radar,
    frames: int,
    place: int,
    devices: int,
    lanes: int,
    frame: tuple[Sequence[TiChirp], int],
    transmitters: Sequence[int],
    receivers: Sequence[int],
) -> dict[str, Any]:
    wave = radar.waveform
    chirps, loops = frame
    cascade = devices > 1
    first_tx, first_rx = TX_PER_DEVICE * place + 1, RX_PER_DEVICE * place + 1
    most_tx = TX_PER_DEVICE if cascade else MOST_TX
    return {
        "mmWaveDeviceId": place,
        "rfConfig": {
            "waveformType": "legacyFrameChirp",
            "MIMOScheme": {"bpm": "BPM", "ddm": "DDM"}.get(wave.multiplexing, "TDM"),
            "rlCalibrationDataFile": "",
            "rlChanCfg_t": {
                "rxChannelEn": f"0x{_bits([rx - first_rx for rx in receivers], RX_PER_DEVICE):X}",
                "txChannelEn": f"0x{_bits([tx - first_tx for tx in transmitters], most_tx):X}",
                "cascading": 0 if not cascade else 1 if place == 0 else 2,
                "cascadingPinoutCfg": "0x0",
            },
            "rlAdcOutCfg_t": {
                "fmt": {"b2AdcBits": 2, "b8FullScaleReducFctr": 0, "b2AdcOutFmt": 0 if radar.adc.real else 1}
            },
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
            **chirp_tables(chirps, first_tx, most_tx),
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
            # Interleave 1 is one receiver after the other (two lanes), 0 all receivers of a sample (four, CSI-2).
            "rlDevDataFmtCfg_t": {"iqSwapSel": 0, "chInterleave": 0 if cascade or lanes == 4 else 1},
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
                "rlDevLaneEnable_t": {"laneEn": "0xF" if lanes == 4 else "0x3"},
                "rlDevLvdsLaneCfg_t": {"laneFmtMap": 0, "laneParamCfg": "0x1"},
            }
        ),
        "monitoringConfig": {},
    }


def _bits(channels: Sequence[int], count: int) -> int:
    return sum(1 << channel for channel in channels if 0 <= channel < count)


def _scaled(value: float, unit: float) -> float:
    """`value` in `unit`, without rounding errors of the division."""
    return float(f"{value / unit:.13g}")
