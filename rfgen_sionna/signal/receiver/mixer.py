"""Errors of the quadrature mixer: IQ imbalance and DC offset."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from rfgen_sionna._types import ComplexArray
from rfgen_sionna.radar import Radar
from rfgen_sionna.signal.random_streams import device_stream
from rfgen_sionna.signal.receiver.value_checks import number_or_numbers, per_element


@dataclass(frozen=True)
class IqImbalance:
    """Unequal gain of I and Q, and an angle between them that is not 90 degrees.

    I' = I, Q' = g (Q cos p - I sin p), so x' = K1 x + K2 conj(x) with K1 = (1 + g exp(-jp)) / 2 and
    K2 = (1 - g exp(jp)) / 2: the image of a tone appears at minus its frequency.
    """

    gain_db: float | tuple[float, ...] = 0.0
    """Gain g of Q over I [dB]; one number, or one for each Rx element."""
    phase_deg: float | tuple[float, ...] = 0.0
    """Quadrature error p [degrees]; one number, or one for each Rx element."""

    def __post_init__(self) -> None:
        for name, limit, unit in (("gain_db", 20, "dB"), ("phase_deg", 89, "degrees")):
            value = number_or_numbers(f"iq_imbalance.{name}", getattr(self, name), -limit, limit, unit)
            object.__setattr__(self, name, value)

    def coefficients(self, radar: Radar) -> tuple[ComplexArray, ComplexArray]:
        """(rx,) K1 and K2."""
        gain = 10.0 ** (per_element("iq_imbalance.gain_db", self.gain_db, radar.rx_names) / 20)
        phase = np.radians(per_element("iq_imbalance.phase_deg", self.phase_deg, radar.rx_names))
        turn = np.asarray(gain * np.exp(1j * phase), dtype=np.complex128)
        return np.asarray(0.5 * (1 + np.conj(turn))), np.asarray(0.5 * (1 - turn))

    def apply(self, samples: ComplexArray, radar: Radar) -> ComplexArray:
        """(chirp, tx, rx, sample) out of the mixer."""
        direct, image = self.coefficients(radar)
        return np.asarray(direct[:, None] * samples + image[:, None] * np.conj(samples))

    def check(self, radar: Radar) -> None:
        """Raise if lists are not for the Rx elements of `radar`."""
        self.coefficients(radar)


@dataclass(frozen=True)
class DcOffset:
    """A constant voltage in I and Q of each receiver."""

    level_dbm: float | tuple[float, ...]
    """Its power I^2 + Q^2, referred to the receiver input [dBm]; one number, or one for each Rx element."""
    phase_deg: float | tuple[float, ...] | None = None
    """Angle of (I, Q) [degrees]; one number, or one for each Rx element; None draws one for each, which it keeps."""

    def __post_init__(self) -> None:
        level = number_or_numbers("dc_offset.level_dbm", self.level_dbm, -250, 60, "dBm")
        object.__setattr__(self, "level_dbm", level)
        if self.phase_deg is not None:
            phase = number_or_numbers("dc_offset.phase_deg", self.phase_deg, -360, 360, "degrees")
            object.__setattr__(self, "phase_deg", phase)

    def offsets(self, radar: Radar, seed: int) -> ComplexArray:
        """(rx,) [sqrt(W)]"""
        level = per_element("dc_offset.level_dbm", self.level_dbm, radar.rx_names)
        if self.phase_deg is None:
            phase = device_stream(seed, "dc_offset", radar).uniform(0, 2 * math.pi, len(radar.rx_names))
        else:
            phase = np.radians(per_element("dc_offset.phase_deg", self.phase_deg, radar.rx_names))
        return np.asarray(10.0 ** ((level - 30) / 20) * np.exp(1j * phase))

    def check(self, radar: Radar) -> None:
        """Raise if lists are not for the Rx elements of `radar`."""
        self.offsets(radar, 0)
