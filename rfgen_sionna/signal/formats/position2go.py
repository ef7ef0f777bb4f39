"""`.raw` and `.xml` of Infineon's Position2Go.

`.raw`: big-endian. A frame is float32 values k/4095 (k the 12-bit level), order chirp, receiver, I of all samples, Q of
all samples; then 8 uint32: frame number, chirps, receivers, samples, receiver mask, ADC bits, receivers interleaved,
data format (1 is complex with I and Q apart). Frames follow one another until the file ends, as Infineon's parser
`f_parse_data.m` reads them; files of one frame each are read as a sequence.

`.xml`: root `Device`; the elements that Infineon's parser and examples ask for. Level 2048 is zero.
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
from rfgen_sionna.signal.formats.files import (
    atomic_files,
    companion_path,
    data_file,
    need_file,
    warn_or_raise,
    whole_frames,
)
from rfgen_sionna.signal.formats.frames import (
    WriteRequest,
    channel_numbers,
    complex_lsb,
    element_order,
    firing_order,
    frame_shape,
    frames_of,
    quantize,
)
from rfgen_sionna.signal.formats.sidecar import SUFFIX, Description, describe, find_description, write_sidecar

NAME = "position2go"
STANDARD = "position2go.raw"
ADC_BITS = 12
FULL_SCALE = 1 << (ADC_BITS - 1)
_TOP = (1 << ADC_BITS) - 1
_TRAILER = (
    "frame number",
    "chirps",
    "receivers",
    "samples",
    "receiver mask",
    "ADC bits",
    "receivers interleaved",
    "data format",
)
_MOST_RECEIVERS = 32
_CALIBRATION_VALUES = 16
_IGNORED_ELEMENTS = ("description", "callibrationData")
"""Elements that do not say what the capture holds."""


def write(request: WriteRequest) -> CaptureReport:
    """Write `request.path` (or `position2go.raw` in it, where it is a folder) and its `.xml`; see `write_capture`.

    Raises
    ------
    CaptureFormatError
        The radar has more than one Tx: the format has no place for a second.
    """
    cube, radar = request.cube, request.cube.radar
    receivers = _receivers(radar)
    loops, _, channels, samples = frame_shape(radar)
    divisor, declared = request.resolve_scale(FULL_SCALE)
    data = data_file(request.path, STANDARD)
    paths = (data, companion_path(data, ".xml"), companion_path(data, SUFFIX))
    clipped = 0
    with atomic_files(paths, request.overwrite) as parts:
        with parts[0].open("wb") as stream:
            for number, frame in enumerate(frames_of(cube)):
                levels, beyond = quantize(frame, divisor, FULL_SCALE)
                clipped += beyond
                # (chirp, slot, rx, sample, IQ) to (chirp, slot, rx, IQ, sample)
                stored = firing_order(levels, radar, receivers).swapaxes(-1, -2)
                stream.write(((stored.astype(np.float32) + FULL_SCALE) / np.float32(_TOP)).astype(">f4").tobytes())
                trailer = (number, loops, channels, samples, _mask(receivers), ADC_BITS, 0, 1)
                stream.write(np.array(trailer, dtype=">u4").tobytes())
        parts[1].write_bytes(_xml(radar, receivers))
        write_sidecar(parts[2], describe(cube, NAME, declared, FULL_SCALE))
    return CaptureReport(NAME, paths, cube.data.shape[0], declared, FULL_SCALE, clipped, 2 * cube.data.size)


def read(path: str | os.PathLike[str], radar: Radar | None = None, *, partial: bool = False) -> Capture:
    """Open a `.raw` file, or all `.raw` files of a folder in the order of their names; see `open_capture`.

    Without a sidecar, `radar` gives the hardware, and `.xml`, where it is there, the ramp and the frame. The pause
    between ramps is not in the `.xml`: it is that of `radar`.
    """
    target = Path(path)
    files = sorted(target.glob("*.raw")) if target.is_dir() else [need_file(data_file(target, STANDARD))]
    if not files:
        raise FileNotFoundError(f"'{target}' holds no .raw file")
    sidecar, config = companion_path(files[0], SUFFIX), companion_path(files[0], ".xml")

    def same(found: Description) -> None:
        check_xml(config, _xml(found.radar, _receivers(found.radar)), _IGNORED_ELEMENTS, sidecar, partial)

    known = find_description(files[0], sidecar, radar, lambda hardware: _configured(files[0], hardware), same)
    receivers = _receivers(known.radar)
    loops, slots, channels, samples = frame_shape(known.radar)
    record = np.dtype([("levels", ">f4", (loops, slots, channels, 2, samples)), ("trailer", ">u4", len(_TRAILER))])
    expected = known.frames if len(files) == 1 else None
    stored: list[NDArray[Any]] = []
    places: list[tuple[int, int]] = []
    kept: list[int] = []
    before = 0
    for number, file in enumerate(files):
        count = whole_frames(file, file.stat().st_size, record.itemsize, expected, partial)
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
        return element_order(complex_lsb(levels.swapaxes(-1, -2)), known.radar, receivers)

    return Capture(NAME, tuple(files), known.radar, known.times(before)[kept], known.scale, known.seed, frame)


def _check_trailers(
    path: Path, trailers: NDArray[Any], wanted: tuple[int, int, int, int], partial: bool
) -> NDArray[np.intp]:
    """The frames whose trailers are right: all of them, or with `partial` those that are left."""
    expected = np.array([*wanted, ADC_BITS, 0, 1], dtype=np.uint32)
    wrong = np.argwhere(trailers[:, 1:] != expected)
    if len(wrong):
        frame, field = (int(value) for value in wrong[0])
        message = (
            f"'{path}', frame {frame}: {_TRAILER[field + 1]} is {int(trailers[frame, field + 1])}; "
            f"{int(expected[field])} is expected of this radar and format"
        )
        if len(set(wrong[:, 0].tolist())) == len(trailers):  # not a damaged frame: frames of another kind
            raise CaptureFormatError(message)
        warn_or_raise(message, partial)
    return np.flatnonzero(np.all(trailers[:, 1:] == expected, axis=1))


def _configured(data: Path, hardware: Radar) -> Description:
    config = companion_path(data, ".xml")
    return Description(radar_from_xml(config, hardware) if config.is_file() else hardware, None, None, None)


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
    # No correction: a simulated board has no error to take out.
    put("CalibrationEndpoint/callibrationData", "[" + ", ".join(["0"] * _CALIBRATION_VALUES) + "]")
    ElementTree.indent(device)
    return bytes(ElementTree.tostring(device, encoding="utf-8", xml_declaration=True)) + b"\n"


def radar_from_xml(path: Path, hardware: Radar) -> Radar:
    """`hardware` with the ramp and the frame that a `.xml` tells.

    Raises
    ------
    CaptureFormatError
        Naming the element that is missing, or that cannot be.
    """
    try:
        device = ElementTree.parse(path).getroot()
    except (ElementTree.ParseError, LookupError, ValueError) as error:  # the last two: encodings that are none
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
        return replace(
            hardware,
            waveform=waveform,
            rx_names=tuple(hardware.rx_names[index] for index in heard),
            rx_positions=hardware.rx_positions[heard],
        )
    except CaptureFormatError:
        raise
    except (ValueError, ZeroDivisionError) as error:
        raise CaptureFormatError(f"'{path}': {error}") from error


def _number(value: float) -> str:
    return f"{value:.13g}"
