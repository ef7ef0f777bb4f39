"""Samples that were lost on the way from the board: zeros in place of packets that did not arrive."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._short_repr import ShortRepr
from rfgen_sionna.radar import Radar

PACKET = 1456
"""Bytes of data in a packet of a DCA1000."""
Order = Literal["receiver", "sample", "none"]
"""Slowest axis of a chirp in a file: all samples of a receiver, or all receivers of a sample; "none": no packets."""
_SHORT_RUN = 64
"""Zeros at the border of a frame that count as the rest of a packet [bytes]."""
_MOST_LISTED = 4  # frames in a warning


@dataclass(frozen=True, eq=False, repr=False)
class Loss(ShortRepr):
    """Samples of one frame that are zero because packets were lost, or because a channel is silent."""

    frame: int
    rows: NDArray[np.bool_]
    """(chirp, tx, rx) whether samples are lost."""
    samples: int
    """Number of lost samples."""
    share: float
    """Of the samples of the frame."""
    tx_names: tuple[str, ...]
    rx_names: tuple[str, ...]

    @property
    def chirps(self) -> tuple[int, ...]:
        """Loops with lost samples, from 0."""
        return tuple(int(chirp) for chirp in np.flatnonzero(self.rows.any(axis=(1, 2))))

    @property
    def channels(self) -> tuple[tuple[str, str], ...]:
        """Names of the Tx (or slot) and Rx of the channels with lost samples."""
        found = np.argwhere(self.rows.any(axis=0))
        return tuple((self.tx_names[tx], self.rx_names[rx]) for tx, rx in found)

    def __str__(self) -> str:
        if self.rows.all() and self.share == 1.0:
            return f"frame {self.frame}: all"
        return (
            f"frame {self.frame}: {100 * self.share:.2g} %, in chirps {_ranges(self.chirps)}, "
            f"{_names(self.tx_names, self.rows.any(axis=(0, 2)))}, {_names(self.rx_names, self.rows.any(axis=(0, 1)))}"
        )


def find_loss(frame: int, samples: NDArray[Any], radar: Radar, order: Order) -> Loss | None:
    """Lost samples of a frame (chirp, tx, rx, sample), or None.

    Lost are rows of one chirp and channel that are zero throughout and, with packets, every run of zeros in the order
    of the file as long as a packet, or at the border of the frame, where a packet goes on in the next frame. A
    receiver's noise is above a bit, so that such runs are no signal.
    """
    zero = samples == 0
    lost = np.repeat(zero.all(axis=-1, keepdims=True), zero.shape[-1], axis=-1)
    if order != "none":
        slots, receivers = np.argsort(radar.waveform.slot_axis), np.argsort(np.argsort(_numbers(radar.rx_names)))
        sent = zero[:, list(radar.waveform.slot_axis)][:, :, np.argsort(receivers)]
        if order == "sample":
            sent = sent.swapaxes(2, 3)
        runs = _long_runs(sent.ravel(), 2 if radar.adc.real else 4).reshape(sent.shape)
        runs = runs.swapaxes(2, 3) if order == "sample" else runs
        lost |= runs[:, slots][:, :, receivers]
    if not lost.any():
        return None
    count = int(np.count_nonzero(lost))
    rows = np.asarray(lost.any(axis=-1), dtype=np.bool_)
    return Loss(frame, rows, count, count / lost.size, radar.axis_names, radar.rx_names)


def summary(losses: Sequence[Loss], frames: int) -> str:
    """Lost samples of a capture of so many frames, in one sentence."""
    listed = "; ".join(map(str, losses[:_MOST_LISTED]))
    more = f"; and {len(losses) - _MOST_LISTED} more" if len(losses) > _MOST_LISTED else ""
    silent = np.logical_and.reduce([loss.rows.all(axis=(0, 1)) for loss in losses]) if len(losses) == frames else []
    dead = "" if not np.any(silent) or np.all(silent) else f" ({_names(losses[0].rx_names, silent)} silent throughout)"
    return f"samples of {len(losses)} of {frames} frames are lost (zeros){dead}: {listed}{more}"


def _long_runs(zero: NDArray[np.bool_], size: int) -> NDArray[np.bool_]:
    """Runs of zeros (of samples of `size` bytes) of a packet's length, or at the border."""
    steps = np.flatnonzero(np.diff(zero.astype(np.int8), prepend=0, append=0))
    first, end = steps[::2], steps[1::2]
    least = np.where((first == 0) | (end == len(zero)), _SHORT_RUN, PACKET)
    out = np.zeros_like(zero)
    for run in np.flatnonzero((end - first) * size >= least):
        out[first[run] : end[run]] = True
    return out


def _numbers(names: Sequence[str]) -> list[int]:
    found = [re.search(r"(\d+)$", name) for name in names]
    numbers = [int(match[1]) for match in found if match]
    return numbers if len(numbers) == len(names) else list(range(len(names)))


def _ranges(values: Sequence[int]) -> str:
    groups: list[list[int]] = []
    for value in values:
        if groups and value == groups[-1][1] + 1:
            groups[-1][1] = value
        else:
            groups.append([value, value])
    texts = [str(first) if first == last else f"{first} … {last}" for first, last in groups]
    return ", ".join(texts[:_MOST_LISTED]) + (", …" if len(texts) > _MOST_LISTED else "")


def _names(names: Sequence[str], chosen: Any) -> str:
    found = [name for name, taken in zip(names, chosen, strict=True) if taken]
    return f"all of {names[0]} … {names[-1]}" if len(found) == len(names) > 2 else ", ".join(found)
