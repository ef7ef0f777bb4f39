"""Transmission through slabs, in the kernel.

A surface of a material with a thickness is a slab without extent. A wave crosses it straight, times
(ITU-R P.2040, eq. 43)

    T = (1 - r^2) exp(-j q) / (1 - r^2 exp(-2 j q)),   q = k d sqrt(eps mu - sin^2)

with Fresnel's r of one face, per polarisation. The path keeps its length. The delay of the bulk,
d sqrt(Re eps mu - sin^2) / c at the middle of the band, is part of the delay; the rest of the phase is the gain's.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from rfgen_sionna._types import SPEED_OF_LIGHT, ComplexArray, FloatArray, IntArray
from rfgen_sionna.scene.kernels import upload
from rfgen_sionna.scene.materials import Material
from rfgen_sionna.tracing.integral.obliquity import MAX_FRINGE
from rfgen_sionna.tracing.integral.simplex import Complex as ComplexPair

NO_SLAB = -1
"""Material index where a leg crosses no slab."""
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

    def lengths(self, crossed: IntArray, normals: FloatArray, k: FloatArray) -> FloatArray:
        """(..., facet) delay in slabs [m] along unit vectors `k` (..., facet, 3), through the slabs `crossed` (facet,
        depth) of `normals` (facet, depth, 3)."""
        cos = np.einsum("fdi,...fi->...fd", normals, k)
        sin2 = np.maximum(1.0 - cos * cos, 0.0)
        bulk = self.thickness[crossed] * np.sqrt(np.maximum(self.index2[crossed] - sin2, 0.0))
        return np.asarray(np.where(crossed == NO_SLAB, 0.0, bulk).sum(axis=-1))


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


@dataclass(frozen=True)
class SlabStack:
    """Slabs in order on one leg to each facet. Raises ValueError if `normals` and `crossed` do not match."""

    table: SlabTable
    crossed: IntArray
    """(facet, depth) material of the table, or `NO_SLAB`."""
    normals: FloatArray
    """(facet, depth, corner, 3) unit normals of the slabs on the ways to the facet's corners."""

    def __post_init__(self) -> None:
        if self.normals.shape != (*self.crossed.shape, 3, 3):  # a kernel would read out of bounds
            raise ValueError(f"normals: shape {self.normals.shape}, {(*self.crossed.shape, 3, 3)} is needed")


@dataclass(frozen=True)
class SlabStacks:
    """Slabs between an element and each facet."""

    before: SlabStack | None
    """Slabs between the element and the mirror of its leg."""
    behind: SlabStack | None
    """Slabs between the mirror, or the element of a direct leg, and the facet."""


class SlabLanes(NamedTuple):
    """One slab per lane."""

    normals: list[Any]
    """Unit normals on the ways to the facet's corners."""
    eps: Any
    mu: Any
    electric: Any
    """Wavenumber times thickness; 0 without a slab."""
    thickness: Any
    index2: Any
    internal_reflections: Any
    there: Any

    def across(self, dr: Any, weights: Sequence[Any] | None = None) -> Any:
        """Unit normal on the way to barycentric coordinates `weights` of the facet; None means its middle."""
        one, other, third = self.normals
        if weights is not None:
            one, other, third = weights[0] * one, weights[1] * other, weights[2] * third
        total = one + other + third
        return total / dr.maximum(dr.norm(total), 1e-12)


class SlabStackLanes(NamedTuple):
    """:class:`SlabStacks` of each lane; `before` holds mirror images, in the frame of the element's image."""

    before: list[SlabLanes]
    behind: list[SlabLanes]


def slab_stack_tables(dr: Any, types: Any, slab_stacks: SlabStacks, frequencies: FloatArray) -> dict[str, Any]:
    """Arrays of `slab_stacks` on the device at node `frequencies` (node,) [Hz], for :func:`slab_stacks_of_lanes`."""
    sides = {"before": slab_stacks.before, "behind": slab_stacks.behind}
    return {name: _slab_tables(dr, types, slabs, frequencies) for name, slabs in sides.items() if slabs is not None}


def _slab_tables(dr: Any, types: Any, slabs: SlabStack, frequencies: FloatArray) -> dict[str, Any]:
    Float, UInt32 = types.Float64, types.UInt32
    table = slabs.table
    eps = np.stack([each.relative_permittivity(frequencies) for each in table.materials], axis=1)
    eps = np.where(np.isfinite(eps), eps, 1.0)
    mu = np.array([complex(each.permeability) for each in table.materials])
    depth = slabs.crossed.shape[1]
    return {
        "count": dr.opaque(UInt32, len(table.materials)),
        "eps_re": upload(Float, eps.real),
        "eps_im": upload(Float, eps.imag),
        "mu_re": upload(Float, mu.real),
        "mu_im": upload(Float, mu.imag),
        "thickness": upload(Float, table.thickness),
        "index2": upload(Float, table.index2),
        "internal_reflections": upload(Float, table.internal_reflections),
        "levels": [
            {
                "crossed": upload(UInt32, np.maximum(slabs.crossed[:, level], 0).astype(np.uint32)),
                "present": upload(Float, slabs.crossed[:, level] != NO_SLAB),
                "normals": upload(Float, slabs.normals[:, level]),
            }
            for level in range(depth)
        ],
    }


