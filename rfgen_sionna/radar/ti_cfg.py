"""Configurations of TI's mmWave SDK demonstrations (`.cfg`): the commands that shape the samples.

Commands, arguments and units follow the user guides of mmWave SDK 1 to 3 and of the mmWave MCU+ SDK. BPM is that of the
demonstrations: all Tx of the first chirp with equal sign, the last Tx of the second one inverted. DDM is that of the
MCU+ demonstration: the k-th Tx in the order of `ddmPhaseShiftAntOrder` turns by -360 k / bands degrees a chirp, in 3
bands for 2 Tx, 4 for 3, 6 for 4.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace
from decimal import Decimal
from typing import Any

from rfgen_sionna.radar.board_frames import FRAME, BoardFrames, RadarConfigWarning
from rfgen_sionna.radar.config import RadarConfigError
from rfgen_sionna.radar.ti_cfg_commands import ADVANCED, IGNORED, NEEDED, REFUSED, SIGNATURES, Command, commands
from rfgen_sionna.radar.ti_chirps import (
    TiChirp,
    TiProfile,
    backoffs,
    common_backoff,
    decimal,
    frame_preset,
    shifter_phases,
)

_MOST_TX = 4
"""Tx of one device: 3, or 4 of the AWR2944."""
DDM_BANDS = {2: 3, 3: 4, 4: 6}
"""Doppler bands by the number of Tx in the MCU+ SDK's DDM demonstration."""
_ADC_BITS = {0: 12, 1: 14, 2: 16}


@dataclass(frozen=True)
class _Frame:
    """One kind of frame: its name, chirps, loops and period [s]."""

    name: str
    first: int
    last: int
    loops: int
    period: Decimal
    command: Command
    profile: int | None = None
    """Profile that replaces those of the chirps; None for theirs."""


def read_ti_cfg(text: str, where: str) -> BoardFrames:
    """Frames of a `.cfg`; `where` names it in errors.

    Raises
    ------
    RadarConfigError
        With all commands that are missing, incomplete or not supported.
    """
    found = commands(text)
    problems = [f"{command} {REFUSED[command.key]}" for command in found if command.key in REFUSED]
    problems += [
        f"{command} {command.arguments[0]} is a continuous wave or another mode without frames; 1 (frames) and 3 "
        "(advanced frames) are supported"
        for command in found
        if command.key == "dfedataoutputmode" and command.arguments and command.arguments[0] not in ("1", "3")
    ]
    if problems:
        raise RadarConfigError(f"{where}: {'; '.join(problems)}")
    problems = [problem for command in found for problem in command.problems()]
    by_key: dict[str, list[Command]] = {key: [] for key in SIGNATURES}
    for command in found:
        by_key.setdefault(command.key, []).append(command)
    needed = (*NEEDED, *(ADVANCED if _advanced(by_key) else ("frameCfg",)))
    missing = [name for name in needed if not by_key[name.lower()]]
    if missing:
        problems.insert(0, f"{', '.join(missing)} {'is' if len(missing) == 1 else 'are'} missing")
    for key in ("channelcfg", "adccfg", "framecfg", "advframecfg", "dfedataoutputmode"):
        if len({command.arguments for command in by_key[key]}) > 1:
            problems.append(f"{' and '.join(map(str, by_key[key]))} contradict each other; one of them is needed")
    if not problems:
        try:
            frames = _CfgReader(by_key).frames()
        except ValueError as error:
            problems = [str(error)]
    if problems:
        raise RadarConfigError(f"{where}: {'; '.join(problems)}")
    unknown = dict.fromkeys(command.name for command in found if command.key not in (*SIGNATURES, *IGNORED))
    if unknown:
        warnings.warn(
            f"{where}: {', '.join(unknown)} {'is' if len(unknown) == 1 else 'are'} not known and left out; if they "
            "change the chirps, the samples differ",
            RadarConfigWarning,
            stacklevel=5,
        )
    return frames


def _advanced(by_key: dict[str, list[Command]]) -> bool:
    modes = [command.arguments[0] for command in by_key["dfedataoutputmode"] if command.arguments]
    return modes[-1] == "3" if modes else bool(by_key["advframecfg"])


