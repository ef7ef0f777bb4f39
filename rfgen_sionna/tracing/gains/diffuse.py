"""Diffuse returns of rough surfaces: S^2 of the reflected energy, with a random phase per facet.

A facet of area A returns, relative to free-space propagation,

    |a|^2 = (lambda / 4 pi)^2 S^2 |Gamma|^2 cos(theta_i) f A / (R_t R_r)^2

with the scattering pattern f, as Sionna's paths do per ray, and the reflectance |Gamma|^2 for the Tx element's
polarisation. cos(theta_i) f and |Gamma|^2 are geometric means of both ways, for reciprocity. The phase follows from the
seed and persists. Where facets change over time it belongs to *grains*, pieces of faces that do not depend on the
viewpoint: a grain scatters from its middle with its whole area, and each of its facets has a share.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import NamedTuple

import numpy as np

from rfgen_sionna._types import SPEED_OF_LIGHT, ComplexArray, FloatArray
from rfgen_sionna.scene.materials import Material
from rfgen_sionna.tracing.integral.slabs import face_reflection
from rfgen_sionna.tracing.surface.facets import Facets, mix_bits
from rfgen_sionna.tracing.surface.surfaces import Surface

GRAIN, STATIC_GRAIN = 0.05, 0.2
"""Longest edge of grains [m], of actors and of static surfaces: speckle changes over wavelength / (2 x edge)."""


def grain_of(surface: Surface) -> float | None:
    """Longest edge [m] of a surface's grains; None for a smooth surface."""
    if surface.material.scattering_coefficient == 0:
        return None
    return STATIC_GRAIN if surface.still else GRAIN


def diffuse_gains(
    facets: Facets,
    materials: Sequence[Material],
    ends: tuple[FloatArray, FloatArray],
    fields: tuple[FloatArray, FloatArray],
    frequency: float,
    seed: int,
) -> ComplexArray | None:
    """(tx, rx, facet) diffuse gains without the propagation phase, for the `materials` of the facets' surfaces; None
    without rough surfaces.

    `ends` are positions [m] of elements (tx, 3) and (rx, 3), one of which may stand for a small array, `fields` their
    electric field (3,), `frequency` is in Hz, and `seed` that of the phases.
    """
    rough = np.array([material.scattering_coefficient for material in materials])
    if not rough.any():
        return None
    gains = np.zeros((len(ends[0]), len(ends[1]), len(facets)), dtype=np.complex128)
    for number in np.flatnonzero(rough).tolist():
        index = np.flatnonzero(facets.surface == number)
        corners, material = facets.corners[index], materials[number]
        cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        size, middle = np.linalg.norm(cross, axis=1), corners.mean(axis=1)
        normal = cross / np.maximum(size, 1e-30)[:, None]
        views = [
            [_ElementView.of(middle - place, normal, material, field, frequency) for place in own]
            for own, field in zip(ends, fields, strict=True)
        ]
        phases = 2 * np.pi * _draws(facets.face[index], facets.place[index], number, seed)
        co_share, cross_share = np.sqrt(1.0 - material.xpd_coefficient), np.sqrt(material.xpd_coefficient)
        area = 0.5 * size
        if facets.grain is not None:  # facets of a grain scatter in phase
            area = area * facets.grain[index, 0]
        for (i, there), (j, back) in product(enumerate(views[0]), enumerate(views[1])):
            energy = rough[number] ** 2 * np.sqrt(there.share * back.share * there.cos * back.cos) * area
            energy *= there.side == back.side
            upright = normal * there.side[:, None]
            one, other = (
                material.scattering_pattern(k_in.k, -k_out.k, upright) for k_in, k_out in ((there, back), (back, there))
            )
            energy *= np.sqrt(one * other) / (there.distance * back.distance) ** 2
            along = np.clip((there.field * back.field).sum(axis=1), -1.0, 1.0)
            field = co_share * along * np.exp(1j * phases[0]) + cross_share * np.sqrt(1.0 - along**2) * np.exp(
                1j * phases[1]
            )
            gains[i, j, index] = SPEED_OF_LIGHT / frequency / (4 * np.pi) * np.sqrt(energy) * field
    return gains


class _ElementView(NamedTuple):
    """Waves between one element and facets."""

    distance: FloatArray
    k: FloatArray
    """(facet, 3) unit vectors from the element."""
    side: FloatArray
    """(facet,) 1 where normals face it, -1 where they face away."""
    cos: FloatArray
    field: FloatArray
    """(facet, 3) unit fields of the waves."""
    share: FloatArray
    """(facet,) reflectance of a smooth surface."""

    @staticmethod
    def of(
        offset: FloatArray, normal: FloatArray, material: Material, field: FloatArray, frequency: float
    ) -> _ElementView:
        """Waves to facets at an `offset` (facet, 3) [m] from an element of electric field `field` (3,)."""
        distance = np.maximum(np.linalg.norm(offset, axis=1), 1e-4)
        k = offset / distance[:, None]
        inward = (normal * k).sum(axis=1)
        cos, transverse = np.clip(np.abs(inward), 0.0, 1.0), field - (k * field).sum(axis=1)[:, None] * k
        transverse = transverse / np.maximum(np.linalg.norm(transverse, axis=1, keepdims=True), 1e-9)
        aside = np.cross(k, normal)
        size = np.linalg.norm(aside, axis=1)
        across = np.where(size > 1e-9, (aside * transverse).sum(axis=1) / np.maximum(size, 1e-9), 0.0) ** 2
        one, other = reflectances(material, frequency, cos)
        share = across * one + (1.0 - across) * other
        return _ElementView(distance, k, -np.sign(inward), cos, transverse, share)


def reflectance(material: Material, frequency: float, cos: FloatArray) -> FloatArray:
    """(...) reflectance of a smooth surface at cosines `cos` (...) of incidence, mean of both polarisations."""
    one, other = reflectances(material, frequency, cos)
    return np.asarray(0.5 * (one + other))


def reflectances(material: Material, frequency: float, cos: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(...) reflectances of a smooth surface for s and p polarisation."""
    eps, mu = complex(material.relative_permittivity(frequency)), complex(material.relative_permeability(frequency))
    if not np.isfinite(eps):
        return np.ones_like(cos), np.ones_like(cos)
    root, *found = face_reflection(eps, mu, cos)
    if material.thickness is not None:
        trip = np.exp(-4j * np.pi * frequency / SPEED_OF_LIGHT * material.thickness * root)
        found = [r * (1.0 - trip) / np.where(abs(1.0 - r * r * trip) > 1e-12, 1.0 - r * r * trip, 1.0) for r in found]
    return np.asarray(abs(found[0]) ** 2), np.asarray(abs(found[1]) ** 2)


def _draws(face: np.ndarray, place: np.ndarray, surface: int, seed: int) -> FloatArray:
    """(2, facet) uniform numbers in 0 … 1 that depend on facet and seed alone (SplitMix64)."""
    with np.errstate(over="ignore"):
        key = face.astype(np.uint64) * np.uint64(0x9E3779B97F4A7C15) + place.astype(np.uint64)
        key = key * np.uint64(0xD1B54A32D192ED03) + np.uint64(seed) * np.uint64(0x8CB92BA72F3D8DD7)
        key = key + np.uint64(surface + 1) * np.uint64(0xABC98388FB8FAC03)
        keys = [key + np.uint64(turn + 1) * np.uint64(0x9E3779B97F4A7C15) for turn in range(2)]
    return np.stack([mix_bits(each).astype(np.float64) / 2.0**64 for each in keys])
