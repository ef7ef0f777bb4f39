"""What a facet's surface does to the field: Fresnel coefficients of both polarisations and the currents they make.

Physical optics takes the currents from the incident side alone and so is not reciprocal where Tx and Rx lie in
different directions. The obliquity used is therefore the mean of both ways, Tx to Rx and Rx to Tx: the same where
physical optics is exact (one place for both, the specular direction), and reciprocal everywhere.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from rfgen_sionna._types import SPEED_OF_LIGHT, ComplexArray, FloatArray, IntArray
from rfgen_sionna.scene.kernels import drjit_types, upload
from rfgen_sionna.scene.materials import Material
from rfgen_sionna.tracing.integral.simplex import Complex as ComplexPair

MAX_FRINGE = 3.0
"""Phase [rad] that half the band may turn the echo of a slab's back face by, against its front's."""

FREQUENCY_STEP = 1e-4
"""Share of the frequency over which the change of what is reflected is differenced."""
_SIGNIFICANT = 0.01
"""Share of what a facet's obliquity might be above which its change over itself tells anything."""
_MIN_ACROSS = 1e-36
"""Squares of the sines of the angles to the elements' fields, multiplied, up to which there is no direction across: for
like fields 1e-9 rad."""
_NEAREST = 1e-4
"""Distance [m] that nearer elements count as there."""


@dataclass(frozen=True)
class Media:
    """What facets are made of, at every node."""

    permittivity: ComplexArray
    """(node, material) relative, conductivity included as -j sigma/(omega eps0); an infinite one is a perfect
    conductor."""
    permeability: ComplexArray
    """(node, material) relative."""
    thickness: FloatArray
    """(material,) of the slab that a facet stands for [m]; infinite is a half-space."""
    smoothness: FloatArray
    """(material,) share sqrt(1 - S^2) of the reflected field that stays coherent on a rough surface."""
    raised: ComplexArray | None = None
    """(node, material) relative permittivity at frequencies higher by `FREQUENCY_STEP`; None is that it is the same."""

    @staticmethod
    def at(materials: Sequence[Material], frequencies: FloatArray, half_band: float = 0.0) -> Media:
        """Media of `materials` at node frequencies (node,) [Hz]; the signal sweeps `half_band` [Hz] to both sides.

        A slab whose back face returns an echo of its own, later than what the band blurs (`MAX_FRINGE`), counts as a
        half-space: its front's return is what the facet stands for.
        """
        shape = (len(frequencies), len(materials))
        permittivity, permeability = np.empty((2, *shape), np.complex128), np.empty(shape, np.complex128)
        known: dict[int, int] = {}  # a town has thousands of objects and a few materials
        for number, material in enumerate(materials):
            first = known.setdefault(id(material.model), number)
            permeability[:, number] = material.permeability
            if first < number and materials[first].outside == material.outside:
                permittivity[..., number] = permittivity[..., first]
                continue
            # A band may end where what is known does.
            beyond = replace(material, outside="extrapolate") if material.outside == "raise" else material
            permittivity[0, :, number] = material.relative_permittivity(frequencies)
            permittivity[1, :, number] = beyond.relative_permittivity((1.0 + FREQUENCY_STEP) * np.asarray(frequencies))
        thickness = np.array([np.inf if each.thickness is None else each.thickness for each in materials])
        if len(frequencies):
            index = np.sqrt(np.abs(permittivity[0, 0]) * np.abs(permeability[0]))  # either may be infinite
            slab = np.where(np.isfinite(thickness) & np.isfinite(index), thickness, 0.0)
            fringe = 4 * np.pi * half_band / SPEED_OF_LIGHT * np.where(np.isfinite(index), index, 0.0) * slab
            thickness = np.where(fringe > MAX_FRINGE, np.inf, thickness)
        rough = np.array([each.scattering_coefficient for each in materials])
        raised = None if np.array_equal(*permittivity) else permittivity[1]
        return Media(permittivity[0], permeability, thickness, np.sqrt(1.0 - rough**2), raised)

    @property
    def slabs(self) -> bool:
        """Whether any facet stands for a slab."""
        return bool(np.isfinite(self.thickness).any())

    def mean(self) -> Media:
        """Their mean over the nodes, as that of a single one."""

        def over_nodes(values: ComplexArray) -> ComplexArray:
            finite = np.isfinite(values).all(axis=0)  # a perfect conductor is one at all of them
            return np.where(finite, np.mean(np.where(finite, values, 0.0), axis=0), values[0])[None]

        raised = None if self.raised is None else over_nodes(self.raised)
        return Media(
            over_nodes(self.permittivity), over_nodes(self.permeability), self.thickness, self.smoothness, raised
        )

    @property
    def drifted(self) -> Media | None:
        """What they are at frequencies higher by `FREQUENCY_STEP`; None where what they reflect stays the same over
        the band, as
        permittivities do and there are no slabs."""
        if self.raised is not None:
            return replace(self, permittivity=self.raised)
        return self if self.slabs else None


