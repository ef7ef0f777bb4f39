"""`.raw` and `.xml` of Infineon's Position2Go.

`.raw`: big-endian. A frame is float32 values k/4095 (k the 12-bit level), order chirp, receiver, I of all samples, Q of
all samples; then 8 uint32: frame number, chirps, receivers, samples, receiver mask, ADC bits, receivers interleaved,
data format (1 is complex with I and Q apart). Frames follow one another until the end of the file (Infineon's parser
`f_parse_data.m`). A folder of files is read as a sequence. Level 2048 is zero.

`.xml`: root `Device` with the elements that Infineon's parser and examples read.
"""

from __future__ import annotations

import os
import xml.etree.ElementTree as ElementTree
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna.radar import Radar
from rfgen_sionna.signal.formats.capture import Capture, CaptureFormatError, CaptureReport
from rfgen_sionna.signal.formats.consistency import check_xml
from rfgen_sionna.signal.formats.files import atomic_files, companion, data_file, need_file, warn_or_raise, whole_frames
from rfgen_sionna.signal.formats.frames import (
    Quantizer,
    WriteRequest,
    channel_numbers,
    complex_only,
    element_order,
    to_samples,
    with_receivers,
)
from rfgen_sionna.signal.formats.sidecar import SUFFIX, Description, find_description, sidecar_of

NAME = "position2go"
STANDARD = "position2go.raw"
ADC_BITS = 12  # of the board's ADC
FULL_SCALE = 1 << (ADC_BITS - 1)
_TOP = (1 << ADC_BITS) - 1
_TRAILER = "frame number, chirps, receivers, samples, receiver mask, ADC bits, receivers interleaved, data format"
_FIELDS = tuple(_TRAILER.split(", "))
_MOST_RECEIVERS = 32  # bits of the receiver mask
_CALIBRATION_VALUES = 16  # length of `callibrationData` in Infineon's files
_IGNORED_ELEMENTS = ("description", "callibrationData")
"""Elements without influence on the samples or their layout."""


def write(request: WriteRequest) -> CaptureReport:
    """Write `request.path` (or `position2go.raw` in it, where it is a folder) and its `.xml`; see `write_capture`.

    Raises
    ------
    CaptureFormatError
        The radar has more than one Tx: the format has no place for a second.
    """
    radar = request.cube.radar
    complex_only(radar, NAME)
    receivers = _receivers(radar)
    loops, _, channels, samples = radar.frame_shape
    quantizer = Quantizer(request, NAME, FULL_SCALE)
    data = data_file(request.path, STANDARD)
    paths = (data, companion(data, ".xml"), companion(data, SUFFIX))
    with atomic_files(paths, request.overwrite) as parts:
        with parts[0].open("wb") as stream:
            for number, levels in enumerate(quantizer.frames(receivers)):
                # (chirp, slot, rx, sample, IQ) to (chirp, slot, rx, IQ, sample)
                stored = levels.swapaxes(-1, -2)
                stream.write(((stored.astype(np.float32) + FULL_SCALE) / np.float32(_TOP)).astype(">f4").tobytes())
                trailer = (number, loops, channels, samples, _mask(receivers), ADC_BITS, 0, 1)
                stream.write(np.array(trailer, dtype=">u4").tobytes())
        parts[1].write_bytes(_xml(radar, receivers))
        quantizer.write_sidecar(parts[2])
    return quantizer.report(paths)


