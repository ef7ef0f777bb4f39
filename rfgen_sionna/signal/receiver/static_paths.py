"""Returns of the device itself, the same in every frame: Tx-Rx leakage, chassis, range bias.

A path of delay tau and voltage gain g has the signal `g exp(j 2 pi [f_0 tau + mu t tau - mu tau^2 / 2])` after the
mixer, as in :mod:`rfgen_sionna.signal.synthesis`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from rfgen_sionna._types import SPEED_OF_LIGHT, ComplexArray, FloatArray
from rfgen_sionna.radar import Radar
from rfgen_sionna.signal.receiver.value_checks import check_number


@dataclass(frozen=True)
class Leakage:
    """Direct path from each Tx to each Rx element."""

    level_db: float
    """Power at an Rx port over the power at the Tx port, minus the isolation [dB]."""
    extra_length: float = 0.0
    """Path length in addition to the distance between the two elements [m]."""

    def __post_init__(self) -> None:
        check_number("leakage.level_db", self.level_db, -200, 0, "dB")
        check_number("leakage.extra_length", self.extra_length, 0, 10, "m")

    def path_lengths(self, radar: Radar) -> FloatArray:
        """(tx, rx) [m]"""
        gap = radar.tx_positions[:, None] - radar.rx_positions[None]
        return np.asarray(np.linalg.norm(gap, axis=-1) + self.extra_length)


@dataclass(frozen=True)
class Chassis:
    """Bumper, radome or housing: a plate normal to the boresight that reflects each Tx into each Rx element."""

    level_db: float
    """Power at an Rx port over the power at the Tx port [dB]."""
    distance: float
    """Distance from the device's origin along the boresight [m]."""

    def __post_init__(self) -> None:
        check_number("chassis.level_db", self.level_db, -200, 0, "dB")
        check_number("chassis.distance", self.distance, 1e-3, 100, "m")

    def path_lengths(self, radar: Radar) -> FloatArray:
        """(tx, rx) distance of the image of each Tx element [m]."""
        image = radar.tx_positions * [-1.0, 1.0, 1.0] + [2 * self.distance, 0.0, 0.0]
        return np.asarray(np.linalg.norm(image[:, None] - radar.rx_positions[None], axis=-1))


@dataclass(frozen=True)
class RangeBias:
    """Common delay of cables and feeds, as a distance that ranges appear too far."""

    distance: float
    """[m]; 0.06 to 0.07 for real boards."""

    def __post_init__(self) -> None:
        check_number("range_bias.distance", self.distance, -1, 10, "m")

    @property
    def delay(self) -> float:
        """[s]"""
        return 2 * self.distance / SPEED_OF_LIGHT

    def phasor(self, radar: Radar) -> ComplexArray:
        """(sample,) factor that adds the delay tau_b to every path.

        The cross term exp(-j 2 pi mu tau tau_b) of a path of delay tau is left out, a constant phase of 2 pi tau_b
        times the beat frequency, the same for every chirp. It changes velocities by mu tau_b / f_0, relative.
        """
        return tone(radar, radar.waveform.sample_times, np.asarray(self.delay))


def tone(radar: Radar, times: FloatArray, delay: FloatArray) -> ComplexArray:
    """(..., time) dechirped unit path of `delay` (...) [s] at `times` after the start of the ramp [s]."""
    f_0, mu = radar.waveform.start_frequency, radar.waveform.slope
    delay = np.asarray(delay)[..., None]
    cycles = f_0 * delay + mu * times * delay - 0.5 * mu * delay**2
    return np.asarray(np.exp(2j * math.pi * (cycles - np.rint(cycles))))


@dataclass(frozen=True)
class StaticPath:
    """Path of the device itself."""

    amplitude: ComplexArray
    """(tx, rx, 1) with the phases of the feeds [sqrt(W)]"""
    delay: FloatArray
    """(tx, rx) [s]"""


def static_paths(
    radar: Radar, leakage: Leakage | None, chassis: Chassis | None, bias: RangeBias | None
) -> list[StaticPath]:
    """Leakage and chassis reflection, with the range bias; one beyond the range window is a ValueError."""
    paths = []
    tx, rx = radar.feed_factors
    feeds: ComplexArray = np.conj(tx[:, None] * rx)
    for name, source in (("leakage.extra_length", leakage), ("chassis.distance", chassis)):
        if source is None:
            continue
        length = source.path_lengths(radar)
        if length.max() > 2 * radar.max_range:
            raise ValueError(
                f"{name} makes a path of {length.max():.2f} m; the range window of radar '{radar.name}' ends at a path "
                f"of {2 * radar.max_range:.2f} m"
            )
        power = 1e-3 * 10.0 ** ((radar.tx_power_dbm + source.level_db) / 10)
        delay = length / SPEED_OF_LIGHT + (0.0 if bias is None else bias.delay)
        paths.append(StaticPath(np.asarray(math.sqrt(power) * feeds[..., None]), delay))
    return paths
