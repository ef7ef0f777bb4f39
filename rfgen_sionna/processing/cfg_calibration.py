"""Calibration that a board measured with TI's demonstration, from its `.cfg`."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from rfgen_sionna.processing.calibration import Calibration
from rfgen_sionna.radar.board_frames import element_numbers
from rfgen_sionna.radar.ti_cfg_commands import commands

if TYPE_CHECKING:
    from rfgen_sionna.radar import Radar

_COMMAND = "compRangeBiasAndRxChanPhase"
_RX = 4
"""Receivers of a device, all of which the command lists for each Tx."""


def read_cfg_calibration(path: str | os.PathLike[str], radar: Radar) -> Calibration:
    """Calibration of the command `compRangeBiasAndRxChanPhase` of a `.cfg`, for the elements of `radar`.

    Its factors, by the numbers of Tx and Rx, multiply the samples of each channel (mmWave SDK user guide): the gains
    are their inverses, without the phases of the elements' feeds that `radar` has.

    Raises
    ------
    ValueError
        The file has no such command, or not all elements of the radar.
    """
    file = Path(path)
    found = [
        each
        for each in commands(file.read_text(encoding="utf-8-sig", errors="replace"))
        if each.key == _COMMAND.lower()
    ]
    if not found:
        raise ValueError(f"'{file}' has no {_COMMAND}")
    try:
        bias, *parts = (float(argument) for argument in found[-1].arguments)
    except ValueError as error:
        raise ValueError(f"'{file}': {found[-1]} needs a range bias and pairs of numbers: {error}") from error
    tx, rx = element_numbers(radar.tx_names, "TX"), element_numbers(radar.rx_names, "RX")
    if len(parts) % (2 * _RX) or max(tx) > len(parts) // (2 * _RX) or max(rx) > _RX:
        raise ValueError(
            f"'{file}': {found[-1]} has {len(parts)} numbers after the bias; radar '{radar.name}' has TX{max(tx)} and "
            f"RX{max(rx)}: a pair for each of {_RX} Rx and each Tx is needed"
        )
    pairs = np.array(parts).reshape(-1, _RX, 2)
    factors = (pairs[..., 0] + 1j * pairs[..., 1])[np.ix_([number - 1 for number in tx], [number - 1 for number in rx])]
    if not np.all(factors):
        raise ValueError(f"'{file}': {found[-1]} has the factor 0; others are needed")
    feeds = np.conj(np.multiply.outer(*radar.feed_factors))  # the mixer conjugates them
    return Calibration(1 / (factors * feeds), radar.tx_names, radar.rx_names, bias)
