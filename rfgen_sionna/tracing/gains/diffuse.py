"""What rough surfaces return diffusely: S^2 of the reflected energy, with a phase of its own for every facet.

A facet of area A returns, per unit of what would reach the receiver without it,

    |a|^2 = (lambda / 4 pi)^2 S^2 |Gamma|^2 cos(theta_i) f A / (R_t R_r)^2

with the scattering pattern f (as Sionna's paths do, per area instead of per ray) and |Gamma|^2 the share that is
reflected of a wave polarised as the Tx element's is there. Of cos(theta_i) f and of |Gamma|^2 those of the way back
count as much, so that Tx and Rx may change places (Sionna takes the way there alone; of elements that are in one place,
and polarised alike, that is the same).

The phase is drawn from the seed for each facet and stays with it: diffuse returns stay coherent from chirp to chirp and
from frame to frame. Where facets are chosen anew, as what moves asks for others, it is drawn for *grains* instead:
pieces of faces that are the same from wherever they are seen. A grain scatters from its middle, with its whole area,
and each of the facets that it is divided into has its share of that.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import NamedTuple

import numpy as np

from rfgen_sionna._types import SPEED_OF_LIGHT, ComplexArray, FloatArray
from rfgen_sionna.scene.materials import Material
from rfgen_sionna.tracing.surface.facets import Facets, mix_bits
from rfgen_sionna.tracing.surface.surfaces import Surface

GRAIN, STATIC_GRAIN = 0.05, 0.2
"""Longest edge of grains [m], of actors and of what stays and is seen by a radar that moves: speckle changes over
wavelength / (2 x edge), 2 degrees at 77 GHz."""


def grain_of(surface: Surface) -> float | None:
    """Longest edge [m] of the grains of a surface; None where it is smooth."""
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
    """(tx, rx, facet) diffuse gains without the propagation phase; None where all is smooth.

    Parameters
    ----------
    facets, materials
        The facets, and the materials of their surfaces.
    ends
        (tx, 3) and (rx, 3) places [m] of elements; one of each stands for a whole array that is near it.
    fields
        (3,) directions of the Tx and Rx elements' electric field.
    frequency
        [Hz]
    seed
        Seed of the phases.
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
        occluders = [
            [_ElementView.of(middle - place, normal, material, field, frequency) for place in own]
            for own, field in zip(ends, fields, strict=True)
        ]
        phases = 2 * np.pi * _draws(facets.face[index], facets.place[index], number, seed)
        kept, turned = np.sqrt(1.0 - material.xpd_coefficient), np.sqrt(material.xpd_coefficient)
        area = 0.5 * size
        if facets.grain is not None:  # a grain's parts scatter in phase, as one
            area = area * facets.grain[index, 0]
        for (i, there), (j, back) in product(enumerate(occluders[0]), enumerate(occluders[1])):
            energy = rough[number] ** 2 * np.sqrt(there.share * back.share * there.cos * back.cos) * area
            energy *= there.side == back.side
            upright = normal * there.side[:, None]
            # Either way round, so that Tx and Rx may change places.
            one, other = (
                material.scattering_pattern(k_in.k, -k_out.k, upright) for k_in, k_out in ((there, back), (back, there))
            )
            energy *= np.sqrt(one * other) / (there.distance * back.distance) ** 2
            along = np.clip((there.field * back.field).sum(axis=1), -1.0, 1.0)
            field = kept * along * np.exp(1j * phases[0]) + turned * np.sqrt(1.0 - along**2) * np.exp(1j * phases[1])
            gains[i, j, index] = SPEED_OF_LIGHT / frequency / (4 * np.pi) * np.sqrt(energy) * field
    return gains


