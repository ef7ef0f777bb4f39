"""Frames of a DCA1000's recording: which files are parts of it, what its size says, where packets are missing."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna.radar import Radar
from rfgen_sionna.signal.formats.capture import CaptureFormatError, CaptureWarning
from rfgen_sionna.signal.formats.continuity import find_breaks
from rfgen_sionna.signal.formats.files import whole_frames
from rfgen_sionna.signal.formats.lanes import LaneLayout
from rfgen_sionna.signal.formats.losses import PACKET
from rfgen_sionna.signal.formats.sidecar import Description
from rfgen_sionna.signal.formats.stream import ByteStream
from rfgen_sionna.signal.formats.studio_files import RecordedFiles
from rfgen_sionna.signal.formats.udp import header_size, unpack

_MOST_LISTED = 4  # breaks in a message
_MIRRORED = 4.0  # energy of the farther half over that of the nearer one


def one_recording(recording: RecordedFiles, frame_size: int, frames: int | None) -> RecordedFiles:
    """`recording`, or one file of it where files such as `walk_0.bin`, `walk_1.bin` are recordings of their own.

    They are parts of one where together they have the declared `frames`, or, without a number, where all but the last
    have the same size, and the last is smaller.

    Raises
    ------
    CaptureFormatError
        They are recordings of their own, and none of them was asked for.
    """
    if recording.joined:
        return recording
    sizes = [file.stat().st_size for file in recording.data]
    if frames is not None:
        parts = sum(sizes) == frames * frame_size
    else:
        parts = len(set(sizes[:-1])) == 1 and sizes[-1] < sizes[0]
    names = ", ".join(f"'{file.name}'" for file in recording.data)
    if parts:
        if frames is None:
            warnings.warn(f"{names} are taken for parts of one recording, by their sizes", CaptureWarning, stacklevel=4)
        return recording
    if recording.named is None:
        raise CaptureFormatError(
            f"'{recording.data[0].parent}' holds {names}: recordings of their own by their sizes, or by numFrames; "
            "open one of them, or name the parts of one in a .setup.json"
        )
    return replace(recording, data=(recording.named,))


def open_stream(recording: RecordedFiles) -> tuple[ByteStream, bool]:
    """Data of the files, and whether they were a dump of packets; packets lost from one are a CaptureWarning."""
    if not any(header_size(file) for file in recording.data):
        return ByteStream.of(recording.data), False
    stream = unpack(recording.data)
    if gaps := stream.gaps:
        lost = sum(count for _, count in gaps)
        warnings.warn(
            f"'{recording.data[0]}' is a dump of UDP packets, of which {-(-lost // PACKET):,} were lost: {lost:,} of "
            f"{stream.size:,} bytes are zeros, from byte {gaps[0][0]:,} on",
            CaptureWarning,
            stacklevel=4,
        )
    return stream, True


def stored_receivers(
    layout: LaneLayout, receivers: Sequence[int], stream: ByteStream
) -> tuple[LaneLayout, list[int] | slice]:
    """Layout in the file, and the receivers in it that are on.

    Four lanes carry all four receivers, zeros in place of those that are off (TI SWRA581B); mmWave Studio's
    `rawDataReader` expects those that are on alone. The zeros decide.
    """
    if layout.lanes != 4 or not layout.interleaved or layout.channels == 4:
        return layout, slice(None)
    full = replace(layout, channels=4)
    if stream.size < full.frame_size:
        return layout, slice(None)
    levels = replace(full, loops=1).unpack(stream.read(0, full.loop_size))
    on = sorted(number - 1 for number in receivers)
    off = [number for number in range(4) if number not in on]
    if np.any(levels[:, :, off]) or not np.any(levels):
        return layout, slice(None)
    return full, on


def check_size(
    stream: ByteStream, path: Path, config: Path, layout: LaneLayout, known: Description, hardware: Radar
) -> None:
    """Refuse a size that no recording of this configuration has, truncated or not: its frames would be scrambled."""
    loops, slots, channels, samples = known.radar.frame_shape
    word = 2 * layout.parts
    each, size = word * loops * slots * layout.channels, stream.size
    said = (
        f"'{path}' has {size:,} bytes; by '{config.name}' a frame has {each * samples:,}: numLoops x chirps {loops} x "
        f"{slots}, receivers {channels}, numAdcSamples {samples}, {word} bytes a sample"
    )
    # A truncated file ends anywhere; one that fits frames of another size exactly was not truncated.
    broken = size % (each * samples) != 0
    own, rest = divmod(size, word * int(np.prod(hardware.frame_shape)))
    exact = known.frames not in (None, size // (each * samples)) and own == known.frames
    if not rest and (broken or exact) and hardware.frame_shape != known.radar.frame_shape:
        raise CaptureFormatError(
            f"{said}; the size is that of whole frames (chirp, tx, rx, sample) of {hardware.frame_shape}, those of "
            f"radar '{hardware.name}', preset '{hardware.preset}'"
        )
    if known.frames is None:
        return
    said += f", numFrames {known.frames}"
    if size > known.frames * each * samples:
        over = size - known.frames * each * samples
        raise CaptureFormatError(f"{said}; {over:,} bytes are too many: one of these fields is wrong")
    other, rest = divmod(size, known.frames * each)
    if broken and not rest:
        raise CaptureFormatError(f"{said}; the size is that of numAdcSamples {other}")


def complete_stream(
    stream: ByteStream, path: Path, layout: LaneLayout, known: Description, partial: bool, searched: bool, cure: str
) -> tuple[ByteStream, int]:
    """The recording with zeros in place of packets that are missing, and the number of its frames to read.

    The places of missing packets are estimated from the chirps where `searched`; `cure` is added to an error.

    Raises
    ------
    CaptureFormatError
        As :func:`~rfgen_sionna.signal.formats.files.whole_frames`.
    """
    size, note, filled = layout.frame_size, cure, stream
    missing = 0 if known.frames is None else known.frames * size - stream.size
    lacks = next((count for count in (missing, -stream.size % size) if count > 0 and count % PACKET == 0), 0)
    if searched and lacks and stream.size % size:
        packets = lacks // PACKET
        note = f"; as much as {packets} {'packet' if packets == 1 else 'packets'} of {PACKET:,} bytes of a DCA1000: "
        breaks = find_breaks(stream, layout.loop_size, layout.loops, packets)
        if breaks is None:
            note += (
                "successive loops do not show where (noise, fast motion, or echoes alike after a shift); frames after "
                "the gap are out of step"
            )
        elif not breaks:
            note += (
                "successive loops show no break: the end of the recording is missing, or else packets at its start or "
                "between two frames, and frames are out of step"
            )
        else:
            for position, count in breaks:
                filled = filled.with_gap(position, count * PACKET)
            if others := packets - sum(count for _, count in breaks):
                note += f"{others} show no break, others are, "
            note += (
                f"by the continuity of loops, an estimate, at {_places(breaks, layout, known.radar)}; zeros stand in "
                "for them in a read with partial=True"
            )
    frames = whole_frames(path, size, known.frames, partial, size=stream.size, filled=filled.size, note=note)
    return filled, frames


def warn_if_mirrored(samples: NDArray[Any], known: Description, path: Path) -> None:
    """Warn where the farther half of the range axis holds most of the energy, as it does with I and Q exchanged.

    `samples` (chirp, tx, rx, sample) are one frame. Its mean over samples, the offset of the ADC, does not count.
    """
    if known.radar.adc.real or known.radar.waveform.slope <= 0:
        return
    centred = samples[:8] - samples[:8].mean(axis=-1, keepdims=True)
    energy = np.square(np.abs(np.fft.fft(centred * np.hanning(samples.shape[-1])))).sum(axis=(0, 1, 2))
    half = len(energy) // 2
    near, far = float(energy[:half].sum()), float(energy[half:].sum())
    if far > _MIRRORED * near:
        order = "Q before I" if known.iq_swap else "I before Q"
        warnings.warn(
            f"'{path}', read with {order}: the farther half of the range axis holds {10 * np.log10(far / near):.0f} dB "
            f"more than the nearer one; if nothing strong is there, the order is the other one: pass "
            f"iq_swap={not known.iq_swap}, or set adc.iq_swap in the radar's file",
            CaptureWarning,
            stacklevel=4,
        )


def _places(breaks: Sequence[tuple[int, int]], layout: LaneLayout, radar: Radar) -> str:
    texts = []
    for position, packets in breaks[:_MOST_LISTED]:
        frame, rest = divmod(position, layout.frame_size)
        loop, rest = divmod(rest, layout.loop_size)
        slot, rest = divmod(rest, layout.loop_size // layout.slots)
        name = radar.axis_names[radar.waveform.slot_axis[slot]]
        receiver = (
            "" if layout.interleaved else f", receiver {rest * layout.channels * layout.slots // layout.loop_size}"
        )
        count = "" if packets == 1 else f", {packets} packets"
        texts.append(f"byte {position:,} (frame {frame}, chirp {loop}, {name}{receiver}{count})")
    return " and ".join(texts) + (f" and {len(breaks) - _MOST_LISTED} more" if len(breaks) > _MOST_LISTED else "")