def read(path: str | os.PathLike[str], radar: Radar | None = None, *, partial: bool = False) -> Capture:
    """Open a `.raw` file, or all `.raw` files of a folder in the order of their names; see `open_capture`.

    Without a sidecar, `radar` gives the hardware and the pause between ramps, and an existing `.xml` ramp and frame.
    """
    target = Path(path)
    files = sorted(target.glob("*.raw")) if target.is_dir() else [need_file(data_file(target, STANDARD))]
    if not files:
        raise FileNotFoundError(f"'{target}' holds no .raw file")
    sidecar, config = sidecar_of(files[0]), companion(files[0], ".xml")

    def same(found: Description) -> None:
        check_xml(config, _xml(found.radar, _receivers(found.radar)), _IGNORED_ELEMENTS, sidecar, partial)

    known = find_description(files[0], sidecar, radar, lambda hardware: _configured(files[0], hardware), same)
    receivers = _receivers(known.radar)
    loops, slots, channels, samples = known.radar.frame_shape
    record = np.dtype([("levels", ">f4", (loops, slots, channels, 2, samples)), ("trailer", ">u4", len(_FIELDS))])
    expected = known.frames if len(files) == 1 else None
    stored: list[NDArray[Any]] = []
    places: list[tuple[int, int]] = []
    kept: list[int] = []
    before = 0
    for number, file in enumerate(files):
        count = whole_frames(file, record.itemsize, expected, partial)
        frames = np.memmap(file, dtype=record, mode="r", shape=(count,))
        whole = _check_trailers(file, frames["trailer"], (loops, channels, samples, _mask(receivers)), partial)
        stored.append(frames)
        places += [(number, int(place)) for place in whole]
        kept += [before + int(place) for place in whole]
        before += count
    if known.frames is not None and before != known.frames and len(files) > 1:
        warn_or_raise(f"'{target}' holds {before} frames; {known.frames} are expected", partial)
        kept = [number for number in kept if number < known.frames]

    def frame(number: int) -> NDArray[Any]:
        file, place = places[number]
        levels = np.rint(stored[file]["levels"][place].astype(np.float32) * np.float32(_TOP)) - FULL_SCALE
        return element_order(to_samples(levels.swapaxes(-1, -2)), known.radar, receivers)

    return Capture(
        NAME, tuple(files), known.radar, known.times(before)[kept], known.scale, known.seed, frame, (sidecar,), "none"
    )


def _check_trailers(
    path: Path, trailers: NDArray[Any], wanted: tuple[int, int, int, int], partial: bool
) -> NDArray[np.intp]:
    """Indices of the frames with a correct trailer: all frames unless `partial`."""
    expected = np.array([*wanted, ADC_BITS, 0, 1], dtype=np.uint32)
    wrong = np.argwhere(trailers[:, 1:] != expected)
    if len(wrong):
        frame, field = (int(value) for value in wrong[0])
        message = (
            f"'{path}', frame {frame}: {_FIELDS[field + 1]} is {int(trailers[frame, field + 1])}; "
            f"{int(expected[field])} is expected of this radar and format"
        )
        if len(set(wrong[:, 0].tolist())) == len(trailers):  # not a damaged frame: frames of another kind
            raise CaptureFormatError(message)
        warn_or_raise(message, partial)
    return np.flatnonzero(np.all(trailers[:, 1:] == expected, axis=1))


def _configured(data: Path, hardware: Radar) -> Description:
    config = companion(data, ".xml")
    return Description(radar_from_xml(config, hardware) if config.is_file() else hardware)


def _receivers(radar: Radar) -> list[int]:
    if len(radar.tx_names) != 1:
        raise CaptureFormatError(f"radar '{radar.name}' has {len(radar.tx_names)} Tx; Position2Go has one")
    if radar.waveform.num_slots > 1 or radar.waveform.slope < 0:
        raise CaptureFormatError(
            f"preset '{radar.preset}' has {radar.waveform.num_slots} slots a loop, the first with a slope of "
            f"{radar.waveform.slope:g} Hz/s; Position2Go has one kind of chirp, upwards or of a constant frequency"
        )
    return channel_numbers(radar.rx_names, "RX", _MOST_RECEIVERS, "the receiver mask")


def _mask(receivers: list[int]) -> int:
    return sum(1 << (number - 1) for number in receivers)


