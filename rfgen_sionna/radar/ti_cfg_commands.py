"""Commands of TI's `.cfg` files: names, arguments, and those that do not shape the samples."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass

_USAGE = """\
dfeDataOutputMode modeType
channelCfg rxChannelEn txChannelEn cascading ? ?
adcCfg numADCBits adcOutputFmt
adcbufCfg subFrameIdx adcOutputFmt SampleSwap ChanInterleave ChirpThreshold
adcbufCfg adcOutputFmt SampleSwap ChanInterleave ChirpThreshold
profileCfg profileId startFreq idleTime adcStartTime rampEndTime txOutPower txPhaseShifter freqSlopeConst \
    txStartTime numAdcSamples digOutSampleRate hpfCornerFreq1 hpfCornerFreq2 rxGain
chirpCfg chirpStartIdx chirpEndIdx profileId startFreqVar freqSlopeVar idleTimeVar adcStartTimeVar txEnable
frameCfg chirpStartIdx chirpEndIdx numLoops numFrames framePeriodicity triggerSelect frameTriggerDelay
frameCfg chirpStartIdx chirpEndIdx numLoops numFrames numAdcSamples framePeriodicity triggerSelect \
    frameTriggerDelay ?
advFrameCfg numOfSubFrames forceProfile numFrames triggerSelect frameTrigDelay ?
subFrameCfg subFrameNum forceProfileIdx chirpStartIdx numOfChirps numLoops burstPeriodicity \
    chirpStartIdxOffset numOfBurst numOfBurstLoops subFramePeriodicity
bpmCfg subFrameIdx enabled chirp0Idx chirp1Idx
bpmCfgAdvanced chirpStartIdx chirpEndIdx constBpmVal
ddmPhaseShiftAntOrder Tx0 Tx1 ? ?
"""
"""Commands that shape the samples, with their arguments; ? may be absent. `adcbufCfg` has four arguments in SDK 1,
`frameCfg` the number of samples in the MCU+ SDK."""

SIGNATURES = {
    key: tuple(usage for usage in _USAGE.splitlines() if usage.split()[0].lower() == key)
    for key in dict.fromkeys(usage.split()[0].lower() for usage in _USAGE.splitlines())
}
"""Forms of each command that shapes the samples, by its name in lower case."""

NEEDED = ("channelCfg", "adcCfg", "profileCfg", "chirpCfg")
ADVANCED = ("advFrameCfg", "subFrameCfg")

_XWRL = "is of TI's low-power xWRL devices, whose bursts are not supported"
REFUSED = {
    "contmodecfg": "is a continuous wave without frames, which is not supported",
    "advchirpcfg": "steps through tables of the device's memory, which is not supported",
    "loopbackburstcfg": "is an internal loopback, which is not supported",
    "chirpcomncfg": _XWRL,
    "chirptimingcfg": _XWRL,
}
"""Commands of frames that are not supported."""

_OTHERS = """
    sensorstop flushcfg sensorstart lowpower guimonitor cfarcfg multiobjbeamforming calibdcrangesig clutterremoval
    extendedmaxvelocity lvdsstreamcfg comprangebiasandrxchanphase measurerangebiasandrxchanphase cqrxsatmonitor
    cqsigimgmonitor analogmonitor aoafovcfg cfarfovcfg calibdata nearfieldcfg peakgrouping idlepowercycle
    configdataport querydemostatus version setdatarate baudrate pmiccfg socpowercfg
    dynamicracfarcfg staticracfarcfg dynamicrangeanglecfg dynamic2danglecfg staticrangeanglecfg finemotioncfg
    antgeometry0 antgeometry1 antphaserot fovcfg staticboundarybox boundarybox presenceboundarybox sensorposition
    gatingparam stateparam allocationparam trackingcfg maxacceleration varparam pointcloudparam sceneryparam
    staticboundary zonedef fallparam classifiercfg micordopplercfg microdopplercfg trackcfg
    cfardopplercfg doacfg rangecfarcfg dopplercfarcfg singleobjdoacfg heatmapcfg rowcfg colcfg statecfg detectioncfg
    vitalsigns vitalsignscfg vitalsign vsrangeidxcfg vitalsignsparams motiondetection
    antgeometrycfg antgeometryboard antennacalibparams rangeproccfg compressioncfg intfmitigcfg localmaxcfg
    procchaincfg adcdatadithercfg enetcfg enetstreamcfg sscctrlcfg powermeas configmode antcalibcfg
"""
IGNORED = frozenset(_OTHERS.split())
"""Commands of processing, output and monitoring, in lower case: they do not change the samples."""


@dataclass(frozen=True)
class Command:
    """One line of a `.cfg`."""

    name: str
    arguments: tuple[str, ...]
    line: int

    def __str__(self) -> str:
        return f"{self.name} (line {self.line})"

    def __getitem__(self, argument: str) -> str:
        return self.values()[argument]

    @property
    def key(self) -> str:
        """The name in lower case."""
        return self.name.lower()

    def values(self) -> dict[str, str]:
        """Arguments by their names."""
        names = self._names()
        return {} if names is None else dict(zip(names, self.arguments, strict=False))

    def integer(self, argument: str) -> int:
        """An argument as a whole number, decimal or hexadecimal (else ValueError)."""
        text = self[argument]
        try:
            if text.lower().startswith("0x"):
                return int(text, 16)
            number = float(text)
            if number == int(number):
                return int(number)
        except (ValueError, OverflowError):
            pass
        raise ValueError(f"{self}: {argument} is '{text}'; a whole number is needed")

    def problems(self) -> Iterator[str]:
        """What is wrong with the number of arguments, or with one of them."""
        if self.key not in SIGNATURES:
            return
        names = self._names()
        if names is None:
            usage = SIGNATURES[self.key][0].replace(" ?", "")
            yield f"{self} has {len(self.arguments)} arguments; {len(usage.split()) - 1} are needed: {usage}"
            return
        for name, text in zip(names, self.arguments, strict=False):
            if not re.fullmatch(r"0[xX][0-9a-fA-F]+|[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?", text):
                yield f"{self}: {name} is '{text}'; a number is needed"

    def _names(self) -> list[str] | None:
        """Names of the arguments in the form of the command that has as many."""
        for usage in SIGNATURES.get(self.key, ()):
            names = usage.split()[1:]
            if len(names) - names.count("?") <= len(self.arguments) <= len(names):
                return names
        return None


def commands(text: str) -> list[Command]:
    """Commands of a `.cfg` from its last `flushCfg` on; comments begin with % or #."""
    found: list[Command] = []
    for number, line in enumerate(text.splitlines(), start=1):
        words = re.split(r"[%#;]|//", line, maxsplit=1)[0].split()
        if not words:
            continue
        command = Command(words[0], tuple(words[1:]), number)
        if command.key == "flushcfg":
            found.clear()
        found.append(command)
    return found


def is_ti_cfg(text: str) -> bool:
    """Whether a text has commands of TI's demonstrations."""
    return any(command.key in SIGNATURES or command.key in REFUSED for command in commands(text))
