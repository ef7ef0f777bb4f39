"""Chirps of a loop in mmWave Studio's JSON.

They are their Tx (`txEnable`), the signs (`rlBpmChirps`, a bit pair for each Tx: between and during chirps) and the
phase shifts (`rlRfPhaseShiftCfgs`, 5.625 degrees a step).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from rfgen_sionna.radar.studio_json import RX_PER_DEVICE, TX_PER_DEVICE
from rfgen_sionna.radar.ti_chirps import PHASE_STEP, TiChirp
from rfgen_sionna.signal.formats.capture import CaptureFormatError

__all__ = ["CHECKED_FIELDS", "FULL_SCALE", "RX_PER_DEVICE", "TX_PER_DEVICE", "chirp_tables"]

FULL_SCALE = 1 << 15  # of the devices' 16-bit words [LSB]
_FIELDS = (
    "mmWaveDeviceId waveformType rxChannelEn b2AdcBits b2AdcOutFmt profileId startFreqConst_GHz idleTimeConst_usec "
    "adcStartTimeConst_usec rampEndTime_usec freqSlopeConst_MHz_usec numAdcSamples digOutSampleRate chirpStartIdx "
    "chirpEndIdx startFreqVar_MHz freqSlopeVar_KHz_usec idleTimeVar_usec adcStartTimeVar_usec txEnable constBpmVal "
    "tx0PhaseShift tx1PhaseShift tx2PhaseShift tx3PhaseShift numLoops numFrames framePeriodicity_msec iqSwapSel "
    "chInterleave laneEn"
)
CHECKED_FIELDS = frozenset(_FIELDS.split())
"""Fields that determine the samples or their layout. Others, such as gains and filters, may differ."""


def chirp_tables(chirps: Sequence[TiChirp], first: int, count: int) -> dict[str, list[dict[str, Any]]]:
    """Lists `rlChirps`, `rlBpmChirps` and `rlRfPhaseShiftCfgs` of a device with `count` Tx from number `first` on."""
    tables: dict[str, list[dict[str, Any]]] = {"rlChirps": [], "rlBpmChirps": [], "rlRfPhaseShiftCfgs": []}
    signs_only = all(phase in (0.0, 180.0) for chirp in chirps for phase in chirp.phases.values())
    for index, chirp in enumerate(chirps):
        own = {tx - first: phase for tx, phase in chirp.phases.items() if 0 <= tx - first < count}
        place = {"chirpStartIdx": index, "chirpEndIdx": index}
        tables["rlChirps"].append(
            {
                "rlChirpCfg_t": place
                | {
                    "profileId": chirp.profile,
                    "startFreqVar_MHz": 0.0,
                    "freqSlopeVar_KHz_usec": 0.0,
                    "idleTimeVar_usec": 0.0,
                    "adcStartTimeVar_usec": 0.0,
                    "txEnable": f"0x{sum(1 << tx for tx in own):X}",
                }
            }
        )
        if not any(own.values()):
            continue
        if signs_only:
            value = sum(3 << 2 * tx for tx, phase in own.items() if phase)
            tables["rlBpmChirps"].append({"rlBpmChirpCfg_t": place | {"constBpmVal": f"0x{value:X}"}})
        else:
            shifters = max(TX_PER_DEVICE, *(tx + 1 for tx in own))
            shifts = {f"tx{tx}PhaseShift": _steps(own.get(tx, 0.0)) for tx in range(shifters)}
            tables["rlRfPhaseShiftCfgs"].append({"rlRfPhaseShiftCfg_t": place | shifts})
    return tables


def _steps(phase: float) -> int:
    steps = phase / PHASE_STEP
    if abs(steps - round(steps)) > 1e-6:
        raise CaptureFormatError(
            f"a slot has the phase {phase:g} degrees; the device's phase shifters have steps of {PHASE_STEP:g} "
            "(transmitter.phase_step_deg rounds to them)"
        )
    return round(steps) % 64