class Medium(NamedTuple):
    """The material of each lane."""

    permittivity: Any
    permeability: Any
    perfect: Any
    smoothness: Any
    electric_thickness: Any
    """Wavenumber times thickness [rad]; None where all are half-spaces."""
    thick: Any
    """Whether a lane is a half-space."""


def media_tables(dr: Any, types: Any, media: Media) -> dict[str, Any]:
    """`media` on the device, for :func:`media_of_lanes`."""
    Float = types.Float64
    conductor = ~np.isfinite(media.permittivity)
    eps, mu = np.where(conductor, 1.0, media.permittivity), np.where(conductor, 1.0, media.permeability)
    half_space = ~np.isfinite(media.thickness)
    found = {
        "count": dr.opaque(types.UInt32, media.permittivity.shape[1]),
        "eps_re": upload(Float, eps.real),
        "eps_im": upload(Float, eps.imag),
        "mu_re": upload(Float, mu.real),
        "mu_im": upload(Float, mu.imag),
        "perfect": upload(Float, conductor),
        "smoothness": upload(Float, media.smoothness),
    }
    if not half_space.all():
        found |= {
            "thickness": upload(Float, np.where(half_space, 0.0, media.thickness)),
            "thick": upload(Float, half_space),
        }
    return found


def media_of_lanes(dr: Any, types: Any, media: dict[str, Any], node: Any, material: Any, wavenumber: Any) -> Medium:
    """Of each lane, from :func:`media_tables`."""
    Complex = types.Complex2f64
    entry = node * media["count"] + material

    def table(name: str, index: Any) -> Any:
        return dr.gather(types.Float64, media[name], index)

    electric, thick = None, None
    if "thickness" in media:
        electric, thick = wavenumber * table("thickness", material), table("thick", material) > 0.5
    return Medium(
        Complex(table("eps_re", entry), table("eps_im", entry)),
        Complex(table("mu_re", entry), table("mu_im", entry)),
        table("perfect", entry) > 0.5,
        table("smoothness", material),
        electric,
        thick,
    )


