"""Frames of a configuration file of a board's own tools, put on the radar file of the board."""

from __future__ import annotations

import copy
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rfgen_sionna.radar.boards import boards_for
from rfgen_sionna.radar.config import CHIRP, RadarConfigError

FRAME = "frame"
"""Preset of a file with one kind of frame; subframes are `subframe0`, `subframe1` …"""


class RadarConfigWarning(UserWarning):
    """A configuration file holds what the radar does not simulate."""


@dataclass(frozen=True)
class BoardFrames:
    """Frames and channels in a configuration file that leaves array, power and noise to the board."""

    presets: Mapping[str, dict[str, Any]]
    """Presets in the keys of a radar file; Tx elements by their numbers, from 1."""
    receivers: tuple[int, ...]
    """Numbers of the receivers in use, from 1."""
    real: bool
    """Whether samples are real."""
    bits: int | None = None
    """Bits of the ADC's words; None leaves them to the board."""
    backoff_db: float = 0.0
    """Reduction of the Tx power [dB]."""
    board: str | None = None
    """Name of the board where the file gives one."""
    devices: int = 1
    """Devices of 4 receivers at most, 4 in a cascade."""
    iq_swap: bool = False
    """Whether Q precedes I in recordings."""

    def __post_init__(self) -> None:
        if not self.receivers:
            raise RadarConfigError("no receiver is enabled (rxChannelEn is 0); at least one is needed")

    @property
    def transmitters(self) -> tuple[int, ...]:
        """Numbers of the Tx elements that fire in any preset."""
        fired: set[int] = set()
        for preset in self.presets.values():
            fired.update(preset.get("tx_order", ()), *(slot["tx"] for slot in preset.get("slot", ())))
        return tuple(sorted(fired))

    @property
    def band(self) -> tuple[float, float]:
        """Lowest and highest frequency in the ADC windows of all presets [Hz]."""
        ends = []
        for preset in self.presets.values():
            for chirp in preset.get("profile", (preset,)):
                first = chirp["start_frequency_hz"] + chirp["slope_hz_per_s"] * chirp["adc_start_time_s"]
                ends += [first, first + chirp["slope_hz_per_s"] * preset["num_samples"] / chirp["sample_rate_hz"]]
        return min(ends), max(ends)

    def boards(self) -> tuple[str, ...]:
        """Shipped boards of this band that have the elements in use, and such samples."""
        tx, rx = max(self.transmitters), max(self.receivers)
        return boards_for(self.band, tx, rx, most_rx=4 * self.devices, real=self.real)


def chirp_table(values: Sequence[float]) -> dict[str, float]:
    """A chirp in the keys of a radar file, from its values in the order of those keys."""
    return dict(zip(CHIRP, values, strict=True))


def element_numbers(names: Sequence[str], prefix: str) -> list[int]:
    """Numbers of the hardware's channels, from 1: from names such as "RX3", else from the order of the names."""
    found = [re.fullmatch(rf"{prefix}[_ ]?(\d+)", name, re.IGNORECASE) for name in names]
    numbers = [int(match[1]) for match in found if match]
    if len(numbers) < len(names) or len(set(numbers)) < len(names) or min(numbers) < 1:
        return list(range(1, len(names) + 1))
    return numbers


def named_tx(preset: Mapping[str, Any], names: Sequence[str], board: str) -> dict[str, Any]:
    """`preset` with the names of its Tx elements in place of their numbers (RadarConfigError where one is absent)."""
    by_number = dict(zip(element_numbers(names, "TX"), names, strict=True))

    def named(fired: Sequence[int]) -> list[str]:
        if absent := [number for number in fired if number not in by_number]:
            raise RadarConfigError(f"TX{absent[0]} fires; radar '{board}' has {', '.join(names)}")
        return [by_number[number] for number in fired]

    changed = dict(preset)
    if "tx_order" in changed:
        changed["tx_order"] = named(changed["tx_order"])
    if "slot" in changed:
        changed["slot"] = [slot | {"tx": named(slot["tx"])} for slot in changed["slot"]]
    return changed


def enabled_rx(receivers: Sequence[int], names: Sequence[str], board: str) -> list[int]:
    """Indices of the receivers in use among `names` (RadarConfigError where one is absent)."""
    numbers = element_numbers(names, "RX")
    if absent := set(receivers) - set(numbers):
        raise RadarConfigError(f"RX{min(absent)} is enabled; radar '{board}' has {', '.join(names)}")
    return [index for index, number in enumerate(numbers) if number in receivers]


def on_board(frames: BoardFrames, board: Mapping[str, Any], board_path: Path, where: str) -> dict[str, Any]:
    """Table of the radar file `board_path` with the presets, receivers and samples of `frames`.

    Raises
    ------
    RadarConfigError
        The board lacks an element, or its ADC has no such samples.
    """
    table = copy.deepcopy(dict(board))
    table.pop("source", None)
    name, array = table["name"], table["array"]
    try:
        table["preset"] = {
            preset: named_tx(values, array["tx_names"], name) for preset, values in frames.presets.items()
        }
        kept = enabled_rx(frames.receivers, array["rx_names"], name)
    except RadarConfigError as error:
        raise RadarConfigError(f"{where}: {error}{_other_boards(frames)}") from error
    for key, values in array.items():
        if key.startswith("rx_") and isinstance(values, list):
            array[key] = [values[index] for index in kept]
    table["default_preset"] = next(iter(frames.presets))
    if table["adc"].get("real", False) and not frames.real:
        raise RadarConfigError(
            f"{where}: samples are complex; the receivers of '{name}' have one converter each, for real samples"
            f"{_other_boards(frames)}"
        )
    table["adc"] |= {"real": frames.real, "iq_swap": frames.iq_swap}
    if frames.bits is not None:
        table["adc"]["bits"] = frames.bits
    table["transmitter"]["power_dbm"] -= frames.backoff_db
    if "file" in table["pattern"]:
        table["pattern"]["file"] = str(board_path.parent / table["pattern"]["file"])
    return table


def _other_boards(frames: BoardFrames) -> str:
    found = frames.boards()
    return f"; boards of this band with these elements: {', '.join(found)}" if found else ""
