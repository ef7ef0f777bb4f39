"""Transmission through slabs, in NumPy."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from rfgen_sionna._types import SPEED_OF_LIGHT, ComplexArray, FloatArray, IntArray
from rfgen_sionna.scene.materials import Material
from rfgen_sionna.tracing.curved.media import SurfaceOptics, polarisation_bases
from rfgen_sionna.tracing.integral.obliquity import Media
from rfgen_sionna.tracing.integral.slabs import SlabTable, transmission


class SlabOptics(SurfaceOptics):
    """Materials of all surfaces, slabs that are seen through among them."""

    @staticmethod
    def of(materials: Sequence[Material], centre: float, half_band: float) -> SlabOptics:
        return SlabOptics(tuple(materials), centre, half_band, SlabTable.of(materials, centre, half_band))

    def transmission(self, of: IntArray, cos: FloatArray, frequency: float) -> tuple[ComplexArray, ComplexArray]:
        """T_s and T_p of slabs `of` (lane,), without the phase of the bulk, which :meth:`bulk` holds as length."""
        t_s, t_p = np.zeros(len(of), np.complex128), np.zeros(len(of), np.complex128)
        back = np.exp(2j * np.pi * frequency / SPEED_OF_LIGHT * self.bulk(of, cos))
        for number in np.unique(of):
            material, lane = self.materials[number], np.flatnonzero(of == number)
            eps = complex(material.relative_permittivity(frequency))
            if material.thickness is not None and np.isfinite(eps):
                mu = complex(material.permeability)
                pair = transmission(
                    eps, mu, material.thickness, cos[lane], frequency, float(self.table.internal_reflections[number])
                )
                t_s[lane], t_p[lane] = pair[0] * back[lane], pair[1] * back[lane]
        return t_s, t_p

    def bulk(self, of: IntArray, cos: FloatArray) -> FloatArray:
        """(lane,) delay in slabs [m] at incidence `cos`."""
        root = np.sqrt(np.maximum(self.table.index2[of] - (1.0 - cos**2), 0.0))
        return np.asarray(self.table.thickness[of] * root)

    @property
    def smoothness(self) -> FloatArray:
        """(material,) share of the reflected field that stays coherent."""
        return np.asarray(Media.at(self.materials, np.array([self.centre]), self.half_band).smoothness)

    @property
    def penetrable(self) -> NDArray[np.bool_]:
        """(material,) which can be gone through."""
        finite = np.array([np.isfinite(complex(m.relative_permittivity(self.centre))) for m in self.materials])
        return np.asarray((self.table.thickness > 0) & finite)


def transmitted(
    field: ComplexArray, k: FloatArray, normal: FloatArray, t_s: ComplexArray, t_p: ComplexArray
) -> ComplexArray:
    """Field (lane, 3) behind a slab."""
    _, s, p = polarisation_bases(k, normal)
    along_s, along_p = np.einsum("li,li->l", field, s), np.einsum("li,li->l", field, p)
    return np.asarray((t_s * along_s)[:, None] * s + (t_p * along_p)[:, None] * p)
