"""Models of the complex permittivity over frequency, each with the frequency ranges of its source.

Sign: fields vary as exp(+j 2 pi f t), losses are a negative imaginary part: eps_r = eps' - j sigma / (2 pi f eps_0).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, Protocol, TypeAlias, runtime_checkable

import numpy as np
from scipy.constants import epsilon_0

from rfgen_sionna._types import ComplexArray, FloatArray

Outside: TypeAlias = Literal["extrapolate", "clamp", "raise"]
Range: TypeAlias = tuple[float, float]


@runtime_checkable
class Permittivity(Protocol):
    """Real part of the relative permittivity and conductivity over frequency."""

    @property
    def ranges(self) -> tuple[Range, ...]:
        """Frequencies [Hz] that the source covers."""

    def evaluate(self, frequency: float, outside: Outside) -> tuple[float, float]:
        """(eps', sigma [S/m]) at one frequency [Hz]; `outside` "raise" has been checked before."""


def complex_permittivity(model: Permittivity, frequencies: FloatArray, outside: Outside) -> ComplexArray:
    """Complex relative permittivity at each frequency [Hz], shaped as `frequencies`."""
    flat = [model.evaluate(float(f), outside) for f in frequencies.ravel()]
    real, sigma = np.array(flat).reshape(-1, 2).T.reshape(2, *frequencies.shape)
    found = np.empty(frequencies.shape, np.complex128)
    # Part by part: an infinite conductivity times 1j has a real part of NaN.
    found.real, found.imag = real, -sigma / (2.0 * np.pi * frequencies * epsilon_0)
    return found


def _nearest(ranges: tuple[Range, ...], frequency: float) -> tuple[int, float]:
    """Index of the range nearest to `frequency` in octaves, and its nearest frequency."""
    edges = [min(max(frequency, low), high) for low, high in ranges]
    best = int(np.argmin([abs(np.log(edge / frequency)) for edge in edges]))
    return best, edges[best]


@dataclass(frozen=True)
class PowerLaw:
    """eps' = a f^b and sigma = c f^d with f in GHz, piecewise (ITU-R P.2040, section 2.1.4 and table 3).

    The first of overlapping ranges counts. Extrapolation interpolates over a gap between two ranges (eps' and
    log sigma, linear in log f) and continues the nearest formula elsewhere.
    """

    segments: tuple[tuple[float, float, float, float, float, float], ...]
    """(lowest GHz, highest GHz, a, b, c, d) of each range."""

    @property
    def ranges(self) -> tuple[Range, ...]:
        return tuple((low * 1e9, high * 1e9) for low, high, *_ in self.segments)

    def evaluate(self, frequency: float, outside: Outside) -> tuple[float, float]:
        for i, (low, high) in enumerate(self.ranges):
            if low <= frequency <= high:
                return self._formula(i, frequency)
        index, edge = _nearest(self.ranges, frequency)
        if outside == "clamp":
            return self._formula(index, edge)
        below = [(high, i) for i, (_, high) in enumerate(self.ranges) if high < frequency]
        above = [(low, -i) for i, (low, _) in enumerate(self.ranges) if low > frequency]
        if not below or not above:
            return self._formula(index, frequency)
        low, i = max(below)
        high, j = min(above)
        weight = np.log(frequency / low) / np.log(high / low)
        (real_low, sigma_low), (real_high, sigma_high) = self._formula(i, low), self._formula(-j, high)
        sigma = np.exp((1.0 - weight) * np.log(sigma_low) + weight * np.log(sigma_high))
        return float((1.0 - weight) * real_low + weight * real_high), float(sigma)

    def _formula(self, index: int, frequency: float) -> tuple[float, float]:
        _, _, a, b, c, d = self.segments[index]
        ghz = frequency / 1e9
        return a * ghz**b, c * ghz**d


@dataclass(frozen=True)
class ColeCole:
    """Cole–Cole relaxations and a static conductivity (Gabriel, Lau and Gabriel 1996).

    eps = eps_inf + sum_n delta_n / (1 + (j w tau_n)^(1 - alpha_n)) + sigma / (j w eps_0). Extrapolation continues the
    formula.
    """

    eps_inf: float
    delta: tuple[float, ...]
    tau: tuple[float, ...]
    """Relaxation times [s]."""
    alpha: tuple[float, ...]
    sigma: float
    """Static conductivity [S/m]."""
    ranges: tuple[Range, ...] = ((10.0, 100e9),)

    def evaluate(self, frequency: float, outside: Outside) -> tuple[float, float]:
        if outside == "clamp":
            frequency = _nearest(self.ranges, frequency)[1]
        omega = 2.0 * np.pi * frequency
        eps = self.eps_inf + self.sigma / (1j * omega * epsilon_0)
        for delta, tau, alpha in zip(self.delta, self.tau, self.alpha, strict=True):
            eps += delta / (1.0 + (1j * omega * tau) ** (1.0 - alpha))
        return float(eps.real), float(-eps.imag * omega * epsilon_0)


@dataclass(frozen=True)
class LossTangent:
    """Constant eps' and loss tangent; "clamp" holds the conductivity of the nearest covered frequency."""

    real: float
    tangent: float
    ranges: tuple[Range, ...]

    def evaluate(self, frequency: float, outside: Outside) -> tuple[float, float]:
        at = _nearest(self.ranges, frequency)[1] if outside == "clamp" else frequency
        return self.real, self.real * self.tangent * 2.0 * np.pi * at * epsilon_0


@dataclass(frozen=True)
class Conductor:
    """Constant eps' and conductivity [S/m]."""

    real: float
    sigma: float
    ranges: tuple[Range, ...]

    def evaluate(self, frequency: float, outside: Outside) -> tuple[float, float]:
        return self.real, self.sigma


@dataclass(frozen=True)
class ComputedPermittivity:
    """Permittivity of a function, such as a user's own Sionna material; defined at any frequency."""

    function: Callable[[float], tuple[float, float]]
    """Frequency [Hz] to (eps', sigma [S/m])."""
    ranges: tuple[Range, ...] = ((0.0, float("inf")),)

    def evaluate(self, frequency: float, outside: Outside) -> tuple[float, float]:
        return self.function(frequency)