def slab_stacks_of_lanes(
    dr: Any,
    types: Any,
    slab_stacks: dict[str, Any],
    mirrored: Callable[[Any], Any],
    facet: Any,
    node: Any,
    wavenumber: Any,
) -> SlabStackLanes:
    """Slabs of each lane, from :func:`slab_stack_tables`; `mirrored` is the mirror image of a direction."""

    def values(numbers: Any, index: Any) -> Any:
        return dr.gather(types.Float64, numbers, index)

    def lanes(tables: dict[str, Any], level: dict[str, Any]) -> SlabLanes:
        material, there = dr.gather(types.UInt32, level["crossed"], facet), values(level["present"], facet)
        entry = node * tables["count"] + material
        thickness = values(tables["thickness"], material) * there
        return SlabLanes(
            [
                types.Array3f64(*(values(level["normals"], facet * 9 + 3 * corner + axis) for axis in range(3)))
                for corner in range(3)
            ],
            types.Complex2f64(values(tables["eps_re"], entry), values(tables["eps_im"], entry)),
            types.Complex2f64(values(tables["mu_re"], material), values(tables["mu_im"], material)),
            wavenumber * thickness,
            thickness,
            values(tables["index2"], material),
            values(tables["internal_reflections"], material),
            there > 0.5,
        )

    before, behind = (
        [lanes(slab_stacks[side], level) for level in slab_stacks[side]["levels"]] if side in slab_stacks else []
        for side in ("before", "behind")
    )
    return SlabStackLanes([slab._replace(normals=[mirrored(each) for each in slab.normals]) for slab in before], behind)


def slab_delay_length(dr: Any, crossed: SlabStackLanes, k: Any) -> Any:
    """Delay in slabs [m] along unit vectors `k`."""
    total = 0.0
    for slab in (*crossed.before, *crossed.behind):
        cos = dr.dot(slab.across(dr), k)
        sin2 = dr.maximum(1.0 - cos * cos, 0.0)
        total = total + slab.thickness * dr.sqrt(dr.maximum(slab.index2 - sin2, 0.0))
    return total


def _coefficients(dr: Any, complex_type: Any, slab: SlabLanes, across: Any) -> tuple[Any, Any]:
    """T of s and p polarisation along k, with `across` = k x n; 1 without a slab."""
    sin2 = dr.minimum(dr.dot(across, across), 1.0)
    cos = dr.maximum(dr.sqrt(1.0 - sin2), 1e-9)
    root = dr.sqrt(slab.eps * slab.mu - sin2)
    root = dr.select(root.imag > 0, -root, root)
    size = dr.exp(slab.electric * root.imag)
    sin, cos_q = dr.sincos(slab.electric * root.real)
    once = complex_type(size * cos_q, -size * sin)

    def through(face: Any) -> Any:
        r = (face * cos - root) / (face * cos + root)
        below = 1.0 - r * r * once * once * slab.internal_reflections
        return dr.select(slab.there, (1.0 - r * r) * once / below, complex_type(1.0, 0.0))

    return through(slab.mu), through(slab.eps)


def field_by_polarisation(dr: Any, field_re: Any, field_im: Any, across: Any, t_s: Any, t_p: Any) -> tuple[Any, Any]:
    """Field, real and imaginary part, after an interface: t_p e + (t_s - t_p) (e . a) a / |a|^2, `across` a = k x n."""
    both = t_s - t_p
    share = ComplexPair(dr.dot(field_re, across), dr.dot(field_im, across))
    share = ComplexPair(both.real, both.imag).times(share).scaled(1.0 / dr.maximum(dr.dot(across, across), 1e-18))
    return (
        t_p.real * field_re - t_p.imag * field_im + share.re * across,
        t_p.real * field_im + t_p.imag * field_re + share.im * across,
    )


def transmitted_field(
    dr: Any, complex_type: Any, slabs: list[SlabLanes], weights: Sequence[Any], k: Any, field_re: Any, field_im: Any
) -> tuple[Any, Any]:
    """Field, real and imaginary part, after `slabs` along `k`, at barycentric coordinates `weights` of the facet."""
    for slab in slabs:
        across = dr.cross(k, slab.across(dr, weights))
        t_s, t_p = _coefficients(dr, complex_type, slab, across)
        field_re, field_im = field_by_polarisation(dr, field_re, field_im, across, t_s, t_p)
    return field_re, field_im
