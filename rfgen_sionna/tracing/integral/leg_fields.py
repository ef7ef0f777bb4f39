"""Fields of elements that arrive at a facet by way of mirrors and slabs, in scalar kernels.

An element behind a plane mirror of normal n has an image with the field f - 2 (f . n) n. For the image's direction k,
the transverse part e of its field, and a = k x n the mirror reflects

    -r_p e + (r_s + r_p) (e . a) a / |a|^2

and a slab transmits t_p e + (t_s - t_p) (e . a) a / |a|^2 with (ITU-R P.2040, eq. 43)

    T = (1 - r^2) exp(-j q) / (1 - r^2 exp(-2 j q)),   q = k d sqrt(eps mu - sin^2).

Both are smooth through normal incidence and the same for both senses of k. The delay of a slab's bulk, d sqrt(Re eps mu
- sin^2) / c at the middle of the band, is part of the path's delay; the rest of the phase is the gain's.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from rfgen_sionna._types import FloatArray, IntArray
from rfgen_sionna.tracing.integral.fresnel import (
    both_ways,
    cross,
    dot,
    minus,
    norm,
    plus,
    reflection,
    scaled,
    transverse,
    unit,
)
from rfgen_sionna.tracing.integral.phasor_moments import FAST

MAX_MIRRORS = 2
"""Largest number of mirrors on a leg."""
_MIN_DISTANCE = 1e-4
_MIN_COSINE = 1e-3


class LegTables(NamedTuple):
    """Legs from Tx and to Rx, of all facets of a call; normals are those in the frame of the images."""

    views: FloatArray
    """(2, 3) images of the phase centre [m] relative to it."""
    mirrors: IntArray
    """(2,) number of mirrors."""
    normals: FloatArray
    """(2, mirror, 3) normals of the mirrors from the element on."""
    media: FloatArray
    """(node, 2, mirror, 7) of :func:`rfgen_sionna.tracing.integral.fresnel.media_table`."""
    planes: FloatArray
    """(plane, 4) n and d of half-spaces n . x >= d that the legs reach."""
    slab: IntArray
    """(2, chosen, depth) material of each slab from the element on, -1 for none."""
    segment: IntArray
    """(2, chosen, depth) number of mirrors before the slab."""
    slab_normals: FloatArray
    """(2, chosen, depth, 3)"""
    cover: FloatArray
    """(2, chosen, depth) share of the facet behind the slab."""
    slab_media: FloatArray
    """(node, material, 4) real and imaginary relative permittivity and permeability."""
    slab_table: FloatArray
    """(material, 3) thickness [m], squared refractive index of the bulk, and 1 with reflections between the faces."""

    @staticmethod
    def direct() -> LegTables:
        """Direct legs in free space."""
        none = np.zeros((2, 0, 0), np.int32)
        return LegTables(
            np.zeros((2, 3)), np.zeros(2, np.int32), np.zeros((2, 0, 3)), np.zeros((0, 2, 0, 7)), np.zeros((0, 4)),
            none, none, np.zeros((2, 0, 0, 3)), np.zeros((2, 0, 0)), np.zeros((0, 0, 4)), np.zeros((0, 3)),
        )  # fmt: skip

    def at(self, nodes: NDArray[np.intp]) -> LegTables:
        """The same for some of the nodes."""
        return self._replace(
            media=self.media[nodes] if len(self.media) else self.media,
            slab_media=self.slab_media[nodes] if len(self.slab_media) else self.slab_media,
        )


@njit(fastmath=FAST, error_model="numpy")
def _by_polarisation(field: Any, across: Any, s: complex, p: complex) -> Any:
    """p e + (s - p) (e . a) a / |a|^2 of a complex `field` e and `across` a."""
    share = dot(field, across) * (s - p) / max(dot(across, across), 1e-18)
    return plus(scaled(field, p), scaled(across, share))


@njit(fastmath=FAST, error_model="numpy")
def transmission(eps: complex, mu: complex, electric: float, inner: float, cosine: float, sine2: float) -> Any:
    """T of s and p polarisation of a slab of thickness times wavenumber `electric`; `inner` is 1 with reflections
    between the faces, else 0."""
    c = max(cosine, 1e-9)
    root = np.sqrt(eps * mu - sine2)
    if root.imag > 0.0:
        root = -root
    once = np.exp(complex(0.0, -1.0) * electric * root)
    r_s, r_p = (mu * c - root) / (mu * c + root), (eps * c - root) / (eps * c + root)
    return (
        (1.0 - r_s * r_s) * once / (1.0 - inner * r_s * r_s * once * once),
        (1.0 - r_p * r_p) * once / (1.0 - inner * r_p * r_p * once * once),
    )


@njit(fastmath=FAST, error_model="numpy")
def _bulk(thickness: float, index2: float, cosine: float) -> float:
    """Delay of a slab [m]."""
    return thickness * np.sqrt(max(index2 - max(1.0 - cosine * cosine, 0.0), 0.0))


@njit(fastmath=FAST, error_model="numpy")
def slab_length(legs: Any, side: int, q: int, k: Any) -> float:
    """Delay in slabs [m] along `k` on one leg to facet `q`."""
    total = 0.0
    for depth in range(legs.slab.shape[2]):
        material = legs.slab[side, q, depth]
        if material >= 0:
            n = legs.slab_normals[side, q, depth]
            thickness, index2 = legs.slab_table[material, 0], legs.slab_table[material, 1]
            total += legs.cover[side, q, depth] * _bulk(thickness, index2, dot((n[0], n[1], n[2]), k))
    return total


@njit(fastmath=FAST, error_model="numpy")
def _leg_field(legs: Any, side: int, node: int, q: int, wavenumber: float, k: Any, element: Any) -> Any:
    """Complex field along `k` at facet `q` per unit of the transverse field of an image of the `element`."""
    own = transverse(element, k)
    field = (complex(own[0]), complex(own[1]), complex(own[2]))
    for place in range(legs.mirrors[side] + 1):
        for depth in range(legs.slab.shape[2]):
            material = legs.slab[side, q, depth]
            if material < 0 or legs.segment[side, q, depth] != place:
                continue
            normal = legs.slab_normals[side, q, depth]
            n = (normal[0], normal[1], normal[2])
            across, cosine = cross(k, n), abs(dot(k, n))
            medium, slab = legs.slab_media[node, material], legs.slab_table[material]
            t_s, t_p = transmission(
                complex(medium[0], medium[1]), complex(medium[2], medium[3]), wavenumber * slab[0], slab[2], cosine,
                min(dot(across, across), 1.0),
            )  # fmt: skip
            # The bulk is in the delay; a facet that is covered in part returns by both ways.
            cover, bulk = legs.cover[side, q, depth], wavenumber * _bulk(slab[0], slab[1], cosine)
            back = np.exp(complex(0.0, cover * bulk))
            free = (1.0 - cover) * back
            field = _by_polarisation(field, across, free + cover * back * t_s, free + cover * back * t_p)
        if place < legs.mirrors[side]:
            normal = legs.normals[side, place]
            n = (normal[0], normal[1], normal[2])
            across = cross(k, n)
            sine2 = min(dot(across, across), 1.0)
            r_s, r_p = reflection(legs.media[node, side, place], wavenumber, np.sqrt(1.0 - sine2), sine2)
            field = _by_polarisation(field, across, r_s, -r_p)
    return field


@njit(fastmath=FAST, error_model="numpy")
def leg_obliquity(
    medium: Any, wavenumber: float, normal: Any, point: Any, tx: Any, rx: Any, direction: Any, tx_field: Any,
    rx_field: Any, legs: Any, node: int, q: int,
) -> complex:  # fmt: skip
    """Obliquity over the product of the distances [1/m^2] at a `point` of facet `q`, per cosine to the `direction`,
    with images `tx` and `rx` [m] of the elements."""
    from_tx, to_rx = minus(point, tx), minus(rx, point)
    spread = norm(from_tx) * norm(to_rx)
    if spread < _MIN_DISTANCE**2:
        return 0j
    k_in, k_out = unit(from_tx), unit(to_rx)
    if dot(normal, k_in) >= 0.0 or dot(normal, k_out) <= 0.0:
        return 0j
    e_tx = _leg_field(legs, 0, node, q, wavenumber, k_in, tx_field)
    e_rx = _leg_field(legs, 1, node, q, wavenumber, k_out, rx_field)
    mean = both_ways(medium, wavenumber, normal, k_in, e_tx, k_out, e_rx)
    return mean / (spread * max(-dot(direction, normal), _MIN_COSINE))
