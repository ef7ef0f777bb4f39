"""Differences between channels: mutual coupling of the Rx antennas, gain and phase of the elements' chains."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from rfgen_sionna._types import ComplexArray
from rfgen_sionna.radar import Radar
from rfgen_sionna.signal.random_streams import device_stream
from rfgen_sionna.signal.receiver.value_checks import check_number, number_or_numbers, per_element

Matrix = tuple[tuple[complex, ...], ...]


@dataclass(frozen=True)
class Coupling:
    """Mutual coupling of the Rx antennas: port r receives sum_q matrix[r][q] times the field at element q.

    Tx antennas couple as well, but what a neighbour radiates in a slot is not in any sample: it fires at another time.
    """

    matrix: Matrix
    """(rx, rx) voltage ratios; ones on the diagonal leave an element's own signal as it is."""

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
        """Coupling that falls with distance: `level_db` at half a wavelength, 1/distance and its phase beyond.

        `phase_deg` is the phase at half a wavelength; there is none between elements that are apart by more than three
        wavelengths.
        """
        check_number("coupling.level_db", level_db, -200, 0, "dB")
        check_number("coupling.phase_deg", phase_deg, -360, 360, "degrees")
        half = radar.wavelength / 2
        gap = np.linalg.norm(radar.rx_positions[:, None] - radar.rx_positions[None], axis=-1)
        gap[np.diag_indices(len(gap))] = np.inf
        phase = math.radians(phase_deg) - math.pi * np.where(np.isinf(gap), 0.0, gap / half - 1)
        matrix = 10.0 ** (level_db / 20) * half / gap * np.exp(1j * phase) * (gap <= 6 * half * (1 + 1e-9))
        return cls(tuple(map(tuple, matrix + np.eye(len(gap)))))

    def apply(self, samples: ComplexArray) -> ComplexArray:
        """Coupled (chirp, tx, rx, sample)."""
        return np.asarray(np.matmul(np.array(self.matrix), samples))

    def check(self, radar: Radar) -> None:
        """Raise if the matrix is not for the Rx elements of `radar`."""
        if len(self.matrix) != len(radar.rx_names):
            raise ValueError(
                f"coupling.matrix is {len(self.matrix)} x {len(self.matrix)}; radar '{radar.name}' has "
                f"{len(radar.rx_names)} Rx elements"
            )


@dataclass(frozen=True)
class Mismatch:
    """Gain and phase of the chains of the Tx and the Rx elements, given, drawn, or drawn about what is given.

    A channel gets the sum of its Tx and its Rx element. Draws are normal; the device keeps them from frame to frame.
    """

    tx_gain_db: float | tuple[float, ...] = 0.0
    """[dB]; one number for all Tx elements or one for each, in the order of `radar.tx_names`."""
    tx_phase_deg: float | tuple[float, ...] = 0.0
    rx_gain_db: float | tuple[float, ...] = 0.0
    rx_phase_deg: float | tuple[float, ...] = 0.0
    gain_spread_db: float = 0.0
    """Standard deviation of what is drawn for each element [dB]."""
    phase_spread_deg: float = 0.0
    """Standard deviation of what is drawn for each element [degrees]."""

    def __post_init__(self) -> None:
        for name, limit, unit in (("gain_db", 100, "dB"), ("phase_deg", 3600, "degrees")):
            for side in ("tx", "rx"):
                value = getattr(self, f"{side}_{name}")
                object.__setattr__(
                    self,
                    f"{side}_{name}",
                    number_or_numbers(f"mismatch.{side}_{name}", value, -limit, limit, unit),
                )
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
        """Raise if lists are not for the elements of `radar`."""
        self.factors(radar, 0)
