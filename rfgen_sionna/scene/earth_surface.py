"""Permittivity of water, ice, snow and soil by ITU-R P.527-6 (09/2021), 1 to 1000 GHz.

Its permittivities are eps' - j eps'', frequencies in its formulas are in GHz and temperatures in degrees Celsius.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from scipy.constants import epsilon_0

from rfgen_sionna.radar.profile import is_number
from rfgen_sionna.scene.permittivity import Outside, Range
from rfgen_sionna.scene.scene_errors import MaterialError

ICE_DENSITY = 0.916
"""Density of ice [g/cm³]."""


@dataclass(frozen=True)
class EarthSurface(ABC):
    """A model of P.527 at a temperature; a :class:`~rfgen_sionna.scene.permittivity.Permittivity`.

    Raises:
        MaterialError: the temperature is out of range.
    """

    temperature: float = 20.0
    """[°C]."""
    allowed: ClassVar[tuple[float, float]] = (-4.0, 40.0)
    """Temperatures [°C] of the formulas."""

    def __post_init__(self) -> None:
        low, high = self.allowed
        if not (is_number(self.temperature) and low <= self.temperature <= high):
            raise MaterialError(f"temperature: {self.temperature!r} °C given, allowed are {low:g} … {high:g} °C")

    @property
    def ranges(self) -> tuple[Range, ...]:
        """Frequencies [Hz] of the formulas."""
        return ((1e9, 1000e9),)

    @abstractmethod
    def permittivity(self, ghz: float) -> complex:
        """Complex relative permittivity at a frequency [GHz]."""

    def evaluate(self, frequency: float, outside: Outside) -> tuple[float, float]:
        if outside == "clamp":
            frequency = min(max(frequency, self.ranges[0][0]), self.ranges[0][1])
        eps = self.permittivity(frequency / 1e9)
        return eps.real, -eps.imag * 2.0 * np.pi * frequency * epsilon_0


@dataclass(frozen=True)
class Water(EarthSurface):
    """Pure and sea water: two Debye relaxations (section 5.1.1 and 5.1.2)."""

    salinity: float = 0.0
    """Salt [g/kg], 0 … 40; 35 in the ocean."""

    def permittivity(self, ghz: float) -> complex:
        t, s = self.temperature, self.salinity
        theta = 300.0 / (t + 273.15) - 1.0
        static = 77.66 + 103.3 * theta
        middle, high = 0.0671 * static, 3.52 - 7.52 * theta
        first = 20.20 - 146.4 * theta + 316.0 * theta**2
        second = 39.8 * first
        if s:
            static *= np.exp(-3.33330e-3 * s + 4.74868e-6 * s**2)
            first *= 1.0 + s * (2.3232e-3 - 7.9208e-5 * t + 3.6764e-6 * t**2 + 3.5594e-7 * t**3 + 8.9795e-9 * t**4)
            middle *= np.exp(-6.28908e-3 * s + 1.76032e-4 * s**2 - 9.22144e-5 * t * s)
            second *= 1.0 + s * (-1.99723e-2 + 1.81176e-4 * t)
            high *= 1.0 + s * (-2.04265e-3 + 1.57883e-4 * t)
        relaxed = (static - middle) / (1.0 + 1j * ghz / first) + (middle - high) / (1.0 + 1j * ghz / second)
        return complex(high + relaxed - 18j * self._conductivity() / ghz)

    def _conductivity(self) -> float:
        """Conductivity of the salt [S/m]."""
        t, s = self.temperature, self.salinity
        if not s:
            return 0.0
        ocean = 2.903602 + 8.607e-2 * t + 4.738817e-4 * t**2 - 2.991e-6 * t**3 + 4.3047e-9 * t**4
        at_15 = s * (37.5109 + 5.45216 * s + 1.4409e-2 * s**2) / (1004.75 + 182.283 * s + s**2)
        slope = (6.9431 + 3.2841 * s - 9.9486e-2 * s**2) / (84.850 + 69.024 * s + s**2)
        return ocean * at_15 * (1.0 + slope * (t - 15.0) / (49.843 - 0.2276 * s + 0.198e-2 * s**2 + t))


@dataclass(frozen=True)
class Ice(EarthSurface):
    """Pure ice (section 5.1.3.1)."""

    temperature: float = -10.0
    allowed: ClassVar[tuple[float, float]] = (-60.0, 0.0)

    def permittivity(self, ghz: float) -> complex:
        t = self.temperature
        theta, tau = 300.0 / (t + 273.15) - 1.0, 335.0 / (t + 273.15)
        low = (0.00504 + 0.0062 * theta) * np.exp(-22.1 * theta)
        high = 0.0207 / (t + 273.15) * np.exp(-tau) / (np.exp(-tau) - 1.0) ** 2
        high += 1.16e-11 * ghz**2 + np.exp(-9.963 + 0.0372 * t)
        return complex(3.1884 + 0.00091 * t, -(low / ghz + high * ghz))


@dataclass(frozen=True)
class Snow(EarthSurface):
    """Dry and wet snow (section 5.1.4), without scattering by the grains."""

    temperature: float = -10.0
    density: float = 0.3
    """Density of the dry snow [g/cm³]."""
    liquid: float = 0.0
    """Share of the volume that is liquid water."""
    allowed: ClassVar[tuple[float, float]] = (-60.0, 0.0)

    def permittivity(self, ghz: float) -> complex:
        ice, share = Ice(self.temperature).permittivity(ghz), self.density / ICE_DENSITY
        real = 1.0 + 1.9 * self.density if self.density <= 0.5 else 0.51 + 2.88 * self.density
        loss = 3.0 * -ice.imag * share * real**2 * (2.0 * real + 1.0)
        dry = complex(real, -loss / ((ice.real + 2.0 * real) * (ice.real + 2.0 * real**2)))
        if not self.liquid:
            return dry
        water = Water(max(self.temperature, 0.0)).permittivity(ghz)
        b = water - 2.0 * dry - 3.0 * self.liquid * (water - dry)
        return complex((-b + np.sqrt(b * b + 8.0 * water * dry)) / 4.0)


@dataclass(frozen=True)
class Soil(EarthSurface):
    """Soil of sand, clay and silt with water (section 5.2)."""

    moisture: float = 0.05
    """Share of the volume that is water."""
    sand: float = 30.63
    """Share of the mass [%]; the default is a silty loam."""
    clay: float = 13.48
    gravity: float = 2.66
    """Specific gravity of the grains."""

    def permittivity(self, ghz: float) -> complex:
        sand, clay, grains, moisture = self.sand, self.clay, self.gravity, self.moisture
        shares = ((0.078886, sand), (0.038753, clay), (0.032732, 100.0 - sand - clay))
        bulk = 1.07256 + sum(factor * np.log(share) for factor, share in shares if share >= 1.0)
        first = 0.0467 + 0.2204 * bulk - 0.004111 * sand - 0.006614 * clay
        second = -1.645 + 1.939 * bulk - 0.0225622 * sand + 0.01594 * clay
        turn = ghz / 1.35
        real = turn * (first - second) / (1.0 + turn**2)
        imaginary = second + (first - second) / (1.0 + turn**2)
        bound = 18.0 * (grains - bulk) / (ghz * grains * moisture)
        water = Water(self.temperature).permittivity(ghz)
        free, loss = water.real + bound * real, -water.imag + bound * imaginary
        solid = (1.01 + 0.44 * grains) ** 2 - 0.062
        alpha = 0.65
        mixed = 1.0 + bulk / grains * (solid**alpha - 1.0) - moisture
        mixed += moisture ** (1.2748 - 0.00519 * sand - 0.00152 * clay) * free**alpha
        lost = moisture ** (1.33797 - 0.00603 * sand - 0.00166 * clay) * loss**alpha
        return complex(mixed ** (1.0 / alpha), -(lost ** (1.0 / alpha)))