class ScatteredWave:
    """A plane wave of unit field `e_in` along `k_in` on a facet, received along `k_out` by an element of field `e_out`.

    Holds half of e_out . (k_out x (E x n) + k_out x (k_out x (n x eta H))) for the incident wave and for reflected ones
    of unit coefficient in both polarisations.
    """

    def __init__(self, dr: Any, vector: Any, normal: Any, k_in: Any, e_in: Any, k_out: Any, e_out: Any) -> None:
        self.cos = dr.clip(-dr.dot(k_in, normal), 0.0, 1.0)
        s_raw = dr.cross(k_in, normal)
        self.sin = dr.norm(s_raw)
        # At normal incidence the plane of incidence is free: any direction across will do.
        spare = dr.cross(dr.select(dr.abs(normal.x) < 0.6, vector(1, 0, 0), vector(0, 1, 0)), normal)
        s = dr.select(self.sin > 1e-9, s_raw / dr.maximum(self.sin, 1e-9), dr.normalize(spare))
        k_reflected = k_in + 2.0 * self.cos * normal
        p_in, p_reflected = dr.cross(s, k_in), dr.cross(s, k_reflected)
        # e . (k x (E x n)) = E . (n x (e x k)) and e . (k x (k x J)) = -e . J, for e across k.
        of_electric, of_current = dr.cross(normal, dr.cross(e_out, k_out)), dr.cross(normal, e_out)

        def received(field: Any, direction: Any) -> Any:
            return 0.5 * (dr.dot(field, of_electric) + dr.dot(of_current, dr.cross(direction, field)))

        self._incident = received(e_in, k_in)
        self._s = dr.dot(e_in, s) * received(s, k_reflected)
        self._p = dr.dot(e_in, p_in) * received(p_reflected, k_reflected)

    def obliquity(self, dr: Any, complex_type: Any, medium: Medium) -> ComplexPair:
        """Incident plus Fresnel-reflected."""
        r_s, r_p = reflection(dr, complex_type, medium, self.cos, self.sin * self.sin)
        return ComplexPair(
            self._incident + r_s.real * self._s + r_p.real * self._p, r_s.imag * self._s + r_p.imag * self._p
        )


def backscatter(
    dr: Any, complex_type: Any, medium: Medium, normal: Any, offset: Any, tx_field: Any, rx_field: Any, nearest: Any
) -> ComplexPair:
    """Obliquity over the square of the distance, for Tx and Rx in one place from which a point lies at `offset` [m].

    The incident wave makes no return of its own there, and the reflected ones leave
    cos (r_s e_s e'_s - r_p e_p e'_p). One over the distance is `nearest` [1/m] at most.
    """
    # Quotients take several times as long as products: there is one where there might be three.
    inverse = 1.0 / dr.maximum(dr.norm(offset), 1e-30)
    k = offset * inverse
    cos = dr.clip(-dr.dot(k, normal), 0.0, 1.0)
    across = dr.cross(k, normal)
    sin2 = dr.dot(across, across)
    r_s, r_p = reflection(dr, complex_type, medium, cos, sin2)
    # Of the transverse parts of the fields, as long as these and turned by 90 degrees: their product is the same.
    e, f = dr.cross(tx_field, k), dr.cross(rx_field, k)
    squares = dr.squared_norm(e) * dr.squared_norm(f)
    size = dr.select(squares > _MIN_ACROSS, 1.0 / dr.sqrt(dr.maximum(squares, _MIN_ACROSS)), 0.0)
    along_s = dr.dot(tx_field, across) * dr.dot(rx_field, across) / dr.maximum(sin2, 1e-18)
    along_p = dr.dot(e, f) - along_s
    scale = cos * size * dr.square(dr.minimum(inverse, nearest))
    return ComplexPair(
        scale * (r_s.real * along_s - r_p.real * along_p), scale * (r_s.imag * along_s - r_p.imag * along_p)
    )


def dispersion(
    dr: Any,
    types: Any,
    media: tuple[dict[str, Any], dict[str, Any]],
    node: Any,
    material: Any,
    wavenumber: Any,
    normal: Any,
    offset: Any,
    fields: tuple[Any, Any],
) -> ComplexPair:
    """By how much :func:`backscatter` changes over the wavenumber, over itself [m], for what the media are made of
    alone: permittivities change, and slabs get thicker. `media` are those of :func:`media_tables`, as they are and at
    frequencies higher by `FREQUENCY_STEP`."""
    found = []
    for each, by in zip(media, (1.0, 1.0 + FREQUENCY_STEP), strict=True):
        medium = media_of_lanes(dr, types, each, node, material, by * wavenumber)
        found.append(backscatter(dr, types.Complex2f64, medium, normal, offset, *fields, 1.0 / _NEAREST))
    now, then = found
    size = now.re * now.re + now.im * now.im
    # Obliquity over the square of the distance is one over that at most.
    representative = size * dr.square(dr.maximum(dr.squared_norm(offset), _NEAREST**2)) > _SIGNIFICANT**2
    inverse = dr.select(representative, 1.0 / dr.select(representative, size, 1.0), 0.0) / (FREQUENCY_STEP * wavenumber)
    return (then - now).times(ComplexPair(now.re * inverse, -now.im * inverse))


