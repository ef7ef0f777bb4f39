"""Errors of channels: coupling of Rx antennas, gain and phase mismatch, IQ imbalance, DC offset."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from rfgen_sionna._short_repr import ShortRepr
from rfgen_sionna._types import ComplexArray, FloatArray
from rfgen_sionna.radar import Radar
from rfgen_sionna.signal.noise import device_stream
from rfgen_sionna.signal.receiver.value_checks import check_number, number_or_numbers, per_element

Matrix = tuple[tuple[complex, ...], ...]


@dataclass(frozen=True, repr=False)
class Coupling(ShortRepr):
    """Mutual coupling of the Rx antennas: port r has sum_q matrix[r][q] times the own signal of port q.

    Coupling of the Tx antennas is not modelled.
    """

    matrix: Matrix
    """(rx, rx) voltage ratios, with ones on the diagonal for an unchanged own signal."""

    def __post_init__(self) -> None:
        try:
            array = np.array(self.matrix, dtype=np.complex128)
        except (TypeError, ValueError):
            array = np.empty(0, dtype=np.complex128)
        if array.ndim != 2 or array.shape[0] != array.shape[1] or not np.all(np.isfinite(array)):
            raise ValueError(f"coupling.matrix is {self.matrix!r}: a square matrix of finite numbers is needed")
        object.__setattr__(self, "matrix", tuple(tuple(complex(value) for value in row) for row in array))

    @classmethod
    def of_neighbours(cls, radar: Radar, level_db: float, phase_deg: float = 0.0) -> Coupling:
        """Coupling by distance d: `level_db` and `phase_deg` at half a wavelength, a level with 1/d and the phase of d.

        Elements more than three wavelengths apart have no coupling. Phases of feeds turn that of the patches.
        """
        check_number("coupling.level_db", level_db, -200, 0, "dB")
        check_number("coupling.phase_deg", phase_deg, -360, 360, "degrees")
        half = radar.wavelength / 2
        gap = np.linalg.norm(radar.rx_positions[:, None] - radar.rx_positions[None], axis=-1)
        gap[np.diag_indices(len(gap))] = np.inf
        phase = math.radians(phase_deg) - math.pi * np.where(np.isinf(gap), 0.0, gap / half - 1)
        matrix = 10.0 ** (level_db / 20) * half / gap * np.exp(1j * phase) * (gap <= 6 * half * (1 + 1e-9))
        feeds = np.conj(radar.feed_factors[1])
        matrix = matrix * feeds[:, None] * np.conj(feeds)
        return cls(tuple(map(tuple, matrix + np.eye(len(gap)))))

    def apply(self, samples: ComplexArray) -> ComplexArray:
        """Coupled (chirp, tx, rx, sample)."""
        return np.asarray(np.matmul(np.array(self.matrix), samples))

    def check(self, radar: Radar) -> None:
        """Raise if the size of the matrix is not the number of Rx elements of `radar`."""
        size, count = len(self.matrix), len(radar.rx_names)
        if size != count:
            raise ValueError(f"coupling.matrix is {size} x {size}; radar '{radar.name}' has {count} Rx elements")


@dataclass(frozen=True, repr=False)
class Mismatch(ShortRepr):
    """Gain and phase of the Tx and Rx chains: given values plus normal draws, constant over all frames.

    The gain of a channel is the product of those of its Tx and Rx element.
    """

    tx_gain_db: float | tuple[float, ...] = 0.0
    """[dB]; one number for all Tx elements, or one for each in the order of `radar.tx_names`."""
    tx_phase_deg: float | tuple[float, ...] = 0.0
    rx_gain_db: float | tuple[float, ...] = 0.0
    rx_phase_deg: float | tuple[float, ...] = 0.0
    gain_spread_db: float = 0.0
    """Standard deviation of the gain drawn for each element [dB]."""
    phase_spread_deg: float = 0.0
    """Standard deviation of the phase drawn for each element [degrees]."""

    def __post_init__(self) -> None:
        for name, limit, unit in (("gain_db", 100, "dB"), ("phase_deg", 3600, "degrees")):
            for side in ("tx", "rx"):
                field = f"{side}_{name}"
                value = number_or_numbers(f"mismatch.{field}", getattr(self, field), -limit, limit, unit)
                object.__setattr__(self, field, value)
        check_number("mismatch.gain_spread_db", self.gain_spread_db, 0, 20, "dB")
        check_number("mismatch.phase_spread_deg", self.phase_spread_deg, 0, 360, "degrees")

    def factors(self, radar: Radar, seed: int) -> tuple[ComplexArray, ComplexArray]:
        """(tx,) and (rx,) voltage gains."""
        rng = device_stream(seed, "mismatch", radar)
        factors: list[Any] = []
        for side in ("tx", "rx"):
            names = getattr(radar, f"{side}_names")
            drawn = rng.standard_normal((len(names), 2)) * [self.gain_spread_db, self.phase_spread_deg]
            gain = per_element(f"mismatch.{side}_gain_db", getattr(self, f"{side}_gain_db"), names) + drawn[:, 0]
            phase = per_element(f"mismatch.{side}_phase_deg", getattr(self, f"{side}_phase_deg"), names) + drawn[:, 1]
            factors.append(10.0 ** (gain / 20) * np.exp(1j * np.radians(phase)))
        return factors[0], factors[1]

    def check(self, radar: Radar) -> None:
        """Raise if lists have not one value for each element of `radar`."""
        self.factors(radar, 0)


@dataclass(frozen=True)
class IqImbalance:
    """Gain and quadrature error of Q: I' = I, Q' = g (Q cos p - I sin p).

    x' = K1 x + K2 conj(x) with K1 = (1 + g exp(-jp)) / 2 and K2 = (1 - g exp(jp)) / 2: the image of a tone is at minus
    its frequency.
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
        """(chirp, tx, rx, sample) after the mixer."""
        direct, image = self.coefficients(radar)
        return np.asarray(direct[:, None] * samples + image[:, None] * np.conj(samples))

    def check(self, radar: Radar) -> None:
        """Raise if lists have not one value for each Rx element of `radar`, or it has no Q."""
        if radar.adc.real:
            raise ValueError(
                f"receiver.iq_imbalance: radar '{radar.name}' has one mixer and converter for each Rx element "
                "(adc.real), thus no Q; leave iq_imbalance out"
            )
        self.coefficients(radar)