class _CfgReader:
    """The frames of commands of correct arguments; contradictions are a ValueError."""

    def __init__(self, by_key: dict[str, list[Command]]) -> None:
        self.by_key = by_key
        self.channels = by_key["channelcfg"][-1]
        self.real = self._real()
        self.profiles = {self._once(command, "profileId"): _profile(command) for command in by_key["profilecfg"]}
        self.chirps = self._chirps()

    def frames(self) -> BoardFrames:
        presets: dict[str, dict[str, Any]] = {}
        fired: list[TiChirp] = []
        for index, frame in enumerate(self._frames()):
            chirps = [self._chirp(number, frame) for number in range(frame.first, frame.last + 1)]
            fired += chirps
            presets[frame.name] = self._preset(frame, self._with_signs(chirps, frame, index))
        for command in self.by_key.get("lvdsstreamcfg", ()):
            header, kind, software = (*command.arguments[1:4], "0", "0", "0")[:3]
            if kind not in ("0", "1") or (kind == "1" and header == "1") or software == "1":
                warnings.warn(
                    f"{command} streams headers or other data among the samples; such a recording is not read: "
                    "lvdsStreamCfg -1 0 1 0 streams samples alone",
                    RadarConfigWarning,
                    stacklevel=6,
                )
        receivers = self.channels.integer("rxChannelEn")
        backoff = common_backoff(self.profiles, fired)
        if backoff is None:
            warnings.warn(
                "profileCfg: txOutPower differs from Tx to Tx; the power of the board's file counts for all of them",
                RadarConfigWarning,
                stacklevel=6,
            )
        return BoardFrames(
            presets,
            tuple(bit + 1 for bit in range(32) if receivers >> bit & 1),
            self.real,
            _ADC_BITS[self.by_key["adccfg"][-1].integer("numADCBits")],
            float(backoff or 0),
            iq_swap=not self.real and self._swapped(),
        )

    def _swapped(self) -> bool:
        """Whether the demonstration streams samples by LVDS (dataFmt 1), in the order of the ADC buffer, Q first."""
        streams = any(command.arguments[2:3] == ("1",) for command in self.by_key.get("lvdsstreamcfg", ()))
        return streams and any(buffer.integer("SampleSwap") for buffer in self.by_key["adcbufcfg"])

    def _real(self) -> bool:
        adc = self.by_key["adccfg"][-1]
        if adc.integer("numADCBits") not in _ADC_BITS:
            raise ValueError(f"{adc}: numADCBits {adc['numADCBits']}; 0, 1 or 2 (12, 14 or 16 bits) is needed")
        output = adc.integer("adcOutputFmt")
        if output not in (0, 1, 2):
            raise ValueError(f"{adc}: adcOutputFmt {output}; 0 (real), 1 or 2 (complex) is supported")
        for buffer in self.by_key["adcbufcfg"]:
            if (buffer.integer("adcOutputFmt") == 1) != (output == 0):
                raise ValueError(f"{adc} and {buffer} contradict each other: real samples are 0 there and 1 here")
        return output == 0

    def _once(self, command: Command, key: str) -> int:
        number = command.integer(key)
        same = [other for other in self.by_key[command.key] if other.integer(key) == number]
        if len({other.arguments for other in same}) > 1:
            raise ValueError(f"{' and '.join(map(str, same))} contradict each other; one of them is needed")
        return number

    def _chirps(self) -> dict[int, TiChirp]:
        """Chirps by their index, with the phases of `bpmCfgAdvanced`."""
        chirps: dict[int, TiChirp] = {}
        enabled = self.channels.integer("txChannelEn")
        for command in self.by_key["chirpcfg"]:
            mask = command.integer("txEnable")
            if not mask or mask >> _MOST_TX or mask & ~enabled:
                raise ValueError(
                    f"{command}: txEnable {mask}; at least one of the Tx in txChannelEn {enabled} of {self.channels} "
                    "is needed"
                )
            number = command.integer("profileId")
            if number not in self.profiles:
                raise ValueError(f"{command} takes profile {number}; there is no such profileCfg")
            variation = (
                decimal(command["startFreqVar"], 0),
                decimal(command["freqSlopeVar"], 9),
                decimal(command["idleTimeVar"], -6),
                decimal(command["adcStartTimeVar"], -6),
            )
            chirp = TiChirp(number, {tx + 1: 0.0 for tx in range(_MOST_TX) if mask >> tx & 1}, variation)
            first, last = command.integer("chirpStartIdx"), command.integer("chirpEndIdx")
            if not 0 <= first <= last < 512:
                raise ValueError(f"{command}: chirps {first} … {last}; 0 … 511, the first one first, are needed")
            for index in range(first, last + 1):
                if chirps.setdefault(index, chirp) != chirp:
                    raise ValueError(f"{command}: another chirpCfg has chirp {index} too")
        for command in self.by_key["bpmcfgadvanced"]:
            value = command.integer("constBpmVal")
            for index in range(command.integer("chirpStartIdx"), command.integer("chirpEndIdx") + 1):
                if index in chirps:
                    phases = {tx: 180.0 * (value >> 2 * tx - 1 & 1) for tx in chirps[index].phases}
                    chirps[index] = replace(chirps[index], phases=phases)
        return chirps

    def _chirp(self, number: int, frame: _Frame) -> TiChirp:
        if number not in self.chirps:
            raise ValueError(f"{frame.command} takes chirp {number}; there is no chirpCfg for it")
        chirp = self.chirps[number]
        if frame.profile is None:
            return chirp
        if frame.profile not in self.profiles:
            raise ValueError(f"{frame.command} forces profile {frame.profile}; there is no such profileCfg")
        return replace(chirp, profile=frame.profile)

    def _frames(self) -> list[_Frame]:
        if not _advanced(self.by_key):
            command = self.by_key["framecfg"][-1]
            first, last = command.integer("chirpStartIdx"), command.integer("chirpEndIdx")
            period = decimal(command["framePeriodicity"], -3)
            frame = _Frame(FRAME, first, last, command.integer("numLoops"), period, command)
            samples = {self.profiles[chirp.profile].num_samples for chirp in self._of(frame)}
            if "numAdcSamples" in command.values() and samples != {command.integer("numAdcSamples")}:
                raise ValueError(
                    f"{command}: numAdcSamples {command['numAdcSamples']}; profileCfg has {sorted(samples)}"
                )
            return [frame]
        head = self.by_key["advframecfg"][-1]
        count = head.integer("numOfSubFrames")
        subframes = {self._once(command, "subFrameNum"): command for command in self.by_key["subframecfg"]}
        if set(subframes) != set(range(count)):
            raise ValueError(f"{head} has {count} subframes; subFrameCfg gives {sorted(subframes)}")
        period = sum((decimal(each["subFramePeriodicity"], -3) for each in subframes.values()), Decimal(0))
        frames = []
        for number, command in sorted(subframes.items()):
            if command.integer("numOfBurst") != 1 or command.integer("numOfBurstLoops") != 1:
                raise ValueError(
                    f"{command}: numOfBurst {command['numOfBurst']} and numOfBurstLoops {command['numOfBurstLoops']}; "
                    "one burst a subframe (1 and 1) is supported"
                )
            first = command.integer("chirpStartIdx")
            forced = command.integer("forceProfileIdx") if head.integer("forceProfile") else None
            last = first + command.integer("numOfChirps") - 1
            frames.append(
                _Frame(f"subframe{number}", first, last, command.integer("numLoops"), period, command, forced)
            )
        return frames

    def _of(self, frame: _Frame) -> list[TiChirp]:
        return [self._chirp(number, frame) for number in range(frame.first, frame.last + 1)]

    def _with_signs(self, chirps: Sequence[TiChirp], frame: _Frame, index: int) -> list[TiChirp]:
        """The chirps with the signs of `bpmCfg`."""
        chirps = list(chirps)
        for command in self.by_key["bpmcfg"]:
            if not command.integer("enabled") or command.integer("subFrameIdx") not in (-1, index):
                continue
            plus, minus = (command.integer(name) - frame.first for name in ("chirp0Idx", "chirp1Idx"))
            if not (0 <= plus < len(chirps) and 0 <= minus < len(chirps)):
                raise ValueError(f"{command}: chirp0Idx and chirp1Idx; {frame.first} … {frame.last} are in the frame")
            if len(chirps[plus].phases) < 2 or set(chirps[plus].phases) != set(chirps[minus].phases):
                raise ValueError(f"{command}: both chirps need the same Tx in txEnable of chirpCfg, at least two")
            inverted = max(chirps[minus].phases)
            chirps[minus] = replace(chirps[minus], phases={tx: 180.0 * (tx == inverted) for tx in chirps[minus].phases})
        return chirps

    def _preset(self, frame: _Frame, chirps: Sequence[TiChirp]) -> dict[str, Any]:
        if frame.loops < 1 or not chirps:
            raise ValueError(f"{frame.command}: {frame.loops} loops of {len(chirps)} chirps; at least 1 of 1 is needed")
        preset = frame_preset(chirps, self.profiles, frame.loops, frame.period)
        orders = self.by_key["ddmphaseshiftantorder"]
        if not orders or preset.get("tx_order"):
            return preset
        order = [int(argument) + 1 for argument in orders[-1].arguments]
        fired = [tx for tx in order if tx in chirps[0].phases]
        bands = DDM_BANDS.get(len(fired), 0)
        if len(preset["slot"]) != 1 or set(fired) != set(chirps[0].phases) or not bands or len(chirps) % bands:
            raise ValueError(
                f"{orders[-1]} with {len(chirps)} chirps a loop; DDM needs the same 2 to 4 Tx of this order in all "
                f"chirps, and a multiple of {bands or 'its'} chirps"
            )
        tx = sorted(fired)
        advance = [(360.0 * (bands - fired.index(number)) / bands) % 360.0 for number in tx]
        return preset | {"slot": [{"tx": tx, "advance_deg": advance}]}


def _profile(command: Command) -> TiProfile:
    phase, power = command.integer("txPhaseShifter"), command.integer("txOutPower")
    return TiProfile(
        decimal(command["startFreq"], 9),
        decimal(command["freqSlopeConst"], 12),
        decimal(command["digOutSampleRate"], 3),
        decimal(command["idleTime"], -6),
        decimal(command["adcStartTime"], -6),
        decimal(command["rampEndTime"], -6),
        command.integer("numAdcSamples"),
        shifter_phases(phase, 1, _MOST_TX),
        backoffs(power, 1, _MOST_TX),
    )