def _xml(radar: Radar, receivers: list[int]) -> bytes:
    wave = radar.waveform
    device = ElementTree.Element("Device")
    ElementTree.SubElement(device, "Acquisition", acquisitionRate=_number(wave.frame_period * 1e3))

    def put(path: str, value: str) -> None:
        at = device
        for name in path.split("/"):
            found = at.find(name)
            at = ElementTree.SubElement(at, name) if found is None else found
        at.text = value

    put("BaseEndpoint/DeviceInfo/description", f"{radar.name}, preset {radar.preset}")
    put("BaseEndpoint/DeviceInfo/numAntennasTx", "1")
    put("BaseEndpoint/DeviceInfo/numAntennasRx", str(len(receivers)))
    put("BaseEndpoint/FrameFormat/numSamplesPerChirp", str(wave.num_samples))
    put("BaseEndpoint/FrameFormat/numChirpsPerFrame", str(wave.num_loops))
    put("BaseEndpoint/FrameFormat/rxMask", str(_mask(receivers)))
    put("BaseEndpoint/FrameFormat/signalPart", "RADAR_SIGNAL_I_AND_Q")
    put("BaseEndpoint/chirpDuration_ns", _number(wave.ramp_end_time * 1e9))
    put("FmcwEndpoint/FmcwConfiguration/lowerFrequency_kHz", _number(wave.start_frequency / 1e3))
    upper = wave.start_frequency + wave.slope * wave.ramp_end_time
    put("FmcwEndpoint/FmcwConfiguration/upperFrequency_kHz", _number(upper / 1e3))
    put("AdcxmcEndpoint/AdcxmcConfiguration/samplerateHz", _number(wave.sample_rate))
    # Zeros: a simulated board needs no correction.
    put("CalibrationEndpoint/callibrationData", "[" + ", ".join(["0"] * _CALIBRATION_VALUES) + "]")
    ElementTree.indent(device)
    return bytes(ElementTree.tostring(device, encoding="utf-8", xml_declaration=True)) + b"\n"


def radar_from_xml(path: Path, hardware: Radar) -> Radar:
    """`hardware` with the ramp and the frame of a `.xml`.

    Raises
    ------
    CaptureFormatError
        Naming the missing or invalid element.
    """
    try:
        device = ElementTree.parse(path).getroot()
    except (ElementTree.ParseError, LookupError, ValueError) as error:  # the last two: unknown encodings
        raise CaptureFormatError(f"'{path}' is not XML: {error}") from error

    def text(name: str) -> str:
        found = device.findtext(name)
        if found is None:
            raise CaptureFormatError(f"'{path}' lacks the element {device.tag}/{name}")
        return found.strip()

    if (part := text("BaseEndpoint/FrameFormat/signalPart")) != "RADAR_SIGNAL_I_AND_Q":
        raise CaptureFormatError(f"'{path}': signalPart is '{part}'; RADAR_SIGNAL_I_AND_Q is supported")
    period = device.find("Acquisition")
    try:
        ramp = float(text("BaseEndpoint/chirpDuration_ns")) * 1e-9
        lower = float(text("FmcwEndpoint/FmcwConfiguration/lowerFrequency_kHz")) * 1e3
        upper = float(text("FmcwEndpoint/FmcwConfiguration/upperFrequency_kHz")) * 1e3
        mask = int(text("BaseEndpoint/FrameFormat/rxMask"))
        heard = [index for index, number in enumerate(_receivers(hardware)) if mask >> (number - 1) & 1]
        count = int(text("BaseEndpoint/DeviceInfo/numAntennasRx"))
        if bin(mask).count("1") != len(heard) or len(heard) > count:
            raise ValueError(f"rxMask is {mask} of {count} receivers; radar has {', '.join(hardware.rx_names)}")
        waveform = replace(
            hardware.waveform,
            start_frequency=lower,
            slope=(upper - lower) / ramp,
            range_limit=hardware.waveform.range_limit if upper != lower else hardware.max_range,
            sample_rate=float(text("AdcxmcEndpoint/AdcxmcConfiguration/samplerateHz")),
            num_samples=int(text("BaseEndpoint/FrameFormat/numSamplesPerChirp")),
            num_loops=int(text("BaseEndpoint/FrameFormat/numChirpsPerFrame")),
            ramp_end_time=ramp,
            frame_period=hardware.waveform.frame_period
            if period is None
            else float(period.get("acquisitionRate", hardware.waveform.frame_period * 1e3)) * 1e-3,
        )
        return with_receivers(replace(hardware, waveform=waveform), heard)
    except CaptureFormatError:
        raise
    except (ValueError, ZeroDivisionError) as error:
        raise CaptureFormatError(f"'{path}': {error}") from error


def _number(value: float) -> str:
    return f"{value:.13g}"
