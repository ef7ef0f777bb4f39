"""Materials with a thickness, and their transmission.

A surface of a material with a thickness is a slab without extent. A wave crosses it straight, times
(ITU-R P.2040, eq. 43)

    T = (1 - r^2) exp(-j q) / (1 - r^2 exp(-2 j q)),   q = k d sqrt(eps mu - sin^2)

with Fresnel's r of one face, per polarisation. The path keeps its length. The delay of the bulk,
d sqrt(Re eps mu - sin^2) / c at the middle of the band, is part of the delay; the rest of the phase is the gain's.
"""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np

from rfgen_sionna._types import SPEED_OF_LIGHT, ComplexArray, FloatArray
from rfgen_sionna.scene.materials import Material
from rfgen_sionna.tracing.integral.obliquity import MAX_FRINGE

MIN_LATE_REFLECTION = 0.02
"""Return of a slab's back face over its front's, above which a warning reports that it is omitted."""
_LOG = logging.getLogger(__name__)


@dataclass(frozen=True)
class SlabTable:
    """Materials with a thickness."""

    materials: tuple[Material, ...]
    thickness: FloatArray
    """(material,) [m]; 0 for opaque materials."""
    index2: FloatArray
    """(material,) squared refractive index for the delay of the bulk."""
    internal_reflections: FloatArray
    """(material,) 1 where reflections between the faces are part of the return, 0 where the band resolves them."""

    @staticmethod
    def of(materials: Sequence[Material], centre: float, half_band: float) -> SlabTable:
        """Table for a band of `half_band` [Hz] to both sides of `centre` [Hz]."""
        count = len(materials)
        thickness, index2, internal_reflections = np.zeros(count), np.ones(count), np.ones(count)
        for number, material in enumerate(materials):
            square = complex(material.relative_permittivity(centre)) * complex(material.permeability)
            if material.thickness is None or not np.isfinite(square):
                continue
            thickness[number], index2[number] = material.thickness, max(square.real, 1.0)
            fringe = 4 * np.pi * half_band / SPEED_OF_LIGHT * abs(square) ** 0.5 * material.thickness
            internal_reflections[number] = float(fringe <= MAX_FRINGE)
        return SlabTable(tuple(materials), thickness, index2, internal_reflections)

    @property
    def round_trip_lengths(self) -> FloatArray:
        """(material,) excess path of the first reflection between the faces at normal incidence [m]."""
        return np.asarray(2.0 * self.internal_reflections * np.sqrt(self.index2) * self.thickness)

    def strength(self, frequency: float) -> FloatArray:
        """(material,) |T| at normal incidence at a `frequency` [Hz]; 0 for opaque materials."""
        found = np.zeros(len(self.materials))
        for number, material in enumerate(self.materials):
            eps = complex(material.relative_permittivity(frequency))
            if material.thickness is None or not np.isfinite(eps):
                continue
            given = eps, complex(material.permeability), material.thickness, np.ones(1), frequency
            found[number] = float(np.abs(transmission(*given, self.internal_reflections[number])[0][0]))
        return found


def face_reflection(eps: complex, mu: complex, cos: FloatArray) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
    """(...) sqrt(eps mu - sin^2) and Fresnel's r_s, r_p of one face, for cosines `cos` (...) of incidence."""
    root = np.sqrt(eps * mu - (1.0 - cos**2) + 0j)
    root = np.where(root.imag > 0, -root, root)
    cos = np.maximum(cos, 1e-9)
    return root, (mu * cos - root) / (mu * cos + root), (eps * cos - root) / (eps * cos + root)


def transmission(
    eps: complex, mu: complex, thickness: float, cos: FloatArray, frequency: float, internal_reflections: float = 1.0
) -> tuple[ComplexArray, ComplexArray]:
    """(...) T of s and p polarisation for cosines `cos` (...) of incidence; `thickness` in m, `frequency` in Hz.
    `internal_reflections` is 1 with reflections between the faces, 0 without. ITU-R P.2040, eq. 43."""
    root, *faces = face_reflection(eps, mu, cos)
    once = np.exp(-2j * np.pi * frequency / SPEED_OF_LIGHT * thickness * root)
    t_s, t_p = ((1.0 - r * r) * once / (1.0 - internal_reflections * r * r * once * once) for r in faces)
    return t_s, t_p


def warn_of_late_reflections(materials: Sequence[Material], centre: float, half_band: float) -> None:
    """Log a warning, once per process, for slabs whose omitted back face returns more than `MIN_LATE_REFLECTION` of the
    front's return at normal incidence; transmission lacks |r|^2 times as much."""
    for number in np.flatnonzero(SlabTable.of(materials, centre, half_band).internal_reflections == 0).tolist():
        material = materials[number]
        eps, mu = complex(material.relative_permittivity(centre)), complex(material.permeability)
        root = np.sqrt(eps * mu)
        r = (mu - root) / (mu + root)
        decay = abs(root.imag) * 4 * np.pi * centre / SPEED_OF_LIGHT * (material.thickness or 0.0)
        share = float(abs(1.0 - r * r) * np.exp(-decay)) if abs(r) > 1e-6 else 0.0  # air reflects nothing
        if share > MIN_LATE_REFLECTION:
            _warn_once(material.name, f"{1e3 * (material.thickness or 0.0):.3g}", round(100 * share))


@cache
def _warn_once(name: str, millimetres: str, percent: int) -> None:
    _LOG.warning(
        "material %s, thickness %s mm: the band resolves the back face, whose return of up to %d %% of the front's is "
        "omitted; reduce the bandwidth or the thickness to include it", name, millimetres, percent,
    )  # fmt: skip
