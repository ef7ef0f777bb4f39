"""Reflection of a field by surfaces, in NumPy: Fresnel coefficients of half-spaces and slabs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rfgen_sionna._types import SPEED_OF_LIGHT, ComplexArray, FloatArray, IntArray
from rfgen_sionna.scene.materials import Material
from rfgen_sionna.scene.mesh import lengths
from rfgen_sionna.tracing.integral.obliquity import Media
from rfgen_sionna.tracing.integral.slabs import SlabTable


@dataclass(frozen=True)
class SurfaceOptics:
    """Materials of all surfaces for the band `centre` ± `half_band` [Hz]."""

    materials: tuple[Material, ...]
    centre: float
    half_band: float
    table: SlabTable

    @staticmethod
    def of(materials: Sequence[Material], centre: float, half_band: float) -> SurfaceOptics:
        return SurfaceOptics(tuple(materials), centre, half_band, SlabTable.of(materials, centre, half_band))

    def reflection(self, of: IntArray, cos: FloatArray, frequency: float) -> tuple[ComplexArray, ComplexArray]:
        """r_s and r_p of the coherent field at cosine of incidence `cos` (lane,) on material `of` (lane,), at
        `frequency` [Hz].

        Conductors have -1 and 1. A slab's internal reflections are included where the band does not resolve them; rough
        surfaces keep sqrt(1 - S^2).
        """
        media = Media.at(self.materials, np.array([frequency]), self.half_band)
        r_s, r_p = np.full(len(of), -1.0 + 0j), np.full(len(of), 1.0 + 0j)
        for number in np.unique(of):
            eps, mu = complex(media.permittivity[0, number]), complex(media.permeability[0, number])
            lane = np.flatnonzero(of == number)
            if np.isfinite(eps):
                c = np.maximum(cos[lane], 1e-9)
                root = np.sqrt(eps * mu - (1.0 - c**2) + 0j)
                root = np.where(root.imag > 0, -root, root)
                trip = 0.0
                if np.isfinite(media.thickness[number]):
                    electric = 2 * np.pi * frequency / SPEED_OF_LIGHT * media.thickness[number]
                    trip = np.exp(-2j * electric * root)
                for found, face in ((r_s, mu), (r_p, eps)):
                    r = (face * c - root) / (face * c + root)
                    below = 1.0 - r * r * trip
                    found[lane] = np.where(
                        np.abs(below) < 1e-12, 0.0, r * (1.0 - trip) / np.where(below == 0, 1, below)
                    )
            r_s[lane] *= media.smoothness[number]
            r_p[lane] *= media.smoothness[number]
        return r_s, r_p


def polarisation_bases(k: FloatArray, normal: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Cosine of incidence (lane,) of unit vectors `k` on the `normal`, and unit vectors s and p (lane, 3) across and in
    the plane of incidence, p = s x k."""
    cos = np.clip(np.abs(np.einsum("li,li->l", k, normal)), 0.0, 1.0)
    s = np.cross(k, normal)
    size = lengths(s)
    # At normal incidence the plane of incidence is free.
    spare = np.cross(np.where(np.abs(normal[:, :1]) < 0.6, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]]), normal)
    s = np.where((size > 1e-9)[:, None], s, spare)
    s /= np.maximum(lengths(s), 1e-300)[:, None]
    return cos, s, np.cross(s, k)


def reflected_direction(k: FloatArray, normal: FloatArray) -> FloatArray:
    """Directions (lane, 3) after reflection of `k` (lane, 3) at `normal` (lane, 3)."""
    return np.asarray(k - 2.0 * np.einsum("li,li->l", k, normal)[:, None] * normal)


def reflected(
    field: ComplexArray, k: FloatArray, normal: FloatArray, r_s: ComplexArray, r_p: ComplexArray
) -> tuple[ComplexArray, FloatArray]:
    """Field and direction (lane, 3) after reflection of a plane wave with coefficients `r_s`, `r_p` (lane,)."""
    _, s, p = polarisation_bases(k, normal)
    after = reflected_direction(k, normal)
    along_s, along_p = np.einsum("li,li->l", field, s), np.einsum("li,li->l", field, p)
    return (r_s * along_s)[:, None] * s + (r_p * along_p)[:, None] * np.cross(s, after), after
