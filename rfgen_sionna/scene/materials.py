"""Materials at radar frequencies: permittivity, permeability, thickness, roughness, source, frequency ranges.

`outside` is the policy at frequencies that a source does not cover: "extrapolate" (with a warning), "clamp"
(permittivity and conductivity of the nearest covered frequency) or "raise". New materials go into `material_table.py`.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import get_args

import numpy as np
from numpy.typing import ArrayLike
from scipy.constants import epsilon_0

from rfgen_sionna._types import ComplexArray, FloatArray
from rfgen_sionna.radar.profile import is_number
from rfgen_sionna.scene.earth_surface import EarthSurface
from rfgen_sionna.scene.material_table import TABLE
from rfgen_sionna.scene.material_words import canonical_name, suggested_material
from rfgen_sionna.scene.permittivity import Conductor, LossTangent, Outside, Permittivity, complex_permittivity
from rfgen_sionna.scene.scattering import LAMBERTIAN, ScatteringPattern
from rfgen_sionna.scene.scene_errors import MaterialError, MaterialRangeWarning


def _prefix(owner: str) -> str:
    return f"{owner}: " if owner else ""


def _check_policy(outside: str) -> None:
    if not isinstance(outside, str) or outside not in get_args(Outside):
        raise MaterialError(f"outside: {outside!r} given, allowed are {', '.join(map(repr, get_args(Outside)))}")


def _frequencies(frequency: ArrayLike) -> FloatArray:
    values = np.asarray(frequency, np.float64)
    if not (np.isfinite(values) & (values > 0.0)).all():
        raise ValueError(f"frequency: {frequency!r} given, positive finite values [Hz] are needed")
    return values


@dataclass(frozen=True)
class Material:
    """Material of a surface.

    Raises:
        MaterialError: a field is out of range; the message names field, value and allowed range.
    """

    name: str
    model: Permittivity
    """Permittivity and conductivity over frequency."""
    source: str
    thickness: float | None = None
    """Thickness of the slab behind the surface [m]; None takes a half-space, of which only the front reflects."""
    scattering_coefficient: float = 0.0
    """Diffuse share S of the reflected field, 0 … 1 (Sionna's definition): S² of the energy."""
    scattering_pattern: ScatteringPattern = LAMBERTIAN
    """Pattern of the diffuse part."""
    xpd_coefficient: float = 0.0
    """Share of the diffuse energy in the other polarisation, 0 … 1 (Sionna's definition)."""
    permeability: complex = 1.0
    """Relative permeability; 1 for all materials of the table."""
    outside: Outside = "extrapolate"
    """Policy at frequencies that the source does not cover."""

    def __post_init__(self) -> None:
        if not isinstance(self.name, str):
            raise MaterialError(f"material: name {self.name!r}, a text is needed")
        what = f"material {self.name!r}"
        _check_policy(self.outside)
        if not isinstance(self.model, Permittivity):
            raise MaterialError(f"{what}: model {self.model!r}, one of rfgen_sionna.scene.permittivity is needed")
        if self.thickness is not None and not (is_number(self.thickness) and self.thickness >= 0.0):
            raise MaterialError(
                f"{what}: thickness {self.thickness!r} m, a finite one that is not negative is needed, or None"
            )
        for field in ("scattering_coefficient", "xpd_coefficient"):
            share = getattr(self, field)
            if not (is_number(share) and 0.0 <= share <= 1.0):
                raise MaterialError(f"{what}: {field} {share!r}, allowed are 0 … 1")
        if not isinstance(self.scattering_pattern, ScatteringPattern):
            raise MaterialError(
                f"{what}: scattering_pattern {self.scattering_pattern!r}, a ScatteringPattern is needed, such as "
                "ScatteringPattern('lambertian')"
            )
        mu = self.permeability
        number = isinstance(mu, (int, float, complex, np.number)) and not isinstance(mu, bool)
        if not (number and np.isfinite(mu) and mu.real > 0 and mu.imag <= 0):
            raise MaterialError(
                f"{what}: permeability {mu!r}, a finite number with a real part above 0 and an imaginary part of at "
                "most 0 (loss) is needed"
            )

    def covers(self, frequency: float) -> bool:
        """Whether the source covers `frequency` [Hz]."""
        return any(low <= frequency <= high for low, high in self.model.ranges)

    def relative_permittivity(self, frequency: ArrayLike) -> ComplexArray:
        """Complex relative permittivity eps' - j sigma / (2 pi f eps_0), shaped as `frequency` [Hz].

        Raises:
            MaterialError: the policy is "raise" and a frequency is not covered.
            ValueError: a frequency is not positive and finite.
        """
        values = _frequencies(frequency)
        if self.outside == "raise":
            self.check(values)
        found = complex_permittivity(self.model, values, self.outside)
        if (wrong := np.isnan(found) | np.isneginf(found.real) | (found.imag > 0)).any():
            raise MaterialError(
                f"material {self.name!r}: permittivity {found[wrong][0]} at {values[wrong][0]:g} Hz, a number with an "
                "imaginary part of at most 0 (loss) is needed"
            )
        # Products of large finite values must not overflow.
        most = np.finfo(np.float64).max ** 0.1
        large = np.isfinite(found) & (np.abs(found.real) + np.abs(found.imag) > most)
        return np.where(large, np.clip(found.real, -most, most) + 1j * np.clip(found.imag, -most, 0.0), found)

    def relative_permeability(self, frequency: ArrayLike) -> ComplexArray:
        """Complex relative permeability, shaped as `frequency` [Hz]."""
        return np.full(_frequencies(frequency).shape, self.permeability, np.complex128)

    def conductivity(self, frequency: ArrayLike) -> FloatArray:
        """Effective conductivity [S/m], all losses counted, shaped as `frequency` [Hz]."""
        values = _frequencies(frequency)
        return np.asarray(-self.relative_permittivity(values).imag * 2.0 * np.pi * values * epsilon_0)

    def check(self, frequency: ArrayLike, owner: str = "") -> None:
        """Raise :class:`MaterialError` at a frequency [Hz] that is not covered; `owner` names the object."""
        for value in _frequencies(frequency).ravel():
            if not self.covers(float(value)):
                others = sorted(name for name, each in MATERIALS.items() if each.covers(float(value)))
                raise MaterialError(
                    f"{_prefix(owner)}material {self.name!r} is not defined at {value / 1e9:g} GHz, its source covers "
                    f'{self.describe_ranges()}; take material({self.name!r}, outside="extrapolate") or "clamp", of '
                    f"rfgen_sionna.scene, or another material: {', '.join(others)} are defined there"
                )

    def describe_ranges(self) -> str:
        """Covered frequencies as text."""
        return ", ".join(f"{low / 1e9:g}-{high / 1e9:g} GHz" for low, high in self.model.ranges)


MATERIALS: Mapping[str, Material] = MappingProxyType(
    {name: Material(name, model, source) for name, (model, source) in TABLE.items()}
)
"""All materials by name; :func:`material` also takes aliases ("steel") and Sionna's prefixes ("itu_metal")."""


def material(
    name: str,
    frequency: float | None = None,
    outside: Outside = "extrapolate",
    owner: str = "",
    *,
    permittivity: float | complex | None = None,
    conductivity: float | None = None,
    loss_tangent: float | None = None,
    temperature: float | None = None,
    thickness: float | None = None,
    scattering_coefficient: float = 0.0,
    source: str = "given by the user",
) -> Material:
    """A material of the table, or an own one of a constant permittivity.

    `material("water", temperature=37)` and `material("glass", thickness=0.004)` are materials of the table,
    `material("my_resin", permittivity=2.9, loss_tangent=0.02)` is an own one.

    Args:
        name: a name or alias, with or without Sionna's prefixes; any name with a `permittivity`.
        frequency: frequency [Hz] to check against the source; None checks nothing.
        outside: policy at frequencies that the source does not cover: "raise" is an error, others warn.
        owner: object of the material, for messages.
        permittivity: relative permittivity of an own material; a complex one, eps' - j eps'', has its loss tangent.
        conductivity: conductivity of an own material [S/m].
        loss_tangent: eps'' / eps' of an own material, instead of a conductivity.
        temperature: temperature of water, ice, snow or soil [°C]; None is that of the source's text.
        thickness: thickness of the slab behind the surface [m]; None is a half-space.
        scattering_coefficient: diffuse share of the reflected field, 0 … 1, of rough surfaces.
        source: source of an own material.

    Raises:
        MaterialError: unknown name or policy, a value out of range, or a `frequency` that is not covered, with "raise".
        TypeError: `name` is no text.
    """
    _check_policy(outside)
    if not isinstance(name, str):
        raise TypeError(f"{_prefix(owner)}material: {name!r} given, the name of a material is needed; {choices()}")
    if permittivity is not None:
        model = _own_model(f"{_prefix(owner)}material {name!r}", permittivity, conductivity, loss_tangent)
        if temperature is not None:
            raise MaterialError(f"{_prefix(owner)}material {name!r}: its permittivity is given, leave temperature out")
        return Material(name, model, source, thickness, scattering_coefficient, outside=outside)
    if conductivity is not None or loss_tangent is not None:
        raise MaterialError(f"{_prefix(owner)}material {name!r}: permittivity is needed, too, 1 for a metal")
    key = canonical_name(name)
    if key not in MATERIALS:
        close = suggested_material(name)
        hint = f", did you mean {close!r}?" if close else ""
        shown = "no material given" if not name.strip() else f"unknown material {name!r}{hint}"
        raise MaterialError(f"{_prefix(owner)}{shown}; {choices()}")
    found = replace(MATERIALS[key], outside=outside)
    if thickness is not None or scattering_coefficient:
        found = replace(found, thickness=thickness, scattering_coefficient=scattering_coefficient)
    if temperature is not None:
        if not isinstance(found.model, EarthSurface):
            warm = ", ".join(other for other, each in MATERIALS.items() if isinstance(each.model, EarthSurface))
            raise MaterialError(f"{_prefix(owner)}material {name!r}: temperature has an effect on {warm} only")
        found = replace(found, model=replace(found.model, temperature=temperature))
    if frequency is not None and outside == "raise":
        found.check(frequency, owner)
    elif frequency is not None:
        warn_uncovered([found], float(frequency), stacklevel=2)
    return found


def _own_model(
    what: str, permittivity: float | complex, conductivity: float | None, loss_tangent: float | None
) -> Permittivity:
    """Model of a constant permittivity with a constant conductivity [S/m] or loss tangent."""
    if not isinstance(permittivity, (int, float, complex, np.number)):
        raise MaterialError(f"{what}: permittivity {permittivity!r}, one number is needed, such as 2.9 or 2.9-0.06j")
    eps = complex(permittivity)
    if sum((eps.imag != 0.0, conductivity is not None, loss_tangent is not None)) > 1:
        raise MaterialError(f"{what}: give its loss once: a complex permittivity, conductivity or loss_tangent")
    if not (np.isfinite(eps) and eps.real > 0.0 and eps.imag <= 0.0):
        raise MaterialError(
            f"{what}: permittivity {permittivity!r}, a real part above 0 and an imaginary part of at most 0 is needed"
        )
    for name, value in (("conductivity", conductivity), ("loss_tangent", loss_tangent)):
        if value is not None and not (is_number(value) and value >= 0.0):
            raise MaterialError(f"{what}: {name} {value!r}, a finite number that is not negative is needed")
    everywhere = ((0.0, float("inf")),)
    if conductivity is not None:
        return Conductor(eps.real, float(conductivity), everywhere)
    return LossTangent(eps.real, -eps.imag / eps.real if loss_tangent is None else float(loss_tangent), everywhere)


def choices() -> str:
    """List of the materials and their ranges, and how to make others."""
    names = ", ".join(f"{name} ({each.describe_ranges()})" for name, each in sorted(MATERIALS.items()))
    own = "rfgen_sionna.material('my_resin', permittivity=2.9, loss_tangent=0.02) makes an own one"
    return f"{own}; known are {names}"


def warn_uncovered(materials: list[Material], frequency: float, stacklevel: int = 2) -> None:
    """Warn once of all `materials` whose sources do not cover a `frequency` [Hz]."""
    names = sorted({f"{m.name} ({m.describe_ranges()})" for m in materials if not m.covers(frequency)})
    if names:
        how = "clamped" if all(m.outside == "clamp" for m in materials) else "extrapolated"
        warnings.warn(
            f"materials {how} to {frequency / 1e9:g} GHz, their sources cover less: {', '.join(names)}",
            MaterialRangeWarning,
            stacklevel=stacklevel + 1,
        )
