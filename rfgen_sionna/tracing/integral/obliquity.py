"""Fresnel coefficients of a facet's surface, and the polarimetric obliquity of its currents.

Physical optics uses the currents of the incident side alone and is not reciprocal where Tx and Rx lie in different
directions. The obliquity here is the mean of both ways: the same where physical optics is exact (monostatic, specular),
and reciprocal everywhere.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from rfgen_sionna._types import SPEED_OF_LIGHT, ComplexArray, FloatArray
from rfgen_sionna.scene.kernels import upload
from rfgen_sionna.scene.materials import Material
from rfgen_sionna.tracing.integral.simplex import Complex as ComplexPair

MAX_FRINGE = 3.0
"""Phase [rad] of a slab's back face against its front over half the band, up to which both are one return."""

FREQUENCY_STEP = 1e-4
"""Relative step of the frequency for differences of the reflection."""
MIN_RELATIVE_STRENGTH = 0.01
"""Share of the largest possible strength from which its relative change is used."""
_MIN_SINE_PRODUCT = 1e-36
"""Product of the squared sines between direction and fields below which there is no transverse field: 1e-9 rad."""
_MIN_DISTANCE = 1e-4
"""Least distance [m] of an element: nearer ones count as there."""


@dataclass(frozen=True)
class Media:
    """Materials of facets at every node."""

    permittivity: ComplexArray
    """(node, material) relative, with conductivity as -j sigma/(omega eps0); infinite for a perfect conductor."""
    permeability: ComplexArray
    """(node, material) relative."""
    thickness: FloatArray
    """(material,) thickness of a slab [m]; infinite for a half-space."""
    smoothness: FloatArray
    """(material,) coherent share sqrt(1 - S^2) of the field that a rough surface reflects."""
    raised: ComplexArray | None = None
    """(node, material) relative permittivity at frequencies higher by `FREQUENCY_STEP`; None means unchanged."""

    @staticmethod
    def at(materials: Sequence[Material], frequencies: FloatArray, half_band: float = 0.0) -> Media:
        """Media of `materials` at node frequencies (node,) [Hz] of a band of `half_band` [Hz] to both sides. A slab
        whose back face the band resolves from its front (`MAX_FRINGE`) counts as a half-space."""
        shape = (len(frequencies), len(materials))
        permittivity, permeability = np.empty((2, *shape), np.complex128), np.empty(shape, np.complex128)
        known: dict[int, int] = {}
        for number, material in enumerate(materials):
            first = known.setdefault(id(material.model), number)
            permeability[:, number] = material.permeability
            if first < number and materials[first].outside == material.outside:
                permittivity[..., number] = permittivity[..., first]
                continue
            # The step may leave the material's frequency range.
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
        """Whether any material is a slab."""
        return bool(np.isfinite(self.thickness).any())

    def mean(self) -> Media:
        """Mean over the nodes, as media of one node."""

        def over_nodes(values: ComplexArray) -> ComplexArray:
            finite = np.isfinite(values).all(axis=0)
            return np.where(finite, np.mean(np.where(finite, values, 0.0), axis=0), values[0])[None]

        raised = None if self.raised is None else over_nodes(self.raised)
        means = over_nodes(self.permittivity), over_nodes(self.permeability)
        return Media(*means, self.thickness, self.smoothness, raised)

    @property
    def drifted(self) -> Media | None:
        """Media at frequencies higher by `FREQUENCY_STEP`; None where reflection is constant over the band."""
        if self.raised is not None:
            return replace(self, permittivity=self.raised)
        return self if self.slabs else None


class Medium(NamedTuple):
    """Material of each lane."""

    permittivity: Any
    permeability: Any
    perfect: Any
    smoothness: Any
    electric_thickness: Any
    """Wavenumber times thickness [rad]; None means half-spaces only."""
    thick: Any
    """Whether a lane is a half-space."""


def media_tables(dr: Any, types: Any, media: Media) -> dict[str, Any]:
    """Arrays of `media` on the device, for :func:`media_of_lanes`."""
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
    """Medium of each lane, from :func:`media_tables`."""
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
    """Plane wave of unit field `e_in` along `k_in` on a facet, received along `k_out` by an element of field `e_out`.
    Attributes are half of e_out . (k_out x (E x n) + k_out x (k_out x (n x eta H))), the Stratton-Chu integrand, for
    the incident wave and for reflected ones of unit coefficient in both polarisations."""

    def __init__(self, dr: Any, vector: Any, normal: Any, k_in: Any, e_in: Any, k_out: Any, e_out: Any) -> None:
        self.cos = dr.clip(-dr.dot(k_in, normal), 0.0, 1.0)
        s_raw = dr.cross(k_in, normal)
        self.sin = dr.norm(s_raw)
        # At normal incidence any direction across is s.
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
        """Obliquity of the incident plus the Fresnel-reflected wave."""
        r_s, r_p = reflection(dr, complex_type, medium, self.cos, self.sin * self.sin)
        return ComplexPair(
            self._incident + r_s.real * self._s + r_p.real * self._p, r_s.imag * self._s + r_p.imag * self._p
        )