@dataclass(frozen=True)
class DcOffset:
    """A constant voltage in I and Q of each receiver, or in the one real signal."""

    level_dbm: float | tuple[float, ...]
    """Power I^2 + Q^2, or the square of a real signal, at the receiver input [dBm]; one number, or one for each Rx
    element."""
    phase_deg: float | tuple[float, ...] | None = None
    """Angle of (I, Q) [degrees], 0 or 180 for a real signal; one number, or one for each Rx element. None draws one for
    each, for all frames."""

    def __post_init__(self) -> None:
        level = number_or_numbers("dc_offset.level_dbm", self.level_dbm, -250, 60, "dBm")
        object.__setattr__(self, "level_dbm", level)
        if self.phase_deg is not None:
            phase = number_or_numbers("dc_offset.phase_deg", self.phase_deg, -360, 360, "degrees")
            object.__setattr__(self, "phase_deg", phase)

    def offsets(self, radar: Radar, seed: int) -> ComplexArray | FloatArray:
        """(rx,) [sqrt(W)], real ones for a real ADC."""
        level = per_element("dc_offset.level_dbm", self.level_dbm, radar.rx_names)
        if self.phase_deg is None:
            phase = device_stream(seed, "dc_offset", radar).uniform(0, 2 * math.pi, len(radar.rx_names))
        else:
            degrees = per_element("dc_offset.phase_deg", self.phase_deg, radar.rx_names)
            if radar.adc.real and np.any(degrees % 180):
                raise ValueError(
                    f"dc_offset.phase_deg is {self.phase_deg!r}: radar '{radar.name}' has real samples (adc.real), "
                    "whose offset has a phase of 0 or 180 degrees"
                )
            phase = np.radians(degrees)
        size = 10.0 ** ((level - 30) / 20)
        return size * np.where(np.cos(phase) < 0, -1.0, 1.0) if radar.adc.real else size * np.exp(1j * phase)

    def check(self, radar: Radar) -> None:
        """Raise if lists have not one value for each Rx element of `radar`."""
        self.offsets(radar, 0)
