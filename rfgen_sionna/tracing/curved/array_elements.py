"""ArrayElements of a radar, for returns by way of bent surfaces."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from rfgen_sionna._types import FloatArray
from rfgen_sionna.radar import Radar
from rfgen_sionna.tracing.gains.band import BandTracer


@dataclass(frozen=True)
class ArrayElements:
    """Who sends and receives."""

    position: FloatArray
    """(3,) phase centre, where rays start [m]."""
    rotation: FloatArray
    """(3, 3) device to world."""
    tx: FloatArray
    """(tx, 3) [m], world."""
    rx: FloatArray
    """(rx, 3) [m], world."""
    fields: tuple[FloatArray, FloatArray]
    """(3,) directions of the electric field of Tx and Rx elements, world."""
    pattern_gain: Callable[[FloatArray], FloatArray]
    """Directions (..., 3) to the elements' two-way field gain (...,), relative to its peak."""

    @staticmethod
    def of(radar: Radar) -> ArrayElements:
        """A radar's."""
        return ArrayElements(
            np.asarray(radar.position, np.float64),
            radar.rotation,
            np.atleast_2d(radar.tx_world),
            np.atleast_2d(radar.rx_world),
            (radar.tx_field, radar.rx_field),
            BandTracer(radar, 1e-2).pattern_gain,
        )