def backscatter(
    dr: Any, complex_type: Any, medium: Medium, normal: Any, offset: Any, tx_field: Any, rx_field: Any, nearest: Any
) -> ComplexPair:
    """Obliquity over the squared distance, for Tx and Rx in one place at -`offset` [m] from a point."""
    # The reflected waves return cos (r_s e_s e'_s - r_p e_p e'_p); 1 / distance is at most `nearest` [1/m].
    inverse = 1.0 / dr.maximum(dr.norm(offset), 1e-30)
    k = offset * inverse
    cos = dr.clip(-dr.dot(k, normal), 0.0, 1.0)
    across = dr.cross(k, normal)
    sin2 = dr.dot(across, across)
    r_s, r_p = reflection(dr, complex_type, medium, cos, sin2)
    # Transverse fields, turned by 90 degrees: the product of two is the same.
    e, f = dr.cross(tx_field, k), dr.cross(rx_field, k)
    squares = dr.squared_norm(e) * dr.squared_norm(f)
    size = dr.select(squares > _MIN_SINE_PRODUCT, 1.0 / dr.sqrt(dr.maximum(squares, _MIN_SINE_PRODUCT)), 0.0)
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
    """Relative change of :func:`backscatter` per wavenumber [m] by the media alone. `media` are two results of
    :func:`media_tables`: at the frequency, and higher by `FREQUENCY_STEP`."""
    found = []
    for each, by in zip(media, (1.0, 1.0 + FREQUENCY_STEP), strict=True):
        medium = media_of_lanes(dr, types, each, node, material, by * wavenumber)
        found.append(backscatter(dr, types.Complex2f64, medium, normal, offset, *fields, 1.0 / _MIN_DISTANCE))
    now, then = found
    size = now.re * now.re + now.im * now.im
    # The largest possible strength is the inverse squared distance.
    representative = size * dr.square(dr.maximum(dr.squared_norm(offset), _MIN_DISTANCE**2)) > MIN_RELATIVE_STRENGTH**2
    inverse = dr.select(representative, 1.0 / dr.select(representative, size, 1.0), 0.0) / (FREQUENCY_STEP * wavenumber)
    return (then - now).times(ComplexPair(now.re * inverse, -now.im * inverse))


def transverse(dr: Any, field: Any, direction: Any) -> Any:
    """Unit vector of the part of a field across `direction`; zero where there is none."""
    across = field - dr.dot(field, direction) * direction
    size = dr.norm(across)
    return dr.select(size > 1e-9, across / dr.maximum(size, 1e-9), 0.0)


def reflection(dr: Any, complex_type: Any, medium: Medium, cos: Any, sin2: Any) -> tuple[Any, Any]:
    """Fresnel's r_s and r_p of the coherent field, of a half-space or a slab (ITU-R P.2040, eq. 43)."""
    eps, mu = medium.permittivity, medium.permeability
    cos = dr.maximum(cos, 1e-9)  # grazing incidence on air is 0 by 0
    root = dr.sqrt(eps * mu - sin2)
    root = dr.select(root.imag > 0, -root, root)  # decay into the material, exp(+j omega t)
    r_s = (mu * cos - root) / (mu * cos + root)
    r_p = (eps * cos - root) / (eps * cos + root)
    if medium.electric_thickness is not None:
        turn = medium.electric_thickness * root * 2.0
        size = dr.select(medium.thick, 0.0, dr.exp(turn.imag))
        sin, cos_turn = dr.sincos(turn.real)
        trip = complex_type(size * cos_turn, -size * sin)
        r_s, r_p = (_slab(dr, r, trip) for r in (r_s, r_p))
    r_s = dr.select(medium.perfect, complex_type(-1, 0), r_s) * medium.smoothness
    r_p = dr.select(medium.perfect, complex_type(1, 0), r_p) * medium.smoothness
    return r_s, r_p


def _slab(dr: Any, r: Any, trip: Any) -> Any:
    """Reflection of a slab of face reflection `r` and round-trip phasor `trip`."""
    below = 1.0 - r * r * trip
    # A slab without thickness reflects nothing, at grazing incidence too.
    vanishing = below.real * below.real + below.imag * below.imag < 1e-24
    return dr.select(vanishing, 0.0, r * (1.0 - trip) / dr.select(vanishing, 1.0, below))
