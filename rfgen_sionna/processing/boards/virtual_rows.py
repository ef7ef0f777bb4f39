"""Rows of a virtual array as TI's firmware uses them: a filled azimuth row, and one above it for elevation."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from rfgen_sionna.radar import Radar


@dataclass(frozen=True)
class VirtualRows:
    """Elements of the two rows, from the right to the left seen from the radar looking out."""

    azimuth: NDArray[np.int64]
    """(element, 2) Tx and Rx of the azimuth row, half a wavelength apart."""
    elevation: NDArray[np.int64]
    """(element, 2) Tx and Rx of the elevation row; (0, 2) without one."""
    offset: float
    """First element of the elevation row to the left of that of the azimuth row, in pitches of the azimuth row."""
    height: float
    """Elevation row over the azimuth row, in pitches of the azimuth row; below it is negative."""


def virtual_rows(radar: Radar) -> VirtualRows:
    """Azimuth and elevation row of the array of a board of TI with its antennas in two rows.

    Raises
    ------
    ValueError
        If the longest row is not evenly spaced, or another row is not on its grid (the ODS and AOP boards).
    """
    position = radar.virtual_positions
    pitch = radar.wavelength / 2
    heights = np.round(position[..., 2] / (pitch / 8)).astype(int)
    levels, sizes = np.unique(heights, return_counts=True)
    main = levels[np.argmax(sizes)]
    rows = {}
    for level in levels:
        elements = np.argwhere(heights == level)
        across = position[elements[:, 0], elements[:, 1], 1]
        order = np.argsort(across, kind="stable")
        rows[level] = elements[order], across[order]
    azimuth, across = rows[main]
    step = float(np.median(np.diff(across))) if len(across) > 1 else pitch
    if len(across) < 2 or not np.allclose(np.diff(across), step, atol=step / 20) or abs(step / pitch - 1) > 0.1:
        raise ValueError(
            f"radar '{radar.name}' has no row of elements half a wavelength apart (the longest has {len(across)}): "
            "this chain is that of boards with a filled azimuth row (IWR1443, xWR1843, IWR6843ISK); "
            "processing.point_cloud takes any array"
        )
    others = [level for level in levels if level != main]
    if not others:
        return VirtualRows(azimuth, np.empty((0, 2), np.int64), 0.0, 0.0)
    if len(others) > 1:
        raise ValueError(
            f"radar '{radar.name}' has elements at {len(levels)} heights: this chain takes one or two rows; "
            "processing.point_cloud takes any array"
        )
    elevation, above = rows[others[0]]
    rise = position[elevation[0, 0], elevation[0, 1], 2] - position[azimuth[0, 0], azimuth[0, 1], 2]
    return VirtualRows(azimuth, elevation, float((above[0] - across[0]) / step), float(rise / step))