def transverse(dr: Any, field: Any, direction: Any) -> Any:
    """Unit vector of the field's part across `direction`; zero where there is none."""
    across = field - dr.dot(field, direction) * direction
    size = dr.norm(across)
    return dr.select(size > 1e-9, across / dr.maximum(size, 1e-9), 0.0)


def reflection(dr: Any, complex_type: Any, medium: Medium, cos: Any, sin2: Any) -> tuple[Any, Any]:
    """Fresnel's r_s and r_p of the coherent field, of a half-space or a slab."""
    eps, mu = medium.permittivity, medium.permeability
    cos = dr.maximum(cos, 1e-9)  # grazing incidence on what is like air is 0 by 0
    root = dr.sqrt(eps * mu - sin2)
    root = dr.select(root.imag > 0, -root, root)  # a wave that decays into the material, exp(+j omega t)
    r_s = (mu * cos - root) / (mu * cos + root)
    r_p = (eps * cos - root) / (eps * cos + root)
    if medium.electric_thickness is not None:
        # The slab's two faces, and all that goes to and fro between them: ITU-R P.2040, eq. (43).
        turn = medium.electric_thickness * root * 2.0
        size = dr.select(medium.thick, 0.0, dr.exp(turn.imag))
        sin, cos_turn = dr.sincos(turn.real)
        trip = complex_type(size * cos_turn, -size * sin)
        r_s, r_p = (_slab(dr, r, trip) for r in (r_s, r_p))
    r_s = dr.select(medium.perfect, complex_type(-1, 0), r_s) * medium.smoothness
    r_p = dr.select(medium.perfect, complex_type(1, 0), r_p) * medium.smoothness
    return r_s, r_p


def _slab(dr: Any, r: Any, trip: Any) -> Any:
    """Reflection of a slab whose faces reflect `r`; `trip` is the phasor of the way through it and back."""
    below = 1.0 - r * r * trip
    # Nothing comes back from a slab of no thickness, at grazing incidence either.
    vanishing = below.real * below.real + below.imag * below.imag < 1e-24
    return dr.select(vanishing, 0.0, r * (1.0 - trip) / dr.select(vanishing, 1.0, below))


def strongest_reflection(
    materials: Sequence[Material], of: IntArray, cos: FloatArray, frequencies: FloatArray
) -> FloatArray:
    """(ray,) the largest |r_s| or |r_p| over `frequencies` [Hz] of material number `of` (ray,) at incidence `cos`."""
    dr, types = drjit_types()
    Float, UInt32 = types.Float64, types.UInt32
    shape = (len(frequencies), len(of))
    media = Media.at(materials, frequencies, 0.5 * float(np.ptp(frequencies)))
    wavenumber = Float(np.repeat(2 * np.pi / SPEED_OF_LIGHT * frequencies, len(of)))
    node = UInt32(np.repeat(np.arange(len(frequencies)), len(of)).astype(np.uint32))
    tables = media_tables(dr, types, media)
    medium = media_of_lanes(dr, types, tables, node, UInt32(np.tile(of, shape[0]).astype(np.uint32)), wavenumber)
    angle = Float(np.tile(np.clip(cos, 0.0, 1.0), shape[0]))
    r_s, r_p = reflection(dr, types.Complex2f64, medium, angle, 1.0 - angle * angle)
    sizes = [(r.real * r.real + r.imag * r.imag).numpy() for r in (r_s, r_p)]
    return np.asarray(np.sqrt(np.maximum(*sizes)).reshape(shape).max(axis=0), dtype=np.float64)