class _ElementView(NamedTuple):
    """How an element sees facets."""

    distance: FloatArray
    k: FloatArray
    """(facet, 3) unit vectors from the element."""
    side: FloatArray
    """(facet,) 1 where normals look at it, -1 where they look away."""
    cos: FloatArray
    field: FloatArray
    """(facet, 3) of its waves, of unit size."""
    share: FloatArray
    """(facet,) of their energy that a smooth surface reflects."""

    @staticmethod
    def of(
        offset: FloatArray, normal: FloatArray, material: Material, field: FloatArray, frequency: float
    ) -> _ElementView:
        """Of facets at an `offset` (facet, 3) [m] from an element whose field points along `field` (3,)."""
        distance = np.maximum(np.linalg.norm(offset, axis=1), 1e-4)
        k = offset / distance[:, None]
        inward = (normal * k).sum(axis=1)
        cos, e = np.clip(np.abs(inward), 0.0, 1.0), _across(field, k)
        share = _reflected(material, frequency, cos, k, normal, e)
        return _ElementView(distance, k, -np.sign(inward), cos, e, share)


def _across(field: FloatArray, k: FloatArray) -> FloatArray:
    """(facet, 3) the part of a `field` (3,) or (facet, 3) across directions `k` (facet, 3), of unit size."""
    part = field - (k * field).sum(axis=1)[:, None] * k
    return np.asarray(part / np.maximum(np.linalg.norm(part, axis=1, keepdims=True), 1e-9))


def _reflected(
    material: Material, frequency: float, cos: FloatArray, k: FloatArray, normal: FloatArray, field: FloatArray
) -> FloatArray:
    """(facet,) share of the energy that a smooth surface reflects of waves along `k` with unit fields (facet, 3)."""
    aside = np.cross(k, normal)
    size = np.linalg.norm(aside, axis=1)
    across = np.where(size > 1e-9, (aside * field).sum(axis=1) / np.maximum(size, 1e-9), 0.0) ** 2
    one, other = reflectances(material, frequency, cos)
    return np.asarray(across * one + (1.0 - across) * other)


def reflectance(material: Material, frequency: float, cos: FloatArray) -> FloatArray:
    """Share of the energy that a smooth surface reflects, mean of both polarisations; as the facet integral has it."""
    one, other = reflectances(material, frequency, cos)
    return np.asarray(0.5 * (one + other))


def reflectances(material: Material, frequency: float, cos: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Shares of the energy that a smooth surface reflects, field across the plane of incidence and in it."""
    eps, mu = complex(material.relative_permittivity(frequency)), complex(material.relative_permeability(frequency))
    if not np.isfinite(eps):
        return np.ones_like(cos), np.ones_like(cos)
    root = np.sqrt(eps * mu - (1.0 - cos**2) + 0j)
    root = np.where(root.imag > 0, -root, root)
    cos = np.maximum(cos, 1e-9)
    found = [(mu * cos - root) / (mu * cos + root), (eps * cos - root) / (eps * cos + root)]
    if material.thickness is not None:
        trip = np.exp(-4j * np.pi * frequency / SPEED_OF_LIGHT * material.thickness * root)
        found = [r * (1.0 - trip) / np.where(abs(1.0 - r * r * trip) > 1e-12, 1.0 - r * r * trip, 1.0) for r in found]
    return abs(found[0]) ** 2, abs(found[1]) ** 2


def _draws(face: np.ndarray, place: np.ndarray, surface: int, seed: int) -> FloatArray:
    """(2, facet) numbers in 0 … 1 that depend on the facet and the seed alone, not on the other facets (SplitMix64)."""
    with np.errstate(over="ignore"):
        key = face.astype(np.uint64) * np.uint64(0x9E3779B97F4A7C15) + place.astype(np.uint64)
        key = key * np.uint64(0xD1B54A32D192ED03) + np.uint64(seed) * np.uint64(0x8CB92BA72F3D8DD7)
        key = key + np.uint64(surface + 1) * np.uint64(0xABC98388FB8FAC03)
        keys = [key + np.uint64(turn + 1) * np.uint64(0x9E3779B97F4A7C15) for turn in range(2)]
    return np.stack([mix_bits(each).astype(np.float64) / 2.0**64 for each in keys])
